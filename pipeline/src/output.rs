//! What is printed where: words on standard output and warnings on standard error; with `--json` data on the one and errors as data on the other.

use crate::error::{BuildError, OUR_FAULT};
use crate::out_folder::{FORCE, KEEPS_EDITS, is_set};
use crate::told::{ErrorTold, Told, schemas};
use clap::{Arg, ArgAction, ArgMatches, Command};
use notices::Notice;
use schemars::JsonSchema;
use serde::Serialize;
use std::ffi::OsString;

/// The id of the flag, which is not that of a verb's own `--json`.
const JSON: &str = "output_as_json";
/// The same of `--quiet`.
const QUIET: &str = "print_nothing";
/// Of `--verbose`.
const VERBOSE: &str = "tell_details";
/// Verbs without the flags: a schema is JSON, a script and a manual are for others than people.
const OTHERS: [&str; 4] = ["schema", "completions", "man", "help"];

/// Gives `--json`, `--quiet` and `--verbose` to every verb that has none of its own, and `--force` to those that keep edits.
pub fn with_flags(command: Command) -> Command {
    command.mut_subcommands(|verb| {
        if verb.has_subcommands() {
            return with_flags(verb);
        }
        if OTHERS.contains(&verb.get_name()) {
            return verb;
        }
        let flags = [
            (JSON, "json", "Print its output as JSON, and errors as JSON on standard error"),
            (QUIET, "quiet", "Print nothing but errors"),
        ];
        let verb = flags.into_iter().fold(verb, |verb, (id, long, help)| {
            if has(&verb, long) {
                return verb;
            }
            let flag = Arg::new(id).long(long).action(ArgAction::SetTrue).help(help);
            verb.arg(if id == QUIET { flag.short('q') } else { flag })
        });
        with_details(with_force(verb))
    })
}

fn has(verb: &Command, long: &str) -> bool {
    verb.get_arguments().any(|a| a.get_long() == Some(long))
}

/// Gives `--verbose` to a verb, or to the command line without one.
pub fn with_details(verb: Command) -> Command {
    let help = "Tell on standard error what is read, done and written, and when";
    let quiet = verb.get_arguments().find(|a| a.get_long() == Some("quiet")).map(|a| a.get_id().clone());
    let flag = Arg::new(VERBOSE).short('v').long("verbose").action(ArgAction::SetTrue).help(help);
    verb.arg(quiet.into_iter().fold(flag, |flag, id| flag.conflicts_with(id)))
}

/// Gives `--force` to a verb that keeps edits of its results.
fn with_force(verb: Command) -> Command {
    if !KEEPS_EDITS.contains(&verb.get_name()) || has(&verb, "force") {
        return verb;
    }
    let help = "Write over files at --out that were changed since, or that this program did not write";
    verb.arg(Arg::new(FORCE).long("force").action(ArgAction::SetTrue).help(help))
}

/// How the output of a verb is wanted.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    verb: String,
    json: bool,
    quiet: bool,
    verbose: bool,
}

impl Asked {
    /// Whether details of the work are wanted.
    pub fn is_verbose(&self) -> bool {
        self.verbose
    }
}

/// What was asked of the output, for a verb that does not see to it itself.
pub fn asked(matches: &ArgMatches) -> Asked {
    let verbose = is_set(matches, VERBOSE);
    let Some((verb, inner)) = matches.subcommand() else { return Asked { verbose, ..Asked::default() } };
    let within = asked(inner);
    if !within.verb.is_empty() {
        return Asked { verb: format!("{verb} {}", within.verb), ..within };
    }
    let quiet = is_set(inner, QUIET) || is_set(inner, "quiet");
    Asked { verb: verb.to_owned(), json: is_set(inner, JSON), quiet, verbose: within.verbose }
}

/// Whether the words of a command line ask for JSON; told of a line that cannot be read, too.
pub fn wants_json(words: &[OsString]) -> bool {
    words.iter().any(|w| w == "--json")
}

/// `--json` of a verb that has its words only.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Output {
    /// output/1
    schema: &'static str,
    /// The verb.
    verb: String,
    /// The lines that name the models of the answer.
    models: Vec<String>,
    /// What is odd, in sentences.
    warnings: Vec<String>,
    /// The same as values.
    notices: Vec<Notice>,
    /// Its lines, as they would be printed.
    lines: Vec<String>,
}

/// Version of [`Output`].
pub const OUTPUT: &str = "output/1";

/// What goes to standard output, and what to standard error.
pub fn streams(asked: &Asked, told: &Told) -> (String, String) {
    match (asked.json, asked.quiet) {
        (true, _) => (as_json(asked, told), String::new()),
        (false, true) => (String::new(), String::new()),
        (false, false) => (told.words.clone(), told.warning_lines()),
    }
}

/// All that a caller in the same process is told, in one text.
pub fn text(asked: &Asked, told: &Told) -> String {
    if asked.json { as_json(asked, told) } else { told.all_lines() }
}

fn as_json(asked: &Asked, told: &Told) -> String {
    let lines = || told.words.lines().map(str::to_owned);
    let value = told.data.clone().or_else(|| {
        serde_json::to_value(Output {
            schema: OUTPUT,
            verb: asked.verb.clone(),
            models: told.models.clone(),
            warnings: notices::texts(&told.warnings),
            notices: told.warnings.clone(),
            lines: lines().collect(),
        })
        .ok()
    });
    pretty(&value)
}

fn pretty(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).unwrap_or_default();
    text.push('\n');
    text
}

/// An error as JSON.
pub fn error_as_json(error: &BuildError) -> String {
    let place = error.place();
    pretty(&ErrorTold {
        schema: schemas::ERROR,
        code: error.code(),
        status: error.exit_status(),
        message: error.to_string(),
        stage: error.stopped_at().map(str::to_owned),
        file: place.map(|p| p.file.clone()),
        row: place.and_then(|p| p.row),
        column: place.and_then(|p| p.column.clone()),
        key: error.setting().map(|s| s.0.to_owned()),
        value: error.setting().map(|s| s.1.to_owned()),
        advice: advice(error),
    })
}

/// A fault of this program as JSON.
pub fn fault_as_json(what: &str) -> String {
    pretty(&ErrorTold {
        schema: schemas::ERROR,
        code: "internal",
        status: OUR_FAULT,
        message: format!("internal error, please report it: {what}"),
        stage: None,
        file: None,
        row: None,
        column: None,
        key: None,
        value: None,
        advice: advice_of("internal"),
    })
}

/// What an error asks for.
pub fn advice(error: &BuildError) -> &'static str {
    match error {
        BuildError::Edited { .. } => "move the file away, name another folder, or add --force to write over it",
        other => advice_of(other.code()),
    }
}

/// What a kind of fault asks for.
fn advice_of(code: &str) -> &'static str {
    match code {
        "stage" => "correct what the message names, and build again; finished stages are kept",
        "machine" => "see to the disk, the rights or the lock, and run the same command again",
        "option" => "correct the option; build-model options lists all with their meaning",
        "usage" => "see --help of the command",
        "internal" => "report it, with the command and its input",
        _ => "correct the file, and run the same command again",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;
    use notices::Kind;
    use serde_json::{Value, json};

    #[test]
    fn warnings_are_apart_from_the_rest() {
        let told = Told::words("2 rows in b\n").odd(vec![Kind::DeckOdd.notice("a: odd")]);
        let asked = |json, quiet| Asked { verb: "init".into(), json, quiet, verbose: false };
        assert_eq!(streams(&asked(false, false), &told), ("2 rows in b\n".into(), "warning: a: odd\n".into()));
        assert_eq!(streams(&asked(false, true), &told), (String::new(), String::new()));
        let (out, err) = streams(&asked(true, true), &told);
        let value: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((&value["warnings"], &value["lines"]), (&json!(["a: odd"]), &json!(["2 rows in b"])));
        assert_eq!(value["notices"], json!([{"kind": "deck-odd", "weight": "light", "text": "a: odd"}]));
        assert!(err.is_empty());
    }

    #[test]
    fn every_verb_takes_the_flags() {
        let all = crate::cli::command();
        let mut seen = 0;
        for verb in all.get_subcommands().filter(|v| !OTHERS.contains(&v.get_name()) && !v.has_subcommands()) {
            for flag in ["json", "quiet", "verbose"] {
                assert!(has(verb, flag), "{} --{flag}", verb.get_name());
            }
            assert!(has(verb, "force") || !KEEPS_EDITS.contains(&verb.get_name()), "{}", verb.get_name());
            seen += 1;
        }
        assert!(seen > 10);
    }

    #[test]
    fn an_error_tells_its_parts() {
        let place = Place { file: "a.csv".into(), row: Some(3), column: Some("load_ap_n".into()) };
        let value: Value = serde_json::from_str(&error_as_json(&BuildError::at(place, "odd".into()))).unwrap();
        assert_eq!(
            [&value["file"], &value["row"], &value["column"]],
            [&json!("a.csv"), &json!(3), &json!("load_ap_n")]
        );
        assert_eq!([&value["code"], &value["status"], &value["message"]], [&json!("file"), &json!(1), &json!("odd")]);
    }
}
