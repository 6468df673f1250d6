//! Cartilage by region of a build, from its hexahedral meshes and its frames.

use super::quantity::Quantity;
use crate::stage::list::folder_name;
use crate::store;
use meshes::frame::AnatomicalFrame;
use meshes::hex::HexMesh;
use serde::Deserialize;
use stages::PerCartilage;
use stages::cartilage::regions::{Region, regions};
use std::path::Path;

/// The stage whose meshes are measured.
const STAGE: &str = "hexmesh";
/// Mean thickness of a region: what the page draws of it.
pub(super) const MEAN: &str = "thickness_mean_mm";
/// Cartilages, which the names of their regions begin with.
const CARTILAGES: [&str; 3] = ["femur", "tibia_medial", "tibia_lateral"];

/// What frames.json has of both bones.
#[derive(Deserialize)]
struct Frames {
    femur: AnatomicalFrame,
    tibia: AnatomicalFrame,
}

/// Area, mean and scatter of the thickness of each region; none of a build without these files, or with others in their place.
pub(super) fn of_build(folder: &Path) -> Vec<Quantity> {
    let found = read(folder).map(|(meshes, frames)| regions(&meshes, &frames.femur, &frames.tibia));
    found.unwrap_or_default().iter().flat_map(quantities).collect()
}

fn read(folder: &Path) -> Option<(PerCartilage<HexMesh>, Frames)> {
    let text = store::read_text(&folder.join(folder_name("frames")).join("frames.json")).ok()?;
    let frames = serde_json::from_str(&text).ok()?;
    let mesh = |name: &str| {
        let bytes = store::read(&folder.join(folder_name(STAGE)).join(format!("{name}.vtu"))).ok()?;
        let read = formats::vtk::read_solids(&bytes).ok()?;
        Some(HexMesh { nodes: read.nodes, elements: read.hexahedra, ..HexMesh::default() })
    };
    let [femur, medial, lateral] = CARTILAGES.map(mesh);
    Some((PerCartilage { femur: femur?, tibia_medial: medial?, tibia_lateral: lateral? }, frames))
}

fn quantities(region: &Region) -> [Quantity; 3] {
    let of = |name: &str, value| Quantity { stage: STAGE, name: name.to_owned(), part: region.name.clone(), value };
    [of("area_bony_mm2", region.area_mm2), of(MEAN, region.mean_mm), of("thickness_sd_mm", region.sd_mm)]
}

/// Cartilage and region of a region's quantity; none of other quantities.
pub(super) fn parted<'a>(stage: &str, name: &str, part: &'a str) -> Option<(&'static str, &'a str)> {
    let of = |c: &&'static str| Some((*c, part.strip_prefix(*c)?.strip_prefix('_')?));
    let measured = stage == STAGE && [MEAN, "area_bony_mm2", "thickness_sd_mm"].contains(&name);
    CARTILAGES.iter().filter(|_| measured).find_map(of)
}
