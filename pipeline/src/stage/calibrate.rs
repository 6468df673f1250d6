//! Stage 10, calibrate: ligament parameters from all data sets together, then from each.

mod charts;
mod forces;

use super::{Files, Stage, Values, Work, reported};
use crate::calibrate::{self, Watch};
use crate::error::BuildError;
use crate::given::Measured;
use crate::kept::Kept;
use crate::model_file::{self, LoadedModel, assembled_model};
use crate::options::BuildOptions;
use crate::progress::left;
use crate::record::json;
use crate::report::chart::Chart;
use crate::report::check::{self, Check, KeyFigure};
use crate::store;
use crate::which_model::JOINT;
use calibration::calibrate::Calibrated;
use calibration::options::{CalibrateOptions, Method};
use calibration::reports;
use calibration::session::{Joint, Outcome, Session};
use notices::Notice;
use serde::{Deserialize, Serialize};
use sim::laxity::{BuiltBone, LaxityTrial};
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Largest misfit of a calibration, in times the stated noise, that counts as an answer. Ours: beyond it the model lacks something.
pub(crate) const MOST_NOISE: f64 = 2.0;

/// Misfit beyond which a knee is calibrated only in part, in times the stated noise: on average the model misses by as much as one reading in 370 may by
/// chance, three standard deviations.
pub(crate) const PARTLY_NOISE: f64 = 3.0;

/// The question that the misfit answers.
pub(crate) const MISFIT: &str = "Does the model answer as the knee did?";

/// The calibrated models of a build, by source.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Calibration {
    /// In the order of their names.
    pub(crate) sources: BTreeMap<String, Outcome>,
    /// All data sets with one set of ligaments, where there are several and the method can.
    pub(crate) joint: Option<Outcome>,
    /// The options of the cost.
    pub(crate) options: CalibrateOptions,
    /// What is odd but not fatal.
    pub(crate) warnings: Vec<Notice>,
    /// For metrics.json.
    pub(crate) metrics: BTreeMap<String, reports::CalibrationMetrics>,
}

reported!(Calibration);

impl Calibration {
    /// The trials of every data set, by name: also of those that have a part in the joint calibration alone.
    pub(crate) fn data_sets(&self) -> Vec<(String, Vec<LaxityTrial>)> {
        let all: BTreeMap<&str, Vec<&LaxityTrial>> = self.all().flat_map(|(_, o)| o.data_sets()).collect();
        all.into_iter().map(|(name, trials)| (name.to_owned(), trials.into_iter().cloned().collect())).collect()
    }

    /// Every calibration by its folder's name, the joint one last.
    pub(crate) fn all(&self) -> impl Iterator<Item = (&str, &Outcome)> {
        self.sources.iter().map(|(n, o)| (n.as_str(), o)).chain(self.joint.iter().map(|o| (JOINT, o)))
    }

    /// The same with the joint one first: it is the knee, the others stand beside it.
    pub(crate) fn main_first(&self) -> impl Iterator<Item = (&str, &Outcome)> {
        let sources = self.sources.iter().map(|(n, o)| (n.as_str(), o));
        self.joint.iter().map(|o| (JOINT, o)).chain(sources)
    }

    /// The largest misfit of the knee's calibration, in times the stated noise; of all where none is the knee's.
    pub(crate) fn worst_misfit(&self) -> Option<f64> {
        let main = self.main().map(|(_, o)| worst_misfit(&o.found));
        main.or_else(|| self.sources.values().map(|o| worst_misfit(&o.found)).max_by(f64::total_cmp))
    }

    /// The calibration that is the knee: the joint one, else that of the one source; `None` where several sources have none.
    pub(crate) fn main(&self) -> Option<(&str, &Outcome)> {
        self.main_first().next().filter(|_| self.joint.is_some() || self.sources.len() == 1)
    }
}

/// The stage.
pub(crate) struct Calibrate;

impl Stage for Calibrate {
    const NUMBER: &'static str = "10";
    const NAME: &'static str = "calibrate";
    const TELLING: &'static [&'static str] = &["trials", "cost", "parameters_determined"];
    const LOOK: Option<&'static str> = Some(MISFIT);
    type Inputs<'a> = (&'a Kept<Assembled>, &'a Kept<Bones>, &'a Kept<Cartilage>, &'a Kept<Measured>);
    type Options = CalibrateOptions;
    type Value = Calibration;
    type Fault = BuildError;

    fn options(all: &BuildOptions) -> &CalibrateOptions {
        &all.calibrate
    }

    fn heard(all: &BuildOptions) -> Cow<'_, CalibrateOptions> {
        Cow::Owned(all.calibrate.heard())
    }

    fn run(
        (assembled, bones, cartilage, measured): Self::Inputs<'_>,
        options: &CalibrateOptions,
        work: &Work,
    ) -> Result<Calibration, BuildError> {
        let model = assembled_model(assembled, bones, cartilage);
        let elsewhere = tracked_elsewhere(measured, assembled, bones);
        let mut made = calibrate_all(&model, &measured.laxity, options, work)?;
        made.warnings.splice(0..0, measured.warnings.iter().cloned().chain(elsewhere));
        Ok(made)
    }

    /// A folder a source.
    fn artifacts(c: &Calibration, (assembled, ..): Self::Inputs<'_>) -> Files {
        let mut files = Vec::new();
        for (name, outcome) in c.all() {
            let here = Path::new("/10-calibrate").join(name);
            let moved = |spec| model_file::moved(spec, Path::new("/09-assemble"), &here);
            let spec = moved(&outcome.spec);
            let mut own = vec![("model.json".to_owned(), json(&spec))];
            own.extend(calibrate::files_of(outcome, &c.options.cost));
            own.extend(calibrate::samples_file(outcome, &spec, &moved(&assembled.spec)));
            files.extend(own.into_iter().map(|(f, bytes)| (format!("{name}/{f}"), bytes)));
        }
        Ok(files)
    }

    fn charts(v: &Values) -> Vec<Chart> {
        let mut all = v.of::<Calibration>().map_or(vec![], charts::charts);
        let of = |name: &str| {
            v.of::<Calibration>()?
                .all()
                .find(|(n, _)| *n == name)
                .map(|(_, o)| (o.found.samples.len(), o.found.unknowns.interval))
        };
        all.extend(forces::charts(v.folder, &|name| of(name).unwrap_or_default()));
        all
    }

    fn key_figure(v: &Values) -> Option<KeyFigure> {
        let worst = v.of::<Calibration>()?.worst_misfit()?;
        Some(KeyFigure {
            name: "largest misfit to measured laxity",
            value: format!("{worst:.1} times the noise"),
            limit: format!("limit {MOST_NOISE:.0} times the noise that was taken"),
            good: Some(check::at_most(worst, MOST_NOISE, 1)),
        })
    }

    fn checks(v: &Values) -> Vec<Check> {
        let mut out = Vec::new();
        for (name, outcome) in v.of::<Calibration>().into_iter().flat_map(Calibration::main_first) {
            let found = &outcome.found;
            let units = ["deg VV", "deg IE", "mm ML", "mm AP", "mm SI"];
            let rms: Vec<String> =
                found.rms.iter().zip(units).filter_map(|(r, u)| r.map(|r| format!("{r:.1} {u}"))).collect();
            let worst = worst_misfit(found);
            let ligaments = &found.parameters;
            let determined = ligaments.iter().filter(|p| p.determined > 0.5).count();
            out.push(Check {
                question: MISFIT,
                answer: format!(
                    "misses by {} (root mean square of {} trials{}), up to {worst:.1} times the noise stated; {determined} of {} ligament parameters determined by the data",
                    rms.join(", "),
                    outcome.trials.len() - found.elsewhere.len(),
                    match found.elsewhere.len() {
                        0 => String::new(),
                        n => format!("; {n} more end in another equilibrium"),
                    },
                    ligaments.len()
                ),
                good: Some(check::at_most(worst, MOST_NOISE, 1)),
                reaches: None,
                model: Some(name.to_owned()),
                stage: Self::NAME,
            });
            out.extend(forces::checks(name, found, v.of()));
        }
        out
    }
}

/// What is told of tracked bodies whose landmarks or frames are not the build's.
fn tracked_elsewhere(measured: &Measured, assembled: &Assembled, bones: &Bones) -> Vec<Notice> {
    let (frames, surfaces) = (&assembled.spec.frames, &bones.surfaces);
    let built = [
        BuiltBone { frame: &frames.femur, surface: &surfaces.femur },
        BuiltBone { frame: &frames.tibia, surface: &surfaces.tibfib },
    ];
    measured.tracked.iter().flat_map(|(name, of)| of.held(built).into_iter().map(move |n| n.whose(name))).collect()
}

/// The largest misfit of a coordinate, in times the stated noise.
pub(crate) fn worst_misfit(found: &Calibrated) -> f64 {
    found.noise_scale.iter().copied().fold(0.0, f64::max)
}

/// A calibrated model for all data sets together, then for each in the frames found so; interrupted ones are kept in the folder of `work`.
fn calibrate_all(
    model: &LoadedModel,
    laxity: &BTreeMap<String, Vec<LaxityTrial>>,
    options: &CalibrateOptions,
    work: &Work,
) -> Result<Calibration, BuildError> {
    let every: Vec<calibrate::Measured> = laxity.iter().map(|(n, t)| (n.clone(), t.clone())).collect();
    let one = |sources: &[calibrate::Measured], name: &str, joint: Option<Joint>| -> Result<Outcome, BuildError> {
        let file = format!(".calibrate-{name}.cbor");
        // one of another calibration is no use here: stages are keyed
        let saved = work.folder.read_file(&file).filter(|bytes| {
            let session = Session::new(&model.spec, &model_file::digest(model), sources, options);
            session.is_ok_and(|s| s.begin(Some(bytes)).is_ok())
        });
        let mut keep = |bytes: &[u8]| work.folder.write_file(&file, bytes);
        let begun = Instant::now();
        let tell = |share: f64, words: &str| {
            (work.tell)(&format!("calibrate {name}: {:.0} %, {words}{}", 100.0 * share, left(begun, share)));
        };
        let watch = Watch { saved, keep: &mut keep, tell: &tell };
        let outcome = calibrate::run((model, joint), sources, options, &format!("laxity.{name}"), watch)?;
        store::discard(&work.folder.path().join(&file));
        Ok(outcome)
    };
    // finished ones are kept until all are: an interruption costs no more than one
    let together = every.len() > 1 && options.method == Method::Posterior;
    let joint = if together { Some(work.part(JOINT, || one(&every, JOINT, None))?) } else { None };
    // a cut knee tells nothing of what was cut: beside a whole one it has a part in the joint calibration, and none of its own
    let is_cut = |m: &calibrate::Measured| m.1.iter().any(|t| !t.without.is_empty());
    let has_own = |m: &calibrate::Measured| !together || !is_cut(m) || every.iter().all(is_cut);
    let mut sources = BTreeMap::new();
    for (s, measured) in every.iter().enumerate().filter(|(_, m)| has_own(m)) {
        let of = |j: &Outcome| Some(Joint { frames: j.frames.get(s)?.clone(), values: j.found.mode.clone() });
        let joint = joint.as_ref().and_then(of);
        let found = work.part(&measured.0, || one(std::slice::from_ref(measured), &measured.0, joint))?;
        sources.insert(measured.0.clone(), found);
    }
    let mut out = Calibration { sources, joint, options: options.clone(), warnings: vec![], metrics: BTreeMap::new() };
    let named = |name: &str, w: &Notice| {
        let says = w.element.as_deref() == Some(name);
        if says { w.clone() } else { w.clone().whose(name) }
    };
    let told = |(name, o): (&str, &Outcome)| o.warnings.iter().map(|w| named(name, w)).collect::<Vec<_>>();
    out.warnings = out.main_first().flat_map(told).collect();
    out.metrics = out.all().map(|(name, o)| (name.to_owned(), reports::metrics(o))).collect();
    Ok(out)
}
