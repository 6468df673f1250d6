//! `import-abaqus`: a published deck becomes a model, as it stands or as another variant of the knee.

use crate::error::{BuildError, Place};
use crate::store;
use crate::told::{Told, schemas};
use clap::Args;
use decks::{ImportedDeck, lower_cartilage, replace_fibres};
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

/// Reads the deck and makes the variant that is asked for.
pub fn imported(args: &ImportArgs) -> Result<ImportedDeck, BuildError> {
    let fault = |e: decks::DeckError| match e.line {
        0 => BuildError::of_file(&args.deck, e.to_string()),
        line => BuildError::at(Place { file: e.file.clone(), row: Some(line), column: None }, e.to_string()),
    };
    let folder = args.deck.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let main = args.deck.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
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

/// `import-abaqus --json`.
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

/// Writes the model; gives the words to print.
pub fn import_abaqus(args: &ImportArgs) -> Result<Told, BuildError> {
    let deck = imported(args)?;
    let files = deck.files().map_err(|e| BuildError::File(e.to_string()))?;
    store::write_all(&args.out, &files)?;
    let words = format!(
        "{}: {} fibres in {} bundles, {} contact pairs\nThe model is {}\n",
        deck.spec.id,
        deck.spec.fibres.len(),
        deck.spec.bundles.len(),
        deck.spec.contact.pairs.len(),
        args.out.join("model.json").display()
    );
    let data = ImportTold {
        schema: schemas::IMPORT,
        id: deck.spec.id.clone(),
        model: args.out.join("model.json").display().to_string(),
        files: files.iter().map(|(name, _)| name.clone()).collect(),
        bundles: deck.spec.bundles.len(),
        fibres: deck.spec.fibres.len(),
        contact_pairs: deck.spec.contact.pairs.len(),
        warnings: notices::texts(&deck.warnings),
        notices: deck.warnings.clone(),
    };
    Ok(Told::words(words).odd(deck.warnings).with(&data))
}
