//! What the presets and the masses of `docs/corrections.md` are recommended for.

use contact_dynamics::{CdLagrange, Corrector, Newmark, PersistencyCorrection, Preset, Simulation, TimeIntegrator};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::masses::{Body, MassMatrix, Takers, Treatment};
use contact_dynamics_scenes::measure::{Figures, Impact, figures, impact, record, record_run};
use contact_dynamics_scenes::wall_bar::WallBar;

const H: f64 = 1e-3;

fn preset_mass(preset: Preset, body: &Body, h: f64) -> MassMatrix {
    let courant = body.courant(h).unwrap();
    let (m, k) = (body.consistent.as_ref(), body.stiffness.symbolic());
    MassMatrix::Matrix(preset.mass(m, k, &body.contact, &body.groups, courant).unwrap())
}

/// The paper's bars by a preset.
fn collide(preset: Preset, elements: usize, h: f64, phase: f64) -> (Figures, Impact) {
    let bars = Bars::paper(elements).delayed(phase, h);
    let mut run = Simulation::builder(bars.system_with(preset_mass(preset, &bars.body(), h)), preset.integrator(), h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .correctors(preset.correctors())
        .build()
        .unwrap();
    let record = record_run(&bars, &mut run, 0.4);
    let load = preset.integrator().tableau().stages.last().unwrap().load;
    (figures(&bars, &record, h), impact(&bars, &record, h, load))
}

#[test]
fn presets_show_the_force_and_keep_the_energy() {
    // Force L1, largest force, energy loss: the worst of ten phases of table 1, and a tenth.
    for (preset, h, force, largest, loss) in [
        (Preset::smooth(), H, 0.0073, 1.036, 2.27e-3),
        (Preset::conservative(), H, 0.0037, 1.027, 1e-5),
        (Preset::explicit(), 0.9 * H, 0.0055, 1.062, 2.1e-3),
    ] {
        for phase in [0.05, 0.45, 0.95] {
            let (figures, impact) = collide(preset, 100, h, phase);
            assert!(impact.force_l1 < 1.1 * force, "{preset:?}, {phase}: {}", impact.force_l1);
            assert!(figures.force_max < 1.0 + 1.1 * (largest - 1.0), "{preset:?}, {phase}: {}", figures.force_max);
            assert!((1.0 - figures.energy).abs() < 1.1 * loss, "{preset:?}, {phase}: {}", figures.energy);
            assert!(figures.closure < 1e-12 && figures.drift < 1e-12 && impact.changes == 2, "{preset:?}, {phase}");
            assert!((0.0..=h).contains(&impact.touch) && impact.release.abs() < 2.5 * H, "{impact:?}");
        }
    }
}

#[test]
fn mass_on_the_contact_nodes_starts_with_its_impulse_and_none_does_not() {
    // m_c [[v]]/h over F₀ is 1/(2 Co) by contact on velocities; massless nodes follow.
    for (elements, courant) in [(10, 0.1), (20, 0.2), (50, 0.25)] {
        let h = courant * 10.0 / elements as f64 / 100.0;
        let bars = Bars::paper(elements).delayed(0.45, h);
        let with = figures(&bars, &record(&bars, CdLagrange, None::<Box<dyn Corrector<f64>>>, h, 0.4), h);
        assert!((with.force_max * 2.0 * courant - 1.0).abs() < 0.01, "{elements}: {}", with.force_max);
        let (without, _) = collide(Preset::explicit(), elements, h, 0.45);
        assert!(without.force_max < 1.09, "{elements}: {}", without.force_max);
    }
}

#[test]
fn presets_bounce_with_the_energy_that_is_claimed() {
    let bar = WallBar::bouncing(100);
    let h = 0.5 * bar.element_size() / bar.wave_speed();
    // (That of central differences, kinetic and elastic, is larger than what they conserve where there are waves.)
    for (preset, [least, most]) in [
        (Preset::smooth(), [0.985, 1.0]),
        (Preset::conservative(), [1.0 - 1e-5, 1.0 + 1e-5]),
        (Preset::explicit(), [1.0 - 1e-3, 1.005]),
    ] {
        let mass = preset_mass(preset, &bar.body(), h);
        let masses = mass.row_sums();
        let mut run = Simulation::builder(bar.system_with(mass), preset.integrator(), h)
            .constraint(bar.contact())
            .correctors(preset.correctors())
            .build()
            .unwrap();
        let load = preset.integrator().tableau().stages.last().unwrap().load;
        let bounces = bar.bounces(&masses, &mut run, h, load).unwrap();
        assert!(bounces.energy[5] > least && bounces.energy[5] < most, "{preset:?}: {:?}", bounces.energy);
        assert!(bounces.ramp < 0.003 && bounces.force_max < 1.1 && bounces.changes == 4, "{preset:?}: {bounces:?}");
    }
}

#[test]
fn an_impact_costs_the_mass_of_the_contact_nodes_or_nothing() {
    // Trapezoidal rule at small Courant numbers: 1/(2n) with that mass, the sliver of a step without.
    let (n, h) = (50, 2.5e-4);
    let bars = Bars::paper(n).delayed(0.45, h);
    let correction: Box<dyn Corrector<f64>> = Box::new(PersistencyCorrection::new());
    let with = record(&bars, Newmark::trapezoidal(), Some(correction), h, 0.4);
    let loss = 1.0 - figures(&bars, &with, h).energy;
    assert!((loss * 2.0 * n as f64 - 1.0).abs() < 0.02, "{loss}");
    let tableau = Newmark::trapezoidal().tableau();
    for (takers, largest) in [(Takers::Neighbors, 1.34), (Takers::Uniform, 1.08), (Takers::Tapered, 1.03)] {
        let treatment = match takers {
            Takers::Neighbors => Treatment::Redistributed(takers),
            _ => Treatment::RedistributedBlend(takers),
        };
        let mass = treatment.mass(&bars.body(), &tableau, 0.125).unwrap();
        let mut run = Simulation::builder(bars.system_with(mass), Newmark::trapezoidal(), h)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .build()
            .unwrap();
        let without = figures(&bars, &record_run(&bars, &mut run, 0.4), h);
        assert!((without.energy - 1.0).abs() < 1e-4, "{takers:?}: {}", without.energy);
        assert!((without.force_max - largest).abs() < 0.01, "{takers:?}: {}", without.force_max);
    }
}
