//! Knees of one population: a mean that all share and each knee's own deviation, as normal distributions whose posterior is known in closed form.
//!
//! Each number is standard normal before anything is measured. That is parted in two: a mean of all knees, of variance `rho`, and each knee's own
//! deviation from it, of variance `1 - rho`. So one knee alone has the prior that it had. How much is shared, `rho`, is not known: it has a
//! value of each sort of numbers, and all that is told is averaged over a grid, weighed by what the knees' data say of it [gelman2013].

use super::message::Message;
use crate::shared::Sort;
use nalgebra::{DMatrix, DVector};

/// Shares of the variance that are tried [-]. All are as likely before. Ours: steps that thirty knees cannot tell apart.
pub const SHARES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 0.95];

/// How much is shared of each sort of numbers [-].
pub type Shares = [f64; Sort::ALL.len()];

/// Numbers that are looked at together, and what each knee's data say of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The sort of each number.
    pub sorts: Vec<Sort>,
    /// A message of each knee, in the order of the knees.
    pub messages: Vec<Message>,
}

/// What the other knees say of a knee's numbers, before its own data are looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Mean of each number [-], in standard deviations of its own prior.
    pub mean: DVector<f64>,
    /// Their covariance [-].
    pub covariance: DMatrix<f64>,
}

/// What the others say of a group, averaged over shares; and how much is shared, as they have it.
#[derive(Clone, Debug, PartialEq)]
pub struct Averaged {
    /// Of each group: mean and standard deviation of each number [-].
    pub groups: Vec<Vec<[f64; 2]>>,
    /// Mean of each share [-].
    pub shares: Shares,
}

/// What knees say of the mean that all share.
struct OfMean {
    message: Message,
    log_evidence: f64,
}

impl Group {
    /// Variances of the mean and of a knee's own deviation.
    fn variances(&self, shares: &Shares) -> [DMatrix<f64>; 2] {
        let of = |f: &dyn Fn(f64) -> f64| {
            let each = self.sorts.iter().map(|s| f(shares[s.place()]));
            DMatrix::from_diagonal(&DVector::from_iterator(self.sorts.len(), each))
        };
        [of(&|r| r), of(&|r| 1.0 - r)]
    }

    /// What each knee's data say of the mean, its own deviation integrated over.
    fn of_mean(&self, shares: &Shares) -> Vec<OfMean> {
        let [_, own] = self.variances(shares);
        self.messages.iter().map(|m| marginal(m, &own)).collect()
    }

    /// What all knees but `left_out` say, where that much is shared; and the logarithm of how likely their data are then, up to what all shares
    /// have in common.
    fn told(&self, of_mean: &[OfMean], left_out: Option<usize>, shares: &Shares) -> (Told, f64) {
        let [between, own] = self.variances(shares);
        let n = self.sorts.len();
        let (mut sum, mut log_evidence) = (Message::nothing(n), 0.0);
        for (_, one) in of_mean.iter().enumerate().filter(|(k, _)| Some(*k) != left_out) {
            sum.precision += &one.message.precision;
            sum.shift += &one.message.shift;
            log_evidence += one.log_evidence;
        }
        let (inverse, log_det) = inverse_of_one_and(&(&between * &sum.precision));
        let covariance = inverse * &between;
        let mean = &covariance * &sum.shift;
        log_evidence += 0.5 * (sum.shift.dot(&mean) - log_det);
        (Told { mean, covariance: covariance + own }, log_evidence)
    }

    /// What all knees but `left_out` say of another knee, where `shares` are known.
    pub fn others(&self, left_out: Option<usize>, shares: &Shares) -> Told {
        self.told(&self.of_mean(shares), left_out, shares).0
    }
}

/// A message about a knee's numbers as one about the mean, where the knee deviates from it by these variances.
fn marginal(message: &Message, own: &DMatrix<f64>) -> OfMean {
    let Message { precision, shift } = message;
    let (inverse, log_det) = inverse_of_one_and(&(own * precision));
    let to_mean = precision * &inverse;
    let deviation = &inverse * own * shift;
    OfMean {
        // rounding leaves it nearly symmetric
        message: Message { precision: 0.5 * (&to_mean + to_mean.transpose()), shift: inverse.transpose() * shift },
        log_evidence: 0.5 * (shift.dot(&deviation) - log_det),
    }
}

/// The inverse of one and a matrix, and the logarithm of its determinant. The matrix is a product of two that have no eigenvalue below 0, so neither
/// has it, and the inverse is there.
fn inverse_of_one_and(m: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let n = m.nrows();
    let sum = DMatrix::identity(n, n) + m;
    let parted = sum.lu();
    let log_det = parted.determinant().abs().ln();
    (parted.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n)), log_det)
}

/// Every combination of shares of the sorts that groups have; others stay at the first.
fn grid(groups: &[Group]) -> Vec<Shares> {
    let mut out = vec![[SHARES[0]; Sort::ALL.len()]];
    for sort in Sort::ALL.into_iter().filter(|s| groups.iter().any(|g| g.sorts.contains(s))) {
        let with = |old: &Shares| {
            let old = *old;
            SHARES.map(move |share| {
                let mut new = old;
                new[sort.place()] = share;
                new
            })
        };
        out = out.iter().flat_map(with).collect();
    }
    out
}

/// What all knees but one say, for each that is left out; nobody left out: what all of them say. The message of the knee that is left out counts
/// nowhere in what it is told: not in the mean, nor in how much is shared.
pub fn told_to(groups: &[Group], whom: &[Option<usize>]) -> Vec<Averaged> {
    let mut sums: Vec<Sum> = whom.iter().map(|_| Sum::default()).collect();
    for shares in grid(groups) {
        let of_means: Vec<Vec<OfMean>> = groups.iter().map(|g| g.of_mean(&shares)).collect();
        for (left_out, sum) in whom.iter().zip(&mut sums) {
            let told: Vec<(Told, f64)> =
                groups.iter().zip(&of_means).map(|(g, m)| g.told(m, *left_out, &shares)).collect();
            sum.add(&told, &shares);
        }
    }
    sums.into_iter().map(Sum::mean).collect()
}

/// A mean over shares in the making.
#[derive(Default)]
struct Sum {
    /// Logarithm of the largest weight so far, and the weights' sum over it.
    weight: Option<(f64, f64)>,
    /// Of each group and number: means, and squares with variances.
    numbers: Vec<Vec<[f64; 2]>>,
    shares: Shares,
}

impl Sum {
    fn add(&mut self, told: &[(Told, f64)], shares: &Shares) {
        let log_weight: f64 = told.iter().map(|t| t.1).sum();
        let (most, sum) = self.weight.unwrap_or((log_weight, 0.0));
        let (now, before) = match log_weight > most {
            true => (1.0, (most - log_weight).exp()),
            false => ((log_weight - most).exp(), 1.0),
        };
        self.weight = Some((most.max(log_weight), sum * before + now));
        if self.numbers.is_empty() {
            self.numbers = told.iter().map(|(t, _)| vec![[0.0; 2]; t.mean.len()]).collect();
        }
        for (own, (t, _)) in self.numbers.iter_mut().zip(told) {
            for (k, [mean, square]) in own.iter_mut().enumerate() {
                *mean = *mean * before + t.mean[k] * now;
                *square = *square * before + (t.covariance[(k, k)] + t.mean[k].powi(2)) * now;
            }
        }
        for (own, share) in self.shares.iter_mut().zip(shares) {
            *own = *own * before + share * now;
        }
    }

    fn mean(self) -> Averaged {
        let all = self.weight.map_or(1.0, |w| w.1);
        let one = |[mean, square]: [f64; 2]| {
            let mean = mean / all;
            [mean, (square / all - mean * mean).max(0.0).sqrt()]
        };
        Averaged {
            groups: self.numbers.into_iter().map(|g| g.into_iter().map(one).collect()).collect(),
            shares: self.shares.map(|s| s / all),
        }
    }
}

#[cfg(test)]
mod tests;
