//! Candidate zero: a smooth field of generalised forces, or of misreadings, of no name. Where it explains more than any named effect, the answer is
//! outside the catalogue.

use crate::covariance::Whitening;
use crate::equilibrium::Bench;
use crate::error::DiscrepancyError;
use crate::fit::Fit;
use crate::problem::{Problem, Scope, Slopes};
use crate::screen::Marginal;
use crate::search::Search;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sim::joint::{AP, IE, ML, SI, VV};

/// Amplitudes of the force field: VV, IE [N mm], ML, AP, SI [N].
const FORCES: [f64; 5] = [3000.0, 1000.0, 20.0, 20.0, 40.0];
/// Amplitudes of misreadings: VV, IE [deg], ML, AP, SI [mm].
const READINGS: [f64; 5] = [2.0, 2.0, 2.0, 2.0, 2.0];
/// Over which flexion [rad] and over which motion (rotations [rad], translations [mm]) the field changes.
const RANGES: (f64, [f64; 5]) = (0.52, [0.05, 0.17, 4.0, 5.0, 4.0]);
/// Coordinates of a reading.
const READ: [usize; 5] = [VV, IE, ML, AP, SI];

/// What the wildcard explains beyond a fit.
#[derive(Clone, Debug)]
pub struct Wildcard {
    /// Log Bayes factor of the best field against the fit alone.
    pub log_bayes_factor: f64,
    /// Whether it is a field of forces (or of misreadings).
    pub is_force: bool,
    /// Where it acts.
    pub scope: Scope,
    /// Its mean: generalised force [N mm, N] or misreading [deg, mm], five a trial.
    pub mean: Vec<[f64; 5]>,
}

/// Responses of all readings to loads: five by five a trial.
fn responses(problem: &Problem, fit: &Fit) -> Result<Vec<[[f64; 5]; 5]>, DiscrepancyError> {
    let model = problem.model_at(&fit.unknowns)?;
    Ok(problem
        .trials
        .par_iter()
        .zip(&fit.linear.rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, &fit.hypothesis, &fit.unknowns);
            Slopes::new(Bench { model: &model, effects: &effects, place: &problem.place }, trial, rest).loads()
        })
        .collect())
}

/// The best field beside a fit of the search.
///
/// Errors: a model that cannot be evaluated.
pub fn wildcard(problem: &Problem, search: &Search, fit: &Fit) -> Result<Wildcard, DiscrepancyError> {
    let responses = responses(problem, fit)?;
    let readings = &search.readings;
    let base = readings.block_of(&crate::robust::widened(&search.covariance, &fit.odd));
    let marginal = Marginal::new(fit, readings, &search.covariance)?;
    let slope = readings.rows_of(&fit.linear.slope);
    let scatter = base + &slope * slope.transpose();
    let residual = &fit.residual + &slope * DVector::from_column_slice(&fit.unknowns);
    let alone = log_density(&marginal.whitening, &marginal.white);
    let mut scopes = vec![Scope::Both];
    if problem.sources.len() > 1 {
        scopes.extend((0..problem.sources.len()).map(Scope::Only));
    }
    let mut kinds = Vec::new();
    for is_force in [true, false] {
        for &scope in &scopes {
            for size in [0.5, 2.0] {
                kinds.push((is_force, scope, size));
            }
        }
    }
    let tried: Vec<Option<(f64, DVector<f64>)>> = kinds
        .par_iter()
        .map(|&(is_force, scope, size)| {
            let field = field(problem, fit, scope, is_force);
            let kernel = kernel(&field, &responses, is_force, size);
            let added = readings.block_of(&kernel);
            let whitening = Whitening::new(&scatter + &added).ok()?;
            let white = whitening.white_vector(&residual);
            Some((log_density(&whitening, &white) - alone, whitening.solve(&residual)))
        })
        .collect();
    let best = (0..kinds.len()).filter_map(|k| tried[k].as_ref().map(|t| (k, t.0))).max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((k, log_bayes_factor)) = best else {
        return Ok(Wildcard { log_bayes_factor: 0.0, is_force: true, scope: Scope::Both, mean: vec![] });
    };
    let (is_force, scope, size) = kinds[k];
    let solved = tried[k].as_ref().map(|t| t.1.clone()).unwrap_or_else(|| DVector::zeros(readings.rows.len()));
    let field = field(problem, fit, scope, is_force);
    let mean = mean(problem, search, &field, &responses, (is_force, size), &solved);
    Ok(Wildcard { log_bayes_factor: log_bayes_factor - (kinds.len() as f64).ln(), is_force, scope, mean })
}

fn log_density(whitening: &Whitening, white: &DVector<f64>) -> f64 {
    -0.5 * (white.norm_squared() + whitening.log_determinant())
}

/// Correlation of the field between trials, a matrix a coordinate.
fn field(problem: &Problem, fit: &Fit, scope: Scope, is_force: bool) -> Vec<DMatrix<f64>> {
    let n = problem.trials.len();
    let acts: Vec<bool> = problem.trials.iter().map(|t| scope.covers(t.source)).collect();
    (0..5)
        .map(|c| {
            let moved = |i: usize| fit.linear.rests[i].q[READ[c]] - problem.trials[i].neutral[READ[c]];
            DMatrix::from_fn(n, n, |i, k| {
                if !acts[i] || !acts[k] {
                    return 0.0;
                }
                let (a, b) = (&problem.trials[i], &problem.trials[k]);
                let mut d = ((a.flexion - b.flexion) / RANGES.0).powi(2);
                if is_force {
                    d += ((moved(i) - moved(k)) / RANGES.1[c]).powi(2);
                }
                (-0.5 * d).exp()
            })
        })
        .collect()
}

/// Covariance of the readings under a field, five a trial.
fn kernel(field: &[DMatrix<f64>], responses: &[[[f64; 5]; 5]], is_force: bool, size: f64) -> DMatrix<f64> {
    let n = responses.len();
    DMatrix::from_fn(5 * n, 5 * n, |r, s| {
        let (i, c, k, d) = (r / 5, r % 5, s / 5, s % 5);
        if is_force {
            let at = |l: usize| (size * FORCES[l]).powi(2) * field[l][(i, k)] * responses[i][l][c] * responses[k][l][d];
            (0..5).map(at).sum()
        } else if c == d {
            (size * READINGS[c]).powi(2) * field[c][(i, k)]
        } else {
            0.0
        }
    })
}

/// The field's mean at every trial.
fn mean(
    problem: &Problem,
    search: &Search,
    field: &[DMatrix<f64>],
    responses: &[[[f64; 5]; 5]],
    (is_force, size): (bool, f64),
    solved: &DVector<f64>,
) -> Vec<[f64; 5]> {
    (0..problem.trials.len())
        .map(|i| {
            std::array::from_fn(|l| {
                search
                    .readings
                    .rows
                    .iter()
                    .zip(solved.iter())
                    .map(|(&(k, d), s)| {
                        if is_force {
                            (size * FORCES[l]).powi(2) * field[l][(i, k)] * responses[k][l][d] * s
                        } else if d == l {
                            (size * READINGS[l]).powi(2) * field[l][(i, k)] * s
                        } else {
                            0.0
                        }
                    })
                    .sum()
            })
        })
        .collect()
}

impl Wildcard {
    /// In words: which coordinate, at which flexion, at which load, where, and how large.
    pub fn words(&self, problem: &Problem) -> String {
        const NAMES: [&str; 5] =
            ["varus-valgus", "internal-external rotation", "medial-lateral", "anterior-posterior", "axial"];
        let scale = if self.is_force { FORCES } else { READINGS };
        let mean = |keep: &dyn Fn(usize) -> bool, c: usize| {
            let values: Vec<f64> = (0..self.mean.len()).filter(|&i| keep(i)).map(|i| self.mean[i][c]).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        let size = |c: usize| {
            let acting: Vec<f64> = (0..self.mean.len())
                .filter(|&i| self.scope.covers(problem.trials[i].source))
                .map(|i| (self.mean[i][c] / scale[c]).powi(2))
                .collect();
            acting.iter().sum::<f64>()
        };
        let c = (0..5).max_by(|&a, &b| size(a).total_cmp(&size(b))).unwrap_or(3);
        let acts = |i: usize| self.scope.covers(problem.trials[i].source);
        let bent = |i: usize| problem.trials[i].nominal > 45.0;
        let pushed = |i: usize| problem.trials[i].load[READ[c]].abs() > 1e-6;
        let (near, far) = (mean(&|i| acts(i) && !bent(i), c), mean(&|i| acts(i) && bent(i), c));
        let (at_rest, loaded) = (mean(&|i| acts(i) && !pushed(i), c), mean(&|i| acts(i) && pushed(i), c));
        let profile = if near * far < 0.0 {
            "changes sign with flexion"
        } else if near.abs() > 2.0 * far.abs() {
            "is largest near extension"
        } else if far.abs() > 2.0 * near.abs() {
            "is largest in flexion"
        } else {
            "is much the same at all flexions"
        };
        let load = if at_rest.abs() > 0.5 * loaded.abs() { "is there without load" } else { "comes with load" };
        let place = match self.scope {
            Scope::Both => "in every data set".to_owned(),
            Scope::Only(s) => format!("in {} only", problem.sources[s]),
        };
        let (per, unit) = match (self.is_force, c < 2) {
            (true, true) => (1e-3, "N m"),
            (true, false) => (1.0, "N"),
            (false, true) => (1.0, "deg"),
            (false, false) => (1.0, "mm"),
        };
        let kind = if self.is_force { "acts like a force on the tibia" } else { "acts like a misreading" };
        format!(
            "It {kind} in {} {place}: {:+.1} {unit} at 0 to 45 deg, {:+.1} {unit} beyond; it {profile} and {load}.",
            NAMES[c],
            near * per,
            far * per
        )
    }
}
