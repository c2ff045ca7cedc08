//! The dam as one system: of meshes, or of reduced blocks.

use crate::record::{Record, Steps};
use crate::valley::{Dam, Loading, Plan, RAYLEIGH, Scheme, Way};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::{Blocks, Boundary, Reduction};
use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSolver, LinearSystem, Newmark, PersistencyCorrection};
use contact_dynamics::{Result, Simulation, TimeIntegrator};
use contact_dynamics_scenes::reduced::Model;
use contact_dynamics_scenes::sparse::diagonal;

/// A run.
struct Whole<'a> {
    run: Simulation<'a, f64>,
    unknowns: usize,
    /// The first dof of each contact on the left and on the right; none if the others of the nodes are no unknowns.
    places: Vec<[usize; 2]>,
}

impl Steps for Whole<'_> {
    fn step(&mut self) -> Result<()> {
        self.run.step()
    }

    fn contacts(&self) -> [&[f64]; 2] {
        let contacts = self.run.state().contacts();
        [contacts.forces(), contacts.gaps()]
    }

    fn is_closed(&self, contact: usize) -> bool {
        self.run.state().contacts().closed()[contact]
    }

    fn slip(&self) -> f64 {
        let u = self.run.state().displacement();
        let of = |&[left, right]: &[usize; 2]| [1, 2].map(|k| u[right + k] - u[left + k]);
        self.places.iter().map(of).fold(0.0, |most, [downstream, upward]| most.max(downstream.hypot(upward)))
    }

    fn changes(&self) -> u64 {
        self.run.statistics().contact_changes
    }

    fn factor(&self) -> usize {
        self.run.factor_size()
    }

    fn unknowns(&self) -> usize {
        self.unknowns
    }
}

/// The four loads on all dofs, scaled by what they are at t.
fn under<'a>(system: LinearSystem<'a, f64>, loading: &'a Loading, loads: [Vec<f64>; 4]) -> LinearSystem<'a, f64> {
    system.load(move |t, out| {
        for (load, scale) in loads.iter().zip(loading.at(t)) {
            out.iter_mut().zip(load).for_each(|(out, load)| *out += scale * load);
        }
    })
}

/// The first dof of each contact on both sides, from the place of the contact dofs of each block.
fn places(dam: &Dam, place: impl Fn((usize, usize)) -> usize) -> Vec<[usize; 2]> {
    dam.contacts.iter().map(|sides| sides.map(&place)).collect()
}

/// Rows of all contacts. Where they rub the dofs behind the first one are those along the joint.
fn rows(places: &[[usize; 2]], friction: f64) -> LinearRows<'static, f64> {
    places.iter().fold(LinearRows::new(), |rows, &[left, right]| {
        let along = |k: usize| [(left + k, -1.0), (right + k, 1.0)];
        let rows = rows.unilateral(&along(0), 0.0);
        if friction > 0.0 { rows.friction(friction, &[&along(1), &along(2)]) } else { rows }
    })
}

impl Scheme {
    fn integrator(self) -> Result<Box<dyn TimeIntegrator + Send>> {
        Ok(match self {
            Self::Trapezoidal => Box::new(Newmark::trapezoidal()),
            Self::Damped => Box::new(GeneralizedAlpha::chung_hulbert(0.9)?),
        })
    }
}

/// All meshes, with one linear solver.
pub(crate) fn meshes(
    name: &str,
    scheme: Scheme,
    dam: &Dam,
    loading: &Loading,
    plan: &Plan,
    solver: Box<dyn LinearSolver<f64> + Send>,
) -> Result<Record> {
    let record = Record::of(name, dam, plan.steps, || {
        let (mut blocks, mut firsts) = (Blocks::new(), Vec::new());
        for block in &dam.blocks {
            let mass: SparseColMat<usize, f64> = diagonal(&block.mass);
            firsts.push(blocks.body(mass.as_ref(), block.stiffness.as_ref(), None)?.start);
        }
        let loads = [0, 1, 2, 3].map(|k| dam.blocks.iter().flat_map(|block| block.loads[k].clone()).collect());
        let [of_mass, of_stiffness] = RAYLEIGH;
        let system = under(blocks.system()?.rayleigh(of_mass, of_stiffness)?, loading, loads);
        let places = places(dam, |(block, dof)| firsts[block] + dof);
        let run = Simulation::builder(system, scheme.integrator()?, plan.step)
            .constraint(rows(&places, plan.friction))
            .corrector(PersistencyCorrection::new())
            .linear_solver(solver)
            .start_at_rest()
            .build()?;
        Ok(Whole { run, unknowns: dam.dofs(), places })
    })?;
    Ok(Record { is_damped: scheme == Scheme::Damped, ..record })
}

/// All blocks reduced to so many modes each, and their contact dofs.
pub(crate) fn reduced(dam: &Dam, loading: &Loading, plan: &Plan, way: Way) -> Result<Record> {
    let Way { boundary, softening, modes, scheme } = way;
    let has_mass = boundary == Boundary::CraigBampton;
    let softened = softening.map_or(String::new(), |softening| format!(", softening {softening}"));
    let mut name = format!("{}{softened}, {modes} modes a block", Model::Reduced(boundary).name());
    if !has_mass && scheme == Scheme::Trapezoidal {
        name += ", trapezoidal rule";
    }
    let mut record = Record::of(&name, dam, plan.steps, || {
        let (mut blocks, mut firsts, mut loads) = (Blocks::new(), Vec::new(), [const { Vec::new() }; 4]);
        for block in &dam.blocks {
            let mass: SparseColMat<usize, f64> = diagonal(&block.mass);
            let [of_mass, of_stiffness] = RAYLEIGH;
            let body = Reduction::new(mass.as_ref(), block.stiffness.as_ref(), &block.contact(plan.friction))
                .boundary(boundary)
                .rayleigh(of_mass, of_stiffness);
            let body = softening.into_iter().fold(body, Reduction::softening).modes(modes)?;
            firsts.push(blocks.reduced(&body)?.start + body.contact_dofs().start);
            for (all, own) in loads.iter_mut().zip(&block.loads) {
                all.extend(body.load(own)?);
            }
        }
        let contact: Vec<Vec<usize>> = dam.blocks.iter().map(|block| block.contact(plan.friction)).collect();
        let place = |(block, dof): (usize, usize)| firsts[block] + contact[block].partition_point(|&own| own < dof);
        let places = places(dam, place);
        let builder = Simulation::builder(under(blocks.system()?, loading, loads), scheme.integrator()?, plan.step)
            .constraint(rows(&places, plan.friction))
            .start_at_rest();
        let run = if has_mass { builder.corrector(PersistencyCorrection::new()) } else { builder }.build()?;
        let places = if plan.friction > 0.0 { places } else { Vec::new() };
        Ok(Whole { run, unknowns: blocks.dofs(), places })
    })?;
    record.is_reduced = true;
    record.is_damped = scheme == Scheme::Damped;
    Ok(record)
}
