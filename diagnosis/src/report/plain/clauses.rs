//! Effects as clauses of a sentence.

use crate::effect::catalogue::Catalogue;
use crate::fit::share_at_whole;
use crate::report::Named;
use crate::report::words::with_unit;

/// An effect as a clause.
pub(super) fn effect(catalogue: &Catalogue, e: &Named) -> String {
    let place = if e.scope == "both" { String::new() } else { format!(" in {}", e.scope) };
    let Ok((found, _)) = catalogue.find(&e.effect) else { return format!("{}{place}", e.effect) };
    let about = e.variant.as_deref().filter(|v| !v.starts_with("about ")).unwrap_or("ligament");
    let share = found.parameter.iter().find_map(|p| Some((e.parameters.get(&p.key)?, p, p.whole?)));
    if let Some((value, of, whole)) = share {
        let (low, high) = value.interval(Some(of));
        let percent = |x: f64| 100.0 * x / whole;
        return if high >= whole {
            let weight = share_at_whole((value.value, value.sd), of).unwrap_or_default();
            format!(
                "the {about} is torn{place} (weight of a whole tear: {weight:.2}), or has lost {:.0} % or more of what it carries",
                percent(low)
            )
        } else {
            format!("the {about} has lost {:.0} to {:.0} % of what it carries{place}", percent(low), percent(high))
        };
    }
    if found.id == "attachment" {
        let off = e.parameters.values().map(|v| v.value * v.value).sum::<f64>().sqrt();
        return format!("the {about} is attached {off:.0} mm from where the model has it");
    }
    let main = found
        .parameter
        .iter()
        .filter(|p| !p.shape)
        .filter_map(|p| e.parameters.get(&p.key))
        .max_by(|a, b| (a.value / a.sd).abs().total_cmp(&(b.value / b.sd).abs()));
    let size = main.map_or(String::new(), |v| format!(" ({})", with_unit(v.value, &v.unit)));
    let article = if found.title.starts_with("a ") { "there is" } else { "there is:" };
    let of = e.variant.as_deref().map_or(String::new(), |v| format!(" ({v})"));
    format!("{article} {}{of}{place}{size}", found.title)
}

/// An effect without the words that make it a sentence.
pub(super) fn bare(catalogue: &Catalogue, e: &Named) -> String {
    effect(catalogue, e).trim_start_matches("there is").trim_start_matches([':', ' ']).to_owned()
}

/// With a capital.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
