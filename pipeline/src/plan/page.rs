//! plan.html: one page to print. Plain words, tables, figures; nothing is loaded from elsewhere.

use super::chances::in_order;
use super::heat;
use super::html::{STYLE, table, words};
use super::knee::STATES;
use super::map::Map;
use super::numbers::Value;
use super::outcome::{Outcome, TestTold};
use super::planned::planned;
use super::table::{chance, shown, unit, value};
use crate::report::html::{LivePart, SKIP_TO_KNEE};
use crate::report::{escaped, head};
use std::fmt::Write;
use validation::plot::{Series, colour, draw, panel};

/// Size of a figure [pixels].
const SIZE: (u32, u32) = (640, 320);

/// A figure is as wide as its column, on the screen and on paper.
pub(super) const FIGURES: &str = "<style>.paper svg{max-width:100%;height:auto}</style>";

/// What the page has of the knee that its reader pulls at.
pub(super) struct Live {
    /// The part; or why there is none.
    pub(super) part: Result<LivePart, String>,
    /// Whether samples were asked for.
    pub(super) samples_asked: bool,
}

/// The page, with the maps that were asked for; at its end its reader pulls at the knee, or reads why not.
pub(super) fn page(out: &Outcome, label: &str, (maps, live): (&[Map], &Live)) -> String {
    let title = if out.plan.is_empty() { "Plan" } else { &out.plan };
    let mut text = head(&format!("{title}: plan")).replace("To the stages", "To the plan");
    if live.part.is_ok() {
        text += SKIP_TO_KNEE;
    }
    text += FIGURES;
    text += STYLE;
    let _ = write!(text, "<header><h1>{}</h1><p>{}</p></header><main id=\"stages\">", escaped(title), escaped(label));
    text += &summary(out);
    text += &planned(out);
    text += &grafts(out);
    text += "<h2>How far the knee gives</h2><p>From rest, in mm or deg: each knee from its own pose under the compression alone, at the same flexion. So an \
             arthrometer counts, and what two knees differ by is the side-to-side difference. Behind each number stands its 90 % interval where the \
             model has samples.</p>";
    text += &laxities(out);
    text += &bears(out);
    text += &figures(out);
    text += "<h2>Against the intact knee, under the same load</h2><p>Reconstructed less intact: forward, external and valgus count as more.</p>";
    text += &differences(out);
    text += &heat::section(maps);
    text += &limits();
    if !out.warnings.is_empty() {
        let all: String = out.warnings.iter().map(|w| format!("<li>{}</li>", escaped(w))).collect();
        let _ = write!(text, "<h2>What is odd</h2><ul>{all}</ul>");
    }
    text += &pulled(live);
    text += "</main>";
    text + live.part.as_ref().map_or("</body></html>\n", |l| &l.foot)
}

/// The section in which the reader pulls at the knee.
fn pulled(live: &Live) -> String {
    match &live.part {
        Ok(part) if live.samples_asked => part.section.clone(),
        // by this the section says why it has no intervals (live.js)
        Ok(part) => format!("<div data-unasked=\"samples\">{}</div>", part.section),
        Err(why) => format!(
            "<h2>Pull at the knee</h2><p>This page has no knee that can be pulled at: {}. The tables above hold all that the plan gave.</p>",
            escaped(why)
        ),
    }
}

/// What a reader wants first.
fn summary(out: &Outcome) -> String {
    let mut text = String::from("<h2>In short</h2><p>");
    let cut = if out.cut.is_empty() { "Nothing is cut.".into() } else { format!("Cut: {}.", out.cut.join(", ")) };
    let _ = write!(text, "{} ", escaped(&cut));
    match out.samples {
        0 => text += "The most probable knee alone was asked: no intervals and no chances.",
        n => {
            let done = if out.grafts.is_empty() { "had this cut, and no graft" } else { "were operated on" };
            let _ = write!(text, "{n} knees that fit the measurements {done}.");
        }
    }
    text += "</p><ul>";
    for c in in_order(&out.chances) {
        let _ = write!(text, "<li>{}: {}</li>", escaped(&c.of), chance(c));
    }
    text + "</ul>"
}

fn grafts(out: &Outcome) -> String {
    if out.grafts.is_empty() {
        return "<h2>Grafts</h2><p>None.</p>".into();
    }
    let percent = |p: Option<[f64; 2]>| p.map_or("none".into(), |[a, b]| format!("{a:.1} and {b:.1}"));
    let rows = out.grafts.iter().map(|g| {
        vec![
            g.name.clone(),
            percent(g.quadrant_percent),
            percent(g.plateau_percent),
            format!("{:.1}", g.length_mm),
            format!("{:.1}", g.slack_length_mm),
            format!("{:.0}", g.stiffness_n_per_mm),
        ]
    });
    let header = words(&[
        "graft",
        "femur: depth from the back and height downwards, % (quadrant)",
        "tibia: from the front and from medial, %",
        "length in CT, mm",
        "slack length, mm",
        "stiffness, N/mm",
    ]);
    format!("<h2>Grafts</h2>{}", table(&header, rows))
}

/// What each graft bears in the loaded tests; the figures have the unloaded ones.
fn bears(out: &Outcome) -> String {
    if out.grafts.is_empty() {
        return String::new();
    }
    let rows = out.tests.iter().filter(|t| t.test != "unloaded").map(|t| {
        let forces = out.grafts.iter().map(|g| shown(value(t, STATES[2], &format!("graft_{}_n", g.name)), 0));
        [t.test.clone(), format!("{}", t.flexion_deg)].into_iter().chain(forces).collect::<Vec<String>>()
    });
    let grafts = out.grafts.iter().map(|g| format!("{}, N", g.name));
    let header: Vec<String> = words(&["test", "flexion, deg"]).into_iter().chain(grafts).collect();
    format!("<h2>What the grafts bear</h2>{}", table(&header, rows))
}

/// What is odd about these states in a test, in the order in which they are asked for.
fn odd(t: &TestTold, states: &[&str]) -> String {
    let flagged = states.iter().filter_map(|s| Some((*s, t.flags.get(*s).filter(|f| !f.is_empty())?)));
    flagged.map(|(s, f)| format!("{s}: {}", f.join(", "))).collect::<Vec<_>>().join("; ")
}

fn laxities(out: &Outcome) -> String {
    let rows = out.tests.iter().filter(|t| t.test != "unloaded").map(|t| {
        let mut row = vec![t.test.clone(), format!("{}", t.flexion_deg)];
        row.extend(STATES.map(|s| shown(value(t, s, "laxity"), 1)));
        row.extend([unit(t).to_owned(), odd(t, &STATES)]);
        row
    });
    table(&words(&["test", "flexion, deg", "intact", "deficient", "reconstructed", "unit", "odd"]), rows)
}

fn differences(out: &Outcome) -> String {
    let rows = out.tests.iter().map(|t| {
        let mut row = vec![t.test.clone(), format!("{}", t.flexion_deg)];
        row.extend(["ap_mm", "ie_deg", "vv_deg"].map(|c| shown(t.off.get(c), 1)));
        for side in ["medial", "lateral"] {
            let name = format!("contact_{side}_force_n");
            row.extend([0, 2].map(|s| shown(value(t, STATES[s], &name), 0)));
        }
        row.push(odd(t, &[STATES[0], STATES[2]]));
        row
    });
    let header = words(&[
        "test",
        "flexion, deg",
        "AP, mm",
        "IE, deg",
        "VV, deg",
        "medial contact intact, N",
        "reconstructed",
        "lateral contact intact, N",
        "reconstructed",
        "odd",
    ]);
    table(&header, rows)
}

/// A value over flexion, and its intervals as bars, which need not lie evenly about it.
fn series<'a>(name: &str, k: usize, of: impl Iterator<Item = (&'a TestTold, Option<&'a Value>)>) -> [Series; 2] {
    let (mut points, mut middles, mut spread) = (vec![], vec![], vec![]);
    for (t, v) in of {
        let Some(v) = v else { continue };
        points.push((t.flexion_deg, v.value));
        if let Some((low, high)) = v.lower.zip(v.upper) {
            middles.push((t.flexion_deg, f64::midpoint(low, high)));
            spread.push(0.5 * (high - low));
        }
    }
    let of = |name: &str, points, spread| Series {
        name: name.to_owned(),
        points,
        spread,
        colour: colour(k),
        line: true,
        thin: false,
    };
    [of(name, points, vec![]), of("", middles, spread)]
}

fn figures(out: &Outcome) -> String {
    let mut text = String::new();
    for (kind, axis) in
        [("anterior drawer", "forward, mm"), ("internal rotation", "external, deg"), ("valgus", "valgus, deg")]
    {
        let of = |s: &str| {
            out.tests.iter().filter(|t| t.test == kind).map(|t| (t, value(t, s, "laxity"))).collect::<Vec<_>>()
        };
        let all: Vec<Series> = STATES.iter().enumerate().flat_map(|(k, s)| series(s, k, of(s).into_iter())).collect();
        text += &figure((kind, axis), &all);
    }
    let passive = || out.tests.iter().filter(|t| t.test == "unloaded");
    let forces: Vec<Series> = out
        .grafts
        .iter()
        .enumerate()
        .flat_map(|(k, g)| {
            let name = format!("graft_{}_n", g.name);
            series(&g.name, k, passive().map(|t| (t, value(t, STATES[2], &name))))
        })
        .collect();
    if !forces.is_empty() {
        text += &figure(("graft force without load", "N"), &forces);
    }
    format!("<div class=\"charts\">{text}</div>")
}

fn figure((title, axis): (&str, &str), all: &[Series]) -> String {
    let svg = draw(SIZE, |area| panel(area, (title, "flexion, deg", axis), all, true));
    let bars = if all.iter().any(|s| !s.spread.is_empty()) { " Bars are 90 % intervals." } else { "" };
    format!("<figure class=\"paper\">{svg}<figcaption>{title}, {axis}.{bars}</figcaption></figure>")
}

/// What a reader must know before believing any of it.
pub(super) fn limits() -> String {
    "<h2>What this does not know</h2><ul>\
     <li>It is a model of one knee, no advice. Nobody has held a plan against an operated knee.</li>\
     <li>A graft is a straight line between its two places. It does not heal, creep or slip.</li>\
     <li>Intervals hold what is not known of this knee, and loads that the model may lack. What every such model lacks of a graft is not in them.</li></ul>"
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_stand_in_the_order_of_the_columns() {
        let flags = STATES.map(|s| (s.to_owned(), if s == "deficient" { vec![] } else { vec!["subluxed".to_owned()] }));
        let t = TestTold {
            test: "valgus".into(),
            flexion_deg: 30.0,
            load: [0.0; 5],
            states: [].into(),
            flags: flags.into(),
            off: [].into(),
            chance: None,
            counts: None,
            odd: vec![],
            beyond: vec![],
        };
        assert_eq!(odd(&t, &["reconstructed", "deficient", "intact"]), "reconstructed: subluxed; intact: subluxed");
        assert_eq!(odd(&t, &STATES[..2]), "intact: subluxed");
    }

    #[test]
    fn the_section_says_why_there_is_no_knee_or_no_interval() {
        let section = |part: Result<&str, &str>, samples_asked| {
            let of = |section: &str| LivePart { section: section.to_owned(), foot: String::new() };
            pulled(&Live { part: part.map(of).map_err(str::to_owned), samples_asked })
        };
        assert_eq!(section(Ok("knee"), true), "knee");
        assert_eq!(section(Ok("knee"), false), "<div data-unasked=\"samples\">knee</div>");
        assert!(section(Err("no <bone>"), true).contains("can be pulled at: no &lt;bone&gt;. The"));
    }
}
