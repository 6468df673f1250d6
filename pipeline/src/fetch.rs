//! `fetch`: the published data sets from their public records.

mod download;
mod place;
mod record;

use crate::error::BuildError;
use crate::store;
use serde::Deserialize;
use sim::names::did_you_mean;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// data/records.toml.
const RECORDS: &str = include_str!("../../data/records.toml");
/// Where the records are served.
const SERVER: &str = "https://zenodo.org";

#[derive(Deserialize)]
struct Sets {
    set: Vec<Set>,
}

/// A published specimen.
#[derive(Clone, Debug, Deserialize)]
struct Set {
    id: String,
    side: String,
    records: Vec<String>,
}

/// Downloads the data set `id` to `dir`; gives the words to print.
///
/// Every file is checked against its record's size and checksum and takes its name only then; an interrupted download goes on
/// where it was. `mirror` serves the records in place of their own server; `patience` is how long one answer may take [s].
pub fn fetch(id: &str, dir: &Path, mirror: Option<&str>, patience: u64) -> Result<String, BuildError> {
    let sets: Sets = toml::from_str(RECORDS).map_err(|e| BuildError::File(format!("data/records.toml: {e}")))?;
    let Some(set) = sets.set.iter().find(|s| s.id == id) else {
        let known = sets.set.iter().map(|s| s.id.as_str()).collect::<Vec<_>>().join(", ");
        return Err(BuildError::Usage(format!(
            "no published data set is called {id}{}; expected one of {known}",
            did_you_mean(id, sets.set.iter().map(|s| s.id.as_str()))
        )));
    };
    let others: Vec<&str> = sets.set.iter().map(|s| s.id.as_str()).filter(|s| *s != id).collect();
    let server = mirror.unwrap_or(SERVER).trim_end_matches('/');
    let agent = download::agent(patience.max(1));
    let mut text = String::new();
    let mut notice = String::new();
    let mut have: Vec<PathBuf> = Vec::new();
    for number in &set.records {
        let url = format!("{server}/api/records/{number}");
        let record = record::parse(&url, &download::text(&agent, &url)?)?;
        let licence = record.licence.as_deref().unwrap_or("none stated: ask its authors before you pass anything on");
        let _ = writeln!(notice, "{}\n  {SERVER}/records/{number}\n  licence: {licence}", record.title);
        store::write(&dir.join("LICENCE.txt"), notice.as_bytes())?;
        for file in record.files.iter().filter(|f| concerns(&f.name, id, &others)) {
            let place = PathBuf::from("records").join(number).join(&file.name);
            let from = match mirror {
                Some(mirror) => on_mirror(&file.url, mirror),
                None => file.url.clone(),
            };
            let new = download::file(&agent, file, &from, &dir.join(&place))?;
            let _ =
                writeln!(text, "{} {} ({} bytes)", if new { "fetched" } else { "have" }, place.display(), file.size);
            have.push(place);
        }
    }
    let _ = writeln!(text, "\n{notice}The licence notice is {}.", dir.join("LICENCE.txt").display());
    Ok(text + &place::specimen(id, &set.side, dir, &have)?)
}

/// Whether a file is of the specimen `id` or of all.
fn concerns(name: &str, id: &str, others: &[&str]) -> bool {
    name.contains(id) || !others.iter().any(|other| name.contains(other))
}

/// The same path on another server.
fn on_mirror(url: &str, mirror: &str) -> String {
    let path = url.split_once("://").map_or(url, |(_, rest)| rest);
    let path = path.split_once('/').map_or("", |(_, path)| path);
    format!("{}/{path}", mirror.trim_end_matches('/'))
}
