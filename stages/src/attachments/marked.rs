//! Sites outlined on one scan, named and carried onto the bone.

use super::{AttachmentsOptions, Side};
use crate::StageError;
use crate::specimen::{NamedPoint, PointFrame};
use attachments::bundle::LIGAMENTS;
use attachments::groups::ligament_called;
use attachments::marks::find_outlines;
use attachments::marks::project::{Footprint, project};
use attachments::naming::{Place, assign, usual_places};
use attachments::site::{Bone, Site, Source};
use meshes::Point;
use meshes::frame::{Ct, Pose, Scan};
use meshes::query::SurfaceQuery;
use meshes::surface::ColouredMesh;
use notices::{Kind, Notice};

pub(super) struct MarkedScan<'a> {
    pub(super) scan: &'a ColouredMesh,
    pub(super) pose: &'a Pose<Scan, Ct>,
}

/// What the marks of one bone come to.
#[derive(Default)]
pub(super) struct Marked {
    /// Sites outlined, and those of rough points without an outline.
    pub(super) sites: Vec<Site>,
    /// Marks whose bone is missing: ligament and place, CT frame.
    pub(super) beyond: Vec<Place>,
}

/// The sites of `side` that are outlined, and those of rough points without an outline.
pub(super) fn sites(
    side: &Side,
    scan: &MarkedScan,
    marks: &[NamedPoint],
    width: f64,
    options: &AttachmentsOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Marked, StageError> {
    let regions = find_outlines(scan.scan, &options.marks);
    let footprints: Vec<Footprint> = regions.iter().map(|r| project(r, scan.pose.motion(), side.query)).collect();
    let (points, beyond) = rough_points(side, scan, marks, options)?;
    warnings.extend(beyond.iter().map(|place| refusal(side, place, options)));
    let centroids: Vec<Point> = footprints.iter().map(|f| f.centroid).collect();
    let mut names: Vec<Option<String>> = assign(&centroids, &points, options.mark_reach_mm)
        .into_iter()
        .map(|p| p.map(|p| points[p].name.clone()))
        .collect();
    let mut found = Marked { sites: Vec::new(), beyond };
    for place in points.iter().filter(|p| !names.contains(&Some(p.name.clone())) && is_ligament(&p.name)) {
        let nearest = side.query.nearest(&place.point);
        warnings.push(Kind::NoOutline.notice(format!(
            "{} on the {}: no outline within {} mm of the point given in marks.csv, the point itself is the site, as rough as it is",
            place.name, side.name, options.mark_reach_mm
        )).of(&place.name));
        found.sites.push(point_site(side.bone, &place.name, nearest.point, nearest.distance));
    }
    let usual: Vec<Place> = usual_places(side.bone, side.frame, width)
        .into_iter()
        .filter(|p| points.iter().all(|q| q.name != p.name))
        .collect();
    name_by_place(&centroids, &mut names, &usual, options.place_reach * width);
    for (k, (name, footprint)) in names.into_iter().zip(footprints).enumerate() {
        let c = footprint.centroid;
        if regions[k].gap_fraction > 0.0 {
            let percent = 100.0 * regions[k].gap_fraction;
            let whose = name.as_deref().unwrap_or("without a name");
            warnings.push(
                Kind::BrokenOutline.notice(format!(
                    "outline {whose} on the {} is broken: {percent:.0} % of it was bridged",
                    side.name
                )),
            );
        }
        match name {
            Some(ligament) if is_ligament(&ligament) => found.sites.push(Site {
                ligament,
                bone: side.bone,
                centroid: c,
                area_mm2: footprint.area_mm2,
                source: Source::Marked,
                projection_mm: footprint.projection_mm,
                region: footprint.points,
            }),
            Some(_) => {}
            None => warnings.push(Kind::UnexpectedOutline.notice(format!(
                "an outline on the {} at CT ({:.1}, {:.1}, {:.1}) mm is none that is expected there and is left out; name it in marks.csv",
                side.name, c.x, c.y, c.z
            )).of(side.name).at([c.x, c.y, c.z])),
        }
    }
    Ok(found)
}

fn is_ligament(name: &str) -> bool {
    LIGAMENTS.contains(&name)
}

fn point_site(bone: Bone, ligament: &str, centroid: Point, projection_mm: f64) -> Site {
    let ligament = ligament.to_owned();
    Site { ligament, bone, centroid, area_mm2: 0.0, source: Source::Marked, projection_mm, region: vec![centroid] }
}

fn refusal(side: &Side, place: &Place, options: &AttachmentsOptions) -> Notice {
    Kind::MarkOffBone.notice(format!(
        "{} on the {}: the point given in marks.csv lies {:.1} mm off the bone, more than {} mm: it is not used; either the bone is missing there (a shaft cut short, no fibula) or the point is off: check its coordinates, and that scan and CT are of one size",
        place.name,
        side.name,
        side.query.nearest(&place.point).distance,
        options.mark_off_site_mm
    )).file("marks.csv").of(&place.name)
}

/// The rows of marks.csv for this bone, CT frame: those on it, and those whose bone is missing.
///
/// A row far off the bone is an error of frame or unit if it lies farther than any cut reaches, or if most rows are off.
fn rough_points(
    side: &Side,
    scan: &MarkedScan,
    marks: &[NamedPoint],
    options: &AttachmentsOptions,
) -> Result<(Vec<Place>, Vec<Place>), StageError> {
    let own = if side.bone == Bone::Femur { PointFrame::ScanFemur } else { PointFrame::ScanTibfib };
    let Some(surface) = SurfaceQuery::new(&scan.scan.mesh) else { return Ok((Vec::new(), Vec::new())) };
    let mut rows: Vec<(usize, f64, Place)> = Vec::new();
    for (row, mark) in marks.iter().enumerate() {
        let (point, off) = if mark.frame == own {
            (scan.pose.point(&mark.point), surface.nearest(&mark.point).distance)
        } else if mark.frame == PointFrame::Ct && side.holds(&mark.point) {
            (mark.point, side.query.nearest(&mark.point).distance)
        } else {
            continue;
        };
        let name = ligament_called(&mark.name).to_owned();
        rows.push((row + 2, off, Place { name, point }));
    }
    let far: Vec<&(usize, f64, Place)> = rows.iter().filter(|r| r.1 > options.mark_off_bone_mm).collect();
    let lost = far.iter().find(|r| r.1 > options.mark_lost_mm || 2 * far.len() > rows.len());
    if let Some((line, off, place)) = lost {
        return Err(StageError::Knee(format!(
            "marks.csv line {line}: {} lies {off:.1} mm off the {}, expected within {} mm; check its frame, unit and coordinates",
            place.name, side.name, options.mark_off_bone_mm
        )));
    }
    let there = |p: &Point| side.query.nearest(p).distance <= options.mark_off_site_mm;
    Ok(rows.into_iter().map(|r| r.2).partition(|place| there(&place.point)))
}

/// Names outlines that no rough point has named by their usual place.
fn name_by_place(centroids: &[Point], names: &mut [Option<String>], places: &[Place], reach: f64) {
    let open: Vec<usize> = (0..names.len()).filter(|&i| names[i].is_none()).collect();
    let rest: Vec<Point> = open.iter().map(|&i| centroids[i]).collect();
    for (i, place) in open.into_iter().zip(assign(&rest, places, reach)) {
        names[i] = place.map(|p| places[p].name.clone());
    }
}
