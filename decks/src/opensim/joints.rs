//! Joints of an OpenSim model: how the child's frame stands in the parent's, and about which axes it turns.

use super::MM_PER_M;
use crate::DeckError;
use crate::tree::{Tree, child, name_of, text};
use meshes::{Isometry, Vector};
use nalgebra::{Translation3, Unit, UnitQuaternion};
use roxmltree::Node;
use std::collections::BTreeMap;

/// Points of a spline are no more than this. Ours.
const MOST_POINTS: usize = 10_000;

/// A joint is turned by no more than this in a model's default pose [rad], 200 deg. Ours.
const MOST_TURN: f64 = 3.5;

/// A frame: its body, and where it is in that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Index of the body.
    pub(super) body: usize,
    /// From the frame's coordinates to the body's [mm].
    pub(super) place: Isometry,
}

/// A joint.
pub(super) struct Joint<'a, 'i> {
    pub(super) node: Node<'a, 'i>,
    pub(super) parent: Frame,
    pub(super) child: Frame,
    axes: Vec<Axis>,
    coordinates: usize,
}

/// An axis about which, or along which, a joint moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    turns: bool,
    direction: Unit<Vector>,
    /// Angle [rad] or shift [m] at the default pose, and where all coordinates are 0.
    amounts: [f64; 2],
    driven: bool,
}

impl Joint<'_, '_> {
    /// Whether nothing moves in it.
    pub(super) fn is_rigid(&self) -> bool {
        self.coordinates == 0
    }

    /// From the child body's coordinates to the parent body's [mm].
    pub(super) fn motion(&self, at_zero: bool) -> Isometry {
        self.parent.place * self.within(at_zero) * self.child.place.inverse()
    }

    /// From the child frame's coordinates to the parent frame's [mm]: turns one after another, shifts along axes of the parent.
    fn within(&self, at_zero: bool) -> Isometry {
        let (mut turn, mut shift) = (UnitQuaternion::identity(), Vector::zeros());
        for axis in &self.axes {
            let amount = axis.amounts[usize::from(at_zero)];
            if axis.turns {
                turn *= UnitQuaternion::from_axis_angle(&axis.direction, amount);
            } else {
                shift += axis.direction.into_inner() * amount * MM_PER_M;
            }
        }
        Isometry::from_parts(Translation3::from(shift), turn)
    }

    /// Axes of its turns in the parent body's coordinates where all coordinates are 0, and whether a coordinate drives them.
    pub(super) fn turns(&self) -> impl Iterator<Item = (Vector, bool)> {
        let mut turn = UnitQuaternion::identity();
        self.axes.iter().filter(|a| a.turns).map(move |a| {
            let direction = self.parent.place.rotation * turn * a.direction.into_inner();
            turn *= UnitQuaternion::from_axis_angle(&a.direction, a.amounts[1]);
            (direction, a.driven)
        })
    }
}

/// Reads a joint between two frames, its parent's and its child's.
///
/// Errors: one body twice, an axis without a direction, a function that is not read.
pub(super) fn joint<'a, 'i>(
    tree: &Tree<'_>,
    [parent, child]: [Frame; 2],
    node: Node<'a, 'i>,
) -> Result<Joint<'a, 'i>, DeckError> {
    let coordinates = coordinates(tree, node)?;
    let values: Vec<f64> = coordinates.iter().map(|(_, value)| *value).collect();
    let axes = match node.tag_name().name() {
        "CustomJoint" => custom(tree, node, &coordinates)?,
        class => plain(class, &values),
    };
    if let Some(turn) = axes.iter().filter(|a| a.turns).map(|a| a.amounts[0].abs()).find(|turn| *turn > MOST_TURN) {
        let what = format!(
            "its coordinates' default values turn it by {turn} rad; expected {MOST_TURN} at most: are they in degrees?"
        );
        return Err(tree.error(node, what));
    }
    if parent.body == child.body {
        return Err(tree.error(node, "joins a body with itself; expected two bodies"));
    }
    let coordinates = if node.tag_name().name() == "WeldJoint" { 0 } else { coordinates.len() };
    Ok(Joint { node, parent, child, axes, coordinates })
}

/// Names and default values of a joint's coordinates.
fn coordinates<'a>(tree: &Tree<'_>, node: Node<'a, '_>) -> Result<Vec<(&'a str, f64)>, DeckError> {
    let list = child(node, "coordinates").into_iter().flat_map(|c| c.children());
    list.filter(|c| c.tag_name().name() == "Coordinate")
        .map(|c| Ok((name_of(c), tree.number(c, "default_value", 0.0)?)))
        .collect()
}

/// The axes of a joint of a kind that has its own.
fn plain(class: &str, values: &[f64]) -> Vec<Axis> {
    let (x, y, z) = (Vector::x_axis(), Vector::y_axis(), Vector::z_axis());
    let kinds: &[(bool, Unit<Vector>)] = match class {
        "PinJoint" => &[(true, z)],
        "SliderJoint" => &[(false, x)],
        "UniversalJoint" => &[(true, x), (true, y)],
        "GimbalJoint" | "BallJoint" => &[(true, x), (true, y), (true, z)],
        "PlanarJoint" => &[(true, z), (false, x), (false, y)],
        "FreeJoint" => &[(true, x), (true, y), (true, z), (false, x), (false, y), (false, z)],
        _ => &[],
    };
    let values = values.iter().copied().chain(std::iter::repeat(0.0));
    let axis = |(&(turns, direction), value)| Axis { turns, direction, amounts: [value, 0.0], driven: true };
    kinds.iter().zip(values).map(axis).collect()
}

/// The axes of a CustomJoint: rotation1 to 3, then translation1 to 3.
fn custom(tree: &Tree<'_>, node: Node<'_, '_>, coordinates: &[(&str, f64)]) -> Result<Vec<Axis>, DeckError> {
    let values: BTreeMap<&str, f64> = coordinates.iter().copied().collect();
    let Some(transform) = child(node, "SpatialTransform") else {
        return Err(tree.error(node, "<SpatialTransform> is missing"));
    };
    let usual = [Vector::x_axis(), Vector::y_axis(), Vector::z_axis()];
    let mut axes = Vec::new();
    for (k, name) in
        ["rotation1", "rotation2", "rotation3", "translation1", "translation2", "translation3"].iter().enumerate()
    {
        let (turns, usual) = (k < 3, usual[k % 3]);
        let found = transform.children().find(|c| c.tag_name().name() == "TransformAxis" && name_of(*c) == *name);
        let Some(given) = found else {
            axes.push(Axis { turns, direction: usual, amounts: [0.0; 2], driven: false });
            continue;
        };
        let direction = Vector::from(tree.numbers(given, "axis", usual.into_inner().into())?);
        let Some(direction) = Unit::try_new(direction, 1e-6) else {
            return Err(tree.error(given, "its axis has no length; expected a direction"));
        };
        let names: Vec<&str> = text(given, "coordinates").unwrap_or("").split_whitespace().collect();
        let mut at = Vec::new();
        for one in &names {
            let Some(value) = values.get(one) else {
                return Err(tree.error(given, format!("names the coordinate {one}, which its joint does not have")));
            };
            at.push(*value);
        }
        let zeros = vec![0.0; at.len()];
        let amounts = [amount(tree, given, &at)?, amount(tree, given, &zeros)?];
        let driven = !names.is_empty() && !constant(given);
        axes.push(Axis { turns, direction, amounts, driven });
    }
    Ok(axes)
}

/// Functions that are read.
const FUNCTIONS: [&str; 6] =
    ["Constant", "LinearFunction", "PolynomialFunction", "PiecewiseLinearFunction", "SimmSpline", "MultiplierFunction"];

/// The function of an axis: it stands in it by its class, or within <function>.
fn function<'a, 'i>(of: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    let read = |n: Node<'a, 'i>| n.children().find(|c| FUNCTIONS.contains(&c.tag_name().name()));
    let any = || child(of, "function").and_then(|f| f.children().find(Node::is_element));
    read(of).or_else(|| child(of, "function").and_then(read)).or_else(any)
}

fn constant(axis: Node<'_, '_>) -> bool {
    let inner = |f: Node<'_, '_>| function(f).is_some_and(|g| g.tag_name().name() == "Constant");
    function(axis).is_none_or(|f| match f.tag_name().name() {
        "Constant" => true,
        "MultiplierFunction" => inner(f),
        _ => false,
    })
}

/// The value of an axis' function where its coordinates have the values `at`.
fn amount(tree: &Tree<'_>, axis: Node<'_, '_>, at: &[f64]) -> Result<f64, DeckError> {
    let Some(mut f) = function(axis) else { return Ok(0.0) };
    let mut scale = 1.0;
    // a scaled model has a factor about each function; they nest no deeper than the file
    while f.tag_name().name() == "MultiplierFunction" {
        scale *= tree.number(f, "scale", 1.0)?;
        let Some(inner) = function(f) else { return Err(tree.error(f, "<function> is missing")) };
        f = inner;
    }
    let x = at.first().copied().unwrap_or(0.0);
    let list = |name: &str| tree.list(f, name);
    let value = match f.tag_name().name() {
        "Constant" => tree.number(f, "value", 0.0)?,
        "LinearFunction" => {
            let c = list("coefficients")?;
            c.iter().zip(at).map(|(c, x)| c * x).sum::<f64>() + c.get(at.len()).copied().unwrap_or(0.0)
        }
        "PolynomialFunction" => list("coefficients")?.iter().fold(0.0, |sum, c| sum * x + c),
        "PiecewiseLinearFunction" | "SimmSpline" => {
            let (xs, ys) = (list("x")?, list("y")?);
            if xs.len() != ys.len() || xs.is_empty() || xs.len() > MOST_POINTS || xs.windows(2).any(|w| w[1] <= w[0]) {
                let what = "expected as many <y> as <x>, which ascend, and at least one";
                return Err(tree.error(f, what));
            }
            if f.tag_name().name() == "SimmSpline" { spline(&xs, &ys, x) } else { lines(&xs, &ys, x) }
        }
        other => {
            return Err(tree.error(
                axis,
                format!("its function is a {other}, which is not read; expected one of {}", FUNCTIONS.join(", ")),
            ));
        }
    };
    Ok(scale * value)
}

/// Linear between points, and beyond them.
fn lines(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    if xs.len() == 1 {
        return ys[0];
    }
    let k = xs.partition_point(|p| *p <= x).clamp(1, xs.len() - 1);
    ys[k - 1] + (x - xs[k - 1]) * (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1])
}

/// The cubic spline through the points with no curvature jump at the second and last but one, as SIMM has it; linear beyond.
///
/// OpenSim's SimmSpline takes the third derivative of its ends from a cubic through four points.
fn spline(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    let n = xs.len();
    if n < 4 {
        return lines(xs, ys, x);
    }
    let [b, c, d] = coefficients(xs, ys);
    if x < xs[0] {
        return ys[0] + (x - xs[0]) * b[0];
    }
    if x > xs[n - 1] {
        return ys[n - 1] + (x - xs[n - 1]) * b[n - 1];
    }
    let k = xs.partition_point(|p| *p <= x).clamp(1, n) - 1;
    let dx = x - xs[k];
    ys[k] + dx * (b[k] + dx * (c[k] + dx * d[k]))
}

/// Slopes, halved curvatures and sixths of third derivatives at each point.
fn coefficients(xs: &[f64], ys: &[f64]) -> [Vec<f64>; 3] {
    let n = xs.len();
    let step = |k: usize| xs[k + 1] - xs[k];
    let slope = |k: usize| (ys[k + 1] - ys[k]) / step(k);
    let (mut b, mut c, mut d) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for k in 1..n - 1 {
        b[k] = 2.0 * (step(k - 1) + step(k));
        d[k] = step(k);
        c[k] = slope(k) - slope(k - 1);
    }
    (b[0], b[n - 1], d[0]) = (-step(0), -step(n - 2), step(0));
    let third = |k: usize| c_of(&c, xs, k);
    let ends = [third(2) - third(1), third(n - 2) - third(n - 3)];
    c[0] = ends[0] * step(0).powi(2) / (xs[3] - xs[0]);
    c[n - 1] = -ends[1] * step(n - 2).powi(2) / (xs[n - 1] - xs[n - 4]);
    for k in 1..n {
        let t = step(k - 1) / b[k - 1];
        b[k] -= t * step(k - 1);
        c[k] -= t * c[k - 1];
    }
    c[n - 1] /= b[n - 1];
    for k in (0..n - 1).rev() {
        c[k] = (c[k] - step(k) * c[k + 1]) / b[k];
    }
    b[n - 1] = slope(n - 2) + step(n - 2) * (c[n - 2] + 2.0 * c[n - 1]);
    for k in 0..n - 1 {
        b[k] = slope(k) - step(k) * (c[k + 1] + 2.0 * c[k]);
        d[k] = (c[k + 1] - c[k]) / step(k);
        c[k] *= 3.0;
    }
    c[n - 1] *= 3.0;
    d[n - 1] = d[n - 2];
    [b, c, d]
}

/// The divided difference of slopes at an inner point.
fn c_of(c: &[f64], xs: &[f64], k: usize) -> f64 {
    c[k] / (xs[k + 1] - xs[k - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::approx_constant, reason = "knots as a file of OpenSim has them")]
    fn a_spline_is_that_of_opensim() {
        let xs = [-2.0944, -1.74533, -1.39626, -1.0472, -0.698132, 0.0, 0.3];
        let ys = [-0.0032, 0.00179, 0.00411, 0.0041, 0.00212, -0.0041, -0.00525];
        // of SimmSpline::calcValue in OpenSim 4.6
        for (x, wanted) in [
            (-2.5, -0.010681892778015461),
            (-2.0, -0.0015676547657113471),
            (-1.5, 0.0036788093470321807),
            (-1.2, 0.004370772750249963),
            (-0.9, 0.0034765569555487434),
            (-0.3, -0.001576568185369546),
            (0.1, -0.004685628992466421),
            (0.5, -0.005336944282233348),
        ] {
            assert!((spline(&xs, &ys, x) - wanted).abs() < 1e-15, "{x}: {} {wanted}", spline(&xs, &ys, x));
        }
        assert_eq!(lines(&[0.0, 1.0, 3.0], &[1.0, 2.0, 0.0], 2.0), 1.0);
        assert_eq!(lines(&[0.0, 1.0, 3.0], &[1.0, 2.0, 0.0], 4.0), -1.0);
    }
}
