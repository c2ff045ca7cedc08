//! All constraints of a simulation as one list of rows.

use crate::contact::{
    BrokenBond, Candidates, ContactConstraint, ContactId, ContactJacobian, Contacts, GapRates, NO_RESPONSE, Stride,
    Tangents, Variation, kept_depth,
};
use crate::contact_solver::AdmissibleSet;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::build::law_support::LawSupport;
use crate::simulation::rows::gap_offsets::GapOffsets;
use crate::simulation::rows::laws::Laws;
use crate::simulation::rows::part::{Local, Part, gather, of};
use crate::simulation::rows::rate_differences::RateDifferences;
use crate::state::{ContactState, Motion, Names};

/// The constraints in the order given, their rows one after the other.
pub(crate) struct Constraints<'a, T: Real> {
    pub(crate) parts: Vec<Part<'a, T>>,
    pub(crate) ids: Vec<ContactId>,
    pub(crate) laws: Laws,
    pub(crate) tangents: Tangents,
    pub(crate) magnitudes: Vec<T>,
    pub(crate) offsets: GapOffsets<T>,
    interface: Interface,
    law_support: LawSupport,
    pub(crate) reading: Reading,
    /// Time by which the last search looked ahead.
    pub(crate) ahead: f64,
    pub(crate) scratch: Scratch<T>,
}

/// The dofs that contact may ever act on.
struct Interface {
    /// The free ones, ascending.
    dofs: Vec<usize>,
    /// Interface index of each dof of the system; `UNKNOWN` or `NO_RESPONSE` for dofs that are not on the interface.
    places: Vec<usize>,
}

/// Whether the rows have to be read again, and how often they have been.
pub(crate) struct Reading {
    /// Whether candidates have changed since the rows were last read.
    pub(crate) stale: bool,
    /// Number of times the rows have been read, and version of their names.
    version: u64,
    names: Names,
    /// The tangents before the rows were read again.
    old_tangents: Tangents,
}

/// Memory for the evaluation of constraints.
#[derive(Default)]
pub(crate) struct Scratch<T> {
    /// Rows and rates of a constraint that is evaluated at another motion.
    pub(crate) contacts: Contacts<T>,
    pub(crate) rates: Vec<GapRates<T>>,
    pub(crate) slip_rates: Vec<GapRates<T>>,
    pub(crate) local: Local<T>,
    pub(crate) differences: RateDifferences<T>,
    /// Bonds that break in a step, and features of all broken bonds of one constraint.
    overloads: Vec<(usize, f64)>,
    features: Vec<usize>,
}

/// The interface index of a dof on which no constraint may act.
const UNKNOWN: usize = usize::MAX - 1;

impl<T: Real> std::fmt::Debug for Constraints<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Constraints").field("parts", &self.parts.len()).field("rows", &self.ids.len()).finish()
    }
}

impl<'a, T: Real> Constraints<'a, T> {
    /// The constraints after a search at (t, u, v) with the `broken` bonds, and a G that is empty until the next
    /// search reads its rows. G is kept apart because corrections read it while they evaluate gaps.
    pub(crate) fn new(
        parts: Vec<Box<dyn ContactConstraint<T> + 'a>>,
        (t, u, v): (f64, &[T], &[T]),
        prescribed: &[usize],
        broken: &[BrokenBond],
        law_support: LawSupport,
    ) -> Result<(Self, ContactJacobian<T>)> {
        let dofs = u.len();
        if let Some(bond) = broken.iter().find(|bond| bond.constraint >= parts.len()) {
            let part = format!("a broken bond of constraint {}", bond.constraint);
            return Err(Error::Incompatible { part, reason: "the run that is continued had more constraints" });
        }
        let mut places = vec![UNKNOWN; dofs];
        let (mut seen, mut local) = (vec![usize::MAX; dofs], Local::default());
        let (mut own, mut interface) = (Vec::with_capacity(parts.len()), Vec::new());
        let mut features = Vec::new();
        for (number, mut constraint) in parts.into_iter().enumerate() {
            let list = constraint.dofs().to_vec();
            for &dof in &list {
                match seen.get(dof) {
                    None => return Err(Error::MissingContactDof { constraint: number, dof, dofs }),
                    Some(&other) if other == number => {
                        return Err(Error::RepeatedContactDof { constraint: number, dof });
                    }
                    Some(_) => seen[dof] = number,
                }
            }
            let (u, v) = (gather(&list, u, &mut local.u), gather(&list, v, &mut local.v));
            list_features(number, broken, &mut features);
            constraint.set_broken(&features);
            constraint.search(t, u, v, 0.0).map_err(|error| of(number, error))?;
            interface.extend((0..list.len()).filter(|&place| !constraint.only_reads(place)).map(|place| list[place]));
            own.push(Part {
                variation: constraint.variation(),
                inspects: constraint.inspects(),
                place: (t, u.to_vec()),
                contacts: Contacts::of(&constraint),
                constraint,
                dofs: list,
                stale: true,
                version: 0,
                rates: None,
                slip_rates: None,
            });
        }
        interface.sort_unstable();
        interface.dedup();
        for &dof in &interface {
            places[dof] = NO_RESPONSE;
        }
        interface.retain(|dof| prescribed.binary_search(dof).is_err());
        for (place, &dof) in interface.iter().enumerate() {
            places[dof] = place;
        }
        let constraints = Self {
            parts: own,
            ids: Vec::new(),
            laws: Laws::default(),
            tangents: Tangents::default(),
            magnitudes: Vec::new(),
            offsets: GapOffsets::default(),
            interface: Interface { dofs: interface, places },
            law_support,
            reading: Reading { stale: true, version: 0, names: Names::default(), old_tangents: Tangents::default() },
            ahead: 0.0,
            scratch: Scratch { local, features, ..Scratch::default() },
        };
        Ok((constraints, ContactJacobian::default()))
    }

    /// Whether any constraint may ever have rows.
    pub(crate) fn may_press(&self) -> bool {
        self.parts.iter().any(|part| !part.dofs.is_empty())
    }

    /// One of the constraints, in the order given.
    pub(crate) fn part(&self, constraint: usize) -> Option<&dyn ContactConstraint<T>> {
        self.parts.get(constraint).map(|part| &*part.constraint as &dyn ContactConstraint<T>)
    }

    /// The first row of a constraint, and its dofs.
    pub(crate) fn rows_of_part(&self, constraint: usize) -> (usize, &[usize]) {
        let first = self.parts[..constraint].iter().map(|part| part.contacts.len()).sum();
        (first, &self.parts[constraint].dofs)
    }

    /// Finds the candidates of a step that imposes contact up to a time `ahead` of the motion.
    pub(crate) fn search(
        &mut self,
        motion: &Motion<T>,
        ahead: f64,
        jacobian: &mut ContactJacobian<T>,
    ) -> Result<Candidates> {
        let Self { parts, scratch: Scratch { local, .. }, reading, .. } = self;
        for (number, part) in parts.iter_mut().enumerate().filter(|(_, part)| part.variation != Variation::Never) {
            let (u, v) = (gather(&part.dofs, &motion.u, &mut local.u), gather(&part.dofs, &motion.v, &mut local.v));
            part.store_place(motion.t, u);
            let found = part.constraint.search(motion.t, u, v, ahead).map_err(|error| of(number, error))?;
            // The flag stays set if a later part fails: the next successful search reads the rows again.
            part.stale |= found == Candidates::Changed;
            reading.stale |= part.stale;
        }
        self.ahead = ahead;
        self.offsets.clear_kept();
        self.read_stale(jacobian)
    }

    /// [`search`](Self::search) at the start of a step, then [`keep_depths`](Self::keep_depths) with the recovery of
    /// each [contact](crate::contact::Contact::recovery). `share` is the step size over the size of a whole step:
    /// without it, halved steps would recover penetration too fast.
    pub(crate) fn search_for_step(
        &mut self,
        motion: &Motion<T>,
        (ahead, share): (f64, f64),
        jacobian: &mut ContactJacobian<T>,
    ) -> Result<Candidates> {
        let found = self.search(motion, ahead, jacobian)?;
        self.keep_depths(motion, share)?;
        Ok(found)
    }

    /// Offsets each gap by the penetration at `motion` that exceeds `share` times the recovery of a whole step. A
    /// share of 0 keeps the penetration that the last step has left.
    pub(crate) fn keep_depths(&mut self, motion: &Motion<T>, share: f64) -> Result<()> {
        self.offsets.clear_kept();
        if self.offsets.recoveries.iter().all(|recovery| recovery.is_infinite()) {
            return Ok(());
        }
        let mut kept = std::mem::take(&mut self.offsets.kept);
        kept.resize(self.len(), T::zero());
        let evaluated = self.finite_gaps(motion.t, &motion.u, &mut kept);
        for (kept, &recovery) in kept.iter_mut().zip(&self.offsets.recoveries) {
            *kept = if recovery.is_infinite() { T::zero() } else { kept_depth(*kept, T::of(share) * recovery) };
        }
        self.offsets.kept = kept;
        evaluated.inspect_err(|_| self.offsets.clear_kept())
    }

    /// Lets every constraint inspect the step that is about to be accepted.
    pub(crate) fn inspect(&mut self, [from, to]: [&Motion<T>; 2], closed: [&[bool]; 2]) -> Result<()> {
        let Self { parts, scratch: Scratch { local, .. }, .. } = self;
        let mut rest = closed;
        for (number, part) in parts.iter_mut().enumerate() {
            let count = part.contacts.len();
            let (own, others) = (rest.map(|flags| &flags[..count]), rest.map(|flags| &flags[count..]));
            rest = others;
            if !part.inspects {
                continue;
            }
            let dofs = &part.dofs;
            let u = [gather(dofs, &from.u, &mut local.u), gather(dofs, &to.u, &mut local.other)];
            let step = Stride::new([from.t, to.t], u, gather(dofs, &from.v, &mut local.v), own);
            part.constraint.inspect(&step).map_err(|error| of(number, error))?;
        }
        Ok(())
    }

    /// Breaks the bonds that cannot carry the forces of a step that ends at t, and appends them to `broken`.
    pub(crate) fn break_bonds(&mut self, forces: &[T], t: f64, broken: &mut Vec<BrokenBond>) {
        let Self { parts, scratch: Scratch { overloads, features, .. }, reading, .. } = self;
        let mut rest = forces;
        for (number, part) in parts.iter_mut().enumerate() {
            let (own, others) = rest.split_at(part.contacts.len());
            rest = others;
            overloads.clear();
            part.constraint.overloads(own, overloads);
            if overloads.is_empty() {
                continue;
            }
            broken.extend(overloads.iter().map(|&overload| BrokenBond::new(number, overload, t)));
            list_features(number, broken, features);
            part.constraint.set_broken(features);
            (part.stale, reading.stale) = (true, true);
        }
    }

    /// Moves the linearization of the rows to u.
    pub(crate) fn follow(&mut self, t: f64, u: &[T], jacobian: &mut ContactJacobian<T>) -> Result<Candidates> {
        for number in 0..self.parts.len() {
            let moved = self.follow_part(number, t, u);
            // The flag stays set after an error, as in a search.
            let changed = !matches!(moved, Ok(Candidates::Unchanged));
            self.parts[number].stale |= changed;
            self.reading.stale |= changed;
            moved?;
        }
        self.read_stale(jacobian)
    }

    pub(crate) fn follow_part(&mut self, number: usize, t: f64, u: &[T]) -> Result<Candidates> {
        let Self { parts, scratch: Scratch { local, .. }, .. } = self;
        let part = &mut parts[number];
        if part.variation != Variation::Follows {
            return Ok(Candidates::Unchanged);
        }
        part.follow(t, gather(&part.dofs, u, &mut local.u)).map_err(|error| of(number, error))
    }

    /// Whether no rows move within a step.
    pub(crate) fn is_affine(&self) -> bool {
        self.parts.iter().all(|part| part.variation != Variation::Follows)
    }

    /// Whether no rows change at all.
    pub(crate) fn is_fixed(&self) -> bool {
        self.parts.iter().all(|part| part.variation == Variation::Never)
    }

    /// The version of the rows. Results computed from rows of another version are out of date.
    pub(crate) fn version(&self) -> u64 {
        self.reading.version
    }

    /// Whether the constraint of a row has not changed its rows since a version.
    pub(crate) fn is_unchanged(&self, row: usize, since: u64) -> bool {
        self.parts[self.ids[row].constraint].version <= since
    }

    /// The names of all rows, and their version.
    pub(crate) fn named(&self) -> (&[ContactId], Names) {
        (&self.ids, self.reading.names)
    }

    /// Reads the rows if they may have changed.
    fn read_stale(&mut self, jacobian: &mut ContactJacobian<T>) -> Result<Candidates> {
        if !self.reading.stale {
            return Ok(Candidates::Unchanged);
        }
        self.read_rows(jacobian)?;
        Ok(Candidates::Changed)
    }

    /// Reads names, laws and G of all rows, and refuses rows that do not fit the system.
    fn read_rows(&mut self, jacobian: &mut ContactJacobian<T>) -> Result<()> {
        let Self { parts, ids, laws, magnitudes, offsets, interface, law_support, reading, .. } = self;
        let (places, names) = (&interface.places, &mut reading.names);
        jacobian.clear();
        laws.clear();
        magnitudes.clear();
        offsets.clear_rows();
        reading.stale = true;
        for (constraint, part) in parts.iter_mut().enumerate() {
            let Part { contacts, dofs, .. } = part;
            if part.stale {
                (part.rates, part.slip_rates) = (None, None);
                contacts.clear();
                part.constraint.contacts(contacts);
                part.version = reading.version + 1;
            }
            for row in 0..contacts.len() {
                let (feature, candidate) = contacts.name(row);
                let contact = ContactId { constraint, feature, candidate };
                if ids.get(laws.len()) != Some(&contact) {
                    names.change();
                    ids.truncate(laws.len());
                    ids.push(contact);
                }
                let law = contacts.law(row);
                law.check::<T>()?;
                law_support.check(law)?;
                laws.push(law);
                let magnitude = contacts.magnitude(row);
                if !magnitude.is_finite() {
                    let (what, value) = ("the magnitude of the coordinates of a contact row", magnitude.value());
                    return Err(Error::NotFinite { what, index: laws.len() - 1, value });
                }
                magnitudes.push(magnitude);
                offsets.push(contacts.recovery(row), law)?;
                check_entries(contacts.row(row), (dofs, places), contact, "a weight of a contact row (by dof)")?;
            }
            jacobian.append(contacts.rows(), dofs);
        }
        if ids.len() > laws.len() {
            names.change();
            ids.truncate(laws.len());
        }
        self.read_tangents(jacobian)?;
        jacobian.locate(&self.interface.places);
        for part in &mut self.parts {
            part.stale = false;
        }
        self.reading.stale = false;
        self.reading.version += 1;
        self.offsets.distribute(&self.ids);
        Ok(())
    }

    /// Reads the tangential rows of contacts with friction, which follow the rows of all gaps.
    fn read_tangents(&mut self, jacobian: &mut ContactJacobian<T>) -> Result<()> {
        let Self { parts, ids, laws, tangents, interface, law_support, reading, .. } = self;
        let (places, old_tangents) = (&interface.places, &mut reading.old_tangents);
        std::mem::swap(tangents, old_tangents);
        tangents.clear();
        if parts.iter().any(|part| part.contacts.has_friction()) {
            tangents.begin(laws.len());
            jacobian.end_normals();
            for part in parts.iter() {
                let Part { contacts, dofs, .. } = part;
                for own in 0..contacts.len() {
                    let (row, friction) = (tangents.listed(), contacts.friction(own));
                    if friction == 0.0 {
                        tangents.push(0.0, 0);
                        continue;
                    }
                    let rows = contacts.tangents_of(own);
                    law_support.check_friction(ids[row], (friction, laws[row], rows.len()))?;
                    for tangent in rows.clone() {
                        let entries = contacts.tangent_rows().row(tangent);
                        check_entries(entries, (dofs, places), ids[row], "a weight of a tangent (by dof)")?;
                    }
                    tangents.push(friction, rows.len());
                    jacobian.append_rows((contacts.tangent_rows(), rows), dofs);
                }
            }
        }
        if !tangents.has_rows_of(old_tangents) {
            reading.names.change();
        }
        Ok(())
    }

    /// The free dofs that contact may ever act on, ascending.
    pub(crate) fn interface(&self) -> &[usize] {
        &self.interface.dofs
    }

    /// The interface index of a dof; none for a prescribed dof, and for a dof that contact never acts on.
    pub(crate) fn place(&self, dof: usize) -> Option<usize> {
        Some(self.interface.places[dof]).filter(|&place| place < self.interface.dofs.len())
    }

    /// The laws of all rows.
    pub(crate) fn laws(&self) -> &Laws {
        &self.laws
    }

    /// The tangential rows of contacts with friction.
    pub(crate) fn tangents(&self) -> &Tangents {
        &self.tangents
    }

    /// The admissible set of the multipliers of a contact.
    pub(crate) fn set(&self, row: usize) -> AdmissibleSet {
        match self.tangents.of(row).len() {
            0 => self.laws[row].into(),
            rows => AdmissibleSet::with_friction(self.tangents.friction(row), rows),
        }
    }

    /// The contact of a row, tangential or not.
    pub(crate) fn id_of(&self, row: usize) -> ContactId {
        self.ids[self.tangents.owner(row)]
    }

    /// [`rows_of`](Self::rows_of) with the friction rows of these contacts.
    pub(crate) fn all_rows_of<'c>(
        &'c self,
        contacts: &'c ContactState<T>,
    ) -> impl Iterator<Item = (usize, usize)> + 'c {
        let rows = |(contact, row): (usize, usize)| {
            std::iter::once((contact, row)).chain(contacts.tangents.of(contact).zip(self.tangents.of(row)))
        };
        self.rows_of(contacts).flat_map(rows)
    }

    /// Number of candidates, and of gap rows.
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    /// (contact, row) of the contacts of a state that are still candidates. A search may have changed the candidates.
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

/// Lists the features of the broken bonds of a constraint, ascending.
fn list_features(constraint: usize, broken: &[BrokenBond], features: &mut Vec<usize>) {
    features.clear();
    features.extend(broken.iter().filter(|bond| bond.constraint == constraint).map(|bond| bond.feature));
    features.sort_unstable();
}

/// Refuses entries (place, weight) of a row on dofs on which the constraint may not act, and weights that are not
/// finite.
fn check_entries<T: Real>(
    entries: impl Iterator<Item = (usize, T)>,
    (dofs, places): (&[usize], &[usize]),
    contact: ContactId,
    what: &'static str,
) -> Result<()> {
    for (place, weight) in entries {
        let dof = match dofs.get(place) {
            Some(&dof) if places[dof] != UNKNOWN => dof,
            _ => return Err(Error::UnlistedPlace { contact, place }),
        };
        if !weight.is_finite() {
            return Err(Error::NotFinite { what, index: dof, value: weight.value() });
        }
    }
    Ok(())
}
