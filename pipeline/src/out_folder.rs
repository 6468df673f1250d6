//! Where results may go: into a folder of their own, not among what is read.

mod leaves;

use crate::error::BuildError;
use crate::stage::list::{folder_name, names};
use crate::store;
use crate::store::written::{Leaves, Rule};
use crate::suggested::quoted;
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
    /// What the verb leaves in the folder.
    leaves: Leaves,
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
            if !within.verb.is_empty() {
                return within;
            }
            return OutFolder { verb: name.to_owned(), leaves: leaves::of(name, inner), ..within };
        }
        let values = |arg: &Arg| {
            let raw = matches.try_get_raw(arg.get_id().as_str()).ok().flatten();
            raw.into_iter().flatten().map(OsStr::to_owned).collect::<Vec<_>>()
        };
        let (outs, others): (Vec<&Arg>, Vec<&Arg>) = command.get_arguments().partition(|a| a.get_long() == Some("out"));
        let out = |folder: bool| outs.iter().filter(|a| is_folder(a) == folder).flat_map(|a| values(a)).next();
        OutFolder {
            verb: String::new(),
            out: out(true).map(PathBuf::from),
            file: out(false).map(PathBuf::from),
            leaves: Leaves::default(),
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

    /// The same, after a look at what is there: a long search is not begun for what cannot be kept.
    ///
    /// Errors: a file that the verb would write over, and that no earlier command left so; a file where a folder is wanted, or a folder where
    /// a file is.
    pub(crate) fn kept(&self) -> Result<Option<Rule>, BuildError> {
        let rule = self.rule();
        if let Some(rule) = rule.as_ref().filter(|_| !self.leaves_nothing()) {
            match (&self.out, &self.file) {
                (Some(folder), _) => store::may_be_folder(folder)?,
                (None, Some(file)) => store::may_be_file(file)?,
                (None, None) => {}
            }
            rule.is_free(&self.leaves)?;
        }
        Ok(rule)
    }

    /// Whether the verb writes nothing this time: an example goes to standard output.
    fn leaves_nothing(&self) -> bool {
        self.out.is_some() && self.leaves == Leaves::default()
    }
}

/// Whether a flag is there and set.
pub(crate) fn is_set(matches: &ArgMatches, id: &str) -> bool {
    matches.try_get_one::<bool>(id).ok().flatten().copied().unwrap_or(false)
}

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

    /// What is at `--out` of a command line, after the look before the work.
    fn looked(words: &[&str]) -> Result<Option<Rule>, BuildError> {
        let all = command();
        OutFolder::of(&all, &all.clone().try_get_matches_from([&["build-model"], words].concat()).unwrap()).kept()
    }

    #[test]
    fn no_work_begins_for_results_that_could_not_be_kept() {
        let all = command();
        let mut seen = 0;
        for verb in VERBS.iter().filter(|v| KEEPS_EDITS.contains(&v[0])) {
            let matches =
                all.clone().try_get_matches_from([&["build-model"], *verb, &["--out", "x"]].concat()).unwrap();
            let leaves = OutFolder::of(&all, &matches).leaves;
            assert!(!leaves.sure.is_empty(), "{verb:?}");
            for name in &leaves.sure {
                let folder = tempfile::tempdir().unwrap();
                let out = folder.path().display().to_string();
                let words = [*verb, &["--out", &out]].concat();
                store::write(&folder.path().join("notes.txt"), b"of others, in the way of nothing").unwrap();
                assert!(looked(&words).is_ok(), "{verb:?}");
                let file = folder.path().join(name);
                store::write(&file, b"by hand").unwrap();
                let told = looked(&words).unwrap_err().to_string();
                assert!(told.contains("--force") && told.contains(&file.display().to_string()), "{verb:?}: {told}");
                assert!(looked(&[&words[..], &["--force"]].concat()).is_ok(), "{verb:?}");
                seen += 1;
            }
        }
        assert!(seen > 40, "{seen}");
    }

    #[test]
    fn a_file_in_place_of_a_folder_and_a_folder_in_place_of_a_file_are_told_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let (file, own) = (folder.path().join("file"), folder.path().display().to_string());
        store::write(&file, b"by hand").unwrap();
        for verb in VERBS.iter().filter(|v| KEEPS_EDITS.contains(&v[0])) {
            let words = [*verb, &["--force", "--out"]].concat();
            for out in [file.clone(), file.join("deeper")] {
                let out = out.display().to_string();
                let told = looked(&[&words[..], &[out.as_str()]].concat()).unwrap_err().to_string();
                assert!(told.contains("is a file, a folder was expected"), "{verb:?}: {told}");
            }
        }
        for verb in [&["simulate", "KNEE", "--protocol", "pivot-shift"][..], &["next-tests", "KNEE", "--for", "ACL"]] {
            let told = looked(&[verb, &["--force", "--out", &own]].concat()).unwrap_err().to_string();
            assert!(told.contains("it is a folder, name a file"), "{verb:?}: {told}");
            assert!(looked(&[verb, &["--out", "-"]].concat()).is_ok(), "{verb:?}: standard output");
        }
        assert!(looked(&["plan", "--example", "--out", &file.display().to_string()]).is_ok(), "nothing is written");
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
