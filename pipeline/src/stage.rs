//! A stage of the build in one place: its number and name, what it is given, its work, and all that is told and shown of it.
//!
//! A file a stage; [`list`] has them in order, and everyone else walks over that list.

mod answers;
mod artifacts;
mod assemble;
mod attachments;
mod bones;
mod calibrate;
mod cartilage;
mod contact_law;
mod diagnose;
mod frames;
mod hexahedra;
mod hexmesh;
mod ingest;
mod layers;
pub(crate) mod list;
mod overclosure;
pub(crate) mod parts;
mod register;
mod segment;
mod validate;
mod values;

pub(crate) use answers::{Answer, Standing, answers};
pub(crate) use artifacts::Files;
pub(crate) use assemble::{contact_surface, fibre_layers};
pub(crate) use calibrate::{MOST_NOISE, PARTLY_NOISE};
pub(crate) use layers::{CONTEXT_MM, bone_layers, ct_layers};
pub(crate) use validate::BETWEEN_TEAMS;
pub(crate) use validate::on_paper;
pub(crate) use values::Values;

use crate::error::{BuildError, Fault};
use crate::kept::Inputs;
use crate::options::BuildOptions;
use crate::report::chart::Chart;
use crate::report::check::{Check, KeyFigure};
use crate::report::geometry::Pool;
use crate::report::picture::Picture;
use crate::report::scene::Scene;
use crate::store::BuildFolder;
use notices::Notice;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::any::{Any, TypeId};
use std::borrow::Cow;

/// The file in a stage's folder that holds its value.
pub(crate) const VALUE: &str = "value.cbor";

/// What every stage's value tells of itself.
pub(crate) trait Reported {
    /// For metrics.json.
    fn metrics(&self) -> serde_json::Value;
    /// What is odd but not fatal.
    fn warnings(&self) -> &[Notice];
}

/// A value whose fields `metrics` and `warnings` tell of it.
macro_rules! reported {
    ($type:ty) => {
        impl crate::stage::Reported for $type {
            fn metrics(&self) -> serde_json::Value {
                serde_json::to_value(&self.metrics).unwrap_or_default()
            }
            fn warnings(&self) -> &[notices::Notice] {
                &self.warnings
            }
        }
    };
}
use reported;

/// What a stage may use beside its inputs; nothing of it changes the result.
pub(crate) struct Work<'a> {
    /// Where an interrupted search is kept.
    pub(crate) folder: &'a BuildFolder,
    /// Told how far the work is.
    pub(crate) tell: &'a (dyn Fn(&str) + Sync),
    /// The stage's name, and the key under which its value will be kept.
    pub(crate) stage: (&'static str, &'a str),
}

impl Work<'_> {
    /// A part of the stage's value: taken from an interrupted run that was given the same, or made and kept until the stage is done.
    pub(crate) fn part<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        make: impl FnOnce() -> Result<T, BuildError>,
    ) -> Result<T, BuildError> {
        let (stage, key) = self.stage;
        if let Some(value) = parts::taken(self.folder, stage, name, key) {
            (self.tell)(&format!("{stage} {name}: taken from the run that was interrupted"));
            return Ok(value);
        }
        let value = make()?;
        parts::keep(self.folder, stage, name, key, &value)?;
        Ok(value)
    }
}

/// One stage. All of it is associated functions, which capture nothing: the result depends on inputs and options alone, and the
/// digests of both are the key under which it is kept.
pub(crate) trait Stage: Sync + 'static {
    /// Its number in the folder's name.
    const NUMBER: &'static str;
    /// Its name.
    const NAME: &'static str;
    /// The metrics that tell most, by the end of their names.
    const TELLING: &'static [&'static str];
    /// What one looks at first in its section of the report.
    const LOOK: Option<&'static str> = None;
    /// What it is given.
    type Inputs<'a>: Inputs;
    /// Its options.
    type Options: Serialize + Clone;
    /// What it makes.
    type Value: Serialize + DeserializeOwned + Reported + 'static;
    /// What it says where it cannot go on.
    type Fault: Fault;

    /// Its section of the options.
    fn options(all: &BuildOptions) -> &Self::Options;
    /// The same as far as its work depends on them, as it stands in the key: what another option silences is as by default.
    fn heard(all: &BuildOptions) -> Cow<'_, Self::Options> {
        Cow::Borrowed(Self::options(all))
    }
    /// Its work.
    fn run(inputs: Self::Inputs<'_>, options: &Self::Options, work: &Work) -> Result<Self::Value, Self::Fault>;
    /// What it leaves in its folder, in formats that ParaView, MeshLab and a text editor open.
    fn artifacts(value: &Self::Value, inputs: Self::Inputs<'_>) -> Files;
    /// The surfaces, lines and points by which one sees whether it is right.
    fn scene(_: &Values, _: &mut Pool) -> Option<Scene> {
        None
    }
    /// The same as still pictures; `None` where what they need is not there.
    fn stills(_: &Values) -> Option<Vec<Picture>> {
        None
    }
    /// Its charts.
    fn charts(_: &Values) -> Vec<Chart> {
        vec![]
    }
    /// More of its section of the report, as HTML.
    fn more(_: &Values) -> String {
        String::new()
    }
    /// Its figure among those that matter most.
    fn key_figure(_: &Values) -> Option<KeyFigure> {
        None
    }
    /// The questions one asks of it, answered.
    fn checks(_: &Values) -> Vec<Check> {
        vec![]
    }
}

/// A stage's section of the options, as it stands in the key.
pub(crate) fn section<S: Stage>(all: &BuildOptions) -> Result<String, BuildError> {
    serde_json::to_string(&*S::heard(all)).map_err(|e| BuildError::Option(e.to_string()))
}

/// A stage as the lists see it: [`Stage`] without its types.
pub(crate) trait View: Sync {
    /// [`Stage::NUMBER`].
    fn number(&self) -> &'static str;
    /// [`Stage::NAME`].
    fn name(&self) -> &'static str;
    /// [`Stage::TELLING`].
    fn telling(&self) -> &'static [&'static str];
    /// [`Stage::LOOK`].
    fn look(&self) -> Option<&'static str>;
    /// The type of its value.
    fn holds(&self) -> TypeId;
    /// Its value as it was kept; `None` where it is not there, or of another version.
    fn read(&self, folder: &BuildFolder) -> Option<Box<dyn Any>>;
    /// [`section`].
    #[cfg(test)]
    fn section(&self, all: &BuildOptions) -> Result<String, BuildError>;
    /// [`Stage::scene`].
    fn scene(&self, v: &Values, pool: &mut Pool) -> Option<Scene>;
    /// [`Stage::stills`].
    fn stills(&self, v: &Values) -> Vec<Picture>;
    /// [`Stage::charts`].
    fn charts(&self, v: &Values) -> Vec<Chart>;
    /// [`Stage::more`].
    fn more(&self, v: &Values) -> String;
    /// [`Stage::key_figure`].
    fn key_figure(&self, v: &Values) -> Option<KeyFigure>;
    /// [`Stage::checks`].
    fn checks(&self, v: &Values) -> Vec<Check>;
    /// `NN-name`: its folder.
    fn folder(&self) -> String {
        format!("{}-{}", self.number(), self.name())
    }
}

impl<S: Stage> View for S {
    fn number(&self) -> &'static str {
        S::NUMBER
    }
    fn name(&self) -> &'static str {
        S::NAME
    }
    fn telling(&self) -> &'static [&'static str] {
        S::TELLING
    }
    fn look(&self) -> Option<&'static str> {
        S::LOOK
    }
    fn holds(&self) -> TypeId {
        TypeId::of::<S::Value>()
    }
    fn read(&self, folder: &BuildFolder) -> Option<Box<dyn Any>> {
        let bytes = folder.read_file(&format!("{}/{VALUE}", self.folder()))?;
        Some(Box::new(ciborium::from_reader::<S::Value, _>(bytes.as_slice()).ok()?))
    }
    #[cfg(test)]
    fn section(&self, all: &BuildOptions) -> Result<String, BuildError> {
        section::<S>(all)
    }
    fn scene(&self, v: &Values, pool: &mut Pool) -> Option<Scene> {
        S::scene(v, pool)
    }
    fn stills(&self, v: &Values) -> Vec<Picture> {
        S::stills(v).unwrap_or_default()
    }
    fn charts(&self, v: &Values) -> Vec<Chart> {
        S::charts(v)
    }
    fn more(&self, v: &Values) -> String {
        S::more(v)
    }
    fn key_figure(&self, v: &Values) -> Option<KeyFigure> {
        S::key_figure(v)
    }
    fn checks(&self, v: &Values) -> Vec<Check> {
        S::checks(v)
    }
}
