//! Blankevoort1991Ligament: each becomes a fibre, and fibres of one law a bundle.
//!
//! OpenSim: `F = k / (2 t) s^2` up to the strain `t`, `F = k (s - t / 2)` from there on, with `s = (l - l0) / l0` and `k` in N. A model counts stretch
//! `x = l - l0` in mm, so its stiffness is `k / l0` and its toe strain `t / 2`. What a path has on one bone alone never changes its length: it
//! is taken off `l` and `l0`, and the stretch stays.

use super::knee::Knee;
use super::places::Places;
use super::wrapped::Objects;
use super::{MM_PER_M, point};
use crate::DeckError;
use crate::lines::{Bundles, Line, bundle_name, bundles};
use crate::tree::{Tree, child, name_of, text};
use meshes::Point;
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::spec::{BundleSpec, FibreSpec, Law};
use std::collections::{BTreeMap, BTreeSet};

/// OpenSim's values where a file has none: strain at the toe's end [-], damping [s].
const TRANSITION_STRAIN: f64 = 0.06;
const DAMPING_S: f64 = 0.003;

/// Bundles and fibres of a knee.
pub(super) struct Ligaments {
    pub(super) bundles: Vec<BundleSpec>,
    pub(super) fibres: Vec<FibreSpec>,
    pub(super) told: Vec<Notice>,
}

/// Reads the ligaments among `objects`.
///
/// Errors: a ligament with numbers that no ligament has; none from femur to tibia.
pub(super) fn ligaments<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places<'a, 'i>,
    knee: &Knee,
    objects: &[Node<'a, 'i>],
) -> Result<Ligaments, DeckError> {
    let (mut lines, mut elsewhere, mut off) = (Vec::new(), BTreeMap::new(), Vec::new());
    let (mut names, mut over) = (BTreeSet::new(), Vec::new());
    let wrapped = Objects::of(objects.first());
    let all = objects.iter().copied().filter(|o| o.tag_name().name() == "Blankevoort1991Ligament");
    for node in all {
        if !tree.flag(node, "appliesForce", true)? {
            off.push(name_of(node));
            continue;
        }
        let path = path(tree, node)?;
        let read = way(tree, places, knee, (node, path))?.and_then(|way| Ok((parted(knee, &way)?, way)));
        let (parted, way) = match read {
            Ok(read) => read,
            Err(where_to) => {
                elsewhere.entry(where_to).or_insert_with(Vec::new).push(name_of(node));
                continue;
            }
        };
        let line = law(tree, node, parted)?;
        if !names.insert(line.name.clone()) {
            return Err(tree.error(node, "another ligament has its name; expected a name of its own"));
        }
        lines.push(line);
        let points: Vec<Point> = way.iter().map(|(_, p)| *p).collect();
        if let Some(words) = wrapped.told((tree, places, knee), path, &points)? {
            over.push(format!("{} ({words})", name_of(node)));
        }
    }
    if lines.is_empty() {
        return Err(DeckError {
            file: tree.file.to_owned(),
            line: 0,
            message: format!(
                "no Blankevoort1991Ligament leads from {} to {}; expected the knee's ligaments as such",
                places.name(knee.femur),
                places.name(knee.tibia)
            ),
        });
    }
    let mut told: Vec<Notice> = Vec::new();
    if !off.is_empty() {
        let what = "are switched off (appliesForce is false) and left out";
        told.push(Kind::DeckOdd.notice(format!("{} ligaments {what}: {}", off.len(), off.join(", "))).count(off.len()));
    }
    if !over.is_empty() {
        let what = "wrap over objects there; here they are straight";
        told.push(
            Kind::DeckOdd.notice(format!("{} ligaments {what}: {}", over.len(), over.join(", "))).count(over.len()),
        );
    }
    for (what, which) in elsewhere {
        let text = format!("{} ligaments are left out, since they {what}: {}", which.len(), which.join(", "));
        told.push(Kind::SpringsUnread.notice(text).count(which.len()));
    }
    let Bundles { bundles, fibres, .. } = bundles(lines);
    Ok(Ligaments { bundles, fibres, told })
}

/// The path of a ligament.
fn path<'a, 'i>(tree: &Tree<'_>, node: Node<'a, 'i>) -> Result<Node<'a, 'i>, DeckError> {
    let found = child(node, "GeometryPath").or_else(|| child(child(node, "path")?, "GeometryPath"));
    found.ok_or_else(|| tree.error(node, "<GeometryPath> is missing; expected a path with two points or more"))
}

/// The points of a ligament's path, each with femur or tibia, to which it belongs; the inner error says why it is none of the knee's.
fn way<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places<'a, 'i>,
    knee: &Knee,
    (node, path): (Node<'a, 'i>, Node<'a, 'i>),
) -> Result<Result<Vec<(usize, Point)>, String>, DeckError> {
    let points = child(path, "PathPointSet").and_then(|s| child(s, "objects"));
    let points = points.into_iter().flat_map(|o| o.children().filter(Node::is_element));
    let mut way: Vec<(usize, Point)> = Vec::new();
    for p in points {
        let frame = places.socket(p, "socket_parent_frame")?;
        let at = point(tree, p, "location")?;
        let Some(place) = knee.place(frame.body) else {
            return Ok(Err(format!("end on {}", places.name(frame.body))));
        };
        way.push((knee.bone(frame.body), place * frame.place * at));
    }
    if way.len() < 2 {
        return Err(tree.error(node, format!("its path has {} points, expected two or more", way.len())));
    }
    Ok(Ok(way))
}

/// Length of a path [mm], and its last point on femur and on tibia; the error says why it is none of the knee's.
fn parted(knee: &Knee, way: &[(usize, Point)]) -> Result<(f64, (Point, Point)), String> {
    let crossings: Vec<usize> = (1..way.len()).filter(|&k| way[k].0 != way[k - 1].0).collect();
    let [at] = crossings[..] else {
        return Err(match crossings.len() {
            0 => "lead from a bone to itself".to_owned(),
            n => format!("cross the joint {n} times"),
        });
    };
    let length: f64 = way.windows(2).map(|w| (w[1].1 - w[0].1).norm()).sum();
    let (a, b) = (way[at - 1], way[at]);
    Ok((length, if a.0 == knee.femur { (a.1, b.1) } else { (b.1, a.1) }))
}

/// The law of a ligament whose path is `length` mm long, and where it leaves femur and tibia.
fn law(
    tree: &Tree<'_>,
    node: Node<'_, '_>,
    (length, (femur, tibia)): (f64, (Point, Point)),
) -> Result<Line, DeckError> {
    let slack = tree.number(node, "slack_length", 0.0)? * MM_PER_M;
    let stiffness = tree.number(node, "linear_stiffness", 0.0)?;
    let transition = tree.number(node, "transition_strain", TRANSITION_STRAIN)?;
    let damping = tree.number(node, "damping_coefficient", DAMPING_S)?;
    let fault = |what: String| Err(tree.error(node, what));
    if slack <= 0.0 || slack > LONGEST_MM {
        let given = text(node, "slack_length").unwrap_or("missing");
        return fault(format!(
            "<slack_length> is {given}, expected metres, above 0 and at most {}",
            LONGEST_MM / MM_PER_M
        ));
    }
    if stiffness <= 0.0 {
        return fault(format!("<linear_stiffness> is {stiffness}, expected N a unit of strain, above 0"));
    }
    if transition <= 0.0 || transition >= 1.0 {
        return fault(format!("<transition_strain> is {transition}, expected above 0 and below 1"));
    }
    if damping < 0.0 {
        return fault(format!("<damping_coefficient> is {damping}, expected seconds, 0 or more"));
    }
    if (femur - tibia).norm() < 1e-6 {
        return fault("its ends on femur and tibia are one point".into());
    }
    Ok(Line {
        name: bundle_name(name_of(node)),
        femur,
        tibia,
        length,
        slack,
        stiffness: stiffness / slack,
        toe_strain: transition / 2.0,
        damping: stiffness * damping / slack,
        law: Law::Smooth,
        end: None,
    })
}

/// Longer than any ligament of a knee [mm]: a length in mm in place of metres is beyond it. Ours.
const LONGEST_MM: f64 = 1000.0;
