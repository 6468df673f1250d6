//! Simulation-based calibration [talts2018] of a knee of two ligaments: truths drawn from the prior times the beliefs, ranks among the samples.

use super::*;
use crate::random::{normal, uniform};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Loads of the drawers that are measured, and of the one that is asked [N].
const LOADS_N: [f64; 2] = [50.0, 134.0];
const ASKED_N: f64 = 90.0;
/// Noise of a reading [mm].
const NOISE_MM: f64 = 0.3;

/// A drawer held by two ligaments that are slack up to a displacement [mm], then stiff [N/mm]; and skin, so that nothing slides away.
struct Drawer {
    /// Believed of the first ligament's force under the largest load: mean and spread [N].
    believed_n: Option<[f64; 2]>,
}

const SKIN_N_PER_MM: f64 = 2.0;

impl Drawer {
    fn ligaments(z: &DVector<f64>) -> [[f64; 2]; 2] {
        [[1.0 + 1.5 * z[0], 30.0 * (0.2 * z[2]).exp()], [3.0 + 1.5 * z[1], 20.0 * (0.2 * z[3]).exp()]]
    }

    fn forces_n(z: &DVector<f64>, x: f64) -> [f64; 2] {
        Self::ligaments(z).map(|[slack, stiff]| stiff * (x - slack).max(0.0))
    }

    /// Where the load is in equilibrium [mm].
    fn displacement(z: &DVector<f64>, load_n: f64) -> f64 {
        let (mut low, mut high) = (-30.0, 100.0);
        for _ in 0..60 {
            let x = f64::midpoint(low, high);
            if SKIN_N_PER_MM * x + Self::forces_n(z, x).iter().sum::<f64>() < load_n { low = x } else { high = x }
        }
        low
    }

    fn answers(&self, z: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
        let x = LOADS_N.map(|load| Self::displacement(z, load));
        let believed = self.believed_n.map(|[mean, sd]| (Self::forces_n(z, x[1])[0] - mean) / sd);
        (DVector::from_iterator(2, x), DVector::from_iterator(usize::from(believed.is_some()), believed))
    }

    /// What is judged: both slacks, and the forces in a drawer that nobody measured.
    fn judged(z: &DVector<f64>) -> [f64; 4] {
        let [a, b] = Self::forces_n(z, Self::displacement(z, ASKED_N));
        [z[0], z[1], a, b]
    }
}

impl Forward for Drawer {
    type State = ();
    fn size(&self) -> usize {
        4
    }
    fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        const STEP: f64 = 1e-5;
        let (reading, belief) = self.answers(z);
        let (mut jacobian, mut belief_jacobian) = (DMatrix::zeros(reading.len(), 4), DMatrix::zeros(belief.len(), 4));
        for k in 0..4 {
            let beside = |by: f64| {
                let mut z = z.clone();
                z[k] += by;
                self.answers(&z)
            };
            let (up, down) = (beside(STEP), beside(-STEP));
            jacobian.set_column(k, &((up.0 - down.0) / (2.0 * STEP)));
            belief_jacobian.set_column(k, &((up.1 - down.1) / (2.0 * STEP)));
        }
        let one_side = vec![false; belief.len()];
        Some(Point { reading, jacobian, belief, belief_jacobian, one_side, state: () })
    }
    fn starts_anew(&self, _: usize) -> bool {
        true
    }
}

/// Place of each truth among its knee's samples, 0 to 1; equal ones (slack ligaments) are parted by chance.
fn places(knees: u64, drawer: &Drawer, noise_told: f64) -> Vec<[f64; 4]> {
    let of = |seed: u64| {
        let mut random = stream(seed, 11);
        let truth = loop {
            let z = normals(&mut random, 4);
            let far = drawer.answers(&z).1.norm_squared();
            if uniform(&mut random) < (-0.5 * far).exp() {
                break z;
            }
        };
        let measured = drawer.answers(&truth).0.map(|x| x + NOISE_MM * normal(&mut random));
        let mut l = Likelihood::independent(measured, vec![noise_told; 2], vec![0; 2]);
        l.robust = 1e9;
        let options = PosteriorOptions { scale_noise: false, samples: 99, seed, ..PosteriorOptions::default() };
        let found = infer(drawer, &mut l, &[], &options).unwrap();
        let samples: Vec<[f64; 4]> = found.samples.iter().map(|s| Drawer::judged(&s.z)).collect();
        let truth = Drawer::judged(&truth);
        std::array::from_fn(|k| {
            let below = samples.iter().filter(|s| s[k] < truth[k] - 1e-9).count() as f64;
            let equal = samples.iter().filter(|s| (s[k] - truth[k]).abs() <= 1e-9).count() as f64;
            (below + uniform(&mut random) * (equal + 1.0)) / (samples.len() as f64 + 1.0)
        })
    };
    (0..knees).into_par_iter().map(of).collect()
}

/// Probability of ranks as uneven as these, if they are even: ten bins.
fn evenness(places: &[[f64; 4]], k: usize) -> f64 {
    let even = places.len() as f64 / 10.0;
    let count = |b: usize| places.iter().filter(|p| ((p[k] * 10.0) as usize).min(9) == b).count() as f64;
    ChiSquared::new(9.0).unwrap().sf((0..10).map(|b| (count(b) - even).powi(2) / even).sum())
}

/// Least probability of even ranks: 0.01 among the eight that are asked [-].
const LEAST_P: f64 = 0.01 / 8.0;

#[test]
fn truths_lie_anywhere_among_the_samples() {
    for believed_n in [None, Some([80.0, 25.0])] {
        let all = places(200, &Drawer { believed_n }, NOISE_MM);
        for k in 0..4 {
            let p = evenness(&all, k);
            assert!(p > LEAST_P, "{believed_n:?}: quantity {k} has ranks as uneven as {p:.5} of even ones");
        }
        for share in [0.5, 0.8, 0.9] {
            let inside = |p: &[f64; 4]| p.iter().filter(|u| (*u - 0.5).abs() <= share / 2.0).count() as f64 / 4.0;
            let held: Vec<f64> = all.iter().map(inside).collect();
            let mean = held.iter().sum::<f64>() / held.len() as f64;
            let variance = held.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / (held.len() - 1) as f64;
            let error = (variance / held.len() as f64).sqrt();
            assert!(
                (mean - share).abs() < 3.0 * error,
                "{believed_n:?}: intervals of {share} hold {mean:.3} +- {error:.3}"
            );
        }
    }
}

#[test]
fn ranks_show_a_noise_that_is_told_too_small() {
    let all = places(200, &Drawer { believed_n: None }, NOISE_MM / 2.0);
    let least = (0..4).map(|k| evenness(&all, k)).fold(1.0, f64::min);
    assert!(least < LEAST_P, "{least}");
}
