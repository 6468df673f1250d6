//! `schema`: what other programs may rely on in the files that the program writes, generated from the types that write them.

use crate::check;
use crate::cohort::{CohortTold, InferTold};
use crate::diagnose::DiagnoseTold;
use crate::error::BuildError;
use crate::import::ImportTold;
use crate::init::InitTold;
use crate::inspect;
use crate::next_tests::{self, NextTestsTold};
use crate::option_docs;
use crate::output::{OUTPUT, Output};
use crate::phantom::PhantomTold;
use crate::plan;
use crate::record::Record;
use crate::report::ReportTold;
use crate::told::{CalibrateTold, ErrorTold, ExportTold, SimulateTold, ValidateTold, schemas};
use schemars::{JsonSchema, schema_for};
use serde_json::Value;

/// A file's name and version, and what it is.
struct Entry {
    name: &'static str,
    /// As the file says in `schema`; the log's lines do not say it.
    version: &'static str,
    what: &'static str,
    make: fn() -> Value,
}

const ALL: [Entry; 25] = [
    Entry { name: "model", version: "model/1", what: "model.json", make: made::<sim::spec::ModelSpec> },
    Entry {
        name: "diagnosis",
        version: "diagnosis/1",
        what: "diagnosis.json",
        make: made::<diagnosis::report::Diagnosis>,
    },
    Entry {
        name: "samples",
        version: calibration::samples::SCHEMA,
        what: "samples.json",
        make: made::<calibration::samples::Samples>,
    },
    Entry { name: "plan", version: plan::SCHEMA, what: "plan.json and plan --json", make: made::<plan::Outcome> },
    Entry {
        name: "sweep",
        version: plan::SWEEP_SCHEMA,
        what: "sweep.json and plan --sweep --json",
        make: made::<plan::SweepTold>,
    },
    Entry { name: "next-tests", version: next_tests::SCHEMA, what: "next-tests --json", make: made::<NextTestsTold> },
    Entry { name: "log", version: "log/1", what: "a line of log.jsonl", make: made::<Record> },
    Entry { name: "simulate", version: schemas::SIMULATE, what: "simulate --json", make: made::<SimulateTold> },
    Entry { name: "calibrate", version: schemas::CALIBRATE, what: "calibrate --json", make: made::<CalibrateTold> },
    Entry { name: "validate", version: schemas::VALIDATE, what: "validate --json", make: made::<ValidateTold> },
    Entry { name: "export", version: schemas::EXPORT, what: "export --json", make: made::<ExportTold> },
    Entry { name: "diagnose", version: schemas::DIAGNOSE, what: "diagnose --json", make: made::<DiagnoseTold> },
    Entry { name: "init", version: schemas::INIT, what: "init --json", make: made::<InitTold> },
    Entry { name: "check", version: "check/1", what: "check --json: every input", make: made::<Vec<check::Item>> },
    Entry { name: "inspect", version: "inspect/1", what: "inspect --json", make: made::<Vec<inspect::StageTold>> },
    Entry { name: "options", version: "options/1", what: "options --json", make: made::<Vec<option_docs::OptionDoc>> },
    Entry { name: "phantom", version: schemas::PHANTOM, what: "phantom --json", make: made::<PhantomTold> },
    Entry {
        name: "import",
        version: schemas::IMPORT,
        what: "import-abaqus, import-opensim and import-febio --json",
        make: made::<ImportTold>,
    },
    Entry { name: "report", version: schemas::REPORT, what: "report --json", make: made::<ReportTold> },
    Entry { name: "cohort", version: schemas::COHORT, what: "cohort --json", make: made::<CohortTold> },
    Entry { name: "cohort-infer", version: InferTold::SCHEMA, what: "cohort infer --json", make: made::<InferTold> },
    Entry {
        name: "shared-prior",
        version: calibration::shared::SCHEMA,
        what: "shared_prior_KNEE.json",
        make: made::<calibration::shared::Shared>,
    },
    Entry {
        name: "credibility",
        version: crate::credibility::SCHEMA,
        what: "credibility.json",
        make: made::<crate::credibility::CredibilityTold>,
    },
    Entry { name: "output", version: OUTPUT, what: "--json of a verb that has words only", make: made::<Output> },
    Entry { name: "error", version: schemas::ERROR, what: "an error, with --json", make: made::<ErrorTold> },
];

fn made<T: JsonSchema>() -> Value {
    schema_for!(T).to_value()
}

/// The names of the schemas.
pub fn names() -> [&'static str; 25] {
    ALL.map(|e| e.name)
}

/// The JSON schema (draft 2020-12) called `name`.
///
/// Errors: no such schema; the message names those there are.
pub fn schema(name: &str) -> Result<String, BuildError> {
    let Some(entry) = ALL.iter().find(|e| e.name == name) else {
        return Err(BuildError::Usage(format!("no schema {name}; one of {} was expected", names().join(", "))));
    };
    let mut value = (entry.make)();
    if let Some(map) = value.as_object_mut() {
        map.insert("$id".into(), format!("urn:genu:schema:{}", entry.version.replace('/', ":")).into());
        map.insert("title".into(), format!("{} ({})", entry.what, entry.version).into());
        if let Some(stated) = map.get_mut("properties").and_then(|p| p.get_mut("schema")).and_then(Value::as_object_mut)
        {
            stated.insert("const".into(), entry.version.into());
        }
    }
    let mut text = serde_json::to_string_pretty(&value).unwrap_or_default();
    text.push('\n');
    Ok(text)
}
