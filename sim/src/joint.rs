//! The joint chain: three cylindrical joints between the fixed tibia and the moving femur [grood1983], in clinical signs.
//!
//! Coordinates `q` are clinical displacements from the CT pose: [`FE`], [`VV`], [`IE`] [rad], [`ML`], [`AP`], [`SI`] [mm],
//! equal for left and right: flexion, valgus, external, and the tibia lateral, anterior, superior of the femur are positive. A load is the
//! generalised force conjugate to its coordinate. Along the chain, from the tibia: IE, SI about and along the tibial axis; VV, AP about and
//! along the floating axis; FE, ML about and along the femoral axis. Grood-Suntay angles are the chain's angles plus the CT pose's;
//! Grood-Suntay translations are projections on the axes, the chain's are components along them.

use crate::coordinate::{AP, Coordinate, FE, IE, ML, SI, Six, VV};
use crate::deck::ChainCoordinate;
use crate::error::SimError;
use crate::portable;
use crate::spec::{AxisSpec, ChainSpec, FramesSpec};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Matrix6, Translation3, UnitQuaternion};

/// Place of each coordinate along the chain, counted from the tibia.
const RANK: [usize; 6] = [4, 2, 0, 5, 3, 1];

/// The chain in the CT pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Tibial, floating and femoral axis, turned superior, posterior and lateral.
    axes: [AxisSpec; 3],
    /// Clinical coordinate to turn about, or shift along, its axis.
    sign: [f64; 6],
    femur: AnatomicalFrame,
    tibia: AnatomicalFrame,
    ct: Six,
}

/// The chain at one pose.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// CT coordinates of the femur's points from their CT coordinates in the CT pose.
    pub femur: Isometry,
    /// Velocity field of the femur for each coordinate.
    pub screws: [Screw; 6],
}

/// A velocity field `angular x p + linear`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Screw {
    /// Angular part [-] for a rotation, zero for a translation.
    pub angular: Vector,
    /// Velocity of the origin [mm or -].
    pub linear: Vector,
}

impl Screw {
    /// Velocity of the point at `p`.
    pub fn at(&self, p: &Vector) -> Vector {
        self.angular.cross(p) + self.linear
    }
}

/// True where coordinate `j` comes before `k` along the chain, or is `k`.
pub fn comes_first(j: usize, k: usize) -> bool {
    RANK[j] <= RANK[k]
}

impl Joint {
    /// The chain of a specification; axes from the frames where the specification gives none.
    ///
    /// Errors: axes that are not unit vectors, or a femoral axis nearly parallel to the tibial one.
    pub fn new(frames: &FramesSpec, side: Side) -> Result<Joint, SimError> {
        check_frame("femur", &frames.femur)?;
        check_frame("tibia", &frames.tibia)?;
        let chain = match &frames.chain {
            Some(chain) => *chain,
            None => chain_of_frames(&frames.femur, &frames.tibia)?,
        };
        let towards = [frames.tibia.superior, -frames.tibia.anterior, -frames.femur.medial];
        let mut axes = [chain.si, chain.ap, chain.ml];
        for (axis, (way, name)) in axes.iter_mut().zip(towards.iter().zip(["si", "ap", "ml"])) {
            let d = axis.direction;
            let unit = (d.norm() - 1.0).abs() < 1e-3;
            if !unit || !axis.point.coords.iter().all(|x| x.is_finite()) {
                return Err(SimError::Spec(format!(
                    "frames.chain.{name}: direction of length {}, expected 1",
                    d.norm()
                )));
            }
            axis.direction = if d.dot(way) < 0.0 { -d.normalize() } else { d.normalize() };
        }
        let turn = if side == Side::Left { 1.0 } else { -1.0 };
        let sign = [-turn, turn, -turn, -1.0, 1.0, -1.0];
        let mut joint = Joint { axes, sign, femur: frames.femur, tibia: frames.tibia, ct: Six::zeros() };
        joint.ct = joint.grood_suntay_of(&Isometry::identity());
        Ok(joint)
    }

    /// Grood-Suntay coordinates of the CT pose [rad, mm].
    pub fn ct_pose(&self) -> Six {
        self.ct
    }

    /// The tibia's frame; the tibia stays where it is in CT.
    pub fn tibia(&self) -> &AnatomicalFrame {
        &self.tibia
    }

    /// The femur's frame in the CT pose.
    pub fn femur(&self) -> &AnatomicalFrame {
        &self.femur
    }

    /// Tibial, floating and femoral axis in the CT pose, turned superior, posterior, lateral.
    pub fn axes(&self) -> &[AxisSpec; 3] {
        &self.axes
    }

    /// Origin of the femoral frame in the CT pose [mm].
    pub fn femur_origin(&self) -> Point {
        self.femur.origin
    }

    /// The coordinate a deck's chain coordinate is, and its sign; `chain` holds the axes as the deck turns them.
    pub fn from_chain(&self, coordinate: ChainCoordinate, chain: Option<&ChainSpec>) -> (Coordinate, f64) {
        let (index, axis, given) = match coordinate {
            ChainCoordinate::Ie => (IE, 0, chain.map(|c| c.si)),
            ChainCoordinate::Si => (SI, 0, chain.map(|c| c.si)),
            ChainCoordinate::Vv => (VV, 1, chain.map(|c| c.ap)),
            ChainCoordinate::Ap => (AP, 1, chain.map(|c| c.ap)),
            ChainCoordinate::Fe => (FE, 2, chain.map(|c| c.ml)),
            ChainCoordinate::Ml => (ML, 2, chain.map(|c| c.ml)),
        };
        let turned = given.is_some_and(|g| g.direction.dot(&self.axes[axis].direction) < 0.0);
        (index, if turned { -self.sign[index.index()] } else { self.sign[index.index()] })
    }

    /// Position of the femur and its velocity fields at `q`.
    pub fn pose(&self, q: &Six) -> Pose {
        let c = Six::from_fn(|i, _| self.sign[i] * q[i]);
        let [si, ap, ml] = &self.axes;
        let first = cylinder(si, c[IE], c[SI]);
        let second = first * cylinder(ap, c[VV], c[AP]);
        let femur = second * cylinder(ml, c[FE], c[ML]);
        let mut screws = [Screw::default(); 6];
        for (turn, shift, axis, before) in
            [(IE, SI, si, Isometry::identity()), (VV, AP, ap, first), (FE, ML, ml, second)]
        {
            let e = before * axis.direction;
            let p = before * axis.point;
            let (turn, shift) = (turn.index(), shift.index());
            screws[turn] = Screw { angular: e * self.sign[turn], linear: p.coords.cross(&e) * self.sign[turn] };
            screws[shift] = Screw { angular: Vector::zeros(), linear: e * self.sign[shift] };
        }
        Pose { femur, screws }
    }

    /// Grood-Suntay coordinates at `q` [rad, mm], clinical signs (formulas: docs/theory, PUBLISHED 1).
    pub fn grood_suntay(&self, q: &Six) -> Six {
        self.grood_suntay_of(&self.pose(q).femur)
    }

    /// Grood-Suntay coordinates of a femur moved by `femur` from the CT pose [rad, mm].
    pub fn grood_suntay_of(&self, femur: &Isometry) -> Six {
        let (r, t) = self.tibia_in_femur(femur);
        let fe = libm::atan2(r[(1, 2)], r[(2, 2)]);
        let vv = libm::asin(r[(0, 2)].clamp(-1.0, 1.0));
        let ie = libm::atan2(-r[(0, 1)], r[(0, 0)]);
        let (sin, cos) = libm::sincos(fe);
        Six::new(fe, vv, ie, -t.x, t.y * cos - t.z * sin, r.column(2).dot(&t))
    }

    /// Derivative of the Grood-Suntay coordinates with respect to `q`, 6 x 6.
    pub fn grood_suntay_derivative(&self, q: &Six) -> Matrix6<f64> {
        let pose = self.pose(q);
        let (r, t) = self.tibia_in_femur(&pose.femur);
        let f = axes_matrix(&self.femur);
        let f = pose.femur.rotation.to_rotation_matrix().matrix() * f;
        let tibia = axes_matrix(&self.tibia);
        let origin = (pose.femur * self.femur.origin).coords;
        let (sin, cos) = libm::sincos(libm::atan2(r[(1, 2)], r[(2, 2)]));
        let mut d = Matrix6::zeros();
        for j in 0..6 {
            let screw = &pose.screws[j];
            let dr = f.transpose() * screw.angular.cross_matrix().transpose() * tibia;
            let dt = f.transpose() * (-screw.angular.cross(&(self.tibia.origin.coords - origin)) - screw.at(&origin));
            let (a, b) = (r[(1, 2)], r[(2, 2)]);
            let dfe = (b * dr[(1, 2)] - a * dr[(2, 2)]) / (a * a + b * b);
            let (a, b) = (-r[(0, 1)], r[(0, 0)]);
            let die = (-b * dr[(0, 1)] - a * dr[(0, 0)]) / (a * a + b * b);
            let dvv = dr[(0, 2)] / (1.0 - r[(0, 2)].powi(2)).max(1e-12).sqrt();
            let dap = dt.y * cos - dt.z * sin - (t.y * sin + t.z * cos) * dfe;
            let dsi = dr.column(2).dot(&t) + r.column(2).dot(&dt);
            d.set_column(j, &Six::new(dfe, dvv, die, -dt.x, dap, dsi));
        }
        d
    }

    /// Chain coordinates of the pose with Grood-Suntay coordinates `gs` [rad, mm]; Newton's method.
    ///
    /// Errors: no convergence, which means a pose beyond the chain's range (valgus near 90 deg).
    pub fn coordinates(&self, gs: &Six) -> Result<Six, SimError> {
        let mut q = gs - self.ct;
        for _ in 0..30 {
            let miss = gs - self.grood_suntay(&q);
            if miss.amax() < 1e-12 {
                return Ok(q);
            }
            let Some(inverse) = self.grood_suntay_derivative(&q).try_inverse() else { break };
            q += inverse * miss;
        }
        if (gs - self.grood_suntay(&q)).amax() < 1e-8 {
            return Ok(q);
        }
        Err(SimError::Input(format!("no pose of the joint has the Grood-Suntay coordinates {:?}", gs.as_slice())))
    }

    /// Rotation and translation of the tibial frame seen from the femoral frame, axes (medial, anterior, superior).
    fn tibia_in_femur(&self, femur: &Isometry) -> (Matrix3<f64>, Vector) {
        let f = femur.rotation.to_rotation_matrix().matrix() * axes_matrix(&self.femur);
        let origin = femur * self.femur.origin;
        (f.transpose() * axes_matrix(&self.tibia), f.transpose() * (self.tibia.origin - origin))
    }
}

/// The frame's axes as columns.
fn axes_matrix(frame: &AnatomicalFrame) -> Matrix3<f64> {
    Matrix3::from_columns(&[frame.medial, frame.anterior, frame.superior])
}

/// Turn by `angle` about the axis, then shift by `shift` along it.
fn cylinder(axis: &AxisSpec, angle: f64, shift: f64) -> Isometry {
    let turn = UnitQuaternion::from_rotation_matrix(&portable::turn(&axis.direction, angle));
    let p = axis.point.coords;
    Isometry::from_parts(Translation3::from(p - turn * p + axis.direction * shift), turn)
}

/// Axes through the frames: tibial superior, femoral medial-lateral, and their common perpendicular.
fn chain_of_frames(femur: &AnatomicalFrame, tibia: &AnatomicalFrame) -> Result<ChainSpec, SimError> {
    let (si, ml) = (tibia.superior, -femur.medial);
    let cross = ml.cross(&si);
    let apart = cross.norm() > 0.1;
    if !apart {
        return Err(SimError::Spec(
            "frames: the femoral medial-lateral axis is nearly parallel to the tibial superior axis; check both frames"
                .into(),
        ));
    }
    let between = femur.origin - tibia.origin;
    let along = between.cross(&ml).dot(&si.cross(&ml)) / cross.norm_squared();
    let foot: Point = tibia.origin + si * along;
    Ok(ChainSpec {
        si: AxisSpec { point: tibia.origin, direction: si },
        ap: AxisSpec { point: foot, direction: cross.normalize() },
        ml: AxisSpec { point: femur.origin, direction: ml },
    })
}

/// Refuses a frame that is not orthonormal to 1e-3.
fn check_frame(name: &str, frame: &AnatomicalFrame) -> Result<(), SimError> {
    let m = axes_matrix(frame);
    let off = (m.transpose() * m - Matrix3::identity()).amax();
    let right_angled = off < 1e-3;
    if !right_angled || !frame.origin.coords.iter().all(|x| x.is_finite()) {
        return Err(SimError::Spec(format!(
            "frames.{name}: axes are not orthonormal (off by {off:.3e}, at most 1e-3)"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
