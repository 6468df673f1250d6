//! A deck's own steps as data: prescribed motions and loads on the six chain coordinates over time.
//!
//! The numbers are the deck's: chain coordinates from the CT pose (mm, rad), their generalised forces (N, N mm), in the
//! deck's signs, with every quirk of it (degree factor, flexion base, sense of the VV moment). They act only when these
//! steps are run; laxity data are always in clinical signs.

use serde::{Deserialize, Serialize};

/// A chain coordinate: turn about or slide along one of the three axes of the joint, from the CT pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ChainCoordinate {
    /// Turn about the tibial axis [rad].
    Ie,
    /// Slide along the tibial axis [mm].
    Si,
    /// Turn about the floating axis [rad].
    Vv,
    /// Slide along the floating axis [mm].
    Ap,
    /// Turn about the femoral axis [rad].
    Fe,
    /// Slide along the femoral axis [mm].
    Ml,
}

/// What is imposed on a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ControlKind {
    /// The coordinate itself [mm or rad], counted from its value at the start of the step.
    Motion,
    /// Its generalised force on the femur's side of the chain [N or N mm].
    Load,
}

/// How an amplitude runs between its points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Curve {
    /// Straight lines; corners rounded over this fraction of the shorter neighbouring interval [-].
    Linear {
        /// Fraction of the interval on either side of a corner [-].
        smooth: f64,
    },
    /// Fifth-order steps, at rest at every point.
    SmoothStep,
}

/// A factor over the time of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Amplitude {
    /// The deck's name of it.
    pub name: String,
    /// How it runs between points.
    pub curve: Curve,
    /// Time in the step [s], factor [-]; times ascending.
    pub points: Vec<[f64; 2]>,
}

/// A motion or load on one coordinate during a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Control {
    /// The coordinate.
    pub coordinate: ChainCoordinate,
    /// Motion or load.
    pub kind: ControlKind,
    /// The deck's factor: mm, rad, N or N mm per unit of amplitude.
    pub magnitude: f64,
    /// The amplitude; constant 1 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Amplitude>,
}

/// A step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeckStep {
    /// The deck's name of it.
    pub name: String,
    /// Duration [s].
    pub duration_s: f64,
    /// Fixed time increment [s]; the solver's own where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub increment_s: Option<f64>,
    /// Whether cartilage contact is defined in it.
    pub contact: bool,
    /// Motions and loads; a coordinate without one is free and unloaded.
    pub controls: Vec<Control>,
}

/// A deck's steps, from the CT pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeckProtocol {
    /// The trial's name.
    pub name: String,
    /// Whether a motion stops half an increment short of its ramp, as a central-difference motion does: the end value of
    /// a linear ramp of length T is multiplied by (1 - increment / 2 T).
    pub lost_half_increment: bool,
    /// The steps in order.
    pub steps: Vec<DeckStep>,
    /// The deck's habits found in the numbers, in words.
    #[serde(default)]
    pub quirks: Vec<String>,
}

impl Amplitude {
    /// The factor at time `t` of the step [s]; constant beyond the ends.
    pub fn at(&self, t: f64) -> f64 {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return 0.0;
        };
        if t <= first[0] {
            return first[1];
        }
        if t >= last[0] {
            return last[1];
        }
        let i = self.points.partition_point(|p| p[0] <= t).clamp(1, self.points.len() - 1);
        match self.curve {
            Curve::SmoothStep => {
                let ([t0, a0], [t1, a1]) = (self.points[i - 1], self.points[i]);
                let x = (t - t0) / (t1 - t0);
                a0 + (a1 - a0) * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
            }
            Curve::Linear { smooth } => self.rounded(i, t, smooth.clamp(0.0, 0.5)),
        }
    }

    /// Straight between points `i - 1` and `i`, with corners replaced by parabolas over `smooth` of the shorter neighbour.
    fn rounded(&self, i: usize, t: f64, smooth: f64) -> f64 {
        let slope =
            |k: usize| (self.points[k][1] - self.points[k - 1][1]) / (self.points[k][0] - self.points[k - 1][0]);
        let width = |k: usize| self.points[k][0] - self.points[k - 1][0];
        for corner in [i - 1, i] {
            if corner == 0 || corner + 1 >= self.points.len() {
                continue;
            }
            let h = smooth * width(corner).min(width(corner + 1));
            let from_start = t - (self.points[corner][0] - h);
            if h > 0.0 && from_start > 0.0 && from_start < 2.0 * h {
                let (s0, s1) = (slope(corner), slope(corner + 1));
                let start = self.points[corner][1] - s0 * h;
                return start + s0 * from_start + (s1 - s0) * from_start * from_start / (4.0 * h);
            }
        }
        self.points[i - 1][1] + slope(i) * (t - self.points[i - 1][0])
    }
}

impl Control {
    /// The imposed value at time `t` of the step [s]: mm, rad, N or N mm.
    pub fn at(&self, t: f64) -> f64 {
        self.magnitude * self.amplitude.as_ref().map_or(1.0, |a| a.at(t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_pass_their_points_and_stay_between() {
        let points = vec![[0.0, 0.0], [0.3, 0.0], [0.9, 2.0], [10.0, 2.0]];
        let step = Amplitude { name: String::new(), curve: Curve::SmoothStep, points: points.clone() };
        assert_eq!([step.at(-1.0), step.at(0.3), step.at(0.9), step.at(20.0)], [0.0, 0.0, 2.0, 2.0]);
        assert!((step.at(0.6) - 1.0).abs() < 1e-12);
        let line = Amplitude { curve: Curve::Linear { smooth: 0.1 }, ..step.clone() };
        assert!((line.at(0.6) - 1.0).abs() < 1e-12);
        let mut last = 0.0;
        for k in 0..=1000 {
            let v = line.at(f64::from(k) * 1e-3);
            assert!(v >= last - 1e-12 && v <= 2.0 + 1e-12 && v - last < 5e-3, "jump at {k}");
            last = v;
        }
        let sharp = Amplitude { curve: Curve::Linear { smooth: 0.0 }, ..step };
        assert!((sharp.at(0.45) - 0.5).abs() < 1e-12);
    }
}
