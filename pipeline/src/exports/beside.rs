//! What lies beside every export: which model it is of, and what its ligaments carry, with intervals where it has samples.

use super::File;
use crate::bands::Asking;
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::simulate::SAMPLES;
use crate::which_model::standing;
use crate::{bands, record};
use calibration::inferred::REST_DEG;
use calibration::posterior::is_outside;
use calibration::session::ap_probes;
use serde_json::json;
use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, Test, TrialResult, force_column};
use sim::trials::{TrialOptions, solve_trials};
use std::fmt::Write;

/// `model.source.json`: the model that was exported; `ligament_forces.csv`: its ligament forces at rest and in drawers, `mode_n` the model's own.
pub(super) fn files(loaded: &LoadedModel) -> Result<Vec<File>, BuildError> {
    let spec = &loaded.spec;
    let (to, file) = (spec.calibrated.as_ref().map(|c| &c.to), loaded.place());
    let told = json!({
        "model": spec.id, "standing": standing(spec), "calibrated_to": to, "file": file,
        "digest": crate::model_file::digest(loaded), "program": env!("CARGO_PKG_VERSION"),
    });
    let mut out = vec![("model.source.json".to_owned(), record::json(&told))];
    out.extend(forces(loaded)?.map(|text| ("ligament_forces.csv".to_owned(), text.into_bytes())));
    Ok(out)
}

/// Names the model in the head of a text file that takes comments: Abaqus decks, XML.
pub(super) fn label((name, bytes): &mut File, loaded: &LoadedModel) {
    let label = loaded.label().replace(['\n', '\r'], " ");
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if name.ends_with(".inp") {
        *bytes = format!("** {label}\n{text}").into_bytes();
    } else if let Some((first, rest)) = text.split_once('\n').filter(|(first, _)| first.starts_with("<?xml")) {
        // two hyphens end a comment of XML
        *bytes = format!("{first}\n<!-- {} -->\n{rest}", label.replace("--", "- -")).into_bytes();
    }
}

/// Forces of every bundle [N]; none where the model has no equilibrium in one of the trials.
fn forces(loaded: &LoadedModel) -> Result<Option<String>, BuildError> {
    let Ok(model) = sim::compile(&loaded.spec, &loaded.meshes) else { return Ok(None) };
    let rest =
        |f: &f64| LaxityTrial::asked(format!("neutral_{f}"), Test::Neutral, *f, Load::compression(COMPRESSION_N));
    let trials: Vec<LaxityTrial> = REST_DEG.iter().map(rest).chain(ap_probes()).collect();
    let answers = solve_trials(&model, &trials, &TrialOptions::default());
    let results: Result<Vec<TrialResult>, _> =
        answers.into_iter().zip(&trials).map(|(a, t)| a.map(|a| a.result(t))).collect();
    let Ok(mut results) = results else { return Ok(None) };
    let bundles = model.bundle_names();
    let asking = Asking { bundles: &bundles, without: &[], source: None, most: SAMPLES, dislocation_ap_mm: None };
    bands::add(loaded, &mut results, &asking)?;
    let mut text = "trial,bundle,mode_n,mean_n,lower_n,upper_n,outside\n".to_owned();
    for r in &results {
        for (bundle, value) in bundles.iter().zip(&r.forces_n) {
            let cells = r.band(&force_column(bundle)).map_or(",,,".to_owned(), |b| {
                let outside = is_outside(*value, [b.lower, b.upper]);
                format!("{:.3},{:.3},{:.3},{outside}", b.mean, b.lower, b.upper)
            });
            let _ = writeln!(text, "{},{bundle},{value:.3},{cells}", r.trial.trial);
        }
    }
    Ok(Some(text))
}

/// Joint compression in these trials [N]; the paper's.
const COMPRESSION_N: f64 = 20.0;
