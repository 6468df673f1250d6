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
use message::{inflation, messages};
use nalgebra::DVector;
use population::{Averaged, Group, Shares, told_to};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Numbers of all ligaments are looked at together where few samples count a ratio of variances as larger by at most this [-]. Beyond, those of a
/// ligament are: with so few samples all together would say next to nothing. Ours: in linear toys of 32 numbers, 48 samples of four other knees.
const MOST_INFLATION: f64 = 3.5;

/// What a knee's data say of the numbers that knees share.
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    /// What it is called ([`called`]).
    pub knee: String,
    /// Its numbers, with their priors.
    pub numbers: Vec<Parameter<Quantity>>,
    /// Samples of them; none of fewer than two.
    pub measured: Option<Measured>,
}

/// Whose a number is, where ligaments are looked at one by one: of a ligament all bundles together, since one can make up for another.
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
        let of = |samples: &[DVector<f64>]| -> Vec<DVector<f64>> {
            samples.iter().map(|z| DVector::from_iterator(places.len(), places.iter().map(|k| z[*k]))).collect()
        };
        let measured = Measured::of(&of(after), &of(before));
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

    /// How many of its numbers the data say anything of, by its own samples alone, ligament by ligament.
    pub fn informed(&self) -> usize {
        let of = |numbers: &Numbers| {
            let (_, own) = in_common(numbers, self)?;
            Some(own.alone().says().iter().filter(|says| **says).count())
        };
        by_ligament(&self.numbers).iter().filter_map(of).sum()
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

/// Numbers that are looked at together.
type Numbers = Vec<Parameter<Quantity>>;

/// Numbers of all knees. Two knees share a number where its name and prior are the same; the first knee's prior stands for it.
fn numbers_of(all: &[Evidence]) -> Numbers {
    let mut out = Numbers::new();
    for p in all.iter().flat_map(|e| &e.numbers) {
        if out.iter().all(|n| n.name != p.name) {
            out.push(p.clone());
        }
    }
    out
}

/// The same, those of a ligament in a group of their own.
fn by_ligament(numbers: &[Parameter<Quantity>]) -> Vec<Numbers> {
    let mut out: Vec<Numbers> = Vec::new();
    for p in numbers {
        match out.iter_mut().find(|group| owner(&group[0].name) == owner(&p.name)) {
            Some(group) => group.push(p.clone()),
            None => out.push(vec![p.clone()]),
        }
    }
    out
}

/// Numbers that are looked at together: all of them, where the samples of all knees but one suffice.
///
/// Data show a sum of two ligaments' numbers rather than each. A knee that tells of one ligament alone takes the other's number for noise. But what
/// other knees have in common in that number is in the word of every knee, and does not average out: thirty knees would be as sure as thirty
/// readings, of what is one error.
fn shapes(all: &[Evidence]) -> Vec<Numbers> {
    let numbers = numbers_of(all);
    let most = all.iter().filter_map(|e| e.measured.as_ref()).map(Measured::freedom);
    let sum = |k: usize| most.clone().map(|f| f[k]).sum::<f64>() - most.clone().map(|f| f[k]).fold(0.0, f64::max);
    match inflation(numbers.len(), [sum(0), sum(1)]) {
        Some(factor) if factor <= MOST_INFLATION => vec![numbers],
        _ => by_ligament(&numbers),
    }
}

/// A knee's samples of those of some numbers that it has with the same prior, and their places among them; none where it has none.
fn in_common(numbers: &[Parameter<Quantity>], of: &Evidence) -> Option<(Vec<usize>, Measured)> {
    let place = |p: &Parameter<Quantity>| numbers.iter().position(|q| q.name == p.name && q.prior == p.prior);
    let (own, places): (Vec<usize>, Vec<usize>) =
        of.numbers.iter().enumerate().filter_map(|(k, p)| Some((k, place(p)?))).unzip();
    let measured = of.measured.as_ref().filter(|_| !own.is_empty())?;
    Some((places, measured.some(&own)))
}

/// What every knee but `left_out` says of some numbers; that one says nothing. Knees with the same of them have their covariances in common. The
/// data of the knee that is left out are not in them: else they would be told back to it by what the others say.
fn said(numbers: &[Parameter<Quantity>], all: &[Evidence], left_out: Option<usize>) -> Vec<Message> {
    let n = numbers.len();
    let mut out: Vec<Message> = all.iter().map(|_| Message::nothing(n)).collect();
    let mut alike: BTreeMap<Vec<usize>, Vec<(usize, Measured)>> = BTreeMap::new();
    for (knee, evidence) in all.iter().enumerate().filter(|(k, _)| Some(*k) != left_out) {
        if let Some((places, measured)) = in_common(numbers, evidence) {
            alike.entry(places).or_default().push((knee, measured));
        }
    }
    for (places, knees) in alike {
        let measured: Vec<&Measured> = knees.iter().map(|k| &k.1).collect();
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
    let informed: Vec<Vec<(String, usize)>> = all_told.iter().map(|(groups, _)| informed(&shapes, groups)).collect();
    let of = all_told.iter().enumerate().flat_map(|(k, (_, told))| told.iter().map(move |of| (k, of)));
    Found {
        priors: of.clone().map(|(k, of)| prior(&shapes, (all, k), (of, &informed[k]))).collect(),
        shares: of.map(|(_, of)| of.shares).collect(),
        informed,
    }
}

/// What all knees but `left_out` say.
fn groups(shapes: &[Numbers], all: &[Evidence], left_out: Option<usize>) -> Vec<Group> {
    let group = |numbers: &Numbers| Group {
        sorts: numbers.iter().filter_map(|p| Sort::of(&p.quantity)).collect(),
        messages: said(numbers, all, left_out),
    };
    shapes.iter().map(group).collect()
}

/// The prior of the knee at a place, beyond the last of one that is not among them: a line of each number that somebody says anything of.
fn prior(
    shapes: &[Numbers],
    (all, k): (&[Evidence], usize),
    (of, informed): (&Averaged, &[(String, usize)]),
) -> Shared {
    let numbers = shapes.iter().flatten().zip(of.groups.iter().flatten()).zip(informed);
    let told = numbers.filter(|(_, (_, knees))| *knees > 0);
    Shared {
        schema: SCHEMA.to_owned(),
        knee: all.get(k).map(|e| e.knee.clone()),
        from: all.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, e)| e.knee.clone()).collect(),
        file: None,
        numbers: told.map(|((p, z), _)| SharedNumber::of(&p.name, &p.prior, *z)).collect(),
    }
}

/// How many knees say anything of each number.
fn informed(shapes: &[Numbers], groups: &[Group]) -> Vec<(String, usize)> {
    let count = |(numbers, group): (&Numbers, &Group)| -> Vec<(String, usize)> {
        let says: Vec<Vec<bool>> = group.messages.iter().map(Message::says).collect();
        let knees = |k: usize| says.iter().filter(|s| s[k]).count();
        numbers.iter().enumerate().map(|(k, p)| (p.name.clone(), knees(k))).collect()
    };
    shapes.iter().zip(groups).flat_map(count).collect()
}

#[cfg(test)]
mod tests;
