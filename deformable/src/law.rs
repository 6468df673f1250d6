//! Stress from the deformation gradient.

use super::wide::{LANES, Wide, Wide3};
use nalgebra::{Matrix3, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// How stress follows from strain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// Linear between Cauchy stress and logarithmic strain: what a hypoelastic rate form (Abaqus/Explicit, C3D8R) gives where
    /// principal axes do not turn in the material, without its drift.
    Linear,
    /// Compressible neo-Hookean, energy `mu / 2 (I1 J^(-2/3) - 3) + K / 2 (J - 1)^2`.
    NeoHookean,
}

/// An isotropic material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// The law.
    pub law: Law,
    /// E [MPa].
    pub youngs_modulus_mpa: f64,
    /// nu [-].
    pub poissons_ratio: f64,
    /// Density [tonne/mm3].
    pub density_tonne_mm3: f64,
}

impl Material {
    /// Cartilage of the published decks: E 12 MPa, nu 0.45, 1.81e-8 tonne/mm3 [andreassen2025].
    pub fn cartilage() -> Material {
        Material { law: Law::Linear, youngs_modulus_mpa: 12.0, poissons_ratio: 0.45, density_tonne_mm3: 1.81e-8 }
    }

    /// First Lame constant [MPa].
    pub fn lambda(&self) -> f64 {
        let (e, nu) = (self.youngs_modulus_mpa, self.poissons_ratio);
        e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    }

    /// Shear modulus [MPa].
    pub fn mu(&self) -> f64 {
        self.youngs_modulus_mpa / (2.0 * (1.0 + self.poissons_ratio))
    }

    /// Modulus of confined compression [MPa].
    pub fn confined(&self) -> f64 {
        self.lambda() + 2.0 * self.mu()
    }

    /// Speed of dilatational waves [mm/s].
    pub fn wave_speed(&self) -> f64 {
        (self.confined() / self.density_tonne_mm3).sqrt()
    }
}

/// A symmetric matrix of each of four elements: xx, xy, xz, yy, yz, zz.
pub(super) type Symmetric = [Wide; 6];

/// Largest size of `(B - 1) / (B + 1)` up to which the logarithm is taken as a series.
const SERIES: f64 = 0.45;

/// Cauchy stress of four elements of one law with deformation gradient `f` (rows).
#[inline(always)]
pub(super) fn stress(law: Law, lambda: Wide, mu: Wide, f: &[Wide3; 3]) -> Symmetric {
    let b = left_cauchy_green(f);
    match law {
        Law::Linear => {
            let e = half_logarithm(&b);
            let p = lambda * (e[0] + e[3] + e[5]);
            let m = mu * 2.0;
            [m * e[0] + p, m * e[1], m * e[2], m * e[3] + p, m * e[4], m * e[5] + p]
        }
        Law::NeoHookean => {
            let j = determinant(f);
            let bulk = lambda + mu * (2.0 / 3.0);
            let factor = mu * j.map(|j| j.max(1e-9).powf(-5.0 / 3.0));
            let mean = (b[0] + b[3] + b[5]) * (1.0 / 3.0);
            let p = bulk * (j - Wide::ONE);
            let s = |x: Wide| factor * (x - mean) + p;
            [s(b[0]), factor * b[1], factor * b[2], s(b[3]), factor * b[4], s(b[5])]
        }
    }
}

/// Energy per reference volume [MPa] of the neo-Hookean law.
pub(super) fn neo_hookean_energy(lambda: f64, mu: f64, f: &Matrix3<f64>) -> f64 {
    let (j, bulk) = (f.determinant(), lambda + mu * 2.0 / 3.0);
    mu / 2.0 * ((f * f.transpose()).trace() * j.powf(-2.0 / 3.0) - 3.0) + bulk / 2.0 * (j - 1.0).powi(2)
}

#[inline(always)]
pub(super) fn determinant(f: &[Wide3; 3]) -> Wide {
    let c = cofactor_row(f, 0);
    f[0][0] * c[0] + f[0][1] * c[1] + f[0][2] * c[2]
}

/// Row `i` of the cofactor matrix `J F^-T`.
#[inline(always)]
pub(super) fn cofactor_row(f: &[Wide3; 3], i: usize) -> Wide3 {
    let (a, b) = (&f[(i + 1) % 3], &f[(i + 2) % 3]);
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn left_cauchy_green(f: &[Wide3; 3]) -> Symmetric {
    let dot = |i: usize, j: usize| f[i][0] * f[j][0] + f[i][1] * f[j][1] + f[i][2] * f[j][2];
    [dot(0, 0), dot(0, 1), dot(0, 2), dot(1, 1), dot(1, 2), dot(2, 2)]
}

/// Product of two symmetric matrices that commute.
#[inline(always)]
fn product(a: &Symmetric, b: &Symmetric) -> Symmetric {
    [
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
        a[0] * b[1] + a[1] * b[3] + a[2] * b[4],
        a[0] * b[2] + a[1] * b[4] + a[2] * b[5],
        a[1] * b[1] + a[3] * b[3] + a[4] * b[4],
        a[1] * b[2] + a[3] * b[4] + a[4] * b[5],
        a[2] * b[2] + a[4] * b[4] + a[5] * b[5],
    ]
}

/// `ln(B) / 2`, the logarithmic strain: `atanh(Y)` with `Y = (B - 1) / (B + 1)` as a series, by eigenvalues where strains are large.
#[inline(always)]
fn half_logarithm(b: &Symmetric) -> Symmetric {
    let one = Wide::ONE;
    let up = [b[0] + one, b[1], b[2], b[3] + one, b[4], b[5] + one];
    // inverse of B + 1
    let c00 = up[3] * up[5] - up[4] * up[4];
    let c01 = up[2] * up[4] - up[1] * up[5];
    let c02 = up[1] * up[4] - up[2] * up[3];
    let scale = (up[0] * c00 + up[1] * c01 + up[2] * c02).inverse();
    let inverse = [
        c00 * scale,
        c01 * scale,
        c02 * scale,
        (up[0] * up[5] - up[2] * up[2]) * scale,
        (up[1] * up[2] - up[0] * up[4]) * scale,
        (up[0] * up[3] - up[1] * up[1]) * scale,
    ];
    // (B - 1) / (B + 1) = 1 - 2 / (B + 1)
    let y = [
        one - inverse[0] * 2.0,
        inverse[1] * -2.0,
        inverse[2] * -2.0,
        one - inverse[3] * 2.0,
        inverse[4] * -2.0,
        one - inverse[5] * 2.0,
    ];
    let z = product(&y, &y);
    let size = (z[0] + z[3] + z[5]).largest();
    let large = size >= SERIES * SERIES;
    if large {
        return by_eigenvalues(b);
    }
    // what is left out is below 1e-12 of the strain
    let last = match size {
        s if s < 1e-4 => 7,
        s if s < 2.5e-3 => 9,
        s if s < 0.0225 => 15,
        _ => 31,
    };
    let unit = |x: f64| [Wide::of(x), Wide::ZERO, Wide::ZERO, Wide::of(x), Wide::ZERO, Wide::of(x)];
    let mut sum = unit(1.0 / f64::from(last));
    let mut n = last - 2;
    while n >= 1 {
        sum = product(&sum, &z);
        for k in [0, 3, 5] {
            sum[k] += Wide::of(1.0 / f64::from(n));
        }
        n -= 2;
    }
    product(&y, &sum)
}

#[cold]
fn by_eigenvalues(b: &Symmetric) -> Symmetric {
    let mut out = [Wide::ZERO; 6];
    for lane in 0..LANES {
        let m = |k: usize| b[k].0[lane];
        let matrix = Matrix3::new(m(0), m(1), m(2), m(1), m(3), m(4), m(2), m(4), m(5));
        let log = match matrix.iter().all(|x| x.is_finite()).then(|| SymmetricEigen::new(matrix)) {
            Some(eigen) => {
                let logs = eigen.eigenvalues.map(|x| 0.5 * x.max(1e-12).ln());
                eigen.eigenvectors * Matrix3::from_diagonal(&logs) * eigen.eigenvectors.transpose()
            }
            None => Matrix3::from_element(f64::NAN),
        };
        for (k, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            out[k].0[lane] = log[(i, j)];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wide(m: &Matrix3<f64>) -> [Wide3; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| Wide::of(m[(i, j)])))
    }

    #[test]
    fn the_series_is_the_logarithm() {
        for size in [1e-3, 0.03, 0.1, 0.25, 0.6] {
            let f = Matrix3::identity() + Matrix3::new(1.0, 0.4, -0.2, 0.3, -0.7, 0.5, -0.6, 0.2, 0.1) * size;
            let b = left_cauchy_green(&wide(&f));
            let (series, exact) = (half_logarithm(&b), by_eigenvalues(&b));
            for (s, e) in series.iter().zip(&exact) {
                assert!((s.0[0] - e.0[0]).abs() < 1e-12, "{size}: {} {}", s.0[0], e.0[0]);
            }
        }
    }

    #[test]
    fn neo_hookean_stress_is_the_gradient_of_its_energy() {
        let material = Material { law: Law::NeoHookean, ..Material::cartilage() };
        let (lambda, mu) = (material.lambda(), material.mu());
        let f = Matrix3::new(1.1, 0.05, -0.02, 0.03, 0.9, 0.04, -0.06, 0.02, 0.97);
        let s = stress(Law::NeoHookean, Wide::of(lambda), Wide::of(mu), &wide(&f));
        let place = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        for (i, row) in place.iter().enumerate() {
            for j in 0..3 {
                let piola: f64 = (0..3).map(|k| s[row[k]].0[0] * cofactor_row(&wide(&f), k)[j].0[0]).sum();
                let energy = |d: f64| {
                    let mut g = f;
                    g[(i, j)] += d;
                    neo_hookean_energy(lambda, mu, &g)
                };
                let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
                assert!((piola - slope).abs() < 1e-7, "{i} {j}: {piola} {slope}");
            }
        }
    }
}
