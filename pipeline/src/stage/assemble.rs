//! Stage 9, assemble: the model.

use super::artifacts::surface;
use super::attachments::fibre_tubes;
use super::calibrate::Calibration;
use super::hexahedra::quality_shell;
use super::layers::bone_layers;
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::check::{Check, KeyFigure};
use crate::report::geometry::{Pool, thinned};
use crate::report::picture::{BONE, Picture, picture};
use crate::report::scene::{Layer, Scene, at, plain};
use crate::validate::Validation;
use attachments::groups::GROUPS;
use meshes::render::Painted;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use sim::coordinate::FREE;
use sim::laxity::LaxityTrial;
use sim::menisci::hexahedra;
use sim::spec::ModelSpec;
use stages::StageError;
use stages::assemble::{AssembleOptions, Assembled, OwnLaw, assemble};
use stages::attachments::Attachments;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use stages::contact_law::ContactLaw;
use stages::frames::Frames;
use stages::menisci::MeniscusMetrics;
use stages::overclosure::Separated;
use stages::specimen::Specimen;

reported!(Assembled);

/// The stage.
pub(crate) struct Assemble;

impl Stage for Assemble {
    const NUMBER: &'static str = "09";
    const NAME: &'static str = "assemble";
    const TELLING: &'static [&'static str] = &["bundles", "fibres", "segmented_menisci"];
    /// The contact law is left out where none was fitted: that of the options stands.
    type Inputs<'a> = (
        &'a Kept<Specimen>,
        &'a Kept<Bones>,
        &'a Kept<Cartilage>,
        &'a Kept<Frames>,
        &'a Kept<Attachments>,
        &'a Kept<Separated>,
        Option<&'a Kept<ContactLaw>>,
    );
    type Options = AssembleOptions;
    type Value = Assembled;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &AssembleOptions {
        &all.assemble
    }

    fn run(
        (s, b, c, f, a, h, law): Self::Inputs<'_>,
        options: &AssembleOptions,
        _: &Work,
    ) -> Result<Assembled, StageError> {
        assemble((s, b, c), f, a, h, law.map(|l| OwnLaw::from(&**l)), options)
    }

    /// model.json and the contact surfaces it names.
    fn artifacts(a: &Assembled, _: Self::Inputs<'_>) -> Files {
        let mut files = vec![("model.json".into(), json(&a.spec))];
        for (name, mesh) in a.contact.named() {
            files.push((format!("contact/{name}.ply"), surface(mesh, &[])?));
        }
        for (name, mesh) in a.bony.iter().flat_map(|b| b.named()) {
            files.push((format!("contact/{name}_bony.ply"), surface(mesh, &[])?));
        }
        if let Some(patella) = &a.patella {
            files.push(("contact/patella.ply".into(), surface(&patella.face, &[])?));
            files.push(("contact/patella_ground.ply".into(), surface(&patella.ground, &[])?));
            if let Some(seen) = &patella.seen {
                files.push(("contact/patella_seen.ply".into(), surface(seen, &[])?));
            }
        }
        Ok(files)
    }

    /// The assembled knee; `fibres` are coloured by force as it moves.
    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let assembled = v.of::<Assembled>()?;
        let moves = v.moves;
        let mut layers = bone_layers(v, pool, 1.0);
        for (name, mesh) in assembled.contact.named() {
            let (key, thin) = contact_surface(name, mesh);
            pool.keep(&key, &thin);
            layers.push(Layer {
                presses: moves.then_some(if name == "tibia_medial" { "with scale" } else { "alone" }),
                name: format!("{} cartilage", plain(name)),
                mesh: Some(key),
                colour: "#7fb0d8",
                opacity: 1.0,
                on: true,
                moves: (name == "femur").then_some("femur"),
                ..Layer::default()
            });
        }
        for m in &assembled.spec.menisci {
            let key = format!("acting {}", m.name);
            pool.keep(&key, &quality_shell(&hexahedra(m)).0);
            layers.push(Layer {
                name: m.name.replace('_', " "),
                mesh: Some(key),
                colour: "#e0c060",
                opacity: 1.0,
                on: true,
                ..Layer::default()
            });
        }
        let main = v.of::<Calibration>().and_then(Calibration::main).map(|(_, o)| &o.spec);
        let spec = main.unwrap_or(&assembled.spec);
        let fibres = &spec.fibres;
        layers.extend(fibre_layers(spec, pool));
        let was_measured = moves && are_poses_measured(v);
        layers.extend(was_measured.then(|| measured_femur(&layers)).flatten());
        Some(Scene {
            id: "knee".into(),
            title: if moves { "The knee in motion" } else { "The assembled knee" }.into(),
            text: format!(
                "{}: {} bundles of {} fibres, {} contact pairs{}.",
                if main.is_some() { "The calibrated knee" } else { "The assembled knee" },
                assembled.spec.bundles.len(),
                fibres.len(),
                assembled.spec.contact.pairs.len(),
                match (moves, was_measured) {
                    (true, true) =>
                        "; Play or the slider moves it through passive flexion, drawers, pivot shift and the measured loads. Fibres are coloured by force, cartilage by contact pressure; where a pose was measured, \"femur as measured\" shows it there, in green. The tibia stands still",
                    (true, false) =>
                        "; Play or the slider moves it through passive flexion, drawers and pivot shift. Fibres are coloured by force, cartilage by contact pressure. No whole pose was measured. The tibia stands still",
                    (false, _) => ", as in CT",
                }
            ),
            from: "front",
            layers,
            moves,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (bones, frames) = (v.of::<Bones>()?, v.of::<Frames>()?);
        let (attachments, separated) = (v.of::<Attachments>()?, v.of::<Separated>()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        parts.extend(separated.meshes.named().map(|(_, mesh)| (quality_shell(mesh).0, [120, 170, 220])));
        let menisci = v.of::<Assembled>().into_iter().flat_map(|a| &a.spec.menisci);
        parts.extend(menisci.map(|m| (quality_shell(&hexahedra(m)).0, [224, 192, 96])));
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
            .map(|(from, eye)| picture(&painted, eye, f.superior, format!("The assembled knee from {from}")))
            .into_iter()
            .collect(),
        )
    }

    fn key_figure(v: &Values) -> Option<KeyFigure> {
        let uncalibrated = v.of::<Assembled>().is_some() && v.of::<Calibration>().is_none();
        uncalibrated.then(|| KeyFigure {
            name: "ligaments have the literature's parameters",
            value: "not calibrated".into(),
            limit: "measured laxity calibrates them".into(),
            good: None,
        })
    }

    fn checks(v: &Values) -> Vec<Check> {
        whose_law(v).into_iter().chain(whose_menisci(v)).collect()
    }
}

/// A contact surface as the page has it, with its key.
pub(crate) fn contact_surface(name: &str, mesh: &TriMesh) -> (String, TriMesh) {
    (format!("contact {name}"), thinned(mesh, &[], 1.2).0)
}

/// The fibres, and the names of the ligaments beside them.
pub(crate) fn fibre_layers(spec: &ModelSpec, pool: &Pool) -> [Layer; 2] {
    let fibres = &spec.fibres;
    let lines = fibres.iter().flat_map(|f| [at(pool, &f.femur), at(pool, &f.tibia)]).collect();
    let (mut middles, mut labels) = (Vec::new(), Vec::new());
    for (name, bundles) in GROUPS {
        let of: Vec<_> = fibres.iter().filter(|f| bundles.contains(&f.bundle.as_str())).collect();
        if of.is_empty() {
            continue;
        }
        let mean = |ends: Vec<Point>| {
            let sum = ends.iter().fold(Vector::zeros(), |sum, p| sum + p.coords);
            at(pool, &Point::from(sum / ends.len() as f64))
        };
        middles.extend([mean(of.iter().map(|f| f.femur).collect()), mean(of.iter().map(|f| f.tibia).collect())]);
        labels.push(name.to_owned());
    }
    let common = || Layer { opacity: 1.0, on: true, ..Layer::default() };
    [
        Layer { name: "fibres".into(), colour: "#c8102e", lines, moves: Some("fibres"), ..common() },
        Layer { name: "names".into(), colour: "#222222", lines: middles, labels, moves: Some("names"), ..common() },
    ]
}

/// Whether any whole pose was measured, under a load or in passive flexion: displacements alone place no bone.
fn are_poses_measured(v: &Values) -> bool {
    let is_pose = |t: &LaxityTrial| t.reference.is_none() && FREE.into_iter().all(|c| t.measured[c].is_some());
    let main = v.of::<Calibration>().and_then(Calibration::main);
    main.is_some_and(|(_, o)| o.trials.iter().any(is_pose))
        || v.of::<Validation>().is_some_and(|validation| !validation.passive.is_empty())
}

/// The femur where it was measured, over the simulated one.
fn measured_femur(layers: &[Layer]) -> Option<Layer> {
    let mesh = layers.iter().find(|l| l.name == "femur")?.mesh.clone();
    let name = "femur as measured".into();
    Some(Layer { name, mesh, colour: "#1a9850", opacity: 0.4, moves: Some("measured"), ..Layer::default() })
}

/// Whose cartilage the contact law is.
fn whose_law(v: &Values) -> Option<Check> {
    let contact = &v.of::<Assembled>()?.spec.contact;
    let published = &AssembleOptions::default();
    let answer = if let Some(l) = v.of::<ContactLaw>() {
        let by_thickness = l.layer.as_ref().filter(|_| contact.layer.is_some());
        let worst = by_thickness.map_or(l.fit_error_percent, |layer| layer.fit_error_percent);
        let kind = if by_thickness.is_some() { ", by its thickness" } else { "" };
        format!("this knee's: fitted to its own cartilage{kind}, forces within {worst:.1} %")
    } else if contact.layer.is_some() {
        "by the cartilages' own thickness, its material given in the options".to_owned()
    } else if (&contact.overclosure_mm, &contact.pressure_mpa) == (&published.overclosure_mm, &published.pressure_mpa) {
        "that published of S192803; contact-law.fit=true fits one to the knee at hand".to_owned()
    } else {
        "the one given in the options".to_owned()
    };
    Some(Check {
        question: "Whose contact law is it?",
        answer,
        good: None,
        reaches: None,
        model: None,
        stage: Assemble::NAME,
    })
}

/// Whose shape the menisci have, where they act.
fn whose_menisci(v: &Values) -> Option<Check> {
    let metrics = &v.of::<Assembled>()?.metrics.menisci;
    let one = |m: &MeniscusMetrics| {
        let shape = match m.segmented_mm3 {
            Some(given) => format!("the segmentation's, {:.0} mm3 of {given:.0} mm3", m.volume_mm3),
            None => "the atlas', fitted to this knee".to_owned(),
        };
        format!("{}: {shape}", plain(&m.name))
    };
    let answer = metrics.iter().map(one).collect::<Vec<_>>().join("; ");
    (!metrics.is_empty()).then_some(Check {
        question: "Whose shape have the menisci?",
        answer,
        good: None,
        reaches: None,
        model: None,
        stage: Assemble::NAME,
    })
}
