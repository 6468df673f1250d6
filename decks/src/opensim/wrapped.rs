//! Ligaments that wrap over an object there: how much of the straight line that is taken here lies within it.
//!
//! OpenSim leads a path over a WrapSphere, a WrapEllipsoid, a WrapCylinder (its axis is z) or a WrapTorus (its circle lies about z) where the line
//! would run through it. Here the line stays straight. What of it lies within the object says where the model differs from the file.

use super::MM_PER_M;
use super::knee::Knee;
use super::places::Places;
use crate::DeckError;
use crate::tree::{Tree, brief, child, name_of, text};
use meshes::Point;
use roxmltree::Node;
use std::collections::BTreeMap;

/// Classes of objects that paths wrap over.
const CLASSES: [&str; 4] = ["WrapCylinder", "WrapEllipsoid", "WrapSphere", "WrapTorus"];
/// Frames that hold such objects.
const FRAMES: [&str; 3] = ["Body", "Ground", "PhysicalOffsetFrame"];
/// Distance between the places of a line that are looked at [mm]: half of the last digit that a warning has.
const STEP_MM: f64 = 0.05;
/// Most places of a line that are looked at [-]: a ligament of 200 mm at that distance, and a longer one more coarsely. Ours.
const MOST_STEPS: f64 = 4000.0;
/// Halvings of a search for the nearest place of an ellipsoid [-]: to 1e-12 of its least half axis, and none where a number would be 0 over 0.
const HALVINGS: usize = 40;

/// The shape of an object about its own axes [mm].
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Half of each axis.
    Ellipsoid([f64; 3]),
    /// Radius, and half the length along z.
    Cylinder([f64; 2]),
    /// Radius of the tube, and of the circle that its middle makes about z.
    Torus([f64; 2]),
}

/// The objects of a model that paths may wrap over, by name; the first of a name counts, as in OpenSim.
pub(super) struct Objects<'a, 'i>(BTreeMap<&'a str, Node<'a, 'i>>);

impl<'a, 'i> Objects<'a, 'i> {
    /// Those in the file to which `one` belongs.
    pub(super) fn of(one: Option<&Node<'a, 'i>>) -> Self {
        let mut all = BTreeMap::new();
        let nodes = one.into_iter().flat_map(|n| n.document().descendants());
        for node in nodes.filter(|n| CLASSES.contains(&n.tag_name().name())) {
            all.entry(name_of(node)).or_insert(node);
        }
        Objects(all)
    }

    /// What a warning says of a ligament whose path, a GeometryPath, leads over these points [mm, in the tibia's coordinates]; nothing where it wraps over no
    /// object that acts.
    ///
    /// Errors: numbers that cannot be read.
    pub(super) fn told(
        &self,
        (tree, places, knee): (&Tree<'_>, &Places<'a, 'i>, &Knee),
        path: Node<'a, 'i>,
        way: &[Point],
    ) -> Result<Option<String>, DeckError> {
        let set = child(path, "PathWrapSet");
        let wraps = set.into_iter().flat_map(|s| s.descendants()).filter(|n| n.tag_name().name() == "PathWrap");
        let mut told = Vec::new();
        for wrap in wraps {
            let name = text(wrap, "wrap_object").unwrap_or("");
            let Some(object) = self.0.get(name).copied() else {
                told.push(format!("over \"{}\", which the file does not have", brief(name)));
                continue;
            };
            if tree.flag(object, "active", true)? {
                told.push(beneath((tree, places, knee), object, within_range(tree, wrap, way)?)?);
            }
        }
        Ok(Some(told.join("; ")).filter(|words| !words.is_empty()))
    }
}

/// The points of a path that may wrap: those from the first to the second number of `range`, counted from 1; without numbers above 0, all.
fn within_range<'w>(tree: &Tree<'_>, wrap: Node<'_, '_>, way: &'w [Point]) -> Result<&'w [Point], DeckError> {
    let [from, to] = tree.numbers(wrap, "range", [-1.0; 2])?;
    let first = if from >= 1.0 { from as usize - 1 } else { 0 };
    let end = if to >= 1.0 { (to as usize).min(way.len()) } else { way.len() };
    Ok(way.get(first..end).unwrap_or_default())
}

/// What a warning says of a straight path and an object.
fn beneath<'a, 'i>(
    (tree, places, knee): (&Tree<'_>, &Places<'a, 'i>, &Knee),
    object: Node<'a, 'i>,
    way: &[Point],
) -> Result<String, DeckError> {
    let name = brief(name_of(object));
    let holder = object.ancestors().skip(1).find(|a| FRAMES.contains(&a.tag_name().name()));
    let Some(frame) = holder.map(|h| places.frame(h)).transpose()? else {
        return Ok(format!("over {name}, which is on no body"));
    };
    let Some(body) = knee.place(frame.body) else {
        return Ok(format!("over {name} on {}, which is no part of femur and tibia", places.name(frame.body)));
    };
    let Some(shape) = Shape::of(tree, object)? else {
        return Ok(format!("over {name}, whose size is not above 0"));
    };
    let into = (body * frame.place * tree.motion(object, "translation", "xyz_body_rotation")?).inverse();
    let way: Vec<Point> = way.iter().map(|p| into * p).collect();
    let [long, deep] = shape.within(&way);
    let side = text(object, "quadrant").filter(|q| !["", "all"].contains(&q.to_lowercase().as_str()));
    let end = match way.iter().any(|p| shape.stops(p)) {
        true => ", with an end of it: OpenSim leaves it straight too",
        false => "",
    };
    Ok(match (long > 0.0, side) {
        (true, _) => format!("{long:.1} mm of the line lie within {name}, {deep:.1} mm deep at most{end}"),
        (false, None) => format!("the line passes beside {name}"),
        // it may be led over that side from without
        (false, Some(side)) => format!("the line passes beside {name}, over whose side {} it has to go", brief(side)),
    })
}

impl Shape {
    /// The shape of an object; none where a length is not above 0.
    fn of(tree: &Tree<'_>, object: Node<'_, '_>) -> Result<Option<Shape>, DeckError> {
        let length = |name: &str| Ok::<f64, DeckError>(tree.number(object, name, 0.0)? * MM_PER_M);
        let (shape, lengths) = match object.tag_name().name() {
            "WrapCylinder" => {
                let lengths = [length("radius")?, length("length")? / 2.0];
                (Shape::Cylinder(lengths), lengths.to_vec())
            }
            "WrapTorus" => {
                let lengths = [length("inner_radius")?, length("outer_radius")?];
                (Shape::Torus(lengths), lengths.to_vec())
            }
            class => {
                let half = match class {
                    "WrapSphere" => [length("radius")?; 3],
                    _ => tree.numbers(object, "dimensions", [0.0; 3])?.map(|x| x * MM_PER_M),
                };
                (Shape::Ellipsoid(half), half.to_vec())
            }
        };
        Ok(lengths.iter().all(|x| *x > 0.0).then_some(shape))
    }

    /// How deep a point lies under the surface [mm]: the way out of an ellipsoid, and sideways out of a cylinder or a torus. Not above 0 outside.
    fn depth(self, p: &Point) -> f64 {
        match self {
            Shape::Ellipsoid(half) => under_ellipsoid(half, p),
            Shape::Cylinder([radius, half]) if p.z.abs() < half => radius - p.x.hypot(p.y),
            Shape::Cylinder(_) => 0.0,
            Shape::Torus([tube, circle]) => tube - (p.x.hypot(p.y) - circle).hypot(p.z),
        }
    }

    /// Whether OpenSim leads no line over the object that ends at this point: within an ellipsoid, or nearer to a cylinder's axis than its radius, beyond
    /// its ends too.
    fn stops(self, p: &Point) -> bool {
        match self {
            Shape::Ellipsoid(_) => self.depth(p) > 0.0,
            Shape::Cylinder([radius, _]) => p.x.hypot(p.y) < radius,
            Shape::Torus(_) => false,
        }
    }

    /// How much of a path lies within [mm], and how deep at most [mm].
    fn within(self, way: &[Point]) -> [f64; 2] {
        let (mut long, mut deep) = (0.0, 0.0_f64);
        for ends in way.windows(2) {
            let (from, along) = (ends[0], ends[1] - ends[0]);
            let steps = (along.norm() / STEP_MM).ceil().clamp(1.0, MOST_STEPS);
            for k in 0..steps as usize {
                let depth = self.depth(&(from + along * ((k as f64 + 0.5) / steps)));
                if depth > 0.0 {
                    long += along.norm() / steps;
                    deep = deep.max(depth);
                }
            }
        }
        [long, deep]
    }
}

/// How deep a point lies under an ellipsoid's surface [mm]; 0 outside.
///
/// The way to the nearest place `x` of the surface stands upright on it. So `x = a^2 y / (a^2 + t)` along each half axis `a`, with one `t`, below 0 for
/// a point `y` within, that puts `x` on the surface. In the plane across the least half axis there may be none: then that axis leads out.
fn under_ellipsoid(half: [f64; 3], p: &Point) -> f64 {
    let y = [p.x, p.y, p.z].map(f64::abs);
    let share = |x: &[f64; 3], k: usize| (x[k] / half[k]).powi(2);
    let sum = |x: &[f64; 3]| (0..3).map(|k| share(x, k)).sum::<f64>();
    if sum(&y) >= 1.0 {
        return 0.0;
    }
    let at = |t: f64| -> [f64; 3] { std::array::from_fn(|k| half[k].powi(2) * y[k] / (half[k].powi(2) + t)) };
    let least = if half[0] <= half[1].min(half[2]) { 0 } else { 1 + usize::from(half[2] < half[1]) };
    let (mut low, mut high) = (-half[least].powi(2), 0.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if sum(&at(middle)) > 1.0 { low = middle } else { high = middle }
    }
    let mut x = at(high);
    let others: f64 = (0..3).filter(|k| *k != least).map(|k| share(&x, k)).sum();
    x[least] = half[least] * (1.0 - others).max(0.0).sqrt();
    (0..3).map(|k| (x[k] - y[k]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Warnings have lengths to a tenth [mm].
    const TOLD_MM: f64 = 0.05;

    fn near(found: [f64; 2], expected: [f64; 2]) -> bool {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < TOLD_MM)
    }

    #[test]
    fn chords_of_every_shape_are_as_long_and_as_deep_as_geometry_says() {
        let line = |a: [f64; 3], b: [f64; 3]| [Point::from(a), Point::from(b)];
        let chord = |radius: f64, off: f64| 2.0 * (radius * radius - off * off).sqrt();
        let across = |x: f64| line([x, -50.0, 0.0], [x, 50.0, 0.0]);
        let ball = Shape::Ellipsoid([10.0; 3]);
        let cylinder = Shape::Cylinder([10.0, 5.0]);
        let torus = Shape::Torus([4.0, 20.0]);
        let long = Shape::Ellipsoid([10.0, 20.0, 30.0]);
        for (shape, way, expected) in [
            (ball, across(6.0), [chord(10.0, 6.0), 4.0]),
            (ball, across(0.0), [20.0, 10.0]),
            (ball, across(11.0), [0.0, 0.0]),
            (cylinder, across(6.0), [chord(10.0, 6.0), 4.0]),
            // beyond its end, and out of one end of it
            (cylinder, line([6.0, -50.0, 6.0], [6.0, 50.0, 6.0]), [0.0, 0.0]),
            (cylinder, line([6.0, 0.0, 0.0], [6.0, 0.0, 50.0]), [5.0, 4.0]),
            // through the tube on both sides, and through the hole
            (torus, across(0.0), [16.0, 4.0]),
            (torus, line([0.0, 0.0, -50.0], [0.0, 0.0, 50.0]), [0.0, 0.0]),
            // along each axis: the least half axis leads out of the middle
            (long, line([-50.0, 0.0, 0.0], [50.0, 0.0, 0.0]), [20.0, 10.0]),
            (long, line([0.0, 0.0, -50.0], [0.0, 0.0, 50.0]), [60.0, 10.0]),
        ] {
            let found = shape.within(&way);
            assert!(near(found, expected), "{shape:?} {way:?}: {found:?}, expected {expected:?}");
            let [a, b] = way;
            let halved = shape.within(&[a, a + (b - a) * 0.4, b]);
            assert!(near(halved, expected), "{shape:?} in two lines: {halved:?}");
        }
    }

    #[test]
    fn no_place_of_an_ellipsoid_is_nearer_than_the_depth_and_one_is_as_near() {
        let half = [10.0, 14.0, 25.0];
        let on =
            |u: f64, v: f64| Point::new(half[0] * u.cos() * v.cos(), half[1] * u.sin() * v.cos(), half[2] * v.sin());
        for p in [[3.0, 4.0, 5.0], [-1.0, 8.0, -12.0], [0.0, 5.0, 0.0], [0.0, 0.0, 22.0], [9.5, 0.0, 0.0], [0.0; 3]] {
            let p = Point::from(p);
            let turns = |n: usize| (0..=n).map(move |k| std::f64::consts::PI * (2.0 * k as f64 / n as f64 - 1.0));
            let nearest = turns(720)
                .flat_map(|u| turns(720).map(move |v| (u, v)))
                .map(|(u, v)| (on(u, v) - p).norm())
                .fold(f64::INFINITY, f64::min);
            let depth = under_ellipsoid(half, &p);
            assert!((depth - nearest).abs() < TOLD_MM, "{p}: {depth}, the nearest of many places {nearest}");
        }
        assert!(under_ellipsoid(half, &Point::new(10.0, 1.0, 0.0)) <= 0.0, "outside");
    }
}
