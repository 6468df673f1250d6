//! What no catalogue has: contacts, bands and stops, measurements that went wrong.

use crate::asked::{Asked, Hidden, Size};
use crate::knee::KneeInput;
use crate::pose::{Five, Pose, about};
use meshes::Point;
use nalgebra::Vector3;

/// Name, parameters, and whether it belongs to the knee, thus to every data set.
pub const UNKNOWN: [(&str, &[Size], bool); 8] = [
    ("x_one_sided_stop", &[("k", 40.0, true)], false),
    ("x_screw_home", &[("k", 40.0, true)], false),
    ("x_adhesion", &[("k", 40.0, true)], false),
    ("x_impingement", &[("k", 60.0, true)], true),
    ("x_wobble", &[("deg", 4.0, false)], false),
    ("x_ct_scale", &[("share", 0.03, false)], true),
    // VV, IE or ML by the rounded number
    ("x_turned_channel", &[("channel", 2.0, true)], false),
    // places of the two among the trials of their scope, as shares
    ("x_swapped_trials", &[("one", 0.3, true), ("other", 0.7, true)], false),
];

/// Sum of the radii of the cruciates [mm].
const CRUCIATES: f64 = 11.0;

/// Closest approach of the lines of the cruciates, positive as they lie in a knee at rest [mm]. Ends: medial, anterior, superior [mm].
fn between_cruciates(p: &Pose) -> f64 {
    let tibial = |[x, y, z]: [f64; 3]| p.turn * Vector3::new(x, y, z) + p.origin;
    let (acl, pcl) = (Vector3::new(-14.5, -10.0, 1.0), Vector3::new(7.0, 4.0, -13.0));
    let across = (tibial([-2.0, -12.0, -11.0]) - pcl).cross(&(tibial([-1.0, 14.0, -4.0]) - acl));
    (pcl - acl).dot(&across) / across.norm().max(1e-9)
}

/// Energy of those that act on the knee, at components `c` of the pose `p`, `d` from the unloaded ones [N mm].
pub(crate) fn stored(hidden: &Hidden, asked: &Asked, (p, c, d): (&Pose, &Five, &Five)) -> f64 {
    let k = hidden.value("k");
    match hidden.effect.as_str() {
        "x_one_sided_stop" => 0.5 * k * (d[3].abs() - 3.0).max(0.0).powi(2) * f64::from(d[3] > 0.0),
        "x_screw_home" => -900.0 * k / 40.0 * c[1] * (-(asked.flexion / 0.35).powi(2)).exp(),
        "x_adhesion" => {
            let tibia = p.turn * Vector3::new(-8.0, 22.0, 3.0) + p.origin;
            0.5 * k * ((Vector3::new(5.0, 15.0, -5.0) - tibia).norm() - 14.0).max(0.0).powi(2)
        }
        "x_impingement" => 0.5 * k * (CRUCIATES - between_cruciates(p)).max(0.0).powi(2),
        _ => 0.0,
    }
}

/// What a laboratory reads of FE, VV, IE [rad], ML, AP, SI [mm] where its femoral tracker sways with the size of the load, or a channel is turned round.
pub(crate) fn misread(hidden: &Hidden, asked: &Asked, reading: &[f64; 6]) -> [f64; 6] {
    let mut out = *reading;
    match hidden.effect.as_str() {
        "x_turned_channel" => {
            let channel = (hidden.value("channel").round() as usize).clamp(1, 3);
            out[channel] = -out[channel];
        }
        "x_wobble" => {
            let loaded = asked.load[3].abs() / 100.0 + (asked.load[1].abs() + asked.load[0].abs()) / 5000.0;
            let turn = about(Vector3::new(0.3, 1.0, 0.5), (hidden.value("deg") * loaded).to_radians());
            let mut p = crate::pose::pose(reading[0], &crate::pose::components(reading));
            p.turn = turn * p.turn;
            p.origin = turn * p.origin;
            out = crate::pose::read(&p);
        }
        _ => {}
    }
    out
}

/// The knee as large as it truly is, where the CT's scale is wrong by a share: surfaces, attachments, and how far apart the bones stood in the CT.
pub(crate) fn true_size(input: &KneeInput, share: f64) -> KneeInput {
    let mut out = input.clone();
    let about = input.frames.0.origin;
    let grow = |p: &mut Point| *p = about + (*p - about) * (1.0 + share);
    grow(&mut out.frames.1.origin);
    out.femur.vertices.iter_mut().for_each(grow);
    out.tibia.iter_mut().flat_map(|t| &mut t.vertices).for_each(grow);
    for bundle in &mut out.bundles {
        bundle.reference_length *= 1.0 + share;
        bundle.fibres.iter_mut().flat_map(|(f, t)| [f, t]).for_each(grow);
    }
    out
}

/// Places, among `count` trials of its scope, of the two whose readings changed places.
pub(crate) fn swapped(hidden: &Hidden, count: usize) -> Option<(usize, usize)> {
    if hidden.effect != "x_swapped_trials" || count < 2 {
        return None;
    }
    let place = |key: &str| ((hidden.value(key) * count as f64) as usize).min(count - 1);
    let (a, b) = (place("one"), place("other"));
    (a != b).then_some((a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knee::BundleInput;
    use crate::pose::pose;
    use meshes::frame::AnatomicalFrame;
    use meshes::surface::TriMesh;
    use std::collections::BTreeMap;

    fn hidden(effect: &str, parameters: &[(&str, f64)]) -> Hidden {
        let parameters = parameters.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect::<BTreeMap<_, _>>();
        Hidden { effect: effect.to_owned(), parameters }
    }

    #[test]
    fn the_cruciates_are_clear_of_each_other_at_rest_and_wind_up_in_internal_rotation() {
        for flexion in [0.0, 0.5, 1.0, 1.5] {
            let at = |ie: f64| between_cruciates(&pose(flexion, &[0.0, ie, 0.0, 5.0, -22.0]));
            assert!(
                at(0.0) > 5.0 && at(0.3) > at(0.0) && at(-0.3) < at(0.0),
                "{flexion}: {} {} {}",
                at(-0.3),
                at(0.0),
                at(0.3)
            );
        }
    }

    #[test]
    fn a_turned_channel_turns_one_reading_and_a_swaying_tracker_needs_a_load() {
        let reading = [0.5, 0.05, 0.2, 1.0, 8.0, -21.0];
        let rest = Asked { flexion: 0.5, load: [0.0; 5] };
        let turned = misread(&hidden("x_turned_channel", &[("channel", 2.2)]), &rest, &reading);
        assert_eq!(turned, [0.5, 0.05, -0.2, 1.0, 8.0, -21.0]);
        let sways = hidden("x_wobble", &[("deg", 4.0)]);
        let apart = |asked: &Asked| {
            let seen = misread(&sways, asked, &reading);
            (0..6).map(|k| (seen[k] - reading[k]).abs()).fold(0.0, f64::max)
        };
        assert!(apart(&rest) < 1e-9 && apart(&Asked { load: [0.0, 0.0, 0.0, -100.0, 0.0], ..rest }) > 0.01);
    }

    #[test]
    fn a_ct_of_a_wrong_scale_has_all_lengths_wrong() {
        let frame = |z: f64| AnatomicalFrame {
            origin: Point::new(3.0, -2.0, z),
            medial: Vector3::x(),
            anterior: Vector3::y(),
            superior: Vector3::z(),
        };
        let ends = (Point::new(5.0, 1.0, 20.0), Point::new(-4.0, 2.0, -15.0));
        let bundle = BundleInput {
            name: "ACL".into(),
            reference_strain: 1.0,
            stiffness: 100.0,
            reference_length: 30.0,
            fibres: vec![ends],
        };
        let input = KneeInput {
            frames: (frame(10.0), frame(-12.0)),
            femur: TriMesh { vertices: vec![Point::new(1.0, 2.0, 3.0)], triangles: vec![] },
            tibia: vec![],
            bundles: vec![bundle],
            contact_slope: 1.0,
        };
        let large = true_size(&input, 0.04);
        assert!((large.bundles[0].reference_length - 31.2).abs() < 1e-9);
        let points = |k: &KneeInput| {
            let (f, t) = k.bundles[0].fibres[0];
            [k.frames.0.origin, k.frames.1.origin, k.femur.vertices[0], f, t]
        };
        let (then, now) = (points(&input), points(&large));
        for (i, j) in (0..5).flat_map(|i| (0..i).map(move |j| (i, j))) {
            assert!(((now[i] - now[j]).norm() - 1.04 * (then[i] - then[j]).norm()).abs() < 1e-9, "{i} {j}");
        }
    }

    #[test]
    fn two_places_change_where_they_differ() {
        assert_eq!(swapped(&hidden("x_swapped_trials", &[("one", 0.25), ("other", 0.75)]), 8), Some((2, 6)));
        assert_eq!(swapped(&hidden("x_swapped_trials", &[("one", 0.3), ("other", 0.31)]), 8), None);
        assert_eq!(swapped(&hidden("x_adhesion", &[]), 8), None);
    }
}
