//! Which model is meant by a path: a model.json, its folder, or the folder of a build or specimen. Of a build the best known is taken: the joint
//! calibration, else that to the one data set, else the assembled model.

use crate::again::building_again;
use crate::error::BuildError;
use crate::record::{hash, records};
use crate::store;
use crate::suggested::{command_on, quoted};
use clap::Args;
use sim::spec::ModelSpec;
use std::path::{Path, PathBuf};

/// Which model of a build is wanted; nothing said: the best known.
#[derive(Args, Clone, Debug, Default)]
pub struct WhichModel {
    /// Of a build: the assembled model, before any calibration
    #[arg(long, conflicts_with = "source")]
    pub as_assembled: bool,
    /// Of a build: the model calibrated to this data set alone, or "joint"
    #[arg(long, value_name = "NAME")]
    pub source: Option<String>,
}

/// Name of the calibration to all data sets together.
pub const JOINT: &str = "joint";
const ASSEMBLED: &str = "09-assemble/model.json";
const CALIBRATED: &str = "10-calibrate";

/// The model.json that a path means.
pub fn chosen(path: &Path, which: &WhichModel) -> Result<PathBuf, BuildError> {
    let is_asked = which.as_assembled || which.source.is_some();
    let own = path.join("model.json");
    if !store::is_folder(path) || store::exists(&own) {
        if is_asked {
            return Err(BuildError::Usage(format!(
                "{} is one model; --as-assembled and --source choose among those of a build, so give its folder",
                path.display()
            )));
        }
        return Ok(if store::is_folder(path) { own } else { path.to_path_buf() });
    }
    let builds = [path.join("build"), path.to_path_buf()];
    let is_build = |b: &&PathBuf| store::exists(&b.join(ASSEMBLED)) || store::is_folder(&b.join(CALIBRATED));
    let Some(build) = builds.iter().find(is_build) else {
        let of_stage = path.parent().filter(|build| store::exists(&build.join("log.jsonl")));
        let advice = match of_stage {
            Some(build) => format!("it is a stage of a build, so give the build's folder: {}", quoted(build)),
            None if store::exists(&path.join("specimen.toml")) => {
                format!("expected model.json there, or a build with {ASSEMBLED}: {}", command_on("build", path))
            }
            None => format!("expected model.json there, a build with {ASSEMBLED}, or a specimen's folder with one"),
        };
        return Err(BuildError::of_file(path, format!("no model in {}; {advice}", path.display())));
    };
    let calibrated = if which.as_assembled { None } else { best(build, which.source.as_deref())? };
    match calibrated {
        Some(file) => unless_outdated(build, file),
        None => of_this_run(build, "assemble", build.join(ASSEMBLED)),
    }
}

/// The calibrated model of a build that is wanted, or the best one; `None` where there is none.
fn best(build: &Path, source: Option<&str>) -> Result<Option<PathBuf>, BuildError> {
    let folder = build.join(CALIBRATED);
    let file = |name: &str| folder.join(name).join("model.json");
    let names: Vec<String> = store::list(&folder).into_iter().filter(|n| store::exists(&file(n))).collect();
    match source {
        Some(name) if names.iter().any(|n| n == name) => Ok(Some(file(name))),
        Some(name) => {
            let have =
                if names.is_empty() { "it is not calibrated".into() } else { format!("it has {}", names.join(", ")) };
            Err(BuildError::of_file(build, format!("{}: no model calibrated to \"{name}\"; {have}", build.display())))
        }
        None if names.iter().any(|n| n == JOINT) => Ok(Some(file(JOINT))),
        None if names.len() < 2 => Ok(names.first().map(|n| file(n))),
        None => Err(BuildError::of_file(
            build,
            format!(
                "{}: calibrated to {} each by itself, not jointly; choose one by --source NAME, or --as-assembled",
                build.display(),
                names.join(", ")
            ),
        )),
    }
}

/// A model of a build, unless the log says that its stage is of an earlier run: the surfaces it names may be others by now.
pub(crate) fn of_this_run(build: &Path, stage: &str, file: PathBuf) -> Result<PathBuf, BuildError> {
    let log = if store::exists(&build.join("log.jsonl")) { records(build)? } else { Vec::new() };
    if !log.iter().any(|r| r.stage == stage && r.outdated) {
        return Ok(file);
    }
    let assembled = if stage == "assemble" { "" } else { ", or take --as-assembled" };
    Err(BuildError::of_file(
        &file,
        format!(
            "{} is of an earlier run: the build was changed since, and the last run did not come so far; go on ({}){assembled}",
            file.display(),
            building_again(build)
        ),
    ))
}

/// A calibrated model of a build, unless the build's assembled model is another by now.
fn unless_outdated(build: &Path, file: PathBuf) -> Result<PathBuf, BuildError> {
    let assembled = build.join(ASSEMBLED);
    let from = serde_json::from_str::<ModelSpec>(&store::read_text(&file)?).ok().and_then(|s| s.calibrated);
    let now = if store::exists(&assembled) { Some(hash(&store::read(&assembled)?)) } else { None };
    match (from, now) {
        (Some(from), Some(now)) if from.from != now => Err(BuildError::of_file(
            &file,
            format!(
                "{} was calibrated from another model than {} is now; build again ({}), or take --as-assembled",
                file.display(),
                assembled.display(),
                building_again(build)
            ),
        )),
        _ => of_this_run(build, "calibrate", file),
    }
}

/// What a model is, in words: "calibrated to kla and rks together", "assembled, not calibrated".
pub fn standing(spec: &ModelSpec) -> String {
    let is_built = spec.uncertainty.as_ref().is_some_and(|_| spec.protocols.is_empty());
    match &spec.calibrated {
        Some(c) if c.to.len() > 1 => format!("calibrated to {} together", c.to.join(" and ")),
        Some(c) => format!("calibrated to {}", c.to.join(", ")),
        None if is_built => "assembled, not calibrated".into(),
        None => "as given".into(),
    }
}
