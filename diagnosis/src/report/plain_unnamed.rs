//! What `unnamed` means, in plain words: whether the data agree with each other, which rows do not, and that no effect of the catalogue is enough.

mod agreement;
mod nearest;
mod noise;
mod rows;
mod tried;

use crate::criteria::{TEMPER, told_apart};
use crate::report::{Against, Diagnosis};
use agreement::agreement;
use nearest::best_row;
use rows::to_repeat;
use tried::best;

pub(crate) use nearest::{closing, closing_most, leaves_most};
pub(crate) use noise::noise;
pub(crate) use rows::{contradictions, contradictions_beside};
pub use rows::{load, row};
pub use tried::did_not_converge;

/// What `unnamed` means: first that, then what to do, then what it rests on.
pub(crate) fn meaning(d: &Diagnosis) -> String {
    let missing = if is_between(d) {
        "Something is missing from the model: what comes nearest below, or something that no effect of the catalogue explains. These data do not tell which."
    } else {
        "Something is missing from the model that no effect of the catalogue explains."
    };
    let Some(why) = &d.unexplained else { return missing.into() };
    let agreement = agreement(&why.data_sets, why.two_knees);
    let first = if agreement.is_empty() { missing.into() } else { agreement };
    first + &to_repeat(&d.contradictions) + &contradictions(&d.contradictions) + &best(why, d.misfit[0])
}

/// Whether the best that was found and a field of no name in its place are not told apart, and nothing else stands against it. The field may be the likelier
/// of the two, so there is no name; but it does not exclude one that earns as much to within the odds that tell answers apart.
fn is_between(d: &Diagnosis) -> bool {
    let alone_against = best_row(d).is_some_and(|t| t.against == [Against::FieldInItsPlace]);
    let ahead = d.wildcard_alone.zip(d.best_log_bayes_factor).map(|(field, name)| field - name);
    alone_against && ahead.is_some_and(|nats| nats < told_apart() * TEMPER)
}
