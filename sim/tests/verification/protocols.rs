//! Protocols of a knee that falls out of its joint: a step without equilibrium is a row without an answer.
use crate::verification::rig::Rig;
use sim::coordinate::{FREE, Load};
use sim::error::SimError;
use sim::flags::Flag;
use sim::laxity::TrialResult;
use sim::model::Model;
use sim::protocols::{Protocol, ProtocolOptions, run};
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
