//! Readings of a knee in trials: poses, or displacements from the pose of another trial, as an apparatus shows them.

use super::jacobian::Jacobian;
use super::{Answer, Answers, Quantity, Trials};
use crate::posterior::Point;
use crate::trial::Trial;
use nalgebra::{DMatrix, DVector};
use sim::coordinate::{Coordinate, FREE, Free};

impl Trials<'_> {
    /// Readings that count, in order: trial and coordinate.
    pub fn rows(&self) -> Vec<(usize, Coordinate)> {
        let of =
            |(i, t): (usize, &Trial)| FREE.into_iter().filter(|&c| t.reads[c]).map(move |c| (i, c)).collect::<Vec<_>>();
        self.trials.iter().enumerate().flat_map(of).collect()
    }

    /// What is read in a trial at these values: VV, IE [deg], ML, AP, SI [mm].
    pub fn read(&self, values: &[f64], answers: &Answers, trial: usize) -> Free<f64> {
        let zero = self.trials[trial].from.map(|from| answers[from].predicted);
        self.reading(values, trial, &answers[trial].predicted, zero.as_ref())
    }

    /// What the apparatus reads of a pose in a trial, `zero` being the pose from which it counts: VV, IE [deg], ML, AP, SI [mm].
    pub fn reading(&self, values: &[f64], trial: usize, pose: &Free<f64>, zero: Option<&Free<f64>>) -> Free<f64> {
        let of = |c: Coordinate| {
            let yields = |(p, x): (&crate::parameter::Parameter<Quantity>, &f64)| x * self.load_step(p, trial, c);
            let apparatus = self.parameters.iter().zip(values).map(yields).sum::<f64>();
            pose[c] - zero.map_or(0.0, |z| z[c]) + apparatus
        };
        Free::from_fn(of)
    }

    /// The load by which a parameter of the apparatus' compliance moves a displacement [N m, N]; 0 of every other parameter, and of a pose.
    fn load_step(&self, p: &crate::parameter::Parameter<Quantity>, trial: usize, coordinate: Coordinate) -> f64 {
        let t = &self.trials[trial];
        match (&p.quantity, t.from) {
            (Quantity::Compliance(source, of), Some(from)) if t.source == Some(*source) && *of == coordinate => {
                t.record.load[coordinate] - self.trials[from].record.load[coordinate]
            }
            _ => 0.0,
        }
    }

    /// The answers that a reading is made of, with their signs.
    fn parts(&self, trial: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        std::iter::once((trial, 1.0)).chain(self.trials[trial].from.map(|from| (from, -1.0)))
    }

    /// Covariance of the readings by loads that are not as recorded, and by loads that the model lacks.
    pub(super) fn shared_scatter(&self, state: &Answers) -> DMatrix<f64> {
        let (rows, n) = (self.rows(), self.trials.len());
        let alike =
            DMatrix::from_fn(n, n, |i, k| self.discrepancy.alike(&self.trials[i].record, &self.trials[k].record));
        let size = |i: usize, k: usize, l: Coordinate| {
            let own = if i == k { self.load_sd[l].powi(2) } else { 0.0 };
            own + alike[(i, k)] * self.discrepancy.sd[l].powi(2)
        };
        let both = |(i, c): (usize, Coordinate), (k, d): (usize, Coordinate)| -> f64 {
            FREE.into_iter().map(|l| state[i].by_load[c][l] * state[k].by_load[d][l] * size(i, k, l)).sum()
        };
        let of = |(i, c): (usize, Coordinate), (k, d): (usize, Coordinate)| -> f64 {
            let pairs = self.parts(i).flat_map(|a| self.parts(k).map(move |b| (a, b)));
            pairs.map(|((i, s), (k, t))| s * t * both((i, c), (k, d))).sum()
        };
        DMatrix::from_fn(rows.len(), rows.len(), |r, s| of(rows[r], rows[s]))
    }

    /// Answers and their derivatives as a point; `values` are those of the parameters, with their derivatives by the standard normal numbers.
    pub(super) fn point(&self, found: Vec<(Answer, Jacobian)>, values: &[(f64, f64)]) -> Point<Answers> {
        let (rows, n) = (self.rows(), values.len());
        let jacobian = DMatrix::from_fn(rows.len(), n, |r, k| {
            let (trial, c) = rows[r];
            let of_knee: f64 =
                self.parts(trial).map(|(i, sign)| sign * found[i].1.predicted[(c.free_index(), k)]).sum();
            (of_knee + self.load_step(&self.parameters[k], trial, c)) * values[k].1
        });
        let mut belief = DVector::zeros(self.beliefs.len());
        let mut belief_jacobian = DMatrix::zeros(self.beliefs.len(), n);
        for (r, b) in self.beliefs.iter().enumerate() {
            let (answer, jacobian) = &found[b.trial];
            let force: f64 = b.bundles.iter().map(|&k| answer.forces_n[k]).sum();
            belief[r] = (force - b.mean_n) / b.sd_n;
            for k in 0..n {
                let by: f64 = b.bundles.iter().map(|&m| jacobian.forces_n[(m, k)]).sum();
                belief_jacobian[(r, k)] = by * values[k].1 / b.sd_n;
            }
        }
        let state: Answers = found.into_iter().map(|f| f.0).collect();
        let plain: Vec<f64> = values.iter().map(|v| v.0).collect();
        let reading = DVector::from_iterator(rows.len(), rows.iter().map(|&(i, c)| self.read(&plain, &state, i)[c]));
        let one_side = self.beliefs.iter().map(|b| b.only_above).collect();
        Point { reading, jacobian, belief, belief_jacobian, one_side, state }
    }
}
