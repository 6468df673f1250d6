//! Registration against specimens with truth.
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "tests")]

use crate::common::phantoms::made;
use crate::common::registration::{Case, Noise, apart, exact_twin, noisy, part, random_pose, seeded};
use crate::common::shared;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use needs_shared::needs_shared;
use stages::register::{BoneRegistration, RegisterOptions, register_bone};
use std::path::Path;

#[expect(clippy::disallowed_methods, reason = "tests read the shared data")]
fn case(dir: &Path, bone: &str) -> Case {
    crate::common::registration::case(|path| std::fs::read(dir.join(path)).unwrap(), bone)
}

/// The bone of a phantom.
fn of_phantom(id: &str, bone: &str) -> Case {
    let made = made(id);
    crate::common::registration::case(|path| made.files.iter().find(|f| f.0 == path).unwrap().1.clone(), bone)
}

fn moved(scan: &ColouredMesh, by: &Isometry) -> ColouredMesh {
    ColouredMesh { mesh: scan.mesh.moved(by), colours: scan.colours.clone() }
}

fn found(case: &Case, scan: &ColouredMesh, pairs: &[(Point, Point)]) -> BoneRegistration {
    register_bone(&case.ct, scan, pairs, &RegisterOptions::default()).unwrap()
}

/// Fails where a landmark outweighs the surface, or the error that is foreseen is not of the size of the true one.
fn truth_is_found(name: &str, case: &Case) {
    for pairs in [&case.pairs[..], &[]] {
        let result = found(case, &case.scan, pairs);
        let (error, angle) = apart(result.ct_from_scan.motion(), &case.truth, &case.scan.mesh);
        assert!(error < 0.08 && angle < 0.15, "{name}: {error} mm, {angle} deg");
        let foreseen = result.predicted_error_mm;
        assert!(error < 2.0 * foreseen && foreseen < 2.0 * error, "{name}: {error}, foreseen {foreseen}");
        assert!(result.held_out_rms_mm < 0.2 && result.inlier_fraction > 0.95);
        assert_eq!(result.level_mm, 0.0);
        assert_eq!(result.residual_mm.len(), case.scan.mesh.vertices.len());
        assert_eq!(result.bare_bone.len(), case.scan.mesh.vertices.len());
    }
}

#[needs_shared]
fn truth_is_found_with_and_without_landmarks_and_the_error_is_foreseen() {
    for id in ["S192803", "S193761"] {
        let Some(dir) = shared("register truth", &format!("specimens/{id}")) else { return };
        for bone in ["femur", "tibfib"] {
            truth_is_found(&format!("{id} {bone}"), &case(&dir, bone));
        }
    }
}

#[test]
fn the_truth_of_a_phantom_is_found_with_and_without_landmarks_and_the_error_is_foreseen() {
    for bone in ["femur", "tibfib"] {
        truth_is_found(bone, &of_phantom("S192803-phantom", bone));
    }
}

/// Fails where a start, a sample or a grid is laid along the axes of a file, or a sum depends on who was first.
fn moving_moves_the_answer(mut case: Case) {
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

#[needs_shared]
fn moving_scan_and_bone_moves_the_answer_on_any_number_of_threads() {
    let Some(dir) = shared("register moved", "specimens/S192803") else { return };
    moving_moves_the_answer(case(&dir, "tibfib"));
}

#[test]
fn moving_a_phantom_s_scan_and_bone_moves_the_answer_on_any_number_of_threads() {
    moving_moves_the_answer(of_phantom("right-phantom", "tibfib"));
}

/// Fails where what is not seen, or a wrong landmark, pulls at the pose.
fn much_missing_does_no_harm(case: &Case) {
    let mut bad = case.pairs.clone();
    bad[0].1.x += 40.0;
    bad[1].0.y -= 25.0;
    let directions = [Vector::new(1.0, 0.5, 0.0), Vector::new(-0.3, 1.0, 0.4), Vector::new(0.2, -0.7, 1.0)];
    for (direction, pairs) in directions.iter().zip([&bad[..], &[], &case.pairs]) {
        let mut part = part(&case.scan, direction, 0.4);
        part.colours.clear();
        let result = found(case, &part, pairs);
        let (error, angle) = apart(result.ct_from_scan.motion(), &case.truth, &part.mesh);
        assert!(error < 0.2 && angle < 0.5, "{direction:?}: {error} mm, {angle} deg");
    }
}

#[needs_shared]
fn forty_percent_missing_no_colours_and_two_bad_landmarks_do_no_harm() {
    let Some(dir) = shared("register part", "specimens/S192803") else { return };
    much_missing_does_no_harm(&case(&dir, "femur"));
}

#[test]
fn forty_percent_of_a_phantom_missing_no_colours_and_two_bad_landmarks_do_no_harm() {
    much_missing_does_no_harm(&of_phantom("S192803-phantom", "femur"));
}

/// Fails where the level of the CT is not sought beside the pose, or is told with the other sign.
fn an_offset_is_told(mut case: Case, name: &str, offset: f64) {
    let normals = case.ct.vertex_normals();
    case.ct.vertices.iter_mut().zip(normals).for_each(|(p, n)| *p += n * offset);
    let result = found(&case, &case.scan, &case.pairs);
    let (error, angle) = apart(result.ct_from_scan.motion(), &case.truth, &case.scan.mesh);
    assert!(error < 0.1 && angle < 0.15, "{name} {offset}: {error} mm, {angle} deg");
    assert!((result.level_mm + offset).abs() < 0.06, "{name} {offset}: level {}", result.level_mm);
}

#[needs_shared]
fn a_bone_segmented_too_small_or_too_large_is_laid_right_and_told() {
    let Some(dir) = shared("register level", "specimens/S192803") else { return };
    for (bone, offset) in [("femur", -0.3), ("tibfib", 0.3)] {
        an_offset_is_told(case(&dir, bone), bone, offset);
    }
}

#[test]
fn a_phantom_s_bone_segmented_too_small_or_too_large_is_laid_right_and_told() {
    for (bone, offset) in [("femur", -0.3), ("tibfib", 0.3)] {
        an_offset_is_told(of_phantom("S192803-phantom", bone), bone, offset);
    }
}

#[needs_shared]
fn condyles_alone_mostly_covered_by_cartilage_are_laid_right() {
    let Some(dir) = shared("register condyles", "specimens/S193761") else { return };
    let case = case(&dir, "femur");
    let up = case.truth.rotation.inverse() * Vector::new(0.12, 0.39, -0.91);
    let part = part(&case.scan, &up, 0.4);
    let result = found(&case, &part, &case.pairs);
    let (error, _) = apart(result.ct_from_scan.motion(), &case.truth, &part.mesh);
    assert!(error < 0.2, "{error} mm");
}

/// Fails where too few starts are tried, or the best of them is not kept.
fn any_pose_is_laid_right(case: &Case, name: &str, seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let pose = random_pose(&mut seeded(seed));
        let scan = moved(&case.scan, &pose);
        let result = found(case, &scan, &[]);
        let (error, angle) = apart(result.ct_from_scan.motion(), &(case.truth * pose.inverse()), &scan.mesh);
        assert!(error < 0.1 && angle < 0.2, "{name}, pose {seed}: {error} mm, {angle} deg");
    }
}

#[needs_shared]
fn scans_in_any_pose_are_laid_right_without_landmarks() {
    for (id, bone) in [("S192803", "tibfib"), ("S193761", "femur")] {
        let Some(dir) = shared("register any pose", &format!("specimens/{id}")) else { return };
        any_pose_is_laid_right(&case(&dir, bone), &format!("{id} {bone}"), 0..4);
    }
}

#[test]
fn scans_of_a_phantom_in_any_pose_are_laid_right_without_landmarks() {
    for bone in ["femur", "tibfib"] {
        any_pose_is_laid_right(&of_phantom("S192803-phantom", bone), bone, 0..2);
    }
}

/// Errors [mm, deg] and the one foreseen over draws of CT error.
fn draws(case: &Case, noise: Noise, seeds: std::ops::Range<u64>) -> Vec<[f64; 3]> {
    let one = |seed| {
        let mut rng = seeded(1000 + seed);
        let mut of = exact_twin(case, 0.058, &mut rng);
        of.ct = noisy(&of.ct, noise, &mut rng);
        let result = found(&of, &of.scan, &of.pairs);
        let (error, angle) = apart(result.ct_from_scan.motion(), &of.truth, &of.scan.mesh);
        [error, angle, result.predicted_error_mm]
    };
    seeds.map(one).collect()
}

/// Fails where the fit leans on single vertices, or weighs what is raised.
fn white_error_leaves_little(case: &Case, name: &str) {
    let found = draws(case, Noise::White(0.05), 0..1);
    assert!(found[0][0] < 0.01 && found[0][1] < 0.015, "{name}: {:?}", found[0]);
}

#[needs_shared]
fn white_error_of_the_ct_averages_out() {
    for id in ["S192803", "S193761"] {
        let Some(dir) = shared("register white", &format!("specimens/{id}")) else { return };
        for bone in ["femur", "tibfib"] {
            white_error_leaves_little(&case(&dir, bone), &format!("{id} {bone}"));
        }
    }
}

#[test]
fn white_error_of_a_phantom_s_ct_averages_out() {
    for bone in ["femur", "tibfib"] {
        white_error_leaves_little(&of_phantom("S192803-phantom", bone), bone);
    }
}

#[needs_shared]
fn correlated_error_of_the_ct_is_weighed_and_foreseen() {
    let Some(dir) = shared("register correlated", "specimens/S193761") else { return };
    let mut found = draws(&case(&dir, "femur"), Noise::Matern(2.5, 0.1, 7.0), 0..6);
    found.extend(draws(&case(&dir, "tibfib"), Noise::Smooth(0.1, 8.0), 0..6));
    let mean = |k: usize| found.iter().map(|f| f[k]).sum::<f64>() / found.len() as f64;
    // Plain least squares: 0.058 mm and 0.083 deg.
    assert!(mean(0) < 0.045 && mean(1) < 0.06, "mean {} mm, {} deg", mean(0), mean(1));
    let foreseen = found.iter().filter(|f| f[0] < 2.0 * f[2] && f[2] < 2.0 * f[0]).count();
    assert!(foreseen * 10 >= found.len() * 8, "{foreseen} of {}: {found:?}", found.len());
}

/// Refuses a scan, in words that tell why.
fn refused(what: &str, ct: &TriMesh, scan: &ColouredMesh) {
    let Err(error) = register_bone(ct, scan, &[], &RegisterOptions::default()) else { panic!("{what} was taken") };
    assert!(error.to_string().contains("CT bone") || error.to_string().contains("no area"), "{what}: {error}");
    // both residuals are judged, so both are told
    let both = ["kept out of the fit lies", "and that of the fit"];
    let told = both.iter().all(|words| error.to_string().contains(words));
    assert!(told || !error.to_string().contains("does not fit the CT bone"), "{what}: {error}");
}

/// Fails where the best pose is taken whatever it leaves: of a mirrored bone, of the other bone, of what is no bone at all.
fn what_is_not_this_bone_is_refused([femur, tibia]: [&Case; 2]) {
    for bone in [femur, tibia] {
        let mut mirrored = bone.scan.clone();
        mirrored.mesh.vertices.iter_mut().for_each(|p| p.x = -p.x);
        mirrored.mesh = mirrored.mesh.flipped();
        refused("a mirrored bone", &bone.ct, &mirrored);
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

#[needs_shared]
fn another_knee_another_bone_a_mirrored_bone_and_nonsense_are_refused() {
    let Some(dir) = shared("register refusal", "specimens/S192803") else { return };
    let Some(other) = shared("register refusal", "specimens/S193761") else { return };
    for bone in ["femur", "tibfib"] {
        let (a, b) = (case(&dir, bone), case(&other, bone));
        refused("another knee", &a.ct, &b.scan);
        refused("another knee", &b.ct, &a.scan);
    }
    what_is_not_this_bone_is_refused([&case(&dir, "femur"), &case(&dir, "tibfib")]);
}

#[test]
fn another_phantom_s_bone_another_bone_a_mirrored_bone_and_nonsense_are_refused() {
    let own = ["femur", "tibfib"].map(|bone| of_phantom("S192803-phantom", bone));
    for (own, bone) in own.iter().zip(["femur", "tibfib"]) {
        refused("another phantom", &own.ct, &of_phantom("S193761-phantom", bone).scan);
    }
    what_is_not_this_bone_is_refused([&own[0], &own[1]]);
}

/// Seen from one side this femur is held five degrees off by its cartilage, from every start: turns off that pose find the right one.
#[test]
fn a_scan_that_its_cartilage_holds_turned_is_laid_right() {
    let whole = of_phantom("right-phantom", "femur");
    let direction = random_pose(&mut seeded(7081)).rotation * nalgebra::Vector3::x();
    let few = part(&whole.scan, &direction, 0.4);
    let result = found(&whole, &few, &whole.pairs);
    let (error, angle) = apart(result.ct_from_scan.motion(), &whole.truth, &few.mesh);
    assert!(error < 0.2 && angle < 0.3, "{error} mm {angle} deg");
}
