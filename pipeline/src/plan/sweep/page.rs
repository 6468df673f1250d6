//! sweep.html: one page to print, with the maps of two choices and the best plans.

use super::file::Sweep;
use super::row::{Row, beyond_among_first, ranked};
use super::subject::Subject;
use super::{BEST, SweepTold, counted, not_restored};
use crate::plan::file::PlanFile;
use crate::plan::heat::heat;
use crate::plan::html::{STYLE, table, words};
use crate::plan::knee::Placed;
use crate::plan::knee::main_coordinate;
use crate::plan::map::{Cell, Map};
use crate::plan::page::{FIGURES, limits};
use crate::plan::planned::{Law, section};
use crate::plan::table::{fixed, shown};
use crate::report::{escaped, head};
use std::collections::BTreeMap;
use std::fmt::Write;

/// What the maps of a sweep show: its column, words, digits behind the point, and what its numbers are multiplied by.
fn shown_on_maps(of: Subject) -> [(String, String, usize, f64); 3] {
    let far =
        format!("furthest from the intact knee in the {}, {} {}", of.several(), main_coordinate(of.kind), of.unit());
    [
        ("chance".to_owned(), "every loaded test like the intact knee, % of the samples".to_owned(), 0, 100.0),
        (of.most_off(), far, 1, 1.0),
        ("unloaded_force_n".to_owned(), "most that the graft bears unloaded, N".to_owned(), 0, 1.0),
    ]
}

/// A map has at most so many fields [-]; ours: a sheet of paper has room for their numbers.
const MOST_FIELDS: usize = 400;

/// What the page is of.
pub(super) struct Given<'a> {
    pub(super) sweep: &'a Sweep,
    /// graft.toml.
    pub(super) base: &'a PlanFile,
    /// Bundles that are cut.
    pub(super) cut: &'a [String],
    /// Where the grafts of graft.toml are.
    pub(super) placed: &'a [Placed],
    /// Draws the samples.
    pub(super) seed: Option<u64>,
}

/// The page.
pub(super) fn page(given: &Given, rows: &[Row], (told, label): (&SweepTold, &str)) -> String {
    let (sweep, base) = (given.sweep, given.base);
    let title = if base.name.is_empty() { "Many plans" } else { &base.name };
    let mut text = head(&format!("{title}: many plans")).replace("To the stages", "To the plans");
    text += FIGURES;
    text += STYLE;
    let _ = write!(text, "<header><h1>{}</h1><p>{}</p></header><main id=\"stages\">", escaped(title), escaped(label));
    text += &summary(given, rows, told);
    text += &varied(sweep, base);
    let laws: Vec<Law> = given.placed.iter().map(|p| (p.stiffness, p.whole.as_deref())).collect();
    text += &section(base, &laws);
    text += &maps(sweep, base, rows);
    text += &best(sweep, base, rows, told.samples);
    text += &limits();
    if !told.warnings.is_empty() {
        let all: String = told.warnings.iter().map(|w| format!("<li>{}</li>", escaped(w))).collect();
        let _ = write!(text, "<h2>What is odd</h2><ul>{all}</ul>");
    }
    text + "</main></body></html>\n"
}

/// What a reader wants first.
fn summary(given: &Given, rows: &[Row], told: &SweepTold) -> String {
    let drawn = given.seed.map_or("the first that the model has".to_owned(), |seed| format!("drawn by seed {seed}"));
    let samples = match told.samples {
        0 => "The most probable knee alone was asked: no intervals and no chances.".to_owned(),
        n => format!(
            "Of each plan {} of the knee {} asked, {drawn}. The table says how many of them could not be operated on or have no equilibrium.",
            counted(n, "sample"),
            if n == 1 { "was" } else { "were" }
        ),
    };
    let cut = match given.cut {
        [] => "Nothing is cut.".to_owned(),
        all => format!("Cut: {}.", all.join(", ")),
    };
    let none = not_restored(rows, given.base).map_or(String::new(), |none| format!("<strong>{none}.</strong> "));
    let lost = match told.plans - told.done {
        0 => String::new(),
        n => format!(" {n} could not be done; sweep.csv says why."),
    };
    format!(
        "<h2>In short</h2><p>{none}{} of the graft {}. {} {samples}{lost} Every number of every plan is in sweep.csv. A row there is what the command \
         plan tells of that one plan.</p>",
        counted(told.plans, "plan"),
        escaped(&told.graft),
        escaped(&cut)
    )
}

/// What is varied, and what graft.toml has of it.
fn varied(sweep: &Sweep, base: &PlanFile) -> String {
    let own = base.graft.get(sweep.graft);
    let rows = sweep.varied.iter().map(|(choice, values)| {
        let list: Vec<String> = values.iter().map(f64::to_string).collect();
        let planned = own.and_then(|g| choice.of(g)).map_or("none".into(), |x| x.to_string());
        vec![choice.label.to_owned(), list.join(", "), planned]
    });
    format!(
        "<h2>What is varied</h2>{}<p>These values take the place of what the graft {} has below. All else is as planned.</p>",
        table(&words(&["choice", "values", "in the plan"]), rows),
        escaped(own.map_or("", |g| g.name.as_str()))
    )
}

/// Maps over two choices; nothing where only one is varied.
fn maps(sweep: &Sweep, base: &PlanFile, rows: &[Row]) -> String {
    let Some(pair) = sweep.map else { return String::new() };
    let [across, up] = pair.map(|k| &sweep.varied[k]);
    if across.1.len() * up.1.len() > MOST_FIELDS {
        return "<h2>Maps</h2><p>There are too many values for a map. sweep.csv has them all.</p>".into();
    }
    // the first of the ranked is the best with its two values
    let mut best: BTreeMap<[u64; 2], &Row> = BTreeMap::new();
    for row in ranked(rows) {
        best.entry(pair.map(|k| row.values[k].to_bits())).or_insert(row);
    }
    let own = base.graft.get(sweep.graft);
    // a field is framed where it tells of the very plan of graft.toml
    let framed = best.values().find(|row| sweep.plan(base, &row.values) == *base);
    let planned = framed.map_or([f64::NAN; 2], |row| pair.map(|k| row.values[k]));
    let mut text = String::new();
    for (column, what, digits, times) in shown_on_maps(Subject::of(base)) {
        let number = |at: [f64; 2]| {
            let row = best.get(&at.map(f64::to_bits))?;
            row.number(&column).map(|x| [times * x, 0.0])
        };
        let places = up.1.iter().flat_map(|y| across.1.iter().map(move |x| [*x, *y]));
        let cells: Vec<Cell> = places.map(|at| Cell { at, quadrant_percent: None, found: number(at) }).collect();
        if cells.iter().all(|c| c.found.is_none()) {
            continue;
        }
        let axes = [across.0.label, up.0.label];
        let graft = own.map_or(String::new(), |g| g.name.clone());
        let map = Map { of: "sweep", graft, axes, planned, cells };
        let svg = heat(&map, &what, digits, |c| c.found.map(|f| f[0]));
        let _ = write!(text, "<figure class=\"paper\">{svg}<figcaption>{what}</figcaption></figure>");
    }
    if text.is_empty() {
        return text;
    }
    let frame = framed.map_or("", |_| " The framed field is the plan of graft.toml.");
    format!(
        "<h2>Maps</h2><p>Where other choices are varied, too, a field tells of the best plan with its two values. The stronger the colour, the more.{frame}\
         </p><div class=\"charts\">{text}</div>"
    )
}

/// The best plans; `samples` were asked.
fn best(sweep: &Sweep, base: &PlanFile, rows: &[Row], samples: usize) -> String {
    let (all, of) = (ranked(rows), Subject::of(base));
    if all.is_empty() {
        return String::new();
    }
    let percent = |r: &Row, column: &str, best: &str| match (r.share(column), r.number(best)) {
        (Some(share), _) => share,
        (_, Some(x)) if r.number(&format!("{column}_of")).is_none() => (if x > 0.0 { "yes" } else { "no" }).to_owned(),
        _ => "none".to_owned(),
    };
    let line = |r: &&Row| {
        let mut cells = vec![r.rank.map_or(String::new(), |n| n.to_string()), r.plan.to_string()];
        cells.extend(r.values.iter().map(f64::to_string));
        cells.push(percent(r, "chance", "restored"));
        cells.push(percent(r, &of.chance(), &of.restored()));
        cells.push(r.number(&of.most_off()).map_or("none".into(), |x| fixed(x, 1)));
        cells.push(shown(r.value("unloaded_force_n").as_ref(), 0));
        cells.extend(
            ["medial", "lateral"].map(|side| shown(r.value(&format!("unloaded_{side}_contact_n")).as_ref(), 0)),
        );
        if samples > 0 {
            let count = |column: &str| r.number(column).map_or(String::new(), |x| fixed(x, 0));
            cells.extend(["samples_leaving", "samples_without_equilibrium"].map(count));
        }
        cells.push(r.brief.join("; "));
        cells
    };
    let mut header = words(&["rank", "plan"]);
    header.extend(sweep.varied.iter().map(|(c, _)| c.label.to_owned()));
    header.extend(words(&["every test like the intact knee"]));
    header.extend([format!("{} like it", of.several()), format!("furthest off in them, {}", of.unit())]);
    header.extend(words(&[
        "most graft force unloaded, N",
        "most medial contact unloaded, N",
        "most lateral contact unloaded, N",
    ]));
    if samples > 0 {
        header.extend(words(&[
            "samples that leave the plateau",
            "samples that could not be operated on or have no equilibrium",
        ]));
    }
    header.push("odd".to_owned());
    let many = all.len().min(BEST);
    let title = match (not_restored(rows, base).is_some(), many) {
        (_, 1) => "The plan".to_owned(),
        (true, _) => format!("The first {many} by rank"),
        (false, _) => format!("The best {many}"),
    };
    let told = match samples {
        0 => String::new(),
        n => format!(
            " A chance is of the samples whose intact knee stays on the plateau. Chances that lie near each other are not told apart by {}. Behind a \
             number stands its 90 % interval.",
            counted(n, "sample")
        ),
    };
    let beyond = beyond_among_first(rows).map_or(String::new(), |words| {
        format!(" {words}. A plan with one keeps its rank; the last column names the graft.")
    });
    format!(
        "<h2>{title}</h2><p>Ranked by the chance that every loaded test is like the intact knee, then by that of the {}, then by how far \
         off they are. What the graft bears unloaded, and the contact, have no part in it: look at their columns.{beyond}{told}</p>{}",
        of.several(),
        table(&header, all.iter().take(BEST).map(line))
    )
}

#[cfg(test)]
mod tests {
    use super::super::file::parsed;
    use super::super::row::{rank, tests::row};
    use super::*;
    use crate::plan::file;

    #[test]
    fn a_field_tells_of_the_best_plan_with_its_values_and_the_table_begins_with_the_best() {
        let base = file::parsed(file::EXAMPLE).unwrap();
        let text = "femur_depth_percent = [20, 24.8]\ntension_n = [40, 80]\nat_flexion_deg = [0, 20]\nmap = [\"femur_depth_percent\", \"tension_n\"]\n";
        let sweep = parsed(text, &base).unwrap();
        let chances = [0.11, 0.22, 0.33, 0.44, 0.55, 0.66, 0.77, 0.07];
        let mut rows: Vec<Row> =
            sweep.all().iter().zip(chances).enumerate().map(|(k, (v, p))| row(k + 1, v, p, 1.0)).collect();
        rank(&mut rows);
        let maps = maps(&sweep, &base, &rows);
        // of two flexions of fixing the better one
        for percent in [22, 44, 66, 77] {
            assert_eq!(maps.matches(&format!(">{percent}<")).count(), 1, "{percent}");
        }
        // a map that nobody could read is none
        let many: Vec<String> = (1..=21).map(|n| n.to_string()).collect();
        let text = format!("femur_depth_percent = [{0}]\ntension_n = [{0}]", many.join(","));
        assert!(super::maps(&parsed(&text, &base).unwrap(), &base, &rows).contains("too many values for a map"));
        // without a force in the rows there is no map of it
        // the best with the plan's depth and tension is fixed at another flexion: it is not the plan
        assert_eq!((maps.matches("<svg").count(), maps.matches("fill=\"none\"").count()), (2, 0));
        let last = rows[7].values.clone();
        rows[7].values = std::mem::replace(&mut rows[6].values, last);
        let maps = super::maps(&sweep, &base, &rows);
        assert!(maps.matches("fill=\"none\"").count() == 2 && maps.contains("The framed field is the plan"));
        let best = best(&sweep, &base, &rows, 100);
        let first = best.split("<tbody>").nth(1).unwrap();
        assert!(first.starts_with("<tr><td data-head=\"rank\">1</td><td data-head=\"plan\">7</td>"), "{first}");
        assert!(first.contains(">77 % (77 of 100)</td>"));
        assert!(best.contains("<h2>The best 8</h2>") && best.contains("not told apart by 100 samples"));
        // where none restores the knee, none is the best; where none could be done, there is no table
        for row in &mut rows {
            row.numbers[0].1 = Some(0.0);
        }
        assert!(super::best(&sweep, &base, &rows, 100).contains("<h2>The first 8 by rank</h2>"));
        for row in &mut rows {
            row.rank = None;
        }
        assert!(super::best(&sweep, &base, &rows, 100).is_empty() && super::maps(&sweep, &base, &rows).is_empty());
    }
}
