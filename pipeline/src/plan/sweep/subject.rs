//! The test that a sweep is about: the drawer forwards, or what the ligament resists that is cut or put in.

use crate::plan::chances::asked_of;
use crate::plan::file::PlanFile;
use crate::plan::knee::main_coordinate;

/// A test by whose outcome plans are ranked, after that of every test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Subject {
    /// Its kind, as in plan.json.
    pub(super) kind: &'static str,
}

impl Subject {
    /// Of a plan: the first test that a ligament other than the ACL resists, where one is cut or put in.
    pub(super) fn of(plan: &PlanFile) -> Subject {
        Subject { kind: asked_of(plan).first().copied().unwrap_or("anterior drawer") }
    }

    /// The end of the names of its columns in sweep.csv.
    fn column(self) -> String {
        // the columns of the ACL's drawer were there first
        if self.kind == "anterior drawer" { "drawer".to_owned() } else { self.kind.replace(' ', "_") }
    }

    /// The column of the chance that it is like the intact knee at every flexion.
    pub(super) fn chance(self) -> String {
        format!("chance_{}", self.column())
    }

    /// The column of whether the most probable knee is.
    pub(super) fn restored(self) -> String {
        format!("restored_{}", self.column())
    }

    /// The column of how far off it is at most.
    pub(super) fn most_off(self) -> String {
        format!("{}_most_off_{}", self.kind.replace(' ', "_"), self.unit())
    }

    /// The unit of its coordinate.
    pub(super) fn unit(self) -> &'static str {
        main_coordinate(self.kind).unit()
    }

    /// Several of it, in words: "anterior drawers".
    pub(super) fn several(self) -> String {
        if self.kind.ends_with("drawer") { format!("{}s", self.kind) } else { format!("tests in {}", self.kind) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::file::{EXAMPLE, parsed};

    #[test]
    fn a_sweep_is_about_what_the_ligament_resists_that_is_cut() {
        let of = |cut: &str| Subject::of(&PlanFile { cut: vec![cut.into()], ..parsed(EXAMPLE).unwrap() });
        assert_eq!((of("ACL").kind, of("ACL").chance().as_str()), ("anterior drawer", "chance_drawer"));
        assert_eq!(
            (of("PCL").kind, of("PCL").most_off().as_str()),
            ("posterior drawer", "posterior_drawer_most_off_mm")
        );
        assert_eq!(
            (of("LCL").several().as_str(), of("LCL").most_off().as_str()),
            ("tests in varus", "varus_most_off_deg")
        );
    }
}
