use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::truth::{Kind, Outcome, Scene, compare};

#[test]
fn explore() {
    for listed in schemes::all() {
        for correction in Correction::ALL {
            let mut line = String::new();
            for kind in Kind::ALL {
                let mut worst: (f64, u64, &str, usize) = (0.0, 0, "", 0);
                let mut counts = [0; 3];
                for seed in 0..6 {
                    let scene = Scene::by_chance(kind, seed, listed.critical);
                    match compare(&scene, listed.make, correction, 80) {
                        Err(e) => line += &format!(" !{seed}: {e}"),
                        Ok(Outcome::Refused(why)) => line += &format!(" R{seed}{}", if seed < 2 && kind == Kind::Bounce { why } else { String::new() }),
                        Ok(Outcome::Compared(c)) => {
                            counts = [counts[0] + c.closings, counts[1] + c.openings, counts[2] + c.closed];
                            if c.worst.size > worst.0 {
                                worst = (c.worst.size, seed, c.worst.what, c.worst.step);
                            }
                        }
                    }
                }
                line += &format!(" | {kind:?} {:.1e} s{} {} @{} {:?}", worst.0, worst.1, worst.2, worst.3, counts);
            }
            println!("{} {}: {line}", listed.name(), correction.name());
        }
    }
}
