//! Tables and curves of forces held against the ligament laws: every law is sampled, none is written here.

/// Least multiple of the toe at which a law of points may end [-]: its last but one lies at 4 ([`sim::ligament`]).
pub(crate) const LEAST_END: f64 = 4.001;

/// Points on the lines that join the rows of a table: the ends of so many equal parts of each line.
pub(crate) fn between(rows: &[[f64; 2]], parts: usize) -> impl Iterator<Item = [f64; 2]> {
    rows.windows(2).flat_map(move |pair| {
        (0..=parts).map(move |k| {
            let share = k as f64 / parts as f64;
            [0, 1].map(|c| pair[0][c] + (pair[1][c] - pair[0][c]) * share)
        })
    })
}
