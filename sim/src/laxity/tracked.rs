//! Poses of tracked bodies: a matrix or a quaternion of femur and tibia a row, turned into the coordinates of the model's frames.
//!
//! A tracker knows bodies, not bones. Points that were probed on each bone are laid on the landmarks of the specimen, and so its frame on its body.

use super::columns::LaxityError;
use super::motion::{USUAL_MEAN, USUAL_SI_MM};
use super::units::unit;
use crate::coordinate::{ALL, Coordinate, FE, FREE, SI, Six};
use crate::error::SimError;
use crate::joint::Joint;
use crate::names::did_you_mean;
use crate::spec::{FramesSpec, PoseSpec};
use csv::StringRecord;
use meshes::frame::{AnatomicalFrame, Side};
use meshes::registration::rigid::from_pairs;
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

mod held;
#[cfg(test)]
mod tests;

pub use held::BuiltBone;

/// Points that lie off their landmarks by more in the root mean square are refused [mm]: a probe's tip is placed within 1 to 3. Ours.
const MOST_RMS_MM: f64 = 5.0;
/// From this on it is told [mm]: nearer points are as well placed as a probe's tip can be. Ours.
const LEAST_TOLD_MM: f64 = 1.0;
/// A matrix or quaternion off a rotation by more than this is none [-]: a file with three decimals is within 0.002. Ours.
const MOST_OFF: f64 = 0.02;
/// Flexions of a knee [deg]: those of tests and motions, with room. Ours.
const USUAL_FE_DEG: [f64; 2] = [-30.0, 170.0];
/// Distances between probed points as a multiple of those between landmarks, where one of both is in another unit: m, cm, in.
const UNITS: [f64; 6] = [1e-3, 0.1, 1.0 / 25.4, 25.4, 10.0, 1e3];
/// Within this factor of such a multiple it is told [-].
const LIKE_A_UNIT: f64 = 1.2;
/// Rows in which a body was lost are at most this share [-]: of more, the file is at fault. Ours.
const MOST_ROWS_OFF: f64 = 0.1;
/// Fewest rows whose median shows which one is off.
const LEAST_ROWS: usize = 3;

/// What a laboratory says of its tracked bodies: `[laxity_format.NAME.tracked]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Declared")]
pub struct Tracked {
    /// Unit of places and of probed points; mm where it is absent.
    pub unit: String,
    /// The trial at whose poses the points were probed, in the tracker's frame. Absent: they are in the frames of the bodies.
    pub probed_at: Option<String>,
    /// The femur's body.
    pub femur: TrackedBone,
    /// The tibia's body.
    pub tibia: TrackedBone,
}

/// The same as it is written down, so that a table that is not there is told by its name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Declared {
    #[serde(default = "millimetres")]
    unit: String,
    probed_at: Option<String>,
    femur: Option<TrackedBone>,
    tibia: Option<TrackedBone>,
}

impl TryFrom<Declared> for Tracked {
    type Error = String;
    fn try_from(declared: Declared) -> Result<Tracked, String> {
        let Declared { unit, probed_at, femur, tibia } = declared;
        let there = |bone: &str, table: Option<TrackedBone>| {
            table.ok_or_else(|| {
                format!("no table tracked.{bone}; expected the body of each bone, with probed, landmarks and frame")
            })
        };
        Ok(Tracked { unit, probed_at, femur: there("femur", femur)?, tibia: there("tibia", tibia)? })
    }
}

/// A body on a bone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackedBone {
    /// Columns of its pose in the tracker's frame: 16 or 12 of a matrix, row by row, or 7: the quaternion's w, x, y, z and the place.
    /// Absent: `femur_m11` to `femur_m34` or `femur_m44`, else `femur_qw`, `femur_qx`, `femur_qy`, `femur_qz`, `femur_x`, `femur_y`, `femur_z`.
    #[serde(default)]
    pub columns: Vec<String>,
    /// Points probed on the bone, by their names.
    pub probed: BTreeMap<String, [f64; 3]>,
    /// The same points in CT [mm].
    pub landmarks: BTreeMap<String, [f64; 3]>,
    /// The bone's frame in CT, as 05-frames/frames.json and 09-assemble/model.json have it; a calibrated model.json has another.
    pub frame: AnatomicalFrame,
}

fn millimetres() -> String {
    "mm".into()
}

/// The cells of a file.
pub(super) struct Cells<'a> {
    pub(super) header: &'a mut Vec<String>,
    pub(super) units: &'a mut Vec<String>,
    pub(super) rows: &'a mut Vec<(usize, StringRecord)>,
    pub(super) decimal_comma: bool,
}

/// How a file's poses are read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum How {
    AsGiven,
    Transposed,
    WLast,
    Inverted,
    Exchanged,
}

/// What is tried where poses as given put no knee together, and what is said where it does.
const OTHERS: [(How, &str); 4] = [
    (How::WLast, "the quaternions have w last, not first: give the columns in the order w, x, y, z"),
    (How::Transposed, "the rotations are transposed: give the matrices row by row, or the quaternions conjugated"),
    (How::Exchanged, "the bodies of femur and tibia are exchanged: exchange their columns"),
    (
        How::Inverted,
        "the poses are of the tracker in the bodies' frames: give those of the bodies in the tracker's frame",
    ),
];

/// A body's pose in a row.
#[derive(Clone, Copy)]
struct Given {
    /// As given, and with w last where it is a quaternion.
    turn: [Matrix3<f64>; 2],
    place: Vector,
}

impl Given {
    fn body(&self, how: How) -> Isometry {
        let turn = match how {
            How::Transposed => self.turn[0].transpose(),
            How::WLast => self.turn[1],
            How::AsGiven | How::Inverted | How::Exchanged => self.turn[0],
        };
        // of unit length where the numbers of a matrix are rounded, too
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn)).into_inner();
        let body = Isometry::from_parts(Translation3::from(self.place), UnitQuaternion::new_normalize(turn));
        if how == How::Inverted { body.inverse() } else { body }
    }
}

/// Bones with their bodies.
struct Knee<'a> {
    joint: Joint,
    bones: [(&'static str, &'a TrackedBone); 2],
    /// From the unit of places to mm.
    to_mm: f64,
    /// The row at which points were probed.
    probed_at: Option<usize>,
}

/// Puts the coordinates of the model's frames in place of the poses of bodies.
///
/// # Errors
/// Columns, points or poses that are not there or are none; points too far off their landmarks; poses that put no knee together.
/// Each with its likely cause.
pub(super) fn to_coordinates(
    cells: &mut Cells<'_>,
    tracked: &Tracked,
    side: Side,
    warnings: &mut Vec<Notice>,
) -> Result<(), LaxityError> {
    let knee = Knee::new(cells, tracked, side)?;
    let mut places = Vec::new();
    for (name, bone) in knee.bones {
        places.push(places_of(name, bone, cells.header.as_slice())?);
    }
    are_apart(&places, cells.header.as_slice())?;
    let mut poses = Vec::new();
    for (row, record) in cells.rows.iter() {
        let mut one = Vec::new();
        for at in &places {
            one.push(given(record, at, cells.decimal_comma, knee.to_mm).map_err(|what| LaxityError::row(*row, what))?);
        }
        poses.push(match one.as_slice() {
            [Some(femur), Some(tibia)] => Some([*femur, *tibia]),
            _ => None,
        });
    }
    let found = knee.coordinates(&poses, How::AsGiven)?;
    if !is_a_knee(&found) {
        let numbers: Vec<usize> = cells.rows.iter().map(|(row, _)| *row).collect();
        let has_quaternions = places.iter().any(|p| p.len() == QUATERNION);
        return Err(LaxityError::File(cause(&knee, &poses, (&found, &numbers), has_quaternions)));
    }
    for (name, bone) in knee.bones {
        let (rms, count) = (laid(name, bone, &knee.probed(bone, None))?.1, bone.probed.len());
        if rms < LEAST_TOLD_MM {
            continue;
        }
        let text =
            format!("{name}: {count} probed points lie off their landmarks by {rms:.2} mm in the root mean square");
        warnings.push(Kind::PointsOffSurface.notice(text).count(count).of(name));
    }
    put(cells, &places.concat(), &found);
    Ok(())
}

/// Refuses a column that both bodies have, and coordinates that stand beside the poses.
fn are_apart(places: &[Vec<usize>], header: &[String]) -> Result<(), LaxityError> {
    if let Some(c) = ALL.into_iter().find(|c| header.contains(&c.column())) {
        return Err(LaxityError::row(1, format!("{} and poses of bodies: leave one out", c.column())));
    }
    // a matrix's last row says nothing, so that both may name the same
    let says = |of: &Vec<usize>| of.iter().take(MATRIX[1]).copied().collect::<Vec<usize>>();
    let [femur, tibia] = [0, 1].map(|bone| places.get(bone).map(says).unwrap_or_default());
    let Some(shared) = femur.iter().find(|k| tibia.contains(*k)) else { return Ok(()) };
    let what = format!(
        "column \"{}\" is named for both bodies: by tracked.femur.columns and tracked.tibia.columns",
        header[*shared]
    );
    Err(LaxityError::row(1, what))
}

/// Numbers of a quaternion with its place.
const QUATERNION: usize = 7;
/// Numbers of a matrix, whole and without its last row.
const MATRIX: [usize; 2] = [16, 12];

/// Where the numbers of a body's pose stand.
fn places_of(bone: &str, of: &TrackedBone, header: &[String]) -> Result<Vec<usize>, LaxityError> {
    let place = |name: &String| header.iter().position(|h| h.trim().eq_ignore_ascii_case(name.trim()));
    if of.columns.is_empty() {
        let cell = |k: usize| format!("{bone}_m{}{}", k / 4 + 1, k % 4 + 1);
        let quaternion = ["qw", "qx", "qy", "qz", "x", "y", "z"].map(|part| format!("{bone}_{part}"));
        let usual =
            MATRIX.map(|count| (0..count).map(cell).collect::<Vec<String>>()).into_iter().chain([quaternion.to_vec()]);
        let mut whole = usual.filter_map(|names: Vec<String>| names.iter().map(place).collect::<Option<Vec<usize>>>());
        let what = format!(
            "no pose of the {bone}: expected the columns {bone}_m11 to {bone}_m34, or {bone}_qw, {bone}_qx, {bone}_qy, {bone}_qz, \
             {bone}_x, {bone}_y, {bone}_z; other names are given by tracked.{bone}.columns"
        );
        return whole.next().ok_or_else(|| LaxityError::row(1, what));
    }
    let count = of.columns.len();
    if count != QUATERNION && !MATRIX.contains(&count) {
        let what =
            format!("tracked.{bone}.columns has {count} names; expected 16 or 12 of a matrix, or 7 of a quaternion");
        return Err(LaxityError::File(what));
    }
    let one = |name: &String| {
        let what = || format!("no column \"{name}\", which tracked.{bone}.columns names{}", did_you_mean(name, header));
        place(name).ok_or_else(|| LaxityError::row(1, what()))
    };
    of.columns.iter().map(one).collect()
}

/// A body's pose in a row; none where a cell is empty.
fn given(record: &StringRecord, at: &[usize], decimal_comma: bool, to_mm: f64) -> Result<Option<Given>, String> {
    let mut n = Vec::new();
    for cell in at.iter().map(|k| record.get(*k).unwrap_or("")) {
        if cell.is_empty() {
            return Ok(None);
        }
        let plain = if decimal_comma { cell.replace(',', ".") } else { cell.to_owned() };
        let number = plain.parse::<f64>().ok().filter(|x| x.is_finite());
        n.push(number.ok_or_else(|| format!("\"{cell}\" in a pose is not a finite number"))?);
    }
    if n.len() == QUATERNION {
        let turn = |[w, i, j, k]: [usize; 4]| {
            UnitQuaternion::from_quaternion(Quaternion::new(n[w], n[i], n[j], n[k])).to_rotation_matrix().into_inner()
        };
        let size = n[..4].iter().map(|x| x * x).sum::<f64>().sqrt();
        if (size - 1.0).abs() > MOST_OFF {
            return Err(format!("a quaternion has the length {size:.4}, expected 1"));
        }
        let turn = [turn([0, 1, 2, 3]), turn([3, 0, 1, 2])];
        return Ok(Some(Given { turn, place: Vector::new(n[4], n[5], n[6]) * to_mm }));
    }
    if let Some(last) = n.get(12..16).filter(|last| **last != [0.0, 0.0, 0.0, 1.0]) {
        let column = [n[3], n[7], n[11]];
        return Err(match column == [0.0; 3] && last[3] == 1.0 {
            true => "a matrix is transposed: its place stands in the last row; give it row by row, with the place in the last column".into(),
            false => format!("the last row of a matrix is {last:?}, expected 0, 0, 0, 1"),
        });
    }
    let turn = Matrix3::new(n[0], n[1], n[2], n[4], n[5], n[6], n[8], n[9], n[10]);
    let off = (turn.transpose() * turn - Matrix3::identity()).amax();
    if off > MOST_OFF {
        return Err(format!("a matrix is no rotation: its columns are off unit length or right angles by {off:.3}"));
    }
    if turn.determinant() < 0.0 {
        return Err("a matrix mirrors: its axes are left-handed; expected those of a right-handed frame".into());
    }
    Ok(Some(Given { turn: [turn, turn], place: Vector::new(n[3], n[7], n[11]) * to_mm }))
}

/// What is wrong with the frames, by the names that they have in a declaration.
fn of_frames(error: &SimError) -> String {
    let told = match error {
        SimError::Spec(told) => told.clone(),
        other => other.to_string(),
    };
    match told.strip_prefix("frames.").and_then(|rest| rest.split_once(": ")) {
        Some((bone, what)) => format!("tracked.{bone}.frame: {what}"),
        None => format!("tracked: {told}"),
    }
}

/// Refuses a frame of the other side. Medial, anterior and superior are right-handed on a left knee alone.
fn is_of_side(bone: &str, frame: &AnatomicalFrame, side: Side) -> Result<(), LaxityError> {
    let handed = frame.medial.cross(&frame.anterior).dot(&frame.superior);
    let (found, this) = if handed > 0.0 { (Side::Left, "left") } else { (Side::Right, "right") };
    if found == side {
        return Ok(());
    }
    let what =
        format!("tracked.{bone}.frame is of a {this} knee: is its medial turned round, or the side of the specimen?");
    Err(LaxityError::File(what))
}

impl<'a> Knee<'a> {
    fn new(cells: &Cells<'_>, tracked: &'a Tracked, side: Side) -> Result<Knee<'a>, LaxityError> {
        let frames = FramesSpec {
            femur: tracked.femur.frame,
            tibia: tracked.tibia.frame,
            gs_ct_pose: PoseSpec::default(),
            chain: None,
            grid: None,
        };
        let joint = Joint::new(&frames, side).map_err(|e| LaxityError::File(of_frames(&e)))?;
        is_of_side("femur", &tracked.femur.frame, side)?;
        is_of_side("tibia", &tracked.tibia.frame, side)?;
        let to_mm = match unit(&tracked.unit) {
            Some(("mm", factor)) => factor,
            _ => return Err(LaxityError::File(format!("tracked.unit = \"{}\"; expected mm, cm or m", tracked.unit))),
        };
        let trial = cells.header.iter().position(|h| h.trim().eq_ignore_ascii_case("trial"));
        let row =
            |name: &String| cells.rows.iter().position(|(_, r)| trial.and_then(|k| r.get(k)) == Some(name.as_str()));
        let probed_at = tracked.probed_at.as_ref().map(|name| {
            row(name)
                .ok_or_else(|| LaxityError::File(format!("tracked.probed_at = \"{name}\" is no trial of the file")))
        });
        let bones = [("femur", &tracked.femur), ("tibia", &tracked.tibia)];
        Ok(Knee { joint, bones, to_mm, probed_at: probed_at.transpose()? })
    }

    /// The probed points of a bone [mm], taken back by the pose of its body where they were probed in the tracker's frame.
    fn probed(&self, bone: &TrackedBone, body: Option<Isometry>) -> BTreeMap<String, Point> {
        let back = body.map_or(Isometry::identity(), |b| b.inverse());
        bone.probed.iter().map(|(name, p)| (name.clone(), back * Point::from(Vector::from(*p) * self.to_mm))).collect()
    }

    /// Coordinates of each row that has both poses [rad, mm].
    fn coordinates(&self, poses: &[Option<[Given; 2]>], how: How) -> Result<Vec<Option<Six>>, LaxityError> {
        let bodies = |given: &[Given; 2]| {
            let [femur, tibia] = given.each_ref().map(|g| g.body(how));
            if how == How::Exchanged { [tibia, femur] } else { [femur, tibia] }
        };
        let mut on = Vec::new();
        for (k, (name, bone)) in self.bones.into_iter().enumerate() {
            let body = match self.probed_at {
                None => None,
                Some(row) => {
                    let what = || LaxityError::File("the row of tracked.probed_at has no poses".into());
                    Some(bodies(poses[row].as_ref().ok_or_else(what)?)[k])
                }
            };
            on.push(laid(name, bone, &self.probed(bone, body))?.0);
        }
        let one = |given: &[Given; 2]| {
            let [femur, tibia] = bodies(given);
            self.joint.grood_suntay_of(&((tibia * on[1]).inverse() * (femur * on[0])))
        };
        Ok(poses.iter().map(|p| p.as_ref().map(&one)).collect())
    }
}

/// The motion that lays a bone of CT on its body, and how far the points lie off their landmarks then [mm].
fn laid(name: &str, bone: &TrackedBone, probed: &BTreeMap<String, Point>) -> Result<(Isometry, f64), LaxityError> {
    let fault = |what: String| LaxityError::File(format!("tracked.{name}: {what}"));
    let mut pairs: Vec<(&String, Point, Point)> = Vec::new();
    for (point, place) in probed {
        let Some(landmark) = bone.landmarks.get(point) else {
            return Err(fault(format!("no landmark {point}{}", did_you_mean(point, bone.landmarks.keys()))));
        };
        pairs.push((point, Point::from(Vector::from(*landmark)), *place));
    }
    let Some((body, rms)) = fit(&pairs) else {
        return Err(fault(format!("{} probed points; expected three and more that are not on a line", pairs.len())));
    };
    if rms > MOST_RMS_MM {
        let what = format!(
            "the probed points lie off their landmarks by {rms:.1} mm in the root mean square, more than {MOST_RMS_MM} mm"
        );
        return Err(fault(what + &why_off(&pairs, rms)));
    }
    Ok((body, rms))
}

/// Pairs laid on each other, and how far apart they stay [mm].
fn fit(pairs: &[(&String, Point, Point)]) -> Option<(Isometry, f64)> {
    let both: Vec<(Point, Point)> = pairs.iter().map(|(_, from, to)| (*from, *to)).collect();
    let body = from_pairs(&both)?;
    let squares: f64 = both.iter().map(|(from, to)| (body * from - to).norm_squared()).sum();
    Some((body, (squares / both.len() as f64).sqrt()))
}

/// The likely cause of points far off their landmarks.
fn why_off(pairs: &[(&String, Point, Point)], rms: f64) -> String {
    let size = |of: fn(&(&String, Point, Point)) -> Point| -> f64 {
        pairs.iter().flat_map(|a| pairs.iter().map(move |b| (of(a) - of(b)).norm())).sum()
    };
    let times = size(|p| p.2) / size(|p| p.1).max(f64::MIN_POSITIVE);
    if UNITS.iter().any(|factor| (times / factor).max(factor / times) < LIKE_A_UNIT) {
        return format!(
            "; their distances are {times:.4} times those of the landmarks: is tracked.unit another, say m in place of mm?"
        );
    }
    if let Some([a, b]) = exchanged(pairs) {
        return format!("; with {a} and {b} exchanged they lie within {MOST_RMS_MM} mm: give each its own place");
    }
    let without =
        |k: usize| fit(&pairs.iter().enumerate().filter(|(n, _)| *n != k).map(|(_, p)| *p).collect::<Vec<_>>());
    let best = (0..pairs.len()).filter_map(|k| Some((k, without(k)?.1))).min_by(|a, b| a.1.total_cmp(&b.1));
    match best.filter(|(_, left)| pairs.len() > 3 && *left < rms / 2.0) {
        Some((k, left)) => format!("; without {} they are within {left:.1} mm: was it probed elsewhere?", pairs[k].0),
        None => "; are they of the other knee?".into(),
    }
}

/// The two points whose exchange lays all on their landmarks; none where no exchange does.
fn exchanged<'a>(pairs: &[(&'a String, Point, Point)]) -> Option<[&'a str; 2]> {
    let both = (0..pairs.len()).flat_map(|a| (a + 1..pairs.len()).map(move |b| (a, b)));
    let rms = |(a, b): (usize, usize)| {
        let mut turned = pairs.to_vec();
        (turned[a].2, turned[b].2) = (pairs[b].2, pairs[a].2);
        Some(((a, b), fit(&turned)?.1))
    };
    let ((a, b), left) = both.filter_map(rms).min_by(|x, y| x.1.total_cmp(&y.1))?;
    (left <= MOST_RMS_MM).then_some([pairs[a].0.as_str(), pairs[b].0.as_str()])
}

/// Whether coordinates are a knee's in their mean.
fn is_a_knee(found: &[Option<Six>]) -> bool {
    let known: Vec<&Six> = found.iter().flatten().collect();
    if known.is_empty() {
        return true;
    }
    let mean = |c: Coordinate| known.iter().map(|q| q[c]).sum::<f64>() / known.len() as f64;
    let within = |x: f64, [least, most]: [f64; 2]| (least..=most).contains(&x);
    USUAL_MEAN.iter().all(|(c, usual)| within(c.to_file(mean(*c)), *usual))
        && within(mean(SI), USUAL_SI_MM)
        && known.iter().all(|q| within(q[FE].to_degrees(), USUAL_FE_DEG))
}

/// What is said of poses that put no knee together: the reading that does, or the rows without which they do. `found` are the coordinates of rows,
/// and the rows' numbers.
fn cause(
    knee: &Knee<'_>,
    poses: &[Option<[Given; 2]>],
    (found, numbers): (&[Option<Six>], &[usize]),
    has_quaternions: bool,
) -> String {
    let fits = |(how, _): &&(How, &str)| {
        (has_quaternions || *how != How::WLast) && knee.coordinates(poses, *how).is_ok_and(|found| is_a_knee(&found))
    };
    let by_rows = || {
        let rows: Vec<String> = rows_off(found)?.into_iter().map(|k| numbers[k].to_string()).collect();
        let (row, these) = if rows.len() == 1 { ("row", "this row") } else { ("rows", "these rows") };
        let rows = rows.join(", ");
        Some(format!("without {row} {rows} they do: was a body lost or moved there? Then take {these} out"))
    };
    let by_reading = OTHERS.iter().find(fits).map(|(_, words)| (*words).to_owned());
    let likely = by_reading.or_else(by_rows).unwrap_or_else(|| {
        "none of the usual slips explains it: look at tracked.unit, at the side and at the frames".into()
    });
    format!("the poses of the tracked bodies put no knee together: its coordinates are beyond those of knees; {likely}")
}

/// The few rows farthest from the median without which the others are a knee's, in the order of the file.
fn rows_off(found: &[Option<Six>]) -> Option<Vec<usize>> {
    let known: Vec<(usize, Six)> = found.iter().enumerate().filter_map(|(k, q)| Some((k, (*q)?))).collect();
    if known.len() < LEAST_ROWS {
        return None;
    }
    let median = |c: Coordinate| {
        let mut all: Vec<f64> = known.iter().map(|(_, q)| c.to_file(q[c])).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let middle = FREE.map(|c| (c, median(c)));
    // a knee bends on purpose: of flexion counts what is beyond a knee's alone. Degrees and millimetres count alike
    let off = |q: &Six| {
        let fe = q[FE].to_degrees();
        let beyond = fe - fe.clamp(USUAL_FE_DEG[0], USUAL_FE_DEG[1]);
        beyond * beyond + middle.iter().map(|(c, m)| (c.to_file(q[*c]) - m).powi(2)).sum::<f64>()
    };
    let mut farthest: Vec<(usize, f64)> = known.iter().map(|(k, q)| (*k, off(q))).collect();
    farthest.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = ((MOST_ROWS_OFF * known.len() as f64) as usize).max(1);
    let mut rest = found.to_vec();
    let mut left_out = Vec::new();
    for (k, _) in farthest.into_iter().take(most) {
        rest[k] = None;
        left_out.push(k);
        if is_a_knee(&rest) {
            left_out.sort_unstable();
            return Some(left_out);
        }
    }
    None
}

/// Takes the poses out of the cells and puts coordinates there.
fn put(cells: &mut Cells<'_>, poses: &[usize], found: &[Option<Six>]) {
    let kept = |k: &usize| !poses.contains(k);
    let stays = |all: &[String]| {
        all.iter().enumerate().filter(|(k, _)| kept(k)).map(|(_, h)| h.clone()).collect::<Vec<String>>()
    };
    *cells.header = stays(cells.header.as_slice());
    *cells.units = stays(cells.units.as_slice());
    cells.header.extend(ALL.map(|c| c.column()));
    for ((_, record), pose) in cells.rows.iter_mut().zip(found) {
        let rest = record.iter().enumerate().filter(|(k, _)| kept(k)).map(|(_, cell)| cell.to_owned());
        let number = |c| pose.map_or(String::new(), |q| number_of(c, &q, cells.decimal_comma));
        *record = rest.chain(ALL.map(number)).collect::<Vec<String>>().into();
    }
}

/// A coordinate as the file would have it [deg, mm].
fn number_of(c: Coordinate, q: &Six, decimal_comma: bool) -> String {
    let text = c.to_file(q[c]).to_string();
    if decimal_comma { text.replace('.', ",") } else { text }
}
