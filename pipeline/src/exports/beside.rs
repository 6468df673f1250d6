//! What lies beside every export: which model it is of, what its ligaments carry and where it rests, with intervals where it has samples.

use super::File;
use crate::bands::Asking;
use crate::cohort::shared;
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::simulate::SAMPLES;
use crate::which_model::standing;
use crate::{bands, record};
use calibration::inferred::REST_DEG;
use calibration::posterior::is_outside;
use calibration::session::ap_probes;
use notices::{Kind, Notice};
use serde_json::json;
use sim::coordinate::Load;
use sim::flags::Flag;
use sim::laxity::{Band, LaxityTrial, Test, TrialResult, force_column, results_csv};
use sim::protocols::{self, Protocol, ProtocolOptions};
use sim::trials::{Answer, TrialOptions, solve_trials};
use sim::{Model, SimError};
use std::fmt::Write;

/// Files that hold answers: forces of ligaments, and all that is predicted.
pub(super) const ANSWERS: [&str; 2] = ["ligament_forces.csv", "predictions.csv"];

/// `model.source.json`: the model that was exported; `ligament_forces.csv`: its ligament forces at rest, in drawers and in the paper's protocols;
/// `predictions.csv`: the same with poses, group sums and contact, as `simulate` tells them. Beside the files stands what has no answer.
pub(super) fn files(loaded: &LoadedModel) -> Result<(Vec<File>, Vec<Notice>), BuildError> {
    let spec = &loaded.spec;
    let (to, file) = (spec.calibrated.as_ref().map(|c| &c.to), loaded.place());
    let told = json!({
        "model": spec.id, "standing": standing(spec), "calibrated_to": to, "file": file,
        "digest": crate::model_file::digest(loaded), "program": env!("CARGO_PKG_VERSION"),
        "not_independent": of_others(loaded),
    });
    let mut out = vec![("model.source.json".to_owned(), record::json(&told))];
    let Ok(model) = sim::compile(spec, &loaded.meshes) else { return Ok((out, vec![])) };
    let (bundles, (results, without)) = (model.bundle_names(), asked(loaded, &model)?);
    if !results.is_empty() {
        let texts = [forces(&bundles, &results), results_csv(&bundles, &results)];
        out.extend(ANSWERS.into_iter().zip(texts).map(|(name, text)| (name.to_owned(), text.into_bytes())));
    }
    Ok((out, missing(&results, &without)))
}

/// What is said of answers that are missing: of rows without equilibrium, and of parts `without` any.
fn missing(results: &[TrialResult], without: &[&str]) -> Vec<Notice> {
    let lost: Vec<&str> = results.iter().filter(|r| !has_answer(r)).map(|r| r.trial.trial.as_str()).collect();
    let rows = lost.first().map(|first| {
        let (n, have) = (lost.len(), if lost.len() == 1 { "has" } else { "have" });
        let text = format!(
            "{n} of {} rows of {} {have} no equilibrium, and no answer there; the first: {first}",
            results.len(),
            ANSWERS[1]
        );
        Kind::RowFlagged.notice(text).count(n)
    });
    let parts = (!without.is_empty()).then(|| {
        let (all, [forces, answers]) = (without.join(", "), ANSWERS);
        let text = match results.is_empty() {
            true => format!("no row has an equilibrium in {all}: {forces} and {answers} are not written"),
            false => format!("no row has an equilibrium in {all}: {answers} has none of them"),
        };
        Kind::RowFlagged.notice(text).count(without.len())
    });
    rows.into_iter().chain(parts).collect()
}

/// The sentence on other knees whose data are in the model's prior; none where no knee's are.
fn of_others(loaded: &LoadedModel) -> Option<String> {
    shared::sentence(loaded.spec.calibrated.as_ref()?.shared_prior.as_ref()?)
}

/// Names the model in the head of a text file that takes comments: Abaqus decks, XML. A line below says whose data are in its prior, if any are.
pub(super) fn label((name, bytes): &mut File, loaded: &LoadedModel) {
    let lines: Vec<String> = [Some(loaded.label()), of_others(loaded)].into_iter().flatten().collect();
    let lines = lines.iter().map(|line| line.replace(['\n', '\r'], " "));
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if name.ends_with(".inp") {
        let head: String = lines.map(|line| format!("** {line}\n")).collect();
        *bytes = (head + text).into_bytes();
    } else if let Some((first, rest)) = text.split_once('\n').filter(|(first, _)| first.starts_with("<?xml")) {
        // two hyphens end a comment of XML
        let head: String = lines.map(|line| format!("<!-- {} -->\n", line.replace("--", "- -"))).collect();
        *bytes = format!("{first}\n{head}{rest}").into_bytes();
    }
}

/// Answers at rest, in drawers and in each protocol of the paper, with bands; and the names of parts without an equilibrium in any row, which are left
/// out.
fn asked(loaded: &LoadedModel, model: &Model) -> Result<(Vec<TrialResult>, Vec<&'static str>), BuildError> {
    let bundles = model.bundle_names();
    let mut out = Vec::new();
    let (parts, without) = parts(model);
    for (protocol, mut results) in parts {
        let pivot = protocol == Some(Protocol::PivotShift);
        let asking = Asking {
            bundles: &bundles,
            without: &[],
            source: None,
            most: SAMPLES,
            dislocation_ap_mm: pivot.then_some(ProtocolOptions::default().pivot_dislocation_ap_mm),
        };
        bands::add(loaded, &mut results, &asking)?;
        results.iter_mut().for_each(|r| r.trial.trial = of_part(protocol, r));
        out.extend(results);
    }
    Ok((out, without))
}

/// Forces of every bundle [N].
fn forces(bundles: &[String], results: &[TrialResult]) -> String {
    let mut text = format!("{HEADER}\n");
    for r in results.iter().filter(|r| has_answer(r)) {
        for (bundle, value) in bundles.iter().zip(&r.forces_n) {
            let _ = writeln!(text, "{},{bundle},{}", r.trial.trial, cells(*value, r.band(&force_column(bundle))));
        }
    }
    text
}

/// Columns as in forces.csv of a calibration: best estimate, its interval, then the mean of the samples and the single model.
const HEADER: &str = "trial,bundle,value_n,lower_n,upper_n,mean_n,mode_n,outside";

/// The best estimate is the samples' mean; without samples the single model's.
fn cells(mode: f64, band: Option<Band>) -> String {
    match band {
        Some(b) => {
            let (outside, [mean, lower, upper]) = (is_outside(mode, [b.lower, b.upper]), [b.mean, b.lower, b.upper]);
            format!("{mean:.3},{lower:.3},{upper:.3},{mean:.3},{mode:.3},{outside}")
        }
        None => format!("{mode:.3},,,,{mode:.3},"),
    }
}

/// A row's name: drawers as in forces.csv of a calibration, rows of a protocol with its name before theirs.
fn of_part(protocol: Option<Protocol>, r: &TrialResult) -> String {
    let own = &r.trial.trial;
    protocol.map_or_else(|| own.clone(), |protocol| format!("{} {own}", name_of(protocol)))
}

/// A protocol's name in these files.
fn name_of(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::ApLaxity => "ap_laxity",
        Protocol::PassiveFlexion => "passive_flexion",
        Protocol::PivotShift => "pivot_shift",
    }
}

/// Whether a result has an equilibrium.
fn has_answer(r: &TrialResult) -> bool {
    !r.flags.contains(&Flag::NoEquilibrium)
}

/// A part's rows, and of which protocol they are; none: rest and drawers.
type Part = (Option<Protocol>, Vec<TrialResult>);

/// Rest and drawers, then the protocols; and the names of those without an equilibrium in any row.
fn parts(model: &Model) -> (Vec<Part>, Vec<&'static str>) {
    let rest =
        |f: &f64| LaxityTrial::asked(format!("neutral_{f}"), Test::Neutral, *f, Load::compression(COMPRESSION_N));
    let trials: Vec<LaxityTrial> = REST_DEG.iter().map(rest).chain(ap_probes()).collect();
    let answers = solve_trials(model, &trials, &TrialOptions::default());
    let bundles = model.bundle_names().len();
    let row = |(answer, trial): (Result<Answer, SimError>, &LaxityTrial)| {
        answer.map_or_else(|_| TrialResult::without_equilibrium(trial, bundles), |a| a.result(trial))
    };
    let asked: Vec<TrialResult> = answers.into_iter().zip(&trials).map(row).collect();
    let (mut out, mut without) = (Vec::new(), Vec::new());
    match asked.iter().any(has_answer) {
        true => out.push((None, asked)),
        false => without.push("rest and drawers"),
    }
    for protocol in [Protocol::ApLaxity, Protocol::PassiveFlexion, Protocol::PivotShift] {
        match protocols::run(model, protocol, &ProtocolOptions::default()) {
            Ok(results) => out.push((Some(protocol), results)),
            Err(_) => without.push(name_of(protocol)),
        }
    }
    (out, without)
}

/// Joint compression in these trials [N]; the paper's.
const COMPRESSION_N: f64 = 20.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_parts_without_an_answer_are_counted_and_the_first_is_named() {
        let trial = |name: &str| LaxityTrial::asked(name.into(), Test::Neutral, 30.0, Load::default());
        let lost = |name: &str| TrialResult::without_equilibrium(&trial(name), 0);
        let found = |name: &str| TrialResult { flags: vec![Flag::Dislocated], ..lost(name) };
        assert!(missing(&[found("a")], &[]).is_empty());
        let told = missing(&[found("a"), lost("pivot_shift b"), lost("c")], &["passive_flexion"]);
        let told: Vec<String> = told.iter().map(ToString::to_string).collect();
        assert_eq!(told.len(), 2);
        assert!(told[0].starts_with("2 of 3 rows of predictions.csv have no equilibrium"), "{}", told[0]);
        assert!(told[0].ends_with("the first: pivot_shift b"), "{}", told[0]);
        assert!(told[1].ends_with("in passive_flexion: predictions.csv has none of them"), "{}", told[1]);
        // a file that is not there holds and lacks nothing
        let told = missing(&[], &["rest and drawers", "pivot_shift"]);
        assert_eq!(told.len(), 1);
        assert!(
            told[0].to_string().ends_with("ligament_forces.csv and predictions.csv are not written"),
            "{}",
            told[0]
        );
    }
}
