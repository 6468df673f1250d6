//! Thickness of cartilage by region, in the parts that atlases of the knee tell apart.
//!
//! The femur has its trochlea, and of each condyle the central, weight-bearing part and the posterior one. A plateau has its central part, and around
//! it the anterior, posterior, internal and external ones (names of Wirth and Eckstein 2008). The limits are ours.

use crate::PerCartilage;
use meshes::frame::AnatomicalFrame;
use meshes::hex::HexMesh;
use meshes::{Point, Vector};
use std::collections::{BTreeMap, BTreeSet};

/// Where the trochlea begins: angle about the transepicondylar axis, from straight down forwards [deg]. Ours: there the cartilage of both condyles
/// meets in front of the notch, in two dissected knees.
const NOTCH_DEG: f64 = 35.0;
/// Where the posterior condyles begin, by the same angle [deg]. Ours: in these knees, 60 % of the way from the notch to the back of the condyles,
/// which is where Wirth and Eckstein part them.
const BACK_DEG: f64 = -25.0;
/// Share of a plateau's area that its central region has [-]; that of Wirth and Eckstein.
const CENTRAL_SHARE: f64 = 0.2;

/// The regions of a femur's cartilage, and of each plateau's.
const OF_FEMUR: [&str; 5] = ["trochlea", "medial_central", "medial_posterior", "lateral_central", "lateral_posterior"];
const OF_PLATEAU: [&str; 5] = ["central", "anterior", "posterior", "internal", "external"];

/// A region of a cartilage.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its cartilage and its own name: `femur_trochlea`, `tibia_medial_central`.
    pub name: String,
    /// Area of its bony face [mm2].
    pub area_mm2: f64,
    /// Mean thickness over this area [mm].
    pub mean_mm: f64,
    /// Standard deviation of the thickness over it [mm].
    pub sd_mm: f64,
}

/// The regions of the three cartilages, as meshed, in CT coordinates like both frames; a region without a column is left out.
///
/// Thickness is the length of the mesh's columns, from bone to joint. Rims that are too thin to be meshed are not in it.
pub fn regions(meshes: &PerCartilage<HexMesh>, femur: &AnatomicalFrame, tibia: &AnatomicalFrame) -> Vec<Region> {
    let mut found = of_femur(&columns(&meshes.femur), femur, &tibia.origin);
    for (name, mesh, outwards) in
        [("tibia_medial", &meshes.tibia_medial, tibia.medial), ("tibia_lateral", &meshes.tibia_lateral, -tibia.medial)]
    {
        found.extend(of_plateau(name, &columns(mesh), &outwards, &tibia.anterior));
    }
    found
}

/// A column of elements from bone to joint.
#[derive(Clone, Copy, Debug)]
struct Column {
    /// Middle of its foot, on the bone.
    foot: Point,
    /// Area of its foot [mm2].
    area: f64,
    /// Mean length of its four edges [mm].
    height: f64,
}

/// The columns of a mesh: those feet that no element has for its head, each with the last head above it.
fn columns(mesh: &HexMesh) -> Vec<Column> {
    let above: BTreeMap<[u32; 4], [u32; 4]> =
        mesh.elements.iter().map(|&[a, b, c, d, e, f, g, h]| ([a, b, c, d], [e, f, g, h])).collect();
    let heads: BTreeSet<[u32; 4]> = above.values().copied().collect();
    let place = |node: u32| mesh.nodes[node as usize];
    let column = |foot: &[u32; 4]| {
        let mut head = *foot;
        // no column is higher than the mesh has elements
        for _ in 0..mesh.elements.len() {
            let Some(next) = above.get(&head) else { break };
            head = *next;
        }
        let [a, b, c, d] = foot.map(place);
        let edges: f64 = (0..4).map(|k| (place(head[k]) - place(foot[k])).norm()).sum();
        Column {
            foot: Point::from((a.coords + b.coords + c.coords + d.coords) / 4.0),
            area: 0.5 * (c - a).cross(&(d - b)).norm(),
            height: edges / 4.0,
        }
    };
    above.keys().filter(|foot| !heads.contains(*foot)).map(column).collect()
}

/// The regions of a femur; `middle` is a point between its condyles.
fn of_femur(columns: &[Column], frame: &AnatomicalFrame, middle: &Point) -> Vec<Region> {
    let region = |c: &Column| {
        let d = c.foot - frame.origin;
        let angle = d.dot(&frame.anterior).atan2(-d.dot(&frame.superior)).to_degrees();
        let is_medial = (c.foot - middle).dot(&frame.medial) > 0.0;
        match (angle > NOTCH_DEG, angle > BACK_DEG, is_medial) {
            (true, ..) => 0,
            (false, true, true) => 1,
            (false, false, true) => 2,
            (false, true, false) => 3,
            (false, false, false) => 4,
        }
    };
    let of: Vec<usize> = columns.iter().map(region).collect();
    gathered("femur", &OF_FEMUR, columns, &of)
}

/// The regions of a plateau. Distances from its middle are counted in its own spread to each side, so that long and broad plateaus part alike: those
/// nearest to the middle are central, the others belong to the side on which they lie farthest.
fn of_plateau(name: &str, columns: &[Column], outwards: &Vector, forwards: &Vector) -> Vec<Region> {
    let area: f64 = columns.iter().map(|c| c.area).sum();
    let middle = Point::from(columns.iter().map(|c| c.foot.coords * c.area).sum::<Vector>() / area);
    let along = |way: &Vector| {
        let off: Vec<f64> = columns.iter().map(|c| (c.foot - middle).dot(way)).collect();
        let squares: f64 = off.iter().zip(columns).map(|(x, c)| x * x * c.area).sum();
        let spread = (squares / area).sqrt();
        off.into_iter().map(|x| x / spread).collect::<Vec<f64>>()
    };
    let places: Vec<(f64, f64)> = along(outwards).into_iter().zip(along(forwards)).collect();
    let side = |&(out, front): &(f64, f64)| match (front.abs() > out.abs(), front > 0.0, out > 0.0) {
        (true, true, _) => 1,
        (true, false, _) => 2,
        (false, _, false) => 3,
        (false, _, true) => 4,
    };
    let mut of: Vec<usize> = places.iter().map(side).collect();
    let mut nearest: Vec<usize> = (0..columns.len()).collect();
    nearest.sort_by(|a, b| places[*a].0.hypot(places[*a].1).total_cmp(&places[*b].0.hypot(places[*b].1)));
    let mut inner = 0.0;
    for n in nearest {
        inner += columns[n].area;
        if inner > CENTRAL_SHARE * area {
            break;
        }
        of[n] = 0;
    }
    gathered(name, &OF_PLATEAU, columns, &of)
}

/// The regions of a cartilage in their order; `of` tells that of each column.
fn gathered(cartilage: &str, names: &[&str], columns: &[Column], of: &[usize]) -> Vec<Region> {
    let region = |(k, name): (usize, &&str)| {
        let own: Vec<&Column> = columns.iter().zip(of).filter(|(_, r)| **r == k).map(|(c, _)| c).collect();
        let area: f64 = own.iter().map(|c| c.area).sum();
        let mean = own.iter().map(|c| c.area * c.height).sum::<f64>() / area;
        let variance = own.iter().map(|c| c.area * (c.height - mean).powi(2)).sum::<f64>() / area;
        let found =
            Region { name: format!("{cartilage}_{name}"), area_mm2: area, mean_mm: mean, sd_mm: variance.sqrt() };
        (area > 0.0).then_some(found)
    };
    names.iter().enumerate().filter_map(region).collect()
}

#[cfg(test)]
mod tests;
