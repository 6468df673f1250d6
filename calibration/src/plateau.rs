//! Which samples say something of a load: one rule for every mean and interval that is told.
//!
//! Beyond the plateau nothing bears: a pose or a force there is none of this knee. So samples whose femur leaves the plateau are left out and counted.
//! Where more than half leave it, the others make no interval of this knee either.

/// The samples of a knee under one load.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Staying {
    /// Those that count, by their numbers; none where more than half of those with an equilibrium leave the plateau.
    pub here: Vec<usize>,
    /// How many leave the plateau.
    pub leaving: usize,
    /// How many have no equilibrium.
    pub lost: usize,
}

impl Staying {
    /// Of samples in their order, whether each leaves the plateau; `None` of one without equilibrium.
    pub fn of(leaves: impl IntoIterator<Item = Option<bool>>) -> Staying {
        let mut out = Staying::default();
        for (sample, leaves) in leaves.into_iter().enumerate() {
            match leaves {
                Some(false) => out.here.push(sample),
                Some(true) => out.leaving += 1,
                None => out.lost += 1,
            }
        }
        if out.leaving > out.here.len() {
            out.here.clear();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_off_the_plateau_are_left_out_and_most_of_them_leave_no_interval() {
        let of = |leaving: usize| Staying::of((0..8).map(|s| Some(s < leaving)).chain([None]));
        let few = of(3);
        assert_eq!((few.here, few.leaving, few.lost), ((3..8).collect::<Vec<_>>(), 3, 1));
        assert_eq!(of(4).here.len(), 4, "half may leave");
        let most = of(5);
        assert_eq!((most.here.len(), most.leaving), (0, 5));
        assert_eq!(Staying::of([]), Staying::default());
    }
}
