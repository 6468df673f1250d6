//! A number of a build, the limits that grade it, and the evidence that it makes.

use super::context::Context;
use super::evidence::{Evidence, Factor};
use super::grade::{Grade, grade, more_is_better};
use super::read::{Build, Read};

/// Reads a number of a build.
pub(super) type Take = fn(&Build, &Context) -> Option<(f64, Read)>;

/// A number of the build and its limits.
pub(super) struct Row {
    pub(super) id: &'static str,
    pub(super) factor: Factor,
    pub(super) what: &'static str,
    pub(super) unit: &'static str,
    /// From where on it is strong, and adequate. Where the first is the larger, more is better.
    pub(super) limits: [f64; 2],
    pub(super) why: &'static str,
    pub(super) take: Take,
}

impl Row {
    /// What a build has of it.
    pub(super) fn evidence(&self, build: &Build, context: &Context) -> Evidence {
        // what an earlier row did not find is not this one's
        build.was_lost();
        build.astray();
        let (value, read) = (self.take)(build, context).unzip();
        Evidence { astray: build.astray(), ..self.told(value, read, build.was_lost()) }
    }

    /// The evidence of a number and the file that it was read from; `gone` where a file that its stage left was not found.
    pub(super) fn told(&self, value: Option<f64>, read: Option<Read>, gone: bool) -> Evidence {
        let sound = read.as_ref().is_some_and(|read| read.as_built) && !gone;
        Evidence {
            id: self.id,
            factor: self.factor,
            what: self.what.into(),
            value,
            unit: self.unit.into(),
            limits: self.limits,
            more_is_better: more_is_better(self.limits),
            grade: value.filter(|_| sound).map_or(Grade::NoEvidence, |v| grade(v, self.limits)),
            why: self.why.into(),
            stage: read.as_ref().map(|r| r.stage.clone()),
            test: None,
            test_digest: None,
            as_built: (gone || read.is_some()).then_some(sound),
            digest: read.as_ref().map(|r| r.digest.clone()),
            date: read.as_ref().and_then(|r| r.date.clone()),
            flexions_deg: read.as_ref().map(|r| r.flexions_deg.clone()).unwrap_or_default(),
            file: read.map(|r| r.file).unwrap_or_default(),
            astray: vec![],
        }
    }
}
