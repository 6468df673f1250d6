//! Stage 0, segment: bones in a CT volume.

use super::{Files, Stage, Work, reported};
use crate::given::Picture;
use crate::kept::Kept;
use crate::options::BuildOptions;
use formats::{nifti, stl};
use stages::StageError;
use stages::segment::{SegmentOptions, Segmented, segment_specimen};

reported!(Segmented);

/// The stage.
pub(crate) struct Segment;

impl Stage for Segment {
    const NUMBER: &'static str = "00";
    const NAME: &'static str = "segment";
    const TELLING: &'static [&'static str] = &["threshold", "femur_volume_mm3", "tibfib_volume_mm3"];
    type Inputs<'a> = (&'a Kept<Picture>,);
    type Options = SegmentOptions;
    type Value = Segmented;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &SegmentOptions {
        &all.segment
    }

    fn run((picture,): Self::Inputs<'_>, options: &SegmentOptions, _: &Work) -> Result<Segmented, StageError> {
        segment_specimen(&picture.ct, &picture.raw, options)
    }

    /// The bones' surfaces, and the label map for 3D Slicer or ITK-SNAP.
    fn artifacts(s: &Segmented, _: Self::Inputs<'_>) -> Files {
        let mut files = Vec::new();
        let bones = [("femur", Some(&s.femur)), ("tibfib", Some(&s.tibfib)), ("patella", s.patella.as_ref())];
        for (name, mesh) in bones.into_iter().filter_map(|(name, mesh)| Some((name, mesh?))) {
            let mut bytes = Vec::new();
            stl::write(&mut bytes, mesh)?;
            files.push((format!("{name}.stl"), bytes));
        }
        let mut labels = Vec::new();
        nifti::write_labels(&mut labels, &s.labels)?;
        files.push(("labels.nii.gz".into(), labels));
        Ok(files)
    }
}
