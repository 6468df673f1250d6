//! `blind make`: cases, a folder each, their truths sealed beside them.

use super::MakeArgs;
use super::bench::BEFORE;
use super::copied::{knee, planned};
use super::drawn::{Asked, Drawn, drawn};
use super::hard::Hard;
use crate::error::BuildError;
use crate::{diagnose, model_file, store};
use blindbench::laboratory::{Case, Planned, cuts, every_kind, kinds};
use diagnosis::problem::trial::Source;
use sim::coordinate::Free;
use sim::laxity::{LaxityTrial, TrialResult, results_csv};
use std::collections::BTreeMap;
use std::path::Path;

/// Makes the cases that were asked for; gives the words to print.
pub(super) fn make(args: &MakeArgs) -> Result<String, BuildError> {
    let loaded = model_file::load(&args.model)?;
    let input = knee(&loaded)?;
    let (sources, _) = diagnose::sources(&args.like)?;
    let sources: Vec<Source> = sources.into_iter().map(|s| args.laboratory.plans(s)).collect();
    let hard = Hard::of(args);
    let plan: Vec<Planned> = sources.iter().flat_map(|s| s.trials.iter().map(|t| planned(&s.name, t))).collect();
    let kinds = match (&args.kind, args.cuts) {
        (Some(kind), _) => vec![kind.clone(); args.count as usize],
        (None, Some(of_each)) => cuts(of_each as usize),
        (None, None) if args.every_kind => every_kind(args.count as usize),
        (None, None) => kinds(args.count as usize),
    };
    let mut bench = Bench::new(args, &sources);
    for (k, kind) in kinds.iter().enumerate() {
        let name = format!("case_{:04}", k + 1);
        let seed = args.seed.wrapping_mul(1_000_003).wrapping_add(k as u64);
        let asked = Asked { name: &name, plan: &plan, kind: (kind, args.size), hard: &hard };
        match drawn((&loaded.spec, &input), &asked, seed)? {
            Ok(drawn) => bench.add(&name, kind, drawn)?,
            Err(reason) => bench.no_test.push(reason),
        }
    }
    bench.words()
}

/// A bench as it grows on disk.
struct Bench<'a> {
    args: &'a MakeArgs,
    sources: &'a [Source],
    seals: BTreeMap<String, String>,
    /// What is to be known of cut knees, a line each.
    of_cuts: Vec<String>,
    /// Why cases were not made.
    no_test: Vec<String>,
}

impl Bench<'_> {
    fn new<'a>(args: &'a MakeArgs, sources: &'a [Source]) -> Bench<'a> {
        Bench { args, sources, seals: BTreeMap::new(), of_cuts: vec![], no_test: vec![] }
    }

    /// Writes a case, and the bench with it: one that is stopped can be answered and scored as far as it came.
    fn add(&mut self, name: &str, kind: &str, drawn: Drawn) -> Result<(), BuildError> {
        let Drawn { mut case, first, apart } = drawn;
        let folder = self.args.out.join(name);
        let left_out = case.truth.out_of_joint.clone();
        write_readings(&folder, self.sources, (&case, &left_out), "")?;
        if let Some(first) = &first {
            write_readings(&folder, self.sources, (first, &[]), BEFORE)?;
        }
        if !left_out.is_empty() || apart > 0 {
            let all = case.readings.len();
            self.of_cuts.push(of_cut((name, kind), [left_out.len(), all], apart));
        }
        // rows of the signature are those of the trials that were read
        case.truth.signature = kept(&case.truth.signature, &left_out);
        let truth = serde_json::to_vec_pretty(&case.truth).map_err(|e| BuildError::File(e.to_string()))?;
        self.seals.insert(name.to_owned(), crate::record::hash(&truth));
        store::write(&self.args.out.join(format!("{name}.truth.json")), &truth)?;
        let names: Vec<&String> = self.sources.iter().map(|s| &s.name).collect();
        let mut manifest = serde_json::json!({"schema": "bench/1", "sources": names, "seals": self.seals});
        if self.args.before {
            manifest["before"] = true.into();
        }
        let text = serde_json::to_vec_pretty(&manifest).map_err(|e| BuildError::File(e.to_string()))?;
        store::write(&self.args.out.join("bench.json"), &text)
    }

    /// What was made, and what was not.
    fn words(&self) -> Result<String, BuildError> {
        if self.seals.is_empty() && !self.no_test.is_empty() {
            return Err(BuildError::File(self.no_test.join("\n")));
        }
        let mut out = format!("{} cases in {}\n", self.seals.len(), self.args.out.display());
        self.of_cuts.iter().chain(&self.no_test).for_each(|line| out += &format!("{line}\n"));
        Ok(out)
    }
}

/// How many trials of a cut knee were left out, and how many knees before it were no test.
fn of_cut((name, kind): (&str, &str), [out, all]: [usize; 2], apart: usize) -> String {
    format!(
        "{name} ({kind}): {out} of {all} trials left out, in which the knee lies out of its joint; knees before it that were no test: {apart}"
    )
}

/// Rows but for those at some places.
fn kept<T: Clone>(rows: &[T], without: &[usize]) -> Vec<T> {
    rows.iter().enumerate().filter(|(k, _)| !without.contains(k)).map(|(_, row)| row.clone()).collect()
}

/// Writes the readings of a case, a file a data set, without the trials at some places of the plan.
fn write_readings(
    folder: &Path,
    sources: &[Source],
    (case, without): (&Case, &[usize]),
    ending: &str,
) -> Result<(), BuildError> {
    let mut readings = case.readings.iter().enumerate();
    for source in sources {
        let all = source.trials.iter().zip(readings.by_ref());
        let read = all.filter(|(_, (k, _))| !without.contains(k));
        let results: Vec<TrialResult> = read.map(|(t, (_, r))| result(t, &Free(*r))).collect();
        store::write(&folder.join(format!("{}{ending}.csv", source.name)), results_csv(&[], &results).as_bytes())?;
    }
    Ok(())
}

/// A trial with another measurement.
fn result(t: &LaxityTrial, r: &Free<f64>) -> TrialResult {
    let pose = sim::spec::PoseSpec { fe_deg: t.fe_deg, ..Default::default() }.moved(r);
    TrialResult { trial: t.clone(), pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_at_some_places_are_left_out_and_the_others_keep_their_order() {
        assert_eq!(kept(&[5, 6, 7, 8], &[0, 2]), [6, 8]);
        assert_eq!(kept(&[5, 6], &[]), [5, 6]);
        let said = of_cut(("case_0002", "cut_ACL"), [4, 54], 1);
        assert!(
            said.starts_with("case_0002 (cut_ACL): 4 of 54 trials left out") && said.ends_with("no test: 1"),
            "{said}"
        );
    }
}
