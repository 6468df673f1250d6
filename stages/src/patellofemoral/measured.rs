//! The knee's own patella.

use super::{Ground, PatellaOptions, Shape};
use crate::StageError;
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::vertex_neighbours;
use meshes::{Point, Vector};
use sim::spec::PatellaSource;

/// Share of a patella's vertices, at either end, whose mean is that end [-].
const END_SHARE: f64 = 0.01;
/// A triangle of the articular face looks back by this cosine at least [-].
const FACES_BACK: f64 = 0.35;
/// The lower part without cartilage, of the height [-]: about the lower quarter [saoa2013].
const BARE: f64 = 0.25;
/// Breadth over which cartilage laid on a bone thins towards its border [mm]; ours.
const TAPER_MM: f64 = 4.0;
/// Cartilage laid on a bone is nowhere thinner than this [mm].
const THINNEST_MM: f64 = 0.5;

/// The patella that CT or MRI shows, with its cartilage where MRI shows that too.
pub(super) fn shape(
    bone: &TriMesh,
    cartilage: Option<&TriMesh>,
    ground: &Ground,
    options: &PatellaOptions,
) -> Result<Shape, StageError> {
    let (frame, size) = axes(bone, &ground.frames.femur);
    let face = match cartilage {
        Some(cartilage) => backward(cartilage, &frame, f64::NEG_INFINITY),
        None => covered(&backward(bone, &frame, (BARE - 0.5) * size[1]), ground, options)?,
    };
    let face = largest(&face);
    if face.triangles.is_empty() {
        return Err(StageError::Knee(
            "patella: nothing of it looks back at the trochlea; is it where the femur is?".into(),
        ));
    }
    let ahead = |p: &Point| (p - frame.origin).dot(&frame.anterior);
    let front = bone.vertices.iter().map(ahead).fold(0.0, f64::max);
    Ok(Shape { frame, face, seen: None, size, front, source: PatellaSource::Measured })
}

/// Axes from side to side and from apex to base, origin between these ends; width and height.
fn axes(bone: &TriMesh, femur: &AnatomicalFrame) -> (AnatomicalFrame, [f64; 2]) {
    let (medial, lateral) = ends(bone, &femur.medial);
    let (base, apex) = ends(bone, &femur.superior);
    let superior = (base - apex).normalize();
    let across = medial - lateral;
    let medial_axis = (across - superior * across.dot(&superior)).normalize();
    let anterior = superior.cross(&medial_axis);
    let anterior = if anterior.dot(&femur.anterior) < 0.0 { -anterior } else { anterior };
    let middle = nalgebra::center(&Point::from(base), &Point::from(apex));
    // as far ahead as the middle of the bone
    let centre = bone.centroid().unwrap_or(middle);
    let beside = |axis: &Vector| axis * (centre - middle).dot(axis);
    let origin = middle + beside(&anterior) + beside(&medial_axis);
    let extent = |axis: &Vector| {
        let along = bone.vertices.iter().map(|p| (p - origin).dot(axis));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let size = [extent(&medial_axis), extent(&superior)];
    (AnatomicalFrame { origin, medial: medial_axis, anterior, superior }, size)
}

/// The far ends along an axis, the one ahead first.
fn ends(bone: &TriMesh, axis: &Vector) -> (Vector, Vector) {
    let mut sorted: Vec<&Point> = bone.vertices.iter().collect();
    sorted.sort_by(|p, q| p.coords.dot(axis).total_cmp(&q.coords.dot(axis)));
    let count = ((sorted.len() as f64 * END_SHARE).ceil() as usize).clamp(1, sorted.len().max(1));
    let mean = |part: &[&Point]| part.iter().map(|p| p.coords).sum::<Vector>() / part.len().max(1) as f64;
    (mean(&sorted[sorted.len() - count..]), mean(&sorted[..count]))
}

/// Triangles that look back, above a height over the middle [mm].
fn backward(mesh: &TriMesh, frame: &AnatomicalFrame, above: f64) -> TriMesh {
    let normals = mesh.triangle_normals();
    let high = |t: usize| mesh.corners(t).iter().all(|p| (p - frame.origin).dot(&frame.superior) > above);
    mesh.submesh(|t| normals[t].dot(&frame.anterior) < -FACES_BACK && high(t)).0
}

/// The largest connected piece.
fn largest(mesh: &TriMesh) -> TriMesh {
    let neighbours = vertex_neighbours(mesh);
    let mut piece = vec![usize::MAX; mesh.vertices.len()];
    let mut sizes = Vec::new();
    for start in 0..mesh.vertices.len() {
        if piece[start] != usize::MAX {
            continue;
        }
        let (id, mut size, mut open) = (sizes.len(), 0_usize, vec![start]);
        piece[start] = id;
        while let Some(v) = open.pop() {
            size += 1;
            for &n in &neighbours[v] {
                if piece[n as usize] == usize::MAX {
                    piece[n as usize] = id;
                    open.push(n as usize);
                }
            }
        }
        sizes.push(size);
    }
    let best = (0..sizes.len()).max_by_key(|&i| (sizes[i], std::cmp::Reverse(i)));
    mesh.submesh(|t| Some(piece[mesh.triangles[t][0] as usize]) == best).0
}

/// Cartilage laid on the back of a bone: thickest in the middle, thinner towards the border and where the trochlea leaves less room.
fn covered(back: &TriMesh, ground: &Ground, options: &PatellaOptions) -> Result<TriMesh, StageError> {
    let query = SurfaceQuery::new(ground.trochlear_face)
        .ok_or_else(|| StageError::Knee("the femur's articular face has no triangles".into()))?;
    let rim = border(back);
    let normals = back.vertex_normals();
    let mut out = back.clone();
    for (i, p) in back.vertices.iter().enumerate() {
        let inside = rim.iter().map(|r| (p - r).norm()).fold(f64::INFINITY, f64::min);
        let full = options.cartilage_mm * (inside / TAPER_MM).clamp(0.0, 1.0);
        // no further than the trochlea's cartilage
        let room = query.nearest(p).distance;
        out.vertices[i] += normals[i] * full.min(room).max(THINNEST_MM);
    }
    Ok(out)
}

/// Vertices of edges that one triangle alone has.
fn border(mesh: &TriMesh) -> Vec<Point> {
    let mut edges = std::collections::BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0_u32) += 1;
        }
    }
    edges.iter().filter(|(_, n)| **n == 1).map(|((a, _), _)| mesh.vertices[*a as usize]).collect()
}
