//! Which test would narrow the intervals of ligament forces most, had it been done: the variance that its reading would remove
//! [lindley1956], by the samples and the derivatives there are. No knee is solved again but for the tests themselves.

use crate::plateau::Staying;
use crate::posterior::{mean, variance};
use inference::knee::{Answers, Trials};
use inference::next_test::{BY_HAND, planned};
use inference::posterior::{Forward, Found};
use inference::trial::Trial;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, Free};
use sim::laxity::Test;

/// Flexions thought of [deg].
const FLEXIONS_DEG: [f64; 4] = [0.0, 30.0, 60.0, 90.0];
/// So many tests are told [-].
const TOLD: usize = 5;
/// A gain below this is no more than what sampling leaves open [%]: standard deviations from 64 samples scatter by as much.
const TELLING_PERCENT: f64 = 5.0;
/// Fewer samples tell no correlation [-].
const LEAST_SAMPLES: usize = 12;

/// A test worth doing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NextTest {
    /// Which.
    pub test: Test,
    /// At which flexion [deg].
    pub flexion_deg: f64,
    /// Its load [N m or N].
    pub load: f64,
    /// Standard deviation of a bundle's force in the drawers now, mean over bundles and drawers [N].
    pub sd_now_n: f64,
    /// Expected with the test [N].
    pub sd_after_n: f64,
}

impl NextTest {
    /// The best test and what it is worth.
    pub fn words(&self) -> String {
        let unit = self.test.coordinate().map_or("N", Coordinate::load_unit);
        let share = 100.0 * (1.0 - self.sd_after_n / self.sd_now_n);
        if share < TELLING_PERCENT {
            return format!("no single test would narrow them by more than {share:.0} %");
        }
        let (test, load, flexion) = (self.test.name(), self.load.abs(), self.flexion_deg);
        format!("a test {test} with {load} {unit} at {flexion} deg would narrow them most, by {share:.0} %")
    }
}

/// The unloaded knee and every test at each flexion; of each test, its place.
fn plan(compression_n: f64) -> (Vec<Trial>, Vec<(Test, f64, f64)>) {
    let (mut asked, mut told) = (Vec::new(), Vec::new());
    for fe_deg in FLEXIONS_DEG {
        let trial = |parts: &[(Test, f64)], from| {
            let reads = Free::from_fn(|c| parts.iter().any(|part| part.0.coordinate() == Some(c)));
            Trial { source: Some(0), reads, from, ..Trial::imagined(planned(parts, fe_deg, compression_n)) }
        };
        let zero = asked.len();
        asked.push(trial(&[], None));
        for (test, size) in BY_HAND {
            asked.push(trial(&[(test, size)], Some(zero)));
            told.push((test, fe_deg, size));
        }
    }
    (asked, told)
}

/// The tests that would narrow the forces of `drawers`, places of trials, most; the best first. `leaves` tells by sample and drawer which leave the
/// plateau. Each reads one displacement from the unloaded pose,
/// with a noise of `sd` [deg, mm]; none where there are too few samples, or the knee cannot be put to the tests.
pub fn next_tests(
    trials: &Trials,
    found: &Found<Answers>,
    (drawers, leaves): (std::ops::Range<usize>, &[Vec<Option<bool>>]),
    (compression_n, sd): (f64, Free<f64>),
) -> Vec<NextTest> {
    let mode = &found.modes[0].z;
    let (asked, told) = plan(compression_n);
    let of = Trials { trials: &asked, beliefs: &[], ..*trials };
    if found.samples.len() < LEAST_SAMPLES {
        return vec![];
    }
    let Some(point) = of.at(mode, None) else { return vec![] };
    let scatter = of.scatter(&point.state);
    let staying: Vec<Staying> = (0..drawers.len()).map(|k| Staying::of(leaves.iter().map(|l| l[k]))).collect();
    let forces: Vec<(&[usize], Vec<f64>)> = drawers
        .zip(&staying)
        .filter(|(_, staying)| !staying.here.is_empty())
        .flat_map(|(i, staying)| (0..trials.model.bundles.len()).map(move |b| (i, b, &staying.here[..])))
        .map(|(i, b, here)| (here, here.iter().map(|s| found.samples[*s].state[i].forces_n[b]).collect()))
        .collect();
    let now = mean(&forces.iter().map(|(_, f)| variance(f).sqrt()).collect::<Vec<_>>());
    // what does not scatter cannot be narrowed
    if now <= 0.0 {
        return vec![];
    }
    let rows = of.rows();
    let mut out = Vec::new();
    for (r, (test, flexion_deg, load)) in told.into_iter().enumerate() {
        let row: DVector<f64> = point.jacobian.row(r).transpose();
        let reading: Vec<f64> = found.samples.iter().map(|s| row.dot(&(&s.z - mode))).collect();
        let own = scatter.as_ref().map_or(0.0, |s| s[(r, r)]) + sd[rows[r].1].powi(2);
        let narrowed = |(here, f): &(&[usize], Vec<f64>)| {
            narrowed(f, &here.iter().map(|s| reading[*s]).collect::<Vec<f64>>(), own)
        };
        let after: Vec<f64> = forces.iter().map(narrowed).collect();
        out.push(NextTest { test, flexion_deg, load, sd_now_n: now, sd_after_n: mean(&after) });
    }
    out.sort_by(|a, b| a.sd_after_n.total_cmp(&b.sd_after_n));
    out.truncate(TOLD);
    out
}

/// Standard deviation that is left of `x` when a reading is known to within `noise` (its variance): both as samples. What samples this few
/// show of a correlation where there is none is taken off.
fn narrowed(x: &[f64], reading: &[f64], noise: f64) -> f64 {
    let (a, b, n) = (mean(x), mean(reading), x.len() as f64);
    let (vx, vy) = (variance(x), variance(reading));
    if vx <= 0.0 || vy <= 0.0 {
        return vx.max(0.0).sqrt();
    }
    let both = x.iter().zip(reading).map(|(x, y)| (x - a) * (y - b)).sum::<f64>() / (n - 1.0);
    let share = ((both * both / (vx * vy) * (n - 1.0) - 1.0) / (n - 2.0)).clamp(0.0, 1.0);
    (vx * (1.0 - share * vy / (vy + noise))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::random::{normals, stream};
    use sim::coordinate::Load;

    #[test]
    fn a_reading_narrows_as_much_as_it_tells() {
        let draws = |k: u64| -> Vec<f64> { normals(&mut stream(7, k), 4000).iter().copied().collect() };
        let (x, other) = (draws(1), draws(2));
        let sd = variance(&x).sqrt();
        assert!(narrowed(&x, &x, 0.0) < 1e-6);
        assert!((narrowed(&x, &x, sd * sd) - sd * 0.5f64.sqrt()).abs() < 1e-6);
        assert!(narrowed(&x, &other, 0.0) > 0.999 * sd);
        let half: Vec<f64> = x.iter().zip(&other).map(|(a, b)| a + b).collect();
        assert!((narrowed(&x, &half, 0.0) / sd - 0.5f64.sqrt()).abs() < 0.03);
        assert!(narrowed(&[1.0; 20], &x[..20], 1.0) == 0.0);
    }

    #[test]
    fn every_test_reads_its_own_coordinate_from_the_unloaded_knee() {
        let (asked, told) = plan(20.0);
        let reading: Vec<&Trial> = asked.iter().filter(|a| a.reads.0.contains(&true)).collect();
        assert_eq!((reading.len(), told.len()), (24, 24));
        for (a, (test, fe_deg, load)) in reading.iter().zip(&told) {
            let c = test.coordinate().unwrap();
            assert!(a.reads[c] && a.record.fe_deg == *fe_deg && a.record.load[c] == *load);
            let zero = &asked[a.from.unwrap()];
            let done = (zero.record.load, zero.record.fe_deg);
            assert!(done == (Load::compression(20.0), *fe_deg) && zero.reads == Free::all(false));
        }
    }
}
