//! A small knee whose ligaments wrap over objects: a warning names each, with how much of its straight line lies within.
#![allow(clippy::unwrap_used, reason = "tests")]

use super::*;
use std::fmt::Write;

/// A ball of 30 mm on a flat plateau, both bodies in one place. Metres.
const KNEE: &str = r#"<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="40500">
<Model name="wrapped">
<Ground name="ground"/>
<gravity>0 0 0</gravity>
<BodySet name="bodyset"><objects>
<Body name="femur_r"><mass>2</mass><inertia>0.01 0.01 0.01 0 0 0</inertia><WrapObjectSet name="wrapobjectset"><objects>ON_FEMUR</objects></WrapObjectSet></Body>
<Body name="tibia_r"><mass>2</mass><inertia>0.01 0.01 0.01 0 0 0</inertia><WrapObjectSet name="wrapobjectset"><objects>ON_TIBIA</objects></WrapObjectSet></Body>
<Body name="patella_r"><mass>1</mass><inertia>0.01 0.01 0.01 0 0 0</inertia><WrapObjectSet name="wrapobjectset"><objects>
<WrapSphere name="on_patella"><radius>0.01</radius></WrapSphere></objects></WrapObjectSet></Body>
</objects></BodySet>
<JointSet name="jointset"><objects>
<FreeJoint name="knee_r"><socket_parent_frame>/bodyset/femur_r</socket_parent_frame><socket_child_frame>/bodyset/tibia_r</socket_child_frame>
<coordinates><Coordinate name="rx"/><Coordinate name="ry"/><Coordinate name="rz"/><Coordinate name="tx"/><Coordinate name="ty"/><Coordinate name="tz"/></coordinates></FreeJoint>
</objects></JointSet>
<ContactGeometrySet name="contactgeometryset"><objects>
<Smith2018ContactMesh name="femur_cartilage"><socket_frame>/bodyset/femur_r</socket_frame><mesh_file>femur.obj</mesh_file><elastic_modulus>5000000</elastic_modulus><poissons_ratio>0.45</poissons_ratio><thickness>0.002</thickness></Smith2018ContactMesh>
<Smith2018ContactMesh name="tibia_cartilage"><socket_frame>/bodyset/tibia_r</socket_frame><mesh_file>tibia.obj</mesh_file><elastic_modulus>5000000</elastic_modulus><poissons_ratio>0.45</poissons_ratio><thickness>0.003</thickness></Smith2018ContactMesh>
</objects></ContactGeometrySet>
<ForceSet name="forceset"><objects>
LIGAMENTS
<Smith2018ArticularContactForce name="contact"><socket_target_mesh>/contactgeometryset/tibia_cartilage</socket_target_mesh><socket_casting_mesh>/contactgeometryset/femur_cartilage</socket_casting_mesh></Smith2018ArticularContactForce>
</objects></ForceSet>
</Model>
</OpenSimDocument>
"#;

/// Steps of a surface a side, and half the opening of the ball [rad].
const N: usize = 30;
const OPENING: f64 = 1.1;

/// A surface [m] as OBJ: `at` gives its points for two numbers from -1 to 1.
fn surface(at: impl Fn(f64, f64) -> [f64; 3], turned: bool) -> Vec<u8> {
    let along = |k: usize| 2.0 * k as f64 / N as f64 - 1.0;
    let mut out = String::new();
    for [x, y, z] in (0..=N).flat_map(|i| (0..=N).map(move |j| (i, j))).map(|(i, j)| at(along(i), along(j))) {
        let _ = writeln!(out, "v {x:?} {y:?} {z:?}");
    }
    for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
        let [a, b, c, d] = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)].map(|(i, j)| 1 + i * (N + 1) + j);
        let [b, d] = if turned { [d, b] } else { [b, d] };
        let _ = writeln!(out, "f {a} {b} {c}\nf {a} {c} {d}");
    }
    out.into_bytes()
}

/// A ligament over points, the first on the femur and the others on the tibia, with its wraps: object and range.
fn ligament(name: &str, points: &[[f64; 3]], slack: f64, wraps: &[(&str, &str)]) -> String {
    let point = |(k, [x, y, z]): (usize, &[f64; 3])| {
        let body = if k == 0 { "femur_r" } else { "tibia_r" };
        format!(
            "<PathPoint name=\"P{k}\"><socket_parent_frame>/bodyset/{body}</socket_parent_frame><location>{x:?} {y:?} {z:?}</location></PathPoint>"
        )
    };
    let wrap = |(object, range): &(&str, &str)| {
        format!(
            "<PathWrap name=\"wrap\"><wrap_object>{object}</wrap_object><method>hybrid</method><range>{range}</range></PathWrap>"
        )
    };
    let (points, wraps): (String, String) =
        (points.iter().enumerate().map(point).collect(), wraps.iter().map(wrap).collect());
    format!(
        "<Blankevoort1991Ligament name=\"{name}\"><GeometryPath name=\"path\"><PathPointSet><objects>{points}</objects></PathPointSet><PathWrapSet><objects>{wraps}</objects></PathWrapSet></GeometryPath><linear_stiffness>4000</linear_stiffness><slack_length>{slack:?}</slack_length></Blankevoort1991Ligament>\n"
    )
}

/// The warning about the knee's ligaments that wrap, with these objects on femur and tibia.
fn told(on_femur: &str, on_tibia: &str, ligaments: &str) -> Option<String> {
    let text = KNEE.replace("ON_FEMUR", on_femur).replace("ON_TIBIA", on_tibia).replace("LIGAMENTS", ligaments);
    let radius = 0.03;
    let ball = |u: f64, v: f64| {
        let (a, b) = (u * OPENING, v * OPENING);
        [radius * a.sin() * b.cos(), -radius * a.cos() * b.cos(), radius * b.sin()]
    };
    let (femur, tibia) = (surface(ball, true), surface(|u, v| [0.03 * u, -0.03, 0.03 * v], false));
    let mut read = |name: &str| match name {
        "femur.obj" => Ok(femur.clone()),
        "tibia.obj" => Ok(tibia.clone()),
        other => Err(format!("{other} is not there")),
    };
    let deck = import("wrapped.osim", text.as_bytes(), &mut read, &Given::default()).unwrap();
    let found: Vec<&String> = deck.spec.warnings.iter().filter(|w| w.contains(" wrap over objects")).collect();
    assert!(found.len() < 2, "{found:?}");
    found.first().map(|w| (*w).clone())
}

const ACL: [[f64; 3]; 2] = [[-0.015, 0.005, 0.005], [0.015, -0.031, 0.0]];
const PCL: [[f64; 3]; 2] = [[0.005, 0.0, -0.005], [-0.022, -0.035, 0.0]];
const MCL: [[f64; 3]; 2] = [[0.0, 0.0, -0.04], [0.0, -0.08, -0.04]];
const LCL: [[f64; 3]; 3] = [[0.0, 0.0, 0.04], [0.0, -0.04, 0.04], [0.0, -0.08, 0.04]];
const ALL: &str = "-1 -1";

#[test]
fn a_ligament_that_wraps_is_named_with_how_far_its_straight_line_lies_within_the_object() {
    // about the middle of the PCL's line; the cylinder's axis is x, 4 mm from the MCL's line; a ball about a point of the LCL's second line
    let on_femur = "<WrapEllipsoid name=\"about_pcl\"><translation>-0.0085 -0.0175 -0.0025</translation><dimensions>0.01 0.01 0.01</dimensions></WrapEllipsoid>
        <WrapSphere name=\"off\"><active>false</active><radius>0.5</radius></WrapSphere>";
    let on_tibia = "<WrapCylinder name=\"under_mcl\"><xyz_body_rotation>0 1.5707963267948966 0</xyz_body_rotation><translation>0 -0.04 -0.036</translation><radius>0.01</radius><length>0.04</length></WrapCylinder>
        <WrapSphere name=\"about_lcl\"><translation>0 -0.06 0.04</translation><radius>0.005</radius></WrapSphere>";
    let ligaments = ligament("ACL1", &ACL, 0.046, &[("off", ALL)])
        + &ligament("PCL1", &PCL, 0.044, &[("about_pcl", ALL)])
        + &ligament("MCL1", &MCL, 0.079, &[("under_mcl", ALL)])
        + &ligament("LCL1", &LCL, 0.079, &[("about_lcl", ALL), ("about_lcl", "1 2")]);
    assert_eq!(
        told(on_femur, on_tibia, &ligaments).unwrap(),
        "3 ligaments wrap over objects there; here they are straight: \
         PCL1 (20.0 mm of the line lie within about_pcl, 10.0 mm deep at most), \
         MCL1 (18.3 mm of the line lie within under_mcl, 6.0 mm deep at most), \
         LCL1 (10.0 mm of the line lie within about_lcl, 5.0 mm deep at most; the line passes beside about_lcl)"
    );
}

#[test]
fn what_cannot_be_measured_of_a_wrap_is_told_too_and_one_that_is_off_is_not() {
    let on_femur = "<WrapSphere name=\"off\"><active>false</active><radius>0.5</radius></WrapSphere>";
    let on_tibia = "<WrapSphere name=\"flat\"><radius>0</radius></WrapSphere>
        <WrapTorus name=\"ring\"><translation>0 -0.04 0.2</translation><quadrant>-x</quadrant><inner_radius>0.002</inner_radius><outer_radius>0.01</outer_radius></WrapTorus>";
    let knee = |acl: &[(&str, &str)], lcl: &[(&str, &str)]| {
        let ligaments = ligament("ACL1", &ACL, 0.046, acl)
            + &ligament("PCL1", &PCL, 0.044, &[])
            + &ligament("MCL1", &MCL, 0.079, &[])
            + &ligament("LCL1", &LCL, 0.079, lcl);
        told(on_femur, on_tibia, &ligaments)
    };
    assert_eq!(knee(&[], &[("off", ALL)]), None);
    let words = knee(&[("nowhere", ALL), ("on_patella", ALL)], &[("flat", ALL), ("ring", ALL)]).unwrap();
    for part in [
        "2 ligaments wrap over objects there",
        "ACL1 (over \"nowhere\", which the file does not have; over on_patella on patella_r, which is no part of femur and tibia)",
        "LCL1 (over flat, whose size is not above 0; the line passes beside ring, over whose side -x it has to go)",
    ] {
        assert!(words.contains(part), "{part}: {words}");
    }
}

#[test]
fn a_line_that_ends_within_its_object_is_told_to_be_straight_in_opensim_too() {
    // about a point of the MCL's line; the cylinder's axis is x
    let ball = |y: f64| {
        format!("<WrapSphere name=\"foot\"><translation>0 {y:?} -0.04</translation><radius>0.006</radius></WrapSphere>")
    };
    let rod = |y: f64| {
        format!(
            "<WrapCylinder name=\"foot\"><xyz_body_rotation>0 1.5707963267948966 0</xyz_body_rotation><translation>0 {y:?} -0.04</translation><radius>0.006</radius><length>0.04</length></WrapCylinder>"
        )
    };
    let ligaments = ligament("ACL1", &ACL, 0.046, &[])
        + &ligament("PCL1", &PCL, 0.044, &[])
        + &ligament("MCL1", &MCL, 0.079, &[("foot", ALL)])
        + &ligament("LCL1", &LCL, 0.079, &[]);
    let at_the_end = "MCL1 (6.0 mm of the line lie within foot, 6.0 mm deep at most, with an end of it: OpenSim leaves it straight too)";
    let before = "MCL1 (12.0 mm of the line lie within foot, 6.0 mm deep at most)";
    for (y, expected) in [(-0.08, at_the_end), (-0.07, before)] {
        for object in [ball(y), rod(y)] {
            let words = told("", &object, &ligaments).unwrap();
            assert!(words.contains(expected), "{words}");
        }
    }
}
