//! sweep.toml: which choices of one graft are varied, and the plans that this makes.

use super::choice::{Bone, CHOICES, Choice, What};
use crate::error::{BuildError, Place};
use crate::plan::file::PlanFile;
use crate::plan::spelled::{self, Key, Kind, key};
use crate::store;
use sim::names::did_you_mean;
use std::path::Path;
use toml::de::DeTable;

/// An example, as `build-model plan --sweep-example` prints it.
pub(crate) const EXAMPLE: &str = include_str!("example.toml");

/// Plans that one sweep may ask [-]; ours: some hours of a laptop.
pub(super) const MOST_PLANS: u128 = 20_000;

/// Keys of sweep.toml: [`CHOICES`] and the names.
const KEYS: &[Key] = &[
    key("graft", Kind::Text, "graft = \"hamstring\""),
    key("map", Kind::Texts, "map = [\"femur_depth_percent\", \"femur_height_percent\"]"),
    key("femur_depth_percent", Kind::Numbers(None), "femur_depth_percent = [20.0, 25.0, 30.0]"),
    key("femur_height_percent", Kind::Numbers(None), "femur_height_percent = [20.0, 30.0]"),
    key("tibia_front_percent", Kind::Numbers(None), "tibia_front_percent = [36.0, 41.0]"),
    key("tibia_medial_percent", Kind::Numbers(None), "tibia_medial_percent = [44.0, 48.0]"),
    key("femur_forwards_mm", Kind::Numbers(None), "femur_forwards_mm = [-4.0, 0.0, 4.0]"),
    key("femur_upwards_mm", Kind::Numbers(None), "femur_upwards_mm = [-4.0, 0.0, 4.0]"),
    key("femur_lateral_mm", Kind::Numbers(None), "femur_lateral_mm = [0.0]"),
    key("tibia_forwards_mm", Kind::Numbers(None), "tibia_forwards_mm = [-4.0, 0.0, 4.0]"),
    key("tibia_upwards_mm", Kind::Numbers(None), "tibia_upwards_mm = [0.0]"),
    key("tibia_lateral_mm", Kind::Numbers(None), "tibia_lateral_mm = [-2.0, 0.0, 2.0]"),
    key("tension_n", Kind::Numbers(None), "tension_n = [40.0, 80.0]"),
    key("at_flexion_deg", Kind::Numbers(None), "at_flexion_deg = [0.0, 20.0]"),
    key("stiffness_n_per_mm", Kind::Numbers(None), "stiffness_n_per_mm = [150.0, 250.0]"),
];

/// A sweep: choices of one graft, each with its values.
#[derive(Clone, Debug)]
pub(crate) struct Sweep {
    /// The number of the graft that is varied.
    pub(super) graft: usize,
    /// The choices, and the values of each.
    pub(super) varied: Vec<(Choice, Vec<f64>)>,
    /// The two choices of the maps, by their places in `varied`.
    pub(super) map: Option<[usize; 2]>,
}

/// A fault: the line, where one is known, and what is wrong.
type Wrong = (Option<usize>, String);

/// Reads a sweep of a plan.
///
/// # Errors
/// A file that cannot be read; a key that is unknown, a value out of range, a name of no graft, too many plans: file, line, what was expected.
pub(crate) fn read(path: &Path, base: &PlanFile) -> Result<Sweep, BuildError> {
    let (text, name) = (store::read_text(path)?, path.display().to_string());
    parsed(&text, base).map_err(|(row, what)| {
        let line = row.map_or(String::new(), |n| format!(" line {n}"));
        BuildError::At { place: Place { row, ..Place::of(path) }, told: format!("{name}{line}: {what}") }
    })
}

/// A sweep from its text.
pub(super) fn parsed(text: &str, base: &PlanFile) -> Result<Sweep, Wrong> {
    let unread = |e: toml::de::Error| {
        let row = e.span().map(|s| spelled::line(text, s.start));
        (row, format!("{}; expected what `build-model plan --sweep-example` prints", e.message().trim()))
    };
    let lines = DeTable::parse(text).map_err(unread)?.into_inner();
    spelled::refuse_by(text, &lines, KEYS)?;
    let table: toml::Table = toml::from_str(text).map_err(unread)?;
    let at = |key: &str, told: String| (spelled::line_of(text, &lines, key), told);
    let graft = graft(&table, base).map_err(|told| at("graft", told))?;
    let mut varied = Vec::new();
    for choice in CHOICES {
        let Some(list) = table.get(choice.key).and_then(|v| v.as_array()) else { continue };
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|n| n as f64));
        let values: Vec<f64> = list.iter().filter_map(number).collect();
        if values.is_empty() {
            return Err(at(choice.key, format!("{} has no value, expected one or more", choice.key)));
        }
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
            let told = format!("{} has {} twice, expected each value once", choice.key, twice[1]);
            return Err(at(choice.key, told));
        }
        varied.push((choice, values));
    }
    let mut sweep = Sweep { graft, varied, map: None };
    sweep.check(base).map_err(|(key, told)| at(key, told))?;
    sweep.map = sweep.mapped(&table).map_err(|told| at("map", told))?;
    Ok(sweep)
}

/// The number of the graft that is named, or of the first.
fn graft(table: &toml::Table, base: &PlanFile) -> Result<usize, String> {
    if base.graft.is_empty() {
        return Err("there is no graft to vary; expected a [[graft]] in the plan".into());
    }
    let Some(name) = table.get("graft").and_then(|v| v.as_str()) else { return Ok(0) };
    let known: Vec<&str> = base.graft.iter().map(|g| g.name.as_str()).collect();
    known.iter().position(|k| *k == name).ok_or_else(|| {
        let near = did_you_mean(name, known.iter().copied());
        format!("the plan has no graft {name:?}{near}; expected one of {}", known.join(", "))
    })
}

impl Sweep {
    /// How many plans there are.
    fn count(&self) -> u128 {
        self.varied.iter().fold(1, |n, (_, values)| n.saturating_mul(values.len() as u128))
    }

    /// Refuses a sweep that means nothing: the key, and what is wrong.
    fn check(&self, base: &PlanFile) -> Result<(), (&'static str, String)> {
        let Some(last) = self.varied.last() else {
            return Err(("", "nothing is varied; expected a list, such as tension_n = [40.0, 80.0]".into()));
        };
        let count = self.count();
        if count > MOST_PLANS {
            let told =
                format!("{count} plans are asked, expected at most {MOST_PLANS}; give some choices fewer values");
            return Err((last.0.key, told));
        }
        let own = &base.graft[self.graft];
        let is_varied = |what: What| self.varied.iter().any(|(c, _)| c.what == what);
        for (choice, _) in &self.varied {
            if let What::Percent(bone, k) = choice.what
                && bone.percent(own).is_none()
                && !is_varied(What::Percent(bone, 1 - k))
            {
                let other = CHOICES.iter().find(|c| c.what == What::Percent(bone, 1 - k)).map_or("", |c| c.key);
                let place = if bone == Bone::Femur { "femur.quadrant_percent" } else { "tibia.plateau_percent" };
                let told =
                    format!("{} says half of a place; expected {other}, too, or {place} in the plan", choice.key);
                return Err((choice.key, told));
            }
        }
        if is_varied(What::Flexion) && own.tension_n.is_none() && !is_varied(What::Tension) {
            let told = "at_flexion_deg changes nothing of a graft with slack_length_mm; expected tension_n, too";
            return Err(("at_flexion_deg", told.into()));
        }
        let is_part = |x: &f64| (0.0..=1.0).contains(x);
        let parts = |(c, values): &&(Choice, Vec<f64>)| {
            matches!(c.what, What::Percent(..)) && values.iter().all(is_part) && values.iter().any(|x| *x > 0.0)
        };
        if let Some((choice, values)) = self.varied.iter().find(parts) {
            let percents: Vec<f64> = values.iter().map(|x| 100.0 * x).collect();
            return Err((
                choice.key,
                format!("{} is {values:?}: parts of 1? Expected percentages, such as {percents:?}", choice.key),
            ));
        }
        // each value by itself, so that the fault is its own
        for (choice, values) in &self.varied {
            for x in values {
                let mut one = base.clone();
                choice.put(&mut one.graft[self.graft], *x);
                one.check().map_err(|wrong| (choice.key, format!("{} has {x}: {}", choice.key, wrong.told)))?;
            }
        }
        Ok(())
    }

    /// The two choices of the maps: those that are named, else the two with most values; none where only one is varied.
    fn mapped(&self, table: &toml::Table) -> Result<Option<[usize; 2]>, String> {
        let several = |k: &usize| self.varied[*k].1.len() > 1;
        if let Some(named) = table.get("map").and_then(|v| v.as_array()) {
            let place = |name: &toml::Value| {
                let at = self.varied.iter().position(|(c, _)| Some(c.key) == name.as_str());
                at.filter(several).ok_or_else(|| format!("map names {name}, expected a choice with several values"))
            };
            return match named.iter().map(place).collect::<Result<Vec<_>, _>>()?[..] {
                [a, b] if a != b => Ok(Some([a, b])),
                _ => Err("map is no pair, expected the names of two choices".into()),
            };
        }
        let mut all: Vec<usize> = (0..self.varied.len()).filter(several).collect();
        all.sort_by_key(|k| (std::cmp::Reverse(self.varied[*k].1.len()), *k));
        Ok(all.first().copied().zip(all.get(1).copied()).map(|(a, b)| if a < b { [a, b] } else { [b, a] }))
    }

    /// The values of every plan, the last choice changing first.
    pub(super) fn all(&self) -> Vec<Vec<f64>> {
        self.varied.iter().fold(vec![vec![]], |all, (_, values)| {
            all.iter().flat_map(|one| values.iter().map(move |x| [one.as_slice(), &[*x]].concat())).collect()
        })
    }

    /// The plan at these values of the choices.
    pub(super) fn plan(&self, base: &PlanFile, values: &[f64]) -> PlanFile {
        let mut out = base.clone();
        if let Some(own) = out.graft.get_mut(self.graft) {
            self.varied.iter().zip(values).for_each(|((choice, _), x)| choice.put(own, *x));
        }
        out
    }

    /// Values of the choices in words: "tension_n 40, at_flexion_deg 20".
    pub(super) fn words(&self, values: &[f64]) -> String {
        let each: Vec<String> = self.varied.iter().zip(values).map(|((c, _), x)| format!("{} {x}", c.key)).collect();
        each.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::file;

    fn base() -> PlanFile {
        file::parsed(file::EXAMPLE).unwrap()
    }

    #[test]
    fn percentages_as_parts_of_one_are_refused_as_in_a_plan() {
        let of = |values: &str| {
            parsed(&format!("femur_depth_percent = {values}\nfemur_height_percent = [25.0]"), &base()).map(|_| ())
        };
        let (row, told) = of("[0.2, 0.3]").unwrap_err();
        assert!(row == Some(1) && told.contains("parts of 1?") && told.contains("[20.0, 30.0]"), "{row:?} {told}");
        // the edge itself may be asked, and a list that goes beyond 1 is of percentages
        assert!(of("[0.0]").is_ok() && of("[0.5, 20.0]").is_ok());
    }

    #[test]
    fn the_keys_are_the_choices_and_the_example_names_each() {
        let keys: Vec<&str> = KEYS[2..].iter().map(|k| k.name).collect();
        assert_eq!(keys, CHOICES.map(|c| c.key));
        for key in KEYS {
            assert!(EXAMPLE.contains(&format!("{} = ", key.name)), "{}", key.name);
        }
        // whoever takes the marks away has a file that is read
        let whole: String = EXAMPLE
            .lines()
            .map(|l| l.strip_prefix("# ").filter(|l| l.contains(" = ")).unwrap_or(l))
            .map(|l| format!("{l}\n"))
            .collect();
        let all = parsed(&whole, &base()).unwrap_err().1;
        assert!(all.contains("plans are asked, expected at most 20000"), "{all}");
        assert_eq!(parsed(EXAMPLE, &base()).unwrap().all().len(), 48);
    }

    #[test]
    fn every_combination_is_a_plan_of_its_own_and_the_rest_stays() {
        let sweep = parsed("tension_n = [40, 80]\nfemur_forwards_mm = [-2, 0, 2.5]\n", &base()).unwrap();
        let all = sweep.all();
        assert_eq!(all.len(), 6);
        for values in &all {
            let plan = sweep.plan(&base(), values);
            let own = &plan.graft[0];
            assert_eq!((own.femur.move_mm[0], own.tension_n), (values[0], Some(values[1])));
            let mut back = plan.clone();
            back.graft[0].femur.move_mm = base().graft[0].femur.move_mm;
            back.graft[0].tension_n = base().graft[0].tension_n;
            assert_eq!(back, base());
        }
        assert_eq!(sweep.map, Some([0, 1]));
        let mut each = all.clone();
        each.sort_by(|a, b| a.partial_cmp(b).unwrap());
        each.dedup();
        assert_eq!(each.len(), 6);
    }

    #[test]
    fn what_means_nothing_is_told_with_its_line() {
        let told = |text: &str, base: &PlanFile| {
            let (line, told) = parsed(text, base).unwrap_err();
            format!("line {}: {told}", line.map_or("none".into(), |n| n.to_string()))
        };
        for (text, words) in [
            ("", "line none: nothing is varied"),
            ("tension = [40]", "line 1: no key tension; did you mean tension_n?"),
            ("\ntension_n = 40", "line 2: tension_n is the number 40; expected a list of numbers, such as"),
            ("tension_n = []", "line 1: tension_n has no value"),
            ("tension_n = [40, 80, 40.0]", "line 1: tension_n has 40 twice"),
            (
                "tension_n = [40, 4000]",
                "line 1: tension_n has 4000: graft \"hamstring\": tension_n is 4000, expected 1 to 500",
            ),
            ("tension_n = [nan]", "line 1: tension_n has NaN"),
            ("tension_n = [40]\nat_flexion_deg = [20, 200]", "line 2: at_flexion_deg has 200"),
            ("femur_upwards_mm = [-31]", "expected -30 to 30"),
            ("femur_depth_percent = [25, 480]", "line 1: femur_depth_percent has 480"),
            (
                "graft = \"hamstrin\"\ntension_n = [40]",
                "line 1: the plan has no graft \"hamstrin\"; did you mean hamstring?",
            ),
            ("tension_n = [40, 80]\nmap = [\"tension_n\", \"at_flexion_deg\"]", "line 2: map names"),
            ("tension_n = [40, 80]\nmap = [\"tension_n\"]", "line 2: map is no pair"),
        ] {
            let told = told(text, &base());
            assert!(told.contains(words), "{text}: {told}");
        }
        let many: Vec<String> = (0..150).map(|n| n.to_string()).collect();
        let square = format!("tension_n = [{}]\nstiffness_n_per_mm = [{}]", many[1..].join(","), many[1..].join(","));
        assert!(told(&square, &base()).contains("22201 plans are asked, expected at most 20000"));
        // half a place is none, unless the plan has the other half
        let mut native = base();
        native.graft[0].femur =
            crate::plan::SiteFile { native: Some("ACL".into()), ..crate::plan::SiteFile::default() };
        assert!(told("femur_depth_percent = [25]", &native).contains("expected femur_height_percent, too"));
        assert!(parsed("femur_depth_percent = [25]", &base()).is_ok());
        let mut slack = base();
        (slack.graft[0].tension_n, slack.graft[0].slack_length_mm) = (None, Some(30.0));
        assert!(told("at_flexion_deg = [0, 20]", &slack).contains("changes nothing"));
        assert!(told("tension_n = [40]", &PlanFile { graft: vec![], ..base() }).contains("no graft to vary"));
    }
}
