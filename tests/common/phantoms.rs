//! Phantoms, each made once a run of a test program: one takes some ten seconds of processor. The stages' tests take this file too.
#![allow(clippy::unwrap_used, reason = "tests")]

use stages::phantom::{PhantomSpecimen, phantom};
use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};

/// The phantom `id` of the seed 1.
pub(crate) fn made(id: &str) -> &'static PhantomSpecimen {
    static MADE: Mutex<BTreeMap<String, &'static OnceLock<PhantomSpecimen>>> = Mutex::new(BTreeMap::new());
    // the lock is not held while one is made: others are made beside it
    let place: &'static OnceLock<PhantomSpecimen> =
        MADE.lock().unwrap().entry(id.to_owned()).or_insert_with(|| Box::leak(Box::default()));
    place.get_or_init(|| phantom(id, 1).unwrap())
}
