//! Ligament forces as intervals: what the data say of each bundle's force in the drawers (`10-calibrate/SOURCE/forces.csv`).

use super::chart::{COLOURS, Chart, layout};
use crate::record::folder_name;
use crate::store::BuildFolder;
use plotly::common::{ErrorData, ErrorType, Marker, Mode};
use plotly::layout::BarMode;
use plotly::{Plot, Scatter};
use std::collections::BTreeMap;

/// A row of forces.csv.
struct Force {
    bundle: String,
    value: f64,
    lower: f64,
    upper: f64,
}

/// A chart a source: the interval of every bundle's force in each trial.
pub(super) fn charts(folder: &BuildFolder) -> Vec<Chart> {
    let files = folder.read_folder(&folder_name("calibrate")).unwrap_or_default();
    files
        .iter()
        .filter_map(|(name, bytes)| Some((name.strip_suffix("/forces.csv")?, rows(bytes)?)))
        .map(|(source, rows)| chart(source, &rows))
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
        out.entry(cell(0).into()).or_default().push(force);
    }
    (!out.is_empty()).then_some(out)
}

fn chart(source: &str, trials: &BTreeMap<String, Vec<Force>>) -> Chart {
    let mut plot = Plot::new();
    let mut widest: Option<(&Force, &str)> = None;
    for ((trial, forces), colour) in trials.iter().zip(COLOURS.iter().cycle()) {
        let error = ErrorData::new(ErrorType::Data)
            .array(forces.iter().map(|f| (f.upper - f.value).max(0.0)).collect())
            .array_minus(forces.iter().map(|f| (f.value - f.lower).max(0.0)).collect())
            .symmetric(false);
        let names: Vec<String> = forces.iter().map(|f| f.bundle.clone()).collect();
        let values: Vec<f64> = forces.iter().map(|f| f.value).collect();
        let marker = Marker::new().color(*colour).size(7);
        plot.add_trace(Scatter::new(names, values).mode(Mode::Markers).name(trial).marker(marker).error_y(error));
        for f in forces {
            if widest.is_none_or(|(w, _)| f.upper - f.lower > w.upper - w.lower) {
                widest = Some((f, trial));
            }
        }
    }
    plot.set_layout(layout("", "force [N]").bar_mode(BarMode::Group));
    let least = widest.map_or(String::new(), |(f, trial)| {
        format!(" Least certain: {} in {trial}, {:.0} to {:.0} N.", f.bundle, f.lower, f.upper)
    });
    Chart {
        id: format!("forces-{source}"),
        title: format!("{source}: ligament forces in the drawers, as intervals"),
        text: format!(
            "The force of every bundle at 133 N anterior and posterior, with the interval that the data leave.{least}"
        ),
        plot: plot.to_json(),
    }
}
