//! Stage 1, ingest: the specimen's files as checked values in mm.

use super::artifacts::{scan_bytes, surface};
use super::{Files, Stage, Work, reported};
use crate::given::Geometry;
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use serde_json::json as object;
use stages::StageError;
use stages::anatomy::check_anatomy;
use stages::ingest::ingest_file;
use stages::segment::{Segmented, with_surfaces};
use stages::specimen::{IngestOptions, Specimen};

reported!(Specimen);

/// The stage.
pub(crate) struct Ingest;

impl Stage for Ingest {
    const NUMBER: &'static str = "01";
    const NAME: &'static str = "ingest";
    const TELLING: &'static [&'static str] = &["triangles", "landmarks", "marks"];
    type Inputs<'a> = (&'a Kept<Geometry>, Option<&'a Kept<Segmented>>);
    type Options = IngestOptions;
    type Value = Specimen;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &IngestOptions {
        &all.ingest
    }

    /// The specimen, unless its bones are plainly not what it says.
    fn run((given, found): Self::Inputs<'_>, options: &IngestOptions, _: &Work) -> Result<Specimen, StageError> {
        let Geometry { file, raw } = &**given;
        let with_bones = found.map(|found| with_surfaces(&file.ct, raw, found)).transpose()?;
        let specimen = ingest_file(file, with_bones.as_ref().unwrap_or(raw), options)?;
        check_anatomy(&specimen).map(|_| specimen)
    }

    /// The surfaces as the program understood them, the points, who it is.
    fn artifacts(s: &Specimen, _: Self::Inputs<'_>) -> Files {
        let mut files = vec![("identity.json".into(), json(&s.identity))];
        for (name, mesh) in s.ct.named() {
            files.push((format!("ct_{name}.ply"), surface(mesh, &[])?));
        }
        let shown = if s.mri.is_some() { "mri" } else { "scan" };
        for (name, scan) in s.scans.named() {
            files.push((format!("{shown}_{name}.ply"), scan_bytes(scan)?));
        }
        for (name, cover) in s.mri.iter().flat_map(|m| m.covers.named()) {
            files.push((format!("mri_cartilage_{name}.ply"), surface(cover, &[])?));
        }
        if let Some(patella) = &s.patella {
            files.push(("ct_patella.ply".into(), surface(&patella.ct, &[])?));
            if let Some(scan) = &patella.scan {
                files.push(("scan_patella.ply".into(), scan_bytes(scan)?));
            }
        }
        files.push(("points.json".into(), json(&object!({"landmarks": s.landmarks, "marks": s.marks}))));
        Ok(files)
    }
}
