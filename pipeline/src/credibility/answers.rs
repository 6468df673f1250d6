//! The open questions of the published knees, answered for this one from its evidence, in words.

use super::evidence::Evidence;
use super::grade::Grade;
use notices::plain;

/// How an answer reads.
#[derive(Clone, Copy, PartialEq)]
enum Asks {
    /// Whether something changes the answers: little, some, much.
    Change,
    /// Which of two changes the answers by more: the first number over the second.
    Which,
    /// Whether something is predicted.
    Predicts,
}

/// A question, what it asks, and the evidence that answers it.
struct Question {
    words: &'static str,
    asks: Asks,
    /// Each with the name that its number has in the answer. Of a prediction the first is the share that holds, the other how wide its intervals are.
    ids: &'static [(&'static str, &'static str)],
    /// What there is none of, where nothing answers it.
    lacking: &'static str,
}

const NOT_RUN: &str = "no calibrated model that stage 11 was run on";
const WIDTH: (&str, &str) = ("cross-prediction-width", "half an interval, of the range");
const ONE_SET: &str = "no second data set with other loads";

/// The questions, in the order in which the knees raised them.
const QUESTIONS: [Question; 7] = [
    Question {
        words: "Do menisci change laxity and the ligaments' forces?",
        asks: Asks::Change,
        ids: &[("menisci-sensitivity", "AP"), ("menisci-forces", "force")],
        lacking: "the model has none; a build with assemble.menisci has",
    },
    Question {
        words: "Does the cartilage's contact law?",
        asks: Asks::Change,
        ids: &[("contact-sensitivity", "AP"), ("contact-forces", "force")],
        lacking: NOT_RUN,
    },
    Question {
        words: "Does the start of the search change the ligaments? (Forces at its ends are not kept.)",
        asks: Asks::Change,
        ids: &[("starts", "reference strain"), ("starts-stiffness", "stiffness")],
        lacking: "no calibration from several starts",
    },
    Question {
        words: "Reference strain or stiffness: which moves laxity more?",
        asks: Asks::Which,
        ids: &[("strain-sensitivity", "strain"), ("stiffness-sensitivity", "stiffness")],
        lacking: NOT_RUN,
    },
    Question {
        words: "Which moves the ligaments' forces more?",
        asks: Asks::Which,
        ids: &[("strain-forces", "strain"), ("stiffness-forces", "stiffness")],
        lacking: NOT_RUN,
    },
    Question {
        words: "Is laxity at flexions predicted that the calibration did not target? (Each range: cross_prediction.csv.)",
        asks: Asks::Predicts,
        ids: &[("other-flexions", "within intervals"), WIDTH],
        lacking: ONE_SET,
    },
    Question {
        words: "Is laxity in directions predicted that it did not target? (Ranges that span one.)",
        asks: Asks::Predicts,
        ids: &[("other-directions", "within intervals"), WIDTH],
        lacking: ONE_SET,
    },
];

/// What stands beside each question: the question, the answer in a few words, and the numbers behind it.
pub(super) struct Answer {
    pub(super) question: &'static str,
    pub(super) word: String,
    pub(super) numbers: String,
}

/// The answers of a knee.
pub(super) fn answers(evidence: &[&Evidence]) -> Vec<Answer> {
    let find = |id: &str| evidence.iter().copied().find(|e| e.id == id && e.grade != Grade::NoEvidence);
    let one = |q: &Question| {
        let share = q.ids.first().and_then(|(id, _)| find(id));
        // without the share a width tells nothing
        let ids = if q.asks == Asks::Predicts && share.is_none() { &[] } else { q.ids };
        let own: Vec<(&str, &Evidence)> = ids.iter().filter_map(|(id, name)| Some((*name, find(id)?))).collect();
        let word = match q.asks {
            Asks::Which => which(&own),
            Asks::Change => changes(&own, q.ids.len()),
            Asks::Predicts => share.map(|share| predicts(share, &own)),
        };
        let numbers: Vec<String> =
            own.iter().filter_map(|(name, e)| Some(format!("{name} {}", number(e.value?, &e.unit)))).collect();
        Answer {
            question: q.words,
            word: word.unwrap_or_else(|| "not known".to_owned()),
            numbers: if numbers.is_empty() { q.lacking.to_owned() } else { numbers.join(", ") },
        }
    };
    QUESTIONS.iter().map(one).collect()
}

/// A number with its unit; a share in whole per cent.
fn number(value: f64, unit: &str) -> String {
    if unit == "-" { format!("{} %", plain((100.0 * value).round())) } else { format!("{} {unit}", plain(value)) }
}

/// How much changes: one word where all numbers that are asked for agree, else one for each.
fn changes(own: &[(&str, &Evidence)], asked: usize) -> Option<String> {
    let (_, first) = own.first()?;
    if own.len() == asked && own.iter().all(|(_, e)| e.grade == first.grade) {
        return Some(much(first.grade).to_owned());
    }
    Some(own.iter().map(|(name, e)| format!("{name} {}", much(e.grade))).collect::<Vec<_>>().join(", "))
}

/// The word of a change.
fn much(grade: Grade) -> &'static str {
    match grade {
        Grade::NoEvidence => "not known",
        Grade::Strong => "little",
        Grade::Adequate => "some",
        Grade::Weak => "much",
    }
}

/// Whether a share within the intervals is a prediction: not where the intervals are so wide that they hold nearly any knee.
fn predicts(share: &Evidence, own: &[(&str, &Evidence)]) -> String {
    let wide = own.iter().any(|(_, e)| e.id == WIDTH.0 && e.grade == Grade::Weak);
    let word = match share.grade {
        Grade::NoEvidence => "not known",
        Grade::Weak => "no",
        _ if wide => "not known: the intervals are too wide to tell",
        Grade::Strong => "yes",
        Grade::Adequate => "in part",
    };
    word.to_owned()
}

/// Which of two moves is the larger, and by how many times.
fn which(own: &[(&str, &Evidence)]) -> Option<String> {
    let [(_, strain), (_, stiffness)] = own else { return None };
    let ratio = strain.value? / stiffness.value?;
    let (name, times) = if ratio >= 1.0 { ("reference strain", ratio) } else { ("stiffness", 1.0 / ratio) };
    times.is_finite().then(|| format!("{name}, {times:.1} times as much"))
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
        }
    }

    fn word(evidence: &[Evidence], question: usize) -> String {
        answers(&evidence.iter().collect::<Vec<_>>()).swap_remove(question).word
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
        let width = |half| piece("cross-prediction-width", half, [0.25, 0.5]);
        let wide = |share, half| [inside(share), vec![width(half)]].concat();
        assert_eq!(word(&wide(1.0, 0.2), 5), "yes");
        assert_eq!(word(&wide(1.0, 1.5), 5), "not known: the intervals are too wide to tell");
        assert_eq!(word(&wide(0.2, 1.5), 5), "no", "what wide intervals miss is missed");
        assert_eq!(word(&[width(0.2)], 5), "not known", "a width alone predicts nothing");
        assert!((0..QUESTIONS.len()).all(|k| word(&[], k) == "not known"));
        assert!(answers(&[]).iter().all(|a| !a.numbers.is_empty()), "what is lacking is said");
        let told = answers(&contact(20.0).iter().collect::<Vec<_>>()).swap_remove(1).numbers;
        assert_eq!(told, "AP 0.5 N, force 20 N");
        assert_eq!([number(0.5, "-"), number(20.0, "N")], ["50 %", "20 N"]);
    }

    /// A question whose evidence is called otherwise would read "not known" for ever.
    #[test]
    fn every_question_asks_for_numbers_that_there_are() {
        let ids: Vec<&str> = super::super::rows::ids();
        assert!(QUESTIONS.iter().flat_map(|q| q.ids).all(|(id, _)| ids.contains(id)), "{ids:?}");
    }
}
