//! Bodies and frames where they do not belong: menisci, a patella grown to the femur, an implant, given frames.

use super::{BUILT, SEGMENTS, built, change, checked, holds, knee, labels, nrrd, with_labels};
use crate::common::{json, text, write};
use meshes::volume::Labels;
use tempfile::TempDir;

/// The living knee with its labels changed, and more said of them in specimen.toml.
fn relabelled(edit: impl Fn(&mut Labels), more: &str) -> TempDir {
    let mut map = labels();
    edit(&mut map);
    let folder = with_labels("l.nrrd", nrrd(&map, std::slice::from_ref(&map.values), 1.0, ""));
    change(folder.path(), "[segmentation]\n", &format!("[segmentation]\n{more}"));
    folder
}

/// Voxels of nothing above (or of bone below) those of a label get another, so many of them: by the axis of the grid that runs up most.
fn beside(map: &mut Labels, of: u8, over: u8, label: u8, mm: f64, up: f64) {
    let axis = (0..3).max_by(|a, b| map.grid.axes[(2, *a)].abs().total_cmp(&map.grid.axes[(2, *b)].abs())).unwrap();
    let step = if map.grid.axes[(2, axis)] * up > 0.0 { 1isize } else { -1 };
    let count = (mm / map.grid.spacing()[axis]).round() as isize;
    let stride = map.grid.strides()[axis] as isize;
    let there: Vec<usize> = (0..map.values.len()).filter(|i| map.values[*i] == of).collect();
    for i in there {
        for n in 1..=count {
            let at = i as isize + n * step * stride;
            if let Some(value) = usize::try_from(at).ok().and_then(|at| map.values.get_mut(at)).filter(|v| **v == over)
            {
                *value = label;
            }
        }
    }
}

#[test]
fn menisci_on_the_wrong_side_are_told() {
    let more = "meniscus_medial = 10\nmeniscus_lateral = 9\n";
    let with = |medial: u8, lateral: u8| {
        relabelled(
            move |m| {
                beside(m, 2, 0, medial, 2.0, 1.0);
                beside(m, 3, 0, lateral, 2.0, 1.0);
            },
            more,
        )
    };
    let (code, words) = built(with(10, 9).path(), "ingest");
    assert!(code == 0 && !words.contains("other side"), "{words}");
    let (code, words) = built(with(9, 10).path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "segmentation.meniscus_medial", "exchanged"]);
}

#[test]
fn an_insert_of_an_implant_is_told() {
    let plate = relabelled(
        |m| {
            for label in [2, 3] {
                beside(m, label, 6, label, 8.0, -1.0);
            }
        },
        "",
    );
    let (_, words) = built(plate.path(), "cartilage");
    holds(&words, &["implant"]);
}

#[test]
fn a_patella_that_hangs_on_the_femur_is_told() {
    let fused = relabelled(
        |m| {
            let grid = m.grid.clone();
            let axis = (0..3).max_by(|a, b| grid.axes[(1, *a)].abs().total_cmp(&grid.axes[(1, *b)].abs())).unwrap();
            let stride = grid.strides()[axis];
            // the shortest way along the axis that runs backwards, made bone three voxels wide
            let mut best = (usize::MAX, 0, 0);
            for line in (0..m.values.len()).filter(|i| grid.voxel(*i)[axis] == 0) {
                let along: Vec<u8> = (0..grid.size[axis]).map(|n| m.values[line + n * stride]).collect();
                let at = |l: u8| along.iter().enumerate().filter(move |(_, v)| **v == l).map(|(n, _)| n);
                for (p, f) in at(7).flat_map(|p| at(5).map(move |f| (p, f))) {
                    let bare = (p.min(f) + 1..p.max(f)).all(|n| ![5, 7].contains(&along[n]));
                    if bare && p.abs_diff(f) < best.0 {
                        best = (p.abs_diff(f), line + p.min(f) * stride, p.max(f) - p.min(f));
                    }
                }
            }
            let sides: Vec<usize> = (0..3).filter(|k| *k != axis).map(|k| grid.strides()[k]).collect();
            for n in 0..=best.2 {
                for k in 0..25 {
                    let at = best.1 + n * stride + k % 5 * sides[0] + k / 5 * sides[1];
                    m.values[at - 2 * sides[0] - 2 * sides[1]] = 5;
                }
            }
            m.values.iter_mut().filter(|v| **v == 7).for_each(|v| *v = 5);
        },
        "",
    );
    change(fused.path(), "patella = 7\n", "");
    let (code, words) = built(fused.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "patella", "bridge"]);
    let (_, words) = built(relabelled(|_| {}, "").path(), "ingest");
    assert!(!words.contains("bridge"), "{words}");
}

#[test]
fn frames_in_another_unit_or_frame_are_refused_by_it() {
    let given = |edit: fn(f64, usize) -> f64| {
        let folder = knee(&BUILT);
        let mut frames = json(&BUILT.path().join("build/05-frames/frames.json"));
        for bone in ["femur", "tibia"] {
            let origin = frames[bone]["origin"].as_array_mut().unwrap();
            origin.iter_mut().enumerate().for_each(|(k, x)| *x = edit(x.as_f64().unwrap(), k).into());
        }
        write(&folder.path().join("frames.json"), frames.to_string());
        let toml = text(&folder.path().join("specimen.toml"));
        write(&folder.path().join("specimen.toml"), format!("{toml}\n[frames]\nfile = \"frames.json\"\n"));
        checked(folder.path())
    };
    let (code, words) = given(|x, _| x);
    assert!(code == 0 && !words.contains("[frames]"), "{words}");
    let (code, words) = given(|x, _| x / 1000.0);
    assert_eq!(code, 1, "{words}");
    holds(&words, &["frames.json", "metres", "1000"]);
    let (code, words) = given(|x, k| if k < 2 { -x } else { x });
    assert_eq!(code, 1, "{words}");
    holds(&words, &["frames.json", "RAS"]);
}

#[test]
fn a_tibia_without_its_fibula_is_told() {
    let without = relabelled(
        |m| {
            let grid = m.grid.clone();
            let axis = (0..3).max_by(|a, b| grid.axes[(2, *a)].abs().total_cmp(&grid.axes[(2, *b)].abs())).unwrap();
            let mut size = grid.size;
            size[axis] = 1;
            let slice = meshes::volume::Grid { size, ..grid.clone() };
            // of each section the largest piece stays
            for k in 0..grid.size[axis] {
                let at = |i: usize| {
                    let mut v = slice.voxel(i);
                    v[axis] = k;
                    grid.at(v)
                };
                let pieces = meshes::volume::components::components(&slice, |i| m.values[at(i)] == 6);
                let largest = (1..pieces.voxels.len()).max_by_key(|p| pieces.voxels[*p]).unwrap_or(0);
                for (i, piece) in pieces.piece.iter().enumerate().filter(|(_, p)| **p != 0) {
                    if *piece as usize != largest {
                        m.values[at(i)] = 0;
                    }
                }
            }
        },
        "",
    );
    let (code, words) = built(without.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    holds(&words, &["warning", "no fibular shaft", "side"]);
    let (_, words) = checked(without.path());
    assert_eq!(words.matches("no fibular shaft").count(), 1, "{words}");
}

#[test]
fn labels_of_femur_and_tibia_exchanged_are_told_by_their_table() {
    let folder = with_labels("l.nrrd", nrrd(&labels(), std::slice::from_ref(&labels().values), 1.0, ""));
    let toml = text(&folder.path().join("specimen.toml"));
    let [femur, tibia] = ["femur", "tibia"].map(|key| {
        let line = toml.lines().find(|l| l.starts_with(&format!("{key} = "))).unwrap();
        line.split(" = ").nth(1).unwrap().to_owned()
    });
    change(folder.path(), &format!("femur = {femur}\n"), "femur = X\n");
    change(folder.path(), &format!("tibia = {tibia}\n"), &format!("tibia = {femur}\n"));
    change(folder.path(), "femur = X\n", &format!("femur = {tibia}\n"));
    let (code, words) = checked(folder.path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["[segmentation]", "exchange"]);
    assert!(!words.contains("paths in [ct]"), "{words}");
}

#[test]
fn columns_of_one_bone_exchanged_are_named() {
    let orders: [([usize; 3], &str); 2] = [([1, 0, 2], "y, x, z"), ([2, 1, 0], "z, y, x")];
    for (order, words) in orders {
        let folder = knee(&BUILT);
        let path = folder.path().join("ct/femur.stl");
        let mut bytes = std::fs::read(&path).unwrap();
        for facet in bytes[84..].chunks_exact_mut(50) {
            for corner in facet[12..48].chunks_exact_mut(12) {
                let old = corner.to_vec();
                order
                    .iter()
                    .enumerate()
                    .for_each(|(k, from)| corner[4 * k..][..4].copy_from_slice(&old[4 * from..][..4]));
            }
        }
        write(&path, bytes);
        let (code, said) = checked(folder.path());
        assert_eq!(code, 1, "{said}");
        holds(&said, &["faced inwards", "two columns exchanged", words]);
    }
}

#[test]
fn check_reads_the_headers_of_a_dicom_series() {
    let folder = knee(&BUILT);
    let toml = text(&folder.path().join("specimen.toml"));
    let at = toml.find("[ct]").unwrap();
    let end = toml[at + 1..].find('[').map_or(toml.len(), |k| at + 1 + k);
    let toml = format!("{}[ct]\nvolume = \"ct/dicom\"\n\n{}", &toml[..at], &toml[end..]);
    write(&folder.path().join("specimen.toml"), toml);
    std::fs::create_dir_all(folder.path().join("ct/dicom")).unwrap();
    let slices = [
        include_bytes!("../corpus/dicom/lossless-0.dcm").as_slice(),
        include_bytes!("../corpus/dicom/lossless-1.dcm"),
        include_bytes!("../corpus/dicom/lossless-2.dcm"),
    ];
    let place = |k: usize| folder.path().join(format!("ct/dicom/IM{k}"));
    // a stack of ten, 1 mm apart
    let at = slices[0].windows(6).position(|w| w == b"1\\2\\0 ").unwrap();
    for k in 0..10usize {
        let mut bytes = slices[0].to_vec();
        bytes[at + 4] = b'0' + k as u8;
        write(&place(k), bytes);
    }
    let (_, words) = checked(folder.path());
    holds(&words, &["ok      ct.volume", "x 10 voxels", "a DICOM series of 10 slices, CT, axial"]);
    std::fs::remove_file(place(4)).unwrap();
    holds(&checked(folder.path()).1, &["FAULT   ct.volume", "1 slices are missing between"]);
    (0..10).for_each(|k| drop(std::fs::remove_file(place(k))));
    slices.iter().enumerate().for_each(|(k, bytes)| write(&place(k), bytes));
    // three slices are a series, and no knee
    let (code, words) = checked(folder.path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["FAULT   ct.volume", "[40, 48, 3] voxels"]);
    std::fs::remove_file(place(1)).unwrap();
    holds(&checked(folder.path()).1, &["FAULT   ct.volume", "2 slices"]);
    let other: Vec<u8> = slices[1].to_vec();
    let kind = other.windows(8).position(|w| w == [8, 0, 0x60, 0, b'C', b'S', 2, 0]).unwrap();
    let mut magnetic = other;
    magnetic[kind + 8..kind + 10].copy_from_slice(b"MR");
    write(&place(1), magnetic);
    holds(&checked(folder.path()).1, &["FAULT   ct.volume", "IM1", "kind MR", "expected CT"]);
}

#[test]
fn a_name_that_two_segments_have_is_refused_by_that_name() {
    let map = labels();
    let one_layer = std::slice::from_ref(&map.values);
    let named = |both: &str| {
        let segment = |(k, (label, name, key)): (usize, &(u8, &str, &str))| {
            let name = if key.starts_with("tibial") && !both.is_empty() { both } else { *name };
            format!("Segment{k}_Name:={name}\nSegment{k}_LabelValue:={label}\nSegment{k}_Layer:=0\n")
        };
        let segments: String = SEGMENTS.iter().enumerate().map(segment).collect();
        let folder = with_labels("l.seg.nrrd", nrrd(&map, one_layer, 1.0, &segments));
        for (label, name, key) in &SEGMENTS[1..3] {
            let name = if both.is_empty() { *name } else { both };
            change(folder.path(), &format!("{key} = {label}"), &format!("{key} = \"{name}\""));
        }
        checked(folder.path())
    };
    let (code, words) = named("Tibial cartilage");
    assert_eq!(code, 1, "{words}");
    holds(
        &words,
        &["segmentation.tibial_cartilage_medial: 2 segments are called \"Tibial cartilage\"", "a name of its own"],
    );
    let (code, words) = named("");
    assert_eq!(code, 0, "{words}");
}
