//! Data that tests may read where it is there.
pub(crate) mod asked;
pub(crate) mod deck;
#[path = "../../../tests/common/shared.rs"]
mod shared;

pub(crate) use shared::shared;
