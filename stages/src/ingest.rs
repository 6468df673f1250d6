//! Stage 1, ingest: the specimen's files become checked values in mm.

use crate::{PerBone, StageError};
use attachments::site::Fibre;
use meshes::Point;
use meshes::frame::Side;
use meshes::surface::{ColouredMesh, TriMesh};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What specimen.toml says (FORMAT 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimenFile {
    /// Who.
    pub specimen: Identity,
    /// Paths of the CT surfaces.
    pub ct: PerBonePath,
    /// Paths of the scans.
    pub scans: PerBonePath,
    /// Paths of marked points.
    #[serde(default)]
    pub points: PointPaths,
    /// Laxity data by name.
    #[serde(default)]
    pub laxity: BTreeMap<String, String>,
    /// Passive flexion data by name.
    #[serde(default)]
    pub passive: BTreeMap<String, String>,
    /// Where a bundle's parameters start.
    #[serde(default)]
    pub ligaments: BTreeMap<String, LigamentStart>,
    /// Options by stage, resolved by the pipeline.
    #[serde(default)]
    pub options: BTreeMap<String, toml::Table>,
}

/// Paths of the two bones' files, relative to the specimen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerBonePath {
    /// The femur's.
    pub femur: String,
    /// The tibia-with-fibula's.
    pub tibfib: String,
}

/// Paths of the optional point files.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointPaths {
    /// landmarks.csv
    pub landmarks: Option<String>,
    /// marks.csv
    pub marks: Option<String>,
    /// attachments.csv
    pub attachments: Option<String>,
}

/// The `[specimen]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Name.
    pub id: String,
    /// Which knee.
    pub side: Side,
    /// Table 1.
    pub sex: Option<String>,
    /// Table 1 [years].
    pub age_years: Option<f64>,
    /// Table 1 [cm].
    pub height_cm: Option<f64>,
    /// Table 1 [kg].
    pub mass_kg: Option<f64>,
    /// published, synthetic or own.
    pub provenance: Option<String>,
    /// A line of text.
    pub note: Option<String>,
}

/// The `[ligaments.BUNDLE]` tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LigamentStart {
    /// Reference strain [-].
    pub reference_strain: Option<f64>,
    /// Stiffness of the bundle [N/mm].
    pub stiffness_n_per_mm: Option<f64>,
}

/// The frame a point is given in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointFrame {
    /// CT.
    Ct,
    /// The femur's scan.
    ScanFemur,
    /// The tibia-with-fibula's scan.
    ScanTibfib,
}

/// A row of landmarks.csv or marks.csv.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedPoint {
    /// Landmark or ligament name.
    pub name: String,
    /// Its frame.
    pub frame: PointFrame,
    /// Its place [mm].
    pub point: Point,
}

/// The files of a specimen as read, before any is believed: what the store hands to [`ingest`].
#[derive(Clone, Debug, Default)]
pub struct RawSpecimen {
    /// specimen.toml.
    pub toml: String,
    /// Every file it names (and textures those name), by path relative to the specimen.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// The specimen: checked, in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Specimen {
    /// Who.
    pub identity: Identity,
    /// CT surfaces, CT frame, as segmented but welded and consistently outward where they can be.
    pub ct: PerBone<TriMesh>,
    /// Scans, each in its scanner's frame.
    pub scans: PerBone<ColouredMesh>,
    /// Landmarks, any frame.
    pub landmarks: Vec<NamedPoint>,
    /// Marked sites.
    pub marks: Vec<NamedPoint>,
    /// Fibres given by hand.
    pub given_fibres: Vec<Fibre>,
    /// Where bundles' parameters start.
    pub ligaments: BTreeMap<String, LigamentStart>,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// Counts for metrics.json.
    pub metrics: serde_json::Value,
}

#[doc(hidden)]
pub type IngestResult = Result<Specimen, StageError>;
