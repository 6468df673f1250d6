//! What stands beside the numbers: words, noise, persons, names of files, landmarks that nothing reads; and files of other programs in a surface's place.

mod folder;
mod one_reading;
mod one_test;

use super::tables::{laxity, plain, with_laxity};
use super::{BUILT, built, change, checked, holds, knee, labels, nrrd, with_labels};
use crate::common::{json, read, text, write};
use formats::{read_surface, stl};
use meshes::surface::TriMesh;
use sim::laxity::sign_doubts;

/// What the reader and the doubts say of a table.
fn said(table: &str) -> String {
    let read = sim::laxity::read(table.as_bytes()).unwrap();
    let doubts = sign_doubts(&read.trials).into_iter().map(|d| d.words);
    notices::texts(&read.warnings).into_iter().chain(doubts).collect::<Vec<_>>().join("\n")
}

/// What a table is refused by.
fn refused(table: &str) -> String {
    sim::laxity::read(table.as_bytes()).unwrap_err().to_string()
}

/// A knee that goes where it is pushed.
fn good() -> String {
    laxity(|t, f| plain(t, f, f + 0.3))
}

/// The table with a column more: what a row has in it, by its number from 0.
fn with_column(name: &str, cell: impl Fn(usize) -> String) -> String {
    let lines = good();
    let line = |(k, l): (usize, &str)| match k {
        0 => format!("{l},{name}\n"),
        _ => format!("{l},{}\n", cell(k - 1)),
    };
    lines.lines().enumerate().map(line).collect()
}

#[test]
fn a_table_s_words_beside_its_numbers_are_told() {
    assert_eq!(said(&good()), "");
    let flagged = with_column("flags", |k| if k == 4 { "exclude".into() } else { String::new() });
    holds(&said(&flagged), &["row 6, column \"flags\": \"exclude\"", "leave the row out"]);
    assert_eq!(said(&with_column("flags", |_| "moving".into())), "");
    for text in ["not excluded", "bad=False", "good; not bad"] {
        assert_eq!(said(&with_column("flags", |_| text.into())), "", "{text}");
    }
    assert_eq!(said(&with_column("Notes", |_| "second knee of the day".into())), "");
    let noted = with_column("comment", |k| if k == 4 { "marker slipped".into() } else { String::new() });
    holds(&said(&noted), &["row 6, column \"comment\""]);
    let again = |name: &str, ap: &str| format!("{name},anterior,30,0,0,0,100,20,30.3,0.5,-1,0.5,{ap},-28.4\n");
    let single = again("anterior_30_2", "3.9");
    let sums = |name: &str, ap: &str| said(&(good() + &single + &again(name, ap)));
    holds(&sums("mean", "3.7"), &["1 trials sum up others", "\"mean\""]);
    holds(&sums("anterior_30_sd", "0.2"), &["1 trials sum up others"]);
    // another reading, somebody's initials, and no single trials beside it
    for said in
        [sums("mean", "9.1"), sums("SD_30", "3.7"), sums("SD_30", "4.2"), said(&(good() + &again("mean", "3.6")))]
    {
        assert!(!said.contains("sum up others"), "{said}");
    }
    // a table of means alone is one of readings
    let means: String = good()
        .lines()
        .enumerate()
        .map(|(k, l)| if k == 0 { format!("{l}\n") } else { format!("mean_{l}\n") })
        .collect();
    assert_eq!(said(&means), "");
}

#[test]
fn noise_tension_and_a_column_that_nobody_read_are_told() {
    for (name, usual, odd, word) in [
        ("sd_ap_mm", "0.4", "0.0004", "one alone may decide"),
        ("sd_ie_deg", "0.5", "40", "no standard deviation"),
        ("load_quadriceps_n", "200", "0.2", "kN"),
    ] {
        assert_eq!(said(&with_column(name, |_| usual.into())), "", "{name}");
        holds(&said(&with_column(name, |_| odd.into())), &[name, word]);
    }
    let lost = laxity(|t, f| {
        let row = plain(t, f, f + 0.3);
        let mut cells: Vec<&str> = row.split(',').collect();
        if ["anterior", "posterior"].contains(&t) {
            cells[12] = "";
        }
        cells.join(",")
    });
    holds(&said(&lost), &["ap_mm is empty in all 6 trials"]);
}

#[test]
fn readings_that_end_at_one_number_are_told() {
    let with = |read: &dyn Fn(f64) -> f64| {
        let row = |t: &str, f: f64| {
            let row = plain(t, f, f + 0.3);
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            let ap = cells[12].parse::<f64>().unwrap() + 0.012_345_7 * f + 0.001_237 * t.len() as f64;
            cells[12] = read(ap).to_string();
            // the rest of the knee goes on
            cells[13] = (0.017 * f - 28.5).to_string();
            cells.join(",")
        };
        let more = ["anterior", "posterior", "internal", "external", "varus", "valgus"].map(|t| row(t, 60.0) + "\n");
        laxity(row) + &more.concat()
    };
    assert_eq!(said(&with(&|ap| ap)), "");
    holds(&said(&with(&|ap| ap.min(3.6))), &["ap_mm is exactly 3.6 mm in 3 of 8 readings", "clipped"]);
    // the same where each flexion was pulled with another load
    let ramp = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let (Ok(load), Ok(flexion)) = (cells[6].parse::<f64>(), cells[2].parse::<f64>()) {
            cells[6] = (load * (1.0 + 0.01 * flexion)).to_string();
        }
        cells.join(",") + "\n"
    };
    let ramped: String = with(&|ap| ap.min(3.6)).lines().map(ramp).collect();
    holds(&said(&ramped), &["ap_mm is exactly 3.6 mm in 3 of 8 readings"]);
    // a displacement that a test goes to, and an instrument of whole mm whose neutral was subtracted
    for table in [with(&|ap| ap.min(2.0)), with(&|ap| ap.round() + 0.123_456_7)] {
        assert!(!said(&table).contains("clipped"), "{table}");
    }
}

#[test]
fn what_programs_and_people_leave_in_cells_is_read_or_named() {
    let trials = |table: &str| sim::laxity::read(table.as_bytes()).unwrap().trials;
    assert_eq!(trials(&good().replacen("ap_mm", "\u{200b}ap_mm", 1)), trials(&good()));
    // a column of whole numbers with gaps, as pandas writes it
    // empty columns of a spreadsheet
    assert_eq!(trials(&with_column(",", |_| ",".into())), trials(&good()));
    let inside: String = good().lines().map(|l| format!("{}\n", l.replacen(',', ",,", 1))).collect();
    assert_eq!(trials(&inside), trials(&good()));
    let orders = |cell: &dyn Fn(usize) -> String| trials(&with_column("order", cell));
    assert_eq!(orders(&|k| format!("{k}.0")), orders(&|k| k.to_string()));
    for (table, words) in [
        (good() + "measured by JS\n", ["14", "below the table"]),
        (good() + "Mean,,,,,,,,30,0.5,-1,0.5,3.5,-28.5\n", ["\"test\"", "sums up others"]),
        (with_column("", |_| "slow".into()), ["column 15", "has no name"]),
        (good().replacen(",anterior,", ",AD,", 1), ["unknown test \"AD\"", "tests = { \"AD\""]),
        (good().replacen(",100,", ",1.100.5,", 1), ["1.100.5", "two decimal marks"]),
        (good().replacen(",100,", ",\u{ff11}\u{ff10}\u{ff10},", 1), ["load_ap_n", "another script"]),
    ] {
        holds(&refused(&table), &words);
    }
}

#[test]
fn names_of_the_other_side_and_of_a_cut_knee_are_told() {
    let folder = with_laxity("K7_right.csv", good().replacen("anterior30", "ACL_cut_30", 1).as_bytes());
    change(folder.path(), "id = \"S193761-phantom\"", "id = \"K7 right\"");
    let (code, words) = checked(folder.path());
    assert_eq!(code, 0, "{words}");
    holds(
        &words,
        &[
            "LOOK    specimen.id",
            "the file's name says the other side",
            "1 trials, the first",
            "are they of a knee of which",
        ],
    );
}

#[test]
fn numbers_of_a_person_and_of_ligaments_in_another_unit_are_told() {
    let folder = knee(&BUILT);
    change(
        folder.path(),
        "provenance = \"synthetic\"",
        "provenance = \"synthetic\"\nage_years = 1954\nheight_cm = 1.75\nmass_kg = 75000",
    );
    let ligaments =
        "[ligaments.ACL_AM]\nreference_strain = 0.05\n\n[ligaments.LCL]\nstiffness_n_per_mm = 68500\n\n[ct]";
    change(folder.path(), "[ct]", ligaments);
    let (code, words) = checked(folder.path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["year of birth", "specimen.height_cm is 1.75", "specimen.mass_kg is 75000"]);
    holds(&words, &["ligaments.ACL_AM.reference_strain is 0.05", "ligaments.LCL.stiffness_n_per_mm is 68500"]);
}

#[test]
fn quotes_of_print_and_decimal_commas_of_the_specimen_file_are_named() {
    for (from, to, words) in [
        ("side = \"left\"", "side = \u{201c}left\u{201d}", "type \""),
        ("[ct]", "[options.hexmesh]\nedge_length_mm = 0,75\n\n[ct]", "edge_length_mm = 0.75"),
    ] {
        let folder = knee(&BUILT);
        change(folder.path(), from, to);
        let (code, said) = checked(folder.path());
        assert_eq!(code, 1, "{said}");
        holds(&said, &["specimen.toml, line", words]);
    }
}

#[test]
fn epicondyles_in_each_other_s_place_are_refused() {
    let frames = json(&BUILT.path().join("build/05-frames/frames.json"));
    let of = |key: &str| -> [f64; 3] { std::array::from_fn(|k| frames["femur"][key][k].as_f64().unwrap()) };
    let (origin, medial) = (of("origin"), of("medial"));
    let with = |sign: f64| {
        let folder = knee(&BUILT);
        let file = folder.path().join("landmarks.csv");
        let mut table = text(&file);
        for (name, to) in [("epicondyle_medial", sign), ("epicondyle_lateral", -sign)] {
            let p: [f64; 3] = std::array::from_fn(|k| origin[k] + 40.0 * to * medial[k]);
            table += &format!("{name},ct,{},{},{}\n", p[0], p[1], p[2]);
        }
        write(&file, table);
        checked(folder.path())
    };
    let (code, words) = with(1.0);
    assert!(code == 0 && !words.contains("exchange"), "{words}");
    let (code, words) = with(-1.0);
    assert_eq!(code, 1, "{words}");
    holds(&words, &["landmarks.csv", "epicondyle_medial lies on the lateral side", "exchange"]);
}

#[test]
fn landmarks_that_nothing_reads_or_that_lie_too_near_are_told() {
    let folder = knee(&BUILT);
    let file = folder.path().join("landmarks.csv");
    let table = text(&file);
    let ct: Vec<&str> = table.lines().filter(|l| l.contains(",ct,")).collect();
    let renamed = |(k, l): (usize, &&str)| format!("F-{k},{}\n", l.split_once(',').unwrap().1);
    write(&file, format!("name,frame,x_mm,y_mm,z_mm\n{}", ct.iter().enumerate().map(renamed).collect::<String>()));
    let (code, words) = checked(folder.path());
    assert_eq!(code, 0, "{words}");
    holds(&words, &["nothing reads any of its 12 landmarks", "`F-0`", "femoral_head_center"]);
    // the distal point of the shaft, at the plateau
    let other = |l: &&str| !l.starts_with("tibial_shaft_distal");
    let rest: String = table.lines().filter(other).map(|l| format!("{l}\n")).collect();
    let frames = json(&BUILT.path().join("build/05-frames/frames.json"));
    let p: Vec<String> = (0..3).map(|k| frames["tibia"]["origin"][k].to_string()).collect();
    write(&file, format!("{rest}tibial_shaft_distal,ct,{}\n", p.join(",")));
    let (_, words) = checked(folder.path());
    holds(&words, &["tibial_shaft_distal lies", "from the joint, expected"]);
}

#[test]
fn points_of_slicer_that_are_not_placed_or_not_measured_are_named() {
    for (file, words) in [
        (
            r#"{"markups": [{"coordinateSystem": "LPS", "controlPoints": [{"label": "a", "position": [1, 2, 3], "positionStatus": "preview"}]}]}"#,
            "none is placed",
        ),
        (
            r#"{"markups": [{"coordinateSystem": "LPS", "controlPoints": [{"label": "a", "position": [NaN, 2, 3]}]}]}"#,
            "no NaN",
        ),
    ] {
        let folder = knee(&BUILT);
        write(&folder.path().join("lm.mrk.json"), file);
        change(folder.path(), "landmarks.csv", "lm.mrk.json");
        let (code, said) = checked(folder.path());
        assert_eq!(code, 1, "{said}");
        holds(&said, &["lm.mrk.json", words]);
    }
}

#[test]
fn files_of_other_programs_and_damaged_numbers_are_named_in_a_surface_s_place() {
    let told = |bytes: &[u8]| read_surface("a.stl", bytes, &Default::default()).err().unwrap().0;
    holds(&told(b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nENDSEC;\nDATA;\nENDSEC;\n"), &["STEP"]);
    holds(&told(b"*HEADING\na\n*NODE\n1, 0., 0., 0.\n"), &["Abaqus"]);
    let mut bone = stl::read(&read(&BUILT.path().join("ct/femur.stl"))).unwrap();
    bone.vertices[7].x = 1e30;
    let mut bytes = Vec::new();
    stl::write(&mut bytes, &bone).unwrap();
    holds(&told(&bytes), &["vertex", "damaged"]);
}

#[test]
fn two_bones_in_one_file_are_told() {
    let folder = knee(&BUILT);
    let place = |name: &str| folder.path().join(name);
    let bones = ["ct/femur.stl", "ct/tibfib.stl"].map(|name| stl::read(&read(&place(name))).unwrap());
    let mut bytes = Vec::new();
    stl::write(&mut bytes, &TriMesh::joined([&bones[0], &bones[1]])).unwrap();
    write(&place("ct/femur.stl"), bytes);
    let (_, words) = checked(folder.path());
    holds(&words, &["LOOK    ct.femur", "another bone", "a file of its own"]);
}

#[test]
fn a_slice_without_labels_and_labels_that_were_mixed_are_named() {
    let mut map = labels();
    let size = map.grid.size;
    let across = (0..3).max_by(|a, b| map.grid.axes[(0, *a)].abs().total_cmp(&map.grid.axes[(0, *b)].abs())).unwrap();
    let bone: Vec<usize> = (0..map.values.len()).filter(|i| map.values[*i] == 5).collect();
    let middle = bone.iter().map(|i| map.grid.voxel(*i)[across]).sum::<usize>() / bone.len();
    assert!(middle > 0 && middle < size[across]);
    let whole = map.clone();
    for i in (0..map.values.len()).filter(|i| whole.grid.voxel(*i)[across] == middle) {
        map.values[i] = 0;
    }
    let folder = with_labels("l.nrrd", nrrd(&map, std::slice::from_ref(&map.values), 1.0, ""));
    let (code, words) = built(folder.path(), "ingest");
    assert_eq!(code, 1, "{words}");
    holds(&words, &["in two pieces", "left without labels"]);
    // cartilage that was eroded where it lies on bone
    let mut gap = whole.clone();
    let (size, strides) = (whole.grid.size, whole.grid.strides());
    let on_bone = |i: &usize| {
        let at = whole.grid.voxel(*i);
        let is = |k: usize| whole.values[k] == 5;
        (0..3).any(|a| at[a] > 0 && is(i - strides[a]) || at[a] + 1 < size[a] && is(i + strides[a]))
    };
    let rim: Vec<usize> = (0..whole.values.len()).filter(|i| whole.values[*i] == 1).filter(on_bone).collect();
    rim.iter().for_each(|i| gap.values[*i] = 0);
    let folder = with_labels("l.nrrd", nrrd(&gap, std::slice::from_ref(&gap.values), 1.0, ""));
    let (_, words) = built(folder.path(), "ingest");
    holds(&words, &["of the voxels of femoral_cartilage touch its bone", "gap"]);
    // specks of cartilage all over, as numbers mixed by an interpolation leave them
    let mut mixed = whole.clone();
    let free: Vec<usize> = (0..whole.values.len()).filter(|i| whole.values[*i] == 0).step_by(101).take(900).collect();
    free.iter().for_each(|i| mixed.values[*i] = 1);
    let folder = with_labels("l.nrrd", nrrd(&mixed, std::slice::from_ref(&mixed.values), 1.0, ""));
    let (_, words) = built(folder.path(), "ingest");
    holds(&words, &["loose pieces of femoral_cartilage", "nearest neighbour"]);
}
