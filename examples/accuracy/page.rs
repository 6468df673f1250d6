//! Figures with their limits, and the page they stand on.

use std::fmt::Write;

/// What a figure should keep to.
#[derive(Clone, Copy)]
pub(crate) enum Limit {
    Most(f64),
    Least(f64),
}

/// A figure in each of its cases.
pub(crate) struct Figure {
    what: String,
    limit: Limit,
    cases: Vec<(String, f64)>,
}

/// A part of the page.
pub(crate) struct Section {
    title: &'static str,
    words: String,
    figures: Vec<Figure>,
}

impl Section {
    pub(crate) fn new(title: &'static str, words: &str) -> Section {
        Section { title, words: words.split_whitespace().collect::<Vec<_>>().join(" "), figures: Vec::new() }
    }

    /// Adds a case of the figure `what`.
    pub(crate) fn add(&mut self, what: &str, limit: Limit, case: &str, value: f64) {
        let known = self.figures.iter_mut().find(|f| f.what == what);
        let case = (case.to_string(), value);
        match known {
            Some(figure) => figure.cases.push(case),
            None => self.figures.push(Figure { what: what.into(), limit, cases: vec![case] }),
        }
    }

    /// The section in Markdown.
    pub(crate) fn text(&self) -> String {
        let mut text = format!(
            "## {}\n\n{}\n\n| figure | limit | cases | median | worst | beyond |\n|---|---|---|---|---|---|\n",
            self.title, self.words
        );
        for figure in &self.figures {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", figure.row());
        }
        text
    }

    /// How many figures have a case beyond their limit, and how many there are.
    pub(crate) fn tally(&self) -> (usize, usize) {
        (self.figures.iter().filter(|f| f.beyond().next().is_some()).count(), self.figures.len())
    }
}

impl Figure {
    fn beyond(&self) -> impl Iterator<Item = &(String, f64)> {
        self.cases.iter().filter(|(_, x)| match self.limit {
            Limit::Most(most) => x.is_nan() || *x > most,
            Limit::Least(least) => x.is_nan() || *x < least,
        })
    }

    fn row(&self) -> String {
        let mut values: Vec<f64> = self.cases.iter().map(|c| c.1).collect();
        values.sort_by(f64::total_cmp);
        let (limit, worst) = match self.limit {
            Limit::Most(most) => (format!("<= {most}"), values.last()),
            Limit::Least(least) => (format!(">= {least}"), values.first()),
        };
        let beyond: Vec<String> = self.beyond().map(|(case, x)| format!("{case} {}", number(*x))).collect();
        let median = values.get(values.len() / 2).map_or(String::new(), |x| number(*x));
        let worst = worst.map_or(String::new(), |x| number(*x));
        let beyond = if beyond.is_empty() { "none".into() } else { beyond.join("; ") };
        format!("| {} | {limit} | {} | {median} | {worst} | {beyond} |", self.what, values.len())
    }
}

/// Three digits that count.
fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if a < 1e-3 => format!("{x:.1e}"),
        a if a < 0.1 => format!("{x:.4}"),
        a if a < 10.0 => format!("{x:.3}"),
        a if a < 1000.0 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}
