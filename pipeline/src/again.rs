//! The command that builds again what lies in a build's folder.

use crate::store;
use crate::suggested::{command, command_on};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The command that builds again what lies in `build`; in words where the specimen lies elsewhere.
pub fn building_again(build: &Path) -> String {
    match specimen_of(build) {
        Some(specimen) if build.file_name().is_some_and(|n| n == "build") => command_on("build", &specimen),
        Some(specimen) => command("build", [specimen.as_os_str(), OsStr::new("--out"), build.as_os_str()]),
        None => format!("the command that made {}", build.display()),
    }
}

/// The specimen of a build: the folder that holds it, where it is one.
fn specimen_of(build: &Path) -> Option<PathBuf> {
    let parent = match build.parent()? {
        parent if parent == Path::new("") => PathBuf::from("."),
        parent => parent.to_path_buf(),
    };
    Some(parent).filter(|place| store::exists(&place.join("specimen.toml")))
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "tests prepare files")]
mod tests {
    use super::*;

    #[test]
    fn a_build_is_made_again_from_the_folder_that_holds_it() {
        let folder = tempfile::TempDir::new().unwrap();
        let specimen = folder.path().join("my knee");
        std::fs::create_dir_all(&specimen).unwrap();
        let build = specimen.join("build");
        assert!(!building_again(&build).contains("build-model"), "no specimen there");
        std::fs::write(specimen.join("specimen.toml"), "").unwrap();
        assert_eq!(building_again(&build), command_on("build", &specimen));
        let other = specimen.join("other");
        assert!(building_again(&other).contains("--out"), "{}", building_again(&other));
    }
}
