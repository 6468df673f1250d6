//! Ends of fibres held against the bones: a place that is missing, or in another unit or frame, lies far off.

use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use sim::spec::FibreSpec;
use std::collections::BTreeSet;

/// An end this far off its bone lies elsewhere, in a knee of [`WIDTH_MM`] [mm]; as of attachments.csv, half as far again as a rough point. Ours.
const OFF_MM: f64 = 15.0;
/// Middle extent of an adult's femur at the knee [mm]; the limit grows and shrinks with it. Ours.
const WIDTH_MM: f64 = 85.0;
/// The limit grows and shrinks no further than this: a whole femur's middle extent is no knee's width [-]. Ours.
const SIZES: [f64; 2] = [0.3, 1.3];
/// Ends that are named; more are counted.
const SHOWN: usize = 5;

/// Names the fibres of which an end lies far off its bone. A bone that the file does not show is `None`.
pub(crate) fn ends(fibres: &[FibreSpec], bones: [Option<&TriMesh>; 2]) -> Option<Notice> {
    let mut lost = Vec::new();
    for (name, bone, femur) in [("femur", bones[0], true), ("tibia", bones[1], false)] {
        let Some((query, limit)) = bone.and_then(|b| Some((SurfaceQuery::new(b)?, limit(b)))) else { continue };
        for f in fibres {
            let far = query.nearest(if femur { &f.femur } else { &f.tibia }).distance;
            if far > limit {
                lost.push(format!("{} ({far:.0} mm off the {name})", f.bundle));
            }
        }
    }
    let all = lost.len();
    lost.truncate(SHOWN);
    (all > 0).then(|| {
        let text = format!(
            "{all} ends of fibres lie far off their bone, the first: {}; check their places (missing, or of another body, frame or unit), or the bone's surface",
            lost.join(", ")
        );
        Kind::FibreEndsOffBone.notice(text).count(all)
    })
}

/// Fibres that stand at the same two points as one before them: an element that is there twice pulls twice.
pub(crate) fn copies(fibres: &[FibreSpec]) -> Option<Notice> {
    let mut seen = BTreeSet::new();
    let place = |f: &FibreSpec| [f.femur, f.tibia].map(|p| [p.x, p.y, p.z].map(f64::to_bits));
    let again: Vec<&FibreSpec> = fibres.iter().filter(|f| !seen.insert(place(f))).collect();
    let first = again.first()?;
    let text = format!(
        "{} fibres stand at the same two points as one before them, the first of {}: is an element there twice? Each pulls by itself",
        again.len(),
        first.bundle
    );
    Some(Kind::FibreCount.notice(text).of(&first.bundle).count(again.len()))
}

fn limit(bone: &TriMesh) -> f64 {
    let Some((low, high)) = bone.bounds() else { return OFF_MM };
    let mut extents: Vec<f64> = (high - low).iter().copied().collect();
    extents.sort_by(f64::total_cmp);
    OFF_MM * (extents[1] / WIDTH_MM).clamp(SIZES[0], SIZES[1])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use meshes::shapes::icosphere;
    use meshes::{Point, Vector};

    #[test]
    fn an_end_off_its_bone_is_named_and_moves_with_it() {
        let fibre = |name: &str, femur: f64, tibia: f64| FibreSpec {
            bundle: name.into(),
            femur: Point::new(0.0, 0.0, femur),
            tibia: Point::new(0.0, 0.0, tibia),
        };
        let shift = Vector::new(0.0, 0.0, -100.0);
        let femur = icosphere(42.5, 3);
        let mut tibia = femur.clone();
        tibia.vertices.iter_mut().for_each(|p| *p += shift);
        let both = [Some(&femur), Some(&tibia)];
        assert!(ends(&[fibre("LCL", -42.0, -58.0)], both).is_none());
        let told = ends(&[fibre("LCL", -42.0, -58.0), fibre("ACL", -62.5, -58.0)], both).unwrap();
        assert!(told.text.contains("1 ends") && told.text.contains("ACL (20 mm off the femur)"), "{}", told.text);
        assert!(ends(&[fibre("ACL", -62.5, -58.0)], [None, Some(&tibia)]).is_none());
        let twice = [fibre("LCL", -42.0, -58.0), fibre("ACL", -42.0, -57.0), fibre("LCL2", -42.0, -58.0)];
        assert!(copies(&twice[..2]).is_none());
        assert!(copies(&twice).unwrap().text.contains("1 fibres stand at the same two points"));
    }
}
