//! Frames: laws on phantoms, then published axes and raters' epicondyles.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "reads ../shared where it is there")]

use crate::common::phantoms::made;
use crate::common::shared;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::plane::clipped;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point, Vector};
use needs_shared::needs_shared;
use stages::PerBone;
use stages::anatomy::{check_anatomy, detect_side, rough_axes};
use stages::bones::Bones;
use stages::frames::{Frames, FramesOptions, frames, grood_suntay};
use stages::ingest::ingest;
use stages::specimen::{IngestOptions, PointFrame, RawSpecimen, Specimen};
use std::path::Path;

/// A phantom as a specimen: read as its files are.
pub(crate) fn phantom(id: &str) -> Specimen {
    let mut raw = RawSpecimen::default();
    for (name, bytes) in made(id).files.clone() {
        if name == "specimen.toml" {
            raw.toml = String::from_utf8(bytes).unwrap();
        } else {
            raw.files.insert(name, bytes);
        }
    }
    ingest(&raw, &IngestOptions::default()).unwrap()
}

/// The frames that its CT bones show.
pub(crate) fn of(specimen: &Specimen) -> Frames {
    let bones =
        Bones { surfaces: specimen.ct.clone(), patella: None, warnings: Vec::new(), metrics: Default::default() };
    frames(specimen, &bones, &FramesOptions::default()).unwrap()
}

fn degrees(a: &Vector, b: &Vector) -> f64 {
    a.normalize().cross(&b.normalize()).norm().atan2(a.dot(b)).to_degrees()
}

fn mesh(path: &Path) -> TriMesh {
    let bytes = std::fs::read(path).unwrap();
    formats::read_surface(&path.to_string_lossy(), &bytes, &Default::default()).unwrap().welded().mesh
}

fn changed(specimen: &Specimen, point: impl Fn(&Point) -> Point, flip: bool) -> Specimen {
    let mut s = specimen.clone();
    for bone in [&mut s.ct.femur, &mut s.ct.tibfib] {
        bone.vertices.iter_mut().for_each(|p| *p = point(p));
        if flip {
            *bone = std::mem::take(bone).flipped();
        }
    }
    s.landmarks.iter_mut().filter(|l| l.frame == PointFrame::Ct).for_each(|l| l.point = point(&l.point));
    s
}

/// Without landmarks, so that the bones alone decide.
fn bare(mut specimen: Specimen) -> Specimen {
    specimen.landmarks.clear();
    specimen
}

#[test]
fn moving_the_knee_moves_the_frames() {
    for specimen in [phantom("S192803-phantom"), bare(phantom("right-phantom"))] {
        let motion = Isometry::new(Vector::new(310.0, -42.0, 77.0), Vector::new(0.9, -1.7, 0.4));
        let (still, moved) = (of(&specimen), of(&changed(&specimen, |p| motion * p, false)));
        for (a, b) in [(&still.femur, &moved.femur), (&still.tibia, &moved.tibia)] {
            assert!((motion * a.origin - b.origin).norm() < 1e-6);
            for (u, v) in [(a.medial, b.medial), (a.anterior, b.anterior), (a.superior, b.superior)] {
                assert!((motion * u - v).norm() < 1e-6);
            }
        }
        assert!((still.gs_ct_pose.ie_deg - moved.gs_ct_pose.ie_deg).abs() < 1e-6);
        assert!((still.condylar_radius_mm - moved.condylar_radius_mm).abs() < 1e-6);
    }
}

#[test]
fn the_mirrored_knee_has_the_mirrored_frames() {
    let specimen = bare(phantom("S193761-phantom"));
    let mut other = changed(&specimen, |p| Point::new(-p.x, p.y, p.z), true);
    other.identity.side = Side::Right;
    let (left, right) = (of(&specimen), of(&other));
    let mirror = |v: &Vector| Vector::new(-v.x, v.y, v.z);
    for (a, b) in [(&left.femur, &right.femur), (&left.tibia, &right.tibia)] {
        assert!((mirror(&a.origin.coords) - b.origin.coords).norm() < 1e-6);
        for (u, v) in [(a.medial, b.medial), (a.anterior, b.anterior), (a.superior, b.superior)] {
            assert!((mirror(&u) - v).norm() < 1e-6);
        }
    }
    let (l, r) = (left.gs_ct_pose, right.gs_ct_pose);
    for (a, b) in [
        (l.fe_deg, r.fe_deg),
        (l.vv_deg, r.vv_deg),
        (l.ie_deg, r.ie_deg),
        (l.ml_mm, r.ml_mm),
        (l.ap_mm, r.ap_mm),
        (l.si_mm, r.si_mm),
    ] {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn axes_are_unit_square_and_of_the_side() {
    for (id, hand) in [("S192803-phantom", 1.0), ("right-phantom", -1.0)] {
        let f = of(&phantom(id));
        for frame in [f.femur, f.tibia] {
            assert!((frame.medial.cross(&frame.anterior).dot(&frame.superior) - hand).abs() < 1e-12);
        }
        assert!((f.femur.medial - (f.epicondyles[0] - f.epicondyles[1]).normalize()).norm() < 1e-12);
        assert!(f.femur.medial.dot(&f.condylar_axis.1) > 0.9);
    }
}

#[test]
fn bones_exchanged_or_of_the_other_side_are_told() {
    for id in stages::phantom::PHANTOMS {
        let good = phantom(id);
        check_anatomy(&good).unwrap();
        let swapped =
            Specimen { ct: PerBone { femur: good.ct.tibfib.clone(), tibfib: good.ct.femur.clone() }, ..good.clone() };
        assert!(check_anatomy(&swapped).unwrap_err().to_string().contains("exchange"), "{id}");
        let mut other = good.clone();
        other.identity.side = if good.identity.side == Side::Left { Side::Right } else { Side::Left };
        let told = check_anatomy(&other).unwrap_err().to_string();
        assert!(told.contains("side ="), "{id}: {told}");
    }
}

fn published(specimen: &str) -> Option<(AnatomicalFrame, AnatomicalFrame)> {
    let path = shared("published frames", &format!("specimens/{specimen}/truth/truth.json"))?;
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let frame = |bone: &str| serde_json::from_value(truth["frames_ct"][bone].clone()).unwrap();
    Some((frame("femur"), frame("tibia")))
}

#[needs_shared]
fn published_axes_give_the_published_pose() {
    let Some((femur, tibia)) = published("S192803") else { return };
    let q = grood_suntay(&femur, &tibia, Side::Left).unwrap();
    for (ours, abaqus) in [
        (q.fe_deg, -6.125_484_73),
        (q.vv_deg, 0.804_964_13),
        (q.ie_deg, 2.170_242_62),
        (q.ml_mm, 0.772_356_44),
        (q.ap_mm, 0.378_040_99),
        (q.si_mm, -22.199_892_39),
    ] {
        assert!((ours - abaqus).abs() < 1e-4, "{ours} {abaqus}");
    }
}

#[needs_shared]
fn frames_lie_near_the_published_ones() {
    for id in ["S192803", "S193761"] {
        let Some((femur, tibia)) = published(id) else { return };
        let Some(dir) = shared("frames", &format!("specimens/{id}")) else { return };
        let mut specimen = phantom("S192803-phantom");
        specimen.ct = PerBone { femur: mesh(&dir.join("ct/femur.stl")), tibfib: mesh(&dir.join("ct/tibfib.stl")) };
        let specimen = bare(specimen);
        check_anatomy(&specimen).unwrap();
        let f = of(&specimen);
        assert!(degrees(&f.femur.medial, &femur.medial) < 4.0, "{id} {}", degrees(&f.femur.medial, &femur.medial));
        assert!(
            degrees(&f.femur.superior, &femur.superior) < 8.0,
            "{id} {}",
            degrees(&f.femur.superior, &femur.superior)
        );
        assert!(degrees(&f.tibia.medial, &tibia.medial) < 10.0, "{id} {}", degrees(&f.tibia.medial, &tibia.medial));
        assert!(
            degrees(&f.tibia.superior, &tibia.superior) < 12.0,
            "{id} {}",
            degrees(&f.tibia.superior, &tibia.superior)
        );
        for (bone, ours, theirs) in [("femur", f.femur.origin, femur.origin), ("tibia", f.tibia.origin, tibia.origin)] {
            assert!((ours - theirs).norm() < 5.0, "{id} {bone}: {:.1} mm", (ours - theirs).norm());
        }
    }
}

/// A tibia like a loaf of bread: a flat top with two hills, one of them higher, on either side of its middle.
fn two_hills(apart: f64) -> (TriMesh, AnatomicalFrame) {
    let height = |x: f64, y: f64| {
        let hill = |at: f64, top: f64| top * (-((x - at).powi(2) + (y + 3.0).powi(2)) / 8.0).exp();
        hill(0.5 * apart, 6.0) + hill(-0.5 * apart, 7.0)
    };
    let n: u32 = 81;
    let at = |i: u32| f64::from(i) - 40.0;
    let vertices = (0..n * n).map(|k| Point::new(at(k % n), at(k / n), height(at(k % n), at(k / n)))).collect();
    let corner = |k: u32| k / (n - 1) * n + k % (n - 1);
    let triangles = (0..(n - 1) * (n - 1)).map(corner).flat_map(|k| [[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]);
    let frame =
        AnatomicalFrame { origin: Point::origin(), medial: Vector::x(), anterior: Vector::y(), superior: Vector::z() };
    (TriMesh { vertices, triangles: triangles.collect() }, frame)
}

#[test]
fn eminences_are_the_two_tips_and_a_single_tip_is_none() {
    let (bone, frame) = two_hills(12.0);
    let [medial, lateral] = stages::eminences::eminences(&bone, &frame, 50.0).unwrap();
    assert!((medial - Point::new(6.0, -3.0, 6.0)).norm() < 0.3, "{medial}");
    assert!((lateral - Point::new(-6.0, -3.0, 7.0)).norm() < 0.3, "{lateral}");
    let (single, frame) = two_hills(0.0);
    assert_eq!(stages::eminences::eminences(&single, &frame, 50.0), None);
}

#[test]
fn given_frames_are_used_as_they_are_or_refused_by_name() {
    use stages::frames::given::{GivenFrame, GivenFrames};
    let mut specimen = phantom("S192803-phantom");
    let found = of(&specimen);
    let give = |f: &AnatomicalFrame, shift: f64| GivenFrame {
        origin: [f.origin.x + shift, f.origin.y, f.origin.z],
        medial: f.medial.into(),
        anterior: f.anterior.into(),
        superior: f.superior.into(),
    };
    specimen.given_frames = Some(GivenFrames { femur: give(&found.femur, 1.0), tibia: give(&found.tibia, 0.0) });
    let own = of(&specimen);
    assert!((own.femur.origin - found.femur.origin - Vector::x()).norm() < 1e-12);
    assert!((own.tibia.medial - found.tibia.medial).norm() < 1e-12);
    assert_eq!(own.warnings, found.warnings);
    specimen.given_frames = Some(GivenFrames { femur: give(&found.femur, 30.0), tibia: give(&found.tibia, 0.0) });
    assert!(of(&specimen).warnings.iter().any(|w| w.contains("30 mm from the one that the bone shows")));
    let mut turned = give(&found.tibia, 0.0);
    turned.anterior = turned.anterior.map(|x| -x);
    specimen.given_frames = Some(GivenFrames { femur: give(&found.femur, 0.0), tibia: turned });
    let bones =
        Bones { surfaces: specimen.ct.clone(), patella: None, warnings: Vec::new(), metrics: Default::default() };
    let told = frames(&specimen, &bones, &FramesOptions::default()).unwrap_err().to_string();
    assert!(told.contains("tibia: anterior points backwards"), "{told}");
}

#[needs_shared]
fn epicondyles_agree_with_five_raters_on_a_whole_and_a_cropped_femur() {
    let Some(dir) = shared("raters", "femora/z013") else { return };
    let femur = mesh(&dir.join("z013_Femur_L.ply"));
    let tibfib = TriMesh::joined([&mesh(&dir.join("z013_Tibia_L.ply")), &mesh(&dir.join("z013_Fibula_L.ply"))]);
    let table = std::fs::read_to_string(dir.join("landmarks_5raters.csv")).unwrap();
    let mean = |name: &str| {
        let picks: Vec<Vector> = table
            .lines()
            .filter(|l| l.contains(name))
            .map(|l| {
                let x: Vec<f64> = l.rsplit(',').take(3).map(|x| x.parse().unwrap()).collect();
                Vector::new(x[2], x[1], x[0])
            })
            .collect();
        picks.iter().sum::<Vector>() / picks.len() as f64
    };
    let consensus = mean("Medial Epicondyle") - mean("Lateral Epicondyle");
    let axes = rough_axes(&femur, &tibfib, Side::Left).unwrap();
    assert_eq!(detect_side(&femur, &tibfib).unwrap().side, Side::Left);
    let cut = |bone: &TriMesh, d: &Vector| clipped(bone, &(axes.joint + d * 150.0), &-d);
    let mut specimen = bare(phantom("S192803-phantom"));
    specimen.ct = PerBone { femur: femur.clone(), tibfib: tibfib.clone() };
    let whole = of(&specimen).femur.medial;
    specimen.ct =
        PerBone { femur: cut(&femur, &axes.femur_shaft.direction), tibfib: cut(&tibfib, &axes.tibia_shaft.direction) };
    let cropped = of(&specimen).femur.medial;
    for (name, medial) in [("whole", whole), ("cropped", cropped)] {
        assert!(degrees(&medial, &consensus) < 2.5, "{name}: {}", degrees(&medial, &consensus));
    }
    assert!(degrees(&whole, &cropped) < 1.5, "{}", degrees(&whole, &cropped));
}

#[test]
fn a_tibia_turned_as_no_knee_at_rest_is_warned_of() {
    let told = |s: &Specimen| of(s).warnings.iter().any(|w| w.contains("an axis of one bone may be wrong"));
    let plain = bare(phantom("right-phantom"));
    assert!(!told(&plain));
    let f = of(&plain).tibia;
    let mut turned = plain;
    let turn = nalgebra::Rotation3::new(f.superior * 30f64.to_radians());
    turned.ct.tibfib.vertices.iter_mut().for_each(|p| *p = f.origin + turn * (*p - f.origin));
    assert!(told(&turned));
}

#[test]
fn a_tibia_shifted_as_no_knee_at_rest_is_warned_of() {
    let told = |s: &Specimen| of(s).warnings.iter().any(|w| w.contains("shifted against the femur"));
    let plain = bare(phantom("right-phantom"));
    assert!(!told(&plain));
    let f = of(&plain).tibia;
    for (way, mm, warned) in [
        (f.medial, 9.0, true),
        (f.medial, -9.0, true),
        (f.anterior, 14.0, true),
        (f.anterior, -14.0, true),
        (f.medial, 3.0, false),
        (f.superior, 3.0, false),
    ] {
        let mut moved = plain.clone();
        moved.ct.tibfib.vertices.iter_mut().for_each(|p| *p += way * mm);
        assert_eq!(told(&moved), warned, "{way:?} {mm}");
    }
}

/// Tibiae cut this far below the joint show no shaft.
const SHORT_MM: f64 = 38.0;

fn cut_short_shows_the_same_frame(name: &str, specimen: &Specimen, slants_deg: &[f64]) {
    let whole = of(specimen);
    let f = whole.tibia;
    for slant in slants_deg {
        let normal = f.superior + f.anterior * slant.to_radians().tan();
        let mut short = specimen.clone();
        short.ct.tibfib = clipped(&specimen.ct.tibfib, &(f.origin - f.superior * SHORT_MM), &normal.normalize());
        let found = of(&short);
        assert!(
            found.warnings.iter().any(|w| w.contains("the tibia's shaft is too short")),
            "{name}: {:?}",
            found.warnings
        );
        let (medial, superior) = (degrees(&f.medial, &found.tibia.medial), degrees(&f.superior, &found.tibia.superior));
        assert!(medial < 6.0 && superior < 7.0, "{name}, slant {slant}: medial {medial} superior {superior} deg");
    }
}

#[test]
fn a_phantom_s_tibia_without_a_shaft_takes_its_way_up_from_the_plateaus() {
    cut_short_shows_the_same_frame("right-phantom", &bare(phantom("right-phantom")), &[-20.0]);
}

#[needs_shared]
fn a_tibia_without_a_shaft_takes_its_way_up_from_the_plateaus() {
    let Some(dir) = shared("a tibia without a shaft", "specimens/S193761") else { return };
    cut_short_shows_the_same_frame("S193761", &crate::common::specimen(&dir, Side::Left), &[20.0]);
}
