//! All constraints of a simulation as one list of rows.

use super::admitted::Admitted;
use super::overclosures::Overclosures;
use crate::contact::{
    Candidates, ContactConstraint, ContactId, ContactJacobian, ContactLaw, GapRates, NO_RESPONSE, Stride,
};
use crate::corrector::{Gaps, rounding};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::state::{ContactState, Motion};

/// The constraints in the order given, their rows one after the other.
pub(crate) struct Constraints<'a, T: Real> {
    parts: Vec<Box<dyn ContactConstraint<T> + 'a>>,
    pub(crate) ids: Vec<ContactId>,
    laws: Vec<ContactLaw>,
    magnitudes: Vec<T>,
    /// Rows and rates of a constraint that is evaluated at another motion.
    scratch: ContactJacobian<T>,
    rates: Vec<GapRates<T>>,
    /// The free dofs that contact may ever act on, ascending.
    interface: Vec<usize>,
    /// For each dof of the system its place on the interface.
    places: Vec<usize>,
    admitted: Admitted,
    /// Whether candidates have changed since the rows were last read.
    stale: bool,
    /// Counts how often the rows have been read.
    version: u64,
    /// What is added to gaps that were negative at the start: by feature, and by row (empty if there is none).
    overclosures: Option<Overclosures<T>>,
    added: Vec<T>,
}

/// The place of a dof that no constraint has listed among those it may act on.
const UNKNOWN: usize = usize::MAX - 1;

impl<T: Real> std::fmt::Debug for Constraints<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Constraints").field("parts", &self.parts.len()).field("rows", &self.ids.len()).finish()
    }
}

impl<'a, T: Real> Constraints<'a, T> {
    /// The constraints after a search at (t, u, v), and room for the rows of their G (kept apart: corrections read G
    /// while they evaluate gaps), which the next search reads.
    pub(crate) fn new(
        mut parts: Vec<Box<dyn ContactConstraint<T> + 'a>>,
        (t, u, v): (f64, &[T], &[T]),
        prescribed: &[usize],
        admitted: Admitted,
    ) -> Result<(Self, ContactJacobian<T>)> {
        let dofs = u.len();
        for part in &mut parts {
            part.check(dofs)?;
            // Before its first search a constraint may have no rows.
            part.search(t, u, v, 0.0)?;
        }
        let mut interface = Vec::new();
        for part in &parts {
            part.dofs(&mut interface);
        }
        if let Some(&dof) = interface.iter().find(|&&dof| dof >= dofs) {
            return Err(Error::MissingDof { what: "a contact constraint", dof, dofs });
        }
        interface.sort_unstable();
        interface.dedup();
        let mut places = vec![UNKNOWN; dofs];
        for &dof in &interface {
            places[dof] = NO_RESPONSE;
        }
        interface.retain(|dof| prescribed.binary_search(dof).is_err());
        for (place, &dof) in interface.iter().enumerate() {
            places[dof] = place;
        }
        // (A sum that overflows is as absurd as one that does not fit into memory.)
        let promised = |count: fn(&Box<dyn ContactConstraint<T> + 'a>) -> usize, what| {
            parts.iter().map(count).try_fold(0_usize, usize::checked_add).ok_or(Error::OutOfMemory { what })
        };
        let rows = promised(ContactConstraint::max_candidates, "the contact problem")?;
        let entries = promised(ContactConstraint::max_entries, "the contact Jacobian")?;
        // Asked for once, so that an absurd promise is an error and not an abort: the largest block that is reserved.
        memory::reserve::<(usize, T)>(entries.max(rows), 1, "the contact Jacobian")?;
        let jacobian = ContactJacobian::with_capacity(rows, entries);
        let (ids, laws, magnitudes) = (Vec::with_capacity(rows), Vec::with_capacity(rows), Vec::with_capacity(rows));
        let constraints = Self {
            parts,
            ids,
            laws,
            magnitudes,
            scratch: ContactJacobian::with_capacity(rows, entries),
            rates: vec![GapRates::default(); rows],
            interface,
            places,
            admitted,
            stale: true,
            version: 0,
            overclosures: None,
            added: Vec::new(),
        };
        Ok((constraints, jacobian))
    }

    /// The largest number of rows there can be.
    pub(crate) fn capacity(&self) -> usize {
        self.parts.iter().map(ContactConstraint::max_candidates).sum()
    }

    /// The largest number of weights that all rows together can have.
    pub(crate) fn entries(&self) -> usize {
        self.parts.iter().map(ContactConstraint::max_entries).sum()
    }

    /// Finds the candidates of a step that imposes contact up to a time `ahead` of the motion.
    pub(crate) fn search(
        &mut self,
        motion: &Motion<T>,
        ahead: f64,
        jacobian: &mut ContactJacobian<T>,
    ) -> Result<Candidates> {
        for part in &mut self.parts {
            // This is kept if a later part fails: the next search that succeeds reads the rows again.
            self.stale |= part.search(motion.t, &motion.u, &motion.v, ahead)? == Candidates::Changed;
        }
        self.read_stale(jacobian)
    }

    /// Lets every constraint inspect the step that is about to be accepted.
    pub(crate) fn inspect(&mut self, [from, to]: [&Motion<T>; 2], closed: [&[bool]; 2]) -> Result<()> {
        let mut rest = closed;
        for (constraint, part) in self.parts.iter_mut().enumerate() {
            let count = part.candidates();
            let (own, others) = (rest.map(|flags| &flags[..count]), rest.map(|flags| &flags[count..]));
            let step = Stride { t: [from.t, to.t], u: [&from.u, &to.u], v: &from.v, closed: own };
            part.inspect(&step).map_err(|error| match error {
                Error::PassedThrough { t, h, contact, what, way, gap } => {
                    let contact = ContactId { constraint, ..contact };
                    Error::PassedThrough { t, h, contact, what, way, gap }
                }
                other => other,
            })?;
            rest = others;
        }
        Ok(())
    }

    /// Moves the linearization of the rows to u.
    pub(crate) fn follow(&mut self, t: f64, u: &[T], jacobian: &mut ContactJacobian<T>) -> Result<Candidates> {
        for constraint in 0..self.parts.len() {
            let moved = self.follow_part(constraint, t, u);
            // This is kept after an error, as in a search.
            self.stale |= match &moved {
                Ok(candidates) => *candidates == Candidates::Changed,
                Err(_) => true,
            };
            moved?;
        }
        self.read_stale(jacobian)
    }

    fn follow_part(&mut self, constraint: usize, t: f64, u: &[T]) -> Result<Candidates> {
        self.parts[constraint].follow(t, u).map_err(|error| match error {
            Error::ContactLost { t, contact } => Error::ContactLost { t, contact: ContactId { constraint, ..contact } },
            Error::ContactNotFinite { t, what, contact, value } => {
                Error::ContactNotFinite { t, what, contact: ContactId { constraint, ..contact }, value }
            }
            other => other,
        })
    }

    /// Whether rows never move within a step.
    pub(crate) fn is_affine(&self) -> bool {
        self.parts.iter().all(ContactConstraint::is_affine)
    }

    /// The version of the rows: what was computed from rows of another version is out of date.
    pub(crate) fn version(&self) -> u64 {
        self.version
    }

    /// Reads the rows if they may have changed.
    fn read_stale(&mut self, jacobian: &mut ContactJacobian<T>) -> Result<Candidates> {
        if !self.stale {
            return Ok(Candidates::Unchanged);
        }
        self.read_rows(jacobian)?;
        Ok(Candidates::Changed)
    }

    /// Reads ids, laws and G of all rows, and refuses what does not fit the memory reserved or the system.
    fn read_rows(&mut self, jacobian: &mut ContactJacobian<T>) -> Result<()> {
        let Self { parts, ids, laws, magnitudes, places, admitted, stale, .. } = self;
        let dofs = places.len();
        jacobian.clear();
        ids.clear();
        laws.clear();
        magnitudes.clear();
        *stale = true;
        for (constraint, part) in parts.iter().enumerate() {
            let candidates = part.candidates();
            if candidates > part.max_candidates() {
                let (expected, found) = (part.max_candidates(), candidates);
                return Err(Error::Dimension { what: "the list of candidates (at most)", expected, found });
            }
            let before = jacobian.rows();
            part.jacobian(jacobian);
            if jacobian.rows() - before != candidates {
                let found = jacobian.rows() - before;
                return Err(Error::Dimension { what: "the contact Jacobian", expected: candidates, found });
            }
            for row in 0..candidates {
                let (feature, candidate) = part.identity(row);
                ids.push(ContactId { constraint, feature, candidate });
                let law = part.law(row);
                law.check()?;
                law.check_scalar::<T>()?;
                admitted.check(law)?;
                laws.push(law);
                let magnitude = part.magnitude(row);
                if !magnitude.is_finite() {
                    let (what, value) = ("the magnitude of the coordinates of a contact row", magnitude.value());
                    return Err(Error::NotFinite { what, index: before + row, value });
                }
                magnitudes.push(magnitude);
                for (dof, weight) in jacobian.row(before + row) {
                    if dof >= dofs {
                        return Err(Error::MissingDof { what: "a contact row", dof, dofs });
                    }
                    if places[dof] == UNKNOWN {
                        let contact = ContactId { constraint, feature, candidate };
                        return Err(Error::UnannouncedDof { contact, dof });
                    }
                    if !weight.is_finite() {
                        let value = weight.value();
                        return Err(Error::NotFinite { what: "a weight of a contact row (by dof)", index: dof, value });
                    }
                }
            }
        }
        jacobian.locate(places);
        *stale = false;
        self.version += 1;
        self.distribute();
        Ok(())
    }

    /// Adds the depths at the start to the gaps from now on.
    pub(crate) fn adjust(&mut self, overclosures: Overclosures<T>) {
        self.overclosures = Some(overclosures);
        self.added.reserve(self.capacity());
        self.distribute();
    }

    /// What [`adjust`](Self::adjust) was given.
    pub(crate) fn overclosures(&self) -> Option<&Overclosures<T>> {
        self.overclosures.as_ref()
    }

    /// Finds for every row what is added to its gap.
    fn distribute(&mut self) {
        if let Some(overclosures) = &self.overclosures {
            self.added.clear();
            self.added.extend(self.ids.iter().map(|&id| overclosures.of(id)));
        }
    }

    /// The free dofs that contact may ever act on, ascending.
    pub(crate) fn interface(&self) -> &[usize] {
        &self.interface
    }

    /// The laws of all rows.
    pub(crate) fn laws(&self) -> &[ContactLaw] {
        &self.laws
    }

    /// Whether the condition of any row depends on the gap at the start of the stage.
    pub(crate) fn reads_start(&self) -> bool {
        self.laws.iter().any(ContactLaw::reads_start)
    }

    /// Whether any row is compliant.
    pub(crate) fn has_compliant(&self) -> bool {
        self.laws.iter().any(ContactLaw::is_compliant)
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    /// Gaps of all rows, refusing NaN and infinity.
    pub(crate) fn finite_gaps(&mut self, t: f64, u: &[T], out: &mut [T]) -> Result<()> {
        let mut rest = &mut *out;
        for part in &mut self.parts {
            let (own, others) = rest.split_at_mut(part.candidates());
            part.gap(t, u, own);
            rest = others;
        }
        if let Some(overclosures) = &self.overclosures {
            let share = T::of(overclosures.share(t)[0]);
            for (gap, &added) in out.iter_mut().zip(&self.added) {
                *gap += share * added;
            }
        }
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
        for part in &mut self.parts {
            let (own, others) = rest.split_at_mut(part.candidates());
            part.rates(t, u, v, own);
            rest = others;
        }
        if let Some(overclosures) = self.overclosures.as_ref().filter(|overclosures| overclosures.vary()) {
            let [_, rate, acceleration] = overclosures.share(t).map(T::of);
            for (rates, &added) in out.iter_mut().zip(&self.added) {
                rates.rate += rate * added;
                rates.acceleration += acceleration * added;
            }
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

    /// (contact, row) of the contacts of a state that are still candidates: a search may have changed these since.
    pub(crate) fn rows_of<'c>(&'c self, contacts: &'c ContactState<T>) -> impl Iterator<Item = (usize, usize)> + 'c {
        let (same, sorted) = (self.ids == contacts.ids, self.ids.is_sorted());
        let row = move |contact: usize, id: &ContactId| match (same, sorted) {
            (true, _) => Some(contact),
            (_, true) => self.ids.binary_search(id).ok(),
            _ => self.ids.iter().position(|other| other == id),
        };
        contacts.ids.iter().enumerate().filter_map(move |(contact, id)| row(contact, id).map(|row| (contact, row)))
    }

    /// Refuses rows that act on no free dof, and gaps that are not numbers.
    pub(crate) fn check_rows(
        &mut self,
        jacobian: &ContactJacobian<T>,
        prescribed: &[usize],
        t: f64,
        u: &[T],
    ) -> Result<()> {
        let mut gaps = vec![T::zero(); self.len()];
        self.finite_gaps(t, u, &mut gaps)?;
        for (row, &contact) in self.ids.iter().enumerate() {
            let acts = |(dof, weight): (usize, T)| weight != T::zero() && prescribed.binary_search(&dof).is_err();
            if !jacobian.row(row).any(acts) {
                return Err(Error::EmptyContact { contact });
            }
        }
        Ok(())
    }
}

impl<T: Real> Gaps<T> for Constraints<'_, T> {
    fn law(&self, row: usize) -> ContactLaw {
        self.laws[row]
    }

    fn gap_rounding(&self, row: usize, magnitude: T, gap: T) -> T {
        rounding(magnitude + gap.abs() + self.magnitudes[row])
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()> {
        self.finite_rates(t, u, v, out)
    }

    fn elsewhere(
        &mut self,
        field: usize,
        (t, [u, v, a]): (f64, [&[T]; 3]),
        here: (f64, &[T]),
        out: &mut [T],
    ) -> Result<()> {
        let mut first = 0;
        for constraint in 0..self.parts.len() {
            let found = self.follow_part(constraint, t, u);
            let Self { parts, scratch, rates, .. } = self;
            let part = &mut parts[constraint];
            let count = part.candidates();
            let out = &mut out[first..first + count];
            if field == 0 {
                part.gap(t, u, out);
            } else {
                scratch.clear();
                part.jacobian(scratch);
                part.rates(t, u, v, &mut rates[..count]);
                for (row, (out, own)) in out.iter_mut().zip(&*rates).enumerate() {
                    *out = match field {
                        1 => scratch.product(row, v) + own.rate,
                        _ => scratch.product(row, a) + own.acceleration,
                    };
                }
            }
            // Back to the same rows, after an error too: G need not be read again.
            let back = self.follow_part(constraint, here.0, here.1);
            self.stale |= back.is_err();
            found.and(back)?;
            first += count;
        }
        if let Some(overclosures) = &self.overclosures {
            let share = T::of(overclosures.share(t)[field.min(2)]);
            for (out, &added) in out.iter_mut().zip(&self.added) {
                *out += share * added;
            }
        }
        self.refuse_infinite(t, ["the gap", "the gap rate", "the gap acceleration"][field.min(2)], out)
    }
}
