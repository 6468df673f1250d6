//! Charts of a calibration: history, parameters with intervals, force and displacement over measured points.

use super::Calibration;
use crate::report::chart::{COLOURS, Chart, layout};
use calibration::session::Outcome;
use plotly::common::{DashType, ErrorData, ErrorType, Line, Marker, MarkerSymbol, Mode, Title};
use plotly::layout::{Axis, AxisType};
use plotly::{Plot, Scatter};
use sim::coordinate::{AP, Coordinate, Free, IE, VV};
use sim::laxity::{LaxityTrial, Test};

/// The charts of the calibrations: the joint one's answers to each source, its parameters; then each source's own.
pub(super) fn charts(c: &Calibration) -> Vec<Chart> {
    let mut out = Vec::new();
    for (name, outcome) in c.main_first() {
        let (sources, of) = &outcome.sources;
        for (s, source) in sources.iter().enumerate() {
            let told = if sources.len() > 1 { format!("{name}, {source}") } else { name.to_owned() };
            out.extend(answers(&told, outcome, &|trial| of.get(trial) == Some(&s)));
        }
        out.push(parameters(name, outcome, "reference strain"));
        out.push(parameters(name, outcome, "stiffness"));
    }
    out.push(history(c.main_first()));
    out
}

fn history<'a>(sources: impl Iterator<Item = (&'a str, &'a Outcome)>) -> Chart {
    let mut plot = Plot::new();
    let (mut text, mut by_starts) = (String::new(), false);
    for ((name, outcome), colour) in sources.zip(COLOURS) {
        let mut best = f64::INFINITY;
        let costs: Vec<f64> = outcome
            .found
            .history
            .iter()
            .map(|c| {
                best = best.min(*c);
                best
            })
            .collect();
        text += &format!(" {name}: {}, lowest {best:.1}.", costs.len());
        by_starts = !outcome.found.mode.is_empty();
        let at: Vec<usize> = (1..=costs.len()).collect();
        plot.add_trace(Scatter::new(at, costs).mode(Mode::Lines).name(name).line(Line::new().color(colour)));
    }
    // a recipe lowers the cost; the posterior lowers misfit and prior together, which is another number
    let (what, by) = match by_starts {
        true => ("half the sum of squares of misfit and prior", "start"),
        false => ("cost", "evaluation"),
    };
    let cost = Axis::new().title(Title::from(format!("lowest {what}"))).type_(AxisType::Log).show_line(true);
    let layout = layout(by, what).y_axis(cost);
    plot.set_layout(layout);
    Chart {
        id: "history".into(),
        title: "Calibration history".into(),
        text: format!("Lowest {what} by {by}.{text}"),
        plot: plot.to_json(),
    }
}

/// Parameters of one kind with the ends of their intervals; the range sought in is grey.
fn parameters(name: &str, outcome: &Outcome, kind: &str) -> Chart {
    let all: Vec<_> = outcome.found.parameters.iter().filter(|p| is_kind(p.kind.name(), kind)).collect();
    let labels: Vec<String> = all.iter().map(|p| format!("X{} {}", p.number, p.bundle)).collect();
    let mut plot = Plot::new();
    for (p, label) in all.iter().zip(&labels) {
        let range = Scatter::new(vec![label.clone(); 2], p.range.to_vec()).mode(Mode::Lines).show_legend(false);
        plot.add_trace(range.line(Line::new().color("#dddddd").width(9.0)).name("range sought in"));
    }
    let values: Vec<f64> = all.iter().map(|p| p.value).collect();
    let error = ErrorData::new(ErrorType::Data)
        .array(all.iter().map(|p| (p.upper - p.value).max(0.0)).collect())
        .array_minus(all.iter().map(|p| (p.value - p.lower).max(0.0)).collect())
        .symmetric(false);
    let marker = Marker::new().color(COLOURS[0]).size(8);
    plot.add_trace(Scatter::new(labels, values).mode(Mode::Markers).name(name).marker(marker).error_y(error));
    let unit = if kind == "stiffness" { "stiffness [N/mm]" } else { "reference strain [-]" };
    plot.set_layout(layout("", unit).show_legend(false));
    let determined = all.iter().filter(|p| p.determined > 0.5).count();
    Chart {
        id: format!("parameters-{name}-{}", kind.replace(' ', "-")),
        title: format!("{name}: {kind}"),
        text: format!(
            "Most probable values of {} parameters with their {:.0} % intervals, by {} samples of the posterior, inside the range they were sought in (grey); the data determine {determined} of them by more than half.",
            all.len(),
            100.0 * outcome.found.unknowns.interval,
            outcome.found.samples.len()
        ),
        plot: plot.to_json(),
    }
}

fn is_kind(name: &str, kind: &str) -> bool {
    name.replace('_', " ").contains(kind)
}

/// Load over displacement: measured points and predicted lines, a chart for each of AP, IE and VV.
fn answers(name: &str, outcome: &Outcome, is_shown: &dyn Fn(usize) -> bool) -> Vec<Chart> {
    let kinds = [
        ("AP", [Test::Anterior, Test::Posterior], AP, "anterior of the tibia [mm]", "anterior force [N]"),
        ("IE", [Test::Internal, Test::External], IE, "external rotation [deg]", "external moment [N m]"),
        ("VV", [Test::Varus, Test::Valgus], VV, "valgus rotation [deg]", "valgus moment [N m]"),
    ];
    kinds
        .into_iter()
        .filter_map(|(what, tests, c, x, y)| {
            let of_kind: Vec<(&LaxityTrial, Option<Free<f64>>)> = outcome
                .trials
                .iter()
                .zip(&outcome.found.predicted)
                .enumerate()
                .filter(|(k, (t, _))| is_shown(*k) && tests.contains(&t.test) && t.measured[c].is_some())
                .map(|(_, (t, p))| (t, *p))
                .collect();
            (!of_kind.is_empty()).then(|| {
                let (mut plot, miss) = answer(&of_kind, c);
                let displaced = of_kind.iter().any(|(t, _)| t.reference.is_some());
                let x = if displaced { format!("{x} from the unloaded pose") } else { x.to_owned() };
                plot.set_layout(layout(&x, y));
                Chart {
                    id: format!("answer-{}-{what}", name.replace(", ", "-")),
                    title: format!("{name}: {what} laxity, predicted over measured"),
                    text: format!("{} trials: measured points and the calibrated model's answers joined by lines, a colour a flexion. Root mean square miss {miss:.2} {}.", of_kind.len(), c.unit()),
                    plot: plot.to_json(),
                }
            })
        })
        .collect()
}

fn answer(trials: &[(&LaxityTrial, Option<Free<f64>>)], c: Coordinate) -> (Plot, f64) {
    let mut flexions: Vec<f64> = trials.iter().map(|(t, _)| t.nominal_flexion_deg).collect();
    flexions.sort_by(f64::total_cmp);
    flexions.dedup();
    let mut plot = Plot::new();
    let (mut sum, mut count) = (0.0, 0.0);
    for (flexion, colour) in flexions.iter().zip(COLOURS.iter().cycle()) {
        let mut rows: Vec<_> = trials.iter().filter(|(t, _)| t.nominal_flexion_deg == *flexion).collect();
        rows.sort_by(|a, b| a.0.load[c].total_cmp(&b.0.load[c]));
        let load: Vec<f64> = rows.iter().map(|(t, _)| t.load[c]).collect();
        let measured: Vec<f64> = rows.iter().filter_map(|(t, _)| t.measured[c]).collect();
        let marker = Marker::new().color(*colour).size(9).symbol(MarkerSymbol::CircleOpen);
        plot.add_trace(
            Scatter::new(measured, load).mode(Mode::Markers).name(format!("{flexion:.0} deg measured")).marker(marker),
        );
        let mut zeros: Vec<(f64, f64)> =
            rows.iter().filter_map(|(t, _)| t.reference.as_ref().map(|r| (0.0, r.load[c]))).collect();
        zeros.dedup();
        let answered: Vec<_> = rows.iter().filter_map(|(t, p)| p.map(|p| (p[c], t.load[c], t.measured[c]))).collect();
        answered.iter().filter_map(|(p, _, m)| m.map(|m| (p - m).powi(2))).for_each(|d| {
            sum += d;
            count += 1.0;
        });
        zeros.extend(answered.iter().map(|(p, l, _)| (*p, *l)));
        zeros.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (x, y) = zeros.into_iter().unzip();
        let line = Line::new().color(*colour).dash(DashType::Solid);
        let marker = Marker::new().color(*colour).size(5);
        plot.add_trace(
            Scatter::new(x, y)
                .mode(Mode::LinesMarkers)
                .name(format!("{flexion:.0} deg predicted"))
                .line(line)
                .marker(marker),
        );
    }
    let miss = if count > 0.0 { f64::sqrt(sum / count) } else { f64::NAN };
    (plot, miss)
}
