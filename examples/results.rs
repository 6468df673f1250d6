//! Writes docs/results.md: calibration and validation of the two published specimens, and what was found where the truth is known.
//!
//! `cargo run --release --example results -- SPECIMENS BUILDS [COVERAGE.md]`: SPECIMENS holds the folders S192803 and S193761, BUILDS keeps their builds
//! (what is there and unchanged is taken up), COVERAGE.md what the example `coverage` of the crate `calibration` printed.
#![expect(clippy::print_stderr, reason = "says how far it is")]

use calibration::design::Design;
use genu::build_args::BuildArgs;
use genu::error::BuildError;
use genu::{calibrate, model_file, options, run, store};
use sim::coordinate::{Coordinate, Free, IE, VV};
use sim::laxity::Test;
use sim::protocols::ProtocolOptions;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use validation::validate::{Source, compare};

/// What the published calibration of S192803 misses by when simulated again with a model rebuilt from what was published: VV, IE [deg], ML, AP, SI
/// [mm].
const PUBLISHED_FIT: [(&str, [f64; 5]); 2] = [("kla", [4.5, 6.8, 2.9, 3.8, 2.4]), ("rks", [7.9, 11.9, 3.3, 4.3, 2.1])];
const COLUMNS: [&str; 5] = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [specimens, builds, rest @ ..] = args.as_slice() else {
        eprintln!("usage: results SPECIMENS BUILDS [COVERAGE.md]");
        return ExitCode::from(2);
    };
    match page(Path::new(specimens), Path::new(builds), rest.first().map(Path::new)) {
        Ok(text) => match store::write(Path::new("docs/results.md"), text.as_bytes()) {
            Ok(()) => ExitCode::SUCCESS,
            Err(e) => fail(&e),
        },
        Err(e) => fail(&e),
    }
}

fn fail(e: &BuildError) -> ExitCode {
    eprintln!("{e}");
    ExitCode::FAILURE
}

fn page(specimens: &Path, builds: &Path, coverage: Option<&Path>) -> Result<String, BuildError> {
    let mut text = "# Calibrated and validated: the two published specimens\n\n\
        Written by `cargo run --release --example results`; built from CT, scans and marks, calibrated to KLA and to RKS data with \
        default options (frames sought), then compared. S192803 has measured laxity; S193761's is synthetic: another simulator's, with ligaments of a \
        healthy knee and other attachments, plus noise. The paper's own tables: [paper](paper.md).\n\n"
        .to_owned();
    let _ = writeln!(text, "{}{}", options::MADE_WITH, options::digest()?);
    for id in ["S192803", "S193761"] {
        let out = builds.join(id);
        eprintln!("{id}");
        run::run(&BuildArgs { out: Some(out.clone()), quiet: true, ..BuildArgs::of(specimens.join(id)) })?;
        let _ = writeln!(text, "\n## {id}\n");
        text += &fit(id, &out)?;
        text += &measured(&specimens.join(id))?;
        text += &compared(id, &out)?;
        text += &determined(&out)?;
        text += &means(&out)?;
        if id == "S193761" {
            text += &covered(&specimens.join(id), &out)?;
        }
    }
    if let Some(found) = coverage {
        text += "\n## Truth known\n\n";
        text += &store::read_text(found)?;
    }
    Ok(text)
}

fn json(path: PathBuf) -> Result<serde_json::Value, BuildError> {
    serde_json::from_slice(&store::read(&path)?).map_err(|e| BuildError::File(format!("{}: {e}", path.display())))
}

/// Rows of a CSV file as cells, without its header.
fn rows(path: PathBuf) -> Result<Vec<Vec<String>>, BuildError> {
    let text = store::read_text(&path)?;
    Ok(text.lines().skip(1).map(|l| l.split(',').map(str::to_owned).collect()).collect())
}

/// Residuals by coordinate, beside what the published calibration reached.
fn fit(id: &str, out: &Path) -> Result<String, BuildError> {
    let metrics = json(out.join("10-calibrate/metrics.json"))?;
    let mut text = "Predicted minus measured, root mean square:\n\n\
        | calibrated to | VV deg | IE deg | ML mm | AP mm | SI mm | cost |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    for (source, theirs) in PUBLISHED_FIT {
        let m = &metrics[source];
        let cells: Vec<String> =
            COLUMNS.iter().map(|c| format!("{:.2}", m["rms"][c].as_f64().unwrap_or(f64::NAN))).collect();
        let cost = m["cost"].as_f64().unwrap_or(f64::NAN);
        let _ = writeln!(text, "| {source} | {} | {cost:.1} |", cells.join(" | "));
        if id == "S192803" {
            let cells: Vec<String> = theirs.iter().map(|v| format!("{v:.1}")).collect();
            let _ = writeln!(text, "| {source}, published parameters | {} | |", cells.join(" | "));
        }
    }
    if id == "S192803" {
        text += "\nThe published rows are of a model rebuilt from what was published (its cartilage is a stand-in), with the decks' flexions and signs of \
            load; its VV of KLA and ML were not calibrated.\n";
    }
    Ok(text)
}

/// How far the data themselves are apart: means over the anterior trials.
fn measured(specimen: &Path) -> Result<String, BuildError> {
    let mut text = "\nThe measurements themselves, means over the trials under anterior load:\n\n\
        | data | nominal flexion deg | trials | VV deg | IE deg |\n|---|---|---|---|---|\n"
        .to_owned();
    for source in ["kla", "rks"] {
        let path = specimen.join(format!("laxity/{source}.csv"));
        let (trials, _) = calibrate::read_laxity(&path.display().to_string(), &store::read(&path)?)?;
        for flexion in [30.0, 90.0] {
            let of: Vec<Free<Option<f64>>> = trials
                .iter()
                .filter(|t| t.test == Test::Anterior && (t.nominal_flexion_deg - flexion).abs() < 0.5)
                .map(|t| t.measured)
                .collect();
            let mean = |c: Coordinate| of.iter().filter_map(|m| m[c]).sum::<f64>() / of.len().max(1) as f64;
            let _ = writeln!(text, "| {source} | {flexion} | {} | {:.1} | {:.1} |", of.len(), mean(VV), mean(IE));
        }
    }
    Ok(text)
}

/// KLA against RKS: each in the frames that its data speak of, and both in the frames found on the bones.
fn compared(id: &str, out: &Path) -> Result<String, BuildError> {
    let base = model_file::load(&out.join("09-assemble"))?;
    let design = Design::of_model(&base.spec).map_err(|e| BuildError::File(e.to_string()))?;
    let mut sources = Vec::new();
    for name in ["kla", "rks"] {
        let calibrated = model_file::load(&out.join("10-calibrate").join(name))?;
        let spec = design.apply(&base.spec, &design.values(&calibrated.spec));
        let fault = |e: sim::SimError| BuildError::File(format!("{id} {name}: {e}"));
        let model = sim::compile(&spec, &base.meshes).map_err(fault)?;
        sources.push(Source::simulated(name, &spec, &model, &ProtocolOptions::default()).map_err(fault)?.0);
    }
    let common = compare(&sources, &[]);
    let mut text = "\nThe KLA-calibrated against the RKS-calibrated model, root mean square difference; each in the frames that were found with its ligaments (the \
        build's compare.csv), and the same ligaments in the frames found on the bones, common to both:\n\n\
        | protocol | quantity | own frames | common frames |"
        .to_owned();
    // S193761's laxity is synthetic, of ligaments that are not the paper's: what the paper says of its Specimen 2 is no measure of it
    let published = id == "S192803";
    text += if published { " published |\n|---|---|---|---|---|\n" } else { "\n|---|---|---|---|\n" };
    for r in rows(out.join("11-validate/compare.csv"))? {
        let [a, b, protocol, quantity, unit, ours, _, theirs, ..] = r.as_slice() else { continue };
        if (a.as_str(), b.as_str()) == ("kla", "rks") {
            let ours: f64 = ours.parse().unwrap_or(f64::NAN);
            let same = common.iter().find(|d| (&d.protocol, &d.quantity) == (protocol, quantity));
            let same = same.map_or("-".to_owned(), |d| format!("{:.2}", d.rmsd));
            let _ = write!(text, "| {protocol} | {quantity} ({unit}) | {ours:.2} | {same} |");
            text += &if published { format!(" {theirs} |\n") } else { "\n".to_owned() };
        }
    }
    Ok(text)
}

/// How many bundle forces under the AP tests the data determine.
fn determined(out: &Path) -> Result<String, BuildError> {
    let mut text = "\nBundle forces under the AP tests whose 90 % interval stays within 15 N of the value:".to_owned();
    for (source, end) in [("kla", ";"), ("rks", ".\n")] {
        let all = rows(out.join(format!("10-calibrate/{source}/forces.csv")))?;
        let known = all.iter().filter(|r| r.get(WITHIN).is_some_and(|c| c == "true")).count();
        let loaded = |r: &&Vec<String>| r.get(2).and_then(|c| c.parse::<f64>().ok()).is_some_and(|v| v > 15.0);
        let which = all.iter().filter(loaded);
        let (strong, sure) =
            which.fold((0, 0), |(n, k), r| (n + 1, k + usize::from(r.get(WITHIN).is_some_and(|c| c == "true"))));
        let _ = write!(text, " {source} {known} of {} ({sure} of the {strong} above 15 N){end}", all.len());
    }
    Ok(text)
}

/// Forces under the AP tests as the two calibrations have them in the mean of what the data leave open.
fn means(out: &Path) -> Result<String, BuildError> {
    let forces = |source: &str| -> Result<BTreeMap<(String, String), [f64; 3]>, BuildError> {
        let all = rows(out.join(format!("10-calibrate/{source}/forces.csv")))?;
        let number = |r: &Vec<String>, k: usize| r.get(k).and_then(|c| c.parse().ok()).unwrap_or(f64::NAN);
        let of = |r: &Vec<String>| match &r[..] {
            [trial, bundle, ..] => Some(((trial.clone(), bundle.clone()), [2, 3, 4].map(|k| number(r, k)))),
            _ => None,
        };
        Ok(all.iter().filter_map(of).collect())
    };
    let (kla, rks) = (forces("kla")?, forces("rks")?);
    let mut groups = BTreeMap::<(String, String), f64>::new();
    let mut overlaps = 0;
    for ((trial, bundle), [mean, lower, upper]) in &kla {
        let Some(other) = rks.get(&(trial.clone(), bundle.clone())) else { continue };
        let group = bundle.split('_').next().unwrap_or_default().to_owned();
        *groups.entry((trial.clone(), group)).or_default() += mean - other[0];
        overlaps += usize::from(*lower <= other[2] && other[1] <= *upper);
    }
    let rms = (groups.values().map(|d| d * d).sum::<f64>() / groups.len().max(1) as f64).sqrt();
    Ok(format!(
        "\nThe table above compares the most probable models. The means over what the data leave open (forces.csv) differ by {rms:.1} N, root mean square over \
        Table 5's groups and the AP tests; {overlaps} of {} intervals of bundle forces overlap.\n",
        kla.len()
    ))
}

/// Place of `within_15_n` in forces.csv.
const WITHIN: usize = 6;

/// How many of the true values lie in the intervals.
fn covered(specimen: &Path, out: &Path) -> Result<String, BuildError> {
    let truth = json(specimen.join("truth/ligaments.json"))?;
    let mut text = "\nThe true parameters (truth/ligaments.json) in the 90 % intervals:\n\n\
        | calibrated to | covered | of those mostly determined by data |\n|---|---|---|\n"
        .to_owned();
    for source in ["kla", "rks"] {
        let (mut all, mut known) = ((0, 0), (0, 0));
        for r in rows(out.join(format!("10-calibrate/{source}/parameters.csv")))? {
            let cell = |k: usize| r.get(k).and_then(|c| c.parse::<f64>().ok()).unwrap_or(f64::NAN);
            let [name, kind] = [1, 2].map(|k| r.get(k).map_or("", String::as_str));
            // the three fibres of the superficial MCL share a stiffness
            let bundle = if name == "sMCL" { "sMCL_A" } else { name };
            let Some(t) = truth["bundles"][bundle][kind].as_f64() else { continue };
            let inside = usize::from(cell(4) - 1e-6 <= t && t <= cell(5) + 1e-6);
            all = (all.0 + inside, all.1 + 1);
            if cell(8) > 0.5 {
                known = (known.0 + inside, known.1 + 1);
            }
        }
        let _ = writeln!(text, "| {source} | {} of {} | {} of {} |", all.0, all.1, known.0, known.1);
    }
    Ok(text)
}
