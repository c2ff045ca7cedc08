//! Two bodies upon each other whose meshes need not match, and the patch test on them.

use crate::solids::{Material, Solid};
use contact_dynamics::contact::{
    BodyContact, ContactConstraint, EdgeToEdge, Facet, Mortar, NodeToFacet, SurfaceSettings, Tie,
};
use contact_dynamics::{LinearSystem, Newmark, Result, Simulation, System};

/// Two bodies, one upon the other, and their facets that face each other: those of the lower one, and of the upper one.
pub struct Stack<const D: usize> {
    pub solid: Solid<D>,
    /// Number of nodes of the lower body.
    pub split: usize,
    pub facets: [Vec<Vec<usize>>; 2],
}

impl<const D: usize> Stack<D> {
    /// Bodies of height 1, the upper one from `1 + gap` on; then all is mapped.
    pub fn new([below, above]: [Solid<D>; 2], gap: f64, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        let split = below.nodes.len();
        let lift = std::array::from_fn(|axis| if axis + 1 == D { 1.0 + gap } else { 0.0 });
        let solid = below.with(above.moved(lift));
        let at = |height: f64, lower: bool| {
            let inside = |&n: &usize| (n < split) == lower && (solid.nodes[n][D - 1] - height).abs() < 1e-9;
            solid.boundary().into_iter().filter(|facet| facet.iter().all(inside)).collect()
        };
        let facets = [at(1.0, true), at(1.0 + gap, false)];
        Self { solid: solid.mapped(map), split, facets }
    }

    /// Two bodies as they are, with their whole surfaces.
    pub fn of_whole_surfaces([below, above]: [Solid<D>; 2]) -> Self {
        let split = below.nodes.len();
        let solid = below.with(above);
        let is_lower = |facet: &Vec<usize>| facet.iter().all(|&node| node < split);
        let facets = solid.boundary().into_iter().partition(is_lower).into();
        Self { solid, split, facets }
    }

    /// Velocities with which the upper body flies.
    pub fn velocity_of_upper(&self, velocity: [f64; D]) -> Vec<f64> {
        let of = |dof: usize| if dof >= D * self.split { velocity[dof % D] } else { 0.0 };
        (0..self.solid.dofs()).map(of).collect()
    }

    /// The facets of the lower body and of the upper one, as segments or quadrilaterals.
    pub fn surfaces(&self) -> [Vec<Facet>; 2] {
        self.facets.each_ref().map(|facets| facets.iter().map(|facet| Self::facet(facet)).collect())
    }

    /// A segment or a quadrilateral by its nodes.
    pub fn facet(nodes: &[usize]) -> Facet {
        match *nodes {
            [a, b] => Facet::from([a, b]),
            [a, b, c, d] => Facet::from([a, b, c, d]),
            _ => panic!("neither a segment nor a quadrilateral: {nodes:?}"),
        }
    }

    /// Weighted gaps, the upper body being the slave, or the lower one.
    pub fn mortar(&self, upper: bool) -> Result<Mortar<f64>> {
        let [lower, above] = self.surfaces();
        let (slave, master) = if upper { (above, lower) } else { (lower, above) };
        Mortar::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// Weighted gaps as among [`bodies`](Self::bodies), of surfaces that may have corners.
    pub fn weighted(&self, upper: bool, reach: f64) -> Result<Box<dyn ContactConstraint<f64>>> {
        Ok(self.bodies(upper)?.with(SurfaceSettings::new().reach(reach))?.constraints()?.remove(0))
    }

    /// What keeps the bodies apart by faces, corners and edges, the upper one being the slave, or the lower one.
    pub fn bodies(&self, upper: bool) -> Result<BodyContact<f64, D>> {
        let [lower, above] = self.surfaces();
        let (slave, master) = if upper { (above, lower) } else { (lower, above) };
        BodyContact::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// The bodies tied to each other, the upper one being the slave, or the lower one.
    pub fn tie(&self, upper: bool) -> Result<Tie<f64>> {
        let [lower, above] = self.surfaces();
        let (slave, master) = if upper { (above, lower) } else { (lower, above) };
        Tie::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// The nodes of the upper body on the facets of the lower one, and the other way round if there are two passes.
    pub fn nodes_on_facets(&self, passes: usize) -> Result<NodeToFacet<f64>> {
        let [lower, above] = self.surfaces();
        let Solid { nodes, .. } = &self.solid;
        if passes > 1 {
            return NodeToFacet::new(nodes, &self.solid.node_dofs(), above, lower);
        }
        let mut slaves: Vec<usize> = self.facets[1].iter().flatten().copied().collect();
        slaves.sort_unstable();
        slaves.dedup();
        NodeToFacet::one_pass(nodes, &self.solid.node_dofs(), &slaves, lower)
    }

    /// ∫ N n dA of the nodes of a facet, n outward.
    fn facet_forces(&self, facet: &[usize]) -> Vec<[f64; 3]> {
        let point = |k: usize| -> [f64; 3] {
            std::array::from_fn(|i| self.solid.nodes[facet[k]].get(i).copied().unwrap_or(0.0))
        };
        let minus = |x: [f64; 3], y: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| x[i] - y[i]) };
        if D == 2 {
            let [x, y, _] = minus(point(1), point(0));
            return vec![[0.5 * y, -0.5 * x, 0.0]; 2];
        }
        // (Of a bilinear quadrilateral products of shape functions and areas are of the third degree.)
        let gauss = 1.0 / 3.0_f64.sqrt();
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let mut forces = vec![[0.0; 3]; 4];
        for [xi, eta] in corners.map(|corner| corner.map(|x| gauss * x)) {
            let between = |share: f64, from: [[f64; 3]; 2], to: [[f64; 3]; 2]| -> [f64; 3] {
                let [first, second] = [minus(from[1], from[0]), minus(to[1], to[0])];
                std::array::from_fn(|i| 0.25 * ((1.0 - share) * first[i] + (1.0 + share) * second[i]))
            };
            let along = between(eta, [point(0), point(1)], [point(3), point(2)]);
            let across = between(xi, [point(0), point(3)], [point(1), point(2)]);
            for (force, [a, b]) in forces.iter_mut().zip(corners) {
                let share = 0.25 * (1.0 + a * xi) * (1.0 + b * eta);
                for (i, force) in force.iter_mut().enumerate() {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    *force += share * (along[j] * across[k] - along[k] * across[j]);
                }
            }
        }
        forces
    }

    /// Both bodies under the same pressure from all sides, held on the planes through the origin: largest deviation of
    /// the displacements from u = −ε x, relative to the largest of these.
    pub fn patch(&self, contact: impl ContactConstraint<f64> + 'static) -> Result<f64> {
        self.patch_with(vec![Box::new(contact)])
    }

    /// The same with any constraints.
    pub fn patch_with(&self, constraints: Vec<Box<dyn ContactConstraint<f64>>>) -> Result<f64> {
        let Self { solid, .. } = self;
        let mut areas = Vec::new();
        for facet in self.facets.iter().flatten() {
            for (&node, force) in facet.iter().zip(self.facet_forces(facet)) {
                areas.extend(force.into_iter().enumerate().take(D).map(|(axis, force)| (D * node + axis, force)));
            }
        }
        under_pressure(&solid.nodes, solid.material, || Ok(solid.system()), &areas, constraints)
    }
}

/// The patch test on two bodies of any elements, by parts of ∫ N n dA of dofs over the sides that face each other.
pub(crate) fn under_pressure<const D: usize>(
    nodes: &[[f64; D]],
    material: Material,
    system: impl Fn() -> Result<LinearSystem<'static, f64>>,
    areas: &[(usize, f64)],
    constraints: Vec<Box<dyn ContactConstraint<f64>>>,
) -> Result<f64> {
    let strain = 0.01;
    let [first, second] = material.lame();
    let pressure = strain * if D == 2 { 2.0 * (first + second) } else { 3.0 * first + 2.0 * second };
    let exact: Vec<f64> = nodes.iter().flatten().map(|x| -strain * x).collect();
    // (A wave crosses a body in a tenth of this unit of time.)
    let time = material.wave_speed() / 10.0;
    // What the stress needs at all sides, less what contact gives.
    let mut load = vec![0.0; exact.len()];
    system()?.force(0.0, &exact, &vec![0.0; exact.len()], &mut load)?;
    load.iter_mut().for_each(|load| *load = -*load);
    areas.iter().for_each(|(dof, area)| load[*dof] += pressure * area);
    let mut system = system()?.load(move |t, f| {
        f.iter_mut().zip(&load).for_each(|(f, load)| *f = load * (time * t / 10.0).min(1.0));
    });
    for (node, place) in nodes.iter().enumerate() {
        for axis in (0..D).filter(|&axis| place[axis].abs() < 1e-9) {
            system = system.fix(D * node + axis)?;
        }
    }
    // A strongly damped scheme: the static solution after a while. (Of motions that a step does not resolve it leaves a
    // third. The slowest ones have a period of 0.8.)
    let mut run =
        Simulation::builder(system, Newmark::new(0.5625, 1.0)?, 0.3 / time).constraints(constraints).build()?;
    run.run_until(40.0 / time, &mut ())?;
    let scale = exact.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let deviation = |(u, exact): (&f64, &f64)| (u - exact).abs();
    Ok(run.state().displacement().iter().zip(&exact).map(deviation).fold(0.0, f64::max) / scale)
}

impl Stack<2> {
    /// Two rings, one around the other, whose facets on the circle between them do not fit.
    pub fn rings(material: Material) -> Self {
        let inner = Solid::ring([0.5, 1.0], [1, 12], material);
        let split = inner.nodes.len();
        let solid = inner.with(Solid::ring([1.0, 1.5], [1, 17], material));
        let facets = [true, false].map(|inside| {
            let radius = |n: usize| solid.nodes[n][0].hypot(solid.nodes[n][1]);
            let on_circle = |&n: &usize| (n < split) == inside && (radius(n) - 1.0).abs() < 1e-9;
            solid.boundary().into_iter().filter(|facet| facet.iter().all(on_circle)).collect()
        });
        Self { solid, split, facets }
    }
}

impl Stack<3> {
    /// The edges of the upper body on those of the lower one.
    pub fn edges(&self) -> Result<EdgeToEdge<f64>> {
        let [lower, above] = self.surfaces();
        EdgeToEdge::new(&self.solid.nodes, &self.solid.node_dofs(), above, lower)
    }
}
