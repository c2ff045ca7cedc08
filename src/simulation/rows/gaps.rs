//! Gaps of all rows and their rates, at the current motion and at other motions.

use crate::contact::{ContactLaw, GapRates, Rates, Tangents, Variation};
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::rows::constraints::{Constraints, Scratch};
use crate::simulation::rows::part::{gather, of};

impl<T: Real> Constraints<'_, T> {
    /// Gaps of all rows, refusing NaN and infinity.
    pub(crate) fn finite_gaps(&mut self, t: f64, u: &[T], out: &mut [T]) -> Result<()> {
        let Self { parts, scratch: Scratch { local, .. }, .. } = self;
        let mut rest = &mut *out;
        for (number, part) in parts.iter_mut().enumerate() {
            let (own, others) = rest.split_at_mut(part.contacts.len());
            if !own.is_empty() {
                let u = gather(&part.dofs, u, &mut local.u);
                part.constraint.gaps(t, u, own).map_err(|error| of(number, error))?;
            }
            rest = others;
        }
        self.offsets.add_to(t, 0, out);
        self.refuse_infinite(t, "the gap", out)
    }

    /// Refuses values of the rows that are NaN or infinite.
    fn refuse_infinite(&self, t: f64, what: &'static str, out: &[T]) -> Result<()> {
        match out[..self.len()].iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(row) => Err(Error::ContactNotFinite { t, what, contact: self.ids[row], value: out[row].value() }),
        }
    }

    /// The parts of the gap rates of all rows that do not come from v and a, refusing NaN and infinity.
    pub(crate) fn finite_rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()> {
        let mut rest = &mut *out;
        for number in 0..self.parts.len() {
            let (own, others) = rest.split_at_mut(self.parts[number].contacts.len());
            self.rates_of(number, (t, u, v), own)?;
            rest = others;
        }
        self.offsets.add_to_rates(t, out);
        if self.parts.iter().all(|part| part.rates == Some(Rates::Zero)) {
            return Ok(());
        }
        for (&contact, rates) in self.ids.iter().zip(&*out) {
            for (what, value) in [("the gap rate", rates.rate), ("the gap acceleration", rates.acceleration)] {
                if !value.is_finite() {
                    return Err(Error::ContactNotFinite { t, what, contact, value: value.value() });
                }
            }
        }
        Ok(())
    }

    /// The parts of the gap rates that do not come from v and a: as a constraint gives them, or from differences of
    /// gaps.
    fn rates_of(&mut self, number: usize, (t, u, v): (f64, &[T], &[T]), out: &mut [GapRates<T>]) -> Result<()> {
        if out.is_empty() {
            return Ok(());
        }
        let Self { parts, scratch: Scratch { local, differences, .. }, ahead, .. } = self;
        let part = &mut parts[number];
        if part.rates == Some(Rates::Zero) {
            out.fill(GapRates::default());
            return Ok(());
        }
        let (u, v) = (gather(&part.dofs, u, &mut local.u), gather(&part.dofs, v, &mut local.v));
        let answer = part.constraint.rates(t, u, v, out).map_err(|error| of(number, error))?;
        part.rates = Some(answer);
        match answer {
            Rates::Given => Ok(()),
            Rates::Zero => {
                out.fill(GapRates::default());
                Ok(())
            }
            Rates::Differences => differences.find(part, (t, u, v), *ahead, out).map_err(|error| of(number, error)),
        }
    }

    /// The parts of the slip rates that do not come from v and a, one entry per tangential row.
    pub(crate) fn finite_slip_rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()> {
        let Self { parts, ids, tangents, scratch: Scratch { slip_rates, local, .. }, .. } = self;
        let (mut contact, mut filled) = (0, 0);
        for (number, part) in parts.iter_mut().enumerate() {
            let first = contact;
            contact += part.contacts.len();
            if !part.contacts.has_friction() {
                continue;
            }
            let rows = part.contacts.tangent_rows().rows();
            slip_rates.clear();
            slip_rates.resize(rows, GapRates::default());
            if part.slip_rates != Some(Rates::Zero) {
                let (u, v) = (gather(&part.dofs, u, &mut local.u), gather(&part.dofs, v, &mut local.v));
                let answer = part.constraint.slip_rates(t, u, v, slip_rates).map_err(|error| of(number, error))?;
                match answer {
                    Rates::Given => {}
                    Rates::Zero => slip_rates.fill(GapRates::default()),
                    Rates::Differences => {
                        return Err(Error::Incompatible {
                            part: format!("constraint {number}, with friction"),
                            reason: "the motion of its surface along itself does not follow from differences of the \
                                     gaps; give the rates of slip",
                        });
                    }
                }
                part.slip_rates = Some(answer);
            }
            for row in (first..contact).filter(|&row| !tangents.of(row).is_empty()) {
                for rates in &slip_rates[part.contacts.tangents_of(row - first)] {
                    for (what, value) in [("the slip rate", rates.rate), ("the slip acceleration", rates.acceleration)]
                    {
                        if !value.is_finite() {
                            let value = value.value();
                            return Err(Error::ContactNotFinite { t, what, contact: ids[row], value });
                        }
                    }
                    out[filled] = *rates;
                    filled += 1;
                }
            }
        }
        Ok(())
    }

    /// Whether the rates of a row are not differences of its gaps.
    pub(crate) fn gives_rates(&self, row: usize) -> bool {
        self.parts[self.ids[row].constraint].rates != Some(Rates::Differences)
    }
}

impl<T: Real> Gaps<T> for Constraints<'_, T> {
    fn law(&self, row: usize) -> ContactLaw {
        self.laws[row]
    }

    fn turn(&self) -> bool {
        !self.is_affine()
    }

    fn gap_rounding(&self, row: usize, magnitude: T, gap: T) -> T {
        rounding(magnitude + gap.abs() + self.magnitudes[row])
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()> {
        self.finite_rates(t, u, v, out)
    }

    fn tangents(&self) -> &Tangents {
        &self.tangents
    }

    fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()> {
        self.finite_slip_rates(t, u, v, out)
    }

    fn elsewhere(
        &mut self,
        field: usize,
        (t, [u, v, a]): (f64, [&[T]; 3]),
        here: (f64, &[T]),
        out: &mut [T],
    ) -> Result<()> {
        let mut first = 0;
        for number in 0..self.parts.len() {
            let found = self.follow_part(number, t, u).and_then(|_| {
                let count = self.parts[number].contacts.len();
                let out = &mut out[first..first + count];
                if out.is_empty() {
                    return Ok(());
                }
                if field == 0 {
                    let Self { parts, scratch: Scratch { local, .. }, .. } = self;
                    let part = &mut parts[number];
                    let u = gather(&part.dofs, u, &mut local.u);
                    return part.constraint.gaps(t, u, out).map_err(|error| of(number, error));
                }
                let mut rates = std::mem::take(&mut self.scratch.rates);
                rates.resize(count.max(rates.len()), GapRates::default());
                let found = self.rates_of(number, (t, u, v), &mut rates[..count]);
                let Self { parts, scratch: Scratch { local, contacts: other, .. }, .. } = self;
                let part = &mut parts[number];
                let contacts = match part.variation {
                    Variation::Follows => {
                        other.clear();
                        part.constraint.contacts(other);
                        other
                    }
                    _ => &mut part.contacts,
                };
                let x = gather(&part.dofs, if field == 1 { v } else { a }, &mut local.other);
                for (row, (out, own)) in out.iter_mut().zip(&rates).enumerate() {
                    let own = if field == 1 { own.rate } else { own.acceleration };
                    *out = contacts.rows().product(row, x) + own;
                }
                self.scratch.rates = rates;
                found
            });
            // Linearizes the same rows again, after an error too: G need not be read again.
            let back = self.follow_part(number, here.0, here.1);
            self.parts[number].stale |= back.is_err();
            self.reading.stale |= back.is_err();
            found.and(back)?;
            first += self.parts[number].contacts.len();
        }
        self.offsets.add_to(t, field.min(2), out);
        self.refuse_infinite(t, ["the gap", "the gap rate", "the gap acceleration"][field.min(2)], out)
    }
}
