//! Of the page of a diagnosis: misfits, errors on unseen trials, ligaments and their forces, with ligaments alone recalibrated; and the same with the
//! answer, where there is one.

use crate::report::html::escaped;
use diagnosis::report::carried::LEAST_N;
use diagnosis::report::words::{fixed, parameter, signed};
use diagnosis::report::{Carried, Diagnosis};
use diagnosis::search::map::Cell;
use sim::coordinate::FREE;
use sim::protocols::ProtocolOptions;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What each map, bar and column is of.
const RECALIBRATED: &str = "ligaments recalibrated";
const ANSWERED: &str = "with the answer";
/// What noise and floor leave, and the same where the error is as low.
const FLOOR: &str = "noise and floor";
const AS_LOW: &str = "noise and floor: so much or more";

/// Whether there is an answer to show. Where nothing is named, what a diagnosis has as "with the answer" is what it has without.
fn has_answer(d: &Diagnosis) -> bool {
    !d.answers.is_empty()
}

/// The residual maps side by side: a row a condition.
pub(super) fn maps(out: &mut String, d: &Diagnosis) {
    let mut maps = vec![(RECALIBRATED, &d.map)];
    if has_answer(d) {
        maps.push((ANSWERED, &d.map_after));
    }
    maps.push(("each condition from all others", &d.map_left_out));
    let nothing = if has_answer(d) {
        "Nothing is added in the first map and in the third, which"
    } else {
        "Nothing is added in either map. The second"
    };
    let _ = write!(
        out,
        "<h2>Where: measured minus predicted, in standard deviations</h2><p class=\"note\">{nothing} predicts each condition by a calibration to all others: gaps that a calibration hides. Bold: larger than any cell in 95 % of simulated data without an effect.</p><table><tr><th></th>"
    );
    for (title, _) in &maps {
        let _ = write!(out, "<th class=\"gap\"></th><th colspan=\"5\">{title}</th>");
    }
    *out += "</tr><tr><th>condition</th>";
    for _ in &maps {
        *out += "<th class=\"gap\"></th><th>VV</th><th>IE</th><th>ML</th><th>AP</th><th>SI</th>";
    }
    *out += "</tr>";
    for ((source, test, flexion, sign), by) in &by_condition(&maps) {
        let load = if *sign == 0 { " unloaded" } else { "" };
        let _ = write!(out, "<tr><td>{} {test} {flexion}&deg;{load}</td>", escaped(source));
        for k in 0..maps.len() {
            *out += "<td class=\"gap\"></td>";
            FREE.iter().for_each(|c| cell(out, by.get(&(k, c.name())).copied()));
        }
        *out += "</tr>";
    }
    *out += "</table>";
}

/// Data set, test, flexion [deg], sign of the load.
type Condition = (String, String, i64, i8);

/// The cells of each condition, by the place of their map and their coordinate.
fn by_condition<'a>(maps: &[(&str, &'a Vec<Cell>)]) -> BTreeMap<Condition, BTreeMap<(usize, &'a str), &'a Cell>> {
    let mut rows: BTreeMap<Condition, BTreeMap<(usize, &str), &Cell>> = BTreeMap::new();
    for (k, (_, cells)) in maps.iter().enumerate() {
        for c in *cells {
            let key = (c.source.clone(), c.test.clone(), c.nominal_flexion_deg.round() as i64, c.load_sign);
            rows.entry(key).or_default().insert((k, &c.dof), c);
        }
    }
    rows
}

fn cell(out: &mut String, cell: Option<&Cell>) {
    let Some(c) = cell else {
        *out += "<td></td>";
        return;
    };
    let depth = (c.z.abs() / 6.0).min(1.0) * 0.75;
    let hue = if c.z > 0.0 { "200,60,40" } else { "40,90,190" };
    let weight = if c.significant { "bold" } else { "normal" };
    let z = signed(c.z, 1);
    let _ = write!(out, "<td style=\"background:rgba({hue},{depth:.2});font-weight:{weight}\">{z}</td>");
}

/// The error on trials that no calibration had seen, as bars; and by coordinate.
pub(super) fn bars(out: &mut String, d: &Diagnosis) {
    let g = &d.gap.held_out;
    let shrink = if has_answer(d) { "Shrink: error" } else { "Error" };
    let _ = write!(
        out,
        "<h2>{shrink} on trials that no calibration had seen</h2><p class=\"note\">Mean square over scatter; whole conditions left out in turn.</p><table>"
    );
    let widest = g.before.max(g.after).max(g.floor).max(1e-9);
    // a floor is cut off at the error with the answer, or with nothing added where there is none
    let least = if g.floor >= g.after { AS_LOW } else { FLOOR };
    let mut bars = vec![(RECALIBRATED, g.before), (ANSWERED, g.after), (least, g.floor)];
    let mut by_coordinate = vec![(RECALIBRATED, &g.rmse_before), (ANSWERED, &g.rmse_after)];
    if !has_answer(d) {
        bars.retain(|(name, _)| *name != ANSWERED);
        by_coordinate.truncate(1);
    }
    for (name, value) in bars {
        let _ = write!(
            out,
            "<tr><td>{name}</td><td style=\"text-align:left\"><span class=\"bar\" style=\"width:{:.1}em\"></span> {value:.2}</td></tr>",
            25.0 * value / widest
        );
    }
    *out += "</table><table><tr><th>root mean square</th>";
    for k in g.rmse_before.keys() {
        // "VV [deg]" of vv_deg
        let (coordinate, unit) = k.split_once('_').unwrap_or((k.as_str(), ""));
        let _ = write!(out, "<th>{} [{unit}]</th>", coordinate.to_uppercase());
    }
    for (name, values) in by_coordinate {
        let _ = write!(out, "</tr><tr><td>{name}</td>");
        for v in values.values() {
            let _ = write!(out, "<td>{v:.2}</td>");
        }
    }
    *out += "</tr></table>";
    if has_answer(d) {
        shrinks(out, d);
    }
}

/// By how much the error falls with the answer, and with an effect that should not help; or that it does not fall.
fn shrinks(out: &mut String, d: &Diagnosis) {
    let g = &d.gap.held_out;
    if g.after >= g.before {
        *out += "<p>The error does not fall with the answer: these trials do not speak for it.</p>";
        return;
    }
    let (falls, closed) = (fixed(g.before - g.after, 2), fixed(100.0 * g.closed, 0));
    let _ = write!(out, "<p>The error falls by {falls}: {closed} % of what noise and floor let it fall.");
    if let Some(c) = &d.gap.control {
        let closes = if c.closed < 0.0 {
            "nothing: the error grows with it".to_owned()
        } else {
            format!("{} %", fixed(100.0 * c.closed, 0))
        };
        let _ = write!(out, " As a control, {} closes {closes}.", escaped(&c.effect));
    }
    *out += "</p>";
}

/// What each ligament carries in each test: without the answer and with it. A diagnosis without an answer has none of these.
pub(super) fn forces(out: &mut String, d: &Diagnosis) {
    if d.ligament_forces.is_empty() {
        return;
    }
    let mut tests: Vec<&str> = Vec::new();
    let mut rows: BTreeMap<&str, BTreeMap<&str, &Carried>> = BTreeMap::new();
    for c in &d.ligament_forces {
        if !tests.contains(&c.test.as_str()) {
            tests.push(&c.test);
        }
        rows.entry(&c.ligament).or_default().insert(&c.test, c);
    }
    let _ = write!(
        out,
        "<h2>What the ligaments carry [N]</h2><p class=\"note\">Under {:.0} N of compression, without friction; with the answer at its likeliest size, also where it may be a tear. Effects of the specimen and of the session act here where they are in all data sets; those of an apparatus or of one data set alone do not. Below {:.0} N left out.</p><table><tr><th>ligament</th>",
        ProtocolOptions::default().compression_n,
        LEAST_N
    );
    for test in &tests {
        let _ = write!(out, "<th colspan=\"2\">{}</th>", escaped(test));
    }
    *out += "</tr><tr><th></th>";
    for _ in &tests {
        let _ = write!(out, "<th>recalibrated</th><th>{ANSWERED}</th>");
    }
    *out += "</tr>";
    for (ligament, by) in &rows {
        let _ = write!(out, "<tr><td>{}</td>", escaped(ligament));
        for test in &tests {
            match by.get(test) {
                Some(c) => {
                    let _ = write!(out, "<td>{:.0}</td><td>{:.0}</td>", c.without_n, c.with_n);
                }
                None => *out += "<td></td><td></td>",
            }
        }
        *out += "</tr>";
    }
    *out += "</table>";
}

/// The ligaments' parameters as given and recalibrated, and with the answer.
pub(super) fn ligaments(out: &mut String, d: &Diagnosis) {
    let (title, columns) = if has_answer(d) {
        ("What the ligaments had taken up", format!("<th>{ANSWERED}</th><th>sd {ANSWERED}</th>"))
    } else {
        ("What the recalibration changed of the ligaments", "<th>sd</th>".to_owned())
    };
    let _ =
        write!(out, "<h2>{title}</h2><table><tr><th>parameter</th><th>given</th><th>recalibrated</th>{columns}</tr>");
    for l in &d.ligaments {
        let with = if has_answer(d) { format!("<td>{:.3}</td>", l.with) } else { String::new() };
        let _ = write!(
            out,
            "<tr><td>{} {}</td><td>{:.3}</td><td>{:.3}</td>{with}<td>{:.3}</td></tr>",
            escaped(&l.bundle),
            parameter(&l.parameter),
            l.given,
            l.without,
            l.sd
        );
    }
    *out += "</table>";
}
