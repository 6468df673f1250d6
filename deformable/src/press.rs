//! Pressing one body onto another, level by level, each at rest: dynamic relaxation.

use super::body::{Motion, Ramp};
use super::{Model, State};
use crate::error::DeformableError;
use meshes::{Point, Vector};
use serde::{Deserialize, Serialize};

/// How a level is brought to rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PressOptions {
    /// Increments over which the body moves to the next level.
    pub ramp_increments: usize,
    /// Increments that a level may take to come to rest, at most.
    pub settle_increments: usize,
    /// At rest where the forces of both bodies differ by no more than this share [-].
    pub imbalance: f64,
    /// And kinetic energy is below this share of the strain energy [-].
    pub kinetic_share: f64,
}

impl Default for PressOptions {
    fn default() -> Self {
        PressOptions { ramp_increments: 120, settle_increments: 2000, imbalance: 2e-3, kinetic_share: 1e-4 }
    }
}

/// A level at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// How far the body has been shifted [mm].
    pub shift_mm: f64,
    /// Force against the direction of pressing on the body that is pressed [N].
    pub force_n: f64,
    /// Contact area, the mean of both faces, all pairs [mm2].
    pub area_mm2: f64,
    /// Largest pressure at a node [MPa].
    pub peak_pressure_mpa: f64,
    /// Sum of the forces on all that is held, of the force [-].
    pub imbalance: f64,
    /// Largest kinetic energy on the way over the strain energy at the end [-].
    pub kinetic_share_under_way: f64,
    /// The same of the kinetic energy at the end [-].
    pub kinetic_share: f64,
    /// Share of hourglass in strain energy [-].
    pub hourglass_share: f64,
    /// Increments it took.
    pub increments: usize,
    /// Whether it came to rest within the increments allowed.
    pub at_rest: bool,
}

/// Presses `body` on to `shift_mm` along unit `direction` and waits until it is at rest. `from_mm` is where it is.
///
/// The direction must be the same for all levels of a state. Errors: as [`State::advance`].
pub fn press(
    (model, state): (&Model, &mut State),
    (body, direction): (usize, &Vector),
    (from_mm, shift_mm): (f64, f64),
    options: &PressOptions,
) -> Result<Level, DeformableError> {
    let dt = model.masses().increment_s;
    let ramp = Ramp {
        start_s: state.time,
        end_s: state.time + dt * options.ramp_increments as f64,
        from: from_mm,
        to: shift_mm,
    };
    state.motions[body] = Motion::Prescribed { turn: Vector::zeros(), about: Point::origin(), shift: *direction, ramp };
    let mut level = Level { shift_mm, ..Level::default() };
    let mut kinetic = 0.0f64;
    for n in 1..=options.ramp_increments + options.settle_increments {
        state.advance(model)?;
        let strain = (state.energy.strain + state.energy.hourglass).max(f64::MIN_POSITIVE);
        level.kinetic_share = state.energy.kinetic.max(0.0) / strain;
        level.increments = n;
        kinetic = kinetic.max(state.energy.kinetic);
        if n <= options.ramp_increments || n % 10 != 0 {
            continue;
        }
        let size = state.reaction(body).0.norm();
        level.imbalance = state.missing().norm() / size.max(1e-3);
        level.at_rest = level.imbalance < options.imbalance
            && state.unbalanced() < 5.0 * options.imbalance * size.max(1e-3)
            && level.kinetic_share < options.kinetic_share;
        // nothing touches yet
        if level.at_rest || (size == 0.0 && state.contact.stored == 0.0) {
            level.at_rest = true;
            break;
        }
    }
    level.force_n = -state.reaction(body).0.dot(direction);
    let strain = (state.energy.strain + state.energy.hourglass).max(1e-12);
    level.kinetic_share_under_way = kinetic / strain;
    level.hourglass_share = state.energy.hourglass / strain;
    (level.area_mm2, level.peak_pressure_mpa) = contact(model, state);
    Ok(level)
}

/// Contact area, mean of both passes, and the largest pressure at a node.
fn contact(model: &Model, state: &State) -> (f64, f64) {
    let mut area = 0.0;
    for (pass, touches) in model.passes.iter().zip(&state.contact.touches) {
        let own = &model.faces[pass.nodes];
        area += 0.5 * own.area.iter().zip(touches).filter(|(_, t)| t.normal > 0.0).map(|(a, _)| a).sum::<f64>();
    }
    let pressures = model.face_of.keys().flat_map(|&face| super::contact_pressure(model, state, face));
    (area, pressures.map(|(_, p)| p).fold(0.0, f64::max))
}
