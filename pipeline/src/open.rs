//! `open`: a report, or the page of a plan or a diagnosis, in the browser.

use crate::diagnosis_files::DIAGNOSIS;
use crate::error::BuildError;
use crate::report::{REPORT, STOPPED};
use crate::suggested::command_on;
use crate::{inspect, store};
use std::path::{Path, PathBuf};

/// Opens the report, or the page of a plan, in or below `dir`, with `view` at the knee that can be pulled at; gives the words to print.
pub fn open(dir: &Path, print: bool, view: bool) -> Result<String, BuildError> {
    let page = page_of(dir)?;
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
        return Err(BuildError::File(format!("{} has no knee to pull at: {}", page.display(), why_without(page))));
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

/// Why a page has no live view, and what to do.
fn why_without(page: &Path) -> &'static str {
    let beside = |name: &str| page.parent().is_some_and(|folder| store::exists(&folder.join(name)));
    if page.ends_with(ONE_PLAN) {
        "the page says why, under \"Pull at the knee\""
    } else if page.ends_with(MANY_PLANS) {
        "it is of many plans; the page of one has it: plan the choice without --sweep, and open that folder"
    } else if beside(DIAGNOSIS) {
        "a surface that its model names is not there as triangles"
    } else {
        "its build was not calibrated; give laxity, and build to stage calibrate or farther"
    }
}

/// What a page with a live view has.
const LIVE: &str = "id=\"live-module\"";
/// The page of a plan's folder.
const ONE_PLAN: &str = "plan.html";
/// The page of a folder with many plans.
const MANY_PLANS: &str = "sweep.html";

/// The page of a folder. Of a build or a diagnosis: report.html, or what stands beside it where the last run came less far. Of a plan: plan.html; of many: sweep.html.
fn page_of(dir: &Path) -> Result<PathBuf, BuildError> {
    let last = |folder: &Path| [STOPPED, REPORT].map(|name| folder.join(name)).into_iter().find(|p| store::exists(p));
    if let Some(page) = last(dir) {
        return Ok(page);
    }
    let build = match inspect::build_folder(dir) {
        Ok(build) => build,
        // a plan may lie in a knee's folder: the knee's own report goes before it
        Err(why) => {
            let mut pages = [ONE_PLAN, MANY_PLANS].map(|name| dir.join(name)).into_iter();
            return pages.find(|page| store::exists(page)).ok_or(why);
        }
    };
    last(&build).ok_or_else(|| {
        let page = build.join(REPORT);
        BuildError::of_file(&page, format!("no {}; write it: {}", page.display(), command_on("report", dir)))
    })
}
