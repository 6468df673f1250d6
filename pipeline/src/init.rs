//! `init`: a specimen folder to fill in, or filled in as far as given files tell what they are.

mod pictures;
mod points;
mod surfaces;
mod template;

use crate::error::BuildError;
use crate::store;
use crate::suggested::{command, command_on};
use crate::told::{Told, schemas};
use formats::kind::{Kind, kind_of};
use formats::read_surface;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What specimen.toml will say.
#[derive(Clone, Debug, Default)]
struct Filled {
    id: String,
    side: Option<&'static str>,
    /// What tells the side, in words; empty where nothing does.
    side_by: &'static str,
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
    /// A line in place of the file's own: of a series its folder has one, and the other files none.
    line: Option<String>,
    bytes: Vec<u8>,
}

/// A file that was given, with its place.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PlacedTold {
    /// The file as given.
    pub from: String,
    /// Its place in the specimen's folder; null where it was left out.
    pub to: Option<String>,
    /// What it was taken for, or why it was left out.
    pub why: String,
}

/// `init --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InitTold {
    /// init/1
    pub schema: &'static str,
    /// The specimen's folder.
    pub folder: String,
    /// What became of every given file.
    pub files: Vec<PlacedTold>,
    /// left or right; null where nothing shows it, and specimen.toml then says left.
    pub side: Option<String>,
    /// What a build needs and nobody gave, a sentence each.
    pub missing: Vec<String>,
}

/// Which knee, as it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SideName {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl SideName {
    fn name(self) -> &'static str {
        match self {
            SideName::Left => "left",
            SideName::Right => "right",
        }
    }
}

/// Writes a specimen folder to `dir`; what `from` holds is copied to where its geometry says it belongs.
pub fn init(dir: &Path, from: &[PathBuf], side: Option<SideName>) -> Result<Told, BuildError> {
    if !store::list(dir).is_empty() {
        return Err(BuildError::of_file(
            dir,
            format!("{} is not empty; give a new folder: {}", dir.display(), beginning_in(dir, from)),
        ));
    }
    let name = dir.file_name().map_or("K1".into(), |n| n.to_string_lossy().into_owned());
    let mut filled = Filled { id: name, ..Filled::default() };
    let (placed, told) = placed(from, &mut filled)?;
    let told = with_side(&mut filled, side.map(SideName::name), told);
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
    let data = InitTold {
        schema: schemas::INIT,
        folder: dir.display().to_string(),
        files: placed
            .iter()
            .map(|p| PlacedTold { from: p.from.clone(), to: p.to.clone(), why: p.why.clone() })
            .collect(),
        side: filled.side.map(str::to_owned),
        missing: missing(&filled),
    };
    Ok(Told::words(words(dir, &placed, &filled, &told)).with(&data))
}

/// The command that begins in a folder beside `dir` that is not there yet.
fn beginning_in(dir: &Path, from: &[PathBuf]) -> String {
    let mut words = vec![store::free_beside(dir).into_os_string()];
    if !from.is_empty() {
        words.push("--from".into());
        words.extend(from.iter().map(|path| path.clone().into_os_string()));
    }
    command("init", words)
}

/// What was placed where, what is missing, and what to type next.
fn words(dir: &Path, placed: &[Placed], filled: &Filled, told: &str) -> String {
    let mut text = String::new();
    for p in placed {
        if let Some(line) = &p.line {
            text += line;
            text += if line.is_empty() { "" } else { "\n" };
            continue;
        }
        let to = p.to.as_deref().map_or("left out".into(), |to| format!("-> {to}"));
        if !p.why.is_empty() {
            let _ = writeln!(text, "{} {to}: {}", p.from, p.why);
        }
    }
    text += told;
    let _ = writeln!(text, "A specimen folder is in {}.", dir.display());
    if placed.is_empty() {
        text += "Put the bones of CT into ct/, the scans into scans/, and name them in specimen.toml.\n";
    } else {
        for what in missing(filled) {
            let _ = writeln!(text, "Missing: {what}");
        }
        if filled.side.is_none() {
            text += "Missing: the side. Nothing that was given shows it; specimen.toml says \"left\", which is no more than a guess: correct it there, or give init --side left or right\n";
        }
        text += "What was guessed is above. Read specimen.toml, and correct what is wrong.\n";
    }
    let _ = writeln!(text, "Next: {}", command_on("check", dir));
    text
}

/// Takes the side that is given; gives what is told of the side.
fn with_side(filled: &mut Filled, given: Option<&'static str>, told: String) -> String {
    let Some(given) = given else { return told };
    let shown = filled.side.filter(|shown| *shown != given);
    (filled.side, filled.side_by) = (Some(given), "given");
    match shown {
        Some(shown) => format!("side = \"{given}\": as given; the files show a {shown} knee\n"),
        None => format!("side = \"{given}\": as given\n"),
    }
}

/// What a build needs and nobody gave, with what to do.
fn missing(filled: &Filled) -> Vec<String> {
    let has = |table: &str, key: &str| filled.paths.contains_key(&(table.to_owned(), key.to_owned()));
    let mut out = Vec::new();
    let mut lacks = |is: bool, what: &str| {
        if is {
            out.push(what.to_owned());
        }
    };
    if !filled.labels.is_empty() {
        return out;
    }
    let volume = has("ct", "volume");
    lacks(!volume && !has("ct", "femur"), "the femur in CT: put its surface at ct/femur.stl");
    lacks(
        !volume && !has("ct", "tibfib"),
        "the tibia with the fibula in CT: put its surface at ct/tibfib.stl, in the frame of the femur's",
    );
    let mri = ["femur", "tibia_medial", "tibia_lateral"].map(|key| has("cartilage", key));
    if mri.contains(&true) {
        lacks(mri.contains(&false), "a cartilage: [cartilage] needs femur, tibia_medial and tibia_lateral");
    } else {
        lacks(!has("scans", "femur"), "the femur's scan, which shows its cartilage: put it at scans/femur.ply");
        lacks(!has("scans", "tibfib"), "the scan of the tibia with the fibula: put it at scans/tibfib.ply");
        let none = !has("scans", "femur") && !has("scans", "tibfib");
        lacks(
            none,
            "or, in place of both scans, the cartilages from MRI: [segmentation], or [cartilage] (docs/specimen.md)",
        );
    }
    out
}

/// Every given file with its place; a folder gives its files.
fn placed(from: &[PathBuf], filled: &mut Filled) -> Result<(Vec<Placed>, String), BuildError> {
    let (mut given, mut tables, mut markups, mut dicom, mut volumes) = (vec![], vec![], vec![], vec![], vec![]);
    let mut out = Vec::new();
    for path in expanded(from)? {
        let bytes = store::read(&path)?;
        let name = path.display().to_string();
        let leave = |why: String| Placed { from: name.clone(), to: None, why, line: None, bytes: vec![] };
        match kind_of(&file_name(&path), &bytes) {
            Kind::Surface(_) => match read_surface(&file_name(&path), &bytes, &companions(&path)) {
                Ok(mesh) => given.push(surfaces::Given { path, bytes, mesh }),
                Err(e) => out.push(leave(format!("cannot be read: {e}"))),
            },
            Kind::Table => tables.push((path, bytes)),
            Kind::Markups => markups.push((path, bytes)),
            // a segmentation is a label map, slices are a CT
            Kind::Dicom => match pictures::label_map(&path, bytes, filled) {
                Ok(placed) => out.extend(placed),
                Err(bytes) => dicom.push((path, bytes)),
            },
            Kind::Picture => match pictures::label_map(&path, bytes, filled) {
                Ok(placed) => out.extend(placed),
                Err(bytes) => volumes.push((path, bytes)),
            },
            Kind::Companion => {}
            Kind::Unknown(what) => out.push(leave(format!(
                "{what}; known are surfaces, tables (CSV, XLSX), pictures (NIfTI, NRRD, MetaImage, DICOM) and points of 3D Slicer or MeshLab"
            ))),
        }
    }
    let (placed, known, text) = surfaces::place(given, filled)?;
    out.extend(placed);
    for (path, bytes) in volumes {
        out.extend(pictures::volume(&path, bytes, filled));
    }
    if !dicom.is_empty() {
        out.extend(pictures::series(dicom, filled));
    }
    for (path, bytes) in tables {
        out.push(points::table(&path, bytes, &known, filled));
    }
    for (path, bytes) in markups {
        out.push(points::markups(&path, bytes, filled));
    }
    Ok((out, text))
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
