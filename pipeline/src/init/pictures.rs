//! Pictures of voxels: label maps by what their labels show, CT volumes, DICOM series.

use super::{Filled, Placed, companions, file_name};
use formats::picture::read_labels;
use meshes::frame::Side;
use stages::guess::guess_labels;
use stages::ingest::ingest;
use stages::specimen::{IngestOptions, RawSpecimen};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A label map with its companions, where the labels show bones and cartilages; else the file's bytes come back: a CT.
pub(super) fn label_map(path: &Path, bytes: Vec<u8>, filled: &mut Filled) -> Result<Vec<Placed>, Vec<u8>> {
    let name = file_name(path);
    let beside = companions(path);
    let read = if filled.labels.is_empty() { read_labels(&name, &bytes, &beside).ok() } else { None };
    let Some(found) = read.and_then(|map| guess_labels(&map)) else { return Err(bytes) };
    let found = match found.side {
        None => match side_of(&found.labels, &name, &bytes, &beside) {
            Some(side) => found.of_side(side),
            None => found,
        },
        Some(_) => found,
    };
    let said: Vec<String> = found.labels.iter().map(|(key, label)| format!("{label} {key}")).collect();
    let lateral = match found.side {
        Some(_) => "",
        None => "; no fibula is seen: see whether medial and lateral are exchanged",
    };
    if let Some(side) = found.side {
        (filled.side, filled.side_by) =
            (Some(if side == Side::Left { "left" } else { "right" }), "told from the label map");
    }
    filled.labels = found.labels;
    let why = format!("a label map; by volume, place and contact: {}{lateral}", said.join(", "));
    Ok(placed(("segmentation", "labels", "mri"), path, (bytes, why), filled))
}

/// The knee's CT, unless bones of CT are there already.
pub(super) fn volume(path: &Path, bytes: Vec<u8>, filled: &mut Filled) -> Vec<Placed> {
    match taken(filled) {
        Some(why) => {
            vec![Placed {
                from: path.display().to_string(),
                to: None,
                why: format!("a volume; {why}"),
                line: None,
                bytes,
            }]
        }
        None => placed(("ct", "volume", "ct"), path, (bytes, "a volume, taken for the knee's CT".into()), filled),
    }
}

/// Why no volume is needed, where it is not.
fn taken(filled: &Filled) -> Option<&'static str> {
    let has = |key: &str| filled.paths.contains_key(&("ct".to_owned(), key.to_owned()));
    match (has("femur") || has("tibfib"), has("volume")) {
        (true, _) => Some("the bones of CT are there as surfaces, so it is not needed"),
        (_, true) => Some("another is taken for the knee's CT; correct [ct] volume if this is the one"),
        _ => None,
    }
}

/// DICOM files: the folder with most of them is the knee's CT.
pub(super) fn series(files: Vec<(PathBuf, Vec<u8>)>, filled: &mut Filled) -> Vec<Placed> {
    let mut by_folder: BTreeMap<PathBuf, Vec<(PathBuf, Vec<u8>)>> = BTreeMap::new();
    for (path, bytes) in files {
        by_folder.entry(path.parent().unwrap_or(Path::new("")).to_path_buf()).or_default().push((path, bytes));
    }
    let most = by_folder.values().map(Vec::len).max();
    let mut out = Vec::new();
    for (folder, files) in by_folder {
        let from = format!("{} ({} DICOM files)", folder.display(), files.len());
        let leave = |why: &str| Placed { from: from.clone(), to: None, why: why.to_owned(), line: None, bytes: vec![] };
        if let Some(why) = taken(filled) {
            out.push(leave(&format!("a volume; {why}")));
        } else if Some(files.len()) != most {
            out.push(leave("a smaller series than another; name it in [ct] volume if it is the knee's"));
        } else {
            filled.paths.insert(("ct".into(), "volume".into()), "ct/dicom".into());
            let line = format!(
                "{} -> ct/dicom: a DICOM series of {} files, taken for the knee's CT",
                folder.display(),
                files.len()
            );
            let mut lines = std::iter::once(line);
            let why = format!("one of the {} files of a DICOM series, taken for the knee's CT", files.len());
            for (path, bytes) in files {
                let to = Some(format!("ct/dicom/{}", file_name(&path)));
                let line = Some(lines.next().unwrap_or_default());
                out.push(Placed { from: path.display().to_string(), to, why: why.clone(), line, bytes });
            }
        }
    }
    out
}

fn placed(
    (table, key, folder): (&str, &str, &str),
    path: &Path,
    (bytes, why): (Vec<u8>, String),
    filled: &mut Filled,
) -> Vec<Placed> {
    let to = format!("{folder}/{}", file_name(path));
    filled.paths.insert((table.into(), key.into()), to.clone());
    let beside = companions(path).into_iter().map(|(name, bytes)| {
        let to = Some(format!("{folder}/{name}"));
        Placed { from: name, to, why: "named by a picture's header".into(), line: None, bytes }
    });
    let mut out: Vec<Placed> = beside.collect();
    out.push(Placed { from: path.display().to_string(), to: Some(to), why, line: None, bytes });
    out
}

/// Which knee a label map shows, by the fibula on the tibia's surface.
fn side_of(
    labels: &BTreeMap<&'static str, u8>,
    name: &str,
    bytes: &[u8],
    beside: &BTreeMap<String, Vec<u8>>,
) -> Option<Side> {
    let keys: String = labels.iter().map(|(key, label)| format!("{key} = {label}\n")).collect();
    let head = "[specimen]\nid = \"map\"\nside = \"right\"\n[segmentation]\n";
    let toml = format!("{head}labels = {name:?}\n{keys}");
    let mut files = beside.clone();
    files.insert(name.to_owned(), bytes.to_vec());
    let specimen = ingest(&RawSpecimen { toml, files }, &IngestOptions::default()).ok()?;
    stages::anatomy::detect_side(&specimen.ct.femur, &specimen.ct.tibfib).map(|s| s.side)
}
