//! A strip that is folded between two plates, with a thickness that its line does not have: Euler's elastica.

use contact_dynamics::contact::{NodeToFacet, SurfaceSettings};
use contact_dynamics::faer::sparse::{Pair, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{GeneralizedAlpha, Linearity, Mass, Result, Simulation, System, TangentWeights};
use std::f64::consts::PI;

/// EA and EI.
const AXIAL: f64 = 1e4;
const BENDING: f64 = 1.0;

/// Damping over mass.
const DAMPING: f64 = 1.0;

/// A chain of links that resist stretch and turning against each other, V = Σ ½ EA (l − L)²/L + Σ ½ EI θ²/L. Further
/// nodes are fixed.
struct Strip {
    nodes: Vec<[f64; 2]>,
    links: usize,
    /// L.
    length: f64,
    mass: Vec<f64>,
    pattern: SymbolicSparseColMat<usize>,
    fixed: Vec<usize>,
}

/// A link: its vector, and l².
struct Link([f64; 2], f64);

impl Link {
    /// Derivatives of its direction angle by its vector: first and second.
    fn turn(&self) -> ([f64; 2], [[f64; 2]; 2]) {
        let ([x, y], square) = (self.0, self.1);
        let (double, difference) = (2.0 * x * y / square.powi(2), (y * y - x * x) / square.powi(2));
        ([-y / square, x / square], [[double, difference], [difference, -double]])
    }
}

impl Strip {
    fn new(nodes: Vec<[f64; 2]>, links: usize, length: f64) -> Self {
        let coupled = |a: usize, b: usize| a == b || (a.max(b) <= links && a.abs_diff(b) <= 2);
        let dofs = 2 * nodes.len();
        let pairs: Vec<_> = (0..dofs)
            .flat_map(|col| (0..dofs).filter(move |row| coupled(row / 2, col / 2)).map(move |row| Pair { row, col }))
            .collect();
        let pattern = SymbolicSparseColMat::try_new_from_indices(dofs, dofs, &pairs).unwrap().0;
        // The apex does not leave its place along the plates.
        let fixed = std::iter::once(links).chain(2 * links + 2..dofs).collect();
        Self { mass: vec![length; dofs], nodes, links, length, pattern, fixed }
    }

    fn link(&self, u: &[f64], number: usize) -> Link {
        let vector: [f64; 2] = std::array::from_fn(|axis| {
            let place = |node: usize| self.nodes[node][axis] + u[2 * node + axis];
            place(number + 1) - place(number)
        });
        Link(vector, vector[0] * vector[0] + vector[1] * vector[1])
    }

    /// The angle from one link to the next.
    fn angle(&self, u: &[f64], number: usize) -> f64 {
        let [a, b] = [number, number + 1].map(|number| self.link(u, number).0);
        (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
    }

    fn add(&self, out: &mut [f64], [row, column]: [usize; 2], value: f64) {
        let start = self.pattern.col_ptr()[column];
        let place = self.pattern.row_idx_of_col_raw(column).binary_search(&row).unwrap();
        out[start + place] += value;
    }

    /// The derivatives of an angle by the coordinates of its three nodes.
    fn gradient(&self, u: &[f64], number: usize) -> [f64; 6] {
        let [a, b] = [number, number + 1].map(|number| self.link(u, number).turn().0);
        [a[0], a[1], -a[0] - b[0], -a[1] - b[1], b[0], b[1]]
    }
}

impl System<f64> for Strip {
    fn dofs(&self) -> usize {
        self.mass.len()
    }

    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }

    fn force(&mut self, _: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        for ((out, v), mass) in out.iter_mut().zip(v).zip(&self.mass) {
            *out = -DAMPING * mass * v;
        }
        for number in 0..self.links {
            let Link(vector, square) = self.link(u, number);
            let stretched = square.sqrt();
            let tension = AXIAL * (stretched - self.length) / self.length / stretched;
            for axis in 0..2 {
                out[2 * number + axis] += tension * vector[axis];
                out[2 * number + 2 + axis] -= tension * vector[axis];
            }
        }
        for number in 0..self.links - 1 {
            let moment = BENDING * self.angle(u, number) / self.length;
            for (out, slope) in out[2 * number..].iter_mut().zip(self.gradient(u, number)) {
                *out -= moment * slope;
            }
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        for dof in 0..self.mass.len() {
            self.add(out, [dof; 2], weights.damping * DAMPING * self.mass[dof]);
        }
        // Second derivatives by the vector of a link.
        let add_link = |out: &mut [f64], number: usize, block: [[f64; 2]; 2]| {
            for (i, row) in block.iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    for (a, b, sign) in [(0, 0, 1.0), (2, 2, 1.0), (0, 2, -1.0), (2, 0, -1.0)] {
                        let place = [2 * number + a + i, 2 * number + b + j];
                        self.add(out, place, weights.stiffness * sign * entry);
                    }
                }
            }
        };
        for number in 0..self.links {
            let Link(vector, square) = self.link(u, number);
            // Pressed links may buckle: their geometric stiffness would make the tangent indefinite.
            let geometric = (AXIAL * (square.sqrt() - self.length) / self.length / square.sqrt()).max(0.0);
            let material = (AXIAL / self.length - geometric) / square;
            add_link(
                out,
                number,
                std::array::from_fn(|i| {
                    std::array::from_fn(|j| material * vector[i] * vector[j] + if i == j { geometric } else { 0.0 })
                }),
            );
        }
        for number in 0..self.links - 1 {
            let moment = BENDING * self.angle(u, number) / self.length;
            let gradient = self.gradient(u, number);
            for (i, x) in gradient.iter().enumerate() {
                for (j, y) in gradient.iter().enumerate() {
                    let value = weights.stiffness * BENDING / self.length * x * y;
                    self.add(out, [2 * number + i, 2 * number + j], value);
                }
            }
            for (number, sign) in [(number, -1.0), (number + 1, 1.0)] {
                add_link(out, number, self.link(u, number).turn().1.map(|row| row.map(|x| sign * moment * x)));
            }
        }
        Ok(())
    }

    fn prescribed(&self) -> &[usize] {
        &self.fixed
    }
}

/// A strip of some links and a thickness, bent to a half circle with straight ends and let go between plates. Returns
/// the force on a plate and the largest curvature in the end, each over its value for the distance of the middle lines.
fn folded(links: usize, thickness: f64) -> [f64; 2] {
    const WHOLE: f64 = PI + 3.0;
    let (length, distance) = (WHOLE / links as f64, 2.0);
    // Along the strip: the upper end, around, the lower end.
    let place = |s: f64| {
        let angle = (s - 0.5 * WHOLE).clamp(-0.5 * PI, 0.5 * PI);
        let straight = (s - 0.5 * WHOLE).abs() - 0.5 * PI;
        [angle.cos() - straight.max(0.0), -angle.sin()]
    };
    let mut nodes: Vec<[f64; 2]> = (0..=links).map(|node| place(length * node as f64)).collect();
    let plate = 0.5 * (distance + thickness);
    nodes.extend([[-9.0, plate], [9.0, plate], [9.0, -plate], [-9.0, -plate]]);
    let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|node| [2 * node, 2 * node + 1]).collect();
    let offsets: Vec<f64> = (0..nodes.len()).map(|node| if node <= links { 0.5 * thickness } else { 0.0 }).collect();
    let strip: Vec<usize> = (0..=links).collect();
    let plates = [[links + 1, links + 2], [links + 3, links + 4]];
    let contact = NodeToFacet::one_pass(&nodes, &dofs, &strip, plates)
        .unwrap()
        .with(SurfaceSettings::new().reach(0.5).offsets(&offsets))
        .unwrap();
    let scheme = GeneralizedAlpha::chung_hulbert(0.0).unwrap();
    let system = Strip::new(nodes, links, length);
    let mut run = Simulation::builder(system, scheme, 0.05).constraint(contact).build().unwrap();
    run.run_until(60.0, &mut ()).unwrap();
    let state = run.state();
    let force = 0.5 * state.contacts().forces().iter().sum::<f64>();
    let speed = state.velocity().iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    assert!(speed < 1e-6, "{speed}");
    let u = state.displacement().to_vec();
    let ends = [1.0 + u[1], -1.0 + u[2 * links + 1]];
    assert!(ends.iter().all(|y| y.abs() <= 0.5 * distance + 1e-9), "{ends:?}");
    let strip = Strip::new((0..=links).map(|node| place(length * node as f64)).collect(), links, length);
    let curvature = (0..links - 1).map(|number| strip.angle(&u, number).abs() / length).fold(0.0, f64::max);
    let largest = 2.0 * FOLD / distance;
    [force / (0.5 * BENDING * largest.powi(2)), curvature / largest]
}

/// ∫ √sin θ dθ over a quarter of a turn.
const FOLD: f64 = 1.198_140_234_735_592;

/// Where the strip leaves a plate it has no curvature, and the plate's force P is all that bends it: with the direction
/// θ from the plate ½ EI κ² = P sin θ, and half of the distance of the middle lines is ∫ sin θ/κ dθ. So κ at the apex
/// is 2 · 1.198 over that distance, as in the bending of fibers between plates (Matthewson, Kurkjian and Gulati, J. Am.
/// Ceram. Soc. 69, 1986), and P = ½ EI κ².
#[test]
fn a_strip_folded_between_plates_is_an_elastica() {
    for thickness in [0.0, 0.3] {
        for (links, bound) in [(32, 5e-3), (64, 2.5e-3)] {
            let ratios = folded(links, thickness);
            let fits = ratios.iter().all(|ratio| (ratio - 1.0).abs() < bound);
            assert!(fits, "{links} links, thickness {thickness}: {ratios:?}");
        }
    }
}
