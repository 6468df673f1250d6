//! Protocols and trials that go out beside a model, and the list of what each step of each file imposes.

use super::File;
use crate::error::{BuildError, Place};
use crate::model_file::LoadedModel;
use crate::store;
use decks::{Imposed, ImposedPoint};
use notices::{Kind, Notice};
use sim::coordinate::{Coordinate, FREE};
use sim::laxity::{self, LaxityTrial};
use std::path::Path;

/// What names of files begin with that stand beside the knee's own.
const PREFIX: &str = "model_";

/// The trials of a laxity file or of results, and what is odd in it; none where no file is given. One column of flexion is enough, as for `simulate`.
pub(super) fn trials(asked: Option<&Path>) -> Result<(Vec<LaxityTrial>, Vec<Notice>), BuildError> {
    let Some(path) = asked else { return Ok((vec![], vec![])) };
    let (bytes, name) = (store::read(path)?, path.display().to_string());
    let read = laxity::read_asked(&bytes);
    let table = read.map_err(|e| BuildError::at(Place::in_laxity(&name, &e), format!("{name}: {e}")))?;
    Ok((table.trials, table.warnings.into_iter().map(|w| w.in_file(&name)).collect()))
}

/// What protocols and trials impose over time, for a program that is told it by flexion and loads alone; and what is left out of that.
pub(super) fn by_flexion(model: &LoadedModel, asked: Option<&Path>) -> Result<(Vec<Imposed>, Vec<Notice>), BuildError> {
    let (trials, mut warnings) = trials(asked)?;
    let all = decks::imposed(&model.spec, &trials).map_err(|e| BuildError::in_file(&model.folder, e))?;
    let (mut kept, others): (Vec<Imposed>, Vec<Imposed>) = all.into_iter().partition(|i| i.holds_flexion_alone);
    // beside model.feb or model.osim, and behind it in a list by name
    kept.iter_mut().for_each(|i| i.stem.insert_str(0, PREFIX));
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|i| i.stem.as_str()).collect();
        let text = format!("protocols that move other coordinates than flexion are left out: {}", names.join(", "));
        warnings.push(Kind::NotInFormat.notice(text).count(names.len()));
    }
    warnings.extend(decks::without_quadriceps(&trials, "files are without it"));
    warnings.extend(decks::of_a_cut_knee(&trials, "files"));
    Ok((kept, warnings))
}

/// The list of steps as CSV; `table` is the file that the trials stand in.
pub(super) fn list(imposed: &[Imposed], ending: &str, table: Option<&Path>) -> File {
    let mut out = csv::Writer::from_writer(Vec::new());
    let mut header = vec!["file".to_owned(), "step".into(), "name".into(), "from_s".into(), "to_s".into()];
    header.push("fe_deg".into());
    header.extend(FREE.map(Coordinate::load_column));
    header.extend(["trial", "table", "row"].map(String::from));
    // a list in memory has room for every row
    let _ = out.write_record(&header);
    for i in imposed {
        for (k, step) in i.steps.iter().enumerate() {
            let mut cells = vec![format!("{}{ending}", i.stem), (k + 1).to_string(), step.name.clone()];
            cells.extend([step.from_s, step.to_s].map(|t| format!("{t:.6}")));
            cells.extend(at_end(&i.points[step.end]));
            let row = i.trial.as_ref().and_then(|(_, row)| *row).map_or(String::new(), |row| row.to_string());
            let table = table.filter(|_| i.trial.is_some()).map_or(String::new(), |path| path.display().to_string());
            cells.extend([i.trial.as_ref().map_or(String::new(), |(name, _)| name.clone()), table, row]);
            let _ = out.write_record(&cells);
        }
    }
    ("steps.csv".to_owned(), out.into_inner().unwrap_or_default())
}

/// Flexion [deg] and loads [N m, N] at the end of a step.
fn at_end(point: &ImposedPoint) -> Vec<String> {
    let loads = FREE.map(|c| point.load[c]);
    // + 0: no load is 0, not -0
    std::iter::once(point.fe_deg).chain(loads).map(|x| format!("{:.6}", x + 0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of loads, with these columns of flexion.
    fn table(flexions: &[&str]) -> String {
        let row = |name: &str, flexion: &str, ap: &str| {
            let cells: Vec<&str> = [name, "anterior"].into_iter().chain(flexions.iter().map(|_| flexion)).collect();
            format!("{},0,0,0,{ap},20\n", cells.join(","))
        };
        let names: Vec<&str> = ["trial", "test"].into_iter().chain(flexions.iter().copied()).collect();
        let header = format!("{},load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n\n", names.join(","));
        header + &row("a", "30", "60") + &row("b", "62.5", "90")
    }

    /// Whichever column of flexion a table of loads has, the same is asked.
    #[test]
    fn a_table_of_loads_needs_its_flexion_once() {
        let folder = tempfile::tempdir().unwrap();
        let read = |flexions: &[&str]| {
            let path = folder.path().join("trials.csv");
            store::write(&path, table(flexions).as_bytes()).unwrap();
            trials(Some(&path)).map(|(trials, _)| trials)
        };
        let asked = read(&["fe_deg", "nominal_flexion_deg"]).unwrap();
        assert_eq!(asked.iter().map(|t| t.fe_deg).collect::<Vec<f64>>(), [30.0, 62.5]);
        for own in ["fe_deg", "nominal_flexion_deg"] {
            assert_eq!(read(&[own]).unwrap(), asked, "{own}");
        }
        assert!(read(&[]).is_err());
    }
}
