//! The command that builds again what lies in a build's folder.

use crate::store;
use crate::suggested::command;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The command that builds again what lies in `build`; in words where the specimen lies elsewhere.
pub(crate) fn building_again(build: &Path) -> String {
    building(build, &[])
}

/// [`building_again`] as far as a stage.
pub(crate) fn building_to(build: &Path, stage: &str) -> String {
    building(build, &["--to", stage])
}

fn building(build: &Path, more: &[&str]) -> String {
    let Some(specimen) = specimen_of(build) else {
        return [&["the command that made", &build.display().to_string()], more].concat().join(" ");
    };
    let mut words = vec![specimen.as_os_str()];
    if build.file_name().is_none_or(|n| n != "build") {
        words.extend([OsStr::new("--out"), build.as_os_str()]);
    }
    words.extend(more.iter().map(OsStr::new));
    command("build", words)
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
mod tests {
    use super::*;

    #[test]
    fn a_build_is_made_again_from_the_folder_that_holds_it() {
        let folder = tempfile::TempDir::new().unwrap();
        let specimen = folder.path().join("my knee");
        store::make_folder(&specimen).unwrap();
        let build = specimen.join("build");
        assert!(!building_again(&build).contains("build-model"), "no specimen there");
        store::write(&specimen.join("specimen.toml"), b"").unwrap();
        assert_eq!(building_again(&build), command("build", [&specimen]));
        assert!(building_to(&build, "diagnose").ends_with(" --to diagnose"));
        let other = specimen.join("other");
        assert!(building_again(&other).contains("--out"), "{}", building_again(&other));
    }
}
