//! A CT volume of bones whose surfaces are known: what a scanner would show of them.

use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::volume::blur::blur;
use meshes::volume::distance::distance_to;
use meshes::volume::{Grid, Volume};
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// What the scanner is like. Densities in Hounsfield units.
#[derive(Clone, Debug, PartialEq)]
pub struct Scanner {
    /// Distance of voxels along each axis [mm].
    pub spacing_mm: [f64; 3],
    /// Directions of the three axes, in columns.
    pub turn: Matrix3<f64>,
    /// Standard deviation of the point spread [mm]; 0.42 is 1 mm at half height.
    pub spread_mm: f64,
    /// Standard deviation of the noise [HU].
    pub noise_hu: f64,
    /// Picture beyond the bones [mm]; negative: the bones run out of it.
    pub margin_mm: [f64; 3],
    /// Soft tissue about the bones [mm], then air.
    pub flesh_mm: f64,
}

impl Default for Scanner {
    fn default() -> Self {
        Scanner {
            spacing_mm: [0.75, 0.75, 0.6],
            turn: Matrix3::identity(),
            spread_mm: 0.42,
            noise_hu: 25.0,
            margin_mm: [12.0; 3],
            flesh_mm: 14.0,
        }
    }
}

/// Depth beyond which only the inside shows [mm].
const DEEP: f64 = 6.5;
/// Distance over which a voxel mixes two sides, as a standard deviation over its width [-].
const MIXING: f64 = 0.29;

/// The volume a scanner would make of `bones`, closed surfaces; `None` where there is none.
///
/// A cortex of 1 mm and 900 HU at the joint to 4 mm and 1400 HU along the shafts, cancellous bone of 280 HU falling to marrow of
/// -40 HU, both uneven; muscle and fat about, air beyond. Then the voxel's own width, a Gaussian point spread and Gaussian
/// noise of the same grain; whole numbers. The joint is taken to lie midway between the first two bones' centroids.
pub fn ct_volume(bones: &[&TriMesh], scanner: &Scanner, seed: u64) -> Option<Volume> {
    let grid = grid(bones, scanner)?;
    let centres: Vec<Point> = bones.iter().take(2).filter_map(|b| b.centroid()).collect();
    let joint = Point::from(centres.iter().map(|c| c.coords).sum::<Vector>() / centres.len() as f64);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let matter = Matter {
        joint,
        mixing: MIXING * scanner.spacing_mm.iter().copied().fold(0.0, f64::max),
        flesh: scanner.flesh_mm,
        grain: waves(&mut rng, 1.6),
        muscle: waves(&mut rng, 14.0),
    };
    let depth = bones.iter().map(|b| signed(b, &grid)).collect::<Option<Vec<_>>>()?;
    let nearest = |i: usize| depth.iter().map(|d| d[i]).fold(f32::INFINITY, f32::min);
    let values: Vec<f32> = (0..grid.count())
        .into_par_iter()
        .map(|i| {
            let p = grid.point(&Vector::from(grid.voxel(i).map(|x| x as f64)));
            matter.density(&p, f64::from(nearest(i))) as f32
        })
        .collect();
    let mut volume = Volume { grid, values };
    blur(&volume.grid, &mut volume.values, scanner.spread_mm);
    let mut noise = vec![0.0f32; volume.values.len()];
    let slice = volume.grid.size[0] * volume.grid.size[1];
    noise.par_chunks_mut(slice).enumerate().for_each(|(k, part)| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(1 + k as u64));
        part.iter_mut().for_each(|x| *x = super::bone::normal_deviate(&mut rng) as f32);
    });
    let left = blur(&volume.grid, &mut noise, scanner.spread_mm);
    for (x, n) in volume.values.iter_mut().zip(noise) {
        *x = (f64::from(*x) + f64::from(n) * scanner.noise_hu / left).round().clamp(-1024.0, 3071.0) as f32;
    }
    Some(volume)
}

fn grid(bones: &[&TriMesh], scanner: &Scanner) -> Option<Grid> {
    let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
    let back = scanner.turn.transpose();
    for p in bones.iter().flat_map(|b| &b.vertices) {
        let q = back * p.coords;
        low = low.inf(&q);
        high = high.sup(&q);
    }
    let margin = Vector::from(scanner.margin_mm);
    let (low, high) = (low - margin, high + margin);
    let spacing = Vector::from(scanner.spacing_mm);
    let size = [0, 1, 2].map(|k| ((high[k] - low[k]) / spacing[k]).ceil());
    if !size.iter().all(|n| (8.0..2000.0).contains(n)) {
        return None;
    }
    Some(Grid {
        size: size.map(|n| n as usize),
        origin: Point::from(scanner.turn * low),
        axes: scanner.turn * Matrix3::from_diagonal(&spacing),
    })
}

/// Distance to the surface [mm] at each voxel, negative inside; exact where it is below [`DEEP`].
fn signed(bone: &TriMesh, grid: &Grid) -> Option<Vec<f32>> {
    let query = SurfaceQuery::new(bone)?;
    let from_mm = grid.index_from_mm()?;
    let mut touched = vec![false; grid.count()];
    for p in &bone.vertices {
        let index = from_mm * (p - grid.origin);
        let voxel = [0, 1, 2].map(|k| index[k].round().clamp(0.0, (grid.size[k] - 1) as f64) as usize);
        touched[grid.at(voxel)] = true;
    }
    let mut depth = distance_to(grid, |i| touched[i]);
    let row = grid.size[0];
    depth.par_chunks_mut(row).enumerate().for_each(|(r, values)| {
        let mut inside: Option<bool> = None;
        for (i, value) in values.iter_mut().enumerate() {
            let near = f64::from(*value) < DEEP + 1.5;
            if near || inside.is_none() {
                let p = grid.point(&Vector::from(grid.voxel(r * row + i).map(|x| x as f64)));
                let d = query.signed_distance(&p);
                inside = Some(d < 0.0);
                *value = d as f32;
            } else if inside == Some(true) {
                *value = -*value;
            }
        }
    });
    Some(depth)
}

type Waves = Vec<(Vector, f64)>;

/// Waves that sum to a field of standard deviation 1 and about the given grain [mm].
fn waves(rng: &mut ChaCha8Rng, grain: f64) -> Waves {
    let wave = |rng: &mut ChaCha8Rng| {
        (Vector::from_fn(|_, _| super::bone::normal_deviate(rng)) / grain, rng.random_range(0.0..std::f64::consts::TAU))
    };
    (0..12).map(|_| wave(rng)).collect()
}

fn sum(waves: &Waves, p: &Point) -> f64 {
    let total: f64 = waves.iter().map(|(k, phase)| (k.dot(&p.coords) + phase).cos()).sum();
    total * (2.0 / waves.len() as f64).sqrt()
}

struct Matter {
    joint: Point,
    mixing: f64,
    flesh: f64,
    grain: Waves,
    muscle: Waves,
}

impl Matter {
    /// Density where the nearest bone's surface is `d` away, negative inside [HU].
    fn density(&self, p: &Point, d: f64) -> f64 {
        let far = (((p - self.joint).norm() - 35.0) / 45.0).clamp(0.0, 1.0);
        let far = far * far * (3.0 - 2.0 * far);
        let (cortex, wall) = (1.0 + 3.0 * far, 900.0 + 500.0 * far);
        let step = |x: f64| 1.0 / (1.0 + (-1.702 * x / self.mixing).exp());
        let (within, beneath) = (step(-d), step(-d - cortex));
        let marrow = if beneath > 1e-6 { 280.0 - 320.0 * far + 60.0 * sum(&self.grain, p) } else { 0.0 };
        let flesh = if within < 1.0 - 1e-6 {
            let skin = step(d - self.flesh);
            (30.0 + 40.0 * sum(&self.muscle, p)) * (1.0 - skin) - 1000.0 * skin
        } else {
            0.0
        };
        flesh * (1.0 - within) + wall * (within - beneath) + marrow * beneath
    }
}
