//! What a public record holds: its files with sizes and checksums, and its licence (Zenodo's records).

use crate::error::BuildError;
use serde_json::Value;

/// A file of a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RecordFile {
    /// Its name.
    pub(super) name: String,
    /// Its size [bytes].
    pub(super) size: u64,
    /// Its MD5 sum, hexadecimal.
    pub(super) md5: String,
    /// Where it is had.
    pub(super) url: String,
}

/// A record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Record {
    /// Its title.
    pub(super) title: String,
    /// Its licence; `None` where it states none.
    pub(super) licence: Option<String>,
    /// Its files.
    pub(super) files: Vec<RecordFile>,
}

/// Reads a record's description.
pub(super) fn parse(url: &str, bytes: &[u8]) -> Result<Record, BuildError> {
    let wrong = |why: String| BuildError::File(format!("{url}: {why}; expected a public record's description"));
    let value: Value = serde_json::from_slice(bytes).map_err(|e| wrong(format!("no JSON ({e})")))?;
    let text = |v: &Value| v.as_str().map(str::to_owned);
    let metadata = &value["metadata"];
    let licence =
        [&metadata["license"]["id"], &metadata["license"], &metadata["rights"][0]["id"]].into_iter().find_map(text);
    let title = text(&metadata["title"]).unwrap_or_default();
    let listed = value["files"].as_array().ok_or_else(|| wrong("it lists no files".into()))?;
    let files = listed
        .iter()
        .map(|f| file(f).ok_or_else(|| wrong(format!("a file without name, size, md5 or link: {f}"))))
        .collect::<Result<Vec<_>, _>>()?;
    if let Some(odd) = files.iter().find(|f| !plain(&f.name)) {
        return Err(wrong(format!("a file called {:?}, which leads out of the folder", odd.name)));
    }
    Ok(Record { title, licence, files })
}

fn file(value: &Value) -> Option<RecordFile> {
    let text = |v: &Value| v.as_str().map(str::to_owned);
    let md5 = value["checksum"].as_str()?.strip_prefix("md5:")?.to_ascii_lowercase();
    (md5.len() == 32 && md5.bytes().all(|b| b.is_ascii_hexdigit())).then_some(())?;
    let url = [&value["links"]["self"], &value["links"]["download"], &value["links"]["content"]]
        .into_iter()
        .find_map(text)?;
    Some(RecordFile { name: text(&value["key"])?, size: value["size"].as_u64()?, md5, url })
}

/// A name in the folder itself or below it.
fn plain(name: &str) -> bool {
    let part = |p: &str| !p.is_empty() && p != "." && p != ".." && !p.starts_with(".tmp-");
    !name.contains(['\\', ':', '\0']) && name.split('/').all(part)
}
