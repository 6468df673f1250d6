//! Thresholds from a histogram.

/// Number of bins.
const BINS: usize = 1024;

/// How often values fall into even bins from `low` to `high`.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    low: f64,
    width: f64,
    counts: Vec<u64>,
}

impl Histogram {
    /// Of the values between `low` and `high`; others are left out. `None` where there is no range.
    pub fn new(values: &[f32], low: f64, high: f64) -> Option<Histogram> {
        let width = (high - low) / BINS as f64;
        if !(width > 0.0 && width.is_finite()) {
            return None;
        }
        let mut counts = vec![0; BINS];
        for &x in values {
            let bin = (f64::from(x) - low) / width;
            if (0.0..BINS as f64).contains(&bin) {
                counts[bin as usize] += 1;
            }
        }
        Some(Histogram { low, width, counts })
    }

    /// Middle of a bin.
    fn value(&self, bin: usize) -> f64 {
        self.low + (bin as f64 + 0.5) * self.width
    }

    /// The value below which a share of the counts lies.
    pub fn percentile(&self, share: f64) -> f64 {
        let total: u64 = self.counts.iter().sum();
        let wanted = share * total as f64;
        let mut below = 0.0;
        let bin = self.counts.iter().position(|&c| {
            below += c as f64;
            below >= wanted
        });
        self.value(bin.unwrap_or(BINS - 1))
    }

    /// The two thresholds that part the values into three classes with the greatest variance between them [otsu1979].
    /// `None` where fewer than three bins are filled.
    pub fn three_classes(&self) -> Option<[f64; 2]> {
        let (mut weight, mut moment) = (vec![0.0; BINS + 1], vec![0.0; BINS + 1]);
        for b in 0..BINS {
            weight[b + 1] = weight[b] + self.counts[b] as f64;
            moment[b + 1] = moment[b] + self.counts[b] as f64 * self.value(b);
        }
        let term = |from: usize, to: usize| {
            let (w, m) = (weight[to] - weight[from], moment[to] - moment[from]);
            if w > 0.0 { m * m / w } else { f64::NEG_INFINITY }
        };
        let mut best = (f64::NEG_INFINITY, [0, 0]);
        for a in 1..BINS - 1 {
            let first = term(0, a);
            for b in a + 1..BINS {
                let sum = first + term(a, b) + term(b, BINS);
                if sum > best.0 {
                    best = (sum, [a, b]);
                }
            }
        }
        best.0.is_finite().then(|| best.1.map(|b| self.low + b as f64 * self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_heaps_are_parted_between_them() {
        let values: Vec<f32> =
            (0..3000).map(|i| [0.0, 300.0, 1000.0][i % 3] + ((i * 37 % 101) as f32 - 50.0)).collect();
        let [a, b] = Histogram::new(&values, -100.0, 1200.0).unwrap().three_classes().unwrap();
        assert!((50.0..251.0).contains(&a) && (350.0..951.0).contains(&b), "{a} {b}");
        assert!(Histogram::new(&values, 5.0, 5.0).is_none());
        assert!(Histogram::new(&[7.0; 9], 0.0, 10.0).unwrap().three_classes().is_none());
    }
}
