//! Where the feet of columns go once their heads stand apart: on the bone, unless that costs too much.

use super::{Body, Knee, OverclosureOptions};
use crate::PerCartilage;
use crate::hexmesh::HexCartilage;
use meshes::hex::HexMesh;
use meshes::{Point, Vector};

/// Lifts tried, and halvings of the last interval.
const LIFTS: usize = 8;
const HALVINGS: usize = 4;

/// The smallest lift of bony faces [mm], from 0 to `max_bony_lift_mm`, that keeps volumes and shapes within the options' bounds;
/// and whether it does.
///
/// Overlap that both bones stay under has nowhere to go: it must be taken from the cartilage's volume. So where overlaps are
/// wide as well as deep the bony faces cannot stay, and give way by as little as the bounds ask.
pub(super) fn least_lift(knee: &Knee, hexes: &HexCartilage, options: &OverclosureOptions) -> (f64, bool) {
    let before = least_shapes(&hexes.meshes);
    let good = |lift: f64| {
        let meshes = placed(knee, hexes, lift, options);
        let falls = before.iter().zip(least_shapes(&meshes)).all(|(b, a)| b - a <= options.scaled_jacobian_fall_max);
        falls && volume_change(&meshes, hexes) <= options.volume_change_max
    };
    if good(0.0) {
        return (0.0, true);
    }
    // Volumes change less the more is lifted, shapes need not: of several lifts the least that is good.
    let tried = (1..=LIFTS).map(|k| options.max_bony_lift_mm * k as f64 / LIFTS as f64).find(|lift| good(*lift));
    let Some(mut high) = tried else { return (options.max_bony_lift_mm, false) };
    let mut low = high - options.max_bony_lift_mm / LIFTS as f64;
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if good(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (high, true)
}

/// The meshes with their columns between feet and heads, feet lifted by `lift` [mm] at most where a column keeps its least height.
pub(super) fn placed(
    knee: &Knee,
    hexes: &HexCartilage,
    lift: f64,
    options: &OverclosureOptions,
) -> PerCartilage<HexMesh> {
    let moved = |mesh: &HexMesh, body: &Body| HexMesh { nodes: nodes(body, lift, options.height_kept), ..mesh.clone() };
    PerCartilage {
        femur: moved(&hexes.meshes.femur, &knee.femur),
        tibia_medial: moved(&hexes.meshes.tibia_medial, &knee.tibiae[0]),
        tibia_lateral: moved(&hexes.meshes.tibia_lateral, &knee.tibiae[1]),
    }
}

fn nodes(body: &Body, lift: f64, kept: f64) -> Vec<Point> {
    let mut nodes = body.start.clone();
    for (column, head) in body.columns.iter().zip(&body.moved).filter(|(_, head)| **head != Vector::zeros()) {
        let foot = head * foot_share(&upright(body, column), head, lift, kept);
        let top = (column.len() - 1).max(1) as f64;
        for (k, &n) in column.iter().enumerate() {
            nodes[n as usize] += foot + (head - foot) * (k as f64 / top);
        }
    }
    nodes
}

/// From a column's foot to its head at the start.
fn upright(body: &Body, column: &[u32]) -> Vector {
    let at = |n: Option<&u32>| n.map_or_else(Point::origin, |&n| body.start[n as usize]);
    at(column.last()) - at(column.first())
}

/// Share of its head's move that a foot makes.
fn foot_share(upright: &Vector, head: &Vector, lift: f64, kept: f64) -> f64 {
    let by_lift = (lift / head.norm()).min(1.0);
    let height = upright.norm();
    let down = -head.dot(upright) / height;
    let by_height = if down > (1.0 - kept) * height { 1.0 - (1.0 - kept) * height / down } else { 0.0 };
    by_lift.max(by_height)
}

/// Mean change of an element's volume over all cartilages [-].
pub(super) fn volume_change(meshes: &PerCartilage<HexMesh>, hexes: &HexCartilage) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for ((_, mesh), (_, old)) in meshes.named().into_iter().zip(hexes.meshes.named()) {
        let change = |e: usize| (mesh.element_volume(e) / old.element_volume(e) - 1.0).abs();
        sum += (0..mesh.elements.len()).map(change).sum::<f64>();
        count += mesh.elements.len();
    }
    sum / f64::from(u32::try_from(count).unwrap_or(u32::MAX).max(1))
}

/// How far the nodes of `which` have moved, over all cartilages [mm].
pub(super) fn moves(
    meshes: &PerCartilage<HexMesh>,
    hexes: &HexCartilage,
    which: impl Fn(&HexMesh) -> &Vec<u32>,
) -> Vec<f64> {
    let pairs = meshes.named().into_iter().zip(hexes.meshes.named());
    let moved = |m: &HexMesh, old: &HexMesh, n: u32| (m.nodes[n as usize] - old.nodes[n as usize]).norm();
    pairs.flat_map(|((_, m), (_, old))| which(m).iter().map(|&n| moved(m, old, n)).collect::<Vec<_>>()).collect()
}

/// Largest share of its height that a column has lost [-].
pub(super) fn largest_thinning(knee: &Knee, meshes: &PerCartilage<HexMesh>) -> f64 {
    let bodies = [&knee.femur, &knee.tibiae[0], &knee.tibiae[1]];
    let lost = |body: &Body, mesh: &HexMesh| {
        let share = |column: &Vec<u32>| match (column.first(), column.last()) {
            (Some(&foot), Some(&head)) => {
                let now = mesh.nodes[head as usize] - mesh.nodes[foot as usize];
                1.0 - now.norm() / upright(body, column).norm()
            }
            _ => 0.0,
        };
        body.columns.iter().map(share).fold(0.0, f64::max)
    };
    bodies.into_iter().zip(meshes.named()).map(|(body, (_, mesh))| lost(body, mesh)).fold(0.0, f64::max)
}

fn least_shapes(meshes: &PerCartilage<HexMesh>) -> [f64; 3] {
    meshes.named().map(|(_, m)| (0..m.elements.len()).map(|e| m.scaled_jacobian(e)).fold(f64::INFINITY, f64::min))
}
