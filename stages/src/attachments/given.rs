//! Fibres given by hand beside the places of the literature; and sites that scans with colours might have shown.

use crate::specimen::Specimen;
use attachments::atlas::{Anatomy, place};
use attachments::bundle::{BUNDLES, LIGAMENTS};
use attachments::site::{Bone, Fibre, Site, Source};
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// A given site this far from the literature's place is told, at the atlas' size [mm]: the literature's largest error, as of marks.
const FAR_MM: f64 = 15.0;
/// All given sites of a bone together lie this near to the literature's in the mean, at the atlas' size [mm]: errors of single sites cancel. Ours.
const SHIFT_MM: f64 = 7.0;
/// Sites from which on a common shift is looked for.
const LEAST_SITES: usize = 4;

/// Warns where given fibres end far from where the literature has their ligament, each and all together.
pub(super) fn compare(anatomy: &Anatomy, given: &[Fibre], scale: f64, warnings: &mut Vec<Notice>) {
    for (bone, name) in [(Bone::Femur, "femur"), (Bone::Tibfib, "tibia")] {
        let mut offs: Vec<(&str, Vector)> = Vec::new();
        for ligament in LIGAMENTS {
            let of = |f: &&Fibre| BUNDLES.iter().any(|b| b.ligament == ligament && b.name == f.bundle);
            let ends: Vec<Point> =
                given.iter().filter(of).map(|f| if bone == Bone::Femur { f.femur } else { f.tibia }).collect();
            let Some(usual) = place(anatomy, ligament, bone, &[], 0.0).filter(|_| !ends.is_empty()) else { continue };
            let middle = ends.iter().map(|p| p.coords).sum::<Vector>() / ends.len() as f64;
            offs.push((ligament, middle - usual.centroid.coords));
        }
        if offs.is_empty() {
            continue;
        }
        let mean = offs.iter().map(|(_, off)| off).sum::<Vector>() / offs.len() as f64;
        if offs.len() >= LEAST_SITES && mean.norm() > SHIFT_MM * scale {
            let frame = if bone == Bone::Femur { anatomy.femur_frame } else { anatomy.tibia_frame };
            let [m, a, s] = [frame.medial, frame.anterior, frame.superior].map(|axis| mean.dot(&axis));
            warnings.push(Kind::GivenShifted.notice(format!(
                "attachments.csv: its {} sites on the {name} lie {:.0} mm from their usual places together ({m:+.0} medial, {a:+.0} anterior, {s:+.0} superior), expected within {:.0}: a shift, or another frame than [ct]",
                offs.len(), mean.norm(), SHIFT_MM * scale
            )).file("attachments.csv").of(name));
        }
        let far: Vec<String> = offs
            .iter()
            .filter(|(_, off)| off.norm() > FAR_MM * scale)
            .map(|(ligament, off)| format!("{ligament} {:.0} mm", off.norm()))
            .collect();
        if !far.is_empty() {
            warnings.push(
                Kind::GivenFar
                    .notice(format!(
                        "attachments.csv: given sites on the {name} lie far from the literature's places: {}",
                        far.join(", ")
                    ))
                    .file("attachments.csv")
                    .of(name),
            );
        }
    }
}

/// Says which sites the literature gives although a scan with colours might have shown them.
pub(super) fn tell_unmarked(specimen: &Specimen, sites: &[Site], warnings: &mut Vec<Notice>) {
    for (bone, name, scan) in
        [(Bone::Femur, "femur", &specimen.scans.femur), (Bone::Tibfib, "tibfib", &specimen.scans.tibfib)]
    {
        if scan.colours.is_empty() {
            continue;
        }
        let own: Vec<&str> = sites
            .iter()
            .filter(|s| s.bone == bone && s.source == Source::Literature)
            .map(|s| s.ligament.as_str())
            .collect();
        let why = match scan.colours.iter().all(|c| *c == scan.colours[0]) {
            true => "its colours are all one",
            false => "no closed outline was found for them",
        };
        if !own.is_empty() {
            warnings.push(
                Kind::Unmarked
                    .notice(format!("scans.{name} has colours, but {} come from the literature: {why}", own.join(", ")))
                    .of(name),
            );
        }
    }
}
