//! Deformable solids against closed answers, the laws they keep, their orders: docs/verification.md holds the figures printed here.
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]
#![allow(clippy::unwrap_used, reason = "tests")]

mod calculix;
mod closed;
mod contact;
mod faults;
mod laws;

use deformable::{Assembly, Body, Damping, Face, Law, Material, Motion, Options, RigidFace, Scaling, Solid};
use meshes::hex::HexMesh;
use meshes::{Point, Vector};

/// A block of `n` elements and `size` mm; its lower face is bony, its upper face articular.
fn block(n: [usize; 3], size: [f64; 3]) -> HexMesh {
    let at = |i: usize, j: usize, k: usize| ((k * (n[1] + 1) + j) * (n[0] + 1) + i) as u32;
    let mut mesh = HexMesh::default();
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                let p = [i, j, k];
                let x: [f64; 3] = std::array::from_fn(|a| size[a] * p[a] as f64 / n[a] as f64);
                mesh.nodes.push(Point::from(x));
            }
        }
    }
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let ring = |k| [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)];
                let (low, high) = (ring(k), ring(k + 1));
                mesh.elements.push(std::array::from_fn(|c| if c < 4 { low[c] } else { high[c - 4] }));
                if k == 0 {
                    mesh.bony_quads.push([low[0], low[3], low[2], low[1]]);
                }
                if k + 1 == n[2] {
                    mesh.articular_quads.push(high);
                }
            }
        }
    }
    let layer = ((n[0] + 1) * (n[1] + 1)) as u32;
    let count = mesh.nodes.len() as u32;
    mesh.bony_nodes = (0..layer).collect();
    mesh.articular_nodes = (count - layer..count).collect();
    mesh
}

/// The block with its inner nodes moved about, as far as `share` of an element of 1 mm.
fn distorted(mut mesh: HexMesh, share: f64, inner_only: bool) -> HexMesh {
    let high = mesh.nodes.iter().fold(mesh.nodes[0], |m, p| m.sup(p));
    for (n, p) in mesh.nodes.iter_mut().enumerate() {
        let inner = (0..3).all(|a| p[a] > 1e-9 && p[a] < high[a] - 1e-9);
        if inner || !inner_only {
            let t = n as f64;
            *p += Vector::new((12.9 * t).sin(), (7.3 * t).cos(), (4.7 * t + 1.0).sin()) * share;
        }
    }
    mesh
}

fn material(law: Law, e: f64, nu: f64) -> Material {
    Material { law, youngs_modulus_mpa: e, poissons_ratio: nu, density_tonne_mm3: 1.81e-8 }
}

/// A solid fixed to body 0.
fn solid(mesh: HexMesh, material: Material) -> Solid {
    Solid { name: "block".into(), mesh, material, body: 0, rollers: Vec::new() }
}

/// Rollers on the three faces through the origin, and nothing bony: free to swell.
fn on_rollers(mesh: HexMesh, material: Material) -> Solid {
    let rollers = (0..mesh.nodes.len() as u32)
        .map(|n| (n, std::array::from_fn(|a| mesh.nodes[n as usize][a].abs() < 1e-9)))
        .filter(|(_, axes): &(u32, [bool; 3])| axes.iter().any(|h| *h))
        .collect();
    Solid { rollers, ..solid(HexMesh { bony_nodes: Vec::new(), ..mesh }, material) }
}

/// A rigid square plate that looks down at height `z`, `wide` mm beyond the origin and `to`.
fn plate(z: f64, wide: f64, to: f64, body: usize) -> RigidFace {
    let (a, b) = (-wide, to + wide);
    let nodes = [[a, a], [b, a], [b, b], [a, b]].map(|[x, y]| Point::new(x, y, z)).to_vec();
    RigidFace { name: "plate".into(), nodes, quads: vec![[0, 3, 2, 1]], body }
}

fn fixed() -> Body {
    Body { name: "ground".into(), motion: Motion::Fixed }
}

fn moved(shift: Vector) -> Body {
    let ramp = deformable::Ramp::constant(0.0);
    Body {
        name: "press".into(),
        motion: Motion::Prescribed { turn: Vector::zeros(), about: Point::origin(), shift, ramp },
    }
}

/// Dynamic relaxation without friction.
fn relaxed() -> Options {
    Options { scaling: Scaling::Even(1e-5), damping: Damping::Critical, friction: 0.0, ..Options::default() }
}

/// One solid below a plate.
fn under_plate(solid: Solid, z: f64, wide: f64, to: f64) -> Assembly {
    Assembly {
        bodies: vec![fixed(), moved(Vector::zeros())],
        solids: vec![solid],
        rigid_faces: vec![plate(z, wide, to, 1)],
        pairs: vec![[Face::Articular(0), Face::Rigid(0)]],
    }
}
