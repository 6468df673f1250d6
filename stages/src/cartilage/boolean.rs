//! Cartilage as the paper has it: the closed scan minus the bone, cleaned.

use super::field::Domain;
use super::solid::finished;
use super::{CartilageOptions, Covered, Made};
use crate::StageError;
use meshes::boolean::difference;
use meshes::measure::edge_quality;
use meshes::repair::solidify;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use notices::Kind;

/// Bodies below this share of the largest volume are films and specks [-]; the smaller plateau has a third of the larger's or more.
const SPECK_SHARE: f64 = 0.1;

/// A body of the difference; by triangle, whether it lies on the scan.
type Body = (f64, TriMesh, Vec<bool>);

/// The cartilages of a bone by Boolean difference.
///
/// The scan is closed at its cut end and holes. The bone is moved onto what the scan shows of bare bone, then grown by the least
/// thickness, so that the films between two surfaces that nearly coincide vanish; the bony face is moved back after. What stays
/// are the largest bodies.
pub(super) fn of_bone(of: &Covered, options: &CartilageOptions) -> Result<Made, StageError> {
    let fail = |why: String| StageError::part("cartilage", format_args!("{} by Boolean difference: {why}", of.name));
    let scan = of.fit.ct_from_scan.mesh(&of.scan.mesh);
    let (domain, error) = Domain::with_error(of.bone, &scan, edge_quality(of.ct).edge_p50_mm, options)
        .ok_or_else(|| fail("the bone or the scan has no triangles".into()))?;
    let margin = options.least_thickness_mm.max(options.least_thickness_sd * domain.bare_sd);
    let bone = moved(&domain.bone, |v| error[v]);
    let grown = moved(&bone, |_| margin);
    let made = difference(&solidify(&scan, 0.01).mesh, &grown).map_err(|e| fail(e.to_string()))?;
    let (bodies, all) = bodies(&made.mesh, &made.of_first, of.facing);
    let least = SPECK_SHARE * bodies.first().map_or(0.0, |b| b.0);
    let kept: Vec<&Body> = bodies.iter().take(of.count).filter(|b| b.0 > least).collect();
    if kept.len() < of.count {
        return Err(fail(format!(
            "bodies of cartilage: {} of {}; check the registration and that the scan shows cartilage, or that no film joins both \
             plateaus; cartilage.method = \"thickness_field\" parts them",
            kept.len(),
            of.count
        )));
    }
    let mut warnings = Vec::new();
    if all > kept.len() {
        warnings.push(
            Kind::FilmsLeftOut
                .notice(format!(
                    "{}: {} films and specks of the Boolean difference left out",
                    of.name,
                    all - kept.len()
                ))
                .of(of.name)
                .count(all - kept.len()),
        );
    }
    let mut solids = Vec::new();
    for (_, mesh, of_scan) in kept {
        let of_scan = without_islands(mesh, of_scan);
        let back = moved_back(mesh, &of_scan, margin);
        let centre = back.centroid().ok_or_else(|| fail("a body has no area".into()))?;
        let solid = finished(of.name, &back, &of_scan, options)?;
        let tunnels = 1 - Topology::of(&solid.solid).euler_characteristic / 2;
        if tunnels > 0 {
            warnings.push(
                Kind::Tunnels
                    .notice(format!("{}: a cartilage has {tunnels} tunnels through thin places", of.name))
                    .of(of.name),
            );
        }
        solids.push((solid, centre));
    }
    Ok(Made { solids, bare_sd: domain.bare_sd, warnings })
}

/// The surface, each vertex moved outwards by its own length.
fn moved(mesh: &TriMesh, by: impl Fn(usize) -> f64) -> TriMesh {
    let normals = mesh.vertex_normals();
    let vertices = mesh.vertices.iter().zip(&normals).enumerate().map(|(v, (p, n))| p + n * by(v)).collect();
    TriMesh { vertices, triangles: mesh.triangles.clone() }
}

/// Bodies that lie on both scan and bone and look the way that cartilage does, the largest first; and how many bodies there were.
fn bodies(mesh: &TriMesh, of_scan: &[bool], facing: Option<Vector>) -> (Vec<Body>, usize) {
    let topology = Topology::of(mesh);
    let mut own: Vec<Vec<usize>> = vec![Vec::new(); topology.components];
    topology.component_of_triangle.iter().enumerate().for_each(|(t, c)| own[*c as usize].push(t));
    let looks = |all: &[usize]| {
        let sum: Vector = all.iter().filter(|t| of_scan[**t]).map(|&t| mesh.area_vector(t)).sum();
        facing.is_none_or(|f| sum.dot(&f) > 0.0)
    };
    let both = |all: &[usize]| all.iter().any(|t| of_scan[*t]) && all.iter().any(|t| !of_scan[*t]);
    let mut bodies: Vec<Body> = own
        .iter()
        .filter(|all| both(all) && looks(all))
        .map(|all| {
            let part = TriMesh {
                vertices: mesh.vertices.clone(),
                triangles: all.iter().map(|&t| mesh.triangles[t]).collect(),
            };
            let part = part.submesh(|_| true).0;
            (part.volume(), part, all.iter().map(|&t| of_scan[t]).collect())
        })
        .collect();
    bodies.sort_by(|a, b| b.0.total_cmp(&a.0));
    (bodies, topology.components)
}

/// Each face in one piece: islands within a face, where the scan folds or dips, go to the face around them.
fn without_islands(mesh: &TriMesh, of_scan: &[bool]) -> Vec<bool> {
    let mut of_scan = of_scan.to_vec();
    for side in [true, false] {
        let of: Vec<usize> = (0..of_scan.len()).filter(|&t| of_scan[t] == side).collect();
        let piece = Topology::of(&mesh.submesh(|t| of_scan[t] == side).0).component_of_triangle;
        let mut area = vec![0.0; piece.iter().max().map_or(0, |m| *m as usize + 1)];
        of.iter().zip(&piece).for_each(|(&t, &p)| area[p as usize] += mesh.area_vector(t).norm());
        let largest = (0..area.len()).max_by(|a, b| area[*a].total_cmp(&area[*b]));
        of.iter().zip(&piece).filter(|(_, p)| Some(**p as usize) != largest).for_each(|(&t, _)| of_scan[t] = !side);
    }
    of_scan
}

/// The body with its bony face moved back onto the bone; the rim, which both faces share, goes with it.
fn moved_back(mesh: &TriMesh, of_scan: &[bool], by: f64) -> TriMesh {
    let mut push = vec![Vector::zeros(); mesh.vertices.len()];
    for (t, corners) in mesh.triangles.iter().enumerate().filter(|(t, _)| !of_scan[*t]) {
        corners.iter().for_each(|&v| push[v as usize] += mesh.area_vector(t));
    }
    let back = |(p, n): (&Point, &Vector)| n.try_normalize(1e-12).map_or(*p, |n| p + n * by);
    TriMesh { vertices: mesh.vertices.iter().zip(&push).map(back).collect(), triangles: mesh.triangles.clone() }
}
