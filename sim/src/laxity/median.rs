//! The median of a list.

/// The median, of an even list the mean of both in its middle; none of an empty one.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let [below, above] = [values.len().saturating_sub(1) / 2, values.len() / 2].map(|k| values.get(k).copied());
    Some(f64::midpoint(below?, above?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_a_list_lies_on_either_side() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3.0]), Some(3.0));
        assert_eq!(median(vec![5.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![8.0, 1.0, 2.0, 4.0]), Some(3.0));
    }
}
