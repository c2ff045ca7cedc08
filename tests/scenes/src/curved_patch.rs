//! Patch tests on curved surfaces: two concentric bodies that press on each other evenly, against Lamé's closed form.

use crate::second_order::{Family, SecondOrderStack};
use crate::solids::{Material, Solid};
use crate::stacks::Stack;
use crate::vectors::norm;
use contact_dynamics::contact::{
    Candidates, ContactConstraint, Contacts, Facet, GapRates, LinearRows, Mortar, NodeToFacet, Rates, Surface,
    Variation,
};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{GeneralizedAlpha, LinearSystem, Result, Simulation};
use std::collections::BTreeMap;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Radii: inside, where the bodies meet, outside.
const RADII: [f64; 3] = [1.0, 1.5, 2.0];

/// Strains: so small that nothing turns.
const STRAIN: f64 = 1e-6;

/// A quarter of two rings, or a quarter of a cube's side of two hollow balls, one around the other.
pub struct CurvedPatch<const D: usize> {
    nodes: Vec<[f64; D]>,
    stiffness: SparseColMat<usize, f64>,
    /// Of the inner body, and of the outer one.
    facets: [Vec<Facet>; 2],
}

/// Errors over what the closed form has.
#[derive(Clone, Copy, Debug)]
pub struct PatchErrors {
    /// Of the pressure on the nodes of the worse of both surfaces (L²).
    pub pressure: f64,
    /// Of the displacement of the worst node over the largest displacement.
    pub displacement: f64,
}

/// A cube onto a part of a hollow ball, a square onto a part of a ring.
fn bend<const D: usize>(x: [f64; D]) -> [f64; D] {
    let radius = RADII[0] + (RADII[1] - RADII[0]) * x[D - 1];
    let quarter = std::f64::consts::FRAC_PI_4;
    let direction: [f64; D] = match D {
        2 => {
            let (s, c) = (2.0 * quarter * (1.0 - x[0])).sin_cos();
            std::array::from_fn(|axis| [c, s][axis])
        }
        _ => std::array::from_fn(|axis| if axis + 1 == D { 1.0 } else { (quarter * x[axis]).tan() }),
    };
    let length = norm(direction);
    direction.map(|x| radius * x / length)
}

impl CurvedPatch<2> {
    /// With so many elements around each body, half as many across.
    pub fn rings(around: [usize; 2], family: Option<Family>) -> Self {
        let bodies = around.map(|cells| Solid::rectangle([1.0; 2], [cells, cells.div_ceil(2)], MATERIAL));
        Self::new(bodies, family)
    }
}

impl CurvedPatch<3> {
    /// With so many elements along each side, half as many across.
    pub fn balls(along: [usize; 2], family: Option<Family>) -> Self {
        let bodies = along.map(|cells| Solid::block([1.0; 3], [cells, cells, cells.div_ceil(2)], MATERIAL));
        Self::new(bodies, family)
    }
}

impl<const D: usize> CurvedPatch<D> {
    fn new(bodies: [Solid<D>; 2], family: Option<Family>) -> Self {
        match family {
            None => {
                let stack = Stack::new(bodies, 0.0, bend);
                let facets = stack.surfaces();
                Self { stiffness: stack.solid.stiffness(), nodes: stack.solid.nodes, facets }
            }
            Some(family) => {
                let stack = SecondOrderStack::new(bodies, family, 0.0, bend);
                let (stiffness, _) = stack.solid.matrices();
                Self { stiffness, nodes: stack.solid.nodes, facets: stack.facets }
            }
        }
    }

    fn dofs(&self) -> Vec<[usize; D]> {
        (0..self.nodes.len()).map(|node| std::array::from_fn(|axis| D * node + axis)).collect()
    }

    fn surfaces(&self, outer: bool) -> [Vec<Facet>; 2] {
        let [inside, outside] = self.facets.clone();
        if outer { [outside, inside] } else { [inside, outside] }
    }

    /// Weighted gaps, the outer body being the slave, or the inner one.
    pub fn mortar(&self, outer: bool) -> Result<Mortar<f64>> {
        let [slave, master] = self.surfaces(outer);
        Mortar::new(&self.nodes, &self.dofs(), slave, master)
    }

    /// The nodes of the outer body on the facets of the inner one, and the other way round if there are two passes.
    pub fn nodes_on_facets(&self, passes: usize) -> Result<NodeToFacet<f64>> {
        let [outer, inner] = self.surfaces(true);
        if passes > 1 {
            return NodeToFacet::new(&self.nodes, &self.dofs(), outer, inner);
        }
        let slaves = Surface::new(&self.nodes, outer)?.nodes().to_vec();
        NodeToFacet::one_pass(&self.nodes, &self.dofs(), &slaves, inner)
    }

    /// The pressure between the bodies: −σ at the radius R of u = (−ε r + ε R^D r^(1 − D)/2) x/r.
    fn pressure() -> f64 {
        let ([lambda, mu], dimension) = (MATERIAL.lame(), D as f64);
        STRAIN * (dimension * lambda + 2.0 * mu + (dimension - 1.0) * mu)
    }

    fn displacement(x: [f64; D]) -> [f64; D] {
        let radius = norm(x);
        let share = (RADII[1] / radius).powi(if D == 2 { 2 } else { 3 });
        x.map(|x| STRAIN * (0.5 * share - 1.0) * x)
    }

    /// Both bodies with the closed form's displacements inside and outside, and sliding along the other sides.
    fn system(&self) -> Result<(LinearSystem<'static, f64>, LinearRows<'static, f64>)> {
        let mut system = LinearSystem::lumped(vec![0.0; D * self.nodes.len()], self.stiffness.clone())?;
        let mut rows = LinearRows::new();
        for (node, &x) in self.nodes.iter().enumerate() {
            let is_at = |radius: f64| (norm(x) - radius).abs() < 1e-9;
            if is_at(RADII[0]) || is_at(RADII[2]) {
                for (axis, u) in Self::displacement(x).into_iter().enumerate() {
                    system = system.drive(D * node + axis, move |t| [u * t, u, 0.0])?;
                }
                continue;
            }
            for axis in (0..D).filter(|&axis| x[axis].abs() < 1e-9) {
                system = system.fix(D * node + axis)?;
            }
            // (Of a cube's side two sides are slanted.)
            for axis in (0..D - 1).filter(|&axis| D == 3 && (x[axis] - x[2]).abs() < 1e-9) {
                rows = rows.equality(&[(D * node + axis, 1.0), (D * node + 2, -1.0)], 0.0);
            }
        }
        Ok((system, rows))
    }

    /// Presses the bodies on each other. What facets of different meshes are off each other at first is no gap.
    ///
    /// # Errors
    ///
    /// Those of the run.
    pub fn pressed(&self, contact: impl ContactConstraint<f64> + 'static) -> Result<PatchErrors> {
        let (system, sides) = self.system()?;
        let builder = Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.0)?, 0.5);
        let builder = builder.constraint(Fitted { contact, names: Vec::new(), start: None });
        let mut run = if D == 3 { builder.constraint(sides) } else { builder }.build()?;
        run.run_until(1.0, &mut ())?;
        let mut forces = vec![[0.0; D]; self.nodes.len()];
        for contact in run.contact_forces().filter(|contact| contact.id.constraint == 0) {
            for (dof, force) in contact.forces() {
                forces[dof / D][dof % D] += force;
            }
        }
        let mut pressure = 0.0_f64;
        for facets in &self.facets {
            let surface = Surface::new(&self.nodes, facets.clone())?;
            let (areas, pressures) = (surface.areas(&self.nodes)?, surface.pressures(&self.nodes, &forces)?);
            let square = |pressure: f64| (pressure / Self::pressure() - 1.0).powi(2);
            let sum: f64 = areas.iter().zip(pressures).map(|(area, pressure)| area * square(pressure)).sum();
            pressure = pressure.max((sum / areas.iter().sum::<f64>()).sqrt());
        }
        let exact: Vec<f64> = self.nodes.iter().flat_map(|&x| Self::displacement(x)).collect();
        let largest = exact.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        let miss = run.state().displacement().iter().zip(&exact).map(|(u, exact)| (u - exact).abs());
        Ok(PatchErrors { pressure, displacement: miss.fold(0.0, f64::max) / largest })
    }
}

/// A contact whose gaps are less what they are at the start.
struct Fitted<C> {
    contact: C,
    names: Vec<(usize, usize)>,
    start: Option<BTreeMap<(usize, usize), f64>>,
}

impl<C: ContactConstraint<f64>> ContactConstraint<f64> for Fitted<C> {
    fn dofs(&self) -> &[usize] {
        self.contact.dofs()
    }

    fn contacts(&self, contacts: &mut Contacts<f64>) {
        self.contact.contacts(contacts);
    }

    fn search(&mut self, t: f64, u: &[f64], v: &[f64], ahead: f64) -> Result<Candidates> {
        let candidates = self.contact.search(t, u, v, ahead)?;
        let contacts = Contacts::of(&self.contact);
        self.names = (0..contacts.len()).map(|row| contacts.name(row)).collect();
        if self.start.is_none() {
            let mut gaps = vec![0.0; contacts.len()];
            self.contact.gaps(t, u, &mut gaps)?;
            self.start = Some(self.names.iter().copied().zip(gaps).collect());
        }
        Ok(candidates)
    }

    fn follow(&mut self, t: f64, u: &[f64]) -> Result<Candidates> {
        self.contact.follow(t, u)
    }

    fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        self.contact.gaps(t, u, gaps)?;
        let start = |name: &(usize, usize)| self.start.as_ref().and_then(|start| start.get(name)).copied();
        for (gap, name) in gaps.iter_mut().zip(&self.names) {
            *gap -= start(name).unwrap_or(0.0);
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[f64], v: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
        self.contact.rates(t, u, v, rates)
    }

    fn variation(&self) -> Variation {
        self.contact.variation()
    }
}
