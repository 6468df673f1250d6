//! Why knees of a cohort are not independent of each other: one knee is given twice, or other knees gave the prior of one.

use super::knee::Knee;
use super::shared;
use std::collections::BTreeMap;

/// A sentence each: of two builds of one knee, then of each knee with a shared prior.
pub(super) fn dependent(knees: &[Knee]) -> Vec<String> {
    let mut out = Vec::new();
    let mut known: BTreeMap<[&str; 2], &Knee> = BTreeMap::new();
    for knee in knees {
        let marks = marks(knee);
        if let Some((first, (_, why))) = marks.iter().find_map(|mark| Some((*known.get(&mark.0)?, mark))) {
            out.push(format!(
                "{} and {} are one knee: {why}. Its figures count twice in medians and outliers, so leave one out.",
                first.name, knee.name
            ));
        }
        for (mark, _) in marks {
            known.entry(mark).or_insert(knee);
        }
    }
    let told = |knee: &Knee| Some(format!("{}: {}", knee.name, shared::sentence(knee.shared_prior.as_ref()?)?));
    out.extend(knees.iter().filter_map(told));
    out
}

/// What no two knees have in common, with words for where they do: id and side, side and digest of a surface. A picture may show both knees of a
/// person, so a file counts with its side.
fn marks(knee: &Knee) -> Vec<([&str; 2], String)> {
    let side = knee.side.as_str();
    if side.is_empty() {
        return Vec::new();
    }
    let id = Some(knee.specimen.as_str()).filter(|id| !id.is_empty());
    let of_id = id.map(|id| ([id, side], format!("both are {id} {side}")));
    let file = |name: &str, digest: &str| format!("both are {side} knees of one file, {name} ({digest:.16})");
    let of_files = knee.surfaces.iter().map(|surface| ([surface.1.as_str(), side], file(&surface.0, &surface.1)));
    of_id.into_iter().chain(of_files).collect()
}
