//! Traits of other people's files, drawn by a seed: each on each input of each phantom. The model is right within its limits, or the files are
//! refused by name, or a warning names the trait; nothing is silently wrong. `GENU_TRAITS=300` draws 300 of them.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
#![expect(clippy::type_complexity, clippy::too_many_lines, reason = "a table of traits, each with what it does")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

mod labels;
mod laxity;
mod words;

use crate::common::{build_model, copy, json, phantom, read, text, write};
use formats::{ply, read_surface, stl};
use meshes::Point;
use meshes::surface::ColouredMesh;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use tempfile::TempDir;

/// Drawn in every run of the tests.
const FEW: usize = 24;
/// Limits within which a model is the right one: frames [mm], [deg], ends of fibres [mm].
const RIGHT: [f64; 3] = [1.5, 1.5, 3.0];
/// Phantoms of dissected knees.
const PHANTOMS: [&str; 2] = ["S193761-phantom", "S192803-phantom"];

/// Numbers by a linear congruence; the same everywhere.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % n as u64) as usize
    }
}

/// What is done to an input, and phrases of which a warning or refusal has one, by whole words; a last `*` stands for any ending.
struct Trait {
    name: String,
    words: &'static [&'static str],
    apply: Box<dyn Fn(&Path)>,
}

/// Changes of a point, by the name of the trait.
fn changes(dice: &mut Dice) -> Vec<(&'static str, fn(Point, f64) -> Point, f64, &'static [&'static str])> {
    let far = 12.0 + dice.below(40) as f64;
    let sign = if dice.below(2) == 0 { far } else { -far };
    vec![
        ("metres", |p, _| p / 1000.0, 0.0, &["metres", "unit"]),
        ("centimetres", |p, _| p / 10.0, 0.0, &["centimetres", "unit"]),
        ("inches", |p, _| p / 25.4, 0.0, &["inches", "unit"]),
        ("RAS", |p, _| Point::new(-p.x, -p.y, p.z), 0.0, &["RAS", "frame", "half turn"]),
        ("mirrored", |p, _| Point::new(-p.x, p.y, p.z), 0.0, &["mirror*", "frame", "side"]),
        ("columns y, x, z", |p, _| Point::new(p.y, p.x, p.z), 0.0, &["column*", "frame", "order"]),
        ("columns z, y, x", |p, _| Point::new(p.z, p.y, p.x), 0.0, &["column*", "frame", "order"]),
        ("shift in x", |p, s| Point::new(p.x + s, p.y, p.z), sign, &["shift*", "frame", "mm off", "lie", "apart"]),
        ("shift in y", |p, s| Point::new(p.x, p.y + s, p.z), sign, &["shift*", "frame", "mm off", "lie", "apart"]),
        ("scale", |p, _| p * 1.3, 0.0, &["scale*", "unit", "mm off", "frame", "adults"]),
    ]
}

/// The cells of a CSV changed from a column on, three by three, in the rows where `of` holds.
fn table(path: &Path, from: usize, of: impl Fn(&[&str]) -> bool, change: impl Fn(Point) -> Point) {
    let mut out = String::new();
    for (k, line) in text(path).lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        if k == 0 || !of(&cells) {
            let _ = writeln!(out, "{line}");
            continue;
        }
        let numbers: Vec<f64> = cells[from..].iter().map(|c| c.parse().unwrap()).collect();
        let moved: Vec<String> = numbers
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(|p| change(Point::from(*p)).coords.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>())
            .collect();
        let _ = writeln!(out, "{},{}", cells[..from].join(","), moved.join(","));
    }
    write(path, out);
}

fn surface(path: &Path, change: impl Fn(Point) -> Point) {
    let name = path.to_string_lossy().into_owned();
    let mut read = read_surface(&name, &read(path), &BTreeMap::new()).unwrap();
    read.mesh.vertices.iter_mut().for_each(|p| *p = change(*p));
    save(path, &read);
}

fn save(path: &Path, surface: &ColouredMesh) {
    let mut bytes = Vec::new();
    match surface.colours.is_empty() {
        true => stl::write(&mut bytes, &surface.mesh).unwrap(),
        false => ply::write_coloured(&mut bytes, surface).unwrap(),
    }
    write(path, bytes);
}

/// How a scan's program writes colours: the type of a channel, the number of full colour.
#[derive(Clone, Copy)]
struct Depth {
    name: &'static str,
    channel: &'static str,
    full: f32,
}

/// Colour depths of programs: a byte's numbers in 16 bits, a camera's 12 bits in them, fractions, and a byte's numbers as fractions.
const DEPTHS: [Depth; 5] = [
    Depth { name: "of 16 bits", channel: "ushort", full: 65535.0 },
    Depth { name: "of 8 bits in 16", channel: "ushort", full: 255.0 },
    Depth { name: "of 12 bits in 16", channel: "ushort", full: 4095.0 },
    Depth { name: "from 0 to 1", channel: "float", full: 1.0 },
    Depth { name: "from 0 to 255 as fractions", channel: "float", full: 255.0 },
];

/// The scan with its colours written in another depth.
fn with_depth(path: &Path, depth: Depth) {
    let scan = read_surface("a.ply", &read(path), &BTreeMap::new()).unwrap();
    let mut out = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", scan.mesh.vertices.len());
    out += "property float x\nproperty float y\nproperty float z\n";
    for name in ["red", "green", "blue"] {
        out += &format!("property {} {name}\n", depth.channel);
    }
    let triangles = &scan.mesh.triangles;
    out += &format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", triangles.len());
    let mut bytes = out.into_bytes();
    for (p, colour) in scan.mesh.vertices.iter().zip(&scan.colours) {
        bytes.extend(p.coords.iter().flat_map(|x| (*x as f32).to_le_bytes()));
        for c in colour {
            let value = f32::from(*c) / 255.0 * depth.full;
            match depth.channel {
                "float" => bytes.extend(value.to_le_bytes()),
                _ => bytes.extend((value.round() as u16).to_le_bytes()),
            }
        }
    }
    for t in triangles {
        bytes.push(3);
        bytes.extend(t.iter().flat_map(|v| v.to_le_bytes()));
    }
    write(path, bytes);
}

/// fibres.csv of a build as attachments.csv.
fn give_fibres(folder: &Path, built: &Path) {
    let table = text(&built.join("06-attachments/fibres.csv"));
    let rows = table.lines().map(|l| l.rsplit_once(',').map_or(l, |(row, _)| row).to_owned() + "\n");
    write(&folder.join("attachments.csv"), rows.collect::<String>());
}

/// Draws a trait of an input of a dissected knee.
fn draw(dice: &mut Dice, built: &Path) -> Trait {
    let mut all = changes(dice);
    let (name, change, by, words) = all.swap_remove(dice.below(all.len()));
    let input = dice.below(9);
    let wide = |path: &Path| {
        let bytes: Vec<u8> =
            [0xff, 0xfe].into_iter().chain(text(path).encode_utf16().flat_map(u16::to_le_bytes)).collect();
        write(path, bytes);
    };
    let built = built.to_owned();
    let (input, words, apply): (String, &'static [&'static str], Box<dyn Fn(&Path)>) = match input {
        0 => (
            "attachments.csv".into(),
            words,
            Box::new(move |d| {
                give_fibres(d, &built);
                table(&d.join("attachments.csv"), 2, |_| true, |p| change(p, by));
            }),
        ),
        1 => (
            "landmarks.csv".into(),
            words,
            Box::new(move |d| {
                table(&d.join("landmarks.csv"), 2, |c| c[1] == "ct", |p| change(p, by));
            }),
        ),
        2 => (
            "landmarks.csv, scans".into(),
            words,
            Box::new(move |d| {
                table(&d.join("landmarks.csv"), 2, |c| c[1] != "ct", |p| change(p, by));
            }),
        ),
        3 => {
            ("marks.csv".into(), words, Box::new(move |d| table(&d.join("marks.csv"), 2, |_| true, |p| change(p, by))))
        }
        4 => ("ct/femur.stl".into(), words, Box::new(move |d| surface(&d.join("ct/femur.stl"), |p| change(p, by)))),
        5 => ("ct/tibfib.stl".into(), words, Box::new(move |d| surface(&d.join("ct/tibfib.stl"), |p| change(p, by)))),
        6 => (
            "both bones of ct".into(),
            words,
            Box::new(move |d| {
                for bone in ["ct/femur.stl", "ct/tibfib.stl"] {
                    surface(&d.join(bone), |p| change(p, by));
                }
            }),
        ),
        7 => {
            ("scans/femur.ply".into(), words, Box::new(move |d| surface(&d.join("scans/femur.ply"), |p| change(p, by))))
        }
        _ => match dice.below(7) {
            0 => (
                "femur_* and tibia_* exchanged".into(),
                &["exchanged"],
                Box::new(move |d| {
                    give_fibres(d, &built);
                    let path = d.join("attachments.csv");
                    let header = text(&path).replacen(
                        "femur_x_mm,femur_y_mm,femur_z_mm,tibia_x_mm,tibia_y_mm,tibia_z_mm",
                        "tibia_x_mm,tibia_y_mm,tibia_z_mm,femur_x_mm,femur_y_mm,femur_z_mm",
                        1,
                    );
                    write(&path, header);
                }),
            ),
            1 => (
                "side".into(),
                &["side", "left", "right"],
                Box::new(|d| {
                    let toml = text(&d.join("specimen.toml"));
                    let other = if toml.contains("side = \"left\"") {
                        toml.replace("side = \"left\"", "side = \"right\"")
                    } else {
                        toml.replace("side = \"right\"", "side = \"left\"")
                    };
                    write(&d.join("specimen.toml"), other);
                }),
            ),
            2 => (
                "frames of marks exchanged".into(),
                &["frame"],
                Box::new(|d| {
                    let path = d.join("marks.csv");
                    let words = text(&path)
                        .replace("scan_femur", "x")
                        .replace("scan_tibfib", "scan_femur")
                        .replace(",x,", ",scan_tibfib,");
                    write(&path, words);
                }),
            ),
            3 => (
                "red and blue exchanged".into(),
                &["colour*"],
                Box::new(|d| {
                    let mut scan = read_surface("a.ply", &read(&d.join("scans/femur.ply")), &BTreeMap::new()).unwrap();
                    scan.colours.iter_mut().for_each(|c| c.swap(0, 2));
                    save(&d.join("scans/femur.ply"), &scan);
                }),
            ),
            4 => {
                let depth = DEPTHS[dice.below(DEPTHS.len())];
                (
                    format!("colours {}", depth.name),
                    &["colour*"],
                    Box::new(move |d| with_depth(&d.join("scans/femur.ply"), depth)),
                )
            }
            5 => ("UTF-16".into(), &["UTF"], Box::new(move |d| wide(&d.join("marks.csv")))),
            _ => (
                "scans exchanged".into(),
                &["same bone", "frame", "exchanged"],
                Box::new(|d| {
                    let [a, b] = ["scans/femur.ply", "scans/tibfib.ply"].map(|n| d.join(n));
                    let (x, y) = (read(&a), read(&b));
                    write(&a, y);
                    write(&b, x);
                }),
            ),
        },
    };
    Trait { name: format!("{name} of {input}"), words, apply }
}

fn run(folder: &Path, out: &Path, to: &str) -> (Option<i32>, String) {
    let done = build_model().arg("build").arg(folder).arg("--out").arg(out).args(["--to", to]).output().unwrap();
    let words = [done.stdout, done.stderr].concat();
    (done.status.code(), String::from_utf8_lossy(&words).into_owned())
}

/// Lines of warnings that `words` has and the right build has not.
fn new_warnings(words: &str, right: &str) -> String {
    words.lines().filter(|l| l.contains("warning") && !right.contains(l)).map(|l| format!("{l}\n")).collect()
}

/// How far frames [mm], [deg] and fibres' ends [mm] of two builds lie apart.
fn apart(a: &Path, b: &Path) -> [f64; 3] {
    let [x, y] = [a, b].map(|d| json(&d.join("05-frames/frames.json"))["gs_ct_pose"].clone());
    let off = |key: &str| (x[key].as_f64().unwrap() - y[key].as_f64().unwrap()).abs();
    let [mm, deg] = [["ml_mm", "ap_mm", "si_mm"], ["fe_deg", "vv_deg", "ie_deg"]]
        .map(|k| k.map(off).into_iter().fold(0.0, f64::max));
    let ends = |d: &Path| -> BTreeMap<String, Vec<f64>> {
        let table = text(&d.join("06-attachments/fibres.csv"));
        let row = |l: &str| {
            let cells: Vec<&str> = l.split(',').collect();
            (format!("{} {}", cells[0], cells[1]), cells[2..8].iter().map(|c| c.parse().unwrap()).collect())
        };
        table.lines().skip(1).map(row).collect()
    };
    let (p, q) = (ends(a), ends(b));
    let far = p.iter().map(|(k, p)| match q.get(k) {
        Some(q) => p.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        None => f64::INFINITY,
    });
    [mm, deg, if p.len() == q.len() { far.fold(0.0, f64::max) } else { f64::INFINITY }]
}

/// How a trait ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    /// Refused, and the message names the trait.
    Refused,
    /// Told by a warning that names it.
    Told,
    /// The right model all the same.
    Right,
    /// Refused by a message that does not name it.
    Unnamed,
    /// Another model or other trials, and no word.
    Silent,
}

fn named(said: &str, drawn: &Trait) -> bool {
    let sentences = words::sentences(said);
    drawn.words.iter().any(|phrase| words::has(&sentences, phrase))
}

/// Whether letters of a word, of a file's name or of a key alone would have named it.
fn by_accident(said: &str, drawn: &Trait) -> bool {
    let bare = |phrase: &&'static str| said.to_lowercase().contains(&phrase.to_lowercase().replace('*', ""));
    !named(said, drawn) && drawn.words.iter().any(bare)
}

fn refused(words: &str, drawn: &Trait) -> Verdict {
    if named(words, drawn) { Verdict::Refused } else { Verdict::Unnamed }
}

/// What a build says of a changed knee; `clean` are the words of the knee as it was, `right` its build.
fn build_verdict(folder: &Path, right: &Path, clean: &str, drawn: &Trait) -> (Verdict, String) {
    let built = folder.join("build");
    let mut said = run(folder, &built, "ingest");
    if said.0 == Some(0) && !named(&new_warnings(&said.1, clean), drawn) {
        said = run(folder, &built, "attachments");
    }
    let (code, words) = said;
    let verdict = match code {
        Some(1) => refused(&words, drawn),
        Some(0) if named(&new_warnings(&words, clean), drawn) => Verdict::Told,
        Some(0) => match apart(&built, right).iter().zip(RIGHT).all(|(o, r)| *o <= r) {
            true => Verdict::Right,
            false => Verdict::Silent,
        },
        code => panic!("{}: exit status {code:?}: {words}", drawn.name),
    };
    (
        verdict,
        if verdict == Verdict::Silent {
            format!("{:.1?}; {}", apart(&built, right), new_warnings(&words, clean))
        } else {
            words
        },
    )
}

/// What `check` says of a changed laxity file; its trials in the standard shape are the right ones, or the trait is named.
fn check_verdict(folder: &Path, right: &str, clean: &str, drawn: &Trait) -> (Verdict, String) {
    let (code, words, trials) = checked(folder);
    let new: String = words.lines().filter(|l| !clean.contains(*l)).map(|l| format!("{l}\n")).collect();
    let verdict = match code {
        Some(1) => refused(&new, drawn),
        Some(0) if new.contains("LOOK") && named(&new, drawn) => Verdict::Told,
        Some(0) if trials == right => Verdict::Right,
        Some(0) => Verdict::Silent,
        code => panic!("{}: exit status {code:?}: {words}", drawn.name),
    };
    (verdict, new)
}

/// Exit status and words of `check`, and the laxity file as it writes it.
fn checked(folder: &Path) -> (Option<i32>, String, String) {
    let out = folder.join("standard");
    let done = build_model().arg("check").arg(folder).arg("--write-laxity").arg(&out).output().unwrap();
    let words = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
    let file = out.join("rks.csv");
    (done.status.code(), words, if file.exists() { text(&file) } else { String::new() })
}

/// A phantom, built as far as traits are judged, and what the build said.
fn built(id: &str) -> (TempDir, String) {
    let folder = phantom(id);
    if id == LIVING {
        labels::coarse(folder.path());
    }
    let (code, words) = run(folder.path(), &folder.path().join("build"), "attachments");
    assert_eq!(code, Some(0), "{words}");
    (folder, words)
}

/// The phantom of a living knee.
const LIVING: &str = "mri-phantom";
/// Of so many traits two are of a dissected knee, one is of a label map, and one of a laxity file.
const ROUND: usize = 4;

#[test]
fn no_trait_makes_a_wrong_model_without_a_word() {
    let count = std::env::var("GENU_TRAITS").ok().and_then(|n| n.parse().ok()).unwrap_or(FEW);
    let seed = std::env::var("GENU_SEED").ok().and_then(|n| n.parse().ok()).unwrap_or(55);
    let mut dice = Dice(seed);
    let knees = PHANTOMS.map(built);
    let living = built(LIVING);
    // with laxity, which the program simulates
    let folder = TempDir::new().unwrap();
    let measured = folder.path().join("knee");
    build_model().args(["phantom", PHANTOMS[0]]).arg(&measured).assert().success();
    let standard = checked(&measured);
    let mut ends: BTreeMap<&'static str, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for i in 0..count {
        let (knee, clean) = if i % ROUND == 2 { &living } else { &knees[i % knees.len()] };
        let drawn = match i % ROUND {
            2 => labels::draw(&mut dice),
            3 => laxity::draw(&mut dice),
            _ => draw(&mut dice, &knee.path().join("build")),
        };
        let folder = TempDir::new().unwrap();
        copy(if i % ROUND == 3 { &measured } else { knee.path() }, folder.path());
        let right = knee.path().join("build");
        let _ = std::fs::remove_dir_all(folder.path().join("build"));
        (drawn.apply)(folder.path());
        let (verdict, words) = match i % ROUND {
            3 => check_verdict(folder.path(), &standard.2, &standard.1, &drawn),
            _ => build_verdict(folder.path(), &right, clean, &drawn),
        };
        let name = match verdict {
            Verdict::Refused => "refused by name",
            Verdict::Told => "told",
            Verdict::Right => "the right model",
            Verdict::Unnamed => "refused without its name",
            Verdict::Silent => "silently wrong",
        };
        *ends.entry(name).or_default() += 1;
        if matches!(verdict, Verdict::Unnamed | Verdict::Silent) {
            let accident = if by_accident(&words, &drawn) { ", told by accident alone" } else { "" };
            println!("{name} {i}{accident}: {}\n{words}", drawn.name);
            wrong.push(format!("{i} {}", drawn.name));
        }
    }
    println!("{count} traits: {ends:?}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}
