//! Loads that a model lacks of a knee, drawn: a function of flexion and load, so that what a trial is given does not depend on which others are asked.

use crate::random::{normal, stream};
use rand_chacha::ChaCha8Rng;
use sim::coordinate::{FREE, Free, Load};
use sim::laxity::LaxityTrial;

/// Model discrepancy: what a model lacks of a knee, as loads that nobody applied [kennedy2001]: alike in trials of like flexion and load, whichever data set has them, and
/// so as large in millimetres as the knee is slack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelDiscrepancy {
    /// Standard deviation of those loads.
    pub sd: Load,
    /// Flexion over which they change [deg].
    pub flexion_deg: f64,
    /// Applied loads over which they change.
    pub load: Load,
}

/// Waves that a drawn load is the sum of [-]: two trials' draws then correlate as they should to 0.1 in one draw, and exactly over all.
const WAVES: usize = 96;

/// A draw of those loads, in whatever trial: random waves, whose spectrum is that of the covariance [rahimi2007].
pub struct DrawnDiscrepancy {
    sd: Load,
    waves: Vec<Wave>,
}

/// A wave over flexion and loads.
struct Wave {
    by_flexion: f64,
    by_load: Load,
    /// Sizes of its cosine and its sine, of each load.
    size: Free<[f64; 2]>,
}

impl ModelDiscrepancy {
    /// How alike it is in two trials [-].
    pub(crate) fn alike(&self, a: &LaxityTrial, b: &LaxityTrial) -> f64 {
        let loads = FREE.into_iter().map(|l| ((a.load[l] - b.load[l]) / self.load[l]).powi(2)).sum::<f64>();
        (-0.5 * (((a.fe_deg - b.fe_deg) / self.flexion_deg).powi(2) + loads)).exp()
    }

    /// One draw of many, by its number.
    pub fn drawn(&self, seed: u64, number: usize) -> DrawnDiscrepancy {
        let mut random = stream(seed, number as u64);
        DrawnDiscrepancy { sd: self.sd, waves: (0..WAVES).map(|_| self.wave(&mut random)).collect() }
    }

    fn wave(&self, random: &mut ChaCha8Rng) -> Wave {
        Wave {
            by_flexion: normal(random) / self.flexion_deg,
            by_load: Load::from_fn(|l| normal(random) / self.load[l]),
            size: Free::from_fn(|_| [normal(random), normal(random)]),
        }
    }
}

impl DrawnDiscrepancy {
    /// The loads that the knee bears in a trial beside those applied [N m, N]. Each is normal, of its own standard deviation.
    pub fn in_trial(&self, trial: &LaxityTrial) -> Load {
        let mut sum = Load::default();
        for wave in &self.waves {
            let along = FREE.into_iter().map(|l| wave.by_load[l] * trial.load[l]).sum::<f64>();
            let (sin, cos) = (wave.by_flexion * trial.fe_deg + along).sin_cos();
            FREE.into_iter().for_each(|l| sum[l] += wave.size[l][0] * cos + wave.size[l][1] * sin);
        }
        let share = 1.0 / (WAVES as f64).sqrt();
        Load::from_fn(|l| self.sd[l] * share * sum[l])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use sim::laxity::Test;

    const OF: ModelDiscrepancy = ModelDiscrepancy {
        sd: Load::new(1.5, 0.25, 8.0, 6.0, 10.0),
        flexion_deg: 25.0,
        load: Load::new(6.0, 3.0, 60.0, 60.0, 60.0),
    };

    fn at(ap: f64, fe_deg: f64) -> LaxityTrial {
        LaxityTrial::asked(String::new(), Test::Neutral, fe_deg, Load::new(0.0, 0.0, 0.0, ap, 20.0))
    }

    #[test]
    fn it_is_alike_in_like_trials_and_makes_a_covariance() {
        let trials: Vec<LaxityTrial> =
            [-130.0, -60.0, 0.0, 60.0, 130.0].iter().flat_map(|&l| [0.0, 30.0, 90.0].map(|f| at(l, f))).collect();
        let n = trials.len();
        let alike = DMatrix::from_fn(n, n, |i, k| OF.alike(&trials[i], &trials[k]));
        assert!((0..n).all(|i| (alike[(i, i)] - 1.0).abs() < 1e-12));
        assert!(alike[(0, 1)] > alike[(0, 2)] && alike[(0, 3)] > alike[(0, 6)]);
        assert!(alike.clone().symmetric_eigenvalues().min() > -1e-12);
    }

    #[test]
    fn draws_scatter_and_hang_together_as_the_covariance_says() {
        let trials = [at(0.0, 30.0), at(60.0, 30.0), at(133.0, 30.0), at(60.0, 60.0), at(-133.0, 90.0)];
        let count = 4000;
        let draws: Vec<Vec<Load>> =
            (0..count).map(|s| OF.drawn(7, s)).map(|d| trials.iter().map(|t| d.in_trial(t)).collect()).collect();
        for l in FREE {
            for (i, a) in trials.iter().enumerate() {
                for (k, b) in trials.iter().enumerate() {
                    let mean = draws.iter().map(|d| d[i][l] * d[k][l]).sum::<f64>() / count as f64;
                    let found = mean / OF.sd[l].powi(2);
                    // the standard error of such a mean is at most sqrt(2 / 4000): 0.022
                    assert!((found - OF.alike(a, b)).abs() < 0.1, "{l:?} {i} {k}: {found} {}", OF.alike(a, b));
                }
                let mean = draws.iter().map(|d| d[i][l]).sum::<f64>() / count as f64;
                assert!(mean.abs() < 0.08 * OF.sd[l], "{l:?} {i}: {mean}");
            }
            let other = FREE.into_iter().find(|o| *o != l).unwrap();
            let both = draws.iter().map(|d| d[0][l] * d[0][other]).sum::<f64>() / count as f64;
            assert!(both.abs() < 0.1 * OF.sd[l] * OF.sd[other], "{l:?} and {other:?} hang together: {both}");
        }
    }
}
