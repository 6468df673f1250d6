//! Traits of other people's files, one a test: the model is right, or the file is refused by name, or the trait is told.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests write files")]
#![expect(clippy::type_complexity, reason = "a table of segments")]

mod bodies;
mod decks;
mod stated;
mod tables;

use crate::common::{build_model, copy, json, phantom, read, text, write};
use formats::{nifti, ply, read_surface, stl};
use meshes::surface::ColouredMesh;
use meshes::volume::Labels;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;

/// The phantom of most tests, built up to the attachments, whose fibres are given by hand in others.
static BUILT: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = phantom("S193761-phantom");
    build_model().arg(folder.path()).args(["--quiet", "--to", "attachments"]).assert().success();
    folder
});
/// The phantom of a living knee.
static LIVING: LazyLock<TempDir> = LazyLock::new(|| phantom("mri-phantom"));

fn knee(of: &LazyLock<TempDir>) -> TempDir {
    let folder = TempDir::new().unwrap();
    copy(of.path(), folder.path());
    let _ = std::fs::remove_dir_all(folder.path().join("build"));
    folder
}

/// What `check` says, with its faults.
fn checked(folder: &Path) -> (i32, String) {
    said(build_model().arg("check").arg(folder))
}

/// What a build up to a stage says, with its warnings.
fn built(folder: &Path, to: &str) -> (i32, String) {
    said(build_model().arg("build").arg(folder).args(["--to", to]))
}

fn said(command: &mut assert_cmd::Command) -> (i32, String) {
    let out = command.output().unwrap();
    let words = [out.stdout, out.stderr].concat();
    (out.status.code().unwrap_or(-1), String::from_utf8_lossy(&words).into_owned())
}

fn change(folder: &Path, from: &str, to: &str) {
    let file = folder.join("specimen.toml");
    let before = text(&file);
    assert!(before.contains(from), "{from} in {before}");
    write(&file, before.replace(from, to));
}

fn holds(words: &str, all: &[&str]) {
    for word in all {
        assert!(words.contains(word), "\"{word}\" is not in:\n{words}");
    }
}

type Six = [f64; 6];

/// The specimen with all fibres given by hand, each changed.
fn given(change: impl Fn(Six) -> Six) -> TempDir {
    let folder = knee(&BUILT);
    let table = text(&BUILT.path().join("build/06-attachments/fibres.csv"));
    let mut out = String::from("bundle,fibre,femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm\n");
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let ends: Vec<String> =
            change(std::array::from_fn(|k| cells[k + 2].parse().unwrap())).iter().map(|x| format!("{x:.6}")).collect();
        let _ = writeln!(out, "{},{},{}", cells[0], cells[1], ends.join(","));
    }
    write(&folder.path().join("attachments.csv"), out);
    folder
}

#[test]
fn given_fibres_are_held_against_the_bones() {
    let (code, words) = built(given(|e| e).path(), "attachments");
    assert!(code == 0 && !words.contains("attachments.csv: its"), "{words}");
    type Case = (fn(Six) -> Six, &'static [&'static str]);
    let cases: [Case; 5] = [
        (|e| e.map(|x| x / 1000.0), &["attachments.csv", "metres", "1000"]),
        (|e| e.map(|x| x / 10.0), &["attachments.csv", "centimetres", "10"]),
        (|[a, b, c, d, e, f]| [-a, -b, c, -d, -e, f], &["attachments.csv", "RAS", "ras"]),
        (|[a, b, c, d, e, f]| [d, e, f, a, b, c], &["attachments.csv", "exchanged"]),
        (|[a, b, c, d, e, f]| [b, a, c, e, d, f], &["attachments.csv"]),
    ];
    for (edit, wanted) in cases {
        let folder = given(edit);
        let (code, words) = checked(folder.path());
        assert_eq!(code, 1, "{words}");
        holds(&words, wanted);
    }
    let (code, words) = built(given(|[a, b, c, d, e, f]| [a, b + 15.0, c, d, e + 15.0, f]).path(), "attachments");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "attachments.csv", "shift"]);
}

#[test]
fn landmarks_in_metres_are_refused_with_the_factor() {
    let folder = knee(&BUILT);
    let mut out = String::from("name,frame,x_mm,y_mm,z_mm\n");
    for line in text(&folder.path().join("landmarks.csv")).lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let p: Vec<f64> = cells[2..].iter().map(|c| c.parse::<f64>().unwrap() / 1000.0).collect();
        let _ = writeln!(out, "{},{},{},{},{}", cells[0], cells[1], p[0], p[1], p[2]);
    }
    write(&folder.path().join("landmarks.csv"), out);
    let (code, words) = checked(folder.path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["landmarks.csv", "metres", "1000"]);
}

#[test]
fn units_in_a_list_are_heard() {
    let folder = knee(&BUILT);
    let mut points = Vec::new();
    for line in text(&folder.path().join("landmarks.csv")).lines().filter(|l| l.contains(",ct,")) {
        let cells: Vec<&str> = line.split(',').collect();
        let p: Vec<f64> = cells[2..].iter().map(|c| c.parse::<f64>().unwrap() / 10.0).collect();
        points.push(serde_json::json!({"label": cells[0], "position": p, "positionStatus": "defined"}));
    }
    let file = serde_json::json!({"markups": [{
        "type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": ["cm", "UCUM", "centimeter"], "controlPoints": points
    }]});
    std::fs::remove_file(folder.path().join("landmarks.csv")).unwrap();
    write(&folder.path().join("lm.mrk.json"), file.to_string());
    change(folder.path(), "landmarks.csv", "lm.mrk.json");
    let (code, words) = built(folder.path(), "frames");
    assert_eq!(code, 0, "{words}");
    let pose = |at: &Path| json(&at.join("build/05-frames/frames.json"))["gs_ct_pose"]["fe_deg"].as_f64().unwrap();
    assert!((pose(folder.path()) - pose(BUILT.path())).abs() < 0.5);
}

fn scan(folder: &Path) -> ColouredMesh {
    read_surface("scans/femur.ply", &read(&folder.join("scans/femur.ply")), &Default::default()).unwrap()
}

/// The specimen with another file in place of the femur's scan, and without marks.
fn with_scan(name: &str, files: &[(&str, Vec<u8>)]) -> TempDir {
    let folder = knee(&BUILT);
    std::fs::remove_file(folder.path().join("scans/femur.ply")).unwrap();
    std::fs::remove_file(folder.path().join("marks.csv")).unwrap();
    let marks = text(&folder.path().join("specimen.toml"));
    write(
        &folder.path().join("specimen.toml"),
        marks.lines().filter(|l| !l.starts_with("marks")).map(|l| format!("{l}\n")).collect::<String>(),
    );
    change(folder.path(), "scans/femur.ply", &format!("scans/{name}"));
    for (name, bytes) in files {
        write(&folder.path().join("scans").join(name), bytes);
    }
    folder
}

/// Sites of the femur that were found by their outlines.
fn marked(folder: &Path) -> usize {
    let sites = json(&folder.join("build/06-attachments/sites.json"));
    sites.as_array().unwrap().iter().filter(|s| s["bone"] == "femur" && s["source"] == "marked").count()
}

#[test]
fn colours_of_0_to_255_are_read_and_of_faces_told() {
    let scan = scan(BUILT.path());
    let mut obj = String::new();
    for (p, c) in scan.mesh.vertices.iter().zip(&scan.colours) {
        let _ = writeln!(obj, "v {} {} {} {} {} {}", p.x, p.y, p.z, c[0], c[1], c[2]);
    }
    scan.mesh.triangles.iter().for_each(|t| _ = writeln!(obj, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1));
    let folder = with_scan("femur.obj", &[("femur.obj", obj.into_bytes())]);
    let (code, words) = built(folder.path(), "attachments");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["0 to 255"]);
    assert_eq!(marked(folder.path()), marked(BUILT.path()));
    let mut faces = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        scan.mesh.vertices.len(),
        scan.mesh.triangles.len()
    );
    scan.mesh.vertices.iter().for_each(|p| _ = writeln!(faces, "{} {} {}", p.x, p.y, p.z));
    for t in &scan.mesh.triangles {
        let mean = |k: usize| t.iter().map(|&v| u32::from(scan.colours[v as usize][k])).sum::<u32>() / 3;
        let _ = writeln!(faces, "3 {} {} {} {} {} {}", t[0], t[1], t[2], mean(0), mean(1), mean(2));
    }
    let folder = with_scan("faces.ply", &[("faces.ply", faces.into_bytes())]);
    let (code, words) = built(folder.path(), "attachments");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["colours lie on the faces"]);
    assert!(marked(folder.path()) + 1 >= marked(BUILT.path()), "{words}");
}

#[test]
fn a_scan_of_one_colour_is_told() {
    let mut white = scan(BUILT.path());
    white.colours.fill([255; 3]);
    let mut bytes = Vec::new();
    ply::write_coloured(&mut bytes, &white).unwrap();
    let folder = with_scan("white.ply", &[("white.ply", bytes)]);
    let (_, words) = checked(folder.path());
    holds(&words, &["LOOK", "one colour", "no colours"]);
    let (code, words) = built(folder.path(), "attachments");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["scans.femur has colours, but", "literature"]);
}

#[test]
fn textures_of_another_machine_are_found_by_their_name() {
    let scan = scan(BUILT.path());
    let normals = scan.mesh.vertex_normals();
    let nearest = meshes::query::SurfaceQuery::new(&scan.mesh).unwrap();
    let _ = normals;
    let paint = |p: &meshes::Point, _: &meshes::Vector| {
        let near = nearest.nearest(p);
        let corners = scan.mesh.triangles[near.triangle as usize];
        std::array::from_fn(|k| {
            (0..3).map(|i| near.barycentric[i] * f64::from(scan.colours[corners[i] as usize][k])).sum()
        })
    };
    let made = crate::common::lines::textured(&scan.mesh, crate::common::lines::Picture::Png, paint);
    let file = |end: &str| made.iter().find(|(n, _)| n.ends_with(end)).unwrap().clone();
    let (obj, mtl, png) = (file(".obj"), file(".mtl"), file(".png"));
    let plain = String::from_utf8(mtl.1.clone()).unwrap();
    let variants = [
        (obj.1.clone(), plain.replace("map_Kd ", "map_Kd C:\\scans\\P01\\")),
        (
            String::from_utf8(obj.1.clone()).unwrap().replace("usemtl bone", "usemtl bone#0").into_bytes(),
            plain.replace("newmtl bone", "newmtl bone#0"),
        ),
        (obj.1.clone(), plain.replace("map_Kd", "map_Ka")),
    ];
    for (surface, library) in variants {
        let files =
            [(obj.0.as_str(), surface), (mtl.0.as_str(), library.into_bytes()), (png.0.as_str(), png.1.clone())];
        let folder = with_scan(&obj.0, &files);
        let (code, words) = checked(folder.path());
        assert_eq!(code, 0, "{words}");
        let line = words.lines().find(|l| l.contains("scans.femur")).unwrap();
        assert!(line.contains("coloured"), "{line}");
    }
}

#[test]
fn an_stl_whose_ends_are_two_words_is_read() {
    let folder = knee(&BUILT);
    let mesh = stl::read(&read(&folder.path().join("ct/femur.stl"))).unwrap();
    let mut out = String::from("solid mesh\n");
    for t in 0..mesh.triangles.len() {
        out += " facet normal 0 0 0\n  outer loop\n";
        mesh.corners(t).iter().for_each(|p| _ = writeln!(out, "   vertex {} {} {}", p.x, p.y, p.z));
        out += "  end loop\n end facet\n";
    }
    write(&folder.path().join("ct/femur.stl"), out + "end solid mesh\n");
    let (code, words) = checked(folder.path());
    assert_eq!(code, 0, "{words}");
}

#[test]
fn numbers_far_from_the_origin_are_told_with_their_step() {
    let folder = knee(&BUILT);
    for name in ["ct/femur.stl", "ct/tibfib.stl"] {
        let mut mesh = stl::read(&read(&folder.path().join(name))).unwrap();
        mesh.vertices.iter_mut().for_each(|p| p.x += 4_000_000.0);
        let mut bytes = Vec::new();
        stl::write(&mut bytes, &mesh).unwrap();
        write(&folder.path().join(name), bytes);
    }
    let (_, words) = checked(folder.path());
    holds(&words, &["steps of 0.25 mm"]);
}

/// The bones and scans times a factor.
fn scaled(factor: f64) -> TempDir {
    let folder = knee(&BUILT);
    for name in ["ct/femur.stl", "ct/tibfib.stl"] {
        let mut mesh = stl::read(&read(&folder.path().join(name))).unwrap();
        mesh.vertices.iter_mut().for_each(|p| *p *= factor);
        let mut bytes = Vec::new();
        stl::write(&mut bytes, &mesh).unwrap();
        write(&folder.path().join(name), bytes);
    }
    for name in ["scans/femur.ply", "scans/tibfib.ply"] {
        let mut scan = read_surface(name, &read(&folder.path().join(name)), &Default::default()).unwrap();
        scan.mesh.vertices.iter_mut().for_each(|p| *p *= factor);
        let mut bytes = Vec::new();
        ply::write_coloured(&mut bytes, &scan).unwrap();
        write(&folder.path().join(name), bytes);
    }
    for name in ["landmarks.csv", "marks.csv"] {
        let mut out = String::new();
        for (k, line) in text(&folder.path().join(name)).lines().enumerate() {
            let cells: Vec<String> = line
                .split(',')
                .enumerate()
                .map(|(i, c)| if k > 0 && i >= 2 { (c.parse::<f64>().unwrap() * factor).to_string() } else { c.into() })
                .collect();
            let _ = writeln!(out, "{}", cells.join(","));
        }
        write(&folder.path().join(name), out);
    }
    folder
}

#[test]
fn a_knee_that_no_adult_has_is_told() {
    let (code, words) = built(scaled(1.5).path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "adults'", "scale"]);
    let (code, words) = built(scaled(0.45).path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "adults'"]);
}

fn labels() -> Labels {
    nifti::read_labels(&read(&LIVING.path().join("mri/labels.nii.gz"))).unwrap()
}

/// The living knee with another file of labels.
fn with_labels(name: &str, bytes: Vec<u8>) -> TempDir {
    let folder = knee(&LIVING);
    std::fs::remove_file(folder.path().join("mri/labels.nii.gz")).unwrap();
    change(folder.path(), "mri/labels.nii.gz", &format!("mri/{name}"));
    write(&folder.path().join("mri").join(name), bytes);
    folder
}

/// An NRRD of bytes: `layers` beside each other at each voxel, coordinates times `unit`.
fn nrrd(labels: &Labels, layers: &[Vec<u8>], unit: f64, segments: &str) -> Vec<u8> {
    let g = &labels.grid;
    let axis = |k: usize| format!("({},{},{})", g.axes[(0, k)] * unit, g.axes[(1, k)] * unit, g.axes[(2, k)] * unit);
    let (list, none, kinds) = if layers.len() > 1 {
        (format!("{} ", layers.len()), "none ", "kinds: list domain domain domain\n")
    } else {
        (String::new(), "", "")
    };
    let head = format!(
        "NRRD0004\ntype: uchar\ndimension: {}\nspace: left-posterior-superior\nsizes: {list}{} {} {}\nspace directions: {none}{} {} {}\n{kinds}encoding: raw\nspace origin: ({},{},{})\n{segments}\n",
        3 + usize::from(layers.len() > 1),
        g.size[0],
        g.size[1],
        g.size[2],
        axis(0),
        axis(1),
        axis(2),
        g.origin.x * unit,
        g.origin.y * unit,
        g.origin.z * unit
    );
    let voxels = (0..labels.values.len()).flat_map(|v| layers.iter().map(move |layer| layer[v]));
    head.into_bytes().into_iter().chain(voxels).collect()
}

const SEGMENTS: [(u8, &str, &str); 6] = [
    (1, "Femoral Cartilage", "femoral_cartilage"),
    (2, "Medial", "tibial_cartilage_medial"),
    (3, "Lateral", "tibial_cartilage_lateral"),
    (5, "Femur", "femur"),
    (6, "Tibia", "tibia"),
    (7, "Patella", "patella"),
];

/// Volumes of the living knee's labels as a build up to ingest counts them [mm3].
fn volumes(folder: &Path) -> serde_json::Value {
    json(&folder.join("build/01-ingest/metrics.json"))["mri"]["label_volume_mm3"].clone()
}

#[test]
fn label_maps_of_other_programs_are_read_or_named() {
    let map = labels();
    let one = |bytes: &[u8], name: &str| with_labels(name, bytes.to_vec());
    let whole = nrrd(&map, std::slice::from_ref(&map.values), 1.0, "");
    let right = one(&whole, "l.nrrd");
    let (code, words) = built(right.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    // in centimetres, unstated
    let (code, words) = built(one(&nrrd(&map, std::slice::from_ref(&map.values), 0.1, ""), "l.nrrd").path(), "ingest");
    assert_eq!(code, 1, "{words}");
    holds(&words, &["centimetres", "10"]);
    // kinds that are named
    let slice = include_bytes!("corpus/dicom/enhanced-rle.dcm").to_vec();
    for (name, bytes, word) in
        [("l.dcm", slice, "segmentation"), ("l.img", vec![0; 600], ".hdr"), ("l.mgz", vec![1; 400], "FreeSurfer")]
    {
        let (code, words) = built(one(&bytes, name).path(), "ingest");
        assert!(code == 1 && words.contains(word), "{name}: {words}");
    }
    // 3D Slicer before 4.11: a layer a segment, no label values
    let layers: Vec<Vec<u8>> =
        SEGMENTS.iter().map(|(l, ..)| map.values.iter().map(|v| u8::from(v == l)).collect()).collect();
    let names = |field: &dyn Fn(usize, &(u8, &str, &str)) -> String| -> String {
        SEGMENTS.iter().enumerate().map(|(k, s)| format!("Segment{k}_Name:={}\n{}", s.1, field(k, s))).collect()
    };
    let old = one(&nrrd(&map, &layers, 1.0, &names(&|_, _| String::new())), "l.seg.nrrd");
    let (code, words) = built(old.path(), "ingest");
    assert!(code == 1 && words.contains("Femur"), "numbers say nothing there: {words}");
    for (number, name, key) in SEGMENTS {
        change(old.path(), &format!("{key} = {number}"), &format!("{key} = \"{name}\""));
    }
    let (code, words) = built(old.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    assert_eq!(volumes(old.path()), volumes(right.path()));
    // numbers mean label values, in whatever layer
    let stated = names(&|k, s| format!("Segment{k}_LabelValue:={}\nSegment{k}_Layer:={k}\n", s.0));
    let valued: Vec<Vec<u8>> =
        SEGMENTS.iter().map(|(l, ..)| map.values.iter().map(|v| if v == l { *l } else { 0 }).collect()).collect();
    let layered = one(&nrrd(&map, &valued, 1.0, &stated), "l.seg.nrrd");
    let (code, words) = built(layered.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    assert_eq!(volumes(layered.path()), volumes(right.path()));
}

#[test]
fn one_label_for_both_tibial_cartilages_is_parted_as_it_was() {
    let mut map = labels();
    let whole = nrrd(&map, std::slice::from_ref(&map.values), 1.0, "");
    let right = with_labels("l.nrrd", whole);
    assert_eq!(built(right.path(), "ingest").0, 0);
    map.values.iter_mut().filter(|v| **v == 3).for_each(|v| *v = 2);
    let folder = with_labels("l.nrrd", nrrd(&map, std::slice::from_ref(&map.values), 1.0, ""));
    change(folder.path(), "tibial_cartilage_lateral = 3", "tibial_cartilage_lateral = 2");
    let (code, words) = built(folder.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["both plateaus", "parted"]);
    for key in ["tibial_cartilage_medial", "tibial_cartilage_lateral"] {
        let [a, b] = [&folder, &right].map(|f| volumes(f.path())[key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 0.02, "{key}: {a} {b}");
    }
}

#[test]
fn labels_within_a_thousandth_of_whole_numbers_are_these() {
    let map = labels();
    let values = map.values.iter().map(|v| f32::from(*v) + if *v == 3 { 4.6e-5 } else { 0.0 }).collect();
    let mut bytes = Vec::new();
    nifti::write(&mut bytes, &meshes::volume::Volume { grid: map.grid.clone(), values }).unwrap();
    assert_eq!(nifti::read_labels(&bytes).unwrap().values, map.values);
}

#[test]
fn a_segmentation_of_dicom_is_merged_by_its_segments() {
    use crate::common::readers::segmentation;
    use formats::picture::read_labels;
    for kind in ["BINARY", "FRACTIONAL"] {
        let map = read_labels("l.dcm", &segmentation(kind), &Default::default()).unwrap();
        let grid = &map.labels.grid;
        assert_eq!((grid.size, map.overlapping), ([4, 3, 4], 2));
        assert!((grid.spacing()[2] - 0.5).abs() < 1e-9 && grid.origin == meshes::Point::new(1.0, 2.0, 0.0));
        assert_eq!(map.names, [("Femur".to_owned(), 1), ("Tibia".to_owned(), 2)]);
        let slice = |k: usize| &map.labels.values[12 * k..12 * (k + 1)];
        assert_eq!(slice(0), [1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2]);
        assert!(slice(1).iter().chain(slice(2)).all(|l| *l == 0) && slice(3).iter().all(|l| *l == 1));
        assert!(map.notes.iter().any(|n| n.contains("2 slices")), "{:?}", map.notes);
    }
    let told = |from: &[u8], to: &[u8]| {
        let bytes = segmentation("BINARY");
        let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
        let spoilt = [&bytes[..at], to, &bytes[at + to.len()..]].concat();
        read_labels("l.dcm", &spoilt, &Default::default()).err().unwrap().0
    };
    holds(&told(b"1.2.840.10008.1.2.1\0", b"1.2.840.10008.1.2.5\0"), &["packed", ".seg.nrrd"]);
    holds(&told(b"1.4.1.1.66.4", b"1.4.1.1.4811"), &["no segmentation"]);
    holds(&told(b"BINARY", b"SOMEHO"), &["SOMEHO", "BINARY"]);
}

#[test]
fn no_page_advises_a_package_of_another_project() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for page in ["README.md", "docs/python.md", "docs/cohorts.md", "python/README.md", "workflow/README.md"] {
        let words = text(&root.join(page));
        assert!(!words.contains("pip install genu") && !words.contains("pip install \"genu["), "{page}");
    }
}

#[test]
fn an_ankle_far_below_a_cropped_tibia_is_no_shifted_table() {
    let folder = knee(&BUILT);
    let file = folder.path().join("landmarks.csv");
    let ct = |l: &&str| l.split(',').nth(1) != Some("ct");
    let header_and_scans: Vec<String> = text(&file).lines().filter(ct).map(str::to_owned).collect();
    write(&file, header_and_scans.join("\n") + "\nankle_center,ct,0,0,-400\n");
    let (_, words) = checked(folder.path());
    assert!(!words.contains("off its surfaces"), "{words}");
    holds(&words, &["1 in ct"]);
}

#[test]
fn marks_of_two_ligaments_in_each_other_s_place_are_told() {
    for (a, b) in [("ACL", "PCL"), ("LCL", "sMCL")] {
        let folder = knee(&BUILT);
        let file = folder.path().join("marks.csv");
        let other = |l: &str| match l.split_once(',') {
            Some((name, rest)) if name == a => format!("{b},{rest}\n"),
            Some((name, rest)) if name == b => format!("{a},{rest}\n"),
            _ => format!("{l}\n"),
        };
        write(&file, text(&file).lines().map(other).collect::<String>());
        let (_, words) = built(folder.path(), "attachments");
        holds(&words, &[&format!("marks of {a} and {b} lie in each other's place")]);
    }
}

#[test]
fn a_hip_beside_the_knee_is_refused() {
    let folder = knee(&BUILT);
    let file = folder.path().join("landmarks.csv");
    let rest: String =
        text(&file).lines().filter(|l| !l.starts_with("femoral_head_center,ct")).map(|l| format!("{l}\n")).collect();
    write(&file, rest + "femoral_head_center,ct,300,0,0\n");
    let (code, words) = built(folder.path(), "frames");
    assert_eq!(code, 1, "{words}");
    holds(&words, &["femoral_head_center", "off the direction of the shaft"]);
}
