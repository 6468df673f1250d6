//! A prior that knees of one laboratory share: what the calibrations of the others say of a knee's numbers, before its own data are looked at.
//!
//! The method `posterior` takes it up as the option `shared_prior`, in place of the priors of those numbers ([`Shared::applied`]).
//! [`crate::evidence`] makes it. Frames, sites, leans and noise are of one knee, or of one laboratory's day, and are not shared.

mod moved;

pub use moved::moved;

use crate::error::CalibrationError;
use inference::knee::Quantity;
use inference::parameter::{Parameter, Prior};
use meshes::frame::Side;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::spec::ModelSpec;

/// Version of the file of a shared prior.
pub const SCHEMA: &str = "shared-prior/1";

/// Largest difference of two numbers that are the same, as a share of a prior's width [-]: they went through text.
const SAME: f64 = 1e-6;

/// A sort of numbers that knees share as much of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sort {
    /// Reference strains.
    Strain,
    /// Stiffnesses.
    Stiffness,
    /// Contact and cartilage.
    Other,
}

impl Sort {
    /// All of them.
    pub const ALL: [Sort; 3] = [Sort::Strain, Sort::Stiffness, Sort::Other];

    /// Its place among all.
    pub fn place(self) -> usize {
        self as usize
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        ["strain", "stiffness", "other"][self.place()]
    }

    /// The sort of a quantity; `None` of what is not shared.
    pub fn of(quantity: &Quantity) -> Option<Sort> {
        match quantity {
            Quantity::ReferenceStrain(_) => Some(Sort::Strain),
            Quantity::Stiffness(_) => Some(Sort::Stiffness),
            Quantity::ContactScale | Quantity::Cartilage => Some(Sort::Other),
            Quantity::Frame(..)
            | Quantity::Site(..)
            | Quantity::Lean(..)
            | Quantity::Compliance(..)
            | Quantity::Resting(..) => None,
        }
    }
}

/// The option `shared_prior`: a file, or what was read in it. Written as text either way, so that what was read counts among the options.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum SharedPrior {
    /// A file that nobody has read yet.
    File(String),
    /// What was read.
    Read(Box<Shared>),
}

impl TryFrom<String> for SharedPrior {
    type Error = String;

    fn try_from(text: String) -> Result<SharedPrior, String> {
        match text.trim() {
            "" => Err("the file of a shared prior was expected; build-model cohort infer writes one".into()),
            // a path is one line
            one if !one.contains('\n') => Ok(SharedPrior::File(one.to_owned())),
            _ => {
                let shared = toml::from_str::<Shared>(&text).map_err(|e| e.message().to_owned())?;
                Ok(SharedPrior::Read(Box::new(shared.checked()?)))
            }
        }
    }
}

impl From<SharedPrior> for String {
    fn from(prior: SharedPrior) -> String {
        match prior {
            SharedPrior::File(path) => path,
            SharedPrior::Read(shared) => toml::to_string(&shared).unwrap_or_default(),
        }
    }
}

/// What other knees say of a knee's numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shared {
    /// [`SCHEMA`].
    pub schema: String,
    /// The knee that it is for: its id and side ([`called`]). None: a knee that is not among those it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub knee: Option<String>,
    /// The knees that it comes from.
    pub from: Vec<String>,
    /// Name of the file that it was read from; a file itself need not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(skip)]
    pub file: Option<String>,
    /// Numbers of which they say anything.
    pub numbers: Vec<SharedNumber>,
}

/// What other knees say of one number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedNumber {
    /// Its name, as in parameters.csv.
    pub name: String,
    /// Its mean, in standard deviations of its own prior [-].
    pub mean: f64,
    /// Its standard deviation likewise [-].
    pub sd: f64,
    /// Its own prior: values at -1, 0 and 1 standard deviations, in the number's unit. A knee with another prior does not use the line.
    pub before: [f64; 3],
    /// The shared one: the same.
    pub after: [f64; 3],
}

/// What a knee is called where knees are told apart: its id and its side.
pub fn called(spec: &ModelSpec) -> String {
    called_by(&spec.id, spec.side)
}

/// The same of a knee that has no model yet.
pub fn called_by(id: &str, side: Side) -> String {
    format!("{id} {}", if side == Side::Left { "left" } else { "right" })
}

/// A prior's values at -1, 0 and 1 standard deviations.
fn values(prior: &Prior) -> [f64; 3] {
    [-1.0, 0.0, 1.0].map(|z| prior.at(z).0)
}

impl Shared {
    /// Refuses what is no shared prior.
    ///
    /// # Errors
    /// The key, its value and what was expected.
    pub fn checked(self) -> Result<Shared, String> {
        if self.schema != SCHEMA {
            return Err(format!(
                "schema is {:?}, expected {SCHEMA}; build-model cohort infer writes such a file",
                self.schema
            ));
        }
        for (k, n) in self.numbers.iter().enumerate() {
            let wrong = |key: &str, value: f64, expected: &str| {
                Err(format!("numbers[{k}] ({}): {key} is {value}, expected {expected}", n.name))
            };
            if !n.mean.is_finite() || n.mean.abs() > FURTHEST {
                return wrong(
                    "mean",
                    n.mean,
                    &format!("-{FURTHEST} to {FURTHEST} standard deviations of the number's own prior"),
                );
            }
            if !(n.sd > 0.0 && n.sd <= WIDEST) {
                return wrong("sd", n.sd, &format!("above 0, at most {WIDEST}"));
            }
            if self.numbers[..k].iter().any(|other| other.name == n.name) {
                return Err(format!("numbers[{k}]: {} is there twice, expected once", n.name));
            }
        }
        Ok(self)
    }

    /// Its file, whose data are in it, and of how much they tell, in a few words.
    pub fn in_words(&self) -> String {
        let say = if self.from.len() == 1 { "says" } else { "say" };
        let numbers = if self.numbers.len() == 1 { "number" } else { "numbers" };
        let file = self.file.as_ref().map_or(String::new(), |file| format!("{file}: "));
        format!("{file}what {} {say} of {} {numbers}", self.from.join(", "), self.numbers.len())
    }

    /// Refuses one that is for another knee, or that a knee's own data are in.
    ///
    /// # Errors
    /// Whose it is, and what to do.
    pub fn is_for(&self, spec: &ModelSpec) -> Result<(), CalibrationError> {
        self.is_for_knee(&called(spec)).map_err(|what| CalibrationError::Option(format!("shared_prior: {what}")))
    }

    /// The same of a knee by what it is called ([`called_by`]), as soon as that is known.
    ///
    /// # Errors
    /// Whose it is, and what to do.
    pub fn is_for_knee(&self, own: &str) -> Result<(), String> {
        let refused =
            |what: String| Err(format!("{what}; give the file that build-model cohort infer wrote for {own}"));
        match &self.knee {
            _ if self.from.iter().any(|from| from == own) => {
                refused(format!("it comes from {own} itself, whose data would count twice"))
            }
            Some(knee) if knee != own => refused(format!("it is for {knee}, and this knee is {own}")),
            _ => Ok(()),
        }
    }

    /// Whether a parameter has the prior that a line is counted from.
    fn is_of(n: &SharedNumber, p: &Parameter<Quantity>) -> bool {
        let (own, width) = (values(&p.prior), n.before[2] - n.before[0]);
        p.name == n.name && own.iter().zip(n.before).all(|(a, b)| (a - b).abs() <= SAME * width.abs())
    }

    /// Parameters with the shared prior in place of their own.
    pub fn applied(&self, parameters: &mut [Parameter<Quantity>]) {
        for p in parameters.iter_mut().filter(|p| Sort::of(&p.quantity).is_some()) {
            if let Some(n) = self.numbers.iter().find(|n| Shared::is_of(n, p)) {
                p.prior = moved(&p.prior, n.mean, n.sd);
            }
        }
    }

    /// What is told of numbers that the knee has not, or with another prior; `parameters` have their own.
    pub fn unused(&self, parameters: &[Parameter<Quantity>]) -> Option<Notice> {
        let lacks =
            |n: &&SharedNumber| !parameters.iter().any(|p| Sort::of(&p.quantity).is_some() && Shared::is_of(n, p));
        let names: Vec<&str> = self.numbers.iter().filter(lacks).map(|n| n.name.as_str()).collect();
        (!names.is_empty()).then(|| {
            let text = format!(
                "{} of {} numbers of the shared prior are not used: this knee has them not, or with another prior of its own ({})",
                names.len(),
                self.numbers.len(),
                names.join(", ")
            );
            Kind::PriorUnused.notice(text).count(names.len())
        })
    }
}

/// Furthest that a shared mean may lie from a number's own prior [sd]; ours: beyond, the prior itself was wrong.
const FURTHEST: f64 = 6.0;
/// Widest that a shared prior may be [sd of the own prior]; ours: an average over shares is wider by little.
const WIDEST: f64 = 2.0;

impl SharedNumber {
    /// A line of a number with this prior; mean and standard deviation are kept within what a file may have.
    pub fn of(name: &str, prior: &Prior, [mean, sd]: [f64; 2]) -> SharedNumber {
        let (mean, sd) = (mean.clamp(-FURTHEST, FURTHEST), sd.min(WIDEST));
        let after = values(&moved(prior, mean, sd));
        SharedNumber { name: name.to_owned(), mean, sd, before: values(prior), after }
    }
}
