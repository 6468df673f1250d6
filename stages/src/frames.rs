//! Stage 5, frames: transepicondylar and tibial frames, Grood-Suntay pose in CT.

pub mod given;
mod patella;

use crate::StageError;
use crate::anatomy::{LEAST_SECTIONS, RoughAxes, Shaft, rough_axes};
use crate::bones::Bones;
use crate::condyles::{Cylinder, Directions, condylar_cylinder, epicondyles};
use crate::eminences::{eminences, on_the_bone};
use crate::plateaus::plateau_centres;
use crate::specimen::{PointFrame, Specimen};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, FE, IE, ML, SI, VV};
use sim::joint::Joint;
use sim::spec::{FramesSpec, PoseSpec};

/// Grood-Suntay coordinates in clinical signs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroodSuntayPose {
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Valgus [deg].
    pub vv_deg: f64,
    /// External rotation of the tibia [deg].
    pub ie_deg: f64,
    /// Lateral [mm].
    pub ml_mm: f64,
    /// Anterior [mm].
    pub ap_mm: f64,
    /// Superior [mm].
    pub si_mm: f64,
}

/// The anatomical frames, CT coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// The femur's: medial along the transepicondylar axis, origin on it.
    pub femur: AnatomicalFrame,
    /// The tibia's, after [grood1983]: origin on the bone, midway between the intercondylar eminences.
    pub tibia: AnatomicalFrame,
    /// The tibia's axes as the bone shows them, origin midway between the centres of the plateaus: where depths below the joint line begin.
    pub joint_line: AnatomicalFrame,
    /// The pose in CT.
    pub gs_ct_pose: GroodSuntayPose,
    /// A point [mm] and the unit direction (medial) of the axis of the cylinder fitted to the posterior condyles.
    pub condylar_axis: (Point, Vector),
    /// Its radius [mm].
    pub condylar_radius_mm: f64,
    /// Angle between it and the transepicondylar axis, in the axial plane [deg].
    pub condylar_angle_deg: f64,
    /// Epicondyles used, medial then lateral [mm].
    pub epicondyles: [Point; 2],
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: FramesMetrics,
}

/// Figures of the frames, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FramesMetrics {
    /// Grood-Suntay coordinates of the CT pose.
    pub gs_ct_pose: GroodSuntayPose,
    /// Angle of the condyles' axis to the transepicondylar one, in the axial plane [deg].
    pub angle_to_tea_axial_deg: f64,
    /// Radius of the cylinder through the posterior condyles [mm].
    pub condylar_radius_mm: f64,
    /// How far the condyles lie from it, root mean square [mm].
    pub condylar_rms_mm: f64,
    /// Distance of the epicondyles [mm].
    pub epicondylar_width_mm: f64,
    /// Sections that show the femur's shaft.
    pub femur_shaft_sections: usize,
    /// Sections that show the tibia's.
    pub tibia_shaft_sections: usize,
    /// How far the femur's axis turns where the farthest third of its shaft is left out [deg].
    pub femur_shaft_turn_deg: f64,
    /// How far the tibia's does [deg].
    pub tibia_shaft_turn_deg: f64,
}

/// How frames are assigned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FramesOptions {
    /// Angle from the femoral shaft to the mechanical axis in the coronal plane, used where no femoral head centre is given
    /// [deg]; about 6 in the mean [yoshioka1987].
    pub valgus_deg: f64,
    /// Angles between condylar and transepicondylar axis in the axial plane outside which a warning is given [deg]: 3.7 (sd 1.5) either way.
    pub condylar_angle_range_deg: [f64; 2],
    /// Length of a shaft that shows its axis, over the epicondylar width, below which a warning says that it is cut short [-]. Ours: with 0.43 the
    /// flexion of one knee moved by 0.01 deg as 6 mm were cut off, with 0.36 by 1.6 deg.
    pub least_shaft_share: f64,
    /// Distance of a given landmark from what the bone shows beyond which a warning is given [mm].
    pub landmark_limit_mm: f64,
    /// How far the way to the femoral head or the ankle may lie from the shaft's direction [deg]; beyond, the landmark is refused. Ours: the mechanical
    /// axis lies 5 to 7 deg from the femoral shaft [yoshioka1987], and a shaft cut short shows its axis within a few degrees.
    pub far_landmark_limit_deg: f64,
    /// How far an axis [deg] and an origin [mm] of a laboratory's own frames may lie from those that the bones show without a warning. Ours: twice
    /// what two constructions of a frame differ by.
    pub given_limits: [f64; 2],
    /// Varus-valgus and internal-external rotation of the CT pose beyond which a warning is given [deg]: a knee at rest is not turned so far; our
    /// own choice.
    pub ct_rotation_limit_deg: [f64; 2],
}

impl Default for FramesOptions {
    fn default() -> Self {
        FramesOptions {
            valgus_deg: 6.0,
            condylar_angle_range_deg: [0.8, 6.5],
            least_shaft_share: 0.4,
            landmark_limit_mm: 12.0,
            far_landmark_limit_deg: 20.0,
            given_limits: [12.0, 12.0],
            ct_rotation_limit_deg: [10.0, 18.0],
        }
    }
}

/// The distance of the epicondyles over the radius of the posterior condyles [-]: 4.2 and 4.3 in two dissected knees, 3.6 in phantoms. Ours, with a
/// seventh to both sides. A femur stretched forwards keeps it.
const USUAL_WIDTHS: [f64; 2] = [3.1, 4.9];

/// A femur of proportions that none has: its axes are of different units.
fn stretched(width_mm: f64, radius_mm: f64) -> Option<Notice> {
    let [least, most] = USUAL_WIDTHS;
    let ratio = width_mm / radius_mm;
    (!(least..=most).contains(&ratio)).then(|| {
        Kind::Proportions.notice(format!(
            "the femur is {width_mm:.0} mm wide over its epicondyles, {ratio:.1} times the radius of its condyles ({radius_mm:.0} mm), where femora have {least} to {most}: the picture is stretched along one axis; check its slice spacing and pixel spacing"
        )).of("femur")
    })
}

/// Assigns the anatomical frames from the bones' shapes, and from landmarks where they are given.
///
/// Femur: medial along the transepicondylar axis, origin midway between the epicondyles; superior towards the centre of the
/// femoral head (else along the shaft, turned by the mean valgus), made square to it. Tibia [grood1983]: superior along the shaft
/// (towards the middle of the plateaus from the ankle where that is given); medial along the line of the plateaus' centres, made
/// square to it; origin on the bone, midway between the intercondylar eminences. A laboratory's own frames take the place of both.
///
/// # Errors
/// Bones in which no shaft, condyles or plateaus are found, with what to do.
pub fn frames(specimen: &Specimen, bones: &Bones, options: &FramesOptions) -> Result<Frames, StageError> {
    let (femur, tibfib) = (&bones.surfaces.femur, &bones.surfaces.tibfib);
    let side = specimen.identity.side;
    let rough = rough_axes(femur, tibfib, side)?;
    let mut warnings = Vec::new();
    let plateaus = "; where no landmark tells, it is taken from the plateaus";
    for (name, shaft, instead) in [("femur", &rough.femur_shaft, ""), ("tibia", &rough.tibia_shaft, plateaus)] {
        if shaft.sections < LEAST_SECTIONS {
            warnings.push(
                Kind::ShortShaft
                    .notice(format!(
                        "the {name}'s shaft is too short for its axis to be found well ({} whole sections){instead}",
                        shaft.sections
                    ))
                    .of(name),
            );
        }
    }
    let mark = |name: &str| landmark(specimen, name);
    let (femoral, cylinder, ends) = femoral_frame(femur, &rough, side, &mark, options, &mut warnings)?;
    let width_mm = (ends[0] - ends[1]).norm();
    warnings.extend(stretched(width_mm, cylinder.radius));
    warnings.extend(bones.patella.as_ref().and_then(|p| patella::misplaced(p, &femoral, width_mm)));
    warnings.extend(short_shafts(&rough, width_mm, &mark, options));
    let (tibial, joint_line) = tibial_frame(tibfib, &rough, side, &mark, options, &mut warnings)?;
    let (femoral, tibial) = match &specimen.given_frames {
        Some(given) => given::frames(given, [&femoral, &tibial], side, options, &mut warnings)?,
        None => (femoral, tibial),
    };
    let gs_ct_pose = grood_suntay(&femoral, &tibial, side)?;
    let angle = axial_angle_deg(&cylinder.direction, &femoral);
    let [least, most] = options.condylar_angle_range_deg;
    if !(least..=most).contains(&angle.abs()) {
        warnings.push(Kind::CondylarAxis.notice(format!(
            "the condylar axis lies {:.1} deg from the transepicondylar axis in the axial plane, outside {least} to {most} deg: look at the epicondyles in the report, or give epicondyle_medial and epicondyle_lateral in landmarks.csv",
            angle.abs()
        )));
    }
    let [vv, ie] = options.ct_rotation_limit_deg;
    if gs_ct_pose.vv_deg.abs() > vv || gs_ct_pose.ie_deg.abs() > ie {
        warnings.push(Kind::CtPoseTurned.notice(format!(
            "in the CT pose the tibia stands at {:.0} deg of varus-valgus and {:.0} deg of internal-external rotation, more than {vv} and {ie} deg: an axis of one bone may be wrong; look at both frames in the report",
            gs_ct_pose.vv_deg, gs_ct_pose.ie_deg
        )));
    }
    // a frame that is given may have its origin elsewhere
    if specimen.given_frames.is_none() {
        warnings.extend(shifted(gs_ct_pose.ml_mm, gs_ct_pose.ap_mm));
    }
    let metrics = FramesMetrics {
        gs_ct_pose,
        angle_to_tea_axial_deg: angle.abs(),
        condylar_radius_mm: cylinder.radius,
        condylar_rms_mm: cylinder.rms,
        epicondylar_width_mm: width_mm,
        femur_shaft_sections: rough.femur_shaft.sections,
        tibia_shaft_sections: rough.tibia_shaft.sections,
        femur_shaft_turn_deg: rough.femur_shaft.turn_deg,
        tibia_shaft_turn_deg: rough.tibia_shaft.turn_deg,
    };
    Ok(Frames {
        femur: femoral,
        tibia: tibial,
        joint_line,
        gs_ct_pose,
        condylar_axis: (cylinder.point, cylinder.direction),
        condylar_radius_mm: cylinder.radius,
        condylar_angle_deg: angle.abs(),
        epicondyles: ends,
        warnings,
        metrics,
    })
}

/// Grood-Suntay coordinates of a tibia under a femur, clinical signs [grood1983].
///
/// # Errors
/// Frames whose femoral and tibial axes are nearly parallel.
pub fn grood_suntay(
    femur: &AnatomicalFrame,
    tibia: &AnatomicalFrame,
    side: Side,
) -> Result<GroodSuntayPose, StageError> {
    let spec = FramesSpec { femur: *femur, tibia: *tibia, gs_ct_pose: PoseSpec::default(), chain: None, grid: None };
    let q = Joint::new(&spec, side).map_err(|e| StageError::Knee(e.to_string()))?.ct_pose();
    Ok(GroodSuntayPose {
        fe_deg: q[FE].to_degrees(),
        vv_deg: q[VV].to_degrees(),
        ie_deg: q[IE].to_degrees(),
        ml_mm: q[ML],
        ap_mm: q[AP],
        si_mm: q[SI],
    })
}

/// Shafts so short that their axes depend on where the picture ends, where no landmark stands for them.
fn short_shafts(
    rough: &RoughAxes,
    width_mm: f64,
    mark: &dyn Fn(&str) -> Option<Point>,
    options: &FramesOptions,
) -> Vec<Notice> {
    let least = options.least_shaft_share * width_mm;
    let bones = [("femur", &rough.femur_shaft, "femoral_head_center"), ("tibia", &rough.tibia_shaft, "ankle_center")];
    let shown = |shaft: &Shaft| shaft.range_mm[1] - shaft.range_mm[0];
    let short = bones.into_iter().filter(|(_, shaft, landmark)| {
        shaft.sections >= LEAST_SECTIONS && shown(shaft) < least && mark(landmark).is_none()
    });
    let told = short.map(|(bone, shaft, landmark)| {
        Kind::ShaftCutShort.notice(format!(
            "the {bone}'s shaft is cut short: {:.0} mm of it show its axis (expected {least:.0} or more), which turns by {:.1} deg without the farthest third; flexion or varus-valgus may be off by as much; {landmark} in landmarks.csv, or a taller picture, would tell",
            shown(shaft),
            shaft.turn_deg
        ))
        .of(bone)
    });
    told.collect()
}

fn landmark(specimen: &Specimen, name: &str) -> Option<Point> {
    specimen.landmarks.iter().find(|l| l.frame == PointFrame::Ct && l.name == name).map(|l| l.point)
}

fn femoral_frame(
    femur: &TriMesh,
    rough: &RoughAxes,
    side: Side,
    mark: &dyn Fn(&str) -> Option<Point>,
    options: &FramesOptions,
    warnings: &mut Vec<Notice>,
) -> Result<(AnatomicalFrame, Cylinder, [Point; 2]), StageError> {
    let along = match mark("femoral_head_center") {
        Some(head) => towards("femoral_head_center", &(head - rough.joint), &rough.femur_shaft, options)?,
        None => from_shaft(rough, options.valgus_deg),
    };
    let like = Directions { medial: -rough.lateral, anterior: rough.anterior, superior: rough.superior };
    let unclear = || {
        StageError::Knee(
            "no pair of condyles was found on the femur: a distal femur with both condyles was expected".into(),
        )
    };
    let mut d = Directions::with_medial(&like.medial, &along, &like).ok_or_else(unclear)?;
    let mut cylinder = condylar_cylinder(femur, &d, &rough.joint).ok_or_else(unclear)?.0;
    for _ in 0..8 {
        d = Directions::with_medial(&cylinder.direction, &along, &like).ok_or_else(unclear)?;
        cylinder = condylar_cylinder(femur, &d, &rough.joint).ok_or_else(unclear)?.0;
    }
    let found = epicondyles(femur, &cylinder, &d).ok_or_else(unclear)?;
    let ends = match (mark("epicondyle_medial"), mark("epicondyle_lateral")) {
        (Some(medial), Some(lateral)) => {
            for (name, given, seen) in [("medial", medial, found[0]), ("lateral", lateral, found[1])] {
                let apart = (given - seen).norm();
                if apart > options.landmark_limit_mm {
                    warnings.push(Kind::EpicondyleFar.notice(format!("landmark epicondyle_{name} lies {apart:.0} mm from the epicondyle that the bone shows; the landmark is used")));
                }
            }
            [medial, lateral]
        }
        (None, None) => found,
        _ => {
            warnings.push(
                Kind::OneEpicondyle
                    .notice("of the epicondyles only one is given as a landmark; both are taken from the bone"),
            );
            found
        }
    };
    let origin = nalgebra::center(&ends[0], &ends[1]);
    let superior = mark("femoral_head_center").map_or(along, |head| head - origin);
    let frame = square(origin, &(ends[0] - ends[1]), &superior, side).ok_or_else(|| {
        StageError::Knee("the transepicondylar axis and the femur's long axis are parallel: check the landmarks epicondyle_* and femoral_head_center".into())
    })?;
    Ok((frame, cylinder, ends))
}

/// The direction to a landmark at a bone's far end, as its shaft shows that it may be.
fn towards(name: &str, way: &Vector, shaft: &Shaft, options: &FramesOptions) -> Result<Vector, StageError> {
    let off = way.angle(&shaft.direction).to_degrees();
    // a landmark at the knee itself has no direction
    let along = (0.0..=options.far_landmark_limit_deg).contains(&off);
    if shaft.sections >= LEAST_SECTIONS && !along {
        return Err(StageError::Knee(format!(
            "landmark {name} lies {:.0} mm from the knee, {off:.0} deg off the direction of the shaft (limit {}): check its unit, frame and sign",
            way.norm(),
            options.far_landmark_limit_deg
        )));
    }
    Ok(way.normalize())
}

/// The femoral shaft's direction turned in the coronal plane, its upper end medially.
pub(crate) fn from_shaft(rough: &RoughAxes, valgus_deg: f64) -> Vector {
    let shaft = rough.femur_shaft.direction;
    let medial = -(rough.lateral - shaft * rough.lateral.dot(&shaft)).normalize();
    let (sin, cos) = valgus_deg.to_radians().sin_cos();
    shaft * cos + medial * sin
}

fn tibial_frame(
    tibfib: &TriMesh,
    rough: &RoughAxes,
    side: Side,
    mark: &dyn Fn(&str) -> Option<Point>,
    options: &FramesOptions,
    warnings: &mut Vec<Notice>,
) -> Result<(AnatomicalFrame, AnatomicalFrame), StageError> {
    let d = Directions { medial: -rough.lateral, anterior: rough.anterior, superior: rough.superior };
    let [medial, lateral] = plateau_centres(tibfib, &d, &rough.joint).ok_or_else(|| {
        StageError::Knee("no pair of plateaus was found on the tibia: a proximal tibia was expected".into())
    })?;
    let origin = nalgebra::center(&medial, &lateral);
    let distal = mark("tibial_shaft_distal");
    if let Some(p) = distal
        && rough.tibia_shaft.sections >= LEAST_SECTIONS
        && off_line(&p, &rough.tibia_shaft) > options.landmark_limit_mm
    {
        warnings.push(Kind::ShaftLandmarkFar.notice(format!(
            "landmark tibial_shaft_distal lies {:.0} mm from the shaft's axis; the shaft is used",
            off_line(&p, &rough.tibia_shaft)
        )));
    }
    let superior = match (mark("ankle_center"), distal) {
        (Some(ankle), _) => -towards("ankle_center", &(ankle - origin), &rough.tibia_shaft, options)?,
        (None, Some(p)) if rough.tibia_shaft.sections < LEAST_SECTIONS => origin - p,
        _ => rough.superior,
    };
    // Grood and Suntay keep the long axis and turn the mediolateral one.
    let up = superior.try_normalize(1e-6).filter(|u| u.dot(&rough.superior) > 0.5).ok_or_else(|| {
        StageError::Knee(
            "landmark ankle_center or tibial_shaft_distal does not lie below the knee: check its frame and sign".into(),
        )
    })?;
    let across = medial - lateral;
    let joint_line = square_about(origin, &(across - up * across.dot(&up)), &up, side)
        .ok_or_else(|| StageError::Knee("the plateaus lie one above the other: check the tibia's surface".into()))?;
    let shown = eminences(tibfib, &joint_line, across.norm());
    let place = match tips(shown, &joint_line, mark, options.landmark_limit_mm, warnings) {
        Some([a, b]) => nalgebra::center(&a, &b),
        None => {
            warnings.push(Kind::NoEminences.notice("the bone shows no two intercondylar eminences: the tibia's origin lies on the bone above the middle of the plateaus; eminence_medial and eminence_lateral in landmarks.csv would tell"));
            origin
        }
    };
    Ok((AnatomicalFrame { origin: on_the_bone(tibfib, &place, &up), ..joint_line }, joint_line))
}

/// The tips of the eminences: as landmarks give them, which are held against those that the bone shows, else as it shows them.
fn tips(
    shown: Option<[Point; 2]>,
    joint_line: &AnatomicalFrame,
    mark: &dyn Fn(&str) -> Option<Point>,
    limit_mm: f64,
    warnings: &mut Vec<Notice>,
) -> Option<[Point; 2]> {
    let given = match (mark("eminence_medial"), mark("eminence_lateral")) {
        (Some(medial), Some(lateral)) => [medial, lateral],
        (None, None) => return shown,
        _ => {
            let what = "of the intercondylar eminences only one is given as a landmark; both are taken from the bone";
            warnings.push(Kind::NoEminences.notice(what));
            return shown;
        }
    };
    let middle = |[a, b]: [Point; 2]| nalgebra::center(&a, &b);
    let off = middle(given) - shown.map_or(joint_line.origin, middle);
    // the origin is laid on the bone, so that heights do not count
    let apart = (off - joint_line.superior * off.dot(&joint_line.superior)).norm();
    if apart > limit_mm {
        warnings.push(Kind::GivenOriginFar.notice(format!(
            "landmarks eminence_medial and eminence_lateral have their middle {apart:.0} mm beside that of the eminences that the bone shows, more than {limit_mm}; they are used, and the tibia's origin lies there: check their coordinates and names"
        )).of("tibia"));
    }
    Some(given)
}

fn off_line(p: &Point, shaft: &Shaft) -> f64 {
    let x = p - shaft.point;
    (x - shaft.direction * x.dot(&shaft.direction)).norm()
}

/// The frame with exactly `medial`, superior as near as can be.
fn square(origin: Point, medial: &Vector, superior: &Vector, side: Side) -> Option<AnatomicalFrame> {
    let medial = medial.try_normalize(1e-6)?;
    let superior = (superior - medial * superior.dot(&medial)).try_normalize(1e-6)?;
    Some(AnatomicalFrame { origin, medial, anterior: forwards(&medial, &superior, side), superior })
}

/// The frame with exactly `superior` (unit) and `medial` square to it.
fn square_about(origin: Point, medial: &Vector, superior: &Vector, side: Side) -> Option<AnatomicalFrame> {
    let medial = medial.try_normalize(1e-6)?;
    Some(AnatomicalFrame { origin, medial, anterior: forwards(&medial, superior, side), superior: *superior })
}

fn forwards(medial: &Vector, superior: &Vector, side: Side) -> Vector {
    match side {
        Side::Left => superior.cross(medial),
        Side::Right => medial.cross(superior),
    }
}

/// Angle between `axis` and the frame's medial axis seen from above [deg], positive where the frame's is turned forwards medially.
fn axial_angle_deg(axis: &Vector, frame: &AnatomicalFrame) -> f64 {
    -axis.dot(&frame.anterior).atan2(axis.dot(&frame.medial)).to_degrees()
}

/// The tibia of a knee at rest lies no further from the femur's middle: ML, AP [mm]. In two published knees and three phantoms it lies within 2.6 of it. Ours.
const MOST_SHIFT_MM: [f64; 2] = [6.0, 10.0];

/// A CT pose whose bones stand beside each other as in no knee at rest: a bone was moved after the picture.
fn shifted(ml_mm: f64, ap_mm: f64) -> Option<Notice> {
    let [ml, ap] = MOST_SHIFT_MM;
    (ml_mm.abs() > ml || ap_mm.abs() > ap).then(|| {
        Kind::CtPoseTurned.notice(format!(
            "in the CT pose the tibia is shifted against the femur by {ml_mm:.0} mm to the lateral and {ap_mm:.0} mm to the front, more than {ml} and {ap} mm: was one bone moved after the picture, or is it of another one? Look at both bones in the report"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eminences_far_from_those_of_the_bone_are_told_and_one_alone_is_not_used() {
        let joint_line = AnatomicalFrame {
            origin: Point::origin(),
            medial: -Vector::x(),
            anterior: -Vector::y(),
            superior: Vector::z(),
        };
        let shown = [Point::new(-6.0, 2.0, 9.0), Point::new(6.0, 4.0, 8.0)];
        let said = |shown: Option<[Point; 2]>, given: [Option<[f64; 3]>; 2]| {
            let mark = move |name: &str| {
                let at = ["eminence_medial", "eminence_lateral"].iter().position(|n| *n == name)?;
                given[at].map(Point::from)
            };
            let mut warnings = Vec::new();
            let used = tips(shown, &joint_line, &mark, 12.0, &mut warnings);
            (used, notices::texts(&warnings).join(" "))
        };
        assert_eq!(said(Some(shown), [None, None]), (Some(shown), String::new()));
        for shown in [Some(shown), None] {
            // heights do not count
            let near = [[-7.0, 6.0, 40.0], [8.0, 8.0, 40.0]];
            assert_eq!(said(shown, near.map(Some)), (Some(near.map(Point::from)), String::new()));
            // at the tuberosity
            let (used, words) = said(shown, [[-7.0, -38.0, 9.0], [8.0, -38.0, 9.0]].map(Some));
            assert!(used.is_some() && words.contains("mm beside that of the eminences"), "{words}");
            let (used, words) = said(shown, [Some([-7.0, 3.0, 9.0]), None]);
            assert!(used == shown && words.contains("only one is given"), "{words}");
        }
    }

    #[test]
    fn a_femur_stretched_upwards_or_sideways_is_told_and_a_large_one_is_not() {
        for size in [0.5, 1.0, 1.4] {
            assert!(stretched(84.0 * size, 20.0 * size).is_none());
            // the radius grows with the height, the width with itself
            for (width, radius) in [(84.0, 28.6), (84.0 * 1.4, 20.0)] {
                assert!(stretched(width * size, radius * size).is_some_and(|n| n.text.contains("spacing")));
            }
        }
    }
}
