//! Where the nodes of a deck lie: coordinate systems, parts and the movement of their instances.

use super::DeckError;
use super::keyword::{Block, DeckText};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Rotation3, Unit};
use std::collections::BTreeMap;

/// A line in the plane counts as horizontal where it rises less than this share of its length [-]: rounding of the deck's numbers.
const LEVEL: f64 = 1e-6;
/// Labels of an instance's nodes are counted on from this, times the instance's number; Abaqus' own labels are less.
const SCOPE: u64 = 1 << 40;

/// A keyword block and the instance that it belongs to.
#[derive(Clone, Copy)]
pub(super) struct Scoped<'a> {
    /// The block.
    pub(super) block: &'a Block,
    /// Number of the instance; 0 is the assembly itself.
    pub(super) scope: usize,
}

/// The assembly, first, and the instances of parts.
#[derive(Clone, Debug, Default)]
pub(super) struct Scopes {
    /// Names in lower case; the assembly's is empty.
    names: Vec<String>,
    /// How each is moved.
    moves: Vec<Isometry>,
}

impl Scopes {
    /// The number of an instance.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().skip(1).position(|n| *n == name.to_lowercase()).map(|k| k + 1)
    }

    /// Numbers of the instances.
    pub(super) fn instances(&self) -> impl Iterator<Item = usize> {
        1..self.names.len()
    }

    /// A name in the scope: `instance.name`, lower case.
    pub(super) fn name(&self, scope: usize, name: &str) -> String {
        if scope == 0 { name.to_lowercase() } else { format!("{}.{}", self.names[scope], name.to_lowercase()) }
    }

    /// The number by which a node of the scope is known.
    pub(super) fn node(scope: usize, label: u64) -> Option<u64> {
        (label < SCOPE).then_some(label + SCOPE * scope as u64)
    }

    /// A node as the deck calls it.
    pub(super) fn label(&self, node: u64) -> String {
        let (scope, label) = ((node / SCOPE) as usize, node % SCOPE);
        if scope == 0 || scope >= self.names.len() { label.to_string() } else { self.name(scope, &label.to_string()) }
    }

    /// A point of the scope, where the assembly has it.
    pub(super) fn place(&self, scope: usize, p: &Point) -> Point {
        self.moves[scope] * p
    }
}

/// The blocks of a deck, those of each part once for each of its instances.
///
/// # Errors
/// A part that no instance uses, an instance of no part, a movement that is no movement.
pub(super) fn flat(deck: &DeckText) -> Result<(Vec<Scoped<'_>>, Scopes), DeckError> {
    let mut scopes = Scopes { names: vec![String::new()], moves: vec![Isometry::identity()] };
    let mut blocks = Vec::new();
    let mut parts: BTreeMap<String, (&Block, Vec<&Block>, bool)> = BTreeMap::new();
    let mut part: Option<String> = None;
    let mut scope = 0;
    for block in &deck.blocks {
        let named = |option: &str| {
            let missing = || deck.error(block, block.line, format!("{option}= is missing"));
            block.option(option).filter(|name| !name.is_empty()).ok_or_else(missing)
        };
        match block.keyword.as_str() {
            "PART" => {
                let name = named("NAME")?;
                parts.insert(name.clone(), (block, Vec::new(), false));
                part = Some(name);
            }
            "END PART" => part = None,
            "INSTANCE" => {
                let (name, of) = (named("NAME")?, named("PART")?);
                let Some((_, own, used)) = parts.get_mut(&of) else {
                    return Err(deck.error(block, block.line, format!("there is no *PART of the name {of} above")));
                };
                *used = true;
                scopes.names.push(name);
                scopes.moves.push(movement(deck, block)?);
                scope = scopes.names.len() - 1;
                blocks.extend(own.iter().map(|&block| Scoped { block, scope }));
            }
            "END INSTANCE" => scope = 0,
            _ => match part.as_ref().and_then(|name| parts.get_mut(name)) {
                Some((_, own, _)) => own.push(block),
                None => blocks.push(Scoped { block, scope }),
            },
        }
    }
    if let Some((block, ..)) = parts.values().find(|(_, own, used)| !used && !own.is_empty()) {
        return Err(deck.error(
            block,
            block.line,
            "no *INSTANCE uses this part, so it is not in the model; write *INSTANCE, NAME=..., PART=... in the *ASSEMBLY",
        ));
    }
    Ok((blocks, scopes))
}

/// The movement of an instance: a shift, then a turn by an angle [deg] about the line through two points.
fn movement(deck: &DeckText, block: &Block) -> Result<Isometry, DeckError> {
    let mut moved = Isometry::identity();
    for (k, (line, cells)) in block.rows().enumerate() {
        let numbers = deck.numbers(block, line, &cells)?;
        let refuse = |what: &str| Err(deck.error(block, line, what));
        let at = |i: usize| numbers.get(i).copied().unwrap_or(0.0);
        match k {
            0 if numbers.len() <= 3 => moved = Isometry::translation(at(0), at(1), at(2)),
            1 if numbers.len() == 7 => {
                let (a, b) = (Point::new(at(0), at(1), at(2)), Point::new(at(3), at(4), at(5)));
                let Some(axis) = Unit::try_new(b - a, 1e-9) else {
                    return refuse("the two points of the axis are one");
                };
                let turn = Isometry::rotation_wrt_point(
                    nalgebra::UnitQuaternion::from_axis_angle(&axis, at(6).to_radians()),
                    a,
                );
                moved = turn * moved;
            }
            _ => return refuse("expected a shift (three numbers), then two points of an axis and an angle (seven)"),
        }
    }
    Ok(moved)
}

/// The system that *SYSTEM sets for the nodes after it: its origin, a point on its first axis, a point in its first plane.
///
/// # Errors
/// Points that span no system; two points whose line leaves the first plane.
pub(super) fn system(deck: &DeckText, block: &Block) -> Result<Isometry, DeckError> {
    let mut numbers = Vec::new();
    let mut last = block.line;
    for (line, mut cells) in block.rows().take(2) {
        cells.resize(if numbers.is_empty() { 6.min(cells.len().max(3)) } else { 3 }, "");
        numbers.extend(deck.numbers(block, line, &cells)?);
        last = line;
    }
    let point = |k: usize| numbers.get(3 * k..3 * k + 3).map(Point::from_slice);
    let Some(origin) = point(0) else { return Ok(Isometry::identity()) };
    let shift = nalgebra::Translation3::from(origin.coords);
    let Some(first) = point(1) else { return Ok(Isometry::from_parts(shift, nalgebra::UnitQuaternion::identity())) };
    let flat = || {
        deck.error(
            block,
            last,
            "the points span no system; expected an origin, a point on X and a point in the XY plane",
        )
    };
    let x = (first - origin).try_normalize(1e-9).ok_or_else(flat)?;
    let z = match point(2) {
        Some(third) => x.cross(&(third - origin)).try_normalize(1e-9).ok_or_else(flat)?,
        None if x.z.abs() < LEVEL => Vector::z(),
        None => {
            return Err(deck.error(
                block,
                last,
                "two points leave the system's turn open; write a third, in its XY plane",
            ));
        }
    };
    let turn = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    Ok(Isometry::from_parts(shift, turn.into()))
}

/// A node's coordinates as *NODE, SYSTEM= means them.
///
/// # Errors
/// A system that is not read.
pub(super) fn cartesian(deck: &DeckText, block: &Block, p: [f64; 3]) -> Result<Point, DeckError> {
    match block.option("SYSTEM").as_deref() {
        None | Some("r" | "") => Ok(Point::from(p)),
        Some("c") => {
            let angle = p[1].to_radians();
            Ok(Point::new(p[0] * angle.cos(), p[0] * angle.sin(), p[2]))
        }
        Some(other) => Err(deck.error(
            block,
            block.line,
            format!("SYSTEM={} is not read; expected R (rectangular) or C (cylindrical)", other.to_uppercase()),
        )),
    }
}
