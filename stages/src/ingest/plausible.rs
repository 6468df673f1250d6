//! What specimen.toml says of a person and of ligaments, and landmarks away from the knee, held against what people are.

use super::held::WIDTH_MM;
use super::{OPTIONAL_PATHS, bodies, middle_extent};
use crate::anatomy::joint_point;
use crate::specimen::{Identity, LigamentStart, NamedPoint, PointFrame, SpecimenFile};
use crate::{PerBone, StageError};
use attachments::bundle::BUNDLES;
use meshes::Point;
use meshes::surface::TriMesh;
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
    let (Some(medial), Some(lateral)) = (at("epicondyle_medial"), at("epicondyle_lateral")) else { return Ok(()) };
    let axes = bodies::axes(&ct.femur, &ct.tibfib, file.specimen.side).filter(|axes| axes.fibula.is_some());
    match axes {
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

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::frame::Side;

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
