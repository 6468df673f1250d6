//! `phantom`: writes a synthetic specimen, its laxity measured by the bench's laboratory on its true shape.

use crate::blind::{apart, kept};
use crate::error::BuildError;
use crate::record::json;
use crate::store;
use crate::told::{Told, schemas};
use blindbench::knee::{BundleInput, KneeInput};
use blindbench::laboratory::{Planned, make};
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, Free, Load, SI};
use sim::laxity::{LaxityTrial, Reference, Test, TrialResult, results_csv, trials_csv};
use sim::spec::PoseSpec;
use stages::assemble::AssembleOptions;
use stages::phantom::{MRI_PHANTOM, PhantomSpecimen};
use std::collections::BTreeMap;
use std::path::Path;

/// `phantom --json`, without `--build`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PhantomTold {
    /// phantom/1
    pub schema: &'static str,
    /// Which knee.
    pub id: String,
    /// The seed of its noise.
    pub seed: u64,
    /// The specimen's folder.
    pub folder: String,
    /// Its files, by their paths below the folder.
    pub files: Vec<String>,
}

/// Writes the phantom `id` to `dir`; gives the words to print. `hide`, an effect of the blind bench, is hidden in its laxity.
pub fn write(id: &str, seed: u64, volume: bool, hide: Option<&str>, dir: &Path) -> Result<Told, BuildError> {
    let fail = |e: String| BuildError::stage("phantom", e);
    let made = if volume { stages::phantom::phantom_volume(id, seed) } else { stages::phantom::phantom(id, seed) };
    let mut made = made.map_err(|e| fail(e.to_string()))?;
    let protocols = if id == MRI_PHANTOM { &LIVING[..] } else { &PROTOCOLS[..] };
    let left_out = measure(&mut made, protocols, hide.unwrap_or("null"), seed).map_err(fail)?;
    let same = store::read_text(&dir.join("specimen.toml")).is_ok_and(|t| t.contains(&format!("id = \"{id}\"")));
    if !store::list(dir).is_empty() && !same {
        return Err(BuildError::of_file(dir, format!("{} is not empty; give a new folder", dir.display())));
    }
    let edited = |(name, bytes): &&(String, Vec<u8>)| store::read(&dir.join(name)).is_ok_and(|there| there != *bytes);
    if let Some((name, _)) = made.files.iter().find(edited) {
        return Err(BuildError::of_file(
            &dir.join(name),
            format!(
                "{} is not as this phantom has it, so it is not written over; give a new folder, or move that file away",
                dir.join(name).display()
            ),
        ));
    }
    store::write_all(dir, &made.files)?;
    let data = PhantomTold {
        schema: schemas::PHANTOM,
        id: id.to_owned(),
        seed,
        folder: dir.display().to_string(),
        files: made.files.iter().map(|(name, _)| name.clone()).collect(),
    };
    let of_cut = if left_out == 0 {
        String::new()
    } else {
        format!(" Left out are {left_out} trials in which the cut knee lies out of its joint.")
    };
    let words = format!(
        "A synthetic knee, {id}, is in {}.{of_cut} Build its model: {}\n",
        dir.display(),
        crate::suggested::command_on("build", dir)
    );
    Ok(Told::words(words).with(&data))
}

/// What truth.json tells that a laboratory needs.
#[derive(Deserialize)]
struct Shape {
    frames_ct: Frames,
    sites_ct: BTreeMap<String, Site>,
}

#[derive(Deserialize)]
struct Frames {
    femur: AnatomicalFrame,
    tibia: AnatomicalFrame,
}

/// The ends of a site's long axis come first.
#[derive(Deserialize)]
struct Site {
    points: Vec<Point>,
}

/// Bundles of a phantom: name, ligament, fibres, reference strain [-], stiffness [N/mm]. Ours: a knee whose laxity is
/// that of intact ones, also as drawn about these (tests/phantom_laxity.rs).
const BUNDLES: [(&str, &str, usize, f64, f64); 14] = [
    ("ACL_AM", "ACL", 2, 1.04, 90.0),
    ("ACL_PL", "ACL", 2, 1.04, 80.0),
    ("LCL", "LCL", 3, 1.035, 100.0),
    ("sMCL_A", "sMCL", 1, 1.03, 100.0),
    ("sMCL_M", "sMCL", 1, 1.03, 100.0),
    ("sMCL_P", "sMCL", 1, 1.03, 100.0),
    ("dMCL", "dMCL", 3, 0.99, 100.0),
    ("PCL_AL", "PCL", 2, 0.92, 90.0),
    ("PCL_PM", "PCL", 2, 0.99, 70.0),
    ("ALS", "ALS", 2, 1.0, 50.0),
    ("PFL", "PFL", 2, 0.99, 60.0),
    ("POL", "POL", 2, 0.98, 60.0),
    ("PCAP_M", "PCAP_M", 3, 1.04, 80.0),
    ("PCAP_L", "PCAP_L", 3, 1.04, 80.0),
];

/// Loads along one axis at several flexions.
struct Protocol {
    source: &'static str,
    flexions_deg: &'static [f64],
    compression_n: f64,
    /// What is read, and with which noise.
    reads: Reads,
    /// Test and its loads [N m or N].
    tests: &'static [(Test, &'static [f64])],
}

/// What a protocol reads.
#[derive(Clone, Copy)]
enum Reads {
    /// Poses; tracking noise of rotations [deg] and translations [mm].
    Poses([f64; 2]),
    /// The displacement from the unloaded pose in the direction of the test, by an apparatus on the skin; noise of rotations [deg] and
    /// translations [mm]. The file states neither the noise nor the compression, which is tone of muscles.
    Displacements([f64; 2]),
}

/// The unloaded trial of displacements.
const UNLOADED: (Test, &[f64]) = (Test::Neutral, &[0.0]);

/// Laxity in vivo: a drawer by an arthrometer at 30 deg, and rotation at 30 and 90 deg. Noise is the scatter of such devices between readings
/// [milano2022; tsai2008].
const LIVING: [Protocol; 2] = [
    Protocol {
        source: "arthrometer",
        flexions_deg: &[30.0],
        compression_n: 20.0,
        reads: Reads::Displacements([0.5, 0.7]),
        tests: &[UNLOADED, (Test::Anterior, &[67.0, 134.0]), (Test::Posterior, &[-90.0])],
    },
    Protocol {
        source: "rotameter",
        flexions_deg: &[30.0, 90.0],
        compression_n: 20.0,
        reads: Reads::Displacements([1.4, 0.7]),
        tests: &[UNLOADED, (Test::Internal, &[-5.0]), (Test::External, &[5.0])],
    },
];

/// The paper's two protocols [andreassen2025].
const PROTOCOLS: [Protocol; 2] = [
    Protocol {
        source: "kla",
        flexions_deg: &[30.0, 90.0],
        compression_n: 20.0,
        reads: Reads::Poses([0.5, 0.4]),
        tests: &[
            (Test::Anterior, &[0.0, 44.5, 89.0, 133.4, 177.9]),
            (Test::Internal, &[0.0, -1.41, -2.82, -4.24, -5.65]),
            (Test::External, &[0.0, 1.41, 2.82, 4.24, 5.65]),
        ],
    },
    Protocol {
        source: "rks",
        flexions_deg: &[0.0, 30.0, 60.0, 90.0],
        compression_n: 50.0,
        reads: Reads::Poses([0.2, 0.2]),
        tests: &[
            (Test::Anterior, &[133.0]),
            (Test::Posterior, &[-133.0]),
            (Test::Internal, &[-7.0]),
            (Test::External, &[7.0]),
            (Test::Varus, &[-10.0]),
            (Test::Valgus, &[10.0]),
        ],
    },
];

impl Protocol {
    fn trials(&self) -> Vec<LaxityTrial> {
        let (Reads::Poses([turn, shift]) | Reads::Displacements([turn, shift])) = self.reads;
        let trial = |test: Test, flexion: f64, size: f64| {
            let mut load = Load::compression(self.compression_n);
            load[test.coordinate().unwrap_or(AP)] += size;
            let name = format!("{}_{flexion}deg_{}", test.name(), size.abs());
            LaxityTrial {
                sd: Free::from_fn(|c| Some(if c.turns() { turn } else { shift })),
                ..LaxityTrial::asked(name, test, flexion, load)
            }
        };
        let at = |flexion: f64| {
            self.tests.iter().flat_map(move |(test, sizes)| sizes.iter().map(move |size| (*test, flexion, *size)))
        };
        self.flexions_deg.iter().flat_map(|f| at(*f)).map(|(test, f, size)| trial(test, f, size)).collect()
    }
}

/// Adds laxity/ and truth/laxity.json to a phantom's files, and names them in its specimen.toml. As in a bench, trials in which a cut knee lies out of its
/// joint are left out of the files and of the truth's signature; gives how many.
///
/// Errors: an unknown effect; a cut knee that lies out of its joint in half of a data set.
fn measure(made: &mut PhantomSpecimen, protocols: &[Protocol], hide: &str, seed: u64) -> Result<usize, String> {
    let knee = knee(made)?;
    let files = &mut made.files;
    let sets: Vec<(&Protocol, Vec<LaxityTrial>)> = protocols.iter().map(|p| (p, p.trials())).collect();
    let plan: Vec<Planned> =
        sets.iter().flat_map(|(p, trials)| trials.iter().map(|t| crate::blind::planned(p.source, t))).collect();
    let mut case = make(&knee, &plan, "phantom", (hide, 1.0), seed).map_err(|e| e.to_string())?;
    if let Some(of) = apart(&case, &plan) {
        return Err(no_test(hide, &of));
    }
    let left_out = case.truth.out_of_joint.clone();
    case.truth.signature = kept(&case.truth.signature, &left_out);
    let mut read = sets.iter().flat_map(|(_, trials)| trials).zip(&case.readings).enumerate();
    let mut table = "\n[laxity]\n".to_owned();
    for (protocol, trials) in &sets {
        let own = read.by_ref().take(trials.len()).filter(|(k, _)| !left_out.contains(k));
        let (trials, of): (Vec<LaxityTrial>, Vec<Free<f64>>) = own.map(|(_, (t, r))| (t.clone(), Free(*r))).unzip();
        let source = protocol.source;
        let text = match protocol.reads {
            Reads::Poses(_) => poses_csv(&trials, &of),
            Reads::Displacements(_) => displacements_csv(&trials, &of),
        };
        files.push((format!("laxity/{source}.csv"), text.into_bytes()));
        table += &format!("{source} = \"laxity/{source}.csv\"\n");
    }
    files.push(("truth/laxity.json".into(), json(&case.truth)));
    let toml = files.iter_mut().find(|(name, _)| name == "specimen.toml").ok_or("no specimen.toml")?;
    toml.1.extend(table.bytes());
    Ok(left_out.len())
}

/// Why a hidden effect leaves no test: trials of each data set in which the knee lies out of its joint, and how many there are.
fn no_test(hide: &str, of: &[(String, [usize; 2])]) -> String {
    let each: Vec<String> =
        of.iter().map(|(source, [out, all])| format!("{out} of {all} trials of {source}")).collect();
    format!(
        "--hide {hide}: the knee lies out of its joint in {}; fewer than half of each data set was expected. Give another --seed, or hide another effect",
        each.join(" and ")
    )
}

/// Readings as poses.
fn poses_csv(trials: &[LaxityTrial], readings: &[Free<f64>]) -> String {
    let result = |(t, r): (&LaxityTrial, &Free<f64>)| TrialResult {
        trial: t.clone(),
        pose: PoseSpec { fe_deg: t.fe_deg, ..PoseSpec::default() }.moved(r),
        forces_n: vec![],
        outputs: vec![],
        flags: vec![],
        bands: vec![],
    };
    let results: Vec<TrialResult> = trials.iter().zip(readings).map(result).collect();
    results_csv(&[], &results)
}

/// Readings as displacements from the unloaded trial of the flexion, in the coordinate of the test; compression and noise are not told.
fn displacements_csv(trials: &[LaxityTrial], readings: &[Free<f64>]) -> String {
    let mut out: Vec<LaxityTrial> = Vec::new();
    for (t, read) in trials.iter().zip(readings) {
        let mut told = LaxityTrial { sd: Free::all(None), ..t.clone() };
        told.load[SI] = 0.0;
        let zero = trials.iter().position(|z| z.test == Test::Neutral && z.fe_deg == t.fe_deg);
        // a trial whose unloaded one was left out has nothing to be read from
        if t.test != Test::Neutral && zero.is_none() {
            continue;
        }
        if let (Some(c), Some(k)) = (t.test.coordinate(), zero) {
            told.measured[c] = Some(read[c] - readings[k][c]);
            let load = Load::default();
            told.reference = Some(Reference { trial: trials[k].trial.clone(), load, fe_deg: t.fe_deg });
        }
        out.push(told);
    }
    trials_csv(&out)
}

/// The phantom's true shape as the laboratory sees it: what bears is the outer surface of bone and cartilage together.
///
/// Errors: files of a phantom that are not there, or not as [`stages::phantom`] writes them.
pub fn knee(made: &PhantomSpecimen) -> Result<KneeInput, String> {
    let name = "truth/truth.json";
    let (_, truth) = made.files.iter().find(|(n, _)| n == name).ok_or_else(|| format!("no {name}"))?;
    let shape: Shape = serde_json::from_slice(truth).map_err(|e| format!("{name}: {e}"))?;
    let bundle = |&(name, ligament, count, reference_strain, stiffness): &(&str, &str, usize, f64, f64)| {
        let all: Vec<_> = BUNDLES.iter().filter(|b| b.1 == ligament).collect();
        let total: usize = all.iter().map(|b| b.2).sum();
        let before: usize = all.iter().take_while(|b| b.0 != name).map(|b| b.2).sum();
        let anterior = shape.frames_ct.tibia.anterior;
        let ends = |bone: &str| -> Result<Vec<Point>, String> {
            let site =
                shape.sites_ct.get(&format!("{ligament}@{bone}")).ok_or_else(|| format!("no site {ligament}"))?;
            let [a, b] = site.points[..2] else { return Err(format!("site {ligament} has no long axis")) };
            // the first bundle is the anterior one
            let (first, last) = if (a - b).dot(&anterior) >= 0.0 { (a, b) } else { (b, a) };
            let at = |k: usize| first + (last - first) * ((k as f64 + 0.5) / total as f64);
            Ok((before..before + count).map(at).collect())
        };
        let fibres: Vec<(Point, Point)> = ends("femur")?.into_iter().zip(ends("tibfib")?).collect();
        let length = fibres.iter().map(|(f, t)| (f - t).norm()).sum::<f64>() / count as f64;
        Ok(BundleInput { name: name.into(), reference_strain, stiffness, reference_length: length, fibres })
    };
    let law = AssembleOptions::default();
    let (x, p) = (&law.overclosure_mm, &law.pressure_mpa);
    let contact_slope = match (x.as_slice(), p.as_slice()) {
        ([.., x0, x1], [.., p0, p1]) => (p1 - p0) / (x1 - x0),
        _ => return Err("the contact law has fewer than two points".into()),
    };
    Ok(KneeInput {
        bundles: BUNDLES.iter().map(bundle).collect::<Result<_, String>>()?,
        femur: made.bearing[0].clone(),
        tibia: vec![made.bearing[1].clone()],
        contact_slope,
        frames: (shape.frames_ct.femur, shape.frames_ct.tibia),
    })
}
