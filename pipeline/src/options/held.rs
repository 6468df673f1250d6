//! Ranges that stages' own checks hold, as `build-model options` tells them. A test holds each against the check itself.

/// The least number above 0.
pub(super) const ABOVE_0: f64 = f64::MIN_POSITIVE;
/// The largest number below 1.
pub(super) const BELOW_1: f64 = 1.0_f64.next_down();

/// Most that no check bounds: [`super::ranges`] has it for every number.
const OPEN: f64 = 1e12;

/// A key, least and most. A key of a list is that of each of its numbers.
pub(super) const HELD: [(&str, f64, f64); 62] = [
    ("segment.closing_mm", 0.0, 5.0),
    ("segment.least_bone_mm3", ABOVE_0, OPEN),
    ("segment.edge_reach_mm", ABOVE_0, OPEN),
    ("segment.smoothing_rounds", 0.0, 100.0),
    ("bones.crop_mm", ABOVE_0, OPEN),
    ("bones.edge_mm", 0.2, OPEN),
    ("bones.flat_tolerance_mm", ABOVE_0, OPEN),
    ("cartilage.least_thickness_mm", 0.01, OPEN),
    ("cartilage.reach_mm", 1.0, OPEN),
    ("cartilage.edge_mm", 0.2, OPEN),
    ("hexmesh.edge_length_mm", 0.2, 3.0),
    ("hexmesh.layers", 1.0, 10.0),
    // the greatest thickness is above the least
    ("hexmesh.min_thickness_mm", 0.0, OPEN.next_down()),
    ("hexmesh.max_thickness_mm", ABOVE_0, OPEN),
    ("overclosure.femur_share", 0.0, 1.0),
    ("overclosure.spread_mm", 0.05, 100.0),
    ("overclosure.spread_reduction", 0.0, 1.0),
    ("overclosure.least_spread_mm", 0.05, 100.0),
    ("overclosure.momentum", 0.0, BELOW_1),
    ("overclosure.height_kept", 0.0, 1.0),
    ("contact-law.force_n", 10.0, 5000.0),
    // below the force itself
    ("contact-law.least_force_n", 0.0, 5000.0_f64.next_down()),
    ("contact-law.levels", 3.0, 100.0),
    ("contact-law.area_weight", 0.0, 10.0),
    ("calibrate.swarm.particles", 2.0, OPEN),
    // each particle has one
    ("calibrate.swarm.swarm_evaluations", 2.0, OPEN),
    ("calibrate.swarm.simplex_size", ABOVE_0, 0.5_f64.next_down()),
    ("calibrate.frames.turn_sd_deg", 0.0, 20.0),
    ("calibrate.frames.shift_sd_mm", 0.0, 20.0),
    ("calibrate.frames.offset_turn_deg", 0.0, 20.0),
    ("calibrate.frames.offset_shift_mm", 0.0, 20.0),
    ("calibrate.inference.first_evaluations", 2.0, OPEN),
    ("calibrate.inference.finalists", 1.0, OPEN),
    ("calibrate.inference.evaluations", 2.0, OPEN),
    ("calibrate.inference.sample_evaluations", 1.0, OPEN),
    ("calibrate.gradient.robust", ABOVE_0, OPEN),
    ("calibrate.gradient.interval", ABOVE_0, BELOW_1),
    ("validate.compression_n", 0.0, 5000.0),
    ("validate.ap_load_n", 0.0, 2000.0),
    ("validate.ap_way_s", 1e-3, 1e6),
    ("validate.ap_rows", 1.0, 1e4),
    ("validate.every_deg", 0.01, 180.0),
    ("validate.rate_deg_per_s", 1e-6, 1e6),
    ("validate.pivot_valgus_nm", -150.0, 150.0),
    ("validate.pivot_internal_nm", -150.0, 150.0),
    ("validate.pivot_dislocation_ap_mm", 1.0, 1e3),
    ("validate.agree.mm", 1e-6, 100.0),
    ("validate.agree.deg", 1e-6, 100.0),
    ("validate.agree.n", 1e-6, 1e4),
    ("validate.trials.settle_s", 1e-3, 1e6_f64.next_down()),
    ("validate.trials.load_s", 1e-3, 1e6_f64.next_down()),
    ("validate.trials.hold_s", 1e-3, 1e6_f64.next_down()),
    ("validate.trials.settle_damping", 0.0, 1e9_f64.next_down()),
    ("validate.trials.damping", 0.0, 1e9_f64.next_down()),
    ("validate.trials.load_from", 0.0, BELOW_1),
    ("validate.trials.increments", 1.0, 1e5),
    ("validate.trials.second_search_mm", 0.0, 50.0),
    ("validate.trials.solver.slip_mm", 1e-12, 100.0),
    ("validate.trials.solver.step_on_the_way_mm", 1e-12, 100.0),
    ("validate.trials.solver.step_at_the_end_mm", 1e-12, 100.0),
    ("validate.trials.solver.departure_mm", 1e-12, 100.0),
    ("validate.trials.solver.iterations", 5.0, 1e5),
];
