//! The usual tests by their loads, and which of them a load makes.

use super::Test;
use crate::coordinate::{AP, Coordinate, IE, Load, VV};

/// The largest loads of the usual tests: VV, IE [N m], AP [N]; 10, 5 and 133 in the paper's protocols [andreassen2025, section 2.6].
pub(super) const USUAL_LOADS: [(Coordinate, f64, Test, Test); 3] = [
    (VV, 10.0, Test::Varus, Test::Valgus),
    (IE, 5.0, Test::Internal, Test::External),
    (AP, 133.0, Test::Posterior, Test::Anterior),
];
/// Share of its usual size below which a load counts as none.
const NO_LOAD: f64 = 0.05;

/// The test that loads make: by the load that is largest beside its usual size.
pub(super) fn test_of(loads: &Load) -> Test {
    let share = |(i, usual, minus, plus): &(Coordinate, f64, Test, Test)| {
        (loads[*i].abs() / usual, if loads[*i] < 0.0 { *minus } else { *plus })
    };
    let most = USUAL_LOADS.iter().map(share).max_by(|a, b| a.0.total_cmp(&b.0));
    most.filter(|(share, _)| *share >= NO_LOAD).map_or(Test::Neutral, |(_, test)| test)
}
