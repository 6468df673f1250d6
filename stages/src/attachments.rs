//! Stage 6, attachments: marked, literature and given sites; fibres.

mod crossings;
mod exchanged;
mod fibres;
mod given;
mod marked;

use crate::bones::Bones;
use crate::cartilage::Cartilage;
use crate::frames::Frames;
use crate::register::Registration;
use crate::specimen::Specimen;
use crate::{PerBone, StageError};
use attachments::atlas::{Anatomy, place};
use attachments::bundle::{BUNDLES, LIGAMENTS};
use attachments::marks::MarkOptions;
use attachments::naming::Place;
use attachments::site::{Bone, Fibre, Site, Source};
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use notices::Notice;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Sites and fibres, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attachments {
    /// One a ligament and bone.
    pub sites: Vec<Site>,
    /// Table 3's fibres, in its order.
    pub fibres: Vec<Fibre>,
    /// What is odd but not fatal; bundles that could not be placed are named here.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: AttachmentsMetrics,
}

/// Counts of sites and fibres, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AttachmentsMetrics {
    /// Sites by marks.
    pub sites_marked: usize,
    /// By the literature.
    pub sites_literature: usize,
    /// Given by hand.
    pub sites_given: usize,
    /// Fibres.
    pub fibres: usize,
    /// How deep each bundle runs through bone [mm].
    pub through_bone_mm: BTreeMap<String, f64>,
}

/// How sites are found and fibres laid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AttachmentsOptions {
    /// How outlines are found on a scan.
    pub marks: MarkOptions,
    /// How far from the middle of its outline a rough point may lie [mm]; the format allows 4, ours adds half as much.
    pub mark_reach_mm: f64,
    /// How far off the CT bone a rough point may lie before the bone counts as missing there [mm]: the format's 4 mm.
    pub mark_off_site_mm: f64,
    /// How far off the scan a rough point is taken for an error of frame or unit, if most of the bone's are [mm]. Ours.
    pub mark_off_bone_mm: f64,
    /// How far off the scan a single rough point is taken for an error [mm]: no bone that may be missing is longer. Ours.
    pub mark_lost_mm: f64,
    /// How far from a mark whose bone is missing the literature's site may lie and still stand for it [mm]; farther, the mark contradicts
    /// it and the ligament is left out. Ours: the literature's largest error.
    pub literature_reach_mm: f64,
    /// How far from its usual place an outline keeps its name, in epicondylar widths [-]. Ours: half the distance between sites.
    pub place_reach: f64,
    /// Share of a region's major axis over which fibres are spread [-]; the rest is the line drawn around the fibres. Ours.
    pub span: f64,
    /// Distance that literature sites keep from cartilage [mm]. Ours.
    pub cartilage_clearance_mm: f64,
    /// How deep a fibre may run in bone without a warning [mm], in the CT pose or from 0 to 90 deg. Ours.
    pub crossing_limit_mm: f64,
}

impl Default for AttachmentsOptions {
    fn default() -> Self {
        AttachmentsOptions {
            marks: MarkOptions::default(),
            mark_reach_mm: 6.0,
            mark_off_site_mm: 4.0,
            mark_off_bone_mm: 15.0,
            mark_lost_mm: 120.0,
            literature_reach_mm: 15.0,
            place_reach: 0.2,
            span: 0.8,
            cartilage_clearance_mm: 1.0,
            crossing_limit_mm: 2.0,
        }
    }
}

/// A bone as this stage sees it.
struct Side<'a> {
    bone: Bone,
    name: &'static str,
    query: &'a SurfaceQuery,
    frame: &'a AnatomicalFrame,
    /// The other bone's surface, to tell whose a point in CT is.
    other: &'a SurfaceQuery,
}

impl Side<'_> {
    fn holds(&self, p: &Point) -> bool {
        self.query.nearest(p).distance <= self.other.nearest(p).distance
    }
}

/// Places every ligament's sites and lays Table 3's fibres between them.
///
/// Order of belief: fibres given by hand, outlines on the scans, the literature. Source: [andreassen2025, sec. 2.4.4].
pub fn attachments(
    specimen: &Specimen,
    registration: &Registration,
    bones: &Bones,
    cartilage: &Cartilage,
    frames: &Frames,
    options: &AttachmentsOptions,
) -> Result<Attachments, StageError> {
    let query = |bone: &'static str, mesh| {
        SurfaceQuery::new(mesh).ok_or_else(|| {
            StageError::Knee(format!(
                "the {bone}'s surface has no triangles, expected a closed bone; look at stage bones"
            ))
        })
    };
    let (femur, tibfib) = (query("femur", &bones.surfaces.femur)?, query("tibfib", &bones.surfaces.tibfib)?);
    let sides = PerBone {
        femur: Side { bone: Bone::Femur, name: "femur", query: &femur, frame: &frames.femur, other: &tibfib },
        tibfib: Side { bone: Bone::Tibfib, name: "tibfib", query: &tibfib, frame: &frames.joint_line, other: &femur },
    };
    let width = (frames.epicondyles[0] - frames.epicondyles[1]).norm();
    let mut warnings = Vec::new();
    let mut sites = Vec::new();
    let mut beyond = Vec::new();
    for (side, scan, pose) in [
        (&sides.femur, &specimen.scans.femur, &registration.bones.femur.ct_from_scan),
        (&sides.tibfib, &specimen.scans.tibfib, &registration.bones.tibfib.ct_from_scan),
    ] {
        let scan = marked::MarkedScan { scan, pose };
        let marked = marked::sites(side, &scan, &specimen.marks, width, options, &mut warnings)?;
        sites.extend(marked.sites);
        beyond.extend(marked.beyond.into_iter().map(|place| (side.bone, place)));
    }
    let contradicted = |site: &Site| {
        let same = |(bone, place): &&(Bone, Place)| *bone == site.bone && place.name == site.ligament;
        let mark = beyond.iter().find(same);
        mark.is_some_and(|(_, place)| (place.point - site.centroid).norm() > options.literature_reach_mm)
    };
    let scale = width / attachments::atlas::WIDTH_MM;
    exchanged::warn(&anatomy(bones, frames, &[]), &sites, Source::Marked, scale, &mut warnings);
    let literature = literature(specimen, bones, cartilage, frames, &sites, options);
    sites.extend(literature.into_iter().filter(|site| !contradicted(site)));
    let anatomy = anatomy(bones, frames, &[]);
    given::compare(&anatomy, &specimen.given_fibres, scale, &mut warnings);
    given::tell_unmarked(specimen, &sites, &mut warnings);
    let fibres = fibres::lay(&sides, &mut sites, &specimen.given_fibres, options, &mut warnings);
    exchanged::warn(&anatomy, &sites, Source::Given, scale, &mut warnings);
    let through_bone = crossings::warn(&sides, frames, &fibres, options.crossing_limit_mm, &mut warnings);
    fibres::warn_of_lengths(&fibres, scale, &mut warnings);
    let rank = |s: &Site| (LIGAMENTS.iter().position(|l| *l == s.ligament), s.bone);
    sites.sort_by_key(rank);
    let count = |source: Source| sites.iter().filter(|s| s.source == source).count();
    let metrics = AttachmentsMetrics {
        sites_marked: count(Source::Marked),
        sites_literature: count(Source::Literature),
        sites_given: count(Source::Given),
        fibres: fibres.len(),
        through_bone_mm: through_bone,
    };
    Ok(Attachments { sites, fibres, warnings, metrics })
}

/// What the literature's rules refer to.
fn anatomy<'a>(bones: &'a Bones, frames: &'a Frames, marked: &'a [Site]) -> Anatomy<'a> {
    Anatomy {
        femur: &bones.surfaces.femur,
        tibfib: &bones.surfaces.tibfib,
        femur_frame: &frames.femur,
        tibia_frame: &frames.joint_line,
        epicondyles: frames.epicondyles,
        marked,
    }
}

/// Sites by the literature where nothing was marked, of ligaments that are not given by hand in full.
fn literature(
    specimen: &Specimen,
    bones: &Bones,
    cartilage: &Cartilage,
    frames: &Frames,
    marked: &[Site],
    options: &AttachmentsOptions,
) -> Vec<Site> {
    let anatomy = anatomy(bones, frames, marked);
    let queries: Vec<SurfaceQuery> =
        cartilage.solids.named().into_iter().filter_map(|(_, s)| SurfaceQuery::new(&s.solid)).collect();
    let covers: Vec<&SurfaceQuery> = queries.iter().collect();
    let given = |bundle: &str| specimen.given_fibres.iter().any(|f| f.bundle == bundle);
    let wanted = LIGAMENTS.iter().filter(|l| BUNDLES.iter().any(|b| b.ligament == **l && !given(&b.name)));
    wanted
        .flat_map(|ligament| [(*ligament, Bone::Femur), (*ligament, Bone::Tibfib)])
        .filter(|(l, b)| !marked.iter().any(|s| s.ligament == *l && s.bone == *b))
        .filter_map(|(l, b)| place(&anatomy, l, b, &covers, options.cartilage_clearance_mm))
        .collect()
}
