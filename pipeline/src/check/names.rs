//! What names say: the other knee, or a knee of which something was cut.

use meshes::frame::Side;
use sim::laxity::LaxityTrial;

/// Words for a side, in a few languages.
const SIDES: [(&str, Side); 8] = [
    ("left", Side::Left),
    ("links", Side::Left),
    ("gauche", Side::Left),
    ("sinister", Side::Left),
    ("right", Side::Right),
    ("rechts", Side::Right),
    ("droit", Side::Right),
    ("dexter", Side::Right),
];
/// Beginnings of words for a knee that lacks something or was mended. Short ones must be the whole word.
const CHANGED: [&str; 7] = ["deficient", "resect", "transect", "sectioned", "reconstruct", "graft", "ruptur"];
const CHANGED_WORDS: [&str; 7] = ["cut", "acld", "aclr", "pcld", "aclx", "torn", "tka"];

fn words(name: &str) -> Vec<String> {
    let small = name.to_lowercase();
    small.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// Whether a name says the other side and not this one.
fn says_other(name: &str, side: Side) -> bool {
    let words = words(name);
    let says = |own: bool| SIDES.iter().any(|(word, of)| (*of == side) == own && words.iter().any(|w| w == word));
    says(false) && !says(true)
}

/// Whether a name says that the knee lacks something or was mended.
fn says_changed(name: &str) -> bool {
    words(name).iter().any(|w| CHANGED_WORDS.contains(&w.as_str()) || CHANGED.iter().any(|start| w.starts_with(start)))
}

/// What is told of a specimen's id.
pub(super) fn of_id(id: &str, side: Side) -> Option<String> {
    says_other(id, side).then(|| format!("the id \"{id}\" says the other side than side = \"{}\"", word(side)))
}

/// What is told of a laxity file's name and of its trials' names.
pub(super) fn of_laxity(path: &str, trials: &[LaxityTrial], side: Side) -> Vec<String> {
    let mut found = Vec::new();
    if says_other(path, side) {
        found.push(format!(
            "the file's name says the other side than side = \"{}\": is it of the other knee?",
            word(side)
        ));
    }
    let all = trials.iter().all(|t| says_other(&t.trial, side));
    if let Some(first) = trials.first().filter(|_| all) {
        found.push(format!(
            "the names of all trials say the other side than side = \"{}\", as \"{}\": are they of the other knee?",
            word(side),
            first.trial
        ));
    }
    let changed: Vec<&LaxityTrial> = trials.iter().filter(|t| says_changed(&t.trial)).collect();
    match (changed.first(), says_changed(path)) {
        (Some(first), _) => found.push(format!(
            "{} trials are of a knee of which something was cut or mended, by their names, the first \"{}\". Expected the knee as its model has it, with all ligaments: keep such trials in a file of their own",
            changed.len(),
            first.trial
        )),
        (None, true) => found.push(
            "the file is of a knee of which something was cut or mended, by its name. Expected the knee as its model has it, with all ligaments"
                .to_owned(),
        ),
        (None, false) => {}
    }
    found
}

fn word(side: Side) -> &'static str {
    if side == Side::Left { "left" } else { "right" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Load;
    use sim::laxity::Test;

    fn trials(names: &[&str]) -> Vec<LaxityTrial> {
        let one = |n: &&str| LaxityTrial::asked((*n).to_owned(), Test::Neutral, 0.0, Load::default());
        names.iter().map(one).collect()
    }

    #[test]
    fn sides_and_cut_knees_are_told_by_whole_words() {
        let usual = trials(&["Anterior_30deg_0", "bright_2", "uncut"]);
        assert!(of_laxity("laxity/kla.csv", &usual, Side::Left).is_empty());
        assert!(of_laxity("laxity/left_then_right.csv", &usual, Side::Left).is_empty());
        assert!(of_laxity("laxity/K7-right.csv", &usual, Side::Left)[0].contains("other side"));
        assert!(of_laxity("laxity/K7-right.csv", &usual, Side::Right).is_empty());
        let right = trials(&["right_a", "right_b"]);
        assert!(of_laxity("a.csv", &right, Side::Left)[0].contains("all trials"));
        for name in ["ACL_cut_30", "ACL-deficient 3", "ACLD_1", "reconstructed_1"] {
            assert!(of_laxity("a.csv", &trials(&["a", name]), Side::Left)[0].contains("1 trials"), "{name}");
        }
        assert!(of_laxity("a/ACLd.csv", &usual, Side::Left)[0].contains("by its name"));
        assert!(of_id("K7 right", Side::Left).is_some() && of_id("right-phantom", Side::Right).is_none());
    }
}
