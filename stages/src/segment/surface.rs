//! Surfaces of the labelled bones.

use super::SegmentMetrics;
use super::refine::refine;
use super::{LABELS, SegmentOptions, Segmented};
use crate::StageError;
use crate::anatomy::looks_swapped;
use meshes::repair::solidify;
use meshes::smooth::{TaubinOptions, taubin};
use meshes::surface::TriMesh;
use meshes::surface_net::surface_net;
use meshes::topology::Topology;
use meshes::volume::components::neighbours;
use meshes::volume::{Grid, Labels, Volume};
use meshes::{Point, Vector};
use notices::Kind;

/// Bodies below this share of the largest are specks [-].
const SPECK_SHARE: f64 = 0.01;

/// The surfaces of every labelled bone.
pub(super) fn surfaces(
    volume: &Volume,
    mut labels: Labels,
    threshold: f64,
    options: &SegmentOptions,
) -> Result<Segmented, StageError> {
    let whole = |what: &[u8], name: &str| {
        surface(volume, &labels, what, threshold, options).ok_or_else(|| {
            StageError::Knee(format!("no surface of the {name} in the CT volume: its label is empty or flat"))
        })
    };
    let mut femur = whole(&[1], "femur")?;
    let mut tibfib = whole(&[2, 3], "tibia")?;
    let patella = if labels.values.contains(&4) { Some(whole(&[4], "patella")?) } else { None };
    if !labels.values.contains(&3) && looks_swapped(&femur, &tibfib) {
        std::mem::swap(&mut femur, &mut tibfib);
        labels.values.iter_mut().for_each(|l| *l = [0, 2, 1, 3, 4][usize::from(*l).min(4)]);
    }
    let mut warnings = Vec::new();
    for (name, mesh, most) in
        [("femur", Some(&femur), 1), ("tibfib", Some(&tibfib), 2), ("patella", patella.as_ref(), 1)]
    {
        let bodies = mesh.map_or(0, |m| Topology::of(m).components);
        if bodies > most {
            warnings.push(
                Kind::InPieces
                    .notice(format!("the {name} came out in {bodies} pieces: look at 00-segment/labels.nii.gz"))
                    .of(name),
            );
        }
    }
    let voxel = labels.grid.voxel_mm3();
    let volume = |n: u8| labels.values.iter().filter(|l| **l == n).count() as f64 * voxel;
    let metrics = SegmentMetrics {
        voxels: labels.grid.size,
        spacing_mm: labels.grid.spacing(),
        threshold,
        label_volume_mm3: LABELS.iter().map(|(n, name)| ((*name).to_owned(), volume(*n))).collect(),
        femur_volume_mm3: femur.volume(),
        tibfib_volume_mm3: tibfib.volume(),
        patella_volume_mm3: patella.as_ref().map(TriMesh::volume),
    };
    Ok(Segmented { femur, tibfib, patella, labels, warnings, metrics })
}

/// The surface of the voxels with one of the labels `what`.
fn surface(volume: &Volume, labels: &Labels, what: &[u8], threshold: f64, options: &SegmentOptions) -> Option<TriMesh> {
    let grid = &volume.grid;
    let field = field(volume, labels, what, threshold)?;
    let far = field.grid.size.map(|n| (n - 1) as f64);
    let net = surface_net(&|p: &Point| field.sample(&p.coords), Point::origin(), Point::from(far), 1.0)?;
    let mut mesh = TriMesh {
        vertices: net.vertices.iter().map(|p| field.grid.point(&p.coords)).collect(),
        triangles: net.triangles,
    };
    if grid.axes.determinant() < 0.0 {
        mesh = mesh.flipped();
    }
    let mut mesh = solidify(&mesh, SPECK_SHARE).mesh;
    let smooth = TaubinOptions { rounds: options.smoothing_rounds, ..TaubinOptions::default() };
    taubin(&mut mesh, &[], &smooth);
    refine(&mut mesh, volume, threshold, options);
    (!mesh.triangles.is_empty() && mesh.volume() > 0.0).then_some(mesh)
}

/// A field on the part of the grid about the labels, and two voxels about it: negative inside, its zero where the
/// threshold is crossed between a voxel of the labels and one that is not.
fn field(volume: &Volume, labels: &Labels, what: &[u8], threshold: f64) -> Option<Volume> {
    let grid = &volume.grid;
    let ours = |i: usize| what.contains(&labels.values[i]);
    let (mut low, mut high) = ([isize::MAX; 3], [isize::MIN; 3]);
    for i in (0..grid.count()).filter(|&i| ours(i)) {
        let voxel = grid.voxel(i);
        for k in 0..3 {
            low[k] = low[k].min(voxel[k] as isize - 2);
            high[k] = high[k].max(voxel[k] as isize + 2);
        }
    }
    if low[0] == isize::MAX {
        return None;
    }
    let size = [0, 1, 2].map(|k| (high[k] - low[k] + 1) as usize);
    let origin = grid.point(&Vector::from(low.map(|x| x as f64)));
    let part = Grid { size, origin, axes: grid.axes };
    let contrast = 0.5 * threshold.abs().max(100.0);
    let value = |voxel: [usize; 3]| -> f32 {
        let place: [isize; 3] = [0, 1, 2].map(|k| voxel[k] as isize + low[k]);
        if (0..3).any(|k| place[k] < 0 || place[k] >= grid.size[k] as isize) {
            return 1.0;
        }
        let at = grid.at(place.map(|x| x as usize));
        let inside = ours(at);
        if neighbours(grid, at).all(|n| ours(n) == inside) {
            return if inside { -1.0 } else { 1.0 };
        }
        let over = (threshold - f64::from(volume.values[at])) / contrast;
        (if inside { over.clamp(-1.0, -0.1) } else { over.clamp(0.1, 1.0) }) as f32
    };
    let values = (0..part.count()).map(|i| value(part.voxel(i))).collect();
    Some(Volume { grid: part, values })
}
