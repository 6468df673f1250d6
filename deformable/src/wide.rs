//! Four numbers side by side, one of each of four elements.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Elements computed together.
pub(super) const LANES: usize = 4;

/// A number of each of four elements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub(super) struct Wide(pub(super) [f64; LANES]);

/// A vector of each.
pub(super) type Wide3 = [Wide; 3];

impl Wide {
    pub(super) const ZERO: Wide = Wide([0.0; LANES]);
    pub(super) const ONE: Wide = Wide([1.0; LANES]);

    #[inline(always)]
    pub(super) fn of(x: f64) -> Wide {
        Wide([x; LANES])
    }

    #[inline(always)]
    pub(super) fn map(self, f: impl Fn(f64) -> f64) -> Wide {
        Wide(self.0.map(f))
    }

    #[inline(always)]
    pub(super) fn inverse(self) -> Wide {
        let mut out = self;
        for x in &mut out.0 {
            *x = 1.0 / *x;
        }
        out
    }

    /// The largest of the four; a NaN is not seen.
    pub(super) fn largest(self) -> f64 {
        self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

macro_rules! lanewise {
    ($trait:ident, $name:ident, $op:tt) => {
        impl $trait for Wide {
            type Output = Wide;
            #[inline(always)]
            fn $name(self, other: Wide) -> Wide {
                let mut out = self;
                for k in 0..LANES {
                    out.0[k] = self.0[k] $op other.0[k];
                }
                out
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl Mul<f64> for Wide {
    type Output = Wide;
    #[inline(always)]
    fn mul(self, x: f64) -> Wide {
        self * Wide::of(x)
    }
}

impl Neg for Wide {
    type Output = Wide;
    #[inline(always)]
    fn neg(self) -> Wide {
        self * -1.0
    }
}

impl AddAssign for Wide {
    #[inline(always)]
    fn add_assign(&mut self, other: Wide) {
        *self = *self + other;
    }
}
