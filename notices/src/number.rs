//! Computed numbers as a sentence tells them.

/// Digits that a reader needs of a number that was computed [-]. Ours: a file's own numbers have three or four.
const DIGITS: i32 = 4;

/// A computed number with four significant digits: no zeros behind the last of them, no rounding before the decimal point. What a person typed
/// is repeated as it was typed, by `{}`.
pub fn plain(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{}", x + 0.0);
    }
    let before = x.abs().log10().floor() as i32 + 1;
    // so small that its zeros would be more than its digits
    if before < -DIGITS {
        return format!("{x:.2e}");
    }
    let told = format!("{x:.*}", usize::try_from(DIGITS - before).unwrap_or(0));
    match told.contains('.') {
        true => told.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => told,
    }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn four_digits_are_told_and_no_digit_before_the_point_is_lost() {
        let told = [
            (18.145799999999998, "18.15"),
            (29.999999999999996, "30"),
            (0.1 + 0.2, "0.3"),
            (-0.017453292, "-0.01745"),
            (123456.7, "123457"),
            (1000.0, "1000"),
            (133.0, "133"),
            (-0.0, "0"),
            (3.2e-9, "3.20e-9"),
            (f64::NAN, "NaN"),
        ];
        for (x, words) in told {
            assert_eq!(plain(x), words);
        }
    }

    #[test]
    fn a_told_number_is_within_half_of_its_last_digit() {
        for k in -40..80 {
            let x = 1.2345678f64.powi(k);
            let told: f64 = plain(x).parse().unwrap();
            assert!((told - x).abs() <= 5.01e-4 * x, "{x}: {told}");
        }
    }
}
