//! The integration tests of genu, one program: each further one would link everything again.

mod architecture;
mod bibliography;
mod calibrated;
mod cli;
mod common;
mod contact_law;
mod corruptions;
mod dependencies;
mod diagnose;
mod exports;
mod faults;
#[cfg(feature = "fetch")]
mod fetch;
mod first_hour;
mod inspect;
mod live;
mod living;
mod machine;
mod marks;
mod mistakes;
mod one_knee;
mod other_files;
mod paper;
mod parts;
mod phantom_laxity;
mod plan;
mod quirks;
mod readers;
mod report;
mod resume;
mod schema;
mod simulate;
mod traits;
mod variants;
mod volumes;
mod whole_path;
