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

/// Further names that a later stage reads.
const OTHERS: [&str; 3] = ["eminence_medial", "eminence_lateral", "tibial_tuberosity"];
/// Landmarks of frame ct from which on a table of which none is read is told: one or two may be there for another program.
const LEAST_UNREAD: usize = 3;

/// What is told where nothing reads any landmark of frame ct: none has a name that is read, and none has its pair in a scan.
pub(super) fn none_read(path: &str, all: &[NamedPoint]) -> Option<Notice> {
    let own: Vec<&NamedPoint> = all.iter().filter(|p| p.frame == PointFrame::Ct).collect();
    let read = |p: &&&NamedPoint| {
        let named = KNOWN.iter().any(|k| k.0 == p.name) || OTHERS.contains(&p.name.as_str());
        named || all.iter().any(|q| q.frame != PointFrame::Ct && q.name == p.name)
    };
    let first = own.first().filter(|_| own.len() >= LEAST_UNREAD && own.iter().filter(read).count() == 0)?;
    let names: Vec<&str> = KNOWN.iter().map(|k| k.0).collect();
    Some(
        Kind::LandmarkName
            .notice(format!(
                "{path}: nothing reads any of its {} landmarks of frame ct, the first `{}`: none has a name of those that frames build on ({}), and none has a fellow of its name in a scan",
                own.len(),
                first.name,
                names.join(", ")
            ))
            .file(path)
            .count(own.len()),
    )
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
