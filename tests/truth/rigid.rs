//! Rigid contact without friction: every scheme with every correction.

use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// One column a correction, in the order of `Correction::ALL`: none, λ_v/λ_a, the same with the past projected, release
/// after it, Taylor–Papadopoulos, splitting, contact-implicit, contact-stabilized, the same on closed contacts,
/// Laursen–Love, a = 0. '+': as the truth, 'u': as the truth without damping, refused with it, '.': refused.
const TABLE: &str = "\
TABLE
";

#[test]
fn runs_are_those_of_the_truth() {
    let sweep =
        Sweep { corrections: &Correction::ALL, law: ContactLaw::Rigid, mixed: false, rubs: false, seeds: 6 };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, TABLE);
    for pair in &swept.pairs {
        // Enough happens: contacts that close, open and rest, in runs that are compared for long enough.
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.openings)];
        assert!(counts.iter().zip([8, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
        assert!(pair.sum(|run| run.closed) > 100, "{}", pair.name);
        // At any time within the step.
        let first = pair.runs.iter().map(|run| run.phases[0]).fold(1.0, f64::min);
        let last = pair.runs.iter().map(|run| run.phases[1]).fold(0.0, f64::max);
        assert!(first < 0.2 && last > 0.8, "{}: {first} to {last}", pair.name);
    }
}
