//! The energy ledger.

use serde::{Deserialize, Serialize};

/// Energies [N mm]; work and dissipation are counted from the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Energies {
    /// Of motion; the leapfrog's product of neighbouring half increments.
    pub kinetic: f64,
    /// Stored in fibres.
    pub strain: f64,
    /// Stored in contact.
    pub contact: f64,
    /// Taken by friction, what its sticking stores included.
    pub friction: f64,
    /// Taken by dashpots.
    pub damping: f64,
    /// Work of loads and prescribed motions.
    pub external: f64,
    /// Stored energy that changed at once: bundles that failed, contact that was defined at the start of a step.
    pub released: f64,
    /// Total at the start.
    pub initial: f64,
    /// Largest energy held and dissipated so far.
    pub largest: f64,
    /// Largest miss of the balance so far.
    pub miss: f64,
}

impl Energies {
    /// What the run has more than it was given: zero but for the scheme's error.
    pub fn residual(&self) -> f64 {
        self.held() + self.friction + self.damping + self.released - self.external - self.initial
    }

    /// Largest miss of the balance so far, of the largest energy [-].
    pub fn balance_error(&self) -> f64 {
        self.miss / self.largest.max(1e-9)
    }

    /// Kinetic and stored.
    fn held(&self) -> f64 {
        self.kinetic + self.strain + self.contact
    }

    /// Notes the balance.
    pub(crate) fn note(&mut self) {
        let taken = self.friction.abs() + self.damping.abs() + self.released.abs();
        self.largest = self.largest.max(self.held() + taken);
        self.miss = self.miss.max(self.residual().abs());
    }
}

impl std::fmt::Display for Energies {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Energies { kinetic, strain, contact, friction, damping, external, .. } = self;
        write!(
            f,
            "kinetic {kinetic:.3e}, strain {strain:.3e}, contact {contact:.3e}, friction {friction:.3e}, damping {damping:.3e}, external {external:.3e} N mm"
        )
    }
}
