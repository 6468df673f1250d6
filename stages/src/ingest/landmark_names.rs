//! Names of landmarks that frames build on: known in any case and with any mark between their words, and told where only nearly known.

use crate::StageError;
use crate::specimen::{NamedPoint, PointFrame};
use notices::{Kind, Notice};
use sim::names::nearest;

/// Names that a frame reads, each with words of other names that mean the same.
const KNOWN: [(&str, &[&[&str]]); 5] = [
    ("femoral_head_center", &[&["head"], &["hip"], &["fhc"]]),
    ("epicondyle_medial", &[&["epicondyle", "medial"], &["epicondyle", "med"], &["mec"], &["me"]]),
    ("epicondyle_lateral", &[&["epicondyle", "lateral"], &["epicondyle", "lat"], &["lec"], &["le"]]),
    ("ankle_center", &[&["ankle"], &["talus"], &["plafond"]]),
    ("tibial_shaft_distal", &[&["tibial", "shaft"], &["tibia", "shaft"]]),
];

/// Names in small letters, with one `_` between words.
fn plain(name: &str) -> String {
    let apart: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { ' ' }).collect();
    apart.to_lowercase().split_whitespace().collect::<Vec<_>>().join("_")
}

/// Which known name another one means, by its words or its letters.
fn meant(name: &str) -> Option<&'static str> {
    let plain = plain(name);
    let words: Vec<&str> = plain.split('_').collect();
    let says = |(known, others): &(&'static str, &[&[&str]])| {
        others.iter().any(|o| o.iter().all(|w| words.contains(w))).then_some(*known)
    };
    KNOWN.iter().find_map(says).or_else(|| nearest(&plain, KNOWN.map(|k| k.0)))
}

/// Takes names that are known but for their writing, and tells those that nothing reads though they are near a known one.
///
/// # Errors
/// Two writings of one name.
pub(super) fn settle(path: &str, all: &mut [NamedPoint], warnings: &mut Vec<Notice>) -> Result<(), StageError> {
    for k in 0..all.len() {
        let written = plain(&all[k].name);
        let Some((known, _)) = KNOWN.iter().find(|n| n.0 == written && n.0 != all[k].name) else { continue };
        let twice = all.iter().any(|p| p.name == *known && p.frame == all[k].frame);
        if twice {
            return Err(StageError::file(
                path,
                format_args!("`{}` and `{known}` are one landmark; keep one", all[k].name),
            ));
        }
        (*known).clone_into(&mut all[k].name);
    }
    let ct = |name: &str| all.iter().any(|p| p.frame == PointFrame::Ct && p.name == name);
    let unread = all.iter().filter(|p| p.frame == PointFrame::Ct && !KNOWN.iter().any(|k| k.0 == p.name));
    for p in unread {
        // a pair of CT and scan is for the registration, whatever its name
        let paired = all.iter().any(|q| q.frame != PointFrame::Ct && q.name == p.name);
        if let Some(known) = meant(&p.name).filter(|known| !paired && !ct(known)) {
            warnings.push(
                Kind::LandmarkName
                    .notice(format!(
                        "{path}: nothing reads the landmark `{}` of frame ct; did you mean {known}? Expected that name",
                        p.name
                    ))
                    .file(path)
                    .of(&p.name),
            );
        }
    }
    Ok(())
}
