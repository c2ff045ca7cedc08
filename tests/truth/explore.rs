use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::truth::{Kind, Outcome, Setting, compare};

#[test] fn debug() {
    let scheme: fn() -> Box<dyn contact_dynamics::TimeIntegrator> = || Box::new(contact_dynamics::Composite);
    let c = Correction::Persistency;
    let scene = Setting { kind: Kind::Press, critical: None, law: ContactLaw::Rigid, mixed: false, rubs: true }.scene(4);
    for r in &scene.rows { println!("{r:?}"); }
    let mut run = contact_dynamics::Simulation::builder(scene.system(), scheme(), scene.h).velocity(scene.v.clone()).start_up(scene.start_up).constraint(scene.contact()).correctors(c.correctors(1.0).unwrap()).build().unwrap();
    let mut truth = contact_dynamics_scenes::truth::Truth::new(&scene, &*scheme(), c);
    for i in 0..80 {
        run.step().unwrap(); truth.step();
        let (a, b) = (run.state(), truth.motion());
        let d = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        let ds = [d(a.displacement(), &b.u), d(a.velocity(), &b.v), d(a.acceleration(), &b.a)];
        if ds[0] > 1e-9 || ds[1] > 1e-9 || ds[2] > 1e-6 {
            println!("step {i} {ds:?}");
            println!("{:?}\n {:?}", a.displacement(), b.u);
            println!("{:?}\n {:?}", a.velocity(), b.v);
            println!("{:?}\n {:?}", a.acceleration(), b.a);
            println!("{:?}", a.contacts());
            println!("{:?}", truth.contacts());
            break;
        }
    }
}
fn explore(law: ContactLaw, mixed: bool, rubs: bool, seeds: u64) {
    for listed in schemes::all() {
        for correction in Correction::ALL {
            let mut line = String::new();
            for kind in Kind::ALL {
                let mut worst: (f64, u64, &str, usize) = (0.0, 0, "", 0);
                let mut counts = [0; 5];
                let mut steps = vec![];
                let mut refused = 0;
                for seed in 0..seeds {
                    let scene = Setting { kind, critical: listed.critical, law, mixed, rubs }.scene(seed);
                    match compare(&scene, listed.make, correction, 80) {
                        Err(e) => line += &format!(" !{kind:?} {seed}: {e}"),
                        Ok(Outcome::Refused(why)) => {
                            refused += 1;
                            if seed == 0 && kind == Kind::Bounce { line += &why; }
                        }
                        Ok(Outcome::Compared(c)) => {
                            counts = [counts[0] + c.closings, counts[1] + c.openings, counts[2] + c.closed, counts[3] + c.slid, counts[4] + c.stuck];
                            steps.push(c.steps);
                            if c.worst.size > worst.0 {
                                worst = (c.worst.size, seed, c.worst.what, c.worst.step);
                            }
                        }
                    }
                }
                line += &format!(" | {kind:?} r{refused} {:.1e} s{} {} @{} {:?} {:?}", worst.0, worst.1, worst.2, worst.3, counts, steps);
            }
            println!("{} {rubs} {} {}: {line}", format!("{law:?}").replace(": ", "="), listed.name(), correction.name());
        }
    }
}

#[test]
fn rigid() { explore(ContactLaw::Rigid, false, false, 8); }
#[test]
fn friction() { explore(ContactLaw::Rigid, false, true, 8); }
#[test]
fn laws() {
    for law in [
        ContactLaw::Restitution { coefficient: 0.6 },
        ContactLaw::RateCondition,
        ContactLaw::PersistencySwitch,
        ContactLaw::Penalty { stiffness: 1.5 },
        ContactLaw::PowerLaw { stiffness: 1.0, exponent: 1.5 },
        ContactLaw::Bipenalty { stiffness: 1.5, mass: 0.25 },
        ContactLaw::StabilizedBipenalty { stiffness: 1.5 },
        ContactLaw::AugmentedLagrangian { stiffness: 1.5, augmentations: 2 },
    ] {
        explore(law, true, false, 4);
    }
}
#[test]
fn rubbing_laws() {
    for law in [
        ContactLaw::Restitution { coefficient: 0.6 },
        ContactLaw::Penalty { stiffness: 1.5 },
        ContactLaw::PowerLaw { stiffness: 1.0, exponent: 1.5 },
        ContactLaw::AugmentedLagrangian { stiffness: 1.5, augmentations: 2 },
    ] {
        explore(law, true, true, 4);
    }
}
