//! Registration against specimens with truth.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Translation3, UnitQuaternion};
use stages::register::{BoneRegistration, RegisterOptions, register_bone};
use std::path::{Path, PathBuf};

#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(path);
    if full.exists() {
        return Some(full);
    }
    assert!(std::env::var("GENU_SHARED").as_deref() != Ok("required"), "{test}: {} is absent", full.display());
    eprintln!("{test}: skipped, {} is absent", full.display());
    None
}

#[expect(clippy::disallowed_methods, reason = "tests read the shared data")]
fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

struct Case {
    ct: TriMesh,
    scan: ColouredMesh,
    truth: Isometry,
    pairs: Vec<(Point, Point)>,
}

fn case(dir: &Path, bone: &str) -> Case {
    let ct = meshes::format::stl::read(&bytes(&dir.join(format!("ct/{bone}.stl")))).unwrap();
    let scan = meshes::format::ply::read(&bytes(&dir.join(format!("scans/{bone}.ply")))).unwrap();
    let truth: serde_json::Value = serde_json::from_slice(&bytes(&dir.join("truth/truth.json"))).unwrap();
    let at = |r: usize, c: usize| truth["scan_to_ct"][bone][r][c].as_f64().unwrap();
    let turn = UnitQuaternion::from_matrix(&Matrix3::from_fn(at));
    let truth = Isometry::from_parts(Translation3::new(at(0, 3), at(1, 3), at(2, 3)), turn);
    let text = String::from_utf8(bytes(&dir.join("landmarks.csv"))).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|l| l.split(',').collect()).collect();
    let point = |r: &[&str]| Point::from(Vector::from_fn(|k, _| r[2 + k].parse::<f64>().unwrap()));
    let in_scan = rows.iter().filter(|r| r[1] == format!("scan_{bone}"));
    let pairs = in_scan
        .filter_map(|r| rows.iter().find(|c| c[1] == "ct" && c[0] == r[0]).map(|c| (point(r), point(c))))
        .collect();
    Case { ct, scan, truth, pairs }
}

fn moved(scan: &ColouredMesh, by: &Isometry) -> ColouredMesh {
    ColouredMesh { mesh: scan.mesh.moved(by), colours: scan.colours.clone() }
}

fn found(case: &Case, scan: &ColouredMesh, pairs: &[(Point, Point)]) -> BoneRegistration {
    register_bone(&case.ct, scan, pairs, &RegisterOptions::default()).unwrap()
}

/// Mean distance over the scan [mm] and angle [deg] between two poses.
fn apart(a: &Isometry, b: &Isometry, scan: &TriMesh) -> (f64, f64) {
    let sum: f64 = scan.vertices.iter().map(|p| (a * p - b * p).norm()).sum();
    (sum / scan.vertices.len() as f64, a.rotation.angle_to(&b.rotation).to_degrees())
}

#[test]
fn truth_is_found_with_and_without_landmarks_and_the_error_is_foreseen() {
    for id in ["S192803", "S193761"] {
        let Some(dir) = shared("register truth", &format!("specimens/{id}")) else { return };
        for bone in ["femur", "tibfib"] {
            let case = case(&dir, bone);
            for pairs in [&case.pairs[..], &[]] {
                let result = found(&case, &case.scan, pairs);
                let (error, angle) = apart(result.ct_from_scan.motion(), &case.truth, &case.scan.mesh);
                assert!(error < 0.15 && angle < 0.25, "{id} {bone}: {error} mm, {angle} deg");
                let foreseen = result.predicted_error_mm;
                assert!(error < 3.0 * foreseen && foreseen < 3.0 * error, "{id} {bone}: {error}, foreseen {foreseen}");
                assert!(result.held_out_rms_mm < 0.2 && result.inlier_fraction > 0.95);
                assert_eq!(result.residual_mm.len(), case.scan.mesh.vertices.len());
                assert_eq!(result.bare_bone.len(), case.scan.mesh.vertices.len());
            }
        }
    }
}

#[test]
fn moving_scan_and_bone_moves_the_answer_on_any_number_of_threads() {
    let Some(dir) = shared("register moved", "specimens/S192803") else { return };
    let mut case = case(&dir, "tibfib");
    let still = found(&case, &case.scan, &[]);
    let scan_motion = Isometry::new(Vector::new(300.0, -80.0, 40.0), Vector::new(2.0, 0.5, -1.3));
    let bone_motion = Isometry::new(Vector::new(-20.0, 55.0, 7.0), Vector::new(-0.7, 1.9, 0.2));
    case.ct = case.ct.moved(&bone_motion);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let turned = one.install(|| found(&case, &moved(&case.scan, &scan_motion), &[]));
    let expected = bone_motion * still.ct_from_scan.motion() * scan_motion.inverse();
    let (error, angle) = apart(turned.ct_from_scan.motion(), &expected, &moved(&case.scan, &scan_motion).mesh);
    assert!(error < 1e-3 && angle < 1e-3, "{error} mm, {angle} deg");
    let again = one.install(|| found(&case, &moved(&case.scan, &scan_motion), &[]));
    let many = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let threads = many.install(|| found(&case, &moved(&case.scan, &scan_motion), &[]));
    assert_eq!(again.ct_from_scan.motion(), turned.ct_from_scan.motion());
    assert_eq!(again.ct_from_scan.motion(), threads.ct_from_scan.motion());
    assert_eq!(again.residual_mm, threads.residual_mm);
}

#[test]
fn forty_percent_missing_no_colours_and_two_bad_landmarks_do_no_harm() {
    let Some(dir) = shared("register part", "specimens/S192803") else { return };
    let case = case(&dir, "femur");
    let mut heights: Vec<f64> = case.scan.mesh.vertices.iter().map(|p| p.x + 0.5 * p.y).collect();
    heights.sort_by(f64::total_cmp);
    let cut = heights[heights.len() * 2 / 5];
    let kept = |v: &u32| case.scan.mesh.vertices[*v as usize];
    let inside = |t: usize| case.scan.mesh.triangles[t].iter().map(kept).all(|p| p.x + 0.5 * p.y > cut);
    let part = ColouredMesh { mesh: case.scan.mesh.submesh(inside).0, colours: Vec::new() };
    let mut pairs = case.pairs.clone();
    pairs[0].1.x += 40.0;
    pairs[1].0.y -= 25.0;
    for pairs in [&pairs[..], &[]] {
        let result = found(&case, &part, pairs);
        let (error, angle) = apart(result.ct_from_scan.motion(), &case.truth, &part.mesh);
        assert!(error < 0.2 && angle < 0.5, "{error} mm, {angle} deg");
    }
}

#[test]
fn another_knee_another_bone_a_mirrored_bone_and_nonsense_are_refused() {
    let Some(dir) = shared("register refusal", "specimens/S192803") else { return };
    let Some(other) = shared("register refusal", "specimens/S193761") else { return };
    let refused = |what: &str, ct: &TriMesh, scan: &ColouredMesh| {
        let Err(error) = register_bone(ct, scan, &[], &RegisterOptions::default()) else { panic!("{what} was taken") };
        assert!(error.0.contains("CT bone") || error.0.contains("no area"), "{what}: {error}");
    };
    let (femur, tibia) = (case(&dir, "femur"), case(&dir, "tibfib"));
    for bone in ["femur", "tibfib"] {
        let (a, b) = (case(&dir, bone), case(&other, bone));
        refused("another knee", &a.ct, &b.scan);
        refused("another knee", &b.ct, &a.scan);
        let mut mirrored = a.scan.clone();
        mirrored.mesh.vertices.iter_mut().for_each(|p| p.x = -p.x);
        mirrored.mesh = mirrored.mesh.flipped();
        refused("a mirrored bone", &a.ct, &mirrored);
    }
    refused("another bone", &femur.ct, &tibia.scan);
    refused("another bone", &tibia.ct, &femur.scan);
    let ball = ColouredMesh { mesh: meshes::shapes::icosphere(40.0, 4), colours: Vec::new() };
    refused("a ball", &femur.ct, &ball);
    refused("nothing", &femur.ct, &ColouredMesh::default());
    let mut broken = femur.scan.clone();
    broken.mesh.vertices[7].z = f64::NAN;
    refused("a number that is none", &femur.ct, &broken);
}
