//! Which way is up, forwards and lateral, from the bones' shapes alone; and whether the bones are what they are said to be.
//!
//! The joint lies where the two bones come closest; each shaft leads away from it; the femoral condyles protrude
//! posteriorly from their shaft; the fibula lies lateral (and posterior) of the tibia. Axes of the CT image are not used.

use crate::StageError;
use crate::plateaus::plateau_normal;
use crate::specimen::Specimen;
use meshes::frame::Side;
use meshes::query::SurfaceQuery;
use meshes::section::{Outline, section};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::{Matrix2, Matrix3, SymmetricEigen, Vector2};

/// A shaft as a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// A point of the axis, next to the joint [mm].
    pub point: Point,
    /// Unit vector away from the joint.
    pub direction: Vector,
    /// Number of sections the line was fitted to; 0: only the bone's centroid gave the direction.
    pub sections: usize,
    /// Square root of the largest section's area [mm]: the bone's size across.
    pub size_mm: f64,
    /// Heights above the joint point between which sections are whole [mm].
    pub range_mm: [f64; 2],
    /// How far the axis turns where the farthest third of its sections is left out [deg]: a shaft that is cut short is unsure by as much.
    pub turn_deg: f64,
}

/// Rough anatomical directions of the knee, CT frame; mutually orthogonal unit vectors, good to about 10 degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughAxes {
    /// Towards the head: along the tibial shaft.
    pub superior: Vector,
    /// Forwards.
    pub anterior: Vector,
    /// Away from the body's midline.
    pub lateral: Vector,
    /// Middle of where the bones come closest [mm].
    pub joint: Point,
    /// The femur's shaft.
    pub femur_shaft: Shaft,
    /// The tibia's shaft.
    pub tibia_shaft: Shaft,
    /// From the tibia's sections to the fibula's, unit, perpendicular to the shaft; `None` without a fibula.
    pub fibula: Option<Vector>,
    /// How far the condyles protrude posteriorly from the femoral shaft, over the bone's size [-].
    pub protrusion: f64,
}

/// Which knee the bones look like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideEvidence {
    /// The likelier side.
    pub side: Side,
    /// From 0 (no telling) to 1 (certain).
    pub confidence: f64,
}

/// What [`check_anatomy`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnatomyReport {
    /// The knee's rough directions, by the declared side.
    pub axes: RoughAxes,
    /// Which knee it looks like; `None` without a fibula.
    pub side: Option<SideEvidence>,
}

/// Rough directions of the knee from its two bones, whole or cropped, in any position.
///
/// # Errors
/// When a bone is empty, the bones are one, or no direction of the shafts or condyles can be told.
pub fn rough_axes(femur: &TriMesh, tibfib: &TriMesh, side: Side) -> Result<RoughAxes, StageError> {
    let joint = joint_point(femur, tibfib)?;
    let femur_shaft = shaft(femur, &joint, "femur")?;
    let mut tibia_shaft = shaft(tibfib, &joint, "tibia")?;
    let (across, forwards, protrusion) = condyle_directions(femur, &femur_shaft)
        .ok_or_else(|| StageError::Knee("no condyles found on the femur: its joint end has no area".into()))?;
    if tibia_shaft.sections < LEAST_SECTIONS
        && let Some(up) = up_from_plateaus(tibfib, &joint, &-tibia_shaft.direction, &forwards)
    {
        tibia_shaft.direction = -up;
    }
    let superior = -tibia_shaft.direction;
    // Flexion turns about the mediolateral axis, so that one is shared; forwards follows from it.
    let across = (across - superior * across.dot(&superior)).try_normalize(1e-6).ok_or_else(|| {
        StageError::Knee("the femur's mediolateral direction runs along the tibial shaft: check that both bones are of one knee and lie as in one CT".into())
    })?;
    let anterior = across.cross(&superior);
    let anterior = if anterior.dot(&forwards) < 0.0 { -anterior } else { anterior };
    let lateral = match side {
        Side::Right => anterior.cross(&superior),
        Side::Left => superior.cross(&anterior),
    };
    let fibula = fibula_direction(tibfib, &tibia_shaft);
    Ok(RoughAxes { superior, anterior, lateral, joint, femur_shaft, tibia_shaft, fibula, protrusion })
}

/// The tibial shaft's direction from the plateaus alone, turned forwards by their mean slope.
fn up_from_plateaus(tibfib: &TriMesh, joint: &Point, superior: &Vector, forwards: &Vector) -> Option<Vector> {
    let normal = plateau_normal(tibfib, superior, joint)?;
    let forwards = (forwards - normal * forwards.dot(&normal)).try_normalize(1e-6)?;
    let (sin, cos) = SLOPE_DEG.to_radians().sin_cos();
    Some(normal * cos + forwards * sin)
}

/// Which knee the bones look like, by the side on which the fibula lies; `None` where that cannot be told.
pub fn detect_side(femur: &TriMesh, tibfib: &TriMesh) -> Option<SideEvidence> {
    side_of(&rough_axes(femur, tibfib, Side::Right).ok()?)
}

fn side_of(axes: &RoughAxes) -> Option<SideEvidence> {
    let right = axes.anterior.cross(&axes.superior);
    let towards = axes.fibula?.dot(&right);
    // A condyle hump of a quarter of the bone's size is plain; the fibula stands 15 to 60 degrees behind lateral.
    let confidence = (towards.abs() / 0.5).min(1.0) * (axes.protrusion / 0.1).clamp(0.0, 1.0);
    Some(SideEvidence { side: if towards > 0.0 { Side::Right } else { Side::Left }, confidence })
}

/// Whether the two files were exchanged: the fibula belongs to what is called the femur, or condyles to what is called the tibia.
pub fn looks_swapped(femur: &TriMesh, tibfib: &TriMesh) -> bool {
    let Ok(joint) = joint_point(femur, tibfib) else { return false };
    let (Ok(f), Ok(t)) = (shaft(femur, &joint, "femur"), shaft(tibfib, &joint, "tibia")) else { return false };
    let (fibula_f, fibula_t) = (fibula_direction(femur, &f).is_some(), fibula_direction(tibfib, &t).is_some());
    let (condyles_f, condyles_t) = (condyle_likeness(femur, &f), condyle_likeness(tibfib, &t));
    (fibula_f && !fibula_t && condyles_t >= condyles_f)
        || (fibula_f == fibula_t && condyles_t > 0.5 && condyles_f < 0.2)
}

/// Refuses a specimen whose bones are plainly not what it says: femur and tibia exchanged, or the other knee.
/// When in doubt it lets pass.
///
/// # Errors
/// One message: what is wrong and what to change.
pub fn check_anatomy(specimen: &Specimen) -> Result<AnatomyReport, StageError> {
    let (femur, tibfib) = (&specimen.ct.femur, &specimen.ct.tibfib);
    if looks_swapped(femur, tibfib) {
        return Err(StageError::Knee(exchanged_bones(specimen).into()));
    }
    let axes = rough_axes(femur, tibfib, specimen.identity.side).map_err(|e| match e {
        StageError::Knee(what) => StageError::Knee(format!("{what}{CHECK_AXES}")),
        other => other,
    })?;
    let side = side_of(&axes);
    if let Some(SideEvidence { side, confidence }) = side
        && side != specimen.identity.side
        && confidence > 0.8
    {
        let name = |s| if s == Side::Left { "left" } else { "right" };
        return Err(StageError::Knee(format!(
            "the bones are those of a {} knee (the fibula lies there), but specimen.toml says side = \"{}\": correct the side, or the export if it mirrored the bones: flipped an axis, or exchanged two columns of the coordinates (x, y, z written as y, x, z)",
            name(side),
            name(specimen.identity.side)
        )));
    }
    Ok(AnatomyReport { axes, side })
}

/// What is said after bones that show no knee.
const CHECK_AXES: &str = "; check that both bones are in one frame, and that the columns of neither are exchanged (x, y, z written as y, x, z)";

/// What is said of bones in each other's place, by where they came from.
fn exchanged_bones(specimen: &Specimen) -> &'static str {
    match (&specimen.metrics.ct_femur, &specimen.mri) {
        (None, Some(_)) => {
            "the label of segmentation.femur looks like a tibia with its fibula and that of segmentation.tibia like a femur: exchange the two labels in [segmentation] of specimen.toml"
        }
        _ => {
            "ct.femur looks like a tibia with its fibula and ct.tibfib like a femur: exchange the two paths in [ct] of specimen.toml (and check those in [scans])"
        }
    }
}

/// Mean of the femur's points that are within 8 mm more than the least distance of the tibia, by area.
pub fn joint_point(femur: &TriMesh, tibfib: &TriMesh) -> Result<Point, StageError> {
    let query = SurfaceQuery::new(tibfib)
        .ok_or_else(|| StageError::Knee("the tibia's surface is empty: expected triangles of the bone".into()))?;
    let areas = femur.vertex_areas();
    let near: Vec<f64> = femur.vertices.iter().map(|p| query.nearest(p).distance).collect();
    let least = near.iter().copied().fold(f64::INFINITY, f64::min);
    let (mut sum, mut weight) = (Vector::zeros(), 0.0);
    let start = femur.vertices.first().copied().unwrap_or_else(Point::origin);
    for ((p, d), a) in femur.vertices.iter().zip(&near).zip(&areas) {
        if *d < least + 8.0 {
            sum += (p - start) * *a;
            weight += a;
        }
    }
    if weight > 0.0 && least.is_finite() {
        Ok(start + sum / weight)
    } else {
        Err(StageError::Knee("the femur's surface is empty or has no area: expected triangles of the bone".into()))
    }
}

/// The shaft of one bone: a line through the centroids of its sections beyond the flared end, refined until it stands.
pub fn shaft(bone: &TriMesh, joint: &Point, name: &str) -> Result<Shaft, StageError> {
    let centroid = bone.centroid().ok_or_else(|| StageError::Knee(format!("the {name}'s surface has no area")))?;
    let away = (centroid - joint).try_normalize(1e-6).ok_or_else(|| {
        StageError::Knee(format!(
            "the {name} has no direction away from the joint: check that it is the bone of this knee"
        ))
    })?;
    let away = (0..4).fold(away, |d, _| along_the_walls(bone, joint, &d));
    let mut line =
        Shaft { point: *joint, direction: away, sections: 0, size_mm: 0.0, range_mm: [0.0; 2], turn_deg: 0.0 };
    for _ in 0..6 {
        line = refit(bone, joint, &line);
    }
    if line.size_mm > 0.0 { Ok(line) } else { Err(StageError::Knee(format!("the {name} cannot be cut into sections"))) }
}

/// The direction that the walls of the bone's far half (of 150 mm at most) run along: that of least area seen end on.
fn along_the_walls(bone: &TriMesh, joint: &Point, away: &Vector) -> Vector {
    let top = bone.vertices.iter().map(|p| (p - joint).dot(away)).fold(0.0, f64::max).min(150.0);
    let mut spread = Matrix3::zeros();
    for t in 0..bone.triangles.len() {
        let [a, b, c] = bone.corners(t);
        let height = (Point::from((a.coords + b.coords + c.coords) / 3.0) - joint).dot(away);
        let vector = bone.area_vector(t);
        let area = vector.norm();
        // The cut end faces away; it is no wall.
        if height > 0.5 * top && height < top && area > 0.0 && vector.dot(away).abs() < 0.6 * area {
            spread += vector * vector.transpose() / area;
        }
    }
    let eigen = SymmetricEigen::new(spread);
    let least = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let direction = if least.dot(away) < 0.0 { -least } else { least };
    if direction.dot(away) > 0.5 { direction } else { *away }
}

const SECTION_STEP_MM: f64 = 3.0;
/// Whole sections from which on a shaft shows its axis.
pub(crate) const LEAST_SECTIONS: usize = 5;
/// Backward slope of the tibial plateaus [deg]: means of 3.7 to 7.0, medial and lateral, men and women [hashemi2008].
const SLOPE_DEG: f64 = 5.5;

fn refit(bone: &TriMesh, joint: &Point, line: &Shaft) -> Shaft {
    let d = line.direction;
    let normals = bone.triangle_normals();
    let top = bone.vertices.iter().map(|p| (p - joint).dot(&d)).fold(0.0, f64::max).min(300.0);
    let mut sections: Vec<(f64, Outline)> = Vec::new();
    let mut h = 0.5 * SECTION_STEP_MM;
    while h < top {
        if let Some(largest) = section(bone, &(joint + d * h), &d).into_iter().next() {
            sections.push((h, largest));
        }
        h += SECTION_STEP_MM;
    }
    let end = &sections[..sections.iter().position(|s| s.0 > 90.0).unwrap_or(sections.len())];
    let widest = end.iter().map(|s| s.1.area).fold(0.0, f64::max);
    let size = widest.max(0.0).sqrt();
    let peak = end.iter().position(|s| s.1.area == widest).unwrap_or(0);
    let whole: Vec<&(f64, Outline)> =
        sections[peak..].iter().take_while(|s| s.0 < 4.0 * size).filter(|(_, o)| is_whole(o, &normals, &d)).collect();
    for share in [0.5, 0.65, 0.8] {
        let part: Vec<&&(f64, Outline)> = whole.iter().filter(|s| s.1.area < share * widest).collect();
        let (Some(first), Some(last)) = (part.first(), part.last()) else { continue };
        if part.len() >= LEAST_SECTIONS {
            let centroids: Vec<Point> = part.iter().map(|s| s.1.centroid).collect();
            let (point, direction) = fitted_line(&centroids, &d);
            let (_, near) = fitted_line(&centroids[..centroids.len() - centroids.len() / 3], &d);
            let turn_deg = direction.angle(&near).to_degrees();
            return Shaft {
                point,
                direction,
                sections: part.len(),
                size_mm: size,
                range_mm: [first.0, last.0],
                turn_deg,
            };
        }
    }
    Shaft { size_mm: size, ..*line }
}

/// Closed, and not running over the cut end.
fn is_whole(outline: &Outline, normals: &[Vector], away: &Vector) -> bool {
    let capped = outline.triangles.iter().filter(|&&t| normals[t as usize].dot(away) > 0.6).count();
    outline.gap < 0.02 * outline.length && (capped as f64) < 0.06 * outline.triangles.len() as f64
}

/// Least-squares line through points that advance along `towards`.
fn fitted_line(points: &[Point], towards: &Vector) -> (Point, Vector) {
    let n = points.len() as f64;
    let mean = Point::from(points.iter().fold(Vector::zeros(), |s, p| s + p.coords) / n);
    let (mut hh, mut hp) = (0.0, Vector::zeros());
    for p in points {
        let h = (p - mean).dot(towards);
        hh += h * h;
        hp += (p - mean) * h;
    }
    let direction = if hh > 0.0 { (hp / hh).normalize() } else { *towards };
    (mean, direction)
}

/// Mediolateral direction (sign open), anterior direction and how far the condyles protrude backwards over the bone's size.
fn condyle_directions(femur: &TriMesh, shaft: &Shaft) -> Option<(Vector, Vector, f64)> {
    let d = shaft.direction;
    let u = any_perpendicular(&d);
    let v = d.cross(&u);
    let lowest = femur.vertices.iter().map(|p| (p - shaft.point).dot(&d)).fold(f64::INFINITY, f64::min);
    let (mut area, mut sum, mut square) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for t in 0..femur.triangles.len() {
        let [a, b, c] = femur.corners(t);
        let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
        if (middle - shaft.point).dot(&d) - lowest < 0.65 * shaft.size_mm {
            let w = femur.area_vector(t).norm();
            let q = Vector2::new((middle - shaft.point).dot(&u), (middle - shaft.point).dot(&v));
            area += w;
            sum += q * w;
            square += q * q.transpose() * w;
        }
    }
    if area <= 0.0 {
        return None;
    }
    let mean = sum / area;
    let eigen = SymmetricEigen::new(square / area - mean * mean.transpose());
    let wide = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let across = u * wide.x + v * wide.y;
    let offset = u * mean.x + v * mean.y;
    let along = d.cross(&across);
    let forwards = if offset.dot(&along) > 0.0 { -along } else { along };
    Some((across, forwards, offset.dot(&along).abs() / shaft.size_mm))
}

/// A unit vector perpendicular to `d`.
fn any_perpendicular(d: &Vector) -> Vector {
    let axis = d.iamin();
    let e = Vector::ith(axis, 1.0);
    (e - d * d.dot(&e)).normalize()
}

/// Mean direction from the tibia's to the fibula's sections, where at least five sections of the shaft show both.
fn fibula_direction(tibfib: &TriMesh, shaft: &Shaft) -> Option<Vector> {
    let d = shaft.direction;
    let lowest = tibfib.vertices.iter().map(|p| (p - shaft.point).dot(&d)).fold(f64::INFINITY, f64::min);
    let highest = tibfib.vertices.iter().map(|p| (p - shaft.point).dot(&d)).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut count) = (Vector::zeros(), 0);
    let mut h = lowest + 0.4 * shaft.size_mm;
    while h < highest.min(lowest + 4.0 * shaft.size_mm) {
        let cut = section(tibfib, &(shaft.point + d * h), &d);
        if let [tibia, fibula, ..] = &cut[..]
            && fibula.area > 0.02 * tibia.area
            && fibula.area > 25.0
            && fibula.area < 0.6 * tibia.area
        {
            let across = fibula.centroid - tibia.centroid;
            sum += (across - d * across.dot(&d)).normalize();
            count += 1;
        }
        h += SECTION_STEP_MM;
    }
    if count >= 5 { sum.try_normalize(0.5 * f64::from(count)) } else { None }
}

/// How alike in size the two largest pieces of the sections nearest the joint are (0 to 1): femoral condyles show two, a plateau one.
fn condyle_likeness(bone: &TriMesh, shaft: &Shaft) -> f64 {
    let d = shaft.direction;
    let lowest = bone.vertices.iter().map(|p| (p - shaft.point).dot(&d)).fold(f64::INFINITY, f64::min);
    let mut best: f64 = 0.0;
    for i in 1..=8 {
        let h = lowest + 0.05 * f64::from(i) * shaft.size_mm;
        if let [first, second, ..] = &section(bone, &(shaft.point + d * h), &d)[..]
            && second.area > 0.05 * shaft.size_mm.powi(2)
        {
            best = best.max(second.area / first.area);
        }
    }
    best
}
