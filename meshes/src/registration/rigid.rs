//! Least-squares rigid motions: from point pairs, and from linearised point-to-plane equations.

use crate::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector6};

/// The rigid motion that takes the first of each pair nearest to the second in the mean square, never a mirroring
/// [arun1987, umeyama1991]; `None` for fewer than three pairs or pairs on a line.
pub fn from_pairs(pairs: &[(Point, Point)]) -> Option<Isometry> {
    if pairs.len() < 3 {
        return None;
    }
    let n = pairs.len() as f64;
    let from: Vector = pairs.iter().map(|(p, _)| p.coords).sum::<Vector>() / n;
    let to: Vector = pairs.iter().map(|(_, q)| q.coords).sum::<Vector>() / n;
    let spread: Matrix3<f64> = pairs.iter().map(|(p, q)| (q.coords - to) * (p.coords - from).transpose()).sum();
    let svd = spread.try_svd(true, true, f64::EPSILON, 200)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
    if svd.singular_values[order[1]] <= 1e-9 * svd.singular_values[order[0]].max(f64::MIN_POSITIVE) {
        return None;
    }
    let mut turn = Matrix3::identity();
    if (u * v_t).determinant() < 0.0 {
        turn[(order[2], order[2])] = -1.0;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * turn * v_t));
    let translation = to - rotation * from;
    Some(Isometry::from_parts(Translation3::from(translation), rotation))
}

/// Normal equations of point-to-plane residuals about a centre, in (translation, rotation) [mm, rad] [chen1992].
#[derive(Clone, Debug)]
pub struct PlaneEquations {
    /// The point about which the rotation turns [mm].
    pub centre: Point,
    /// Information matrix, 6 x 6.
    pub matrix: Matrix6<f64>,
    /// Right-hand side.
    pub rhs: Vector6<f64>,
}

/// The row of the point-to-plane equation of a point with unit normal `n`: (n, (p - centre) x n).
pub fn plane_row(p: &Point, n: &Vector, centre: &Point) -> Vector6<f64> {
    let torque = (p - centre).cross(n);
    Vector6::new(n.x, n.y, n.z, torque.x, torque.y, torque.z)
}

impl PlaneEquations {
    /// No equation yet.
    pub fn about(centre: Point) -> PlaneEquations {
        PlaneEquations { centre, matrix: Matrix6::zeros(), rhs: Vector6::zeros() }
    }

    /// Adds the equation that `p` should move along unit `n` by `-residual` [mm].
    pub fn add(&mut self, p: &Point, n: &Vector, residual: f64, weight: f64) {
        let row = plane_row(p, n, &self.centre);
        self.matrix += weight * row * row.transpose();
        self.rhs -= weight * residual * row;
    }

    /// The motion that solves the equations; `None` where the geometry leaves a direction free.
    pub fn solve(&self) -> Option<Isometry> {
        let x = self.matrix.cholesky()?.solve(&self.rhs);
        x.iter().all(|v| v.is_finite()).then(|| small_motion(&x, &self.centre))
    }
}

/// The motion of a (translation, rotation) vector about `centre`.
pub fn small_motion(x: &Vector6<f64>, centre: &Point) -> Isometry {
    let rotation = UnitQuaternion::from_scaled_axis(Vector::new(x[3], x[4], x[5]));
    let shift = Vector::new(x[0], x[1], x[2]) + centre.coords - rotation * centre.coords;
    Isometry::from_parts(Translation3::from(shift), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_give_back_the_motion_and_never_a_mirror() {
        let motion = Isometry::new(Vector::new(3.0, -2.0, 9.0), Vector::new(0.4, 2.0, -1.0));
        let points =
            [Point::new(1.0, 2.0, 3.0), Point::new(40.0, 1.0, 0.0), Point::new(5.0, 30.0, 8.0), Point::origin()];
        let pairs: Vec<_> = points.iter().map(|p| (*p, motion * p)).collect();
        let found = from_pairs(&pairs).unwrap();
        assert!(pairs.iter().all(|(p, q)| (found * p - q).norm() < 1e-10));
        let mirrored: Vec<_> = points.iter().map(|p| (*p, Point::new(-p.x, p.y, p.z))).collect();
        assert!(
            (from_pairs(&mirrored).unwrap().rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-9
        );
    }

    #[test]
    fn too_few_or_collinear_pairs_give_none() {
        let line: Vec<_> = (0..5).map(|i| Point::new(f64::from(i), 0.0, 0.0)).map(|p| (p, p)).collect();
        assert!(from_pairs(&line).is_none());
        assert!(from_pairs(&line[..2]).is_none());
    }
}
