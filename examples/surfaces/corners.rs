//! Blocks that fall on blocks by corners, edges and faces: who gains energy, and what gets inside.

use contact_dynamics::Composite;
use contact_dynamics_scenes::falls::{Fall, FallFigures, Keeps, Landing};
use contact_dynamics_scenes::random::xorshift;
use std::error::Error;
use std::fmt::Write;

/// A rise of the energy that is not the scheme's own.
const GAIN: f64 = 0.01;

const CONTACTS: [(&str, Keeps); 5] = [
    ("two passes", Keeps::TwoPasses),
    ("two passes, edges", Keeps::TwoPassesAndEdges),
    ("mortar", Keeps::Mortar),
    ("bodies", Keeps::Bodies),
    ("bodies, of itself", Keeps::Itself),
];

/// How often energy is gained, how much, how deep nodes and edges get, and how many steps are refused.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Blocks that fall on blocks, in random orientations: falls whose energy rises by more than 1 % above that at \
         the start, highest energy over that, deepest node in a facet and edge in an edge over the element size, \
         steps refused, falls that fail\n\n\
         | landing | contact | falls | gain energy | highest | node | edge | refused | fail |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let landings = [
        ("any", Landing::Any),
        ("corner on face", Landing::Corner),
        ("edge on face", Landing::Edge),
        ("face on face", Landing::Face),
        ("edge across edge", Landing::Across),
        ("corner beside edge", Landing::Beside),
    ];
    let falls = if quick { 1 } else { 20 };
    for (name, landing) in landings {
        for (contact, keeps) in CONTACTS {
            let mut random = xorshift(77);
            let (mut gained, mut failed, mut refused) = (0, 0, 0);
            let (mut highest, mut node, mut edge) = (0.0_f64, 0.0_f64, 0.0_f64);
            for fall in 0..falls {
                let scene = Fall::new(landing, &mut random);
                let courant = 0.5 + random();
                let until = if quick { 2.0 } else { 8.0 };
                match scene.run(keeps, Box::new(Composite), courant, until) {
                    Ok(figures) => {
                        let FallFigures { node_depth, edge_depth, .. } = figures;
                        gained += usize::from(figures.highest > 1.0 + GAIN);
                        refused += figures.refused;
                        highest = highest.max(figures.highest);
                        (node, edge) = (node.max(node_depth / scene.element), edge.max(edge_depth / scene.element));
                    }
                    Err(error) => {
                        eprintln!("{name}, {contact}, fall {fall}: {error}");
                        failed += 1;
                    }
                }
            }
            writeln!(
                table,
                "| {name} | {contact} | {falls} | {gained} | {highest:.3} | {node:.0e} | {edge:.0e} | {refused} | \
                 {failed} |"
            )?;
        }
    }
    Ok(table)
}
