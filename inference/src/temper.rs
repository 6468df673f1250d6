//! How loud readings speak: the one place that says by how much less they are believed than their scatter says.
//!
//! A likelihood takes readings for right but for their scatter. Several hundred of them would then outvote whatever the model has wrong. So a likelihood has
//! the power of one over a temper [miller2019].

/// What is asked of readings. The two answers differ, since the scatter that stands beside them does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asks {
    /// How large things are, of so many readings: a calibration. Its scatter has noise, repositioning and loads that the model lacks. What contact, toe and
    /// sites of fibres have wrong is not in it, and is alike in all trials: more readings do not tell it.
    Sizes(usize),
    /// Which cause is missing: a diagnosis. Its scatter has contact, toe and sites of fibres, too, each with what trials have in common. So more readings
    /// are not less believed; what is left is that the scatter itself is declared.
    Causes,
}

/// However many readings there are, they say no more about sizes than this many that were right but for their scatter [miller2019]; set on the bench's nulls.
const READINGS_BELIEVED: f64 = 100.0;
/// Temper of readings asked for causes [-]. Declared: with several hundred readings evidence speaks louder than the scatter is known.
const OF_CAUSES: f64 = 1.5;

/// How many times less loud readings speak than their scatter says [-].
pub const fn temper(asks: Asks) -> f64 {
    match asks {
        Asks::Sizes(readings) => 1.0 + readings as f64 / READINGS_BELIEVED,
        Asks::Causes => OF_CAUSES,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_readings_say_what_they_say_and_many_as_much_as_a_hundred() {
        let heard = |n: usize| n as f64 / temper(Asks::Sizes(n));
        assert!(temper(Asks::Sizes(0)) == 1.0 && heard(1) > 0.98);
        assert!(heard(50) < heard(1000) && (95.0..READINGS_BELIEVED).contains(&heard(10_000)), "{}", heard(10_000));
    }
}
