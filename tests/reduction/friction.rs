//! Friction on reduced bodies: tangential dofs among the contact dofs.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::Reduction;
use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Result, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 1e4, poisson: 0.3, density: 1.0 };
const GRAVITY: f64 = 10.0;
const FRICTION: f64 = 0.3;

type Matrix = SparseColMat<usize, f64>;

/// A block on a floor, thrown along it.
struct Thrown {
    mass: Matrix,
    stiffness: Matrix,
    /// x and y dofs of the nodes on the floor.
    feet: Vec<[usize; 2]>,
    weight: Vec<f64>,
    velocity: Vec<f64>,
}

impl Thrown {
    fn new(speed: f64) -> Self {
        let solid = Solid::rectangle([1.0, 0.5], [8, 4], MATERIAL);
        let feet = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0);
        let lumped: Vec<f64> = solid.lumped_mass();
        let along = |x: f64| (0..solid.dofs()).map(|dof| if dof % 2 == 0 { x } else { 0.0 }).collect();
        Self {
            mass: solid.consistent_mass(),
            stiffness: solid.stiffness(),
            feet: feet.map(|node| [Solid::<2>::dof(node, 0), Solid::<2>::dof(node, 1)]).collect(),
            weight: lumped.iter().enumerate().map(|(dof, m)| if dof % 2 == 1 { -GRAVITY * m } else { 0.0 }).collect(),
            velocity: along(speed),
        }
    }

    /// Modes and the dofs of the feet, with a third of the critical damping, by a scheme that damps what the sudden
    /// weight excites.
    fn reduced(&self, modes: usize, h: f64) -> Result<Simulation<'static, f64>> {
        let contact = self.feet.concat();
        let reduction = Reduction::new(self.mass.as_ref(), self.stiffness.as_ref(), &contact);
        let body = reduction.damping_ratio(|_| 0.3).constant_load(&self.weight).modes(modes)?;
        let first = body.contact_dofs().start;
        let feet: Vec<[usize; 2]> = (0..self.feet.len()).map(|k| [first + 2 * k, first + 2 * k + 1]).collect();
        run(body.system()?, &feet, body.velocity(&self.velocity)?, h)
    }

    fn full(&self, h: f64) -> Result<Simulation<'static, f64>> {
        let weight = self.weight.clone();
        let system = LinearSystem::new(self.mass.clone(), self.stiffness.clone())?;
        run(system.load(move |_, out| out.copy_from_slice(&weight)), &self.feet, self.velocity.clone(), h)
    }
}

fn run(
    system: LinearSystem<'static, f64>,
    feet: &[[usize; 2]],
    velocity: Vec<f64>,
    h: f64,
) -> Result<Simulation<'static, f64>> {
    let floor = feet
        .iter()
        .fold(LinearRows::new(), |rows, &[x, y]| rows.unilateral(&[(y, 1.0)], 0.0).friction(FRICTION, &[&[(x, 1.0)]]));
    Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.5)?, h).velocity(velocity).constraint(floor).build()
}

/// Sums of pressure and friction.
fn forces(run: &Simulation<'_, f64>) -> [f64; 2] {
    let contacts = run.state().contacts();
    let friction = (0..contacts.forces().len()).map(|contact| contacts.friction_forces(contact)[0]).sum();
    [contacts.forces().iter().sum(), friction]
}

/// v₀ − μ g t until it stands, and then it stays.
#[test]
fn a_reduced_block_that_slides_is_slowed_by_coulombs_friction() {
    let (speed, h) = (3.0, 2e-3);
    let thrown = Thrown::new(speed);
    let weight: f64 = -thrown.weight.iter().sum::<f64>();
    let mut run = thrown.reduced(20, h).unwrap();
    let mean = |run: &Simulation<'_, f64>, values: &[f64]| {
        let feet = thrown.feet.len();
        let first = run.state().displacement().len() - 2 * feet;
        (0..feet).map(|k| values[first + 2 * k]).sum::<f64>() / feet as f64
    };
    for _ in 0..10 {
        let until = run.time() + 0.08;
        run.run_until(until, &mut ()).unwrap();
        // The block shakes under its sudden weight, which no mode damps as a whole: friction follows the pressure.
        let [pressure, friction] = forces(&run);
        assert!((friction + FRICTION * pressure).abs() < 1e-9 * weight, "{pressure} {friction}");
        let expected = speed - FRICTION * GRAVITY * run.time();
        let found = mean(&run, run.state().velocity());
        assert!((found - expected).abs() < 0.02 * speed, "{found} {expected}");
    }
    run.run_until(2.0, &mut ()).unwrap();
    assert!(mean(&run, run.state().velocity()).abs() < 1e-3 * speed);
    assert!(forces(&run)[1].abs() < 0.5 * FRICTION * weight);
    let far = mean(&run, run.state().displacement());
    assert!((far / (0.5 * speed * speed / (FRICTION * GRAVITY)) - 1.0).abs() < 0.01, "{far}");
}

/// The impulses of pressure and friction while the sudden weight shakes the block, beside the full model.
#[test]
fn a_reduced_block_rubs_as_the_full_one() {
    let thrown = Thrown::new(3.0);
    let h = 1e-3;
    let impulses = [thrown.reduced(40, h), thrown.full(h)].map(|run| {
        let mut run = run.unwrap();
        let mut sums = [0.0; 2];
        for _ in 0..500 {
            run.step().unwrap();
            sums.iter_mut().zip(forces(&run)).for_each(|(sum, force)| *sum += h * force);
        }
        sums
    });
    for (reduced, full) in impulses[0].iter().zip(impulses[1]) {
        assert!((reduced / full - 1.0).abs() < 0.02, "{impulses:?}");
    }
}
