//! credibility.html: one page without network, in the order of the standard.

use super::answers::Answer;
use super::context::Context;
use super::evidence::{Evidence, FactorTold};
use super::grade::{Grade, Level};
use super::told::Told;
use crate::cohort::shared::sentence;
use crate::report::page_parts::{escaped, head};
use std::fmt::Write;

/// Characters of a digest that are shown; credibility.json has all.
const SHOWN: usize = 12;
/// Beside the page's own style.
const STYLE: &str = "<style>.grade{font-weight:600;white-space:nowrap}.grade.strong,.grade.adequate{color:var(--good)}.grade.weak{color:var(--bad)}\
.grade.no-evidence{color:var(--look)}.factor td:first-child{min-width:12rem}.number{white-space:nowrap}.factor th,.overview th,.overview td{overflow-wrap:normal}.trace{color:var(--dim);font-size:.85rem}\
@media(max-width:40rem){.factor table,.factor tbody,.factor tr,.factor td{display:block}.factor thead{display:none}.factor tr{border-bottom:1px solid var(--line);padding:.4rem 0}.factor td{border:0}}</style>";

/// The page.
pub(super) fn page(told: &Told) -> String {
    let mut html = head(&format!("{}: credibility", told.knee)).replace("To the stages", "To the factors");
    let _ = write!(
        html,
        "{STYLE}<header><h1>{}: credibility of the model</h1><p>In the order of ASME V&amp;V 40-2018. Made by build-model from the build's own files; no person has judged it.</p></header>",
        escaped(&told.knee)
    );
    html += &context(told);
    html += &overview(told);
    html += &questions(told);
    html += "<main id=\"stages\">";
    told.factors.iter().for_each(|f| html += &factor(f));
    html + "</main></body></html>\n"
}

/// Question, context of use, risk.
fn context(told: &Told) -> String {
    let Context { question, context_of_use, influence, consequence, flexion_deg } = &told.context;
    let text = |t: &Option<String>| t.as_deref().map_or("not stated".to_owned(), escaped);
    let level = |l: &Option<Level>| l.map_or("not stated", Level::word).to_owned();
    let asks = |risk: Level| {
        format!(
            "{}; it asks for evidence that is {}{}",
            risk.word(),
            risk.asks_for().word(),
            if risk == Level::High { "" } else { " or better" }
        )
    };
    let mut rows = vec![
        ("Question", text(question)),
        ("Context of use", text(context_of_use)),
        ("Flexions asked about", flexion_deg.map_or("not stated".into(), |[a, b]| format!("{a} to {b} deg"))),
        ("Influence of the model", level(influence)),
        ("Consequence of a wrong decision", level(consequence)),
        ("Model risk", told.model_risk.map_or("not stated".to_owned(), asks)),
        ("Model", told.model.as_deref().map_or("not calibrated".to_owned(), |m| format!("calibrated, {}", escaped(m)))),
        ("Built by", format!("Genu {}", escaped(&told.program))),
    ];
    rows.extend(told.shared_prior.as_ref().and_then(sentence).map(|words| ("Prior of other knees", escaped(&words))));
    let rows: String = rows.iter().map(|(k, v)| format!("<tr><th scope=\"row\">{k}</th><td>{v}</td></tr>")).collect();
    format!("<h2>What is asked</h2><table>{rows}</table>")
}

/// A line a factor.
fn overview(told: &Told) -> String {
    let mut html = "<h2>What speaks for it</h2><table class=\"overview\"><thead><tr><th>factor</th><th>weakest evidence</th><th>pieces</th><th>enough for the risk</th></tr></thead><tbody>".to_owned();
    for f in &told.factors {
        let known = f.evidence.iter().filter(|e| e.grade != Grade::NoEvidence).count();
        let enough = match f.enough {
            None => "risk not stated",
            Some(true) => "yes",
            Some(false) => "<strong>no</strong>",
        };
        let _ = write!(
            html,
            "<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td>{}</td><td>{known} of {}</td><td>{enough}</td></tr>",
            anchor(f),
            f.name,
            word(f.grade),
            f.evidence.len()
        );
    }
    html += "</tbody></table><p>A factor is worth what its weakest evidence is worth. Where a number is missing, nothing is assumed. The comparator is this knee alone: the page says nothing of other knees.</p>";
    if !told.changed.is_empty() {
        let _ = write!(
            html,
            "<p class=\"failure\">Not as the build left them, so no evidence: {}. Build again.</p>",
            escaped(&told.changed.join(", "))
        );
    }
    html
}

/// What the published knees left open, answered for this one.
fn questions(told: &Told) -> String {
    let row = |a: &Answer| {
        let cells = [a.answer.clone(), a.numbers_in_words(), a.flexions_in_words()];
        let cells = cells.map(|cell| format!("<td>{}</td>", escaped(&cell))).concat();
        format!("<tr id=\"{}\"><th scope=\"row\">{}</th>{cells}</tr>", answer_anchor(a.id), escaped(a.question))
    };
    let rows: String = told.answers.iter().map(row).collect();
    format!(
        "<h2>What published knees left open, for this one</h2><table class=\"overview\"><thead><tr><th>question</th><th>answer</th><th>numbers</th><th>decided in flexions</th></tr></thead><tbody>{rows}</tbody></table><p>Little, some and much are the grades strong, adequate and weak of the numbers below. Nothing was calibrated again. An end of the search that fits worse than the noise allows is no other answer: it is told as one that did not fit.</p>"
    )
}

/// Where an answer stands on the page.
fn answer_anchor(id: &str) -> String {
    format!("answer-{id}")
}

fn anchor(f: &FactorTold) -> String {
    f.name.to_lowercase().replace(' ', "-")
}

fn word(grade: Grade) -> String {
    format!("<span class=\"grade {}\">{}</span>", grade.word().replace(' ', "-"), grade.word())
}

fn factor(f: &FactorTold) -> String {
    let rows: String = f.evidence.iter().map(row).collect();
    format!(
        "<section class=\"factor\" id=\"{}\"><h2>{}</h2><p>{} Weakest: {}.</p><table><thead><tr><th>what</th><th>number</th><th>grade</th><th>strong, adequate; why</th><th>made by</th></tr></thead><tbody>{rows}</tbody></table></section>",
        anchor(f),
        f.name,
        f.question,
        word(f.grade)
    )
}

fn row(e: &Evidence) -> String {
    let value = e.value.map_or("none".to_owned(), |v| format!("{} {}", number(v), unit(&e.unit)));
    let than = if e.more_is_better { "from" } else { "up to" };
    format!(
        "<tr><td>{}</td><td class=\"number\">{}</td><td>{}</td><td>{than} {}; {}</td><td class=\"trace\">{}</td></tr>",
        escaped(&e.what),
        escaped(value.trim()),
        word(e.grade),
        both(e.limits, unit(&e.unit)),
        escaped(&e.why),
        made_by(e)
    )
}

/// Stage or test, file, digest, day.
fn made_by(e: &Evidence) -> String {
    let Some(digest) = &e.digest else {
        let words = if e.as_built == Some(false) { "nothing: <strong>its file is gone</strong>" } else { "nothing" };
        return words.to_owned();
    };
    let by = match (&e.stage, &e.test) {
        (Some(stage), _) => format!("stage {}", escaped(stage)),
        (None, Some(test)) => {
            format!("test {}, {}", escaped(test), short(e.test_digest.as_deref().unwrap_or_default()))
        }
        (None, None) => String::new(),
    };
    let day = e.date.as_deref().unwrap_or("day not known");
    let changed = if e.as_built == Some(false) { "; <strong>changed since</strong>" } else { "" };
    format!("{by}; <code>{}</code>, {}, {day}{changed}", escaped(&e.file), short(digest))
}

/// The first characters of a digest.
fn short(digest: &str) -> String {
    digest.chars().take(SHOWN).collect()
}

fn unit(unit: &str) -> &str {
    if unit == "-" { "" } else { unit }
}

/// Three digits at most, or the power of ten where it is small.
fn number(x: f64) -> String {
    let size = x.abs();
    let told = match size {
        _ if x.fract() == 0.0 && size < 1e6 => return format!("{x}"),
        s if s < 1e-3 => return format!("{x:.1e}"),
        s if s < 1.0 => format!("{x:.3}"),
        s if s < 100.0 => format!("{x:.2}"),
        _ => return format!("{x:.0}"),
    };
    told.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Two limits with their unit.
fn both([strong, adequate]: [f64; 2], unit: &str) -> String {
    format!("{}, {} {unit}", number(strong), number(adequate)).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_no_empty_ones() {
        assert_eq!(
            [0.43, 0.0245, 4.4e-4, 5.947, 0.2, 13.0, 1234.5, 0.0, -0.05].map(number).join(" "),
            "0.43 0.025 4.4e-4 5.95 0.2 13 1234 0 -0.05"
        );
        assert_eq!((both([1.0, 5.0], "%"), both([0.5, 0.2], "")), ("1, 5 %".to_owned(), "0.5, 0.2".to_owned()));
    }
}
