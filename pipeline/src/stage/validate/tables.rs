//! Tables of the calibrated knee: ligament and contact forces with their intervals; and how tables stand in the page.

use super::charts::{by_samples, contact, ligament, number};
use crate::report::html::escaped;
use attachments::groups::GROUPS;
use sim::flags::sentences;
use sim::laxity::{Test, TrialResult};
use validation::tables::Table;
use validation::validate::Source;

/// A result that one asks of a knee.
pub(super) struct Asked<'a> {
    /// The test.
    words: String,
    /// What is odd about it.
    odd: Vec<String>,
    result: &'a TrialResult,
}

impl Asked<'_> {
    /// The test, with what is odd.
    fn whole(&self) -> String {
        if self.odd.is_empty() { self.words.clone() } else { format!("{} ({})", self.words, self.odd.join(", ")) }
    }

    /// The test, with a mark where a note below says what is odd.
    fn marked(&self) -> String {
        if self.odd.is_empty() { self.words.clone() } else { format!("{} *", self.words) }
    }
}

/// Results that one asks of a knee: the drawers at every flexion, the ends of the pivot shift.
pub(super) fn asked(s: &Source) -> Vec<Asked<'_>> {
    let mut out = Vec::new();
    for (test, words) in [(Test::Anterior, "anterior drawer"), (Test::Posterior, "posterior drawer")] {
        for fe in s.ap_flexions() {
            out.extend(s.ap_end(test, fe).map(|r| (format!("{words}, {fe:.0} deg"), r)));
        }
    }
    out.extend(s.pivot_end(true).map(|r| ("pivot shift".to_owned(), r)));
    out.extend(s.pivot_end(false).map(|r| ("pivot shift without ACL".to_owned(), r)));
    // the tables tell means: that the single model lies beside its interval is no flag of theirs
    let odd = |r: &TrialResult| sentences(r.flags.iter().filter(|f| !f.is_of_the_single_model()));
    out.into_iter().map(|(words, result)| Asked { words, odd: odd(result), result }).collect()
}

/// Forces of the ligaments, and contact by compartment.
pub(super) fn tables(s: &Source) -> Vec<Table> {
    labelled(s, &asked(s), Asked::whole)
}

/// The same with the tests labelled.
fn labelled<'a>(s: &Source, rows: &[Asked<'a>], label: fn(&Asked<'a>) -> String) -> Vec<Table> {
    let mut forces = table(&format!("Ligament forces of the model {} [N]{}", s.name, by_samples(s)), &["test"]);
    forces.header.extend(GROUPS.iter().map(|(g, _)| (*g).to_owned()));
    for a in rows {
        let told = (0..GROUPS.len()).map(|g| number(&ligament(s, a.result, g)));
        forces.rows.push(std::iter::once(label(a)).chain(told).collect());
    }
    let columns =
        [("force_n", "force [N]"), ("area_mm2", "area [mm2]"), ("mean_mpa", "mean [MPa]"), ("peak_mpa", "peak [MPa]")];
    let mut contacts = table(&format!("Contact of the model {} by compartment{}", s.name, by_samples(s)), &["test"]);
    for side in ["medial", "lateral"] {
        contacts.header.extend(columns.iter().map(|(_, words)| format!("{side} {words}")));
    }
    for a in rows {
        let told: Vec<String> = ["medial", "lateral"]
            .iter()
            .flat_map(|side| {
                columns.map(|(what, _)| contact(a.result, side, what).map_or(String::new(), |t| number(&t)))
            })
            .collect();
        if told.iter().any(|t| !t.is_empty()) {
            contacts.rows.push(std::iter::once(label(a)).chain(told).collect());
        }
    }
    [forces, contacts].into_iter().filter(|t| !t.rows.is_empty()).collect()
}

fn table(title: &str, header: &[&str]) -> Table {
    let header = header.iter().map(|h| (*h).to_owned()).collect();
    Table { name: String::new(), title: title.to_owned(), header, rows: vec![] }
}

/// A table behind its title.
pub(super) fn html(t: &Table, open: bool) -> String {
    format!(
        "<details{}><summary>{}</summary><div class=\"wide\" tabindex=\"0\">{}</div></details>",
        if open { " open" } else { "" },
        escaped(&t.title),
        cells(t)
    )
}

/// Tables below their titles, for paper: intervals with a dash and flags below, so that a row is a line. No number in them is negative.
pub(super) fn on_paper(s: &Source) -> String {
    let rows = asked(s);
    let mut html = String::new();
    for mut t in labelled(s, &rows, Asked::marked) {
        t.rows.iter_mut().flatten().for_each(|c| *c = c.replace(" to ", "\u{2013}"));
        html += &format!("<p><b>{}</b></p>{}", escaped(&t.title), cells(&t));
    }
    let notes: Vec<String> =
        rows.iter().filter(|a| !a.odd.is_empty()).map(|a| format!("{}: {}", a.words, a.odd.join(", "))).collect();
    if !notes.is_empty() {
        html += &format!("<p>* {}.</p>", escaped(&notes.join("; ")));
    }
    html
}

fn cells(t: &Table) -> String {
    let row = |cells: &[String], tag: &str| {
        cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect::<String>()
    };
    let rows: String = t.rows.iter().map(|r| format!("<tr>{}</tr>", row(r, "td"))).collect();
    format!("<table><thead><tr>{}</tr></thead><tbody>{rows}</tbody></table>", row(&t.header, "th"))
}
