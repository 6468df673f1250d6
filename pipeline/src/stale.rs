//! Whether a page that a program wrote still says what the program says: word by word, numbers within what their last printed digit shows.

/// At most so many lines are told.
const MOST: usize = 12;

/// Lines in which `written` differs from `fresh`; numbers may differ by one unit of their last digit, which two machines' rounding may do.
pub fn differences(written: &str, fresh: &str) -> Vec<String> {
    let (a, b): (Vec<&str>, Vec<&str>) = (written.trim_end().lines().collect(), fresh.trim_end().lines().collect());
    let mut out = Vec::new();
    for i in 0..a.len().max(b.len()) {
        let (old, new) = (a.get(i).copied().unwrap_or("(nothing)"), b.get(i).copied().unwrap_or("(nothing)"));
        if !same(old, new) {
            out.push(format!("line {}: is \"{old}\"; the program says \"{new}\"", i + 1));
        }
        if out.len() == MOST {
            break;
        }
    }
    out
}

fn same(a: &str, b: &str) -> bool {
    let (a, b) = (parts(a), parts(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(x, y)| x == y || near(x, y))
}

/// Numbers, and what stands between them.
fn parts(line: &str) -> Vec<&str> {
    let mut out = Vec::new();
    let mut start = 0;
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let mut before: Option<bool> = None;
    for (at, c) in line.char_indices() {
        let number = is_number(c);
        if before.is_some_and(|b| b != number) {
            out.push(&line[start..at]);
            start = at;
        }
        before = Some(number);
    }
    out.push(&line[start..]);
    out
}

/// Numbers of as many decimals, one unit of the last digit apart at most.
fn near(a: &str, b: &str) -> bool {
    let decimals = |s: &str| s.split_once('.').map_or(0, |(_, d)| d.len());
    let (Ok(x), Ok(y)) = (a.parse::<f64>(), b.parse::<f64>()) else { return false };
    // a hair over one unit: the difference itself is rounded
    decimals(a) == decimals(b) && (x - y).abs() <= 1.001 * 10f64.powi(-(decimals(a) as i32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_must_be_the_same_and_numbers_nearly() {
        assert!(differences("ACL 163.4 (47), X1\n", "ACL 163.5 (48), X1").is_empty());
        for other in [
            "ACL 163.6 (47), X1",
            "ACL 163.4 (49), X1",
            "PCL 163.4 (47), X1",
            "ACL 163.40 (47), X1",
            "ACL -163.4 (47), X1",
        ] {
            assert_eq!(differences("ACL 163.4 (47), X1", other).len(), 1, "{other}");
        }
        assert_eq!(differences("a\nb", "a").len(), 1);
        assert_eq!(differences(&"a\n".repeat(100), "").len(), MOST);
    }
}
