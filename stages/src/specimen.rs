//! A specimen: what specimen.toml says, its files as read, and its checked values in mm.

mod mri;

pub use mri::{CartilageFrame, CartilagePaths, LabelName, Mri, SegmentationPaths};
use notices::Notice;

use crate::PerBone;
use crate::PerCartilage;
use crate::frames::given::GivenFrames;
use attachments::site::Fibre;
use meshes::Point;
use meshes::frame::Side;
use meshes::surface::{ColouredMesh, TriMesh};
use serde::{Deserialize, Serialize};
use sim::laxity::LaxityFormat;
use std::collections::BTreeMap;

/// What specimen.toml says (FORMAT 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimenFile {
    /// Who.
    pub specimen: Identity,
    /// Paths of the CT surfaces, or of the CT volume.
    #[serde(default)]
    pub ct: CtPaths,
    /// Paths of the scans.
    pub scans: Option<ScanPaths>,
    /// A label map of MRI in place of scans, and of CT where that is not given.
    pub segmentation: Option<SegmentationPaths>,
    /// Surfaces of cartilage in place of scans.
    pub cartilage: Option<CartilagePaths>,
    /// Paths of marked points.
    #[serde(default)]
    pub points: PointPaths,
    /// Laxity data by name.
    #[serde(default)]
    pub laxity: BTreeMap<String, String>,
    /// Shapes of laxity files that are not the standard one, by the names of [`SpecimenFile::laxity`].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub laxity_format: BTreeMap<String, LaxityFormat>,
    /// Passive flexion data by name.
    #[serde(default)]
    pub passive: BTreeMap<String, String>,
    /// The laboratory's own frames.
    #[serde(default)]
    pub frames: Option<FramesPath>,
    /// Where a bundle's parameters start.
    #[serde(default)]
    pub ligaments: BTreeMap<String, LigamentStart>,
    /// Options by stage, resolved by the pipeline.
    #[serde(default)]
    pub options: BTreeMap<String, toml::Table>,
}

/// Paths of what CT gave, relative to the specimen: both surfaces, or a volume.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CtPaths {
    /// The femur's surface.
    pub femur: Option<String>,
    /// The tibia-with-fibula's surface.
    pub tibfib: Option<String>,
    /// The patella's surface, if it is to be carried along.
    pub patella: Option<String>,
    /// A CT volume of the knee: a NIfTI, NRRD or MetaImage file, or a folder with a DICOM series.
    pub volume: Option<String>,
    /// A label map of the volume, made or mended by hand (NIfTI, NRRD, MetaImage).
    pub labels: Option<String>,
}

impl CtPaths {
    /// Whether nothing is named.
    pub fn is_empty(&self) -> bool {
        *self == CtPaths::default()
    }

    /// Keys and paths of the two surfaces: given, or those stage 0 finds in the volume.
    pub fn surfaces(&self) -> PerBone<String> {
        let path = |given: &Option<String>, found: &str| given.clone().unwrap_or_else(|| found.to_string());
        PerBone { femur: path(&self.femur, SEGMENTED[0]), tibfib: path(&self.tibfib, SEGMENTED[1]) }
    }
}

/// Where the surfaces that stage 0 found stand among a specimen's files: femur, tibia-with-fibula.
pub const SEGMENTED: [&str; 2] = ["00-segment/femur.stl", "00-segment/tibfib.stl"];

/// Where the surface of the patella that stage 0 found stands among a specimen's files.
pub const SEGMENTED_PATELLA: &str = "00-segment/patella.stl";

/// Paths of the scans, relative to the specimen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanPaths {
    /// The femur's: one, or several that overlap.
    pub femur: Pieces,
    /// The tibia-with-fibula's: one, or several that overlap.
    pub tibfib: Pieces,
    /// The patella's.
    pub patella: Option<String>,
    /// The knee's with its capsule on: checks the registration, nothing else.
    pub capsule: Option<String>,
}

/// A bone's scan, or several that overlap; points of the scan's frame are of the first one's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a path, or a list of paths of scans that overlap")]
pub enum Pieces {
    /// All in one.
    One(String),
    /// Several, each in a frame of its own.
    Several(Vec<String>),
}

impl Pieces {
    /// The paths.
    pub fn paths(&self) -> &[String] {
        match self {
            Pieces::One(path) => std::slice::from_ref(path),
            Pieces::Several(paths) => paths,
        }
    }
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

/// The `[frames]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FramesPath {
    /// A file in the shape of 05-frames/frames.json, CT frame.
    pub file: String,
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
    /// Scans, each in its scanner's frame; where cartilage comes of MRI, the bones as MRI shows them.
    pub scans: PerBone<ColouredMesh>,
    /// Cartilage of MRI, where it comes without scans.
    #[serde(default)]
    pub mri: Option<Mri>,
    /// The patella, if there is one.
    #[serde(default)]
    pub patella: Option<Patella>,
    /// The scan with the capsule on, in its scanner's frame, if there is one.
    #[serde(default)]
    pub capsule: Option<TriMesh>,
    /// Landmarks, any frame.
    pub landmarks: Vec<NamedPoint>,
    /// Marked sites.
    pub marks: Vec<NamedPoint>,
    /// Fibres given by hand.
    pub given_fibres: Vec<Fibre>,
    /// The laboratory's own frames, CT frame.
    #[serde(default)]
    pub given_frames: Option<GivenFrames>,
    /// Where bundles' parameters start.
    pub ligaments: BTreeMap<String, LigamentStart>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: IngestMetrics,
}

/// Counts of what was read, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IngestMetrics {
    /// Of the femur's CT surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ct_femur: Option<SurfaceMetrics>,
    /// Of the tibia's and fibula's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ct_tibfib: Option<SurfaceMetrics>,
    /// Of the femur's scan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_femur: Option<SurfaceMetrics>,
    /// Of the tibia's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_tibfib: Option<SurfaceMetrics>,
    /// Of what MRI shows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mri: Option<MriMetrics>,
    /// Landmarks.
    pub landmarks: usize,
    /// Marks.
    pub marks: usize,
    /// Fibres given by hand.
    pub given_fibres: usize,
}

/// Counts of a surface, and what was put right.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceMetrics {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Its middle extent [mm].
    pub width_mm: f64,
    /// Vertices that no triangle uses.
    pub dropped_vertices: usize,
    /// Triangles without area that were dropped.
    pub degenerate_triangles: usize,
    /// Doubled triangles that were dropped.
    pub doubled_triangles: usize,
    /// Triangles that were turned outward.
    pub turned_triangles: usize,
    /// Cavities inside.
    pub cavities: usize,
    /// Open edges.
    pub boundary_edges: usize,
    /// Edges of more than two triangles, or of two turned alike.
    pub irregular_edges: usize,
    /// Pieces.
    pub components: usize,
    /// Whether it has colours.
    pub coloured: bool,
    /// Pieces that were joined to it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub merged: Vec<MergedPiece>,
}

/// A piece of a scan that was joined to the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MergedPiece {
    /// Its file.
    pub path: String,
    /// Share that the others show, too [-].
    pub overlap_fraction: f64,
    /// Distance there, root mean square [mm].
    pub overlap_rms_mm: f64,
    /// Triangles that only it shows.
    pub added_triangles: usize,
}

/// Figures of a label map, or of surfaces of cartilage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MriMetrics {
    /// Voxels along each axis of a label map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voxels: Option<[usize; 3]>,
    /// Their size [mm].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing_mm: Option<[f64; 3]>,
    /// Volume of each label [mm3].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub label_volume_mm3: BTreeMap<String, f64>,
    /// Volume of each surface of cartilage [mm3].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cartilage_volume_mm3: Option<PerCartilage<f64>>,
}

/// A patella: carried along, without a part in any simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Patella {
    /// Its CT surface, CT frame.
    pub ct: TriMesh,
    /// Its scan, in the scanner's frame, if there is one.
    pub scan: Option<ColouredMesh>,
}

/// What a specimen may look like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IngestOptions {
    /// Smallest width of a bone, the middle one of its principal extents, that is taken for millimetres [mm]; a knee's is
    /// 60 to 110 (epicondylar width 73 to 93 in the VSD femora, doi 10.1038/s41597-023-02669-z).
    pub least_width_mm: f64,
    /// Largest such width [mm].
    pub greatest_width_mm: f64,
    /// Blur of a label map before its surfaces are drawn, in its largest voxel spacings [-]: takes the steps between slices away; our own trials.
    pub label_blur: f64,
    /// Edges of surfaces drawn from a label map [mm]: half of the model's bones'.
    pub label_edge_mm: f64,
    /// Inputs that are in RAS where their files cannot say so (STL, PLY, OBJ, CSV): any of ct, cartilage, points. A file that says its frame is heard.
    pub ras: Vec<String>,
}

/// What [`IngestOptions::ras`] may name: tables of specimen.toml.
pub const RAS_INPUTS: [&str; 3] = ["ct", "cartilage", "points"];

impl IngestOptions {
    /// Whether the inputs of a table are in RAS unless their files say otherwise.
    pub fn is_ras(&self, table: &str) -> bool {
        self.ras.iter().any(|r| r == table)
    }
}

impl Default for IngestOptions {
    fn default() -> Self {
        IngestOptions {
            least_width_mm: 35.0,
            greatest_width_mm: 200.0,
            label_blur: 0.7,
            label_edge_mm: 0.7,
            ras: vec![],
        }
    }
}
