//! The page: one self-contained file that opens offline.

use crate::diagnosis::{Diagnosis, Verdict};
use crate::map::Cell;
use std::collections::BTreeMap;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222}\
h1{font-size:1.4em}h2{font-size:1.1em;margin-top:2em}table{border-collapse:collapse;font-size:.9em}\
td,th{border:1px solid #ccc;padding:.2em .5em;text-align:right}th{background:#f4f4f4}td:first-child,th:first-child{text-align:left}\
.verdict{border-left:6px solid #2a6;padding:.5em 1em;background:#f6faf8}.bar{height:1.1em;background:#478;display:inline-block}\
.note{color:#666;font-size:.9em}";

/// The page of a diagnosis of `model`.
pub fn page(model: &str, d: &Diagnosis) -> String {
    let mut out = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>What is missing: {0}</title><style>{STYLE}</style><body><h1>What is missing: {0}</h1>",
        escape(model)
    );
    let title = match d.verdict {
        Verdict::Decisive => "Decisive",
        Verdict::Probable => "Probable",
        Verdict::OneOf => "One of several",
        Verdict::Unnamed => "Something without a name in the catalogue",
        Verdict::None => "Nothing beyond noise",
    };
    let _ = write!(out, "<div class=\"verdict\"><b>{title}.</b> {}</div>", escape(&d.description));
    answers(&mut out, d);
    out += "<h2>Where: measured minus predicted, in standard deviations</h2><p class=\"note\">Left: ligaments recalibrated, nothing added. Middle: with the answer added. Right: each condition predicted from all others, nothing added. Bold: larger than any cell in 95 % of simulated data without an effect.</p><div style=\"display:flex;gap:2em;flex-wrap:wrap\">";
    grid(&mut out, "before", &d.map);
    grid(&mut out, "after", &d.map_after);
    grid(&mut out, "each condition predicted by the others, before", &d.map_left_out);
    out += "</div>";
    bars(&mut out, d);
    ligaments(&mut out, d);
    next(&mut out, d);
    out += "<h2>What could not be tested</h2><ul>";
    for n in &d.not_testable {
        let _ = write!(out, "<li>{}: {}</li>", escape(&n.effect), escape(&n.why));
    }
    let _ = write!(
        out,
        "</ul><p class=\"note\">An effect was named from a log Bayes factor of {:.1} on (what 95 % of simulated data without an effect stay below, and half as much again or more, since the scatter itself is known no better). A smooth field of no name beside the answer: log Bayes factor {:.1}. M and L effects belong to the apparatus and are left out of predictions about the joint; T belongs to the specimen; U to the session.</p></body></html>",
        d.threshold, d.wildcard
    );
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn answers(out: &mut String, d: &Diagnosis) {
    if d.answers.is_empty() {
        return;
    }
    *out += "<h2>Which: the answers</h2><table><tr><th>effect</th><th>where</th><th>size</th><th>weight</th><th>log Bayes factor</th><th>held-out gain</th></tr>";
    for a in &d.answers {
        let names: Vec<String> = a
            .effects
            .iter()
            .map(|e| format!("{}{}", e.effect, e.variant.as_ref().map(|v| format!(" ({v})")).unwrap_or_default()))
            .collect();
        let places: Vec<&str> = a.effects.iter().map(|e| e.scope.as_str()).collect();
        let sizes: Vec<String> = a
            .effects
            .iter()
            .flat_map(|e| &e.parameters)
            .map(|(k, v)| format!("{k} {:.3} &plusmn; {:.3} {}", v.value, v.sd, escape(&v.unit)))
            .collect();
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.1}</td><td>{:.1}</td></tr>",
            escape(&names.join(" + ")),
            escape(&places.join(" + ")),
            sizes.join("<br>"),
            a.weight,
            a.log_bayes_factor,
            a.held_out_gain
        );
    }
    *out += "</table>";
}

fn grid(out: &mut String, title: &str, cells: &[Cell]) {
    let mut rows: BTreeMap<(String, String, i64, i8), BTreeMap<String, &Cell>> = BTreeMap::new();
    for c in cells {
        let key = (c.source.clone(), c.test.clone(), c.nominal_flexion_deg.round() as i64, c.load_sign);
        rows.entry(key).or_default().insert(c.dof.clone(), c);
    }
    let _ = write!(out, "<table><tr><th>{title}</th><th>VV</th><th>IE</th><th>ML</th><th>AP</th><th>SI</th></tr>");
    for ((source, test, flexion, sign), by) in &rows {
        let load = match sign {
            0 => " unloaded",
            _ => "",
        };
        let _ = write!(out, "<tr><td>{} {test} {flexion}&deg;{load}</td>", escape(source));
        for dof in ["vv", "ie", "ml", "ap", "si"] {
            match by.get(dof) {
                Some(c) => {
                    let depth = (c.z.abs() / 6.0).min(1.0) * 0.75;
                    let hue = if c.z > 0.0 { "200,60,40" } else { "40,90,190" };
                    let weight = if c.significant { "bold" } else { "normal" };
                    let _ = write!(
                        out,
                        "<td style=\"background:rgba({hue},{depth:.2});font-weight:{weight}\">{:+.1}</td>",
                        c.z
                    );
                }
                None => *out += "<td></td>",
            }
        }
        *out += "</tr>";
    }
    *out += "</table>";
}

fn bars(out: &mut String, d: &Diagnosis) {
    let g = &d.gap.held_out;
    *out += "<h2>Shrink: error on trials that no calibration had seen</h2><p class=\"note\">Mean square over scatter; whole conditions left out in turn.</p><table>";
    let widest = g.before.max(g.after).max(1e-9);
    for (name, value) in
        [("ligaments recalibrated", g.before), ("with the answer", g.after), ("noise and floor", g.floor)]
    {
        let _ = write!(
            out,
            "<tr><td>{name}</td><td style=\"text-align:left\"><span class=\"bar\" style=\"width:{:.1}em\"></span> {value:.2}</td></tr>",
            25.0 * value / widest
        );
    }
    *out += "</table><table><tr><th>root mean square</th>";
    for k in g.rmse_before.keys() {
        let _ = write!(out, "<th>{k}</th>");
    }
    for (name, values) in [("before", &g.rmse_before), ("after", &g.rmse_after)] {
        let _ = write!(out, "</tr><tr><td>{name}</td>");
        for v in values.values() {
            let _ = write!(out, "<td>{v:.2}</td>");
        }
    }
    let _ = write!(out, "</tr></table><p>{:.0} % of the gap is closed.", 100.0 * g.closed);
    if let Some(c) = &d.gap.control {
        let _ = write!(out, " As a control, {} closes {:.0} %.", escape(&c.effect), 100.0 * c.closed);
    }
    *out += "</p>";
}

fn ligaments(out: &mut String, d: &Diagnosis) {
    *out += "<h2>What the ligaments had taken up</h2><table><tr><th>parameter</th><th>given</th><th>recalibrated</th><th>with the answer</th><th>sd</th></tr>";
    for l in &d.ligaments {
        let _ = write!(
            out,
            "<tr><td>{} {}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3}</td></tr>",
            escape(&l.bundle),
            l.parameter.replace('_', " "),
            l.given,
            l.without,
            l.with,
            l.sd
        );
    }
    *out += "</table>";
}

fn next(out: &mut String, d: &Diagnosis) {
    if d.next_tests.is_empty() {
        return;
    }
    *out += "<h2>Next: tests that would tell the answers apart</h2><table><tr><th>test</th><th>flexion</th><th>load</th><th>apparatus</th><th>expected gain</th></tr>";
    for t in &d.next_tests {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{:.2}</td></tr>",
            t.test,
            t.flexion_deg,
            t.load,
            escape(&t.source),
            t.expected_gain
        );
    }
    *out += "</table>";
}
