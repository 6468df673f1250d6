//! How deep the straight fibres run through bone, from the CT pose to 90 deg.

use super::Side;
use crate::PerBone;
use crate::frames::Frames;
use attachments::bundle::BUNDLES;
use attachments::layout::depth_inside;
use attachments::site::Fibre;
use meshes::{Point, Vector};
use nalgebra::{Rotation3, Unit};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// Flexions at which fibres are looked at beside the CT pose [deg]; those of the paper's protocols.
const FLEXIONS_DEG: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

/// Where a bundle runs deepest through a bone.
struct Deepest {
    mm: f64,
    /// None in the CT pose.
    flexion_deg: Option<f64>,
    in_ct_mm: f64,
}

/// Warns of bundles that run deeper through a bone than `limit` mm. Gives the greatest depth of each bundle [mm], of those that touch a bone.
///
/// Flexed by a turn of the tibia about the axis of the posterior condyles: no screw-home rotation, and no force.
pub(super) fn warn(
    sides: &PerBone<Side>,
    frames: &Frames,
    fibres: &[Fibre],
    limit: f64,
    warnings: &mut Vec<Notice>,
) -> BTreeMap<String, f64> {
    let mut depths = BTreeMap::new();
    for bundle in BUNDLES.iter() {
        let own: Vec<&Fibre> = fibres.iter().filter(|f| f.bundle == bundle.name).collect();
        for (side, of_femur) in [(&sides.femur, true), (&sides.tibfib, false)] {
            let at = |flexion: Option<f64>| {
                let turned = |p: &Point, forth: bool| flexion.map_or(*p, |f| flexed(frames, p, f, forth));
                let depth = |f: &&Fibre| match of_femur {
                    true => depth_inside(&f.femur, &turned(&f.tibia, true), side.query),
                    false => depth_inside(&turned(&f.femur, false), &f.tibia, side.query),
                };
                own.iter().map(depth).fold(0.0, f64::max)
            };
            let in_ct_mm = at(None);
            let mut deepest = Deepest { mm: in_ct_mm, flexion_deg: None, in_ct_mm };
            for flexion in FLEXIONS_DEG {
                let mm = at(Some(flexion));
                if mm > deepest.mm {
                    deepest = Deepest { mm, flexion_deg: Some(flexion), in_ct_mm };
                }
            }
            let most = depths.entry(bundle.name.clone()).or_insert(0.0);
            *most = deepest.mm.max(*most);
            if deepest.mm > limit {
                warnings.push(told(&bundle.name, side.name, &deepest, limit));
            }
        }
    }
    depths.retain(|_, mm| *mm > 0.0);
    depths
}

fn told(bundle: &str, bone: &str, d: &Deepest, limit: f64) -> Notice {
    let place = match d.flexion_deg {
        None => "in the CT pose".to_owned(),
        Some(flexion) => format!("at {flexion} deg ({:.1} mm in the CT pose)", d.in_ct_mm),
    };
    let deep = beside(d.mm, limit);
    Kind::ThroughBone.notice(format!(
        "bundle {bundle} runs up to {deep} mm deep through the {bone} {place}, more than {limit} mm: fibres are straight and do not wrap, so its length is too short there; look at its sites"
    )).of(bundle)
}

/// Decimals with which a depth is told, and most of them.
const DECIMALS: std::ops::Range<usize> = 1..6;

/// A value beyond its limit with as many decimals as it takes to read as beyond it.
fn beside(value: f64, limit: f64) -> String {
    let told = |decimals: usize| format!("{value:.decimals$}");
    let is_beyond = |text: &String| text.parse().is_ok_and(|x: f64| x > limit);
    DECIMALS.map(told).find(is_beyond).unwrap_or_else(|| value.to_string())
}

/// A point of the tibia when the knee is flexed to an angle, the femur staying where it is; or, not `forth`, a point of the femur the tibia staying.
fn flexed(frames: &Frames, p: &Point, flexion_deg: f64, forth: bool) -> Point {
    let (centre, medial) = frames.condylar_axis;
    let f = &frames.femur;
    // flexion takes what is inferior backwards
    let sense = medial.cross(&f.superior).dot(&f.anterior).signum();
    let angle = sense * (flexion_deg - frames.gs_ct_pose.fe_deg).to_radians() * if forth { 1.0 } else { -1.0 };
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(medial), angle);
    let arm: Vector = p - centre;
    centre + turn * arm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::GroodSuntayPose;
    use meshes::frame::AnatomicalFrame;

    /// Frames of a knee in LPS in extension, its condylar axis at the origin.
    fn frames(medial_x: f64) -> Frames {
        let (medial, anterior) = (Vector::new(medial_x, 0.0, 0.0), Vector::new(0.0, -1.0, 0.0));
        let frame = AnatomicalFrame { origin: Point::origin(), medial, anterior, superior: Vector::z() };
        Frames {
            femur: frame,
            tibia: frame,
            joint_line: frame,
            gs_ct_pose: GroodSuntayPose { fe_deg: 0.0, vv_deg: 0.0, ie_deg: 0.0, ml_mm: 0.0, ap_mm: 0.0, si_mm: 0.0 },
            condylar_axis: (Point::origin(), medial),
            condylar_radius_mm: 20.0,
            condylar_angle_deg: 3.0,
            epicondyles: [Point::origin(); 2],
            warnings: vec![],
            metrics: Default::default(),
        }
    }

    #[test]
    fn flexion_takes_the_shank_backwards_on_either_side() {
        let ankle = Point::new(0.0, 0.0, -400.0);
        for medial_x in [1.0, -1.0] {
            let frames = frames(medial_x);
            let flexed_ankle = flexed(&frames, &ankle, 90.0, true);
            // LPS: posterior is +y
            assert!((flexed_ankle - Point::new(0.0, 400.0, 0.0)).norm() < 1e-9, "{flexed_ankle}");
            // seen from the tibia the femur goes the other way
            assert!((flexed(&frames, &flexed_ankle, 90.0, false) - ankle).norm() < 1e-9);
        }
    }

    #[test]
    fn a_warning_names_bundle_bone_depth_flexion_and_what_it_means() {
        let deepest = Deepest { mm: 8.83, flexion_deg: Some(60.0), in_ct_mm: 3.21 };
        let words = told("PCAP_L", "femur", &deepest, 2.0);
        for part in ["PCAP_L", "femur", "8.8 mm", "at 60 deg", "3.2 mm in the CT pose", "do not wrap"] {
            assert!(words.contains(part), "{words}");
        }
    }

    #[test]
    fn a_depth_beyond_its_limit_reads_beyond_it() {
        assert_eq!([2.04, 2.004, 3.21].map(|mm| beside(mm, 2.0)), ["2.04", "2.004", "3.2"]);
    }
}
