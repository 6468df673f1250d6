//! Load against displacement where the model disagrees most: as measured, by the model as given, with ligaments recalibrated, and with the answer.

use crate::fit::Fit;
use crate::map::Cell;
use crate::problem::Problem;
use crate::trial::Trial;
use calibration::targets::primary;
use serde::{Deserialize, Serialize};
use sim::laxity::{COORDINATES, LOAD_UNITS, VALUE_UNITS};
use validation::plot::{INK, Series, colour, draw, panel};

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
    let c = COORDINATES.iter().position(|d| *d == cell.dof)?;
    let at = |t: &Trial| t.source == source && t.nominal.round() == cell.nominal_flexion_deg.round();
    let axis = problem.trials.iter().filter(|t| at(t) && t.test.name() == cell.test).find_map(|t| primary(t.test))?;
    let along = |t: &Trial| primary(t.test).is_none_or(|p| p == axis);
    let unit = if axis < 2 { 1000.0 } else { 1.0 };
    let mut points: Vec<Point> = problem
        .trials
        .iter()
        .enumerate()
        .filter(|(_, t)| at(t) && along(t))
        .filter_map(|(i, t)| {
            Some(Point {
                trial: t.name.clone(),
                load: t.load[axis + 1] / unit,
                measured: t.measured[c]?,
                sd: t.sd[c],
                given: given[5 * i + c],
                without: base.linear.value[5 * i + c],
                with: answer.map(|f| f.linear.value[5 * i + c]),
            })
        })
        .collect();
    points.sort_by(|a, b| a.load.total_cmp(&b.load));
    Some(Curve {
        source: cell.source.clone(),
        load: COORDINATES[axis].to_owned(),
        nominal_flexion_deg: cell.nominal_flexion_deg,
        dof: cell.dof.clone(),
        points,
    })
}

/// The curves as one picture (SVG), a panel each.
pub fn picture(curves: &[Curve]) -> String {
    if curves.is_empty() {
        return String::new();
    }
    draw((340 * curves.len() as u32, 340), |root| {
        for (k, (area, curve)) in root.split_evenly((1, curves.len())).iter().zip(curves).enumerate() {
            let name = |all: &[&str], of: &str| all.iter().position(|x| *x == of).unwrap_or_default();
            let (axis, dof) = (name(&COORDINATES, &curve.load), name(&COORDINATES, &curve.dof));
            let title = format!("{} at {:.0} deg", curve.source, curve.nominal_flexion_deg);
            let unit = LOAD_UNITS[axis].replace("nm", "N m").replace('n', "N");
            let load = format!("{} load ({unit})", curve.load.to_uppercase());
            let read = format!("{} ({})", curve.dof.to_uppercase(), VALUE_UNITS[dof]);
            panel(area, (&title, &load, &read), &series(curve), k == 0)?;
        }
        Ok(())
    })
}

fn series(curve: &Curve) -> Vec<Series> {
    let line = |name: &str, k: usize, of: &dyn Fn(&Point) -> Option<f64>| Series {
        name: name.into(),
        points: curve.points.iter().filter_map(|p| Some((p.load, of(p)?))).collect(),
        spread: vec![],
        colour: colour(k),
        line: true,
        thin: k > 1,
    };
    let mut out = vec![
        line("model as given", 3, &|p| Some(p.given)),
        line("ligaments recalibrated", 1, &|p| Some(p.without)),
        line("with the answer", 0, &|p| p.with),
        Series {
            name: "measured".into(),
            points: curve.points.iter().map(|p| (p.load, p.measured)).collect(),
            spread: curve.points.iter().map(|p| p.sd).collect(),
            colour: INK,
            line: false,
            thin: true,
        },
    ];
    out.retain(|s| !s.points.is_empty());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(with: Option<f64>) -> Curve {
        let point = |load: f64| Point {
            trial: format!("t{load}"),
            load,
            measured: 0.1 * load,
            sd: 0.4,
            given: 0.2 * load,
            without: 0.15 * load,
            with: with.map(|w| w * load),
        };
        Curve {
            source: "kla".into(),
            load: "ap".into(),
            nominal_flexion_deg: 30.0,
            dof: "ap".into(),
            points: [-100.0, 0.0, 100.0].map(point).into(),
        }
    }

    #[test]
    fn a_picture_has_a_panel_a_curve_and_a_line_for_an_answer_alone() {
        let two = picture(&[curve(Some(0.1)), curve(Some(0.1))]);
        assert_eq!(two.matches("kla at 30 deg").count(), 2);
        assert!(two.contains("AP load (N)") && two.contains("AP (mm)") && two.contains("with the answer"));
        assert!(!picture(&[curve(None)]).contains("with the answer"));
        assert_ne!(two, picture(&[curve(Some(0.1)), curve(Some(0.12))]));
        assert!(picture(&[]).is_empty());
    }
}
