//! Agreement between ranks: sums, largest values, and that none has failed.

use super::Ranks;
use crate::error::{Error, Result};
use crate::real::Real;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of sums in one message. Every request to the ranks starts with this many values, so that a rank that has
/// failed and reports it is understood by ranks that wait in another request.
const SUMS: usize = 6;

/// Number of words in the message of a failed rank, six bytes each: an f64 represents integers below 2⁴⁸ exactly.
const WORDS: usize = 40;
const BYTES: usize = 6;

/// The ranks of a run, or none.
#[derive(Clone, Debug)]
pub(crate) struct Together<T: Real> {
    ranks: Option<Arc<Agreement<T>>>,
}

#[derive(Debug)]
struct Agreement<T: Real> {
    ranks: Arc<dyn Ranks<T>>,
    /// Whether all ranks know of the failure that is being returned.
    announced: AtomicBool,
}

impl<T: Real> Together<T> {
    /// With the ranks of a system, if it has any.
    pub(crate) fn new(ranks: Option<Arc<dyn Ranks<T>>>) -> Self {
        Self { ranks: ranks.map(|ranks| Arc::new(Agreement { ranks, announced: AtomicBool::new(false) })) }
    }

    /// Whether there are no other ranks.
    pub(crate) fn is_alone(&self) -> bool {
        self.ranks.is_none()
    }

    /// The parts of a vector of `dofs` entries that this rank owns.
    pub(crate) fn owned(&self, dofs: usize) -> impl Iterator<Item = Range<usize>> {
        let all = self.ranks.is_none().then_some(0..dofs);
        all.into_iter().chain(self.ranks.iter().flat_map(|agreement| agreement.ranks.owned().iter().cloned()))
    }

    /// Whether this rank owns a dof.
    pub(crate) fn owns(&self, dof: usize) -> bool {
        let Some(agreement) = &self.ranks else { return true };
        let owned = agreement.ranks.owned();
        owned[..owned.partition_point(|range| range.start <= dof)].last().is_some_and(|range| range.contains(&dof))
    }

    /// Distributes the values of owners.
    pub(crate) fn share(&self, values: &mut [T]) -> Result<()> {
        let Some(agreement) = &self.ranks else { return Ok(()) };
        let result = agreement.ranks.share(values);
        agreement.unreachable(result)
    }

    /// The scalar product over all dofs.
    pub(crate) fn dot(&self, x: &[T], y: &[T]) -> Result<T> {
        let [sum] = self.sum(Ok([self.part_of_dot(x, y).value()]))?;
        Ok(T::of(sum))
    }

    /// This rank's part of the scalar product over all dofs.
    pub(crate) fn part_of_dot(&self, x: &[T], y: &[T]) -> T {
        let products = |part: Range<usize>| x[part.clone()].iter().zip(&y[part]).map(|(&x, &y)| x * y).sum::<T>();
        self.owned(x.len()).map(products).sum()
    }

    /// This rank's part of the work of a force along a displacement increment.
    pub(crate) fn part_of_work(&self, [from, to]: [&[T]; 2], force: impl Fn(usize) -> T) -> T {
        let own = |part: Range<usize>| part.map(|dof| (to[dof] - from[dof]) * force(dof)).sum::<T>();
        self.owned(to.len()).map(own).sum()
    }

    /// Fails on all ranks if one has failed.
    pub(crate) fn agree<R>(&self, result: Result<R>) -> Result<R> {
        let Some(agreement) = &self.ranks else { return result };
        match result {
            Ok(value) => agreement.sum(Ok([])).map(|[]| value),
            // If one has failed there is no sum.
            Err(error) => agreement.sum(Err(error)).and_then(|[]| Err(Error::Poisoned)),
        }
    }

    /// Sums over all ranks; fails on all if one has failed.
    pub(crate) fn sum<const N: usize>(&self, part: Result<[f64; N]>) -> Result<[f64; N]> {
        match &self.ranks {
            None => part,
            Some(agreement) => agreement.sum(part),
        }
    }

    /// The largest values over all ranks; fails on all if one has failed.
    pub(crate) fn max<const N: usize>(&self, part: Result<[f64; N]>) -> Result<[f64; N]> {
        let Some(agreement) = &self.ranks else { return part };
        let mut values = self.agree(part)?;
        agreement.unreachable(agreement.ranks.max(&mut values))?;
        Ok(values)
    }

    /// Ends an operation that can fail as a whole, a step or a build: the error is not passed to another agreement.
    pub(crate) fn finish<R>(&self, result: Result<R>) -> Result<R> {
        let result = self.agree(result);
        self.caught();
        result
    }

    /// A failure that all ranks know of ends here.
    pub(crate) fn caught(&self) {
        if let Some(agreement) = &self.ranks {
            agreement.announced.store(false, Ordering::Relaxed);
        }
    }
}

impl<T: Real> Agreement<T> {
    /// Sums values together with the number of ranks that have failed unrecoverably and recoverably.
    fn sum<const N: usize>(&self, part: Result<[f64; N]>) -> Result<[f64; N]> {
        const { assert!(N <= SUMS, "more sums than travel together") };
        let mut values = [0.0; SUMS + 2];
        let own = match part {
            Ok(part) => {
                values[..N].copy_from_slice(&part);
                None
            }
            // All ranks know, and none waits for this one.
            Err(error) if self.announced.load(Ordering::Relaxed) => return Err(error),
            Err(error) => {
                values[if error.is_recoverable() { SUMS + 1 } else { SUMS }] = 1.0;
                Some(error)
            }
        };
        self.unreachable(self.ranks.sum(&mut values))?;
        let [lost, refused] = [values[SUMS], values[SUMS + 1]];
        if lost + refused > 0.0 {
            self.announced.store(true, Ordering::Relaxed);
            return Err(self.report(own, lost > 0.0)?);
        }
        let mut sums = [0.0; N];
        sums.copy_from_slice(&values[..N]);
        Ok(sums)
    }

    /// The error of this rank: its own, or the message of the first rank with the worst failure.
    fn report(&self, own: Option<Error>, lost: bool) -> Result<Error> {
        let own = own.filter(|error| error.is_recoverable() != lost);
        let number = self.ranks.rank() as f64;
        let mut first = [if own.is_some() { -number } else { f64::NEG_INFINITY }];
        self.unreachable(self.ranks.max(&mut first))?;
        let speaks = own.is_some() && first[0].to_bits() == (-number).to_bits();
        let mut words = [0.0; WORDS];
        if let Some(error) = own.as_ref().filter(|_| speaks) {
            write_words(&error.to_string(), &mut words);
        }
        self.unreachable(self.ranks.sum(&mut words))?;
        // Rank numbers are exact in f64.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of a rank")]
        let rank = -first[0] as usize;
        Ok(own.unwrap_or_else(|| Error::OtherRank { rank, recoverable: !lost, message: read_words(&words) }))
    }

    /// If ranks cannot be reached, no further requests are made.
    fn unreachable<R>(&self, result: Result<R>) -> Result<R> {
        result.inspect_err(|_| self.announced.store(true, Ordering::Relaxed))
    }
}

/// Encodes a text as numbers, truncated to fit.
fn write_words(text: &str, words: &mut [f64]) {
    let mut end = text.len().min(words.len() * BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    for (word, bytes) in words.iter_mut().zip(text.as_bytes()[..end].chunks(BYTES)) {
        *word = bytes.iter().rev().fold(0.0, |word, &byte| 256.0 * word + f64::from(byte));
    }
}

/// Decodes the text of such numbers.
fn read_words(words: &[f64]) -> String {
    let mut bytes = Vec::with_capacity(words.len() * BYTES);
    for &word in words {
        let mut rest = word;
        for _ in 0..BYTES {
            let byte = rest % 256.0;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
            bytes.push(byte as u8);
            rest = (rest - byte) / 256.0;
        }
    }
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_travel_as_numbers() {
        for text in ["", "ω", "the host's force failed: element 17", &"long ä".repeat(100)] {
            let mut words = [0.0; WORDS];
            write_words(text, &mut words);
            let read = read_words(&words);
            assert!(text.starts_with(&read) && read.len() >= text.len().min(WORDS * BYTES - 1), "{read}");
        }
    }
}
