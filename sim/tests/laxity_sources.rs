//! Two data sets of one knee: one file given twice, a side that is turned, a zero that is shifted; units that a test's largest load shows.
#![allow(clippy::unwrap_used, reason = "tests")]

use sim::coordinate::{AP, Coordinate, FREE, Free, IE, ML, SI, VV};
use sim::laxity::{LaxityTrial, against_model, between, read, repeated, sign_doubts};

/// Drawers and moments at flexions, whose loads are `size` times those of the first apparatus; it goes to the side with valgus and drawer.
fn made(size: f64) -> Vec<LaxityTrial> {
    let mut csv = String::from(
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n",
    );
    let tests = [
        ("anterior", [0.0, 0.0, 130.0]),
        ("posterior", [0.0, 0.0, -130.0]),
        ("external", [0.0, 5.0, 0.0]),
        ("internal", [0.0, -5.0, 0.0]),
    ];
    for flexion in [0.0, 30.0, 90.0] {
        for (test, loads) in tests {
            let [vv, ie, ap] = loads.map(|x| size * x);
            csv += &format!(
                "{test}_{flexion},{test},{flexion},{vv},{ie},0,{ap},20,{flexion},{},{},{},{},-24\n",
                0.2 * ie,
                3.0 * ie - 2.0,
                1.0 + 0.008 * ap - 0.1 * ie,
                0.05 * ap + 2.0
            );
        }
    }
    read(csv.as_bytes()).unwrap().trials
}

/// Columns that two sets contradict each other in, the second changed.
fn columns(change: &dyn Fn(&mut LaxityTrial)) -> Vec<String> {
    let (a, mut b) = (made(1.0), made(1.4));
    b.iter_mut().for_each(change);
    let both = between(&[("kla", &a), ("rks", &b)]);
    // whichever comes first
    let other: Vec<String> = between(&[("rks", &b), ("kla", &a)]).into_iter().map(|d| d.column).collect();
    assert_eq!(both.iter().map(|d| d.column.clone()).collect::<Vec<_>>(), other);
    assert!(both.iter().all(|d| d.words.contains("laxity.kla and laxity.rks")));
    other
}

#[test]
fn one_file_as_two_sets_is_found_whatever_its_trials_are_called() {
    let a = made(1.0);
    let mut b = a.clone();
    b.iter_mut().for_each(|t| t.trial += "_again");
    assert_eq!(repeated(&[("kla", &a), ("other", &made(1.4)), ("rks", &b)]), Some(["kla", "rks"]));
    b[3].measured[AP] = Some(0.25);
    assert_eq!(repeated(&[("kla", &a), ("rks", &b)]), None);
    assert_eq!(repeated(&[("kla", &a)]), None);
}

#[test]
fn a_side_turned_or_a_zero_shifted_in_one_set_is_found_and_nothing_else() {
    assert!(columns(&|_| ()).is_empty());
    assert_eq!(columns(&|t| t.measured[ML] = t.measured[ML].map(|x| -x)), ["ml_mm"]);
    for (c, by) in [(VV, 6.0), (IE, 15.0), (ML, 5.0), (AP, 10.0), (SI, 6.0)] {
        for by in [by, -by] {
            assert_eq!(columns(&|t: &mut LaxityTrial| t.measured[c] = t.measured[c].map(|x| x + by)), [c.column()]);
        }
    }
    // rougher apparatus is no fault
    for c in FREE {
        assert!(columns(&|t: &mut LaxityTrial| t.measured[c] = t.measured[c].map(|x| x + 1.0)).is_empty());
    }
    // displacements have no zero
    let mut b = made(1.4);
    b.iter_mut().for_each(|t| t.measured[AP] = t.measured[AP].map(|x| x + 10.0));
    let from = |t: &LaxityTrial| sim::laxity::Reference { trial: "n".into(), load: t.load, fe_deg: t.fe_deg };
    b.iter_mut().for_each(|t| t.reference = Some(from(t)));
    assert!(between(&[("kla", &made(1.0)), ("rks", &b)]).is_empty());
}

#[test]
fn the_unit_of_a_load_is_named_where_one_makes_it_usual() {
    let words = |c: Coordinate, by: f64| {
        let mut trials = made(1.0);
        trials.iter_mut().for_each(|t| t.load[c] *= by);
        let of = sign_doubts(&trials).into_iter().filter(|d| d.column == c.load_column());
        of.map(|d| d.words).collect::<String>()
    };
    for (c, by, unit) in [
        (AP, 1.0 / 4.448_22, "In lbf it would be 130"),
        (AP, 4.448_22, "In N, not in lbf"),
        (AP, 0.001, "In kN it would be 130"),
        (IE, 8.850_75, "In lbf in it would be 5"),
        (IE, 0.112_985, "In N m, not in lbf in"),
        (IE, 1000.0, "In N mm it would be 5"),
    ] {
        assert!(words(c, by).contains(unit), "{c:?} {by}: {}", words(c, by));
    }
    assert!(words(AP, 1.0).is_empty() && words(IE, 1.0).is_empty());
}

#[test]
fn the_angle_between_the_shafts_is_no_flexion() {
    let words = |change: &dyn Fn(&mut LaxityTrial)| {
        let mut trials = made(1.0);
        trials.iter_mut().for_each(change);
        let of = sign_doubts(&trials).into_iter().filter(|d| d.column == "fe_deg");
        of.map(|d| d.words).collect::<String>()
    };
    assert!(words(&|_| ()).is_empty());
    let fe: fn(&mut LaxityTrial) = |t| t.fe_deg = 180.0 - t.fe_deg;
    assert!(words(&fe).contains("angle between the shafts"), "{}", words(&fe));
    let both: fn(&mut LaxityTrial) = |t| {
        t.fe_deg = 180.0 - t.fe_deg;
        t.nominal_flexion_deg = 180.0 - t.nominal_flexion_deg;
    };
    assert!(words(&both).contains("angle between the shafts"), "{}", words(&both));
}

#[test]
fn poses_about_another_zero_than_a_knee_s_are_doubted() {
    for (c, by) in [(VV, 30.0), (IE, -60.0), (ML, 25.0), (AP, -40.0)] {
        let mut trials = made(1.0);
        trials.iter_mut().for_each(|t| t.measured[c] = t.measured[c].map(|x| x + by));
        let doubts = sign_doubts(&trials);
        assert!(doubts.iter().any(|d| d.column == c.column() && d.words.contains("offset")), "{doubts:?}");
    }
}

#[test]
fn a_side_turned_in_every_set_shows_against_a_model() {
    let trials = made(1.0);
    // a model that is stiffer, has its zero elsewhere, and leaves out a trial
    let answer = |by: f64| -> Vec<_> {
        let one = |t: &LaxityTrial| Free::from_fn(|c| by * 0.5 * t.measured[c].unwrap() + 4.0);
        trials.iter().enumerate().map(|(i, t)| (i != 3).then(|| one(t))).collect()
    };
    assert!(against_model(&trials, &answer(1.0)).is_none());
    let told = against_model(&trials, &answer(-1.0)).unwrap();
    assert!(told.column == "ml_mm" && told.words.contains("positive = \"medial\""), "{}", told.words);
    assert!(against_model(&trials[..4], &answer(-1.0)[..4]).is_none(), "few tests show nothing");
}

/// Columns that are doubted after a change.
fn doubted(change: &dyn Fn(&mut LaxityTrial)) -> Vec<(String, String)> {
    let mut trials = made(1.4);
    trials.iter_mut().for_each(change);
    sign_doubts(&trials).into_iter().map(|d| (d.column, d.words)).collect()
}

#[test]
fn loads_that_are_round_in_another_unit_are_told_and_others_are_not() {
    assert!(doubted(&|_| ()).is_empty());
    let moments = |by: f64| {
        move |t: &mut LaxityTrial| {
            // two loads, as tests have
            let size = if t.nominal_flexion_deg > 60.0 { 5.0 / 7.0 } else { 1.0 };
            t.load[IE] = (t.load[IE] * by * size * 1e4).round() / 1e4;
        }
    };
    for (by, unit) in [(0.737_562, "ft lbf"), (1.0, ""), (0.7, ""), (1.0 / 9.806_65, "kgf m")] {
        let told = doubted(&moments(by));
        let named = told.iter().any(|(c, words)| c == "load_ie_nm" && words.contains(&format!("in {unit} it and")));
        assert_eq!(named, !unit.is_empty(), "{by}: {told:?}");
    }
    // one load alone shows it where it is a multiple of 0.5 N m to four digits
    let told = doubted(&|t| t.load[IE] *= 0.737_562);
    assert!(matches!(&told[..], [(c, words)] if c == "load_ie_nm" && words.contains("Is ft lbf its unit")), "{told:?}");
    assert!(doubted(&|t| t.load[IE] *= 0.737).is_empty());
}

#[test]
fn a_cell_filled_with_zero_is_told_and_a_zero_that_is_read_is_not() {
    let one = |test: &'static str, c: Coordinate| {
        move |t: &mut LaxityTrial| {
            t.measured[c] = t.measured[c].map(|x| if t.trial == test { 0.0 } else { x + 0.012_345 });
        }
    };
    let told = doubted(&one("external_30", IE));
    assert!(matches!(&told[..], [(c, words)] if c == "ie_deg" && words.contains("external_30")), "{told:?}");
    // without load a knee may stand at 0
    let unloaded = |t: &mut LaxityTrial| {
        one("external_30", IE)(t);
        if t.trial == "external_30" {
            t.load[IE] = 0.0;
        }
    };
    assert!(doubted(&unloaded).iter().all(|(c, _)| c != "ie_deg"));
    // readings of one decimal pass through 0
    let coarse = |t: &mut LaxityTrial| {
        one("external_30", IE)(t);
        t.measured[IE] = t.measured[IE].map(f64::round);
    };
    assert!(doubted(&coarse).is_empty());
    // a coordinate that is held is 0 throughout
    assert!(doubted(&|t| t.measured[VV] = Some(0.0)).is_empty());
}

#[test]
fn flexion_that_counts_negative_throughout_is_told() {
    let turned = |t: &mut LaxityTrial| (t.fe_deg, t.nominal_flexion_deg) = (-t.fe_deg, -t.nominal_flexion_deg);
    let told = doubted(&turned);
    assert!(matches!(&told[..], [(c, words)] if c == "fe_deg" && words.contains("negative throughout")), "{told:?}");
}

#[test]
fn drawers_in_another_unit_in_one_set_are_told_as_that_and_not_as_an_offset() {
    for by in [2.54, 1.0 / 2.54, 10.0, 0.1, 1.3] {
        let (a, mut b) = (made(1.0), made(1.4));
        b.iter_mut().for_each(|t| t.measured[AP] = t.measured[AP].map(|x| by * x));
        let all = between(&[("kla", &a), ("rks", &b)]);
        let of_ap: Vec<&str> = all.iter().filter(|d| d.column == "ap_mm").map(|d| d.words.as_str()).collect();
        let named = of_ap.len() == 1 && of_ap[0].contains("moves forwards") && of_ap[0].contains("unit");
        assert!(if by == 1.3 { of_ap.is_empty() } else { named }, "{by}: {all:?}");
    }
}
