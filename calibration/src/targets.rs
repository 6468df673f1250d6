//! Calibration targets from laxity data: which trials, and which of them can be used.
//!
//! Complaints name the row of the file (the header is row 1) and the trial. A trial that no file holds counts by its place, plus two.

mod doubt;

use crate::cost::CostOptions;
use crate::error::CalibrationError;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, FREE, Free};
use sim::laxity::{Branch, LaxityTrial, Test};
use sim::spec::PoseSpec;
use std::collections::BTreeMap;

/// Which trials of a laxity file are targets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetSet {
    /// Every trial.
    #[default]
    All,
    /// Anterior, internal and external at 30 and 90 deg, all loads, and neutral at 0: 31 trials of the published data [andreassen2025, figure 5].
    Kla,
    /// AP, IE and VV at 0, 30, 60 and 90 deg, the largest load of each, and neutral: 25 trials [andreassen2025, figure 5].
    Rks,
}

/// Measurement noise of displacements where the file gives none: half of the variance between sessions of arthrometers on living knees. AP: less than
/// 1 mm between examiners for mean readings [milano2022]; IE: 2 deg, from less than 3 deg between two knees [tsai2008]; VV: 0.6 deg, of stress
/// radiographs [kappel2020]; ML and SI ours.
const NOISE_OF_DISPLACEMENTS: Free<f64> = Free([0.4, 1.4, 0.6, 0.7, 0.6]);

/// What makes a trial usable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TargetOptions {
    /// Which trials.
    pub set: TargetSet,
    /// Flexion the model is made for [deg], least and most; the published models are run from -6 to 91, ours reach the rim of the cartilage beyond 120.
    pub flexion_deg: [f64; 2],
    /// Which coordinates count, whatever the method: any of vv, ie, ml, ap, si.
    pub coordinates: Vec<String>,
    /// Measurement noise where the file gives none [deg, mm]: VV, IE, ML, AP, SI, one standard deviation; the published data's.
    pub noise: Free<f64>,
    /// The same of displacements from another trial's pose [deg, mm]; arthrometers on living knees scatter by more.
    pub noise_of_displacements: Free<f64>,
    /// Fewest trials that can be calibrated to [-]; ranges need two.
    pub fewest: usize,
}

impl Default for TargetOptions {
    fn default() -> Self {
        let noise = Free([0.5, 0.5, 0.4, 0.4, 0.4]);
        TargetOptions {
            set: TargetSet::All,
            flexion_deg: [-20.0, 120.0],
            coordinates: FREE.map(|c| c.name().to_owned()).to_vec(),
            noise,
            noise_of_displacements: NOISE_OF_DISPLACEMENTS,
            fewest: 2,
        }
    }
}

/// Trials to calibrate to.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    /// The trials, in the order of the file, each with its row.
    pub trials: Vec<LaxityTrial>,
    /// Measurement noise of a pose that has none of its own: VV, IE [deg], ML, AP, SI [mm], one standard deviation.
    pub usual_noise: Free<f64>,
    /// The same of a displacement.
    pub usual_noise_of_displacements: Free<f64>,
    /// What is odd but not fatal, by row.
    pub warnings: Vec<Notice>,
}

/// The usable trials of a set.
///
/// # Errors
/// By row: too few trials, rows that contradict each other beyond all noise, values in another unit, flexion beyond the
/// model; all that is wrong is listed, a line each. A trial without a coordinate that counts is left out with a warning.
pub fn targets(
    measured: &[LaxityTrial],
    ct: &PoseSpec,
    cost: &CostOptions,
    options: &TargetOptions,
) -> Result<Targets, CalibrationError> {
    check(options)?;
    let mut out = Targets::none(options);
    for i in of_set(measured, options.set, &mut out.warnings) {
        let mut t = measured[i].clone();
        for c in FREE {
            if !options.coordinates.iter().any(|x| x == c.name()) {
                t.measured[c] = None;
            }
        }
        let row = t.row.unwrap_or(i + 2);
        let named = |x: &LaxityTrial| x.reference.as_ref().is_some_and(|r| r.trial == t.trial);
        if t.measured.iter().all(Option::is_none) && measured.iter().any(named) {
            continue;
        }
        if !is_usable(&t, row, cost, &mut out.warnings) {
            continue;
        }
        out.trials.push(LaxityTrial { row: Some(row), ..t });
    }
    let mut faults = doubt::beyond_flexion(&out, options.flexion_deg);
    faults.extend(doubt::other_units(&out, ct));
    faults.extend(doubt::contradictions(&mut out));
    doubt::against_the_load(&mut out);
    // a displacement is of two poses
    let poses = out.trials.len() + usize::from(out.trials.iter().any(|t| t.reference.is_some()));
    if poses < options.fewest.max(2) {
        let have: Vec<String> = out.trials.iter().map(|t| format!("row {} ({})", row(t), t.trial)).collect();
        faults.insert(
            0,
            format!(
                "{} usable trial{} [{}], at least {} are needed: errors are divided by the range over the trials",
                have.len(),
                if have.len() == 1 { "" } else { "s" },
                have.join(", "),
                options.fewest.max(2)
            ),
        );
    }
    if faults.is_empty() { Ok(out) } else { Err(CalibrationError::Targets(faults.join("\n"))) }
}

/// Refuses options that mean nothing.
fn check(options: &TargetOptions) -> Result<(), CalibrationError> {
    if options.flexion_deg[0].is_nan()
        || options.flexion_deg[1].is_nan()
        || options.flexion_deg[0] >= options.flexion_deg[1]
    {
        return Err(CalibrationError::Option(format!(
            "targets.flexion_deg is {:?}, expected least < most",
            options.flexion_deg
        )));
    }
    if let Some(odd) = options.coordinates.iter().find(|x| !FREE.iter().any(|c| c.name() == x.as_str())) {
        return Err(CalibrationError::Option(format!(
            "targets.coordinates: {odd:?}, expected any of {}",
            FREE.map(Coordinate::name).join(", ")
        )));
    }
    match options.noise.iter().chain(&options.noise_of_displacements).find(|n| !(**n > 0.0 && n.is_finite())) {
        Some(n) => Err(CalibrationError::Option(format!("targets.noise: {n}, expected above 0"))),
        None => Ok(()),
    }
}

/// Indices of the set's trials; warns of conditions of the set that are not there.
fn of_set(measured: &[LaxityTrial], set: TargetSet, warnings: &mut Vec<Notice>) -> Vec<usize> {
    use Test::{Anterior, External, Internal, Neutral, Posterior, Valgus, Varus};
    let (tests, flexions, name): (&[Test], &[f64], &str) = match set {
        TargetSet::All => return (0..measured.len()).collect(),
        TargetSet::Kla => (&[Anterior, Internal, External], &[30.0, 90.0], "KLA"),
        TargetSet::Rks => (&[Anterior, Posterior, Internal, External, Varus, Valgus], &[0.0, 30.0, 60.0, 90.0], "RKS"),
    };
    let at = |t: &LaxityTrial, fe: f64| (t.nominal_flexion_deg - fe).abs() < 0.5;
    let mut chosen = Vec::new();
    let mut missing = Vec::new();
    let mut take = |test: Test, fe: f64, largest: bool| {
        let mut of: Vec<usize> = (0..measured.len())
            .filter(|&i| measured[i].test == test && at(&measured[i], fe))
            .filter(|&i| measured[i].branch != Some(Branch::Unloading))
            .collect();
        if of.is_empty() {
            missing.push(format!("{} at {fe} deg", test.name()));
        }
        if largest {
            let most = of.iter().map(|&i| primary_load(&measured[i])).fold(0.0, f64::max);
            of.retain(|&i| primary_load(&measured[i]) > 0.97 * most);
        }
        chosen.extend(of);
    };
    for &test in tests {
        flexions.iter().for_each(|&fe| take(test, fe, set == TargetSet::Rks));
    }
    take(Neutral, 0.0, false);
    if !missing.is_empty() {
        warnings.push(Kind::SetLacks.notice(format!("the {name} set has no {}", missing.join(", "))).of(name));
    }
    chosen.sort_unstable();
    chosen
}

/// Size of the load a test is about [N m or N].
fn primary_load(t: &LaxityTrial) -> f64 {
    t.test.coordinate().map_or(0.0, |c| t.load[c].abs())
}

/// Whether a trial has a coordinate that counts; warns of those it lacks.
fn is_usable(t: &LaxityTrial, row: usize, cost: &CostOptions, warnings: &mut Vec<Notice>) -> bool {
    let weights = cost.weights_of(t.test);
    let counts: Vec<Coordinate> = FREE.into_iter().filter(|&c| weights[c] > 0.0).collect();
    let names = |which: &[Coordinate]| which.iter().map(|c| c.column()).collect::<Vec<_>>().join(", ");
    let missing: Vec<Coordinate> = counts.iter().copied().filter(|&c| t.measured[c].is_none()).collect();
    if missing.len() == counts.len() {
        warnings.push(
            Kind::RowLeftOut
                .notice(format!("row {row} ({}): left out, {} not measured", t.trial, names(&counts)))
                .row(row)
                .of(&t.trial),
        );
        return false;
    }
    // an arthrometer shows one coordinate
    if !missing.is_empty() && t.reference.is_none() {
        warnings.push(
            Kind::RowInPart
                .notice(format!("row {row} ({}): {} not measured, counts without", t.trial, names(&missing)))
                .row(row)
                .of(&t.trial),
        );
    }
    true
}

/// Row of a target in its file.
pub(crate) fn row(target: &LaxityTrial) -> usize {
    target.row.unwrap_or_default()
}

impl Targets {
    /// No trials yet.
    pub(crate) fn none(options: &TargetOptions) -> Targets {
        Targets {
            trials: vec![],
            usual_noise: options.noise,
            usual_noise_of_displacements: options.noise_of_displacements,
            warnings: vec![],
        }
    }

    /// Measurement noise of a trial: its own, else the usual one.
    pub fn noise(&self, t: &LaxityTrial) -> Free<f64> {
        t.noise(if t.reference.is_some() { &self.usual_noise_of_displacements } else { &self.usual_noise })
    }

    /// The trials without those of the given groups (test, nominal flexion), and those alone: to hold out whole conditions.
    pub fn split(&self, held_out: &[(Test, f64)]) -> (Targets, Targets) {
        let is_out = |t: &LaxityTrial| {
            held_out.iter().any(|(test, fe)| *test == t.test && (t.nominal_flexion_deg - fe).abs() < 0.5)
        };
        let (mut kept, mut out) = (self.clone(), self.clone());
        for (part, wanted) in [(&mut kept, false), (&mut out, true)] {
            part.trials.retain(|t| is_out(t) == wanted);
        }
        (kept, out)
    }

    /// Number of trials of each group.
    pub fn groups(&self) -> BTreeMap<(Test, i64), usize> {
        let mut out = BTreeMap::new();
        for t in &self.trials {
            *out.entry((t.test, t.nominal_flexion_deg.round() as i64)).or_insert(0) += 1;
        }
        out
    }
}

#[cfg(test)]
mod tests;
