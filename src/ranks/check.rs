//! Checks of ranks when a run is built: numbers that must agree, ownership, and the order of the contact dofs.

use super::{Ranks, Together};
use crate::error::{Error, Result};
use crate::real::Real;

/// Rejects ranges that do not ascend or exceed the dofs of the rank.
pub(crate) fn check_owned<T: Real>(ranks: &dyn Ranks<T>, dofs: usize) -> Result<()> {
    let mut end = 0;
    for range in ranks.owned() {
        if range.start < end || range.end < range.start {
            let part = format!("the dofs {range:?} owned by rank {}", ranks.rank());
            return Err(Error::Incompatible { part, reason: "the ranges must ascend and not overlap" });
        }
        end = range.end;
        if end > dofs {
            return Err(Error::MissingDof { what: "the dofs owned by a rank", dof: end - 1, dofs });
        }
    }
    Ok(())
}

/// Rejects numbers that differ between ranks.
pub(crate) fn check_alike<T: Real, const N: usize>(
    together: &Together<T>,
    names: [&'static str; N],
    values: [f64; N],
) -> Result<()> {
    if together.is_alone() {
        return Ok(());
    }
    let largest = together.max(Ok(values))?;
    let smallest = together.max(Ok(values.map(|value| -value)))?.map(|value| -value);
    for (what, [smallest, largest]) in
        names.into_iter().zip(std::array::from_fn::<_, N, _>(|k| [smallest[k], largest[k]]))
    {
        if smallest.to_bits() != largest.to_bits() {
            return Err(Error::RanksDiffer { what, smallest, largest });
        }
    }
    Ok(())
}

/// Rejects contact dofs with no owner or several, or with different orders on different ranks.
pub(crate) fn check_interface<T: Real>(together: &Together<T>, dofs: usize, interface: &[usize]) -> Result<()> {
    if together.is_alone() {
        return Ok(());
    }
    let mut marks = vec![T::zero(); dofs];
    for (place, &dof) in interface.iter().enumerate() {
        let [owners] = together.sum(Ok([f64::from(u8::from(together.owns(dof)))]))?;
        if owners.to_bits() != 1.0_f64.to_bits() {
            let what = "the number of owners of a contact dof";
            return Err(Error::RanksDiffer { what, smallest: owners, largest: 1.0 });
        }
        if together.owns(dof) {
            marks[dof] = T::of((place + 1) as f64);
        }
    }
    together.share(&mut marks)?;
    let place_of_owner = |(place, &dof): (usize, &usize)| (marks[dof].value() - (place + 1) as f64).abs();
    let apart = interface.iter().enumerate().map(place_of_owner).fold(0.0, f64::max);
    let [apart] = together.max(Ok([apart]))?;
    if apart > 0.0 {
        let what = "the place of a contact dof in the order of all (or its owner's value, as it was shared)";
        return Err(Error::RanksDiffer { what, smallest: 0.0, largest: apart });
    }
    Ok(())
}
