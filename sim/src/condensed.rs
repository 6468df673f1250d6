//! Bodies with coordinates of their own between femur and tibia, condensed out of the knee's equilibrium.
//!
//! At every pose of the femur such a body rests where its energy over its inner coordinates is least. What is left is an energy of the pose alone;
//! its gradient and Hessian follow by static condensation, `H = E_qq - E_qu E_uu^-1 E_uq`. Inner coordinates that are not quite at rest are
//! corrected by the last Newton step, so that energy and gradient are exact to its square.

use crate::coordinate::Six;
use crate::joint::Pose;
use nalgebra::Matrix6;

/// Newton steps below this end the search for rest [the inner coordinates' units: mm].
const SMALL_STEP: f64 = 2e-4;
/// Most Newton steps to rest.
const MOST_STEPS: usize = 60;
/// A step is halved this often at most.
const MOST_HALVINGS: usize = 12;
/// First shift of a stiffness that is not positive definite, of its greatest diagonal entry [-].
const FIRST_SHIFT: f64 = 1e-3;

/// A body with inner coordinates.
pub trait Inner: std::fmt::Debug + Send + Sync {
    /// The body's name in the specification.
    fn name(&self) -> &str;

    /// How many inner coordinates it has, and how far apart two that are coupled lie in their order.
    fn size(&self) -> (usize, usize);

    /// Energy and its derivatives at a pose and inner coordinates. Coordinates are of one unit, or scaled to be comparable.
    fn at(&self, pose: &Pose, inner: &[f64]) -> Parts;

    /// Furthest an inner coordinate may go in one Newton step.
    fn longest_step(&self) -> f64;

    /// Newton steps below this end the search on the way of a path, where the search for the joint's pose goes on. Energy is then exact to the
    /// step's cube, gradient and stiffness to its square and itself.
    fn step_on_the_way(&self) -> f64 {
        SMALL_STEP
    }

    /// Whether the femur bears on the tibia through it.
    fn bears(&self, _pose: &Pose, _inner: &[f64]) -> bool {
        false
    }

    /// Brings `rest` near the joint's coordinates `q` where Newton's method would not get there from it.
    fn approach(&self, _q: &Six, _rest: &mut Rest) {}

    /// What it tells of itself where it rests: names with their units, values.
    fn outputs(&self, pose: &Pose, inner: &[f64]) -> Vec<(String, f64)>;
}

/// Energy [N mm] and derivatives by the joint's and the inner coordinates.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Energy.
    pub energy: f64,
    /// By the joint's coordinates.
    pub outer: Six,
    /// By these twice.
    pub hessian: Matrix6<f64>,
    /// By each inner coordinate.
    pub inner: Vec<f64>,
    /// By each inner coordinate and the joint's.
    pub mixed: Vec<Six>,
    /// By the inner coordinates twice.
    pub stiffness: Band,
}

impl Parts {
    /// All zero, for inner coordinates of a size and a bandwidth.
    pub fn zeros((size, band): (usize, usize)) -> Parts {
        Parts {
            energy: 0.0,
            outer: Six::zeros(),
            hessian: Matrix6::zeros(),
            inner: vec![0.0; size],
            mixed: vec![Six::zeros(); size],
            stiffness: Band::zeros(size, band),
        }
    }
}

/// A body at rest at a pose: a function of the joint's coordinates alone.
#[derive(Clone, Debug, Default)]
pub struct Condensed {
    /// Energy [N mm].
    pub energy: f64,
    /// Its gradient [N mm, N].
    pub gradient: Six,
    /// Its second derivative.
    pub hessian: Matrix6<f64>,
    /// The inner coordinates at rest.
    pub inner: Vec<f64>,
    /// Evaluations of the body that it took.
    pub evaluations: usize,
}

/// Where a body rested last, and how its rest moves with the pose: where the next search starts.
#[derive(Clone, Debug, Default)]
pub struct Rest {
    at: Six,
    inner: Vec<f64>,
    slope: Vec<Six>,
    /// Whether the search may end at [`Inner::step_on_the_way`].
    pub(crate) on_the_way: bool,
}

impl Rest {
    /// At inner coordinates known otherwise.
    pub fn known(q: &Six, inner: Vec<f64>) -> Rest {
        Rest { at: *q, slope: vec![Six::zeros(); inner.len()], inner, on_the_way: false }
    }

    /// The joint's coordinates there; none where nothing is known.
    pub fn at(&self) -> Option<Six> {
        (!self.inner.is_empty()).then_some(self.at)
    }

    /// Inner coordinates at another pose, by how the rest moves with it.
    pub(crate) fn extrapolated(&self, q: &Six) -> Vec<f64> {
        let moved = q - self.at;
        self.inner.iter().zip(&self.slope).map(|(u, s)| u + s.dot(&moved)).collect()
    }

    /// The inner coordinates there.
    pub(crate) fn inner(&self) -> &[f64] {
        &self.inner
    }

    /// Inner coordinates at a pose close by; at zero where nothing is known.
    fn guess(&self, q: &Six, size: usize, longest: f64) -> Vec<f64> {
        if self.inner.len() != size {
            return vec![0.0; size];
        }
        let moved = q - self.at;
        let step: Vec<f64> = self.slope.iter().map(|s| s.dot(&moved)).collect();
        let most = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        let share = if most > longest { longest / most } else { 1.0 };
        self.inner.iter().zip(step).map(|(u, s)| u + share * s).collect()
    }
}

/// The body at rest at a pose: led near it where it must be, then [`settle`]d.
pub fn condense(body: &dyn Inner, at: (&Six, &Pose), rest: &mut Rest) -> Condensed {
    body.approach(at.0, rest);
    settle(body, at, rest)
}

/// The body at rest at a pose: Newton's method with a line search from where it rested last.
pub(crate) fn settle(body: &dyn Inner, (q, pose): (&Six, &Pose), rest: &mut Rest) -> Condensed {
    let (size, longest) = (body.size().0, body.longest_step());
    let small = if rest.on_the_way { body.step_on_the_way() } else { SMALL_STEP };
    let mut inner = rest.guess(q, size, longest);
    let mut parts = body.at(pose, &inner);
    let mut evaluations = 1;
    let (step, factor) = loop {
        let factor = parts.stiffness.factored();
        let mut step: Vec<f64> = parts.inner.iter().map(|g| -g).collect();
        factor.solve(&mut step);
        let most = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if most < small {
            break (step, factor);
        }
        if evaluations >= MOST_STEPS {
            // no rest was found: what the body does where it stands
            break (vec![0.0; size], factor);
        }
        let mut share = (longest / most).min(1.0);
        let slope: f64 = step.iter().zip(&parts.inner).map(|(s, g)| s * g).sum();
        for halving in 0..=MOST_HALVINGS {
            let tried: Vec<f64> = inner.iter().zip(&step).map(|(u, s)| u + share * s).collect();
            let at = body.at(pose, &tried);
            evaluations += 1;
            // below rounding the energy does not tell
            let noise = 1e-13 * (1.0 + parts.energy.abs());
            if at.energy <= parts.energy + 1e-4 * share * slope + noise || halving == MOST_HALVINGS {
                (inner, parts) = (tried, at);
                break;
            }
            share *= 0.5;
        }
    };
    // what is left of the way to rest changes energy and gradient, to first order of the gradient
    let mut out = Condensed {
        energy: parts.energy + 0.5 * step.iter().zip(&parts.inner).map(|(s, g)| s * g).sum::<f64>(),
        gradient: parts.outer,
        hessian: parts.hessian,
        inner,
        evaluations,
    };
    let mut slope: Vec<Six> = parts.mixed.iter().map(|m| -m).collect();
    factor.solve_sixes(&mut slope);
    for ((mixed, s), along) in parts.mixed.iter().zip(&step).zip(&slope) {
        out.gradient += mixed * *s;
        out.hessian += mixed * along.transpose();
    }
    out.hessian = (out.hessian + out.hessian.transpose()) * 0.5;
    out.inner.iter_mut().zip(&step).for_each(|(u, s)| *u += s);
    *rest = Rest { at: *q, inner: out.inner.clone(), slope, ..*rest };
    out
}

/// A symmetric matrix whose entries lie within a band about the diagonal; the lower half is kept, row by row.
#[derive(Clone, Debug)]
pub struct Band {
    size: usize,
    band: usize,
    rows: Vec<f64>,
}

impl Band {
    /// All zero.
    pub fn zeros(size: usize, band: usize) -> Band {
        Band { size, band, rows: vec![0.0; size * (band + 1)] }
    }

    /// Place of entry (`i`, `j`), `j` not above `i`.
    fn place(&self, i: usize, j: usize) -> usize {
        i * (self.band + 1) + self.band + j - i
    }

    /// Adds to the entry (`i`, `j`) and so to its mirror; of each such pair only one may be given.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        let place = self.place(i.max(j), i.min(j));
        self.rows[place] += value;
    }

    /// Cholesky's factor; where the matrix is not positive definite its diagonal is raised until it is.
    fn factored(&self) -> Factor {
        let greatest = (0..self.size).map(|i| self.rows[self.place(i, i)].abs()).fold(0.0, f64::max);
        let mut shift = 0.0;
        for _ in 0..60 {
            if let Some(factor) = self.cholesky(shift) {
                return factor;
            }
            shift = if shift == 0.0 { FIRST_SHIFT * greatest.max(1e-9) } else { 4.0 * shift };
        }
        // numbers that are not finite: no step
        let mut rows = vec![0.0; self.rows.len()];
        (0..self.size).for_each(|i| rows[self.place(i, i)] = f64::INFINITY);
        Factor(Band { rows, ..*self })
    }

    fn cholesky(&self, shift: f64) -> Option<Factor> {
        let mut l = self.clone();
        for i in 0..self.size {
            let first = i.saturating_sub(self.band);
            for j in first..=i {
                let from = first.max(j.saturating_sub(self.band));
                let (row, other) = (self.place(i, from), self.place(j, from));
                let sum: f64 = (0..j - from).map(|k| l.rows[row + k] * l.rows[other + k]).sum();
                let value = l.rows[self.place(i, j)] - sum;
                l.rows[self.place(i, j)] = if i == j {
                    let pivot = value + shift;
                    if pivot.is_nan() || pivot <= 1e-12 {
                        return None;
                    }
                    pivot.sqrt()
                } else {
                    value / l.rows[self.place(j, j)]
                };
            }
        }
        Some(Factor(l))
    }
}

/// Cholesky's factor of a band.
struct Factor(Band);

impl Factor {
    /// Solves in place.
    fn solve(&self, x: &mut [f64]) {
        let l = &self.0;
        for i in 0..l.size {
            let first = i.saturating_sub(l.band);
            let sum: f64 = (first..i).map(|k| l.rows[l.place(i, k)] * x[k]).sum();
            x[i] = (x[i] - sum) / l.rows[l.place(i, i)];
        }
        for i in (0..l.size).rev() {
            let last = (i + l.band).min(l.size - 1);
            let sum: f64 = (i + 1..=last).map(|k| l.rows[l.place(k, i)] * x[k]).sum();
            x[i] = (x[i] - sum) / l.rows[l.place(i, i)];
        }
    }

    /// Solves six columns in place.
    fn solve_sixes(&self, x: &mut [Six]) {
        let l = &self.0;
        for i in 0..l.size {
            let first = i.saturating_sub(l.band);
            let sum: Six = (first..i).map(|k| x[k] * l.rows[l.place(i, k)]).sum();
            x[i] = (x[i] - sum) / l.rows[l.place(i, i)];
        }
        for i in (0..l.size).rev() {
            let last = (i + l.band).min(l.size - 1);
            let sum: Six = (i + 1..=last).map(|k| x[k] * l.rows[l.place(k, i)]).sum();
            x[i] = (x[i] - sum) / l.rows[l.place(i, i)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinate::{AP, SI};

    /// Two points in a row between the joint's AP and SI and the ground, on springs that harden.
    #[derive(Debug)]
    struct Chain;

    impl Inner for Chain {
        fn name(&self) -> &str {
            "chain"
        }

        fn outputs(&self, _: &Pose, _: &[f64]) -> Vec<(String, f64)> {
            Vec::new()
        }

        fn size(&self) -> (usize, usize) {
            (2, 1)
        }

        fn at(&self, pose: &Pose, u: &[f64]) -> Parts {
            let mut out = Parts::zeros(self.size());
            // the pose's shift of the femur's origin stands for AP and SI
            let (a, s) = (pose.femur.translation.vector.x, pose.femur.translation.vector.y);
            let hard = |x: f64| (x * x + x.powi(4), 2.0 * x + 4.0 * x.powi(3), 2.0 + 12.0 * x * x);
            let [(e0, f0, k0), (e1, f1, k1), (e2, f2, k2)] = [hard(u[0] - a), hard(u[1] - u[0]), hard(u[1] - s * s)];
            out.energy = e0 + e1 + e2;
            out.inner = vec![f0 - f1, f1 + f2];
            (out.outer[AP], out.outer[SI]) = (-f0, -2.0 * s * f2);
            (out.hessian[(4, 4)], out.hessian[(5, 5)]) = (k0, 4.0 * s * s * k2 - 2.0 * f2);
            (out.mixed[0][AP], out.mixed[1][SI]) = (-k0, -2.0 * s * k2);
            out.stiffness.add(0, 0, k0 + k1);
            out.stiffness.add(1, 1, k1 + k2);
            out.stiffness.add(1, 0, -k1);
            out
        }

        fn longest_step(&self) -> f64 {
            1.0
        }
    }

    fn at(a: f64, s: f64, rest: &mut Rest) -> Condensed {
        let femur = meshes::Isometry::translation(a, s, 0.0);
        let pose = Pose { femur, screws: Default::default() };
        let mut q = Six::zeros();
        (q[AP], q[SI]) = (a, s);
        condense(&Chain, (&q, &pose), rest)
    }

    #[test]
    fn what_is_condensed_has_its_own_derivatives_wherever_the_search_began() {
        let (a, s, h) = (1.7, 0.6, 1e-4);
        let cold = at(a, s, &mut Rest::default());
        let mut warm = Rest::default();
        at(1.5, 0.8, &mut warm);
        let warm = at(a, s, &mut warm);
        assert!((cold.energy - warm.energy).abs() < 1e-12 && (cold.gradient - warm.gradient).amax() < 1e-10);
        for (c, da, ds) in [(AP, h, 0.0), (SI, 0.0, h)] {
            let (up, down) = (at(a + da, s + ds, &mut Rest::default()), at(a - da, s - ds, &mut Rest::default()));
            assert!(((up.energy - down.energy) / (2.0 * h) - cold.gradient[c]).abs() < 1e-6);
            let slope = (up.gradient - down.gradient) / (2.0 * h);
            assert!((slope - cold.hessian.column(c.index())).amax() < 1e-5, "{slope} {}", cold.hessian);
        }
    }

    #[test]
    fn a_band_solves_and_is_raised_where_it_is_not_positive() {
        let mut band = Band::zeros(4, 2);
        for (i, j, v) in [(0, 0, 4.0), (1, 1, 5.0), (2, 2, 6.0), (3, 3, 3.0), (1, 0, 1.0), (2, 0, -1.0), (3, 1, 2.0)] {
            band.add(i, j, v);
        }
        let mut x = [1.0, 2.0, 3.0, 4.0];
        band.factored().solve(&mut x);
        let row =
            [4.0 * x[0] + x[1] - x[2], x[0] + 5.0 * x[1] + 2.0 * x[3], -x[0] + 6.0 * x[2], 2.0 * x[1] + 3.0 * x[3]];
        assert!(row.iter().zip([1.0, 2.0, 3.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-12));
        band.add(3, 3, -5.0);
        let mut x = [1.0; 4];
        band.factored().solve(&mut x);
        assert!(x.iter().all(|x| x.is_finite()));
    }
}
