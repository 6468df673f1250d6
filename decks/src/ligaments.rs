//! Fibres and bundles: axial connectors with a force table.

use super::bodies::{Bodies, position};
use super::expression::lookup;
use super::laws::{LEAST_END, between};
use super::model::{Behaviour, Connector, DeckModel, Element};
use crate::DeckError;
use notices::{Kind, Notice};
use sim::SimError;
use sim::ligament::Bundle;
use sim::spec::{BundleSpec, FibreSpec, Law};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Deck names of the bundles and Table 3's.
const NAMES: [(&str, &str); 14] = [
    ("aclam", "ACL_AM"),
    ("aclpl", "ACL_PL"),
    ("lcl", "LCL"),
    ("mcla", "sMCL_A"),
    ("mclm", "sMCL_M"),
    ("mclp", "sMCL_P"),
    ("dmcl", "dMCL"),
    ("pclal", "PCL_AL"),
    ("pclpm", "PCL_PM"),
    ("als", "ALS"),
    ("pfl", "PFL"),
    ("pol", "POL"),
    ("pcapm", "PCAP_M"),
    ("pcapl", "PCAP_L"),
];
/// Table 3's name of a deck's bundle in small letters.
pub(super) fn bundle_name(stem: &str) -> Option<String> {
    NAMES.iter().find(|(deck, ours)| *deck == stem || ours.to_lowercase() == stem).map(|(_, ours)| (*ours).to_owned())
}

/// Stiffness of a bundle beyond which the unit is doubted [N/mm]: ten times either way of Table 3's ranges; ours.
pub(super) const USUAL_N_PER_MM: RangeInclusive<f64> = 0.7..=2500.0;
/// Toe strain where the deck states none [-].
const TOE_STRAIN: f64 = 0.03;

/// A force in compression below this share of the table's largest is rounding [-]. Ours.
const LEAST_PUSH: f64 = 1e-6;
/// Parts of the line between two rows, at whose ends a law is compared with it [-]. Ours: between the points at which the laws are one, too.
const PARTS: usize = 8;
/// A table's end this near a whole number of toes is that number [-]: tables are written with a few digits. Ours.
const WHOLE: f64 = 1e-6;
/// Types of the elements that are read as fibres: axial connectors, and springs along the line between two nodes.
const CONNECTOR: &str = "CONN3D2";
const SPRING: &str = "SPRINGA";

/// What the deck says of ligaments.
#[derive(Default)]
pub(super) struct Ligaments {
    pub(super) bundles: Vec<BundleSpec>,
    pub(super) fibres: Vec<FibreSpec>,
    pub(super) toe_end_multiple: BTreeMap<String, f64>,
    /// Element labels' order: bundle name and places of its elements, for reports.
    pub(super) warnings: Vec<Notice>,
    /// The set by which each element is a fibre.
    owner: BTreeMap<usize, String>,
}

/// A set of connectors or springs that is a bundle: its place in Table 3, its name there, its own and its law.
struct Found<'a> {
    rank: usize,
    stem: String,
    set: &'a Connector,
    behaviour: &'a Behaviour,
}

/// Reads every axial connector set as a bundle, and every set of springs between the bones; Table 3's order first.
pub(super) fn ligaments(
    model: &DeckModel,
    bodies: &Bodies,
    parameters: &BTreeMap<String, f64>,
) -> Result<Ligaments, DeckError> {
    let mut out = Ligaments { warnings: model.warnings.clone(), ..Ligaments::default() };
    let mut found: Vec<Found> = Vec::new();
    for set in model.connectors.iter().filter(|c| c.kind == "axial") {
        if set.spring && !set_joins_bones(model, bodies, set) {
            out.warnings.push(
                Kind::SpringsUnread
                    .notice(format!("springs {}: not read, as they do not lead from bone to bone", set.elset))
                    .of(&set.elset),
            );
            continue;
        }
        let stem = set.elset.rsplit('.').next().unwrap_or(&set.elset);
        let stem = stem.strip_suffix("_1d").unwrap_or(stem).to_owned();
        let rank = NAMES.iter().position(|(deck, ours)| *deck == stem || ours.to_lowercase() == stem);
        let Some(behaviour) = set.behaviour.as_ref().and_then(|b| model.behaviours.get(b)) else {
            return Err(model.error(set.at, format!("connector set {} has no behaviour", set.elset)));
        };
        found.push(Found { rank: rank.unwrap_or(NAMES.len()), stem, set, behaviour });
    }
    unread(model, bodies, &mut out.warnings)?;
    found.sort_by_key(|f| f.rank);
    for f in found {
        read_bundle(model, bodies, &f, parameters, &mut out)?;
    }
    if out.bundles.is_empty() {
        return Err(DeckError::whole("no AXIAL connector with a force table: the deck has no ligament"));
    }
    Ok(out)
}

/// One bundle with its fibres.
fn read_bundle(
    model: &DeckModel,
    bodies: &Bodies,
    f: &Found,
    parameters: &BTreeMap<String, f64>,
    out: &mut Ligaments,
) -> Result<(), DeckError> {
    let name = NAMES.get(f.rank).map_or_else(|| f.stem.to_uppercase(), |(_, ours)| (*ours).to_owned());
    if f.rank == NAMES.len() {
        let kind = if f.set.spring { "springs" } else { "connector set" };
        out.warnings.push(
            Kind::UnknownBundle
                .notice(format!("{kind} {}: no bundle of Table 3 has this name; kept as {name}", f.set.elset))
                .of(&f.set.elset),
        );
    }
    let elements = model.elsets.get(&f.set.elset).map_or(&[][..], Vec::as_slice);
    for &e in elements {
        if let Some(other) = out.owner.insert(e, f.set.elset.clone()) {
            let what = format!(
                "this element is a fibre of the sets {other} and {}, each with a section of its own; expected one section an element, else its force counts twice",
                f.set.elset
            );
            return Err(model.error(model.elements[e].at, what));
        }
        along_its_ends(model, f.set, &name, &model.elements[e])?;
        out.fibres.push(fibre(model, bodies, &name, &model.elements[e])?);
    }
    let law = bundle(&name, &f.stem, f.behaviour, elements.len(), parameters, &mut out.warnings);
    let (bundle, multiple) = law.map_err(|e| {
        let springs = "; springs are read where *SPRING, NONLINEAR gives such a table";
        model.error(f.set.at, e.message + if f.set.spring { springs } else { "" })
    })?;
    if !f.set.spring && (f.behaviour.damping - 0.05).abs() > 1e-9 {
        out.warnings.push(
            Kind::FibreDamping
                .notice(format!("{name}: fibre damping {} N s/mm, 0.05 assumed", f.behaviour.damping))
                .of(&name),
        );
    }
    out.warnings.extend(pushes(&name, f.behaviour));
    if !USUAL_N_PER_MM.contains(&bundle.stiffness_n_per_mm) {
        let [low, high] = [USUAL_N_PER_MM.start(), USUAL_N_PER_MM.end()];
        out.warnings.push(Kind::OddStiffness.notice(format!(
            "{name}: a stiffness of {:.3} N/mm, where ligaments have {low} to {high}: check the unit of the deck's forces (N) and lengths (mm)",
            bundle.stiffness_n_per_mm
        )).of(&name));
    }
    out.toe_end_multiple.extend(multiple.map(|m| (name, m)));
    out.bundles.push(bundle);
    Ok(())
}

/// What is said of a table with forces that push.
fn pushes(name: &str, behaviour: &Behaviour) -> Option<Notice> {
    let pushed = behaviour.elastic.iter().map(|p| -p[0]).fold(0.0, f64::max);
    let most = behaviour.elastic.last().map_or(0.0, |p| p[0]);
    (pushed > LEAST_PUSH * most).then(|| {
        let text = format!(
            "{name}: the deck's force table pushes with up to {pushed:.3} N where the fibre is shorter than slack; here it is slack there, as ligaments are"
        );
        Kind::ForceTable.notice(text).of(name)
    })
}

/// Refuses an element that does not act along the line between its ends, as its section takes it to.
fn along_its_ends(model: &DeckModel, set: &Connector, name: &str, element: &Element) -> Result<(), DeckError> {
    let (expected, section) = if set.spring { (SPRING, "*SPRING") } else { (CONNECTOR, "*CONNECTOR SECTION") };
    if element.kind.eq_ignore_ascii_case(expected) {
        return Ok(());
    }
    let what = format!(
        "{name}: an element of type {} in a set of {section}; expected {expected}, which pulls along the line between its ends: a SPRING1 or SPRING2 acts along an axis that does not turn with them",
        element.kind
    );
    Err(model.error(element.at, what))
}

fn fibre(model: &DeckModel, bodies: &Bodies, bundle: &str, element: &Element) -> Result<FibreSpec, DeckError> {
    let &[a, b] = &element.nodes[..] else {
        return Err(model.error(element.at, format!("{bundle}: a fibre needs two nodes")));
    };
    let (femur, tibia) = match (bodies.is_femoral(a), bodies.is_femoral(b)) {
        (Some(true), Some(false)) => (a, b),
        (Some(false), Some(true)) => (b, a),
        _ => {
            let [a, b] = [a, b].map(|n| model.scopes.label(n));
            return Err(model.error(
                element.at,
                format!("{bundle}: fibre {a}-{b} does not lead from the femur to the tibia; tie one end to each (*MPC BEAM, or *RIGID BODY)"),
            ));
        }
    };
    Ok(FibreSpec { bundle: bundle.to_owned(), femur: position(model, femur)?, tibia: position(model, tibia)? })
}

/// Whether an element leads from the femur to the tibia.
fn joins_bones(bodies: &Bodies, element: &Element) -> bool {
    let ends: Vec<Option<bool>> = element.nodes.iter().map(|n| bodies.is_femoral(*n)).collect();
    ends.contains(&Some(true)) && ends.contains(&Some(false))
}

fn set_joins_bones(model: &DeckModel, bodies: &Bodies, set: &Connector) -> bool {
    model.elsets.get(&set.elset).into_iter().flatten().any(|&e| joins_bones(bodies, &model.elements[e]))
}

/// Says which elements no rigid body, connector or mass uses; of those from bone to bone, which may be a ligament, none is passed over.
fn unread(model: &DeckModel, bodies: &Bodies, warnings: &mut Vec<Notice>) -> Result<(), DeckError> {
    let kinds = ["axial", "cylindrical", "beam"];
    let read = model.connectors.iter().filter(|c| kinds.contains(&c.kind.as_str())).map(|c| &c.elset);
    let sets = model.rigid.iter().map(|(set, _)| set).chain(read).chain(model.mass.keys()).chain(model.inertia.keys());
    let mut used = vec![false; model.elements.len()];
    sets.filter_map(|set| model.elsets.get(set)).flatten().for_each(|&e| used[e] = true);
    let names = first_names(model);
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for (e, element) in model.elements.iter().enumerate().filter(|(e, _)| !used[*e]) {
        let set = names.get(&e).copied().unwrap_or("without a set");
        if element.nodes.len() == 2 && joins_bones(bodies, element) {
            return Err(model.error(
                element.at,
                format!("{}: an element of type {} from femur to tibia is not read; expected a ligament as AXIAL connectors or as *SPRING, NONLINEAR", set, element.kind),
            ));
        }
        *counts.entry((set, &element.kind)).or_default() += 1;
    }
    warnings.extend(counts.iter().map(|((set, kind), n)| {
        Kind::ElementsUnread
            .notice(format!("{n} elements of type {kind} ({set}) are on neither bone and not read"))
            .count(*n)
    }));
    Ok(())
}

/// The first set of each element.
fn first_names(model: &DeckModel) -> BTreeMap<usize, &str> {
    let mut names = BTreeMap::new();
    for (set, elements) in &model.elsets {
        elements.iter().for_each(|&e| {
            names.entry(e).or_insert(set.as_str());
        });
    }
    names
}

/// Recovers a bundle's numbers from its force table: slack at `d0`, a toe of length `toe`, then a line.
/// Numbers the deck states as parameters are taken as stated where the table agrees.
fn bundle(
    name: &str,
    stem: &str,
    behaviour: &Behaviour,
    fibres: usize,
    parameters: &BTreeMap<String, f64>,
    warnings: &mut Vec<Notice>,
) -> Result<(BundleSpec, Option<f64>), DeckError> {
    let table = &behaviour.elastic;
    let bad = |what: &str| DeckError::whole(format!("{name}: force table {what}; expected slack, toe, line"));
    if table.is_empty() {
        return Err(bad("is not there: a linear elasticity is none, nor is one of another component than 1"));
    }
    let slack = table.iter().rposition(|p| p[0] <= 0.0).ok_or_else(|| bad("has no slack part"))?;
    let [.., before, last] = table[..] else { return Err(bad("is too short")) };
    let slope = (last[0] - before[0]) / (last[1] - before[1]);
    let d0 = table[slack][1];
    let toe = last[1] - last[0] / slope - d0;
    if fibres == 0 || !slope.is_finite() || slope <= 0.0 || !toe.is_finite() || toe <= 0.0 {
        return Err(bad("is not of that form"));
    }
    let stated = |suffix: &str| {
        (2..=stem.len()).rev().filter_map(|n| stem.get(..n)).find_map(|p| lookup(&format!("{p}_{suffix}"), parameters))
    };
    let near = |value: f64, stated: Option<f64>| stated.filter(|s| (s - value).abs() <= 1e-8 * value.abs());
    let toe_strain = stated("ET").filter(|e| *e > 0.0).unwrap_or(TOE_STRAIN);
    let (l0, k) = (toe / toe_strain, slope * fibres as f64);
    let (length, strain) = (l0 - d0, (l0 - d0) / l0);
    let spec = BundleSpec {
        name: name.to_owned(),
        reference_strain: near(strain, stated("EREF")).unwrap_or(strain),
        stiffness_n_per_mm: near(k, stated("K2")).unwrap_or(k),
        reference_length_mm: near(length, stated("L")).unwrap_or(length),
        toe_strain,
        damping_n_s_per_mm: sim::spec::fibre_damping(),
        law: Law::Smooth,
    };
    let multiple = whole((last[1] - d0) / toe);
    let end = (multiple >= LEAST_END).then_some(multiple);
    let wrong = |e: SimError| DeckError::whole(e.to_string());
    let spec = BundleSpec { law: nearest(&spec, fibres, end, &table[slack..]).map_err(wrong)?, ..spec };
    let law = sim::ligament::of_fibres(&spec, fibres, end).map_err(wrong)?;
    warnings.extend(end.is_none().then(|| ends_early(name, multiple, &law)));
    let off = table[slack..].iter().map(|p| (p[0] - law.response(p[1] - d0).force).abs()).fold(0.0, f64::max);
    if off > 1e-6 * last[0] {
        warnings.push(
            Kind::ForceTable
                .notice(format!("{name}: the deck's force table departs from toe and line by up to {off:.3} N"))
                .of(name),
        );
    }
    Ok((spec, end))
}

/// Where a table ends, in toes; so near a whole number it is that number.
fn whole(multiple: f64) -> f64 {
    let near = multiple.round();
    if (multiple - near).abs() < WHOLE { near } else { multiple }
}

/// What is said of a table that ends before its line is well begun: how far the force of the law in its place grows.
fn ends_early(name: &str, multiple: f64, law: &Bundle) -> Notice {
    let beyond = 2.0 * law.table_end * law.toe_mm();
    let grows = match law.response(beyond).stiffness > 0.0 {
        true => "on, as ligaments do".to_owned(),
        false => format!("on to {:.0} toes", law.table_end),
    };
    let text = format!(
        "{name}: the deck's force table ends {multiple:.2} toes behind slack, and its force stays there; here it grows {grows}"
    );
    Kind::ForceTable.notice(text).of(name)
}

/// The law that departs least from the lines between the rows of a table from slack on.
///
/// Errors: numbers that no bundle has.
fn nearest(spec: &BundleSpec, fibres: usize, end: Option<f64>, rows: &[[f64; 2]]) -> Result<Law, SimError> {
    let mut found = (f64::INFINITY, spec.law);
    for law in Law::ALL {
        let tried = sim::ligament::of_fibres(&BundleSpec { law, ..spec.clone() }, fibres, end)?;
        let off = |[force, at]: [f64; 2]| (force - tried.response(at - rows[0][1]).force).powi(2);
        let off: f64 = between(rows, PARTS).map(off).sum();
        if off < found.0 {
            found = (off, law);
        }
    }
    Ok(found.1)
}
