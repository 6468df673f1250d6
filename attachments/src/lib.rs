//! Ligament attachments: marks on a scan, sites on a bone, the literature atlas (Table 2 as data), bundles and fibres.

pub mod atlas;
pub mod bundle;
pub mod groups;
pub mod layout;
pub mod lengths;
pub mod marks;
pub mod naming;
pub mod site;
