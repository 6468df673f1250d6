//! Stage 10, calibrate: ligament parameters from all data sets together, then from each.

mod charts;
mod forces;

use super::{Files, Stage, Values, Work, reported};
use crate::calibrate::{self, JOINT, Watch};
use crate::error::BuildError;
use crate::given::Measured;
use crate::kept::Kept;
use crate::model_file::{self, LoadedModel, assembled_model};
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::chart::Chart;
use crate::report::check::{Check, KeyFigure};
use crate::store;
use calibration::calibrate::Calibrated;
use calibration::options::{CalibrateOptions, Method};
use calibration::reports;
use calibration::session::{Outcome, Session};
use calibration::unknowns::KnownFrames;
use serde::{Deserialize, Serialize};
use sim::laxity::LaxityTrial;
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Largest misfit of a calibration, in times the stated noise, that counts as an answer. Ours: beyond it the model lacks something.
const MOST_NOISE: f64 = 2.0;

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
    pub(crate) warnings: Vec<String>,
    /// For metrics.json.
    pub(crate) metrics: BTreeMap<String, reports::CalibrationMetrics>,
}

reported!(Calibration);

impl Calibration {
    /// Every calibration by its folder's name, the joint one last.
    pub(crate) fn all(&self) -> impl Iterator<Item = (&str, &Outcome)> {
        self.sources.iter().map(|(n, o)| (n.as_str(), o)).chain(self.joint.iter().map(|o| (JOINT, o)))
    }
}

/// The stage.
pub(crate) struct Calibrate;

impl Stage for Calibrate {
    const NUMBER: &'static str = "10";
    const NAME: &'static str = "calibrate";
    const TELLING: &'static [&'static str] = &["trials", "cost", "parameters_determined"];
    const LOOK: Option<&'static str> = Some("Does the model answer as the knee did?");
    type Inputs<'a> = (&'a Kept<Assembled>, &'a Kept<Bones>, &'a Kept<Cartilage>, &'a Kept<Measured>);
    type Options = CalibrateOptions;
    type Value = Calibration;
    type Fault = BuildError;

    fn options(all: &BuildOptions) -> &CalibrateOptions {
        &all.calibrate
    }

    fn run(
        (assembled, bones, cartilage, measured): Self::Inputs<'_>,
        options: &CalibrateOptions,
        work: &Work,
    ) -> Result<Calibration, BuildError> {
        let model = assembled_model(assembled, bones, cartilage);
        let mut made = calibrate_all(&model, &measured.laxity, options, work)?;
        made.warnings.splice(0..0, measured.warnings.iter().cloned());
        Ok(made)
    }

    /// A folder a source.
    fn artifacts(c: &Calibration, _: Self::Inputs<'_>) -> Files {
        let mut files = Vec::new();
        for (name, outcome) in c.all() {
            let spec =
                model_file::moved(&outcome.spec, Path::new("/09-assemble"), &Path::new("/10-calibrate").join(name));
            files.push((format!("{name}/model.json"), json(&spec)));
            files.extend(
                calibrate::files_of(outcome, &c.options.cost)
                    .into_iter()
                    .map(|(f, bytes)| (format!("{name}/{f}"), bytes)),
            );
        }
        Ok(files)
    }

    fn charts(v: &Values) -> Vec<Chart> {
        let mut all = v.of::<Calibration>().map_or(vec![], |c| charts::charts(&c.sources));
        all.extend(forces::charts(v.folder));
        all
    }

    fn key_figure(v: &Values) -> Option<KeyFigure> {
        let all = v.of::<Calibration>()?.sources.values();
        let worst = all.map(|o| worst_misfit(&o.found)).fold(0.0, f64::max);
        Some(KeyFigure {
            name: "largest misfit to measured laxity",
            value: format!("{worst:.1} times the noise"),
            limit: format!("limit {MOST_NOISE:.0} times the stated noise"),
            good: Some(worst < MOST_NOISE),
        })
    }

    fn checks(v: &Values) -> Vec<Check> {
        let mut out = Vec::new();
        for (name, outcome) in v.of::<Calibration>().into_iter().flat_map(|c| c.all()) {
            let found = &outcome.found;
            let units = ["deg VV", "deg IE", "mm ML", "mm AP", "mm SI"];
            let rms: Vec<String> =
                found.rms.iter().zip(units).filter_map(|(r, u)| r.map(|r| format!("{r:.1} {u}"))).collect();
            let worst = worst_misfit(found);
            let ligaments = &found.parameters;
            let determined = ligaments.iter().filter(|p| p.determined > 0.5).count();
            out.push(Check {
                question: "Does the model answer as the knee did?",
                answer: format!(
                    "{name}: misses by {} (root mean square of {} trials), up to {worst:.1} times the noise stated; {determined} of {} ligament parameters determined by the data",
                    rms.join(", "),
                    outcome.trials.len(),
                    ligaments.len()
                ),
                good: Some(worst < MOST_NOISE),
                stage: Self::NAME,
            });
            out.extend(forces::checks(name, found, v.of()));
        }
        out
    }
}

/// The largest misfit of a coordinate, in times the stated noise.
fn worst_misfit(found: &Calibrated) -> f64 {
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
    let one =
        |sources: &[calibrate::Measured], name: &str, frames: Option<&KnownFrames>| -> Result<Outcome, BuildError> {
            let file = format!(".calibrate-{name}.cbor");
            // one of another calibration is no use here: stages are keyed
            let saved = work.folder.read_file(&file).filter(|bytes| {
                let session = Session::new(&model.spec, &model_file::digest(model), sources, options);
                session.is_ok_and(|s| s.begin(Some(bytes)).is_ok())
            });
            let mut keep = |bytes: &[u8]| work.folder.write_file(&file, bytes);
            let begun = Instant::now();
            let tell = |share: f64, words: &str| {
                let left = begun.elapsed().as_secs_f64() * (1.0 / share.max(1e-3) - 1.0);
                let left = if share > 0.02 { format!(", about {left:.0} s left") } else { String::new() };
                (work.tell)(&format!("calibrate {name}: {:.0} %, {words}{left}", 100.0 * share));
            };
            let watch = Watch { saved, keep: &mut keep, tell: &tell };
            let outcome = calibrate::run((model, frames), sources, options, &format!("laxity.{name}"), watch)?;
            store::discard(&work.folder.path().join(&file));
            Ok(outcome)
        };
    let together = every.len() > 1 && options.method == Method::Gradient;
    let joint = if together { Some(one(&every, JOINT, None)?) } else { None };
    let mut sources = BTreeMap::new();
    for (s, measured) in every.iter().enumerate() {
        let frames = joint.as_ref().and_then(|j| j.frames.get(s));
        sources.insert(measured.0.clone(), one(std::slice::from_ref(measured), &measured.0, frames)?);
    }
    let mut out = Calibration { sources, joint, options: options.clone(), warnings: vec![], metrics: BTreeMap::new() };
    let told = |(name, o): (&str, &Outcome)| o.warnings.iter().map(|w| format!("{name}: {w}")).collect::<Vec<_>>();
    out.warnings = out.all().flat_map(told).collect();
    out.metrics = out.all().map(|(name, o)| (name.to_owned(), reports::metrics(o))).collect();
    Ok(out)
}
