//! Surfaces of label maps, smooth below the voxel.

use super::blur::blur;
use super::{Grid, Labels, Volume};
use crate::repair::solidify;
use crate::surface::TriMesh;
use crate::surface_net::surface_net;
use crate::{Point, Vector};

/// The part of a label map about some labels: which of its voxels are of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The part of the grid, with a border of voxels of none.
    pub grid: Grid,
    /// One entry a voxel.
    pub inside: Vec<bool>,
}

impl Part {
    /// The voxels for whose label `of` holds, with `border` voxels about them on each axis; `None` where there are none.
    /// Beyond the picture nothing is inside.
    pub fn new(labels: &Labels, border: [usize; 3], of: impl Fn(u8) -> bool) -> Option<Part> {
        let grid = &labels.grid;
        let (mut low, mut high) = ([isize::MAX; 3], [isize::MIN; 3]);
        for (i, _) in labels.values.iter().enumerate().filter(|(_, l)| of(**l)) {
            let voxel = grid.voxel(i);
            for k in 0..3 {
                low[k] = low[k].min(voxel[k] as isize - border[k] as isize);
                high[k] = high[k].max(voxel[k] as isize + border[k] as isize);
            }
        }
        if low[0] == isize::MAX {
            return None;
        }
        let size = [0, 1, 2].map(|k| (high[k] - low[k] + 1) as usize);
        let part = Grid { size, origin: grid.point(&Vector::from(low.map(|x| x as f64))), axes: grid.axes };
        let mut inside = vec![false; part.count()];
        for (i, value) in inside.iter_mut().enumerate() {
            let voxel = part.voxel(i);
            let at = [0, 1, 2].map(|k| voxel[k] as isize + low[k]);
            if (0..3).all(|k| at[k] >= 0 && at[k] < grid.size[k] as isize) {
                *value = of(labels.values[grid.at(at.map(|x| x as usize))]);
            }
        }
        Some(Part { grid: part, inside })
    }
}

/// Voxels about a part that a blur of `sigma_mm` reaches, and one more, on each axis of `grid`.
pub fn border(grid: &Grid, sigma_mm: f64) -> [usize; 3] {
    grid.spacing().map(|s| (3.5 * sigma_mm / s.max(1e-6)).ceil() as usize + 1)
}

/// The surface of a part: where the blurred part falls below a half [gibson1998].
///
/// The blur of `sigma_mm` takes the steps of the voxels away and keeps plane faces where they are; a face of radius r moves by
/// sigma^2 / r towards its middle, a sixtieth of a millimetre at a condyle. `edge_mm` is the distance of the surface's
/// vertices, whatever the voxels' shape and directions. Closed, outward; `None` for a part without size.
pub fn outline(part: &Part, sigma_mm: f64, edge_mm: f64) -> Option<TriMesh> {
    let mut values: Vec<f32> = part.inside.iter().map(|&i| if i { -0.5 } else { 0.5 }).collect();
    blur(&part.grid, &mut values, sigma_mm);
    let field = Volume { grid: part.grid.clone(), values };
    let to_index = field.grid.index_from_mm()?;
    let far = Vector::from(field.grid.size.map(|n| (n - 1) as f64));
    let corner = |c: usize| {
        let pick = Vector::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2 & 1) as f64);
        field.grid.point(&far.component_mul(&pick))
    };
    let (low, high) = (1..8).map(corner).fold((corner(0), corner(0)), |(lo, hi), p| {
        (Point::from(lo.coords.inf(&p.coords)), Point::from(hi.coords.sup(&p.coords)))
    });
    let origin = field.grid.origin;
    let net = surface_net(&|p: &Point| field.sample(&(to_index * (p - origin))), low, high, edge_mm)?;
    // Where two faces touch within a cell the net has edges of four triangles.
    let mesh = solidify(&net, 0.0).mesh;
    (!mesh.triangles.is_empty()).then_some(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::Topology;
    use nalgebra::{Matrix3, Rotation3};

    /// A ball of radius 20 mm on an oblique grid of 0.36 x 0.36 x 0.7 mm.
    fn ball() -> Labels {
        let turn = Rotation3::new(Vector::new(0.3, -0.2, 0.4));
        let axes = turn.matrix() * Matrix3::from_diagonal(&Vector::new(0.36, 0.36, 0.7));
        let grid = Grid { size: [130, 130, 66], origin: Point::origin(), axes };
        let middle = grid.point(&Vector::new(64.3, 64.1, 32.7));
        let values = (0..grid.count())
            .map(|i| u8::from((grid.point(&Vector::from(grid.voxel(i).map(|x| x as f64))) - middle).norm() < 20.0))
            .collect();
        Labels { grid, values }
    }

    #[test]
    fn a_ball_of_voxels_comes_out_smooth_and_of_its_volume() {
        let labels = ball();
        let part = Part::new(&labels, border(&labels.grid, 0.5), |l| l == 1).unwrap();
        let mesh = outline(&part, 0.5, 0.7).unwrap();
        assert!(Topology::of(&mesh).is_closed());
        let voxels = labels.values.iter().filter(|l| **l == 1).count() as f64 * labels.grid.voxel_mm3();
        assert!((mesh.volume() / voxels - 1.0).abs() < 0.005, "{} {voxels}", mesh.volume());
        let middle = labels.grid.point(&Vector::new(64.3, 64.1, 32.7));
        let mut off: Vec<f64> = mesh.vertices.iter().map(|p| ((p - middle).norm() - 20.0).abs()).collect();
        let p95 = crate::measure::percentile(&mut off, 0.95);
        assert!(p95 < 0.12, "{p95}");
    }

    #[test]
    fn a_part_that_runs_out_of_the_picture_is_closed_there() {
        let mut labels = ball();
        labels.values.iter_mut().for_each(|l| *l = 1);
        let part = Part::new(&labels, border(&labels.grid, 0.5), |l| l == 1).unwrap();
        let mesh = outline(&part, 0.5, 0.9).unwrap();
        assert!(Topology::of(&mesh).is_closed());
        let whole = labels.grid.count() as f64 * labels.grid.voxel_mm3();
        assert!((mesh.volume() / whole - 1.0).abs() < 0.01, "{} {whole}", mesh.volume());
        assert!(Part::new(&labels, [1; 3], |l| l == 9).is_none());
    }
}
