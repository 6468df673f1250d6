//! Ranges of options: all sections are judged together, before anything is read or built with them.

use super::BuildOptions;
use super::held::{ABOVE_0, BELOW_1, HELD};
use toml::{Table, Value};

/// Ranges that no stage's own check holds: a key, least and most. A key of a list is that of each of its numbers.
pub(super) const RANGES: [(&str, f64, f64); 59] = [
    ("segment.neck_share", ABOVE_0, 1.0),
    ("segment.threshold", -3e4, 1e6),
    ("ingest.least_width_mm", 1.0, 1e3),
    // above the least
    ("ingest.greatest_width_mm", 1.0_f64.next_up(), 1e4),
    ("ingest.label_blur", 0.0, 10.0),
    ("ingest.label_edge_mm", 0.1, 10.0),
    ("register.held_out_of", 2.0, 1e3),
    ("register.rms_limit_mm", 1e-3, 10.0),
    ("register.inlier_limit", 0.0, 1.0),
    ("register.error_limit_mm", 1e-3, 10.0),
    ("bones.speck_share", 0.0, 1.0),
    ("bones.remesh_rounds", 0.0, 100.0),
    ("bones.smoothing_rounds", 0.0, 1e3),
    ("cartilage.cleft_mm", 0.0, 20.0),
    ("frames.valgus_deg", -20.0, 20.0),
    ("frames.least_shaft_share", 0.0, 5.0),
    ("frames.far_landmark_limit_deg", 0.0, 90.0),
    ("frames.condylar_angle_range_deg", -45.0, 45.0),
    ("attachments.span", 0.0, 1.0),
    ("attachments.place_reach", 0.0, 10.0),
    ("attachments.marks.gap_fraction_max", 0.0, 1.0),
    ("hexmesh.least_scaled_jacobian", -1.0, BELOW_1),
    ("overclosure.volume_change_max", 0.0, 1.0),
    // from an inverted element to a cube
    ("overclosure.scaled_jacobian_fall_max", 0.0, 2.0),
    ("contact-law.flexions_deg", -15.0, 130.0),
    ("contact-law.youngs_modulus_mpa", 0.01, 1e4),
    ("contact-law.poissons_ratio", 0.0, 0.499),
    ("contact-law.friction", 0.0, 1.0),
    ("contact-law.penalty_mpa_per_mm", 1e-3, 1e6),
    ("assemble.friction", 0.0, 1.0),
    ("assemble.toe_strain", 1e-6, 0.5),
    ("assemble.patellofemoral.toe_strain", 1e-6, 0.5),
    ("assemble.patellofemoral.retinacular_strain", 0.5, 1.5),
    ("assemble.mass_tonne", 1e-9, 1.0),
    ("assemble.inertia_tonne_mm2", 1e-9, 1e6),
    ("assemble.layer.youngs_modulus_mpa", 0.01, 1e4),
    ("assemble.layer.poissons_ratio", 0.0, 0.499),
    ("assemble.layer.least_thickness_mm", 0.01, 10.0),
    ("calibrate.cost.percentile", 0.0, 100.0),
    ("calibrate.cost.limit_mm", ABOVE_0, MOST),
    ("calibrate.targets.flexion_deg", -30.0, 160.0),
    // a misfit is divided by its noise
    ("calibrate.targets.noise", ABOVE_0, MOST),
    ("calibrate.targets.noise_of_displacements", ABOVE_0, MOST),
    // the random numbers of starts and of samples stand in streams of their own, so far apart
    ("calibrate.inference.starts", 0.0, 999.0),
    ("calibrate.inference.samples", 0.0, 1e4),
    ("calibrate.search.contact_spacing_mm", 0.1, 20.0),
    ("validate.ap_flexions_deg", -30.0, 160.0),
    ("validate.from_flexion_deg", -30.0, 160.0),
    ("validate.to_flexion_deg", -30.0, 160.0),
    ("validate.pivot_flexion_deg", -30.0, 160.0),
    ("validate.trials.rim_share", 0.0, 1.0),
    ("validate.explicit.longest_increment_s", 1e-9, 0.1),
    ("validate.explicit.safety", 0.01, 1.0),
    ("validate.explicit.mass_scale", 1e-6, 1e9),
    ("validate.explicit.slip_mm", 1e-6, 1.0),
    ("validate.explicit.most_increments", 1.0, 1e9),
    ("validate.trials.flexion_deg", -180.0, 180.0),
    ("diagnose.folds", 2.0, 100.0),
    ("diagnose.draws", 1.0, 1e4),
];

/// Numbers of either sign that the checks of their own stages hold, or that may be anything.
const SIGNED: [&str; 7] = [
    "validate.pivot_valgus_nm",
    "validate.pivot_internal_nm",
    "diagnose.least_evidence",
    "diagnose.least_further",
    "diagnose.least_beside",
    "calibrate.ranges",
    "calibrate.loads",
];

/// Most seeds, counts and sizes [-, mm, N]: no option has a use for more.
const MOST: f64 = 1e12;

/// What is wrong with a section: its name, and which option, its value and what was expected.
pub(super) struct Fault {
    pub(super) section: String,
    pub(super) what: String,
}

/// Every section in turn: first each number by itself, then what a stage demands of its options together.
pub(super) fn check(options: &BuildOptions, table: &Table) -> Result<(), Fault> {
    for (section, value) in table {
        numbers(section, section, value)?;
    }
    together(options)
}

/// The numbers at and below a key: finite, and in its range; where none is told, not negative.
fn numbers(section: &str, key: &str, value: &Value) -> Result<(), Fault> {
    let number = match value {
        Value::Float(x) => *x,
        Value::Integer(i) => *i as f64,
        Value::Table(t) => return t.iter().try_for_each(|(k, v)| numbers(section, &format!("{key}.{k}"), v)),
        Value::Array(a) => return a.iter().try_for_each(|v| numbers(section, key, v)),
        _ => return Ok(()),
    };
    let fault = |expected: String| {
        let what = format!("{key} is {value}, expected {expected}; check its unit");
        Err(Fault { section: section.to_owned(), what })
    };
    if let Some((_, least, most)) = RANGES.iter().find(|r| r.0 == key) {
        return match (*least..=*most).contains(&number) {
            true => Ok(()),
            false => fault(words([*least, *most])),
        };
    }
    if !number.is_finite() {
        return fault("a finite number".into());
    }
    match (is_signed(key) || number >= 0.0, key.ends_with("seed") || number.abs() <= MOST) {
        (false, _) => fault("a number that is not negative".into()),
        (_, false) => fault(format!("at most {MOST:e}")),
        _ => Ok(()),
    }
}

/// Whether a key, or the table above it, may have numbers of either sign.
fn is_signed(key: &str) -> bool {
    SIGNED.iter().any(|s| key.strip_prefix(s).is_some_and(|rest| rest.is_empty() || rest.starts_with('.')))
}

/// Least and most that an option may be, by its key and default; none of what is no number. Another option may ask for more.
pub(crate) fn range(key: &str, default: Option<&Value>) -> Option<[f64; 2]> {
    if let Some((_, least, most)) = RANGES.iter().chain(&HELD).find(|r| r.0 == key) {
        return Some([*least, *most]);
    }
    let first = match default? {
        Value::Array(all) => all.first()?,
        value => value,
    };
    let most = if key.ends_with("seed") { i64::MAX as f64 } else { MOST };
    match first {
        Value::Float(_) | Value::Integer(_) => Some([if is_signed(key) { -most } else { 0.0 }, most]),
        _ => None,
    }
}

/// A range in words.
pub(crate) fn words([least, most]: [f64; 2]) -> String {
    // what is not taken itself begins a range from above, and ends one from below
    let (low, is_above) = match least.next_down() {
        _ if least == ABOVE_0 => ("above 0".to_owned(), true),
        round if told(round).len() < told(least).len() => (format!("above {}", told(round)), true),
        _ => (told(least), false),
    };
    let (high, open) = match most.next_up() {
        round if told(round).len() < told(most).len() => (told(round), "below "),
        _ => (told(most), ""),
    };
    match (least <= -MOST, most.next_up() >= MOST) {
        (true, true) => "any number".to_owned(),
        (_, true) if is_above => low,
        (_, true) => format!("{low} or more"),
        _ => format!("{low} to {open}{high}"),
    }
}

/// A number as it was written: by its power of ten where it is very small or large.
fn told(x: f64) -> String {
    if x != 0.0 && !(1e-4..1e7).contains(&x.abs()) { format!("{x:e}") } else { format!("{x}") }
}

/// What each stage demands of its options before it works.
fn together(o: &BuildOptions) -> Result<(), Fault> {
    fn of(section: &str, found: Result<(), impl ToString>) -> Result<(), Fault> {
        found.map_err(|e| Fault { section: section.to_owned(), what: e.to_string() })
    }
    of("segment", stages::segment::check_options(&o.segment))?;
    of("ingest", stages::ingest::check_options(&o.ingest))?;
    of("bones", stages::bones::check(&o.bones))?;
    of("cartilage", stages::cartilage::check(&o.cartilage))?;
    of("hexmesh", stages::hexmesh::check(&o.hexmesh))?;
    of("overclosure", stages::overclosure::check(&o.overclosure))?;
    of("contact-law", stages::contact_law::check(&o.contact_law))?;
    of("assemble", stages::assemble::check_options(&o.assemble))?;
    of("calibrate", o.calibrate.check())?;
    of("validate", sim::protocols::check(&o.validate))?;
    of("validate", o.validate.trials.check())
}

#[cfg(test)]
mod tests {
    use super::super::{parse_override, resolve};
    use std::collections::BTreeMap;

    /// What calibrate refuses when it works is refused before a build begins.
    #[test]
    fn a_noise_of_0_is_refused_in_each_coordinate() {
        let set = |text: &str| resolve(&BTreeMap::new(), &[parse_override(text).unwrap()], None);
        for key in ["calibrate.targets.noise", "calibrate.targets.noise_of_displacements"] {
            for k in 0..5 {
                for odd in ["0.0", "-0.5"] {
                    let noise =
                        |x: &'static str| (0..5).map(|i| if i == k { x } else { "0.5" }).collect::<Vec<_>>().join(", ");
                    let said = set(&format!("{key}=[{}]", noise(odd))).unwrap_err().to_string();
                    assert!(said.contains(key) && said.contains("expected above 0"), "{said}");
                    assert!(set(&format!("{key}=[{}]", noise("1e-3"))).is_ok(), "{key}");
                }
            }
        }
        let said = set("calibrate.cost.limit_mm=0").unwrap_err().to_string();
        assert!(said.contains("calibrate.cost.limit_mm") && said.contains("expected above 0"), "{said}");
        assert!(set("calibrate.cost.limit_mm=1e-3").is_ok());
    }
}
