//! Pairs of effects from the screens: two that act together may each explain little alone, or hide each other.

use super::steps::{Found, Given};
use super::{Screened, Searcher, Start, WIDTH};
use crate::effect::candidate::{Candidate, sized};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::{Marginal, Score, signatures};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Pairs of each screen that are refitted [-].
const PAIRS: usize = 4;

/// Whether sizes point where the effect can go: a pull that would have to push is none.
fn can_be(candidate: &Candidate, size: &[f64]) -> bool {
    let mut sided = candidate.effect.parameter.iter().zip(size).filter(|(p, _)| p.one_sided && !p.shape).peekable();
    sided.peek().is_none() || sided.any(|(_, x)| *x > 0.0)
}

/// Log Bayes factor of two whitened signatures together, of standard deviation 1, and their sizes; `products` are those of all columns with each other,
/// `along` with the residual.
fn together(products: &DMatrix<f64>, along: &DVector<f64>, columns: &[usize]) -> Option<(f64, DVector<f64>)> {
    let n = columns.len();
    let identity = |a: usize, b: usize| if a == b { 1.0 } else { 0.0 };
    let curvature = DMatrix::from_fn(n, n, |a, b| products[(columns[a], columns[b])] + identity(a, b));
    let slope = DVector::from_fn(n, |a, _| along[columns[a]]);
    let factor = Cholesky::new(curvature)?;
    let size = factor.solve(&slope);
    let occam: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    Some((0.5 * slope.dot(&size) - occam, size))
}

/// Whitened signatures side by side.
struct Stack {
    /// Where each begins, and where the last ends.
    first: Vec<usize>,
    /// Products of all columns with each other.
    products: DMatrix<f64>,
    /// And with the residual.
    along: DVector<f64>,
}

impl Stack {
    fn new(scores: &[(usize, Score, f64)], residual: &DVector<f64>) -> Stack {
        let mut first = vec![0];
        scores.iter().for_each(|(_, s, _)| first.push(first[first.len() - 1] + s.white.ncols()));
        let mut white = DMatrix::zeros(residual.len(), first[scores.len()]);
        for (k, (_, s, _)) in scores.iter().enumerate() {
            white.columns_mut(first[k], s.white.ncols()).copy_from(&s.white);
        }
        Stack { first, products: white.tr_mul(&white), along: white.tr_mul(residual) }
    }

    /// Log Bayes factor of two together, and their sizes.
    fn of(&self, a: usize, b: usize) -> Option<(f64, DVector<f64>)> {
        let columns: Vec<usize> = [a, b].iter().flat_map(|&k| self.first[k]..self.first[k + 1]).collect();
        together(&self.products, &self.along, &columns)
    }
}

impl Searcher<'_> {
    /// The best pairs of candidates about a fit, in closed form: those that promise `least` more than any of them alone.
    fn pairs(&self, at: &Fit, given: Given, cov: &DMatrix<f64>, least: f64) -> Result<Vec<Screened>, DiagnosisError> {
        let (readings, candidates) = (given.readings, given.candidates);
        let signatures = signatures(self.problem, at, candidates)?;
        let marginal = Marginal::new(at, readings, cov)?;
        let scores = self.scores(at, (readings, &marginal), candidates, &signatures);
        let stack = Stack::new(&scores, &marginal.white);
        let alone = |(_, s, prior): &(usize, Score, f64)| s.log_bayes_factor(&marginal.white) + prior;
        let best = scores.iter().map(alone).fold(0.0, f64::max);
        let mut list: Vec<(f64, [usize; 2], DVector<f64>)> = Vec::new();
        for a in 0..scores.len() {
            for b in a + 1..scores.len() {
                let [one, other] = [&candidates[scores[a].0], &candidates[scores[b].0]];
                if one.effect.id == other.effect.id {
                    continue;
                }
                let Some((gain, size)) = stack.of(a, b) else { continue };
                let gain = gain + scores[a].2 + scores[b].2;
                if gain > best + least && sized([one, other], size.as_slice()).all(|(c, of)| can_be(c, of)) {
                    list.push((gain, [scores[a].0, scores[b].0], size * WIDTH));
                }
            }
        }
        list.sort_by(|x, y| y.0.total_cmp(&x.0));
        list.truncate(8 * PAIRS);
        let screened = |(gain, places, size): (f64, [usize; 2], DVector<f64>)| {
            let both = places.map(|k| signatures[k].column_iter()).into_iter().flatten().collect::<Vec<_>>();
            let beside = marginal.beside(at, readings, &DMatrix::from_columns(&both), &size);
            Screened { gain, candidates: places.to_vec(), size, beside }
        };
        Ok(list.into_iter().map(screened).collect())
    }

    /// Refits of the best pairs that the screens of a search ask for, where they promise half of `least` more than single effects do: screens are linear.
    pub(super) fn paired(
        &self,
        start: &Start,
        found: &Found,
        given: Given,
        least: f64,
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let near = self.scatter(&start.held, given.extra)?;
        let mut out: Vec<Fit> = Vec::new();
        for (at, cov) in [(&found.base, &found.cov), (&start.zero, &start.cov), (&start.held, &near)] {
            let list = self.pairs(at, given, cov, 0.5 * least)?;
            let data = (given.readings, &found.cov);
            out.extend(self.refits(at, data, given.candidates, (&list, PAIRS), found.base.log_evidence)?);
        }
        out.retain(|f| self.each_has_a_size(f));
        Ok(out)
    }

    /// Whether each effect of a fit has a size of its own. A part that has none is none: what such a fit has more is another valley of the ligaments.
    pub(super) fn each_has_a_size(&self, fit: &Fit) -> bool {
        let mut at = self.problem.nuisances();
        fit.hypothesis.iter().all(|c| {
            at += c.size();
            fit.own_evidence_of(at - c.size(), c.size()) > 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_that_hide_each_other_are_seen_together() {
        // nearly opposite signatures, both large: alone each promises little of what the two explain
        let n = 30;
        let one = DVector::from_fn(n, |r, _| 6.0 * (r as f64 * 0.7).sin());
        let other = DVector::from_fn(n, |r, _| -6.0 * (r as f64 * 0.7 + 0.25).sin());
        let white = DMatrix::from_columns(&[one.clone(), other.clone()]);
        let residual = one + other;
        let (products, along) = (white.tr_mul(&white), white.tr_mul(&residual));
        let [a, b, both] = [&[0][..], &[1], &[0, 1]].map(|c| together(&products, &along, c).unwrap());
        assert!(both.0 > a.0.max(b.0) + 5.0, "{} {} {}", a.0, b.0, both.0);
        assert!((both.1[0] - 1.0).abs() < 0.2 && (both.1[1] - 1.0).abs() < 0.2);
        // against the ratio of two normal densities
        let scatter = DMatrix::identity(n, n) + &white * white.transpose();
        let factor = Cholesky::new(scatter).unwrap();
        let half = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let direct = 0.5 * (residual.norm_squared() - residual.dot(&factor.solve(&residual))) - half;
        assert!((both.0 - direct).abs() < 1e-9);
    }
}
