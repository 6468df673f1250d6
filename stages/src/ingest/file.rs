//! specimen.toml and the files it names.

use crate::StageError;
use crate::specimen::{CartilageFrame, CtPaths, Pieces, RawSpecimen, SEGMENTED, SpecimenFile};
use attachments::bundle::BUNDLES;
use sim::names::{did_you_mean, with_suggestion};

mod shape;

/// Files that count when they lie beside specimen.toml, named by `[points]` or not, in the order landmarks, marks,
/// attachments. Who loads a specimen adds those that exist to [`RawSpecimen::files`].
pub const OPTIONAL_PATHS: [&str; 3] = ["landmarks.csv", "marks.csv", "attachments.csv"];

/// Parses and checks specimen.toml.
///
/// # Errors
/// Bad TOML, an unknown key, an unknown bundle, a value out of range, a path out of the specimen: with the line or key.
pub fn parse_specimen_file(text: &str) -> Result<SpecimenFile, StageError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let file: SpecimenFile = toml::from_str(text).map_err(|e| {
        if let Some(empty) = shape::empty(text) {
            return StageError::specimen(empty);
        }
        let what = with_suggestion(&e.message().trim().replace('\n', "; "));
        let what = format!("{}{}{}", shape::placed(text, &e, what), unquoted(text, &e), typed(text, &e));
        match e.span() {
            Some(span) => {
                let before = text.get(..span.start).unwrap_or(text);
                let line = before.matches('\n').count() + 1;
                StageError::line("specimen.toml", line, what)
            }
            None => StageError::specimen(what),
        }
    })?;
    let refuse = |what: String| Err(StageError::specimen(what));
    if file.specimen.id.trim().is_empty() {
        return refuse("specimen.id is empty; expected a name".into());
    }
    check_sources(&file)?;
    if !file.ct.is_empty() {
        check_ct(&file.ct)?;
    }
    if let Some(provenance) = &file.specimen.provenance
        && !["published", "synthetic", "own"].contains(&provenance.as_str())
    {
        return refuse(format!("specimen.provenance is \"{provenance}\"; expected published, synthetic or own"));
    }
    let scans = file.scans.iter().flat_map(|s| [("femur", &s.femur), ("tibfib", &s.tibfib)]);
    for (key, pieces) in scans {
        if pieces.paths().is_empty() || pieces.paths().len() > 50 {
            return refuse(format!("scans.{key} lists {} paths; expected 1 to 50", pieces.paths().len()));
        }
    }
    for (name, start) in &file.ligaments {
        if !BUNDLES.iter().any(|b| b.name == *name) {
            let known: Vec<&str> = BUNDLES.iter().map(|b| b.name.as_str()).collect();
            return refuse(format!(
                "[ligaments.{name}] names no bundle{}; expected one of {}",
                did_you_mean(name, known.iter().copied()),
                known.join(", ")
            ));
        }
        for (key, value) in
            [("reference_strain", start.reference_strain), ("stiffness_n_per_mm", start.stiffness_n_per_mm)]
        {
            if value.is_some_and(|v| !(v.is_finite() && v > 0.0)) {
                return refuse(format!("ligaments.{name}.{key} must be a number above 0"));
            }
        }
    }
    if let Some(name) = file.laxity_format.keys().find(|name| !file.laxity.contains_key(*name)) {
        return refuse(format!(
            "[laxity_format.{name}] has no file{}; expected [laxity] {name} = \"laxity/....csv\"",
            did_you_mean(name, file.laxity.keys())
        ));
    }
    for (key, path) in named(&file) {
        check_path(&key, &path)?;
    }
    Ok(file)
}

/// The key and the value of the line at fault.
fn at_fault<'a>(text: &'a str, e: &toml::de::Error) -> Option<(&'a str, &'a str)> {
    let line = e.span().and_then(|s| text.get(..s.start)).map_or(0, |before| before.matches('\n').count());
    let (key, value) = text.lines().nth(line)?.split_once('=')?;
    Some((key.trim(), value.split('#').next().unwrap_or("").trim()))
}

/// What is said of quotes of typesetting, and of a decimal comma.
fn typed(text: &str, e: &toml::de::Error) -> String {
    let Some((key, value)) = at_fault(text, e) else { return String::new() };
    if value.starts_with(['\u{201c}', '\u{201d}', '\u{201e}', '\u{2018}', '\u{2019}', '\u{ab}']) {
        return "; its quotes are those of printed text: type \" in their place".into();
    }
    let plain = value.replace(',', ".");
    let is_decimal = value.matches(',').count() == 1 && !value.contains('.') && plain.parse::<f64>().is_ok();
    if is_decimal { format!("; write a decimal point: {key} = {plain}") } else { String::new() }
}

/// What a line with an unquoted word should be.
fn unquoted(text: &str, e: &toml::de::Error) -> String {
    let Some((key, value)) = at_fault(text, e) else { return String::new() };
    let word = !value.is_empty() && value.chars().all(|c| c.is_alphanumeric() || "_-./".contains(c));
    match word && e.message().contains("quoted") {
        true => format!("; write {key} = \"{value}\""),
        false => String::new(),
    }
}

fn check_ct(ct: &CtPaths) -> Result<(), StageError> {
    let wrong = match (&ct.femur, &ct.tibfib, &ct.volume, &ct.labels) {
        (Some(_), Some(_), None, None) | (None, None, Some(_), _) => return Ok(()),
        (None, Some(_), None, _) => "femur is missing",
        (Some(_), None, None, _) => "tibfib is missing",
        (_, _, Some(_), _) => "surfaces and a volume are both given",
        (_, _, None, Some(_)) => "labels without their volume",
        (None, None, None, None) => "it names nothing",
    };
    Err(StageError::specimen(format!(
        "[ct]: {wrong}; expected femur and tibfib (surfaces), or volume (and labels, if there are any)"
    )))
}

/// Every path specimen.toml names, in its order, each once.
///
/// # Errors
/// As [`parse_specimen_file`]. A path that is absolute or climbs out with `..` is refused: a specimen directory is a
/// whole that can be copied, digested and built elsewhere, and a stranger's specimen must not make the program read other files.
pub fn paths_named_by(toml: &str) -> Result<Vec<String>, StageError> {
    parse_specimen_file(toml).map(|file| paths_of(&file))
}

/// Every path that a parsed specimen.toml names, in its order, each once.
pub fn paths_of(file: &SpecimenFile) -> Vec<String> {
    let mut paths: Vec<String> = Vec::new();
    for (_, path) in named(file) {
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    paths
}

/// Paths of the files that a loaded file names in turn: an OBJ's material libraries, their textures.
pub fn paths_named_in(path: &str, bytes: &[u8]) -> Vec<String> {
    formats::companions(path, bytes)
}

/// Refuses a specimen that lacks a file it names.
pub(super) fn check_present(file: &SpecimenFile, raw: &RawSpecimen) -> Result<(), StageError> {
    let segmented = SEGMENTED.iter().all(|path| raw.files.contains_key(*path));
    for (key, path) in named(file) {
        if segmented && ["ct.volume", "ct.labels"].contains(&key.as_str()) {
            continue;
        }
        if !raw.files.contains_key(&path) {
            return Err(StageError::specimen(format!(
                "{key} names {path}, which is not there; put the file there or correct the path"
            )));
        }
    }
    Ok(())
}

/// Keys and the paths they name.
pub fn named(file: &SpecimenFile) -> Vec<(String, String)> {
    let mut named = Vec::new();
    let scans = file.scans.iter().flat_map(|s| [("scans.femur", &s.femur), ("scans.tibfib", &s.tibfib)]);
    let more = file.scans.iter().flat_map(|s| [("scans.patella", &s.patella), ("scans.capsule", &s.capsule)]);
    let ct = [
        ("ct.femur", &file.ct.femur),
        ("ct.tibfib", &file.ct.tibfib),
        ("ct.patella", &file.ct.patella),
        ("ct.volume", &file.ct.volume),
        ("ct.labels", &file.ct.labels),
    ];
    named.extend(ct.into_iter().filter_map(|(key, path)| Some((key.to_string(), path.clone()?))));
    let each = |(key, pieces): (&str, &Pieces)| {
        pieces.paths().iter().map(|path| (key.to_string(), path.clone())).collect::<Vec<_>>()
    };
    named.extend(scans.flat_map(each));
    named.extend(more.filter_map(|(key, path)| Some((key.to_string(), path.clone()?))));
    named.extend(file.segmentation.iter().map(|s| ("segmentation.labels".to_string(), s.labels.clone())));
    named.extend(file.cartilage.iter().flat_map(|c| c.named()).map(|(key, path)| (key.to_string(), path)));
    let points = [
        ("points.landmarks", &file.points.landmarks),
        ("points.marks", &file.points.marks),
        ("points.attachments", &file.points.attachments),
    ];
    named.extend(points.into_iter().filter_map(|(key, path)| Some((key.to_string(), path.clone()?))));
    named.extend(file.frames.iter().map(|f| ("frames.file".to_string(), f.file.clone())));
    named.extend(file.laxity.iter().map(|(name, path)| (format!("laxity.{name}"), path.clone())));
    named.extend(file.passive.iter().map(|(name, path)| (format!("passive.{name}"), path.clone())));
    named
}

fn check_path(key: &str, path: &str) -> Result<(), StageError> {
    let drive = path.as_bytes().get(1) == Some(&b':');
    let wrong = if path.trim().is_empty() {
        "is empty"
    } else if path.starts_with('/') || path.starts_with('\\') || drive {
        "is an absolute path"
    } else if path.contains('\\') {
        "has backslashes (write / in paths)"
    } else if path.split('/').any(|part| part == "..") {
        "leads out of the specimen directory"
    } else {
        return Ok(());
    };
    Err(StageError::specimen(format!(
        "{key} = \"{path}\" {wrong}; expected a path inside the specimen directory: copy the file there"
    )))
}

/// Checks that a specimen names one source of bones and one of cartilage.
fn check_sources(file: &SpecimenFile) -> Result<(), StageError> {
    let refuse = |what: &str| Err(StageError::specimen(what));
    let named: Vec<&str> = [
        ("[scans]", file.scans.is_some()),
        ("[segmentation]", file.segmentation.is_some()),
        ("[cartilage]", file.cartilage.is_some()),
    ]
    .into_iter()
    .filter_map(|(name, there)| there.then_some(name))
    .collect();
    match named[..] {
        [] => {
            return refuse(
                "nothing shows cartilage; expected one of [scans] (surface scans), [segmentation] (a label map) or [cartilage] (surfaces)",
            );
        }
        [_] => {}
        _ => {
            return refuse(&format!(
                "{} are both given; expected one: keep the one to build from",
                named.join(" and ")
            ));
        }
    }
    if file.ct.is_empty() && file.segmentation.is_none() {
        return refuse("nothing shows the bones; expected [ct] femur and tibfib (surfaces), or volume");
    }
    if let Some(c) = &file.cartilage {
        let bones = c.femur_bone.is_some() as usize + c.tibfib_bone.is_some() as usize;
        if c.frame == CartilageFrame::Mri && bones != 2 {
            return refuse(
                "cartilage.frame is mri; expected femur_bone and tibfib_bone, the bones by which it is registered to those of [ct]",
            );
        }
    }
    Ok(())
}
