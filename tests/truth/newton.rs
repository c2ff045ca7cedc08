//! Springs that harden, by Newton's method: every scheme with every correction, on rigid contact, with friction and
//! without.

use crate::independent::Bodies;
use crate::rigid;
use crate::sweep::{ALONG_PATHS, Sweep, Swept};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

fn swept(rubs: bool) -> Swept {
    let sweep = Sweep {
        corrections: &Correction::ALL,
        law: ContactLaw::Rigid,
        mixed: false,
        rubs,
        bodies: Bodies::Hardening,
        changes: &[1.0],
        seeds: 3,
    };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.closed)];
        assert!(counts.iter().zip([2, 6, 40]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
    swept
}

#[test]
fn runs_by_newtons_method_are_those_of_the_truth() {
    let table = swept(false).table;
    let linear = rigid::TABLE.lines().filter(|line| !line.ends_with(ALONG_PATHS));
    for (line, linear) in table.lines().zip(linear) {
        assert_eq!(line, linear);
    }
}

#[test]
fn runs_by_newtons_method_with_friction_are_those_of_the_truth() {
    swept(true);
}
