//! `check`: reads and judges every input of a specimen without building, and says what each missing thing costs.

mod laxity;
mod names;
mod page;

use crate::error::BuildError;
use crate::options::{BuildOptions, resolve};
use crate::store;
use crate::suggested::command_on;
use clap::Args;
use meshes::frame::Side;
use meshes::query::SurfaceQuery;
use notices::Notice;
use schemars::JsonSchema;
use serde::Serialize;
use stages::StageError;
use stages::anatomy::{SideEvidence, check_anatomy};
use stages::ingest::{self, OPTIONAL_PATHS, of_knee};
use stages::segment::look;
use stages::specimen::{NamedPoint, PointFrame, RawSpecimen, Specimen, SpecimenFile};
use std::fmt::Write;
use std::path::PathBuf;

/// `build-model check`.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// The specimen's folder, which holds specimen.toml
    pub dir: PathBuf,
    /// Where check.html goes, with load against displacement [default: DIR/build]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Also write the laxity files in the standard shape, into this folder
    #[arg(long, value_name = "FOLDER")]
    pub write_laxity: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// How an input stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// There, and good.
    Ok,
    /// There, and odd: a build goes on.
    Look,
    /// Not there: a build goes on without.
    Missing,
    /// A build would stop.
    Fault,
}

/// An input with what was found and what it means.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Item {
    /// What it is, by its key in specimen.toml.
    pub input: String,
    /// How it stands.
    pub state: State,
    /// What was found.
    pub found: String,
    /// What is lost without it, or what to do.
    pub cost: String,
    /// The notices that `found` tells, as values.
    #[serde(skip)]
    notices: Vec<Notice>,
}

impl Item {
    fn new(input: &str, state: State, found: impl Into<String>, cost: &str) -> Item {
        Item { input: input.into(), state, found: found.into(), cost: cost.into(), notices: vec![] }
    }

    /// The same, which tells these notices.
    fn telling(self, notices: Vec<Notice>) -> Item {
        Item { notices, ..self }
    }

    /// Whether it tells this notice, in whatever words.
    fn tells(&self, notice: &Notice) -> bool {
        let wordless = |n: &Notice| Notice { text: String::new(), ..n.clone() };
        self.notices.iter().any(|own| wordless(own) == wordless(notice))
    }
}

/// Points of a table may lie this far from the surfaces of their frame in the median before the frame is doubted [mm]: landmarks are
/// rough by 4.5 mm, marks by 4. Ours.
const FAR_MM: f64 = 15.0;

/// Judges the specimen; gives the words to print, or the faults as one error.
pub fn check(args: &CheckArgs) -> Result<String, BuildError> {
    let (file, raw) = store::read_specimen(&args.dir)?;
    let options = resolve(&file.options, &[], None)?;
    let mut items = geometry(&file, &raw, &options);
    let cost = "the side is taken from specimen.toml, whatever the id says";
    items.extend(
        names::of_id(&file.specimen.id, file.specimen.side)
            .map(|found| Item::new("specimen.id", State::Look, found, cost)),
    );
    let measured = laxity::judge(&file, &raw, &options, &mut items);
    passive(&file, &raw, &mut items);
    if let Some(folder) = &args.write_laxity {
        for (name, trials) in &measured {
            store::write(&folder.join(format!("{name}.csv")), sim::laxity::trials_csv(trials).as_bytes())?;
        }
    }
    let mut plots = None;
    if !measured.is_empty() {
        let place = args.out.clone().unwrap_or_else(|| args.dir.join("build")).join("check.html");
        store::write(&place, page::page(&file.specimen.id, &measured, &items).as_bytes())?;
        plots = Some(place);
    }
    let faults = items.iter().filter(|i| i.state == State::Fault).count();
    let text = match args.json {
        true => String::from_utf8_lossy(&crate::record::json(&items)).into_owned(),
        false => words(&file, &items, plots, args),
    };
    if faults == 0 {
        return Ok(text);
    }
    let first = items.iter().find(|i| i.state == State::Fault).map(|i| format!("{}: {}", i.input, i.found));
    Err(BuildError::Faults { table: text, count: faults, first: first.unwrap_or_default() })
}

/// The table and what to type next.
fn words(file: &SpecimenFile, items: &[Item], plots: Option<PathBuf>, args: &CheckArgs) -> String {
    let side = if file.specimen.side == Side::Left { "left" } else { "right" };
    let mut text = format!("{}, {side} knee\n\n", file.specimen.id);
    let width = items.iter().map(|i| i.input.len()).max().unwrap_or(0);
    for i in items {
        let state = match i.state {
            State::Ok => "ok",
            State::Look => "LOOK",
            State::Missing => "missing",
            State::Fault => "FAULT",
        };
        let _ = writeln!(text, "{state:8}{:width$}  {}", i.input, i.found);
        if !i.cost.is_empty() {
            let _ = writeln!(text, "        {:width$}  -> {}", "", i.cost);
        }
    }
    let count = |s: State| items.iter().filter(|i| i.state == s).count();
    let _ = writeln!(
        text,
        "\n{} ok, {} to look at, {} missing, {} that would stop a build",
        count(State::Ok),
        count(State::Look),
        count(State::Missing),
        count(State::Fault)
    );
    if let Some(place) = plots {
        let _ = writeln!(text, "Load against displacement: {}", place.display());
    }
    if count(State::Fault) == 0 {
        let _ = writeln!(text, "Next: {}", command_on("build", &args.dir));
    }
    text
}

/// Bones, scans, side and points.
fn geometry(file: &SpecimenFile, raw: &RawSpecimen, options: &BuildOptions) -> Vec<Item> {
    let mut items = Vec::new();
    let there = |path: &str| raw.files.keys().any(|f| f == path || f.starts_with(&format!("{path}/")));
    for judged in ingest::judge_surfaces(file, raw, &options.ingest) {
        if !there(&judged.path) {
            let what = format!("{} is not there", judged.path);
            items.push(Item::new(
                &judged.key,
                State::Fault,
                what,
                "put the file there, or correct the path in specimen.toml",
            ));
            continue;
        }
        items.push(match judged.result {
            Err(e) => Item::new(&judged.key, State::Fault, e.to_string(), ""),
            Ok(counts) => {
                let coloured = counts.coloured;
                let found = format!(
                    "{} triangles, {:.0} mm wide{}{}",
                    counts.triangles,
                    counts.width_mm,
                    if coloured { ", coloured" } else { "" },
                    judged.warnings.iter().map(|w| format!("; {w}")).collect::<String>()
                );
                let state = if judged.warnings.is_empty() { State::Ok } else { State::Look };
                let grey = judged.key.starts_with("scans.") && !coloured;
                let cost = if grey {
                    "no colours: outlined sites cannot be found; sites come from the literature"
                } else {
                    ""
                };
                Item::new(&judged.key, state, found, cost).telling(judged.warnings)
            }
        });
    }
    let pictures = [("ct.volume", &file.ct.volume), ("ct.labels", &file.ct.labels)];
    let absent: Vec<Item> = pictures
        .iter()
        .filter_map(|(key, path)| Some((*key, path.as_deref().filter(|p| !there(p.trim_end_matches('/')))?)))
        .map(|(key, path)| {
            let what = format!("{path} is not there");
            Item::new(key, State::Fault, what, "put it there, or correct the path in specimen.toml")
        })
        .collect();
    if absent.is_empty() && file.ct.volume.is_some() {
        items.extend(volume(file, raw, options));
    }
    items.extend(absent);
    if file.ct.volume.is_none() {
        if items.iter().all(|i| i.state != State::Fault) {
            whole(file, raw, options, &mut items);
        } else {
            items.extend(not_yet(file));
        }
    }
    items
}

/// Points that are named and not looked at, because surfaces are at fault.
fn not_yet(file: &SpecimenFile) -> impl Iterator<Item = Item> {
    let named = [
        ("points.landmarks", &file.points.landmarks),
        ("points.marks", &file.points.marks),
        ("points.attachments", &file.points.attachments),
    ];
    named.into_iter().filter_map(|(key, path)| {
        let found = format!("{}: not looked at, because a surface is at fault", path.as_ref()?);
        Some(Item::new(key, State::Look, found, "mend what is a FAULT, then check again"))
    })
}

/// The CT volume and the label map beside it, as far as their files tell.
fn volume(file: &SpecimenFile, raw: &RawSpecimen, options: &BuildOptions) -> Vec<Item> {
    let cost = "the bones are segmented by the build";
    match look(&file.ct, raw, &options.segment) {
        Err(e) => {
            let of_labels = matches!(&e, StageError::File { place, .. } if place.key.as_deref() == Some("ct.labels"));
            let key = if of_labels { "ct.labels" } else { "ct.volume" };
            vec![Item::new(key, State::Fault, e.to_string(), "")]
        }
        Ok(seen) => {
            let odd: String = seen.warnings.iter().map(|w| format!("; {w}")).collect();
            let state = if odd.is_empty() { State::Ok } else { State::Look };
            let labels = seen.labels.map(|held| Item::new("ct.labels", State::Ok, format!("labels of {held}"), ""));
            std::iter::once(Item::new("ct.volume", state, seen.volume + &odd, cost)).chain(labels).collect()
        }
    }
}

/// What shows only when every surface is read: side, exchange, points.
fn whole(file: &SpecimenFile, raw: &RawSpecimen, options: &BuildOptions, items: &mut Vec<Item>) {
    let specimen = match ingest::ingest_file(file, raw, &options.ingest) {
        Ok(specimen) => specimen,
        Err(e) => return items.push(Item::new("specimen", State::Fault, e.to_string(), "")),
    };
    match check_anatomy(&specimen) {
        Ok(report) => items.push(side(report.side, file.specimen.side)),
        Err(e) => items.push(Item::new("specimen.side", State::Fault, e.to_string(), "")),
    }
    for (k, input, cost) in [
        (
            0,
            "points.landmarks",
            "the registration searches for its start; frames come from shape alone, without the femoral head",
        ),
        (1, "points.marks", "outlined sites are named by their place on the bone"),
        (2, "points.attachments", "fibres are laid by the program: marked sites, else the literature"),
    ] {
        let named = [&file.points.landmarks, &file.points.marks, &file.points.attachments][k];
        let path = named.as_deref().unwrap_or(OPTIONAL_PATHS[k]);
        if !raw.files.contains_key(path) {
            items.push(Item::new(input, State::Missing, format!("no {path}"), cost));
            continue;
        }
        items.push(match k {
            0 => points(input, &specimen, &specimen.landmarks),
            1 => points(input, &specimen, &specimen.marks),
            _ => Item::new(input, State::Ok, format!("{} fibres", specimen.given_fibres.len()), ""),
        });
    }
    for warning in &specimen.warnings {
        if !items.iter().any(|i| i.tells(warning)) {
            items.push(Item::new("specimen", State::Look, warning.text.clone(), "a build goes on"));
        }
    }
}

/// Which side the bones show, against the one that is given.
fn side(shown: Option<SideEvidence>, given: Side) -> Item {
    let Some(s) = shown else {
        return Item::new(
            "specimen.side",
            State::Look,
            ingest::NO_FIBULA,
            "the side cannot be checked; LCL and PFL are left out where their sites are missing",
        )
        .telling(vec![ingest::no_fibula()]);
    };
    let agrees = s.side == given;
    Item::new(
        "specimen.side",
        if s.confidence > 0.5 && agrees { State::Ok } else { State::Look },
        format!("the bones show a {:?} knee, certainty {:.0} %", s.side, 100.0 * s.confidence).to_lowercase(),
        if agrees { "" } else { "specimen.toml says the other side: look at it, and at what the bones' files hold" },
    )
}

/// Points of a table: how many, and whether they lie at their surfaces.
fn points(input: &str, specimen: &Specimen, all: &[NamedPoint]) -> Item {
    let frames = [
        (PointFrame::Ct, "ct", vec![&specimen.ct.femur, &specimen.ct.tibfib]),
        (PointFrame::ScanFemur, "scan_femur", vec![&specimen.scans.femur.mesh]),
        (PointFrame::ScanTibfib, "scan_tibfib", vec![&specimen.scans.tibfib.mesh]),
    ];
    let (mut found, mut far) = (Vec::new(), Vec::new());
    for (frame, name, meshes) in frames {
        let queries: Vec<SurfaceQuery> = meshes.iter().filter_map(|m| SurfaceQuery::new(m)).collect();
        let of_frame = all.iter().filter(|p| p.frame == frame).count();
        if of_frame > 0 {
            found.push(format!("{of_frame} in {name}"));
        }
        // points of hip, shaft and ankle may lie outside a cropped bone
        let mut off: Vec<f64> = all
            .iter()
            .filter(|p| p.frame == frame && of_knee(&p.name))
            .map(|p| queries.iter().map(|q| q.nearest(&p.point).distance).fold(f64::INFINITY, f64::min))
            .collect();
        off.sort_by(f64::total_cmp);
        let Some(middle) = off.get(off.len() / 2) else { continue };
        if *middle > FAR_MM {
            far.push(format!("those in {name} lie {middle:.0} mm off its surfaces"));
        }
    }
    if far.is_empty() {
        return Item::new(input, State::Ok, found.join(", "), "");
    }
    Item::new(
        input,
        State::Look,
        format!("{}; {}", found.join(", "), far.join("; ")),
        "look at the column frame, and at the unit: mm is expected",
    )
}

/// Measured passive flexion.
fn passive(file: &SpecimenFile, raw: &RawSpecimen, items: &mut Vec<Item>) {
    if file.passive.is_empty() {
        items.push(Item::new("passive", State::Missing, "no file named", "passive flexion is simulated, not compared"));
    }
    for (name, path) in &file.passive {
        let input = format!("passive.{name}");
        items.push(match raw.files.get(path) {
            None => Item::new(
                &input,
                State::Fault,
                format!("{path} is not there"),
                "put the file there, or correct the path",
            ),
            Some(bytes) => match crate::given::read_passive(name, path, bytes) {
                Ok(p) => Item::new(&input, State::Ok, format!("{} poses", p.poses.len()), ""),
                Err(e) => Item::new(&input, State::Fault, e.to_string(), ""),
            },
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use notices::Kind;

    #[test]
    fn bones_that_show_the_other_side_are_looked_at_whatever_the_certainty() {
        for given in [Side::Left, Side::Right] {
            for shown in [Side::Left, Side::Right] {
                for confidence in [0.1, 0.52, 0.9] {
                    let item = side(Some(SideEvidence { side: shown, confidence }), given);
                    let ok = shown == given && confidence > 0.5;
                    assert_eq!(item.state == State::Ok, ok, "{item:?}");
                    assert_eq!(item.cost.contains("the other side"), shown != given, "{item:?}");
                }
            }
        }
        assert_eq!(side(None, Side::Left).state, State::Look);
    }

    /// What an item tells is told once, however a stage words it; another finding is not hidden by a sentence that is part of one.
    #[test]
    fn what_an_item_tells_goes_by_its_values_and_not_by_its_words() {
        let spikes =
            |file: &str, count: usize| Kind::Spikes.notice("far off").file(file).count(count).at([1.0, 2.0, 3.0]);
        let own = vec![spikes("a.ply", 3), Kind::HoleFilled.notice("a hole was filled").of("femur")];
        let item = Item::new("ct.femur", State::Look, "far off; a hole was filled", "").telling(own.clone());
        for notice in &own {
            for words in ["", "reworded", "far off", "a hole"] {
                assert!(item.tells(&Notice { text: words.to_owned(), ..notice.clone() }), "{notice:?} as {words:?}");
            }
        }
        for other in
            [spikes("b.ply", 3), spikes("a.ply", 4), Kind::Specks.notice("far off"), Kind::HoleFilled.notice("a hole")]
        {
            assert!(!item.tells(&other), "{other:?}");
        }
        assert!(!Item::new("ct.femur", State::Look, "far off", "").tells(&own[0]), "words alone tell nothing");
    }
}
