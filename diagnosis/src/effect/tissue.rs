//! Tissues the model lacks, has elsewhere, or has too much of.

use super::Situation;
use super::lines::{line, point};
use nalgebra::Vector3;
use sim::joint::{AP, IE, ML, Six, VV};
use sim::ligament::Fibre;

/// A meniscus' lever about the tibial axis [mm].
const LEVER: f64 = 22.0;
/// Play before it resists: about the unloaded pose, and about the reference pose, where the condyles' rollback comes first [mm].
const PLAY: [f64; 2] = [1.5, 5.0];
/// Overrun at which a meniscus of hardening 1 is twice as stiff [mm].
const OVERRUN: f64 = 4.0;

/// How far the knee is from where a tissue is at rest: the unloaded pose of its flexion, or (`about` 1) the pose of the reference.
fn away(here: &Situation, about: usize) -> Six {
    if about == 0 { here.q - here.trial.neutral } else { here.q }
}

/// Wedges round the two compartments that resist sliding on the plateau; `v`: k [N/mm], further play [mm], hardening [-], further lever [mm].
pub(super) fn meniscus(here: &Situation, about: usize, v: &[f64]) -> Six {
    let d = away(here, about);
    let (play, lever) = ((PLAY[about.min(1)] + v[1]).max(0.0), (LEVER + v[3]).max(0.0));
    let mut out = Six::zeros();
    for arm in [lever, -lever] {
        let (across, along) = (d[ML], d[AP] + arm * d[IE]);
        let size = across.hypot(along);
        let over = (size - play).max(0.0);
        // a millimetre of onset, so that the slope is continuous
        let ramp = if over < 1.0 { 0.5 * over * over } else { over - 0.5 };
        let force = v[0] * ramp * (1.0 + v[2].max(0.0) * over / OVERRUN) / size.max(1e-9);
        out[ML] -= force * across;
        out[AP] -= force * along;
        out[IE] -= force * along * arm;
    }
    out
}

/// Motions at which a capsule of hardening 1 is twice as stiff: AP [mm], IE, VV [rad].
const HARD: [f64; 3] = [10.0, 0.3, 0.15];

/// Springs in AP [N/mm], IE and VV [N mm/rad], and their common hardening [-].
pub(super) fn capsule(here: &Situation, about: usize, v: &[f64]) -> Six {
    let d = away(here, about);
    let mut out = Six::zeros();
    for (k, j) in [AP, IE, VV].into_iter().enumerate() {
        out[j] = -v[k] * d[j] * (1.0 + v[3].max(0.0) * (d[j] / HARD[k]).powi(2));
    }
    out
}

/// Femoral and tibial ends of the library's lines: anterolateral, meniscofemoral, fabellofibular, medial retinaculum, popliteus
/// [medial, anterior, superior, mm].
const EXTRA: [([f64; 3], [f64; 3]); 5] = [
    ([-42.0, -5.0, 5.0], [-33.0, 5.0, -10.0]),
    ([8.0, -5.0, -5.0], [-15.0, -20.0, 0.0]),
    ([-22.0, -28.0, 12.0], [-40.0, -22.0, -15.0]),
    ([42.0, 0.0, 0.0], [20.0, 25.0, -12.0]),
    ([-40.0, 3.0, -8.0], [-5.0, -22.0, -28.0]),
];

/// A tension-only spring; `v`: stiffness [N/mm], strain in the CT pose [%], femoral anterior and superior, tibial medial and anterior shift of its
/// ends from the library's [mm].
pub(super) fn extra_bundle(here: &Situation, which: usize, v: &[f64]) -> Six {
    let Some((femur, tibia)) = EXTRA.get(which) else { return Six::zeros() };
    let femur = [femur[0], femur[1] + v[2], femur[2] + v[3]];
    let tibia = [tibia[0] + v[4], tibia[1] + v[5], tibia[2]];
    let (line, initial) = line(here, femur, tibia);
    let slack = initial / (1.0 + 0.01 * v[1]).max(0.5);
    -line.gradient * (v[0] * (line.length - slack).max(0.0))
}

/// Whether a bundle belongs to a structure.
fn belongs(bundle: &str, structure: &str) -> bool {
    bundle.strip_prefix(structure).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
}

/// The structures of `structure_loss` and `attachment`, in the catalogue's order.
const STRUCTURES: [&str; 9] = ["ACL", "PCL", "LCL", "sMCL", "dMCL", "ALS", "PFL", "POL", "PCAP"];

/// Fibres of a structure with the share of their load that is lost.
pub(super) fn loss(here: &Situation, structure: usize, share: f64) -> Six {
    let states = here.model.fibre_states(&here.pose);
    let mut out = Six::zeros();
    for (fibre, state) in here.model.fibres.iter().zip(&states) {
        if belongs(&here.model.bundles[fibre.bundle].name, STRUCTURES[structure.min(8)]) {
            out += state.line.gradient * (state.response.force * share.min(1.0));
        }
    }
    out
}

/// Pull of all fibres.
pub(super) fn all_fibres(here: &Situation) -> Six {
    let states = here.model.fibre_states(&here.pose);
    states.iter().fold(Six::zeros(), |sum, s| sum - s.line.gradient * s.response.force)
}

/// Change of all pulls when every reference strain changes by `change`.
pub(super) fn strain_change(here: &Situation, change: f64) -> Six {
    let states = here.model.fibre_states(&here.pose);
    let mut out = Six::zeros();
    for (fibre, state) in here.model.fibres.iter().zip(&states) {
        let bundle = &here.model.bundles[fibre.bundle];
        let u = state.line.length - fibre.initial_length;
        let mut other = bundle.clone();
        other.reference_strain += change;
        let more = other.response(u + other.initial_stretch()).force - state.response.force;
        out -= state.line.gradient * more;
    }
    out
}

/// A structure's sites moved: femoral anterior and superior, tibial anterior [mm].
pub(super) fn attachment(here: &Situation, structure: usize, v: &[f64]) -> Six {
    let (femur, tibia) = (&here.place.femur, &here.place.tibia);
    let femoral = femur.anterior * v[0] + femur.superior * v[1];
    let tibial = tibia.anterior * v[2];
    let mut out = Six::zeros();
    for fibre in &here.model.fibres {
        let bundle = &here.model.bundles[fibre.bundle];
        if !belongs(&bundle.name, STRUCTURES[structure.min(8)]) {
            continue;
        }
        let moved = moved_fibre(fibre, &femoral, &tibial);
        out += fibre_pull(here, &moved) - fibre_pull(here, fibre);
    }
    out
}

/// The fibre with its ends moved in the CT pose; its strain there stays.
pub(crate) fn moved_fibre(fibre: &Fibre, femoral: &Vector3<f64>, tibial: &Vector3<f64>) -> Fibre {
    let (femur, tibia) = (fibre.femur + femoral, fibre.tibia + tibial);
    Fibre { bundle: fibre.bundle, femur, tibia, initial_length: (femur - tibia).norm() }
}

/// Generalised force of a fibre.
pub(crate) fn fibre_pull(here: &Situation, fibre: &Fibre) -> Six {
    let bundle = &here.model.bundles[fibre.bundle];
    let line = fibre.line(&here.pose);
    let force = bundle.response(line.length - fibre.initial_length + bundle.initial_stretch()).force;
    -line.gradient * force
}

/// Force of fibres that are longer than straight by `longer(fibre, q)`: minus the slope of the energy that this adds.
fn wrapped(here: &Situation, structure: &str, longer: &dyn Fn(&Fibre, &Situation) -> f64) -> Six {
    let energy = |at: &Situation| -> f64 {
        let fibres = at.model.fibres.iter().filter(|f| belongs(&at.model.bundles[f.bundle].name, structure));
        fibres
            .map(|f| {
                let bundle = &at.model.bundles[f.bundle];
                let x = f.line(&at.pose).length - f.initial_length + bundle.initial_stretch();
                bundle.response(x + longer(f, at)).energy - bundle.response(x).energy
            })
            .sum()
    };
    Six::from_fn(|j, _| {
        let h = if j <= IE { 1e-5 } else { 1e-3 };
        let side = |s: f64| {
            let mut q = here.q;
            q[j] += s * h;
            energy(&here.place.situation(here.model, here.trial, here.load, &q))
        };
        -(side(1.0) - side(-1.0)) / (2.0 * h)
    })
}

/// The superficial MCL over the tibial rim: longer by h^2/2 (1/a + 1/b), where the rim stands `offset` proud of the line of the CT pose.
pub(super) fn mcl_wrap(here: &Situation, offset: f64) -> Six {
    let tibia = &here.place.tibia;
    let rim = point(tibia, [0.0, 0.0, -5.0]);
    wrapped(here, "sMCL", &|fibre, at| {
        let line = fibre.line(&at.pose);
        let crossing = |femur: &Vector3<f64>| {
            let (up, way) = (tibia.superior, femur - fibre.tibia);
            let part = ((rim - fibre.tibia).dot(&up) / way.dot(&up)).clamp(0.2, 0.95);
            (tibia.medial.dot(&(way * part + fibre.tibia)), part)
        };
        let ((now, part), (then, _)) = (crossing(&line.femur), crossing(&fibre.femur));
        let h = (offset - (now - then)).clamp(0.0, 20.0);
        0.5 * h * h * (1.0 / (part * line.length) + 1.0 / ((1.0 - part) * line.length))
    })
}

/// The posterior capsule over the condyles, out of touch from 30 deg on.
pub(super) fn pcap_wrap(here: &Situation, offset: f64) -> Six {
    wrapped(here, "PCAP", &|fibre, at| {
        let h = (offset * (1.0 - at.flexion.to_degrees() / 30.0).clamp(0.0, 1.3)).max(0.0);
        2.0 * h * h / fibre.line(&at.pose).length
    })
}
