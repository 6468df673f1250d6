//! Pictures of attachments: a knee's bones and fibres from four sides.

use super::{Meshes, fault};
use crate::error::BuildError;
use image::ImageEncoder;
use meshes::render::{Painted, View, ball, render, tube};
use meshes::surface::TriMesh;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;

const SIDE: usize = 420;
const BONE: [u8; 3] = [225, 213, 190];
/// Colours of bundles by how their names begin; what begins otherwise is grey.
const COLOURS: [(&str, [u8; 3]); 10] = [
    ("ACL", [200, 30, 40]),
    ("PCL", [30, 80, 200]),
    ("PCAP", [130, 60, 160]),
    ("LCL", [20, 140, 60]),
    ("PFL", [20, 140, 60]),
    ("ALS", [20, 140, 60]),
    ("sMCL", [235, 130, 20]),
    ("MCL", [235, 130, 20]),
    ("dMCL", [235, 130, 20]),
    ("POL", [235, 130, 20]),
];
/// What the picture shows, in words.
pub(super) const WORDS: &str = "From the front, behind, the medial and the lateral side; ends of fibres are balls. Red: ACL. Blue: PCL. Violet: posterior capsule. \
    Green: LCL, PFL and ALS. Orange: both layers of the MCL and the POL.";

/// A PNG of the bones and fibres from the front, behind, medially and laterally, side by side.
///
/// Errors: a bone that is not there.
pub(super) fn fibres(spec: &ModelSpec, meshes: &Meshes) -> Result<Vec<u8>, BuildError> {
    let mut parts: Vec<(TriMesh, [u8; 3])> = Vec::new();
    for body in &spec.bodies {
        match meshes.get(&body.bone) {
            Some(MeshValue::Surface(bone)) => parts.push((bone.clone(), BONE)),
            _ => return Err(fault(format!("no surface {}", body.bone))),
        }
    }
    for f in &spec.fibres {
        let c = COLOURS.iter().find(|(name, _)| f.bundle.starts_with(name)).map_or([110; 3], |c| c.1);
        parts.push((tube(&f.femur, &f.tibia, 0.6), c));
        parts.extend([f.femur, f.tibia].map(|end| (ball(&end, 1.4), c)));
    }
    let painted: Vec<Painted> =
        parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
    let t = &spec.frames.tibia;
    let views = [t.anterior, -t.anterior, t.medial, -t.medial]
        .map(|towards_eye| render(&painted, &View { towards_eye, up: t.superior }, SIDE, SIDE).pixels);
    let row = 3 * SIDE;
    let pixels: Vec<u8> =
        (0..SIDE).flat_map(|y| views.iter().flat_map(move |v| v.iter().skip(y * row).take(row).copied())).collect();
    let mut png = Vec::new();
    image::codecs::png::PngEncoder::new(&mut png)
        .write_image(&pixels, (views.len() * SIDE) as u32, SIDE as u32, image::ExtendedColorType::Rgb8)
        .map_err(fault)?;
    Ok(png)
}
