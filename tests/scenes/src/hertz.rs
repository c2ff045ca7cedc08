//! Two elastic cylinders that press on each other, meshed around the contact alone: the displacements of Hertz' theory
//! are given on all other sides, so that no error is left of bodies that end.

use crate::solids::{Material, Solid};
use crate::stacks::Stack;
use contact_dynamics::contact::{ContactConstraint, Surface};
use contact_dynamics::faer::c64;
use contact_dynamics::{Error, GeneralizedAlpha, LinearSystem, Result, Simulation};

/// Two bodies of one material in plane strain, the lower one flat, the upper one round. Nothing has mass, so that each
/// step is a static balance.
pub struct Cylinders {
    pub stack: Stack<2>,
    /// Half the width of both meshes, and their depth.
    size: f64,
    radius: f64,
}

/// Errors over what Hertz has.
#[derive(Clone, Copy, Debug)]
pub struct HertzErrors {
    /// Of the pressure on the nodes of the lower surface and of the upper one, in the L² norm over |x| < 1.2 a.
    pub pressure: [f64; 2],
    /// Of the largest pressure on either surface.
    pub peak: [f64; 2],
    /// Of the whole force.
    pub force: f64,
}

/// Half the width of the contact.
const CONTACT: f64 = 1.0;

/// How far the surfaces reach that meet each other, over that.
const NEAR: f64 = 2.0;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

impl Cylinders {
    /// Bodies of so many elements over half the contact's width, below and above. `size` is the depth of the meshes and
    /// `radius` that of the upper body, both over half the contact's width.
    pub fn new(elements: [f64; 2], size: f64, radius: f64) -> Self {
        let body = |elements: f64| {
            let deep = (elements * size).round() as usize;
            Solid::rectangle([1.0; 2], [2 * deep, deep], MATERIAL)
        };
        let size = size * CONTACT;
        let mut stack = Stack::new(elements.map(body), 0.0, |[x, y]| [size * (2.0 * x - 1.0), size * (y - 1.0)]);
        for [x, y] in &mut stack.solid.nodes[stack.split..] {
            *y += *x * *x / (2.0 * radius);
        }
        // Nodes whose displacements are given cannot be pressed.
        let nodes = &stack.solid.nodes;
        let is_near = |facet: &Vec<usize>| facet.iter().all(|&node| nodes[node][0].abs() < NEAR * CONTACT);
        stack.facets.iter_mut().for_each(|facets| facets.retain(is_near));
        Self { stack, size, radius }
    }

    /// The largest pressure by Hertz: E* a/(2 R), where two bodies of one material have 1/E* = 2 (1 − ν²)/E.
    pub fn peak(&self) -> f64 {
        0.25 * MATERIAL.plane_modulus() * CONTACT / self.radius
    }

    /// Hertz' pressure at a distance from the middle.
    pub fn pressure(&self, x: f64) -> f64 {
        self.peak() * (1.0 - (x / CONTACT).powi(2)).max(0.0).sqrt()
    }

    /// The displacement of the lower body at y ≤ 0, none in the origin, by Westergaard's potential of pressures on a
    /// half-plane: Z with Re Z = −p at y = 0, and its integral Y; 2 μ u is (1 − 2 ν) Re Y − y Im Z along the surface
    /// and 2 (1 − ν) Im Y − y Re Z across.
    pub fn displacement(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        // (On the surface itself the root has two values.)
        let y = y.min(-1e-12 * CONTACT);
        let (z, i) = (c64::new(x, y) / CONTACT, c64::i());
        let root = (1.0 - z * z).sqrt();
        let potential = -self.peak() * (root - i * z);
        let integral = -0.5 * self.peak() * CONTACT * (z * root + z.asin() - i * z * z);
        let [_, shear] = MATERIAL.lame();
        let nu = MATERIAL.poisson;
        let along = (1.0 - 2.0 * nu) * integral.re - y * potential.im;
        let across = 2.0 * (1.0 - nu) * integral.im - y * potential.re;
        [along, across].map(|u| u / (2.0 * shear))
    }

    /// The bodies with Hertz' displacements on all sides but those that face each other, given in a unit of time.
    fn system(&self) -> Result<LinearSystem<'static, f64>> {
        let Stack { solid, split, .. } = &self.stack;
        let mut system = LinearSystem::lumped(vec![0.0; solid.dofs()], solid.stiffness())?;
        for (node, &[x, y]) in solid.nodes.iter().enumerate() {
            let side = if node < *split { 1.0 } else { -1.0 };
            // The upper body is the lower one in a mirror, before it was made round.
            let y = if node < *split { y } else { x * x / (2.0 * self.radius) - y };
            let is_far = x.abs() > self.size * (1.0 - 1e-9) || -y > self.size * (1.0 - 1e-9);
            if is_far {
                let [along, across] = self.displacement([x, y]);
                for (axis, u) in [along, side * across].into_iter().enumerate() {
                    system = system.drive(2 * node + axis, move |t| [u * t, u, 0.0])?;
                }
            }
        }
        Ok(system)
    }

    /// Presses the bodies on each other.
    ///
    /// # Errors
    ///
    /// Those of the run, and [`Error::Incompatible`] if the two surfaces do not get the same force.
    pub fn pressed(&self, contact: impl ContactConstraint<f64> + 'static) -> Result<HertzErrors> {
        let Stack { solid, .. } = &self.stack;
        let mut run = Simulation::builder(self.system()?, GeneralizedAlpha::chung_hulbert(0.0)?, 0.25)
            .constraint(contact)
            .build()?;
        run.run_until(1.0, &mut ())?;
        let mut forces = vec![[0.0; 2]; solid.nodes.len()];
        for (dof, force) in run.contact_forces().flat_map(|contact| contact.forces().collect::<Vec<_>>()) {
            forces[dof / 2][dof % 2] += force;
        }
        let [(lower, pressed), (upper, lifted)] = [0, 1].map(|body| self.errors(body, &forces));
        if (pressed + lifted).abs() > 1e-9 * lifted {
            return Err(Error::Incompatible { part: "the forces on the two surfaces".into(), reason: "they differ" });
        }
        let exact = 0.5 * std::f64::consts::PI * CONTACT * self.peak();
        let [(lower, peak_below), (upper, peak_above)] = [lower?, upper?];
        Ok(HertzErrors { pressure: [lower, upper], peak: [peak_below, peak_above], force: lifted / exact - 1.0 })
    }

    /// Errors of pressure and peak on one surface, and the force on it.
    fn errors(&self, body: usize, forces: &[[f64; 2]]) -> (Result<(f64, f64)>, f64) {
        let nodes = &self.stack.solid.nodes;
        let errors = || {
            let surface = Surface::new(nodes, self.stack.surfaces()[body].clone())?;
            let (areas, pressures) = (surface.areas(nodes)?, surface.pressures(nodes, forces)?);
            let (mut square, mut whole, mut largest) = (0.0, 0.0, 0.0_f64);
            for ((&node, area), pressure) in surface.nodes().iter().zip(areas).zip(pressures) {
                let x = nodes[node][0];
                if x.abs() < 1.2 * CONTACT {
                    let exact = self.pressure(x);
                    square += area * (pressure - exact).powi(2);
                    whole += area * exact * exact;
                    largest = largest.max(pressure);
                }
            }
            Ok(((square / whole).sqrt(), largest / self.peak() - 1.0))
        };
        let split = self.stack.split;
        let of_body = |node: usize| (node < split) == (body == 0);
        (errors(), (0..nodes.len()).filter(|&node| of_body(node)).map(|node| forces[node][1]).sum())
    }
}
