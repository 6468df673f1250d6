//! The sections of a meniscus parted into wedges: the points of their faces, their place and their cross-section.

use super::{Node, Wedge};
use crate::error::SimError;
use crate::spec::{MeniscusSpec, SectionSpec};
use meshes::hex::HexMesh;
use meshes::{Point, Vector};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// No meniscus is higher or wider than this [mm].
const MOST_MM: f64 = 40.0;
/// Most sections, points of a section and wedges.
const MOST_SECTIONS: usize = 1000;

/// A wedge as the links see it.
pub(super) struct Part {
    /// Its centre [mm].
    pub(super) centre: Vector,
    /// Its cross-section [mm2].
    pub(super) area: f64,
}

/// Refuses what is no meniscus.
pub(super) fn check(m: &MeniscusSpec) -> Result<(), SimError> {
    let fault = |what: String| Err(SimError::Spec(format!("menisci {}: {what}", m.name)));
    let points = m.sections.first().map_or(0, |s| s.lower.len());
    if !(2..=MOST_SECTIONS).contains(&m.wedges) || !(m.wedges + 1..=MOST_SECTIONS).contains(&m.sections.len()) {
        return fault(format!(
            "{} wedges of {} sections, expected at least 2 wedges and a section more than wedges",
            m.wedges,
            m.sections.len()
        ));
    }
    for (n, s) in m.sections.iter().enumerate() {
        if s.lower.len() != points || s.upper.len() != points || !(2..=MOST_SECTIONS).contains(&points) {
            return fault(format!(
                "section {n} has {} and {} points, expected as many on both faces as section 0, at least 2",
                s.lower.len(),
                s.upper.len()
            ));
        }
        let sane = |p: &Point| p.coords.iter().all(|x| x.abs() < 1e6) && (p - s.lower[0]).norm() < MOST_MM;
        if !s.lower.iter().chain(&s.upper).all(sane) {
            return fault(format!("section {n} has a point that is not finite or lies over {MOST_MM} mm off"));
        }
        let area = section(s).1;
        if area.is_nan() || area <= 0.1 {
            return fault(format!("section {n} has an area of {area:.3} mm2, expected above 0.1"));
        }
    }
    let x = &m.material;
    for (key, value, most) in [
        ("circumferential_modulus_mpa", x.circumferential_modulus_mpa, 1e4),
        ("transverse_modulus_mpa", x.transverse_modulus_mpa, x.circumferential_modulus_mpa),
        ("shear_modulus_mpa", x.shear_modulus_mpa, x.transverse_modulus_mpa),
        ("cartilage_mpa_per_mm", x.cartilage_mpa_per_mm, 1e4),
        ("anterior_horn.stiffness_n_per_mm", m.anterior_horn.stiffness_n_per_mm, 1e6),
        ("posterior_horn.stiffness_n_per_mm", m.posterior_horn.stiffness_n_per_mm, 1e6),
        ("periphery_n_per_mm2", m.periphery_n_per_mm2, 1e4),
    ] {
        if !(value > 0.0 && value <= most) {
            return fault(format!("{key} is {value}, expected above 0 and at most {most}"));
        }
    }
    let parts = parts(m);
    for (name, horn, part) in
        [("anterior_horn", &m.anterior_horn, &parts[0]), ("posterior_horn", &m.posterior_horn, &parts[parts.len() - 1])]
    {
        let length = (horn.tibia.coords - part.centre).norm();
        if !(length > 0.5 && length < MOST_MM) {
            return fault(format!("{name} lies {length:.2} mm from its wedge, expected 0.5 to {MOST_MM}"));
        }
    }
    Ok(())
}

/// The sections of the `n`-th wedge; neighbours share one.
fn range(m: &MeniscusSpec, n: usize) -> RangeInclusive<usize> {
    let gaps = m.sections.len() - 1;
    gaps * n / m.wedges..=gaps * (n + 1) / m.wedges
}

/// Centre [mm] and area [mm2] of a section.
fn section(s: &SectionSpec) -> (Vector, f64) {
    let (mut centre, mut area) = (Vector::zeros(), 0.0);
    for (l, u) in s.lower.windows(2).zip(s.upper.windows(2)) {
        for [a, b, c] in [[l[0], l[1], u[1]], [l[0], u[1], u[0]]] {
            let part = 0.5 * (b - a).cross(&(c - a)).norm();
            centre += (a.coords + b.coords + c.coords) * (part / 3.0);
            area += part;
        }
    }
    (if area > 0.0 { centre / area } else { s.lower[0].coords }, area)
}

/// The wedges as the links see them.
pub(super) fn parts(m: &MeniscusSpec) -> Vec<Part> {
    let part = |n: usize| {
        let all: Vec<(Vector, f64)> = range(m, n).map(|s| section(&m.sections[s])).collect();
        let count = all.len() as f64;
        Part {
            centre: all.iter().map(|(c, _)| c).sum::<Vector>() / count,
            area: all.iter().map(|(_, a)| a).sum::<f64>() / count,
        }
    };
    (0..m.wedges).map(part).collect()
}

/// The wedges with the points of their faces.
pub(super) fn wedges(m: &MeniscusSpec) -> Vec<Wedge> {
    (0..m.wedges).map(|n| wedge(m, n)).collect()
}

fn wedge(m: &MeniscusSpec, n: usize) -> Wedge {
    let (mut upper, mut lower, mut length) = (Vec::new(), Vec::new(), 0.0);
    let sections = &m.sections[range(m, n)];
    for pair in sections.windows(2) {
        let last = pair[0].lower.len() - 1;
        length +=
            0.5 * ((pair[1].lower[last] - pair[0].lower[last]) + (pair[1].upper[last] - pair[0].upper[last])).norm();
        for k in 0..last {
            let quad = |face: fn(&SectionSpec) -> &[Point]| {
                [face(&pair[0])[k], face(&pair[1])[k], face(&pair[1])[k + 1], face(&pair[0])[k + 1]]
            };
            let (l, u) = (quad(|s| &s.lower), quad(|s| &s.upper));
            let [below, above] = [middle(&l), middle(&u)];
            let height = (above - below).norm();
            // the layer of cartilage and half of the wedge's height give way one after the other
            let foundation =
                1.0 / (1.0 / m.material.cartilage_mpa_per_mm + 0.5 * height / m.material.transverse_modulus_mpa);
            for (face, q, p) in [(&mut lower, &l, below), (&mut upper, &u, above)] {
                let area = 0.5 * (q[2] - q[0]).cross(&(q[3] - q[1])).norm();
                face.push(Node { place: p.coords.into(), stiffness: area * foundation, area });
            }
        }
    }
    let all: Vec<Vector> = upper.iter().chain(&lower).map(|n: &Node| Vector::from(n.place)).collect();
    let centre = all.iter().sum::<Vector>() / all.len() as f64;
    let radius = all.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    Wedge { upper, lower, centre, radius, periphery: m.periphery_n_per_mm2 * length }
}

/// The middle of a quadrilateral.
fn middle(q: &[Point; 4]) -> Point {
    Point::from(q.iter().map(|p| p.coords).sum::<Vector>() / 4.0)
}

/// [`super::hexahedra`].
pub(super) fn hexahedra(m: &MeniscusSpec) -> HexMesh {
    let points = m.sections.first().map_or(0, |s| s.lower.len());
    let mut mesh = HexMesh::default();
    for s in &m.sections {
        mesh.nodes.extend(s.lower.iter().chain(&s.upper).copied());
    }
    let at = |s: usize, k: usize, upper: bool| (s * 2 * points + k + if upper { points } else { 0 }) as u32;
    // left and right, medial and lateral menisci turn opposite ways
    let side = |s: usize, k: usize| {
        let p = |n: u32| mesh.nodes[n as usize];
        let o = p(at(s, k, false));
        (p(at(s + 1, k, false)) - o).cross(&(p(at(s, k + 1, false)) - o)).dot(&(p(at(s, k, true)) - o))
    };
    let cells: Vec<(usize, usize)> = (0..m.sections.len().saturating_sub(1))
        .flat_map(|s| (0..points.saturating_sub(1)).map(move |k| (s, k)))
        .collect();
    let turned = cells.iter().map(|&(s, k)| side(s, k)).sum::<f64>() < 0.0;
    for (s, k) in cells {
        let (from, to) = if turned { (s + 1, s) } else { (s, s + 1) };
        let face = |upper: bool| [at(from, k, upper), at(to, k, upper), at(to, k + 1, upper), at(from, k + 1, upper)];
        let ([a, b, c, d], [e, f, g, h]) = (face(false), face(true));
        mesh.elements.push([a, b, c, d, e, f, g, h]);
        mesh.bony_quads.push([a, d, c, b]);
        mesh.articular_quads.push([e, f, g, h]);
    }
    let used = |quads: &[[u32; 4]]| quads.iter().flatten().copied().collect::<BTreeSet<u32>>().into_iter().collect();
    (mesh.bony_nodes, mesh.articular_nodes) = (used(&mesh.bony_quads), used(&mesh.articular_quads));
    mesh
}
