//! Tracked bodies whose declaration is not of the build: the warnings come through to standard error, the log and the report.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, json, read, text, thinned, write};
use meshes::frame::{AnatomicalFrame, Side};
use meshes::{Isometry, Point, Vector};
use serde_json::Value;
use sim::coordinate::{ALL, Six};
use sim::joint::Joint;
use sim::spec::{FramesSpec, PoseSpec};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use tempfile::TempDir;

/// The femur's frame is turned by this [deg], and the tibia's landmarks lie forwards by this [mm].
const TURN_DEG: f64 = 3.0;
const OFF_MM: f64 = 150.0;
/// One trial of so many is kept: that many are enough to calibrate at all.
const EVERY: usize = 3;

/// Outermost points of a bone: to both sides, forwards, and at the joint (`joint`: upwards or downwards).
fn landmarks(file: &Path, frame: &AnatomicalFrame, joint: f64) -> Vec<Point> {
    let mesh = formats::read_surface("bone.ply", &read(file), &BTreeMap::new()).unwrap().mesh;
    let farthest = |way: Vector| {
        let along = |p: &&Point| p.coords.dot(&way);
        *mesh.vertices.iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap()
    };
    [frame.medial, -frame.medial, frame.anterior, frame.superior * joint].map(farthest).into()
}

/// A bone's table in specimen.toml. Its body's frame is CT, so that points are probed where the landmarks are.
fn declared(bone: &str, frame: &AnatomicalFrame, points: &[Point]) -> String {
    let three = |v: &Vector| format!("{:?}", <[f64; 3]>::from(*v));
    let points: Vec<String> = points.iter().enumerate().map(|(k, p)| format!("p{k} = {}", three(&p.coords))).collect();
    let points = points.join(", ");
    format!(
        "[laxity_format.kla.tracked.{bone}]\nprobed = {{ {points} }}\nlandmarks = {{ {points} }}\n\
         frame = {{ origin = {}, medial = {}, anterior = {}, superior = {} }}\n",
        three(&frame.origin.coords),
        three(&frame.medial),
        three(&frame.anterior),
        three(&frame.superior)
    )
}

/// A table of coordinates as one of bodies in the tibia's CT: the tibia rests, the femur moves.
fn as_bodies(table: &str, joint: &Joint) -> String {
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let columns = ALL.map(|c| header.iter().position(|name| *name == c.column()).unwrap());
    let others = |cells: &[&str]| -> Vec<String> {
        cells.iter().enumerate().filter(|(k, _)| !columns.contains(k)).map(|(_, cell)| (*cell).to_owned()).collect()
    };
    let names = |bone: &str| (0..12).map(|k| format!("{bone}_m{}{}", k / 4 + 1, k % 4 + 1)).collect::<Vec<_>>();
    let mut out = [others(&header), names("femur"), names("tibia")].concat().join(",") + "\n";
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let mut read = Six::zeros();
        ALL.iter().zip(columns).for_each(|(c, k)| read[*c] = c.to_solver(cells[k].parse().unwrap()));
        let femur = joint.pose(&joint.coordinates(&read).unwrap()).femur;
        let matrix = |body: &Isometry| {
            let all = body.to_homogeneous();
            (0..12).map(|k| format!("{:?}", all[(k / 4, k % 4)])).collect::<Vec<_>>()
        };
        out += &([others(&cells), matrix(&femur), matrix(&Isometry::identity())].concat().join(",") + "\n");
    }
    out
}

/// Puts the poses of bodies and their declaration in place of the phantom's laxity: a frame of the femur that is turned, and landmarks of the
/// tibia that lie before it.
fn track(knee: &Path) {
    let build = knee.join("build");
    let frames = json(&build.join("05-frames/frames.json"));
    let frame = |bone: &str| serde_json::from_value::<AnatomicalFrame>(frames[bone].clone()).unwrap();
    let (femur, tibia) = (frame("femur"), frame("tibia"));
    let turn = Isometry::rotation(femur.superior * TURN_DEG.to_radians());
    let turned = AnatomicalFrame { medial: turn * femur.medial, anterior: turn * femur.anterior, ..femur };
    let on_femur = landmarks(&build.join("03-bones/femur.ply"), &femur, -1.0);
    let mut on_tibia = landmarks(&build.join("03-bones/tibfib.ply"), &tibia, 1.0);
    on_tibia.iter_mut().for_each(|p| *p += tibia.anterior * OFF_MM);
    let spec = FramesSpec { femur: turned, tibia, gs_ct_pose: PoseSpec::default(), chain: None, grid: None };
    let is_left = femur.medial.cross(&femur.anterior).dot(&femur.superior) > 0.0;
    let joint = Joint::new(&spec, if is_left { Side::Left } else { Side::Right }).unwrap();
    let table = knee.join("laxity/kla.csv");
    write(&table, as_bodies(&thinned(&text(&table), EVERY, &[]), &joint));
    let toml = knee.join("specimen.toml");
    let mut told: String =
        text(&toml).lines().filter(|line| !line.starts_with("rks ")).map(|line| format!("{line}\n")).collect();
    let bones = declared("femur", &turned, &on_femur) + &declared("tibia", &tibia, &on_tibia);
    let _ = write!(told, "[laxity_format.kla.tracked]\nunit = \"mm\"\n{bones}");
    write(&toml, told);
}

#[test]
fn warnings_about_tracked_bodies_come_through_to_the_terminal_the_log_and_the_report() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().args(["phantom", "S193761-phantom"]).arg(&knee).assert().success();
    build_model().arg(&knee).args(["--quiet", "--to", "frames"]).assert().success();
    track(&knee);
    let mut command = build_model();
    command.arg(&knee).args(["--to", "calibrate"]);
    for set in ["inference.starts=1", "inference.finalists=1", "inference.rounds=1", "inference.samples=4"] {
        command.args(["--set", &format!("calibrate.{set}")]);
    }
    let run = command.assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    let turned = format!("kla: tracked.femur.frame is turned by {TURN_DEG:.1} deg and shifted by 0.0 mm");
    let off = "kla: tracked.tibia.landmarks lie ";
    // of one kind the terminal has the first, and how many more there are
    assert!(said.contains(&format!("calibrate: {turned}")) && said.contains("(and 1 more of this kind: "), "{said}");
    let log = text(&knee.join("build/log.jsonl"));
    let records: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let record = records.iter().find(|r| r["stage"] == "calibrate").unwrap();
    let warnings: Vec<&str> = record["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect();
    let own: Vec<&&str> = warnings.iter().filter(|w| w.contains("tracked.")).collect();
    assert!(own.len() == 2 && own[0].starts_with(&turned) && own[1].starts_with(off), "{warnings:?}");
    let page = text(&knee.join("build/report.html"));
    assert!(page.contains(&turned) && page.contains(off), "the report does not have them");
}
