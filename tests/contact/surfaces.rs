//! Surfaces: the outer sides of cells of any kind, their areas and normals, pressures, what is refused.

use contact_dynamics::Error;
use contact_dynamics::contact::{Facet, Surface};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::vectors::{cross, dot, minus};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// The volume within a closed surface of flat facets: the sum of tetrahedra on triangles of its facets.
fn volume(surface: &Surface, nodes: &[[f64; 3]]) -> f64 {
    let fan = |facet: Facet| {
        let x: Vec<_> = facet.nodes().iter().map(|&node| nodes[node]).collect();
        (2..x.len()).map(|k| dot(x[0], cross(x[k - 1], x[k])) / 6.0).sum::<f64>()
    };
    surface.into_iter().map(fan).sum()
}

/// Corners, edges and sides of a cell of three dimensions with straight edges.
struct Kind {
    corners: &'static [[f64; 3]],
    edges: &'static [[usize; 2]],
    /// Its quadrilateral sides.
    quadrilaterals: &'static [[usize; 4]],
    /// Facets of first order.
    facets: usize,
    volume: f64,
}

const KINDS: [Kind; 4] = [
    Kind {
        corners: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        edges: &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
        quadrilaterals: &[],
        facets: 4,
        volume: 1.0 / 6.0,
    },
    Kind {
        corners: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]],
        edges: &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
        quadrilaterals: &[[0, 1, 2, 3]],
        facets: 5,
        volume: 1.0 / 3.0,
    },
    Kind {
        corners: &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 2.0],
            [1.0, 0.0, 2.0],
            [0.0, 1.0, 2.0],
        ],
        edges: &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
        quadrilaterals: &[[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
        facets: 5,
        volume: 1.0,
    },
    Kind {
        corners: &[
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [2.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 3.0],
            [2.0, 0.0, 3.0],
            [2.0, 1.0, 3.0],
            [0.0, 1.0, 3.0],
        ],
        edges: &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
        quadrilaterals: &[[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
        facets: 6,
        volume: 6.0,
    },
];

fn mean<const N: usize>(of: [usize; N], nodes: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|i| of.iter().map(|&node| nodes[node][i]).sum::<f64>() / N as f64)
}

/// Another order, at random.
fn shuffle(list: &mut [usize], seed: u64) {
    let mut random = xorshift(seed);
    let mut drawn: Vec<(f64, usize)> = list.iter().map(|&x| (random(), x)).collect();
    drawn.sort_by(|x, y| x.0.total_cmp(&y.0));
    list.iter_mut().zip(drawn).for_each(|(place, (_, x))| *place = x);
}

#[test]
fn cells_of_every_kind_have_their_sides_turned_outward() {
    for (seed, kind) in KINDS.iter().enumerate() {
        let corners = kind.corners.len();
        let mut nodes = kind.corners.to_vec();
        nodes.extend(kind.edges.map_means(&nodes));
        let with_edges = nodes.len();
        let mut all = nodes.clone();
        all.extend(kind.quadrilaterals.map_means(&nodes));
        if corners == 8 {
            all.push(mean([0, 1, 2, 3, 4, 5, 6, 7], &nodes));
        }
        for count in [corners, with_edges, all.len()] {
            let mut cell: Vec<usize> = (0..count).collect();
            shuffle(&mut cell[corners..], 7 + seed as u64);
            let surface = Surface::of_cells(&all, [&cell]).unwrap();
            assert!((volume(&surface, &all) - kind.volume).abs() < 1e-14 * kind.volume, "{corners} corners, {count}");
            if count == corners {
                assert_eq!(surface.facets().len(), kind.facets);
            }
            assert_eq!(surface.nodes().len(), count - usize::from(count == 27));
            // Mirrored, the numbers go the other way around.
            let mirrored: Vec<_> = all.iter().map(|[x, y, z]| [-x, *y, *z]).collect();
            let surface = Surface::of_cells(&mirrored, [&cell]).unwrap();
            assert!((volume(&surface, &mirrored) - kind.volume).abs() < 1e-14 * kind.volume);
        }
    }
}

trait Means {
    fn map_means(&self, nodes: &[[f64; 3]]) -> Vec<[f64; 3]>;
}

impl<const N: usize> Means for &[[usize; N]] {
    fn map_means(&self, nodes: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.iter().map(|&of| mean(of, nodes)).collect()
    }
}

#[test]
fn sides_between_cells_are_inside() {
    let block = Solid::block([1.0, 2.0, 3.0], [2, 3, 4], MATERIAL);
    let surface = Surface::of_cells(&block.nodes, &block.elements).unwrap();
    assert_eq!(surface.facets().len(), 2 * (6 + 8 + 12));
    assert!((volume(&surface, &block.nodes) - 6.0).abs() < 1e-13);
    let areas = surface.areas(&block.nodes).unwrap();
    assert!((areas.iter().sum::<f64>() - 22.0).abs() < 1e-13);
    let plate = Solid::rectangle([1.0, 2.0], [3, 2], MATERIAL);
    let surface = Surface::of_cells(&plate.nodes, &plate.elements).unwrap();
    assert_eq!(surface.facets().len(), 10);
    assert!((surface.areas(&plate.nodes).unwrap().iter().sum::<f64>() - 6.0).abs() < 1e-14);
    // A wedge upon a hexahedron share a quadrilateral.
    let mut nodes = KINDS[3].corners.to_vec();
    nodes.extend([[0.0, 0.5, 4.0], [2.0, 0.5, 4.0]]);
    let cells = [vec![0, 1, 2, 3, 4, 5, 6, 7], vec![4, 7, 8, 5, 6, 9]];
    let house = Surface::of_cells(&nodes, cells).unwrap();
    assert_eq!(house.facets().len(), 9);
    assert!((volume(&house, &nodes) - 7.0).abs() < 1e-13);
}

/// A ball as a block whose nodes are drawn onto spheres.
fn ball(cells: usize) -> Solid<3> {
    Solid::block([2.0; 3], [cells; 3], MATERIAL).mapped(|x| {
        let x = x.map(|x| x - 1.0);
        let [largest, length] = [x.iter().fold(0.0_f64, |most, x| most.max(x.abs())), dot(x, x).sqrt()];
        if length > 0.0 { x.map(|x| x * largest / length) } else { x }
    })
}

#[test]
fn areas_and_normals_of_a_ball_converge() {
    let mut errors = [Vec::new(), Vec::new()];
    for cells in [4, 8, 16] {
        let ball = ball(cells);
        let surface = Surface::of_cells(&ball.nodes, &ball.elements).unwrap();
        let area: f64 = surface.areas(&ball.nodes).unwrap().iter().sum();
        errors[0].push((area - 4.0 * std::f64::consts::PI).abs());
        let normals = surface.normals(&ball.nodes).unwrap();
        let miss = |(&node, &normal): (&usize, &[f64; 3])| {
            let off = minus(normal, ball.nodes[node]);
            dot(off, off).sqrt()
        };
        errors[1].push(surface.nodes().iter().zip(&normals).map(miss).fold(0.0, f64::max));
    }
    // (Where the edges of the block were the mesh stays irregular, and normals are of the first order.)
    for (errors, least) in errors.into_iter().zip([1.8, 0.9]) {
        let orders = errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect::<Vec<_>>();
        assert!(orders.iter().all(|order| *order > least), "{errors:?}: {orders:?}");
    }
}

#[test]
fn the_pressure_of_one_side_is_that_of_its_rim_and_corners() {
    // A block whose lower side bears a pressure of 3, with friction up to 0.4 of it in any direction.
    let block = Solid::block([1.0, 2.0, 1.0], [3, 2, 2], MATERIAL).mapped(|[x, y, z]| [x * (1.0 + 0.2 * y), y, z]);
    let surface = Surface::of_cells(&block.nodes, &block.elements).unwrap();
    let is_below = |node: &usize| block.nodes[*node][2] == 0.0;
    let below = block.boundary().into_iter().filter(|facet| facet.iter().all(is_below));
    let below = Surface::new(&block.nodes, below.map(|f| Facet::from([f[0], f[1], f[2], f[3]]))).unwrap();
    let areas = below.areas(&block.nodes).unwrap();
    for (slip, direction) in [(0.0, 0.0), (0.4, 0.3), (0.4, 2.0), (0.4, -2.4)] {
        let mut forces = vec![[0.0; 3]; block.nodes.len()];
        let (s, c) = f64::sin_cos(direction);
        for (&node, area) in below.nodes().iter().zip(&areas) {
            forces[node] = [slip * c, slip * s, 1.0].map(|share| 3.0 * share * area);
        }
        let pressures = surface.pressures(&block.nodes, &forces).unwrap();
        let shears = surface.shears(&block.nodes, &forces).unwrap();
        for ((&node, pressure), shear) in surface.nodes().iter().zip(pressures).zip(shears) {
            let expected = if is_below(&node) { [3.0, 3.0 * slip * c, 3.0 * slip * s] } else { [0.0; 3] };
            let found = [pressure, shear[0], shear[1]];
            assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{slip} {node}: {found:?}");
        }
    }
}

#[test]
fn a_pressure_comes_out_as_it_went_in() {
    // Skewed bilinear facets, edges and corners: the forces of a pressure of 3 by its potential, the volume.
    let block = Solid::block([1.0; 3], [2; 3], MATERIAL).mapped(|[x, y, z]| [x + 0.3 * y * z, y - 0.2 * x * x, z + x]);
    let surface = Surface::of_cells(&block.nodes, &block.elements).unwrap();
    let enclosed = |nodes: &[[f64; 3]]| -> f64 {
        // Of a bilinear facet as the mean of both ways to cut it into triangles.
        let cut = |facet: Facet, k: usize| {
            let x: Vec<_> = (0..4).map(|i| nodes[facet.nodes()[(i + k) % 4]]).collect();
            (2..4).map(|k| dot(x[0], cross(x[k - 1], x[k])) / 6.0).sum::<f64>()
        };
        surface.into_iter().map(|facet| 0.5 * (cut(facet, 0) + cut(facet, 1))).sum()
    };
    let d = 1e-4;
    let mut forces = vec![[0.0; 3]; block.nodes.len()];
    for &node in surface.nodes() {
        for axis in 0..3 {
            let mut moved = [block.nodes.clone(), block.nodes.clone()];
            moved[0][node][axis] -= d;
            moved[1][node][axis] += d;
            forces[node][axis] = -3.0 * (enclosed(&moved[1]) - enclosed(&moved[0])) / (2.0 * d);
        }
    }
    let pressures = surface.pressures(&block.nodes, &forces).unwrap();
    assert!(pressures.iter().all(|p| (p - 3.0).abs() < 1e-9), "{pressures:?}");
    let shears = surface.shears(&block.nodes, &forces).unwrap();
    assert!(shears.iter().flatten().all(|tau| tau.abs() < 1e-9), "{shears:?}");
    // A force along a flat side is shear, its own and no pressure.
    let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
    let line = Surface::new::<f64, _, 2>(&square, [[2, 1], [1, 0]]).unwrap();
    let forces = [[0.0; 2], [5.0, 0.0], [0.0; 2]];
    assert_eq!(line.pressures(&square, &forces).unwrap(), [0.0; 3]);
    let shears = line.shears(&square, &forces).unwrap();
    let [x, y]: [f64; 2] = shears[1];
    assert!((x - 5.0).abs() < 1e-15 && y.abs() < 1e-15);
}

#[test]
fn what_is_no_surface_of_cells_is_refused() {
    let block = Solid::block([1.0; 3], [2, 1, 1], MATERIAL);
    let nodes = &block.nodes;
    let refused = |cells: &[Vec<usize>]| Surface::of_cells(nodes, cells).unwrap_err().to_string();
    assert!(refused(&[vec![0, 1, 2, 3, 4, 5, 6]]).contains("has 4 or 10 nodes"));
    assert!(refused(&[vec![0, 1, 2, 99]]).contains("99"));
    assert!(refused(&[vec![0, 1, 2, 3]]).contains("no volume"));
    let line = [[0.0, 0.1], [1.0, 0.4], [2.0, 0.7], [0.5, 2.0]];
    let flat = |cell: [usize; 3]| Surface::of_cells(&line, [cell]).map(drop);
    assert!(flat([0, 1, 3]).is_ok() && flat([0, 1, 2]).unwrap_err().to_string().contains("no volume"));
    assert!(matches!(Surface::of_cells(nodes, [[0; 0]; 0]), Err(Error::Empty { .. })));
    let element = block.elements[0].clone();
    assert!(matches!(Surface::of_cells(nodes, [&element, &element]), Err(Error::Empty { .. })));
    assert!(refused(&[element.clone(), element.clone(), element]).contains("three cells"));
    let mut bent = KINDS[0].corners.to_vec();
    bent.extend([[0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5], [0.5, 0.0, 0.5], [0.5, 0.0, 0.1]]);
    let cell: Vec<usize> = (0..10).collect();
    assert!(Surface::of_cells(&bent, [cell]).unwrap_err().to_string().contains("middles of two edges"));
    let surface = Surface::of_cells(nodes, &block.elements).unwrap();
    assert!(matches!(surface.areas(&[[0.0; 3]; 2]), Err(Error::Dimension { found: 2, .. })));
    assert!(matches!(surface.areas(&[[0.0; 2]; 12]), Err(Error::Dimension { found: 2, .. })));
    let mut lost = nodes.clone();
    lost[3][1] = f64::NAN;
    assert!(matches!(surface.areas(&lost), Err(Error::NotFinite { index: 3, .. })));
    let (good, bad) = (vec![[0.0; 3]; nodes.len()], lost);
    assert!(matches!(surface.pressures(&good, &bad), Err(Error::NotFinite { index: 3, .. })));
}
