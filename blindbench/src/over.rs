//! Fibres that run over bone, and so are longer than straight.

use crate::frames::Frames;
use crate::pose::Pose;
use nalgebra::Vector3;

/// Where bone stands in a fibre's way, in that bone's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Over {
    /// 0: the femur; 1: the tibia.
    pub(crate) bone: usize,
    /// A point of its edge [mm].
    pub(crate) at: Vector3<f64>,
    /// The direction in which it pushes fibres out, of length 1.
    pub(crate) out: Vector3<f64>,
    /// The edge meets fibres at its height along this direction, of length 1; where it is zero, in their middle.
    pub(crate) along: Vector3<f64>,
}

impl Over {
    /// By how much the way over the edge is longer than the straight line between ends in the femur's and the tibia's frame [mm].
    pub(crate) fn longer(&self, p: &Pose, femur: &Vector3<f64>, tibia: &Vector3<f64>) -> f64 {
        let (a, b) = if self.bone == 0 {
            (*femur, p.turn * tibia + p.origin)
        } else {
            (p.turn.transpose() * (femur - p.origin), *tibia)
        };
        let crossing = crossing(&a, &b, &self.along, (self.at - b).dot(&self.along));
        let proud = (self.at - crossing).dot(&self.out);
        if proud <= 0.0 {
            return 0.0;
        }
        let over = crossing + self.out * proud;
        (a - over).norm() + (over - b).norm() - (a - b).norm()
    }

    /// The same edge in other frames.
    pub(crate) fn in_frames(&self, frames: &Frames) -> Over {
        let at = frames.point(self.bone, &self.at);
        let turned = |way: &Vector3<f64>| frames.point(self.bone, &(self.at + way)) - at;
        Over { at, out: turned(&self.out), along: turned(&self.along), ..*self }
    }
}

/// Where the line from `b` to `a` has risen by `height` along a direction [mm]; its middle where it does not rise.
pub(crate) fn crossing(a: &Vector3<f64>, b: &Vector3<f64>, along: &Vector3<f64>, height: f64) -> Vector3<f64> {
    let rise = (a - b).dot(along);
    let part = if rise.abs() > 1e-9 { (height / rise).clamp(0.1, 0.9) } else { 0.5 };
    b + (a - b) * part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::pose;

    /// Ends 60 mm apart along the long axis, and an edge that stands `proud` of their line, 20 mm above the lower end.
    fn longer(proud: f64) -> f64 {
        let p = pose(0.0, &[0.0; 5]);
        let at = Vector3::new(30.0 + proud, 7.0, -20.0);
        let over = Over { bone: 1, at, out: Vector3::x(), along: Vector3::z() };
        over.longer(&p, &Vector3::new(30.0, 0.0, 20.0), &Vector3::new(30.0, 0.0, -40.0))
    }

    #[test]
    fn a_fibre_is_longer_by_the_way_over_the_edge_and_straight_where_the_edge_stands_back() {
        let way = |h: f64| (40.0f64.hypot(h) + 20.0f64.hypot(h)) - 60.0;
        for h in [0.5, 4.0, 9.0] {
            assert!((longer(h) - way(h)).abs() < 1e-9, "{h}: {} against {}", longer(h), way(h));
        }
        assert_eq!((longer(0.0), longer(-3.0)), (0.0, 0.0));
    }
}
