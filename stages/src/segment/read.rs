//! The volume and the label map among a specimen's files.

use super::{SegmentOptions, Segmented, segment};
use crate::StageError;
use crate::specimen::{CtPaths, RawSpecimen, SEGMENTED, SEGMENTED_PATELLA};
use meshes::format::{dicom, picture, stl};
use meshes::volume::Volume;

/// Reads the CT volume and label map that `[ct]` names and segments it.
///
/// # Errors
/// As the readers and [`segment`], with the file's name.
pub fn segment_specimen(ct: &CtPaths, raw: &RawSpecimen, options: &SegmentOptions) -> Result<Segmented, StageError> {
    let path = ct.volume.as_deref().unwrap_or_default();
    let (volume, warnings) = volume(path, raw)?;
    let labels = match &ct.labels {
        Some(path) => {
            let bytes = raw.files.get(path).ok_or_else(|| absent("ct.labels", path))?;
            let read = picture::read_labels(path, bytes, &raw.files);
            Some(read.map_err(|e| StageError::named(path, "ct.labels", e.0))?.labels)
        }
        None => None,
    };
    let mut made = segment(&volume, labels.as_ref(), options).map_err(|e| StageError::file(path, e))?;
    made.warnings.splice(0..0, warnings.into_iter().map(|w| format!("{path}: {w}")));
    Ok(made)
}

fn absent(key: &str, path: &str) -> StageError {
    StageError::specimen(format!("{key} names {path}, which is not there; put the file there or correct the path"))
}

fn volume(path: &str, raw: &RawSpecimen) -> Result<(Volume, Vec<String>), StageError> {
    let fail = |e: meshes::format::FormatError| StageError::named(path, "ct.volume", e.0);
    if let Some(bytes) = raw.files.get(path) {
        if dicom::looks_dicom(bytes) {
            return Err(StageError::Knee(format!(
                "{path} (ct.volume): one DICOM file; expected the folder with the whole series, or NIfTI, NRRD or MetaImage"
            )));
        }
        return Ok((picture::read_volume(path, bytes, &raw.files).map_err(fail)?, Vec::new()));
    }
    let folder = format!("{}/", path.trim_end_matches('/'));
    let files: Vec<(&str, &[u8])> = raw
        .files
        .range(folder.clone()..)
        .take_while(|(name, _)| name.starts_with(&folder))
        .map(|(name, bytes)| (name.as_str(), bytes.as_slice()))
        .collect();
    if files.is_empty() {
        return Err(absent("ct.volume", path));
    }
    let series = dicom::read_series(&files).map_err(fail)?;
    Ok((series.volume, series.warnings))
}

/// The specimen with the surfaces found in its volume in place of the volume.
///
/// # Errors
/// Never in practice: writing to memory.
pub fn with_surfaces(ct: &CtPaths, raw: &RawSpecimen, found: &Segmented) -> Result<RawSpecimen, StageError> {
    let path = ct.volume.as_deref().unwrap_or_default().trim_end_matches('/');
    let folder = format!("{path}/");
    let volume = |name: &str| name == path || name.starts_with(&folder) || Some(name) == ct.labels.as_deref();
    let mut files: std::collections::BTreeMap<String, Vec<u8>> =
        raw.files.iter().filter(|(name, _)| !volume(name)).map(|(name, bytes)| (name.clone(), bytes.clone())).collect();
    let bones = SEGMENTED.into_iter().zip([&found.femur, &found.tibfib]);
    for (name, mesh) in bones.chain(found.patella.as_ref().map(|mesh| (SEGMENTED_PATELLA, mesh))) {
        let mut bytes = Vec::new();
        stl::write(&mut bytes, mesh).map_err(|e| StageError::Knee(e.to_string()))?;
        files.insert(name.into(), bytes);
    }
    Ok(RawSpecimen { toml: raw.toml.clone(), files })
}
