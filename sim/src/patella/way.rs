//! The way of the patella to a pose of the knee: on the branch of equilibria where it rested last, as long as that goes on.

use super::Patella;
use crate::condensed::{Rest, settle};
use crate::coordinate::Six;

/// Furthest the knee goes between two equilibria of the patella that are sought one from the other [rad, mm].
const STRIDE: [f64; 6] = [0.15, 0.15, 0.15, 6.0, 6.0, 6.0];
/// Within this part of a stride the patella is not led [-]: it is sought at once.
const AT_ONCE: f64 = 0.1;
/// A stride is halved where the patella ends further than this from its extrapolated motion [mm, angles times 20 mm]; ours.
const DEPARTURE: f64 = 1.0;
/// Least stride, of the whole one [-]: where it still departs, the branch ends and the patella snaps.
const LEAST_STRIDE: f64 = 1.0 / 32.0;
/// More strides than this are no motion of a knee [-].
const MOST_STRIDES: f64 = 1e3;
/// Tension with which the patella is first laid on the trochlea [N]; it is doubled until it is all there.
const FIRST_TENSION: f64 = 10.0;

impl Patella {
    /// At rest in the CT pose.
    pub(super) fn laid(&self) -> Rest {
        let (at, pose) = (Six::zeros(), self.knee.pose(&Six::zeros()));
        let mut rest = Rest::known(&at, vec![0.0; 6]);
        let mut tension = FIRST_TENSION;
        while tension < self.tension {
            settle(&self.with_tension(tension), (&at, &pose), &mut rest);
            tension *= 2.0;
        }
        settle(self, (&at, &pose), &mut rest);
        rest
    }

    /// Brings the patella near the knee's coordinates `q`, from where it rests, in strides; one that leaves the branch is taken again by halves.
    pub(super) fn lead(&self, q: &Six, rest: &mut Rest) {
        let Some(from) = rest.at() else { return };
        let moved = q - from;
        let strides = (0..6).map(|i| (moved[i] / STRIDE[i]).abs()).fold(0.0, f64::max);
        if !(strides > AT_ONCE && strides < MOST_STRIDES) {
            return;
        }
        let (longest, shortest) = ((1.0 / strides).min(1.0), (LEAST_STRIDE / strides).min(1.0));
        let (mut done, mut size) = (0.0, longest);
        while done < 1.0 {
            let next = if done + size > 1.0 - 1e-9 { 1.0 } else { done + size };
            let at = from + moved * next;
            let (predicted, before) = (rest.extrapolated(&at), rest.clone());
            settle(self, (&at, &self.knee.pose(&at)), rest);
            let departure = rest.inner().iter().zip(predicted).map(|(u, p)| (u - p).abs()).fold(0.0, f64::max);
            if departure > DEPARTURE && size > shortest {
                *rest = before;
                size = (0.5 * size).max(shortest);
            } else {
                done = next;
                size = (2.0 * size).min(longest);
            }
        }
    }
}
