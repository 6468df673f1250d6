//! Numbers in words.

pub(crate) use diagnosis::report::words::fixed;

/// A value with its interval, all with so many decimals; where they all read 0 it is "0".
pub(crate) fn with_interval(mean: f64, lower: f64, upper: f64, decimals: usize) -> String {
    let told = [mean, lower, upper].map(|x| fixed(x, decimals));
    let zero = fixed(0.0, decimals);
    if told.iter().all(|t| *t == zero) {
        return "0".to_owned();
    }
    format!("{} ({} to {})", told[0], told[1], told[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_reads_minus_nought_and_nought_has_no_interval() {
        assert_eq!([fixed(-0.3, 0), fixed(-0.04, 1), fixed(-0.06, 1), fixed(0.0, 2)], ["0", "0.0", "-0.1", "0.00"]);
        assert_eq!(with_interval(0.01, 0.0, 0.04, 1), "0");
        assert_eq!(with_interval(0.01, 0.0, 0.06, 1), "0.0 (0.0 to 0.1)");
        assert_eq!(with_interval(31.2, 12.0, 55.5, 0), "31 (12 to 56)");
    }
}
