//! What a knee's measurements say of a few of its numbers, apart from what was believed before: a normal factor, from samples of both.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// A normal factor of some numbers `z`: the exponential of `shift . z - z . precision z / 2`. It may say nothing along some directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Precision: symmetric, no eigenvalue below 0.
    pub precision: DMatrix<f64>,
    /// Precision times the factor's mean.
    pub shift: DVector<f64>,
}

/// Samples of some numbers of a knee, by their means and covariances.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// After the measurement.
    after: Moments,
    /// Before it: what was believed.
    before: Moments,
}

#[derive(Clone, Debug, PartialEq)]
struct Moments {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    count: usize,
}

/// Least share of a number's variance that is removed by what says anything of it [-]: its standard deviation is narrower by 1 %. Ours: less is chance.
const LEAST_REMOVED: f64 = 0.02;

/// Least ratio of variances that samples are believed to tell [-]; ours: a standard deviation a hundred times as narrow as before.
const LEAST_RATIO: f64 = 1e-4;

impl Message {
    /// One that says nothing of `n` numbers.
    pub fn nothing(n: usize) -> Message {
        Message { precision: DMatrix::zeros(n, n), shift: DVector::zeros(n) }
    }

    /// Whether it says anything of each number: whether that varies less by it, from one standard normal and beside the others.
    pub fn says(&self) -> Vec<bool> {
        let n = self.shift.len();
        let left = (DMatrix::identity(n, n) + &self.precision).try_inverse();
        (0..n).map(|k| left.as_ref().is_some_and(|left| 1.0 - left[(k, k)] > LEAST_REMOVED)).collect()
    }

    /// Whether it says nothing.
    pub fn says_nothing(&self) -> bool {
        self.precision.iter().all(|x| *x == 0.0)
    }
}

impl Measured {
    /// From samples after a measurement and before it; `None` of fewer than two of either.
    pub fn of(after: &[DVector<f64>], before: &[DVector<f64>]) -> Option<Measured> {
        Some(Measured { after: Moments::of(after)?, before: Moments::of(before)? })
    }

    /// The same of some of its numbers, by their places.
    pub fn some(&self, places: &[usize]) -> Measured {
        let of = |m: &Moments| Moments {
            mean: m.mean.select_rows(places),
            covariance: m.covariance.select_rows(places).select_columns(places),
            count: m.count,
        };
        Measured { after: of(&self.after), before: of(&self.before) }
    }

    /// How many samples more than one there are, after the measurement and before it.
    pub(crate) fn freedom(&self) -> [f64; 2] {
        [&self.after, &self.before].map(|m| m.count as f64 - 1.0)
    }

    /// What its data say, by its own samples alone.
    pub fn alone(&self) -> Message {
        messages(&[self]).pop().unwrap_or_else(|| Message::nothing(self.after.mean.len()))
    }
}

impl Moments {
    fn of(samples: &[DVector<f64>]) -> Option<Moments> {
        let (n, count) = (samples.first()?.len(), samples.len());
        if count < 2 {
            return None;
        }
        let mean = samples.iter().fold(DVector::zeros(n), |sum, s| sum + s) / count as f64;
        let mut covariance = DMatrix::zeros(n, n);
        for s in samples {
            let off = s - &mean;
            covariance += &off * off.transpose();
        }
        Some(Moments { mean, covariance: covariance / (count as f64 - 1.0), count })
    }
}

/// A covariance of all knees, and how many numbers it has to go by.
fn pooled<'a>(all: impl Iterator<Item = &'a Moments> + Clone) -> Option<(DMatrix<f64>, f64)> {
    let freedom = |m: &Moments| m.count as f64 - 1.0;
    let sum: f64 = all.clone().map(freedom).sum();
    let parts = all.map(|m| &m.covariance * (freedom(m) / sum));
    Some((parts.reduce(|a, b| a + b)?, sum))
}

/// What knees' data say of the same numbers: of each, the density of its samples after the measurement over that before, both taken as normal.
///
/// Before the measurement a number need not be standard normal: beliefs about forces count then already, in each knee alike. They are no
/// measurement, so they are divided out.
///
/// Covariances by few samples err. So knees have one covariance after the measurement, and one before: the mean over the knees. Means are each
/// knee's own. Where knees are measured somewhat unlike, that counts the data for less than they are worth, since precisions are convex in
/// variances. A knee whose own covariance is larger than chance allows was measured less than the others, and has its own
/// ([`was_measured_less`]).
///
/// Of numbers that nothing was said of, some combination still varies less after than before, by chance. The least ratio that chance gives is known
/// [wachter1980]. All ratios are counted as larger by that much for the precision ([`inflation`]), not for the mean. The errors of means and
/// ratio are added. So a direction that the data leave open says next to nothing.
pub(crate) fn messages(all: &[&Measured]) -> Vec<Message> {
    let n = all.first().map_or(0, |m| m.after.mean.len());
    let (less, like): (Vec<usize>, Vec<usize>) = (0..all.len()).partition(|k| was_measured_less(all, *k) == Some(true));
    let mut out: Vec<Message> = all.iter().map(|_| Message::nothing(n)).collect();
    for knees in less.into_iter().map(|k| vec![k]).chain([like]) {
        let own: Vec<&Measured> = knees.iter().map(|k| all[*k]).collect();
        if let Some(directions) = Directions::of(&own, n) {
            knees.iter().for_each(|k| out[*k] = directions.message(all[*k]));
        }
    }
    out
}

/// How far beyond the usual largest ratio one must lie to be no chance, in standard deviations of the root of a variance [-]: four, since there
/// are many knees and numbers.
const NO_CHANCE: f64 = 4.0;

/// Whether a knee's samples after the measurement vary more along some combination than those of the others, beyond chance; `None` where that
/// cannot be told.
fn was_measured_less(all: &[&Measured], knee: usize) -> Option<bool> {
    let others = all.iter().enumerate().filter(|(k, _)| *k != knee).map(|(_, m)| &m.after);
    let (others, freedom) = pooled(others)?;
    let own = &all[knee].after;
    let (own_freedom, n) = (own.count as f64 - 1.0, own.mean.len() as f64);
    let (y, x) = (n / own_freedom, n / freedom);
    if y >= 1.0 || x >= 1.0 {
        return None;
    }
    let root = Cholesky::new(others)?.l();
    let half = root.solve_lower_triangular(&own.covariance)?;
    let ratios = symmetric(&root.solve_lower_triangular(&half.transpose())?).symmetric_eigenvalues();
    let edge = 1.0 + (x + y - x * y).sqrt() + NO_CHANCE / (2.0 * own_freedom).sqrt();
    Some(ratios.max() > (edge / (1.0 - x)).powi(2))
}

/// Combinations of numbers that vary by themselves before and after.
struct Directions {
    /// From numbers to combinations.
    into: DMatrix<f64>,
    /// Variance after over that before.
    ratios: DVector<f64>,
    /// By how much it is counted as larger.
    inflation: f64,
    /// Variance of the logarithm of a ratio, by few samples.
    error: f64,
}

impl Directions {
    /// `None` of too few samples, or where some combination does not vary.
    fn of(all: &[&Measured], n: usize) -> Option<Directions> {
        let (after, freedom) = pooled(all.iter().map(|m| &m.after))?;
        let (before, freedom_before) = pooled(all.iter().map(|m| &m.before))?;
        let inflation = inflation(n, [freedom, freedom_before])?;
        let root = Cholesky::new(before)?.l();
        let half = root.solve_lower_triangular(&after)?;
        let parted = SymmetricEigen::new(symmetric(&root.solve_lower_triangular(&half.transpose())?));
        let unmixed = root.solve_lower_triangular(&DMatrix::identity(n, n))?;
        Some(Directions {
            into: parted.eigenvectors.transpose() * unmixed,
            ratios: parted.eigenvalues.map(|r| r.max(LEAST_RATIO)),
            inflation,
            error: 2.0 / freedom + 2.0 / freedom_before,
        })
    }

    fn message(&self, of: &Measured) -> Message {
        let (after, before) = (&self.into * &of.after.mean, &self.into * &of.before.mean);
        let n = after.len();
        let (mut precisions, mut shifts) = (DVector::zeros(n), DVector::zeros(n));
        for k in 0..n {
            let (ratio, told) = (self.ratios[k], 1.0 / (self.inflation * self.ratios[k]) - 1.0);
            if told <= 0.0 {
                continue;
            }
            let removed = 1.0 - ratio;
            let mean = (after[k] - ratio * before[k]) / removed;
            let of_means =
                (ratio / of.after.count as f64 + ratio * ratio / of.before.count as f64) / (removed * removed);
            let by_ratio = ratio * (after[k] - before[k]) / (removed * removed);
            precisions[k] = 1.0 / (1.0 / told + of_means + by_ratio * by_ratio * self.error);
            shifts[k] = precisions[k] * mean;
        }
        let back = self.into.transpose();
        let precision = symmetric(&(&back * DMatrix::from_diagonal(&precisions) * &self.into));
        let message = Message { precision, shift: back * shifts };
        let is_finite = message.precision.iter().chain(message.shift.iter()).all(|x| x.is_finite());
        if is_finite { message } else { Message::nothing(n) }
    }
}

/// By how much a ratio of variances is counted as larger [-]: one over the least ratio of two covariances of `n` numbers that are alike, each
/// with so many numbers to go by, as these grow together [wachter1980]. `None` of too few.
pub(crate) fn inflation(n: usize, freedom: [f64; 2]) -> Option<f64> {
    let [y, x] = freedom.map(|f| n as f64 / f);
    let apt = n > 0 && y < 1.0 && x < 1.0;
    apt.then(|| ((1.0 - x) / (1.0 - (x + y - x * y).sqrt())).powi(2))
}

/// A matrix without what rounding has made of one that is symmetric.
fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (m + m.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::random::{normals, stream};

    /// Samples of a normal distribution of this mean and root of its covariance.
    fn drawn(seed: u64, count: usize, mean: &DVector<f64>, root: &DMatrix<f64>) -> Vec<DVector<f64>> {
        (0..count).map(|s| mean + root * normals(&mut stream(seed, s as u64), mean.len())).collect()
    }

    fn alone(after: &[DVector<f64>], before: &[DVector<f64>]) -> Message {
        Measured::of(after, before).unwrap().alone()
    }

    #[test]
    fn many_samples_give_what_was_measured_without_what_was_believed() {
        // believed: correlated numbers; measured: one combination of them
        let believed = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, -0.6, 0.5]);
        let (covariance, centre) = (&believed * believed.transpose(), DVector::from_vec(vec![0.3, -0.2]));
        let along = DVector::from_vec(vec![0.8, 0.6]);
        let (precision, reading) = (&along * along.transpose() * 9.0, 1.1);
        let shift = &along * (9.0 * reading);
        let inverse = covariance.clone().try_inverse().unwrap();
        let after = (&inverse + &precision).try_inverse().unwrap();
        let mean = &after * (&inverse * &centre + &shift);
        let root = Cholesky::new(after).unwrap().l();
        let told = alone(&drawn(1, 40_000, &mean, &root), &drawn(2, 40_000, &centre, &believed));
        let size = precision.norm();
        assert!((&told.precision - &precision).norm() < 0.08 * size, "{} {precision}", told.precision);
        assert!((&told.shift - &shift).norm() < 0.08 * shift.norm(), "{} {shift}", told.shift);
    }

    #[test]
    fn few_samples_of_what_was_not_measured_say_nearly_nothing() {
        for n in [1, 2, 4] {
            let (rounds, mean, root) = (200, DVector::zeros(n), DMatrix::identity(n, n));
            let one = |r: u64| alone(&drawn(100 + r, 48, &mean, &root), &drawn(9_000 + r, 48, &mean, &root));
            let told: Vec<Message> = (0..rounds).map(one).collect();
            let silent = told.iter().filter(|m| m.says_nothing()).count();
            let most = told.iter().map(|m| m.precision.trace()).sum::<f64>() / rounds as f64;
            assert!(silent * 5 > rounds as usize * 4, "{n} numbers: {silent} of {rounds} say nothing");
            assert!(most < 0.03 * n as f64, "{n} numbers: a precision of {most} in the mean");
        }
    }

    /// Thirty knees, a number each that was measured with this precision, and the sum of the readings: about 0.7 each, scattered by the precision and
    /// by 0.7 between knees.
    fn knees(precision: f64, seed: u64) -> (Vec<Measured>, f64) {
        let (variance, one) = (1.0 / (1.0 + precision), DMatrix::identity(1, 1));
        let root = DMatrix::from_element(1, 1, f64::sqrt(variance));
        let knee = |k: u64| {
            let noise = normals(&mut stream(seed, 500_000 + k), 2);
            let reading = 0.7 + 0.7 * noise[0] + noise[1] / precision.sqrt();
            let mean = DVector::from_element(1, reading * precision * variance);
            let after = drawn(seed + 2 * k, 48, &mean, &root);
            (Measured::of(&after, &drawn(seed + 2 * k + 1, 48, &DVector::zeros(1), &one)).unwrap(), reading)
        };
        let (all, readings): (Vec<Measured>, Vec<f64>) = (0..30).map(knee).unzip();
        (all, readings.iter().sum())
    }

    #[test]
    fn knees_together_say_what_each_measured_and_never_claim_more() {
        for precision in [0.5, 1.0, 3.0, 9.0] {
            let (mut sums, mut readings) = ([0.0; 2], 0.0);
            for seed in 0..10 {
                let (all, read) = knees(precision, 1000 * seed);
                readings += read / 300.0;
                for m in messages(&all.iter().collect::<Vec<_>>()) {
                    sums = [sums[0] + m.precision[(0, 0)], sums[1] + m.shift[0]];
                }
            }
            let (told, mean) = (sums[0] / 300.0, sums[1] / sums[0]);
            assert!((0.5..1.0).contains(&(told / precision)), "{precision}: {told}");
            // 48 samples of 300 knees leave 0.03 at the least precision
            assert!((mean - readings).abs() < 0.12, "{precision}: readings of {readings} are told as {mean}");
        }
    }

    #[test]
    fn a_knee_that_was_not_measured_says_nothing_among_others_that_were() {
        for others in [1, 2, 29] {
            let (measured, _) = knees(9.0, 3);
            let one = DMatrix::identity(1, 1);
            let open = |seed: u64| drawn(seed, 48, &DVector::zeros(1), &one);
            let open = Measured::of(&open(77), &open(77)).unwrap();
            let all: Vec<&Measured> = measured[..others].iter().chain([&open]).collect();
            let told = messages(&all);
            assert!(told[others].says_nothing(), "{others}: {:?}", told[others]);
            let without = messages(&all[..others]);
            assert_eq!(told[..others], without[..], "and changes nothing of what they say");
        }
    }

    #[test]
    fn too_few_samples_say_nothing() {
        let samples = drawn(1, 4, &DVector::zeros(3), &DMatrix::identity(3, 3));
        assert!(alone(&samples, &samples).says_nothing());
        assert!(Measured::of(&[], &samples).is_none() && Measured::of(&samples, &samples[..1]).is_none());
        let still = vec![DVector::zeros(2); 48];
        assert!(alone(&still, &still).says_nothing(), "a number that does not vary");
    }
}
