//! What the paper reports of its two specimens [andreassen2025, tables 4 to 7, section 3].

use attachments::groups::ligament_called;
use serde::{Deserialize, Deserializer};
use sim::laxity::Test;
use sim::spec::PoseSpec;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// All of it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Table 4.
    pub parameters: Vec<Parameters>,
    /// Table 5.
    pub ap_forces: Vec<ApForces>,
    /// Tables 6 and 7.
    pub pivot_shift: Vec<PivotShift>,
    /// KLA against RKS.
    pub rmsd: Vec<Rmsd>,
}

/// A column of Table 4.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    specimen: String,
    source: String,
    /// X1 to X26 [-, then N/mm].
    pub values: Vec<f64>,
}

/// A row of Table 5.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApForces {
    specimen: String,
    source: String,
    test: Test,
    flexion_deg: f64,
    /// By group [N]; below 5 N left out.
    #[serde(deserialize_with = "by_ligament")]
    pub forces_n: BTreeMap<String, f64>,
}

/// A row of Tables 6 and 7.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PivotShift {
    specimen: String,
    source: String,
    acl: bool,
    /// Whether the paper marks it as a dislocation.
    pub dislocated: bool,
    /// FE, VV, IE [deg], ML, AP, SI [mm].
    pose: [f64; 6],
    /// By group [N].
    #[serde(deserialize_with = "by_ligament")]
    pub forces_n: BTreeMap<String, f64>,
}

/// Forces under the program's names of the paper's groups.
fn by_ligament<'de, D: Deserializer<'de>>(from: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let theirs = BTreeMap::<String, f64>::deserialize(from)?;
    Ok(theirs.into_iter().map(|(name, force)| (ligament_called(&name).to_owned(), force)).collect())
}

impl PivotShift {
    /// The pose of Table 6.
    pub fn pose(&self) -> PoseSpec {
        let [fe_deg, vv_deg, ie_deg, ml_mm, ap_mm, si_mm] = self.pose;
        PoseSpec { fe_deg, vv_deg, ie_deg, ml_mm, ap_mm, si_mm }
    }
}

/// Differences between the KLA and the RKS model of a specimen, section 3.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rmsd {
    specimen: String,
    /// AP under the anterior load [mm].
    pub anterior_ap_mm: f64,
    /// AP under the posterior load [mm].
    pub posterior_ap_mm: f64,
    /// AP of passive flexion [mm].
    pub passive_ap_mm: f64,
    /// IE of passive flexion [deg].
    pub passive_ie_deg: f64,
    /// VV of passive flexion [deg].
    pub passive_vv_deg: f64,
    /// Ligament forces of the AP tests [N].
    pub ap_forces_n: f64,
}

/// The tables of the paper, as they are shipped.
pub const TABLES: &str = include_str!("../data/published.toml");

/// The data file.
static PUBLISHED: LazyLock<Published> =
    LazyLock::new(|| toml::from_str(TABLES).expect("the tables shipped with the program parse"));

/// The paper's name of a specimen; `None` of any other.
pub fn title(specimen: &str) -> Option<&'static str> {
    match specimen {
        "S192803" => Some("Specimen 1"),
        "S193761" => Some("Specimen 2"),
        _ => None,
    }
}

/// Table 4's column of a specimen and source.
pub fn parameters(specimen: &str, source: &str) -> Option<&'static [f64]> {
    let is = |p: &&Parameters| p.specimen == specimen && p.source == source;
    PUBLISHED.parameters.iter().find(is).map(|p| p.values.as_slice())
}

/// Table 5's row.
pub fn ap_forces(specimen: &str, source: &str, test: Test, flexion_deg: f64) -> Option<&'static ApForces> {
    let is = |p: &&ApForces| {
        p.specimen == specimen && p.source == source && p.test == test && (p.flexion_deg - flexion_deg).abs() < 1.5
    };
    PUBLISHED.ap_forces.iter().find(is)
}

/// The row of Tables 6 and 7.
pub fn pivot_shift(specimen: &str, source: &str, acl: bool) -> Option<&'static PivotShift> {
    PUBLISHED.pivot_shift.iter().find(|p| p.specimen == specimen && p.source == source && p.acl == acl)
}

/// KLA against RKS.
pub fn rmsd(specimen: &str) -> Option<&'static Rmsd> {
    PUBLISHED.rmsd.iter().find(|p| p.specimen == specimen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use attachments::groups::GROUPS;

    #[test]
    fn every_cell_of_the_tables_is_there() {
        assert_eq!((PUBLISHED.parameters.len(), PUBLISHED.ap_forces.len(), PUBLISHED.pivot_shift.len()), (4, 24, 8));
        assert!(PUBLISHED.parameters.iter().all(|p| p.values.len() == 26));
        let groups = PUBLISHED.ap_forces.iter().flat_map(|p| p.forces_n.keys());
        let known = |g: &String| GROUPS.iter().any(|(name, _)| name == g);
        assert!(groups.chain(PUBLISHED.pivot_shift.iter().flat_map(|p| p.forces_n.keys())).all(known));
        assert_eq!(parameters("S193761", "rks").unwrap()[2], 1.06);
        assert_eq!(ap_forces("S192803", "kla", Test::Anterior, 30.0).unwrap().forces_n["ACL"], 163.4);
        assert!(pivot_shift("S193761", "kla", false).unwrap().dislocated);
        assert!(parameters("S1", "rks").is_none());
    }

    #[test]
    fn the_papers_force_difference_is_the_root_mean_square_over_all_groups_and_tests() {
        let mut sum = 0.0;
        for (test, fe) in [Test::Anterior, Test::Posterior].iter().flat_map(|t| [30.0, 60.0, 90.0].map(|fe| (*t, fe))) {
            let of = |source: &str, g: &str| {
                let row = ap_forces("S192803", source, test, fe).unwrap();
                row.forces_n.get(g).copied().unwrap_or(0.0)
            };
            sum += GROUPS.iter().map(|(g, _)| (of("kla", g) - of("rks", g)).powi(2)).sum::<f64>();
        }
        assert!(((sum / 54.0).sqrt() - rmsd("S192803").unwrap().ap_forces_n).abs() < 0.05);
    }
}
