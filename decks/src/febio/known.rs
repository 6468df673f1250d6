//! Every element of a FEBio file and what becomes of it: read, without effect, told, or refused.
//!
//! A row's name is that of the element, with its type behind a colon where FEBio parts the element by types: `contact:sliding-elastic`. The parts of an
//! obeyed one are its parameters, and its attributes with an `@`.

use crate::elements::{Program, Table};
use crate::known::Known;
use roxmltree::Node;
use std::collections::BTreeMap;
use std::sync::LazyLock;

const FEBIO: Program = Program {
    name: "FEBio",
    unknown: "FEBio 4 has no such element of solids",
    part: "parameter",
    parts_hold_elements: false,
    elsewhere: Some((
        "from",
        "stands in another file (from=\"{}\"): import {} in place of this one, if it has the whole knee as model.feb of export has; else save the model as one file by FEBio Studio",
    )),
};

/// The table, a line an element.
pub(super) static TABLE: LazyLock<Table> = LazyLock::new(|| Table::new(FEBIO, include_str!("elements.txt")));

/// The elements of FEBio 2.5 to 4.0 that a file of solids may hold.
pub fn elements() -> &'static BTreeMap<&'static str, Known> {
    &TABLE.rows
}

/// The name of an element in the table.
pub(super) fn key(node: Node<'_, '_>) -> String {
    TABLE.key(node)
}
