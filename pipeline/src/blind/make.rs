//! `blind make`: cases, a folder each, their truths sealed beside them.

use super::MakeArgs;
use super::bench::BEFORE;
use super::copied::{knee, planned};
use super::drawn::{Asked, Drawn, drawn};
use super::hard::Hard;
use crate::error::BuildError;
use crate::{diagnose, model_file, store};
use blindbench::hidden::CUT;
use blindbench::knee::BundleInput;
use blindbench::laboratory::{Case, Planned, cuts, every_kind, kinds};
use diagnosis::problem::trial::Source;
use diagnosis::report::words::listed;
use sim::coordinate::Free;
use sim::laxity::{LaxityTrial, TrialResult, results_csv};
use sim::names::is_of;
use std::collections::BTreeMap;
use std::path::Path;

/// Makes the cases that were asked for; gives the words to print.
pub(super) fn make(args: &MakeArgs) -> Result<String, BuildError> {
    asked_well(args)?;
    let loaded = model_file::load(&args.model)?;
    let input = knee(&loaded)?;
    let (sources, _) = diagnose::sources(&args.like)?;
    if let Some(cut) = sources.iter().find(|s| s.trials.iter().any(|t| !t.without.is_empty())) {
        let words = format!(
            "--like {}: its knee was cut (column without); a protocol of a whole knee was expected, and --cuts cuts it",
            cut.name
        );
        return Err(BuildError::Usage(words));
    }
    let sources: Vec<Source> = sources.into_iter().map(|s| args.laboratory.plans(s)).collect();
    let hard = Hard::of(args);
    let plan: Vec<Planned> = sources.iter().flat_map(|s| s.trials.iter().map(|t| planned(&s.name, t))).collect();
    let kinds = match (&args.kind, args.cuts) {
        (Some(kind), _) => vec![kind.clone(); args.count as usize],
        (None, Some(of_each)) => cuts(of_each as usize),
        (None, None) if args.every_kind => every_kind(args.count as usize),
        (None, None) => kinds(args.count as usize),
    };
    if let Some(words) = lacking(&kinds, &input.bundles) {
        return Err(BuildError::of_file(&args.model, format!("{}: {words}", args.model.display())));
    }
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

/// Refuses a size that hides nothing, or more than all of a ligament, and data sets of one name.
fn asked_well(args: &MakeArgs) -> Result<(), BuildError> {
    let names: Vec<&String> = args.like.iter().map(|(name, _)| name).collect();
    if let Some((_, name)) = names.iter().enumerate().find(|(k, name)| names[..*k].contains(*name)) {
        return Err(BuildError::Usage(format!("--like {name} is given twice; names must differ")));
    }
    let size = args.size;
    if !size.is_finite() || size <= 0.0 {
        return Err(BuildError::Usage(format!("--size {size}: a number above 0 was expected, such as 0.5")));
    }
    if args.cuts.is_some() && size > 1.0 {
        return Err(BuildError::Usage(format!(
            "--size {size}: with --cuts it is the share that is lost; a number above 0 and up to 1 was expected, such as 0.5"
        )));
    }
    Ok(())
}

/// That ligaments are to be cut which the knee does not have, and which it has; none where it has all.
fn lacking(kinds: &[String], bundles: &[BundleInput]) -> Option<String> {
    let (has, lacks): (Vec<&str>, Vec<&str>) = CUT.into_iter().partition(|s| bundles.iter().any(|b| is_of(&b.name, s)));
    let is_asked = |s: &&str| kinds.iter().any(|kind| kind.strip_prefix("cut_") == Some(*s));
    let asked: Vec<&str> = lacks.into_iter().filter(is_asked).collect();
    if asked.is_empty() {
        return None;
    }
    let kinds: Vec<String> = has.iter().map(|s| format!("--kind cut_{s}")).collect();
    let instead = if kinds.is_empty() {
        "none of its ligaments can be".to_owned()
    } else {
        format!("cut another one by itself: {}", kinds.join(", "))
    };
    Some(format!("the knee has no bundle of {}, so it cannot be cut; {instead}", listed(&asked, "or")))
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
            self.of_cuts.push(of_cut((name, kind), &counts(self.sources, &left_out), apart));
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
        let cases = if self.seals.len() == 1 { "case" } else { "cases" };
        let mut out = format!("{} {cases} in {}\n", self.seals.len(), self.args.out.display());
        self.of_cuts.iter().chain(&self.no_test).for_each(|line| out += &format!("{line}\n"));
        Ok(out)
    }
}

/// Trials of each data set at some places of the plan, and how many there are.
fn counts<'a>(sources: &'a [Source], left_out: &[usize]) -> Vec<(&'a str, [usize; 2])> {
    let mut first = 0;
    let of = |source: &'a Source| {
        let all = source.trials.len();
        let own = first..first + all;
        first += all;
        (source.name.as_str(), [left_out.iter().filter(|&k| own.contains(k)).count(), all])
    };
    sources.iter().map(of).collect()
}

/// How many trials of each data set of a cut knee were left out, and how many knees before it were no test.
fn of_cut((name, kind): (&str, &str), counts: &[(&str, [usize; 2])], apart: usize) -> String {
    let [out, all] = [0, 1].map(|k| counts.iter().map(|(_, of)| of[k]).sum::<usize>());
    let each: Vec<String> = counts.iter().map(|(source, [out, all])| format!("{source} {out} of {all}")).collect();
    let lies = "in which the cut knee lies out of its joint";
    let before = match apart {
        0 => String::new(),
        1 => " One knee drawn before it lay so in half of a data set, and was no test.".to_owned(),
        _ => format!(" {apart} knees drawn before it lay so in half of a data set, and were no test."),
    };
    format!("{name} ({kind}): {out} of {all} trials left out, {lies} ({}).{before}", each.join(", "))
}

/// Rows but for those at some places.
pub(crate) fn kept<T: Clone>(rows: &[T], without: &[usize]) -> Vec<T> {
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
    }

    #[test]
    fn a_line_on_a_cut_knee_tells_each_data_set_that_lost_trials_and_knees_before_it_where_there_were_any() {
        let trials = |count: usize| -> Vec<LaxityTrial> {
            let trial = |k: usize| {
                LaxityTrial::asked(format!("t{k}"), sim::laxity::Test::Anterior, 30.0, sim::coordinate::Load::default())
            };
            (0..count).map(trial).collect()
        };
        let sources = [Source::new("kla", trials(30)), Source::new("rks", trials(24))];
        for (left_out, apart, expected) in [
            (vec![17, 29, 30], 0, ["3 of 54 trials left out, in which", "(kla 2 of 30, rks 1 of 24)."]),
            (
                vec![53],
                1,
                ["1 of 54 trials left out, in which", "(kla 0 of 30, rks 1 of 24). One knee drawn before it"],
            ),
            (vec![], 2, ["0 of 54 trials left out, in which", "(kla 0 of 30, rks 0 of 24). 2 knees drawn before it"]),
        ] {
            let said = of_cut(("case_0002", "cut_ACL"), &counts(&sources, &left_out), apart);
            assert!(said.starts_with("case_0002 (cut_ACL): ") && expected.iter().all(|e| said.contains(e)), "{said}");
            assert_eq!(said.contains("drawn before it"), apart > 0, "{said}");
        }
    }

    #[test]
    fn a_size_that_hides_nothing_or_more_than_all_and_a_name_twice_are_refused_before_a_model_is_read() {
        let args = |size: f64, cuts: Option<u32>| MakeArgs {
            model: "no such model.json".into(),
            like: vec![],
            out: "nowhere".into(),
            count: 1,
            seed: 1,
            kind: None,
            every_kind: false,
            cuts,
            before: false,
            size,
            own_frames: false,
            wide: false,
            surfaces: false,
            laboratory: crate::blind::Laboratory::First,
        };
        for (size, cuts, is_refused) in [
            (-1.0, None, true),
            (0.0, Some(1), true),
            (f64::NAN, None, true),
            (f64::INFINITY, None, true),
            (1.5, Some(1), true),
            (1.5, None, false),
            (1.0, Some(1), false),
        ] {
            let refused = asked_well(&args(size, cuts)).err().map(|e| e.to_string()).unwrap_or_default();
            assert_eq!(refused.contains("--size"), is_refused, "{size} {cuts:?}: {refused}");
            let made = make(&args(size, cuts)).unwrap_err().to_string();
            assert_eq!(made.contains("--size"), is_refused, "{made}");
        }
        let like = |names: [&str; 2]| names.map(|name| (name.to_owned(), std::path::PathBuf::from("kla.csv"))).to_vec();
        let twice = make(&MakeArgs { like: like(["kla", "kla"]), ..args(1.0, None) }).unwrap_err().to_string();
        assert!(twice.contains("--like kla is given twice"), "{twice}");
        assert!(asked_well(&MakeArgs { like: like(["kla", "rks"]), ..args(1.0, None) }).is_ok());
    }

    #[test]
    fn a_ligament_that_the_knee_does_not_have_is_refused_before_a_case_is_made() {
        let bundle = |name: &str| BundleInput {
            name: name.into(),
            reference_strain: 1.0,
            stiffness: 50.0,
            reference_length: 30.0,
            fibres: vec![],
        };
        let all = ["ACL_AM", "ACL_PL", "PCL_AL", "sMCL_A", "LCL"].map(bundle);
        assert_eq!(lacking(&cuts(1), &all), None);
        for kinds in [cuts(1), vec!["cut_LCL".to_owned()]] {
            let said = lacking(&kinds, &all[..4]).unwrap();
            assert!(said.contains("no bundle of LCL, so") && said.contains("cut_PCL, --kind cut_sMCL"), "{said}");
            assert!(!said.contains("cut_LCL"), "{said}");
        }
        // what is not asked for may be missing
        assert_eq!(lacking(&["cut_ACL".to_owned(), "null".to_owned()], &all[..4]), None);
        assert!(lacking(&cuts(1), &[]).unwrap().contains("ACL, PCL, sMCL or LCL, so it cannot be cut; none"));
    }
}
