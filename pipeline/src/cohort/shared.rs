//! The file of a shared prior, as a calibration takes it up.

use crate::error::{BuildError, Place};
use crate::record::{hash, json};
use crate::store;
use calibration::options::CalibrateOptions;
use calibration::shared::{Shared, SharedPrior};
use sim::spec::SharedPriorSpec;
use std::path::Path;

/// Its option.
const KEY: &str = "calibrate.shared_prior";

/// Reads the file that the option names into the options: what stands in it decides the result, so it counts among them. `knee` is what the
/// knee at hand is called: its id and side.
///
/// # Errors
/// A file that is not there, is no shared prior, or is none for this knee: the option, the file, what is wrong and what to do.
pub(crate) fn read_in(options: &mut CalibrateOptions, knee: &str) -> Result<(), BuildError> {
    let (named, shared) = match &options.shared_prior {
        None => return Ok(()),
        Some(SharedPrior::File(path)) => (path.clone(), Box::new(Shared { file: name_of(path), ..read(path)? })),
        Some(SharedPrior::Read(shared)) => (IN_PLACE.to_owned(), shared.clone()),
    };
    shared.is_for_knee(knee).map_err(|what| wrong(&named, format!("{KEY}: {named}: {what}")))?;
    options.shared_prior = Some(SharedPrior::Read(shared));
    Ok(())
}

/// How a shared prior is named whose text stands in the option itself.
const IN_PLACE: &str = "the text of a shared prior";

/// The last part of a path.
fn name_of(path: &str) -> Option<String> {
    Some(Path::new(path).file_name()?.to_string_lossy().into_owned())
}

/// What a model says of the prior that other knees gave its calibration; nothing where none did.
pub(crate) fn of_options(options: &CalibrateOptions) -> Option<SharedPriorSpec> {
    match &options.shared_prior {
        Some(SharedPrior::Read(shared)) => Some(of(shared)),
        Some(SharedPrior::File(_)) | None => None,
    }
}

/// The same of a shared prior.
pub(crate) fn of(shared: &Shared) -> SharedPriorSpec {
    let as_written = Shared { file: None, ..shared.clone() };
    SharedPriorSpec {
        file: shared.file.clone(),
        digest: hash(&json(&as_written)),
        from: shared.from.clone(),
        numbers: shared.numbers.len(),
    }
}

/// Knees that a sentence names; of more it tells how many there are.
const NAMED: usize = 3;

/// The sentence for a reader: which file, how many knees informed the prior, and that the result is not independent of them. Nothing of a prior that tells
/// of no number: nothing came from it.
pub(crate) fn sentence(prior: &SharedPriorSpec) -> Option<String> {
    let is_one = prior.from.len() == 1;
    let knees = if is_one { "1 other knee says".to_owned() } else { format!("{} other knees say", prior.from.len()) };
    let names = Some(prior.from.join(", ")).filter(|names| prior.from.len() <= NAMED && !names.is_empty());
    let sources: Vec<String> = prior.file.clone().into_iter().chain(names).collect();
    let sources = if sources.is_empty() { String::new() } else { format!(" ({})", sources.join(": ")) };
    let numbers = if prior.numbers == 1 { "number" } else { "numbers" };
    let those = if is_one { "that knee" } else { "those knees" };
    (prior.numbers > 0).then(|| {
        format!(
            "The prior of {} {numbers} is what {knees}{sources}, so the result is not independent of {those}.",
            prior.numbers
        )
    })
}

/// What stands behind the parameters that a knee's data do not settle, in words: the literature, and other knees where these gave the prior.
pub(crate) fn the_rest(prior: Option<&SharedPriorSpec>) -> &'static str {
    match prior.filter(|prior| prior.numbers > 0) {
        None => "the rest lean on the literature",
        Some(_) => "the rest lean on the literature and on what other knees say",
    }
}

/// What a table of knees calls a shared prior: its file, or that its text was given.
pub(crate) fn name(prior: &SharedPriorSpec) -> &str {
    prior.file.as_deref().unwrap_or(IN_PLACE)
}

/// The option is at fault, with this value.
fn wrong(value: &str, told: String) -> BuildError {
    BuildError::Setting { key: KEY.to_owned(), value: value.to_owned(), on_line: false, told }
}

fn read(path: &str) -> Result<Shared, BuildError> {
    let wrong = |what: String| {
        let expected = "a file shared_prior_KNEE.json, written by build-model cohort infer BUILD BUILD --out FOLDER";
        wrong(path, format!("{KEY}: {what}; expected {expected}"))
    };
    let file = Path::new(path);
    let bytes = store::read(file).map_err(|e| match e {
        // the machine's faults stay what they are
        BuildError::At { told, .. } => wrong(told),
        other => other,
    })?;
    let shared: Shared = serde_json::from_slice(&bytes).map_err(|e| {
        let Place { row, .. } = Place::in_json(file, &e);
        wrong(format!("{path} line {}: {e}", row.unwrap_or_default()))
    })?;
    shared.checked().map_err(|what| wrong(format!("{path}: {what}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WELL: &str = r#"{"schema": "shared-prior/1", "knee": "A left", "from": ["B left"], "numbers": [
        {"name": "LCL.reference_strain", "mean": -0.5, "sd": 0.8, "before": [0.95, 1.01, 1.07], "after": [0.93, 0.98, 1.03]}]}"#;

    fn read_of(folder: &Path, text: &str) -> Result<CalibrateOptions, BuildError> {
        let file = folder.join("a.json");
        store::write(&file, text.as_bytes()).unwrap();
        let named = SharedPrior::File(file.display().to_string());
        let mut options = CalibrateOptions { shared_prior: Some(named), ..CalibrateOptions::default() };
        read_in(&mut options, "A left").map(|()| options)
    }

    #[test]
    fn what_stands_in_the_file_is_among_the_options_and_in_the_key_of_the_stage() {
        let folder = tempfile::tempdir().unwrap();
        let key = |text: &str| serde_json::to_string(&read_of(folder.path(), text).unwrap()).unwrap();
        let (one, same, other) = (key(WELL), key(&WELL.replace("  ", " ")), key(&WELL.replace("-0.5", "-0.4")));
        assert_eq!(one, same, "spaces mean nothing");
        assert!(one != other && one.contains("LCL.reference_strain"), "{one}");
        // read already: nothing is read again
        let mut options = read_of(folder.path(), WELL).unwrap();
        let before = options.clone();
        read_in(&mut options, "A left").unwrap();
        assert_eq!(options, before);
    }

    #[test]
    fn a_model_says_which_file_it_was_and_whose_data_are_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let prior: Shared = serde_json::from_str(WELL).unwrap();
        // the digest is that of the file as cohort infer writes it, whatever stands between its words
        let told = of_options(&read_of(folder.path(), WELL).unwrap()).unwrap();
        assert_eq!((told.file.as_deref(), told.digest.clone()), (Some("a.json"), hash(&json(&prior))));
        assert_eq!((told.from.join(","), told.numbers), ("B left".to_owned(), 1));
        assert_eq!(of_options(&CalibrateOptions::default()), None);
        let words = sentence(&told).unwrap();
        assert_eq!(
            words,
            "The prior of 1 number is what 1 other knee says (a.json: B left), so the result is not independent of that knee."
        );
        let many = (0..30).map(|k| format!("K{k} left")).collect();
        let words = sentence(&SharedPriorSpec { file: None, from: many, numbers: 14, ..told.clone() }).unwrap();
        assert_eq!(
            words,
            "The prior of 14 numbers is what 30 other knees say, so the result is not independent of those knees."
        );
        assert_eq!((name(&told), name(&SharedPriorSpec { file: None, ..told.clone() })), ("a.json", IN_PLACE));
        // what tells of no number gave nothing
        let nothing = SharedPriorSpec { numbers: 0, ..told.clone() };
        assert_eq!(sentence(&nothing), None);
        assert_eq!(the_rest(Some(&nothing)), the_rest(None));
        assert_ne!(the_rest(Some(&told)), the_rest(None));
    }

    #[test]
    fn a_malformed_file_is_an_error_with_key_and_advice() {
        let folder = tempfile::tempdir().unwrap();
        let faults: [(&str, &str); 5] = [
            ("{", "line 1"),
            (&WELL.replace("shared-prior/1", "samples/1"), "samples/1"),
            (&WELL.replace("0.8", "-0.8"), "sd is -0.8"),
            (&WELL.replace("\"mean\"", "\"meen\""), "meen"),
            (&WELL.replace("-0.5", "\"low\""), "low"),
        ];
        for (text, named) in faults {
            let error = read_of(folder.path(), text).unwrap_err();
            let told = error.to_string();
            assert!(told.contains(named) && told.contains("cohort infer"), "{told}");
            assert_eq!(error.setting().map(|s| s.0), Some(KEY), "{told}");
        }
        let named = SharedPrior::File(folder.path().join("none.json").display().to_string());
        let mut options = CalibrateOptions { shared_prior: Some(named), ..CalibrateOptions::default() };
        let told = read_in(&mut options, "A left").unwrap_err().to_string();
        assert!(told.contains("none.json") && told.contains(KEY), "{told}");
    }

    #[test]
    fn one_that_is_not_for_the_knee_at_hand_is_refused_where_it_is_read_and_where_its_text_is_given() {
        let folder = tempfile::tempdir().unwrap();
        let text_of = |knee: &str| WELL.replace("\"knee\": \"A left\", ", knee);
        let cases: [(String, &[&str]); 3] = [
            (text_of("\"knee\": \"A left\", "), &["A left"]),
            (text_of("\"knee\": \"A right\", "), &["A right"]),
            (text_of(""), &["A left", "A right", "C left"]),
        ];
        for (text, is_for) in cases {
            let file = folder.path().join("a.json");
            store::write(&file, text.as_bytes()).unwrap();
            let read: Shared = serde_json::from_str(&text).unwrap();
            for knee in ["A left", "A right", "B left", "C left"] {
                for prior in [SharedPrior::File(file.display().to_string()), SharedPrior::Read(Box::new(read.clone()))]
                {
                    let mut options = CalibrateOptions { shared_prior: Some(prior), ..CalibrateOptions::default() };
                    let found = read_in(&mut options, knee);
                    assert_eq!(found.is_ok(), is_for.contains(&knee), "{knee}: {text}");
                    if let Err(error) = found {
                        assert_eq!(error.setting().map(|s| s.0), Some(KEY), "{error}");
                        let told = error.to_string();
                        assert!(told.starts_with(KEY) && told.contains(&format!("wrote for {knee}")), "{told}");
                    }
                }
            }
        }
    }
}
