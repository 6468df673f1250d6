//! The two faces of a cartilage solid, made ready for meshing.

use crate::StageError;
use crate::cartilage::CartilageSolid;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// The bony face as one sheet, and the articular face; normals of both towards the articular side.
pub(super) struct Sheet {
    pub(super) bony: TriMesh,
    /// Thickness above each vertex of `bony` [mm]; 0 on caps.
    pub(super) thickness_mm: Vec<f64>,
    pub(super) articular: TriMesh,
}

/// Parts of the bony face smaller than this share of it are dropped without a note.
const NEGLIGIBLE: f64 = 0.01;
/// An articular triangle whose normal leads into the bone by more than this cosine is none.
const INTO_BONE: f64 = 0.3;

/// Splits a solid; the bony face is its largest part, small holes capped.
pub(super) fn split(solid: &CartilageSolid, notes: &mut Vec<Notice>) -> Result<Sheet, StageError> {
    let (vertices, triangles) = (solid.solid.vertices.len(), solid.solid.triangles.len());
    if solid.articular.len() != triangles || solid.thickness_mm.len() != vertices {
        return Err(StageError::Knee(format!(
            "labels of {} triangles and thickness of {} vertices, expected {triangles} and {vertices}",
            solid.articular.len(),
            solid.thickness_mm.len()
        )));
    }
    if solid.solid.vertices.iter().any(|p| !p.coords.iter().all(|x| x.is_finite()))
        || solid.solid.triangles.iter().flatten().any(|&v| v as usize >= vertices)
    {
        return Err(StageError::Knee(
            "the solid has a coordinate that is not a number or a triangle without a vertex".into(),
        ));
    }
    let (bony, old) = solid.solid.submesh(|t| !solid.articular[t]);
    let (articular, _) = solid.solid.submesh(|t| solid.articular[t]);
    if bony.triangles.is_empty() || articular.triangles.is_empty() {
        return Err(StageError::Knee("the solid needs triangles of both the bony and the articular face".into()));
    }
    let (sheet, kept) = largest_part(&bony, "bony", notes);
    let articular = away_from_bone(&articular, &sheet);
    let (articular, _) = largest_part(&articular, "articular", notes);
    let mut thickness_mm: Vec<f64> = kept.iter().map(|&v| solid.thickness_mm[old[v as usize] as usize]).collect();
    let bony = capped(sheet.flipped(), &mut thickness_mm);
    Ok(Sheet { bony, thickness_mm, articular })
}

/// The triangles of the articular face that do not look into the bone: frayed bits of the rim and of the bony face do.
fn away_from_bone(articular: &TriMesh, bony: &TriMesh) -> TriMesh {
    let Some(query) = SurfaceQuery::new(bony) else { return articular.clone() };
    let normals = articular.triangle_normals();
    let keep = |t: usize| {
        let [a, b, c] = articular.corners(t);
        let centre = Point::from((a.coords + b.coords + c.coords) / 3.0);
        // The sheet's own normals still lead into the bone here.
        normals[t].dot(&query.smooth_normal(&query.nearest(&centre))) < INTO_BONE
    };
    articular.submesh(keep).0
}

/// The largest connected part of a face and the old index of its vertices; a note when it is not nearly all.
fn largest_part(face: &TriMesh, name: &str, notes: &mut Vec<Notice>) -> (TriMesh, Vec<u32>) {
    let parts = Topology::of(face).component_of_triangle;
    let count = parts.iter().max().map_or(0, |m| m + 1) as usize;
    let mut areas = vec![0.0; count];
    for (t, &part) in parts.iter().enumerate() {
        areas[part as usize] += face.area_vector(t).norm() / 2.0;
    }
    let main = (0..count).max_by(|&a, &b| areas[a].total_cmp(&areas[b])).unwrap_or(0);
    let whole: f64 = areas.iter().sum();
    if areas.get(main).is_some_and(|a| *a < (1.0 - NEGLIGIBLE) * whole) {
        notes.push(
            Kind::FaceParts
                .notice(format!(
                    "the {name} face has {count} parts; the largest used, {:.0} of {whole:.0} mm2",
                    areas[main]
                ))
                .count(count),
        );
    }
    face.submesh(|t| parts[t] as usize == main)
}

/// The sheet with a fan over each hole (each border loop but the longest); new vertices have thickness 0.
fn capped(mut sheet: TriMesh, thickness_mm: &mut Vec<f64>) -> TriMesh {
    let mut loops = border_loops(&sheet);
    let length = |l: &Vec<u32>| -> f64 {
        (0..l.len())
            .map(|k| (sheet.vertices[l[k] as usize] - sheet.vertices[l[(k + 1) % l.len()] as usize]).norm())
            .sum()
    };
    let Some(longest) = (0..loops.len()).max_by(|&a, &b| length(&loops[a]).total_cmp(&length(&loops[b]))) else {
        return sheet;
    };
    loops.remove(longest);
    for l in loops {
        let centre = l.iter().map(|&v| sheet.vertices[v as usize].coords).sum::<Vector>() / l.len() as f64;
        let c = sheet.vertices.len() as u32;
        sheet.vertices.push(Point::from(centre));
        thickness_mm.push(0.0);
        sheet.triangles.extend((0..l.len()).map(|k| [l[(k + 1) % l.len()], l[k], c]));
    }
    sheet
}

/// Loops of the border, in the direction of its triangles. Pinched vertices end a loop early: each edge is used once.
fn border_loops(sheet: &TriMesh) -> Vec<Vec<u32>> {
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for t in &sheet.triangles {
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
        }
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &(a, b) in edges.keys().rev() {
        if !edges.contains_key(&(b, a)) {
            next.entry(a).or_default().push(b);
        }
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.iter().find(|(_, list)| !list.is_empty()) {
        let (mut here, mut path) = (start, Vec::new());
        while let Some(to) = next.get_mut(&here).and_then(Vec::pop) {
            path.push(here);
            here = to;
            if here == start {
                break;
            }
        }
        if here == start && path.len() > 2 {
            loops.push(path);
        }
        next.retain(|_, list| !list.is_empty());
    }
    loops
}
