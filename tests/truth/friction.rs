//! Rigid contact with Coulomb's friction in the plane: every scheme, with every correction that knows friction.

use crate::independent::Bodies;
use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// Columns as in `rigid.rs`.
pub(crate) const TABLE: &str = "\
+++........ composite
+++..+..... Newmark(0.25, 0.5)
+++..u..... Newmark(0.3025, 0.6)
+++..+..... Newmark(0.5, 1)
+++..u..... HHT-α(0.5)
+++..u..... WBZ-α(0.5)
+++..u..... Chung–Hulbert(0.9)
+++..u..... Chung–Hulbert(0.8)
+++..u..... Chung–Hulbert(0.5)
+++..u..... Chung–Hulbert(0)
+++..u..... GSSSS-U0(0.8, 0.8, 0.8)
+++..+..... GSSSS-U0(1, 1, 0)
+++........ Houbolt
+++........ Park
+++........ BDF2
+++........ OALTS(0.5)
+++........ Bathe
+++........ Bathe(γ = 0.5)
+++........ ρ∞-Bathe(0.5)
+++........ ρ∞-Bathe(0.9)
+++........ ρ∞-Bathe(1)
+.......... Moreau–Jean(0.5)
+.......... Moreau–Jean(1)
+++..+..... energy–momentum
+.......... central difference
+.......... CD-Lagrange
........... Tchamwa–Wielgosz(1.033)
+++..u..... Chung–Lee(1.0370)
+++..u..... Hulbert–Chung(0.8)
+++..u..... Hulbert–Chung(0.5)
+.......... Noh–Bathe(0.5400)
+.......... Noh–Bathe(0.5858)
";

#[test]
fn runs_with_friction_are_those_of_the_truth() {
    let sweep = Sweep {
        corrections: &Correction::ALL,
        law: ContactLaw::Rigid,
        mixed: false,
        rubs: true,
        bodies: Bodies::Linear,
        changes: &[1.0],
        seeds: 6,
    };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, TABLE);
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.slid), pair.sum(|run| run.stuck)];
        assert!(counts.iter().zip([4, 20, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
}
