//! Physiological priors (data/priors.toml): reference strains at extension, forces in drawers and at rest.

use serde::Deserialize;
use sim::laxity::Test;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Priors {
    /// Of reference strains, by bundle.
    pub reference_strain: BTreeMap<String, StrainPrior>,
    /// Of forces.
    pub force: Vec<ForcePrior>,
}

/// A normal distribution, cut off at Table 3's bounds.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrainPrior {
    /// Mean [-].
    pub mean: f64,
    /// Standard deviation [-].
    pub sd: f64,
    /// Where it comes from.
    pub source: String,
    /// How it was read again: text, abstract, memory.
    pub read: String,
}

/// A belief about forces in trials that need not have been measured.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForcePrior {
    /// The ligament whose bundles are summed; `all` for every one.
    pub ligament: String,
    /// Drawer of 133 N, or neutral.
    pub test: Test,
    /// At which flexions [deg].
    pub flexion_deg: Vec<f64>,
    /// Mean [N].
    pub mean_n: f64,
    /// Standard deviation [N].
    pub sd_n: f64,
    /// Whether less than the mean is as likely.
    #[serde(default)]
    pub only_above: bool,
    /// Where it comes from.
    pub source: String,
    /// How it was read again: text, abstract, memory.
    pub read: String,
}

impl ForcePrior {
    /// Whether a bundle counts.
    pub fn is_of(&self, bundle: &str) -> bool {
        self.ligament == "all" || bundle == self.ligament || bundle.starts_with(&format!("{}_", self.ligament))
    }
}

/// The priors shipped with the program.
pub static PRIORS: LazyLock<Priors> = LazyLock::new(|| {
    toml::from_str(include_str!("../../data/priors.toml")).expect("the priors shipped with the program parse")
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Kind};

    #[test]
    fn every_bundle_has_a_prior_within_table_3_and_every_belief_a_ligament() {
        for v in Design::table3().variables.iter().filter(|v| v.kind == Kind::ReferenceStrain) {
            let prior = &PRIORS.reference_strain[&v.bundles[0]];
            assert!(v.lower < prior.mean && prior.mean < v.upper && prior.sd > 0.0, "{}", v.name());
            assert!(["text", "abstract", "memory"].contains(&prior.read.as_str()));
        }
        let names: Vec<String> = Design::table3().variables.iter().flat_map(|v| v.bundles.clone()).collect();
        for f in &PRIORS.force {
            assert!(names.iter().any(|n| f.is_of(n)), "{}", f.ligament);
            assert!(f.sd_n > 0.0);
        }
    }
}
