//! Codecs over bytes and `Write`: STL, PLY, OBJ, VTU. None opens a file.

pub mod ply;
pub mod stl;
pub mod vtu;

/// What a codec refuses, in words for the person who owns the file.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct FormatError(pub String);
