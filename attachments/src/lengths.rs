//! Published lengths of ligaments, against which the placed ones are checked.

/// The length of a ligament among knees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedLength {
    /// Ligament name.
    pub ligament: &'static str,
    /// Mean [mm], in extension.
    pub mean_mm: f64,
    /// Standard deviation from knee to knee [mm], with the spread between studies where there are several.
    pub sd_mm: f64,
    /// Keys of the bibliography.
    pub cite: &'static [&'static str],
}

/// What was found in print. The posterior structures and the PCL have no length here: none was found that is measured between the sites of Table 2.
pub const PUBLISHED: [PublishedLength; 5] = [
    // averages of studies from 26 to 38 mm; 31 mm, sd 3 mm in 33 knees
    PublishedLength { ligament: "ACL", mean_mm: 32.0, sd_mm: 4.6, cite: &["cone2019", "odensten1985"] },
    // 61.4 mm, sd 6.2 mm in 61 knees; 66 mm (59 to 74) in 10
    PublishedLength { ligament: "LCL", mean_mm: 62.0, sd_mm: 6.2, cite: &["zeng2011", "meister2000"] },
    // femoral and tibial distance to the joint line together: 31.1 (sd 4.6) and 62.4 (sd 5.5) mm
    PublishedLength { ligament: "sMCL", mean_mm: 93.5, sd_mm: 7.2, cite: &["liu2010"] },
    // the same of the deep ligament: 20.5 (sd 4.2) and 6.5 (sd 1.3) mm
    PublishedLength { ligament: "dMCL", mean_mm: 27.0, sd_mm: 4.4, cite: &["liu2010"] },
    // 33.1 mm, sd 2.2 mm in 4 knees; 5 mm is ours, since studies differ
    PublishedLength { ligament: "ALS", mean_mm: 33.1, sd_mm: 5.0, cite: &["zens2015"] },
];

/// Standard deviations from the mean beyond which a length is told [-]: one normal knee in eighty.
pub const LIMIT_SD: f64 = 2.5;

/// Range of lengths [mm] of a ligament in a knee of this size (`scale`: epicondylar width over the atlas'); `None` where no length is published.
pub fn usual_range_mm(ligament: &str, scale: f64) -> Option<[f64; 2]> {
    let found = PUBLISHED.iter().find(|p| p.ligament == ligament)?;
    Some([-1.0, 1.0].map(|way| scale * (found.mean_mm + way * LIMIT_SD * found.sd_mm)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bundle::LIGAMENTS;

    #[test]
    fn every_length_is_of_a_known_ligament_and_grows_with_the_knee() {
        for p in PUBLISHED {
            assert!(LIGAMENTS.contains(&p.ligament) && !p.cite.is_empty());
            let [small, large] = [0.9, 1.1].map(|s| usual_range_mm(p.ligament, s).unwrap());
            assert!(small[0] > 0.0 && small[0] < large[0] && small[1] < large[1], "{}", p.ligament);
        }
        assert_eq!(usual_range_mm("PFL", 1.0), None);
    }
}
