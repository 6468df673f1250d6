//! The paper's Figures 5 to 8 for the specimen at hand, as SVG.

use crate::cost::CostFunction;
use crate::targets::primary;
use crate::validate::{Passive, Source};
use plotters::coord::Shift;
use plotters::prelude::*;
use sim::laxity::{COORDINATES, LaxityTrial, Test};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Colours of sources, in their order [okabe2008].
const COLOURS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

fn colour(k: usize) -> RGBColor {
    COLOURS[k % COLOURS.len()]
}

/// A line or points of a panel.
struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    colour: RGBColor,
    /// Points only where false.
    line: bool,
    /// Thin, for what was measured.
    thin: bool,
}

/// Draws to a string of SVG; empty where drawing fails.
fn draw(size: (u32, u32), paint: impl FnOnce(&Area) -> Drawn) -> String {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        if root.fill(&WHITE).is_err() || paint(&root).is_err() || root.present().is_err() {
            return String::new();
        }
    }
    svg
}

/// One panel of lines and points, with a legend where asked for.
fn panel(area: &Area, labels: (&str, &str, &str), series: &[Series], legend: bool) -> Drawn {
    let all = || series.iter().flat_map(|s| s.points.iter());
    let span = |pick: &dyn Fn(&(f64, f64)) -> f64| {
        let (low, high) = all()
            .map(pick)
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let room = (0.06 * (high - low)).max(0.5);
        if low > high { (0.0, 1.0) } else { (low - room, high + room) }
    };
    let ((x0, x1), (y0, data_top)) = (span(&|p| p.0), span(&|p| p.1));
    // room above the data for the legend: about 18 pixels a name, of what captions and axes leave
    let plot = (f64::from(area.dim_in_pixel().1) - 80.0).max(1.0);
    let share = if legend { ((18.0 * series.len() as f64 + 14.0) / plot).min(0.5) } else { 0.0 };
    let y1 = data_top + (data_top - y0) * share / (1.0 - share);
    let mut chart = ChartBuilder::on(area)
        .caption(labels.0, ("sans-serif", 15))
        .margin(8)
        .x_label_area_size(38)
        .y_label_area_size(52)
        .build_cartesian_2d(x0..x1, y0..y1)?;
    chart
        .configure_mesh()
        .x_desc(labels.1)
        .y_desc(labels.2)
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style(("sans-serif", 12))
        .draw()?;
    for s in series {
        let style = s.colour.stroke_width(if s.thin { 1 } else { 2 });
        let points = s.points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite());
        let colour = s.colour;
        if s.line {
            chart
                .draw_series(LineSeries::new(points, style))?
                .label(&s.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], style));
        } else {
            chart
                .draw_series(points.map(|p| Circle::new(p, 3, colour.filled())))?
                .label(&s.name)
                .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
        }
    }
    if legend {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(("sans-serif", 12))
            .draw()?;
    }
    Ok(())
}

/// Figure 5: the targets, loads against flexion, a panel a coordinate.
pub fn figure5(targets: &[(String, Vec<LaxityTrial>)]) -> String {
    draw((960, 340), |root| {
        let panels = [
            (3, "Anterior +, posterior -", "AP load (N)"),
            (1, "External +, internal -", "IE load (N m)"),
            (0, "Valgus +, varus -", "VV load (N m)"),
        ];
        for (k, (area, (c, title, y))) in root.split_evenly((1, 3)).iter().zip(panels).enumerate() {
            let of = |(s, (name, trials)): (usize, &(String, Vec<LaxityTrial>))| Series {
                name: name.clone(),
                points: trials
                    .iter()
                    .filter(|t| primary(t.test) == Some(c) || (t.test == Test::Neutral && c == 3))
                    .map(|t| (t.fe_deg, t.load[c]))
                    .collect(),
                colour: colour(s),
                line: false,
                thin: false,
            };
            let series: Vec<Series> = targets.iter().enumerate().map(of).collect();
            panel(area, (title, "Flexion (deg)", y), &series, k == 0)?;
        }
        Ok(())
    })
}

/// Figure 6: the groups of a source's targets, their weights, and what each adds to the cost of the calibrated model.
pub fn figure6(name: &str, cost: &CostFunction, predicted: &[Option<[f64; 5]>]) -> String {
    let errors = cost.cost(predicted).errors;
    let rows: Vec<(String, f64)> = cost
        .terms
        .iter()
        .enumerate()
        .map(|(k, t)| {
            let (axis, unit) = (COORDINATES[t.coordinate].to_uppercase(), sim::laxity::VALUE_UNITS[t.coordinate]);
            let error = errors.get(k).copied();
            let text = format!(
                "{} {:.0} deg, {} trial{}: {axis} ({:.0}){}",
                t.test.name(),
                t.nominal_flexion_deg,
                t.trials.len(),
                if t.trials.len() == 1 { "" } else { "s" },
                t.weight,
                error.map_or(String::new(), |e| format!(", misses by {e:.1} {unit}"))
            );
            (text, error.map_or(0.0, |e| e * t.weight / t.range))
        })
        .collect();
    let most = rows.iter().map(|r| r.1).fold(1e-9, f64::max);
    draw((860, 60 + 20 * rows.len() as u32), |root| {
        let ink = ("sans-serif", 13).into_font();
        root.draw(&Text::new(
            format!("{name}: groups of targets (weight in brackets) and their share of the cost"),
            (12, 10),
            ("sans-serif", 16).into_font(),
        ))?;
        for (k, (text, share)) in rows.iter().enumerate() {
            let y = 42 + 20 * k as i32;
            root.draw(&Text::new(text.clone(), (12, y), ink.clone()))?;
            let length = (340.0 * share / most).round() as i32;
            root.draw(&Rectangle::new([(430, y), (430 + length, y + 13)], colour(0).filled()))?;
            root.draw(&Text::new(format!("{share:.1}"), (438 + length, y), ink.clone()))?;
        }
        Ok(())
    })
}

/// Figure 7: AP position under the anterior (top) and posterior (bottom) load against flexion.
pub fn figure7(sources: &[Source]) -> String {
    draw((560, 420), |root| {
        let mut series = Vec::new();
        for (k, s) in sources.iter().enumerate() {
            for (test, name) in [(Test::Anterior, "anterior"), (Test::Posterior, "posterior")] {
                let points: Vec<(f64, f64)> = s
                    .ap_flexions()
                    .iter()
                    .filter_map(|&fe| s.ap_end(test, fe).map(|r| (r.pose.fe_deg, r.pose.ap_mm)))
                    .collect();
                let thin = test == Test::Posterior;
                series.push(Series { name: format!("{} {name}", s.name), points, colour: colour(k), line: true, thin });
            }
        }
        panel(root, ("AP position under AP load", "Flexion (deg)", "Anterior (mm)"), &series, true)
    })
}

/// Figure 8: passive flexion of every source, and as measured.
pub fn figure8(sources: &[Source], measured: &[Passive]) -> String {
    draw((1020, 360), |root| {
        let panels = [(3, "AP", "Anterior (mm)"), (1, "IE", "External (deg)"), (0, "VV", "Valgus (deg)")];
        for (n, (area, (c, title, y))) in root.split_evenly((1, 3)).iter().zip(panels).enumerate() {
            let simulated = sources.iter().enumerate().map(|(k, s)| Series {
                name: s.name.clone(),
                points: s.passive_flexion.iter().map(|r| (r.pose.fe_deg, r.predicted()[c])).collect(),
                colour: colour(k),
                line: true,
                thin: false,
            });
            let experiments = measured.iter().enumerate().map(|(k, m)| Series {
                name: format!("{} experiment", m.name),
                points: m
                    .poses
                    .iter()
                    .map(|p| (p.fe_deg, [p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm][c]))
                    .collect(),
                colour: colour(sources.iter().position(|s| s.name == m.name).unwrap_or(sources.len() + k)),
                line: false,
                thin: true,
            });
            let series: Vec<Series> = simulated.chain(experiments).collect();
            panel(area, (title, "Flexion (deg)", y), &series, n == 0)?;
        }
        Ok(())
    })
}
