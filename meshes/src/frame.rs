//! Frames as types where frames meet: a [`Pose`] carries where it leads from and to, so that a swapped one does not compile.

use crate::surface::TriMesh;
use crate::{Isometry, Point, Vector};
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;
use std::ops::Mul;

/// The CT frame: the model's frame, that of the tibia, which is fixed.
#[derive(Clone, Copy, Debug)]
pub struct Ct;
/// The scanner frame of one scanned bone.
#[derive(Clone, Copy, Debug)]
pub struct Scan;

/// A rigid motion that takes coordinates in `From` to coordinates in `To`; name values `to_from_from`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Pose<From, To> {
    motion: Isometry,
    #[serde(skip)]
    frames: PhantomData<(From, To)>,
}

impl<F, T> Clone for Pose<F, T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<F, T> Copy for Pose<F, T> {}

impl<F, T> Pose<F, T> {
    /// States that `motion` leads from `F` to `T`: the one unchecked entry.
    pub fn assume(motion: Isometry) -> Self {
        Pose { motion, frames: PhantomData }
    }

    /// The bare motion.
    pub fn motion(&self) -> &Isometry {
        &self.motion
    }

    /// The way back.
    pub fn inverse(&self) -> Pose<T, F> {
        Pose::assume(self.motion.inverse())
    }

    /// A point carried from `F` to `T` [mm].
    pub fn point(&self, p: &Point) -> Point {
        self.motion * p
    }

    /// A direction carried from `F` to `T`.
    pub fn vector(&self, v: &Vector) -> Vector {
        self.motion * v
    }

    /// A surface carried from `F` to `T`.
    pub fn mesh(&self, m: &TriMesh) -> TriMesh {
        m.moved(&self.motion)
    }
}

impl<A, B, C> Mul<Pose<A, B>> for Pose<B, C> {
    type Output = Pose<A, C>;
    fn mul(self, inner: Pose<A, B>) -> Pose<A, C> {
        Pose::assume(self.motion * inner.motion)
    }
}

/// An anatomical frame, in CT coordinates: origin [mm] and unit axes. `medial`, `anterior`, `superior` are mutually
/// orthogonal; right-handed as (medial, anterior, superior) for a left knee, left-handed for a right one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct AnatomicalFrame {
    /// Origin [mm].
    #[schemars(with = "[f64; 3]")]
    pub origin: Point,
    /// Unit vector towards the body's midline.
    #[schemars(with = "[f64; 3]")]
    pub medial: Vector,
    /// Unit vector forwards.
    #[schemars(with = "[f64; 3]")]
    pub anterior: Vector,
    /// Unit vector towards the head.
    #[schemars(with = "[f64; 3]")]
    pub superior: Vector,
}

/// Which knee.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The left knee.
    Left,
    /// The right knee.
    Right,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose: Pose<Scan, Ct> = Pose::assume(Isometry::new(Vector::new(1.0, 2.0, 3.0), Vector::new(0.1, 0.2, 0.3)));
        let p = Point::new(4.0, 5.0, 6.0);
        assert!(((pose.inverse() * pose).point(&p) - p).norm() < 1e-12);
    }
}
