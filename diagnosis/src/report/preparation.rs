//! From a model and data to a question that can be searched: the model moved to where its own unknowns fit, noise as the data have it, and what the
//! unknowns would take up told before it is looked for.

use crate::criteria::{TEMPER, TESTABLE_SIZE};
use crate::effect::candidate::{Candidate, Scope};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::{Marginal, Score, signatures};
use crate::problem::covariance::Readings;
use crate::problem::noise::scales;
use crate::problem::{Problem, TakenUp};
use crate::report::NotTestable;
use crate::search::{DiagnosisOptions, Searcher, Start, WIDTH};
use inference::knee::Quantity;
use inference::parameter::Parameter;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Rounds in which a built knee is fitted and its question asked about the fit: in the second the scatter is that of the fitted knee.
const CENTRINGS: usize = 2;

/// A question ready to be searched.
///
/// Errors: a model that cannot be evaluated, data without information.
pub(crate) fn prepared(
    problem: Problem,
    options: &DiagnosisOptions,
    calibrated: Option<&BTreeMap<String, f64>>,
) -> Result<Problem, DiagnosisError> {
    let problem = problem.within_the_joint();
    let is_built = problem.nuisance.are_of_a_built_knee();
    let problem = if is_built { centred(problem, options, calibrated)? } else { problem };
    let mut problem = problem.with_far_rests(true);
    let mut start = Searcher { problem: &problem, options }.start()?;
    let readings = Readings::of(&problem, &|_| true);
    let noise = scales(&problem, &readings, &start.base.residual, &start.cov);
    let is_taken = noise.iter().any(|n| n.taken);
    problem = problem.with_noise(noise);
    if is_taken {
        let base = Searcher { problem: &problem, options }.start()?.base;
        problem = if is_built { problem.centred_at(&base.unknowns)? } else { problem };
        start = Searcher { problem: &problem, options }.start()?;
    }
    let little = problem.fits_little(&start.base.linear.rests);
    problem = if little { problem.with_rests_as_they_are() } else { problem.with_far_rests(false) };
    if is_built {
        problem.absorbed = absorbed(&problem, &start, &readings, options)?;
    }
    Ok(problem)
}

/// The question about a built knee, moved to the most probable values of its unknowns: first those of a calibration, then its own.
fn centred(
    problem: Problem,
    options: &DiagnosisOptions,
    calibrated: Option<&BTreeMap<String, f64>>,
) -> Result<Problem, DiagnosisError> {
    let mut problem = problem.with_far_rests(true);
    if let Some(found) = calibrated {
        let values = problem.nuisance.at_values(found);
        problem = problem.centred_at(&values)?;
    }
    for _ in 0..CENTRINGS {
        let base = Searcher { problem: &problem, options }.start()?.base;
        problem = problem.centred_at(&base.unknowns)?;
    }
    Ok(problem)
}

/// Candidates that would earn a name at twice their usual size if frames or sites were known, and do not as they are. The readings' values play no part.
/// An effect that may be whole is judged about the knee as it was given, too: calibrated to a knee that lacks a ligament, that ligament is slack already.
fn absorbed(
    problem: &Problem,
    start: &Start,
    readings: &Readings,
    options: &DiagnosisOptions,
) -> Result<Vec<TakenUp>, DiagnosisError> {
    let evidence = TEMPER * options.least_evidence;
    let here = taken_up(problem, (&start.base, &start.cov), readings, (problem.candidates(), evidence))?;
    let may_be_whole = |t: &TakenUp| t.candidate.effect.parameter.iter().any(|p| p.whole.is_some());
    let (whole, mut out): (Vec<TakenUp>, Vec<TakenUp>) = here.into_iter().partition(may_be_whole);
    if whole.is_empty() {
        return Ok(out);
    }
    let given = Searcher { problem, options }.standing(&[], problem.nuisance.given.clone(), readings)?;
    let asked = whole.iter().map(|t| t.candidate.clone()).collect();
    let there = taken_up(problem, (&given, &start.cov), readings, (asked, evidence))?;
    out.extend(whole.into_iter().filter(|t| there.iter().any(|other| other.candidate == t.candidate)));
    Ok(out)
}

/// Those of some candidates that a fit's frames or sites would take up, where an effect must earn `evidence`.
fn taken_up(
    problem: &Problem,
    (at, cov): (&Fit, &DMatrix<f64>),
    readings: &Readings,
    (candidates, evidence): (Vec<Candidate>, f64),
) -> Result<Vec<TakenUp>, DiagnosisError> {
    let signatures = signatures(problem, at, &candidates)?;
    let is_frame = |p: &Parameter<Quantity>| matches!(p.quantity, Quantity::Frame(..));
    let is_site = |p: &Parameter<Quantity>| matches!(p.quantity, Quantity::Site(..));
    let given = Marginal::new(at, readings, cov)?;
    let knowing = |known: &dyn Fn(&Parameter<Quantity>) -> bool| {
        let mut fit: Fit = at.clone();
        let all: Vec<usize> = (0..problem.nuisances()).filter(|&k| known(&problem.nuisance.list[k])).collect();
        all.into_iter()
            .for_each(|k| fit.linear.jacobian.set_column(k, &nalgebra::DVector::zeros(fit.linear.jacobian.nrows())));
        Marginal::new(&fit, readings, cov)
    };
    let others = [
        ("frames", knowing(&is_frame)?),
        ("attachment sites", knowing(&is_site)?),
        ("frames and attachment sites", knowing(&|n| is_frame(n) || is_site(n))?),
    ];
    let is_testable = |signature: &DMatrix<f64>, c: &Candidate, marginal: &Marginal| {
        let Some(score) = Score::new(signature, readings, marginal, WIDTH) else { return true };
        let sizes = (0..c.size()).filter(|&k| !c.effect.parameter[k].shape);
        sizes.filter_map(|k| score.size_for(k, evidence)).any(|size| size <= TESTABLE_SIZE)
    };
    let one = |(c, signature): (&Candidate, &DMatrix<f64>)| {
        if is_testable(signature, c, &given) {
            return None;
        }
        let by = others.iter().find(|(_, marginal)| is_testable(signature, c, marginal))?.0;
        Some(TakenUp { candidate: c.clone(), by })
    };
    Ok(candidates.iter().zip(&signatures).filter_map(one).collect())
}

/// What is told of them.
pub(crate) fn told(problem: &Problem) -> Vec<NotTestable> {
    let one = |t: &TakenUp| {
        let place = match t.candidate.scope {
            Scope::Both if problem.asked().len() > 1 => "in all data sets alike".to_owned(),
            Scope::Both => "in the one data set there is".to_owned(),
            Scope::Only(s) => format!("in {} alone", problem.sources[s]),
        };
        let why = format!("{place}: the {} of a built knee are not known well enough, and may take it up", t.by);
        let variant = t.candidate.effect.variants.get(t.candidate.variant);
        let why = variant.map_or_else(|| why.clone(), |v| format!("{v} {why}"));
        NotTestable { effect: t.candidate.name(), why }
    };
    problem.absorbed.iter().map(one).collect()
}
