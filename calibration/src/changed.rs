//! A knee that was changed after it was calibrated: every sample has the same done to it.

use crate::unknown::Unknown;
use inference::knee::Quantity;
use sim::graft::{Graft, with_grafts};
use sim::model::Model;
use std::collections::BTreeMap;

/// What is done to the ligaments of a knee, beside cuts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changed {
    /// Added to the reference strain of a bundle [-].
    pub strain: BTreeMap<String, f64>,
    /// Factor on the stiffness of a bundle [-].
    pub stiffness: BTreeMap<String, f64>,
    /// Grafts, in the order of fixing.
    pub grafts: Vec<Graft>,
}

/// Grafts as they were fixed in the most probable knee and in each sample: reference strains [-]; none where there is no equilibrium.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fixed {
    pub(crate) own: Vec<f64>,
    pub(crate) samples: Vec<Option<Vec<f64>>>,
}

impl Changed {
    /// Whether nothing is changed.
    pub fn is_nothing(&self) -> bool {
        self.grafts.is_empty() && self.strain.values().all(|x| *x == 0.0) && self.stiffness.values().all(|x| *x == 1.0)
    }

    /// A model with its own bundles changed; grafts are not in it yet.
    ///
    /// # Errors
    /// A name of no bundle, a number out of range.
    pub fn tuned(&self, model: &Model) -> Result<Model, sim::SimError> {
        let mut parameters = model.parameters();
        let place = |name: &String| {
            let at = model.bundles.iter().position(|b| b.name == *name);
            at.ok_or_else(|| sim::SimError::Input(format!("no bundle is named {name:?}")))
        };
        for (name, added) in &self.strain {
            parameters[place(name)?].reference_strain += added;
        }
        for (name, factor) in &self.stiffness {
            parameters[place(name)?].stiffness_n_per_mm *= factor;
        }
        model.with_parameters(&parameters)
    }

    /// A model with its own bundles changed and grafts put in and fixed while `cut` is cut; nothing is cut in what comes back.
    ///
    /// # Errors
    /// As [`Changed::tuned`] and [`with_grafts`].
    pub fn done_to(&self, model: &Model, cut: &[String], near: Option<&[f64]>) -> Result<Model, sim::SimError> {
        with_grafts(&self.tuned(model)?, &self.grafts, cut, near)
    }

    /// The unknowns of a knee that was changed: those of a changed bundle are its own, and moved in every sample.
    pub(crate) fn unknowns(&self, of: &[Unknown], bundles: &[String]) -> Vec<Unknown> {
        let parted =
            |u: &Unknown, own: &[usize], change: &dyn Fn(usize, f64) -> f64, kind: fn(Vec<usize>) -> Quantity| {
                let one = |b: &usize| Unknown {
                    quantity: kind(vec![*b]),
                    most_probable: change(*b, u.most_probable),
                    samples: u.samples.iter().map(|x| change(*b, *x)).collect(),
                    ..u.clone()
                };
                own.iter().map(one).collect::<Vec<_>>()
            };
        let strain = |b: usize, x: f64| x + self.strain.get(&bundles[b]).unwrap_or(&0.0);
        let stiffness = |b: usize, x: f64| x * self.stiffness.get(&bundles[b]).unwrap_or(&1.0);
        let touched = |own: &[usize], by: &BTreeMap<String, f64>| own.iter().any(|b| by.contains_key(&bundles[*b]));
        let each = |u: &Unknown| match &u.quantity {
            Quantity::ReferenceStrain(own) if touched(own, &self.strain) => {
                parted(u, own, &strain, Quantity::ReferenceStrain)
            }
            Quantity::Stiffness(own) if touched(own, &self.stiffness) => {
                parted(u, own, &stiffness, Quantity::Stiffness)
            }
            _ => vec![u.clone()],
        };
        of.iter().flat_map(each).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_of_two_bundles_is_parted_where_one_of_them_changes() {
        let shared = Unknown {
            name: "both".into(),
            quantity: Quantity::ReferenceStrain(vec![0, 2]),
            most_probable: 1.0,
            samples: vec![0.9, 1.1],
            before: vec![],
        };
        let other = Unknown { quantity: Quantity::Stiffness(vec![2]), samples: vec![50.0, 70.0], ..shared.clone() };
        let bundles = ["A", "B", "C"].map(str::to_owned);
        let changed = Changed {
            strain: [("C".to_owned(), 0.05)].into(),
            stiffness: [("C".to_owned(), 2.0)].into(),
            ..Changed::default()
        };
        let out = changed.unknowns(&[shared.clone(), other.clone()], &bundles);
        let told: Vec<(&Quantity, &[f64])> = out.iter().map(|u| (&u.quantity, &u.samples[..])).collect();
        let strain = |b: usize| Quantity::ReferenceStrain(vec![b]);
        let by_hand = [
            (&strain(0), &[0.9, 1.1][..]),
            (&strain(2), &[0.9 + 0.05, 1.1 + 0.05][..]),
            (&Quantity::Stiffness(vec![2]), &[100.0, 140.0][..]),
        ];
        assert_eq!(told, by_hand);
        assert_eq!(Changed::default().unknowns(&[shared.clone(), other.clone()], &bundles), [shared, other]);
    }
}
