//! Flexions and loads as a deck's steps: the paper's validation protocols [andreassen2025, section 2.6], and laxity trials, each from the CT pose.

use sim::coordinate::{FE, Load, SI, Six};
use sim::deck::{Amplitude, ChainCoordinate, Control, ControlKind, Curve, DeckProtocol, DeckStep};
use sim::joint::Joint;
use sim::laxity::LaxityTrial;
use sim::protocols::ProtocolOptions;
use sim::spec::ModelSpec;

/// How long flexion and loads are held at the end of a step [s]: the fibres' dashpots die away in it. As this program's explicit solver holds them.
const HELD_S: f64 = 0.6;
/// How long compression is ramped up [s]; as in the deck that settles and flexes.
const SETTLE_S: f64 = 0.7;
/// How long a knee is flexed and loaded [s]; with the hold after it, the 1.5 s of the published decks.
const RAMP_S: f64 = 0.9;
/// Increment [s]; as in the deck that settles and flexes.
const INCREMENT_S: f64 = 1e-4;
/// Turns below this are none [rad]: what is left of turning degrees into radians and back.
const NO_TURN: f64 = 1e-12;

/// The chain's coordinates, in the order in which a deck lists them.
const CHAIN: [ChainCoordinate; 6] = [
    ChainCoordinate::Fe,
    ChainCoordinate::Vv,
    ChainCoordinate::Ie,
    ChainCoordinate::Ml,
    ChainCoordinate::Ap,
    ChainCoordinate::Si,
];

/// Where a step leads, and in what time.
struct Leg {
    name: &'static str,
    fe_deg: f64,
    load: Load,
    seconds: f64,
}

/// Chain flexion from the CT pose [rad] and generalised loads [N mm, N], between two steps.
#[derive(Clone, Copy)]
struct Place {
    turn: f64,
    load: Six,
}

/// The paper's protocols with their usual numbers: AP laxity at each of its flexions, passive flexion, pivot shift.
pub(super) fn of_the_paper(spec: &ModelSpec, joint: &Joint) -> Vec<DeckProtocol> {
    let o = ProtocolOptions::default();
    let program = |name: String, legs: &[Leg]| program(spec, joint, format!("{}_{name}", spec.id), legs);
    let ap_laxity = o.ap_flexions_deg.iter().map(|fe_deg| {
        let leg = |name, ap: f64, seconds| {
            let load = Load::new(0.0, 0.0, 0.0, ap, o.compression_n);
            Leg { name, fe_deg: *fe_deg, load, seconds }
        };
        let (forwards, backwards) = (o.ap_load_n, -o.ap_load_n);
        let legs = [
            leg("LOAD", forwards, RAMP_S),
            leg("BACKWARDS", backwards, o.ap_way_s),
            leg("FORWARDS", forwards, o.ap_way_s),
        ];
        program(format!("ap_laxity_{fe_deg}deg"), &legs)
    });
    let mut out: Vec<DeckProtocol> = ap_laxity.collect();
    let alone = Load::compression(o.compression_n);
    let seconds = ((o.to_flexion_deg - o.from_flexion_deg) / o.rate_deg_per_s).max(RAMP_S);
    let flexed = [
        Leg { name: "START", fe_deg: o.from_flexion_deg, load: alone, seconds: RAMP_S },
        Leg { name: "FLEX", fe_deg: o.to_flexion_deg, load: alone, seconds },
    ];
    out.push(program("passive_flexion".into(), &flexed));
    let load = Load::new(o.pivot_valgus_nm, -o.pivot_internal_nm, 0.0, 0.0, o.compression_n);
    let pivot = Leg { name: "PIVOT_SHIFT", fe_deg: o.pivot_flexion_deg, load, seconds: RAMP_S };
    out.push(program(format!("pivot_shift_{}deg", o.pivot_flexion_deg), &[pivot]));
    out
}

/// A laxity trial: settled under its compression, then flexed and loaded.
pub(super) fn of_trial(spec: &ModelSpec, joint: &Joint, trial: &LaxityTrial) -> DeckProtocol {
    let leg = Leg { name: "LOAD", fe_deg: trial.fe_deg, load: trial.load, seconds: RAMP_S };
    program(spec, joint, format!("{}_trial_{}", spec.id, trial.trial), &[leg])
}

/// Settling in the CT pose under the first leg's compression, then the legs.
fn program(spec: &ModelSpec, joint: &Joint, name: String, legs: &[Leg]) -> DeckProtocol {
    let ct = joint.ct_pose()[FE];
    let load = Load::compression(legs.first().map_or(0.0, |leg| leg.load[SI]));
    let settle = Leg { name: "SETTLE", fe_deg: ct.to_degrees(), load, seconds: SETTLE_S };
    let mut at = Place { turn: 0.0, load: Six::zeros() };
    let mut steps = Vec::new();
    for leg in std::iter::once(&settle).chain(legs) {
        let to = Place { turn: leg.fe_deg.to_radians() - ct, load: leg.load.generalised() };
        steps.push(DeckStep {
            name: leg.name.into(),
            duration_s: leg.seconds + HELD_S,
            increment_s: Some(INCREMENT_S),
            contact: true,
            controls: controls((spec, joint), leg, [at, to]),
        });
        at = to;
    }
    DeckProtocol { name, lost_half_increment: true, steps, quirks: Vec::new() }
}

/// What a step imposes in the deck's signs; loads that stay 0 are left out.
fn controls((spec, joint): (&ModelSpec, &Joint), leg: &Leg, [from, to]: [Place; 2]) -> Vec<Control> {
    let one = |coordinate: ChainCoordinate| {
        let (clinical, sign) = joint.from_chain(coordinate, spec.frames.chain.as_ref());
        let turn = Some(to.turn - from.turn).filter(|t| t.abs() > NO_TURN).unwrap_or(0.0);
        let (kind, [a, b]) = match clinical == FE {
            true => (ControlKind::Motion, [0.0, turn]),
            false => (ControlKind::Load, [from.load[clinical], to.load[clinical]]),
        };
        let largest = if a.abs() > b.abs() { a } else { b };
        if kind == ControlKind::Load && largest == 0.0 {
            return None;
        }
        let amplitude = (a != b).then(|| Amplitude {
            name: format!("{}_{}", leg.name, clinical.name().to_uppercase()),
            curve: Curve::SmoothStep,
            points: vec![[0.0, a / largest], [leg.seconds, b / largest], [leg.seconds + HELD_S, b / largest]],
        });
        // + 0: a hold is 0, not -0
        Some(Control { coordinate, kind, magnitude: sign * largest + 0.0, amplitude })
    };
    CHAIN.into_iter().filter_map(one).collect()
}
