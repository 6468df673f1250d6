//! Turns whose every bit is the same on every machine.
//!
//! A system's own sine and cosine may differ from another's in the last bit. Along a path with friction that grows to hundredths of a newton. So the
//! turns of a pose are computed by the same code everywhere: in a browser, too.

use meshes::Vector;
use nalgebra::{Matrix3, Rotation3};

/// Steps of [`nearest_rotation`] at most; frames are orthonormal to 1e-3, and each step squares what is left.
const STEPS: usize = 10;
/// The rotation has been found where a step moves it by less [-].
const CLOSE: f64 = 1e-15;

/// Turn by `angle` [rad] about a unit `axis`, by Rodrigues' formula.
pub(crate) fn turn(axis: &Vector, angle: f64) -> Rotation3<f64> {
    let (sin, cos) = libm::sincos(angle);
    let (x, y, z, rest) = (axis.x, axis.y, axis.z, 1.0 - cos);
    Rotation3::from_matrix_unchecked(Matrix3::new(
        x * x + (1.0 - x * x) * cos,
        x * y * rest - z * sin,
        x * z * rest + y * sin,
        x * y * rest + z * sin,
        y * y + (1.0 - y * y) * cos,
        y * z * rest - x * sin,
        x * z * rest - y * sin,
        y * z * rest + x * sin,
        z * z + (1.0 - z * z) * cos,
    ))
}

/// The rotation nearest to a matrix that is almost one: its polar part, by Newton's method [higham1986].
pub(crate) fn nearest_rotation(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    let mut r = *matrix;
    for _ in 0..STEPS {
        let Some(inverse) = r.try_inverse() else { break };
        let next = (r + inverse.transpose()) * 0.5;
        let moved = (next - r).amax();
        r = next;
        if moved < CLOSE {
            break;
        }
    }
    Rotation3::from_matrix_unchecked(r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Unit;

    #[test]
    fn a_turn_is_the_one_about_its_axis() {
        let axis = Vector::new(0.3, -0.5, 0.8).normalize();
        for angle in [-3.0, -0.7, 0.0, 1e-9, 0.4, 2.0] {
            let other = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), angle);
            assert!((turn(&axis, angle).matrix() - other.matrix()).amax() < 1e-15, "{angle}");
        }
    }

    #[test]
    fn the_nearest_rotation_of_a_rotation_is_itself_and_of_what_is_almost_one_a_rotation() {
        let r = *turn(&Vector::new(0.6, 0.0, 0.8), 0.9).matrix();
        assert!((nearest_rotation(&r).matrix() - r).amax() < 1e-15);
        let off = Matrix3::new(1e-3, -4e-4, 2e-4, 7e-4, 1e-4, -9e-4, 3e-4, 5e-4, -6e-4);
        let found = *nearest_rotation(&(r + off)).matrix();
        assert!((found.transpose() * found - Matrix3::identity()).amax() < 1e-14 && (found - r).amax() < 2e-3);
        assert!(found.determinant() > 0.0);
    }
}
