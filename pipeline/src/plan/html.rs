//! Tables of a plan's page.

use crate::report::escaped;

/// On a narrow screen a row is a list: each of its numbers behind the head of its column. What does not fit into a box scrolls in it.
/// On paper the page has its title, which a report has on a sheet of its own.
pub(super) const STYLE: &str = "<style>@media screen and (max-width:40rem){.fold table,.fold tbody,.fold tr{display:block}\
    .fold thead{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%)}\
    .fold tr{border-bottom:1px solid var(--line);padding:.3rem 0}\
    .fold td{display:grid;grid-template-columns:minmax(0,2fr) minmax(0,3fr);gap:.6rem;border:0;padding:.1rem 0}\
    .fold td:empty{display:none}.fold td::before{content:attr(data-head);color:var(--dim)}}\
    @media print{body>header{display:block!important}.wide{overflow:visible}.fold td,.fold th{font-size:7pt;padding-right:.3rem}}</style>";

/// A table that folds on a narrow screen; its cells are escaped.
pub(super) fn table(header: &[String], rows: impl Iterator<Item = Vec<String>>) -> String {
    let heads: String = header.iter().map(|h| format!("<th>{}</th>", escaped(h))).collect();
    let cell = |(head, text): (&String, &String)| {
        format!("<td data-head=\"{}\">{}</td>", escaped(head), together(&escaped(text)))
    };
    let row = |r: Vec<String>| format!("<tr>{}</tr>", header.iter().zip(&r).map(cell).collect::<String>());
    let body: String = rows.map(row).collect();
    format!("<div class=\"wide fold\"><table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table></div>")
}

/// An interval stays on one line: "7.1 (6.0 to 8.3)" breaks before its bracket alone.
fn together(text: &str) -> String {
    let is_interval = |inner: &str| inner.split(" to ").filter(|x| x.parse::<f64>().is_ok()).count() == 2;
    match text.split_once(" (").and_then(|(value, rest)| Some((value, rest.strip_suffix(')')?))) {
        Some((value, inner)) if is_interval(inner) => format!("{value} ({})", inner.replace(' ', "&nbsp;")),
        _ => text.to_owned(),
    }
}

/// Words for a header.
pub(super) fn words(all: &[&str]) -> Vec<String> {
    all.iter().map(|w| (*w).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cell_has_the_head_of_its_column_and_an_interval_stays_together() {
        let heads = words(&["a", "b & \"c\"", "d"]);
        let rows = [["1", "<2>", ""], ["7.1 (-6.0 to 8.3)", "deficient (1 of 2)", "x"]];
        let text = table(&heads, rows.iter().map(|r| words(r)));
        for (head, cells) in
            heads.iter().zip([["1", "7.1 (-6.0&nbsp;to&nbsp;8.3)"], ["&lt;2&gt;", "deficient (1 of 2)"], ["", "x"]])
        {
            for cell in cells {
                let whole = format!("<td data-head=\"{}\">{cell}</td>", escaped(head));
                assert_eq!(text.matches(&whole).count(), 1, "{whole}: {text}");
            }
        }
        assert_eq!(text.matches("<tr>").count(), 3, "{text}");
    }
}
