//! How far the frames in which motion was measured may stand from the model's: turns and shifts of the femoral and tibial frame.
//!
//! A rater's epicondylar axis is 2.5 deg from the consensus on average, a plateau's centre is a convention of millimetres. Ligaments fitted to motion read
//! in other frames make up for the difference with forces that are not there; so the difference is inferred too.

use meshes::frame::{AnatomicalFrame, Side};
use nalgebra::{Matrix6, Rotation3, Vector3};
use sim::SimError;
use sim::coordinate::{FE, Six};
use sim::joint::{Joint, Pose};
use sim::spec::FramesSpec;
use sim::trials::pose_spec;

/// Turns about, then shifts along, the medial, anterior and superior axis of the femur, then of the tibia [deg, mm].
pub type Terms = [f64; 12];

/// Turn [deg] or shift [mm] over which derivatives by frames are taken; ours: far beyond rounding, far below what bends an answer.
pub const STEP: f64 = 0.05;

/// Names of the terms, in order: bone and axis, `deg` or `mm`.
pub fn term_name(term: usize) -> String {
    let bone = ["femur", "tibia"][term / 6];
    let axis = ["medial", "anterior", "superior"][term % 3];
    let kind = if term % 6 < 3 { "turn_deg" } else { "shift_mm" };
    format!("{bone}.{axis}.{kind}")
}

/// Frames turned and shifted in their own axes; the pose in CT follows.
///
/// # Errors
/// Frames that make no joint.
pub fn corrected(frames: &FramesSpec, side: Side, terms: &Terms) -> Result<FramesSpec, SimError> {
    let mut out = frames.clone();
    let hand = if side == Side::Left { 1.0 } else { -1.0 };
    for (frame, t) in [&mut out.femur, &mut out.tibia].into_iter().zip(terms.chunks_exact(6)) {
        let axes = [frame.medial, frame.anterior, frame.superior];
        let turn: meshes::Vector = (0..3).map(|a| axes[a] * (hand * t[a].to_radians())).sum();
        let shift: meshes::Vector = (0..3).map(|a| axes[a] * t[3 + a]).sum();
        let turn = Rotation3::new(turn);
        *frame = AnatomicalFrame {
            origin: frame.origin + shift,
            medial: turn * frame.medial,
            anterior: turn * frame.anterior,
            superior: turn * frame.superior,
        };
    }
    if terms.iter().any(|t| *t != 0.0) {
        out.grid = Some(frames.tabulated());
    }
    out.gs_ct_pose = pose_spec(&Joint::new(&out, side)?.ct_pose());
    Ok(out)
}

/// For each turn and shift that is asked for, the joint with the frame moved by [`STEP`] forward and back; none of frames that make no joint.
pub type FrameSteps = [Option<[Joint; 2]>; 12];

/// Steps of the asked terms about frames that are turned and shifted already.
pub fn frame_steps(frames: &FramesSpec, side: Side, about: &Terms, is_asked: impl Fn(usize) -> bool) -> FrameSteps {
    std::array::from_fn(|t| {
        let at = |by: f64| {
            let mut terms = *about;
            terms[t] += by;
            Joint::new(&corrected(frames, side, &terms).ok()?, side).ok()
        };
        if is_asked(t) { Some([at(STEP)?, at(-STEP)?]) } else { None }
    })
}

/// What a turn or shift of a frame changes where the bones stay, per degree or millimetre.
pub struct FrameChange {
    /// What is read [rad, mm].
    pub read: Six,
    /// The generalised forces of the wrench that the knee bears [N mm, N].
    pub force: Six,
    /// Flexion as the chain has it [rad].
    pub flexion: f64,
}

impl FrameChange {
    /// By central differences over the steps of a term: the bones at `pose` bear the generalised force `force`, and `read` makes what is read of
    /// Grood-Suntay coordinates. `None` of a pose that the chain does not reach.
    pub fn of(joints: &[Joint; 2], pose: &Pose, force: &Six, read: &dyn Fn(&Six) -> Six) -> Option<FrameChange> {
        let wrench = wrench(pose, force)?;
        let at = |joint: &Joint| {
            let gs = joint.grood_suntay_of(&pose.femur);
            let q = joint.coordinates(&gs).ok()?;
            let pose = joint.pose(&q);
            let along = |j: usize| wrench[0].dot(&pose.screws[j].linear) + wrench[1].dot(&pose.screws[j].angular);
            Some((read(&gs), Six::from_fn(|j, _| along(j)), q[FE] + joint.ct_pose()[FE]))
        };
        let ([up, down], per) = ([at(&joints[0])?, at(&joints[1])?], 1.0 / (2.0 * STEP));
        Some(FrameChange { read: (up.0 - down.0) * per, force: (up.1 - down.1) * per, flexion: (up.2 - down.2) * per })
    }
}

/// Force and moment about the CT's origin whose generalised force is `force` at a pose.
fn wrench(pose: &Pose, force: &Six) -> Option<[Vector3<f64>; 2]> {
    let rows = Matrix6::from_fn(|j, c| if c < 3 { pose.screws[j].linear[c] } else { pose.screws[j].angular[c - 3] });
    let w = rows.try_inverse()? * force;
    Some([Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5])])
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::{Point, Vector};
    use sim::spec::PoseSpec;

    #[test]
    fn a_shift_moves_the_reading_by_itself_and_no_turn_changes_nothing() {
        let at = |z: f64| AnatomicalFrame {
            origin: Point::new(0.0, 0.0, z),
            medial: -Vector::x(),
            anterior: -Vector::y(),
            superior: Vector::z(),
        };
        let frames =
            FramesSpec { femur: at(20.0), tibia: at(0.0), gs_ct_pose: PoseSpec::default(), chain: None, grid: None };
        let same = corrected(&frames, Side::Left, &[0.0; 12]).unwrap();
        let mut terms = [0.0; 12];
        (terms[10], terms[11]) = (3.0, 2.0);
        let moved = corrected(&frames, Side::Left, &terms).unwrap();
        assert_eq!(same.femur, frames.femur);
        assert!((moved.gs_ct_pose.ap_mm - same.gs_ct_pose.ap_mm - 3.0).abs() < 1e-9);
        assert!((moved.gs_ct_pose.si_mm - same.gs_ct_pose.si_mm - 2.0).abs() < 1e-9);
        let mut terms = [0.0; 12];
        terms[8] = 4.0;
        let turned = corrected(&frames, Side::Left, &terms).unwrap();
        assert!(((turned.gs_ct_pose.ie_deg - same.gs_ct_pose.ie_deg).abs() - 4.0).abs() < 1e-9);
        assert_eq!(term_name(10), "tibia.anterior.shift_mm");
    }
}
