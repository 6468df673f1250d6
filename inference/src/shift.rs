//! What a sample of randomised maximum likelihood changes [oliver1996]: every term that is normal is drawn, the prior's centre, the noise of the
//! measurements, beliefs.
//!
//! A belief that counts on one side alone is no normal term. So where the model is as linear as it is at a mode, the sample itself is drawn first, by
//! elliptical slice sampling [murray2010]; the beliefs that it violates count as normal terms from there on, the others as limits that it keeps. Then
//! the draws are those of which the fit to a linear model gives this very sample: the innovations of a normal posterior do not depend on its draws.

use crate::linear::{Linear, Shift};
use crate::noise::Likelihood;
use crate::random::{normal, normals, stream, uniform};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Streams of random numbers of a sample: centre and noise, beliefs, the linear model's sample.
const STREAMS: [u64; 3] = [1_000, 200_000, 300_000];
/// Steps of the slice sampler: a step costs a product of a vector with a triangle, and a few dozen forget the start of a normal with up to a hundred
/// beliefs; ours.
const SLICES: usize = 150;
/// Beliefs whose residual's variance under the prior, in the linear model, is less than this say nothing there [-].
const STILL: f64 = 1e-9;

/// The normal posterior of the linear model without beliefs of one side.
struct Normal<'a> {
    at: &'a Linear,
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    two: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
}

impl<'a> Normal<'a> {
    fn new(likelihood: &Likelihood, at: &'a Linear) -> Option<Normal<'a>> {
        let jacobian = likelihood.white_rows(&at.jacobian);
        let residual = likelihood.white(&(&at.reading - &likelihood.measured));
        let two: Vec<usize> = (0..at.belief.len()).filter(|&j| !at.one_side[j]).collect();
        let believed = at.belief_jacobian.select_rows(&two);
        let mut precision = jacobian.tr_mul(&jacobian) + believed.tr_mul(&believed);
        (0..precision.nrows()).for_each(|k| precision[(k, k)] += 1.0);
        let factor = Cholesky::new(precision)?;
        Some(Normal { at, jacobian, residual, two, factor })
    }

    /// Where the fit to the linear model ends under these draws.
    fn fit(&self, s: &Shift) -> DVector<f64> {
        let at = self.at;
        let mut gradient = self.jacobian.tr_mul(&(&self.residual - &s.noise)) + &at.z - &s.centre;
        for &j in &self.two {
            gradient += at.belief_jacobian.row(j).transpose() * (at.belief[j] - s.belief[j]);
        }
        &at.z - self.factor.solve(&gradient)
    }

    /// A draw about zero.
    fn draw(&self, random: &mut rand_chacha::ChaCha8Rng) -> DVector<f64> {
        let z = normals(random, self.at.z.len());
        self.factor.l_dirty().tr_solve_lower_triangular(&z).unwrap_or(z)
    }
}

/// Centre of the prior of sample `s`, of `n` numbers, before anything is known.
pub fn centre_of(seed: u64, s: u64, n: usize) -> DVector<f64> {
    normals(&mut stream(seed, STREAMS[0] + s), n)
}

/// What sample `s` changes, and where it lies if the model is as linear as `at`; `None` where a covariance is not positive definite.
pub fn drawn(likelihood: &Likelihood, at: &Linear, seed: u64, s: u64) -> Option<(Shift, DVector<f64>)> {
    let (n, readings, beliefs) = (at.z.len(), likelihood.measured.len(), at.belief.len());
    let mut random = stream(seed, STREAMS[0] + s);
    let (centre, noise) = (normals(&mut random, n), normals(&mut random, readings));
    let belief = normals(&mut stream(seed, STREAMS[1] + s), beliefs);
    let mut shift = Shift { centre, noise, belief, both_sides: vec![false; beliefs] };
    let normal_part = Normal::new(likelihood, at)?;
    let first = normal_part.fit(&shift);
    let one: Vec<usize> =
        (0..beliefs).filter(|&j| at.one_side[j] && at.belief_jacobian.row(j).norm_squared() > STILL).collect();
    if one.is_empty() {
        return Some((shift, first));
    }
    let rows = at.belief_jacobian.select_rows(&one);
    let here = DVector::from_iterator(one.len(), one.iter().map(|&j| at.belief[j]));
    let mut random = stream(seed, STREAMS[2] + s);
    let unmoved = Shift { noise: DVector::zeros(readings), belief: DVector::zeros(beliefs), ..Shift::none(n) };
    let mean = normal_part.fit(&unmoved);
    let at_mean = &here + &rows * (&mean - &at.z);
    let off = sliced(&normal_part, &first - &mean, (&rows, &at_mean), &mut random);
    let sample = &mean + &off;
    let violated = &at_mean + &rows * &off;
    let taut: Vec<usize> = (0..one.len()).filter(|&k| violated[k] > 0.0).collect();
    let (start, errors) = innovated(&normal_part, &off, (&rows, &at_mean), &taut, &mut random)?;
    // the draws of which the linear fit, without beliefs of one side, ends at `start`
    let by = &mean + &start - &first;
    shift.centre += &by;
    shift.noise += &normal_part.jacobian * &by;
    shift.belief += &at.belief_jacobian * &by;
    for (k, &j) in one.iter().enumerate() {
        shift.belief[j] = match taut.iter().position(|t| *t == k) {
            Some(place) => errors[place],
            None => above(violated[k], &mut random),
        };
    }
    taut.iter().for_each(|&k| shift.both_sides[one[k]] = true);
    Some((shift, sample))
}

/// A draw, as its distance from the mean, of the normal posterior times what beliefs of one side say: elliptical slice sampling [murray2010].
fn sliced(
    of: &Normal,
    mut off: DVector<f64>,
    (rows, at_mean): (&DMatrix<f64>, &DVector<f64>),
    random: &mut rand_chacha::ChaCha8Rng,
) -> DVector<f64> {
    let say = |r: &DVector<f64>| -0.5 * r.iter().map(|r| r.max(0.0).powi(2)).sum::<f64>();
    let mut moved = rows * &off;
    for _ in 0..SLICES {
        let other = of.draw(random);
        let other_moved = rows * &other;
        let least = say(&(at_mean + &moved)) + uniform(random).ln();
        let mut angle = std::f64::consts::TAU * uniform(random);
        let (mut low, mut high) = (angle - std::f64::consts::TAU, angle);
        loop {
            let (sin, cos) = angle.sin_cos();
            let tried = &moved * cos + &other_moved * sin;
            if say(&(at_mean + &tried)) >= least || high - low < 1e-12 {
                off = &off * cos + &other * sin;
                moved = tried;
                break;
            }
            if angle < 0.0 {
                low = angle;
            } else {
                high = angle;
            }
            angle = low + (high - low) * uniform(random);
        }
    }
    off
}

/// The draw without the beliefs that are violated, as its distance from the mean, of which the draw with them is `off`; and those beliefs' noise.
fn innovated(
    of: &Normal,
    off: &DVector<f64>,
    (rows, at_mean): (&DMatrix<f64>, &DVector<f64>),
    taut: &[usize],
    random: &mut rand_chacha::ChaCha8Rng,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let rows = rows.select_rows(taut);
    let at_mean = DVector::from_iterator(taut.len(), taut.iter().map(|&k| at_mean[k]));
    let gain = of.factor.solve(&rows.transpose());
    let mut spread = &rows * &gain;
    (0..taut.len()).for_each(|k| spread[(k, k)] += 1.0);
    let errors = DVector::from_fn(taut.len(), |_, _| normal(random));
    let innovation = errors - (&at_mean + &rows * of.draw(random));
    let start = off - &gain * Cholesky::new(spread)?.solve(&innovation);
    let errors = innovation + at_mean + rows * &start;
    Some((start, errors))
}

/// A standard normal number above `least`, which is not positive.
fn above(least: f64, random: &mut rand_chacha::ChaCha8Rng) -> f64 {
    loop {
        let z = normal(random);
        if z > least {
            return z;
        }
    }
}
