//! What a model answers, as CSV.

use super::columns::{QUADRICEPS_COLUMN, WITHOUT_COLUMN, cut_cell, required_columns, sd_column};
use super::{Branch, LaxityTrial};
use crate::coordinate::{Coordinate, FREE, Free};
use crate::flags::{Flag, sentences};
use crate::spec::PoseSpec;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// What a model answers to a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialResult {
    /// The trial that was simulated.
    pub trial: LaxityTrial,
    /// The predicted pose, clinical signs.
    pub pose: PoseSpec,
    /// Force of each bundle [N], in the order of the model's bundles.
    pub forces_n: Vec<f64>,
    /// What bodies with coordinates of their own tell of themselves: names with their units, values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<(String, f64)>,
    /// What is odd about the answer; empty when nothing is.
    pub flags: Vec<Flag>,
    /// What samples of the posterior say of its columns, by their names; empty where none were asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<(String, Band)>,
}

/// Mean and interval of a quantity over samples of the posterior, in its own unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// Mean over the samples.
    pub mean: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl TrialResult {
    /// Of a trial without equilibrium, in a model of so many bundles: all that is predicted is NaN, and a flag says why.
    pub fn without_equilibrium(trial: &LaxityTrial, bundles: usize) -> TrialResult {
        let none = f64::NAN;
        let pose = PoseSpec { fe_deg: trial.fe_deg, vv_deg: none, ie_deg: none, ml_mm: none, ap_mm: none, si_mm: none };
        TrialResult {
            trial: trial.clone(),
            pose,
            forces_n: vec![none; bundles],
            outputs: vec![],
            flags: vec![Flag::NoEquilibrium],
            bands: vec![],
        }
    }

    /// The band of a column, where samples were asked.
    pub fn band(&self, column: &str) -> Option<Band> {
        self.bands.iter().find(|(name, _)| name == column).map(|(_, b)| *b)
    }

    /// A value of the result by the name of its column in a results file; `bundles` in the order of the forces.
    pub fn columns(&self, bundles: &[String]) -> Vec<(String, f64)> {
        let pose = FREE.into_iter().map(|c| (c.column(), self.predicted()[c]));
        let forces = bundles.iter().zip(&self.forces_n).map(|(b, f)| (force_column(b), *f));
        pose.chain(forces).chain(self.outputs.iter().cloned()).collect()
    }

    /// The predicted VV, IE [deg], ML, AP, SI [mm].
    pub fn predicted(&self) -> Free<f64> {
        self.pose.free()
    }
}

/// The results file of `simulate --trials`: the columns of laxity data with the predicted pose in place of the measured,
/// then `force_BUNDLE_n` per bundle and `flags`. It reads back as laxity data. A trial whose readings count from another one is told so too.
pub fn results_csv(bundles: &[String], results: &[TrialResult]) -> String {
    let mut header = required_columns();
    header.extend(["branch".to_owned(), "order".to_owned(), "time_s".to_owned()]);
    let place = |r: &TrialResult| {
        r.trial.reference.as_ref().and_then(|r| results.iter().position(|x| x.trial.trial == r.trial))
    };
    let displaced = results.iter().any(|r| place(r).is_some());
    header.extend(displaced.then(|| "reference".to_owned()));
    let pulled = results.iter().any(|r| r.trial.quadriceps_n != 0.0);
    header.extend(pulled.then(|| QUADRICEPS_COLUMN.to_owned()));
    let cut = results.iter().any(|r| !r.trial.without.is_empty());
    header.extend(cut.then(|| WITHOUT_COLUMN.to_owned()));
    header.extend(bundles.iter().map(|b| force_column(b)));
    let outputs = output_columns(results);
    header.extend(outputs.iter().cloned());
    let banded = banded_columns(results);
    header.extend(banded.iter().flat_map(|c| band_columns(c)));
    header.push("flags".to_owned());
    let mut out = line(&header);
    for r in results {
        let t = &r.trial;
        let mut cells = vec![t.trial.clone(), t.test.name().to_owned(), number(t.nominal_flexion_deg)];
        cells.extend(t.load.iter().map(|v| number(*v)));
        cells.push(number(r.pose.fe_deg));
        let from = place(r).map(|k| &results[k]);
        let zero = from.map_or(Free::all(0.0), TrialResult::predicted);
        cells.extend(r.predicted().iter().zip(zero).map(|(v, zero)| number(v - zero)));
        cells.push(branch(t).to_owned());
        cells.push(t.order.map(|v| v.to_string()).unwrap_or_default());
        cells.push(t.time_s.map(number).unwrap_or_default());
        cells.extend(displaced.then(|| from.map(|r| r.trial.trial.clone()).unwrap_or_default()));
        cells.extend(pulled.then(|| number(t.quadriceps_n)));
        cells.extend(cut.then(|| cut_cell(&t.without)));
        cells.extend(r.forces_n.iter().map(|v| number(*v)));
        cells.extend(output_cells(r, &outputs));
        cells.extend(band_cells(r, from, &banded));
        cells.push(sentences(&r.flags).join("; "));
        out += &line(&cells);
    }
    out
}

/// Measured trials as a standard laxity file; an empty cell is "not measured".
pub fn trials_csv(trials: &[LaxityTrial]) -> String {
    let mut header = required_columns();
    header.extend(FREE.map(sd_column));
    header.extend(["branch".to_owned(), "order".to_owned(), "time_s".to_owned()]);
    let displaced = trials.iter().any(|t| t.reference.is_some());
    header.extend(displaced.then(|| "reference".to_owned()));
    let pulled = trials.iter().any(|t| t.quadriceps_n != 0.0);
    header.extend(pulled.then(|| QUADRICEPS_COLUMN.to_owned()));
    let cut = trials.iter().any(|t| !t.without.is_empty());
    header.extend(cut.then(|| WITHOUT_COLUMN.to_owned()));
    let mut out = line(&header);
    let cell = |v: &Option<f64>| v.map(number).unwrap_or_default();
    for t in trials {
        let mut cells = vec![t.trial.clone(), t.test.name().to_owned(), number(t.nominal_flexion_deg)];
        cells.extend(t.load.iter().map(|v| number(*v)));
        cells.push(number(t.fe_deg));
        cells.extend(t.measured.iter().chain(&t.sd).map(cell));
        cells.push(branch(t).to_owned());
        cells.push(t.order.map(|v| v.to_string()).unwrap_or_default());
        cells.push(cell(&t.time_s));
        cells.extend(displaced.then(|| t.reference.as_ref().map(|r| r.trial.clone()).unwrap_or_default()));
        cells.extend(pulled.then(|| number(t.quadriceps_n)));
        cells.extend(cut.then(|| cut_cell(&t.without)));
        out += &line(&cells);
    }
    out
}

fn branch(t: &LaxityTrial) -> &'static str {
    match t.branch {
        None => "",
        Some(Branch::Loading) => "loading",
        Some(Branch::Unloading) => "unloading",
    }
}

/// The file of a validation protocol: a row a step, `fe_deg,...,si_mm`, the loads, `force_BUNDLE_n` per bundle, `flags`, and
/// whether any of them makes the row odd.
/// Each step is a result whose trial holds the loads.
pub fn protocol_csv(bundles: &[String], steps: &[TrialResult]) -> String {
    let mut header = vec!["fe_deg".to_owned()];
    header.extend(FREE.map(Coordinate::column));
    header.extend(FREE.map(Coordinate::load_column));
    header.extend(bundles.iter().map(|b| force_column(b)));
    let outputs = output_columns(steps);
    header.extend(outputs.iter().cloned());
    let banded = banded_columns(steps);
    header.extend(banded.iter().flat_map(|c| band_columns(c)));
    header.extend(["flags", "odd", "step"].map(str::to_owned));
    let mut out = line(&header);
    for r in steps {
        let mut cells = vec![number(r.pose.fe_deg)];
        cells.extend(r.predicted().iter().chain(&r.trial.load).chain(&r.forces_n).map(|v| number(*v)));
        cells.extend(output_cells(r, &outputs));
        cells.extend(band_cells(r, None, &banded));
        let odd = if r.flags.iter().any(Flag::is_odd) { "yes" } else { "no" };
        cells.extend([sentences(&r.flags).join("; "), odd.to_owned(), r.trial.trial.clone()]);
        out += &line(&cells);
    }
    out
}

/// What any of the results' bodies tell, in the order in which it is first told.
fn output_columns(results: &[TrialResult]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for (name, _) in results.iter().flat_map(|r| &r.outputs) {
        if !out.contains(name) {
            out.push(name.clone());
        }
    }
    out
}

/// A result's cells of those columns; empty where it does not tell.
fn output_cells(result: &TrialResult, columns: &[String]) -> Vec<String> {
    let of = |c: &String| result.outputs.iter().find(|(name, _)| name == c).map(|(_, v)| number(*v));
    columns.iter().map(|c| of(c).unwrap_or_default()).collect()
}

/// Columns of which any result has a band, in the order in which they are first told.
fn banded_columns(results: &[TrialResult]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for (name, _) in results.iter().flat_map(|r| &r.bands) {
        if !out.contains(name) {
            out.push(name.clone());
        }
    }
    out
}

/// The three columns of a band.
fn band_columns(column: &str) -> [String; 3] {
    ["mean", "lower", "upper"].map(|end| format!("{column}_{end}"))
}

/// A result's cells of those columns; empty where it has no band, or where its readings count from another result: a difference has another band.
fn band_cells(result: &TrialResult, from: Option<&TrialResult>, columns: &[String]) -> Vec<String> {
    let is_pose = |c: &str| FREE.into_iter().any(|k| k.column() == c);
    let of = |c: &String| match result.band(c) {
        Some(b) if from.is_none() || !is_pose(c) => [b.mean, b.lower, b.upper].map(number),
        _ => Default::default(),
    };
    columns.iter().flat_map(of).collect()
}

/// The force column of a bundle.
pub fn force_column(bundle: &str) -> String {
    format!("force_{bundle}_n")
}

/// Six decimals, never "-0"; empty when not finite.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let mut text = String::new();
    let _ = write!(text, "{:.6}", if value.abs() < 5e-7 { 0.0 } else { value });
    text
}

/// A CSV line; cells with commas, quotes or line ends are quoted.
fn line(cells: &[String]) -> String {
    let quoted: Vec<String> = cells
        .iter()
        .map(|c| if c.contains([',', '"', '\n', '\r']) { format!("\"{}\"", c.replace('"', "\"\"")) } else { c.clone() })
        .collect();
    quoted.join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::super::{read, read_asked};
    use super::*;
    use crate::coordinate::AP;

    const HEADER: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm";

    fn csv(row: &str) -> String {
        format!("{HEADER}\n{row}\n")
    }

    fn error(text: &str) -> String {
        read(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn results_read_back_as_laxity_data() {
        let table = read(csv("\"a, b\",anterior,30,0,0,0,44.5,20,21,1.5,-2,,4,-20").as_bytes()).unwrap();
        assert_eq!(table.trials[0].measured.0, [Some(1.5), Some(-2.0), None, Some(4.0), Some(-20.0)]);
        let pose = PoseSpec { fe_deg: 21.0, vv_deg: 0.25, ie_deg: -1.0, ml_mm: 2.0, ap_mm: 3.0, si_mm: -19.0 };
        let result = TrialResult {
            trial: table.trials[0].clone(),
            pose,
            forces_n: vec![12.5],
            outputs: vec![],
            flags: vec![],
            bands: vec![],
        };
        let text = results_csv(&["ACL_AM".into()], &[result]);
        assert!(text.lines().next().unwrap().contains("force_ACL_AM_n"));
        let back = read(text.as_bytes()).unwrap();
        assert_eq!(back.trials[0].measured.0, [Some(0.25), Some(-1.0), Some(2.0), Some(3.0), Some(-19.0)]);
        assert_eq!(back.trials[0].trial, "a, b");
        assert!(protocol_csv(&["ACL_AM".into()], &[]).starts_with("fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm,"));
    }

    #[test]
    fn a_trial_without_equilibrium_is_a_row_of_empty_cells_that_reads_back_as_nothing_measured() {
        let rows = "rest,neutral,30,0,0,0,0,20,30,1,2,3,4,5\npulled,anterior,30,0,0,0,44,20,30,1,2,3,4,5";
        let mut trials = read(csv(rows).as_bytes()).unwrap().trials;
        let pose = PoseSpec { fe_deg: 30.0, ap_mm: 7.0, ..PoseSpec::default() };
        let found = |trial: &LaxityTrial| TrialResult {
            trial: trial.clone(),
            pose,
            forces_n: vec![9.0],
            outputs: vec![("contact_medial_force_n".to_owned(), 12.0)],
            flags: vec![],
            bands: vec![],
        };
        let lost = TrialResult::without_equilibrium(&trials[0], 1);
        let text = results_csv(&["ACL".into()], &[lost.clone(), found(&trials[1])]);
        // five coordinates, branch, order, time, a force, an output
        let row = text.lines().nth(1).unwrap();
        assert!(
            row.starts_with("rest,neutral,30.") && row.ends_with(&format!("{}no equilibrium", ",".repeat(11))),
            "{text}"
        );
        let back = read(text.as_bytes()).unwrap().trials;
        assert_eq!((back[0].measured, back[0].load), (Free::all(None), trials[0].load));
        assert_eq!(back[1].measured[AP], Some(7.0));
        // what counts from it has no displacement, its forces stay
        let (name, load, fe_deg) = (trials[0].trial.clone(), trials[0].load, trials[0].fe_deg);
        trials[1].reference = Some(super::super::Reference { trial: name, load, fe_deg });
        let text = results_csv(&["ACL".into()], &[lost, found(&trials[1])]);
        assert!(text.contains(&format!(",30.000000{}rest,9.000000,12.000000,", ",".repeat(9))), "{text}");
    }

    #[test]
    fn tension_of_the_quadriceps_is_read_written_and_left_out_where_there_is_none() {
        let with = format!(
            "{HEADER},load_quadriceps_n\na,neutral,30,0,0,0,0,20,21,,,,,,60\nb,neutral,60,0,0,0,0,20,61,,,,,,\n"
        );
        let trials = read(with.as_bytes()).unwrap().trials;
        assert_eq!([trials[0].quadriceps_n, trials[1].quadriceps_n], [60.0, 0.0]);
        assert_eq!(read(trials_csv(&trials).as_bytes()).unwrap().trials, trials);
        let pose = PoseSpec { fe_deg: 21.0, ..PoseSpec::default() };
        let outputs = vec![("patella_tilt_deg".to_owned(), 3.5)];
        let told =
            TrialResult { trial: trials[0].clone(), pose, forces_n: vec![], outputs, flags: vec![], bands: vec![] };
        let other = TrialResult { trial: trials[1].clone(), outputs: vec![], ..told.clone() };
        let text = results_csv(&[], &[told, other.clone()]);
        assert!(text.contains("load_quadriceps_n,patella_tilt_deg,flags"), "{text}");
        assert_eq!(read(text.as_bytes()).unwrap().trials[0].quadriceps_n, 60.0);
        assert!(!results_csv(&[], &[other]).contains("quadriceps") && !trials_csv(&trials[1..]).contains("quadriceps"));
        assert!(error(&with.replace(",60\n", ",-60\n")).contains("row 2, column \"load_quadriceps_n\": -60 N"));
        assert!(error(&with.replace(",60\n", ",60000\n")).contains("another unit"));
    }

    #[test]
    fn a_model_may_be_asked_by_loads_alone() {
        let poses = ",vv_deg,ie_deg,ml_mm,ap_mm,si_mm";
        let row = "a,anterior,30,0,0,0,44,20,21\n";
        let alone = format!("{}\n{row}", HEADER.replace(poses, ""));
        let trial = read_asked(alone.as_bytes()).unwrap().trials.remove(0);
        assert_eq!((trial.load[AP], trial.fe_deg, trial.measured), (44.0, 21.0, Free::all(None)));
        assert!(error(&alone).contains("missing column vv_deg, ie_deg, ml_mm, ap_mm, si_mm"));
        let one = format!("{}\n{}", HEADER.replace(poses, ",vv_deg"), row.replace("21\n", "21,1\n"));
        let refused = read_asked(one.as_bytes()).unwrap_err().to_string();
        assert!(refused.contains("missing column ie_deg"), "{refused}");
    }

    #[test]
    fn complaints_name_row_and_column() {
        assert!(error("").contains("the file is empty"));
        assert!(error(HEADER).contains("no trial"));
        assert!(error(&HEADER.replace("ml_mm", "ml_m")).contains("column 12: unknown column \"ml_m\""));
        assert!(error(&HEADER.replace(",si_mm", "")).contains("missing column si_mm"));
        assert!(error(&csv("a,anterior,30,0,0,0,44,20,21,1,2,x,4,5")).contains("row 2, column \"ml_mm\": \"x\""));
        assert!(error(&csv("a,anterior,30,0,0,0,44,20,inf,1,2,3,4,5")).contains("column \"fe_deg\""));
        assert!(error(&csv("a,foreward,30,0,0,0,44,20,21,1,2,3,4,5")).contains("unknown test \"foreward\""));
        assert!(error(&csv("a,internal,30,0,-4000,0,0,20,21,1,2,3,4,5")).contains("another unit"));
        assert!(error(&csv("a,internal,90,0,-4,0,0,20,1.5708,1,2,3,4,5")).contains("radians"));
        assert!(error(&csv("a,internal,90,0,-4,0,0,20")).contains("row 2"));
        let twice = "a,internal,90,0,-4,0,0,20,88,1,2,3,4,5";
        assert!(error(&csv(&format!("{twice}\n{twice}"))).contains("row 3, column \"trial\""));
    }

    #[test]
    fn a_load_against_its_test_is_a_warning() {
        let table = read(csv("a,internal,90,0,4,0,0,20,88,1,2,3,4,5").as_bytes()).unwrap();
        assert!(table.warnings[0].contains("does not point that way"), "{:?}", table.warnings);
    }
}
