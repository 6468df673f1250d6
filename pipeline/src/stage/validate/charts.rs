//! Charts of the calibrated knee: ligament and contact forces against flexion and load, with intervals where samples were asked.

use crate::report::chart::{COLOURS, Chart, layout};
use crate::report::number::{fixed, with_interval};
use attachments::groups::GROUPS;
use plotly::common::{ErrorData, ErrorType, Fill, Line, Marker, Mode};
use plotly::layout::BarMode;
use plotly::{Bar, Plot, Scatter};
use sim::laxity::{Band, Test, TrialResult, force_column};
use validation::validate::Source;

/// Force of a ligament below which a chart leaves it out, as the paper's tables do [N].
const LEAST_N: f64 = 5.0;

/// A value with its band, where there is one.
type Told = (f64, Option<Band>);

/// A line of a chart.
struct Curve {
    name: String,
    /// Its own in every chart, whatever other lines there are.
    colour: &'static str,
    /// Place and value.
    points: Vec<(f64, Told)>,
}

/// The charts of the knee, the first source of a validation.
pub(super) fn charts(s: &Source) -> Vec<Chart> {
    let passive: Vec<&TrialResult> = s.passive_flexion.iter().filter(|r| Source::has_answer(r)).collect();
    let drawer = |test| s.ap_flexions().into_iter().filter_map(|fe| s.ap_end(test, fe)).collect::<Vec<_>>();
    let sets = [
        ("passive", "passive flexion", passive),
        ("anterior", "the anterior drawer", drawer(Test::Anterior)),
        ("posterior", "the posterior drawer", drawer(Test::Posterior)),
    ];
    let mut out = Vec::new();
    for (id, words, rows) in &sets {
        out.extend(against_flexion(s, id, words, rows, &ligaments(s, rows), ("N", "Ligament forces")));
    }
    out.extend(pivot(s));
    for (id, words, rows) in &sets {
        let force = compartments(rows, "force_n");
        out.extend(against_flexion(s, &format!("contact-{id}"), words, rows, &force, ("N", "Contact force")));
    }
    let (id, words, rows) = &sets[0];
    let peak = compartments(rows, "peak_mpa");
    out.extend(against_flexion(s, &format!("pressure-{id}"), words, rows, &peak, ("MPa", "Peak contact pressure")));
    out
}

/// A group's force in a result, with its band: that of its sum, or of its one bundle.
pub(super) fn ligament(s: &Source, r: &TrialResult, group: usize) -> Told {
    let (name, bundles) = GROUPS[group];
    // of several bundles no single one's band is the sum's
    let of_bundle = || {
        let mut bands = bundles.iter().filter_map(|b| r.band(&force_column(b)));
        bands.next().filter(|_| bands.next().is_none())
    };
    (s.groups(r)[group], r.band(&format!("group_{name}_n")).or_else(of_bundle))
}

/// What the contact of a compartment tells, with its band.
pub(super) fn contact(r: &TrialResult, side: &str, what: &str) -> Option<Told> {
    let column = format!("contact_{side}_{what}");
    let value = r.outputs.iter().find(|(name, _)| *name == column)?.1;
    Some((value, r.band(&column)))
}

fn ligaments(s: &Source, rows: &[&TrialResult]) -> Vec<Curve> {
    let curve = |(g, (name, _)): (usize, &(&str, &[&str]))| Curve {
        name: (*name).to_owned(),
        colour: COLOURS[g % COLOURS.len()],
        points: rows.iter().map(|r| (r.pose.fe_deg, ligament(s, r, g))).collect(),
    };
    let most = |c: &Curve| c.points.iter().map(|(_, (f, b))| b.map_or(*f, |b| b.upper.max(*f))).fold(0.0, f64::max);
    GROUPS.iter().enumerate().map(curve).filter(|c| most(c) >= LEAST_N).collect()
}

fn compartments(rows: &[&TrialResult], what: &str) -> Vec<Curve> {
    let of = |(side, colour): (&str, &'static str)| Curve {
        name: side.to_owned(),
        colour,
        points: rows.iter().filter_map(|r| Some((r.pose.fe_deg, contact(r, side, what)?))).collect(),
    };
    [("medial", COLOURS[0]), ("lateral", COLOURS[1])].map(of).into_iter().filter(|c| !c.points.is_empty()).collect()
}

/// Lines over flexion, the band behind each.
fn against_flexion(
    s: &Source,
    id: &str,
    words: &str,
    rows: &[&TrialResult],
    curves: &[Curve],
    (unit, what): (&str, &str),
) -> Option<Chart> {
    if curves.is_empty() || rows.len() < 2 {
        return None;
    }
    let axis = if unit == "N" { "force [N]" } else { "peak pressure [MPa]" };
    let mut plot = Plot::new();
    let banded = curves.iter().any(|c| c.points.iter().any(|(_, (_, b))| b.is_some()));
    for curve in curves {
        let colour = curve.colour;
        band(&mut plot, curve);
        let line = |at: &(f64, Told)| at.1.1.map_or(at.1.0, |b| b.mean);
        let (x, y): (Vec<f64>, Vec<f64>) = curve.points.iter().map(|p| (p.0, line(p))).unzip();
        let trace = Scatter::new(x, y).mode(Mode::LinesMarkers).name(&curve.name);
        plot.add_trace(trace.line(Line::new().color(colour)).marker(Marker::new().color(colour).size(5)));
    }
    plot.set_layout(layout("flexion [deg]", axis));
    let told: Vec<String> = curves.iter().filter_map(|c| most(c, unit)).collect();
    let how = if banded {
        format!("Means with their 90 % intervals (shaded), by {} samples.", s.samples)
    } else {
        "Most probable values; no samples were asked, so no intervals.".to_owned()
    };
    Some(Chart {
        id: format!("{}-{id}", s.name),
        title: format!("{what} in {words}"),
        text: format!(
            "{what} of the model {} in {words}, against flexion. {how} Largest: {}.",
            s.name,
            told.join("; ")
        ),
        plot: plot.to_json(),
    })
}

/// How many samples the intervals of a source are by, in words that go on; nothing where none were asked.
pub(super) fn by_samples(s: &Source) -> String {
    if s.samples == 0 { String::new() } else { format!(", means with 90 % intervals by {} samples", s.samples) }
}

/// The largest value of a curve, in words.
fn most(c: &Curve, unit: &str) -> Option<String> {
    let value = |t: &Told| t.1.map_or(t.0, |b| b.mean);
    let (fe, told) = *c.points.iter().max_by(|a, b| value(&a.1).total_cmp(&value(&b.1)))?;
    Some(format!("{} {} {unit} at {} deg", c.name, number(&told), fixed(fe, 0)))
}

/// What reaches further is told without decimals [N, mm2, MPa].
const WHOLE_FROM: f64 = 20.0;

/// A value in words, its interval in brackets.
pub(super) fn number(told: &Told) -> String {
    match told {
        (_, Some(b)) => with_interval(b.mean, b.lower, b.upper, usize::from(b.upper < WHOLE_FROM)),
        (v, None) => fixed(*v, usize::from(*v < WHOLE_FROM)),
    }
}

/// The band of a curve as a filled strip.
fn band(plot: &mut Plot, curve: &Curve) {
    let colour = curve.colour;
    let points: Vec<(f64, Band)> = curve.points.iter().filter_map(|(x, (_, b))| Some((*x, (*b)?))).collect();
    if points.is_empty() {
        return;
    }
    let edge = |of: fn(&Band) -> f64| {
        let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|(x, b)| (*x, of(b))).unzip();
        Scatter::new(x, y)
            .mode(Mode::Lines)
            .show_legend(false)
            .name(format!("{}, 90 % interval", curve.name))
            .line(Line::new().color(colour.to_owned()).width(0.0))
    };
    plot.add_trace(edge(|b| b.lower));
    plot.add_trace(edge(|b| b.upper).fill(Fill::ToNextY).fill_color(format!("{colour}33")));
}

/// The end of the pivot shift with and without ACL, a bar a ligament.
fn pivot(s: &Source) -> Option<Chart> {
    let mut plot = Plot::new();
    let mut told = Vec::new();
    for ((acl, name), colour) in [(true, "intact"), (false, "without ACL")].into_iter().zip(COLOURS) {
        let Some(r) = s.pivot_end(acl) else { continue };
        let all: Vec<Told> = (0..GROUPS.len()).map(|g| ligament(s, r, g)).collect();
        let values: Vec<f64> = all.iter().map(|(v, b)| b.map_or(*v, |b| b.mean)).collect();
        let names: Vec<&str> = GROUPS.iter().map(|(g, _)| *g).collect();
        let mut bar = Bar::new(names, values).name(name).marker(Marker::new().color(colour));
        if all.iter().all(|(_, b)| b.is_some()) {
            let reach = |of: fn(&Band) -> f64| all.iter().filter_map(|(_, b)| b.as_ref().map(of)).collect::<Vec<f64>>();
            let error = ErrorData::new(ErrorType::Data)
                .array(reach(|b| (b.upper - b.mean).max(0.0)))
                .array_minus(reach(|b| (b.mean - b.lower).max(0.0)))
                .symmetric(false);
            bar = bar.error_y(error);
        }
        plot.add_trace(bar);
        let strong = all.iter().zip(GROUPS).filter(|((v, _), _)| *v >= LEAST_N);
        let words: Vec<String> = strong.map(|(t, (g, _))| format!("{g} {} N", number(t))).collect();
        told.push(format!("{name}: {}", words.join(", ")));
    }
    if told.is_empty() {
        return None;
    }
    plot.set_layout(layout("", "force [N]").bar_mode(BarMode::Group));
    Some(Chart {
        id: format!("{}-pivot", s.name),
        title: "Ligament forces at the end of the pivot shift".into(),
        text: format!("Model {}{}. {}.", s.name, by_samples(s), told.join(". ")),
        plot: plot.to_json(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ligament_has_a_colour_of_its_own() {
        // ligaments() takes them by number
        assert!(GROUPS.len() <= COLOURS.len());
        let all: std::collections::BTreeSet<&str> = COLOURS[..GROUPS.len()].iter().copied().collect();
        assert_eq!(all.len(), GROUPS.len());
    }

    #[test]
    fn a_value_is_told_with_its_interval_where_there_is_one() {
        let band = Band { mean: 31.2, lower: 12.0, upper: 55.5 };
        assert_eq!(number(&(28.0, Some(band))), "31 (12 to 56)");
        assert_eq!(number(&(28.4, None)), "28");
        assert_eq!(number(&(2.44, None)), "2.4");
    }
}
