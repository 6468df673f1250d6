//! The surfaces: read, unit judged, put right, counted.

use super::space;
use crate::StageError;
use crate::specimen::SurfaceMetrics;
use crate::specimen::{IngestOptions, RawSpecimen, SpecimenFile};
use formats::companions;
use formats::kind::{Kind, kind_of};
use formats::read_surface_told;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::tidy::tidy;
use meshes::topology::{Topology, vertex_neighbours};
use meshes::{Point, Vector};
use notices::Notice;
use std::collections::BTreeMap;

/// The width knees have [mm], the middle principal extent of a bone, whole or cropped.
pub(super) const KNEE_WIDTH_MM: f64 = 85.0;
/// Less is noise [mm].
const SPIKE_MM: f64 = 1.0;
/// Fewer triangles make no bone.
const LEAST_TRIANGLES: usize = 100;

/// A piece beside a bone with more of the triangles is a body of its own, no speck [-]. Ours: a patella has a tenth of a femur's.
const LARGE_PIECE: f64 = 0.08;
/// Share of the triangles that face inwards, from which on the whole surface does [-].
const INSIDE_OUT: f64 = 0.9;
/// What is said of such a surface: a mirror turns a surface inside out, and so do two columns that are exchanged.
const TURNED_WHOLE: &str = "triangles turned outward: the whole surface faced inwards, as one does that was mirrored (an axis flipped, or two columns exchanged: x, y, z written as y, x, z); check it, unless its program writes them so";

/// Reads, checks and repairs the surface that `key` of specimen.toml names; and its counts for metrics.json.
pub(super) fn checked(
    key: &str,
    path: &str,
    files: &BTreeMap<String, Vec<u8>>,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
) -> Result<(ColouredMesh, SurfaceMetrics), StageError> {
    let refuse = |what: String| StageError::named(path, key, what);
    let Some(bytes) = files.get(path) else { return Err(refuse("the file is not there".into())) };
    missing_companions(path, bytes, files, warnings);
    let (mut read, notes) =
        read_surface_told(path, bytes, files).map_err(|e| refuse(no_surface(path, bytes, &e.to_string())))?;
    warnings.extend(notes.into_iter().map(|note| note.in_file(path)));
    space::to_lps(&mut read.mesh, key, path, bytes, options);
    if read.mesh.triangles.len() < LEAST_TRIANGLES {
        return Err(refuse(format!(
            "{} vertices and {} triangles; expected the surface of a bone: export a triangle mesh, not points",
            read.mesh.vertices.len(),
            read.mesh.triangles.len()
        )));
    }
    let (surface, repairs) = tidy(&read);
    let width = middle_extent(&surface.mesh);
    warnings.extend(odd_size(key, path, width));
    // A patella is half as wide as a knee.
    check_unit(if key.ends_with("patella") { 2.0 * width } else { width }, options).map_err(refuse)?;
    if let Some((count, first)) = spikes(&surface.mesh) {
        warnings.push(notices::Kind::Spikes.notice(format!(
            "{path}: {count} vertices stand far off all their neighbours, the first at ({:.1}, {:.1}, {:.1}): damaged or stray points",
            first.x, first.y, first.z
        )).file(path).count(count).at([first.x, first.y, first.z]));
    }
    let topology = Topology::of(&surface.mesh);
    let mut warn = |kind: notices::Kind, count: usize, what: &str| {
        if count > 0 {
            warnings.push(kind.notice(format!("{path}: {count} {what}")).file(path).count(count));
        }
    };
    warn(notices::Kind::DroppedTriangles, repairs.degenerate_triangles, "triangles without area dropped");
    warn(notices::Kind::DroppedTriangles, repairs.doubled_triangles, "doubled triangles dropped");
    let inside_out = repairs.turned_triangles as f64 > INSIDE_OUT * read.mesh.triangles.len() as f64;
    warn(
        notices::Kind::TurnedTriangles,
        repairs.turned_triangles,
        if inside_out { TURNED_WHOLE } else { "triangles turned outward" },
    );
    warn(notices::Kind::Cavities, repairs.cavities, "cavities inside the bone left as they are");
    warn(
        notices::Kind::IrregularEdges,
        topology.irregular_edges,
        "edges shared by more than two triangles, or by two turned alike",
    );
    if key.starts_with("ct.") {
        warn(notices::Kind::OpenEdges, topology.boundary_edges, "open edges in a CT surface, which should be closed");
    }
    let bodies = if key == "ct.tibfib" { 2 } else { 1 };
    if topology.components > bodies {
        let what = pieces_beside(&topology, bodies, repairs.cavities);
        warn(notices::Kind::PiecesBeside, topology.components - bodies, &what);
    }
    if key.starts_with("scans.") && topology.boundary_edges == 0 {
        warnings.push(
            notices::Kind::ClosedScan
                .notice(format!(
                    "{path}: the scan is closed: its holes may have been filled with surface nobody measured"
                ))
                .file(path),
        );
    }
    let counts = SurfaceMetrics {
        vertices: surface.mesh.vertices.len(),
        triangles: surface.mesh.triangles.len(),
        width_mm: width,
        dropped_vertices: repairs.dropped_vertices,
        degenerate_triangles: repairs.degenerate_triangles,
        doubled_triangles: repairs.doubled_triangles,
        turned_triangles: repairs.turned_triangles,
        cavities: repairs.cavities,
        boundary_edges: topology.boundary_edges,
        irregular_edges: topology.irregular_edges,
        components: topology.components,
        coloured: surface.colours.iter().any(|c| *c != surface.colours[0]),
        merged: vec![],
    };
    Ok((surface, counts))
}

/// What pieces beside so many bodies are.
fn pieces_beside(topology: &Topology, bodies: usize, cavities: usize) -> String {
    let share = share_of(topology, bodies);
    // an inner shell is told as what it is
    match share > LARGE_PIECE && cavities == 0 {
        true => format!(
            "loose pieces besides the bone, of which the largest has {:.0} % of all triangles: another bone, or a table? Give each bone a file of its own",
            100.0 * share
        ),
        false => "loose pieces besides the bone".into(),
    }
}

/// The share of all triangles that the largest piece beside so many bodies has [-]; components are in order of size.
fn share_of(topology: &Topology, bodies: usize) -> f64 {
    let own = topology.component_of_triangle.iter().filter(|c| **c as usize == bodies).count();
    own as f64 / topology.component_of_triangle.len().max(1) as f64
}

/// Why a file is no surface, and where a file of its kind belongs.
fn no_surface(path: &str, bytes: &[u8], why: &str) -> String {
    let kind = kind_of(path, bytes);
    let place = match kind {
        Kind::Picture | Kind::Dicom => "name a CT under [ct] volume, a label map under [segmentation] labels",
        Kind::Markups | Kind::Table => "name tables of points under [points], measured laxity under [laxity]",
        _ => return why.to_owned(),
    };
    format!("it is {}; expected a surface as STL, PLY, OBJ or VTK: {place}", kind.words())
}

/// A surface of a specimen, judged by itself.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Its key in specimen.toml.
    pub key: String,
    /// Its path.
    pub path: String,
    /// Counts as in metrics.json, or what is wrong.
    pub result: Result<SurfaceMetrics, StageError>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
}

/// Judges every surface that specimen.toml names, each by itself, so that one bad file does not hide another.
pub fn judge_surfaces(file: &SpecimenFile, raw: &RawSpecimen, options: &IngestOptions) -> Vec<Judged> {
    let surface = |key: &str| {
        ["ct.femur", "ct.tibfib", "ct.patella"].contains(&key) || (key.starts_with("scans.") && key != "scans.capsule")
    };
    let named = super::file::named(file).into_iter().filter(|(key, _)| surface(key));
    named
        .map(|(key, path)| {
            let mut warnings = Vec::new();
            let result = checked(&key, &path, &raw.files, options, &mut warnings).map(|(_, counts)| counts);
            Judged { key, path, result, warnings }
        })
        .collect()
}

/// Vertices farther from the middle of their neighbours than one and a half times these spread, and than [`SPIKE_MM`]: how many, and
/// the first. No measured surface has such.
fn spikes(mesh: &TriMesh) -> Option<(usize, Point)> {
    let neighbours = vertex_neighbours(mesh);
    let far = |v: usize| {
        let around = &neighbours[v];
        let middle = Point::from(
            around.iter().map(|&w| mesh.vertices[w as usize].coords).sum::<Vector>() / around.len().max(1) as f64,
        );
        let spread = around.iter().map(|&w| (mesh.vertices[w as usize] - middle).norm()).fold(0.0, f64::max);
        let off = (mesh.vertices[v] - middle).norm();
        around.len() >= 4 && off > SPIKE_MM && off > 1.5 * spread
    };
    let found: Vec<usize> = (0..mesh.vertices.len()).filter(|&v| far(v)).collect();
    found.first().map(|&v| (found.len(), mesh.vertices[v]))
}

fn missing_companions(path: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>, warnings: &mut Vec<Notice>) {
    let mut named: Vec<(String, String)> = companions(path, bytes).into_iter().map(|c| (path.to_string(), c)).collect();
    let mut next = 0;
    while let Some((by, companion)) = named.get(next).cloned() {
        next += 1;
        match files.get(&companion) {
            Some(content) if next < 1000 => {
                let more: Vec<_> =
                    companions(&companion, content).into_iter().map(|c| (companion.clone(), c)).collect();
                named.extend(more);
            }
            Some(_) => {}
            None => warnings.push(
                notices::Kind::NoCompanion
                    .notice(format!("{by} names {companion}, which is not there: its colours are lost"))
                    .file(&by),
            ),
        }
    }
}

/// The middle one of the three extents along the principal axes [mm]: as wide as the joint end, however long the shaft.
pub fn middle_extent(mesh: &TriMesh) -> f64 {
    let Some(centre) = mesh.centroid() else { return 0.0 };
    let areas = mesh.vertex_areas();
    let mut spread = nalgebra::Matrix3::zeros();
    for (p, a) in mesh.vertices.iter().zip(&areas) {
        let d = p - centre;
        spread += d * d.transpose() * *a;
    }
    if !spread.iter().all(|x| x.is_finite()) {
        return f64::INFINITY;
    }
    let axes = spread.symmetric_eigen().eigenvectors;
    let mut extents: Vec<f64> = (0..3)
        .map(|k| {
            let axis: Vector = axes.column(k).into();
            let (lo, hi) = mesh.vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| {
                let x = (p - centre).dot(&axis);
                (lo.min(x), hi.max(x))
            });
            hi - lo
        })
        .collect();
    extents.sort_by(f64::total_cmp);
    extents[1]
}

/// Widths of adults' knees, the middle extent of a bone [mm]: epicondylar widths are 73 to 93 in the VSD femora (doi 10.1038/s41597-023-02669-z),
/// and extents are up to a sixth more or less than these; ours.
const ADULT_MM: std::ops::RangeInclusive<f64> = 60.0..=110.0;

/// What is said of a bone that no adult has.
pub(super) fn odd_size(key: &str, path: &str, width: f64) -> Option<Notice> {
    let bone = key.ends_with("femur") || key.ends_with("tibfib");
    let odd = bone && width.is_finite() && !ADULT_MM.contains(&width);
    odd.then(|| {
        notices::Kind::OddSize.notice(format!(
            "{path}: the bone is {width:.0} mm wide, where adults' are {:.0} to {:.0}: a child's or a giant's, or a wrong scale or pixel spacing",
            ADULT_MM.start(),
            ADULT_MM.end()
        )).file(path)
    })
}

pub(super) fn check_unit(width: f64, options: &IngestOptions) -> Result<(), String> {
    if (options.least_width_mm..=options.greatest_width_mm).contains(&width) {
        return Ok(());
    }
    let units = [("metres", 1000.0), ("inches", 25.4), ("centimetres", 10.0), ("micrometres", 0.001)];
    let unit = units.iter().find(|(_, mm)| (0.5..2.0).contains(&(width * mm / KNEE_WIDTH_MM)));
    Err(match unit {
        Some((name, mm)) => format!(
            "the bone is {width:.3} mm wide as its numbers stand, where adults' are {:.0} to {:.0} mm: it is a knee in {name}; expected millimetres: multiply the coordinates by {mm} (export in mm)",
            ADULT_MM.start(),
            ADULT_MM.end()
        ),
        None => format!(
            "the bone is {width:.3} mm wide as its numbers stand; expected a knee in millimetres, {} to {} mm: check the unit and that the file holds this bone alone",
            options.least_width_mm, options.greatest_width_mm
        ),
    })
}
