//! Rigid contact without friction: every scheme with every correction.

use crate::independent::Bodies;
use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// One column a correction, in the order of `Correction::ALL`: none, λ_v/λ_a, the same with the past projected, release
/// after it, Taylor–Papadopoulos, splitting, contact-implicit, contact-stabilized, the same on closed contacts,
/// Laursen–Love, a = 0. '+': as the truth, 'u': as the truth without damping, refused with it, '.': refused.
pub(crate) const TABLE: &str = "\
+++++.....+ composite
+++++++uu.+ Newmark(0.25, 0.5)
+++++uuuu.+ Newmark(0.3025, 0.6)
+++++++uu.+ Newmark(0.5, 1)
+++++uuuu.+ HHT-α(0.5)
+++++uuuu.+ WBZ-α(0.5)
+++++uuuu.+ Chung–Hulbert(0.9)
+++++uuuu.+ Chung–Hulbert(0.8)
+++++uuuu.+ Chung–Hulbert(0.5)
+++++uuuu.+ Chung–Hulbert(0)
+++++uuuu.+ GSSSS-U0(0.8, 0.8, 0.8)
+++++++uu.+ GSSSS-U0(1, 1, 0)
+++++.....+ Houbolt
+++++.....+ Park
+++++.....+ BDF2
+++++.....+ OALTS(0.5)
+++++.....+ Bathe
+++++.....+ Bathe(γ = 0.5)
+++++.....+ ρ∞-Bathe(0.5)
+++++.....+ ρ∞-Bathe(0.9)
+++++.....+ ρ∞-Bathe(1)
+.......... Moreau–Jean(0.5)
+.......... Moreau–Jean(1)
+++++++uu++ energy–momentum
+.......... central difference
+.......... CD-Lagrange
........... Tchamwa–Wielgosz(1.033)
+++++uuuu.+ Chung–Lee(1.0370)
+++++uuuu.+ Hulbert–Chung(0.8)
+++++uuuu.+ Hulbert–Chung(0.5)
+.......... Noh–Bathe(0.5400)
+.......... Noh–Bathe(0.5858)
";

#[test]
fn runs_are_those_of_the_truth() {
    let sweep = Sweep {
        corrections: &Correction::ALL,
        law: ContactLaw::Rigid,
        mixed: false,
        rubs: false,
        bodies: Bodies::Linear,
        changes: &[1.0],
        seeds: 6,
    };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, TABLE);
    for pair in &swept.pairs {
        // Enough happens: contacts that close, open and rest, in runs that are compared for long enough.
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.openings)];
        assert!(counts.iter().zip([6, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
        assert!(pair.sum(|run| run.closed) > 100, "{}", pair.name);
        // At any time within the step.
        let first = pair.runs.iter().map(|run| run.phases[0]).fold(1.0, f64::min);
        let last = pair.runs.iter().map(|run| run.phases[1]).fold(0.0, f64::max);
        assert!(first < 0.3 && last > 0.7, "{}: {first} to {last}", pair.name);
    }
}
