//! Observed order of u, v and a on smooth motion: damped forced oscillator, and several dofs at once.

use contact_dynamics::analysis::order;
use contact_dynamics::tableau::StartUp;
use contact_dynamics::{LinearSystem, Simulation, TimeIntegrator};
use contact_dynamics_scenes::reference::{HarmonicForce, forced_oscillator, single_oscillator};
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::sparse::{matrix, springs};

const OMEGA: f64 = 2.0;
const XI: f64 = 0.05;
const FORCE: HarmonicForce = HarmonicForce { frequency: 1.3, cosine: 0.7, sine: 0.4 };

/// Errors of (u, v, a) at t = 8 of the oscillator that starts with force and displacement.
fn oscillator_error(scheme: Box<dyn TimeIntegrator>, start: StartUp, steps: u32) -> [f64; 3] {
    let scalar = |x| matrix(1, [(0, 0, x)]);
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
    let mut run = Simulation::builder(system, scheme, h)
        .displacement(vec![0.3])
        .velocity(vec![-0.8])
        .start_up(start)
        .build()
        .unwrap();
    run.run_until(8.0, &mut ()).unwrap();
    let exact = forced_oscillator(OMEGA, XI, FORCE, 0.3, -0.8, 8.0);
    let state = run.state();
    [
        (state.displacement()[0] - exact[0]).abs(),
        (state.velocity()[0] - exact[1]).abs(),
        (state.acceleration()[0] - exact[2]).abs(),
    ]
}

fn observed(steps: u32, error: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
    let (coarse, fine) = (error(steps), error(2 * steps));
    [0, 1, 2].map(|i| (coarse[i] / fine[i]).log2())
}

fn is_shifted(scheme: Listed) -> bool {
    order(&(scheme.make)().tableau()).acceleration_shift.abs() > 0.0
}

#[test]
fn damped_forced_oscillator_converges_with_the_order_of_the_scheme_in_u_v_and_a() {
    for scheme in all() {
        // First-order schemes have large constants and approach their order late, and so do those which start with an
        // acceleration of another time.
        let late = scheme.order == 1 || is_shifted(scheme);
        let steps = if late { 25_600 } else { 1600 };
        let found = observed(steps, |steps| oscillator_error((scheme.make)(), StartUp::Trapezoidal, steps));
        let near = |order: &f64| (order - f64::from(scheme.order)).abs() < 0.05;
        assert!(found.iter().all(near), "{}: {found:?}", scheme.name());
    }
}

#[test]
fn a_taylor_past_keeps_the_order_of_multistep_schemes() {
    for scheme in all().into_iter().filter(|scheme| (scheme.make)().tableau().depth() > 1) {
        let found = observed(1600, |steps| oscillator_error((scheme.make)(), StartUp::Taylor, steps));
        assert!(found.iter().all(|order| (order - 2.0).abs() < 0.05), "{}: {found:?}", scheme.name());
    }
}

/// Three masses in a chain on a base, Rayleigh damping, started in a combination of modes of the exact solution.
#[test]
fn several_dofs_are_second_order_from_the_first_step() {
    // K of a fixed-free chain has eigenvectors sin((2j−1)π(i)/(2n+1)); M = 1.
    let n = 3;
    let stiffness = || matrix(n, springs(n, 1.0).chain([(0, 0, 1.0)]));
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
            let q = single_oscillator(*omega, xi, 1.0, 0.5, t);
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
    for scheme in all().into_iter().filter(|scheme| scheme.order == 2) {
        let found = observed(1600, |steps| error((scheme.make)(), steps, steps));
        assert!(found.iter().all(|o| (o - 2.0).abs() < 0.05), "{}: {found:?}", scheme.name());
        // Houbolt and Park change from two trapezoidal steps to their own rows here. Schemes that store a at another
        // time start with that of the first state, which their first few accelerations show. (Errors may change sign
        // early: an order above 2 is no fault.)
        let early = observed(1600, |steps| error((scheme.make)(), steps, 3));
        let least = if is_shifted(scheme) { 0.9 } else { 1.7 };
        assert!(early.iter().all(|&o| o > least), "{}, third step: {early:?}", scheme.name());
    }
}
