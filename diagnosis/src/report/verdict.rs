//! How sure an answer is: weights of rivals, what a name must have earned, and what it may leave.

use crate::criteria::{
    ANOTHER, BEYOND_DOUBT_DEVIATIONS, CLOSES_MOST, CLOSES_NEARLY_ALL, DECISIVE_EXCESS, DECISIVE_WEIGHT, INTERVAL_90,
    NO_SIZE, POOR_DEVIATIONS, PROBABLE_WEIGHT, STARTS_DIFFER, TEMPER, ahead, decided, discrepancy, likelier, mixed_up,
};
use crate::effect::candidate::Scope;
use crate::effect::catalogue::Effect;
use crate::fit::Fit;
use crate::fit::form::{are_expected, left_by_form};
use crate::report::{Against, Verdict};
use crate::search::{Search, Searcher};

/// How many times less loud the data speak than their declared scatter says: the floor is known no better than this, and a misfit shows that it is
/// too narrow. It raises the threshold of a name, tempers the weights of names and widens the intervals of sizes alike.
pub(crate) fn temper(searcher: &Searcher, fit: &Fit) -> f64 {
    TEMPER * (searcher.total(fit) / fit.residual.len() as f64).max(1.0)
}

/// Weight of each rival: evidence and prior, tempered where the best leaves more than it should.
pub(crate) fn weights<'a>(searcher: &Searcher, search: &'a Search, best: &Fit) -> Vec<(&'a Fit, f64)> {
    let temper = temper(searcher, best);
    let top = searcher.gain(best, &search.base);
    let mut out: Vec<(&Fit, f64)> =
        search.rivals.iter().map(|f| (f, ((searcher.gain(f, &search.base) - top) / temper).exp())).collect();
    let sum: f64 = out.iter().map(|(_, w)| w).sum::<f64>() + (-top / temper).exp();
    out.iter_mut().for_each(|(_, w)| *w /= sum);
    out
}

/// An answer that asks to be believed.
pub(crate) struct Candidature<'a> {
    /// The best hypothesis where its evidence passes the threshold, else nothing missing.
    pub believed: &'a Fit,
    /// Nothing missing.
    pub base: &'a Fit,
    /// Whether the evidence passes the threshold.
    pub is_named: bool,
    /// Log Bayes factor of a field of no name beside it [-].
    pub field: f64,
    /// Log Bayes factor of a field of no name without it, against nothing missing [-].
    pub alone: f64,
    /// Effects that could be named [-].
    pub names: usize,
    /// Log Bayes factor of two trials exchanged beside it [-].
    pub exchanged: f64,
    /// Its gain of the held-out log score [-].
    pub gain: f64,
    /// Share of the held-out gap that it closes [-].
    pub closes: f64,
    /// Whether these trials cannot tell it from another answer.
    pub has_kin: bool,
}

/// What a verdict rests on.
#[derive(Clone, Copy, Debug)]
struct Grounds {
    /// Readings [-].
    readings: f64,
    /// Sum of squares beyond their number that the answer leaves [-].
    excess: f64,
    /// Whether the evidence passes the threshold.
    is_named: bool,
    /// What it may leave for its form in this knee [nats].
    form: f64,
    /// Whether its effects are of sizes that somebody would expect.
    is_expected: bool,
    /// Log Bayes factor of a field of no name beside it [-].
    field: f64,
    /// Log Bayes factor of a field of no name without it, against nothing missing [-].
    alone: f64,
    /// What its effects were chosen among [nats].
    choice: f64,
    /// By how much a field in its place may do better only because the search began elsewhere [nats].
    by_chance: f64,
    /// Log Bayes factor of two trials exchanged beside it [-].
    exchanged: f64,
    /// Its gain of the held-out log score [-].
    gain: f64,
    /// Share of the held-out gap that it closes [-].
    closes: f64,
    /// Whether these trials cannot tell it from another answer.
    has_kin: bool,
    /// Weight of the answer among its rivals [-].
    weight: f64,
    /// Its log Bayes factor against nothing missing [-].
    evidence: f64,
}

impl Grounds {
    fn new(searcher: &Searcher, rivals: &[(&Fit, f64)], of: &Candidature) -> Grounds {
        let readings = of.believed.residual.len() as f64;
        let excess = searcher.total(of.believed) - readings;
        let evidence = searcher.gain(of.believed, of.base);
        let sizes = &of.believed.unknowns[searcher.problem.nuisances()..];
        let is_built = searcher.problem.nuisance.are_of_a_built_knee();
        Grounds {
            readings,
            excess,
            is_named: of.is_named,
            form: left_by_form(&of.believed.hypothesis, sizes, evidence),
            is_expected: are_expected(sizes),
            field: of.field,
            alone: of.alone,
            choice: of.believed.hypothesis.len() as f64 * (of.names.max(1) as f64).ln(),
            by_chance: if is_built { INTERVAL_90 * STARTS_DIFFER } else { 0.0 },
            exchanged: of.exchanged,
            gain: of.gain,
            closes: of.closes,
            has_kin: of.has_kin,
            weight: by_names(rivals).first().map_or(0.0, |g| g.1),
            evidence,
        }
    }

    /// Whether something is missing that the answer is not.
    fn is_unnamed(&self) -> bool {
        if self.is_named {
            return !self.against().is_empty();
        }
        let loud = 1.0 + self.excess / self.readings;
        // where no more is left than noise and floor explain, a field must be as sure as a decisive answer
        let least = if loud > 1.0 { discrepancy() * loud } else { decided() };
        self.field > least || self.exchanged > mixed_up() || self.deviations() > BEYOND_DOUBT_DEVIATIONS
    }

    /// What stands against the answer; nothing where it may be named.
    fn against(&self) -> Vec<Against> {
        if !self.is_named {
            return vec![Against::EarnsTooLittle];
        }
        let leaves = self.deviations() > POOR_DEVIATIONS && self.closes < CLOSES_NEARLY_ALL;
        let another = if self.is_expected { ANOTHER * self.evidence } else { 0.0 };
        let beside = self.field > discrepancy().max(self.form).max(another);
        // two records mixed up beside a name leave it its name; a name that has earned less than they would is owed to them
        let mixed = self.exchanged > mixed_up().max(self.evidence);
        let all = [
            (Against::LeavesTooMuch, leaves),
            (Against::FieldBeside, beside),
            (Against::FieldInItsPlace, self.in_place() > self.by_chance),
            (Against::RecordsMixedUp, mixed),
        ];
        all.into_iter().filter(|(_, stands)| *stands).map(|(what, _)| what).collect()
    }

    /// Standard deviations of the sum of squares that the answer leaves beyond the number of readings [-].
    fn deviations(&self) -> f64 {
        self.excess / (2.0 * self.readings).sqrt()
    }

    /// By how much a field in the place of the answer is the likelier of the two [nats].
    fn in_place(&self) -> f64 {
        self.alone - self.evidence - ahead().max(self.form) + self.choice
    }

    /// Whether it may be decisive: a named effect that leaves much is not the whole truth. A field weighs only where it is asked for.
    fn may_decide(&self, may_be_unnamed: bool) -> bool {
        let is_beside = self.field > likelier() || self.in_place() > 0.0;
        let rests = self.excess < DECISIVE_EXCESS * self.readings && !(may_be_unnamed && is_beside);
        self.weight >= DECISIVE_WEIGHT
            && self.evidence >= decided()
            && self.gain > 0.0
            && self.closes >= CLOSES_MOST
            && !self.has_kin
            && rests
    }
}

/// What stands against an answer, whichever answers there are beside it.
pub(crate) fn against(searcher: &Searcher, of: &Candidature) -> Vec<Against> {
    Grounds::new(searcher, &[], of).against()
}

/// How sure the answer is.
pub(crate) fn verdict(searcher: &Searcher, rivals: &[(&Fit, f64)], of: &Candidature) -> Verdict {
    let grounds = Grounds::new(searcher, rivals, of);
    let stands = || is_sized(searcher, of.believed) && holds(searcher, of.base, rivals);
    judge(&grounds, searcher.options.wildcard, stands)
}

/// The rules; `stands` tells whether the answer keeps its size and its place under other priors and noise.
fn judge(grounds: &Grounds, may_be_unnamed: bool, stands: impl FnOnce() -> bool) -> Verdict {
    if may_be_unnamed && grounds.is_unnamed() {
        Verdict::Unnamed
    } else if !grounds.is_named {
        Verdict::None
    } else if grounds.may_decide(may_be_unnamed) && stands() {
        Verdict::Decisive
    } else if grounds.weight >= PROBABLE_WEIGHT {
        Verdict::Probable
    } else {
        Verdict::OneOf
    }
}

/// Whether each effect of an answer is there, and whole.
fn is_sized(searcher: &Searcher, fit: &Fit) -> bool {
    let values = fit.parameters(searcher.problem.nuisances(), temper(searcher, fit));
    fit.hypothesis.iter().zip(values).all(|(c, values)| is_whole(&c.effect, &values))
}

/// Whether an effect of these sizes (values and standard deviations) is kept from nothing by a 90 % interval, and no part of it that has a sign is nothing:
/// half of an effect may be all of one that has another name (hamstrings on the lateral side alone pull as the iliotibial band does).
fn is_whole(effect: &Effect, values: &[(f64, f64)]) -> bool {
    let sizes = || effect.parameter.iter().zip(values).filter(|(p, _)| !p.shape);
    let is_there = sizes().any(|(_, (value, sd))| value.abs() > INTERVAL_90 * sd);
    is_there && sizes().all(|(p, (value, sd))| !p.one_sided || *value > NO_SIZE * sd)
}

/// Whether the first answer stays the first, and above the threshold, with priors half and twice as wide and noise of 0.7 and 1.5 of the stated.
fn holds(searcher: &Searcher, base: &Fit, rivals: &[(&Fit, f64)]) -> bool {
    let n = searcher.problem.nuisances();
    let Some((first, _)) = rivals.first() else { return true };
    let names = |f: &Fit| f.hypothesis.iter().map(|c| (c.name(), c.scope)).collect::<Vec<_>>();
    let score = |f: &Fit, wide: f64, noise: f64| {
        let heavy = |x: f64| 2.5 * (1.0 + x * x / 4.0).ln();
        let prior: f64 = f.unknowns[n..].iter().map(|x| heavy(*x) - heavy(x / wide) - wide.ln()).sum();
        searcher.gain(f, base) / (noise * noise) + prior
    };
    [(0.5, 1.0), (2.0, 1.0), (1.0, 0.7), (1.0, 1.5)].iter().all(|&(wide, noise)| {
        let own = score(first, wide, noise);
        own > searcher.options.least_evidence
            && rivals.iter().all(|(f, _)| names(f) == names(first) || score(f, wide, noise) < own)
    })
}

/// Rivals with the same effects and scopes are one answer: its best fit and the sum of weights. Answers are ordered by the weight of their effects in
/// whatever scope, then by their own: which effect comes before where it acts.
pub(crate) fn by_names<'a>(rivals: &[(&'a Fit, f64)]) -> Vec<(&'a Fit, f64)> {
    type Key = Vec<(String, Scope)>;
    let mut out: Vec<(Key, &Fit, f64)> = Vec::new();
    for (fit, weight) in rivals {
        let mut key: Vec<(String, Scope)> = fit.hypothesis.iter().map(|c| (c.name(), c.scope)).collect();
        key.sort();
        match out.iter_mut().find(|(k, _, _)| *k == key) {
            Some(one) => one.2 += weight,
            None => out.push((key, fit, *weight)),
        }
    }
    let effects = |key: &Key| key.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let of_effects =
        |key: &Key| -> f64 { out.iter().filter(|(k, _, _)| effects(k) == effects(key)).map(|(_, _, w)| w).sum() };
    let mut ranked: Vec<(f64, &Fit, f64)> = out.iter().map(|(key, fit, w)| (of_effects(key), *fit, *w)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.2.total_cmp(&a.2)));
    ranked.into_iter().map(|(_, fit, w)| (fit, w)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::candidate::Candidate;
    use crate::effect::catalogue::Catalogue;
    use crate::fit::bare;

    /// A clean answer: it leaves what noise does, and closes the gap.
    const CLEAN: Grounds = Grounds {
        readings: 280.0,
        excess: 0.0,
        is_named: true,
        form: 0.0,
        is_expected: true,
        field: 0.0,
        alone: 0.0,
        choice: 0.0,
        by_chance: 0.0,
        exchanged: f64::NEG_INFINITY,
        gain: 50.0,
        closes: 0.9,
        has_kin: false,
        weight: 0.99,
        evidence: 60.0,
    };

    #[test]
    fn a_form_leaves_the_square_of_its_share_to_one_effect_of_a_size_that_somebody_would_expect() {
        let candidate = |id: &str| {
            let effect = Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
            Candidate { effect, variant: 0, scope: Scope::Both }
        };
        let (band, frame) = (candidate("itb"), candidate("femur_frame"));
        assert!((left_by_form(std::slice::from_ref(&band), &[1.2], 200.0) - 0.15f64.powi(2) * 200.0).abs() < 1e-12);
        assert_eq!(left_by_form(std::slice::from_ref(&band), &[6.0], 200.0), 0.0);
        assert_eq!(left_by_form(std::slice::from_ref(&frame), &[1.2, 0.3], 200.0), 0.0);
        assert_eq!(left_by_form(&[band, frame], &[1.2, 1.2, 0.3], 200.0), 0.0);
    }

    #[test]
    fn fits_of_the_same_names_are_one_answer_whose_weight_is_their_sum() {
        let fit = |id: &str, scope: Scope| bare::fit(vec![bare::candidate(id, scope)]);
        let [band, again, kla] = [Scope::Both, Scope::Both, Scope::Only(0)].map(|s| fit("itb", s));
        let frame = fit("femur_frame", Scope::Both);
        let ranked = by_names(&[(&frame, 0.4), (&band, 0.2), (&again, 0.2), (&kla, 0.2)]);
        let told: Vec<(String, f64)> = ranked.iter().map(|(f, w)| (f.hypothesis[0].name(), *w)).collect();
        // what acts in one scope or in the other speaks for the effect
        let expected =
            [(band.hypothesis[0].name(), 0.4), (kla.hypothesis[0].name(), 0.2), (frame.hypothesis[0].name(), 0.4)];
        assert_eq!(told, expected);
    }

    #[test]
    fn half_of_an_effect_is_not_decisive() {
        let effect = |id: &str| Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
        let hamstrings = effect("ham_tone");
        assert!(is_whole(&hamstrings, &[(60.0, 12.0), (40.0, 12.0)]));
        // a part may be small, not nothing; one of them is well told
        assert!(is_whole(&hamstrings, &[(60.0, 12.0), (8.0, 12.0)]));
        assert!(!is_whole(&hamstrings, &[(0.0, 6.0), (75.0, 13.0)]));
        assert!(!is_whole(&hamstrings, &[(15.0, 12.0), (8.0, 12.0)]));
        // a frame turned about one axis alone is a whole one, and shapes are no parts
        assert!(is_whole(&effect("femur_frame"), &[(0.0, 0.5), (5.0, 0.5)]));
        assert!(is_whole(&effect("meniscus"), &[(15.0, 3.0), (0.0, 2.0), (0.0, 1.0), (0.0, 8.0)]));
    }

    fn judged(grounds: Grounds) -> Verdict {
        judge(&grounds, true, || true)
    }

    #[test]
    fn a_clean_answer_is_as_sure_as_its_weight() {
        assert_eq!(judged(CLEAN), Verdict::Decisive);
        assert_eq!(judged(Grounds { weight: 0.9, ..CLEAN }), Verdict::Probable);
        assert_eq!(judged(Grounds { weight: 0.5, ..CLEAN }), Verdict::OneOf);
        assert_eq!(judged(Grounds { is_named: false, ..CLEAN }), Verdict::None);
    }

    #[test]
    fn a_named_answer_is_unnamed_where_something_stands_against_it_alone_and_each_reason_is_told() {
        use Against::{EarnsTooLittle, FieldBeside, FieldInItsPlace, LeavesTooMuch, RecordsMixedUp};
        assert!(CLEAN.against().is_empty());
        let leaves = Grounds { excess: 500.0, closes: 0.7, ..CLEAN };
        let reasons = [
            (leaves, LeavesTooMuch),
            (Grounds { field: 47.0, ..CLEAN }, FieldBeside),
            (Grounds { alone: 90.0, ..CLEAN }, FieldInItsPlace),
            (Grounds { exchanged: 90.0, ..CLEAN }, RecordsMixedUp),
        ];
        for (grounds, reason) in reasons {
            assert_eq!(grounds.against(), [reason]);
            assert_eq!(judged(grounds), Verdict::Unnamed, "{reason:?}");
        }
        // what closes nearly all of the gap on other trials may leave much
        assert!(Grounds { closes: 0.95, ..leaves }.against().is_empty());
        // several stand beside each other; what earns too little is asked no further
        assert_eq!(Grounds { field: 47.0, ..leaves }.against(), [LeavesTooMuch, FieldBeside]);
        assert_eq!(Grounds { is_named: false, field: 47.0, ..leaves }.against(), [EarnsTooLittle]);
    }

    #[test]
    fn no_answer_decides_that_predicts_no_better_closes_little_leaves_much_or_does_not_stand() {
        for doubtful in [
            Grounds { gain: -1.0, ..CLEAN },
            Grounds { closes: 0.4, ..CLEAN },
            Grounds { excess: 80.0, ..CLEAN },
            Grounds { evidence: 25.0, ..CLEAN },
            Grounds { has_kin: true, ..CLEAN },
        ] {
            assert_eq!(judged(doubtful), Verdict::Probable, "{doubtful:?}");
        }
        assert_eq!(judge(&CLEAN, true, || false), Verdict::Probable);
    }

    #[test]
    fn a_name_beside_which_a_field_explains_more_is_none_but_for_a_form_that_may_differ() {
        let beside = Grounds { field: 5.0, ..CLEAN };
        assert_eq!(judged(beside), Verdict::Unnamed);
        assert_eq!(judged(Grounds { field: 4.0, ..CLEAN }), Verdict::Probable);
        assert_eq!(judged(Grounds { field: 3.0, ..CLEAN }), Verdict::Decisive);
        // so large a field is not decisive
        let formed = Grounds { form: 8.0, ..beside };
        assert_eq!(judged(formed), Verdict::Probable);
        assert_eq!(judged(Grounds { form: 4.0, ..formed }), Verdict::Unnamed);
        // what stands in for the truth closes much and leaves much; the truth leaves little
        let standing_in = Grounds { excess: 56.0, closes: 0.82, ..CLEAN };
        assert_eq!(judged(standing_in), Verdict::Unnamed);
        assert_ne!(judged(Grounds { closes: 0.95, ..standing_in }), Verdict::Unnamed);
        assert_ne!(judged(Grounds { excess: 30.0, ..standing_in }), Verdict::Unnamed);
        // without the field nothing is outside the catalogue
        assert_ne!(judge(&beside, false, || true), Verdict::Unnamed);
    }

    #[test]
    fn a_field_that_earns_little_of_what_the_name_does_is_another_thing_that_is_missing() {
        let strong = Grounds { evidence: 300.0, field: 12.0, ..CLEAN };
        assert_eq!(judged(strong), Verdict::Probable);
        // as much as kin would leave, or beside a size that nobody would expect, it takes the name
        assert_eq!(judged(Grounds { field: 16.0, ..strong }), Verdict::Unnamed);
        assert_eq!(judged(Grounds { is_expected: false, ..strong }), Verdict::Unnamed);
        assert_eq!(judged(Grounds { evidence: 80.0, field: 5.0, ..CLEAN }), Verdict::Unnamed);
    }

    #[test]
    fn what_a_name_was_chosen_among_counts_as_what_a_field_was_chosen_among_does() {
        // one of 25 names; a field's kinds are in its mean already
        let one = Grounds { choice: 25f64.ln(), ..CLEAN };
        assert_eq!(judged(Grounds { alone: 58.9, ..one }), Verdict::Decisive);
        assert_eq!(judged(Grounds { alone: 59.3, ..one }), Verdict::Unnamed);
        // two names are a choice among as many pairs
        let two = Grounds { choice: 2.0 * 25f64.ln(), ..CLEAN };
        assert_eq!(judged(Grounds { alone: 56.0, ..two }), Verdict::Unnamed);
    }

    #[test]
    fn a_field_alone_must_earn_as_much_as_beside_a_name() {
        let nothing = Grounds { is_named: false, excess: 1.0, ..CLEAN };
        assert_eq!(judged(Grounds { field: 4.4, ..nothing }), Verdict::None);
        assert_eq!(judged(Grounds { field: 4.6, ..nothing }), Verdict::Unnamed);
        // where nothing missing leaves more than it should, the data speak less loud
        assert_eq!(judged(Grounds { field: 4.6, excess: 70.0, ..nothing }), Verdict::None);
        // where it leaves less than noise and floor do, a field of a few nats is theirs
        let quiet = Grounds { excess: -30.0, ..nothing };
        assert_eq!(judged(Grounds { field: 12.0, ..quiet }), Verdict::None);
        assert_eq!(judged(Grounds { field: 31.0, ..quiet }), Verdict::Unnamed);
    }

    #[test]
    fn a_name_in_whose_place_a_field_does_better_is_none_but_for_a_form_that_may_differ() {
        assert_eq!(judged(Grounds { alone: 64.0, ..CLEAN }), Verdict::Unnamed);
        assert_eq!(judged(Grounds { alone: 61.0, ..CLEAN }), Verdict::Decisive);
        assert_eq!(judged(Grounds { alone: 62.5, form: 5.0, ..CLEAN }), Verdict::Decisive);
        // on a built knee the difference is known to within a few nats: too near for a verdict against the name, and for a decisive one
        let built = Grounds { by_chance: 4.0, ..CLEAN };
        assert_eq!(judged(Grounds { alone: 64.0, ..built }), Verdict::Probable);
        assert_eq!(judged(Grounds { alone: 61.0, ..built }), Verdict::Decisive);
        assert_eq!(judged(Grounds { alone: 67.0, ..built }), Verdict::Unnamed);
    }

    #[test]
    fn two_records_mixed_up_are_no_effect_of_the_catalogue_and_take_no_name_that_has_earned_more() {
        let nothing = Grounds { is_named: false, ..CLEAN };
        assert_eq!(judged(Grounds { exchanged: 6.0, ..nothing }), Verdict::Unnamed);
        assert_eq!(judged(Grounds { exchanged: 4.0, ..nothing }), Verdict::None);
        assert_eq!(judged(Grounds { exchanged: 20.0, ..CLEAN }), Verdict::Decisive);
        assert_eq!(judged(Grounds { exchanged: 20.0, evidence: 8.0, ..CLEAN }), Verdict::Unnamed);
    }

    #[test]
    fn what_no_effect_explains_is_unnamed_only_beyond_doubt() {
        let nothing = Grounds { is_named: false, ..CLEAN };
        assert_eq!(judged(Grounds { excess: 70.0, ..nothing }), Verdict::None);
        assert_eq!(judged(Grounds { excess: 110.0, ..nothing }), Verdict::Unnamed);
        assert_eq!(judged(Grounds { excess: 110.0, closes: 0.2, ..CLEAN }), Verdict::Unnamed);
    }
}
