//! Warnings grouped by kind and weight, so that seventeen of one kind are one line.

use super::html::escaped;
use crate::alike::kind;
use std::fmt::Write;

/// Warnings of one kind from one stage.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub(super) stage: String,
    /// Whether the model may be wrong because of it; otherwise something is rougher than it could be.
    pub(super) heavy: bool,
    /// The warnings themselves, in their order.
    pub(super) all: Vec<String>,
}

/// Words by which a warning says that the model may be wrong: something is missing, misplaced, or did not come to its end.
const HEAVY: [&str; 16] = [
    "left out",
    "misplaced",
    "inverted",
    "not converged",
    "dislocated",
    "subluxed",
    "failure load",
    "too small",
    "too large",
    "turned round",
    "damaged",
    "wrong",
    "crosses",
    "runs in bone",
    "does not point",
    "at the edge",
];

/// The groups, heavy ones first, then the most frequent. Of a stage in `outside`, whose own answer is outside its limit, all are heavy:
/// the value weighs, not the words.
pub(super) fn groups(warnings: &[(String, String)], outside: &[&str]) -> Vec<Group> {
    let mut found: Vec<(String, Group)> = Vec::new();
    for (stage, text) in warnings {
        let key = format!("{stage} {}", kind(text));
        match found.iter_mut().find(|(k, _)| *k == key) {
            Some((_, group)) => group.all.push(text.clone()),
            None => {
                let heavy = outside.contains(&stage.as_str()) || HEAVY.iter().any(|w| text.contains(w));
                found.push((key, Group { stage: stage.clone(), heavy, all: vec![text.clone()] }));
            }
        }
    }
    let mut groups: Vec<Group> = found.into_iter().map(|(_, g)| g).collect();
    groups.sort_by_key(|g| (!g.heavy, std::cmp::Reverse(g.all.len())));
    groups
}

/// The groups as HTML: a line each, its warnings below.
pub(super) fn html(groups: &[Group]) -> String {
    let mut out = String::new();
    for (heavy, title) in [(true, "The model may be wrong here"), (false, "Rougher than it could be")] {
        let of: Vec<&Group> = groups.iter().filter(|g| g.heavy == heavy).collect();
        if of.is_empty() {
            continue;
        }
        let count: usize = of.iter().map(|g| g.all.len()).sum();
        let class = if heavy { "heavy" } else { "light" };
        let open = if heavy { " open" } else { "" };
        let plural = if count == 1 { "warning" } else { "warnings" };
        let _ = write!(
            out,
            "<details class=\"warnings {class}\"{open}><summary>{title}: {count} {plural} of {} {}</summary><ul>",
            of.len(),
            if of.len() == 1 { "kind" } else { "kinds" }
        );
        of.iter().for_each(|g| out += &line(g));
        out += "</ul></details>";
    }
    out
}

fn line(group: &Group) -> String {
    let stage = format!("<a href=\"#{0}\">{0}</a>", escaped(&group.stage));
    let Some((first, more)) = group.all.split_first() else { return String::new() };
    if more.is_empty() {
        return format!("<li>{stage}: {}</li>", escaped(first));
    }
    let rest: String = more.iter().map(|w| format!("<li>{}</li>", escaped(w))).collect();
    format!(
        "<li>{stage}: <b>{} of one kind</b>, the first: {} <details><summary>and {} more of this kind</summary><ul>{rest}</ul></details></li>",
        group.all.len(),
        escaped(first),
        more.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_that_differ_in_names_and_numbers_are_one_kind() {
        let of = |stage: &str, text: &str| (stage.to_owned(), text.to_owned());
        let all = [
            of("attachments", "ACL_AM fibre 1 runs 2.1 mm deep through the femur"),
            of("ingest", "landmarks.csv gives no head"),
            of("attachments", "PFL fibre 3 runs 4.0 mm deep through the tibia"),
            of("attachments", "LCL is left out: no fibula"),
        ];
        let groups = groups(&all, &[]);
        assert_eq!(groups.len(), 3);
        assert!(groups[0].heavy && groups[0].all[0].starts_with("LCL"));
        assert_eq!(groups[1].all.len(), 2);
        assert!(html(&groups).contains("2 of one kind") && html(&groups).contains("and 1 more of this kind"));
        let weighed = super::groups(&all, &["ingest"]);
        assert!(weighed.iter().filter(|g| g.heavy).any(|g| g.stage == "ingest"), "by its stage's answer");
    }
}
