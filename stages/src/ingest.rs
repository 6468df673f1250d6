//! Stage 1, ingest: the specimen's files become checked values in mm.

mod file;
mod merge;
mod points;
mod surfaces;

pub use file::{OPTIONAL_PATHS, parse_specimen_file, paths_named_by, paths_named_in};

use crate::{PerBone, StageError};
use attachments::bundle::BUNDLES;
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
    /// Paths of the CT surfaces, or of the CT volume.
    pub ct: CtPaths,
    /// Paths of the scans.
    pub scans: ScanPaths,
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
    /// A CT volume of the knee: a NIfTI file, or a folder with a DICOM series.
    pub volume: Option<String>,
    /// A label map of the volume, made or mended by hand (NIfTI).
    pub labels: Option<String>,
}

impl CtPaths {
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
}

impl Default for IngestOptions {
    fn default() -> Self {
        IngestOptions { least_width_mm: 35.0, greatest_width_mm: 200.0 }
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
    let ct = file.ct.surfaces();
    let (ct_femur, ct_femur_counts) = surface("ct.femur", &ct.femur, &mut warnings)?;
    let (ct_tibfib, ct_tibfib_counts) = surface("ct.tibfib", &ct.tibfib, &mut warnings)?;
    let (scan_femur, scan_femur_counts) =
        merge::scan("scans.femur", &file.scans.femur, &ct_femur.mesh, &mut warnings, &surface)?;
    let (scan_tibfib, scan_tibfib_counts) =
        merge::scan("scans.tibfib", &file.scans.tibfib, &ct_tibfib.mesh, &mut warnings, &surface)?;
    let patella = patella(&file, raw, &mut warnings, &surface)?;
    let capsule = match &file.scans.capsule {
        Some(path) => Some(surface("scans.capsule", path, &mut warnings)?.0.mesh),
        None => None,
    };
    for (key, scan) in [("scans.femur", &scan_femur), ("scans.tibfib", &scan_tibfib)] {
        if scan.colours.is_empty() {
            warnings.push(format!("{key} has no colours: outlined attachment sites cannot be found on it"));
        }
    }
    let landmarks = points::landmarks(&file, raw)?;
    warnings.extend(points::missing(&file, raw, &landmarks));
    let marks = points::marks(&file, raw)?;
    let given_fibres = points::fibres(&file, raw)?;
    for bundle in BUNDLES.iter() {
        let given = given_fibres.iter().filter(|f| f.bundle == bundle.name).count();
        if given > 0 && given != bundle.fibres {
            warnings
                .push(format!("attachments.csv gives {} {given} fibres, Table 3 has {}", bundle.name, bundle.fibres));
        }
    }
    let metrics = serde_json::json!({
        "ct_femur": ct_femur_counts, "ct_tibfib": ct_tibfib_counts,
        "scan_femur": scan_femur_counts, "scan_tibfib": scan_tibfib_counts,
        "landmarks": landmarks.len(), "marks": marks.len(), "given_fibres": given_fibres.len(),
    });
    Ok(Specimen {
        identity: file.specimen,
        ct: PerBone { femur: ct_femur.mesh, tibfib: ct_tibfib.mesh },
        scans: PerBone { femur: scan_femur, tibfib: scan_tibfib },
        patella,
        capsule,
        landmarks,
        marks,
        given_fibres,
        ligaments: file.ligaments,
        warnings,
        metrics,
    })
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
    let Some(path) = file.ct.patella.as_deref().or(found) else {
        if file.scans.patella.is_some() {
            warnings.push("scans.patella is left out: CT shows no patella to lay it on; name one as ct.patella".into());
        }
        return Ok(None);
    };
    let ct = surface("ct.patella", path, warnings)?.0.mesh;
    let scan = match &file.scans.patella {
        Some(path) => Some(surface("scans.patella", path, warnings)?.0),
        None => None,
    };
    Ok(Some(Patella { ct, scan }))
}

#[cfg(test)]
mod tests;
