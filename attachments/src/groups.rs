//! The ligaments of the paper's tables, sums of bundles.

/// Groups of Tables 5 and 7 and their bundles.
pub const GROUPS: [(&str, &[&str]); 9] = [
    ("ACL", &["ACL_AM", "ACL_PL"]),
    ("ALS", &["ALS"]),
    ("LCL", &["LCL"]),
    ("MCL_S", &["sMCL_A", "sMCL_M", "sMCL_P"]),
    ("MCL_D", &["dMCL"]),
    ("POL", &["POL"]),
    ("PCAP", &["PCAP_M", "PCAP_L"]),
    ("PCL", &["PCL_AL", "PCL_PM"]),
    ("PFL", &["PFL"]),
];

/// Force of each group [N]; `bundles` are the names of the forces.
pub fn group_forces(bundles: &[String], forces_n: &[f64]) -> [f64; 9] {
    GROUPS.map(|(_, members)| {
        bundles.iter().zip(forces_n).filter(|(b, _)| members.contains(&b.as_str())).map(|(_, f)| f).sum()
    })
}
