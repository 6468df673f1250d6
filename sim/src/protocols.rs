//! The paper's validation protocols [andreassen2025, section 2.6] on a model: AP laxity, passive flexion, pivot shift.
//!
//! Each gives rows in the order of time; a row's trial holds the loads acting there and names the step. A step without equilibrium is a row without
//! an answer, as a laxity trial without equilibrium is.

use crate::coordinate::{FE, Load};
use crate::error::SimError;
use crate::explicit::options::ExplicitOptions;
use crate::flags::{Flag, HALF_PLATEAU_MM};
use crate::jumps::flag_jumps;
use crate::laxity::{LaxityTrial, Test, TrialResult};
use crate::model::Model;
use crate::quasistatic::Phase;
use crate::trials::{Answer, Path, TrialOptions, chain_flexion};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Least and largest joint compression of a protocol [N]. Ours: several times the weight of a body.
pub const COMPRESSION_N: [f64; 2] = [0.0, 5000.0];

/// A protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// Settle, flex and load forwards, then from forwards to backwards and back.
    ApLaxity,
    /// Flexion without load.
    PassiveFlexion,
    /// Valgus with internal moment.
    PivotShift,
}

/// How a protocol is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// Equilibrium along the path of loading.
    Quasistatic,
    /// Explicit dynamics through the paper's steps, to rest at each row.
    Explicit,
}

/// How far apart two solvers may lie.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Agreement {
    /// In a translation [mm]; ours: a tenth of what tells a sound knee from one with a torn ACL.
    pub mm: f64,
    /// In a rotation [deg]; ours: a tenth of a laxity's scatter.
    pub deg: f64,
    /// In a bundle's force [N]; ours: a fiftieth of the drawers' load.
    pub n: f64,
}

impl Default for Agreement {
    fn default() -> Self {
        Agreement { mm: 0.2, deg: 0.3, n: 3.0 }
    }
}

/// The protocols' numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ProtocolOptions {
    /// Joint compression throughout [N]; as in the published calibration decks (the published tables: most likely 150).
    pub compression_n: f64,
    /// AP laxity: flexions [deg]; [andreassen2025, section 2.6.2].
    pub ap_flexions_deg: Vec<f64>,
    /// AP laxity: load either way [N]; [andreassen2025, section 2.6.2].
    pub ap_load_n: f64,
    /// AP laxity: rows of each way of the third step [-].
    pub ap_rows: usize,
    /// AP laxity: duration of each way [s].
    pub ap_way_s: f64,
    /// Passive flexion: first flexion [deg]; [andreassen2025, section 2.6.3].
    pub from_flexion_deg: f64,
    /// Passive flexion: last flexion [deg]; [andreassen2025, section 2.6.3].
    pub to_flexion_deg: f64,
    /// Passive flexion: flexion between rows [deg].
    pub every_deg: f64,
    /// Passive flexion: rate [deg/s]; that of the published deck.
    pub rate_deg_per_s: f64,
    /// Pivot shift: flexion [deg]; [andreassen2025, section 2.6.4].
    pub pivot_flexion_deg: f64,
    /// Pivot shift: valgus moment [N m]; [andreassen2025, section 2.6.4].
    pub pivot_valgus_nm: f64,
    /// Pivot shift: internal moment [N m]; [andreassen2025, section 2.6.4].
    pub pivot_internal_nm: f64,
    /// Pivot shift: AP further than this from the CT pose is a dislocation [mm]; [`HALF_PLATEAU_MM`]. The paper calls AP of 21.6 and 23.1 mm
    /// dislocated, of 8.1 mm not [andreassen2025, table 6].
    pub pivot_dislocation_ap_mm: f64,
    /// Samples of the posterior by which intervals of a calibrated model's answers are told [-]; 0 leaves them out; ours.
    pub samples: usize,
    /// By which solver the knee's rows are told: explicit or quasistatic. With the explicit one the quasi-static answer stands beside it; ours.
    pub solver: Solver,
    /// How far apart both solvers may lie before a row is flagged.
    pub agree: Agreement,
    /// The explicit solver; its steps are the paper's [andreassen2025, section 2.4.5].
    pub explicit: ExplicitOptions,
    /// Path and solver of the quasi-static answer.
    pub trials: TrialOptions,
}

impl Default for ProtocolOptions {
    fn default() -> Self {
        ProtocolOptions {
            compression_n: 20.0,
            ap_flexions_deg: vec![30.0, 60.0, 90.0],
            ap_load_n: 133.0,
            ap_rows: 8,
            ap_way_s: 0.9,
            from_flexion_deg: 0.0,
            to_flexion_deg: 90.0,
            every_deg: 5.0,
            rate_deg_per_s: 90.0,
            pivot_flexion_deg: 30.0,
            pivot_valgus_nm: 8.0,
            pivot_internal_nm: 4.0,
            pivot_dislocation_ap_mm: HALF_PLATEAU_MM,
            samples: 48,
            solver: Solver::Explicit,
            agree: Agreement::default(),
            explicit: ExplicitOptions::default(),
            trials: TrialOptions::default(),
        }
    }
}

impl ProtocolOptions {
    /// The options as far as the solver hears them, and the others by default: with the quasi-static one alone there is nothing to hold it against.
    #[must_use]
    pub fn heard(&self) -> ProtocolOptions {
        let mut out = self.clone();
        if self.solver == Solver::Quasistatic {
            (out.agree, out.explicit) = (Agreement::default(), ExplicitOptions::default());
        }
        out
    }

    /// Path, solver and limits of a protocol: in a pivot shift less AP is a dislocation.
    pub(crate) fn of(&self, protocol: Protocol) -> TrialOptions {
        let ap = self.trials.dislocation_ap_mm;
        let dislocation_ap_mm =
            if protocol == Protocol::PivotShift { ap.min(self.pivot_dislocation_ap_mm) } else { ap };
        TrialOptions { dislocation_ap_mm, ..self.trials.clone() }
    }
}

/// Part of a path, with a row at its end: the loads and the flexion that its trial names.
#[derive(Clone, Debug)]
pub(crate) struct Leg {
    pub(crate) trial: LaxityTrial,
    /// Time to go there [s] and increments; `None`: flexed and loaded as a laxity trial is.
    pub(crate) going: Option<(f64, usize)>,
}

/// Runs a protocol by the quasi-static solver; a row a step. A step without equilibrium is a row that says so, and the next one goes on from the last
/// answer.
///
/// Errors: options out of range; no equilibrium in any row.
pub fn run(model: &Model, protocol: Protocol, options: &ProtocolOptions) -> Result<Vec<TrialResult>, SimError> {
    let paths = paths(model, protocol, options)?;
    let options = ProtocolOptions { trials: options.of(protocol), ..options.clone() };
    let each = paths.par_iter().map(|legs| quasi_static(model, legs, &options));
    let rows = each.collect::<Vec<_>>().concat();
    let (rows, _) = with_lost(rows, paths.iter().flatten().map(|leg| &leg.trial), model.bundle_names().len())?;
    Ok(rows)
}

/// Rows of a protocol in a model of so many bundles, `trials` in their order: a row without equilibrium says so in its place. Beside them why the first
/// has none.
///
/// Errors: what was asked is at fault; no equilibrium in any row.
pub(crate) fn with_lost<'a>(
    rows: Vec<Result<TrialResult, SimError>>,
    trials: impl Iterator<Item = &'a LaxityTrial>,
    bundles: usize,
) -> Result<(Vec<TrialResult>, Option<SimError>), SimError> {
    let (mut out, mut why) = (Vec::with_capacity(rows.len()), None);
    for (row, trial) in rows.into_iter().zip(trials) {
        match row {
            Ok(row) => out.push(row),
            Err(e @ SimError::Solver(_)) => {
                out.push(TrialResult::without_equilibrium(trial, bundles));
                why = why.or(Some(e));
            }
            // what was asked is at fault
            Err(e) => return Err(e),
        }
    }
    match why {
        Some(e) if out.iter().all(|r| r.flags.contains(&Flag::NoEquilibrium)) => Err(e),
        why => {
            flag_jumps(&mut out);
            Ok((out, why))
        }
    }
}

/// The paths of a protocol; each starts in the CT pose, settled under compression.
///
/// Errors: options out of range.
pub(crate) fn paths(model: &Model, protocol: Protocol, o: &ProtocolOptions) -> Result<Vec<Vec<Leg>>, SimError> {
    o.trials.check()?;
    check(o)?;
    let paths = match protocol {
        Protocol::ApLaxity => o.ap_flexions_deg.iter().map(|fe| ap_laxity(*fe, o)).collect(),
        Protocol::PassiveFlexion => {
            chain_flexion(model, o.from_flexion_deg, &o.trials)?;
            chain_flexion(model, o.to_flexion_deg, &o.trials)?;
            vec![passive_flexion(model, o)]
        }
        Protocol::PivotShift => pivot_shift(o),
    };
    for leg in paths.iter().flatten() {
        chain_flexion(model, leg.trial.fe_deg, &o.trials)?;
    }
    Ok(paths)
}

/// The rows of a path, as far as each has an equilibrium.
fn quasi_static(model: &Model, legs: &[Leg], o: &ProtocolOptions) -> Vec<Result<TrialResult, SimError>> {
    let mut path = match Path::settled(model, o.compression_n, &o.trials) {
        Ok(path) => path,
        Err(e) => return legs.iter().map(|_| Err(e.clone())).collect(),
    };
    let mut is_reached = true;
    let row = |leg: &Leg| {
        // after a step without equilibrium the way is longer than the leg's: it is flexed and loaded as a laxity trial is
        let going = leg.going.filter(|_| is_reached);
        let answer = path.attempt(|path| gone((model, path), (leg, going), o));
        is_reached = answer.is_ok();
        answer.map(|a| a.result(&leg.trial)).map_err(|e| e.of_trial(&leg.trial.trial))
    };
    legs.iter().map(row).collect()
}

/// Goes a part of a path, by its own way or by another one, and rests there.
fn gone(
    (model, path): (&Model, &mut Path),
    (leg, going): (&Leg, Option<(f64, usize)>),
    o: &ProtocolOptions,
) -> Result<Answer, SimError> {
    let flexion = chain_flexion(model, leg.trial.fe_deg, &o.trials)?;
    let load = leg.trial.load.generalised();
    match going {
        None => path.load(flexion, &load)?,
        Some((seconds, steps)) => {
            let flow = Some((seconds, o.trials.flowing()));
            path.follow(&Phase { flexion, load, load_from: 0.0, flow, steps })?;
        }
    }
    path.rest()
}

/// Refuses numbers that mean nothing.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(o: &ProtocolOptions) -> Result<(), SimError> {
    let fault = |m: String| Err(SimError::Input(format!("protocol: {m}")));
    for (key, x, least, most) in [
        ("compression_n", o.compression_n, COMPRESSION_N[0], COMPRESSION_N[1]),
        ("ap_load_n", o.ap_load_n, 0.0, 2000.0),
        ("ap_way_s", o.ap_way_s, 1e-3, 1e6),
        ("ap_rows", o.ap_rows as f64, 1.0, 1e4),
        ("every_deg", o.every_deg, 0.01, 180.0),
        ("rate_deg_per_s", o.rate_deg_per_s, 1e-6, 1e6),
        ("pivot_valgus_nm", o.pivot_valgus_nm, -150.0, 150.0),
        ("pivot_internal_nm", o.pivot_internal_nm, -150.0, 150.0),
        ("pivot_dislocation_ap_mm", o.pivot_dislocation_ap_mm, 1.0, 1e3),
        ("agree.mm", o.agree.mm, 1e-6, 100.0),
        ("agree.deg", o.agree.deg, 1e-6, 100.0),
        ("agree.n", o.agree.n, 1e-6, 1e4),
    ] {
        if !(x >= least && x <= most) {
            return fault(format!("{key} is {x}, expected {least} to {most}"));
        }
    }
    if o.to_flexion_deg.is_nan() || o.from_flexion_deg.is_nan() || o.to_flexion_deg < o.from_flexion_deg {
        return fault(format!("flexion from {} to {} deg; it must rise", o.from_flexion_deg, o.to_flexion_deg));
    }
    Ok(())
}

fn leg(step: String, test: Test, fe_deg: f64, load: Load, going: Option<(f64, usize)>) -> Leg {
    Leg { trial: LaxityTrial::asked(step, test, fe_deg, load), going }
}

fn ap_laxity(fe_deg: f64, o: &ProtocolOptions) -> Vec<Leg> {
    let at = |ap: f64| Load::new(0.0, 0.0, 0.0, ap, o.compression_n);
    let test = |ap: f64| if ap >= 0.0 { Test::Anterior } else { Test::Posterior };
    let name = |what: &str, ap: f64| format!("{fe_deg} deg {what} {ap:+.1} N");
    let mut legs = vec![leg(name("load", o.ap_load_n), Test::Anterior, fe_deg, at(o.ap_load_n), None)];
    for (what, from) in [("backwards", 1.0), ("forwards", -1.0)] {
        for k in 1..=o.ap_rows {
            // + 0: half-way is 0 N, not -0
            let ap = o.ap_load_n * from * (1.0 - 2.0 * k as f64 / o.ap_rows as f64) + 0.0;
            legs.push(leg(name(what, ap), test(ap), fe_deg, at(ap), Some((o.ap_way_s / o.ap_rows as f64, 2))));
        }
    }
    legs
}

fn passive_flexion(model: &Model, o: &ProtocolOptions) -> Vec<Leg> {
    let load = Load::compression(o.compression_n);
    let count = ((o.to_flexion_deg - o.from_flexion_deg) / o.every_deg - 1e-9).ceil().max(0.0) as usize;
    let mut last = model.joint.ct_pose()[FE].to_degrees();
    let each = (0..=count).map(|k| {
        let fe_deg = (o.from_flexion_deg + k as f64 * o.every_deg).min(o.to_flexion_deg);
        let seconds = ((fe_deg - last).abs() / o.rate_deg_per_s).max(1e-3);
        let steps = ((fe_deg - last).abs() / 3.0).ceil().max(1.0) as usize;
        last = fe_deg;
        leg(format!("{fe_deg} deg"), Test::Neutral, fe_deg, load, Some((seconds, steps)))
    });
    each.collect()
}

/// Without the moments, then with both ramped up together while flexing, as in the two-step simulation.
fn pivot_shift(o: &ProtocolOptions) -> Vec<Vec<Leg>> {
    let fe_deg = o.pivot_flexion_deg;
    let full = Load::new(o.pivot_valgus_nm, -o.pivot_internal_nm, 0.0, 0.0, o.compression_n);
    let none = Load::compression(o.compression_n);
    vec![
        vec![leg(format!("{fe_deg} deg compressed"), Test::Neutral, fe_deg, none, None)],
        vec![leg(format!("{fe_deg} deg pivot shift"), Test::Valgus, fe_deg, full, None)],
    ]
}
