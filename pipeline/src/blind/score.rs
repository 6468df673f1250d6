//! `blind score`: truths are opened, answers are scored.

use super::bench::bench;
use super::table::table;
use super::{ScoreArgs, regret};
use crate::error::BuildError;
use crate::{diagnose, diagnosis_files, model_file, store};
use blindbench::laboratory::Truth;
use blindbench::score::{Said, score};
use calibration::options::CalibrateOptions;
use diagnosis::diagnosis::Diagnosis;
use diagnosis::search::DiagnosisOptions;
use sim::coordinate::Free;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(super) fn score_answers(args: &ScoreArgs) -> Result<String, BuildError> {
    let truths = opened(args)?;
    let mut folders = Vec::new();
    // the first answer to each case that was free to name anything
    let mut whole: BTreeMap<String, Said> = BTreeMap::new();
    for answers in &args.answers {
        let mut pairs = Vec::new();
        for truth in &truths {
            let Some(said) = said(answers, &truth.case)? else { continue };
            if said.without.is_empty() {
                whole.entry(truth.case.clone()).or_insert_with(|| said.clone());
            }
            pairs.push((truth.clone(), said));
        }
        folders.push((answers, pairs));
    }
    let (cases, _, _) = bench(&args.bench)?;
    let mut text = String::new();
    for (answers, pairs) in folders {
        let result = score(&pairs, &whole);
        let json = serde_json::to_vec_pretty(&result).map_err(|e| BuildError::File(e.to_string()))?;
        store::write(&answers.join("score.json"), &json)?;
        text +=
            &format!("{}: {} of {} cases answered\n{}", answers.display(), pairs.len(), cases.len(), table(&result));
    }
    Ok(text)
}

/// Truths of the cases that have an answer, their seals checked, with what they promise to an analysis.
fn opened(args: &ScoreArgs) -> Result<Vec<Truth>, BuildError> {
    let (cases, sources, manifest) = bench(&args.bench)?;
    let loaded = model_file::load(&args.model)?;
    let (options, calibrate) = (DiagnosisOptions::default(), CalibrateOptions::default());
    let model = diagnosis_files::prepared(&loaded, &calibrate).map_err(|e| BuildError::File(e.to_string()))?;
    let mut truths = Vec::new();
    for case in cases.iter().filter(|c| args.answers.iter().any(|a| store::exists(&a.join(c).join("diagnosis.json")))) {
        let bytes = store::read(&args.bench.join(format!("{case}.truth.json")))?;
        if manifest["seals"][case].as_str() != Some(crate::record::hash(&bytes).as_str()) {
            return Err(BuildError::File(format!(
                "{case}.truth.json: its seal is broken (bench.json holds another digest)"
            )));
        }
        let mut truth: Truth = serde_json::from_slice(&bytes).map_err(|e| BuildError::File(format!("{case}: {e}")))?;
        truth.case.clone_from(case);
        if !truth.effects.is_empty() {
            let measured: Vec<(String, PathBuf)> =
                sources.iter().map(|s| (s.clone(), args.bench.join(case).join(format!("{s}.csv")))).collect();
            let (data, _) = diagnose::sources(&measured)?;
            let promise = {
                let signature: Vec<Free<f64>> = truth.signature.iter().copied().map(Free).collect();
                diagnosis::diagnosis::atlas::promise(&model, &loaded.spec, &data, &signature, (&options, &calibrate))
            }
            .map_err(|e| BuildError::File(format!("{case}: {e}")))?;
            truth.strength.expected_evidence = promise.all;
            truth.strength.settled_evidence = promise.settled;
        }
        truths.push(truth);
    }
    Ok(truths)
}

/// What a folder's answer to a case said, where there is one.
fn said(answers: &Path, case: &str) -> Result<Option<Said>, BuildError> {
    let path = answers.join(case).join("diagnosis.json");
    if !store::exists(&path) {
        return Ok(None);
    }
    let diagnosis: Diagnosis =
        serde_json::from_slice(&store::read(&path)?).map_err(|e| BuildError::in_file(&path, e))?;
    Ok(Some(Said { regret: regret::read(&answers.join(case))?, ..reduced(&diagnosis) }))
}

fn reduced(d: &Diagnosis) -> Said {
    let verdict = serde_json::to_value(d.verdict).ok().and_then(|v| v.as_str().map(str::to_owned));
    let mut sizes = BTreeMap::new();
    for e in d.answers.first().map(|a| a.effects.as_slice()).unwrap_or_default() {
        for (key, v) in &e.parameters {
            sizes.insert((e.effect.clone(), key.clone()), (v.value, v.sd));
        }
    }
    let first = d.answers.first().map(|a| a.effects.as_slice()).unwrap_or_default();
    let variants = first.iter().filter_map(|e| Some((e.effect.clone(), e.variant.clone()?))).collect();
    let names =
        |a: &diagnosis::diagnosis::Answer| a.effects.iter().map(|e| (e.effect.clone(), e.scope.clone())).collect();
    Said {
        verdict: verdict.unwrap_or_default(),
        answers: d.answers.iter().map(names).collect(),
        weights: d.answers.iter().map(|a| a.weight).collect(),
        variants,
        reported: reported(d),
        sizes,
        closed: d.gap.held_out.closed,
        without: d.without.clone(),
        evidence: d.answers.iter().map(|a| a.log_bayes_factor).collect(),
        best: d.best_log_bayes_factor,
        regret: None,
    }
}

/// What a diagnosis reports as possible: its answers, then what it does not exclude beside them; not that nothing is missing.
fn reported(d: &Diagnosis) -> Vec<Vec<(String, Option<String>)>> {
    let states = d.answers.iter().map(|a| &a.effects).chain(d.not_excluded.iter().map(|n| &n.effects));
    let mut out: Vec<Vec<(String, Option<String>)>> = Vec::new();
    for effects in states.filter(|effects| !effects.is_empty()) {
        let state = effects.iter().map(|e| (e.effect.clone(), e.variant.clone())).collect();
        if !out.contains(&state) {
            out.push(state);
        }
    }
    out
}
