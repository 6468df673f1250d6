//! Every element of a FEBio file and what becomes of it: read, without effect, told, or refused.
//!
//! A row's name is that of the element, with its type behind a colon where FEBio parts the element by types: `contact:sliding-elastic`. The parts of an
//! obeyed one are its parameters, and its attributes with an `@`.

use crate::DeckError;
use crate::known::{Class, Counted, Known, rows};
use crate::tree::{Tree, shown};
use notices::Notice;
use roxmltree::Node;
use sim::names::did_you_mean;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

/// The table, a line an element.
const TABLE: &str = include_str!("elements.txt");

static ELEMENTS: LazyLock<BTreeMap<&'static str, Known>> = LazyLock::new(|| rows(TABLE, ' '));
/// Elements that are parted by their types.
static TYPED: LazyLock<BTreeSet<&'static str>> =
    LazyLock::new(|| ELEMENTS.keys().filter_map(|name| Some(name.split_once(':')?.0)).collect());

/// The elements of FEBio 2.5 to 4.0 that a file of solids may hold.
pub fn elements() -> &'static BTreeMap<&'static str, Known> {
    &ELEMENTS
}

/// The name of an element in the table.
pub(super) fn key(node: Node<'_, '_>) -> String {
    let name = node.tag_name().name();
    match node.attribute("type") {
        Some(kind) if TYPED.contains(name) => format!("{name}:{}", kind.trim()),
        _ => name.to_owned(),
    }
}

/// The elements that are read, in the order of the file, and what is told of the others.
pub(super) struct Judged<'a, 'i> {
    pub(super) objects: Vec<Node<'a, 'i>>,
    pub(super) told: Vec<Notice>,
}

/// Holds every element of a file against the table.
///
/// # Errors
/// An element that is refused, or one that FEBio does not have and that resembles one that is read.
pub(super) fn judge<'a, 'i>(tree: &'a Tree<'i>) -> Result<Judged<'a, 'i>, DeckError> {
    let mut told = Counted::default();
    let mut objects = Vec::new();
    let mut open = vec![tree.root()];
    while let Some(object) = open.pop() {
        let key = key(object);
        let named = key.replacen(':', " ", 1);
        let Some(known) = ELEMENTS.get(key.as_str()) else {
            told.tell(tree, object, unknown(tree, object, &key)?);
            continue;
        };
        if object.attribute("from").is_some() {
            let what = "stands in another file (from); expected one file: save the model by FEBio Studio";
            return Err(tree.error(object, what));
        }
        match known.class {
            Class::Refused => return Err(tree.error(object, format!("{named} is not read: it {}", known.why))),
            Class::Told => told.tell(tree, object, format!("{named} is passed over: {}", known.why)),
            Class::Harmless => {}
            Class::Obeyed => {
                objects.push(object);
                let mut within = inner(tree, object, known, &mut told)?;
                within.reverse();
                open.extend(within);
            }
        }
    }
    Ok(Judged { objects, told: told.told(tree) })
}

/// The elements within an element that have a row of their own; its parameters and attributes are held against its own row.
fn inner<'a, 'i>(
    tree: &Tree<'_>,
    object: Node<'a, 'i>,
    known: &Known,
    told: &mut Counted,
) -> Result<Vec<Node<'a, 'i>>, DeckError> {
    let mut found = Vec::new();
    let owner = object.tag_name().name();
    let attributes = || known.parts.iter().filter_map(|p| p.strip_prefix('@'));
    for attribute in object.attributes() {
        let name = attribute.name();
        if !attributes().any(|a| a == name) {
            let hint = did_you_mean(name, attributes());
            if !hint.is_empty() {
                return Err(tree.error(object, format!("it has no attribute {name}{hint}")));
            }
            told.tell(tree, object, format!("{owner}: the attribute {name} is passed over"));
        }
    }
    for part in object.children().filter(Node::is_element) {
        let name = part.tag_name().name();
        if known.parts.contains(&name) {
            if let Some(odd) = part.attributes().find(|a| !["type", "name", "id"].contains(&a.name())) {
                let what = match odd.name() {
                    "lc" => format!("{owner}: {name} follows a load curve there; its own number is taken"),
                    other => format!("{owner}: the attribute {other} of {name} is passed over"),
                };
                told.tell(tree, part, what);
            }
        } else if ELEMENTS.contains_key(key(part).as_str()) {
            found.push(part);
        } else {
            let hint = did_you_mean(name, known.parts.iter().copied());
            if !hint.is_empty() {
                return Err(tree.error(part, format!("{} has no such parameter{hint}", shown(object))));
            }
            if TYPED.contains(name) || known.parts.iter().all(|p| p.starts_with('@')) {
                found.push(part);
            } else {
                told.tell(tree, part, format!("{owner}: the parameter {name} is passed over"));
            }
        }
    }
    Ok(found)
}

/// What is said of an element that FEBio does not have.
fn unknown(tree: &Tree<'_>, object: Node<'_, '_>, key: &str) -> Result<String, DeckError> {
    let read = ELEMENTS.iter().filter(|(_, k)| k.class == Class::Obeyed).map(|(name, _)| *name);
    let hint = did_you_mean(key, read);
    let named = key.replacen(':', " ", 1);
    if !hint.is_empty() {
        return Err(tree.error(object, format!("FEBio has no {named}{}", hint.replacen(':', " ", 1))));
    }
    Ok(format!("{named} is passed over: FEBio 4 has no such element of solids"))
}
