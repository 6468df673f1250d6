//! How far the trials of a calibration reached, and which trials ask for more: there a model extrapolates.

use crate::coordinate::{AP, Coordinate, FE, FREE, Free, IE, ML, SI, VV};
use crate::laxity::LaxityTrial;
use crate::spec::ReachSpec;

/// A trial asks for more when its flexion lies so far beyond the calibration's [deg]. Ours: as far as trials of one position lie apart.
const FLEXION_SPARE_DEG: f64 = 5.0;
/// A trial asks for more when its load lies beyond the calibration's by this part of it [-], and by [`LOAD_SPARE`]. Ours: little more bends no law.
const LOAD_SPARE_SHARE: f64 = 0.1;
/// Moments [N m] and forces [N] that are nothing: what hands and robots hold a load to. Ours.
const LOAD_SPARE: [f64; 2] = [0.5, 5.0];

/// What a trial asks for beyond a calibration's trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Flexion, or the coordinate along which the load acts.
    pub coordinate: Coordinate,
    /// What the trial asks for [deg, N m, N].
    pub asked: f64,
    /// The farthest of the calibration's trials on that side.
    pub reached: f64,
}

impl ReachSpec {
    /// The reach of trials; none of no trials.
    pub fn of<'a>(trials: impl IntoIterator<Item = &'a LaxityTrial>) -> Option<ReachSpec> {
        let (mut flexion, mut loads) =
            ([f64::INFINITY, f64::NEG_INFINITY], Free::all([f64::INFINITY, f64::NEG_INFINITY]));
        let widen = |range: &mut [f64; 2], x: f64| *range = [range[0].min(x), range[1].max(x)];
        for trial in trials {
            widen(&mut flexion, trial.fe_deg);
            FREE.into_iter().for_each(|c| widen(&mut loads[c], trial.load[c]));
        }
        let [vv_nm, ie_nm, ml_n, ap_n, si_n] = [VV, IE, ML, AP, SI].map(|c| loads[c]);
        flexion[0].is_finite().then_some(ReachSpec { flexion_deg: flexion, vv_nm, ie_nm, ml_n, ap_n, si_n })
    }

    /// The range of a coordinate: of flexion, or of the load along it.
    fn range(&self, c: Coordinate) -> [f64; 2] {
        let of = [(FE, self.flexion_deg), (VV, self.vv_nm), (IE, self.ie_nm), (ML, self.ml_n), (AP, self.ap_n)];
        of.into_iter().find(|(known, _)| *known == c).map_or(self.si_n, |(_, range)| range)
    }

    /// What a trial asks for beyond.
    pub fn beyond(&self, trial: &LaxityTrial) -> Vec<Beyond> {
        let asked = |c: Coordinate| if c == FE { trial.fe_deg } else { trial.load[c] };
        let over = |c: Coordinate| {
            let (asked, [low, high]) = (asked(c), self.range(c));
            let spare = |end: f64| match c {
                FE => FLEXION_SPARE_DEG,
                _ => (LOAD_SPARE_SHARE * end.abs()).max(LOAD_SPARE[usize::from(!c.turns())]),
            };
            let end = [low, high].into_iter().zip([asked < low - spare(low), asked > high + spare(high)]);
            end.filter(|(_, far)| *far).map(move |(reached, _)| Beyond { coordinate: c, asked, reached }).next()
        };
        std::iter::once(FE).chain(FREE).filter_map(over).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinate::Load;
    use crate::laxity::Test;

    fn trial(fe_deg: f64, load: Load) -> LaxityTrial {
        LaxityTrial::asked("t".into(), Test::Neutral, fe_deg, load)
    }

    fn beyond(reach: &ReachSpec, fe_deg: f64, load: Load) -> Vec<Coordinate> {
        reach.beyond(&trial(fe_deg, load)).iter().map(|b| b.coordinate).collect()
    }

    #[test]
    fn no_trial_of_a_calibration_is_beyond_it_and_what_is_is_told_on_its_side() {
        let all = [(0.0, 0.0, 133.0), (92.0, 0.0, -133.0), (30.0, 8.0, 0.0), (60.0, -10.0, 0.0)]
            .map(|(fe, vv, ap)| trial(fe, Load::new(vv, 0.0, 0.0, ap, 20.0)));
        let reach = ReachSpec::of(&all).unwrap();
        assert!(all.iter().all(|t| reach.beyond(t).is_empty()));
        assert!(beyond(&reach, 95.0, Load::compression(20.0)).is_empty());
        assert_eq!(beyond(&reach, 120.0, Load::compression(20.0)), [FE]);
        assert_eq!(beyond(&reach, -10.0, Load::compression(20.0)), [FE]);
        assert_eq!(beyond(&reach, 30.0, Load::new(9.9, 0.0, 0.0, 0.0, 20.0)), [VV]);
        assert!(beyond(&reach, 30.0, Load::new(-9.9, 0.0, 0.0, 0.0, 20.0)).is_empty());
        assert_eq!(beyond(&reach, 30.0, Load::new(0.0, 4.0, 0.0, -250.0, 500.0)), [IE, AP, SI]);
        let told = reach.beyond(&trial(120.0, Load::compression(20.0)))[0];
        assert_eq!((told.asked, told.reached), (120.0, 92.0));
        assert_eq!(ReachSpec::of(&[]), None);
    }
}
