//! `cohort`: many builds on one page and in tidy tables.

use crate::error::BuildError;
use crate::store;
use crate::suggested::command;
use crate::told::{Told, schemas};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

mod dependent;
mod infer;
mod knee;
mod outliers;
mod page;
mod quantity;
mod regions;
pub(crate) mod shared;
mod table;
mod tables;

pub use dependent::{Dependence, DependentTold};
pub use infer::InferTold;
use knee::{Knee, Status};
use outliers::Outlier;

/// `build-model cohort`.
#[derive(Args, Clone, Debug)]
pub struct CohortArgs {
    /// Folders of builds, or of the specimens that hold them. `infer` before them: what the others say of each knee, as a prior for its calibration
    #[arg(required = true, value_name = "BUILD")]
    pub builds: Vec<PathBuf>,
    /// Folder for cohort.html and the tables (CSV and Parquet); after `infer` for the priors and infer.csv
    #[arg(long)]
    pub out: PathBuf,
}

/// `cohort --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CohortTold {
    /// cohort/1
    pub schema: &'static str,
    /// Every knee, in the order given.
    pub knees: Vec<KneeTold>,
    /// Why knees are not independent of each other; empty where they are.
    pub dependent: Vec<DependentTold>,
    /// The page and the tables.
    pub files: Vec<String>,
}

/// A knee of a cohort.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct KneeTold {
    /// Its name in the cohort.
    pub knee: String,
    /// The specimen's own name.
    pub specimen: String,
    /// built or failed.
    pub status: String,
    /// Where and why its build stopped; null where it did not.
    pub failed: Option<FailedTold>,
    /// The last stage that stands; null where none does.
    pub last_stage: Option<String>,
    /// How many warnings its build has.
    pub warnings: usize,
    /// In what it stands out of the cohort, a sentence each.
    pub outliers: Vec<String>,
    /// Its report; null where there is none.
    pub report: Option<String>,
}

/// What stopped a build.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FailedTold {
    /// The stage.
    pub stage: String,
    /// Why, and what to do.
    pub message: String,
}

/// Reads every build and writes the page and the tables; gives the words to print.
///
/// A build that failed, or is not there, is a row like any other. Errors: no build at all, files that cannot be written.
pub fn cohort(args: &CohortArgs) -> Result<Told, BuildError> {
    // a folder of that name is ./infer
    if let Some((_, builds)) = args.builds.split_first().filter(|(first, _)| *first == Path::new(INFER)) {
        return infer::infer(builds, &args.out);
    }
    let knees: Vec<Knee> =
        names(&args.builds).iter().zip(&args.builds).map(|(n, place)| Knee::read(n, place)).collect();
    if knees.iter().all(|k| k.folder.is_none()) {
        let first = args.builds.first().map(|p| p.display().to_string()).unwrap_or_default();
        let given = match knees.len() {
            1 => first,
            n => format!("any of the {n} folders given ({first}, ...)"),
        };
        return Err(BuildError::File(format!(
            "no build in {given}: no log.jsonl or failure.json there or in build/; build them first: {}",
            command("build", args.builds.first())
        )));
    }
    if let Some((a, b)) = twice(&knees) {
        let (a, b) = (args.builds[a].display(), args.builds[b].display());
        return Err(BuildError::Usage(format!("{a} and {b} are one build; expected each knee once")));
    }
    let outliers = outliers::outliers(&knees);
    let dependent = dependent::dependent(&knees);
    let out = store::make_folder(&args.out)?;
    let mut files = Vec::new();
    let tables = tables::tables(&knees, &outliers);
    for table in &tables {
        files.extend(table.files()?);
    }
    files.push(("cohort.html".to_owned(), page::page(&knees, (&outliers, &dependent), &tables, &out).into_bytes()));
    store::write_all(&out, &files)?;
    let printed = words(&knees, (&outliers, &dependent), &out);
    Ok(Told::words(printed).with(&as_data(&knees, (&outliers, dependent), &files, &out)))
}

/// The word that asks for a shared prior in place of the page.
const INFER: &str = "infer";

/// Two of the knees that are one build; it would weigh twice among the others.
fn twice(knees: &[Knee]) -> Option<(usize, usize)> {
    let mut places: BTreeMap<PathBuf, usize> = BTreeMap::new();
    let whole = |k: &Knee| k.folder.as_ref().and_then(|f| f.canonicalize().ok());
    let known = |(n, place)| places.insert(place, n).map(|first| (first, n));
    knees.iter().enumerate().filter_map(|(n, k)| Some((n, whole(k)?))).find_map(known)
}

/// What each knee is called: its folder's name, with as many folders above it as tell it from the others.
fn names(builds: &[PathBuf]) -> Vec<String> {
    let parts: Vec<Vec<String>> = builds
        .iter()
        .map(|path| {
            let whole = store::absolute(path).unwrap_or_else(|_| path.clone());
            let mut parts: Vec<String> =
                whole.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
            if parts.len() > 1 && parts.last().is_some_and(|p| p == "build") {
                parts.pop();
            }
            parts
        })
        .collect();
    let tail = |p: &[String], n: usize| p[p.len().saturating_sub(n)..].join("/");
    parts
        .iter()
        .enumerate()
        .map(|(k, own)| {
            let alone = |n: &usize| parts.iter().enumerate().all(|(j, p)| j == k || tail(p, *n) != tail(own, *n));
            let n = (1..own.len()).find(alone).unwrap_or(own.len());
            tail(own, n)
        })
        .collect()
}

/// The outliers of a knee.
fn of<'a>(outliers: &'a [Outlier], knee: &Knee) -> Vec<&'a Outlier> {
    outliers.iter().filter(|o| o.knee == knee.name).collect()
}

/// The words to print: what is odd of the cohort (outliers, then why knees are not independent) and where the page is.
fn words(knees: &[Knee], (outliers, dependent): (&[Outlier], &[DependentTold]), out: &Path) -> String {
    let mut text = String::new();
    for k in knees {
        match &k.status {
            Status::Failed { stage, message } => text += &format!("failed: {}: {stage}: {message}\n", k.name),
            Status::Built => {
                let odd = of(outliers, k);
                if let Some(first) = odd.first() {
                    text += &format!("look at: {}: {} outliers, first {}\n", k.name, odd.len(), first.words());
                }
            }
        }
    }
    dependent.iter().for_each(|told| text += &format!("not independent: {}\n", told.message));
    let failed = knees.iter().filter(|k| k.failed()).count();
    let count = if knees.len() == 1 { "1 knee".to_owned() } else { format!("{} knees", knees.len()) };
    text + &format!("{count}, {failed} failed\nLook at {}\n", out.join("cohort.html").display())
}

fn as_data(
    knees: &[Knee],
    (outliers, dependent): (&[Outlier], Vec<DependentTold>),
    files: &[(String, Vec<u8>)],
    out: &Path,
) -> CohortTold {
    let knee = |k: &Knee| KneeTold {
        knee: k.name.clone(),
        specimen: k.specimen.clone(),
        status: k.status.name().to_owned(),
        failed: match &k.status {
            Status::Failed { stage, message } => Some(FailedTold { stage: stage.clone(), message: message.clone() }),
            Status::Built => None,
        },
        last_stage: k.last_stage().map(str::to_owned),
        warnings: k.warnings().count(),
        outliers: of(outliers, k).iter().map(|o| o.words()).collect(),
        report: k.report().map(|p| p.display().to_string()),
    };
    CohortTold {
        schema: schemas::COHORT,
        knees: knees.iter().map(knee).collect(),
        dependent,
        files: files.iter().map(|(name, _)| out.join(name).display().to_string()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knees_are_called_by_what_tells_them_apart() {
        let named = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(named(&["/d/a/build", "/d/b/build"]), ["a", "b"]);
        assert_eq!(named(&["/x/a/build", "/y/a", "/y/c"]), ["x/a", "y/a", "c"]);
        assert_eq!(named(&["/build"]).len(), 1);
    }
}
