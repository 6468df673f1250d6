//! specimen.toml as a file, the names of files in its folder, its tables of points; and an ankle that lies beside its tibia.

use super::super::{BUILT, built, change, checked, given, holds, knee};
use crate::common::{json, read, text, write};
use std::fmt::Write as _;

#[test]
fn a_specimen_file_in_utf_16_is_read_and_one_in_latin_1_is_named() {
    let folder = knee(&BUILT);
    let place = folder.path().join("specimen.toml");
    change(folder.path(), "provenance = \"synthetic\"", "provenance = \"synthetic\"\nsex = \"m\u{e4}nnlich\"");
    let whole = text(&place);
    let wide: Vec<u8> = [0xff, 0xfe].into_iter().chain(whole.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    write(&place, wide);
    let (code, words) = built(folder.path(), "ingest");
    assert_eq!(code, 0, "{words}");
    let narrow: Vec<u8> = whole.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    write(&place, narrow);
    for (code, words) in [checked(folder.path()), built(folder.path(), "ingest")] {
        assert_eq!(code, 1, "{words}");
        holds(&words, &["specimen.toml, line", "Latin-1", "sex = \"m\u{e4}nnlich\"", "save it as UTF-8"]);
    }
}

#[test]
fn a_file_whose_name_has_letters_of_another_case_is_named() {
    let folder = knee(&BUILT);
    let place = |name: &str| folder.path().join(name);
    if place("CT").exists() {
        return; // this disk takes both names for one
    }
    std::fs::rename(place("ct/femur.stl"), place("ct/Femur.STL")).unwrap();
    for (code, words) in [checked(folder.path()), built(folder.path(), "ingest")] {
        assert_eq!(code, 1, "{words}");
        holds(&words, &["ct.femur names ct/femur.stl, which is not there, and ct/Femur.STL is"]);
    }
    std::fs::rename(place("ct/Femur.STL"), place("ct/femur.stl")).unwrap();
    // a table that is read without being named
    std::fs::rename(place("marks.csv"), place("Marks.csv")).unwrap();
    change(folder.path(), "marks = \"marks.csv\"\n", "");
    let (code, words) = checked(folder.path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["Marks.csv: nothing reads it", "marks.csv"]);
}

#[test]
fn separators_at_the_end_of_rows_of_points_are_left_out_and_cells_there_are_named() {
    let folder = given(|e| e);
    let place = folder.path().join("attachments.csv");
    let table = text(&place);
    let ended = |end: &dyn Fn(usize) -> &'static str| {
        table.lines().enumerate().map(|(k, l)| format!("{l}{}\n", end(k))).collect::<String>()
    };
    for end in [(|k| if k > 0 { "," } else { "" }) as fn(usize) -> &'static str, |_| ",,"] {
        write(&place, ended(&end));
        let (code, words) = checked(folder.path());
        assert_eq!(code, 0, "{words}");
        holds(&words, &["points.attachments", &format!("{} fibres", table.lines().count() - 1)]);
    }
    write(&place, ended(&|k| if k == 3 { ",new" } else { "," }));
    let (code, words) = checked(folder.path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["attachments.csv, line 4", "`new` stands beyond the last column"]);
}

#[test]
fn fibres_of_two_bundles_between_the_same_points_are_told() {
    let folder = given(|e| e);
    assert!(!checked(folder.path()).1.contains("the same two points"));
    let place = folder.path().join("attachments.csv");
    let table = text(&place);
    let of = |name: &str| table.lines().find(|l| l.starts_with(name)).unwrap().to_owned();
    let (am, pl) = (of("ACL_AM,1,"), of("ACL_PL,1,"));
    write(&place, table.replace(&pl, &am.replace("ACL_AM", "ACL_PL")));
    let (code, words) = checked(folder.path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["1 fibres stand at the same two points", "were rows copied"]);
}

/// The specimen with its ankle so far lateral and superior of the tibia's origin [mm], along the axes of the tibia.
fn with_ankle([lateral, superior]: [f64; 2]) -> (i32, String) {
    let frames = json(&BUILT.path().join("build/05-frames/frames.json"));
    let of = |key: &str| -> [f64; 3] { std::array::from_fn(|k| frames["tibia"][key][k].as_f64().unwrap()) };
    let (origin, medial, up) = (of("origin"), of("medial"), of("superior"));
    let folder = knee(&BUILT);
    let place = folder.path().join("landmarks.csv");
    let mut table = String::from_utf8(read(&place)).unwrap();
    let p: [f64; 3] = std::array::from_fn(|k| origin[k] - lateral * medial[k] + superior * up[k]);
    let _ = writeln!(table, "ankle_center,ct,{},{},{}", p[0], p[1], p[2]);
    write(&place, table);
    let (code, words) = built(folder.path(), "ingest");
    let looked = checked(folder.path()).1;
    assert_eq!(words.contains("ankle_center"), looked.contains("ankle_center"), "{words}\n{looked}");
    (code, words)
}

#[test]
fn an_ankle_beside_the_tibia_or_at_its_wrong_end_is_told() {
    let (code, words) = with_ankle([0.0, -370.0]);
    assert!(code == 0 && !words.contains("ankle_center"), "{words}");
    for (lateral, word) in [(100.0, "lateral"), (-100.0, "medial")] {
        let (code, words) = with_ankle([lateral, -370.0]);
        assert_eq!(code, 0, "{words}");
        holds(&words, &["warning", "ankle_center lies", &format!("mm {word} of the tibia's long axis"), "deg"]);
    }
    let (_, words) = with_ankle([0.0, 370.0]);
    holds(&words, &["ankle_center lies", "at the femur's end of the knee"]);
}
