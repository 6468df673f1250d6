//! Table 3's fibres between the sites.

use super::{AttachmentsOptions, Side};
use crate::PerBone;
use attachments::bundle::{BUNDLES, Bundle, LIGAMENTS};
use attachments::layout::{counting_directions, ends, uncross};
use attachments::lengths::usual_range_mm;
use attachments::site::{Bone, Fibre, Site, Source};
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// The fibres of every bundle that has both sites, in Table 3's order; those given by hand stand for their bundle, and their
/// ligament's site where nothing better is known of it.
pub(super) fn lay(
    sides: &PerBone<Side>,
    sites: &mut Vec<Site>,
    given: &[Fibre],
    options: &AttachmentsOptions,
    warnings: &mut Vec<Notice>,
) -> Vec<Fibre> {
    let mut fibres = Vec::new();
    for ligament in LIGAMENTS {
        let bundles: Vec<&Bundle> = BUNDLES.iter().filter(|b| b.ligament == ligament).collect();
        let is_given = |b: &&&Bundle| given.iter().any(|f| f.bundle == b.name);
        if bundles.iter().all(|b| is_given(&b)) {
            sites.retain(|s| s.ligament != ligament);
            sites.extend(given_sites(ligament, &bundles, given));
        }
        let mut laid = laid(sides, sites, ligament, &bundles, options).into_iter();
        let mut places = Vec::new();
        for bundle in bundles {
            let own: Vec<Fibre> = laid.by_ref().take(bundle.fibres).collect();
            let mut by_hand: Vec<Fibre> = given.iter().filter(|f| f.bundle == bundle.name).cloned().collect();
            if !by_hand.is_empty() {
                by_hand.sort_by_key(|f| f.fibre);
                places.extend(super::exchanged::Placed::of(&bundle.name, &by_hand, &own));
                fibres.extend(by_hand);
            } else if own.is_empty() {
                warnings.push(
                    Kind::BundleLeftOut
                        .notice(format!("bundle {} is left out: {}", bundle.name, missing(sites, ligament)))
                        .of(&bundle.name),
                );
            } else {
                fibres.extend(own.into_iter().enumerate().map(|(i, f)| Fibre {
                    bundle: bundle.name.clone(),
                    fibre: i + 1,
                    ..f
                }));
            }
        }
        super::exchanged::warn_of_bundles(&places, warnings);
    }
    fibres.sort_by_key(|f| BUNDLES.iter().position(|b| b.name == f.bundle));
    fibres
}

fn missing(sites: &[Site], ligament: &str) -> String {
    let has = |bone: Bone| sites.iter().any(|s| s.ligament == ligament && s.bone == bone);
    let names: Vec<&str> = [(Bone::Femur, "femur"), (Bone::Tibfib, "tibfib")]
        .into_iter()
        .filter(|(bone, _)| !has(*bone))
        .map(|(_, name)| name)
        .collect();
    format!("{ligament} has no site on the {}; mark it or give it in attachments.csv", names.join(" and "))
}

/// All fibres of a ligament in their order along its sites; empty where a site is missing.
fn laid(
    sides: &PerBone<Side>,
    sites: &[Site],
    ligament: &str,
    bundles: &[&Bundle],
    options: &AttachmentsOptions,
) -> Vec<Fibre> {
    let site = |bone: Bone| sites.iter().find(|s| s.ligament == ligament && s.bone == bone);
    let (Some(upper), Some(lower)) = (site(Bone::Femur), site(Bone::Tibfib)) else { return Vec::new() };
    let count = bundles.iter().map(|b| b.fibres).sum();
    let along = |side: &Side, site: &Site| {
        ends(site, side.query, count, &counting_directions(ligament, side.bone, side.frame), options.span)
    };
    let (mut femur, clear_above) = along(&sides.femur, upper);
    let (mut tibia, clear_below) = along(&sides.tibfib, lower);
    if !clear_below {
        uncross(&femur, &mut tibia);
    } else if !clear_above {
        uncross(&tibia, &mut femur);
    }
    let source = if upper.source == Source::Literature || lower.source == Source::Literature {
        Source::Literature
    } else if upper.source == Source::Given && lower.source == Source::Given {
        Source::Given
    } else {
        Source::Marked
    };
    let pairs = femur.into_iter().zip(tibia);
    pairs.map(|(femur, tibia)| Fibre { bundle: String::new(), fibre: 0, femur, tibia, source }).collect()
}

fn given_sites(ligament: &str, bundles: &[&Bundle], given: &[Fibre]) -> [Site; 2] {
    let own: Vec<&Fibre> = given.iter().filter(|f| bundles.iter().any(|b| b.name == f.bundle)).collect();
    [Bone::Femur, Bone::Tibfib].map(|bone| {
        let region: Vec<Point> = own.iter().map(|f| if bone == Bone::Femur { f.femur } else { f.tibia }).collect();
        let sum: Vector = region.iter().map(|p| p.coords).sum();
        let centroid = Point::from(sum / region.len().max(1) as f64);
        let ligament = ligament.to_owned();
        Site { ligament, bone, centroid, area_mm2: 0.0, source: Source::Given, projection_mm: 0.0, region }
    })
}

/// Warns of ligaments longer or shorter than published ones; `scale` is the knee's size over the atlas'.
pub(super) fn warn_of_lengths(fibres: &[Fibre], scale: f64, warnings: &mut Vec<Notice>) {
    for ligament in LIGAMENTS {
        let of = |f: &&Fibre| BUNDLES.iter().any(|b| b.ligament == ligament && b.name == f.bundle);
        let lengths: Vec<f64> = fibres.iter().filter(of).map(|f| (f.femur - f.tibia).norm()).collect();
        let Some([least, most]) = usual_range_mm(ligament, scale).filter(|_| !lengths.is_empty()) else { continue };
        let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
        if !(least..=most).contains(&mean) {
            warnings.push(Kind::FibreLength.notice(format!(
                "the fibres of {ligament} are {mean:.0} mm long in the mean, outside the {least:.0} to {most:.0} mm of knees of this size: look at its two sites in the report, or mark them{}",
                if mean > most { ". Bones that lie apart in CT make ligaments long, too" } else { "" }
            )).of(ligament));
        }
    }
}
