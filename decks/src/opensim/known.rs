//! Every element of an OpenSim model and what becomes of it: read, without effect, told, or refused.

use crate::elements::{Program, Table};
use crate::known::Known;
use std::collections::BTreeMap;
use std::sync::LazyLock;

const OPENSIM: Program = Program {
    name: "OpenSim",
    unknown: "OpenSim 4.6 and JAM have no such element",
    part: "property",
    parts_hold_elements: true,
    elsewhere: None,
};

/// The table, a line an element.
pub(super) static TABLE: LazyLock<Table> = LazyLock::new(|| Table::new(OPENSIM, include_str!("elements.txt")));

/// The classes of OpenSim 4.6, and those of JAM.
pub fn elements() -> &'static BTreeMap<&'static str, Known> {
    &TABLE.rows
}
