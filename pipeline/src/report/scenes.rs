//! The scenes of the report: for every stage the surfaces, lines and points by which one sees whether it is right.

use super::bone_layers::{BONE, CONTEXT_MM, bone_layers};
use super::cartilage_scenes::{cartilage, hexahedra, overclosure};
use super::geometry::{Pool, packed_values, thinned};
use super::scene::{Layer, Scalar, Scene, at, named_in, named_places, places, plain, word};
use super::values::Values;
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use stages::specimen::Specimen;

const SCAN_MM: f64 = 0.9;

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
    let patella = registration.patella.as_ref().zip(specimen.patella.as_ref().and_then(|p| p.scan.as_ref()));
    let bones = registration.bones.named().into_iter().zip(specimen.scans.named()).map(|((n, b), (_, s))| (n, b, s));
    for (name, bone, scan) in bones.chain(patella.map(|(bone, scan)| ("patella", bone, scan))) {
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
                one_of: Some(name),
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
    layers.extend(ct_layers(specimen, pool, 1.0, false));
    Some(Scene {
        id: "register".into(),
        title: "Scans on their bones".into(),
        text: format!(
            "Each scan laid on its CT bone, coloured by its distance to the bone: about 0 mm on bare bone, 1 to 4 mm where cartilage lies between.{words} The other map shows which part was taken for bare bone. Bare bone must be of one colour, and the mask must hold no edge of cartilage."
        ),
        from: "front",
        layers,
        moves: false,
    })
}

/// The CT bones, a layer each.
fn ct_layers(specimen: &Specimen, pool: &mut Pool, opacity: f64, on: bool) -> Vec<Layer> {
    specimen
        .ct
        .named()
        .into_iter()
        .map(|(name, mesh)| {
            let key = format!("ct {name}");
            pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
            Layer { name: format!("{name}: CT bone"), mesh: Some(key), colour: BONE, opacity, on, ..Layer::default() }
        })
        .collect()
}

fn bones(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let surfaces = &v.bones.as_ref()?.surfaces;
    Some(Scene {
        id: "bones".into(),
        title: "Rigid bones".into(),
        text: format!(
            "The rigid bone surfaces: femur of {} triangles, tibia with fibula of {}, shown with edges of about {CONTEXT_MM} mm. Both must be closed, without spikes or steps, and complete.",
            surfaces.femur.triangles.len(),
            surfaces.tibfib.triangles.len()
        ),
        from: "front",
        layers: bone_layers(v, pool, 1.0),
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
            "Anatomical frames (medial red, anterior green, superior blue), condylar axis (radius {:.1} mm, {:.1} deg from the epicondyles) and epicondyles. Pose in CT: flexion {:.1}, valgus {:.1}, external {:.1} deg; lateral {:.1}, anterior {:.1}, superior {:.1} mm. Red must point to the midline, green forwards, blue to the hip.",
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
            "{} fibres between {} sites: {} marked on the specimen (red), {} placed from the literature (blue), {} given (green). Every region must lie on its mark. No fibre may pass through bone.",
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
    let place = |m: &stages::specimen::NamedPoint| match m.frame {
        stages::specimen::PointFrame::Ct => m.point,
        stages::specimen::PointFrame::ScanFemur => registration.bones.femur.ct_from_scan.point(&m.point),
        stages::specimen::PointFrame::ScanTibfib => registration.bones.tibfib.ct_from_scan.point(&m.point),
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
            "The assembled knee: {} bundles of {} fibres, {} contact pairs{}.",
            assembled.spec.bundles.len(),
            fibres.len(),
            assembled.spec.contact.pairs.len(),
            if moves {
                "; the slider moves it through passive flexion, AP laxity and pivot shift, its fibres coloured by force; the tibia stands still"
            } else {
                ", as in CT"
            }
        ),
        from: "front",
        layers,
        moves,
    })
}

/// What the failed stage was given, with the places that the message names as `(x, y, z)`.
pub(super) fn failed(failure: &crate::record::Failure, v: &Values, pool: &mut Pool) -> Option<Scene> {
    let mut layers = bone_layers(v, pool, 0.6);
    if layers.is_empty() {
        layers.extend(ct_layers(v.specimen.as_ref()?, pool, 0.6, true));
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
    let named = named_in(&failure.message);
    let count = named.len();
    if count > 0 {
        let points: Vec<Point> = named.iter().map(|n| n.1).collect();
        let mut layer = named_places("places that the message names", &points, pool);
        for (label, (name, _)) in layer.labels.iter_mut().zip(&named).filter(|(_, (name, _))| !name.is_empty()) {
            *label = format!("{name} {label}");
        }
        layers.push(layer);
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
