//! One cut in a row: what was said of it, and how far the search stayed behind the truth.

use diagnosis::diagnosis::Diagnosis;
use diagnosis::report::{Named, NotExcluded};
use diagnosis::search::regret::Regret;

/// An answer in short: its effects with their sizes.
fn told(effects: &[Named]) -> String {
    let one = |e: &Named| {
        let about = e.variant.as_ref().map_or(String::new(), |v| format!(" {v}"));
        let place = if e.scope == "both" { String::new() } else { format!(" ({})", e.scope) };
        let sizes: Vec<String> = e.parameters.iter().map(|(k, v)| format!(" {k} {:.2}", v.value)).collect();
        format!("{}{about}{place}{}", e.effect, sizes.concat())
    };
    effects.iter().map(one).collect::<Vec<_>>().join(" + ")
}

/// The share that an answer says the ligament has lost.
fn loss_found(d: &Diagnosis, ligament: &str) -> Option<f64> {
    let is_it = |e: &&Named| e.effect == "structure_loss" && e.variant.as_deref() == Some(ligament);
    let found = d.answers.iter().find_map(|a| a.effects.iter().find(is_it))?;
    found.parameters.get("loss").map(|v| v.value)
}

/// A state that is not excluded, with its log odds.
fn state(of: &NotExcluded) -> String {
    let name = match &of.torn {
        Some(structure) => format!("{structure} torn"),
        None if of.effects.is_empty() => "nothing".to_owned(),
        None => told(&of.effects),
    };
    format!("{name} {:.1}", of.log_odds)
}

/// The row of a cut.
pub(crate) fn row(
    (ligament, loss, seed): (&str, f64, u64),
    trials: usize,
    d: &Diagnosis,
    regret: Option<Regret>,
    seconds: f64,
) -> String {
    let answers: Vec<String> = d.answers.iter().map(|a| format!("{} [{:.2}]", told(&a.effects), a.weight)).collect();
    let figure = |x: Option<f64>, places: usize| x.map_or("-".to_owned(), |x| format!("{x:.places$}"));
    let test = d.next_tests.first().map_or("-".to_owned(), |t| {
        format!("{} {:.0} deg {} gain {:.1}", t.test, t.flexion_deg, t.source, t.expected_gain)
    });
    let cells = [
        ligament.to_owned(),
        format!("{loss}"),
        seed.to_string(),
        trials.to_string(),
        format!("{:?}", d.verdict),
        answers.first().cloned().unwrap_or_else(|| format!("- (best {})", told(&d.best))),
        answers.get(1..).unwrap_or_default().join(", "),
        figure(loss_found(d, ligament), 2),
        figure(regret.map(|r| r.information), 1),
        figure(regret.map(|r| r.truth), 1),
        figure(d.best_log_bayes_factor, 1),
        figure(regret.map(|r| r.short()), 1),
        figure(regret.map(|r| r.leaves), 2),
        format!("{:.1} {:.1}", d.wildcard, d.wildcard_alone.unwrap_or_default()),
        format!("{:.2} {:.2}", d.misfit[0], d.misfit[1]),
        test,
        d.not_excluded.iter().map(state).collect::<Vec<_>>().join(", "),
        format!("{seconds:.0}"),
    ];
    format!("| {} |", cells.join(" | "))
}

/// What stands in a row.
pub(crate) const HEAD: &str = "| cut | share | seed | trials | verdict | first | others of the set | loss found | information | truth earns | best earns | regret | truth leaves | field beside, in place | left before, after | next test | not excluded, log odds | s |";
