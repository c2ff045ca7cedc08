//! Bonds: when they break, what is left of them, what a run remembers of it.

use contact_dynamics::contact::{
    BondStrength, ContactConstraint, ContactLaw, GapOffset, LinearRows, Mortar, SurfaceSettings,
};
use contact_dynamics::observer::{Control, StepView};
use contact_dynamics::{
    Composite, ContactStatus, Error, Newmark, PersistencyCorrection, Real, Simulation, SimulationBuilder, StepControl,
    TimeIntegrator, verify,
};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::bars::Bars;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// A bar of length 10 with waves of speed 1 and a bond at 2 from its free end, that a pressure of 1 hits on the other
/// end for a time of 4. Where the reflected front meets the end of the pulse, in the bond, all of the pulse is to the
/// right of it, without stress, and has the velocity 2.
fn spall(per_length: usize, strength: f64, scheme: Box<dyn TimeIntegrator>) -> SimulationBuilder<'static, f64> {
    let bars = Bars {
        elements: [8 * per_length, 2 * per_length],
        young: [1.0; 2],
        density: [1.0; 2],
        area: 1.0,
        length: [8.0, 2.0],
        velocity: [0.0; 2],
        gap: 0.0,
        ..Bars::paper(1)
    };
    let [left, right] = bars.contact_dofs();
    let h = 0.4 / per_length as f64;
    let system = bars.system::<f64>().load(move |t, f| f[0] = if t < 4.0 - 0.5 * h { 1.0 } else { 0.0 });
    let bond = LinearRows::new().bond(strength, &[(left, -1.0), (right, 1.0)], 0.0);
    Simulation::builder(system, scheme, h).constraint(bond).energy_balance()
}

/// Momentum of the bar left of the bond, and of what is right of it.
fn momenta(per_length: usize, velocity: &[f64]) -> [f64; 2] {
    let size = 1.0 / per_length as f64;
    let of = |v: &[f64]| size * (v.iter().sum::<f64>() - 0.5 * (v[0] + v[v.len() - 1]));
    let (left, right) = velocity.split_at(8 * per_length + 1);
    [of(left), of(right)]
}

#[test]
fn a_pulse_tears_off_the_end_of_a_bar_and_stays_in_it() {
    let per_length = 40;
    for strength in [0.4, 0.6, 0.8] {
        for scheme in [Box::new(Composite) as Box<dyn TimeIntegrator>, Box::new(Newmark::trapezoidal())] {
            let name = scheme.name();
            let mut run = spall(per_length, strength, scheme).build().unwrap();
            let mut events = Vec::new();
            run.run_until(16.0, &mut |step: &StepView<'_, f64>| {
                events.extend_from_slice(step.state.newly_broken_bonds());
                Control::Continue
            })
            .unwrap();
            let [bond] = events[..] else { panic!("{name}, {strength}: {events:?}") };
            assert_eq!((bond.constraint, bond.feature), (0, 0));
            assert!((bond.time - 12.0).abs() < 0.2 && (1.0..1.5).contains(&bond.load), "{name}, {strength}: {bond:?}");
            let [left, right] = momenta(per_length, run.state().velocity());
            assert!((left + right - 4.0).abs() < 0.02 && left.abs() < 0.15, "{name}, {strength}: {left} {right}");
            assert!(run.gaps()[0] > 7.0 && !run.state().contacts().closed()[0]);
        }
    }
    // What is never reached breaks nothing.
    let mut run = spall(per_length, 1.6, Box::new(Composite)).build().unwrap();
    run.run_until(16.0, &mut ()).unwrap();
    assert!(run.state().broken_bonds().is_empty() && run.gaps()[0].abs() < 1e-12);
}

#[test]
fn what_breaks_takes_or_gives_no_energy_but_for_half_a_step() {
    // The force of the last step in which it held acts on for half a step: that is in the books, and goes with h.
    let lost = |per_length: usize| {
        let mut run = spall(per_length, 0.6, Box::new(Newmark::trapezoidal())).uncorrected().build().unwrap();
        run.run_until(11.0, &mut ()).unwrap();
        let before = run.energy();
        run.run_until(14.0, &mut ()).unwrap();
        assert_eq!(run.state().broken_bonds().len(), 1);
        let after = run.energy();
        let works = after.works.unwrap();
        assert!(works.remainder.abs() < 1e-9, "{works:?}");
        let change = after.total() - before.total();
        assert!((change - (works.contact - before.works.unwrap().contact)).abs() < 1e-9);
        change
    };
    let [coarse, fine] = [20, 80].map(lost);
    assert!(coarse < 0.0 && fine < 0.0 && fine > 0.4 * coarse && fine > -0.02, "{coarse:e} {fine:e}");
}

#[test]
fn runs_go_on_from_a_broken_bond_bit_for_bit() {
    let builder = || spall(10, 0.6, Box::new(Composite));
    let mut run = builder().build().unwrap();
    run.run_until(13.0, &mut ()).unwrap();
    let (state, history) = (run.state().clone(), run.history().clone());
    assert_eq!(state.broken_bonds().len(), 1);
    let mut other = builder().resume(state.clone(), history.clone()).build().unwrap();
    run.run_until(16.0, &mut ()).unwrap();
    other.run_until(16.0, &mut ()).unwrap();
    assert_eq!(run.state(), other.state());
    // A run that begins again knows what is broken.
    run.restart().unwrap();
    run.step().unwrap();
    assert!(run.state().broken_bonds().len() == 1 && run.gaps()[0] > 1.0);
    // A constraint that has served a run is whole at the start of the next one.
    let mut bond = LinearRows::new().bond(0.5, &[(0, 1.0)], 0.0);
    for _ in 0..2 {
        let mass = contact_dynamics_scenes::masses::MassMatrix::Lumped(vec![1.0]);
        let free = contact_dynamics_scenes::sparse::matrix(1, []);
        let pulled = mass.system(free).unwrap().load(|t, f| f[0] = t);
        let mut run = Simulation::builder(pulled, Newmark::trapezoidal(), 0.1).constraint(&mut bond).build().unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        assert!((run.state().broken_bonds()[0].time - 0.5).abs() < 0.11);
    }
    // A run without the constraint cannot go on from there.
    let lone = Bars { elements: [80, 20], ..Bars::paper(1) };
    let error = Simulation::builder(lone.system::<f64>(), Composite, 0.04).resume(state, history).build().unwrap_err();
    assert!(error.to_string().contains("broken bond of constraint 0"), "{error}");
}

#[test]
fn steps_that_are_refused_break_nothing() {
    // Steps of one change of contact at most: what breaks counts in the step that opens it.
    let control = StepControl::halving(1e-3).unwrap().local_error(1e-3).unwrap();
    let mut run = spall(10, 0.6, Box::new(Newmark::trapezoidal())).step_control(control).build().unwrap();
    let mut last = 0;
    while run.time() < 16.0 {
        run.step().unwrap();
        let broken = run.state().broken_bonds();
        assert!(broken.len() >= last && broken.iter().all(|bond| bond.time <= run.time()));
        last = broken.len();
    }
    assert!(last == 1 && run.statistics().refused_steps > 0);
    assert!(run.state().broken_bonds()[0].load < 1.2, "{:?}", run.state().broken_bonds());
}

#[test]
fn strengths_that_are_none_are_refused() {
    for (tension, shear) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (f64::INFINITY, f64::INFINITY)] {
        assert!(matches!(BondStrength::new(tension, shear), Err(Error::Parameter { .. })), "{tension} {shear}");
    }
    let never_by_shear = BondStrength::new(2.0, f64::INFINITY).unwrap();
    assert!((never_by_shear.load([1.0, 1e9]) - 0.5).abs() < 1e-15 && never_by_shear.load([-5.0, 1e9]).abs() < 1e-15);
    for strength in [0.0, f64::NAN, f64::INFINITY] {
        let mut rows = LinearRows::new().bond(strength, &[(0, 1.0)], GapOffset::Constant(0.0));
        assert!(matches!(rows.search(0.0, &[0.0], &[0.0], 0.0), Err(Error::Parameter { .. })), "{strength}");
    }
    let stack = Stack::new([1, 1].map(|n| Solid::rectangle([1.0; 2], [n, 1], MATERIAL)), 0.0, |x| x);
    let glue = BondStrength::new(1.0, 1.0).unwrap();
    assert!(matches!(
        stack.mortar(true).unwrap().bonded(glue).unwrap().with(SurfaceSettings::new().offsets(&[0.1; 8])),
        Err(Error::Incompatible { .. })
    ));
}

/// Nodes turned by an angle in the plane of the first axis and the last, as displacements.
fn turned<const D: usize>(nodes: &[[f64; D]], angle: f64) -> Vec<f64> {
    let (sine, cosine) = angle.sin_cos();
    let turn = |x: &[f64; D]| {
        let mut u = [0.0; D];
        u[0] = cosine * x[0] - sine * x[D - 1] - x[0];
        u[D - 1] = sine * x[0] + cosine * x[D - 1] - x[D - 1];
        u
    };
    nodes.iter().flat_map(turn).collect()
}

/// Tractions along the normal and across it are what they are in whichever way bodies have turned.
fn check_axes<const D: usize>(stack: &Stack<D>) {
    let glue = BondStrength::new(1.0, 2.0).unwrap();
    let mut contact = stack.mortar(true).unwrap().friction(0.4).bonded(glue).unwrap();
    let mut nodes: Vec<usize> = stack.facets[1].iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();

    for angle in [0.0_f64, 0.7, 2.5] {
        let u = turned(&stack.solid.nodes, angle);
        contact.search_on(0.0, &u, &vec![0.0; u.len()], 0.0).unwrap();
        let contacts = contact.found();
        // On the upper body a pull acts against the normal of its lower side, (0, …, −1) turned.
        let (sine, cosine) = angle.sin_cos();
        for (place, &node) in nodes.iter().enumerate() {
            let row = D * place;
            assert_eq!((contacts.name(row).0, contacts.law(row)), (node, ContactLaw::Equality));
            let mut on_master = [0.0; D];
            for (place, weight) in contacts.row(row) {
                let dof = contact.dofs()[place];
                if dof < D * stack.split {
                    on_master[dof % D] += weight;
                }
            }
            assert!((on_master[0] - sine).abs() < 1e-13 && (on_master[D - 1] + cosine).abs() < 1e-13, "{on_master:?}");
        }
    }
    // Rows are derivatives of gaps, before and after bonds break.
    let broken: Vec<usize> = nodes.iter().step_by(2).copied().collect();
    for features in [&[][..], &broken] {
        contact.set_broken(features);
        let mut random = xorshift(11);
        let count = stack.solid.dofs();
        let mut shaken = |size: f64| (0..count).map(|_| size * (random() - 0.5)).collect::<Vec<_>>();
        let (u, v) = (shaken(0.1), shaken(1.0));
        let error = verify::gap_jacobian(&mut contact, 0.0, &u, &v, 1e-5).unwrap();
        assert_eq!(error.rows, D * (nodes.len() - features.len()) + features.len());
        // (Quadrature in warped facets has kinks where its points move, as in tests/contact/mortar.rs.)
        let bound = if features.is_empty() { 1e-8 } else { 1e-3 };
        assert!(error.jacobian < bound, "{error:?}");
    }
}

#[test]
fn bonds_turn_with_the_bodies() {
    check_axes(&Stack::new([3, 4].map(|n| Solid::rectangle([1.0; 2], [n, 2], MATERIAL)), 0.0, |x| x));
    let bodies = [[2, 3, 1], [3, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
    check_axes(&Stack::new(bodies, 0.0, |x| x));
}

/// The first dof of the upper block of those.
const UPPER: usize = 2 * 4 * 3;

/// Two blocks of width 1, the lower one held, the upper one pulled by even forces; in units of length.
fn pulled<T: Real>(
    glue: BondStrength,
    friction: f64,
    [unit, height]: [f64; 2],
    pull: impl Fn(f64) -> [f64; 2] + Send + 'static,
) -> Simulation<'static, T> {
    let bodies = [3, 4].map(|n| Solid::rectangle([1.0; 2], [n, 2], Material { poisson: 0.0, ..MATERIAL }));
    let stack = Stack::new(bodies, 0.0, |[x, y]| [x, height * y]);
    let nodes: Vec<[T; 2]> = stack.solid.nodes.iter().map(|x| x.map(|x| T::of(unit * x))).collect();
    let [lower, upper] = stack.surfaces();
    let contact = Mortar::new(&nodes, &stack.solid.node_dofs(), upper, lower).unwrap().friction(friction);
    // (Damping of what swings, not of what slides.)
    let mut system = stack.solid.system::<T>().rayleigh(T::zero(), T::of(0.01)).unwrap();
    for (node, _) in stack.solid.nodes.iter().enumerate().filter(|(_, [_, y])| *y < 1e-9) {
        system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
    }
    // Forces of the whole upper body, shared as its mass is: no moment, and tractions that are even.
    let mass = stack.solid.lumped_mass::<f64>();
    assert_eq!(UPPER, 2 * stack.split);
    let system = system.load(move |t, f| {
        let forces = pull(t);
        for (dof, f) in f.iter_mut().enumerate().skip(UPPER) {
            *f = T::of(unit * mass[dof] * forces[dof % 2]);
        }
    });
    Simulation::builder(system, Newmark::trapezoidal(), 0.01 * height)
        .constraint(contact.bonded(glue).unwrap())
        .corrector(PersistencyCorrection::new())
        .build()
        .unwrap()
}

#[test]
fn an_even_pull_breaks_all_bonds_at_once_whatever_the_units() {
    // (Tractions are forces over lengths: they do not scale here.)
    let times = [1.0, 1e-6, 1e6].map(|unit| {
        let glue = BondStrength::new(2.0, 1.0).unwrap();
        let mut run = pulled::<f64>(glue, 0.0, [unit, 1.0], |t| [0.0, t]);
        run.run_until(4.0, &mut ()).unwrap();
        let broken = run.state().broken_bonds();
        assert_eq!(broken.len(), 5);
        assert!(run.state().broken_bonds().iter().all(|bond| bond.time.to_bits() == broken[0].time.to_bits()));
        // The blocks swing a little: the load grows for ten times as long as a wave needs to come back.
        assert!((broken[0].time - 2.0).abs() < 0.1 && broken[0].load < 1.05, "{broken:?}");
        assert!(run.gaps().iter().all(|gap| *gap > 0.1 * unit));
        broken[0].time
    });
    assert!(times.iter().all(|time| (time - times[0]).abs() < 1e-12));
}

#[test]
fn what_shear_has_broken_slides_with_friction() {
    let glue = BondStrength::new(f64::INFINITY, 3.0).unwrap();
    // Plates of a fifth of their width: pressed by 2, pushed along by a force that grows until the glue breaks.
    let height = 0.2;
    let mut run = pulled::<f64>(glue, 0.5, [1.0, height], move |t| [3.3 * t / height, -2.0 / height]);
    let dofs = run.state().displacement().len();
    let along: Vec<f64> = (0..dofs).map(|dof| f64::from(u8::from(dof >= UPPER && dof % 2 == 0))).collect();
    run.run_until(0.8, &mut ()).unwrap();
    let broken = run.state().broken_bonds();
    assert!(broken.len() == 5 && broken.iter().all(|bond| (0.7..0.8).contains(&bond.time)), "{broken:?}");
    // The upper plate slides, against half of 2 (before it comes to where the lower one ends).
    let before = run.momentum(&along).unwrap();
    run.run_until(0.88, &mut ()).unwrap();
    let gained = run.momentum(&along).unwrap() - before;
    let expected = 3.3 * 0.5 * (0.88_f64.powi(2) - 0.8_f64.powi(2)) - 0.08;
    assert!((gained / expected - 1.0).abs() < 0.05, "{gained} {expected}");
    let contacts = run.state().contacts();
    assert!((0..5).all(|row| matches!(contacts.status(row), ContactStatus::Sliding | ContactStatus::Open)));
}

#[test]
fn bonds_that_hold_are_ties() {
    let strong = BondStrength::new(1e6, 1e6).unwrap();
    let stack = Stack::new([3, 4].map(|n| Solid::rectangle([1.0; 2], [n, 2], MATERIAL)), 0.0, |x| x);
    let run = |contact: Box<dyn ContactConstraint<f64>>| {
        let velocity: Vec<f64> = stack.solid.nodes.iter().flat_map(|[x, y]| [1e-6 * y, 1e-6 * x * y]).collect();
        let system = stack.solid.system::<f64>();
        let mut run =
            Simulation::builder(system, Composite, 0.01).velocity(velocity).constraint(contact).build().unwrap();
        run.run_until(0.5, &mut ()).unwrap();
        assert!(run.state().broken_bonds().is_empty());
        run.state().displacement().to_vec()
    };
    let tied = run(Box::new(stack.tie(true).unwrap()));
    let bonded = run(Box::new(stack.mortar(true).unwrap().bonded(strong).unwrap()));
    // (Rows that turn turn by as little as the displacements are.)
    let largest = tied.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    assert!(tied.iter().zip(&bonded).all(|(tied, bonded)| (tied - bonded).abs() < 1e-5 * largest));
}
