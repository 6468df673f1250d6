//! Stage 3, bones: the model's rigid bone surfaces from CT.

use crate::specimen::Specimen;
use crate::{PerBone, StageError};
use meshes::holes::fill_holes;
use meshes::measure::EdgeQuality;
use meshes::measure::{edge_quality, percentile};
use meshes::plane::{clipped, flat_faces};
use meshes::query::SurfaceQuery;
use meshes::remesh::{RemeshOptions, remesh};
use meshes::repair::{Solidified, solidify};
use meshes::smooth::{TaubinOptions, taubin};
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};

/// The rigid bones, closed, about 1.5 mm edges, CT frame; tibia and fibula are bodies of one surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bones {
    /// The surfaces.
    pub surfaces: PerBone<TriMesh>,
    /// The patella, where CT shows one.
    #[serde(default)]
    pub patella: Option<TriMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: BonesMetrics,
}

/// Figures of the bones, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BonesMetrics {
    /// Of the femur.
    pub femur: BoneMetrics,
    /// Of the tibia with the fibula.
    pub tibfib: BoneMetrics,
    /// Of the patella, where CT shows one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patella: Option<BoneMetrics>,
}

/// Figures of a bone's surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoneMetrics {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Bodies that hang together.
    pub bodies: usize,
    /// Volume [mm3].
    pub volume_mm3: f64,
    /// By how much it differs from the CT surface's, cropped [%].
    pub volume_change_percent: f64,
    /// 95 % of the vertices lie nearer to the CT surface [mm].
    pub surface_distance_p95_mm: f64,
    /// All lie nearer [mm].
    pub surface_distance_max_mm: f64,
    /// Edge lengths and angles.
    #[serde(flatten)]
    pub edges: EdgeQuality,
    /// Holes that were filled.
    pub holes_filled: usize,
}

/// How the bones are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BonesOptions {
    /// Length of bone kept from its joint end along the shaft [mm]; [andreassen2025, sec. 2.3].
    pub crop_mm: f64,
    /// Wanted edge length [mm]; the published decks' bones.
    pub edge_mm: f64,
    /// Rounds of remeshing [-]; our own trials.
    pub remesh_rounds: usize,
    /// Pairs of smoothing steps [-]; [taubin1995].
    pub smoothing_rounds: usize,
    /// Bodies below this share of the largest one's volume are specks [-]; our own choice: half a fibular head passes.
    pub speck_share: f64,
    /// Farthest a sawn end may lie from its plane [mm]; three times the noise of a CT surface.
    pub flat_tolerance_mm: f64,
}

impl Default for BonesOptions {
    fn default() -> Self {
        BonesOptions {
            crop_mm: 150.0,
            edge_mm: 1.5,
            remesh_rounds: 6,
            smoothing_rounds: 6,
            speck_share: 0.01,
            flat_tolerance_mm: 0.35,
        }
    }
}

/// Makes the rigid bone surfaces: cropped about the joint, closed, repaired, smoothed, evenly meshed.
///
/// Each bone is cut `crop_mm` from its joint end by a plane across its own shaft, made solid ([`solidify`]), smoothed without
/// shrinking [taubin1995] and remeshed [botsch2004]; the edges of sawn ends stay sharp.
///
/// Errors: a bone without volume, or one that cannot be closed.
pub fn bones(specimen: &Specimen, options: &BonesOptions) -> Result<Bones, StageError> {
    check(options)?;
    let mut warnings = Vec::new();
    let (femur, tibfib) = (&specimen.ct.femur, &specimen.ct.tibfib);
    let far = || StageError::part("bones", "a CT surface has no triangles");
    let towards = (femur.centroid().ok_or_else(far)?, tibfib.centroid().ok_or_else(far)?);
    let one = |name, mesh, towards| {
        let mut warnings = Vec::new();
        bone(name, mesh, Some(towards), options, &mut warnings).map(|made| (made, warnings))
    };
    let (f, t) = rayon::join(|| one("femur", femur, &towards.1), || one("tibfib", tibfib, &towards.0));
    let (((f, femur_metrics), first), ((t, tibfib_metrics), second)) = (f?, t?);
    warnings.extend(first.into_iter().chain(second));
    let mut metrics = BonesMetrics { femur: femur_metrics, tibfib: tibfib_metrics, patella: None };
    let mut patella = None;
    if let Some(given) = &specimen.patella {
        let (mesh, figures) = bone("patella", &given.ct, None, options, &mut warnings)?;
        metrics.patella = Some(figures);
        patella = Some(mesh);
    }
    Ok(Bones { surfaces: PerBone { femur: f, tibfib: t }, patella, warnings, metrics })
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(options: &BonesOptions) -> Result<(), StageError> {
    let positive =
        [("crop_mm", options.crop_mm), ("edge_mm", options.edge_mm), ("flat_tolerance_mm", options.flat_tolerance_mm)];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(StageError::option(format_args!("bones.{name}"), value, "a positive number of mm"));
        }
    }
    if options.edge_mm < 0.2 {
        return Err(StageError::option("bones.edge_mm", options.edge_mm, "0.2 mm or more"));
    }
    Ok(())
}

/// One bone's surface, cropped towards the `other` bone's middle where one is given.
fn bone(
    name: &str,
    ct: &TriMesh,
    other: Option<&Point>,
    options: &BonesOptions,
    warnings: &mut Vec<Notice>,
) -> Result<(TriMesh, BoneMetrics), StageError> {
    let solid = solidify(ct, options.speck_share);
    tell(name, &solid, warnings);
    if solid.mesh.volume() <= 0.0 {
        return Err(StageError::part(
            "bones",
            format_args!(
                "the CT surface of the {name} encloses no volume, expected a closed bone: check the file {name} in [ct]"
            ),
        ));
    }
    let whole = other.map_or_else(|| solid.mesh.clone(), |other| cropped(&solid.mesh, other, options));
    let labels = flat_faces(&whole, options.flat_tolerance_mm, 60.0);
    let mut smooth = whole.clone();
    taubin(
        &mut smooth,
        &flat_corners(&whole, &labels),
        &TaubinOptions { rounds: options.smoothing_rounds, ..TaubinOptions::default() },
    );
    let wanted = RemeshOptions { edge_mm: options.edge_mm, rounds: options.remesh_rounds };
    let (mesh, _) = remesh(&smooth, &labels, &wanted).map_err(|e| {
        StageError::part(
            "bones",
            format_args!("the {name} cannot be remeshed: {e}; repair the CT surface in its segmentation program"),
        )
    })?;
    let topology = Topology::of(&mesh);
    if !topology.is_closed() {
        return Err(StageError::part(
            "bones",
            format_args!("the {name} came out open; please report this surface as a fault"),
        ));
    }
    let metrics = grades(&whole, &mesh, &topology, solid.holes.len());
    Ok((mesh, metrics))
}

fn tell(name: &str, solid: &Solidified, warnings: &mut Vec<Notice>) {
    for hole in &solid.holes {
        let p = hole.centre;
        warnings.push(
            Kind::HoleFilled
                .notice(format!(
                    "{name}: hole of {:.0} mm around at ({:.1}, {:.1}, {:.1}) filled",
                    hole.perimeter_mm, p.x, p.y, p.z
                ))
                .of(name)
                .at([p.x, p.y, p.z]),
        );
    }
    for (kind, count, what) in [
        (Kind::DroppedTriangles, solid.dropped_triangles, "degenerate, doubled or crowded triangles dropped"),
        (Kind::TurnedTriangles, solid.turned_triangles, "triangles turned over"),
        (Kind::Specks, solid.specks, "specks dropped"),
        (Kind::Cavities, solid.inner_shells, "inner shells dropped"),
    ] {
        if count > 0 {
            warnings.push(kind.notice(format!("{name}: {count} {what}")).of(name).count(count));
        }
    }
}

/// The part of `mesh` within `crop_mm` of its joint end, capped where it is cut.
fn cropped(mesh: &TriMesh, other: &Point, options: &BonesOptions) -> TriMesh {
    let Some((origin, axis)) = shaft(mesh, other, options.crop_mm) else { return mesh.clone() };
    let end = joint_end(mesh, &axis);
    let height = |p: &Point| end - p.coords.dot(&axis);
    let deepest = mesh.vertices.iter().map(height).fold(0.0, f64::max);
    if deepest <= options.crop_mm + 1.0 {
        return mesh.clone();
    }
    let plane = origin + axis * (end - options.crop_mm - origin.coords.dot(&axis));
    let mut part = clipped(mesh, &plane, &axis);
    fill_holes(&mut part, f64::INFINITY);
    solidify(&part, options.speck_share).mesh
}

fn joint_end(mesh: &TriMesh, axis: &Vector) -> f64 {
    mesh.vertices.iter().map(|p| p.coords.dot(axis)).fold(f64::NEG_INFINITY, f64::max)
}

/// A point of the shaft and its direction towards the joint: the long axis of the largest body, then, where there is shaft
/// enough, the line through the centres of ten slabs of it between half of `crop_mm` and all of it from the joint end.
fn shaft(mesh: &TriMesh, other: &Point, crop_mm: f64) -> Option<(Point, Vector)> {
    let topology = Topology::of(mesh);
    let body = mesh.submesh(|t| topology.component_of_triangle[t] == 0).0;
    let centre = body.centroid()?;
    let mut spread = nalgebra::Matrix3::zeros();
    for t in 0..body.triangles.len() {
        let [a, b, c] = body.corners(t);
        let d = (a.coords + b.coords + c.coords) / 3.0 - centre.coords;
        spread += d * d.transpose() * body.area_vector(t).norm();
    }
    let eigen = spread.symmetric_eigen();
    let mut axis: Vector = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    if axis.dot(&(other - centre)) < 0.0 {
        axis = -axis;
    }
    let mut origin = centre;
    for _ in 0..3 {
        let end = joint_end(&body, &axis);
        let mut slabs = vec![(Vector::zeros(), 0.0); 10];
        for t in 0..body.triangles.len() {
            let [a, b, c] = body.corners(t);
            let p = (a.coords + b.coords + c.coords) / 3.0;
            let slab = ((end - p.dot(&axis)) / crop_mm - 0.5) * 20.0;
            if (0.0..10.0).contains(&slab) {
                let area = body.area_vector(t).norm();
                slabs[slab as usize].0 += p * area;
                slabs[slab as usize].1 += area;
            }
        }
        let centres: Vec<Vector> = slabs.iter().filter(|s| s.1 > 0.0).map(|s| s.0 / s.1).collect();
        if centres.len() < 8 {
            break;
        }
        let mean: Vector = centres.iter().sum::<Vector>() / centres.len() as f64;
        let line: nalgebra::Matrix3<f64> = centres.iter().map(|c| (c - mean) * (c - mean).transpose()).sum();
        let eigen = line.symmetric_eigen();
        let found: Vector = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        axis = if found.dot(&axis) < 0.0 { -found } else { found };
        origin = Point::from(mean);
    }
    Some((origin, axis))
}

/// Whether each vertex lies on a flat face or its edge.
fn flat_corners(mesh: &TriMesh, labels: &[u32]) -> Vec<bool> {
    let mut flat = vec![false; mesh.vertices.len()];
    for (triangle, label) in mesh.triangles.iter().zip(labels) {
        if *label > 0 {
            triangle.iter().for_each(|&v| flat[v as usize] = true);
        }
    }
    flat
}

fn grades(before: &TriMesh, after: &TriMesh, topology: &Topology, holes: usize) -> BoneMetrics {
    let mut distance: Vec<f64> = SurfaceQuery::new(before)
        .map(|q| after.vertices.iter().map(|p| q.nearest(p).distance).collect())
        .unwrap_or_default();
    BoneMetrics {
        vertices: after.vertices.len(),
        triangles: after.triangles.len(),
        bodies: topology.components,
        volume_mm3: after.volume(),
        volume_change_percent: 100.0 * (after.volume() / before.volume() - 1.0),
        surface_distance_p95_mm: percentile(&mut distance, 0.95),
        surface_distance_max_mm: percentile(&mut distance, 1.0),
        edges: edge_quality(after),
        holes_filled: holes,
    }
}
