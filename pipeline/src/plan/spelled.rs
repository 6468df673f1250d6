//! What graft.toml may hold at each key. Another kind of value is told with line, key and what was expected.

use sim::names::did_you_mean;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// What a key may hold.
pub(super) enum Kind {
    Text,
    Texts,
    Number,
    /// So many, where that is fixed.
    Numbers(Option<usize>),
    Table(&'static [Key]),
    Tables(&'static [Key]),
}

/// A key: its name, what it may hold, and how that is written.
pub(super) struct Key {
    pub(super) name: &'static str,
    kind: Kind,
    such: &'static str,
    is_needed: bool,
}

pub(super) const fn key(name: &'static str, kind: Kind, such: &'static str) -> Key {
    Key { name, kind, such, is_needed: false }
}

const fn needed(name: &'static str, kind: Kind, such: &'static str) -> Key {
    Key { name, kind, such, is_needed: true }
}

/// Keys of a plan: [`super::file::PlanFile`].
const PLAN: &[Key] = &[
    key("name", Kind::Text, "name = \"single bundle\""),
    key("cut", Kind::Texts, "cut = [\"ACL\"]"),
    key("graft", Kind::Tables(GRAFT), "[[graft]]"),
    key("tests", Kind::Table(TESTS), "[tests]"),
];

/// Of a graft: [`super::file::GraftFile`].
const GRAFT: &[Key] = &[
    needed("name", Kind::Text, "name = \"hamstring\""),
    needed("femur", Kind::Table(SITE), "femur = { native = \"ACL\" }"),
    needed("tibia", Kind::Table(SITE), "tibia = { native = \"ACL\" }"),
    key("stiffness_n_per_mm", Kind::Number, "stiffness_n_per_mm = 200.0"),
    key("cross_section_mm2", Kind::Number, "cross_section_mm2 = 50.0"),
    key("modulus_mpa", Kind::Number, "modulus_mpa = 120.0"),
    key("free_length_mm", Kind::Number, "free_length_mm = 60.0"),
    key("toe_strain", Kind::Number, "toe_strain = 0.03"),
    key("tension_n", Kind::Number, "tension_n = 80.0"),
    key("at_flexion_deg", Kind::Number, "at_flexion_deg = 20.0"),
    key("slack_length_mm", Kind::Number, "slack_length_mm = 30.0"),
];

/// Of a place on a bone: [`super::file::SiteFile`].
const SITE: &[Key] = &[
    key("native", Kind::Text, "native = \"ACL\""),
    key("point_mm", Kind::Numbers(Some(3)), "point_mm = [12.0, -3.5, 40.0]"),
    key("quadrant_percent", Kind::Numbers(Some(2)), "quadrant_percent = [24.8, 28.5]"),
    key("plateau_percent", Kind::Numbers(Some(2)), "plateau_percent = [41.0, 48.0]"),
    key("move_mm", Kind::Numbers(Some(3)), "move_mm = [2.0, 0.0, 0.0]"),
];

/// Of the tests: [`super::file::TestsFile`].
const TESTS: &[Key] = &[
    key("flexions_deg", Kind::Numbers(None), "flexions_deg = [0.0, 30.0]"),
    key("passive_deg", Kind::Numbers(None), "passive_deg = [0.0, 45.0, 90.0]"),
    key("drawer_n", Kind::Number, "drawer_n = 134.0"),
    key("rotation_nm", Kind::Number, "rotation_nm = 5.0"),
    key("varus_valgus_nm", Kind::Number, "varus_valgus_nm = 10.0"),
    key("pivot", Kind::Numbers(Some(3)), "pivot = [30.0, 8.0, 4.0]"),
    key("compression_n", Kind::Number, "compression_n = 20.0"),
    key("restored_mm", Kind::Number, "restored_mm = 2.0"),
    key("restored_deg", Kind::Number, "restored_deg = 3.0"),
];

impl Key {
    /// What was expected, and how it is written.
    fn expected(&self) -> String {
        let what = match self.kind {
            Kind::Text => "text in quotes".to_owned(),
            Kind::Texts => "a list of names".to_owned(),
            Kind::Number => "a number".to_owned(),
            Kind::Numbers(Some(n)) => format!("a list of {n} numbers"),
            Kind::Numbers(None) => "a list of numbers".to_owned(),
            Kind::Table(_) => "a table".to_owned(),
            Kind::Tables(_) => "a table a graft".to_owned(),
        };
        format!("expected {what}, such as {}", self.such)
    }

    /// Holds a value against the key; faults go to `faults`, each with its place in the text.
    fn judge(&self, path: &str, value: &Spanned<DeValue>, faults: &mut Vec<(usize, String)>) {
        let at = value.span().start;
        let wrong = match (&self.kind, value.get_ref()) {
            (Kind::Text, DeValue::String(_)) => None,
            (Kind::Number, number) if is_number(number) => None,
            (Kind::Texts, DeValue::Array(all)) => first_other(all, &|v| matches!(v, DeValue::String(_))),
            (Kind::Numbers(count), DeValue::Array(all)) => first_other(all, &is_number)
                .or_else(|| count.is_some_and(|n| n != all.len()).then(|| (at, format!("is a list of {}", all.len())))),
            (Kind::Table(keys), DeValue::Table(table)) => {
                judge(&format!("{path}."), table, at, keys, faults);
                None
            }
            (Kind::Tables(keys), DeValue::Array(all)) => {
                for (k, one) in all.iter().enumerate() {
                    if let DeValue::Table(table) = one.get_ref() {
                        judge(&format!("{path}[{k}]."), table, one.span().start, keys, faults);
                    }
                }
                first_other(all, &|v| matches!(v, DeValue::Table(_)))
            }
            (_, other) => Some((at, format!("is {}", words(other)))),
        };
        faults.extend(wrong.map(|(at, found)| (at, format!("{path} {found}; {}", self.expected()))));
    }
}

fn is_number(value: &DeValue) -> bool {
    matches!(value, DeValue::Integer(_) | DeValue::Float(_))
}

/// The first value of a list that is none of those that belong there: its place, and what is said of it.
fn first_other(all: &DeArray, belongs: &dyn Fn(&DeValue) -> bool) -> Option<(usize, String)> {
    let other = all.iter().find(|v| !belongs(v.get_ref()))?;
    Some((other.span().start, format!("has {} in it", words(other.get_ref()))))
}

/// A value in words.
fn words(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("the text {text:?}"),
        DeValue::Integer(n) => format!("the number {n}"),
        DeValue::Float(n) => format!("the number {n}"),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// Holds a table, which begins at `from`, against its keys.
fn judge(path: &str, table: &DeTable, from: usize, keys: &[Key], faults: &mut Vec<(usize, String)>) {
    for (name, value) in table {
        match keys.iter().find(|k| k.name == name.get_ref().as_ref()) {
            Some(key) => key.judge(&format!("{path}{}", key.name), value, faults),
            None => {
                let known: Vec<&str> = keys.iter().map(|k| k.name).collect();
                let near = did_you_mean(name.get_ref(), known.iter().copied());
                let told = format!("no key {path}{}{near}; expected one of {}", name.get_ref(), known.join(", "));
                faults.push((name.span().start, told));
            }
        }
    }
    for key in keys.iter().filter(|k| k.is_needed && !table.keys().any(|n| n.get_ref().as_ref() == k.name)) {
        faults.push((from, format!("{path}{} is not there; {}", key.name, key.expected())));
    }
}

/// Refuses a plan with a value of another kind, an unknown key or none where one is needed: the line and the first of its faults.
pub(super) fn refuse(text: &str, plan: &DeTable) -> Result<(), (Option<usize>, String)> {
    refuse_by(text, plan, PLAN)
}

/// The same of a file that has these keys.
pub(super) fn refuse_by(text: &str, file: &DeTable, keys: &[Key]) -> Result<(), (Option<usize>, String)> {
    let mut faults = Vec::new();
    judge("", file, 0, keys, &mut faults);
    match faults.into_iter().min_by_key(|f| f.0) {
        Some((at, told)) => Err((Some(line(text, at)), told)),
        None => Ok(()),
    }
}

/// The line of a place in a text, the first being 1.
pub(super) fn line(text: &str, at: usize) -> usize {
    text[..at.min(text.len())].matches('\n').count() + 1
}

/// The line of a key such as `graft.0.femur`, or of what it lies in where it is not there.
pub(super) fn line_of(text: &str, plan: &DeTable, path: &str) -> Option<usize> {
    let (mut table, mut at) = (Some(plan), None);
    let mut list: Option<&DeArray> = None;
    for step in path.split('.') {
        let found = match (table, list) {
            (Some(t), _) => t.iter().find(|(k, _)| k.get_ref().as_ref() == step).map(|(k, v)| (k.span().start, v)),
            (_, Some(l)) => step.parse().ok().and_then(|n: usize| l.get(n)).map(|v| (v.span().start, v)),
            _ => None,
        };
        let Some((start, value)) = found else { break };
        at = Some(start);
        (table, list) = match value.get_ref() {
            DeValue::Table(t) => (Some(t), None),
            DeValue::Array(l) => (None, Some(l)),
            _ => (None, None),
        };
    }
    at.map(|at| line(text, at))
}

#[cfg(test)]
mod tests {
    use super::super::file::{EXAMPLE, PlanFile, parsed};
    use super::*;

    /// A plan with a value at each key, of one graft.
    const WHOLE: &str = r#"
name = "n"
cut = ["ACL"]
[[graft]]
name = "g"
stiffness_n_per_mm = 200
cross_section_mm2 = 50
modulus_mpa = 100
free_length_mm = 60
toe_strain = 0.03
tension_n = 40
at_flexion_deg = 20
slack_length_mm = 30
[graft.femur]
native = "ACL"
point_mm = [1, 2, 3]
quadrant_percent = [20, 30]
plateau_percent = [40, 50]
move_mm = [0, 0, 0]
[graft.tibia]
native = "ACL"
[tests]
flexions_deg = [30]
passive_deg = [30]
drawer_n = 134
rotation_nm = 5
varus_valgus_nm = 10
pivot = [30, 8, 4]
compression_n = 20
restored_mm = 2
restored_deg = 3
"#;

    #[test]
    fn the_keys_are_those_that_are_read() {
        let whole: PlanFile = toml::from_str(WHOLE).unwrap();
        let written = toml::Table::try_from(&whole).unwrap();
        let names = |keys: &[Key]| keys.iter().map(|k| k.name.to_owned()).collect::<std::collections::BTreeSet<_>>();
        let of = |table: &toml::Table| table.keys().cloned().collect();
        let graft = written["graft"][0].as_table().unwrap();
        assert_eq!(names(PLAN), of(&written));
        assert_eq!(names(GRAFT), of(graft));
        assert_eq!(names(SITE), of(graft["femur"].as_table().unwrap()));
        assert_eq!(names(TESTS), of(written["tests"].as_table().unwrap()));
    }

    #[test]
    fn each_key_with_another_kind_of_value_is_told_with_its_line_and_what_was_expected() {
        let lines: Vec<&str> = WHOLE.lines().collect();
        let mut tried = 0;
        for (k, own) in lines.iter().enumerate() {
            let Some((key, _)) = own.split_once(" = ") else { continue };
            let others =
                ["\"ACL\"", "[\"ACL\"]", "7", "[7]", "[7, 7, 7, 7]", "true", "2026-01-01", "{ a = 1 }", "[[1]]"];
            for other in others {
                let mut changed = lines.clone();
                let line = format!("{key} = {other}");
                changed[k] = &line;
                let text = changed.join("\n");
                // a list of names or numbers takes any of its kind
                if toml::from_str::<PlanFile>(&text).is_ok() {
                    continue;
                }
                let (at, told) = parsed(&text).unwrap_err();
                assert_eq!(at, Some(k + 1), "{line}: {told}");
                assert!(told.contains(key) && told.contains("; expected "), "{line}: {told}");
                assert!(told.contains(&format!("such as {key} = ")), "{line}: {told}");
                tried += 1;
            }
        }
        assert!(tried > 150, "{tried}");
    }

    #[test]
    fn a_word_for_a_list_and_a_head_for_a_table_are_told() {
        let told = |from: &str, to: &str| {
            assert!(EXAMPLE.contains(from), "{from}");
            let (line, told) = parsed(&EXAMPLE.replace(from, to)).unwrap_err();
            format!("line {}: {told}", line.unwrap())
        };
        assert_eq!(
            told("cut = [\"ACL\"]", "cut = \"ACL\""),
            "line 5: cut is the text \"ACL\"; expected a list of names, such as cut = [\"ACL\"]"
        );
        assert_eq!(
            told("[[graft]]", "[graft]"),
            "line 8: graft is a table; expected a table a graft, such as [[graft]]"
        );
        let misspelt = told("\ntension_n", "\ntenshun_n");
        assert!(
            misspelt.starts_with("line 19: no key graft[0].tenshun_n") && misspelt.contains("did you mean tension_n?")
        );
        assert!(told("tibia = {", "# tibia = {").starts_with("line 8: graft[0].tibia is not there; expected a table"));
        assert!(told("[tests]", "[test]").starts_with("line 23: no key test"));
    }

    #[test]
    fn a_value_out_of_its_range_has_its_line_too() {
        let told = |from: &str, to: &str| parsed(&EXAMPLE.replace(from, to)).unwrap_err();
        assert_eq!(told("\ntension_n = 80.0", "\ntension_n = 8000.0").0, Some(19));
        assert_eq!(told("drawer_n = 134.0", "drawer_n = -1").0, Some(26));
        assert_eq!(told("[41.0, 48.0]", "[41.0, 480.0]").0, Some(15));
        // neither of two keys: the graft's own line
        assert_eq!(told("\ntension_n = 80.0", "\n").0, Some(8));
    }
}
