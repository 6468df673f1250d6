//! How a model was made, in words and tables that the supplement of a paper can take: versions, options, digests.

use super::html::escaped;
use crate::cohort::shared;
use crate::options::BuildOptions;
use crate::record::Record;
use crate::stage::list::heading;
use calibration::shared::{Shared, SharedPrior};
use std::fmt::Write;
use toml::{Table, Value};

/// What run.toml and the log say of a build.
pub(super) struct Methods {
    id: String,
    version: String,
    code: String,
    /// Path and blake3 digest of every input.
    inputs: Vec<(String, String)>,
    /// Options that are not the program's own: key, value, default.
    changed: Vec<[String; 3]>,
    /// Every option in force.
    options: Vec<[String; 2]>,
    /// Stage and digest of its result.
    stages: Vec<(String, String)>,
    /// Whose data are in the prior of the calibration, where other knees gave it.
    shared_prior: Option<String>,
}

/// A table: its title, its header, its rows.
type Titled = (&'static str, Vec<&'static str>, Vec<Vec<String>>);

impl Methods {
    /// Of a build's run.toml; `None` where it cannot be read.
    pub(super) fn read(run: &[u8], records: &[Record]) -> Option<Methods> {
        let run: Table = std::str::from_utf8(run).ok()?.parse().ok()?;
        let text = |path: [&str; 2]| run.get(path[0])?.get(path[1])?.as_str().map(str::to_owned);
        let inputs = run.get("inputs")?.as_table()?.iter();
        let mut options = Vec::new();
        let mut defaults = Vec::new();
        leaves("", run.get("options")?, &mut options);
        leaves("", &Value::try_from(BuildOptions::default()).ok()?, &mut defaults);
        let default = |key: &str| defaults.iter().find(|d| d[0] == key).map_or("none".to_owned(), |d| d[1].clone());
        let changed = options.iter().filter(|o| default(&o[0]) != o[1]);
        Some(Methods {
            id: text(["specimen", "id"])?,
            version: text(["program", "version"])?,
            code: text(["program", "code"])?,
            inputs: inputs.filter_map(|(k, v)| Some((k.clone(), v.as_str()?.to_owned()))).collect(),
            changed: changed.map(|o| [o[0].clone(), o[1].clone(), default(&o[0])]).collect(),
            options,
            stages: records.iter().map(|r| (heading(&r.stage), r.digest.clone())).collect(),
            shared_prior: shared_prior(&run).and_then(|s| shared::sentence(&shared::of(&s))),
        })
    }

    fn words(&self) -> String {
        let options = match self.changed.len() {
            0 => "All options have the values that this version has by default.".to_owned(),
            1 => "1 option differs from the defaults of this version; the table names it.".to_owned(),
            n => format!("{n} options differ from the defaults of this version; the table names them."),
        };
        let shared = self.shared_prior.as_ref().map_or(String::new(), |words| format!(" {words}"));
        format!(
            "The model of {} was built with Genu {} (digest of the source {}). It was made by {} stages from {} files. {options} \
             The same inputs and options give the same model, byte for byte, on any number of threads. Digests are blake3.{shared}",
            self.id,
            self.version,
            &self.code[..self.code.len().min(16)],
            self.stages.len(),
            self.inputs.len()
        )
    }

    fn tables(&self) -> [Titled; 4] {
        let pair = |(a, b): &(String, String)| vec![a.clone(), b.clone()];
        [
            (
                "Options that differ from the defaults",
                vec!["option", "value", "default"],
                self.changed.iter().map(|c| c.to_vec()).collect(),
            ),
            ("Digests of the inputs", vec!["file", "blake3"], self.inputs.iter().map(pair).collect()),
            ("Digests of the results", vec!["stage", "blake3"], self.stages.iter().map(pair).collect()),
            ("Every option in force", vec!["option", "value"], self.options.iter().map(|o| o.to_vec()).collect()),
        ]
    }

    /// The section of the report.
    pub(super) fn html(&self) -> String {
        let mut out = format!("<section id=\"methods\"><h2>Methods</h2><p>{}</p>", escaped(&self.words()));
        out += "<p>The same as plain text, for a supplement: <code>methods.md</code>, beside this page.</p>";
        for (title, header, rows) in self.tables().into_iter().filter(|t| !t.2.is_empty()) {
            let cells = |row: &[String], tag: &str| {
                row.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect::<String>()
            };
            let header: Vec<String> = header.into_iter().map(String::from).collect();
            let rows: String = rows.iter().map(|r| format!("<tr>{}</tr>", cells(r, "td"))).collect();
            let _ = write!(
                out,
                "<details><summary>{title}</summary><div class=\"wide\" tabindex=\"0\"><table><thead><tr>{}</tr></thead><tbody>{rows}</tbody></table></div></details>",
                cells(&header, "th")
            );
        }
        out + "</section>"
    }

    /// methods.md.
    pub(super) fn markdown(&self) -> String {
        let mut out = format!("# Methods: the model of {}\n\n{}\n", self.id, self.words());
        for (title, header, rows) in self.tables().into_iter().filter(|t| !t.2.is_empty()) {
            let rule = header.iter().map(|_| "---").collect::<Vec<_>>().join(" | ");
            let _ = writeln!(out, "\n## {title}\n\n| {} |\n| {rule} |", header.join(" | "));
            for row in rows {
                let _ = writeln!(out, "| {} |", row.join(" | ").replace('\n', " "));
            }
        }
        out
    }
}

/// Every value of a table by its path.
fn leaves(prefix: &str, value: &Value, out: &mut Vec<[String; 2]>) {
    match value {
        Value::Table(table) if !table.is_empty() => {
            let key = |k: &str| if prefix.is_empty() { k.to_owned() } else { format!("{prefix}.{k}") };
            table.iter().for_each(|(k, v)| leaves(&key(k), v, out));
        }
        other => out.push([prefix.to_owned(), shown(prefix, other)]),
    }
}

/// The shared prior that run.toml has among its options.
fn shared_prior(run: &Table) -> Option<Box<Shared>> {
    let text = run.get("options")?.get("calibrate")?.get("shared_prior")?.as_str()?;
    match SharedPrior::try_from(text.to_owned()).ok()? {
        SharedPrior::Read(shared) => Some(shared),
        SharedPrior::File(_) => None,
    }
}

/// The option whose value is the text of a whole file.
const SHARED_PRIOR: &str = "calibrate.shared_prior";

/// How a value stands in a table: as run.toml has it. Of a shared prior only whose it is, since its text is long.
fn shown(key: &str, value: &Value) -> String {
    let text = value.as_str().filter(|_| key == SHARED_PRIOR);
    match text.map(|text| SharedPrior::try_from(text.to_owned())) {
        Some(Ok(SharedPrior::Read(shared))) => shared.in_words(),
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_changed_is_told_with_its_default() {
        let options = crate::options::resolve(
            &Default::default(),
            &[crate::options::parse_override("hexmesh.layers=4").unwrap()],
            None,
        )
        .unwrap();
        let run = serde_json::json!({
            "program": {"version": "1", "code": "ab"}, "specimen": {"id": "K"}, "inputs": {"a": "b"}, "options": options,
        });
        let run = toml::to_string(&run).unwrap();
        let methods = Methods::read(run.as_bytes(), &[]).unwrap();
        assert_eq!(methods.changed, [["hexmesh.layers".to_owned(), "4".to_owned(), "3".to_owned()]]);
        assert!(methods.words().contains("1 option differs from"), "{}", methods.words());
        assert!(methods.markdown().contains("| hexmesh.layers | 4 | 3 |") && methods.html().contains("id=\"methods\""));
    }

    #[test]
    fn of_a_shared_prior_a_table_says_whose_it_is_and_not_its_text() {
        let line = r#"{"name": "N", "mean": -0.5, "sd": 0.8, "before": [0.9, 1.0, 1.1], "after": [0.8, 0.9, 1.0]}"#;
        for (from, numbers, wanted) in [
            (r#""B left""#, vec![line], "what B left says of 1 number"),
            (r#""B left", "C right""#, vec![], "what B left, C right say of 0 numbers"),
        ] {
            let text =
                format!(r#"{{"schema": "shared-prior/1", "from": [{from}], "numbers": [{}]}}"#, numbers.join(", "));
            let shared = SharedPrior::Read(Box::new(serde_json::from_str(&text).unwrap()));
            let mut options = BuildOptions::default();
            options.calibrate.shared_prior = Some(shared);
            let run = serde_json::json!({
                "program": {"version": "1", "code": "ab"}, "specimen": {"id": "K"}, "inputs": {"a": "b"}, "options": options,
            });
            let methods = Methods::read(toml::to_string(&run).unwrap().as_bytes(), &[]).unwrap();
            assert_eq!(methods.changed, [[SHARED_PRIOR.to_owned(), wanted.to_owned(), "none".to_owned()]]);
            let text = methods.markdown();
            assert!(text.contains(wanted) && !text.contains("shared-prior/1"), "{text}");
            // what tells of no number is nobody's prior
            let dependent = "so the result is not independent of that knee.";
            assert_eq!(text.contains(dependent), numbers.len() == 1, "{text}");
            assert_eq!(methods.html().contains(dependent), numbers.len() == 1);
        }
    }
}
