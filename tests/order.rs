//! Observed order of u, v and a on smooth motion: damped forced oscillator, and several dofs at once.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::reference::{HarmonicForce, forced_oscillator};
use contact_dynamics::{Bathe, Bdf2, Composite, Houbolt, LinearSystem, Newmark, Park, Simulation, TimeIntegrator};

const OMEGA: f64 = 2.0;
const XI: f64 = 0.05;
const FORCE: HarmonicForce = HarmonicForce { frequency: 1.3, cosine: 0.7, sine: 0.4 };

/// Errors of (u, v, a) at t = 8 of the oscillator that starts with force and displacement.
fn oscillator_error(scheme: Box<dyn TimeIntegrator>, steps: u32) -> [f64; 3] {
    let scalar = |x| SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, x)]).unwrap();
    let mass = 3.0;
    let system = LinearSystem::lumped(vec![mass], scalar(mass * OMEGA * OMEGA))
        .unwrap()
        .damping(scalar(mass * 2.0 * XI * OMEGA))
        .unwrap()
        .load(move |t, force| {
            let angle = FORCE.frequency * t;
            force[0] = mass * (FORCE.cosine * angle.cos() + FORCE.sine * angle.sin());
        });
    let h = 8.0 / f64::from(steps);
    let mut run = Simulation::builder(system, scheme, h).displacement(vec![0.3]).velocity(vec![-0.8]).build().unwrap();
    run.run_until(8.0, &mut ()).unwrap();
    let exact = forced_oscillator(OMEGA, XI, FORCE, 0.3, -0.8, 8.0);
    let state = run.state();
    [
        (state.displacement()[0] - exact[0]).abs(),
        (state.velocity()[0] - exact[1]).abs(),
        (state.acceleration()[0] - exact[2]).abs(),
    ]
}

fn observed(error: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
    let (coarse, fine) = (error(1600), error(3200));
    [0, 1, 2].map(|i| (coarse[i] / fine[i]).log2())
}

#[test]
fn damped_forced_oscillator_is_second_order_in_u_v_and_a() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 6] = [
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(Newmark::new(0.3, 0.5).unwrap()),
        || Box::new(Houbolt),
        || Box::new(Park),
        || Box::new(Bathe::default()),
    ];
    for scheme in schemes {
        let order = observed(|steps| oscillator_error(scheme(), steps));
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{}: {order:?}", scheme().name());
    }
}

#[test]
fn newmark_with_numerical_damping_is_first_order() {
    let order = observed(|steps| oscillator_error(Box::new(Newmark::new(0.3025, 0.6).unwrap()), steps));
    assert!(order.iter().all(|o| (o - 1.0).abs() < 0.1), "{order:?}");
}

/// Three masses in a chain on a base, Rayleigh damping, started in a combination of modes of the exact solution.
#[test]
fn several_dofs_are_second_order_from_the_first_step() {
    // K of a fixed-free chain has eigenvectors sin((2j−1)π(i)/(2n+1)); M = 1.
    let n = 3;
    let mut triplets = Vec::new();
    for i in 0..n {
        triplets.push(Triplet::new(i, i, if i + 1 == n { 1.0 } else { 2.0 }));
        if i + 1 < n {
            triplets.push(Triplet::new(i, i + 1, -1.0));
            triplets.push(Triplet::new(i + 1, i, -1.0));
        }
    }
    let stiffness = || SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets).unwrap();
    let (alpha, beta) = (0.02, 0.03);
    let modes: Vec<(f64, Vec<f64>)> = (1..=n)
        .map(|j| {
            let angle = (2 * j - 1) as f64 * std::f64::consts::PI / (2 * n + 1) as f64;
            let shape = (1..=n).map(|i| (i as f64 * angle).sin()).collect();
            (2.0 * (0.5 * angle).sin(), shape)
        })
        .collect();
    let exact = |t: f64| {
        let mut motion = [[0.0; 3]; 3];
        for (omega, shape) in &modes {
            let xi = 0.5 * (alpha / omega + beta * omega);
            let q = contact_dynamics::reference::single_oscillator(*omega, xi, 1.0, 0.5, t);
            for (field, q) in q.iter().enumerate() {
                for (i, s) in shape.iter().enumerate() {
                    motion[field][i] += s * q;
                }
            }
        }
        motion
    };
    let start = exact(0.0);
    // Both at the end and after one step: a first-order start would show there.
    let error = |scheme: Box<dyn TimeIntegrator>, steps: u32, taken: u32| {
        let system = LinearSystem::lumped(vec![1.0; n], stiffness()).unwrap().rayleigh(alpha, beta).unwrap();
        let h = 4.0 / f64::from(steps);
        let mut run = Simulation::builder(system, scheme, h)
            .displacement(start[0].to_vec())
            .velocity(start[1].to_vec())
            .build()
            .unwrap();
        let t = f64::from(taken) * h;
        run.run_until(t, &mut ()).unwrap();
        let (state, exact) = (run.state(), exact(t));
        let worst = |x: &[f64], y: &[f64; 3]| x.iter().zip(y).fold(0.0_f64, |w, (x, y)| w.max((x - y).abs()));
        [
            worst(state.displacement(), &exact[0]),
            worst(state.velocity(), &exact[1]),
            worst(state.acceleration(), &exact[2]),
        ]
    };
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 4] =
        [|| Box::new(Composite), || Box::new(Newmark::trapezoidal()), || Box::new(Bdf2), || Box::new(Houbolt)];
    for scheme in schemes {
        let order = observed(|steps| error(scheme(), steps, steps));
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{}: {order:?}", scheme().name());
        let early = observed(|steps| error(scheme(), steps, 3));
        // (Houbolt changes from two trapezoidal steps to its own rows here.)
        assert!(early.iter().all(|&o| o > 1.75), "{}, third step: {early:?}", scheme().name());
    }
}
