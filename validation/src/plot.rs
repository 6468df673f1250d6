//! Panels of lines and points as SVG.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// Where a panel is painted.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Whether it was.
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

type Plane = Cartesian2d<RangedCoordf64, RangedCoordf64>;

/// Colours of sources, in their order [okabe2008].
const COLOURS: [RGBColor; 4] =
    [RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

/// Of what was measured.
pub const INK: RGBColor = RGBColor(40, 40, 40);

/// Colour of the source `k`.
pub fn colour(k: usize) -> RGBColor {
    COLOURS[k % COLOURS.len()]
}

/// A line or points of a panel.
pub struct Series {
    /// Its name in the legend; without one the bars alone are drawn.
    pub name: String,
    /// Its points, in the units of the axes.
    pub points: Vec<(f64, f64)>,
    /// Half the height of the bar at each point, in the unit of the vertical axis; empty for none.
    pub spread: Vec<f64>,
    /// Its colour.
    pub colour: RGBColor,
    /// Points only where false.
    pub line: bool,
    /// Thin, for what was measured.
    pub thin: bool,
}

/// Draws to a string of SVG of `size` [pixels]; empty where drawing fails.
pub fn draw(size: (u32, u32), paint: impl FnOnce(&Area) -> Drawn) -> String {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        if root.fill(&WHITE).is_err() || paint(&root).is_err() || root.present().is_err() {
            return String::new();
        }
    }
    svg
}

/// One panel of lines and points under a title, with names of both axes, and a legend where asked for.
pub fn panel(area: &Area, labels: (&str, &str, &str), series: &[Series], legend: bool) -> Drawn {
    let ends = |s: &Series, k: usize, (x, y): (f64, f64)| {
        let half = s.spread.get(k).copied().unwrap_or(0.0);
        [(x, y - half), (x, y + half)]
    };
    let all: Vec<(f64, f64)> =
        series.iter().flat_map(|s| s.points.iter().enumerate().flat_map(move |(k, p)| ends(s, k, *p))).collect();
    let span = |pick: &dyn Fn(&(f64, f64)) -> f64| {
        let (low, high) = all
            .iter()
            .map(pick)
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let room = (0.06 * (high - low)).max(0.5);
        if low > high { (0.0, 1.0) } else { (low - room, high + room) }
    };
    let ((x0, x1), (y0, data_top)) = (span(&|p| p.0), span(&|p| p.1));
    // room above the data for the legend: about 18 pixels a name, of what captions and axes leave
    let plot = (f64::from(area.dim_in_pixel().1) - 80.0).max(1.0);
    let share = if legend {
        ((18.0 * series.iter().filter(|s| !s.name.is_empty()).count() as f64 + 14.0) / plot).min(0.5)
    } else {
        0.0
    };
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
        .x_labels((area.dim_in_pixel().0 / 55) as usize)
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style(("sans-serif", 12))
        .draw()?;
    for s in series {
        bars(&mut chart, s)?;
        if s.name.is_empty() {
            continue;
        }
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

/// Bars of a series, up and down from its points.
fn bars<'a>(chart: &mut ChartContext<'a, SVGBackend<'a>, Plane>, s: &Series) -> Drawn {
    let both = s.points.iter().zip(&s.spread).filter(|(p, h)| p.0.is_finite() && p.1.is_finite() && h.is_finite());
    chart.draw_series(both.map(|(p, h)| PathElement::new(vec![(p.0, p.1 - h), (p.0, p.1 + h)], s.colour)))?;
    Ok(())
}
