//! Rows between which a knee jumps: an equilibrium that ends, or a patella that lets go.

use crate::coordinate::{FREE, Free};
use crate::flag::Flag;
use crate::laxity::{Imposed, TrialResult};

/// Motion beyond which a knee jumps, by a degree of flexion: VV, IE [deg], ML, AP, SI [mm]. Ours: a knee that flexes turns by 1 deg and rolls by 1 mm.
const JUMP: Free<f64> = Free([5.0, 5.0, 3.0, 3.0, 3.0]);
/// Rows further apart in flexion show no jump [deg]; ours.
const BESIDE_DEG: f64 = 2.0;

/// Flags rows next to each other in flexion, under the same loads, between which the knee jumps. A row has no answer where its numbers are none.
pub fn flag_jumps(rows: &mut [TrialResult]) {
    let mut order: Vec<usize> =
        (0..rows.len()).filter(|&k| rows[k].predicted().iter().all(|x| x.is_finite())).collect();
    order.sort_by(|&a, &b| rows[a].pose.fe_deg.total_cmp(&rows[b].pose.fe_deg));
    let mut found = Vec::new();
    for (n, &a) in order.iter().enumerate() {
        let loads = Imposed { fe_deg: 0.0, ..rows[a].trial.imposed() };
        let next = order[n + 1..].iter().copied().take_while(|&b| apart(rows, a, b) <= BESIDE_DEG);
        let alike =
            |b: &usize| apart(rows, a, *b) > 0.0 && Imposed { fe_deg: 0.0, ..rows[*b].trial.imposed() } == loads;
        if let Some(b) = next.filter(alike).min_by(|b, c| apart(rows, a, *b).total_cmp(&apart(rows, a, *c))) {
            let (before, after, by) = (rows[a].predicted(), rows[b].predicted(), apart(rows, a, b).max(1.0));
            let jumps = FREE.into_iter().any(|c| (after[c] - before[c]).abs() > JUMP[c] * by);
            found.extend(jumps.then_some([a, b]));
        }
    }
    for k in found.into_iter().flatten() {
        let flags = &mut rows[k].flags;
        flags.extend((!flags.contains(&Flag::Jumps)).then_some(Flag::Jumps));
    }
}

/// How far two rows lie apart in flexion [deg].
fn apart(rows: &[TrialResult], a: usize, b: usize) -> f64 {
    rows[b].pose.fe_deg - rows[a].pose.fe_deg
}
