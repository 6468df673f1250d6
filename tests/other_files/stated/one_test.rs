//! Laxity files in which one position or one test is otherwise than the rest: a sign, a unit; and thousands among decimal commas.

use super::super::tables::{laxity, plain};
use super::{good, refused, said, text, with_column};
use crate::common::build_model;
use std::sync::LazyLock;
use tempfile::TempDir;

/// A phantom as the program writes it, with its laxity.
static MEASURED: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    build_model().args(["phantom", "S192803-phantom"]).arg(folder.path().join("knee")).assert().success();
    folder
});

/// The table with cells changed, by test, flexion and number of the column.
pub(super) fn changed(change: impl Fn(&str, f64, usize, f64) -> f64) -> String {
    laxity(|test, flexion| {
        let row = plain(test, flexion, flexion + 0.3);
        let cell = |(at, cell): (usize, &str)| match cell.parse::<f64>() {
            Ok(number) if at > 1 => change(test, flexion, at, number).to_string(),
            _ => cell.to_owned(),
        };
        row.split(',').enumerate().map(cell).collect::<Vec<_>>().join(",")
    })
}

#[test]
fn a_sign_that_is_turned_at_one_flexion_is_told_there() {
    assert_eq!(said(&changed(|_, _, _, x| x)), "");
    for (at, column) in [(9, "vv_deg"), (10, "ie_deg"), (12, "ap_mm")] {
        for there in [0.0, 30.0, 90.0] {
            let words = said(&changed(|_, flexion, k, x| if k == at && flexion == there { -x } else { x }));
            let wanted =
                format!("against its load in {column} at 1 of 3 flexions, the first {there} deg, and with it at 2");
            assert!(words.contains(&wanted), "{wanted}: {words}");
        }
    }
}

#[test]
fn noise_under_no_load_or_of_a_knee_that_stands_still_is_not_called_a_turned_sign() {
    // what plain() reads without a load, and loads and motions of nothing
    for (load, column, at_rest, pair) in [
        (3, 9, 0.5, ["varus", "valgus"]),
        (4, 10, -1.0, ["internal", "external"]),
        (6, 12, -1.5, ["posterior", "anterior"]),
    ] {
        let at = |test: &str, flexion: f64| flexion == 30.0 && pair.contains(&test);
        let little = changed(|test, flexion, k, x| match at(test, flexion) {
            true if k == load => 0.05 * x,
            true if k == column => at_rest - 0.05 * (x - at_rest),
            _ => x,
        });
        let stiff = changed(|test, flexion, k, x| match at(test, flexion) {
            true if k == column => at_rest - 0.01 * (x - at_rest),
            _ => x,
        });
        for table in [little, stiff] {
            let words = said(&table);
            assert!(!words.contains("against its load"), "{words}");
        }
    }
    // a sensor reads something of nothing
    let unloaded = "n1,neutral,45,0.2,0.1,0,-1,20,45.3,0.4,-1.2,0.5,-1.4,-28.5\nn2,neutral,45,-0.2,-0.1,0,1,20,45.2,0.6,-0.8,0.5,-1.6,-28.5\n";
    let words = said(&(good() + unloaded));
    assert!(!words.contains("against its load"), "{words}");
}

#[test]
fn loads_of_one_test_in_another_unit_are_told_by_its_name() {
    for (at, column, test, fellow) in [
        (3, "load_vv_nm", "varus", "valgus"),
        (4, "load_ie_nm", "external", "internal"),
        (6, "load_ap_n", "posterior", "anterior"),
    ] {
        let words = said(&changed(|own, _, k, x| if k == at && own == test { x / 1000.0 } else { x }));
        assert!(words.contains(&format!("{column} is at most")), "{words}");
        assert!(words.contains(&format!("in the tests called {test}")) && words.contains(fellow), "{words}");
        // one way is often pulled less
        let words = said(&changed(|own, _, k, x| if k == at && own == test { x / 2.0 } else { x }));
        assert!(!words.contains("in the tests called"), "{words}");
    }
}

/// A laxity file of the phantom with one column's readings divided in the rows that are meant, by test and flexion.
pub(super) fn phantom_with(file: &str, column: &str, divided: f64, meant: impl Fn(&str, &str) -> bool) -> String {
    phantom_changed(file, column, |test, at, value| if meant(test, at) { value / divided } else { value })
}

/// A phantom's table with the cells of a column changed, by test and flexion.
pub(super) fn phantom_changed(file: &str, column: &str, change: impl Fn(&str, &str, f64) -> f64) -> String {
    let table = text(&MEASURED.path().join("knee/laxity").join(file));
    let at = table.lines().next().unwrap().split(',').position(|name| name == column).unwrap();
    let line = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if let Ok(value) = cells[at].parse::<f64>() {
            cells[at] = format!("{:.6}", change(&cells[1], &cells[2], value));
        }
        cells.join(",") + "\n"
    };
    table.lines().map(line).collect()
}

#[test]
fn readings_of_one_test_or_flexion_in_another_unit_are_told_by_its_name() {
    const RAD: f64 = 57.295_779_513_082_32;
    for file in ["kla.csv", "rks.csv"] {
        assert_eq!(said(&phantom_with(file, "ap_mm", 1.0, |_, _| true)), "", "{file}");
        for (column, factor, unit, own) in [
            ("ap_mm", 10.0, "cm", ["anterior", "posterior"]),
            ("ap_mm", 25.4, "inches", ["anterior", "posterior"]),
            ("ie_deg", RAD, "radians", ["internal", "external"]),
            ("vv_deg", RAD, "radians", ["varus", "valgus"]),
        ] {
            let table = phantom_with(file, column, 1.0, |_, _| true);
            let has = |at: usize, word: &str| table.lines().any(|line| line.split(',').nth(at) == Some(word));
            for test in own.into_iter().filter(|test| has(1, test)) {
                let words = said(&phantom_with(file, column, factor, |name, _| name == test));
                let wanted = [format!("in the {test} trials"), format!("maybe these readings are in {unit}")];
                assert!(wanted.iter().all(|w| words.contains(w)) && words.lines().count() == 1, "{wanted:?}: {words}");
            }
            let tested = own.into_iter().any(|test| has(1, test));
            for flexion in ["30.000000", "90.000000"].into_iter().filter(|_| tested) {
                let words = said(&phantom_with(file, column, factor, |_, at| at == flexion));
                let wanted = format!("at {} deg, and by", &flexion[..2]);
                // a flexion may move the knee 2.5 times as far as another, by which inches are more than cm
                let units = if unit == "radians" { &["radians"][..] } else { &["cm", "inches"] };
                let is_named = units.iter().any(|u| words.contains(&format!("maybe these readings are in {u}")));
                let told = words.contains(&wanted) && is_named;
                assert!(told && words.lines().count() == 1, "{wanted}: {words}");
            }
        }
    }
}

#[test]
fn loads_and_places_of_one_flexion_in_another_unit_are_told_there() {
    let at_30 = |_: &str, at: &str| at == "30.000000";
    for (column, divided, unit) in [
        ("load_ap_n", 4.448_221_615_260_5, "lbf"),
        ("load_ap_n", 9.806_65, "kgf"),
        ("load_ie_nm", 9.806_65, "kgf m"),
        ("si_mm", 10.0, "cm"),
        ("si_mm", 25.4, "inches"),
    ] {
        let words = said(&phantom_with("rks.csv", column, divided, at_30));
        let told = words.starts_with(column) && words.contains(" at 30 deg, and ");
        assert!(told && words.contains(&format!("maybe it is in {unit} there")), "{column} {unit}: {words}");
    }
    // a smaller load that moves the knee less
    let table = phantom_with("rks.csv", "load_ap_n", 5.0, at_30);
    let less = table.lines().map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let meant = cells[2] == "30.000000" && ["anterior", "posterior"].contains(&cells[1]);
        let cell = |(k, cell): (usize, &&str)| match cell.parse::<f64>() {
            Ok(value) if meant && k == 12 => (0.4 * value).to_string(),
            _ => (*cell).to_owned(),
        };
        cells.iter().enumerate().map(cell).collect::<Vec<_>>().join(",") + "\n"
    });
    let words = said(&less.collect::<String>());
    assert!(!words.contains("maybe it is in"), "{words}");
}

#[test]
fn neutral_trials_under_a_test_s_load_are_told() {
    let row = |name: &str, vv: f64, ie: f64, ap: f64| {
        good() + &format!("{name},neutral,30,{vv},{ie},0,{ap},20,30.3,0.5,-1,0.5,-1.5,-28.5\n")
    };
    assert_eq!(said(&row("n", 0.3, -0.2, 5.0)), "");
    for (vv, ie, ap) in [(10.0, 0.0, 0.0), (0.0, -5.0, 0.0), (0.0, 0.0, 100.0)] {
        let words = said(&row("n", vv, ie, ap));
        assert!(words.contains("1 trials are neutral by name and loaded, the first \"n\""), "{words}");
    }
}

#[test]
fn a_stiff_test_and_a_stiff_flexion_are_not_called_another_unit() {
    for (column, least) in [("ap_mm", 2.0), ("ie_deg", 5.0), ("vv_deg", 4.0)] {
        for test in ["anterior", "posterior", "internal", "external", "varus", "valgus"] {
            let words = said(&phantom_with("rks.csv", column, least, |name, _| name == test));
            assert!(!words.contains("maybe these readings"), "{column} {test}: {words}");
        }
        let words = said(&phantom_with("rks.csv", column, 0.5 * least, |_, at| at == "30.000000"));
        assert!(!words.contains("maybe these readings"), "{column}: {words}");
    }
}

#[test]
fn thousands_with_points_among_decimal_commas_are_refused_at_their_cell() {
    let german = good().replace(',', ";").replace('.', ",");
    assert_eq!(said(&german), "");
    let words = refused(&german.replacen(";20;", ";1.000;", 1));
    for word in ["row 2, column 8", "\"1.000\" may be a thousand", "write 1000 or 1,000"] {
        assert!(words.contains(word), "{word}: {words}");
    }
    let quoted = refused(&good().replacen(",20,", ",\"1,000\",", 1));
    assert!(quoted.contains("write 1000 or 1.000"), "{quoted}");
}

#[test]
fn numbers_in_columns_of_words_tell_nothing_of_decimal_signs() {
    for name in ["comment", "flags"] {
        let table = with_column(name, |_| "@".into()).replace(',', ";");
        let english = table.replace(";100;", ";100.000;").replace('@', "0,5");
        assert_eq!(said(&english), "", "{name}");
        let german = table.replace('.', ",");
        for word in ["1.000", "1,000"] {
            assert_eq!(said(&german.replace('@', word)), "", "{name} {word}");
        }
    }
    // a column that nothing reads is what such a table is refused by
    let unknown = with_column("version", |_| "@".into()).replace(',', ";").replace('.', ",").replace('@', "4.120");
    assert!(refused(&unknown).contains("unknown column \"version\""));
}
