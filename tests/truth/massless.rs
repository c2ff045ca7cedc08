//! Dofs without mass, damped and not, some of which touch: every scheme with every correction, on rigid contact, with
//! friction and without. Implicit stages solve for them with the others, explicit ones before.

use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::truth::Bodies;

/// Columns as in `rigid.rs`.
const SMOOTH: &str = "\
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
........... Moreau–Jean(0.5)
+.......... Moreau–Jean(1)
........... energy–momentum
u.......... central difference
u.......... CD-Lagrange
........... Tchamwa–Wielgosz(1.033)
........... Chung–Lee(1.0370)
........... Hulbert–Chung(0.8)
........... Hulbert–Chung(0.5)
u.......... Noh–Bathe(0.5400)
u.......... Noh–Bathe(0.5858)
";

/// The same with friction, implicit schemes.
const ROUGH: &str = "\
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
........... Moreau–Jean(0.5)
+.......... Moreau–Jean(1)
........... energy–momentum
";

#[test]
fn runs_with_dofs_without_mass_are_those_of_the_truth() {
    let sweep = Sweep {
        corrections: &Correction::ALL,
        law: ContactLaw::Rigid,
        mixed: false,
        rubs: false,
        bodies: Bodies::Massless,
        changes: &[1.0],
        seeds: 8,
    };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, SMOOTH);
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.openings)];
        assert!(counts.iter().zip([6, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
}

#[test]
fn runs_with_friction_there_are_those_of_the_truth() {
    let sweep = Sweep {
        corrections: &Correction::ALL,
        law: ContactLaw::Rigid,
        mixed: false,
        rubs: true,
        bodies: Bodies::Massless,
        changes: &[1.0],
        seeds: 8,
    };
    let swept = sweep.run();
    println!("{}largest difference {:.0e}", swept.table, swept.worst);
    assert_eq!(swept.table, ROUGH);
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.slid), pair.sum(|run| run.stuck)];
        assert!(counts.iter().zip([2, 20, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
}
