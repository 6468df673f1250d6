//! Outlined sites: those of the knees, and lines drawn in many ways whose region is known.

use crate::built::{Built, site_errors};
use crate::knees::Knee;
use crate::lines::{Ground, Line, Picture, Style, drawn, free_places, textured};
use crate::page::{Limit, Section};
use attachments::marks::{MarkOptions, find_outlines};
use attachments::site::Source;
use formats::read_surface;
use meshes::surface::ColouredMesh;

const STYLES: [(&str, Style, Ground); 7] = [
    ("1.5 mm", Style::Even(1.5), Ground { brown: false, clutter: false }),
    ("thick, 4 mm", Style::Even(4.0), Ground { brown: false, clutter: false }),
    ("thin, 1 mm", Style::Even(1.0), Ground { brown: false, clutter: false }),
    ("broken", Style::Broken(1.5), Ground { brown: false, clutter: false }),
    ("smeared", Style::Smeared(1.5), Ground { brown: false, clutter: false }),
    ("brown bone", Style::Even(1.5), Ground { brown: true, clutter: false }),
    ("sticker and screw beside", Style::Even(1.5), Ground { brown: false, clutter: true }),
];
/// Half axes of the ellipses drawn [mm].
const HALVES: [[f64; 2]; 3] = [[6.0, 4.5], [4.5, 4.0], [8.0, 5.0]];

pub(crate) fn section(knees: &[(&Knee, Built)]) -> Section {
    let mut page = Section::new(
        "Marks",
        "Drawn lines: wavy ellipses, half axes 4 to 8 mm, on bare bone of the scans; their truth is what the line's middle encloses. Thick: 4 mm. Thin: 1 mm, scan \
         vertices being 0.8 mm apart. Broken: a quarter missing. Smeared: wiped outwards by 4 mm over a quarter of the way round. Texture: \
         on CT bones of 1.5 mm edges, eight pixels an edge.",
    );
    for (knee, built) in knees {
        for (site, error) in site_errors(knee, built, Source::Marked) {
            page.add(
                "centroid of a marked site, as built [mm]",
                Limit::Most(1.2),
                &format!("{} {site}", knee.name),
                error,
            );
        }
        for (bone, scan) in knee.specimen.scans.named() {
            let lines = lines(scan);
            for (words, style, ground) in STYLES {
                let painted = drawn(scan, &lines, style, ground);
                judge(&mut page, &format!("{} {bone}", knee.name), words, &painted, scan, &lines);
            }
        }
    }
    for (knee, _) in knees.iter().take(2) {
        for (bone, ct) in knee.specimen.ct.named() {
            let plain = ColouredMesh { mesh: ct.clone(), colours: vec![[221, 199, 166]; ct.vertices.len()] };
            let lines = lines(&plain);
            for (words, style, ground) in STYLES {
                let picture = if style == Style::Broken(1.5) { Picture::Jpeg } else { Picture::Png };
                let bare =
                    if ground.brown { crate::lines::browned([221.0, 199.0, 166.0]) } else { [221.0, 199.0, 166.0] };
                let files =
                    textured(ct, picture, |p, n| lines.iter().fold(bare, |c, l| l.colour(c, style, ground, p, n)));
                let (obj, rest) = (&files[0].1, files[1..].iter().cloned().collect());
                let read = read_surface("scan.obj", obj, &rest).unwrap_or_default();
                judge(&mut page, &format!("{} {bone}", knee.name), &format!("{words}, texture"), &read, &plain, &lines);
            }
        }
    }
    page
}

pub(crate) fn lines(scan: &ColouredMesh) -> Vec<Line> {
    let places = free_places(scan, HALVES.len());
    places.into_iter().zip(HALVES).map(|((p, n), half)| Line::new(p, n, half)).collect()
}

fn judge(page: &mut Section, bone: &str, words: &str, painted: &ColouredMesh, scan: &ColouredMesh, lines: &[Line]) {
    let regions = find_outlines(painted, &MarkOptions::default());
    for (k, line) in lines.iter().enumerate() {
        let (area, centre) = line.region(&scan.mesh);
        let case = format!("{bone} line {k}");
        let near = regions.iter().min_by(|a, b| (a.centroid - centre).norm().total_cmp(&(b.centroid - centre).norm()));
        let near = near.filter(|r| (r.centroid - centre).norm() < 10.0);
        let off = near.map_or(f64::NAN, |r| (r.centroid - centre).norm());
        let percent = near.map_or(f64::NAN, |r| 100.0 * (r.area_mm2 / area - 1.0).abs());
        page.add(&format!("centroid, {words} [mm]"), Limit::Most(1.2), &case, off);
        page.add(&format!("area, {words} [%]"), Limit::Most(15.0), &case, percent);
    }
}
