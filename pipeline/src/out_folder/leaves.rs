//! What each verb leaves in the folder of `--out`, as far as its words tell: it is looked at before the work.

use super::is_set;
use crate::store::written::Leaves;
use clap::ArgMatches;

/// Files that a verb writes whatever comes of its work, or removes where they are of an earlier run.
const SURE: [(&str, &[&str]); 7] = [
    (
        "calibrate",
        &[
            "model.json",
            "metrics.json",
            "parameters.csv",
            "history.csv",
            "frames.csv",
            "noise.csv",
            "rest.csv",
            "next_tests.csv",
            "forces.csv",
            "fit.csv",
            "starts.csv",
            "figure5.svg",
        ],
    ),
    ("credibility", &["credibility.json", "credibility.html"]),
    ("import-abaqus", MODEL),
    ("import-febio", MODEL),
    ("import-opensim", MODEL),
    ("plan", &["plan.json", "plan.csv", "plan.html"]),
    (
        "validate",
        &[
            "table4.csv",
            "table5.csv",
            "table6.csv",
            "table7.csv",
            "cross_prediction.csv",
            "solvers.csv",
            "sensitivity.csv",
            "compare.csv",
            "tables.md",
            "figure7.svg",
            "figure8.svg",
        ],
    ),
];

/// Of an import: its meshes are known once it has read them.
const MODEL: &[&str] = &["model.json"];

/// Tables of a cohort.
const OF_COHORT: [&str; 8] =
    ["knees", "stages", "warnings", "quantities", "outliers", "parameters", "forces", "laxity"];

/// Of many plans; one plan has its own in [`SURE`].
const OF_SWEEP: [&str; 3] = ["sweep.csv", "sweep.json", "sweep.html"];

/// Of a diagnosis, and of an atlas.
const OF_DIAGNOSIS: [&[&str]; 2] = [&["diagnosis.json", "report.html", "model.json"], &["atlas.json", "atlas.html"]];

/// What `verb` leaves in a folder when it is asked so; nothing where it has no folder, or writes nothing this time.
pub(super) fn of(verb: &str, matches: &ArgMatches) -> Leaves {
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
    let of_verb = SURE.iter().find(|(name, _)| *name == verb).map_or(&[][..], |(_, names)| *names);
    let (mut sure, mut perhaps) = (owned(of_verb), vec![]);
    match verb {
        "calibrate" => perhaps = owned(&["samples.json", "samples.csv", "cost.csv", "figure6.svg"]),
        "cohort" if asks_for_priors(matches) => {
            sure = in_each_format(["infer"]);
            perhaps = owned(&["shared_prior*.json"]);
        }
        "cohort" => {
            sure = in_each_format(OF_COHORT);
            sure.push("cohort.html".to_owned());
        }
        "diagnose" => {
            let is_atlas = is_set(matches, "atlas");
            sure = owned(OF_DIAGNOSIS[usize::from(is_atlas)]);
            perhaps = if is_atlas { vec![] } else { owned(&["components/*.toml"]) };
        }
        "plan" if is_set(matches, "example") || is_set(matches, "sweep_example") => sure = vec![],
        "plan" if matches.try_contains_id("sweep").unwrap_or(false) => sure = owned(&OF_SWEEP),
        "plan" if is_set(matches, "map") => sure.push("map.csv".to_owned()),
        _ => {}
    }
    Leaves { sure, perhaps }
}

/// Whether the first word after `cohort` is `infer`.
fn asks_for_priors(matches: &ArgMatches) -> bool {
    let words = matches.try_get_raw("builds").ok().flatten();
    words.and_then(|mut words| words.next()).is_some_and(|word| word == "infer")
}

/// Tables of a cohort, as files.
fn in_each_format<const N: usize>(tables: [&str; N]) -> Vec<String> {
    let endings: &[&str] = if cfg!(feature = "parquet") { &["csv", "parquet"] } else { &["csv"] };
    tables.iter().flat_map(|table| endings.iter().map(move |ending| format!("{table}.{ending}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::command;

    /// What a command line leaves.
    fn left(words: &[&str]) -> Leaves {
        let matches = command().try_get_matches_from([&["build-model"], words].concat()).unwrap();
        let (verb, inner) = matches.subcommand().unwrap();
        of(verb, inner)
    }

    #[test]
    fn what_is_left_depends_on_what_is_asked() {
        let has = |words: &[&str], name: &str| left(words).sure.iter().any(|n| n == name);
        let plan = ["plan", "KNEE", "graft.toml"];
        assert!(!has(&plan, "map.csv") && has(&[&plan[..], &["--map"]].concat(), "map.csv"));
        assert_eq!(left(&["plan", "--example"]), Leaves::default());
        let sweep = [&plan[..], &["--sweep", "sweep.toml"]].concat();
        assert_eq!(left(&sweep).sure, OF_SWEEP);
        assert!(OF_SWEEP.iter().all(|name| !has(&plan, name)));
        assert_eq!(left(&["plan", "--sweep-example"]), Leaves::default());
        let diagnose = ["diagnose", "KNEE", "--measured", "kla=kla.csv", "--out", "d"];
        let atlas = [&diagnose[..], &["--atlas"]].concat();
        assert!(has(&diagnose, "model.json") && !has(&diagnose, "atlas.json"));
        assert!(has(&atlas, "atlas.json") && !has(&atlas, "model.json"));
        let [page, priors] = [["cohort", "a", "b", "--out", "c"], ["cohort", "infer", "b", "--out", "c"]];
        assert!(has(&page, "cohort.html") && has(&page, "knees.csv") && !has(&page, "infer.csv"));
        assert!(has(&priors, "infer.csv") && !has(&priors, "cohort.html"));
        assert_eq!(left(&["inspect", "KNEE"]), Leaves::default());
    }
}
