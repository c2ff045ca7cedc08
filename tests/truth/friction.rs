//! Rigid contact with Coulomb's friction in the plane: every scheme, with every correction that knows friction.

use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// Columns as in `rigid.rs`.
const TABLE: &str = "\
TABLE
";

#[test]
fn runs_with_friction_are_those_of_the_truth() {
    let sweep = Sweep { corrections: &Correction::ALL, law: ContactLaw::Rigid, mixed: false, rubs: true, seeds: 8 };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, TABLE);
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.slid), pair.sum(|run| run.stuck)];
        assert!(counts.iter().zip([6, 20, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
}
