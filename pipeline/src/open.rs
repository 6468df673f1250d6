//! `open`: a report in the browser.

use crate::error::BuildError;
use crate::quoted::quoted;
use crate::{inspect, store};
use std::path::{Path, PathBuf};

/// Opens the report in or below `dir`; gives the words to print.
pub fn open(dir: &Path, print: bool) -> Result<String, BuildError> {
    let page = report(dir)?;
    let told = format!("{}\n", page.display());
    if print {
        return Ok(told);
    }
    let page = store::absolute(&page)?;
    open::that_detached(&page).map_err(|e| {
        BuildError::of_file(
            &page,
            format!("no browser could be started ({e}); open this file in one: {}", page.display()),
        )
    })?;
    Ok(told)
}

/// report.html of a build or a diagnosis.
fn report(dir: &Path) -> Result<PathBuf, BuildError> {
    let beside = dir.join("report.html");
    if store::exists(&beside) {
        return Ok(beside);
    }
    let page = inspect::build_folder(dir)?.join("report.html");
    match store::exists(&page) {
        true => Ok(page),
        false => Err(BuildError::of_file(
            &page,
            format!("no {}; write it: build-model report {}", page.display(), quoted(dir)),
        )),
    }
}
