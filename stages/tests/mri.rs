//! Knees without scans: label maps and surfaces of MRI through ingest, bones and cartilage.

#![expect(clippy::unwrap_used, reason = "a test may fail by panicking")]

use crate::common::phantoms::made;
use crate::common::{bytes, shared};
use formats::{nifti, stl};
use meshes::measure::percentile;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::volume::Labels;
use needs_shared::needs_shared;
use stages::bones::{Bones, BonesOptions, bones};
use stages::cartilage::{Cartilage, CartilageOptions, cartilage};
use stages::ingest::ingest;
use stages::phantom::MRI_PHANTOM;
use stages::register::Registration;
use stages::specimen::{IngestOptions, RawSpecimen, Specimen};

fn raw() -> RawSpecimen {
    let mut raw = RawSpecimen::default();
    for (name, bytes) in made(MRI_PHANTOM).files.clone() {
        if name == "specimen.toml" {
            raw.toml = String::from_utf8(bytes).unwrap();
        } else {
            raw.files.insert(name, bytes);
        }
    }
    raw
}

fn built(specimen: &Specimen) -> (Bones, Cartilage) {
    let made = bones(specimen, &BonesOptions::default()).unwrap();
    let solids = cartilage(specimen, &Registration::left_out(), &made, &CartilageOptions::default()).unwrap();
    (made, solids)
}

/// Mean and 95th percentile of the distances of two surfaces, both ways [mm].
fn apart(a: &TriMesh, b: &TriMesh) -> (f64, f64) {
    let mut all = Vec::new();
    for (from, to) in [(a, b), (b, a)] {
        let query = SurfaceQuery::new(to).unwrap();
        all.extend(from.vertices.iter().map(|p| query.nearest(p).distance));
    }
    (all.iter().sum::<f64>() / all.len() as f64, percentile(&mut all, 0.95))
}

/// What is said of a specimen that must be refused.
fn told(raw: &RawSpecimen) -> String {
    // A specimen's Debug is megabytes long, so none is shown.
    match ingest(raw, &IngestOptions::default()) {
        Ok(specimen) => panic!("not refused: {:?}", specimen.warnings),
        Err(error) => error.to_string(),
    }
}

/// The phantom's label map changed voxel by voxel.
fn relabelled(raw: &RawSpecimen, change: impl Fn(&Labels, usize, u8) -> u8) -> RawSpecimen {
    let mut raw = raw.clone();
    let labels = nifti::read_labels(&raw.files["mri/labels.nii.gz"]).unwrap();
    let values = (0..labels.values.len()).map(|i| change(&labels, i, labels.values[i])).collect();
    let mut bytes = Vec::new();
    nifti::write_labels(&mut bytes, &Labels { values, ..labels.clone() }).unwrap();
    raw.files.insert("mri/labels.nii.gz".into(), bytes);
    raw
}

#[test]
fn a_label_map_gives_bones_and_cartilage_of_its_volumes_on_the_true_surfaces() {
    let raw = raw();
    let specimen = ingest(&raw, &IngestOptions::default()).unwrap();
    assert!(specimen.warnings.iter().any(|w| w.contains("register is left out")), "{:?}", specimen.warnings);
    let (made, solids) = built(&specimen);
    for (name, mesh) in made.surfaces.named() {
        let truth = stl::read(&raw.files[&format!("truth/bone_{name}.stl")]).unwrap();
        let (mean, p95) = apart(mesh, &truth);
        assert!(mean < 0.15 && p95 < 0.4, "{name}: {mean} {p95}");
    }
    for (name, part) in solids.solids.named() {
        let truth = match name {
            "femur" => "truth/femur.stl",
            "tibia_medial" => "truth/tibfib_medial.stl",
            _ => "truth/tibfib_lateral.stl",
        };
        let truth = stl::read(&raw.files[truth]).unwrap();
        assert!(Topology::of(&part.solid).is_closed());
        let (mean, p95) = apart(&part.solid, &truth);
        assert!(mean < 0.25 && p95 < 0.6, "{name}: {mean} {p95}");
        let given = solids.metrics.solids.get(name).unwrap().given_volume_mm3.unwrap();
        assert!((part.solid.volume() / given - 1.0).abs() < 0.04, "{name}: {} {given}", part.solid.volume());
        let bone = if name == "femur" { &made.surfaces.femur } else { &made.surfaces.tibfib };
        let query = SurfaceQuery::new(bone).unwrap();
        let bony = part.solid.submesh(|t| !part.articular[t]).0;
        let mut off: Vec<f64> = bony.vertices.iter().map(|p| query.nearest(p).distance).collect();
        assert!(percentile(&mut off, 0.95) < 0.15, "{name} stands {} mm off its bone", percentile(&mut off, 0.95));
    }
}

#[test]
fn specks_and_holes_are_mended_and_told() {
    let raw = raw();
    let clean = ingest(&raw, &IngestOptions::default()).unwrap();
    let dirty = relabelled(&raw, |labels, i, l| {
        let v = labels.grid.voxel(i);
        match l {
            0 if v.iter().all(|x| *x < 8) => 5,
            5 if v.iter().all(|x| x % 40 < 2) => 0,
            _ => l,
        }
    });
    let mended = ingest(&dirty, &IngestOptions::default()).unwrap();
    for word in ["loose pieces of femur", "within femur filled"] {
        assert!(mended.warnings.iter().any(|w| w.contains(word)), "{word}: {:?}", mended.warnings);
    }
    let (mean, p95) = apart(&clean.ct.femur, &mended.ct.femur);
    assert!(mean < 0.05 && p95 < 0.1, "{mean} {p95}");
}

#[test]
fn what_cannot_be_built_is_refused_in_one_sentence() {
    let raw = raw();
    let change = |from: &str, to: &str| RawSpecimen { toml: raw.toml.replace(from, to), ..raw.clone() };
    for (text, words) in [
        (told(&change("patella = 7", "patella = 6")), ["both label 6", "patella"]),
        (told(&change("femur = 5", "femur = 55")), ["no voxel has label 55", "5, 6"]),
        (told(&change("femur = 5", "femur = \"Femur\"")), ["no segment is called", "Femur"]),
        (told(&change("femoral_cartilage = 1", "femoral_cartilage = 0")), ["background", "femoral_cartilage"]),
        (
            told(&change("[segmentation]", "[scans]\nfemur = \"a\"\ntibfib = \"b\"\n\n[segmentation]")),
            ["both given", "[scans]"],
        ),
        (told(&relabelled(&raw, |_, _, l| if l == 2 { 0 } else { l })), ["tibial_cartilage_medial", "label 2"]),
        (
            told(&relabelled(&raw, |labels, i, l| if l == 0 && labels.grid.voxel(i)[0] == 0 { 9 } else { l.min(4) })),
            ["femur", "label 5"],
        ),
    ] {
        assert!(words.iter().all(|w| text.contains(w)), "{words:?}: {text}");
    }
    // a key whose label no voxel has
    let absent = change("patella = 7", "patella = 77");
    let told = ingest(&absent, &IngestOptions::default()).unwrap().warnings;
    assert!(told.iter().any(|w| w.contains("segmentation.patella") && w.contains("77")), "{told:?}");
    let unnamed = relabelled(&raw, |labels, i, l| if l == 0 && labels.grid.voxel(i)[0] == 0 { 9 } else { l });
    let specimen = ingest(&unnamed, &IngestOptions::default()).unwrap();
    assert!(specimen.warnings.iter().any(|w| w.contains("labels 9")), "{:?}", specimen.warnings);
}

#[test]
fn two_knees_and_the_wrong_side_are_refused() {
    let raw = raw();
    // both knees in one picture, side by side, the second a little smaller
    let labels = nifti::read_labels(&raw.files["mri/labels.nii.gz"]).unwrap();
    let [nx, ny, nz] = labels.grid.size;
    let mut both = Labels { grid: labels.grid.clone(), values: Vec::new() };
    both.grid.size[0] = 2 * nx;
    for row in labels.values.chunks_exact(nx) {
        both.values.extend(row);
        both.values.extend(row);
    }
    let lowest = nz / 4;
    both.values[2 * nx * ny * (nz - lowest)..].chunks_exact_mut(2 * nx).for_each(|row| row[nx..].fill(0));
    let mut bytes = Vec::new();
    nifti::write_labels(&mut bytes, &both).unwrap();
    let mut two = raw.clone();
    two.files.insert("mri/labels.nii.gz".into(), bytes);
    let text = told(&two);
    assert!(text.contains("femur") && text.contains("two pieces") && text.contains("one knee"), "{text}");
    let turned = RawSpecimen { toml: raw.toml.replace("side = \"right\"", "side = \"left\""), ..raw.clone() };
    let specimen = ingest(&turned, &IngestOptions::default()).unwrap();
    let made = bones(&specimen, &BonesOptions::default()).unwrap();
    let refused =
        cartilage(&specimen, &Registration::left_out(), &made, &CartilageOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("medial") && refused.contains("side"), "{refused}");
}

#[test]
fn surfaces_of_cartilage_closed_or_open_build_as_well() {
    let mut raw = raw();
    for (name, from) in [("ct/femur.stl", "truth/bone_femur.stl"), ("ct/tibfib.stl", "truth/bone_tibfib.stl")] {
        let bytes = raw.files[from].clone();
        raw.files.insert(name.into(), bytes);
    }
    let head = raw.toml.split("[segmentation]").next().unwrap().to_string();
    raw.toml = format!(
        "{head}[ct]\nfemur = \"ct/femur.stl\"\ntibfib = \"ct/tibfib.stl\"\n[cartilage]\nfemur = \"truth/femur.stl\"\ntibia_medial = \"truth/tibfib_medial.stl\"\ntibia_lateral = \"truth/tibfib_lateral.stl\"\n"
    );
    let specimen = ingest(&raw, &IngestOptions::default()).unwrap();
    let (_, closed) = built(&specimen);
    // the articular faces alone: what looks away from the bone
    let bone = SurfaceQuery::new(&specimen.ct.tibfib).unwrap();
    let solid = stl::read(&raw.files["truth/tibfib_medial.stl"]).unwrap();
    let (open, _) = solid.submesh(|t| {
        let [a, b, c] = solid.corners(t);
        bone.nearest(&meshes::Point::from((a.coords + b.coords + c.coords) / 3.0)).distance > 0.3
    });
    let mut bytes = Vec::new();
    stl::write(&mut bytes, &open).unwrap();
    raw.files.insert("truth/tibfib_medial.stl".into(), bytes);
    let (_, opened) = built(&ingest(&raw, &IngestOptions::default()).unwrap());
    for (name, part) in closed.solids.named() {
        let given = closed.metrics.solids.get(name).unwrap().given_volume_mm3.unwrap();
        assert!((part.solid.volume() / given - 1.0).abs() < 0.05, "{name}: {} {given}", part.solid.volume());
    }
    let [a, b] = [&closed, &opened].map(|c| c.solids.tibia_medial.solid.volume());
    assert!((b / a - 1.0).abs() < 0.06, "{a} closed, {b} open");
}

#[needs_shared]
fn the_shared_label_maps_are_built_within_their_limits() {
    let toml = "[specimen]\nid = \"a\"\nside = \"SIDE\"\n[segmentation]\nlabels = \"l.nrrd\"\nfemur = 5\ntibia = 6\nfibula = 8\npatella = 7\nfemoral_cartilage = 1\ntibial_cartilage_medial = 2\ntibial_cartilage_lateral = 3\npatellar_cartilage = 4\nmeniscus_medial = 10\nmeniscus_lateral = 9\n";
    for (name, side, limit) in [("S192803", "left", 0.04), ("kneeB", "right", 0.05)] {
        let Some(path) = shared("mri", &format!("mri/{name}/labels.nrrd")) else { return };
        let mut raw = RawSpecimen { toml: toml.replace("SIDE", side), ..RawSpecimen::default() };
        raw.files.insert("l.nrrd".into(), bytes(&path));
        let specimen = ingest(&raw, &IngestOptions::default()).unwrap();
        let (_, solids) = built(&specimen);
        for (part, solid) in solids.solids.named() {
            let given = solids.metrics.solids.get(part).unwrap().given_volume_mm3.unwrap();
            let volume = solid.solid.volume();
            assert!((volume / given - 1.0).abs() < limit, "{name} {part}: {volume} of {given}");
        }
        if name == "kneeB" {
            assert!(specimen.patella.is_some());
            // its fibula touches the tibia in a voxel
            assert_eq!(Topology::of(&specimen.ct.tibfib).components, 2);
            assert_eq!(
                solids.bodies.keys().collect::<Vec<_>>(),
                ["meniscus_lateral", "meniscus_medial", "patellar_cartilage"]
            );
        }
    }
}
