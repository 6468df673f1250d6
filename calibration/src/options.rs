//! Options of a calibration, as in `[options.calibrate]` of specimen.toml.

use crate::cost::CostOptions;
use crate::error::CalibrationError;
use crate::knee::SearchOptions;
use crate::priors::PriorTable;
use crate::rig::RigOptions;
use crate::shared::SharedPrior;
use crate::targets::TargetOptions;
use inference::posterior::PosteriorOptions;
use serde::{Deserialize, Serialize};
use sim::laxity::{LaxityTrial, Test};
use std::collections::BTreeMap;

/// How the parameters are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The posterior of everything that is not known, by the solver's derivatives.
    #[default]
    #[serde(alias = "gradient")]
    Posterior,
    /// Particle swarm, then simplex: the paper's recipe.
    SwarmSimplex,
}

/// Options of a calibration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CalibrateOptions {
    /// How.
    pub method: Method,
    /// Which trials, and what makes them usable.
    pub targets: TargetOptions,
    /// How the cost is counted.
    pub cost: CostOptions,
    /// Ranges instead of Table 3's [- or N/mm], by name ("X3" or "LCL.reference_strain").
    pub ranges: BTreeMap<String, [f64; 2]>,
    /// Which priors are used, of reference strains and of forces in drawers and at rest: calibration/data/priors.toml (also `usual`; most of it from memory of the literature, not read), none of them
    /// (also `none`), only what was read in its source (`published`), or that with the usual values where nothing was read (`read`; docs/theory/priors.md). Without, strains are even over Table 3. The paper's recipe never uses them.
    pub priors: PriorTable,
    /// What other knees of a laboratory say of this one's ligaments, contact and cartilage, in place of their own priors: a file shared_prior_KNEE.json that
    /// `build-model cohort infer` writes. A relative path counts from the folder in which the program runs. The method posterior alone takes it [gelman2013].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shared_prior: Option<SharedPrior>,
    /// What else is believed of ligament loads; nothing by default.
    pub loads: Vec<LoadPrior>,
    /// The paper's recipe.
    pub swarm: SwarmOptions,
    /// How far the frames of the measurements may stand from the model's; the paper's recipe and imported decks take them as given.
    pub frames: FrameOptions,
    /// The apparatus and the limb where readings are displacements; heard by the method posterior.
    pub rig: RigOptions,
    /// How answers are sought on the way.
    pub search: SearchOptions,
    /// The posterior: starts, fits, samples.
    pub inference: PosteriorOptions,
    /// Intervals and outliers.
    pub gradient: IntervalOptions,
    /// Seed of every random number.
    pub seed: u64,
}

/// A belief about a bundle's force [andreassen2025, discussion]: near `mean_n`, or no more than `most_n`, with a standard deviation. It
/// joins the least squares as a residual, and the cost as `weight` times its size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadPrior {
    /// Bundles whose forces are summed, by name.
    pub bundles: Vec<String>,
    /// In which test; in every one where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<Test>,
    /// At which nominal flexion [deg]; at every one where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_flexion_deg: Option<f64>,
    /// Expected force [N].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_n: Option<f64>,
    /// Force beyond which it counts [N].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_n: Option<f64>,
    /// Standard deviation [N].
    pub sd_n: f64,
    /// Weight in the cost of one standard deviation, averaged over the trials it applies to [-].
    #[serde(default = "load_weight")]
    pub weight: f64,
}

impl LoadPrior {
    /// Whether it is about a trial.
    pub fn applies(&self, t: &LaxityTrial) -> bool {
        self.test.is_none_or(|test| test == t.test)
            && self.nominal_flexion_deg.is_none_or(|f| (f - t.nominal_flexion_deg).abs() < 0.5)
    }
}

fn load_weight() -> f64 {
    50.0
}

/// The paper's recipe [andreassen2025, section 2.5].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SwarmOptions {
    /// Particles [-]; ours, the paper gives none.
    pub particles: usize,
    /// Evaluations by the swarm [-]; about 750 [andreassen2025, section 2.5].
    pub swarm_evaluations: usize,
    /// Evaluations by the simplex [-]; about 500 [andreassen2025, section 2.5].
    pub simplex_evaluations: usize,
    /// First edge of the simplex, in widths of the ranges [-]; ours.
    pub simplex_size: f64,
}

impl Default for SwarmOptions {
    fn default() -> Self {
        SwarmOptions { particles: 25, swarm_evaluations: 750, simplex_evaluations: 500, simplex_size: 0.1 }
    }
}

/// Intervals and outliers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IntervalOptions {
    /// Whether a recipe's noise is scaled up, a coordinate each, where the best fit misses the measurements by more, before its intervals.
    pub scale_noise: bool,
    /// Residuals beyond this many standard deviations count linearly, not squared [huber1964] [-].
    pub robust: f64,
    /// Points of a recipe's posterior by Laplace's approximation [-].
    pub samples: usize,
    /// Probability of the intervals [-].
    pub interval: f64,
}

impl Default for IntervalOptions {
    fn default() -> Self {
        IntervalOptions { scale_noise: true, robust: 3.0, samples: 48, interval: 0.9 }
    }
}

impl CalibrateOptions {
    /// The options as far as the method hears them, and the others by default: the posterior has no swarm, and a belief no weight in a cost.
    #[must_use]
    pub fn heard(&self) -> CalibrateOptions {
        let mut out = self.clone();
        if self.method == Method::Posterior {
            out.swarm = SwarmOptions::default();
            out.loads.iter_mut().for_each(|load| load.weight = load_weight());
        }
        out
    }

    /// Refuses options that the method does not hear.
    fn refuse_unheard(&self) -> Result<(), CalibrationError> {
        let refused = |what: &str| Err(CalibrationError::Option(what.into()));
        let (own, usual) = (&self.gradient, IntervalOptions::default());
        if self.method == Method::Posterior && own.samples != usual.samples {
            return refused("gradient.samples is not heard by the method posterior: set inference.samples");
        }
        if self.method == Method::Posterior && own.scale_noise != usual.scale_noise {
            return refused("gradient.scale_noise is not heard by the method posterior: set inference.scale_noise");
        }
        if self.method != Method::Posterior && self.shared_prior.is_some() {
            return refused("shared_prior is not heard by a recipe: leave it out, or set method to posterior");
        }
        Ok(())
    }

    /// Refuses options that mean nothing.
    ///
    /// # Errors
    /// The option's name, its value and what is expected.
    pub fn check(&self) -> Result<(), CalibrationError> {
        let least = |name: &str, value: usize, least: usize| match value >= least {
            true => Ok(()),
            false => Err(CalibrationError::Option(format!("{name} is {value}, expected at least {least}"))),
        };
        least("swarm.particles", self.swarm.particles, 2)?;
        least("swarm.swarm_evaluations", self.swarm.swarm_evaluations, self.swarm.particles)?;
        least("inference.first_evaluations", self.inference.first_evaluations, 2)?;
        least("inference.finalists", self.inference.finalists, 1)?;
        least("inference.evaluations", self.inference.evaluations, 2)?;
        least("inference.sample_evaluations", self.inference.sample_evaluations, 1)?;
        if self.method == Method::Posterior && self.inference.samples == 1 {
            let what = "inference.samples is 1, expected 2 or more, or 0 for none: one sample makes no interval";
            return Err(CalibrationError::Option(what.into()));
        }
        self.refuse_unheard()?;
        let between = |name: &str, value: f64, low: f64, high: f64| match value > low && value < high {
            true => Ok(()),
            false => Err(CalibrationError::Option(format!("{name} is {value}, expected between {low} and {high}"))),
        };
        between("swarm.simplex_size", self.swarm.simplex_size, 0.0, 0.5)?;
        between("gradient.interval", self.gradient.interval, 0.0, 1.0)?;
        for (name, sd) in [
            ("frames.turn_sd_deg", self.frames.turn_sd_deg.unwrap_or(0.0)),
            ("frames.shift_sd_mm", self.frames.shift_sd_mm.unwrap_or(0.0)),
            ("frames.offset_turn_deg", self.frames.offset_turn_deg),
            ("frames.offset_shift_mm", self.frames.offset_shift_mm),
        ] {
            if !(0.0..=20.0).contains(&sd) {
                return Err(CalibrationError::Option(format!("{name} is {sd}, expected 0 to 20")));
            }
        }
        self.rig.check()?;
        between("gradient.robust", self.gradient.robust, 0.0, f64::INFINITY)?;
        for (i, p) in self.loads.iter().enumerate() {
            between(&format!("loads[{i}].sd_n"), p.sd_n, 0.0, f64::INFINITY)?;
            if p.mean_n.is_some() == p.most_n.is_some() {
                return Err(CalibrationError::Option(format!("loads[{i}]: give either mean_n or most_n")));
            }
        }
        Ok(())
    }
}

/// How far frames may be off beside what the model says of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrameOptions {
    /// Standard deviation of a turn about each axis [deg], in place of the model's `uncertainty`; 0 takes the frames as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_sd_deg: Option<f64>,
    /// Standard deviation of a shift along each axis [mm], in place of the model's `uncertainty`; 0 takes the frames as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_sd_mm: Option<f64>,
    /// Standard deviation of a data set's own turn beside that of all [deg]; ours: a sensor's calibration.
    pub offset_turn_deg: f64,
    /// Standard deviation of a data set's own shift beside that of all [mm]; ours: a point probed again.
    pub offset_shift_mm: f64,
}

impl Default for FrameOptions {
    fn default() -> Self {
        FrameOptions { turn_sd_deg: None, shift_sd_mm: None, offset_turn_deg: 1.5, offset_shift_mm: 2.5 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_is_refused_as_it_makes_no_interval() {
        let with = |samples: usize| {
            let mut options = CalibrateOptions::default();
            options.inference.samples = samples;
            options.check()
        };
        assert!([0, 2, 48].into_iter().all(|samples| with(samples).is_ok()));
        let told = with(1).unwrap_err().to_string();
        assert!(told.contains("inference.samples is 1") && told.contains("0 for none"), "{told}");
    }

    #[test]
    fn an_option_that_the_method_does_not_hear_is_refused() {
        type Change = fn(&mut CalibrateOptions);
        let changes: [(&str, Change); 2] = [
            ("gradient.samples", |o| o.gradient.samples = 12),
            ("gradient.scale_noise", |o| o.gradient.scale_noise = false),
        ];
        for (name, change) in changes {
            let mut options = CalibrateOptions::default();
            change(&mut options);
            assert!(options.check().unwrap_err().to_string().contains(name));
            // the paper's recipe hears it
            options.method = Method::SwarmSimplex;
            assert!(options.check().is_ok());
        }
        let mut options = CalibrateOptions { method: Method::SwarmSimplex, ..CalibrateOptions::default() };
        options.shared_prior = Some(SharedPrior::File("a.json".into()));
        assert!(options.check().unwrap_err().to_string().contains("shared_prior"));
        options.method = Method::Posterior;
        assert!(options.check().is_ok());
        // the calibration has one seed
        let text = toml::to_string(&CalibrateOptions::default()).unwrap();
        assert_eq!(text.matches("seed = ").count(), 1, "{text}");
    }
}
