//! What effects of tissues have in common: where they are at rest, and what fibres of the model pull.

use super::Situation;
use nalgebra::Vector3;
use serde::Deserialize;
use sim::coordinate::{IE, Six};
use sim::ligament::Fibre;
use sim::names::is_of;

/// Where a tissue is at rest.
#[derive(Debug, PartialEq, Deserialize)]
pub(super) enum About {
    /// In the unloaded pose of each flexion.
    #[serde(rename = "about the unloaded pose")]
    Unloaded,
    /// In the pose of the reference.
    #[serde(rename = "about the reference pose")]
    Reference,
}

impl About {
    /// How far the knee is from there [rad, mm].
    pub(super) fn away(&self, here: &Situation) -> Six {
        match self {
            About::Unloaded => here.q - here.trial.unloaded.q,
            About::Reference => here.q,
        }
    }
}

/// The fibre with its ends moved in the CT pose; its strain there stays.
pub(super) fn moved_fibre(fibre: &Fibre, femoral: &Vector3<f64>, tibial: &Vector3<f64>) -> Fibre {
    let (femur, tibia) = (fibre.femur + femoral, fibre.tibia + tibial);
    fibre.with_ends(femur, tibia)
}

/// Generalised force of a fibre.
pub(crate) fn fibre_pull(here: &Situation, fibre: &Fibre) -> Six {
    let bundle = &here.model.bundles[fibre.bundle];
    let line = fibre.line(&here.pose);
    let force = bundle.response(line.length - fibre.initial_length + bundle.initial_stretch()).force;
    -line.gradient * force
}

/// Force of fibres that are longer than straight by `longer(fibre, q)`: minus the slope of the energy that this adds.
pub(super) fn wrapped(here: &Situation, structure: &str, longer: &dyn Fn(&Fibre, &Situation) -> f64) -> Six {
    let energy = |at: &Situation| -> f64 {
        let fibres = at.model.fibres.iter().filter(|f| is_of(&at.model.bundles[f.bundle].name, structure));
        fibres
            .map(|f| {
                let bundle = &at.model.bundles[f.bundle];
                let x = f.line(&at.pose).length - f.initial_length + bundle.initial_stretch();
                bundle.response(x + longer(f, at)).energy - bundle.response(x).energy
            })
            .sum()
    };
    Six::from_fn(|j, _| {
        let h = if j <= IE.index() { 1e-5 } else { 1e-3 };
        let side = |s: f64| {
            let mut q = here.q;
            q[j] += s * h;
            energy(&here.place.situation(here.model, here.trial, &here.load, &q))
        };
        -(side(1.0) - side(-1.0)) / (2.0 * h)
    })
}
