//! Menisci of a knee: sections from horn to horn between its cartilages, from a segmentation or from the literature's sizes.

mod atlas;
mod centreline;
mod lying;
mod segmented;
mod sizes;

use crate::{PerCartilage, StageError};
use atlas::Plateau;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::spec::{HornSpec, MeniscusMaterial, MeniscusSpec, SectionSpec};
use sizes::SIZES;
use std::collections::BTreeMap;

/// Whether menisci act in the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Menisci {
    /// None act.
    #[default]
    Off,
    /// They act, shaped as a segmentation shows them; one that it does not show, by the atlas.
    On,
    /// They act, shaped by the atlas: the literature's sizes fitted to this knee.
    Atlas,
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

/// A law of contact begins where its pressure passes this share of its last one [-]: decks lead in with rows of next to nothing.
const BEGINS: f64 = 0.01;

/// Slope with which a table of pressure [MPa] over overclosure [mm] begins [MPa/mm].
pub fn first_slope(overclosure_mm: &[f64], pressure_mpa: &[f64]) -> f64 {
    let last = pressure_mpa.last().copied().unwrap_or(0.0);
    let n = pressure_mpa.iter().position(|p| *p > BEGINS * last).unwrap_or(0).max(1);
    match (overclosure_mm.get(n - 1..=n), pressure_mpa.get(n - 1..=n)) {
        (Some([a, b]), Some([p, q])) => (q - p) / (b - a),
        _ => 0.0,
    }
}

/// The menisci of a knee.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laid {
    /// Medial, lateral.
    pub menisci: Vec<MeniscusSpec>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// Of each.
    pub metrics: Vec<MeniscusMetrics>,
}

/// Shape of a meniscus, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeniscusMetrics {
    /// Its name.
    pub name: String,
    /// Where its shape is from: "segmentation", or "atlas".
    pub source: String,
    /// Volume [mm3].
    pub volume_mm3: f64,
    /// Volume of the segmented body [mm3].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmented_mm3: Option<f64>,
    /// Mean width of the anterior, the middle and the posterior third of its sections [mm].
    pub width_mm: [f64; 3],
    /// Mean height of their periphery [mm].
    pub height_mm: [f64; 3],
    /// Share of its plateau's cartilage that lies under it, seen from above [-].
    pub coverage: f64,
    /// How far its body stands out over the rim of that cartilage [mm]; negative where it ends within. None where its body does not lie there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extrusion_mm: Option<f64>,
}

/// Volume that differs by more than this share from that of the segmented body is told [-].
const VOLUME_SHARE: f64 = 0.25;
/// A horn that ends further than this from where the literature has its root is told [mm].
const ROOT_OFF_MM: f64 = 15.0;

/// Both menisci of a knee; `contact` are the articular faces, `slope` is that of the contact law [MPa/mm], `bodies` are segmented ones by name, closed, in
/// CT coordinates. One without a body is shaped by the atlas.
///
/// Errors: cartilages that do not lie over one another, a body that is no meniscus.
pub fn menisci(
    contact: &PerCartilage<TriMesh>,
    frame: &AnatomicalFrame,
    slope: f64,
    bodies: &BTreeMap<String, TriMesh>,
) -> Result<Laid, StageError> {
    let mut laid = Laid::default();
    for (compartment, tibia) in
        [(Compartment::Medial, &contact.tibia_medial), (Compartment::Lateral, &contact.tibia_lateral)]
    {
        meniscus(&Between { femur: &contact.femur, tibia, frame, compartment }, slope, bodies, &mut laid)?;
    }
    Ok(laid)
}

fn meniscus(
    between: &Between,
    slope: f64,
    bodies: &BTreeMap<String, TriMesh>,
    laid: &mut Laid,
) -> Result<(), StageError> {
    let size = SIZES.of(between.compartment);
    let of_atlas = [size.anterior_root_mm, size.posterior_root_mm].map(|place| between.root(place));
    let plateau = Plateau::new(between)?;
    let body = bodies.get(between.name());
    let (sections, roots) = match body {
        Some(body) => {
            let own = segmented::own(between, &plateau, body)?;
            laid.warnings.extend(odd_roots(between, &own.roots, &of_atlas));
            (own.sections, own.roots)
        }
        None => (atlas::sections(&plateau, size, of_atlas), of_atlas),
    };
    let spec = spec(between, body.is_some(), slope, roots, sections);
    let metrics = metrics(&spec, body, between);
    laid.warnings.extend(odd_volume(&metrics));
    laid.menisci.push(spec);
    laid.metrics.push(metrics);
    Ok(())
}

/// What is told of horns that end elsewhere than the literature has it.
fn odd_roots(between: &Between, roots: &[Point; 2], of_atlas: &[Point; 2]) -> Vec<Notice> {
    let up = between.frame.superior;
    let off = |n: usize| {
        let d = roots[n] - of_atlas[n];
        (d - up * d.dot(&up)).norm()
    };
    [(0, "anterior"), (1, "posterior")]
        .into_iter()
        .filter(|(n, _)| off(*n) > ROOT_OFF_MM)
        .map(|(n, which)| {
            Kind::HornFar.notice(format!(
                "{}: its {which} horn ends {:.0} mm from where the literature has its root, and is held there: check whether the segmentation is cut short",
                between.name(),
                off(n)
            )).of(between.name())
        })
        .collect()
}

/// What is told of a shape of another volume than the body's.
fn odd_volume(m: &MeniscusMetrics) -> Option<Notice> {
    let given = m.segmented_mm3?;
    ((m.volume_mm3 / given - 1.0).abs() > VOLUME_SHARE).then(|| {
        Kind::MeniscusVolume.notice(format!(
            "{}: its wedges have {:.0} mm3, the segmented body {given:.0} mm3: look for a body that is not wedge-shaped, or lies within a cartilage",
            m.name, m.volume_mm3
        )).of(&m.name)
    })
}

fn spec(between: &Between, own: bool, slope: f64, roots: [Point; 2], sections: Vec<SectionSpec>) -> MeniscusSpec {
    let m = &SIZES.material;
    let up = &between.frame.superior;
    // a root lies as high as the face of the horn that it holds
    let horn = |root: Point, end: &SectionSpec| {
        let last = end.lower[end.lower.len() / 2];
        HornSpec { tibia: root + up * (last - root).dot(up), stiffness_n_per_mm: m.horn_n_per_mm }
    };
    let tibia = if between.compartment == Compartment::Medial { "tibia_medial" } else { "tibia_lateral" };
    MeniscusSpec {
        name: between.name().into(),
        femur: "contact/femur.ply".into(),
        tibia: format!("contact/{tibia}.ply"),
        source: if own { "segmentation" } else { "atlas" }.into(),
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
    }
}

fn metrics(m: &MeniscusSpec, body: Option<&TriMesh>, between: &Between) -> MeniscusMetrics {
    let mesh = sim::menisci::hexahedra(m);
    let volume: f64 = (0..mesh.elements.len()).map(|e| mesh.element_volume(e)).sum();
    let thirds = |of: fn(&SectionSpec) -> f64| {
        let count = m.sections.len();
        [0, 1, 2].map(|k| {
            let third = &m.sections[count * k / 3..count * (k + 1) / 3];
            third.iter().map(of).sum::<f64>() / third.len() as f64
        })
    };
    MeniscusMetrics {
        name: m.name.clone(),
        source: m.source.clone(),
        volume_mm3: volume.abs(),
        segmented_mm3: body.map(TriMesh::volume),
        width_mm: thirds(|s| (s.lower[s.lower.len() - 1] - s.lower[0]).norm()),
        height_mm: thirds(|s| (s.upper[s.upper.len() - 1] - s.lower[s.lower.len() - 1]).norm()),
        coverage: lying::coverage(m, between),
        extrusion_mm: lying::extrusion_mm(m, between),
    }
}

#[cfg(test)]
mod tests;
