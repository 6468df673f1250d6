//! `options`: every option with its default, unit, source and meaning, as its comment in the source says.

use crate::error::BuildError;
use crate::options::{BuildOptions, range, range_words};
use serde::Serialize;
use sim::names::did_you_mean;
use std::fmt::Write;
use toml::{Table as TomlTable, Value};

/// A struct or a choice: its name, and name, type and comment of each member.
type Table = (&'static str, &'static [(&'static str, &'static str, &'static str)]);

mod comments {
    use super::Table;
    include!(concat!(env!("OUT_DIR"), "/option_comments.rs"));
}

/// An option as it is shown.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct OptionDoc {
    /// `stage.key`, as after `--set`.
    pub key: String,
    /// Its default, as TOML writes it.
    pub default: String,
    /// The same as a value; null where there is none.
    pub value: serde_json::Value,
    /// Its unit; `-` for a number without one, empty where it is no number.
    pub unit: String,
    /// Least and most that it may be, each number of a list alike; null where it is no number. Another option may ask for more.
    pub range: Option<[f64; 2]>,
    /// Where the default comes from: a key of docs/bibliography.bib, or `ours`.
    pub source: String,
    /// What it does.
    pub meaning: String,
    /// The values it may take, where it is a choice.
    pub choices: Vec<String>,
    /// Whether a laboratory sets it, so that `options` shows it without `--all`.
    pub shown: bool,
}

/// Options that a laboratory sets: what the knee, its scans, its measurements and its questions ask for. All others are of the method.
const SHOWN: [&str; 58] = [
    "segment.threshold",
    "segment.closing_mm",
    "segment.labels_are",
    "segment.smoothing_rounds",
    "ingest.ras",
    "ingest.label_blur",
    "register.seed",
    "register.rms_limit_mm",
    "register.error_limit_mm",
    "register.landmark_limit_mm",
    "bones.crop_mm",
    "bones.edge_mm",
    "cartilage.method",
    "cartilage.least_thickness_mm",
    "cartilage.reach_mm",
    "cartilage.edge_mm",
    "frames.landmark_limit_mm",
    "frames.given_limits",
    "attachments.mark_reach_mm",
    "attachments.mark_off_bone_mm",
    "attachments.crossing_limit_mm",
    "hexmesh.edge_length_mm",
    "hexmesh.layers",
    "hexmesh.min_thickness_mm",
    "overclosure.gap_mm",
    "contact-law.fit",
    "contact-law.law",
    "contact-law.youngs_modulus_mpa",
    "contact-law.poissons_ratio",
    "contact-law.flexions_deg",
    "contact-law.force_n",
    "assemble.overclosure_mm",
    "assemble.pressure_mpa",
    "assemble.friction",
    "assemble.toe_strain",
    "assemble.law",
    "assemble.wrap",
    "assemble.menisci",
    "assemble.patella",
    "calibrate.method",
    "calibrate.targets.set",
    "calibrate.targets.flexion_deg",
    "calibrate.targets.coordinates",
    "calibrate.targets.noise",
    "calibrate.ranges",
    "calibrate.priors",
    "calibrate.loads",
    "calibrate.gradient.samples",
    "calibrate.gradient.interval",
    "calibrate.seed",
    "validate.compression_n",
    "validate.ap_flexions_deg",
    "validate.ap_load_n",
    "validate.to_flexion_deg",
    "validate.samples",
    "validate.solver",
    "diagnose.run",
    "diagnose.seed",
];

/// Longest line on a terminal.
const WIDTH: usize = 100;

/// The options that a laboratory sets, or with `every` all, of one stage or of all, in words; as JSON always all.
pub fn options(stage: Option<&str>, every: bool, json: bool) -> Result<String, BuildError> {
    let all = all()?;
    let stages: Vec<&str> = members("BuildOptions").iter().map(|m| m.0).collect();
    if let Some(stage) = stage
        && !stages.contains(&stage)
    {
        return Err(BuildError::Usage(format!(
            "no stage with options is called {stage}{}; stages are {}",
            did_you_mean(stage, stages.iter().copied()),
            stages.join(", ")
        )));
    }
    let chosen: Vec<&OptionDoc> =
        all.iter().filter(|o| stage.is_none_or(|s| o.key.split('.').next() == Some(s))).collect();
    if json {
        return Ok(String::from_utf8_lossy(&crate::record::json(&chosen)).into_owned());
    }
    let more = if every { 0 } else { chosen.iter().filter(|o| !o.shown).count() };
    let mut text = String::new();
    for o in chosen.iter().filter(|o| every || o.shown) {
        let unit = if o.unit.is_empty() { String::new() } else { format!(" [{}]", o.unit) };
        let _ = writeln!(text, "{} = {}{unit}", o.key, o.default);
        let source = format!(" Source: {}.", o.source);
        let choices = if o.choices.is_empty() { String::new() } else { format!(" One of {}.", o.choices.join(", ")) };
        let range = o.range.map_or(String::new(), |range| format!(" Range: {}.", range_words(range)));
        text += &wrapped(&format!("{}{choices}{range}{source}", o.meaning));
    }
    if more > 0 {
        let of = stage.map_or(String::new(), |s| format!(" {s}"));
        let _ = writeln!(text, "\n{more} more are of the method: build-model options{of} --all");
    }
    let example = chosen.iter().find(|o| o.unit == "mm").or(chosen.first());
    if let Some(o) = example {
        let (stage, key) = o.key.split_once('.').unwrap_or(("", &o.key));
        let _ = writeln!(
            text,
            "\nChange one for a single build: --set {}={}, beside its folder\nor for all, in specimen.toml: [options.{stage}] {key} = {}",
            o.key, o.default, o.default
        );
    }
    Ok(text)
}

/// Every option of every stage.
pub fn all() -> Result<Vec<OptionDoc>, BuildError> {
    let defaults = TomlTable::try_from(BuildOptions::default()).map_err(|e| BuildError::Option(e.to_string()))?;
    let mut found = Vec::new();
    walk("", "BuildOptions", Some(&Value::Table(defaults)), &mut found);
    Ok(found)
}

fn members(name: &str) -> &'static [(&'static str, &'static str, &'static str)] {
    comments::STRUCTS.iter().find(|(n, _)| *n == name).map_or(&[], |(_, m)| m)
}

fn walk(prefix: &str, name: &str, defaults: Option<&Value>, found: &mut Vec<OptionDoc>) {
    for (field, kind, comment) in members(name) {
        let key = if prefix.is_empty() { (*field).to_owned() } else { format!("{prefix}.{field}") };
        let default = defaults.and_then(|d| d.get(field));
        if !members(kind).is_empty() {
            walk(&key, kind, default, found);
            continue;
        }
        // numbers of a list may have a unit each
        let (meaning, mut unit, source) = parted(comment, default.is_some_and(Value::is_array));
        // a seed has no unit, whether its comment says so or not
        if unit.is_empty() && key.ends_with(".seed") {
            "-".clone_into(&mut unit);
        }
        // of two choices with one name, that which has the default
        let is_default = |c: &&Table| default.is_some_and(|d| c.1.iter().any(|m| d.as_str() == Some(m.0)));
        let mut named = comments::CHOICES.iter().filter(|(n, _)| n == kind);
        let choices = named.clone().find(is_default).or(named.next()).map_or(&[][..], |(_, m)| m);
        found.push(OptionDoc {
            shown: SHOWN.contains(&key.as_str()),
            range: range(&key, default),
            key,
            default: default.map_or("none".to_owned(), Value::to_string),
            value: default.and_then(|d| serde_json::to_value(d).ok()).unwrap_or_default(),
            unit,
            source,
            meaning,
            choices: choices.iter().map(|c| c.0.to_owned()).collect(),
        });
    }
}

/// A comment's meaning, the unit in its brackets, and its source. Of a list it may tell a unit for each number: all are its unit, in their order.
fn parted(comment: &str, is_list: bool) -> (String, String, String) {
    let (mut meaning, mut unit, mut sources) = (String::new(), String::new(), Vec::new());
    let mut rest = comment;
    while let Some((before, after)) = rest.split_once('[') {
        let Some((inner, behind)) = after.split_once(']') else { break };
        meaning += before;
        let cited = inner.split([',', ';']).next().unwrap_or("").trim();
        if cited.chars().rev().take_while(char::is_ascii_digit).count() == 4 {
            sources.push(inner.to_owned());
        } else if inner.starts_with('`') {
            meaning += inner.trim_matches('`');
        } else if unit.is_empty() {
            inner.clone_into(&mut unit);
        } else if is_list {
            if !unit.split(", ").any(|known| known == inner) {
                unit += &format!(", {inner}");
            }
        } else {
            meaning += &format!("[{inner}]");
        }
        rest = behind;
    }
    meaning += rest;
    // a default that cites nobody is a choice of this program
    if sources.is_empty() {
        sources.push("ours".into());
    }
    for (from, to) in [("; ours.", "."), ("; ours,", ","), (" Ours.", "")] {
        meaning = meaning.replace(from, to);
    }
    let mut words = meaning.split_whitespace().collect::<Vec<_>>().join(" ");
    for (from, to) in [
        (" ;", ";"),
        (" .", "."),
        (" ,", ","),
        (";.", "."),
        (" :", ":"),
        (", )", ")"),
        (",)", ")"),
        ("(, ", "("),
        (" ()", ""),
    ] {
        words = words.replace(from, to);
    }
    (words, unit, sources.join("; "))
}

/// Words under an option, indented.
fn wrapped(text: &str) -> String {
    let (mut out, mut line) = (String::new(), String::from("   "));
    for word in text.split_whitespace() {
        if line.len() + word.len() + 1 > WIDTH {
            let _ = writeln!(out, "{line}");
            line = "   ".into();
        }
        let _ = write!(line, " {word}");
    }
    if line.trim().is_empty() { out } else { out + &line + "\n" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{parse_override, typed};
    use std::collections::BTreeMap;

    /// Tables whose keys are the names of coordinates or bundles.
    const NAMED_TABLES: [&str; 2] = ["calibrate.cost.weights", "calibrate.ranges"];

    #[test]
    fn every_option_has_a_default_and_a_meaning() {
        let all = all().unwrap();
        let mut leaves = Vec::new();
        fn gather(prefix: &str, value: &Value, into: &mut Vec<String>) {
            match value {
                Value::Table(t) if !t.is_empty() => {
                    t.iter().for_each(|(k, v)| gather(&format!("{prefix}.{k}"), v, into));
                }
                _ => into.push(prefix.trim_start_matches('.').to_owned()),
            }
        }
        gather("", &Value::try_from(BuildOptions::default()).unwrap(), &mut leaves);
        // a table by coordinate or bundle is one option
        let by_name = |leaf: &str, key: &str| NAMED_TABLES.contains(&key) && leaf.starts_with(&format!("{key}."));
        for leaf in &leaves {
            assert!(
                all.iter().any(|o| o.key == *leaf || by_name(leaf, &o.key)),
                "{leaf} is not among the options shown"
            );
        }
        let is_number =
            |v: &serde_json::Value| v.is_number() || v.as_array().is_some_and(|a| a.iter().any(|v| v.is_number()));
        let of = |lacks: &dyn Fn(&OptionDoc) -> bool| -> Vec<&str> {
            all.iter().filter(|o| lacks(o)).map(|o| o.key.as_str()).collect()
        };
        assert_eq!(of(&|o| o.meaning.is_empty()), [""; 0], "options without a meaning");
        assert_eq!(of(&|o| o.range.is_some() && o.unit.is_empty()), [""; 0], "options without a unit");
        assert_eq!(of(&|o| is_number(&o.value) && o.range.is_none()), [""; 0], "numbers without a range");
        assert_eq!(of(&|o| o.range.is_some_and(|[a, b]| a > b)), [""; 0], "ranges the wrong way round");
        assert_eq!(of(&|o| o.source.is_empty()), [""; 0], "options without a source or ours");
    }

    #[test]
    fn a_laboratory_is_shown_few_options_and_all_of_them_are_there() {
        let all = all().unwrap();
        let shown: Vec<&str> = all.iter().filter(|o| o.shown).map(|o| o.key.as_str()).collect();
        assert!(shown.len() <= 60 && shown.len() == SHOWN.len(), "{} shown, {SHOWN:?}", shown.len());
        let told = options(None, false, false).unwrap();
        let lines = |text: &str| {
            let has = |key: &str| text.lines().any(|l| l.starts_with(&format!("{key} = ")));
            all.iter().filter(|o| has(&o.key)).count()
        };
        assert_eq!(lines(&told), shown.len());
        assert_eq!(lines(&options(None, true, false).unwrap()), all.len());
        assert!(told.contains(&format!("{} more are of the method", all.len() - shown.len())));
    }

    /// What a citation left where it was cut out, and what only a reader of the source can follow.
    fn odd(meaning: &str) -> bool {
        let left = ["(,", ",)", ", )", "()", "( )", "(;", ";)", ",,", "..", " ,", " ."];
        let ends = [" of.", " the.", " as.", " to.", " in.", " with.", " and.", " from."];
        // a sentence begins with a capital, and nothing is owned by nobody
        let begins_small = meaning.match_indices(". ").any(|(at, _)| meaning[at + 2..].starts_with(char::is_lowercase));
        left.iter().chain(&ends).any(|w| meaning.contains(w))
            || begins_small
            || meaning.contains("::")
            || meaning.contains(" 's ")
    }

    #[test]
    fn no_text_has_a_hole_where_a_citation_was_or_a_path_of_the_source() {
        assert!(
            odd("half the smallest (LCL 48 mm2, ) is 24") && odd("the diagnosis' (crate::rim)") && !odd("0.5 (ours)")
        );
        assert!(
            odd("takes the rest. shares evenly.")
                && odd("the kappa of.")
                && odd("Settling; 's test deck.")
                && !odd("All of it.")
        );
        let all = all().unwrap();
        let odd: Vec<&OptionDoc> = all.iter().filter(|o| odd(&o.meaning)).collect();
        assert!(odd.is_empty(), "{odd:?}");
        // the cut itself leaves no hole
        assert_eq!(parted("Half (LCL 48 mm2, [laprade2003]) is 24 [mm2].", false).0, "Half (LCL 48 mm2) is 24.");
        assert_eq!(parted("Half ([laprade2003]) is 24 [mm2].", false).0, "Half is 24.");
    }

    #[test]
    fn a_default_is_among_its_choices() {
        for o in all().unwrap().iter().filter(|o| !o.choices.is_empty() && o.default != "none") {
            assert!(o.choices.contains(&o.default.trim_matches('"').to_owned()), "{}: {:?}", o.key, o.choices);
        }
    }

    /// The options with one set to a word, or what is said against it.
    fn with_word(key: &str, word: &str) -> Result<BuildOptions, String> {
        let line = parse_override(&format!("{key}={word}")).unwrap();
        typed(&BTreeMap::new(), &[line], None).map_err(|e| e.to_string())
    }

    /// What is told comes from comments, what is taken from types: the two must not part.
    #[test]
    fn the_choices_that_are_told_are_those_that_are_taken() {
        let all = all().unwrap();
        let mut asked = 0;
        for o in &all {
            let refused = with_word(&o.key, "\"no-such-word\"").err();
            let choices: Vec<BuildOptions> =
                o.choices.iter().map(|c| with_word(&o.key, &format!("\"{c}\"")).unwrap()).collect();
            let Some(said) = refused.filter(|said| !choices.is_empty() || said.contains("unknown variant")) else {
                assert!(choices.is_empty(), "{} takes any word, and tells {:?}", o.key, o.choices);
                continue;
            };
            // every second part stands between two marks
            let named = said.split('`').skip(1).step_by(2).filter(|word| *word != "no-such-word");
            for word in named {
                let meant = with_word(&o.key, &format!("\"{word}\"")).unwrap();
                assert!(choices.contains(&meant), "{}: {word} is not among {:?}", o.key, o.choices);
            }
            asked += 1;
        }
        assert!(asked > 8, "{asked} options have choices");
    }

    #[test]
    fn an_option_that_is_told_is_one_that_is_heard() {
        for o in all().unwrap() {
            // no option is a list of a list of a switch: its type refuses it, and only an unknown name is refused as such
            let said = with_word(&o.key, "[[true]]").unwrap_err();
            assert!(!said.contains("unknown field") && said.contains(&o.key), "{said}");
        }
    }

    #[test]
    fn a_default_is_a_value_of_its_type_beside_its_text() {
        let all = all().unwrap();
        for o in &all {
            let read = format!("x = {}", o.default).parse::<TomlTable>().ok();
            let value = read.and_then(|t| serde_json::to_value(&t["x"]).ok()).unwrap_or_default();
            assert_eq!(value, o.value, "{} = {}", o.key, o.default);
        }
        type Json = serde_json::Value;
        for is in [Json::is_boolean, Json::is_u64, Json::is_f64, Json::is_string, Json::is_array] {
            assert!(all.iter().any(|o| is(&o.value)));
        }
    }

    #[test]
    fn a_comment_is_parted_into_meaning_unit_and_source() {
        let told = parted("Wanted edge in the plane [mm]; 0.5 to 1 in use [stimpson2007]. Ours.", false);
        assert_eq!(told, ("Wanted edge in the plane; 0.5 to 1 in use.".into(), "mm".into(), "stimpson2007".into()));
    }

    #[test]
    fn the_index_of_the_pages_names_every_schema() {
        let index = include_str!("../../docs/index.md");
        let line = index.lines().find(|l| l.contains("`build-model schema NAME`")).unwrap();
        let missing: Vec<&str> =
            crate::schema::names().into_iter().filter(|name| !line.contains(&format!("`{name}`"))).collect();
        assert_eq!(missing, [""; 0], "schemas that docs/index.md does not name");
    }

    #[test]
    fn a_list_has_the_units_of_all_its_numbers() {
        let told = parted("Turn [deg], shift [mm] and tilt [deg].", true);
        assert_eq!((told.0.as_str(), told.1.as_str()), ("Turn, shift and tilt.", "deg, mm"));
        // of one number the others are beside it
        assert_eq!(parted("A turn [deg] for each shift [mm].", false).1, "deg");
        let all = all().unwrap();
        let lists = all.iter().filter(|o| o.value.is_array());
        let left: Vec<&str> = lists.filter(|o| o.meaning.contains('[')).map(|o| o.key.as_str()).collect();
        assert_eq!(left, [""; 0], "lists with a unit left in their words");
        let limits = all.iter().find(|o| o.key == "frames.given_limits").unwrap();
        assert_eq!(limits.unit, "deg, mm");
    }
}
