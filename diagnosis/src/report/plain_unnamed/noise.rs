//! Noise other than its file states, in plain words.

use crate::problem::trial::NoiseScale;
use crate::report::words::{figures, with_unit};
use sim::coordinate::Coordinate;
use std::fmt::Write;

/// What scatters more than its file states, as a finding; nothing where all is as stated, or less.
pub(crate) fn noise(of: &[NoiseScale]) -> String {
    let mut out = String::new();
    let mut told: Vec<&str> = Vec::new();
    let is_more = |n: &&NoiseScale| n.taken && n.inferred > n.stated;
    for set in of.iter().filter(is_more) {
        if told.contains(&set.source.as_str()) {
            continue;
        }
        told.push(&set.source);
        let own = of.iter().filter(is_more).filter(|n| n.source == set.source);
        let each: Vec<String> = own.map(scatter).collect();
        let _ = write!(
            out,
            "\n{} scatters between neighbouring loads more than its file states: {}.",
            set.source,
            each.join(", ")
        );
    }
    out
}

/// "VV by 3.18 deg (stated: 0.500)".
fn scatter(n: &NoiseScale) -> String {
    let unit = Coordinate::named(&n.coordinate).map_or("", Coordinate::unit);
    format!("{} by {} (stated: {})", n.coordinate.to_uppercase(), with_unit(n.inferred, unit), figures(n.stated))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_other_than_stated_is_a_finding_and_noise_as_stated_is_none() {
        let of = |coordinate: &str, inferred, taken| NoiseScale {
            source: "kla".into(),
            coordinate: coordinate.into(),
            stated: 0.5,
            inferred,
            lower: 0.8 * inferred,
            upper: 1.2 * inferred,
            taken,
        };
        let told = noise(&[of("vv", 4.0, true), of("ml", 0.52, false), of("ap", 0.2, true)]);
        assert!(
            told.contains("kla scatters")
                && told.contains("VV by 4.00 deg (stated: 0.500)")
                && !told.contains("ML")
                && !told.contains("AP")
        );
        assert_eq!(noise(&[of("ml", 0.52, false)]), "");
    }
}
