//! Elastic foundation by local thickness: cartilages as thin elastic layers bonded to bone, in series [blankevoort1991b; bei2004].
//!
//! Both layers are of one material, so they have one strain: overclosure over the sum of their thicknesses.

use crate::error::SimError;
use crate::spec::{LayerLaw, LayerSpec};

/// Strain from which the logarithmic law goes on straight [-]: pressure stays finite where overclosure passes the thickness.
const MOST_STRAIN: f64 = 0.8;

/// Pressure over overclosure and thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    law: LayerLaw,
    /// Stress over strain of a layer that cannot widen [MPa].
    modulus: f64,
    /// The edge's breadth in thicknesses [-].
    pub(super) edge_spread: f64,
}

/// Energy per area of an overclosure d and a thickness h, and its derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Strained {
    /// Energy per area [N/mm].
    pub(super) energy: f64,
    /// By d: pressure [MPa].
    pub(super) pressure: f64,
    /// By d twice: slope [MPa/mm].
    pub(super) slope: f64,
    /// By h [MPa].
    pub(super) by_thickness: f64,
    /// By d and h [MPa/mm].
    pub(super) mixed: f64,
    /// By h twice [MPa/mm].
    pub(super) curve: f64,
}

/// Stress over strain of a layer that is bonded and cannot widen [MPa]: its oedometric modulus.
pub fn confined_modulus(youngs_modulus_mpa: f64, poissons_ratio: f64) -> f64 {
    let nu = poissons_ratio;
    youngs_modulus_mpa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
}

impl Layer {
    /// The law of a specification.
    ///
    /// Errors: numbers out of range.
    pub fn new(spec: &LayerSpec) -> Result<Layer, SimError> {
        let fault = |m: String| Err(SimError::Spec(format!("contact.layer.{m}")));
        let (e, nu, least) = (spec.youngs_modulus_mpa, spec.poissons_ratio, spec.least_thickness_mm);
        if !(e > 0.0 && e < 1e5) {
            return fault(format!("youngs_modulus_mpa is {e}, expected above 0 and below 1e5; check its unit"));
        }
        if !(0.0..0.5).contains(&nu) {
            return fault(format!("poissons_ratio is {nu}, expected 0 to below 0.5"));
        }
        if !(0.05..=5.0).contains(&least) {
            return fault(format!("least_thickness_mm is {least}, expected 0.05 to 5"));
        }
        if !(0.0..=10.0).contains(&spec.edge_spread) {
            return fault(format!("edge_spread is {}, expected 0 to 10", spec.edge_spread));
        }
        Ok(Layer { law: spec.law, modulus: confined_modulus(e, nu), edge_spread: spec.edge_spread })
    }

    /// Energy per area of overclosure `d` [mm] on layers of `h` [mm] together.
    #[inline]
    pub(super) fn at(&self, d: f64, h: f64) -> Strained {
        if d <= 0.0 {
            return Strained::default();
        }
        let inverse = 1.0 / h;
        let x = d * inverse;
        let (f, f1, f2) = match self.law {
            LayerLaw::Linear => (0.5 * x * x, x, 1.0),
            LayerLaw::Logarithmic => logarithmic(x),
        };
        let m = self.modulus;
        let slope = m * f2 * inverse;
        Strained {
            energy: m * h * f,
            pressure: m * f1,
            slope,
            by_thickness: m * (f - x * f1),
            mixed: -x * slope,
            curve: x * x * slope,
        }
    }
}

/// `x + (1 - x) ln(1 - x)` and its derivatives; straight in the first from [`MOST_STRAIN`] on.
#[inline]
fn logarithmic(x: f64) -> (f64, f64, f64) {
    let y = x.min(MOST_STRAIN);
    let left = 1.0 - y;
    let ln = libm::log(left);
    let (f, f1, f2) = (y + left * ln, -ln, 1.0 / left);
    let past = x - y;
    (f + past * (f1 + 0.5 * past * f2), f1 + past * f2, f2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(law: LayerLaw) -> Layer {
        let spec = LayerSpec {
            law,
            youngs_modulus_mpa: 5.0,
            poissons_ratio: 0.45,
            edge_spread: 0.0,
            least_thickness_mm: 0.5,
            bony_faces: Default::default(),
        };
        Layer::new(&spec).unwrap()
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        for law in [LayerLaw::Linear, LayerLaw::Logarithmic] {
            let l = layer(law);
            for (d, h) in [(0.01, 4.0), (1.2, 3.1), (2.5, 4.0), (3.9, 4.0), (6.0, 4.0)] {
                let (here, s) = (l.at(d, h), 1e-6);
                let by = |f: fn(&Strained) -> f64, dd: f64, dh: f64| {
                    (f(&l.at(d + dd, h + dh)) - f(&l.at(d - dd, h - dh))) / (2.0 * s)
                };
                let close =
                    |a: f64, b: f64| assert!((a - b).abs() < 1e-6 * (1.0 + a.abs()), "{law:?} {d} {h}: {a} {b}");
                close(by(|e| e.energy, s, 0.0), here.pressure);
                close(by(|e| e.energy, 0.0, s), here.by_thickness);
                close(by(|e| e.pressure, s, 0.0), here.slope);
                close(by(|e| e.pressure, 0.0, s), here.mixed);
                close(by(|e| e.by_thickness, 0.0, s), here.curve);
            }
        }
    }

    #[test]
    fn small_strain_is_linear_and_two_layers_are_in_series() {
        let (a, b) = (layer(LayerLaw::Linear), layer(LayerLaw::Logarithmic));
        let m = confined_modulus(5.0, 0.45);
        assert!((a.at(0.02, 4.0).pressure / (m * 0.005) - 1.0).abs() < 1e-12);
        assert!((b.at(0.02, 4.0).pressure / a.at(0.02, 4.0).pressure - 1.0).abs() < 0.003);
        // under one pressure layers of 1.5 and 2.5 mm give way by 0.3 and 0.5 mm, together 0.8 of 4
        let p = b.at(0.3, 1.5).pressure;
        assert!((b.at(0.5, 2.5).pressure - p).abs() < 1e-12 && (b.at(0.8, 4.0).pressure - p).abs() < 1e-12);
    }
}
