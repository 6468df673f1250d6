//! A model as a complete Abaqus/Explicit deck that [`super::import`] reads back to the same model.

mod menisci;
mod parts;

use crate::names::written_names;
use crate::programs;
use meshes::frame::Side;
use notices::{Kind, Notice};
use sim::SimError;
use sim::deck::{Amplitude, ChainCoordinate, Control, ControlKind, Curve, DeckProtocol, DeckStep};
use sim::joint::Joint;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Files of a deck and what it could not carry.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedDeck {
    /// File name and text; one main file a protocol, then what they include.
    pub files: Vec<(String, String)>,
    /// The main files' names.
    pub mains: Vec<String>,
    /// What a deck cannot express.
    pub warnings: Vec<Notice>,
}

/// Writes `spec` as an Abaqus deck; `meshes` by the paths that `spec` names.
///
/// Bones and contact faces become rigid triangles (R3D3), cartilage C3D8R or C3D4; a cartilage mesh that is not given is
/// left out with a warning, since contact does not need it. The main files are the model's own protocols; where it has none, settling under 20 N
/// and flexion to 30 deg. After them come the paper's protocols: AP laxity at each flexion, passive flexion, pivot shift.
///
/// # Errors
/// A bone or contact face that is not given or is no surface; frames that make no joint; amplitudes of one name that differ.
pub fn export(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<ExportedDeck, SimError> {
    export_with(spec, meshes, &[])
}

/// [`export`] with a main file more for each of the trials: settled, then flexed and loaded as the trial says.
///
/// # Errors
/// As [`export`].
pub fn export_with(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    trials: &[LaxityTrial],
) -> Result<ExportedDeck, SimError> {
    let mut warnings = Vec::new();
    let spec = &renamed(spec, &mut warnings);
    let joint = Joint::new(&spec.frames, spec.side)?;
    let geometry = parts::geometry(spec, meshes, &mut warnings)?;
    let mut files = vec![
        ("geometry.inp".to_owned(), geometry.meshes()),
        ("bodies.inp".to_owned(), geometry.bodies),
        ("joint.inp".to_owned(), parts::joint(spec, &joint)),
        ("ligaments.inp".to_owned(), parts::ligaments(spec)?),
        ("contact.inp".to_owned(), parts::contact(spec)),
    ];
    if !spec.menisci.is_empty() {
        files.push(("menisci.inp".to_owned(), menisci::parts(spec)));
        files.push(("menisci_contact.inp".to_owned(), menisci::contact(spec)));
        warnings.push(Kind::NotInFormat.notice(
            "menisci are deformable in the deck; their coronary ligament is left out, and an import leaves them out",
        ));
    }
    if !spec.components.is_empty() {
        warnings.push(
            Kind::ComponentsLeftOut
                .notice(format!(
                    "{} added components have no counterpart in the deck; they are left out",
                    spec.components.len()
                ))
                .count(spec.components.len()),
        );
    }
    let mut mains: Vec<String> = Vec::new();
    for protocol in all_protocols(spec, &joint, trials) {
        let name = free_name(&file_stem(&protocol.name), &mains);
        files.push((name.clone(), main_file(spec, &protocol)?));
        mains.push(name);
    }
    warnings.extend(without_quadriceps(trials, "decks are without it, as no deck has a patella"));
    warnings.extend(of_a_cut_knee(trials, "decks"));
    Ok(ExportedDeck { files, mains, warnings })
}

/// The model with its bundles called as a deck can call them: Abaqus reads commas, brackets and stars as its own, and takes no heed of case.
fn renamed(spec: &ModelSpec, warnings: &mut Vec<Notice>) -> ModelSpec {
    let names = written_names(spec, |c| c.is_ascii_alphanumeric() || c == '_');
    let name = |ours: &String| names.get(ours).unwrap_or(ours).clone();
    let mut out = spec.clone();
    out.bundles.iter_mut().for_each(|b| b.name = name(&b.name));
    out.fibres.iter_mut().for_each(|f| f.bundle = name(&f.bundle));
    out.toe_end_multiple = spec.toe_end_multiple.iter().map(|(key, value)| (name(key), *value)).collect();
    let changed: Vec<String> =
        names.iter().filter(|(a, b)| a != b).map(|(a, b)| format!("{a} is called {b}")).collect();
    if !changed.is_empty() {
        let text = format!("names of bundles that a deck cannot have: {}", changed.join(", "));
        warnings.push(Kind::NotInFormat.notice(text).count(changed.len()));
    }
    out
}

/// The model's own protocols or the one for a model that brings none, those of the paper that it does not bring itself, then the trials.
pub(crate) fn all_protocols(spec: &ModelSpec, joint: &Joint, trials: &[LaxityTrial]) -> Vec<DeckProtocol> {
    let own = if spec.protocols.is_empty() { vec![settle_and_flex(spec, joint)] } else { spec.protocols.clone() };
    let of_the_paper = programs::of_the_paper(spec, joint);
    let brought = |name: &str| own.iter().any(|p| file_stem(&p.name).eq_ignore_ascii_case(&file_stem(name)));
    let more: Vec<DeckProtocol> = of_the_paper.into_iter().filter(|p| !brought(&p.name)).collect();
    let of_trials = trials.iter().map(|t| programs::of_trial(spec, joint, t));
    own.iter().cloned().chain(more).chain(of_trials).collect()
}

/// A main file's name that none has yet, whatever the case of its letters: "a b" and "A/B" are one name for a file system.
pub(crate) fn free_name(stem: &str, taken: &[String]) -> String {
    let is_free = |name: &String| !taken.iter().any(|t| t.eq_ignore_ascii_case(name));
    let numbered = (2..).map(|n| format!("{stem}_{n}.inp"));
    std::iter::once(format!("{stem}.inp")).chain(numbered).find(is_free).unwrap_or_default()
}

/// What is said of trials in which the quadriceps pull, and of their files: no other program's file has that pull.
pub fn without_quadriceps(trials: &[LaxityTrial], files: &str) -> Option<Notice> {
    let pulled = trials.iter().filter(|t| t.quadriceps_n != 0.0).count();
    let text = format!("{pulled} trials have a pull of the quadriceps; their {files}");
    (pulled > 0).then(|| Kind::NotInFormat.notice(text).count(pulled))
}

/// What is said of trials of a cut knee, and of their `files`: those have the whole one.
pub fn of_a_cut_knee(trials: &[LaxityTrial], files: &str) -> Option<Notice> {
    let cut: Vec<&LaxityTrial> = trials.iter().filter(|t| !t.without.is_empty()).collect();
    let names = cut.first()?.without.join(" and ");
    let text = format!("{} trials are of a knee without {names}; their {files} have the whole knee", cut.len());
    Some(Kind::NotInFormat.notice(text).count(cut.len()))
}

/// The number in at most 20 characters, Abaqus' limit: shortest exact where that fits.
fn number(x: f64) -> String {
    let exact = format!("{x:?}");
    if exact.len() <= 20 {
        return exact;
    }
    let scientific = format!("{x:e}");
    if scientific.len() <= 20 { scientific } else { format!("{x:.12e}") }
}

pub(crate) fn file_stem(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || "_-.".contains(c) { c } else { '_' }).collect()
}

/// A protocol for a model that brings none.
fn settle_and_flex(spec: &ModelSpec, joint: &Joint) -> DeckProtocol {
    let turn = if spec.side == Side::Left { -1.0 } else { 1.0 };
    let flex = turn * (30f64.to_radians() - joint.ct_pose()[0]);
    let ramp = |name: &str| {
        Some(Amplitude {
            name: name.into(),
            curve: Curve::SmoothStep,
            points: vec![[0.0, 0.0], [0.7, 1.0], [1.0, 1.0]],
        })
    };
    let control = |coordinate, kind, magnitude, amplitude| Control { coordinate, kind, magnitude, amplitude };
    let step = |name: &str, controls| DeckStep {
        name: name.into(),
        duration_s: 1.0,
        increment_s: Some(1e-4),
        contact: true,
        controls,
    };
    DeckProtocol {
        name: format!("{}_settle_flex", spec.id),
        lost_half_increment: true,
        steps: vec![
            step(
                "SETTLE",
                vec![
                    control(ChainCoordinate::Fe, ControlKind::Motion, 0.0, None),
                    control(ChainCoordinate::Si, ControlKind::Load, -20.0, ramp("SETTLE_RAMP")),
                ],
            ),
            step(
                "FLEX",
                vec![
                    control(ChainCoordinate::Fe, ControlKind::Motion, flex, ramp("FLEX_RAMP")),
                    control(ChainCoordinate::Si, ControlKind::Load, -20.0, None),
                ],
            ),
        ],
        quirks: Vec::new(),
    }
}

/// The file that is run: includes, amplitudes, steps.
fn main_file(spec: &ModelSpec, protocol: &DeckProtocol) -> Result<String, SimError> {
    let mut out = format!(
        "*HEADING\n{}\n** mm, N, s, tonne, MPa, rad\n",
        spec.id.replace(['\n', '\r', ',', '<', '>', '*'], " ").trim()
    );
    for quirk in &protocol.quirks {
        let _ = writeln!(out, "** {quirk}");
    }
    if protocol.quirks.iter().any(|q| q.starts_with("flexion base 0")) {
        out += "*PARAMETER\nTF_KIN_BASEMRI_CYLINDRICAL_FE=0.0\n";
    }
    out += "*INCLUDE, INPUT=geometry.inp\n*INCLUDE, INPUT=bodies.inp\n*INCLUDE, INPUT=joint.inp\n*INCLUDE, INPUT=ligaments.inp\n";
    if !spec.menisci.is_empty() {
        out += "*INCLUDE, INPUT=menisci.inp\n";
    }
    let controls = protocol.steps.iter().flat_map(|s| &s.controls);
    amplitudes(&mut out, controls.filter_map(|c| c.amplitude.as_ref()))?;
    let mut contact = false;
    for step in &protocol.steps {
        let _ = writeln!(out, "*STEP, NAME={}", step.name);
        match step.increment_s {
            Some(dt) => {
                let _ = writeln!(
                    out,
                    "*DYNAMIC, EXPLICIT, DIRECT USER CONTROL\n{}, {}",
                    number(dt),
                    number(step.duration_s)
                );
            }
            None => {
                let _ = writeln!(out, "*DYNAMIC, EXPLICIT\n, {}", number(step.duration_s));
            }
        }
        if step.contact && !contact {
            out += "*INCLUDE, INPUT=contact.inp\n";
            if !spec.menisci.is_empty() {
                out += "*INCLUDE, INPUT=menisci_contact.inp\n";
            }
            contact = true;
        }
        out += "*BOUNDARY, OP=NEW\n1, ENCASTRE\n";
        for (kind, keyword) in [(ControlKind::Motion, "MOTION"), (ControlKind::Load, "LOAD")] {
            if !step.controls.iter().any(|c| c.kind == kind) {
                let _ = writeln!(out, "*CONNECTOR {keyword}, OP=NEW");
            }
        }
        for c in &step.controls {
            let keyword = if c.kind == ControlKind::Motion { "MOTION" } else { "LOAD" };
            let amplitude = c.amplitude.as_ref().map_or(String::new(), |a| format!(", AMPLITUDE={}", a.name));
            let (axis, component) = axis_component(c.coordinate);
            let _ =
                writeln!(out, "*CONNECTOR {keyword}, OP=NEW{amplitude}\n{axis}, {component}, {}", number(c.magnitude));
        }
        out += "*OUTPUT, HISTORY, TIME INTERVAL=0.02\n*NODE OUTPUT, NSET=REF_FRAMES\nCOORD\n";
        out += "*ELEMENT OUTPUT, ELSET=FIBRES\nCU, CTF\n*END STEP\n";
    }
    Ok(out)
}

fn amplitudes<'a>(out: &mut String, all: impl Iterator<Item = &'a Amplitude>) -> Result<(), SimError> {
    let mut known: BTreeMap<String, &Amplitude> = BTreeMap::new();
    for a in all {
        if let Some(earlier) = known.insert(a.name.to_lowercase(), a) {
            if earlier != a {
                return Err(SimError::Spec(format!(
                    "protocols: two amplitudes named \"{}\" differ; rename one",
                    a.name
                )));
            }
            continue;
        }
        let curve = match a.curve {
            Curve::SmoothStep => ", DEFINITION=SMOOTH STEP".to_owned(),
            Curve::Linear { smooth } if smooth > 0.0 => format!(", DEFINITION=TABULAR, SMOOTH={}", number(smooth)),
            Curve::Linear { .. } => ", DEFINITION=TABULAR".to_owned(),
        };
        let _ = writeln!(out, "*AMPLITUDE, NAME={}{curve}", a.name);
        for [t, v] in &a.points {
            let _ = writeln!(out, "{}, {}", number(*t), number(*v));
        }
    }
    Ok(())
}

fn axis_component(c: ChainCoordinate) -> (&'static str, u32) {
    match c {
        ChainCoordinate::Ie => ("AXIS_TF_SI", 4),
        ChainCoordinate::Si => ("AXIS_TF_SI", 1),
        ChainCoordinate::Vv => ("AXIS_TF_AP", 4),
        ChainCoordinate::Ap => ("AXIS_TF_AP", 1),
        ChainCoordinate::Fe => ("AXIS_TF_ML", 4),
        ChainCoordinate::Ml => ("AXIS_TF_ML", 1),
    }
}
