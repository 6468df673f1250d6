//! Systems of equal springs in a row, each node held by blocks of its own: block-tridiagonal, solved by elimination from the first node on.

use meshes::Vector;
use nalgebra::{Matrix3, Matrix3x6};

/// An eliminated system. Its rows are `(2 + K_i) x_i - x_(i-1) - x_(i+1)`.
pub(super) struct Chain {
    /// Inverse of each pivot.
    inverse: Vec<Matrix3<f64>>,
}

impl Chain {
    /// Eliminates the system whose node `i` has the block `held(i)` beside its springs; `None` where it is not positive definite.
    pub(super) fn new(nodes: usize, held: impl Fn(usize) -> Option<Matrix3<f64>>) -> Option<Chain> {
        let mut inverse: Vec<Matrix3<f64>> = Vec::with_capacity(nodes);
        // what precedes the first block is a multiple of the identity
        let mut plain = true;
        for i in 0..nodes {
            let block = held(i);
            plain &= block.is_none();
            if plain {
                inverse.push(Matrix3::from_diagonal_element((i + 1) as f64 / (i + 2) as f64));
                continue;
            }
            let mut pivot = block.unwrap_or_else(Matrix3::zeros);
            (0..3).for_each(|a| pivot[(a, a)] += 2.0);
            if let Some(last) = inverse.last() {
                pivot -= last;
            }
            inverse.push(inverted(&pivot)?);
        }
        Some(Chain { inverse })
    }

    /// Solves for six right-hand sides, a column each.
    pub(super) fn solved(&self, right: &[Matrix3x6<f64>]) -> Vec<Matrix3x6<f64>> {
        let mut x = right.to_vec();
        // nothing is carried on before the first that is not zero
        let first = right.iter().position(|r| r.iter().any(|v| *v != 0.0)).unwrap_or(right.len());
        for i in first + 1..x.len() {
            let carried = self.inverse[i - 1] * x[i - 1];
            x[i] += carried;
        }
        let mut after = Matrix3x6::zeros();
        // nor is anything asked of those before it
        for i in (first..x.len()).rev() {
            after = self.inverse[i] * (x[i] + after);
            x[i] = after;
        }
        x
    }

    /// Solves for one right-hand side, in place.
    pub(super) fn solve(&self, x: &mut [Vector]) {
        for i in 1..x.len() {
            let carried = self.inverse[i - 1] * x[i - 1];
            x[i] += carried;
        }
        for i in (0..x.len()).rev() {
            let after = x.get(i + 1).copied().unwrap_or_default();
            x[i] = self.inverse[i] * (x[i] + after);
        }
    }
}

/// Inverse of a symmetric matrix that is positive definite, else nothing.
fn inverted(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (a, b, c) = (m[(0, 0)], m[(0, 1)], m[(0, 2)]);
    let (d, e, f) = (m[(1, 1)], m[(1, 2)], m[(2, 2)]);
    let (xx, xy, xz) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let minor = a * d - b * b;
    let determinant = a * xx + b * xy + c * xz;
    if !(a > 0.0 && minor > 0.0 && determinant > 1e-9) {
        return None;
    }
    let (yy, yz) = (a * f - c * c, b * c - a * e);
    Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, minor) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solved_system_gives_its_right_hand_side_back() {
        let n = Vector::new(0.6, 0.0, 0.8);
        let held = |i: usize| (i == 2 || i == 3).then(|| n * n.transpose() * 40.0);
        let right: Vec<Vector> = (0..6).map(|i| Vector::new(f64::from(i), 1.0, -2.0)).collect();
        let mut x = right.clone();
        Chain::new(6, held).unwrap().solve(&mut x);
        for i in 0..6 {
            let at = |k: Option<usize>| k.and_then(|k| x.get(k)).copied().unwrap_or_default();
            let own = x[i] * 2.0 + held(i).unwrap_or_else(Matrix3::zeros) * x[i];
            let back = own - at(i.checked_sub(1)) - at(Some(i + 1));
            assert!((back - right[i]).norm() < 1e-12, "{i}: {back:?}");
        }
    }

    #[test]
    fn a_system_that_has_no_least_point_is_refused() {
        assert!(Chain::new(4, |_| Some(Matrix3::from_diagonal_element(-1.5))).is_none());
    }
}
