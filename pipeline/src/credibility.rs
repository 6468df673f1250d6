//! `credibility`: what speaks for a knee's model, factor by factor in the order of ASME V&V 40, each number with its file and digest.

mod answers;
mod context;
mod evidence;
mod figures;
mod grade;
mod of_program;
mod page;
mod questions;
mod read;
mod row;
mod rows;
mod told;
mod untargeted;

pub use answers::{Answer, AnswerNumber, Verdict};
pub use context::Context;
pub use evidence::{Evidence, Factor, FactorTold};
pub use grade::{Grade, Level};
pub use told::Told as CredibilityTold;

use crate::error::BuildError;
use crate::inspect;
use crate::record::json;
use crate::store;
use crate::told::Told;
use clap::Args;
use evidence::FACTORS;
use read::Build;
use std::path::{Path, PathBuf};

/// The version of credibility.json.
pub const SCHEMA: &str = "credibility/1";
/// The file beside specimen.toml that states the context.
const CONTEXT: &str = "credibility.toml";

/// `build-model credibility`.
#[derive(Args, Clone, Debug)]
pub struct CredibilityArgs {
    /// Folder of a build, or of the specimen that holds it
    pub dir: PathBuf,
    /// Question, context of use and risk of the model [default: credibility.toml of the specimen, where it is]
    #[arg(long, value_name = "CONTEXT.toml")]
    pub context: Option<PathBuf>,
    /// Folder for credibility.html and credibility.json [default: that of the build]
    #[arg(long)]
    pub out: Option<PathBuf>,
}

/// Judges a build and writes the page.
pub fn credibility(args: &CredibilityArgs) -> Result<Told, BuildError> {
    let folder = inspect::build_folder(&args.dir)?;
    let told = judged(&folder, &context(args, &folder)?)?;
    let out = args.out.clone().unwrap_or_else(|| folder.clone());
    let files =
        [("credibility.json".to_owned(), json(&told)), ("credibility.html".to_owned(), page::page(&told).into_bytes())];
    store::write_all(&out, &files)?;
    let lines = told.factors.iter().map(|f| format!("{:28} {}\n", f.name, f.grade.word()));
    let page = format!("The page is {}\n", out.join("credibility.html").display());
    Ok(Told::words(lines.collect::<String>() + &page).with(&told))
}

/// The stated context: the file that is named, else the specimen's own, else nothing.
fn context(args: &CredibilityArgs, folder: &Path) -> Result<Context, BuildError> {
    let own = [Some(args.dir.join(CONTEXT)), folder.parent().map(|p| p.join(CONTEXT))];
    let found = own.into_iter().flatten().find(|p| store::exists(p));
    match args.context.clone().or(found) {
        Some(file) => Context::read(&file),
        None => Ok(Context::default()),
    }
}

/// What is known of the build in `folder`.
fn judged(folder: &Path, context: &Context) -> Result<CredibilityTold, BuildError> {
    let build = Build::open(folder)?;
    let shared_prior = figures::shared_prior(&build);
    let rows = rows::all(&build, context, shared_prior.as_ref());
    let risk = context.risk();
    let of = |factor: Factor| {
        let evidence: Vec<Evidence> = rows.iter().filter(|r| r.factor == factor).cloned().collect();
        FactorTold::of(factor, evidence, risk)
    };
    let factors = FACTORS.map(of).to_vec();
    let told: Vec<&Evidence> = factors.iter().flat_map(|f| &f.evidence).collect();
    let answers = answers::answers(&told, figures::did_not_fit(&build));
    Ok(CredibilityTold {
        schema: SCHEMA,
        knee: build.knee.clone(),
        model: build.model.clone(),
        shared_prior,
        program: build.program.clone(),
        context: context.clone(),
        model_risk: risk,
        factors,
        answers,
        changed: build.changed(),
    })
}
