//! Why knees of a cohort are not independent of each other: one knee is given twice, or other knees gave the prior of one.

use super::knee::Knee;
use super::shared;
use schemars::JsonSchema;
use serde::Serialize;
use sim::spec::SharedPriorSpec;
use std::collections::BTreeMap;

/// Why knees of a cohort are not independent.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct DependentTold {
    /// What they have in common.
    pub kind: Dependence,
    /// Their names in the cohort: both builds of one knee, or the knee with the shared prior.
    pub knees: Vec<String>,
    /// The sentence of the page and the terminal.
    pub message: String,
    /// The prior that other knees gave; null where one knee is given twice.
    pub shared_prior: Option<SharedPriorSpec>,
}

/// What makes knees depend on each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dependence {
    /// Two builds are of one knee.
    OneKnee,
    /// Other knees gave the prior of its calibration.
    SharedPrior,
}

/// Two builds of one knee, then each knee with a shared prior.
pub(super) fn dependent(knees: &[Knee]) -> Vec<DependentTold> {
    let mut out = Vec::new();
    let mut known: BTreeMap<[&str; 2], &Knee> = BTreeMap::new();
    for knee in knees {
        let marks = marks(knee);
        if let Some((first, (_, why))) = marks.iter().find_map(|mark| Some((*known.get(&mark.0)?, mark))) {
            out.push(DependentTold {
                kind: Dependence::OneKnee,
                knees: vec![first.name.clone(), knee.name.clone()],
                message: format!(
                    "{} and {} are one knee: {why}. Its figures count twice in medians and outliers, so leave one out.",
                    first.name, knee.name
                ),
                shared_prior: None,
            });
        }
        for (mark, _) in marks {
            known.entry(mark).or_insert(knee);
        }
    }
    out.extend(knees.iter().filter_map(with_shared_prior));
    out
}

/// A knee that has a shared prior.
fn with_shared_prior(knee: &Knee) -> Option<DependentTold> {
    let prior = knee.shared_prior.as_ref()?;
    Some(DependentTold {
        kind: Dependence::SharedPrior,
        knees: vec![knee.name.clone()],
        message: format!("{}: {}", knee.name, shared::sentence(prior)?),
        shared_prior: Some(prior.clone()),
    })
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
