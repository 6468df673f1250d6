//! Surfaces: bones and scans by geometry, cartilages by name; put into mm where they are in metres.

use super::{Filled, Placed, companions, file_name};
use crate::error::BuildError;
use formats::ply;
use meshes::frame::Side;
use meshes::surface::{ColouredMesh, TriMesh};
use stages::guess::{Role, guess};
use stages::ingest::middle_extent;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// A surface that was given.
pub(super) struct Given {
    pub(super) path: PathBuf,
    pub(super) bytes: Vec<u8>,
    pub(super) mesh: ColouredMesh,
}

/// A surface narrower than this is in metres [its unit]: the smallest of a knee, a meniscus, is 20 mm wide, the largest 0.2 m.
const METRES: f64 = 0.3;

/// What was placed, the surfaces by their roles, and what is told of the side.
pub(super) type Found = (Vec<Placed>, BTreeMap<Role, TriMesh>, String);

/// Places the surfaces.
pub(super) fn place(given: Vec<Given>, filled: &mut Filled) -> Result<Found, BuildError> {
    let (mut out, mut known, mut text) = (Vec::new(), BTreeMap::new(), String::new());
    let names: Vec<String> = given.iter().map(|g| g.path.display().to_string()).collect();
    let (given, metres): (Vec<Given>, Vec<bool>) =
        given.into_iter().map(in_mm).collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let meshes: Vec<ColouredMesh> = given.iter().map(|g| g.mesh.clone()).collect();
    let mut guesses = guess(&meshes);
    by_name(&given, &mut guesses.surfaces);
    let both = [Role::CtFemur, Role::CtTibfib].iter().all(|r| guesses.surfaces.iter().any(|g| g.role == Some(*r)));
    for (((g, guess), metres), from) in given.into_iter().zip(guesses.surfaces).zip(metres).zip(names) {
        let (mut why, mut role) = (guess.why, guess.role);
        if !filled.labels.is_empty() && !both {
            role = None;
            why += "; the label map shows this knee, so it is not needed";
        }
        let cartilage =
            if role.is_none() && filled.labels.is_empty() { cartilage_key(&file_name(&g.path)) } else { None };
        let place = role.filter(|r| !known.contains_key(r)).map(Role::key).or(cartilage.map(|key| ("cartilage", key)));
        if let Some(key) = cartilage {
            why += &format!("; by its name {key}, in the frame of CT: correct [cartilage] frame if it is another");
        }
        if metres {
            why += "; it was in metres, and is written in mm";
        }
        let to = place.filter(|(table, key)| !filled.paths.contains_key(&((*table).to_owned(), (*key).to_owned())));
        let to = to.map(|(table, key)| {
            let to = format!("{}/{}", if table == "cartilage" { "mri" } else { table }, file_name(&g.path));
            filled.paths.insert((table.into(), key.into()), to.clone());
            if let Some(role) = role {
                known.insert(role, g.mesh.mesh.clone());
            }
            to
        });
        if let Some(place) = to.as_deref().and_then(|t| t.rsplit_once('/')).filter(|_| !metres) {
            for (name, bytes) in companions(&g.path) {
                let to = Some(format!("{}/{name}", place.0));
                out.push(Placed { from: name, to, why: "named by a surface".into(), line: None, bytes });
            }
        }
        out.push(Placed { from, to, why, line: None, bytes: g.bytes });
    }
    if let Some(side) = guesses.side {
        let name = if side.side == Side::Left { "left" } else { "right" };
        (filled.side, filled.side_by) = (Some(name), "told from the bones");
        let _ = writeln!(text, "side = \"{name}\": the fibula lies there (certainty {:.0} %)", 100.0 * side.confidence);
    }
    Ok((out, known, text))
}

/// The surface in mm, and whether it was in metres; then its bytes are those of a PLY.
fn in_mm(mut given: Given) -> Result<(Given, bool), BuildError> {
    if !(1e-3..METRES).contains(&middle_extent(&given.mesh.mesh)) {
        return Ok((given, false));
    }
    given.mesh.mesh.vertices.iter_mut().for_each(|p| *p *= 1e3);
    let mut bytes = Vec::new();
    let wrote = match given.mesh.colours.is_empty() {
        true => ply::write(&mut bytes, &given.mesh.mesh, &[]),
        false => ply::write_coloured(&mut bytes, &given.mesh),
    };
    wrote.map_err(|e| BuildError::in_file(&given.path, e))?;
    let path = given.path.with_extension("mm.ply");
    Ok((Given { path, bytes, ..given }, true))
}

/// One bone of CT alone does not show which it is: its name tells.
fn by_name(given: &[Given], guesses: &mut [stages::guess::Guess]) {
    let Some(i) = guesses.iter().position(|g| g.lone_bone) else { return };
    let name = file_name(&given[i].path).to_lowercase();
    let role = match (name.contains("fem"), name.contains("tib")) {
        (true, false) => Some((Role::CtFemur, "the femur")),
        (false, true) => Some((Role::CtTibfib, "the tibia")),
        _ => None,
    };
    guesses[i].why = match role {
        Some((_, what)) => format!("closed, no colours: a bone in CT; one alone does not show which: by its name {what}"),
        None => "closed, no colours: a bone in CT; one alone does not show which: give the other bone too, or name it femur or tibfib".into(),
    };
    guesses[i].role = role.map(|r| r.0);
}

/// The key of `[cartilage]` that a file's name tells.
fn cartilage_key(name: &str) -> Option<&'static str> {
    let name = name.to_lowercase();
    let has = |word: &str| name.contains(word);
    match (has("cart"), has("fem"), has("tib"), has("med"), has("lat")) {
        (true, true, false, ..) => Some("femur"),
        (true, false, true, true, false) => Some("tibia_medial"),
        (true, false, true, false, true) => Some("tibia_lateral"),
        _ => None,
    }
}
