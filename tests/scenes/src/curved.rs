//! Motion along curved gaps, without friction: what a scheme makes of energy and place where the exact motion is known.

use contact_dynamics::contact::{GapFunction, NodesOnObstacle, Side, Sphere};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{ContactConstraint, ContactLaw, Corrector, LinearSystem, Simulation, TimeIntegrator};

/// The scenes. Radius, masses and speeds are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// A particle runs once around inside a circle.
    Circle,
    /// A particle slides in a round bowl, with gravity; it starts at the bottom and stays below the rim.
    Bowl,
    /// Two beads on a circular wire, an equality row each, joined by a spring.
    Dumbbell,
    /// Two free particles joined by a rod, an equality row, turn about each other and fly on.
    Rod,
}

pub const SCENES: [Scene; 4] = [Scene::Circle, Scene::Bowl, Scene::Dumbbell, Scene::Rod];

/// What came out at the end of a run.
#[derive(Clone, Copy, Debug)]
pub struct Drift {
    /// Largest change of the energy on the way, over that of the start, and the change at the end.
    pub energy: f64,
    pub at_end: f64,
    /// Distance of the first particle from where it should be.
    pub place: f64,
    /// Largest violation of a gap.
    pub gap: f64,
    /// Work that the books give to contact, and the remainder, over the energy of the start.
    pub work: f64,
    pub remainder: f64,
}

impl Scene {
    /// Places of the particles at u = 0, their velocities, the stiffness of the spring between them, gravity, the time.
    fn data(self) -> (Vec<f64>, Vec<f64>, f64, f64, f64) {
        match self {
            Self::Circle => (vec![0.0, -1.0], vec![1.0, 0.0], 0.0, 0.0, 6.0),
            Self::Bowl => (vec![0.0, -1.0], vec![1.0, 0.0], 0.0, 1.0, 6.0),
            // A quarter of a circle apart.
            Self::Dumbbell => (vec![0.0, -1.0, 1.0, 0.0], vec![1.0, 0.0, 0.0, 0.2], 8.0, 0.0, 6.0),
            Self::Rod => (vec![0.0, 0.0, 1.0, 0.0], vec![0.3, -0.5, 0.3, 0.5], 0.0, 0.0, 6.0),
        }
    }

    fn constraint<'a>(self, places: &[f64]) -> Box<dyn ContactConstraint<f64> + 'a> {
        let nodes: Vec<[f64; 2]> = places.chunks(2).map(|x| [x[0], x[1]]).collect();
        let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|node| [2 * node, 2 * node + 1]).collect();
        if self == Self::Rod {
            let place = [places[0], places[1], places[2], places[3]];
            let rod = move |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
                let r = [0, 1].map(|i| place[2 + i] + x[2 + i] - place[i] - x[i]);
                let w = [0, 1].map(|i| v[2 + i] - v[i]);
                let length = r[0].hypot(r[1]);
                let n = r.map(|r| r / length);
                gradient.copy_from_slice(&[-n[0], -n[1], n[0], n[1]]);
                let across = n[0] * w[1] - n[1] * w[0];
                [length - 1.0, 0.0, across * across / length]
            };
            return Box::new(GapFunction::new(&[0, 1, 2, 3], rod).with_law(ContactLaw::Equality));
        }
        let bowl = Sphere::new([0.0, 0.0], 1.0, Side::Inside).unwrap();
        let all: Vec<usize> = (0..nodes.len()).collect();
        let law = if self == Self::Dumbbell { ContactLaw::Equality } else { ContactLaw::Rigid };
        Box::new(NodesOnObstacle::new(bowl, &nodes, &dofs, &all).unwrap().with_law(law))
    }

    /// Place of the first particle at the end, if it is known in closed form or by a fine reference.
    fn reference(self) -> Option<[f64; 2]> {
        let (.., gravity, time) = self.data();
        match self {
            Self::Circle => Some([time.sin(), -time.cos()]),
            Self::Bowl => {
                let (mut angle, mut rate) = (0.0_f64, 1.0);
                let steps = 60_000;
                let h = time / f64::from(steps);
                let slope = |[angle, rate]: [f64; 2]| [rate, -gravity * f64::sin(angle)];
                for _ in 0..steps {
                    let at = |k: [f64; 2], share: f64| [angle + share * h * k[0], rate + share * h * k[1]];
                    let a = slope([angle, rate]);
                    let b = slope(at(a, 0.5));
                    let c = slope(at(b, 0.5));
                    let d = slope(at(c, 1.0));
                    angle += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]);
                    rate += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]);
                }
                Some([angle.sin(), -angle.cos()])
            }
            Self::Dumbbell => None,
            // The middle flies on, the rod turns with rate 1.
            Self::Rod => Some([0.5 + 0.3 * time - 0.5 * time.cos(), -0.5 * time.sin()]),
        }
    }

    /// Runs a scheme with the step size `h`.
    pub fn run<'a>(
        self,
        scheme: impl TimeIntegrator + 'a,
        correctors: impl IntoIterator<Item = Box<dyn Corrector<f64> + 'a>>,
        h: f64,
    ) -> contact_dynamics::Result<Drift> {
        let (places, velocity, spring, gravity, time) = self.data();
        let dofs = places.len();
        let mut entries: Vec<_> = (0..dofs).map(|dof| Triplet::new(dof, dof, spring)).collect();
        if spring > 0.0 {
            entries.extend((0..2).flat_map(|i| [Triplet::new(i, 2 + i, -spring), Triplet::new(2 + i, i, -spring)]));
        }
        let k = SparseColMat::<usize, f64>::try_new_from_triplets(dofs, dofs, &entries).unwrap();
        let weight: Vec<f64> = (0..dofs).map(|dof| if dof % 2 == 1 { -gravity } else { 0.0 }).collect();
        let load = weight.clone();
        let system =
            LinearSystem::lumped(vec![1.0; dofs], k)?.load(move |_: f64, f: &mut [f64]| f.copy_from_slice(&load));
        let mut run = Simulation::builder(system, scheme, h)
            .velocity(velocity)
            .constraint(self.constraint(&places))
            .uncorrected()
            .correctors(correctors)
            .energy_balance()
            .build()?;
        let own = |u: &[f64]| -weight.iter().zip(u).map(|(f, u)| f * u).sum::<f64>();
        let before = run.energy().total() + own(run.state().displacement());
        let (mut energy, mut at_end, mut gap, mut work, mut remainder) = (0.0_f64, 0.0, 0.0_f64, 0.0, 0.0);
        while run.time() < time - 1e-9 * h {
            run.step()?;
            let now = run.energy();
            let state = run.state();
            at_end = (now.total() + own(state.displacement()) - before) / before;
            energy = energy.max(at_end.abs());
            gap = state.contacts().gaps().iter().fold(gap, |gap, g| gap.max(g.abs()));
            if let Some(works) = now.works {
                (work, remainder) = (works.contact / before, works.remainder / before);
            }
        }
        let u = run.state().displacement();
        let place = self.reference().map_or(0.0, |[x, y]| (places[0] + u[0] - x).hypot(places[1] + u[1] - y));
        Ok(Drift { energy, at_end, place, gap, work, remainder })
    }
}
