//! Springs of a FEBio file as the law of a fibre: slack, toe, line.

use crate::DeckError;
use crate::laws::{LEAST_END, between};
use crate::tree::{Tree, brief, text};
use roxmltree::Node;
use sim::ligament::of_fibres;
use sim::spec::{BundleSpec, Law, fibre_damping};

/// Toe of a spring that has none [-]: with stiffness k its force is off by at most a quarter of k times the toe. Ours.
const NO_TOE: f64 = 1e-4;
/// A curve that departs from slack, toe and line by more than this share of its largest force is another law [-]. Ours.
const OTHER_LAW: f64 = 0.1;
/// A toe that is written by chords, as exports do, is off by a sixteen-hundredth of stiffness times toe; so much is no departure [-]. Ours.
const CHORDS: f64 = 1e-3;
/// Parts of the line between two points, at whose ends a law is compared with a curve [-]. Ours.
const PARTS: usize = 4;
/// A law whose force no longer grows so many toes behind a curve's end has an end itself [-]. Ours.
const FAR_TOES: f64 = 1000.0;
/// A slope below this share of the steepest is none [-]. Ours: forces are written with a few digits.
const FLAT: f64 = 1e-6;

/// What a curve is a function of.
#[derive(Clone, Copy, PartialEq)]
enum Measure {
    Elongation,
    Strain,
    Stretch,
}

/// A spring's material: force [N] over its measure.
pub(super) struct Spring {
    measure: Measure,
    points: Vec<[f64; 2]>,
    /// Whether the force stays what it is beyond the last point.
    pub(super) ends: bool,
    /// Points that are joined by curves in FEBio.
    pub(super) smooth: bool,
}

/// A spring's law about its own length in the file.
pub(super) struct Fitted {
    /// Lengthening at which it begins to pull [mm].
    pub(super) slack: f64,
    pub(super) toe: f64,
    pub(super) stiffness: f64,
    pub(super) law: Law,
    pub(super) end: Option<f64>,
    /// Largest distance from the curve [N], and how much of it the law itself owes: chords, or a toe where the curve has none.
    pub(super) off: f64,
    pub(super) owed: f64,
    /// Whether the curve has force where it is shorter than slack.
    pub(super) pushes: bool,
    /// Lengthening from which the force stays there and grows here [mm].
    pub(super) stays: Option<f64>,
}

impl Spring {
    /// The law of a discrete_material; `curves` are the load curves, with their numbers.
    ///
    /// Errors: numbers that cannot be read, a formula or steps in place of points.
    pub(super) fn new(
        tree: &Tree<'_>,
        node: Node<'_, '_>,
        curves: &[(String, Node<'_, '_>)],
    ) -> Result<Spring, DeckError> {
        let kind = node.attribute("type").unwrap_or("").trim();
        if kind != "nonlinear spring" {
            let e = tree.number(node, "E", 0.0)?;
            if e <= 0.0 {
                return Err(tree.error(node, format!("E is {e}, expected N/mm, above 0")));
            }
            let under = if kind == "linear spring" { -e } else { 0.0 };
            let points = vec![[-1.0, under], [0.0, 0.0], [1.0, e]];
            return Ok(Spring { measure: Measure::Elongation, points, ends: false, smooth: false });
        }
        let measure = match text(node, "measure").unwrap_or("elongation").to_lowercase().as_str() {
            "elongation" | "0" => Measure::Elongation,
            "strain" | "1" => Measure::Strain,
            "stretch" | "2" => Measure::Stretch,
            other => {
                let what = format!("measure is \"{}\", expected elongation, strain or stretch", brief(other));
                return Err(tree.error(node, what));
            }
        };
        let scale = tree.number(node, "scale", 1.0)?;
        let force = crate::tree::child(node, "force")
            .ok_or_else(|| tree.error(node, "there is no <force>; expected a curve of points"))?;
        let mut out = function(tree, force, curves)?;
        out.measure = measure;
        out.points.iter_mut().for_each(|p| p[1] *= scale);
        if out.points.len() < 2 || out.points.windows(2).any(|w| w[1][0] <= w[0][0]) {
            let what =
                format!("its curve has {} points, expected two or more whose first numbers ascend", out.points.len());
            return Err(tree.error(force, what));
        }
        Ok(out)
    }

    /// The curve over lengthening [mm] of a spring of `length` mm.
    fn over_lengthening(&self, length: f64) -> Vec<[f64; 2]> {
        let at = |x: f64| match self.measure {
            Measure::Elongation => x,
            Measure::Strain => x * length,
            Measure::Stretch => (x - 1.0) * length,
        };
        self.points.iter().map(|[x, f]| [at(*x), *f]).collect()
    }

    /// Slack, toe and line of a spring of `length` mm; the error says what its curve lacks.
    pub(super) fn fit(&self, length: f64) -> Result<Fitted, String> {
        let mut curve = self.over_lengthening(length);
        let largest = curve.iter().map(|p| p[1]).fold(0.0, f64::max);
        if largest <= 0.0 {
            return Err("its curve never pulls".into());
        }
        let slope = |w: &[[f64; 2]]| (w[1][1] - w[0][1]) / (w[1][0] - w[0][0]);
        let steepest = curve.windows(2).map(slope).fold(0.0, f64::max);
        let mut flat = false;
        while curve.len() > 2 && slope(&curve[curve.len() - 2..]).abs() <= FLAT * steepest {
            curve.pop();
            flat = true;
        }
        let stiffness = slope(&curve[curve.len() - 2..]);
        if stiffness <= 0.0 {
            return Err("its curve falls at its end".into());
        }
        let last = curve[curve.len() - 1];
        let begins = begin(&curve);
        let root = last[0] - last[1] / stiffness;
        let least = NO_TOE * (length + begins);
        let toe = (root - begins).max(least);
        let slack = if root - begins > least { begins } else { root - toe };
        let ends = flat || self.ends;
        let end = flat.then(|| (last[0] - slack) / toe).filter(|end| *end >= LEAST_END);
        let numbers = numbers(length, slack, toe, stiffness);
        let fits = Law::ALL.map(|law| beside(&curve, &BundleSpec { law, ..numbers.clone() }, slack, end));
        let Beside { law, end, off, at_toe } =
            fits.into_iter().flatten().min_by(|a, b| a.off.total_cmp(&b.off)).ok_or("its numbers are no fibre's")?;
        if off > OTHER_LAW * last[1] {
            return Err(format!("its curve departs from slack, toe and line by {off:.3} N of {:.3}", last[1]));
        }
        let owed = if root - begins > least { CHORDS * stiffness * toe } else { at_toe };
        let pushes = curve.iter().any(|p| p[1] < -FLAT * largest);
        let stays = (ends && end.is_none()).then_some(last[0]);
        Ok(Fitted { slack, toe, stiffness, law, end, off, owed, pushes, stays })
    }
}

/// Where a curve begins to pull.
fn begin(curve: &[[f64; 2]]) -> f64 {
    match curve.iter().rposition(|p| p[1] <= 0.0) {
        None => curve[0][0],
        Some(k) if k + 1 < curve.len() => {
            let ([x0, f0], [x1, f1]) = (curve[k], curve[k + 1]);
            x0 - f0 * (x1 - x0) / (f1 - f0)
        }
        Some(k) => curve[k][0],
    }
}

/// A law beside a curve.
struct Beside {
    law: Law,
    /// The multiple of the toe at which the law ends, where it does.
    end: Option<f64>,
    /// How far it departs from the curve where that pulls [N].
    off: f64,
    /// Its force one toe behind slack, where a line without a toe begins [N].
    at_toe: f64,
}

/// The numbers of a fibre that is `length` mm long in its file and begins to pull `slack` mm beyond.
fn numbers(length: f64, slack: f64, toe: f64, stiffness: f64) -> BundleSpec {
    let rest = length + slack;
    BundleSpec {
        name: String::new(),
        reference_strain: length / rest,
        stiffness_n_per_mm: stiffness,
        reference_length_mm: length,
        toe_strain: toe / rest,
        law: Law::Smooth,
        damping_n_s_per_mm: fibre_damping(),
    }
}

/// A law beside the curve; none of numbers that no law has, and none that ends where the curve goes on.
fn beside(curve: &[[f64; 2]], spec: &BundleSpec, slack: f64, end: Option<f64>) -> Option<Beside> {
    let bundle = of_fibres(spec, 1, end).ok()?;
    let toe = bundle.toe_mm();
    let ends = bundle.response((FAR_TOES + end.unwrap_or(0.0)) * toe).stiffness <= 0.0;
    if ends && end.is_none() {
        return None;
    }
    let off = |[x, f]: [f64; 2]| (f.max(0.0) - bundle.response(x - slack).force).abs();
    Some(Beside {
        law: spec.law,
        end: end.filter(|_| ends),
        off: between(curve, PARTS).map(off).fold(0.0, f64::max),
        at_toe: bundle.response(toe).force,
    })
}

/// The points of a force, its own or of a load curve.
fn function(tree: &Tree<'_>, force: Node<'_, '_>, curves: &[(String, Node<'_, '_>)]) -> Result<Spring, DeckError> {
    let plain = |points| Spring { measure: Measure::Elongation, points, ends: false, smooth: false };
    match (force.attribute("type").map(str::trim), force.attribute("lc").map(str::trim)) {
        (Some("linear ramp"), _) => {
            let (slope, at) = (tree.number(force, "slope", 1.0)?, tree.number(force, "intercept", 0.0)?);
            Ok(plain(vec![[-1.0, at - slope], [0.0, at], [1.0, at + slope]]))
        }
        (Some("const"), _) => Err(tree.error(force, "is one force at every length; expected a curve of points")),
        (Some("point"), _) => points(tree, force),
        (_, Some(number)) => {
            let own = curves.iter().find(|(id, _)| id == number);
            let Some((_, curve)) = own else {
                return Err(tree.error(force, format!("there is no load curve {}", brief(number))));
            };
            let factor = match tree.numbers_in(force)?[..] {
                [factor] => factor,
                [] => 1.0,
                _ => return Err(tree.error(force, "it has several numbers, expected the factor of its load curve")),
            };
            let mut read = points(tree, *curve)?;
            read.points.iter_mut().for_each(|p| p[1] *= factor);
            Ok(read)
        }
        _ => Err(tree.error(force, "it has neither a type nor a load curve (lc); expected a curve of points")),
    }
}

/// The points of a curve and how it goes on.
fn points(tree: &Tree<'_>, node: Node<'_, '_>) -> Result<Spring, DeckError> {
    let word = |names: [&str; 2]| {
        let own = text(node, names[0]).or_else(|| node.attribute(names[1]));
        own.unwrap_or("").trim().to_lowercase()
    };
    let interpolate = word(["interpolate", if node.tag_name().name() == "loadcurve" { "type" } else { "-" }]);
    if interpolate == "step" {
        return Err(tree.error(node, "its curve is of steps; expected interpolate LINEAR"));
    }
    let extend = word(["extend", "extend"]);
    if extend.starts_with("repeat") {
        return Err(tree.error(node, "its curve repeats itself; expected extend EXTRAPOLATE or CONSTANT"));
    }
    let mut found = Vec::new();
    for point in node.descendants().filter(|n| ["pt", "point"].contains(&n.tag_name().name())) {
        let given = tree.numbers_in(point)?;
        let Ok(pair) = <[f64; 2]>::try_from(given.as_slice()) else {
            return Err(tree.error(point, format!("a point has {} numbers, expected 2", given.len())));
        };
        found.push(pair);
    }
    let smooth = !["", "linear"].contains(&interpolate.as_str());
    Ok(Spring { measure: Measure::Elongation, points: found, ends: extend != "extrapolate", smooth })
}
