//! The literature atlas: Table 2 [andreassen2025] as rules in `atlas.toml`, placed on the bones at hand.

mod landmarks;

use crate::site::{Bone, Site, Source};
use landmarks::{condyle, fibular_apex, outline_point, plateau_point};
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use serde::Deserialize;
use std::sync::LazyLock;

/// What the rules refer to, CT frame.
#[derive(Clone, Copy, Debug)]
pub struct Anatomy<'a> {
    /// The femur's closed surface.
    pub femur: &'a TriMesh,
    /// The tibia's, with the fibula where there is one.
    pub tibfib: &'a TriMesh,
    /// The femur's frame: origin on the transepicondylar axis.
    pub femur_frame: &'a AnatomicalFrame,
    /// The tibia's axes at the joint line: origin midway between the plateaus.
    pub tibia_frame: &'a AnatomicalFrame,
    /// Medial and lateral epicondyle [mm].
    pub epicondyles: [Point; 2],
    /// Sites that were marked: where a source measures from a ligament's site, a marked one is the better start.
    pub marked: &'a [Site],
}

/// The mediolateral half of a bone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Half {
    /// Towards the body's midline.
    Medial,
    /// Away from it.
    Lateral,
}

/// How a place is found; lengths [mm] at an epicondylar width of [`WIDTH_MM`], directions medial, anterior, superior.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum At {
    /// An offset from an epicondyle.
    Epicondyle {
        /// Which.
        side: Half,
        /// Offset [mm].
        offset_mm: [f64; 3],
    },
    /// An offset from another ligament's site on the same bone: the marked one, else where the atlas has it.
    Site {
        /// The other ligament.
        ligament: String,
        /// Offset [mm].
        offset_mm: [f64; 3],
    },
    /// The back of a condyle.
    Condyle {
        /// Which.
        side: Half,
        /// Angle behind straight distal [deg].
        arc_deg: f64,
    },
    /// Shares of the epicondylar width from the origin of the femoral frame [-].
    Notch([f64; 3]),
    /// The tibia's outline.
    Outline {
        /// Below the joint line [mm].
        depth_mm: f64,
        /// Medial and anterior component of the way from the outline's middle.
        azimuth: [f64; 2],
    },
    /// Shares of the tibia's outline from its medial and its anterior edge [-], seen from above.
    Plateau([f64; 2]),
    /// An offset from the apex of the fibular head.
    Fibula {
        /// Offset [mm].
        offset_mm: [f64; 3],
    },
}

/// A rule.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Ligament name.
    pub ligament: String,
    /// The bone.
    pub bone: Bone,
    /// Where.
    pub at: At,
    /// Half axes of the region [mm].
    pub half_mm: [f64; 2],
    /// Direction of the first half axis: medial, anterior, superior.
    pub along: [f64; 3],
    /// Keys of the bibliography.
    pub cite: Vec<String>,
    /// How the source puts it, and what of it is ours.
    pub words: String,
}

/// The rules, one a ligament and bone.
pub static ATLAS: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Table {
        site: Vec<Rule>,
    }
    let table: Table = toml::from_str(include_str!("atlas.toml")).expect("the atlas shipped with the program parses");
    table.site
});

/// Epicondylar width that the atlas' lengths are meant for [mm]. Ours.
pub const WIDTH_MM: f64 = 82.0;

/// A rule that leads farther from the bone than this leads to where there is none, at the atlas' size [mm]. Ours.
const OFF_BONE_MM: f64 = 12.0;

/// Farthest that a covered place is moved to bare bone [mm]. Ours.
const BESIDE_MM: f64 = 25.0;
/// Bare vertices that are farther than the nearest by this count e times less [mm]: about a vertex' spacing. Ours.
const BLUR_MM: f64 = 1.5;

/// The ligament's site on `bone` by the literature, on the surface and at least `clearance_mm` from `cartilage` (surfaces that cover
/// bone); `None` where the bone lacks what the rule refers to (no fibula, a shaft cut short), or no rule exists.
pub fn place(
    anatomy: &Anatomy,
    ligament: &str,
    bone: Bone,
    cartilage: &[&SurfaceQuery],
    clearance_mm: f64,
) -> Option<Site> {
    let rule = ATLAS.iter().find(|r| r.ligament == ligament && r.bone == bone)?;
    let scale = (anatomy.epicondyles[0] - anatomy.epicondyles[1]).norm() / WIDTH_MM;
    let (mesh, frame) = match bone {
        Bone::Femur => (anatomy.femur, anatomy.femur_frame),
        Bone::Tibfib => (anatomy.tibfib, anatomy.tibia_frame),
    };
    let query = SurfaceQuery::new(mesh)?;
    let rough = found(anatomy, bone, &rule.at, scale)?;
    let covered = |p: &Point| cartilage.iter().any(|c| c.nearest(p).distance < clearance_mm);
    let nearest = query.nearest(&rough);
    if nearest.distance > OFF_BONE_MM * scale {
        return None;
    }
    let mut centroid = nearest.point;
    if covered(&centroid) {
        centroid = beside(&centroid, mesh, &query, &covered)?;
    }
    let (region, area_mm2) = ellipse(&centroid, rule, frame, scale, &query);
    let region: Vec<Point> = region.into_iter().filter(|p| !covered(p)).collect();
    Some(Site {
        ligament: ligament.to_owned(),
        bone,
        centroid,
        area_mm2,
        source: Source::Literature,
        projection_mm: 0.0,
        region: if region.is_empty() { vec![centroid] } else { region },
    })
}

/// Bare bone next to a covered place: the mean of the nearest bare vertices, so that no single one of them decides, laid on the bone.
fn beside(place: &Point, mesh: &TriMesh, bone: &SurfaceQuery, covered: &dyn Fn(&Point) -> bool) -> Option<Point> {
    let near = mesh.vertices.iter().map(|p| (*p, (p - place).norm()));
    let bare: Vec<(Point, f64)> = near.filter(|(p, d)| *d < BESIDE_MM && !covered(p)).collect();
    let least = bare.iter().map(|b| b.1).min_by(f64::total_cmp)?;
    let weigh = |d: f64| (-(d - least) / BLUR_MM).exp();
    let weight: f64 = bare.iter().map(|b| weigh(b.1)).sum();
    let mean = bare.iter().map(|(p, d)| p.coords * weigh(*d)).sum::<Vector>() / weight;
    let mean = bone.nearest(&mean.into()).point;
    let nearest = || bare.iter().map(|b| b.0).min_by(|a, b| (a - mean).norm().total_cmp(&(b - mean).norm()));
    if covered(&mean) { nearest() } else { Some(mean) }
}

fn found(anatomy: &Anatomy, bone: Bone, at: &At, scale: f64) -> Option<Point> {
    let (femur, tibia) = (anatomy.femur_frame, anatomy.tibia_frame);
    let along = |f: &AnatomicalFrame, c: &[f64; 3]| f.medial * c[0] + f.anterior * c[1] + f.superior * c[2];
    match at {
        At::Epicondyle { side, offset_mm } => {
            let end = anatomy.epicondyles[usize::from(*side == Half::Lateral)];
            Some(end + along(femur, offset_mm) * scale)
        }
        At::Site { ligament, offset_mm } => {
            let same = |s: &&Site| s.ligament == *ligament && s.bone == bone;
            let start = match anatomy.marked.iter().find(same) {
                Some(site) => site.centroid,
                None => {
                    let rule = ATLAS.iter().find(|r| r.ligament == *ligament && r.bone == bone)?;
                    found(anatomy, bone, &rule.at, scale)?
                }
            };
            let frame = if bone == Bone::Femur { femur } else { tibia };
            Some(start + along(frame, offset_mm) * scale)
        }
        At::Condyle { side, arc_deg } => condyle(anatomy.femur, femur, *side, *arc_deg),
        At::Notch(shares) => Some(femur.origin + along(femur, shares) * (scale * WIDTH_MM)),
        At::Outline { depth_mm, azimuth } => outline_point(anatomy.tibfib, tibia, depth_mm * scale, azimuth),
        At::Plateau(shares) => plateau_point(anatomy.tibfib, tibia, shares),
        At::Fibula { offset_mm } => Some(fibular_apex(anatomy.tibfib, tibia)? + along(tibia, offset_mm) * scale),
    }
}

/// Points of the rule's ellipse about 1 mm apart, laid on the surface; and its area [mm2].
fn ellipse(centre: &Point, rule: &Rule, frame: &AnatomicalFrame, scale: f64, bone: &SurfaceQuery) -> (Vec<Point>, f64) {
    let normal = bone.smooth_normal(&bone.nearest(centre));
    let wish = frame.medial * rule.along[0] + frame.anterior * rule.along[1] + frame.superior * rule.along[2];
    let flat = wish - normal * wish.dot(&normal);
    let u: Vector = flat.try_normalize(1e-6).unwrap_or_else(|| normal.cross(&frame.medial).normalize());
    let v = normal.cross(&u);
    let [a, b] = rule.half_mm.map(|h| h * scale);
    let steps = |half: f64| -> Vec<f64> {
        let n = half.ceil().max(1.0);
        (-(n as i64)..=n as i64).map(|i| i as f64 / n * half).collect()
    };
    let mut points = Vec::new();
    for x in steps(a) {
        for y in steps(b) {
            if (x / a).powi(2) + (y / b).powi(2) <= 1.0 {
                points.push(bone.nearest(&(centre + u * x + v * y)).point);
            }
        }
    }
    (points, std::f64::consts::PI * a * b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bundle::LIGAMENTS;

    #[test]
    fn every_ligament_has_one_cited_rule_a_bone() {
        for ligament in LIGAMENTS {
            for bone in [Bone::Femur, Bone::Tibfib] {
                let rules: Vec<&Rule> = ATLAS.iter().filter(|r| r.ligament == ligament && r.bone == bone).collect();
                assert_eq!(rules.len(), 1, "{ligament} {bone:?}");
                assert!(!rules[0].cite.is_empty() && !rules[0].words.is_empty());
                let on_femur =
                    matches!(rules[0].at, At::Epicondyle { .. } | At::Condyle { .. } | At::Notch(_) | At::Site { .. });
                assert_eq!(on_femur, bone == Bone::Femur, "{ligament}");
                if let At::Site { ligament: start, .. } = &rules[0].at {
                    let of_start = ATLAS.iter().find(|r| r.ligament == *start && r.bone == bone).unwrap();
                    assert!(!matches!(of_start.at, At::Site { .. }), "{ligament} from {start}: one step at most");
                }
            }
        }
        assert_eq!(ATLAS.len(), 20);
    }
}
