//! The protocols by explicit dynamics, and the quasi-static answer beside them as the check.

use crate::apart::{Apart, Checked};
use crate::validate::{Source, leaves_plateau};
use notices::{Kind, Notice};
use rayon::prelude::*;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{FE, FREE, Six};
use sim::explicit::{TrialSteps, explicit_rows};
use sim::flags::{Cause, Flag};
use sim::laxity::{TrialResult, force_column};
use sim::model::Model;
use sim::protocols::{Agreement, Protocol, ProtocolOptions};
use sim::quasistatic::{Goal, State, increment_near};

/// Protocols in the order of [`Source::protocols`], and what is cut in each.
const PROTOCOLS: [(Protocol, Option<&str>); 4] = [
    (Protocol::ApLaxity, None),
    (Protocol::PassiveFlexion, None),
    (Protocol::PivotShift, None),
    (Protocol::PivotShift, Some("ACL")),
];

/// The same source by explicit dynamics: the whole way from the CT pose, by the paper's steps, to rest at each row. Rows whose path was stopped stay
/// quasi-static and are flagged.
///
/// # Errors
/// Options out of range.
pub fn explicit(quasi: &Source, model: &Model, options: &ProtocolOptions) -> Result<(Source, Vec<Notice>), SimError> {
    let mut out = quasi.clone();
    let name = out.name.clone();
    let mut told = Vec::new();
    let rows = [0, 1, 2, 3].map(|k| quasi.protocols()[k].1.len());
    let solved = all_rows(model, rows, options)?;
    for (found, (protocol, rows)) in solved.into_iter().zip(out.protocols_mut()) {
        let stopped = found.iter().filter(|r| r.is_err()).count();
        if let Some(e) = found.iter().find_map(|r| r.as_ref().err()) {
            let what = format!(
                "{name}: {protocol}: explicit dynamics were stopped early, {stopped} of {} rows are the quasi-static answer: {e}",
                found.len()
            );
            told.push(Kind::ExplicitStopped.notice(what).of(&name).count(stopped));
        }
        // of the quasi-static rows it was said before
        let is_said = rows.iter().any(Source::is_dislocated);
        for (row, by) in rows.iter_mut().zip(found) {
            match by {
                Ok(by) => *row = with_other_rests(by, row),
                // where neither has an answer there is no quasi-static one to tell
                Err(_) if Source::has_answer(row) => row.flags.push(Flag::Stopped),
                Err(_) => {}
            }
        }
        let is_new = !is_said && rows.iter().any(Source::is_dislocated);
        told.extend(is_new.then(|| leaves_plateau(&name, protocol)));
    }
    Ok((out, told))
}

/// A row by explicit dynamics with what the quasi-static search found beside it: another equilibrium.
fn with_other_rests(mut by: TrialResult, quasi: &TrialResult) -> TrialResult {
    by.flags.extend(quasi.flags.contains(&Flag::Several).then_some(Flag::Several));
    by
}

/// Rows of one protocol, as far as they were solved.
type Rows = Vec<Result<TrialResult, SimError>>;

/// Rows of every protocol that has any, all at once.
fn all_rows(model: &Model, counts: [usize; 4], options: &ProtocolOptions) -> Result<Vec<Rows>, SimError> {
    let one = |k: usize| {
        let (protocol, cut) = PROTOCOLS[k];
        if counts[k] == 0 {
            return Ok(vec![]);
        }
        let cut = cut.map(|c| model.without(&[c.to_owned()])).transpose()?;
        explicit_rows(cut.as_ref().unwrap_or(model), protocol, options, &TrialSteps::default(), &options.explicit)
    };
    (0..PROTOCOLS.len()).into_par_iter().map(one).collect()
}

/// Holds a source by explicit dynamics against its quasi-static answer: rows that lie too far apart are flagged with the cause, and the largest
/// differences are kept with their places.
///
/// # Errors
/// A model that cannot be without friction or ACL.
pub fn hold_against(
    source: &mut Source,
    quasi: &Source,
    model: &Model,
    options: &ProtocolOptions,
) -> Result<Vec<Notice>, SimError> {
    let (bundles, name) = (source.bundles.clone(), source.name.clone());
    let (mut largest, mut told) = (Vec::new(), Vec::new());
    let quasistatic = [0, 1, 2, 3].map(|k| quasi.protocols()[k].1.to_vec());
    for ((protocol, rows), (beside, (_, cut))) in
        source.protocols_mut().into_iter().zip(quasistatic.iter().zip(PROTOCOLS))
    {
        if rows.is_empty() {
            continue;
        }
        let cut_model = cut.map(|c| model.without(&[c.to_owned()])).transpose()?;
        let free = cut_model.as_ref().unwrap_or(model).with_friction(0.0)?;
        let place = Place { protocol, cut: cut.unwrap_or_default() };
        let mut all = Vec::new();
        // a row that one of them alone has an answer to is not held against anything
        let told_by_both = |(row, other): &(&mut TrialResult, &TrialResult)| {
            !row.flags.contains(&Flag::Stopped) && Source::has_answer(row) && Source::has_answer(other)
        };
        for (row, other) in rows.iter_mut().zip(beside).filter(told_by_both) {
            let mut apart = place.differences(row, other, &bundles, &options.agree);
            if apart.iter().any(|a| a.share() > 1.0) {
                let cause = cause(&free, row, other, options);
                row.flags.push(Flag::Apart(cause));
                apart.iter_mut().filter(|a| a.share() > 1.0).for_each(|a| a.cause = Some(cause));
            }
            all.extend(apart);
        }
        let beyond = rows.iter().filter(|r| r.flags.iter().any(|f| matches!(f, Flag::Apart(_)))).count();
        let found = ["mm", "deg", "N"].map(|unit| most(&all, unit));
        if let (true, Some(worst)) = (beyond > 0, found.iter().flatten().max_by(|a, b| a.share().total_cmp(&b.share())))
        {
            told.push(notice(&name, beyond, worst));
        }
        largest.extend(found.into_iter().flatten());
    }
    source.check = Some(Checked { quasistatic, largest });
    Ok(told)
}

/// The largest of a unit; of equals the first.
fn most(all: &[Apart], unit: &str) -> Option<Apart> {
    let own = all.iter().filter(|a| a.unit == unit);
    own.reduce(|a, b| if b.difference().abs() > a.difference().abs() { b } else { a }).cloned()
}

fn notice(name: &str, rows: usize, worst: &Apart) -> Notice {
    let cause = worst.cause.map_or("", Cause::words);
    let what = format!(
        "{name}: {}: explicit and quasi-static answers differ by more than they may in {rows} row{}; most at {}: {} by {:.2} {} ({cause})",
        worst.protocol,
        if rows == 1 { "" } else { "s" },
        worst.step,
        worst.quantity,
        worst.difference().abs(),
        worst.unit
    );
    Kind::SolversApart.notice(what).of(name).count(rows)
}

/// Where differences are told of.
struct Place<'a> {
    protocol: &'a str,
    cut: &'a str,
}

impl Place<'_> {
    /// Differences of two rows in every coordinate and bundle.
    fn differences(&self, row: &TrialResult, other: &TrialResult, bundles: &[String], may: &Agreement) -> Vec<Apart> {
        let one = |(quantity, column): (String, String), unit: &str, values: [f64; 2], limit: f64| Apart {
            protocol: self.protocol.to_owned(),
            cut: self.cut.to_owned(),
            step: row.trial.trial.clone(),
            flexion_deg: row.pose.fe_deg,
            quantity,
            column,
            unit: unit.to_owned(),
            explicit: values[0],
            quasistatic: values[1],
            limit,
            cause: None,
        };
        let (here, there) = (row.predicted(), other.predicted());
        let pose = FREE.into_iter().map(|c| {
            let limit = if c.turns() { may.deg } else { may.mm };
            one((c.name().to_uppercase(), c.column()), c.unit(), [here[c], there[c]], limit)
        });
        let forces = bundles.iter().zip(row.forces_n.iter().zip(&other.forces_n));
        pose.chain(forces.map(|(b, (f, g))| one((b.clone(), force_column(b)), "N", [*f, *g], may.n))).collect()
    }
}

/// Why two rows lie apart: both are followed to their rest without friction.
fn cause(free: &Model, row: &TrialResult, other: &TrialResult, options: &ProtocolOptions) -> Cause {
    if row.flags.contains(&Flag::Moving) {
        return Cause::Moving;
    }
    if Source::is_dislocated(row) || Source::is_dislocated(other) {
        return Cause::OffPlateau;
    }
    let rest = |r: &TrialResult| -> Option<Six> {
        let from = free.joint.coordinates(&r.pose.six()).ok()?;
        let goal = Goal { flexion: from[FE], load: r.trial.load.generalised(), flow: None };
        let solver = &options.trials.solver;
        let solved = increment_near(free, &State::at(from), &goal, solver, true, &mut Nearby::default()).ok()?;
        Some(free.joint.grood_suntay(&solved.state.q))
    };
    let (Some(a), Some(b)) = (rest(row), rest(other)) else { return Cause::Unknown };
    let limit = |turns: bool| if turns { options.agree.deg } else { options.agree.mm };
    let same = FREE.into_iter().all(|c| c.to_file(a[c] - b[c]).abs() <= limit(c.turns()));
    if same { Cause::Friction } else { Cause::Equilibria }
}

#[cfg(test)]
mod tests;
