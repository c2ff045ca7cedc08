//! Two plates of a hundred thousand facets: searches, linearizations of the contacts found, and certificates of
//! non-penetration, beside the step without contact.

use super::MATERIAL;
use contact_dynamics::contact::{ContactConstraint, NonPenetration, Stride, Surface};
use contact_dynamics::{Newmark, Simulation};
use contact_dynamics_scenes::solids::Solid;
use contact_dynamics_scenes::stacks::Stack;
use example_support::timing::{Arguments, Ratio, Table, Unit};

const RATIOS: &[Ratio] = &[Ratio { heading: "/ step", to: &["step without contact"] }];

/// A constraint with two states of its dofs: at rest, and with the upper plate aside.
struct Searched {
    contact: Box<dyn ContactConstraint<f64>>,
    states: [Vec<f64>; 2],
    searches: usize,
}

impl Searched {
    fn new(contact: Box<dyn ContactConstraint<f64>>, stack: &Stack<3>, way: f64) -> Self {
        let is_upper = |dof: usize| dof / 3 >= stack.split;
        let moved = |dof: &usize| if is_upper(*dof) && dof.is_multiple_of(3) { way } else { 0.0 };
        let aside = contact.dofs().iter().map(moved).collect();
        Self { states: [vec![0.0; contact.dofs().len()], aside], contact, searches: 0 }
    }

    /// Searches where the plates have moved to since the last search.
    fn search(&mut self) {
        let u = &self.states[self.searches % 2];
        self.contact.search(0.0, u, &self.states[0], 0.0).expect("plates that meet");
        self.searches += 1;
    }
}

pub(super) fn measure(arguments: &Arguments) {
    let n = if arguments.quick { 6 } else { 224 };
    let side = n as f64;
    let plates = [0.0, 0.3].map(|aside| {
        Solid::block([side, side, 1.0], [n, n, 1], MATERIAL).mapped(|[x, y, z]| [x + aside, y + 0.4 * aside, z])
    });
    let stack = Stack::new(plates, 0.1, |x| x);
    println!("two plates of {n}² facets, {} dofs", stack.solid.dofs());
    let mut table = Table::new(Unit::Milli, RATIOS);
    let h = 1.0 / MATERIAL.wave_speed();
    let mut run =
        Simulation::builder(stack.solid.system::<f64>(), Newmark::trapezoidal(), h).build().expect("free plates");
    run.step().expect("a well-posed step");
    table.row("step without contact", move || run.step().expect("a well-posed step"));
    let nodes = |passes: usize| stack.nodes_on_facets(passes).expect("surfaces");
    // The ways, in facets, that the upper plate has gone since the last search.
    for (what, way) in [("nothing moved", 0.0), ("lists kept", 1e-3), ("lists anew", 5.0)] {
        let contacts: [(&str, Box<dyn ContactConstraint<f64>>); 4] = [
            ("nodes on facets, one pass", Box::new(nodes(1))),
            ("nodes on facets, two passes", Box::new(nodes(2))),
            ("mortar", Box::new(stack.mortar(true).expect("surfaces"))),
            ("edges on edges, none sharp", Box::new(stack.edges().expect("surfaces"))),
        ];
        for (name, contact) in contacts {
            let mut searched = Searched::new(contact, &stack, way);
            (0..2).for_each(|_| searched.search());
            table.row(format!("{name}, {what}"), move || searched.search());
        }
    }
    for (what, depth) in [("apart", 0.0), ("all facets near", 0.11)] {
        let solid = &stack.solid;
        let surface = Surface::of_cells(&solid.nodes, &solid.elements).expect("plates");
        let check =
            NonPenetration::new(&solid.nodes, &solid.node_dofs(), &surface).and_then(|check| check.depth(depth));
        let Searched { mut contact, states: [start, end], .. } =
            Searched::new(Box::new(check.expect("a depth")), &stack, 1e-3);
        contact.search(0.0, &start, &start, 0.0).expect("plates apart");
        table.row(format!("certificate, {what}"), move || {
            contact.inspect(&Stride::new([0.0, 1.0], [&start, &end], &start, [&[], &[]])).expect("plates apart");
        });
    }
    table.sample(arguments.repeated(5), 1);
    table.print();
}
