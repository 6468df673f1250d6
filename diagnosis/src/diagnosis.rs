//! The diagnosis: where, which, added, shrunk, next; and the verdict in words.

pub mod atlas;

use crate::criteria::{DECISIVE_WEIGHT, LEFT_OUT, told_apart};
use crate::discrepancy::{Discrepancy, discrepancy};
use crate::effect::candidate::Candidate;
use crate::effect::catalogue::Catalogue;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::next_test::next_tests;
use crate::problem::Problem;
use crate::problem::trial::Source;
use crate::report::against::{in_place, is_believed, nameable};
use crate::report::carried::carried;
use crate::report::component::{Component, Provenance, augmented, components};
use crate::report::detection::limits_of_detection;
use crate::report::excluded::may_be_torn;
use crate::report::not_excluded::not_excluded;
use crate::report::preparation::prepared;
use crate::report::set_aside::{in_words, set_aside};
use crate::report::unexplained::unexplained;
use crate::report::verdict::{Candidature, by_names, temper, verdict, weights};
use crate::search::contradiction::contradictions;
use crate::search::curves::curves;
use crate::search::exchange::{Exchange, exchange};
use crate::search::held_out::{HeldOut, closed, held_out};
use crate::search::map::{map, map_left_out};
use crate::search::regret::{Hidden, Regret, regret};
use crate::search::{DiagnosisOptions, Search, Searcher};
use calibration::options::CalibrateOptions;
use sim::Model;
use sim::coordinate::{FREE, Free};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

pub use crate::report::{
    Absorbed, Answer, Control, Diagnosis, Exchanged, Gap, GapReport, Named, NotTestable, Value, Verdict,
};
use crate::report::{DetectionLimit, MayBeTorn, named};

/// The diagnosis with what is needed to add its answer.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The report.
    pub diagnosis: Diagnosis,
    /// The components of the first answer; none where nothing is named.
    pub components: Vec<Component>,
    /// The model with them and the ligaments recalibrated beside them.
    pub model: Option<ModelSpec>,
}

impl Outcome {
    /// Adds the first answer, `best`, to the model of `spec`, and what ligaments carry then against `base`; nothing where nothing is named.
    fn add(
        &mut self,
        problem: &Problem,
        spec: &ModelSpec,
        [base, best]: [&Fit; 2],
        temper: f64,
    ) -> Result<(), DiagnosisError> {
        let Some(first) = self.diagnosis.answers.first() else { return Ok(()) };
        let earned = (first.log_bayes_factor, self.diagnosis.gap.held_out.closed);
        self.components = components(problem, best, temper, earned);
        let model = augmented(problem, spec, best, &self.components)?;
        let knees = [problem.models_at(&base.unknowns)?, problem.models_at(&best.unknowns)?];
        self.diagnosis.ligament_forces = carried([(knees[0].shared(), spec), (knees[1].shared(), &model)])?;
        self.model = Some(model);
        Ok(())
    }

    /// The same with what it was found with, in the report, the components and the model that carries them.
    ///
    /// Errors: none of its own.
    pub fn with_provenance(mut self, provenance: &Provenance) -> Result<Outcome, DiagnosisError> {
        self.diagnosis.provenance = Some(provenance.clone());
        self.components.iter_mut().for_each(|c| c.provenance = Some(provenance.clone()));
        if let Some(model) = &mut self.model {
            let first = model.components.len() - self.components.len();
            for (value, c) in model.components[first..].iter_mut().zip(&self.components) {
                *value = serde_json::to_value(c).map_err(|e| DiagnosisError::Component(e.to_string()))?;
            }
        }
        Ok(self)
    }
}

/// The calibration of a knee that is diagnosed.
#[derive(Clone, Copy, Debug)]
pub struct Calibration<'a> {
    /// Its options: a diagnosis has the same ranges, priors, frames, noise and contact nodes.
    pub options: &'a CalibrateOptions,
    /// Where it ended with all of the data ([`calibration::calibrate::Calibrated::mode`]): there the unknowns of a knee built from raw data are sought first.
    pub mode: Option<&'a BTreeMap<String, f64>>,
}

/// Diagnoses a model against data.
///
/// Errors: data or model at fault.
pub fn diagnose(
    model: &Model,
    spec: &ModelSpec,
    sources: &[Source],
    catalogue: &Catalogue,
    options: &DiagnosisOptions,
    calibration: Calibration,
) -> Result<Outcome, DiagnosisError> {
    let problem = asked((model, spec), sources, catalogue, options, calibration)?;
    let searcher = Searcher { problem: &problem, options };
    conclude(&searcher, &judged(&searcher, searcher.search()?)?, spec)
}

/// A diagnosis beside the truth, for benches: what it told, and how far its search stayed behind; no such figure without a truth.
///
/// Errors: as [`diagnose`], a truth that is not in the catalogue.
#[expect(clippy::too_many_arguments, reason = "those of a diagnosis, and the truth")]
pub fn diagnose_beside(
    model: &Model,
    spec: &ModelSpec,
    sources: &[Source],
    catalogue: &Catalogue,
    options: &DiagnosisOptions,
    calibration: Calibration,
    truth: &[Hidden],
) -> Result<(Outcome, Option<Regret>), DiagnosisError> {
    let problem = asked((model, spec), sources, catalogue, options, calibration)?;
    let searcher = Searcher { problem: &problem, options };
    let judged = judged(&searcher, searcher.search()?)?;
    let regret = regret(&problem, (&searcher, &judged.search), truth)?;
    Ok((conclude(&searcher, &judged, spec)?, regret))
}

/// The question, ready to be searched.
fn asked(
    (model, spec): (&Model, &ModelSpec),
    sources: &[Source],
    catalogue: &Catalogue,
    options: &DiagnosisOptions,
    calibration: Calibration,
) -> Result<Problem, DiagnosisError> {
    let problem = Problem::new(model, spec, sources, catalogue, calibration.options)?;
    let present = crate::report::component::present(spec, &problem.sources, &Catalogue::shipped())?;
    let problem = if present.is_empty() { problem } else { problem.with_present(present) };
    prepared(problem, options, calibration.mode)
}

/// A search with its verdict and what that rests on.
struct Judged {
    search: Search,
    verdict: Verdict,
    /// Whether the evidence of its best passes the threshold.
    is_named: bool,
    /// What these trials cannot tell from its best.
    kin: Vec<Fit>,
    /// A field of no name beside the best.
    field: Discrepancy,
    /// The same in its place, with its log Bayes factor.
    alone: (Discrepancy, f64),
    exchange: Option<Exchange>,
    /// Nothing missing and the best on held-out trials.
    held_out: [HeldOut; 2],
    /// Each effect by itself and the best pairs, where the verdict is `unnamed`.
    each: Option<Vec<Fit>>,
}

impl Judged {
    /// The best hypothesis, believed or not.
    fn best(&self) -> &Fit {
        self.search.rivals.first().unwrap_or(&self.search.base)
    }

    /// The best where it is believed, else nothing missing.
    fn believed(&self) -> &Fit {
        if self.is_named { self.best() } else { &self.search.base }
    }

    /// Log Bayes factor of two trials exchanged; none where no two would do better [-].
    fn exchanged(&self) -> f64 {
        odds_of(self.exchange)
    }

    /// What the best gains on held-out trials.
    fn gain(&self) -> f64 {
        self.held_out[1].gain_over(&self.held_out[0])
    }
}

fn odds_of(exchange: Option<Exchange>) -> f64 {
    exchange.map_or(f64::NEG_INFINITY, |e| e.log_bayes_factor)
}

/// A search with its verdict. Before nothing is named, each effect is tried by itself from all its starts; where that finds a better answer, it is judged.
fn judged(searcher: &Searcher, search: Search) -> Result<Judged, DiagnosisError> {
    let mut first = judged_as_it_is(searcher, search.clone())?;
    if first.verdict != Verdict::Unnamed {
        return Ok(first);
    }
    let found = search.rivals.first().map(|f| f.unknowns.clone());
    let (wide, each) = searcher.widened(search)?;
    let is_new = wide.rivals.first().map(|f| &f.unknowns) != found.as_ref();
    let out = if is_new {
        judged_as_it_is(searcher, wide)?
    } else {
        let single: Vec<Fit> = each.iter().filter(|f| f.hypothesis.len() == 1).cloned().collect();
        searcher.take_in(&mut first.search, &single);
        first
    };
    let each = (out.verdict == Verdict::Unnamed).then_some(each);
    Ok(Judged { each, ..out })
}

/// The verdict of a search, no further looked for.
fn judged_as_it_is(searcher: &Searcher, search: Search) -> Result<Judged, DiagnosisError> {
    let (problem, folds) = (searcher.problem, searcher.options.folds);
    let (search, kin) = with_kin(searcher, search)?;
    let best = search.rivals.first().unwrap_or(&search.base);
    let is_named = !best.hypothesis.is_empty() && is_believed(searcher, &search, best);
    let believed = if is_named { best } else { &search.base };
    let field = discrepancy(problem, (&search.readings, &search.covariance), believed)?;
    let alone = if is_named { in_place(searcher, &search, best)? } else { (field.clone(), field.log_bayes_factor) };
    let leaves = searcher.total(believed) / believed.residual.len() as f64;
    let exchange = exchange(problem, &search, believed, leaves.max(1.0))?;
    let scored = |fit: &Fit| held_out(searcher, &search.covariance, fit, folds, folds);
    let before = scored(&search.base)?;
    let after = if is_named { scored(best)? } else { before.clone() };
    let of = Candidature {
        believed,
        base: &search.base,
        is_named,
        field: field.log_bayes_factor,
        alone: alone.1,
        names: nameable(problem),
        exchanged: odds_of(exchange),
        gain: after.gain_over(&before),
        closes: closed(&before, &after),
        has_kin: kin.iter().any(|f| f.hypothesis != best.hypothesis),
    };
    let verdict = verdict(searcher, &weights(searcher, &search, believed), &of);
    Ok(Judged { verdict, is_named, kin, field, alone, exchange, held_out: [before, after], each: None, search })
}

fn conclude(searcher: &Searcher, judged: &Judged, spec: &ModelSpec) -> Result<Outcome, DiagnosisError> {
    let (problem, options) = (searcher.problem, searcher.options);
    let Judged { search, kin, verdict, field, exchange, .. } = judged;
    let (verdict, best, believed) = (*verdict, judged.best(), judged.believed());
    let rivals = weights(searcher, search, believed);
    let [before, after] = &judged.held_out;
    let answers = if matches!(verdict, Verdict::None | Verdict::Unnamed) {
        vec![]
    } else {
        answers(searcher, search, (&rivals, kin), (before, judged.gain()))?
    };
    let shown = if answers.is_empty() { &search.base } else { best };
    let shrunk = if answers.is_empty() { before } else { after };
    let control = if answers.is_empty() { None } else { control(searcher, search, best, before)? };
    let threshold = search.threshold * temper(searcher, best);
    let (missable, open) = left_open(searcher, search, verdict, threshold)?;
    let first = open.iter().find(|(t, _)| t.is_slackened()).or(open.first()).map(|(_, fits)| fits);
    let rival_fits = to_tell_apart(verdict, &search.base, (&rivals, kin), first);
    let may_be_torn: Vec<MayBeTorn> = open.iter().map(|(t, _)| t.clone()).collect();
    let residuals = map(problem, search, &search.base)?;
    let drawn = curves(problem, &residuals, &search.given, &search.base, (!answers.is_empty()).then_some(best));
    let diagnosis = Diagnosis {
        schema: "diagnosis/1".into(),
        verdict,
        answers,
        plain: String::new(),
        description: String::new(),
        before: names_before(problem),
        left_out: crate::report::left_out(problem),
        set_aside: set_aside(problem, search),
        contradictions: contradictions(searcher, search, shown, verdict == Verdict::Unnamed)?,
        unexplained: unexplained(searcher, search, (before, judged.exchanged()), judged.each.as_deref())?,
        not_excluded: not_excluded(searcher, search, verdict, &may_be_torn)?,
        may_be_torn,
        added: vec![],
        gap: GapReport { held_out: gap(before, shrunk), control },
        map: residuals,
        map_after: map(problem, search, shown)?,
        map_left_out: map_left_out(problem, search, &search.base)?,
        curves: drawn,
        not_testable: not_testable(problem),
        without: left_out(&problem.catalogue),
        missable,
        next_tests: next_tests(problem, &rival_fits, options.seed)?,
        noise: problem.noise.clone(),
        ligaments: absorbed(problem, &search.base, shown),
        ligament_forces: vec![],
        threshold,
        wildcard: field.log_bayes_factor,
        wildcard_alone: Some(judged.alone.1),
        exchanged: exchange.and_then(|e| told_exchange(problem, e)),
        misfit: [&search.base, best].map(|f| searcher.total(f) / f.residual.len() as f64),
        best: named(problem, best, temper(searcher, believed)),
        best_log_bayes_factor: Some(searcher.gain(best, &search.base)),
        provenance: None,
    };
    let mut outcome = Outcome { diagnosis, components: vec![], model: None };
    outcome.add(problem, spec, [&search.base, best], temper(searcher, best))?;
    // what is told in words is all that is missing, not what the best answer leaves
    let told = if verdict == Verdict::Unnamed { &judged.alone.0 } else { field };
    let aside: Vec<String> = outcome.diagnosis.set_aside.iter().map(in_words).collect();
    outcome.diagnosis.description =
        crate::report::words::description(problem, &outcome.diagnosis, told, search, &aside);
    outcome.diagnosis.plain = crate::report::plain::plain(&problem.catalogue, &outcome.diagnosis);
    Ok(outcome)
}

/// The search with the kin of its best, where that is believed.
fn with_kin(searcher: &Searcher, search: Search) -> Result<(Search, Vec<Fit>), DiagnosisError> {
    match search.rivals.first() {
        Some(best) if !searcher.options.by_error && is_believed(searcher, &search, best) => {
            let told_apart = told_apart() * temper(searcher, best);
            searcher.closed(search, told_apart)
        }
        _ => Ok((search, vec![])),
    }
}

/// Fits that a next test is to tell apart, with their weights: the answers with their kin; where nothing is named, the rivals all the same; where nothing is
/// missing, a structure as it was given and torn.
fn to_tell_apart<'a>(
    verdict: Verdict,
    base: &'a Fit,
    (rivals, kin): (&[(&'a Fit, f64)], &[Fit]),
    open: Option<&'a [Fit; 2]>,
) -> Vec<(&'a Fit, f64)> {
    let alike = |fits: Vec<&'a Fit>| -> Vec<(&'a Fit, f64)> {
        let weight = 1.0 / fits.len().max(1) as f64;
        fits.into_iter().map(|f| (f, weight)).collect()
    };
    match verdict {
        Verdict::None => match open {
            Some(fits) => alike(fits.iter().collect()),
            None => alike(std::iter::once(base).chain(rivals.iter().take(1).map(|(f, _)| *f)).collect()),
        },
        // of one rival alone the question is whether it is there
        Verdict::Unnamed if rivals.len() < 2 => {
            alike(std::iter::once(base).chain(rivals.iter().map(|(f, _)| *f)).collect())
        }
        Verdict::Unnamed => alike(rivals.iter().map(|(f, _)| *f).collect()),
        _ if kin.is_empty() => rivals.to_vec(),
        _ => {
            let is_kin = |f: &Fit| kin.iter().any(|k| k.hypothesis == f.hypothesis);
            let first = rivals.iter().take(1).map(|(f, _)| *f);
            alike(first.chain(rivals.iter().skip(1).map(|(f, _)| *f).filter(|f| is_kin(f))).collect())
        }
    }
}

/// What would have been missed, and which structures may be torn, each with two fits.
type Open = (Vec<DetectionLimit>, Vec<(MayBeTorn, [Fit; 2])>);

/// What these trials leave open where nothing is named.
fn left_open(searcher: &Searcher, search: &Search, verdict: Verdict, threshold: f64) -> Result<Open, DiagnosisError> {
    if verdict != Verdict::None {
        return Ok((vec![], vec![]));
    }
    Ok((limits_of_detection(searcher.problem, search, threshold)?, may_be_torn(searcher, search)?))
}

/// Names of the data sets that were measured before.
fn names_before(problem: &Problem) -> Vec<String> {
    problem.sources.iter().zip(&problem.before).filter(|(_, b)| **b).map(|(name, _)| name.clone()).collect()
}

/// The exchange with the names of its trials, where it is to be believed.
fn told_exchange(problem: &Problem, exchange: Exchange) -> Option<Exchanged> {
    let name = |i: usize| format!("{} {}", problem.source_of(&problem.trials[i]), problem.trials[i].record.trial);
    let trials = exchange.trials.map(name);
    let log_bayes_factor = exchange.log_bayes_factor;
    (log_bayes_factor > crate::criteria::mixed_up()).then_some(Exchanged { trials, log_bayes_factor })
}

/// Effects of the shipped catalogue that another one has not.
fn left_out(catalogue: &Catalogue) -> Vec<String> {
    let has = |id: &String| catalogue.effect.iter().any(|e| e.id == *id);
    Catalogue::shipped().effect.into_iter().map(|e| e.id).filter(|id| !has(id)).collect()
}

/// The smallest set of answers with 95 % of the belief, and the kin of the first; the first gains `gain` over `before` on held-out trials, what the others gain is found here.
///
/// Errors: a model that cannot be evaluated.
fn answers(
    searcher: &Searcher,
    search: &Search,
    (rivals, kin): (&[(&Fit, f64)], &[Fit]),
    (before, gain): (&HeldOut, f64),
) -> Result<Vec<Answer>, DiagnosisError> {
    let mut out = Vec::new();
    let mut sum = 0.0;
    for (k, (fit, weight)) in by_names(rivals).into_iter().enumerate() {
        // all that the data cannot tell from the first by log odds of 3 stay in
        let close = out.first().is_some_and(|a: &Answer| weight > LEFT_OUT * a.weight);
        let is_kin = kin.iter().any(|f| f.hypothesis == fit.hypothesis);
        if sum >= DECISIVE_WEIGHT && k > 0 && !close && !is_kin {
            continue;
        }
        sum += weight;
        let folds = searcher.options.folds;
        let held_out_gain =
            if k == 0 { gain } else { held_out(searcher, &search.covariance, fit, folds, folds)?.gain_over(before) };
        out.push(Answer {
            effects: named(searcher.problem, fit, temper(searcher, fit)),
            weight,
            log_bayes_factor: searcher.gain(fit, &search.base),
            held_out_gain,
        });
    }
    Ok(out)
}

fn gap(before: &HeldOut, after: &HeldOut) -> Gap {
    let by = |r: &Free<f64>| FREE.into_iter().map(|c| (c.column(), r[c])).collect::<BTreeMap<_, _>>();
    Gap {
        before: before.score,
        after: after.score,
        floor: after.floor.min(after.score),
        closed: closed(before, after),
        rmse_before: by(&before.rmse),
        rmse_after: by(&after.rmse),
    }
}

/// The candidate of as many parameters that the screen likes least.
fn control(
    searcher: &Searcher,
    search: &Search,
    best: &Fit,
    before: &HeldOut,
) -> Result<Option<Control>, DiagnosisError> {
    let size: usize = best.hypothesis.iter().map(Candidate::size).sum();
    let worst = search.screened.iter().rev().find(|(c, _)| c.size() >= size.min(3));
    let Some((candidate, _)) = worst else { return Ok(None) };
    let mut start = search.base.unknowns.clone();
    start.extend(vec![0.1; candidate.size()]);
    let hypothesis = [candidate.clone()];
    let fit =
        searcher.fit(&hypothesis, &start, &search.base.coordinates(), &search.covariance, &search.readings, 10)?;
    let after = held_out(searcher, &search.covariance, &fit, searcher.options.folds, searcher.options.folds)?;
    Ok(Some(Control { effect: candidate.name(), closed: closed(before, &after) }))
}

/// Effects that these data cannot test.
pub fn not_testable(problem: &Problem) -> Vec<NotTestable> {
    let why = |e: &crate::effect::catalogue::Effect| {
        e.untestable(&problem.trials).map(|why| NotTestable { effect: e.id.clone(), why })
    };
    let mut out: Vec<NotTestable> = problem.catalogue.effect.iter().filter_map(why).collect();
    out.extend(crate::report::preparation::told(problem));
    out
}

fn absorbed(problem: &Problem, base: &Fit, with: &Fit) -> Vec<Absorbed> {
    let one = |(k, v): (usize, &calibration::design::Variable)| {
        let bundle = problem.model.bundles.iter().position(|b| Some(&b.name) == v.bundles.first())?;
        let given = &problem.given[bundle];
        let at = |fit: &Fit| problem.nuisance.at(k, fit.unknowns[k]);
        let (value, slope) = at(with);
        Some(Absorbed {
            bundle: v.bundle(),
            parameter: v.kind.name().into(),
            given: match v.kind {
                calibration::design::Kind::ReferenceStrain => given.reference_strain,
                calibration::design::Kind::StiffnessNPerMm => given.stiffness_n_per_mm,
            },
            without: at(base).0,
            with: value,
            sd: slope * with.posterior[(k, k)].max(0.0).sqrt(),
        })
    };
    problem.design.variables.iter().enumerate().filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::candidate::Scope;
    use crate::fit::bare;

    #[test]
    fn where_nothing_is_named_tests_tell_rivals_apart_and_one_alone_from_nothing_missing() {
        let base = bare::fit(vec![]);
        let all = ["itb", "gravity", "load_gain"].map(|id| bare::fit(vec![bare::candidate(id, Scope::Both)]));
        for count in 0..=all.len() {
            let rivals: Vec<(&Fit, f64)> = all.iter().take(count).map(|f| (f, 0.1)).collect();
            let asked = to_tell_apart(Verdict::Unnamed, &base, (&rivals, &[]), None);
            // any rival is asked about, none for the sake of its weight
            assert!(rivals.iter().all(|(f, _)| asked.iter().any(|(a, _)| a.hypothesis == f.hypothesis)));
            assert!(asked.iter().all(|(_, weight)| (weight * asked.len() as f64 - 1.0).abs() < 1e-12));
            // a test tells two things apart: beside one rival the other is nothing missing
            assert_eq!(asked.len() >= 2, count >= 1, "{count}");
            assert_eq!(asked.iter().any(|(a, _)| a.hypothesis.is_empty()), count < 2, "{count}");
        }
    }
}
