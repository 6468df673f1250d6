//! What a diagnosis is made of and leaves, for the command and for the stage of a build: the model that it asks, and its files.

use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::report::diagnosis_page;
use crate::report::html::LivePart;
use calibration::options::CalibrateOptions;
use diagnosis::diagnosis::Diagnosis;
use diagnosis::problem::trial::Source;
use diagnosis::report::component::Component;
use sim::spec::ModelSpec;

/// The page of a diagnosis.
pub(crate) const PAGE: &str = "report.html";
/// The diagnosis for programs.
pub(crate) const DIAGNOSIS: &str = "diagnosis.json";

/// The model of a file, compiled for a diagnosis of a knee that was calibrated so.
pub(crate) fn prepared(
    loaded: &LoadedModel,
    calibrate: &CalibrateOptions,
) -> Result<sim::Model, diagnosis::DiagnosisError> {
    diagnosis::problem::rim::prepared(&loaded.spec, &loaded.meshes, &calibrate.search)
}

/// A sentence for each data set of a knee of which something was cut, as its file says.
pub(crate) fn of_cut_knees(sources: &[Source]) -> Vec<String> {
    let one = |s: &Source| {
        let cut = &s.trials.first()?.without;
        (!cut.is_empty())
            .then(|| format!("{} was read of the knee without {}, as its file says.", s.name, cut.join(" and ")))
    };
    sources.iter().filter_map(one).collect()
}

/// diagnosis.json, report.html, components/ and model.json, which is `spec`: with what was added or as it was.
pub(crate) fn files_of(
    diagnosis: &Diagnosis,
    components: &[Component],
    spec: &ModelSpec,
    live: Option<&LivePart>,
) -> Result<Vec<(String, Vec<u8>)>, BuildError> {
    let mut diagnosis = diagnosis.clone();
    let mut files = Vec::new();
    for (k, component) in components.iter().enumerate() {
        let name = format!("components/{}-{}.toml", component.effect, k + 1);
        let text = toml::to_string(component).map_err(|e| BuildError::File(format!("{name}: {e}")))?;
        files.push((name.clone(), text.into_bytes()));
        diagnosis.added.push(name);
    }
    files.push(("model.json".into(), as_json(spec)?));
    files.push((PAGE.into(), diagnosis_page::page(&spec.id, &diagnosis, live).into_bytes()));
    files.push((DIAGNOSIS.into(), as_json(&diagnosis)?));
    Ok(files)
}

pub(crate) fn as_json(value: &impl serde::Serialize) -> Result<Vec<u8>, BuildError> {
    serde_json::to_vec_pretty(value).map_err(|e| BuildError::File(format!("cannot write as JSON: {e}")))
}
