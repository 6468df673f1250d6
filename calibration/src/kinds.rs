//! Samples that answer a load in another way than the most probable knee: subluxed, or in another equilibrium.
//!
//! A mean and an interval over knees of two kinds are of neither. So the samples of another kind are counted; they stay in the interval.

use sim::coordinate::{FREE, Free};
use sim::flags::{Difference, Flag};

/// A gap between neighbouring poses that parts two equilibria [mm]: a second search for an equilibrium begins as far beside the first
/// (docs/theory/solver.md). Ours.
const GAP_MM: f64 = 4.0;
/// The same of rotations [deg].
const GAP_DEG: f64 = 8.0;

/// Of the samples that stay on the plateau under one load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kinds {
    /// How many there are.
    pub here: usize,
    /// How many are subluxed.
    pub subluxed: usize,
    /// How many are turned further than knees turn.
    pub rotated: usize,
    /// How many a gap parts from the most probable knee.
    pub elsewhere: usize,
}

impl Kinds {
    /// Of the most probable knee's pose, and of samples on the plateau: their poses, and whether each is subluxed, and rotated beyond any knee.
    pub fn of(own: Option<&Free<f64>>, here: impl IntoIterator<Item = (Free<f64>, [bool; 2])>) -> Kinds {
        let (poses, odd): (Vec<Free<f64>>, Vec<[bool; 2]>) = here.into_iter().unzip();
        let count = |k: usize| odd.iter().filter(|is| is[k]).count();
        Kinds {
            here: poses.len(),
            subluxed: count(0),
            rotated: count(1),
            elsewhere: own.map_or(0, |own| elsewhere(own, &poses)),
        }
    }

    /// What is told of them beside the flags of the most probable knee, of `asked` samples.
    pub fn flags(&self, most_probable: &[Flag], asked: usize) -> Vec<Flag> {
        let (subluxed, not) = match most_probable.contains(&Flag::Subluxed) {
            true => (0, self.here - self.subluxed),
            false => (self.subluxed, 0),
        };
        let rotated = if most_probable.contains(&Flag::Rotated) { 0 } else { self.rotated };
        let stay = if most_probable.contains(&Flag::Dislocated) { self.here } else { 0 };
        let counts = [
            (Difference::OnPlateau, stay),
            (Difference::Subluxed, subluxed),
            (Difference::NotSubluxed, not),
            (Difference::Rotated, rotated),
            (Difference::Elsewhere, self.elsewhere),
        ];
        let told = counts.into_iter().filter(|(_, count)| *count > 0);
        told.map(|(how, count)| Flag::SamplesDiffer { how, count, of: asked }).collect()
    }
}

/// How many poses a gap along some coordinate parts from `own`, and from all on its side.
fn elsewhere(own: &Free<f64>, poses: &[Free<f64>]) -> usize {
    let mut parted = vec![false; poses.len()];
    for c in FREE {
        let gap = if c.unit() == "deg" { GAP_DEG } else { GAP_MM };
        for towards in [-1.0, 1.0] {
            let mut along: Vec<(f64, usize)> = poses
                .iter()
                .enumerate()
                .map(|(k, p)| (towards * (p[c] - own[c]), k))
                .filter(|(x, _)| *x > 0.0)
                .collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut last = 0.0;
            let first = along.iter().position(|(x, _)| {
                let is_far = x - last > gap;
                last = *x;
                is_far
            });
            along.iter().skip(first.unwrap_or(along.len())).for_each(|(_, k)| parted[*k] = true);
        }
    }
    parted.iter().filter(|p| **p).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::{AP, IE};

    fn at(ap: f64, ie: f64) -> Free<f64> {
        let mut pose = Free::default();
        (pose[AP], pose[IE]) = (ap, ie);
        pose
    }

    fn kinds(own: &Free<f64>, poses: &[Free<f64>]) -> Kinds {
        Kinds::of(Some(own), poses.iter().map(|p| (*p, [false; 2])))
    }

    #[test]
    fn samples_beyond_a_gap_are_elsewhere_and_those_of_a_wide_scatter_are_not() {
        let own = at(0.0, 0.0);
        // as wide as two equilibria are apart, and without a gap
        let wide: Vec<Free<f64>> = (-10..=10).map(|k| at(f64::from(k), -2.0 * f64::from(k))).collect();
        assert_eq!(kinds(&own, &wide), Kinds { here: 21, ..Kinds::default() });
        let near = [0.5, -1.0, 1.5, 2.0].map(|ap| at(ap, 0.0));
        let two: Vec<Free<f64>> = near.into_iter().chain([at(-9.0, 0.0), at(-9.5, 1.0), at(1.0, 12.0)]).collect();
        assert_eq!(kinds(&own, &two).elsewhere, 3);
        // counted from the most probable knee, wherever most samples are
        assert_eq!(kinds(&at(-9.0, 0.0), &two).elsewhere, 5);
        assert_eq!(Kinds::of(None, two.into_iter().map(|p| (p, [false; 2]))).elsewhere, 0);
    }

    #[test]
    fn samples_are_told_of_where_they_are_not_as_the_most_probable_knee() {
        let found = Kinds { here: 40, subluxed: 6, ..Kinds::default() };
        let told = |own: &[Flag]| sim::flags::sentences(&found.flags(own, 48));
        assert_eq!(told(&[]), ["6 of 48 samples are subluxed"]);
        assert_eq!(told(&[Flag::Subluxed]), ["34 of 48 samples are not subluxed"]);
        assert_eq!(told(&[Flag::Dislocated]), ["40 of 48 samples stay on the plateau", "6 of 48 samples are subluxed"]);
        let turned = Kinds { here: 40, rotated: 2, ..Kinds::default() };
        assert_eq!(turned.flags(&[], 48)[0].to_string(), "2 of 48 samples are rotated beyond any knee");
        assert!(turned.flags(&[Flag::Rotated], 48).is_empty());
        assert!(Kinds { here: 40, ..Kinds::default() }.flags(&[], 48).is_empty());
        assert!(Kinds { here: 40, subluxed: 40, ..Kinds::default() }.flags(&[Flag::Subluxed], 48).is_empty());
        let apart = Kinds { elsewhere: 2, ..Kinds::default() }.flags(&[], 48);
        assert_eq!(sim::flags::sentences(&apart), ["2 of 48 samples rest elsewhere"]);
    }
}
