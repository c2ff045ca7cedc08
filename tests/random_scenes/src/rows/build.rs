//! From a recipe to a simulation.

use super::nonlinear::Nonlinear;
use super::recipe::{Contacting, Control, Element, Recipe, Row, Solving, Support, Tangent};
use super::rubber::Triangle;
use contact_dynamics::contact::{ContactLaw, GapOffset};
use contact_dynamics::contact_solver::{ActiveSet, Assembly, ContactSolver, GaussSeidel, Pivoting};
use contact_dynamics::{
    ByBody, Cholesky, ConjugateGradients, LinearRows, LinearSolver, LinearSystem, Lu, Newton, Real, Result, Simulation,
    SimulationBuilder, StepControl, System, Tridiagonal,
};
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::sparse::{element, matrix};

/// The time of a wave through an element, over the nominal step.
const TRANSIT: f64 = 3.0;

impl Recipe {
    /// The simulation of the recipe.
    pub(super) fn simulation<T: Real>(&self) -> Result<Simulation<'static, T>> {
        let [length, _, time] = self.units;
        let scaled = |x: &[f64], unit: f64| -> Vec<T> { x.iter().map(|x| T::of(x * unit)).collect() };
        let builder = self.builder::<T>(self.step_size())?;
        builder.displacement(scaled(&self.displacement, length)).velocity(scaled(&self.velocity, length / time)).build()
    }

    /// The nominal one.
    pub(super) fn step_size(&self) -> f64 {
        self.h * self.units[2]
    }

    /// With everything but the state to start from.
    pub(super) fn builder<T: Real>(&self, h: f64) -> Result<SimulationBuilder<'static, T>> {
        let scheme = (schemes::all()[self.scheme].make)();
        let mut builder =
            Simulation::builder(self.system::<T>()?, scheme, h).constraint(self.contact()).newton(match self.tangent {
                Tangent::Full => Newton::full(),
                Tangent::Modified => Newton::modified(),
                Tangent::LineSearch => Newton::full().line_search(),
            });
        builder = match self.correction {
            Correction::None => builder.uncorrected(),
            correction => builder.correctors(correction.correctors(TRANSIT * self.step_size())?),
        };
        let solver: Option<Box<dyn ContactSolver<T>>> = match self.contact_solver {
            Contacting::Default => None,
            Contacting::Pivoting => Some(Box::new(Pivoting::default())),
            Contacting::GaussSeidel => Some(Box::new(GaussSeidel::default())),
            Contacting::WithoutW => Some(Box::new(ActiveSet::default().with_assembly(Assembly::Never))),
        };
        if let Some(solver) = solver {
            builder = builder.contact_solver(solver);
        }
        let solver: Option<Box<dyn LinearSolver<T>>> = match self.linear_solver {
            Solving::Default => None,
            Solving::ByBody => Some(Box::new(ByBody::default())),
            Solving::Cholesky => Some(Box::new(Cholesky::default())),
            Solving::Lu => Some(Box::new(Lu)),
            Solving::ConjugateGradients => Some(Box::new(ConjugateGradients::default())),
            Solving::Tridiagonal => Some(Box::new(Tridiagonal)),
        };
        if let Some(solver) = solver {
            builder = builder.linear_solver(solver);
        }
        let halving = || StepControl::halving(h / 256.0);
        let control = match self.control {
            Control::None => None,
            Control::Halving => Some(halving()?),
            Control::LocalError(tolerance) => Some(halving()?.local_error(tolerance * self.units[0])?),
            Control::ContactChanges(limit) => Some(halving()?.contact_changes(limit)?),
        };
        if let Some(control) = control {
            builder = builder.step_control(control);
        }
        Ok(if self.balance { builder.energy_balance() } else { builder })
    }

    /// In units of stiffness: mass/time².
    fn stiffness_unit(&self) -> f64 {
        let [_, mass, time] = self.units;
        mass / (time * time)
    }

    fn system<T: Real>(&self) -> Result<Box<dyn System<T>>> {
        let [length, mass, time] = self.units;
        let n = self.dofs();
        let unit = self.stiffness_unit();
        // (The diagonal is there, so that dofs without springs have a place.)
        let diagonal = (0..n).map(|i| (i, i, 0.0));
        let stiffness = matrix(n, diagonal.chain(self.elements.iter().flat_map(|e| entries(e, unit))));
        let shares = self.elements.iter().filter(|element| element.shared_mass > 0.0);
        let shares: Vec<_> = shares
            .flat_map(|e| element(e.dofs[0], e.dofs[1], [2.0, 1.0].map(|share| share * e.shared_mass * mass)))
            .collect();
        let lumped = self.mass.iter().map(|m| m * mass);
        let mut system = if shares.is_empty() {
            LinearSystem::lumped(lumped.map(T::of).collect(), stiffness)?
        } else {
            LinearSystem::new(matrix(n, lumped.enumerate().map(|(i, m)| (i, i, m)).chain(shares)), stiffness)?
        };
        let [of_mass, of_stiffness] = self.damping;
        if of_mass > 0.0 || of_stiffness > 0.0 {
            system = system.rayleigh(T::of(of_mass / time), T::of(of_stiffness * time))?;
        }
        if !self.load.constant.is_empty() {
            let load = self.load.clone();
            let force = mass * length / (time * time);
            system = system.load(move |t, out| {
                let sin = (load.frequency / time * t).sin();
                for ((out, f), a) in out.iter_mut().zip(&load.constant).zip(&load.amplitude) {
                    *out += T::of((f + a * sin) * force);
                }
            });
        }
        for &Support { dof, amplitude, frequency } in &self.supports {
            system = if amplitude == 0.0 {
                system.fix(dof)?
            } else {
                system.drive(dof, move |t| swing(amplitude * length, frequency / time, t).map(T::of))?
            };
        }
        let hardening = self.elements.iter().filter(|element| element.hardening > 0.0);
        let springs: Vec<_> = hardening
            .map(|e| ([e.dofs[0], e.dofs[1]].map(Some), T::of(e.hardening * unit / (length * length))))
            .collect();
        let rubber = self.elements.iter().filter_map(|e| Some((&e.dofs[..], e.rubber.as_ref()?, &e.stiffness[..])));
        let triangles: Vec<_> = rubber.map(|rubber| Triangle::new(rubber, [length, unit])).collect();
        if springs.is_empty() && triangles.is_empty() {
            return Ok(Box::new(system));
        }
        Ok(Box::new(Nonlinear::new(system, springs, triangles)))
    }

    fn contact<T: Real>(&self) -> LinearRows<'static, T> {
        let [length, _, time] = self.units;
        let typed = |terms: &[(usize, f64)]| -> Vec<(usize, T)> {
            terms.iter().map(|&(dof, weight)| (dof, T::of(weight))).collect()
        };
        self.rows.iter().fold(LinearRows::new(), |rows, row| {
            let Row { gap, amplitude, frequency, .. } = *row;
            let offset: GapOffset<'static, T> = if amplitude == 0.0 {
                GapOffset::from(T::of(gap * length))
            } else {
                GapOffset::moving(move |t| {
                    let [way, rate, acceleration] = swing(amplitude * length, frequency / time, t);
                    [gap * length + way, rate, acceleration].map(T::of)
                })
            };
            let rows = rows.row(self.in_units(row.law), &typed(&row.terms), offset);
            match &row.friction {
                None => rows,
                Some((coefficient, tangents)) => {
                    let tangents: Vec<_> = tangents.iter().map(|tangent| typed(tangent)).collect();
                    let tangents: Vec<_> = tangents.iter().map(|tangent| &tangent[..]).collect();
                    rows.friction(*coefficient, &tangents)
                }
            }
        })
    }

    fn in_units(&self, law: ContactLaw) -> ContactLaw {
        let [length, mass, _] = self.units;
        let unit = self.stiffness_unit();
        match law {
            ContactLaw::Penalty { stiffness } => ContactLaw::Penalty { stiffness: stiffness * unit },
            ContactLaw::PowerLaw { stiffness, exponent } => {
                ContactLaw::PowerLaw { stiffness: stiffness * unit * length.powf(1.0 - exponent), exponent }
            }
            ContactLaw::Bipenalty { stiffness, mass: m } => {
                ContactLaw::Bipenalty { stiffness: stiffness * unit, mass: m * mass }
            }
            ContactLaw::StabilizedBipenalty { stiffness } => {
                ContactLaw::StabilizedBipenalty { stiffness: stiffness * unit }
            }
            ContactLaw::AugmentedLagrangian { stiffness, augmentations } => {
                ContactLaw::AugmentedLagrangian { stiffness: stiffness * unit, augmentations }
            }
            law => law,
        }
    }
}

/// a sin(w t) with its derivatives.
fn swing(a: f64, w: f64, t: f64) -> [f64; 3] {
    let (sin, cos) = (w * t).sin_cos();
    [a * sin, a * w * cos, -a * w * w * sin]
}

fn entries(element: &Element, unit: f64) -> impl Iterator<Item = (usize, usize, f64)> {
    let dofs = element.dofs.iter().enumerate();
    let pairs = dofs.flat_map(|(i, &row)| element.dofs.iter().enumerate().map(move |(j, &column)| (i, row, j, column)));
    pairs.map(move |(i, row, j, column)| (row, column, unit * element.stiffness[element.dofs.len() * i + j]))
}
