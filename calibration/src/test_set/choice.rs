//! A set chosen by samples of readings and of what is wanted, and what it leaves.

use crate::posterior::mean;
use nalgebra::{Cholesky, DMatrix, DVector};

/// A further test must take this share of what the tests before it leave [-]: less is no more than what sampling leaves open.
const WORTH: f64 = 0.02;

/// What tests of a knee read, and what is wanted of it.
pub(super) struct Known {
    /// Of each test its readings, samples by rows.
    pub(super) readings: Vec<DMatrix<f64>>,
    /// Variances of their columns.
    pub(super) noise: Vec<Vec<f64>>,
    /// What is wanted, by sample.
    pub(super) targets: Vec<DVector<f64>>,
}

/// A choice.
pub(super) struct Choice {
    /// Tests by number, and the share of the targets' spread that is left after each.
    pub(super) order: Vec<(usize, f64)>,
    /// Spread of each target, now and with all of them.
    pub(super) spread: Vec<(f64, f64)>,
}

impl Known {
    /// Spread of each target that a set of tests leaves.
    fn left(&self, set: &[usize]) -> Vec<f64> {
        let columns: Vec<DVector<f64>> =
            set.iter().flat_map(|k| self.readings[*k].column_iter().map(|c| c.into_owned())).collect();
        let noise: Vec<f64> = set.iter().flat_map(|k| self.noise[*k].clone()).collect();
        self.targets.iter().map(|t| left(&columns, &noise, t)).collect()
    }

    /// Tests chosen one by one, at most `count`.
    pub(super) fn chosen(&self, count: usize) -> Choice {
        let now = self.left(&[]);
        // what does not vary needs no test
        let share = |then: &[f64]| {
            mean(&then.iter().zip(&now).filter(|(_, n)| **n > 0.0).map(|(t, n)| t / n).collect::<Vec<_>>())
        };
        let (mut set, mut order, mut so_far, mut then) = (Vec::new(), Vec::new(), 1.0, now.clone());
        while order.len() < count {
            let tried = (0..self.readings.len()).filter(|k| !set.contains(k)).map(|k| {
                let spread = self.left(&[&set[..], &[k]].concat());
                (k, share(&spread), spread)
            });
            let Some((k, best, spread)) = tried.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if best > (1.0 - WORTH) * so_far {
                break;
            }
            set.push(k);
            order.push((k, best));
            (so_far, then) = (best, spread);
        }
        Choice { order, spread: now.into_iter().zip(then).collect() }
    }
}

/// Standard deviation of `target` about its best linear prediction from noisy readings, every sample predicted by the others [allen1974].
fn left(readings: &[DVector<f64>], noise: &[f64], target: &DVector<f64>) -> f64 {
    let n = target.len() as f64;
    let centred = |v: &DVector<f64>| v.add_scalar(-v.mean());
    let t = centred(target);
    let columns: Vec<DVector<f64>> = readings.iter().map(centred).collect();
    let y = DMatrix::from_fn(target.len(), columns.len(), |r, c| columns[c][r]);
    let noisy = DVector::from_row_slice(noise);
    let moments = y.transpose() * &y + DMatrix::from_diagonal(&(&noisy * (n - 1.0)));
    let Some(factor) = Cholesky::new(moments) else { return (t.norm_squared() / n).sqrt() };
    let solved = factor.solve(&y.transpose());
    let weights = &solved * &t;
    let fitted = &y * &weights;
    let of = |i: usize| {
        let leverage = y.row(i).transpose().dot(&solved.column(i)) + 1.0 / n;
        ((t[i] - fitted[i]) / (1.0 - leverage).max(1e-6)).powi(2)
    };
    let squares: f64 = (0..target.len()).map(of).sum();
    let blurred: f64 = weights.iter().zip(noise).map(|(w, v)| w * w * v).sum();
    (squares / n + blurred).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::random::{normals, stream};

    fn draws(k: u64, n: usize) -> DVector<f64> {
        normals(&mut stream(11, k), n)
    }

    fn column(v: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_column_slice(v.len(), 1, v.as_slice())
    }

    #[test]
    fn what_is_left_is_that_of_the_exact_posterior_where_all_is_normal() {
        let (a, b) = (draws(1, 4000), draws(2, 4000));
        // the target a + b, a read with noise of variance v: left is 1 + v / (1 + v)
        for v in [1e-6, 0.5, 2.0f64] {
            let exact = (1.0 + v / (1.0 + v)).sqrt();
            assert!((left(std::slice::from_ref(&a), &[v], &(&a + &b)) / exact - 1.0).abs() < 0.03, "{v}");
        }
        assert!(left(&[a.clone(), b.clone()], &[1e-9, 1e-9], &(&a + &b)) < 1e-3);
    }

    #[test]
    fn readings_that_tell_nothing_promise_nothing_however_many_there_are() {
        let t = draws(3, 40);
        let nothing = left(&[], &[], &t);
        for many in [1, 6, 12] {
            let y: Vec<DVector<f64>> = (0..many).map(|k| draws(10 + k, 40)).collect();
            assert!(left(&y, &vec![0.01; y.len()], &t) > 0.95 * nothing, "{many}");
        }
    }

    #[test]
    fn a_set_takes_what_tells_most_first_and_not_the_same_twice() {
        let (a, b) = (draws(1, 400), draws(2, 400));
        let targets = vec![&a * 2.0 + &b];
        let readings = vec![column(&draws(9, 400)), column(&b), column(&a), column(&(&a + draws(5, 400) * 1e-3))];
        let Choice { order, spread } = Known { readings, noise: vec![vec![0.01]; 4], targets }.chosen(4);
        let first: Vec<usize> = order.iter().map(|o| o.0).collect();
        assert!(first[0] >= 2 && first[1] == 1, "{first:?}");
        assert!(!first.contains(&0), "{first:?}");
        assert!(order.windows(2).all(|w| w[1].1 < w[0].1), "{order:?}");
        assert!(spread[0].1 < 0.15 * spread[0].0, "{spread:?}");
    }
}
