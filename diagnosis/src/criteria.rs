//! Every threshold of a verdict. Each says its kind.
//!
//! *Derived*: an expression of stated odds and the tempering; no literal of its own. *Calibrated*: a literal, with the number of nulls (data sets in which
//! nothing is hidden) it was set with, their seeds where they were kept, and the rate aimed at. *Declared*: a judgement that no data set yet tests; it says what for.
//! Log Bayes factors and log odds are in nats.

use inference::temper::{Asks, temper};

/// How many times less loud the data speak than their declared scatter says where an answer leaves no more than it should [-]; why: [`Asks::Causes`]. It
/// raises the threshold of a name, tempers weights, widens intervals of sizes.
pub const TEMPER: f64 = temper(Asks::Causes);

/// One thing that is missing in this many is in nobody's catalogue [-]. Declared.
const MISSING_PER_UNKNOWN: f64 = 10.0;
/// Odds from which a finding is taken for sure [-]: a twentieth of doubt, as everywhere in statistics.
const SURE: f64 = 20.0;
/// Share by which the nearest kin of the catalogue differ in what they explain [-]. Measured: 4 to 17 % (docs/theory/discrepancy.md, Removed effects).
const KIN_DIFFER: f64 = 0.1;

/// Least log Bayes factor of an effect in a screen, whatever simulated nulls say. Calibrated: 105 nulls (development round), of which three
/// had names of 4.3 to 4.8 nats after tempering; rate aimed at 5 %. Their seeds were not kept, so nobody can repeat that round. Since then 9 of 400 nulls
/// alarm (docs/discrepancy.md).
pub const LEAST_EVIDENCE: f64 = 3.3;
/// Least log Bayes factor of a refitted answer that has a name [nats].
pub const NAMED: f64 = TEMPER * LEAST_EVIDENCE;
/// Share of simulated nulls that a screen's threshold stays above [-]: the rate aimed at is 5 %.
pub const NULLS_BELOW: f64 = 0.95;
/// Least gain by a further effect beside others that leave no more than they should. Calibrated: compounds of development rounds against singles with a
/// false second effect; no nulls.
pub const LEAST_BESIDE: f64 = 6.0;
/// The same beside others that leave too much, where a little more is a patch. Calibrated as [`LEAST_BESIDE`].
pub const LEAST_FURTHER: f64 = 8.0;

/// Least gain of the log score on held-out trials by a further effect [nats]. Derived: beside one missing thing another is missing in one of
/// [`MISSING_PER_UNKNOWN`], as loud as the data may speak; what a fold has not seen knows of no choice among many, so none is paid for.
pub fn predicted() -> f64 {
    TEMPER * MISSING_PER_UNKNOWN.ln()
}

/// Log Bayes factor from which fields of no name are believed. Derived in form, calibrated in fact: odds of [`SURE`] as loud as the data may speak, two to
/// one for the field after the odds of [`MISSING_PER_UNKNOWN`]. The form was settled with 230 nulls in view, five of which had fields of 3.4 to 4.6: they
/// are no independent check of it.
pub fn discrepancy() -> f64 {
    TEMPER * SURE.ln()
}

/// Log Bayes factor from which two records are taken to be exchanged. Derived, as [`discrepancy`]: swapped records are in no catalogue either.
pub fn mixed_up() -> f64 {
    discrepancy()
}

/// Surprise from which two readings contradict each other [nats], the likeliest of so many `pairs`; of one, where something is missing for certain. Derived: odds of [`SURE`] beyond the choice, as
/// loud as the data may speak.
pub fn contradicted(pairs: usize) -> f64 {
    TEMPER * (SURE.ln() + (pairs.max(1) as f64).ln())
}

/// Log Bayes factor of a field beside a name from which the name is no longer the likelier of the two, and by which a rival takes the place of the best.
/// Derived: nine of ten missing things have a name, as loud as the data may speak.
pub fn likelier() -> f64 {
    TEMPER * (MISSING_PER_UNKNOWN - 1.0).ln()
}

/// By how much a field in a name's place must do better than the name. Derived: one in [`MISSING_PER_UNKNOWN`]; not tempered, for both sides speak of the
/// same data.
pub fn ahead() -> f64 {
    MISSING_PER_UNKNOWN.ln()
}

/// Standard deviation, over the starts of a calibration, of the difference between what a name earns on a built knee and what a field in its place does
/// [nats]: each is the best of what a search met. Calibrated: six effects on both built knees (`blind make`, seeds 7001 and 7002), three seeds of the
/// calibration each.
pub const STARTS_DIFFER: f64 = 1.5;

/// Expected log odds, over the temper, below which two answers are kin: these trials cannot tell them apart. Derived: [`SURE`], as [`LEFT_OUT`].
pub fn told_apart() -> f64 {
    SURE.ln()
}

/// Least log Bayes factor of a decisive answer. Derived: a share [`KIN_DIFFER`] of it tells an unknown one of its kind apart by odds of [`SURE`].
pub fn decided() -> f64 {
    SURE.ln() / KIN_DIFFER
}

/// Share of what an answer has earned that a field beside it may earn without taking its name [-]. Derived: of [`KIN_DIFFER`] a field, one among many, finds
/// about half.
pub const ANOTHER: f64 = 0.5 * KIN_DIFFER;

/// Weight from which one answer is decisive [-]. Derived: odds of nearly [`SURE`].
pub const DECISIVE_WEIGHT: f64 = 1.0 - 1.0 / SURE;
/// Weight from which it is probable [-]. Declared: three to one.
pub const PROBABLE_WEIGHT: f64 = 0.75;
/// An answer this much less likely than the first is left out of the set [-]. Derived: [`SURE`].
pub const LEFT_OUT: f64 = 1.0 / SURE;

/// Standard deviations of the sum of squares from which an answer leaves more than noise does [-]. Declared: 4 % of nulls leave as much.
pub const POOR_DEVIATIONS: f64 = 1.8;
/// Standard deviations of the sum of squares from which something is missing though no effect explains it [-]. Declared: beyond any null seen.
pub const BEYOND_DOUBT_DEVIATIONS: f64 = 4.0;
/// Excess of the sum of squares, over the number of readings, up to which an answer may be decisive [-]. Declared.
pub const DECISIVE_EXCESS: f64 = 0.25;
/// Size of an effect, in standard deviations of its prior, that is no longer the effect of that name [-]. Declared.
pub const BEYOND_BELIEF: f64 = 5.0;
/// Share of the held-out gap that a decisive answer must close [-]. Declared: more than half.
pub const CLOSES_MOST: f64 = 0.5;
/// Share of the held-out gap that an answer must close whose rest stays significant [-]. Declared: else it is at most part of what is missing.
pub const CLOSES_NEARLY_ALL: f64 = 0.9;
/// Log odds below which no test is worth calling one that would tell, and no tear one that fits better [nats]: odds of less than three to one. Declared.
pub const WORTH_TELLING: f64 = 1.0;
/// Share of its standard deviation below which a part of an effect is nothing [-]: it was pressed against its bound. Declared.
pub const NO_SIZE: f64 = 0.1;
/// Half width of a 90 % interval, in standard deviations [-]. Derived: the normal distribution's.
pub const INTERVAL_90: f64 = 1.645;

/// Log likelihood ratio from which noise other than the stated one is taken. Declared: the stated one has the benefit of the doubt, as an effect's absence has.
pub const OTHER_NOISE: f64 = 3.0;
/// Size, in standard deviations of its prior, at which an effect must earn a name to be testable beside a built knee's unknowns [-]. Declared.
pub const TESTABLE_SIZE: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_quotes_these_numbers() {
        let page = include_str!("../../docs/discrepancy.md");
        let rows = [
            ("tempering", TEMPER),
            ("least evidence of a screen", LEAST_EVIDENCE),
            ("least evidence of a name", TEMPER * LEAST_EVIDENCE),
            ("a further effect", LEAST_BESIDE),
            ("a further effect where much is left", LEAST_FURTHER),
            ("a further effect, on held-out trials", predicted()),
            ("a field of no name", discrepancy()),
            ("exchanged records", mixed_up()),
            ("a field beside a decisive name", likelier()),
            ("a field in a name's place", ahead()),
            ("kin of an answer", told_apart()),
            ("a decisive answer", decided()),
            ("share of a field beside a name", ANOTHER),
            ("weight of a decisive answer", DECISIVE_WEIGHT),
            ("weight of a probable answer", PROBABLE_WEIGHT),
            ("noise other than stated", OTHER_NOISE),
            ("difference by starts, built knees", STARTS_DIFFER),
            ("size of a testable effect", TESTABLE_SIZE),
        ];
        for (name, value) in rows {
            let row = format!("| {name} | {} |", (value * 100.0).round() / 100.0);
            assert!(page.contains(&row), "docs/discrepancy.md lacks {row:?}");
        }
    }
}
