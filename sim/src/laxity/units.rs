//! Units of the columns of a laxity file, and what they are in the standard ones.

/// Units by quantity, with the factor to the standard unit.
const UNITS: [(&str, &[&str], f64); 18] = [
    ("deg", &["deg", "degree", "degrees", "°"], 1.0),
    ("deg", &["rad", "radian", "radians"], 57.295_779_513_082_32),
    ("mm", &["mm", "millimetre", "millimeter"], 1.0),
    ("mm", &["cm"], 10.0),
    ("mm", &["m", "metre", "meter"], 1000.0),
    ("mm", &["in", "inch"], 25.4),
    ("n", &["n", "newton"], 1.0),
    ("n", &["kn"], 1000.0),
    ("n", &["lbf", "lb"], 4.448_221_615_260_5),
    ("n", &["kgf", "kp"], 9.806_65),
    ("nm", &["nm", "n m", "n*m", "n·m", "n.m", "n-m"], 1.0),
    ("nm", &["nmm", "n mm", "n*mm", "n·mm", "n.mm", "n-mm"], 0.001),
    ("nm", &["ncm", "n cm", "n*cm", "n·cm", "n.cm", "n-cm"], 0.01),
    ("nm", &["kgf m", "kgfm", "kgf*m", "kgf·m", "kgf.m", "kgf-m", "kp m"], 9.806_65),
    ("nm", &["in lbf", "in-lbf", "lbf in", "lbf-in", "in lb"], 0.112_984_829_027_616_7),
    ("nm", &["ft lbf", "ft-lbf", "lbf ft", "lbf-ft", "ft lb"], 1.355_817_948_331_4),
    ("nm", &["kn m", "knm", "kn*m", "kn·m", "kn.m", "kn-m"], 1000.0),
    ("s", &["s", "sec", "seconds"], 1.0),
];

/// Quantity and factor of a unit.
pub(super) fn unit(text: &str) -> Option<(&'static str, f64)> {
    let text = text.trim().trim_matches(|c| "[]()".contains(c)).trim().to_lowercase();
    UNITS.iter().find(|(_, names, _)| names.contains(&text.as_str())).map(|(quantity, _, factor)| (*quantity, *factor))
}

/// The unit in a column name's brackets: `F_ant [kN]`.
pub(super) fn bracketed(name: &str) -> Option<&str> {
    let open = name.rfind(['[', '('])?;
    let inner = name[open + 1..].trim().trim_end_matches([']', ')']);
    unit(inner).map(|_| inner)
}

/// The standard unit of a standard column; `None` for words and counts.
pub(super) fn standard_unit(column: &str) -> Option<&'static str> {
    let last = column.rsplit('_').next()?;
    ["deg", "mm", "nm", "n", "s"].into_iter().find(|u| *u == last)
}

/// Units of a quantity, as a message lists them.
pub(super) fn units_of(quantity: &str) -> String {
    UNITS.iter().filter(|(q, _, _)| *q == quantity).map(|(_, names, _)| names[0]).collect::<Vec<_>>().join(", ")
}
