//! Files that are given in memory, by a caller in the same process, in place of files on a disk.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

thread_local! {
    static HERE: RefCell<Given> = RefCell::default();
}

/// Bytes by the path at which they are found.
#[derive(Clone, Debug, Default)]
pub struct Given(Arc<BTreeMap<PathBuf, Vec<u8>>>);

impl Given {
    /// Files by their paths.
    pub fn new(files: BTreeMap<PathBuf, Vec<u8>>) -> Given {
        Given(Arc::new(files))
    }

    /// From now on this thread finds these files, and no others that were given.
    pub fn here(&self) {
        HERE.with(|here| *here.borrow_mut() = self.clone());
    }
}

/// The bytes that are given at `path`.
pub(super) fn bytes(path: &Path) -> Option<Vec<u8>> {
    HERE.with(|here| here.borrow().0.get(path).cloned())
}

/// Whether a file is given at `path`.
pub(super) fn is(path: &Path) -> bool {
    HERE.with(|here| here.borrow().0.contains_key(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store;

    #[test]
    fn a_file_in_memory_is_read_where_it_was_given_and_nowhere_else() {
        let place = Path::new("no such folder/trials");
        let given = Given::new(BTreeMap::from([(place.to_path_buf(), b"a".to_vec())]));
        let reads = |given: Option<Given>| {
            let work = move || {
                given.iter().for_each(Given::here);
                (store::exists(place), store::read(place).ok())
            };
            std::thread::spawn(work).join().unwrap()
        };
        assert_eq!(reads(Some(given)), (true, Some(b"a".to_vec())));
        assert_eq!(reads(None), (false, None));
    }
}
