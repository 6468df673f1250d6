//! Marks or given fibres of two ligaments or bundles in each other's place: the names of a table exchanged.

use attachments::atlas::{self, Anatomy};
use attachments::site::{Bone, Fibre, Site, Source};
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// Marks are taken for exchanged where the other way round they lie nearer to the literature's sites by this share [-]. Ours: right marks lie within
/// 10 mm of the literature's sites, exchanged ones on each other's.
const NEARER: f64 = 0.5;
/// Least distance by which they do [mm], at the atlas' size. Ours: the literature's own error.
const LEAST_GAIN_MM: f64 = 12.0;

/// Least distance by which two bundles of one ligament do, on both bones together [mm]. Ours: a third of that of the bundles of a cruciate.
const LEAST_GAIN_OF_BUNDLES_MM: f64 = 6.0;

/// Tells each pair of sites of one source on one bone that lie in each other's place.
pub(super) fn warn(anatomy: &Anatomy, all: &[Site], source: Source, scale: f64, warnings: &mut Vec<Notice>) {
    let (what, file) = if source == Source::Given { ("fibres", "attachments.csv") } else { ("marks", "marks.csv") };
    let sites: Vec<Site> = all.iter().filter(|s| s.source == source).cloned().collect();
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
                        "on the {name} the {what} of {a} and {b} lie in each other's place ({as_named:.0} mm from the literature's sites together, {exchanged:.0} mm the other way round): look at their names in {file}"
                    )).of(a));
                }
            }
        }
    }
}

/// Fibres of a bundle given by hand, and where the rule lays those of that bundle in the same sites: the middles of both ends [mm].
pub(super) struct Placed<'a> {
    bundle: &'a str,
    given: [Point; 2],
    laid: [Point; 2],
}

impl Placed<'_> {
    /// Of a bundle; none without fibres.
    pub(super) fn of<'a>(bundle: &'a str, given: &[Fibre], laid: &[Fibre]) -> Option<Placed<'a>> {
        let middle = |fibres: &[Fibre], end: fn(&Fibre) -> Point| {
            let sum: Vector = fibres.iter().map(|f| end(f).coords).sum();
            (!fibres.is_empty()).then(|| Point::from(sum / fibres.len() as f64))
        };
        let both = |fibres: &[Fibre]| Some([middle(fibres, |f| f.femur)?, middle(fibres, |f| f.tibia)?]);
        Some(Placed { bundle, given: both(given)?, laid: both(laid)? })
    }

    /// How far the given ends lie from where the rule lays `other`, both bones together [mm].
    fn off(&self, other: &Placed) -> f64 {
        self.given.iter().zip(&other.laid).map(|(g, l)| (g - l).norm()).sum()
    }
}

/// Tells two bundles of one ligament whose given fibres lie in each other's place.
pub(super) fn warn_of_bundles(places: &[Placed], warnings: &mut Vec<Notice>) {
    for (i, a) in places.iter().enumerate() {
        for b in &places[i + 1..] {
            let (as_named, exchanged) = (a.off(a) + b.off(b), a.off(b) + b.off(a));
            if exchanged < NEARER * as_named && as_named - exchanged > LEAST_GAIN_OF_BUNDLES_MM {
                let text = format!(
                    "the fibres of {} and {} lie in each other's place ({as_named:.0} mm from where bundles of these names lie in their sites, {exchanged:.0} mm the other way round): look at their names in attachments.csv",
                    a.bundle, b.bundle
                );
                warnings.push(Kind::MarksExchanged.notice(text).file("attachments.csv").of(a.bundle));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn bundles_in_each_others_place_are_told_and_crooked_ones_are_not() {
        let fibres = |x: f64| {
            let one = |fibre: usize| Fibre {
                bundle: String::new(),
                fibre,
                femur: Point::new(x, fibre as f64, 30.0),
                tibia: Point::new(x, fibre as f64, 0.0),
                source: Source::Given,
            };
            vec![one(1), one(2)]
        };
        let told = |a: f64, b: f64| {
            let mut warnings = Vec::new();
            let of = [("ACL_AM", a, 5.0), ("ACL_PL", b, -1.0)];
            let given = of.map(|(name, given, laid)| Placed::of(name, &fibres(given), &fibres(laid)).unwrap());
            warn_of_bundles(&given, &mut warnings);
            warnings
        };
        assert!(told(5.0, -1.0).is_empty() && told(3.0, 1.0).is_empty() && told(4.0, 4.0).is_empty());
        let said = told(-1.0, 5.0);
        assert!(said.len() == 1 && said[0].text.contains("ACL_AM and ACL_PL"), "{said:?}");
        assert!(Placed::of("ACL_AM", &[], &fibres(1.0)).is_none());
    }
}
