//! What section 3 of the paper states in words, beside what models say.

use super::drawers;
use crate::parameters::{KINDS, mean, mean_difference, numbered};
use crate::published;
use crate::validate::{Difference, Source};
use calibration::design::Design;
use sim::coordinate::{FREE, Free};
use sim::laxity::Test;

/// Section 3.1, counted from the printed Table 4: statement, the paper's number, ours.
pub fn parameters() -> Vec<[String; 3]> {
    let columns = [("S192803", "kla"), ("S192803", "rks"), ("S193761", "kla"), ("S193761", "rks")];
    let sets: Vec<_> = columns
        .iter()
        .filter_map(|(knee, data)| Some((*knee, *data, numbered(published::parameters(knee, data)?))))
        .collect();
    let means: Vec<(u32, f64)> = (1..=26)
        .filter_map(|n| {
            let values: Vec<f64> =
                sets.iter().filter_map(|(_, _, v)| v.iter().find(|(m, _)| *m == n).map(|(_, x)| *x)).collect();
            mean(&values).map(|m| (n, m))
        })
        .collect();
    let name = |n: u32| Design::table3().variables.iter().find(|v| v.number == n).map_or(String::new(), |v| v.bundle());
    let mut out = Vec::new();
    let ends =
        [("strain", 1..=14, "0.85, dMCL", "1.17, PCAP_M", 2), ("stiffness", 15..=26, "51.9, PFL", "138.9, dMCL", 1)];
    for (kind, numbers, low, high, digits) in ends {
        let of = means.iter().filter(|(n, _)| numbers.contains(n));
        let least = of.clone().min_by(|a, b| a.1.total_cmp(&b.1));
        let most = of.max_by(|a, b| a.1.total_cmp(&b.1));
        for (which, paper, found) in [("smallest", low, least), ("largest", high, most)] {
            let ours = found.map_or("-".into(), |(n, x)| format!("{x:.digits$}, {}", name(*n)));
            out.push([format!("{which} mean {kind}"), paper.to_owned(), ours]);
        }
    }
    let figures = [["4.6", "12.3"], ["14.3", "55.8"]];
    for (kind, figure) in KINDS.into_iter().zip(figures) {
        for (between, what, paper) in [(false, "KLA from RKS", figure[0]), (true, "Specimen 1 from 2", figure[1])] {
            let ours = mean_difference(&sets, kind, between).map_or("-".into(), |d| format!("{d:.1}"));
            out.push([format!("mean difference of {}, {what} [%]", kind.name.replace('_', " ")), paper.into(), ours]);
        }
    }
    out
}

/// Sections 3.2 to 3.4 of one knee's models: statement, the paper's number, ours.
pub fn sentences(sources: &[Source], differences: &[Difference]) -> Vec<[String; 3]> {
    let mut out = Vec::new();
    let told = ["ap_laxity", "passive_flexion"];
    for d in differences.iter().filter(|d| d.published.is_some() && told.contains(&d.protocol.as_str())) {
        let unit = if d.unit == "n" { "N" } else { d.unit.as_str() };
        let what =
            format!("{}, {}, KLA against RKS [{}]", d.protocol.replace('_', " "), d.quantity.replace('_', " "), unit);
        out.push([what, format!("{:.2}", d.published.unwrap_or(f64::NAN)), format!("{:.2}", d.rmsd)]);
    }
    let count = |yes: usize, of: usize| format!("{yes} of {of}");
    let anterior: Vec<_> = sources.iter().flat_map(drawers).filter(|(t, ..)| *t == Test::Anterior).collect();
    let first = anterior.iter().filter(|(_, _, row)| row.iter().all(|(f, _)| *f <= row[0].0)).count();
    out.push(["ACL the most loaded in anterior tests".into(), count(6, 6), count(first, anterior.len())]);
    let posterior: Vec<_> = sources.iter().flat_map(drawers).filter(|(t, ..)| *t == Test::Posterior).collect();
    let loaded = |g: usize| posterior.iter().filter(|(_, _, row)| row[g].0 > 0.0).count();
    let theirs = |g: usize| posterior.iter().filter(|(_, _, row)| row[g].1 > 0.0).count();
    for (name, g) in [("POL", 5), ("PFL", 8), ("PCL", 7)] {
        out.push([format!("{name} loaded in posterior tests"), count(theirs(g), 6), count(loaded(g), posterior.len())]);
    }
    out.extend(pivot_shift(sources));
    out
}

/// Section 3.4.
fn pivot_shift(sources: &[Source]) -> Vec<[String; 3]> {
    let mut out = Vec::new();
    let [a, b] = sources else { return out };
    for (acl, word) in [(true, "intact"), (false, "without ACL")] {
        let known = |s: &Source| published::pivot_shift(&s.specimen, &s.name, acl).map(|p| p.pose().free());
        let ours = a.pivot_end(acl).zip(b.pivot_end(acl)).map(|(x, y)| (x.predicted(), y.predicted()));
        let theirs = known(a).zip(known(b));
        for (turns, what) in [(true, "rotation [deg]"), (false, "translation [mm]")] {
            let most = |x: Free<f64>, y: Free<f64>| {
                let of = FREE.into_iter().filter(|c| c.turns() == turns);
                of.map(|c| (x[c] - y[c]).abs()).fold(0.0, f64::max)
            };
            let paper = theirs.map_or("-".into(), |(x, y)| format!("{:.1}", most(x, y)));
            let found = ours.map_or("-".into(), |(x, y)| format!("{:.1}", most(x, y)));
            out.push([format!("pivot shift {word}, largest difference in {what}"), paper, found]);
        }
    }
    for s in sources {
        let ends = [true, false].map(|acl| s.pivot_end(acl));
        let known = [true, false].map(|acl| published::pivot_shift(&s.specimen, &s.name, acl));
        let ([Some(i), Some(n)], [Some(p), Some(q)]) = (ends, known) else { continue };
        let force = |r: &published::PivotShift| r.forces_n.get("ALS").copied().unwrap_or(0.0);
        for (what, theirs, ours) in [
            ("anterior translation [mm]", q.pose().ap_mm - p.pose().ap_mm, n.pose.ap_mm - i.pose.ap_mm),
            ("valgus [deg]", q.pose().vv_deg - p.pose().vv_deg, n.pose.vv_deg - i.pose.vv_deg),
            ("ALS force [N]", force(q) - force(p), s.groups(n)[1] - s.groups(i)[1]),
        ] {
            out.push([format!("{}: without ACL more {what}", s.name), format!("{theirs:+.1}"), format!("{ours:+.1}")]);
        }
        let collateral = |f: [f64; 9]| f[2] + f[3] + f[4];
        let paper: f64 = ["LCL", "sMCL", "dMCL"].iter().filter_map(|g| p.forces_n.get(*g)).sum();
        out.push([
            format!("{}: LCL and MCL together, intact [N]", s.name),
            format!("{paper:.1}"),
            format!("{:.1}", collateral(s.groups(i))),
        ]);
    }
    out
}
