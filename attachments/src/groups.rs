//! The ligaments of the paper's tables, sums of bundles, and what else they are called in files that are read.

/// Groups of Tables 5 and 7 and their bundles.
pub const GROUPS: [(&str, &[&str]); 9] = [
    ("ACL", &["ACL_AM", "ACL_PL"]),
    ("ALS", &["ALS"]),
    ("LCL", &["LCL"]),
    ("sMCL", &["sMCL_A", "sMCL_M", "sMCL_P"]),
    ("dMCL", &["dMCL"]),
    ("POL", &["POL"]),
    ("PCAP", &["PCAP_M", "PCAP_L"]),
    ("PCL", &["PCL_AL", "PCL_PM"]),
    ("PFL", &["PFL"]),
];

/// Names by which files call a ligament, and the name that this program gives it: the paper's tables 5 and 7, and points of outlines, where the
/// ligament that shows is the superficial layer. Names of bundles in decks are with their reader.
const SYNONYMS: [(&str, &str); 3] = [("MCL_S", "sMCL"), ("MCL_D", "dMCL"), ("MCL", "sMCL")];

/// The program's name of a ligament that a file calls `name`; a name without a synonym is itself.
pub fn ligament_called(name: &str) -> &str {
    SYNONYMS.iter().find(|(theirs, _)| *theirs == name).map_or(name, |(_, ours)| ours)
}

/// Force of each group [N]; `bundles` are the names of the forces.
pub fn group_forces(bundles: &[String], forces_n: &[f64]) -> [f64; 9] {
    GROUPS.map(|(_, members)| {
        bundles.iter().zip(forces_n).filter(|(b, _)| members.contains(&b.as_str())).map(|(_, f)| f).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bundle::{BUNDLES, LIGAMENTS};

    #[test]
    fn a_ligament_has_one_name() {
        for bundle in BUNDLES.iter() {
            let held = GROUPS.iter().filter(|(_, members)| members.contains(&bundle.name.as_str())).count();
            assert_eq!(held, 1, "{}", bundle.name);
        }
        for (theirs, ours) in SYNONYMS {
            assert!(LIGAMENTS.contains(&ours) && !LIGAMENTS.contains(&theirs), "{theirs}");
            assert!(GROUPS.iter().all(|(name, _)| *name != theirs), "{theirs}");
            assert_eq!(ligament_called(theirs), ours);
        }
        assert_eq!(ligament_called("POL"), "POL");
    }
}
