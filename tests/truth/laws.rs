//! Laws of contact besides the rigid one, beside rigid rows and without, with and without friction: every scheme.

use crate::independent::Bodies;
use crate::sweep::Sweep;
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// With stiffnesses in units of a spring of the scene, and the mass in those of k h².
const LAWS: [ContactLaw; 10] = [
    ContactLaw::Restitution { coefficient: 0.6 },
    ContactLaw::RateCondition,
    ContactLaw::PersistencySwitch,
    ContactLaw::Penalty { stiffness: 1.5 },
    ContactLaw::PowerLaw { stiffness: 1.0, exponent: 1.5 },
    ContactLaw::Bipenalty { stiffness: 1.5, mass: 0.25 },
    ContactLaw::StabilizedBipenalty { stiffness: 1.5 },
    ContactLaw::AugmentedLagrangian { stiffness: 1.5, augmentations: 2 },
    ContactLaw::KelvinVoigt { stiffness: 1.0, damping: 1.0 },
    ContactLaw::HuntCrossley { stiffness: 0.5, exponent: 1.5, dissipation: 0.01 },
];

const CORRECTIONS: [Correction; 3] = [Correction::None, Correction::History, Correction::Splitting];

/// One group of columns a law, in the order of `LAWS`, of one column a correction: none, λ_v/λ_a with the past
/// projected, splitting. Flags as in `rigid.rs`; '?': scenes without a rigid row are compared, the others refused.
const TABLE: &str = "\
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. composite
.+. +++ +++ +++ +++ +++ ... +++ +++ +++ Newmark(0.25, 0.5)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Newmark(0.3025, 0.6)
.+. +++ +++ +++ +++ +++ ... +++ +++ +++ Newmark(0.5, 1)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u HHT-α(0.5)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u WBZ-α(0.5)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Chung–Hulbert(0.9)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Chung–Hulbert(0.8)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Chung–Hulbert(0.5)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Chung–Hulbert(0)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u GSSSS-U0(0.8, 0.8, 0.8)
.+. +++ +++ +++ +++ +++ ... +++ +++ +++ GSSSS-U0(1, 1, 0)
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. Houbolt
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. Park
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. BDF2
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. OALTS(0.5)
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. Bathe
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. Bathe(γ = 0.5)
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. ρ∞-Bathe(0.5)
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. ρ∞-Bathe(0.9)
.+. ++. ++. ++. ++. ++. ... ++. ++. ++. ρ∞-Bathe(1)
+.. ... ... +.. +.. +.. ... +.. +.. +.. Moreau–Jean(0.5)
+.. ... ... +.. +.. +.. ... +.. +.. +.. Moreau–Jean(1)
.+. +++ +++ +++ +++ +++ ... +++ +++ +++ energy–momentum
... ... ... +.. +.. +.. +.. +.. +.. +.. central difference
+.. ... ... +.. +.. +.. ... +.. +.. +.. CD-Lagrange
... ... ... ??? ??? ??? ... ??? ??? ??? Tchamwa–Wielgosz(1.033)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Chung–Lee(1.0370)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Hulbert–Chung(0.8)
.+. ++u ++u ++u ++u ++u ... ++u ++u ++u Hulbert–Chung(0.5)
... ... ... +.. +.. +.. ... +.. +.. +.. Noh–Bathe(0.5400)
... ... ... +.. +.. +.. ... +.. +.. +.. Noh–Bathe(0.5858)
";

/// The same of laws that admit friction.
const RUBBING: &str = "\
.+. ++. ++. ++. ++. composite
.+. +++ +++ +++ +++ Newmark(0.25, 0.5)
.+. ++u ++u ++u ++u Newmark(0.3025, 0.6)
.+. +++ +++ +++ +++ Newmark(0.5, 1)
.+. ++u ++u ++u ++u HHT-α(0.5)
.+. ++u ++u ++u ++u WBZ-α(0.5)
.+. ++u ++u ++u ++u Chung–Hulbert(0.9)
.+. ++u ++u ++u ++u Chung–Hulbert(0.8)
.+. ++u ++u ++u ++u Chung–Hulbert(0.5)
.+. ++u ++u ++u ++u Chung–Hulbert(0)
.+. ++u ++u ++u ++u GSSSS-U0(0.8, 0.8, 0.8)
.+. +++ +++ +++ +++ GSSSS-U0(1, 1, 0)
.+. ++. ++. ++. ++. Houbolt
.+. ++. ++. ++. ++. Park
.+. ++. ++. ++. ++. BDF2
.+. ++. ++. ++. ++. OALTS(0.5)
.+. ++. ++. ++. ++. Bathe
.+. ++. ++. ++. ++. Bathe(γ = 0.5)
.+. ++. ++. ++. ++. ρ∞-Bathe(0.5)
.+. ++. ++. ++. ++. ρ∞-Bathe(0.9)
.+. ++. ++. ++. ++. ρ∞-Bathe(1)
+.. +.. +.. +.. +.. Moreau–Jean(0.5)
+.. +.. +.. +.. +.. Moreau–Jean(1)
.+. +++ +++ +++ +++ energy–momentum
... +.. +.. +.. +.. central difference
+.. +.. +.. +.. +.. CD-Lagrange
... ... ... ... ... Tchamwa–Wielgosz(1.033)
.+. ++u ++u ++u ++u Chung–Lee(1.0370)
.+. ++u ++u ++u ++u Hulbert–Chung(0.8)
.+. ++u ++u ++u ++u Hulbert–Chung(0.5)
... +.. +.. +.. +.. Noh–Bathe(0.5400)
... +.. +.. +.. +.. Noh–Bathe(0.5858)
";

fn table(laws: &[ContactLaw], rubs: bool) -> String {
    let mut lines: Vec<[String; 2]> = Vec::new();
    let mut worst = 0.0_f64;
    for &law in laws {
        let swept = Sweep {
            corrections: &CORRECTIONS,
            law,
            mixed: true,
            rubs,
            bodies: Bodies::Linear,
            changes: &[1.0],
            seeds: 3,
        }
        .run();
        worst = worst.max(swept.worst);
        for (i, line) in swept.table.lines().enumerate() {
            let (flags, name) = line.split_once(' ').expect("flags and a name");
            match lines.get_mut(i) {
                Some([all, _]) => {
                    all.push(' ');
                    all.push_str(flags);
                }
                None => lines.push([flags.into(), name.into()]),
            }
        }
        for pair in &swept.pairs {
            assert!(pair.sum(|run| run.closings) >= 3, "{law:?}: {}", pair.name);
        }
    }
    println!("largest difference {worst:.0e}");
    let lines: Vec<String> = lines.iter().map(|line| line.join(" ") + "\n").collect();
    lines.concat()
}

#[test]
fn runs_with_other_laws_are_those_of_the_truth() {
    let found = table(&LAWS, false);
    println!("{found}");
    assert_eq!(found, TABLE);
}

#[test]
fn runs_with_other_laws_and_friction_are_those_of_the_truth() {
    let rubbing: Vec<ContactLaw> = [0, 3, 4, 7, 8].map(|law| LAWS[law]).to_vec();
    let found = table(&rubbing, true);
    println!("{found}");
    assert_eq!(found, RUBBING);
}
