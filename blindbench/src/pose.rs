//! The tibia in the femur's frame, from flexion and five components along the joint's axes [grood1983].

use nalgebra::{Matrix3, Rotation3, Vector3};

/// VV, IE [rad], ML, AP, SI [mm]: components along the axes, clinical signs.
pub(crate) type Five = [f64; 5];

/// Rotation and origin of the tibia's frame (medial, anterior, superior) in the femur's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub(crate) turn: Matrix3<f64>,
    pub(crate) origin: Vector3<f64>,
}

pub(crate) fn about(axis: Vector3<f64>, angle: f64) -> Matrix3<f64> {
    Rotation3::new(axis * angle).into_inner()
}

/// The pose of components at a flexion [rad].
pub(crate) fn pose(flexion: f64, c: &Five) -> Pose {
    let turn = about(Vector3::x(), -flexion) * about(Vector3::y(), c[0]) * about(Vector3::z(), c[1]);
    let floating = Vector3::new(0.0, flexion.cos(), -flexion.sin());
    Pose { turn, origin: Vector3::x() * -c[2] + floating * c[3] + turn.column(2) * c[4] }
}

/// What a laboratory reads of a pose: FE, VV, IE [rad], then ML, AP, SI as projections [mm].
pub(crate) fn read(p: &Pose) -> [f64; 6] {
    let (r, t) = (&p.turn, &p.origin);
    let fe = r[(1, 2)].atan2(r[(2, 2)]);
    [
        fe,
        r[(0, 2)].clamp(-1.0, 1.0).asin(),
        (-r[(0, 1)]).atan2(r[(0, 0)]),
        -t.x,
        t.y * fe.cos() - t.z * fe.sin(),
        r.column(2).dot(t),
    ]
}

/// Components of a reading: the way back for a start.
pub(crate) fn components(reading: &[f64; 6]) -> Five {
    let [_, vv, ie, ml, ap, si] = *reading;
    // projections on ML and SI mix by the sine of VV
    let (s, c2) = (vv.sin(), vv.cos().powi(2));
    let along = (si + s * ml) / c2;
    [vv, ie, ml + s * along, ap, along]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_and_reading_are_each_others_inverse() {
        let reading = [0.9, 0.06, -0.2, 1.2, 8.0, -21.0];
        let back = read(&pose(reading[0], &components(&reading)));
        for (a, b) in reading.iter().zip(&back) {
            assert!((a - b).abs() < 1e-9, "{reading:?} {back:?}");
        }
    }
}
