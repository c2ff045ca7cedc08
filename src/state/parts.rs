//! Checkpoints of parts of a body: the share of one of several ranks, and the whole assembled from all parts.

use super::{History, checkpoint::Checkpoint};
use crate::error::{Error, Result};
use crate::real::Real;

impl<T: Real> Checkpoint<T> {
    /// The checkpoint of a part of the body: its dof i is dof `dofs[i]` of this one. Contacts are kept unchanged,
    /// because every part has all candidates. [`joined`](Self::joined) is the inverse.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Checkpoint, GeneralizedAlpha, LinearSystem, Simulation};
    ///
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &[Triplet::new(0, 0, 9.0)])?;
    /// let system = LinearSystem::lumped(vec![1.0; 2], k)?;
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.01).velocity(vec![1.0, 2.0]).build()?;
    /// run.run_until(0.1, &mut ())?;
    /// let whole = run.checkpoint();
    /// let parts = [(whole.part(&[1])?, vec![1]), (whole.part(&[0])?, vec![0])];
    /// assert_eq!(parts[0].0.state().displacement(), &whole.state().displacement()[1..]);
    /// assert_eq!(Checkpoint::joined(&parts, 2)?.state(), whole.state());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::MissingDof`], [`Error::Incompatible`] for a run with dofs without mass.
    pub fn part(&self, dofs: &[usize]) -> Result<Self> {
        self.check_divisible()?;
        let all = self.state.motion.u.len();
        if let Some(&dof) = dofs.iter().find(|&&dof| dof >= all) {
            return Err(Error::MissingDof { what: "the part of a checkpoint", dof, dofs: all });
        }
        let mut part = self.clone();
        for values in part.vectors() {
            *values = dofs.iter().map(|&dof| values[dof]).collect();
        }
        Ok(part)
    }

    /// The checkpoint of the whole body of `dofs` dofs, from parts, each with the numbers of its dofs in the whole.
    /// If several parts have a dof, the first one is used.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without parts, [`Error::Dimension`] for a list whose length differs from its part,
    /// [`Error::MissingDof`], [`Error::Incompatible`] for parts of different runs, instants or contacts, for a dof
    /// that no part has, and for a run with dofs without mass.
    pub fn joined(parts: &[(Self, Vec<usize>)], dofs: usize) -> Result<Self> {
        let refuse = |reason| Err(Error::Incompatible { part: "the parts of a checkpoint".into(), reason });
        let Some((first, _)) = parts.first() else {
            return Err(Error::Empty { what: "the list of parts of a checkpoint", remedy: "give at least one" });
        };
        let mut owner = vec![None; dofs];
        for (number, (part, list)) in parts.iter().enumerate() {
            part.check_divisible()?;
            let found = part.state.motion.u.len();
            if list.len() != found {
                let what = "the list of the dofs of a part of a checkpoint";
                return Err(Error::Dimension { what, expected: found, found: list.len() });
            }
            if !first.is_alike(part) {
                return refuse("they are of different runs, instants or contacts");
            }
            for (place, &dof) in list.iter().enumerate() {
                let Some(owner) = owner.get_mut(dof) else {
                    return Err(Error::MissingDof { what: "a part of a checkpoint", dof, dofs });
                };
                owner.get_or_insert((number, place));
            }
        }
        let Some(owner) = owner.into_iter().collect::<Option<Vec<_>>>() else {
            return refuse("a dof of the whole belongs to none of them");
        };
        let mut sources: Vec<Self> = parts.iter().map(|(part, _)| part.clone()).collect();
        let mut vectors: Vec<_> = sources.iter_mut().map(Self::vectors).collect();
        let mut whole = first.clone();
        for values in whole.vectors() {
            let from: Vec<_> = vectors.iter_mut().filter_map(Iterator::next).collect();
            *values = owner.iter().map(|&(number, place)| from[number][place]).collect();
        }
        Ok(whole)
    }

    /// Whether another part can belong to the same run at the same instant.
    fn is_alike(&self, other: &Self) -> bool {
        let shape = |part: &Self| {
            let History { slots, known, smooth, clock, made_with, computed, unshifted, scheme, .. } = &part.history;
            let lists = (slots.len(), computed.known().count(), unshifted.each_ref().map(Vec::is_empty));
            (lists, *known, *smooth, *clock, made_with.to_bits(), scheme.clone())
        };
        shape(self) == shape(other)
            && self.rows == other.rows
            && self.state.contacts == other.state.contacts
            && self.state.motion.t.to_bits() == other.state.motion.t.to_bits()
    }

    fn check_divisible(&self) -> Result<()> {
        match self.history.slopes.is_empty() {
            true => Ok(()),
            false => Err(Error::Incompatible {
                part: "the checkpoint".into(),
                reason: "a run with dofs without mass is not divided",
            }),
        }
    }

    /// All vectors with one entry per dof, in a fixed order. Vectors of motions that nothing reads are empty.
    fn vectors(&mut self) -> impl Iterator<Item = &mut Vec<T>> {
        let (state, history) = (&mut self.state, &mut self.history);
        let motions = std::iter::once(&mut state.motion).chain(&mut history.slots).chain(history.computed.all());
        let fields = motions.flat_map(|motion| [&mut motion.u, &mut motion.v, &mut motion.a]);
        fields.chain(&mut state.rates).chain(&mut history.unshifted).filter(|values| !values.is_empty())
    }
}
