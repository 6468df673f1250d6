//! Contact by thickness: what a pass over the nodes adds up, and how much of it a patch of its size bears.
//!
//! A thin bonded layer bears as if it could not widen. Near a patch's edge it can, so a small patch bears less [hayes1972]: of the energy U of thin layer
//! theory a pass keeps U y / (1 + y), y the patch's radius over `edge_spread` thicknesses. The radius follows from V = sum d2/h2 and
//! W = sum d3/h2 over the area, so that a node that begins to touch changes no force abruptly.

use super::layer::{Layer, Strained};
use super::near::Kept;
use super::{Contact, Pass, Sums, add_stiffness, field::Sample, symmetric, thickness::above_bone};
use crate::error::SimError;
use crate::spec::ContactSpec;
use meshes::Vector;
use meshes::surface::TriMesh;
use nalgebra::{Matrix6, Vector6};
use std::collections::BTreeMap;

/// Every pair must have a side that gives way.
pub(super) fn check(spec: &ContactSpec) -> Result<(), SimError> {
    let Some(layer) = &spec.layer else { return Ok(()) };
    let known = |name: &String| layer.bony_faces.contains_key(name);
    if let Some(p) = spec.pairs.iter().find(|p| !known(&p.femur) && !known(&p.tibia)) {
        return Err(SimError::Spec(format!(
            "contact.layer.bony_faces names neither {} nor {}: nothing of this pair gives way; name the bony face of one of them",
            p.femur, p.tibia
        )));
    }
    Ok(())
}

/// Thickness at the vertices of a mesh of the contact; empty where it does not give way.
pub(super) fn thickness(
    name: &str,
    mesh: &TriMesh,
    spec: &ContactSpec,
    surfaces: &BTreeMap<String, TriMesh>,
) -> Result<Vec<f64>, SimError> {
    let Some(layer) = &spec.layer else { return Ok(Vec::new()) };
    let Some(bony_name) = layer.bony_faces.get(name) else { return Ok(Vec::new()) };
    let bony = surfaces
        .get(bony_name)
        .ok_or_else(|| SimError::Spec(format!("contact.layer.bony_faces: no surface {bony_name}")))?;
    above_bone((name, mesh), (bony_name, bony), layer.least_thickness_mm)
}

/// A node in contact.
struct Touch {
    /// Field's frame [mm].
    place: [f64; 3],
    area: f64,
    overclosure: f64,
    /// Of both layers [mm].
    thickness: f64,
    distance: Sample,
    below: Sample,
    strained: Strained,
}

/// Sums over a pass: energy of thin layers, and the two measures of the patch.
#[derive(Clone, Copy, Debug, Default)]
struct Totals {
    u: f64,
    v: f64,
    w: f64,
}

/// The patch's energy and its derivatives by the totals.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    energy: f64,
    /// By u, v, w.
    first: [f64; 3],
    /// By u, v, w twice.
    second: [[f64; 3]; 3],
}

impl Share {
    fn new(t: &Totals, edge_spread: f64) -> Share {
        // patches of no size have no energy either
        if edge_spread == 0.0 || t.w < f64::MIN_POSITIVE.sqrt() {
            return Share { energy: t.u, first: [1.0, 0.0, 0.0], second: [[0.0; 3]; 3] };
        }
        let y = (t.v / std::f64::consts::PI).sqrt() * (t.v / t.w) / edge_spread;
        let (g, g1, g2) = (y / (1.0 + y), (1.0 + y).powi(-2), -2.0 * (1.0 + y).powi(-3));
        let (yv, yw) = (1.5 * y / t.v, -y / t.w);
        let (vv, vw, ww) = (0.75 * y / (t.v * t.v), -1.5 * y / (t.v * t.w), 2.0 * y / (t.w * t.w));
        let pair = |a: f64, b: f64, ab: f64| t.u * (g2 * a * b + g1 * ab);
        Share {
            energy: t.u * g,
            first: [g, t.u * g1 * yv, t.u * g1 * yw],
            second: [
                [0.0, g1 * yv, g1 * yw],
                [g1 * yv, pair(yv, yv, vv), pair(yv, yw, vw)],
                [g1 * yw, pair(yv, yw, vw), pair(yw, yw, ww)],
            ],
        }
    }
}

impl Share {
    /// Under pressures multiplied by `scale`.
    fn times(mut self, scale: f64) -> Share {
        self.energy *= scale;
        self.first.iter_mut().for_each(|x| *x *= scale);
        self.second.iter_mut().flatten().for_each(|x| *x *= scale);
        self
    }
}

impl Touch {
    /// Derivatives by overclosure and thickness of the three terms that are summed, without the area: d, h, dd, dh, hh.
    #[inline]
    fn terms(&self) -> [[f64; 5]; 3] {
        let (s, by) = (&self.strained, 1.0 / self.thickness);
        let x = self.overclosure * by;
        let (square, i) = (x * x, by * by);
        [
            [s.pressure, s.by_thickness, s.slope, s.mixed, s.curve],
            [2.0 * x * by, -2.0 * square * by, 2.0 * i, -4.0 * x * i, 6.0 * square * i],
            [3.0 * square, -2.0 * square * x, 6.0 * x * by, -6.0 * square * by, 6.0 * square * x * by],
        ]
    }

    /// The terms weighed by the patch's derivatives.
    #[inline]
    fn weighed(&self, terms: &[[f64; 5]; 3], first: &[f64; 3]) -> [f64; 5] {
        std::array::from_fn(|k| (0..3).map(|t| first[t] * terms[t][k]).sum())
    }

    /// Gradient in space of a term of these derivatives.
    #[inline]
    fn gradient(&self, term: &[f64; 5]) -> [f64; 3] {
        std::array::from_fn(|a| term[1] * self.below.gradient[a] - term[0] * self.distance.gradient[a])
    }

    /// Its second derivatives, xx, xy, xz, yy, yz, zz.
    #[inline]
    fn curvature(&self, term: &[f64; 5]) -> [f64; 6] {
        const PLACES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let (g, n) = (&self.distance.gradient, &self.below.gradient);
        let [by_d, by_h, dd, dh, hh] = *term;
        std::array::from_fn(|k| {
            let (a, b) = PLACES[k];
            dd * g[a] * g[b] - dh * (g[a] * n[b] + n[a] * g[b]) + hh * n[a] * n[b] - by_d * self.distance.hessian[k]
                + by_h * self.below.hessian[k]
        })
    }
}

/// What a node in contact presses, in the field's frame.
pub(super) struct Pressed {
    pub(super) place: [f64; 3],
    pub(super) area: f64,
    /// Overclosure of the surfaces [mm].
    pub(super) deep: f64,
    /// Along the field's gradient [N].
    pub(super) force: Vector,
    /// [N/mm].
    pub(super) stiffness: f64,
}

impl Contact {
    /// The nodes of a pass that overclose, and their sums.
    fn touching<const CURVED: bool>(&self, layer: &Layer, pass: &Pass, near: &mut Kept) -> (Vec<Touch>, Totals) {
        let (mut touches, mut totals) = (Vec::with_capacity(near.touching), Totals::default());
        let start = self.law.start();
        // cartilage whose contact begins before the surfaces meet is thicker by as much
        let more = (-start).max(0.0);
        near.for_each((pass.nodes, pass.field), &pass.field_from_nodes, start, |p, area, own| {
            let Some((distance, below)) = pass.field.sample_layered::<CURVED>(p, -start) else { return };
            let (overclosure, thickness) = (-distance.distance - start, own + below.distance + more);
            if overclosure <= 0.0 {
                return;
            }
            let strained = layer.at(overclosure, thickness);
            totals.u += strained.energy * area;
            let squares = (overclosure / thickness).powi(2) * area;
            totals.v += squares;
            totals.w += squares * overclosure;
            touches.push(Touch { place: *p, area, overclosure, thickness, distance, below, strained });
        });
        near.touching = touches.len();
        (touches, totals)
    }

    /// Sums of a pass.
    #[expect(clippy::needless_range_loop, reason = "indices of matrices")]
    pub(super) fn sum_layered(&self, layer: &Layer, pass: &Pass, near: &mut Kept) -> Sums {
        let (touches, totals) = self.touching::<true>(layer, pass, near);
        let share = Share::new(&totals, layer.edge_spread).times(self.scale);
        let mut sums = Sums { energy: share.energy, ..Sums::default() };
        let mut stiffness = [0.0; 21];
        // how u, v and w change with the field's motion
        let mut change = [Vector6::zeros(); 3];
        for t in &touches {
            let terms = t.terms();
            let term = t.weighed(&terms, &share.first);
            let (gradient, p) = (t.gradient(&term), &t.place);
            sums.area += t.area;
            sums.deepest = sums.deepest.max(-t.distance.distance);
            for a in 0..3 {
                sums.force[a] -= gradient[a] * t.area;
                for b in 0..3 {
                    sums.virial[(b, a)] -= p[b] * gradient[a] * t.area;
                }
            }
            add_stiffness(&mut stiffness, &t.curvature(&term).map(|x| x * t.area), p);
            if layer.edge_spread > 0.0 {
                let (deeper, thicker) =
                    (wrench(&t.distance.gradient, p, -t.area), wrench(&t.below.gradient, p, t.area));
                for (sum, term) in change.iter_mut().zip(&terms) {
                    *sum += deeper * term[0] + thicker * term[1];
                }
            }
        }
        sums.stiffness = symmetric(&stiffness) + outer(&change, &share.second);
        sums
    }

    /// Energy of a pass, and what each of its nodes presses.
    pub(super) fn press_layered(&self, layer: &Layer, pass: &Pass, near: &mut Kept) -> (f64, Vec<Pressed>) {
        let (touches, totals) = self.touching::<false>(layer, pass, near);
        let share = Share::new(&totals, layer.edge_spread).times(self.scale);
        let of = |t: &Touch| Pressed {
            place: t.place,
            area: t.area,
            deep: -t.distance.distance,
            force: Vector::from(t.gradient(&t.weighed(&t.terms(), &share.first))) * -t.area,
            // the slope of the thin layer is no less than the patch's
            stiffness: t.strained.slope * t.area * self.scale,
        };
        (share.energy, touches.iter().map(of).collect())
    }
}

/// `by` times a direction and its moment at a place.
#[inline]
fn wrench(g: &[f64; 3], p: &[f64; 3], by: f64) -> Vector6<f64> {
    let moment = [p[1] * g[2] - p[2] * g[1], p[2] * g[0] - p[0] * g[2], p[0] * g[1] - p[1] * g[0]];
    Vector6::new(g[0], g[1], g[2], moment[0], moment[1], moment[2]) * by
}

/// The part of the stiffness that comes from the patch as a whole.
fn outer(change: &[Vector6<f64>; 3], second: &[[f64; 3]; 3]) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    for a in 0..3 {
        for b in 0..3 {
            out += change[a] * change[b].transpose() * second[a][b];
        }
    }
    out
}
