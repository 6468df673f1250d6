//! Nodal masses and the stable increment.

use super::element::Element;
use super::law::Material;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// How masses are chosen. Ends at rest do not depend on them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// As they are; the increment is the stable one.
    None,
    /// Elements, and nodes of faces, whose stable increment is shorter than this are made heavier until it is this [s].
    AtLeast(f64),
    /// Every element is made as heavy or light as gives this stable increment [s]; faces bear their penalty on top: dynamic relaxation.
    Even(f64),
}

/// What the masses are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Masses {
    /// Mass of the solids by their density [tonne].
    pub true_tonne: f64,
    /// Mass in use [tonne].
    pub used_tonne: f64,
    /// Largest factor on an element's mass [-].
    pub largest_factor: f64,
    /// Elements whose mass was changed.
    pub changed_elements: usize,
    /// Elements.
    pub elements: usize,
    /// The increment [s].
    pub increment_s: f64,
    /// Stable increment of the elements as they are, without contact [s].
    pub unscaled_increment_s: f64,
}

/// Square of the highest frequency of an element by its bound [1/s2]; `deformation` from the reference.
pub(super) fn highest_squared(element: &Element, material: &Material, deformation: &Matrix3<f64>) -> f64 {
    8.0 * element.stiffness_bound(material, deformation) / material.density_tonne_mm3
}

/// Masses under way.
pub(super) struct Weigh {
    pub(super) mass: Vec<f64>,
    /// Square of the highest frequency of all elements with their masses.
    highest: f64,
    pub(super) told: Masses,
    scaling: Scaling,
}

impl Weigh {
    pub(super) fn new(nodes: usize, scaling: Scaling) -> Weigh {
        Weigh { mass: vec![0.0; nodes], highest: 0.0, told: Masses::default(), scaling }
    }

    /// Adds an element's mass to its nodes.
    pub(super) fn element(&mut self, nodes: &[u32; 8], element: &Element, material: &Material) {
        let own = element.volume * material.density_tonne_mm3;
        let squared = highest_squared(element, material, &Matrix3::identity());
        // an increment of dt is stable where squared < 4 / dt^2
        let factor = match self.scaling {
            Scaling::None => 1.0,
            Scaling::AtLeast(dt) => (squared * dt * dt / 4.0).max(1.0),
            Scaling::Even(dt) => squared * dt * dt / 4.0,
        };
        let told = &mut self.told;
        told.true_tonne += own;
        told.used_tonne += own * factor;
        told.largest_factor = told.largest_factor.max(factor);
        told.changed_elements += usize::from((factor - 1.0).abs() > 1e-12);
        told.elements += 1;
        let dt = 2.0 / squared.sqrt();
        told.unscaled_increment_s = if told.elements == 1 { dt } else { told.unscaled_increment_s.min(dt) };
        self.highest = self.highest.max(squared / factor);
        nodes.iter().for_each(|&n| self.mass[n as usize] += own * factor / 8.0);
    }

    /// Takes the penalty of the faces into account, `stiffness` by node [N/mm], and gives the increment.
    ///
    /// A node and what it presses on are a spring between them: `k (u - sum w v)^2 <= 2 k (u^2 + sum w v^2)`, so twice the stiffness that
    /// bears on a node, both passes together, bounds its part.
    pub(super) fn increment(&mut self, stiffness: &[f64], safety: f64) -> f64 {
        let mut contact: f64 = 0.0;
        for (m, k) in self.mass.iter_mut().zip(stiffness).filter(|(_, k)| **k > 0.0) {
            if *m <= 0.0 {
                continue;
            }
            match self.scaling {
                Scaling::None => contact = contact.max(2.0 * k / *m),
                // the elements alone leave no room: faces get what their penalty asks
                Scaling::AtLeast(dt) | Scaling::Even(dt) => {
                    let add = 2.0 * k * dt * dt / 4.0;
                    *m += add;
                    self.told.used_tonne += add;
                }
            }
        }
        let dt = 2.0 / (self.highest + contact).sqrt();
        self.told.increment_s = safety * dt;
        self.told.increment_s
    }
}
