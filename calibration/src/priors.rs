//! Physiological priors: reference strains at extension, forces in drawers and at rest. docs/theory/priors.md says where the tables come from.

use serde::{Deserialize, Serialize};
use sim::laxity::Test;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Which table of priors is used. Files of options write the usual one as `true`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Given", into = "Given")]
pub enum PriorTable {
    /// calibration/data/priors.toml; `usual` says the same.
    #[default]
    #[serde(rename = "true")]
    Usual,
    /// None: strains are even over Table 3, forces unknown; `none` says the same.
    #[serde(rename = "false")]
    None,
    /// calibration/data/priors-published.toml: only what was read in its source.
    #[serde(rename = "published")]
    Published,
}

/// A table as options name it.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected true, false, or a table of priors: usual, none, published")]
enum Given {
    Switch(bool),
    Name(String),
}

impl TryFrom<Given> for PriorTable {
    type Error = String;

    fn try_from(given: Given) -> Result<PriorTable, String> {
        let name = match given {
            Given::Switch(on) => return Ok(if on { PriorTable::Usual } else { PriorTable::None }),
            Given::Name(name) => name,
        };
        match name.as_str() {
            "usual" | "true" => Ok(PriorTable::Usual),
            "none" | "false" => Ok(PriorTable::None),
            "published" => Ok(PriorTable::Published),
            _ => Err(format!("no table of priors is called {name:?}; expected true, false, usual, none or published")),
        }
    }
}

impl From<PriorTable> for Given {
    fn from(table: PriorTable) -> Given {
        match table {
            PriorTable::Usual => Given::Switch(true),
            PriorTable::None => Given::Switch(false),
            PriorTable::Published => Given::Name("published".into()),
        }
    }
}

impl PriorTable {
    /// The table.
    pub fn priors(self) -> Option<&'static Priors> {
        match self {
            PriorTable::Usual => Some(&PRIORS),
            PriorTable::None => None,
            PriorTable::Published => Some(&PUBLISHED),
        }
    }

    /// What it believes of forces.
    pub fn forces(self) -> &'static [ForcePrior] {
        self.priors().map_or(&[], |p| &p.force)
    }

    /// What it believes of a bundle's reference strain.
    pub fn reference_strain(self, bundle: &str) -> Option<&'static StrainPrior> {
        self.priors()?.reference_strain.get(bundle)
    }
}

/// A table of priors.
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
    /// How it was read: text, abstract, model (a published model's file), memory.
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
    /// How it was read: text, abstract, model (a published model's file), memory.
    pub read: String,
}

impl ForcePrior {
    /// Whether a bundle counts.
    pub fn is_of(&self, bundle: &str) -> bool {
        self.ligament == "all" || bundle == self.ligament || bundle.starts_with(&format!("{}_", self.ligament))
    }
}

/// The usual priors, as they are shipped.
pub const USUAL: &str = include_str!("../data/priors.toml");

/// The usual priors.
pub static PRIORS: LazyLock<Priors> =
    LazyLock::new(|| toml::from_str(USUAL).expect("the priors shipped with the program parse"));

/// Priors of what was read in its source, and nothing else.
static PUBLISHED: LazyLock<Priors> = LazyLock::new(|| {
    toml::from_str(include_str!("../data/priors-published.toml")).expect("the published priors parse")
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Kind};
    use crate::options::CalibrateOptions;

    fn check(table: &Priors, ways: &[&str]) {
        let design = Design::table3();
        for (bundle, prior) in &table.reference_strain {
            let of = |v: &&crate::design::Variable| v.kind == Kind::ReferenceStrain && v.bundles.contains(bundle);
            let v = design.variables.iter().find(of).unwrap();
            assert!(v.lower < prior.mean && prior.mean < v.upper && prior.sd > 0.0, "{bundle}");
            assert!(ways.contains(&prior.read.as_str()), "{bundle}: {}", prior.read);
        }
        let names: Vec<String> = design.variables.iter().flat_map(|v| v.bundles.clone()).collect();
        for f in &table.force {
            assert!(names.iter().any(|n| f.is_of(n)), "{}", f.ligament);
            assert!(f.sd_n > 0.0 && ways.contains(&f.read.as_str()), "{}: {}", f.ligament, f.read);
        }
    }

    #[test]
    fn every_bundle_has_a_usual_prior_within_table_3_and_every_belief_a_ligament() {
        check(&PRIORS, &["text", "abstract", "memory"]);
        for v in Design::table3().variables.iter().filter(|v| v.kind == Kind::ReferenceStrain) {
            assert!(PRIORS.reference_strain.contains_key(&v.bundles[0]), "{}", v.name());
        }
    }

    #[test]
    fn the_published_table_holds_nothing_from_memory() {
        check(&PUBLISHED, &["text", "abstract", "model"]);
        assert_ne!(*PUBLISHED, *PRIORS);
    }

    #[test]
    fn options_name_a_table_and_an_unknown_name_is_one_error() {
        let parse = |value: &str| toml::from_str::<CalibrateOptions>(&format!("priors = {value}"));
        for (value, table) in [
            ("true", PriorTable::Usual),
            ("\"usual\"", PriorTable::Usual),
            ("false", PriorTable::None),
            ("\"none\"", PriorTable::None),
            ("\"published\"", PriorTable::Published),
        ] {
            assert_eq!(parse(value).unwrap().priors, table, "{value}");
        }
        for value in ["\"publishd\"", "1", "[true]"] {
            let told = parse(value).unwrap_err().message().to_owned();
            assert!(told.contains("true, false") && told.contains("published"), "{value}: {told}");
        }
    }

    #[test]
    fn options_are_written_as_they_were_before_there_were_tables() {
        let written = |priors| toml::to_string(&CalibrateOptions { priors, ..Default::default() }).unwrap();
        assert!(toml::to_string(&CalibrateOptions::default()).unwrap().contains("\npriors = true\n"));
        for table in [PriorTable::Usual, PriorTable::None, PriorTable::Published] {
            let again: CalibrateOptions = toml::from_str(&written(table)).unwrap();
            assert_eq!(again.priors, table);
        }
        assert!(written(PriorTable::None).contains("\npriors = false\n"));
    }
}
