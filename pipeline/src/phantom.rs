//! `phantom`: writes a synthetic specimen.

use crate::error::BuildError;
use crate::store;
use std::path::Path;

/// Writes the phantom `id` to `dir`; gives the words to print.
pub fn write(id: &str, seed: u64, volume: bool, dir: &Path) -> Result<String, BuildError> {
    let files = if volume { stages::phantom::phantom_volume(id, seed) } else { stages::phantom::phantom(id, seed) };
    let files = files.map_err(|e| BuildError::stage("phantom", e))?.files;
    let same = store::read_text(&dir.join("specimen.toml")).is_ok_and(|t| t.contains(&format!("id = \"{id}\"")));
    if !store::list(dir).is_empty() && !same {
        return Err(BuildError::File(format!("{} is not empty; give a new folder", dir.display())));
    }
    store::write_all(dir, &files)?;
    Ok(format!("A synthetic knee, {id}, is in {0}. Build its model: build-model {0}\n", dir.display()))
}
