//! `import-abaqus`: a published deck becomes a model, as it stands or as another variant of the knee. `import-opensim`, `import-febio`: so does an OpenSim or a FEBio knee.

use crate::error::{BuildError, Place};
use crate::init::SideName;
use crate::store;
use crate::told::{Told, schemas};
use clap::Args;
use decks::opensim::{self, Given};
use decks::{ImportedDeck, febio, lower_cartilage, replace_fibres};
use meshes::frame::Side;
use notices::Notice;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// `build-model import-abaqus`.
#[derive(Args, Clone, Debug)]
pub struct ImportArgs {
    /// The main input file
    pub deck: PathBuf,
    /// Folder for model.json and its meshes
    #[arg(long)]
    pub out: PathBuf,
    /// Fibres in place of the deck's: a table with the columns geometry, bundle, femur_x to tibia_z, L_ref
    #[arg(long, value_name = "TABLE.csv", requires = "variant")]
    pub fibres: Option<PathBuf>,
    /// Which rows of the table: those with this in the column geometry
    #[arg(long, value_name = "NAME", requires = "fibres")]
    pub variant: Option<String>,
    /// Whose parameters in the table: NAME reads the columns NAME_EREF and NAME_K2 [default: the deck's]
    #[arg(long, value_name = "NAME", requires = "fibres")]
    pub parameters: Option<String>,
    /// Lower a tibial cartilage along the tibia's axis by so many mm, tibia_medial or tibia_lateral; may be given more than once
    #[arg(long = "lower", value_name = "PART=MM", value_parser = part, allow_hyphen_values = true)]
    pub lowered: Vec<(String, f64)>,
}

impl ImportArgs {
    /// The deck as it stands, into `out`.
    pub fn of(deck: &Path, out: &Path) -> ImportArgs {
        let (deck, out) = (deck.to_path_buf(), out.to_path_buf());
        ImportArgs { deck, out, fibres: None, variant: None, parameters: None, lowered: vec![] }
    }
}

fn part(text: &str) -> Result<(String, f64), String> {
    let (part, mm) = text.split_once('=').ok_or("PART=MM was expected, say tibia_medial=2.5")?;
    let mm = mm.trim().parse().map_err(|_| format!("\"{mm}\" is no number of millimetres"))?;
    Ok((part.trim().to_owned(), mm))
}

/// `build-model import-opensim`.
#[derive(Args, Clone, Debug)]
pub struct ImportOpensimArgs {
    /// The model file (.osim), its meshes beside it or in its folder Geometry
    pub model: PathBuf,
    /// Folder for model.json and its meshes, and what the file does not tell
    #[command(flatten)]
    pub knee: KneeArgs,
}

/// `build-model import-febio`.
#[derive(Args, Clone, Debug)]
pub struct ImportFebioArgs {
    /// The file (.feb), of format 4.0, 3.0 or 2.5, in mm, N and MPa
    pub model: PathBuf,
    /// Folder for model.json and its meshes, and what the file does not tell
    #[command(flatten)]
    pub knee: KneeArgs,
}

/// Where a knee of another program goes, and what is said of it where its file does not tell it.
#[derive(Args, Clone, Debug)]
pub struct KneeArgs {
    /// Folder for model.json and its meshes
    #[arg(long)]
    pub out: PathBuf,
    /// The femur's body, where names and contact do not tell it
    #[arg(long, value_name = "BODY")]
    pub femur: Option<String>,
    /// The tibia's body, where names and contact do not tell it
    #[arg(long, value_name = "BODY")]
    pub tibia: Option<String>,
    /// Which knee, where ligaments and names do not tell it
    #[arg(long)]
    pub side: Option<SideName>,
}

impl KneeArgs {
    fn given(&self) -> Given {
        let side = self.side.map(|s| if s == SideName::Left { Side::Left } else { Side::Right });
        Given { femur: self.femur.clone(), tibia: self.tibia.clone(), side }
    }
}

/// A deck's or model's fault, with its place.
fn fault(file: &Path, e: &decks::DeckError) -> BuildError {
    match e.line {
        0 => BuildError::in_file(file, &e.message),
        line => BuildError::at(Place { file: e.file.clone(), row: Some(line), column: None }, e.to_string()),
    }
}

/// The folder of a file, and its name there.
fn parted(file: &Path) -> (&Path, String) {
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder, file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default())
}

/// Reads the deck and makes the variant that is asked for.
pub fn imported(args: &ImportArgs) -> Result<ImportedDeck, BuildError> {
    let fault = |e: decks::DeckError| match e.line {
        0 => BuildError::of_file(&args.deck, e.to_string()),
        _ => fault(&args.deck, &e),
    };
    let (folder, main) = parted(&args.deck);
    let mut read = |name: &str| store::read_beside(folder, name).map_err(|e| e.to_string());
    let mut deck = decks::import(&main, &mut read).map_err(fault)?;
    if let (Some(table), Some(variant)) = (&args.fibres, &args.variant) {
        let text = store::read_text(table)?;
        replace_fibres(&mut deck, &text, variant, args.parameters.as_deref())
            .map_err(|e| BuildError::in_file(table, e))?;
    }
    for (part, mm) in &args.lowered {
        lower_cartilage(&mut deck, part, *mm).map_err(fault)?;
    }
    Ok(deck)
}

/// `--json` of `import-abaqus`, `import-opensim` and `import-febio`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ImportTold {
    /// import/1
    pub schema: &'static str,
    /// The specimen's name.
    pub id: String,
    /// The model.json.
    pub model: String,
    /// All files, by their paths below the folder of `--out`.
    pub files: Vec<String>,
    /// Bundles of ligaments.
    pub bundles: usize,
    /// Their fibres.
    pub fibres: usize,
    /// Pairs of cartilages in contact.
    pub contact_pairs: usize,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// Writes the model of a deck; gives the words to print.
pub fn import_abaqus(args: &ImportArgs) -> Result<Told, BuildError> {
    written(imported(args)?, &args.out)
}

/// Writes the model of an OpenSim knee; gives the words to print.
pub fn import_opensim(args: &ImportOpensimArgs) -> Result<Told, BuildError> {
    let (folder, main) = parted(&args.model);
    let mut read = |name: &str| store::read_beside(folder, name).map_err(|e| e.to_string());
    let bytes = store::read(&args.model)?;
    let knee = opensim::import(&main, &bytes, &mut read, &args.knee.given()).map_err(|e| fault(&args.model, &e))?;
    written(knee, &args.knee.out)
}

/// Writes the model of a FEBio knee; gives the words to print.
pub fn import_febio(args: &ImportFebioArgs) -> Result<Told, BuildError> {
    let (_, main) = parted(&args.model);
    let bytes = store::read(&args.model)?;
    let knee = febio::import(&main, &bytes, &args.knee.given()).map_err(|e| fault(&args.model, &e))?;
    written(knee, &args.knee.out)
}

/// Writes a model into a folder.
fn written(deck: ImportedDeck, out: &Path) -> Result<Told, BuildError> {
    let files = deck.files().map_err(|e| BuildError::File(e.to_string()))?;
    store::write_all(out, &files)?;
    let model = out.join("model.json").display().to_string();
    let words = format!(
        "{}: {} fibres in {} bundles, {} contact pairs\nThe model is {model}\n",
        deck.spec.id,
        deck.spec.fibres.len(),
        deck.spec.bundles.len(),
        deck.spec.contact.pairs.len()
    );
    let data = ImportTold {
        schema: schemas::IMPORT,
        id: deck.spec.id.clone(),
        model,
        files: files.iter().map(|(name, _)| name.clone()).collect(),
        bundles: deck.spec.bundles.len(),
        fibres: deck.spec.fibres.len(),
        contact_pairs: deck.spec.contact.pairs.len(),
        warnings: notices::texts(&deck.warnings),
        notices: deck.warnings.clone(),
    };
    Ok(Told::words(words).odd(deck.warnings).with(&data))
}
