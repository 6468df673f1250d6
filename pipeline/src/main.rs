//! `build-model`: see [`genu::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    genu::cli::main()
}
