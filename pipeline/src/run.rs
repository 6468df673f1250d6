//! One run of the build: read, resolve, lock, build, report.

use crate::build::build_model;
use crate::build_args::BuildArgs;
use crate::cohort::shared;
use crate::error::BuildError;
use crate::options::{BuildOptions, resolve};
use crate::progress::Progress;
use crate::record::{self, Failure, Record, hash};
use crate::run_log::{Range, RunLog};
use crate::stage::list::{STAGES, folder_name, names};
use crate::stage::parts;
use crate::store::{self, BuildFolder};
use crate::suggested::command_on;
use crate::told::Told;
use crate::which_model::{WhichModel, chosen};
use crate::{inspect, interrupted, report};
use calibration::shared::called_by;
use stages::specimen::{RawSpecimen, SpecimenFile};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Builds a specimen's model; gives what is told.
pub fn run(args: &BuildArgs) -> Result<Told, BuildError> {
    check_range(args)?;
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let (file, raw) = store::read_specimen(&args.dir)?;
    if args.to.as_deref() == Some("segment") && file.ct.volume.is_none() {
        return Err(BuildError::Usage("--to segment: the specimen has surfaces and no CT volume ([ct] volume)".into()));
    }
    let mut options = resolve(&file.options, &args.overrides, args.seed)?;
    shared::read_in(&mut options.calibrate, &called_by(&file.specimen.id, file.specimen.side))?;
    if args.to.as_deref() == Some("contact-law") && !options.contact_law.fit {
        return Err(BuildError::Usage("--to contact-law: the stage runs only with --set contact-law.fit=true".into()));
    }
    if [&args.from, &args.to].iter().any(|s| s.as_deref() == Some("diagnose")) {
        options.diagnose.run = true;
        if file.laxity.is_empty() {
            return Err(BuildError::Usage(
                "the stage diagnose needs measured laxity ([laxity] in specimen.toml)".into(),
            ));
        }
    }
    let out = args.out.clone().unwrap_or_else(|| args.dir.join("build"));
    let range = Range { from: args.from.clone(), to: args.to.clone(), force: args.force, plan: args.plan };
    if args.plan && !store::exists(&out.join("log.jsonl")) {
        return Ok(Told::words(format!("Nothing is built in {} yet: every stage would run\n", out.display())));
    }
    let folder = BuildFolder::open(&out)?;
    let progress = Progress::new(args.quiet, expected(&file, &options, args.to.as_deref()));
    let mut log = RunLog::new(&folder, &options, range, progress);
    if args.plan {
        return planned(build_model(&file, &raw, &mut log), &log.records, args.json).map(Told::words);
    }
    let place = out.clone();
    let _told = interrupted::working(move || Some(kept(&place)));
    folder.write_file("run.toml", run_toml(&raw, &file, &options)?.as_bytes())?;
    let (stopped, whole) = match build_model(&file, &raw, &mut log) {
        // beyond --to an earlier run's values may have carried it to the end
        Ok(()) => (None, !log.records.iter().any(|r| r.outdated)),
        Err(BuildError::Reached) => (None, false),
        Err(error) => (Some(error), false),
    };
    let (records, read) = (log.settled(stopped.is_some())?, std::mem::take(&mut log.read_warnings));
    drop(log);
    let failure = stopped.as_ref().map(failure);
    let page = report::write(&folder, &records, failure.as_ref(), whole)?;
    if let Some(error) = stopped {
        return Err(error);
    }
    Ok(if args.json {
        Told::words(inspect::as_json(&records))
    } else if args.quiet {
        Told::default()
    } else {
        let mut odd = inspect::notices(&records, &out);
        odd.extend(read);
        let prior = shared::of_options(&options.calibrate).as_ref().and_then(shared::sentence);
        Told::words(closing_words(&out, &records, page, prior.as_deref())).odd(odd)
    })
}

/// How many stages a build will go through; `register` is left out only by a specimen that ingest has read.
fn expected(file: &SpecimenFile, options: &BuildOptions, to: Option<&str>) -> usize {
    let goes_through = |stage: &str| match stage {
        "segment" => file.ct.volume.is_some(),
        "contact-law" => options.contact_law.fit,
        "calibrate" | "validate" => !file.laxity.is_empty(),
        "diagnose" => !file.laxity.is_empty() && options.diagnose.run,
        _ => true,
    };
    let last = to.and_then(|to| names().iter().position(|n| *n == to)).unwrap_or(STAGES.len() - 1);
    names()[..=last].iter().filter(|stage| goes_through(stage)).count()
}

/// The words of a plan: which stages would run; as JSON, the log's lines as they would be, those that would run with `cached` false.
fn planned(end: Result<(), BuildError>, records: &[Record], json: bool) -> Result<String, BuildError> {
    let mut text = String::new();
    for r in records {
        let _ = writeln!(text, "{:12} {}", r.stage, if r.cached { "unchanged" } else { "would run" });
    }
    match end {
        Ok(()) | Err(BuildError::Reached | BuildError::Unplanned(_)) if json => Ok(inspect::as_json(records)),
        Ok(()) | Err(BuildError::Reached) => Ok(text),
        Err(BuildError::Unplanned(stage)) => {
            Ok(text + &format!("{stage:12} would run, and what needs it: it never has\n"))
        }
        Err(error) => Err(error),
    }
}

/// What a build that is interrupted now leaves to go on from.
fn kept(out: &Path) -> String {
    let records = record::current(&inspect::records(out).unwrap_or_default());
    let stages = match records.last() {
        None => "No stage is finished".to_owned(),
        Some(last) => format!("Kept in {}: {} stages, up to {}", out.display(), records.len(), last.stage),
    };
    match parts::kept(out) {
        parts if parts.is_empty() => stages,
        parts => format!("{stages}; of the stage at work {}", parts.join(", ")),
    }
}

/// What is kept of the error that stopped a build.
fn failure(error: &BuildError) -> Failure {
    let (file, row) = error.place().map_or((None, None), |p| (Some(p.file.clone()), p.row));
    match error {
        BuildError::Stage { stage, message, marks, .. } => {
            Failure { stage: (*stage).to_owned(), message: message.clone(), file, row, marks: marks.to_vec() }
        }
        other => Failure { stage: "input".into(), message: other.to_string(), file, row, marks: vec![] },
    }
}

fn check_range(args: &BuildArgs) -> Result<(), BuildError> {
    let names = names();
    let place = |name: &Option<String>| name.as_ref().and_then(|n| names.iter().position(|s| s == n));
    match (place(&args.from), place(&args.to)) {
        (Some(from), Some(to)) if from > to => Err(BuildError::Usage(format!(
            "--from {} comes after --to {}; stages are {}",
            names[from],
            names[to],
            names.join(", ")
        ))),
        _ => Ok(()),
    }
}

/// run.toml: resolved options, program version, digest of every input.
fn run_toml(raw: &RawSpecimen, file: &SpecimenFile, options: &BuildOptions) -> Result<String, BuildError> {
    let mut inputs: BTreeMap<&str, String> =
        raw.files.iter().map(|(name, bytes)| (name.as_str(), hash(bytes))).collect();
    inputs.insert("specimen.toml", hash(raw.toml.as_bytes()));
    let table = serde_json::json!({
        "program": {"version": env!("CARGO_PKG_VERSION"), "code": env!("GENU_CODE_DIGEST")},
        "specimen": {"id": file.specimen.id},
        "inputs": inputs,
        "options": options,
    });
    toml::to_string(&table).map_err(|e| BuildError::File(format!("run.toml: {e}")))
}

/// What is said at the end of a build. `prior`: whose data are in the prior of its calibration, in a sentence, where other knees gave it.
fn closing_words(out: &Path, records: &[Record], page: &str, prior: Option<&str>) -> String {
    let mut text = inspect::table(records);
    let _ = writeln!(text, "\nThe report is {}. Open it: {}", out.join(page).display(), command_on("open", out));
    let left: Vec<&str> = records.iter().filter(|r| r.outdated).map(|r| r.stage.as_str()).collect();
    if !left.is_empty() {
        let beside = if page == report::REPORT { "" } else { " and report.html: to build them anew, leave --to out" };
        let _ = writeln!(
            text,
            "Of an earlier run {} {}{beside}",
            if left.len() == 1 { "is" } else { "are" },
            left.join(", ")
        );
    }
    let done = |stage: &str| records.iter().any(|r| r.stage == stage && !r.outdated);
    if done("assemble") {
        let best = chosen(out, &WhichModel::default());
        let file = best.unwrap_or_else(|_| out.join(folder_name("assemble")).join("model.json"));
        let standing = if done("calibrate") { "calibrated" } else { "assembled, not calibrated" };
        if let Some(words) = prior.filter(|_| done("calibrate")) {
            let _ = writeln!(text, "{words}");
        }
        let _ = writeln!(text, "The model is {} ({standing})", file.display());
    }
    text
}
