//! The energy ledger of deformable solids.

use serde::{Deserialize, Serialize};

/// Energies [N mm]; work and dissipation are counted from the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Of motion; the leapfrog's product of neighbouring half increments.
    pub kinetic: f64,
    /// Work against the elements' mean stress.
    pub strain: f64,
    /// Stored in hourglass modes.
    pub hourglass: f64,
    /// Taken by hourglass viscosity.
    pub hourglass_viscous: f64,
    /// Stored in penetration and sticking friction.
    pub contact: f64,
    /// Taken by friction.
    pub friction: f64,
    /// Taken by mass-proportional damping.
    pub damping: f64,
    /// Work of loads and prescribed motions.
    pub external: f64,
    /// Largest energy held and dissipated so far.
    pub largest: f64,
    /// Largest miss of the balance so far.
    pub miss: f64,
}

impl Ledger {
    /// What there is more than was given: zero but for the scheme's error.
    pub fn residual(&self) -> f64 {
        self.held() + self.taken() - self.external
    }

    /// Largest miss of the balance so far, of the largest energy [-].
    pub fn balance_error(&self) -> f64 {
        self.miss / self.largest.max(1e-12)
    }

    fn held(&self) -> f64 {
        self.kinetic + self.strain + self.hourglass + self.contact
    }

    fn taken(&self) -> f64 {
        self.hourglass_viscous + self.friction + self.damping
    }

    pub(super) fn note(&mut self) {
        self.largest = self.largest.max(self.held().abs() + self.taken().abs());
        self.miss = self.miss.max(self.residual().abs());
    }
}

impl std::fmt::Display for Ledger {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Ledger { kinetic, strain, hourglass, contact, friction, damping, external, .. } = self;
        write!(
            f,
            "kinetic {kinetic:.3e}, strain {strain:.3e}, hourglass {hourglass:.3e}, contact {contact:.3e}, friction {friction:.3e}, damping {damping:.3e}, external {external:.3e} N mm"
        )
    }
}
