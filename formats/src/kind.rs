//! What a file holds, for whoever is handed files of any kind: by content, and by the ending of its name where that does not decide.

use super::{SurfaceFormat, dicom, picture, surface_format};

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A surface.
    Surface(SurfaceFormat),
    /// A picture of voxels: NIfTI, NRRD or MetaImage, whole or a header with its data beside it.
    Picture,
    /// A file of a DICOM series.
    Dicom,
    /// Points of 3D Slicer or MeshLab.
    Markups,
    /// A table: text, a workbook, channels.
    Table,
    /// What another file names: a material library, a texture, a picture's detached voxels.
    Companion,
    /// None of these, with what it seems to be and what was expected.
    Unknown(String),
}

impl Kind {
    /// What it is, in words.
    pub fn words(&self) -> &str {
        match self {
            Kind::Surface(_) => "a surface",
            Kind::Picture => "a picture of voxels",
            Kind::Dicom => "a DICOM picture",
            Kind::Markups => "points of 3D Slicer or MeshLab",
            Kind::Table => "a table",
            Kind::Companion => "a material library, a texture or bare voxels",
            Kind::Unknown(what) => what,
        }
    }
}

/// The kind of a file of this name with these bytes.
pub fn kind_of(name: &str, bytes: &[u8]) -> Kind {
    let lower = name.to_ascii_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|e| lower.ends_with(e));
    let is_slicers = || bytes[..bytes.len().min(4000)].windows(9).any(|w| w == b"\"markups\"");
    if dicom::looks_dicom(bytes) {
        Kind::Dicom
    } else if picture::looks_picture(bytes) || ends(&[".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"]) {
        Kind::Picture
    } else if ends(&[".fcsv", ".mrk.json", ".pp"])
        || bytes.starts_with(b"# Markups")
        || (ends(&[".json"]) && is_slicers())
    {
        Kind::Markups
    } else if ends(&[".mtl", ".png", ".jpg", ".jpeg", ".raw", ".zraw"]) {
        Kind::Companion
    } else if ends(&[".csv", ".tsv", ".txt", ".xlsx", ".tdms"]) {
        Kind::Table
    } else {
        match surface_format(name, bytes) {
            Ok(format) => Kind::Surface(format),
            Err(e) => Kind::Unknown(e.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_content_before_names() {
        let mut dicom = vec![0; 128];
        dicom.extend(b"DICM");
        for (name, bytes, wanted) in [
            ("IM0001", dicom.as_slice(), Kind::Dicom),
            ("a.stl", b"solid a\nfacet normal 0 0 1\n", Kind::Surface(SurfaceFormat::Stl)),
            ("a.vtk", b"# vtk DataFile Version 5.1\n", Kind::Surface(SurfaceFormat::Vtk)),
            ("a.vtp", b"<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\">", Kind::Surface(SurfaceFormat::Vtk)),
            ("labels", b"NRRD0004\n", Kind::Picture),
            ("knee.nii.gz", b"\x1f\x8b", Kind::Picture),
            ("F.fcsv", b"# Markups fiducial file version = 5.0\n", Kind::Markups),
            ("F.mrk.json", b"{\"markups\": []}", Kind::Markups),
            ("F.pp", b"<!DOCTYPE PickedPoints>\n", Kind::Markups),
            ("kla.xlsx", b"PK\x03\x04", Kind::Table),
            ("kla.csv", b"trial,test\n", Kind::Table),
            ("okn.TDMS", b"TDSm", Kind::Table),
            ("a.mtl", b"newmtl a\n", Kind::Companion),
        ] {
            assert_eq!(kind_of(name, bytes), wanted, "{name}");
        }
        assert!(matches!(kind_of("notes.docx", b"PK\x03\x04"), Kind::Unknown(what) if what.contains("zip")));
        assert!(matches!(kind_of("x", b""), Kind::Unknown(what) if what.contains("empty")));
    }
}
