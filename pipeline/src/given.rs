//! What a build is given: the files of a specimen, parted by the stages that read them, so that a change of one touches no other.

use crate::error::{BuildError, Place};
use crate::kept::{Kept, Read};
use crate::record::hash;
use attachments::bundle::{BUNDLES, LIGAMENTS};
use notices::{Kind, Notice};
use serde::Serialize;
use sim::laxity::{LaxityTrial, Named, SignDoubt, Tracked};
use sim::names::{did_you_mean, is_of};
use stages::ingest::{named, paths_named_in};
use stages::specimen::{CtPaths, RawSpecimen, SpecimenFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use validation::validate::Passive;

/// The CT volume and the label map beside it: what `segment` reads.
pub struct Picture {
    /// The table `[ct]`.
    pub ct: CtPaths,
    /// The files.
    pub raw: RawSpecimen,
}

/// Surfaces, points, label maps of MRI and what specimen.toml says of them: what `ingest` reads.
pub struct Geometry {
    /// specimen.toml without options, laxity and passive flexion.
    pub file: SpecimenFile,
    /// The files.
    pub raw: RawSpecimen,
}

/// Laxity and passive flexion: what `calibrate`, `validate` and `diagnose` read.
#[derive(Serialize)]
pub struct Measured {
    /// Trials by data set.
    pub laxity: BTreeMap<String, Vec<LaxityTrial>>,
    /// Of each laxity file, by data set.
    pub digests: BTreeMap<String, String>,
    /// Bodies that were tracked, by data set: they are held against the build's bones and frames, which the reader of the file does not know.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub tracked: BTreeMap<String, Tracked>,
    /// What is odd in the files.
    pub warnings: Vec<Notice>,
}

/// Measured passive flexion: what `validate` compares with.
#[derive(Serialize)]
pub struct PassiveFlexion(pub Vec<Passive>);

/// The picture of a specimen; `None` where CT gave surfaces.
///
/// Errors: none in practice; what was read can be digested.
pub fn picture(file: &SpecimenFile, raw: &RawSpecimen) -> Result<Option<Kept<Picture>>, BuildError> {
    if file.ct.volume.is_none() {
        return Ok(None);
    }
    let names = picture_names(&file.ct, raw);
    Kept::read(Picture { ct: file.ct.clone(), raw: files_of(raw, |name| names.contains(name)) }).map(Some)
}

/// Names of the files of the CT volume and the label map, and of those that they name.
fn picture_names(ct: &CtPaths, raw: &RawSpecimen) -> BTreeSet<String> {
    let volume = ct.volume.as_deref().map(|path| path.trim_end_matches('/'));
    let named: Vec<&str> = volume.into_iter().chain(ct.labels.as_deref()).collect();
    let folder = volume.map(|path| format!("{path}/"));
    let mut names: BTreeSet<String> = BTreeSet::new();
    for (name, bytes) in &raw.files {
        if named.contains(&name.as_str()) {
            names.extend(paths_named_in(name, bytes));
        }
        if named.contains(&name.as_str()) || folder.as_ref().is_some_and(|f| name.starts_with(f)) {
            names.insert(name.clone());
        }
    }
    names
}

/// What `ingest` reads of a specimen.
///
/// Errors: none in practice; what was read can be digested.
pub fn geometry(file: &SpecimenFile, raw: &RawSpecimen) -> Result<Kept<Geometry>, BuildError> {
    let mut others = picture_names(&file.ct, raw);
    others.extend(file.laxity.values().chain(file.passive.values()).cloned());
    let mut file = file.clone();
    file.options.clear();
    file.laxity.clear();
    file.laxity_format.clear();
    file.passive.clear();
    let ours = named(&file).into_iter().filter(|(key, _)| !["ct.volume", "ct.labels"].contains(&key.as_str()));
    ours.for_each(|(_, path)| {
        others.remove(&path);
    });
    let raw = files_of(raw, |name| !others.contains(name));
    Kept::read(Geometry { file, raw })
}

/// The files whose names are wanted.
fn files_of(raw: &RawSpecimen, wanted: impl Fn(&str) -> bool) -> RawSpecimen {
    let files = raw.files.iter().filter(|(name, _)| wanted(name)).map(|(n, b)| (n.clone(), b.clone()));
    RawSpecimen { toml: String::new(), files: files.collect() }
}

/// What was measured of the knee's motion.
///
/// Errors: a file that is not there or cannot be read.
pub fn measured(file: &SpecimenFile, raw: &RawSpecimen) -> Result<(Kept<Measured>, Kept<PassiveFlexion>), BuildError> {
    let bytes = |table: &str, name: &str, path: &str| {
        raw.files.get(path).ok_or_else(|| {
            BuildError::of_file(
                Path::new(path),
                format!("specimen.toml [{table}] {name}: no file {path} in the specimen's folder"),
            )
        })
    };
    let (mut laxity, mut digests, mut tracked, mut warnings) =
        (BTreeMap::new(), BTreeMap::new(), BTreeMap::new(), Vec::new());
    for (name, path) in &file.laxity {
        let found = bytes("laxity", name, path)?;
        let format = file.laxity_format.get(name).cloned().unwrap_or_default();
        let table = sim::laxity::read_as(found, &format, file.specimen.side)
            .map_err(|e| BuildError::at(Place::in_laxity(path, &e), format!("{path}: {e}")))?;
        if let Some(what) = no_ligament(&table.trials) {
            return Err(BuildError::of_file(Path::new(path), format!("{path}: {what}")));
        }
        warnings.extend(told(path, &table));
        digests.insert(name.clone(), hash(found));
        tracked.extend(format.tracked.map(|bodies| (name.clone(), bodies)));
        let (trials, thinner) = crate::thin::thinned(table.trials);
        warnings.extend(thinner.map(|what| what.in_file(path)));
        laxity.insert(name.clone(), trials);
    }
    let sets: Vec<Named> =
        laxity.iter().map(|(name, t): (&String, &Vec<LaxityTrial>)| (name.as_str(), &t[..])).collect();
    if let Some(what) = twice(&sets) {
        return Err(BuildError::File(format!("specimen.toml [laxity]: {what}")));
    }
    warnings.extend(sim::laxity::between(&sets).into_iter().map(SignDoubt::notice));
    let mut passive = Vec::new();
    for (name, path) in &file.passive {
        passive.push(read_passive(name, path, bytes("passive", name, path)?)?);
    }
    Ok((Kept::read(Measured { laxity, digests, tracked, warnings })?, Kept::read(PassiveFlexion(passive))?))
}

/// Menisci by the names under which a trial may be without them.
const MENISCI: [&str; 2] = ["meniscus_medial", "meniscus_lateral"];

/// What is said of a ligament that a file calls cut and no built knee has; none where it has all of them.
pub fn no_ligament(trials: &[LaxityTrial]) -> Option<String> {
    let known = || BUNDLES.iter().map(|b| b.name.as_str()).chain(MENISCI);
    let fits = |name: &str| known().any(|k| is_of(k, name));
    let first = trials.first()?;
    let name = first.without.iter().find(|name| !fits(name))?;
    let near = did_you_mean(name, LIGAMENTS.iter().copied().chain(known()));
    let ligaments = LIGAMENTS.join(", ");
    Some(format!(
        "row {}, column \"without\": no ligament is called {name}{near}; expected some of {ligaments}, joined by +",
        first.row.unwrap_or(0)
    ))
}

/// What is said of a file that is given as two data sets; none where each is its own.
pub fn twice(sets: &[Named]) -> Option<String> {
    sim::laxity::repeated(sets).map(|[a, b]| {
        format!("{a} and {b} hold the same measurements: one file was given twice, which would count each reading double; name the file of each source")
    })
}

/// Warnings of a reader that a build repeats; `check` has the rest.
const REPEATED: usize = 5;

/// What a build or a diagnosis says of a laxity file: what the reader found odd, and what looks turned, zeroed or scaled.
pub(crate) fn told(path: &str, table: &sim::laxity::LaxityTable) -> Vec<Notice> {
    let doubts = sim::laxity::sign_doubts(&table.trials).into_iter().map(SignDoubt::notice);
    let mut all: Vec<Notice> = doubts.chain(table.warnings.iter().take(REPEATED).cloned()).collect();
    if table.warnings.len() > REPEATED {
        let more = table.warnings.len() - REPEATED;
        let text = format!("{more} more warnings like these; all are told by the command check");
        all.push(Kind::MoreLikeThese.notice(text).count(more));
    }
    all.into_iter().map(|w| w.in_file(path)).collect()
}

/// Measured passive flexion under its name.
///
/// Errors: a table that cannot be read.
pub fn read_passive(name: &str, file: &str, bytes: &[u8]) -> Result<Passive, BuildError> {
    let poses =
        validation::passive::read(bytes).map_err(|e| BuildError::of_file(Path::new(file), format!("{file}: {e}")))?;
    Ok(Passive { name: name.to_owned(), poses })
}

impl Read for Picture {
    fn digest(&self) -> Result<String, BuildError> {
        of_files(&self.ct, &self.raw)
    }
}

impl Read for Geometry {
    fn digest(&self) -> Result<String, BuildError> {
        of_files(&self.file, &self.raw)
    }
}

impl Read for Measured {
    fn digest(&self) -> Result<String, BuildError> {
        of_value(self)
    }
}

impl Read for PassiveFlexion {
    fn digest(&self) -> Result<String, BuildError> {
        of_value(self)
    }
}

/// One digest of a value and of files with their names.
fn of_files(value: &impl Serialize, raw: &RawSpecimen) -> Result<String, BuildError> {
    let files: BTreeMap<&str, String> = raw.files.iter().map(|(name, bytes)| (name.as_str(), hash(bytes))).collect();
    of_value(&(value, files))
}

/// The digest of a value as it would be kept.
fn of_value(value: &impl Serialize) -> Result<String, BuildError> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).map_err(|e| BuildError::File(format!("what was read: {e}")))?;
    Ok(hash(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Load;
    use sim::laxity::Test;

    #[test]
    fn what_no_built_knee_has_cannot_have_been_cut() {
        let of = |names: &[&str]| {
            let one = LaxityTrial::asked("a".into(), Test::Neutral, 30.0, Load::default());
            no_ligament(&[LaxityTrial {
                row: Some(2),
                without: names.iter().map(|n| (*n).to_owned()).collect(),
                ..one
            }])
        };
        let known = [&[][..], &["ACL"], &["ACL_AM", "PCAP"], &["meniscus_medial", "sMCL"]];
        assert!(known.iter().all(|names| of(names).is_none()));
        for (name, meant) in [("acl", "ACL"), ("MCL", "sMCL or dMCL"), ("ACLX", "ACL")] {
            let told = of(&["ALS", name]).unwrap();
            assert!(
                told.starts_with("row 2, column \"without\"") && told.contains(&format!("mean {meant}?")),
                "{told}"
            );
        }
        assert!(of(&["patella"]).is_some());
    }
}
