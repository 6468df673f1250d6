//! Protocols of a knee that falls out of its joint: a step without equilibrium is a row without an answer.
use crate::verification::rig::Rig;
use sim::coordinate::{FREE, Load};
use sim::error::SimError;
use sim::flags::Flag;
use sim::jumps::flag_jumps;
use sim::laxity::{LaxityTrial, Test, TrialResult};
use sim::model::Model;
use sim::protocols::{Protocol, ProtocolOptions, run};
use sim::spec::PoseSpec;
use sim::trials::{TrialOptions, solve};

/// Compression [N].
const COMPRESSION: f64 = 20.0;

/// The rig knee without ligaments on its flat plateaus: friction holds it while nothing pulls, and nothing under a drawer.
fn loose() -> Model {
    let whole = Rig::knee().compiled();
    whole.without(&whole.bundle_names()).unwrap()
}

/// A drawer beyond any friction, at the CT pose's flexion.
fn drawn(ap_rows: usize) -> ProtocolOptions {
    ProtocolOptions {
        compression_n: COMPRESSION,
        ap_flexions_deg: vec![0.0],
        ap_load_n: 50.0,
        ap_rows,
        ..ProtocolOptions::default()
    }
}

fn is_lost(row: &TrialResult) -> bool {
    row.flags == [Flag::NoEquilibrium]
}

#[test]
fn a_step_without_equilibrium_is_a_row_without_an_answer_and_the_next_goes_on_from_the_last() {
    let model = loose();
    let rows = run(&model, Protocol::ApLaxity, &drawn(2)).unwrap();
    // 50 N, then backwards over 0 to -50 N, and forwards again
    assert_eq!(rows.iter().map(is_lost).collect::<Vec<_>>(), [true, false, true, false, true]);
    for lost in rows.iter().filter(|r| is_lost(r)) {
        assert!(lost.predicted().iter().chain(&lost.forces_n).all(|x| x.is_nan()));
        assert!(lost.pose.fe_deg == 0.0 && lost.forces_n.len() == rows[1].forces_n.len());
    }
    let rest = solve(&model, 0.0, &Load::compression(COMPRESSION), &TrialOptions::default()).unwrap().predicted();
    for row in [&rows[1], &rows[3]] {
        let off = FREE.into_iter().map(|c| (row.predicted()[c] - rest[c]).abs()).fold(0.0, f64::max);
        assert!(off < 0.01, "{}: {off} off where an unloaded knee rests", row.trial.trial);
    }
}

#[test]
fn a_protocol_without_any_equilibrium_and_one_that_cannot_be_asked_are_errors() {
    let model = loose();
    let refused = |options: &ProtocolOptions| run(&model, Protocol::ApLaxity, options).unwrap_err();
    let none = refused(&drawn(1));
    assert!(matches!(&none, SimError::Solver(m) if m.contains("0 deg load +50.0 N")), "{none}");
    assert!(matches!(refused(&ProtocolOptions { ap_load_n: -1.0, ..drawn(2) }), SimError::Input(_)));
    assert!(matches!(refused(&ProtocolOptions { ap_flexions_deg: vec![0.0, 200.0], ..drawn(2) }), SimError::Input(_)));
}

/// Rows a degree apart: an even motion is no jump, one of 3.5 mm is, and both of its rows say so. Other loads, states and far flexions are other rows.
#[test]
fn a_knee_that_jumps_between_flexions_under_one_load_is_flagged_at_both() {
    let row = |fe_deg: f64, ap_mm: f64, si_n: f64| {
        let trial = LaxityTrial::asked(format!("{fe_deg}"), Test::Neutral, fe_deg, Load::compression(si_n));
        let pose = PoseSpec { fe_deg, ap_mm, ..PoseSpec::default() };
        TrialResult { trial, pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] }
    };
    let flagged = |mut rows: Vec<TrialResult>| {
        flag_jumps(&mut rows);
        rows.iter().map(|r| r.flags == [Flag::Jumps]).collect::<Vec<_>>()
    };
    let even: Vec<TrialResult> = (0..5).map(|k| row(f64::from(k), f64::from(k), 20.0)).collect();
    assert_eq!(flagged(even.clone()), [false; 5]);
    let mut jumping = even;
    jumping[3..].iter_mut().for_each(|r| r.pose.ap_mm += 2.5);
    // whatever the order of the rows
    jumping.swap(0, 3);
    assert_eq!(flagged(jumping.clone()), [true, false, true, false, false]);
    let mut cut = jumping;
    cut[2].trial.without = vec!["ACL".into()];
    assert_eq!(flagged(cut), [false; 5]);
    assert_eq!(flagged(vec![row(10.0, 0.0, 20.0), row(11.0, 9.0, 50.0), row(13.5, 9.0, 20.0)]), [false; 3]);
    // a row without an answer lies between no others
    assert_eq!(flagged(vec![row(1.0, 0.0, 20.0), row(2.0, f64::NAN, 20.0), row(3.0, 7.0, 20.0)]), [true, false, true]);
}
