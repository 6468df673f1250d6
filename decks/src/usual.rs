//! What a deck's numbers say of its units: pressures, friction and masses held against what a knee has.

use crate::DeckError;
use crate::faces::extent;
use crate::ligaments::USUAL_N_PER_MM;
use crate::model::{DeckModel, Pair};
use meshes::Vector;
use notices::{Kind, Notice};
use sim::mesh::MeshValue;
use sim::spec::{BodySpec, BundleSpec, ContactSpec, FramesSpec};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Pressure over overclosure of a contact law at its last row [MPa/mm]. A layer 2 to 4 mm thick has a confined modulus of 0.6 MPa at rest and of
/// some 250 MPa in a quick step; half and twice that. Ours.
const USUAL_MPA_PER_MM: RangeInclusive<f64> = 0.3..=300.0;
/// Pressure that counts as none, as a share of the law's largest [-]. Ours: decks begin their tables with 1e-7.
const NO_PRESSURE: f64 = 1e-3;
/// A law may begin this far before surfaces touch [mm]: a calibrated knee's cartilage may be thicker than its surfaces show, by three standard
/// deviations of its thickness at most. `sim` bounds contact up to there, too. Ours.
const EARLIEST_MM: f64 = 0.6;
/// Friction of cartilage is 0.01 to 0.1; more than this is of no joint [-]. Ours.
const MOST_FRICTION: f64 = 0.5;
/// The heaviest that a bone with its limb is [tonne]: a heavy person. Ours.
const MOST_TONNE: f64 = 0.15;
/// The most rotary inertia of it [tonne mm2]: that mass at half a metre. Ours.
const MOST_TONNE_MM2: f64 = 37_500.0;

/// A contact surface across more than this is of no knee [mm]: a node that is far off, or another unit. Its distance field would take long. Ours:
/// five times a large plateau's.
const WIDEST_SURFACE_MM: f64 = 600.0;

/// Refuses contact surfaces that are far too wide, before a simulation samples the space around them.
///
/// # Errors
/// The first such surface.
pub(crate) fn wide(contact: &ContactSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<(), DeckError> {
    for path in contact.pairs.iter().flat_map(|pair| [&pair.femur, &pair.tibia]) {
        let Some(MeshValue::Surface(mesh)) = meshes.get(path) else { continue };
        let across = extent(mesh);
        if across > WIDEST_SURFACE_MM {
            return Err(DeckError::whole(format!(
                "surface {path} is {across:.0} mm across, where a knee's are 150 at most: is it in mm, or does one of its nodes lie far off?"
            )));
        }
    }
    Ok(())
}

/// Refuses a law that does not begin with no pressure, or presses less where it is deeper.
///
/// # Errors
/// Such a table, or one of a single row, with the line of its contact pair.
pub(super) fn law(model: &DeckModel, pair: &Pair) -> Result<(), DeckError> {
    let name = &pair.interaction;
    let refuse = |what: String| Err(model.error(pair.at, format!("the interaction {name} {what}")));
    let Some(law) = model.interactions.get(name) else {
        return refuse("is not defined in this deck; expected *SURFACE INTERACTION with this name".into());
    };
    if law.table.len() < 2 {
        return refuse(
            "has no table; expected *SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR of two rows or more".into(),
        );
    }
    if let Some(w) = law.table.windows(2).find(|w| w[1][0] < w[0][0]) {
        return refuse(format!(
            "has a pressure that falls from {} to {} MPa as the overclosure grows from {} to {} mm; expected pressures that ascend, in rows of pressure, overclosure",
            w[0][0], w[1][0], w[0][1], w[1][1]
        ));
    }
    let most = law.table.iter().map(|row| row[0]).fold(0.0, f64::max);
    if let Some([first, mm]) = law.table.first().filter(|row| row[0] > NO_PRESSURE * most) {
        let place = if *mm < 0.0 { format!("{} mm before surfaces touch", -mm) } else { "without overclosure".into() };
        return refuse(format!(
            "has a pressure of {first:.4} MPa {place}; expected 0 in its first row: cartilages that do not touch do not press"
        ));
    }
    Ok(())
}

/// What is told of a law that begins long before surfaces touch: of its last overclosure without pressure.
fn early(contact: &ContactSpec) -> Option<Notice> {
    let most = contact.pressure_mpa.iter().copied().fold(0.0, f64::max);
    let rows = contact.pressure_mpa.iter().zip(&contact.overclosure_mm);
    let (_, start) = rows.take_while(|(mpa, _)| **mpa <= NO_PRESSURE * most).last()?;
    (*start < -EARLIEST_MM).then(|| {
        let text = format!(
            "contact: its law presses from {} mm before surfaces touch, where a thicker cartilage explains {EARLIEST_MM} mm: check the signs and the unit of its overclosures (mm, positive where surfaces overlap)",
            -start
        );
        Kind::OddStiffness.notice(text).of("contact")
    })
}

/// What is told of contact pairs with other laws than the first, whose law is taken for all.
pub(super) fn other_laws(model: &DeckModel) -> Option<Notice> {
    let of = |pair: &Pair| model.interactions.get(&pair.interaction);
    let first = model.pairs.first()?;
    let other = model.pairs.iter().find(|p| of(p) != of(first))?;
    Some(Kind::DeckOdd.notice(format!(
        "contact pairs have different laws: {} of {} / {}, and {} of {} / {}. A model has one law: the first is taken for all",
        first.interaction,
        first.surfaces[0],
        first.surfaces[1],
        other.interaction,
        other.surfaces[0],
        other.surfaces[1]
    )))
}

/// What is told of a contact law and of masses that no knee in mm, N, s, tonne and MPa has.
pub(crate) fn told(contact: &ContactSpec, bodies: &[BodySpec]) -> Vec<Notice> {
    let mut found = Vec::from_iter(early(contact));
    let last = contact.pressure_mpa.last().zip(contact.overclosure_mm.last()).filter(|(_, mm)| **mm > 0.0);
    if let Some(slope) = last.map(|(mpa, mm)| mpa / mm).filter(|slope| !USUAL_MPA_PER_MM.contains(slope)) {
        found.push(Kind::OddStiffness.notice(format!(
            "contact: its law has {slope:.3} MPa for each mm of overclosure, where cartilage has {} to {}: check the unit of its pressures (MPa, not kPa or Pa) and overclosures (mm), and the order of its columns (pressure, overclosure)",
            USUAL_MPA_PER_MM.start(),
            USUAL_MPA_PER_MM.end()
        )).of("contact"));
    }
    if contact.friction > MOST_FRICTION {
        found.push(
            Kind::OddStiffness
                .notice(format!(
                    "contact: a friction of {}, where cartilage has 0.01 to 0.1: is it in per cent?",
                    contact.friction
                ))
                .of("contact"),
        );
    }
    for body in bodies {
        let (mass, inertia) = (body.mass_tonne, body.inertia_tonne_mm2);
        if mass > MOST_TONNE || inertia > MOST_TONNE_MM2 {
            found.push(Kind::OddStiffness.notice(format!(
                "{}: a mass of {mass} tonne with a rotary inertia of {inertia} tonne mm2, where a limb has {MOST_TONNE} tonne and {MOST_TONNE_MM2} tonne mm2 at most: check their units (tonne, not kg or g)",
                body.name
            )).of(&body.name));
        }
    }
    found
}

/// Reference strains beyond these are of no fibre that the file's pose may have [-]: Table 3 of [andreassen2025] has 0.55 to 1.25, and a ligament
/// tears at 1.3. Ours.
const USUAL_STRAIN: RangeInclusive<f64> = 0.45..=1.35;
/// The middle of a knee's bundles is stiffer than this [N/mm]: Table 3's ranges begin at 10 and end at 200. Ours.
const LEAST_MIDDLE_N_PER_MM: f64 = 5.0;
/// Bundles that are named; more are counted.
const SHOWN: usize = 5;

/// What is told of bundles that are slack, or torn, in the pose of the file.
pub(crate) fn strains(bundles: &[BundleSpec]) -> Option<Notice> {
    let odd: Vec<&BundleSpec> = bundles.iter().filter(|b| !USUAL_STRAIN.contains(&b.reference_strain)).collect();
    let shown: Vec<String> =
        odd.iter().take(SHOWN).map(|b| format!("{} ({:.2})", b.name, b.reference_strain)).collect();
    let [least, most] = [USUAL_STRAIN.start(), USUAL_STRAIN.end()];
    (!odd.is_empty()).then(|| {
        let text = format!(
            "{} bundles are {least} times as long as their slack length or less, or {most} times or more, in the pose of the file: {}. Check their slack lengths or tables, the places of their ends, and the pose",
            odd.len(),
            shown.join(", ")
        );
        Kind::OddStiffness.notice(text).count(odd.len())
    })
}

/// What is told of bundles whose stiffness no ligament has, one by one or all together.
fn stiffness(bundles: &[BundleSpec]) -> Vec<Notice> {
    let [low, high] = [USUAL_N_PER_MM.start(), USUAL_N_PER_MM.end()];
    let mut found: Vec<Notice> = bundles
        .iter()
        .filter(|b| !USUAL_N_PER_MM.contains(&b.stiffness_n_per_mm))
        .map(|b| {
            Kind::OddStiffness
                .notice(format!(
                    "{}: a stiffness of {:.3} N/mm, where ligaments have {low} to {high}: check the unit of its force",
                    b.name, b.stiffness_n_per_mm
                ))
                .of(&b.name)
        })
        .collect();
    let mut all: Vec<f64> = bundles.iter().map(|b| b.stiffness_n_per_mm).collect();
    all.sort_by(f64::total_cmp);
    if let Some(middle) = all.get(all.len() / 2).filter(|k| **k < LEAST_MIDDLE_N_PER_MM) {
        found.push(Kind::OddStiffness.notice(format!(
            "ligaments: their stiffness is {middle:.3} N/mm in the median, where a knee's is above {LEAST_MIDDLE_N_PER_MM}: is it given in N/mm where the force at a strain of 1 is asked for (N), or in another unit?"
        )));
    }
    found
}

/// What is told of the numbers of a knee that another program's file holds.
pub(crate) fn whole(bundles: &[BundleSpec], contact: &ContactSpec, bodies: &[BodySpec]) -> Vec<Notice> {
    let mut found = told(contact, bodies);
    found.extend(strains(bundles));
    found.extend(stiffness(bundles));
    found
}

/// A medial axis lies this near the line from the lateral to the medial collateral ligament [deg]: 3 to 6 in two published knees and a phantom. Ours.
const MOST_OFF_MEDIAL_DEG: f64 = 30.0;

/// What is told of the sides of a knee: `across` leads from the lateral to the medial collateral ligament, by which the deck's side is told.
pub(super) fn sides(frames: &FramesSpec, meshes: &BTreeMap<String, MeshValue>, across: &Vector) -> Vec<Notice> {
    let mut found = Vec::new();
    for (bone, frame) in [("femur", &frames.femur), ("tibia", &frames.tibia)] {
        let off = frame.medial.cross(across).norm().atan2(frame.medial.dot(across).abs()).to_degrees();
        if off > MOST_OFF_MEDIAL_DEG {
            found.push(Kind::DeckOdd.notice(format!(
                "{bone}: the medial axis of its frame lies {off:.0} deg from the line between the collateral ligaments, expected within {MOST_OFF_MEDIAL_DEG}: are two axes exchanged, or the nodes of ref_frames in another order (origin, medial, anterior, superior)?"
            )).of(bone));
        }
    }
    let middle = |side: &str| match meshes.get(&format!("meshes/articular_tibia_{side}.ply")) {
        Some(MeshValue::Surface(mesh)) if !mesh.vertices.is_empty() => {
            Some(mesh.vertices.iter().map(|p| p.coords).sum::<Vector>() / mesh.vertices.len() as f64)
        }
        _ => None,
    };
    let plateaus = middle("medial").zip(middle("lateral")).map(|(medial, lateral)| medial - lateral);
    if plateaus.is_some_and(|between| between.dot(across) < 0.0) {
        found.push(Kind::DeckOdd.notice(
            "the medial plateau lies on the side of the LCL: the names of the collateral ligaments or those of the plateaus are exchanged, and with the ligaments the knee's side".to_owned(),
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Point;
    use meshes::frame::AnatomicalFrame;
    use meshes::surface::TriMesh;
    use sim::spec::PoseSpec;

    fn frames(medial: Vector) -> FramesSpec {
        let anterior = Vector::new(0.0, -1.0, 0.0);
        let frame = AnatomicalFrame { origin: Point::origin(), medial, anterior, superior: Vector::z() };
        FramesSpec { femur: frame, tibia: frame, gs_ct_pose: PoseSpec::default(), chain: None, grid: None }
    }

    fn plateau(x: f64) -> MeshValue {
        let vertices = [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]].map(Point::from).to_vec();
        MeshValue::Surface(TriMesh { vertices, triangles: vec![[0, 1, 2]] })
    }

    #[test]
    fn plateaus_and_axes_on_another_side_than_the_ligaments_are_told() {
        let of = |medial: f64, lateral: f64| {
            let faces = [("medial", medial), ("lateral", lateral)];
            BTreeMap::from(faces.map(|(side, x)| (format!("meshes/articular_tibia_{side}.ply"), plateau(x))))
        };
        let said = |meshes: &BTreeMap<String, MeshValue>, axis: Vector| {
            notices::texts(&sides(&frames(axis), meshes, &Vector::new(80.0, 4.0, 3.0))).join(" ")
        };
        assert_eq!(said(&of(20.0, -20.0), Vector::x()), "");
        assert_eq!(said(&of(20.0, -20.0), -Vector::x()), "", "the axis's sign is settled elsewhere");
        assert_eq!(said(&BTreeMap::new(), Vector::x()), "");
        assert!(said(&of(-20.0, 20.0), Vector::x()).contains("side of the LCL"));
        let turned = said(&of(20.0, -20.0), Vector::y());
        assert!(turned.contains("femur: the medial axis") && turned.contains("tibia: the medial axis"), "{turned}");
    }
}
