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
    ids: &'static [&'static str],
    /// What there is none of, where nothing answers it.
    lacking: &'static str,
}

const NOT_RUN: &str = "no calibrated model that stage 11 was run on";
const ONE_SET: &str = "no second data set with other loads";

/// The questions, in the order in which the knees raised them.
const QUESTIONS: [Question; 7] = [
    Question {
        words: "Do menisci change laxity and the ligaments' forces?",
        asks: Asks::Change,
        ids: &["menisci-sensitivity", "menisci-forces"],
        lacking: "the model has none; a build with assemble.menisci has",
    },
    Question {
        words: "Does the cartilage's contact law?",
        asks: Asks::Change,
        ids: &["contact-sensitivity", "contact-forces"],
        lacking: NOT_RUN,
    },
    Question {
        words: "Does the start of the search change the ligaments? (Forces at its ends are not kept.)",
        asks: Asks::Change,
        ids: &["starts", "starts-stiffness"],
        lacking: "no calibration from several starts",
    },
    Question {
        words: "Reference strain or stiffness: which moves laxity more?",
        asks: Asks::Which,
        ids: &["strain-sensitivity", "stiffness-sensitivity"],
        lacking: NOT_RUN,
    },
    Question {
        words: "Which moves the ligaments' forces more?",
        asks: Asks::Which,
        ids: &["strain-forces", "stiffness-forces"],
        lacking: NOT_RUN,
    },
    Question {
        words: "Is laxity at flexions predicted that the calibration did not target, such as 60 deg?",
        asks: Asks::Predicts,
        ids: &["other-flexions"],
        lacking: ONE_SET,
    },
    Question {
        words: "Is laxity in directions predicted that it did not target, such as posterior?",
        asks: Asks::Predicts,
        ids: &["other-directions"],
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
    let find = |id: &&str| evidence.iter().copied().find(|e| e.id == *id && e.grade != Grade::NoEvidence);
    let one = |q: &Question| {
        let own: Vec<&Evidence> = q.ids.iter().filter_map(find).collect();
        let word = match q.asks {
            Asks::Which => which(&own),
            asks => own.iter().map(|e| e.grade).min().map(|worst| graded(asks, worst).to_owned()),
        };
        let numbers: Vec<String> = own.iter().filter_map(|e| Some(number(e.value?, &e.unit))).collect();
        Answer {
            question: q.words,
            word: word.unwrap_or_else(|| "not known".to_owned()),
            numbers: if numbers.is_empty() { q.lacking.to_owned() } else { numbers.join(", ") },
        }
    };
    QUESTIONS.iter().map(one).collect()
}

/// A number with its unit; a share in per cent.
fn number(value: f64, unit: &str) -> String {
    if unit == "-" { format!("{} %", plain(100.0 * value)) } else { format!("{} {unit}", plain(value)) }
}

/// The word of the worst grade.
fn graded(asks: Asks, worst: Grade) -> &'static str {
    match (asks == Asks::Predicts, worst) {
        (_, Grade::NoEvidence) => "not known",
        (true, Grade::Strong) => "yes",
        (true, Grade::Adequate) => "in part",
        (true, Grade::Weak) => "no",
        (false, Grade::Strong) => "little",
        (false, Grade::Adequate) => "some",
        (false, Grade::Weak) => "much",
    }
}

/// Which of two moves is the larger, and by how many times.
fn which(own: &[&Evidence]) -> Option<String> {
    let [strain, stiffness] = own else { return None };
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
        assert_eq!([5.0, 20.0, 99.0].map(|n| word(&contact(n), 1)), ["little", "some", "much"]);
        let forces = |a, b| [piece("strain-forces", a, [15.0, 30.0]), piece("stiffness-forces", b, [15.0, 30.0])];
        assert_eq!(word(&forces(300.0, 20.0), 4), "reference strain, 15.0 times as much");
        assert_eq!(word(&forces(10.0, 20.0), 4), "stiffness, 2.0 times as much");
        assert_eq!(word(&forces(10.0, 20.0)[..1], 4), "not known", "one number is no comparison");
        let inside = |share| [piece("other-flexions", share, [0.8, 0.5])];
        assert_eq!([0.9, 0.6, 0.2].map(|s| word(&inside(s), 5)), ["yes", "in part", "no"]);
        assert!((0..QUESTIONS.len()).all(|k| word(&[], k) == "not known"));
        assert!(answers(&[]).iter().all(|a| !a.numbers.is_empty()), "what is lacking is said");
        assert_eq!([number(0.5, "-"), number(20.0, "N")], ["50 %", "20 N"]);
    }

    /// A question whose evidence is called otherwise would read "not known" for ever.
    #[test]
    fn every_question_asks_for_numbers_that_there_are() {
        let ids: Vec<&str> = super::super::rows::ids();
        assert!(QUESTIONS.iter().flat_map(|q| q.ids).all(|id| ids.contains(id)), "{ids:?}");
    }
}
