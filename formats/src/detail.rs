//! A textured surface cut finer where its texture tells more than its corners can hold.

use super::texture::Paint;
use meshes::Point;
use meshes::surface::{ColouredMesh, TriMesh};
use std::collections::BTreeMap;

/// A triangle with the texture coordinates of its corners.
#[derive(Clone, Copy)]
pub(super) struct Patch<'a> {
    pub(super) corners: [u32; 3],
    pub(super) uv: [Option<[f64; 2]>; 3],
    pub(super) material: Option<usize>,
    pub(super) paint: Option<&'a Paint>,
}

/// Edges longer than this are halved [mm]: a drawn line is 1 mm wide or more.
const LONGEST: f64 = 0.8;
/// Edges across fewer texels than this hold nothing between their ends.
const FEWEST_TEXELS: f64 = 2.0;
/// Surfaces of more triangles are not cut finer, and no more than this many times.
const MOST_TRIANGLES: usize = 1_000_000;
const ROUNDS: usize = 6;

/// The surface with the colours of its paints, finer where their textures ask for it: at each vertex the mean over its seams; without
/// colours where no paint is there.
pub(super) fn painted(mut vertices: Vec<Point>, patches: Vec<Patch>) -> ColouredMesh {
    let patches = refined(&mut vertices, patches);
    let mut sums = vec![([0.0; 3], 0u32); vertices.len()];
    let corner = |i: usize, k: usize| {
        let p = &patches[i];
        (p.corners[k], p.material, p.uv[k].map(|uv| uv.map(f64::to_bits)), i)
    };
    let mut corners: Vec<_> = (0..patches.len()).flat_map(|i| [0, 1, 2].map(|k| corner(i, k))).collect();
    corners.sort_unstable();
    corners.dedup_by_key(|c| (c.0, c.1, c.2));
    for (vertex, _, uv, patch) in corners {
        let Some(colour) = patches[patch].paint.and_then(|p| p.at(uv.map(|uv| uv.map(f64::from_bits)))) else {
            continue;
        };
        let (sum, count) = &mut sums[vertex as usize];
        (0..3).for_each(|k| sum[k] += colour[k]);
        *count += 1;
    }
    let mesh = TriMesh { vertices, triangles: patches.iter().map(|p| p.corners).collect() };
    if sums.iter().all(|&(_, count)| count == 0) {
        return ColouredMesh { mesh, colours: Vec::new() };
    }
    let mean = |(sum, count): ([f64; 3], u32)| sum.map(|x| (x / f64::from(count.max(1))).round() as u8);
    ColouredMesh { mesh, colours: sums.into_iter().map(mean).collect() }
}

/// Halves edges, wherever two triangles share one in both, until the colours at the corners tell what the texture does. The
/// shape stays: new points lie on old edges.
fn refined<'a>(positions: &mut Vec<Point>, mut patches: Vec<Patch<'a>>) -> Vec<Patch<'a>> {
    for _ in 0..ROUNDS {
        if patches.len() > MOST_TRIANGLES {
            break;
        }
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for patch in &patches {
            for k in 0..3 {
                if long(positions, patch, k) && patch.texels(k) > FEWEST_TEXELS {
                    middles.insert(patch.edge(k), 0);
                }
            }
        }
        if middles.is_empty() || positions.len() + middles.len() > u32::MAX as usize {
            break;
        }
        for (&(a, b), middle) in &mut middles {
            *middle = positions.len() as u32;
            let (p, q) = (positions[a as usize], positions[b as usize]);
            positions.push(Point::from(p.coords.zip_map(&q.coords, f64::midpoint)));
        }
        let mut halved = Vec::with_capacity(2 * patches.len());
        patches.into_iter().for_each(|patch| halve(patch, positions, &middles, &mut halved));
        patches = halved;
    }
    patches
}

fn length(positions: &[Point], (a, b): (u32, u32)) -> f64 {
    (positions[a as usize] - positions[b as usize]).norm()
}

fn long(positions: &[Point], patch: &Patch, k: usize) -> bool {
    length(positions, patch.edge(k)) > LONGEST
}

/// Cuts at the longest edge that has a middle, and the halves again; at most three cuts, as halves of edges have none.
fn halve<'a>(patch: Patch<'a>, positions: &[Point], middles: &BTreeMap<(u32, u32), u32>, into: &mut Vec<Patch<'a>>) {
    let cut = (0..3).filter(|&k| middles.contains_key(&patch.edge(k)));
    let longest = cut.max_by(|&j, &k| length(positions, patch.edge(j)).total_cmp(&length(positions, patch.edge(k))));
    let Some((k, &middle)) = longest.and_then(|k| Some((k, middles.get(&patch.edge(k))?))) else {
        into.push(patch);
        return;
    };
    let next = (k + 1) % 3;
    let uv = patch.uv[k].zip(patch.uv[next]).map(|(a, b)| [f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1])]);
    for replaced in [next, k] {
        let mut half = patch;
        half.corners[replaced] = middle;
        half.uv[replaced] = uv;
        halve(half, positions, middles, into);
    }
}

impl Patch<'_> {
    fn edge(&self, k: usize) -> (u32, u32) {
        let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
        (a.min(b), a.max(b))
    }

    fn texels(&self, k: usize) -> f64 {
        let span = self.paint.zip(self.uv[k].zip(self.uv[(k + 1) % 3]));
        span.map_or(0.0, |(paint, (a, b))| paint.texels(a, b))
    }
}
