//! Correctors of a host, written with what `Correction` offers to everybody, do what those of the crate do.

use contact_dynamics::corrector::{
    ContactImplicit, Correction, Edits, Effects, LaursenLove, Parts, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::{
    Composite, Corrector, Error, GeneralizedAlpha, Gssss, LinearRows, Newmark, Park, PersistencyCorrection, Result,
    Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::{Bars, MassKind};

const H: f64 = 1e-3;

/// A corrector from a function.
#[derive(Debug)]
struct Own(fn(&mut Correction<'_, f64>) -> Result<()>);

impl Corrector<f64> for Own {
    fn name(&self) -> String {
        "own".into()
    }
    fn effects(&self) -> Effects {
        Effects { edits: Edits::Past, ..Effects::default() }
    }
    fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
        (self.0)(step)
    }
}

/// λ_v/λ_a by pushes along rows: reported forces, not the two multipliers themselves.
fn persistency(step: &mut Correction<'_, f64>) -> Result<()> {
    step.solve_velocity_jumps()?;
    let (closed, impulses) = (step.closed().to_vec(), step.jump_impulses().to_vec());
    step.apply_impulses(&closed, &impulses)?;
    step.solve_acceleration_jumps()?;
    let (engaged, forces) = (step.engaged().to_vec(), step.jump_forces().to_vec());
    step.apply_forces(&engaged, &forces)?;
    for (&row, &force) in engaged.iter().zip(&forces) {
        step.report_force(row, step.contacts().forces()[row] + step.force_share() * force);
    }
    Ok(())
}

/// Contact forces as impulses at the end of the step.
fn contact_implicit(step: &mut Correction<'_, f64>) -> Result<()> {
    let (rows, [u, v, a]) = (step.closed().to_vec(), step.response());
    let raw: Vec<f64> = rows.iter().map(|&row| step.contacts().raw_forces()[row]).collect();
    let times = |x: f64| raw.iter().map(|raw| x * raw).collect::<Vec<_>>();
    step.apply_forces(&rows, &times(-a))?;
    for (&row, &raw) in rows.iter().zip(&raw) {
        step.report_force(row, 2.0 * u * raw);
    }
    step.apply_impulses(&rows, &times(step.step_size() * (2.0 * u - v)))
}

/// The velocity jump that gives the work of contact back.
fn laursen_love(step: &mut Correction<'_, f64>) -> Result<()> {
    let rows = step.closed().to_vec();
    let start = step.starting_gaps()?.to_vec();
    if start.is_empty() {
        return Ok(());
    }
    let raw: Vec<f64> = rows.iter().map(|&row| step.contacts().raw_forces()[row]).collect();
    let gaps = step.contacts().gaps();
    let work: f64 = rows.iter().zip(&raw).map(|(&row, raw)| raw * (gaps[row] - start[row])).sum();
    let mut s = Vec::new();
    step.compliances(&rows, &mut s)?;
    let size = rows.len();
    let (mut square, mut rate) = (0.0, 0.0);
    for (i, &row) in rows.iter().enumerate() {
        rate += raw[i] * step.rate(row)?;
        square += raw[i] * (0..size).map(|j| s[i + j * size] * raw[j]).sum::<f64>();
    }
    if square > 0.0 {
        let factor = ((rate * rate - 2.0 * square * work).max(0.0).sqrt() - rate) / square;
        step.apply_impulses(&rows, &raw.iter().map(|raw| factor * raw).collect::<Vec<_>>())?;
    }
    Ok(())
}

/// λ_v/λ_a, and at release what it took.
fn release(step: &mut Correction<'_, f64>) -> Result<()> {
    for i in 0..step.released().len() {
        let row = step.released()[i];
        let impulse = step.exchange_energy(row, step.contacts().dissipated()[row])?;
        step.move_past(row, impulse)?;
    }
    Ok(())
}

/// λ_v/λ_a, and at release the wave that the last force was.
fn taylor_papadopoulos(step: &mut Correction<'_, f64>) -> Result<()> {
    PersistencyCorrection::new().correct(step)?;
    for i in 0..step.released().len() {
        let row = step.released()[i];
        let impulse = 0.5 * 0.01 * step.previous_force(row).max(0.0);
        step.apply_impulses(&[row], &[impulse])?;
        step.move_past(row, impulse)?;
    }
    Ok(())
}

/// No acceleration on contact nodes.
fn zero_acceleration(step: &mut Correction<'_, f64>) -> Result<()> {
    step.solve_velocity_jumps()?;
    step.solve_acceleration_jumps()?;
    let [_, _, weight] = step.momentum_weights();
    for (row, force) in step.engaged().to_vec().into_iter().zip(step.jump_forces().to_vec()) {
        step.report_force(row, step.contacts().forces()[row] + step.force_share() * force);
        step.book_impulse(row, weight * force);
        for (dof, _) in step.row(row) {
            step.acceleration_mut()[dof] = 0.0;
        }
    }
    Ok(())
}

fn run(
    scheme: Box<dyn TimeIntegrator>,
    mass: MassKind,
    correctors: Vec<Box<dyn Corrector<f64>>>,
) -> Simulation<'static, f64> {
    let bars = Bars { mass, ..Bars::paper(10) };
    Simulation::builder(bars.system::<f64>(), scheme, H)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .correctors(correctors)
        .energy_balance()
        .build()
        .unwrap()
}

type Scheme = fn() -> Box<dyn TimeIntegrator>;
type Correctors = fn() -> Vec<Box<dyn Corrector<f64>>>;

#[test]
fn correctors_of_a_host_do_what_those_of_the_crate_do() {
    let newmark: Scheme = || Box::new(Newmark::trapezoidal());
    let composite: Scheme = || Box::new(Composite);
    let alpha: Scheme = || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap());
    let park: Scheme = || Box::new(Park);
    let middle: Scheme = || Box::new(Gssss::new(1.0, 1.0, 1.0).unwrap());
    let cases: [(&str, &[Scheme], Correctors, Correctors); 6] = [
        (
            "λ_v/λ_a",
            &[newmark, composite, alpha],
            || vec![Box::new(PersistencyCorrection::new())],
            || vec![Box::new(Own(persistency))],
        ),
        ("contact-implicit", &[newmark], || vec![Box::new(ContactImplicit)], || vec![Box::new(Own(contact_implicit))]),
        ("Laursen–Love", &[middle], || vec![Box::new(LaursenLove)], || vec![Box::new(Own(laursen_love))]),
        (
            "release",
            &[newmark, composite, park],
            || vec![Box::new(PersistencyCorrection::with_history_projection()), Box::new(Release)],
            || vec![Box::new(PersistencyCorrection::with_history_projection()), Box::new(Own(release))],
        ),
        (
            "Taylor–Papadopoulos",
            &[newmark, composite, park],
            || vec![Box::new(TaylorPapadopoulos::new(0.01).unwrap())],
            || vec![Box::new(Own(taylor_papadopoulos))],
        ),
        ("a = 0", &[newmark, alpha], || vec![Box::new(ZeroAcceleration)], || vec![Box::new(Own(zero_acceleration))]),
    ];
    for (name, schemes, theirs, own) in cases {
        for (scheme, mass) in schemes.iter().flat_map(|s| [(s, MassKind::Lumped), (s, MassKind::Consistent)]) {
            let [mut theirs, mut own, mut none] = [theirs(), own(), Vec::new()].map(|c| run(scheme(), mass, c));
            let (mut changes, mut effect) = (0, 0.0_f64);
            let mut impulses = [0.0; 2];
            for step in 0..250 {
                for run in [&mut theirs, &mut own, &mut none] {
                    run.step().unwrap();
                }
                let [a, b, c] = [&theirs, &own, &none].map(Simulation::state);
                let apart = |x: &[f64], y: &[f64]| x.iter().zip(y).fold(0.0_f64, |d, (x, y)| d.max((x - y).abs()));
                let size = |x: &[f64]| x.iter().fold(1e-3_f64, |d, x| d.max(x.abs()));
                for (x, y) in [
                    (a.displacement(), b.displacement()),
                    (a.velocity(), b.velocity()),
                    (a.acceleration(), b.acceleration()),
                    (a.contacts().forces(), b.contacts().forces()),
                    (a.contacts().dissipated(), b.contacts().dissipated()),
                ] {
                    assert!(apart(x, y) <= 1e-7 * size(x), "{name}, {mass:?}, step {step}: {x:?} {y:?}");
                }
                for (sum, state) in impulses.iter_mut().zip([a, b]) {
                    *sum += state.contacts().impulses()[0];
                }
                changes += usize::from(a.contacts().closed()[0]);
                effect = effect.max(apart(a.velocity(), c.velocity()));
            }
            assert!(changes > 10 && effect > 1e-3, "{name}: {changes} {effect:e}");
            assert!((impulses[0] - impulses[1]).abs() <= 1e-9 * impulses[0].abs(), "{name}: {impulses:?}");
            let works = [&mut theirs, &mut own].map(|run| run.energy().works.unwrap().corrections);
            assert!((works[0] - works[1]).abs() <= 1e-9 * (works[0].abs() + 1e-9), "{name}: {works:?}");
        }
    }
}

/// What an impact took, given back with a factor, is in the energy to the digit, and momentum is what it was.
#[test]
fn energy_is_exchanged_as_asked() {
    for share in [0.25, 1.0, -0.5] {
        #[derive(Debug)]
        struct Share(f64);
        impl Corrector<f64> for Share {
            fn name(&self) -> String {
                "share".into()
            }
            fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
                for i in 0..step.released().len() {
                    let row = step.released()[i];
                    let taken = step.contacts().dissipated()[row];
                    let impulse = step.exchange_energy(row, self.0 * taken)?;
                    assert_eq!(impulse > 0.0, self.0 > 0.0);
                    let rest = step.contacts().dissipated()[row];
                    // Slower than at rest relative to each other they cannot become.
                    if self.0 > 0.0 {
                        assert!((rest - (1.0 - self.0) * taken).abs() < 1e-12, "{rest:e} {taken:e}");
                    } else {
                        assert!(rest > taken && step.rate(row)? > -1e-12);
                    }
                }
                Ok(())
            }
        }
        let correctors: Vec<Box<dyn Corrector<f64>>> =
            vec![Box::new(PersistencyCorrection::new().parts(Parts::Both)), Box::new(Share(share))];
        let mut run = run(Box::new(Newmark::trapezoidal()), MassKind::Lumped, correctors);
        let ones = vec![1.0; run.state().displacement().len()];
        let before = run.momentum(&ones).unwrap();
        run.run_until(0.4, &mut ()).unwrap();
        assert!((run.momentum(&ones).unwrap() - before).abs() < 1e-10);
        assert!(run.statistics().contact_changes > 1);
    }
}

/// ½ S j² + j ġ = energy has its digits for energies far below that of the motion, and below their rounding nothing is
/// done.
#[test]
fn small_energies_are_exchanged_without_cancellation() {
    fn exchange(step: &mut Correction<'_, f64>) -> Result<()> {
        let mut compliance = Vec::new();
        for i in 0..step.released().len() {
            let row = step.released()[i];
            step.compliances(&[row], &mut compliance)?;
            for share in [1e-12, 1e-9, 1e-6, 1e-3] {
                let rate = step.rate(row)?;
                assert!(rate > 0.0, "{rate}");
                let energy = share * rate * rate / compliance[0];
                let impulse = step.exchange_energy(row, energy)?;
                let expected = energy / (rate + 0.5 * compliance[0] * impulse);
                assert!((impulse - expected).abs() <= 1e-12 * expected, "{share}: {impulse:e}, not {expected:e}");
            }
            let (rate, taken) = (step.rate(row)?, step.contacts().dissipated()[row]);
            let impulse = step.exchange_energy(row, 1e-40 * rate * rate / compliance[0])?;
            assert_eq!(impulse.to_bits(), 0.0_f64.to_bits());
            assert_eq!((step.rate(row)?, step.contacts().dissipated()[row]), (rate, taken));
        }
        Ok(())
    }
    let correctors: Vec<Box<dyn Corrector<f64>>> =
        vec![Box::new(PersistencyCorrection::new()), Box::new(Own(exchange))];
    let mut run = run(Box::new(Newmark::trapezoidal()), MassKind::Lumped, correctors);
    run.run_until(0.4, &mut ()).unwrap();
    assert!(run.statistics().contact_changes > 1);
}

/// A corrector that edits the past must say so beforehand.
#[test]
fn the_past_is_moved_by_those_who_said_so() {
    #[derive(Debug)]
    struct Silent;
    impl Corrector<f64> for Silent {
        fn name(&self) -> String {
            "silent".into()
        }
        fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
            step.move_past(0, 1.0)
        }
    }
    let spring = contact_dynamics::faer::sparse::SparseColMat::try_new_from_triplets(
        1,
        1,
        &[contact_dynamics::faer::sparse::Triplet::new(0, 0, 1.0)],
    )
    .unwrap();
    let system = contact_dynamics::LinearSystem::lumped(vec![1.0], spring).unwrap();
    let mut run = Simulation::builder(system, Composite, 0.01)
        .velocity(vec![-1.0])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.05))
        .corrector(Silent)
        .build()
        .unwrap();
    let error = run.run_until(0.2, &mut ()).unwrap_err();
    assert!(matches!(error, Error::Incompatible { .. }), "{error}");
}
