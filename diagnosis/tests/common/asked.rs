//! Trials with what was measured in them.
use crate::common::deck::Asked;

/// Trials (test, flexion [deg], load) as asked of the deck, with the readings of each.
pub(crate) fn asked<'a>(trials: &[(&'a str, f64, [f64; 4])], measured: &[[f64; 5]]) -> Vec<Asked<'a>> {
    trials.iter().zip(measured).map(|(&(test, flexion, load), m)| ("t", test, flexion, load, *m)).collect()
}
