//! The stages in order.

use super::View;
pub(crate) use super::assemble::Assemble;
pub(crate) use super::attachments::Attach;
pub(crate) use super::bones::RigidBones;
pub(crate) use super::calibrate::{Calibrate, Calibration};
pub(crate) use super::cartilage::MakeCartilage;
pub(crate) use super::contact_law::FitContactLaw;
pub(crate) use super::diagnose::Diagnose;
pub(crate) use super::frames::AssignFrames;
pub(crate) use super::hexmesh::Hexmesh;
pub(crate) use super::ingest::Ingest;
pub(crate) use super::overclosure::Overclosure;
pub(crate) use super::register::Register;
pub(crate) use super::segment::Segment;
pub(crate) use super::validate::Validate;

/// All of them.
pub(crate) static STAGES: [&dyn View; 14] = [
    &Segment,
    &Ingest,
    &Register,
    &RigidBones,
    &MakeCartilage,
    &AssignFrames,
    &Attach,
    &Hexmesh,
    &Overclosure,
    &FitContactLaw,
    &Assemble,
    &Calibrate,
    &Validate,
    &Diagnose,
];

/// Their names.
pub(crate) fn names() -> [&'static str; 14] {
    STAGES.map(|s| s.name())
}

/// The stage called `name`.
pub(crate) fn named(name: &str) -> Option<&'static dyn View> {
    STAGES.into_iter().find(|s| s.name() == name)
}

/// `NN-stage`.
pub(crate) fn folder_name(name: &str) -> String {
    named(name).map_or(format!("00-{name}"), View::folder)
}

/// `04 cartilage`.
pub(crate) fn heading(name: &str) -> String {
    format!("{} {name}", named(name).map_or("", |s| s.number()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::option_docs::{self, OptionDoc};
    use crate::options::{BuildOptions, Override, parse_override, typed};
    use std::collections::BTreeMap;

    /// The value with its first number or truth changed, or the first of its words left out; `None` where it holds none.
    fn changed(value: &toml::Value) -> Option<toml::Value> {
        use toml::Value;
        Some(match value {
            Value::Float(x) => Value::Float(1.5 * x + 0.125),
            Value::Integer(i) => Value::Integer(i + 1),
            Value::Boolean(b) => Value::Boolean(!b),
            Value::Array(all) => {
                let (first, rest) = all.split_first()?;
                match changed(first) {
                    Some(other) => Value::Array(std::iter::once(other).chain(rest.iter().cloned()).collect()),
                    // words among which the first is left out
                    None if !rest.is_empty() => Value::Array(rest.to_vec()),
                    None => return None,
                }
            }
            Value::Table(all) => {
                let (key, inner) = all.iter().find_map(|(k, v)| Some((k.clone(), changed(v)?)))?;
                let mut all = all.clone();
                all.insert(key, inner);
                Value::Table(all)
            }
            _ => return None,
        })
    }

    /// Values that an option might have in place of the one it has; the first that its type takes and that is another is tried.
    fn others(option: &OptionDoc) -> Vec<String> {
        let default = format!("x = {}", option.default).parse::<toml::Table>();
        let near = default.ok().and_then(|t| changed(&t["x"])).map(|v| v.to_string());
        let words = option.choices.iter().map(|c| format!("{c:?}"));
        let more = ["7.125", "[7.125]", "[\"ct.femur\"]", "\"word\"", "{ a = [1.5, 2.5] }", LOADS];
        near.into_iter().chain(words).chain(more.map(String::from)).collect()
    }

    /// `calibrate.loads` is empty by default, and a list of tables.
    const LOADS: &str = "[{ bundles = [\"LCL\"], sd_n = 5.0 }]";

    /// Options under which others are heard; with none of them all the rest are.
    const HEARD_UNDER: [&str; 2] = ["", "calibrate.method=\"swarm-simplex\""];

    #[test]
    fn every_option_is_in_the_key_of_its_own_stage_and_of_no_other() {
        let sections = |o: &BuildOptions| STAGES.map(|s| s.section(o).unwrap());
        let all = option_docs::all().unwrap();
        assert!(all.len() > 150, "only {} options", all.len());
        let mut faults = Vec::new();
        for option in &all {
            let own = option.key.split('.').next().unwrap();
            let changed = HEARD_UNDER.iter().find_map(|under| {
                let under = (!under.is_empty()).then(|| parse_override(under).unwrap());
                let with = |set: Option<Override>| {
                    let sets: Vec<Override> = under.iter().cloned().chain(set).collect();
                    Some(sections(&typed(&BTreeMap::new(), &sets, None).ok()?))
                };
                let usual = with(None).unwrap();
                others(option).into_iter().find_map(|value| {
                    let changed = with(Some(parse_override(&format!("{}={value}", option.key)).ok()?))?;
                    (changed != usual).then(|| (usual.clone(), changed))
                })
            });
            let Some((usual, changed)) = changed else {
                faults.push(format!("{}: no other value than {} was taken", option.key, option.default));
                continue;
            };
            let differ = STAGES.iter().zip(usual.iter().zip(&changed)).filter(|(_, (a, b))| a != b);
            let names: Vec<&str> = differ.map(|(s, _)| s.name()).collect();
            if names != [own] {
                faults.push(format!("{}: in the keys of {}", option.key, names.join(", ")));
            }
        }
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }

    #[test]
    fn names_and_numbers_ascend_and_every_stage_has_a_section() {
        assert!(STAGES.is_sorted_by(|a, b| a.number() < b.number()));
        let sections = toml::Table::try_from(BuildOptions::default()).unwrap();
        let mut names = names().to_vec();
        names.sort_unstable();
        let mut of_options: Vec<&str> = sections.keys().map(String::as_str).collect();
        of_options.sort_unstable();
        assert_eq!(names, of_options);
    }

    /// What is silenced changes no key, so that no stage is run again for the same bytes.
    #[test]
    fn an_option_that_another_silences_is_in_no_key() {
        let key = |sets: &[&str]| {
            let sets: Vec<Override> = sets.iter().map(|s| parse_override(s).unwrap()).collect();
            STAGES.map(|s| s.section(&typed(&BTreeMap::new(), &sets, None).unwrap()).unwrap())
        };
        let belief = |weight: f64| {
            format!("calibrate.loads=[{{ bundles = [\"LCL\"], sd_n = 5.0, most_n = 40.0, weight = {weight:?} }}]")
        };
        assert_eq!(key(&[&belief(50.0)]), key(&[&belief(7.0)]));
        let recipe = "calibrate.method=\"swarm-simplex\"";
        assert_ne!(key(&[recipe, &belief(50.0)]), key(&[recipe, &belief(7.0)]));
        let (swarm, quasi) = ("calibrate.swarm.particles=30", "validate.solver=\"quasistatic\"");
        assert_eq!(key(&[swarm]), key(&[]));
        assert_ne!(key(&[recipe, swarm]), key(&[recipe]));
        for silent in ["validate.agree.mm=0.5", "validate.explicit.mass_scale=7.0"] {
            assert_eq!(key(&[quasi, silent]), key(&[quasi]), "{silent}");
            assert_ne!(key(&[silent]), key(&[]), "{silent}");
        }
    }
}
