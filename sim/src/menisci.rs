//! Menisci as rings of rigid wedges: contact with both cartilages, hoop fibres, horns, a periphery held to the tibia.
//!
//! Each wedge shifts in space; the shifts are the inner coordinates of a [`crate::condensed`] body. Theory and sources: docs/theory/menisci.md.

mod links;
mod shape;

use crate::condensed::{Inner, Parts};
use crate::contact::field::Field;
use crate::contact::{Contact, ContactResponse, Side, Sums, accumulate, local_screws, symmetric};
use crate::coordinate::{ALL, Six};
use crate::error::SimError;
use crate::joint::Pose;
use crate::spec::{MeniscusSpec, ModelSpec};
use links::Link;
use meshes::{Isometry, Vector};
use nalgebra::Matrix3;
use std::sync::Arc;

/// Furthest a wedge goes in a Newton step [mm]: less than a meniscus is high.
const LONGEST_STEP: f64 = 1.0;

/// A point of a wedge's face.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// CT coordinates where the wedge is not shifted [mm].
    place: [f64; 3],
    /// Area times foundation stiffness [N/mm].
    stiffness: f64,
    /// Area [mm2].
    area: f64,
}

/// A rigid wedge.
#[derive(Clone, Debug)]
struct Wedge {
    upper: Vec<Node>,
    lower: Vec<Node>,
    /// Centre and radius of both faces [mm].
    centre: Vector,
    radius: f64,
    /// Spring that holds it to the tibia [N/mm].
    periphery: f64,
}

/// A meniscus.
#[derive(Clone, Debug)]
pub struct Meniscus {
    name: String,
    wedges: Vec<Wedge>,
    /// Between neighbouring wedges, and of the horns.
    links: Vec<Link>,
    femur: Arc<Side>,
    tibia: Arc<Side>,
    /// The tibia's superior and posterior axis.
    axes: [Vector; 2],
}

/// The menisci of a specification, between the surfaces of its contact.
///
/// Errors: a pair that is not among the contact's, sections without order, numbers out of range.
pub(crate) fn compile(spec: &ModelSpec, contact: &Contact) -> Result<Vec<Meniscus>, SimError> {
    spec.menisci.iter().map(|m| meniscus(m, spec, contact)).collect()
}

fn meniscus(m: &MeniscusSpec, spec: &ModelSpec, contact: &Contact) -> Result<Meniscus, SimError> {
    shape::check(m)?;
    let pair = spec.contact.pairs.iter().position(|p| p.femur == m.femur && p.tibia == m.tibia);
    let pair = pair.ok_or_else(|| {
        SimError::Spec(format!("menisci {}: {} and {} are not a pair of contact.pairs", m.name, m.femur, m.tibia))
    })?;
    let (wedges, tibia) = (shape::wedges(m), spec.frames.tabulated().tibia);
    Ok(Meniscus {
        name: m.name.clone(),
        links: links::links(m, &shape::parts(m)),
        wedges,
        femur: contact.pairs[pair].femur.clone(),
        tibia: contact.pairs[pair].tibia.clone(),
        axes: [tibia.superior, -tibia.anterior],
    })
}

/// A field and where it stands.
struct Placed<'a> {
    field: &'a Field,
    ct_from_field: Isometry,
    /// Rotation and shift of the inverse.
    turn: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Placed<'_> {
    fn new(field: &Field, moved: Isometry) -> Placed<'_> {
        let ct_from_field = moved * field.local_from_ct.inverse();
        let inverse = ct_from_field.inverse();
        let turn = inverse.rotation.to_rotation_matrix();
        let turn = std::array::from_fn(|i| std::array::from_fn(|j| turn[(i, j)]));
        Placed { field, ct_from_field, turn, shift: inverse.translation.vector.into() }
    }

    /// A shifted point in the field's frame.
    #[inline]
    fn place(&self, p: &[f64; 3], shift: &Vector) -> [f64; 3] {
        let [x, y, z] = [p[0] + shift.x, p[1] + shift.y, p[2] + shift.z];
        let row = |i: usize| self.turn[i][0] * x + self.turn[i][1] * y + self.turn[i][2] * z + self.shift[i];
        [row(0), row(1), row(2)]
    }

    /// Sums over the nodes of a face that overclose, in the field's frame.
    fn sum(&self, wedge: &Wedge, nodes: &[Node], shift: &Vector) -> Option<Sums> {
        if self.field.apart(&self.place(&wedge.centre.into(), shift), 0.0) > wedge.radius {
            return None;
        }
        let (mut sums, mut stiffness) = (Sums::default(), [0.0; 21]);
        for node in nodes {
            let p = self.place(&node.place, shift);
            // the bound is quicker than the spline
            if self.field.clearance(&p, 0.0) > 0.0 {
                continue;
            }
            if let Some(s) = self.field.sample::<true>(&p, 0.0) {
                let (d, k) = (-s.distance, node.stiffness);
                sums.add(&mut stiffness, (&p, node.area), &s, [0.5 * k * d * d, k * d, k]);
            }
        }
        sums.stiffness = symmetric(&stiffness);
        (sums.area > 0.0).then_some(sums)
    }
}

impl Meniscus {
    /// Force on the femur, at a pose and shifts of the wedges [N].
    fn load(&self, pose: &Pose, inner: &[f64]) -> Vector {
        let femur = Placed::new(&self.femur.field, pose.femur);
        let sums = self.wedges.iter().enumerate().filter_map(|(n, w)| femur.sum(w, &w.upper, &shift(inner, n)));
        sums.map(|s| -(femur.ct_from_field.rotation * s.force)).sum()
    }

    /// Greatest tension between wedges and at the horns [N].
    fn hoop(&self, inner: &[f64]) -> f64 {
        self.links.iter().map(|l| l.tension(inner)).fold(0.0, f64::max)
    }

    /// Mean shift of its wedges [mm].
    fn shift(&self, inner: &[f64]) -> Vector {
        (0..self.wedges.len()).map(|n| shift(inner, n)).sum::<Vector>() / self.wedges.len() as f64
    }
}

/// The shift of a wedge.
fn shift(inner: &[f64], wedge: usize) -> Vector {
    Vector::new(inner[3 * wedge], inner[3 * wedge + 1], inner[3 * wedge + 2])
}

impl Inner for Meniscus {
    fn name(&self) -> &str {
        &self.name
    }

    fn size(&self) -> (usize, usize) {
        (3 * self.wedges.len(), 5)
    }

    fn longest_step(&self) -> f64 {
        LONGEST_STEP
    }

    fn at(&self, pose: &Pose, inner: &[f64]) -> Parts {
        let mut out = Parts::zeros(self.size());
        let femur = Placed::new(&self.femur.field, pose.femur);
        let tibia = Placed::new(&self.tibia.field, Isometry::identity());
        let screws = local_screws(pose, &femur.ct_from_field);
        let turn = femur.ct_from_field.rotation.to_rotation_matrix();
        let mut whole = Sums::default();
        for (n, wedge) in self.wedges.iter().enumerate() {
            let u = shift(inner, n);
            out.energy += 0.5 * wedge.periphery * u.norm_squared();
            put(&mut out, n, &(u * wedge.periphery), &(Matrix3::identity() * wedge.periphery));
            if let Some(sums) = tibia.sum(wedge, &wedge.lower, &u) {
                out.energy += sums.energy;
                add(&mut out, n, &tibia.ct_from_field, &sums);
            }
            if let Some(sums) = femur.sum(wedge, &wedge.upper, &u) {
                let push = add(&mut out, n, &femur.ct_from_field, &sums);
                for ((c, screw), moved) in ALL.into_iter().zip(&screws).zip(&pose.screws) {
                    // the femur's motion turns the force with it, and moves the wedge the other way in its frame
                    let twist = Six::from_iterator(screw.linear.iter().chain(screw.angular.iter()).copied());
                    let slope = turn * (sums.stiffness * twist).fixed_rows::<3>(0).into_owned();
                    let mixed = moved.angular.cross(&push) - slope;
                    (0..3).for_each(|a| out.mixed[3 * n + a][c] += mixed[a]);
                }
                whole.join(&sums);
            }
        }
        let mut on_femur = ContactResponse::default();
        accumulate(&mut on_femur, &whole, &screws, (true, 1.0));
        (out.outer, out.hessian) = (on_femur.gradient, on_femur.hessian);
        out.energy += on_femur.energy;
        self.links.iter().for_each(|l| l.add(inner, &mut out));
        out
    }

    fn bears(&self, pose: &Pose, inner: &[f64]) -> bool {
        self.load(pose, inner).norm() > 0.0
    }

    fn outputs(&self, pose: &Pose, inner: &[f64]) -> Vec<(String, f64)> {
        let told = [
            ("load_n", self.load(pose, inner).dot(&self.axes[0])),
            ("hoop_n", self.hoop(inner)),
            ("posterior_mm", self.shift(inner).dot(&self.axes[1])),
        ];
        told.map(|(what, value)| (format!("{}_{what}", self.name), value)).into()
    }
}

/// Adds a face's sums to a wedge; its gradient by the wedge's shift [N].
fn add(out: &mut Parts, wedge: usize, ct_from_field: &Isometry, sums: &Sums) -> Vector {
    let turn = ct_from_field.rotation.to_rotation_matrix();
    let gradient = -(turn * sums.force);
    let stiffness = turn * sums.stiffness.fixed_view::<3, 3>(0, 0).into_owned() * turn.transpose();
    put(out, wedge, &gradient, &stiffness);
    gradient
}

/// Adds a gradient and a stiffness of one wedge.
fn put(out: &mut Parts, wedge: usize, gradient: &Vector, stiffness: &Matrix3<f64>) {
    for a in 0..3 {
        out.inner[3 * wedge + a] += gradient[a];
        (0..=a).for_each(|b| out.stiffness.add(3 * wedge + a, 3 * wedge + b, stiffness[(a, b)]));
    }
}

/// A meniscus as hexahedra that fill its sections, from horn to horn; the first edge of each runs along the fibres. Its faces on the tibia stand as bony,
/// those on the femur as articular.
pub fn hexahedra(m: &MeniscusSpec) -> meshes::hex::HexMesh {
    shape::hexahedra(m)
}
