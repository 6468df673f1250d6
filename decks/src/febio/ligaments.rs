//! Discrete elements: each spring from femur to tibia becomes a fibre, and fibres of one law a bundle.

use super::bodies::{Bodies, Knee};
use super::curves::{Fitted, Spring};
use super::mesh::Mesh;
use crate::DeckError;
use crate::lines::{Bundles, Line, bundle_name, bundles};
use crate::tree::{Tree, brief, name_of};
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::spec::fibre_damping;
use std::collections::{BTreeMap, BTreeSet};

/// Forces that differ by less are written with few digits [N]. Ours.
const NEAR_N: f64 = 0.01;
/// A curve that goes on this far beyond a fibre's length in the file is never left [-]: ligaments tear before. Ours.
const FAR: f64 = 0.3;
/// Names that a message shows; more are counted.
const SHOWN: usize = 5;

/// What is told of springs: by what is said, which they are.
#[derive(Default)]
struct Said(BTreeMap<&'static str, Vec<String>>);

impl Said {
    fn of(&mut self, what: &'static str, which: String) {
        self.0.entry(what).or_default().push(which);
    }

    fn told(self, kind: Kind) -> impl Iterator<Item = Notice> {
        self.0.into_iter().map(move |(what, mut which)| {
            let all = which.len();
            which.truncate(SHOWN);
            let more = if all > SHOWN { ", ..." } else { "" };
            kind.notice(format!("{all} springs {what}: {}{more}", which.join(", "))).count(all)
        })
    }
}

/// Reads the springs.
///
/// Errors: a spring whose law no ligament has; none from femur to tibia.
pub(super) fn ligaments(
    tree: &Tree<'_>,
    (mesh, bodies, knee): (&Mesh, &Bodies<'_, '_>, &Knee),
    objects: &[Node<'_, '_>],
) -> Result<(Bundles, Vec<Notice>), DeckError> {
    let of = |name: &'static str| objects.iter().copied().filter(move |o| o.tag_name().name() == name);
    let number = |n: Node<'_, '_>| n.attribute("id").unwrap_or("").trim().to_owned();
    let curves: Vec<_> = of("load_controller").chain(of("loadcurve")).map(|n| (number(n), n)).collect();
    let springs: Vec<_> = of("discrete_material").map(|n| (number(n), n)).collect();
    let (mut lines, mut names) = (Vec::new(), BTreeSet::new());
    let (mut odd, mut elsewhere) = (Said::default(), Said::default());
    for node in of("discrete") {
        let (set, pairs) = pairs(tree, mesh, node)?;
        let dmat = node.attribute("dmat").unwrap_or("").trim();
        let law = springs.iter().find(|(id, n)| id == dmat || name_of(*n) == dmat);
        let law = match law {
            Some((_, law)) => Some(Spring::new(tree, *law, &curves)?),
            // a material that is told, such as a muscle's
            None if tree
                .root()
                .descendants()
                .any(|n| n.tag_name().name() == "discrete_material" && number(n) == dmat) =>
            {
                None
            }
            None => return Err(tree.error(node, format!("there is no discrete_material {}", brief(dmat)))),
        };
        for (k, ends) in pairs.iter().enumerate() {
            let name = if pairs.len() == 1 { set.to_owned() } else { format!("{set}_{}", k + 1) };
            let Some(law) = &law else {
                elsewhere.of("are of a material that is not read, and left out", name);
                continue;
            };
            let on = ends.map(|n| bodies.of_node(n).and_then(|b| knee.is_femur(b)));
            let [femur, tibia] = match on {
                [Some(true), Some(false)] => *ends,
                [Some(false), Some(true)] => [ends[1], ends[0]],
                _ => {
                    elsewhere.of("lead not from femur to tibia, and are left out", name);
                    continue;
                }
            };
            let ends = [femur, tibia].map(|n| mesh.points[n]);
            let length = (ends[0] - ends[1]).norm();
            let fault = |what: String| tree.error(node, format!("{}: {what}", brief(&name)));
            if length < 1e-3 {
                return Err(fault("its ends on femur and tibia are one point".into()));
            }
            let fit = law.fit(length).map_err(|what| fault(format!("{what}; expected slack, toe, line")))?;
            say(&mut odd, law, &fit, (&name, length));
            let slack = length + fit.slack;
            if slack <= 0.0 {
                return Err(fault(format!("it pulls from {:.3} mm shorter than nothing", -slack)));
            }
            let (toe_strain, stiffness) = (fit.toe / slack, fit.stiffness);
            let name = bundle_name(&name);
            if !names.insert(name.clone()) {
                return Err(fault("another spring has its name; expected a name of its own".into()));
            }
            let [femur, tibia] = ends;
            lines.push(Line {
                name,
                femur,
                tibia,
                length,
                slack,
                stiffness,
                toe_strain,
                damping: fibre_damping(),
                law: fit.law,
                end: fit.end,
            });
        }
    }
    if lines.is_empty() {
        let (f, t) = (bodies.name(knee.femur), bodies.name(knee.tibia));
        let what = format!(
            "no spring leads from {f} to {t}; expected ligaments as discrete elements whose nodes are fixed to the rigid bodies (bc of type rigid)"
        );
        return Err(DeckError { file: tree.file.to_owned(), line: 0, message: what });
    }
    let told = odd.told(Kind::ForceTable).chain(elsewhere.told(Kind::SpringsUnread)).collect();
    Ok((bundles(lines), told))
}

/// The set of a discrete element's springs, and their nodes.
fn pairs<'n, 'm>(
    tree: &Tree<'_>,
    mesh: &'m Mesh,
    node: Node<'n, '_>,
) -> Result<(&'n str, &'m [[usize; 2]]), DeckError> {
    if let Some(kind) = node.attribute("type").filter(|t| t.trim() != "spring") {
        return Err(tree.error(node, format!("its type is \"{}\", expected spring", brief(kind))));
    }
    let set = node.attribute("discrete_set").unwrap_or("");
    match mesh.springs.get(set) {
        Some(pairs) => Ok((set, pairs)),
        None => Err(tree.error(node, format!("\"{}\" is no DiscreteSet of the mesh", brief(set)))),
    }
}

fn say(odd: &mut Said, law: &Spring, fit: &Fitted, (name, length): (&str, f64)) {
    if fit.off > NEAR_N + fit.owed {
        odd.of("have curves that depart from slack, toe and line", format!("{name} (by {:.2} N)", fit.off));
    }
    if fit.pushes {
        odd.of("push there when they are shorter than slack; here they are slack", name.to_owned());
    }
    if let Some(stays) = fit.stays.filter(|x| *x < FAR * length) {
        odd.of(
            "have curves whose force stays beyond their end; here it grows on",
            format!("{name} (from {stays:.2} mm)"),
        );
    }
    if law.smooth {
        odd.of("have smooth curves; here lines join their points", name.to_owned());
    }
}
