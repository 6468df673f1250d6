//! Laxity files of a specimen: what they hold, what a calibration leaves out, and whether their signs are the clinical ones.

use super::{Item, State, names};
use crate::given;
use crate::options::BuildOptions;
use calibration::targets::targets;
use notices::{Kind, Notice};
use sim::laxity::{LaxityTrial, Named, between, read_as, sign_doubts};
use sim::spec::PoseSpec;
use stages::specimen::{RawSpecimen, SpecimenFile};
use std::collections::{BTreeMap, BTreeSet};

/// What may be calibrated to, by source; an item each, and an item a doubt.
pub(super) fn judge(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &BuildOptions,
    items: &mut Vec<Item>,
) -> BTreeMap<String, Vec<LaxityTrial>> {
    let mut measured = BTreeMap::new();
    if file.laxity.is_empty() {
        let cost = "nothing to calibrate to: ligaments keep the literature's parameters, and nothing is validated";
        items.push(Item::new("laxity", State::Missing, "no file named", cost));
    }
    for (name, path) in &file.laxity {
        let input = format!("laxity.{name}");
        let Some(bytes) = raw.files.get(path) else {
            let found = format!("{path} is not there");
            items.push(Item::new(
                &input,
                State::Fault,
                found,
                "put the file there, or correct the path in specimen.toml",
            ));
            continue;
        };
        let format = file.laxity_format.get(name).cloned().unwrap_or_default();
        match read_as(bytes, &format, file.specimen.side) {
            Err(e) => items.push(Item::new(&input, State::Fault, format!("{path}: {e}"), "")),
            Ok(table) => {
                items.push(summary(&input, &table.trials, &table.warnings));
                let cost = "a build calibrates to the readings as they stand";
                let said = names::of_laxity(path, &table.trials, file.specimen.side);
                items.extend(said.into_iter().map(|found| Item::new(&input, State::Look, found, cost)));
                for doubt in sign_doubts(&table.trials) {
                    items.push(Item::new(&input, State::Look, doubt.words, cost));
                }
                let (trials, thinner) = crate::thin::thinned(table.trials.clone());
                let cost = "a calibration takes the readings, not the rows";
                items.extend(thinner.map(|what| Item::new(&input, State::Look, what.text, cost)));
                items.extend(left_out(&input, &trials, options));
                let unknown = given::no_ligament(&trials).map(|what| format!("{path}: {what}"));
                items.extend(unknown.map(|what| Item::new(&input, State::Fault, what, "")));
                measured.insert(name.clone(), table.trials);
            }
        }
    }
    against_each_other(&measured, items);
    if file.laxity.len() == 1 {
        let cost = "one source alone: nothing shows how far its apparatus can be trusted";
        items.push(Item::new("laxity", State::Missing, "no second source", cost));
    }
    measured
}

/// What two sources of one knee contradict each other in.
fn against_each_other(measured: &BTreeMap<String, Vec<LaxityTrial>>, items: &mut Vec<Item>) {
    let sets: Vec<Named> = measured.iter().map(|(name, trials)| (name.as_str(), trials.as_slice())).collect();
    if let Some(what) = given::twice(&sets) {
        return items.push(Item::new("laxity", State::Fault, what, "name the file of each source, or leave one out"));
    }
    let cost = "a build calibrates to both as they stand";
    items.extend(between(&sets).into_iter().map(|doubt| Item::new("laxity", State::Look, doubt.words, cost)));
}

/// Warnings of the reader that are shown; more are counted.
const SHOWN: usize = 3;

/// Counts, flexions, what is given beside.
fn summary(input: &str, trials: &[LaxityTrial], warnings: &[Notice]) -> Item {
    let tests: BTreeSet<&str> = trials.iter().map(|t| t.test.name()).collect();
    let flexions: BTreeSet<i64> = trials.iter().map(|t| t.nominal_flexion_deg.round() as i64).collect();
    let list: Vec<String> = flexions.iter().map(i64::to_string).collect();
    let tests: Vec<&str> = tests.into_iter().collect();
    let mut found = format!("{} trials at {} deg: {}", trials.len(), list.join(", "), tests.join(", "));
    let cut = trials.first().map_or(&[][..], |t| &t.without);
    if !cut.is_empty() {
        found += &format!("; of the knee without {}", cut.join(" and "));
    }
    let displaced = trials.iter().filter(|t| t.reference.is_some()).count();
    if displaced > 0 {
        found += &format!("; {displaced} read displacements from another trial's pose");
    }
    for w in warnings.iter().take(SHOWN) {
        found += &format!("; {w}");
    }
    if warnings.len() > SHOWN {
        found += &format!("; and {} more like these", warnings.len() - SHOWN);
    }
    let mut without = Vec::new();
    if trials.iter().all(|t| t.sd.iter().all(Option::is_none)) {
        without.push("no measurement noise (sd_...): the program's is taken");
    }
    if trials.iter().all(|t| t.branch.is_none()) {
        without.push("no branches: effects of loading history cannot be diagnosed");
    }
    Item::new(input, if warnings.is_empty() { State::Ok } else { State::Look }, found, &without.join("; "))
}

/// What a calibration would leave out or refuse.
fn left_out(input: &str, trials: &[LaxityTrial], options: &BuildOptions) -> Option<Item> {
    let o = &options.calibrate;
    match targets(trials, &PoseSpec::default(), &o.cost, &o.targets) {
        Err(e) => Some(Item::new(input, State::Fault, e.to_string(), "")),
        Ok(t) => {
            let out: Vec<&Notice> = t.warnings.iter().filter(|w| w.kind == Kind::RowLeftOut).collect();
            let first = out.first()?;
            let found = format!("{} trials are left out of the calibration, the first: {first}", out.len());
            Some(Item::new(input, State::Look, found, ""))
        }
    }
}
