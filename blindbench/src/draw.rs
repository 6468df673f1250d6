//! Effects drawn from a number: which, where, and of what size.

use crate::BenchError;
use crate::asked::{Hidden, Size};
use crate::further::{AXES, FURTHER, LEVER};
use crate::hidden::{CUT, CUT_EFFECT, KINDS, cut};
use crate::tissue::SITE;
use crate::unknown::UNKNOWN;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// What a case is to be: drawn from a number so that kinds take turns.
pub fn kinds(count: usize) -> Vec<String> {
    (0..count)
        .map(|k| match k % 6 {
            0 | 3 => "null".to_owned(),
            4 if k % 12 == 4 => "compound".to_owned(),
            4 => "unknown".to_owned(),
            _ => KINDS[(k / 6 * 3 + k % 6) % KINDS.len()].0.to_owned(),
        })
        .collect()
}

/// Every kind of the catalogue in turn, and a null before each five.
pub fn every_kind(count: usize) -> Vec<String> {
    let all: Vec<&str> = KINDS.iter().map(|k| k.0).chain(FURTHER.iter().map(|k| k.0)).collect();
    let of = |k: usize| if k.is_multiple_of(6) { "null" } else { all[(k - k / 6 - 1) % all.len()] };
    (0..count).map(|k| of(k).to_owned()).collect()
}

/// So many cuts of each structure that can be cut, in turn, and as many whole knees: each round begins with one.
pub fn cuts(of_each: usize) -> Vec<String> {
    let round = || std::iter::once("null".to_owned()).chain(CUT.iter().map(|s| format!("cut_{s}")));
    (0..of_each).flat_map(|_| round()).collect()
}

/// The effects of a kind with their scopes; `factor` is on their sizes.
///
/// Errors: an unknown kind.
pub(crate) fn effects(
    (kind, factor): (&str, f64),
    sources: &[String],
    random: &mut ChaCha8Rng,
) -> Result<Vec<(Hidden, String)>, BenchError> {
    if let Some(cut) = cut(kind, factor) {
        return Ok(vec![(cut, "both".into())]);
    }
    let names: Vec<String> = match kind {
        "null" => vec![],
        "unknown" => vec![UNKNOWN[(random.random::<f64>() * UNKNOWN.len() as f64) as usize].0.to_owned()],
        "compound" => {
            let first = (random.random::<f64>() * KINDS.len() as f64) as usize;
            let second = (first + 1 + (random.random::<f64>() * (KINDS.len() - 1) as f64) as usize) % KINDS.len();
            vec![KINDS[first].0.to_owned(), KINDS[second].0.to_owned()]
        }
        other => vec![other.to_owned()],
    };
    names.into_iter().map(|effect| one(effect, factor, sources, random)).collect()
}

fn one(
    effect: String,
    factor: f64,
    sources: &[String],
    random: &mut ChaCha8Rng,
) -> Result<(Hidden, String), BenchError> {
    let tissue = ["meniscus", "capsule_envelope", "extra_bundle"].contains(&effect.as_str());
    let kind = if effect.starts_with(SITE) { "attachment" } else { effect.as_str() };
    let known = KINDS.iter().map(|k| (k.0, k.1, tissue)).chain(UNKNOWN).chain(FURTHER).find(|k| k.0 == kind);
    let Some((_, keys, of_the_knee)) = known else { return Err(unheard(&effect)) };
    let parameters = keys.iter().map(|key| sized(key, factor, random)).collect();
    let places = sources.len() as f64 + 1.0;
    let place = (random.random::<f64>() * places) as usize;
    let scope = if of_the_knee { None } else { sources.get(place) };
    let mut hidden = Hidden { effect, parameters };
    further(&mut hidden, factor, random);
    Ok((hidden, scope.cloned().unwrap_or_else(|| "both".into())))
}

/// A parameter with its value: its usual size by six to fourteen tenths, to either side where it may be negative.
fn sized((key, size, positive): &Size, factor: f64, random: &mut ChaCha8Rng) -> (String, f64) {
    let sign = if *positive || random.random::<bool>() { 1.0 } else { -1.0 };
    let factor = if *key == LEVER { 1.0 } else { factor };
    ((*key).to_owned(), sign * factor * size * (0.6 + 0.8 * random.random::<f64>()))
}

/// What is about one of several structures or axes: which one, and how much of it.
fn further(hidden: &mut Hidden, factor: f64, random: &mut ChaCha8Rng) {
    let mut among = |count: usize| ((random.random::<f64>() * count as f64) as usize).min(count - 1);
    match hidden.effect.as_str() {
        CUT_EFFECT => {
            hidden.parameters.insert("structure".into(), among(CUT.len()) as f64);
            let share = (0.3 + 0.7 * random.random::<f64>()) * factor;
            hidden.parameters.insert("loss".into(), share.clamp(0.0, 1.0));
        }
        "attachment" => hidden.effect = format!("{SITE}{}", CUT[among(CUT.len())]),
        "load_sign" => {
            let axis = among(AXES.len()) as f64;
            hidden.parameters.extend([("turned".to_owned(), 1.0), ("axis".to_owned(), axis)]);
        }
        _ => {}
    }
}

/// What a kind that nobody knows is told.
fn unheard(effect: &str) -> BenchError {
    let own = KINDS.iter().map(|k| k.0.to_owned());
    let further = FURTHER.iter().chain(&UNKNOWN).map(|k| k.0.to_owned());
    let of_structures = CUT.iter().flat_map(|s| [format!("cut_{s}"), format!("{SITE}{s}")]);
    let all: Vec<String> = own.chain(further).chain(of_structures).collect();
    BenchError::Effect(format!("no effect is called {effect}; there are null, compound, unknown, {}", all.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use std::collections::BTreeSet;

    fn drawn(kind: &str, factor: f64, seed: u64) -> (Hidden, String) {
        let sources = ["kla".to_owned(), "rks".to_owned()];
        effects((kind, factor), &sources, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap().remove(0)
    }

    #[test]
    fn a_bench_of_cuts_has_as_many_of_each_structure_as_whole_knees_in_whatever_part_of_it() {
        let of = |kinds: &[String], kind: &str| kinds.iter().filter(|k| *k == kind).count();
        let all = cuts(7);
        assert_eq!(all.len(), 7 * (CUT.len() + 1));
        for kind in CUT.iter().map(|s| format!("cut_{s}")).chain(["null".to_owned()]) {
            assert_eq!(of(&all, &kind), 7, "{kind}");
            // a bench that is stopped after whole rounds is one of fewer
            assert_eq!(of(&all[..10], &kind), 2, "{kind}");
        }
        let structures: BTreeSet<String> = all.iter().filter_map(|k| Some(cut(k, 1.0)?.cuts()?.0.to_owned())).collect();
        assert_eq!(structures.len(), CUT.len());
        assert!(cuts(0).is_empty());
    }

    #[test]
    fn a_loss_is_partial_or_whole_of_each_structure_and_a_sign_is_turned_in_full() {
        let (mut structures, mut axes, mut sites) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        for seed in 0..100 {
            let (hidden, scope) = drawn("structure_loss", 1.0, seed);
            let (structure, loss) = hidden.cuts().unwrap();
            assert!((0.3..=1.0).contains(&loss) && scope == "both", "{loss} {scope}");
            structures.insert(structure);
            let (sign, _) = drawn("load_sign", 0.5, seed);
            assert_eq!(sign.value("turned"), 1.0);
            axes.insert(sign.value("axis") as usize);
            sites.insert(drawn("attachment", 1.0, seed).0.effect);
        }
        assert_eq!((structures.len(), axes.len(), sites.len()), (CUT.len(), AXES.len(), CUT.len()));
        assert!(sites.iter().all(|s| s.starts_with(SITE)));
    }

    #[test]
    fn sizes_grow_with_the_factor_but_not_a_lever() {
        for (kind, keys, _) in FURTHER.iter().filter(|k| !["structure_loss", "load_sign"].contains(&k.0)) {
            let [one, two] = [1.0, 2.0].map(|factor| drawn(kind, factor, 3).0);
            for (key, _, _) in *keys {
                let grown = if *key == LEVER { 1.0 } else { 2.0 };
                assert!(
                    (two.value(key) - grown * one.value(key)).abs() < 1e-9 && one.value(key) != 0.0,
                    "{kind} {key}"
                );
            }
        }
    }

    #[test]
    fn every_kind_has_its_turn_and_one_that_nobody_knows_is_told_the_others() {
        let all: BTreeSet<String> = every_kind(34).into_iter().collect();
        assert_eq!(all.len(), KINDS.len() + FURTHER.len() + 1);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let told = effects(("gravitty", 1.0), &["kla".to_owned()], &mut random).unwrap_err().to_string();
        assert!(told.contains("gravitty") && told.contains("gravity") && told.contains("cut_ACL"), "{told}");
    }
}
