//! `open`: a report in the browser.

use crate::error::BuildError;
use crate::suggested::command_on;
use crate::{inspect, store};
use std::path::{Path, PathBuf};

/// Opens the report in or below `dir`, with `view` at the knee that can be pulled at; gives the words to print.
pub fn open(dir: &Path, print: bool, view: bool) -> Result<String, BuildError> {
    let page = report(dir)?;
    let place = if view { Some(address(&page)?) } else { None };
    let told = format!("{}\n", place.clone().unwrap_or_else(|| page.display().to_string()));
    if print {
        return Ok(told);
    }
    let page = store::absolute(&page)?;
    let opened = match &place {
        Some(address) => open::that_detached(address),
        None => open::that_detached(&page),
    };
    opened.map_err(|e| {
        BuildError::of_file(&page, format!("no browser could be started ({e}); open this in one: {}", told.trim_end()))
    })?;
    Ok(told)
}

/// The address of a report's live view; a fragment needs an address, not a path.
fn address(page: &Path) -> Result<String, BuildError> {
    if !store::read_text(page)?.contains(LIVE) {
        return Err(BuildError::File(format!(
            "{} has no knee to pull at: its build was not calibrated; give laxity, and build to stage calibrate or farther",
            page.display()
        )));
    }
    let mut out = "file://".to_owned();
    for byte in store::absolute(page)?.to_string_lossy().bytes() {
        match byte {
            b'/' | b'.' | b'-' | b'_' | b'~' => out.push(byte.into()),
            _ if byte.is_ascii_alphanumeric() => out.push(byte.into()),
            _ => out += &format!("%{byte:02X}"),
        }
    }
    Ok(out + "#live&")
}

/// What a page with a live view has.
const LIVE: &str = "id=\"live-module\"";

/// report.html of a build or a diagnosis.
fn report(dir: &Path) -> Result<PathBuf, BuildError> {
    let beside = dir.join("report.html");
    if store::exists(&beside) {
        return Ok(beside);
    }
    let page = inspect::build_folder(dir)?.join("report.html");
    match store::exists(&page) {
        true => Ok(page),
        false => {
            Err(BuildError::of_file(&page, format!("no {}; write it: {}", page.display(), command_on("report", dir))))
        }
    }
}
