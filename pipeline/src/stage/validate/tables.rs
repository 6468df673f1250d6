//! Tables of the calibrated knee: ligament and contact forces with their intervals; and how tables stand in the page.

use super::charts::{by_samples, contact, ligament, number};
use crate::bands::is_of_the_single_model;
use crate::report::html::escaped;
use attachments::groups::GROUPS;
use sim::laxity::{Test, TrialResult};
use validation::tables::Table;
use validation::validate::Source;

/// Results that one asks of a knee: the drawers at every flexion, the ends of the pivot shift.
pub(super) fn asked(s: &Source) -> Vec<(String, &TrialResult)> {
    let mut out = Vec::new();
    for (test, words) in [(Test::Anterior, "anterior drawer"), (Test::Posterior, "posterior drawer")] {
        for fe in s.ap_flexions() {
            out.extend(s.ap_end(test, fe).map(|r| (format!("{words}, {fe:.0} deg"), r)));
        }
    }
    out.extend(s.pivot_end(true).map(|r| ("pivot shift".to_owned(), r)));
    out.extend(s.pivot_end(false).map(|r| ("pivot shift without ACL".to_owned(), r)));
    for (words, r) in &mut out {
        // the tables tell means: that the single model lies beside its interval is no flag of theirs
        let odd: Vec<&str> = r.flags.iter().map(String::as_str).filter(|f| !is_of_the_single_model(f)).collect();
        if !odd.is_empty() {
            *words += &format!(" ({})", odd.join(", "));
        }
    }
    out
}

/// Forces of the ligaments, and contact by compartment.
pub(super) fn tables(s: &Source) -> Vec<Table> {
    let rows = asked(s);
    let mut forces = table(&format!("Ligament forces of the model {} [N]{}", s.name, by_samples(s)), &["test"]);
    forces.header.extend(GROUPS.iter().map(|(g, _)| (*g).to_owned()));
    for (words, r) in &rows {
        let told = (0..GROUPS.len()).map(|g| number(&ligament(s, r, g)));
        forces.rows.push(std::iter::once(words.clone()).chain(told).collect());
    }
    let columns =
        [("force_n", "force [N]"), ("area_mm2", "area [mm2]"), ("mean_mpa", "mean [MPa]"), ("peak_mpa", "peak [MPa]")];
    let mut contacts = table(&format!("Contact of the model {} by compartment{}", s.name, by_samples(s)), &["test"]);
    for side in ["medial", "lateral"] {
        contacts.header.extend(columns.iter().map(|(_, words)| format!("{side} {words}")));
    }
    for (words, r) in &rows {
        let told: Vec<String> = ["medial", "lateral"]
            .iter()
            .flat_map(|side| columns.map(|(what, _)| contact(r, side, what).map_or(String::new(), |t| number(&t))))
            .collect();
        if told.iter().any(|t| !t.is_empty()) {
            contacts.rows.push(std::iter::once(words.clone()).chain(told).collect());
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
pub(super) fn on_paper(tables: &[Table]) -> String {
    let mut notes: Vec<String> = Vec::new();
    let mut html = String::new();
    for t in tables {
        let rows = t.rows.iter().map(|row| {
            let mut cells: Vec<String> = row.iter().map(|c| c.replace(" to ", "\u{2013}")).collect();
            if let Some(first) = cells.first_mut()
                && let Some((name, flags)) = first.clone().split_once(" (")
            {
                let note = format!("{name}: {}", flags.trim_end_matches(')'));
                if !notes.contains(&note) {
                    notes.push(note);
                }
                *first = format!("{name} *");
            }
            cells
        });
        let t = Table { rows: rows.collect(), ..t.clone() };
        html += &format!("<p><b>{}</b></p>{}", escaped(&t.title), cells(&t));
    }
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
