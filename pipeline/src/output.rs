//! `--json` of verbs that print words: the same lines and warnings, for programs.

use crate::model_file::MODEL_LINE;
use crate::store;
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The id of the flag, which is not that of a verb's own `--json`.
const ID: &str = "output_as_json";
/// Verbs without the flag: a schema is JSON, a script and a manual are for others than people.
const OTHERS: [&str; 4] = ["schema", "completions", "man", "help"];

/// Gives `--json` to every verb that has none of its own.
pub fn with_json(command: Command) -> Command {
    command.mut_subcommands(|verb| {
        if verb.has_subcommands() {
            return with_json(verb);
        }
        let own = verb.get_arguments().any(|a| a.get_long() == Some("json"));
        if own || OTHERS.contains(&verb.get_name()) {
            return verb;
        }
        verb.arg(Arg::new(ID).long("json").action(ArgAction::SetTrue).help("Print its output as JSON"))
    })
}

/// A verb whose output is wanted as JSON.
pub struct Asked {
    verb: String,
    out: Option<PathBuf>,
}

/// The verb, where `--json` was given to one that has none of its own.
pub fn asked(matches: &ArgMatches) -> Option<Asked> {
    let (verb, inner) = matches.subcommand()?;
    if let Some(asked) = asked(inner) {
        return Some(Asked { verb: format!("{verb} {}", asked.verb), ..asked });
    }
    let flag = inner.try_get_one::<bool>(ID).ok().flatten().copied().unwrap_or(false);
    let out = inner.try_get_one::<PathBuf>("out").ok().flatten().cloned();
    flag.then(|| Asked { verb: verb.to_owned(), out })
}

/// What a verb printed, as JSON: `{"schema": "output/1", "verb", "models": [..], "warnings": [..], "lines": [..]}`, lines as they would be printed,
/// those that name the models of the answer apart; `diagnose` with what it wrote to diagnosis.json (or atlas.json) under `result`.
pub fn as_json(asked: &Asked, text: &str) -> String {
    let (warnings, lines): (Vec<&str>, Vec<&str>) = text.lines().partition(|l| l.starts_with("warning: "));
    let warnings: Vec<&str> = warnings.iter().map(|w| w.trim_start_matches("warning: ")).collect();
    let models: Vec<&str> = lines.iter().filter_map(|l| l.strip_prefix(MODEL_LINE)).collect();
    let mut value =
        json!({"schema": "output/1", "verb": asked.verb, "models": models, "warnings": warnings, "lines": lines});
    let written = asked.out.as_deref().filter(|_| asked.verb == "diagnose").and_then(result);
    if let Some(result) = written {
        value["result"] = result;
    }
    let mut text = serde_json::to_string_pretty(&value).unwrap_or_default();
    text.push('\n');
    text
}

/// What a diagnosis wrote last.
fn result(out: &Path) -> Option<Value> {
    let place = store::first_that_exists(&[out.join("diagnosis.json"), out.join("atlas.json")]);
    serde_json::from_str(&store::read_text(&place).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_apart_from_the_rest() {
        let asked = Asked { verb: "simulate".into(), out: None };
        let value: Value = serde_json::from_str(&as_json(&asked, "warning: a: odd\n2 rows in b\n")).unwrap();
        assert_eq!(value["warnings"], json!(["a: odd"]));
        assert_eq!(value["lines"], json!(["2 rows in b"]));
    }

    #[test]
    fn every_verb_takes_the_flag() {
        let all = crate::cli::command();
        let mut seen = 0;
        for verb in all.get_subcommands().filter(|v| !OTHERS.contains(&v.get_name()) && !v.has_subcommands()) {
            assert!(verb.get_arguments().any(|a| a.get_long() == Some("json")), "{}", verb.get_name());
            seen += 1;
        }
        assert!(seen > 10);
    }
}
