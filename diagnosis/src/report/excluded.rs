//! Where nothing is named: structures that may be torn all the same. Recalibrated ligaments take a tear up where a slack structure does as well, and a
//! structure that no trial loads is never missed. What these trials leave open is told, with the test that would close it. So is each structure whose
//! whole tear such trials would not name: that nothing is named then says nothing of it.

use crate::criteria::told_apart;
use crate::effect::candidate::{Candidate, Scope};
use crate::effect::catalogue::Effect;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::report::MayBeTorn;
use crate::report::verdict::temper;
use crate::search::{Search, Searcher, TRIES};
use inference::knee::Quantity;
use rayon::prelude::*;
use sim::names::is_of;

/// Structures that injuries take most, in the order in which they are told: what a surgeon asks about. Of these it is found what a tear would earn.
const INJURED: [&str; 4] = ["ACL", "PCL", "sMCL", "LCL"];

/// Such structures, each with two fits: as it was given, and torn. Those stand first against whose tear the data do not speak; of these those that injuries
/// take most, then those that carry most.
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
    let named = search.threshold * temper(searcher, search.rivals.first().unwrap_or(base));
    let mut out: Vec<_> = all.into_iter().filter(|(t, _)| is_open(t, named)).collect();
    out.sort_by(|a, b| place(&a.0).cmp(&place(&b.0)).then(b.0.given_n.total_cmp(&a.0.given_n)));
    Ok(out)
}

/// Whether a structure may be torn, or could be torn without a name in such trials, where a name takes so much.
fn is_open(t: &MayBeTorn, named: f64) -> bool {
    !t.fits_worse_torn || t.would_be_missed(named)
}

/// Where a structure is told: those first against whose tear the data do not speak, for the next test asks about the first. Of either those stand first that
/// injuries take most.
fn place(t: &MayBeTorn) -> (bool, usize) {
    (t.fits_worse_torn, INJURED.iter().position(|s| *s == t.structure).unwrap_or(INJURED.len()))
}

/// A loss of each structure that the model has, whether or not these trials could name it.
pub(crate) fn structures(problem: &Problem) -> Vec<Candidate> {
    let may_be_whole = |e: &&Effect| e.parameter.iter().any(|p| p.whole.is_some());
    let all = problem.catalogue.effect.iter().filter(may_be_whole).flat_map(|effect| {
        let of = |variant| Candidate { effect: effect.clone(), variant, scope: Scope::Both };
        (0..effect.variants.len()).map(of)
    });
    let own = |s: &str| !problem.nuisance.of_structure(s).is_empty() && !problem.was_cut(s);
    let has = |c: &Candidate| c.variant_name().is_some_and(|s| own(&s));
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
    let torn = best_torn(searcher, search, candidate, base.log_evidence)?;
    let log_odds = torn.log_evidence - base.log_evidence;
    let is_injured = INJURED.contains(&structure.as_str());
    let would_earn = if is_injured { Some(would_earn(searcher, search, candidate)?) } else { None };
    let told = MayBeTorn {
        structure,
        log_odds,
        fits_worse_torn: log_odds <= -told_apart() * temper(searcher, base),
        would_earn,
        given_n,
        now_n,
        slack: slack(problem, base, &own),
        against_given: base.log_evidence - as_given.log_evidence,
    };
    Ok((told, [as_given, torn]))
}

/// How far a tear may be behind for more starts to be worth it [nats]. Ours: ends of one tear, cut LCL and sMCL of a phantom, lay up to 8 apart.
const FAR_BEHIND: f64 = 20.0;
/// How often the fit of a tear is led on [-].
const MOST_ROUNDS: usize = 3;
/// What a round must gain for another to be worth it [nats].
const WORTH_A_ROUND: f64 = 1.0;

/// The best fit with all of a structure lost. It starts beside the recalibrated knee; where that ends below an evidence, from the knee as it was given too,
/// and from where either ends with a loss of any size. Fibres that go slack on the way end fits of one tear nats apart. The best is led on to its end.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn best_torn(
    searcher: &Searcher,
    search: &Search,
    candidate: &Candidate,
    below: f64,
) -> Result<Fit, DiagnosisError> {
    let knees = [searcher.put_back(&search.base, candidate), searcher.problem.nuisance.given.clone()];
    let mut best = fit_torn(searcher, search, candidate, knees[0].clone())?;
    if best.log_evidence < below {
        best = likelier(best, fit_torn(searcher, search, candidate, knees[1].clone())?);
    }
    for knee in knees {
        if best.log_evidence >= below || best.log_evidence < below - FAR_BEHIND {
            return Ok(best);
        }
        best = likelier(best, fit_torn_by_part(searcher, search, candidate, knee)?);
    }
    let sizes = sizes_of(searcher.problem, &best);
    for _ in 0..MOST_ROUNDS {
        let on = searcher.fit_holding((&best.hypothesis, &sizes), (&best.unknowns, &best.coordinates()), search)?;
        let gain = on.log_evidence - best.log_evidence;
        best = likelier(best, on);
        if gain < WORTH_A_ROUND {
            break;
        }
    }
    Ok(best)
}

/// The likelier of two fits.
fn likelier(one: Fit, other: Fit) -> Fit {
    if other.log_evidence > one.log_evidence { other } else { one }
}

/// What a whole tear would earn in such trials [nats]: both sides are fitted to what the recalibrated knee would read without noise, the structure
/// put back as it was given and then torn. Nothing missing is fitted from that knee and from where it fits the data at hand.
fn would_earn(searcher: &Searcher, search: &Search, candidate: &Candidate) -> Result<f64, DiagnosisError> {
    let knee = searcher.put_back(&search.base, candidate);
    let start = torn_from(candidate, knee.clone());
    let hypothesis = std::slice::from_ref(candidate);
    let at = searcher.standing(hypothesis, start.clone(), &search.readings)?;
    let readings = Readings { measured: search.readings.pick(&at.linear.value), ..search.readings.clone() };
    let rests = at.coordinates();
    let fit = |of: &[Candidate], from: &[f64]| searcher.fit(of, from, &rests, &search.covariance, &readings, TRIES);
    let torn = fit(hypothesis, &start)?;
    let whole = [fit(&[], &knee)?, fit(&[], &search.base.unknowns)?];
    Ok(whole.iter().map(|f| searcher.gain(&torn, f)).fold(f64::INFINITY, f64::min))
}

/// The unknowns of a knee with all of a structure lost.
fn torn_from(candidate: &Candidate, knee: Vec<f64>) -> Vec<f64> {
    let whole = candidate.effect.parameter.iter().map(|p| p.whole.unwrap_or(0.0) / p.sd);
    knee.into_iter().chain(whole).collect()
}

/// A fit with all of a structure lost, from a knee. The loss is held, so that its evidence is that of the tear, whatever the prior of one.
fn fit_torn(
    searcher: &Searcher,
    search: &Search,
    candidate: &Candidate,
    knee: Vec<f64>,
) -> Result<Fit, DiagnosisError> {
    let start = torn_from(candidate, knee);
    let torn = searcher.standing(std::slice::from_ref(candidate), start, &search.readings)?;
    let sizes = sizes_of(searcher.problem, &torn);
    searcher.fit_holding((&torn.hypothesis, &sizes), (&torn.unknowns, &torn.coordinates()), search)
}

/// The same by way of a loss of any size: where that ends, all is lost, and it is fitted again.
fn fit_torn_by_part(
    searcher: &Searcher,
    search: &Search,
    candidate: &Candidate,
    knee: Vec<f64>,
) -> Result<Fit, DiagnosisError> {
    let nuisances = knee.len();
    let start = torn_from(candidate, knee);
    let torn = searcher.standing(std::slice::from_ref(candidate), start, &search.readings)?;
    let part = searcher.fit_holding((&torn.hypothesis, &[]), (&torn.unknowns, &torn.coordinates()), search)?;
    let again = torn_from(candidate, part.unknowns[..nuisances].to_vec());
    let sizes = sizes_of(searcher.problem, &part);
    searcher.fit_holding((&part.hypothesis, &sizes), (&again, &part.coordinates()), search)
}

/// Places of the sizes of a fit's effects among its unknowns.
fn sizes_of(problem: &Problem, fit: &Fit) -> Vec<usize> {
    (problem.nuisances()..fit.unknowns.len()).collect()
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
        let own = names.iter().zip(&forces).filter(|(name, _)| is_of(name, structure));
        own.map(|(_, f)| f).sum::<f64>()
    };
    Ok(problem.trials.iter().zip(&fit.linear.rests).map(in_trial).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn structure(name: &str, fits_worse_torn: bool, would_earn: Option<f64>) -> MayBeTorn {
        let structure = name.to_owned();
        let (log_odds, given_n, now_n, slack) = (0.0, 100.0, 100.0, 0.0);
        MayBeTorn { structure, log_odds, given_n, now_n, slack, against_given: 0.0, fits_worse_torn, would_earn }
    }

    #[test]
    fn a_structure_is_closed_only_where_the_data_speak_against_its_tear_and_would_have_named_it() {
        for (earns, is_missed) in [(Some(3.0), true), (Some(60.0), false), (None, false)] {
            assert!(is_open(&structure("PCL", false, earns), 5.0));
            assert_eq!(is_open(&structure("PCL", true, earns), 5.0), is_missed);
            // one that the data want slacker is no exception
            let slack = MayBeTorn { now_n: 40.0, against_given: 14.0, ..structure("PCL", true, earns) };
            assert!(is_open(&slack, 5.0) == is_missed && !slack.is_slackened());
        }
    }

    #[test]
    fn what_injuries_take_most_is_told_first() {
        let mut told = ["POL", "LCL", "ACL", "PCAP", "sMCL", "PCL"].map(|name| structure(name, false, None));
        told.sort_by_key(place);
        let first: Vec<&str> = told.iter().take(4).map(|t| t.structure.as_str()).collect();
        assert_eq!(first, INJURED);
        // each is a structure that the catalogue may call lost
        let losses =
            crate::effect::catalogue::Catalogue::shipped().effect.into_iter().find(|e| e.id == "structure_loss");
        assert!(losses.is_some_and(|e| INJURED.iter().all(|s| e.variants.iter().any(|v| v == s))));
    }

    /// The next test is about the first: never about a tear that the data speak against while another is open.
    #[test]
    fn a_tear_that_the_data_speak_against_is_told_behind_those_that_they_leave_open() {
        let acl = structure("ACL", true, Some(3.9));
        let mut told = [acl, structure("POL", false, None), structure("sMCL", false, Some(0.1))];
        told.sort_by_key(place);
        assert_eq!(told.each_ref().map(|t| t.structure.as_str()), ["sMCL", "POL", "ACL"]);
    }
}
