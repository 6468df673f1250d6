//! The one unit system: mm, N, s, tonne, MPa, radian. Degrees and newton-metres appear only at the borders.

/// Radians from degrees.
pub fn radians(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// Degrees from radians.
pub fn degrees(radians: f64) -> f64 {
    radians.to_degrees()
}

/// N mm in one N m.
pub const N_MM_PER_N_M: f64 = 1000.0;
