//! A ligament that was cut is named, and no search stays behind a fit that starts at the truth.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, published, question, source};
use calibration::options::CalibrateOptions;
use diagnosis::diagnosis::{Calibration, Diagnosis, Verdict, diagnose};
use diagnosis::effect::candidate::Candidate;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::fit::Data;
use diagnosis::problem::covariance::{Floor, Readings, covariance};
use diagnosis::problem::outlier::Mixture;
use diagnosis::problem::trial::Source;
use diagnosis::problem::{Problem, reading};
use diagnosis::search::regret::{Hidden, regret};
use diagnosis::search::{DiagnosisOptions, Searcher, TRIES};
use inference::random::{normal, stream};
use inference::trial::Trial;
use needs_shared::needs_shared;
use sim::coordinate::{AP, FREE, Free, SI};
use sim::equilibrium::Equilibrium;

/// Most that a search may stay behind the truth [nats].
const MOST_REGRET: f64 = 2.0;

/// Drawers, rotations and moments at two flexions; nothing was measured yet.
const PLAN: [Asked; 12] = [
    ("a", "anterior", 30.0, [0.0, 0.0, 0.0, 60.0], [0.0; 5]),
    ("b", "anterior", 30.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("c", "anterior", 60.0, [0.0, 0.0, 0.0, 60.0], [0.0; 5]),
    ("d", "anterior", 60.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("e", "posterior", 30.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("f", "posterior", 60.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("g", "internal", 30.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("h", "internal", 60.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("i", "external", 30.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
    ("j", "external", 60.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
    ("k", "varus", 30.0, [6.0, 0.0, 0.0, 0.0], [0.0; 5]),
    ("l", "valgus", 30.0, [-6.0, 0.0, 0.0, 0.0], [0.0; 5]),
];

/// Bent aside near extension, where the PCL is slack.
const BENT: [Asked; 4] = [
    ("a", "varus", 15.0, [6.0, 0.0, 0.0, 0.0], [0.0; 5]),
    ("b", "valgus", 15.0, [-6.0, 0.0, 0.0, 0.0], [0.0; 5]),
    ("c", "varus", 30.0, [6.0, 0.0, 0.0, 0.0], [0.0; 5]),
    ("d", "valgus", 30.0, [-6.0, 0.0, 0.0, 0.0], [0.0; 5]),
];

/// The question of a deck whose readings are those of the model itself with a structure cut, and noise.
pub(crate) fn cut(structure: &str) -> Option<Problem> {
    let mut problem = question("cuts", &[("rks", &PLAN)])?;
    let readings = answered(&problem, structure);
    for (trial, there) in problem.trials.iter_mut().zip(readings) {
        trial.record.measured = there;
    }
    // poses held at what is measured are found anew
    Some(problem.with_present(vec![]))
}

/// The loss of a structure, and so much of it beside the knee as it is given.
fn lost(problem: &Problem, structure: &str, share: f64) -> (Candidate, Vec<f64>) {
    let is_it = |c: &Candidate| c.effect.id == "structure_loss" && c.variant_name().as_deref() == Some(structure);
    let torn = problem.candidates().into_iter().find(is_it).unwrap();
    let size = share / torn.effect.parameter[0].sd;
    (torn, [vec![0.0; problem.nuisances()], vec![size]].concat())
}

/// What the model itself answers to its trials with a structure cut, with noise.
fn answered(problem: &Problem, structure: &str) -> Vec<Free<Option<f64>>> {
    answered_without(problem, structure, 1.0)
}

/// The same with a share of it lost.
fn answered_without(problem: &Problem, structure: &str, share: f64) -> Vec<Free<Option<f64>>> {
    let (torn, unknowns) = lost(problem, structure, share);
    let rests = problem.rests(&[torn], &unknowns, &[]).unwrap();
    let mut random = stream(7, 0);
    let noisy = |(trial, rest): (&Trial, &Equilibrium)| {
        let there = reading(rest);
        let mut out = Free::all(None);
        FREE.into_iter().for_each(|c| out[c] = Some(there[c] + trial.sd[c] * normal(&mut random)));
        out
    };
    problem.trials.iter().zip(&rests).map(noisy).collect()
}

/// The diagnosis of the deck under some trials, of which the PCL is cut.
fn of_a_cut_pcl(trials: &[Asked]) -> Option<Diagnosis> {
    without_pcl(trials, 1.0)
}

/// The same with a share of the PCL lost.
fn without_pcl(trials: &[Asked], share: f64) -> Option<Diagnosis> {
    let deck = published("cuts")?;
    let (model, options) = (sim::compile(&deck.spec, &deck.meshes).unwrap(), CalibrateOptions::default());
    let mut sources = vec![source("rks", trials)];
    let catalogue = Catalogue::shipped();
    let problem = Problem::new(&model, &deck.spec, &sources, &catalogue, &options).unwrap();
    for (trial, there) in sources[0].trials.iter_mut().zip(answered_without(&problem, "PCL", share)) {
        trial.measured = there;
    }
    let few = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let calibration = Calibration { options: &options, mode: None };
    Some(diagnose(&model, &deck.spec, &sources, &catalogue, &few, calibration).unwrap().diagnosis)
}

#[needs_shared]
fn a_cut_is_told_in_plain_words_with_what_looks_like_it_and_the_test_that_would_tell() {
    // bent, not pulled
    let Some(told) = of_a_cut_pcl(&BENT) else { return };
    let names = told.answers.iter().flat_map(|a| &a.effects).map(|e| (e.effect.as_str(), e.variant.as_deref()));
    assert!(names.clone().any(|n| n == ("structure_loss", Some("PCL"))), "{}", told.plain);
    // such trials do not tell a torn ligament from one that is attached where it is slack
    assert!(names.clone().any(|n| n.0 == "attachment_PCL"), "{}", told.plain);
    assert_ne!(told.verdict, Verdict::Decisive, "{}", told.plain);
    assert!(told.plain.contains("PCL is torn") && told.plain.contains("osterior drawer"), "{}", told.plain);
    // what is named is in the set of what is not excluded, the best at nothing
    let is_pcl = |e: &diagnosis::report::Named| e.variant.as_deref() == Some("PCL");
    let pcl = told.not_excluded.iter().filter(|n| n.effects.iter().any(is_pcl)).count();
    let top = told.not_excluded.iter().any(|n| n.log_odds == 0.0);
    assert!(pcl > 0 && top, "{:?}", told.not_excluded);
}

/// The diagnosis of a deck whose PCL is cut, under some trials, beside what the whole knee read in them before.
fn of_a_cut_pcl_after(trials: &[Asked]) -> Option<Diagnosis> {
    let deck = published("cuts")?;
    let (model, options) = (sim::compile(&deck.spec, &deck.meshes).unwrap(), CalibrateOptions::default());
    let mut sources = [source("rks", trials), Source::before("rks_before", source("rks", trials).trials)];
    let catalogue = Catalogue::shipped();
    let problem = Problem::new(&model, &deck.spec, &sources, &catalogue, &options).unwrap();
    // a loss acts in what was measured since, alone
    let all = answered(&problem, "PCL");
    let given = problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap();
    let both = sources.iter_mut().flat_map(|s| &mut s.trials).zip(all).zip(problem.trials.iter().zip(&given));
    for ((own, there), (trial, rest)) in both {
        let (whole, is_before) = (reading(rest), problem.before[trial.source.unwrap()]);
        let near = FREE.into_iter().all(|c| there[c].is_some_and(|x| (x - whole[c]).abs() < 5.0 * trial.sd[c]));
        assert!(near || !is_before, "{} {there:?} {whole:?}", trial.record.trial);
        own.measured = there;
    }
    let few = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let calibration = Calibration { options: &options, mode: None };
    Some(diagnose(&model, &deck.spec, &sources, &catalogue, &few, calibration).unwrap().diagnosis)
}

#[needs_shared]
fn a_cut_is_named_where_the_whole_knee_was_measured_before() {
    let Some(told) = of_a_cut_pcl_after(&[&PLAN[..], &BENT[..]].concat()) else { return };
    let first = &told.answers.first().unwrap_or_else(|| panic!("{}", told.plain)).effects[0];
    assert_eq!((first.effect.as_str(), first.variant.as_deref()), ("structure_loss", Some("PCL")), "{}", told.plain);
    assert_eq!((first.scope.as_str(), &told.before[..]), ("rks", &["rks_before".to_owned()][..]));
    assert!(told.plain.contains("he PCL is torn"), "{}", told.plain);
}

#[needs_shared]
fn of_a_whole_knee_the_tears_that_its_trials_would_miss_are_told_and_no_other() {
    // drawn forwards alone, which moves the knee where the sMCL hardly tells
    let Some(told) = without_pcl(&PLAN[..4], 0.0) else { return };
    assert_eq!(told.verdict, Verdict::None, "{}", told.plain);
    let open: Vec<&str> = told.may_be_torn.iter().map(|t| t.structure.as_str()).collect();
    assert!(!open.contains(&"ACL") && open.contains(&"sMCL"), "{} {:?}", told.threshold, told.may_be_torn);
    assert!(
        open.iter().all(|structure| told.plain.contains(*structure)) && !told.plain.contains("ACL"),
        "{}",
        told.plain
    );
    assert!(told.may_be_torn.iter().all(|t| !t.is_slackened()), "{:?}", told.may_be_torn);
    // one list has that nothing is missing, and each tear that fits as well; a tear that fits worse is not in it
    assert!(told.not_excluded.iter().any(|n| n.effects.is_empty()), "{:?}", told.not_excluded);
    for t in &told.may_be_torn {
        let listed = told.not_excluded.iter().find(|n| n.torn.as_ref() == Some(&t.structure));
        assert_eq!(listed.map(|n| n.log_odds), (!t.fits_worse_torn).then_some(t.log_odds), "{t:?}");
    }
    assert!(told.not_excluded.windows(2).all(|w| w[0].log_odds >= w[1].log_odds), "{:?}", told.not_excluded);
    // the head says that no effect is proven where a tear is three times as likely as nothing, and there alone
    let is_ahead = told.not_excluded.iter().any(|n| n.torn.is_some() && n.log_odds >= 1.0);
    assert_eq!(told.plain.contains("No effect is proven by these trials"), is_ahead, "{}", told.plain);
    assert!(!is_ahead || !told.plain.contains("Nothing is missing"), "{}", told.plain);
    let smcl = told.may_be_torn.iter().find(|t| t.structure == "sMCL").unwrap();
    assert!(smcl.would_be_missed(told.threshold), "{smcl:?}");
    // the next test is about the first, against which nothing speaks; where no single one would show it the head says so
    let first = &told.may_be_torn[0];
    let none = format!("No single test of usual load would tell whether the {} is torn", first.structure);
    assert!(!first.fits_worse_torn, "{first:?}");
    assert_eq!(told.plain.contains(&none), told.next_tests[0].expected_gain < 1.0, "{}", told.plain);
    assert!(told.plain.contains(&format!("whether the {} is torn", first.structure)), "{}", told.plain);
}

#[needs_shared]
fn what_is_lost_of_a_ligament_its_own_parameters_do_not_move() {
    // turned and bent: the LCL is taut
    let Some(problem) = question("lost", &[("rks", &PLAN[8..])]) else { return };
    for share in [0.5, 1.0] {
        let (torn, x) = lost(&problem, "LCL", share);
        let hypothesis = [torn];
        let rests = problem.rests(&hypothesis, &x, &[]).unwrap();
        let starts = sim::equilibrium::starts_of(&rests);
        let linear = problem.linear_at(&hypothesis, &x, rests).unwrap();
        let at = |k: usize, by: f64| {
            let mut y = x.clone();
            y[k] += by;
            let rests = problem.rests(&hypothesis, &y, &starts).unwrap();
            rests.iter().flat_map(reading).collect::<Vec<f64>>()
        };
        let (mut off, mut all) = (0.0_f64, 0.0_f64);
        for k in 0..problem.nuisances() {
            let step = 0.01;
            for (r, (up, down)) in at(k, step).iter().zip(at(k, -step)).enumerate() {
                let by_difference = (up - down) / (2.0 * step);
                off += (by_difference - linear.jacobian[(r, k)]).powi(2);
                all += by_difference.powi(2);
            }
        }
        assert!(off.sqrt() < 0.02 * all.sqrt(), "{share}: {} of {}", off.sqrt(), all.sqrt());
    }
}

#[needs_shared]
fn a_cut_acl_is_named_and_the_search_does_not_stay_behind_the_truth() {
    // what is beside a name is not asked
    let options = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 3, ..DiagnosisOptions::default() };
    let Some(problem) = cut("ACL") else { return };
    let searcher = Searcher { problem: &problem, options: &options };
    let search = searcher.search().unwrap();
    let best = &search.rivals[0];
    let named: Vec<_> = best.hypothesis.iter().map(|c| (c.name(), c.variant_name())).collect();
    assert_eq!(named, [("structure_loss".to_owned(), Some("ACL".to_owned()))]);
    let cut = Hidden::of_all("structure_loss", "ACL", ("loss", 1.0));
    let regret = regret(&problem, (&searcher, &search), &[cut]).unwrap().unwrap();
    assert!(regret.short() <= MOST_REGRET, "{regret:?}");
    // what these trials tell of the cut is what the search finds of it, but for the noise
    assert!(regret.information > 0.5 * regret.truth && regret.information < 2.0 * regret.truth, "{regret:?}");
    // more than all is not lost
    let whole = 1.0 / best.hypothesis[0].effect.parameter[0].sd;
    assert!(best.unknowns[problem.nuisances()] <= whole, "{:?}", best.unknowns.last());
}

#[needs_shared]
fn what_is_held_is_known_and_costs_neither_a_prior_nor_a_width() {
    // trials that recalibrated ligaments fit, so that fits end by themselves
    let Some(mut problem) = question("held", &[("rks", &PLAN[6..])]) else { return };
    let readings = answered(&problem, "PCL");
    problem.trials.iter_mut().zip(readings).for_each(|(trial, there)| trial.record.measured = there);
    let problem = problem.with_present(vec![]);
    let given = vec![0.0; problem.nuisances()];
    let rests = problem.nearer(&[], &given, &[]).unwrap();
    let scatter = covariance(&problem, &[], &given, &rests, &Floor::default()).unwrap();
    let readings = Readings::of(&problem, &|_| true);
    let mixture = Mixture::new(&readings, readings.block_of(&scatter), &problem.trials).unwrap();
    let fit = |from: &[f64], starts: &[sim::equilibrium::Start], held: &[usize]| {
        Data { problem: &problem, readings: &readings, mixture: &mixture, steps: TRIES, held }
            .fit(&[], from, starts)
            .unwrap()
    };
    let free = fit(&given, &sim::equilibrium::starts_of(&rests), &[]);
    // where the data tell most of it
    let told = |k: &usize| free.posterior[(*k, *k)];
    let k = (0..given.len()).min_by(|a, b| told(a).total_cmp(&told(b))).unwrap();
    let held = fit(&free.unknowns, &free.coordinates(), &[k]);
    // the posterior's density over the prior's (Savage and Dickey's ratio), at the mode
    let off = free.unknowns[k] - free.means[k];
    let ratio = 0.5 * off * off - 0.5 * told(&k).ln();
    assert!(told(&k) < 0.9 && (held.unknowns[k] - free.unknowns[k]).abs() < 1e-6, "{}", told(&k));
    assert!(
        (held.log_evidence - free.log_evidence - ratio).abs() < 0.3,
        "{} {ratio}",
        held.log_evidence - free.log_evidence
    );
    assert!(held.posterior[(k, k)] < 1e-9);
}

#[needs_shared]
fn a_reading_of_a_knee_that_left_its_joint_is_left_out_and_told_and_a_shifted_origin_is_none() {
    let Some(mut problem) = question("astray", &[("rks", &PLAN)]) else { return };
    let given = vec![0.0; problem.nuisances()];
    let there: Vec<_> = problem.rests(&[], &given, &[]).unwrap().iter().map(reading).collect();
    problem.trials.iter_mut().zip(there).for_each(|(trial, there)| trial.record.measured = there.map(Some));
    let far = |of: &dyn Fn(usize) -> bool, ap: f64, si: f64| {
        let mut moved = problem.clone();
        for (_, t) in moved.trials.iter_mut().enumerate().filter(|(i, _)| of(*i)) {
            t.record.measured[AP] = t.record.measured[AP].map(|x| x + ap);
            t.record.measured[SI] = t.record.measured[SI].map(|x| x + si);
        }
        moved.with_present(vec![]).within_the_joint()
    };
    let usual = far(&|_| false, 0.0, 0.0);
    assert!(usual.astray.is_empty() && usual.trials.len() == PLAN.len(), "{:?}", usual.astray);
    let one = far(&|i| i == 3, 30.0, 40.0);
    assert_eq!(one.astray, ["rks d_3"]);
    assert!(one.trials.len() == PLAN.len() - 1 && one.trials.iter().all(|t| t.record.trial != "d_3"));
    // all of a set as far off: its origin is, not the knee
    assert!(far(&|_| true, 30.0, 40.0).astray.is_empty());
}
