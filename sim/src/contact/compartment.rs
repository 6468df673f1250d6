//! What the cartilage bears, by compartment of the tibia: force, area, centre, mean and peak pressure.

use super::layered::Pressed;
use super::{Contact, Nearby, Pair, Pass};
use crate::joint::Pose;
use meshes::frame::AnatomicalFrame;
use meshes::{Point, Vector};

/// A patch belongs to one compartment as a whole where no more than this share of its width lies across the tibia's sagittal plane [-]; ours: the
/// spines lie within a tenth of a plateau's width. A patch that spans both plateaus is parted at that plane.
const ACROSS: f64 = 0.2;

/// The compartments, in the order of [`Contact::compartments`].
pub const COMPARTMENTS: [&str; 2] = ["medial", "lateral"];

/// What one compartment bears. Directions are those of the tibial frame, in clinical signs: lateral, anterior, superior.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compartment {
    /// Force of the femur on the tibia [N].
    pub force: Vector,
    /// Area in contact, the mean of both passes [mm2].
    pub area_mm2: f64,
    /// Centre of pressure, from the tibial origin [mm]; zero where nothing is pressed.
    pub centre: Vector,
    /// Mean pressure over the area [MPa].
    pub mean_mpa: f64,
    /// Largest pressure at a node, the mean of both passes [MPa].
    pub peak_mpa: f64,
}

/// Pressure at a node of a cartilage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodePressure {
    /// Which pair of surfaces.
    pub pair: usize,
    /// Whether the node is the tibia's; otherwise the femur's.
    pub is_tibial: bool,
    /// CT coordinates at the pose [mm].
    pub place: Point,
    /// [MPa].
    pub pressure_mpa: f64,
}

/// Sums over the nodes of one compartment; `peak` by pass.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    force: Vector,
    total: f64,
    place: Vector,
    area: f64,
    peak: [f64; 2],
}

impl Contact {
    /// What the medial and the lateral compartment bear at a pose, in the frame of the tibia.
    pub fn compartments(&self, pose: &Pose, tibia: &AnatomicalFrame) -> [Compartment; 2] {
        let sides: Vec<Option<usize>> = self.pairs.iter().map(|p| side_of(p, tibia)).collect();
        let mut sums = [Sum::default(); 2];
        let mut near = Nearby::once();
        for (n, pass) in self.passes(pose).enumerate() {
            for node in self.pressed(&pass, near.pass(n)) {
                let place = placed(tibia, &(pass.ct_from_field * Point::from(node.place)));
                let sum = &mut sums[sides[pass.pair].unwrap_or(usize::from(place.x > 0.0))];
                let total = node.force.norm();
                // the passes' forces are on the femur
                sum.force -= turned(tibia, &(pass.ct_from_field.rotation * node.force)) * pass.side();
                sum.total += pass.share * total;
                sum.place += place * (pass.share * total);
                sum.area += pass.share * node.area;
                let peak = &mut sum.peak[usize::from(pass.tibial)];
                *peak = peak.max(total / node.area);
            }
        }
        let passes = if self.tibial_only { 1.0 } else { 2.0 };
        sums.map(|s| Compartment {
            force: s.force,
            area_mm2: s.area,
            centre: if s.total > 0.0 { s.place / s.total } else { Vector::zeros() },
            mean_mpa: if s.area > 0.0 { s.total / s.area } else { 0.0 },
            peak_mpa: (s.peak[0] + s.peak[1]) / passes,
        })
    }

    /// Pressure at every node in contact, of both cartilages.
    pub fn node_pressures(&self, pose: &Pose) -> Vec<NodePressure> {
        let mut near = Nearby::once();
        let of = |(n, pass): (usize, Pass)| {
            let nodes = self.pressed(&pass, near.pass(n));
            let node = |node: Pressed| NodePressure {
                pair: pass.pair,
                is_tibial: pass.tibial,
                place: pass.ct_from_field * Point::from(node.place),
                pressure_mpa: node.force.norm() / node.area,
            };
            nodes.into_iter().map(node).collect::<Vec<_>>()
        };
        self.passes(pose).enumerate().flat_map(of).collect()
    }

    /// Every node that presses, of both passes: its pair, its place at the pose (CT coordinates), its share of the load [N].
    pub(super) fn node_forces(&self, pose: &Pose) -> Vec<(usize, Point, f64)> {
        let mut near = Nearby::once();
        let of = |(n, pass): (usize, Pass)| {
            let node = |node: Pressed| {
                let at = pass.ct_from_field * Point::from(node.place);
                (pass.pair, at, pass.share * node.force.norm())
            };
            self.pressed(&pass, near.pass(n)).into_iter().map(node).collect::<Vec<_>>()
        };
        self.passes(pose).enumerate().flat_map(of).filter(|n| n.2 > 0.0).collect()
    }

    /// The nodes of a pass that press, by the law of the contact.
    fn pressed(&self, pass: &Pass, near: &mut super::Kept) -> Vec<Pressed> {
        if let Some(layer) = &self.layer {
            return self.press_layered(layer, pass, near).1;
        }
        let (start, mut out) = (self.law.start(), Vec::new());
        near.for_each((pass.nodes, pass.field), &pass.field_from_nodes, start, |p, area, _| {
            let Some(s) = pass.field.sample::<false>(p, -start) else { return };
            let (_, pressure, slope) = self.law.at(-s.distance);
            let weight = area * self.scale;
            let force = Vector::from(s.gradient) * (pressure * weight);
            out.push(Pressed { place: *p, area, deep: -s.distance, force, stiffness: slope * weight });
        });
        out
    }
}

impl Compartment {
    /// Its figures by the names of their columns in a results file; nothing pressed has no centre.
    pub fn outputs(&self, name: &str) -> Vec<(String, f64)> {
        let mut told = vec![
            ("force_n", self.force.norm()),
            ("area_mm2", self.area_mm2),
            ("mean_mpa", self.mean_mpa),
            ("peak_mpa", self.peak_mpa),
        ];
        if self.area_mm2 > 0.0 {
            told.extend([("centre_ml_mm", self.centre.x), ("centre_ap_mm", self.centre.y)]);
        }
        told.into_iter().map(|(what, value)| (format!("contact_{name}_{what}"), value)).collect()
    }
}

/// Lateral, anterior, superior components of a direction of the CT.
fn turned(tibia: &AnatomicalFrame, v: &Vector) -> Vector {
    Vector::new(-v.dot(&tibia.medial), v.dot(&tibia.anterior), v.dot(&tibia.superior))
}

/// Lateral, anterior, superior of the tibial origin [mm].
pub(super) fn placed(tibia: &AnatomicalFrame, p: &Point) -> Vector {
    turned(tibia, &(p - tibia.origin))
}

/// The compartment that a pair lies in as a whole, by its tibial patch.
pub(super) fn side_of(pair: &Pair, tibia: &AnatomicalFrame) -> Option<usize> {
    let lateral = pair.tibia.nodes.position.iter().map(|p| placed(tibia, &Point::from(*p)).x);
    let (low, high) = lateral.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let across = |inside: f64| inside.max(0.0) < ACROSS * (high - low);
    if across(high) {
        Some(0)
    } else if across(-low) {
        Some(1)
    } else {
        None
    }
}
