//! Decks as other people write them: parts and instances, systems, springs, encodings, and every keyword of the manual.
#![allow(clippy::unwrap_used, reason = "tests")]

use decks::known::{Class, keywords};
use decks::{DeckError, ImportedDeck, import};
use meshes::Vector;
use sim::mesh::MeshValue;

/// A right knee of 3 fibres in one file.
const KNEE: &str = include_str!("../../tests/corpus/knee.inp");

fn read(bytes: &[u8]) -> Result<ImportedDeck, DeckError> {
    import("k.inp", &mut |name: &str| if name == "k.inp" { Ok(bytes.to_vec()) } else { Err("no such file".into()) })
}

/// Where the femur's surface ends, low and high.
fn femur(deck: &ImportedDeck) -> (Vector, Vector) {
    let Some(MeshValue::Surface(mesh)) = deck.meshes.get("meshes/femur.ply") else { panic!("no femur") };
    let (low, high) = mesh.bounds().unwrap();
    (low.coords, high.coords)
}

/// The deck with the femur's nodes (labels from 1,000,001 to 1,000,042) between `before` and `after`.
fn around_femur(before: &str, after: &str) -> String {
    let start = KNEE.find("*NODE\n1000001").unwrap();
    let end = start + 6 + KNEE[start + 6..].find('*').unwrap();
    format!("{}{before}{}{after}{}", &KNEE[..start], &KNEE[start..end], &KNEE[end..])
}

/// Nodes and elements of both bones as parts with instances; `moved` is the movement of the femur's.
fn parts(moved: &str, own_numbers: bool) -> String {
    let block = |from: &str| {
        let start = KNEE.find(from).unwrap();
        let element = start + 6 + KNEE[start + 6..].find('*').unwrap();
        let end = element + 1 + KNEE[element + 1..].find('*').unwrap();
        (start, end)
    };
    let (femur, tibia) = (block("*NODE\n1000001"), block(&tibia_nodes()));
    let renumbered = |text: &str, from: u64| -> String {
        text.lines()
            .map(|line| {
                let cells = line.split(", ").map(|cell| match cell.trim().parse::<u64>() {
                    Ok(n) if own_numbers => (n - from).to_string(),
                    _ => cell.to_owned(),
                });
                cells.collect::<Vec<_>>().join(", ") + "\n"
            })
            .collect()
    };
    let first = |text: &str| text.lines().nth(1).unwrap().split(',').next().unwrap().trim().parse::<u64>().unwrap() - 1;
    let (f, t) = (&KNEE[femur.0..femur.1], &KNEE[tibia.0..tibia.1]);
    let mut rest = KNEE.to_owned();
    rest.replace_range(tibia.0..tibia.1, "");
    rest.replace_range(femur.0..femur.1, "");
    let rest = rest.replacen("*HEADING\nmade\n", "", 1);
    let rest = if own_numbers {
        // the reference nodes' labels 1 and 2 are the parts' now
        rest.replace("\n1, 0.5", "\n900001, 0.5")
            .replace("\n2, 0.5", "\n900002, 0.5")
            .replace("REF NODE=1\n", "REF NODE=900001\n")
            .replace("REF NODE=2\n", "REF NODE=900002\n")
            .replace(", 2\n", ", 900002\n")
            .replace(", 1\n", ", 900001\n")
            .replace("\n1, ENCASTRE", "\n900001, ENCASTRE")
    } else {
        rest
    };
    let (step, head) = (rest.find("*STEP").unwrap(), "*HEADING\nmade\n");
    format!(
        "{head}*PART, NAME=FEMUR\n{}*END PART\n*PART, NAME=TIBIA\n{}*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=FEMUR-1, PART=FEMUR\n{moved}*END INSTANCE\n*INSTANCE, NAME=TIBIA-1, PART=TIBIA\n*END INSTANCE\n{}*END ASSEMBLY\n{}",
        renumbered(f, first(f)),
        renumbered(t, first(t)),
        &rest[..step],
        &rest[step..]
    )
}

/// How the tibia's nodes begin.
fn tibia_nodes() -> String {
    let at = KNEE.find("ELSET=BONE-TIB").unwrap();
    let start = KNEE[..at].rfind("*NODE").unwrap();
    KNEE[start..start + 20].to_owned()
}

#[test]
fn a_system_moves_the_nodes_after_it() {
    let (low, high) = femur(&read(KNEE.as_bytes()).unwrap());
    let moved = read(around_femur("*SYSTEM\n100.,0.,0.,101.,0.,0.\n", "*SYSTEM\n").as_bytes()).unwrap();
    let (l, h) = femur(&moved);
    assert!((l - low - Vector::x() * 100.0).norm() < 1e-9 && (h - high - Vector::x() * 100.0).norm() < 1e-9);
    // a quarter turn about z: x goes to y
    let turned = read(around_femur("*SYSTEM\n0,0,0,0,1,0\n-1,0,0\n", "*SYSTEM\n").as_bytes()).unwrap();
    let (l, h) = femur(&turned);
    assert!((l.x + high.y).abs() < 1e-9 && (h.y - high.x).abs() < 1e-9, "{l} {h}");
    let open = read(around_femur("*SYSTEM\n0,0,0,1,0,1\n", "*SYSTEM\n").as_bytes()).unwrap_err();
    assert!(open.message.contains("third") && open.line > 0, "{open}");
}

#[test]
fn cylindrical_nodes_are_turned_and_spherical_ones_refused() {
    let swapped = KNEE.replacen("*NODE\n1000001", "*NODE, SYSTEM=C\n1000001", 1);
    let (low, high) = femur(&read(swapped.as_bytes()).unwrap());
    assert!(high.x <= 15.0 + 1e-9 && low.x >= -15.0 - 1e-9);
    let refused = read(KNEE.replacen("*NODE\n1000001", "*NODE, SYSTEM=S\n1000001", 1).as_bytes()).unwrap_err();
    assert!(refused.message.contains("SYSTEM=S") && refused.line > 1, "{refused}");
}

#[test]
fn parts_with_numbers_of_their_own_and_moved_instances_are_read() {
    let plain = read(KNEE.as_bytes()).unwrap();
    let (low, high) = femur(&plain);
    for own in [false, true] {
        let same = read(parts("", own).as_bytes()).unwrap();
        assert_eq!((same.spec.bundles, same.spec.fibres), (plain.spec.bundles.clone(), plain.spec.fibres.clone()));
        assert_eq!(same.meshes["meshes/femur.ply"], plain.meshes["meshes/femur.ply"]);
    }
    let (l, h) = femur(&read(parts("0., 0., 5.\n", false).as_bytes()).unwrap());
    assert!((l.z - low.z - 5.0).abs() < 1e-9 && (h.z - high.z - 5.0).abs() < 1e-9);
    let (l, h) = femur(&read(parts("0,0,0\n0,0,0,0,0,1,90\n", true).as_bytes()).unwrap());
    assert!((h.y - high.x).abs() < 1e-9 && (l.y - low.x).abs() < 1e-9);
    let lost = read(parts("", false).replace("*INSTANCE, NAME=FEMUR-1, PART=FEMUR\n*END INSTANCE\n", "").as_bytes());
    assert!(lost.unwrap_err().message.contains("no *INSTANCE"));
}

#[test]
fn names_of_instances_and_sets_before_their_time_are_found() {
    let text = parts("", true).replace("ELSET=BONE-FEMUR, REF NODE", "ELSET=FEMUR-1.BONE-FEMUR, REF NODE");
    assert_eq!(read(text.as_bytes()).unwrap().spec.bundles.len(), 2);
    let late = KNEE.replacen("*HEADING", "*ELSET, ELSET=BOTH\nLCL_1D, sMCL_A_1D\n*HEADING", 1);
    assert!(read(late.as_bytes()).is_ok());
    let nowhere = read(KNEE.replacen("*HEADING", "*ELSET, ELSET=X\nNOWHERE\n*HEADING", 1).as_bytes()).unwrap_err();
    assert!(
        nowhere.line == 2 && nowhere.message.contains("nowhere") || nowhere.message.contains("NOWHERE"),
        "{nowhere}"
    );
}

#[test]
fn encodings_of_windows_are_read() {
    let plain = read(KNEE.as_bytes()).unwrap();
    let wide: Vec<u8> = [0xff, 0xfe].into_iter().chain(KNEE.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    for bytes in [[b"\xef\xbb\xbf", KNEE.as_bytes()].concat(), wide] {
        assert_eq!(read(&bytes).unwrap().spec.bundles, plain.spec.bundles);
    }
}

#[test]
fn a_deck_in_another_unit_is_refused_with_the_factor() {
    let metres = KNEE
        .lines()
        .scan(false, |nodes, line| {
            if line.starts_with('*') && !line.starts_with("**") {
                *nodes = line == "*NODE" || line.starts_with("*NODE,");
            }
            let cells: Vec<&str> = line.split(", ").collect();
            let numbers: Vec<f64> = cells.iter().skip(1).filter_map(|c| c.parse().ok()).collect();
            Some(match (&numbers[..], *nodes) {
                ([x, y, z], true) => format!("{}, {}, {}, {}\n", cells[0], x / 1000.0, y / 1000.0, z / 1000.0),
                _ => format!("{line}\n"),
            })
        })
        .collect::<String>();
    let told = read(metres.as_bytes()).unwrap_err().to_string();
    assert!(told.contains("metres") && told.contains("1000"), "{told}");
    // the file, a line of it that holds an element, and what the number is in
    let (place, words) = told.split_once(": ").unwrap();
    let (file, line) = place.rsplit_once(':').unwrap();
    let cells = metres.lines().nth(line.parse::<usize>().unwrap() - 1).unwrap().split(',').count();
    assert!(file.ends_with(".inp") && cells >= 4, "{told}");
    assert!(words.contains(" mm wide as its numbers stand, where a knee is 60 to 110 mm wide"), "{told}");
}

/// The deck with a ligament of springs, and what *SPRING says of it.
fn springs(kind: &str, spring: &str) -> String {
    let fibre = "*NODE\n2011, 3., 0.3, 19.\n2012, 3., 0.7, -21.\n";
    let element =
        format!("*ELEMENT, TYPE={kind}, ELSET=ACL_AM\n2011, 2011, 2012\n*MPC\nBEAM, 2011, 2\nBEAM, 2012, 1\n");
    KNEE.replacen("*ELSET, ELSET=FIBRES", &format!("{fibre}{element}{spring}*ELSET, ELSET=FIBRES"), 1)
}

#[test]
fn springs_between_the_bones_are_a_ligament_and_nothing_like_it_is_lost() {
    let table = "*SPRING, ELSET=ACL_AM, NONLINEAR\n\n0., -10.\n0., 0.\n30., 1.\n120., 2.\n";
    let deck = read(springs("SPRINGA", table).as_bytes()).unwrap();
    assert_eq!((deck.spec.bundles.len(), deck.spec.fibres.len()), (3, 4));
    let acl = deck.spec.bundles.iter().find(|b| b.name == "ACL_AM").unwrap();
    assert!((acl.stiffness_n_per_mm - 90.0).abs() < 1e-9);
    for (kind, spring) in [
        ("SPRINGA", "*SPRING, ELSET=ACL_AM\n\n50.,\n"),
        ("SPRINGA", ""),
        ("T3D2", ""),
        ("CONN3D2", "*CONNECTOR SECTION, ELSET=ACL_AM\nSLIPRING\n"),
    ] {
        let told = read(springs(kind, spring).as_bytes()).unwrap_err();
        assert!(told.to_string().to_lowercase().contains("acl_am") && told.line > 1, "{told}");
    }
    // of the medial side too, without which no side is known
    let medial = KNEE.replacen("TYPE=CONN3D2, ELSET=sMCL_A_1D", "TYPE=SPRINGA, ELSET=sMCL_A_1D", 1);
    let told = read(medial.as_bytes());
    assert!(told.is_ok() || told.unwrap_err().to_string().to_lowercase().contains("mcl"));
}

/// A table that ends before its line is well begun made a model that no program opened.
#[test]
fn a_force_table_may_end_anywhere_behind_its_toe() {
    for toes in [2.5, 3.0, 4.0, 4.0005, 4.5, 10.0] {
        // a toe of 1 mm, then a line of 60 N/mm from 2 mm on
        let most = 60.0 * (toes - 1.0);
        let table = format!("*SPRING, ELSET=ACL_AM, NONLINEAR\n\n0., -10.\n0., 0.\n60., 2.\n{most:?}, {toes:?}\n");
        let deck = read(springs("SPRINGA", &table).as_bytes()).unwrap();
        let bundles = sim::ligament::compile(&deck.spec).unwrap().0;
        let acl = bundles.iter().find(|b| b.name == "ACL_AM").unwrap();
        assert!((acl.toe_mm() - 1.0).abs() < 1e-9 && (acl.response(2.2).force - 72.0).abs() < 1e-6, "{toes}");
        let told = notices::texts(&deck.warnings).join("\n");
        assert_eq!(told.contains("toes behind slack, and its force stays there"), toes < 4.001, "{toes}: {told}");
        // what is said of the model is what the model does, 20 toes behind slack
        let grows = acl.response(20.0).stiffness > 0.0;
        assert_eq!(told.contains("here it grows on, as ligaments do"), grows && toes < 4.001, "{toes}: {told}");
        assert_eq!(told.contains("here it grows on to 10 toes"), !grows && toes < 4.001, "{toes}: {told}");
    }
}

#[test]
fn springs_along_an_axis_and_connectors_of_another_type_are_refused_by_their_line() {
    let table = "*SPRING, ELSET=ACL_AM, NONLINEAR\n3, 3\n0., -10.\n0., 0.\n30., 1.\n120., 2.\n";
    for kind in ["SPRING1", "SPRING2"] {
        let told = read(springs(kind, table).as_bytes()).unwrap_err();
        assert!(told.line > 1 && told.to_string().contains("ACL_AM"), "{kind}: {told}");
    }
    for kind in ["T3D2", "SPRING2", "SPRINGA"] {
        let deck = KNEE.replacen("TYPE=CONN3D2, ELSET=LCL_1D", &format!("TYPE={kind}, ELSET=LCL_1D"), 1);
        let told = read(deck.as_bytes()).unwrap_err();
        let words = told.to_string();
        assert!(told.line > 1 && words.contains(kind) && words.contains("expected CONN3D2"), "{kind}: {words}");
    }
}

#[test]
fn a_spring_that_pushes_is_told_and_a_linear_connector_is_no_table() {
    let pushes = "*SPRING, ELSET=ACL_AM, NONLINEAR\n\n-900., -10.\n0., 0.\n30., 1.\n120., 2.\n";
    let deck = read(springs("SPRINGA", pushes).as_bytes()).unwrap();
    let told = notices::texts(&deck.warnings).join("\n");
    assert!(told.contains("ACL_AM: the deck's force table pushes with up to 900.000 N"), "{told}");
    let told = notices::texts(&read(KNEE.as_bytes()).unwrap().warnings).join("\n");
    assert!(!told.contains("pushes"), "{told}");
    let linear = KNEE.replacen("COMPONENT=1, NONLINEAR", "COMPONENT=1", 1);
    let told = read(linear.as_bytes()).unwrap_err();
    assert!(told.line > 1 && told.to_string().contains("a linear elasticity is none"), "{told}");
}

#[test]
fn amplitudes_of_values_are_obeyed_and_a_restart_is_told() {
    let with = |words: &str| {
        read(KNEE.replacen("*ELSET, ELSET=FIBRES", &format!("{words}*ELSET, ELSET=FIBRES"), 1).as_bytes())
    };
    // it holds the values themselves, whatever the magnitude
    let absolute = KNEE.replace("NAME=FLEX_RAMP,", "NAME=FLEX_RAMP, VALUE=ABSOLUTE,");
    let magnitudes = |deck: &str| {
        let deck = read(deck.as_bytes()).unwrap();
        let all = deck.spec.protocols.iter().flat_map(|d| &d.steps).flat_map(|s| s.controls.clone());
        all.filter(|c| c.amplitude.as_ref().is_some_and(|a| a.name == "FLEX_RAMP"))
            .map(|c| c.magnitude)
            .collect::<Vec<_>>()
    };
    assert!(magnitudes(KNEE).iter().any(|m| *m != 1.0));
    assert!(magnitudes(&absolute).iter().all(|m| *m == 1.0));
    let told = |words: &str| with(words).unwrap().warnings.iter().map(|w| format!("{w}\n")).collect::<String>();
    assert!(told("*RESTART, READ, STEP=1\n").contains("READ"));
    assert!(!told("*RESTART, WRITE, FREQUENCY=0\n").contains("RESTART"));
}

#[test]
fn a_node_defined_twice_is_told() {
    let deck =
        read(KNEE.replacen("*ELSET, ELSET=FIBRES", "*NODE\n1000001, 0., 0., 0.\n*ELSET, ELSET=FIBRES", 1).as_bytes());
    let told = notices::texts(&deck.unwrap().warnings).join("\n");
    assert!(told.contains("second time"), "{told}");
}

/// A deck with a keyword alone is refused by its name and line, told, or as it was without; the table has every keyword of the index.
#[test]
fn every_keyword_of_the_manual_is_obeyed_harmless_told_or_refused() {
    assert_eq!(keywords().len(), 593);
    let plain = read(KNEE.as_bytes()).unwrap();
    let mut counts = [0; 4];
    for (keyword, known) in keywords() {
        counts[known.class as usize] += 1;
        let text = KNEE.replacen("*ELSET, ELSET=FIBRES", &format!("*{keyword}\n*ELSET, ELSET=FIBRES"), 1);
        match (known.class, read(text.as_bytes())) {
            (Class::Refused, Err(e)) => assert!(e.message.contains(keyword) && e.line > 1, "{keyword}: {e}"),
            (Class::Told, Ok(deck)) => {
                let told = deck.warnings.iter().find(|w| w.contains(&format!("*{keyword} is passed over")));
                assert!(told.is_some_and(|w| w.contains("k.inp:")), "{keyword}: {:?}", deck.warnings);
            }
            (Class::Harmless, Ok(deck)) => assert_eq!(deck, plain, "{keyword}"),
            (Class::Obeyed, Ok(_)) => {}
            (Class::Obeyed, Err(e)) => assert!(e.line > 0 || e.message.len() > 10, "{keyword}: {e}"),
            (class, other) => panic!("{keyword} is {class:?}, but {:?}", other.err()),
        }
    }
    assert!(counts[0] >= 30 && counts[1] >= 60 && counts[3] >= 40, "{counts:?}");
    let slip = read(KNEE.replacen("*NODE", "*NODES", 1).as_bytes()).unwrap_err();
    assert!(slip.message.contains("did you mean NODE"), "{slip}");
    let strange =
        read(KNEE.replacen("*ELSET, ELSET=FIBRES", "*GENU SPECIAL\n*ELSET, ELSET=FIBRES", 1).as_bytes()).unwrap();
    assert!(strange.warnings.iter().any(|w| w.contains("GENU SPECIAL")));
    let flag = read(KNEE.replacen("*ELSET, ELSET=FIBRES", "*ELSET, ELSET=FIBRES, STRANGE=1", 1).as_bytes()).unwrap();
    assert!(flag.warnings.iter().any(|w| w.contains("STRANGE")), "{:?}", flag.warnings);
}

#[test]
fn values_of_parameters_that_are_not_obeyed_are_told_and_others_are_not() {
    let plain = read(KNEE.as_bytes()).unwrap();
    for (keyword, parameter, told) in [
        ("*CONTACT PAIR, CPSET=PAIR_1", "OP=DELETE", true),
        ("*CONTACT PAIR, CPSET=PAIR_1", "OP=ADD", false),
        ("*CONNECTOR MOTION, OP=NEW", "type=displacement", false),
        ("*CONNECTOR DAMPING, COMPONENT=1", "TYPE=STRUCTURAL", true),
        ("*RIGID BODY, ELSET=BONE-FEMUR", "POSITION=CENTER OF MASS", true),
        ("*RIGID BODY, ELSET=BONE-FEMUR", "POSITION=INPUT", false),
        ("*AMPLITUDE, NAME=FLEX_RAMP", "TIME=TOTAL TIME", true),
        ("*STEP, NAME=FLEX", "NLGEOM=NO", true),
        ("*STEP, NAME=FLEX", "NLGEOM", false),
        ("*STEP, NAME=FLEX", "NLGEOM=YES", false),
    ] {
        let deck = read(KNEE.replacen(keyword, &format!("{keyword}, {parameter}"), 1).as_bytes()).unwrap();
        let new: Vec<_> = deck.warnings.iter().filter(|w| !plain.warnings.contains(w)).collect();
        let named = new.iter().any(|w| w.contains(&format!("the parameter {parameter} is passed over")));
        assert_eq!(named, told, "{keyword}, {parameter}: {new:?}");
        assert!(told || new.is_empty(), "{keyword}, {parameter}: {new:?}");
    }
    let critical = KNEE.replacen("DEFINITION=DAMPING COEFFICIENT", "DEFINITION=CRITICAL DAMPING FRACTION", 1);
    let words = notices::texts(&read(critical.as_bytes()).unwrap().warnings).join("\n");
    assert!(words.contains("DEFINITION=CRITICAL DAMPING FRACTION"), "{words}");
}

#[test]
fn lines_may_end_as_any_system_ends_them() {
    let plain = read(KNEE.as_bytes()).unwrap();
    for end in ["\r\n", "\r"] {
        assert_eq!(read(KNEE.replace('\n', end).as_bytes()).unwrap(), plain, "{end:?}");
    }
}

/// The rows of the deck's contact law, as it writes them.
const LAW: &str = "0.0, 0.0\n0.3, 0.05\n1.3, 0.2\n";

/// The warnings of a changed deck that the deck as it was has not.
fn new_warnings(changed: &str) -> String {
    let plain = read(KNEE.as_bytes()).unwrap().warnings;
    let new = read(changed.as_bytes()).unwrap().warnings;
    notices::texts(&new.into_iter().filter(|w| !plain.contains(w)).collect::<Vec<_>>()).join("\n")
}

/// Pressures and overclosures, each times a factor.
fn law(pressure: f64, overclosure: f64) -> String {
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(", ").map(|c| c.parse().unwrap()).collect();
        format!("{}, {}\n", cells[0] * pressure, cells[1] * overclosure)
    };
    KNEE.replacen(LAW, &LAW.lines().map(row).collect::<String>(), 1)
}

#[test]
fn pressures_friction_and_masses_of_another_unit_are_told() {
    assert!(KNEE.contains(LAW), "the corpus has another law");
    for (pressure, overclosure) in [(1e3, 1.0), (1e6, 1.0), (1e-3, 1.0), (1.0, 1e-3), (1.0, 100.0)] {
        let told = new_warnings(&law(pressure, overclosure));
        assert!(told.contains("check the unit of its pressures"), "{pressure}, {overclosure}: {told}");
    }
    // a stiffer or softer cartilage is one
    for factor in [0.2, 5.0] {
        assert_eq!(new_warnings(&law(factor, 1.0)), "", "{factor}");
    }
    for mass in ["3.", "3000."] {
        let told = new_warnings(&KNEE.replacen("1e-5,", &format!("{mass},"), 1));
        assert!(told.contains("femur: a mass of") && told.contains("tonne, not kg"), "{told}");
    }
    assert_eq!(new_warnings(&KNEE.replacen("1e-5,", "0.005,", 1)), "");
    let told = new_warnings(&KNEE.replacen("*FRICTION\n0.03,", "*FRICTION\n3.,", 1));
    assert!(told.contains("friction of 3"), "{told}");
}

#[test]
fn a_law_that_presses_from_afar_or_less_where_it_is_deeper_is_refused() {
    for (rows, word) in [
        ("0.1, 0.0\n0.3, 0.05\n1.3, 0.2\n", "without overclosure"),
        ("0.1, -0.1\n0.3, 0.05\n1.3, 0.2\n", "0.1 mm before surfaces touch"),
        ("0.0, 0.0\n1.3, 0.05\n0.3, 0.2\n", "falls from 1.3 to 0.3"),
        ("0.3, 0.05\n", "two rows or more"),
    ] {
        let told = read(KNEE.replacen(LAW, rows, 1).as_bytes()).unwrap_err();
        assert!(told.message.contains(word) && told.line > 1, "{told}");
    }
    // the published decks begin with next to nothing
    let published = KNEE.replacen(LAW, "0.0, -0.01\n1e-7, 0.0\n0.3, 0.05\n1.3, 0.2\n", 1);
    assert_eq!(new_warnings(&published), "");
}

#[test]
fn a_friction_or_damping_below_0_is_refused_at_its_line() {
    let damping = "*CONTACT DAMPING, DEFINITION=DAMPING COEFFICIENT\n";
    for keyword in ["*FRICTION\n", damping] {
        let at = KNEE.find(keyword).unwrap() + keyword.len();
        let line = 1 + KNEE[..at].matches('\n').count();
        let with = |cell: &str| {
            let end = at + KNEE[at..].find('\n').unwrap();
            read(format!("{}{cell}{}", &KNEE[..at], &KNEE[end..]).as_bytes())
        };
        for cell in ["-0.03,", "-1e-9"] {
            let told = with(cell).unwrap_err();
            assert!(
                told.line == line && told.message.contains("negative; expected 0 or more"),
                "{keyword}{cell}: {told}"
            );
        }
        assert!(with("0.").is_ok() && with("").is_ok(), "{keyword}");
    }
}

#[test]
fn each_contact_pair_has_its_law_and_all_have_one() {
    let unknown = read(KNEE.replacen("INTERACTION=RIGID_INTERACT", "INTERACTION=NONE_SUCH", 1).as_bytes()).unwrap_err();
    assert!(unknown.message.contains("none_such is not defined") && unknown.line > 1, "{unknown}");
    let second = |name: &str, factor: f64| {
        let rows = format!("0., 0.\n{}, 0.05\n{}, 0.2\n", 0.3 * factor, 1.3 * factor);
        let law = format!(
            "*SURFACE INTERACTION, NAME={name}\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n{rows}*FRICTION\n0.03,\n*CONTACT DAMPING, DEFINITION=DAMPING COEFFICIENT\n0.001,\n"
        );
        let pair = format!("*CONTACT PAIR, INTERACTION={name}\nSURF-ART-TIBIA-MED, SURF-ART-FEMUR\n");
        KNEE.replacen("*BOUNDARY, OP=NEW", &format!("{law}{pair}*BOUNDARY, OP=NEW"), 1)
    };
    let told = new_warnings(&second("STIFF", 4.0));
    assert!(told.contains("different laws") && told.contains("stiff"), "{told}");
    assert_eq!(new_warnings(&second("SAME", 1.0)), "");
}

#[test]
fn an_element_counts_once_however_often_sets_list_it() {
    let plain = read(KNEE.as_bytes()).unwrap();
    let section = "*CONNECTOR SECTION, ELSET=LCL_1D, BEHAVIOR=LCL_BEHAVIOR";
    let again = KNEE.replacen(section, &format!("*ELSET, ELSET=LCL_1D\n2001, 2003, 2001\n{section}"), 1);
    assert_eq!(read(again.as_bytes()).unwrap().spec, plain.spec);
    // two sections of one element are two forces, which Abaqus refuses
    let second =
        "*ELSET, ELSET=LIGAMENTS\nLCL_1D\n*CONNECTOR SECTION, ELSET=LIGAMENTS, BEHAVIOR=LCL_BEHAVIOR\nAXIAL,\n";
    let told = read(KNEE.replacen(section, &format!("{second}{section}"), 1).as_bytes()).unwrap_err();
    assert!(told.message.contains("ligaments") && told.message.contains("lcl_1d") && told.line > 1, "{told}");
}

/// Balls in contact, as FEBio writes them.
const BALLS: &str = include_str!("../../tests/corpus/ball.feb");

#[test]
fn a_node_far_off_is_refused_before_the_space_up_to_it_is_sampled() {
    let read = |y: &str| {
        let text =
            BALLS.replacen("<node id=\"159\">30,-30,7.5</node>", &format!("<node id=\"159\">30,{y},7.5</node>"), 1);
        decks::febio::import("ball.feb", text.as_bytes(), &Default::default())
    };
    assert!(BALLS.contains("<node id=\"159\">30,-30,7.5</node>"), "the corpus has another node");
    assert!(read("-30").is_ok());
    for far in ["-900", "3000", "-9000", "1e6"] {
        let told = read(far).unwrap_err().to_string();
        assert!(told.contains("mm across"), "{far}: {told}");
    }
}

#[test]
fn a_surface_on_the_other_side_of_its_elements_is_turned() {
    let plain = read(KNEE.as_bytes()).unwrap();
    let header = "*ELEMENT, TYPE=R3D3, ELSET=ART-FEMUR\n";
    let start = KNEE.find(header).unwrap() + header.len();
    let end = start + KNEE[start..].find('*').unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(", ").collect();
        format!("{}, {}, {}, {}\n", cells[0], cells[1], cells[3], cells[2])
    };
    let turned: String = KNEE[start..end].lines().map(row).collect();
    let inward = format!("{}{turned}{}", &KNEE[..start], &KNEE[end..]);
    assert_ne!(read(inward.as_bytes()).unwrap().meshes, plain.meshes);
    let other_side = inward.replacen("ART-FEMUR, SPOS", "ART-FEMUR, SNEG", 1);
    assert_eq!(read(other_side.as_bytes()).unwrap().meshes, plain.meshes);
}

#[test]
fn axes_of_a_frame_in_another_order_are_told() {
    let axes = "1002, 100.5, 0.25, 20.0\n1003, 0.5, -99.75, 20.0";
    assert!(KNEE.contains(axes), "the corpus has another frame");
    let told = new_warnings(&KNEE.replacen(axes, "1003, 100.5, 0.25, 20.0\n1002, 0.5, -99.75, 20.0", 1));
    assert!(told.contains("femur: the medial axis of its frame lies 90 deg"), "{told}");
}
