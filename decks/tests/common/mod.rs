//! Data that tests may read where it is there.

#[path = "../../../tests/common/shared.rs"]
mod shared;

pub(crate) use shared::shared;
