//! Measurements that contradict each other: two readings, near the same load and flexion, that no knee of the model gives both.
//!
//! The knee is fitted to either reading alone and to both, with all of its priors. What both cost more than the cheaper of them alone is how far off the
//! other is in any knee that gives that one. So a contradiction is one of the data: no ligament, site or frame of any knee of the model explains it.

use crate::criteria::contradicted;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::covariance::Readings;
use crate::problem::trial::row_of;
use crate::problem::{Begin, Problem};
use crate::search::{Search, Searcher, TRIES};
use inference::trial::Trial;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, FREE};
use sim::equilibrium::Start;
use std::collections::BTreeMap;

/// Flexions that are near each other [deg]. Declared, as are the loads: a reader may lay such records side by side. Usual plans have a flexion every 30 deg.
const NEAR_FLEXION_DEG: f64 = 30.0;
/// Moments and forces that are near each other: VV, IE [N m], ML, AP, SI [N].
const NEAR_LOADS: [f64; 5] = [3.0, 2.5, 50.0, 50.0, 60.0];
/// Tensions of the quadriceps that are near each other [N].
const NEAR_QUADRICEPS_N: f64 = 50.0;
/// Pairs whose knees are fitted, the most promising on a straight line first [-].
const FITTED: usize = 12;
/// Of them with the same trial at most [-].
const FITTED_OF_A_TRIAL: usize = 3;
/// Standard deviations within which a knee gives a reading [-]: beyond them a reading counts as an outlier.
const GIVEN: f64 = 3.0;
/// Contradictions that are told at most [-]; the head of a page has the first three.
const MOST: usize = 6;

/// One of two readings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Witness {
    /// Data set.
    pub source: String,
    /// Row of its file, the header being row 1; none where no file holds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<usize>,
    /// Name of the trial.
    pub trial: String,
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Loads by their columns in the file [N m, N].
    pub loads: BTreeMap<String, f64>,
    /// What was read [deg or mm].
    pub value: f64,
}

/// Two readings of one coordinate that contradict each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contradiction {
    /// Coordinate: vv, ie, ml, ap or si.
    pub dof: String,
    /// The two readings; that first which a knee of the model gives more easily.
    pub readings: [Witness; 2],
    /// What a knee of the model that gives the first reading gives in the second trial [deg or mm].
    pub expected: f64,
    /// Its standard deviation, with noise, frames and all that is unknown of the knee [deg or mm].
    pub sd: f64,
    /// What both cost the best knee more than the first alone: half the square of the standard deviations by which the second is off [nats].
    pub surprise: f64,
    /// Measurement noise of either reading, as the diagnosis takes it [deg or mm]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<[f64; 2]>,
    /// Standard deviations by which the second is off, by the surprise [-]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
    /// How many readings near it either contradicts, the other one included, on a straight line [-]; answers of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contradicts: Option<[usize; 2]>,
}

/// Of how many more readings than the other a row must contradict to be the one that is off, as a factor [-]. Declared.
const OFF_BY_MOST: usize = 2;

impl Contradiction {
    /// Standard deviations by which the second reading is off [-].
    pub fn deviations(&self) -> f64 {
        self.z.unwrap_or((2.0 * self.surprise.max(0.0)).sqrt())
    }

    /// Which of the two readings is off, by how many of those near it either contradicts; none where that does not tell.
    pub fn outlier(&self) -> Option<usize> {
        let [first, second] = self.contradicts?;
        let is_far = |one: usize, other: usize| one >= OFF_BY_MOST * other.max(1);
        if is_far(second, first) { Some(1) } else { is_far(first, second).then_some(0) }
    }
}

/// Two readings by their places among all, the first trial first.
#[derive(Clone, Copy)]
struct Pair {
    rows: [usize; 2],
    trials: [usize; 2],
    dof: Coordinate,
    surprise: f64,
}

/// The clearest contradictions beside what a fit explains, each trial in one of them at most; none where chance among so many pairs may do it. Where
/// something `is_missing` for certain, only the place of it is asked, and no choice is paid for.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn contradictions(
    searcher: &Searcher,
    search: &Search,
    fit: &Fit,
    is_missing: bool,
) -> Result<Vec<Contradiction>, DiagnosisError> {
    let given = given(&fit.residual, &search.readings.block_of(&search.covariance));
    // where the knee itself rests: next to a reading that no knee gives, another stiffness would stand in for its own
    let problem = searcher.problem.clone().with_far_rests(true);
    let linear = problem.linear(&fit.hypothesis, &fit.unknowns, Begin::At(&[]))?;
    let residual = &search.readings.measured - search.readings.pick(&linear.value);
    let fit = &Fit { linear, residual, ..fit.clone() };
    let searcher = &Searcher { problem: &problem, options: searcher.options };
    let pairs = pairs(&problem, search, fit);
    let bar = contradicted(if is_missing { 1 } else { pairs.len() });
    let open = not_both(pairs, &given);
    let counts = counts(&open, search.readings.rows.len(), bar);
    let likely = promising(open, bar);
    let mut found: Vec<(Pair, Contradiction)> = likely
        .into_par_iter()
        .map(|pair| Ok((pair, fitted(searcher, search, fit, (pair, pair.rows.map(|r| counts[r])))?)))
        .collect::<Result<_, DiagnosisError>>()?;
    found.retain(|(_, c)| c.surprise >= bar);
    found.sort_by(|a, b| b.1.surprise.total_cmp(&a.1.surprise));
    let mut told: Vec<(Pair, Contradiction)> = Vec::new();
    for (pair, contradiction) in found {
        let is_told = told.iter().any(|(other, _)| pair.trials.iter().any(|t| other.trials.contains(t)));
        if !is_told && told.len() < MOST {
            told.push((pair, contradiction));
        }
    }
    Ok(told.into_iter().map(|(_, c)| c).collect())
}

/// Whether a fit gives each reading, by whichever of its rests is nearest to it.
fn given(residual: &DVector<f64>, scatter: &DMatrix<f64>) -> Vec<bool> {
    residual.iter().enumerate().map(|(r, off)| off.abs() <= GIVEN * scatter[(r, r)].sqrt()).collect()
}

/// Pairs of which a fit does not give both readings: a knee that rests in two ways may give one by either.
fn not_both(pairs: Vec<Pair>, given: &[bool]) -> Vec<Pair> {
    pairs.into_iter().filter(|p| !p.rows.iter().all(|r| given[*r])).collect()
}

/// Of each reading how many pairs with it pass a bar on a straight line.
fn counts(pairs: &[Pair], readings: usize, bar: f64) -> Vec<usize> {
    let mut out = vec![0; readings];
    pairs.iter().filter(|p| p.surprise >= bar).flat_map(|p| p.rows).for_each(|r| out[r] += 1);
    out
}

/// Those that may pass the bar on a straight line, the most promising first.
fn promising(mut pairs: Vec<Pair>, bar: f64) -> Vec<Pair> {
    pairs.retain(|p| p.surprise >= bar);
    pairs.sort_by(|a, b| b.surprise.total_cmp(&a.surprise));
    let mut out: Vec<Pair> = Vec::new();
    for pair in pairs {
        let of = |t: &usize| out.iter().filter(|p| p.trials.contains(t)).count();
        if out.len() < FITTED && pair.trials.iter().all(|t| of(t) < FITTED_OF_A_TRIAL) {
            out.push(pair);
        }
    }
    out
}

/// All pairs of readings of one coordinate near the same load and flexion, with their surprise on a straight line about a fit.
fn pairs(problem: &Problem, search: &Search, fit: &Fit) -> Vec<Pair> {
    let readings = &search.readings;
    let jacobian = readings.rows_of(&fit.linear.jacobian);
    let scatter = readings.block_of(&search.covariance) + &jacobian * jacobian.transpose();
    let before = &fit.residual + &jacobian * fit.from_means();
    let mut out = Vec::new();
    for (b, &(second, dof)) in readings.rows.iter().enumerate() {
        for (a, &(first, other)) in readings.rows[..b].iter().enumerate() {
            if other != dof || first == second || !are_near(&problem.trials[first], &problem.trials[second]) {
                continue;
            }
            let [x, y] = [a, b].map(|r| before[r] / scatter[(r, r)].sqrt());
            let together = scatter[(a, b)] / (scatter[(a, a)] * scatter[(b, b)]).sqrt();
            out.push(Pair { rows: [a, b], trials: [first, second], dof, surprise: surprise([x, y], together) });
        }
    }
    out
}

/// What two standard normal numbers that go together, by their correlation, cost more than the lesser of them alone [nats].
fn surprise([x, y]: [f64; 2], together: f64) -> f64 {
    let alone = 1.0 - together * together;
    if alone <= 0.0 {
        return 0.0;
    }
    0.5 * ((x * x + y * y - 2.0 * together * x * y) / alone - x.abs().min(y.abs()).powi(2))
}

/// Whether two trials are near each other: a reader may lay them side by side. Loading and unloading are not, nor are a whole knee and a cut one.
fn are_near(a: &Trial, b: &Trial) -> bool {
    let near = |x: f64, y: f64, most: f64| (x - y).abs() <= most;
    let branches = a.record.branch.zip(b.record.branch).is_none_or(|(a, b)| a == b);
    let loads = [a.load(), b.load()];
    branches
        && a.record.without == b.record.without
        && near(a.flexion().to_degrees(), b.flexion().to_degrees(), NEAR_FLEXION_DEG)
        && near(a.record.quadriceps_n, b.record.quadriceps_n, NEAR_QUADRICEPS_N)
        && FREE.into_iter().zip(NEAR_LOADS).all(|(c, most)| near(loads[0][c], loads[1][c], c.to_force(most)))
}

/// A pair weighed by knees that are fitted to either reading and to both: from where the fit at hand stands and from the model as given, and to both also
/// from where either alone ends. Of either reading `counts` has how many it contradicts.
fn fitted(
    searcher: &Searcher,
    search: &Search,
    fit: &Fit,
    (pair, counts): (Pair, [usize; 2]),
) -> Result<Contradiction, DiagnosisError> {
    let whole = searcher.problem;
    let mut problem = whole.clone();
    problem.keep(&(0..whole.trials.len()).map(|t| pair.trials.contains(&t)).collect::<Vec<_>>());
    let [a, b] = pair.rows.map(|r| search.readings.measured[r]);
    let readings = |which: &[(usize, f64)]| Readings {
        rows: which.iter().map(|(t, _)| (*t, pair.dof)).collect(),
        measured: DVector::from_iterator(which.len(), which.iter().map(|(_, x)| *x)),
    };
    let scatter = scatter_of(search, pair.trials);
    let few = Searcher { problem: &problem, options: searcher.options };
    let rests: Vec<Start> = fit.coordinates();
    let here = (fit.unknowns.clone(), pair.trials.map(|t| rests[t].clone()).to_vec());
    let mut given = fit.unknowns.clone();
    given[..problem.nuisances()].copy_from_slice(&problem.nuisance.given);
    let there = (given, here.1.clone());
    let best = |to: &Readings, from: &[&(Vec<f64>, Vec<Start>)]| -> Result<Fit, DiagnosisError> {
        let fits = from.iter().map(|(x, at)| few.fit(&fit.hypothesis, x, at, &scatter, to, TRIES));
        let fits: Vec<Fit> = fits.collect::<Result<_, _>>()?;
        let best = fits.into_iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence));
        best.ok_or_else(|| DiagnosisError::Model("a fit has no start".into()))
    };
    let one = best(&readings(&[(0, a)]), &[&here, &there])?;
    let other = best(&readings(&[(1, b)]), &[&here, &there])?;
    let ends = [&one, &other].map(|f| (f.unknowns.clone(), f.coordinates()));
    let both = best(&readings(&[(0, a), (1, b)]), &[&ends[0], &ends[1], &here])?;
    let [alone, beside] = [&one, &other].map(|f| 0.5 * few.total(f));
    let (first, fit) = if alone <= beside { (0, one) } else { (1, other) };
    let at = row_of(1 - first, pair.dof);
    let jacobian = fit.linear.jacobian.row(at).transpose();
    let spread = (jacobian.transpose() * &fit.posterior * &jacobian)[(0, 0)] + scatter[(at, at)];
    let witness = |k: usize| witness(whole, pair.trials[k], [a, b][k]);
    let noise = pair.trials.map(|t| whole.trials[t].sd[pair.dof]);
    let surprise = 0.5 * few.total(&both) - alone.min(beside);
    Ok(Contradiction {
        dof: pair.dof.name().to_owned(),
        readings: [witness(first), witness(1 - first)],
        expected: fit.linear.value[at],
        sd: spread.max(0.0).sqrt(),
        surprise,
        noise: Some([noise[first], noise[1 - first]]),
        z: Some((2.0 * surprise.max(0.0)).sqrt()),
        contradicts: Some([counts[first], counts[1 - first]]),
    })
}

/// The scatter of two trials, five rows each.
fn scatter_of(search: &Search, trials: [usize; 2]) -> DMatrix<f64> {
    let n = FREE.len();
    let at = |r: usize| n * trials[r / n] + r % n;
    DMatrix::from_fn(2 * n, 2 * n, |r, k| search.covariance[(at(r), at(k))])
}

/// A reading of a trial with its place.
pub(crate) fn witness(problem: &Problem, trial: usize, value: f64) -> Witness {
    let t = &problem.trials[trial];
    Witness {
        source: problem.source_of(t).into(),
        row: t.record.row,
        trial: t.record.trial.clone(),
        flexion_deg: t.flexion().to_degrees(),
        loads: FREE.into_iter().map(|c| (c.load_column(), t.load()[c] / c.to_force(1.0))).collect(),
        value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_contradicts_all_near_it_is_the_outlier_and_of_two_alike_neither_is() {
        let readings = 5;
        // reading 3 against all others, and nothing else; one pair stays below the bar
        let pair = |a: usize, b: usize, surprise: f64| Pair {
            rows: [a, b],
            trials: [a, b],
            dof: sim::coordinate::IE,
            surprise,
        };
        let pairs: Vec<Pair> =
            [0usize, 1, 2, 4].map(|k| pair(k.min(3), k.max(3), 9.0)).into_iter().chain([pair(0, 1, 2.0)]).collect();
        let found = counts(&pairs, readings, 4.5);
        assert_eq!(found, [1, 1, 1, 4, 1]);
        let outlier = |contradicts: [usize; 2]| told(Some(contradicts)).outlier();
        for other in [0, 1, 2, 4] {
            assert_eq!(outlier([found[other], found[3]]), Some(1));
            assert_eq!(outlier([found[3], found[other]]), Some(0));
        }
        assert_eq!((outlier([1, 1]), outlier([2, 3]), outlier([0, 1])), (None, None, None));
        // an answer of an earlier version does not tell
        assert_eq!(told(None).outlier(), None);
    }

    #[test]
    fn what_a_fit_gives_both_of_within_three_deviations_is_no_contradiction() {
        let scatter = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 0.25, 4.0]));
        let given = given(&DVector::from_vec(vec![5.9, -1.4, -6.1]), &scatter);
        assert_eq!(given, [true, true, false]);
        let pair = |rows: [usize; 2]| Pair { rows, trials: rows, dof: sim::coordinate::AP, surprise: 9.0 };
        let open = not_both(vec![pair([0, 1]), pair([0, 2]), pair([1, 2])], &given);
        assert_eq!(open.iter().map(|p| p.rows).collect::<Vec<_>>(), [[0, 2], [1, 2]]);
    }

    #[test]
    fn a_surprise_is_half_the_square_of_the_deviations_that_are_told() {
        for surprise in [0.0, 4.5, 12.5, 38.0] {
            let of = Contradiction { surprise, ..told(None) };
            assert!((0.5 * of.deviations().powi(2) - surprise).abs() < 1e-12);
        }
    }

    fn told(contradicts: Option<[usize; 2]>) -> Contradiction {
        let witness = |source: &str| Witness {
            source: source.into(),
            row: Some(2),
            trial: "a".into(),
            flexion_deg: 30.0,
            loads: BTreeMap::new(),
            value: 1.0,
        };
        let readings = ["kla", "rks"].map(witness);
        Contradiction {
            dof: "ie".into(),
            readings,
            expected: 0.0,
            sd: 1.0,
            surprise: 9.0,
            noise: None,
            z: None,
            contradicts,
        }
    }

    #[test]
    fn two_readings_that_would_go_together_and_do_not_are_of_no_one_knee() {
        // one knee would have them alike
        assert!(surprise([1.0, 1.0], 0.99) < 0.1);
        // far apart, though either alone is nothing odd
        assert!(surprise([1.5, -1.5], 0.99) > 100.0);
        // what does not go together is as odd as the odder of the two
        assert!((surprise([0.5, -5.0], 0.0) - 12.5).abs() < 1e-12);
        // which comes first does not matter
        assert!((surprise([2.0, -1.0], 0.9) - surprise([-1.0, 2.0], 0.9)).abs() < 1e-12);
    }
}
