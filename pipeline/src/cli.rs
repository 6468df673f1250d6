//! The command line: what may be asked, and who answers.
#![expect(clippy::print_stderr, reason = "the command line talks to the person at it")]

use crate::blind::{self, BlindVerb};
use crate::build_args::{BuildArgs, stage_name};
use crate::calibrate::CalibrateArgs;
use crate::check::{self, CheckArgs};
use crate::cohort::{self, CohortArgs};
use crate::credibility::{self, CredibilityArgs};
use crate::diagnose::{self, DiagnoseArgs};
use crate::error::{BuildError, OUR_FAULT};
use crate::exports::{self, Format, OpensimContact};
use crate::import::{self, ImportArgs, ImportFebioArgs, ImportOpensimArgs};
use crate::next_tests::{self, NextTestsArgs};
use crate::out_folder::OutFolder;
use crate::output::{self, Asked};
use crate::plan::{self, PlanArgs};
use crate::progress::detail;
use crate::simulate::SimulateArgs;
use crate::store::written::Rule;
use crate::told::Told;
use crate::validate::ValidateArgs;
use crate::which_model::WhichModel;
use crate::{
    calibrate, fetch, init, inspect, interrupted, manual, open, option_docs, phantom, report, run, schema, simulate,
    store, validate,
};
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use sim::names::did_you_mean;
use std::ffi::OsString;
use std::panic::UnwindSafe;
use std::path::PathBuf;
use std::process::ExitCode;

/// The version, and the commit it was built from.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("GENU_COMMIT"), ")");

/// The way in.
const FIRST_STEPS: &str = "First steps:
  build-model init KNEE --from FILES     a specimen folder, filled in as far as the files tell
  build-model check KNEE                 what is there, what is missing, what that costs
  build-model build KNEE                 the model, with a report
  build-model open KNEE                  the report, in the browser";

/// Turns what a laboratory measures of a knee into a model of that knee.
#[derive(Parser)]
#[command(name = "build-model", version = VERSION, after_help = FIRST_STEPS, args_conflicts_with_subcommands = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Option<Verb>,
    #[command(flatten)]
    build: Option<BuildArgs>,
}

#[derive(Subcommand)]
enum Verb {
    /// Write a specimen folder to fill in, or filled in as far as given files tell
    Init {
        /// A new or empty folder
        dir: PathBuf,
        /// Surfaces, tables or folders of them: bones, scans, side and frames are guessed from geometry
        #[arg(long, num_args = 1.., value_name = "FILES")]
        from: Vec<PathBuf>,
        /// Which knee, where the files do not show it, or show it wrongly
        #[arg(long)]
        side: Option<init::SideName>,
    },
    /// Read and judge all inputs of a specimen; build nothing
    Check(CheckArgs),
    /// Build the model of a specimen: the long form of build-model DIR
    Build(BuildArgs),
    /// Open the report of a build in the browser
    Open {
        /// The specimen's or the build's folder, or a diagnosis' or a plan's folder
        dir: PathBuf,
        /// Print its path only
        #[arg(long)]
        print: bool,
        /// Go to the knee that can be pulled at
        #[arg(long)]
        view: bool,
    },
    /// List options with default, unit, source and meaning
    Options {
        /// One stage's only
        stage: Option<String>,
        /// Also those of the method, which a laboratory leaves alone
        #[arg(long)]
        all: bool,
        /// Print as JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a script that completes commands in a shell
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page, or write one for every command
    Man {
        /// Folder for build-model.1 and a page for every command
        #[arg(long)]
        out: Option<PathBuf>,
    },
    /// Tell what each stage made: metrics, warnings, files, time
    Inspect {
        /// The specimen's or the build's folder
        dir: PathBuf,
        /// One stage only, in full
        #[arg(value_parser = stage_name)]
        stage: Option<String>,
        /// Print as JSON
        #[arg(long)]
        json: bool,
    },
    /// Write a synthetic specimen with known truth
    Phantom {
        /// Which one; an unknown name lists those there are
        id: String,
        /// A new or empty folder
        dir: PathBuf,
        /// Seed of its noise
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Write a CT volume in place of the CT surfaces
        #[arg(long)]
        volume: bool,
        /// Hide an effect in its laxity, one of the blind bench (ham_tone, meniscus, ...); truth/laxity.json tells it
        #[arg(long, value_name = "EFFECT")]
        hide: Option<String>,
        /// Build its model at once
        #[arg(long)]
        build: bool,
    },
    /// Download a published data set, with checksums and licence notice
    Fetch {
        /// Which one; an unknown name lists those there are
        id: String,
        /// Where it goes; what is there already is not fetched again
        dir: PathBuf,
        /// A server that holds the records in place of their own
        #[arg(long, value_name = "URL")]
        mirror: Option<String>,
        /// Longest that one answer of the server may take [s]; what was cut off goes on where it was
        #[arg(long, value_name = "SECONDS", default_value_t = 600)]
        patience: u64,
    },
    /// Turn a published Abaqus knee deck into a model
    ImportAbaqus(ImportArgs),
    /// Turn an OpenSim knee with JAM's ligaments and contact into a model
    ImportOpensim(ImportOpensimArgs),
    /// Turn a FEBio knee of rigid bones, springs and sliding contact into a model
    ImportFebio(ImportFebioArgs),
    /// Write a model as another program reads it
    Export {
        /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set, else the assembled one
        model: PathBuf,
        /// Which model of a build
        #[command(flatten)]
        which: WhichModel,
        /// For which program
        #[arg(long)]
        format: Format,
        /// Contact of an OpenSim model [default: elastic]
        #[arg(long)]
        contact: Option<OpensimContact>,
        /// Poses for a time series (results of simulate or a protocol; with --format vtk), or trials of which each becomes a file (with --format abaqus, febio or opensim)
        #[arg(long, value_name = "RESULTS.csv")]
        poses: Option<PathBuf>,
        /// Folder for the files
        #[arg(long)]
        out: PathBuf,
        /// Write over files there that were changed since an export wrote them
        #[arg(long)]
        force: bool,
    },
    /// Predict what a model does under the loads of laxity trials or of a protocol
    Simulate(SimulateArgs),
    /// Find the ligament parameters with which a model answers as the knee did
    Calibrate(CalibrateArgs),
    /// Run the validation protocols on models of one knee and compare them
    Validate(ValidateArgs),
    /// Find the effect that a model lacks, by measured laxity
    Diagnose(DiagnoseArgs),
    /// Plan a ligament's reconstruction: cut, graft, and what the knee does then
    Plan(PlanArgs),
    /// Choose the laxity tests that would narrow a force or a motion of a calibrated knee most
    NextTests(NextTestsArgs),
    /// Tell what speaks for a knee's model, factor by factor as ASME V&V 40 asks, each number with its file and digest
    Credibility(CredibilityArgs),
    /// Put many builds on one page and into tidy tables
    Cohort(CohortArgs),
    /// Print the JSON schema of a file that the program writes
    Schema {
        /// Which one; an unknown name lists those there are
        name: String,
    },
    /// Make data with hidden effects, answer them, score the answers
    #[command(subcommand)]
    Blind(BlindVerb),
    /// Write report.html of a build again, or compare.html of two
    Report {
        /// The specimen's or the build's folder
        dir: PathBuf,
        /// Another build to show beside it, in compare.html of the first
        #[arg(long, value_name = "OTHER")]
        compare: Option<PathBuf>,
    },
}

/// The command line as clap knows it, for completions and the manual.
pub fn command() -> clap::Command {
    with_negative_numbers(output::with_details(output::with_flags(Cli::command())))
}

/// Takes "-1" behind an option for its value, which then is refused for what it is; else it were an argument that is not known.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |a: &clap::Arg| !a.is_positional() && a.get_action().takes_values();
    command
        .mut_args(|a| if takes(&a) { a.allow_negative_numbers(true) } else { a })
        .mut_subcommands(with_negative_numbers)
}

/// What was asked, and how its output is wanted.
struct Call {
    cli: Cli,
    asked: Asked,
    folder: OutFolder,
}

impl Call {
    fn read(words: impl IntoIterator<Item = OsString>) -> Result<Call, clap::Error> {
        let matches = command().try_get_matches_from(words)?;
        let cli = Cli::from_arg_matches(&matches).map_err(|e| e.format(&mut command()))?;
        Ok(Call { cli, asked: output::asked(&matches), folder: OutFolder::of(&command(), &matches) })
    }
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    ExitCode::from(main_of(std::env::args_os()))
}

/// Runs the command line `words`, the program's name first; gives the exit status: 0 done, 1 the input is at fault, 2 wrong use, 3 the
/// machine (disk, rights, a lock), 4 a fault of this program; 130 is an interruption.
pub fn main_of(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    let json = output::wants_json(&words);
    std::panic::set_hook(Box::new(move |info| eprint!("{}", fault_told(json, &info.to_string()))));
    interrupted::listen(words.iter().skip(1).map(|w| w.to_string_lossy().into_owned()).collect());
    guarded(|| status(&words, json))
}

/// What is printed of a fault of this program.
fn fault_told(json: bool, what: &str) -> String {
    match json {
        true => output::fault_as_json(what),
        false => format!("build-model: internal error, please report it: {what}\n"),
    }
}

/// The exit status of `work`; 4 where it panics, which the panic hook tells.
fn guarded(work: impl FnOnce() -> u8 + UnwindSafe) -> u8 {
    std::panic::catch_unwind(work).unwrap_or(OUR_FAULT)
}

/// Runs the command line, prints what came of it, and gives the exit status.
fn status(words: &[OsString], json: bool) -> u8 {
    let call = parsed(words);
    if call.asked.is_verbose() {
        detail::begin(VERSION);
    }
    let status = printed(answer(call), words, json);
    detail::end(status, store::peak_memory_mib());
    status
}

/// Prints what a command told, or its error; gives the exit status.
fn printed(told: Result<(Asked, Told), BuildError>, words: &[OsString], json: bool) -> u8 {
    match told {
        Ok((asked, told)) => {
            let (out, err) = output::streams(&asked, &told);
            eprint!("{err}");
            if writes_to_standard_output(words) {
                eprint!("{out}");
                return 0;
            }
            store::print(out.as_bytes()).map_or_else(|error| refused(&error, json), |()| 0)
        }
        Err(error) => {
            if let BuildError::Faults { table, .. } = &error {
                let _ = store::print(table.as_bytes());
            }
            refused(&error, json)
        }
    }
}

/// Tells an error, and gives the exit status.
fn refused(error: &BuildError, json: bool) -> u8 {
    match json {
        true => eprint!("{}", output::error_as_json(error)),
        false => eprintln!("build-model: {error}"),
    }
    error.exit_status()
}

/// Whether the result itself goes to standard output (`--out -`), so that what is told of it must not.
fn writes_to_standard_output(words: &[OsString]) -> bool {
    words.windows(2).any(|w| w[0] == "--out" && w[1] == "-") || words.iter().any(|w| w == "--out=-")
}

/// The arguments; a first word that is neither a command nor a folder is told as what it most likely is.
fn parsed(words: &[OsString]) -> Call {
    Call::read(words.iter().cloned()).unwrap_or_else(|error| {
        let first = words.get(1).map(|w| w.to_string_lossy().into_owned()).unwrap_or_default();
        let misspelt = matches!(
            error.kind(),
            ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand | ErrorKind::ArgumentConflict
        );
        let near = did_you_mean(&first, verbs().iter());
        if misspelt && !near.is_empty() && !verbs().contains(&first) && !store::exists(first.as_ref()) {
            eprintln!("build-model: no command or folder is called {first}{near}");
            std::process::exit(2);
        }
        if output::wants_json(words) && error.use_stderr() {
            let wrong = BuildError::Usage(error.to_string().trim().to_owned());
            eprint!("{}", output::error_as_json(&wrong));
            std::process::exit(wrong.exit_status().into());
        }
        error.exit()
    })
}

/// The names of all commands.
pub fn verbs() -> Vec<String> {
    command().get_subcommands().map(|c| c.get_name().to_owned()).collect()
}

/// Does what the words of a command line ask for, without the program's name, and gives what it would print.
///
/// Errors: those of the command; a command line that clap refuses is [`BuildError::Usage`] with clap's words.
pub fn call(words: impl IntoIterator<Item = OsString>) -> Result<String, BuildError> {
    let words = std::iter::once(OsString::from("build-model")).chain(words);
    let (asked, told) = answer(Call::read(words).map_err(|e| BuildError::Usage(e.to_string().trim().to_owned()))?)?;
    Ok(output::text(&asked, &told))
}

/// The arguments of `simulate` in the words after it.
pub fn simulate_args(words: impl IntoIterator<Item = OsString>) -> Result<SimulateArgs, BuildError> {
    let words = ["build-model", "simulate"].map(OsString::from).into_iter().chain(words);
    match Call::read(words).map_err(|e| BuildError::Usage(e.to_string().trim().to_owned()))?.cli.verb {
        Some(Verb::Simulate(args)) => Ok(args),
        _ => Err(BuildError::Usage("the arguments of simulate were expected".into())),
    }
}

fn answer(call: Call) -> Result<(Asked, Told), BuildError> {
    call.folder.checked()?;
    let kept = call.folder.kept()?;
    let told = Rule::holds(kept, || match (call.cli.verb, call.cli.build) {
        (Some(verb), _) => answer_verb(verb),
        (None, Some(build)) => run::run(known_folder(&build)?),
        (None, None) => Err(BuildError::Usage("a specimen folder was expected; see --help".into())),
    })?;
    Ok((call.asked, told))
}

/// The arguments of a build; a single word that is no folder and nearly a command is told as that command.
fn known_folder(args: &BuildArgs) -> Result<&BuildArgs, BuildError> {
    let word = args.dir.to_string_lossy();
    if args.dir.components().count() == 1 && !store::exists(&args.dir) {
        let near = did_you_mean(&word, verbs().iter());
        if !near.is_empty() {
            return Err(BuildError::File(format!("no command or folder is called {word}{near}")));
        }
    }
    Ok(args)
}

fn answer_verb(verb: Verb) -> Result<Told, BuildError> {
    let words = |text: Result<String, BuildError>| text.map(Told::words);
    match verb {
        Verb::Init { dir, from, side } => init::init(&dir, &from, side),
        Verb::Check(args) => words(check::check(&args)),
        Verb::Build(args) => run::run(&args),
        Verb::Open { dir, print, view } => words(open::open(&dir, print, view)),
        Verb::Options { stage, all, json } => words(option_docs::options(stage.as_deref(), all, json)),
        Verb::Completions { shell } => words(Ok(manual::completions(shell, command()))),
        Verb::Man { out } => words(manual::pages(out.as_deref(), command())),
        Verb::Inspect { dir, stage, json } => words(inspect::inspect(&dir, stage.as_deref(), json)),
        Verb::Phantom { id, dir, seed, volume, hide, build } => {
            let wrote = phantom::write(&id, seed, volume, hide.as_deref(), &dir)?;
            if build { run::run(&BuildArgs::of(dir)) } else { Ok(wrote) }
        }
        Verb::Fetch { id, dir, mirror, patience } => words(fetch::fetch(&id, &dir, mirror.as_deref(), patience)),
        Verb::ImportAbaqus(args) => import::import_abaqus(&args),
        Verb::ImportOpensim(args) => import::import_opensim(&args),
        Verb::ImportFebio(args) => import::import_febio(&args),
        Verb::Export { model, which, format, contact, poses, out, force } => {
            exports::export((&model, &which), (format, contact), poses.as_deref(), &out, force)
        }
        Verb::Simulate(args) => simulate::simulate(&args),
        Verb::Calibrate(args) => calibrate::calibrate(&args),
        Verb::Validate(args) => validate::validate(&args),
        Verb::Diagnose(args) => diagnose::run(&args),
        Verb::Plan(args) => plan::plan(&args),
        Verb::NextTests(args) => next_tests::next_tests(&args),
        Verb::Credibility(args) => credibility::credibility(&args),
        Verb::Cohort(args) => cohort::cohort(&args),
        Verb::Schema { name } => words(schema::schema(&name)),
        Verb::Blind(verb) => words(blind::run(&verb)),
        Verb::Report { dir, compare } => report::rewrite(&dir, compare.as_deref()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_ends_with_4_and_asks_to_be_reported() {
        let hook = std::panic::take_hook();
        let (said, hears) = std::sync::mpsc::channel();
        let said = std::sync::Mutex::new(said);
        std::panic::set_hook(Box::new(move |info| {
            let _ = said.lock().map(|s| s.send(fault_told(false, &info.to_string())));
        }));
        let ended = [guarded(|| panic!("a made fault")), guarded(|| 3)];
        std::panic::set_hook(hook);
        assert_eq!(ended, [OUR_FAULT, 3]);
        assert_eq!(OUR_FAULT, 4);
        let told: Vec<String> = hears.try_iter().collect();
        assert!(told.iter().any(|t| t.contains("please report it") && t.contains("a made fault")), "{told:?}");
        let json: serde_json::Value = serde_json::from_str(&fault_told(true, "a made fault")).unwrap();
        assert_eq!((&json["status"], &json["code"]), (&4.into(), &"internal".into()));
    }
}
