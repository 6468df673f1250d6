//! One page of A4 for whoever supervises: the four answers, the knee, its forces. Shown on paper alone.

use super::cards::class;
use super::html::escaped;
use super::picture::Picture;
use crate::stage::Answer;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// What the page is of.
pub(super) struct Sheet<'a> {
    pub(super) id: &'a str,
    pub(super) synthetic: bool,
    pub(super) verdict: &'a str,
    pub(super) answers: [Answer; 4],
    pub(super) stills: Vec<Picture>,
    /// Tables and figures of the validation, as HTML; empty where there was none.
    pub(super) forces: String,
}

impl Sheet<'_> {
    /// The page.
    pub(super) fn html(&self) -> String {
        let made = if self.synthetic { " Synthetic: made by the program, not measured." } else { "" };
        let told = match self.forces.is_empty() {
            true => "",
            false => {
                " Forces in N, means with 90 % intervals in brackets where samples were asked, else most probable values."
            }
        };
        let card = |a: &Answer| {
            format!(
                "<li class=\"{}\"><b>{} {}.</b> {}</li>",
                class(a.standing),
                escaped(a.question),
                escaped(&a.word),
                escaped(&a.words)
            )
        };
        let still = |p: &Picture| {
            format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", escaped(&p.caption), STANDARD.encode(&p.png))
        };
        format!(
            "<section class=\"sheet\" aria-label=\"One page\"><h1>{}: model of the knee on one page</h1><p>{}{made}{told} Version {}.</p><ul class=\"answers\">{}</ul><div class=\"pictures\">{}</div>{}</section>",
            escaped(self.id),
            escaped(self.verdict),
            env!("CARGO_PKG_VERSION"),
            self.answers.iter().map(card).collect::<String>(),
            self.stills.iter().map(still).collect::<String>(),
            self.forces
        )
    }
}
