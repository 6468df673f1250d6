//! What a search met on its way.

use crate::fit::Fit;

/// Fits of single effects that a search met: the best of each hypothesis, with its gain over nothing missing in the scatter of its time.
#[derive(Clone, Debug, Default)]
pub(super) struct Met(Vec<(f64, Fit)>);

impl Met {
    /// The fits.
    pub(super) fn fits(&self) -> impl Iterator<Item = &Fit> {
        self.0.iter().map(|(_, fit)| fit)
    }

    /// Keeps a fit where it is the first of its hypothesis, or the best so far.
    pub(super) fn take(&mut self, gain: f64, fit: &Fit) {
        match self.0.iter_mut().find(|(_, own)| own.hypothesis == fit.hypothesis) {
            Some(own) if own.0 < gain => *own = (gain, fit.clone()),
            Some(_) => {}
            None => self.0.push((gain, fit.clone())),
        }
    }
}
