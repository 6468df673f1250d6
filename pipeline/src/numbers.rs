//! Numbers on the command line, each refused with what was expected of it.

/// Reads a number of a range.
pub(crate) fn between([least, most]: [f64; 2]) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let x = text.parse::<f64>().ok();
        x.filter(|x| (least..=most).contains(x)).ok_or_else(|| format!("expected a number from {least} to {most}"))
    }
}

/// Reads how many of something.
pub(crate) fn count(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "expected a whole number, 0 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_outside_or_is_no_number_is_refused_with_the_range() {
        let newtons = between([0.0, 5000.0]);
        assert_eq!((newtons("20"), newtons("5e3")), (Ok(20.0), Ok(5000.0)));
        for wrong in ["-1", "5001", "nan", "inf", "twenty", ""] {
            assert_eq!(newtons(wrong), Err("expected a number from 0 to 5000".into()), "{wrong}");
        }
        assert_eq!(count("48"), Ok(48));
        assert!(["-1", "1.5", "nan", ""].iter().all(|wrong| count(wrong).is_err()));
    }
}
