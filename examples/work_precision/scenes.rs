//! Two scenes with smooth motion and exact answers.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{Control, LinearSystem, Simulation, StepView, TimeIntegrator};
use contact_dynamics_scenes::reference::single_oscillator;
use contact_dynamics_scenes::springs;
use std::f64::consts::PI;
use std::time::Instant;

/// Makes a scheme.
pub(crate) type Make = fn() -> Box<dyn TimeIntegrator>;

/// Square of the error of u and v at t, and that of the exact motion.
type ErrorFunction = dyn Fn(f64, &[f64], &[f64]) -> [f64; 2];

/// A scene: its system, start, length in time, and error.
pub(crate) struct Scene {
    pub(crate) key: &'static str,
    pub(crate) title: &'static str,
    until: f64,
    system: Box<dyn Fn() -> LinearSystem<'static, f64>>,
    start: [Vec<f64>; 2],
    /// Time from which on the error is looked at.
    from: f64,
    error: Box<ErrorFunction>,
}

impl Scene {
    /// Relative error, and seconds a run; `None` if the run blew up.
    pub(crate) fn run(&self, make: Make, steps: u32, repetitions: usize) -> Option<(f64, f64)> {
        let h = self.until / f64::from(steps);
        let build = || {
            let [u, v] = self.start.clone();
            Simulation::builder((self.system)(), make(), h).displacement(u).velocity(v).build().ok()
        };
        let mut sums = [0.0; 2];
        let observer = &mut |step: &StepView<'_, f64>| {
            let state = step.state;
            if state.time() > self.from {
                let squares = (self.error)(state.time(), state.displacement(), state.velocity());
                (sums[0], sums[1]) = (sums[0] + squares[0], sums[1] + squares[1]);
            }
            Control::Continue
        };
        build()?.run_until(self.until, observer).ok()?;
        let error = (sums[0] / sums[1]).sqrt();
        if !error.is_finite() {
            return None;
        }
        // The fastest of several runs: others were disturbed.
        let mut fastest = f64::INFINITY;
        for _ in 0..repetitions {
            let mut run = build()?;
            let begin = Instant::now();
            run.run_until(self.until, &mut ()).ok()?;
            fastest = fastest.min(begin.elapsed().as_secs_f64());
        }
        Some((error, fastest))
    }
}

/// A bar of 100 linear elements, fixed at one end, in three of its lowest modes, with Rayleigh damping.
pub(crate) fn damped_bar() -> Scene {
    let n = 100;
    let size = 1.0 / n as f64;
    let (alpha, beta) = (0.1, 1e-3);
    let lumped = move |node: usize| if node == n { 0.5 * size } else { size };
    let stiffness = move || {
        let mut triplets = Vec::new();
        for node in 1..=n {
            triplets.push(Triplet::new(node - 1, node - 1, if node == n { 1.0 } else { 2.0 } / size));
            if node < n {
                triplets.push(Triplet::new(node - 1, node, -1.0 / size));
                triplets.push(Triplet::new(node, node - 1, -1.0 / size));
            }
        }
        SparseColMat::try_new_from_triplets(n, n, &triplets).unwrap()
    };
    let system = move || {
        let masses = (1..=n).map(lumped).collect();
        LinearSystem::lumped(masses, stiffness()).unwrap().rayleigh(alpha, beta).unwrap()
    };
    // The eigenvectors of the lumped chain are sines, also with the half mass at its end.
    let modes: Vec<(f64, f64, Vec<f64>)> = [(1_u32, 1.0), (2, 0.5), (3, 0.25)]
        .into_iter()
        .map(|(j, amplitude)| {
            let angle = 0.5 * PI * f64::from(2 * j - 1) * size;
            let shape = (1..=n).map(|node| (node as f64 * angle).sin()).collect();
            (2.0 / size * (0.5 * angle).sin(), amplitude, shape)
        })
        .collect();
    let exact = move |t: f64| {
        let mut motion = [vec![0.0; n], vec![0.0; n]];
        for (omega, amplitude, shape) in &modes {
            let xi = 0.5 * (alpha / omega + beta * omega);
            let q = single_oscillator(*omega, xi, *amplitude, 0.5 * omega * amplitude, t);
            for (field, q) in motion.iter_mut().zip(q) {
                field.iter_mut().zip(shape).for_each(|(x, s)| *x += s * q);
            }
        }
        motion
    };
    let start = exact(0.0);
    // Kinetic and elastic energy of a motion, doubled.
    let energy = move |u: &[f64], v: &[f64]| {
        let kinetic: f64 = v.iter().zip(1..).map(|(v, node)| lumped(node) * v * v).sum();
        let strains = (0..n).map(|i| u[i] - if i == 0 { 0.0 } else { u[i - 1] });
        kinetic + strains.map(|strain| strain * strain / size).sum::<f64>()
    };
    let error = move |t: f64, u: &[f64], v: &[f64]| {
        let [exact_u, exact_v] = exact(t);
        let difference = |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x - y).collect() };
        [energy(&difference(u, &exact_u), &difference(v, &exact_v)), energy(&exact_u, &exact_v)]
    };
    Scene {
        key: "bar",
        title: "Damped bar, 100 dofs",
        until: 8.0,
        system: Box::new(system),
        start,
        from: 7.0,
        error: Box::new(error),
    }
}

/// A driven dof, a stiff spring (10⁷) to a unit mass, a soft one (1) to another (Bathe, Noh, Comput. Struct. 98–99,
/// 2012): the error is that of the second mass.
pub(crate) fn stiff_soft() -> Scene {
    let error = move |t: f64, u: &[f64], v: &[f64]| {
        let frequency = springs::FREQUENCY;
        let denominator = 1.0 - frequency * frequency;
        let exact_u = ((frequency * t).sin() - frequency * t.sin()) / denominator;
        let exact_v = frequency * ((frequency * t).cos() - t.cos()) / denominator;
        [(u[2] - exact_u).powi(2) + (v[2] - exact_v).powi(2), exact_u * exact_u + exact_v * exact_v]
    };
    Scene {
        key: "springs",
        title: "Stiff and soft spring",
        until: 10.0,
        system: Box::new(springs::stiff_soft),
        start: [vec![0.0; 3], vec![0.0, 0.0, 0.0]],
        from: 5.0,
        error: Box::new(error),
    }
}
