//! A covariance in Cholesky's form: what makes numbers that scatter together white, and white ones scatter.

use crate::error::InferenceError;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A covariance in Cholesky's form, a factor for each group of numbers that scatter together.
#[derive(Clone, Debug)]
pub struct Whitening {
    size: usize,
    groups: Vec<Group>,
}

#[derive(Clone, Debug)]
struct Group {
    /// Places of its numbers, in order.
    at: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
}

impl Whitening {
    /// Factorises.
    ///
    /// # Errors
    /// A matrix that is not positive definite.
    pub fn new(covariance: DMatrix<f64>) -> Result<Whitening, InferenceError> {
        let size = covariance.nrows();
        let groups = together(&covariance).into_iter().map(|at| {
            let block = DMatrix::from_fn(at.len(), at.len(), |i, j| covariance[(at[i], at[j])]);
            Some(Group { at, factor: Cholesky::new(block)? })
        });
        let groups = groups.collect::<Option<_>>().ok_or(InferenceError::Covariance)?;
        Ok(Whitening { size, groups })
    }

    /// Whitens the columns.
    pub fn white(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.by_group(m, |factor, part| {
            factor.l_dirty().solve_lower_triangular_mut(part);
        })
    }

    /// Whitens a vector.
    pub fn white_vector(&self, v: &DVector<f64>) -> DVector<f64> {
        self.vector(v, |factor, part| {
            factor.l_dirty().solve_lower_triangular_mut(part);
        })
    }

    /// The inverse times a vector.
    pub fn solve(&self, v: &DVector<f64>) -> DVector<f64> {
        self.vector(v, |factor, part| factor.solve_mut(part))
    }

    /// The inverse of the covariance.
    pub fn inverse(&self) -> DMatrix<f64> {
        self.blocks(|factor| factor.inverse())
    }

    /// Log of the determinant.
    pub fn log_determinant(&self) -> f64 {
        let mut diagonal = DVector::zeros(self.size);
        for group in &self.groups {
            group.at.iter().zip(group.factor.l_dirty().diagonal().iter()).for_each(|(&i, x)| diagonal[i] = *x);
        }
        2.0 * diagonal.iter().map(|x| x.ln()).sum::<f64>()
    }

    /// The lower factor: times white numbers it is numbers of this covariance.
    pub fn lower(&self) -> DMatrix<f64> {
        self.blocks(|factor| factor.l())
    }

    /// The rows of each group as its factor makes them.
    fn by_group(&self, m: &DMatrix<f64>, make: impl Fn(&Cholesky<f64, Dyn>, &mut DMatrix<f64>)) -> DMatrix<f64> {
        let mut out = m.clone();
        for group in &self.groups {
            let mut part = m.select_rows(&group.at);
            make(&group.factor, &mut part);
            group.at.iter().enumerate().for_each(|(i, &at)| out.row_mut(at).copy_from(&part.row(i)));
        }
        out
    }

    fn vector(&self, v: &DVector<f64>, make: impl Fn(&Cholesky<f64, Dyn>, &mut DMatrix<f64>)) -> DVector<f64> {
        let made = self.by_group(&DMatrix::from_column_slice(v.len(), 1, v.as_slice()), make);
        made.column(0).into_owned()
    }

    /// A matrix of one block a group, 0 elsewhere.
    fn blocks(&self, make: impl Fn(&Cholesky<f64, Dyn>) -> DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.size, self.size);
        for Group { at, factor } in &self.groups {
            let block = make(factor);
            for (i, j) in (0..at.len()).flat_map(|i| (0..at.len()).map(move |j| (i, j))) {
                out[(at[i], at[j])] = block[(i, j)];
            }
        }
        out
    }
}

/// Groups of places that a covariance ties together, by their first, each in order.
fn together(covariance: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = covariance.nrows();
    let mut seen = vec![false; n];
    let mut groups = Vec::new();
    for first in 0..n {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&i) = group.get(next) {
            next += 1;
            for j in 0..n {
                // a number that is none ties, and then has no factor
                if !seen[j] && covariance[(j, i)] != 0.0 {
                    seen[j] = true;
                    group.push(j);
                }
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two groups that lie in turn among each other, and one number by itself.
    fn covariance() -> DMatrix<f64> {
        let mut c = DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]));
        for (i, j, x) in [(0, 2, 0.5), (2, 5, -1.0), (1, 4, 1.5), (4, 6, 0.7)] {
            (c[(i, j)], c[(j, i)]) = (x, x);
        }
        c
    }

    #[test]
    fn groups_are_as_the_whole() {
        let c = covariance();
        assert_eq!(together(&c), [vec![0, 2, 5], vec![1, 4, 6], vec![3]]);
        let (whole, parts) = (Cholesky::new(c.clone()).unwrap(), Whitening::new(c.clone()).unwrap());
        let m = DMatrix::from_fn(7, 3, |i, j| (i * 3 + j) as f64 - 4.5);
        let v = m.column(1).into_owned();
        let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| assert!((a - b).amax() < 1e-13, "{a} {b}");
        near(&parts.lower(), &whole.l());
        near(&parts.inverse(), &whole.inverse());
        near(&parts.white(&m), &whole.l().solve_lower_triangular(&m).unwrap());
        near(&DMatrix::from_columns(&[parts.solve(&v)]), &DMatrix::from_columns(&[whole.solve(&v)]));
        near(&DMatrix::from_columns(&[parts.white_vector(&v)]), &DMatrix::from_columns(&[parts.white(&m).column(1)]));
        let log = 2.0 * whole.l().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        assert!((parts.log_determinant() - log).abs() < 1e-13);
    }

    #[test]
    fn what_is_no_covariance_has_no_factor() {
        let mut c = covariance();
        c[(3, 3)] = -1.0;
        assert!(Whitening::new(c).is_err());
        let mut c = covariance();
        (c[(1, 4)], c[(4, 1)]) = (f64::NAN, f64::NAN);
        assert!(Whitening::new(c).is_err());
    }
}
