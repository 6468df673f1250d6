//! Effects of the catalogue beside the first fifteen kinds, in forms of the laboratory's own.

use crate::asked::{Asked, Hidden, Size};
use crate::pose::{Five, Pose, about, components, pose, read};
use nalgebra::Vector3;

/// Name, parameters, and whether it belongs to the knee, thus to every data set. Sizes are about those that an analysis expects.
///
/// A `structure_loss` has its share drawn from 0.3 to 1. A `load_sign` is turned in full. A lever does not grow with the size that is asked for.
pub const FURTHER: [(&str, &[Size], bool); 13] = [
    ("structure_loss", &[("loss", 1.0, true)], true),
    ("attachment", &[("femur_ap_mm", 4.0, false), ("femur_si_mm", 4.0, false), ("tibia_ap_mm", 4.0, false)], true),
    ("mcl_wrap", &[("offset_mm", 5.0, true)], true),
    ("pcap_wrap", &[("offset_mm", 6.0, true)], true),
    (
        "bone_compliance",
        &[("ap_mm_per_100n", 0.7, true), ("ie_deg_per_nm", 0.3, true), ("vv_deg_per_nm", 0.1, true)],
        true,
    ),
    (
        "apparatus_compliance",
        &[("ap_mm_per_100n", 1.5, true), ("ie_deg_per_nm", 0.7, true), ("vv_deg_per_nm", 0.15, true)],
        false,
    ),
    ("cuff_softening", &[("ap_mm", 3.0, true), ("ie_deg", 4.0, true)], false),
    ("load_sign", &[("turned", 1.0, true)], false),
    ("gravity", &[("weight_n", 15.0, true), (LEVER, 40.0, false)], false),
    ("guarding_reflex", &[("share", 0.4, true)], false),
    ("load_axis", &[("turns", 0.7, true)], false),
    ("strap_tissue", &[("calf_mm_per_100n", 3.0, true), ("offset_mm", 2.0, false)], false),
    ("foot_turn", &[("out_deg", 6.0, true), ("in_deg", 8.0, true)], false),
];

/// A parameter that shapes an effect: the size that is asked for does not change it.
pub(crate) const LEVER: &str = "lever_mm";

/// Axes whose load may be recorded with the opposite sign, in the order of their numbers in a truth: their names in catalogues, and their loads' places.
pub const AXES: [(&str, usize); 3] = [("varus-valgus", 0), ("rotation", 1), ("anterior-posterior", 3)];

/// Centre of the shank's weight below the tibia's origin [mm]: about four tenths of a shank's length.
const SHANK_MM: f64 = 170.0;

/// Loads AP [N], IE and VV [N mm] at which straps yield as much as they would in proportion.
const FULL: [f64; 3] = [100.0, 5000.0, 10_000.0];

/// Straps and soft tissue yield by this power of the load: soonest at first.
const SOFT: f64 = 0.9;

/// Loads AP [N] and IE [N mm] at which 63 % of a cuff's slack is taken up.
const SLACK: [f64; 2] = [15.0, 375.0];

/// Share of what the calf gives way to a forward pull that the shin does to a push back [-].
const SHIN: f64 = 0.1;

/// Moment at which foot and ankle have turned by half of what they ever do [N mm].
const HALF_TURNED: f64 = 1500.0;

/// The load that the knee truly gets.
pub(crate) fn true_load(hidden: &Hidden, asked: &Asked) -> Asked {
    let mut out = *asked;
    if hidden.effect == "load_sign" {
        let (_, axis) = AXES[(hidden.value("axis") as usize).min(AXES.len() - 1)];
        out.load[axis] *= 1.0 - 2.0 * hidden.value("turned");
    }
    out
}

/// The load on a knee that was read at rest, where a strap or a handle turns with the shank: drawers and sideways forces along the shank's own axes, and
/// of moments of varus and valgus the part about the axis of the tests. None where nothing turns.
pub(crate) fn following(hidden: &[Hidden], asked: &Asked, at: &[f64; 6]) -> Option<Five> {
    let turns: f64 = hidden.iter().filter(|h| h.effect == "load_axis").map(|h| h.value("turns")).sum();
    if turns == 0.0 {
        return None;
    }
    let shank = pose(at[0], &components(at)).turn;
    let floating = Vector3::new(0.0, at[0].cos(), -at[0].sin());
    let [vv, ie, ml, ap, si] = asked.load;
    let force = shank * Vector3::new(-ml, ap, 0.0);
    let along = [shank.column(1).dot(&floating) * vv, ie, -force.x, force.dot(&floating), si];
    Some(std::array::from_fn(|j| asked.load[j] + turns * (along[j] - asked.load[j])))
}

/// What is read of FE, VV, IE [rad], ML, AP, SI [mm] where something between bone and sensor gives way.
pub(crate) fn misread(hidden: &Hidden, asked: &Asked, reading: &[f64; 6]) -> [f64; 6] {
    let mut out = *reading;
    let [ap, ie, vv] = [asked.load[3], asked.load[1], asked.load[0]];
    let yields = |load: f64, full: f64| full * load.signum() * (load.abs() / full).powf(SOFT);
    let play = |load: f64, slack: f64| load.signum() * (1.0 - (-load.abs() / slack).exp());
    let turn = |key: &str, nmm: f64| (hidden.value(key) * nmm / 1000.0).to_radians();
    match hidden.effect.as_str() {
        "apparatus_compliance" => {
            out[4] += hidden.value("ap_mm_per_100n") * yields(ap, FULL[0]) / 100.0;
            out[2] += turn("ie_deg_per_nm", yields(ie, FULL[1]));
            out[1] += turn("vv_deg_per_nm", yields(vv, FULL[2]));
        }
        "cuff_softening" => {
            out[4] += hidden.value("ap_mm") * play(ap, SLACK[0]);
            out[2] += (hidden.value("ie_deg") * play(ie, SLACK[1])).to_radians();
        }
        "strap_tissue" => {
            let gives = if ap > 0.0 { 1.0 } else { SHIN };
            out[4] +=
                hidden.value("offset_mm") + gives * hidden.value("calf_mm_per_100n") * yields(ap, FULL[0]) / 100.0;
        }
        "foot_turn" => {
            let end = hidden.value(if ie > 0.0 { "out_deg" } else { "in_deg" });
            out[2] += (end * ie / (ie.abs() + HALF_TURNED)).to_radians();
        }
        // the shaft bends about its own axes, between the joint and the sensor
        "bone_compliance" => {
            let mut p = pose(reading[0], &components(reading));
            p.origin += p.turn * Vector3::new(0.0, hidden.value("ap_mm_per_100n") * ap / 100.0, 0.0);
            p.turn *= about(Vector3::y(), turn("vv_deg_per_nm", vv)) * about(Vector3::z(), turn("ie_deg_per_nm", ie));
            out = read(&p);
        }
        _ => {}
    }
    out
}

/// Energy of the shank's weight at a pose [N mm]: the thigh points down, so that a straight shank presses the joint and a bent one sags backwards.
pub(crate) fn stored(hidden: &Hidden, p: &Pose) -> f64 {
    if hidden.effect != "gravity" {
        return 0.0;
    }
    let centre = p.turn * Vector3::new(-hidden.value(LEVER), 0.0, -SHANK_MM) + p.origin;
    -hidden.value("weight_n") * centre.z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hidden(effect: &str, parameters: &[(&str, f64)]) -> Hidden {
        Hidden {
            effect: effect.to_owned(),
            parameters: parameters.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
        }
    }

    const READING: [f64; 6] = [0.5, 0.05, 0.2, 1.0, 8.0, -21.0];

    fn loaded(load: [f64; 5]) -> Asked {
        Asked { flexion: 0.5, load }
    }

    /// What yields is as large as told: a hundredth of AP [mm] a newton, degrees a newton metre.
    #[test]
    fn straps_and_bones_yield_with_the_load_and_as_much_as_told() {
        let parameters = [("ap_mm_per_100n", 1.5), ("ie_deg_per_nm", 0.6), ("vv_deg_per_nm", 0.2)];
        let asked = loaded([10_000.0, 5000.0, 0.0, 100.0, 0.0]);
        for effect in ["apparatus_compliance", "bone_compliance"] {
            let h = hidden(effect, &parameters);
            let by = |asked: &Asked| -> [f64; 6] {
                let seen = misread(&h, asked, &READING);
                std::array::from_fn(|k| seen[k] - READING[k])
            };
            let d = by(&asked);
            let told = [(d[4], 1.5, 0.15), (d[2].to_degrees(), 3.0, 0.15), (d[1].to_degrees(), 2.0, 0.15)];
            for (is, expected, within) in told {
                assert!((is - expected).abs() < within * expected, "{effect}: {is} against {expected}");
            }
            assert!(by(&loaded([0.0; 5])).iter().all(|x| x.abs() < 1e-9), "{effect}: nothing without load");
            let back = by(&loaded([0.0, 0.0, 0.0, -100.0, 0.0]));
            assert!(back[4] < -1.3, "{effect}: {}", back[4]);
        }
    }

    #[test]
    fn a_cuff_gives_way_at_small_load_and_then_holds() {
        let h = hidden("cuff_softening", &[("ap_mm", 3.0), ("ie_deg", 4.0)]);
        let ap = |n: f64| misread(&h, &loaded([0.0, 0.0, 0.0, n, 0.0]), &READING)[4] - READING[4];
        assert!((ap(100.0) - 3.0).abs() < 0.01 && (ap(-100.0) + 3.0).abs() < 0.01 && ap(0.0).abs() < 1e-9);
        // most of it within 20 N
        assert!(ap(20.0) > 2.0 && ap(20.0) < 2.6, "{}", ap(20.0));
        let ie = misread(&h, &loaded([0.0, 5000.0, 0.0, 0.0, 0.0]), &READING)[2] - READING[2];
        assert!((ie.to_degrees() - 4.0).abs() < 0.01);
    }

    #[test]
    fn a_calf_gives_way_and_a_shin_hardly_and_a_foot_turns_each_way_by_its_own() {
        let strap = hidden("strap_tissue", &[("calf_mm_per_100n", 3.0), ("offset_mm", -2.0)]);
        let ap = |n: f64| misread(&strap, &loaded([0.0, 0.0, 0.0, n, 0.0]), &READING)[4] - READING[4];
        assert!((ap(0.0) + 2.0).abs() < 1e-9 && (ap(100.0) - 1.0).abs() < 1e-9 && (ap(-100.0) + 2.3).abs() < 1e-9);
        let foot = hidden("foot_turn", &[("out_deg", 6.0), ("in_deg", 9.0)]);
        let ie = |nmm: f64| (misread(&foot, &loaded([0.0, nmm, 0.0, 0.0, 0.0]), &READING)[2] - READING[2]).to_degrees();
        assert!(
            ie(0.0).abs() < 1e-9 && ie(1500.0) > 2.9 && ie(5000.0) < 6.0 && ie(-5000.0) < -6.5 && ie(-5000.0) > -9.0
        );
    }

    #[test]
    fn a_strap_that_turns_with_the_shank_pulls_to_where_the_foot_points() {
        let strap = [hidden("load_axis", &[("turns", 1.0)])];
        let drawer = loaded([0.0, 0.0, 0.0, 133.0, 20.0]);
        let at = |ie: f64| following(&strap, &drawer, &[0.5, 0.0, ie, 1.0, 8.0, -21.0]).unwrap();
        assert!(following(&[hidden("gravity", &[("weight_n", 9.0)])], &drawer, &READING).is_none());
        for (j, (is, asked)) in at(0.0).into_iter().zip(drawer.load).enumerate() {
            assert!((is - asked).abs() < 1e-9, "{j}: a straight shank gets what was asked for");
        }
        // 45 N at 20 deg, lateral where the foot points outwards
        let (out, inwards) = (at(20f64.to_radians()), at(-20f64.to_radians()));
        assert!((out[2] - 45.5).abs() < 0.1 && (inwards[2] + 45.5).abs() < 0.1, "{out:?} {inwards:?}");
        assert!((out[3] - inwards[3]).abs() < 1e-9 && (out[2].hypot(out[3]) - 133.0).abs() < 1e-9, "{out:?}");
    }

    #[test]
    fn a_turned_sign_turns_the_load_of_its_axis_alone() {
        let asked = loaded([1.0, 2.0, 3.0, 4.0, 5.0]);
        for (number, (_, axis)) in AXES.iter().enumerate() {
            let is = true_load(&hidden("load_sign", &[("turned", 1.0), ("axis", number as f64)]), &asked).load;
            let mut turned = asked.load;
            turned[*axis] = -turned[*axis];
            assert_eq!(is, turned);
        }
    }

    #[test]
    fn the_shank_presses_the_joint_in_extension_and_sags_backwards_in_flexion() {
        let h = hidden("gravity", &[("weight_n", 20.0), (LEVER, 0.0)]);
        // force on a component: minus the slope of the energy
        let force = |flexion: f64, j: usize| {
            let at = |step: f64| {
                let mut c = [0.0, 0.0, 0.0, 0.0, -21.0];
                c[j] += step;
                stored(&h, &pose(flexion, &c))
            };
            -(at(1e-3) - at(-1e-3)) / 2e-3
        };
        for flexion in [0.0, 0.6, 1.5f64] {
            assert!((force(flexion, 3) + 20.0 * flexion.sin()).abs() < 1e-6, "sag at {flexion}: {}", force(flexion, 3));
            assert!((force(flexion, 4) - 20.0 * flexion.cos()).abs() < 1e-6, "pressed at {flexion}");
        }
        let sideways = hidden("gravity", &[("weight_n", 20.0), (LEVER, 50.0)]);
        let tilt = |vv: f64| stored(&sideways, &pose(0.0, &[vv, 0.0, 0.0, 0.0, -21.0]));
        let moment = -(tilt(1e-4) - tilt(-1e-4)) / 2e-4;
        assert!((moment - 1000.0).abs() < 1.0, "a weight 50 mm aside tilts by {moment} N mm");
    }
}
