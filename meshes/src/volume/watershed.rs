//! Bodies that hang together by a neck, parted at it.

use super::Grid;
use super::components::neighbours;

/// When a neck parts two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeckOptions {
    /// Widest neck that parts, over the half thickness of the thinner body [-].
    pub neck_share: f64,
    /// A body smaller than this is part of its neighbour, however thin the neck [voxels].
    pub least_voxels: usize,
}

/// The body of each voxel, counted from 1; 0 where `height` is not positive.
///
/// A watershed of the distance `height` inside the set [meyer1994]: voxels are taken from the thickest to the thinnest; where two bodies
/// meet they become one unless the meeting place is a neck, thinner than `neck_share` of the thinner body. Voxels of
/// the same `seed` (0: none) become one body in the end, of different seeds never do.
/// Bodies are numbered by their seed first, then by their thickest voxel. Deterministic.
pub fn part_at_necks(grid: &Grid, height: &[f32], seed: impl Fn(usize) -> u8, options: &NeckOptions) -> Vec<u32> {
    let mut order: Vec<(u32, u32)> =
        (0..grid.count()).filter(|&i| height[i] > 0.0).map(|i| (u32::MAX - height[i].to_bits(), i as u32)).collect();
    order.sort_unstable();
    let mut bodies = Bodies { parent: vec![0], of: vec![Body::default()] };
    let mut body = vec![0u32; grid.count()];
    // Bodies that a voxel touches, each with the thickness at its thickest neighbour of that body.
    let mut meeting: Vec<(f32, u32)> = Vec::with_capacity(6);
    for &(_, at) in &order {
        let at = at as usize;
        meeting.clear();
        for next in neighbours(grid, at) {
            if body[next] != 0 {
                let root = bodies.root(body[next]);
                match meeting.iter_mut().find(|m| m.1 == root) {
                    Some(known) => known.0 = known.0.max(height[next]),
                    None => meeting.push((height[next], root)),
                }
            }
        }
        // The way up: else a body would creep over the skin of another that it touches, where all is equally thin.
        meeting.sort_by_key(|&(up, b)| (std::cmp::Reverse((up.to_bits(), bodies.of[b as usize].peak.to_bits())), b));
        let own = seed(at);
        let mut home =
            match meeting.iter().map(|m| m.1).find(|&b| own == 0 || [0, own].contains(&bodies.of[b as usize].seed)) {
                Some(b) => b,
                None => bodies.add(height[at]),
            };
        body[at] = home;
        bodies.of[home as usize].voxels += 1;
        if own != 0 {
            bodies.of[home as usize].seed = own;
        }
        for &(_, other) in &meeting {
            if other != home && bodies.are_one(home, other, height[at], options) {
                home = bodies.join(home, other);
            }
        }
    }
    bodies.numbered(&body)
}

#[derive(Clone, Copy, Default)]
struct Body {
    peak: f32,
    voxels: usize,
    seed: u8,
}

struct Bodies {
    parent: Vec<u32>,
    of: Vec<Body>,
}

impl Bodies {
    fn add(&mut self, peak: f32) -> u32 {
        self.parent.push(self.parent.len() as u32);
        self.of.push(Body { peak, voxels: 0, seed: 0 });
        (self.parent.len() - 1) as u32
    }

    fn root(&mut self, mut b: u32) -> u32 {
        while self.parent[b as usize] != b {
            let up = self.parent[self.parent[b as usize] as usize];
            self.parent[b as usize] = up;
            b = up;
        }
        b
    }

    fn are_one(&self, a: u32, b: u32, neck: f32, options: &NeckOptions) -> bool {
        let (a, b) = (self.of[a as usize], self.of[b as usize]);
        if a.seed != 0 && b.seed != 0 {
            return a.seed == b.seed;
        }
        let small = a.voxels.min(b.voxels) < options.least_voxels;
        small || f64::from(neck) >= options.neck_share * f64::from(a.peak.min(b.peak))
    }

    fn join(&mut self, a: u32, b: u32) -> u32 {
        let (peak_a, peak_b) = (self.of[a as usize].peak, self.of[b as usize].peak);
        let (keep, gone) = if (peak_a, b) >= (peak_b, a) { (a, b) } else { (b, a) };
        let from = self.of[gone as usize];
        self.parent[gone as usize] = keep;
        let into = &mut self.of[keep as usize];
        into.voxels += from.voxels;
        into.seed = into.seed.max(from.seed);
        keep
    }

    fn numbered(&mut self, body: &[u32]) -> Vec<u32> {
        let roots: Vec<u32> = (0..self.parent.len() as u32).map(|b| self.root(b)).collect();
        let mut alive: Vec<u32> = (1..self.parent.len() as u32).filter(|&b| roots[b as usize] == b).collect();
        alive.sort_by_key(|&b| {
            let seed = self.of[b as usize].seed;
            (seed == 0, seed, b)
        });
        let mut number = vec![0; self.parent.len()];
        let (mut count, mut last) = (0, 0);
        for &b in &alive {
            let seed = self.of[b as usize].seed;
            if seed == 0 || seed != last {
                count += 1;
            }
            last = seed;
            number[b as usize] = count;
        }
        body.iter().map(|&b| number[roots[b as usize] as usize]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::distance::distance_to;
    use crate::{Point, Vector};
    use nalgebra::Matrix3;

    fn dumbbell(radius: f64, neck: f64) -> (Grid, Vec<f32>) {
        let grid = Grid { size: [60, 30, 30], origin: Point::origin(), axes: Matrix3::identity() };
        let inside = |i: usize| {
            let p = grid.point(&Vector::from(grid.voxel(i).map(|x| x as f64)));
            let ball = |x: f64| (p - Point::new(x, 15.0, 15.0)).norm() < radius;
            ball(16.0) || ball(44.0) || ((16.0..44.0).contains(&p.x) && (p.y - 15.0).hypot(p.z - 15.0) < neck)
        };
        let height = distance_to(&grid, |i| !inside(i));
        (grid, height)
    }

    #[test]
    fn a_thin_neck_parts_and_a_thick_one_does_not() {
        let options = NeckOptions { neck_share: 0.5, least_voxels: 100 };
        let (grid, height) = dumbbell(12.0, 2.5);
        let parted = part_at_necks(&grid, &height, |_| 0, &options);
        assert_eq!(parted.iter().max(), Some(&2));
        assert_ne!(parted[grid.at([16, 15, 15])], parted[grid.at([44, 15, 15])]);
        let (grid, height) = dumbbell(12.0, 8.0);
        let one = part_at_necks(&grid, &height, |_| 0, &options);
        assert_eq!(one.iter().max(), Some(&1));
        // Seeds part even that, and are numbered in their order.
        let (a, b) = (grid.at([16, 15, 15]), grid.at([44, 15, 15]));
        let seeded = part_at_necks(&grid, &height, |i| if i == a { 7 } else { u8::from(i == b) * 3 }, &options);
        assert_eq!((seeded[b], seeded[a], seeded.iter().max()), (1, 2, Some(&2)));
    }
}
