//! Steps whose size changes over and over, of schemes that read no past and store all at the time of the state: on
//! rigid contact, with friction and without, and with dofs without mass, whose velocities are differenced over two
//! steps.

use crate::independent::Bodies;
use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

#[test]
fn runs_whose_step_changes_are_those_of_the_truth() {
    // (Taylor's and Papadopoulos' correction knows the time of a wave, which the truth has in steps.)
    let corrections = Correction::ALL.into_iter().filter(|correction| *correction != Correction::TaylorPapadopoulos);
    let corrections: Vec<Correction> = corrections.collect();
    for (rubs, bodies) in [(false, Bodies::Linear), (true, Bodies::Linear), (false, Bodies::Massless)] {
        let sweep = Sweep {
            corrections: &corrections,
            law: ContactLaw::Rigid,
            mixed: false,
            rubs,
            bodies,
            changes: &[1.0, 1.0, 0.4, 0.9, 0.3, 0.3, 0.7],
            seeds: 4,
        };
        let swept = sweep.run();
        println!("{}largest difference {:.0e}", swept.table, swept.worst);
        assert!(swept.pairs.len() >= 30, "{}", swept.pairs.len());
        for pair in &swept.pairs {
            let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.openings)];
            assert!(counts.iter().zip([2, 8, 8]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
        }
    }
}
