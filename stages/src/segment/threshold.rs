//! The threshold of dense bone, from the histogram.

use crate::StageError;
use meshes::volume::Volume;
use meshes::volume::histogram::Histogram;

/// Share of the way from soft tissue to dense bone [-]. A thin cortex, blurred, still passes; trabecular bone mostly does not.
const SHARE: f64 = 0.35;
/// The densest share of voxels is left out of the histogram: metal.
const METAL_SHARE: f64 = 1e-4;

/// Parts air or fat, soft tissue, and dense bone by their histogram [otsu1979]; the threshold lies a third of the way from the
/// middle of soft tissue to the middle of dense bone.
pub(super) fn from_histogram(volume: &Volume) -> Result<f64, StageError> {
    let fail = || {
        StageError::Knee("no bone stands out in the CT volume: expected air or soft tissue and brighter bone; check the file, or give segment.threshold".into())
    };
    let (low, high) = volume.values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let all = Histogram::new(&volume.values, f64::from(low), f64::from(high) + 1e-3).ok_or_else(fail)?;
    let top = all.percentile(1.0 - METAL_SHARE);
    let [_, upper] =
        Histogram::new(&volume.values, f64::from(low), top).and_then(|h| h.three_classes()).ok_or_else(fail)?;
    // Soft tissue is the commonest value below dense bone and above air, which lies as far down again.
    let lower = upper - 0.75 * (top - upper).max(0.5 * (upper - f64::from(low)));
    let soft = Histogram::new(&volume.values, lower.max(f64::from(low)), upper).ok_or_else(fail)?.percentile(0.5);
    let dense = Histogram::new(&volume.values, upper, top).ok_or_else(fail)?.percentile(0.5);
    if dense > soft { Ok(soft + SHARE * (dense - soft)) } else { Err(fail()) }
}
