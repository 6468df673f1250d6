//! Pressure-overclosure law: linear between points, the last slope continued, nothing below the first point.

use crate::error::SimError;

/// A segment of the law: pressure, and the energy per area stored up to its start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Segment {
    start: f64,
    pressure: f64,
    slope: f64,
    energy: f64,
}

/// Tabular pressure over overclosure.
#[derive(Clone, Debug, PartialEq)]
pub struct PressureLaw {
    segments: Vec<Segment>,
}

impl PressureLaw {
    /// From a table: overclosure [mm] ascending, pressure [MPa] not falling, starting at 0.
    pub fn new(overclosure: &[f64], pressure: &[f64]) -> Result<PressureLaw, SimError> {
        let fault = |m: String| Err(SimError::Spec(format!("contact: {m}")));
        if overclosure.len() != pressure.len() || overclosure.len() < 2 {
            return fault(format!(
                "{} overclosures and {} pressures, expected as many, at least two",
                overclosure.len(),
                pressure.len()
            ));
        }
        let mut segments = Vec::new();
        let mut energy = 0.0;
        for i in 0..overclosure.len() - 1 {
            let (x0, x1, p0, p1) = (overclosure[i], overclosure[i + 1], pressure[i], pressure[i + 1]);
            if !(x1 > x0 && p1 >= p0 && p0 >= 0.0 && x0.is_finite() && x1.is_finite() && p1.is_finite()) {
                return fault(format!("table point {}: overclosure must rise and pressure may not fall", i + 1));
            }
            segments.push(Segment { start: x0, pressure: p0, slope: (p1 - p0) / (x1 - x0), energy });
            energy += (x1 - x0) * (p0 + p1) / 2.0;
        }
        if pressure[0] != 0.0 {
            return fault(format!("the first pressure is {}, expected 0", pressure[0]));
        }
        Ok(PressureLaw { segments })
    }

    /// Overclosure below which there is no pressure [mm].
    pub fn start(&self) -> f64 {
        self.segments[0].start
    }

    /// Largest slope [MPa/mm].
    pub fn steepest(&self) -> f64 {
        self.segments.iter().fold(0.0, |m, s| s.slope.max(m))
    }

    /// Energy per area [N/mm], pressure [MPa], slope [MPa/mm] at an overclosure [mm].
    #[inline]
    pub fn at(&self, overclosure: f64) -> (f64, f64, f64) {
        for s in self.segments.iter().rev() {
            let x = overclosure - s.start;
            if x > 0.0 {
                let p = s.pressure + s.slope * x;
                return (s.energy + x * (s.pressure + p) / 2.0, p, s.slope);
            }
        }
        (0.0, 0.0, 0.0)
    }
}
