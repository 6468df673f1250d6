//! A laboratory's own frames, in the shape of 05-frames/frames.json.

use super::FramesOptions;
use crate::StageError;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};

/// How far axes may be from unit length and from square, and still be taken for rounded ones [-].
const ROUNDED: f64 = 1e-2;

/// What the file gives; other keys of frames.json are allowed and not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GivenFrames {
    /// The femur's.
    pub femur: GivenFrame,
    /// The tibia's.
    pub tibia: GivenFrame,
}

/// Origin [mm] and axes of a frame, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GivenFrame {
    /// Origin [mm].
    pub origin: [f64; 3],
    /// Unit vector.
    pub medial: [f64; 3],
    /// Unit vector.
    pub anterior: [f64; 3],
    /// Unit vector.
    pub superior: [f64; 3],
}

/// Reads the file.
///
/// # Errors
/// The file, the line and what was expected.
pub fn read(path: &str, bytes: &[u8]) -> Result<GivenFrames, StageError> {
    serde_json::from_slice(bytes).map_err(|e| {
        StageError::file(path, format_args!("{e}; expected femur and tibia, each with origin, medial, anterior, superior (three numbers each), as in 05-frames/frames.json"))
    })
}

/// The given frames made exact: the medial axis is kept for the femur, the superior one for the tibia. `found` are those that the bones
/// show, femur first.
///
/// # Errors
/// Axes that are not unit, not square or of the other hand, an origin far from the bone: with the key and what was expected.
pub(super) fn frames(
    given: &GivenFrames,
    found: [&AnatomicalFrame; 2],
    side: Side,
    options: &FramesOptions,
    warnings: &mut Vec<Notice>,
) -> Result<(AnatomicalFrame, AnatomicalFrame), StageError> {
    let femur = checked("femur", &given.femur, side)?;
    let tibia = checked("tibia", &given.tibia, side)?;
    for (bone, own, seen) in [("femur", &femur, found[0]), ("tibia", &tibia, found[1])] {
        compare(bone, own, seen, options, warnings);
    }
    Ok((femur, tibia))
}

fn checked(bone: &str, given: &GivenFrame, side: Side) -> Result<AnatomicalFrame, StageError> {
    let axes = [&given.medial, &given.anterior, &given.superior].map(|a| Vector::from_row_slice(a));
    let names = ["medial", "anterior", "superior"];
    let refuse = |what: String| Err(StageError::part(format_args!("[frames] {bone}"), what));
    if given.origin.iter().chain(axes.iter().flat_map(|a| a.iter())).any(|x| !x.is_finite()) {
        return refuse("a number is not finite; expected origin in mm and three unit vectors".into());
    }
    for (name, axis) in names.iter().zip(&axes) {
        if (axis.norm() - 1.0).abs() > ROUNDED {
            return refuse(format!("{name} has length {:.3}; expected a unit vector", axis.norm()));
        }
    }
    for (i, j) in [(0, 1), (1, 2), (0, 2)] {
        let cosine = axes[i].dot(&axes[j]);
        if cosine.abs() > ROUNDED {
            let angle = cosine.acos().to_degrees();
            return refuse(format!("{} and {} make {angle:.1} deg; expected 90", names[i], names[j]));
        }
    }
    let up = axes[2].normalize();
    let frame = super::square_about(Point::from(given.origin), &(axes[0] - up * axes[0].dot(&up)), &up, side);
    let Some(frame) = frame else { return refuse("medial and superior are parallel".into()) };
    if frame.anterior.dot(&axes[1]) < 0.0 {
        return refuse(format!(
            "anterior points backwards for a {} knee; check the side, or turn anterior or medial round",
            if side == Side::Left { "left" } else { "right" }
        ));
    }
    Ok(frame)
}

/// Warns where a given frame is far from what the bone shows.
fn compare(bone: &str, own: &AnatomicalFrame, seen: &AnatomicalFrame, o: &FramesOptions, warnings: &mut Vec<Notice>) {
    let [most_deg, most_mm] = o.given_limits;
    for (name, a, b) in [("medial", own.medial, seen.medial), ("superior", own.superior, seen.superior)] {
        let angle = a.cross(&b).norm().atan2(a.dot(&b)).to_degrees();
        if angle > most_deg {
            warnings.push(Kind::GivenAxisFar.notice(format!(
                "[frames] {bone}: the {name} axis lies {angle:.0} deg from the one that the bone shows, more than {most_deg}; the given one is used: check its frame and sign"
            )).of(bone));
        }
    }
    let apart = (own.origin - seen.origin).norm();
    if apart > most_mm {
        warnings.push(Kind::GivenOriginFar.notice(format!(
            "[frames] {bone}: the origin lies {apart:.0} mm from the one that the bone shows, more than {most_mm}; the given one is used: check its unit and frame"
        )).of(bone));
    }
}
