//! A knee that a program's file gave, and what it answers.

use decks::ImportedDeck;
use sim::coordinate::Load;
use sim::trials::{TrialOptions, solve};

/// Name, femoral and tibial end, and a number of the ligament's own: a slack length, or where it begins to pull.
pub(crate) type Ligament = (&'static str, [f64; 3], [f64; 3], f64);

/// Half the opening of the ball [rad].
const OPENING: f64 = 1.1;

/// The lower part of a ball about the origin, for two numbers from -1 to 1. x forwards, y to the head, z to the right.
pub(crate) fn ball(radius: f64, u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (u * OPENING, v * OPENING);
    [radius * a.sin() * b.cos(), -radius * a.cos() * b.cos(), radius * b.sin()]
}

/// A flat square at a height, likewise; `half` is half its side.
pub(crate) fn plateau(half: f64, height: f64, u: f64, v: f64) -> [f64; 3] {
    [half * u, height, half * v]
}

/// Steps of a grid a side.
pub(crate) const N: usize = 60;

/// Points of a grid, row by row; `at` gives one for two numbers from -1 to 1.
pub(crate) fn points(at: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let along = |k: usize| 2.0 * k as f64 / N as f64 - 1.0;
    (0..=N).flat_map(|i| (0..=N).map(move |j| (i, j))).map(|(i, j)| at(along(i), along(j))).collect()
}

/// Quads of a grid of points, whose first has this number.
pub(crate) fn quads(first: usize, turned: bool) -> Vec<[usize; 4]> {
    let mut out = Vec::new();
    for i in 0..N {
        for j in 0..N {
            let [a, b, c, d] = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)].map(|(i, j)| first + i * (N + 1) + j);
            out.push(if turned { [a, d, c, b] } else { [a, b, c, d] });
        }
    }
    out
}

/// Where the knee stands under a load at a flexion, in Grood-Suntay coordinates, and its fibres' forces.
pub(crate) fn answer(deck: &ImportedDeck, flexion: f64, load: &Load) -> (Vec<f64>, Vec<f64>) {
    let model = sim::compile(&deck.spec, &deck.meshes).expect("a model");
    let q = solve(&model, flexion, load, &TrialOptions::default()).expect("an equilibrium").state.q;
    let forces = model.bundle_forces(&model.evaluate(&q).fibres);
    (model.joint.grood_suntay(&q).as_slice().to_vec(), forces)
}

/// A drawer under compression.
pub(crate) fn pressed(anterior: f64) -> Load {
    Load::new(0.0, 0.0, 0.0, anterior, 50.0)
}

/// By how much two lists of numbers differ at most, of those beyond 1 as a share.
pub(crate) fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + a.abs())).fold(0.0, f64::max)
}

/// What was told of a file.
pub(crate) fn told(deck: &ImportedDeck) -> String {
    deck.spec.warnings.join("\n")
}
