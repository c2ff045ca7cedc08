//! Elastic bodies in two and three dimensions: meshes of quad4 (plane strain) and hex8 elements, and their assembly.

use contact_dynamics::contact::Surface;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{LinearSystem, Real};

/// A linear elastic material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub young: f64,
    pub poisson: f64,
    pub density: f64,
}

impl Material {
    /// Speed of dilatational waves.
    pub fn wave_speed(&self) -> f64 {
        let Self { young, poisson, density } = *self;
        (young * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson) * density)).sqrt()
    }

    /// E/(1 − ν²).
    pub fn plane_modulus(&self) -> f64 {
        self.young / (1.0 - self.poisson * self.poisson)
    }

    /// Lamé's λ and μ.
    pub fn lame(&self) -> [f64; 2] {
        let Self { young, poisson, .. } = *self;
        [young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson))]
    }
}

/// A mesh of one element kind: quad4 in two dimensions (unit thickness), hex8 in three. Dofs are numbered node by node.
#[derive(Clone, Debug)]
pub struct Solid<const D: usize> {
    pub nodes: Vec<[f64; D]>,
    /// Corners of each element, in the order of the reference element's corners ([`corner`]).
    pub elements: Vec<Vec<usize>>,
    pub material: Material,
}

/// Corner k of the reference element [−1, 1]^D: the sides counterclockwise, the bottom first.
fn corner<const D: usize>(k: usize) -> [f64; D] {
    let signs = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][k % 4];
    std::array::from_fn(|axis| if axis < 2 { signs[axis] } else { [-1.0, 1.0][k / 4] })
}

/// Shape functions and their derivatives at a point of the reference element.
fn shapes<const D: usize>(at: [f64; D]) -> Vec<(f64, [f64; D])> {
    let shape = |k: usize| {
        let corner = corner::<D>(k);
        let factor = |axis: usize| 0.5 * (1.0 + corner[axis] * at[axis]);
        let product = |skipped: usize| (0..D).filter(|&a| a != skipped).map(factor).product::<f64>();
        (product(D), std::array::from_fn(|axis| 0.5 * corner[axis] * product(axis)))
    };
    (0..1 << D).map(shape).collect()
}

/// Determinant and inverse of a small matrix by Gauss–Jordan elimination.
pub(crate) fn invert<const D: usize>(mut a: [[f64; D]; D]) -> (f64, [[f64; D]; D]) {
    let mut inverse: [[f64; D]; D] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let mut determinant = 1.0;
    for k in 0..D {
        let best = (k..D).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
        if best != k {
            a.swap(k, best);
            inverse.swap(k, best);
            determinant = -determinant;
        }
        let pivot = a[k][k];
        determinant *= pivot;
        for j in 0..D {
            a[k][j] /= pivot;
            inverse[k][j] /= pivot;
        }
        for i in (0..D).filter(|&i| i != k) {
            let factor = a[i][k];
            for j in 0..D {
                a[i][j] -= factor * a[k][j];
                inverse[i][j] -= factor * inverse[k][j];
            }
        }
    }
    (determinant, inverse)
}

impl Solid<3> {
    /// A block of `cells` hex8 elements with one corner in the origin.
    pub fn block(size: [f64; 3], cells: [usize; 3], material: Material) -> Self {
        Self::grid(cells, material, |x| std::array::from_fn(|axis| size[axis] * x[axis]))
    }

    /// A quarter of a ball of radius `radius` around (0, 0, radius), x, y ≥ 0, of elements that become smaller toward
    /// the pole in the origin: `cells` of them along x, y and z.
    pub fn quarter_ball(radius: f64, cells: [usize; 3], finest: f64, material: Material) -> Self {
        Self::ball_part(radius, (cells, cells), finest, material, |x| x)
    }

    /// Half of a ball, as [`quarter_ball`](Self::quarter_ball) with y ≥ 0 alone; `cells` along x are those of a side.
    pub fn half_ball(radius: f64, cells: [usize; 3], finest: f64, material: Material) -> Self {
        let [x, y, z] = cells;
        Self::ball_part(radius, (cells, [2 * x, y, z]), finest, material, |x| 2.0 * x - 1.0)
    }

    /// Part of a ball in a grid of `all` cells; `cells` are those from the pole outward, and `across` places x in
    /// [0, 1] across the pole.
    fn ball_part(
        radius: f64,
        (cells, all): ([usize; 3], [usize; 3]),
        finest: f64,
        material: Material,
        across: fn(f64) -> f64,
    ) -> Self {
        let graded = |x: f64, ratio: f64| (ratio.powf(x) - 1.0) / (ratio - 1.0);
        // Ratio of the largest to the smallest element such that the smallest is `finest`.
        let ratio = |cells: usize, length: f64| {
            let first = |ratio: f64| length * graded(1.0 / cells as f64, ratio);
            let (mut low, mut high) = (1.0 + 1e-9, 1e6);
            for _ in 0..200 {
                let middle = f64::sqrt(low * high);
                if first(middle) > finest { low = middle } else { high = middle }
            }
            low
        };
        let ratios = [ratio(cells[0], 0.7 * radius), ratio(cells[1], 0.7 * radius), ratio(cells[2], 2.0 * radius)];
        Self::grid(all, material, |x| {
            let side = across(x[0]);
            let [px, py] = [side.signum() * graded(side.abs(), ratios[0]), graded(x[1], ratios[1])];
            let pz = 2.0 * graded(x[2], ratios[2]) - 1.0;
            // The cube [−1, 1]³ mapped to the ball.
            let [a, b, c] = [px * px, py * py, pz * pz];
            [
                radius * px * (1.0 - b / 2.0 - c / 2.0 + b * c / 3.0).sqrt(),
                radius * py * (1.0 - c / 2.0 - a / 2.0 + c * a / 3.0).sqrt(),
                radius + radius * pz * (1.0 - a / 2.0 - b / 2.0 + a * b / 3.0).sqrt(),
            ]
        })
    }

    /// A ring around the y axis, of `cells` elements across, around and along the axis.
    pub fn hoop(radii: [f64; 2], width: f64, cells: [usize; 3], material: Material) -> Self {
        let plane = Solid::ring(radii, [cells[0], cells[1]], material);
        let count = plane.nodes.len();
        let slice = |k: usize| width * (k as f64 / cells[2] as f64 - 0.5);
        let nodes = (0..=cells[2]).flat_map(|k| plane.nodes.iter().map(move |[x, z]| [*x, slice(k), *z]));
        // Seen against the y axis the plane's elements go clockwise: the far slice comes first.
        let element = |k: usize, corners: &[usize]| -> Vec<usize> {
            corners.iter().map(|n| n + (k + 1) * count).chain(corners.iter().map(|n| n + k * count)).collect()
        };
        let elements = (0..cells[2]).flat_map(|k| plane.elements.iter().map(move |corners| element(k, corners)));
        Self { nodes: nodes.collect(), elements: elements.collect(), material }
    }

    /// Turned about an axis through the origin.
    pub fn rotated(self, axis: [f64; 3], angle: f64) -> Self {
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [x, y, z] = axis.map(|a| a / length);
        let (s, c) = angle.sin_cos();
        let (k, t) = ([x, y, z], 1.0 - c);
        let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
        let matrix: [[f64; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| t * k[i] * k[j] + s * cross[i][j] + if i == j { c } else { 0.0 })
        });
        self.mapped(|p| std::array::from_fn(|i| (0..3).map(|j| matrix[i][j] * p[j]).sum()))
    }
}

impl Solid<2> {
    /// A rectangle of `cells` quad4 elements with one corner in the origin.
    pub fn rectangle(size: [f64; 2], cells: [usize; 2], material: Material) -> Self {
        Self::grid(cells, material, |x| std::array::from_fn(|axis| size[axis] * x[axis]))
    }

    /// A disc around the origin, of `cells` × `cells` elements of a square drawn round.
    pub fn disc(radius: f64, cells: usize, material: Material) -> Self {
        Self::grid([cells; 2], material, |x| {
            let [x, y] = x.map(|x| 2.0 * x - 1.0);
            [radius * x * (1.0 - y * y / 2.0).sqrt(), radius * y * (1.0 - x * x / 2.0).sqrt()]
        })
    }

    /// A ring around the origin, of `cells` elements across and around.
    pub fn ring(radii: [f64; 2], cells: [usize; 2], material: Material) -> Self {
        let [across, around] = cells;
        let node = |i: usize, j: usize| i + (across + 1) * (j % around);
        let place = |i: usize, j: usize| {
            let radius = radii[0] + (radii[1] - radii[0]) * i as f64 / across as f64;
            let (s, c) = (std::f64::consts::TAU * j as f64 / around as f64).sin_cos();
            [radius * c, radius * s]
        };
        let nodes = (0..around).flat_map(|j| (0..=across).map(move |i| place(i, j))).collect();
        let element = |i, j| vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        let elements = (0..around).flat_map(|j| (0..across).map(move |i| element(i, j))).collect();
        Self { nodes, elements, material }
    }

    /// Turned about the origin.
    pub fn rotated(self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        self.mapped(|[x, y]| [c * x - s * y, s * x + c * y])
    }
}

impl<const D: usize> Solid<D> {
    /// The unit cube cut into `cells`, its nodes placed by `place`.
    pub fn grid(cells: [usize; D], material: Material, place: impl Fn([f64; D]) -> [f64; D]) -> Self {
        let points = cells.map(|n| n + 1);
        let split = |mut index: usize, sizes: [usize; D]| -> [usize; D] {
            std::array::from_fn(|axis| {
                let place = index % sizes[axis];
                index /= sizes[axis];
                place
            })
        };
        let join = |at: [usize; D]| (0..D).rev().fold(0, |index, axis| index * points[axis] + at[axis]);
        let nodes = (0..points.iter().product()).map(|i| {
            let at = split(i, points);
            place(std::array::from_fn(|axis| at[axis] as f64 / cells[axis] as f64))
        });
        let elements = (0..cells.iter().product()).map(|e| {
            let at = split(e, cells);
            let node = |k: usize| {
                let corner = corner::<D>(k);
                join(std::array::from_fn(|axis| at[axis] + usize::from(corner[axis] > 0.0)))
            };
            (0..1 << D).map(node).collect()
        });
        Self { nodes: nodes.collect(), elements: elements.collect(), material }
    }

    /// With its nodes placed elsewhere.
    pub fn mapped(mut self, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        for node in &mut self.nodes {
            *node = map(*node);
        }
        self
    }

    /// Moved.
    pub fn moved(self, by: [f64; D]) -> Self {
        self.mapped(|p| std::array::from_fn(|axis| p[axis] + by[axis]))
    }

    /// Moved so that its lowest node is at `height` of the last axis.
    pub fn lifted(self, height: f64) -> Self {
        let lowest = self.nodes.iter().map(|node| node[D - 1]).fold(f64::INFINITY, f64::min);
        self.moved(std::array::from_fn(|axis| if axis == D - 1 { height - lowest } else { 0.0 }))
    }

    /// This body and another one of the same material, as one system; nodes of the other come behind.
    pub fn with(mut self, other: Self) -> Self {
        assert_eq!(self.material, other.material);
        let first = self.nodes.len();
        self.nodes.extend(other.nodes);
        self.elements.extend(other.elements.into_iter().map(|e| e.into_iter().map(|n| n + first).collect()));
        self
    }

    pub fn dofs(&self) -> usize {
        D * self.nodes.len()
    }

    /// The dof of a node along an axis.
    pub fn dof(node: usize, axis: usize) -> usize {
        D * node + axis
    }

    /// Sides of elements that belong to one element only, oriented outward: counterclockwise seen from outside in three
    /// dimensions, with the body on the left in two.
    pub fn boundary(&self) -> Vec<Vec<usize>> {
        let surface = Surface::of_cells(&self.nodes, &self.elements).expect("a mesh of sound elements");
        surface.facets().iter().map(|facet| facet.nodes().to_vec()).collect()
    }

    /// The nodes of [`boundary`](Self::boundary), ascending.
    pub fn surface_nodes(&self) -> Vec<usize> {
        let mut nodes: Vec<_> = self.boundary().into_iter().flatten().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Shape functions, their derivatives in space, and weight times volume, at the Gauss points of an element.
    pub(crate) fn gauss_points(&self, element: &[usize]) -> Vec<(Vec<f64>, Vec<[f64; D]>, f64)> {
        let point = |k: usize| {
            let shapes = shapes::<D>(corner::<D>(k).map(|x| x / 3.0_f64.sqrt()));
            // jacobian[i][j] = ∂x_j/∂ξ_i
            let jacobian: [[f64; D]; D] = std::array::from_fn(|i| {
                std::array::from_fn(|j| shapes.iter().zip(element).map(|((_, d), &n)| d[i] * self.nodes[n][j]).sum())
            });
            let (volume, inverse) = invert(jacobian);
            assert!(volume > 0.0, "an element is turned inside out");
            let derivative =
                |d: &[f64; D]| -> [f64; D] { std::array::from_fn(|j| (0..D).map(|i| inverse[j][i] * d[i]).sum()) };
            (shapes.iter().map(|s| s.0).collect(), shapes.iter().map(|s| derivative(&s.1)).collect(), volume)
        };
        (0..1 << D).map(point).collect()
    }

    /// K, small strains; plane strain in two dimensions.
    pub fn stiffness<T: Real>(&self) -> SparseColMat<usize, T> {
        let [lambda, mu] = self.material.lame();
        let mut triplets = Vec::new();
        for element in &self.elements {
            let points = self.gauss_points(element);
            for (a, &node_a) in element.iter().enumerate() {
                for (b, &node_b) in element.iter().enumerate() {
                    let mut block = [[0.0; D]; D];
                    for (_, derivatives, volume) in &points {
                        let (da, db) = (derivatives[a], derivatives[b]);
                        let dot: f64 = da.iter().zip(&db).map(|(x, y)| x * y).sum();
                        for i in 0..D {
                            for j in 0..D {
                                let diagonal = if i == j { mu * dot } else { 0.0 };
                                block[i][j] += volume * (lambda * da[i] * db[j] + mu * da[j] * db[i] + diagonal);
                            }
                        }
                    }
                    for (i, row) in block.iter().enumerate() {
                        for (j, &value) in row.iter().enumerate() {
                            triplets.push(Triplet::new(D * node_a + i, D * node_b + j, value));
                        }
                    }
                }
            }
        }
        let k = SparseColMat::<usize, f64>::try_new_from_triplets(self.dofs(), self.dofs(), &triplets).unwrap();
        let (pattern, values) = k.into_parts();
        SparseColMat::new(pattern, values.into_iter().map(T::of).collect())
    }

    /// Row-sum lumped masses.
    pub fn lumped_mass<T: Real>(&self) -> Vec<T> {
        let mut mass = vec![0.0; self.dofs()];
        for element in &self.elements {
            for (shapes, _, volume) in self.gauss_points(element) {
                for (&node, shape) in element.iter().zip(shapes) {
                    for axis in 0..D {
                        mass[D * node + axis] += self.material.density * volume * shape;
                    }
                }
            }
        }
        mass.into_iter().map(T::of).collect()
    }

    /// The consistent M.
    pub fn consistent_mass(&self) -> SparseColMat<usize, f64> {
        let mut triplets = Vec::new();
        for element in &self.elements {
            for (shapes, _, volume) in self.gauss_points(element) {
                for (&row, x) in element.iter().zip(&shapes) {
                    for (&column, y) in element.iter().zip(&shapes) {
                        let m = self.material.density * volume * x * y;
                        triplets.extend((0..D).map(|axis| Triplet::new(D * row + axis, D * column + axis, m)));
                    }
                }
            }
        }
        SparseColMat::try_new_from_triplets(self.dofs(), self.dofs(), &triplets).unwrap()
    }

    /// The free system with lumped mass.
    pub fn system<T: Real>(&self) -> LinearSystem<'static, T> {
        LinearSystem::lumped(self.lumped_mass(), self.stiffness()).unwrap()
    }

    /// One velocity or displacement for all nodes.
    pub fn uniform<T: Real>(&self, value: [f64; D]) -> Vec<T> {
        (0..self.dofs()).map(|dof| T::of(value[dof % D])).collect()
    }

    /// The dofs of all nodes.
    pub fn node_dofs(&self) -> Vec<[usize; D]> {
        (0..self.nodes.len()).map(|node| std::array::from_fn(|axis| Self::dof(node, axis))).collect()
    }
}
