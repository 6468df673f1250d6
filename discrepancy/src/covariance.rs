//! How far readings may lie from predictions when nothing is missing: measurement, load, repositioning, attachments, and the declared floor of
//! the contact model.

use crate::equilibrium::Bench;
use crate::error::DiscrepancyError;
use crate::problem::{Candidate, Linear, Problem, Slopes};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::contact::Nearby;
use sim::joint::{Six, VV};

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
    /// Measured: docs/discrepancy.md.
    pub contact_share: f64,
    /// Flexion over which that difference changes [deg].
    pub contact_range_deg: f64,
    /// Share, in common to all trials, that the model's own contact may have in the truth beside that of the diagnosis ([`crate::rim`]) [-].
    pub contact_law: f64,
    /// Share of the contact force that facets and friction of the contact may add to a trial across it, by a lever of 20 mm for moments [-].
    pub roughness: f64,
    /// Resistance to tilt that the rims of the contact may add or lack, alike at all flexions [N m/rad]. Measured: docs/discrepancy.md.
    pub tilt_nm_per_rad: f64,
    /// Part of what is not linear in the ligaments, over their prior, that stays as scatter [-].
    pub nonlinear: f64,
}

impl Default for Floor {
    fn default() -> Self {
        Floor {
            force_n: 2.0,
            moment_nm: 0.1,
            repositioning: 0.4,
            attachment_mm: 0.4,
            contact_share: 0.06,
            contact_range_deg: 25.0,
            contact_law: 0.3,
            roughness: 0.005,
            tilt_nm_per_rad: 6.0,
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
            nonlinear: 0.0,
            ..Floor::default()
        }
    }
}

/// The readings that were measured, as (trial, coordinate), and their values [deg, mm].
#[derive(Clone, Debug)]
pub struct Readings {
    /// Trial and coordinate of each.
    pub rows: Vec<(usize, usize)>,
    /// Measured values.
    pub measured: DVector<f64>,
}

impl Readings {
    /// Of the trials that `keep` wants.
    pub fn of(problem: &Problem, keep: &dyn Fn(usize) -> bool) -> Readings {
        let mut rows = Vec::new();
        let mut measured = Vec::new();
        for (i, t) in problem.trials.iter().enumerate().filter(|(i, _)| keep(*i)) {
            for (c, value) in t.measured.iter().enumerate() {
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
        DVector::from_iterator(self.rows.len(), self.rows.iter().map(|(i, c)| all[5 * i + c]))
    }

    /// These rows of a matrix of five a trial.
    pub fn rows_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows.len(), all.ncols(), |r, k| all[(5 * self.rows[r].0 + self.rows[r].1, k)])
    }

    /// These rows and columns of a square matrix.
    pub fn block_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        let at = |r: usize| 5 * self.rows[r].0 + self.rows[r].1;
        DMatrix::from_fn(self.rows.len(), self.rows.len(), |r, k| all[(at(r), at(k))])
    }
}

/// Derivatives that the scatter needs, of one trial.
struct Scatter {
    loads: [[f64; 5]; 5],
    attachments: Vec<[f64; 5]>,
    compartments: Vec<[f64; 5]>,
    /// Contact force [N].
    pressed: f64,
    /// By the model's own contact in place of that of the diagnosis.
    own_contact: [f64; 5],
    /// By a resistance to tilt [per N mm/rad].
    tilt: [f64; 5],
}

/// Covariance of all readings (five a trial) about the predictions at an answer.
///
/// Errors: a model that cannot be evaluated there.
pub fn covariance(
    problem: &Problem,
    hypothesis: &[Candidate],
    unknowns: &[f64],
    rests: &[crate::equilibrium::Rest],
    floor: &Floor,
) -> Result<DMatrix<f64>, DiscrepancyError> {
    let model = problem.model_at(unknowns)?;
    let n = problem.trials.len();
    let scatter: Vec<Scatter> = (0..n)
        .into_par_iter()
        .map(|i| {
            let trial = &problem.trials[i];
            let effects = problem.effects_in(trial.source, hypothesis, unknowns);
            let bench = Bench { model: &model, effects: &effects, place: &problem.place };
            let slopes = Slopes::new(bench, trial, &rests[i]);
            let pose = model.joint.pose(&rests[i].q);
            let compartments = model.contact_near(&pose, &mut Nearby::default()).wrench;
            let push = |(f, m): &(meshes::Vector, meshes::Vector)| {
                let mut miss = Six::from_fn(|j, _| -(f.dot(&pose.screws[j].linear) + m.dot(&pose.screws[j].angular)));
                miss[0] = 0.0;
                slopes.by(&miss, &Six::zeros())
            };
            let pressed = compartments.iter().map(|(f, _)| f.norm()).sum();
            Scatter {
                loads: slopes.loads(),
                attachments: slopes.attachments(),
                compartments: modes(&compartments.iter().map(push).collect::<Vec<_>>()),
                pressed,
                own_contact: slopes.own_contact(),
                tilt: {
                    let mut miss = Six::zeros();
                    miss[VV] = rests[i].q[VV] - trial.neutral[VV];
                    slopes.by(&miss, &Six::zeros())
                },
            }
        })
        .collect();
    Ok(assemble(problem, &scatter, floor))
}

/// Part of the contact's share that all compartments have in common: more would hide joint compression, and the contact's scale is free anyway.
const COMMON: f64 = 0.2;

/// Responses to each compartment's force as deviations from their mean, and a little of the mean.
fn modes(each: &[[f64; 5]]) -> Vec<[f64; 5]> {
    let n = each.len().max(1) as f64;
    let mean: [f64; 5] = std::array::from_fn(|c| each.iter().map(|p| p[c]).sum::<f64>() / n);
    let mut out: Vec<[f64; 5]> = each.iter().map(|p| std::array::from_fn(|c| p[c] - mean[c])).collect();
    out.push(mean.map(|m| COMMON * n * m));
    out
}

fn assemble(problem: &Problem, scatter: &[Scatter], floor: &Floor) -> DMatrix<f64> {
    let n = problem.trials.len();
    let fibre = floor.attachment_mm.powi(2);
    let loads: [f64; 5] =
        [1000.0 * floor.moment_nm, 1000.0 * floor.moment_nm, floor.force_n, floor.force_n, floor.force_n];
    let tilt = (1000.0 * floor.tilt_nm_per_rad).powi(2);
    let law = floor.contact_law.powi(2);
    let range = floor.contact_range_deg.max(1.0).to_radians();
    let mut out = DMatrix::zeros(5 * n, 5 * n);
    for i in 0..n {
        for k in 0..=i {
            let (a, b) = (&scatter[i], &scatter[k]);
            let (ti, tk) = (&problem.trials[i], &problem.trials[k]);
            let near = (-0.5 * ((ti.flexion - tk.flexion) / range).powi(2)).exp();
            let contact = (1.0 + near) * floor.contact_share.powi(2);
            for c in 0..5 {
                for d in 0..5 {
                    let sum = |x: &[[f64; 5]], y: &[[f64; 5]]| x.iter().zip(y).map(|(u, v)| u[c] * v[d]).sum::<f64>();
                    let mut v = fibre * sum(&a.attachments, &b.attachments)
                        + contact * sum(&a.compartments, &b.compartments)
                        + tilt * a.tilt[c] * b.tilt[d]
                        + law * a.own_contact[c] * b.own_contact[d];
                    if ti.condition == tk.condition && c == d {
                        v += floor.repositioning.powi(2) * ti.sd[c] * tk.sd[c];
                    }
                    if i == k {
                        let rough = |l: usize| floor.roughness * a.pressed * [20.0, 20.0, 1.0, 1.0, 0.0][l];
                        let size = |l: usize| loads[l].powi(2) + rough(l).powi(2);
                        v += (0..5).map(|l| size(l) * a.loads[l][c] * a.loads[l][d]).sum::<f64>();
                        if c == d {
                            v += ti.sd[c].powi(2);
                        }
                    }
                    out[(5 * i + c, 5 * k + d)] = v;
                    out[(5 * k + d, 5 * i + c)] = v;
                }
            }
        }
    }
    out
}

/// What linear prediction misses over the prior of ligaments and contact: mean square of the remainders, a block a trial.
///
/// Errors: a model that cannot be evaluated.
pub fn remainders(problem: &Problem, linear: &Linear, draws: usize) -> Result<DMatrix<f64>, DiscrepancyError> {
    let mut random = ChaCha8Rng::seed_from_u64(20_251);
    let (n, m) = (problem.trials.len(), problem.nuisances());
    let starts: Vec<Six> = linear.rests.iter().map(|r| r.q).collect();
    let mut out = DMatrix::zeros(5 * n, 5 * n);
    for _ in 0..draws {
        let x: Vec<f64> = (0..m).map(|_| normal(&mut random)).collect();
        let rests = problem.rests(&[], &x, &starts)?;
        let first = &linear.slope * DVector::from_column_slice(&x);
        for (i, rest) in rests.iter().enumerate() {
            let there = crate::problem::reading(rest);
            let left: [f64; 5] = std::array::from_fn(|c| there[c] - linear.value[5 * i + c] - first[5 * i + c]);
            for c in 0..5 {
                for d in 0..5 {
                    out[(5 * i + c, 5 * i + d)] += left[c] * left[d] / draws as f64;
                }
            }
        }
    }
    Ok(out)
}

/// A standard normal number [box1958].
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).max(1e-300).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

/// A covariance in Cholesky's form.
#[derive(Clone, Debug)]
pub struct Whitening(Cholesky<f64, Dyn>);

impl Whitening {
    /// Factorises.
    ///
    /// Errors: a matrix that is not positive definite.
    pub fn new(covariance: DMatrix<f64>) -> Result<Whitening, DiscrepancyError> {
        Cholesky::new(covariance)
            .map(Whitening)
            .ok_or_else(|| DiscrepancyError::Data("the readings' covariance is not positive definite".into()))
    }

    /// Whitens the columns.
    pub fn white(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.0.l_dirty().solve_lower_triangular(m).unwrap_or_else(|| m.clone())
    }

    /// Whitens a vector.
    pub fn white_vector(&self, v: &DVector<f64>) -> DVector<f64> {
        self.0.l_dirty().solve_lower_triangular(v).unwrap_or_else(|| v.clone())
    }

    /// The inverse times a vector.
    pub fn solve(&self, v: &DVector<f64>) -> DVector<f64> {
        self.0.solve(v)
    }

    /// The inverse of the covariance.
    pub fn inverse(&self) -> DMatrix<f64> {
        self.0.inverse()
    }

    /// Log of the determinant.
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.0.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    }

    /// The lower factor.
    pub fn lower(&self) -> DMatrix<f64> {
        self.0.l()
    }
}
