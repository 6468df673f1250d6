//! Readings that lie alone, coordinates zeroed at each position, flexion from another zero.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests read the shared data")]

use needs_shared::needs_shared;
use sim::coordinate::{AP, Coordinate, IE, ML, SI, VV};
use sim::laxity::{LaxityTrial, between, read, sign_doubts};

/// A robot's tests at four flexions, of a knee that loosens in flexion.
fn made() -> Vec<LaxityTrial> {
    let mut csv = String::from(
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n",
    );
    let tests = [
        ("anterior", [0.0, 0.0, 130.0]),
        ("posterior", [0.0, 0.0, -130.0]),
        ("external", [0.0, 7.0, 0.0]),
        ("internal", [0.0, -7.0, 0.0]),
        ("valgus", [10.0, 0.0, 0.0]),
        ("varus", [-10.0, 0.0, 0.0]),
    ];
    for flexion in [0.0, 30.0, 60.0, 90.0] {
        for (test, [vv, ie, ap]) in tests {
            let slack = 1.0 + flexion / 90.0;
            csv += &format!(
                "{test}_{flexion},{test},{flexion},{vv},{ie},0,{ap},20,{:.3},{:.3},{:.3},{:.3},{:.3},{:.3}\n",
                flexion + 1.234,
                0.2137 * slack * vv + 0.011 * ie + 0.123,
                1.8137 * slack * ie + 0.0213 * vv - 0.071 * flexion - 2.017,
                0.013 + 0.011 * ie - 0.007 * ap,
                0.03 * slack * ap + 0.041 * flexion + 2.713,
                -24.123 + 0.041 * flexion
            );
        }
    }
    read(csv.as_bytes()).unwrap().trials
}

fn told(change: impl Fn(usize, &mut LaxityTrial)) -> Vec<(String, String)> {
    let mut trials = made();
    trials.iter_mut().enumerate().for_each(|(k, t)| change(k, t));
    sign_doubts(&trials).into_iter().map(|d| (d.column, d.words)).collect()
}

#[test]
fn a_course_over_flexion_has_no_reading_that_lies_alone() {
    assert!(told(|_, _| ()).is_empty(), "{:?}", told(|_, _| ()));
}

#[test]
fn a_reading_that_jumped_is_named_by_its_trial() {
    for (c, by) in [(VV, 12.0), (IE, 45.0), (ML, 12.0), (AP, 25.0), (SI, 12.0)] {
        for sign in [by, -by] {
            for at in (0..24).filter(|k| (6..18).contains(k)) {
                let name = made()[at].trial.clone();
                let all = told(|k, t| {
                    if k == at {
                        t.measured[c] = t.measured[c].map(|x| x + sign);
                    }
                });
                let named = |(column, words): &(String, String)| *column == c.column() && words.contains(&name);
                assert!(all.iter().any(named), "{name} {}: {all:?}", c.column());
            }
        }
    }
}

#[test]
fn a_coordinate_zeroed_at_each_position_is_told_and_one_at_one_position_is_not() {
    let zero = made();
    let first = |t: &LaxityTrial, c: Coordinate| {
        zero.iter().find(|z| z.nominal_flexion_deg == t.nominal_flexion_deg).and_then(|z| z.measured[c]).unwrap()
    };
    for c in [VV, IE] {
        let all = told(|_, t| t.measured[c] = t.measured[c].map(|x| x - first(t, c)));
        assert!(all.iter().any(|d| d.0 == c.column() && d.1.contains("zeroed at each")), "{}: {all:?}", c.column());
        let one = told(|_, t| {
            if t.nominal_flexion_deg == 30.0 {
                t.measured[c] = t.measured[c].map(|x| x - first(t, c));
            }
        });
        assert!(one.iter().all(|d| !d.1.contains("zeroed at each")), "{one:?}");
    }
}

#[test]
fn flexion_from_another_zero_is_told_where_it_is_alike_at_every_position() {
    let alike = told(|_, t| t.fe_deg += 12.0);
    assert!(alike.iter().any(|d| d.0 == "fe_deg" && d.1.contains("another zero")), "{alike:?}");
    assert!(told(|_, t| t.fe_deg += if t.nominal_flexion_deg == 90.0 { 12.0 } else { 0.0 }).is_empty());
    assert!(told(|_, t| t.fe_deg += 3.0).is_empty());
}

#[test]
fn rotations_of_two_sets_that_differ_by_a_factor_of_two_are_told() {
    let (a, mut b) = (made(), made());
    b.iter_mut().for_each(|t| t.load[IE] *= 0.8);
    let words =
        |b: &[LaxityTrial]| between(&[("kla", &a), ("rks", b)]).into_iter().map(|d| d.words).collect::<Vec<_>>();
    assert!(words(&b).is_empty(), "{:?}", words(&b));
    b.iter_mut().for_each(|t| t.measured[IE] = t.measured[IE].map(|x| 2.0 * x));
    assert!(words(&b).iter().any(|w| w.contains("ie_deg") && w.contains("counted twice")), "{:?}", words(&b));
}

#[test]
fn a_compression_that_is_next_to_nothing_and_not_0_is_told() {
    let small = told(|_, t| t.load[SI] /= 1000.0);
    assert!(small.iter().any(|d| d.0 == "load_si_n" && d.1.contains("kN")), "{small:?}");
    assert!(told(|_, t| t.load[SI] = 0.0).is_empty());
}

/// The robot's valgus trial at 60 deg of the published knee turned 9 deg less than those at 30 and 90: its moment turned nothing.
#[needs_shared]
fn the_published_knee_s_valgus_at_60_deg_lies_alone() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/specimens/S192803/laxity/rks.csv");
    let bytes = std::fs::read(path).unwrap();
    let all = sign_doubts(&read(&bytes).unwrap().trials);
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(all[0].words.contains("Valgus_60deg") && all[0].column == "vv_deg", "{}", all[0].words);
}
