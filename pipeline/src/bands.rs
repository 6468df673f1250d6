//! Mean and interval beside what a model answers, by the samples of the posterior that its calibration left.

use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::record::hash;
use crate::store;
use calibration::samples::{SCHEMA, Samples, group_sums};
use sim::laxity::{Band, LaxityTrial, TrialResult};

/// The file beside a calibrated model.json.
const FILE: &str = "samples.json";

/// Samples of a model, and what to say of them; none where the model has none, or was changed since.
pub(crate) fn of(loaded: &LoadedModel) -> Result<(Option<Samples>, String), BuildError> {
    let file = loaded.folder.join(FILE);
    let is_calibrated = loaded.file.file_name().is_some_and(|n| n == "model.json") && loaded.spec.calibrated.is_some();
    if !is_calibrated || !store::exists(&file) {
        return Ok((None, String::new()));
    }
    let fault = |what: String| BuildError::File(format!("{}: {what}; expected what calibrate writes", file.display()));
    let samples: Samples =
        serde_json::from_slice(&store::read(&file)?).map_err(|e| fault(format!("column {}: {e}", e.column())))?;
    if samples.schema != SCHEMA {
        return Err(fault(format!("schema \"{}\", {SCHEMA} is read", samples.schema)));
    }
    let n = samples.len();
    if let Some(u) = samples.of.unknowns.iter().find(|u| u.samples.len() != n) {
        return Err(fault(format!("{} has {} samples, others {n}", u.name, u.samples.len())));
    }
    if samples.model != hash(&store::read(&loaded.file)?) {
        let text = format!(
            "warning: {} was changed since it was calibrated: its samples are not used, values have no intervals\n",
            loaded.file.display()
        );
        return Ok((None, text));
    }
    Ok((Some(samples), String::new()))
}

/// Gives results their bands by at most `most` samples, and the sums of ligament groups; gives the words to print.
pub(crate) fn add(
    loaded: &LoadedModel,
    results: &mut [TrialResult],
    bundles: &[String],
    without: &[String],
    most: usize,
) -> Result<String, BuildError> {
    for r in results.iter_mut() {
        r.outputs.extend(group_sums(bundles, &r.forces_n));
    }
    if most == 0 {
        return Ok(String::new());
    }
    let (samples, text) = of(loaded)?;
    let Some(samples) = samples else { return Ok(text) };
    Ok(text + &by(&samples, loaded, results, without, most))
}

/// Gives results the bands of samples; gives the words to print.
pub(crate) fn by(
    samples: &Samples,
    loaded: &LoadedModel,
    results: &mut [TrialResult],
    without: &[String],
    most: usize,
) -> String {
    if !loaded.spec.components.is_empty() {
        return "warning: what was added to the model is in its values and not in its samples: no intervals\n".into();
    }
    let trials: Vec<LaxityTrial> = results.iter().map(asked).collect();
    let bands = match samples.bands(&loaded.meshes, &trials, without, most) {
        Ok(bands) => bands,
        Err(e) => return format!("warning: no intervals: {e}\n"),
    };
    for ((r, row), own) in results.iter_mut().zip(bands.rows).zip(&bands.most_probable) {
        r.bands = row.into_iter().map(|(name, band)| (name.clone(), in_full(&name, band, r, own))).collect();
    }
    let n = (100.0 * samples.of.interval).round();
    let mut text = format!("mean and {n} % interval by {} samples of the posterior\n", bands.asked);
    if bands.lost > 0 {
        text += &format!(
            "warning: up to {} of {} samples have no equilibrium in a row: intervals there are of those that have\n",
            bands.lost, bands.asked
        );
    }
    text
}

/// A band of contact area or pressure as the model's own mesh has it: the search merges contact nodes further, which spreads the contact, so the band is
/// multiplied by what the model tells over what the search tells of the same knee. Every other band stays.
fn in_full(name: &str, band: Band, result: &TrialResult, search: &[(String, f64)]) -> Band {
    let is_spread = ["_area_mm2", "_mean_mpa", "_peak_mpa"].iter().any(|end| name.ends_with(end));
    let of = |all: &[(String, f64)]| all.iter().find(|o| o.0 == name).map(|o| o.1).filter(|x| *x > 0.0);
    match (is_spread, of(&result.outputs), of(search)) {
        (true, Some(full), Some(coarse)) => {
            let factor = full / coarse;
            Band { mean: factor * band.mean, lower: factor * band.lower, upper: factor * band.upper }
        }
        _ => band,
    }
}

/// The trial that a result answers: a protocol's row says its flexion in its pose.
fn asked(r: &TrialResult) -> LaxityTrial {
    LaxityTrial { fe_deg: r.pose.fe_deg, ..r.trial.clone() }
}
