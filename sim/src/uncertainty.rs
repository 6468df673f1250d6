//! What a model does not know of its knee, as standard deviations beside the numbers (FORMAT 3, `uncertainty`).
//!
//! A verb that infers takes these for its priors. Each group says where its numbers come from.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Standard deviations of what the build does not know. Published decks have small ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Attachment sites, by bundle.
    pub sites: BTreeMap<String, SiteUncertainty>,
    /// Anatomical frames.
    pub frames: FramesUncertainty,
    /// Natural logarithm of the factor on contact pressure [-].
    pub contact_log_scale: f64,
    /// Thickness of the two cartilages of a compartment together [mm].
    pub cartilage_mm: f64,
    /// Ligament parameters, by bundle; a bundle or parameter that is absent has the prior of the program's table.
    #[serde(default)]
    pub ligaments: BTreeMap<String, LigamentUncertainty>,
    /// Where `contact_log_scale` and `cartilage_mm` come from, by name.
    #[serde(default)]
    pub sources: BTreeMap<String, String>,
}

/// Standard deviation of each of the three components of a bundle's ends [mm], CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SiteUncertainty {
    /// Femoral end [mm].
    pub femur_mm: f64,
    /// Tibial end [mm].
    pub tibia_mm: f64,
    /// How the two ends were found, and where the numbers come from.
    pub source: String,
}

/// Uncertainty of both frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FramesUncertainty {
    /// The femur's.
    pub femur: FrameUncertainty,
    /// The tibia's.
    pub tibia: FrameUncertainty,
}

/// Standard deviations of a frame's turns and shifts, about and along its own axes: medial, anterior, superior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameUncertainty {
    /// Turn about the medial, anterior and superior axis [deg].
    pub turn_deg: [f64; 3],
    /// Shift of the origin along the medial, anterior and superior axis [mm].
    pub shift_mm: [f64; 3],
    /// Where the numbers come from.
    pub source: String,
}

/// Priors of a bundle's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LigamentUncertainty {
    /// Ratio of length to slack length in the CT pose [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_strain: Option<ParameterPrior>,
    /// Stiffness of the whole bundle [N/mm].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_n_per_mm: Option<ParameterPrior>,
    /// Where the numbers come from.
    #[serde(default)]
    pub source: String,
}

/// What is believed of a parameter before anything is measured, in the parameter's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "prior", rename_all = "lowercase", deny_unknown_fields)]
pub enum ParameterPrior {
    /// Equally likely between two bounds.
    Uniform {
        /// Least value.
        lower: f64,
        /// Largest value.
        upper: f64,
    },
    /// A normal distribution, cut off at the bounds where they are given.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sd: f64,
        /// Least value.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lower: Option<f64>,
        /// Largest value.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        upper: Option<f64>,
    },
}

impl Uncertainty {
    /// What is taken where a model has no `uncertainty`: that of a published deck, whose numbers are the author's own.
    ///
    /// `bundles` are the model's bundle names.
    pub fn of_deck(bundles: &[String]) -> Uncertainty {
        let source = "a published deck: its numbers are taken as the authors mean them".to_owned();
        let site = || SiteUncertainty { femur_mm: DECK_SITE_MM, tibia_mm: DECK_SITE_MM, source: source.clone() };
        let frame = || FrameUncertainty { turn_deg: [0.0; 3], shift_mm: [0.0; 3], source: source.clone() };
        Uncertainty {
            sites: bundles.iter().map(|b| (b.clone(), site())).collect(),
            frames: FramesUncertainty { femur: frame(), tibia: frame() },
            contact_log_scale: DECK_CONTACT_LOG_SCALE,
            cartilage_mm: DECK_CARTILAGE_MM,
            ligaments: BTreeMap::new(),
            sources: ["contact_log_scale", "cartilage_mm"].map(|k| (k.to_owned(), source.clone())).into(),
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// The key, its value and what was expected.
    pub fn check(&self) -> Result<(), String> {
        let sd = |key: String, x: f64| match x.is_finite() && x >= 0.0 {
            true => Ok(()),
            false => Err(format!("uncertainty.{key} is {x}, expected a standard deviation of 0 or more")),
        };
        for (bundle, s) in &self.sites {
            sd(format!("sites.{bundle}.femur_mm"), s.femur_mm)?;
            sd(format!("sites.{bundle}.tibia_mm"), s.tibia_mm)?;
        }
        for (bone, f) in [("femur", &self.frames.femur), ("tibia", &self.frames.tibia)] {
            f.turn_deg.iter().try_for_each(|x| sd(format!("frames.{bone}.turn_deg"), *x))?;
            f.shift_mm.iter().try_for_each(|x| sd(format!("frames.{bone}.shift_mm"), *x))?;
        }
        sd("contact_log_scale".into(), self.contact_log_scale)?;
        sd("cartilage_mm".into(), self.cartilage_mm)?;
        for (bundle, l) in &self.ligaments {
            for (name, prior) in
                [("reference_strain", &l.reference_strain), ("stiffness_n_per_mm", &l.stiffness_n_per_mm)]
            {
                if prior.is_some_and(|p| !p.is_proper()) {
                    return Err(format!(
                        "uncertainty.ligaments.{bundle}.{name}: {prior:?}, expected finite numbers, sd above 0 and lower < upper"
                    ));
                }
            }
        }
        Ok(())
    }
}

impl ParameterPrior {
    /// Whether the numbers make a distribution.
    pub fn is_proper(&self) -> bool {
        match *self {
            ParameterPrior::Uniform { lower, upper } => lower.is_finite() && upper.is_finite() && lower < upper,
            ParameterPrior::Normal { mean, sd, lower, upper } => {
                mean.is_finite()
                    && sd.is_finite()
                    && sd > 0.0
                    && lower.is_none_or(f64::is_finite)
                    && upper.is_none_or(f64::is_finite)
                    && lower.zip(upper).is_none_or(|(l, u)| l < u)
            }
        }
    }
}

/// Scatter of a deck's attachment sites [mm]: what a diagnosis has allowed so far for the choice of a node. Ours.
const DECK_SITE_MM: f64 = 0.4;
/// Scatter of a deck's contact law, natural logarithm [-]. Ours.
const DECK_CONTACT_LOG_SCALE: f64 = 0.05;
/// Scatter of a deck's cartilage [mm]: contact meshes of 1 mm lie that far from the surface. Ours.
const DECK_CARTILAGE_MM: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_says_prior_and_bounds_and_bad_numbers_are_named() {
        let text = r#"{"sites": {"LCL": {"femur_mm": 1.0, "tibia_mm": 2.0, "source": "marked"}},
            "frames": {"femur": {"turn_deg": [1, 2, 2], "shift_mm": [2, 2, 2], "source": "x"},
                       "tibia": {"turn_deg": [1, 2, 4], "shift_mm": [2, 3, 2], "source": "x"}},
            "contact_log_scale": 0.2, "cartilage_mm": 0.3,
            "ligaments": {"LCL": {"reference_strain": {"prior": "normal", "mean": 1.0, "sd": 0.05},
                                  "stiffness_n_per_mm": {"prior": "uniform", "lower": 60, "upper": 200}, "source": "y"}}}"#;
        let mut u: Uncertainty = serde_json::from_str(text).unwrap();
        assert_eq!(u.check(), Ok(()));
        let back: Uncertainty = serde_json::from_str(&serde_json::to_string(&u).unwrap()).unwrap();
        assert_eq!(u, back);
        u.cartilage_mm = f64::NAN;
        assert!(u.check().unwrap_err().contains("cartilage_mm"));
        u.cartilage_mm = 0.1;
        u.sites.get_mut("LCL").unwrap().tibia_mm = -1.0;
        assert!(u.check().unwrap_err().contains("sites.LCL.tibia_mm"));
        assert_eq!(Uncertainty::of_deck(&["LCL".into()]).check(), Ok(()));
    }
}
