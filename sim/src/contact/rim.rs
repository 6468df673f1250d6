//! Where the contact lies on its own surfaces: how far inside the rim of the tibial and of the femoral cartilage, and how much of it at a rim.
//!
//! A rim is the edge of an open patch. Of a plateau's rim what faces the midline does not count: there stands the eminence. Of the femur's rim what
//! ends the condyles counts.

use super::Contact;
use super::compartment::{placed, side_of};
use crate::joint::Pose;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use std::collections::BTreeMap;

/// A piece of rim faces a way where its outward direction is within 45 deg of it: the cosine [-]; ours.
const FACES: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// An edge of a patch's boundary, CT coordinates.
#[derive(Clone, Debug)]
pub(crate) struct RimEdge {
    ends: [Vector; 2],
    /// Along the surface, away from it; unit length.
    outward: Vector,
}

/// How one compartment bears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// 0 medial, 1 lateral.
    pub compartment: usize,
    /// Sum of the nodes' forces, as sizes [N].
    pub load_n: f64,
    /// From the centre of pressure to the nearest rim that counts, on the tibia and on the femur [mm]; infinite where there is none.
    pub inside_mm: [f64; 2],
    /// Share of the load that lies within the asked breadth of such a rim, on the tibia and on the femur [-].
    pub at_rim: [f64; 2],
}

impl RimEdge {
    /// The boundary of a surface.
    pub(crate) fn of(mesh: &TriMesh) -> Vec<RimEdge> {
        let mut found: BTreeMap<(u32, u32), (usize, [u32; 3])> = BTreeMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                found.entry((a.min(b), a.max(b))).or_insert((0, [a, b, t[(k + 2) % 3]])).0 += 1;
            }
        }
        let edge = |[a, b, across]: [u32; 3]| {
            let [a, b, across] = [a, b, across].map(|v| mesh.vertices[v as usize].coords);
            let along = (b - a).try_normalize(0.0)?;
            let out = a - across;
            let outward = (out - along * out.dot(&along)).try_normalize(0.0)?;
            Some(RimEdge { ends: [a, b], outward })
        };
        found.into_values().filter(|(n, _)| *n == 1).filter_map(|(_, t)| edge(t)).collect()
    }

    /// Distance of a point [mm].
    fn distance(&self, p: &Vector) -> f64 {
        let [a, b] = self.ends;
        let along = b - a;
        let t = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (p - a - along * t).norm()
    }

    /// True of a piece of a plateau's rim over which a femur may leave it: any that does not face the midline.
    fn ends_plateau(&self, tibia: &AnatomicalFrame, compartment: usize) -> bool {
        let to_midline = if compartment == 0 { -tibia.medial } else { tibia.medial };
        self.outward.dot(&to_midline) < FACES
    }

    /// True of a piece of the femur's rim that ends the condyles: those at the upper ends of their course. Sides and notch are none.
    fn ends_condyle(&self, femur: &AnatomicalFrame) -> bool {
        self.outward.dot(&femur.superior) > FACES
    }
}

/// Distance to the nearest edge that counts [mm].
fn to_rim(edges: &[&RimEdge], p: &Vector) -> f64 {
    edges.iter().map(|e| e.distance(p)).fold(f64::INFINITY, f64::min)
}

impl Contact {
    /// How each compartment that bears load bears it, by the frames of femur and tibia in the CT pose. A node within `breadth` [mm] of a rim bears
    /// at the rim.
    pub fn bearings(&self, pose: &Pose, frames: [&AnatomicalFrame; 2], breadth: f64) -> Vec<Bearing> {
        let [femur, tibia] = frames;
        let (forces, back) = (self.node_forces(pose), pose.femur.inverse());
        let mut out: Vec<Bearing> = Vec::new();
        for (n, pair) in self.pairs.iter().enumerate() {
            let whole = side_of(pair, tibia);
            for compartment in 0..2 {
                let own = |at: &Point| whole.unwrap_or(usize::from(placed(tibia, at).x > 0.0)) == compartment;
                let of = |moved: &dyn Fn(&Point) -> Point| -> Vec<(Point, f64)> {
                    forces.iter().filter(|(p, at, _)| *p == n && own(at)).map(|(_, at, f)| (moved(at), *f)).collect()
                };
                let on_tibia = of(&|p: &Point| *p);
                if on_tibia.is_empty() {
                    continue;
                }
                let plateau = pair.tibia.rim.iter().filter(|e| e.ends_plateau(tibia, compartment)).collect::<Vec<_>>();
                let condyle = pair.femur.rim.iter().filter(|e| e.ends_condyle(femur)).collect::<Vec<_>>();
                let (inside, at_rim) = against(&plateau, &on_tibia, breadth);
                let (inside_femur, at_rim_femur) = against(&condyle, &of(&|p: &Point| back * p), breadth);
                let load_n = on_tibia.iter().map(|n| n.1).sum();
                let (inside_mm, at_rim) = ([inside, inside_femur], [at_rim, at_rim_femur]);
                out.push(Bearing { compartment, load_n, inside_mm, at_rim });
            }
        }
        out
    }
}

/// Of loaded places: how far their centre lies from a rim [mm], and the share of the load within `breadth` of it.
fn against(rim: &[&RimEdge], places: &[(Point, f64)], breadth: f64) -> (f64, f64) {
    let load: f64 = places.iter().map(|p| p.1).sum();
    let centre = places.iter().map(|(p, f)| p.coords * *f).sum::<Vector>() / load;
    let inside = to_rim(rim, &centre);
    let reach = places.iter().map(|(p, _)| (p.coords - centre).norm()).fold(0.0, f64::max);
    if inside > reach + breadth {
        return (inside, 0.0);
    }
    let near = places.iter().filter(|(p, _)| to_rim(rim, &p.coords) < breadth);
    (inside, near.map(|p| p.1).sum::<f64>() / load)
}
