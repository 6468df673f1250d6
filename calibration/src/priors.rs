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
    /// calibration/data/priors-read.toml: what was read in a source, the usual where nothing was.
    #[serde(rename = "read")]
    Read,
}

/// A table as options name it.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected true, false, or a table of priors: usual, none, published, read")]
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
            "read" => Ok(PriorTable::Read),
            _ => Err(format!(
                "no table of priors is called {name:?}; expected true, false, usual, none, published or read"
            )),
        }
    }
}

impl From<PriorTable> for Given {
    fn from(table: PriorTable) -> Given {
        match table {
            PriorTable::Usual => Given::Switch(true),
            PriorTable::None => Given::Switch(false),
            PriorTable::Published => Given::Name("published".into()),
            PriorTable::Read => Given::Name("read".into()),
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
            PriorTable::Read => Some(&READ),
        }
    }

    /// What it believes of forces.
    pub fn forces(self) -> &'static [ForcePrior] {
        self.priors().map_or(&[], |p| &p.force)
    }

    /// The standard deviation with which a belief of the table counts at each of its flexions [N]. What a ligament does in a drawer is one property of a knee: two
    /// knees of [andreassen2025, table 5] do at 60 and 90 deg as at 30. So it counts once, however many flexions the table names: the sum of the precisions is
    /// that of one belief.
    pub fn sd_at_each_n(self, of: &ForcePrior) -> f64 {
        let same = self.forces().iter().filter(|f| (&f.ligament, f.test) == (&of.ligament, of.test));
        of.sd_n * (same.map(|f| f.flexion_deg.len()).sum::<usize>() as f64).sqrt()
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
    /// How it was read: text, abstract, model (a published model's file), ours (no source says it), memory.
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
    /// How it was read: text, abstract, model (a published model's file), ours (no source says it), memory.
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

/// Priors of what was read in its source, and the usual where nothing was.
static READ: LazyLock<Priors> = LazyLock::new(|| {
    toml::from_str(include_str!("../data/priors-read.toml")).expect("the priors that were read parse")
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Kind};
    use crate::options::CalibrateOptions;

    /// All ways in which a figure was read.
    const WAYS: [&str; 5] = ["text", "abstract", "model", "ours", "memory"];
    /// The tables, in the order of the page's columns.
    const TABLES: [PriorTable; 3] = [PriorTable::Usual, PriorTable::Published, PriorTable::Read];

    fn check(table: &Priors, ways: &[&str]) {
        let design = Design::table3();
        for (bundle, prior) in &table.reference_strain {
            let of = |v: &&crate::design::Variable| v.kind == Kind::ReferenceStrain && v.bundles.contains(bundle);
            let v = design.variables.iter().find(of).unwrap();
            assert!(v.lower < prior.mean && prior.mean < v.upper && prior.sd > 0.0, "{bundle}");
            assert!(ways.contains(&prior.read.as_str()), "{bundle}: {}", prior.read);
            assert_eq!(prior.read == "ours", prior.source.starts_with("ours"), "{bundle}: {}", prior.source);
        }
        let names: Vec<String> = design.variables.iter().flat_map(|v| v.bundles.clone()).collect();
        for f in &table.force {
            assert!(names.iter().any(|n| f.is_of(n)), "{}", f.ligament);
            assert!(f.sd_n > 0.0 && ways.contains(&f.read.as_str()), "{}: {}", f.ligament, f.read);
            assert_eq!(f.read == "ours", f.source.starts_with("ours"), "{}: {}", f.ligament, f.source);
        }
    }

    /// A table's beliefs about forces, one by one: ligament, test and flexion.
    fn beliefs(table: &Priors) -> BTreeMap<(String, String, String), &ForcePrior> {
        let each = |f: &ForcePrior, deg: &f64| (f.ligament.clone(), f.test.name().to_string(), deg.to_string());
        let mut out = BTreeMap::new();
        for f in &table.force {
            for deg in &f.flexion_deg {
                assert!(out.insert(each(f, deg), f).is_none(), "{} at {deg} deg is believed twice", f.ligament);
            }
        }
        out
    }

    /// Cells of the page's table below this line, a row each.
    fn rows(header: &str) -> Vec<Vec<String>> {
        let below = include_str!("../../docs/theory/priors.md")
            .lines()
            .skip_while(|l| *l != header)
            .skip(2)
            .take_while(|l| l.starts_with('|'));
        let rows: Vec<Vec<String>> =
            below.map(|l| l.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect()).collect();
        assert!(!rows.is_empty(), "no table below {header}");
        rows
    }

    #[test]
    fn every_bundle_has_a_usual_prior_within_table_3_and_every_belief_a_ligament() {
        check(&PRIORS, &WAYS);
        check(&READ, &WAYS);
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
    fn a_belief_of_a_drawer_counts_once_however_many_flexions_it_names() {
        for table in TABLES {
            let mut precisions: BTreeMap<(&str, &str), (f64, [f64; 2])> = BTreeMap::new();
            for f in table.forces() {
                let (sum, ends) = precisions.entry((&f.ligament, f.test.name())).or_insert((0.0, [f64::INFINITY, 0.0]));
                *sum += f.flexion_deg.len() as f64 / table.sd_at_each_n(f).powi(2);
                let own = 1.0 / f.sd_n.powi(2);
                *ends = [ends[0].min(own), ends[1].max(own)];
            }
            for (about, (sum, [least, most])) in precisions {
                let once = least * (1.0 - 1e-12) <= sum && sum <= most * (1.0 + 1e-12);
                assert!(once, "{about:?}: {sum} is not between {least} and {most}");
            }
        }
    }

    #[test]
    fn the_table_of_what_was_read_is_the_usual_one_wherever_nothing_was() {
        let unread = |read: &str| read == "ours" || read == "memory";
        for (bundle, usual) in &PRIORS.reference_strain {
            let now = &READ.reference_strain[bundle];
            let same = (now.mean, now.sd) == (usual.mean, usual.sd);
            assert!(same || !unread(&now.read), "{bundle} differs, and nobody says so: {}", now.source);
        }
        let now = beliefs(&READ);
        for (about, usual) in beliefs(&PRIORS) {
            let of = |f: &ForcePrior| (f.mean_n, f.sd_n, f.only_above);
            let read = now.get(&about).copied().unwrap_or_else(|| panic!("{about:?} is no more believed"));
            assert!(of(read) == of(usual) || !unread(&read.read), "{about:?} differs, and nobody says so");
        }
        assert_ne!(*READ, *PRIORS);
    }

    #[test]
    fn the_page_has_the_strains_of_each_table() {
        let rows = rows("| bundle | usual | published | read |");
        let told: Vec<&String> = rows.iter().map(|r| &r[0]).collect();
        for bundle in PRIORS.reference_strain.keys() {
            assert_eq!(told.iter().filter(|b| **b == bundle).count(), 1, "{bundle}");
        }
        for row in &rows {
            for (table, cell) in TABLES.iter().zip(&row[1..]) {
                let prior = table.reference_strain(&row[0]);
                let now = prior.map_or("even".to_owned(), |p| format!("{} ± {}, {}", p.mean, p.sd, p.read));
                assert_eq!(*cell, now, "{} of {table:?}", row[0]);
            }
        }
    }

    #[test]
    fn the_page_has_the_forces_of_each_table() {
        let rows = rows("| ligament | drawer | flexion, deg | usual | published | read |");
        for (t, table) in TABLES.iter().enumerate() {
            let mut left = beliefs(table.priors().unwrap());
            for row in &rows {
                for deg in row[2].split(", ") {
                    let about = (row[0].clone(), row[1].clone(), deg.to_owned());
                    let now = left.remove(&about).map_or("none".to_owned(), |f| {
                        let side = if f.only_above { ", one-sided" } else { " ±" };
                        format!("{}{side} {}, {}", f.mean_n, f.sd_n, f.read)
                    });
                    assert_eq!(row[3 + t], now, "{about:?} of {table:?}");
                }
            }
            assert!(left.is_empty(), "{table:?}: not on the page: {:?}", left.keys());
        }
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
            ("\"read\"", PriorTable::Read),
        ] {
            assert_eq!(parse(value).unwrap().priors, table, "{value}");
        }
        for value in ["\"publishd\"", "1", "[true]"] {
            let told = parse(value).unwrap_err().message().to_owned();
            assert!(
                told.contains("true, false") && told.contains("published") && told.contains("read"),
                "{value}: {told}"
            );
        }
    }

    #[test]
    fn options_are_written_as_they_were_before_there_were_tables() {
        let written = |priors| toml::to_string(&CalibrateOptions { priors, ..Default::default() }).unwrap();
        assert!(toml::to_string(&CalibrateOptions::default()).unwrap().contains("\npriors = true\n"));
        for table in [PriorTable::Usual, PriorTable::None, PriorTable::Published, PriorTable::Read] {
            let again: CalibrateOptions = toml::from_str(&written(table)).unwrap();
            assert_eq!(again.priors, table);
        }
        assert!(written(PriorTable::None).contains("\npriors = false\n"));
    }
}
