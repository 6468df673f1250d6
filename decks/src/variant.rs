//! Another variant of a published knee: fibres from a table, cartilage moved by a stated amount.

use super::ligaments::bundle_name;
use super::{DeckError, ImportedDeck};
use meshes::{Isometry, Point};
use notices::Kind;
use sim::mesh::MeshValue;
use sim::spec::FibreSpec;
use std::collections::BTreeMap;

/// How far a cartilage may be moved [mm]: more than any plateau is thick or offset.
const FARTHEST_MM: f64 = 30.0;

/// The columns of a table of fibres that are read, by name.
struct Columns<'a> {
    header: Vec<&'a str>,
}

impl Columns<'_> {
    fn text<'r>(&self, row: &[&'r str], line: usize, column: &str) -> Result<&'r str, DeckError> {
        let place = self.header.iter().position(|h| *h == column);
        let place = place.ok_or_else(|| fault(1, format!("no column {column}; found: {}", self.header.join(", "))))?;
        row.get(place).copied().ok_or_else(|| fault(line, format!("{} cells, {column} is missing", row.len())))
    }

    fn number(&self, row: &[&str], line: usize, column: &str) -> Result<f64, DeckError> {
        let text = self.text(row, line, column)?;
        let finite = text.parse::<f64>().ok().filter(|x| x.is_finite());
        finite.ok_or_else(|| fault(line, format!("{column} is \"{text}\", expected a number")))
    }

    fn point(&self, row: &[&str], line: usize, bone: &str) -> Result<Point, DeckError> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| self.number(row, line, &format!("{bone}_{axis}")));
        Ok(Point::new(x?, y?, z?))
    }
}

fn fault(line: usize, message: String) -> DeckError {
    DeckError { file: "table of fibres".into(), line, message }
}

/// Gives a deck the fibres of another variant. `table` is CSV with the columns geometry (the variant), bundle (deck names), femur_x to tibia_z [mm],
/// L_ref (the bundle's reference length) [mm], and for `parameters`, say KLA, KLA_EREF [-] and KLA_K2 [N/mm]; without `parameters` the deck's stay.
///
/// # Errors
/// By line: a missing column, no number where one is expected, a bundle the deck has not; no row of the variant; a bundle without a row.
pub fn replace_fibres(
    deck: &mut ImportedDeck,
    table: &str,
    variant: &str,
    parameters: Option<&str>,
) -> Result<(), DeckError> {
    let mut lines = table.lines().enumerate().filter(|(_, l)| !l.trim().is_empty());
    let header = lines.next().map_or(vec![], |(_, l)| l.split(',').map(str::trim).collect());
    let columns = Columns { header };
    let mut fibres: BTreeMap<String, Vec<FibreSpec>> = BTreeMap::new();
    let mut variants: Vec<&str> = Vec::new();
    for (i, line) in lines {
        let row: Vec<&str> = line.split(',').map(str::trim).collect();
        let line = i + 1;
        let of = columns.text(&row, line, "geometry")?;
        if !variants.contains(&of) {
            variants.push(of);
        }
        if of != variant {
            continue;
        }
        let stem = columns.text(&row, line, "bundle")?;
        let name = bundle_name(&stem.to_lowercase()).unwrap_or_else(|| stem.to_uppercase());
        let known = deck.spec.bundles.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
        let Some(bundle) = deck.spec.bundles.iter_mut().find(|b| b.name == name) else {
            return Err(fault(line, format!("bundle {stem} is not in the deck; its bundles: {known}")));
        };
        bundle.reference_length_mm = columns.number(&row, line, "L_ref")?;
        if let Some(p) = parameters {
            bundle.reference_strain = columns.number(&row, line, &format!("{p}_EREF"))?;
            bundle.stiffness_n_per_mm = columns.number(&row, line, &format!("{p}_K2"))?;
        }
        let [femur, tibia] = ["femur", "tibia"].map(|bone| columns.point(&row, line, bone));
        fibres.entry(name.clone()).or_default().push(FibreSpec { bundle: name, femur: femur?, tibia: tibia? });
    }
    if fibres.is_empty() {
        return Err(fault(1, format!("no fibre of variant {variant}; there are: {}", variants.join(", "))));
    }
    if let Some(bundle) = deck.spec.bundles.iter().find(|b| !fibres.contains_key(&b.name)) {
        return Err(fault(1, format!("variant {variant} has no fibre of {}", bundle.name)));
    }
    deck.spec.fibres = deck.spec.bundles.iter().flat_map(|b| fibres[&b.name].clone()).collect();
    let values = parameters.map_or("the deck's parameters".to_owned(), |p| format!("parameters {p}"));
    tell(deck, format!("fibres of variant {variant} from a table, {values}: not the deck's"));
    Ok(())
}

/// Moves a tibial cartilage, `tibia_medial` or `tibia_lateral`, down the tibia's long axis by `by_mm` (up where negative): its contact face and its solid.
///
/// # Errors
/// A part the deck has not, a distance that is not finite or beyond 30 mm.
pub fn lower_cartilage(deck: &mut ImportedDeck, part: &str, by_mm: f64) -> Result<(), DeckError> {
    if by_mm.is_nan() || by_mm.abs() > FARTHEST_MM {
        return Err(DeckError::whole(format!(
            "{part} lowered by {by_mm} mm, expected -{FARTHEST_MM} to {FARTHEST_MM}"
        )));
    }
    let down = -by_mm * deck.spec.frames.tibia.superior;
    let face = format!("meshes/articular_{part}.ply");
    if !part.starts_with("tibia_") || !deck.meshes.contains_key(&face) {
        let name = |path: &String| Some(path.strip_prefix("meshes/articular_")?.strip_suffix(".ply")?.to_owned());
        let parts: Vec<String> = deck.meshes.keys().filter_map(name).filter(|p| p.starts_with("tibia_")).collect();
        return Err(DeckError::whole(format!("no tibial cartilage {part}; there are: {}", parts.join(", "))));
    }
    for path in [face, format!("meshes/cartilage_{part}.vtu")] {
        match deck.meshes.get_mut(&path) {
            Some(MeshValue::Surface(m)) => *m = m.moved(&Isometry::translation(down.x, down.y, down.z)),
            Some(MeshValue::Hex(m)) => m.nodes.iter_mut().for_each(|p| *p += down),
            Some(MeshValue::Tet(m)) => m.nodes.iter_mut().for_each(|p| *p += down),
            None => {}
        }
    }
    tell(deck, format!("{part}: cartilage lowered by {by_mm} mm along the tibia's axis, as asked: not the deck's"));
    Ok(())
}

fn tell(deck: &mut ImportedDeck, words: String) {
    deck.spec.warnings.push(words.clone());
    deck.warnings.push(Kind::DeckChanged.notice(words));
}
