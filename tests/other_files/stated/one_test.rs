//! Laxity files in which one position or one test is otherwise than the rest: a sign, a unit; and thousands among decimal commas.

use super::super::tables::{laxity, plain};
use super::{good, refused, said, with_column};

/// The table with cells changed, by test, flexion and number of the column.
fn changed(change: impl Fn(&str, f64, usize, f64) -> f64) -> String {
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
