//! What could be named with a protocol, before any data are seen: signatures at one prior standard deviation, what ligaments would absorb of
//! them, and what each would be mistaken for.

use crate::criteria::NAMED;
use crate::diagnosis::not_testable;
use crate::effect::candidate::Candidate;
use crate::effect::catalogue::Catalogue;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::{Marginal, signatures};
use crate::problem::covariance::{Readings, covariance, remainders};
use crate::problem::outlier::Mixture;
use crate::problem::trial::Source;
use crate::problem::{Begin, Problem};
use crate::report::{NotTestable, scope_name};
use crate::search::DiagnosisOptions;
use calibration::options::CalibrateOptions;
use inference::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sim::Model;
use sim::coordinate::Free;
use sim::equilibrium::starts_of;
use sim::spec::ModelSpec;
use std::fmt::Write;

/// An effect in a scope.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtlasRow {
    /// The effect.
    pub effect: String,
    /// The structure it is about.
    pub variant: Option<String>,
    /// Where it would act.
    pub scope: String,
    /// Root mean square of its signature at one prior standard deviation, in scatters [-].
    pub raw: f64,
    /// The same with ligaments and contact recalibrated [-].
    pub retained: f64,
    /// Share of its information that they absorb [-].
    pub absorbed: f64,
    /// Expected log Bayes factor at one prior standard deviation [-].
    pub expected_evidence: f64,
    /// Size, in prior standard deviations, at which half of the data sets would earn the effect its name ([`NAMED`]) [-].
    pub detectable: f64,
    /// What it would be mistaken for: less than 3 of expected log odds apart.
    pub confusable: Vec<String>,
}

/// The atlas of a protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Atlas {
    /// "atlas/1".
    pub schema: String,
    /// Effects, the plainest first.
    pub effects: Vec<AtlasRow>,
    /// What these data could never test.
    pub not_testable: Vec<NotTestable>,
}

/// The atlas of a model and trials; measured poses are not looked at.
///
/// Errors: data or model at fault.
pub fn atlas(
    model: &Model,
    spec: &ModelSpec,
    sources: &[Source],
    catalogue: &Catalogue,
    (options, calibrate): (&DiagnosisOptions, &CalibrateOptions),
) -> Result<Atlas, DiagnosisError> {
    let problem = Problem::new(model, spec, sources, catalogue, calibrate)?;
    let (fit, cov) = before_data(&problem, options)?;
    let readings = Readings::of(&problem, &|_| true);
    let candidates = problem.candidates();
    let signatures = signatures(&problem, &fit, &candidates)?;
    let plain = Whitening::new(readings.block_of(&cov))?;
    let marginal = Marginal::new(&fit, &readings, &cov)?;
    let white =
        |w: &Whitening| -> Vec<DMatrix<f64>> { signatures.iter().map(|s| w.white(&readings.rows_of(s))).collect() };
    let (raw, kept) = (white(&plain), white(&marginal.whitening));
    let mut effects: Vec<AtlasRow> =
        (0..candidates.len()).map(|k| row(&problem, &candidates, (&raw, &kept), k)).collect();
    effects.sort_by(|a, b| b.expected_evidence.total_cmp(&a.expected_evidence));
    let (effects, unfelt): (Vec<AtlasRow>, Vec<AtlasRow>) = effects.into_iter().partition(|r| r.raw > UNFELT);
    let mut not_testable = not_testable(&problem);
    not_testable.extend(unfelt.into_iter().map(AtlasRow::untestable));
    Ok(Atlas { schema: "atlas/1".into(), effects, not_testable })
}

/// A signature below this, in scatters, is none [-]: what is left of an effect that does nothing in these trials is the solver's own error; ours.
const UNFELT: f64 = 1e-3;

impl AtlasRow {
    /// The same as what these data could never test.
    fn untestable(self) -> NotTestable {
        let of = self.variant.map_or(String::new(), |v| format!(" of {v}"));
        let place = if self.scope == "both" { "any data set".to_owned() } else { self.scope };
        NotTestable { effect: self.effect + &of, why: format!("it moves no reading of {place}") }
    }
}

/// The model as given, and the scatter of its readings.
fn before_data(problem: &Problem, options: &DiagnosisOptions) -> Result<(Fit, DMatrix<f64>), DiagnosisError> {
    let unknowns = vec![0.0; problem.nuisances()];
    let linear = problem.linear(&[], &unknowns, Begin::At(&[]))?;
    let starts = starts_of(&linear.rests);
    let extra = remainders(problem, &starts, options.draws, &options.floor)? * options.floor.nonlinear.powi(2);
    let cov = covariance(problem, &[], &unknowns, &linear.rests, &options.floor)? + extra;
    let readings = Readings::of(problem, &|_| true);
    let fit = Fit {
        hypothesis: vec![],
        residual: DVector::zeros(readings.rows.len()),
        misfit: 0.0,
        outliers: vec![],
        log_evidence: 0.0,
        posterior: DMatrix::identity(unknowns.len(), unknowns.len()),
        means: problem.means(unknowns.len()),
        unknowns,
        linear,
    };
    Ok((fit, cov))
}

/// Evidence that an analysis can expect from a known signature [nats].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Promise {
    /// Half the signature's square under the scatter with ligaments and contact marginalised.
    pub all: f64,
    /// The same with trials that jump set aside, as the analysis sets them aside ([`crate::problem::outlier`]): an effect may throw a knee on the brink far, but so may
    /// much else, and the analysis takes whichever branch is nearer.
    pub settled: f64,
}

/// What an analysis with this model can expect from a known signature (a row a trial, VV, IE [deg], ML, AP, SI [mm]).
///
/// Errors: data or model at fault, another number of rows than trials.
pub fn promise(
    model: &Model,
    spec: &ModelSpec,
    sources: &[Source],
    signature: &[Free<f64>],
    (options, calibrate): (&DiagnosisOptions, &CalibrateOptions),
) -> Result<Promise, DiagnosisError> {
    let problem = Problem::new(model, spec, sources, &Catalogue::shipped(), calibrate)?;
    if signature.len() != problem.trials.len() {
        return Err(DiagnosisError::Data(format!(
            "a signature of {} rows for {} trials",
            signature.len(),
            problem.trials.len()
        )));
    }
    let (fit, cov) = before_data(&problem, options)?;
    let readings = Readings::of(&problem, &|_| true);
    let jacobian = readings.rows_of(&fit.linear.jacobian);
    let mixture = Mixture::new(&readings, readings.block_of(&cov) + &jacobian * jacobian.transpose(), &problem.trials)?;
    let all: Vec<f64> = signature.iter().flatten().copied().collect();
    let signature = readings.pick(&all);
    let half = |w: &Whitening| 0.5 * w.white_vector(&signature).norm_squared();
    let all = half(mixture.plain());
    Ok(Promise { all, settled: mixture.weigh(&signature).whitening.as_ref().map_or(all, half) })
}

fn row(
    problem: &Problem,
    candidates: &[Candidate],
    (raw, kept): (&[DMatrix<f64>], &[DMatrix<f64>]),
    k: usize,
) -> AtlasRow {
    let c = &candidates[k];
    let n = kept[k].nrows() as f64;
    let size = c.size() as f64;
    let power = kept[k].norm_squared() / size;
    let occam = Cholesky::new(DMatrix::identity(c.size(), c.size()) + kept[k].tr_mul(&kept[k]))
        .map_or(0.0, |f| f.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>());
    // what another effect, at its best size, leaves of this one
    let mut confusable: Vec<(f64, String)> = Vec::new();
    for (j, other) in candidates.iter().enumerate().filter(|(j, _)| *j != k) {
        if other.effect.id == c.effect.id {
            continue;
        }
        let inner = DMatrix::identity(other.size(), other.size()) * 0.25 + kept[j].tr_mul(&kept[j]);
        let Some(f) = Cholesky::new(inner) else { continue };
        let cross = kept[j].tr_mul(&kept[k]);
        let left = 0.5 * (kept[k].norm_squared() - (cross.transpose() * f.solve(&cross)).trace()) / size;
        if left < 3.0 {
            confusable.push((left, format!("{} ({})", other.name(), scope_name(problem, other))));
        }
    }
    confusable.sort_by(|a, b| a.0.total_cmp(&b.0));
    AtlasRow {
        effect: c.name(),
        variant: c.variant_name(),
        scope: scope_name(problem, c),
        raw: (raw[k].norm_squared() / (n * size)).sqrt(),
        retained: (power / n).sqrt(),
        absorbed: 1.0 - kept[k].norm_squared() / raw[k].norm_squared().max(1e-12),
        expected_evidence: 0.5 * power - occam,
        detectable: (2.0 * (NAMED + occam) / power.max(1e-9)).sqrt(),
        confusable: confusable.into_iter().take(4).map(|(_, name)| name).collect(),
    }
}

/// Sizes beyond so many prior standard deviations are told as beyond it [-]: no knee has one.
const BEYOND: f64 = 10.0;

fn size_in_words(detectable: f64) -> String {
    if detectable > BEYOND { format!("> {BEYOND}") } else { format!("{detectable:.2}") }
}

/// The atlas as lines for a terminal.
pub fn table(atlas: &Atlas) -> String {
    let mut out = format!(
        "{:<22} {:<18} {:<6} {:>6} {:>8} {:>8} {:>9} {:>10}  mistaken for\n",
        "effect", "structure", "where", "raw", "retained", "absorbed", "evidence", "detectable"
    );
    for r in &atlas.effects {
        let _ = writeln!(
            out,
            "{:<22} {:<18} {:<6} {:>6.2} {:>8.2} {:>7.0}% {:>9.1} {:>10}  {}",
            r.effect,
            r.variant.as_deref().unwrap_or(""),
            r.scope,
            r.raw,
            r.retained,
            100.0 * r.absorbed,
            r.expected_evidence,
            size_in_words(r.detectable),
            r.confusable.join(", ")
        );
    }
    for n in &atlas.not_testable {
        let _ = writeln!(out, "not testable: {}, {}", n.effect, n.why);
    }
    out
}
