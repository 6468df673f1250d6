//! Where nothing is named: structures that may be torn all the same. Recalibrated ligaments take a tear up where a slack structure does as well, and a
//! structure that no trial loads is never missed. What these trials leave open is told, with the test that would close it.

use crate::candidate::{Candidate, Scope};
use crate::catalogue::Effect;
use crate::criteria::told_apart;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::report::MayBeTorn;
use crate::search::{Search, Searcher};
use crate::verdict::temper;
use inference::knee::Quantity;
use rayon::prelude::*;

/// Such structures, those first that carry most, each with two fits: as it was given, and torn.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn may_be_torn(searcher: &Searcher, search: &Search) -> Result<Vec<(MayBeTorn, [Fit; 2])>, DiagnosisError> {
    let (problem, base) = (searcher.problem, &search.base);
    let given = searcher.standing(&[], problem.nuisance.given.clone(), &search.readings)?;
    let candidates = structures(problem);
    let all: Vec<_> = candidates
        .par_iter()
        .filter_map(|c| Some((c, c.variant_name()?)))
        .map(|(c, structure)| one(searcher, search, &given, (c, structure)))
        .collect::<Result<_, DiagnosisError>>()?;
    let least = -told_apart() * temper(searcher, base);
    let mut out: Vec<_> = all.into_iter().filter(|(t, _)| t.log_odds > least).collect();
    out.sort_by(|a, b| b.0.given_n.total_cmp(&a.0.given_n));
    Ok(out)
}

/// A loss of each structure that the model has, whether or not these trials could name it.
fn structures(problem: &Problem) -> Vec<Candidate> {
    let may_be_whole = |e: &&Effect| e.parameter.iter().any(|p| p.whole.is_some());
    let all = problem.catalogue.effect.iter().filter(may_be_whole).flat_map(|effect| {
        let of = |variant| Candidate { effect: effect.clone(), variant, scope: Scope::Both };
        (0..effect.variants.len()).map(of)
    });
    let has = |c: &Candidate| c.variant_name().is_some_and(|s| !problem.nuisance.of_structure(&s).is_empty());
    all.filter(has).collect()
}

fn one(
    searcher: &Searcher,
    search: &Search,
    given: &Fit,
    (candidate, structure): (&Candidate, String),
) -> Result<(MayBeTorn, [Fit; 2]), DiagnosisError> {
    let (problem, base) = (searcher.problem, &search.base);
    let [given_n, now_n] = [most(problem, given, &structure)?, most(problem, base, &structure)?];
    let own = problem.nuisance.of_structure(&structure);
    let start = searcher.put_back(base, candidate);
    let as_given = searcher.fit_holding((&[], &own), (&start, &base.coordinates()), search)?;
    let mut torn = fit_torn(searcher, search, candidate, start)?;
    if torn.log_evidence < base.log_evidence {
        let other = fit_torn(searcher, search, candidate, problem.nuisance.given.clone())?;
        torn = if other.log_evidence > torn.log_evidence { other } else { torn };
    }
    let told = MayBeTorn {
        structure,
        log_odds: torn.log_evidence - base.log_evidence,
        given_n,
        now_n,
        slack: slack(problem, base, &own),
        against_given: base.log_evidence - as_given.log_evidence,
    };
    Ok((told, [as_given, torn]))
}

/// A fit with all of a structure lost, from a knee. The loss is held, so that its evidence is that of the tear, whatever the prior of one.
fn fit_torn(
    searcher: &Searcher,
    search: &Search,
    candidate: &Candidate,
    knee: Vec<f64>,
) -> Result<Fit, DiagnosisError> {
    let nuisances = knee.len();
    let whole = candidate.effect.parameter.iter().map(|p| p.whole.unwrap_or(0.0) / p.sd);
    let start = knee.into_iter().chain(whole).collect();
    let torn = searcher.standing(std::slice::from_ref(candidate), start, &search.readings)?;
    let sizes: Vec<usize> = (nuisances..torn.unknowns.len()).collect();
    searcher.fit_holding((&torn.hypothesis, &sizes), (&torn.unknowns, &torn.coordinates()), search)
}

/// The largest fall of a reference strain among some unknowns, from the model as given to a fit [-].
fn slack(problem: &Problem, fit: &Fit, own: &[usize]) -> f64 {
    let nuisance = &problem.nuisance;
    let is_strain = |k: &&usize| matches!(nuisance.list[**k].quantity, Quantity::ReferenceStrain(_));
    let fall = |&k: &usize| nuisance.at(k, nuisance.given[k]).0 - nuisance.at(k, fit.unknowns[k]).0;
    own.iter().filter(is_strain).map(fall).fold(0.0, f64::max)
}

/// The most that a structure carries in any trial at a fit [N].
fn most(problem: &Problem, fit: &Fit, structure: &str) -> Result<f64, DiagnosisError> {
    let models = problem.models_at(&fit.unknowns)?;
    let names = models.shared().bundle_names();
    let in_trial = |(trial, rest): (&inference::trial::Trial, &sim::equilibrium::Equilibrium)| {
        let model = models.of(trial.source);
        let forces = model.bundle_forces(&model.fibre_states(&model.joint.pose(&rest.q)));
        let own = names.iter().zip(&forces).filter(|(name, _)| crate::effect::belongs(name, structure));
        own.map(|(_, f)| f).sum::<f64>()
    };
    Ok(problem.trials.iter().zip(&fit.linear.rests).map(in_trial).fold(0.0, f64::max))
}
