//! The knee's anatomical frames and side: stated by node sets, else by the axes of rigid joints, else by the ligaments.

use super::bodies::{Bodies, Knee};
use super::known::key;
use super::mesh::Mesh;
use crate::DeckError;
use crate::axes::{Axes, ONE_AXIS, Raw, Shown, side, side_by_name, square, turned};
use crate::tree::{Tree, text};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Point, Vector};
use notices::Kind;
use roxmltree::Node;
use sim::spec::FibreSpec;

/// Ending of the node sets that state the frames: of each bone four nodes, the origin and one medial, anterior and superior of it.
pub const ANATOMICAL: &str = "_anatomical";
/// Axes that are stated are at right angles within this cosine [-]: coordinates are written with six decimals.
const SQUARE: f64 = 1e-4;

/// An axis of a joint, and where it is.
struct Axis {
    origin: Point,
    direction: Vector,
    bodies: [Option<usize>; 2],
}

/// The knee's frames.
///
/// Errors: axes or a side that cannot be told.
pub(super) fn axes(
    tree: &Tree<'_>,
    (mesh, bodies, knee): (&Mesh, &Bodies<'_, '_>, &Knee),
    (fibres, faces): (&[FibreSpec], [Point; 2]),
    objects: &[Node<'_, '_>],
    given: Option<Side>,
) -> Result<Axes, DeckError> {
    let whole = |message: String| DeckError { file: tree.file.to_owned(), line: 0, message };
    let stated = [stated(mesh, "femur"), stated(mesh, "tibia")];
    if let [Some(femur), Some(tibia)] = stated {
        let (femur, tibia) = (femur.map_err(whole)?, tibia.map_err(whole)?);
        let side = hand(&tibia);
        if hand(&femur) != side {
            return Err(whole(format!("the sets femur{ANATOMICAL} and tibia{ANATOMICAL} are of knees of two sides")));
        }
        if given.is_some_and(|g| g != side) {
            return Err(whole(format!(
                "--side says the other side than the sets femur{ANATOMICAL} and tibia{ANATOMICAL}"
            )));
        }
        return Ok(Axes { femur, tibia, side, told: Vec::new() });
    }
    let shown = Shown::by(fibres);
    let joints = joints(tree, bodies, objects)?;
    let centres = [knee.femur, knee.tibia].map(|b| bodies.centre(tree, b));
    let [femur, tibia] = centres;
    let origins = [femur?.unwrap_or(faces[0]), tibia?.unwrap_or(faces[1])];
    let mut told = Vec::new();
    let raw = match of_joints(&joints, &shown, knee, origins) {
        Some(raw) => raw,
        None => {
            told.push(Kind::DeckOdd.notice(format!(
                "the file states no anatomical axes: they are taken from the ligaments, and flexion, rotations and translations follow them; state them by node sets femur{ANATOMICAL} and tibia{ANATOMICAL} (origin, medial, anterior, superior)"
            )));
            of_ligaments(&shown, fibres, origins).map_err(whole)?
        }
    };
    let by_name = side_by_name(bodies.name(knee.femur)).or(side_by_name(bodies.name(knee.tibia)));
    let side =
        side(&raw[1], &shown, given, by_name).map_err(|e| whole(e.replace("bodies' names", "rigid bodies' names")))?;
    let [femur, tibia] = raw.map(|r| turned(&r, &shown, side));
    Ok(Axes { femur, tibia, side, told })
}

/// The frame that a node set states, where it is there.
fn stated(mesh: &Mesh, bone: &str) -> Option<Result<AnatomicalFrame, String>> {
    let set = mesh.sets.get(&format!("{bone}{ANATOMICAL}"))?;
    let wrong = |what: &str| {
        Err(format!(
            "the set {bone}{ANATOMICAL} {what}; expected four nodes: the origin, and one medial, anterior and superior of it"
        ))
    };
    let &[o, m, a, s] = &set[..] else { return Some(wrong(&format!("has {} nodes", set.len()))) };
    let origin = mesh.points[o];
    let way = |n: usize| (mesh.points[n] - origin).try_normalize(1e-6);
    let (Some(m), Some(a), Some(s)) = (way(m), way(a), way(s)) else {
        return Some(wrong("has two nodes at one place"));
    };
    if [m.dot(&a), a.dot(&s), s.dot(&m)].iter().any(|c| c.abs() > SQUARE) {
        return Some(wrong("has axes that are not at right angles"));
    }
    // the superior axis stays; the others are put at right angles to the last digit
    let medial = (m - s * m.dot(&s)).normalize();
    let across = s.cross(&medial);
    let anterior = if across.dot(&a) < 0.0 { -across } else { across };
    Some(Ok(AnatomicalFrame { origin, medial, anterior, superior: s }))
}

fn hand(frame: &AnatomicalFrame) -> Side {
    if frame.medial.cross(&frame.anterior).dot(&frame.superior) > 0.0 { Side::Left } else { Side::Right }
}

/// The axes of cylindrical and revolute joints.
fn joints(tree: &Tree<'_>, bodies: &Bodies<'_, '_>, objects: &[Node<'_, '_>]) -> Result<Vec<Axis>, DeckError> {
    let is_axis = |n: &&Node<'_, '_>| {
        let key = key(**n);
        key.ends_with(":rigid cylindrical joint") || key.ends_with(":rigid revolute joint")
    };
    let mut out = Vec::new();
    for &node in objects.iter().filter(is_axis) {
        let along = if text(node, "joint_axis").is_some() { "joint_axis" } else { "rotation_axis" };
        let direction = Vector::from(tree.numbers(node, along, [0.0; 3])?).try_normalize(1e-9);
        let direction = direction.ok_or_else(|| tree.error(node, format!("<{along}> is no direction")))?;
        let origin = Point::from(tree.numbers(node, "joint_origin", [0.0; 3])?);
        let body = |name: &str| text(node, name).and_then(|t| bodies.named(t));
        out.push(Axis { origin, direction, bodies: [body("body_a"), body("body_b")] });
    }
    Ok(out)
}

/// Frames by joints: the one along the fibres is superior, the one from LCL to MCL medial-lateral.
fn of_joints(joints: &[Axis], shown: &Shown, knee: &Knee, origins: [Point; 2]) -> Option<[Raw; 2]> {
    let along =
        |way: Vector| move |a: &&Axis, b: &&Axis| a.direction.dot(&way).abs().total_cmp(&b.direction.dot(&way).abs());
    let superior = joints.iter().max_by(along(shown.superior))?;
    let rest = joints.iter().filter(|j| j.direction.dot(&superior.direction).abs() < ONE_AXIS);
    let across = match (shown.medial, shown.anterior) {
        (Some(m), _) => rest.max_by(along(m)),
        (None, Some(a)) => rest.min_by(along(a)),
        (None, None) => None,
    }?;
    let at =
        |bone: usize, usual: Point| joints.iter().find(|j| j.bodies.contains(&Some(bone))).map_or(usual, |j| j.origin);
    let (ml, si) = (across.direction, superior.direction);
    Some([square(at(knee.femur, origins[0]), ml, si, true), square(at(knee.tibia, origins[1]), ml, si, false)])
}

/// Frames by ligaments.
fn of_ligaments(shown: &Shown, fibres: &[FibreSpec], origins: [Point; 2]) -> Result<[Raw; 2], String> {
    let superior = shown.superior;
    let across = shown.medial.or_else(|| shown.anterior.map(|a| a.cross(&superior)));
    let across = across.filter(|m| m.cross(&superior).norm() > 1e-6);
    let across = across.ok_or_else(|| {
        format!("the knee's axes cannot be told: no fibres are named MCL and LCL, or ACL and PCL; expected such names, or node sets femur{ANATOMICAL} and tibia{ANATOMICAL} (origin, medial, anterior, superior)")
    })?;
    // between the collateral ligaments the femur turns, between the cruciates' ends is the eminence
    let named = |of: &[&str]| {
        fibres.iter().filter(|f| of.iter().any(|n| f.bundle.to_uppercase().contains(n))).collect::<Vec<_>>()
    };
    let middle = |ends: Vec<Point>, usual: Point| match ends.len() {
        0 => usual,
        n => Point::from(ends.iter().map(|p| p.coords).sum::<Vector>() / n as f64),
    };
    let two = |one: &str, other: &str, femur: bool, usual: Point| {
        let end = |of: &str| {
            let ends = named(&[of]).into_iter().map(|f| if femur { f.femur } else { f.tibia }).collect();
            middle(ends, usual)
        };
        nalgebra::center(&end(one), &end(other))
    };
    let femur = two("MCL", "LCL", true, origins[0]);
    let tibia = two("ACL", "PCL", false, origins[1]);
    Ok([square(femur, across, superior, true), square(tibia, across, superior, false)])
}
