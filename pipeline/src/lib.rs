//! The build of a knee model from a specimen: the order of the work, files, command line, report.
//!
//! Start with [`run::run`], one build; [`build::build_model`] shows the order of the work.
//!
//! ```
//! let text = genu::option_docs::options(Some("hexmesh"), false, false).unwrap();
//! assert!(text.contains("hexmesh.edge_length_mm"));
//! ```

pub(crate) mod again;
pub(crate) mod bands;
pub(crate) mod beyond;
pub mod blind;
pub mod build;
pub mod build_args;
pub mod calibrate;
pub mod check;
pub mod cli;
pub mod cohort;
pub mod credibility;
pub mod diagnose;
mod diagnosis_files;
pub mod error;
pub mod exports;
#[cfg_attr(not(feature = "fetch"), path = "fetch/without.rs")]
pub mod fetch;
pub mod given;
pub mod import;
pub mod init;
pub mod inspect;
pub mod interrupted;
pub mod kept;
pub mod manual;
pub mod model_file;
pub mod next_tests;
mod numbers;
pub mod open;
pub mod option_docs;
pub mod options;
mod out_folder;
pub mod output;
pub mod paper;
pub mod phantom;
pub mod plan;
pub mod progress;
pub mod record;
pub mod report;
pub mod run;
pub mod run_log;
pub mod schema;
pub mod simulate;
pub(crate) mod stage;
pub mod stale;
pub mod store;
pub mod suggested;
mod thin;
pub mod told;
pub mod validate;
pub mod which_model;
