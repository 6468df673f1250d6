//! Where a graft leaves the bones, and what its site and its tension do.

use super::{knee, single, value, with_acl_moved};
use genu::plan::{Outcome, outcome};
use meshes::Point;
use notices::Kind;
use sim::spec::ModelSpec;

#[test]
fn a_femoral_site_further_forwards_loads_a_graft_in_flexion_and_further_back_slackens_it() {
    let (_, spec, surfaces) = knee();
    let at = |mm: f64| {
        let plan = single(&format!(", move_mm = [{mm:.1}, 0, 0]"), "tension_n = 40\nat_flexion_deg = 20");
        let out = outcome(spec, surfaces, &plan).unwrap();
        [20.0, 90.0].map(|fe| value(&out, "unloaded", fe, "reconstructed", "graft_g_n"))
    };
    let [back, native, front] = [-4.0, 0.0, 4.0].map(at);
    // all are fixed at one tension, and part with flexion
    assert!([back, native, front].iter().all(|f| (f[0] - 40.0).abs() < 1.0), "{back:?} {native:?} {front:?}");
    assert!(front[1] > native[1] + 20.0 && native[1] > back[1], "{back:?} {native:?} {front:?}");
    // forwards: taut in flexion; backwards: slacker than where it was fixed
    assert!(front[1] > front[0] && back[1] < back[0], "{back:?} {front:?}");
}

/// Where the first graft of a plan leaves the bones: femur, tibia.
fn places(out: &Outcome) -> [Point; 2] {
    [Point::from(out.grafts[0].femur_mm), Point::from(out.grafts[0].tibia_mm)]
}

#[test]
fn a_site_moves_as_far_along_the_bone_as_it_is_asked_to() {
    let (_, spec, surfaces) = knee();
    let given = single("", "slack_length_mm = 60");
    let at = |bone: usize, mm: f64| {
        let mut plan = given.clone();
        let site = if bone == 0 { &mut plan.graft[0].femur } else { &mut plan.graft[0].tibia };
        site.move_mm = [mm, 0.0, 0.0];
        places(&outcome(spec, surfaces, &plan).unwrap())[bone]
    };
    for (bone, frame) in [&spec.frames.femur, &spec.frames.tibia].into_iter().enumerate() {
        // a footprint's centre lies a little off the bone: a small step lays it there
        let start = at(bone, 0.01);
        for mm in [-4.0, 4.0] {
            let way = at(bone, mm) - start;
            // along a curved bone the straight way is a little shorter
            assert!((way.norm() - 4.0).abs() < 0.5, "bone {bone}, {mm} mm: {:.2} mm", way.norm());
            assert!(way.dot(&frame.anterior) * mm > 0.0, "bone {bone}, {mm} mm: {way:?}");
        }
    }
}

/// A plan whose graft begins elsewhere than was asked says so, and no other does; the percentages are those that a typed site is refused by.
#[test]
fn a_site_that_is_moved_off_its_wall_or_not_as_far_as_asked_is_told() {
    let (_, spec, surfaces) = knee();
    let told = |by: [f64; 3]| {
        let mut plan = single("", "slack_length_mm = 30");
        plan.graft[0].femur.move_mm = by;
        let out = outcome(spec, surfaces, &plan).unwrap();
        let percent = out.grafts[0].quadrant_percent;
        let far = out.notices.iter().filter(|n| n.kind == Kind::GivenFar);
        (percent, far.map(ToString::to_string).collect::<Vec<String>>())
    };
    let mut off_the_wall = 0;
    for by in [[0.0; 3], [3.0, 0.0, 0.0], [-3.0, 0.0, 0.0], [0.0, 30.0, 0.0], [0.0, -30.0, 0.0], [30.0, 0.0, 0.0]] {
        let (percent, texts) = told(by);
        let is_off = by != [0.0; 3] && percent.is_none_or(|both| both.iter().any(|p| !(-10.0..=110.0).contains(p)));
        let is_told =
            |t: &String| t.contains("as for a typed site") || t.contains("begins on the lateral wall of the notch");
        assert_eq!(texts.iter().any(is_told), is_off, "{by:?}: {percent:?} {texts:?}");
        off_the_wall += usize::from(is_off);
        if by.iter().all(|x| x.abs() < 4.0) {
            assert!(texts.is_empty(), "{by:?}: {texts:?}");
        }
    }
    assert!(off_the_wall > 0, "no move of 30 mm leaves the wall");
    // the condyle ends sooner than 30 mm below the notch's roof
    let (_, texts) = told([0.0, -30.0, 0.0]);
    assert!(texts.iter().any(|t| t.contains("asks for 30.0 mm along the bone")), "{texts:?}");
}

#[test]
fn an_acl_that_is_not_on_the_wall_of_the_notch_has_its_graft_laid_there() {
    let (_, spec, surfaces) = knee();
    let frame = &spec.frames.femur;
    let slack = single("", "slack_length_mm = 60");
    // above the roof, behind the condyle, below it: where a rule of the literature or a wrong mark may fall
    for off in [frame.superior * 25.0, frame.superior * 15.0 - frame.anterior * 10.0, frame.superior * -30.0] {
        let out = outcome(&with_acl_moved(spec, off), surfaces, &slack).unwrap();
        let percent = out.grafts[0].quadrant_percent.unwrap();
        assert!(percent.iter().zip([24.8, 28.5]).all(|(x, y)| (x - y).abs() < 0.1), "{off:?}: {percent:?}");
        assert!(out.notices.iter().any(|n| n.kind == Kind::GivenFar), "{off:?}: {:?}", out.warnings);
        assert!((places(&out)[0] - frame.origin).dot(&frame.medial) < -3.0, "{off:?}: not lateral of the midline");
    }
    // each bundle keeps its place above or below the other
    let height = |spec: &ModelSpec, name: &str| {
        let mut plan = slack.clone();
        plan.graft[0].femur.native = Some(name.to_owned());
        (places(&outcome(spec, surfaces, &plan).unwrap())[0] - frame.origin).dot(&frame.superior)
    };
    let apart = |spec: &ModelSpec| height(spec, "ACL_AM") - height(spec, "ACL_PL");
    let (own, laid) = (apart(spec), apart(&with_acl_moved(spec, frame.superior * 25.0)));
    assert!(own > 2.0 && (laid - own).abs() < 1.0, "{own} {laid}");
}

#[test]
fn a_graft_that_was_laid_on_the_wall_obeys_the_law_of_its_site() {
    let (_, spec, surfaces) = knee();
    let high = with_acl_moved(spec, spec.frames.femur.superior * 25.0);
    let at = |mm: f64| {
        let plan = single(&format!(", move_mm = [{mm:.1}, 0, 0]"), "tension_n = 40\nat_flexion_deg = 20");
        value(&outcome(&high, surfaces, &plan).unwrap(), "unloaded", 90.0, "reconstructed", "graft_g_n")
    };
    let [back, here, front] = [-4.0, 0.0, 4.0].map(at);
    assert!(front > here + 5.0 && here >= back, "{back} {here} {front}");
}

#[test]
fn more_tension_draws_the_tibia_back_turns_it_out_and_presses_the_knee_together() {
    let (_, spec, surfaces) = knee();
    let at = |n: f64| {
        let out = outcome(spec, surfaces, &single("", &format!("tension_n = {n}\nat_flexion_deg = 20"))).unwrap();
        let of = |name: &str| value(&out, "unloaded", 20.0, "reconstructed", name);
        [of("ap_mm"), of("contact_medial_force_n") + of("contact_lateral_force_n"), of("graft_g_n"), of("ie_deg")]
    };
    let all = [10.0, 40.0, 120.0].map(at);
    for pair in all.windows(2) {
        assert!(pair[1][0] < pair[0][0] - 0.1 && pair[1][1] > pair[0][1], "{all:?}");
        assert!(pair[1][3] > pair[0][3] + 0.1, "{all:?}");
    }
    assert!(all.iter().zip([10.0, 40.0, 120.0]).all(|(a, n)| (a[2] - n).abs() < 1.0), "{all:?}");
}
