//! Kinds of field: what one follows, in which coordinates, where.

use crate::effect::candidate::Scope;
use crate::effect::catalogue::Catalogue;
use crate::problem::Problem;
use sim::coordinate::{AP, Coordinate, FE, FREE, IE, ML, SI, Six, VV};

/// Amplitudes of the force field in the order of [`Six`]; flexion is prescribed, so any force in it is small [N mm, N].
const FORCES: [f64; 6] = [f64::INFINITY, 3000.0, 1000.0, 20.0, 20.0, 40.0];
/// Amplitudes of misreadings, flexion first [deg, mm].
const READINGS: [f64; 6] = [3.0, 2.0, 2.0, 2.0, 2.0, 2.0];
/// Loads that count as one, in the order of [`Six`]; flexion has none [N mm, N].
pub(super) const LOADS: [f64; 6] = [f64::INFINITY, 5000.0, 4000.0, 100.0, 100.0, 100.0];
/// The coordinates of a field, as sums run over them: the five of a reading, then flexion that is misread.
pub(super) const FIELD: [Coordinate; 6] = [VV, IE, ML, AP, SI, FE];
/// Shares of the farthest motion from which a stop resists [-].
const STOPS: [f64; 2] = [0.25, 0.6];
/// Distances of the cruciates' lines from which they press on each other [mm]: round cords of 39 and 58 mm^2 would touch at 8 mm [siebold2015; harner1995],
/// flat ones that meet edge on, and lines that are not in the middle, earlier.
const CORDS: [f64; 3] = [8.0, 11.0, 14.0];
/// The flexion that is neither near extension nor deep [rad].
pub(super) const MIDDLE: f64 = std::f64::consts::FRAC_PI_4;

/// A bone's frame of reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bone {
    /// The femur's.
    Femur,
    /// The tibia's.
    Tibia,
}

/// What a field follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// Nothing: the same in every trial.
    Constant,
    /// Flexion.
    Flexion,
    /// Flexion and the motion from the unloaded pose.
    Motion,
    /// The load along its coordinate.
    Load,
    /// The load along another.
    Across(Coordinate),
    /// The motion from the unloaded pose along its coordinate, in proportion: a reading of another scale.
    Scale,
    /// The motion from the unloaded pose one way (`sign`), beyond a share of the farthest that way: a one-sided stop.
    Stop {
        /// +1 or -1.
        sign: f64,
        /// Of the farthest motion [-].
        from: f64,
    },
    /// A pull along a line past the knee, toward the far end of the thigh (femur) or of the shank.
    Pull(Bone),
    /// Nearness to extension (largest there, nothing from [`MIDDLE`] on), or to deep flexion (nothing up to there).
    Near {
        /// Whether to deep flexion.
        bent: bool,
    },
    /// How bones larger than their surfaces would pull and press; `apart` where they would stand farther apart in the CT, too, as in one of a wrong scale.
    Larger {
        /// Whether all lengths of the CT would be larger.
        apart: bool,
    },
    /// How the cruciates would press on each other from this distance of their lines on [mm].
    Impinging(f64),
    /// The size of the load, whichever way that points: a tracker that sways with its bone's frame of reference.
    Sway(Bone),
}

/// Groups of courses: smooth fields, then suspects.
const GROUPS: usize = 7;

impl Course {
    /// Which group it is of: 0 smooth fields; stops, profiles, swaying trackers, larger bones, impinging cruciates, pulls.
    fn group(self) -> usize {
        match self {
            Course::Stop { .. } => 1,
            Course::Near { .. } => 2,
            Course::Sway(_) => 3,
            Course::Larger { .. } => 4,
            Course::Impinging(_) => 5,
            Course::Pull(_) => 6,
            _ => 0,
        }
    }
}

/// A component: its value in every trial; of a misreading, turns in degrees [N mm, N, or deg, mm].
pub(super) type Part = Vec<Six>;

/// A kind of field.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub is_force: bool,
    pub course: Course,
    pub scope: Scope,
    /// The only coordinate that it has (flexion for misreadings alone); the five of a reading otherwise.
    pub only: Option<Coordinate>,
}

impl Kind {
    /// Whether what it follows is anywhere: without load along an axis nothing follows that.
    pub(super) fn is_felt(&self, problem: &Problem) -> bool {
        let axis = match self.course {
            Course::Load => self.only,
            Course::Across(d) => Some(d),
            _ => None,
        };
        let loaded =
            |d: Coordinate| problem.trials.iter().any(|t| problem.acts(self.scope, t.source) && t.load()[d] != 0.0);
        axis.is_none_or(loaded)
    }

    /// Whether an effect of the catalogue does just this: what has a name there is none of these.
    pub(super) fn has_a_name(&self, catalogue: &Catalogue) -> bool {
        let name = match (self.is_force, self.course, self.only) {
            (true, Course::Constant, Some(IE | AP)) => "load_bias",
            (true, Course::Constant, Some(SI)) => "joint_compression",
            (true, Course::Across(AP), Some(IE)) => "load_misalign",
            (false, Course::Constant, Some(VV | IE)) => "tibia_frame",
            (false, Course::Constant, Some(ML | AP | SI)) => "origin_shift",
            (false, Course::Constant, Some(FE)) => "flexion_offset",
            (false, Course::Load, Some(VV | IE | AP)) => "apparatus_compliance",
            _ => return false,
        };
        catalogue.effect.iter().any(|e| e.id == name)
    }
}

/// Size of a field in coordinate `c`: force [N mm, N] or misreading [deg, mm].
pub(super) fn amplitude(is_force: bool, c: Coordinate) -> f64 {
    (if is_force { FORCES } else { READINGS })[c.index()]
}

/// All kinds of field; [`shares`] tells how likely each is.
pub(super) fn kinds(sources: &[usize]) -> Vec<Kind> {
    use Course::{Across, Constant, Flexion, Impinging, Larger, Load, Motion, Near, Pull, Scale, Stop, Sway};
    let each = if sources.len() > 1 { sources } else { &[] };
    let scopes: Vec<Scope> = std::iter::once(Scope::Both).chain(each.iter().copied().map(Scope::Only)).collect();
    let mut shapes: Vec<(bool, Course, Option<Coordinate>)> = Vec::new();
    for only in std::iter::once(None).chain(FREE.map(Some)) {
        // a misreading that follows the motion in any way would be the motion itself; in proportion it is a scale
        shapes.extend([Constant, Flexion, Motion, Load].map(|course| (true, course, only)));
        shapes.extend([Constant, Flexion, Scale, Load].map(|course| (false, course, only)));
    }
    shapes.extend([Constant, Flexion].map(|course| (false, course, Some(FE))));
    for (c, d) in FREE.into_iter().flat_map(|c| FREE.into_iter().filter(move |d| *d != c).map(move |d| (c, d))) {
        shapes.extend([true, false].map(|is_force| (is_force, Across(d), Some(c))));
    }
    for c in FREE {
        shapes.extend(STOPS.iter().flat_map(|&from| [-1.0, 1.0].map(|sign| (true, Stop { sign, from }, Some(c)))));
    }
    shapes.extend(FREE.into_iter().flat_map(|c| [false, true].map(|bent| (true, Near { bent }, Some(c)))));
    shapes.extend([Bone::Femur, Bone::Tibia].map(|bone| (false, Sway(bone), None)));
    shapes.extend([Bone::Femur, Bone::Tibia].map(|bone| (true, Pull(bone), None)));
    let kind = |scope: Scope, (is_force, course, only)| Kind { is_force, course, scope, only };
    let mut out: Vec<Kind> =
        scopes.iter().flat_map(|&scope| shapes.iter().map(move |&shape| kind(scope, shape))).collect();
    // of the knee, thus of all data sets
    out.extend([false, true].map(|apart| kind(Scope::Both, (true, Larger { apart }, None))));
    out.extend(CORDS.map(|from| kind(Scope::Both, (true, Impinging(from), None))));
    out
}

/// How likely each kind is before any data: smooth fields are half of what has no name, each group of suspects as likely as another.
pub(super) fn shares(kinds: &[Kind]) -> Vec<f64> {
    let groups: Vec<usize> = kinds.iter().map(|k| k.course.group()).collect();
    let in_group = |g: usize| groups.iter().filter(|&&other| other == g).count() as f64;
    let suspects: Vec<usize> = (1..GROUPS).filter(|&g| groups.contains(&g)).collect();
    let share = |g: usize| {
        if suspects.is_empty() {
            1.0
        } else if g == 0 {
            0.5
        } else {
            0.5 / suspects.len() as f64
        }
    };
    groups.iter().map(|&g| share(g) / in_group(g)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_act_in_all_data_sets_or_in_one_and_misreadings_follow_no_motion() {
        let two = kinds(&[0, 1]);
        // eight courses in one coordinate or all five, misread flexion two ways, loads across: twenty pairs, as forces and as misreadings; two stops
        // each way and two ends of flexion in each coordinate; two bones whose tracker sways, two along which something pulls; larger bones two ways,
        // cruciates of three sizes
        assert_eq!(two.len(), 3 * (8 * 6 + 2 + 2 * 20 + 4 * 5 + 2 * 5 + 2 + 2) + 2 + 3);
        assert!((shares(&two).iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(two.iter().all(|k| k.is_force || k.course != Course::Motion));
        assert!(two.iter().all(|k| k.only != Some(FE) || !k.is_force));
        assert!(kinds(&[0]).iter().all(|k| k.scope == Scope::Both));
    }

    #[test]
    fn what_the_catalogue_has_a_name_for_is_no_field_of_no_name() {
        let all = kinds(&[0]);
        let named = |catalogue: &Catalogue| all.iter().filter(|k| k.has_a_name(catalogue)).count();
        let shipped = Catalogue::shipped();
        // constant loads of three axes, one load across, six constant misreadings, three in proportion to the load
        assert_eq!(named(&shipped), 3 + 1 + 6 + 3);
        for (struck, kinds) in [("load_bias", 2), ("joint_compression", 1), ("load_misalign", 1), ("tibia_frame", 2)] {
            assert_eq!(named(&shipped.without(&[struck])), 13 - kinds, "{struck}");
        }
        for (struck, kinds) in [("origin_shift", 3), ("flexion_offset", 1), ("apparatus_compliance", 3), ("itb", 0)] {
            assert_eq!(named(&shipped.without(&[struck])), 13 - kinds, "{struck}");
        }
    }
}
