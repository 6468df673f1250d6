//! The page of a diagnosis: one self-contained file that opens offline; and the same inside the report of a build.

use super::diagnosis_curves::picture;
use super::diagnosis_unnamed::{contradicting, noise, why_unnamed};
use super::html::{LivePart, escaped, head};
use diagnosis::diagnosis::atlas::{Atlas, table};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::report::carried::LEAST_N;
use diagnosis::report::not_excluded::{least_log_odds, to_one};
use diagnosis::report::words::{listed, next_tells, parameter, parameter_of_effect, sizes, with_unit};
use diagnosis::report::{Carried, Diagnosis, Missable, Named, NotExcluded, Verdict};
use diagnosis::search::map::Cell;
use sim::coordinate::FREE;
use sim::protocols::ProtocolOptions;
use std::collections::BTreeMap;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:var(--ink,#222)}\
h1{font-size:1.4em}h2{font-size:1.1em;margin-top:2em}table{border-collapse:collapse;font-size:.9em}\
td,th{border:1px solid var(--line,#ccc);padding:.2em .5em;text-align:right}th{background:var(--faint,#f4f4f4)}td:first-child,th:first-child{text-align:left}\
.verdict{border-left:6px solid var(--link,#478);padding:.5em 1em;background:var(--note-bg,#f4f6fa)}.bar{height:1.1em;background:#478;display:inline-block}\
.note{color:var(--dim,#666);font-size:.9em}.gap{border:0;background:none;padding:.2em}.words td,.words th{text-align:left;vertical-align:top}";

/// Pictures on a white ground are turned dark with the page that holds them.
const DARK: &str = "@media screen and (prefers-color-scheme:dark){svg{filter:invert(.91) hue-rotate(180deg)}}";

/// The page of a diagnosis of `model`; at its end its reader pulls at the knee, where the surfaces for that are there.
pub(crate) fn page(model: &str, d: &Diagnosis, live: Option<&LivePart>) -> String {
    if let Some(live) = live {
        let head = begun(model);
        let header = format!("<header><h1>{}: diagnosis</h1></header>", escaped(model));
        return format!("{head}{header}<main id=\"stages\">{}{}</main>{}", part(model, d), live.section, live.foot);
    }
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>What is missing: {}</title><style>{STYLE}</style><body>{}</body></html>",
        escaped(model),
        body(model, d)
    )
}

/// How a page of its own begins; it has no stages to skip to.
fn begun(model: &str) -> String {
    head(&format!("What is missing: {model}")).replace("To the stages", "To the diagnosis")
}

/// The same as a part of another page: a tree of its own, so that neither page's style reaches the other; its headings stand below the section's.
pub(crate) fn part(model: &str, d: &Diagnosis) -> String {
    let style = STYLE.replace("h2{", "h4{").replace("h1{", "h3{") + DARK;
    let lower = [("<h2>", "<h4>"), ("</h2>", "</h4>"), ("<h1>", "<h3>"), ("</h1>", "</h3>")];
    let body = lower.iter().fold(body(model, d), |text, (from, to)| text.replace(from, to));
    format!("<div class=\"diagnosis\"><template shadowrootmode=\"open\"><style>{style}</style>{body}</template></div>")
}

fn body(model: &str, d: &Diagnosis) -> String {
    let mut out = format!("<h1>What is missing: {}</h1>", escaped(model));
    let mut lines = d.plain.lines();
    if let Some(first) = lines.next() {
        let _ = write!(out, "<p><strong>{}</strong></p>", escaped(first));
        let more: String = lines.map(|line| format!("<li>{}</li>", escaped(line))).collect();
        out += &if more.is_empty() { more } else { format!("<ul>{more}</ul>") };
    }
    let _ = write!(out, "<div class=\"verdict\">{}</div>", escaped(&d.description));
    contradicting(&mut out, d);
    left_out(&mut out, d);
    answers(&mut out, d);
    not_excluded(&mut out, d);
    meanings(&mut out, d);
    why_unnamed(&mut out, d);
    noise(&mut out, d);
    maps(&mut out, d);
    bars(&mut out, d);
    curves(&mut out, d);
    ligaments(&mut out, d);
    forces(&mut out, d);
    next(&mut out, d);
    missed(&mut out, d);
    out += "<h2>What could not be tested</h2><ul>";
    for n in &d.not_testable {
        let _ = write!(out, "<li>{}: {}</li>", escaped(&n.effect), escaped(&n.why));
    }
    let _ = write!(
        out,
        "</ul>{}<p class=\"note\">An effect was named from a log Bayes factor of {:.1} on (what 95 % of simulated data without an effect stay below, and half as much again or more, since the scatter itself is known no better). Fields of no name (forces or misreadings: constant, by flexion, by motion, by load) beside the answer, or beside nothing where nothing is named: log Bayes factor {:.1}. M and L effects belong to the apparatus and are left out of predictions about the joint; T belongs to the specimen; U to the session.</p>",
        provenance(d),
        d.threshold,
        d.wildcard
    );
    out
}

/// What the page was made from, for whoever wants the same bytes again.
fn provenance(d: &Diagnosis) -> String {
    let Some(p) = &d.provenance else { return String::new() };
    let mut out = format!(
        "<h2>What this was found with</h2><table class=\"words\"><tr><td>program</td><td>{}</td></tr><tr><td>catalogue</td><td>{}</td></tr><tr><td>model</td><td>{}</td></tr>",
        escaped(&p.program),
        escaped(&p.catalogue),
        escaped(&p.model)
    );
    for (name, digest) in &p.data {
        let _ = write!(out, "<tr><td>data: {}</td><td>{}</td></tr>", escaped(name), escaped(digest));
    }
    out + "</table><p class=\"note\">Digests are BLAKE3, of the model with its surfaces and of each data file.</p>"
}

/// The trials of which no hypothesis was asked.
fn left_out(out: &mut String, d: &Diagnosis) {
    let Some(of) = &d.left_out else { return };
    let _ = write!(
        out,
        "<h2>Trials that were left out</h2><p>{} of {}, since the knee lies out of its joint there: {}.</p>",
        of.trials.len(),
        of.of,
        escaped(&of.trials.join(", "))
    );
}

fn answers(out: &mut String, d: &Diagnosis) {
    if d.answers.is_empty() {
        return;
    }
    let catalogue = Catalogue::shipped();
    *out += "<h2>Which: the answers</h2><table><tr><th>effect</th><th>where</th><th>size (90 % interval)</th><th>weight</th><th>log Bayes factor</th><th>held-out gain</th></tr>";
    for a in &d.answers {
        let places: Vec<&str> = a.effects.iter().map(|e| e.scope.as_str()).collect();
        let sizes: Vec<String> = a.effects.iter().flat_map(|e| sizes(&catalogue, e, "")).map(|t| escaped(&t)).collect();
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.1}</td><td>{:.1}</td></tr>",
            escaped(&names_of(&a.effects)),
            escaped(&places.join(" + ")),
            sizes.join("<br>"),
            a.weight,
            a.log_bayes_factor,
            a.held_out_gain
        );
    }
    *out += "</table>";
}

/// What the data do not exclude, whatever the verdict; nothing where that is one state alone, which the head tells.
fn not_excluded(out: &mut String, d: &Diagnosis) {
    if d.not_excluded.len() < 2 {
        return;
    }
    let against = if d.verdict == Verdict::None { "a knee that lacks nothing" } else { "the best that was found" };
    let least = least_log_odds(d);
    let _ = write!(
        out,
        "<h2>What these data do not exclude</h2><p class=\"note\">Each state was fitted by itself, the ligaments recalibrated beside it. Log odds [nats] against {against}, of a tear before any prior of one: 0 is as likely, 1 nearly three times as likely. A state stands here where its log odds are above {least:.1}: the data do not speak against it by {} or more.{}</p>{}",
        to_one(-least),
        finding(&d.not_excluded, against),
        states(&d.not_excluded)
    );
}

/// What it means that a tear is in the list: of those ahead of what the odds are against, and of the others. `against`: that, in words.
fn finding(of: &[NotExcluded], against: &str) -> String {
    let tears = || of.iter().filter(|n| n.torn.is_some());
    let (is_ahead, is_behind) = (tears().any(|n| n.log_odds > 0.0), tears().any(|n| n.log_odds <= 0.0));
    let mut out = String::new();
    if is_ahead {
        let _ = write!(out, " A tear above 0: the data prefer it to {against}, but not beyond the bar.");
    }
    if is_behind {
        let which = if is_ahead { "a tear of 0 or less" } else { "a tear" };
        let _ = write!(out, " That {which} stands here is no finding: these trials do not tell it from {against}.");
    }
    out
}

/// The table of states. Where all are whole tears, or nothing, their place and size are alike and left out.
fn states(of: &[NotExcluded]) -> String {
    let catalogue = Catalogue::shipped();
    let are_alike = of.iter().all(|n| n.torn.is_some() || n.is_nothing());
    let columns = if are_alike { "" } else { "<th>where</th><th>size (90 % interval)</th>" };
    let mut out = format!("<table class=\"words\"><tr><th>state</th>{columns}<th>log odds</th></tr>");
    for n in of {
        let name = match &n.torn {
            Some(structure) => format!("{structure} torn"),
            None if n.is_nothing() => "nothing".to_owned(),
            None => names_of(&n.effects),
        };
        let _ = write!(out, "<tr><td>{}</td>", escaped(&name));
        if !are_alike {
            let places: Vec<&str> = n.effects.iter().map(|e| e.scope.as_str()).collect();
            let sizes: Vec<String> = n.effects.iter().flat_map(|e| sizes_of(&catalogue, n, e)).collect();
            let _ = write!(out, "<td>{}</td><td>{}</td>", escaped(&places.join(" + ")), sizes.join("<br>"));
        }
        let _ = write!(out, "<td>{:+.1}</td></tr>", n.log_odds);
    }
    out + "</table>"
}

/// Sizes of an effect of a state. A whole tear is held where it is, so that its size has no interval.
fn sizes_of(catalogue: &Catalogue, state: &NotExcluded, e: &Named) -> Vec<String> {
    let held =
        || e.parameters.iter().map(|(k, v)| format!("{} {}", parameter_of_effect(k), with_unit(v.value, &v.unit)));
    let told: Vec<String> = if state.torn.is_some() { held().collect() } else { sizes(catalogue, e, "") };
    told.iter().map(|t| escaped(t)).collect()
}

/// Effects by their names and the structures that they are about.
fn names_of(effects: &[Named]) -> String {
    let name = |e: &Named| format!("{}{}", e.effect, e.variant.as_ref().map(|v| format!(" ({v})")).unwrap_or_default());
    effects.iter().map(name).collect::<Vec<_>>().join(" + ")
}

/// What the answers mean in plain words, for the joint, and how to check them at the bench; where nothing is named, what came nearest.
fn meanings(out: &mut String, d: &Diagnosis) {
    let unnamed = d.verdict == Verdict::Unnamed;
    let named: Vec<&Named> = d.answers.iter().flat_map(|a| &a.effects).collect();
    let effects = if unnamed { d.best.iter().collect() } else { named };
    if effects.is_empty() {
        return;
    }
    *out += if unnamed { "<h2>What came nearest</h2>" } else { "<h2>What that means</h2>" };
    *out += "<table class=\"words\"><tr><th>effect</th><th>in plain words</th><th>for the joint</th><th>to check at the bench</th></tr>";
    let catalogue = Catalogue::shipped();
    let mut told: Vec<&str> = Vec::new();
    for e in effects {
        let Ok((found, _)) = catalogue.find(&e.effect) else { continue };
        if told.contains(&found.id.as_str()) {
            continue;
        }
        let cells = [&found.title, &found.words, &found.clinical, &found.bench].map(|t| escaped(t));
        let _ = write!(out, "<tr><td>{}</td></tr>", cells.join("</td><td>"));
        told.push(&found.id);
    }
    *out += "</table>";
}

/// The residual maps side by side: a row a condition.
fn maps(out: &mut String, d: &Diagnosis) {
    let maps = [
        ("ligaments recalibrated", &d.map),
        ("with the answer", &d.map_after),
        ("each condition from all others", &d.map_left_out),
    ];
    let mut rows: BTreeMap<Condition, BTreeMap<(usize, &str), &Cell>> = BTreeMap::new();
    for (k, (_, cells)) in maps.iter().enumerate() {
        for c in *cells {
            let key = (c.source.clone(), c.test.clone(), c.nominal_flexion_deg.round() as i64, c.load_sign);
            rows.entry(key).or_default().insert((k, &c.dof), c);
        }
    }
    *out += "<h2>Where: measured minus predicted, in standard deviations</h2><p class=\"note\">Nothing is added in the first map and in the third, which predicts each condition by a calibration to all others: gaps that a calibration hides. Bold: larger than any cell in 95 % of simulated data without an effect.</p><table><tr><th></th>";
    for (title, _) in maps {
        let _ = write!(out, "<th class=\"gap\"></th><th colspan=\"5\">{title}</th>");
    }
    *out += "</tr><tr><th>condition</th>";
    for _ in maps {
        *out += "<th class=\"gap\"></th><th>VV</th><th>IE</th><th>ML</th><th>AP</th><th>SI</th>";
    }
    *out += "</tr>";
    for ((source, test, flexion, sign), by) in &rows {
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

fn cell(out: &mut String, cell: Option<&Cell>) {
    let Some(c) = cell else {
        *out += "<td></td>";
        return;
    };
    let depth = (c.z.abs() / 6.0).min(1.0) * 0.75;
    let hue = if c.z > 0.0 { "200,60,40" } else { "40,90,190" };
    let weight = if c.significant { "bold" } else { "normal" };
    let _ = write!(out, "<td style=\"background:rgba({hue},{depth:.2});font-weight:{weight}\">{:+.1}</td>", c.z);
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
        // "VV [deg]" of vv_deg
        let (coordinate, unit) = k.split_once('_').unwrap_or((k.as_str(), ""));
        let _ = write!(out, "<th>{} [{unit}]</th>", coordinate.to_uppercase());
    }
    for (name, values) in [("before", &g.rmse_before), ("after", &g.rmse_after)] {
        let _ = write!(out, "</tr><tr><td>{name}</td>");
        for v in values.values() {
            let _ = write!(out, "<td>{v:.2}</td>");
        }
    }
    let _ = write!(
        out,
        "</tr></table><p>The error falls by {:.2}: {:.0} % of what noise and floor let it fall.",
        g.before - g.after,
        100.0 * g.closed
    );
    if let Some(c) = &d.gap.control {
        let _ = write!(out, " As a control, {} closes {:.0} %.", escaped(&c.effect), 100.0 * c.closed);
    }
    *out += "</p>";
}

/// The worst places as curves.
fn curves(out: &mut String, d: &Diagnosis) {
    let picture = picture(&d.curves);
    if !picture.is_empty() {
        *out += "<h2>Load and displacement where the model disagrees most</h2><p class=\"note\">Bars: one standard deviation of the measurement. Signs: valgus, external, lateral, anterior, superior of the tibia.</p>";
        *out += &picture;
    }
}

/// What each ligament carries in each test: before and after.
fn forces(out: &mut String, d: &Diagnosis) {
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
        "<h2>What the ligaments carry [N]: recalibrated, with the answer</h2><p class=\"note\">Under {:.0} N of compression, without friction. Effects of the specimen and of the session act here where they are in all data sets; those of an apparatus or of one data set alone do not. Below {:.0} N left out.</p><table><tr><th>ligament</th>",
        ProtocolOptions::default().compression_n,
        LEAST_N
    );
    for test in &tests {
        let _ = write!(out, "<th colspan=\"2\">{}</th>", escaped(test));
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

fn ligaments(out: &mut String, d: &Diagnosis) {
    *out += "<h2>What the ligaments had taken up</h2><table><tr><th>parameter</th><th>given</th><th>recalibrated</th><th>with the answer</th><th>sd</th></tr>";
    for l in &d.ligaments {
        let _ = write!(
            out,
            "<tr><td>{} {}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3}</td></tr>",
            escaped(&l.bundle),
            parameter(&l.parameter),
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
    let _ = write!(out, "<h2>Next: tests that would tell {}</h2>", escaped(&next_tells(d)));
    *out += "<p class=\"note\">Expected gain: log odds that such a test adds [nats]. Less than 1 tells little.</p><table><tr><th>test</th><th>flexion</th><th>load</th><th>apparatus</th><th>expected gain</th></tr>";
    for t in &d.next_tests {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{:.2}</td></tr>",
            t.test,
            t.flexion_deg,
            t.load,
            escaped(&t.source),
            t.expected_gain
        );
    }
    *out += "</table>";
}

/// Where nothing is named: the sizes that would have been missed, a row an effect, a column a scope.
fn missed(out: &mut String, d: &Diagnosis) {
    if d.missable.is_empty() {
        return;
    }
    let mut scopes: Vec<&str> = Vec::new();
    let mut rows: Vec<(&Missable, BTreeMap<&str, Vec<String>>)> = Vec::new();
    for m in &d.missable {
        if !scopes.contains(&m.scope.as_str()) {
            scopes.push(&m.scope);
        }
        if !rows.last().is_some_and(|(r, _)| r.effect == m.effect && r.variant == m.variant) {
            rows.push((m, BTreeMap::new()));
        }
        let size = format!("{} {}", parameter_of_effect(&m.parameter), with_unit(m.size, &m.unit));
        rows.last_mut().expect("pushed above").1.entry(&m.scope).or_default().push(size);
    }
    *out += "<h2>What would have been missed</h2><p class=\"note\">Half of such data would have revealed an effect of this size, were it alone; ligaments and contact recalibrated, linear.</p><table class=\"words\"><tr><th>effect</th>";
    for s in &scopes {
        let _ = write!(out, "<th>{}</th>", escaped(s));
    }
    *out += "</tr>";
    for (m, by) in &rows {
        let told = |v: &&String| !m.effect.ends_with(v.as_str());
        let about = m.variant.as_ref().filter(told).map(|v| format!(" ({v})")).unwrap_or_default();
        let _ = write!(out, "<tr><td>{}</td>", escaped(&format!("{}{about}", m.effect)));
        for s in &scopes {
            let cell = by.get(s).map_or(String::new(), |sizes| sizes.join("<br>"));
            let _ = write!(out, "<td>{}</td>", cell);
        }
        *out += "</tr>";
    }
    *out += "</table>";
    let missed: Vec<&str> =
        d.may_be_torn.iter().filter(|t| t.would_be_missed(d.threshold)).map(|t| t.structure.as_str()).collect();
    if !missed.is_empty() {
        let _ = write!(
            out,
            "<p>A loss without a size here may be missed even where it is whole. These trials would not name a whole tear of the {}: fitted without noise, it earns less than a name takes.</p>",
            escaped(&listed(&missed, "or"))
        );
    }
}

/// The page of an atlas.
pub(crate) fn atlas(model: &str, found: &Atlas) -> String {
    let (model, text) = (escaped(model), escaped(&table(found)));
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>What could be named: {model}</title><body><h1>What could be named: {model}</h1><p>Sizes are one prior standard deviation of each effect; raw and retained are root mean square signatures in scatters, before and after ligaments and contact are recalibrated; detectable is the size, in prior standard deviations, that half of such data would reveal.</p><pre>{text}</pre></body></html>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnosis::report::Value;

    fn lost(structure: &str, sd: f64) -> Named {
        let parameters = [("loss".to_owned(), Value { value: 1.0, sd, unit: "-".into() })].into();
        Named { effect: "structure_loss".into(), scope: "both".into(), variant: Some(structure.into()), parameters }
    }

    fn torn(structure: &str, log_odds: f64) -> NotExcluded {
        NotExcluded { effects: vec![lost(structure, 0.0)], torn: Some(structure.into()), log_odds }
    }

    #[test]
    fn a_tear_that_the_data_prefer_is_never_called_one_that_they_do_not_feel() {
        let told = |of: &[NotExcluded]| finding(of, "a knee that lacks nothing");
        let (ahead, behind) = (torn("PCL", 4.3), torn("PFL", -3.4));
        let above = told(std::slice::from_ref(&ahead));
        assert!(above.contains("prefer it to a knee that lacks nothing") && !above.contains("no finding"), "{above}");
        let below = told(std::slice::from_ref(&behind));
        assert!(below.contains("That a tear stands here is no finding") && !below.contains("prefer"), "{below}");
        let both = told(&[ahead, behind]);
        assert!(both.contains("prefer it") && both.contains("That a tear of 0 or less stands here"), "{both}");
        assert_eq!(told(&[]), "");
    }

    #[test]
    fn place_and_size_stand_in_every_row_of_a_state_or_in_none() {
        let nothing = NotExcluded { effects: vec![], torn: None, log_odds: 0.0 };
        let tears = states(&[torn("PCL", 4.3), nothing.clone()]);
        assert!(!tears.contains("<th>where</th>") && tears.contains("<td>PCL torn</td><td>+4.3</td>"), "{tears}");
        assert!(tears.contains("<td>nothing</td><td>+0.0</td>"), "{tears}");
        let part = NotExcluded { effects: vec![lost("ACL", 0.2)], torn: None, log_odds: 0.0 };
        let mixed = states(&[part, torn("PCL", -0.3), nothing]);
        assert!(mixed.contains("<td>PCL torn</td><td>both</td><td>loss 1.00</td><td>-0.3</td>"), "{mixed}");
        assert!(mixed.contains("<td>structure_loss (ACL)</td><td>both</td><td>loss 1.00 ("), "{mixed}");
        assert!(mixed.contains("<td>nothing</td><td></td><td></td>"), "{mixed}");
    }

    #[test]
    fn a_page_of_a_diagnosis_skips_to_the_diagnosis() {
        for model in ["knee1", "the knee"] {
            let told = begun(model);
            assert!(told.contains(">To the diagnosis</a>") && !told.contains("To the stages"), "{told}");
            assert!(told.contains(&format!("What is missing: {model}")), "{told}");
        }
    }
}
