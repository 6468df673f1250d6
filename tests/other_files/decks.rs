//! Decks and models of other programs: definitions given twice, further columns, angles in degrees, fibres that are there twice.

use super::{holds, said};
use crate::common::{build_model, text, write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;

/// A knee of two balls as a deck.
const KNEE: &str = include_str!("../corpus/knee.inp");

/// The corpus' model as OpenSim and FEBio have it.
static EXPORTED: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = TempDir::new().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/knee");
    for (format, more) in [("opensim", &["--contact", "jam"][..]), ("febio", &[])] {
        let out = folder.path().join(format);
        build_model()
            .arg("export")
            .arg(&model)
            .args(["--format", format])
            .args(more)
            .arg("--out")
            .arg(out)
            .assert()
            .success();
    }
    folder
});

/// What an import of a file says.
fn imported(verb: &str, file: &Path) -> (i32, String) {
    let out = TempDir::new().unwrap();
    said(build_model().arg(verb).arg(file).arg("--out").arg(out.path().join("m")))
}

/// What the import of a deck says.
fn deck(text: &str) -> (i32, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("k.inp");
    write(&file, text);
    imported("import-abaqus", &file)
}

/// The deck with a part of it replaced.
fn changed(from: &str, to: &str) -> (i32, String) {
    assert!(KNEE.contains(from), "{from} is not in the corpus' deck");
    deck(&KNEE.replacen(from, to, 1))
}

/// A model of another program, changed, beside its meshes.
fn other(format: &str, name: &str, change: impl Fn(&str) -> String) -> (i32, String) {
    let folder = EXPORTED.path().join(format);
    let file: PathBuf = folder.join(format!("changed_{name}"));
    let ending = if format == "opensim" { "osim" } else { "feb" };
    write(&file, change(&text(&folder.join(format!("model.{ending}")))));
    imported(&format!("import-{format}"), &file)
}

#[test]
fn what_a_deck_says_twice_and_otherwise_is_told() {
    let plain = deck(KNEE);
    assert!(plain.0 == 0 && !plain.1.contains("second"), "{}", plain.1);
    let behaviour = "*CONNECTOR BEHAVIOR, NAME=LCL_BEHAVIOR\n";
    let table = "*CONNECTOR ELASTICITY, COMPONENT=1, NONLINEAR\n0., -1.\n0., 0.\n1., 1.\n50., 6.\n";
    let law = "*SURFACE INTERACTION, NAME=RIGID_INTERACT\n";
    let stiff = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n30., 0.1\n60., 0.2\n";
    for (from, to, word) in [
        (behaviour, format!("{behaviour}{table}{behaviour}"), "tables of a connector behavior"),
        (law, format!("{law}{stiff}{law}"), "tables of a surface interaction"),
        (
            "*MASS, ELSET=FEMUR_MASS\n",
            "*MASS, ELSET=FEMUR_MASS\n5e-3,\n*MASS, ELSET=FEMUR_MASS\n".into(),
            "second *MASS",
        ),
    ] {
        let (code, words) = changed(from, &to);
        assert_eq!(code, 0, "{words}");
        holds(&words, &["warning", word, "the last one is taken"]);
    }
}

#[test]
fn columns_and_types_of_a_deck_that_are_not_read_are_told() {
    for (from, to, word) in [
        ("<LCL_F1>, <LCL_U1>", "<LCL_F1>, <LCL_U1>, 20.", "depend on temperature"),
        ("*FRICTION\n0.03,", "*FRICTION\n0.03, 0., 0.\n0.3, 0., 5.", "*FRICTION depend on"),
        (
            "BEHAVIOR=LCL_BEHAVIOR\nAXIAL,",
            "BEHAVIOR=LCL_BEHAVIOR\nAXIAL, ROTATION",
            "second type of connection, ROTATION",
        ),
        ("REF NODE=1000284\n", "REF NODE=1000284\n2.0,\n", "have a thickness"),
        ("TYPE=ELEMENT, NAME=SURF-ART-FEMUR", "TYPE=NODE, NAME=SURF-ART-FEMUR", "TYPE=NODE is passed over"),
        ("2003, 2003, 2004\n", "2003, 2003, 2004\n2009, 2001, 2002\n", "1 fibres stand at the same two points"),
    ] {
        let (code, words) = changed(from, to);
        assert_eq!(code, 0, "{words}");
        holds(&words, &["warning", word]);
    }
}

#[test]
fn numbers_of_a_deck_that_are_written_otherwise_are_refused_at_their_line() {
    for (from, to, word) in [
        ("2001, -30.0, 0.3333333333333333, 19.0", "2001, -30,0, 0,33, 19,0", "decimal commas"),
        ("2001, -30.0,", "2001, -3.0+1,", "lacks the letter"),
        ("AXIS_TF_ML, 4, 0.6235987755982988", "AXIS_TF_ML, 4, 35.7", "in degrees"),
    ] {
        let (code, words) = changed(from, to);
        assert_eq!(code, 1, "{words}");
        holds(&words, &["k.inp:", word]);
    }
    // a normal of length 1 may stand behind the coordinates
    let (code, words) =
        changed("2001, -30.0, 0.3333333333333333, 19.0", "2001, -30.0, 0.3333333333333333, 19.0, 0., 0.6, 0.8");
    assert_eq!(code, 0, "{words}");
    // of another length, and a surface of nodes that no contact uses
    for (from, to) in [
        ("2001, -30.0, 0.3333333333333333, 19.0", "2001, -30.0, 0.3333333333333333, 19.0, 0., 3.0, 4.0"),
        ("*SURFACE INTERACTION, NAME", "*SURFACE, TYPE=NODE, NAME=SPARE\n2001,\n2003,\n*SURFACE INTERACTION, NAME"),
    ] {
        let (code, words) = changed(from, to);
        assert!(code == 0 && !words.contains("TYPE=NODE") && !words.contains("several element sets"), "{words}");
    }
    // a speed in rad/s is no angle, and a motion by its rate is another one
    let motion = "AMPLITUDE=FLEX_RAMP\nAXIS_TF_ML, 4, 0.6235987755982988";
    for kind in ["VELOCITY", "ACCELERATION"] {
        let rate = format!("AMPLITUDE=FLEX_RAMP, TYPE={kind}\nAXIS_TF_ML, 4, 4.0");
        let (code, words) = changed(motion, &rate);
        assert_eq!(code, 1, "{words}");
        holds(&words, &["k.inp:", "CONNECTOR MOTION", &format!("TYPE={kind} is not read"), "TYPE=DISPLACEMENT"]);
        assert!(!words.contains("in degrees"), "{words}");
    }
    let (code, words) = deck(&KNEE[..9000]);
    assert_eq!(code, 1, "{words}");
    holds(&words, &["cut short"]);
}

#[test]
fn ligaments_of_other_programs_that_are_there_twice_or_in_another_unit_are_told() {
    let part = |text: &str, from: &str, to: &str| {
        let start = text.find(from).unwrap();
        text[start..start + text[start..].find(to).unwrap() + to.len()].to_owned()
    };
    for (format, name) in [("opensim", "plain.osim"), ("febio", "plain.feb")] {
        let (code, words) = other(format, name, str::to_owned);
        assert_eq!(code, 0, "{words}");
        assert!(!words.contains("same two points") && !words.contains("slack length"), "{words}");
    }
    let (code, words) = other("opensim", "twice.osim", |text| {
        let one = part(text, "<Blankevoort1991Ligament name=\"LCL_1\">", "</Blankevoort1991Ligament>");
        text.replacen(&one, &format!("{one}{}", one.replacen("LCL_1", "LCL_9", 1)), 1)
    });
    assert_eq!(code, 0, "{words}");
    holds(&words, &["1 fibres stand at the same two points", "LCL"]);
    let (code, words) = other("febio", "twice.feb", |text| {
        let one = part(text, "<delem>", "</delem>");
        text.replacen(&one, &format!("{one}{one}"), 1)
    });
    assert_eq!(code, 0, "{words}");
    holds(&words, &["1 fibres stand at the same two points"]);
    // N/mm where the force at a strain of 1 is asked for, and a slack length that is a fifth short
    let (code, words) = other("opensim", "units.osim", |text| {
        let mut parts = text.split("<linear_stiffness>");
        let mut out = parts.next().unwrap().to_owned();
        for part in parts {
            let (number, rest) = part.split_once('<').unwrap();
            out += &format!("<linear_stiffness>{}<{rest}", number.parse::<f64>().unwrap() / 40.0);
        }
        out
    });
    assert_eq!(code, 0, "{words}");
    holds(&words, &["N/mm in the median", "force at a strain of 1"]);
    let (code, words) = other("opensim", "slack.osim", |text| {
        let one = part(text, "<Blankevoort1991Ligament name=\"LCL_1\">", "</slack_length>");
        let (before, _) = one.rsplit_once("<slack_length>").unwrap();
        text.replacen(&one, &format!("{before}<slack_length>0.045</slack_length>"), 1)
    });
    assert_eq!(code, 0, "{words}");
    holds(&words, &["1.35 times or more", "LCL"]);
}

#[test]
fn angles_in_degrees_and_contact_of_nothing_in_other_programs_are_told() {
    let (code, words) = other("opensim", "degrees.osim", |text| {
        let flexion = "<Coordinate name=\"flexion\">";
        text.replacen(flexion, &format!("{flexion}<default_value>30</default_value>"), 1)
    });
    assert_eq!(code, 1, "{words}");
    holds(&words, &["in degrees"]);
    let (code, words) = other("febio", "soft.feb", |text| {
        let start = text.find("<penalty>").unwrap();
        let end = start + text[start..].find("</penalty>").unwrap();
        text.replace(&text[start..end], "<penalty>0.001")
    });
    assert_eq!(code, 0, "{words}");
    holds(&words, &["contact: its law has", "MPa for each mm"]);
}
