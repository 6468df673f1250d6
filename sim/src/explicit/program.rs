//! What is imposed over time: steps with loads and motions, contact, dashpots and failures.

use super::options::ExplicitOptions;
use crate::coordinate::Six;
use crate::deck::{Amplitude, Curve};
use crate::error::SimError;
use serde::{Deserialize, Serialize};

/// More increments than this are refused.
const MOST_INCREMENTS: f64 = 1e8;

/// A value over the time of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Course {
    /// Value at factor 0 [N, N mm; 0 in a motion].
    pub base: f64,
    /// Value a factor of 1 adds [N, N mm, rad or mm].
    pub magnitude: f64,
    /// The factor over time; constant 1 where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<Amplitude>,
    /// What the factor lost at the start [-]: half an increment, in a deck with fixed increments.
    #[serde(default)]
    pub lost: f64,
}

/// What is imposed on a coordinate (clinical signs).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Drive {
    /// Its conjugate load [N mm, N].
    Load(Course),
    /// Its displacement from where it is at the start of the step [rad, mm].
    Motion(Course),
}

/// A step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Its name.
    pub name: String,
    /// Its duration [s].
    pub duration_s: f64,
    /// Longest increment [s]; that of the options where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub increment_s: Option<f64>,
    /// Whether cartilage contact is defined in it.
    pub contact: bool,
    /// What is imposed on each coordinate, in the order of [`crate::joint`].
    pub drive: [Drive; 6],
    /// Dashpots along the coordinates [N mm s/rad, N s/mm].
    pub damping: Six,
    /// Bundles that fail at its first increment, by bundle or ligament.
    #[serde(default)]
    pub fail: Vec<String>,
}

/// Steps, one after another.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// In order.
    pub steps: Vec<Step>,
}

impl Course {
    /// The same value all the time.
    pub fn constant(value: f64) -> Course {
        Course { base: 0.0, magnitude: value, amplitude: None, lost: 0.0 }
    }

    /// From one value to another between two times of the step, constant before and after.
    pub fn ramp(values: [f64; 2], times: [f64; 2], curve: Curve) -> Course {
        let points = vec![[times[0], 0.0], [times[1], 1.0]];
        let amplitude = Some(Amplitude { name: String::new(), curve, points });
        Course { base: values[0], magnitude: values[1] - values[0], amplitude, lost: 0.0 }
    }

    /// Value at a time of the step [s].
    pub fn at(&self, time: f64) -> f64 {
        self.base + self.magnitude * (self.amplitude.as_ref().map_or(1.0, |a| a.at(time)) - self.lost)
    }

    fn is_finite(&self) -> bool {
        let points = self.amplitude.iter().flat_map(|a| a.points.iter().flatten());
        points.chain([&self.base, &self.magnitude, &self.lost]).all(|x| x.abs() < 1e9)
    }
}

impl Program {
    /// Refuses what cannot be run.
    pub(crate) fn check(&self, options: &ExplicitOptions) -> Result<(), SimError> {
        let fault = |m: String| Err(SimError::Input(m));
        if self.steps.is_empty() {
            return fault("a program without steps".into());
        }
        for step in &self.steps {
            let name = &step.name;
            if !(step.duration_s > 0.0 && step.duration_s < 1e6) {
                return fault(format!("step {name}: duration {} s, expected above 0", step.duration_s));
            }
            let increment = step.increment_s.unwrap_or(options.longest_increment_s);
            if !(increment > 0.0 && increment <= 0.1 && step.duration_s / increment < MOST_INCREMENTS) {
                return fault(format!("step {name}: increments of {increment} s in {} s", step.duration_s));
            }
            for (coordinate, drive) in step.drive.iter().enumerate() {
                let (Drive::Load(course) | Drive::Motion(course)) = drive;
                if !course.is_finite() {
                    let which = ["flexion", "varus-valgus", "rotation", "ML", "AP", "SI"][coordinate];
                    return fault(format!("step {name}: the load or motion of {which} is not finite: {course:?}"));
                }
            }
            if !step.damping.iter().all(|c| *c >= 0.0 && *c < 1e12) {
                return fault(format!("step {name}: dashpots {:?}, expected 0 or more", step.damping.as_slice()));
            }
        }
        Ok(())
    }
}
