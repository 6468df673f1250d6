//! The integration tests of stages, one program: each further one would link everything again.

mod attachments;
mod bones;
mod cartilage;
mod common;
mod frames;
mod joint;
mod menisci;
mod mri;
mod patella;
mod register;
mod segment;
