//! FEBio knees: laws of what is read, and what is told or refused.

use crate::common::elements::{Law, each_is_what_the_table_says};
use crate::common::knees::{N, answer, apart, ball, pressed, quads, told};
use crate::febio_knee::{
    CONTACT, FRAMES, LIGAMENTS, PENALTY, STIFFNESS, TOE_MM, bare, curve, force, knee, layered, list, plateau, pts,
};
use decks::febio::{elements, import};
use decks::opensim::Given;
use decks::{DeckError, ImportedDeck};
use meshes::frame::Side;
use sim::ligament::of_fibres;
use sim::spec::{BundleSpec, ContactSpec, Law as LigamentLaw, LayerLaw, fibre_damping};
use std::fmt::Write;

fn read_as(text: &str, given: &Given) -> Result<ImportedDeck, DeckError> {
    import("ball.feb", text.as_bytes(), given)
}

fn read(text: &str) -> Result<ImportedDeck, DeckError> {
    read_as(text, &Given::default())
}

fn pressure(c: &ContactSpec, d: f64) -> f64 {
    sim::contact::law::PressureLaw::new(&c.overclosure_mm, &c.pressure_mpa).expect("a law").at(d).1
}

#[test]
fn a_knee_is_read_with_its_side_frames_law_and_ligaments() {
    let deck = read(&knee().text()).unwrap();
    let spec = &deck.spec;
    assert_eq!((spec.id.as_str(), spec.side, spec.fibres.len()), ("ball", Side::Right, 6));
    for (frame, (_, origin)) in [&spec.frames.femur, &spec.frames.tibia].into_iter().zip(FRAMES) {
        let seen = [frame.medial.z, frame.anterior.x, frame.superior.y, frame.origin.y];
        assert!(apart(&seen, &[-1.0, 1.0, 1.0, origin[1]]) < 1e-12, "{frame:?}");
    }
    assert!((pressure(&spec.contact, 0.5) - PENALTY * 0.5).abs() < 1e-12);
    let names: Vec<&str> = spec.bundles.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["ACL_am1", "ACL_pl1", "PCL_al1", "MCL_s1", "MCL_s2", "LCL"]);
    assert!(deck.warnings.iter().all(|w| w.to_string().contains("stands for the bone")), "{:?}", deck.warnings);
}

#[test]
fn a_model_keeps_the_id_that_its_file_tells_and_else_has_the_files_name() {
    let text = knee().text();
    let root = text.find("<febio_spec").unwrap();
    let at = root + text[root..].find('>').unwrap() + 1;
    let of = |comment: &str| read(&format!("{}{comment}{}", &text[..at], &text[at..])).unwrap().spec.id;
    for comment in ["", "<!-- of a knee -->", "<!-- model: -->"] {
        assert_eq!(of(comment), "ball", "{comment}");
    }
    for id in ["S1", "K & \"1\" <left>, of two"] {
        assert_eq!(of(&format!("<!-- {}{id} -->", decks::febio::MODEL)), id);
    }
}

#[test]
fn a_fibre_pulls_as_its_curve_says_by_every_measure() {
    let length = |k: usize| {
        let (_, a, b, _) = LIGAMENTS[k];
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    };
    for measure in ["elongation", "strain", "stretch"] {
        let mut other = bare();
        other.face("femur", |u, v| ball(30.0, u, v), true);
        other.face("tibia", |u, v| plateau(-30.0, u, v), false);
        for (k, (name, femur, tibia, begins)) in LIGAMENTS.into_iter().enumerate() {
            let by = |x: f64| match measure {
                "elongation" => x,
                "strain" => x / length(k),
                _ => 1.0 + x / length(k),
            };
            let points: Vec<_> = curve(begins).into_iter().map(|[x, f]| [by(x), f / 2.0]).collect();
            let material = format!("<scale>2</scale><measure>{measure}</measure>{}", force(&points, "EXTRAPOLATE"));
            other.spring(name, [femur, tibia], "nonlinear spring", &material);
        }
        let deck = read(&other.text()).unwrap();
        let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
        for (bundle, (_, _, _, begins)) in model.bundles.iter().zip(LIGAMENTS) {
            for x in [-3.0, 0.0, 0.6, 1.8, 2.99, 3.5, 9.0, 60.0] {
                let wanted = match x {
                    x if x <= 0.0 => 0.0,
                    x if x < 2.0 * TOE_MM => STIFFNESS / (4.0 * TOE_MM) * x * x,
                    x => STIFFNESS * (x - TOE_MM),
                };
                let force = bundle.response(begins + x + bundle.initial_stretch()).force;
                assert!(
                    (force - wanted).abs() < 1e-6 * (1.0 + wanted),
                    "{measure} {}: {x}: {force} {wanted}",
                    bundle.name
                );
            }
        }
    }
}

/// A law that the reader does not know would come back as another: here it is found.
#[test]
fn a_spring_by_the_table_of_each_law_pulls_by_that_law() {
    let ends = [[0.0, 2.0, -41.0], [0.0, -79.0, -31.0]];
    let length = f64::hypot(81.0, 10.0);
    for law in LigamentLaw::ALL {
        let spec = BundleSpec {
            name: "cord".into(),
            reference_strain: 1.02,
            stiffness_n_per_mm: STIFFNESS,
            reference_length_mm: length,
            toe_strain: 0.03,
            law,
            damping_n_s_per_mm: fibre_damping(),
        };
        let written = of_fibres(&spec, 1, None).unwrap();
        let begins = -written.initial_stretch();
        let table = written.table(40.0).into_iter().map(|[x, f]| [begins + x, f]);
        let points: Vec<[f64; 2]> = [[begins - 50.0, 0.0]].into_iter().chain(table).collect();
        let mut knee = knee();
        knee.spring("cord", ends, "nonlinear spring", &force(&points, "EXTRAPOLATE"));
        let deck = read(&knee.text()).unwrap();
        let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
        let cord = model.bundles.iter().find(|b| b.name == "cord").unwrap();
        assert_eq!(cord.law, law);
        for longer in [-3.0, 0.0, 0.6, 1.8, 3.5, 9.0, 30.0] {
            let [wanted, found] = [&written, cord].map(|b| b.response(longer + b.initial_stretch()).force);
            assert!((found - wanted).abs() < 1e-6 * (1.0 + wanted), "{law:?} {longer}: {found} {wanted}");
        }
    }
}

#[test]
fn linear_springs_pull_from_their_own_length_and_those_that_push_are_told() {
    let with = |kind: &str| {
        let mut knee = knee();
        let ends = [[0.0, 2.0, -41.0], [0.0, -79.0, -31.0]];
        knee.spring("cord", ends, kind, "<E>25</E>");
        read(&knee.text()).unwrap()
    };
    for (kind, pushes) in [("tension-only linear spring", false), ("linear spring", true)] {
        let deck = with(kind);
        let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
        let cord = model.bundles.iter().find(|b| b.name == "cord").unwrap();
        for x in [-1.0, 0.0, 0.1, 1.0, 5.0] {
            let wanted = 25.0 * f64::max(x, 0.0);
            let force = cord.response(x + cord.initial_stretch()).force;
            // a toe of a ten-thousandth of the length stands for none
            assert!((force - wanted).abs() < 25.0 * 1e-4 * 82.0, "{kind} {x}: {force} {wanted}");
        }
        assert!(!told(&deck).contains("depart from"), "{}", told(&deck));
        assert_eq!(
            told(&deck).contains("1 springs push there when they are shorter than slack; here they are slack: cord"),
            pushes
        );
    }
}

#[test]
fn older_formats_give_the_same_knee() {
    let now = read(&knee().text()).unwrap();
    // of 3.0: sets as elements, load curves apart from their springs
    let mut three = bare();
    three.face("femur", |u, v| ball(30.0, u, v), true);
    three.face("tibia", |u, v| plateau(-30.0, u, v), false);
    let mut curves = String::new();
    for (k, (name, femur, tibia, begins)) in LIGAMENTS.into_iter().enumerate() {
        three.spring(
            name,
            [femur, tibia],
            "nonlinear spring",
            &format!("<scale>1</scale><force lc=\"{}\">1</force>", k + 1),
        );
        let points = pts(&curve(begins)).replace("pt>", "point>");
        let _ = write!(
            curves,
            "<load_controller id=\"{}\" type=\"loadcurve\"><interpolate>LINEAR</interpolate><extend>EXTRAPOLATE</extend><points>{points}</points></load_controller>",
            k + 1
        );
    }
    three.frames();
    three.more = format!("<LoadData>{curves}</LoadData>");
    let text = three.text().replace("version=\"4.0\"", "version=\"3.0\"");
    assert_eq!(read(&text).unwrap().spec, now.spec);
    // of 2.5: a Geometry whose elements state their material, bodies by number, master and slave, curves with attributes
    let text = text.replace("version=\"3.0\"", "version=\"2.5\"").replace("Mesh>", "Geometry>");
    let start = text.find("<MeshDomains>").unwrap();
    let end = text.find("</MeshDomains>").unwrap() + "</MeshDomains>".len();
    let mut text = text.replace(&text[start..end].to_owned(), "");
    for (name, id) in [("femur", 1), ("tibia", 2)] {
        text = text.replace(&format!("name=\"{name}_part\">"), &format!("name=\"{name}_part\" mat=\"{id}\">"));
        text = text.replace(&format!("><rb>{name}</rb></bc>"), &format!(" rb=\"{id}\"/>"));
    }
    text = text.replace("<bc type=\"rigid\"", "<rigid");
    text = text.replace(
        "<primary>femur_surface</primary><secondary>tibia_surface</secondary>",
        "<master surface=\"femur_surface\"/><slave surface=\"tibia_surface\"/>",
    );
    text = text
        .replace("<load_controller", "<loadcurve")
        .replace("</load_controller", "</loadcurve")
        .replace(" type=\"loadcurve\"", " type=\"linear\" extend=\"extrapolate\"");
    text = text
        .replace("<interpolate>LINEAR</interpolate><extend>EXTRAPOLATE</extend><points>", "")
        .replace("</points>", "");
    assert_eq!(read(&text).unwrap().spec, now.spec);
}

#[test]
fn axes_of_ligaments_are_told_and_those_of_joints_taken() {
    let text = knee().text();
    let plain = read(&text).unwrap();
    let bare = text.replace("_anatomical", "_points");
    let by_ligaments = read(&bare).unwrap();
    assert!(told(&by_ligaments).contains("the file states no anatomical axes"), "{}", told(&by_ligaments));
    let off = |deck: &ImportedDeck| {
        let pairs =
            [(&deck.spec.frames.femur, &plain.spec.frames.femur), (&deck.spec.frames.tibia, &plain.spec.frames.tibia)];
        pairs
            .iter()
            .map(|(a, b)| a.medial.angle(&b.medial).max(a.superior.angle(&b.superior)).to_degrees())
            .fold(0.0, f64::max)
    };
    assert!(off(&by_ligaments) > 0.1 && off(&by_ligaments) < 15.0, "{}", off(&by_ligaments));
    let joint = |name: &str, axis: &str, bodies: [&str; 2], at: &str| {
        format!(
            "<rigid_connector name=\"{name}\" type=\"rigid cylindrical joint\"><body_a>{}</body_a><body_b>{}</body_b><joint_origin>{at}</joint_origin><joint_axis>{axis}</joint_axis></rigid_connector>",
            bodies[0], bodies[1]
        )
    };
    let link = "<material id=\"9\" name=\"link\" type=\"rigid body\"/>\n</Material>";
    let joints = joint("flexion", "0,0,1", ["femur", "link"], "0,0,0")
        + &joint("rotation", "0,-1,0", ["link", "tibia"], "0,-30,0");
    let jointed = bare.replace("</Material>", link).replace("<Contact>", &format!("<Rigid>{joints}</Rigid><Contact>"));
    let by_joints = read(&jointed).unwrap();
    assert!(off(&by_joints) < 1e-9, "{}", off(&by_joints));
    assert!((by_joints.spec.frames.tibia.origin.y + 30.0).abs() < 1e-12);
}

#[test]
fn each_pass_of_contact_adds_its_own_force() {
    let two = read(&knee().text().replace("<two_pass>0<", "<two_pass>1<")).unwrap();
    assert!((pressure(&two.spec.contact, 0.5) - PENALTY).abs() < 1e-12);
    let rough =
        read(&knee().text().replace("<search_radius>", "<fric_coeff>0.05</fric_coeff><search_radius>")).unwrap();
    assert_eq!(rough.spec.contact.friction, 0.05);
}

#[test]
fn cartilage_that_deforms_is_a_layer_of_its_material_and_thickness() {
    let deck = read(&layered("type=\"neo-Hookean\"><E>5</E><v>0.45</v>").text()).unwrap();
    let layer = deck.spec.contact.layer.as_ref().unwrap();
    assert_eq!((layer.law, layer.youngs_modulus_mpa, layer.poissons_ratio), (LayerLaw::Logarithmic, 5.0, 0.45));
    assert_eq!(layer.bony_faces.len(), 2);
    // M = E (1 - v) / ((1 + v) (1 - 2 v)) on 5 mm; a sphere's facets are a little nearer than its radii
    let m = 5.0 * 0.55 / (1.45 * 0.1);
    assert!((pressure(&deck.spec.contact, 1.0) / (m / 5.0) - 1.0).abs() < 2e-3);
    // shear modulus and bulk modulus state the same material
    let (shear, bulk) = (5.0 / 2.9, 5.0 / 0.3);
    let same = layered(&format!("type=\"Mooney-Rivlin\"><c1>{:?}</c1><c2>0</c2><k>{bulk:?}</k>", shear / 2.0));
    let other = read(&same.text()).unwrap();
    let [a, b] = [&deck, &other].map(|deck| answer(deck, 20.0, &pressed(30.0)));
    assert!(apart(&a.0, &b.0) < 1e-6 && apart(&a.1, &b.1) < 1e-5, "{a:?} {b:?}");
    // rigid faces that press as a layer of 5 mm does, in proportion to strain
    let linear = read(&layered("type=\"isotropic elastic\"><E>5</E><v>0.45</v>").text()).unwrap();
    let rigid = read(&knee().text().replace("<penalty>4.0<", &format!("<penalty>{:?}<", m / 5.0))).unwrap();
    let [a, b] = [&linear, &rigid].map(|deck| answer(deck, 20.0, &pressed(30.0)));
    assert!(apart(&a.0, &b.0) < 5e-3 && apart(&a.1, &b.1) < 5e-2, "{a:?} {b:?}");
    // of another material: its line is named
    let text = layered("type=\"Ogden\"><c1>1</c1>").text();
    let e = read(&text).unwrap_err();
    assert!(e.line > 0 && e.message.contains("a cartilage is of \"Ogden\"; expected neo-Hookean"), "{e}");
    // tied to bone in place of fixed
    let mut tied = layered("type=\"neo-Hookean\"><E>5</E><v>0.45</v>");
    tied.face("bone", |u, v| plateau(-33.0, u, v), false);
    let text = tied.text().replace("mat=\"bone\"", "mat=\"tibia\"");
    let text = text.replace("<bc type=\"rigid\" node_set=\"tibia_inner\"><rb>tibia</rb></bc>", "");
    let first: usize = 1 + (N + 1) * (N + 1) * 3;
    let faces: String = quads(first, false)
        .iter()
        .map(|q| format!("<quad4 id=\"1\">{}</quad4>", list(&[q[3], q[2], q[1], q[0]])))
        .collect();
    let pair = format!(
        "<Surface name=\"back\">{faces}</Surface><SurfacePair name=\"glue\"><primary>back</primary><secondary>bone_surface</secondary></SurfacePair></Mesh>"
    );
    let text = text.replace("</Mesh>", &pair).replace(
        "</Contact>",
        "<contact name=\"glue\" type=\"tied-elastic\" surface_pair=\"glue\"><penalty>1</penalty></contact></Contact>",
    );
    let glued = read(&text).unwrap();
    assert_eq!(glued.spec.contact, deck.spec.contact);
}

#[test]
fn what_is_no_part_of_the_knee_is_told() {
    let mut knee = knee();
    knee.materials += "<material id=\"4\" name=\"patella\" type=\"rigid body\"/>\n<material id=\"5\" name=\"meniscus\" type=\"Fung orthotropic\"><E1>1</E1></material>\n";
    knee.spring("tendon", [[50.0, 0.0, 0.0], [40.0, -60.0, 0.0]], "tension-only linear spring", "<E>100</E>");
    let text = knee.text().replace("node_set=\"tendon_femur\"><rb>femur<", "node_set=\"tendon_femur\"><rb>patella<");
    let loads = "<Rigid><rigid_load type=\"rigid_force\"><rb>femur</rb></rigid_load></Rigid>\n<Loads><body_load type=\"const\"/></Loads>\n<Contact>";
    let said = told(&read(&text.replace("<Contact>", loads)).unwrap());
    for part in [
        "ball.feb:",
        "rigid_load rigid_force is passed over: loads are left out",
        "Loads is passed over",
        "material Fung orthotropic is passed over",
        "rigid bodies that are no part of femur and tibia are left out: patella",
        "1 springs lead not from femur to tibia, and are left out: tendon",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn every_element_of_the_table_is_what_the_table_says() {
    let element = |name: &str| match name.split_once(':') {
        Some((tag, kind)) => format!("<{tag} type=\"{kind}\"/>"),
        None => format!("<{name}/>"),
    };
    let with = |part: &str| {
        let mut knee = knee();
        knee.more = format!("<Step><step>\n{part}</step></Step>");
        knee.text()
    };
    let file = |part: Option<&str>| part.map_or_else(|| knee().text(), with);
    let law = Law { table: elements(), file: "ball.feb", element: &element, with: &file, read: &read };
    let counts = each_is_what_the_table_says(&law);
    assert!(counts[0] > 100 && counts[1] > 5 && counts[2] > 10, "{counts:?}");
    assert!(told(&read(&with("<Wonder/>")).unwrap()).contains("Wonder is passed over: FEBio 4 has no such element"));
    let e = read(&with("<contact type=\"sliding-elastc\" surface_pair=\"tf\"/>")).unwrap_err();
    assert!(e.to_string().contains("did you mean contact sliding-elastic?"), "{e}");
}

#[test]
fn what_cannot_be_read_is_refused_with_its_line() {
    let whole = knee().text();
    let change = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let pairless = change("surface_pair=\"tf\"", "surface_pair=\"ft\"");
    let two = {
        let mut knee = knee();
        knee.contact += &CONTACT.replace("4.0", "5.0").replace("name=\"tf\"", "name=\"second\"");
        knee.text()
    };
    let cases = [
        (change("version=\"4.0\"", "version=\"1.2\""), "open the file in FEBio Studio and save it"),
        (change("<febio_spec", "<febio").replace("</febio_spec", "</febio"), "expected a <febio_spec>"),
        (change("</Mesh>", ""), "no XML"),
        (change("type=\"solid\"/>", "type=\"biphasic\"/>"), "expected solid"),
        (change("type=\"solid\"/>", "type=\"solid\"><units>SI</units></Module>"), "expected mm-N-s"),
        (change("<penalty>4.0", "<penalty>-4.0"), "expected MPa/mm"),
        (change("<penalty>4.0", "<penalty>many"), "\"many\" of"),
        (change("<penalty>4.0</penalty>", "<penalti>4.0</penalti>"), "did you mean penalty?"),
        (change("<auto_penalty>0", "<auto_penalty>1"), "expected 0, and the penalty in MPa/mm"),
        (change(">PENALTY<", ">AUGLAG<"), "expected PENALTY"),
        (change("<two_pass>0", "<tension>1</tension><two_pass>0"), "holds surfaces together"),
        (pairless, "is no SurfacePair"),
        (two, "tf and second press by different laws; expected one law between femur and tibia"),
        (change("<primary>femur_surface", "<primary>femr_surface"), "no surface of the mesh"),
        (change("mat=\"femur\"", "mat=\"femr\""), "is no material"),
        (change("<rb>femur</rb>", "<rb>fibula</rb>"), "is no rigid body; the file has femur, tibia"),
        (change("node_set=\"ACLam1_femur\"", "node_set=\"lost\""), "is no node set"),
        (change("discrete_set=\"ACLam1\"", "discrete_set=\"lost\""), "is no DiscreteSet"),
        (change("dmat=\"1\"", "dmat=\"77\""), "there is no discrete_material 77"),
        (change("<delem>", "<delem>999999,"), "is no node of the mesh"),
        (change("<node id=\"2\">", "<node id=\"1\">"), "given twice"),
        (change("<node id=\"2\">", "<node id=\"2\">1,"), "has 4 numbers, expected 3"),
        (change("<measure>elongation", "<measure>length"), "expected elongation, strain or stretch"),
        (change("<interpolate>LINEAR", "<interpolate>STEP"), "expected interpolate LINEAR"),
        (change("<pt>", "<pt>1e9,1</pt><pt>"), "ascend"),
        (change("<force type=\"point\">", "<force type=\"math\">"), "expected a curve of points"),
        (
            change("<Mesh>", "<Mesh from=\"other.feb\">"),
            "<Mesh>: stands in another file (from=\"other.feb\"): import other.feb",
        ),
        (change("type=\"quad4\" name=\"femur_part\"", "type=\"blob\" name=\"femur_part\""), "its type is \"blob\""),
        (
            whole
                .replace("femur_anatomical", "femur_points")
                .replace("\"ACL", "\"one")
                .replace("\"MCL", "\"two")
                .replace("\"LCL", "\"three"),
            "axes cannot be told",
        ),
    ];
    for (text, wanted) in cases {
        let e = read(&text).expect_err(wanted);
        assert!(e.to_string().contains(wanted), "{wanted}: {e}");
        assert!(e.to_string().starts_with("ball.feb:"), "{e}");
    }
}

#[test]
fn bodies_and_side_are_asked_for_where_nothing_tells_them() {
    let plain = knee().text().replace("femur_surface", "upper").replace("tibia_surface", "lower");
    let plain = plain.replace("name=\"femur\"", "name=\"A\"").replace("name=\"tibia\"", "name=\"B\"");
    let plain = plain
        .replace("<rb>femur<", "<rb>A<")
        .replace("<rb>tibia<", "<rb>B<")
        .replace("mat=\"femur\"", "mat=\"A\"")
        .replace("mat=\"tibia\"", "mat=\"B\"");
    let e = read(&plain).unwrap_err();
    assert!(e.to_string().contains("--femur BODY --tibia BODY"), "{e}");
    let given = |femur: &str, side| Given { femur: Some(femur.into()), tibia: Some("B".into()), side };
    let named = read_as(&plain, &given("A", None)).unwrap();
    assert_eq!(named.spec.fibres, read(&knee().text()).unwrap().spec.fibres);
    let e = read_as(&plain, &given("A", Some(Side::Left))).unwrap_err();
    assert!(e.to_string().contains("--side says the other side"), "{e}");
    assert!(read_as(&plain, &given("C", None)).unwrap_err().to_string().contains("the file has no rigid body C"));
}

#[test]
fn a_damaged_file_is_refused_and_never_a_panic() {
    let text = knee().text();
    // the head and all but the nodes and elements, closely; those roughly
    let cuts = (0..text.len()).step_by(text.len() / 150);
    for cut in cuts.chain((0..600).step_by(41)).filter(|&n| text.is_char_boundary(n)) {
        assert!(read(&text[..cut]).is_err(), "cut at {cut}");
    }
    let tail = text.find("<MeshDomains>").unwrap();
    for (n, at) in (0..600).step_by(83).chain((tail..text.len()).step_by(211)).enumerate() {
        let mut bytes = text.clone().into_bytes();
        bytes[at] = [b'<', b'9', b'-', b'"', 0xff][n % 5];
        let _ = import("x.feb", &bytes, &Given::default());
    }
    let deep = format!("<febio_spec version=\"4.0\">{}", "<a>".repeat(200_000));
    assert!(read(&deep).unwrap_err().to_string().contains("nest more than"));
    let wide = text.replacen("<delem>", "<delem>1:18446744073709551615:1,", 1);
    assert!(read(&wide).is_err());
    let e = import("x.feb", &[0xff, 0xfe, 0x00], &Given::default()).unwrap_err();
    assert!(e.to_string().contains("no text"), "{e}");
}
