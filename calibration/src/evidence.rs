//! What the calibrations of a laboratory's knees say of each other.
//!
//! [`Evidence::of`] takes from a calibration's samples what its data say of the numbers that knees share. [`priors`] tells each knee what the others say.

mod message;
pub mod population;

pub use message::{Measured, Message};

use crate::design::Design;
use crate::error::CalibrationError;
use crate::options::CalibrateOptions;
use crate::samples::Samples;
use crate::shared::{SCHEMA, Shared, SharedNumber, Sort, called};
use crate::unknown::Unknown;
use crate::unknowns::parameters;
use attachments::groups::GROUPS;
use inference::knee::Quantity;
use inference::parameter::Parameter;
use message::messages;
use nalgebra::DVector;
use population::{Averaged, Group, Shares, told_to};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Smallest change of a mean or standard deviation that is told, in standard deviations of the prior [-].
const LEAST_CHANGE: f64 = 1e-9;

/// What a knee's data say of the numbers that knees share.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// What it is called ([`called`]).
    pub knee: String,
    /// Its numbers, with their priors.
    pub numbers: Vec<Parameter<Quantity>>,
    /// Samples of the numbers of a ligament together, by their places.
    pub measured: Vec<(Vec<usize>, Measured)>,
}

/// Whose a number is: of a ligament all bundles together, since one can make up for another.
fn owner(name: &str) -> &str {
    let bundle = name.split('.').next().unwrap_or(name);
    let is_of =
        |(group, bundles): &&(&'static str, &'static [&'static str])| *group == bundle || bundles.contains(&bundle);
    GROUPS.iter().find(is_of).map_or(bundle, |(group, _)| *group)
}

impl Evidence {
    /// From standard normal numbers of `parameters` in samples after the measurement, and before it.
    pub fn between(
        knee: String,
        parameters: &[Parameter<Quantity>],
        (after, before): (&[DVector<f64>], &[DVector<f64>]),
    ) -> Evidence {
        let places: Vec<usize> =
            (0..parameters.len()).filter(|k| Sort::of(&parameters[*k].quantity).is_some()).collect();
        let mut owners: Vec<&str> = places.iter().map(|k| owner(&parameters[*k].name)).collect();
        owners.sort_unstable();
        owners.dedup();
        let together = |who: &&str| {
            let own: Vec<usize> = (0..places.len()).filter(|i| owner(&parameters[places[*i]].name) == *who).collect();
            let of = |samples: &[DVector<f64>]| -> Vec<DVector<f64>> {
                samples.iter().map(|z| DVector::from_iterator(own.len(), own.iter().map(|i| z[places[*i]]))).collect()
            };
            let measured = Measured::of(&of(after), &of(before))?;
            Some((own, measured))
        };
        let measured = owners.iter().filter_map(together).collect();
        Evidence { knee, numbers: places.iter().map(|k| parameters[*k].clone()).collect(), measured }
    }

    /// From the samples of a calibration with these options.
    ///
    /// # Errors
    /// A calibration that had a shared prior itself; one by a recipe, or an earlier version, that left no samples of the knee before it was measured.
    pub fn of(samples: &Samples, options: &CalibrateOptions) -> Result<Evidence, CalibrationError> {
        let spec = &samples.counted_from;
        let refused = |what: &str| Err(CalibrationError::Model(format!("{}: {what}", called(spec))));
        if options.shared_prior.is_some() {
            return refused(
                "calibrated with a shared prior (calibrate.shared_prior), so data of others are in its samples; build it without, elsewhere",
            );
        }
        let design = Design::of_model(spec)?.with_ranges(&options.ranges)?;
        let all = parameters(spec, &design, &[], options, None);
        let unknowns = samples.of.unknowns.iter();
        let own: Vec<(&Parameter<Quantity>, &Unknown)> = unknowns
            .filter(|u| Sort::of(&u.quantity).is_some())
            .filter_map(|u| Some((all.iter().find(|p| p.name == u.name)?, u)))
            .collect();
        let count = own.iter().map(|(_, u)| u.before.len()).min().unwrap_or(0);
        if count < 2 {
            return refused(
                "its samples do not say what was known before it was measured; build it again with this version, with calibrate.inference.samples",
            );
        }
        let z = |of: &dyn Fn(&Unknown, usize) -> f64, s: usize| {
            DVector::from_iterator(own.len(), own.iter().map(|(p, u)| p.prior.z_of(of(u, s))))
        };
        let after: Vec<DVector<f64>> = (0..samples.len()).map(|s| z(&|u, s| u.samples[s], s)).collect();
        let before: Vec<DVector<f64>> = (0..count).map(|s| z(&|u, s| u.before[s], s)).collect();
        let parameters: Vec<Parameter<Quantity>> = own.iter().map(|(p, _)| (*p).clone()).collect();
        Ok(Evidence::between(called(spec), &parameters, (&after, &before)))
    }

    /// How many of its numbers the data say anything of, by its own samples alone.
    pub fn informed(&self) -> usize {
        let of = |(own, m): &(Vec<usize>, Measured)| {
            let said = m.alone();
            (0..own.len()).filter(|k| !said.is_silent(*k)).count()
        };
        self.measured.iter().map(of).sum()
    }
}

/// What is shared, and how much.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// For each knee in turn, then for one that is not among them.
    pub priors: Vec<Shared>,
    /// For each of these, mean share of the variance of each sort of numbers ([`Sort::ALL`]) [-]. No knee's own data are in its own.
    pub shares: Vec<Shares>,
    /// For each of these, names of numbers, and how many of the knees that it comes from say anything of each.
    pub informed: Vec<Vec<(String, usize)>>,
}

/// Numbers of one ligament over all knees.
struct Shape {
    numbers: Vec<Parameter<Quantity>>,
}

/// Numbers of all knees, by ligament. Two knees share a number where its name and prior are the same; the first knee's prior stands for it.
fn shapes(all: &[Evidence]) -> Vec<Shape> {
    let mut out: Vec<Shape> = Vec::new();
    for p in all.iter().flat_map(|e| &e.numbers) {
        let here = out.iter_mut().find(|s| owner(&s.numbers[0].name) == owner(&p.name));
        match here {
            Some(shape) if shape.numbers.iter().any(|n| n.name == p.name) => {}
            Some(shape) => shape.numbers.push(p.clone()),
            None => out.push(Shape { numbers: vec![p.clone()] }),
        }
    }
    out
}

/// A knee's samples of the numbers of a ligament, and their places there; none where it has them not, or one with another prior.
fn in_shape<'a>(shape: &Shape, of: &'a Evidence) -> Option<(Vec<usize>, &'a Measured)> {
    let place = |k: &usize| {
        let p = &of.numbers[*k];
        shape.numbers.iter().position(|q| q.name == p.name && q.prior == p.prior)
    };
    of.measured.iter().find_map(|(own, m)| Some((own.iter().map(place).collect::<Option<Vec<usize>>>()?, m)))
}

/// What every knee but `left_out` says of the numbers of a ligament; that one says nothing. Knees with the same of its numbers have their
/// covariances in common. The data of the knee that is left out are not in them: else they would be told back to it by what the others say.
fn said(shape: &Shape, all: &[Evidence], left_out: Option<usize>) -> Vec<Message> {
    let n = shape.numbers.len();
    let mut out: Vec<Message> = all.iter().map(|_| Message::nothing(n)).collect();
    let mut alike: BTreeMap<Vec<usize>, Vec<(usize, &Measured)>> = BTreeMap::new();
    for (knee, evidence) in all.iter().enumerate().filter(|(k, _)| Some(*k) != left_out) {
        if let Some((places, measured)) = in_shape(shape, evidence) {
            alike.entry(places).or_default().push((knee, measured));
        }
    }
    for (places, knees) in alike {
        let measured: Vec<&Measured> = knees.iter().map(|k| k.1).collect();
        for ((knee, _), message) in knees.iter().zip(messages(&measured)) {
            for (i, a) in places.iter().enumerate() {
                out[*knee].shift[*a] = message.shift[i];
                for (k, b) in places.iter().enumerate() {
                    out[*knee].precision[(*a, *b)] = message.precision[(i, k)];
                }
            }
        }
    }
    out
}

/// What all others say to each knee, and all of them to one that is not among them.
pub fn priors(all: &[Evidence]) -> Found {
    let shapes = shapes(all);
    let to = |k: usize| -> (Vec<Group>, Vec<Averaged>) {
        let left_out = Some(k).filter(|k| *k < all.len());
        let groups = groups(&shapes, all, left_out);
        let told = told_to(&groups, &[left_out]);
        (groups, told)
    };
    // each knee in turn, then one that is not among them
    let all_told: Vec<(Vec<Group>, Vec<Averaged>)> = (0..=all.len()).into_par_iter().map(to).collect();
    let of = all_told.iter().enumerate().flat_map(|(k, (_, told))| told.iter().map(move |of| (k, of)));
    Found {
        priors: of.clone().map(|(k, of)| prior(&shapes, all, (k, of))).collect(),
        shares: of.map(|(_, of)| of.shares).collect(),
        informed: all_told.iter().map(|(groups, _)| informed(&shapes, groups)).collect(),
    }
}

/// What all knees but `left_out` say, by ligament.
fn groups(shapes: &[Shape], all: &[Evidence], left_out: Option<usize>) -> Vec<Group> {
    let group = |shape: &Shape| Group {
        sorts: shape.numbers.iter().filter_map(|p| Sort::of(&p.quantity)).collect(),
        messages: said(shape, all, left_out),
    };
    shapes.iter().map(group).collect()
}

/// The prior of the knee at a place; beyond the last, of one that is not among them.
fn prior(shapes: &[Shape], all: &[Evidence], (k, of): (usize, &Averaged)) -> Shared {
    Shared {
        schema: SCHEMA.to_owned(),
        knee: all.get(k).map(|e| e.knee.clone()),
        from: all.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, e)| e.knee.clone()).collect(),
        file: None,
        numbers: shapes.iter().zip(&of.groups).flat_map(|(s, g)| s.numbers.iter().zip(g)).filter_map(number).collect(),
    }
}

/// How many knees say anything of each number.
fn informed(shapes: &[Shape], groups: &[Group]) -> Vec<(String, usize)> {
    let count = |(shape, group): (&Shape, &Group)| -> Vec<(String, usize)> {
        let says = |k: usize| group.messages.iter().filter(|m| !m.is_silent(k)).count();
        shape.numbers.iter().enumerate().map(|(k, p)| (p.name.clone(), says(k))).collect()
    };
    shapes.iter().zip(groups).flat_map(count).collect()
}

/// A line of a shared prior; none of a number that nobody says anything of.
fn number((p, [mean, sd]): (&Parameter<Quantity>, &[f64; 2])) -> Option<SharedNumber> {
    let changed = mean.abs() > LEAST_CHANGE || (sd - 1.0).abs() > LEAST_CHANGE;
    changed.then(|| SharedNumber::of(&p.name, &p.prior, [*mean, *sd]))
}

#[cfg(test)]
mod tests;
