//! Fits for tests of rules that look at names and numbers alone.

use crate::effect::candidate::{Candidate, Scope};
use crate::effect::catalogue::Catalogue;
use crate::fit::Fit;
use crate::problem::Linear;
use nalgebra::{DMatrix, DVector};

/// An effect of the catalogue in a scope, its first variant.
pub(crate) fn candidate(id: &str, scope: Scope) -> Candidate {
    let effect = Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
    Candidate { effect, variant: 0, scope }
}

/// A fit of some effects that knows its hypothesis alone.
pub(crate) fn fit(hypothesis: Vec<Candidate>) -> Fit {
    Fit {
        hypothesis,
        unknowns: vec![],
        means: vec![],
        linear: Linear { value: vec![], jacobian: DMatrix::zeros(0, 0), rests: vec![], in_vain: vec![] },
        residual: DVector::zeros(0),
        misfit: 0.0,
        outliers: vec![],
        log_evidence: 0.0,
        posterior: DMatrix::zeros(0, 0),
    }
}
