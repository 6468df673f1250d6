//! Where results may go: into a folder of their own, not among what is read.

use crate::error::BuildError;
use crate::stage::list::{folder_name, names};
use crate::store;
use crate::store::written::Rule;
use crate::suggested::quoted;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Verbs whose results belong to a build.
const INTO_A_BUILD: [&str; 3] = ["build", "check", "credibility"];

/// Verbs that write over nothing at `--out` but what they wrote there and nobody changed since. An export sees to its own files, a build to its
/// stages.
pub(crate) const KEEPS_EDITS: [&str; 11] = [
    "calibrate",
    "cohort",
    "credibility",
    "diagnose",
    "import-abaqus",
    "import-febio",
    "import-opensim",
    "next-tests",
    "plan",
    "simulate",
    "validate",
];

/// The id of `--force` where a verb has none of its own.
pub(crate) const FORCE: &str = "write_over";

/// The folder of `--out`, and what the verb reads.
#[derive(Clone, Debug, Default)]
pub(crate) struct OutFolder {
    verb: String,
    out: Option<PathBuf>,
    /// The file of `--out`, of a verb that writes one.
    file: Option<PathBuf>,
    /// Whether `--out` is named on the line; else it is where results usually go.
    is_named: bool,
    force: bool,
    /// Folders that are named, and those of models that are named.
    inputs: Vec<PathBuf>,
}

impl OutFolder {
    /// Of a command line that clap has read.
    pub(crate) fn of(command: &Command, matches: &ArgMatches) -> OutFolder {
        if let Some((name, inner)) = matches.subcommand() {
            let Some(verb) = command.find_subcommand(name) else { return OutFolder::default() };
            let within = OutFolder::of(verb, inner);
            return if within.verb.is_empty() { OutFolder { verb: name.to_owned(), ..within } } else { within };
        }
        let values = |arg: &Arg| {
            let raw = matches.try_get_raw(arg.get_id().as_str()).ok().flatten();
            raw.into_iter().flatten().map(OsStr::to_owned).collect::<Vec<_>>()
        };
        let (outs, others): (Vec<&Arg>, Vec<&Arg>) = command.get_arguments().partition(|a| a.get_long() == Some("out"));
        let out = |folder: bool| outs.iter().filter(|a| is_folder(a) == folder).flat_map(|a| values(a)).next();
        let is_named = |a: &&Arg| matches.value_source(a.get_id().as_str()) == Some(ValueSource::CommandLine);
        OutFolder {
            verb: String::new(),
            out: out(true).map(PathBuf::from),
            file: out(false).map(PathBuf::from),
            is_named: outs.iter().any(is_named),
            force: is_set(matches, FORCE) || is_set(matches, "force"),
            // a word such as that of --source is no folder, though one may be called so
            inputs: others
                .into_iter()
                .filter(|a| a.is_positional())
                .flat_map(values)
                .filter_map(|t| input(&t))
                .collect(),
        }
    }

    /// Refuses a folder of a specimen, of a stage, of what is read; that of a build where the verb's results do not belong there.
    ///
    /// Errors: [`BuildError::Usage`], with the folder and another.
    pub(crate) fn checked(&self) -> Result<(), BuildError> {
        let Some(out) = &self.out else { return Ok(()) };
        let Ok(place) = store::absolute(out) else { return Ok(()) };
        let belongs = self.verb.is_empty() || INTO_A_BUILD.contains(&self.verb.as_str());
        let is_input = || self.inputs.iter().any(|i| store::absolute(i).is_ok_and(|i| i == place));
        let what = if store::exists(&place.join("specimen.toml")) {
            "the folder of a specimen (it holds specimen.toml)"
        } else if is_of_a_stage(&place) {
            "the folder of a stage, which the build keeps"
        } else if !belongs && store::exists(&place.join("log.jsonl")) {
            "the folder of a build (it holds log.jsonl)"
        } else if !belongs && is_input() {
            "a folder that is read"
        } else {
            return Ok(());
        };
        let other = quoted(&out.join(if self.verb.is_empty() { "build" } else { &self.verb }));
        Err(BuildError::Usage(format!(
            "--out {} is {what}; expected a folder of its own for what is written, such as --out {other}",
            quoted(out)
        )))
    }

    /// What may be written over at `--out`; `None` of a verb that sees to it itself, or has no results.
    pub(crate) fn rule(&self) -> Option<Rule> {
        if !KEEPS_EDITS.contains(&self.verb.as_str()) {
            return None;
        }
        let of = |path: &Option<PathBuf>, folder: bool| path.as_deref().map(|p| Rule::of(p, folder, self.force));
        of(&self.out, true).or_else(|| of(&self.file, false))
    }

    /// The same, after a look at results that are there: a long search is not begun for what cannot be kept.
    ///
    /// Errors: a result that was edited; a model that is not known as a result, where the verb leaves one.
    pub(crate) fn kept(&self) -> Result<Option<Rule>, BuildError> {
        let rule = self.rule();
        if let Some(rule) = rule.as_ref().filter(|_| self.is_named) {
            rule.unedited()?;
            if LEAVES_A_MODEL.contains(&self.verb.as_str()) {
                rule.may_write(MODEL)?;
            }
        }
        Ok(rule)
    }
}

/// Whether a flag is there and set.
pub(crate) fn is_set(matches: &ArgMatches, id: &str) -> bool {
    matches.try_get_one::<bool>(id).ok().flatten().copied().unwrap_or(false)
}

/// Verbs that leave a model in the folder of `--out`, whatever they find.
const LEAVES_A_MODEL: [&str; 4] = ["calibrate", "import-abaqus", "import-febio", "import-opensim"];

/// Its name.
const MODEL: &str = "model.json";

/// Whether an argument is a folder: files have a name with an ending.
fn is_folder(arg: &Arg) -> bool {
    !arg.get_value_names().unwrap_or_default().iter().any(|n| n.contains('.'))
}

/// The folder that an argument means, PATH or NAME=PATH: itself, or that of a model; none of other files and words.
fn input(text: &OsStr) -> Option<PathBuf> {
    let text = text.to_string_lossy();
    let named = text.split_once('=').map(|(_, path)| path);
    std::iter::once(text.as_ref()).chain(named).map(Path::new).find_map(|path| {
        if store::is_folder(path) {
            return Some(path.to_path_buf());
        }
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let is_model = path.file_name().is_some_and(|n| n == "model.json") && store::exists(path);
        is_model.then(|| parent.to_path_buf())
    })
}

/// Whether a folder is that of a stage, or lies in one.
fn is_of_a_stage(place: &Path) -> bool {
    let stages = names().map(folder_name);
    let is_stage = |p: &Path| p.file_name().is_some_and(|n| stages.iter().any(|s| n == s.as_str()));
    let in_build = |p: &Path| p.parent().is_some_and(|build| store::exists(&build.join("log.jsonl")));
    place.ancestors().any(|p| is_stage(p) && in_build(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::command;

    /// The error of a command line, or nothing.
    fn told(words: &[&str]) -> Option<String> {
        let all = command();
        let matches = all.clone().try_get_matches_from([&["build-model"], words].concat()).unwrap();
        OutFolder::of(&all, &matches).checked().err().map(|e| e.to_string())
    }

    /// Words that every verb with a folder for results takes, without it; `KNEE` stands for a folder.
    const VERBS: [&[&str]; 13] = [
        &["build", "KNEE"],
        &["check", "KNEE"],
        &["export", "KNEE", "--format", "stl"],
        &["calibrate", "KNEE", "--targets", "kla=kla.csv"],
        &["validate", "kla=KNEE"],
        &["diagnose", "KNEE", "--measured", "kla=kla.csv"],
        &["plan", "KNEE", "graft.toml"],
        &["credibility", "KNEE"],
        &["cohort", "KNEE"],
        &["import-abaqus", "a.inp"],
        &["import-opensim", "a.osim"],
        &["import-febio", "a.feb"],
        &["man"],
    ];

    #[test]
    fn no_verb_writes_into_a_specimen_and_only_those_of_a_build_into_one() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name).display().to_string();
        let (knee, build, stage) = (place("knee"), place("knee/build"), place("knee/build/10-calibrate/joint"));
        store::make_folder(Path::new(&stage)).unwrap();
        store::write(Path::new(&place("knee/specimen.toml")), b"").unwrap();
        store::write(Path::new(&place("knee/build/log.jsonl")), b"").unwrap();
        for verb in VERBS {
            let with = |out: &str| {
                let words: Vec<String> = verb.iter().map(|w| w.replace("KNEE", &knee)).collect();
                let words: Vec<&str> = words.iter().map(String::as_str).chain(["--out", out]).collect();
                told(&words)
            };
            assert!(with(&knee).unwrap().contains("holds specimen.toml"), "{verb:?}");
            assert!(with(&stage).unwrap().contains("the folder of a stage"), "{verb:?}");
            assert_eq!(with(&build).is_none(), INTO_A_BUILD.contains(&verb[0]), "{verb:?}");
            assert_eq!(with(&place("knee/own")), None, "{verb:?}");
        }
        assert!(told(&[&knee, "--out", &knee]).unwrap().contains("holds specimen.toml"));
        assert_eq!(told(&[&knee, "--out", &build]), None);
    }

    #[test]
    fn no_other_verb_has_a_folder_for_results() {
        let all = command();
        let has = |verb: &&Command| verb.get_arguments().any(|a| a.get_long() == Some("out") && is_folder(a));
        let mut found: Vec<&str> = all.get_subcommands().filter(has).map(Command::get_name).collect();
        let mut known = VERBS.map(|v| v[0]).to_vec();
        found.sort_unstable();
        known.sort_unstable();
        assert_eq!(found, known);
    }

    #[test]
    fn verbs_with_results_keep_edits_and_force_is_heard() {
        let of = |words: &[&str]| {
            let all = command();
            let matches = all.clone().try_get_matches_from([&["build-model"], words].concat()).unwrap();
            OutFolder::of(&all, &matches).rule()
        };
        let others = ["build", "check", "export", "man"]; // stages, an own page, own digests, pages of the program
        for verb in VERBS {
            let rule = |more: &[&str]| of(&[verb, &["--out", "results"], more].concat());
            assert_eq!(rule(&[]).is_none(), others.contains(&verb[0]), "{verb:?}");
            if rule(&[]).is_some() {
                assert_eq!(rule(&["--force"]), Some(Rule::of(Path::new("results"), true, true)), "{verb:?}");
            }
        }
        for verb in [&["simulate", "KNEE", "--protocol", "pivot-shift"][..], &["next-tests", "KNEE", "--for", "ACL"]] {
            let rule = |more: &[&str]| of(&[verb, &["--out", "a.csv"], more].concat());
            assert_eq!(rule(&[]), Some(Rule::of(Path::new("a.csv"), false, false)), "{verb:?}");
            assert_eq!(rule(&["--force"]), Some(Rule::of(Path::new("a.csv"), false, true)), "{verb:?}");
        }
        assert_eq!(of(&["credibility", "KNEE"]), None, "the build's own page");
    }

    #[test]
    fn no_search_begins_for_a_model_that_could_not_be_kept() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().display().to_string();
        store::write(&folder.path().join("model.json"), b"{}").unwrap();
        let all = command();
        for verb in VERBS.iter().filter(|v| LEAVES_A_MODEL.contains(&v[0])) {
            let of = |more: &[&str]| {
                let words = [&["build-model"], *verb, &["--out", &out], more].concat();
                OutFolder::of(&all, &all.clone().try_get_matches_from(words).unwrap()).kept()
            };
            assert!(of(&[]).unwrap_err().to_string().contains("--force"), "{verb:?}");
            assert!(of(&["--force"]).is_ok(), "{verb:?}");
        }
    }

    #[test]
    fn a_model_is_not_written_over_and_files_may_lie_beside_their_results() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().display().to_string();
        let model = folder.path().join("model.json").display().to_string();
        store::write(Path::new(&model), b"{}").unwrap();
        for words in [
            &["calibrate", &model, "--targets", "kla=kla.csv"][..],
            &["validate", &own],
            &["validate", &format!("a={model}")],
        ] {
            let error = told(&[words, &["--out", &own]].concat()).unwrap();
            assert!(error.contains("a folder that is read") && error.contains(words[0]), "{error}");
        }
        let deck = folder.path().join("deck.inp").display().to_string();
        store::write(Path::new(&deck), b"").unwrap();
        assert_eq!(told(&["import-abaqus", &deck, "--out", &own]), None);
        // a data set that is called as the folder is none that is read
        let of_set = ["calibrate", "KNEE", "--source", &own, "--targets", "kla=kla.csv", "--out", &own];
        assert_eq!(told(&of_set), None, "the model.json there is not the one that is named");
        // a file for results is no folder
        assert_eq!(told(&["simulate", &own, "--protocol", "pivot-shift", "--out", &own]), None);
    }
}
