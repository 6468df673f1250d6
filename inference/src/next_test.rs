//! Laxity tests that nobody did yet. A calibration asks which of them would narrow what it knows most, a diagnosis which would tell its answers apart.

use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, Test};

/// Tests with their load [N m or N]: what an examiner's hand or an arthrometer applies, as a calibration thinks of them.
pub const BY_HAND: [(Test, f64); 6] = [
    (Test::Anterior, 134.0),
    (Test::Posterior, -134.0),
    (Test::Internal, -5.0),
    (Test::External, 5.0),
    (Test::Varus, -10.0),
    (Test::Valgus, 10.0),
];

/// Tests with their load [N m or N]: about what the apparatus of published knees applies, as a diagnosis thinks of them.
pub const BY_APPARATUS: [(Test, f64); 7] = [
    (Test::Anterior, 130.0),
    (Test::Posterior, -130.0),
    (Test::Internal, -5.0),
    (Test::External, 5.0),
    (Test::Varus, -8.0),
    (Test::Valgus, 8.0),
    (Test::Neutral, 0.0),
];

/// A test of one part or of several at once, each with its load along its own coordinate [N m or N], under a compression.
pub fn planned(parts: &[(Test, f64)], fe_deg: f64, compression_n: f64) -> LaxityTrial {
    let mut load = Load::compression(compression_n);
    parts.iter().filter_map(|(test, size)| Some((test.coordinate()?, *size))).for_each(|(c, size)| load[c] = size);
    let test = parts.first().map_or(Test::Neutral, |part| part.0);
    LaxityTrial::asked(format!("{}_{fe_deg}", test.name()), test, fe_deg, load)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_test_of_two_parts_has_both_loads_and_a_neutral_one_its_compression_alone() {
        let both = planned(&[(Test::Anterior, 134.0), (Test::Internal, -5.0)], 30.0, 20.0);
        assert_eq!((both.load, both.test), (Load::new(0.0, -5.0, 0.0, 134.0, 20.0), Test::Anterior));
        assert_eq!(planned(&[(Test::Neutral, 7.0)], 0.0, 50.0).load, Load::compression(50.0));
        assert_eq!(planned(&[], 15.0, 50.0).trial, "neutral_15");
    }
}
