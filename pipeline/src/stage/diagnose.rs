//! Stage 12, diagnose: what the assembled model lacks.

use super::calibrate::{Calibration, MOST_NOISE};
use super::{Files, Stage, Values, Work, reported};
use crate::diagnosis_files::{files_of, of_cut_knees, prepared};
use crate::given::Measured;
use crate::kept::Kept;
use crate::model_file::{self, LoadedModel, assembled_model};
use crate::options::BuildOptions;
use crate::report::check::at_most;
use crate::report::diagnosis_page;
use crate::report::html::escaped;
use diagnosis::diagnosis::{Calibration as Calibrated, Diagnosis, diagnose};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::trial::Source;
use diagnosis::report::component::{Component, Provenance};
use diagnosis::report::{Named, Verdict};
use diagnosis::search::DiagnosisOptions;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::laxity::LaxityTrial;
use sim::spec::ModelSpec;
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::path::Path;

/// A diagnosis in a build.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Diagnosed {
    /// The report.
    pub(crate) diagnosis: Diagnosis,
    /// What was added.
    pub(crate) components: Vec<Component>,
    /// The model with it, or as assembled.
    pub(crate) model: ModelSpec,
    /// What is odd but not fatal.
    pub(crate) warnings: Vec<Notice>,
    /// For metrics.json.
    pub(crate) metrics: DiagnosisMetrics,
}

/// Figures of a diagnosis, for metrics.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DiagnosisMetrics {
    /// What was found.
    pub(crate) verdict: Verdict,
    /// Misfit of the model with its ligaments recalibrated, and with the answer [-].
    pub(crate) misfit: [f64; 2],
    /// Share of the gap on held-out trials that the answer closes [-].
    pub(crate) gap_closed: f64,
    /// The most probable effects, told or not.
    pub(crate) effects: Vec<Named>,
    /// Effects that these data cannot test.
    pub(crate) not_testable: usize,
}

reported!(Diagnosed);

/// The stage.
pub(crate) struct Diagnose;

impl Stage for Diagnose {
    const NUMBER: &'static str = "12";
    const NAME: &'static str = "diagnose";
    const TELLING: &'static [&'static str] = &["verdict", "misfit", "gap_closed"];
    type Inputs<'a> =
        (&'a Kept<Assembled>, &'a Kept<Bones>, &'a Kept<Cartilage>, &'a Kept<Calibration>, &'a Kept<Measured>);
    type Options = DiagnosisOptions;
    type Value = Diagnosed;
    type Fault = String;

    fn options(all: &BuildOptions) -> &DiagnosisOptions {
        &all.diagnose
    }

    fn run(
        (assembled, bones, cartilage, calibration, measured): Self::Inputs<'_>,
        options: &DiagnosisOptions,
        _: &Work,
    ) -> Result<Diagnosed, String> {
        diagnose_built(&assembled_model(assembled, bones, cartilage), calibration, measured, options)
    }

    /// What `build-model diagnose` writes.
    fn artifacts(d: &Diagnosed, _: Self::Inputs<'_>) -> Files {
        let spec = model_file::moved(&d.model, Path::new("/09-assemble"), Path::new("/12-diagnose"));
        // the report of the build has the knee to pull at
        files_of(&d.diagnosis, &d.components, &spec, None).map_err(std::io::Error::other)
    }

    /// The page of the diagnosis.
    fn more(v: &Values) -> String {
        let Some(d) = v.of::<Diagnosed>() else { return String::new() };
        let both =
            both_hold(v, d.diagnosis.verdict).map_or(String::new(), |words| format!("<p>{}</p>", escaped(&words)));
        both + &diagnosis_page::part(&d.model.id, &d.diagnosis)
    }
}

/// Why a misfit of the calibration and a diagnosis that names nothing may both hold.
pub(crate) fn both_hold(v: &Values, verdict: Verdict) -> Option<String> {
    let worst = v.of::<Calibration>()?.worst_misfit().filter(|w| !at_most(*w, MOST_NOISE, 1))?;
    (verdict == Verdict::None).then(|| {
        format!(
            " The calibration misses by {worst:.1} times the noise that was taken, and both hold: that is the noise of reading alone, while the diagnosis also counts repositioning between tests and takes the noise that the data show. What is left over then has no pattern that it could tell from scatter."
        )
    })
}

/// What the assembled model lacks, from where its calibration ended.
fn diagnose_built(
    model: &LoadedModel,
    calibration: &Calibration,
    measured: &Measured,
    options: &DiagnosisOptions,
) -> Result<Diagnosed, String> {
    let displaced = |trials: &[LaxityTrial]| trials.iter().any(|t| t.reference.is_some());
    let (left_out, kept): (Vec<_>, Vec<_>) = measured.laxity.iter().partition(|(_, trials)| displaced(trials));
    if kept.is_empty() && !left_out.is_empty() {
        let what = "every data set holds displacements; a diagnosis needs poses of at least one apparatus";
        return Err(what.into());
    }
    let sources: Vec<Source> = kept.into_iter().map(|(name, trials)| Source::new(name, trials.clone())).collect();
    let catalogue = Catalogue::shipped();
    let provenance = Provenance {
        program: env!("CARGO_PKG_VERSION").into(),
        catalogue: catalogue.version.clone(),
        model: model_file::digest(model),
        data: measured.digests.clone(),
    };
    let knee = prepared(model, &calibration.options).map_err(|e| e.to_string())?;
    let of_all =
        calibration.joint.as_ref().or_else(|| calibration.sources.values().next().filter(|_| sources.len() == 1));
    let mode = of_all.map(|c| &c.found.mode).filter(|mode| !mode.is_empty());
    let calibrated = Calibrated { options: &calibration.options, mode };
    let mut outcome = diagnose(&knee, &model.spec, &sources, &catalogue, options, calibrated)
        .and_then(|o| o.with_provenance(&provenance))
        .map_err(|e| e.to_string())?;
    for words in of_cut_knees(&sources) {
        outcome.diagnosis.plain += &format!("\n{words}");
    }
    let d = &outcome.diagnosis;
    let clear = d.noise.iter().filter(|n| n.taken);
    let mut warnings: Vec<Notice> = left_out
        .iter()
        .map(|(name, _)| {
            Kind::DisplacementsLeftOut
                .notice(format!("laxity.{name} is left out of the diagnosis: it holds displacements, poses are needed"))
                .of(name)
        })
        .collect();
    warnings.extend(clear.map(|n| {
        let unit = if ["vv", "ie"].contains(&n.coordinate.as_str()) { "deg" } else { "mm" };
        Kind::NoiseStated
            .notice(format!(
                "{} {}: a noise of {:.2} {unit} is stated, neighbouring loads say {:.2} ({:.2} to {:.2}), which was taken",
                n.source, n.coordinate, n.stated, n.inferred, n.lower, n.upper
            ))
            .of(&n.source)
            .column(&n.coordinate)
    }));
    let metrics = DiagnosisMetrics {
        verdict: d.verdict,
        misfit: d.misfit,
        gap_closed: d.gap.held_out.closed,
        effects: d.best.clone(),
        not_testable: d.not_testable.len(),
    };
    Ok(Diagnosed {
        model: outcome.model.clone().unwrap_or_else(|| model.spec.clone()),
        components: outcome.components,
        diagnosis: outcome.diagnosis,
        warnings,
        metrics,
    })
}
