//! Ligament forces of a calibrated knee: what is asked of them, and what the data say of each bundle's force in the drawers as
//! intervals (`10-calibrate/SOURCE/forces.csv`).

use super::{Calibrate, Check, Stage, check};
use crate::report::chart::{COLOURS, Chart, layout};
use crate::stage::View;
use crate::store::BuildFolder;
use crate::which_model::JOINT;
use calibration::calibrate::Calibrated;
use calibration::posterior::FORCE_DETERMINED_N;
use calibration::reports::{error_words, share_words};
use calibration::session::ap_probes;
use plotly::common::{ErrorData, ErrorType, Marker, Mode};
use plotly::layout::Axis;
use plotly::{Plot, Scatter};
use sim::laxity::{LaxityTrial, Test};
use stages::assemble::Assembled;
use std::collections::BTreeMap;

/// Tension of all ligaments without load that a knee may have, 0 to 90 deg [N]. Published parameters on a knee give 9 to 109 N.
const MOST_REST_N: f64 = 250.0;
/// Force of a cruciate under the drawer that its antagonist holds [N]. The paper has none [andreassen2025, table 5].
const MOST_ANTAGONIST_N: f64 = 20.0;

/// Tension at rest, cruciates against each other, forces that laxity leaves open.
pub(super) fn checks(name: &str, found: &Calibrated, assembled: Option<&Assembled>) -> Vec<Check> {
    let mut out = Vec::new();
    let share = found.unknowns.interval;
    if let Some(most) = found.rest.iter().max_by(|a, b| a.value_n.total_cmp(&b.value_n)) {
        out.push(Check {
            question: "How tense are the ligaments without load?",
            answer: format!(
                "at most {:.0} N in all, at {:.0} deg ({} by {} samples; limit {MOST_REST_N:.0} N)",
                most.value_n,
                most.fe_deg,
                interval(most.interval_n, share),
                found.samples.len()
            ),
            good: Some(check::at_most(most.value_n, MOST_REST_N, 0)),
            reaches: reaches(most.interval_n, MOST_REST_N),
            model: Some(name.to_owned()),
            stage: Calibrate::NAME,
        });
    }
    let Some(bundles) = assembled.map(|a| &a.spec.bundles) else { return out };
    let forces = found.forces.iter().filter_map(|f| Some((f, bundles.get(f.bundle)?.name.as_str(), f.value_n?)));
    let probes = ap_probes();
    let antagonist = forces.clone().filter(|(f, bundle, _)| {
        let test = probes.iter().find(|p| p.trial == f.trial).map(|p| p.test);
        let against = if test == Some(Test::Anterior) { "PCL" } else { "ACL" };
        bundle.starts_with(against)
    });
    if let Some((f, bundle, most)) = antagonist.max_by(|a, b| a.2.total_cmp(&b.2)) {
        out.push(Check {
            question: "Does a cruciate pull against a drawer that the other holds?",
            answer: format!(
                "at most {most:.0} N, in {} under the {} ({}; limit {MOST_ANTAGONIST_N:.0} N)",
                bundle.replace('_', " "),
                probes.iter().find(|p| p.trial == f.trial).map_or(f.trial.clone(), drawer),
                interval(f.interval_n, share)
            ),
            good: Some(check::at_most(most, MOST_ANTAGONIST_N, 0)),
            reaches: reaches(f.interval_n, MOST_ANTAGONIST_N),
            model: Some(name.to_owned()),
            stage: Calibrate::NAME,
        });
    }
    // an interval counts from the value that stands beside it
    let reaches_far = |(value, ends): (f64, [f64; 2])| ends.iter().any(|e| (e - value).abs() > FORCE_DETERMINED_N);
    let open = forces.clone().filter_map(|(f, ..)| f.value_n.zip(f.interval_n)).filter(|f| reaches_far(*f)).count();
    let before = forces.clone().filter_map(|(f, ..)| f.unmeasured).map(|[value, lower, upper]| (value, [lower, upper]));
    let unmeasured = match before.clone().count() {
        0 => String::new(),
        count => format!("; with nothing measured {} of {count} do", before.filter(|f| reaches_far(*f)).count()),
    };
    let all = forces.count();
    if all > 0 {
        let told = [share_words(found), error_words(found)].into_iter().filter(|words| !words.is_empty());
        let told: String = told.map(|words| format!("; {words}")).collect();
        let next = found.next_tests.first().map_or(String::new(), |t| format!("; {}", t.words()));
        out.push(Check {
            question: "Which ligament forces does laxity leave open?",
            answer: format!(
                "{open} of {all} bundle forces under drawers have a {} that reaches more than {FORCE_DETERMINED_N:.0} N from the value{unmeasured}{told}{next}",
                named(share)
            ),
            good: None,
            reaches: None,
            model: Some(name.to_owned()),
            stage: Calibrate::NAME,
        });
    }
    out
}

/// A drawer in words.
fn drawer(probe: &LaxityTrial) -> String {
    format!("{} drawer at {:.0} deg", probe.test.name(), probe.fe_deg)
}

/// An interval that holds this share of the samples, in words.
fn interval(interval_n: Option<[f64; 2]>, share: f64) -> String {
    interval_n.map_or("no interval: most samples leave the plateau, or fewer than two count".to_owned(), |ends| {
        let [lower, upper] = ends;
        format!("{} {lower:.0} to {upper:.0} N", named(share))
    })
}

/// An interval that holds this share of the samples.
fn named(share: f64) -> String {
    format!("{:.0} % interval", 100.0 * share)
}

/// The upper end of an interval where it is beyond the limit.
fn reaches(interval_n: Option<[f64; 2]>, limit_n: f64) -> Option<String> {
    let [_, upper_n] = interval_n?;
    (!check::at_most(upper_n, limit_n, 0)).then(|| format!("{upper_n:.0} N"))
}

/// A row of forces.csv.
struct Force {
    bundle: String,
    value: f64,
    lower: f64,
    upper: f64,
}

/// A chart a source: the interval of every bundle's force in each trial; `samples` knows how many there are of a source, and how many an interval holds [-].
pub(super) fn charts(folder: &BuildFolder, samples: &dyn Fn(&str) -> (usize, f64)) -> Vec<Chart> {
    let mut files: Vec<_> = folder.read_folder(&Calibrate.folder()).unwrap_or_default().into_iter().collect();
    // the knee first
    files.sort_by_key(|(name, _)| !name.starts_with(&format!("{JOINT}/")));
    files
        .iter()
        .filter_map(|(name, bytes)| Some((name.strip_suffix("/forces.csv")?, rows(bytes)?)))
        .map(|(source, rows)| chart(source, &rows, samples(source)))
        .collect()
}

/// Rows by trial; `None` where the table is not as expected.
fn rows(bytes: &[u8]) -> Option<BTreeMap<String, Vec<Force>>> {
    let mut reader = csv::Reader::from_reader(bytes);
    let header = reader.headers().ok()?.clone();
    let at = |name: &str| header.iter().position(|h| h == name);
    let places = [at("trial")?, at("bundle")?, at("value_n")?, at("lower_n")?, at("upper_n")?];
    let mut out: BTreeMap<String, Vec<Force>> = BTreeMap::new();
    for record in reader.records() {
        let record = record.ok()?;
        let cell = |k: usize| record.get(places[k]).unwrap_or("");
        let number = |k: usize| cell(k).parse::<f64>().ok();
        let force = Force { bundle: cell(1).into(), value: number(2)?, lower: number(3)?, upper: number(4)? };
        // a force without an interval has no bar
        if !(force.lower.is_finite() && force.upper.is_finite()) {
            continue;
        }
        out.entry(cell(0).into()).or_default().push(force);
    }
    (!out.is_empty()).then_some(out)
}

fn chart(source: &str, trials: &BTreeMap<String, Vec<Force>>, (samples, share): (usize, f64)) -> Chart {
    let mut plot = Plot::new();
    let mut widest: Option<(&Force, &str)> = None;
    let mut bundles: Vec<&str> = trials.values().flatten().map(|f| f.bundle.as_str()).collect();
    let mut met = std::collections::BTreeSet::new();
    bundles.retain(|b| met.insert(*b));
    let middle = (trials.len() as f64 - 1.0) / 2.0;
    for (k, ((trial, forces), colour)) in trials.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let shift = 0.8 * (k as f64 - middle) / trials.len() as f64;
        let error = ErrorData::new(ErrorType::Data)
            .array(forces.iter().map(|f| (f.upper - f.value).max(0.0)).collect())
            .array_minus(forces.iter().map(|f| (f.value - f.lower).max(0.0)).collect())
            .symmetric(false);
        let place = |f: &Force| bundles.iter().position(|b| *b == f.bundle).map_or(f64::NAN, |n| n as f64 + shift);
        let names: Vec<f64> = forces.iter().map(place).collect();
        let values: Vec<f64> = forces.iter().map(|f| f.value).collect();
        let marker = Marker::new().color(*colour).size(7);
        plot.add_trace(Scatter::new(names, values).mode(Mode::Markers).name(trial).marker(marker).error_y(error));
        for f in forces {
            if widest.is_none_or(|(w, _)| f.upper - f.lower > w.upper - w.lower) {
                widest = Some((f, trial));
            }
        }
    }
    let ticks = (0..bundles.len()).map(|n| n as f64).collect();
    let axis =
        Axis::new().tick_values(ticks).tick_text(bundles.clone()).tick_angle(-45.0).show_grid(false).zero_line(false);
    plot.set_layout(layout("", "force [N]").x_axis(axis));
    let least = widest.map_or(String::new(), |(f, trial)| {
        format!(" Least certain: {} in {trial}, {:.0} to {:.0} N.", f.bundle, f.lower, f.upper)
    });
    Chart {
        id: format!("forces-{source}"),
        title: format!("{source}: ligament forces in the drawers, as intervals"),
        text: format!(
            "The force of every bundle at 133 N anterior and posterior, with the {} that the data leave, by {samples} samples of the posterior.{least}",
            named(share)
        ),
        plot: plot.to_json(),
    }
}
