//! Internal forces, four elements at a time.

use super::element::Element;
use super::law::{Law, Material, cofactor_row, determinant, stress};
use super::wide::{LANES, Wide, Wide3};

/// Four elements of one solid. Missing ones repeat the last and are not gathered.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Nodes, by corner and lane.
    pub(super) nodes: [[u32; LANES]; 8],
    /// The first element's number within its solid, and how many are real.
    pub(super) first: u32,
    pub(super) count: u32,
    /// The solid.
    pub(super) solid: u32,
    law: Law,
    gradient: [Wide3; 8],
    /// `warp / 8` [mm].
    warp: [Wide3; 4],
    volume: Wide,
    lambda: Wide,
    mu: Wide,
    /// Hourglass stiffness [N/mm] and viscosity [N s/mm].
    stiffness: Wide,
    viscosity: Wide,
}

/// Forces on the nodes, by corner, axis and lane.
pub(super) type BlockForces = [f64; 8 * 3 * LANES];

/// What a block tells besides its forces.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockState {
    /// Least ratio of volumes [-]; NaN where a place is.
    pub(super) least: f64,
    /// Energy of the hourglass modes [N mm] and power of their viscosity [N mm/s].
    pub(super) hourglass: f64,
    pub(super) viscous: f64,
}

impl Block {
    /// Up to four elements: their nodes and reference values; `stiffness`, `viscosity` are the options'.
    pub(super) fn new(
        elements: &[([u32; 8], Element)],
        (solid, first): (u32, u32),
        material: &Material,
        (stiffness, viscosity): (f64, f64),
    ) -> Block {
        let lane = |k: usize| &elements[k.min(elements.len() - 1)];
        let wide = |f: &dyn Fn(&Element) -> f64| Wide(std::array::from_fn(|k| f(&lane(k).1)));
        let m = material.confined();
        let rate = material.density_tonne_mm3 * material.wave_speed();
        Block {
            nodes: std::array::from_fn(|c| std::array::from_fn(|k| lane(k).0[c])),
            first,
            count: elements.len() as u32,
            solid,
            law: material.law,
            gradient: std::array::from_fn(|c| std::array::from_fn(|a| wide(&|e| e.gradient[c][a]))),
            warp: std::array::from_fn(|h| std::array::from_fn(|a| wide(&|e| e.warp[h][a] / 8.0))),
            volume: wide(&|e| e.volume),
            lambda: Wide::of(material.lambda()),
            mu: Wide::of(material.mu()),
            stiffness: wide(&|e| 4.0 * stiffness * m * e.volume * e.squares()),
            viscosity: wide(&|e| viscosity * rate * e.volume.powf(2.0 / 3.0)),
        }
    }

    #[inline(always)]
    fn gather(&self, at: &[[f64; 3]]) -> [Wide3; 8] {
        std::array::from_fn(|c| {
            let places = self.nodes[c].map(|n| &at[n as usize]);
            std::array::from_fn(|a| Wide([places[0][a], places[1][a], places[2][a], places[3][a]]))
        })
    }

    /// Deformation gradients with nodes at `x`, rows.
    #[inline(always)]
    pub(super) fn deformation(&self, x: &[Wide3; 8]) -> [Wide3; 3] {
        let mut f = [[Wide::ZERO; 3]; 3];
        for (place, g) in x.iter().zip(&self.gradient) {
            for i in 0..3 {
                for j in 0..3 {
                    f[i][j] += place[i] * g[j];
                }
            }
        }
        f
    }

    /// Cauchy stress (xx, xy, xz, yy, yz, zz) and ratio of volumes of each element.
    pub(super) fn stress(&self, at: &[[f64; 3]]) -> ([Wide; 6], Wide) {
        let f = self.deformation(&self.gather(at));
        (stress(self.law, self.lambda, self.mu, &f), determinant(&f))
    }

    /// Deformation gradients, rows.
    pub(super) fn gradients(&self, at: &[[f64; 3]]) -> [Wide3; 3] {
        self.deformation(&self.gather(at))
    }

    /// Volumes [mm3].
    pub(super) fn volumes(&self) -> &[f64; LANES] {
        &self.volume.0
    }

    /// Internal forces: what holds the nodes back from where they are.
    #[inline]
    pub(super) fn forces(&self, at: &[[f64; 3]], rates: &[[f64; 3]], out: &mut BlockForces) -> BlockState {
        let x = self.gather(at);
        let f = self.deformation(&x);
        let s = stress(self.law, self.lambda, self.mu, &f);
        let c = [cofactor_row(&f, 0), cofactor_row(&f, 1), cofactor_row(&f, 2)];
        let ratio = f[0][0] * c[0][0] + f[0][1] * c[0][1] + f[0][2] * c[0][2];
        let rows = [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]];
        let viscous = self.viscosity.0[0] > 0.0;
        let v = if viscous { self.gather(rates) } else { [[Wide::ZERO; 3]; 8] };
        let turn = if viscous { self.deformation(&v) } else { [[Wide::ZERO; 3]; 3] };
        let (mut energy, mut power) = (Wide::ZERO, Wide::ZERO);
        for i in 0..3 {
            // first Piola-Kirchhoff stress times volume
            let piola = |j: usize| (rows[i][0] * c[0][j] + rows[i][1] * c[1][j] + rows[i][2] * c[2][j]) * self.volume;
            let mut p = [piola(0), piola(1), piola(2)];
            let modes = self.modes(&std::array::from_fn(|n| x[n][i]), &f[i]);
            let mut push = modes.map(|q| self.stiffness * q);
            for k in 0..4 {
                energy += push[k] * modes[k] * 0.5;
            }
            if viscous {
                let rates = self.modes(&std::array::from_fn(|n| v[n][i]), &turn[i]);
                for k in 0..4 {
                    push[k] += self.viscosity * rates[k];
                    power += self.viscosity * rates[k] * rates[k];
                }
            }
            for (k, push) in push.iter().enumerate() {
                for (p, warp) in p.iter_mut().zip(&self.warp[k]) {
                    *p = *p - *push * *warp;
                }
            }
            let warp = spread(&push.map(|q| q * 0.125));
            for (n, g) in self.gradient.iter().enumerate() {
                let force = p[0] * g[0] + p[1] * g[1] + p[2] * g[2] + warp[n];
                out[(n * 3 + i) * LANES..(n * 3 + i + 1) * LANES].copy_from_slice(&force.0);
            }
        }
        // lanes beyond the count repeat the last element
        let sum = |w: &Wide| w.0[..self.count as usize].iter().sum();
        let least = ratio.0.iter().copied().fold(f64::INFINITY, |m, x| if x < m || x.is_nan() { x } else { m });
        BlockState { least, hourglass: sum(&energy), viscous: sum(&power) }
    }

    /// Amplitudes of the four hourglass modes of one coordinate: blind to linear fields.
    #[inline(always)]
    fn modes(&self, u: &[Wide; 8], gradient: &Wide3) -> [Wide; 4] {
        let mut modes = sums(u);
        for (mode, warp) in modes.iter_mut().zip(&self.warp) {
            *mode = *mode * 0.125 - (gradient[0] * warp[0] + gradient[1] * warp[1] + gradient[2] * warp[2]);
        }
        modes
    }
}

/// Sums of the nodes' values with the signs of the four hourglass vectors.
#[inline(always)]
fn sums(u: &[Wide; 8]) -> [Wide; 4] {
    let d: [Wide; 4] = std::array::from_fn(|k| u[k + 4] - u[k]);
    let s: [Wide; 4] = std::array::from_fn(|k| u[k + 4] + u[k]);
    let (front, back) = (d[0] - d[2], d[1] - d[3]);
    [-(front + back), back - front, (s[0] - s[1]) + (s[2] - s[3]), (d[0] - d[1]) + (d[2] - d[3])]
}

/// The hourglass vectors times their amplitudes, at each node.
#[inline(always)]
fn spread(q: &[Wide; 4]) -> [Wide; 8] {
    let (a, b) = (q[0] + q[1], q[0] - q[1]);
    let (c, d) = (q[2] - q[3], q[2] + q[3]);
    [a + c, b - c, c - a, -(b + c), d - a, -(b + d), a + d, b - d]
}

#[cfg(test)]
mod tests {
    use super::super::element::hourglass_signs;
    use super::*;

    #[test]
    fn sums_and_spread_use_the_hourglass_signs() {
        for n in 0..8 {
            let mut u = [Wide::ZERO; 8];
            u[n] = Wide::ONE;
            for (k, sign) in hourglass_signs(n).into_iter().enumerate() {
                assert_eq!(sums(&u)[k].0[0], sign, "node {n} mode {k}");
                let mut q = [Wide::ZERO; 4];
                q[k] = Wide::ONE;
                assert_eq!(spread(&q)[n].0[0], sign, "node {n} mode {k}");
            }
        }
    }
}
