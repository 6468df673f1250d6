//! Contact pressure on the page's cartilages: at the corners of the thinned surfaces, the pressed ones alone.

use meshes::{Isometry, Point};
use sim::contact::Contact;
use sim::joint::Pose;
use std::collections::BTreeMap;

/// How far from a corner a node counts [mm]; and how near one must be for the corner to count as pressed.
const REACH_MM: f64 = 1.8;
const NEAR_MM: f64 = 1.1;

/// The cartilages as a page has them.
#[derive(Clone, Debug)]
pub struct Surfaces {
    named: Vec<(String, Vec<Point>)>,
}

/// Pressures [MPa] of corners, by surface.
#[derive(Clone, Debug, Default)]
pub struct Pressed {
    /// Corners by their numbers, and their pressures.
    pub by_surface: BTreeMap<String, Vec<(u16, f64)>>,
}

impl Surfaces {
    /// Of surfaces in contact: names and corners in CT [mm]. The femur's name ends in "femur", all others are the tibia's.
    pub fn new(named: Vec<(String, Vec<Point>)>) -> Surfaces {
        Surfaces { named }
    }

    /// The corners that are pressed at a pose.
    pub fn pressed(&self, contact: &Contact, pose: &Pose) -> Pressed {
        let nodes = contact.node_pressures(pose);
        let back = pose.femur.inverse();
        let of = |tibial: bool, place: Isometry| -> Vec<(Point, f64)> {
            nodes.iter().filter(|n| n.is_tibial == tibial).map(|n| (place * n.place, n.pressure_mpa)).collect()
        };
        let (femoral, tibial) = (of(false, back), of(true, Isometry::identity()));
        let mut by_surface = BTreeMap::new();
        for (key, corners) in &self.named {
            let all = spread(corners, if key.ends_with("femur") { &femoral } else { &tibial });
            if !all.is_empty() {
                by_surface.insert(key.clone(), all);
            }
        }
        Pressed { by_surface }
    }
}

/// Pressures of nodes at the corners beside them, nearer ones with more weight.
fn spread(corners: &[Point], nodes: &[(Point, f64)]) -> Vec<(u16, f64)> {
    let reach = |p: &Point, k: usize, sign: f64| sign * p[k] + REACH_MM;
    let far = |k: usize, sign: f64| nodes.iter().map(|(p, _)| reach(p, k, sign)).fold(f64::MIN, f64::max);
    let bounds = [0, 1, 2].map(|k| (-far(k, -1.0), far(k, 1.0)));
    let inside = |p: &Point| (0..3).all(|k| bounds[k].0 <= p[k] && p[k] <= bounds[k].1);
    let at = |p: &Point| {
        let (mut sum, mut weights, mut nearest) = (0.0, 0.0, f64::INFINITY);
        for (node, pressure) in nodes {
            let d = (node - p).norm();
            nearest = nearest.min(d);
            let weight = (1.0 - d / REACH_MM).max(0.0);
            (sum, weights) = (sum + weight * pressure, weights + weight);
        }
        (nearest <= NEAR_MM && weights > 0.0).then(|| sum / weights)
    };
    let numbered = corners.iter().enumerate().filter_map(|(n, p)| Some((u16::try_from(n).ok()?, p)));
    numbered.filter(|(_, p)| inside(p)).filter_map(|(n, p)| Some((n, at(p)?))).collect()
}

impl Pressed {
    /// The largest [MPa].
    pub fn most(&self) -> f64 {
        self.by_surface.values().flatten().map(|(_, p)| *p).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_beside_nodes_are_pressed_and_others_are_not() {
        let corners: Vec<Point> = (0..20).map(|n| Point::new(f64::from(n), 0.0, 0.0)).collect();
        let nodes = [(Point::new(5.0, 0.0, 0.0), 2.0), (Point::new(6.0, 0.0, 0.0), 4.0)];
        let found = spread(&corners, &nodes);
        let at: Vec<u16> = found.iter().map(|(n, _)| *n).collect();
        assert_eq!(at, [4, 5, 6, 7]);
        assert!(found[1].1 > 2.0 && found[1].1 < found[2].1 && found[2].1 < 4.0);
        assert!(spread(&corners, &[]).is_empty());
    }
}
