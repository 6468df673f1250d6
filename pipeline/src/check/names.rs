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

/// Words beside them that say that it was not, or not yet.
const UNCHANGED: [&str; 10] = ["before", "pre", "prior", "no", "not", "non", "without", "free", "intact", "study"];
/// Words that make a side one of somebody or something else than the knee.
const NO_KNEE: [&str; 13] = [
    "hand",
    "handed",
    "arm",
    "foot",
    "eye",
    "rater",
    "camera",
    "sensor",
    "actuator",
    "healthy",
    "contralateral",
    "other",
    "none",
];
/// Words for a knee, beside which a side is its own.
const KNEES: [&str; 5] = ["knee", "knie", "genou", "leg", "bein"];

fn words(name: &str) -> Vec<String> {
    let small = name.to_lowercase();
    small.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// A path's last part, without its ending: a folder holds other files, too.
fn own_name(path: &str) -> &str {
    let file = path.rsplit(['/', '\\']).next().unwrap_or(path);
    file.split_once('.').map_or(file, |(name, _)| name)
}

/// Whether a name says the other side and not this one. The side stands first, last or beside a word for the knee.
fn says_other(name: &str, side: Side) -> bool {
    let words = words(name);
    let is_knee = |at: usize| words.get(at).is_some_and(|w| KNEES.contains(&w.as_str()));
    let stands = |at: usize| at == 0 || at + 1 == words.len() || is_knee(at - 1) || is_knee(at + 1);
    let is_side = |word: &str, own: bool| SIDES.iter().any(|(w, of)| *w == word && (*of == side) == own);
    let other = (0..words.len()).any(|at| is_side(&words[at], false) && stands(at));
    let own = words.iter().any(|w| is_side(w, true));
    other && !own && !words.iter().any(|w| NO_KNEE.contains(&w.as_str()))
}

/// Whether a name says that the knee lacks something or was mended.
fn says_changed(name: &str) -> bool {
    let words = words(name);
    let changed = |w: &String| CHANGED_WORDS.contains(&w.as_str()) || CHANGED.iter().any(|start| w.starts_with(start));
    words.iter().any(changed) && !words.iter().any(|w| UNCHANGED.contains(&w.as_str()))
}

/// What is said of a specimen's id.
pub(super) fn of_id(id: &str, side: Side) -> Option<String> {
    says_other(id, side).then(|| {
        format!("the id \"{id}\" says the other side than side = \"{}\": is it of the other knee?", word(side))
    })
}

/// What is said of a laxity file's name and of its trials' names.
pub(super) fn of_laxity(path: &str, trials: &[LaxityTrial], side: Side) -> Vec<String> {
    let mut found = Vec::new();
    let file = own_name(path);
    if says_other(file, side) {
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
    if trials.iter().any(|t| !t.without.is_empty()) {
        return found;
    }
    let changed: Vec<&LaxityTrial> = trials.iter().filter(|t| says_changed(&t.trial)).collect();
    match (changed.first(), says_changed(file)) {
        (Some(first), _) => found.push(format!(
            "{} trials, the first \"{}\": are they of a knee of which something was cut or mended, as their names say? Expected the knee as its model has it, with all ligaments: keep such trials in a file of their own, with a column without (ACL)",
            changed.len(),
            first.trial
        )),
        (None, true) => found.push(
            "the file: is it of a knee of which something was cut or mended, as its name says? Expected the knee as its model has it, with all ligaments, or a column without (ACL)"
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
        for name in ["pre_cut_1", "before_cut_1", "no_graft_1", "rupture_free_1", "not_resected"] {
            assert!(of_laxity(&format!("cut_data/{name}.csv"), &trials(&[name]), Side::Left).is_empty(), "{name}");
        }
        for name in ["right_healthy_side_none", "right_hand", "right-arm", "K7_right_2", "a/right/b"] {
            assert!(of_laxity(&format!("laxity/{name}.csv"), &usual, Side::Left).is_empty(), "{name}");
        }
        for name in ["K7_right", "rechts_30", "K7_right_knee_2"] {
            assert!(
                of_laxity(&format!("laxity/{name}.csv"), &usual, Side::Left)[0].contains("the other knee?"),
                "{name}"
            );
        }
        assert!(of_laxity("a/ACLd.csv", &usual, Side::Left)[0].contains("as its name says?"));
        assert!(of_id("K7 right", Side::Left).is_some() && of_id("right-phantom", Side::Right).is_none());
    }
}
