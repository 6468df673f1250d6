//! The fit of contact by thickness: modulus and edge spread, by least squares of relative differences of force.

use super::pose::{Rigid, Start};
use super::{ContactLawOptions, Curve, fault};
use crate::StageError;
use crate::assemble::LayerMaterial;
use serde::{Deserialize, Serialize};
use sim::contact::Contact;
use sim::spec::LayerLaw;

/// Contact by thickness, fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedLayer {
    /// What the model then has.
    pub material: LayerMaterial,
    /// Largest difference of force from the deformable model's, from `least_force_n` up [%].
    pub fit_error_percent: f64,
    /// Its root mean square [%].
    pub fit_rms_percent: f64,
    /// Root mean square difference of contact area at equal force [%].
    pub area_error_percent: f64,
    /// Force at the deformable model's approaches, a list a flexion [N].
    pub force_n: Vec<Vec<f64>>,
    /// Contact area there [mm2].
    pub area_mm2: Vec<Vec<f64>>,
}

/// The material of a law by thickness and how well it does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerMetrics {
    /// Linear or logarithmic.
    pub law: LayerLaw,
    /// Young's modulus [MPa].
    pub youngs_modulus_mpa: f64,
    /// Poisson's ratio [-].
    pub poissons_ratio: f64,
    /// Breadth of the soft edge in thicknesses [-].
    pub edge_spread: f64,
    /// A layer counts as this thick at least [mm].
    pub least_thickness_mm: f64,
    /// Largest difference of force [%].
    pub fit_error_percent: f64,
    /// Root mean square difference of force [%].
    pub fit_rms_percent: f64,
    /// Difference of area at equal force [%].
    pub area_error_percent: f64,
}

impl FittedLayer {
    /// The material and how well it does, for law.json and metrics.json.
    pub fn told(&self) -> LayerMetrics {
        let m = &self.material;
        LayerMetrics {
            law: m.law,
            youngs_modulus_mpa: m.youngs_modulus_mpa,
            poissons_ratio: m.poissons_ratio,
            edge_spread: m.edge_spread,
            least_thickness_mm: m.least_thickness_mm,
            fit_error_percent: self.fit_error_percent,
            fit_rms_percent: self.fit_rms_percent,
            area_error_percent: self.area_error_percent,
        }
    }
}

/// Edge spreads that are tried first [-].
const SPREADS: [f64; 8] = [0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 0.95, 1.4];
/// Steps of the search between two of them; each leaves 0.62 of the interval.
const STEPS: usize = 10;

/// A level that counts.
struct Row<'a> {
    start: &'a Start,
    approach: f64,
    force: f64,
    area: f64,
}

/// The best of the laws that the options name.
pub(super) fn fit(
    rigid: &Rigid,
    starts: &[Start],
    curves: &[Curve],
    o: &ContactLawOptions,
) -> Result<FittedLayer, StageError> {
    let rows: Vec<Row> = starts
        .iter()
        .zip(curves)
        .flat_map(|(start, c)| c.levels.iter().map(move |l| (start, l)))
        .filter(|(_, l)| l.force_n >= o.least_force_n && l.force_n > 0.0)
        .map(|(start, l)| Row { start, approach: l.shift_mm, force: l.force_n, area: l.area_mm2 })
        .collect();
    let mut best: Option<(f64, LayerMaterial)> = None;
    for &law in &o.layer_laws {
        let found = search(rigid, &rows, law, o)?;
        if best.as_ref().is_none_or(|(rms, _)| found.0 < *rms) {
            best = Some(found);
        }
    }
    let (_, material) = best.ok_or_else(|| StageError::Knee("layer_laws: at least one law was expected".into()))?;
    told(rigid, (starts, curves), &rows, material)
}

/// Root mean square of the relative differences, and the material, at the best edge spread.
fn search(
    rigid: &Rigid,
    rows: &[Row],
    law: LayerLaw,
    o: &ContactLawOptions,
) -> Result<(f64, LayerMaterial), StageError> {
    let at = |edge_spread: f64| {
        let material = LayerMaterial {
            law,
            youngs_modulus_mpa: 1.0,
            poissons_ratio: o.poissons_ratio,
            edge_spread,
            least_thickness_mm: o.least_thickness_mm,
        };
        modulus(rigid, rows, material)
    };
    let tried = SPREADS.iter().map(|&s| at(s)).collect::<Result<Vec<_>, _>>()?;
    let least = (0..tried.len()).min_by(|a, b| tried[*a].0.total_cmp(&tried[*b].0)).unwrap_or(0);
    let mut best = tried[least].clone();
    let (mut low, mut high) = (SPREADS[least.saturating_sub(1)], SPREADS[(least + 1).min(SPREADS.len() - 1)]);
    // golden section; what is left out is the part beyond the worse of two inner points
    let inner = f64::midpoint(5f64.sqrt(), -1.0);
    for _ in 0..STEPS {
        let (a, b) = (high - inner * (high - low), low + inner * (high - low));
        let (at_a, at_b) = (at(a)?, at(b)?);
        let better = if at_a.0 <= at_b.0 {
            high = b;
            at_a
        } else {
            low = a;
            at_b
        };
        if better.0 < best.0 {
            best = better;
        }
    }
    Ok(best)
}

/// The modulus by least squares: force is in proportion to it.
fn modulus(rigid: &Rigid, rows: &[Row], material: LayerMaterial) -> Result<(f64, LayerMaterial), StageError> {
    let contact = contact(rigid, &material)?;
    let x: Vec<f64> = rows.iter().map(|r| rigid.force(&contact, &r.start.pose, r.approach).0 / r.force).collect();
    let squares = x.iter().map(|x| x * x).sum::<f64>();
    let factor = x.iter().sum::<f64>() / squares.max(1e-300);
    let rms = (x.iter().map(|x| (factor * x - 1.0).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let youngs_modulus_mpa = material.youngs_modulus_mpa * factor;
    Ok((rms, LayerMaterial { youngs_modulus_mpa, ..material }))
}

fn contact(rigid: &Rigid, material: &LayerMaterial) -> Result<Contact, StageError> {
    rigid.layers.with_layer(&material.spec(Default::default())).map_err(fault)
}

fn told(
    rigid: &Rigid,
    (starts, curves): (&[Start], &[Curve]),
    rows: &[Row],
    material: LayerMaterial,
) -> Result<FittedLayer, StageError> {
    let contact = contact(rigid, &material)?;
    let force = |r: &Row| rigid.force(&contact, &r.start.pose, r.approach).0 / r.force - 1.0;
    let misses: Vec<f64> = rows.iter().map(force).collect();
    let areas: Vec<f64> =
        rows.iter().filter(|r| r.area > 0.0).map(|r| area_at(rigid, &contact, r) / r.area - 1.0).collect();
    let rms = |x: &[f64]| 100.0 * (x.iter().map(|d| d * d).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let of = |start: &Start, curve: &Curve| -> (Vec<f64>, Vec<f64>) {
        curve.levels.iter().map(|l| rigid.force(&contact, &start.pose, l.shift_mm)).unzip()
    };
    let (force_n, area_mm2) = starts.iter().zip(curves).map(|(s, c)| of(s, c)).unzip();
    Ok(FittedLayer {
        fit_error_percent: 100.0 * misses.iter().fold(0.0, |m: f64, d| d.abs().max(m)),
        fit_rms_percent: rms(&misses),
        area_error_percent: rms(&areas),
        force_n,
        area_mm2,
        material,
    })
}

/// Contact area where the law bears a level's force.
fn area_at(rigid: &Rigid, contact: &Contact, row: &Row) -> f64 {
    let (mut low, mut high) = (0.0, 2.0 * row.approach);
    // to a thousandth of the approach
    for _ in 0..11 {
        let middle = f64::midpoint(low, high);
        if rigid.force(contact, &row.start.pose, middle).0 < row.force { low = middle } else { high = middle }
    }
    rigid.force(contact, &row.start.pose, f64::midpoint(low, high)).1
}
