//! A plan as a tidy table, and as lines for a terminal.

use super::chances::{ChanceTold, FailTold};
use super::knee::{STATES, main_coordinate};
use super::numbers::Value;
use super::outcome::{Outcome, TestTold};
use std::fmt::Write;

/// A number with its interval: "7.1 (6.0 to 8.3)".
pub(super) fn shown(v: Option<&Value>, digits: usize) -> String {
    match v {
        None => "none".into(),
        Some(Value { value, lower: Some(low), upper: Some(high), .. }) => {
            format!("{value:.digits$} ({low:.digits$} to {high:.digits$})")
        }
        Some(v) => format!("{:.digits$}", v.value),
    }
}

/// A value of a state.
pub(super) fn value<'a>(t: &'a TestTold, state: &str, name: &str) -> Option<&'a Value> {
    t.states.get(state)?.get(name)
}

/// plan.csv: a row a value.
pub(super) fn csv(out: &Outcome) -> String {
    let mut text = String::from("test,flexion_deg,state,quantity,value,mean,lower,upper,flags\n");
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
    for t in &out.tests {
        let states = STATES.iter().filter_map(|s| Some((*s, t.states.get(*s)?)));
        for (state, values) in states.chain([("reconstructed less intact", &t.off)]) {
            let flags = t.flags.get(state).map_or(String::new(), |f| f.join("; "));
            for (name, v) in values {
                // names of grafts are the user's
                let name = if name.contains([',', '"', '\n']) {
                    format!("\"{}\"", name.replace('"', "\"\""))
                } else {
                    name.clone()
                };
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
    text
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
    for c in &out.chances {
        let _ = writeln!(text, "{}: {}", c.of, chance(c));
    }
    text
}

/// A chance in words.
pub(super) fn chance(c: &ChanceTold) -> String {
    let best = if c.most_probable { "yes" } else { "no" };
    let share = match c.chance {
        Some(p) => format!("in {:.0} % of the samples; most probable knee: {best}", 100.0 * p),
        None => format!("most probable knee: {best}"),
    };
    share + &c.fails.as_ref().map_or(String::new(), fails)
}

/// Where it fails most often, in words.
fn fails(f: &FailTold) -> String {
    let place = format!("{} at {} deg", f.test, f.flexion_deg);
    match f.samples {
        Some([fails, all]) => format!("; fails most often in {place}: in {fails} of {all} samples"),
        None => format!("; furthest off in {place}"),
    }
}
