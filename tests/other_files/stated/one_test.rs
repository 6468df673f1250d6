//! Laxity files in which one position or one test is otherwise than the rest: a sign, a unit; and thousands among decimal commas.

use super::super::tables::{laxity, plain};
use super::{good, refused, said};

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
            let wanted = format!("against its load in {column} at 1 of 3 flexions, the first {there} deg");
            assert!(words.contains(&wanted), "{wanted}: {words}");
        }
    }
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
