//! A calibration rehearsed where the truth is known: measurements simulated by the model itself with parameters spread evenly over their
//! ranges and with noise, some trials left out; then what the calibration says of parameters, forces and the trials left out, beside the truth.

use crate::cost::residual;
use crate::design::Design;
use crate::error::CalibrationError;
use crate::experiment::Experiment;
use crate::gradient::normal;
use crate::knee::Knee;
use crate::options::CalibrateOptions;
use crate::session::{Session, ap_probes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sim::laxity::LaxityTrial;
use std::ops::ControlFlow;

/// Every so many trials one is left out.
const LEFT_OUT: usize = 5;

/// What a rehearsal showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Rehearsal {
    /// Its seed.
    pub seed: u64,
    /// Ligament parameters whose interval holds the truth, and how many there are.
    pub covered: (usize, usize),
    /// Root mean square, over all coordinates of the trials left out, of predicted minus measured over the noise [-].
    pub left_out: f64,
    /// The same of the true model: the noise itself [-].
    pub noise: f64,
    /// Errors of the bundle forces that are called determined [N].
    pub determined: Vec<f64>,
    /// Bundle forces whose interval holds the truth, and how many there are.
    pub forces_covered: (usize, usize),
    /// Root mean square over the noise of the fit to the trials kept, and of the true model [-].
    pub kept: (f64, f64),
}

/// Rehearses a calibration of `knee` to trials like these: their loads, flexions and noise; their measurements are not used.
///
/// # Errors
/// As [`Session::new`] and [`Session::run`].
pub fn rehearse(
    knee: &Knee,
    trials: &[LaxityTrial],
    options: &CalibrateOptions,
    seed: u64,
) -> Result<Rehearsal, CalibrationError> {
    let design = Design::of_model(&knee.spec)?;
    let mut random = ChaCha8Rng::seed_from_u64(77 + seed);
    let unit: Vec<f64> = (0..design.len()).map(|_| random.random_range(0.0..1.0)).collect();
    let truth = design.at(&unit);
    let data = measured(knee, &design, &truth, trials, options, &mut random);
    let parts = |out: bool| -> Vec<LaxityTrial> {
        data.iter().enumerate().filter(|(i, _)| (i % LEFT_OUT == LEFT_OUT - 1) == out).map(|(_, t)| t.clone()).collect()
    };
    let (kept, left_out) = (parts(false), parts(true));
    let options = CalibrateOptions { seed, ..options.clone() };
    let session = Session::new(&knee.spec, "rehearsal", &kept, &options)?;
    let found = session.run(knee, session.begin(None)?, &mut |_| ControlFlow::Continue(()))?.found;
    let over_noise = |design: &Design, values: &[f64], trials: &[LaxityTrial]| {
        let simulate = knee.simulating(design, trials);
        let predicted = Experiment { design, simulate: &simulate, trials: trials.len() }.predictions(values);
        rms_over_noise(trials, &predicted)
    };
    let forces = true_forces(knee, &design, &truth);
    let (mut determined, mut forces_covered) = (vec![], (0, 0));
    for f in &found.forces {
        let Some(&true_n) = forces.get(&f.trial).and_then(|all| all.get(f.bundle)) else { continue };
        forces_covered.0 += usize::from((f.lower_n - 0.5..=f.upper_n + 0.5).contains(&true_n));
        forces_covered.1 += 1;
        if f.is_determined() {
            determined.push((f.value_n.unwrap_or(0.0) - true_n).abs());
        }
    }
    let inside = found.parameters.iter().zip(&truth).filter(|(p, t)| (p.lower..=p.upper).contains(*t)).count();
    Ok(Rehearsal {
        seed,
        covered: (inside, truth.len()),
        left_out: over_noise(&session.design, &found.values, &left_out),
        noise: over_noise(&design, &truth, &left_out),
        determined,
        forces_covered,
        kept: (over_noise(&session.design, &found.values, &kept), over_noise(&design, &truth, &kept)),
    })
}

/// The trials with what the true model answers and noise; those it has no answer to are left out.
fn measured(
    knee: &Knee,
    design: &Design,
    truth: &[f64],
    trials: &[LaxityTrial],
    options: &CalibrateOptions,
    random: &mut ChaCha8Rng,
) -> Vec<LaxityTrial> {
    let simulate = knee.simulating(design, trials);
    let answers = Experiment { design, simulate: &simulate, trials: trials.len() }.predictions(truth);
    let mut out = Vec::new();
    for (t, answer) in trials.iter().zip(answers) {
        let sd: [f64; 5] = std::array::from_fn(|c| t.sd[c].unwrap_or(options.targets.noise[c]));
        let noise: [f64; 5] = std::array::from_fn(|c| sd[c] * normal(random));
        if let Some(a) = answer {
            let measured = std::array::from_fn(|c| Some(a[c] + noise[c]));
            out.push(LaxityTrial { measured, sd: sd.map(Some), ..t.clone() });
        }
    }
    out
}

/// Bundle forces of the true model in the probe trials, by name.
fn true_forces(knee: &Knee, design: &Design, truth: &[f64]) -> std::collections::BTreeMap<String, Vec<f64>> {
    let probes = ap_probes();
    let simulate = knee.simulating(design, &probes);
    let answers = Experiment { design, simulate: &simulate, trials: probes.len() }.answers(truth, false);
    let named = probes.iter().zip(answers).filter_map(|(t, a)| Some((t.trial.clone(), a.ok()?.forces_n)));
    named.collect()
}

/// Root mean square of predicted minus measured over the noise [-].
fn rms_over_noise(trials: &[LaxityTrial], predicted: &[Option<[f64; 5]>]) -> f64 {
    let mut squares = Vec::new();
    for (t, p) in trials.iter().zip(predicted) {
        let Some(p) = p else { continue };
        for (r, sd) in residual(t, p).iter().zip(t.sd) {
            if let (Some(r), Some(sd)) = (r, sd) {
                squares.push((r / sd).powi(2));
            }
        }
    }
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}
