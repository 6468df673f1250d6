//! The answer in plain words, before any number of statistics: what it means, and what would tell.

use crate::catalogue::Catalogue;
use crate::next_test::NextTest;
use crate::plain_unnamed::{closing, contradictions, meaning, noise};
use crate::report::{Answer, Carried, Diagnosis, MayBeTorn, Named, Verdict};
use crate::words::{figures, with_unit};
use std::fmt::Write;

/// Expected log odds below which no single test is worth calling one that would tell [nats]: odds of less than three to one.
const WOULD_TELL: f64 = 1.0;
/// Flexion up to which a forward drawer is a Lachman test [deg].
const LACHMAN_DEG: f64 = 30.0;
/// Most structures that are listed as left open [-].
const MOST_OPEN: usize = 4;
/// Ligament force in the report's tests from which it is told as unlikely [N]: twice the drawer of 133 N. Ours: in cadavers the ACL carries about the load of a
/// drawer [sakane1997].
const UNLIKELY_N: f64 = 267.0;

/// The head of a diagnosis in plain words: what it means first; then a line for each thing to know or to do.
pub(crate) fn plain(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let mut out = match d.verdict {
        Verdict::None => nothing(d),
        Verdict::Unnamed => unnamed(catalogue, d),
        _ => named(catalogue, d),
    };
    if d.verdict != Verdict::Unnamed {
        out += &contradictions(&d.contradictions);
    }
    // beside an answer, what is rough may be the answer's own
    if d.answers.is_empty() {
        out += &noise(&d.noise);
    }
    for more in [test(d), unlikely(&d.ligament_forces)].iter().filter(|m| !m.is_empty()) {
        let _ = write!(out, "\n{more}");
    }
    out
}

fn named(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let answers: Vec<String> = d.answers.iter().map(|a| answer(catalogue, a)).collect();
    let Some((first, others)) = answers.split_first() else { return String::new() };
    let mut out = match d.verdict {
        Verdict::Decisive => format!("{}.", capital(first)),
        Verdict::Probable => format!("Most likely {first}."),
        _ => format!("{}.", capital(first)),
    };
    if !others.is_empty() {
        let how = if d.verdict == Verdict::OneOf { "Or" } else { "These data alone would not exclude that" };
        let _ = write!(out, " {how} {}.", others.join(", or "));
    }
    out
}

fn unnamed(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let bare = |words: String| words.trim_start_matches("there is").trim_start_matches([':', ' ']).to_owned();
    let near: Vec<String> = d.best.iter().map(|e| bare(effect(catalogue, e))).collect();
    let mut out = meaning(d);
    if !near.is_empty() {
        let _ = write!(out, "\nThe nearest, though not good enough: {}{}.", near.join(", with "), closing(d));
    }
    out
}

fn nothing(d: &Diagnosis) -> String {
    let mut out = String::from("Nothing is missing from the model that these trials show.");
    let (slack, open): (Vec<&MayBeTorn>, Vec<&MayBeTorn>) = d.may_be_torn.iter().partition(|t| t.is_slackened());
    for t in slack {
        let _ = write!(
            out,
            " But it fits only with a slacker {} than the model as given has ({:.0} N at most in these trials, not {:.0} N): that is torn, or slack by {:.0} % of its \
             length or more, and these trials cannot tell which.",
            t.structure,
            t.now_n,
            t.given_n,
            100.0 * t.slack
        );
    }
    let open: Vec<&str> = open.iter().take(MOST_OPEN).map(|t| t.structure.as_str()).collect();
    if let Some((last, others)) = open.split_last() {
        let list = if others.is_empty() { (*last).to_owned() } else { format!("{} or {last}", others.join(", ")) };
        let _ = write!(out, " They would not have shown a torn {list}: slacker ligaments fit as well.");
    }
    if !d.may_be_torn.is_empty() && d.before.is_empty() {
        out += " What the same knee read while it was whole would tell, too (--before NAME=FILE).";
    }
    out
}

fn answer(catalogue: &Catalogue, a: &Answer) -> String {
    a.effects.iter().map(|e| effect(catalogue, e)).collect::<Vec<_>>().join(", and ")
}

/// An effect as a clause.
fn effect(catalogue: &Catalogue, e: &Named) -> String {
    let place = if e.scope == "both" { String::new() } else { format!(" in {}", e.scope) };
    let Ok((found, _)) = catalogue.find(&e.effect) else { return format!("{}{place}", e.effect) };
    let about = e.variant.as_deref().filter(|v| !v.starts_with("about ")).unwrap_or("ligament");
    let share = found.parameter.iter().find_map(|p| Some((e.parameters.get(&p.key)?, p, p.whole?)));
    if let Some((value, of, whole)) = share {
        let (low, high) = value.interval(Some(of));
        let percent = |x: f64| 100.0 * x / whole;
        return if high >= whole {
            format!("the {about} is torn{place}, or has lost {:.0} % or more of what it carries", percent(low))
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
    format!("{article} {}{place}{size}", found.title)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// The test that would tell, where an answer is open.
fn test(d: &Diagnosis) -> String {
    let is_open = d.answers.len() > 1 || matches!(d.verdict, Verdict::Unnamed) || !d.may_be_torn.is_empty();
    let Some(best) = d.next_tests.first().filter(|_| is_open) else { return String::new() };
    if best.expected_gain < WOULD_TELL {
        return format!(
            "No single test of usual load would tell; the best is {} (it changes the log odds by {} at most).",
            told(best),
            figures(best.expected_gain)
        );
    }
    let about = d.may_be_torn.iter().find(|t| t.is_slackened()).or(d.may_be_torn.first());
    let which = about.map_or(String::new(), |t| format!(" of the {}", t.structure));
    let careful = if best.gives_way { " The knee may give way in it: begin with less load." } else { "" };
    format!("{} would tell{which}.{careful}", capital(&told(best)))
}

/// A test as a clinician calls it.
fn told(t: &NextTest) -> String {
    let load = t.load.abs();
    let name = match t.test.as_str() {
        "anterior" if t.flexion_deg <= LACHMAN_DEG => format!("a Lachman test ({load:.0} N forward"),
        "anterior" => format!("an anterior drawer ({load:.0} N"),
        "posterior" => format!("a posterior drawer ({load:.0} N"),
        "internal" | "external" => format!("an {} rotation ({load:.0} N m", t.test),
        "varus" | "valgus" => format!("a {} test ({load:.0} N m", t.test),
        other => format!("a {other} trial (unloaded"),
    };
    format!("{name} at {:.0} deg, in {})", t.flexion_deg, t.source)
}

/// The unlikeliest load that an answer puts into a ligament.
fn unlikely(forces: &[Carried]) -> String {
    let is_unlikely = |c: &&Carried| c.with_n >= UNLIKELY_N && c.with_n > c.without_n;
    let most = forces.iter().filter(is_unlikely).max_by(|a, b| a.with_n.total_cmp(&b.with_n));
    most.map_or(String::new(), |c| {
        format!("Beware: the answer has the {} carry {:.0} N under {}, an unlikely load.", c.ligament, c.with_n, c.test)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Value;

    fn lost(structure: &str, value: f64, sd: f64) -> Named {
        let parameters = [("loss".to_owned(), Value { value, sd, unit: "-".into() })].into();
        Named { effect: "structure_loss".into(), scope: "both".into(), variant: Some(structure.into()), parameters }
    }

    #[test]
    fn a_loss_is_told_as_a_tear_only_where_all_may_be_lost() {
        let words = |value, sd| effect(&Catalogue::shipped(), &lost("ACL", value, sd));
        assert_eq!(words(1.0, 0.05), "the ACL is torn, or has lost 92 % or more of what it carries");
        assert_eq!(words(0.5, 0.1), "the ACL has lost 34 to 66 % of what it carries");
    }

    #[test]
    fn a_forward_drawer_is_a_lachman_test_near_extension_alone() {
        let at = |flexion_deg| NextTest {
            test: "anterior".into(),
            flexion_deg,
            load: 130.0,
            source: "kla".into(),
            expected_gain: 4.0,
            gives_way: false,
        };
        assert_eq!(told(&at(15.0)), "a Lachman test (130 N forward at 15 deg, in kla)");
        assert_eq!(told(&at(75.0)), "an anterior drawer (130 N at 75 deg, in kla)");
    }

    #[test]
    fn a_load_that_the_answer_itself_puts_into_a_ligament_is_told_where_nobody_has_seen_it() {
        let carried = |without_n, with_n| Carried {
            ligament: "PCL".into(),
            test: "133 N forward at 30 deg".into(),
            without_n,
            with_n,
        };
        assert!(unlikely(&[carried(20.0, 361.0)]).contains("361 N under 133 N forward"));
        assert_eq!(unlikely(&[carried(20.0, 140.0), carried(400.0, 361.0)]), "");
    }
}
