//! The paper's protocols and laxity trials as decks: what a deck imposes is what was asked for, whichever way its axes are turned.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::decks::{knee, read_back};
use decks::{ExportedDeck, export, export_with, imposed};
use meshes::frame::Side;
use sim::coordinate::{ALL, FE, Load, Six};
use sim::deck::{ChainCoordinate, ControlKind};
use sim::explicit::{Drive, deck_program};
use sim::joint::Joint;
use sim::laxity::{LaxityTrial, Test};
use sim::spec::ModelSpec;

/// Flexion and loads, read from a deck: both are written with all their digits, and its nodes give the axes to 1e-8 and better.
const SAME: f64 = 1e-6;

/// A left knee: the right one in the mirror.
fn left() -> ModelSpec {
    let (mut spec, _) = knee();
    spec.side = Side::Left;
    for frame in [&mut spec.frames.femur, &mut spec.frames.tibia] {
        frame.medial = -frame.medial;
    }
    for fibre in &mut spec.fibres {
        fibre.femur.x = -fibre.femur.x;
        fibre.tibia.x = -fibre.tibia.x;
    }
    spec
}

/// The model of a main file, as it is read back.
fn model_of(deck: &ExportedDeck, main: &str) -> ModelSpec {
    read_back(&deck.files.iter().cloned().collect(), main).unwrap().spec
}

/// What a deck that was read back imposes at the end of each step: flexion [deg] and loads in clinical signs [N mm, N].
fn ends(spec: &ModelSpec) -> Vec<(f64, Six)> {
    let joint = Joint::new(&spec.frames, spec.side).unwrap();
    let program = deck_program(&joint, spec.frames.chain.as_ref(), &spec.protocols[0]);
    let mut turn = joint.ct_pose()[FE];
    let mut out = Vec::new();
    for step in &program.steps {
        let mut load = Six::zeros();
        for c in ALL {
            match &step.drive[c.index()] {
                Drive::Motion(course) => turn += course.at(step.duration_s),
                Drive::Load(course) => load[c] = course.at(step.duration_s),
            }
        }
        out.push((turn.to_degrees(), load));
    }
    out
}

fn assert_ends(spec: &ModelSpec, expected: &[(Option<f64>, Load)], what: &str) {
    let found = ends(spec);
    assert_eq!(found.len(), expected.len(), "{what}");
    for ((turn, load), (flexion, asked)) in found.iter().zip(expected) {
        assert!(flexion.is_none_or(|f| (f - turn).abs() < SAME), "{what}: {turn} deg, {flexion:?} asked");
        let asked = asked.generalised();
        assert!((load - asked).amax() <= SAME * asked.amax(), "{what}: {load:?} {asked:?}");
    }
}

/// The paper's numbers [andreassen2025, section 2.6]: 133 N at 30, 60 and 90 deg; 0 to 90 deg; 8 N m of valgus and 4 N m inwards at 30 deg.
/// 20 N press throughout.
fn assert_protocols(spec: &ModelSpec, deck: &ExportedDeck) {
    let pressed = Load::compression(20.0);
    let drawer = |ap: f64| Load::new(0.0, 0.0, 0.0, ap, 20.0);
    let of = |name: &str| model_of(deck, &format!("{}_{name}.inp", spec.id));
    for flexion in [30.0, 60.0, 90.0] {
        let name = format!("ap_laxity_{flexion}deg");
        let at = Some(flexion);
        let expected = [(None, pressed), (at, drawer(133.0)), (at, drawer(-133.0)), (at, drawer(133.0))];
        assert_ends(&of(&name), &expected, &name);
    }
    let flexed = [(None, pressed), (Some(0.0), pressed), (Some(90.0), pressed)];
    assert_ends(&of("passive_flexion"), &flexed, "passive flexion");
    let shifted = Load::new(8.0, -4.0, 0.0, 0.0, 20.0);
    assert_ends(&of("pivot_shift_30deg"), &[(None, pressed), (Some(30.0), shifted)], "pivot shift");
}

#[test]
fn every_protocol_of_the_paper_goes_out_and_imposes_what_it_says() {
    for mut spec in [knee().0, left()] {
        let meshes = knee().1;
        spec.id = format!("{:?}", spec.side).to_lowercase();
        let deck = export(&spec, &meshes).unwrap();
        assert_eq!(deck.mains.len(), 6, "{:?}", deck.mains);
        assert_protocols(&spec, &deck);
        // a chain of which every axis is turned round is the same knee
        let mut turned = model_of(&deck, &deck.mains[0]);
        assert_eq!(turned.side, spec.side);
        turned.id.clone_from(&spec.id);
        let chain = turned.frames.chain.as_mut().unwrap();
        for axis in [&mut chain.si, &mut chain.ap, &mut chain.ml] {
            axis.direction = -axis.direction;
        }
        assert_protocols(&spec, &export(&turned, &meshes).unwrap());
    }
}

#[test]
fn a_deck_that_comes_back_brings_no_protocol_twice() {
    let (spec, meshes) = knee();
    let first = export(&spec, &meshes).unwrap();
    for main in &first.mains {
        let mut back = model_of(&first, main);
        back.id.clone_from(&spec.id);
        let again = export(&back, &meshes).unwrap();
        let names = |deck: &ExportedDeck| deck.mains.iter().cloned().collect::<std::collections::BTreeSet<_>>();
        assert_eq!(names(&again).len(), again.mains.len());
        assert!(names(&again).is_subset(&names(&first)), "{main}: {:?}", again.mains);
        assert_eq!(&again.mains[0], main);
    }
}

#[test]
fn every_trial_becomes_a_deck_of_its_own() {
    let (spec, meshes) = knee();
    let trial = |name: &str, flexion: f64, load: Load| LaxityTrial::asked(name.into(), Test::Neutral, flexion, load);
    let mut trials = vec![
        trial("a b", 15.0, Load::new(10.0, 0.0, 0.0, 0.0, 20.0)),
        trial("a/b", 45.0, Load::new(0.0, -5.0, 3.0, 0.0, 0.0)),
        trial("A b", -5.0, Load::new(0.0, 0.0, 0.0, -100.0, 50.0)),
    ];
    let deck = export_with(&spec, &meshes, &trials).unwrap();
    let mains = &deck.mains[deck.mains.len() - trials.len()..];
    let whole: std::collections::BTreeSet<String> = deck.files.iter().map(|(name, _)| name.to_lowercase()).collect();
    assert_eq!(whole.len(), deck.files.len(), "no file stands over another, on whatever system");
    for (main, t) in mains.iter().zip(&trials) {
        let settled = Load::compression(t.load[sim::coordinate::SI]);
        assert_ends(&model_of(&deck, main), &[(None, settled), (Some(t.fe_deg), t.load)], main);
    }
    assert!(deck.warnings.iter().all(|w| !w.contains("quadriceps")));
    trials[1].quadriceps_n = 100.0;
    let told = export_with(&spec, &meshes, &trials).unwrap().warnings;
    assert!(told.iter().any(|w| w.contains("quadriceps") && w.count == Some(1)), "{told:?}");
}

#[test]
fn what_other_programs_are_told_is_what_the_decks_impose() {
    let load = Load::new(10.0, -2.0, 3.0, -100.0, 20.0);
    let trials = [LaxityTrial { row: Some(7), ..LaxityTrial::asked("a b".into(), Test::Neutral, 15.0, load) }];
    for mut spec in [knee().0, left()] {
        spec.id = format!("{:?}", spec.side).to_lowercase();
        let deck = export_with(&spec, &knee().1, &trials).unwrap();
        let told = imposed(&spec, &trials).unwrap();
        let mains: Vec<String> = told.iter().map(|i| format!("{}.inp", i.stem)).collect();
        assert_eq!(mains, deck.mains);
        for (i, main) in told.iter().zip(&mains) {
            assert!(i.holds_flexion_alone && i.points.windows(2).all(|w| w[0].time_s < w[1].time_s), "{main}");
            let found = ends(&model_of(&deck, main));
            assert_eq!(found.len(), i.steps.len(), "{main}");
            for (step, (turn, load)) in i.steps.iter().zip(found) {
                let (point, asked) = (&i.points[step.end], i.points[step.end].load.generalised());
                assert!((point.time_s - step.to_s).abs() < 1e-9 && step.from_s < step.to_s, "{main}: {step:?}");
                assert!((point.fe_deg - turn).abs() < SAME, "{main}: {} deg, {turn} in the deck", point.fe_deg);
                assert!((load - asked).amax() <= SAME * asked.amax(), "{main}: {asked:?}, {load:?} in the deck");
            }
        }
        let of_trial: Vec<_> = told.iter().filter_map(|i| i.trial.clone()).collect();
        assert_eq!(of_trial, [("a b".to_owned(), Some(7))]);
    }
}

#[test]
fn a_protocol_that_moves_more_than_flexion_is_known_by_it() {
    let (spec, meshes) = knee();
    let deck = export(&spec, &meshes).unwrap();
    let back = model_of(&deck, &format!("{}_ap_laxity_30deg.inp", spec.id));
    let is_own = |spec: &ModelSpec| imposed(spec, &[]).unwrap()[0].holds_flexion_alone;
    assert!(is_own(&back));
    let (motion, load) = (ControlKind::Motion, ControlKind::Load);
    for (coordinate, kind) in
        [(ChainCoordinate::Ap, motion), (ChainCoordinate::Si, motion), (ChainCoordinate::Fe, load)]
    {
        let mut other = back.clone();
        for control in other.protocols[0].steps.iter_mut().flat_map(|s| &mut s.controls) {
            control.kind = if control.coordinate == coordinate { kind } else { control.kind };
        }
        assert!(other != back && !is_own(&other), "{coordinate:?}");
    }
}
