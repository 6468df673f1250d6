//! What can be named: an effect of the catalogue, one of its variants, in one data set or all.

use crate::effect::Active;
use crate::effect::catalogue::Effect;

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// In every data set.
    Both,
    /// In one.
    Only(usize),
}

impl Scope {
    /// Whether it acts in a data set; in a trial of none, where it acts in all.
    pub fn covers(self, source: Option<usize>) -> bool {
        match self {
            Scope::Both => true,
            Scope::Only(one) => source == Some(one),
        }
    }
}

/// An effect with a scope: what can be named.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The effect.
    pub effect: Effect,
    /// Which of its variants.
    pub variant: usize,
    /// Where it acts.
    pub scope: Scope,
}

impl Candidate {
    /// Name in answers.
    pub fn name(&self) -> String {
        self.effect.name(self.variant)
    }

    /// Name of its variant, where the effect has several.
    pub fn variant_name(&self) -> Option<String> {
        self.effect.variants.get(self.variant).cloned()
    }

    /// The effect at work with values in units of its priors.
    pub fn active(&self, scaled: &[f64]) -> Active {
        let values: Vec<f64> = self.effect.parameter.iter().zip(scaled).map(|(p, x)| p.sd * x).collect();
        Active::new(&self.effect, self.variant, &values).expect("candidates come from implemented effects")
    }

    /// Whether values in units of its priors are as large as the effect must be to deserve its name.
    pub fn is_large_enough(&self, scaled: &[f64]) -> bool {
        self.effect.parameter.iter().zip(scaled).all(|(p, x)| p.sd * x.abs() >= p.least)
    }

    /// Whether values in units of its priors are no larger than the effect can be.
    pub fn is_small_enough(&self, scaled: &[f64]) -> bool {
        self.effect.parameter.iter().zip(scaled).all(|(p, x)| p.most.is_none_or(|most| p.sd * x.abs() <= most))
    }

    /// No effect, with the shape from which fits of it start, in units of its priors.
    pub fn nothing(&self) -> Vec<f64> {
        self.effect.parameter.iter().map(|p| if p.shape { p.from.unwrap_or(0.0) } else { 0.0 }).collect()
    }

    /// The size and the shape from which fits of it start, in units of its priors.
    pub fn typical(&self) -> Vec<f64> {
        self.effect.parameter.iter().map(|p| p.from.unwrap_or(if p.shape { 0.0 } else { 1.0 })).collect()
    }

    /// Number of parameters.
    pub fn size(&self) -> usize {
        self.effect.parameter.len()
    }
}

/// Each of several candidates with its own of values that stand one candidate's after the other's.
pub fn sized<'a>(
    candidates: impl IntoIterator<Item = &'a Candidate>,
    values: &'a [f64],
) -> impl Iterator<Item = (&'a Candidate, &'a [f64])> {
    let mut left = values;
    candidates.into_iter().map(move |c| {
        let (own, others) = left.split_at(c.size());
        left = others;
        (c, own)
    })
}
