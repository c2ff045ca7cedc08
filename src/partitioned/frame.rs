//! A frame between two sides whose nodes match, with localized Lagrange multipliers.

use super::assembly::Assembly;
use super::coupling::Coupling;
use super::problem::{check_flexibility, check_length};
use crate::contact_solver::{ActiveSet, ContactSolver};
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use crate::sparse::check_vector;

/// The interface of a body: its values without contact, and its flexibility.
///
/// Values are taken along the normal of each frame node, which points from the first side to the second for both.
/// They may be displacements, velocities or accelerations, with the corresponding flexibility.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Side<'a, T> {
    /// Values along the normals without contact.
    pub free: &'a [T],
    /// Entry i + j n: the change of the value of node i by a unit force along the normal on node j (n nodes,
    /// symmetric, positive semidefinite). For displacements of an implicit step w_u G A⁻¹Gᵀ with the effective matrix
    /// A of the body, for velocities and accelerations G M⁻¹Gᵀ per unit of impulse and force; all zero for a rigid
    /// obstacle.
    pub flexibility: &'a [T],
}

impl<'a, T> Side<'a, T> {
    /// A side with these values without contact and this flexibility.
    pub const fn new(free: &'a [T], flexibility: &'a [T]) -> Self {
        Self { free, flexibility }
    }
}

/// The solution of a [`Frame`].
#[derive(Clone, Debug, Default)]
pub struct Interface<T> {
    forces: Vec<T>,
    positions: Vec<T>,
    values: [Vec<T>; 2],
    gaps: Vec<T>,
    closed: Vec<bool>,
    iterations: usize,
}

impl<T: Real> Interface<T> {
    /// The force l on each node, positive in compression (of either sign after [`Frame::hold`]): the second side gets
    /// +l along the normal, the first −l. The multipliers of both sides are equal, because the frame has no mass.
    pub fn forces(&self) -> &[T] {
        &self.forces
    }

    /// Positions of the frame, as values of the first side: if closed, the values of both sides; if open, halfway
    /// between them, where any position would be valid, because no force acts.
    pub fn positions(&self) -> &[T] {
        &self.positions
    }

    /// Values of both sides with contact.
    pub fn values(&self) -> [&[T]; 2] {
        [&self.values[0], &self.values[1]]
    }

    /// Gaps between both sides, zero to rounding if closed, positive if open.
    pub fn gaps(&self) -> &[T] {
        &self.gaps
    }

    /// Which nodes are closed: pressed by a force, or with a gap within the rounding of its terms. After
    /// [`Frame::hold`]: the held nodes.
    pub fn closed(&self) -> &[bool] {
        &self.closed
    }

    /// Iterations of the contact solver.
    pub fn iterations(&self) -> usize {
        self.iterations
    }
}

/// A frame between two bodies with matching contact nodes: the interface problem of localized Lagrange multipliers
/// (Park, Felippa, Gumaste, Comput. Mech. 24, 2000; with contact Rebel, Park, Felippa, Int. J. Numer. Methods Eng.
/// 54, 2002).
///
/// Each side s is tied to the frame by its own multipliers l_s; the frame has displacements x and no mass. With d_s
/// the values of the sides under their forces, and the whole gap between the frame and the second side:
///
/// ```text
/// d_1 = free_1 − F_1 l_1,   d_2 = free_2 + F_2 l_2
/// 0 ≤ x − d_1 ⊥ l_1 ≥ 0,    0 ≤ d_2 + gap − x ⊥ l_2 ≥ 0,    l_1 − l_2 = 0 (equilibrium of the frame)
/// ```
///
/// Eliminating the frame leaves `0 ≤ (F_1 + F_2) l + free_2 − free_1 + gap ⊥ l ≥ 0`, which any [`ContactSolver`] can
/// solve. A body needs no knowledge of the other one or its code: its step continues with the forces of the frame.
/// Results equal the monolithic form up to rounding (`tests/partitioned/frames.rs`).
///
/// A side may combine several bodies, with a block-diagonal flexibility: of bodies in a row every other one belongs
/// to the first side. For three bodies in mutual contact, and for nodes that do not match, use an
/// [`Assembly`](super::Assembly).
///
/// An explicit or implicit step of the host:
///
/// 1. each body advances without contact, `free`, and solves for unit forces on its interface (once while its matrix
///    is unchanged);
/// 2. [`solve`](Self::solve);
/// 3. each body adds the response to its forces;
/// 4. to make velocities (then accelerations) agree with the contact, as
///    [`PersistencyCorrection`](crate::PersistencyCorrection) does: [`hold`](Self::hold) on the closed nodes. A
///    second frame for this keeps the factors of both.
///
/// ```
/// use contact_dynamics::partitioned::{Frame, Side};
///
/// // Masses 2 and 1 on springs, in units of a step: responses to unit forces ½ and 1. The gap is 0.1.
/// let mut frame = Frame::<f64>::new(1)?;
/// let first = Side::new(&[0.3], &[0.5]);
/// let second = Side::new(&[-0.1], &[1.0]);
/// let interface = frame.solve([first, second], &[0.1])?;
/// assert!((interface.forces()[0] - 0.2).abs() < 1e-15); // (0.3 + 0.1 − 0.1)/(½ + 1)
/// assert!((interface.positions()[0] - 0.2).abs() < 1e-15); // 0.3 − ½ · 0.2 = −0.1 + 1 · 0.2 + 0.1
///
/// // Velocities 1 and −2 become their common one, (2 · 1 − 1 · 2)/3, by an impulse of 2.
/// let first = Side::new(&[1.0], &[0.5]);
/// let second = Side::new(&[-2.0], &[1.0]);
/// let interface = frame.hold([first, second], &[0.0], &[true])?;
/// assert!((interface.forces()[0] - 2.0).abs() < 1e-15 && interface.positions()[0].abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct Frame<T: Real> {
    /// Both sides as bodies, with a row for each node.
    assembly: Assembly<T>,
    interface: Interface<T>,
}

impl<T: Real> Frame<T> {
    /// A frame with this many nodes, solved by [`ActiveSet`]. A node tied in several directions counts once for each
    /// of them.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) if the dense problem does not fit.
    pub fn new(nodes: usize) -> Result<Self> {
        Self::with_solver(nodes, ActiveSet::default())
    }

    /// The same with a solver of the host's choice.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) if the dense problem does not fit.
    pub fn with_solver(nodes: usize, solver: impl ContactSolver<T> + 'static) -> Result<Self> {
        let rigid: Vec<T> = memory::zeros(nodes, nodes, "a frame")?;
        let row = |node| Coupling::unilateral(&[(0, node, -T::one()), (1, node, T::one())]);
        let rows: Vec<_> = (0..nodes).map(row).collect();
        let assembly = Assembly::with_solver(&[&rigid, &rigid], &rows, solver)?;
        let zero = || vec![T::zero(); nodes];
        let interface = Interface {
            forces: zero(),
            positions: zero(),
            values: [zero(), zero()],
            gaps: zero(),
            closed: vec![false; nodes],
            iterations: 0,
        };
        Ok(Self { assembly, interface })
    }

    /// Contact: forces that press, on nodes whose gap would close. `gaps` are the gaps at zero values of both sides,
    /// positive when open.
    ///
    /// The forces of the previous call are the initial guess; they may change the work, not the result. Does not
    /// allocate.
    ///
    /// # Errors
    ///
    /// `Dimension`, `NotFinite`, `Asymmetric` and `Singular` (`dof` is the frame node) of [`Error`](crate::Error) for
    /// wrong sides, `Frame` if no forces were found. The frame remains usable.
    pub fn solve(&mut self, sides: [Side<'_, T>; 2], gaps: &[T]) -> Result<&Interface<T>> {
        self.run(sides, gaps, None)
    }

    /// Joins both sides at the nodes with a true `held`, by forces of any sign and size, without force on the others.
    /// For ties, and for jumps of velocity or acceleration (`gaps` zero), whose forces are then impulses or forces.
    ///
    /// With flexibilities G M⁻¹Gᵀ this is the projection of [`JumpProjection`](crate::JumpProjection), S = F_1 + F_2:
    /// momentum is conserved, kinetic energy falls.
    ///
    /// # Errors
    ///
    /// As for [`solve`](Self::solve).
    pub fn hold(&mut self, sides: [Side<'_, T>; 2], gaps: &[T], held: &[bool]) -> Result<&Interface<T>> {
        self.run(sides, gaps, Some(held))
    }

    fn run(&mut self, sides: [Side<'_, T>; 2], gaps: &[T], held: Option<&[bool]>) -> Result<&Interface<T>> {
        let n = self.interface.forces.len();
        check_vector("gaps of the frame", gaps, n)?;
        check_length("the list of nodes held", held.map_or(n, <[bool]>::len), n)?;
        for side in &sides {
            check_vector("free values of a side", side.free, n)?;
            check_flexibility("flexibility of a side", side.flexibility, n)?;
        }
        let Self { assembly, interface } = self;
        for (body, side) in sides.iter().enumerate() {
            assembly.update_flexibility(body, side.flexibility);
        }
        let found = assembly.run(&sides.map(|side| side.free), gaps, held)?;
        interface.forces.copy_from_slice(found.multipliers());
        interface.gaps.copy_from_slice(found.gaps());
        interface.closed.copy_from_slice(found.closed());
        interface.iterations = found.iterations();
        for (body, values) in interface.values.iter_mut().enumerate() {
            values.copy_from_slice(found.values(body));
        }
        let [first, second] = &interface.values;
        for (position, ((&first, &second), &gap)) in
            interface.positions.iter_mut().zip(first.iter().zip(second).zip(gaps))
        {
            *position = T::of(0.5) * (first + second + gap);
        }
        Ok(interface)
    }
}
