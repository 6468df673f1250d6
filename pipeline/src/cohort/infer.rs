//! `cohort infer`: what the calibrations of a laboratory's knees say of each other's ligaments, as a prior for each.

use super::names;
use super::table::{Column, Table};
use crate::error::BuildError;
use crate::options::{BuildOptions, parse_override};
use crate::record::json;
use crate::store;
use crate::suggested::{command, command_on};
use crate::told::Told;
use crate::which_model::{WhichModel, chosen};
use calibration::evidence::population::Shares;
use calibration::evidence::{Evidence, Found, priors};
use calibration::samples::Samples;
use calibration::shared::{Shared, SharedNumber, Sort};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use toml::Value;

/// `cohort infer --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InferTold {
    /// cohort-infer/1
    pub schema: &'static str,
    /// Every knee, in the order given.
    pub knees: Vec<InferKneeTold>,
    /// The prior for a knee that is not among them.
    pub for_another: PriorTold,
    /// Numbers, and how many knees' data say anything of each.
    pub informed: BTreeMap<String, usize>,
    /// The files that were written.
    pub files: Vec<String>,
}

impl InferTold {
    /// Its version.
    pub const SCHEMA: &'static str = "cohort-infer/1";
}

/// What the others say of a knee.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InferKneeTold {
    /// Its name in the cohort.
    pub knee: String,
    /// Its id and side.
    pub specimen: String,
    /// The model that its samples are of.
    pub model: String,
    /// Numbers of which its own data say anything.
    pub informed: usize,
    /// What the others say of it.
    pub prior: PriorTold,
    /// The command that builds it with that prior, beside the build that was read; null where its specimen does not lie around that build.
    pub next: Option<String>,
}

/// A shared prior.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PriorTold {
    /// Its file.
    pub file: String,
    /// Share of the variance that knees have in common, by sort of numbers, as the others have it [-].
    pub shares: BTreeMap<&'static str, f64>,
    /// What it holds.
    pub numbers: Vec<SharedNumber>,
}

/// A calibrated knee of a cohort.
struct Calibrated {
    name: String,
    build: PathBuf,
    model: PathBuf,
    options: BuildOptions,
    evidence: Evidence,
}

/// Reads the samples of every calibration, writes what the others say of each knee, and gives the words to print.
///
/// # Errors
/// One knee alone; a knee that is not calibrated, with other options than the first, or with data of other knees in it; a knee given twice;
/// files that cannot be written.
pub(super) fn infer(builds: &[PathBuf], out: &Path) -> Result<Told, BuildError> {
    if builds.len() < 2 {
        return Err(BuildError::Usage(format!(
            "cohort infer: {} given, expected two or more calibrated knees, each with the others' help; a knee alone has nobody to learn from",
            if builds.is_empty() { "no build" } else { "one build" }
        )));
    }
    let mut knees: Vec<Calibrated> =
        names(builds).into_iter().zip(builds).map(|(n, b)| Calibrated::read(n, b)).collect::<Result<_, _>>()?;
    alike(&knees)?;
    told_apart(&mut knees);
    let evidence: Vec<Evidence> = knees.iter().map(|k| k.evidence.clone()).collect();
    let found = priors(&evidence);
    let out = store::make_folder(out)?;
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for (k, prior) in found.priors.iter().enumerate() {
        files.push((file_of(knees.get(k)), json(prior)));
    }
    files.extend(table(&knees, &found).files()?);
    store::write_all(&out, &files)?;
    let data = as_data(&knees, &found, &files, &out);
    Ok(Told::words(words(&knees, &data)).with(&data))
}

/// The file of a knee's prior; of none, of that for another knee.
fn file_of(knee: Option<&Calibrated>) -> String {
    knee.map_or("shared_prior.json".into(), |k| format!("shared_prior_{}.json", k.name.replace('/', "_")))
}

impl Calibrated {
    fn read(name: String, place: &Path) -> Result<Calibrated, BuildError> {
        let model = store::absolute(&chosen(place, &WhichModel::default())?)?;
        let (file, of_build) = (model.with_file_name("samples.json"), model.ancestors().nth(3));
        let build = of_build.map(Path::to_path_buf).unwrap_or_default();
        let fault = |what: String| BuildError::of_file(place, format!("{}: {what}", place.display()));
        if !store::exists(&file) || !store::exists(&build.join("run.toml")) {
            return Err(fault(format!(
                "no build with samples of a calibration (10-calibrate, method posterior); it needs measured laxity: {}",
                command_on("build", place)
            )));
        }
        let samples: Samples = serde_json::from_slice(&store::read(&file)?)
            .map_err(|e| BuildError::in_file(&file, format!("{e}; build it again: {}", command_on("build", place))))?;
        let run: toml::Table = store::read_text(&build.join("run.toml"))?.parse().unwrap_or_default();
        let options: Option<BuildOptions> = run.get("options").and_then(|o| o.clone().try_into().ok());
        let Some(options) = options else {
            let again = command_on("build", place);
            return Err(fault(format!("its run.toml has no options of this version; build it again: {again}")));
        };
        let evidence = Evidence::of(&samples, &options.calibrate).map_err(|e| fault(e.to_string()))?;
        // a model.json has no folder of its own to be called by
        let name = if store::is_folder(place) { name } else { samples.counted_from.id };
        Ok(Calibrated { name, build, model, options, evidence })
    }

    /// Its specimen's folder, where it lies around the build.
    fn specimen(&self) -> Option<&Path> {
        self.build.parent().filter(|p| store::exists(&p.join("specimen.toml")))
    }

    /// The command that builds it with this prior and the options that it had, beside the build that was read: that one stays what its data alone
    /// say.
    fn next_command(&self, prior: &Path) -> Option<String> {
        let specimen = self.specimen()?;
        let out = specimen.join("build-shared");
        let set = format!("calibrate.shared_prior={}", prior.display());
        let mut words = vec![specimen.as_os_str(), OsStr::new("--out"), out.as_os_str()];
        let own = set_again(&self.options);
        words.extend(own.iter().chain([&set]).flat_map(|set| [OsStr::new("--set"), OsStr::new(set)]));
        Some(command("build", words))
    }
}

/// Gives knees that are called the same names of their own: id and side. Folders are told apart already; a model.json is called by its id alone.
fn told_apart(knees: &mut [Calibrated]) {
    let names: Vec<String> = knees.iter().map(|k| k.name.clone()).collect();
    for k in knees.iter_mut().filter(|k| names.iter().filter(|n| **n == k.name).count() > 1) {
        k.name = k.evidence.knee.replace(' ', "_");
    }
}

/// Every option that is not as the program has it by itself, as `--set` takes it: `stage.key=value`.
fn set_again(options: &BuildOptions) -> Vec<String> {
    let table = |of: &BuildOptions| toml::Table::try_from(of).unwrap_or_default();
    let mut out = Vec::new();
    unusual("", &table(options), &table(&BuildOptions::default()), &mut out);
    out
}

/// The same of a table of options, whose keys begin with `path`. What is no table in both stands whole.
fn unusual(path: &str, own: &toml::Table, usual: &toml::Table, out: &mut Vec<String>) {
    for (key, value) in own {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match (value, usual.get(key)) {
            (Value::Table(own), Some(Value::Table(usual))) => unusual(&path, own, usual, out),
            (own, usual) if usual != Some(own) => out.push(as_set(&path, own)),
            _ => {}
        }
    }
}

/// An option as `--set` takes it; a word goes without quotes where that means the same.
fn as_set(key: &str, value: &Value) -> String {
    let whole = format!("{key}={value}");
    let bare = value.as_str().map(|word| format!("{key}={word}"));
    bare.filter(|bare| parse_override(bare) == parse_override(&whole)).unwrap_or(whole)
}

/// Refuses knees that were assembled or calibrated otherwise than the first, and knees that have one name: the data of one knee would count twice.
fn alike(knees: &[Calibrated]) -> Result<(), BuildError> {
    for (n, k) in knees.iter().enumerate() {
        let fault = |what: String| BuildError::of_file(&k.build, format!("{}: {what}", k.build.display()));
        if let Some(other) = knees[..n].iter().find(|o| o.evidence.knee == k.evidence.knee) {
            return Err(fault(format!(
                "it is of {}, and so is {}; expected each knee once, so give each an id of its own (specimen.toml [specimen] id)",
                k.evidence.knee,
                other.build.display()
            )));
        }
        if let Some((key, [here, there])) = differing(&knees[0].options, &k.options) {
            return Err(fault(format!(
                "{key} is {there}, and {here} in {}; expected the same options of all knees; build one again: {} --set {key}=...",
                knees[0].build.display(),
                command_on("build", k.specimen().unwrap_or(&k.build))
            )));
        }
    }
    Ok(())
}

/// Stages whose options decide what the numbers that knees share mean: a scale of contact is counted from friction and the law of contact.
const DECIDING: [&str; 2] = ["assemble", "calibrate"];
/// The stage that decides the law of contact where it runs.
const OF_LAW: &str = "contact-law";

/// The first option that differs, with both values; a seed may.
fn differing(a: &BuildOptions, b: &BuildOptions) -> Option<(String, [String; 2])> {
    let is_fitted = a.contact_law.fit || b.contact_law.fit;
    let decides = |stage: &str| DECIDING.contains(&stage) || (is_fitted && stage == OF_LAW);
    let leaves = |o: &BuildOptions| {
        let (mut o, mut out) = (o.clone(), BTreeMap::new());
        o.calibrate.seed = 0;
        if let Ok(table) = toml::Table::try_from(o) {
            table.iter().filter(|(stage, _)| decides(stage)).for_each(|(k, v)| gather(k, v, &mut out));
        }
        out
    };
    let (a, b) = (leaves(a), leaves(b));
    let of = |all: &BTreeMap<String, String>, key: &String| all.get(key).cloned().unwrap_or_else(|| "none".into());
    let key = a.keys().chain(b.keys()).find(|k| a.get(*k) != b.get(*k))?;
    Some((key.clone(), [of(&a, key), of(&b, key)]))
}

/// Every value of a table by its path.
fn gather(key: &str, value: &Value, out: &mut BTreeMap<String, String>) {
    match value {
        Value::Table(t) => t.iter().for_each(|(k, v)| gather(&format!("{key}.{k}"), v, out)),
        other => {
            out.insert(key.to_owned(), other.to_string());
        }
    }
}

/// The rows of infer.csv: a number of a knee's prior each.
fn table(knees: &[Calibrated], found: &Found) -> Table {
    let name = |k: usize| knees.get(k).map(|k| k.name.clone()).unwrap_or_default();
    let rows: Vec<(usize, &SharedNumber)> =
        found.priors.iter().enumerate().flat_map(|(k, p)| p.numbers.iter().map(move |n| (k, n))).collect();
    let informed = |k: usize, n: &SharedNumber| found.informed[k].iter().find(|i| i.0 == n.name).map_or(0, |i| i.1);
    let text =
        |of: &dyn Fn(usize, &SharedNumber) -> String| Column::Text(rows.iter().map(|(k, n)| of(*k, n)).collect());
    let number = |of: &dyn Fn(&SharedNumber) -> f64| Column::Number(rows.iter().map(|(_, n)| Some(of(n))).collect());
    let informed_by = rows.iter().map(|(k, n)| Some(informed(*k, n) as f64)).collect();
    Table {
        name: "infer",
        columns: vec![
            ("knee", text(&|k, _| name(k))),
            ("number", text(&|_, n| n.name.clone())),
            ("informed_by", Column::Number(informed_by)),
            ("mean", number(&|n| n.mean)),
            ("sd", number(&|n| n.sd)),
            ("before_lower", number(&|n| n.before[0])),
            ("before", number(&|n| n.before[1])),
            ("before_upper", number(&|n| n.before[2])),
            ("after_lower", number(&|n| n.after[0])),
            ("after", number(&|n| n.after[1])),
            ("after_upper", number(&|n| n.after[2])),
        ],
    }
}

fn as_data(knees: &[Calibrated], found: &Found, files: &[(String, Vec<u8>)], out: &Path) -> InferTold {
    let shares = |of: &Shares| -> BTreeMap<&'static str, f64> {
        Sort::ALL.into_iter().map(|s| (s.name(), of[s.place()])).collect()
    };
    let prior = |k: usize, of: &Shared| PriorTold {
        file: out.join(file_of(knees.get(k))).display().to_string(),
        shares: shares(&found.shares[k]),
        numbers: of.numbers.clone(),
    };
    let knee = |(k, of): (usize, &Calibrated)| InferKneeTold {
        knee: of.name.clone(),
        specimen: of.evidence.knee.clone(),
        model: of.model.display().to_string(),
        informed: of.evidence.informed(),
        prior: prior(k, &found.priors[k]),
        next: of.next_command(&out.join(file_of(Some(of)))),
    };
    InferTold {
        schema: InferTold::SCHEMA,
        knees: knees.iter().enumerate().map(knee).collect(),
        for_another: prior(knees.len(), &found.priors[knees.len()]),
        informed: found.informed[knees.len()].iter().cloned().collect(),
        files: files.iter().map(|(name, _)| out.join(name).display().to_string()).collect(),
    }
}

fn words(knees: &[Calibrated], data: &InferTold) -> String {
    let mut text = String::new();
    for k in &data.knees {
        text += &format!(
            "{}: its own data by themselves say something of {} numbers, those of the others together of {}\n",
            k.knee,
            k.informed,
            k.prior.numbers.len()
        );
    }
    let shares: Vec<String> =
        data.for_another.shares.iter().map(|(sort, share)| format!("{sort} {:.0} %", 100.0 * share)).collect();
    text += &format!(
        "What knees have in common of the variance of their priors, as the data have it: {}\n",
        shares.join(", ")
    );
    text += "Next, build each knee with what the others say of it:\n";
    for (k, told) in knees.iter().zip(&data.knees) {
        text += &match &told.next {
            Some(next) => format!("  {next}\n"),
            None => format!("  {}: its specimen, with --set calibrate.shared_prior={}\n", k.name, told.prior.file),
        };
    }
    text + &format!("For a knee that is not among them: --set calibrate.shared_prior={}\n", data.for_another.file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Override, resolve};

    #[test]
    fn the_first_option_that_differs_is_named_and_a_seed_may_differ() {
        let usual = BuildOptions::default();
        let with = |change: &dyn Fn(&mut BuildOptions)| {
            let mut other = usual.clone();
            change(&mut other);
            differing(&usual, &other)
        };
        assert_eq!(with(&|o| o.calibrate.seed = 7), None);
        let (key, values) = with(&|o| o.calibrate.inference.samples = 12).unwrap();
        assert_eq!((key.as_str(), values), ("calibrate.inference.samples", ["48".to_owned(), "12".to_owned()]));
        let (key, [none, one]) = with(&|o| o.calibrate.frames.turn_sd_deg = Some(1.0)).unwrap();
        assert_eq!((key.as_str(), none.as_str(), one.as_str()), ("calibrate.frames.turn_sd_deg", "none", "1.0"));
        let (key, values) = with(&|o| o.assemble.friction = 0.01).unwrap();
        assert_eq!((key.as_str(), values), ("assemble.friction", ["0.03".to_owned(), "0.01".to_owned()]));
        assert_eq!(with(&|o| o.contact_law.fit = true).unwrap().0, "contact-law.fit");
        // what does not act on the numbers that knees share
        assert_eq!(with(&|o| o.bones.edge_mm = 2.0), None);
    }

    #[test]
    fn options_that_are_set_again_are_those_of_the_build() {
        let set = |all: &[&str]| -> BuildOptions {
            let all: Vec<Override> = all.iter().map(|s| parse_override(s).unwrap()).collect();
            resolve(&BTreeMap::new(), &all, None).unwrap()
        };
        assert!(set_again(&BuildOptions::default()).is_empty(), "what is usual is not said");
        let cases: [&[&str]; 6] = [
            &["assemble.patella=on", "assemble.friction=0.01", "calibrate.inference.samples=200"],
            &["calibrate.ranges={X3 = [0.8, 1.0], \"LCL.reference_strain\" = [0.9, 1.1]}"],
            &["calibrate.loads=[{bundles = [\"ACL_AM\"], most_n = 40.0, sd_n = 5.0}]"],
            &["calibrate.priors=none", "calibrate.targets.flexion_deg=[0, 90]", "calibrate.seed=7"],
            &["calibrate.frames.turn_sd_deg=1", "assemble.law=tabular"],
            &["bones.edge_mm=2", "diagnose.run=true", "validate.ap_flexions_deg=[20]"],
        ];
        for case in cases {
            let options = set(case);
            let again = set_again(&options);
            assert!(again.len() >= case.len(), "{case:?}: {again:?}");
            let words: Vec<&str> = again.iter().map(String::as_str).collect();
            assert_eq!(set(&words), options, "{again:?}");
        }
        assert!(set_again(&set(cases[0])).contains(&"assemble.patella=on".to_owned()));
    }
}
