//! The rows of cadavers.csv, read and checked. What each source is and how it was read: docs/drawers.md.

use genu::error::BuildError;
use serde::Deserialize;
use sim::coordinate::Coordinate;
use sim::laxity::{TESTS, Test};

/// The table beside this file.
const TABLE: &str = include_str!("cadavers.csv");
/// What no cut is called.
const INTACT: &str = "intact";

/// What stands in brackets behind a mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Spread {
    /// A standard deviation.
    Sd,
    /// An error bar whose kind was not told.
    Bar,
    /// Nothing.
    Untold,
}

/// A line of the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    source: String,
    n: Option<u32>,
    load: f64,
    test: String,
    state: String,
    fe_deg: f64,
    mean: f64,
    sd: Option<f64>,
    spread: Spread,
    unit: String,
}

/// A load in one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Push {
    /// Its name.
    pub(crate) test: Test,
    /// What it loads.
    pub(crate) coordinate: Coordinate,
    /// Its clinical sign [-].
    pub(crate) sign: f64,
}

/// What cadavers did under a load.
#[derive(Debug)]
pub(crate) struct Row {
    /// Key in docs/bibliography.bib.
    pub(crate) source: String,
    /// Knees; none where they were not told.
    pub(crate) knees: Option<u32>,
    /// Size of the load [N m, N].
    pub(crate) load: f64,
    /// Its name in the file.
    pub(crate) test: String,
    /// Its directions; the motions of two are one range.
    pub(crate) pushes: Vec<Push>,
    /// Its name in the file.
    pub(crate) state: String,
    /// Ligaments cut.
    pub(crate) cut: Vec<String>,
    /// Flexion [deg].
    pub(crate) fe_deg: f64,
    /// Mean of the motion [deg, mm].
    pub(crate) mean: f64,
    /// Its scatter [deg, mm]; none where it was not told.
    pub(crate) sd: Option<f64>,
    /// What the scatter is.
    pub(crate) spread: Spread,
    /// Unit of the motion.
    pub(crate) unit: &'static str,
}

impl Row {
    /// Test and load in words: "internal 5 N m".
    pub(crate) fn test_told(&self) -> String {
        let unit = self.pushes.first().map_or("", |p| p.coordinate.load_unit());
        format!("{} {} {unit}", self.test, self.load)
    }

    /// The source, with its knees where they were told.
    pub(crate) fn source_told(&self) -> String {
        self.knees.map_or(self.source.clone(), |n| format!("{} ({n})", self.source))
    }

    /// The cadavers' mean and scatter in words.
    pub(crate) fn cadavers_told(&self) -> String {
        match (self.spread, self.sd) {
            (Spread::Sd, Some(sd)) => format!("{} ({sd})", self.mean),
            (Spread::Bar, Some(bar)) => format!("{} (bar {bar})", self.mean),
            _ => format!("{}", self.mean),
        }
    }
}

/// Every row, in the order of the file.
///
/// Errors: a line that is not as the file's head says; each names the line.
pub(crate) fn rows() -> Result<Vec<Row>, BuildError> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(TABLE.as_bytes());
    let fault = |told: String| BuildError::File(format!("examples/drawers/cadavers.csv: {told}"));
    let mut out = Vec::new();
    for line in reader.deserialize::<Line>() {
        let line = line.map_err(|e| fault(e.to_string()))?;
        let name = format!("{}, {} {}, {}, {} deg", line.source, line.test, line.load, line.state, line.fe_deg);
        out.push(row(line).map_err(|told| fault(format!("{name}: {told}")))?);
    }
    Ok(out)
}

/// A row of a line; else what is wrong with it.
fn row(line: Line) -> Result<Row, String> {
    let pushes: Vec<Push> = line.test.split('-').map(push).collect::<Result<_, _>>()?;
    let unit = pushes.first().map_or("", |p| p.coordinate.unit());
    if unit != line.unit || pushes.iter().any(|p| p.coordinate.unit() != unit) {
        return Err(format!("the unit is {}; the test moves in {unit}", line.unit));
    }
    if !(line.load > 0.0 && line.mean.is_finite() && line.fe_deg.is_finite()) {
        return Err("expected a load above 0, a flexion and a mean".into());
    }
    let is_told = line.spread != Spread::Untold;
    if is_told != line.sd.is_some_and(|sd| sd > 0.0) || is_told != line.sd.is_some() {
        return Err("expected an sd above 0, or none and the spread untold".into());
    }
    let cut = match line.state.as_str() {
        INTACT => Vec::new(),
        state => state.split('+').map(str::to_owned).collect(),
    };
    Ok(Row {
        source: line.source,
        knees: line.n,
        load: line.load,
        test: line.test,
        pushes,
        state: line.state,
        cut,
        fe_deg: line.fe_deg,
        mean: line.mean,
        sd: line.sd,
        spread: line.spread,
        unit,
    })
}

/// The load of a test's name, in the signs of the coordinates: valgus, external and anterior are positive.
fn push(name: &str) -> Result<Push, String> {
    let fault =
        || format!("no load is named {name:?}; expected anterior, posterior, internal, external, varus, valgus");
    let (test, _) = TESTS.into_iter().find(|(_, known)| *known == name).ok_or_else(fault)?;
    let coordinate = test.coordinate().ok_or_else(fault)?;
    let is_positive = matches!(test, Test::Anterior | Test::External | Test::Valgus);
    Ok(Push { test, coordinate, sign: if is_positive { 1.0 } else { -1.0 } })
}
