//! One picture in every format that is read, written by programs that are not ours: the same bones, and so the same model.
#![allow(clippy::unwrap_used, clippy::print_stderr, clippy::print_stdout, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at files and run other programs")]

use crate::common::{build_model, copy, differing, files, read, reads, text, write};
use formats::{dicom, picture, read_surface, stl};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::volume::Volume;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const BONES: [&str; 3] = ["femur", "tibfib", "patella"];
/// Most that bones of a picture may lie off: mean and 99th percentile [mm]; those of stages/tests/segment.rs.
const NEAR: [f64; 2] = [0.25, 0.8];
/// By so much more where the picture was packed with loss.
const LOSSY: f64 = 1.5;

/// A phantom whose bones or labels stand in a picture, and that picture in every format that could be written, by kind.
fn pictures(
    test: &str,
    id: &str,
    picture: &str,
    more: &[&str],
) -> Option<(TempDir, TempDir, BTreeMap<String, String>)> {
    let (specimen, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let made = if more.is_empty() { stages::phantom::phantom_volume(id, 1) } else { stages::phantom::phantom(id, 1) };
    for (name, bytes) in made.unwrap().files {
        let path = specimen.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write(&path, bytes);
    }
    let source = specimen.path().join(picture);
    let mut arguments = vec![source.to_str().unwrap(), out.path().to_str().unwrap()];
    arguments.extend(more);
    if !reads(test, "volumes.py", &arguments) {
        return None;
    }
    fs::remove_file(&source).unwrap();
    let mut kinds = BTreeMap::new();
    for entry in fs::read_dir(out.path()).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        if !name.ends_with(".raw") {
            kinds.insert(name.split('.').next().unwrap().to_owned(), name);
        }
    }
    Some((specimen, out, kinds))
}

/// The specimen with the picture of a kind, built up to a stage.
fn built(specimen: &Path, picture: &str, pictures: &Path, name: &str, to: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    copy(specimen, folder.path());
    let place = folder.path().join("picture");
    fs::create_dir_all(&place).unwrap();
    let from = pictures.join(name);
    if from.is_dir() {
        copy(&from, &place.join(name));
    } else {
        let stem = name.split('.').next().unwrap();
        for (file, bytes) in files(pictures).into_iter().filter(|(f, _)| f.split('.').next() == Some(stem)) {
            write(&place.join(file), bytes);
        }
    }
    let toml = folder.path().join("specimen.toml");
    let told = text(&toml).replace(picture, &format!("picture/{name}"));
    assert!(told.contains("picture/"), "{told}");
    write(&toml, told);
    build_model().arg(folder.path()).args(["--to", to, "--quiet"]).assert().success();
    folder
}

fn bones(build: &Path) -> Vec<TriMesh> {
    let path = |bone: &&str| build.join(format!("build/00-segment/{bone}.stl"));
    BONES.iter().map(|b| stl::read(&read(&path(b))).unwrap()).collect()
}

/// Mean and 99th percentile of the distance of `found`'s vertices from `right` [mm].
fn apart(found: &TriMesh, right: &TriMesh) -> [f64; 2] {
    let query = SurfaceQuery::new(right).unwrap();
    let mut d: Vec<f64> = found.vertices.iter().map(|p| query.signed_distance(p).abs()).collect();
    d.sort_by(f64::total_cmp);
    [d.iter().sum::<f64>() / d.len() as f64, d[d.len() * 99 / 100]]
}

/// The voxels that a picture's reader gives.
fn voxels(place: &Path, name: &str) -> Volume {
    let path = place.join(name);
    if !path.is_dir() {
        let beside = files(place).into_iter().filter(|(f, _)| f.ends_with(".raw")).collect();
        return picture::read_volume(name, &read(&path), &beside).unwrap();
    }
    let all = files(&path);
    let of: Vec<(&str, &[u8])> = all.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
    dicom::read_series(&of).unwrap().volume
}

/// The pictures of which bones are made: one of each family, DICOM's positions being decimals and NIfTI's floats, and each that was packed with loss.
fn is_built(kind: &str) -> bool {
    ["nrrd", "dicom", "enhanced_j2k"].contains(&kind) || kind.ends_with("lossy")
}

#[test]
fn a_ct_picture_gives_the_same_bones_in_every_format() {
    let test = "a_ct_picture_gives_the_same_bones_in_every_format";
    let picture = "ct/knee.nii.gz";
    let Some((specimen, out, kinds)) = pictures(test, "right-phantom", picture, &[]) else { return };
    let build = |name: &str, to: &str| built(specimen.path(), picture, out.path(), name, to);
    let plain = build(&kinds["nifti1"], "segment");
    let (right, right_voxels) = (bones(plain.path()), voxels(out.path(), &kinds["nifti1"]));
    let truth: Vec<TriMesh> =
        BONES.iter().map(|b| stl::read(&read(&specimen.path().join(format!("truth/ct_{b}.stl")))).unwrap()).collect();
    for (kind, name) in kinds.iter().filter(|k| k.0 != "nifti1") {
        let (found, lossy) = (voxels(out.path(), name), kind.ends_with("lossy"));
        let (a, b) = (&found.grid, &right_voxels.grid);
        // positions in DICOM and in a MetaImage are decimals
        let same = a.size == b.size && (a.origin - b.origin).norm() < 1e-3 && (a.axes - b.axes).amax() < 1e-5;
        println!("{kind}: grid {:?}, the same {same}", found.grid.size);
        if same && !lossy {
            assert!(found.values == right_voxels.values, "{kind} gives other voxels than NIfTI-1");
        }
        if same && !lossy && !is_built(kind) {
            continue;
        }
        let (found, factor) = (bones(build(name, "segment").path()), if lossy { LOSSY } else { 1.0 });
        for ((bone, f), (r, t)) in BONES.iter().zip(&found).zip(right.iter().zip(&truth)) {
            let (off, from_plain) = (apart(f, t), apart(f, r));
            println!(
                "{kind} {bone}: mean {:.3} mm, p99 {:.3} mm of the truth; {from_plain:.4?} of NIfTI's",
                off[0], off[1]
            );
            assert!(off[0] <= factor * NEAR[0] && off[1] <= factor * NEAR[1], "{kind} {bone}: {off:?}");
            assert!(lossy || from_plain[1] < 1e-3, "{kind} {bone}: {from_plain:?}");
        }
    }
    // from the same bones on everything is the same
    if let (Some(plain), Some(packed)) = (kinds.get("dicom"), kinds.get("enhanced_j2k")) {
        let model = |name: &str| text(&build(name, "assemble").path().join("build/09-assemble/model.json"));
        assert_eq!(model(plain), model(packed));
    }
}

#[test]
fn a_label_map_gives_the_same_surfaces_in_every_format() {
    let test = "a_label_map_gives_the_same_surfaces_in_every_format";
    let picture = "mri/labels.nii.gz";
    let Some((specimen, out, kinds)) = pictures(test, "mri-phantom", picture, &["--labels"]) else { return };
    let ingested = |name: &str| {
        let folder = built(specimen.path(), picture, out.path(), name, "ingest");
        let mut found = files(&folder.path().join("build/01-ingest"));
        found.retain(|name, _| name.ends_with(".ply"));
        assert!(!found.is_empty());
        found
    };
    let (right, right_voxels) = (ingested(&kinds["nifti1"]), voxels(out.path(), &kinds["nifti1"]));
    for (kind, name) in kinds.iter().filter(|k| k.0 != "nifti1") {
        // the same voxels on the same grid give the same surfaces: one of each family is built
        let read = voxels(out.path(), name);
        let same = read.grid == right_voxels.grid && read.values == right_voxels.values;
        println!("{kind}: the same voxels {same}");
        if same && !["nrrd", "metaimage"].contains(&kind.as_str()) {
            continue;
        }
        let found = ingested(name);
        let other = differing(&right, &found);
        println!(
            "{kind}: {} of {} surfaces are the same bytes",
            right.len() - other.len().min(right.len()),
            right.len()
        );
        // MetaImage holds the axes of an oblique grid as decimals
        if kind.starts_with("metaimage") {
            for (surface, bytes) in &right {
                let mesh = |bytes: &[u8]| read_surface(surface, bytes, &BTreeMap::new()).unwrap().mesh;
                let off = apart(&mesh(&found[surface]), &mesh(bytes));
                println!("{kind} {surface}: mean {:.5} mm, p99 {:.5} mm", off[0], off[1]);
                assert!(off[0] < 2e-3 && off[1] < 0.02, "{kind} {surface}: {off:?}");
            }
        } else {
            assert!(other.is_empty(), "{kind} gives other {other:?}");
        }
    }
}

/// The structures of the living phantom's label map, as specimen.toml has them.
const STRUCTURES: [&str; 6] = [
    "femoral_cartilage=1",
    "tibial_cartilage_medial=2",
    "tibial_cartilage_lateral=3",
    "femur=5",
    "tibia=6",
    "patella=7",
];

#[test]
fn a_dicom_segmentation_gives_the_surfaces_of_the_label_map() {
    let test = "a_dicom_segmentation_gives_the_surfaces_of_the_label_map";
    let picture = "mri/labels.nii.gz";
    let Some((specimen, out, kinds)) = pictures(test, "mri-phantom", picture, &STRUCTURES) else { return };
    let plain = TempDir::new().unwrap();
    for (name, bytes) in stages::phantom::phantom("mri-phantom", 1).unwrap().files {
        let path = plain.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write(&path, bytes);
    }
    build_model().arg(plain.path()).args(["--to", "ingest", "--quiet"]).assert().success();
    let surfaces = |folder: &Path| {
        let mut found = files(&folder.join("build/01-ingest"));
        found.retain(|name, _| name.ends_with(".ply"));
        found
    };
    let right = surfaces(plain.path());
    // segments have numbers of their own, from 1 on, so that their names are given
    let toml = specimen.path().join("specimen.toml");
    let named = STRUCTURES.iter().fold(text(&toml), |toml, structure| {
        let (key, label) = structure.split_once('=').unwrap();
        toml.replace(&format!("{key} = {label}\n"), &format!("{key} = \"{key}\"\n"))
    });
    write(&toml, named);
    for (kind, name) in &kinds {
        let folder = built(specimen.path(), picture, out.path(), name, "ingest");
        let found = surfaces(folder.path());
        assert_eq!(found.keys().collect::<Vec<_>>(), right.keys().collect::<Vec<_>>(), "{kind}");
        for (surface, bytes) in &right {
            let mesh = |bytes: &[u8]| read_surface(surface, bytes, &BTreeMap::new()).unwrap().mesh;
            let off = apart(&mesh(&found[surface]), &mesh(bytes));
            println!("{kind} {surface}: mean {:.5} mm, p99 {:.5} mm", off[0], off[1]);
            // places in DICOM are decimals
            assert!(off[0] < 2e-3 && off[1] < 0.02, "{kind} {surface}: {off:?}");
        }
    }
}
