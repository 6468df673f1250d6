//! The four answers of the first screen as cards, each with the figures of its stages.

use super::check::KeyFigure;
use super::html::escaped;
use crate::stage::{Answer, Standing};

/// The class that colours an answer.
pub(super) fn class(standing: Standing) -> &'static str {
    match standing {
        Standing::Good => "good",
        Standing::Look => "look",
        Standing::Failed => "failed",
        Standing::Open => "unknown",
    }
}

/// The cards; `figures` are key figures by their stage, `stages` those that have a section to lead to.
pub(super) fn html(answers: &[Answer; 4], figures: &[(&str, KeyFigure)], stages: &[String]) -> String {
    let mut out = "<ul class=\"answers\">".to_owned();
    for (k, a) in answers.iter().enumerate() {
        let mine = figures.iter().filter(|(stage, _)| place(stage) == k);
        let facts: String = mine.map(|(_, f)| fact(f)).collect();
        let there = stages.iter().any(|s| s == a.stage) || a.standing == Standing::Failed;
        let more = if there { format!(" <a href=\"#{}\">More</a>", escaped(a.stage)) } else { String::new() };
        out += &format!(
            "<li class=\"{}\" data-answer=\"{}\"><h3>{}</h3><p class=\"word\">{}</p>{facts}<p>{}{more}</p></li>",
            class(a.standing),
            ["geometry", "calibrated", "predicts", "missing"][k],
            escaped(a.question),
            escaped(&a.word),
            escaped(&a.words)
        );
    }
    out + "</ul>"
}

/// Under which answer a stage's figure stands.
fn place(stage: &str) -> usize {
    match stage {
        "assemble" | "calibrate" => 1,
        "validate" => 2,
        "diagnose" => 3,
        _ => 0,
    }
}

fn fact(f: &KeyFigure) -> String {
    let class = match f.good {
        Some(true) => "good",
        Some(false) => "look",
        None => "unknown",
    };
    format!("<p class=\"fact {class}\"><b>{}</b> {} ({})</p>", escaped(&f.value), escaped(f.name), escaped(&f.limit))
}
