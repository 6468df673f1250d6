//! What an answer is held against: the threshold of a name, fields of no name beside it and in its place. Any fit may be asked as if it were one.

use crate::discrepancy::{Discrepancy, discrepancy};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::report::Against;
use crate::report::verdict::{Candidature, against, temper};
use crate::search::{Search, Searcher};

/// Whether an effect's evidence, as loud as the data may speak, passes the threshold.
pub(crate) fn is_believed(searcher: &Searcher, search: &Search, best: &Fit) -> bool {
    searcher.gain(best, &search.base) >= search.threshold * temper(searcher, best)
}

/// A field of no name in the place of an answer and its log Bayes factor against nothing missing: linear about nothing missing, or about the rests of the
/// answer with its effects taken out, whichever explains more. A field that moves the knee far is seen as it is from the latter alone. The former is told
/// against nothing missing in the same linear terms, since that fit's own evidence may lie nats off them; the latter can only be told against it. The rests
/// of a knee with a torn structure are those of that knee, whatever is taken out on a straight line: there the former alone is a field in the name's place.
pub(crate) fn in_place(searcher: &Searcher, search: &Search, best: &Fit) -> Result<(Discrepancy, f64), DiagnosisError> {
    let data = (&search.readings, &search.covariance);
    let far = discrepancy(searcher.problem, data, &search.base)?;
    if best.has_most_of_a_whole() {
        let gain = far.log_bayes_factor;
        return Ok((far, gain));
    }
    let near = discrepancy(searcher.problem, data, &searcher.stripped(best, &search.readings))?;
    let gains = [far.log_bayes_factor, near.log_evidence - search.base.log_evidence];
    Ok(if gains[1] > gains[0] { (near, gains[1]) } else { (far, gains[0]) })
}

/// How many effects the data could name.
pub(crate) fn nameable(problem: &Problem) -> usize {
    let mut ids: Vec<String> = problem.candidates().into_iter().map(|c| c.effect.id).collect();
    ids.dedup();
    ids.len()
}

/// What stands against a fit of a search, asked as if it were the answer: it closes a share of the gap on held-out trials, and two trials exchanged
/// have so high a log Bayes factor. Nothing where it might be named.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn as_the_answer(
    searcher: &Searcher,
    search: &Search,
    fit: &Fit,
    (closes, exchanged): (f64, f64),
) -> Result<Vec<Against>, DiagnosisError> {
    if !is_believed(searcher, search, fit) {
        return Ok(vec![Against::EarnsTooLittle]);
    }
    let field = discrepancy(searcher.problem, (&search.readings, &search.covariance), fit)?;
    let (_, alone) = in_place(searcher, search, fit)?;
    let of = Candidature {
        believed: fit,
        base: &search.base,
        is_named: true,
        field: field.log_bayes_factor,
        alone,
        names: nameable(searcher.problem),
        exchanged,
        // what it gains there decides how sure a name is, not whether there is one
        gain: 0.0,
        closes,
        has_kin: false,
    };
    Ok(against(searcher, &of))
}
