//! docs/paper.md: the paper's tables beside ours, from its own parameters on its own knee, and from our calibrations in finished builds.

mod calibrated;
mod cost;
mod picture;

pub use calibrated::calibrated_part;

use crate::error::BuildError;
use crate::import::{ImportArgs, imported};
use calibration::design::Design;
use sim::mesh::MeshValue;
use sim::protocols::ProtocolOptions;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use validation::paper::{self, AtPose, Scores};
use validation::validate::{Source, compare};
use validation::{figures, published};

/// The two fitted numbers: how far the MRI cartilages of the medial and the lateral plateau are lowered [mm].
pub const FITTED_MM: [f64; 2] = [5.5, 5.5];
/// Tilt of the lateral plateau that tests why Table 7 is missed [deg].
const TILT_DEG: f64 = 8.0;
/// The page.
pub const PAGE: &str = "docs/paper.md";
/// What parts it: below stands what needs builds.
pub const BUILDS: &str = "\n# From our calibrations\n";
const SPECIMEN: &str = "S192803";
const SOURCES: [&str; 2] = ["kla", "rks"];

type Meshes = BTreeMap<String, MeshValue>;
/// A picture's file name in docs/pictures and its bytes.
pub type Drawn = (String, Vec<u8>);

/// The published deck with the fibres of the models that the paper calibrated; `lowered`: the plateaus, medial and lateral [mm].
fn deck(shared: &Path, lowered: [f64; 2]) -> Result<(ModelSpec, Meshes), BuildError> {
    let folder = shared.join("published/S192803");
    let parts = ["tibia_medial", "tibia_lateral"].map(str::to_owned);
    let args = ImportArgs {
        deck: folder.join("deck/S192803_MAIN_LAXITY_Anterior_30deg_0.inp"),
        out: PathBuf::new(),
        fibres: Some(folder.join("ligament_fibres.csv")),
        variant: Some("CTS".into()),
        parameters: Some("KLA".into()),
        lowered: parts.into_iter().zip(lowered).collect(),
    };
    let deck = imported(&args)?;
    Ok((deck.spec, deck.meshes))
}

/// Under 150 N at the flexions of the paper's tables: what its own tables fit best.
fn protocols() -> ProtocolOptions {
    let ap_flexions_deg = vec![30.9, 60.8, 90.7];
    ProtocolOptions { compression_n: 150.0, ap_flexions_deg, pivot_flexion_deg: 30.9, ..ProtocolOptions::default() }
}

fn fault(e: impl std::fmt::Display) -> BuildError {
    BuildError::File(format!("paper: {e}"))
}

/// A model with Table 4's values.
fn table4(specimen: &str, source: &str, spec: &ModelSpec) -> Result<ModelSpec, BuildError> {
    let design = Design::of_model(spec).map_err(fault)?;
    let values = published::parameters(specimen, source).unwrap_or_default();
    let of_model: Vec<f64> =
        design.variables.iter().filter_map(|v| values.get(v.number as usize - 1)).copied().collect();
    Ok(design.apply(spec, &of_model))
}

/// Specimen 1 with Table 4's parameters, and what its two models answer to the protocols.
pub struct Knee {
    /// KLA's model and RKS's.
    pub specs: [ModelSpec; 2],
    /// Their meshes.
    pub meshes: Meshes,
    /// Their answers.
    pub sources: Vec<Source>,
}

/// Specimen 1 from its published deck, the plateaus, medial and lateral, `lowered` [mm], the lateral one tilted, its outer side up.
///
/// Errors: published data that are not there, no rest.
pub fn knee(shared: &Path, lowered: [f64; 2], tilted_deg: f64) -> Result<Knee, BuildError> {
    let (spec, mut meshes) = deck(shared, lowered)?;
    tilt_lateral(&spec, &mut meshes, tilted_deg);
    let specs = [table4(SPECIMEN, "kla", &spec)?, table4(SPECIMEN, "rks", &spec)?];
    let sources = both(SPECIMEN, specs.each_ref().map(|spec| (spec, &meshes)))?;
    Ok(Knee { specs, meshes, sources })
}

/// The lateral plateau turned about the tibia's anterior axis through its middle, its outer side up by `deg`, as a shear: what tests a cause.
fn tilt_lateral(spec: &ModelSpec, meshes: &mut Meshes, deg: f64) {
    let (frame, slope) = (&spec.frames.tibia, deg.to_radians().tan());
    if let Some(MeshValue::Surface(face)) = meshes.get_mut("meshes/articular_tibia_lateral.ply") {
        let across: Vec<f64> = face.vertices.iter().map(|p| (p - frame.origin).dot(&frame.medial)).collect();
        let middle = across.iter().sum::<f64>() / across.len().max(1) as f64;
        for (p, x) in face.vertices.iter_mut().zip(across) {
            *p += frame.superior * (slope * (middle - x));
        }
    }
}

/// Both models of a knee under the protocols, each with its meshes.
fn both(specimen: &str, models: [(&ModelSpec, &Meshes); 2]) -> Result<Vec<Source>, BuildError> {
    let mut out = Vec::new();
    for (name, (spec, meshes)) in SOURCES.iter().zip(models) {
        let model = sim::compile(spec, meshes).map_err(fault)?;
        let simulated = Source::simulated(name, spec, &model, &protocols());
        out.push(simulated.map_err(|e| fault(format!("{specimen} {name}: {e}")))?.0);
    }
    Ok(out)
}

fn list(rows: &[[String; 3]]) -> String {
    let line = |r: &[String; 3]| format!("| {} | {} | {} |\n", r[0], r[1], r[2]);
    "| statement | paper | ours |\n|---|---|---|\n".to_owned() + &rows.iter().map(line).collect::<String>()
}

fn summary(s: &Scores) -> Vec<String> {
    let each = |v: &[(String, f64)]| v.iter().map(|(n, x)| format!("{n} {x:.1}")).collect::<Vec<_>>().join(", ");
    vec![
        each(&s.table5_n),
        format!("{:.1}", s.table6),
        format!("{} of {}", s.directions.0, s.directions.1),
        format!("{:.0}", s.table7_n),
        each(&s.acl_n),
    ]
}

/// From the published parameters, `shared` being the folder of the published data: the page's first part and its pictures.
///
/// Errors: published data that are not there, no rest.
pub fn published_part(shared: &Path) -> Result<(String, Vec<Drawn>), BuildError> {
    let mut text = format!(
        "# The paper's tables beside ours\n\n\
        Written by `cargo run --release --example paper`; with `--check` it fails where this page is older than the program. Every cell reads: ours (the paper's). \
        Source: [andreassen2025].\n\n\
        **The knee**: Specimen 1 ({SPECIMEN}) from its published Abaqus deck, with the fibres of the CT models (`import-abaqus --fibres ... --variant CTS`). \
        **Parameters**: the paper's Table 4 as printed, nothing calibrated here. **Loads**: 150 N of compression at 30.9, 60.8 and 90.7 deg; the paper does not say: these are \
        inferred from a deck and the flexion of its Table 6.\n\n\
        **Two numbers are fitted**: the cartilage of the CT models is not published; that of the MRI model stands in, its medial plateau lowered by {} mm and its lateral one \
        by {} mm (`--lower`). They were chosen for Table 5. So Table 5 and section 3.2 show what can be attained, not what is predicted. The section \"Table 7 from the poses of Table 6\" needs none.\n\n\
        ## Section 3.1, Table 4\n\n{}\n\
        Percent are of the second: of RKS, of Specimen 2. Of five usual rules (percent of the first, the second, their mean, the larger, the smaller) only this one gives all four figures of the paper.\n",
        FITTED_MM[0],
        FITTED_MM[1],
        list(&paper::parameters())
    );
    let mut rows = Vec::new();
    let mut knees = Vec::new();
    for (name, lowered, tilted) in [
        ("none fitted: MRI cartilage as it is", [0.0; 2], 0.0),
        ("two fitted", FITTED_MM, 0.0),
        ("a third, to test a cause: lateral plateau tilted, outer side up", FITTED_MM, TILT_DEG),
    ] {
        let knee = knee(shared, lowered, tilted)?;
        rows.push([vec![name.to_owned()], summary(&paper::scores(&knee.sources))].concat());
        knees.push(knee);
    }
    let Some(knee) = knees.get(1) else { return Err(fault("no model")) };
    let sources = &knee.sources;
    let line = |r: &Vec<String>| format!("| {} |\n", r.join(" | "));
    let _ = write!(
        text,
        "\n## How near\n\n\
        | plateaus | Table 5, RMS N | Table 6, RMS deg or mm | Table 6, change without ACL in the paper's direction | Table 7, RMS N | Table 7, intact ACL, ours less the paper's N |\n\
        |---|---|---|---|---|---|\n{}",
        rows.iter().map(line).collect::<String>()
    );
    text += &tables(sources);
    text += "\n![Figure 7](pictures/paper-figure7.svg)\n\n![Figure 8](pictures/paper-figure8.svg)\n";
    text += &at_poses(shared, knee)?;
    let (costs, mut drawn) = cost::costs(shared, knee)?;
    text += &costs;
    let name = "paper-attachments.png";
    text += &format!("\n## Attachments\n\n{}\n\n![Fibres on the published knee](pictures/{name})\n", picture::WORDS);
    drawn.push((name.to_owned(), picture::fibres(&knee.specs[0], &knee.meshes)?));
    for (name, svg) in [("7", figures::figure7(sources)), ("8", figures::figure8(sources, &[]))] {
        drawn.push((format!("paper-figure{name}.svg"), svg.into_bytes()));
    }
    Ok((text, drawn))
}

/// The largest step of AP between neighbouring poses of passive flexion, in words.
fn slack(sources: &[Source]) -> String {
    let steps = sources.iter().flat_map(|s| {
        s.passive_flexion
            .windows(2)
            .filter(|w| w.iter().all(Source::has_answer))
            .map(|w| (s.name.as_str(), w[0].pose.ap_mm - w[1].pose.ap_mm, &w[0].pose, &w[1].pose))
    });
    let largest = steps.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    largest.map_or(String::new(), |(name, _, a, b)| {
        format!(
            "Unloaded AP lies in a slack zone, so passive flexion goes where the plateau lets it: the largest step is {name}'s, from {:.1} mm at {:.0} deg to {:.1} mm at {:.0} deg.\n",
            a.ap_mm, a.fe_deg, b.ap_mm, b.fe_deg
        )
    })
}

/// Sections 3.2 to 3.4 of one knee.
fn tables(sources: &[Source]) -> String {
    format!(
        "\n## Sections 3.2 to 3.4 in its own words\n\n{}\n{}\n## Table 5: ligament forces under 133 N [N]\n\n{}\n## Table 6: the simulated pivot shift\n\n{}\n\
        ## Table 7: ligament forces in it [N]\n\n{}\n## Figures 7 and 8\n\n{}",
        list(&paper::sentences(sources, &compare(sources, &[]))),
        slack(sources),
        paper::table5(sources),
        paper::table6(sources),
        paper::table7(sources),
        paper::curves(sources)
    )
}

/// Both models at the poses that Table 6 prints: with Table 4 as printed, and before rounding.
///
/// Errors: published data that are not there.
pub fn poses(shared: &Path, knee: &Knee) -> Result<[Vec<AtPose>; 2], BuildError> {
    let mut out = [vec![], vec![]];
    for ((name, spec), source) in SOURCES.iter().zip(&knee.specs).zip(&knee.sources) {
        for (rows, spec) in out.iter_mut().zip([spec.clone(), unrounded(shared, name, spec)?]) {
            let model = sim::compile(&spec, &knee.meshes).map_err(fault)?;
            rows.extend(paper::at_published_poses(source, &model, &protocols()).map_err(fault)?);
        }
    }
    Ok(out)
}

/// Table 7 from Table 6's poses: no cartilage, nothing fitted; and what the cartilage would have to bear there.
fn at_poses(shared: &Path, knee: &Knee) -> Result<String, BuildError> {
    let [printed, exact] = poses(shared, knee)?;
    let ((_, rounded_miss), (table, miss)) = (paper::poses(&printed), paper::poses(&exact));
    let mut text = format!(
        "\n## Table 7 from the poses of Table 6: nothing fitted\n\n\
        The fibres at the printed poses, with the parameters of the calibration logs (Table 4 before rounding; ALS of KLA as printed, 1.00, where the log has 1.0999) [N]:\n\n{table}\n\
        They miss by {miss:.1} N (root mean square); with Table 4 as printed by {rounded_miss:.1} N. So fibres, ligament law and joint coordinates are the paper's; what keeps \
        the models above from Tables 6 and 7 is where the cartilage lets them rest.\n\n\
        For rest at these poses under the loads above, the cartilage must bear what ligaments and loads leave over. What the two-fitted models bear at the same poses, and where they \
        themselves rest:\n\n\
        | model | ACL | needed N | at mm lateral of the tibia's axis | ours there N | at mm | ours at rest N | at mm |\n|---|---|---|---|---|---|---|---|\n"
    );
    for p in &exact {
        let acl = if p.acl { "intact" } else { "none" };
        let cells: Vec<String> =
            [p.needed, p.borne, p.at_rest].concat().iter().map(|x| format!("{:.0}", x + 0.0)).collect();
        let _ = writeln!(text, "| {} | {acl} | {} |", p.source, cells.join(" | "));
    }
    let mean = |f: &dyn Fn(&AtPose) -> f64| exact.iter().map(f).sum::<f64>() / exact.len().max(1) as f64;
    let _ = writeln!(
        text,
        "\n**Why Tables 6 and 7 are missed**: in the mean the paper's poses need the cartilage's force {:.0} mm lateral of the axis; ours bears it at {:.0} mm where it rests. \
        The shape of the stand-in was put to the test: its lateral plateau tilted by {TILT_DEG} deg, outer side up (4 and {TILT_DEG} deg were tried, after Tables 6 and 7 were seen; the tilt is no \
        measurement). Tables 6 and 7 come nearer (the last row of \"How near\"), Table 5 of KLA does not: at 30 deg under the posterior load that model rests on another branch. So \
        the plateau's shape is a cause, shown by trial; that it is the only one is not shown. Of 20 pairs of heights between 0 and 7 mm none brought both Table 5 within 10 N and Table 6 within 2.5.",
        mean(&|p| p.needed[1]),
        mean(&|p| p.at_rest[1])
    );
    Ok(text)
}

/// A specification with the values of the calibration log in place of Table 4's wherever they round to them.
fn unrounded(shared: &Path, source: &str, spec: &ModelSpec) -> Result<ModelSpec, BuildError> {
    let (printed, file) = (spec.clone(), shared.join("published/S192803"));
    let args = ImportArgs {
        deck: file.join("deck/S192803_MAIN_LAXITY_Anterior_30deg_0.inp"),
        out: PathBuf::new(),
        fibres: Some(file.join("ligament_fibres.csv")),
        variant: Some("CTS".into()),
        parameters: Some(source.to_uppercase()),
        lowered: vec![],
    };
    let log = imported(&args)?.spec;
    let mut out = printed;
    for b in &mut out.bundles {
        if let Some(l) = log.bundles.iter().find(|l| l.name == b.name) {
            // printed with two decimals
            if (l.reference_strain - b.reference_strain).abs() < 0.0051 {
                b.reference_strain = l.reference_strain;
            }
            if (l.stiffness_n_per_mm - b.stiffness_n_per_mm).abs() < 0.0051 {
                b.stiffness_n_per_mm = l.stiffness_n_per_mm;
            }
        }
    }
    Ok(out)
}
