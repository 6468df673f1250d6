//! What specimen.toml says of a person and of ligaments, and landmarks away from the knee, held against what people are.

use super::held::WIDTH_MM;
use super::{OPTIONAL_PATHS, bodies, middle_extent};
use crate::anatomy::{LEAST_SECTIONS, RoughAxes, joint_point};
use crate::frames::from_shaft;
use crate::specimen::{Identity, LigamentStart, NamedPoint, PointFrame, SpecimenFile};
use crate::{PerBone, StageError};
use attachments::bundle::BUNDLES;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice, plain};
use std::collections::BTreeMap;

/// What people are: years, cm, kg. Children and giants are within. Ours.
const AGE_YEARS: [f64; 2] = [0.0, 120.0];
const HEIGHT_CM: [f64; 2] = [45.0, 260.0];
const MASS_KG: [f64; 2] = [2.5, 350.0];
/// Reference strains beyond these are no ratio of lengths [-]: Table 3 of [andreassen2025] has 0.55 to 1.25, and a ligament tears at 1.3. Ours.
const REFERENCE_STRAIN: [f64; 2] = [0.45, 1.35];
/// Stiffness this many times beyond the range of Table 3 is of another unit [-]. Ours.
const STIFFNESS_TIMES: f64 = 10.0;
/// How far landmarks lie from the joint in a knee of [`WIDTH_MM`] [mm]. Ours: two published knees and three phantoms have the hip at 430 to 480, the
/// distal shaft at 85 to 100; femora are 400 to 500 long and tibiae 320 to 430.
const FAR_MM: [(&str, [f64; 2]); 3] =
    [("femoral_head_center", [260.0, 640.0]), ("ankle_center", [200.0, 580.0]), ("tibial_shaft_distal", [45.0, 580.0])];
/// The way from the knee to the ankle turns from the tibia's shaft by no more than this [deg]. Ours: the axis of a tibia's upper half and its mechanical
/// axis lie within 3 deg of each other, and a shaft that is cut short shows its own within a few.
const ANKLE_ASTRAY_DEG: f64 = 8.0;
/// The same where no shaft shows its axis and the plateaus stand for it [deg]: slopes of plateaus differ by some 3 deg from knee to knee. Ours.
const ANKLE_ASTRAY_OF_PLATEAUS_DEG: f64 = 12.0;
/// The way from the knee to the femoral head turns, medially or laterally, from the usual one by no more than this [deg]. Ours: in two published knees and
/// two phantoms by 3, in limbs with little or much valgus by 5. Forwards and backwards it says nothing: femora are bowed.
const HEAD_ASTRAY_DEG: f64 = 8.0;
/// The usual way to the head: so far medially from the femur's shaft [deg] [yoshioka1987].
const VALGUS_DEG: f64 = 6.0;
/// The epicondyles lie this far on their own sides at least, or nothing is said [mm]; they are 75 apart. Ours.
const SIDE_MM: f64 = 20.0;

/// Holds all of it.
///
/// # Errors
/// Epicondyles in each other's place.
pub(super) fn check(
    file: &SpecimenFile,
    landmarks: &[NamedPoint],
    ct: &PerBone<TriMesh>,
    warnings: &mut Vec<Notice>,
) -> Result<(), StageError> {
    warnings.extend(person(&file.specimen));
    warnings.extend(ligaments(&file.ligaments));
    let path = file.points.landmarks.as_deref().unwrap_or(OPTIONAL_PATHS[0]);
    let at = |name: &str| landmarks.iter().find(|p| p.frame == PointFrame::Ct && p.name == name).map(|p| p.point);
    let scale = middle_extent(&ct.femur) / WIDTH_MM;
    warnings.extend(far(path, ct, scale, &at));
    let ends = (at("epicondyle_medial"), at("epicondyle_lateral"));
    let (ankle, head) = (at("ankle_center"), at("femoral_head_center"));
    if ankle.is_none() && head.is_none() && (ends.0.is_none() || ends.1.is_none()) {
        return Ok(());
    }
    let axes = bodies::axes(&ct.femur, &ct.tibfib, file.specimen.side);
    if let Some(axes) = &axes {
        let ways = [ankle.map(|p| to_ankle(p, axes)), head.and_then(|p| to_head(p, axes))];
        warnings.extend(ways.into_iter().flatten().filter_map(|way| astray(path, &way, axes)));
    }
    let (Some(medial), Some(lateral)) = ends else { return Ok(()) };
    match axes.filter(|axes| axes.fibula.is_some()) {
        Some(axes) if (lateral - medial).dot(&axes.lateral) < -SIDE_MM * scale => Err(StageError::file(
            path,
            "epicondyle_medial lies on the lateral side and epicondyle_lateral on the medial one: exchange their names, or correct the side in specimen.toml",
        )),
        _ => Ok(()),
    }
}

/// Numbers of a person that nobody has.
fn person(who: &Identity) -> Vec<Notice> {
    let all = [
        ("age_years", who.age_years, AGE_YEARS, "is it the year of birth?"),
        ("height_cm", who.height_cm, HEIGHT_CM, "is it in m, mm or inches?"),
        ("mass_kg", who.mass_kg, MASS_KG, "is it in g or N?"),
    ];
    let odd = |(key, value, [least, most], what): (&str, Option<f64>, [f64; 2], &str)| {
        let value = value.filter(|x| !(least..=most).contains(x))?;
        let text = format!("specimen.{key} is {}; expected {least} to {most}: {what}", plain(value));
        Some(Kind::OddSize.notice(text).of(key))
    };
    all.into_iter().filter_map(odd).collect()
}

/// Numbers of ligaments in another unit, or strains in place of ratios of lengths.
fn ligaments(starts: &BTreeMap<String, LigamentStart>) -> Vec<Notice> {
    let mut found = Vec::new();
    for (name, start) in starts {
        let [least, most] = REFERENCE_STRAIN;
        if let Some(strain) = start.reference_strain.filter(|e| !(least..=most).contains(e)) {
            let text = format!(
                "ligaments.{name}.reference_strain is {}; expected {least} to {most}: it is the length in the CT pose over the slack length, 1.05 where the bundle is strained by 5 %",
                plain(strain)
            );
            found.push(Kind::OddStiffness.notice(text).of(name));
        }
        let Some(bundle) = BUNDLES.iter().find(|b| b.name == *name) else { continue };
        let range = &bundle.stiffness_n_per_mm;
        let [least, most] = [range.lower / STIFFNESS_TIMES, range.upper * STIFFNESS_TIMES];
        if let Some(k) = start.stiffness_n_per_mm.filter(|k| !(least..=most).contains(k)) {
            let text = format!(
                "ligaments.{name}.stiffness_n_per_mm is {}; expected {} to {}, which is ten times beyond the literature's either way: is it in N/m, or in N for a strain of 1?",
                plain(k),
                plain(least),
                plain(most)
            );
            found.push(Kind::OddStiffness.notice(text).of(name));
        }
    }
    found
}

/// Landmarks of hip, shaft and ankle that lie nearer to the knee, or farther, than in anybody.
fn far(path: &str, ct: &PerBone<TriMesh>, scale: f64, at: &dyn Fn(&str) -> Option<Point>) -> Vec<Notice> {
    if FAR_MM.iter().all(|(name, _)| at(name).is_none()) {
        return Vec::new();
    }
    let Ok(joint) = joint_point(&ct.femur, &ct.tibfib) else { return Vec::new() };
    let odd = |(name, [least, most]): (&'static str, [f64; 2])| {
        let far = (at(name)? - joint).norm();
        let [least, most] = [least * scale, most * scale];
        (!(least..=most).contains(&far)).then(|| {
            let text = format!(
                "{path}: {name} lies {far:.0} mm from the joint, expected {least:.0} to {most:.0} in a knee of this size: check its coordinates, their unit (mm), and its name"
            );
            Kind::ShaftLandmarkFar.notice(text).file(path).of(name)
        })
    };
    FAR_MM.into_iter().filter_map(odd).collect()
}

/// The way from the knee to a landmark at a bone's far end, and the usual one.
struct Way {
    name: &'static str,
    /// The line from which it is told, and the bone at its other end.
    words: [&'static str; 2],
    point: Point,
    /// From the knee [mm].
    way: Vector,
    usual: Vector,
    most_deg: f64,
}

fn to_ankle(point: Point, axes: &RoughAxes) -> Way {
    let shaft = &axes.tibia_shaft;
    let is_shown = shaft.sections >= LEAST_SECTIONS;
    let most_deg = if is_shown { ANKLE_ASTRAY_DEG + shaft.turn_deg } else { ANKLE_ASTRAY_OF_PLATEAUS_DEG };
    let (way, usual) = (point - axes.joint, shaft.direction);
    Way { name: "ankle_center", words: ["tibia's long axis", "femur"], point, way, usual, most_deg }
}

/// The way across and up. Only a shaft shows where the head may lie.
fn to_head(point: Point, axes: &RoughAxes) -> Option<Way> {
    let shaft = &axes.femur_shaft;
    let usual = from_shaft(axes, VALGUS_DEG);
    let forwards = shaft.direction.cross(&axes.lateral).try_normalize(1e-6)?;
    let way = point - axes.joint;
    let way = way - forwards * way.dot(&forwards);
    let words = ["femur's usual mechanical axis", "tibia"];
    let most_deg = HEAD_ASTRAY_DEG + shaft.turn_deg;
    (shaft.sections >= LEAST_SECTIONS).then_some(Way {
        name: "femoral_head_center",
        words,
        point,
        way,
        usual,
        most_deg,
    })
}

/// A landmark beside the way that its bone's shaft leads, or at the other end of the knee: the bone's frame would be turned by as much.
fn astray(path: &str, to: &Way, axes: &RoughAxes) -> Option<Notice> {
    let way = to.way;
    let turned = way.angle(&to.usual).to_degrees();
    // a landmark at the joint itself has no direction
    if turned.is_nan() || turned <= to.most_deg {
        return None;
    }
    let beside = way - to.usual * way.dot(&to.usual);
    let sides = [(axes.lateral, ["lateral", "medial"]), (axes.anterior, ["anterior", "posterior"])];
    let [across, along] = sides.map(|(axis, names)| (beside.dot(&axis), names));
    let (far, names) = if across.0.abs() < along.0.abs() { along } else { across };
    let [line, other] = to.words;
    let end = if way.dot(&to.usual) < 0.0 { format!(", at the {other}'s end of the knee") } else { String::new() };
    let text = format!(
        "{path}: {} lies {:.0} mm {} of the {line}{end}: its way from the knee turns by {turned:.1} deg from that axis, expected {:.1} at most; the bone's frame turns with it: check the point, its frame and its name",
        to.name,
        beside.norm(),
        names[usize::from(far < 0.0)],
        to.most_deg
    );
    let place = [to.point.x, to.point.y, to.point.z];
    Some(Kind::ShaftLandmarkFar.notice(text).file(path).of(to.name).at(place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::Shaft;
    use meshes::frame::Side;

    /// A left knee at the origin, up along z, with its forwards along -y; its tibia's shaft is shown by so many sections.
    fn knee(sections: usize, scale: f64) -> RoughAxes {
        let shaft = |direction: Vector| Shaft {
            point: Point::from(direction * 50.0 * scale),
            direction,
            sections,
            size_mm: 60.0 * scale,
            range_mm: [30.0 * scale, 120.0 * scale],
            turn_deg: 1.0,
        };
        RoughAxes {
            superior: Vector::z(),
            anterior: -Vector::y(),
            lateral: Vector::x(),
            joint: Point::origin(),
            femur_shaft: shaft(Vector::z()),
            tibia_shaft: shaft(-Vector::z()),
            fibula: None,
            protrusion: 0.3,
        }
    }

    #[test]
    fn an_ankle_beside_the_tibia_or_at_its_wrong_end_is_told_in_a_knee_of_any_size() {
        for scale in [0.6, 1.0, 1.3] {
            let told = |x: f64, y: f64, z: f64, sections: usize| {
                let ankle = Point::from(Vector::new(x, y, z) * scale);
                let knee = knee(sections, scale);
                astray("l.csv", &to_ankle(ankle, &knee), &knee).map(|n| n.text)
            };
            for sections in [2, 30] {
                assert_eq!(told(0.0, 0.0, -400.0, sections), None);
                // as much as tibiae are bowed, either way
                for at in [-35.0, 35.0] {
                    assert_eq!(told(at, 0.0, -400.0, sections), None);
                    assert_eq!(told(0.0, at, -400.0, sections), None);
                }
                for (x, y, word) in [
                    (100.0, 0.0, "lateral"),
                    (-100.0, 0.0, "medial"),
                    (20.0, -100.0, "anterior"),
                    (20.0, 100.0, "posterior"),
                ] {
                    let words = told(x, y, -400.0, sections).unwrap();
                    let off = x.hypot(y) * scale;
                    assert!(words.contains(&format!("lies {off:.0} mm {word} of the tibia's long axis")), "{words}");
                    // the limit is 8 deg, and 1 by which the shaft itself may be off, or 12 where the plateaus stand for it
                    let most = if sections < LEAST_SECTIONS { "12.0" } else { "9.0" };
                    assert!(
                        words.contains("turns by 14.") && words.contains(&format!("expected {most} at most")),
                        "{words}"
                    );
                    assert!(!words.contains("the femur's end"), "{words}");
                }
                assert!(told(10.0, 0.0, 400.0, sections).unwrap().contains("at the femur's end"));
            }
            assert_eq!(told(0.0, 0.0, 0.0, 30), None);
        }
    }

    #[test]
    fn a_head_far_beside_the_mechanical_axis_is_told_where_a_shaft_shows_it() {
        let told = |x: f64, y: f64, sections: usize| {
            let knee = knee(sections, 1.0);
            let way = to_head(Point::new(x, y, 450.0), &knee)?;
            astray("l.csv", &way, &knee).map(|n| n.text)
        };
        // medial of the shaft by 0 to 12 deg, and bowed forwards or backwards
        for x in [0.0, -47.0, -95.0] {
            for y in [-90.0, 0.0, 90.0] {
                assert_eq!(told(x, y, 30), None, "{x} {y}");
            }
        }
        for (x, word) in [(100.0, "lateral"), (-147.0, "medial")] {
            let words = told(x, 0.0, 30).unwrap();
            assert!(words.contains(&format!("mm {word} of the femur's usual mechanical axis")), "{words}");
        }
        assert_eq!(told(100.0, 0.0, 2), None);
    }

    #[test]
    fn numbers_of_a_person_in_another_unit_are_told() {
        let who = |age: f64, height: f64, mass: f64| Identity {
            id: "k".into(),
            side: Side::Left,
            sex: None,
            age_years: Some(age),
            height_cm: Some(height),
            mass_kg: Some(mass),
            provenance: None,
            note: None,
        };
        let told = |who: &Identity| notices::texts(&person(who)).join(" ");
        for usual in [who(29.0, 188.0, 113.4), who(3.0, 95.0, 14.0)] {
            assert_eq!(told(&usual), "");
        }
        let words = told(&who(1954.0, 1.75, 75_000.0));
        for word in ["year of birth", "in m", "in g"] {
            assert!(words.contains(word), "{words}");
        }
    }

    #[test]
    fn every_range_of_table_3_passes_and_other_units_are_told() {
        let of = |name: &str, strain: f64, k: f64| {
            let start = LigamentStart { reference_strain: Some(strain), stiffness_n_per_mm: Some(k) };
            notices::texts(&ligaments(&BTreeMap::from([(name.to_owned(), start)]))).join(" ")
        };
        for b in BUNDLES.iter() {
            for (strain, k) in [
                (b.reference_strain.lower, b.stiffness_n_per_mm.lower),
                (b.reference_strain.upper, b.stiffness_n_per_mm.upper),
            ] {
                assert_eq!(of(&b.name, strain, k), "");
            }
        }
        assert!(of("ACL_AM", 0.05, 70.0).contains("slack length"));
        assert!(of("ACL_AM", 105.0, 70.0).contains("slack length"));
        assert!(of("ACL_AM", 1.05, 68_500.0).contains("N/m"));
    }
}
