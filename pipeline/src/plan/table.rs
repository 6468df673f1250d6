//! A plan as a tidy table, and as lines for a terminal.

use super::chances::{ChanceTold, FailTold, in_order};
use super::knee::{STATES, main_coordinate};
use super::numbers::Value;
use super::outcome::{Outcome, TestTold};
use std::fmt::Write;

/// A number with so many digits behind the point; what rounds to nothing has no sign.
pub(super) fn fixed(x: f64, digits: usize) -> String {
    let told = format!("{x:.digits$}");
    match told.strip_prefix('-') {
        Some(size) if size.chars().all(|c| c == '0' || c == '.') => size.to_owned(),
        _ => told,
    }
}

/// A number with its interval: "7.1 (6.0 to 8.3)".
pub(super) fn shown(v: Option<&Value>, digits: usize) -> String {
    match v {
        None => "none".into(),
        Some(Value { value, lower: Some(low), upper: Some(high), .. }) => {
            let [value, low, high] = [value, low, high].map(|x| fixed(*x, digits));
            format!("{value} ({low} to {high})")
        }
        Some(v) => fixed(v.value, digits),
    }
}

/// A value of a state.
pub(super) fn value<'a>(t: &'a TestTold, state: &str, name: &str) -> Option<&'a Value> {
    t.states.get(state)?.get(name)
}

/// Words as a cell has them: names of grafts are the user's, and may have commas.
fn quoted(words: &str) -> String {
    if words.contains([',', '"', '\n']) { format!("\"{}\"", words.replace('"', "\"\"")) } else { words.to_owned() }
}

/// The state by which plan.csv calls how far the reconstructed knee lies from the intact one.
const AGAINST: &str = "reconstructed less intact";

/// What is odd about a state; about a difference what is odd about either of its ends.
fn odd(t: &TestTold, state: &str) -> String {
    let of = |state: &str| t.flags.get(state).map_or(String::new(), |f| f.join("; "));
    if state != AGAINST {
        return of(state);
    }
    let ends = [STATES[0], STATES[2]].map(|end| (end, of(end)));
    let odd = ends.iter().filter(|(_, flags)| !flags.is_empty()).map(|(end, flags)| format!("{end}: {flags}"));
    odd.collect::<Vec<_>>().join("; ")
}

/// plan.csv: a row a value. A state without any is a row that says why.
pub(super) fn csv(out: &Outcome) -> String {
    let mut text = String::from("test,flexion_deg,state,quantity,value,mean,lower,upper,flags\n");
    out.tests.iter().for_each(|t| rows(&mut text, t));
    text
}

/// The rows of a test.
fn rows(text: &mut String, t: &TestTold) {
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
    let states = STATES.iter().filter_map(|s| Some((*s, t.states.get(*s)?)));
    for (state, values) in states.chain([(AGAINST, &t.off)]) {
        let flags = quoted(&odd(t, state));
        if values.is_empty() && !flags.is_empty() {
            let _ = writeln!(text, "{},{},{state},,,,,,{flags}", t.test, t.flexion_deg);
        }
        for (name, v) in values {
            let name = quoted(name);
            let _ = writeln!(
                text,
                "{},{},{state},{name},{:.4},{},{},{},{flags}",
                t.test,
                t.flexion_deg,
                v.value,
                cell(v.mean),
                cell(v.lower),
                cell(v.upper)
            );
        }
    }
}

/// The unit of a test's own coordinate.
pub(super) fn unit(t: &TestTold) -> &'static str {
    main_coordinate(&t.test).unit()
}

/// Lines for a terminal: laxities side by side, chances.
pub(super) fn words(out: &Outcome) -> String {
    let mut text = String::new();
    for t in out.tests.iter().filter(|t| t.test != "unloaded") {
        let of = |state: &str| shown(value(t, state, "laxity"), 1);
        let [intact, deficient, reconstructed] = STATES.map(of);
        let _ = writeln!(
            text,
            "{} at {} deg: intact {intact}, deficient {deficient}, reconstructed {reconstructed} {}",
            t.test,
            t.flexion_deg,
            unit(t)
        );
    }
    for c in in_order(&out.chances) {
        let _ = writeln!(text, "{}: {}", c.of, chance(c));
    }
    text
}

/// A chance in words.
pub(super) fn chance(c: &ChanceTold) -> String {
    let best = if c.most_probable { "yes" } else { "no" };
    let share = match (c.chance, c.counts) {
        (Some(p), Some([holds, of])) => {
            format!("in {:.0} % of the samples ({holds} of {of}); most probable knee: {best}", 100.0 * p)
        }
        _ => format!("most probable knee: {best}"),
    };
    share + &c.fails.as_ref().map_or(String::new(), fails)
}

/// Where it fails most often, in words.
fn fails(f: &FailTold) -> String {
    let place = format!("{} at {} deg", f.test, f.flexion_deg);
    match f.samples {
        Some([fails, all]) => format!("; fails most often in {place}: in {fails} of {all} samples"),
        None if f.is_lost => format!("; no equilibrium in {place}"),
        None => format!("; furthest off in {place}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn a_difference_has_the_flags_of_both_ends_and_a_state_without_values_has_a_row() {
        let value = Value { value: 1.0, mean: None, lower: None, upper: None };
        let some = || BTreeMap::from([("ap_mm".to_owned(), value)]);
        let flags = [("intact", "subluxed"), ("deficient", "no equilibrium"), ("reconstructed", "dislocated")];
        let t = TestTold {
            test: "valgus".into(),
            flexion_deg: 30.0,
            load: [0.0; 5],
            states: STATES.map(|s| (s.to_owned(), if s == "deficient" { BTreeMap::new() } else { some() })).into(),
            flags: flags.map(|(s, f)| (s.to_owned(), vec![f.to_owned()])).into(),
            off: some(),
            chance: None,
            counts: None,
            odd: vec![],
            beyond: vec![],
        };
        let mut text = String::new();
        rows(&mut text, &t);
        let expected = [
            "valgus,30,intact,ap_mm,1.0000,,,,subluxed",
            "valgus,30,deficient,,,,,,no equilibrium",
            "valgus,30,reconstructed,ap_mm,1.0000,,,,dislocated",
            "valgus,30,reconstructed less intact,ap_mm,1.0000,,,,intact: subluxed; reconstructed: dislocated",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_test_without_equilibrium_is_told_as_such() {
        let told = |is_lost: bool, samples: Option<[usize; 2]>| {
            fails(&FailTold { test: "varus".into(), flexion_deg: 30.0, samples, is_lost })
        };
        assert_eq!(told(true, None), "; no equilibrium in varus at 30 deg");
        assert_eq!(told(false, None), "; furthest off in varus at 30 deg");
        assert_eq!(told(false, Some([3, 9])), "; fails most often in varus at 30 deg: in 3 of 9 samples");
    }

    #[test]
    fn what_rounds_to_nothing_has_no_sign_and_all_else_keeps_its_own() {
        for digits in 0..4 {
            let step = 10.0_f64.powi(-(digits as i32));
            for x in [0.0, 1e-9, 0.4 * step] {
                assert_eq!(fixed(-x, digits), fixed(x, digits), "{x} {digits}");
            }
            for x in [0.6 * step, step, 12.0] {
                assert_eq!(fixed(-x, digits), format!("-{}", fixed(x, digits)), "{x} {digits}");
            }
        }
        let v = Value { value: -0.04, mean: Some(-0.01), lower: Some(-2.0), upper: Some(-0.001) };
        assert_eq!(shown(Some(&v), 1), "0.0 (-2.0 to 0.0)");
    }
}
