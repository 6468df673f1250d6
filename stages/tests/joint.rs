//! Stages 7 to 9 on a phantom's cartilage as a build has it: hexahedra, their separation, the model.
#![allow(clippy::unwrap_used, reason = "tests")]

use meshes::hex::HexMesh;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use sim::coordinate::{SI, Six};
use sim::mesh::MeshValue;
use stages::assemble::{AssembleOptions, Assembled, articular_face, assemble};
use stages::attachments::{Attachments, AttachmentsOptions, attachments};
use stages::bones::{Bones, BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::frames::{Frames, FramesOptions, frames};
use stages::hexmesh::{HexCartilage, HexmeshOptions, hexmesh, quality};
use stages::overclosure::{OverclosureOptions, Separated, overclosure};
use stages::register::{RegisterOptions, register};
use stages::specimen::Specimen;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A phantom through stages 1 to 8.
struct Built {
    specimen: Specimen,
    bones: Bones,
    cartilage: Cartilage,
    frames: Frames,
    attachments: Attachments,
    hexes: HexCartilage,
    apart: Separated,
}

impl Built {
    fn new(specimen: Specimen) -> Built {
        let registration = register(&specimen, &RegisterOptions::default()).unwrap();
        let bones = bones(&specimen, &BonesOptions::default()).unwrap();
        let cartilage = cartilage(&specimen, &registration, &bones, &CartilageOptions::default()).unwrap();
        let frames = frames(&specimen, &bones, &FramesOptions::default()).unwrap();
        let options = AttachmentsOptions::default();
        let attachments = attachments(&specimen, &registration, &bones, &cartilage, &frames, &options).unwrap();
        let hexes = hexmesh(&cartilage, &HexmeshOptions::default()).unwrap();
        let apart = overclosure(&hexes, &OverclosureOptions::default()).unwrap();
        Built { specimen, bones, cartilage, frames, attachments, hexes, apart }
    }

    fn model(&self) -> Assembled {
        let knee = (&self.specimen, &self.bones, &self.cartilage);
        let options = AssembleOptions::default();
        assemble(knee, &self.frames, &self.attachments, &self.apart, None, &options).unwrap()
    }
}

/// Made once: some seconds of processor.
fn built() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| Built::new(crate::frames::phantom("S192803-phantom")))
}

/// Faces of elements that no other element shares, as triangles.
fn hull(mesh: &HexMesh) -> TriMesh {
    let mut faces: BTreeMap<[u32; 4], Vec<[u32; 4]>> = BTreeMap::new();
    for element in &mesh.elements {
        for corners in meshes::hex::FACES {
            let face = corners.map(|k| element[k]);
            let mut key = face;
            key.sort_unstable();
            faces.entry(key).or_default().push(face);
        }
    }
    assert!(faces.values().all(|f| f.len() <= 2), "three elements share a face");
    let outer = faces.values().filter(|f| f.len() == 1).map(|f| f[0]);
    let triangles = outer.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: mesh.nodes.clone(), triangles }
}

/// Fails where a quadrilateral folds over a rim, elements do not share their faces, or a face leaves the solid.
#[test]
fn hexahedra_of_a_phantom_are_upright_closed_and_fill_its_cartilage() {
    let knee = built();
    for ((name, mesh), (_, part)) in knee.hexes.meshes.named().into_iter().zip(knee.cartilage.solids.named()) {
        let (hull, shape) = (hull(mesh), quality(mesh));
        let topology = Topology::of(&hull);
        assert!(topology.is_closed() && topology.components == 1, "{name}: {} pieces", topology.components);
        assert!(shape.inverted == 0 && shape.scaled_jacobian_min.unwrap() > 0.3, "{name}: {shape:?}");
        assert!(shape.scaled_jacobian_p05.unwrap() > 0.75 && shape.scaled_jacobian_mean > 0.92, "{name}: {shape:?}");
        let share = hull.volume() / part.solid.volume();
        assert!((0.95..1.005).contains(&share), "{name}: {share} of the volume");
        let solid = SurfaceQuery::new(&part.solid).unwrap();
        let off = |n: &u32| solid.nearest(&mesh.nodes[*n as usize]).distance;
        let most = mesh.bony_nodes.iter().chain(&mesh.articular_nodes).map(off).fold(0.0, f64::max);
        assert!(most < 1e-6, "{name}: a node lies {most} mm off the solid");
    }
}

/// Farther than this from the other bone's cartilage nothing overlaps, and nothing moves [mm]: five widths of the kernel.
const FAR_MM: f64 = 5.0;

/// Fails where the kernel reaches what does not overlap, a bony face lifts without need, or a gap is measured at nodes alone.
#[test]
fn cartilages_of_a_phantom_come_apart_and_nothing_else_moves() {
    let knee = built();
    let metrics = &knee.apart.metrics;
    assert!(metrics.max_overclosure_before_mm > 0.03, "the cartilages did not overlap: {metrics:?}");
    assert!(metrics.max_overclosure_after_mm == 0.0 && metrics.gap_min_mm.unwrap() >= 0.05, "{metrics:?}");
    assert_eq!(metrics.largest_bony_lift_mm, 0.0);
    let (before, after) = (&knee.hexes.meshes, &knee.apart.meshes);
    let face = |mesh: &HexMesh| SurfaceQuery::new(&articular_face(mesh)).unwrap();
    let tibia = [face(&before.tibia_medial), face(&before.tibia_lateral)];
    let femur = [face(&before.femur)];
    for ((name, old), (_, new)) in before.named().into_iter().zip(after.named()) {
        assert_eq!(old.elements, new.elements);
        assert!(old.bony_nodes.iter().all(|&n| old.nodes[n as usize] == new.nodes[n as usize]), "{name}");
        let others = if name == "femur" { &tibia[..] } else { &femur[..] };
        let moved = old.nodes.iter().zip(&new.nodes).filter(|(a, b)| (*a - *b).norm() > 1e-6);
        let moved: Vec<_> = moved.map(|(a, _)| a).collect();
        assert!(!moved.is_empty(), "{name}: nothing moved");
        let away = |p: &&meshes::Point| others.iter().all(|other| other.nearest(p).distance > FAR_MM);
        assert!(!moved.iter().any(away), "{name}: what lies apart moved");
    }
    // what is apart stays
    let again = HexCartilage { meshes: after.clone(), warnings: Vec::new(), metrics: Default::default() };
    let twice = overclosure(&again, &OverclosureOptions::default()).unwrap();
    assert!(twice.meshes == *after && twice.metrics.iterations == 0, "{:?}", twice.metrics);
}

/// Fails where a bundle loses a fibre, its length is of something else, a face is turned over or a frame is of another bone.
#[test]
fn the_model_of_a_phantom_has_its_fibres_and_touches_nowhere_before_it_is_pressed() {
    let knee = built();
    let made = knee.model();
    let spec = &made.spec;
    assert_eq!((spec.fibres.len(), spec.bundles.len()), (knee.attachments.fibres.len(), 14));
    for bundle in &spec.bundles {
        let own = spec.fibres.iter().filter(|f| f.bundle == bundle.name).map(|f| (f.femur - f.tibia).norm());
        let own: Vec<f64> = own.collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        assert!((bundle.reference_length_mm - mean).abs() < 1e-9, "{}: {own:?}", bundle.name);
    }
    let surfaces = made.contact.named().map(|(name, mesh)| (format!("contact/{name}.ply"), mesh));
    let meshes = surfaces.map(|(name, mesh)| (name, MeshValue::Surface(mesh.clone()))).into_iter().collect();
    let model = sim::compile(spec, &meshes).unwrap();
    let pose = model.joint.ct_pose();
    assert!((pose[SI] - knee.frames.gs_ct_pose.si_mm).abs() < 1e-6, "{pose}");
    // no gap is below 0.05 mm in CT; moved by more, one way presses and the other does not
    let presses = |by: f64| {
        // coordinates are counted from the CT pose
        let mut q = Six::zeros();
        q[SI] = by;
        model.evaluate(&q).contact.gradient.norm()
    };
    assert!(presses(0.0) < 1.0, "{} N", presses(0.0));
    let [one, other] = [0.5, -0.5].map(presses);
    assert!(one.max(other) > 10.0 && one.min(other) == 0.0, "{one} N, {other} N");
}
