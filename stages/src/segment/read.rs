//! The volume and the label map among a specimen's files.

use super::{SegmentOptions, Segmented, segment};
use crate::StageError;
use crate::specimen::{CtPaths, RawSpecimen, SEGMENTED, SEGMENTED_PATELLA};
use formats::{dicom, picture, stl};
use meshes::volume::{Grid, Labels, Volume};
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// Reads the CT volume and label map that `[ct]` names and segments it.
///
/// # Errors
/// As the readers and [`segment`], with the file's name.
pub fn segment_specimen(ct: &CtPaths, raw: &RawSpecimen, options: &SegmentOptions) -> Result<Segmented, StageError> {
    let path = ct.volume.as_deref().unwrap_or_default();
    let (volume, mut warnings) = volume(path, raw)?;
    warnings.extend(picture::sheared(&volume.grid));
    let labels = labels(ct, raw, &volume.grid, &mut warnings)?;
    let mut made = segment(&volume, labels.as_ref(), options).map_err(|e| StageError::file(path, e))?;
    made.warnings.splice(0..0, warnings.into_iter().map(|w| w.in_file(path)));
    Ok(made)
}

/// What a CT volume's files say, before any of its bones is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The volume, in words: voxels, their size, how it is cut, of what kind.
    pub volume: String,
    /// The label map beside it, in words.
    pub labels: Option<String>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
}

/// Reads the headers of a DICOM series, or a picture, and the label map, as far as [`segment_specimen`] would refuse them at once.
///
/// # Errors
/// As the readers, with key and file: several series, a missing slice, another kind of picture, voxels in another unit, labels elsewhere.
pub fn look(ct: &CtPaths, raw: &RawSpecimen, options: &SegmentOptions) -> Result<Seen, StageError> {
    let path = ct.volume.as_deref().unwrap_or_default();
    let named = |e: &dyn std::fmt::Display| StageError::named(path, "ct.volume", e.to_string());
    let (grid, how, mut warnings) = match raw.files.get(path) {
        Some(_) => {
            let (volume, warnings) = volume(path, raw)?;
            super::check(&volume, None, options).map_err(|e| named(&e))?;
            super::threshold_of(&volume, options).map_err(|e| named(&e))?;
            (volume.grid, String::new(), warnings)
        }
        None => {
            let files = in_folder(path, raw)?;
            let seen = dicom::survey(&files).map_err(|e| named(&e))?;
            super::check_grid(&seen.grid).map_err(|e| named(&e))?;
            let kind = if seen.modality.is_empty() { "of no stated kind" } else { seen.modality.as_str() };
            let slices = seen.grid.size[2];
            let how = format!("; {path}, a DICOM series of {slices} slices, {kind}, {}", seen.cut);
            (seen.grid, how, seen.warnings)
        }
    };
    warnings.extend(picture::sheared(&grid));
    let [x, y, z] = grid.spacing();
    let [nx, ny, nz] = grid.size;
    let volume = format!(
        "{nx} x {ny} x {nz} voxels of {x:.2} x {y:.2} x {z:.2} mm, {:.0} x {:.0} x {:.0} mm{how}",
        nx as f64 * x,
        ny as f64 * y,
        nz as f64 * z
    );
    let labels = match labels(ct, raw, &grid, &mut warnings)? {
        None => None,
        Some(labels) => {
            super::check_labels(&grid, &labels)
                .map_err(|e| StageError::named(ct.labels.as_deref().unwrap_or_default(), "ct.labels", e.to_string()))?;
            let held = super::LABELS.iter().filter(|(n, _)| labels.values.contains(n)).map(|(_, name)| *name);
            Some(held.collect::<Vec<_>>().join(", "))
        }
    };
    Ok(Seen { volume, labels, warnings: warnings.into_iter().map(|w| w.in_file(path)).collect() })
}

/// The label map beside the volume, on the volume's grid.
fn labels(
    ct: &CtPaths,
    raw: &RawSpecimen,
    grid: &Grid,
    warnings: &mut Vec<Notice>,
) -> Result<Option<Labels>, StageError> {
    let Some(path) = &ct.labels else { return Ok(None) };
    let bytes = raw.files.get(path).ok_or_else(|| absent("ct.labels", path))?;
    let read = picture::read_labels(path, bytes, &raw.files).map_err(|e| StageError::named(path, "ct.labels", e.0))?;
    on_grid(path, read.labels, grid, warnings).map(Some)
}

/// Share of the labelled voxels that must lie in the volume for the two to be of one space [-]; a map of a larger field may lose a little.
const LEAST_INSIDE: f64 = 0.95;

/// The labels on the volume's grid: as they are, or the nearest voxel's where the map is flipped, turned, cropped or of another spacing
/// and lies in the same space.
///
/// # Errors
/// A map that lies elsewhere.
fn on_grid(path: &str, labels: Labels, grid: &Grid, warnings: &mut Vec<Notice>) -> Result<Labels, StageError> {
    let refuse = |what: String| StageError::named(path, "ct.labels", what);
    if labels.grid.same_places(grid) {
        return Ok(labels);
    }
    let nowhere = || refuse("its axes or the volume's are flat".into());
    let (into, from) = (grid.index_from_mm().ok_or_else(nowhere)?, labels.grid.index_from_mm().ok_or_else(nowhere)?);
    let at = |matrix: &nalgebra::Matrix3<f64>, of: &Grid, p: Point| {
        let index = matrix * (p - of.origin);
        let voxel = [0, 1, 2].map(|k| index[k].round());
        let inside = (0..3).all(|k| voxel[k] >= 0.0 && voxel[k] < of.size[k] as f64);
        inside.then(|| of.at(voxel.map(|x| x as usize)))
    };
    let place = |of: &Grid, v: usize| of.point(&Vector::from(of.voxel(v).map(|i| i as f64)));
    let (mut all, mut inside) = (0usize, 0usize);
    for (v, _) in labels.values.iter().enumerate().filter(|(_, l)| **l > 0) {
        all += 1;
        inside += usize::from(at(&into, grid, place(&labels.grid, v)).is_some());
    }
    if (inside as f64) < LEAST_INSIDE * all as f64 {
        return Err(refuse(format!(
            "{:.0} % of its labelled voxels lie in the volume, by the placement in its header; expected {:.0} % or more: save it in the volume's space",
            100.0 * inside as f64 / all.max(1) as f64,
            100.0 * LEAST_INSIDE
        )));
    }
    let value = |v: usize| at(&from, &labels.grid, place(grid, v)).map_or(0, |i| labels.values[i]);
    warnings.push(Kind::OtherGrid.notice(format!(
        "{path} lies on another grid than the volume ({:?} voxels, the volume {:?}) in the same space: each voxel takes the label of the nearest",
        labels.grid.size, grid.size
    )).file(path));
    Ok(Labels { values: (0..grid.count()).map(value).collect(), grid: grid.clone() })
}

fn absent(key: &str, path: &str) -> StageError {
    let what = format!("{path} is not there; put the file there or correct the path");
    StageError::named("specimen.toml", key, what)
}

fn volume(path: &str, raw: &RawSpecimen) -> Result<(Volume, Vec<Notice>), StageError> {
    let fail = |e: formats::FormatError| StageError::named(path, "ct.volume", e.0);
    if let Some(bytes) = raw.files.get(path) {
        if dicom::looks_dicom(bytes) {
            return Err(StageError::Knee(format!(
                "{path} (ct.volume): one DICOM file; expected the folder with the whole series, or NIfTI, NRRD or MetaImage"
            )));
        }
        return Ok((picture::read_volume(path, bytes, &raw.files).map_err(fail)?, Vec::new()));
    }
    let series = dicom::read_series(&in_folder(path, raw)?).map_err(fail)?;
    Ok((series.volume, series.warnings))
}

/// The files of a series' folder.
fn in_folder<'a>(path: &str, raw: &'a RawSpecimen) -> Result<Vec<(&'a str, &'a [u8])>, StageError> {
    let folder = format!("{}/", path.trim_end_matches('/'));
    let files: Vec<(&str, &[u8])> = raw
        .files
        .range(folder.clone()..)
        .take_while(|(name, _)| name.starts_with(&folder))
        .map(|(name, bytes)| (name.as_str(), bytes.as_slice()))
        .collect();
    if files.is_empty() { Err(absent("ct.volume", path)) } else { Ok(files) }
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
