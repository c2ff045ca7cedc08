//! Bodies factorized on their own move as in one factor.

use crate::scene::{Comparison, H, Scene, motion, simulation};
use contact_dynamics::{Automatic, ByBody, Cholesky, Composite, GeneralizedAlpha, LinearSolver, TimeIntegrator};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::Solid;
use contact_dynamics_scenes::{Bars, MassKind};

#[test]
fn bodies_factorized_alone_move_as_in_one_factor() {
    let mut cases: Vec<(String, Scene, Option<Solid<2>>)> = Vec::new();
    for mass in [MassKind::Lumped, MassKind::Consistent] {
        cases.push((format!("bars, {mass:?}"), Scene::bars(&Bars::paper(20).delayed(0.35, H).with_mass(mass)), None));
    }
    let (scene, solid) = Scene::blocks(0.4);
    cases.push(("blocks".into(), scene, None));
    cases.push(("hyperelastic blocks".into(), Scene::blocks(0.4).0, Some(solid)));
    for (name, scene, solid) in &cases {
        for corrected in [false, true] {
            for composite in [true, false] {
                let scheme = || -> Box<dyn TimeIntegrator> {
                    if composite {
                        Box::new(Composite)
                    } else {
                        Box::new(GeneralizedAlpha::chung_hulbert(0.9).unwrap())
                    }
                };
                let run = |solver: Box<dyn LinearSolver<f64>>| match solid {
                    Some(solid) => {
                        simulation(Hyperelastic::new(solid, Law::NeoHookean), scene, scheme(), corrected, solver)
                    }
                    None => scene.simulation(scheme(), corrected, solver),
                };
                let mut one = run(Box::new(Automatic));
                let mut apart = run(Box::new(ByBody::new(Automatic).body(0..scene.split, Cholesky::default())));
                let mut comparison = Comparison::default();
                for _ in 0..400 {
                    one.step().unwrap();
                    apart.step().unwrap();
                    comparison.add(motion(&apart), motion(&one));
                }
                assert!(one.statistics().contact_changes >= 2, "{name}: no impact");
                assert!(comparison.worst() < 1e-10, "{name}, corrected {corrected}: {comparison:?}");
            }
        }
    }
}
