//! Presets against the exact impact of two bars, at every phase of the step, and over many bounces.

use contact_dynamics::mass::{self, Mass};
use contact_dynamics::{
    CdLagrange, Error, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Preset, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::measure::record_run;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{element, matrix};
use contact_dynamics_scenes::{Bars, MassKind, Record};

const H: f64 = 1e-3;
const F0: f64 = 0.0125;

/// Mean and worst over the phases of: RMS and mean of the force error, largest force, total variation, energy lost,
/// error of the contact node's velocity.
struct Sweep {
    mean: [f64; 6],
    worst: [f64; 6],
}

const L2: usize = 0;
const L1: usize = 1;
const MAX: usize = 2;
const VARIATION: usize = 3;
const LOSS: usize = 4;
const VELOCITY: usize = 5;

/// The paper's bars, the impact at φ of a step after 0.1 s, φ = 0.05, 0.15, …
fn sweep(n: usize, load: f64, run: impl Fn(&Bars) -> Record) -> Sweep {
    let (mut mean, mut worst) = ([0.0; 6], [0.0_f64; 6]);
    for k in 0..10 {
        let bars = Bars::paper(n).delayed(0.05 + 0.1 * f64::from(k), H);
        let (impact, release) = (bars.impact_time(), bars.impact_time() + 0.2);
        let record = run(&bars);
        let exact = |t: f64| if t > impact && t < release { 1.0 } else { 0.0 };
        // The force lives at its own time.
        let points = || {
            (0..record.t.len()).map(|i| {
                let at = record.t[i] - (1.0 - load) * H;
                (i, record.t[i], at, record.force[i] / F0 - exact(at))
            })
        };
        let square: Vec<f64> =
            points().filter(|p| (0.08..=0.34).contains(&p.1)).map(|(.., error)| error * error).collect();
        let away = |p: &(usize, f64, f64, f64)| {
            (0.08..=0.32).contains(&p.1) && (p.2 - impact).abs() > H && (p.2 - release).abs() > H
        };
        let absolute: Vec<f64> = points().filter(away).map(|(.., error)| error.abs()).collect();
        let velocity: Vec<f64> = points()
            .filter(|p| (0.08..=0.34).contains(&p.1))
            .map(|(i, t, ..)| {
                let exact = if t < impact { 1.0 } else { -f64::from(u8::from(t > release)) };
                (record.v[i][0] / 0.05 - exact).powi(2)
            })
            .collect();
        let average = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let figures = [
            average(&square).sqrt(),
            average(&absolute),
            record.force.iter().fold(0.0_f64, |a, &b| a.max(b)) / F0,
            record.force.windows(2).map(|p| (p[1] - p[0]).abs()).sum::<f64>() / F0,
            1.0 - record.energy(record.t.len() - 1) / record.start_energy,
            average(&velocity).sqrt(),
        ];
        for (i, figure) in figures.into_iter().enumerate() {
            mean[i] += 0.1 * figure;
            worst[i] = worst[i].max(figure);
        }
    }
    Sweep { mean, worst }
}

/// The bars with the mass, scheme and corrections of a preset.
fn by_preset(preset: Preset, bars: &Bars, h: f64) -> Record {
    let (m, k) = (bars.consistent_mass::<f64>(), bars.stiffness::<f64>());
    let contact = bars.contact_dofs();
    let courant = mass::courant(Mass::Consistent(m.as_ref()), k.as_ref(), h).unwrap()[contact[0]];
    let groups: Vec<usize> = (0..bars.dofs()).map(|dof| usize::from(dof >= contact[1])).collect();
    let m = preset.mass(m.as_ref(), k.symbolic(), &contact, &groups, courant).unwrap();
    let mut run = Simulation::builder(LinearSystem::new(m, k).unwrap(), preset.integrator(), h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .correctors(preset.correctors())
        .build()
        .unwrap();
    record_run(bars, &mut run, 0.4)
}

fn load(preset: Preset) -> f64 {
    preset.integrator().tableau().stages[0].load.max(0.5)
}

#[test]
fn the_smooth_preset_meets_its_figures() {
    let preset = Preset::smooth();
    let found = sweep(100, load(preset), |bars| by_preset(preset, bars, H));
    assert!(found.mean[MAX] < 1.05 && found.mean[VARIATION] < 2.2 && found.mean[L2] < 0.065, "{:?}", found.mean);
    assert!(found.worst[L2] < 0.08, "{:?}", found.worst);
}

#[test]
fn the_conservative_preset_meets_both_sets_of_figures() {
    let preset = Preset::conservative();
    let found = sweep(100, 1.0, |bars| by_preset(preset, bars, H));
    assert!(found.mean[LOSS].abs() < 0.0015 && found.mean[VELOCITY] < 0.2, "{:?}", found.mean);
    assert!(found.mean[MAX] < 1.05 && found.mean[VARIATION] < 2.2 && found.mean[L2] < 0.065, "{:?}", found.mean);
    assert!(found.worst[L2] < 0.08, "{:?}", found.worst);
}

#[test]
fn the_courant_number_is_all_that_the_conservative_preset_needs() {
    for (n, error, overshoot) in [(20, 0.03, 1.05), (100, 0.008, 1.05), (400, 0.006, 1.12)] {
        let found = sweep(n, 1.0, |bars| by_preset(Preset::conservative(), bars, H));
        assert!(found.mean[L1] < error && found.mean[MAX] < overshoot, "{n}: {:?}", found.mean);
    }
}

#[test]
fn presets_beat_the_corrected_lumped_mass() {
    let plain = sweep(100, 1.0, |bars| {
        let mut run = Simulation::builder(bars.system::<f64>(), Newmark::trapezoidal(), H)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        record_run(bars, &mut run, 0.4)
    });
    for preset in [Preset::smooth(), Preset::conservative()] {
        let found = sweep(100, load(preset), |bars| by_preset(preset, bars, H));
        for figure in [L2, L1, MAX, VARIATION, LOSS] {
            assert!(found.mean[figure] < plain.mean[figure], "{preset:?} {figure}: {:?} {:?}", found.mean, plain.mean);
        }
    }
}

#[test]
fn central_differences_are_exact_at_courant_one() {
    // The impact inside a step: all forces are F0 but the first and the last.
    let found = sweep(100, 1.0, |bars| {
        let mut run = Simulation::builder(bars.system::<f64>(), CdLagrange, H)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .uncorrected()
            .build()
            .unwrap();
        record_run(bars, &mut run, 0.4)
    });
    assert!(found.mean[MAX] < 1.0 + 1e-9 && found.mean[VARIATION] < 2.0 + 1e-9, "{:?}", found.mean);
}

#[test]
fn the_explicit_preset_takes_any_courant_number() {
    // 0.1, 0.2, 0.5 and the limit.
    for (n, error) in [(10, 0.08), (20, 0.04), (50, 0.02), (100, 0.006)] {
        let found = sweep(n, 1.0, |bars| by_preset(Preset::explicit(), bars, H));
        assert!(found.mean[L1] < error && found.worst[MAX] < 1.12, "{n}: {:?} {:?}", found.mean, found.worst);
        assert!(found.mean[LOSS].abs() < 0.002 && found.mean[VARIATION] < 3.2, "{n}: {:?}", found.mean);
    }
}

/// The overshoot grows with the Courant number, and the energy by what central differences conserve instead of it.
#[test]
fn the_explicit_preset_overshoots_most_at_courant_one() {
    for (n, overshoots) in [(10_u32, [1.09, 1.09, 1.09, 1.10, 1.12]), (20, [1.07, 1.075, 1.075, 1.09, 1.11])] {
        for (courant, most) in [0.5, 0.8, 0.9, 0.95, 1.0].into_iter().zip(overshoots) {
            let h = courant * 0.1 / f64::from(n);
            let (mut largest, mut energy) = (0.0_f64, 0.0);
            for phase in 0..10 {
                let bars = Bars::paper(n.try_into().unwrap()).delayed(0.05 + 0.1 * f64::from(phase), h);
                let record = by_preset(Preset::explicit(), &bars, h);
                largest = record.force.iter().fold(largest, |a, &b| a.max(b / F0));
                energy += 0.1 * record.energy(record.t.len() - 1) / record.start_energy;
            }
            println!(
                "{n} elements, Courant number {courant}: largest force {largest:.3} F₀, energy after it {energy:.4}"
            );
            assert!(largest < most && (0.9999..1.0135).contains(&energy), "{n}, {courant}: {largest} {energy}");
        }
    }
}

/// A bar that falls on the floor under gravity, and its energy over that at the start after six periods.
fn six_bounces(preset: Preset) -> f64 {
    let (n, young, length, gravity, height) = (100, 900.0, 10.0, 10.0, 5.0);
    let size = length / n as f64;
    let matrix = |diagonal: f64, off: f64| matrix(n + 1, (0..n).flat_map(|e| element(e, e + 1, [diagonal, off])));
    let (k, m) = (matrix(young / size, -young / size), matrix(size / 3.0, size / 6.0));
    let h = 0.5 * size / 30.0;
    let m = preset.mass(m.as_ref(), k.symbolic(), &[0], &vec![0; n + 1], 0.5).unwrap();
    let weights: Vec<f64> = (0..=n).map(|j| m.val_of_col(j).iter().sum::<f64>() * gravity).collect();
    let load = weights.clone();
    let system = LinearSystem::new(m, k).unwrap().load(move |_, f| {
        for (f, w) in f.iter_mut().zip(&load) {
            *f = -w;
        }
    });
    let mut run = Simulation::builder(system, preset.integrator(), h)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], height))
        .build()
        .unwrap();
    let total = |run: &mut Simulation<'_, f64>| {
        let fall: f64 = weights.iter().zip(run.state().displacement()).map(|(w, u)| w * (u + height)).sum();
        run.energy().total() + fall
    };
    let before = total(&mut run);
    run.run_until(6.0 * 16.0 / 3.0, &mut ()).unwrap();
    total(&mut run) / before
}

#[test]
fn the_conservative_preset_keeps_its_energy_over_six_bounces() {
    let energy = six_bounces(Preset::conservative());
    assert!((energy - 1.0).abs() < 0.002, "{energy}");
    let energy = six_bounces(Preset::smooth());
    assert!(energy > 0.98 && energy < 1.0, "{energy}");
}

#[test]
fn courant_numbers_are_checked() {
    let bars = Bars::paper(20).with_mass(MassKind::Consistent);
    let (m, k) = (bars.consistent_mass::<f64>(), bars.stiffness::<f64>());
    let try_mass = |preset: Preset, courant: f64| {
        preset.mass(m.as_ref(), k.symbolic(), &bars.contact_dofs(), &vec![0; bars.dofs()], courant).map(drop)
    };
    for courant in [-0.1, f64::NAN, f64::INFINITY] {
        for preset in [Preset::smooth(), Preset::conservative(), Preset::explicit()] {
            assert!(matches!(try_mass(preset, courant), Err(Error::Parameter { .. })));
        }
    }
    assert!(matches!(try_mass(Preset::explicit(), 1.1), Err(Error::Parameter { .. })));
    assert!(try_mass(Preset::conservative(), 40.0).is_ok());
}

#[test]
fn the_mass_of_a_preset_is_definite_on_any_mesh_at_any_courant_number() {
    let material = Material { young: 50.0, poisson: 0.25, density: 1.0 };
    let solid = Solid::rectangle([1.0, 0.6], [10, 6], material);
    let bottom = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][1] < 1e-9);
    let massless: Vec<usize> = bottom.flat_map(|n| [2 * n, 2 * n + 1]).collect();
    let groups: Vec<usize> = (0..solid.dofs()).map(|dof| dof % 2).collect();
    let (m, k) = (solid.consistent_mass(), solid.stiffness::<f64>());
    let total: f64 = m.val().iter().sum();
    for courant in [0.0, 0.5, 1.0, 3.0] {
        for preset in [Preset::smooth(), Preset::conservative()] {
            let mass = preset.mass(m.as_ref(), k.symbolic(), &massless, &groups, courant).unwrap();
            assert!((mass.val().iter().sum::<f64>() / total - 1.0).abs() < 1e-12, "{courant}");
            let system = LinearSystem::new(mass, solid.stiffness()).unwrap();
            assert!(Simulation::builder(system, preset.integrator(), 1e-2).build().is_ok(), "{courant}");
        }
    }
}
