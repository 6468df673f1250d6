//! What a protocol or trial adds to a model of OpenSim: flexion given over time, loads along the other coordinates, and dampers.
//!
//! A file of it is complete. Whoever integrates it in time, in OpenSim or its GUI, has the protocol; `follow.py` finds its poses of rest.

use decks::{Imposed, ImposedPoint};
use sim::coordinate::{AP, Coordinate, IE, ML, SI, VV};
use std::fmt::Write;

/// The ending of a protocol's file.
pub(in crate::exports) const ENDING: &str = ".osim";
/// The script beside the files: its name, and itself.
pub(super) const SCRIPT: (&str, &str) = ("follow.py", include_str!("follow.py"));

/// The coordinates that loads act on, by their names in the model, and the damper of each [N m s/rad, N s/m]. Ligaments have none there,
/// so the knee would swing on. With a femur of 1 kg and 0.01 kg m2 these are near the critical ones. At rest they carry nothing. Ours.
const LOADED: [(Coordinate, &str, f64); 5] = [
    (VV, "valgus", 2.0),
    (IE, "external", 2.0),
    (ML, "lateral", 500.0),
    (AP, "anterior", 500.0),
    (SI, "superior", 500.0),
];

/// What stands in each place of the file; nothing in the model alone.
#[derive(Default)]
pub(super) struct Driven {
    /// In the coordinate of flexion.
    pub(super) flexion: String,
    /// Among the forces.
    pub(super) forces: String,
    /// The controllers.
    pub(super) controllers: String,
}

impl Driven {
    /// Of a protocol or trial.
    pub(super) fn of(imposed: &Imposed) -> Driven {
        let points = &imposed.points;
        let flexion = format!(
            "<prescribed_function><SimmSpline>{}</SimmSpline></prescribed_function><prescribed>true</prescribed>",
            table(points, |p| p.turn)
        );
        let (mut forces, mut functions) = (String::new(), String::new());
        for (c, name, damper) in LOADED {
            let _ = writeln!(
                forces,
                "<CoordinateActuator name=\"load_{name}\"><coordinate>{name}</coordinate><optimal_force>1</optimal_force>\
                 </CoordinateActuator>\
                 <SpringGeneralizedForce name=\"damper_{name}\"><coordinate>{name}</coordinate><viscosity>{damper:?}</viscosity>\
                 </SpringGeneralizedForce>"
            );
            let _ = writeln!(
                functions,
                "<PiecewiseLinearFunction>{}</PiecewiseLinearFunction>",
                table(points, |p| p.load[c])
            );
        }
        let loads = LOADED.map(|(_, name, _)| format!("/forceset/load_{name}")).join(" ");
        let controllers = format!(
            "<ControllerSet name=\"controllerset\"><objects><PrescribedController name=\"loads\">\
             <socket_actuators>{loads}</socket_actuators>\
             <FunctionSet name=\"ControlFunctions\"><objects>{functions}</objects></FunctionSet>\
             </PrescribedController></objects></ControllerSet>\n"
        );
        Driven { flexion, forces, controllers }
    }
}

/// A function over time, by its points.
fn table(points: &[ImposedPoint], value: impl Fn(&ImposedPoint) -> f64) -> String {
    let row = |values: Vec<f64>| values.iter().map(|x| format!("{:?}", x + 0.0)).collect::<Vec<_>>().join(" ");
    let (x, y) = (points.iter().map(|p| p.time_s).collect(), points.iter().map(value).collect());
    format!("<x>{}</x><y>{}</y>", row(x), row(y))
}
