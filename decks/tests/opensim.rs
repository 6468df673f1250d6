//! OpenSim knees: laws of what is read, and what is told or refused.

use crate::common::elements::{Law, each_is_what_the_table_says};
use crate::common::knees::{Ligament, answer, apart, ball, plateau, points, pressed, quads};
use decks::known::Class;
use decks::opensim::{Given, elements, import};
use decks::{DeckError, ImportedDeck};
use meshes::frame::Side;
use sim::coordinate::{AP, FE};
use sim::spec::LayerLaw;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A right knee: a ball of 30 mm on a flat plateau, six ligaments, one joint with six coordinates. Metres.
const KNEE: &str = r#"<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="40500">
<Model name="ball">
<Ground name="ground"/>
<gravity>0 0 0</gravity><length_units>m</length_units><force_units>N</force_units>
<BodySet name="bodyset"><objects>
<Body name="femur_r"><mass>2</mass><mass_center>0 0 0</mass_center><inertia>0.01 0.01 0.01 0 0 0</inertia></Body>
<Body name="tibia_r"><mass>2</mass><mass_center>0 0 0</mass_center><inertia>0.01 0.01 0.01 0 0 0</inertia></Body>
<!--BODIES-->
</objects><groups/></BodySet>
<JointSet name="jointset"><objects>
<FreeJoint name="hip"><socket_parent_frame>/ground</socket_parent_frame><socket_child_frame>/bodyset/femur_r</socket_child_frame>
<coordinates><!--PLACE--></coordinates></FreeJoint>
<CustomJoint name="knee_r">
<socket_parent_frame>femur_offset</socket_parent_frame><socket_child_frame>tibia_offset</socket_child_frame>
<coordinates><Coordinate name="flexion"><default_value>0</default_value></Coordinate><Coordinate name="adduction"/><Coordinate name="rotation"/>
<Coordinate name="tx"/><Coordinate name="ty"/><Coordinate name="tz"/></coordinates>
<frames><PhysicalOffsetFrame name="femur_offset"><socket_parent>/bodyset/femur_r</socket_parent><translation>0 0 0</translation><orientation>0 0 0</orientation></PhysicalOffsetFrame>
<PhysicalOffsetFrame name="tibia_offset"><socket_parent>/bodyset/tibia_r</socket_parent><translation>0 0 0</translation><orientation>0 0 0</orientation></PhysicalOffsetFrame></frames>
<SpatialTransform>
<TransformAxis name="rotation1"><coordinates>flexion</coordinates><axis>0 0 1</axis><LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>
<TransformAxis name="rotation2"><coordinates>adduction</coordinates><axis>1 0 0</axis><LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>
<TransformAxis name="rotation3"><coordinates>rotation</coordinates><axis>0 1 0</axis><LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>
<TransformAxis name="translation1"><coordinates>tx</coordinates><axis>1 0 0</axis><LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>
<TransformAxis name="translation2"><coordinates>ty</coordinates><axis>0 1 0</axis><LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>
<TransformAxis name="translation3"><coordinates>tz</coordinates><axis>0 0 1</axis><function><MultiplierFunction><function><Constant><value>0</value></Constant></function><scale>1.1</scale></MultiplierFunction></function></TransformAxis>
</SpatialTransform></CustomJoint>
</objects></JointSet>
<ContactGeometrySet name="contactgeometryset"><objects>
<Smith2018ContactMesh name="femur_cartilage"><socket_frame>/bodyset/femur_r</socket_frame><mesh_file>femur.obj</mesh_file><elastic_modulus>5000000</elastic_modulus><poissons_ratio>0.45</poissons_ratio><thickness>0.002</thickness></Smith2018ContactMesh>
<Smith2018ContactMesh name="tibia_cartilage"><socket_frame>/bodyset/tibia_r</socket_frame><mesh_file>tibia.obj</mesh_file><elastic_modulus>5000000</elastic_modulus><poissons_ratio>0.45</poissons_ratio><thickness>0.003</thickness></Smith2018ContactMesh>
</objects></ContactGeometrySet>
<ForceSet name="forceset"><objects>
LIGAMENTS
<Smith2018ArticularContactForce name="tf_contact"><socket_target_mesh>/contactgeometryset/tibia_cartilage</socket_target_mesh><socket_casting_mesh>/contactgeometryset/femur_cartilage</socket_casting_mesh><elastic_foundation_formulation>linear</elastic_foundation_formulation><use_lumped_contact_model>true</use_lumped_contact_model></Smith2018ArticularContactForce>
</objects></ForceSet>
<!--MORE-->
</Model>
</OpenSimDocument>
"#;

/// Name, femoral and tibial end [m], slack length [m].
const LIGAMENTS: [Ligament; 6] = [
    ("ACLam1", [-0.015, 0.005, 0.005], [0.015, -0.031, 0.0], 0.046),
    ("ACLpl1", [-0.016, 0.0, 0.006], [0.008, -0.031, 0.002], 0.038),
    ("PCLal1", [0.005, 0.0, -0.005], [-0.022, -0.035, 0.0], 0.044),
    ("MCLs1", [0.0, 0.0, -0.04], [0.005, -0.08, -0.03], 0.0805),
    ("MCLs2", [0.0, 0.001, -0.04], [0.001, -0.078, -0.03], 0.0795),
    ("LCL1", [0.0, 0.0, 0.04], [-0.01, -0.06, 0.035], 0.0605),
];
const STIFFNESS_N: f64 = 4000.0;
const TRANSITION: f64 = 0.06;
/// Half the side of the plateau [m].
const HALF_M: f64 = 0.03;

fn point(body: &str, at: &[f64; 3]) -> String {
    format!(
        "<PathPoint name=\"P\"><socket_parent_frame>{body}</socket_parent_frame><location>{:?} {:?} {:?}</location></PathPoint>",
        at[0], at[1], at[2]
    )
}

fn ligament(name: &str, points: &str, slack: f64) -> String {
    format!(
        "<Blankevoort1991Ligament name=\"{name}\"><GeometryPath name=\"path\"><PathPointSet><objects>{points}</objects></PathPointSet></GeometryPath><linear_stiffness>{STIFFNESS_N:?}</linear_stiffness><transition_strain>{TRANSITION:?}</transition_strain><slack_length>{slack:?}</slack_length></Blankevoort1991Ligament>\n"
    )
}

fn knee() -> String {
    let one = |(name, femur, tibia, slack): &Ligament| {
        let points = point("/bodyset/femur_r", femur) + &point("/bodyset/tibia_r", tibia);
        ligament(name, &points, *slack)
    };
    KNEE.replace("LIGAMENTS", &LIGAMENTS.iter().map(one).collect::<String>())
}

/// A grid of points [m] as OBJ.
fn grid(at: impl Fn(f64, f64) -> [f64; 3], turned: bool) -> Vec<u8> {
    let mut out = String::new();
    for [x, y, z] in points(at) {
        let _ = writeln!(out, "v {x:?} {y:?} {z:?}");
    }
    for [a, b, c, d] in quads(1, turned) {
        let _ = writeln!(out, "f {a} {b} {c}\nf {a} {c} {d}");
    }
    out.into_bytes()
}

/// The lower part of a ball about the origin; its radius [m].
fn lower(radius: f64) -> Vec<u8> {
    grid(|u, v| ball(radius, u, v), true)
}

/// A plateau at a height [m].
fn flat(height: f64) -> Vec<u8> {
    grid(|u, v| plateau(HALF_M, height, u, v), false)
}

fn files() -> BTreeMap<&'static str, Vec<u8>> {
    BTreeMap::from([
        ("Geometry/femur.obj", lower(0.03)),
        ("Geometry/tibia.obj", flat(-0.03)),
        ("Geometry/femur_back.obj", lower(0.028)),
        ("Geometry/tibia_back.obj", flat(-0.033)),
    ])
}

fn read_as(text: &str, given: &Given) -> Result<ImportedDeck, DeckError> {
    let files = files();
    let mut read = |name: &str| files.get(name).cloned().ok_or_else(|| format!("{name} is not there"));
    import("ball.osim", text.as_bytes(), &mut read, given)
}

fn read(text: &str) -> Result<ImportedDeck, DeckError> {
    read_as(text, &Given::default())
}

/// Where the knee stands under a load at a flexion, in Grood-Suntay coordinates, and its fibres' forces.

#[test]
fn a_knee_is_read_with_its_side_frames_law_and_ligaments() {
    let deck = read(&knee()).unwrap();
    let spec = &deck.spec;
    assert_eq!((spec.side, spec.fibres.len(), spec.bundles.len()), (Side::Right, 6, 6));
    // of a right knee z is lateral, x forwards, y to the head
    for frame in [&spec.frames.femur, &spec.frames.tibia] {
        let seen = [frame.medial.z, frame.anterior.x, frame.superior.y];
        assert!(apart(&seen, &[-1.0, 1.0, 1.0]) < 1e-12, "{frame:?}");
    }
    let pose = spec.frames.gs_ct_pose;
    assert!([pose.fe_deg, pose.vv_deg, pose.ie_deg, pose.ap_mm].iter().all(|x| x.abs() < 1e-9), "{pose:?}");
    // M = 5 MPa x 0.55 / (1.45 x 0.1) on 5 mm
    let slope = 5.0 * 0.55 / (1.45 * 0.1) / 5.0;
    assert!((spec.contact.pressure_mpa[1] / spec.contact.overclosure_mm[1] - slope).abs() < 1e-12);
    let names: Vec<&str> = spec.bundles.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["ACL_am1", "ACL_pl1", "PCL_al1", "MCL_s1", "MCL_s2", "LCL"]);
    assert!(deck.warnings.iter().all(|w| w.to_string().contains("stands for the bone")), "{:?}", deck.warnings);
}

#[test]
fn a_fibre_pulls_as_opensims_formula_says_at_every_length() {
    let deck = read(&knee()).unwrap();
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    for (bundle, (_, femur, tibia, slack)) in model.bundles.iter().zip(&LIGAMENTS) {
        let rest = (0..3).map(|k| (femur[k] - tibia[k]).powi(2)).sum::<f64>().sqrt();
        for strain in [-0.02, 0.0, 0.01, 0.03, 0.0599, 0.0601, 0.09, 0.2] {
            let wanted = match strain {
                s if s <= 0.0 => 0.0,
                s if s < TRANSITION => STIFFNESS_N / (2.0 * TRANSITION) * s * s,
                s => STIFFNESS_N * (s - TRANSITION / 2.0),
            };
            // a model counts from the CT pose [mm]
            let longer = (slack * (1.0 + strain) - rest) * 1e3;
            let force = bundle.response(longer + bundle.initial_stretch()).force;
            assert!((force - wanted).abs() < 1e-8 * (1.0 + wanted), "{}: {strain}: {force} {wanted}", bundle.name);
        }
    }
}

#[test]
fn moving_the_model_or_its_frames_moves_nothing_in_the_answers() {
    let plain = read(&knee()).unwrap();
    let value =
        |name: &str, x: f64| format!("<Coordinate name=\"{name}\"><default_value>{x:?}</default_value></Coordinate>");
    let place: String =
        ["a", "b", "c", "d", "e", "f"].iter().zip([0.7, -1.2, 2.1, 0.3, -0.4, 1.5]).map(|(n, x)| value(n, x)).collect();
    // the tibia's body stands elsewhere in its own coordinates: so do its points, its mesh and its joint's frame
    let shift = "0.1 -0.2 0.05";
    let welded = "<Body name=\"shank\"><mass>1</mass><inertia>1 1 1 0 0 0</inertia></Body>";
    let weld = format!(
        "<WeldJoint name=\"weld\"><socket_parent_frame>/bodyset/tibia_r</socket_parent_frame><socket_child_frame>shank_offset</socket_child_frame><frames><PhysicalOffsetFrame name=\"shank_offset\"><socket_parent>/bodyset/shank</socket_parent><translation>{shift}</translation><orientation>0.4 -0.3 1.1</orientation></PhysicalOffsetFrame></frames></WeldJoint>\n<CustomJoint name=\"knee_r\">"
    );
    let on_shank = |text: String| {
        let text = text.replace("<!--BODIES-->", welded).replace("<CustomJoint name=\"knee_r\">", &weld);
        // the offset frame is where the tibia's body is: what is fixed there is fixed to the shank
        text.replace(
            "<PathPoint name=\"P\"><socket_parent_frame>/bodyset/tibia_r<",
            "<PathPoint name=\"P\"><socket_parent_frame>/jointset/weld/shank_offset<",
        )
    };
    let moved =
        [knee().replace("<!--PLACE-->", &place), on_shank(knee()), on_shank(knee()).replace("<!--PLACE-->", &place)];
    let a = answer(&plain, 25.0, &pressed(60.0));
    assert!(a.1.iter().any(|f| *f > 20.0), "{a:?}");
    for text in moved {
        let other = read(&text).unwrap();
        let b = answer(&other, 25.0, &pressed(60.0));
        assert!(apart(&a.0, &b.0) < 1e-6 && apart(&a.1, &b.1) < 1e-5, "{a:?} {b:?}");
    }
}

#[test]
fn a_default_pose_changes_the_pose_of_ct_and_no_answer() {
    let plain = read(&knee()).unwrap();
    // the joint turns the tibia about z: backwards is flexion
    let text = knee().replacen("<default_value>0</default_value>", "<default_value>-0.35</default_value>", 1);
    let bent = read(&text).unwrap();
    assert!(
        (bent.spec.frames.gs_ct_pose.fe_deg - 0.35f64.to_degrees()).abs() < 1e-9,
        "{:?}",
        bent.spec.frames.gs_ct_pose
    );
    for anterior in [60.0, -60.0] {
        let [a, b] = [&plain, &bent].map(|deck| answer(deck, 20.0, &pressed(anterior)));
        assert!((a.0[FE.index()] - b.0[FE.index()]).abs() < 1e-9);
        assert!((a.0[AP.index()] - b.0[AP.index()]).abs() < 2e-3 && apart(&a.1, &b.1) < 2e-3, "{a:?} {b:?}");
    }
}

#[test]
fn a_point_more_on_one_bone_lengthens_the_path_and_changes_no_force() {
    let text = knee();
    let (name, femur, tibia, slack) = LIGAMENTS[0];
    let own = point("/bodyset/femur_r", &femur) + &point("/bodyset/tibia_r", &tibia);
    let more = own.clone() + &point("/bodyset/tibia_r", &[tibia[0], tibia[1] - 0.02, tibia[2]]);
    let longer = ligament(name, &more, slack + 0.02).replace(
        &format!("<linear_stiffness>{STIFFNESS_N:?}"),
        // force a mm is stiffness over slack length, and the toe's length its strain times that
        &format!("<linear_stiffness>{:?}", STIFFNESS_N * (slack + 0.02) / slack),
    );
    let longer = longer.replace(&format!(">{TRANSITION:?}<"), &format!(">{:?}<", TRANSITION * slack / (slack + 0.02)));
    let other = read(&text.replace(&ligament(name, &own, slack), &longer)).unwrap();
    let plain = read(&text).unwrap();
    let [a, b] = [&plain, &other].map(|deck| answer(deck, 20.0, &pressed(60.0)));
    assert!(apart(&a.0, &b.0) < 1e-8 && apart(&a.1, &b.1) < 1e-6, "{a:?} {b:?}");
}

#[test]
fn fibres_of_one_law_are_one_bundle() {
    let points = |x: f64| point("/bodyset/femur_r", &[x, 0.0, -0.04]) + &point("/bodyset/tibia_r", &[x, -0.08, -0.04]);
    let two = ligament("cord_1", &points(0.0), 0.079) + &ligament("cord_2", &points(0.004), 0.079);
    let deck =
        read(&knee().replace("<Smith2018ArticularContactForce ", &(two + "<Smith2018ArticularContactForce "))).unwrap();
    let cord = deck.spec.bundles.iter().find(|b| b.name == "cord").unwrap();
    assert!((cord.stiffness_n_per_mm - 2.0 * STIFFNESS_N / 79.0).abs() < 1e-9, "{cord:?}");
    assert_eq!(deck.spec.fibres.iter().filter(|f| f.bundle == "cord").count(), 2);
}

#[test]
fn laws_of_contact_are_jams() {
    let text = knee();
    let law = |text: &str| read(text).unwrap().spec.contact;
    let at = |c: &sim::spec::ContactSpec, d: f64| {
        sim::contact::law::PressureLaw::new(&c.overclosure_mm, &c.pressure_mpa).unwrap().at(d).1
    };
    let m = 5.0 * 0.55 / (1.45 * 0.1);
    let nonlinear = law(&text.replace(">linear<", ">nonlinear<"));
    for d in [0.1f64, 0.5, 1.0, 2.0] {
        let wanted = -m * (1.0 - d / 5.0).ln();
        assert!((at(&nonlinear, d) / wanted - 1.0).abs() < 2e-2, "{d}: {} {wanted}", at(&nonlinear, d));
    }
    // layers of two materials, in series: 2 mm of twice the modulus and 3 mm
    let series = law(&text.replacen(">5000000<", ">10000000<", 1).replace(">true</use_lumped", ">false</use_lumped"));
    assert!((at(&series, 1.0) - 1.0 / (2.0 / (2.0 * m) + 3.0 / m)).abs() < 1e-9);
    // a thickness that varies goes by the faces on bone
    let back = |name: &str| {
        format!(
            "<mesh_file>{name}.obj</mesh_file><use_variable_thickness>true</use_variable_thickness><mesh_back_file>{name}_back.obj</mesh_back_file>"
        )
    };
    let varying =
        ["femur", "tibia"].iter().fold(text, |t, n| t.replace(&format!("<mesh_file>{n}.obj</mesh_file>"), &back(n)));
    let deck = read(&varying).unwrap();
    let layer = deck.spec.contact.layer.as_ref().unwrap();
    assert_eq!((layer.law, layer.youngs_modulus_mpa, layer.poissons_ratio), (LayerLaw::Linear, 5.0, 0.45));
    assert_eq!(layer.bony_faces.len(), 2);
    // both layers have here the thickness that the other model states: the same answers
    let [a, b] = [&read(&knee()).unwrap(), &deck].map(|deck| answer(deck, 20.0, &pressed(30.0)));
    assert!(apart(&a.0, &b.0) < 2e-3 && apart(&a.1, &b.1) < 2e-2, "{a:?} {b:?}");
}

#[test]
fn what_is_no_part_of_the_knee_is_told() {
    let patella = "<Body name=\"patella_r\"><mass>0.1</mass><inertia>1 1 1 0 0 0</inertia></Body>";
    let tendon = point("/bodyset/patella_r", &[0.05, 0.0, 0.0]) + &point("/bodyset/tibia_r", &[0.04, -0.06, 0.0]);
    let text = knee().replace("<!--BODIES-->", patella).replace("<gravity>0 0 0<", "<gravity>0 -9.8 0<");
    let forces = ligament("PT1", &tendon, 0.06)
        + &ligament("off", &tendon, 0.06).replace("<GeometryPath", "<appliesForce>false</appliesForce><GeometryPath");
    let more = forces + "<Millard2012EquilibriumMuscle name=\"vasmed_r\"/><Smith2018ArticularContactForce ";
    let text = text.replace("<Smith2018ArticularContactForce ", &more);
    let wrap = "<PathWrapSet><objects><PathWrap name=\"w\"><wrap_object>Med_Lig_r</wrap_object></PathWrap></objects></PathWrapSet></GeometryPath>";
    let text = text.replacen("</GeometryPath>", wrap, 1);
    let told = read(&text).unwrap().spec.warnings.join("\n");
    for part in [
        "ball.osim:",
        "Millard2012EquilibriumMuscle is passed over: muscles are left out",
        "gravity is left out",
        "patella_r",
        "1 ligaments are left out, since they end on patella_r: PT1",
        "switched off (appliesForce is false) and left out: off",
        "wrap over objects there; here they are straight: ACLam1",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn an_end_off_the_bone_that_the_file_shows_is_told() {
    let geometry = "<attached_geometry><Mesh name=\"bone\"><mesh_file>bone.obj</mesh_file></Mesh></attached_geometry></Body>\n<Body name=\"tibia_r\">";
    let text = knee().replace("</Body>\n<Body name=\"tibia_r\">", geometry);
    let whole = |_: &str| {
        let mesh = meshes::shapes::icosphere(0.04, 4);
        let mut obj: String = mesh.vertices.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
        mesh.triangles.iter().for_each(|t| obj += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
        obj.into_bytes()
    };
    let told = |text: &str| {
        let files = files();
        let mut read = |name: &str| match name.ends_with("bone.obj") {
            true => Ok(whole(name)),
            false => files.get(name).cloned().ok_or_else(|| format!("{name} is not there")),
        };
        import("ball.osim", text.as_bytes(), &mut read, &Given::default()).unwrap().spec.warnings.join("\n")
    };
    // the cruciates end 25 mm inside of a ball of 40: told of those alone
    let right = told(&text);
    assert!(!right.contains("MCLs") && !right.contains("LCL1"), "{right}");
    // without a location a point lies at its body's origin
    let lost = text.replacen(&format!("<location>{:?} {:?} {:?}</location>", 0.0, 0.0, 0.04), "", 1);
    assert_ne!(lost, text);
    let said = told(&lost);
    assert!(
        said.contains("lie far off their bone") && said.contains("LCL") && said.contains("off the femur"),
        "{said}"
    );
}

#[test]
fn every_element_of_the_table_is_what_the_table_says() {
    let with = |part: &str| {
        knee().replace("<!--MORE-->", &format!("<ComponentSet><objects>\n{part}</objects></ComponentSet>"))
    };
    let element = |name: &str| format!("<{name} name=\"x\"/>");
    let file = |part: Option<&str>| part.map_or_else(knee, with);
    let law = Law { table: elements(), file: "ball.osim", element: &element, with: &file, read: &read };
    let counts = each_is_what_the_table_says(&law);
    assert!(elements().values().all(|e| (e.class == Class::Obeyed) != e.parts.is_empty()));
    assert!(counts[0] > 150 && counts[1] > 40 && counts[2] > 2, "{counts:?}");
    // an element that nobody knows is told; one that is nearly known is refused
    assert!(read(&with("<Wonder name=\"x\"/>")).unwrap().spec.warnings.join("").contains("no such element"));
    let e = read(&with("<Blankevoort1991Ligamnt name=\"x\"/>")).unwrap_err();
    assert!(e.to_string().contains("did you mean Blankevoort1991Ligament?"), "{e}");
}

#[test]
fn what_cannot_be_read_is_refused_with_its_line() {
    let change = |from: &str, to: &str| {
        assert!(KNEE.contains(from) || knee().contains(from), "{from}");
        knee().replacen(from, to, 1)
    };
    let cases = [
        (change("Version=\"40500\"", "Version=\"30000\""), "open the model in OpenSim 4 and save it"),
        (
            change("<OpenSimDocument", "<Document").replace("</OpenSimDocument", "</Document"),
            "expected an <OpenSimDocument>",
        ),
        (change("</Model>", ""), "no XML"),
        (
            change("linear_stiffness>4000", "linear_stifness>4000").replacen(
                "</linear_stiffness>",
                "</linear_stifness>",
                1,
            ),
            "did you mean linear_stiffness?",
        ),
        (change("linear_stiffness>4000", "linear_stiffness>-1"), "expected N a unit of strain"),
        (change("linear_stiffness>4000.0", "linear_stiffness>many"), "\"many\" of"),
        (change("linear_stiffness>4000.0", "linear_stiffness>NaN"), "no finite number"),
        (change("slack_length>0.046", "slack_length>46000"), "expected metres"),
        (change("transition_strain>0.06", "transition_strain>6"), "below 1"),
        (
            change(
                "/bodyset/femur_r</socket_parent_frame><location>",
                "/bodyset/femr_r</socket_parent_frame><location>",
            ),
            "is no body or offset frame",
        ),
        (change("<location>-0.015 0.005 0.005<", "<location>-0.015 0.005<"), "has 2 numbers, expected 3"),
        (change("poissons_ratio>0.45", "poissons_ratio>0.5"), "below 0.5"),
        (change("thickness>0.002", "thickness>2"), "expected metres"),
        (change("<mesh_file>femur.obj", "<mesh_file>gone.obj"), "gone.obj is not there"),
        (change(">linear</elastic", ">quadratic</elastic"), "expected linear or nonlinear"),
        (
            change("/contactgeometryset/tibia_cartilage", "/contactgeometryset/tibia_cartlage"),
            "no Smith2018ContactMesh",
        ),
        (change("<length_units>m<", "<length_units>mm<"), "expected m"),
        (change("<axis>0 0 1</axis>", "<axis>0 0 0</axis>"), "expected a direction"),
        (change("<coordinates>flexion</coordinates>", "<coordinates>flex</coordinates>"), "names the coordinate flex"),
        (change("name=\"tibia_r\"", "name=\"femur_r\""), "another body's"),
        (
            change("<socket_parent>/bodyset/femur_r</socket_parent>", "<socket_parent>femur_offset</socket_parent>"),
            "circle",
        ),
        (change("name=\"ACLpl1\"", "name=\"ACLam1\""), "another ligament has its name"),
        (
            change("<PathPoint name", "<MovingPathPoint name").replacen("</PathPoint>", "</MovingPathPoint>", 1),
            "a fibre's ends are fixed",
        ),
        (knee().replace("Smith2018ArticularContactForce", "HuntCrossleyForce"), "--contact jam"),
    ];
    for (text, wanted) in cases {
        let e = read(&text).expect_err(wanted);
        assert!(e.to_string().contains(wanted), "{wanted}: {e}");
        assert!(e.to_string().starts_with("ball.osim:"), "{e}");
    }
}

#[test]
fn bodies_and_side_are_asked_for_where_nothing_tells_them() {
    let plain = knee().replace("femur", "upper").replace("tibia", "lower");
    let plain = plain.replace("upper.obj", "femur.obj").replace("lower.obj", "tibia.obj");
    let e = read(&plain).unwrap_err();
    assert!(e.to_string().contains("--femur BODY --tibia BODY"), "{e}");
    let given = |side| Given { femur: Some("upper_r".into()), tibia: Some("lower_r".into()), side };
    let named = read_as(&plain, &given(None)).unwrap();
    assert_eq!(named.spec.fibres, read(&knee()).unwrap().spec.fibres);
    let e = read_as(&plain, &given(Some(Side::Left))).unwrap_err();
    assert!(e.to_string().contains("--side says left"), "{e}");
    let wrong = Given { femur: Some("uper_r".into()), ..Given::default() };
    assert!(read_as(&plain, &wrong).unwrap_err().to_string().contains("did you mean upper_r?"));
}

#[test]
fn a_mirrored_knee_is_a_left_one_and_answers_alike() {
    let mirrored = |p: &[f64; 3]| [p[0], p[1], -p[2]];
    let mut text = knee();
    for (name, femur, tibia, slack) in &LIGAMENTS {
        let points = |f: &[f64; 3], t: &[f64; 3]| point("/bodyset/femur_r", f) + &point("/bodyset/tibia_r", t);
        let own = ligament(name, &points(femur, tibia), *slack);
        text = text.replace(&own, &ligament(name, &points(&mirrored(femur), &mirrored(tibia)), *slack));
    }
    let left = read(&text.replace("femur_r", "femur_l").replace("tibia_r", "tibia_l")).unwrap();
    assert_eq!(left.spec.side, Side::Left);
    let [a, b] = [&read(&knee()).unwrap(), &left].map(|deck| answer(deck, 20.0, &pressed(60.0)));
    assert!(apart(&a.0, &b.0) < 1e-4 && apart(&a.1, &b.1) < 1e-3, "{a:?} {b:?}");
}

#[test]
fn a_damaged_file_is_refused_and_never_a_panic() {
    let text = knee();
    let places = (0..text.len()).step_by(97).filter(|&n| text.is_char_boundary(n));
    for cut in places {
        assert!(read(&text[..cut]).is_err(), "cut at {cut}");
    }
    // a letter changed here and there: read or refused
    for at in (0..text.len()).step_by(331) {
        let mut bytes = text.clone().into_bytes();
        bytes[at] = b'<';
        let _ = read(&String::from_utf8_lossy(&bytes));
    }
    let deep = format!("<OpenSimDocument Version=\"40500\">{}", "<a>".repeat(200_000));
    assert!(read(&deep).unwrap_err().to_string().contains("nest more than"));
    let mut nothing = |name: &str| Err(name.to_owned());
    let e = import("x.osim", &[0xff, 0xfe, 0x00], &mut nothing, &Given::default()).unwrap_err();
    assert!(e.to_string().contains("not UTF-8"), "{e}");
}
