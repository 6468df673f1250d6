//! A FEBio file a protocol or trial: the knee of model.feb, its six coordinates as three rigid cylindrical joints, flexion given and loads
//! put on over time.
//!
//! A file takes mesh, fibres and contact from model.feb, which must lie beside it. FEBio's joint turns its second body against its first by
//! `rotation`, and its `force` and `moment` push the first. So loads have the other sign of the coordinates there. Load curves hold clinical
//! signs.

use super::{FIXED, KNEE, OUTPUT, materials, menisci, place};
use crate::error::BuildError;
use crate::exports::File;
use crate::model_file::LoadedModel;
use decks::{Imposed, ImposedStep};
use meshes::Vector;
use sim::coordinate::{ALL, Coordinate, FE};
use sim::deck::ChainCoordinate;
use sim::joint::Joint;
use std::fmt::Write;

/// The ending of a protocol's file.
pub(in crate::exports) const ENDING: &str = ".feb";
/// Steps of a search for equilibrium in a step of a protocol.
const STEPS: usize = 20;
/// The smallest such step, as a share of the step of the protocol.
const LEAST_STEP: f64 = 1e-3;
/// Stiffness by which a joint holds its bodies on its axis [N/mm, N mm/rad]: 100 N and 10 N m move them by 0.001 mm and 0.006 deg.
const HELD: [f64; 2] = [1e5, 1e8];

/// The joints from the tibia on: name, bodies, and the coordinates about and along the axis.
const JOINTS: [(&str, [&str; 2], [ChainCoordinate; 2]); 3] = [
    ("tibial_axis", ["tibia", LINKS[0]], [ChainCoordinate::Ie, ChainCoordinate::Si]),
    ("floating_axis", LINKS, [ChainCoordinate::Vv, ChainCoordinate::Ap]),
    ("femoral_axis", [LINKS[1], "femur"], [ChainCoordinate::Fe, ChainCoordinate::Ml]),
];
/// Bodies between two joints; they have no faces.
const LINKS: [&str; 2] = ["link_tibial", "link_floating"];

/// A file a protocol or trial.
pub(super) fn files(model: &LoadedModel, imposed: &[Imposed]) -> Result<Vec<File>, BuildError> {
    let joint = Joint::new(&model.spec.frames, model.spec.side).map_err(|e| BuildError::in_file(&model.folder, e))?;
    let file = |i: &Imposed| (format!("{}{ENDING}", i.stem), document(model, &joint, i).into_bytes());
    Ok(imposed.iter().map(file).collect())
}

fn document(model: &LoadedModel, joint: &Joint, imposed: &Imposed) -> String {
    let from = |section: &str| format!("<{section} from=\"{KNEE}\"/>\n");
    let numbered = |(k, step): (usize, &ImposedStep)| control(k + 1, step);
    let steps: String = imposed.steps.iter().enumerate().map(numbered).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<febio_spec version=\"4.0\">\n<Module type=\"solid\"/>\n\
         {}<Material>{}{}{}</Material>\n{}{}{}<Rigid>{FIXED}\n{}</Rigid>\n{}{}<Step>\n{steps}</Step>\n\
         <LoadData>\n{}</LoadData>\n{OUTPUT}\n</febio_spec>\n",
        from("Globals"),
        materials(model),
        menisci::menisci(model, (0, 0, 0)).materials,
        links(model, joint),
        from("Mesh"),
        from("MeshDomains"),
        from("Boundary"),
        joints(joint),
        from("Contact"),
        from("Discrete"),
        curves(imposed)
    )
}

/// Materials of the links, numbered after those of bones and menisci.
fn links(model: &LoadedModel, joint: &Joint) -> String {
    let first = 3 + model.spec.menisci.len();
    let one = |(k, name): (usize, &str)| {
        format!(
            "<material id=\"{}\" name=\"{name}\" type=\"rigid body\"><density>1e-9</density><center_of_mass>{}</center_of_mass></material>",
            first + k,
            place(&joint.axes()[k].point)
        )
    };
    LINKS.into_iter().enumerate().map(one).collect()
}

/// The three joints. Flexion is given, the others are loaded.
fn joints(joint: &Joint) -> String {
    let mut out = String::new();
    for ((name, [first, second], [turn, shift]), axis) in JOINTS.into_iter().zip(joint.axes()) {
        let ((turn, turned), (shift, shifted)) = (joint.from_chain(turn, None), joint.from_chain(shift, None));
        let along = |tag: &str, c: Coordinate, sign: f64| format!("<{tag} lc=\"{}\">{sign:?}</{tag}>", curve(c));
        let given = turn == FE;
        let about = if given { along("rotation", turn, turned) } else { along("moment", turn, -turned) };
        let vector = |v: &Vector| format!("{:.12},{:.12},{:.12}", v.x, v.y, v.z);
        let [force_penalty, moment_penalty] = HELD;
        let _ = writeln!(
            out,
            "<rigid_connector name=\"{name}\" type=\"rigid cylindrical joint\"><body_a>{first}</body_a><body_b>{second}</body_b>\
             <tolerance>0</tolerance><gaptol>0</gaptol><angtol>0</angtol>\
             <force_penalty>{force_penalty:?}</force_penalty><moment_penalty>{moment_penalty:?}</moment_penalty><auto_penalty>0</auto_penalty>\
             <laugon>PENALTY</laugon><joint_origin>{}</joint_origin><joint_axis>{}</joint_axis><transverse_axis>{}</transverse_axis>\
             <prescribed_rotation>{}</prescribed_rotation><prescribed_translation>0</prescribed_translation>{}{about}</rigid_connector>",
            place(&axis.point),
            vector(&axis.direction),
            vector(&across(&axis.direction)),
            u8::from(given),
            along("force", shift, -shifted)
        );
    }
    out
}

/// A unit vector at right angles to an axis.
fn across(axis: &Vector) -> Vector {
    let other = if axis.x.abs() < 0.7 { Vector::x() } else { Vector::y() };
    axis.cross(&other).normalize()
}

/// The number of a coordinate's load curve.
fn curve(c: Coordinate) -> usize {
    c.index() + 1
}

/// A load curve a coordinate: flexion from the CT pose [rad], loads in clinical signs [N mm, N].
fn curves(imposed: &Imposed) -> String {
    let mut out = String::new();
    for c in ALL {
        let value = |p: &decks::ImposedPoint| if c == FE { p.turn } else { c.to_force(p.load[c]) };
        let points: String =
            imposed.points.iter().map(|p| format!("<pt>{:.6},{:.9}</pt>", p.time_s, value(p) + 0.0)).collect();
        let _ = writeln!(
            out,
            "<load_controller id=\"{}\" type=\"loadcurve\"><interpolate>LINEAR</interpolate><extend>CONSTANT</extend>\
             <points>{points}</points></load_controller>",
            curve(c)
        );
    }
    out
}

/// A step of the protocol.
fn control(id: usize, step: &ImposedStep) -> String {
    let lasts = step.to_s - step.from_s;
    let size = lasts / STEPS as f64;
    format!(
        "<step id=\"{id}\" name=\"{}\"><Control><analysis>STATIC</analysis><time_steps>{STEPS}</time_steps><step_size>{size:.9}</step_size>\
         <time_stepper type=\"default\"><dtmin>{:.9}</dtmin><dtmax>{size:.9}</dtmax></time_stepper>\
         <solver type=\"solid\"><symmetric_stiffness>non-symmetric</symmetric_stiffness></solver></Control></step>\n",
        crate::report::html::escaped(&step.name),
        LEAST_STEP * lasts
    )
}
