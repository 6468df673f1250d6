//! Mean and interval beside what a model answers, by the samples of the posterior that its calibration left.

use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::record::hash;
use crate::store;
use calibration::error::CalibrationError;
use calibration::posterior::{error_of_ends, is_outside};
use calibration::samples::{Question, SCHEMA, Samples, group_sums};
use notices::{Kind, Notice};
use sim::coordinate::FREE;
use sim::flags::Flag;
use sim::laxity::{LaxityTrial, TrialResult};

/// The file beside a calibrated model.json.
const FILE: &str = "samples.json";

/// Samples of a model, and what to say of them; none where the model has none, or was changed since.
pub(crate) fn of(loaded: &LoadedModel) -> Result<(Option<Samples>, Vec<Notice>), BuildError> {
    let file = loaded.folder.join(FILE);
    let is_calibrated = loaded.file.file_name().is_some_and(|n| n == "model.json") && loaded.spec.calibrated.is_some();
    if !is_calibrated || !store::exists(&file) {
        return Ok((None, vec![]));
    }
    let fault = |what: String| {
        BuildError::of_file(&file, format!("{}: {what}; expected what calibrate writes", file.display()))
    };
    let samples: Samples =
        serde_json::from_slice(&store::read(&file)?).map_err(|e| fault(format!("column {}: {e}", e.column())))?;
    if samples.schema != SCHEMA {
        return Err(fault(format!("schema \"{}\", {SCHEMA} is read", samples.schema)));
    }
    let n = samples.len();
    if let Some(u) = samples.of.unknowns.iter().find(|u| u.samples.len() != n) {
        return Err(fault(format!("{} has {} samples, others {n}", u.name, u.samples.len())));
    }
    if samples.model != hash(&store::read(&loaded.file)?) {
        let text = format!(
            "{} was changed since it was calibrated: its samples are not used, values have no intervals",
            loaded.file.display()
        );
        return Ok((None, vec![Kind::ModelChanged.notice(text)]));
    }
    Ok((Some(samples), vec![]))
}

/// An interval needs so many samples [-].
const FEWEST: usize = 2;

/// What is asked of the samples of a model.
#[derive(Clone, Copy)]
pub(crate) struct Asking<'a> {
    /// Names of the bundles, in the order of the forces.
    pub(crate) bundles: &'a [String],
    /// Cut bundles or ligaments.
    pub(crate) without: &'a [String],
    /// In the frames of which data set, by its place; none: in those that all share.
    pub(crate) source: Option<usize>,
    /// How many samples at most.
    pub(crate) most: usize,
    /// AP from the CT pose beyond which the femur has left the plateau [mm]; none: as in a laxity trial.
    pub(crate) dislocation_ap_mm: Option<f64>,
}

/// What is said of results that were given bands.
#[derive(Clone, Debug, Default)]
pub(crate) struct Banded {
    /// A line for a reader.
    pub(crate) words: String,
    /// What is odd.
    pub(crate) warnings: Vec<Notice>,
    /// By how many samples.
    pub(crate) samples: usize,
    /// Poses and forces that the single model has outside its interval, and the rows in which it has any.
    pub(crate) outside: [usize; 2],
}

/// Gives results the sums of ligament groups.
pub(crate) fn sum_up(results: &mut [TrialResult], bundles: &[String]) {
    for r in results.iter_mut() {
        r.outputs.extend(group_sums(bundles, &r.forces_n));
    }
}

/// Gives results their bands, and the sums of ligament groups.
pub(crate) fn add(loaded: &LoadedModel, results: &mut [TrialResult], asking: &Asking) -> Result<(), BuildError> {
    sum_up(results, asking.bundles);
    if asking.most > 0
        && let (Some(samples), _) = of(loaded)?
    {
        by(&samples, loaded, results, asking);
    }
    Ok(())
}

/// Gives results the bands of samples, and flags where samples leave the plateau or rest otherwise and where the single model lies outside its interval.
pub(crate) fn by(samples: &Samples, loaded: &LoadedModel, results: &mut [TrialResult], asking: &Asking) -> Banded {
    let none = |why: String| Banded { warnings: vec![Kind::NoIntervals.notice(why)], ..Banded::default() };
    if !loaded.spec.components.is_empty() {
        return none("what was added to the model is in its values and not in its samples: no intervals".into());
    }
    let trials: Vec<LaxityTrial> = results.iter().map(asked).collect();
    let values: Vec<Vec<(String, f64)>> = results.iter().map(|r| r.columns(asking.bundles)).collect();
    let question = Question {
        trials: &trials,
        without: asking.without,
        source: asking.source,
        most: asking.most,
        dislocation_ap_mm: asking.dislocation_ap_mm,
        values: Some(&values),
    };
    let bands = match samples.bands(&loaded.meshes, &question) {
        Ok(bands) => bands,
        Err(CalibrationError::Targets(why)) => return none(format!("no intervals: {why}")),
        Err(e) => return none(format!("no intervals: {e}")),
    };
    let (mut outside, mut told) = ([0; 2], 0);
    let rows = bands.rows.into_iter().zip(bands.leaving).zip(bands.kinds);
    for ((r, ((row, leaving), kinds)), values) in results.iter_mut().zip(rows).zip(&values) {
        // where the one knee has no answer, samples give it none, and none rests otherwise than it
        if r.flags.contains(&Flag::NoEquilibrium) {
            continue;
        }
        r.bands = row;
        let differing = kinds.flags(&r.flags, bands.asked);
        r.flags.extend(differing);
        r.flags.extend((leaving > 0).then_some(Flag::SamplesLeave { count: leaving, of: bands.asked }));
        let own = outside_of(r, values);
        told += r.bands.iter().filter(|(name, _)| is_pose_or_force(name)).count();
        outside = [outside[0] + own.len(), outside[1] + usize::from(!own.is_empty())];
        r.flags.extend((!own.is_empty()).then_some(Flag::OutsideInterval(own)));
    }
    if bands.asked < FEWEST {
        return none(too_few(samples.len(), bands.asked));
    }
    let fewer = if asking.most > bands.asked {
        format!(" (all that it left; {} were asked for)", asking.most)
    } else {
        String::new()
    };
    let n = (100.0 * samples.of.interval).round();
    let error = error_of_ends(bands.asked, samples.of.interval)
        .map_or(String::new(), |e| format!("; an end errs by {:.0} % of half an interval", 100.0 * e));
    let of_one = match outside {
        [0, _] => String::new(),
        [k, rows] => format!(
            "{k} of {told} poses and forces of the single most probable model lie outside their interval, in {rows} row{} (flags)\n",
            if rows == 1 { "" } else { "s" }
        ),
    };
    let lost = (bands.lost > 0).then(|| {
        Kind::SamplesLost
            .notice(format!(
                "up to {} of {} samples have no equilibrium in a row: intervals there are of those that have",
                bands.lost, bands.asked
            ))
            .count(bands.lost)
    });
    let has_no_pose = |r: &&TrialResult| !r.bands.is_empty() && FREE.iter().all(|c| r.band(&c.column()).is_none());
    let unposed = results.iter().filter(has_no_pose).count();
    let poses = (unposed > 0).then(|| {
        let rows = if unposed == 1 { "row has" } else { "rows have" };
        let why = "under the loads that the model lacks fewer than two samples stay on the plateau";
        Kind::NoIntervals.notice(format!("{unposed} {rows} no interval of the pose: {why}")).count(unposed)
    });
    Banded {
        words: format!("mean and {n} % interval by {} samples of the posterior{fewer}{error}\n{of_one}", bands.asked),
        warnings: lost.into_iter().chain(unasked(results)).chain(poses).collect(),
        samples: bands.asked,
        outside,
    }
}

/// Why there are no intervals, where a calibration `left` so many samples and fewer than an interval needs were asked.
fn too_few(left: usize, asked: usize) -> String {
    let samples = if left == 1 { "sample" } else { "samples" };
    if left < FEWEST {
        return format!("the calibration left {left} {samples}: no intervals; they need {FEWEST}");
    }
    format!("--samples {asked}: no intervals; they need {FEWEST} samples, 0 is the single model")
}

/// What is said of answered rows without an interval and without a word of their samples.
fn unasked(results: &[TrialResult]) -> Option<Notice> {
    let has_a_reason = |f: &Flag| matches!(f, Flag::NoEquilibrium | Flag::SamplesLeave { .. });
    let is_unasked = |r: &&TrialResult| r.bands.is_empty() && !r.flags.iter().any(has_a_reason);
    let count = results.iter().filter(is_unasked).count();
    let rows = if count == 1 { "row has" } else { "rows have" };
    let why = "no sample has an equilibrium there, or the most probable knee has none without friction";
    (count > 0).then(|| Kind::NoIntervals.notice(format!("{count} {rows} no interval: {why}")).count(count))
}

/// Columns in which the single model lies outside its interval.
fn outside_of(r: &TrialResult, values: &[(String, f64)]) -> Vec<String> {
    let lies_outside = |(name, value): &&(String, f64)| {
        is_pose_or_force(name) && r.band(name).is_some_and(|b| is_outside(*value, [b.lower, b.upper]))
    };
    values.iter().filter(lies_outside).map(|(name, _)| name.clone()).collect()
}

/// True of columns of poses, bundles and sums of bundles: the others have less scatter than another simulator would give them.
pub(crate) fn is_pose_or_force(column: &str) -> bool {
    column.starts_with("force_") || column.starts_with("group_") || FREE.iter().any(|c| c.column() == column)
}

/// The trial that a result answers: a protocol's row says its flexion in its pose.
fn asked(r: &TrialResult) -> LaxityTrial {
    LaxityTrial { fe_deg: r.pose.fe_deg, ..r.trial.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Load;
    use sim::laxity::{Band, Test};
    use sim::spec::PoseSpec;

    #[test]
    fn a_single_model_outside_its_interval_is_told_by_column() {
        let band = |lower: f64, upper: f64| Band { mean: 0.5 * (lower + upper), lower, upper };
        let trial = LaxityTrial::asked("t".into(), Test::Neutral, 30.0, Load::default());
        let mut r = TrialResult {
            trial,
            pose: PoseSpec { ap_mm: 3.0, ..PoseSpec::default() },
            forces_n: vec![40.0, 10.0],
            outputs: vec![("contact_medial_force_n".into(), 9.0)],
            flags: vec![],
            bands: vec![],
        };
        r.bands = vec![
            ("ap_mm".into(), band(3.5, 5.0)),
            ("ie_deg".into(), band(-1.0, 1.0)),
            ("force_ACL_AM_n".into(), band(10.0, 39.0)),
            ("force_LCL_n".into(), band(5.0, 15.0)),
            ("contact_medial_force_n".into(), band(1.0, 2.0)),
        ];
        let values = r.columns(&["ACL_AM".to_owned(), "LCL".to_owned()]);
        assert_eq!(outside_of(&r, &values), ["ap_mm", "force_ACL_AM_n"]);
    }
}
