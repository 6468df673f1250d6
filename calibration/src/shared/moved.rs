//! A prior with another centre and width, as a prior of the kinds there are.

use inference::parameter::Prior;

/// Steps of a search by halves [-]: to 1e-12 of what is searched through.
const HALVES: usize = 40;
/// Narrowest and widest normal distribution between two bounds, in widths between them [-]. Wider than the one is as good as even; narrower than
/// the other no data make it.
const WIDTHS: [f64; 2] = [1e-3, 3.0];
/// How far beyond a bound the middle of a distribution may lie that is cut off there [sd]: what is left must have a probability.
const BEYOND: f64 = 5.0;

/// The prior of a number whose `z`, standard normal by `of`, is normal with this mean and standard deviation.
///
/// Exact of normal and log-normal priors. Of those between bounds it is the normal distribution, cut off at these bounds, that has the same
/// middle and the same width between minus one and one standard deviation.
pub fn moved(of: &Prior, mean: f64, sd: f64) -> Prior {
    match *of {
        Prior::Normal { mean: m, sd: s } => Prior::Normal { mean: m + s * mean, sd: s * sd },
        Prior::LogNormal { median, log_sd } => {
            Prior::LogNormal { median: median * (log_sd * mean).exp(), log_sd: log_sd * sd }
        }
        Prior::Uniform { lower, upper } | Prior::Truncated { lower, upper, .. } => {
            let at = |z: f64| of.at(mean + sd * z).0;
            between([lower, upper], at(0.0), at(1.0) - at(-1.0))
        }
        Prior::HalfNormal { .. } => *of,
    }
}

/// The normal distribution cut off at bounds that has this middle, and this much between minus one and one standard deviation.
fn between([lower, upper]: [f64; 2], middle: f64, spread: f64) -> Prior {
    let about = |sd: f64| {
        let of = |mean: f64| Prior::Truncated { mean, sd, lower, upper };
        let mean = halved([lower - BEYOND * sd, upper + BEYOND * sd], |m| of(m).at(0.0).0 < middle);
        of(mean)
    };
    let spread_of = |p: &Prior| p.at(1.0).0 - p.at(-1.0).0;
    let [narrow, wide] = WIDTHS.map(|w| (w * (upper - lower)).ln());
    about(halved([narrow, wide], |log_sd| spread_of(&about(log_sd.exp())) < spread).exp())
}

/// Where what rises passes from too little to enough.
fn halved([mut low, mut high]: [f64; 2], is_less: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVES {
        let middle = 0.5 * (low + high);
        if is_less(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDED: [Prior; 3] = [
        Prior::Uniform { lower: 50.0, upper: 150.0 },
        Prior::Truncated { mean: 1.06, sd: 0.05, lower: 0.95, upper: 1.25 },
        // cut off close to its middle
        Prior::Truncated { mean: 1.01, sd: 0.05, lower: 0.7, upper: 1.05 },
    ];
    /// Means and standard deviations as others tell them [-].
    const TOLD: [[f64; 2]; 6] = [[0.0, 0.7], [0.5, 0.8], [-0.5, 0.8], [1.0, 0.6], [-1.0, 0.75], [0.3, 0.95]];

    #[test]
    fn normal_and_log_normal_priors_are_moved_exactly() {
        for of in [Prior::Normal { mean: 2.0, sd: 0.2 }, Prior::LogNormal { median: 1.0, log_sd: 0.3 }] {
            for [mean, sd] in TOLD {
                for z in [-2.0, -1.0, 0.0, 0.5, 2.0] {
                    let (a, b) = (moved(&of, mean, sd).at(z).0, of.at(mean + sd * z).0);
                    assert!((a - b).abs() < 1e-12, "{of:?} {mean} {sd}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn priors_between_bounds_are_moved_to_the_same_middle_and_nearly_the_same_tails() {
        for of in BOUNDED {
            let width = of.at(1.0).0 - of.at(-1.0).0;
            for [mean, sd] in TOLD {
                let there = moved(&of, mean, sd);
                there.check("x").unwrap();
                let off = |z: f64| (there.at(z).0 - of.at(mean + sd * z).0).abs() / width;
                assert!(off(0.0) < 1e-6, "{of:?} {mean} {sd}: middle {}", off(0.0));
                for z in [-2.0, -1.0, 1.0, 2.0] {
                    assert!(off(z) < TAILS, "{of:?} {mean} {sd} at {z}: {}", off(z));
                }
            }
        }
    }

    #[test]
    fn a_mean_that_rises_raises_every_quantile() {
        for of in BOUNDED {
            for z in [-1.5, 0.0, 1.5] {
                let values: Vec<f64> = (-4..=4).map(|k| moved(&of, 0.4 * f64::from(k), 0.8).at(z).0).collect();
                assert!(values.windows(2).all(|w| w[0] < w[1]), "{of:?} at {z}: {values:?}");
            }
        }
    }

    /// Most that a tail may be off, in widths of the own prior [-].
    const TAILS: f64 = 0.08;
}
