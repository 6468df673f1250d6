//! Laxity in the shapes of six laboratories: the same trials come out, in clinical signs; what cannot be read is refused with its mend.
#![allow(clippy::unwrap_used, reason = "tests")]

use meshes::frame::Side;
use sim::coordinate::{AP, Coordinate, FREE, IE, ML, SI, VV};
use sim::laxity::{LaxityFormat, LaxityTable, LaxityTrial, read, read_as, read_asked, sign_doubts, trials_csv};

/// AP drawers and VV, IE moments at three flexions: made of slopes, so that every sign is known. `(load, displacement)` by coordinate.
fn made() -> Vec<LaxityTrial> {
    let mut csv = String::from(
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n",
    );
    let tests = [
        ("anterior", [0.0, 0.0, 133.0]),
        ("posterior", [0.0, 0.0, -133.0]),
        ("external", [0.0, 5.0, 0.0]),
        ("internal", [0.0, -5.0, 0.0]),
        ("valgus", [10.0, 0.0, 0.0]),
        ("varus", [-10.0, 0.0, 0.0]),
    ];
    for flexion in [0.0, 30.0, 90.0] {
        for (test, [vv, ie, ap]) in tests {
            csv += &format!(
                "{test}_{flexion},{test},{flexion},{vv},{ie},0,{ap},20,{},{},{},{},{},-21\n",
                flexion + 1.5,
                0.4 * vv,
                3.0 * ie - 2.0,
                1.0 + 0.1 * vv,
                0.04 * ap - 1.0
            );
        }
    }
    read(csv.as_bytes()).unwrap().trials
}

/// The standard file with commas for points and semicolons for commas, and a row of units.
fn continental() -> String {
    let csv = trials_csv(&made());
    let (header, rows) = csv.split_once('\n').unwrap();
    let units: Vec<&str> = header
        .split(',')
        .map(|c| match c.rsplit('_').next().unwrap() {
            "deg" => "deg",
            "mm" => "mm",
            "nm" => "Nm",
            "n" => "N",
            "s" => "s",
            _ => "",
        })
        .collect();
    format!("{}\n{}\n{}", header.replace(',', ";"), units.join(";"), rows.replace(',', ";").replace('.', ","))
}

fn table(format: &str, csv: &str, side: Side) -> LaxityTable {
    read_as(csv.as_bytes(), &toml::from_str::<LaxityFormat>(format).unwrap(), side).unwrap()
}

fn same(found: &[LaxityTrial], names: bool) {
    let wanted = made();
    assert_eq!(found.len(), wanted.len());
    for (f, w) in found.iter().zip(&wanted) {
        assert!(!names || f.trial == w.trial);
        assert_eq!((f.test, f.nominal_flexion_deg), (w.test, w.nominal_flexion_deg), "{}", w.trial);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
        assert!(close(f.fe_deg, w.fe_deg));
        for c in FREE {
            assert!(close(f.load[c], w.load[c]), "{} load {c}: {} for {}", w.trial, f.load[c], w.load[c]);
            assert!(close(f.measured[c].unwrap(), w.measured[c].unwrap()), "{} value {c}", w.trial);
        }
    }
    assert!(sign_doubts(found).is_empty(), "{:?}", sign_doubts(found));
}

#[test]
fn standard_and_continental_files_need_no_declaration() {
    same(&read(trials_csv(&made()).as_bytes()).unwrap().trials, true);
    same(&read(continental().as_bytes()).unwrap().trials, true);
    same(&read(format!("\u{feff}{}", trials_csv(&made()).replace(',', "\t")).as_bytes()).unwrap().trials, true);
}

/// Other names, kN, N mm and radians in brackets; the tests in the laboratory's words.
#[test]
fn other_names_units_and_words() {
    let mut csv = String::from(
        "Run;Direction;Flex target;T_vv (Nmm);T_ie [Nmm];F_ap [kN];Flex [rad];VV [rad];IE [rad];ML [cm];AP [cm];SI [cm];Operator\n",
    );
    for t in made() {
        let m = t.measured.map(Option::unwrap);
        let word = if t.test.name() == "anterior" { "Ant. drawer" } else { t.test.name() };
        let cells = [
            t.load[VV] * 1e3,
            t.load[IE] * 1e3,
            t.load[AP] / 1e3,
            t.fe_deg.to_radians(),
            m[VV].to_radians(),
            m[IE].to_radians(),
            m[ML] / 10.0,
            m[AP] / 10.0,
            m[SI] / 10.0,
        ];
        let cells: Vec<String> = cells.iter().map(|v| v.to_string().replace('.', ",")).collect();
        csv += &format!("{};{word};{};{};JS\n", t.trial, t.nominal_flexion_deg, cells.join(";"));
    }
    let format = r#"
        constants = { load_si_n = 20, load_ml_n = 0 }
        tests = { "ant. drawer" = "anterior" }
        [columns]
        trial = "run"
        test = "Direction"
        nominal_flexion_deg = "Flex target"
        load_vv_nm = "T_vv"
        load_ie_nm = "T_ie"
        load_ap_n = "F_ap"
        fe_deg = "Flex"
        vv_deg = "VV"
        ie_deg = "IE"
        ml_mm = "ML"
        ap_mm = "AP"
        si_mm = "SI"
    "#;
    let found = table(format, &csv, Side::Left);
    same(&found.trials, true);
    assert!(found.warnings.iter().any(|w| w.contains("Operator")), "{:?}", found.warnings);
}

/// A robot whose axes do not turn with the side, whose loads act on the femur, and whose files have neither tests nor nominal flexion.
#[test]
fn a_robots_axes_on_either_side() {
    for side in [Side::Left, Side::Right] {
        let right = if side == Side::Right { 1.0 } else { -1.0 };
        let mut csv = String::from("Fy,Mz,Mx,Fz,flex,rx,rz,x,y,z\n");
        for t in made() {
            let m = t.measured.map(Option::unwrap);
            let cells = [
                -t.load[AP],
                -right * t.load[IE],
                -right * t.load[VV],
                -t.load[SI],
                -t.fe_deg,
                right * m[VV],
                right * m[IE],
                right * m[ML],
                m[AP],
                -m[SI],
            ];
            csv += &format!("{}\n", cells.map(|v| v.to_string()).join(","));
        }
        let format = r#"
            loads_on = "femur"
            nominal_flexions_deg = [0, 30, 90]
            branch_from_load = true
            [columns]
            load_ap_n = "Fy"
            load_ie_nm = { name = "Mz", positive = "right" }
            load_vv_nm = { name = "Mx", positive = "right" }
            load_si_n = "Fz"
            fe_deg = { name = "flex", positive = "extension" }
            vv_deg = { name = "rx", positive = "right" }
            ie_deg = { name = "rz", positive = "right" }
            ml_mm = { name = "x", positive = "right" }
            ap_mm = "y"
            si_mm = { name = "z", positive = "distraction" }
        "#;
        same(&table(format, &csv, side).trials, false);
    }
}

/// A ramp up and down: branches from the load.
#[test]
fn branches_are_told_from_the_load() {
    let mut csv = String::from("test,nominal_flexion_deg,load_ap_n,fe_deg,ap_mm\n");
    for load in [10, 50, 100, 60, 20] {
        csv += &format!("anterior,30,{load},30,{}\n", f64::from(load) * 0.05);
    }
    let trials = table("branch_from_load = true", &csv, Side::Left).trials;
    let names: Vec<String> = trials.iter().map(|t| format!("{:?}", t.branch.unwrap()).to_lowercase()).collect();
    assert_eq!(names, ["loading", "loading", "loading", "unloading", "unloading"]);
}

/// Every convention that is turned round is found, and nothing is in data that are right.
#[test]
fn turned_signs_are_found() {
    let turned = |change: &dyn Fn(&mut LaxityTrial)| {
        let mut trials = made();
        trials.iter_mut().for_each(change);
        sign_doubts(&trials).into_iter().map(|d| d.column).collect::<Vec<_>>()
    };
    let flip = |t: &mut LaxityTrial, c: Coordinate| t.measured[c] = t.measured[c].map(|v| -v);
    assert!(turned(&|_: &mut LaxityTrial| ()).is_empty());
    assert_eq!(turned(&|t: &mut LaxityTrial| flip(t, AP)), ["ap_mm"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| flip(t, VV)), ["vv_deg"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| flip(t, IE)), ["ie_deg"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| t.load[IE] = -t.load[IE]), ["load_ie_nm"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| t.fe_deg = -t.fe_deg), ["fe_deg"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| flip(t, SI)), ["si_mm"]);
    assert_eq!(turned(&|t: &mut LaxityTrial| t.load[SI] = -t.load[SI]), ["load_si_n"]);
}

/// Units and zeros that no knee has are doubted, each at its column.
#[test]
fn loads_ranges_and_origins_of_no_knee_are_doubted() {
    let changed = |change: &dyn Fn(&mut LaxityTrial)| {
        let mut trials = made();
        trials.iter_mut().for_each(change);
        sign_doubts(&trials).into_iter().map(|d| d.column).collect::<Vec<_>>()
    };
    let times = |t: &mut LaxityTrial, c: Coordinate, by: f64| t.measured[c] = t.measured[c].map(|v| by * v);
    assert!(changed(&|t: &mut LaxityTrial| t.load[AP] *= 100.0).contains(&"load_ap_n".to_owned()));
    assert!(changed(&|t: &mut LaxityTrial| t.load[SI] *= 1000.0).contains(&"load_si_n".to_owned()));
    assert!(changed(&|t: &mut LaxityTrial| t.load[IE] *= 88.5).contains(&"load_ie_nm".to_owned()));
    assert!(changed(&|t: &mut LaxityTrial| times(t, IE, 57.3)).contains(&"ie_deg".to_owned()));
    for by in [0.1, 1.0 / 25.4, 25.4] {
        assert!(changed(&|t: &mut LaxityTrial| times(t, SI, by)).contains(&"si_mm".to_owned()), "{by}");
    }
}

#[test]
fn what_cannot_be_read_is_refused_with_its_mend() {
    let refused = |format: &str, csv: &str| {
        read_as(csv.as_bytes(), &toml::from_str::<LaxityFormat>(format).unwrap(), Side::Left).unwrap_err().to_string()
    };
    let standard = trials_csv(&made());
    for (format, csv, words) in [
        ("", standard.replacen("load_ap_n", "Fap", 1), ["unknown column \"Fap\"", "laxity_format"]),
        (
            "",
            standard.replacen("ml_mm", "ml_cm", 1),
            ["\"ml_cm\": it is ml_mm in cm", "ml_mm = { name = \"ml_cm\", unit = \"cm\" }"],
        ),
        (
            "",
            standard.replacen("load_vv_nm", "load_vv_nmm", 1).replacen(",fe_deg", ",fe_rad", 1),
            ["it is load_vv_nm in nmm", "; fe_deg = { name = \"fe_rad\", unit = \"rad\" }"],
        ),
        ("", standard.replacen("ml_mm", "ML [mm]", 1), ["it is ml_mm by another name", "ml_mm = \"ML [mm]\""]),
        ("", standard.replacen("load_ap_n", "Load AP (lbf)", 1), ["it is load_ap_n in lbf", "unit = \"lbf\""]),
        (
            "",
            standard.replacen("anterior_0,anterior,", "anterior_0,anterior,5,", 1),
            ["row 2", "save the table with semicolons"],
        ),
        ("columns = { ap_mm = \"AP\" }", standard.clone(), ["no column \"AP\"", "the file has trial"]),
        ("columns = { app_mm = \"ap_mm\" }", standard.clone(), ["columns.app_mm", "did you mean ap_mm?"]),
        (
            "columns = { ap_mm = { name = \"ap_mm\", positive = \"forward\" } }",
            standard.clone(),
            ["forward", "expected anterior, posterior"],
        ),
        (
            "columns = { ap_mm = { name = \"ap_mm\", unit = \"N\" } }",
            standard.clone(),
            ["unit \"N\"", "expected one of mm"],
        ),
        ("decimal = \",\"\nseparator = \",\"", standard.clone(), ["both a comma", "semicolons"]),
    ] {
        let said = refused(format, &csv);
        assert!(words.iter().all(|w| said.contains(w)), "{said}");
    }
}

#[test]
fn the_line_that_is_told_for_a_column_reads_the_file() {
    let right = made();
    for (column, name, factor) in [
        ("ml_mm", "ml_cm", 0.1),
        ("ap_mm", "AP [in]", 1.0 / 25.4),
        ("load_ie_nm", "load_ie_nmm", 1000.0),
        ("si_mm", "SI mm", 1.0),
    ] {
        let csv = rewritten(column, |_, cell| (cell.parse::<f64>().unwrap() * factor).to_string());
        let csv = csv.replacen(column, name, 1);
        let said = read(csv.as_bytes()).unwrap_err().to_string();
        let line = said.split_once("in specimen.toml: ").unwrap().1;
        let format = toml::from_str::<LaxityFormat>(&format!("[columns]\n{line}")).unwrap();
        let found = read_as(csv.as_bytes(), &format, Side::Right).unwrap().trials;
        let same = |a: &LaxityTrial, b: &LaxityTrial| {
            let near = |x: f64, y: f64| (x - y).abs() < 1e-6;
            FREE.into_iter().all(|c| near(a.measured[c].unwrap(), b.measured[c].unwrap()) && near(a.load[c], b.load[c]))
        };
        assert!(found.len() == right.len() && found.iter().zip(&right).all(|(a, b)| same(a, b)), "{name}: {said}");
    }
}

/// The standard file with a column's cells in its lines (from 0, the header not counted) as another program writes them.
fn rewritten(column: &str, change: impl Fn(usize, &str) -> String) -> String {
    let csv = trials_csv(&made());
    let (header, rows) = csv.split_once('\n').unwrap();
    let at = header.split(',').position(|h| h == column).unwrap();
    let row = |(k, line): (usize, &str)| {
        let cells: Vec<String> = line
            .split(',')
            .enumerate()
            .map(|(i, cell)| if i == at { change(k, cell) } else { cell.to_owned() })
            .collect();
        cells.join(",") + "\n"
    };
    format!("{header}\n{}", rows.lines().enumerate().map(row).collect::<String>())
}

#[test]
fn a_typeset_minus_is_a_minus() {
    let right = read(trials_csv(&made()).as_bytes()).unwrap();
    for minus in ['\u{2212}', '\u{2013}', '\u{fe63}', '\u{ff0d}'] {
        let csv = trials_csv(&made()).replace(",-", &format!(",{minus}"));
        assert_eq!(read(csv.as_bytes()).unwrap(), right, "{minus}");
    }
    // alone it says that nothing was read
    let blank = read(rewritten("ml_mm", |_, _| "\u{2014}".into()).as_bytes()).unwrap();
    assert!(blank.trials.iter().all(|t| t.measured[ML].is_none()));
}

#[test]
fn cells_of_other_programs_are_refused_with_their_cause() {
    let of = |column: &str, text: &'static str| {
        rewritten(column, move |k, cell| if k == 4 { text.into() } else { cell.into() })
    };
    let header = trials_csv(&made()).lines().next().unwrap().to_owned();
    let twice = trials_csv(&made()) + &header + "\n" + trials_csv(&made()).split_once('\n').unwrap().1;
    for (csv, row, words) in [
        (of("ml_mm", "(2.341)"), 6, "write -2.341"),
        (of("ml_mm", "2.341-"), 6, "write -2.341"),
        (of("ap_mm", "5. Mai"), 6, "date"),
        (of("ap_mm", "05.05.2026"), 6, "date"),
        (of("ap_mm", "5.15 mm"), 6, "take \"mm\" out"),
        (of("ap_mm", "#DIV/0!"), 6, "a formula of the sheet failed"),
        (of("ap_mm", "Err:502"), 6, "a formula of the sheet failed"),
        (of("nominal_flexion_deg", "#WERT!"), 6, "a formula of the sheet failed"),
        (of("trial", "#REF!"), 6, "is no name; a formula of the sheet failed"),
        (of("trial", "#NAME?"), 6, "is no name; a formula of the sheet failed"),
        (of("trial", "Err:508"), 6, "is no name; a formula of the sheet failed"),
        (of("ap_mm", "#####"), 6, "widen the column"),
        (of("ap_mm", "'-5.15"), 6, "write -5.15"),
        (of("ap_mm", "<5"), 6, "a bound or a guess"),
        (of("ap_mm", "5.15 \u{b1} 0.2"), 6, "in the column sd_"),
        (of("load_ap_n", "1\u{a0}050.5"), 6, "write 1050.5"),
        (of("load_ap_n", "1'050"), 6, "write 1050"),
        (of("load_ap_n", "1.05D+02"), 6, "write 1.05E+02"),
        (of("ap_mm", "\"5,15\""), 6, "decimal comma"),
        (of("ap_mm", "-999"), 6, "code for not measured; leave the cell empty"),
        (of("fe_deg", "-9999"), 6, "code for not measured; leave the cell empty"),
        (of("nominal_flexion_deg", ""), 6, "merged cells"),
        (of("test", ""), 6, "merged cells"),
        (twice, 20, "a second header"),
    ] {
        let said = read(csv.as_bytes()).unwrap_err().to_string();
        assert!(said.starts_with(&format!("row {row}")) && said.contains(words), "{said}");
    }
    // above all rows an empty cell is no merged one
    let first = rewritten("nominal_flexion_deg", |k, cell| if k == 0 { String::new() } else { cell.into() });
    assert!(!read(first.as_bytes()).unwrap_err().to_string().contains("merged"));
    // another unit is still told as one
    let said = read(of("ap_mm", "-998").as_bytes()).unwrap_err().to_string();
    assert!(said.contains("another unit") && !said.contains("code"), "{said}");
    // a name may have a mark or a number
    for name in ["#5", "#5!", "knee #2", "Err 5", "again?"] {
        assert_eq!(read(of("trial", name).as_bytes()).unwrap().trials[4].trial, name);
    }
}

const FLEXIONS: [&str; 2] = ["nominal_flexion_deg", "fe_deg"];

/// Trials that are only loads, with these columns of flexion; `cell` is what stands in a row (from 0) and such a column.
fn only_loads(columns: &[&'static str], separator: &str, cell: impl Fn(usize, &str) -> String) -> String {
    let tests =
        [("rest", "neutral", 0), ("pulled", "anterior", 100), ("pushed", "posterior", -100), ("again", "anterior", 60)];
    let line = |before: [&str; 2], flexions: Vec<String>, loads: [&str; 5]| {
        let cells = before.map(String::from).into_iter().chain(flexions).chain(loads.map(String::from));
        cells.collect::<Vec<_>>().join(separator) + "\n"
    };
    let names = columns.iter().map(|c| (*c).to_owned()).collect();
    let mut file = line(["trial", "test"], names, ["load_vv_nm", "load_ie_nm", "load_ml_n", "load_ap_n", "load_si_n"]);
    for (k, (name, test, ap)) in tests.into_iter().enumerate() {
        let flexions = columns.iter().map(|c| cell(k, c)).collect();
        file += &line([name, test], flexions, ["0", "0", "0", &ap.to_string(), "20"]);
    }
    file
}

/// Flexions of these trials [deg].
const ASKED_DEG: [&str; 4] = ["30", "62.5", "0", "90"];

/// What is asked by loads and one flexion is what is asked by loads and the same flexion twice, row by row.
#[test]
fn one_flexion_asks_what_both_ask() {
    for separator in [",", ";", "\t"] {
        let both = only_loads(&FLEXIONS, separator, |k, _| ASKED_DEG[k].into());
        let asked = read_asked(both.as_bytes()).unwrap();
        assert_eq!(asked.trials[1].fe_deg, 62.5);
        for own in FLEXIONS {
            let one = only_loads(&[own], separator, |k, _| ASKED_DEG[k].into());
            assert_eq!(read_asked(one.as_bytes()).unwrap(), asked, "{own} {separator:?}");
            assert!(read(one.as_bytes()).is_err(), "what was measured needs both");
        }
        // each row has both, the first or the second
        for which in 0..3_usize.pow(4) {
            let given = |k: usize| which / 3_usize.pow(k as u32) % 3;
            let cell = |k: usize, column: &str| {
                let left_out = given(k) > 0 && column == FLEXIONS[given(k) % 2];
                if left_out { String::new() } else { ASKED_DEG[k].to_owned() }
            };
            let mixed = only_loads(&FLEXIONS, separator, cell);
            assert_eq!(read_asked(mixed.as_bytes()).unwrap().trials, asked.trials, "{mixed}");
        }
    }
}

#[test]
fn a_flexion_at_fault_is_told_by_the_column_that_the_file_has() {
    let said = |columns: &[&'static str], bad: &str| {
        let file = only_loads(columns, ",", |k, _| if k == 2 { bad.into() } else { ASKED_DEG[k].into() });
        read_asked(file.as_bytes()).unwrap_err().to_string()
    };
    for (own, other) in [(FLEXIONS[0], FLEXIONS[1]), (FLEXIONS[1], FLEXIONS[0])] {
        for (bad, words) in
            [("400", "beyond 180 deg"), ("bent", "not a finite number"), ("", "empty; expected degrees")]
        {
            let said = said(&[own], bad);
            let named = said.starts_with(&format!("row 4, column \"{own}\"")) && !said.contains(other);
            assert!(named && said.contains(words), "{own}: {said}");
        }
    }
    let empty = said(&FLEXIONS, "");
    assert!(empty.contains("empty, as \"fe_deg\" is; expected degrees"), "{empty}");
    let neither = said(&[], "");
    assert!(neither.contains("missing column nominal_flexion_deg or fe_deg;"), "{neither}");
}

#[test]
fn one_cause_in_many_rows_is_one_notice_with_their_count() {
    let turned = rewritten(
        "load_ap_n",
        |k, cell| {
            if k < 12 { cell.into() } else { (-cell.parse::<f64>().unwrap()).to_string() }
        },
    );
    let found = read(turned.as_bytes()).unwrap();
    let against: Vec<_> = found.warnings.iter().filter(|w| w.kind == notices::Kind::LoadAgainstTest).collect();
    assert_eq!(against.len(), 1, "{:?}", found.warnings);
    assert_eq!((against[0].row, against[0].count), (Some(14), Some(2)));
    assert!(against[0].text.contains("1 more rows alike, the last 15, all at 90 deg"), "{}", against[0].text);
    let empty = read(rewritten("load_ml_n", |_, _| String::new()).as_bytes()).unwrap();
    assert_eq!(empty.warnings.iter().map(|w| w.count).collect::<Vec<_>>(), [Some(18)]);
}

#[test]
fn tables_of_another_shape_are_refused_with_what_they_are() {
    let csv = trials_csv(&made());
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<_>>().join(",") + "\n";
    let on_its_side: String = (0..rows[0].len()).map(column).collect();
    let page = format!("<table><tr><td>{}</td></tr></table>", csv.replace(',', "</td><td>"));
    for (text, words) in [
        (csv.replace(',', "|"), "parted by another sign"),
        (csv.replace(',', "  "), "parted by another sign"),
        (on_its_side, "lies on its side"),
        (page, "web page"),
    ] {
        let said = read(text.as_bytes()).unwrap_err().to_string();
        assert!(said.contains(words), "{words}: {said}");
    }
}
