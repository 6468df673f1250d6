//! Which laxity test would tell the remaining answers apart: the symmetric divergence of what they predict [lopezfidalgo2007].

use crate::bench::Bench;
use crate::covariance::Whitening;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::jacobian::Jacobian;
use crate::problem::{Problem, reading};
use crate::trial::Trial;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, FREE, IE, Load, SI, Six, VV};
use sim::laxity::{LaxityTrial, Test};

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
    /// Expected log odds that it adds between the answers, weighed by belief [-].
    pub expected_gain: f64,
}

/// Weight below which a rival is not worth a test of its own [-].
const LEAST_WEIGHT: f64 = 0.01;
/// Most rivals that a test is to tell apart [-].
const MOST_RIVALS: usize = 3;

/// The five best tests between rivals with their weights.
///
/// Errors: a model that cannot be evaluated.
pub fn next_tests(problem: &Problem, rivals: &[(&Fit, f64)]) -> Result<Vec<NextTest>, DiagnosisError> {
    let few: Vec<&(&Fit, f64)> = rivals.iter().filter(|(_, w)| *w > LEAST_WEIGHT).take(MOST_RIVALS).collect();
    if few.len() < 2 {
        return Ok(vec![]);
    }
    let plans = plans(problem);
    let predicted: Vec<Vec<Forecast>> =
        few.iter().map(|(fit, _)| predictions(problem, fit, &plans)).collect::<Result<_, _>>()?;
    let mut out = Vec::new();
    for (t, plan) in plans.iter().enumerate() {
        let mut gain = 0.0;
        for a in 0..few.len() {
            for b in 0..a {
                let ((x, s), (y, u)) = (&predicted[a][t], &predicted[b][t]);
                let noise =
                    DMatrix::from_diagonal(&DVector::from_row_slice(&problem.usual_noise.map(|sd| sd.powi(2)).0));
                let Ok(w) = Whitening::new((s + u) * 0.5 + noise) else { continue };
                gain += few[a].1 * few[b].1 * w.white_vector(&(x - y)).norm_squared();
            }
        }
        out.push(NextTest {
            test: plan.test.name().into(),
            flexion_deg: plan.nominal,
            load: size(plan),
            source: problem.sources[plan.source].clone(),
            expected_gain: gain,
        });
    }
    out.sort_by(|a, b| b.expected_gain.total_cmp(&a.expected_gain));
    out.truncate(5);
    Ok(out)
}

fn size(plan: &Trial) -> f64 {
    plan.test.coordinate().map_or(0.0, |c| plan.load[c] / c.to_force(1.0))
}

/// Every test at five flexions in every apparatus, at usual loads.
fn plans(problem: &Problem) -> Vec<Trial> {
    let tests = [
        (Test::Anterior, AP, 130.0),
        (Test::Posterior, AP, -130.0),
        (Test::Internal, IE, -5000.0),
        (Test::External, IE, 5000.0),
        (Test::Varus, VV, -8000.0),
        (Test::Valgus, VV, 8000.0),
        (Test::Neutral, SI, 50.0),
    ];
    let mut out = Vec::new();
    for source in 0..problem.sources.len() {
        for flexion in [0.0, 15.0, 45.0, 75.0] {
            for (test, coordinate, load) in tests {
                let mut loads = Six::zeros();
                loads[SI] = 50.0;
                loads[coordinate] = load;
                let flexed = f64::to_radians(flexion);
                let near = problem
                    .trials
                    .iter()
                    .min_by(|a, b| (a.flexion - flexed).abs().total_cmp(&(b.flexion - flexed).abs()));
                let name = format!("{}_{flexion}", test.name());
                let asked = LaxityTrial::asked(name, test, flexion, Load::default());
                let mut plan =
                    Trial { source, sd: problem.usual_noise, load: loads, flexion: flexed, ..Trial::alone(&asked) };
                near.into_iter().for_each(|t| plan.rest_at(t.unloaded()));
                out.push(plan);
            }
        }
    }
    out
}

/// A prediction with its scatter.
type Forecast = (DVector<f64>, DMatrix<f64>);

/// Predictions of a fit with their posterior scatter.
fn predictions(problem: &Problem, fit: &Fit, plans: &[Trial]) -> Result<Vec<Forecast>, DiagnosisError> {
    let models = problem.models_at(&fit.unknowns)?;
    let joints = problem.nuisance.joints(&fit.unknowns, problem.sources.len());
    Ok(problem
        .unloaded_at(plans, &models, &fit.hypothesis)
        .par_iter()
        .map(|plan| {
            let effects = problem.effects_in(plan.source, &fit.hypothesis, &fit.unknowns);
            let bench = Bench { model: models.of(plan.source), effects: &effects, place: &problem.place };
            let rest = bench.walk(plan);
            let jacobian = Jacobian::new(bench, plan, &rest);
            let mut columns = jacobian.nuisances(&problem.nuisance, &fit.unknowns, &joints);
            let mut at = problem.nuisances();
            for c in &fit.hypothesis {
                let scaled = &fit.unknowns[at..at + c.size()];
                at += c.size();
                columns.extend(jacobian.candidate(c, scaled, c.scope.covers(plan.source)));
            }
            let j = DMatrix::from_fn(FREE.len(), columns.len(), |r, c| columns[c].0[r]);
            (DVector::from_row_slice(&reading(&rest).0), &j * &fit.posterior * j.transpose())
        })
        .collect())
}
