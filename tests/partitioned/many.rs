//! Scenes of two, three and four bodies, and a host that lets each of them advance in a code of its own.

use crate::body::{self, Body};
use crate::scene::{Comparison, H, Scene, motion};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::partitioned::{Assembly, Coupling};
use contact_dynamics::{LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{diagonal, product};
use std::ops::Range;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 0.01 };

/// A row over dofs of all bodies, its gap at rest, and whether it is a tie.
struct Row {
    entries: Vec<(usize, f64)>,
    gap: f64,
    is_tie: bool,
}

/// Several bodies in one model; the dofs of each body follow those of the body before.
pub(crate) struct Many {
    stiffness: SparseColMat<usize, f64>,
    mass: SparseColMat<usize, f64>,
    lumped: Option<Vec<f64>>,
    /// Places of plane bodies.
    nodes: Vec<[f64; 2]>,
    /// Dofs of a node.
    axes: usize,
    /// Dofs of the bodies.
    ranges: Vec<Range<usize>>,
    rows: Vec<Row>,
    velocity: Vec<f64>,
}

impl Many {
    /// Two bodies with matching nodes along one axis.
    pub(crate) fn two(scene: Scene) -> Self {
        let row = |(&[first, second], &gap): (&[usize; 2], &f64)| Row {
            entries: vec![(first, -1.0), (second, 1.0)],
            gap,
            is_tie: false,
        };
        Self {
            rows: scene.pairs.iter().zip(&scene.gaps).map(row).collect(),
            ranges: vec![0..scene.split, scene.split..scene.velocity.len()],
            stiffness: scene.stiffness,
            mass: scene.mass,
            lumped: scene.lumped,
            nodes: Vec::new(),
            axes: 1,
            velocity: scene.velocity,
        }
    }

    /// Plane bodies with a velocity each, and no rows yet.
    fn new(bodies: Vec<(Solid<2>, [f64; 2])>) -> Self {
        let (mut ranges, mut velocity, mut first) = (Vec::new(), Vec::new(), 0);
        let mut all: Option<Solid<2>> = None;
        for (solid, v) in bodies {
            ranges.push(first..first + solid.dofs());
            first += solid.dofs();
            velocity.extend(solid.uniform::<f64>(v));
            all = Some(match all {
                Some(before) => before.with(solid),
                None => solid,
            });
        }
        let all = all.expect("bodies");
        let (stiffness, lumped) = (all.stiffness(), all.lumped_mass::<f64>());
        let (mass, lumped) = (diagonal(&lumped), Some(lumped));
        Self { stiffness, mass, lumped, nodes: all.nodes, axes: 2, ranges, rows: Vec::new(), velocity }
    }

    /// The nodes of a body at `value` along an axis, in the order of the other coordinate.
    fn face(&self, body: usize, axis: usize, value: f64) -> Vec<usize> {
        let range = &self.ranges[body];
        let mut nodes: Vec<usize> =
            (range.start / 2..range.end / 2).filter(|&node| (self.nodes[node][axis] - value).abs() < 1e-9).collect();
        nodes.sort_by(|&i, &j| self.nodes[i][1 - axis].total_cmp(&self.nodes[j][1 - axis]));
        nodes
    }

    /// Rows of the nodes of `upper` on the facets between those of `lower`, along an axis.
    fn meet(&mut self, [lower, upper]: [&[usize]; 2], axis: usize, gap: impl Fn(usize) -> f64, is_tie: bool) {
        let along = |node: usize| self.nodes[node][1 - axis];
        let mut rows = Vec::new();
        for (k, &node) in upper.iter().enumerate() {
            let place = along(node);
            let Some(facet) =
                lower.windows(2).find(|ends| place > along(ends[0]) - 1e-9 && place < along(ends[1]) + 1e-9)
            else {
                continue;
            };
            let share = ((place - along(facet[0])) / (along(facet[1]) - along(facet[0]))).clamp(0.0, 1.0);
            let mut entries = vec![(2 * node + axis, 1.0)];
            let below = [(facet[0], share - 1.0), (facet[1], -share)];
            entries.extend(below.map(|(node, weight)| (2 * node + axis, weight)).iter().filter(|e| e.1.abs() > 1e-9));
            rows.push(Row { entries, gap: gap(k), is_tie });
        }
        self.rows.extend(rows);
    }

    /// Three or four squares whose corners meet in a point, all of which fly toward it; of three the lower one is as
    /// wide as the upper two.
    pub(crate) fn point(count: usize, phase: f64) -> Self {
        let n = 3;
        let square = |place: [f64; 2]| Solid::rectangle([1.0, 1.0], [n; 2], MATERIAL).moved(place);
        let mut bodies = vec![(square([-1.0, 0.0]), [0.05, -0.04]), (square([0.0, 0.0]), [-0.04, -0.05])];
        match count {
            3 => {
                let wide = Solid::rectangle([2.0, 1.0], [2 * n, n], MATERIAL).moved([-1.0, -1.0]);
                bodies.push((wide, [0.005, 0.05]));
            }
            _ => bodies.extend([(square([-1.0, -1.0]), [0.04, 0.05]), (square([0.0, -1.0]), [-0.05, 0.06])]),
        }
        let mut scene = Self::new(bodies);
        let gap = |first: f64| move |k: usize| (first + phase + 1.7 * k as f64) * 0.1 * H;
        let lower: Vec<Vec<usize>> = (2..count).map(|body| scene.face(body, 1, 0.0)).collect();
        for side in 0..2 {
            let upper = scene.face(side, 1, 0.0);
            scene.meet([&lower[side.min(count - 3)], &upper], 1, gap([8.3, 6.9][side]), false);
        }
        let pairs: &[[usize; 2]] = if count == 3 { &[[0, 1]] } else { &[[0, 1], [2, 3]] };
        for &[left, right] in pairs {
            let [left, right] = [left, right].map(|body| scene.face(body, 0, 0.0));
            scene.meet([&left, &right], 0, gap(7.6), false);
        }
        scene
    }

    /// A block that falls on another one of a coarser mesh, with a cap of a third mesh tied to its top.
    pub(crate) fn facets(phase: f64) -> Self {
        let block = |size: [f64; 2], cells: [usize; 2], height: f64| {
            Solid::rectangle(size, cells, MATERIAL).moved([-0.5 * size[0], height])
        };
        let mut scene = Self::new(vec![
            (block([2.2, 1.5], [4, 3], -1.5), [0.0, 0.05]),
            (block([2.0, 1.5], [5, 4], 0.0), [0.01, -0.05]),
            (block([2.0, 0.5], [3, 2], 1.5), [0.01, -0.05]),
        ]);
        let [floor, bottom] = [(0, 0.0), (1, 0.0)].map(|(body, height)| scene.face(body, 1, height));
        scene.meet([&floor, &bottom], 1, |k| (8.3 + phase + 1.7 * k as f64) * 0.1 * H, false);
        let [top, cap] = [(1, 1.5), (2, 1.5)].map(|(body, height)| scene.face(body, 1, height));
        for axis in [0, 1] {
            // Places along the face stay those of the first axis.
            let first = scene.rows.len();
            scene.meet([&top, &cap], 1, |_| 0.0, true);
            for row in &mut scene.rows[first..] {
                row.entries.iter_mut().for_each(|entry| entry.0 -= 1 - axis);
            }
        }
        scene
    }

    /// Rows with weights other than one.
    pub(crate) fn weighted(&self) -> usize {
        self.rows.iter().filter(|row| row.entries.len() > 2).count()
    }

    fn simulation(&self, corrected: bool) -> Simulation<'static, f64> {
        let rows = self.rows.iter().fold(LinearRows::new(), |rows, Row { entries, gap, is_tie }| match is_tie {
            true => rows.equality(entries, *gap),
            false => rows.unilateral(entries, *gap),
        });
        let system = match &self.lumped {
            Some(mass) => LinearSystem::lumped(mass.clone(), self.stiffness.clone()),
            None => LinearSystem::new(self.mass.clone(), self.stiffness.clone()),
        };
        let system = system.unwrap();
        let builder = Simulation::builder(system, Newmark::trapezoidal(), H);
        let builder = builder.velocity(self.velocity.clone()).constraint(rows);
        match corrected {
            true => builder.corrector(PersistencyCorrection::new()),
            false => builder.uncorrected(),
        }
        .build()
        .unwrap()
    }

    /// Momentum along each axis, of all bodies.
    fn momentum(&self, v: &[f64]) -> Vec<f64> {
        let momenta = product(self.mass.as_ref(), v);
        (0..self.axes).map(|axis| momenta[axis..].iter().step_by(self.axes).sum()).collect()
    }
}

/// The bodies in their own codes, and the assemblies between them: one for displacements, one for rates.
struct Host {
    bodies: Vec<Body>,
    assemblies: [Assembly<f64>; 2],
    gaps: Vec<f64>,
    ties: Vec<bool>,
    raw: Vec<f64>,
    force: Vec<f64>,
    pressed: usize,
}

impl Host {
    fn new(scene: &Many) -> Self {
        let mut contact: Vec<usize> =
            scene.rows.iter().flat_map(|row| row.entries.iter().map(|entry| entry.0)).collect();
        contact.sort_unstable();
        contact.dedup();
        let bodies: Vec<Body> = scene
            .ranges
            .iter()
            .map(|range| {
                let own = contact.iter().filter(|dof| range.contains(dof)).map(|dof| dof - range.start).collect();
                Body::new([&scene.mass, &scene.stiffness], &scene.velocity, range.clone(), own)
            })
            .collect();
        let place = |&(dof, weight): &(usize, f64)| {
            let body = scene.ranges.iter().position(|range| range.contains(&dof)).unwrap();
            let own = dof - scene.ranges[body].start;
            (body, bodies[body].contact.iter().position(|&contact| contact == own).unwrap(), weight)
        };
        let coupling = |row: &Row| {
            let entries: Vec<_> = row.entries.iter().map(place).collect();
            if row.is_tie { Coupling::equality(&entries) } else { Coupling::unilateral(&entries) }
        };
        let rows: Vec<_> = scene.rows.iter().map(coupling).collect();
        let flexible: Vec<&[f64]> = bodies.iter().map(|body| &body.flexibility[..]).collect();
        let inertia: Vec<&[f64]> = bodies.iter().map(|body| &body.inertia[..]).collect();
        let assemblies = [flexible, inertia].map(|flexibilities| Assembly::new(&flexibilities, &rows).unwrap());
        Self {
            assemblies,
            bodies,
            gaps: scene.rows.iter().map(|row| row.gap).collect(),
            ties: scene.rows.iter().map(|row| row.is_tie).collect(),
            raw: vec![0.0; rows.len()],
            force: vec![0.0; rows.len()],
            pressed: 0,
        }
    }

    fn at_interface(&self, x: fn(&Body) -> &Vec<f64>) -> Vec<Vec<f64>> {
        self.bodies.iter().map(|body| body.at_interface(x(body))).collect()
    }

    /// Rates of one kind made to agree on the rows that are closed and pressed, or approach: returns these rows and
    /// what it takes.
    fn agree(
        &mut self,
        x: fn(&mut Body) -> &mut Vec<f64>,
        free: &[Vec<f64>],
        closed: &[bool],
    ) -> (Vec<bool>, Vec<f64>) {
        let free: Vec<&[f64]> = free.iter().map(Vec::as_slice).collect();
        let (rows, still) = (self.gaps.len(), vec![0.0; self.gaps.len()]);
        // The rates of the rows are their gaps where none is held.
        let rates = self.assemblies[1].hold(&free, &still, &vec![false; rows]).unwrap().gaps().to_vec();
        let engaged = |row: usize| self.ties[row] || closed[row] && (self.raw[row] > 0.0 || rates[row] < 0.0);
        let held: Vec<bool> = (0..rows).map(engaged).collect();
        let found = self.assemblies[1].hold(&free, &still, &held).unwrap();
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let jump = body.jump(found.forces(number));
            x(body).iter_mut().zip(jump).for_each(|(x, jump)| *x += jump);
        }
        (held, found.multipliers().to_vec())
    }

    fn step(&mut self, corrected: bool) {
        self.bodies.iter_mut().for_each(Body::advance);
        let free = self.at_interface(|body| &body.u);
        let free: Vec<&[f64]> = free.iter().map(Vec::as_slice).collect();
        let found = self.assemblies[0].solve(&free, &self.gaps).unwrap();
        for (number, body) in self.bodies.iter_mut().enumerate() {
            body.push(found.forces(number));
            let there = body.at_interface(&body.u);
            assert!(there.iter().zip(found.values(number)).all(|(x, y)| (x - y).abs() < 1e-15));
        }
        self.raw.copy_from_slice(found.multipliers());
        self.force.copy_from_slice(found.multipliers());
        self.pressed += self.raw.iter().zip(&self.ties).filter(|(raw, tie)| **raw > 0.0 && !**tie).count();
        if !corrected {
            return;
        }
        let closed = found.closed().to_vec();
        let v = self.at_interface(|body| &body.v);
        let (held, _) = self.agree(|body| &mut body.v, &v, &closed);
        let a = self.at_interface(|body| &body.a);
        let (_, forces) = self.agree(|body| &mut body.a, &a, &held);
        self.force.iter_mut().zip(forces).for_each(|(force, l)| *force += l);
    }

    fn go_to(&mut self, motion: [&[f64]; 4]) {
        body::go_to(&mut self.bodies, motion);
    }

    fn motion(&self) -> [Vec<f64>; 4] {
        let all = |x: fn(&Body) -> &Vec<f64>| self.bodies.iter().flat_map(|body| x(body).clone()).collect();
        [all(|body| &body.u), all(|body| &body.v), all(|body| &body.a), self.force.clone()]
    }
}

/// Runs the bodies in their own codes beside the monolithic simulation, until they have parted; returns how often a
/// row was pressed.
pub(crate) fn compare(name: &str, scene: &Many, corrected: bool, steps: usize) -> usize {
    let mut host = Host::new(scene);
    let mut run = scene.simulation(corrected);
    let mut comparison = Comparison::default();
    let before = scene.momentum(&scene.velocity);
    let size: f64 = product(scene.mass.as_ref(), &scene.velocity).iter().map(|p| p.abs()).sum();
    for _ in 0..steps {
        host.step(corrected);
        run.step().unwrap();
        let found = host.motion();
        comparison.add([&found[0], &found[1], &found[2], &found[3]], motion(&run));
        let after = scene.momentum(&found[1]);
        let is_kept = after.iter().zip(&before).all(|(after, before)| (after - before).abs() < 1e-11 * size);
        assert!(is_kept, "{name}: {after:?} {before:?}");
        if !corrected {
            // Contact opens and closes all the time, and each time differences of rounding grow threefold and more:
            // every step begins where the other did.
            host.go_to(motion(&run));
        }
    }
    let released = host.raw.iter().zip(&host.ties).all(|(force, tie)| *tie || *force == 0.0);
    assert!(released, "{name}, corrected {corrected}: still pressed");
    assert!(comparison.worst() < 1e-10, "{name}, corrected {corrected}: {comparison:?}");
    host.pressed
}
