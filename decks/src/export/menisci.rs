//! Menisci in a deck: transversely isotropic hexahedra, horns as springs, contact with both cartilage faces.

use super::number;
use super::parts::{TIBIA, set_name};
use crate::model::MENISCI;
use meshes::Point;
use sim::menisci::hexahedra;
use sim::spec::meniscus::{POISSON_ACROSS, POISSON_ALONG, SHEAR_ALONG_MPA};
use sim::spec::{MeniscusSpec, ModelSpec};
use std::fmt::Write;

/// First label of nodes and of elements: above those of all other parts.
const FIRST: u64 = 50_000_001;

/// A set's name.
fn set(m: &MeniscusSpec) -> String {
    m.name.to_uppercase().replace('_', "-")
}

/// Nodes, elements, faces, material and horns.
pub(super) fn parts(spec: &ModelSpec) -> String {
    let mut out = String::from("** menisci: the first edge of each element runs along the fibres\n");
    out += "*ORIENTATION, NAME=MENISCUS-FIBRES, DEFINITION=OFFSET TO NODES\n2, 4, 1\n";
    let (mut node, mut element) = (FIRST, FIRST);
    for m in &spec.menisci {
        let (name, mesh) = (set(m), hexahedra(m));
        let first = node;
        out += "*NODE\n";
        let mut put = |out: &mut String, p: &Point| {
            let _ = writeln!(out, "{node}, {}, {}, {}", number(p.x), number(p.y), number(p.z));
            node += 1;
            node - 1
        };
        mesh.nodes.iter().for_each(|p| {
            put(&mut out, p);
        });
        let roots = [&m.anterior_horn, &m.posterior_horn].map(|horn| put(&mut out, &horn.tibia));
        let _ = writeln!(out, "*MPC\nBEAM, {}, {TIBIA}\nBEAM, {}, {TIBIA}", roots[0], roots[1]);
        let _ = writeln!(out, "*ELEMENT, TYPE=C3D8R, ELSET={name}");
        for e in &mesh.elements {
            let nodes: Vec<String> = e.iter().map(|n| (first + u64::from(*n)).to_string()).collect();
            let _ = writeln!(out, "{element}, {}", nodes.join(", "));
            element += 1;
        }
        let x = &m.material;
        let (along, across) = (x.circumferential_modulus_mpa, x.transverse_modulus_mpa);
        let shear_across = across / (2.0 * (1.0 + POISSON_ACROSS));
        let _ = writeln!(
            out,
            "*SOLID SECTION, ELSET={name}, MATERIAL={name}, ORIENTATION=MENISCUS-FIBRES\n1.0,\n*MATERIAL, NAME={name}\n*DENSITY\n1.81e-8,"
        );
        let elastic =
            [along, across, across, POISSON_ALONG, POISSON_ALONG, POISSON_ACROSS, SHEAR_ALONG_MPA, SHEAR_ALONG_MPA];
        let _ = writeln!(
            out,
            "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n{}\n{}",
            elastic.map(number).join(", "),
            number(shear_across)
        );
        // S1 is the face of the first four nodes, S2 that of the last four
        for (face, side) in [("LOWER", "S1"), ("UPPER", "S2")] {
            let _ = writeln!(out, "*SURFACE, TYPE=ELEMENT, NAME=SURF-{name}-{face}\n{name}, {side}");
        }
        let ring = 2 * m.sections[0].lower.len() as u64;
        let ends =
            [(first, &m.anterior_horn, "ANT"), (first + mesh.nodes.len() as u64 - ring, &m.posterior_horn, "POST")];
        for ((from, horn, which), root) in ends.into_iter().zip(roots) {
            let _ = writeln!(out, "*ELEMENT, TYPE=SPRINGA, ELSET={name}-{which}");
            for n in from..from + ring {
                let _ = writeln!(out, "{element}, {n}, {root}");
                element += 1;
            }
            let k = number(horn.stiffness_n_per_mm / ring as f64);
            let _ = writeln!(out, "*SPRING, ELSET={name}-{which}\n\n{k},");
        }
    }
    out
}

/// Contact of each meniscus with both cartilage faces, by the model's own table.
pub(super) fn contact(spec: &ModelSpec) -> String {
    let c = &spec.contact;
    let mut out = format!("*SURFACE INTERACTION, NAME={MENISCI}\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n");
    for (p, o) in c.pressure_mpa.iter().zip(&c.overclosure_mm) {
        let _ = writeln!(out, "{}, {}", number(*p), number(*o));
    }
    for m in &spec.menisci {
        let name = set(m);
        for (face, path, femur) in [("UPPER", &m.femur, true), ("LOWER", &m.tibia, false)] {
            let other = set_name("ART", path, femur);
            let _ = writeln!(
                out,
                "*CONTACT PAIR, CPSET={name}-{face}, MECHANICAL CONSTRAINT=PENALTY, INTERACTION={MENISCI}, WEIGHT=0.5\nSURF-{name}-{face}, SURF-{other}"
            );
        }
    }
    out
}
