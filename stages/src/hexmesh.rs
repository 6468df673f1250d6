//! Stage 7, hexmesh: cartilage solids become hexahedra.

use crate::cartilage::{Cartilage, CartilageSolid};
use crate::error::Mark;
use crate::{PerCartilage, StageError};
use meshes::hex::HexMesh;
use meshes::parametrise::{Flat, flatten};
use meshes::quad::{Outline, QuadGrid, Raster, quads_within};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::sweep::{Columns, Faces};
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};

mod faces;

/// How the solids are meshed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HexmeshOptions {
    /// Wanted edge in the plane of the sheet [mm]; 0.5 to 1 in use.
    pub edge_length_mm: f64,
    /// Elements through the thickness [-].
    pub layers: usize,
    /// The mesh ends where the cartilage is thinner than this [mm].
    pub min_thickness_mm: f64,
    /// Columns found longer than this are misses [mm].
    pub max_thickness_mm: f64,
    /// The build stops where more than a hundredth of a cartilage's elements have this scaled Jacobian or less [-]; 0 is inverted
    /// [stimpson2007].
    pub least_scaled_jacobian: f64,
    /// Spots too thin to mesh, of at most this area, are meshed over [mm2]; larger ones stay holes.
    pub filled_hole_mm2: f64,
}

impl Default for HexmeshOptions {
    fn default() -> Self {
        HexmeshOptions {
            edge_length_mm: 0.9,
            layers: 3,
            min_thickness_mm: 0.35,
            max_thickness_mm: 10.0,
            least_scaled_jacobian: 0.0,
            filled_hole_mm2: 12.0,
        }
    }
}

/// Heights may differ from their surroundings' median by this and two fifths of it [mm].
const OUTLIER_MM: f64 = 0.4;

/// Outlines are smoothed over at least this, so that no rim has notches that elements cannot follow [mm].
const LEAST_SMOOTHING_MM: f64 = 0.5;
/// Sweeps that even out edge lengths, and sweeps of the search for better shapes, at most.
const RELAX_SWEEPS: usize = 12;
const SHAPE_SWEEPS: usize = 40;
/// A quadrilateral with a scaled Jacobian below the first, its opposite nodes within the second of an edge, has folded shut [-].
const FOLDED: f64 = 0.3;
const FOLD_WIDTH: f64 = 0.4;

/// The three hexahedral cartilages, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HexCartilage {
    /// The meshes.
    pub meshes: PerCartilage<HexMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: PerCartilage<HexQuality>,
}

/// Counts and shape of a hexahedral mesh, for metrics.json; none where it has no element.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HexQuality {
    /// Elements.
    pub elements: usize,
    /// Least scaled Jacobian [-].
    pub scaled_jacobian_min: Option<f64>,
    /// 5 % of the elements have less [-].
    pub scaled_jacobian_p05: Option<f64>,
    /// Mean scaled Jacobian [-].
    pub scaled_jacobian_mean: f64,
    /// Elements whose scaled Jacobian is not above 0.
    pub inverted: usize,
    /// Shortest edge on a face [mm].
    pub edge_min_mm: Option<f64>,
    /// Median edge on a face [mm].
    pub edge_median_mm: Option<f64>,
    /// Longest edge on a face [mm].
    pub edge_max_mm: Option<f64>,
    /// Volume [mm3].
    pub volume_mm3: f64,
}

/// Meshes the three solids. Errors name the cartilage.
pub fn hexmesh(cartilage: &Cartilage, options: &HexmeshOptions) -> Result<HexCartilage, StageError> {
    check(options)?;
    let one = |name: &str, solid: &CartilageSolid| {
        mesh_solid(solid, options).map_err(|e| e.of_part(format_args!("cartilage {name}")))
    };
    let solids = &cartilage.solids;
    let (femur, (medial, lateral)) = rayon::join(
        || one("femur", &solids.femur),
        || rayon::join(|| one("tibia_medial", &solids.tibia_medial), || one("tibia_lateral", &solids.tibia_lateral)),
    );
    let meshed = PerCartilage { femur: femur?, tibia_medial: medial?, tibia_lateral: lateral? };
    let mut warnings = Vec::new();
    for (name, (_, notes)) in meshed.named() {
        warnings.extend(notes.iter().map(|n| n.clone().whose(&format!("cartilage {name}"))));
    }
    let meshes = PerCartilage {
        femur: meshed.femur.0,
        tibia_medial: meshed.tibia_medial.0,
        tibia_lateral: meshed.tibia_lateral.0,
    };
    let metrics = meshes.map(quality);
    Ok(HexCartilage { meshes, warnings, metrics })
}

/// Counts and shape of a mesh.
pub fn quality(mesh: &HexMesh) -> HexQuality {
    let mut shape: Vec<f64> = (0..mesh.elements.len()).map(|e| mesh.scaled_jacobian(e)).collect();
    let mean = shape.iter().sum::<f64>() / shape.len().max(1) as f64;
    shape.sort_by(f64::total_cmp);
    let volume: f64 = (0..mesh.elements.len()).map(|e| mesh.element_volume(e)).sum();
    let mut edges: Vec<f64> = mesh
        .bony_quads
        .iter()
        .chain(&mesh.articular_quads)
        .flat_map(|q| (0..4).map(|k| (mesh.nodes[q[k] as usize] - mesh.nodes[q[(k + 1) % 4] as usize]).norm()))
        .collect();
    edges.sort_by(f64::total_cmp);
    let at = |list: &[f64], share: f64| list.get((share * list.len() as f64) as usize).or(list.last()).copied();
    HexQuality {
        elements: shape.len(),
        scaled_jacobian_min: shape.first().copied(),
        scaled_jacobian_p05: at(&shape, 0.05),
        scaled_jacobian_mean: mean,
        inverted: shape.iter().filter(|s| **s <= 0.0).count(),
        edge_min_mm: edges.first().copied(),
        edge_median_mm: at(&edges, 0.5),
        edge_max_mm: edges.last().copied(),
        volume_mm3: volume,
    }
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(options: &HexmeshOptions) -> Result<(), StageError> {
    let edge = options.edge_length_mm;
    if !(0.2..=3.0).contains(&edge) {
        return Err(StageError::option("hexmesh.edge_length_mm", edge, "0.2 to 3"));
    }
    if !(1..=10).contains(&options.layers) {
        return Err(StageError::option("hexmesh.layers", options.layers, "1 to 10"));
    }
    let positive = [options.min_thickness_mm, options.max_thickness_mm, options.filled_hole_mm2];
    if !(-1.0..1.0).contains(&options.least_scaled_jacobian) {
        return Err(StageError::option("hexmesh.least_scaled_jacobian", options.least_scaled_jacobian, "-1 to 1"));
    }
    if positive.iter().any(|x| !x.is_finite() || *x < 0.0) || options.max_thickness_mm <= options.min_thickness_mm {
        return Err(StageError::Knee(
            "hexmesh.min_thickness_mm, max_thickness_mm and filled_hole_mm2 must be finite, not negative, and max above min".into(),
        ));
    }
    Ok(())
}

/// The mesh of one solid and what was odd about it.
fn mesh_solid(solid: &CartilageSolid, options: &HexmeshOptions) -> Result<(HexMesh, Vec<Notice>), StageError> {
    let mut notes = Vec::new();
    let sheet = faces::split(solid, &mut notes)?;
    let queries = SurfaceQuery::new(&sheet.bony).zip(SurfaceQuery::new(&sheet.articular));
    let (bony, articular) = queries.ok_or_else(|| StageError::Knee("a face of the solid cannot be searched".into()))?;
    let faces = Faces { bony: &bony, articular: &articular };
    let (flat, grid) = plan(&sheet, options, &mut notes)?;
    let mut columns = raise(&sheet.bony, &flat, &grid, &faces, options)?;
    columns.relax(&faces, RELAX_SWEEPS);
    let edge = options.edge_length_mm;
    columns.optimise(&faces, edge, SHAPE_SWEEPS);
    if columns.collapse_folded(FOLDED, FOLD_WIDTH * edge) > 0 {
        columns.optimise(&faces, edge, SHAPE_SWEEPS);
    }
    let raised = thicken(&mut columns, 0.5 * options.min_thickness_mm);
    if raised > 0 {
        notes.push(
            Kind::RaisedColumns
                .notice(format!("{raised} columns were thinner than half the minimum thickness and were raised to it"))
                .count(raised),
        );
    }
    let mesh = columns.hexahedra(options.layers);
    let inverted = (0..mesh.elements.len()).filter(|&e| mesh.scaled_jacobian(e) <= 0.0).count();
    if inverted > 0 {
        notes.push(
            Kind::InvertedElements
                .notice(format!("{inverted} of {} elements are inverted", mesh.elements.len()))
                .count(inverted),
        );
    }
    refuse_bad(&mesh, options)?;
    Ok((mesh, notes))
}

/// Elements that an error names.
const NAMED_ELEMENTS: usize = 20;

/// Refuses a mesh with too many bad elements; names the worst by number and place.
fn refuse_bad(mesh: &HexMesh, options: &HexmeshOptions) -> Result<(), StageError> {
    let quality = |e: usize| mesh.scaled_jacobian(e);
    let mut bad: Vec<(f64, usize)> = (0..mesh.elements.len())
        .map(|e| (quality(e), e))
        .filter(|(q, _)| q.is_nan() || *q <= options.least_scaled_jacobian)
        .collect();
    if 100 * bad.len() <= mesh.elements.len() {
        return Ok(());
    }
    bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let named: Vec<(Mark, f64)> = bad
        .iter()
        .take(NAMED_ELEMENTS)
        .map(|&(q, e)| {
            let middle = mesh.elements[e].iter().map(|&n| mesh.nodes[n as usize].coords).sum::<Vector>() / 8.0;
            (Mark { name: format!("element {}", e + 1), place: middle.into() }, q)
        })
        .collect();
    let words: Vec<String> = named
        .iter()
        .map(|(mark, q)| {
            let [x, y, z] = mark.place;
            format!("{} at ({x:.1}, {y:.1}, {z:.1}) {q:.2}", mark.name)
        })
        .collect();
    let what = format!(
        "{} of {} elements have a scaled Jacobian of {} or less, expected at most a hundredth; the worst: {}; look at the solid there, or change hexmesh.edge_length_mm or min_thickness_mm",
        bad.len(),
        mesh.elements.len(),
        options.least_scaled_jacobian,
        words.join(", ")
    );
    Err(StageError::At { what, marks: named.into_iter().map(|(mark, _)| mark).collect() })
}

/// Lays the bony face flat and covers it with quadrilaterals wherever the cartilage is thick enough.
fn plan(
    sheet: &faces::Sheet,
    options: &HexmeshOptions,
    notes: &mut Vec<Notice>,
) -> Result<(Vec<Flat>, QuadGrid), StageError> {
    let edge = options.edge_length_mm;
    let flat = flatten(&sheet.bony).ok_or_else(|| StageError::Knee("the bony face cannot be laid flat".into()))?;
    let angle = outline(sheet, &flat, options)?.0.main_angle();
    let turn = nalgebra::Rotation2::new(-angle);
    let flat: Vec<Flat> = flat.iter().map(|p| turn * p).collect();
    let (outline, holes) = outline(sheet, &flat, options)?;
    if holes > 0 {
        notes.push(
            Kind::ThinSpots
                .notice(format!("{holes} thin spots of at most {} mm2 meshed over", options.filled_hole_mm2))
                .count(holes),
        );
    }
    let grid = quads_within(&outline, edge);
    if grid.quads.is_empty() {
        let area = sheet.bony.area();
        return Err(StageError::Knee(format!(
            "no element of {edge} mm fits: bony face {area:.0} mm2, min_thickness_mm {}; check the solid",
            options.min_thickness_mm
        )));
    }
    Ok((flat, grid))
}

fn outline(sheet: &faces::Sheet, flat: &[Flat], options: &HexmeshOptions) -> Result<(Outline, usize), StageError> {
    let edge = options.edge_length_mm;
    let raster = Raster::around(flat, edge / 5.0, 3.0 * edge)
        .ok_or_else(|| StageError::Knee("the flattened bony face is unreasonably large for this edge length".into()))?;
    let mut thickness = vec![-1.0; raster.len()];
    for t in &sheet.bony.triangles {
        raster.paint(&mut thickness, &t.map(|v| flat[v as usize]), t.map(|v| sheet.thickness_mm[v as usize]));
    }
    let thick: Vec<bool> = thickness.iter().map(|t| *t >= options.min_thickness_mm).collect();
    let (inside, holes) = raster.holes_filled(&thick, options.filled_hole_mm2);
    Ok((Outline::new(raster, &inside, 1.3 * edge, 0.2 * edge, (0.6 * edge).max(LEAST_SMOOTHING_MM)), holes))
}

/// Stands a column on each node of the grid: up the smoothed normal of the bony face to the articular face.
fn raise(
    sheet: &TriMesh,
    flat: &[Flat],
    grid: &QuadGrid,
    faces: &Faces,
    options: &HexmeshOptions,
) -> Result<Columns, StageError> {
    let plane = TriMesh {
        vertices: flat.iter().map(|p| Point::new(p.x, p.y, 0.0)).collect(),
        triangles: sheet.triangles.clone(),
    };
    let plane =
        SurfaceQuery::new(&plane).ok_or_else(|| StageError::Knee("the flattened face cannot be searched".into()))?;
    let bony: Vec<Point> = grid
        .nodes
        .iter()
        .map(|p| {
            let near = plane.nearest(&Point::new(p.x, p.y, 0.0));
            let corners = sheet.corners(near.triangle as usize);
            Point::from((0..3).map(|k| near.barycentric[k] * corners[k].coords).sum::<Vector>())
        })
        .collect();
    let neighbours = meshes::quad::grid::neighbours(bony.len(), &grid.quads);
    let mut up: Vec<Vector> = bony.iter().map(|p| faces.bony.smooth_normal(&faces.bony.nearest(p))).collect();
    for _ in 0..20 {
        up = smoothed(&up, &neighbours, |v| v.try_normalize(0.0).unwrap_or_else(Vector::zeros));
    }
    let found: Vec<Option<f64>> =
        bony.iter().zip(&up).map(|(p, n)| height_above(p, n, faces.articular, options.max_thickness_mm)).collect();
    let found = without_outliers(found, &neighbours);
    let height = fill_gaps(&found, &neighbours, options.min_thickness_mm);
    let articular = (0..bony.len())
        .map(|n| {
            let head = bony[n] + up[n] * height[n];
            if found[n].is_some() { head } else { faces.articular.nearest(&head).point }
        })
        .collect();
    Ok(Columns { bony, articular, quads: grid.quads.clone(), on_outline: grid.on_outline.clone() })
}

/// Distance [mm] from `foot` along `up` to the first part of the articular face that looks that way, within `reach`.
fn height_above(foot: &Point, up: &Vector, articular: &SurfaceQuery, reach: f64) -> Option<f64> {
    let mut height = 0.02;
    while let Some(hit) = articular.ray(&(foot + up * height), up, reach - height) {
        height += hit.distance;
        if articular.normal(hit.triangle).dot(up) > 0.1 {
            return Some(height);
        }
        height += 0.02;
    }
    None
}

fn smoothed(values: &[Vector], neighbours: &[Vec<u32>], finish: impl Fn(Vector) -> Vector) -> Vec<Vector> {
    let mean = |(n, list): (usize, &Vec<u32>)| {
        finish(values[n] + list.iter().map(|&m| values[m as usize]).sum::<Vector>() / list.len().max(1) as f64)
    };
    neighbours.iter().enumerate().map(mean).collect()
}

/// Heights far from the median of their surroundings count as misses: a ray through a crack or onto a stray bit.
fn without_outliers(found: Vec<Option<f64>>, neighbours: &[Vec<u32>]) -> Vec<Option<f64>> {
    let plausible = |n: usize| {
        let two_rings = neighbours[n].iter().flat_map(|&m| neighbours[m as usize].iter());
        let mut around: Vec<f64> = two_rings.filter_map(|&m| found[m as usize]).collect();
        around.sort_by(f64::total_cmp);
        let median = around.get(around.len() / 2).copied().unwrap_or(0.0);
        found[n].filter(|h| (h - median).abs() <= OUTLIER_MM + 0.4 * median)
    };
    (0..found.len()).map(plausible).collect()
}

/// Heights where rays missed: from neighbours that have one, ring by ring.
fn fill_gaps(found: &[Option<f64>], neighbours: &[Vec<u32>], least: f64) -> Vec<f64> {
    let mut known = found.to_vec();
    loop {
        let guess = |n: usize| {
            let around: Vec<f64> = neighbours[n].iter().filter_map(|&m| known[m as usize]).collect();
            (!around.is_empty()).then(|| around.iter().sum::<f64>() / around.len() as f64)
        };
        let next: Vec<Option<f64>> = (0..known.len()).map(|n| known[n].or_else(|| guess(n))).collect();
        let same = next == known;
        known = next;
        if same {
            return known.into_iter().map(|h| h.unwrap_or(least)).collect();
        }
    }
}

/// Raises columns lower than `least` [mm] along the normal of the quadrilaterals at their feet; returns how many.
fn thicken(columns: &mut Columns, least: f64) -> usize {
    let mut up = vec![Vector::zeros(); columns.bony.len()];
    for quad in &columns.quads {
        let [a, b, c, d] = quad.map(|v| columns.bony[v as usize]);
        let normal = (c - a).cross(&(d - b));
        quad.iter().for_each(|&v| up[v as usize] += normal);
    }
    let mut count = 0;
    for (n, up) in up.iter().enumerate() {
        let up = up.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        let height = (columns.articular[n] - columns.bony[n]).dot(&up);
        if height < least {
            columns.articular[n] += up * (least - height);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests;
