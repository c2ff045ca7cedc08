//! Compares tangent, damping force and potential of a system with differences of its force.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::system::{self, System, TangentWeights};

/// Errors of the parts of a system as derivatives of its force.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TangentError {
    /// K of [`tangent`](System::tangent) against −∂f/∂u.
    pub stiffness: MatrixMismatch,
    /// C of [`tangent`](System::tangent) against −∂f/∂v.
    pub damping: MatrixMismatch,
    /// [`damping_force`](System::damping_force) (zero if there is none) against f(t, u, 0) − f(t, u, v).
    pub damping_force: ForceMismatch,
    /// Derivatives of [`potential_energy`](System::potential_energy) against the internal force at rest,
    /// [`external_load`](System::external_load) − f(t, u, 0); also detects a load missing in `external_load`. `None`
    /// without potential.
    pub potential: Option<ForceMismatch>,
}

impl TangentError {
    /// The largest of all relative errors and asymmetries; NaN if one is NaN.
    pub fn largest(&self) -> f64 {
        let [k, c] = [self.stiffness, self.damping];
        let potential = self.potential.map_or(0.0, |potential| potential.relative);
        let all = [k.relative, c.relative, k.asymmetry, c.asymmetry, self.damping_force.relative, potential];
        all.into_iter().fold(0.0, |m: f64, x| if x.is_nan() || m.is_nan() { f64::NAN } else { m.max(x) })
    }
}

/// A matrix compared with difference quotients of the force, including entries outside of the pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MatrixMismatch {
    /// Largest difference of an entry relative to the largest entry of both matrices; NaN if an entry is not finite.
    pub relative: f64,
    /// Row of the entry with the largest difference.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// The entry of the tangent there; zero outside of the pattern.
    pub given: f64,
    /// The difference quotient there.
    pub expected: f64,
    /// Whether the pattern has the entry.
    pub in_pattern: bool,
    /// Largest difference of two entries across the diagonal of the tangent, relative to the same scale.
    pub asymmetry: f64,
}

/// A vector compared with forces.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ForceMismatch {
    /// Largest difference relative to the largest entry of both vectors; NaN if an entry is not finite.
    pub relative: f64,
    /// The dof of that difference.
    pub dof: usize,
    /// The host's value there.
    pub given: f64,
    /// The value computed from its force.
    pub expected: f64,
}

/// Compares K and C of a system with central differences of its force at (t, u, v), and its damping force and potential
/// with the force.
///
/// Every dof is varied, including prescribed ones, by `step` (length) in u and by `velocity_step` in v. The error of
/// a quotient is about step² times the third derivative of the force plus ε |f| / step, so use 1e-5 to 1e-6 (`f32`:
/// 1e-2 to 1e-3) of the relevant scale: of an element in u, and of typical speeds in v. Check at a deformed, moving
/// state: many errors of a tangent vanish at rest. Outputs hold NaN before each call, so unwritten entries are
/// detected. Costs 4 n forces, 2 n energies and n² comparisons for n dofs: meant for small meshes.
///
/// # Errors
///
/// [`Error::Empty`] without dofs; [`Error::Dimension`] if u, v, the mass or the pattern do not have the size of the
/// system; [`Error::Incompatible`] for a pattern out of order; [`Error::Asymmetric`] and [`Error::MatrixNotFinite`] for
/// the mass; [`Error::NotFinite`] for u and v; [`Error::Parameter`] for steps that are not positive or too small to
/// change u or v; and the errors of the system.
///
/// ```
/// use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
/// use contact_dynamics::{Mass, Result, System, TangentWeights, verify};
///
/// /// A unit mass on the spring N = u + u³.
/// struct Cubic(SymbolicSparseColMat<usize>);
///
/// impl System<f64> for Cubic {
///     fn dofs(&self) -> usize {
///         1
///     }
///     fn mass(&self) -> Mass<'_, f64> {
///         Mass::Lumped(&[1.0])
///     }
///     fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
///         out[0] = -u[0] - u[0].powi(3);
///         Ok(())
///     }
///     fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
///         self.0.as_ref()
///     }
///     fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
///         out[0] = w.stiffness * (1.0 + 2.0 * u[0] * u[0]); // 3 u² would be right
///         Ok(())
///     }
/// }
///
/// let mut spring = Cubic(SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]));
/// let error = verify::tangent(&mut spring, 0.0, &[2.0], &[1.0], 1e-5, 1e-5)?;
/// let k = error.stiffness;
/// assert_eq!((k.row, k.column, k.given), (0, 0, 9.0));
/// assert!((k.expected - 13.0).abs() < 1e-8 && (k.relative - 4.0 / 13.0).abs() < 1e-8);
/// assert!(error.damping.relative == 0.0 && error.potential.is_none());
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn tangent<T: Real>(
    system: &mut dyn System<T>,
    t: f64,
    u: &[T],
    v: &[T],
    step: f64,
    velocity_step: f64,
) -> Result<TangentError> {
    let dofs = system::check_sizes(system)?;
    system::check_vector("the displacement", u, dofs)?;
    system::check_vector("the velocity", v, dofs)?;
    let mut matrix = Matrix::of(system);
    let mut force = |u: &[T], v: &[T], out: &mut [T]| {
        out.fill(T::nan());
        system.force(t, u, v, out)
    };
    let varied = Varied { name: "the step of displacements", at: u, step };
    let stiffness = varied.quotients(|u, out| force(u, v, out))?;
    let varied = Varied { name: "the step of velocities", at: v, step: velocity_step };
    let damping = varied.quotients(|v, out| force(u, v, out))?;

    let rest = vec![T::zero(); v.len()];
    let (mut moving, mut still) = (rest.clone(), rest.clone());
    force(u, v, &mut moving)?;
    force(u, &rest, &mut still)?;

    let mut compare = |stiffness, damping, quotients: &[T]| -> Result<(MatrixMismatch, f64)> {
        matrix.values.fill(T::nan());
        system.tangent(t, u, v, TangentWeights { stiffness, damping }, &mut matrix.values)?;
        Ok(matrix.compare(quotients))
    };
    let (stiffness, largest) = compare(T::one(), T::zero(), &stiffness)?;
    let (damping, _) = compare(T::zero(), T::one(), &damping)?;

    let mut out = vec![T::nan(); u.len()];
    match system.damping_force() {
        Some(damping) => damping.evaluate(u, v, &mut out)?,
        None => out.fill(T::zero()),
    }
    let mut damping_force = Worst::default();
    for (dof, ((&still, &moving), &given)) in still.iter().zip(&moving).zip(&out).enumerate() {
        damping_force.compare((dof, 0), given, still - moving);
    }

    let mut potential = None;
    if system.potential_energy(u).is_some() {
        let varied = Varied { name: "the step of displacements", at: u, step };
        let gradient = varied.gradient(|u| system.potential_energy(u).unwrap_or_else(T::nan))?;
        out.fill(T::nan());
        system.external_load(t, &mut out)?;
        // At rest both forces are rounding: the change over a step is the smallest scale.
        let mut worst = Worst { scale: largest * step, found: None };
        for (dof, gradient) in gradient.into_iter().enumerate() {
            worst.compare((dof, 0), gradient, out[dof] - still[dof]);
        }
        potential = Some(worst.force());
    }
    Ok(TangentError { stiffness, damping, damping_force: damping_force.force(), potential })
}

/// A vector whose entries are varied one at a time.
struct Varied<'a, T> {
    name: &'static str,
    at: &'a [T],
    step: f64,
}

impl<T: Real> Varied<'_, T> {
    /// Calls `visit` with each dof, the vector displaced there in both directions (−, +), and the distance of the two.
    fn each(&self, mut visit: impl FnMut(usize, [&[T]; 2], T) -> Result<()>) -> Result<()> {
        let refuse = |range| Err(Error::Parameter { name: self.name, value: self.step, range });
        if !(self.step > 0.0 && self.step.is_finite()) {
            return refuse("positive and finite");
        }
        let (mut before, mut after) = (self.at.to_vec(), self.at.to_vec());
        for (dof, &x) in self.at.iter().enumerate() {
            (before[dof], after[dof]) = (x - T::of(self.step), x + T::of(self.step));
            let distance = after[dof] - before[dof];
            if distance == T::zero() {
                return refuse("large enough to change every entry");
            }
            visit(dof, [&before, &after], distance)?;
            (before[dof], after[dof]) = (x, x);
        }
        Ok(())
    }

    /// Minus the derivatives of a force, column by column.
    fn quotients(&self, mut force: impl FnMut(&[T], &mut [T]) -> Result<()>) -> Result<Vec<T>> {
        let n = self.at.len();
        let mut quotients = Vec::with_capacity(n * n);
        let (mut first, mut second) = (vec![T::zero(); n], vec![T::zero(); n]);
        self.each(|_, [before, after], distance| {
            force(before, &mut first)?;
            force(after, &mut second)?;
            quotients.extend(first.iter().zip(&second).map(|(&first, &second)| (first - second) / distance));
            Ok(())
        })?;
        Ok(quotients)
    }

    /// The derivatives of a potential.
    fn gradient(&self, mut potential: impl FnMut(&[T]) -> T) -> Result<Vec<T>> {
        let mut gradient = Vec::with_capacity(self.at.len());
        self.each(|_, [before, after], distance| {
            gradient.push((potential(after) - potential(before)) / distance);
            Ok(())
        })?;
        Ok(gradient)
    }
}

/// The values of a tangent in its pattern.
struct Matrix<T> {
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<T>,
}

impl<T: Real> Matrix<T> {
    fn of(system: &dyn System<T>) -> Self {
        let pattern = system.pattern();
        let (pointers, rows) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
        Self { pointers, values: vec![T::nan(); rows.len()], rows }
    }

    fn position(&self, row: usize, column: usize) -> Option<usize> {
        let range = self.pointers[column]..self.pointers[column + 1];
        self.rows[range.clone()].binary_search(&row).ok().map(|at| range.start + at)
    }

    fn entry(&self, row: usize, column: usize) -> T {
        self.position(row, column).map_or(T::zero(), |at| self.values[at])
    }

    /// The comparison with quotients stored column by column, and its scale.
    fn compare(&self, quotients: &[T]) -> (MatrixMismatch, f64) {
        let mut worst = Worst::default();
        let n = self.pointers.len() - 1;
        for (index, &quotient) in quotients.iter().enumerate() {
            let (row, column) = (index % n, index / n);
            worst.compare((row, column), self.entry(row, column), quotient);
        }
        let Found { difference, at: (row, column), given, expected } = worst.worst();
        let in_pattern = self.position(row, column).is_some();
        let [relative, asymmetry] = [difference, self.asymmetry()].map(|difference| worst.over_scale(difference));
        (MatrixMismatch { relative, row, column, given, expected, in_pattern, asymmetry }, worst.scale)
    }

    fn asymmetry(&self) -> f64 {
        let columns = self.pointers.windows(2).enumerate();
        let differences = columns.flat_map(|(column, range)| {
            (range[0]..range[1]).map(move |at| (self.values[at] - self.entry(column, self.rows[at])).value().abs())
        });
        differences.fold(0.0, |m, d| if d.is_nan() { d } else { m.max(d) })
    }
}

/// The largest difference found, and the largest entry.
#[derive(Default)]
struct Worst {
    scale: f64,
    found: Option<Found>,
}

#[derive(Clone, Copy)]
struct Found {
    difference: f64,
    at: (usize, usize),
    given: f64,
    expected: f64,
}

impl Worst {
    fn compare<T: Real>(&mut self, at: (usize, usize), given: T, expected: T) {
        let (given, expected) = (given.value(), expected.value());
        self.scale = self.scale.max(given.abs()).max(expected.abs());
        let difference = (given - expected).abs();
        // NaN is worse than any number, and the first one is kept.
        let worse = |found: Found| difference > found.difference || (difference.is_nan() && !found.difference.is_nan());
        if self.found.is_none_or(worse) {
            self.found = Some(Found { difference, at, given, expected });
        }
    }

    fn over_scale(&self, difference: f64) -> f64 {
        if difference == 0.0 { 0.0 } else { difference / self.scale }
    }

    fn worst(&self) -> Found {
        self.found.unwrap_or(Found { difference: 0.0, at: (0, 0), given: 0.0, expected: 0.0 })
    }

    fn force(&self) -> ForceMismatch {
        let Found { difference, at: (dof, _), given, expected } = self.worst();
        ForceMismatch { relative: self.over_scale(difference), dof, given, expected }
    }
}
