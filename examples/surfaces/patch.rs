//! Patch tests: two bodies under the same pressure from all sides, whose displacements are linear.

use contact_dynamics_scenes::second_order::{Family, SecondOrderStack};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;
use std::error::Error;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Largest errors of the displacements, for meshes that match and that do not.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Patch test: largest error of the displacements over the largest displacement\n\n\
         | interface | elements below, above | one pass | two passes | mortar, slave above | slave below | dual, slave \
         above | slave below |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let meshes = if quick { &[(3, 2)][..] } else { &[(3, 3), (2, 4), (3, 4), (4, 2), (7, 2)] };
    for &(below, above) in meshes {
        let bodies = || [below, above].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
        let flat = Stack::new(bodies(), 0.0, |x| x);
        row(&mut table, "line", &format!("{below}, {above}"), &flat)?;
        let curved = Stack::new(bodies(), 0.0, |[x, y]| [x, y + 0.35 * x * (2.0 - y) * y]);
        row(&mut table, "slanted line", &format!("{below}, {above}"), &curved)?;
    }
    let meshes = if quick { &[([2, 2], [1, 1])][..] } else { &[([3, 3], [3, 3]), ([3, 3], [2, 2]), ([2, 3], [4, 1])] };
    for &(below, above) in meshes {
        let bodies = || [below, above].map(|[x, y]| Solid::block([1.0; 3], [x, y, 1], MATERIAL));
        let name = format!("{} × {}, {} × {}", below[0], below[1], above[0], above[1]);
        row(&mut table, "plane", &name, &Stack::new(bodies(), 0.0, |x| x))?;
        let slanted = Stack::new(bodies(), 0.0, |[x, y, z]| [x, y, z + 0.25 * (x + 0.5 * y) * (2.0 - z) * z]);
        row(&mut table, "slanted plane", &name, &slanted)?;
        row(&mut table, "plane, skewed quads", &name, &Stack::new(bodies(), 0.0, skew))?;
    }
    second_order(&mut table, quick)?;
    off_middle(&mut table, quick)?;
    Ok(table)
}

/// Sides of second order whose nodes are not in the middle: how errors fall with the size of elements.
fn off_middle(table: &mut String, quick: bool) -> Result<(), Box<dyn Error>> {
    table.push_str(
        "\nPatch test on skewed sides of second order, whose nodes are not in the middle, by meshes whose elements are \
         half as large from one to the next, with the observed orders\n\n\
         | elements | elements below, above | slave above | order | slave below | order |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    let families = [
        ("tetrahedra of 10", Family::Simplex),
        ("hexahedra of 20", Family::Serendipity),
        ("hexahedra of 27", Family::Lagrange),
    ];
    for (name, family) in families.into_iter().take(if quick { 1 } else { 3 }) {
        let mut before = [None; 2];
        for cells in if quick { &[1][..] } else { &[1, 2] } {
            let bodies = || [[2 * cells, 2 * cells, 1], [*cells, 2 * cells, 1]];
            let stack =
                SecondOrderStack::new(bodies().map(|cells| Solid::block([1.0; 3], cells, MATERIAL)), family, 0.0, skew);
            let [[a, b, _], [c, d, _]] = bodies();
            write!(table, "| {name} | {a} × {b}, {c} × {d} |")?;
            for (upper, before) in [true, false].into_iter().zip(&mut before) {
                let error = stack.patch(stack.mortar(upper)?).ok();
                let order = before
                    .zip(error)
                    .map_or(String::new(), |(coarse, fine): (f64, f64)| format!(" {:.1}", (coarse / fine).log2()));
                write!(table, " {} |{order} |", error.map_or("fails".into(), small))?;
                *before = error;
            }
            writeln!(table)?;
        }
    }
    Ok(())
}

/// Quadrilaterals that are no parallelograms: across the middle nodes move, sides stay.
fn skew([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x + 0.6 * x * (1.0 - x) * (y - 0.5), y, z]
}

/// Elements of second order, with their facets as they are and as several of first order.
fn second_order(table: &mut String, quick: bool) -> Result<(), Box<dyn Error>> {
    table.push_str(
        "\nPatch test on elements of second order by `Mortar`\n\n\
         | elements | interface | elements below, above | as first order, slave above | slave below | slave above | \
         slave below |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let plates = [
        ("triangles of 6 nodes", Family::Simplex),
        ("quadrilaterals of 8", Family::Serendipity),
        ("quadrilaterals of 9", Family::Lagrange),
    ];
    let solids = [
        ("tetrahedra of 10", Family::Simplex),
        ("hexahedra of 20", Family::Serendipity),
        ("hexahedra of 27", Family::Lagrange),
    ];
    let meshes = if quick { &[(3, 2)][..] } else { &[(2, 3), (5, 2)] };
    for ((name, family), &(below, above)) in plates.iter().flat_map(|of| meshes.iter().map(move |mesh| (of, mesh))) {
        let bodies = || [below, above].map(|cells| Solid::rectangle([1.0; 2], [cells, 1], MATERIAL));
        let cells = format!("{below}, {above}");
        let flat = SecondOrderStack::new(bodies(), *family, 0.0, |x| x);
        second_order_row(table, &format!("{name} | line | {cells}"), &flat)?;
        let slanted = SecondOrderStack::new(bodies(), *family, 0.0, |[x, y]| [x, y + 0.35 * x * (2.0 - y) * y]);
        second_order_row(table, &format!("{name} | slanted line | {cells}"), &slanted)?;
    }
    for (name, family) in solids.iter().take(if quick { 1 } else { 3 }) {
        let bodies = || [[2, 2, 1], [1, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
        let flat = SecondOrderStack::new(bodies(), *family, 0.0, |x| x);
        second_order_row(table, &format!("{name} | plane | 2 × 2, 1 × 2"), &flat)?;
        let slant = |[x, y, z]: [f64; 3]| [x, y, z + 0.25 * (x + 0.5 * y) * (2.0 - z) * z];
        let slanted = SecondOrderStack::new(bodies(), *family, 0.0, slant);
        second_order_row(table, &format!("{name} | slanted plane | 2 × 2, 1 × 2"), &slanted)?;
        let skewed = SecondOrderStack::new(bodies(), *family, 0.0, skew);
        second_order_row(table, &format!("{name} | plane, skewed sides | 2 × 2, 1 × 2"), &skewed)?;
    }
    Ok(())
}

fn second_order_row<const D: usize>(
    table: &mut String,
    name: &str,
    stack: &SecondOrderStack<D>,
) -> Result<(), Box<dyn Error>> {
    write!(table, "| {name} |")?;
    let parts = [true, false].map(|upper| stack.mortar_of_first_order(upper));
    let whole = [true, false].map(|upper| stack.mortar(upper));
    for contact in parts.into_iter().chain(whole) {
        write!(table, " {} |", stack.patch(contact?).map_or("fails".into(), small))?;
    }
    writeln!(table)?;
    Ok(())
}

fn row<const D: usize>(
    table: &mut String,
    interface: &str,
    cells: &str,
    stack: &Stack<D>,
) -> Result<(), Box<dyn Error>> {
    let nodes = [1, 2].map(|passes| stack.patch(stack.nodes_on_facets(passes)?));
    let mortar = [true, false].map(|upper| stack.patch(stack.mortar(upper)?));
    let dual = [true, false].map(|upper| stack.patch(stack.mortar(upper)?.dual()?));
    write!(table, "| {interface} | {cells} |")?;
    for error in nodes.into_iter().chain(mortar).chain(dual) {
        write!(table, " {} |", small(error?))?;
    }
    writeln!(table)?;
    Ok(())
}

/// Rounding is not a figure.
fn small(error: f64) -> String {
    if error < 1e-11 { "exact".into() } else { format!("{error:.1e}") }
}
