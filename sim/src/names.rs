//! Near misses: which known name a person most likely meant.

/// Names closer than this are taken for the same word mistyped (Jaro-Winkler similarity, 0 to 1) [winkler1990]. Ours: `hexmsh` and
/// `hexmesh` have 0.97, `wings` and `ingest` 0.82.
const NEAR: f64 = 0.85;
/// Shortest name that is looked for inside longer ones: `edge` in `edge_length_mm`.
const SHORTEST_PART: usize = 3;

/// Most names that are equally near and still all named.
const MOST_EQUALS: usize = 3;

/// Whether a bundle is a ligament's: `ACL_AM` and `ACL` are of `ACL`, and `ACLX` is not.
///
/// ```
/// assert!(sim::names::is_of("ACL_AM", "ACL") && sim::names::is_of("ACL", "ACL"));
/// assert!(!sim::names::is_of("ACLX", "ACL") && !sim::names::is_of("ACL", "ACL_AM"));
/// ```
pub fn is_of(bundle: &str, ligament: &str) -> bool {
    bundle.strip_prefix(ligament).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
}

/// The known name nearest to `name`, if one is near; of equals the first of the list.
pub fn nearest<'a, S: AsRef<str> + ?Sized + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> Option<&'a str> {
    equally_near(name, known).first().copied()
}

/// The known names nearest to `name`, each once, in the order of the list; none where none is near.
fn equally_near<'a, S: AsRef<str> + ?Sized + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> Vec<&'a str> {
    let name = name.to_lowercase().replace('-', "_");
    let score = |k: &str| {
        let k = k.to_lowercase().replace('-', "_");
        let part =
            name.len() >= SHORTEST_PART && (k.contains(&name) || (k.len() >= SHORTEST_PART && name.contains(&k)));
        // letters exchanged or one mistyped, in names too short for the similarity: PLC for PCL
        let part = part || (k.len() >= SHORTEST_PART && strsim::osa_distance(&name, &k) == 1);
        let whole = strsim::jaro_winkler(&name, &k);
        if part { whole.max(NEAR) } else { whole }
    };
    let scored = known.into_iter().map(|k| (score(k.as_ref()), k.as_ref())).filter(|(s, _)| *s >= NEAR);
    let (mut most, mut best) = (0.0, Vec::new());
    for (score, name) in scored {
        if score > most {
            (most, best) = (score, vec![name]);
        } else if score == most && !best.contains(&name) {
            best.push(name);
        }
    }
    best
}

/// `; did you mean NAME?`, with all of a few that are equally near; or nothing.
pub fn did_you_mean<'a, S: AsRef<str> + ?Sized + 'a>(name: &str, known: impl IntoIterator<Item = &'a S>) -> String {
    match equally_near(name, known).as_slice() {
        [] => String::new(),
        few if few.len() <= MOST_EQUALS => format!("; did you mean {}?", few.join(" or ")),
        [first, ..] => format!("; did you mean {first}?"),
    }
}

/// A parser's message about an unknown field or variant, with the name that was most likely meant.
pub fn with_suggestion(message: &str) -> String {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match quoted.split_first() {
        Some((name, known)) if message.starts_with("unknown") => {
            format!("{message}{}", did_you_mean(name, known.iter().copied()))
        }
        _ => in_words(message),
    }
}

/// Types of the parser in words that its reader has.
pub fn in_words(message: &str) -> String {
    let words = [
        ("expected f64", "expected a number"),
        ("expected usize", "expected a whole number, 0 or more"),
        ("expected u64", "expected a whole number, 0 or more"),
        ("expected u32", "expected a whole number, 0 or more"),
        ("expected a boolean", "expected true or false"),
    ];
    words.iter().fold(message.to_owned(), |text, (from, to)| text.replace(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_found_and_a_different_word_is_not() {
        let stages = ["ingest", "register", "bones", "cartilage", "hexmesh", "contact-law"];
        for (slip, meant) in [
            ("hexmsh", Some("hexmesh")),
            ("contact_law", Some("contact-law")),
            ("bonse", Some("bones")),
            ("Cartilages", Some("cartilage")),
            ("wings", None),
            ("", None),
        ] {
            assert_eq!(nearest(slip, stages), meant, "{slip}");
        }
        assert_eq!(nearest("PLC", ["ACL", "PCL", "LCL", "sMCL"]), Some("PCL"));
        assert_eq!(nearest("MCL", ["ACL", "sMCL", "dMCL"]), Some("sMCL"), "of equals the first");
        let of = |known: &[&str]| did_you_mean("MCL", known);
        assert_eq!(
            of(&["ACL", "sMCL", "dMCL", "sMCL"]),
            "; did you mean sMCL or dMCL?",
            "of a few equals all, each once"
        );
        assert_eq!(of(&["aMCL", "bMCL", "dMCL", "eMCL"]), "; did you mean aMCL?", "of many the first");
        assert_eq!(of(&["patella"]), "");
        assert_eq!(nearest("edge", ["layers", "edge_length_mm"]), Some("edge_length_mm"));
        let told = with_suggestion("unknown field `fmur`, expected one of `femur`, `tibfib`");
        assert!(told.ends_with("; did you mean femur?"), "{told}");
        assert_eq!(with_suggestion("missing field `id`"), "missing field `id`");
    }
}
