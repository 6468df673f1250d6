//! Finished parts of a stage at work, on disk until the whole stage is: an interrupted build takes them up.

use crate::error::BuildError;
use crate::record::hash;
use crate::store::{self, BuildFolder};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A part as it is kept: only what has its digest and its stage's key is taken for whole.
#[derive(Serialize, Deserialize)]
struct Part {
    name: String,
    key: String,
    digest: String,
    value: Vec<u8>,
}

/// What files of parts begin with.
const LEAD: &str = ".part-";

/// The file of a part; what a name has beside letters, digits, - and _ is told by its digest.
fn file(stage: &str, name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    match name.chars().all(plain) {
        true => format!("{LEAD}{stage}-{name}.cbor"),
        false => format!("{LEAD}{stage}-{}.cbor", hash(name.as_bytes())),
    }
}

/// A part that an interrupted run finished; `None` where there is none, or one of other inputs, options or programs.
pub(super) fn taken<T: DeserializeOwned>(folder: &BuildFolder, stage: &str, name: &str, key: &str) -> Option<T> {
    let bytes = folder.read_file(&file(stage, name))?;
    let part: Part = ciborium::from_reader(bytes.as_slice()).ok()?;
    let whole = part.name == name && part.key == key && part.digest == hash(&part.value);
    if whole { ciborium::from_reader(part.value.as_slice()).ok() } else { None }
}

/// Keeps a part.
pub(super) fn keep<T: Serialize>(
    folder: &BuildFolder,
    stage: &'static str,
    name: &str,
    key: &str,
    value: &T,
) -> Result<(), BuildError> {
    let bytes = |value: &dyn Fn(&mut Vec<u8>) -> Result<(), String>| {
        let mut out = Vec::new();
        value(&mut out).map_err(|e| BuildError::stage(stage, e)).map(|()| out)
    };
    let value = bytes(&|out| ciborium::into_writer(value, out).map_err(|e| e.to_string()))?;
    let part = Part { name: name.to_owned(), key: key.to_owned(), digest: hash(&value), value };
    folder.write_file(&file(stage, name), &bytes(&|out| ciborium::into_writer(&part, out).map_err(|e| e.to_string()))?)
}

/// Removes the parts of a stage: it is done, or begins anew.
pub(crate) fn discard(folder: &BuildFolder, stage: &str) {
    let lead = format!("{LEAD}{stage}-");
    for name in store::list(folder.path()).iter().filter(|n| n.starts_with(&lead)) {
        store::discard(&folder.path().join(name));
    }
}

/// How many parts of a stage at work are kept below a build's folder, by stage.
pub(crate) fn kept(folder: &std::path::Path) -> Vec<String> {
    let names = store::list(folder).into_iter();
    names.filter_map(|n| Some(n.strip_prefix(LEAD)?.strip_suffix(".cbor")?.replacen('-', " ", 1))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_taken_by_its_own_key_and_only_whole() {
        let place = tempfile::TempDir::new().unwrap();
        let folder = BuildFolder::open(place.path()).unwrap();
        let take = |name: &str, key: &str| taken::<Vec<f64>>(&folder, "calibrate", name, key);
        for name in ["kla", "a/b c"] {
            keep(&folder, "calibrate", name, "k", &vec![1.5, 2.5]).unwrap();
            assert_eq!(take(name, "k"), Some(vec![1.5, 2.5]));
            assert_eq!(take(name, "other"), None);
        }
        assert_eq!(kept(place.path()).len(), 2);
        assert!(kept(place.path()).contains(&"calibrate kla".to_owned()));
        // cut short, or with a byte turned
        let name = file("calibrate", "kla");
        let bytes = folder.read_file(&name).unwrap();
        for end in [0, 1, bytes.len() / 2, bytes.len() - 1] {
            folder.write_file(&name, &bytes[..end]).unwrap();
            assert_eq!(take("kla", "k"), None);
        }
        let mut turned = bytes.clone();
        *turned.last_mut().unwrap() ^= 1;
        folder.write_file(&name, &turned).unwrap();
        assert_eq!(take("kla", "k"), None);
        discard(&folder, "validate");
        assert_eq!(kept(place.path()).len(), 2);
        discard(&folder, "calibrate");
        assert!(kept(place.path()).is_empty());
    }
}
