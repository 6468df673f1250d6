//! `build-model`.

fn main() {}
