//! Bone surfaces: what a body shows, or where nothing fits, its contact surface made a solid.

use super::forces::names_file;
use super::knee::Knee;
use super::places::Places;
use super::{Files, MM_PER_M};
use crate::DeckError;
use crate::faces::{SOLID_MM, extent, thickened};
use crate::tree::{Tree, child, text};
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Point, Vector};
use notices::{Kind, Notice};
use roxmltree::Node;

/// The bone of femur or tibia in the knee's coordinates, and whether the file shows it.
///
/// Errors: numbers that cannot be read. A file that is not there, or no bone, is told.
pub(super) fn bone<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places<'a, 'i>,
    knee: &Knee,
    (femur, objects, contact): (bool, &[Node<'a, 'i>], &TriMesh),
    files: &mut Files<'_, '_>,
    told: &mut Vec<Notice>,
) -> Result<(TriMesh, bool), DeckError> {
    let name = if femur { "femur" } else { "tibia" };
    let bodies = knee.bodies(femur);
    let mut why = "the body shows no surface of its own".to_owned();
    for body in bodies {
        let shown = objects.iter().copied().filter(|o| o.tag_name().name() == "Mesh");
        let mut best: Option<TriMesh> = None;
        for mesh in shown.filter(|m| m.ancestors().any(|a| a == places.bodies[body])) {
            let file = text(mesh, "mesh_file").unwrap_or("");
            if file.is_empty() || names_file(objects, file) {
                continue;
            }
            match read(tree, places, knee, mesh, files)? {
                Ok(surface) if best.as_ref().is_none_or(|b| extent(b) < extent(&surface)) => best = Some(surface),
                Ok(_) => {}
                Err(what) => why = what,
            }
        }
        if let Some(surface) = best {
            return Ok((surface, true));
        }
    }
    let text = format!("{name}: {why}; its contact surface, {SOLID_MM} mm thick, stands for the bone in pictures");
    told.push(Kind::DeckOdd.notice(text).of(name));
    Ok((thickened(contact, SOLID_MM), false))
}

/// A shown surface in the knee's coordinates; the inner error says why it is no bone.
fn read<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places<'a, 'i>,
    knee: &Knee,
    mesh: Node<'a, 'i>,
    files: &mut Files<'_, '_>,
) -> Result<Result<TriMesh, String>, DeckError> {
    let holder =
        mesh.ancestors().skip(1).find(|a| ["Body", "Ground", "PhysicalOffsetFrame"].contains(&a.tag_name().name()));
    let frame = match text(mesh, "socket_frame") {
        None | Some("" | "..") => holder.map(|h| places.frame(h)).transpose()?,
        Some(_) => Some(places.socket(mesh, "socket_frame")?),
    };
    let scale = Vector::from(tree.numbers(mesh, "scale_factors", [1.0; 3])?);
    let file = child(mesh, "mesh_file").and_then(|f| f.text()).unwrap_or("").trim();
    let mut surface = match files.surface(file) {
        Ok(surface) => surface,
        Err(why) => return Ok(Err(why)),
    };
    let place =
        frame.map_or_else(Isometry::identity, |f| knee.place(f.body).unwrap_or_else(Isometry::identity) * f.place);
    for p in &mut surface.vertices {
        *p = place * Point::from(p.coords.component_mul(&scale) * MM_PER_M);
    }
    let closed = Topology::of(&surface).is_closed();
    Ok(match closed {
        true if surface.volume() < 0.0 => Ok(surface.flipped()),
        true => Ok(surface),
        false => Err(format!("{file} is open")),
    })
}
