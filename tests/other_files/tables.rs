//! Tables: what programs put around them, workbooks, lists of points, zeros and units.

use super::{BUILT, built, change, checked, holds, knee, said};
use crate::common::{build_model, json, text, write};
use std::fmt::Write as _;
use tempfile::TempDir;

/// The specimen with one laxity file of these bytes.
pub(super) fn with_laxity(name: &str, bytes: &[u8]) -> TempDir {
    let folder = knee(&BUILT);
    std::fs::create_dir_all(folder.path().join("laxity")).unwrap();
    let toml = text(&folder.path().join("specimen.toml"));
    let toml = toml.split("[laxity]").next().unwrap().to_owned();
    write(&folder.path().join("specimen.toml"), format!("{toml}\n[laxity]\nk = \"laxity/{name}\"\n"));
    write(&folder.path().join("laxity").join(name), bytes);
    folder
}

/// Laxity of a knee: three flexions, both ways of three loads.
pub(super) fn laxity(row: impl Fn(&str, f64) -> String) -> String {
    let mut out = String::from(
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n",
    );
    for flexion in [0.0, 30.0, 90.0] {
        for test in ["anterior", "posterior", "internal", "external", "varus", "valgus"] {
            let _ = writeln!(out, "{}", row(test, flexion));
        }
    }
    out
}

pub(super) fn plain(test: &str, flexion: f64, fe: f64) -> String {
    let s = |plus: &str, minus: &str| f64::from(i8::from(test == plus)) - f64::from(i8::from(test == minus));
    let (ap, ie, vv) = (s("anterior", "posterior"), s("external", "internal"), s("valgus", "varus"));
    format!(
        "{test}{flexion},{test},{flexion},{},{},0,{},20,{fe},{},{},0.5,{},-28.5",
        10.0 * vv,
        5.0 * ie,
        100.0 * ap,
        4.0 * vv + 0.5,
        15.0 * ie - 1.0,
        5.0 * ap - 1.5
    )
}

#[test]
fn zeros_units_and_exchanged_columns_of_laxity_are_looked_at() {
    let good = laxity(|t, f| plain(t, f, f + 0.3));
    let (code, words) = checked(with_laxity("k.csv", good.as_bytes()).path());
    assert!(code == 0 && !words.contains("LOOK    laxity.k"), "{words}");
    let zeroed = laxity(|t, f| plain(t, f, f - 30.0));
    let first = good.replacen(",30.3,0.5,-1,0.5,3.5,-28.5", ",30.3,0,0,0,0,0", 1);
    let swapped = good.replace("ml_mm,ap_mm", "ap_mm,ml_mm");
    let kilo = laxity(|t, f| plain(t, f, f + 0.3).replace(",100,", ",0.1,").replace(",-100,", ",-0.1,"));
    let radians = laxity(|t, f| {
        let row = plain(t, f, f + 0.3);
        let cells: Vec<String> = row
            .split(',')
            .enumerate()
            .map(|(k, c)| if k == 10 { (c.parse::<f64>().unwrap().to_radians()).to_string() } else { c.to_owned() })
            .collect();
        cells.join(",")
    });
    for (table, word) in [
        (zeroed, "zeroed"),
        (first, "counted from that trial"),
        (swapped, "exchanged"),
        (kilo, "unit"),
        (radians, "rad"),
    ] {
        // told, or refused for what follows from it
        let (code, words) = checked(with_laxity("k.csv", table.as_bytes()).path());
        let named = [word, if code == 0 { "LOOK" } else { word }];
        holds(&words, &named);
    }
}

#[test]
fn what_programs_put_around_a_table_is_taken_off_or_named() {
    let good = laxity(|t, f| plain(t, f, f + 0.3));
    let trials = |folder: &TempDir| {
        let (code, words) =
            said(build_model().arg("check").arg(folder.path()).arg("--write-laxity").arg(folder.path().join("std")));
        assert_eq!(code, 0, "{words}");
        text(&folder.path().join("std/k.csv"))
    };
    let right = trials(&with_laxity("k.csv", good.as_bytes()));
    let wide: Vec<u8> = [0xff, 0xfe].into_iter().chain(good.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let german = good.replace(',', ";").replace('.', ",");
    let index: String = good
        .lines()
        .enumerate()
        .map(|(k, l)| if k == 0 { format!(",{l}\n") } else { format!("{},{l}\n", k - 1) })
        .collect();
    let tail = format!("{good},,,,,,,,,,,,,\n,,,,,,,,,,,,,\n");
    // each row of a trial has a separator more than the header
    let ends = |table: &str, end: &str| {
        let line = |(k, l): (usize, &str)| format!("{l}{}\n", if k == 0 { "" } else { end });
        table.lines().enumerate().map(line).collect::<String>()
    };
    let cases: [Vec<u8>; 12] = [
        wide,
        format!("sep=;\n{german}").into_bytes(),
        format!("# robot of 2019\n{good}").into_bytes(),
        format!("Knee 7, left\n\n{good}").into_bytes(),
        index.into_bytes(),
        tail.into_bytes(),
        good.replace(",-28.5", ",n/a").into_bytes(),
        ends(&good, ",").into_bytes(),
        ends(&good, ",,,").into_bytes(),
        ends(&german, ";").into_bytes(),
        // rows of other lengths; separators behind the header alone
        ends(&good, ",").replacen("-28.5,\n", "-28.5\n", 3).into_bytes(),
        good.replacen("si_mm\n", "si_mm,,\n", 1).into_bytes(),
    ];
    for (k, bytes) in cases.iter().enumerate() {
        let table = trials(&with_laxity("k.csv", bytes));
        let same = table == right
            || k == 6 && table == right.replace("-28.500000", "")
            || k == 6 && table.lines().count() == right.lines().count();
        assert!(same, "{k}:\n{table}\n{right}");
    }
    let beyond = ends(&good, ",").replacen("-28.5,\n", "-28.5,slow\n", 1);
    let (code, words) = checked(with_laxity("k.csv", beyond.as_bytes()).path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["row 2, column 15", "\"slow\" stands beyond the header"]);
    let latin: Vec<u8> = [b"\xb0 degrees\n", good.as_bytes()].concat();
    let (code, words) = checked(with_laxity("k.csv", &latin).path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["Latin-1"]);
    let (code, words) = checked(with_laxity("k.xls", &[0xd0, 0xcf, 0x11, 0xe0, 0xa1, 0xb1]).path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["Excel workbook of before 2007", ".xlsx", "CSV"]);
    let thousands = good.replace(',', "\t").replace("\t100\t", "\t1,000\t");
    let (code, words) = checked(with_laxity("k.tsv", thousands.as_bytes()).path());
    assert_eq!(code, 1, "{words}");
    holds(&words, &["1,000", "thousand", "decimal"]);
}

/// The trials of a table, wherever its rows stood.
fn trials(bytes: &[u8]) -> (Vec<sim::laxity::LaxityTrial>, Vec<String>) {
    let mut table = sim::laxity::read(bytes).unwrap();
    table.trials.iter_mut().for_each(|t| t.row = None);
    (table.trials, notices::texts(&table.warnings))
}

#[test]
fn a_workbook_gives_the_trials_of_its_sheet() {
    // by XlsxWriter: notes with a date first, then a title, a formula with its value, empty cells and rows
    let (from_book, told) = trials(include_bytes!("../corpus/laxity.xlsx"));
    assert_eq!(from_book, trials(include_bytes!("../corpus/laxity.csv")).0);
    assert!(told.iter().any(|w| w.contains("of 2 sheets, \"Robot\" is read")), "{told:?}");
    let (code, words) = checked(with_laxity("k.xlsx", include_bytes!("../corpus/laxity.xlsx")).path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["3 trials", "Robot"]);
}

#[test]
fn workbooks_that_lack_something_are_refused_by_it() {
    use crate::common::readers::{SHEET, workbook, zipped};
    let sheet = String::from_utf8(SHEET.to_vec()).unwrap();
    assert_eq!(trials(&workbook(SHEET)).0.len(), 1);
    let told = |bytes: &[u8]| sim::laxity::read(bytes).unwrap_err().to_string();
    holds(&told(&workbook(sheet.replace("<v>100</v>", "<v></v>").as_bytes())), &["G3", "formula without its value"]);
    holds(&told(&workbook(sheet.replace("r=\"N3\"", "r=\"XFD3\"").as_bytes())), &["16384", "columns"]);
    holds(&told(&zipped(&[("content.xml", b"<a/>")])), &["OpenDocument", ".ods"]);
    holds(&told(&zipped(&[("a.txt", b"a")])), &["zip archive"]);
    holds(&told(&workbook(SHEET)[..400]), &["cut short"]);
}

#[test]
fn a_sheet_of_a_thousand_cells_far_away_takes_no_memory() {
    use crate::common::readers::{SHEET, workbook};
    let far =
        String::from_utf8(SHEET.to_vec()).unwrap().replace("r=\"3\"", "r=\"1048576\"").replace("3\"", "1048576\"");
    let before = genu::store::peak_memory_mib().unwrap_or(0.0);
    assert_eq!(trials(&workbook(far.as_bytes())).0.len(), 1);
    assert!(genu::store::peak_memory_mib().unwrap_or(0.0) - before < 50.0);
}

#[test]
fn landmarks_of_meshlab_and_of_a_workbook_are_those_of_the_table() {
    let frames = |folder: &TempDir| {
        let (code, words) = built(folder.path(), "frames");
        assert_eq!(code, 0, "{words}");
        json(&folder.path().join("build/05-frames/frames.json"))
    };
    let own = knee(&BUILT);
    let table = text(&own.path().join("landmarks.csv"));
    let ct: String =
        table.lines().filter(|l| l.contains(",ct,") || l.contains("frame")).map(|l| format!("{l}\n")).collect();
    write(&own.path().join("landmarks.csv"), &ct);
    let right = frames(&own);
    let mut picked = String::from("<!DOCTYPE PickedPoints>\n<PickedPoints>\n");
    let mut rows = String::new();
    for (k, line) in ct.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        if k > 0 {
            let _ = writeln!(
                picked,
                " <point x=\"{}\" y=\"{}\" z=\"{}\" name=\"{}\" active=\"1\"/>",
                cells[2], cells[3], cells[4], cells[0]
            );
        }
        let cell = |(at, c): (usize, &&str)| match k > 0 && at >= 2 {
            true => format!("<c><v>{c}</v></c>"),
            false => format!("<c t=\"str\"><v>{c}</v></c>"),
        };
        rows += &format!("<row>{}</row>", cells.iter().enumerate().map(cell).collect::<String>());
    }
    picked += "</PickedPoints>\n";
    let book = crate::common::readers::workbook(format!("<sheetData>{rows}</sheetData>").as_bytes());
    for (name, bytes) in [("landmarks.pp", picked.into_bytes()), ("landmarks.xlsx", book)] {
        let folder = knee(&BUILT);
        std::fs::remove_file(folder.path().join("landmarks.csv")).unwrap();
        change(folder.path(), "landmarks.csv", name);
        write(&folder.path().join(name), bytes);
        assert_eq!(frames(&folder), right, "{name}");
    }
}

#[test]
fn check_tells_how_many_readings_a_raw_log_makes() {
    let header = laxity(|_, _| String::new()).lines().next().unwrap().to_owned();
    let mut log = header + "\n";
    for k in 0..6000 {
        let load = 100.0 * (f64::from(k) / 300.0).sin();
        let test = if load < 0.0 { "posterior" } else { "anterior" };
        let _ = writeln!(log, "r{k},{test},30,0,0,0,{load:.3},20,30.2,0.5,-1,0.5,{:.4},-28.5", 0.05 * load);
    }
    let (code, words) = checked(with_laxity("k.csv", log.as_bytes()).path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["6000 rows are averaged to", "readings", "scatter"]);
}

#[test]
fn two_sources_of_one_knee_are_held_against_each_other() {
    let good = laxity(|t, f| plain(t, f, f + 0.3));
    let folder = with_laxity("k.csv", good.as_bytes());
    let with = |second: &str| {
        let toml = text(&folder.path().join("specimen.toml"));
        if !toml.contains("\nr = ") {
            write(&folder.path().join("specimen.toml"), format!("{toml}r = \"laxity/r.csv\"\n"));
        }
        write(&folder.path().join("laxity/r.csv"), second);
        checked(folder.path())
    };
    let (code, words) = with(&good.replace("anterior0,", "another0,"));
    assert_eq!(code, 1, "{words}");
    holds(&words, &["k and r hold the same measurements", "given twice"]);
    let (code, words) = built(folder.path(), "calibrate");
    assert_eq!(code, 1, "{words}");
    holds(&words, &["[laxity]", "k and r hold the same measurements"]);
    // the second apparatus pulls harder, and has a zero of its own
    let harder = |ap: f64| {
        good.replace(",100,", ",120,").replace(",-28.5", ",-28.4").replace(",3.5,", &format!(",{},", 4.1 + ap))
    };
    let (code, words) = with(&harder(0.0));
    assert!(code == 0 && !words.contains("LOOK    laxity "), "{words}");
    let shifted: String = harder(0.0)
        .lines()
        .map(|l| {
            let mut cells: Vec<String> = l.split(',').map(String::from).collect();
            if let Ok(x) = cells[12].parse::<f64>() {
                cells[12] = (x + 12.0).to_string();
            }
            cells.join(",") + "\n"
        })
        .collect();
    let (code, words) = with(&shifted);
    assert_eq!(code, 0, "{words}");
    holds(&words, &["LOOK    laxity ", "ap_mm", "offset"]);
}

#[test]
fn units_and_angles_of_laxity_are_named() {
    let good = laxity(|t, f| plain(t, f, f + 0.3));
    let pounds = good.replace(",100,", ",22.48,").replace(",-100,", ",-22.48,");
    let between = laxity(|t, f| plain(t, f, 180.0 - f));
    for (table, words) in [(pounds, "In lbf it would be 99.99"), (between, "angle between the shafts")] {
        // told, or refused for what follows from it
        let (_, said) = checked(with_laxity("k.csv", table.as_bytes()).path());
        holds(&said, &["LOOK", words]);
    }
    let widest: Vec<u8> = good.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
    let (code, said) = checked(with_laxity("k.csv", &widest).path());
    assert!(code == 0 && said.contains("18 trials"), "{said}");
}

#[test]
fn landmarks_in_the_table_that_3d_slicer_exports_are_read_in_the_frame_of_its_columns() {
    for (axes, sign) in [("l,p,s", 1.0), ("r,a,s", -1.0)] {
        let folder = knee(&BUILT);
        let mut out = format!("label,{axes},defined,selected,visible,locked,description\n");
        for line in text(&folder.path().join("landmarks.csv")).lines().filter(|l| l.contains(",ct,")) {
            let cells: Vec<&str> = line.split(',').collect();
            let p: Vec<f64> = cells[2..].iter().map(|c| c.parse().unwrap()).collect();
            let _ = writeln!(out, "\"{}\",{},{},{},1,1,1,0,\"\"", cells[0], sign * p[0], sign * p[1], p[2]);
        }
        std::fs::remove_file(folder.path().join("landmarks.csv")).unwrap();
        write(&folder.path().join("lm.csv"), out);
        change(folder.path(), "landmarks.csv", "lm.csv");
        let (code, words) = checked(folder.path());
        assert_eq!(code, 0, "{axes}: {words}");
        holds(&words, &["12 in ct"]);
    }
}
