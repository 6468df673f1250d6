//! Menisci in a FEBio file: transversely isotropic hexahedra, horns as springs, contact with both cartilage faces.

use super::{contact_name, penalty, place};
use crate::model_file::LoadedModel;
use sim::menisci::hexahedra;
use sim::spec::meniscus::{POISSON_ACROSS, POISSON_ALONG, SHEAR_ALONG_MPA};
use std::fmt::Write;

/// A horn's spring is linear over this far either way [mm].
const FAR_MM: f64 = 50.0;

/// What menisci are in each section of the file.
#[derive(Default)]
pub(super) struct Menisci {
    pub(super) materials: String,
    pub(super) nodes: String,
    pub(super) elements: String,
    pub(super) surfaces: String,
    pub(super) sets: String,
    pub(super) pairs: String,
    pub(super) domains: String,
    pub(super) boundary: String,
    pub(super) contact: String,
    pub(super) springs: String,
    pub(super) discrete: String,
}

/// The menisci, when `node`, `element` and `spring` are the last labels given out.
pub(super) fn menisci(model: &LoadedModel, (mut node, mut element, mut spring): (usize, usize, usize)) -> Menisci {
    let mut out = Menisci::default();
    let mut roots = Vec::new();
    for (n, m) in model.spec.menisci.iter().enumerate() {
        let (name, mesh, first) = (&m.name, hexahedra(m), node);
        let _ = writeln!(out.nodes, "<Nodes name=\"{name}\">");
        for p in mesh.nodes.iter().chain([&m.anterior_horn.tibia, &m.posterior_horn.tibia]) {
            node += 1;
            let _ = writeln!(out.nodes, "<node id=\"{node}\">{}</node>", place(p));
        }
        out.nodes += "</Nodes>\n";
        let list =
            |nodes: &[u32]| nodes.iter().map(|v| (*v as usize + first + 1).to_string()).collect::<Vec<_>>().join(",");
        let _ = writeln!(out.elements, "<Elements type=\"hex8\" name=\"{name}_part\">");
        for e in &mesh.elements {
            element += 1;
            let _ = writeln!(out.elements, "<elem id=\"{element}\">{}</elem>", list(e));
        }
        out.elements += "</Elements>\n";
        let _ = writeln!(out.domains, "<SolidDomain name=\"{name}_part\" mat=\"{name}\"/>");
        let (along, across) = (m.material.circumferential_modulus_mpa, m.material.transverse_modulus_mpa);
        let _ = write!(
            out.materials,
            "<material id=\"{}\" name=\"{name}\" type=\"orthotropic elastic\"><density>1e-9</density><mat_axis type=\"local\">1,2,4</mat_axis><E1>{along}</E1><E2>{across}</E2><E3>{across}</E3><G12>{SHEAR_ALONG_MPA}</G12><G23>{:.6}</G23><G31>{SHEAR_ALONG_MPA}</G31><v12>{POISSON_ALONG}</v12><v23>{POISSON_ACROSS}</v23><v31>{:.6}</v31></material>",
            n + 3,
            across / (2.0 * (1.0 + POISSON_ACROSS)),
            POISSON_ALONG * across / along
        );
        for (face, quads, path, femur) in
            [("upper", &mesh.articular_quads, &m.femur, true), ("lower", &mesh.bony_quads, &m.tibia, false)]
        {
            let _ = writeln!(out.surfaces, "<Surface name=\"{name}_{face}\">");
            for (k, q) in quads.iter().enumerate() {
                let _ = writeln!(out.surfaces, "<quad4 id=\"{}\">{}</quad4>", k + 1, list(q));
            }
            out.surfaces += "</Surface>\n";
            let other = contact_name(model, path, femur);
            let _ = writeln!(
                out.pairs,
                "<SurfacePair name=\"{name}_{face}_on_{other}\"><primary>{name}_{face}</primary><secondary>{other}_surface</secondary></SurfacePair>"
            );
            let _ = write!(
                out.contact,
                "<contact name=\"{name}_{face}_on_{other}\" type=\"sliding-elastic\" surface_pair=\"{name}_{face}_on_{other}\"><laugon>PENALTY</laugon><penalty>{:.6}</penalty><auto_penalty>0</auto_penalty><two_pass>1</two_pass><search_radius>5</search_radius><symmetric_stiffness>0</symmetric_stiffness></contact>",
                penalty(model)
            );
        }
        let ring = 2 * m.sections[0].lower.len();
        let last = first + mesh.nodes.len();
        for (from, root, horn, which) in
            [(first, last + 1, &m.anterior_horn, "anterior"), (last - ring, last + 2, &m.posterior_horn, "posterior")]
        {
            spring += 1;
            roots.push(root.to_string());
            let set = format!("{name}_{which}_horn");
            let ends: String = (1..=ring).map(|k| format!("<delem>{},{root}</delem>", from + k)).collect();
            let _ = writeln!(out.sets, "<DiscreteSet name=\"{set}\">{ends}</DiscreteSet>");
            let force = horn.stiffness_n_per_mm / ring as f64 * FAR_MM;
            let _ = writeln!(
                out.springs,
                "<discrete_material id=\"{spring}\" name=\"{set}\" type=\"nonlinear spring\"><scale>1</scale><measure>elongation</measure><force type=\"point\"><interpolate>LINEAR</interpolate><extend>EXTRAPOLATE</extend><points><pt>{:.6},{:.6}</pt><pt>0.000000,0.000000</pt><pt>{FAR_MM:.6},{force:.6}</pt></points></force></discrete_material>",
                -FAR_MM, -force
            );
            let _ = writeln!(out.discrete, "<discrete dmat=\"{spring}\" discrete_set=\"{set}\"/>");
        }
    }
    if !roots.is_empty() {
        let _ = writeln!(out.sets, "<NodeSet name=\"meniscus_roots\">{}</NodeSet>", roots.join(","));
        out.boundary =
            "<bc name=\"roots of the menisci on tibia\" type=\"rigid\" node_set=\"meniscus_roots\"><rb>tibia</rb></bc>"
                .into();
    }
    out
}
