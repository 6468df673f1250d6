//! Pressing the deformable cartilages together at one flexion.

use super::pose::{Rigid, Start, motion};
use super::{ContactLawOptions, Snapshot, SolidFields, fault};
use crate::overclosure::Separated;
use crate::{PerCartilage, StageError};
use deformable::press::{Level, PressOptions, press as press_to};
use deformable::{
    Assembly, Body, Damping, Face, Masses, Model, Motion, Options, Scaling, Solid, State, compile, fields,
};
use meshes::hex::HexMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};

/// Increment that every element is given in dynamic relaxation [s]: numerical.
const INCREMENT_S: f64 = 1e-5;
/// The cartilages start this far apart [mm].
const CLEAR_MM: f64 = 0.01;

/// The deformable model's answer at one flexion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Levels at rest; `shift_mm` is the approach from where the undeformed cartilages begin to overlap.
    pub levels: Vec<Level>,
    /// Masses in use.
    pub masses: Masses,
    /// Largest miss of the energy balance, of the largest energy [-].
    pub energy_balance_error: f64,
}

pub(super) struct Pressed {
    pub(super) curve: Curve,
    pub(super) snapshots: Vec<Snapshot>,
    pub(super) warnings: Vec<Notice>,
}

/// Presses the femur's cartilage down the tibia's axis until the force wanted is reached.
pub(super) fn press(
    rigid: &Rigid,
    start: &Start,
    separated: &Separated,
    o: &ContactLawOptions,
) -> Result<Pressed, StageError> {
    let model = compile(assembly(rigid, start, separated, o), &solver(o)).map_err(fault)?;
    let mut state = State::new(&model);
    let down = -rigid.up;
    let mut out = Pressed {
        curve: Curve {
            flexion_deg: start.flexion_deg,
            levels: vec![],
            masses: model.masses(),
            energy_balance_error: 0.0,
        },
        snapshots: vec![],
        warnings: vec![],
    };
    let step = start.reach_mm / o.levels as f64;
    let (mut at, mut force) = (0.0, 0.0);
    for n in 1..=3 * o.levels {
        let next = CLEAR_MM + step * n as f64;
        let level = press_to((&model, &mut state), (FEMUR, &down), (at, next), &PressOptions::default());
        let level = level.map_err(|e| StageError::part(format_args!("flexion {} deg", start.flexion_deg), e))?;
        (at, force) = (next, level.force_n);
        if !level.at_rest {
            out.warnings.push(Kind::NotAtRest.notice(format!(
                "flexion {} deg, {force:.0} N: not quite at rest (forces differ by {:.1e})",
                start.flexion_deg, level.imbalance
            )));
        }
        out.curve.levels.push(Level { shift_mm: next - CLEAR_MM, ..level });
        let last = force >= o.force_n;
        if o.all_fields || last {
            out.snapshots.push(snapshot((&model, &state), start.flexion_deg, n, force));
        }
        if last {
            break;
        }
    }
    out.curve.energy_balance_error = state.energy.balance_error();
    if force < o.force_n {
        out.warnings.push(Kind::ForceNotReached.notice(format!(
            "flexion {} deg: {force:.0} N at {at:.2} mm, {} N were wanted",
            start.flexion_deg, o.force_n
        )));
    }
    Ok(out)
}

/// Body numbers.
const TIBIA: usize = 0;
const FEMUR: usize = 1;

fn solver(o: &ContactLawOptions) -> Options {
    Options {
        hourglass_stiffness: o.hourglass_stiffness,
        penalty_mpa_per_mm: o.penalty_mpa_per_mm,
        friction: o.friction,
        scaling: Scaling::Even(INCREMENT_S),
        damping: Damping::Critical,
        ..Options::default()
    }
}

fn assembly(rigid: &Rigid, start: &Start, separated: &Separated, o: &ContactLawOptions) -> Assembly {
    let apart = rigid.pressed(&start.pose, -CLEAR_MM);
    let still = deformable::Ramp::constant(0.0);
    let bodies = vec![
        Body { name: "tibia".into(), motion: Motion::Fixed },
        Body {
            name: "femur".into(),
            motion: Motion::Prescribed { turn: Vector::zeros(), about: Point::origin(), shift: -rigid.up, ramp: still },
        },
    ];
    let m = &separated.meshes;
    let solid = |name: &str, mesh: HexMesh, body| Solid {
        name: name.into(),
        mesh,
        material: o.material(),
        body,
        rollers: Vec::new(),
    };
    let mut femur = m.femur.clone();
    femur.nodes.iter_mut().for_each(|p| *p = motion(&apart) * *p);
    let solids = vec![
        solid("femur", femur, FEMUR),
        solid("tibia_medial", m.tibia_medial.clone(), TIBIA),
        solid("tibia_lateral", m.tibia_lateral.clone(), TIBIA),
    ];
    let pairs = vec![[Face::Articular(0), Face::Articular(1)], [Face::Articular(0), Face::Articular(2)]];
    Assembly { bodies, solids, rigid_faces: Vec::new(), pairs }
}

fn snapshot((model, state): (&Model, &State), flexion_deg: f64, level: usize, force_n: f64) -> Snapshot {
    let of = |solid: usize| {
        let f = fields(model, state, solid);
        SolidFields {
            places: f.places.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect(),
            stress_mpa: f.stress_mpa.iter().map(|s| s.map(|x| x as f32)).collect(),
            contact_pressure_mpa: f.contact_pressure_mpa.iter().map(|p| *p as f32).collect(),
        }
    };
    Snapshot {
        flexion_deg,
        level,
        force_n,
        fields: PerCartilage { femur: of(0), tibia_medial: of(1), tibia_lateral: of(2) },
    }
}
