//! Laxity of a knee in which ligaments were cut: the column `without`.
#![allow(clippy::unwrap_used, reason = "tests")]

use meshes::frame::Side;
use sim::coordinate::Load;
use sim::laxity::{LaxityFormat, LaxityTrial, between, read, read_as, trials_csv};

const HEADER: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm";

/// Two trials, each with what stands in its column.
fn file(states: [&str; 2]) -> String {
    let rows = ["a,anterior,30,0,0,0,90,20,30,0,0,0,12,0", "b,posterior,30,0,0,0,-90,20,30,0,0,0,-6,0"];
    let rows = rows.iter().zip(states).map(|(row, state)| format!("{row},{state}\n")).collect::<String>();
    format!("{HEADER},without\n{rows}")
}

#[test]
fn what_was_cut_is_read_in_any_order_written_and_left_out_where_nothing_was() {
    let trials = read(file(["ALS + ACL", "ACL+ALS"]).as_bytes()).unwrap().trials;
    assert!(trials.iter().all(|t| t.without == ["ACL", "ALS"]));
    assert_eq!(read(trials_csv(&trials).as_bytes()).unwrap().trials, trials);
    let whole = read(file(["", ""]).as_bytes()).unwrap().trials;
    assert!(whole.iter().all(|t| t.without.is_empty()) && !trials_csv(&whole).contains("without"));
    // the pose from which a displacement counts is of the same knee
    let mut displaced = trials[0].clone();
    displaced.reference =
        Some(sim::laxity::Reference { trial: "n".into(), load: Load::compression(20.0), fe_deg: 30.0 });
    assert_eq!(displaced.unloaded().unwrap().without, displaced.without);
}

#[test]
fn a_file_is_of_one_state_of_the_knee_which_specimen_toml_may_say_too() {
    let told = read(file(["ACL", ""]).as_bytes()).unwrap_err().to_string();
    assert!(told.contains("row 3 (b), column \"without\": empty where row 2 has ACL"), "{told}");
    let without = |text: &str, declared: &str| -> Vec<String> {
        let format: LaxityFormat = toml::from_str(declared).unwrap();
        read_as(text.as_bytes(), &format, Side::Right).unwrap().trials[0].without.clone()
    };
    let plain = file(["", ""]).replace(",without", "").replace(",\n", "\n");
    assert_eq!(without(&plain, "without = [\"PCL\"]"), ["PCL"]);
    // a column says the same as what is declared
    assert_eq!(without(&file(["PCL+ACL", "ACL+PCL"]), "without = [\"ACL+PCL\"]"), ["ACL", "PCL"]);
    for (cell, declared, words) in [
        ("ACL", "PCL", "\"ACL\", but specimen.toml declares without = PCL"),
        ("", "PCL", "empty, as of a whole knee, but specimen.toml declares without = PCL"),
        ("ACL", "none", "\"ACL\", but specimen.toml declares without = none"),
    ] {
        let format: LaxityFormat = toml::from_str(&format!("without = [\"{declared}\"]")).unwrap();
        let told = read_as(file([cell, cell]).as_bytes(), &format, Side::Right).unwrap_err().to_string();
        assert!(told.contains(&format!("row 2, column \"without\": {words}")), "{told}");
    }
    let told = read(file(["ACL+none", "ACL+none"]).as_bytes()).unwrap_err().to_string();
    assert!(told.contains("a knee is whole or it is cut"), "{told}");
}

#[test]
fn a_whole_knee_has_other_words_and_names_have_one_sign_between_them() {
    for word in ["intact", "none", "Whole", "no"] {
        let trials = read(file([word, ""]).as_bytes()).unwrap().trials;
        assert!(trials.iter().all(|t| t.without.is_empty()), "{word}");
    }
    for joined in ["ACL/ALS", "ACL;ALS", "ACL and ALS", "ACL & ALS", "\"ACL,ALS\""] {
        let told = read(file([joined, joined]).as_bytes()).unwrap_err().to_string();
        assert!(told.contains("row 2, column \"without\"") && told.contains("as ACL+ALS"), "{joined}: {told}");
    }
    for name in ["cut", "State", "knee_condition", "acl_deficient"] {
        let text = file(["ACL", "ACL"]).replace(",without", &format!(",{name}"));
        let told = read(text.as_bytes()).unwrap_err().to_string();
        assert!(told.contains(&format!("unknown column \"{name}\"")) && told.contains("call it without"), "{told}");
    }
}

#[test]
fn a_whole_and_a_cut_knee_do_not_contradict_each_other() {
    let rows = (0..5).map(|k| format!("t{k},anterior,{f},0,0,0,90,20,{f},0,0,0,3,0\n", f = 15 * k)).collect::<String>();
    let whole = read(format!("{HEADER}\n{rows}").as_bytes()).unwrap().trials;
    let farther = |state: &[&str]| -> Vec<LaxityTrial> {
        let one = |t: &LaxityTrial| LaxityTrial {
            without: state.iter().map(|s| (*s).to_owned()).collect(),
            measured: t.measured.map(|m| m.map(|x| x + 15.0)),
            ..t.clone()
        };
        whole.iter().map(one).collect()
    };
    assert!(!between(&[("kla", &whole), ("rks", &farther(&[]))]).is_empty());
    assert!(between(&[("kla", &whole), ("cut", &farther(&["ACL"]))]).is_empty());
}
