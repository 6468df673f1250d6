//! The paper's section 3 beside what models answer: its tables cell by cell, its sentences, its forces at its own poses [andreassen2025].
//!
//! Text for a page; every cell reads "ours (the paper's)".

mod poses;
mod words;

pub use poses::{AtPose, at_published_poses, poses};
pub use words::{parameters, sentences};

use crate::published;
use crate::validate::Source;
use attachments::groups::GROUPS;
use sim::coordinate::{FREE, Free};
use sim::laxity::{Test, TrialResult};

/// Forces below this are "-" in Table 5 [N].
const LEAST_N: f64 = 5.0;
/// Axes of Table 6 after flexion.
const AXES: [&str; 5] = ["VV deg", "IE deg", "ML mm", "AP mm", "SI mm"];

/// How near the models of a knee come to the paper's.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// Root mean square over the 54 forces of Table 5 [N], by source.
    pub table5_n: Vec<(String, f64)>,
    /// Root mean square over Table 6 [deg, mm].
    pub table6: f64,
    /// Cells of Table 6 in which the change from intact to without ACL has the paper's direction, and all.
    pub directions: (usize, usize),
    /// Root mean square over Table 7 [N].
    pub table7_n: f64,
    /// ACL force of the intact pivot shift, ours less the paper's [N], by source.
    pub acl_n: Vec<(String, f64)>,
}

/// Root mean square; NaN of nothing.
pub(crate) fn rms(d: &[f64]) -> f64 {
    (d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64).sqrt()
}

/// Rows as a Markdown table.
pub(crate) fn grid(header: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rule = format!("|{}\n", "---|".repeat(header.len()));
    line(header) + &rule + &rows.iter().map(|r| line(r)).collect::<String>()
}

pub(crate) fn header(first: &[&str], then: impl Iterator<Item = String>) -> Vec<String> {
    first.iter().map(|s| (*s).to_owned()).chain(then).collect()
}

/// Forces of the paper's ligaments, the published beside.
fn pairs(ours: [f64; 9], theirs: &std::collections::BTreeMap<String, f64>) -> [(f64, f64); 9] {
    let known = GROUPS.map(|(g, _)| theirs.get(g).copied().unwrap_or(0.0));
    std::array::from_fn(|k| (ours[k], known[k]))
}

/// Ours and the paper's forces of a row of Table 5; below 5 N zero, as the paper has them.
fn drawer(s: &Source, test: Test, fe: f64) -> Option<[(f64, f64); 9]> {
    let theirs = published::ap_forces(&s.specimen, &s.name, test, fe)?;
    let ours = s.groups(s.ap_end(test, fe)?).map(|f| if f < LEAST_N { 0.0 } else { f });
    Some(pairs(ours, &theirs.forces_n))
}

/// Ours and the paper's pose of a row of Table 6, without flexion.
fn pose(s: &Source, acl: bool) -> Option<Free<(f64, f64)>> {
    let theirs = published::pivot_shift(&s.specimen, &s.name, acl)?.pose().free();
    let ours = s.pivot_end(acl)?.predicted();
    Some(Free::from_fn(|c| (ours[c], theirs[c])))
}

/// Ours and the paper's forces of a row of Table 7.
fn pivot(s: &Source, acl: bool) -> Option<[(f64, f64); 9]> {
    let theirs = published::pivot_shift(&s.specimen, &s.name, acl)?;
    Some(pairs(s.groups(s.pivot_end(acl)?), &theirs.forces_n))
}

/// A row of Table 5: test, flexion, ours and the paper's forces.
type Drawer = (Test, f64, [(f64, f64); 9]);

/// All rows of Table 5 that a source has.
pub(crate) fn drawers(s: &Source) -> Vec<Drawer> {
    let mut out = Vec::new();
    for test in [Test::Anterior, Test::Posterior] {
        for fe in s.ap_flexions() {
            out.extend(drawer(s, test, fe).map(|row| (test, fe, row)));
        }
    }
    out
}

/// How near these sources come.
pub fn scores(sources: &[Source]) -> Scores {
    let miss = |pairs: &[(f64, f64)]| pairs.iter().map(|(a, b)| a - b).collect::<Vec<_>>();
    let table5_n = sources.iter().map(|s| {
        let all: Vec<f64> = drawers(s).iter().flat_map(|(_, _, row)| miss(row)).collect();
        (s.name.clone(), rms(&all))
    });
    let (mut six, mut seven, mut acl_n, mut directions) = (vec![], vec![], vec![], (0, 0));
    for s in sources {
        for acl in [true, false] {
            six.extend(pose(s, acl).iter().flat_map(|p| miss(&p.0)));
            seven.extend(pivot(s, acl).iter().flat_map(|p| miss(p)));
        }
        acl_n.extend(pivot(s, true).map(|p| (s.name.clone(), p[0].0 - p[0].1)));
        if let (Some(a), Some(b)) = (pose(s, true), pose(s, false)) {
            let same = FREE.into_iter().filter(|&c| (b[c].0 - a[c].0) * (b[c].1 - a[c].1) > 0.0).count();
            directions = (directions.0 + same, directions.1 + 5);
        }
    }
    Scores { table5_n: table5_n.collect(), table6: rms(&six), directions, table7_n: rms(&seven), acl_n }
}

/// A cell of forces: ours and the paper's; "-" for both below 5 N.
fn cell((ours, theirs): (f64, f64)) -> String {
    let one = |f: f64| if f < LEAST_N { "-".to_owned() } else { format!("{f:.0}") };
    if ours < LEAST_N && theirs < LEAST_N { "-".into() } else { format!("{} ({})", one(ours), one(theirs)) }
}

/// Table 5, ours (the paper's) [N].
pub fn table5(sources: &[Source]) -> String {
    let mut rows = Vec::new();
    for s in sources {
        for (test, fe, row) in drawers(s) {
            let begin = [s.name.clone(), test.name().to_owned(), format!("{fe:.1}")];
            rows.push(begin.into_iter().chain(row.map(cell)).collect());
        }
    }
    grid(&header(&["model", "load", "flexion deg"], GROUPS.iter().map(|(g, _)| (*g).to_owned())), &rows)
}

/// Table 6, ours (the paper's).
pub fn table6(sources: &[Source]) -> String {
    let mut rows = Vec::new();
    for acl in [true, false] {
        for s in sources {
            let Some(p) = pose(s, acl) else { continue };
            let told = s.pivot_end(acl).is_some_and(Source::is_dislocated);
            let theirs = published::pivot_shift(&s.specimen, &s.name, acl).is_some_and(|p| p.dislocated);
            let word = |d: bool| if d { "yes" } else { "no" };
            let mut row = vec![s.name.clone(), if acl { "intact" } else { "none" }.to_owned()];
            row.extend(p.map(|(a, b)| format!("{a:.1} ({b:.1})")));
            row.push(format!("{} ({})", word(told), word(theirs)));
            rows.push(row);
        }
    }
    let axes = AXES.iter().map(|a| (*a).to_owned()).chain(["dislocated".to_owned()]);
    grid(&header(&["model", "ACL"], axes), &rows)
}

/// Table 7, ours (the paper's) [N].
pub fn table7(sources: &[Source]) -> String {
    let mut rows = Vec::new();
    for acl in [true, false] {
        for s in sources {
            let Some(p) = pivot(s, acl) else { continue };
            let mut row = vec![s.name.clone(), if acl { "intact" } else { "none" }.to_owned()];
            row.extend(p.map(cell));
            rows.push(row);
        }
    }
    grid(&header(&["model", "ACL"], GROUPS.iter().map(|(g, _)| (*g).to_owned())), &rows)
}

/// Figures 7 and 8 as numbers: AP under both loads, passive flexion.
pub fn curves(sources: &[Source]) -> String {
    let mut rows = Vec::new();
    for test in [Test::Anterior, Test::Posterior] {
        for s in sources {
            let ap: Vec<String> = s
                .ap_flexions()
                .iter()
                .map(|fe| s.ap_end(test, *fe).map_or("-".into(), |r| format!("{:.1}", r.pose.ap_mm)))
                .collect();
            rows.push([s.name.clone(), test.name().to_owned()].into_iter().chain(ap).collect());
        }
    }
    let flexions = sources.first().map(Source::ap_flexions).unwrap_or_default();
    let mut text = "Figure 7, AP position [mm] under 133 N:\n\n".to_owned();
    text += &grid(&header(&["model", "load"], flexions.iter().map(|f| format!("{f:.1} deg"))), &rows);
    let mut rows = Vec::new();
    for s in sources {
        let is_told = |r: &&TrialResult| {
            Source::has_answer(r) && (r.pose.fe_deg / 30.0 - (r.pose.fe_deg / 30.0).round()).abs() < 0.02
        };
        for r in s.passive_flexion.iter().filter(is_told) {
            let p = r.pose;
            let values = [p.ap_mm, p.ie_deg, p.vv_deg].map(|x| format!("{x:.1}"));
            rows.push([s.name.clone(), format!("{:.0}", p.fe_deg.abs())].into_iter().chain(values).collect());
        }
    }
    text += "\nFigure 8, passive flexion:\n\n";
    text + &grid(&header(&["model", "flexion deg", "AP mm", "IE deg", "VV deg"], std::iter::empty()), &rows)
}
