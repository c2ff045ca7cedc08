//! Dofs without mass, damped and not, some of which touch: every scheme with every correction, on rigid contact, with
//! friction and without. Implicit stages solve for them with the others, explicit ones before.

use crate::independent::Bodies;
use crate::sweep::Sweep;
use crate::{friction, rigid};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes::{self, Listed};

/// What these schemes do with dofs without mass that others do not: refuse them, or, explicit ones, what is damped there.
const APART: [(&str, &str); 10] = [
    ("Moreau–Jean(0.5)", "..........."),
    ("energy–momentum", "..........."),
    ("Chung–Lee(1.0370)", "..........."),
    ("Hulbert–Chung(0.8)", "..........."),
    ("Hulbert–Chung(0.5)", "..........."),
    ("Tchamwa–Wielgosz(1.033)", "..........."),
    ("central difference", "u.........."),
    ("CD-Lagrange", "u.........."),
    ("Noh–Bathe(0.5400)", "u.........."),
    ("Noh–Bathe(0.5858)", "u.........."),
];

/// The table of the same scenes whose dofs all have mass, but for the schemes above.
fn expected(with_mass: &str, is_told: impl Fn(&str) -> bool) -> String {
    let lines = with_mass.lines().filter_map(|line| {
        let (flags, name) = line.split_once(' ').expect("flags and a name");
        let apart = APART.iter().find(|(scheme, _)| *scheme == name);
        is_told(name).then(|| format!("{} {name}\n", apart.map_or(flags, |(_, flags)| flags)))
    });
    lines.collect()
}

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
    assert_eq!(swept.table, expected(rigid::TABLE, |_| true));
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
    let explicit: Vec<String> =
        schemes::all().iter().filter(|listed| listed.critical.is_some()).map(Listed::name).collect();
    assert_eq!(swept.table, expected(friction::TABLE, |name| !explicit.iter().any(|explicit| explicit == name)));
    for pair in &swept.pairs {
        let counts = [pair.long(), pair.sum(|run| run.closings), pair.sum(|run| run.slid), pair.sum(|run| run.stuck)];
        assert!(counts.iter().zip([2, 20, 20, 20]).all(|(count, least)| *count >= least), "{}: {counts:?}", pair.name);
    }
}
