//! The scenes of the report: for every stage the surfaces, lines and points by which one sees whether it is right.

use super::geometry::{Pool, packed_values, rounded, thinned};
use super::values::Values;
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::gap::ContactFace;
use meshes::hex::{FACES, HexMesh};
use meshes::surface::TriMesh;
use serde::Serialize;
use stages::PerCartilage;
use std::collections::BTreeMap;

const BONE: &str = "#e1d5be";
/// Edge of the cubes in which corners are drawn together: of bones that are there to see the rest by, and of scans [mm].
const CONTEXT_MM: f64 = 2.2;
const SCAN_MM: f64 = 0.9;

/// A scene: what it shows, in words and in layers.
#[derive(Serialize)]
pub(super) struct Scene {
    pub(super) id: String,
    pub(super) title: String,
    /// Its text alternative: what it shows, the figures, what to look for.
    pub(super) text: String,
    /// Where the eye is at first: front, behind, above, below.
    pub(super) from: &'static str,
    pub(super) layers: Vec<Layer>,
    /// True where a slider moves it.
    pub(super) moves: bool,
}

/// A part of a scene that can be hidden.
#[derive(Serialize, Default)]
pub(super) struct Layer {
    pub(super) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mesh: Option<String>,
    pub(super) colour: &'static str,
    pub(super) opacity: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) scalar: Option<Scalar>,
    /// Ends of lines, two points each, or points; mm.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) lines: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) points: Vec<[f64; 3]>,
    /// Words at the points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) labels: Vec<String>,
    /// Shown at first.
    pub(super) on: bool,
    /// Of the layers with the same word one is shown at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) one_of: Option<&'static str>,
    /// Moves with the femur: the whole of it, or ("fibres") the first end of each line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) moves: Option<&'static str>,
}

/// Values by which a surface is coloured.
#[derive(Serialize, Clone)]
pub(super) struct Scalar {
    pub(super) values: String,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) title: &'static str,
    pub(super) scale: &'static str,
    /// One a triangle, not a corner.
    pub(super) cells: bool,
}

/// The scenes of a stage; places that its warnings name are marked in them.
pub(super) fn scenes(stage: &str, warnings: &[String], v: &Values, pool: &mut Pool) -> Vec<Scene> {
    let mut scene = match stage {
        "register" => registration(v, pool),
        "bones" => bones(v, pool),
        "cartilage" => cartilage(v, pool),
        "frames" => frames(v, pool),
        "attachments" => attachments(v, pool),
        "hexmesh" => v.hexes.as_ref().map(|h| hexahedra("hexmesh", &h.meshes, pool)),
        "overclosure" => overclosure(v, pool),
        _ => None,
    };
    let named: Vec<Point> = warnings.iter().flat_map(|w| places(w)).collect();
    if let (Some(scene), false) = (&mut scene, named.is_empty()) {
        scene.layers.push(named_places("places that warnings name", &named, pool));
    }
    scene.into_iter().collect()
}

fn registration(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let (registration, specimen) = (v.registration.as_ref()?, v.specimen.as_ref()?);
    let mut layers = Vec::new();
    let mut words = String::new();
    for ((name, bone), (_, scan)) in registration.bones.named().into_iter().zip(specimen.scans.named()) {
        let bare: Vec<f64> = bone.bare_bone.iter().map(|b| f64::from(u8::from(*b))).collect();
        let (mesh, means) = thinned(&bone.ct_from_scan.mesh(&scan.mesh), &[&bone.residual_mm, &bare], SCAN_MM);
        let key = format!("scan {name}");
        pool.keep(&key, &mesh);
        let maps = [
            ("distance to bone", &means[0], -1.0, 3.0, "mm", "distance"),
            ("bare-bone mask", &means[1], 0.0, 1.0, "bare bone", "mask"),
        ];
        for (what, values, low, high, title, scale) in maps {
            layers.push(Layer {
                name: format!("{name}: {what}"),
                mesh: Some(key.clone()),
                opacity: 1.0,
                scalar: Some(Scalar {
                    values: packed_values(values, low, high),
                    low,
                    high,
                    title,
                    scale,
                    cells: false,
                }),
                on: scale == "distance",
                one_of: Some(if name == "femur" { "femur" } else { "tibfib" }),
                ..Layer::default()
            });
        }
        words += &format!(
            " {name}: {:.2} mm root mean square on bare bone, {:.0} % of what looks like bone lies on it, predicted error {:.2} mm.",
            bone.rms_bare_bone_mm,
            100.0 * bone.inlier_fraction,
            bone.predicted_error_mm
        );
    }
    for (name, mesh) in specimen.ct.named() {
        let key = format!("ct {name}");
        pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
        layers.push(Layer {
            name: format!("{name}: CT bone"),
            mesh: Some(key),
            colour: BONE,
            opacity: 1.0,
            on: false,
            ..Layer::default()
        });
    }
    Some(Scene {
        id: "register".into(),
        title: "Scans on their bones".into(),
        text: format!(
            "Each scan laid on its CT bone, coloured by its distance to the bone: about 0 mm on bare bone, 1 to 4 mm where cartilage lies between.{words} The other map shows which part was taken for bare bone. Right when bare bone is of one colour and no edge of cartilage is in the mask."
        ),
        from: "front",
        layers,
        moves: false,
    })
}

fn bone_layers(v: &Values, pool: &mut Pool, opacity: f64) -> Vec<Layer> {
    let Some(bones) = &v.bones else { return vec![] };
    bones
        .surfaces
        .named()
        .into_iter()
        .map(|(name, mesh)| {
            let key = format!("bone {name}");
            pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
            let moves = (name == "femur").then_some("femur");
            Layer { name: name.into(), mesh: Some(key), colour: BONE, opacity, on: true, moves, ..Layer::default() }
        })
        .collect()
}

fn bones(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let surfaces = &v.bones.as_ref()?.surfaces;
    Some(Scene {
        id: "bones".into(),
        title: "Rigid bones".into(),
        text: format!(
            "The rigid bone surfaces: femur of {} triangles, tibia with fibula of {}, shown with edges of about {CONTEXT_MM} mm. Right when closed, without spikes or steps, and nothing is missing.",
            surfaces.femur.triangles.len(),
            surfaces.tibfib.triangles.len()
        ),
        from: "front",
        layers: bone_layers(v, pool, 1.0),
        moves: false,
    })
}

fn cartilage(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let cartilage = v.cartilage.as_ref()?;
    let (mut layers, mut words) = (bone_layers(v, pool, 1.0), String::new());
    layers.iter_mut().for_each(|l| l.on = false);
    for (name, s) in cartilage.solids.named() {
        let key = format!("cartilage {name}");
        let (mesh, means) = thinned(&s.solid, &[&s.thickness_mm], 0.7);
        pool.keep(&key, &mesh);
        let most = s.thickness_mm.iter().copied().fold(0.0, f64::max);
        words += &format!(" {}: {:.0} mm3, at most {most:.1} mm thick.", plain(name), s.solid.volume());
        layers.push(Layer {
            name: format!("{} cartilage", plain(name)),
            mesh: Some(key),
            opacity: 1.0,
            scalar: Some(Scalar {
                values: packed_values(&means[0], 0.0, 4.0),
                low: 0.0,
                high: 4.0,
                title: "thickness mm",
                scale: "thickness",
                cells: false,
            }),
            on: true,
            ..Layer::default()
        });
    }
    Some(Scene {
        id: "cartilage".into(),
        title: "Cartilage thickness".into(),
        text: format!(
            "Closed cartilage solids coloured by thickness, 0 to 4 mm.{words} Right when thickest in the middle of the contact areas and thinning to the rim without holes."
        ),
        from: "front",
        layers,
        moves: false,
    })
}

fn frames(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let f = v.frames.as_ref()?;
    let mut layers = bone_layers(v, pool, 0.55);
    for (name, frame) in [("femur", &f.femur), ("tibia", &f.tibia)] {
        let ends = |frame: &AnatomicalFrame| {
            [
                (frame.medial, "medial", "#c8102e"),
                (frame.anterior, "anterior", "#1a7f37"),
                (frame.superior, "superior", "#1f4fd8"),
            ]
        };
        for (axis, word, colour) in ends(frame) {
            let tip = frame.origin + axis * 70.0;
            layers.push(Layer {
                name: format!("{name} {word}"),
                colour,
                lines: vec![at(pool, &frame.origin), at(pool, &tip)],
                opacity: 1.0,
                on: true,
                ..Layer::default()
            });
        }
    }
    let (middle, along) = f.condylar_axis;
    layers.push(Layer {
        name: "condylar axis".into(),
        colour: "#7b3fa0",
        lines: vec![at(pool, &(middle - along * 45.0)), at(pool, &(middle + along * 45.0))],
        opacity: 1.0,
        on: true,
        ..Layer::default()
    });
    layers.push(Layer {
        name: "epicondyles".into(),
        colour: "#e69f00",
        points: f.epicondyles.iter().map(|p| at(pool, p)).collect(),
        labels: vec!["medial epicondyle".into(), "lateral epicondyle".into()],
        opacity: 1.0,
        on: true,
        ..Layer::default()
    });
    let p = &f.gs_ct_pose;
    Some(Scene {
        id: "frames".into(),
        title: "Frames and axes".into(),
        text: format!(
            "Anatomical frames (medial red, anterior green, superior blue), condylar axis (radius {:.1} mm, {:.1} deg from the epicondyles) and epicondyles. Pose in CT: flexion {:.1}, valgus {:.1}, external {:.1} deg; lateral {:.1}, anterior {:.1}, superior {:.1} mm. Right when red points to the midline, green forwards, blue to the hip.",
            f.condylar_radius_mm, f.condylar_angle_deg, p.fe_deg, p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm
        ),
        from: "front",
        layers,
        moves: false,
    })
}

fn attachments(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let a = v.attachments.as_ref()?;
    let mut layers = bone_layers(v, pool, 1.0);
    let names: std::collections::BTreeSet<&str> = a.fibres.iter().map(|f| f.bundle.as_str()).collect();
    for name in names {
        let of_bundle: Vec<_> = a.fibres.iter().filter(|f| f.bundle == name).collect();
        let source = of_bundle[0].source;
        layers.push(Layer {
            name: format!("{name} ({})", word(source)),
            colour: match source {
                attachments::site::Source::Marked => "#c8102e",
                attachments::site::Source::Literature => "#1f4fd8",
                attachments::site::Source::Given => "#1a7f37",
            },
            lines: of_bundle.iter().flat_map(|f| [at(pool, &f.femur), at(pool, &f.tibia)]).collect(),
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
    }
    layers.push(Layer {
        name: "sites: regions".into(),
        colour: "#111111",
        points: a.sites.iter().flat_map(|s| s.region.iter().map(|p| at(pool, p)).collect::<Vec<_>>()).collect(),
        opacity: 1.0,
        on: true,
        ..Layer::default()
    });
    layers.push(Layer {
        name: "sites: middles, named".into(),
        colour: "#e69f00",
        points: a.sites.iter().map(|s| at(pool, &s.centroid)).collect(),
        labels: a
            .sites
            .iter()
            .map(|s| format!("{} {} ({})", s.ligament, plain(&format!("{:?}", s.bone).to_lowercase()), word(s.source)))
            .collect(),
        opacity: 1.0,
        on: true,
        ..Layer::default()
    });
    layers.extend(marks(v, pool));
    let count = |source| a.sites.iter().filter(|s| s.source == source).count();
    Some(Scene {
        id: "attachments".into(),
        title: "Marks, sites and fibres".into(),
        text: format!(
            "{} fibres between {} sites: {} marked on the specimen (red), {} placed from the literature (blue), {} given (green). Right when every region lies on its mark and no fibre passes through bone.",
            a.fibres.len(),
            a.sites.len(),
            count(attachments::site::Source::Marked),
            count(attachments::site::Source::Literature),
            count(attachments::site::Source::Given)
        ),
        from: "behind",
        layers,
        moves: false,
    })
}

/// The marks as they were measured, on the registered bones.
fn marks(v: &Values, pool: &Pool) -> Option<Layer> {
    let (specimen, registration) = (v.specimen.as_ref()?, v.registration.as_ref()?);
    if specimen.marks.is_empty() {
        return None;
    }
    let place = |m: &stages::ingest::NamedPoint| match m.frame {
        stages::ingest::PointFrame::Ct => m.point,
        stages::ingest::PointFrame::ScanFemur => registration.bones.femur.ct_from_scan.point(&m.point),
        stages::ingest::PointFrame::ScanTibfib => registration.bones.tibfib.ct_from_scan.point(&m.point),
    };
    Some(Layer {
        name: "marks as measured".into(),
        colour: "#e69f00",
        points: specimen.marks.iter().map(|m| at(pool, &place(m))).collect(),
        labels: specimen.marks.iter().map(|m| m.name.clone()).collect(),
        opacity: 1.0,
        on: false,
        ..Layer::default()
    })
}

fn hexahedra(id: &str, meshes: &PerCartilage<HexMesh>, pool: &mut Pool) -> Scene {
    let (mut layers, mut words) = (Vec::new(), String::new());
    for (name, mesh) in meshes.named() {
        let (shell, elements) = shell(mesh);
        let quality: Vec<f64> = (0..mesh.elements.len()).map(|e| mesh.scaled_jacobian(e)).collect();
        let key = format!("{id} {name}");
        pool.keep(&key, &shell);
        let values: Vec<f64> = elements.iter().map(|e| quality[*e as usize]).collect();
        let least = quality.iter().copied().fold(1.0, f64::min);
        words += &format!(" {}: {} elements, the worst {least:.2}.", plain(name), quality.len());
        layers.push(Layer {
            name: format!("{} hexahedra", plain(name)),
            mesh: Some(key),
            opacity: 1.0,
            scalar: Some(Scalar {
                values: packed_values(&values, 0.0, 1.0),
                low: 0.0,
                high: 1.0,
                title: "scaled Jacobian",
                scale: "quality",
                cells: true,
            }),
            on: true,
            ..Layer::default()
        });
    }
    Scene {
        id: id.into(),
        title: "Hexahedra by scaled Jacobian".into(),
        text: format!(
            "The outside of the hexahedral cartilage, every element coloured by its scaled Jacobian: 1 is a cube, 0 or less is inverted.{words} Right when nothing is dark but single elements at the rim."
        ),
        from: "front",
        layers,
        moves: false,
    }
}

/// Outer faces as triangles on the mesh's own nodes, and the element of each.
fn shell(mesh: &HexMesh) -> (TriMesh, Vec<u32>) {
    let mut count: BTreeMap<[u32; 4], u32> = BTreeMap::new();
    let key = |mut face: [u32; 4]| {
        face.sort_unstable();
        face
    };
    let faces_of = |e: &[u32; 8]| FACES.map(|f| f.map(|k| e[k]));
    mesh.elements.iter().flat_map(faces_of).for_each(|f| *count.entry(key(f)).or_default() += 1);
    let (mut triangles, mut elements) = (Vec::new(), Vec::new());
    for (e, element) in mesh.elements.iter().enumerate() {
        for [a, b, c, d] in faces_of(element).into_iter().filter(|f| count[&key(*f)] == 1) {
            triangles.extend([[a, b, c], [a, c, d]]);
            elements.extend([e as u32; 2]);
        }
    }
    let (shell, _) = TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true);
    (shell, elements)
}

fn overclosure(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let (before, after) = (v.hexes.as_ref()?, v.separated.as_ref()?);
    let (mut layers, mut words) = (Vec::new(), String::new());
    for (when, meshes) in [("before", &before.meshes), ("after", &after.meshes)] {
        let femur = ContactFace::new(&meshes.femur.nodes, &meshes.femur.articular_quads)?;
        for (name, mesh) in [("tibia_medial", &meshes.tibia_medial), ("tibia_lateral", &meshes.tibia_lateral)] {
            let triangles = mesh.articular_quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
            let (face, _) = TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true);
            let gaps: Vec<f64> = face.vertices.iter().map(|p| femur.gap(p).map_or(2.0, |g| g.gap)).collect();
            let least = gaps.iter().copied().fold(2.0, f64::min);
            words += &format!(" {} {when}: {least:.2} mm.", plain(name));
            let key = format!("gap {when} {name}");
            pool.keep(&key, &face);
            layers.push(Layer {
                name: format!("{}: gap {when}", plain(name)),
                mesh: Some(key),
                opacity: 1.0,
                scalar: Some(Scalar {
                    values: packed_values(&gaps, -2.0, 2.0),
                    low: -2.0,
                    high: 2.0,
                    title: "gap mm",
                    scale: "gap",
                    cells: false,
                }),
                on: when == "after",
                one_of: Some(if name == "tibia_medial" { "medial" } else { "lateral" }),
                ..Layer::default()
            });
        }
    }
    layers.extend(hexahedra("overclosure", &after.meshes, pool).layers.into_iter().map(|l| Layer {
        on: false,
        name: format!("{} after", l.name),
        ..l
    }));
    Some(Scene {
        id: "overclosure".into(),
        title: "Overclosure before and after".into(),
        text: format!(
            "Tibial articular faces coloured by the gap to the femoral face: red where they overlap (below 0), blue where they are apart; 2 mm stands for farther. Smallest gaps:{words} Right when nothing is red after."
        ),
        from: "above",
        layers,
        moves: false,
    })
}

/// The assembled knee; `fibres` are coloured by force as it moves.
pub(super) fn knee(v: &Values, pool: &mut Pool, moves: bool) -> Option<Scene> {
    let assembled = v.assembled.as_ref()?;
    let mut layers = bone_layers(v, pool, 1.0);
    for (name, mesh) in assembled.contact.named() {
        let key = format!("contact {name}");
        pool.keep(&key, &thinned(mesh, &[], 1.2).0);
        let moves = (name == "femur").then_some("femur");
        layers.push(Layer {
            name: format!("{} cartilage", plain(name)),
            mesh: Some(key),
            colour: "#7fb0d8",
            opacity: 1.0,
            on: true,
            moves,
            ..Layer::default()
        });
    }
    let fibres = &assembled.spec.fibres;
    layers.push(Layer {
        name: "fibres".into(),
        colour: "#c8102e",
        lines: fibres.iter().flat_map(|f| [at(pool, &f.femur), at(pool, &f.tibia)]).collect(),
        opacity: 1.0,
        on: true,
        moves: Some("fibres"),
        ..Layer::default()
    });
    Some(Scene {
        id: "knee".into(),
        title: if moves { "The knee in motion" } else { "The assembled knee" }.into(),
        text: format!(
            "The assembled knee: {} bundles of {} fibres, {} contact pairs{}. The tibia stands still, the femur moves.",
            assembled.spec.bundles.len(),
            fibres.len(),
            assembled.spec.contact.pairs.len(),
            if moves {
                "; the slider moves it through passive flexion, AP laxity and pivot shift, its fibres coloured by force"
            } else {
                ", as in CT"
            }
        ),
        from: "front",
        layers,
        moves,
    })
}

fn at(pool: &Pool, p: &Point) -> [f64; 3] {
    let p = pool.point(p);
    [p.x, p.y, p.z].map(|x| rounded(x, 100.0))
}

fn plain(name: &str) -> &str {
    match name {
        "tibia_medial" => "medial tibia",
        "tibia_lateral" => "lateral tibia",
        other => other,
    }
}

fn word(source: attachments::site::Source) -> &'static str {
    match source {
        attachments::site::Source::Marked => "marked",
        attachments::site::Source::Literature => "literature",
        attachments::site::Source::Given => "given",
    }
}

/// What the failed stage was given, with the places that the message names as `(x, y, z)`.
pub(super) fn failed(failure: &super::Failure, v: &Values, pool: &mut Pool) -> Option<Scene> {
    let mut layers = bone_layers(v, pool, 0.6);
    if layers.is_empty() {
        for (name, mesh) in v.specimen.as_ref()?.ct.named() {
            let key = format!("ct {name}");
            pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
            layers.push(Layer {
                name: format!("{name}: CT bone"),
                mesh: Some(key),
                colour: BONE,
                opacity: 0.6,
                on: true,
                ..Layer::default()
            });
        }
    }
    for (name, s) in v.cartilage.iter().flat_map(|c| c.solids.named()) {
        let key = format!("cartilage {name}");
        pool.keep(&key, &thinned(&s.solid, &[], 0.7).0);
        layers.push(Layer {
            name: format!("{} cartilage", plain(name)),
            mesh: Some(key),
            colour: "#7fb0d8",
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
    }
    let named = places(&failure.message);
    let count = named.len();
    if count > 0 {
        layers.push(named_places("places that the message names", &named, pool));
    }
    Some(Scene {
        id: "failed".into(),
        title: format!("What {} was given", failure.stage),
        text: format!(
            "The surfaces that the stage worked on{}.",
            if count > 0 { ", with the places that the message names in red" } else { "; its message names no place" }
        ),
        from: "front",
        layers,
        moves: false,
    })
}

fn named_places(name: &str, places: &[Point], pool: &Pool) -> Layer {
    Layer {
        name: name.into(),
        colour: "#c8102e",
        points: places.iter().map(|p| at(pool, p)).collect(),
        labels: places.iter().map(|p| format!("({:.1}, {:.1}, {:.1}) in CT", p.x, p.y, p.z)).collect(),
        opacity: 1.0,
        on: true,
        ..Layer::default()
    }
}

/// Points written as `(x, y, z)`.
fn places(text: &str) -> Vec<Point> {
    text.split('(')
        .skip(1)
        .filter_map(|rest| {
            let inside = rest.split_once(')')?.0;
            let numbers: Vec<f64> = inside.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
            match numbers[..] {
                [x, y, z] if [x, y, z].iter().all(|n: &f64| n.is_finite()) => Some(Point::new(x, y, z)),
                _ => None,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_from_a_message() {
        assert_eq!(places("edge at (1.5, -2, 3) and (a, b, c), (1, 2)"), vec![Point::new(1.5, -2.0, 3.0)]);
    }
}
