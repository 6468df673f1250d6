//! Values that carry their digest, and what a stage is given: nothing but such values.

use crate::error::BuildError;
use crate::record::hash;
use std::ops::Deref;

/// A value with the digest by which stages know it: an earlier stage's result, or files that were read.
pub struct Kept<T> {
    value: T,
    digest: String,
}

/// What was read from files, and tells the digest of all of it.
pub trait Read {
    /// blake3 of everything that a stage may look at.
    fn digest(&self) -> Result<String, BuildError>;
}

impl<T: Read> Kept<T> {
    /// Files as they were read.
    pub fn read(value: T) -> Result<Kept<T>, BuildError> {
        let digest = value.digest()?;
        Ok(Kept { value, digest })
    }
}

impl<T> Kept<T> {
    /// A stage's result, kept as `bytes`.
    pub(crate) fn made(value: T, bytes: &[u8]) -> Kept<T> {
        Kept { value, digest: hash(bytes) }
    }

    /// A stage's result of an earlier run, taken for another than it was: what depends on it would run again.
    pub(crate) fn outdated(value: T) -> Kept<T> {
        Kept { value, digest: "outdated".into() }
    }

    /// blake3, hexadecimal.
    pub fn digest(&self) -> &str {
        &self.digest
    }
}

impl<T> Deref for Kept<T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.value
    }
}

/// What a stage is given: kept values, some of which may be left out, in a tuple.
pub trait Inputs: Copy {
    /// Adds the digest of each.
    fn digests(self, into: &mut Vec<String>);
}

impl<T> Inputs for &Kept<T> {
    fn digests(self, into: &mut Vec<String>) {
        into.push(self.digest.clone());
    }
}

impl<T> Inputs for Option<&Kept<T>> {
    fn digests(self, into: &mut Vec<String>) {
        into.push(self.map_or("left out".into(), |kept| kept.digest.clone()));
    }
}

macro_rules! tuples {
    ($($($name:ident)+;)+) => {$(
        impl<$($name: Inputs),+> Inputs for ($($name,)+) {
            #[expect(non_snake_case, reason = "a name stands for the type and for its value")]
            fn digests(self, into: &mut Vec<String>) {
                let ($($name,)+) = self;
                $($name.digests(into);)+
            }
        }
    )+};
}
tuples! {
    A;
    A B;
    A B C;
    A B C D;
    A B C D E;
    A B C D E F;
    A B C D E F G;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digests(inputs: impl Inputs) -> Vec<String> {
        let mut out = Vec::new();
        inputs.digests(&mut out);
        out
    }

    #[test]
    fn every_input_counts_where_it_stands() {
        let (a, b) = (Kept::made(1, b"a"), Kept::made(2, b"b"));
        let all = [digests((&a, &b)), digests((&b, &a)), digests((&a, Some(&b))), digests((&a, None::<&Kept<i32>>))];
        assert_eq!(all[0], all[2]);
        assert!(all[0] != all[1] && all[0] != all[3]);
        assert_eq!(*a + *b, 3);
    }
}
