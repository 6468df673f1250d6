//! Where model and data disagree: standardised mean residuals by data set, test, flexion, sign of the load and coordinate.

use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::Marginal;
use crate::problem::Problem;
use crate::problem::covariance::normal;
use crate::search::Search;
use inference::whitening::Whitening;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use sim::coordinate::Coordinate;
use std::collections::BTreeMap;

/// A cell of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Cell {
    /// Data set.
    pub source: String,
    /// Test.
    pub test: String,
    /// Flexion it is filed under [deg].
    pub nominal_flexion_deg: f64,
    /// Sign of the tested load: -1, 0 or 1.
    pub load_sign: i8,
    /// Coordinate: vv, ie, ml, ap or si.
    pub dof: String,
    /// Mean residual over its standard deviation when nothing is missing [-].
    pub z: f64,
    /// Mean of measured minus predicted [deg or mm].
    pub mean: f64,
    /// Whether it is beyond what any cell of the map reaches in 95 % of simulated nulls.
    pub significant: bool,
}

/// The map of a fit. Residuals are those left after the fit; their scatter is corrected for what the fit took up.
///
/// Errors: a covariance that is not positive definite.
pub fn map(problem: &Problem, search: &Search, fit: &Fit) -> Result<Vec<Cell>, DiagnosisError> {
    let marginal = Marginal::new(fit, &search.readings, &search.covariance)?;
    let block = search.readings.block_of(&search.covariance);
    // residual after the fit = block C0^-1 (residual before): its covariance is block C0^-1 block
    let inner = marginal.whitening.white(&block);
    let left = inner.tr_mul(&inner);
    Ok(cells(problem, search, &fit.residual, &left))
}

/// The map of predictions of each condition by the rest: the gaps that a calibration to the condition itself would have hidden. Linear about the
/// fit.
///
/// Errors: a covariance that is not positive definite.
pub fn map_left_out(problem: &Problem, search: &Search, fit: &Fit) -> Result<Vec<Cell>, DiagnosisError> {
    let marginal = Marginal::new(fit, &search.readings, &search.covariance)?;
    let rows = &search.readings.rows;
    let half = marginal.whitening.white(&DMatrix::identity(rows.len(), rows.len()));
    let inverse = half.tr_mul(&half);
    let solved = &inverse * &marginal.before;
    let mut of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (r, &(i, _)) in rows.iter().enumerate() {
        of.entry(problem.trials[i].condition).or_default().push(r);
    }
    // errors of prediction: the inverse's own block, inverted, times what is solved
    let mut turn = DMatrix::zeros(rows.len(), rows.len());
    for members in of.values() {
        let n = members.len();
        let block = DMatrix::from_fn(n, n, |a, b| inverse[(members[a], members[b])]);
        let block = block.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));
        for (a, &row) in members.iter().enumerate() {
            for (b, &column) in members.iter().enumerate() {
                turn[(row, column)] = block[(a, b)];
            }
        }
    }
    let spread = &turn * inverse * &turn;
    Ok(cells(problem, search, &(turn * solved), &spread))
}

/// Means of errors by cell, and whether they are beyond what `spread`, their covariance when nothing is missing, allows.
fn cells(problem: &Problem, search: &Search, errors: &DVector<f64>, spread: &DMatrix<f64>) -> Vec<Cell> {
    let members = members(problem, search);
    let weights = DMatrix::from_fn(members.len(), search.readings.rows.len(), |m, r| {
        if members[m].1.contains(&r) { 1.0 / members[m].1.len() as f64 } else { 0.0 }
    });
    let means = &weights * errors;
    let spread = &weights * spread * weights.transpose();
    let sd: Vec<f64> = (0..members.len()).map(|m| spread[(m, m)].max(1e-12).sqrt()).collect();
    let limit = limit(&spread, &sd);
    members
        .iter()
        .enumerate()
        .map(|(m, ((source, test, flexion, sign, c), _))| {
            let z = means[m] / sd[m];
            Cell {
                source: source.map_or_else(String::new, |s| problem.sources[s].clone()),
                test: test.name().to_owned(),
                nominal_flexion_deg: *flexion as f64,
                load_sign: *sign,
                dof: c.name().to_owned(),
                z,
                mean: means[m],
                significant: z.abs() > limit,
            }
        })
        .collect()
}

type Key = (Option<usize>, sim::laxity::Test, i64, i8, Coordinate);

fn members(problem: &Problem, search: &Search) -> Vec<(Key, Vec<usize>)> {
    let mut out: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
    for (r, &(i, c)) in search.readings.rows.iter().enumerate() {
        let t = &problem.trials[i];
        let load = t.record.test.coordinate().map_or(0.0, |p| t.load()[p]);
        let sign = if load.abs() < 1e-6 { 0 } else { load.signum() as i8 };
        out.entry((t.source, t.record.test, t.record.nominal_flexion_deg.round() as i64, sign, c)).or_default().push(r);
    }
    out.into_iter().collect()
}

/// What the largest of all cells stays below in 95 % of nulls.
fn limit(spread: &DMatrix<f64>, sd: &[f64]) -> f64 {
    let n = sd.len();
    let scaled =
        DMatrix::from_fn(n, n, |a, b| spread[(a, b)] / (sd[a] * sd[b]) * if a == b { 1.0 + 1e-6 } else { 1.0 });
    let Ok(lower) = Whitening::new(scaled).map(|w| w.lower()) else { return 4.0 };
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut largest: Vec<f64> =
        (0..200).map(|_| (&lower * DVector::from_fn(n, |_, _| normal(&mut random))).amax()).collect();
    largest.sort_by(f64::total_cmp);
    largest[190]
}
