//! The deck's own steps as a protocol.

use super::bodies::Bodies;
use super::expression::lookup;
use super::keyword::{Block, DeckText};
use crate::DeckError;
use sim::deck::{Amplitude, ChainCoordinate, Control, ControlKind, Curve, DeckProtocol, DeckStep};
use std::collections::BTreeMap;

/// A joint turns by no more than this [rad], 200 deg. Ours.
const MOST_TURN: f64 = 3.5;

/// Reads the steps; `None` where the deck has none.
pub(super) fn protocol(deck: &DeckText, bodies: &Bodies, name: &str) -> Result<Option<DeckProtocol>, DeckError> {
    let mut amplitudes: BTreeMap<String, Amplitude> = BTreeMap::new();
    let mut steps: Vec<DeckStep> = Vec::new();
    let mut step: Option<DeckStep> = None;
    let mut cleared: [bool; 2] = [false; 2];
    let mut fixed_increments = false;
    for block in &deck.blocks {
        match (block.keyword.as_str(), &mut step) {
            ("AMPLITUDE", _) => {
                let amplitude = amplitude(deck, block)?;
                amplitudes.insert(amplitude.name.to_lowercase(), amplitude);
            }
            ("STEP", _) => {
                steps.extend(step.take());
                cleared = [false; 2];
                step = Some(DeckStep {
                    name: block.options.get("NAME").cloned().unwrap_or_else(|| format!("step {}", steps.len() + 1)),
                    duration_s: 0.0,
                    increment_s: None,
                    contact: steps.last().is_some_and(|s| s.contact),
                    controls: steps.last().map_or(Vec::new(), |s| s.controls.clone()),
                });
            }
            ("END STEP", _) => steps.extend(step.take()),
            ("DYNAMIC", Some(step)) => {
                let direct = block.options.contains_key("DIRECT USER CONTROL");
                fixed_increments |= direct;
                if let Some((line, cells)) = block.rows().next() {
                    let row = deck.numbers(block, line, &cells)?;
                    step.increment_s = row.first().copied().filter(|v| direct && *v > 0.0);
                    step.duration_s = row.get(1).copied().unwrap_or(0.0);
                }
            }
            ("CONTACT PAIR", Some(step)) => step.contact = true,
            ("CONNECTOR MOTION" | "CONNECTOR LOAD", Some(step)) => {
                controls(deck, block, (bodies, &amplitudes), step, &mut cleared)?;
            }
            _ => {}
        }
    }
    steps.extend(step);
    if steps.is_empty() {
        return Ok(None);
    }
    if deck.blocks.iter().take_while(|b| b.keyword != "STEP").any(|b| b.keyword == "CONTACT PAIR") {
        steps.iter_mut().for_each(|s| s.contact = true);
    }
    let quirks = quirks(deck, &steps, fixed_increments);
    Ok(Some(DeckProtocol { name: name.to_owned(), lost_half_increment: fixed_increments, steps, quirks }))
}

fn amplitude(deck: &DeckText, block: &Block) -> Result<Amplitude, DeckError> {
    let mut numbers = Vec::new();
    for (line, cells) in block.rows() {
        numbers.extend(deck.numbers(block, line, &cells)?);
    }
    let points: Vec<[f64; 2]> = numbers.as_chunks::<2>().0.to_vec();
    if points.is_empty() || points.windows(2).any(|w| w[1][0] <= w[0][0]) {
        return Err(deck.error(block, block.line, "pairs of time and factor with ascending times expected"));
    }
    let smooth = match block.options.get("SMOOTH") {
        Some(text) => deck.number(block, block.line, text)?,
        None => 0.0,
    };
    let definition = block.option("DEFINITION").unwrap_or_default();
    if !["", "tabular"].contains(&definition.as_str()) && !definition.starts_with("smooth") {
        let what = format!("DEFINITION={} is not read; expected TABULAR or SMOOTH STEP", definition.to_uppercase());
        return Err(deck.error(block, block.line, what));
    }
    let step = definition.starts_with("smooth");
    let curve = if step { Curve::SmoothStep } else { Curve::Linear { smooth } };
    let name = block.options.get("NAME").cloned().unwrap_or_default();
    Ok(Amplitude { name, curve, points })
}

/// Whether an amplitude holds values in place of factors of a magnitude.
fn is_absolute(deck: &DeckText, name: &str) -> bool {
    let mut own = deck
        .blocks
        .iter()
        .filter(|b| b.keyword == "AMPLITUDE" && b.options.get("NAME").is_some_and(|n| n.eq_ignore_ascii_case(name)));
    own.any(|b| b.option("VALUE").as_deref() == Some("absolute"))
}

/// The motions or loads of a block; OP=NEW drops those carried over from the step before.
fn controls(
    deck: &DeckText,
    block: &Block,
    (bodies, amplitudes): (&Bodies, &BTreeMap<String, Amplitude>),
    step: &mut DeckStep,
    cleared: &mut [bool; 2],
) -> Result<(), DeckError> {
    let kind = if block.keyword == "CONNECTOR MOTION" { ControlKind::Motion } else { ControlKind::Load };
    if let Some(rate) = block.option("TYPE").filter(|kind| kind != "displacement") {
        let what = format!(
            "TYPE={} is not read: a rate would be taken for a place; expected TYPE=DISPLACEMENT, with the integral of the rate over time as the amplitude",
            rate.to_uppercase()
        );
        return Err(deck.error(block, block.line, what));
    }
    let flag = &mut cleared[usize::from(kind == ControlKind::Load)];
    if block.option("OP").as_deref() == Some("new") && !*flag {
        step.controls.retain(|c| c.kind != kind);
        *flag = true;
    }
    let amplitude = match block.options.get("AMPLITUDE") {
        None => None,
        Some(name) => match amplitudes.get(&name.to_lowercase()) {
            Some(found) => Some(found.clone()),
            None => return Err(deck.error(block, block.line, format!("amplitude \"{name}\" is not defined above"))),
        },
    };
    let absolute = amplitude.as_ref().is_some_and(|a| is_absolute(deck, &a.name));
    for (line, cells) in block.rows() {
        let set = cells.first().unwrap_or(&"").to_lowercase();
        let Some(axis) = bodies.axes.iter().position(|a| *a == set || a.rsplit('.').next() == Some(&set)) else {
            return Err(deck.error(block, line, format!("\"{set}\" is none of the joint's axes")));
        };
        let component = cells.get(1).copied().unwrap_or("");
        let coordinate = match (axis, component) {
            (0, "1") => ChainCoordinate::Si,
            (0, "4") => ChainCoordinate::Ie,
            (1, "1") => ChainCoordinate::Ap,
            (1, "4") => ChainCoordinate::Vv,
            (2, "1") => ChainCoordinate::Ml,
            (2, "4") => ChainCoordinate::Fe,
            _ => return Err(deck.error(block, line, format!("component \"{component}\"; expected 1 or 4"))),
        };
        let magnitude = deck.number(block, line, cells.get(2).unwrap_or(&""))?;
        // such an amplitude holds the values themselves, whatever the magnitude
        let magnitude = if absolute { 1.0 } else { magnitude };
        let turns = matches!(coordinate, ChainCoordinate::Ie | ChainCoordinate::Vv | ChainCoordinate::Fe);
        let factors = amplitude.iter().flat_map(|a| &a.points).map(|p| p[1].abs());
        let most = magnitude.abs() * factors.reduce(f64::max).unwrap_or(1.0);
        if turns && kind == ControlKind::Motion && most > MOST_TURN {
            let what = format!("a motion turns by {most} rad; expected {MOST_TURN} at most: is it in degrees?");
            return Err(deck.error(block, line, what));
        }
        step.controls.retain(|c| c.coordinate != coordinate || c.kind != kind);
        step.controls.push(Control { coordinate, kind, magnitude, amplitude: amplitude.clone() });
    }
    Ok(())
}

/// The habits of the published decks, told where the numbers show them.
fn quirks(deck: &DeckText, steps: &[DeckStep], fixed_increments: bool) -> Vec<String> {
    let mut quirks = Vec::new();
    let find = |coordinate, kind| {
        steps
            .iter()
            .flat_map(|s| &s.controls)
            .find(move |c| c.coordinate == coordinate && c.kind == kind && c.magnitude != 0.0 && c.amplitude.is_some())
    };
    let degree = 1f64.to_radians();
    if let Some(c) = find(ChainCoordinate::Fe, ControlKind::Motion)
        && (c.magnitude.abs() / degree - 1.0).abs() < 0.02
        && (c.magnitude.abs() / degree - 1.0).abs() > 1e-6
    {
        quirks.push(format!("flexion is turned into radians by {} instead of {degree:.7}", c.magnitude.abs()));
    }
    if lookup("TF_KIN_BASEMRI_CYLINDRICAL_FE", &deck.parameters) == Some(0.0) {
        quirks.push("flexion base 0: the CT pose's own flexion is not taken off the target".into());
    }
    if find(ChainCoordinate::Vv, ControlKind::Load).is_some_and(|c| c.magnitude < 0.0) {
        quirks.push("the varus-valgus moment is turned round: a positive deck moment pushes into varus".into());
    }
    if let Some(c) = find(ChainCoordinate::Si, ControlKind::Load) {
        quirks.push(format!("compression is this trial's own: {} N along the tibial axis", c.magnitude));
    }
    if fixed_increments {
        quirks.push("fixed increments: a motion's ramp ends half an increment short".into());
    }
    quirks
}
