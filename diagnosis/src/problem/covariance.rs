//! How far readings may lie from predictions when nothing is missing: measurement, load, repositioning, attachments, and the declared floor of
//! the contact model.

use crate::effect::bench::Bench;
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::problem::jacobian::{At, Jacobian};
use crate::problem::trial::row_of;
use crate::problem::{Linear, Problem};
use inference::noise::{LOAD_N_NM, REPOSITIONING};
use inference::trial::Trial;
use inference::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, Coordinate, FREE, Free, ML, Six, VV};
use sim::equilibrium::{Equilibrium, Start, starts_of};
use sim::joint::Pose;
use sim::model::FibreState;

/// Scatter that is not in the files. Every number is one standard deviation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Floor {
    /// Recorded forces [N]; millimetres in a slack zone.
    pub force_n: f64,
    /// Recorded moments [N m].
    pub moment_nm: f64,
    /// Repositioning of the knee between conditions, in measurement noises [-].
    pub repositioning: f64,
    /// Each end of each fibre, along each axis [mm].
    pub attachment_mm: f64,
    /// Share of a compartment's contact force by which another mesh of the same cartilage differs: one part constant, one smooth over flexion [-].
    /// Measured: docs/theory/discrepancy.md.
    pub contact_share: f64,
    /// Flexion over which that difference changes [deg].
    pub contact_range_deg: f64,
    /// Share, in common to all trials, that the model's own contact may have in the truth beside that of the diagnosis [-].
    pub contact_law: f64,
    /// Share of the contact force that facets and friction of the contact may add to a trial across it, by a lever of 20 mm for moments [-].
    pub roughness: f64,
    /// Resistance to tilt that the rims of the contact may add or lack, alike at all flexions [N m/rad]. Measured: docs/theory/discrepancy.md.
    pub tilt_nm_per_rad: f64,
    /// Exponent of the contact's force over that of the model's law, in common to all trials [-]: pressure that grows otherwise than in proportion.
    pub contact_exponent: f64,
    /// Half width of the ligaments' toe over the model's, in common to all fibres [-]; the line beyond stays where it is.
    pub toe_share: f64,
    /// Part of what is not linear in the ligaments, over their prior, that stays as scatter [-].
    pub nonlinear: f64,
}

impl Default for Floor {
    fn default() -> Self {
        Floor {
            force_n: LOAD_N_NM.0,
            moment_nm: LOAD_N_NM.1,
            repositioning: REPOSITIONING,
            attachment_mm: 0.4,
            contact_share: 0.06,
            contact_range_deg: 25.0,
            contact_law: 0.3,
            roughness: 0.005,
            tilt_nm_per_rad: 6.0,
            contact_exponent: 0.15,
            toe_share: 0.3,
            nonlinear: 0.15,
        }
    }
}

impl Floor {
    /// No floor beyond what the files say: for comparison only.
    pub fn none() -> Floor {
        Floor {
            force_n: 0.0,
            moment_nm: 0.0,
            repositioning: 0.0,
            attachment_mm: 0.0,
            contact_share: 0.0,
            contact_law: 0.0,
            roughness: 0.0,
            tilt_nm_per_rad: 0.0,
            contact_exponent: 0.0,
            toe_share: 0.0,
            nonlinear: 0.0,
            ..Floor::default()
        }
    }
}

/// The readings that were measured, as (trial, coordinate), and their values [deg, mm].
#[derive(Clone, Debug)]
pub struct Readings {
    /// Trial and coordinate of each.
    pub rows: Vec<(usize, Coordinate)>,
    /// Measured values.
    pub measured: DVector<f64>,
}

impl Readings {
    /// Of the trials that `keep` wants.
    pub fn of(problem: &Problem, keep: &dyn Fn(usize) -> bool) -> Readings {
        let mut rows = Vec::new();
        let mut measured = Vec::new();
        for (i, t) in problem.trials.iter().enumerate().filter(|(i, _)| keep(*i)) {
            for (c, value) in t.record.measured.each() {
                if let Some(v) = value {
                    rows.push((i, c));
                    measured.push(*v);
                }
            }
        }
        Readings { rows, measured: DVector::from_vec(measured) }
    }

    /// These entries of a list of five a trial.
    pub fn pick(&self, all: &[f64]) -> DVector<f64> {
        DVector::from_iterator(self.rows.len(), self.rows.iter().map(|(i, c)| all[row_of(*i, *c)]))
    }

    /// These rows of a matrix of five a trial.
    pub fn rows_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), all.ncols(), |r, k| all[(row_of(self.rows[r].0, self.rows[r].1), k)])
    }

    /// These rows and columns of a square matrix.
    pub fn block_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        let at = |r: usize| row_of(self.rows[r].0, self.rows[r].1);
        DMatrix::from_fn(self.rows.len(), self.rows.len(), |r, k| all[(at(r), at(k))])
    }
}

/// Derivatives that the scatter needs, of one trial.
struct Scatter {
    loads: Free<Free<f64>>,
    attachments: Vec<Free<f64>>,
    compartments: Vec<Free<f64>>,
    /// Contact force [N].
    pressed: f64,
    /// By the model's own contact in place of that of the diagnosis.
    own_contact: Free<f64>,
    /// By a resistance to tilt [per N mm/rad].
    tilt: Free<f64>,
    /// By the thickness of each compartment's cartilage [per mm]; empty where that is known.
    thickness: Vec<Free<f64>>,
    /// By the exponent of the contact's law and by the width of the ligaments' toe, as shares.
    laws: [Free<f64>; 2],
}

/// Contact force at which another exponent of its law changes nothing [N]; the law's scale is free beside it.
const REFERENCE: f64 = 100.0;

/// What all fibres gain in tension as their toes become wider ([`sim::ligament::Bundle::gain_by_wider_toe`]), as generalised forces; of what effects
/// leave of them.
fn wider_toe(bench: &Bench, states: &[FibreState]) -> Six {
    let model = bench.model;
    model.fibres.iter().zip(states).filter(|(_, s)| s.response.force > 0.0).fold(Six::zeros(), |sum, (fibre, state)| {
        let b = &model.bundles[fibre.bundle];
        let stretch = state.line.length - fibre.initial_length + b.initial_stretch();
        sum + state.line.gradient * (b.gain_by_wider_toe(stretch) * bench.left(fibre.bundle))
    })
}

/// Covariance of all readings (five a trial) about the predictions at an answer.
///
/// Errors: a model that cannot be evaluated there.
pub fn covariance(
    problem: &Problem,
    hypothesis: &[Candidate],
    unknowns: &[f64],
    rests: &[Equilibrium],
    floor: &Floor,
) -> Result<DMatrix<f64>, DiagnosisError> {
    let models = problem.models_at(unknowns)?;
    let trials = problem.unloaded_at(&problem.trials, &models, hypothesis);
    let scatter: Vec<Scatter> = trials
        .par_iter()
        .zip(rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, hypothesis, unknowns);
            let bench = Bench { model: models.of(trial.source), effects: &effects, place: &problem.place };
            scatter_of(bench, trial, rest, problem.cartilage_mm > 0.0)
        })
        .collect();
    Ok(assemble(problem, &scatter, floor))
}

/// Derivatives that the scatter needs, of a trial at its rest.
fn scatter_of(bench: Bench, trial: &Trial, rest: &Equilibrium, with_thickness: bool) -> Scatter {
    let jacobian = Jacobian::new(bench, trial, rest);
    let model = bench.model;
    let pushed = |(f, m): &(meshes::Vector, meshes::Vector), pose: &Pose| {
        Six::from_fn(|j, _| -(f.dot(&pose.screws[j].linear) + m.dot(&pose.screws[j].angular)))
    };
    let compartments = jacobian.of_the_knee(|at| {
        let there = jacobian.at(at);
        there.contact.wrench.iter().map(|w| pushed(w, &there.pose)).collect()
    });
    let laws = jacobian.of_the_knee(|at| {
        let there = jacobian.at(at);
        let steeper = |(f, m): &(meshes::Vector, meshes::Vector)| {
            let more = (f.norm() / REFERENCE).max(1e-6).ln();
            pushed(&(f * more, m * more), &there.pose)
        };
        vec![there.contact.wrench.iter().map(steeper).sum(), wider_toe(&bench, &there.fibres)]
    });
    let thickness = |at: &At| {
        let pose = &jacobian.at(at).pose;
        let sides = [THICKER, -THICKER].map(|by| at.wrenches_above(model, by));
        let differs = |(up, down)| (pushed(up, pose) - pushed(down, pose)) / (2.0 * THICKER);
        sides[0].iter().zip(&sides[1]).map(differs).collect()
    };
    let mut tilted = Six::zeros();
    tilted[VV] = rest.q[VV] - trial.unloaded.q[VV];
    Scatter {
        loads: jacobian.loads(),
        attachments: jacobian.attachments(),
        compartments: modes(&compartments),
        pressed: jacobian.loaded().contact.wrench.iter().map(|(f, _)| f.norm()).sum(),
        own_contact: jacobian.own_contact(),
        tilt: jacobian.by(&tilted, &Six::zeros()),
        thickness: if with_thickness { jacobian.of_the_knee(thickness) } else { vec![] },
        laws: [laws[0], laws[1]],
    }
}

/// Change of a cartilage's thickness over which derivatives are taken [mm].
const THICKER: f64 = 0.02;
/// Distance over which cartilage is as much off at one place as at another [mm], about half a plateau's depth: the bearing surface leans by as much over it.
const LEANS_OVER_MM: f64 = 12.0;

/// Part of the contact's share that all compartments have in common: more would hide joint compression, and the contact's scale is free anyway.
const COMMON: f64 = 0.2;

/// Responses to each compartment's force as deviations from their mean, and a little of the mean.
fn modes(each: &[Free<f64>]) -> Vec<Free<f64>> {
    let n = each.len().max(1) as f64;
    let mean: Free<f64> = Free::from_fn(|c| each.iter().map(|p| p[c]).sum::<f64>() / n);
    let mut out: Vec<Free<f64>> = each.iter().map(|p| Free::from_fn(|c| p[c] - mean[c])).collect();
    out.push(mean.map(|m| COMMON * n * m));
    out
}

/// Lever of the roughness of cartilage by coordinate [mm, -]: moments by the distance of the compartments, nothing along the tibial axis.
const ROUGH: Free<f64> = Free([20.0, 20.0, 1.0, 1.0, 0.0]);

fn assemble(problem: &Problem, scatter: &[Scatter], floor: &Floor) -> DMatrix<f64> {
    let n = problem.trials.len();
    let fibre = floor.attachment_mm.powi(2);
    let loads = Free::from_fn(|l| if l.turns() { 1000.0 * floor.moment_nm } else { floor.force_n });
    let tilt = (1000.0 * floor.tilt_nm_per_rad).powi(2);
    let law = floor.contact_law.powi(2);
    let laws = [floor.contact_exponent.powi(2), floor.toe_share.powi(2)];
    // half of a cartilage's error is that of a compartment, half changes with the place where it bears
    let cartilage = 0.5 * problem.cartilage_mm.powi(2);
    let lean = (problem.cartilage_mm / LEANS_OVER_MM).powi(2);
    let range = floor.contact_range_deg.max(1.0).to_radians();
    let mut out = DMatrix::zeros(5 * n, 5 * n);
    for i in 0..n {
        for k in 0..=i {
            let (a, b) = (&scatter[i], &scatter[k]);
            let (ti, tk) = (&problem.trials[i], &problem.trials[k]);
            let near = (-0.5 * ((ti.flexion() - tk.flexion()) / range).powi(2)).exp();
            let contact = (1.0 + near) * floor.contact_share.powi(2);
            for c in FREE {
                for d in FREE {
                    let sum = |x: &[Free<f64>], y: &[Free<f64>]| x.iter().zip(y).map(|(u, v)| u[c] * v[d]).sum::<f64>();
                    let mut v = fibre * sum(&a.attachments, &b.attachments)
                        + contact * sum(&a.compartments, &b.compartments)
                        + tilt * a.tilt[c] * b.tilt[d]
                        + law * a.own_contact[c] * b.own_contact[d]
                        + (0..2).map(|l| laws[l] * a.laws[l][c] * b.laws[l][d]).sum::<f64>();
                    if cartilage > 0.0 {
                        let across = |l: Coordinate| a.pressed * a.loads[l][c] * b.pressed * b.loads[l][d];
                        v += (1.0 + near) * cartilage * sum(&a.thickness, &b.thickness)
                            + near * lean * (across(ML) + across(AP));
                    }
                    if ti.condition == tk.condition && c == d {
                        v += floor.repositioning.powi(2) * ti.sd[c] * tk.sd[c];
                    }
                    if i == k {
                        let rough = |l: Coordinate| floor.roughness * a.pressed * ROUGH[l];
                        let size = |l: Coordinate| loads[l].powi(2) + rough(l).powi(2);
                        v += FREE.into_iter().map(|l| size(l) * a.loads[l][c] * a.loads[l][d]).sum::<f64>();
                        if c == d {
                            v += ti.sd[c].powi(2);
                        }
                    }
                    out[(row_of(i, c), row_of(k, d))] = v;
                    out[(row_of(k, d), row_of(i, c))] = v;
                }
            }
        }
    }
    out
}

/// What linear prediction misses over the prior of ligaments and contact: mean square of the remainders, a block a trial. It is of the model as given
/// alone, about its own rests from the poses `starts`: a pose that the model does not rest in is no prediction, and how far it is from one is no scatter.
///
/// Errors: a model that cannot be evaluated.
pub fn remainders(
    problem: &Problem,
    starts: &[Start],
    draws: usize,
    floor: &Floor,
) -> Result<DMatrix<f64>, DiagnosisError> {
    let mut random = ChaCha8Rng::seed_from_u64(20_251);
    let (n, m) = (problem.trials.len(), problem.nuisances());
    let given = vec![0.0; m];
    let linear = problem.linear_at(&[], &given, problem.rests(&[], &given, starts)?)?;
    let starts = starts_of(&linear.rests);
    let spread = if problem.nuisance.are_of_a_built_knee() { posterior_root(problem, &linear, floor)? } else { None };
    let mut out = DMatrix::zeros(5 * n, 5 * n);
    for _ in 0..draws {
        let mut x: Vec<f64> = (0..m).map(|_| normal(&mut random)).collect();
        if let Some(root) = &spread {
            x = (root * DVector::from_column_slice(&x)).iter().copied().collect();
        }
        let rests = problem.rests(&[], &x, &starts)?;
        let first = &linear.jacobian * DVector::from_column_slice(&x);
        for (i, rest) in rests.iter().enumerate() {
            let there = crate::problem::reading(rest);
            let left: Free<f64> = Free::from_fn(|c| there[c] - linear.value[row_of(i, c)] - first[row_of(i, c)]);
            for c in FREE {
                for d in FREE {
                    out[(row_of(i, c), row_of(i, d))] += left[c] * left[d] / draws as f64;
                }
            }
        }
    }
    Ok(out)
}

/// A root of the covariance that linear data leave the nuisance parameters: a built knee's priors are far wider than what matters once it was measured.
fn posterior_root(problem: &Problem, linear: &Linear, floor: &Floor) -> Result<Option<DMatrix<f64>>, DiagnosisError> {
    let given = vec![0.0; problem.nuisances()];
    let readings = Readings::of(problem, &|_| true);
    let scatter = readings.block_of(&covariance(problem, &[], &given, &linear.rests, floor)?);
    let white = Whitening::new(scatter)?.white(&readings.rows_of(&linear.jacobian));
    let curvature = DMatrix::identity(given.len(), given.len()) + white.tr_mul(&white);
    Ok(Cholesky::new(curvature).and_then(|c| Cholesky::new(c.inverse())).map(|c| c.l()))
}

/// A standard normal number [box1958].
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).max(1e-300).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}
