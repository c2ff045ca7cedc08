//! The nonsmooth generalized-α scheme: against its papers' equations written out by hand, and for what it conserves.

use contact_dynamics::corrector::{ContactImplicit, NonsmoothSplitting};
use contact_dynamics::{
    Bathe, Composite, Corrector, Error, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::measure::{figures, record_run};
use contact_dynamics_scenes::sparse::{free, matrix, springs};
use contact_dynamics_scenes::{Bars, MassKind};

/// α_m, α_f, β and γ of a scheme.
type Parameters = [f64; 4];

fn parameters(scheme: &GeneralizedAlpha) -> Parameters {
    [scheme.alpha_m(), scheme.alpha_f(), scheme.beta(), scheme.gamma()]
}

/// Two masses on a spring above a floor at −0.1, the lower one in contact now and then, the spring too long by
/// `stretch` at first, with the equations of the papers: smooth
/// accelerations v̇ apart from those that the scheme stores, displacements moved by M⁻¹ ν and velocities by M⁻¹ Λ.
/// Returns u, v and Λ/h of every step, and in how many steps a contact was pressed and parted.
fn by_hand(steps: usize, stretch: f64, h: f64, [am, af, beta, gamma]: Parameters) -> (Vec<[f64; 5]>, u32) {
    let (m, k, floor) = ([0.5, 2.0], 40.0, -0.1);
    let smooth = |u: [f64; 2]| [-k * (u[0] - u[1]) / m[0], (-k * (u[1] - u[0]) - 3.0) / m[1]];
    let (mut u, mut v) = ([0.0, stretch], [-1.0_f64; 2]);
    let mut rate = smooth(u);
    let mut a = rate;
    let (mut out, mut parted) = (Vec::new(), 0);
    for _ in 0..steps {
        // (1 − α_m) a' + α_m a = (1 − α_f) v̇(u') + α_f v̇ with a' = (u' − base − push)/(β h²): two equations for u'.
        let c = beta * h * h / (1.0 - am);
        let base: [f64; 2] = std::array::from_fn(|i| u[i] + h * v[i] + h * h * (0.5 - beta) * a[i]);
        let [s0, s1] = m.map(|m| c * (1.0 - af) * k / m);
        let solve = |push: f64| {
            let right = |i: usize| base[i] + c * (af * rate[i] - am * a[i]);
            let (b0, b1) = (right(0) + push, right(1) - c * (1.0 - af) * 3.0 / m[1]);
            let determinant = (1.0 + s0) * (1.0 + s1) - s0 * s1;
            [(b0 * (1.0 + s1) + s0 * b1) / determinant, (b1 * (1.0 + s0) + s1 * b0) / determinant]
        };
        let (free, unit) = (solve(0.0)[0], solve(1.0)[0] - solve(0.0)[0]);
        let push = f64::max(0.0, (floor - free) / unit);
        let moved = solve(push);
        let next = [moved[0] - base[0] - push, moved[1] - base[1]].map(|way| way / (beta * h * h));
        for i in 0..2 {
            v[i] += h * ((1.0 - gamma) * a[i] + gamma * next[i]);
        }
        u = moved;
        let impulse = if push > 0.0 { f64::max(0.0, -m[0] * v[0]) } else { 0.0 };
        parted += u32::from(push > 0.0 && impulse == 0.0);
        v[0] += impulse / m[0];
        (a, rate) = (next, smooth(u));
        out.push([u[0], u[1], v[0], v[1], impulse / h]);
    }
    (out, parted)
}

#[test]
fn steps_are_those_of_the_papers() {
    let schemes = [
        GeneralizedAlpha::chung_hulbert(0.8).unwrap(),
        GeneralizedAlpha::chung_hulbert(0.3).unwrap(),
        GeneralizedAlpha::hht(0.7).unwrap(),
        GeneralizedAlpha::wbz(0.6).unwrap(),
        GeneralizedAlpha::new(0.0, 0.0, 0.25, 0.5).unwrap(),
    ];
    let (mut touched, mut parted) = (0, 0);
    let sizes = [0.05, 0.1, 0.15, 0.2, 0.3].into_iter().flat_map(|h| [0.0, 0.1, 0.2, 0.3].map(|stretch| (h, stretch)));
    for ((h, stretch), scheme) in sizes.flat_map(|size| schemes.map(|scheme| (size, scheme))) {
        let k = matrix(2, springs(2, 40.0));
        let system = LinearSystem::lumped(vec![0.5, 2.0], k).unwrap().load(|_, f| f[1] = -3.0);
        let mut run = Simulation::builder(system, scheme, h)
            .displacement(vec![0.0, stretch])
            .velocity(vec![-1.0; 2])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.1))
            .corrector(NonsmoothSplitting)
            .build()
            .unwrap();
        let (steps, count) = by_hand(200, stretch, h, parameters(&scheme));
        parted += count;
        for (step, expected) in steps.into_iter().enumerate() {
            run.step().unwrap();
            let (u, v) = (run.state().displacement(), run.state().velocity());
            let found = [u[0], u[1], v[0], v[1], run.state().contacts().forces()[0]];
            for (x, y) in found.into_iter().zip(expected) {
                assert!((x - y).abs() < 1e-9 * (1.0 + y.abs()), "{}, {step}: {found:?} {expected:?}", scheme.name());
            }
            touched += u32::from(expected[4] > 0.0);
        }
    }
    assert!(touched > 10_000 && parted > 0, "{touched} {parted}");
}

/// A scheme with its correction.
type Case = (Box<dyn TimeIntegrator>, Box<dyn Corrector<f64>>);

/// A run that begins in contact has no contact force in its accelerations either: the first force is that of all.
#[test]
fn rest_is_rest_from_the_first_step_on() {
    let scheme = || GeneralizedAlpha::chung_hulbert(0.7).unwrap();
    let cases: [Case; 3] = [
        (Box::new(scheme()), Box::new(NonsmoothSplitting)),
        (Box::new(Newmark::trapezoidal()), Box::new(NonsmoothSplitting)),
        (Box::new(Newmark::trapezoidal()), Box::new(ContactImplicit)),
    ];
    for (scheme, corrector) in cases {
        let name = corrector.name();
        let system = free(&[2.0]).load(|_, f| f[0] = -7.0);
        let mut run = Simulation::builder(system, scheme, 0.1)
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.0))
            .correctors([corrector])
            .build()
            .unwrap();
        for step in 0..20 {
            if step == 10 {
                run.restart().unwrap();
            }
            assert!((run.state().acceleration()[0] + 3.5).abs() < 1e-14, "{name}");
            run.step().unwrap();
            let state = run.state();
            assert!(state.displacement()[0].abs() < 1e-16, "{name}: {:?}", state.displacement());
            assert!(state.velocity()[0].abs() < 1e-15, "{name}");
            assert!((state.contacts().forces()[0] - 7.0).abs() < 1e-13, "{name}: {:?}", state.contacts().forces());
            assert!((state.contacts().impulses()[0] - 0.7).abs() < 1e-14, "{name}");
        }
    }
}

/// Two bars: gap and gap rate vanish in contact, forces stay close to the wave solution after the first, no energy is
/// created by schemes that create none, and impulses are the change of momentum.
#[test]
fn two_bars_in_every_phase() {
    const H: f64 = 1e-3;
    // (The force on a consistent mass rings with it.)
    for (mass, error) in [(MassKind::Lumped, 0.12), (MassKind::Consistent, 0.2)] {
        for phase in [0.05, 0.35, 0.65, 0.95] {
            for rho in [0.8, 1.0] {
                let mut bars = Bars { mass, ..Bars::paper(50) };
                bars.gap = (0.1 + phase * H) * (bars.velocity[0] - bars.velocity[1]);
                let mut run =
                    Simulation::builder(bars.system::<f64>(), GeneralizedAlpha::chung_hulbert(rho).unwrap(), H)
                        .velocity(bars.velocities())
                        .constraint(bars.contact())
                        .corrector(NonsmoothSplitting)
                        .build()
                        .unwrap();
                let record = record_run(&bars, &mut run, 0.4);
                let found = figures(&bars, &record, H);
                let case = format!("{mass:?}, {phase}, ρ∞ = {rho}: {found:?}");
                assert!(found.closure < 1e-10 && found.drift < 1e-10, "{case}");
                assert!(found.energy > 0.97 && found.energy < 1.0 + 1e-12, "{case}");
                assert!(found.force_rms < error, "{case}");
            }
        }
    }
}

/// On an incline: below the friction angle no creep whatever the scheme, above it a = g (sin α − μ cos α).
#[test]
fn a_block_on_an_incline() {
    let run = |scheme: Box<dyn TimeIntegrator>, friction: f64| {
        let (sin, cos) = (0.4_f64.sin(), 0.4_f64.cos());
        let system = free(&[3.0; 2]).load(move |_, f| (f[0], f[1]) = (3.0 * 9.81 * sin, -3.0 * 9.81 * cos));
        Simulation::builder(system, scheme, 1e-2)
            .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)]]))
            .corrector(NonsmoothSplitting)
            .build()
            .unwrap()
    };
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] = [
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        || Box::new(GeneralizedAlpha::hht(0.6).unwrap()),
        || Box::new(Newmark::trapezoidal()),
    ];
    for scheme in schemes {
        let mut held = run(scheme(), 0.45);
        for _ in 0..10_000 {
            held.step().unwrap();
        }
        // (The way made in a step is that of the fall less as much: to the rounding of its square.)
        assert!(held.state().displacement()[0].abs() < 1e-14, "{}: {:?}", scheme().name(), held.state().displacement());
        let friction = held.state().contacts().friction_forces(0)[0];
        assert!((friction + 3.0 * 9.81 * 0.4_f64.sin()).abs() < 1e-10, "{friction}");

        let mut slides = run(scheme(), 0.25);
        for _ in 0..100 {
            slides.step().unwrap();
        }
        let t = slides.time();
        let a = 9.81 * (0.4_f64.sin() - 0.25 * 0.4_f64.cos());
        let state = slides.state();
        assert!((state.velocity()[0] - a * t).abs() < 1e-11, "{}", scheme().name());
        // (The first step does not know that it slides before its velocity does.)
        assert!((state.displacement()[0] - 0.5 * a * t * t).abs() < 1e-3 * a * t * t, "{}", scheme().name());
        assert!((state.contacts().friction_forces(0)[0] + 0.25 * state.contacts().forces()[0]).abs() < 1e-11);
    }
}

#[test]
fn schemes_with_a_past_are_refused() {
    let build = |scheme: Box<dyn TimeIntegrator>| {
        Simulation::builder(free(&[1.0]), scheme, 0.1)
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.1))
            .corrector(NonsmoothSplitting)
            .build()
    };
    for scheme in [Box::new(Composite) as Box<dyn TimeIntegrator>, Box::new(Bathe::new(2.0 - 2.0_f64.sqrt()).unwrap())]
    {
        assert!(matches!(build(scheme), Err(Error::Incompatible { .. })));
    }
}
