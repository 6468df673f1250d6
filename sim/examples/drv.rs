use sim::abaqus::MeshValue;
use sim::explicit::*;
use sim::joint::*;
use std::time::Instant;
pub fn load(dir: &str) -> (sim::spec::ModelSpec, std::collections::BTreeMap<String, MeshValue>) {
    let spec: sim::spec::ModelSpec =
        serde_json::from_slice(&std::fs::read(format!("{dir}/model.json")).unwrap()).unwrap();
    let mut meshes = std::collections::BTreeMap::new();
    for n in spec.contact.pairs.iter().flat_map(|p| [&p.femur, &p.tibia]) {
        let b = std::fs::read(format!("{dir}/{n}")).unwrap();
        meshes.insert(
            n.clone(),
            MeshValue::Surface(meshes::format::read_surface(n, &b, &Default::default()).unwrap().mesh),
        );
    }
    (spec, meshes)
}
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.
}
fn show(g: &Six) -> String {
    let mut s = String::new();
    for i in 0..6 {
        s += &format!("{:9.4}", if i < 3 { g[i].to_degrees() } else { g[i] });
    }
    s
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let l = load("/tmp/lead/deck");
    let m = sim::compile(&l.0, &l.1).unwrap();
    let t = Instant::now();
    let p0 = m.joint.pose(&Six::new(0.5, 0.0, 0.1, 0., 5., 0.5));
    let c = cpu();
    let mut s = 0.;
    for _ in 0..2000 {
        s += m.contact.press(&p0).energy;
    }
    println!("{s} press {:.1} us", (cpu() - c) / 2000. * 1e6);
    let c = cpu();
    for _ in 0..2000 {
        s += m.contact.evaluate(&p0).energy;
    }
    println!("{s} evaluate {:.1} us", (cpu() - c) / 2000. * 1e6);
    let mut o = ExplicitOptions::default();
    let mut ts = TrialSteps::default();
    let mode = a.get(1).map(|s| s.as_str()).unwrap_or("trial");
    for kv in a.iter().skip(2) {
        let (k, v) = kv.split_once('=').unwrap();
        let v: f64 = v.parse().unwrap();
        match k {
            "dt" => o.longest_increment_s = v,
            "safety" => o.safety = v,
            "mass" => o.mass_scale = v,
            "fixed" => o.control = if v > 0. { Control::Fixed } else { Control::Stable },
            "settle" => ts.settle_s = v,
            "load" => ts.load_s = v,
            "ld" => ts.load_damping = v,
            "sd" => ts.settle_damping = v,
            _ => panic!("{k}"),
        };
    }
    let prog = if mode == "deck" {
        deck_program(&m.joint, l.0.frames.chain.as_ref(), &l.0.protocols[0])
    } else {
        ts.program(&m.joint, 90.0, &Six::new(0., 0., 0., 0., 133., 20.)).unwrap()
    };
    let mut st = ExplicitState::at_rest();
    let c = cpu();
    let mut last = 0;
    let mut dts = vec![];
    let r = run(&m, &prog, &o, &mut st, &mut |p| {
        dts.push(p.increment_s);
        if p.step == "LAXITY" && p.state.time_s < 0.012 {
            println!(
                "{:.5} dt {:.2e} {} res {:.2} k {:.2} d {:.2} s {:.1} c {:.1} f {:.1}",
                p.state.time_s,
                p.increment_s,
                show(&m.joint.grood_suntay(&p.state.q)),
                p.state.energies.residual(),
                p.state.energies.kinetic,
                p.state.energies.damping,
                p.state.energies.strain,
                p.state.energies.contact,
                p.state.energies.friction
            );
        }
        let k = (p.fraction * 20.) as i32;
        if k != last {
            last = k;
            println!(
                "{} {:.2} n {} dt {:.1e} {} | bal {:.2e} ",
                p.step,
                p.fraction,
                p.state.increments,
                p.increment_s,
                show(&m.joint.grood_suntay(&p.state.q)),
                p.state.energies.balance_error()
            );
        }
        std::ops::ControlFlow::Continue(())
    });
    println!("{r:?} cpu {:.3} s, {} increments, wall {:?}", cpu() - c, st.increments, t.elapsed());
    dts.sort_by(f64::total_cmp);
    println!("dt min {:.2e} median {:.2e}", dts[0], dts[dts.len() / 2]);
    println!("{} {:?}", st.energies, st.energies);
    let s = snapshot(&m, &prog, &st).unwrap();
    println!("{}", show(&s.grood_suntay));
    println!("rate {:?}", st.rate.as_slice());
    println!("{:?}", s.bundle_forces.iter().map(|f| f.round()).collect::<Vec<_>>());
}
