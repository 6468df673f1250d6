//! Stage 0, segment: bone surfaces from a CT volume.

mod names;
mod read;
mod refine;
mod solid;
mod surface;
mod threshold;

use notices::Notice;
pub use read::{Seen, look, segment_specimen, with_surfaces};

use crate::StageError;
use meshes::surface::TriMesh;
use meshes::volume::{Grid, Labels, Volume};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Labels in label maps, in and out.
pub const LABELS: [(u8, &str); 4] = [(1, "femur"), (2, "tibia"), (3, "fibula"), (4, "patella")];

/// What a CT volume shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segmented {
    /// The femur, closed, CT frame.
    pub femur: TriMesh,
    /// Tibia with fibula, closed; one body where they touch, else two.
    pub tibfib: TriMesh,
    /// The patella, where it is in the picture.
    pub patella: Option<TriMesh>,
    /// Which voxel is which bone, on the volume's own grid, to be mended by hand where it is wrong.
    pub labels: Labels,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: SegmentMetrics,
}

/// Figures of the segmentation, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SegmentMetrics {
    /// Voxels along each axis.
    pub voxels: [usize; 3],
    /// Their size [mm].
    pub spacing_mm: [f64; 3],
    /// Between bone and what is not [HU].
    pub threshold: f64,
    /// Volume of each label [mm3].
    pub label_volume_mm3: BTreeMap<String, f64>,
    /// Volume of the femur's surface [mm3].
    pub femur_volume_mm3: f64,
    /// Of the tibia's with the fibula's [mm3].
    pub tibfib_volume_mm3: f64,
    /// Of the patella's [mm3].
    pub patella_volume_mm3: Option<f64>,
}

/// What a given label map means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LabelMeaning {
    /// Every voxel's bone has been decided.
    #[default]
    Masks,
    /// A few strokes in each bone tell which is which; voxels without a label are undecided.
    Seeds,
}

/// How bones are found in a CT volume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentOptions {
    /// Value above which a voxel is dense bone [as the volume: HU]; not given: from the histogram [otsu1979]. It decides what
    /// hangs together; where the surface runs is decided by the edge itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<f64>,
    /// Gaps in the cortex up to twice this wide are closed [mm]; our own trials: nutrient canals and thin plateaus.
    pub closing_mm: f64,
    /// Bones are parted at necks thinner than this share of the thinner bone [-]; our own trials.
    pub neck_share: f64,
    /// Smaller bodies are no bones of the knee [mm3]; a patella has 10000 and more, a fabella up to 1000.
    pub least_bone_mm3: f64,
    /// What a given label map means: masks, or seeds.
    pub labels_are: LabelMeaning,
    /// How far from a voxel's border the edge of the bone is looked for [mm]; three voxels of a common scan.
    pub edge_reach_mm: f64,
    /// Pairs of smoothing steps that do not shrink [-]; [taubin1995].
    pub smoothing_rounds: usize,
}

impl Default for SegmentOptions {
    fn default() -> Self {
        SegmentOptions {
            threshold: None,
            closing_mm: 1.2,
            neck_share: 0.5,
            least_bone_mm3: 2000.0,
            labels_are: LabelMeaning::Masks,
            edge_reach_mm: 2.0,
            smoothing_rounds: 5,
        }
    }
}

/// Finds femur, tibia, fibula and patella in a CT volume of one knee, and their surfaces to a fraction of a voxel.
///
/// Dense bone by a threshold; its gaps closed, what it encloses filled; bodies parted at necks of the distance inside;
/// bones named by their size and shape. The surface is a net on the voxels [gibson1998] moved along its normals to half the
/// height of the edge it lies at, so that neither the threshold nor the scanner's point spread moves it.
/// `given` is a label map ([`LABELS`]) on the same grid, made or mended by hand.
///
/// # Errors
/// A volume without bone, or with another number of large bodies than a femur and a tibia; a label map of another grid.
pub fn segment(volume: &Volume, given: Option<&Labels>, options: &SegmentOptions) -> Result<Segmented, StageError> {
    check(volume, given, options)?;
    let mut warnings = Vec::new();
    let threshold = threshold_of(volume, options)?;
    let labels = match given.filter(|_| options.labels_are == LabelMeaning::Masks) {
        Some(given) => given.clone(),
        None => {
            let bodies = solid::bodies(volume, given, threshold, options)?;
            names::named(volume, &bodies, options, &mut warnings)?
        }
    };
    let mut made = surface::surfaces(volume, labels, threshold, options)?;
    made.warnings.splice(0..0, warnings);
    Ok(made)
}

/// The threshold that is given, or that the histogram shows.
fn threshold_of(volume: &Volume, options: &SegmentOptions) -> Result<f64, StageError> {
    options.threshold.map_or_else(|| threshold::from_histogram(volume), Ok)
}

fn check(volume: &Volume, given: Option<&Labels>, options: &SegmentOptions) -> Result<(), StageError> {
    let fail = |what: String| Err(StageError::Knee(what));
    let grid = &volume.grid;
    check_grid(grid)?;
    if volume.values.len() != grid.count() {
        return fail(format!("the CT volume has {} numbers for {:?} voxels", volume.values.len(), grid.size));
    }
    if let Some(at) = volume.values.iter().position(|x| !x.is_finite()) {
        return fail(format!("voxel {:?} of the CT volume is not a finite number", grid.voxel(at)));
    }
    if let Some(given) = given {
        check_labels(grid, given)?;
    }
    check_options(options)
}

/// Refuses voxels that show no knee.
fn check_grid(grid: &Grid) -> Result<(), StageError> {
    if grid.size.iter().any(|n| *n < 8) || grid.index_from_mm().is_none() {
        return Err(StageError::Knee(format!(
            "the CT volume has {:?} voxels; expected a picture of a knee, hundreds along each axis",
            grid.size
        )));
    }
    let coarse = grid.spacing().into_iter().fold(0.0, f64::max);
    if !(0.05..=5.0).contains(&coarse) {
        return Err(StageError::Knee(format!(
            "the CT volume's voxels are {coarse:.3} mm apart; expected 0.2 to 2 mm: check its unit"
        )));
    }
    Ok(())
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check_options(options: &SegmentOptions) -> Result<(), StageError> {
    let fail = |what: String| Err(StageError::Knee(what));
    let positive = [
        ("neck_share", options.neck_share),
        ("least_bone_mm3", options.least_bone_mm3),
        ("edge_reach_mm", options.edge_reach_mm),
    ];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return fail(format!("segment.{name} is {value}; expected a number above 0"));
        }
    }
    if !(0.0..=5.0).contains(&options.closing_mm) || options.smoothing_rounds > 100 {
        return fail("segment.closing_mm must be 0 to 5 mm and segment.smoothing_rounds at most 100".into());
    }
    Ok(())
}

fn check_labels(grid: &Grid, given: &Labels) -> Result<(), StageError> {
    if !given.grid.same_places(grid) {
        return Err(StageError::Knee(format!(
            "ct.labels has {:?} voxels at other places than the CT volume's {:?}; expected a label map on the volume's own grid: export it with the volume as reference",
            given.grid.size, grid.size
        )));
    }
    let known = LABELS.map(|(n, name)| format!("{n} {name}")).join(", ");
    if let Some(odd) = given.values.iter().find(|l| usize::from(**l) > LABELS.len()) {
        return Err(StageError::Knee(format!("ct.labels has a label {odd}; expected 0 none, {known}")));
    }
    for (label, name) in [(1, "femur"), (2, "tibia")] {
        if !given.values.contains(&label) {
            return Err(StageError::Knee(format!(
                "ct.labels has no voxel of the {name} (label {label}); expected {known}"
            )));
        }
    }
    Ok(())
}
