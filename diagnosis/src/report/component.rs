//! An effect added to a model: a versioned piece of data that model.json carries.

use crate::effect::Active;
use crate::effect::candidate::Scope;
use crate::effect::catalogue::Catalogue;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::report::{Named, Value, named};
use serde::{Deserialize, Serialize};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

pub use crate::report::Provenance;

/// A component (components/NAME-1.toml, and an entry of `components` in model.json).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Component {
    /// "component/1".
    pub schema: String,
    /// The effect's name.
    pub effect: String,
    /// The structure it is about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    /// A data set, or "both".
    pub scope: String,
    /// "specimen", "session" or "apparatus": an apparatus' component never reaches a prediction about the joint alone.
    pub kept: String,
    /// "proposed", until someone accepts it.
    pub status: String,
    /// Version of the catalogue.
    pub catalogue: String,
    /// Log Bayes factor of the answer it came with.
    pub log_bayes_factor: f64,
    /// Share of the gap on held-out trials that the answer closes [-]; components of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed: Option<f64>,
    /// Values.
    pub parameters: BTreeMap<String, Value>,
    /// What it was found with; components of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

impl Component {
    /// Its place in the catalogue, at work.
    ///
    /// Errors: an unknown effect or parameter.
    pub fn active(&self, catalogue: &Catalogue) -> Result<Active, DiagnosisError> {
        let (effect, first) = catalogue.find(&self.effect)?;
        let variant = match &self.variant {
            None => first,
            Some(v) => effect.variants.iter().position(|x| x == v).ok_or_else(|| {
                DiagnosisError::Component(format!(
                    "{} has no variant {v:?}; it has {}",
                    self.effect,
                    effect.variants.join(", ")
                ))
            })?,
        };
        let values = effect.parameter.iter().map(|p| match self.parameters.get(&p.key) {
            Some(v) if v.value.is_finite() => Ok(v.value),
            _ => Err(DiagnosisError::Component(format!("{} lacks a number for {}", self.effect, p.key))),
        });
        Active::new(effect, variant, &values.collect::<Result<Vec<_>, _>>()?)
    }
}

/// The components of a fit that `closed` this share of the held-out gap; `temper` as in [`named`].
pub fn components(problem: &Problem, fit: &Fit, temper: f64, (log_bayes_factor, closed): (f64, f64)) -> Vec<Component> {
    let kept = fit.hypothesis.iter().map(|c| c.effect.kept.clone());
    named(problem, fit, temper)
        .into_iter()
        .zip(kept)
        .map(|(Named { effect, scope, variant, parameters }, kept)| Component {
            schema: "component/1".into(),
            effect,
            variant,
            scope,
            kept,
            status: "proposed".into(),
            catalogue: problem.catalogue.version.clone(),
            log_bayes_factor,
            closed: Some(closed),
            parameters,
            provenance: None,
        })
        .collect()
}

/// The components a model has, each at work.
///
/// Errors: a component that cannot be read.
pub fn of_model(spec: &ModelSpec, catalogue: &Catalogue) -> Result<Vec<(Component, Active)>, DiagnosisError> {
    let read = |(k, value): (usize, &serde_json::Value)| {
        let component: Component = serde_json::from_value(value.clone())
            .map_err(|e| DiagnosisError::Component(format!("components[{k}] of the model: {e}")))?;
        let active = component.active(catalogue)?;
        Ok((component, active))
    };
    spec.components.iter().enumerate().map(read).collect()
}

/// The components a model has, with the data sets in which they act. A component of another data set is silent.
///
/// Errors: a component that cannot be read.
pub fn present(
    spec: &ModelSpec,
    sources: &[String],
    catalogue: &Catalogue,
) -> Result<Vec<(Active, Scope)>, DiagnosisError> {
    let mut out = Vec::new();
    for (component, active) in of_model(spec, catalogue)? {
        if component.scope == "both" {
            out.push((active, Scope::Both));
        } else if let Some(s) = sources.iter().position(|n| *n == component.scope) {
            out.push((active, Scope::Only(s)));
        }
    }
    Ok(out)
}

/// The model with the ligaments and the components of a fit: a new version.
///
/// Errors: none of its own; the model's parameters as in the fit.
pub fn augmented(
    problem: &Problem,
    spec: &ModelSpec,
    fit: &Fit,
    components: &[Component],
) -> Result<ModelSpec, DiagnosisError> {
    let mut out = spec.clone();
    let knee = problem.models_at(&fit.unknowns)?;
    let parameters = knee.shared().parameters();
    for (bundle, p) in out.bundles.iter_mut().zip(&parameters) {
        bundle.reference_strain = p.reference_strain;
        bundle.stiffness_n_per_mm = p.stiffness_n_per_mm;
    }
    if problem.nuisance.are_of_a_built_knee() {
        out.frames = problem.nuisance.frames_at(&fit.unknowns)?;
        for (fibre, at) in out.fibres.iter_mut().zip(&knee.shared().fibres) {
            (fibre.femur, fibre.tibia) = (at.femur.into(), at.tibia.into());
        }
    }
    let scale = problem.nuisance.contact_scale(&fit.unknowns);
    out.contact.scale_pressure(scale);
    for c in components {
        let value = serde_json::to_value(c).map_err(|e| DiagnosisError::Component(e.to_string()))?;
        out.components.push(value);
    }
    Ok(out)
}
