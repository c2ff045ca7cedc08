//! Elastic bodies by chance: blocks of quadrilaterals, triangles, hexahedra or tetrahedra, and bars that are folded.

use contact_dynamics::contact::{Facet, Surface};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::vectors::dot;
use std::f64::consts::{FRAC_PI_2, PI};

/// One of some choices.
pub(crate) fn pick<T: Copy>(choices: &[T], random: &mut Congruential) -> T {
    let place = random.unit() * choices.len() as f64;
    let index = (1..choices.len()).take_while(|&next| place >= next as f64).count();
    choices[index]
}

/// A power of ten whose exponent is drawn.
pub(crate) fn decades(low: f64, high: f64, random: &mut Congruential) -> f64 {
    10.0_f64.powf(random.within(low, high))
}

/// An elastic body with its surface.
#[derive(Clone, Debug)]
pub(super) struct Body<const D: usize> {
    pub(super) solid: Solid<D>,
    pub(super) facets: Vec<Facet>,
    /// Length of the shortest side of a cell.
    pub(super) element: f64,
    /// Whether cells are triangles or tetrahedra.
    pub(super) simplices: bool,
}

impl<const D: usize> Body<D> {
    /// A block about the origin, its lower side down.
    pub(super) fn block(size: [f64; D], material: Material, random: &mut Congruential) -> Self {
        let cells = std::array::from_fn(|_| pick(&[1, 2, 3], random));
        let place = |x: [f64; D]| std::array::from_fn(|axis| size[axis] * (x[axis] - 0.5));
        let solid = Solid::grid(cells, material, place);
        let element = size.iter().zip(cells).map(|(size, cells)| size / cells as f64).fold(f64::INFINITY, f64::min);
        Self::of(solid, element, random)
    }

    /// A bar folded to a U of thickness 0.2 with a slot of `slot`, its arms along the first axis.
    pub(super) fn folded(slot: f64, material: Material, random: &mut Congruential) -> Self {
        let (radius, cells) = (0.5 * slot, std::array::from_fn(|axis| if axis == 0 { 11 } else { 1 }));
        let solid = Solid::grid(cells, material, |x: [f64; D]| {
            let (s, across) = (2.75 * x[0], 0.2 * x[D - 1]);
            let angle = PI * ((s - 1.0) / 0.75).clamp(0.0, 1.0) - FRAC_PI_2;
            let straight = if s < 1.75 { s.min(1.0) } else { 2.75 - s };
            let distance = radius + 0.2 - across;
            let mut place = x.map(|x| 0.3 * x);
            place[0] = straight + distance * angle.cos();
            place[D - 1] = distance * angle.sin();
            place
        });
        Self { element: 0.1, ..Self::of(solid, 0.1, random) }
    }

    /// Cut into simplices or not, and its facets into triangles or not.
    fn of(mut solid: Solid<D>, element: f64, random: &mut Congruential) -> Self {
        let [simplices, halved] = [pick(&[true, false, false], random), pick(&[true, false], random)];
        let cells = if simplices { cut(&solid.elements) } else { solid.elements.clone() };
        let surface = Surface::of_cells(&solid.nodes, &cells).expect("a mesh of sound elements");
        let halves = |facet: &Facet| match *facet.nodes() {
            [a, b, c, d] if halved => vec![Facet::from([a, b, c]), Facet::from([a, c, d])],
            _ => vec![*facet],
        };
        let facets = surface.facets().iter().flat_map(halves).collect();
        if simplices {
            solid.elements = cells.iter().map(|cell| collapsed(cell)).collect();
        }
        Self { solid, facets, element, simplices }
    }

    /// With its nodes placed elsewhere.
    pub(super) fn mapped(mut self, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        self.solid = self.solid.mapped(map);
        self
    }
}

/// Triangles of quadrilaterals, tetrahedra of hexahedra (around the diagonal, so that they fit to their neighbors).
fn cut(elements: &[Vec<usize>]) -> Vec<Vec<usize>> {
    const TRIANGLES: [&[usize]; 2] = [&[0, 1, 2], &[0, 2, 3]];
    const TETRAHEDRA: [&[usize]; 6] =
        [&[0, 1, 2, 6], &[0, 2, 3, 6], &[0, 3, 7, 6], &[0, 7, 4, 6], &[0, 4, 5, 6], &[0, 5, 1, 6]];
    let parts = |element: &Vec<usize>| if element.len() == 4 { &TRIANGLES[..] } else { &TETRAHEDRA[..] };
    let part = |element: &[usize], corners: &[usize]| corners.iter().map(|&corner| element[corner]).collect();
    elements.iter().flat_map(|element| parts(element).iter().map(|corners| part(element, corners))).collect()
}

/// A simplex as a quadrilateral or a hexahedron some of whose corners are the same: its strain is constant.
fn collapsed(cell: &[usize]) -> Vec<usize> {
    match *cell {
        [a, b, c] => vec![a, b, c, c],
        [a, b, c, d] => vec![a, b, c, c, d, d, d, d],
        _ => panic!("no simplex: {cell:?}"),
    }
}

/// A rotation by chance: its rows are orthonormal, and right-handed.
pub(super) fn rotation<const D: usize>(random: &mut Congruential) -> [[f64; D]; D] {
    let mut rows = [[0.0; D]; D];
    for k in 0..D {
        let mut row: [f64; D] = std::array::from_fn(|_| random.signed());
        for other in &rows[..k] {
            let along = dot(row, *other);
            row = std::array::from_fn(|i| row[i] - along * other[i]);
        }
        let length = dot(row, row).sqrt();
        rows[k] = row.map(|x| x / length);
    }
    if determinant(&rows) < 0.0 {
        rows[0] = rows[0].map(|x| -x);
    }
    rows
}

fn determinant<const D: usize>(rows: &[[f64; D]; D]) -> f64 {
    let minor = |j: usize, k: usize| rows[D - 2][j] * rows[D - 1][k] - rows[D - 2][k] * rows[D - 1][j];
    if D == 2 { minor(0, 1) } else { (0..3).map(|i| rows[0][i] * minor((i + 1) % 3, (i + 2) % 3)).sum() }
}

pub(super) fn turned<const D: usize>(rotation: &[[f64; D]; D], x: [f64; D]) -> [f64; D] {
    std::array::from_fn(|i| dot(rotation[i], x))
}
