//! Systems of random scenes that are not linear.

use super::rubber::Triangle;
use contact_dynamics::faer::sparse::SymbolicSparseColMatRef;
use contact_dynamics::{DampingForce, LinearSystem, Linearity, Mass, Real, Result, System, TangentWeights};

/// A linear system with springs whose force grows with the cube of their extension, and what triangles of rubber add to
/// their linear forces.
pub struct Nonlinear<T: Real> {
    linear: LinearSystem<'static, T>,
    /// Both dofs, or one and the ground, and k₃.
    springs: Vec<([Option<usize>; 2], T)>,
    /// Where the entries of each spring are among the values of the tangent, with their signs.
    places: Vec<Vec<(usize, f64)>>,
    triangles: Vec<Triangle<T>>,
    /// The same of each pair of their dofs, row by row.
    of_triangles: Vec<Vec<usize>>,
}

/// The dofs of a spring, with the signs by which they make it longer.
fn signed(ends: [Option<usize>; 2]) -> impl Iterator<Item = (usize, f64)> {
    ends.into_iter().zip([1.0, -1.0]).filter_map(|(end, sign)| Some((end?, sign)))
}

/// How much longer a spring is.
fn length<T: Real>(ends: [Option<usize>; 2], u: &[T]) -> T {
    signed(ends).map(|(dof, sign)| T::of(sign) * u[dof]).sum()
}

impl<T: Real> Nonlinear<T> {
    pub fn new(
        linear: LinearSystem<'static, T>,
        springs: Vec<([Option<usize>; 2], T)>,
        triangles: Vec<Triangle<T>>,
    ) -> Self {
        let pattern = linear.pattern();
        let place = |row: usize, column: usize| {
            let range = pattern.col_range(column);
            let found = pattern.row_idx()[range.clone()].iter().position(|&i| i == row);
            range.start + found.expect("a spring is in the pattern")
        };
        let of_spring = |(ends, _): &([Option<usize>; 2], T)| {
            let pairs = signed(*ends).flat_map(|one| signed(*ends).map(move |other| (one, other)));
            pairs.map(|((i, x), (j, y))| (place(i, j), x * y)).collect()
        };
        let places = springs.iter().map(of_spring).collect();
        let of_triangle = |triangle: &Triangle<T>| {
            let dofs = &triangle.dofs;
            dofs.iter()
                .flat_map(|&row| dofs.iter().map(move |&column| (row, column)))
                .map(|(i, j)| place(i, j))
                .collect()
        };
        let of_triangles = triangles.iter().map(of_triangle).collect();
        Self { places, linear, springs, triangles, of_triangles }
    }
}

impl<T: Real> System<T> for Nonlinear<T> {
    fn dofs(&self) -> usize {
        self.linear.dofs()
    }
    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }
    fn mass(&self) -> Mass<'_, T> {
        self.linear.mass()
    }
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        self.linear.force(t, u, v, out)?;
        for &(ends, k) in &self.springs {
            let d = length(ends, u);
            let force = k * d * d * d;
            signed(ends).for_each(|(dof, sign)| out[dof] -= T::of(sign) * force);
        }
        for triangle in &self.triangles {
            let beyond = triangle.force_beyond("force", u)?;
            triangle.dofs.iter().zip(beyond).for_each(|(&dof, force)| out[dof] -= force);
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.linear.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        self.linear.tangent(t, u, v, weights, out)?;
        for (&(ends, k), places) in self.springs.iter().zip(&self.places) {
            let d = length(ends, u);
            let slope = weights.stiffness * T::of(3.0) * k * d * d;
            places.iter().for_each(|&(place, sign)| out[place] += T::of(sign) * slope);
        }
        for (triangle, places) in self.triangles.iter().zip(&self.of_triangles) {
            let beyond = triangle.stiffness_beyond("tangent", u)?;
            places.iter().zip(beyond.as_flattened()).for_each(|(&place, &k)| out[place] += weights.stiffness * k);
        }
        Ok(())
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        self.linear.damping_force()
    }
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        let springs = self.springs.iter().map(|&(ends, k)| {
            let d = length(ends, u);
            T::of(0.25) * k * d * d * d * d
        });
        let beyond: T = springs.chain(self.triangles.iter().map(|triangle| triangle.energy_beyond(u))).sum();
        self.linear.potential_energy(u).map(|linear| linear + beyond)
    }
    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        self.linear.external_load(t, out)
    }
    fn prescribed(&self) -> &[usize] {
        self.linear.prescribed()
    }
    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
        self.linear.prescribed_motion(t, out)
    }
}
