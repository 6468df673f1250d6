//! Poses of tracked bodies, made from knees whose coordinates are known.

use super::{Tracked, TrackedBone};
use crate::coordinate::{ALL, FE, FREE, Six};
use crate::joint::Joint;
use crate::laxity::{Column, LaxityError, LaxityFormat, LaxityTable, read_as};
use crate::spec::{FramesSpec, PoseSpec};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::collections::BTreeMap;

/// Coordinates are found to this [deg, mm]: numbers are written with all their digits.
const SAME: f64 = 1e-6;
/// Flexion, valgus, external [deg], lateral, anterior, superior [mm], from the CT pose.
const MOVED: [[f64; 6]; 3] =
    [[5.0, 1.0, -3.0, 0.5, 2.0, 0.3], [40.0, -2.0, 8.0, -1.0, 6.0, -0.5], [85.0, 3.0, -12.0, 2.0, -4.0, 1.0]];

/// Bodies in a row: the femur's and the tibia's, in the tracker's frame.
type Bodies = [Isometry; 2];

/// A knee with bodies on its bones.
#[derive(Clone)]
struct Lab {
    side: Side,
    tracked: Tracked,
    rows: Vec<Bodies>,
}

fn isometry(place: [f64; 3], turn: [f64; 3]) -> Isometry {
    Isometry::new(Vector::from(place), Vector::from(turn))
}

fn frames() -> FramesSpec {
    let frame = |origin: [f64; 3], tilt: f64| AnatomicalFrame {
        origin: Point::from(Vector::from(origin)),
        medial: Vector::x(),
        anterior: Vector::new(0.0, -tilt.cos(), tilt.sin()),
        superior: Vector::new(0.0, tilt.sin(), tilt.cos()),
    };
    let (femur, tibia) = (frame([1.0, 2.0, 25.0], 0.0), frame([0.0, 0.0, 0.0], 0.1));
    FramesSpec { femur, tibia, gs_ct_pose: PoseSpec::default(), chain: None, grid: None }
}

/// What the model's joint says of each row [rad, mm].
fn truth() -> (Joint, Vec<(Six, Isometry)>) {
    let joint = Joint::new(&frames(), Side::Right).unwrap();
    let q = |moved: &[f64; 6]| {
        let mut q = Six::zeros();
        ALL.iter().for_each(|c| q[*c] = c.to_solver(moved[c.index()]));
        q
    };
    let rows = MOVED.iter().map(q).map(|q| (joint.grood_suntay(&q), joint.pose(&q).femur)).collect();
    (joint, rows)
}

/// A right knee before a tracker that stands so.
fn lab(tracker: Isometry) -> Lab {
    let frames = frames();
    // a bone of CT on its body
    let on = [isometry([12.0, -40.0, 7.0], [0.4, -1.1, 0.7]), isometry([-30.0, 5.0, 60.0], [-0.9, 0.3, 1.3])];
    let points = |of: &AnatomicalFrame, up: f64| {
        let place = |x: f64, y: f64, z: f64| of.origin + of.medial * x + of.anterior * y + of.superior * z;
        [
            ("medial", place(40.0, 0.0, 0.0)),
            ("lateral", place(-41.0, 3.0, 1.0)),
            ("far", place(5.0, -8.0, up)),
            ("front", place(2.0, 35.0, 9.0)),
        ]
    };
    let bone = |frame: AnatomicalFrame, on: &Isometry, up: f64| {
        let all = points(&frame, up);
        let numbers = |p: &Point| <[f64; 3]>::from(p.coords);
        let name = |n: &str| n.to_owned();
        TrackedBone {
            columns: vec![],
            probed: all.iter().map(|(n, p)| (name(n), numbers(&(on * p)))).collect(),
            landmarks: all.iter().map(|(n, p)| (name(n), numbers(p))).collect(),
            frame,
        }
    };
    let (femur, tibia) = (bone(frames.femur, &on[0], 120.0), bone(frames.tibia, &on[1], -150.0));
    let back = on.map(|o| o.inverse());
    let rows = truth().1.iter().map(|(_, femur)| [tracker * femur * back[0], tracker * back[1]]).collect();
    Lab { side: Side::Right, tracked: Tracked { unit: "mm".into(), probed_at: None, femur, tibia }, rows }
}

/// Trackers that stand differently.
fn trackers() -> [Isometry; 3] {
    [
        Isometry::identity(),
        isometry([500.0, -80.0, 1200.0], [1.9, 0.4, -0.6]),
        isometry([-3.0, 700.0, 20.0], [-0.2, -2.1, 0.9]),
    ]
}

impl Lab {
    /// As if the points had been probed in the tracker's frame at the second row.
    fn probed_in_tracker(mut self) -> Lab {
        let bodies = self.rows[1];
        for (bone, body) in [&mut self.tracked.femur, &mut self.tracked.tibia].into_iter().zip(bodies) {
            bone.probed.values_mut().for_each(|p| *p = (body * Point::from(Vector::from(*p))).coords.into());
        }
        self.tracked.probed_at = Some("r1".into());
        self
    }

    /// The other knee, in the mirror.
    fn mirrored(mut self) -> Lab {
        let flip = Matrix3::from_diagonal(&Vector::new(-1.0, 1.0, 1.0));
        for bone in [&mut self.tracked.femur, &mut self.tracked.tibia] {
            bone.probed.values_mut().chain(bone.landmarks.values_mut()).for_each(|p| p[0] = -p[0]);
            let f = &mut bone.frame;
            f.origin = Point::from(flip * f.origin.coords);
            [&mut f.medial, &mut f.anterior, &mut f.superior].into_iter().for_each(|v| *v = flip * *v);
        }
        for body in self.rows.iter_mut().flatten() {
            let turn = flip * body.rotation.to_rotation_matrix().into_inner() * flip;
            let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
            *body = Isometry::from_parts((flip * body.translation.vector).into(), turn);
        }
        self.side = Side::Left;
        self
    }

    /// The table by this header and these numbers of a body.
    fn read(&self, names: &[String], numbers: impl Fn(&Isometry) -> Vec<f64>) -> Result<LaxityTable, LaxityError> {
        self.read_with(names, numbers, |_| ())
    }

    /// The same under a declaration that says more.
    fn read_with(
        &self,
        names: &[String],
        numbers: impl Fn(&Isometry) -> Vec<f64>,
        more: impl Fn(&mut LaxityFormat),
    ) -> Result<LaxityTable, LaxityError> {
        let mut text = format!("trial,load_ap_n,{}\n", names.join(","));
        for (k, bodies) in self.rows.iter().enumerate() {
            let cells: Vec<String> = bodies.iter().flat_map(&numbers).map(|x| format!("{x:?}")).collect();
            text += &format!("r{k},60,{}\n", cells.join(","));
        }
        let tracked = Some(self.tracked.clone());
        let mut format =
            LaxityFormat { tracked, nominal_flexions_deg: vec![5.0, 40.0, 85.0], ..LaxityFormat::default() };
        more(&mut format);
        read_as(text.as_bytes(), &format, self.side)
    }

    /// The bones, to be changed.
    fn bones(&mut self) -> [(&'static str, &mut TrackedBone); 2] {
        [("femur", &mut self.tracked.femur), ("tibia", &mut self.tracked.tibia)]
    }

    fn by_matrix(&self) -> Result<LaxityTable, LaxityError> {
        self.read(&matrix_names(), matrix)
    }

    fn by_quaternion(&self) -> Result<LaxityTable, LaxityError> {
        self.read(&quaternion_names(), quaternion)
    }
}

fn of_both(of: impl Fn(&str) -> Vec<String>) -> Vec<String> {
    ["femur", "tibia"].into_iter().flat_map(of).collect()
}

fn matrix_names() -> Vec<String> {
    of_both(|bone| (0..16).map(|k| format!("{bone}_m{}{}", k / 4 + 1, k % 4 + 1)).collect())
}

fn quaternion_names() -> Vec<String> {
    of_both(|bone| ["qw", "qx", "qy", "qz", "x", "y", "z"].map(|part| format!("{bone}_{part}")).to_vec())
}

/// A body's matrix, row by row.
fn matrix(body: &Isometry) -> Vec<f64> {
    let whole = body.to_homogeneous();
    (0..16).map(|k| whole[(k / 4, k % 4)]).collect()
}

fn quaternion(body: &Isometry) -> Vec<f64> {
    let (q, p) = (body.rotation.quaternion(), body.translation.vector);
    vec![q.w, q.i, q.j, q.k, p.x, p.y, p.z]
}

/// Holds what was read against the model's own coordinates.
fn assert_truth(found: Result<LaxityTable, LaxityError>, what: &str) {
    let table = found.unwrap_or_else(|e| panic!("{what}: {e}"));
    let (_, rows) = truth();
    assert_eq!(table.trials.len(), rows.len(), "{what}");
    for (trial, (gs, _)) in table.trials.iter().zip(&rows) {
        assert!((trial.fe_deg - gs[FE].to_degrees()).abs() < SAME, "{what}: {} deg", trial.fe_deg);
        for c in FREE {
            let (read, asked) = (trial.measured[c].unwrap(), c.to_file(gs[c]));
            assert!((read - asked).abs() < SAME, "{what}, {c}: {read}, {asked} expected");
        }
    }
    let told = table.warnings.iter().any(|w| w.contains("probed points"));
    assert!(!told, "{what}: {:?}", table.warnings);
}

#[test]
fn a_trackers_place_a_bodys_place_and_the_kind_of_pose_change_nothing() {
    for (k, tracker) in trackers().into_iter().enumerate() {
        for lab in [lab(tracker), lab(tracker).probed_in_tracker()] {
            let what = format!("tracker {k}, probed at {:?}", lab.tracked.probed_at);
            assert_truth(lab.by_matrix(), &what);
            assert_truth(lab.by_quaternion(), &what);
        }
    }
}

#[test]
fn left_mirrors_right() {
    for tracker in trackers() {
        for lab in [lab(tracker), lab(tracker).probed_in_tracker()] {
            assert_truth(lab.clone().mirrored().by_matrix(), "left");
            assert_truth(lab.mirrored().by_quaternion(), "left");
        }
    }
}

#[test]
fn columns_of_any_name_and_lengths_of_any_unit_are_read() {
    let mut lab = lab(trackers()[1]);
    let names: Vec<String> = (0..24).map(|k| format!("T{k}")).collect();
    lab.tracked.femur.columns = names[..12].to_vec();
    lab.tracked.tibia.columns = names[12..].to_vec();
    lab.tracked.unit = "m".into();
    for bone in [&mut lab.tracked.femur, &mut lab.tracked.tibia] {
        bone.probed.values_mut().flatten().for_each(|x| *x /= 1e3);
    }
    let metres = |body: &Isometry| {
        let mut cells = matrix(body)[..12].to_vec();
        [3, 7, 11].into_iter().for_each(|k| cells[k] /= 1e3);
        cells
    };
    assert_truth(lab.read(&names, metres), "metres");
    lab.tracked.femur.columns.pop();
    assert!(lab.read(&names, metres).unwrap_err().to_string().contains("11 names"));
}

#[test]
fn a_slip_is_refused_by_its_name() {
    let knee = lab(trackers()[1]);
    let whole_transposed = |b: &Isometry| (0..16).map(|k| b.to_homogeneous()[(k % 4, k / 4)]).collect::<Vec<f64>>();
    let turned_back = |b: &Isometry| Isometry::from_parts(b.translation, b.rotation.inverse());
    let last = |b: &Isometry| {
        let mut cells = quaternion(b);
        cells[..4].rotate_left(1);
        cells
    };
    let mut exchanged = knee.clone();
    exchanged.rows.iter_mut().for_each(|r| r.reverse());
    let (m, q) = (matrix_names(), quaternion_names());
    let without_w: Vec<String> = q.iter().filter(|name| !name.ends_with("_qw")).cloned().collect();
    let told = [
        (knee.read(&m, whole_transposed), "a matrix is transposed"),
        (knee.read(&m, |b| matrix(&turned_back(b))), "the rotations are transposed"),
        (knee.read(&q, |b| quaternion(&turned_back(b))), "the quaternions conjugated"),
        (knee.read(&q, last), "w last, not first"),
        (knee.read(&m, |b| matrix(&b.inverse())), "of the tracker in the bodies' frames"),
        (exchanged.by_matrix(), "femur and tibia are exchanged"),
        (exchanged.by_quaternion(), "femur and tibia are exchanged"),
        (knee.read(&m, |b| matrix(b).into_iter().map(|x| x * 1.1).collect()), "is [0.0, 0.0, 0.0, 1.1]"),
        (knee.read(&q, |b| quaternion(b).into_iter().map(|x| x * 1.1).collect()), "the length 1.1"),
        (knee.read(&without_w, |b| quaternion(b)[1..].to_vec()), "no pose of the femur"),
    ];
    for (found, words) in told {
        let error = found.expect_err(words).to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
}

#[test]
fn points_off_their_landmarks_are_refused_with_the_likely_cause() {
    type Points = BTreeMap<String, [f64; 3]>;
    let asked = |change: &dyn Fn(&mut Points)| {
        let mut lab = lab(trackers()[2]);
        change(&mut lab.tracked.femur.probed);
        lab.by_matrix().expect_err("points that do not fit").to_string()
    };
    let scaled = |factor: f64| asked(&|p| p.values_mut().flatten().for_each(|x| *x *= factor));
    for factor in [1e-3, 0.1, 1.0 / 25.4, 1e3] {
        assert!(scaled(factor).contains("is tracked.unit another"), "{factor}: {}", scaled(factor));
    }
    let off = asked(&|p| p.values_mut().take(1).for_each(|x| x[1] += 60.0));
    assert!(off.contains("without far they are within 0.0 mm"), "{off}");
    let few = asked(&|p| p.retain(|name, _| name == "far" || name == "front"));
    assert!(few.contains("2 probed points; expected three"), "{few}");
    let unnamed = asked(&|p| {
        let far = p.remove("far").unwrap();
        p.insert("farr".into(), far);
    });
    assert!(unnamed.contains("no landmark farr; did you mean far?"), "{unnamed}");
    // what a hand does is within the limit, and told
    let mut shaken = lab(trackers()[2]);
    shaken.tracked.tibia.probed.values_mut().enumerate().for_each(|(k, p)| p[k % 3] += 2.0);
    let told = shaken.by_matrix().unwrap().warnings;
    assert!(told.iter().any(|w| w.contains("tibia: 4 probed points")), "{told:?}");
    assert!(!told.iter().any(|w| w.contains("femur: 4 probed points")), "{told:?}");
}

#[test]
fn two_points_in_each_others_place_are_named_whichever_they_are() {
    let names = ["far", "front", "lateral", "medial"];
    for bone in 0..2 {
        for (k, a) in names.into_iter().enumerate() {
            for b in &names[k + 1..] {
                let mut lab = lab(trackers()[2]);
                let probed = &mut lab.bones()[bone].1.probed;
                let [of_a, of_b] = [probed[a], probed[*b]];
                probed.insert(a.to_owned(), of_b);
                probed.insert((*b).to_owned(), of_a);
                let told = lab.by_matrix().expect_err("points in each other's place").to_string();
                assert!(told.contains(&format!("with {a} and {b} exchanged")), "{told}");
            }
        }
    }
}

#[test]
fn a_frame_of_the_other_side_or_that_is_none_is_named() {
    for (knee, other) in [(lab(trackers()[1]), "left"), (lab(trackers()[1]).mirrored(), "right")] {
        for bone in 0..2 {
            let mut turned = knee.clone();
            let (name, of) = &mut turned.bones()[bone];
            of.frame.medial = -of.frame.medial;
            let expected = format!("tracked.{name}.frame is of a {other} knee");
            let told = turned.by_matrix().expect_err(&expected).to_string();
            assert!(told.contains(&expected), "{told}");
            let mut stretched = knee.clone();
            let (name, of) = &mut stretched.bones()[bone];
            of.frame.medial *= 1.1;
            let expected = format!("tracked.{name}.frame: axes are not orthonormal");
            let told = stretched.by_matrix().expect_err(&expected).to_string();
            assert!(told.contains(&expected) && !told.contains("model"), "{told}");
        }
        // in both frames, all fits but the sides of the coordinates
        let mut turned = knee.clone();
        turned.bones().into_iter().for_each(|(_, of)| of.frame.medial = -of.frame.medial);
        let told = turned.by_matrix().expect_err("both frames turned").to_string();
        assert!(told.contains(&format!("of a {other} knee")), "{told}");
    }
}

#[test]
fn one_row_that_lies_apart_is_named_and_more_are_not() {
    for body in 0..2 {
        for row in 0..MOVED.len() {
            let mut lab = lab(trackers()[1]);
            lab.rows[row][body].translation.vector.y += 900.0;
            let told = lab.by_matrix().expect_err("a lost body").to_string();
            assert!(told.contains(&format!("without row {} they do", row + 2)), "{told}");
            lab.rows[(row + 1) % MOVED.len()][body].translation.vector.y += 900.0;
            let told = lab.by_matrix().expect_err("two lost bodies of three").to_string();
            assert!(!told.contains("without row"), "{told}");
        }
    }
}

#[test]
fn coordinates_beside_poses_are_refused() {
    let knee = lab(trackers()[1]);
    for c in ALL {
        let (column, mut names) = (c.column(), matrix_names());
        names.insert(16, column.clone());
        names.push("spare".into());
        let numbers = |b: &Isometry| matrix(b).into_iter().chain([1.0]).collect::<Vec<f64>>();
        let told = knee.read(&names, numbers).expect_err(&column).to_string();
        assert!(told.contains(&format!("{column} and poses of bodies: leave one out")), "{told}");
        // by another name, too
        names[16] = "encoder".into();
        let declared = |format: &mut LaxityFormat| {
            format.columns.insert(column.clone(), Column::Name("encoder".into()));
        };
        let told = knee.read_with(&names, numbers, declared).expect_err(&column).to_string();
        assert!(told.contains(&format!("columns.{column} and poses of bodies: leave one out")), "{told}");
    }
}

#[test]
fn a_column_of_both_bodies_is_refused_but_for_a_matrixs_last_row() {
    let names: Vec<String> = (0..32).map(|k| format!("T{k}")).collect();
    let mut lab = lab(trackers()[1]);
    lab.tracked.femur.columns = names[..16].to_vec();
    lab.tracked.tibia.columns = [&names[16..28], &names[12..16]].concat();
    assert_truth(lab.read(&names, matrix), "one last row for both");
    for shared in 0..12 {
        let mut slip = lab.clone();
        slip.tracked.tibia.columns[shared] = names[shared].clone();
        let told = slip.read(&names, matrix).expect_err("a shared column").to_string();
        assert!(told.contains(&format!("\"{}\" is named for both bodies", names[shared])), "{told}");
    }
}

/// As docs/import-tdms.md has it.
const DECLARED: &str = r#"
nominal_flexions_deg = [0, 30, 60, 90]
[tracked]
unit = "mm"
probed_at = "ct_pose"
[tracked.femur]
probed = { medial_epicondyle = [812.4, -33.0, 1460.2], lateral_epicondyle = [741.9, -71.3, 1466.8], shaft = [768.0, 60.2, 1571.5] }
landmarks = { medial_epicondyle = [-71.2, -120.3, 30.1], lateral_epicondyle = [9.8, -118.7, 31.0], shaft = [-30.5, -127.9, 150.3] }
frame = { origin = [-30.7, -119.5, 30.5], medial = [-1.0, 0.0, 0.0], anterior = [0.0, -1.0, 0.0], superior = [0.0, 0.0, 1.0] }
[tracked.tibia]
probed = { medial = [812.4, -33.0, 1410.2], lateral = [741.9, -71.3, 1416.8], shaft = [768.0, 20.2, 1301.5] }
landmarks = { medial = [-68.9, -122.3, 2.1], lateral = [6.8, -120.1, 1.0], shaft = [-29.5, -117.9, -140.3] }
frame = { origin = [-30.7, -119.5, 6.5], medial = [-1.0, 0.0, 0.0], anterior = [0.0, -1.0, 0.0], superior = [0.0, 0.0, 1.0] }
"#;

#[test]
fn a_declaration_is_read_and_a_misspelt_key_is_none() {
    let format: LaxityFormat = toml::from_str(DECLARED).unwrap();
    let tracked = format.tracked.unwrap();
    assert_eq!((tracked.probed_at.as_deref(), tracked.unit.as_str()), (Some("ct_pose"), "mm"));
    assert!(tracked.femur.probed.keys().eq(tracked.femur.landmarks.keys()) && tracked.femur.columns.is_empty());
    for key in ["unit", "probed_at", "probed", "landmarks", "frame"] {
        let slip = DECLARED.replace(&format!("{key} ="), &format!("{key}s ="));
        assert!(toml::from_str::<LaxityFormat>(&slip).is_err(), "{key}");
    }
}

#[test]
fn a_table_that_is_not_there_is_told_by_its_name() {
    let (femur, tibia) = (DECLARED.find("[tracked.femur]").unwrap(), DECLARED.find("[tracked.tibia]").unwrap());
    let without =
        [("tibia", DECLARED[..tibia].to_owned()), ("femur", DECLARED[..femur].to_owned() + &DECLARED[tibia..])];
    for (bone, text) in without {
        let told = toml::from_str::<LaxityFormat>(&text).unwrap_err().to_string();
        assert!(told.contains(&format!("no table tracked.{bone}")), "{told}");
    }
}
