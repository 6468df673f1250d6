//! cohort.html: who failed and why, who needs a look, and every quantity across knees.

use super::dependent::DependentTold;
use super::knee::{Knee, Rows, Status};
use super::outliers::{Outlier, by_quantity, median};
use super::regions::{self, parted};
use super::table::Table;
use crate::model_file::between;
use crate::report::page_parts::{COLOURS, escaped, head, layout, plotly_js};
use plotly::common::{ErrorData, ErrorType, Line, Marker, Mode};
use plotly::layout::{Axis, Layout};
use plotly::{Plot, Scatter};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// More knees than this are drawn as outliers and an even choice of the rest, so that the page stays light.
const MOST_DRAWN: usize = 400;
/// Intervals of more knees than this would hide each other and are left out.
const MOST_INTERVALS: usize = 40;
/// Categories whose medians differ by more than this factor get charts of their own.
const SAME_SCALE: f64 = 3.0;
const RED: &str = "#c8102e";

/// A chart and what it is called.
struct Strip {
    title: String,
    plot: Plot,
}

/// A point of a strip.
struct Dot {
    category: String,
    knee: usize,
    value: f64,
    interval: Option<(f64, f64)>,
    outlier: bool,
}

/// The page for the folder `out`, absolute. `dependent`: why knees are not independent.
pub(super) fn page(
    knees: &[Knee],
    (outliers, dependent): (&[Outlier], &[DependentTold]),
    tables: &[Table],
    out: &Path,
) -> String {
    let failed = knees.iter().filter(|k| k.failed()).count();
    let odd: BTreeSet<&str> = outliers.iter().map(|o| o.knee.as_str()).collect();
    let mut html = head(&format!("{} knees", knees.len()));
    let class = if failed > 0 {
        "failed"
    } else if odd.is_empty() && dependent.is_empty() {
        "good"
    } else {
        "look"
    };
    let _ = write!(
        html,
        "<header><h1>{} knees</h1></header><p class=\"verdict {class}\" id=\"verdict\"><strong>{} built, {failed} failed, {} stand out.</strong></p>\
         <nav aria-label=\"Parts\"><ul><li><a href=\"#failed\">Failed</a></li><li><a href=\"#look\">To look at</a></li>\
         <li><a href=\"#charts\">Across knees</a></li><li><a href=\"#knees\">All knees</a></li><li><a href=\"#tables\">Tables</a></li></ul></nav><main id=\"stages\">",
        knees.len(),
        knees.len() - failed,
        odd.len()
    );
    html += &failures(knees, out);
    html += &not_independent(dependent);
    html += &to_look_at(knees, outliers, out);
    let strips = strips(knees, outliers);
    html += &charts(&strips, knees.len());
    html += &all(knees, outliers, out);
    html += &files(tables);
    html += "</main>";
    html + &script(&strips)
}

fn link(knee: &Knee, out: &Path) -> String {
    let name = escaped(&knee.name);
    match knee.report() {
        Some(report) => format!("<a href=\"{}\">{name}</a>", escaped(&address(&between(out, &report)))),
        None => name,
    }
}

/// A path as the address of a link.
fn address(path: &str) -> String {
    path.bytes()
        .map(|b| match b {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => char::from(b).to_string(),
            other => format!("%{other:02X}"),
        })
        .collect()
}

fn failures(knees: &[Knee], out: &Path) -> String {
    let mut html = "<section id=\"failed\"><h2>Failed</h2>".to_owned();
    for knee in knees {
        if let Status::Failed { stage, message } = &knee.status {
            let _ = write!(
                html,
                "<h3>{} at {}</h3><p class=\"failure\">{}</p>",
                link(knee, out),
                escaped(stage),
                escaped(message)
            );
        }
    }
    if knees.iter().all(|k| !k.failed()) {
        html += "<p>None.</p>";
    }
    html + "</section>"
}

/// Why knees are not independent of each other; nothing where they are.
fn not_independent(dependent: &[DependentTold]) -> String {
    if dependent.is_empty() {
        return String::new();
    }
    let rows: String = dependent.iter().map(|told| format!("<li>{}</li>", escaped(&told.message))).collect();
    format!("<section id=\"dependent\"><h2>Not independent</h2><ul>{rows}</ul></section>")
}

fn to_look_at(knees: &[Knee], outliers: &[Outlier], out: &Path) -> String {
    let mut html = "<section id=\"look\"><h2>To look at</h2><p>Values more than 3.5 robust standard deviations from the cohort's median; \
                    fewer than five knees have none.</p>"
        .to_owned();
    let before = html.len();
    for knee in knees {
        let odd = super::of(outliers, knee);
        if odd.is_empty() {
            continue;
        }
        let rows: String = odd.iter().map(|o| format!("<li>{}</li>", escaped(&o.words()))).collect();
        let _ = write!(html, "<h3>{}</h3><ul>{rows}</ul>", link(knee, out));
    }
    if html.len() == before {
        html += "<p>None.</p>";
    }
    // a warning that every knee gives says little of one of them
    let mut each: BTreeMap<&str, usize> = BTreeMap::new();
    knees.iter().flat_map(Knee::warnings).for_each(|(stage, _)| *each.entry(stage).or_default() += 1);
    if !each.is_empty() {
        let words: Vec<String> = each.iter().map(|(stage, n)| format!("{stage} {n}")).collect();
        let _ = write!(
            html,
            "<p>Warnings of all knees, by stage: {}. Each stands in warnings.csv.</p>",
            escaped(&words.join(", "))
        );
    }
    html + "</section>"
}

fn charts(strips: &[Strip], knees: usize) -> String {
    let mut html = "<section id=\"charts\"><h2>Across knees</h2><p>A point a knee, a bar at the median, outliers red, the farthest with its name".to_owned();
    if knees > MOST_DRAWN {
        let _ = write!(html, "; of {knees} knees an even choice of {MOST_DRAWN} is drawn and every outlier");
    }
    html += ".</p><div class=\"charts\">";
    for (k, strip) in strips.iter().enumerate() {
        let _ = write!(
            html,
            "<figure><h3>{0}</h3><div class=\"chart\" id=\"strip-{k}\" role=\"img\" aria-label=\"{0} across knees\"></div></figure>",
            escaped(&strip.title)
        );
    }
    html + "</div></section>"
}

fn all(knees: &[Knee], outliers: &[Outlier], out: &Path) -> String {
    let mut html = "<section id=\"knees\"><h2>All knees</h2><div class=\"wide\"><table><thead><tr><th>knee</th><th>side</th><th>status</th>\
                    <th>last stage</th><th>warnings</th><th>outliers</th><th>time [s]</th><th>memory [MiB]</th><th>disk [MiB]</th></tr></thead><tbody>"
        .to_owned();
    for knee in knees {
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.0}</td><td>{:.1}</td></tr>",
            link(knee, out),
            escaped(&knee.side),
            knee.status.name(),
            escaped(knee.last_stage().unwrap_or("none")),
            knee.warnings().count(),
            super::of(outliers, knee).len(),
            knee.seconds(),
            knee.memory_mib(),
            knee.bytes as f64 / 1_048_576.0
        );
    }
    html + "</tbody></table></div></section>"
}

fn files(tables: &[Table]) -> String {
    let mut html = "<section id=\"tables\"><h2>Tables</h2><ul>".to_owned();
    for t in tables {
        let columns: Vec<&str> = t.columns.iter().map(|(name, _)| *name).collect();
        let _ = write!(
            html,
            "<li><a href=\"{0}.csv\">{0}.csv</a>{3}: {1} rows of {2}</li>",
            t.name,
            t.rows(),
            columns.join(", "),
            if cfg!(feature = "parquet") {
                format!(", <a href=\"{0}.parquet\">{0}.parquet</a>", t.name)
            } else {
                String::new()
            }
        );
    }
    html + "</ul></section>"
}

/// A chart of every quantity with its parts as categories; then parameters and forces by source, laxity by protocol.
fn strips(knees: &[Knee], outliers: &[Outlier]) -> Vec<Strip> {
    let far: BTreeSet<(&str, &str, &str)> =
        outliers.iter().map(|o| (o.knee.as_str(), o.quantity.name.as_str(), o.quantity.part.as_str())).collect();
    // by stage, title and whether it is a pose
    let mut groups: BTreeMap<(&str, String, bool), Vec<Dot>> = BTreeMap::new();
    for ((stage, name, part), values) in by_quantity(knees) {
        let coordinate = name.strip_prefix("pose_");
        let region = parted(stage, &name, &part);
        if region.is_some() && name != regions::MEAN {
            continue; // of regions, the tables have these too
        }
        let (title, category) = match (coordinate, region) {
            (Some(c), _) => (format!("pose in CT [{}]", if c.ends_with("_mm") { "mm" } else { "deg" }), c.to_owned()),
            (None, Some((cartilage, region))) => {
                (format!("{name} of {} by region", cartilage.replace('_', " ")), region.replace('_', " "))
            }
            (None, None) => (name.clone(), part.clone()),
        };
        let dots = groups.entry((stage, title, coordinate.is_some())).or_default();
        for (knee, value) in values {
            let outlier = far.contains(&(knees[knee].name.as_str(), name.as_str(), part.as_str()));
            dots.push(Dot { category: category.clone(), knee, value, interval: None, outlier });
        }
    }
    let order = crate::stage::list::names();
    let mut groups: Vec<_> = groups.into_iter().collect();
    groups.sort_by_key(|((stage, ..), _)| order.iter().position(|s| s == stage));
    let mut out: Vec<Strip> = groups
        .into_iter()
        .flat_map(|((stage, title, is_pose), dots)| panels(knees, (&format!("{stage}: {title}"), is_pose), dots))
        .collect();
    out.extend(of_rows(knees, |k| &k.parameters, ("kind", "bundle"), ["value", "lower", "upper"]));
    out.extend(of_rows(knees, |k| &k.forces, ("trial", "bundle"), ["value_n", "lower_n", "upper_n"]));
    for coordinate in ["ap_mm", "ie_deg"] {
        out.extend(of_rows(knees, |k| &k.laxity, ("file", "step"), [coordinate, "", ""]));
    }
    out
}

/// Charts of the rows of files: one a source and a value of the column `by.0`, with `by.1` as categories.
fn of_rows(knees: &[Knee], rows: impl Fn(&Knee) -> &Vec<Rows>, by: (&str, &str), values: [&str; 3]) -> Vec<Strip> {
    let mut groups: BTreeMap<String, Vec<Dot>> = BTreeMap::new();
    for (knee, k) in knees.iter().enumerate() {
        for r in rows(k) {
            let kinds = if by.0 == "file" { vec![r.kind.clone(); r.len()] } else { r.cells(by.0) };
            let [value, lower, upper] = values.map(|c| r.numbers(c));
            for (i, (kind, category)) in kinds.iter().zip(r.cells(by.1)).enumerate() {
                let Some(value) = value[i] else { continue };
                let interval = lower[i].zip(upper[i]);
                let what = if by.0 == "file" { format!("{kind} {}", values[0]) } else { kind.replace('_', " ") };
                let dots = groups.entry(format!("{}: {what}", r.source)).or_default();
                dots.push(Dot { category, knee, value, interval, outlier: false });
            }
        }
    }
    groups.into_iter().map(|(title, dots)| strip(knees, &title, &dots)).collect()
}

/// One chart; one for every category where one scale would flatten some of them.
fn panels(knees: &[Knee], (title, is_pose): (&str, bool), dots: Vec<Dot>) -> Vec<Strip> {
    let mut by: BTreeMap<String, Vec<Dot>> = BTreeMap::new();
    dots.into_iter().for_each(|d| by.entry(d.category.clone()).or_default().push(d));
    let middles: Vec<f64> = by.values().map(|d| median(&d.iter().map(|d| d.value).collect::<Vec<_>>()).abs()).collect();
    let (least, most) =
        (middles.iter().copied().fold(f64::INFINITY, f64::min), middles.iter().copied().fold(0.0, f64::max));
    if is_pose || most <= SAME_SCALE * least {
        return vec![strip(knees, title, &by.into_values().flatten().collect::<Vec<_>>())];
    }
    by.into_iter().map(|(part, dots)| strip(knees, &format!("{title}, {}", part.replace('_', " ")), &dots)).collect()
}

fn strip(knees: &[Knee], title: &str, dots: &[Dot]) -> Strip {
    let mut categories: Vec<&str> = Vec::new();
    for d in dots {
        if !categories.contains(&d.category.as_str()) {
            categories.push(&d.category);
        }
    }
    let column = |d: &Dot| categories.iter().position(|c| *c == d.category).unwrap_or_default() as f64;
    // every knee has its own place in all columns, so that it can be followed from one to the next
    let place = |d: &Dot| column(d) + 0.6 * ((d.knee as f64 + 0.5) / knees.len() as f64 - 0.5);
    let every = knees.len().div_ceil(MOST_DRAWN);
    let mut plot = Plot::new();
    for (outlier, colour) in [(false, COLOURS[0]), (true, RED)] {
        let drawn: Vec<&Dot> =
            dots.iter().filter(|d| d.outlier == outlier && (outlier || d.knee % every == 0)).collect();
        if drawn.is_empty() {
            continue;
        }
        let names: Vec<String> = drawn.iter().map(|d| knees[d.knee].name.clone()).collect();
        let far = |d: &Dot| (d.value - middle_of(dots, &d.category)).abs();
        let farthest = |d: &Dot| drawn.iter().filter(|o| o.category == d.category).all(|o| far(o) <= far(d));
        let shown: Vec<String> = drawn
            .iter()
            .zip(&names)
            .map(|(d, n)| if outlier && farthest(d) { n.clone() } else { String::new() })
            .collect();
        let (x, y): (Vec<f64>, Vec<f64>) = drawn.iter().map(|d| (place(d), d.value)).unzip();
        let mut trace = Scatter::new(x, y)
            .mode(if outlier { Mode::MarkersText } else { Mode::Markers })
            .text_array(shown)
            .hover_text_array(names)
            .hover_template("%{hovertext}: %{y:.4g}<extra></extra>")
            .marker(Marker::new().color(colour).size(7).opacity(0.75));
        if outlier {
            trace = trace.text_position(plotly::common::Position::TopCenter);
        }
        if knees.len() <= MOST_INTERVALS && drawn.iter().any(|d| d.interval.is_some()) {
            let away = |d: &Dot, up: bool| {
                d.interval.map_or(0.0, |(l, u)| if up { u - d.value } else { d.value - l }.max(0.0))
            };
            let error = ErrorData::new(ErrorType::Data)
                .array(drawn.iter().map(|d| away(d, true)).collect())
                .array_minus(drawn.iter().map(|d| away(d, false)).collect())
                .symmetric(false)
                .thickness(1.0)
                .width(0);
            trace = trace.error_y(error);
        }
        plot.add_trace(trace);
    }
    let middles: Vec<f64> = categories.iter().map(|c| middle_of(dots, c)).collect();
    let at: Vec<f64> = (0..categories.len()).map(|k| k as f64).collect();
    // a bar a category, broken after each
    let (ends_of, at_height): (Vec<f64>, Vec<f64>) = middles
        .iter()
        .enumerate()
        .flat_map(|(k, m)| [(k as f64 - 0.38, *m), (k as f64 + 0.38, *m), (k as f64, f64::NAN)])
        .unzip();
    let bar = Line::new().color("#222222").width(2.0);
    let template = "median %{y:.4g}<extra></extra>";
    plot.add_trace(Scatter::new(ends_of, at_height).mode(Mode::Lines).line(bar).hover_template(template));
    let ends = vec![-0.6, categories.len() as f64 - 0.4];
    let names: Vec<String> = categories.iter().map(|c| c.replace("tibia_", "tibia ")).collect();
    let axis =
        Axis::new().tick_values(at).tick_text(names).range(ends).show_grid(false).zero_line(false).auto_margin(true);
    let layout: Layout = layout("", "").x_axis(axis).show_legend(false);
    plot.set_layout(layout);
    Strip { title: title.to_owned(), plot }
}

/// The median of a category.
fn middle_of(dots: &[Dot], category: &str) -> f64 {
    median(&dots.iter().filter(|d| d.category == category).map(|d| d.value).collect::<Vec<_>>())
}

fn script(strips: &[Strip]) -> String {
    let plots: Vec<String> = strips.iter().map(|s| s.plot.to_json()).collect();
    let data = format!("[{}]", plots.join(",")).replace("</", "<\\/");
    format!(
        "<script type=\"application/json\" id=\"data\">{data}</script>{}<script>{}</script></body></html>\n",
        plotly_js(),
        include_str!("page.js")
    )
}
