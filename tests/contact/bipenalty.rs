//! The stabilized bipenalty: against its predictor and corrector written out, and for its energy.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::{
    Bdf2, CdLagrange, CentralDifference, ContactLaw, Error, HulbertChung, LinearRows, LinearSystem, Newmark, NohBathe,
    Simulation, TchamwaWielgosz, TimeIntegrator, mass,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::measure::{Figures, figures, record_run};
use contact_dynamics_scenes::wall_bar::WallBar;

fn falling(bar: &WallBar, law: ContactLaw, h: f64) -> Simulation<'static, f64> {
    Simulation::builder(bar.system(), CentralDifference, h)
        .constraint(bar.contact_under(law))
        .uncorrected()
        .build()
        .unwrap()
}

/// K u of a bar.
fn product(bar: &WallBar, u: &[f64]) -> Vec<f64> {
    let k = bar.young / bar.element_size();
    let mut force = vec![0.0; u.len()];
    for i in 0..bar.elements {
        let pull = k * (u[i + 1] - u[i]);
        (force[i], force[i + 1]) = (force[i] - pull, force[i + 1] + pull);
    }
    force
}

#[test]
fn it_is_its_predictor_and_corrector() {
    let bar = WallBar { height: 0.02, gravity: 30.0, ..WallBar::bouncing(8) };
    let masses = bar.mass();
    for share in [0.1, 1.0, 100.0] {
        let stiffness = share * bar.young / bar.element_size();
        let h = 0.7 * bar.element_size() / bar.wave_speed();
        let mut run = falling(&bar, ContactLaw::StabilizedBipenalty { stiffness }, h);
        // Leapfrog: the free motion predicts u, the spring at the mean gap there moves M + m GᵀG with m = k h²/4.
        let added = stiffness * h * h / 4.0;
        let mut u = vec![0.0; masses.len()];
        // (A half step from rest.)
        let mut v: Vec<f64> = vec![-0.5 * h * bar.gravity; masses.len()];
        let mut touched = 0;
        for step in 0..400 {
            let before = u[0] + bar.height;
            u.iter_mut().zip(&v).for_each(|(u, v)| *u += h * v);
            let force = product(&bar, &u);
            for (i, (v, m)) in v.iter_mut().zip(&masses).enumerate() {
                *v -= h * (force[i] / m + bar.gravity);
            }
            let now = u[0] + bar.height;
            let last = (-0.5 * (before + now)).max(0.0);
            let predicted = now + 0.5 * h * v[0];
            let pressed = 0.5 * stiffness * (last - predicted).max(0.0);
            let acceleration = pressed / (masses[0] + added);
            v[0] += h * acceleration;
            run.step().unwrap();
            let found = run.state();
            for (x, y) in found.displacement().iter().zip(&u) {
                assert!((x - y).abs() < 1e-9 * (bar.height + y.abs()), "{share}, {step}: {x} {y}");
            }
            let lambda = masses[0] * acceleration;
            let size = masses[0] * bar.height / (h * h);
            assert!((found.contacts().forces()[0] - lambda).abs() < 1e-9 * size, "{share}, {step}");
            touched += u32::from(lambda > 0.0);
        }
        assert!(touched > 20, "{touched}");
    }
}

#[test]
fn in_lasting_contact_it_is_the_plain_form() {
    // A bar that stands on the floor and vibrates, pressed all the time.
    let bar = WallBar { height: 0.0, ..WallBar::bouncing(10) };
    let stiffness = 3.0 * bar.young / bar.element_size();
    let h = 0.8 * bar.element_size() / bar.wave_speed();
    let start: Vec<f64> = bar.rest().iter().map(|u| 1.2 * u - bar.weight() / stiffness).collect();
    let make = |law: ContactLaw| {
        Simulation::builder(bar.system(), CentralDifference, h)
            .displacement(start.clone())
            .constraint(bar.contact_under(law))
            .uncorrected()
            .build()
            .unwrap()
    };
    let mut plain = make(ContactLaw::Bipenalty { stiffness, mass: mass::bipenalty(stiffness, h).unwrap() });
    let mut stabilized = make(ContactLaw::StabilizedBipenalty { stiffness });
    let forces = |run: &mut Simulation<'_, f64>| {
        let force = |_| {
            run.step().unwrap();
            run.state().contacts().forces()[0]
        };
        (0..3000).map(force).collect::<Vec<f64>>()
    };
    // (The first half step is made differently: compared is the band that the force keeps.)
    let [one, other] = [forces(&mut plain), forces(&mut stabilized)].map(|forces| {
        assert!(forces.iter().all(|&force| force > 0.0));
        let (least, most) = forces.iter().fold((f64::MAX, 0.0_f64), |(a, b), &x| (a.min(x), b.max(x)));
        [least / bar.weight(), most / bar.weight()]
    });
    assert!((one[0] - other[0]).abs() < 0.02 && (one[1] - other[1]).abs() < 0.02, "{one:?} {other:?}");
}

#[test]
fn energy_never_rises_however_stiff_the_spring_and_whatever_the_phase() {
    for share in [1e-2, 0.3, 1.0, 10.0, 1e6] {
        for courant in [0.2, 0.6, 0.95] {
            for phase in [0.0, 0.3, 0.7] {
                let bar = WallBar::bouncing(20);
                let h = courant * bar.element_size() / bar.wave_speed();
                let bar = WallBar { height: bar.height * (1.0 + phase * h), ..bar };
                let stiffness = share * bar.young / bar.element_size();
                let mut run = falling(&bar, ContactLaw::StabilizedBipenalty { stiffness }, h);
                let masses = bar.mass();
                let mut before = run.state().displacement().to_vec();
                let (mut energies, mut touched) = (Vec::new(), 0);
                for _ in 0..4000 {
                    run.step().unwrap();
                    let u = run.state().displacement();
                    touched += u32::from(run.state().contacts().forces()[0] > 0.0);
                    let elastic: f64 = product(&bar, u).iter().zip(&before).map(|(f, u)| 0.5 * f * u).sum();
                    let moving = masses.iter().zip(u.iter().zip(&before)).map(|(m, (u, before))| {
                        0.5 * m * ((u - before) / h).powi(2) + m * bar.gravity * (0.5 * (u + before) + bar.height)
                    });
                    let depth = (-0.5 * (u[0] + before[0]) - bar.height).max(0.0);
                    energies.push(moving.sum::<f64>() + elastic + 0.5 * stiffness * depth * depth);
                    before.copy_from_slice(u);
                }
                assert!(touched > 20);
                let scale = energies[0];
                let worst = energies.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
                assert!(worst < 1e-10 * scale, "{share}, {courant}, {phase}: {worst:e} of {scale}");
            }
        }
    }
}

#[test]
fn the_plain_form_gains_energy_over_many_impacts_and_this_one_does_not() {
    for phase in [0.1, 0.5, 0.9] {
        let bar = WallBar::bouncing(50);
        let h = 0.5 * bar.element_size() / bar.wave_speed();
        let bar = WallBar { height: bar.height + phase * h, ..bar };
        let stiffness = bar.young / bar.element_size();
        let last = |law: ContactLaw| {
            let mut run = falling(&bar, law, h);
            bar.bounces(&bar.mass(), &mut run, h, 1.0).unwrap().energy[5]
        };
        let plain = last(ContactLaw::Bipenalty { stiffness, mass: mass::bipenalty(stiffness, h).unwrap() });
        let stabilized = last(ContactLaw::StabilizedBipenalty { stiffness });
        assert!(plain > 1.005, "{phase}: {plain}");
        assert!(stabilized < 1.0 && stabilized > 0.99, "{phase}: {stabilized}");
    }
}

/// The paper's bars by central differences at Courant number 0.9.
fn two_bars(n: usize, phase: f64, law: ContactLaw) -> Figures {
    let h = 0.9 * 10.0 / n as f64 / 100.0;
    let bars = Bars::paper(n).delayed(phase, h);
    let mut run = Simulation::builder(bars.system::<f64>(), CentralDifference, h)
        .velocity(bars.velocities())
        .constraint(bars.contact_under(law))
        .uncorrected()
        .build()
        .unwrap();
    let record = record_run(&bars, &mut run, 0.4);
    figures(&bars, &record, h)
}

#[test]
fn two_bars_meet_without_ringing() {
    for n in [20, 100] {
        for phase in [0.1, 0.5, 0.9] {
            let bars = Bars::paper(n);
            let stiffness = bars.young[0] * bars.area / bars.element_size(0);
            let found = two_bars(n, phase, ContactLaw::StabilizedBipenalty { stiffness });
            assert!(found.force_rms < 0.11 && found.force_max < 1.05, "{n}, {phase}: {found:?}");
            assert!((found.energy - 1.0).abs() < 0.2 / n as f64, "{n}, {phase}: {found:?}");
            assert!(found.closure < 1e-10 && found.drift < 1e-10);
        }
    }
}

#[test]
fn moving_walls_take_it_and_other_schemes_do_not() {
    let build = |scheme: Box<dyn TimeIntegrator>, speed: f64| {
        let k = WallBar::bouncing(1).stiffness();
        let wall = GapOffset::moving(move |t| [0.2 - speed * t, -speed, 0.0]);
        let law = ContactLaw::StabilizedBipenalty { stiffness: 50.0 };
        Simulation::builder(LinearSystem::lumped(vec![1.0; 2], k).unwrap(), scheme, 1e-3)
            .velocity(vec![speed - 1.0; 2])
            .constraint(LinearRows::new().row(law, &[(0, 1.0)], wall))
            .uncorrected()
            .build()
    };
    let end = |speed: f64| {
        let mut run = build(Box::new(CentralDifference), speed).unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        run.state().velocity().iter().map(|v| v - speed).collect::<Vec<f64>>()
    };
    // Seen from the wall it is the same impact.
    let (still, moving) = (end(0.0), end(3.0));
    assert!(still[0].max(still[1]) > 0.1, "{still:?}");
    for (x, y) in still.iter().zip(&moving) {
        assert!((x - y).abs() < 1e-8, "{still:?} {moving:?}");
    }
    let others: [Box<dyn TimeIntegrator>; 6] = [
        Box::new(CdLagrange),
        Box::new(TchamwaWielgosz::new(1.033).unwrap()),
        Box::new(Newmark::trapezoidal()),
        Box::new(Bdf2),
        Box::new(HulbertChung::new(0.8).unwrap()),
        Box::new(NohBathe::new(0.54).unwrap()),
    ];
    for scheme in others {
        assert!(matches!(build(scheme, 0.0), Err(Error::Incompatible { .. })));
    }
}
