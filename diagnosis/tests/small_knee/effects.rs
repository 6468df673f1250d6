//! What effects do to the small knee: nothing of no size, what their derivatives say, and what they stand for.

use super::{Small, loss};
use crate::common::deck::{Asked, source};
use diagnosis::effect::Active;
use diagnosis::effect::bench::Bench;
use diagnosis::effect::candidate::{Candidate, Scope};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::{Problem, reading};
use diagnosis::report::carried::carried;
use diagnosis::report::predict::{acting, apply, taken_off};
use inference::knee::Quantity;
use serde_json::json;
use sim::coordinate::{AP, VV};
use sim::equilibrium::starts_of;
use sim::laxity::{LaxityTrial, TrialResult};
use sim::uncertainty::{FrameUncertainty, FramesUncertainty, SiteUncertainty, Uncertainty};

const MEASURED: [f64; 5] = [0.0, 0.0, 0.0, 0.0, -25.0];

/// Drawers of a knee that is turned by a moment, and turned and tilted knees.
const TRIALS: [Asked; 5] = [
    ("a", "anterior", 30.0, [0.0, 5.0, 0.0, 60.0], MEASURED),
    ("p", "posterior", 60.0, [0.0, -5.0, 0.0, -60.0], MEASURED),
    ("i", "internal", 30.0, [0.0, -2.0, 0.0, 0.0], MEASURED),
    ("e", "external", 45.0, [0.0, 2.0, 0.0, 0.0], MEASURED),
    ("v", "valgus", 15.0, [5.0, 0.0, 0.0, 0.0], MEASURED),
];

/// Effects of an apparatus that bend nowhere, in sizes that are felt.
const EFFECTS: [&str; 7] =
    ["load_axis", "strap_tissue", "foot_turn", "apparatus_compliance", "cuff_softening", "load_misalign", "load_gain"];
/// Their sizes in units of their priors [-].
const SIZE: f64 = 0.8;
/// Most that derivatives differ from differences, of all together [-].
const OFF: f64 = 0.02;

fn of_both(problem: &Problem, id: &str) -> Candidate {
    let is_it = |c: &Candidate| c.effect.id == id && c.variant == 0 && c.scope == Scope::Both;
    problem.candidates().into_iter().find(is_it).unwrap()
}

/// Readings of all trials, five each.
fn read(problem: &Problem, hypothesis: &[Candidate], x: &[f64]) -> Vec<f64> {
    problem.rests(hypothesis, x, &[]).unwrap().iter().flat_map(reading).collect()
}

/// Derivatives by the unknowns `of` stand beside differences of readings.
fn derivatives_are_those_of_differences(problem: &Problem, c: &Candidate, x: &[f64], of: std::ops::Range<usize>) {
    let hypothesis = [c.clone()];
    let rests = problem.rests(&hypothesis, x, &[]).unwrap();
    let starts = starts_of(&rests);
    let linear = problem.linear_at(&hypothesis, x, rests).unwrap();
    let at = |k: usize, h: f64| {
        let mut y = x.to_vec();
        y[k] += h;
        let rests = problem.rests(&hypothesis, &y, &starts).unwrap();
        rests.iter().flat_map(reading).collect::<Vec<f64>>()
    };
    let (mut off, mut all) = (0.0_f64, 0.0_f64);
    for k in of {
        let h = 0.01;
        for (r, (up, down)) in at(k, h).iter().zip(at(k, -h)).enumerate() {
            let by_difference = (up - down) / (2.0 * h);
            off += (by_difference - linear.jacobian[(r, k)]).powi(2);
            all += by_difference.powi(2);
        }
    }
    assert!(all > 0.0 && off.sqrt() < OFF * all.sqrt(), "{}: {} of {}", c.name(), off.sqrt(), all.sqrt());
}

/// Fails where an effect has a part that its size does not scale, or a derivative without the load's own change.
#[test]
fn an_apparatus_of_no_fault_changes_nothing_and_derivatives_are_those_of_differences() {
    let problem = Small::new().asked(&[source("rks", &TRIALS)]);
    let n = problem.nuisances();
    let without = read(&problem, &[], &vec![0.0; n]);
    for id in EFFECTS {
        let c = of_both(&problem, id);
        let with = |size: f64| [vec![0.0; n], vec![size; c.size()]].concat();
        let none = read(&problem, std::slice::from_ref(&c), &with(0.0));
        let most = none.iter().zip(&without).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 1e-4, "{id} of no size moves a reading by {most}");
        derivatives_are_those_of_differences(&problem, &c, &with(SIZE), n..n + c.size());
    }
}

/// Fails where an effect of an apparatus has a side of its own: medial by an axis of the file.
#[test]
fn an_apparatus_does_to_a_mirrored_knee_what_it_does_to_the_knee() {
    let [left, right] = [Small::new(), Small::mirrored()].map(|knee| knee.asked(&[source("rks", &TRIALS)]));
    let [own, others] = [&left, &right].map(|knee| read(knee, &[], &vec![0.0; knee.nuisances()]));
    for id in EFFECTS {
        let by = |knee: &Problem, without: &[f64]| -> Vec<f64> {
            let c = of_both(knee, id);
            let x = [vec![0.0; knee.nuisances()], vec![SIZE; c.size()]].concat();
            read(knee, &[c], &x).iter().zip(without).map(|(a, b)| a - b).collect()
        };
        let (a, b) = (by(&left, &own), by(&right, &others));
        let most = a.iter().map(|x| x.abs()).fold(0.0, f64::max);
        assert!(most > 0.1, "{id} moves readings by {most} at most");
        for (r, (x, y)) in a.iter().zip(&b).enumerate() {
            assert!((x - y).abs() < 0.05 + 0.02 * most, "{id}, trial {} coordinate {}: {x} {y}", r / 5, r % 5);
        }
    }
}

/// Turned and bent: the LCL is taut.
const BENT: [Asked; 4] = [
    ("i", "external", 30.0, [0.0, 3.0, 0.0, 0.0], MEASURED),
    ("j", "external", 60.0, [0.0, 3.0, 0.0, 0.0], MEASURED),
    ("k", "varus", 30.0, [6.0, 0.0, 0.0, 0.0], MEASURED),
    ("l", "valgus", 30.0, [-6.0, 0.0, 0.0, 0.0], MEASURED),
];

/// Fails where what is lost of a ligament still answers to the ligament's own parameters.
#[test]
fn what_is_lost_of_a_ligament_its_own_parameters_do_not_move() {
    let problem = Small::new().asked(&[source("rks", &BENT)]);
    let c = loss(&problem, "LCL");
    for share in [0.5, 1.0] {
        let size = share / c.effect.parameter[0].sd;
        let x = [vec![0.0; problem.nuisances()], vec![size]].concat();
        derivatives_are_those_of_differences(&problem, &c, &x, 0..problem.nuisances());
    }
}

/// Fails where trials that share a way end elsewhere than each alone, by company or by threads.
#[test]
fn a_way_that_trials_share_ends_where_the_way_of_each_alone_does() {
    let problem = Small::new().asked(&[source("rks", &TRIALS)]);
    let candidates = problem.candidates();
    // nothing missing, a structure lost, which knows no trial, and an effect that knows the trial
    for (id, size) in [("", 0.0), ("structure_loss", 0.8), ("load_gain", 0.5)] {
        let hypothesis: Vec<_> = candidates.iter().filter(|c| c.effect.id == id).take(1).cloned().collect();
        assert_eq!(hypothesis.is_empty(), id.is_empty());
        let mut x = vec![0.0; problem.nuisances()];
        x.extend(hypothesis.iter().flat_map(|c| vec![size; c.size()]));
        let (together, models) = (problem.rests(&hypothesis, &x, &[]).unwrap(), problem.models_at(&x).unwrap());
        for (trial, rest) in problem.trials.iter().zip(&together) {
            let effects = problem.effects_in(trial.source, &hypothesis, &x);
            let bench = Bench { model: models.of(trial.source), effects: &effects, place: &problem.place };
            assert_eq!(bench.walk(trial).q, rest.q, "{id}, {}", trial.record.trial);
        }
    }
}

/// Fails where a tissue that acts about the unloaded pose is laid about another: then it moves a knee that nothing loads.
#[test]
fn tissues_about_the_unloaded_pose_leave_an_unloaded_knee_where_it_is() {
    let asked: [Asked; 4] = [0.0, 15.0, 30.0, 60.0].map(|f| ("unloaded", "neutral", f, [0.0; 4], MEASURED));
    let problem = Small::new().asked(&[source("rks", &asked)]);
    // ligaments other than the knee's, some tighter, some slacker
    let x: Vec<f64> = (0..problem.nuisances()).map(|k| 0.3 * (1.7 * k as f64).sin()).collect();
    let plain = problem.rests(&[], &x, &[]).unwrap();
    let moved = plain.iter().zip(&problem.trials).map(|(r, t)| (r.q - t.unloaded.q).amax()).fold(0.0, f64::max);
    assert!(moved > 0.1, "other ligaments rest elsewhere: {moved}");
    let starts: Vec<_> = problem.trials.iter().map(|t| t.unloaded.clone()).collect();
    for (id, size) in [("capsule_envelope", [1.5, 1.5, 1.5, 0.5]), ("meniscus", [1.5, -1.0, 0.5, 0.0])] {
        let tissue = of_both(&problem, id);
        let rests = problem.rests(std::slice::from_ref(&tissue), &[&x[..], &size].concat(), &starts).unwrap();
        for (a, b) in rests.iter().zip(&plain) {
            assert!(a.balanced && (a.q - b.q).amax() < 0.01, "{id}: {}", a.q - b.q);
        }
    }
}

/// Fails where the weight hangs on the pose but for flexion, or has a moment of its own.
#[test]
fn the_weight_of_the_shank_pulls_with_the_sine_of_flexion_and_turns_by_its_lever_alone() {
    let flexions = [0.0, 30.0, 60.0, 90.0];
    let asked = flexions.map(|f| ("unloaded", "neutral", f, [0.0; 4], MEASURED));
    let problem = Small::new().asked(&[source("rks", &asked)]);
    let catalogue = Catalogue::shipped();
    let (effect, variant) = catalogue.find("gravity").unwrap();
    for (trial, flexion) in problem.trials.iter().zip(flexions) {
        let force = |weight: f64, lever: f64| {
            let gravity = Active::new(effect, variant, &[weight, lever]).unwrap();
            gravity.force(&problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q))
        };
        let pulled = force(12.0, 70.0);
        assert!((pulled[AP] + 12.0 * flexion.to_radians().sin()).abs() < 1e-3, "{flexion} deg: {}", pulled[AP]);
        assert!((pulled[VV] - 840.0).abs() < 1e-9, "{flexion} deg: {} N mm", pulled[VV]);
        // no weight, no moment
        assert_eq!(force(0.0, 70.0).norm(), 0.0);
    }
}

/// Fails where the frames of one data set turn the readings of the other.
#[test]
fn the_frames_of_a_data_set_change_its_own_readings_alone() {
    let mut small = Small::new();
    let frame = || FrameUncertainty { turn_deg: [2.0; 3], shift_mm: [2.0; 3], source: String::new() };
    let site = || SiteUncertainty { femur_mm: 2.0, tibia_mm: 2.0, source: String::new() };
    small.spec.uncertainty = Some(Uncertainty {
        sites: small.spec.bundles.iter().map(|b| (b.name.clone(), site())).collect(),
        frames: FramesUncertainty { femur: frame(), tibia: frame() },
        contact_log_scale: 0.3,
        cartilage_mm: 0.2,
        ligaments: Default::default(),
        sources: Default::default(),
    });
    let problem = small.asked(&["kla", "rks"].map(|name| source(name, &TRIALS[2..])));
    let here = vec![0.0; problem.nuisances()];
    let linear = problem.linear_at(&[], &here, problem.rests(&[], &here, &[]).unwrap()).unwrap();
    let (mut own, mut felt) = (0, 0.0_f64);
    for (k, p) in problem.nuisance.list.iter().enumerate() {
        let Quantity::Frame(Some(of), _) = p.quantity else { continue };
        own += 1;
        for (i, trial) in problem.trials.iter().enumerate() {
            let moved = linear.jacobian.view((5 * i, k), (5, 1)).amax();
            if trial.source == Some(of) {
                felt = felt.max(moved);
            } else {
                assert_eq!(moved, 0.0, "{} in {}", p.name, trial.record.trial);
            }
        }
    }
    assert!(own == 24 && felt > 0.1, "{own} of them, felt by {felt}");
}

/// What diagnose added to a model, as data.
fn component(
    effect: &str,
    variant: Option<&str>,
    kept: &str,
    scope: &str,
    values: &[(&str, f64)],
) -> serde_json::Value {
    let value = |(name, size): &(&str, f64)| ((*name).to_owned(), json!({"value": size, "sd": 1.0, "unit": "-"}));
    let parameters: serde_json::Map<String, serde_json::Value> = values.iter().map(value).collect();
    let mut out = json!({
        "schema": "component/1",
        "effect": effect,
        "scope": scope,
        "kept": kept,
        "status": "proposed",
        "catalogue": "1",
        "log_bayes_factor": 10.0,
        "parameters": parameters,
    });
    if let Some(variant) = variant {
        out["variant"] = variant.into();
    }
    out
}

fn trials() -> Vec<LaxityTrial> {
    let text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
        a,anterior,30,0,0,0,100,20,30,0,0,0,9,-25\nb,internal,60,0,-5,0,0,20,60,0,-5,0,14,-24\n";
    sim::laxity::read(text.as_bytes()).unwrap().trials
}

/// Fails where an effect of no size is solved for all the same, a target is corrected by something else than the prediction, or an apparatus reaches
/// what is told of the knee itself.
#[test]
fn a_component_of_no_size_changes_no_bit_and_one_of_an_apparatus_stays_with_it() {
    let Small { mut spec, model } = Small::new();
    let pose = spec.frames.gs_ct_pose;
    let result = |trial| TrialResult { trial, pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] };
    let plain: Vec<TrialResult> = trials().into_iter().map(result).collect();
    let mut out = plain.clone();
    let capsule = |ap: f64| {
        let values = [("ap", ap), ("ie", 0.0), ("vv", 0.0), ("hardening", 0.0)];
        vec![component("capsule_envelope", None, "specimen", "both", &values)]
    };
    spec.components = capsule(0.0);
    apply(&model, &spec, None, &mut out).unwrap();
    assert_eq!(out, plain);

    spec.components = capsule(20.0);
    apply(&model, &spec, None, &mut out).unwrap();
    // held back against the anterior load
    let moved = out[0].pose.ap_mm - plain[0].pose.ap_mm;
    assert!(moved < -0.1, "{moved} mm");
    let targets = taken_off(&model, &spec, Some("kla"), &trials()).unwrap();
    assert!((trials()[0].measured[AP].unwrap() - targets[0].measured[AP].unwrap() - moved).abs() < 1e-9);

    let shift = [("ml_mm", 0.0), ("ap_mm", 2.0), ("si_mm", 0.0)];
    spec.components = vec![component("origin_shift", None, "apparatus", "kla", &shift)];
    assert!(acting(&spec, None).unwrap().is_empty() && acting(&spec, Some("rks")).unwrap().is_empty());
    let mut out = plain.clone();
    apply(&model, &spec, Some("kla"), &mut out).unwrap();
    assert!((out[0].pose.ap_mm - pose.ap_mm - 2.0).abs() < 1e-9, "{:?}", out[0].pose);
}

/// Fails where a loss is taken off a bundle's stiffness once for each of its fibres, or not in the forces that are told.
#[test]
fn a_ligament_that_is_lost_carries_nothing_under_any_test() {
    let Small { spec, model } = Small::new();
    let acl = |share: f64| {
        let mut other = spec.clone();
        other.components = vec![component("structure_loss", Some("ACL"), "specimen", "both", &[("loss", share)])];
        let all = carried([(&model, &spec), (&model, &other)]).unwrap();
        all.into_iter().filter(|c| c.ligament == "ACL").collect::<Vec<_>>()
    };
    assert!(acl(1.0).len() > 1 && acl(1.0).iter().all(|c| c.without_n > 20.0 && c.with_n < 1e-6), "{:?}", acl(1.0));
    // half of it carries less than all of it did, and more than nothing
    assert!(acl(0.5).iter().all(|c| c.with_n > 1.0 && c.with_n < c.without_n), "{:?}", acl(0.5));
}
