//! Pictures of voxels, CT volumes and label maps: NIfTI-1 and -2, NRRD, MetaImage, DICOM segmentations, told apart by content.

use super::raw::refuse;
use super::{FormatError, dicom, metaimage, mgh, nifti, nrrd};
use meshes::volume::{Grid, Labels, Volume};
use notices::{Kind, Notice};
use std::collections::BTreeMap;

/// A label map with the names that its file gives the labels.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelMap {
    /// The labels.
    pub labels: Labels,
    /// Names and labels, in the file's order; empty where the file has none.
    pub names: Vec<(String, u8)>,
    /// Voxels that lay in several segments and stay in the first [-].
    pub overlapping: usize,
    /// Of several layers: the label that the file states for each of `names`, none where it states none. Else empty.
    pub stated: Vec<Option<u8>>,
    /// What is odd about the file but not fatal.
    pub notes: Vec<Notice>,
}

impl LabelMap {
    fn of(labels: Labels) -> LabelMap {
        let notes = sheared(&labels.grid).into_iter().collect();
        LabelMap { labels, names: Vec::new(), overlapping: 0, stated: Vec::new(), notes }
    }
}

/// Axes that are this far from square are told [deg]: beyond the rounding of headers.
const SHEAR_DEG: f64 = 0.2;

/// What is said of a grid whose axes are not square to each other.
pub fn sheared(grid: &Grid) -> Option<Notice> {
    let columns: Vec<_> = grid.axes.column_iter().map(|c| c.into_owned()).collect();
    let off = |(a, b): (usize, usize)| (columns[a].angle(&columns[b]).to_degrees() - 90.0).abs();
    let worst = [(0, 1), (0, 2), (1, 2)].into_iter().map(off).fold(0.0, f64::max);
    (worst > SHEAR_DEG).then(|| {
        Kind::ShearedGrid.notice(format!("the axes of its voxels are sheared by {worst:.1} deg: a tilted gantry, or an affine registration that was saved into the header"))
    })
}

/// Reads a volume. `files` holds the specimen's files by path and serves a detached header's data file.
///
/// # Errors
/// What the format's reader refuses; a file of no known kind.
pub fn read_volume(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<Volume, FormatError> {
    if nrrd::looks_nrrd(bytes) {
        let mut read = nrrd::read(name, bytes, files)?;
        return match read.layers.len() {
            1 => read.layers.remove(0).volume(),
            n => refuse(format!("the file has {n} layers; expected one volume")),
        };
    }
    if metaimage::looks_metaimage(bytes) {
        return metaimage::read(name, bytes, files)?.volume();
    }
    known(name, bytes)?;
    match mgh::looks_mgh(name, bytes) {
        true => mgh::read(bytes)?.volume(),
        false => nifti::read(bytes),
    }
}

/// Reads a label map, with its segments' names where it has them; `files` as for [`read_volume`].
///
/// Segments of several layers get labels of their own, from 1 on, in the file's order.
///
/// # Errors
/// As [`read_volume`]; values that are no labels.
pub fn read_labels(name: &str, bytes: &[u8], files: &BTreeMap<String, Vec<u8>>) -> Result<LabelMap, FormatError> {
    let whole = LabelMap::of;
    if nrrd::looks_nrrd(bytes) {
        let mut read = nrrd::read(name, bytes, files)?;
        if read.layers.len() > 1 {
            return merged(read);
        }
        let names = read.segments.into_iter().map(|s| (s.name, s.label)).collect();
        return Ok(LabelMap { names, ..whole(read.layers.remove(0).labels()?) });
    }
    if metaimage::looks_metaimage(bytes) {
        return metaimage::read(name, bytes, files)?.labels().map(whole);
    }
    if dicom::looks_dicom(bytes) {
        let read = dicom::segmentation::read(bytes).map_err(|e| {
            FormatError(format!("the file is DICOM: {}; else export the segmentation as .seg.nrrd by 3D Slicer", e.0))
        })?;
        let mut map = LabelMap { names: read.names, overlapping: read.overlapping, ..whole(read.labels) };
        map.notes.extend(read.notes);
        return Ok(map);
    }
    known(name, bytes)?;
    if mgh::looks_mgh(name, bytes) {
        return mgh::read(bytes)?.labels().map(whole);
    }
    let mut map = nifti::read_labels(bytes).map(whole)?;
    if !nifti::says_place(bytes) {
        map.notes.push(
            Kind::NoHeaderPlace.notice("the header says not where its voxels lie (qform and sform are 0), so no one knows which way is left: axes are taken as right, anterior, superior"),
        );
    }
    map.notes.extend(two_places(bytes));
    Ok(map)
}

/// sform and qform of one header that place its voxels farther apart than this are told [mm]: a voxel's size. Ours.
const PLACES_MM: f64 = 1.0;

/// What is told of a NIfTI whose header places its voxels twice, at two places.
fn two_places(bytes: &[u8]) -> Option<Notice> {
    let mm = nifti::places_apart(bytes).filter(|mm| *mm > PLACES_MM)?;
    Some(Kind::NoHeaderPlace.notice(format!(
        "the header's sform and qform place its voxels up to {mm:.0} mm apart: the sform is taken, and other programs take the qform. Look whether the bones lie where the other files of this knee have them; else export the picture anew"
    )))
}

/// Whether the content says that it is NRRD, MetaImage or NIfTI that is not packed.
pub(super) fn looks_picture(bytes: &[u8]) -> bool {
    let nifti = [344, 4].iter().any(|&at| bytes.get(at..at + 3).is_some_and(|b| b == b"n+1" || b == b"n+2"));
    nifti || nrrd::looks_nrrd(bytes) || metaimage::looks_metaimage(bytes)
}

/// The data file that a picture's header names.
pub(super) fn data_file(bytes: &[u8]) -> Option<String> {
    if nrrd::looks_nrrd(bytes) {
        nrrd::data_file(bytes)
    } else if metaimage::looks_metaimage(bytes) {
        metaimage::data_file(bytes)
    } else {
        None
    }
}

/// Refuses what is plainly no picture, with what it seems to be.
fn known(name: &str, bytes: &[u8]) -> Result<(), FormatError> {
    let expected =
        "expected NIfTI (.nii, .nii.gz), NRRD (.nrrd, .nhdr, .seg.nrrd), MetaImage (.mha, .mhd) or FreeSurfer (.mgz)";
    let lower = name.to_ascii_lowercase();
    if dicom::looks_dicom(bytes) {
        return refuse(format!("the file is DICOM; {expected}, or the folder of the DICOM series"));
    }
    if lower.ends_with(".img") || lower.ends_with(".hdr") || lower.ends_with(".img.gz") {
        return refuse(format!(
            "the file is one of a pair (.hdr and .img, Analyze or NIfTI); {expected}: export one file, .nii or .nii.gz"
        ));
    }
    if bytes.is_empty() {
        return refuse(format!("the file is empty; {expected}"));
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return refuse("the file is a Git LFS pointer, not the data: fetch it with `git lfs pull`");
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return refuse(format!("the file is a zip archive; {expected}: unpack it"));
    }
    if bytes.starts_with(b"\x89HDF") {
        return refuse(format!("the file is HDF5 (MINC, or a program's own); {expected}: export it"));
    }
    Ok(())
}

/// Layers made one label map.
fn merged(read: nrrd::Nrrd) -> Result<LabelMap, FormatError> {
    let mut layers = Vec::new();
    for raw in read.layers {
        layers.push(raw.labels()?);
    }
    let Some(first) = layers.first() else { return refuse("the file has no layer") };
    let mut labels = Labels { grid: first.grid.clone(), values: vec![0; first.values.len()] };
    let (mut names, mut overlapping) = (Vec::new(), 0);
    for (k, segment) in read.segments.iter().enumerate().take(255) {
        let Some(layer) = layers.get(segment.layer) else {
            return refuse(format!("segment {} lies in layer {}, which is not there", segment.name, segment.layer));
        };
        let own = k as u8 + 1;
        for (value, seen) in labels.values.iter_mut().zip(&layer.values).filter(|(_, s)| **s == segment.label) {
            debug_assert!(*seen == segment.label);
            if *value == 0 {
                *value = own;
            } else {
                overlapping += 1;
            }
        }
        names.push((segment.name.clone(), own));
    }
    if names.is_empty() {
        return refuse("the file has several layers and names no segments; expected one label map");
    }
    let stated = read.segments.iter().take(names.len()).map(|s| s.stated.then_some(s.label)).collect();
    Ok(LabelMap { names, overlapping, stated, ..LabelMap::of(labels) })
}

#[cfg(test)]
mod tests;
