//! What a file states beside its readings, and what its tests lack: noise, the quadriceps' tension, a tested coordinate that nobody read.

use super::columns::{QUADRICEPS_COLUMN, sd_column};
use super::motion::tests;
use super::{LaxityTrial, SignDoubt};
use crate::coordinate::{AP, Coordinate, FREE, Free, IE, VV};
use notices::plain;

/// Less is the noise of no instrument [deg] or [mm]: robots repeat to 0.02. Ours.
const LEAST_SD: f64 = 0.005;
/// More tells nothing of a knee: VV, IE [deg], ML, AP, SI [mm]. Ours: half of what each moves in a loose knee's tests; arthrometers on living
/// knees scatter by 2 mm.
const MOST_SD: Free<f64> = Free([8.0, 15.0, 6.0, 8.0, 6.0]);
/// Less tension pulls nothing [N]: rigs hold 50 and more. Ours.
const LEAST_QUADRICEPS_N: f64 = 5.0;
/// Trials of a coordinate's tests from which on one of them should have read it.
const LEAST_TRIALS: usize = 2;

/// Doubts about what is stated.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let noise = FREE.into_iter().filter_map(|c| noise(trials, c));
    let unread = [VV, IE, AP].into_iter().filter_map(|c| unread(trials, c));
    noise.chain(unread).chain(quadriceps(trials)).collect()
}

/// Noise that no instrument has, or beside which readings say nothing.
fn noise(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let usual = LEAST_SD..=MOST_SD[c];
    let odd = |t: &&LaxityTrial| t.sd[c].is_some_and(|sd| !usual.contains(&sd));
    let found: Vec<&LaxityTrial> = trials.iter().filter(odd).collect();
    let first = found.first()?;
    let unit = c.unit();
    Some(SignDoubt {
        column: sd_column(c),
        words: format!(
            "{} is {} {unit} in {} trials, the first \"{}\". Expected {LEAST_SD} to {} {unit}: is its unit another (m, cm, rad), or is it no standard deviation? A reading counts by its noise, so that one alone may decide, or none",
            sd_column(c),
            plain(first.sd[c]?),
            found.len(),
            first.trial,
            MOST_SD[c]
        ),
    })
}

/// Tests that load a coordinate and never read it, though they read others.
fn unread(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let own = tests(trials, c);
    let lost = own.iter().all(|t| t.measured[c].is_none());
    let others = own.iter().any(|t| t.measured.iter().any(Option::is_some));
    (own.len() >= LEAST_TRIALS && lost && others).then(|| SignDoubt {
        column: c.column(),
        words: format!(
            "{} is empty in all {} trials whose tests load it: was the column lost? These trials tell little of the knee without it",
            c.column(),
            own.len()
        ),
    })
}

/// A tension that is not 0 and pulls nothing.
fn quadriceps(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let most = trials.iter().map(|t| t.quadriceps_n).fold(0.0, f64::max);
    (most > 0.0 && most < LEAST_QUADRICEPS_N).then(|| SignDoubt {
        column: QUADRICEPS_COLUMN.into(),
        words: format!(
            "{QUADRICEPS_COLUMN} is at most {} N and not 0. Expected 0, or the tendon's tension, 50 N and more: is its unit another (kN)? Declare the unit by [laxity_format.NAME.columns]",
            plain(most)
        ),
    })
}

#[cfg(test)]
mod tests_of_doubts {
    use super::*;
    use crate::coordinate::Load;
    use crate::laxity::Test;

    fn drawer(k: usize) -> LaxityTrial {
        let mut load = Load::default();
        load[AP] = 100.0;
        let mut trial = LaxityTrial::asked(format!("a{k}"), Test::Anterior, 30.0, load);
        trial.measured[AP] = Some(4.0);
        trial.measured[VV] = Some(0.5);
        trial
    }

    fn columns(trials: &[LaxityTrial]) -> Vec<String> {
        doubts(trials).into_iter().map(|d| d.column).collect()
    }

    #[test]
    fn noise_tension_and_a_lost_column_are_told_and_usual_ones_are_not() {
        let good: Vec<LaxityTrial> = (0..4).map(drawer).collect();
        let with = |edit: &dyn Fn(&mut LaxityTrial)| {
            let mut all = good.clone();
            all.iter_mut().for_each(edit);
            columns(&all)
        };
        assert!(columns(&good).is_empty());
        assert!(with(&|t| (t.sd[AP], t.quadriceps_n) = (Some(0.4), 200.0)).is_empty());
        for sd in [0.0005, 40.0] {
            assert_eq!(with(&|t| t.sd[AP] = Some(sd)), ["sd_ap_mm"]);
        }
        assert_eq!(with(&|t| t.quadriceps_n = 0.4), [QUADRICEPS_COLUMN]);
        assert_eq!(with(&|t| t.measured[AP] = None), ["ap_mm"]);
        // trials that are asked have read nothing
        assert!(with(&|t| t.measured = Free::all(None)).is_empty());
    }
}
