//! What ties wedges to each other and the horns to the tibia: fibres that bear tension, in a matrix that bears all.

use super::shape::Part;
use super::{put, shift};
use crate::condensed::Parts;
use crate::ligament::toe_then_line;
use crate::spec::{HornSpec, MeniscusSpec};
use meshes::Vector;
use nalgebra::Matrix3;

/// Strain over which fibres take hold [-]; ours: stiffness stays continuous, and is the fibres' from half a percent on.
const TOE: f64 = 0.005;

/// A link from one wedge to the next, or to the tibia.
#[derive(Clone, Debug)]
pub(super) struct Link {
    /// The wedge that it begins at, and the one that it ends at; none: the tibia.
    ends: (usize, Option<usize>),
    /// From one end to the other where nothing is shifted [mm].
    rest: Vector,
    /// Of the fibres, in tension alone [N/mm].
    fibres: f64,
    /// Of the matrix along the link, beyond that across it [N/mm].
    along: f64,
    /// Of the matrix across the link [N/mm].
    across: f64,
}

/// The links of a meniscus: the anterior horn's, between wedges, the posterior horn's.
pub(super) fn links(m: &MeniscusSpec, parts: &[Part]) -> Vec<Link> {
    let [e, t, g] =
        [m.material.circumferential_modulus_mpa, m.material.transverse_modulus_mpa, m.material.shear_modulus_mpa];
    let of = |ends, rest: Vector, area: f64, horn: f64| {
        let length = rest.norm();
        // a horn's own stiffness is in series with half a wedge
        let soft = |modulus: f64| 1.0 / (length / (modulus * area) + horn);
        let (tension, press, across) = (soft(e), soft(t), soft(g));
        Link { ends, rest, fibres: tension - press, along: press - across, across }
    };
    let horn = |n: usize, horn: &HornSpec| {
        of((n, None), horn.tibia.coords - parts[n].centre, parts[n].area, 1.0 / horn.stiffness_n_per_mm)
    };
    let mut out = vec![horn(0, &m.anterior_horn)];
    for (n, pair) in parts.windows(2).enumerate() {
        let area = 0.5 * (pair[0].area + pair[1].area);
        out.push(of((n, Some(n + 1)), pair[1].centre - pair[0].centre, area, 0.0));
    }
    out.push(horn(parts.len() - 1, &m.posterior_horn));
    out
}

impl Link {
    /// How much further apart its ends are than where nothing is shifted.
    fn moved(&self, inner: &[f64]) -> Vector {
        self.ends.1.map_or(Vector::zeros(), |n| shift(inner, n)) - shift(inner, self.ends.0)
    }

    /// Energy, force and stiffness along the link at a stretch [mm].
    fn stretched(&self, x: f64) -> (f64, f64, f64) {
        // the parabola ends at TOE
        let (r, c) = (toe_then_line(self.fibres, 0.5 * TOE * self.rest.norm(), x), self.along);
        (r.energy + 0.5 * c * x * x, r.force + c * x, r.stiffness + c)
    }

    /// Tension [N]; below 0 where it is pressed.
    pub(super) fn tension(&self, inner: &[f64]) -> f64 {
        let moved = self.moved(inner);
        let along = self.rest + moved;
        self.stretched(along.norm() - self.rest.norm()).1 + self.across * moved.dot(&along) / along.norm().max(1e-9)
    }

    /// Adds its energy and derivatives.
    pub(super) fn add(&self, inner: &[f64], out: &mut Parts) {
        let moved = self.moved(inner);
        let length = (self.rest + moved).norm().max(1e-9);
        let way = (self.rest + moved) / length;
        let (e, f, s) = self.stretched(length - self.rest.norm());
        out.energy += e + 0.5 * self.across * moved.norm_squared();
        let gradient = way * f + moved * self.across;
        let along = way * way.transpose();
        let stiffness = along * s + (Matrix3::identity() - along) * (f / length) + Matrix3::identity() * self.across;
        put(out, self.ends.0, &-gradient, &stiffness);
        if let Some(other) = self.ends.1 {
            put(out, other, &gradient, &stiffness);
            for a in 0..3 {
                (0..3).for_each(|b| out.stiffness.add(3 * other + a, 3 * self.ends.0 + b, -stiffness[(a, b)]));
            }
        }
    }
}
