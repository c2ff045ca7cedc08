//! Overlaps at the start of a run: their depths, and the share of them that is left later.

#[cfg(feature = "serde")]
use super::read::{finite, number, positive};
use crate::contact_id::ContactId;
#[cfg(feature = "serde")]
use crate::error::Result;
use crate::real::Real;

/// Depths of overlaps at the start of a run, which are added to the gaps from then on, or for a time.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Overclosures<T> {
    /// (constraint, feature) and the depth, ascending.
    depths: Vec<((usize, usize), T)>,
    start: f64,
    /// The time over which they are removed.
    over: Option<f64>,
}

impl<T: Real> Overclosures<T> {
    /// From the gaps of contacts at the start. The deepest contact of each feature counts.
    pub(crate) fn new(gaps: &[(ContactId, T)], start: f64, over: Option<f64>) -> Self {
        let mut depths: Vec<((usize, usize), T)> = Vec::new();
        for &(id, gap) in gaps {
            let feature = (id.constraint, id.feature);
            match depths.iter_mut().find(|(other, _)| *other == feature) {
                Some((_, depth)) => *depth = depth.max(-gap),
                None => depths.push((feature, -gap)),
            }
        }
        depths.sort_unstable_by_key(|(feature, _)| *feature);
        Self { depths, start, over }
    }

    /// Checks overclosures read from a checkpoint, and refuses values that no run produces.
    #[cfg(feature = "serde")]
    pub(super) fn check_read(&self) -> Result<()> {
        finite("the start of the overclosures of a checkpoint", self.start)?;
        self.over.map_or(Ok(()), |over| positive("the time over which overclosures are removed", over))?;
        self.depths.iter().try_for_each(|(_, depth)| finite("an overclosure of a checkpoint", depth.value()))?;
        self.depths.windows(2).try_for_each(|pair| {
            let feature = pair[1].0.1 as f64;
            number("a feature of the overclosures of a checkpoint", feature, "ascending", |_| pair[0].0 < pair[1].0)
        })
    }

    /// Whether the depths are removed over time.
    pub(crate) fn vary(&self) -> bool {
        self.over.is_some()
    }

    /// The share that is left at t, with its first two derivatives.
    pub(crate) fn share(&self, t: f64) -> [f64; 3] {
        let Some(over) = self.over else { return [1.0, 0.0, 0.0] };
        let x = ((t - self.start) / over).max(0.0);
        if x >= 1.0 {
            return [0.0; 3];
        }
        [1.0 - x * x * (3.0 - 2.0 * x), -6.0 * x * (1.0 - x) / over, (12.0 * x - 6.0) / (over * over)]
    }

    /// The depth of a contact.
    pub(crate) fn of(&self, id: ContactId) -> T {
        let found = self.depths.binary_search_by_key(&(id.constraint, id.feature), |(feature, _)| *feature);
        found.map_or(T::zero(), |at| self.depths[at].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_that_is_left_falls_smoothly_with_the_derivatives_that_it_says() {
        let (start, over) = (0.7, 2.5);
        let overclosures = Overclosures::<f64>::new(&[], start, Some(over));
        let share = |t: f64| overclosures.share(t);
        let [first, last] = [share(start), share(start + over)];
        assert!((first[0] - 1.0).abs() < 1e-15 && first[1].abs() < 1e-15, "{first:?}");
        assert!(last.iter().all(|x| x.abs() < 1e-15), "{last:?}");
        let d = 1e-5;
        for t in [0.9, 1.3, 1.95, 2.4, 3.1] {
            let [before, here, after] = [-d, 0.0, d].map(|by| share(t + by));
            let slopes = [0, 1].map(|k| (after[k] - before[k]) / (2.0 * d));
            assert!((slopes[0] - here[1]).abs() < 1e-9 && (slopes[1] - here[2]).abs() < 1e-9, "{t}: {here:?}");
            assert!((0.0..1.0).contains(&here[0]) && here[1] < 0.0, "{t}: {here:?}");
        }
    }
}
