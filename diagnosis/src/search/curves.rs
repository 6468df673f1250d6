//! Load against displacement where the model disagrees most: as measured, by the model as given, with ligaments recalibrated, and with the answer.

use crate::fit::Fit;
use crate::problem::Problem;
use crate::problem::trial::row_of;
use crate::search::map::Cell;
use inference::trial::Trial;
use serde::{Deserialize, Serialize};
use sim::coordinate::Coordinate;

/// How many are told.
const MOST: usize = 3;

/// The readings of one coordinate along one axis of loading, at one flexion of one data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Data set.
    pub source: String,
    /// Axis of the load: vv, ie or ap.
    pub load: String,
    /// Flexion it is filed under [deg].
    pub nominal_flexion_deg: f64,
    /// Coordinate that was read: vv, ie, ml, ap or si.
    pub dof: String,
    /// Its points, by load.
    pub points: Vec<Point>,
}

/// A trial on a curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Its name.
    pub trial: String,
    /// Load [N m or N].
    pub load: f64,
    /// Measured [deg or mm].
    pub measured: f64,
    /// Noise of the measurement [deg or mm].
    pub sd: f64,
    /// By the model as given [deg or mm].
    pub given: f64,
    /// With ligaments alone recalibrated [deg or mm].
    pub without: f64,
    /// With the answer [deg or mm]; none where nothing is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with: Option<f64>,
}

/// Curves through the cells of `map` that are farthest off; `given` are the readings of the model as given, five a trial [deg, mm].
pub fn curves(problem: &Problem, map: &[Cell], given: &[f64], base: &Fit, answer: Option<&Fit>) -> Vec<Curve> {
    let mut worst: Vec<&Cell> = map.iter().collect();
    worst.sort_by(|a, b| b.z.abs().total_cmp(&a.z.abs()));
    let mut out: Vec<Curve> = Vec::new();
    for cell in worst {
        let Some(curve) = through(problem, cell, given, base, answer) else { continue };
        if curve.points.len() > 1 && !out.iter().any(|c| is_same(c, &curve)) {
            out.push(curve);
        }
        if out.len() == MOST {
            break;
        }
    }
    out
}

fn is_same(a: &Curve, b: &Curve) -> bool {
    (&a.source, &a.load, a.nominal_flexion_deg, &a.dof) == (&b.source, &b.load, b.nominal_flexion_deg, &b.dof)
}

/// The curve that a cell lies on; none for a cell without load.
fn through(problem: &Problem, cell: &Cell, given: &[f64], base: &Fit, answer: Option<&Fit>) -> Option<Curve> {
    let source = problem.sources.iter().position(|s| *s == cell.source)?;
    let c = Coordinate::named(&cell.dof)?;
    let at = |t: &Trial| {
        t.source == Some(source) && t.record.nominal_flexion_deg.round() == cell.nominal_flexion_deg.round()
    };
    let axis = problem
        .trials
        .iter()
        .filter(|t| at(t) && t.record.test.name() == cell.test)
        .find_map(|t| t.record.test.coordinate())?;
    let along = |t: &Trial| t.record.test.coordinate().is_none_or(|p| p == axis);
    let mut points: Vec<Point> = problem
        .trials
        .iter()
        .enumerate()
        .filter(|(_, t)| at(t) && along(t))
        .filter_map(|(i, t)| {
            Some(Point {
                trial: t.record.trial.clone(),
                load: t.load()[axis] / axis.to_force(1.0),
                measured: t.record.measured[c]?,
                sd: t.sd[c],
                given: given[row_of(i, c)],
                without: base.linear.value[row_of(i, c)],
                with: answer.map(|f| f.linear.value[row_of(i, c)]),
            })
        })
        .collect();
    points.sort_by(|a, b| a.load.total_cmp(&b.load));
    Some(Curve {
        source: cell.source.clone(),
        load: axis.name().to_owned(),
        nominal_flexion_deg: cell.nominal_flexion_deg,
        dof: cell.dof.clone(),
        points,
    })
}
