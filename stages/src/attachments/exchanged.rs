//! Marks of two ligaments in each other's place: the names of a table exchanged.

use attachments::atlas::{self, Anatomy};
use attachments::site::{Bone, Site};
use meshes::Point;
use notices::{Kind, Notice};

/// Marks are taken for exchanged where the other way round they lie nearer to the literature's sites by this share [-]. Ours: right marks lie within
/// 10 mm of the literature's sites, exchanged ones on each other's.
const NEARER: f64 = 0.5;
/// Least distance by which they do [mm], at the atlas' size. Ours: the literature's own error.
const LEAST_GAIN_MM: f64 = 12.0;

/// Tells each pair of marked sites on one bone that lie in each other's place.
pub(super) fn warn(anatomy: &Anatomy, sites: &[Site], scale: f64, warnings: &mut Vec<Notice>) {
    for (bone, name) in [(Bone::Femur, "femur"), (Bone::Tibfib, "tibia")] {
        let own = |s: &Site| {
            atlas::place(anatomy, &s.ligament, bone, &[], 0.0).map(|l| (s.ligament.clone(), s.centroid, l.centroid))
        };
        let marked: Vec<(String, Point, Point)> = sites.iter().filter(|s| s.bone == bone).filter_map(own).collect();
        for (i, (a, at_a, usual_a)) in marked.iter().enumerate() {
            for (b, at_b, usual_b) in &marked[i + 1..] {
                let as_named = (at_a - usual_a).norm() + (at_b - usual_b).norm();
                let exchanged = (at_a - usual_b).norm() + (at_b - usual_a).norm();
                if exchanged < NEARER * as_named && as_named - exchanged > LEAST_GAIN_MM * scale {
                    warnings.push(Kind::MarksExchanged.notice(format!(
                        "on the {name} the marks of {a} and {b} lie in each other's place ({as_named:.0} mm from the literature's sites together, {exchanged:.0} mm the other way round): look at their names in marks.csv"
                    )).of(a));
                }
            }
        }
    }
}
