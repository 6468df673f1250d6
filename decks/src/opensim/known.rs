//! Every element of an OpenSim model and what becomes of it: read, without effect, told, or refused.

use crate::DeckError;
use crate::known::{Class, Counted, Known, rows};
use crate::tree::{Tree, name_of, shown};
use notices::Notice;
use roxmltree::Node;
use sim::names::did_you_mean;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// The table, a line an element.
const TABLE: &str = include_str!("elements.txt");

static ELEMENTS: LazyLock<BTreeMap<&'static str, Known>> = LazyLock::new(|| rows(TABLE, ' '));

/// The classes of OpenSim 4.6, and those of JAM.
pub fn elements() -> &'static BTreeMap<&'static str, Known> {
    &ELEMENTS
}

/// The objects of a model that are read, in the order of the file, and what is told of the others.
pub(super) struct Judged<'a, 'i> {
    pub(super) objects: Vec<Node<'a, 'i>>,
    pub(super) told: Vec<Notice>,
}

/// Holds every element of a model against the table.
///
/// # Errors
/// An element that is refused, or one that OpenSim does not have and that resembles one that is read.
pub(super) fn judge<'a, 'i>(tree: &Tree<'_>, model: Node<'a, 'i>) -> Result<Judged<'a, 'i>, DeckError> {
    let mut told = Counted::default();
    let mut objects = Vec::new();
    let mut open = vec![model];
    while let Some(object) = open.pop() {
        let Some(known) = ELEMENTS.get(object.tag_name().name()) else {
            told.tell(tree, object, unknown(tree, object)?);
            continue;
        };
        match known.class {
            Class::Refused => return Err(tree.error(object, format!("is not read: it {}", known.why))),
            Class::Told => {
                told.tell(tree, object, format!("{} is passed over: {}", object.tag_name().name(), known.why));
            }
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

/// The objects within an object: those of its properties, and those that stand in it by their class.
fn inner<'a, 'i>(
    tree: &Tree<'_>,
    object: Node<'a, 'i>,
    known: &Known,
    told: &mut Counted,
) -> Result<Vec<Node<'a, 'i>>, DeckError> {
    let mut found = Vec::new();
    let class = object.tag_name().name();
    for part in object.children().filter(Node::is_element) {
        let name = part.tag_name().name();
        if known.parts.contains(&name) {
            found.extend(part.children().filter(Node::is_element));
        } else if ELEMENTS.contains_key(name) {
            found.push(part);
        } else {
            let read = known.parts.iter().copied();
            let hint = did_you_mean(name, read);
            if !hint.is_empty() {
                return Err(tree.error(part, format!("{} has no such property{hint}", shown(object))));
            }
            told.tell(tree, part, format!("{class}: the property {name} is passed over"));
        }
    }
    Ok(found)
}

/// What is said of an element that OpenSim does not have.
fn unknown(tree: &Tree<'_>, object: Node<'_, '_>) -> Result<String, DeckError> {
    let name = object.tag_name().name();
    let read = ELEMENTS.iter().filter(|(_, k)| k.class == Class::Obeyed).map(|(name, _)| *name);
    let hint = did_you_mean(name, read);
    if !hint.is_empty() && !name_of(object).is_empty() {
        return Err(tree.error(object, format!("OpenSim has no such element{hint}")));
    }
    Ok(format!("{name} is passed over: OpenSim 4.6 and JAM have no such element"))
}
