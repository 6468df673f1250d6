//! Stage 6 on the shared specimens, with their true registration and frames, and on a phantom, with its true registration.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use crate::common::phantoms::made;
use attachments::site::{Bone, Source};
use formats::{ply, stl};
use meshes::frame::{AnatomicalFrame, Pose, Side};
use meshes::query::SurfaceQuery;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix4, Rotation3, Translation3, UnitQuaternion};
use needs_shared::needs_shared;
use serde_json::Value;
use stages::attachments::{Attachments, AttachmentsOptions, attachments};
use stages::bones::Bones;
use stages::cartilage::{Cartilage, CartilageSolid};
use stages::frames::{Frames, GroodSuntayPose};
use stages::register::{BoneRegistration, Registration};
use stages::specimen::{Identity, NamedPoint, PointFrame, Specimen};
use stages::{PerBone, PerCartilage, StageError};
use std::sync::OnceLock;

#[expect(clippy::disallowed_methods, reason = "reads the shared test data")]
fn shared(test: &str, path: &str) -> Option<Vec<u8>> {
    Some(std::fs::read(crate::common::shared(test, path)?).unwrap())
}

#[derive(Clone)]
struct Knee {
    specimen: Specimen,
    registration: Registration,
    bones: Bones,
    cartilage: Cartilage,
    frames: Frames,
    truth: Value,
}

impl Knee {
    fn attach(&self) -> Attachments {
        self.attempt().unwrap()
    }

    fn attempt(&self) -> Result<Attachments, StageError> {
        let (bones, frames, options) = (&self.bones, &self.frames, AttachmentsOptions::default());
        attachments(&self.specimen, &self.registration, bones, &self.cartilage, frames, &options)
    }
}

fn vector(v: &Value) -> Vector {
    Vector::from_fn(|k, _| v[k].as_f64().unwrap())
}

fn pose(value: &Value) -> Isometry {
    let m = Matrix4::from_fn(|r, c| value[r][c].as_f64().unwrap());
    let rotation = Rotation3::from_matrix(&m.fixed_view::<3, 3>(0, 0).into_owned());
    Isometry::from_parts(
        Translation3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

fn registered(value: &Value) -> BoneRegistration {
    BoneRegistration {
        ct_from_scan: Pose::assume(pose(value)),
        rms_bare_bone_mm: 0.1,
        inlier_fraction: 1.0,
        held_out_rms_mm: 0.1,
        predicted_error_mm: 0.1,
        level_mm: 0.0,
        residual_mm: Vec::new(),
        bare_bone: Vec::new(),
    }
}

fn frame(v: &Value) -> AnatomicalFrame {
    AnatomicalFrame {
        origin: vector(&v["origin"]).into(),
        medial: vector(&v["medial"]),
        anterior: vector(&v["anterior"]),
        superior: vector(&v["superior"]),
    }
}

fn marks(text: &str) -> Vec<NamedPoint> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let frame = if cells[1] == "scan_femur" { PointFrame::ScanFemur } else { PointFrame::ScanTibfib };
        let point = Point::from_slice(&[2, 3, 4].map(|k| cells[k].trim().parse().unwrap()));
        NamedPoint { name: cells[0].to_owned(), frame, point }
    };
    text.lines().skip(1).filter(|l| !l.trim().is_empty()).map(row).collect()
}

fn knee(test: &str, id: &str) -> Option<Knee> {
    let read = |path: &str| shared(test, &format!("specimens/{id}/{path}"));
    let truth: Value = serde_json::from_slice(&read("truth/truth.json")?).unwrap();
    let scan = |bone: &str| Some(ply::read(&read(&format!("scans/{bone}.ply"))?).unwrap());
    let ct = |bone: &str| Some(stl::read(&read(&format!("ct/{bone}.stl"))?).unwrap());
    let surfaces = PerBone { femur: ct("femur")?, tibfib: ct("tibfib")? };
    let femur = frame(&truth["frames_ct"]["femur"]);
    let identity = Identity {
        id: id.to_owned(),
        side: Side::Left,
        sex: None,
        age_years: None,
        height_cm: None,
        mass_kg: None,
        provenance: None,
        note: None,
    };
    let specimen = Specimen {
        identity,
        ct: surfaces.clone(),
        scans: PerBone { femur: scan("femur")?, tibfib: scan("tibfib")? },
        mri: None,
        patella: None,
        capsule: None,
        landmarks: Vec::new(),
        marks: marks(std::str::from_utf8(&read("marks.csv")?).unwrap()),
        given_fibres: Vec::new(),
        given_frames: None,
        ligaments: Default::default(),
        warnings: Vec::new(),
        metrics: Default::default(),
    };
    let to_ct = &truth["scan_to_ct"];
    let registration = Registration {
        bones: PerBone { femur: registered(&to_ct["femur"]), tibfib: registered(&to_ct["tibfib"]) },
        patella: None,
        warnings: Vec::new(),
        metrics: Default::default(),
    };
    let frames = Frames {
        epicondyles: [femur.origin + 44.0 * femur.medial, femur.origin - 44.0 * femur.medial],
        condylar_axis: (femur.origin, femur.medial),
        condylar_radius_mm: 20.0,
        condylar_angle_deg: 0.0,
        tibia: frame(&truth["frames_ct"]["tibia"]),
        joint_line: frame(&truth["frames_ct"]["tibia"]),
        femur,
        gs_ct_pose: GroodSuntayPose { fe_deg: 0.0, vv_deg: 0.0, ie_deg: 0.0, ml_mm: 0.0, ap_mm: 0.0, si_mm: 0.0 },
        warnings: Vec::new(),
        metrics: Default::default(),
    };
    let bones = Bones { surfaces, patella: None, warnings: Vec::new(), metrics: Default::default() };
    let solid = |name: &str| {
        let solid = stl::read(&read(&format!("truth/{name}.stl"))?).unwrap();
        let (articular, thickness_mm) = (vec![true; solid.triangles.len()], vec![0.0; solid.vertices.len()]);
        Some(CartilageSolid { solid, articular, thickness_mm })
    };
    let solids = PerCartilage {
        femur: solid("femur")?,
        tibia_medial: solid("tibfib_medial")?,
        tibia_lateral: solid("tibfib_lateral")?,
    };
    let cartilage = Cartilage { solids, bodies: Default::default(), warnings: Vec::new(), metrics: Default::default() };
    Some(Knee { specimen, registration, bones, cartilage, frames, truth })
}

/// A phantom with its own frames, which the bones show, in place of the published ones.
fn of_phantom() -> Knee {
    let files = &made("S192803-phantom").files;
    let file = |path: &str| &files.iter().find(|f| f.0 == path).unwrap().1;
    let truth: Value = serde_json::from_slice(file("truth/truth.json")).unwrap();
    let specimen = crate::frames::phantom("S192803-phantom");
    let frames = crate::frames::of(&specimen);
    let to_ct = &truth["scan_to_ct"];
    let registration = Registration {
        bones: PerBone { femur: registered(&to_ct["femur"]), tibfib: registered(&to_ct["tibfib"]) },
        patella: None,
        warnings: Vec::new(),
        metrics: Default::default(),
    };
    let solid = |name: &str| {
        let solid = stl::read(file(&format!("truth/{name}.stl"))).unwrap();
        let (articular, thickness_mm) = (vec![true; solid.triangles.len()], vec![0.0; solid.vertices.len()]);
        CartilageSolid { solid, articular, thickness_mm }
    };
    let solids = PerCartilage {
        femur: solid("femur"),
        tibia_medial: solid("tibfib_medial"),
        tibia_lateral: solid("tibfib_lateral"),
    };
    let bones =
        Bones { surfaces: specimen.ct.clone(), patella: None, warnings: Vec::new(), metrics: Default::default() };
    let cartilage = Cartilage { solids, bodies: Default::default(), warnings: Vec::new(), metrics: Default::default() };
    Knee { specimen, registration, bones, cartilage, frames, truth }
}

/// The same, made once.
fn phantom() -> Knee {
    static KNEE: OnceLock<Knee> = OnceLock::new();
    KNEE.get_or_init(of_phantom).clone()
}

fn check_marked(knee: &Knee, result: &Attachments) {
    for (key, site) in knee.truth["sites_ct"].as_object().unwrap().iter().filter(|(_, s)| s["marked"] == true) {
        let centre = Point::from(vector(&site["centroid"]));
        let named = |s: &&attachments::site::Site| {
            let bone = if s.bone == attachments::site::Bone::Femur { "femur" } else { "tibfib" };
            format!("{}@{bone}", s.ligament) == *key
        };
        let own = result.sites.iter().find(named).unwrap_or_else(|| panic!("{key} has no site"));
        assert_eq!(own.source, Source::Marked, "{key}");
        let error = (own.centroid - centre).norm();
        assert!(error < 1.2, "{key}: {error:.2} mm");
        assert!(own.projection_mm < 0.5, "{key}: projected over {} mm", own.projection_mm);
    }
}

/// Fails where an outline is named by the order of the marks, or found by them alone.
fn outlines_are_named(id: &str, mut knee: Knee) {
    let with = knee.attach();
    check_marked(&knee, &with);
    knee.specimen.marks.clear();
    let without = knee.attach();
    check_marked(&knee, &without);
    assert_eq!(with.sites, without.sites);
    println!("{id}: {:#?}", with.warnings);
}

#[needs_shared]
fn outlines_are_named_with_and_without_rough_points() {
    for id in ["S192803", "S193761"] {
        let Some(knee) = knee("outlines_are_named_with_and_without_rough_points", id) else { return };
        outlines_are_named(id, knee);
    }
}

#[test]
fn outlines_of_a_phantom_are_named_with_and_without_rough_points() {
    outlines_are_named("phantom", phantom());
}

fn mirrored(mesh: &TriMesh) -> TriMesh {
    let vertices = mesh.vertices.iter().map(|p| Point::new(-p.x, p.y, p.z)).collect();
    TriMesh { vertices, triangles: mesh.triangles.clone() }.flipped()
}

/// The other leg's knee: every x turned over, in CT and in the scans.
fn other_side(knee: &mut Knee) {
    let turn = |v: &Vector| Vector::new(-v.x, v.y, v.z);
    let specimen = &mut knee.specimen;
    for (scan, bone) in [
        (&mut specimen.scans.femur, &mut knee.registration.bones.femur),
        (&mut specimen.scans.tibfib, &mut knee.registration.bones.tibfib),
    ] {
        scan.mesh = mirrored(&scan.mesh);
        let old = bone.ct_from_scan.motion();
        let flip = nalgebra::Matrix3::from_diagonal(&Vector::new(-1.0, 1.0, 1.0));
        let matrix = flip * old.rotation.to_rotation_matrix().matrix() * flip;
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix));
        let shift = turn(&old.translation.vector);
        bone.ct_from_scan = Pose::assume(Isometry::from_parts(shift.into(), rotation));
    }
    knee.bones.surfaces =
        PerBone { femur: mirrored(&knee.bones.surfaces.femur), tibfib: mirrored(&knee.bones.surfaces.tibfib) };
    let solids = &mut knee.cartilage.solids;
    for cartilage in [&mut solids.femur, &mut solids.tibia_medial, &mut solids.tibia_lateral] {
        cartilage.solid = mirrored(&cartilage.solid);
    }
    for frame in [&mut knee.frames.femur, &mut knee.frames.tibia, &mut knee.frames.joint_line] {
        frame.origin = turn(&frame.origin.coords).into();
        (frame.medial, frame.anterior, frame.superior) =
            (turn(&frame.medial), turn(&frame.anterior), turn(&frame.superior));
    }
    knee.frames.epicondyles = knee.frames.epicondyles.map(|p| turn(&p.coords).into());
    knee.specimen.marks.clear();
}

/// Fails where a site, or the order of fibres, is laid by an axis of the file in place of medial, or by which way the scan's triangles go round.
fn the_other_side_mirrors(mut knee: Knee) {
    let left = knee.attach();
    other_side(&mut knee);
    let right = knee.attach();
    assert_eq!(left.fibres.len(), right.fibres.len());
    for (l, r) in left.sites.iter().zip(&right.sites) {
        let turned = Point::new(-r.centroid.x, r.centroid.y, r.centroid.z);
        assert!((l.centroid - turned).norm() < 1e-3, "{}: {} and {}", l.ligament, l.centroid, turned);
    }
    for (l, r) in left.fibres.iter().zip(&right.fibres) {
        assert_eq!((&l.bundle, l.fibre), (&r.bundle, r.fibre));
        for (end, here, there) in [("femur", l.femur, r.femur), ("tibia", l.tibia, r.tibia)] {
            let off = (here - Point::new(-there.x, there.y, there.z)).norm();
            assert!(off < 0.5, "{} {}, {end}: {off} mm", l.bundle, l.fibre);
        }
    }
}

#[needs_shared]
fn a_right_knee_mirrors_the_left() {
    let Some(knee) = knee("a_right_knee_mirrors_the_left", "S192803") else { return };
    the_other_side_mirrors(knee);
}

#[test]
fn a_right_phantom_mirrors_the_left() {
    the_other_side_mirrors(phantom());
}

/// Fails where an outline is sought on a grid of the scan's frame, or a site is laid without the registration.
fn moving_moves_the_sites(mut knee: Knee) {
    let before = knee.attach();
    let ct = Isometry::new(Vector::new(30.0, -200.0, 55.0), Vector::new(0.4, -1.1, 0.7));
    let scanner = Isometry::new(Vector::new(-80.0, 20.0, 5.0), Vector::new(-0.9, 0.3, 1.4));
    let specimen = &mut knee.specimen;
    specimen.marks.clear();
    specimen.scans.femur.mesh = specimen.scans.femur.mesh.moved(&scanner);
    specimen.scans.tibfib.mesh = specimen.scans.tibfib.mesh.moved(&scanner);
    for bone in [&mut knee.registration.bones.femur, &mut knee.registration.bones.tibfib] {
        bone.ct_from_scan = Pose::assume(ct * bone.ct_from_scan.motion() * scanner.inverse());
    }
    knee.bones.surfaces =
        PerBone { femur: knee.bones.surfaces.femur.moved(&ct), tibfib: knee.bones.surfaces.tibfib.moved(&ct) };
    let solids = &mut knee.cartilage.solids;
    for cartilage in [&mut solids.femur, &mut solids.tibia_medial, &mut solids.tibia_lateral] {
        cartilage.solid = cartilage.solid.moved(&ct);
    }
    knee.frames.epicondyles = knee.frames.epicondyles.map(|p| ct * p);
    for frame in [&mut knee.frames.femur, &mut knee.frames.tibia, &mut knee.frames.joint_line] {
        frame.origin = ct * frame.origin;
        (frame.medial, frame.anterior, frame.superior) = (ct * frame.medial, ct * frame.anterior, ct * frame.superior);
    }
    let after = knee.attach();
    assert_eq!(before.sites.len(), after.sites.len());
    for (b, a) in before.sites.iter().zip(&after.sites) {
        assert!((ct * b.centroid - a.centroid).norm() < 1e-6, "{}", b.ligament);
        assert!((b.area_mm2 - a.area_mm2).abs() < 1e-6 * b.area_mm2, "{}", b.ligament);
    }
    for (b, a) in before.fibres.iter().zip(&after.fibres) {
        assert!((ct * b.tibia - a.tibia).norm() < 1e-5, "{}", b.bundle);
    }
}

fn recoloured(scan: &ColouredMesh, shade: impl Fn([u8; 3]) -> [u8; 3]) -> ColouredMesh {
    ColouredMesh { mesh: scan.mesh.clone(), colours: scan.colours.iter().map(|c| shade(*c)).collect() }
}

#[needs_shared]
fn moving_ct_and_scan_moves_the_sites() {
    let Some(knee) = knee("moving_ct_and_scan_moves_the_sites", "S193761") else { return };
    moving_moves_the_sites(knee);
}

#[test]
fn moving_a_phantom_s_ct_and_scan_moves_the_sites() {
    moving_moves_the_sites(phantom());
}

/// Fails where ink is what is darker than a fixed shade.
fn shades_do_not_move_the_sites(mut knee: Knee) {
    let scans = knee.specimen.scans.clone();
    for gain in [[0.6, 0.6, 0.6], [1.1, 1.1, 1.1], [0.6, 0.45, 0.35]] {
        let shade = |c: [u8; 3]| std::array::from_fn(|k| (f64::from(c[k]) * gain[k]).min(255.0) as u8);
        knee.specimen.scans.femur = recoloured(&scans.femur, shade);
        knee.specimen.scans.tibfib = recoloured(&scans.tibfib, shade);
        check_marked(&knee, &knee.attach());
    }
}

#[needs_shared]
fn exposure_and_brown_bone_do_not_move_the_sites() {
    let Some(knee) = knee("exposure_and_brown_bone_do_not_move_the_sites", "S192803") else { return };
    shades_do_not_move_the_sites(knee);
}

#[test]
fn exposure_and_brown_bone_do_not_move_a_phantom_s_sites() {
    shades_do_not_move_the_sites(phantom());
}

/// Fails where a site is called marked that nobody marked.
fn no_colours_no_marked_sites(mut knee: Knee) {
    knee.specimen.scans.femur.colours.clear();
    knee.specimen.scans.tibfib.colours.clear();
    knee.specimen.marks.clear();
    let result = knee.attach();
    assert!(result.sites.iter().all(|s| s.source == Source::Literature));
}

#[needs_shared]
fn without_colours_there_are_no_marked_sites() {
    let Some(knee) = knee("without_colours_there_are_no_marked_sites", "S192803") else { return };
    no_colours_no_marked_sites(knee);
}

#[test]
fn without_colours_a_phantom_has_no_marked_sites() {
    no_colours_no_marked_sites(phantom());
}

/// Fails where a literature site is not brought to the bone, or not out of the cartilage.
fn literature_sites_are_on_bare_bone(id: &str, knee: &Knee) {
    let result = knee.attach();
    let solids = knee.cartilage.solids.named().map(|(_, c)| SurfaceQuery::new(&c.solid).unwrap());
    let mut count = 0;
    for site in result.sites.iter().filter(|s| s.source == Source::Literature) {
        let (name, bone) = match site.bone {
            Bone::Femur => ("femur", &knee.bones.surfaces.femur),
            Bone::Tibfib => ("tibfib", &knee.bones.surfaces.tibfib),
        };
        assert!(SurfaceQuery::new(bone).unwrap().nearest(&site.centroid).distance < 1e-6, "{id} {}", site.ligament);
        let nearest = solids.iter().map(|c| c.nearest(&site.centroid).distance).fold(f64::INFINITY, f64::min);
        assert!(nearest >= 1.0 - 1e-9, "{id} {} on {name}: {nearest} mm from cartilage", site.ligament);
        count += 1;
    }
    assert_eq!(count, 12, "{id}");
}

#[needs_shared]
fn literature_sites_lie_on_the_bone_outside_cartilage() {
    for id in ["S192803", "S193761"] {
        let Some(knee) = knee("literature_sites_lie_on_the_bone_outside_cartilage", id) else {
            return;
        };
        literature_sites_are_on_bare_bone(id, &knee);
    }
}

#[test]
fn literature_sites_of_a_phantom_lie_on_the_bone_outside_cartilage() {
    literature_sites_are_on_bare_bone("phantom", &phantom());
}

/// Fails where a mark far off is drawn to the bone, or one without an outline gets a made one.
fn a_mark_far_off_is_refused(mut knee: Knee) {
    let first = knee.specimen.marks[0].point;
    let middle = knee.specimen.scans.femur.mesh.centroid().unwrap();
    knee.specimen.marks[0].point = first + (first - middle).normalize() * 400.0;
    let error = knee.attempt().unwrap_err().to_string();
    assert!(error.contains("marks.csv line 2") && error.contains("ACL"), "{error}");
    knee.specimen.marks[0].point = first;
    knee.specimen.scans.femur.colours.iter_mut().for_each(|c| *c = [222, 200, 165]);
    let result = knee.attach();
    let acl = result.sites.iter().find(|s| s.ligament == "ACL").unwrap();
    assert_eq!((acl.source, acl.area_mm2), (Source::Marked, 0.0));
    assert!(result.warnings.iter().any(|w| w.contains("no outline within")));
}

#[needs_shared]
fn a_mark_off_the_bone_is_refused_and_one_without_outline_is_a_point() {
    let Some(knee) = knee("a_mark_off_the_bone_is_refused_and_one_without_outline_is_a_point", "S192803") else {
        return;
    };
    a_mark_far_off_is_refused(knee);
}

#[test]
fn a_mark_off_a_phantom_s_bone_is_refused_and_one_without_outline_is_a_point() {
    a_mark_far_off_is_refused(phantom());
}

#[needs_shared]
fn a_mark_whose_bone_is_missing_gives_way_to_the_literature_or_leaves_its_bundles_out() {
    let name = "a_mark_whose_bone_is_missing_gives_way_to_the_literature_or_leaves_its_bundles_out";
    let Some(mut knee) = knee(name, "S192803") else { return };
    knee.specimen.scans.tibfib.colours.iter_mut().for_each(|c| *c = [222, 200, 165]);
    let tibia = knee.frames.tibia;
    let to_scan = knee.registration.bones.tibfib.ct_from_scan.motion().inverse();
    let lateral = to_scan * (-tibia.medial);
    let mark = |knee: &Knee, name: &str| {
        let is = |m: &&NamedPoint| m.name == name && m.frame == PointFrame::ScanTibfib;
        knee.specimen.marks.iter().position(|m| is(&m)).unwrap()
    };
    let (smcl, acl) = (mark(&knee, "sMCL"), mark(&knee, "ACL"));
    // 30 mm off the bone: nothing that the literature knows is near; 6 mm: its own place of the ligament is.
    knee.specimen.marks[smcl].point -= 30.0 * lateral;
    knee.specimen.marks[acl].point += 6.0 * (to_scan * tibia.superior);
    let result = knee.attach();
    let tibial = |l: &str| result.sites.iter().find(|s| s.ligament == l && s.bone == Bone::Tibfib);
    assert!(tibial("sMCL").is_none());
    for bundle in ["sMCL_A", "sMCL_M", "sMCL_P"] {
        assert!(result.fibres.iter().all(|f| f.bundle != bundle));
        assert!(result.warnings.iter().any(|w| w.contains(bundle) && w.contains("left out")), "{:?}", result.warnings);
    }
    assert_eq!(tibial("ACL").unwrap().source, Source::Literature);
    assert_eq!(result.warnings.iter().filter(|w| w.contains("the bone is missing there")).count(), 2);
    // Most of a bone's marks astray is no missing bone.
    knee.specimen
        .marks
        .iter_mut()
        .filter(|m| m.frame == PointFrame::ScanTibfib)
        .for_each(|m| m.point += 90.0 * lateral);
    assert!(knee.attempt().is_err());
}
