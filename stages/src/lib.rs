//! The stages of the build: one public function each, from values to values. None opens a file.
//!
//! Order: ingest, register, bones, cartilage, frames, attachments, hexmesh, overclosure, contact-law (optional), assemble.
//!
//! Start with [`ingest::ingest`]; each stage takes the values of those before it.
//!
//! ```
//! use stages::ingest::ingest;
//! use stages::specimen::{IngestOptions, RawSpecimen};
//!
//! let files = stages::phantom::phantom("S192803-phantom", 1).unwrap().files;
//! let mut raw = RawSpecimen::default();
//! for (path, bytes) in files {
//!     if path == "specimen.toml" {
//!         raw.toml = String::from_utf8(bytes).unwrap();
//!     } else {
//!         raw.files.insert(path, bytes);
//!     }
//! }
//! let specimen = ingest(&raw, &IngestOptions::default()).unwrap();
//! assert!(specimen.ct.femur.volume() > 1e4); // [mm3]
//! ```

pub mod anatomy;
pub mod assemble;
pub mod attachments;
pub mod bones;
pub mod cartilage;
pub mod condyles;
pub mod contact_law;
pub mod eminences;
pub mod error;
pub mod frames;
pub mod guess;
pub mod hexmesh;
pub mod ingest;
pub mod menisci;
pub mod overclosure;
pub mod patellofemoral;
pub mod phantom;
pub mod plateaus;
pub mod register;
pub mod segment;
pub mod specimen;

pub use error::StageError;
use serde::{Deserialize, Serialize};

/// A value of each of the two bones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerBone<T> {
    /// The femur's.
    pub femur: T,
    /// The tibia-with-fibula's.
    pub tibfib: T,
}

/// A value of each of the three cartilages.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerCartilage<T> {
    /// The femur's.
    pub femur: T,
    /// The medial plateau's.
    pub tibia_medial: T,
    /// The lateral plateau's.
    pub tibia_lateral: T,
}

impl<T> PerBone<T> {
    /// The values with their names in files.
    pub fn named(&self) -> [(&'static str, &T); 2] {
        [("femur", &self.femur), ("tibfib", &self.tibfib)]
    }

    /// The value of a name in files.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.named().into_iter().find(|(n, _)| *n == name).map(|(_, value)| value)
    }
}

impl<T> PerCartilage<T> {
    /// The function's value of each.
    pub fn map<U>(&self, of: impl Fn(&T) -> U) -> PerCartilage<U> {
        PerCartilage {
            femur: of(&self.femur),
            tibia_medial: of(&self.tibia_medial),
            tibia_lateral: of(&self.tibia_lateral),
        }
    }

    /// The values with their names in files.
    pub fn named(&self) -> [(&'static str, &T); 3] {
        [("femur", &self.femur), ("tibia_medial", &self.tibia_medial), ("tibia_lateral", &self.tibia_lateral)]
    }

    /// The value of a name in files.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.named().into_iter().find(|(n, _)| *n == name).map(|(_, value)| value)
    }
}
