//! Ligaments as lines between the bones, and the bundles that lines of one law make.

use meshes::Point;
use sim::spec::{BundleSpec, FibreSpec, Law};
use std::collections::{BTreeMap, BTreeSet};

/// Fibres whose laws differ by less than this share, or so many mm, are of one bundle: numbers are written so that they come back.
const SAME: f64 = 1e-9;
/// Ligaments whose name goes on without a line: `ACLam1` becomes `ACL_am1`, so that `--without ACL` cuts it.
const LIGAMENTS: [&str; 5] = ["ACL", "PCL", "MCL", "LCL", "PFL"];

/// A ligament as a line between the bones.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) femur: Point,
    pub(crate) tibia: Point,
    /// Length of its path, and that at which it begins to pull [mm].
    pub(crate) length: f64,
    pub(crate) slack: f64,
    pub(crate) stiffness: f64,
    pub(crate) toe_strain: f64,
    pub(crate) damping: f64,
    pub(crate) law: Law,
    /// Of a law of lines between points: the multiple of the toe from which the force stays.
    pub(crate) end: Option<f64>,
}

impl Line {
    /// Stretch, toe, stiffness, damping and the points' end [mm, N/mm, N s/mm, -]: what the fibres of a bundle share beside their law.
    fn numbers(&self) -> [f64; 5] {
        let end = self.end.unwrap_or(0.0);
        [self.length - self.slack, self.toe_strain * self.slack, self.stiffness, self.damping, end]
    }
}

/// A name as columns and options can hold it.
pub(crate) fn bundle_name(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    let whole = |l: &&&str| plain.strip_prefix(**l).is_some_and(|r| !r.is_empty() && !r.starts_with('_'));
    match LIGAMENTS.iter().find(whole) {
        Some(ligament) => format!("{ligament}_{}", &plain[ligament.len()..]),
        None if plain.is_empty() => "ligament".to_owned(),
        None => plain,
    }
}

/// What lines make: bundles, fibres, and the ends of those laws that are lines between points.
#[derive(Default)]
pub(crate) struct Bundles {
    pub(crate) bundles: Vec<BundleSpec>,
    pub(crate) fibres: Vec<FibreSpec>,
    pub(crate) ends: BTreeMap<String, f64>,
}

/// Bundles of the fibres: those of one name but for a number are one bundle where all have one law, else each is a bundle.
pub(crate) fn bundles(lines: Vec<Line>) -> Bundles {
    let stem = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches('_').to_owned();
    let mut groups: Vec<(String, Vec<Line>)> = Vec::new();
    for line in lines {
        let own = stem(&line.name);
        let place = groups.iter().position(|(name, _)| *name == own && !own.is_empty());
        match place {
            Some(k) => groups[k].1.push(line),
            None => groups.push((own, vec![line])),
        }
    }
    let taken: BTreeSet<String> = groups.iter().flat_map(|(_, l)| l).map(|l| l.name.clone()).collect();
    let mut out = Bundles::default();
    for (name, group) in groups {
        let (law, first) = (group[0].law, group[0].numbers());
        let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * b.abs().max(1.0);
        let same = |l: &Line| l.law == law && l.numbers().iter().zip(&first).all(near);
        // a fibre alone is of a bundle where its number stands apart, as in ALS_1
        let apart = |l: &Line| l.name.len() > name.len() && l.name[name.len()..].starts_with('_');
        let whole = group.len() > 1 || apart(&group[0]);
        let one = whole && group.iter().all(same) && !taken.contains(&name);
        let parts: Vec<(String, Vec<&Line>)> = match one {
            true => vec![(name, group.iter().collect())],
            false => group.iter().map(|l| (l.name.clone(), vec![l])).collect(),
        };
        for (name, of) in parts {
            let fibre = |l: &&Line| FibreSpec { bundle: name.clone(), femur: l.femur, tibia: l.tibia };
            out.fibres.extend(of.iter().map(fibre));
            out.ends.extend(of[0].end.map(|end| (name.clone(), end)));
            out.bundles.push(bundle(name, &of));
        }
    }
    out
}

/// A bundle of fibres of one law: the mean of their lengths stands for each.
fn bundle(name: String, of: &[&Line]) -> BundleSpec {
    let count = of.len() as f64;
    let [stretch, toe, stiffness, damping, _] = of[0].numbers();
    // one fibre keeps its own numbers to the last digit
    let slack = of.iter().map(|l| l.slack).sum::<f64>() / count;
    let length = if of.len() == 1 { of[0].length } else { slack + stretch };
    BundleSpec {
        name,
        reference_strain: length / slack,
        stiffness_n_per_mm: stiffness * count,
        reference_length_mm: length,
        toe_strain: toe / slack,
        law: of[0].law,
        damping_n_s_per_mm: damping,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_ligaments_are_parted_so_that_a_cut_finds_them() {
        for (given, wanted) in [
            ("ACLam1", "ACL_am1"),
            ("ACL_AM_1", "ACL_AM_1"),
            ("PCLal3", "PCL_al3"),
            ("ACL", "ACL"),
            ("sMCL_A_2", "sMCL_A_2"),
            ("PT 1,2", "PT_1_2"),
            ("", "ligament"),
        ] {
            assert_eq!(bundle_name(given), wanted, "{given}");
        }
    }
}
