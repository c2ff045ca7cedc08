//! Patch tests on curved surfaces: rings and balls around each other, against Lamé's closed form.

use contact_dynamics_scenes::curved_patch::{CurvedPatch, PatchErrors};
use contact_dynamics_scenes::second_order::Family;
use std::error::Error;
use std::fmt::Write;

/// What presses on what, and how errors fall with the size of elements.
const CONTACTS: [&str; 6] = [
    "mortar, outer the slave",
    "mortar, inner the slave",
    "dual, outer the slave",
    "dual, inner the slave",
    "one pass",
    "two passes",
];

/// Errors of pressure and displacement with their observed orders.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Patch test on curved surfaces: concentric rings that press on each other evenly, by elements around the inner \
         one and the outer one; errors of the pressure (L², the worse of both surfaces) and of the displacement (the \
         worst node) over Lamé's closed form, with the observed orders\n\n\
         | facets | elements | contact | pressure | order | displacement | order |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let families = [
        ("first order", None),
        ("second order, 8 nodes", Some(Family::Serendipity)),
        ("second order, 9 nodes", Some(Family::Lagrange)),
    ];
    for (name, family) in families {
        let meshes: &[[usize; 2]] = if quick { &[[4, 5]] } else { &[[4, 5], [8, 10], [16, 20], [32, 40]] };
        let pressed = |mesh, contact| pressed(&CurvedPatch::rings(mesh, family), contact);
        rows(&mut table, (name, &CONTACTS[..]), meshes, pressed)?;
    }
    balls(&mut table, quick)?;
    Ok(table)
}

/// Parts of balls around each other.
fn balls(table: &mut String, quick: bool) -> Result<(), Box<dyn Error>> {
    table.push_str(
        "\nThe same of balls, a quarter of a cube's side of each, by elements along the sides of the inner one and the \
         outer one\n\n\
         | facets | elements | contact | pressure | order | displacement | order |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let meshes: &[[usize; 2]] = if quick { &[[2, 3]] } else { &[[2, 3], [4, 6]] };
    rows(table, ("first order", &CONTACTS[..2]), meshes, |mesh, contact| {
        let patch = CurvedPatch::balls(mesh, None);
        patch.pressed(patch.mortar(contact == 0)?)
    })
}

/// By one of the contacts.
fn pressed(patch: &CurvedPatch<2>, contact: usize) -> contact_dynamics::Result<PatchErrors> {
    match contact {
        0 | 1 => patch.pressed(patch.mortar(contact == 0)?),
        2 | 3 => patch.pressed(patch.mortar(contact == 2)?.dual()?),
        _ => patch.pressed(patch.nodes_on_facets(contact - 3)?),
    }
}

/// The lines of a case by meshes whose elements are half as large from one to the next.
fn rows(
    table: &mut String,
    (name, contacts): (&str, &[&str]),
    meshes: &[[usize; 2]],
    errors: impl Fn([usize; 2], usize) -> contact_dynamics::Result<PatchErrors>,
) -> Result<(), Box<dyn Error>> {
    for (contact, what) in contacts.iter().enumerate() {
        let mut before: Option<PatchErrors> = None;
        for &mesh in meshes {
            let found = match errors(mesh, contact) {
                Ok(found) => found,
                Err(error) => {
                    eprintln!("{name}, {mesh:?}, {what}: {error}");
                    writeln!(table, "| {name} | {}, {} | {what} | fails | | | |", mesh[0], mesh[1])?;
                    break;
                }
            };
            let order = |of: fn(&PatchErrors) -> f64| {
                before.map_or(String::new(), |before| format!(" {:.1}", (of(&before) / of(&found)).log2()))
            };
            let [pressure, displacement] = [order(|errors| errors.pressure), order(|errors| errors.displacement)];
            writeln!(
                table,
                "| {name} | {}, {} | {what} | {:.1e} |{pressure} | {:.1e} |{displacement} |",
                mesh[0], mesh[1], found.pressure, found.displacement
            )?;
            before = Some(found);
        }
    }
    Ok(())
}
