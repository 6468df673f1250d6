//! Laxity files in which one reading, one load, or readings that no test of theirs loads are in another unit; one side that is turned at one flexion.

use super::one_test::{changed, phantom_changed, phantom_with};
use super::said;

const RAD: f64 = 57.295_779_513_082_32;
const LBF: f64 = 4.448_221_615_260_5;
const FT_LBF: f64 = 1.355_817_948_331_4;

/// Whether it is the row of a test at a flexion.
fn at(test: &'static str, flexion: &'static str) -> impl Fn(&str, &str) -> bool {
    move |own: &str, there: &str| own == test && there == flexion
}

/// That the one line about a table names the column and has these words.
fn one_line(table: &str, column: &str, words: &[&str]) {
    let said = said(table);
    let has = said.starts_with(column) || said.contains(&format!(" {column} "));
    assert!(has && words.iter().all(|w| said.contains(w)) && said.lines().count() == 1, "{column} {words:?}: {said}");
}

#[test]
fn one_reading_in_another_unit_is_told_by_its_trial() {
    for (column, divided, unit, test) in [
        ("ap_mm", 10.0, "cm", "anterior"),
        ("ap_mm", 25.4, "inches", "anterior"),
        ("ie_deg", RAD, "radians", "external"),
        ("ie_deg", RAD, "radians", "internal"),
        ("si_mm", 10.0, "cm", "varus"),
    ] {
        let table = phantom_with("rks.csv", column, divided, at(test, "30.000000"));
        let trial = format!("trial \"{test}_30deg");
        let wanted = format!("maybe this one is in {unit}");
        // what lies so near to 0 is in cm and in inches
        let said = said(&table);
        let named = said.contains(&wanted) || (unit == "inches" && said.contains("maybe this one is in cm"));
        assert!(said.contains(&trial) && named && said.lines().count() == 1, "{column} {unit}: {said}");
        // a knee that was blocked, or not loaded, reads so as well
        assert!(said.contains("or it slipped, or its load was not applied"), "{column} {unit}: {said}");
    }
    // a reading that is off by no unit's factor
    for divided in [2.0, 3.0, -1.0] {
        let table = phantom_with("rks.csv", "ap_mm", divided, at("anterior", "30.000000"));
        assert!(!said(&table).contains("maybe this one"), "{divided}: {}", said(&table));
    }
}

#[test]
fn one_load_that_is_off_by_a_unit_s_factor_is_told_by_its_trial() {
    for (column, divided, unit, test) in [
        ("load_ap_n", LBF, "lbf", "anterior"),
        ("load_ap_n", 9.806_65, "kgf", "posterior"),
        ("load_ap_n", 1000.0, "kN", "anterior"),
        ("load_ie_nm", FT_LBF, "ft lbf", "external"),
        ("load_vv_nm", FT_LBF, "ft lbf", "varus"),
    ] {
        let table = phantom_with("rks.csv", column, divided, at(test, "30.000000"));
        let wanted = format!("maybe it is in {unit} there");
        one_line(&table, column, &[&format!("trial \"{test}_30deg"), &wanted]);
    }
    // a smaller load of a laboratory
    for divided in [1.33, 1.4, 4.433, 10.0] {
        let table = phantom_with("rks.csv", "load_ap_n", divided, at("anterior", "30.000000"));
        assert!(!said(&table).contains("maybe it is in"), "{divided}: {}", said(&table));
    }
}

#[test]
fn a_load_of_one_size_that_is_round_in_another_unit_only_is_told() {
    let all = |_: &str, _: &str| true;
    one_line(&phantom_with("rks.csv", "load_ie_nm", FT_LBF, all), "load_ie_nm", &["7.00 N m", "Is ft lbf its unit"]);
    one_line(&phantom_with("rks.csv", "load_vv_nm", FT_LBF, all), "load_vv_nm", &["10.00 N m", "Is ft lbf its unit"]);
    one_line(&phantom_with("rks.csv", "load_si_n", LBF, all), "load_si_n", &["50.00 N", "Is lbf its unit"]);
    // numbers of another laboratory
    for divided in [1.1, 1.3, 1.7, 2.0] {
        assert_eq!(said(&phantom_with("rks.csv", "load_ie_nm", divided, all)), "", "{divided}");
    }
}

#[test]
fn readings_that_a_test_does_not_load_in_another_unit_are_told_by_its_name() {
    for (file, column, divided, unit, test) in [
        ("rks.csv", "ml_mm", 10.0, "cm", "internal"),
        ("kla.csv", "ml_mm", 10.0, "cm", "internal"),
        ("rks.csv", "ap_mm", 10.0, "cm", "internal"),
        ("rks.csv", "ie_deg", RAD, "radians", "anterior"),
        ("kla.csv", "ie_deg", RAD, "radians", "anterior"),
    ] {
        let table = phantom_with(file, column, divided, |own, _| own == test);
        let words = [format!("in the {test} trials"), format!("maybe these readings are in {unit}")];
        one_line(&table, column, &[&words[0], &words[1]]);
    }
    for (file, column, divided) in [("kla.csv", "vv_deg", RAD), ("rks.csv", "ml_mm", 10.0), ("kla.csv", "ml_mm", 10.0)]
    {
        let table = phantom_with(file, column, divided, |_, there| there == "30.000000");
        one_line(&table, column, &["at 30 deg, and by", "maybe these readings are in"]);
    }
    // a knee that moves less in one test, but not about 0; and one that stands still
    let less = |own: &str, _: f64, k: usize, x: f64| if k == 11 && own == "internal" { 0.1 * x + 1.5 } else { x };
    for table in [changed(less), changed(|_, _, k, x| if k == 11 { 0.0 } else { x })] {
        assert!(!said(&table).contains("maybe these readings"), "{}", said(&table));
    }
}

#[test]
fn a_side_that_is_turned_at_one_flexion_is_told_there() {
    for there in ["0.000000", "30.000000", "90.000000"] {
        let table = phantom_with("rks.csv", "ml_mm", -1.0, |_, flexion| flexion == there);
        let flexion = there.split('.').next().unwrap();
        let words = said(&table);
        assert!(words.contains(&format!("ml_mm goes to the other side at {flexion} deg")), "{there}: {words}");
    }
    for (file, by) in [("rks.csv", -1.0), ("rks.csv", 1.0), ("kla.csv", -1.0)] {
        let words = said(&phantom_with(file, "ml_mm", by, |_, _| true));
        assert!(!words.contains("to the other side at"), "{file} {by}: {words}");
    }
}

#[test]
fn noise_of_the_side_at_one_flexion_is_not_called_turned() {
    // at 0 deg tests go to the other side than at 30 and 90 deg: each of them, or all but the last two
    let table = |by: f64, last: f64| {
        changed(|test, flexion, k, x| {
            let way = if ["anterior", "internal", "varus"].contains(&test) { 1.0 } else { -1.0 };
            let step = match (flexion == 0.0, test) {
                (true, _) => by,
                (false, "varus" | "valgus") => last,
                (false, _) => -by,
            };
            if k == 11 { x + way * step } else { x }
        })
    };
    for (by, last, is_told) in [(0.3, -0.3, false), (0.6, -0.6, false), (2.0, -2.0, true), (2.0, 1.0, false)] {
        let words = said(&table(by, last));
        assert_eq!(words.contains("ml_mm goes to the other side at 0 deg"), is_told, "{by} {last}: {words}");
    }
}

#[test]
fn what_the_apparatus_holds_in_a_test_is_no_unit_or_named_as_well() {
    for own in [&["anterior"][..], &["anterior", "posterior"]] {
        let held =
            |by: f64| phantom_changed("rks.csv", "ie_deg", |test, _, x| if own.contains(&test) { by * x } else { x });
        // what is held well varies by less than in any unit
        let words = said(&held(5e-4));
        assert!(!words.contains("maybe these readings"), "{own:?}: {words}");
        let words = said(&held(0.015));
        let named = words.contains("in radians, and the rest in deg, or the apparatus held ie_deg there");
        assert!(named && words.contains("leave its cells empty where it was held"), "{own:?}: {words}");
    }
    // what the test loads is not held
    let words = said(&phantom_with("rks.csv", "ap_mm", 10.0, |own, _| own == "anterior"));
    assert!(words.contains("maybe these readings") && !words.contains("held"), "{words}");
}

#[test]
fn moments_that_were_turned_from_pound_inches_are_not_called_another_unit() {
    // 50 and 100 lbf in: as kgf m they would be 55.40 and 110.80 N m, which no test applies
    let words = said(&changed(|_, _, k, x| if k == 3 || k == 4 { 1.1298 * x } else { x }));
    assert!(!words.contains("round"), "{words}");
}

#[test]
fn a_coordinate_that_is_zeroed_anew_at_one_flexion_is_told_there() {
    let shifted = |column: &str, there: &str, by: f64| {
        said(&phantom_changed("rks.csv", column, |_, at, x| if at == there { x + by } else { x }))
    };
    for (column, by, sign) in [("ml_mm", 12.0, "+"), ("ml_mm", -12.0, "-"), ("vv_deg", 12.0, "+")] {
        for there in ["0.000000", "30.000000", "90.000000"] {
            let words = shifted(column, there, by);
            let wanted = format!("at {} deg {column} lies {sign}1", there.split('.').next().unwrap());
            assert!(words.contains(&wanted) && words.contains("was it zeroed anew there"), "{wanted}: {words}");
        }
    }
    // what flexion may do to a knee
    for (column, by) in [("ml_mm", 4.0), ("vv_deg", 5.0), ("ap_mm", 10.0), ("ie_deg", 15.0)] {
        let words = shifted(column, "30.000000", by);
        assert!(!words.contains("zeroed anew"), "{column}: {words}");
    }
}

#[test]
fn one_test_that_turns_a_knee_less_at_one_flexion_is_not_called_radians() {
    // a phantom's tibia turns by 8 deg under valgus, and hardly in extension
    let table = |by: f64| {
        changed(|test, flexion, k, x| match (k, test, flexion == 0.0) {
            (10, "valgus", true) => by / RAD,
            (10, "valgus", false) => by,
            _ => x,
        })
    };
    for (by, is_told) in [(-8.0, false), (-20.0, true)] {
        let words = said(&table(by));
        assert_eq!(words.contains("maybe this one is in radians"), is_told, "{by}: {words}");
    }
}
