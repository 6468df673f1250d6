//! Stage 1, ingest: the specimen's files become checked values in mm.

mod file;
mod merge;
mod mri;
mod points;
mod slicer;
mod space;
mod surfaces;

pub use file::{OPTIONAL_PATHS, named, parse_specimen_file, paths_named_by, paths_named_in};
pub use mri::{CartilageFrame, CartilagePaths, LabelName, Mri, SegmentationPaths};
pub use surfaces::{Judged, judge_surfaces, middle_extent};

use crate::frames::{self, given::GivenFrames};
use crate::{PerBone, StageError};
use attachments::bundle::BUNDLES;
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
    pub warnings: Vec<String>,
    /// Counts for metrics.json.
    pub metrics: serde_json::Value,
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
}

impl Default for IngestOptions {
    fn default() -> Self {
        IngestOptions { least_width_mm: 35.0, greatest_width_mm: 200.0, label_blur: 0.7, label_edge_mm: 0.7 }
    }
}

/// Turns the files of a specimen into checked values in mm.
///
/// Surfaces are welded, freed of triangles without area and turned outward; holes and loose pieces stay, counted.
/// Anatomy (side, exchanged bones) is not looked at here but where frames are assigned.
///
/// # Errors
/// A missing or unreadable file, an unknown key, name or unit: with file, line or element, what was expected, what to do.
pub fn ingest(raw: &RawSpecimen, options: &IngestOptions) -> Result<Specimen, StageError> {
    let file = parse_specimen_file(&raw.toml)?;
    let mut warnings = Vec::new();
    file::check_present(&file, raw)?;
    let surface =
        |key: &str, path: &str, warnings: &mut Vec<String>| surfaces::checked(key, path, &raw.files, options, warnings);
    let sources = sources(&file, raw, options, &mut warnings, &surface)?;
    let landmarks = points::landmarks(&file, raw)?;
    warnings.extend(points::missing(&file, raw, &landmarks));
    let marks = points::marks(&file, raw)?;
    let given_fibres = points::fibres(&file, raw)?;
    let given_frames = match &file.frames {
        Some(f) => Some(frames::given::read(&f.file, &raw.files[&f.file])?),
        None => None,
    };
    for bundle in BUNDLES.iter() {
        let given = given_fibres.iter().filter(|f| f.bundle == bundle.name).count();
        if given > 0 && given != bundle.fibres {
            warnings
                .push(format!("attachments.csv gives {} {given} fibres, Table 3 has {}", bundle.name, bundle.fibres));
        }
    }
    space::check(&sources.ct, [&landmarks, &marks])?;
    let mut metrics = sources.metrics;
    metrics["landmarks"] = landmarks.len().into();
    metrics["marks"] = marks.len().into();
    metrics["given_fibres"] = given_fibres.len().into();
    Ok(Specimen {
        identity: file.specimen,
        ct: sources.ct,
        scans: sources.scans,
        mri: sources.mri,
        patella: sources.patella,
        capsule: sources.capsule,
        landmarks,
        marks,
        given_fibres,
        given_frames,
        ligaments: file.ligaments,
        warnings,
        metrics,
    })
}

/// What shows bones and cartilage.
struct Sources {
    ct: PerBone<TriMesh>,
    scans: PerBone<ColouredMesh>,
    mri: Option<Mri>,
    patella: Option<Patella>,
    capsule: Option<TriMesh>,
    metrics: serde_json::Value,
}

/// Reads the bones and what shows their cartilage: scans, a label map or surfaces.
fn sources(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &IngestOptions,
    warnings: &mut Vec<String>,
    surface: &Read,
) -> Result<Sources, StageError> {
    if let (Some(table), true) = (&file.segmentation, file.ct.is_empty()) {
        let read = mri::from_labels(table, raw, options, false, warnings)?;
        let patella = read.patella.clone().map(|ct| Patella { ct, scan: None });
        return Ok(of_mri(read.bones.clone(), read, patella, serde_json::json!({}), warnings));
    }
    let ct = file.ct.surfaces();
    let (femur, femur_counts) = surface("ct.femur", &ct.femur, warnings)?;
    let (tibfib, tibfib_counts) = surface("ct.tibfib", &ct.tibfib, warnings)?;
    let patella = patella(file, raw, warnings, surface)?;
    let ct = PerBone { femur: femur.mesh, tibfib: tibfib.mesh };
    let mut metrics = serde_json::json!({ "ct_femur": femur_counts, "ct_tibfib": tibfib_counts });
    let Some(scans) = &file.scans else {
        let read = match (&file.segmentation, &file.cartilage) {
            (Some(table), _) => mri::from_labels(table, raw, options, true, warnings)?,
            (None, Some(table)) => {
                mri::from_surfaces(table, raw, PerBone { femur: &ct.femur, tibfib: &ct.tibfib }, options, warnings)?
            }
            (None, None) => return Err(StageError("specimen.toml: nothing shows cartilage".into())),
        };
        return Ok(of_mri(ct, read, patella, metrics, warnings));
    };
    let (scan_femur, scan_femur_counts) = merge::scan("scans.femur", &scans.femur, &ct.femur, warnings, surface)?;
    let (scan_tibfib, scan_tibfib_counts) = merge::scan("scans.tibfib", &scans.tibfib, &ct.tibfib, warnings, surface)?;
    let capsule = match &scans.capsule {
        Some(path) => Some(surface("scans.capsule", path, warnings)?.0.mesh),
        None => None,
    };
    for (key, scan) in [("scans.femur", &scan_femur), ("scans.tibfib", &scan_tibfib)] {
        if scan.colours.is_empty() {
            warnings.push(format!("{key} has no colours: outlined attachment sites cannot be found on it"));
        }
    }
    metrics["scan_femur"] = scan_femur_counts;
    metrics["scan_tibfib"] = scan_tibfib_counts;
    let scans = PerBone { femur: scan_femur, tibfib: scan_tibfib };
    Ok(Sources { ct, scans, mri: None, patella, capsule, metrics })
}

/// What MRI gives, with the bones of `ct`.
fn of_mri(
    ct: PerBone<TriMesh>,
    read: mri::Read,
    patella: Option<Patella>,
    mut metrics: serde_json::Value,
    warnings: &mut Vec<String>,
) -> Sources {
    let register = if read.mri.in_ct { "register is left out, and " } else { "" };
    warnings.push(format!(
        "no scans: {register}no outlines are looked for; ligaments without points in marks.csv or attachments.csv are placed by the literature"
    ));
    metrics["mri"] = read.metrics;
    let bare = |mesh: TriMesh| ColouredMesh { mesh, colours: Vec::new() };
    let scans = PerBone { femur: bare(read.bones.femur), tibfib: bare(read.bones.tibfib) };
    Sources { ct, scans, mri: Some(read.mri), patella, capsule: None, metrics }
}

/// Reads a surface by key and path, with its counts.
type Read<'a> = dyn Fn(&str, &str, &mut Vec<String>) -> Result<(ColouredMesh, serde_json::Value), StageError> + 'a;

/// The patella that specimen.toml names, or that stage 0 found.
fn patella(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    warnings: &mut Vec<String>,
    surface: &Read,
) -> Result<Option<Patella>, StageError> {
    let found = raw.files.contains_key(SEGMENTED_PATELLA).then_some(SEGMENTED_PATELLA);
    let scan_path = file.scans.as_ref().and_then(|s| s.patella.as_deref());
    let Some(path) = file.ct.patella.as_deref().or(found) else {
        if scan_path.is_some() {
            warnings.push("scans.patella is left out: CT shows no patella to lay it on; name one as ct.patella".into());
        }
        return Ok(None);
    };
    let ct = surface("ct.patella", path, warnings)?.0.mesh;
    let scan = match scan_path {
        Some(path) => Some(surface("scans.patella", path, warnings)?.0),
        None => None,
    };
    Ok(Some(Patella { ct, scan }))
}

#[cfg(test)]
mod tests;
