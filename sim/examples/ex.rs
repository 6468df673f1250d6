use rayon::prelude::*;
use sim::joint::*;
use sim::model::*;
use sim::quasistatic::*;
use std::collections::BTreeMap;
use std::time::Instant;
fn arg(k: &str, d: f64) -> f64 {
    std::env::args().find_map(|a| a.strip_prefix(&format!("{k}=")).map(|v| v.parse().unwrap())).unwrap_or(d)
}
type Row = BTreeMap<String, String>;
fn rows(p: &str) -> Vec<Row> {
    csv::Reader::from_path(p).unwrap().deserialize().map(|r| r.unwrap()).collect()
}
fn main() {
    let dir = "/tmp/lead/deck";
    let spec: sim::spec::ModelSpec =
        serde_json::from_str(&std::fs::read_to_string(format!("{dir}/model.json")).unwrap()).unwrap();
    let mut ms = BTreeMap::new();
    for n in spec.bodies.iter().map(|b| &b.bone).chain(spec.contact.pairs.iter().flat_map(|p| [&p.femur, &p.tibia])) {
        let b = std::fs::read(format!("{dir}/{n}")).unwrap();
        ms.insert(
            n.clone(),
            sim::abaqus::MeshValue::Surface(meshes::format::read_surface(n, &b, &BTreeMap::new()).unwrap().mesh),
        );
    }
    let t = Instant::now();
    let model = compile_with(&spec, &ms, &sim::contact::ContactOptions { spacing_mm: arg("spacing", 0.8) }).unwrap();
    eprintln!("compile {:.2}s", t.elapsed().as_secs_f64());
    let mu = arg("mu", 0.03);
    let model = model.with_friction(mu).unwrap();
    let key = [
        ("ALS", "ALS"),
        ("ACLpl", "ACL_PL"),
        ("ACLam", "ACL_AM"),
        ("LCL", "LCL"),
        ("MCLA", "sMCL_A"),
        ("MCLM", "sMCL_M"),
        ("MCLP", "sMCL_P"),
        ("dMCL", "dMCL"),
        ("POL", "POL"),
        ("PCAPL", "PCAP_L"),
        ("PCAPM", "PCAP_M"),
        ("PCLal", "PCL_AL"),
        ("PCLpm", "PCL_PM"),
        ("PFL", "PFL"),
    ];
    let pubd = "/work/shared/published/S192803";
    let trials: Vec<Row> =
        rows(&format!("{pubd}/laxity_targets.csv")).into_iter().filter(|r| r["source"] == "KLA_MRI").collect();
    let ev = rows(&format!("{pubd}/abaqus_evaluations.csv"));
    let n = arg("rows", 12.0) as usize;
    let st = (ev.len() / n).max(1);
    let pick: Vec<&Row> = ev.iter().step_by(st).take(n).collect();
    let opt = SolverOptions { slip_mm: arg("slip", 0.02), step_on_the_way_mm: arg("tol", 5e-3), ..Default::default() };
    let f = |r: &Row, k: &str| r[k].parse::<f64>().unwrap();
    let mut da = vec![];
    let mut di = vec![];
    let mut tt = vec![];
    let mut evn = 0usize;
    let mut worst = vec![];
    let fail = std::sync::atomic::AtomicUsize::new(0);
    for e in &pick {
        let params: Vec<BundleParameters> = model
            .bundles
            .iter()
            .map(|b| {
                let k = key.iter().find(|x| x.1 == b.name).unwrap().0;
                let kk = if k.starts_with("MCL") { "MCL" } else { k };
                BundleParameters {
                    reference_strain: f(e, &format!("{k}_EREF")),
                    stiffness_n_per_mm: f(e, &format!("{kk}_K2")),
                    toe_strain: b.toe_strain,
                }
            })
            .collect();
        let m = model.with_parameters(&params).unwrap();
        let res: Vec<_> = trials
            .par_iter()
            .map(|r| {
                let t0 = Instant::now();
                let out = solve(&m, r, &opt);
                let dt = t0.elapsed().as_secs_f64();
                match out {
                    Ok((gs, c)) => Some((gs, c, dt)),
                    Err(er) => {
                        fail.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        eprintln!("{} {er}", r["trial"]);
                        None
                    }
                }
            })
            .collect();
        for (r, x) in trials.iter().zip(res) {
            let Some((gs, c, dt)) = x else { continue };
            tt.push(dt);
            evn += c;
            let ap = r["type"] == "Anterior";
            let c = format!("abserr_{}_{}", if ap { "AP" } else { "IE" }, r["trial"]);
            let ab = e.get(&c).unwrap_or_else(|| &e["abs_err_0deg_AP"]).parse::<f64>().unwrap();
            let v = if ap { gs[AP] } else { gs[IE].to_degrees() };
            let d = (v - f(r, if ap { "exp_GS_AP" } else { "exp_GS_IE" })).abs() - ab;
            if ap {
                da.push(d.abs())
            } else {
                di.push(d.abs())
            }
            worst.push((d, e["row"].clone(), r["trial"].clone(), v));
        }
    }
    let pct = |v: &mut Vec<f64>, p: f64| {
        v.sort_by(f64::total_cmp);
        let x = (v.len() - 1) as f64 * p;
        let i = x as usize;
        v[i] + (x - i as f64) * (v[(i + 1).min(v.len() - 1)] - v[i])
    };
    println!(
        "AP med {:.3} p90 {:.2} | IE med {:.3} p90 {:.2} | ms med {:.1} p90 {:.1} | evals/trial {:.0} fail {:?}",
        pct(&mut da, 0.5),
        pct(&mut da, 0.9),
        pct(&mut di, 0.5),
        pct(&mut di, 0.9),
        1e3 * pct(&mut tt, 0.5),
        1e3 * pct(&mut tt, 0.9),
        evn as f64 / tt.len() as f64,
        fail
    );
    if arg("show", 0.0) > 0.0 {
        // by trial: median signed
        let mut by: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for w in &worst {
            by.entry(w.2.clone()).or_default().push(w.0);
        }
        for (k, mut v) in by {
            println!(
                "{k:22} signed med {:+.2} p10 {:+.2} p90 {:+.2}",
                pct(&mut v, 0.5),
                pct(&mut v, 0.1),
                pct(&mut v, 0.9)
            );
        }
        worst.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        for w in worst.iter().take(arg("show", 0.0) as usize) {
            println!("{:+.2} row {} {} value {:.2}", w.0, w.1, w.2, w.3);
        }
    }
}
fn solve(m: &Model, r: &Row, opt: &SolverOptions) -> Result<(Six, usize), sim::SimError> {
    let f = |k: &str| r[k].parse::<f64>().unwrap();
    let load =
        Six::new(0., -f("deck_load_VV"), f("deck_load_IE"), -f("deck_load_ML"), f("deck_load_AP"), -f("deck_load_SI"));
    let si = Six::new(0., 0., 0., 0., 0., load[SI]);
    let fe = f("deck_final_GS_FE_deg").to_radians() - m.joint.ct_pose()[FE];
    let mut count = 0;
    let heavy = Dashpots { fibres: true, translation: 100., rotation: 100. };
    let light = Dashpots { fibres: true, translation: arg("ct", 0.01), rotation: arg("cr", 0.01) };
    let mut phases = vec![];
    let s = arg("settle", 0.0);
    if s > 0.0 {
        phases.push(Phase { flexion: 0., load: si, load_from: 0., flow: Some((s, heavy)), steps: 3 });
    }
    let n = arg("n", 18.) as usize;
    let q = arg("quasi", 0.) > 0.;
    phases.push(Phase {
        flexion: fe,
        load,
        load_from: arg("from", 1. / 3.),
        flow: if q { None } else { Some((arg("ramp", 0.9), light)) },
        steps: n,
    });
    if !q {
        phases.push(Phase {
            flexion: fe,
            load,
            load_from: 0.,
            flow: Some((arg("hold", 0.6), light)),
            steps: arg("h", 4.) as usize,
        });
    }
    let mut state = State::default();
    let mut l = if s > 0.0 { Six::zeros() } else { si };
    for p in &phases {
        state = follow(m, &state, &l, p, opt, &mut |_, s| count += s.evaluations)?;
        l = p.load;
    }
    if arg("eq", 1.) > 0. {
        let s = increment(
            m,
            &state,
            &Goal { flexion: fe, load, flow: None },
            &SolverOptions { iterations: 200, ..opt.clone() },
            true,
        )?;
        count += s.evaluations;
        state = s.state;
    }
    Ok((m.joint.grood_suntay(&state.q), count))
}
