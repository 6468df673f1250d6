//! Stage 9, assemble: everything a simulation needs, in one specification.

mod uncertainty;

use crate::attachments::Attachments;
use crate::bones::Bones;
use crate::cartilage::Cartilage;
use crate::frames::Frames;
use crate::menisci::{Laid, Menisci, MeniscusMetrics, first_slope, menisci};
use crate::overclosure::Separated;
use crate::patellofemoral::{PatellaChoice, PatellaMetrics, PatellaOptions, Patellofemoral, patellofemoral};
use crate::specimen::Specimen;
use crate::{PerCartilage, StageError};
use attachments::bundle::{BUNDLES, Bundle};
use meshes::hex::HexMesh;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::mesh::MeshValue;
use sim::names::is_of;
use sim::spec::{
    BodySpec, BundleSpec, ContactSpec, FibreSpec, FramesSpec, Law, LayerLaw, LayerSpec, ModelSpec, PairSpec, PoseSpec,
    Units, WrapSpec,
};
use std::collections::BTreeMap;

/// Options of the stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssembleOptions {
    /// Overclosures of the contact law, ascending [mm]; the published law of S192803 [andreassen2025].
    pub overclosure_mm: Vec<f64>,
    /// Pressures at them [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Coulomb friction of cartilage on cartilage [-] [andreassen2025].
    pub friction: f64,
    /// Contact damping, fraction of critical [-] [andreassen2025].
    pub contact_damping: f64,
    /// Toe strain of every bundle [-] [blankevoort1991].
    pub toe_strain: f64,
    /// Force law of every bundle.
    pub law: Law,
    /// Mass of the moving body in explicit dynamics [tonne]; numerical, as in the published decks.
    pub mass_tonne: f64,
    /// Rotary inertia of the moving body in explicit dynamics [tonne mm2]; numerical, as in the published decks.
    pub inertia_tonne_mm2: f64,
    /// Whether contact is by the cartilages' own thickness in place of the table; stage contact-law sets it where that fits better.
    pub by_thickness: bool,
    /// The layers of contact by thickness.
    pub layer: LayerMaterial,
    /// Ligaments or bundles that wrap over femur and tibia in place of running straight through them, or "all"; none: every fibre is straight.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wrap: Vec<String>,
    /// Whether menisci act in the model: off, on (the knee's own where segmented, else the atlas') or atlas.
    pub menisci: Menisci,
    /// Which patella acts: off, on (the knee's own) or generic.
    pub patella: PatellaChoice,
    /// Numbers of the patellofemoral joint.
    pub patellofemoral: PatellaOptions,
}

/// Cartilage as thin elastic layers bonded to bone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayerMaterial {
    /// Pressure over strain.
    pub law: LayerLaw,
    /// Young's modulus [MPa] [andreassen2025].
    pub youngs_modulus_mpa: f64,
    /// Poisson's ratio [-] [andreassen2025].
    pub poissons_ratio: f64,
    /// How far in from a patch's edge cartilage gives way sideways, in thicknesses [-]; what fits the phantoms with this material.
    pub edge_spread: f64,
    /// A layer is nowhere taken thinner than this [mm]: about what the thickness is known to, and hexmesh.min_thickness_mm.
    pub least_thickness_mm: f64,
}

impl Default for LayerMaterial {
    fn default() -> Self {
        LayerMaterial {
            law: LayerLaw::Linear,
            youngs_modulus_mpa: 12.0,
            poissons_ratio: 0.45,
            edge_spread: 0.6,
            least_thickness_mm: 0.5,
        }
    }
}

impl LayerMaterial {
    /// As model.json has it; `bony_faces` by articular mesh.
    pub(crate) fn spec(&self, bony_faces: BTreeMap<String, String>) -> LayerSpec {
        LayerSpec {
            law: self.law,
            youngs_modulus_mpa: self.youngs_modulus_mpa,
            poissons_ratio: self.poissons_ratio,
            edge_spread: self.edge_spread,
            least_thickness_mm: self.least_thickness_mm,
            bony_faces,
        }
    }
}

impl Default for AssembleOptions {
    fn default() -> Self {
        AssembleOptions {
            overclosure_mm: vec![0.0, 0.05, 0.1, 0.2],
            pressure_mpa: vec![0.0, 0.323_340_3, 0.646_680_6, 1.339_037_9],
            friction: 0.03,
            contact_damping: 0.001,
            toe_strain: 0.03,
            law: Law::Smooth,
            mass_tonne: 1e-5,
            inertia_tonne_mm2: 0.1,
            by_thickness: false,
            layer: LayerMaterial::default(),
            wrap: Vec::new(),
            menisci: Menisci::Off,
            patella: PatellaChoice::Off,
            patellofemoral: PatellaOptions::default(),
        }
    }
}

/// The model specification and the contact surfaces it names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assembled {
    /// model.json; mesh paths as the build lays its folders out, relative to 09-assemble.
    pub spec: ModelSpec,
    /// Articular faces as triangles, outward normals, open patches, CT frame.
    pub contact: PerCartilage<TriMesh>,
    /// Their faces on bone, where the contact is by thickness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bony: Option<PerCartilage<TriMesh>>,
    /// The patella, where one acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patella: Option<Patellofemoral>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: AssembleMetrics,
}

/// Counts of the model's parts, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AssembleMetrics {
    /// Bundles.
    pub bundles: usize,
    /// Fibres.
    pub fibres: usize,
    /// Triangles of each contact surface.
    pub contact_triangles: Vec<MeshCount>,
    /// The menisci, where they act.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub menisci: Vec<MeniscusMetrics>,
    /// How many of them are shaped by a segmentation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmented_menisci: Option<usize>,
    /// The patella, where one acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patella: Option<PatellaMetrics>,
}

/// Triangles of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshCount {
    /// Its name.
    pub mesh: String,
    /// Triangles.
    pub triangles: usize,
}

/// A contact law that was fitted to this knee's own cartilage; it stands in place of that of the options.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnLaw {
    /// Overclosures, ascending from 0 [mm].
    pub overclosure_mm: Vec<f64>,
    /// Pressures at them [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Whether contact is by the cartilages' own thickness.
    pub by_thickness: bool,
    /// The layers of contact by thickness, where they were fitted.
    pub layer: Option<LayerMaterial>,
}

/// The options with a law of this knee's own.
fn with_law(options: &AssembleOptions, law: OwnLaw) -> AssembleOptions {
    AssembleOptions {
        overclosure_mm: law.overclosure_mm,
        pressure_mpa: law.pressure_mpa,
        by_thickness: law.by_thickness,
        layer: law.layer.unwrap_or_else(|| options.layer.clone()),
        ..options.clone()
    }
}

/// Assembles the model. `law` is the contact law that was fitted to this knee; where it is none, that of the options stands.
pub fn assemble(
    (specimen, bones, cartilage): (&Specimen, &Bones, &Cartilage),
    frames: &Frames,
    attachments: &Attachments,
    separated: &Separated,
    law: Option<OwnLaw>,
    options: &AssembleOptions,
) -> Result<Assembled, StageError> {
    let own_law = law.is_some();
    let options = &law.map_or_else(|| options.clone(), |law| with_law(options, law));
    check(specimen, options)?;
    let contact = PerCartilage {
        femur: articular_face(&separated.meshes.femur),
        tibia_medial: articular_face(&separated.meshes.tibia_medial),
        tibia_lateral: articular_face(&separated.meshes.tibia_lateral),
    };
    let bony = options.by_thickness.then(|| PerCartilage {
        femur: bony_face(&separated.meshes.femur),
        tibia_medial: bony_face(&separated.meshes.tibia_medial),
        tibia_lateral: bony_face(&separated.meshes.tibia_lateral),
    });
    let patella = patellofemoral(
        options.patella,
        (specimen, frames, bones),
        (cartilage, &contact.femur),
        (&options.overclosure_mm, &options.pressure_mpa),
        &options.patellofemoral,
    )?;
    let (bundles, mut warnings) = bundles(specimen, attachments, options);
    warnings.extend(patella.iter().flat_map(|p| p.warnings.clone()));
    let fibres = attachments
        .fibres
        .iter()
        .map(|f| FibreSpec { bundle: f.bundle.clone(), femur: f.femur, tibia: f.tibia })
        .collect::<Vec<_>>();
    let slope = first_slope(&options.overclosure_mm, &options.pressure_mpa);
    let laid = match options.menisci {
        Menisci::Off => Laid::default(),
        Menisci::On => menisci(&contact, &frames.tibia, slope, &cartilage.bodies)?,
        Menisci::Atlas => menisci(&contact, &frames.tibia, slope, &BTreeMap::new())?,
    };
    warnings.extend(laid.warnings);
    let count = |(name, m): (&str, &TriMesh)| MeshCount { mesh: name.to_owned(), triangles: m.triangles.len() };
    let metrics = AssembleMetrics {
        bundles: bundles.len(),
        fibres: fibres.len(),
        contact_triangles: contact.named().map(count).to_vec(),
        segmented_menisci: (!laid.metrics.is_empty())
            .then(|| laid.metrics.iter().filter(|m| m.segmented_mm3.is_some()).count()),
        menisci: laid.metrics,
        patella: patella.as_ref().map(|p| p.metrics.clone()),
    };
    let wrap = wrap_spec(&bundles, options);
    let wraps = |w: &&Notice| w.kind != Kind::ThroughBone || wrap.is_none();
    let mut spec = ModelSpec {
        schema: "model/1".into(),
        id: specimen.identity.id.clone(),
        side: specimen.identity.side,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames: frames_spec(frames),
        bodies: bodies(specimen, patella.as_ref(), options),
        contact: contact_spec(options),
        bundles,
        fibres,
        wrap: wrap.clone(),
        menisci: laid.menisci,
        toe_end_multiple: Default::default(),
        protocols: Vec::new(),
        components: Vec::new(),
        calibrated: None,
        uncertainty: Some(uncertainty::uncertainty(specimen, attachments, own_law)),
        patella: patella.as_ref().map(|p| p.spec.clone()),
        warnings: warnings.iter().chain(attachments.warnings.iter().filter(wraps)).map(|w| w.text.clone()).collect(),
    };
    if wrap.is_some() {
        measure_wrapped(&mut spec, bones)?;
    }
    Ok(Assembled { spec, contact, bony, patella, warnings, metrics })
}

/// Which bundles wrap: those whose own name or whose ligament's is among the options'.
fn wrap_spec(bundles: &[BundleSpec], options: &AssembleOptions) -> Option<WrapSpec> {
    let wraps = |b: &&BundleSpec| options.wrap.iter().any(|name| is_named(&b.name, name));
    let bundles: Vec<String> = bundles.iter().filter(wraps).map(|b| b.name.clone()).collect();
    (!bundles.is_empty()).then(|| WrapSpec { over: ["femur", "tibia"].map(str::to_owned).to_vec(), bundles })
}

/// Whether a bundle is meant by its name, its ligament's or "all".
fn is_named(bundle: &str, name: &str) -> bool {
    name == ALL || is_of(bundle, name)
}

/// The name of all bundles in `wrap`.
const ALL: &str = "all";

/// Gives bundles that wrap the mean length of their fibres' paths in CT, so that a reference strain means what it means of a straight one.
fn measure_wrapped(spec: &mut ModelSpec, bones: &Bones) -> Result<(), StageError> {
    let mesh = |(name, mesh): (&str, &TriMesh)| (format!("../03-bones/{name}.ply"), MeshValue::Surface(mesh.clone()));
    let meshes: BTreeMap<String, MeshValue> = bones.surfaces.named().map(mesh).into_iter().collect();
    let lengths = sim::ligament::lengths(spec, &meshes).map_err(|e| StageError::Knee(e.to_string()))?;
    for bundle in &mut spec.bundles {
        let of = |(f, l): (&FibreSpec, &f64)| (f.bundle == bundle.name).then_some(*l);
        let own: Vec<f64> = spec.fibres.iter().zip(&lengths).filter_map(of).collect();
        bundle.reference_length_mm = own.iter().sum::<f64>() / own.len().max(1) as f64;
    }
    Ok(())
}

fn check(specimen: &Specimen, options: &AssembleOptions) -> Result<(), StageError> {
    if let Some(name) = specimen.ligaments.keys().find(|n| BUNDLES.iter().all(|b| b.name != **n)) {
        let known = BUNDLES.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(StageError::Knee(format!(
            "specimen.toml [ligaments.{name}]: no such bundle; one of {known} was expected"
        )));
    }
    check_options(options)
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check_options(options: &AssembleOptions) -> Result<(), StageError> {
    let (x, p) = (&options.overclosure_mm, &options.pressure_mpa);
    let ascending = x.windows(2).all(|w| w[0] < w[1]) && p.windows(2).all(|w| w[0] <= w[1]);
    if x.len() < 2 || x.len() != p.len() || !ascending || x.iter().chain(p).any(|v| !v.is_finite()) {
        return Err(StageError::Knee(
            "assemble.overclosure_mm and assemble.pressure_mpa: two equally long ascending lists were expected".into(),
        ));
    }
    if let Some(name) = options.wrap.iter().find(|n| !BUNDLES.iter().any(|b| is_named(&b.name, n))) {
        let known = BUNDLES.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(StageError::Knee(format!(
            "assemble.wrap names {name:?}; \"{ALL}\" or some of {known} were expected"
        )));
    }
    Ok(())
}

/// The articular quadrilaterals, each split along its shorter diagonal.
pub fn articular_face(mesh: &HexMesh) -> TriMesh {
    face(mesh, &mesh.articular_quads)
}

/// The quadrilaterals on bone, likewise.
pub fn bony_face(mesh: &HexMesh) -> TriMesh {
    face(mesh, &mesh.bony_quads)
}

fn face(mesh: &HexMesh, quads: &[[u32; 4]]) -> TriMesh {
    let length = |a: u32, b: u32| (mesh.nodes[a as usize] - mesh.nodes[b as usize]).norm();
    let triangles = quads
        .iter()
        .flat_map(
            |&[a, b, c, d]| {
                if length(a, c) <= length(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
            },
        )
        .collect();
    TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true).0
}

fn bundles(
    specimen: &Specimen,
    attachments: &Attachments,
    options: &AssembleOptions,
) -> (Vec<BundleSpec>, Vec<Notice>) {
    let mut warnings = Vec::new();
    let mut specs = Vec::new();
    for bundle in BUNDLES.iter() {
        let lengths: Vec<f64> =
            attachments.fibres.iter().filter(|f| f.bundle == bundle.name).map(|f| (f.femur - f.tibia).norm()).collect();
        if lengths.is_empty() {
            warnings.push(
                Kind::BundleLeftOut
                    .notice(format!("bundle {} is left out: it has no fibre", bundle.name))
                    .of(&bundle.name),
            );
            continue;
        }
        specs.push(bundle_spec(bundle, &lengths, specimen, options));
    }
    (specs, warnings)
}

fn bundle_spec(bundle: &Bundle, lengths: &[f64], specimen: &Specimen, options: &AssembleOptions) -> BundleSpec {
    let start = specimen.ligaments.get(&bundle.name).copied().unwrap_or_default();
    BundleSpec {
        name: bundle.name.clone(),
        reference_strain: start.reference_strain.unwrap_or(bundle.reference_strain.middle()),
        stiffness_n_per_mm: start.stiffness_n_per_mm.unwrap_or(bundle.stiffness_n_per_mm.middle()),
        reference_length_mm: lengths.iter().sum::<f64>() / lengths.len() as f64,
        toe_strain: options.toe_strain,
        damping_n_s_per_mm: sim::spec::fibre_damping(),
        law: options.law,
    }
}

pub(crate) fn frames_spec(frames: &Frames) -> FramesSpec {
    let gs = &frames.gs_ct_pose;
    FramesSpec {
        femur: frames.femur,
        tibia: frames.tibia,
        gs_ct_pose: PoseSpec {
            fe_deg: gs.fe_deg,
            vv_deg: gs.vv_deg,
            ie_deg: gs.ie_deg,
            ml_mm: gs.ml_mm,
            ap_mm: gs.ap_mm,
            si_mm: gs.si_mm,
        },
        chain: None,
        grid: None,
    }
}

fn bodies(specimen: &Specimen, patella: Option<&Patellofemoral>, options: &AssembleOptions) -> Vec<BodySpec> {
    let body = |name: &str, bone: &str, cartilage: &[&str]| BodySpec {
        name: name.into(),
        bone: format!("../03-bones/{bone}.ply"),
        cartilage: cartilage.iter().map(|c| format!("../08-overclosure/{c}.vtu")).collect(),
        mass_tonne: options.mass_tonne,
        inertia_tonne_mm2: options.inertia_tonne_mm2,
    };
    let mut bodies =
        vec![body("femur", "femur", &["femur"]), body("tibia", "tibfib", &["tibia_medial", "tibia_lateral"])];
    bodies.extend(specimen.patella.is_some().then(|| body("patella", "patella", &[])));
    if specimen.patella.is_none() && patella.is_some_and(|p| p.seen.is_some()) {
        bodies.push(BodySpec { bone: "contact/patella_seen.ply".into(), ..body("patella", "patella", &[]) });
    }
    let carried = specimen.mri.iter().flat_map(|m| m.bodies.keys());
    bodies
        .extend(carried.map(|name| BodySpec { bone: format!("../04-cartilage/{name}.ply"), ..body(name, name, &[]) }));
    bodies
}

fn contact_spec(options: &AssembleOptions) -> ContactSpec {
    let pair = |tibia: &str| PairSpec { femur: "contact/femur.ply".into(), tibia: format!("contact/{tibia}.ply") };
    ContactSpec {
        overclosure_mm: options.overclosure_mm.clone(),
        pressure_mpa: options.pressure_mpa.clone(),
        friction: options.friction,
        damping: options.contact_damping,
        layer: options.by_thickness.then(|| {
            let bony = |name: &str| (format!("contact/{name}.ply"), format!("contact/{name}_bony.ply"));
            options.layer.spec(["femur", "tibia_medial", "tibia_lateral"].map(bony).into())
        }),
        pairs: vec![pair("tibia_medial"), pair("tibia_lateral")],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Point;

    #[test]
    fn the_articular_face_keeps_area_and_drops_other_nodes() {
        let mut nodes: Vec<Point> = (0..4).map(|i| Point::new(f64::from(i % 2), f64::from(i / 2), -1.0)).collect();
        nodes.extend((0..4).map(|i| Point::new(f64::from(i % 2), f64::from(i / 2), 0.0)));
        let mesh = HexMesh { nodes, articular_quads: vec![[4, 5, 7, 6]], ..HexMesh::default() };
        let face = articular_face(&mesh);
        assert_eq!(face.vertices.len(), 4);
        assert!((face.area() - 1.0).abs() < 1e-12);
        assert!(face.triangle_normals().iter().all(|n| n.z > 0.99));
    }
}
