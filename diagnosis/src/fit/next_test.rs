//! Which laxity test would tell the remaining answers apart: the symmetric divergence of what they predict [lopezfidalgo2007].

use crate::effect::Active;
use crate::effect::bench::Bench;
use crate::effect::candidate::Candidate;
use crate::effect::ways::walked;
use crate::error::DiagnosisError;
use crate::fit::{Fit, within};
use crate::problem::covariance::normal;
use crate::problem::jacobian::Jacobian;
use crate::problem::outlier::alone;
use crate::problem::{Problem, reading};
use inference::next_test::{BY_APPARATUS, planned};
use inference::trial::Trial;
use inference::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::FREE;

/// A test worth doing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct NextTest {
    /// Which.
    pub test: String,
    /// At which flexion [deg].
    pub flexion_deg: f64,
    /// The load it is about [N m or N].
    pub load: f64,
    /// Data set whose apparatus would do it.
    pub source: String,
    /// Expected log odds that it adds between the answers, weighed by belief, as loud as the diagnosis lets one trial speak [-].
    pub expected_gain: f64,
    /// Whether the answers lie so far apart there that the knee gives way in one of them: such a trial counts for no more than an odd one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub gives_way: bool,
}

/// Weight below which a rival is not worth a test of its own [-].
const LEAST_WEIGHT: f64 = 0.01;
/// Most rivals that a test is to tell apart [-].
const MOST_RIVALS: usize = 3;

/// Most tests that are told [-].
const MOST_TESTS: usize = 5;
/// Tests whose predictions are drawn, too, the most promising first [-].
const DRAWN: usize = 2 * MOST_TESTS;
/// Draws of each rival [-]: with two rivals, twice as many as readings and the degrees of freedom of two means.
const DRAWS: usize = 6;

/// The best tests between rivals with their weights. A test that promises much on a straight line is predicted again from draws of either rival: where a
/// small change of a ligament throws the knee onto another branch the straight line knows nothing, and the lesser of both promises counts.
///
/// Errors: a model that cannot be evaluated.
pub fn next_tests(problem: &Problem, rivals: &[(&Fit, f64)], seed: u64) -> Result<Vec<NextTest>, DiagnosisError> {
    let few: Vec<&(&Fit, f64)> = rivals.iter().filter(|(_, w)| *w > LEAST_WEIGHT).take(MOST_RIVALS).collect();
    if few.len() < 2 {
        return Ok(vec![]);
    }
    let weights: Vec<f64> = few.iter().map(|(_, w)| *w).collect();
    let plans = plans(problem);
    let linear: Vec<Vec<Forecast>> =
        few.iter().map(|(fit, _)| predictions(problem, fit, &plans)).collect::<Result<_, _>>()?;
    let mut ranked: Vec<(usize, Told)> = (0..plans.len())
        .map(|t| (t, told_by(problem, &linear.iter().map(|of| &of[t]).collect::<Vec<_>>(), &weights)))
        .collect();
    ranked.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    ranked.truncate(DRAWN);
    let asked: Vec<Trial> = ranked.iter().map(|(t, _)| plans[*t].clone()).collect();
    let drawn: Vec<Vec<Forecast>> =
        few.iter().map(|(fit, _)| drawn(problem, fit, &asked, seed)).collect::<Result<_, _>>()?;
    let mut out: Vec<NextTest> = Vec::new();
    for (k, (plan, (_, linear))) in asked.iter().zip(&ranked).enumerate() {
        let sampled = told_by(problem, &drawn.iter().map(|of| &of[k]).collect::<Vec<_>>(), &weights);
        out.push(NextTest {
            test: plan.record.test.name().into(),
            flexion_deg: plan.record.nominal_flexion_deg,
            load: size(plan),
            source: problem.source_of(plan).into(),
            expected_gain: linear.gain.min(sampled.gain),
            gives_way: linear.is_outlier && sampled.is_outlier,
        });
    }
    out.sort_by(|a, b| b.expected_gain.total_cmp(&a.expected_gain));
    out.truncate(MOST_TESTS);
    Ok(out)
}

/// What a test tells between rivals.
#[derive(Clone, Copy)]
struct Told {
    /// Log odds, weighed by belief.
    gain: f64,
    /// Whether some two lie so far apart that either would call the other's trial an outlier.
    is_outlier: bool,
}

/// What one test tells between rivals of some weights, by what each predicts.
fn told_by(problem: &Problem, of: &[&Forecast], weights: &[f64]) -> Told {
    let noise = DMatrix::from_diagonal(&DVector::from_row_slice(&problem.usual_noise.map(|sd| sd.powi(2)).0));
    let mut told = Told { gain: 0.0, is_outlier: false };
    for a in 0..of.len() {
        for b in 0..a {
            let ((x, s), (y, u)) = (of[a], of[b]);
            let Ok(w) = Whitening::new((s + u) * 0.5 + &noise) else { continue };
            let squares = w.white_vector(&(x - y)).norm_squared();
            let cost = alone(squares, FREE.len());
            // either may be the true one
            told.gain += 2.0 * weights[a] * weights[b] * cost;
            told.is_outlier |= cost < 0.5 * squares;
        }
    }
    told
}

fn size(plan: &Trial) -> f64 {
    plan.record.test.coordinate().map_or(0.0, |c| plan.record.load[c])
}

/// Compression in every test [N].
const COMPRESSION_N: f64 = 50.0;
/// Flexions thought of [deg].
const FLEXIONS_DEG: [f64; 4] = [0.0, 15.0, 45.0, 75.0];

/// Every test at four flexions in every apparatus, at usual loads.
fn plans(problem: &Problem) -> Vec<Trial> {
    let mut out = Vec::new();
    for source in problem.asked() {
        for flexion in FLEXIONS_DEG {
            let off = |t: &Trial| (t.flexion() - f64::to_radians(flexion)).abs();
            let near = problem.trials.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            for part in BY_APPARATUS {
                let asked = Trial::alone(planned(&[part], flexion, COMPRESSION_N));
                let unloaded = near.map_or(asked.unloaded.clone(), |t| t.unloaded.clone());
                out.push(Trial { source: Some(source), sd: problem.usual_noise, unloaded, ..asked });
            }
        }
    }
    out
}

/// A prediction with its scatter.
type Forecast = (DVector<f64>, DMatrix<f64>);

/// The effects of a hypothesis at some unknowns, at work in each trial.
fn effects_in(problem: &Problem, (hypothesis, unknowns): (&[Candidate], &[f64]), trials: &[Trial]) -> Vec<Vec<Active>> {
    trials.iter().map(|t| problem.effects_in(t.source, hypothesis, unknowns)).collect()
}

/// Predictions of a fit with their posterior scatter.
fn predictions(problem: &Problem, fit: &Fit, plans: &[Trial]) -> Result<Vec<Forecast>, DiagnosisError> {
    let models = problem.models_at(&fit.unknowns)?;
    let joints = problem.nuisance.joints(&fit.unknowns, problem.sources.len());
    let plans = problem.unloaded_at(plans, &models, &fit.hypothesis);
    let effects = effects_in(problem, (&fit.hypothesis, &fit.unknowns), &plans);
    let bench = |i: usize| Bench { model: models.of(plans[i].source), effects: &effects[i], place: &problem.place };
    let rests = walked(&plans, bench);
    plans
        .par_iter()
        .zip(&rests)
        .enumerate()
        .map(|(i, (plan, rest))| {
            let jacobian = Jacobian::new(bench(i), plan, rest);
            let mut columns = jacobian.nuisances(&problem.nuisance, &fit.unknowns, &joints)?;
            let mut at = problem.nuisances();
            for c in &fit.hypothesis {
                let scaled = &fit.unknowns[at..at + c.size()];
                at += c.size();
                columns.extend(jacobian.candidate(c, scaled, problem.acts(c.scope, plan.source)));
            }
            let j = DMatrix::from_fn(FREE.len(), columns.len(), |r, c| columns[c].0[r]);
            Ok((DVector::from_row_slice(&reading(rest).0), &j * &fit.posterior * j.transpose()))
        })
        .collect()
}

/// Predictions of a fit from draws of its unknowns, each led the whole way; a draw that finds no rest tells what it would read there all the same.
fn drawn(problem: &Problem, fit: &Fit, plans: &[Trial], seed: u64) -> Result<Vec<Forecast>, DiagnosisError> {
    let half = Cholesky::new(fit.posterior.clone()).map(|c| c.l());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let draws: Vec<Vec<f64>> = (0..DRAWS)
        .map(|_| {
            let z = DVector::from_fn(fit.unknowns.len(), |_, _| normal(&mut random));
            let by = half.as_ref().map_or_else(|| DVector::zeros(z.len()), |l| l * &z);
            within(&fit.hypothesis, problem.nuisances(), fit.unknowns.iter().zip(by.iter()).map(|(x, d)| x + d))
        })
        .collect();
    let read: Vec<Vec<DVector<f64>>> = draws
        .par_iter()
        .map(|x| {
            let models = problem.models_at(x)?;
            let trials = problem.unloaded_at(plans, &models, &fit.hypothesis);
            let effects = effects_in(problem, (&fit.hypothesis, x), &trials);
            let bench =
                |i: usize| Bench { model: models.of(trials[i].source), effects: &effects[i], place: &problem.place };
            Ok(walked(&trials, bench).iter().map(|rest| DVector::from_row_slice(&reading(rest).0)).collect())
        })
        .collect::<Result<_, DiagnosisError>>()?;
    Ok((0..plans.len()).map(|t| moments(&read.iter().map(|of| &of[t]).collect::<Vec<_>>())).collect())
}

/// Mean and covariance of some draws.
fn moments(draws: &[&DVector<f64>]) -> Forecast {
    let count = draws.len() as f64;
    let mean = draws.iter().fold(DVector::zeros(draws[0].len()), |sum, x| sum + *x) / count;
    let scatter = draws.iter().fold(DMatrix::zeros(mean.len(), mean.len()), |sum, x| {
        let off = *x - &mean;
        sum + &off * off.transpose()
    });
    (mean, scatter / (count - 1.0).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_on_two_branches_scatter_as_far_as_the_branches_lie_apart() {
        let draws = [[0.0, 1.0], [10.0, 1.0], [0.0, 3.0], [10.0, 3.0]].map(|x| DVector::from_row_slice(&x));
        let (mean, scatter) = moments(&draws.iter().collect::<Vec<_>>());
        assert_eq!(mean.as_slice(), [5.0, 2.0]);
        assert!((scatter[(0, 0)] - 100.0 / 3.0).abs() < 1e-12 && (scatter[(1, 1)] - 4.0 / 3.0).abs() < 1e-12);
        assert!(scatter[(0, 1)].abs() < 1e-12);
    }
}
