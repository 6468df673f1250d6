//! What a build is asked.

use crate::options::{Override, parse_override};
use crate::stage::list::names;
use clap::Args;
use sim::names::did_you_mean;
use std::path::PathBuf;

/// `build-model DIR`.
#[derive(Args, Clone, Debug)]
pub struct BuildArgs {
    /// The specimen's folder, which holds specimen.toml
    pub dir: PathBuf,
    /// Where the build goes [default: DIR/build]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Run this stage and those after it, even if nothing changed
    #[arg(long, value_name = "STAGE", value_parser = stage_name)]
    pub from: Option<String>,
    /// Stop after this stage
    #[arg(long, value_name = "STAGE", value_parser = stage_name)]
    pub to: Option<String>,
    /// Run every stage, even if nothing changed
    #[arg(long)]
    pub force: bool,
    /// Run nothing: tell which stages would run, if each that runs made something new
    #[arg(long)]
    pub plan: bool,
    /// Override an option; may be given more than once
    #[arg(long = "set", value_name = "stage.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Seed of whatever is random
    #[arg(long)]
    pub seed: Option<u64>,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the log as JSON
    #[arg(long)]
    pub json: bool,
}

impl BuildArgs {
    /// A build of `dir` with nothing special.
    pub fn of(dir: PathBuf) -> BuildArgs {
        BuildArgs {
            dir,
            out: None,
            from: None,
            to: None,
            force: false,
            plan: false,
            overrides: Vec::new(),
            jobs: None,
            seed: None,
            quiet: false,
            json: false,
        }
    }
}

/// A stage by its name; a near miss is suggested.
pub fn stage_name(name: &str) -> Result<String, String> {
    let known = names();
    if known.contains(&name) {
        Ok(name.to_string())
    } else {
        Err(format!("no such stage{}; expected one of {}", did_you_mean(name, known), known.join(", ")))
    }
}
