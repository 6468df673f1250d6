use super::*;
use crate::random::normal;

/// Readings that are linear in the numbers, by a matrix, with a slight curve.
pub(super) struct Toy {
    jacobian: DMatrix<f64>,
    curve: f64,
}

impl Forward for Toy {
    type State = ();
    fn size(&self) -> usize {
        self.jacobian.ncols()
    }
    fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        let s = &self.jacobian * z;
        let reading = s.map(|x| x + self.curve * x * x);
        let jacobian =
            DMatrix::from_fn(s.len(), z.len(), |i, k| (1.0 + 2.0 * self.curve * s[i]) * self.jacobian[(i, k)]);
        let none = DMatrix::zeros(0, z.len());
        Some(Point { reading, jacobian, belief_jacobian: none, ..Point::default() })
    }
}

/// A toy of `rows` readings of `n` numbers; the last number is not touched.
pub(super) fn toy(rows: usize, n: usize, curve: f64, seed: u64) -> Toy {
    let mut random = stream(seed, 7);
    Toy { jacobian: DMatrix::from_fn(rows, n, |_, k| if k + 1 == n { 0.0 } else { normal(&mut random) }), curve }
}

pub(super) fn likelihood(toy: &Toy, truth: &DVector<f64>, sd: f64, seed: u64) -> Likelihood {
    let mut random = stream(seed, 8);
    let reading = toy.at(truth, None).unwrap().reading;
    let rows = reading.len();
    let measured = reading.map(|x| x + sd * normal(&mut random));
    Likelihood::independent(measured, vec![sd; rows], vec![0; rows])
}

fn moments(samples: &[Sample<()>], k: usize) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().map(|s| s.z[k]).sum::<f64>() / n;
    (mean, (samples.iter().map(|s| (s.z[k] - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

#[test]
fn a_linear_model_has_the_closed_forms_posterior() {
    let toy = toy(12, 6, 0.0, 1);
    let truth = normals(&mut stream(1, 9), 6);
    let mut l = likelihood(&toy, &truth, 0.5, 1);
    l.robust = 1e9;
    let options = PosteriorOptions { scale_noise: false, samples: 2000, ..PosteriorOptions::default() };
    let found = infer(&toy, &mut l, &[], &options).unwrap();
    let precision = DMatrix::identity(6, 6) + toy.jacobian.tr_mul(&toy.jacobian) / 0.25;
    let covariance = precision.clone().try_inverse().unwrap();
    let mean = &covariance * toy.jacobian.tr_mul(&l.measured) / 0.25;
    assert_eq!(found.modes.len(), 1);
    assert!((&found.modes[0].z - &mean).amax() < 1e-3, "{} {mean}", found.modes[0].z);
    for k in 0..6 {
        let (m, sd) = moments(&found.samples, k);
        let exact = covariance[(k, k)].sqrt();
        // of 2000 samples: four standard errors
        assert!((m - mean[k]).abs() < 0.09 * exact, "{k}: {m} {}", mean[k]);
        assert!((sd / exact - 1.0).abs() < 0.065, "{k}: {sd} {exact}");
    }
}

#[test]
fn what_the_data_do_not_touch_keeps_its_prior() {
    let toy = toy(30, 6, 0.05, 2);
    let truth = normals(&mut stream(2, 9), 6);
    let mut l = likelihood(&toy, &truth, 0.2, 2);
    let found = infer(&toy, &mut l, &[], &PosteriorOptions { samples: 800, ..PosteriorOptions::default() }).unwrap();
    let (mean, sd) = moments(&found.samples, 5);
    assert!(mean.abs() < 0.12 && (sd - 1.0).abs() < 0.1, "{mean} {sd}");
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let (mut inside, mut all) = (0, 0);
    for seed in 0..60 {
        let toy = toy(24, 8, 0.03, seed);
        let truth = normals(&mut stream(seed, 9), 8);
        let mut l = likelihood(&toy, &truth, 0.5, seed);
        let found =
            infer(&toy, &mut l, &[], &PosteriorOptions { samples: 60, starts: 2, seed, ..PosteriorOptions::default() })
                .unwrap();
        for k in 0..8 {
            let mut values: Vec<f64> = found.samples.iter().map(|s| s.z[k]).collect();
            values.sort_by(f64::total_cmp);
            let n = values.len();
            inside += usize::from((values[n / 20]..=values[n - 1 - n / 20]).contains(&truth[k]));
            all += 1;
        }
    }
    let share = f64::from(inside as u32) / f64::from(all as u32);
    // 480 intervals of 88 to 92 %: three standard errors are 4 %
    assert!((0.84..=0.95).contains(&share), "{share}");
}

#[test]
fn one_thread_and_several_give_the_same_bytes() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let toy = toy(24, 8, 0.05, 4);
            let mut l = likelihood(&toy, &normals(&mut stream(4, 9), 8), 0.5, 4);
            let found = infer(&toy, &mut l, &[], &PosteriorOptions::default()).unwrap();
            found.samples.iter().flat_map(|s| s.z.iter().map(|x| x.to_bits()).collect::<Vec<_>>()).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(3));
}

/// One number whose square is read: two modes that the readings cannot tell apart.
struct Square {
    anew: bool,
}

impl Forward for Square {
    type State = ();
    fn size(&self) -> usize {
        1
    }
    fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        let (reading, jacobian) = (DVector::from_element(1, z[0] * z[0]), DMatrix::from_element(1, 1, 2.0 * z[0]));
        Some(Point { reading, jacobian, belief_jacobian: DMatrix::zeros(0, 1), ..Point::default() })
    }
    fn starts_anew(&self, _: usize) -> bool {
        self.anew
    }
}

#[test]
fn samples_that_start_from_their_own_draws_reach_a_mode_that_no_start_found() {
    let above = |anew: bool| {
        let mut l = Likelihood::independent(DVector::from_element(1, 1.0), vec![0.1], vec![0]);
        let options = PosteriorOptions { starts: 0, scale_noise: false, samples: 200, ..PosteriorOptions::default() };
        let given = [DVector::from_element(1, 0.9)];
        let found = infer(&Square { anew }, &mut l, &given, &options).unwrap();
        assert!(found.samples.len() > 100);
        found.samples.iter().filter(|s| s.z[0] > 0.0).count() as f64 / found.samples.len() as f64
    };
    assert!(above(false) > 0.99, "{}", above(false));
    assert!((above(true) - 0.5).abs() < 0.15, "{}", above(true));
}

#[test]
fn readings_that_are_believed_less_widen_the_posterior_as_more_noise_would() {
    let spread = |temper: f64, sd: f64| {
        let toy = toy(12, 6, 0.0, 5);
        let mut l = likelihood(&toy, &normals(&mut stream(5, 9), 6), 0.5, 5);
        l.sd.fill(sd);
        (l.robust, l.temper) = (1e9, temper);
        let found =
            infer(&toy, &mut l, &[], &PosteriorOptions { scale_noise: false, ..PosteriorOptions::default() }).unwrap();
        found.modes[0].form.hessian.clone()
    };
    assert!((spread(4.0, 0.5) - spread(1.0, 1.0)).amax() < 1e-9);
}

#[test]
fn samples_that_all_end_far_from_a_fit_still_make_an_interval() {
    let toy = toy(40, 6, 0.6, 6);
    let mut l = likelihood(&toy, &normals(&mut stream(6, 9), 6), 0.01, 6);
    let options =
        PosteriorOptions { samples: 40, sample_evaluations: 1, scale_noise: false, ..PosteriorOptions::default() };
    let found = infer(&toy, &mut l, &[], &options).unwrap();
    assert!(found.samples.len() >= 10, "{} of 40, {} stuck", found.samples.len(), found.stuck);
}

/// A toy that counts its fits.
struct Counted(Toy, std::sync::atomic::AtomicUsize);

impl Forward for Counted {
    type State = ();
    fn size(&self) -> usize {
        self.0.size()
    }
    fn at(&self, z: &DVector<f64>, near: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        self.0.at(z, near)
    }
    fn fitted(&self) {
        self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    }
}

#[test]
fn as_many_fits_are_told_as_are_expected() {
    // samples of one evaluation end far from a fit: each is tried again, and told once
    for (starts, finalists, rounds, samples, each) in
        [(8, 3, 2, 48, 14), (0, 3, 1, 0, 14), (1, 1, 0, 5, 14), (1, 1, 0, 40, 1)]
    {
        let counted = Counted(toy(12, 4, 0.02, 4), 0.into());
        let mut l = likelihood(&counted.0, &normals(&mut stream(4, 9), 4), 0.3, 4);
        let options = PosteriorOptions {
            starts,
            finalists,
            rounds,
            samples,
            sample_evaluations: each,
            ..PosteriorOptions::default()
        };
        infer(&counted, &mut l, &[DVector::zeros(4)], &options).unwrap();
        assert_eq!(counted.1.into_inner(), options.fits(1));
    }
}

/// One number, read once, and a belief that it is below a bound, or near it.
struct Believed {
    reading: f64,
    belief: f64,
    bound: f64,
    one_side: bool,
}

impl Forward for Believed {
    type State = ();
    fn size(&self) -> usize {
        1
    }
    fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        let of = |jacobian: f64| DMatrix::from_element(1, 1, jacobian);
        Some(Point {
            reading: z * self.reading,
            jacobian: of(self.reading),
            belief: DVector::from_element(1, self.belief * z[0] - self.bound),
            belief_jacobian: of(self.belief),
            one_side: vec![self.one_side],
            state: (),
        })
    }
}

impl Believed {
    /// Mean and standard deviation of the posterior with a measurement of `measured`, by a sum.
    fn exact(&self, measured: f64) -> (f64, f64) {
        let density = |z: f64| {
            let belief = self.belief * z - self.bound;
            let heard = if self.one_side { belief.max(0.0) } else { belief };
            (-0.5 * (z * z + (self.reading * z - measured).powi(2) + heard * heard)).exp()
        };
        let grid: Vec<f64> = (-8_000..=8_000).map(|i| f64::from(i) * 1e-3).collect();
        let sum = |f: &dyn Fn(f64) -> f64| grid.iter().map(|z| density(*z) * f(*z)).sum::<f64>();
        let mean = sum(&|z| z) / sum(&|_| 1.0);
        (mean, (sum(&|z| (z - mean).powi(2)) / sum(&|_| 1.0)).sqrt())
    }
}

#[test]
fn samples_are_as_wide_as_the_posterior_with_beliefs() {
    for belief in [0.0, 1.0, 2.0, 4.0] {
        for (one_side, bound) in [(false, 0.0), (false, 2.0), (true, -2.0), (true, 0.0), (true, 2.0)] {
            for reading in [0.0, 1.0] {
                let toy = Believed { reading, belief, bound, one_side };
                let measured = DVector::from_element(1, 0.7);
                let mut l = Likelihood::independent(measured, vec![1.0], vec![0]);
                l.robust = 1e9;
                let options = PosteriorOptions { scale_noise: false, samples: 4000, ..PosteriorOptions::default() };
                let found = infer(&toy, &mut l, &[], &options).unwrap();
                let (mean, sd) = moments(&found.samples, 0);
                let (exact, exact_sd) = toy.exact(0.7);
                let told = format!(
                    "jacobian {belief}, bound {bound}, one side {one_side}, reading {reading}: {mean:.3} {sd:.3}, exact {exact:.3} {exact_sd:.3}"
                );
                assert!((0.95..1.05).contains(&(sd / exact_sd)), "{told}");
                assert!((mean - exact).abs() < 0.08 * exact_sd, "{told}");
            }
        }
    }
}
