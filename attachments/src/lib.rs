//! Ligament attachments: marks on a scan, sites on a bone, the literature atlas (Table 2 as data), bundles and fibres.
//!
//! Start with [`bundle::BUNDLES`] (Table 3) and [`atlas`] (Table 2); [`marks`] finds outlines of attachment sites on a coloured scan.
//!
//! ```
//! let posterior: Vec<&str> = attachments::bundle::BUNDLES.iter().filter(|b| b.ligament == "PCL").map(|b| b.name.as_str()).collect();
//! assert_eq!(posterior, ["PCL_AL", "PCL_PM"]);
//! ```

pub mod atlas;
pub mod bundle;
pub mod groups;
pub mod layout;
pub mod lengths;
pub mod marks;
pub mod naming;
pub mod site;
