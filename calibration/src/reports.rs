//! What a calibration leaves behind, as CSV and as numbers for metrics.json.

use crate::calibrate::Calibrated;
use crate::cost::residual;
use crate::options::Method;
use crate::posterior::share::LEAST;
use crate::posterior::{ForceEstimate, error_of_ends, is_outside, mean};
use crate::session::Outcome;
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, FREE, Free};
use sim::flags::Flag;
use sim::laxity::{WITHOUT_COLUMN, cut_cell};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Its tables, by name.
pub fn files(outcome: &Outcome) -> Vec<(String, Vec<u8>)> {
    let bundles: Vec<String> = outcome.spec.bundles.iter().map(|b| b.name.clone()).collect();
    let mut tables = vec![
        ("parameters.csv", parameters(&outcome.found)),
        ("history.csv", history(&outcome.found.history)),
        ("frames.csv", frames(&outcome.found)),
        ("noise.csv", noise(&outcome.found)),
        ("rest.csv", rest(&outcome.found)),
        ("next_tests.csv", next_tests(&outcome.found)),
        ("forces.csv", forces(&outcome.found, &bundles)),
        ("fit.csv", fit(outcome)),
        ("starts.csv", points(&outcome.found, true)),
    ];
    // a posterior's samples have a file of their own, with every unknown
    if outcome.found.unknowns.unknowns.is_empty() {
        tables.push(("samples.csv", points(&outcome.found, false)));
    }
    tables.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes())).collect()
}

/// parameters.csv: `lower` and `upper` are the ends of the interval, `range_lower` and `range_upper` those of the range sought in.
pub fn parameters(found: &Calibrated) -> String {
    let mut out = "design_variable,bundle,kind,value,lower,upper,range_lower,range_upper,determined\n".to_owned();
    for p in found.parameters.iter() {
        let _ = writeln!(
            out,
            "X{},{},{},{:.6},{:.6},{:.6},{},{},{:.3}",
            p.number,
            p.bundle,
            p.kind.name(),
            p.value,
            p.lower,
            p.upper,
            p.range[0],
            p.range[1],
            p.determined
        );
    }
    out
}

/// frames.csv: turns and shifts of the frames, of all data sets and of each its own, and what else is no ligament's.
fn frames(found: &Calibrated) -> String {
    let mut out = "name,value,lower,upper,prior_lower,prior_upper,determined,z\n".to_owned();
    for p in &found.others {
        let (prior, name) = (p.prior, &p.name);
        let _ = writeln!(
            out,
            "{name},{:.4},{:.4},{:.4},{:.3},{:.3},{:.3},{:.2}",
            p.value, p.lower, p.upper, prior[0], prior[1], p.determined, p.z
        );
    }
    out
}

/// noise.csv: noise of each data set and coordinate, as stated and as inferred, one standard deviation [deg or mm].
fn noise(found: &Calibrated) -> String {
    let mut out = "source,coordinate,stated,inferred,lower,upper\n".to_owned();
    for n in &found.noise {
        let (source, coordinate) = (&n.source, &n.coordinate);
        // what four digits would round to nothing keeps its own
        let cell = |x: f64| if x < 1e-3 { format!("{x:.4e}") } else { format!("{x:.4}") };
        let [stated, inferred, lower, upper] = [n.stated, n.inferred, n.lower, n.upper].map(cell);
        let _ = writeln!(out, "{source},{coordinate},{stated},{inferred},{lower},{upper}");
    }
    out
}

/// next_tests.csv: tests by displacement from the unloaded knee that would narrow the forces in the drawers most, the best first: standard
/// deviation of a bundle's force, mean over bundles and drawers [N], now and expected with the test.
fn next_tests(found: &Calibrated) -> String {
    let mut out = "test,flexion_deg,load,unit,sd_now_n,sd_after_n\n".to_owned();
    for t in &found.next_tests {
        let unit = t.test.coordinate().map_or("", Coordinate::load_suffix);
        let (test, now, after) = (t.test.name(), t.sd_now_n, t.sd_after_n);
        let _ = writeln!(out, "{test},{},{},{unit},{now:.3},{after:.3}", t.flexion_deg, t.load);
    }
    out
}

/// rest.csv: tension of all ligaments together without load but 20 N of compression [N]: the best estimate and its interval, the single most probable
/// model twice (`model_n` is its old name), the samples' mean, whether that model lies outside the interval, and how many samples leave the plateau.
fn rest(found: &Calibrated) -> String {
    let mut out = "fe_deg,value_n,lower_n,upper_n,model_n,mean_n,mode_n,outside,leaving\n".to_owned();
    for r in &found.rest {
        let outside = r.interval_n.is_some_and(|i| is_outside(r.mode_n, i));
        let ends = ends(r.interval_n);
        let _ = writeln!(
            out,
            "{},{:.3},{ends},{:.3},{:.3},{:.3},{outside},{}",
            r.fe_deg, r.value_n, r.mode_n, r.value_n, r.mode_n, r.leaving
        );
    }
    out
}

/// Both ends of an interval as two cells; `nan` where there is none, which readers of numbers take.
fn ends(interval_n: Option<[f64; 2]>) -> String {
    interval_n.map_or("nan,nan".to_owned(), |[lower, upper]| format!("{lower:.3},{upper:.3}"))
}

/// A line about forces that are told with their intervals: how many of the single most probable model lie outside them, and how many samples at most
/// are left out of one; empty where neither is.
pub fn outside_words(found: &Calibrated) -> String {
    let outside = found.forces.iter().filter(|f| f.mode_is_outside()).count();
    let leaving = found.forces.iter().map(|f| f.leaving).chain(found.rest.iter().map(|r| r.leaving)).max().unwrap_or(0);
    let mut out = String::new();
    if outside > 0 {
        let of = found.forces.len();
        let _ = writeln!(
            out,
            "{outside} of {of} bundle forces of the single most probable model lie outside their interval (forces.csv, outside)"
        );
    }
    if leaving > 0 {
        let of = found.samples.len();
        let _ = writeln!(
            out,
            "up to {leaving} of {of} samples leave the plateau in a drawer or at rest, and do not count there"
        );
    }
    out
}

/// history.csv: what the method lowers and the best so far. Of a recipe it is the cost of every evaluation; of the method posterior, half the sum of
/// squares that each start left.
pub fn history(costs: &[f64]) -> String {
    let (mut out, mut best) = ("evaluation,cost,best_cost\n".to_owned(), f64::INFINITY);
    for (i, cost) in costs.iter().enumerate() {
        best = best.min(*cost);
        let _ = writeln!(out, "{},{cost:.6},{best:.6}", i + 1);
    }
    out
}

/// forces.csv: bundle forces in the AP tests with their intervals, and whether those stay within 15 N of the value; then what beliefs removed of the
/// variance before the measurements, and mean and interval with nothing measured; then the samples' mean and the single most probable model, whether
/// that lies outside the interval, and how many samples leave the plateau. `determined` and `believed` are 0 where chance may give as much: a 0 may
/// also be a variance that has grown. `removed`, the last column, is the data's share as the samples have it, below zero where it has grown.
fn forces(found: &Calibrated, bundles: &[String]) -> String {
    let mut out = "trial,bundle,value_n,lower_n,upper_n,determined,within_15_n".to_owned();
    out += ",believed,unmeasured_n,unmeasured_lower_n,unmeasured_upper_n,mean_n,mode_n,outside,leaving,removed\n";
    for f in &found.forces {
        let name = bundles.get(f.bundle).map_or("", String::as_str);
        let cell = |x: Option<f64>| x.map_or(String::new(), |v| format!("{v:.3}"));
        let [value, mean, mode] = [f.value_n, f.mean_n, f.mode_n].map(cell);
        let (trial, within) = (&f.trial, f.is_determined());
        let before = f.unmeasured.map_or(",,".to_owned(), |[v, a, b]| format!("{v:.3},{a:.3},{b:.3}"));
        let _ = writeln!(
            out,
            "{trial},{name},{value},{},{:.3},{within},{:.3},{before},{mean},{mode},{},{},{}",
            ends(f.interval_n),
            f.determined,
            f.believed,
            f.mode_is_outside(),
            f.leaving,
            cell(f.removed)
        );
    }
    out
}

/// fit.csv: measured, predicted by the model that is handed on, and their difference, a row a trial. Column `without` is there where a knee was cut.
fn fit(outcome: &Outcome) -> String {
    let mut out = "trial,test,nominal_flexion_deg,fe_deg".to_owned();
    for c in FREE {
        let name = c.column();
        let _ = write!(out, ",measured_{name},predicted_{name},residual_{name}");
    }
    let cut = outcome.trials.iter().any(|t| !t.without.is_empty());
    let _ = writeln!(out, ",flags{}", if cut { format!(",{WITHOUT_COLUMN}") } else { String::new() });
    for (i, (t, p)) in outcome.trials.iter().zip(&outcome.found.predicted).enumerate() {
        let named = outcome.name_of(i);
        let name = if named.contains([',', '"']) { format!("\"{}\"", named.replace('"', "\"\"")) } else { named };
        let _ = write!(out, "{name},{},{},{}", t.test.name(), t.nominal_flexion_deg, t.fe_deg);
        let residuals = p.as_ref().map(|p| residual(t, p));
        for c in FREE {
            let cell = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:.6}"));
            let _ = write!(
                out,
                ",{},{},{}",
                cell(t.measured[c]),
                cell(p.map(|p| p[c])),
                cell(residuals.and_then(|r| r[c]))
            );
        }
        let flag = outcome.found.elsewhere.contains(&i).then_some(Flag::Several);
        let _ = write!(out, ",{}", flag.map_or(String::new(), |f| f.to_string()));
        let _ = writeln!(out, "{}", if cut { format!(",{}", cut_cell(&t.without)) } else { String::new() });
    }
    out
}

/// starts.csv and samples.csv: design values found from different starts (with their cost), or samples of the posterior.
fn points(found: &Calibrated, starts: bool) -> String {
    let mut out = if starts { "cost,".to_owned() } else { String::new() };
    let names: Vec<String> = found.parameters.iter().map(|p| format!("X{}", p.number)).collect();
    out += &names.join(",");
    out.push('\n');
    let row = |values: &[f64]| values.iter().map(|v| format!("{v:.6}")).collect::<Vec<_>>().join(",") + "\n";
    if starts {
        found.rivals.iter().for_each(|(cost, p)| out += &format!("{cost:.6},{}", row(p)));
    } else {
        found.samples.iter().for_each(|p| out += &row(p));
    }
    out
}

/// The figures of a calibration, for metrics.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationMetrics {
    /// Cost of the calibrated model: the sum of cost.csv, and its square where a trial ends as far off as `cost.limit_mm` [andreassen2025].
    pub cost: f64,
    /// How many samples of equal weight the samples are worth by their importance weights [-]; `None` of a recipe and of too few.
    #[serde(default)]
    pub effective_samples: Option<f64>,
    /// Evaluations of the model.
    pub evaluations: usize,
    /// Shape of the tail of these weights [-] [vehtari2024]; `None` where one sample outweighs all.
    #[serde(default)]
    pub k_hat: Option<f64>,
    /// Lowest cost that was met.
    pub lowest_cost: f64,
    /// The method.
    pub method: Method,
    /// Factors on the stated noise, by column.
    pub noise_scale: BTreeMap<String, f64>,
    /// Parameters whose interval is less than half of what it was before the data.
    pub parameters_determined: usize,
    /// Predicted minus measured, root mean square, by column [deg, mm].
    pub rms: BTreeMap<String, f64>,
    /// Samples of the posterior.
    pub samples: usize,
    /// Trials that count.
    pub trials: usize,
}

/// A share of a parameter's variance that data must remove for it to count as determined [-].
const DETERMINED: f64 = 0.5;

/// The figures of a calibration.
pub fn metrics(outcome: &Outcome) -> CalibrationMetrics {
    let found = &outcome.found;
    let by_column = |v: Free<Option<f64>>| v.each().filter_map(|(c, x)| Some((c.column(), (*x)?))).collect();
    CalibrationMetrics {
        cost: found.cost,
        effective_samples: found.weighed.map(|w| w.effective_samples),
        evaluations: found.evaluations,
        k_hat: found.weighed.map(|w| w.k_hat).filter(|k| k.is_finite()),
        lowest_cost: found.lowest_cost.0,
        method: found.method,
        noise_scale: by_column(found.noise_scale.map(Some)),
        parameters_determined: found.parameters.iter().filter(|p| p.determined > DETERMINED).count(),
        rms: by_column(found.rms),
        samples: found.samples.len(),
        trials: outcome.trials.len(),
    }
}

/// How far an end of an interval may be off, by so few samples; empty where there is none.
pub fn error_words(found: &Calibrated) -> String {
    let n = found.samples.len();
    let told = |e: f64| format!("an end of an interval errs by {:.0} % of half of it, by {n} samples", 100.0 * e);
    error_of_ends(n, found.unknowns.interval).map_or(String::new(), told)
}

/// Share of the forces' variance in the drawers that data removed, and share that beliefs had removed before, each a mean over all forces [%].
pub fn shares_of_forces(found: &Calibrated) -> [f64; 2] {
    let share = |of: fn(&ForceEstimate) -> f64| 100.0 * mean(&found.forces.iter().map(of).collect::<Vec<_>>());
    [share(|f| f.determined), share(|f| f.believed)]
}

/// The same in words: empty where there is nothing to compare.
pub fn share_words(found: &Calibrated) -> String {
    let samples = found.samples.len();
    if found.forces.iter().all(|f| f.unmeasured.is_none()) {
        return String::new();
    }
    if samples < LEAST {
        return format!("{samples} samples do not tell what data and beliefs removed, {LEAST} do");
    }
    let [by_data, by_belief] = shares_of_forces(found);
    format!(
        "the measurements removed {by_data:.0} % of the variance that the forces had without them, after beliefs about forces had removed {by_belief:.0} %"
    )
}

/// What was found, for the terminal.
pub fn words(outcome: &Outcome) -> String {
    let found = &outcome.found;
    let mut text = format!(
        "{} trials, {} evaluations; cost {:.1}, lowest met {:.1}\n",
        outcome.trials.len(),
        found.evaluations,
        found.cost,
        found.lowest_cost.0
    );
    for c in FREE {
        if let Some(rms) = found.rms[c] {
            let _ = writeln!(text, "  {c} misses by {rms:.2} {} (root mean square)", c.unit());
        }
    }
    for p in found.parameters.iter() {
        let _ = writeln!(
            text,
            "  X{:<2} {:7} {:18} {:8.3}  {:8.3} to {:8.3}  {:3.0} % by the data",
            p.number,
            p.bundle,
            p.kind.name(),
            p.value,
            p.lower,
            p.upper,
            100.0 * p.determined
        );
    }
    text += &words_of_forces(found);
    text
}

/// What data and beliefs did to the forces in the drawers, how sure an interval is, and which test would narrow them most.
fn words_of_forces(found: &Calibrated) -> String {
    let mut text = String::new();
    let shares = share_words(found);
    if !shares.is_empty() {
        let _ = writeln!(text, "  forces in drawers: {shares} (forces.csv)");
    }
    let error = error_words(found);
    if !error.is_empty() {
        let _ = writeln!(text, "  {error}");
    }
    if let Some(t) = found.next_tests.first() {
        let _ = writeln!(text, "  forces in drawers: {} (next_tests.csv)", t.words());
    }
    text
}

#[cfg(test)]
mod tests;
