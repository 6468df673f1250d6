//! Options: the defaults of the program, overridden by specimen.toml, overridden by `--set stage.key=value`.

mod held;
mod ranges;

pub(crate) use ranges::{range, words as range_words};

use crate::error::BuildError;
use calibration::options::CalibrateOptions;
use diagnosis::search::DiagnosisOptions;
use serde::{Deserialize, Serialize};
use sim::names::{did_you_mean, in_words, nearest};
use sim::protocols::ProtocolOptions;
use stages::assemble::AssembleOptions;
use stages::attachments::AttachmentsOptions;
use stages::bones::BonesOptions;
use stages::cartilage::CartilageOptions;
use stages::contact_law::ContactLawOptions;
use stages::frames::FramesOptions;
use stages::hexmesh::HexmeshOptions;
use stages::overclosure::OverclosureOptions;
use stages::register::RegisterOptions;
use stages::segment::SegmentOptions;
use stages::specimen::IngestOptions;
use std::collections::BTreeMap;
use toml::{Table, Value};

/// Every option of every stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BuildOptions {
    /// Stage 0.
    pub segment: SegmentOptions,
    /// Stage 1.
    pub ingest: IngestOptions,
    /// Stage 2.
    pub register: RegisterOptions,
    /// Stage 3.
    pub bones: BonesOptions,
    /// Stage 4.
    pub cartilage: CartilageOptions,
    /// Stage 5.
    pub frames: FramesOptions,
    /// Stage 6.
    pub attachments: AttachmentsOptions,
    /// Stage 7.
    pub hexmesh: HexmeshOptions,
    /// Stage 8.
    pub overclosure: OverclosureOptions,
    /// Stage 8b, which runs where its `fit` is true.
    #[serde(rename = "contact-law")]
    pub contact_law: ContactLawOptions,
    /// Stage 9.
    pub assemble: AssembleOptions,
    /// Stage 10.
    pub calibrate: CalibrateOptions,
    /// Stage 11.
    pub validate: ProtocolOptions,
    /// Stage 12, which runs where it is asked for or its `run` is true.
    pub diagnose: DiagnosisOptions,
}

/// How a page tells what it was made with: this, then [`digest`].
pub const MADE_WITH: &str = "Made with default options and tables of digest ";

/// Digest of the default options of all stages and of the tables they work with: what a page of results was made with.
pub fn digest() -> Result<String, BuildError> {
    let options = serde_json::to_string(&BuildOptions::default()).map_err(|e| BuildError::Option(e.to_string()))?;
    let mut hasher = blake3::Hasher::new();
    let tables = [attachments::bundle::TABLE_3, calibration::priors::USUAL, validation::published::TABLES];
    for part in [options.as_str()].iter().chain(&tables) {
        hasher.update(part.as_bytes());
    }
    // a few of its digits tell two apart
    Ok(hasher.finalize().to_hex().chars().take(16).collect())
}

/// A `--set stage.key=value`.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    stage: String,
    key: String,
    value: Value,
}

impl Override {
    /// The error that it is.
    fn is_wrong(&self, told: String) -> BuildError {
        BuildError::Setting {
            key: format!("{}.{}", self.stage, self.key),
            value: self.value.to_string(),
            on_line: true,
            told,
        }
    }
}

/// Reads `stage.key=value`; the value in TOML's words, or a bare word for a string.
pub fn parse_override(text: &str) -> Result<Override, String> {
    let (path, value) = text.split_once('=').ok_or("expected stage.key=value, such as hexmesh.edge_length_mm=0.75")?;
    let (stage, key) = path
        .trim()
        .split_once('.')
        .ok_or("expected stage.key=value, such as hexmesh.edge_length_mm=0.75: there is no dot before the =")?;
    let value = value.trim();
    let parsed = format!("value = {value}").parse::<Table>().ok().and_then(|mut t| t.remove("value"));
    Ok(Override {
        stage: stage.trim().into(),
        key: key.trim().into(),
        value: parsed.unwrap_or_else(|| Value::String(value.into())),
    })
}

/// The options in force: every name in them known, every value in its range. All sections are judged, whatever is asked for.
///
/// Errors: the option, where it was set, what was expected.
pub fn resolve(
    specimen: &BTreeMap<String, Table>,
    overrides: &[Override],
    seed: Option<u64>,
) -> Result<BuildOptions, BuildError> {
    let options = typed(specimen, overrides, seed)?;
    let table = Table::try_from(&options).map_err(|e| BuildError::Option(e.to_string()))?;
    ranges::check(&options, &table).map_err(|fault| {
        let more = format!("{}; see build-model options {}", fault.what, fault.section);
        match overrides.iter().find(|o| o.stage == fault.section && is_well_without(o, specimen, overrides, seed)) {
            Some(o) => o.is_wrong(format!("--set {}.{}: {more}", o.stage, o.key)),
            None => BuildError::Option(format!("specimen.toml [options.{}]: {more}", fault.section)),
        }
    })?;
    Ok(options)
}

/// Refuses an option of another stage than those that a command has a use for: nothing would hear it.
///
/// # Errors
/// The first such option.
pub fn only(overrides: &[Override], stages: &[&str]) -> Result<(), BuildError> {
    overrides.iter().find(|o| !stages.contains(&o.stage.as_str())).map_or(Ok(()), |o| {
        let takes: Vec<String> = stages.iter().map(|s| format!("{s}.key=value")).collect();
        Err(o.is_wrong(format!(
            "--set {}.{}: nothing here is of the stage {}; this command takes {}, a build takes all (build-model build SPECIMEN --set ...)",
            o.stage, o.key, o.stage, takes.join(" and ")
        )))
    })
}

/// Refuses an option that the command at hand does not hear, with the reason.
///
/// # Errors
/// Where it is among them.
pub fn deaf(overrides: &[Override], stage: &str, key: &str, why: &str) -> Result<(), BuildError> {
    match overrides.iter().find(|o| o.stage == stage && o.key == key) {
        Some(o) => Err(o.is_wrong(format!("--set {stage}.{key}: {why}"))),
        None => Ok(()),
    }
}

/// Whether the section of an override is as it should be once that one is left out. That one by its place: a NaN is no NaN's equal.
fn is_well_without(o: &Override, specimen: &BTreeMap<String, Table>, all: &[Override], seed: Option<u64>) -> bool {
    let others: Vec<Override> = all.iter().filter(|x| !std::ptr::eq(*x, o)).cloned().collect();
    let Ok(options) = typed(specimen, &others, seed) else { return false };
    let Ok(table) = Table::try_from(&options) else { return false };
    ranges::check(&options, &table).map_or_else(|fault| fault.section != o.stage, |()| true)
}

/// The options in force, their names known and of the right type.
pub(crate) fn typed(
    specimen: &BTreeMap<String, Table>,
    overrides: &[Override],
    seed: Option<u64>,
) -> Result<BuildOptions, BuildError> {
    let wrong = BuildError::Option;
    let mut table = Table::try_from(BuildOptions::default()).map_err(|e| wrong(e.to_string()))?;
    if let Some(seed) = seed {
        for stage in table.iter_mut().filter_map(|(_, v)| v.as_table_mut()).filter(|t| t.contains_key("seed")) {
            let told = || wrong(format!("--seed is {seed}, expected at most {}", i64::MAX));
            stage.insert("seed".into(), Value::Integer(i64::try_from(seed).map_err(|_| told())?));
        }
    }
    let from_file = specimen
        .iter()
        .flat_map(|(stage, t)| t.iter().map(move |(k, v)| (stage.as_str(), k, v, "specimen.toml [options]")));
    let from_line = overrides.iter().map(|o| (o.stage.as_str(), &o.key, &o.value, "--set"));
    for (stage, key, value, place) in from_file.chain(from_line) {
        let wrong = |told: String| BuildError::Setting {
            key: format!("{stage}.{key}"),
            value: value.to_string(),
            on_line: place == "--set",
            told,
        };
        let known: Vec<String> = table.keys().cloned().collect();
        let Some(Value::Table(options)) = table.get_mut(stage) else {
            let near = did_you_mean(stage, &known);
            return Err(wrong(format!("{place}: no stage {stage}{near}; expected one of {}", known.join(", "))));
        };
        let keys = known_keys(options);
        place_at(options, key, value);
        check(stage, options).map_err(|e| {
            let near = nearest(key, &keys);
            let more = match (keys.iter().any(|k| k == key), near) {
                (true, _) if matches!(value, Value::String(s) if s.is_empty()) => {
                    format!("; no value stands after the =; see build-model options {stage}")
                }
                (true, _) => format!("; see build-model options {stage}"),
                (false, near) => {
                    let near = near.map(|n| format!("; did you mean {n}?")).unwrap_or_default();
                    match keys.len() <= MOST_LISTED {
                        true => format!("{near}; known: {}", keys.join(", ")),
                        false => format!("{near}; all {} are told by build-model options {stage}", keys.len()),
                    }
                }
            };
            wrong(format!("{place} {stage}.{key}: {e}{more}"))
        })?;
    }
    table.try_into().map_err(|e: toml::de::Error| wrong(e.message().to_string()))
}

/// Keys of a stage that a message lists; of more it says where they are told.
const MOST_LISTED: usize = 16;

/// Puts a value at a key, which may lead into tables by dots; a table is merged with the one there.
fn place_at(options: &mut Table, key: &str, value: &Value) {
    if let Some((first, rest)) = key.split_once('.').filter(|_| !options.contains_key(key))
        && let Some(Value::Table(inner)) = options.get_mut(first)
    {
        return place_at(inner, rest, value);
    }
    match (options.get_mut(key), value) {
        (Some(Value::Table(old)), Value::Table(new)) => new.iter().for_each(|(k, v)| place_at(old, k, v)),
        (old, _) => {
            let new = like(old.as_deref(), value);
            options.insert(key.to_owned(), new);
        }
    }
}

/// An integer given where the default is a float is that float.
fn like(default: Option<&Value>, value: &Value) -> Value {
    match (default, value) {
        (Some(Value::Float(_)), Value::Integer(i)) => Value::Float(*i as f64),
        (Some(Value::Array(old)), Value::Array(new)) => {
            Value::Array(new.iter().enumerate().map(|(i, v)| like(old.get(i).or(old.first()), v)).collect())
        }
        _ => value.clone(),
    }
}

/// The keys of a stage's options, those in tables by their paths.
fn known_keys(options: &Table) -> Vec<String> {
    let inner = |(key, value): (&String, &Value)| match value {
        Value::Table(t) if !t.is_empty() => known_keys(t).iter().map(|k| format!("{key}.{k}")).collect(),
        _ => vec![key.clone()],
    };
    options.iter().flat_map(inner).collect()
}

/// What the options' types refuse, without the parser's list of fields: the caller lists the keys.
fn check(stage: &str, options: &Table) -> Result<(), String> {
    let one: Table = [(stage.to_string(), Value::Table(options.clone()))].into_iter().collect();
    one.try_into::<BuildOptions>().map(|_| ()).map_err(|e| {
        let message = e.message().to_string();
        message
            .split_once(", expected one of")
            .filter(|_| message.starts_with("unknown field"))
            .map_or_else(|| in_words(&message), |(first, _)| first.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_win_and_unknown_names_are_named() {
        let set = |s: &str| parse_override(s).unwrap();
        let options =
            resolve(&BTreeMap::new(), &[set("assemble.friction=0"), set("assemble.law=tabular")], None).unwrap();
        assert!(options.assemble.friction.abs() < f64::EPSILON);
        assert_eq!(options.assemble.law, sim::spec::Law::Tabular);
        let line = [
            set("calibrate.inference.starts=3"),
            set("calibrate.ranges={X3 = [0.8, 1]}"),
            set("validate.ap_flexions_deg=[20]"),
        ];
        let options = resolve(&BTreeMap::new(), &line, Some(5)).unwrap();
        assert_eq!((options.calibrate.inference.starts, options.calibrate.seed), (3, 5));
        assert_eq!(options.calibrate.ranges["X3"], [0.8, 1.0]);
        assert_eq!(options.validate.ap_flexions_deg, [20.0]);
        for (text, named) in [
            ("calibrate.inference.strts=1", "strts"),
            ("assemble.frction=1", "frction"),
            ("asemble.friction=1", "asemble"),
            ("assemble.friction=\"a\"", "friction"),
            ("calibrate.samples=", "did you mean gradient.samples?"),
            ("calibrate.seed=", "no value stands after the ="),
        ] {
            let error = resolve(&BTreeMap::new(), &[set(text)], None).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }

    /// Options whose ends another option moves: what is set beside them at the lower end, and at the upper.
    const BESIDE: [(&str, &str, &str); 11] = [
        ("ingest.least_width_mm", "", "ingest.greatest_width_mm=1e4"),
        ("ingest.greatest_width_mm", "ingest.least_width_mm=1", ""),
        ("hexmesh.min_thickness_mm", "", "hexmesh.max_thickness_mm=1e12"),
        ("hexmesh.max_thickness_mm", "hexmesh.min_thickness_mm=0", ""),
        ("contact-law.force_n", "contact-law.least_force_n=1", ""),
        ("contact-law.least_force_n", "", "contact-law.force_n=5e3"),
        ("calibrate.swarm.particles", "", "calibrate.swarm.swarm_evaluations=1000000000000"),
        ("calibrate.swarm.swarm_evaluations", "calibrate.swarm.particles=2", ""),
        ("calibrate.gradient.samples", "calibrate.method=swarm-simplex", "calibrate.method=swarm-simplex"),
        ("validate.from_flexion_deg", "", "validate.to_flexion_deg=160"),
        ("validate.to_flexion_deg", "validate.from_flexion_deg=-30", ""),
    ];

    /// Lists whose numbers rise.
    const RISING: [&str; 3] = ["contact-law.overclosure_mm", "assemble.overclosure_mm", "assemble.pressure_mpa"];

    /// An option set to a number; of a list all its numbers, of one that rises the first where it is 0 or less, else the last.
    fn set_to(key: &str, default: &Value, number: f64) -> Override {
        let one = |like: &Value, x: f64| match like {
            Value::Integer(_) => Value::Integer(x as i64),
            _ => Value::Float(x),
        };
        let of_list = |k: usize, many: usize| match (RISING.contains(&key), number > 0.0) {
            (false, _) => number,
            (true, false) => number + k as f64,
            (true, true) => number * k as f64 / (many - 1) as f64,
        };
        let value = match default {
            Value::Array(all) => {
                Value::Array(all.iter().enumerate().map(|(k, v)| one(v, of_list(k, all.len()))).collect())
            }
            other => one(other, number),
        };
        let (stage, key) = key.split_once('.').unwrap();
        Override { stage: stage.into(), key: key.into(), value }
    }

    /// Whether an option may be a number beside what is set for it.
    fn is_taken(o: &crate::option_docs::OptionDoc, number: f64, beside: &str) -> bool {
        let default =
            format!("x = {}", o.default).parse::<Table>().map_or(Value::Float(0.0), |mut t| t.remove("x").unwrap());
        let beside = Some(beside).filter(|b| !b.is_empty()).map(|b| parse_override(b).unwrap());
        let all: Vec<Override> = beside.into_iter().chain([set_to(&o.key, &default, number)]).collect();
        resolve(&BTreeMap::new(), &all, None).is_ok()
    }

    /// Every number in turn: both ends of its range are taken, what is next to them outside is refused. No option is let off.
    #[test]
    fn the_range_that_is_told_is_the_range_that_is_taken() {
        let all = crate::option_docs::all().unwrap();
        let (mut faults, mut walked) = (Vec::new(), 0);
        for o in &all {
            let Some([least, most]) = o.range else { continue };
            let (_, at_least, at_most) = BESIDE.iter().find(|b| b.0 == o.key).unwrap_or(&("", "", ""));
            let whole = o.value.is_i64() || o.value.as_array().is_some_and(|a| a.iter().any(serde_json::Value::is_i64));
            // far enough outside that a whole number is another one
            let step = |x: f64| if whole { 1.0 } else { 1e-6 * x.abs().max(1e-9) };
            let ends = [(least, least - step(least), at_least), (most, most + step(most), at_most)];
            for (end, outside, beside) in ends {
                // next to the largest seeds there is no other number of so many digits
                let beyond = outside.abs() < 1e18 && is_taken(o, outside, beside);
                if beyond || !is_taken(o, end, beside) {
                    let how = if beyond { "takes more" } else { "refuses its end" };
                    faults.push(format!("{}: told {least:e} to {most:e}; {how} at {end:e}", o.key));
                }
                walked += 1;
            }
        }
        assert!(faults.is_empty(), "{}", faults.join("\n"));
        assert_eq!(walked, 2 * all.iter().filter(|o| o.range.is_some()).count());
        let mut keys = BESIDE.iter().map(|b| b.0).chain(RISING);
        assert!(keys.all(|key| all.iter().any(|o| o.key == key && o.range.is_some())));
    }

    #[test]
    fn a_range_reads_as_it_is_meant() {
        let told = [
            ([0.0, 10.0], "0 to 10"),
            ([held::ABOVE_0, 1.0], "above 0 to 1"),
            ([0.0, held::BELOW_1], "0 to below 1"),
            ([held::ABOVE_0, 1e12], "above 0"),
            ([0.2, 1e12], "0.2 or more"),
            ([-1e12, 1e12], "any number"),
            ([1e-9, 0.1], "1e-9 to 0.1"),
            ([1.0_f64.next_up(), 1e4], "above 1 to 10000"),
            ([0.0, 1e12_f64.next_down()], "0 or more"),
        ];
        for (range, words) in told {
            assert_eq!(range_words(range), words);
        }
    }

    #[test]
    fn a_value_out_of_its_range_is_refused_in_every_section() {
        for (text, expected) in [
            ("segment.neck_share=0", "above 0"),
            ("ingest.label_blur=-1", "0 to 10"),
            ("ingest.ras=[\"mri\"]", "any of"),
            ("register.held_out_of=1", "2 to 1000"),
            ("bones.edge_mm=0.1", "0.2 mm or more"),
            ("cartilage.cleft_mm=nan", "0 to 20"),
            ("frames.given_limits=[12, -1]", "not negative"),
            ("attachments.mark_reach_mm=inf", "finite"),
            ("hexmesh.edge_length_mm=-1", "not negative"),
            ("hexmesh.layers=11", "1 to 10"),
            ("overclosure.momentum=1", "0 to 1"),
            ("contact-law.force_n=5", "10 to 5000"),
            ("assemble.pressure_mpa=[0, 1]", "equally long"),
            ("calibrate.inference.finalists=0", "at least 1"),
            ("calibrate.gradient.interval=1", "between 0 and 1"),
            ("validate.ap_rows=0", "1 to 10000"),
            ("validate.trials.load_s=-0.1", "not negative"),
            ("diagnose.folds=1", "2 to 100"),
        ] {
            let (_, key) = text.split_once('.').unwrap();
            let key = key.split('=').next().unwrap();
            let error = resolve(&BTreeMap::new(), &[parse_override(text).unwrap()], None).unwrap_err();
            assert_eq!(error.exit_status(), 2, "{error}");
            let error = error.to_string();
            assert!(error.contains(&format!(".{key}")) && error.contains(expected), "{text}: {error}");
        }
        let far: Table = "edge_mm = 0.1".parse().unwrap();
        let error = resolve(&BTreeMap::from([("bones".to_owned(), far)]), &[], None).unwrap_err();
        assert!(error.exit_status() == 1 && error.to_string().starts_with("specimen.toml [options.bones]"), "{error}");
        assert_eq!(resolve(&BTreeMap::new(), &[], Some(u64::MAX >> 1)).unwrap().calibrate.seed, u64::MAX >> 1);
    }
}
