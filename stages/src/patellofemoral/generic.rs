//! A patella of mean shape, scaled to the knee and laid on its trochlea. It is nobody's patella: what follows of it is a mean knee's.

use super::{Ground, Shape, gap};
use crate::StageError;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::spec::PatellaSource;

/// Width, of the transepicondylar width [-].
const WIDTH: f64 = 0.55;
/// Height over width [-].
const HEIGHT: f64 = 0.97;
/// Width over thickness with cartilage [-] [saoa2013].
const WIDTH_TO_THICKNESS: f64 = 1.8;
/// Share of the thickness behind the frame's origin [-].
const BEHIND: f64 = 0.55;
/// Lean of the medial and the lateral facet against the patella's breadth [deg].
const FACETS_DEG: [f64; 2] = [26.0, 22.0];
/// Roundness of the ridge between them, of the width [-].
const RIDGE: f64 = 0.08;
/// Radius of the articular face from apex to base, over the height [-].
const SAGITTAL: f64 = 1.5;
/// Height of the ridge's middle over the patella's, of the height [-]: the lower quarter bears no cartilage.
const MIDDLE: f64 = 0.12;
/// The articular face within the outline [-].
const ARTICULAR: f64 = 0.92;
/// Lowest of the articular face, of the height [-].
const LOWEST: f64 = -0.25;
/// Length of the tendon over the height: Insall and Salvati's ratio [-] [insall1971].
const TENDON: f64 = 1.0;
/// Edge of the articular face's cells [mm].
const CELL_MM: f64 = 1.0;
/// Angles on the groove between which the patella is laid, below the front [rad].
const PLACES: [f64; 2] = [-0.9, 1.2];
/// Gap at which it is laid on [mm].
const GAP_MM: f64 = 0.1;

/// A patella's dimensions [mm].
struct Size {
    width: f64,
    height: f64,
    thickness: f64,
}

impl Size {
    /// Distance of the outline from the middle of the upper or lower part, as a share: below 1 inside.
    fn outline(&self, medial: f64, superior: f64) -> f64 {
        let s = superior - 0.05 * self.height;
        let (half, power) = if s > 0.0 { (0.45, 2.5) } else { (0.55, 1.7) };
        let sum = (medial / (0.5 * self.width)).abs().powf(power) + (s / (half * self.height)).abs().powf(power);
        sum.powf(1.0 / power)
    }

    /// How far behind the origin the back is [mm].
    fn back(&self, medial: f64, superior: f64) -> f64 {
        let lean = FACETS_DEG[usize::from(medial < 0.0)].to_radians().tan();
        let round = RIDGE * self.width;
        let aside = lean * (medial.hypot(round) - round);
        let along = superior - MIDDLE * self.height;
        BEHIND * self.thickness - aside - along * along / (2.0 * SAGITTAL * self.height)
    }

    /// How far ahead of the origin the front is [mm].
    fn front(&self, medial: f64, superior: f64) -> f64 {
        let inside = (1.0 - self.outline(medial, superior).powi(2)).max(0.0).sqrt();
        let rim = -0.12 * self.thickness;
        rim + ((1.0 - BEHIND) * self.thickness - rim) * inside
    }
}

/// The patella, laid on the groove where the tendon has its length.
pub(super) fn shape(ground: &Ground) -> Result<Shape, StageError> {
    let width = WIDTH * ground.width;
    let size = Size { width, height: HEIGHT * width, thickness: width / WIDTH_TO_THICKNESS };
    let placed = |angle: f64| frame(angle, &size, ground);
    let tendon = |angle: f64| {
        let f = placed(angle);
        (f.origin - f.superior * (0.5 * size.height) - ground.tuberosity).norm() - TENDON * size.height
    };
    let [mut high, mut low] = PLACES;
    if tendon(high) < 0.0 || tendon(low) > 0.0 {
        return Err(StageError::Knee(format!(
            "patella: no place on the trochlea is {:.0} mm from the tibial tuberosity; is the knee in CT near extension? A landmark tibial_tuberosity would correct a tuberosity wrongly found",
            TENDON * size.height
        )));
    }
    for _ in 0..60 {
        let middle = 0.5 * (high + low);
        if tendon(middle) > 0.0 { high = middle } else { low = middle }
    }
    let mut frame = placed(0.5 * (high + low));
    let mut face = articular(&size, &frame);
    // along its own axis until it all but touches
    let back = gap(&face, &frame, ground)? - GAP_MM;
    if !back.is_finite() {
        return Err(StageError::Knee("patella: it does not lie before the trochlea's cartilage".into()));
    }
    frame.origin -= frame.anterior * back;
    face.vertices.iter_mut().for_each(|p| *p -= frame.anterior * back);
    let seen = Some(closed(&size, &frame));
    let front = size.front(0.0, 0.0);
    Ok(Shape { frame, face, seen, size: [size.width, size.height], front, source: PatellaSource::Generic })
}

/// Axes of the patella whose ridge touches the groove at an angle below the front.
fn frame(angle: f64, size: &Size, ground: &Ground) -> AnatomicalFrame {
    let femur = &ground.frames.femur;
    let anterior = femur.anterior * angle.cos() - femur.superior * angle.sin();
    let superior = femur.superior * angle.cos() + femur.anterior * angle.sin();
    let origin =
        ground.trochlea.at(angle, femur) + anterior * (BEHIND * size.thickness) - superior * (MIDDLE * size.height);
    AnatomicalFrame { origin, medial: femur.medial, anterior, superior }
}

fn point(frame: &AnatomicalFrame, [medial, anterior, superior]: [f64; 3]) -> Point {
    frame.origin + frame.medial * medial + frame.anterior * anterior + frame.superior * superior
}

/// The articular face: cells of a grid within its outline.
fn articular(size: &Size, frame: &AnatomicalFrame) -> TriMesh {
    let half = |extent: f64| (0.6 * extent / CELL_MM).ceil() as i32;
    let (columns, rows) = (half(size.width), half(size.height));
    let mut mesh = TriMesh::default();
    for j in -rows..=rows {
        for i in -columns..=columns {
            let (m, s) = (f64::from(i) * CELL_MM, f64::from(j) * CELL_MM);
            mesh.vertices.push(point(frame, [m, -size.back(m, s), s]));
        }
    }
    let inside = |i: i32, j: i32| {
        let (m, s) = (f64::from(i) * CELL_MM, f64::from(j) * CELL_MM);
        size.outline(m, s) < ARTICULAR && s > LOWEST * size.height
    };
    let index = |i: i32, j: i32| ((j + rows) * (2 * columns + 1) + i + columns) as u32;
    for j in -rows..rows {
        for i in -columns..columns {
            if [(0, 0), (1, 0), (0, 1), (1, 1)].iter().all(|(a, b)| inside(i + a, j + b)) {
                mesh.triangles.push([index(i, j), index(i + 1, j), index(i + 1, j + 1)]);
                mesh.triangles.push([index(i, j), index(i + 1, j + 1), index(i, j + 1)]);
            }
        }
    }
    outwards(mesh.submesh(|_| true).0, &-frame.anterior)
}

/// Rings and sectors of the closed surface.
const RINGS: [u32; 2] = [14, 72];

/// The whole patella as a closed surface: front and back over its outline.
fn closed(size: &Size, frame: &AnatomicalFrame) -> TriMesh {
    let [rings, sectors] = RINGS;
    let mut mesh = TriMesh::default();
    for side in [1.0, -1.0] {
        for ring in 0..=rings {
            for sector in 0..sectors {
                let angle = f64::from(sector) / f64::from(sectors) * std::f64::consts::TAU;
                let (m, s) = (angle.cos() * 0.5 * size.width, angle.sin() * 0.5 * size.height);
                // out to the outline along a ray from the middle
                let share = f64::from(ring) / f64::from(rings);
                let out = edge(size, m, s) * share;
                let (m, s) = (m * out, s * out);
                let front = size.front(m, s);
                let depth = if side > 0.0 { front } else { (-size.back(m, s)).min(front - 2.0) };
                mesh.vertices.push(point(frame, [m, depth, s]));
            }
        }
    }
    let at = |side: u32, ring: u32, sector: u32| (side * (rings + 1) + ring) * sectors + sector % sectors;
    let mut quad = |a: u32, b: u32, c: u32, d: u32| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for sector in 0..sectors {
        let next = sector + 1;
        for ring in 0..rings {
            quad(at(0, ring, sector), at(0, ring + 1, sector), at(0, ring + 1, next), at(0, ring, next));
            quad(at(1, ring, sector), at(1, ring, next), at(1, ring + 1, next), at(1, ring + 1, sector));
        }
        quad(at(0, rings, sector), at(1, rings, sector), at(1, rings, next), at(0, rings, next));
    }
    // the middle rings are points
    let mut welded = mesh;
    for t in &mut welded.triangles {
        for v in t.iter_mut() {
            let side = *v / ((rings + 1) * sectors);
            if *v - side * (rings + 1) * sectors < sectors {
                *v = side * (rings + 1) * sectors;
            }
        }
    }
    welded.triangles.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    let mesh = welded.submesh(|_| true).0;
    if mesh.volume() < 0.0 { mesh.flipped() } else { mesh }
}

/// How many times a vector from the middle reaches to the outline.
fn edge(size: &Size, medial: f64, superior: f64) -> f64 {
    let (mut inside, mut outside) = (0.0, 2.0);
    for _ in 0..50 {
        let middle = 0.5 * (inside + outside);
        if size.outline(medial * middle, superior * middle) < 1.0 { inside = middle } else { outside = middle }
    }
    inside
}

/// Turned over where its triangles look away from a direction.
fn outwards(mesh: TriMesh, way: &Vector) -> TriMesh {
    let total: Vector = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t)).sum();
    if total.dot(way) < 0.0 { mesh.flipped() } else { mesh }
}
