//! Fibres given by hand beside the places of the literature; and sites that scans with colours might have shown.

use crate::specimen::Specimen;
use attachments::atlas::{Anatomy, place};
use attachments::bundle::{BUNDLES, LIGAMENTS};
use attachments::site::{Bone, Fibre, Site, Source};
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// A given site this far from the literature's place is told, at the atlas' size [mm]: the literature's largest error, as of marks.
const FAR_MM: f64 = 15.0;
/// The tibial sites of the cruciates are told from so far on [mm]: in two published knees and two phantoms they lie 4.6 to 8.4 off. Ours.
const CRUCIATE_FAR_MM: f64 = 10.5;
/// And where they lie less or more medial of the literature's places, at the atlas' size [mm]: between the eminences they have little room. In those
/// knees they lie 1.3 to 6.5 medial; three more either way. Ours.
const CRUCIATE_MEDIAL_MM: [f64; 2] = [-2.0, 9.5];
/// The cruciates.
const CRUCIATES: [&str; 2] = ["ACL", "PCL"];
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
        let frame = if bone == Bone::Femur { anatomy.femur_frame } else { anatomy.tibia_frame };
        let along = |off: &Vector| [frame.medial, frame.anterior, frame.superior].map(|axis| off.dot(&axis));
        let words = |off: &Vector| {
            let [m, a, s] = along(off);
            format!("{m:+.0} medial, {a:+.0} anterior, {s:+.0} superior")
        };
        let mean = offs.iter().map(|(_, off)| off).sum::<Vector>() / offs.len() as f64;
        if offs.len() >= LEAST_SITES && mean.norm() > SHIFT_MM * scale {
            warnings.push(Kind::GivenShifted.notice(format!(
                "attachments.csv: its {} sites on the {name} lie {:.0} mm from their usual places together ({}), expected within {:.0}: a shift, or another frame than [ct]",
                offs.len(), mean.norm(), words(&mean), SHIFT_MM * scale
            )).file("attachments.csv").of(name));
        }
        let far: Vec<String> = offs
            .iter()
            .filter(|(ligament, off)| is_far((*ligament, bone), off.norm(), along(off)[0], scale))
            .map(|(ligament, off)| format!("{ligament} {:.0} mm ({})", off.norm(), words(off)))
            .collect();
        if !far.is_empty() {
            warnings.push(
                Kind::GivenFar
                    .notice(format!(
                        "attachments.csv: given sites on the {name} lie far from the literature's places: {}; look at them on the bone, and at their columns",
                        far.join(", ")
                    ))
                    .file("attachments.csv")
                    .of(name),
            );
        }
    }
}

/// Whether a site lies farther from the literature's place than such sites do: `off` [mm], of which so much `medial` [mm].
fn is_far((ligament, bone): (&str, Bone), off: f64, medial: f64, scale: f64) -> bool {
    let [low, high] = CRUCIATE_MEDIAL_MM.map(|mm| mm * scale);
    match CRUCIATES.contains(&ligament) && bone == Bone::Tibfib {
        true => off > CRUCIATE_FAR_MM * scale || !(low..=high).contains(&medial),
        false => off > FAR_MM * scale,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// How far published sites and those of phantoms lie off, and how far medial [mm]: the most of each kind.
    const HONEST: [(&str, Bone, f64, f64); 6] = [
        ("ACL", Bone::Tibfib, 8.4, 6.5),
        ("ACL", Bone::Tibfib, 7.5, 4.0),
        ("PCL", Bone::Tibfib, 7.7, 1.3),
        ("PCL", Bone::Tibfib, 5.6, 5.5),
        ("ACL", Bone::Femur, 11.2, 0.4),
        ("POL", Bone::Femur, 14.4, 1.5),
    ];

    #[test]
    fn sites_as_knees_have_them_are_not_far_and_cruciates_moved_by_8_mm_across_are() {
        for scale in [0.9, 1.0, 1.1] {
            for (ligament, bone, off, medial) in HONEST {
                assert!(!is_far((ligament, bone), scale * off, scale * medial, scale), "{ligament} {off} {scale}");
                for by in [-8.0 * scale, 8.0 * scale] {
                    let (was, rest) = (scale * medial, scale * (off * off - medial * medial).sqrt());
                    let moved = (was + by).hypot(rest);
                    let told = is_far((ligament, bone), moved, was + by, scale);
                    // one that the move brings nearer to the literature's place cannot be told
                    let nearer = moved < scale * off;
                    assert!(told || bone == Bone::Femur || nearer, "{ligament} {by} {scale}");
                }
            }
            assert!(is_far(("POL", Bone::Femur), 15.1 * scale, 0.0, scale));
        }
    }
}
