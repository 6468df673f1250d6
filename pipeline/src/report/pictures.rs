//! The still pictures of the report, for print and where 3D is not to be had.

use super::values::Values;
use image::ImageEncoder;
use meshes::frame::AnatomicalFrame;
use meshes::hex::{FACES, HexMesh};
use meshes::render::{Painted, View, ball, colour, render, tube};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use stages::attachments::Attachments;

const BONE: [u8; 3] = [225, 213, 190];
const SIZE: (usize, usize) = (420, 420);

/// A picture with its words.
pub(super) struct Figure {
    /// PNG bytes.
    pub(super) png: Vec<u8>,
    /// Pixels across.
    pub(super) width: usize,
    /// What it shows.
    pub(super) caption: String,
}

impl Values {
    /// The pictures of a stage; none where what they need is not there.
    pub(super) fn pictures(&self, stage: &str) -> Vec<Figure> {
        let figures = match stage {
            "register" => self.residuals(),
            "bones" => self.rigid_bones(),
            "cartilage" => self.thickness(),
            "frames" => self.axes(),
            "attachments" => self.fibres(),
            "hexmesh" => self.hexes.as_ref().and_then(|h| self.quality(h.meshes.named())),
            "overclosure" => self.separated.as_ref().and_then(|s| self.quality(s.meshes.named())),
            "assemble" => self.knee(),
            _ => None,
        };
        figures.unwrap_or_default()
    }

    fn residuals(&self) -> Option<Vec<Figure>> {
        let (registration, specimen, frames) =
            (self.registration.as_ref()?, self.specimen.as_ref()?, self.frames.as_ref()?);
        let named =
            registration.bones.named().into_iter().zip(specimen.scans.named()).zip([frames.femur, frames.tibia]);
        Some(
            named
                .flat_map(|(((name, bone), (_, scan)), frame)| {
                    let mesh = bone.ct_from_scan.mesh(&scan.mesh);
                    let paint: Vec<[u8; 3]> = bone.residual_mm.iter().map(|d| colour(*d, -1.0, 1.0)).collect();
                    [("the front", frame.anterior), ("behind", -frame.anterior)].map(|(from, eye)| {
                        figure(
                            &[Painted { mesh: &mesh, colours: &paint }],
                            eye,
                            frame.superior,
                            format!("Scan of the {name} on its CT bone, from {from}: distance from -1 mm (blue) to +1 mm (red, cartilage)"),
                        )
                    })
                })
                .collect(),
        )
    }

    fn rigid_bones(&self) -> Option<Vec<Figure>> {
        let (bones, frames) = (self.bones.as_ref()?, self.frames.as_ref()?);
        let painted: Vec<Painted> =
            bones.surfaces.named().map(|(_, mesh)| Painted { mesh, colours: &[BONE] }).into_iter().collect();
        let f = &frames.tibia;
        Some(vec![
            figure(&painted, f.anterior, f.superior, "Rigid bones from the front".into()),
            figure(&painted, -f.medial, f.superior, "Rigid bones from the lateral side".into()),
        ])
    }

    fn thickness(&self) -> Option<Vec<Figure>> {
        let (cartilage, frames) = (self.cartilage.as_ref()?, self.frames.as_ref()?);
        let paints = cartilage
            .solids
            .named()
            .map(|(_, s)| s.thickness_mm.iter().map(|t| colour(*t, 0.0, 4.0)).collect::<Vec<_>>());
        let painted: Vec<Painted> = cartilage
            .solids
            .named()
            .into_iter()
            .zip(&paints)
            .map(|((_, s), paint)| Painted { mesh: &s.solid, colours: paint })
            .collect();
        let (f, t) = (&frames.femur, &frames.tibia);
        let scale = "thickness from 0 (blue) to 4 mm (red)";
        Some(vec![
            figure(&painted[..1], f.anterior, f.superior, format!("Femoral cartilage from the front: {scale}")),
            figure(&painted[..1], -f.superior, f.anterior, format!("Femoral cartilage from below: {scale}")),
            figure(&painted[1..], t.superior, t.anterior, format!("Tibial cartilage from above: {scale}")),
        ])
    }

    fn axes(&self) -> Option<Vec<Figure>> {
        let (bones, frames) = (self.bones.as_ref()?, self.frames.as_ref()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        for frame in [&frames.femur, &frames.tibia] {
            parts.extend(axes_of(frame));
        }
        parts.extend(frames.epicondyles.iter().map(|p| (ball(p, 2.5), [230, 160, 0])));
        let painted: Vec<Painted> =
            parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
        let f = &frames.femur;
        let words = "medial red, anterior green, superior blue; epicondyles yellow";
        Some(vec![
            figure(&painted, f.anterior, f.superior, format!("Frames from the front: {words}")),
            figure(&painted, -f.superior, f.anterior, format!("Frames from below: {words}")),
        ])
    }

    fn fibres(&self) -> Option<Vec<Figure>> {
        let (bones, frames, attachments) = (self.bones.as_ref()?, self.frames.as_ref()?, self.attachments.as_ref()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        parts.extend(fibre_tubes(attachments));
        let painted: Vec<Painted> =
            parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
        let f = &frames.tibia;
        Some(
            [
                ("the front", f.anterior),
                ("behind", -f.anterior),
                ("the medial side", f.medial),
                ("the lateral side", -f.medial),
            ]
            .map(|(from, eye)| {
                figure(
                    &painted,
                    eye,
                    f.superior,
                    format!("Ligament fibres from {from}: marked red, literature blue, given green"),
                )
            })
            .into_iter()
            .collect(),
        )
    }

    fn quality(&self, meshes: [(&'static str, &HexMesh); 3]) -> Option<Vec<Figure>> {
        let frames = self.frames.as_ref()?;
        let shells = meshes.map(|(_, mesh)| quality_shell(mesh));
        let painted: Vec<Painted> = shells.iter().map(|(mesh, paint)| Painted { mesh, colours: paint }).collect();
        let (f, t) = (&frames.femur, &frames.tibia);
        let scale =
            "elements with a scaled Jacobian above 0.5 are pale, below 0.5 orange, below 0.2 red, inverted ones black";
        Some(vec![
            figure(&painted[..1], f.anterior, f.superior, format!("Femoral hexahedra from the front: {scale}")),
            figure(&painted[..1], -f.superior, f.anterior, format!("Femoral hexahedra from below: {scale}")),
            figure(&painted[1..], t.superior, t.anterior, format!("Tibial hexahedra from above: {scale}")),
        ])
    }

    fn knee(&self) -> Option<Vec<Figure>> {
        let (bones, frames) = (self.bones.as_ref()?, self.frames.as_ref()?);
        let (attachments, separated) = (self.attachments.as_ref()?, self.separated.as_ref()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        parts.extend(separated.meshes.named().map(|(_, mesh)| (quality_shell(mesh).0, [120, 170, 220])));
        parts.extend(fibre_tubes(attachments));
        let painted: Vec<Painted> =
            parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
        let f = &frames.tibia;
        Some(
            [
                ("the front", f.anterior),
                ("behind", -f.anterior),
                ("the medial side", f.medial),
                ("the lateral side", -f.medial),
            ]
            .map(|(from, eye)| figure(&painted, eye, f.superior, format!("The assembled knee from {from}")))
            .into_iter()
            .collect(),
        )
    }
}

fn figure(painted: &[Painted], towards_eye: Vector, up: Vector, caption: String) -> Figure {
    let picture = render(painted, &View { towards_eye, up }, SIZE.0, SIZE.1);
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    // Writing to memory does not fail; an empty picture would show in the page.
    let _ = encoder.write_image(
        &picture.pixels,
        picture.width as u32,
        picture.height as u32,
        image::ExtendedColorType::Rgb8,
    );
    Figure { png, width: SIZE.0, caption }
}

fn axes_of(frame: &AnatomicalFrame) -> Vec<(TriMesh, [u8; 3])> {
    [(frame.medial, [210, 30, 30]), (frame.anterior, [30, 160, 30]), (frame.superior, [40, 60, 210])]
        .into_iter()
        .map(|(axis, c)| (tube(&frame.origin, &(frame.origin + axis * 80.0), 1.2), c))
        .collect()
}

fn fibre_tubes(attachments: &Attachments) -> Vec<(TriMesh, [u8; 3])> {
    attachments
        .fibres
        .iter()
        .map(|f| {
            let c = match f.source {
                attachments::site::Source::Marked => [200, 40, 40],
                attachments::site::Source::Literature => [40, 90, 200],
                attachments::site::Source::Given => [40, 150, 60],
            };
            (tube(&f.femur, &f.tibia, 0.7), c)
        })
        .collect()
}

/// Pale where an element is sound, so that the few bad ones are seen.
fn quality_colour(scaled_jacobian: f64) -> [u8; 3] {
    match scaled_jacobian {
        j if j <= 0.0 => [20, 0, 20],
        j if j < 0.2 => [190, 20, 40],
        j if j < 0.5 => [250, 160, 80],
        _ => [200, 212, 222],
    }
}

/// The outer faces as triangles of their own, coloured by their element's scaled Jacobian.
fn quality_shell(mesh: &HexMesh) -> (TriMesh, Vec<[u8; 3]>) {
    let mut count: std::collections::BTreeMap<[u32; 4], u32> = std::collections::BTreeMap::new();
    let key = |mut face: [u32; 4]| {
        face.sort_unstable();
        face
    };
    let faces_of = |e: &[u32; 8]| FACES.map(|f| f.map(|k| e[k]));
    mesh.elements.iter().flat_map(faces_of).for_each(|f| *count.entry(key(f)).or_default() += 1);
    let mut shell = TriMesh::default();
    let mut paint = Vec::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let c = quality_colour(mesh.scaled_jacobian(e));
        for face in faces_of(element).into_iter().filter(|f| count[&key(*f)] == 1) {
            let base = shell.vertices.len() as u32;
            let corners: [Point; 4] = face.map(|n| mesh.nodes[n as usize]);
            shell.vertices.extend(corners);
            paint.extend([c; 4]);
            shell.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
    }
    (shell, paint)
}
