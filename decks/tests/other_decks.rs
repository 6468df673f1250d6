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
        ("*CONNECTOR MOTION, OP=NEW", "TYPE=VELOCITY", true),
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
