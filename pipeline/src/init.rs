//! `init`: a specimen folder to fill in, or filled in as far as given files tell what they are.

mod template;

use crate::error::BuildError;
use crate::store;
use meshes::Point;
use meshes::format::picture::read_labels;
use meshes::format::read_surface;
use meshes::frame::Side;
use meshes::surface::{ColouredMesh, TriMesh};
use stages::anatomy::detect_side;
use stages::guess::{Role, frames_of, guess, guess_labels};
use stages::ingest::ingest;
use stages::specimen::{IngestOptions, PointFrame, RawSpecimen};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What specimen.toml will say.
#[derive(Clone, Debug, Default)]
struct Filled {
    id: String,
    side: Option<&'static str>,
    /// Paths by table and key.
    paths: BTreeMap<(String, String), String>,
    /// Labels of a label map by their keys of `[segmentation]`.
    labels: BTreeMap<&'static str, u8>,
}

/// A file that was given: what it is, where it goes, and its bytes there.
struct Placed {
    from: String,
    to: Option<String>,
    why: String,
    bytes: Vec<u8>,
}

/// Writes a specimen folder to `dir`; what `from` holds is copied to where its geometry says it belongs.
pub fn init(dir: &Path, from: &[PathBuf]) -> Result<String, BuildError> {
    if !store::list(dir).is_empty() {
        return Err(BuildError::File(format!(
            "{} is not empty; give a new folder: build-model init NEW_FOLDER",
            dir.display()
        )));
    }
    let name = dir.file_name().map_or("K1".into(), |n| n.to_string_lossy().into_owned());
    let mut filled = Filled { id: name, ..Filled::default() };
    let (placed, side) = placed(from, &mut filled)?;
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for p in &placed {
        files.extend(p.to.clone().map(|to| (to, p.bytes.clone())));
    }
    if !filled.paths.keys().any(|(table, _)| table == "laxity") {
        files.push(("laxity/example.csv".into(), template::LAXITY.as_bytes().to_vec()));
    }
    files.push(("specimen.toml".into(), template::specimen_toml(&filled).into_bytes()));
    store::write_all(dir, &files)?;
    let without_scans = !filled.labels.is_empty();
    for folder in ["ct", "scans", "laxity"].into_iter().filter(|f| *f == "laxity" || !without_scans) {
        store::make_folder(&dir.join(folder))?;
    }
    let mut text = String::new();
    for p in &placed {
        let to = p.to.as_deref().map_or("left out".into(), |to| format!("-> {to}"));
        let _ = writeln!(text, "{} {to}: {}", p.from, p.why);
    }
    text += &side;
    let _ = writeln!(text, "A specimen folder is in {}.", dir.display());
    if placed.is_empty() {
        text += "Put the bones of CT into ct/, the scans into scans/, and name them in specimen.toml.\n";
    } else {
        text += "What was guessed is above. Read specimen.toml, and correct what is wrong.\n";
    }
    let _ = writeln!(text, "Next: build-model check {}", dir.display());
    Ok(text)
}

/// Every given file with its place; a folder gives its files.
fn placed(from: &[PathBuf], filled: &mut Filled) -> Result<(Vec<Placed>, String), BuildError> {
    let mut surfaces: Vec<(PathBuf, Vec<u8>, ColouredMesh)> = Vec::new();
    let mut tables = Vec::new();
    let mut out = Vec::new();
    for path in expanded(from)? {
        let bytes = store::read(&path)?;
        let name = path.display().to_string();
        let end = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let leave = |why: &str| Placed { from: name.clone(), to: None, why: why.into(), bytes: vec![] };
        match end.as_str() {
            "stl" | "ply" | "obj" => match read_surface(&name, &bytes, &companions(&path)) {
                Ok(mesh) => surfaces.push((path, bytes, mesh)),
                Err(e) => out.push(leave(&format!("cannot be read: {e}"))),
            },
            "csv" => tables.push((path, bytes)),
            "nii" | "gz" | "nrrd" | "mha" => out.push(picture(&path, bytes, filled)),
            "nhdr" | "mhd" | "raw" | "zraw" => {
                out.push(leave("a picture in two files; save it as one .nrrd or .mha, or name it in specimen.toml"));
            }
            "mtl" | "png" | "jpg" | "jpeg" => {}
            _ => out.push(leave("of no kind that is known: expected STL, PLY, OBJ, CSV, NIfTI, NRRD or MetaImage")),
        }
    }
    let meshes: Vec<ColouredMesh> = surfaces.iter().map(|s| s.2.clone()).collect();
    let guesses = guess(&meshes);
    let mut known: BTreeMap<Role, TriMesh> = BTreeMap::new();
    for ((path, bytes, mesh), g) in surfaces.into_iter().zip(guesses.surfaces) {
        let to = g.role.filter(|r| !known.contains_key(r)).map(|role| {
            let (table, key) = role.key();
            let to = format!("{table}/{}", file_name(&path));
            filled.paths.insert((table.into(), key.into()), to.clone());
            known.insert(role, mesh.mesh);
            to
        });
        if let Some(place) = to.as_deref().and_then(|t| t.rsplit_once('/')) {
            for (name, bytes) in companions(&path) {
                let to = Some(format!("{}/{name}", place.0));
                out.push(Placed { from: name, to, why: "named by a surface".into(), bytes });
            }
        }
        out.push(Placed { from: path.display().to_string(), to, why: g.why, bytes });
    }
    for (path, bytes) in tables {
        out.push(table(&path, bytes, &known, filled));
    }
    let mut text = String::new();
    if let Some(side) = guesses.side {
        let name = if side.side == Side::Left { "left" } else { "right" };
        filled.side = Some(name);
        let _ = writeln!(text, "side = \"{name}\": the fibula lies there (certainty {:.0} %)", 100.0 * side.confidence);
    }
    Ok((out, text))
}

/// A picture of voxels: a label map where its labels show bones and cartilages, else the knee's CT.
fn picture(path: &Path, bytes: Vec<u8>, filled: &mut Filled) -> Placed {
    let name = path.display().to_string();
    let guessed = read_labels(&name, &bytes, &BTreeMap::new()).ok().and_then(|map| guess_labels(&map));
    let guessed = guessed.map(|found| match found.side {
        None => match side_of(&found.labels, &bytes) {
            Some(side) => found.of_side(side),
            None => found,
        },
        Some(_) => found,
    });
    let (table, key, to, why) = match guessed {
        Some(found) => {
            let said: Vec<String> = found.labels.iter().map(|(key, label)| format!("{label} {key}")).collect();
            let lateral = match found.side {
                Some(_) => "",
                None => "; no fibula is seen: see whether medial and lateral are exchanged",
            };
            filled.side = found.side.map(|side| if side == Side::Left { "left" } else { "right" }).or(filled.side);
            filled.labels = found.labels;
            let why = format!("a label map; by volume, place and contact: {}{lateral}", said.join(", "));
            ("segmentation", "labels", format!("mri/{}", file_name(path)), why)
        }
        None => ("ct", "volume", format!("ct/{}", file_name(path)), "a volume, taken for the knee's CT".to_owned()),
    };
    filled.paths.insert((table.into(), key.into()), to.clone());
    Placed { from: name, to: Some(to), why, bytes }
}

/// Which knee a label map shows, by the fibula on the tibia's surface.
fn side_of(labels: &BTreeMap<&'static str, u8>, bytes: &[u8]) -> Option<Side> {
    const MAP: &str = "map";
    let keys: String = labels.iter().map(|(key, label)| format!("{key} = {label}\n")).collect();
    let head = "[specimen]\nid = \"map\"\nside = \"right\"\n[segmentation]\n";
    let toml = format!("{head}labels = \"{MAP}\"\n{keys}");
    let raw = RawSpecimen { toml, files: BTreeMap::from([(MAP.to_owned(), bytes.to_vec())]) };
    let specimen = ingest(&raw, &IngestOptions::default()).ok()?;
    detect_side(&specimen.ct.femur, &specimen.ct.tibfib).map(|s| s.side)
}

/// The files of the given paths; folders are listed, hidden files left out.
fn expanded(from: &[PathBuf]) -> Result<Vec<PathBuf>, BuildError> {
    let mut out = Vec::new();
    for path in from {
        if !store::exists(path) {
            return Err(BuildError::Usage(format!("--from {}: no such file or folder", path.display())));
        }
        let listed = store::sizes(path);
        if listed.is_empty() {
            out.push(path.clone());
        }
        // truth/ and build/ are what phantoms and builds leave: they are not measured
        let made = |name: &str| name.starts_with("truth/") || name.starts_with("build/") || name.starts_with('.');
        out.extend(listed.into_iter().filter(|(n, _)| !made(n) && n != "specimen.toml").map(|(n, _)| path.join(n)));
    }
    Ok(out)
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Material libraries and textures that lie beside a surface, by name.
fn companions(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut found: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let mut next: Vec<(String, Vec<u8>)> = store::read(path).map(|b| (file_name(path), b)).into_iter().collect();
    while let Some((name, bytes)) = next.pop() {
        for inner in stages::ingest::paths_named_in(&name, &bytes) {
            if let Ok(bytes) = store::read(&folder.join(&inner))
                && !found.contains_key(&inner)
            {
                found.insert(inner.clone(), bytes.clone());
                next.push((inner, bytes));
            }
        }
    }
    found
}

/// A table's place, by its header; points without a frame get that of the surface they lie on.
fn table(path: &Path, bytes: Vec<u8>, known: &BTreeMap<Role, TriMesh>, filled: &mut Filled) -> Placed {
    let from = path.display().to_string();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let header = text.trim_start_matches('\u{feff}').lines().next().unwrap_or("").to_lowercase();
    let has = |column: &str| header.split([',', ';', '\t']).any(|c| c.trim() == column);
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut place = |table: &str, key: &str, to: String| {
        filled.paths.insert((table.into(), key.into()), to.clone());
        Some(to)
    };
    let points = |key: &str| (key == "landmarks" && has("name") || key == "marks" && has("ligament")) && has("x_mm");
    let (to, why, bytes) = if has("bundle") && has("fibre") {
        (place("points", "attachments", "attachments.csv".into()), "fibres given by hand".to_owned(), bytes)
    } else if let Some(key) = ["landmarks", "marks"].into_iter().find(|k| points(k)) {
        let (why, bytes) = match has("frame") {
            true => (format!("{key}, with their frames"), bytes),
            false => framed(&text, known),
        };
        (place("points", key, format!("{key}.csv")), why, bytes)
    } else if has("fe_deg") && !header.contains("load") {
        (place("passive", &stem, format!("passive/{stem}.csv")), "measured passive flexion".into(), bytes)
    } else if header.contains("load")
        || header.contains("force")
        || header.contains("torque")
        || header.contains("moment")
    {
        (place("laxity", &stem, format!("laxity/{stem}.csv")), "measured laxity".into(), bytes)
    } else {
        (None, format!("no table that is known; its header is {header}"), bytes)
    };
    Placed { from, to, why, bytes }
}

/// A table of points with a column `frame` put in, by the surface that they lie nearest to.
fn framed(text: &str, known: &BTreeMap<Role, TriMesh>) -> (String, Vec<u8>) {
    let surfaces: Vec<(PointFrame, &TriMesh)> = known
        .iter()
        .filter_map(|(role, mesh)| match role {
            Role::CtFemur | Role::CtTibfib => Some((PointFrame::Ct, mesh)),
            Role::ScanFemur => Some((PointFrame::ScanFemur, mesh)),
            Role::ScanTibfib => Some((PointFrame::ScanTibfib, mesh)),
            Role::CtPatella => None,
        })
        .collect();
    let point = |line: &str| {
        let x: Vec<f64> = line.split(',').rev().take(3).filter_map(|c| c.trim().parse().ok()).collect();
        (x.len() == 3).then(|| Point::new(x[2], x[1], x[0]))
    };
    let mut lines = text.lines();
    let header = lines.next().unwrap_or("").replacen(",x_mm", ",frame,x_mm", 1);
    let (mut out, mut counts) = (header + "\n", BTreeMap::<&str, usize>::new());
    let lines: Vec<(&str, Option<Point>)> = lines.filter(|l| !l.trim().is_empty()).map(|l| (l, point(l))).collect();
    let points: Vec<Point> = lines.iter().filter_map(|l| l.1).collect();
    let mut frames = frames_of(&points, &surfaces).into_iter();
    for (line, point) in lines {
        let frame = point.and_then(|_| frames.next().flatten()).map_or("ct", |frame| match frame {
            PointFrame::Ct => "ct",
            PointFrame::ScanFemur => "scan_femur",
            PointFrame::ScanTibfib => "scan_tibfib",
        });
        *counts.entry(frame).or_default() += 1;
        let (name, rest) = line.split_once(',').unwrap_or((line, ""));
        let _ = writeln!(out, "{name},{frame},{rest}");
    }
    let told: Vec<String> = counts.iter().map(|(f, n)| format!("{n} in {f}")).collect();
    (format!("points without frames; by the surface they lie on: {}", told.join(", ")), out.into_bytes())
}
