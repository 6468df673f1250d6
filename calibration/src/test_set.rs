//! Which tests, done together, would narrow a wanted quantity most: a set chosen one by one [lindley1956], by what the samples of the posterior answer.
//!
//! What a set leaves of a quantity's spread is the error of its best linear prediction from the readings, each sample predicted by all others
//! [allen1974]. So readings that only fit these samples promise nothing.

mod choice;
mod wanted;

use crate::error::CalibrationError;
use crate::samples::{Question, Samples};
use choice::{Choice, Known};
use inference::knee::predict::Prediction;
use inference::next_test::{BY_HAND, planned};
use nalgebra::DMatrix;
use sim::coordinate::{Coordinate, Free, Load};
use sim::laxity::{LaxityTrial, Test};
use sim::model::Model;

/// Flexions thought of [deg]; those of the laxity protocols, and extension.
const FLEXIONS_DEG: [f64; 5] = [0.0, 15.0, 30.0, 60.0, 90.0];
/// The pivot shift: flexion [deg], valgus and internal moment [N m]; the paper's.
const PIVOT: (f64, f64, f64) = (30.0, 8.0, 4.0);
/// Fewer samples tell no correlation [-]; ours: each is predicted by the others.
pub const LEAST_SAMPLES: usize = 8;
/// A test in which more of the samples than this leave the plateau is not thought of [-]: its reading is none of this knee.
const MOST_LEAVING: f64 = 0.1;

/// What one wants to know.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    /// Forces of bundles, summed, in the drawers of 133 N: their numbers.
    Force(Vec<usize>),
    /// Anterior displacement in those drawers.
    Drawer,
    /// AP and IE that the pivot shift brings.
    PivotShift,
}

/// A test that can be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// What it tests: one coordinate, or two at once.
    pub tests: Vec<Test>,
    /// At which flexion [deg].
    pub flexion_deg: f64,
    /// Its loads, compression among them.
    pub load: Load,
    /// Coordinates that it reads, from the unloaded pose.
    pub reads: Vec<Coordinate>,
}

impl Candidate {
    /// "anterior", or "anterior with internal".
    pub fn name(&self) -> String {
        self.tests.iter().map(|t| t.name()).collect::<Vec<_>>().join(" with ")
    }
}

/// A test of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Which.
    pub test: Candidate,
    /// Standard deviation of what is wanted that is left with it and those before it, as a share of that now [-]; the mean over what is wanted.
    pub left: f64,
}

/// A set of tests, the most telling first.
#[derive(Clone, Debug, PartialEq)]
pub struct TestSet {
    /// The tests.
    pub tests: Vec<Chosen>,
    /// Standard deviation now of each wanted number, and with the set [N, mm or deg].
    pub spread: Vec<(String, f64, f64)>,
    /// Samples that count.
    pub samples: usize,
    /// Samples that were asked.
    pub asked: usize,
    /// Tests thought of.
    pub thought_of: usize,
}

/// How a set is chosen.
#[derive(Clone, Debug)]
pub struct Asking<'a> {
    /// What is wanted.
    pub wanted: Wanted,
    /// Bundles or ligaments that are cut where it is wanted; the tests are done on the knee as it is.
    pub without: &'a [String],
    /// Most tests.
    pub count: usize,
    /// Whether tests may load two coordinates at once.
    pub combined: bool,
    /// Standard deviation of a reading of a pose [deg, mm].
    pub noise: Free<f64>,
    /// Compression of the joint [N].
    pub compression_n: f64,
    /// Most samples.
    pub most: usize,
}

/// Every test at each flexion: single loads, then pairs of two coordinates where they may be combined.
pub fn candidates(compression_n: f64, combined: bool) -> Vec<Candidate> {
    let mut loads: Vec<Vec<(Test, f64)>> = BY_HAND.iter().map(|l| vec![*l]).collect();
    for (k, a) in BY_HAND.iter().enumerate() {
        let pairs = BY_HAND[k + 1..].iter().filter(|b| b.0.coordinate() != a.0.coordinate());
        loads.extend(pairs.filter(|_| combined).map(|b| vec![*a, *b]));
    }
    let of = |fe: f64, parts: &[(Test, f64)]| {
        let tests: Vec<Test> = parts.iter().map(|p| p.0).collect();
        let reads = tests.iter().filter_map(|t| t.coordinate()).collect();
        Candidate { tests, flexion_deg: fe, load: planned(parts, fe, compression_n).load, reads }
    };
    FLEXIONS_DEG.iter().flat_map(|fe| loads.iter().map(move |parts| of(*fe, parts))).collect()
}

/// What the samples answer: the unloaded knee at each flexion, every candidate, and the wanted trials.
struct Answered {
    candidates: Vec<Candidate>,
    /// By sample: rests, then candidates.
    read: Vec<Vec<Option<Prediction>>>,
    /// By sample: the wanted trials.
    known: Vec<Vec<Option<Prediction>>>,
}

/// Whether a sample's femur rests on the plateau.
fn stays(p: &Option<Prediction>) -> bool {
    p.as_ref().is_some_and(|p| !p.leaves_the_plateau)
}

impl Answered {
    fn of(samples: &Samples, searched: &Model, asking: &Asking) -> Result<Answered, CalibrationError> {
        let candidates = candidates(asking.compression_n, asking.combined);
        let mut told: Vec<LaxityTrial> =
            FLEXIONS_DEG.iter().map(|fe| trial(*fe, Load::compression(asking.compression_n))).collect();
        told.extend(candidates.iter().map(|c| trial(c.flexion_deg, c.load)));
        let ask = |trials: &[LaxityTrial], without| {
            let question =
                Question { trials, without, source: None, most: asking.most, dislocation_ap_mm: None, values: None };
            samples.answers(searched, &question)
        };
        let (read, known) = (ask(&told, &[])?, ask(&wanted::trials(asking), asking.without)?);
        Ok(Answered { candidates, read, known })
    }

    /// Places among what was read of a candidate's unloaded pose and of its own.
    fn ends(&self, candidate: usize) -> [usize; 2] {
        let fe_deg = self.candidates[candidate].flexion_deg;
        let zero = FLEXIONS_DEG.iter().position(|fe| *fe == fe_deg).unwrap_or(0);
        [zero, FLEXIONS_DEG.len() + candidate]
    }

    /// Candidates whose readings are of this knee: few samples leave the plateau there.
    fn thought_of(&self) -> Vec<usize> {
        let may_be_read = |place: usize| {
            let leaving = self.read.iter().filter(|of| !stays(&of[place])).count();
            leaving as f64 <= MOST_LEAVING * self.read.len() as f64
        };
        (0..self.candidates.len()).filter(|k| self.ends(*k).into_iter().all(may_be_read)).collect()
    }

    /// Samples that stay on the plateau in all wanted trials and in those candidates.
    fn here(&self, thought_of: &[usize]) -> Result<Vec<usize>, CalibrationError> {
        let counts = |s: &usize| {
            self.known[*s].iter().all(stays)
                && thought_of.iter().flat_map(|k| self.ends(*k)).all(|place| stays(&self.read[*s][place]))
        };
        let here: Vec<usize> = (0..self.read.len()).filter(counts).collect();
        if here.len() < LEAST_SAMPLES {
            let (lost, all) = (self.read.len() - here.len(), self.read.len());
            return Err(CalibrationError::Model(format!(
                "in {lost} of {all} samples the femur leaves the plateau where the quantity is wanted, or under the tests; {LEAST_SAMPLES} must stay on it. Ask for another quantity, or calibrate to more data first"
            )));
        }
        Ok(here)
    }

    /// Readings of a candidate from its unloaded pose, samples by rows.
    fn readings(&self, candidate: usize, here: &[usize]) -> DMatrix<f64> {
        let [zero, place] = self.ends(candidate);
        let pose = |s: usize, place: usize, c: Coordinate| self.read[s][place].as_ref().map_or(0.0, |p| p.pose[c]);
        let reads = &self.candidates[candidate].reads;
        DMatrix::from_fn(here.len(), reads.len(), |s, r| pose(here[s], place, reads[r]) - pose(here[s], zero, reads[r]))
    }
}

/// Chooses a set for a knee known by samples; `searched` is the model of [`Samples::searched`].
///
/// # Errors
/// A name of no bundle; a most probable knee without equilibrium; too few samples that stay on the plateau.
pub fn test_set(samples: &Samples, searched: &Model, asking: &Asking) -> Result<TestSet, CalibrationError> {
    let answered = Answered::of(samples, searched, asking)?;
    let thought_of = answered.thought_of();
    let here = answered.here(&thought_of)?;
    // a displacement has the noise of two poses
    let noise = |k: &usize| answered.candidates[*k].reads.iter().map(|c| 2.0 * asking.noise[*c].powi(2)).collect();
    let (names, targets) = wanted::numbers(&asking.wanted, &here, &answered.known);
    let known = Known {
        readings: thought_of.iter().map(|k| answered.readings(*k, &here)).collect(),
        noise: thought_of.iter().map(noise).collect(),
        targets,
    };
    let Choice { order, spread } = known.chosen(asking.count);
    let test = |(k, left): (usize, f64)| Chosen { test: answered.candidates[thought_of[k]].clone(), left };
    Ok(TestSet {
        tests: order.into_iter().map(test).collect(),
        spread: names.into_iter().zip(spread).map(|(name, (now, then))| (name, now, then)).collect(),
        samples: here.len(),
        asked: answered.read.len(),
        thought_of: thought_of.len(),
    })
}

/// A trial of some loads.
fn trial(fe_deg: f64, load: Load) -> LaxityTrial {
    LaxityTrial::asked(String::new(), Test::Neutral, fe_deg, load)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::FREE;

    #[test]
    fn candidates_load_one_coordinate_or_two_and_read_what_they_load() {
        let (single, all) = (candidates(20.0, false), candidates(20.0, true));
        assert_eq!((single.len(), all.len()), (6 * FLEXIONS_DEG.len(), 18 * FLEXIONS_DEG.len()));
        for c in &all {
            let loaded: Vec<Coordinate> =
                FREE.into_iter().filter(|k| c.load[*k] != Load::compression(20.0)[*k]).collect();
            let mut reads = c.reads.clone();
            reads.sort();
            assert_eq!(loaded, reads, "{}", c.name());
        }
    }
}
