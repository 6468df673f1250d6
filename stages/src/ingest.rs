//! Stage 1, ingest: the specimen's files become checked values in mm.

mod bodies;
mod file;
mod folder;
mod held;
mod landmark_names;
mod merge;
mod mri;
mod picked;
mod plausible;
mod points;
mod slicer;
mod space;
mod surfaces;

pub use file::{OPTIONAL_PATHS, named, parse_specimen_file, paths_named_by, paths_named_in, paths_of};
pub use folder::{check_case, specimen_text};
use notices::{Kind, Notice};
pub use space::of_knee;
pub use surfaces::{Judged, judge_surfaces, middle_extent};

use crate::frames;
use crate::specimen::{IngestMetrics, SurfaceMetrics};
use crate::specimen::{
    IngestOptions, Mri, NamedPoint, Patella, RAS_INPUTS, RawSpecimen, SEGMENTED_PATELLA, Specimen, SpecimenFile,
};
use crate::{PerBone, StageError};
use attachments::bundle::BUNDLES;
use attachments::site::Fibre;
use meshes::surface::{ColouredMesh, TriMesh};

/// Turns the files of a specimen into checked values in mm.
///
/// Surfaces are welded, freed of triangles without area and turned outward; holes and loose pieces stay, counted.
/// Anatomy (side, exchanged bones) is not looked at here but where frames are assigned.
///
/// # Errors
/// A missing or unreadable file, an unknown key, name or unit: with file, line or element, what was expected, what to do.
pub fn ingest(raw: &RawSpecimen, options: &IngestOptions) -> Result<Specimen, StageError> {
    ingest_file(&parse_specimen_file(&raw.toml)?, raw, options)
}

/// Names of the points in a file of 3D Slicer's or MeshLab's; `None` for another kind of file.
///
/// # Errors
/// A file that cannot be read.
pub fn markup_names(path: &str, bytes: &[u8]) -> Option<Result<Vec<String>, StageError>> {
    slicer::read(path, bytes)
        .or_else(|| picked::read(path, bytes))
        .map(|read| Ok(read?.into_iter().map(|p| p.name).collect()))
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check_options(options: &IngestOptions) -> Result<(), StageError> {
    if let Some(odd) = options.ras.iter().find(|r| !RAS_INPUTS.contains(&r.as_str())) {
        let known = RAS_INPUTS.join(", ");
        return Err(StageError::Knee(format!("ingest.ras names `{odd}`; expected any of {known}")));
    }
    match options.least_width_mm < options.greatest_width_mm {
        true => Ok(()),
        false => {
            Err(StageError::option("ingest.least_width_mm", options.least_width_mm, "less than greatest_width_mm"))
        }
    }
}

/// [`ingest`] of a specimen.toml that is parsed already; of `raw` only the files are looked at.
///
/// # Errors
/// As [`ingest`].
pub fn ingest_file(file: &SpecimenFile, raw: &RawSpecimen, options: &IngestOptions) -> Result<Specimen, StageError> {
    check_options(options)?;
    let mut warnings = Vec::new();
    file::check_present(file, raw)?;
    let surface =
        |key: &str, path: &str, warnings: &mut Vec<Notice>| surfaces::checked(key, path, &raw.files, options, warnings);
    let sources = sources(file, raw, options, &mut warnings, &surface)?;
    let landmarks = points::landmarks(file, raw, options, &mut warnings)?;
    warnings.extend(points::missing(file, raw, &landmarks));
    let marks = points::marks(file, raw, options, &mut warnings)?;
    let given_fibres = points::fibres(file, raw, options, &mut warnings)?;
    let given_frames = match &file.frames {
        Some(f) => Some(frames::given::read(&f.file, &raw.files[&f.file])?),
        None => None,
    };
    for bundle in BUNDLES.iter() {
        let given = given_fibres.iter().filter(|f| f.bundle == bundle.name).count();
        if given > 0 && given != bundle.fibres {
            warnings.push(
                Kind::FibreCount
                    .notice(format!(
                        "attachments.csv gives {} {given} fibres, Table 3 has {}",
                        bundle.name, bundle.fibres
                    ))
                    .file("attachments.csv")
                    .of(&bundle.name)
                    .count(given),
            );
        }
    }
    space::check(&sources.ct, [&landmarks, &marks])?;
    hold(file, &sources, [&landmarks, &marks], &given_fibres, &mut warnings)?;
    hold_bodies(file, &sources, given_frames.as_ref(), &mut warnings)?;
    plausible::check(file, &landmarks, &sources.ct, &mut warnings)?;
    let metrics = IngestMetrics {
        landmarks: landmarks.len(),
        marks: marks.len(),
        given_fibres: given_fibres.len(),
        ..sources.metrics
    };
    Ok(Specimen {
        identity: file.specimen.clone(),
        ct: sources.ct,
        scans: sources.scans,
        mri: sources.mri,
        patella: sources.patella,
        capsule: sources.capsule,
        landmarks,
        marks,
        given_fibres,
        given_frames,
        ligaments: file.ligaments.clone(),
        warnings,
        metrics,
    })
}

/// Holds everything that was given by hand against the bones.
fn hold(
    file: &SpecimenFile,
    sources: &Sources,
    [landmarks, marks]: [&[NamedPoint]; 2],
    fibres: &[Fibre],
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    let Some(bones) = held::Bones::of(&sources.ct) else { return Ok(()) };
    let given = [&file.points.landmarks, &file.points.marks, &file.points.attachments];
    let path = |k: usize| given[k].as_deref().unwrap_or(OPTIONAL_PATHS[k]);
    held::points((path(0), "landmarks"), landmarks, &bones, &sources.scans, warnings)?;
    held::points((path(1), "marks"), marks, &bones, &sources.scans, warnings)?;
    held::fibres(path(2), fibres, &bones, warnings)?;
    match &sources.patella {
        Some(patella) => held::patella(patella, &bones, warnings),
        None => Ok(()),
    }
}

/// What is said where nothing tells left from right.
pub const NO_FIBULA: &str = "no fibular shaft was found: nothing shows whether the side in specimen.toml is right";

/// The notice of it.
pub fn no_fibula() -> Notice {
    Kind::NoFibula.notice(NO_FIBULA)
}

/// Holds given frames and bodies that are carried along against the bones.
fn hold_bodies(
    file: &SpecimenFile,
    sources: &Sources,
    given: Option<&frames::given::GivenFrames>,
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    let side = file.specimen.side;
    if let Some(axes) = bodies::axes(&sources.ct.femur, &sources.ct.tibfib, side) {
        bodies::grown_together(&sources.ct.femur, &axes, "the femur", warnings);
        if axes.fibula.is_none() {
            warnings.push(no_fibula());
        }
    }
    if let (Some(given), Some(table), Some(bones)) = (given, &file.frames, held::Bones::of(&sources.ct)) {
        bodies::frames(&table.file, given, &bones, warnings)?;
    }
    let Some(mri) = sources.mri.as_ref().filter(|m| !m.bodies.is_empty()) else { return Ok(()) };
    // beside CT the bones of MRI stand where scans do
    let own = PerBone { femur: sources.scans.femur.mesh.clone(), tibfib: sources.scans.tibfib.mesh.clone() };
    if let Some(bones) = held::Bones::of(&own) {
        bodies::carried(mri, &bones, bodies::axes(&own.femur, &own.tibfib, side).as_ref(), warnings);
    }
    Ok(())
}

/// What shows bones and cartilage.
struct Sources {
    ct: PerBone<TriMesh>,
    scans: PerBone<ColouredMesh>,
    mri: Option<Mri>,
    patella: Option<Patella>,
    capsule: Option<TriMesh>,
    metrics: IngestMetrics,
}

/// Reads the bones and what shows their cartilage: scans, a label map or surfaces.
fn sources(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
    surface: &Read,
) -> Result<Sources, StageError> {
    if let (Some(table), true) = (&file.segmentation, file.ct.is_empty()) {
        let read = mri::from_labels(table, raw, options, (false, file.specimen.side), warnings)?;
        let patella = read.patella.clone().map(|ct| Patella { ct, scan: None });
        return Ok(of_mri(read.bones.clone(), read, patella, IngestMetrics::default(), warnings));
    }
    let ct = file.ct.surfaces();
    let (femur, femur_counts) = surface("ct.femur", &ct.femur, warnings)?;
    let (tibfib, tibfib_counts) = surface("ct.tibfib", &ct.tibfib, warnings)?;
    let patella = patella(file, raw, warnings, surface)?;
    let ct = PerBone { femur: femur.mesh, tibfib: tibfib.mesh };
    let metrics =
        IngestMetrics { ct_femur: Some(femur_counts), ct_tibfib: Some(tibfib_counts), ..IngestMetrics::default() };
    let Some(scans) = &file.scans else {
        let read = match (&file.segmentation, &file.cartilage) {
            (Some(table), _) => mri::from_labels(table, raw, options, (true, file.specimen.side), warnings)?,
            (None, Some(table)) => {
                mri::from_surfaces(table, raw, PerBone { femur: &ct.femur, tibfib: &ct.tibfib }, options, warnings)?
            }
            (None, None) => return Err(StageError::specimen("nothing shows cartilage")),
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
        if scan.colours.iter().all(|c| *c == scan.colours[0]) {
            warnings.push(
                Kind::NoColours
                    .notice(format!("{key} has no colours: outlined attachment sites cannot be found on it"))
                    .of(key),
            );
        }
    }
    let metrics =
        IngestMetrics { scan_femur: Some(scan_femur_counts), scan_tibfib: Some(scan_tibfib_counts), ..metrics };
    let scans = PerBone { femur: scan_femur, tibfib: scan_tibfib };
    Ok(Sources { ct, scans, mri: None, patella, capsule, metrics })
}

/// What MRI gives, with the bones of `ct`.
fn of_mri(
    ct: PerBone<TriMesh>,
    read: mri::Read,
    patella: Option<Patella>,
    metrics: IngestMetrics,
    warnings: &mut Vec<Notice>,
) -> Sources {
    let register = if read.mri.in_ct { "register is left out, and " } else { "" };
    warnings.push(Kind::NoScans.notice(format!(
        "no scans: {register}no outlines are looked for; ligaments without points in marks.csv or attachments.csv are placed by the literature"
    )));
    let metrics = IngestMetrics { mri: Some(read.metrics), ..metrics };
    let bare = |mesh: TriMesh| ColouredMesh { mesh, colours: Vec::new() };
    let scans = PerBone { femur: bare(read.bones.femur), tibfib: bare(read.bones.tibfib) };
    Sources { ct, scans, mri: Some(read.mri), patella, capsule: None, metrics }
}

/// Reads a surface by key and path, with its counts.
type Read<'a> = dyn Fn(&str, &str, &mut Vec<Notice>) -> Result<(ColouredMesh, SurfaceMetrics), StageError> + 'a;

/// The patella that specimen.toml names, or that stage 0 found.
fn patella(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    warnings: &mut Vec<Notice>,
    surface: &Read,
) -> Result<Option<Patella>, StageError> {
    let found = raw.files.contains_key(SEGMENTED_PATELLA).then_some(SEGMENTED_PATELLA);
    let scan_path = file.scans.as_ref().and_then(|s| s.patella.as_deref());
    let Some(path) = file.ct.patella.as_deref().or(found) else {
        if scan_path.is_some() {
            warnings.push(
                Kind::PatellaScanLeftOut
                    .notice("scans.patella is left out: CT shows no patella to lay it on; name one as ct.patella"),
            );
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
