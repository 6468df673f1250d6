//! Lengths of lines as functions of their ends, with first and second derivatives.

use meshes::Vector;
use nalgebra::Matrix3;

/// A length and its derivatives by the place of one end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Length {
    pub(super) value: f64,
    /// Unit vector along the line at that end, pointing away from it.
    pub(super) gradient: Vector,
    pub(super) hessian: Matrix3<f64>,
}

/// The straight line from `far` to `near`, by the place of `near`.
pub(super) fn straight(near: &Vector, far: &Vector) -> Length {
    let r = near - far;
    let value = r.norm().max(1e-9);
    let gradient = r / value;
    Length { value, gradient, hessian: (Matrix3::identity() - gradient * gradient.transpose()) / value }
}

/// A cylinder that lines wrap over on its front.
#[derive(Clone, Debug)]
pub(super) struct Cylinder {
    pub(super) point: Vector,
    /// Along the axis, across it to the front, across it upwards: unit vectors.
    pub(super) axes: [Vector; 3],
    pub(super) radius: f64,
}

impl Cylinder {
    /// The shortest line from `far` to `near` over the front, by the place of `near`: on the unrolled cylinder it is straight, so its length
    /// is the hypotenuse of its course across the axis and that along it.
    pub(super) fn over(&self, near: &Vector, far: &Vector) -> Length {
        let plane = |p: &Vector| {
            let r = p - self.point;
            let (x, y) = (r.dot(&self.axes[1]), r.dot(&self.axes[2]));
            (libm::hypot(x, y), libm::atan2(y, x))
        };
        let ((near_at, near_angle), (far_at, far_angle)) = (plane(near), plane(far));
        if near_at <= self.radius || far_at <= self.radius {
            // an end inside the cylinder: nothing to wrap over
            return straight(near, far);
        }
        let touch = near_angle + libm::acos(self.radius / near_at);
        let arc = far_angle - libm::acos(self.radius / far_at) - touch;
        if arc <= 0.0 {
            return straight(near, far);
        }
        let [axis, front, up] = self.axes;
        let free = (near_at * near_at - self.radius * self.radius).sqrt();
        let across = free + self.radius * arc + (far_at * far_at - self.radius * self.radius).sqrt();
        let along = (near - far).dot(&axis);
        let (sin, cos) = libm::sincos(touch);
        let (out, course) = (front * cos + up * sin, front * sin - up * cos);
        let value = libm::hypot(across, along);
        let gradient = (course * across + axis * along) / value;
        let bend = out * out.transpose() * (across / free);
        let hessian =
            (course * course.transpose() + bend + axis * axis.transpose() - gradient * gradient.transpose()) / value;
        Length { value, gradient, hessian }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder() -> Cylinder {
        let axis = Vector::new(0.9, 0.1, -0.2).normalize();
        let front = (Vector::y() - axis * axis.y).normalize();
        Cylinder { point: Vector::new(3.0, -2.0, 1.0), axes: [axis, front, axis.cross(&front)], radius: 21.0 }
    }

    #[test]
    fn derivatives_are_those_of_the_length_wrapped_or_not() {
        for (mirror, wrapped) in [(1.0, true), (-1.0, true), (1.0, false)] {
            let mut c = cylinder();
            c.axes[0] *= mirror;
            let far = c.point + c.axes[1] * 26.0 + c.axes[2] * 120.0 + c.axes[0] * 8.0;
            let (front, up) = if wrapped { (15.0, -28.0) } else { (34.0, 4.0) };
            let near = c.point + c.axes[1] * front + c.axes[2] * up - c.axes[0] * 4.0;
            let here = c.over(&near, &far);
            assert_eq!(here.value > straight(&near, &far).value + 0.1, wrapped);
            for k in 0..3 {
                let mut step = Vector::zeros();
                step[k] = 1e-4;
                let (up, down) = (c.over(&(near + step), &far), c.over(&(near - step), &far));
                assert!(((up.value - down.value) / 2e-4 - here.gradient[k]).abs() < 1e-7, "{mirror} {wrapped} {k}");
                let slope = (up.gradient - down.gradient) / 2e-4;
                assert!((slope - here.hessian.column(k)).amax() < 1e-7, "{mirror} {wrapped} {k}");
            }
        }
    }

    #[test]
    fn wrapping_begins_without_a_step() {
        let c = cylinder();
        let far = c.point + c.axes[1] * 26.0 + c.axes[2] * 120.0;
        let at = |angle: f64| c.over(&(c.point + (c.axes[1] * angle.cos() + c.axes[2] * angle.sin()) * 33.0), &far);
        for k in 0..2000 {
            let angle = 0.5 - 1e-3 * f64::from(k);
            let (a, b) = (at(angle), at(angle - 1e-3));
            assert!((a.value - b.value).abs() < 0.0331 && (a.gradient - b.gradient).norm() < 2e-2);
        }
    }
}
