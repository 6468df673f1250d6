//! Stage 4 on the shared specimens.

#[path = "common/specimen.rs"]
mod common;

use common::{bytes, shared, specimen, surface};
use meshes::frame::{Pose, Side};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};
use stages::PerBone;
use stages::bones::{BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::ingest::Specimen;
use stages::register::{BoneRegistration, Registration};
use std::path::Path;

/// The true registration, with the residual map that goes with it.
fn true_registration(dir: &Path, specimen: &Specimen) -> Registration {
    let truth: serde_json::Value = serde_json::from_slice(&bytes(&dir.join("truth/truth.json"))).unwrap();
    let one = |name: &str, ct: &TriMesh, scan: &TriMesh| {
        let m = |r: usize, c: usize| truth["scan_to_ct"][name][r][c].as_f64().unwrap();
        let rotation = Rotation3::from_matrix(&Matrix3::from_fn(m));
        let motion = Isometry::from_parts(
            Translation3::new(m(0, 3), m(1, 3), m(2, 3)),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        let query = SurfaceQuery::new(ct).unwrap();
        let residual_mm: Vec<f64> = scan.vertices.iter().map(|p| query.signed_distance(&(motion * p))).collect();
        BoneRegistration {
            ct_from_scan: Pose::assume(motion),
            rms_bare_bone_mm: 0.1,
            inlier_fraction: 1.0,
            held_out_rms_mm: 0.1,
            predicted_error_mm: 0.0,
            bare_bone: residual_mm.iter().map(|r| r.abs() < 0.4).collect(),
            residual_mm,
        }
    };
    Registration {
        bones: PerBone {
            femur: one("femur", &specimen.ct.femur, &specimen.scans.femur.mesh),
            tibfib: one("tibfib", &specimen.ct.tibfib, &specimen.scans.tibfib.mesh),
        },
        warnings: Vec::new(),
        metrics: serde_json::Value::Null,
    }
}

fn build(specimen: &Specimen, registration: &Registration) -> Cartilage {
    let bones = bones(specimen, &BonesOptions::default()).unwrap();
    cartilage(specimen, registration, &bones, &CartilageOptions::default()).unwrap()
}

/// Volume error [percent] and 95th percentile of the distance from the true surface [mm].
fn errors(made: &TriMesh, truth: &TriMesh) -> (f64, f64) {
    let query = SurfaceQuery::new(made).unwrap();
    let mut samples: Vec<(f64, f64)> = (0..truth.triangles.len())
        .map(|t| {
            let centre = Point::from(truth.corners(t).iter().map(|p| p.coords).sum::<Vector>() / 3.0);
            (query.nearest(&centre).distance, truth.area_vector(t).norm())
        })
        .collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = samples.iter().map(|s| s.1).sum();
    let mut sum = 0.0;
    let p95 = samples
        .iter()
        .find(|s| {
            sum += s.1;
            sum >= 0.95 * total
        })
        .unwrap()
        .0;
    (100.0 * (made.volume() / truth.volume() - 1.0), p95)
}

#[test]
fn solids_are_closed_single_and_near_the_truth() {
    for id in ["S192803", "S193761"] {
        let Some(dir) = shared("cartilage of specimens", &format!("specimens/{id}")) else { return };
        let specimen = specimen(&dir, Side::Left);
        let made = build(&specimen, &true_registration(&dir, &specimen));
        for (name, part) in made.solids.named() {
            let file = if name == "femur" { "femur".into() } else { name.replace("tibia", "tibfib") };
            let truth = surface(&dir.join(format!("truth/{file}.stl")));
            let topology = Topology::of(&part.solid);
            assert!(topology.is_closed() && topology.components == 1);
            let (volume, distance) = errors(&part.solid, &truth);
            assert!(volume.abs() < if name == "femur" { 3.5 } else { 7.0 }, "{id} {name}: volume off {volume:.2} %");
            assert!(distance < 0.45, "{id} {name}: surface distance p95 {distance:.3} mm");
        }
    }
}
