//! What the finished stages of a build left, read back where it is asked for.

use super::View;
use crate::options::BuildOptions;
use crate::store::BuildFolder;
use std::any::{Any, TypeId};
use std::cell::OnceCell;

/// A stage's value, read when it is first asked for; `None` where it cannot be.
type Value = OnceCell<Option<Box<dyn Any>>>;

/// The values of the finished stages.
pub(crate) struct Values<'a> {
    /// The build's own options.
    pub(crate) options: BuildOptions,
    /// Where the build lies.
    pub(crate) folder: &'a BuildFolder,
    /// Whether a slider moves the assembled knee.
    pub(crate) moves: bool,
    stages: Vec<(&'static dyn View, Value)>,
}

impl<'a> Values<'a> {
    /// The values of `stages`, of the build in `folder` that was made with `options`.
    pub(crate) fn new(folder: &'a BuildFolder, options: BuildOptions, stages: Vec<&'static dyn View>) -> Values<'a> {
        let stages = stages.into_iter().map(|stage| (stage, OnceCell::new())).collect();
        Values { options, folder, moves: false, stages }
    }

    /// The stage's value that is of this type; `None` where the build has not come so far, or another version kept it.
    pub(crate) fn of<T: 'static>(&self) -> Option<&T> {
        let (stage, kept) = self.stages.iter().find(|(stage, _)| stage.holds() == TypeId::of::<T>())?;
        kept.get_or_init(|| stage.read(self.folder)).as_deref()?.downcast_ref()
    }
}
