//! Effects that change the knee itself.

use crate::BenchError;
use crate::asked::Hidden;
use crate::knee::Knee;
use nalgebra::Vector3;

/// Beginning of the name of an effect that displaces a ligament's sites; the structure follows.
pub(crate) const SITE: &str = "attachment_";

/// Whether an effect changes the tissues of a knee.
pub(crate) fn changes(hidden: &Hidden) -> bool {
    structure(hidden).is_some()
}

/// The structure that it changes.
fn structure(hidden: &Hidden) -> Option<&str> {
    match hidden.effect.as_str() {
        "mcl_wrap" => Some("sMCL"),
        "pcap_wrap" => Some("PCAP"),
        other => other.strip_prefix(SITE).or_else(|| hidden.cuts().map(|(structure, _)| structure)),
    }
}

/// Changes a knee as an effect does, where it does.
///
/// Errors: the knee has no such structure.
pub(crate) fn change(knee: &mut Knee, hidden: &Hidden) -> Result<(), BenchError> {
    let Some(structure) = structure(hidden) else { return Ok(()) };
    if !knee.has(structure) {
        return Err(BenchError::Effect(format!("{}: the knee has no bundle of {structure}", hidden.effect)));
    }
    match (hidden.effect.as_str(), hidden.cuts()) {
        (_, Some((_, loss))) => knee.weaken(structure, loss),
        ("mcl_wrap", _) => knee.lay_over_rim(structure, hidden.value("offset_mm")),
        ("pcap_wrap", _) => knee.lay_over_condyles(structure, hidden.value("offset_mm")),
        _ => {
            let femur = Vector3::new(0.0, hidden.value("femur_ap_mm"), hidden.value("femur_si_mm"));
            knee.move_sites(structure, [femur, Vector3::new(0.0, hidden.value("tibia_ap_mm"), 0.0)]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat;

    #[test]
    fn a_structure_that_the_knee_lacks_is_refused_by_name() {
        let mut knee = Knee::drawn(&flat::input(), 5).unwrap();
        for effect in ["mcl_wrap", "pcap_wrap", "attachment_PCL"] {
            let hidden = Hidden { effect: effect.into(), parameters: [("offset_mm".to_owned(), 4.0)].into() };
            let refused = change(&mut knee, &hidden).unwrap_err().to_string();
            assert!(changes(&hidden) && refused.contains("no bundle of"), "{refused}");
        }
        let other = Hidden { effect: "gravity".into(), parameters: [("weight_n".to_owned(), 9.0)].into() };
        assert!(!changes(&other) && change(&mut knee, &other).is_ok());
    }
}
