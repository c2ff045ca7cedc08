//! Bodies of random scenes: masses and the springs or elements between them.

use super::recipe::{Element, Rubber};
use super::rubber;
use crate::surfaces::{decades, pick};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::entries;

/// Masses, what is between them, and how many dofs a node has.
#[derive(Clone, Debug)]
pub(super) struct Bodies {
    pub(super) mass: Vec<f64>,
    pub(super) elements: Vec<Element>,
    pub(super) axes: usize,
    /// Dofs that are at the surface of something, where rows may act.
    pub(super) outside: Vec<usize>,
}

/// Ratios within which masses and stiffnesses lie, in powers of ten.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub(super) mass: f64,
    pub(super) stiffness: f64,
}

impl Spread {
    pub(super) fn new(random: &mut Congruential) -> Self {
        let mut of = || pick(&[0.0, 0.0, 1.0, 2.0, 4.0, 8.0], random);
        Self { mass: of(), stiffness: of() }
    }

    fn mass(self, random: &mut Congruential) -> f64 {
        decades(-0.5 * self.mass, 0.5 * self.mass, random) * random.within(0.5, 2.0)
    }

    fn stiffness(self, random: &mut Congruential) -> f64 {
        decades(-0.5 * self.stiffness, 0.5 * self.stiffness, random) * random.within(0.5, 2.0)
    }
}

impl Bodies {
    fn masses(n: usize, axes: usize, spread: Spread, random: &mut Congruential) -> Vec<f64> {
        (0..n).flat_map(|_| vec![spread.mass(random); axes]).collect()
    }

    /// Bars of equal elements, the last node of each facing the first of the next.
    pub(super) fn chains(spread: Spread, random: &mut Congruential) -> Self {
        let bars = pick(&[1, 1, 2, 3], random);
        let (mut mass, mut elements, mut outside) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..bars {
            let (m, k) = (spread.mass(random), spread.stiffness(random));
            let (n, first) = (pick(&[1, 2, 3, 5, 10], random), mass.len());
            mass.extend((0..n).map(|i| if i == 0 || i + 1 == n { 0.5 * m } else { m }));
            elements.extend((1..n).map(|i| Element::spring(first + i - 1, first + i, k)));
            outside.extend([first, first + n - 1]);
        }
        Self { mass, elements, axes: 1, outside }
    }

    /// A membrane: a grid of masses that move across it, held at some of its corners.
    pub(super) fn plate(spread: Spread, random: &mut Congruential) -> Self {
        let [rows, columns] = [pick(&[2, 3, 4], random), pick(&[2, 3, 5], random)];
        let mass = Self::masses(rows * columns, 1, spread, random);
        let mut elements = Vec::new();
        for i in 0..rows {
            for j in 0..columns {
                let here = columns * i + j;
                if i > 0 {
                    elements.push(Element::spring(here - columns, here, spread.stiffness(random)));
                }
                if j > 0 {
                    elements.push(Element::spring(here - 1, here, spread.stiffness(random)));
                }
                let is_corner = (i == 0 || i + 1 == rows) && (j == 0 || j + 1 == columns);
                if is_corner && pick(&[true, false], random) {
                    elements.push(Element::ground(here, spread.stiffness(random)));
                }
            }
        }
        let outside = (0..mass.len()).collect();
        Self { mass, elements, axes: 1, outside }
    }

    /// Masses in a plane or in space, without springs or with some.
    pub(super) fn cloud(spread: Spread, random: &mut Congruential) -> Self {
        let axes = pick(&[1, 2, 3], random);
        let nodes = pick(&[1, 2, 3, 5, 8], random);
        let mass = Self::masses(nodes, axes, spread, random);
        let mut elements = Vec::new();
        for _ in 0..pick(&[0, 0, 1, 3, 6], random) {
            let [one, other] = [0, 0].map(|_| (random.unit() * nodes as f64) as usize);
            let direction: Vec<f64> = (0..axes).map(|_| random.signed()).collect();
            let k = spread.stiffness(random);
            elements.push(if one == other {
                Element::ground(axes * one, k)
            } else {
                Self::directed(axes, [one, other], &direction, k)
            });
        }
        let outside = (0..mass.len()).collect();
        Self { mass, elements, axes, outside }
    }

    /// A spring between two nodes that resists along a direction.
    fn directed(axes: usize, [one, other]: [usize; 2], direction: &[f64], k: f64) -> Element {
        let of = |node: usize, sign: f64| direction.iter().enumerate().map(move |(a, d)| (axes * node + a, sign * d));
        let terms: Vec<_> = of(one, 1.0).chain(of(other, -1.0)).collect();
        let stiffness = terms.iter().flat_map(|x| terms.iter().map(move |y| k * x.1 * y.1)).collect();
        Element {
            dofs: terms.iter().map(|term| term.0).collect(),
            stiffness,
            shared_mass: 0.0,
            hardening: 0.0,
            rubber: None,
        }
    }

    /// Boxes on each other: a mass with two dofs each.
    pub(super) fn pile(spread: Spread, random: &mut Congruential) -> Self {
        let boxes = pick(&[1, 2, 3, 5, 8], random);
        let mass = Self::masses(boxes, 2, spread, random);
        let outside = (0..mass.len()).collect();
        Self { mass, elements: Vec::new(), axes: 2, outside }
    }

    /// A block of quadrilaterals or hexahedra; outside are the dofs of the nodes of its lower side.
    pub(super) fn block(spread: Spread, random: &mut Congruential) -> Self {
        let poisson = random.within(0.0, 0.4);
        let material = Material { young: spread.stiffness(random), poisson, density: spread.mass(random) };
        match pick(&[2, 3], random) {
            2 => Self::of_solid(&Solid::<2>::grid(cells(random, &[1, 2, 3]), material, |x| x)),
            _ => Self::of_solid(&Solid::<3>::grid(cells(random, &[1, 1, 2]), material, |x| x)),
        }
    }

    fn of_solid<const D: usize>(solid: &Solid<D>) -> Self {
        let n = solid.dofs();
        let mut stiffness = vec![0.0; n * n];
        for (i, j, k) in entries(&solid.stiffness()) {
            stiffness[n * i + j] = k;
        }
        let element = Element { dofs: (0..n).collect(), stiffness, shared_mass: 0.0, hardening: 0.0, rubber: None };
        let below = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][D - 1] < 1e-9);
        let outside = below.flat_map(|node| (0..D).map(move |axis| D * node + axis)).collect();
        Self { mass: solid.lumped_mass(), elements: vec![element], axes: D, outside }
    }

    /// A plate of triangles in the plane, each square of a grid cut in two, its nodes moved a little. Edges are about
    /// one long; outside are the dofs of all nodes.
    pub(super) fn rubber(spread: Spread, random: &mut Congruential) -> Self {
        let [columns, rows] = [pick(&[1, 2, 3, 4], random), pick(&[1, 1, 2], random)];
        let node = |i: usize, j: usize| (columns + 1) * j + i;
        let mut places = Vec::new();
        for j in 0..=rows {
            places.extend((0..=columns).map(|i| [i as f64 + 0.2 * random.signed(), j as f64 + 0.2 * random.signed()]));
        }
        let (mu, density) = (spread.stiffness(random), spread.mass(random));
        let lambda = mu * decades(-1.0, 1.0, random);
        let (mut mass, mut elements) = (vec![0.0; 2 * places.len()], Vec::new());
        for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
            let corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
            for nodes in [[0, 1, 2], [0, 2, 3]].map(|places| places.map(|place: usize| corners[place])) {
                let [x, y, z] = nodes.map(|node| places[node]);
                let twice = (y[0] - x[0]) * (z[1] - x[1]) - (z[0] - x[0]) * (y[1] - x[1]);
                let gradient = |b: [f64; 2], c: [f64; 2]| [(b[1] - c[1]) / twice, (c[0] - b[0]) / twice];
                let gradients = [gradient(y, z), gradient(z, x), gradient(x, y)];
                let material = Rubber { gradients, lambda: 0.5 * twice * lambda, mu: 0.5 * twice * mu };
                let dofs = nodes.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect();
                let stiffness = rubber::stiffness(&material, &[0.0; 6]).concat();
                let rubber = Some(material);
                elements.push(Element { dofs, stiffness, shared_mass: 0.0, hardening: 0.0, rubber });
                nodes.iter().for_each(|node| (0..2).for_each(|axis| mass[2 * node + axis] += density * twice / 6.0));
            }
        }
        let outside = (0..mass.len()).collect();
        Self { mass, elements, axes: 2, outside }
    }

    /// Two grids of masses in space that move along one axis each, large enough that threads share them.
    pub(super) fn lattices(spread: Spread, random: &mut Congruential) -> Self {
        let (mut mass, mut elements) = (Vec::new(), Vec::new());
        for _ in 0..2 {
            let cells: [usize; 3] = cells(random, &[17, 18, 20]);
            let (first, k) = (mass.len(), spread.stiffness(random));
            mass.extend(vec![spread.mass(random); cells.iter().product()]);
            let mut step = 1;
            for count in cells {
                let inner = (first..mass.len()).filter(|node| (node - first) / step % count + 1 < count);
                elements.extend(inner.map(|node| Element::spring(node, node + step, k)));
                step *= count;
            }
        }
        let outside = vec![0, mass.len() / 3, mass.len() / 2, mass.len() - 2, mass.len() - 1];
        Self { mass, elements, axes: 1, outside }
    }

    /// The highest frequency is below this.
    pub(super) fn highest(&self) -> f64 {
        let mut sums = vec![0.0; self.mass.len()];
        for element in &self.elements {
            let n = element.dofs.len();
            for (i, &dof) in element.dofs.iter().enumerate() {
                sums[dof] += element.stiffness[n * i..n * (i + 1)].iter().map(|k| k.abs()).sum::<f64>();
            }
        }
        let ratios = sums.iter().zip(&self.mass).filter(|(_, m)| **m > 0.0).map(|(k, m)| k / m);
        ratios.fold(0.0_f64, f64::max).sqrt()
    }
}

fn cells<const D: usize>(random: &mut Congruential, counts: &[usize]) -> [usize; D] {
    std::array::from_fn(|_| pick(counts, random))
}
