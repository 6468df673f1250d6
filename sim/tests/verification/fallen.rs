//! Explicit dynamics of a knee that falls out of its joint: what flies off is no answer.
use crate::verification::rig::Rig;
use sim::coordinate::{FE, Load};
use sim::error::SimError;
use sim::explicit::{ExplicitOptions, TrialSteps, explicit_protocol, explicit_trial, unobserved};
use sim::flags::Flag;
use sim::laxity::{LaxityTrial, Test, TrialResult};
use sim::model::Model;
use sim::protocols::{Protocol, ProtocolOptions};
use sim::trials::{TrialOptions, flags, solve_trial};

/// Compression [N]: little, so that what falls is not followed far.
const COMPRESSION: f64 = 2.0;
/// A drawer beyond any friction [N].
const DRAWER: f64 = 1.0;

/// The rig knee without ligaments on its flat plateaus: friction alone holds it.
fn loose() -> Model {
    let whole = Rig::knee().compiled();
    whole.without(&whole.bundle_names()).unwrap()
}

/// What explicit dynamics answer to a drawer in extension [N].
fn drawn(model: &Model, newton: f64) -> Result<TrialResult, SimError> {
    let load = Load::new(0.0, 0.0, 0.0, newton, COMPRESSION);
    let trial = LaxityTrial::asked("drawn".into(), Test::Anterior, 0.0, load);
    explicit_trial(model, &trial, &TrialSteps::default(), &ExplicitOptions::default(), &mut unobserved)
}

#[test]
fn a_femur_that_flies_off_has_no_answer_and_one_that_lies_there_has() {
    let model = loose();
    let rests = drawn(&model, 0.0).unwrap();
    assert!(!rests.flags.contains(&Flag::Dislocated), "{:?}", rests.flags);
    for newton in [DRAWER, -DRAWER] {
        let told = drawn(&model, newton).unwrap_err();
        assert!(matches!(&told, SimError::Solver(m) if m.contains("drawn")), "{newton}: {told}");
    }
}

#[test]
fn rows_of_a_path_that_flies_off_have_no_answer_from_there_on() {
    let options = ProtocolOptions {
        compression_n: COMPRESSION,
        ap_flexions_deg: vec![0.0],
        ap_load_n: DRAWER,
        ap_rows: 2,
        ..ProtocolOptions::default()
    };
    let (steps, explicit) = (TrialSteps::default(), ExplicitOptions::default());
    // the first row has none, so no row of the path has one
    let told = explicit_protocol(&loose(), Protocol::ApLaxity, &options, &steps, &explicit).unwrap_err();
    assert!(matches!(&told, SimError::Solver(m) if m.contains("0 deg load +1.0 N")), "{told}");
}

#[test]
fn a_knee_that_has_turned_over_is_dislocated_and_rotated() {
    let model = Rig::knee().compiled();
    let trial = LaxityTrial::asked("rest".into(), Test::Neutral, 0.0, Load::compression(20.0));
    let rest = solve_trial(&model, &trial, &TrialOptions::default()).unwrap();
    // beyond 90 deg of valgus the same bones read 180 deg less of flexion
    let told = |flexion_deg: f64| {
        let mut gs = model.joint.grood_suntay(&rest.state.q);
        gs[FE] = flexion_deg.to_radians();
        let told = flags(&model, &gs, &rest.evaluation, &TrialOptions::default());
        [Flag::Dislocated, Flag::Rotated].map(|flag| told.contains(&flag))
    };
    for sound in [0.0, -15.0, -30.0] {
        assert_eq!(told(sound), [false; 2], "{sound} deg");
    }
    for over in [-60.0, -150.0] {
        assert_eq!(told(over), [true; 2], "{over} deg");
    }
}
