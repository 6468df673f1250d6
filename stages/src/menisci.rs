//! Menisci of a knee: sections from horn to horn between its cartilages, from a segmentation or from the literature's sizes.

mod atlas;
mod sizes;

use crate::{PerCartilage, StageError};
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use serde::{Deserialize, Serialize};
use sim::spec::{HornSpec, MeniscusMaterial, MeniscusSpec};
use sizes::SIZES;

/// Whether menisci act in the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Menisci {
    /// None act.
    #[default]
    Off,
    /// They act, with shapes of the literature's sizes.
    On,
}

/// Rigid wedges of a meniscus.
const WEDGES: usize = 12;

/// A compartment of the tibia.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compartment {
    /// Medial.
    Medial,
    /// Lateral.
    Lateral,
}

/// What a meniscus lies between.
pub(crate) struct Between<'a> {
    /// The femoral cartilage's articular face.
    pub(crate) femur: &'a TriMesh,
    /// The tibial one's.
    pub(crate) tibia: &'a TriMesh,
    /// The tibial frame.
    pub(crate) frame: &'a AnatomicalFrame,
    /// Which compartment.
    pub(crate) compartment: Compartment,
}

impl Between<'_> {
    /// Away from the middle of the knee.
    fn outwards(&self) -> Vector {
        if self.compartment == Compartment::Medial { self.frame.medial } else { -self.frame.medial }
    }

    /// The meniscus' name.
    fn name(&self) -> &'static str {
        if self.compartment == Compartment::Medial { "meniscus_medial" } else { "meniscus_lateral" }
    }

    /// A root, by its place in front of and medial of the compartment's eminence [mm].
    fn root(&self, [anterior, medial]: [f64; 2]) -> Point {
        self.frame.origin
            + self.outwards() * SIZES.tibia.eminence_mm
            + self.frame.anterior * anterior
            + self.frame.medial * medial
    }
}

/// Both menisci of a knee, and a warning for one that has no room; `contact` are the articular faces, `slope` is that of the contact law [MPa/mm].
///
/// Errors: cartilages that do not lie over one another.
pub fn menisci(
    contact: &PerCartilage<TriMesh>,
    frame: &AnatomicalFrame,
    slope: f64,
) -> Result<Vec<MeniscusSpec>, StageError> {
    let both = [(Compartment::Medial, &contact.tibia_medial), (Compartment::Lateral, &contact.tibia_lateral)];
    both.map(|(compartment, tibia)| meniscus(&Between { femur: &contact.femur, tibia, frame, compartment }, slope))
        .into_iter()
        .collect()
}

fn meniscus(between: &Between, slope: f64) -> Result<MeniscusSpec, StageError> {
    let size = SIZES.of(between.compartment);
    let roots = [size.anterior_root_mm, size.posterior_root_mm].map(|place| between.root(place));
    let sections = atlas::sections(between, size, roots)?;
    let m = &SIZES.material;
    let up = between.frame.superior;
    // a root lies as high as the face of the horn that it holds
    let horn = |root: Point, end: &sim::spec::SectionSpec| {
        let last = end.lower[end.lower.len() / 2];
        HornSpec { tibia: root + up * (last - root).dot(&up), stiffness_n_per_mm: m.horn_n_per_mm }
    };
    let tibia = if between.compartment == Compartment::Medial { "tibia_medial" } else { "tibia_lateral" };
    Ok(MeniscusSpec {
        name: between.name().into(),
        femur: "contact/femur.ply".into(),
        tibia: format!("contact/{tibia}.ply"),
        source: "atlas".into(),
        wedges: WEDGES,
        material: MeniscusMaterial {
            circumferential_modulus_mpa: m.circumferential_modulus_mpa,
            transverse_modulus_mpa: m.transverse_modulus_mpa,
            shear_modulus_mpa: m.shear_modulus_mpa,
            // the law is that of two layers in series
            cartilage_mpa_per_mm: 2.0 * slope,
        },
        anterior_horn: horn(roots[0], &sections[0]),
        posterior_horn: horn(roots[1], &sections[sections.len() - 1]),
        periphery_n_per_mm2: m.periphery_n_per_mm2,
        sections,
    })
}

#[cfg(test)]
mod tests;
