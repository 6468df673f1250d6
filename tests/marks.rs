//! Outlines drawn in many ways on a scan, against the region that they enclose: laws of the method that no specimen shows.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::lines::{Ground, Line, Picture, Style, browned, drawn, free_places, textured};
use attachments::marks::{MarkOptions, find_outlines, region::Region};
use formats::read_surface;
use meshes::surface::ColouredMesh;
use stages::ingest::ingest;
use stages::specimen::{IngestOptions, RawSpecimen, Specimen};

const BONE: [f64; 3] = [221.0, 199.0, 166.0];
const PLAIN: Ground = Ground { brown: false, clutter: false };

fn phantom() -> Specimen {
    let mut raw = RawSpecimen::default();
    for (name, bytes) in crate::common::phantoms::made("S192803-phantom").files.clone() {
        if name == "specimen.toml" {
            raw.toml = String::from_utf8(bytes).unwrap();
        } else {
            raw.files.insert(name, bytes);
        }
    }
    ingest(&raw, &IngestOptions::default()).unwrap()
}

fn three_lines(scan: &ColouredMesh) -> Vec<Line> {
    let places = free_places(scan, 3);
    assert_eq!(places.len(), 3, "places for lines");
    places.into_iter().zip([[6.0, 4.5], [4.5, 4.0], [8.0, 5.0]]).map(|((p, n), half)| Line::new(p, n, half)).collect()
}

/// Each line found, its centroid within 1.2 mm and its area within 15 %.
fn assert_found(what: &str, regions: &[Region], lines: &[Line], scan: &ColouredMesh) {
    for (k, line) in lines.iter().enumerate() {
        let (area, centre) = line.region(&scan.mesh);
        let off = |r: &&Region| (r.centroid - centre).norm();
        let near = regions.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_else(|| panic!("{what}: none"));
        let percent = 100.0 * (near.area_mm2 / area - 1.0);
        assert!(off(&near) < 1.2, "{what}, line {k}: {:.2} mm off", off(&near));
        assert!(percent.abs() < 15.0, "{what}, line {k}: area {percent:.1} % off");
    }
}

#[test]
fn thick_thin_broken_and_smeared_lines_on_any_ground_enclose_what_they_do() {
    let scan = phantom().scans.femur;
    let lines = three_lines(&scan);
    let plainly = find_outlines(&scan, &MarkOptions::default()).len();
    for (style, ground) in [
        (Style::Even(1.5), PLAIN),
        (Style::Even(4.0), PLAIN),
        (Style::Even(1.0), PLAIN),
        (Style::Broken(1.5), PLAIN),
        (Style::Smeared(1.5), PLAIN),
        (Style::Even(1.5), Ground { brown: true, clutter: false }),
        (Style::Even(1.5), Ground { brown: false, clutter: true }),
    ] {
        let regions = find_outlines(&drawn(&scan, &lines, style, ground), &MarkOptions::default());
        assert_found(&format!("{style:?} {ground:?}"), &regions, &lines, &scan);
        assert_eq!(regions.len(), plainly + lines.len(), "{style:?} {ground:?}: outlines besides those drawn");
    }
}

#[test]
fn lines_in_the_texture_of_a_coarse_obj_are_found_as_finely() {
    let ct = phantom().ct.femur;
    let plain = ColouredMesh { colours: vec![BONE.map(|x| x as u8); ct.vertices.len()], mesh: ct };
    let lines = three_lines(&plain);
    for (picture, style, brown) in [
        (Picture::Png, Style::Even(1.0), false),
        (Picture::Jpeg, Style::Broken(1.5), false),
        (Picture::Jpeg, Style::Smeared(1.5), true),
    ] {
        let bare = if brown { browned(BONE) } else { BONE };
        let ground = Ground { brown, clutter: true };
        let files =
            textured(&plain.mesh, picture, |p, n| lines.iter().fold(bare, |c, l| l.colour(c, style, ground, p, n)));
        let rest = files[1..].iter().cloned().collect();
        let read = read_surface("scan.obj", &files[0].1, &rest).unwrap();
        let regions = find_outlines(&read, &MarkOptions::default());
        assert_found(&format!("{picture:?} {style:?}"), &regions, &lines, &plain);
        assert_eq!(regions.len(), lines.len(), "{picture:?} {style:?}");
    }
}
