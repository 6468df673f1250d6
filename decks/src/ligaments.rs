//! Fibres and bundles: axial connectors with a force table.

use super::bodies::{Bodies, position};
use super::expression::lookup;
use super::model::{Behaviour, DeckModel};
use crate::DeckError;
use sim::spec::{BundleSpec, FibreSpec, Law};
use std::collections::BTreeMap;

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

/// Toe strain where the deck states none [-].
const TOE_STRAIN: f64 = 0.03;

/// What the deck says of ligaments.
#[derive(Default)]
pub(super) struct Ligaments {
    pub(super) bundles: Vec<BundleSpec>,
    pub(super) fibres: Vec<FibreSpec>,
    pub(super) toe_end_multiple: BTreeMap<String, f64>,
    /// Element labels' order: bundle name and places of its elements, for reports.
    pub(super) warnings: Vec<String>,
}

/// Reads every axial connector set as a bundle, Table 3's order first.
pub(super) fn ligaments(
    model: &DeckModel,
    bodies: &Bodies,
    parameters: &BTreeMap<String, f64>,
) -> Result<Ligaments, DeckError> {
    let mut found: Vec<(usize, String, String, &Behaviour)> = Vec::new();
    for c in model.connectors.iter().filter(|c| c.kind == "axial") {
        let stem = c.elset.strip_suffix("_1d").unwrap_or(&c.elset).to_owned();
        let rank = NAMES.iter().position(|(deck, ours)| *deck == stem || ours.to_lowercase() == stem);
        let Some(behaviour) = c.behaviour.as_ref().and_then(|b| model.behaviours.get(b)) else {
            return Err(DeckError::whole(format!("connector set {} has no behaviour", c.elset)));
        };
        found.push((rank.unwrap_or(NAMES.len()), stem, c.elset.clone(), behaviour));
    }
    found.sort_by_key(|(rank, ..)| *rank);
    let mut out = Ligaments::default();
    for (rank, stem, elset, behaviour) in found {
        let name = NAMES.get(rank).map_or_else(|| stem.to_uppercase(), |(_, ours)| (*ours).to_owned());
        if rank == NAMES.len() {
            out.warnings.push(format!("connector set {elset} is no bundle of Table 3; kept as {name}"));
        }
        let elements = model.elsets.get(&elset).cloned().unwrap_or_default();
        for &e in &elements {
            out.fibres.push(fibre(model, bodies, &name, &model.elements[e].nodes)?);
        }
        let (bundle, multiple) = bundle(&name, &stem, behaviour, elements.len(), parameters, &mut out.warnings)?;
        if (behaviour.damping - 0.05).abs() > 1e-9 {
            out.warnings.push(format!("{name}: fibre damping {} N s/mm, 0.05 assumed", behaviour.damping));
        }
        out.toe_end_multiple.insert(name, multiple);
        out.bundles.push(bundle);
    }
    if out.bundles.is_empty() {
        return Err(DeckError::whole("no AXIAL connector with a force table: the deck has no ligament"));
    }
    Ok(out)
}

fn fibre(model: &DeckModel, bodies: &Bodies, bundle: &str, nodes: &[u64]) -> Result<FibreSpec, DeckError> {
    let &[a, b] = nodes else {
        return Err(DeckError::whole(format!("{bundle}: a fibre needs two nodes")));
    };
    let (femur, tibia) = match (bodies.is_femoral(a), bodies.is_femoral(b)) {
        (Some(true), Some(false)) => (a, b),
        (Some(false), Some(true)) => (b, a),
        _ => {
            return Err(DeckError::whole(format!(
                "{bundle}: fibre {a}-{b} does not lead from the femur to the tibia; tie one end to each"
            )));
        }
    };
    Ok(FibreSpec { bundle: bundle.to_owned(), femur: position(model, femur)?, tibia: position(model, tibia)? })
}

/// Recovers a bundle's numbers from its force table: slack at `d0`, a toe of length `toe`, then a line.
/// Numbers the deck states as parameters are taken as stated where the table agrees.
fn bundle(
    name: &str,
    stem: &str,
    behaviour: &Behaviour,
    fibres: usize,
    parameters: &BTreeMap<String, f64>,
    warnings: &mut Vec<String>,
) -> Result<(BundleSpec, f64), DeckError> {
    let table = &behaviour.elastic;
    let bad = |what: &str| DeckError::whole(format!("{name}: force table {what}; expected slack, toe, line"));
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
        law: if table.iter().filter(|p| p[1] > d0 && p[1] < d0 + 1.999 * toe).count() <= 3 {
            Law::Tabular
        } else {
            Law::Smooth
        },
    };
    let exact = |x: f64| if x < 2.0 * toe { slope * x * x / (4.0 * toe) } else { slope * (x - toe) };
    let off = table[slack..].iter().map(|p| (p[0] - exact(p[1] - d0)).abs()).fold(0.0, f64::max);
    if off > 1e-6 * last[0] {
        warnings.push(format!("{name}: the deck's force table departs from toe and line by up to {off:.3} N"));
    }
    let multiple = (last[1] - d0) / toe;
    let whole = multiple.round();
    Ok((spec, if (multiple - whole).abs() < 1e-6 { whole } else { multiple }))
}
