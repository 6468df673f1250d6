//! What the samples of the posterior say of a plan. They are asked as `simulate` asks them, so that both tell the same.

use super::knee::{Found, Surfaces};
use calibration::changed::{Changed, Fixed};
use calibration::plateau::Staying;
use calibration::samples::{Bands, Each, Question, Reached, Samples, band_of};
use sim::coordinate::Coordinate;
use sim::graft::Graft;
use sim::laxity::{Band, LaxityTrial};
use sim::model::Model;

/// What the samples answer in one state.
#[derive(Clone, Debug, Default)]
pub(super) struct OfState {
    pub(super) bands: Bands,
    pub(super) each: Each,
}

/// What the samples answer to a plan.
#[derive(Clone, Debug, Default)]
pub(super) struct Sampled {
    /// In the order of [`super::knee::STATES`].
    pub(super) states: [OfState; 3],
    /// Share of the samples between the ends of an interval [-].
    pub(super) interval: f64,
}

/// Place of an answer: state and test.
pub(super) type At = [usize; 2];

/// What all plans have in common that cut the same of one knee: the samples, the model that they are asked of, and what they answer before a graft is in.
pub(super) struct SampledBefore {
    samples: Samples,
    searched: Model,
    /// Intact, deficient.
    states: [OfState; 2],
}

impl SampledBefore {
    /// Asks the samples every test, intact and deficient. `best` has the answers of the most probable knee by the final mechanics.
    ///
    /// # Errors
    /// A model that does not compile; a most probable knee without equilibrium in all tests: a sentence.
    pub(super) fn of(
        samples: Samples,
        surfaces: &Surfaces,
        (trials, cut): (&[LaxityTrial], &[String]),
        best: [&[Option<Found>]; 2],
    ) -> Result<SampledBefore, String> {
        let searched = samples.searched(surfaces).map_err(|e| e.to_string())?;
        let unchanged = (&Changed::default(), &Fixed::default());
        let intact = asked_of(&samples, &searched, (trials, &[]), (unchanged, best[0]))?;
        let deficient = asked_of(&samples, &searched, (trials, cut), (unchanged, best[1]))?;
        Ok(SampledBefore { samples, searched, states: [intact, deficient] })
    }

    /// The same with grafts that are fixed in each sample: all three states. `best` has what the most probable knee answers with them.
    ///
    /// # Errors
    /// A most probable knee that the search's mechanics cannot operate on, or without equilibrium in all tests: a sentence.
    pub(super) fn with(
        &self,
        grafts: &[Graft],
        (trials, cut): (&[LaxityTrial], &[String]),
        best: &[Option<Found>],
    ) -> Result<Sampled, String> {
        let [intact, deficient] = self.states.clone();
        let reconstructed = if grafts.is_empty() {
            deficient.clone()
        } else {
            let changed = Changed { grafts: grafts.to_vec(), ..Changed::default() };
            let most = self.samples.len();
            let fixed = self.samples.fixed(&self.searched, (&changed, cut), most).map_err(|e| e.to_string())?;
            asked_of(&self.samples, &self.searched, (trials, cut), ((&changed, &fixed), best))?
        };
        Ok(Sampled { states: [intact, deficient, reconstructed], interval: self.interval() })
    }

    /// Share of the samples between the ends of an interval [-].
    pub(super) fn interval(&self) -> f64 {
        self.samples.of.interval
    }
}

/// What the samples answer in one state.
fn asked_of(
    samples: &Samples,
    searched: &Model,
    (trials, without): (&[LaxityTrial], &[String]),
    (change, best): ((&Changed, &Fixed), &[Option<Found>]),
) -> Result<OfState, String> {
    let values: Vec<Vec<(String, f64)>> = best.iter().map(|f| f.as_ref().map_or(vec![], |f| f.told.clone())).collect();
    let question =
        Question { trials, without, source: None, most: samples.len(), dislocation_ap_mm: None, values: Some(&values) };
    let told = samples.bands_and_each(searched, &question, change);
    told.map(|(bands, each)| OfState { bands, each }).map_err(|e| e.to_string())
}

impl Sampled {
    /// How many samples there are.
    pub(super) fn len(&self) -> usize {
        self.states[0].each.len()
    }

    /// The answer of a sample.
    pub(super) fn reached(&self, sample: usize, [state, test]: At) -> Option<&Reached> {
        self.states[state].each.get(sample)?.get(test)?.as_ref()
    }

    /// Mean and interval of a column of results.
    pub(super) fn band(&self, [state, test]: At, column: &str) -> Option<Band> {
        self.states[state].bands.rows.get(test)?.iter().find(|(name, _)| name == column).map(|(_, b)| *b)
    }

    /// Which samples stay on the plateau in all of these answers.
    pub(super) fn staying(&self, all: &[At]) -> Staying {
        let leaves = |s: usize| {
            let found: Option<Vec<&Reached>> = all.iter().map(|at| self.reached(s, *at)).collect();
            Some(found?.iter().any(|r| r.leaves_the_plateau))
        };
        Staying::of((0..self.len()).map(leaves))
    }

    /// Mean and interval of how far a coordinate comes from one answer to another, of the samples that stay on the plateau in both.
    pub(super) fn change(&self, c: Coordinate, from: At, to: At) -> Option<Band> {
        let (mut plain, mut drawn) = (vec![], vec![]);
        for s in self.staying(&[from, to]).here {
            let (Some(a), Some(b)) = (self.reached(s, from), self.reached(s, to)) else { continue };
            plain.push(b.pose[c] - a.pose[c]);
            drawn.extend(a.pushed.zip(b.pushed).map(|(a, b)| b[c] - a[c]));
        }
        band_of(&plain, &drawn, self.interval)
    }

    /// How many samples have no equilibrium there.
    pub(super) fn lost(&self, at: At) -> usize {
        (0..self.len()).filter(|s| self.reached(*s, at).is_none()).count()
    }

    /// How many samples rest without a graft in some test, and with it in none: it could not be fixed in them.
    pub(super) fn not_operated(&self) -> usize {
        let rests = |state: usize, s: usize| self.states[state].each[s].iter().any(Option::is_some);
        (0..self.len()).filter(|s| rests(1, *s) && !rests(2, *s)).count()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use calibration::kinds::Kinds;
    use sim::coordinate::{AP, Free};

    /// A pose with this AP [mm].
    pub(in super::super) fn pose(ap: f64) -> Free<f64> {
        let mut out = Free::default();
        out[AP] = ap;
        out
    }

    /// So many samples of one test, by state and sample: where each is, and whether it is off the plateau.
    pub(in super::super) fn sampled(
        count: usize,
        at: &dyn Fn(usize, usize) -> Free<f64>,
        is_off: &dyn Fn(usize, usize) -> bool,
    ) -> Sampled {
        let states = [0, 1, 2].map(|state| {
            let one = |s: usize| {
                let (pose, leaves_the_plateau) = (at(state, s), is_off(state, s));
                vec![Some(Reached { pose, pushed: Some(pose), leaves_the_plateau })]
            };
            let each: Each = (0..count).map(one).collect();
            let leaving = (0..count).filter(|s| is_off(state, *s)).count();
            let bands =
                Bands { leaving: vec![leaving], kinds: vec![Kinds::default()], asked: count, ..Bands::default() };
            OfState { bands, each }
        });
        Sampled { states, interval: 0.9 }
    }

    #[test]
    fn a_sample_without_a_fixed_graft_is_one_that_could_not_be_operated_on() {
        let mut of = sampled(4, &|_, s| pose(s as f64), &|_, _| false);
        assert_eq!((of.not_operated(), of.lost([2, 0])), (0, 0));
        of.states[2].each[1][0] = None;
        // a knee that rests in no state says nothing of the operation
        (0..3).for_each(|state| of.states[state].each[3][0] = None);
        assert_eq!((of.not_operated(), of.lost([2, 0]), of.lost([0, 0])), (1, 2, 1));
        assert_eq!(of.staying(&[[0, 0], [2, 0]]).here, [0, 2]);
    }
}
