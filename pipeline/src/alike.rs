//! Warnings of one kind: those that differ in names and numbers alone.

/// A warning without its names and numbers: what warnings of one kind have in common.
pub(crate) fn kind(text: &str) -> String {
    let named =
        |w: &str| w.chars().any(|c| c.is_ascii_digit() || c == '_') || w.chars().skip(1).any(char::is_uppercase);
    let words =
        without_sources(text).split(|c: char| c.is_whitespace() || "(),;:\"".contains(c)).filter(|w| !w.is_empty());
    let plain: Vec<&str> = words.filter(|w| !named(w) && !BONES.contains(w)).collect();
    plain.into_iter().take(8).collect::<Vec<_>>().join(" ")
}

/// A text without the names of models and data sets that it begins with: `joint: kla: `.
fn without_sources(text: &str) -> &str {
    match text.split_once(": ") {
        Some((name, rest)) if !name.contains(char::is_whitespace) => without_sources(rest),
        _ => text,
    }
}

/// Names that tell warnings of one kind apart.
const BONES: [&str; 7] = ["femur", "tibia", "tibfib", "patella", "medial", "lateral", "fibula"];

/// The first of each kind, in their order, and how many more there are of it.
pub(crate) fn firsts(warnings: &[String]) -> Vec<(&str, usize)> {
    let mut found: Vec<(String, &str, usize)> = Vec::new();
    for text in warnings {
        let own = kind(text);
        match found.iter_mut().find(|(kind, ..)| *kind == own) {
            Some((.., more)) => *more += 1,
            None => found.push((own, text, 0)),
        }
    }
    found.into_iter().map(|(_, text, more)| (text, more)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_that_differ_in_names_and_numbers_are_one_line_with_a_count() {
        let all = [
            "ACL_AM fibre 1 runs 2.1 mm deep through the femur",
            "LCL is left out: no fibula",
            "PFL fibre 3 runs 4.0 mm deep through the tibia",
        ]
        .map(String::from);
        assert_eq!(firsts(&all), [(all[0].as_str(), 1), (all[1].as_str(), 0)]);
    }

    #[test]
    fn whose_warning_it_is_tells_no_kinds_apart() {
        let all =
            ["joint: kla: vv_deg scatters by 2.4", "joint: rks: ml_mm scatters by 0.7", "kla: vv_deg scatters by 2.6"];
        assert!(all.iter().all(|w| kind(w) == "scatters by"), "{:?}", all.map(kind));
        assert_ne!(kind("kla: 18 of 48 samples ended near a fit"), kind(all[0]));
    }
}
