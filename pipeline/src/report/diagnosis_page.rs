//! The page of a diagnosis: one self-contained file that opens offline; and the same inside the report of a build.

mod compared;

use super::diagnosis_curves::picture;
use super::diagnosis_unnamed::{contradicting, noise, why_unnamed};
use super::html::{LivePart, escaped, head};
use compared::{bars, forces, ligaments, maps};
use diagnosis::diagnosis::atlas::{Atlas, table};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::report::not_excluded::{least_log_odds, to_one};
use diagnosis::report::words::{fixed, listed, next_tells, parameter_of_effect, signed, sizes, with_unit};
use diagnosis::report::{DetectionLimit, Diagnosis, Named, NotExcluded, Verdict};
use std::collections::BTreeMap;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:var(--ink,#222)}\
h1{font-size:1.4em}h2{font-size:1.1em;margin-top:2em}table{border-collapse:collapse;font-size:.9em}\
td,th{border:1px solid var(--line,#ccc);padding:.2em .5em;text-align:right}th{background:var(--faint,#f4f4f4)}td:first-child,th:first-child{text-align:left}\
.verdict{border-left:6px solid var(--link,#478);padding:.5em 1em;background:var(--note-bg,#f4f6fa)}.bar{height:1.1em;background:#478;display:inline-block}\
.note{color:var(--dim,#666);font-size:.9em}.gap{border:0;background:none;padding:.2em}.words td,.words th{text-align:left;vertical-align:top}";

/// The scope of what acts in all data sets, as a diagnosis has it and in words.
const BOTH: &str = "both";
const ALL: &str = "all data sets";

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
    // what it means and what to do; rows that contradict each other are that where nothing is named, and else stand behind
    let is_unnamed = d.verdict == Verdict::Unnamed;
    if is_unnamed {
        contradicting(&mut out, d);
    }
    answers(&mut out, d);
    meanings(&mut out, d);
    not_excluded(&mut out, d);
    next(&mut out, d);
    if !is_unnamed {
        contradicting(&mut out, d);
    }
    // then the numbers
    left_out(&mut out, d);
    why_unnamed(&mut out, d);
    noise(&mut out, d);
    maps(&mut out, d);
    bars(&mut out, d);
    curves(&mut out, d);
    ligaments(&mut out, d);
    forces(&mut out, d);
    missed(&mut out, d);
    out += "<h2>What could not be tested</h2><ul>";
    let catalogue = Catalogue::shipped();
    for n in &d.not_testable {
        let _ = write!(out, "<li>{}: {}</li>", escaped(&titled(&catalogue, &n.effect)), escaped(&n.why));
    }
    let _ = write!(out, "</ul>{}{}", provenance(d), bars_of_names(d));
    out
}

/// What a name takes, what a field of no name earns, and what becomes of an effect that is named.
fn bars_of_names(d: &Diagnosis) -> String {
    let beside = match d.verdict {
        Verdict::None => "with nothing added",
        Verdict::Unnamed => "beside what comes nearest, or with nothing added where that earns too little",
        _ => "beside the answer",
    };
    format!(
        "<p class=\"note\">A name takes a log Bayes factor of {:.2} here. 95 % of simulated data without an effect stay below two thirds of that or less: the scatter itself is known no better. A field of no name is a force or a misreading that is constant, or goes with flexion, motion or load. It earns a log Bayes factor of {} {beside}. Effects of the apparatus are left out of predictions about the joint. Those of tissues stay with the specimen, those of muscles with the session.</p>",
        d.threshold,
        fixed(d.wildcard, 1)
    )
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
        "<h2>Trials that were left out</h2><p>{} of {}: as read, the knee lies out of its joint there, or a frame or an origin is off. They are: {}.</p>",
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
    *out += "<h2>Which: the answers</h2><table><tr><th>effect</th><th>where</th><th>size (90 % interval)</th><th>weight among the answers</th><th>log Bayes factor</th><th>gain on unseen trials [nats]</th></tr>";
    for a in &d.answers {
        let places: Vec<&str> = a.effects.iter().map(place).collect();
        let sizes: Vec<String> = a.effects.iter().flat_map(|e| sizes(&catalogue, e, "")).map(|t| escaped(&t)).collect();
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{}</td><td>{}</td></tr>",
            escaped(&names_of(&a.effects)),
            escaped(&places.join(" + ")),
            sizes.join("<br>"),
            a.weight,
            fixed(a.log_bayes_factor, 1),
            fixed(a.held_out_gain, 1)
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
    let asked = match d.verdict {
        Verdict::None => " That knee and whole tears were asked, and no other effect.",
        _ => "",
    };
    let _ = write!(
        out,
        "<h2>What these data do not exclude</h2><p class=\"note\">Each state was fitted by itself, the ligaments recalibrated beside it. Log odds [nats] against {against}, of a tear before any prior of one: 0 is as likely, 1 nearly three times as likely. A state stands here where its log odds are above {least:.1}: the data do not speak against it by {} or more.{asked}{}</p>{}",
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
        let _ = write!(out, " A tear above 0: the data prefer it to {against}, but by too little to name it.");
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
            None if n.is_nothing() => "nothing is missing".to_owned(),
            None => names_of(&n.effects),
        };
        let _ = write!(out, "<tr><td>{}</td>", escaped(&name));
        if !are_alike {
            let places: Vec<&str> = n.effects.iter().map(place).collect();
            let sizes: Vec<String> = n.effects.iter().flat_map(|e| sizes_of(&catalogue, n, e)).collect();
            let _ = write!(out, "<td>{}</td><td>{}</td>", escaped(&places.join(" + ")), sizes.join("<br>"));
        }
        let _ = write!(out, "<td>{}</td></tr>", signed(n.log_odds, 1));
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

/// Where an effect acts.
fn place(e: &Named) -> &str {
    if e.scope == BOTH { ALL } else { &e.scope }
}

/// A name of the catalogue after what it means: "a weakened or torn structure (structure_loss)".
fn titled(catalogue: &Catalogue, name: &str) -> String {
    catalogue.find(name).map_or_else(|_| name.to_owned(), |(found, _)| format!("{} ({name})", found.title))
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
        let name = titled(&catalogue, &e.effect);
        let cells = [&name, &found.words, &found.clinical, &found.bench].map(|t| escaped(t));
        let _ = write!(out, "<tr><td>{}</td></tr>", cells.join("</td><td>"));
        told.push(&found.id);
    }
    *out += "</table>";
}

/// The worst places as curves.
fn curves(out: &mut String, d: &Diagnosis) {
    let picture = picture(&d.curves);
    if !picture.is_empty() {
        *out += "<h2>Load and displacement where the model disagrees most</h2><p class=\"note\">Bars: one standard deviation of the measurement. Signs: valgus, external, lateral, anterior, superior of the tibia.</p>";
        *out += &picture;
    }
}

fn next(out: &mut String, d: &Diagnosis) {
    if d.next_tests.is_empty() {
        return;
    }
    let _ = write!(out, "<h2>Next: tests that would tell {}</h2>", escaped(&next_tells(d)));
    *out += "<p class=\"note\">Expected gain: log odds that such a test adds [nats]. Less than 1 tells little.</p><table><tr><th>test</th><th>flexion [deg]</th><th>load [N m; of drawers N]</th><th>apparatus</th><th>expected gain</th></tr>";
    for t in &d.next_tests {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            t.test,
            t.flexion_deg,
            fixed(t.load, 1),
            escaped(&t.source),
            fixed(t.expected_gain, 2)
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
    let mut rows: Vec<(&DetectionLimit, BTreeMap<&str, Vec<String>>)> = Vec::new();
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
        let _ = write!(out, "<th>{}</th>", escaped(if *s == BOTH { ALL } else { s }));
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
            "<p>A loss without a size here may be missed even where it is whole, by this linear reckoning. Whole tears of the ligaments that injuries take most were fitted without noise, too. That of the {} earns less than a name takes: these trials would not name it.</p>",
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
    use serde_json::json;

    fn lost(structure: &str, sd: f64) -> Named {
        let parameters = [("loss".to_owned(), Value { value: 1.0, sd, unit: "-".into() })].into();
        Named { effect: "structure_loss".into(), scope: "both".into(), variant: Some(structure.into()), parameters }
    }

    fn torn(structure: &str, log_odds: f64) -> NotExcluded {
        NotExcluded { effects: vec![lost(structure, 0.0)], torn: Some(structure.into()), log_odds }
    }

    /// A diagnosis whose numbers all round to nothing from below; what it has with the answer differs from what it has without in name alone.
    fn with_verdict(verdict: &str) -> Diagnosis {
        let tiny = -0.0004;
        let is_named = !["none", "unnamed"].contains(&verdict);
        let answer = json!({"effects": [], "weight": 1.0, "log_bayes_factor": tiny, "held_out_gain": tiny});
        let cell = json!([{
            "source": "kla", "test": "anterior", "nominal_flexion_deg": 30.0, "load_sign": 1, "dof": "ap", "z": tiny, "mean": tiny,
            "significant": true
        }]);
        let rmse = json!({"ap_mm": 0.4});
        let gap = json!({
            "before": 1.004, "after": 1.0, "floor": 1.0, "closed": tiny, "rmse_before": rmse, "rmse_after": rmse
        });
        let carried = json!({"ligament": "ACL", "test": "drawer", "without_n": 9.0, "with_n": 9.0});
        let list = |of: serde_json::Value| if is_named { vec![of] } else { vec![] };
        let told = json!({
            "schema": "diagnosis/1", "verdict": verdict, "answers": list(answer), "plain": "What it means.", "description": "Words.", "added": [],
            "gap": {"held_out": gap, "control": {"effect": "gravity", "closed": tiny}}, "map": cell, "map_after": cell, "map_left_out": cell,
            "not_testable": [],
            "next_tests": [{
                "test": "neutral", "flexion_deg": 30.0, "load": tiny, "source": "kla", "expected_gain": tiny
            }],
            "ligaments": [{
                "bundle": "ACL_AM", "parameter": "reference_strain", "given": 1.0, "without": 1.0, "with": 1.0, "sd": 0.01
            }],
            "ligament_forces": list(carried), "threshold": 4.95, "wildcard": tiny, "misfit": [1.0, 1.0], "best": [],
            "not_excluded": [{"effects": [], "torn": "PCL", "log_odds": tiny}, {"effects": [], "log_odds": 0.0}]
        });
        serde_json::from_value(told).unwrap()
    }

    #[test]
    fn a_page_shows_what_an_answer_changes_only_where_there_is_an_answer() {
        for (verdict, is_named) in
            [("none", false), ("unnamed", false), ("one_of", true), ("probable", true), ("decisive", true)]
        {
            let page = body("knee", &with_verdict(verdict));
            for words in ["ith the answer", "Shrink", "The error falls", "As a control", "had taken up", "the third"] {
                assert_eq!(page.contains(words), is_named, "{verdict}: {words} in {page}");
            }
            // a map has five coordinates, and each row as many cells as there are maps
            let maps = if is_named { 3 } else { 2 };
            assert_eq!(page.matches("colspan=\"5\"").count(), maps, "{page}");
            assert_eq!(page.matches("<th>AP</th>").count(), maps, "{page}");
            assert_eq!(page.matches("font-weight:bold").count(), maps, "{page}");
            // of the ligaments' parameters, and of their forces in the one test: no column is without its name
            let columns = if is_named { [2, 2] } else { [1, 0] };
            let headed = ["<th>recalibrated</th>", "<th>with the answer</th>"].map(|th| page.matches(th).count());
            assert_eq!(headed, columns, "{verdict}: {page}");
        }
    }

    #[test]
    fn a_floor_that_is_cut_off_says_so_and_a_control_never_closes_less_than_nothing() {
        let mut d = with_verdict("decisive");
        assert!(body("knee", &d).contains("<td>noise and floor: so much or more</td>"));
        (d.gap.held_out.floor, d.gap.held_out.before) = (0.9, 2.0);
        for (closed, told) in [(-0.15, "closes nothing: the error grows with it."), (0.12, "closes 12 %.")] {
            if let Some(control) = &mut d.gap.control {
                control.closed = closed;
            }
            let page = body("knee", &d);
            assert!(page.contains("<td>noise and floor</td>") && page.contains(told), "{page}");
        }
        // where the error does not fall, what a control closes of it is no number
        d.gap.held_out.after = 2.5;
        let page = body("knee", &d);
        assert!(page.contains("does not fall with the answer") && !page.contains("As a control"), "{page}");
    }

    #[test]
    fn nothing_on_a_page_reads_minus_nought() {
        for verdict in ["none", "unnamed", "decisive"] {
            let page = body("knee", &with_verdict(verdict));
            assert!(page.contains(">0.0<") && page.contains(">0.00<"), "{page}");
            assert!(["-0.0", "-0<", "-0 ", "+0.0<"].iter().all(|odd| !page.contains(odd)), "{page}");
        }
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
    fn a_list_in_which_only_tears_were_asked_says_so() {
        for (verdict, is_none) in [("none", true), ("unnamed", false), ("decisive", false)] {
            let page = body("knee", &with_verdict(verdict));
            assert_eq!(page.contains("whole tears were asked, and no other effect"), is_none, "{verdict}: {page}");
        }
    }

    #[test]
    fn place_and_size_stand_in_every_row_of_a_state_or_in_none() {
        let nothing = NotExcluded { effects: vec![], torn: None, log_odds: 0.0 };
        let tears = states(&[torn("PCL", 4.3), nothing.clone()]);
        assert!(!tears.contains("<th>where</th>") && tears.contains("<td>PCL torn</td><td>+4.3</td>"), "{tears}");
        assert!(tears.contains("<td>nothing is missing</td><td>0.0</td>"), "{tears}");
        let part = NotExcluded { effects: vec![lost("ACL", 0.2)], torn: None, log_odds: 0.0 };
        let mixed = states(&[part, torn("PCL", -0.3), nothing]);
        assert!(mixed.contains("<td>PCL torn</td><td>all data sets</td><td>loss 1.00</td><td>-0.3</td>"), "{mixed}");
        assert!(mixed.contains("<td>structure_loss (ACL)</td><td>all data sets</td><td>loss 1.00 ("), "{mixed}");
        assert!(mixed.contains("<td>nothing is missing</td><td></td><td></td>"), "{mixed}");
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
