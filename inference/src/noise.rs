//! What was measured and how it scatters: noise as stated times a scale that is inferred, outliers, and scatter that readings share.

pub mod contrasts;

use crate::error::InferenceError;
use crate::least_squares::Quadratic;
use crate::linear::{Linear, Shift};
use crate::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Measured numbers and their scatter.
#[derive(Clone, Debug)]
pub struct Likelihood {
    /// What was measured.
    pub measured: DVector<f64>,
    /// Standard deviation of each as stated.
    pub sd: Vec<f64>,
    /// Group of each: those of one group share a scale (one coordinate of one data set).
    pub group: Vec<usize>,
    /// Scale of each group's standard deviation [-].
    pub scale: Vec<f64>,
    /// Standard deviation of the natural logarithm of each scale after the data [-]; of its prior before.
    pub log_scale_sd: Vec<f64>,
    /// The same of the prior, about 1 [-].
    pub prior_log_sd: f64,
    /// Residuals beyond this many standard deviations count as that many [-].
    pub robust: f64,
    /// Factor on each variance by which an outlier is let go [-].
    outlying: Vec<f64>,
    /// Covariance beside the noise that does not depend on the model: of repositioning, say.
    pub common: DMatrix<f64>,
    /// Covariance beside the noise that does: of loads, say.
    shared: DMatrix<f64>,
    /// Factor on the whole covariance in fits, not in the inference of the noise [-]: how much less the readings are believed than their scatter says.
    pub temper: f64,
    factor: Option<Whitening>,
}

/// Repositioning of the knee between conditions, in measurement noises [-]; ours, of a calibration and of a diagnosis alike.
pub const REPOSITIONING: f64 = 0.4;
/// Scatter of a recorded force [N] and of a recorded moment [N m]; ours: what load cells of a good laboratory repeat. In a slack zone it is millimetres.
pub const LOAD_N_NM: (f64, f64) = (2.0, 0.1);
/// Prior of a scale's logarithm [-]: a laboratory states its noise to a quarter. Thirty readings that scatter by twice as much outweigh it.
const PRIOR_LOG_SD: f64 = 0.25;
/// Furthest that a logarithm of a scale goes in a step [-].
const LONGEST: f64 = 0.7;
/// Rounds of Fisher scoring; the sixth moves scales by less than 1 %.
const ROUNDS: usize = 6;

impl Likelihood {
    /// Readings that scatter each by itself.
    pub fn independent(measured: DVector<f64>, sd: Vec<f64>, group: Vec<usize>) -> Likelihood {
        let (n, groups) = (sd.len(), group.iter().max().map_or(0, |g| g + 1));
        Likelihood {
            measured,
            sd,
            group,
            scale: vec![1.0; groups],
            log_scale_sd: vec![PRIOR_LOG_SD; groups],
            prior_log_sd: PRIOR_LOG_SD,
            robust: 3.0,
            outlying: vec![1.0; n],
            common: DMatrix::zeros(n, n),
            shared: DMatrix::zeros(n, n),
            temper: 1.0,
            factor: None,
        }
    }

    /// Sets the covariance that the model gives readings beside their noise.
    pub fn share(&mut self, covariance: DMatrix<f64>) {
        self.shared = covariance;
        self.factor = None;
    }

    /// The same with scales drawn from what is known of them: `z` standard normal, a number a group.
    pub fn with_scales_at(&self, z: &DVector<f64>) -> Likelihood {
        let scale = (0..self.scale.len()).map(|g| self.scale[g] * (self.log_scale_sd[g] * z[g]).exp()).collect();
        Likelihood { scale, factor: None, ..self.clone() }
    }

    /// Variance of a reading's own noise.
    fn variance(&self, i: usize) -> f64 {
        (self.sd[i] * self.scale[self.group[i]]).powi(2) * self.outlying[i]
    }

    /// Factorises the covariance; to be called after every change.
    ///
    /// # Errors
    /// It is not positive definite.
    pub fn prepare(&mut self) -> Result<(), InferenceError> {
        let mut all = &self.shared + &self.common;
        (0..self.sd.len()).for_each(|i| all[(i, i)] += self.variance(i));
        all *= self.temper;
        self.factor = Some(Whitening::new(all)?);
        Ok(())
    }

    /// A vector over the factor of the covariance.
    pub fn white(&self, v: &DVector<f64>) -> DVector<f64> {
        self.factor.as_ref().map_or_else(|| v.clone(), |f| f.white_vector(v))
    }

    /// Scatter of the readings of which `white` are standard normal numbers: the factor of the covariance times it.
    pub fn scattered(&self, white: &DVector<f64>) -> DVector<f64> {
        self.factor.as_ref().map_or_else(|| white.clone(), |f| f.lower() * white)
    }

    /// The rows of a matrix over the factor of the covariance.
    pub fn white_rows(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.factor.as_ref().map_or_else(|| m.clone(), |f| f.white(m))
    }

    /// Half the squared residuals at a point, and what it changes by, with what a sample changes.
    pub fn form(&self, at: &Linear, shift: &Shift) -> Quadratic {
        let mut residual = self.white(&(&at.reading - &self.measured));
        if !shift.noise.is_empty() {
            residual -= &shift.noise;
        }
        let jacobian = self.white_rows(&at.jacobian);
        let pull = &at.z - &shift.centre;
        let mut gradient = jacobian.tr_mul(&residual) + &pull;
        let mut hessian = jacobian.tr_mul(&jacobian);
        let (belief, belief_jacobian) = shift.heard(at);
        if !belief.is_empty() {
            gradient += belief_jacobian.tr_mul(&belief);
            hessian += belief_jacobian.tr_mul(&belief_jacobian);
        }
        (0..hessian.nrows()).for_each(|k| hessian[(k, k)] += 1.0);
        let value = 0.5 * (residual.norm_squared() + belief.norm_squared() + pull.norm_squared());
        Quadratic { value, gradient, hessian }
    }

    /// Half the logarithm of the covariance's determinant, the constant of an evidence.
    pub fn half_log_determinant(&self) -> f64 {
        self.factor.as_ref().map_or(0.0, |f| 0.5 * f.log_determinant())
    }

    /// Lets outliers go: residuals beyond `robust` of their standard deviations count as that many, however far they are [hinich1975].
    fn let_go(&mut self, reading: &DVector<f64>) {
        for i in 0..self.sd.len() {
            let plain = (self.sd[i] * self.scale[self.group[i]]).powi(2);
            let z = (reading[i] - self.measured[i]).abs() / (plain + self.shared[(i, i)] + self.common[(i, i)]).sqrt();
            self.outlying[i] = (z / self.robust).max(1.0).powi(2);
        }
    }

    /// Scales that make the measurements most probable when everything else is integrated over, by Fisher scoring on the logarithms of the scales
    /// (restricted maximum likelihood with a prior) [gilmour1995].
    ///
    /// # Errors
    /// The covariance is not positive definite.
    pub fn infer_scales(&mut self, at: &Linear, scale_noise: bool) -> Result<(), InferenceError> {
        self.let_go(&at.reading);
        if scale_noise {
            let (belief, belief_jacobian) = Shift::none(at.z.len()).heard(at);
            let (n, extra) = (self.sd.len(), belief.len());
            let rows = n + extra;
            let mut jacobian = DMatrix::zeros(rows, at.jacobian.ncols());
            jacobian.rows_mut(0, n).copy_from(&at.jacobian);
            jacobian.rows_mut(n, extra).copy_from(&belief_jacobian);
            let mut centred = DVector::zeros(rows);
            centred.rows_mut(0, n).copy_from(&(&self.measured - &at.reading));
            centred.rows_mut(n, extra).copy_from(&-&belief);
            centred += &jacobian * &at.z;
            let base = &jacobian * jacobian.transpose();
            for _ in 0..ROUNDS {
                self.score(&base, &centred, n)?;
            }
        }
        self.prepare()
    }

    /// One step of Fisher scoring.
    fn score(&mut self, base: &DMatrix<f64>, centred: &DVector<f64>, n: usize) -> Result<(), InferenceError> {
        let mut all = base.clone();
        for i in 0..n {
            for k in 0..n {
                all[(i, k)] += self.shared[(i, k)] + self.common[(i, k)];
            }
            all[(i, i)] += self.variance(i);
        }
        (n..base.nrows()).for_each(|i| all[(i, i)] += 1.0);
        let factor = Cholesky::new(all).ok_or(InferenceError::Covariance)?;
        let (inverse, solved) = (factor.inverse(), factor.solve(centred));
        let groups = self.scale.len();
        let precision = 1.0 / self.prior_log_sd.powi(2);
        let mut gradient = DVector::from_fn(groups, |g, _| -self.scale[g].ln() * precision);
        let mut information = DMatrix::identity(groups, groups) * precision;
        // the covariance changes by 2 variance with the logarithm of the scale
        for i in 0..n {
            let d = 2.0 * self.variance(i);
            gradient[self.group[i]] += 0.5 * d * (solved[i] * solved[i] - inverse[(i, i)]);
            for k in 0..n {
                let e = 2.0 * self.variance(k);
                information[(self.group[i], self.group[k])] += 0.5 * d * e * inverse[(i, k)] * inverse[(i, k)];
            }
        }
        let information = Cholesky::new(information).ok_or(InferenceError::Covariance)?;
        let step = information.solve(&gradient);
        let spread = information.inverse();
        for g in 0..groups {
            self.scale[g] *= step[g].clamp(-LONGEST, LONGEST).exp();
            self.log_scale_sd[g] = spread[(g, g)].sqrt();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normals, stream};

    #[test]
    fn a_scale_of_noise_is_found_and_a_group_without_readings_keeps_its_prior() {
        let mut random = stream(3, 0);
        let n = 240;
        let jacobian = DMatrix::from_fn(n, 20, |_, _| crate::random::normal(&mut random));
        let z = normals(&mut random, 20);
        let scale = [2.0, 0.5];
        let group: Vec<usize> = (0..n).map(|i| i % 2).collect();
        let noise = DVector::from_fn(n, |i, _| 0.3 * scale[group[i]] * crate::random::normal(&mut random));
        let mut likelihood = Likelihood::independent(&jacobian * &z + noise, vec![0.3; n], group);
        likelihood.scale.push(1.0);
        likelihood.log_scale_sd.push(PRIOR_LOG_SD);
        let at = Linear {
            reading: DVector::zeros(n),
            jacobian,
            belief: DVector::zeros(0),
            belief_jacobian: DMatrix::zeros(0, 20),
            one_side: Vec::new(),
            z: DVector::zeros(20),
        };
        likelihood.robust = 1e9;
        for _ in 0..3 {
            likelihood.infer_scales(&at, true).unwrap();
        }
        for (g, true_scale) in scale.iter().enumerate() {
            let off = (likelihood.scale[g] / true_scale).ln() / likelihood.log_scale_sd[g];
            assert!(off.abs() < 3.0, "{:?} {:?}", likelihood.scale, likelihood.log_scale_sd);
            assert!(likelihood.log_scale_sd[g] < 0.1);
        }
        assert!((likelihood.scale[2] - 1.0).abs() < 1e-9 && (likelihood.log_scale_sd[2] - PRIOR_LOG_SD).abs() < 1e-9);
    }

    #[test]
    fn one_jumped_reading_does_not_widen_the_noise_of_its_group() {
        let scale = |jump: f64| {
            let mut random = stream(4, 0);
            let n = 40;
            let mut measured = DVector::from_fn(n, |_, _| crate::random::normal(&mut random));
            measured[7] += jump;
            let mut likelihood = Likelihood::independent(measured, vec![1.0; n], vec![0; n]);
            let none = DMatrix::zeros(n, 1);
            let at = Linear {
                reading: DVector::zeros(n),
                jacobian: none,
                belief: DVector::zeros(0),
                belief_jacobian: DMatrix::zeros(0, 1),
                one_side: Vec::new(),
                z: DVector::zeros(1),
            };
            (0..3).for_each(|_| likelihood.infer_scales(&at, true).unwrap());
            likelihood.scale[0]
        };
        // counted as three deviations however far it is
        assert!((scale(30.0) / scale(300.0) - 1.0).abs() < 1e-3);
        assert!(scale(30.0) / scale(0.0) < 1.15, "{} {}", scale(30.0), scale(0.0));
    }
}
