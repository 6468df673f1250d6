//! Which bodies are femur and tibia, where they are, and the knee's frames.

use super::forces::Force;
use super::joints::Frame;
use super::places::Places;
use super::{Given, MM_PER_M};
use crate::DeckError;
use crate::axes::{Axes, FEMORAL, ONE_AXIS, Raw, Shown, TIBIAL, side, side_by_name, side_word, square, turned};
use crate::tree::Tree;
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use notices::Kind;
use sim::spec::FibreSpec;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the offset frame that, on femur and tibia, states the anatomical axes: x forwards, y to the head, z to the right.
pub const ANATOMICAL: &str = "anatomical";

/// Femur and tibia of a model. All places are in the tibia's coordinates, in mm, at the default pose.
pub(super) struct Knee {
    pub(super) femur: usize,
    pub(super) tibia: usize,
    femoral: BTreeSet<usize>,
    tibial: BTreeSet<usize>,
    /// Where the bodies of both are.
    at: BTreeMap<usize, Isometry>,
}

impl Knee {
    /// Finds the two bodies: as given, or those that the contact forces join and whose names say so.
    ///
    /// Errors: none or several; bodies that no joint which is read connects.
    pub(super) fn find(
        tree: &Tree<'_>,
        places: &Places<'_, '_>,
        forces: &[Force],
        given: &Given,
    ) -> Result<Knee, DeckError> {
        let whole = |message: String| DeckError { file: tree.file.to_owned(), line: 0, message };
        let body = |option: &str, name: &Option<String>| match name {
            None => Ok(None),
            Some(name) => places.body(name).map(Some).ok_or_else(|| {
                let all: Vec<&str> = (0..places.bodies.len()).map(|b| places.name(b)).collect();
                let near = sim::names::did_you_mean(name, all.iter().copied());
                whole(format!("{option}: the model has no body {name}{near}; it has {}", all.join(", ")))
            }),
        };
        let asked = (body("--femur", &given.femur)?, body("--tibia", &given.tibia)?);
        let (femur, tibia) = match asked {
            (Some(femur), Some(tibia)) => (femur, tibia),
            _ => the_one(places, forces, &pairs(places, forces, asked)).map_err(whole)?,
        };
        let (femoral, tibial) = (places.welded_to(femur), places.welded_to(tibia));
        let own = femoral.iter().chain(&tibial).copied();
        let at = own.filter_map(|body| Some((body, places.place(tibia, body, false)?))).collect();
        let knee = Knee { femur, tibia, femoral, tibial, at };
        if femur == tibia || knee.femoral.contains(&tibia) {
            return Err(whole(format!("{} and {} are one rigid body", places.shown(femur), places.shown(tibia))));
        }
        if knee.place(femur).is_none() {
            return Err(whole(format!(
                "no joints that are read lead from {} to {}; expected {}",
                places.shown(tibia),
                places.shown(femur),
                super::places::JOINTS.join(", ")
            )));
        }
        Ok(knee)
    }

    /// Where a body of femur or tibia is; none of another body.
    pub(super) fn place(&self, body: usize) -> Option<Isometry> {
        self.at.get(&body).copied()
    }

    /// Femur or tibia: that to which a body belongs.
    pub(super) fn bone(&self, body: usize) -> usize {
        if self.femoral.contains(&body) { self.femur } else { self.tibia }
    }

    /// Whether the contact force joins femur and tibia.
    pub(super) fn joins(&self, force: &Force) -> bool {
        let of = |group: &BTreeSet<usize>| force.meshes.iter().filter(|m| group.contains(&m.body)).count();
        of(&self.femoral) == 1 && of(&self.tibial) == 1
    }

    /// The bodies that move with the femur, or with the tibia; the one that is named first.
    pub(super) fn bodies(&self, femur: bool) -> Vec<usize> {
        let (own, group) = if femur { (self.femur, &self.femoral) } else { (self.tibia, &self.tibial) };
        std::iter::once(own).chain(group.iter().copied().filter(|b| *b != own)).collect()
    }
}

impl super::forces::Mesh {
    /// Whether its name or its body's says that it is of a bone.
    fn is_of(&self, words: &[&str; 3]) -> bool {
        let says = |name: &str| words.iter().any(|w| name.to_lowercase().contains(w));
        let other = if words == &FEMORAL { &TIBIAL } else { &FEMORAL };
        let denies = other.iter().any(|w| self.body_name.to_lowercase().contains(w));
        says(&self.body_name) || (says(&self.name) && !denies)
    }
}

/// Femur and tibia that a contact force joins: of the bodies that were asked for, else of those whose names say so.
fn pairs(places: &Places<'_, '_>, forces: &[Force], asked: (Option<usize>, Option<usize>)) -> BTreeSet<(usize, usize)> {
    let mut pairs = BTreeSet::new();
    for force in forces {
        for (a, b) in [(&force.meshes[0], &force.meshes[1]), (&force.meshes[1], &force.meshes[0])] {
            let femoral = asked.0.map_or_else(|| a.is_of(&FEMORAL), |body| places.welded_to(body).contains(&a.body));
            let tibial = asked.1.map_or_else(|| b.is_of(&TIBIAL), |body| places.welded_to(body).contains(&b.body));
            if femoral && tibial && a.body != b.body {
                pairs.insert((a.body, b.body));
            }
        }
    }
    pairs
}

/// The pair, if it is one; else what to say.
fn the_one(
    places: &Places<'_, '_>,
    forces: &[Force],
    pairs: &BTreeSet<(usize, usize)>,
) -> Result<(usize, usize), String> {
    let mut all = pairs.iter();
    match (all.next(), all.next()) {
        (Some(one), None) => Ok(*one),
        (None, _) => Err(none_found(places, forces)),
        _ => {
            let shown = |(f, t): &(usize, usize)| format!("{} and {}", places.name(*f), places.name(*t));
            let which: Vec<String> = pairs.iter().map(shown).collect();
            let which = which.join("; ");
            Err(format!("the model has more than one knee: {which}; say which: --femur BODY --tibia BODY"))
        }
    }
}

fn none_found(places: &Places<'_, '_>, forces: &[Force]) -> String {
    if forces.is_empty() {
        return "no Smith2018ArticularContactForce acts; expected one between the cartilages of femur and tibia (a model of ours: export --format opensim --contact jam)".into();
    }
    let on = |f: &Force| format!("{} and {}", places.name(f.meshes[0].body), places.name(f.meshes[1].body));
    let on: Vec<String> = forces.iter().map(on).collect();
    format!(
        "which bodies are femur and tibia cannot be told: contact is between {}; say it: --femur BODY --tibia BODY",
        on.join("; ")
    )
}

/// The knee's frames: those the file states, or those of the joint's axes.
///
/// Errors: axes or a side that cannot be told.
pub(super) fn axes(
    tree: &Tree<'_>,
    places: &Places<'_, '_>,
    knee: &Knee,
    fibres: &[FibreSpec],
    given: Option<Side>,
) -> Result<Axes, DeckError> {
    let shown = Shown::by(fibres);
    let whole = |message: String| DeckError { file: tree.file.to_owned(), line: 0, message };
    let stated = (places.offset_frame(ANATOMICAL, knee.femur)?, places.offset_frame(ANATOMICAL, knee.tibia)?);
    let raw = match stated {
        (Some(femur), Some(tibia)) => [stated_axes(knee, femur), stated_axes(knee, tibia)],
        _ => joint_axes(places, knee, &shown).map_err(whole)?,
    };
    let by_name = side_by_name(places.name(knee.femur)).or(side_by_name(places.name(knee.tibia)));
    let mut told = Vec::new();
    let side = side(&raw[1], &shown, given, by_name).map_err(whole)?;
    if by_name.is_some_and(|named| named != side) {
        let what = format!("the ligaments show a {} knee, the bodies' names the other side", side_word(side));
        told.push(Kind::SignDoubt.notice(what));
    }
    let [femur, tibia] = raw.map(|r| turned(&r, &shown, side));
    Ok(Axes { femur, tibia, side, told })
}

fn stated_axes(knee: &Knee, frame: Frame) -> Raw {
    let place = knee.place(frame.body).unwrap_or_else(Isometry::identity) * frame.place;
    let axis = |v: Vector| place.rotation * v;
    Raw {
        origin: Point::from(place.translation.vector),
        axes: [axis(Vector::z()), axis(Vector::x()), axis(Vector::y())],
    }
}

/// The axes about which the joints between tibia and femur turn, where all coordinates are 0; each bone takes them along.
fn joint_axes(places: &Places<'_, '_>, knee: &Knee, shown: &Shown) -> Result<[Raw; 2], String> {
    let way = places.between(knee.tibia, knee.femur).unwrap_or_default();
    let (mut driven, mut all) = (Vec::new(), Vec::new());
    for joint in &way {
        let to = places.place(knee.tibia, joint.parent.body, true).unwrap_or_else(Isometry::identity);
        for (direction, moves) in joint.turns() {
            let direction = to.rotation * direction;
            all.push(direction);
            if moves {
                driven.push(direction);
            }
        }
    }
    let candidates = if driven.len() >= 3 { driven } else { all };
    let by = |to: Vector| move |a: &Vector, b: &Vector| a.dot(&to).abs().total_cmp(&b.dot(&to).abs());
    // the ligaments stand in the default pose, the axes where all coordinates are 0: the tibia is where it was
    let superior = candidates
        .iter()
        .copied()
        .max_by(by(shown.superior))
        .ok_or("the knee's joint has no axis to turn about; expected three")?;
    let rest: Vec<Vector> = candidates.iter().copied().filter(|a| a.dot(&superior).abs() < ONE_AXIS).collect();
    let across = match (shown.medial, shown.anterior) {
        (Some(m), _) => rest.into_iter().max_by(by(m)),
        (None, Some(a)) => rest.into_iter().min_by(by(a)),
        (None, None) => None,
    };
    let across = across.ok_or(
        "the knee's axes cannot be told apart: no fibres are named MCL and LCL, or ACL and PCL, or the joint turns about one axis; expected such names, or offset frames called \"anatomical\" on femur and tibia (x forwards, y to the head, z to the right)",
    )?;
    let turn = |by: &Isometry| [across, superior].map(|v| by.rotation * v);
    let zero = places.place(knee.tibia, knee.femur, true).unwrap_or_else(Isometry::identity);
    let now = places.place(knee.tibia, knee.femur, false).unwrap_or_else(Isometry::identity);
    let end = |joint: Option<&&super::joints::Joint<'_, '_>>, bone: usize, to: &Isometry| {
        let frame = joint.map(|j| if knee.bone(j.parent.body) == bone { j.parent } else { j.child });
        frame.map_or(Point::from(to.translation.vector), |f| {
            let place = knee.place(f.body).unwrap_or(*to) * f.place;
            Point::from(place.translation.vector)
        })
    };
    let moving: Vec<_> = way.iter().filter(|j| !j.is_rigid()).collect();
    let (first, last) = (moving.first().copied(), moving.last().copied());
    let [ml, si] = turn(&(now * zero.inverse()));
    let femur = square(end(last, knee.femur, &now), ml, si, true);
    let tibia = square(end(first, knee.tibia, &Isometry::identity()), across, superior, false);
    Ok([femur, tibia])
}

/// Mass [tonne] and rotary inertia [tonne mm2] of a body, and whether the file has none above 0.
pub(super) fn mass(tree: &Tree<'_>, places: &Places<'_, '_>, body: usize) -> Result<((f64, f64), bool), DeckError> {
    /// Of a body without a mass of its own: a dissected knee's femur of 1 kg, 0.01 kg m2. Ours; only explicit dynamics reads it.
    const USUAL: (f64, f64) = (1e-3, 10.0);
    let node = places.bodies[body];
    let mass = tree.number(node, "mass", 0.0)? * 1e-3;
    let inertia = tree.list(node, "inertia")?;
    let inertia = inertia.iter().take(3).sum::<f64>() / 3.0 * 1e-3 * MM_PER_M * MM_PER_M;
    let heavy = mass > 0.0 && inertia > 0.0;
    // ground has none to state
    Ok(if heavy { ((mass, inertia), false) } else { (USUAL, body > 0) })
}
