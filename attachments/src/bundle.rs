//! The fourteen ligament bundles of Table 3 [andreassen2025]: names, fibre counts, parameter ranges, as data.

use serde::Deserialize;
use std::sync::LazyLock;

/// A design variable's number and range.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Number n of the design variable X_n of Table 3.
    pub variable: u32,
    /// Smallest value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
}

impl Range {
    /// The middle of the range.
    pub fn middle(&self) -> f64 {
        f64::midpoint(self.lower, self.upper)
    }
}

/// A row of Table 3.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bundle {
    /// Bundle name, as everywhere in files.
    pub name: String,
    /// The ligament whose site the bundle attaches to.
    pub ligament: String,
    /// Number of fibres.
    pub fibres: usize,
    /// Reference strain [-], 1 = just taut in the CT pose.
    pub reference_strain: Range,
    /// Stiffness of the whole bundle [N/mm].
    pub stiffness_n_per_mm: Range,
}

/// Table 3, as it is shipped.
pub const TABLE_3: &str = include_str!("../data/table3.toml");

/// The rows of Table 3, in its order.
pub static BUNDLES: LazyLock<Vec<Bundle>> = LazyLock::new(|| {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Table {
        bundle: Vec<Bundle>,
    }
    let table: Table = toml::from_str(TABLE_3).expect("the table shipped with the program parses");
    table.bundle
});

/// The ten ligaments, each with one site a bone.
pub const LIGAMENTS: [&str; 10] = ["ACL", "PCL", "LCL", "sMCL", "dMCL", "ALS", "PFL", "POL", "PCAP_M", "PCAP_L"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_3_has_14_bundles_30_fibres_and_26_variables() {
        assert_eq!(BUNDLES.len(), 14);
        assert_eq!(BUNDLES.iter().map(|b| b.fibres).sum::<usize>(), 30);
        let mut variables: Vec<u32> =
            BUNDLES.iter().flat_map(|b| [b.reference_strain.variable, b.stiffness_n_per_mm.variable]).collect();
        variables.sort_unstable();
        variables.dedup();
        assert_eq!(variables, (1..=26).collect::<Vec<_>>());
        assert!(BUNDLES.iter().all(|b| LIGAMENTS.contains(&b.ligament.as_str())));
    }
}
