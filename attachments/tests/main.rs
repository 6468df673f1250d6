//! The integration tests of attachments, one program: each further one would link everything again.

mod marks_truth;
#[path = "../../tests/common/shared.rs"]
mod shared;
