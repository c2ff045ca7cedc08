//! Impacts of bodies whose reduction is asked for: a ball and a ring on a plane, two blocks face to face.

use crate::impacts::{Course, Impact, Part};
use crate::masses::{Takers, Treatment};
use crate::reference::PowerLawImpact;
use crate::solids::{Material, Solid};
use contact_dynamics::{ContactLaw, Result};
use std::f64::consts::PI;

/// A quarter of an elastic ball of unit radius that falls on a plane; the other quarters are mirrored.
#[derive(Clone, Debug)]
pub struct Ball {
    pub impact: Impact,
    /// The whole ball by Hertz.
    pub hertz: PowerLawImpact,
    /// Nodes of the plane's touch begin so far above it.
    gap: f64,
}

const BALL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

impl Ball {
    /// At the speed for which Hertz' contact radius is `contact`, with so many elements across it.
    ///
    /// # Errors
    ///
    /// Those of the mesh's motions.
    pub fn new(contact: f64, across: usize, cells: [usize; 3]) -> Result<Self> {
        let solid = Solid::quarter_ball(1.0, cells, contact / across as f64, BALL);
        let stiffness = 4.0 / 3.0 * BALL.plane_modulus();
        let mass = BALL.density * 4.0 / 3.0 * PI;
        debug_assert!(matches!(ContactLaw::hertz(BALL.plane_modulus(), 1.0),
            ContactLaw::PowerLaw { stiffness: k, .. } if (k / stiffness - 1.0).abs() < 1e-12));
        // The depth at rest is a²/R.
        let velocity = (contact.powi(5) * stiffness / (1.25 * mass)).sqrt();
        let hertz = PowerLawImpact { mass, stiffness, exponent: 1.5, velocity };
        let planes = |(node, place): (usize, &[f64; 3])| {
            (0..2).filter(|&axis| place[axis].abs() < 1e-12).map(|axis| 3 * node + axis).collect::<Vec<_>>()
        };
        let fixed = solid.nodes.iter().enumerate().flat_map(planes).collect();
        let touching: Vec<usize> =
            solid.surface_nodes().into_iter().filter(|&n| touches(solid.nodes[n], contact)).collect();
        let gap = 0.03 * velocity * hertz.duration();
        let row = |(k, &node): (usize, &usize)| (vec![(0, k, 1.0)], solid.nodes[node][2] + gap);
        let rows = touching.iter().enumerate().map(row).collect();
        let mut part = Part::new(&solid, &touching, fixed, -velocity)?;
        // (On elements as uneven as these the tapered blend is singular.)
        part.treatment = Treatment::Redistributed(Takers::Neighbors);
        let until = 1.5 * hertz.duration();
        Ok(Self { impact: Impact { parts: vec![part], rows, until }, hertz, gap })
    }

    /// Hertz' course for a quarter of the ball, in steps of h.
    pub fn exact(&self, h: f64) -> Course {
        let PowerLawImpact { mass, stiffness, exponent, velocity } = self.hertz;
        let start = self.gap / velocity;
        let (mut depth, mut rate, mut t) = (0.0_f64, velocity, start);
        let mut forces = vec![(start, 0.0)];
        let slope = |[depth, rate]: [f64; 2]| [rate, -stiffness / mass * depth.max(0.0).powf(exponent)];
        let mut impulse = 0.0;
        // Runge and Kutta's steps, many more than those of the run.
        let fine = 0.1 * h;
        while depth >= 0.0 {
            let at = |k: [f64; 2], share: f64| [depth + share * fine * k[0], rate + share * fine * k[1]];
            let a = slope([depth, rate]);
            let b = slope(at(a, 0.5));
            let c = slope(at(b, 0.5));
            let d = slope(at(c, 1.0));
            depth += fine / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]);
            rate += fine / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]);
            t += fine;
            let force = 0.25 * stiffness * depth.max(0.0).powf(exponent);
            impulse += fine * force;
            forces.push((t, force));
        }
        let (steps, last) = (forces.len(), t);
        Course { forces, impulse, velocities: vec![velocity], energy: 1.0, h: fine, steps, last, ..Course::default() }
    }
}

/// Nodes of the round side near the pole.
fn touches([x, y, z]: [f64; 3], contact: f64) -> bool {
    let on_sphere = ((x * x + y * y + (z - 1.0).powi(2)).sqrt() - 1.0).abs() < 1e-9;
    on_sphere && z < 1.0 && x.hypot(y) < 1.4 * contact
}

/// Blocks of the two that collide: sizes, materials, speeds of the lower and of the upper one.
const LOWER: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };
const UPPER: Material = Material { young: 60.0, poisson: 0.2, density: 2.0 };
const WIDTHS: [f64; 2] = [2.0, 1.0];
const HEIGHTS: [f64; 2] = [1.0, 0.75];

/// The pressure of plane waves when they meet at unit speed, over their common width, before waves of the edges.
pub fn plane_force() -> f64 {
    let impedance = |of: Material| of.density * of.wave_speed();
    (impedance(LOWER).recip() + impedance(UPPER).recip()).recip() * WIDTHS[1]
}

/// The speed of the fastest waves in either block.
pub fn fastest_wave() -> f64 {
    LOWER.wave_speed().max(UPPER.wave_speed())
}

/// A block in plane strain strikes a wider one of another material, flat, node on node; `cells` on a unit of length, a
/// multiple of four. Both are free.
///
/// # Errors
///
/// Those of the meshes' motions.
pub fn two_blocks(cells: usize) -> Result<Impact> {
    let gap = 0.02;
    let block = |k: usize, material: Material| {
        let size = [WIDTHS[k], HEIGHTS[k]];
        let number = size.map(|length| (length * cells as f64).round() as usize);
        Solid::rectangle(size, number, material)
    };
    let lower = block(0, LOWER).moved([-0.5 * WIDTHS[0], -HEIGHTS[0]]);
    let upper = block(1, UPPER).moved([-0.5 * WIDTHS[1], 0.0]);
    let face = |solid: &Solid<2>| -> Vec<usize> {
        let inside = |&n: &usize| solid.nodes[n][1].abs() < 1e-9 && solid.nodes[n][0].abs() < 0.5 * WIDTHS[1] + 1e-9;
        (0..solid.nodes.len()).filter(inside).collect()
    };
    let faces = [face(&lower), face(&upper)];
    debug_assert_eq!(faces[0].len(), faces[1].len());
    let rows = (0..faces[1].len()).map(|k| (vec![(0, k, -1.0), (1, k, 1.0)], gap)).collect();
    let parts = vec![Part::new(&lower, &faces[0], Vec::new(), 0.0)?, Part::new(&upper, &faces[1], Vec::new(), -1.0)?];
    Ok(Impact { parts, rows, until: 0.5 })
}

const RING: Material = Material { young: 0.91, poisson: 0.3, density: 1.0 };
/// Its thickness over its radius.
const THICKNESS: f64 = 0.05;

/// The frequency of bending with n waves around a thin ring of unit radius (E/(1 − ν²) = ρ = 1).
pub fn ring_frequency(n: usize) -> f64 {
    let n = n as f64;
    THICKNESS / 12.0_f64.sqrt() * n * (n * n - 1.0) / (n * n + 1.0).sqrt()
}

/// A ring in plane strain, of so many elements across and around, that strikes a plane at a speed (waves have 1). Nodes
/// within so large an angle of the lowest may touch.
///
/// # Errors
///
/// Those of the mesh's motions.
pub fn ring(cells: [usize; 2], speed: f64, angle: f64) -> Result<Impact> {
    let radii = [1.0 - 0.5 * THICKNESS, 1.0 + 0.5 * THICKNESS];
    let solid = Solid::ring(radii, cells, RING).moved([0.0, radii[1]]);
    let touches = |&n: &usize| {
        let [x, y] = solid.nodes[n];
        (x.hypot(y - radii[1]) - radii[1]).abs() < 1e-9 && x.abs().atan2(radii[1] - y) < angle + 1e-9
    };
    let touching: Vec<usize> = (0..solid.nodes.len()).filter(touches).collect();
    let gap = 2.0 * speed;
    let row = |(k, &node): (usize, &usize)| (vec![(0, k, 1.0)], solid.nodes[node][1] + gap);
    let rows = touching.iter().enumerate().map(row).collect();
    let part = Part::new(&solid, &touching, Vec::new(), -speed)?;
    Ok(Impact { parts: vec![part], rows, until: 4.0 * PI / ring_frequency(2) })
}
