//! Which knees stand out, and in what.

use super::knee::Knee;
use super::quantity::Quantity;
use std::collections::BTreeMap;

/// Fewer knees than this have no outliers: their scatter is not known.
const FEWEST: usize = 5;
/// Modified z-score beyond which a value is an outlier [iglewicz1993].
const FAR: f64 = 3.5;
/// Standard deviation of a normal sample per median absolute deviation [-].
const SD_PER_MAD: f64 = 1.4826;

/// A value that stands out of the cohort.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outlier {
    pub(super) knee: String,
    pub(super) quantity: Quantity,
    pub(super) median: f64,
    /// Robust standard deviations from the median.
    pub(super) z: f64,
}

impl Outlier {
    /// A sentence without a verb.
    pub(super) fn words(&self) -> String {
        let q = &self.quantity;
        let part = if q.part.is_empty() { String::new() } else { format!(" of {}", q.part) };
        format!("{}{part} {:.4} where the median is {:.4} (z {:+.1})", q.name, q.value, self.median, self.z)
    }
}

/// What a quantity is told from another by.
pub(super) type Key = (&'static str, String, String);

/// All values of every quantity, with the index of their knee.
pub(super) fn by_quantity(knees: &[Knee]) -> BTreeMap<Key, Vec<(usize, f64)>> {
    let mut all: BTreeMap<Key, Vec<(usize, f64)>> = BTreeMap::new();
    for (i, knee) in knees.iter().enumerate() {
        for q in &knee.quantities {
            all.entry((q.stage, q.name.clone(), q.part.clone())).or_default().push((i, q.value));
        }
    }
    all
}

/// The outliers of all quantities, by modified z-score, knees in their order.
pub(super) fn outliers(knees: &[Knee]) -> Vec<Outlier> {
    let mut found = Vec::new();
    for ((stage, name, part), values) in by_quantity(knees) {
        let plain: Vec<f64> = values.iter().map(|(_, v)| *v).collect();
        let Some((middle, sd)) = robust(&plain) else { continue };
        for (i, value) in values {
            let z = (value - middle) / sd;
            if z.abs() > FAR {
                let quantity = Quantity { stage, name: name.clone(), part: part.clone(), value };
                found.push((i, Outlier { knee: knees[i].name.clone(), quantity, median: middle, z }));
            }
        }
    }
    found.sort_by_key(|(i, _)| *i);
    found.into_iter().map(|(_, o)| o).collect()
}

/// Median and robust standard deviation; `None` for few values, or where more than half are the same.
fn robust(values: &[f64]) -> Option<(f64, f64)> {
    if values.len() < FEWEST {
        return None;
    }
    let middle = median(values);
    let away: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    let sd = SD_PER_MAD * median(&away);
    (sd > 0.0).then_some((middle, sd))
}

/// The median; NaN of nothing.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_far_value_does_not_hide_itself() {
        let values = [1.0, 1.1, 0.9, 1.05, 0.95, 100.0];
        let (middle, sd) = robust(&values).unwrap();
        assert!((100.0 - middle) / sd > FAR);
        assert!(values[..5].iter().all(|v| ((v - middle) / sd).abs() < FAR));
        assert!(robust(&values[..4]).is_none());
        assert!(robust(&[2.0; 9]).is_none());
    }
}
