//! The open questions of the published knees, answered for this one from its evidence: values for programs, and words for people.

use super::evidence::Evidence;
use super::grade::Grade;
use notices::plain;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// How an answer reads.
#[derive(Clone, Copy, PartialEq)]
enum Asks {
    /// Whether something changes the answers: little, some, much.
    Change,
    /// The same of the ends of the search, of which some may not fit.
    Ends,
    /// Which of two changes the answers by more: the first number over the second.
    Which,
    /// Whether something is predicted.
    Predicts,
}

/// An answer for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No number answers it.
    NotKnown,
    /// It changes little.
    Little,
    /// It changes some.
    Some,
    /// It changes much.
    Much,
    /// Reference strain moves it more.
    ReferenceStrain,
    /// Stiffness moves it more.
    Stiffness,
    /// It is predicted.
    Yes,
    /// It is predicted in part.
    InPart,
    /// It is not predicted.
    No,
    /// The intervals are too wide to tell.
    TooWide,
}

impl Verdict {
    /// In words.
    fn word(self) -> &'static str {
        match self {
            Verdict::NotKnown => "not known",
            Verdict::Little => "little",
            Verdict::Some => "some",
            Verdict::Much => "much",
            Verdict::ReferenceStrain => "reference strain",
            Verdict::Stiffness => "stiffness",
            Verdict::Yes => "yes",
            Verdict::InPart => "in part",
            Verdict::No => "no",
            Verdict::TooWide => "not known: the intervals are too wide to tell",
        }
    }
}

/// A number that an answer was taken from.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AnswerNumber {
    /// The evidence that it is.
    pub id: &'static str,
    /// Its name in the answer.
    pub name: &'static str,
    /// The number.
    pub value: f64,
    /// Its unit; "-" for a share.
    pub unit: String,
    /// The grade that it has as evidence.
    pub grade: Grade,
}

/// An open question of the published knees and its answer for this one.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Answer {
    /// Its name, for programs.
    pub id: &'static str,
    /// The question.
    pub question: &'static str,
    /// The answer, for programs; of several numbers, that of the one which changes most.
    pub verdict: Verdict,
    /// The answer in words, as on the page.
    pub answer: String,
    /// The numbers that it was taken from.
    pub numbers: Vec<AnswerNumber>,
    /// What there is none of; none where a number answers.
    pub lacking: Option<String>,
    /// Flexions that it was decided in [deg].
    pub flexions_deg: Vec<f64>,
    /// Ends of the search that did not fit as well as the best, so that they answer nothing; none of what is not asked of ends.
    pub did_not_fit: Option<usize>,
}

impl Answer {
    /// Its numbers in words, or what is lacking.
    pub(super) fn numbers_in_words(&self) -> String {
        let one = |n: &AnswerNumber| format!("{} {}", n.name, number(n.value, &n.unit));
        let mut told = match &self.lacking {
            Some(lacking) => lacking.clone(),
            None => self.numbers.iter().map(one).collect::<Vec<_>>().join(", "),
        };
        if let Some(ends) = self.did_not_fit.filter(|n| *n > 0) {
            told += &format!("; {ends} {} of the search did not fit as well", if ends == 1 { "end" } else { "ends" });
        }
        told
    }

    /// The flexions that it was decided in, in words: how many, and which.
    pub(super) fn flexions_in_words(&self) -> String {
        let each: Vec<String> = self.flexions_deg.iter().map(|fe| plain(*fe)).collect();
        if each.is_empty() { "none".to_owned() } else { format!("{}: {} deg", each.len(), each.join(", ")) }
    }
}

/// A question, what it asks, and the evidence that answers it.
struct Question {
    id: &'static str,
    words: &'static str,
    asks: Asks,
    /// Each with the name that its number has in the answer. Of a prediction the first is the share that holds, the other how wide its intervals are.
    ids: &'static [(&'static str, &'static str)],
    /// What there is none of, where nothing answers it.
    lacking: &'static str,
}

const NOT_RUN: &str = "no calibrated model that stage 11 was run on";
/// What the width of a prediction's intervals is called in its answer.
const WIDTH: &str = "half an interval, of the range";
const ONE_SET: &str = "no second data set with other loads";

/// The questions, in the order in which the knees raised them.
const QUESTIONS: [Question; 7] = [
    Question {
        id: "menisci",
        words: "Do menisci change laxity and the ligaments' forces?",
        asks: Asks::Change,
        ids: &[("menisci-sensitivity", "AP"), ("menisci-forces", "force")],
        lacking: "the model has none; a build with assemble.menisci has",
    },
    Question {
        id: "contact-law",
        words: "Does the cartilage's contact law change laxity and the ligaments' forces?",
        asks: Asks::Change,
        ids: &[("contact-sensitivity", "AP"), ("contact-forces", "force")],
        lacking: NOT_RUN,
    },
    Question {
        id: "starts",
        words: "Does the start of the search change the ligaments? (Forces at its ends are not kept.)",
        asks: Asks::Ends,
        ids: &[("starts", "reference strain"), ("starts-stiffness", "stiffness")],
        lacking: "no two ends of the search that fit",
    },
    Question {
        id: "strain-or-stiffness-laxity",
        words: "Reference strain or stiffness: which moves laxity more?",
        asks: Asks::Which,
        ids: &[("strain-sensitivity", "strain"), ("stiffness-sensitivity", "stiffness")],
        lacking: NOT_RUN,
    },
    Question {
        id: "strain-or-stiffness-forces",
        words: "Reference strain or stiffness: which moves the ligaments' forces more?",
        asks: Asks::Which,
        ids: &[("strain-forces", "strain"), ("stiffness-forces", "stiffness")],
        lacking: NOT_RUN,
    },
    Question {
        id: "other-flexions",
        words: "Is laxity at flexions predicted that the calibration did not target? (Each range: cross_prediction.csv.)",
        asks: Asks::Predicts,
        ids: &[("other-flexions", "within intervals"), ("other-flexions-width", WIDTH)],
        lacking: ONE_SET,
    },
    Question {
        id: "other-directions",
        words: "Is laxity in directions predicted that the calibration did not target? (Ranges that span one.)",
        asks: Asks::Predicts,
        ids: &[("other-directions", "within intervals"), ("other-directions-width", WIDTH)],
        lacking: ONE_SET,
    },
];

/// The answers of a knee; `did_not_fit` of the ends of the search, where it is known.
pub(super) fn answers(evidence: &[&Evidence], did_not_fit: Option<usize>) -> Vec<Answer> {
    QUESTIONS.iter().map(|q| answer(q, evidence, did_not_fit)).collect()
}

/// The evidence of a question, each with its name in the answer.
type Own<'a> = Vec<(&'static str, &'a Evidence)>;

fn answer(q: &Question, evidence: &[&Evidence], did_not_fit: Option<usize>) -> Answer {
    let find = |id: &str| evidence.iter().copied().find(|e| e.id == id && e.grade != Grade::NoEvidence);
    let share = q.ids.first().and_then(|(id, _)| find(id));
    // without the share a width tells nothing
    let ids = if q.asks == Asks::Predicts && share.is_none() { &[] } else { q.ids };
    let own: Own = ids.iter().filter_map(|(id, name)| Some((*name, find(id)?))).collect();
    let told = match q.asks {
        Asks::Which => which(&own),
        Asks::Change | Asks::Ends => changes(&own, q.ids.len()),
        Asks::Predicts => share.map(|share| predicts(share, &own)),
    };
    let (verdict, words) = told.unwrap_or((Verdict::NotKnown, Verdict::NotKnown.word().to_owned()));
    let of = |name: &'static str, e: &Evidence| {
        Some(AnswerNumber { id: e.id, name, value: e.value?, unit: e.unit.clone(), grade: e.grade })
    };
    let numbers: Vec<AnswerNumber> = own.iter().filter_map(|(name, e)| of(name, e)).collect();
    let mut flexions_deg: Vec<f64> = own.iter().flat_map(|(_, e)| e.flexions_deg.iter().copied()).collect();
    flexions_deg.sort_unstable_by(f64::total_cmp);
    flexions_deg.dedup();
    Answer {
        id: q.id,
        question: q.words,
        verdict,
        answer: words,
        lacking: numbers.is_empty().then(|| lacking(q, evidence)),
        numbers,
        flexions_deg,
        did_not_fit: did_not_fit.filter(|_| q.asks == Asks::Ends),
    }
}

/// What there is none of, where no number answers: files that are not as their stages left them, else what the knee never had.
fn lacking(q: &Question, evidence: &[&Evidence]) -> String {
    let asked = evidence.iter().filter(|e| q.ids.iter().any(|(id, _)| *id == e.id));
    let files: BTreeSet<&str> = asked.flat_map(|e| e.astray.iter().map(String::as_str)).collect();
    let files: Vec<&str> = files.into_iter().collect();
    match files[..] {
        [] => q.lacking.to_owned(),
        [one] => format!("{one} is not as its stage left it"),
        _ => format!("{} are not as their stages left them", files.join(" and ")),
    }
}

/// A number with its unit; a share in whole per cent.
fn number(value: f64, unit: &str) -> String {
    if unit == "-" { format!("{} %", plain((100.0 * value).round())) } else { format!("{} {unit}", plain(value)) }
}

/// How much changes: one word where all numbers that are asked for agree, else one for each.
fn changes(own: &Own, asked: usize) -> Option<(Verdict, String)> {
    let worst = much(own.iter().map(|(_, e)| e.grade).min()?);
    if own.len() == asked && own.iter().all(|(_, e)| much(e.grade) == worst) {
        return Some((worst, worst.word().to_owned()));
    }
    let each = own.iter().map(|(name, e)| format!("{name} {}", much(e.grade).word()));
    Some((worst, each.collect::<Vec<_>>().join(", ")))
}

/// How much a number changes.
fn much(grade: Grade) -> Verdict {
    match grade {
        Grade::NoEvidence => Verdict::NotKnown,
        Grade::Strong => Verdict::Little,
        Grade::Adequate => Verdict::Some,
        Grade::Weak => Verdict::Much,
    }
}

/// Whether a share within the intervals is a prediction: not where the intervals are so wide that they hold nearly any knee.
fn predicts(share: &Evidence, own: &Own) -> (Verdict, String) {
    let wide = own.iter().any(|(name, e)| *name == WIDTH && e.grade == Grade::Weak);
    let verdict = match share.grade {
        Grade::NoEvidence => Verdict::NotKnown,
        Grade::Weak => Verdict::No,
        _ if wide => Verdict::TooWide,
        Grade::Strong => Verdict::Yes,
        Grade::Adequate => Verdict::InPart,
    };
    (verdict, verdict.word().to_owned())
}

/// Which of two moves is the larger, and by how many times.
fn which(own: &Own) -> Option<(Verdict, String)> {
    let [(_, strain), (_, stiffness)] = own[..] else { return None };
    let ratio = strain.value? / stiffness.value?;
    let (verdict, times) =
        if ratio >= 1.0 { (Verdict::ReferenceStrain, ratio) } else { (Verdict::Stiffness, 1.0 / ratio) };
    times.is_finite().then(|| (verdict, format!("{}, {times:.1} times as much", verdict.word())))
}

#[cfg(test)]
mod tests {
    use super::super::evidence::Factor;
    use super::super::grade::grade;
    use super::*;

    fn piece(id: &'static str, value: f64, limits: [f64; 2]) -> Evidence {
        Evidence {
            id,
            factor: Factor::ModelInputs,
            what: String::new(),
            value: Some(value),
            unit: "N".into(),
            limits,
            more_is_better: limits[0] >= limits[1],
            grade: grade(value, limits),
            why: String::new(),
            stage: None,
            test: None,
            test_digest: None,
            file: String::new(),
            digest: None,
            date: None,
            as_built: Some(true),
            flexions_deg: vec![],
            astray: vec![],
        }
    }

    fn word(evidence: &[Evidence], question: usize) -> String {
        told(evidence, None, question).answer
    }

    fn told(evidence: &[Evidence], did_not_fit: Option<usize>, question: usize) -> Answer {
        answers(&evidence.iter().collect::<Vec<_>>(), did_not_fit).swap_remove(question)
    }

    #[test]
    fn an_answer_follows_its_numbers_and_nothing_answers_without_them() {
        let contact =
            |force| [piece("contact-sensitivity", 0.5, [1.0, 3.0]), piece("contact-forces", force, [15.0, 30.0])];
        assert_eq!(
            [5.0, 20.0, 99.0].map(|n| word(&contact(n), 1)),
            ["little", "AP little, force some", "AP little, force much"]
        );
        assert_eq!(word(&contact(20.0)[1..], 1), "force some", "what one number tells has its name");
        let forces = |a, b| [piece("strain-forces", a, [15.0, 30.0]), piece("stiffness-forces", b, [15.0, 30.0])];
        assert_eq!(word(&forces(300.0, 20.0), 4), "reference strain, 15.0 times as much");
        assert_eq!(word(&forces(10.0, 20.0), 4), "stiffness, 2.0 times as much");
        assert_eq!(word(&forces(10.0, 20.0)[..1], 4), "not known", "one number is no comparison");
        let inside = |share| vec![piece("other-flexions", share, [0.8, 0.5])];
        assert_eq!([0.9, 0.6, 0.2].map(|s| word(&inside(s), 5)), ["yes", "in part", "no"]);
        let width = |half| piece("other-flexions-width", half, [0.25, 0.5]);
        let wide = |share, half| [inside(share), vec![width(half)]].concat();
        assert_eq!(word(&wide(1.0, 0.2), 5), "yes");
        assert_eq!(word(&wide(1.0, 1.5), 5), "not known: the intervals are too wide to tell");
        assert_eq!(word(&wide(0.2, 1.5), 5), "no", "what wide intervals miss is missed");
        assert_eq!(word(&[width(0.2)], 5), "not known", "a width alone predicts nothing");
        assert!((0..QUESTIONS.len()).all(|k| word(&[], k) == "not known"));
        assert!(answers(&[], None).iter().all(|a| a.lacking.is_some()), "what is lacking is said");
        assert_eq!(told(&contact(20.0), None, 1).numbers_in_words(), "AP 0.5 N, force 20 N");
        assert_eq!([number(0.5, "-"), number(20.0, "N")], ["50 %", "20 N"]);
    }

    /// What programs read follows the numbers, too, and is never better than the words.
    #[test]
    fn a_verdict_is_that_of_the_number_that_changes_most() {
        for (a, b, verdict) in [(0.5, 5.0, Verdict::Little), (0.5, 99.0, Verdict::Much), (2.0, 5.0, Verdict::Some)] {
            for swapped in [false, true] {
                let mut both =
                    vec![piece("contact-sensitivity", a, [1.0, 3.0]), piece("contact-forces", b, [15.0, 30.0])];
                if swapped {
                    both.reverse();
                }
                let answer = told(&both, None, 1);
                assert_eq!((answer.verdict, answer.numbers.len(), answer.lacking), (verdict, 2, None), "{a} {b}");
            }
        }
        for (share, half, verdict) in [
            (0.9, 0.1, Verdict::Yes),
            (0.6, 0.1, Verdict::InPart),
            (0.9, 9.0, Verdict::TooWide),
            (0.1, 0.1, Verdict::No),
        ] {
            let all = [piece("other-flexions", share, [0.8, 0.5]), piece("other-flexions-width", half, [0.25, 0.5])];
            assert_eq!(told(&all, None, 5).verdict, verdict);
        }
        assert!(answers(&[], Some(2)).iter().all(|a| a.verdict == Verdict::NotKnown));
    }

    /// Widths of other ranges say nothing of these.
    #[test]
    fn a_prediction_is_as_wide_as_the_ranges_that_are_asked_about() {
        let ids = ["cross-prediction-width", "other-flexions-width", "other-directions-width"];
        for (question, share) in [(5, "other-flexions"), (6, "other-directions")] {
            for wide in ids {
                let width = |id| piece(id, if id == wide { 0.9 } else { 0.1 }, [0.25, 0.5]);
                let all = [vec![piece(share, 1.0, [0.8, 0.5])], ids.map(width).to_vec()].concat();
                let (answer, own) = (told(&all, None, question), format!("{share}-width"));
                assert_eq!(answer.verdict == Verdict::TooWide, wide == own, "{share} {wide}");
                assert_eq!(answer.numbers.iter().map(|n| n.id).collect::<Vec<_>>(), [share, own.as_str()]);
            }
        }
    }

    /// Of each question and each of its numbers: a file that was changed is what is lacking, not what the knee never had.
    #[test]
    fn what_is_lacking_is_the_file_that_was_changed_where_one_was() {
        for (k, q) in QUESTIONS.iter().enumerate() {
            for (id, _) in q.ids {
                let struck = |files: &[&str]| Evidence {
                    grade: Grade::NoEvidence,
                    astray: files.iter().map(|f| (*f).to_owned()).collect(),
                    ..piece(id, 1.0, [1.0, 3.0])
                };
                let of = |files: &[&str]| told(&[struck(files)], None, k).lacking.unwrap();
                assert_eq!(of(&["10-calibrate/a.csv"]), "10-calibrate/a.csv is not as its stage left it");
                assert_eq!(of(&["a.csv", "b.csv"]), "a.csv and b.csv are not as their stages left them");
                assert_eq!(of(&[]), q.lacking);
            }
        }
    }

    /// An answer is read by itself in credibility.json.
    #[test]
    fn every_question_stands_alone() {
        for q in &QUESTIONS {
            let subject = ["laxity", "the ligaments"].iter().any(|word| q.words.contains(word));
            let verb = ["change", "moves", "predicted"].iter().any(|word| q.words.contains(word));
            assert!(subject && verb && !q.words.contains(" it "), "{}", q.words);
        }
    }

    #[test]
    fn an_answer_says_in_how_many_flexions_it_was_decided() {
        let at = |id, flexions: &[f64]| Evidence { flexions_deg: flexions.to_vec(), ..piece(id, 0.5, [1.0, 3.0]) };
        let both = [at("contact-sensitivity", &[30.0, 0.0]), at("contact-forces", &[15.0, 30.0])];
        let answer = told(&both, None, 1);
        assert_eq!(answer.flexions_deg, [0.0, 15.0, 30.0]);
        assert_eq!(answer.flexions_in_words(), "3: 0, 15, 30 deg");
        assert_eq!(told(&[], None, 1).flexions_in_words(), "none");
    }

    /// A worse fit is told of and answers nothing; of other questions it says nothing.
    #[test]
    fn ends_that_did_not_fit_are_told_beside_the_answer_about_starts_alone() {
        let both = [piece("starts", 3.0, [2.0, 4.6]), piece("starts-stiffness", 9.0, [7.0, 14.3])];
        let told_of = |ends| match ends {
            0 => "",
            1 => "; 1 end of the search did not fit as well",
            _ => "; 2 ends of the search did not fit as well",
        };
        for ends in 0..3 {
            for evidence in [&both[..], &[]] {
                let (with, without) = (told(evidence, Some(ends), 2), told(evidence, None, 2));
                assert_eq!((with.verdict, &with.answer), (without.verdict, &without.answer), "{ends}");
                assert_eq!(with.numbers_in_words(), without.numbers_in_words() + told_of(ends));
                assert_eq!(with.did_not_fit, Some(ends));
            }
        }
        let others = answers(&[], Some(2));
        assert!(others.iter().enumerate().all(|(k, a)| k == 2 || a.did_not_fit.is_none()));
    }

    /// A question whose evidence is called otherwise would read "not known" for ever.
    #[test]
    fn every_question_asks_for_numbers_that_there_are() {
        let ids: Vec<&str> = super::super::rows::ids();
        assert!(QUESTIONS.iter().flat_map(|q| q.ids).all(|(id, _)| ids.contains(id)), "{ids:?}");
    }
}
