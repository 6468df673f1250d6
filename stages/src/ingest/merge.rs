//! Scans of one bone that overlap become one, in the frame of the first.

use super::Read;
use crate::StageError;
use crate::register::rough;
use crate::specimen::Pieces;
use crate::specimen::{MergedPiece, SurfaceMetrics};
use meshes::registration::icp::{refine, standing};
use meshes::registration::sample::{Samples, spread};
use meshes::registration::target::Target;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, holes::boundary_loops};
use notices::{Kind, Notice};
use std::collections::BTreeSet;

/// Points by which a piece is laid on the others [-].
const SAMPLES: usize = 4000;
/// Nearer than this, a piece shows what is there already [mm]: beyond the noise of registration and scanner.
const COVERED_MM: f64 = 1.0;
/// Least share of a piece that must lie on the others [-], and how well it must lie there, root mean square [mm]; a scanner's
/// scans agree to a tenth of a millimetre.
const LEAST_OVERLAP: f64 = 0.1;
const MOST_APART_MM: f64 = 0.35;

/// The scan that `key` of specimen.toml names, all pieces in one; and its counts.
///
/// A piece is laid roughly on the CT bone, then on the pieces before it by what both show, cartilage and bone alike
/// (point to plane, robust); of it stays what they do not show. Seams stay open, so a mark across one is two.
pub(super) fn scan(
    key: &str,
    pieces: &Pieces,
    ct: &TriMesh,
    warnings: &mut Vec<Notice>,
    read: &Read,
) -> Result<(ColouredMesh, SurfaceMetrics), StageError> {
    let [first, others @ ..] = pieces.paths() else {
        return Err(StageError::specimen(format!("{key} lists no path")));
    };
    let (mut whole, mut counts) = read(key, first, warnings)?;
    for path in others {
        let (piece, _) = read(key, path, warnings)?;
        let fault = |why: String| StageError::named(path, key, why);
        let laid = laid(&whole.mesh, &piece.mesh, ct).map_err(fault)?;
        let added = added(&whole, &piece, &laid.pose).map_err(fault)?;
        if piece.colours.is_empty() != whole.colours.is_empty() {
            warnings.push(
                Kind::MixedColours
                    .notice(format!("{path}: one scan of {key} has colours and another has none: grey is put in"))
                    .file(path),
            );
        }
        counts.merged.push(MergedPiece {
            path: path.clone(),
            overlap_fraction: laid.overlap,
            overlap_rms_mm: laid.rms,
            added_triangles: added.mesh.triangles.len(),
        });
        whole = joined(whole, added);
    }
    (counts.vertices, counts.triangles) = (whole.mesh.vertices.len(), whole.mesh.triangles.len());
    Ok((whole, counts))
}

/// How a piece lies on the others.
struct Laid {
    pose: Isometry,
    overlap: f64,
    rms: f64,
}

fn laid(whole: &TriMesh, piece: &TriMesh, ct: &TriMesh) -> Result<Laid, String> {
    let no_area = || "a surface without area".to_string();
    let bone = Target::new(ct, 6000).ok_or_else(no_area)?;
    let [there, here] = [whole, piece].map(|mesh| spread(mesh, SAMPLES));
    let no_start = || "it does not resemble the CT bone anywhere".to_string();
    let ct_from_whole = rough(&bone, &there, &[], 1).ok_or_else(no_start)?.pose;
    let ct_from_piece = rough(&bone, &here, &[], 1).ok_or_else(no_start)?.pose;
    let target = Target::new(whole, 6000).ok_or_else(no_area)?;
    let mut pose = ct_from_whole.inverse() * ct_from_piece;
    for reach in [4.0, 2.0, 1.0] {
        let shared = shared(&target, &here, &pose, reach);
        pose = refine(&target, &shared, &pose, &[reach, 0.8 * reach, 0.6 * reach, 0.5 * reach, 0.4 * reach]);
    }
    let on = shared(&target, &here, &pose, COVERED_MM);
    let overlap = on.points.len() as f64 / here.points.len().max(1) as f64;
    let squares: f64 = on
        .points
        .iter()
        .zip(&on.normals)
        .map(|(p, n)| standing(&target, &(pose * p), &(pose * n)).residual.powi(2))
        .sum();
    let rms = (squares / on.points.len().max(1) as f64).sqrt();
    if overlap < LEAST_OVERLAP || rms > MOST_APART_MM {
        return Err(format!(
            "{:.0} % of it lies on the scans before it, {rms:.2} mm (root mean square) apart; expected {:.0} % or more within {MOST_APART_MM} mm: check that it is the same bone, undeformed, and overlaps the one before it in the list",
            100.0 * overlap,
            100.0 * LEAST_OVERLAP
        ));
    }
    Ok(Laid { pose, overlap, rms })
}

/// The samples that lie within `reach` of the target and face as it does.
fn shared(target: &Target, source: &Samples, pose: &Isometry, reach: f64) -> Samples {
    let mut out = Samples::default();
    for (p, n) in source.points.iter().zip(&source.normals) {
        let at = standing(target, &(pose * p), &(pose * n));
        if at.distance < reach && at.facing > 0.7 && at.residual.abs() > 0.9 * at.distance {
            out.points.push(*p);
            out.normals.push(*n);
        }
    }
    out
}

/// The triangles of `piece`, moved, that show what `whole` does not.
fn added(whole: &ColouredMesh, piece: &ColouredMesh, pose: &Isometry) -> Result<ColouredMesh, String> {
    let query = meshes::query::SurfaceQuery::new(&whole.mesh).ok_or("a surface without triangles")?;
    let rim: BTreeSet<u32> = boundary_loops(&whole.mesh).into_iter().flatten().collect();
    let moved = piece.mesh.moved(pose);
    let covered: Vec<bool> = moved
        .vertices
        .iter()
        .map(|p| {
            let near = query.nearest(p);
            let corners = whole.mesh.triangles[near.triangle as usize];
            near.distance < COVERED_MM && !corners.iter().any(|v| rim.contains(v))
        })
        .collect();
    let (mesh, from) = moved.submesh(|t| moved.triangles[t].iter().any(|&v| !covered[v as usize]));
    let colours =
        if piece.colours.is_empty() { Vec::new() } else { from.iter().map(|&v| piece.colours[v as usize]).collect() };
    Ok(ColouredMesh { mesh, colours })
}

fn joined(whole: ColouredMesh, more: ColouredMesh) -> ColouredMesh {
    let grey = |scan: &ColouredMesh| vec![[128; 3]; scan.mesh.vertices.len()];
    let colours = match (whole.colours.is_empty(), more.colours.is_empty()) {
        (true, true) => Vec::new(),
        (true, false) => [grey(&whole), more.colours].concat(),
        (false, true) => [whole.colours.clone(), grey(&more)].concat(),
        (false, false) => [whole.colours, more.colours].concat(),
    };
    ColouredMesh { mesh: TriMesh::joined([&whole.mesh, &more.mesh]), colours }
}
