//! Where the ligaments attach on the phantom, as the dissections describe it.
//!
//! Femur: distances from the epicondyles after [laprade2003], [laprade2007]; cruciates on the walls of the notch. Tibia: sMCL
//! about 61 mm below the joint line, LCL on the fibular head, cruciates before and behind the spines.

/// A site: ligament, place to look for the surface (lateral, anterior, superior, mm, of a knee 88 mm wide), half height
/// and half width of its outline [mm], whether it is outlined on the scan.
pub(super) type Recipe = (&'static str, [f64; 3], [f64; 2], bool);

/// Sites of the femur.
pub(super) const FEMUR: [Recipe; 10] = [
    ("ACL", [10.5, -6.0, -2.0], [6.5, 4.0], true),
    ("PCL", [-10.0, 1.5, -5.5], [6.5, 4.5], true),
    ("LCL", [46.0, 0.0, 2.0], [4.0, 3.5], true),
    ("sMCL", [-47.0, -3.0, 4.0], [4.0, 6.0], true),
    ("dMCL", [-46.0, -1.0, -4.5], [3.0, 5.0], false),
    ("ALS", [45.0, -1.5, 5.5], [2.0, 3.0], false),
    ("PFL", [43.0, 5.0, -7.0], [3.0, 3.0], false),
    ("POL", [-44.0, -11.0, 7.0], [2.0, 3.0], false),
    ("PCAP_M", [-24.0, -18.0, 17.0], [2.0, 8.0], false),
    ("PCAP_L", [24.0, -17.0, 17.0], [2.0, 8.0], false),
];

/// Sites of the tibia with the fibula.
pub(super) const TIBFIB: [Recipe; 10] = [
    ("ACL", [-1.0, 13.0, 3.0], [6.0, 4.5], true),
    ("PCL", [0.0, -25.0, -11.0], [5.0, 5.0], true),
    ("LCL", [54.0, -10.0, -29.0], [4.0, 3.5], true),
    ("sMCL", [-18.0, 7.0, -62.0], [6.0, 4.0], true),
    ("dMCL", [-40.0, -3.0, -9.0], [2.5, 5.0], false),
    ("ALS", [40.0, 2.0, -10.0], [2.0, 3.0], false),
    ("PFL", [43.0, -25.0, -16.0], [3.0, 3.0], false),
    ("POL", [-34.0, -19.0, -8.0], [2.0, 3.0], false),
    ("PCAP_M", [-19.0, -27.0, -12.0], [2.0, 8.0], false),
    ("PCAP_L", [18.0, -27.0, -12.0], [2.0, 8.0], false),
];
