//! A file that arrives in parts: under another name until it is whole.

use super::{fault, remove, words};
use crate::error::{BuildError, Place};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// A file on its way, `NAME.part`, which outlives an interruption.
pub struct PartFile {
    target: PathBuf,
    place: PathBuf,
    file: File,
    length: u64,
}

impl PartFile {
    /// Takes up what an earlier attempt left, or begins.
    pub fn take_up(target: &Path) -> Result<PartFile, BuildError> {
        let wrong = |e: std::io::Error| cannot("write", target, &e);
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(wrong)?;
        }
        let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let place = target.with_file_name(format!("{name}.part"));
        let file = File::options().create(true).append(true).open(&place).map_err(wrong)?;
        file.try_lock().map_err(|_| {
            let told = format!("another build-model is fetching {}; wait for it", target.display());
            BuildError::Machine { told, place: Some(Place::of(target)) }
        })?;
        let length = file.metadata().map_err(wrong)?.len();
        Ok(PartFile { target: target.to_path_buf(), place, file, length })
    }

    /// Bytes that are there.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) -> Result<(), BuildError> {
        self.file.write_all(bytes).map_err(|e| cannot("write", &self.place, &e))?;
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Begins anew.
    pub fn restart(&mut self) -> Result<(), BuildError> {
        self.file.set_len(0).map_err(|e| cannot("write", &self.place, &e))?;
        self.length = 0;
        Ok(())
    }

    /// Gives the content to `see`, in pieces.
    pub fn each(&self, see: impl FnMut(&[u8])) -> Result<(), BuildError> {
        pieces(&self.place, see)
    }

    /// The file is whole and takes its name.
    pub fn finish(self) -> Result<(), BuildError> {
        let result = self.file.sync_all().and_then(|()| fs::rename(&self.place, &self.target));
        result.map_err(|e| cannot("write", &self.target, &e))
    }

    /// The file is worthless and goes.
    pub fn discard(self) {
        remove(&self.place);
    }
}

/// What hinders work on a file: most often the machine.
fn cannot(what: &str, path: &Path, e: &std::io::Error) -> BuildError {
    fault(e, path, format!("cannot {what} {}: {}", path.display(), words(e)))
}

/// Gives a file's content to `see`, in pieces.
pub fn pieces(path: &Path, mut see: impl FnMut(&[u8])) -> Result<(), BuildError> {
    let wrong = |e: std::io::Error| cannot("read", path, &e);
    let mut file = File::open(path).map_err(wrong)?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer).map_err(wrong)? {
            0 => return Ok(()),
            n => see(&buffer[..n]),
        }
    }
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_and_a_lock_are_the_machines_fault() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("data.zip");
        let _at_work = PartFile::take_up(&target).unwrap();
        let locked = PartFile::take_up(&target).err().unwrap();
        // every write to this device finds the disk full
        let full = folder.path().join("full.zip");
        std::os::unix::fs::symlink("/dev/full", folder.path().join("full.zip.part")).unwrap();
        let refused = PartFile::take_up(&full).unwrap().add(b"bytes").unwrap_err();
        for error in [locked, refused] {
            assert!(error.exit_status() == 3 && error.place().is_some(), "{error}");
        }
    }
}
