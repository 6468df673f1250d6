//! What menisci do in a model: share of a load in extension, laxity without them, time of a trial. The figures of docs/verification.md.
//!
//! `cargo run --release -p genu-stages --example menisci -- [--times] [--fit0] MODEL.json...`; a model without menisci is given those of the atlas. `--times` prints times
//! alone. `--fit0` fits the atlas' upper faces where the knee rests at 0 deg, which was tried and left.
#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "reads models and prints figures for the reader")]

#[path = "../../benches/common/clock.rs"]
mod clock;

use clock::Clock;
use meshes::surface::TriMesh;
use sim::coordinate::{FE, Load};
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use sim::trials::{Answer, TrialOptions, solve};
use sim::{Model, compile};
use stages::PerCartilage;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let (options, paths): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|a| a.starts_with("--"));
    for path in paths {
        println!("{path}");
        let mut loaded = load(Path::new(&path))?;
        let given = std::mem::take(&mut loaded.spec.menisci);
        let bare = compile(&loaded.spec, &loaded.meshes)?;
        loaded.spec.menisci = given;
        if loaded.spec.menisci.is_empty() {
            loaded.spec.menisci = of_atlas(&loaded, options.iter().any(|o| o == "--fit0").then_some(&bare))?;
        }
        if let Some(out) = options.iter().find_map(|o| o.strip_prefix("--write=")) {
            std::fs::write(out, serde_json::to_vec_pretty(&loaded.spec)?)?;
            continue;
        }
        let with = compile(&loaded.spec, &loaded.meshes)?;
        if options.iter().any(|o| o == "--times") {
            times(&bare, &with);
            continue;
        }
        shapes(&loaded.spec);
        println!("  without menisci");
        shares(&bare);
        println!("  with menisci");
        shares(&with);
        drawers(&bare, &with)?;
        times(&bare, &with);
    }
    Ok(())
}

/// A model with the surfaces it names.
struct LoadedModel {
    spec: ModelSpec,
    meshes: BTreeMap<String, MeshValue>,
}

fn load(path: &Path) -> Result<LoadedModel, Box<dyn Error>> {
    let spec: ModelSpec = serde_json::from_slice(&std::fs::read(path)?)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut meshes = BTreeMap::new();
    for name in spec.contact.meshes() {
        let bytes = std::fs::read(folder.join(name))?;
        let mesh = formats::read_surface(name, &bytes, &BTreeMap::new())?.mesh;
        meshes.insert(name.clone(), MeshValue::Surface(mesh));
    }
    Ok(LoadedModel { spec, meshes })
}

fn of_atlas(loaded: &LoadedModel, fit: Option<&Model>) -> Result<Vec<sim::spec::MeniscusSpec>, Box<dyn Error>> {
    let contact = &loaded.spec.contact;
    let surface = |name: &String| match loaded.meshes.get(name) {
        Some(MeshValue::Surface(mesh)) => Ok(mesh.clone()),
        _ => Err(format!("no surface {name}")),
    };
    let [medial, lateral]: [TriMesh; 2] = [surface(&contact.pairs[0].tibia)?, surface(&contact.pairs[1].tibia)?];
    let mut cartilage =
        PerCartilage { femur: surface(&contact.pairs[0].femur)?, tibia_medial: medial, tibia_lateral: lateral };
    if let Some(model) = fit {
        let answer = solve(model, 0.0, &Load::compression(20.0), &TrialOptions::default())?;
        cartilage.femur = cartilage.femur.moved(&answer.evaluation.pose.femur);
        println!("  fitted at 0 deg, AP {:.1} mm {:?}", answer.pose.ap_mm, answer.flags);
    }
    let slope = stages::menisci::first_slope(&contact.overclosure_mm, &contact.pressure_mpa);
    let mut menisci = stages::menisci::menisci(&cartilage, &loaded.spec.frames.tibia, slope, &BTreeMap::new())?.menisci;
    for (m, pair) in menisci.iter_mut().zip(&contact.pairs) {
        (m.femur, m.tibia) = (pair.femur.clone(), pair.tibia.clone());
    }
    Ok(menisci)
}

/// Width, height and area of the menisci.
fn shapes(spec: &ModelSpec) {
    for m in &spec.menisci {
        let last = m.sections[0].lower.len() - 1;
        let width: Vec<f64> = m.sections.iter().map(|s| (s.lower[last] - s.lower[0]).norm()).collect();
        let height = |k: usize| m.sections.iter().map(|s| (s.upper[k] - s.lower[k]).norm()).collect::<Vec<f64>>();
        println!(
            "  {}: widths {width:.1?}, heights inside {:.1?}, middle {:.1?}, outside {:.1?} mm",
            m.name,
            height(0),
            height(last / 2),
            height(last)
        );
        let horn = |h: &sim::spec::HornSpec, k: usize| (h.tibia - m.sections[k].lower[last / 2]).norm();
        let round: f64 = m.sections.windows(2).map(|w| (w[1].lower[last] - w[0].lower[last]).norm()).sum();
        println!(
            "    horns {:.1}, {:.1} mm; periphery {round:.0} mm",
            horn(&m.anterior_horn, 0),
            horn(&m.posterior_horn, m.sections.len() - 1)
        );
    }
}

fn told(model: &Model, answer: &Answer, ending: &str) -> Vec<f64> {
    let outputs = model.outputs(&answer.evaluation);
    outputs.into_iter().filter(|(name, _)| name.ends_with(ending)).map(|(_, x)| x).collect()
}

/// Share of a compression of 1000 N that the menisci bear, and where they are.
fn shares(model: &Model) {
    for flexion in [model.joint.ct_pose()[FE].to_degrees(), 0.0, 30.0, 60.0, 90.0] {
        for load in [20.0, 300.0, 1000.0] {
            let answer = match solve(model, flexion, &Load::compression(load), &TrialOptions::default()) {
                Ok(answer) => answer,
                Err(e) => {
                    println!("  {flexion:3.0} deg {load:5.0} N: {e}");
                    continue;
                }
            };
            let wrenches = &answer.evaluation.contact.wrench;
            let direct: Vec<f64> = wrenches.iter().map(|(f, _)| f.norm()).collect();
            let borne = told(model, &answer, "load_n");
            let share = borne.iter().sum::<f64>() / (borne.iter().sum::<f64>() + direct.iter().sum::<f64>());
            let each: Vec<f64> = borne.iter().zip(&direct).map(|(m, d)| 100.0 * m / (m + d)).collect();
            println!(
                "  {flexion:3.0} deg {load:5.0} N, AP {:.1} mm: menisci bear {:4.0} % (medial, lateral {each:.0?} %); cartilage {direct:.0?} N, menisci {borne:.0?} N, hoop {:.0?} N, back {:.1?} mm {:?}",
                answer.pose.ap_mm,
                100.0 * share,
                told(model, &answer, "hoop_n"),
                told(model, &answer, "posterior_mm"),
                answer.flags
            );
        }
    }
}

/// Anterior and posterior laxity under 133 N.
fn drawers(bare: &Model, with: &Model) -> Result<(), Box<dyn Error>> {
    let cut = |names: &[&str]| with.without(&names.iter().map(ToString::to_string).collect::<Vec<_>>());
    let knees = [
        ("without menisci", bare.clone()),
        ("with menisci", with.clone()),
        ("without medial", cut(&["meniscus_medial"])?),
        ("without lateral", cut(&["meniscus_lateral"])?),
        ("no ACL, menisci", cut(&["ACL"])?),
        ("no ACL, no medial", cut(&["ACL", "meniscus_medial"])?),
        ("no ACL, no menisci", bare.without(&["ACL".to_owned()])?),
    ];
    for (name, model) in &knees {
        let mut line = String::new();
        for flexion in [0.0, 30.0, 60.0, 90.0] {
            let at = |load: f64| solve(model, flexion, &Load::new(0.0, 0.0, 0.0, load, 20.0), &TrialOptions::default());
            let (front, back) = (at(133.0), at(-133.0));
            let place = |a: &Result<Answer, sim::SimError>| a.as_ref().map_or(f64::NAN, |a| a.pose.ap_mm);
            line += &format!("  {:6.2} {:6.2} ({:5.2})", place(&front), place(&back), place(&front) - place(&back));
        }
        println!("  {name:18} AP at +133, -133 N (laxity) at 0, 30, 60, 90 deg:{line}");
    }
    Ok(())
}

/// Processor time of laxity trials, side by side.
fn times(bare: &Model, with: &Model) {
    let trials = laxity_trials();
    let options = TrialOptions::default();
    let time = |model: &Model, trial: &LaxityTrial| {
        let start = Clock::start();
        let answer = sim::trials::solve_trial(model, trial, &options);
        (start.milliseconds(), answer.map_or(0, |a| a.evaluations))
    };
    let mut ratios: Vec<f64> = Vec::new();
    for _ in 0..5 {
        let (mut a, mut b) = ((0.0, 0), (0.0, 0));
        // in turn, so that the machine's other work falls on both
        for trial in &trials {
            for (model, sum) in [(bare, &mut a), (with, &mut b)] {
                let (ms, count) = time(model, trial);
                *sum = (sum.0 + ms, sum.1 + count);
            }
        }
        let mean = |sum: (f64, usize)| (sum.0 / trials.len() as f64, sum.1 as f64 / trials.len() as f64);
        let (x, y) = (mean(a), mean(b));
        println!(
            "  a trial: {:.2} ms, {:.1} evaluations, without; {:.2} ms, {:.1} evaluations, with menisci",
            x.0, x.1, y.0, y.1
        );
        ratios.push(y.0 / x.0);
    }
    ratios.sort_by(f64::total_cmp);
    println!("  ratio of times {ratios:.2?}");
}

fn laxity_trials() -> Vec<LaxityTrial> {
    let header = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm";
    let mut text = format!("{header}\n");
    for flexion in [0, 30, 60, 90] {
        for (test, vv, ie, ap) in [
            ("anterior", 0, 0, 133),
            ("posterior", 0, 0, -133),
            ("internal", 0, -5, 0),
            ("external", 0, 5, 0),
            ("varus", -10, 0, 0),
            ("valgus", 10, 0, 0),
        ] {
            text += &format!("{test}_{flexion},{test},{flexion},{vv},{ie},0,{ap},20,{flexion},,,,,\n");
        }
    }
    sim::laxity::read(text.as_bytes()).map(|t| t.trials).unwrap_or_default()
}
