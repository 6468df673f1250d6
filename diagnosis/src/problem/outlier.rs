//! Single trials that no hypothesis explains: an outlier of the tracking, or a knee that took another branch.
//!
//! A trial's scatter is a mixture: as declared, or with a small probability ten times as wide [box1968]. Which trials are wide is chosen with the
//! unknowns, at a price, so that one outlier costs a hypothesis a limited number of nats instead of hundreds, and does not bend its parameters.

use crate::error::DiagnosisError;
use crate::problem::covariance::Readings;
use crate::problem::trial::row_of;
use inference::trial::Trial;
use inference::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use sim::coordinate::FREE;
use sim::laxity::Test;

/// Probability that a trial is an outlier [-].
const SHARE: f64 = 0.01;
/// How much wider an outlier's scatter is, as a variance [-].
const WIDER: f64 = 100.0;
/// Most trials that may be outliers, as a share of all [-]: more are no accident.
const MOST: f64 = 0.1;

/// Scatter of readings with what is needed to find outliers.
#[derive(Clone, Debug)]
pub struct Mixture {
    plain: Whitening,
    scatter: DMatrix<f64>,
    inverse: DMatrix<f64>,
    groups: Vec<Group>,
}

/// A trial's rows among the readings.
#[derive(Clone, Debug)]
struct Group {
    trial: usize,
    /// Data set and test: of each, one trial at most is an outlier. Several that are off together are no accident.
    kin: (Option<usize>, Test),
    first: usize,
    count: usize,
}

/// A residual weighed: the outliers, the scatter with them wide, and minus the log density up to a constant.
#[derive(Clone, Debug)]
pub struct Weighed {
    /// Trials set aside, by index.
    pub outliers: Vec<usize>,
    /// Scatter with them wide; `None` where there are none.
    pub whitening: Option<Whitening>,
    /// Half the whitened squares, what is paid for outliers included [nats].
    pub cost: f64,
}

impl Mixture {
    /// Of readings of `trials` with the covariance `scatter`, a row a reading.
    ///
    /// Errors: a covariance that is not positive definite.
    pub fn new(readings: &Readings, scatter: DMatrix<f64>, trials: &[Trial]) -> Result<Mixture, DiagnosisError> {
        let plain = Whitening::new(scatter.clone())?;
        let mut groups: Vec<Group> = Vec::new();
        for (row, &(trial, _)) in readings.rows.iter().enumerate() {
            match groups.last_mut() {
                Some(g) if g.trial == trial => g.count += 1,
                _ => {
                    let kin = (trials[trial].source, trials[trial].record.test);
                    groups.push(Group { trial, kin, first: row, count: 1 });
                }
            }
        }
        let inverse = plain.inverse();
        Ok(Mixture { plain, scatter, inverse, groups })
    }

    /// The scatter without outliers.
    pub fn plain(&self) -> &Whitening {
        &self.plain
    }

    /// Weighs a residual with no trial set aside.
    pub fn weigh_all(&self, residual: &DVector<f64>) -> Weighed {
        Weighed { outliers: vec![], whitening: None, cost: 0.5 * self.plain.white_vector(residual).norm_squared() }
    }

    /// Weighs a residual: trials are set aside one after another, each that lowers the cost most, while it falls.
    pub fn weigh(&self, residual: &DVector<f64>) -> Weighed {
        let mut out = self.weigh_all(residual);
        let plain = out.cost;
        let mut chosen: Vec<&Group> = Vec::new();
        let mut inverse: Option<DMatrix<f64>> = None;
        let most = (MOST * self.groups.len() as f64) as usize;
        while plain.is_finite() && chosen.len() < most {
            let now = inverse.as_ref().unwrap_or(&self.inverse);
            let solved = now * residual;
            let open = self.groups.iter().filter(|g| chosen.iter().all(|c| c.kin != g.kin));
            let gains = open.filter_map(|g| Some((g, self.gain(now, &solved, g)?)));
            let Some((group, gain)) = gains.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if gain <= 0.0 {
                break;
            }
            let Some(next) = self.widen(now, group) else { break };
            inverse = Some(next);
            chosen.push(group);
            out.cost -= gain;
        }
        if !chosen.is_empty() {
            let mut scatter = self.scatter.clone();
            for g in &chosen {
                scatter.view_mut((g.first, g.first), (g.count, g.count)).scale_mut(WIDER);
            }
            out.outliers = chosen.iter().map(|g| g.trial).collect();
            out.whitening = Whitening::new(scatter).ok();
        }
        out
    }

    /// Inverse of what a group's scatter grows by, and that plus its block of the inverse.
    fn grown(&self, inverse: &DMatrix<f64>, g: &Group) -> Option<(Cholesky<f64, Dyn>, Cholesky<f64, Dyn>)> {
        let place = ((g.first, g.first), (g.count, g.count));
        let added = Cholesky::new(self.scatter.view(place.0, place.1) * (WIDER - 1.0))?;
        let sum = Cholesky::new(added.inverse() + inverse.view(place.0, place.1))?;
        Some((added, sum))
    }

    /// By how much the cost falls where a group is set aside [nats].
    fn gain(&self, inverse: &DMatrix<f64>, solved: &DVector<f64>, g: &Group) -> Option<f64> {
        let part = solved.rows(g.first, g.count).into_owned();
        let squares = |m: &Cholesky<f64, Dyn>| 0.5 * part.dot(&m.solve(&part));
        // never more than without the group altogether: cheap, and most are far below the price
        let bound = squares(&Cholesky::new(inverse.view((g.first, g.first), (g.count, g.count)).into_owned())?);
        if bound < -SHARE.ln() {
            return None;
        }
        let (added, sum) = self.grown(inverse, g)?;
        let half = |m: &Cholesky<f64, Dyn>| m.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        Some(squares(&sum) - half(&added) - half(&sum) + SHARE.ln())
    }

    /// The inverse with a group's scatter wide [hager1989].
    fn widen(&self, inverse: &DMatrix<f64>, g: &Group) -> Option<DMatrix<f64>> {
        let (_, sum) = self.grown(inverse, g)?;
        let columns = inverse.columns(g.first, g.count);
        Some(inverse - columns * sum.solve(&columns.transpose()))
    }
}

/// What it costs to set trials aside, before their scatter is the wider [nats].
pub fn price(outliers: usize) -> f64 {
    -SHARE.ln() * outliers as f64
}

/// What one trial costs whose whitened residual has this sum of squares over so many readings, by itself: as it is, or set aside [nats].
pub fn alone(squares: f64, readings: usize) -> f64 {
    let aside = price(1) + 0.5 * readings as f64 * WIDER.ln() + 0.5 * squares / WIDER;
    aside.min(0.5 * squares)
}

/// A covariance of five readings a trial, with outliers wide.
pub fn widened(covariance: &DMatrix<f64>, outliers: &[usize]) -> DMatrix<f64> {
    let mut out = covariance.clone();
    for i in outliers {
        for a in FREE {
            for b in FREE {
                out[(row_of(*i, a), row_of(*i, b))] *= WIDER;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const TESTS: [Test; 4] = [Test::Anterior, Test::Posterior, Test::Internal, Test::External];

    fn mixture() -> Mixture {
        let n = 60;
        let text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
            a,anterior,30,0,0,0,100,20,30,0,0,0,9,-21\n";
        let trial = Trial::alone(sim::laxity::read(text.as_bytes()).unwrap().trials.remove(0));
        let of = |i: usize| {
            let mut one = Trial { source: Some(i / 10), ..trial.clone() };
            one.record.test = TESTS[i % 4];
            one
        };
        let trials: Vec<Trial> = (0..20).map(of).collect();
        let scatter = DMatrix::from_fn(n, n, |a, b| if a == b { 1.0 } else { 0.2 });
        let readings = Readings { rows: (0..n).map(|r| (r / 3, FREE[r % 3])).collect(), measured: DVector::zeros(n) };
        Mixture::new(&readings, scatter, &trials).unwrap()
    }

    #[test]
    fn usual_residuals_are_weighed_as_they_are() {
        let residual = DVector::from_fn(60, |r, _| (r as f64 * 1.7).sin() * 1.4);
        let mixture = mixture();
        let weighed = mixture.weigh(&residual);
        assert!(weighed.outliers.is_empty() && weighed.whitening.is_none());
        assert_eq!(weighed.cost, 0.5 * mixture.plain().white_vector(&residual).norm_squared());
    }

    #[test]
    fn a_trial_by_itself_costs_what_the_mixture_has_it_cost() {
        let text = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
            a,anterior,30,0,0,0,100,20,30,0,0,0,9,-21\n";
        let trial = Trial::alone(sim::laxity::read(text.as_bytes()).unwrap().trials.remove(0));
        // ten are needed for one to be set aside
        let trials: Vec<Trial> = vec![trial; 10];
        let all = Readings { rows: (0..50).map(|r| (r / 5, FREE[r % 5])).collect(), measured: DVector::zeros(50) };
        let mixture = Mixture::new(&all, DMatrix::identity(50, 50), &trials).unwrap();
        for size in [1.0, 3.0, 5.0, 8.0, 40.0] {
            let mut residual = DVector::zeros(50);
            residual[2] = size;
            let cost = mixture.weigh(&residual).cost;
            assert!((alone(size * size, 5) - cost).abs() < 1e-9, "{size} {cost}");
        }
        assert!(alone(40.0 * 40.0, 5) < 30.0);
    }

    #[test]
    fn one_outlier_costs_a_limited_number_of_nats_however_far_it_is() {
        let mixture = mixture();
        let usual = DVector::from_fn(60, |r, _| (r as f64 * 1.7).sin());
        let mut jumped = usual.clone();
        jumped[30] += 30.0;
        let weighed = mixture.weigh(&jumped);
        assert_eq!(weighed.outliers, [10]);
        let extra = weighed.cost - mixture.weigh(&usual).cost;
        assert!(extra > 5.0 && extra < 25.0, "{extra}");
        // the cost is that of the scatter with the outlier wide
        let wide = weighed.whitening.unwrap();
        let price = 0.5 * (wide.log_determinant() - mixture.plain().log_determinant()) - SHARE.ln();
        assert!((weighed.cost - 0.5 * wide.white_vector(&jumped).norm_squared() - price).abs() < 1e-8);
        // several of one test that are off are no outliers: one is set aside, the others count
        for trial in [14, 18] {
            jumped[3 * trial] += 30.0;
        }
        let weighed = mixture.weigh(&jumped);
        assert_eq!(weighed.outliers.len(), 1);
        assert!(weighed.cost > 500.0);
    }
}
