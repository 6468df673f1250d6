//! Stresses and pressures of a state, for files and tables.

use super::face::{NONE, Surface};
use super::law::neo_hookean_energy;
use super::model::Model;
use super::{Face, Law, State};
use meshes::Point;
use nalgebra::Matrix3;

/// What a solid looks like.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fields {
    /// Where its nodes are [mm].
    pub places: Vec<Point>,
    /// Cauchy stress of each element: xx, xy, xz, yy, yz, zz [MPa].
    pub stress_mpa: Vec<[f64; 6]>,
    /// Von Mises' stress of each element [MPa].
    pub von_mises_mpa: Vec<f64>,
    /// Pressure (minus the mean stress) of each element [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Volume of each element over that at the start [-].
    pub volume_ratio: Vec<f64>,
    /// Contact pressure at each node [MPa], 0 off the face.
    pub contact_pressure_mpa: Vec<f64>,
}

/// The fields of a solid.
pub fn fields(model: &Model, state: &State, solid: usize) -> Fields {
    let range = model.nodes_of(solid);
    let count = model.solids()[solid].mesh.elements.len();
    let mut out = Fields {
        places: state.x[range.clone()].iter().map(|p| Point::from(*p)).collect(),
        stress_mpa: vec![[0.0; 6]; count],
        volume_ratio: vec![1.0; count],
        contact_pressure_mpa: vec![0.0; range.len()],
        ..Fields::default()
    };
    for block in model.blocks.iter().filter(|b| b.solid as usize == solid) {
        let (cauchy, ratio) = block.stress(&state.x);
        for lane in 0..block.count as usize {
            let e = block.first as usize + lane;
            out.stress_mpa[e] = cauchy.map(|s| s.0[lane]);
            out.volume_ratio[e] = ratio.0[lane];
        }
    }
    out.von_mises_mpa = out.stress_mpa.iter().map(von_mises).collect();
    out.pressure_mpa = out.stress_mpa.iter().map(|s| -(s[0] + s[3] + s[5]) / 3.0).collect();
    for (node, pressure) in contact_pressure(model, state, Face::Articular(solid)) {
        if let Some(slot) = node.checked_sub(range.start).and_then(|n| out.contact_pressure_mpa.get_mut(n)) {
            *slot = pressure;
        }
    }
    out
}

fn von_mises(s: &[f64; 6]) -> f64 {
    let [xx, xy, xz, yy, yz, zz] = *s;
    let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (normal / 2.0 + 3.0 * (xy * xy + xz * xz + yz * yz)).sqrt()
}

/// Pressure at each node of a face [MPa], node numbers the model's: the normal forces of both passes over the node's area.
pub fn contact_pressure(model: &Model, state: &State, face: Face) -> Vec<(usize, f64)> {
    let Some(&own) = model.face_of.get(&face) else { return Vec::new() };
    let mut push = vec![0.0; model.start.len()];
    for (pass, touches) in model.passes.iter().zip(&state.contact.touches) {
        for (n, touch) in touches.iter().enumerate().filter(|(_, t)| t.normal > 0.0 && t.quad != NONE) {
            if pass.nodes == own {
                push[model.faces[pass.nodes].nodes[n] as usize] += touch.normal;
            } else if pass.face == own {
                let corners = &model.faces[own].quads[touch.quad as usize];
                corners.iter().zip(&touch.weights).for_each(|(&c, w)| push[c as usize] += w * touch.normal);
            }
        }
    }
    let now = Surface::new(model.faces[own].quads.clone(), &state.x);
    now.nodes.iter().zip(&now.area).map(|(&n, a)| (n as usize, push[n as usize] / a)).collect()
}

impl State {
    /// Elastic energy of the solids with a neo-Hookean law, hourglass modes left out [N mm].
    pub fn neo_hookean_energy(&self, model: &Model) -> f64 {
        let mut sum = 0.0;
        for block in &model.blocks {
            let material = &model.solids()[block.solid as usize].material;
            if material.law != Law::NeoHookean {
                continue;
            }
            let f = block.gradients(&self.x);
            for lane in 0..block.count as usize {
                let f = Matrix3::from_fn(|i, j| f[i][j].0[lane]);
                sum += block.volumes()[lane] * neo_hookean_energy(material.lambda(), material.mu(), &f);
            }
        }
        sum
    }
}
