//! Data that tests may read where it is there, and what tests of several programs' files share.

pub(crate) mod elements;
pub(crate) mod knees;

#[path = "../../../tests/common/shared.rs"]
mod shared;

pub(crate) use shared::shared;
