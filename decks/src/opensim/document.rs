//! What only OpenSim's files have: the model's element, and frames as a displacement and a turn.

use crate::DeckError;
use crate::tree::{Tree, child};
use meshes::{Isometry, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use roxmltree::Node;

/// Oldest version of the file format that is read: that of OpenSim 4.0.
const OLDEST_VERSION: u64 = 40_000;

impl<'a> Tree<'a> {
    /// The model's element.
    ///
    /// Errors: another kind of file, or one older than OpenSim 4.
    pub(super) fn model(&self) -> Result<Node<'_, 'a>, DeckError> {
        let root = self.root();
        if root.tag_name().name() != "OpenSimDocument" {
            let what = format!("the file is a <{}>; expected an <OpenSimDocument>", root.tag_name().name());
            return Err(self.error(root, what));
        }
        let version = root.attribute("Version").and_then(|v| v.trim().parse::<u64>().ok());
        if version.is_none_or(|v| v < OLDEST_VERSION) {
            let what = format!(
                "the format is of version {}; expected {OLDEST_VERSION} or later: open the model in OpenSim 4 and save it",
                root.attribute("Version").unwrap_or("none")
            );
            return Err(self.error(root, what));
        }
        child(root, "Model").ok_or_else(|| self.error(root, "there is no <Model>; expected an OpenSim model"))
    }

    /// A displacement and a turn, the frame-fixed x-y-z angles of OpenSim, as a motion in mm.
    pub(super) fn motion(&self, node: Node<'_, '_>, shift: &str, turn: &str) -> Result<Isometry, DeckError> {
        let shift = Vector::from(self.numbers(node, shift, [0.0; 3])?) * super::MM_PER_M;
        let [x, y, z] = self.numbers(node, turn, [0.0; 3])?;
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        let turn = about(Vector::x_axis(), x) * about(Vector::y_axis(), y) * about(Vector::z_axis(), z);
        Ok(Isometry::from_parts(Translation3::from(shift), turn))
    }
}
