//! Each kind of mistake in a host's system is found, and the entry named is the wrong one.

use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::verify::{self, TangentError};
use contact_dynamics::{DampingForce, Error, Linearity, Mass, Real, Result, System, TangentWeights};

const NODES: usize = 4;
const STIFFNESS: [f64; NODES - 1] = [3.0, 5.0, 2.0];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    Nothing,
    /// Entry (1, 2) of the tangent is 1 % too large, and so is (2, 1) unless the tangent is to be unsymmetric.
    WrongEntry,
    Unsymmetric,
    /// The pattern lacks (2, 3) and (3, 2).
    MissingEntry,
    /// The outermost entry of the pattern is not written.
    NotWritten,
    SignOfDamping,
    /// K is written where C was asked for.
    IgnoredWeights,
    /// The potential of the last spring is linear.
    Potential,
    /// The load is not in `external_load`.
    Load,
    DampingForce,
    MassSize,
    PatternSize,
}

/// Masses in a row; spring and dashpot between neighbors: N = k (s + s³) + (1 + s²) ds/dt. The first one is a support.
struct Chain<T> {
    mass: Vec<T>,
    pattern: SymbolicSparseColMat<usize>,
    mistake: Mistake,
}

impl<T: Real> Chain<T> {
    fn new(mistake: Mistake) -> Self {
        let size = if mistake == Mistake::PatternSize { NODES + 1 } else { NODES };
        let (mut pointers, mut rows) = (vec![0], Vec::new());
        for column in 0..size {
            let near = (0..size).filter(|row| row.abs_diff(column) < 2);
            rows.extend(near.filter(|&row| mistake != Mistake::MissingEntry || row.max(column) != 3 || row == column));
            pointers.push(rows.len());
        }
        Self {
            mass: vec![T::one(); if mistake == Mistake::MassSize { NODES - 1 } else { NODES }],
            pattern: SymbolicSparseColMat::new_checked(size, size, pointers, None, rows),
            mistake,
        }
    }

    fn stretch(i: usize, u: &[T]) -> (T, T) {
        (T::of(STIFFNESS[i]), u[i + 1] - u[i])
    }
}

impl<T: Real> System<T> for Chain<T> {
    fn dofs(&self) -> usize {
        NODES
    }
    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }
    fn mass(&self) -> Mass<'_, T> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        out.fill(T::of(t));
        for i in 0..NODES - 1 {
            let ((k, s), (_, rate)) = (Self::stretch(i, u), Self::stretch(i, v));
            let force = k * (s + s * s * s) + (T::one() + s * s) * rate;
            out[i] += force;
            out[i + 1] -= force;
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        let mut dense = [[T::zero(); NODES]; NODES];
        for i in 0..NODES - 1 {
            let ((k, s), (_, rate)) = (Self::stretch(i, u), Self::stretch(i, v));
            let (three, two) = (T::of(3.0), T::of(2.0));
            let stiffness = k * (T::one() + three * s * s) + two * s * rate;
            let mut damping = T::one() + s * s;
            if self.mistake == Mistake::SignOfDamping {
                damping = -damping;
            }
            let value = match self.mistake {
                Mistake::IgnoredWeights => stiffness * (weights.stiffness + weights.damping),
                _ => weights.stiffness * stiffness + weights.damping * damping,
            };
            dense[i][i] += value;
            dense[i + 1][i + 1] += value;
            dense[i][i + 1] -= value;
            dense[i + 1][i] -= value;
        }
        let factor = T::of(1.01);
        match self.mistake {
            Mistake::WrongEntry => (dense[1][2], dense[2][1]) = (factor * dense[1][2], factor * dense[2][1]),
            Mistake::Unsymmetric => dense[1][2] *= factor,
            _ => {}
        }
        let slots = (0..NODES).flat_map(|j| self.pattern.row_idx_of_col_raw(j).iter().map(move |&i| (i, j)));
        for ((i, j), out) in slots.zip(out) {
            if self.mistake != Mistake::NotWritten || (i, j) != (NODES - 1, NODES - 1) {
                *out = dense[i][j];
            }
        }
        Ok(())
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        match self.mistake {
            Mistake::DampingForce => None,
            _ => Some(self),
        }
    }
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        let energy = |i: usize| {
            let (k, s) = Self::stretch(i, u);
            let fourth = if self.mistake == Mistake::Potential && i == 2 { T::zero() } else { T::of(0.25) };
            k * s * s * (T::of(0.5) + fourth * s * s)
        };
        Some((0..NODES - 1).map(energy).sum())
    }
    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        out.fill(if self.mistake == Mistake::Load { T::zero() } else { T::of(t) });
        Ok(())
    }
    fn prescribed(&self) -> &[usize] {
        &[0]
    }
}

impl<T: Real> DampingForce<T> for Chain<T> {
    fn evaluate(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        out.fill(T::zero());
        for i in 0..NODES - 1 {
            let ((_, s), (_, rate)) = (Self::stretch(i, u), Self::stretch(i, v));
            out[i] -= (T::one() + s * s) * rate;
            out[i + 1] += (T::one() + s * s) * rate;
        }
        Ok(())
    }
}

const U: [f64; NODES] = [0.1, -0.3, 0.4, 0.9];
const V: [f64; NODES] = [0.5, 1.2, -0.7, 0.3];

fn checked(mistake: Mistake) -> Result<TangentError> {
    verify::tangent(&mut Chain::new(mistake), 0.7, &U, &V, 1e-5, 1e-5)
}

#[test]
fn a_right_tangent_passes() {
    let error = checked(Mistake::Nothing).unwrap();
    assert!(error.largest() < 2e-10, "{error:?}");
    assert!(error.stiffness.in_pattern && error.potential.is_some());
    // At rest nothing is left but rounding, which is no mismatch.
    let rest =
        verify::tangent(&mut Chain::new(Mistake::Nothing), 0.0, &[0.0; NODES], &[0.0; NODES], 1e-5, 1e-5).unwrap();
    assert!(rest.largest() < 1e-9, "{rest:?}");
    // In single precision with steps that fit it.
    let single =
        verify::tangent(&mut Chain::<f32>::new(Mistake::Nothing), 0.7, &U.map(f32::of), &V.map(f32::of), 5e-3, 5e-3)
            .unwrap();
    assert!(single.largest() < 1e-3, "{single:?}");
}

#[test]
fn a_wrong_entry_is_named() {
    let error = checked(Mistake::WrongEntry).unwrap();
    let k = error.stiffness;
    assert!([(1, 2), (2, 1)].contains(&(k.row, k.column)) && k.in_pattern, "{k:?}");
    assert!((k.given / k.expected - 1.01).abs() < 1e-8 && k.asymmetry < 1e-15, "{k:?}");
    assert!(k.relative > 1e-3 && error.damping_force.relative < 1e-9 && error.potential.unwrap().relative < 1e-9);

    let k = checked(Mistake::Unsymmetric).unwrap().stiffness;
    assert_eq!((k.row, k.column), (1, 2));
    assert!((k.asymmetry / k.relative - 1.0).abs() < 1e-6, "{k:?}");
}

#[test]
fn an_entry_outside_of_the_pattern_is_named() {
    let error = checked(Mistake::MissingEntry).unwrap();
    for matrix in [error.stiffness, error.damping] {
        assert!([(3, 2), (2, 3)].contains(&(matrix.row, matrix.column)), "{matrix:?}");
        assert!(!matrix.in_pattern && matrix.given == 0.0 && matrix.expected < -1.0 && matrix.relative > 0.1);
    }
}

#[test]
fn an_entry_that_is_not_written_is_named() {
    let error = checked(Mistake::NotWritten).unwrap();
    assert!(error.largest().is_nan() && error.stiffness.relative.is_nan() && error.stiffness.given.is_nan());
    assert_eq!((error.stiffness.row, error.stiffness.column), (3, 3));
}

#[test]
fn damping_of_the_wrong_sign_is_found() {
    let error = checked(Mistake::SignOfDamping).unwrap();
    let c = error.damping;
    assert!((c.given / c.expected + 1.0).abs() < 1e-8 && (c.relative - 2.0).abs() < 1e-8, "{c:?}");
    // Springs 0 and 1 meet in dof 1: 2 + s₀² + s₁² = 2.65, dof 2 has 2.74.
    assert_eq!((c.row, c.column), (2, 2));
    assert!(error.stiffness.relative < 1e-9 && error.damping_force.relative < 1e-9);
    let error = checked(Mistake::IgnoredWeights).unwrap();
    assert!(error.damping.relative > 0.5 && error.stiffness.relative < 1e-9);
}

#[test]
fn a_forgotten_damping_force_is_found() {
    let error = checked(Mistake::DampingForce).unwrap();
    let force = error.damping_force;
    // Two dashpots pull dof 2 the same way.
    assert_eq!((force.dof, force.given, force.relative), (2, 0.0, 1.0));
    assert!((force.expected + 1.49 * 1.9 + 1.25).abs() < 1e-12, "{force:?}");
    assert!(error.damping.relative < 1e-9);
}

#[test]
fn a_wrong_potential_is_found() {
    let error = checked(Mistake::Potential).unwrap();
    let gradient = error.potential.unwrap();
    assert!([2, 3].contains(&gradient.dof) && gradient.relative > 1e-3, "{gradient:?}");
    assert!(((gradient.expected - gradient.given).abs() - 2.0 * 0.5_f64.powi(3)).abs() < 1e-9, "{gradient:?}");
    assert!(error.stiffness.relative < 1e-9);
    // A load that is in the force alone looks like a force without potential.
    let gradient = checked(Mistake::Load).unwrap().potential.unwrap();
    assert!((gradient.expected - gradient.given + 0.7).abs() < 1e-9, "{gradient:?}");
}

#[test]
fn wrong_sizes_and_steps_are_refused() {
    for (mistake, part, size) in
        [(Mistake::MassSize, "the mass", 3), (Mistake::PatternSize, "the pattern of the tangent", 5)]
    {
        let error = checked(mistake).unwrap_err();
        assert!(matches!(error, Error::Dimension { what, expected: 4, found } if what == part && found == size));
    }
    let check = |u: &[f64], v: &[f64], step| {
        verify::tangent(&mut Chain::new(Mistake::Nothing), 0.0, u, v, step, 1e-5).unwrap_err()
    };
    assert!(matches!(check(&U[1..], &V, 1e-5), Error::Dimension { found: 3, .. }));
    assert!(matches!(check(&U, &[0.0, f64::NAN, 0.0, 0.0], 1e-5), Error::NotFinite { index: 1, .. }));
    for step in [0.0, f64::NAN, 1e-20] {
        assert!(matches!(check(&U, &V, step), Error::Parameter { name: "the step of displacements", .. }));
    }
}
