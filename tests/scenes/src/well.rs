//! A rod in a curved well: beam elements along the axis of a well in a vertical plane, with a low and a high side at
//! each node; and torque and drag of the soft string to compare with.
//!
//! The rod is linear about the axis of the well, in which it lies without stress: displacements are those of a
//! clearance, and the force N = T κ with which tension pulls it across a bend comes from the angles between the
//! elements. What it takes to bend a straight rod into the well, and the stiffness of a taut string, are left out, as
//! the soft string does.

use crate::sparse::{Entry, matrix};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Corrector, LinearRows, LinearSystem, Result, Simulation, SimulationBuilder, TimeIntegrator};
use std::ops::Range;

/// A well: vertical, then an arc of a circle, then straight on with the inclination reached.
#[derive(Clone, Copy, Debug)]
pub struct Well {
    /// Measured depth at which the arc begins.
    pub kick_off: f64,
    /// Of the arc.
    pub radius: f64,
    /// At the top, and at the end of the arc (radians from the vertical).
    pub inclination: [f64; 2],
}

impl Well {
    /// Measured depth at which the arc ends.
    pub fn end_of_arc(&self) -> f64 {
        self.kick_off + self.radius * (self.inclination[1] - self.inclination[0])
    }

    /// Inclination from the vertical at a measured depth.
    pub fn inclination_at(&self, depth: f64) -> f64 {
        let turned = (depth - self.kick_off).max(0.0) / self.radius;
        (self.inclination[0] + turned).min(self.inclination[1])
    }

    /// Curvature at a measured depth.
    pub fn curvature_at(&self, depth: f64) -> f64 {
        match depth > self.kick_off && depth < self.end_of_arc() {
            true => self.radius.recip(),
            false => 0.0,
        }
    }

    /// Where the axis is at a measured depth: along the way, and down.
    pub fn position(&self, depth: f64) -> [f64; 2] {
        let [start, end] = self.inclination;
        let straight = |length: f64, angle: f64| [length * angle.sin(), length * angle.cos()];
        let angle = self.inclination_at(depth);
        let above = straight(depth.min(self.kick_off), start);
        let arc = [start.cos() - angle.cos(), angle.sin() - start.sin()].map(|x| self.radius * x);
        let below = straight((depth - self.end_of_arc()).max(0.0), end);
        [0, 1].map(|k| above[k] + arc[k] + below[k])
    }
}

/// A rod in a well, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Rod {
    pub well: Well,
    pub length: f64,
    pub elements: usize,
    /// EA.
    pub stretching: f64,
    /// EI.
    pub bending: f64,
    /// Mass over length.
    pub density: f64,
    /// Weight over length, buoyancy taken off.
    pub weight: f64,
    /// Coulomb's coefficient.
    pub friction: f64,
    /// From the low to the high side.
    pub play: f64,
    /// The pull at the lower end.
    pub tail: f64,
}

/// Dofs of a node: along the way, down, rotation.
const DOFS: usize = 3;

impl Rod {
    /// Drill pipe of 5 inches in mud: 2000 m in a well that builds up to 60° from 500 m on, with 3° on 30 m.
    pub fn drill_pipe(elements: usize) -> Self {
        let inclination = [0.0, std::f64::consts::FRAC_PI_3];
        Self {
            well: Well { kick_off: 500.0, radius: 573.0, inclination },
            length: 2000.0,
            elements,
            stretching: 7.1e8,
            bending: 1.25e6,
            density: 29.0,
            weight: 245.0,
            friction: 0.25,
            play: 0.05,
            tail: 0.0,
        }
    }

    /// Speed of axial waves: √(EA/ρA).
    pub fn wave_speed(&self) -> f64 {
        (self.stretching / self.density).sqrt()
    }

    /// Length of an element.
    pub fn size(&self) -> f64 {
        self.length / self.elements as f64
    }

    /// Measured depth of a node.
    pub fn depth(&self, node: usize) -> f64 {
        self.length * node as f64 / self.elements as f64
    }

    /// The length that belongs to a node.
    pub fn share(&self, node: usize) -> f64 {
        if node == 0 || node == self.elements { 0.5 * self.size() } else { self.size() }
    }

    /// Number of dofs.
    pub fn dofs(&self) -> usize {
        DOFS * (self.elements + 1)
    }

    /// Direction down the hole at a node, and the normal toward the high side.
    fn directions(&self, node: usize) -> [[f64; 2]; 2] {
        let (sin, cos) = self.well.inclination_at(self.depth(node)).sin_cos();
        [[sin, cos], [cos, -sin]]
    }

    /// (dof, weight) pairs of a displacement of a node along a direction.
    fn along(node: usize, direction: [f64; 2]) -> [(usize, f64); 2] {
        [(DOFS * node, direction[0]), (DOFS * node + 1, direction[1])]
    }

    /// The way down the hole of a node.
    pub fn way(&self, node: usize, u: &[f64]) -> f64 {
        Self::along(node, self.directions(node)[0]).iter().map(|&(dof, weight)| weight * u[dof]).sum()
    }

    /// Euler and Bernoulli's beam between two nodes, in the axes of the plane.
    fn element(&self, e: usize) -> Vec<Entry> {
        let [from, to] = [e, e + 1].map(|node| self.well.position(self.depth(node)));
        let chord = [to[0] - from[0], to[1] - from[1]];
        let l = chord[0].hypot(chord[1]);
        let (c, s) = (chord[0] / l, chord[1] / l);
        let (axial, b) = (self.stretching / l, self.bending / l.powi(3));
        // Rows of the strain modes: stretch; deflections and rotations by Hermite's polynomials.
        let stretch = [-c, -s, 0.0, c, s, 0.0];
        let deflection = [s, -c, 0.0, -s, c, 0.0];
        let mut block = [[0.0; 2 * DOFS]; 2 * DOFS];
        for i in 0..2 * DOFS {
            for j in 0..2 * DOFS {
                let rotation = |k: usize| if k % DOFS == 2 { 1.0 } else { 0.0 };
                let (ri, rj) = (rotation(i), rotation(j));
                let same = if i == j { 4.0 } else { 2.0 };
                block[i][j] = axial * stretch[i] * stretch[j] + 12.0 * b * deflection[i] * deflection[j]
                    - 6.0 * b * l * (deflection[i] * rj + ri * deflection[j])
                    + same * b * l * l * ri * rj;
            }
        }
        let entry = |i: usize, j: usize| (DOFS * e + i, DOFS * e + j, block[i][j]);
        (0..2 * DOFS).flat_map(|i| (0..2 * DOFS).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).collect()
    }

    /// K.
    pub fn stiffness(&self) -> SparseColMat<usize, f64> {
        matrix(self.dofs(), (0..self.elements).flat_map(|e| self.element(e)))
    }

    /// Lumped masses; a rotation has that of a stiff piece of half an element to either side.
    pub fn masses(&self) -> Vec<f64> {
        let of = |node: usize| {
            let mass = self.density * self.share(node);
            [mass, mass, mass * self.size().powi(2) / 12.0]
        };
        (0..=self.elements).flat_map(of).collect()
    }

    /// A run that begins with the rod at rest on the low side, weightless; weight (and the tail's pull) come on
    /// smoothly within `onset`. The top moves up as `hoist` says (way, velocity, acceleration), and not sideways.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn run(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        h: f64,
        onset: f64,
        hoist: impl Fn(f64) -> [f64; 3] + Send + 'static,
    ) -> Result<Simulation<'static, f64>> {
        self.scene(scheme, h, onset, hoist)?.constraint(self.walls(self.friction)).correctors(correctors).build()
    }

    /// The same before contact, for runs without it.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn scene(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        h: f64,
        onset: f64,
        hoist: impl Fn(f64) -> [f64; 3] + Send + 'static,
    ) -> Result<SimulationBuilder<'static, f64>> {
        let (rod, last) = (*self, self.elements);
        let [top, _] = self.directions(0);
        // The top is vertical or horizontal: one dof is that along the well.
        let (driven, fixed) = if top[1].abs() > 0.5 { (1, 0) } else { (0, 1) };
        let system = LinearSystem::lumped(self.masses(), self.stiffness())?
            .load(move |t, force| {
                // (Smoothly: what slides one way all the time is not damped by Coulomb's friction.)
                let part = if onset > 0.0 { ramp(1.0, onset)(t)[1] } else { 1.0 };
                force.fill(0.0);
                for node in 0..=last {
                    force[DOFS * node + 1] = part * rod.weight * rod.share(node);
                }
                for (dof, weight) in Self::along(last, rod.directions(last)[0]) {
                    force[dof] += part * rod.tail * weight;
                }
            })
            .drive(driven, move |t| hoist(t).map(|x| -x))?
            .fix(fixed)?;
        Ok(Simulation::builder(system, scheme, h))
    }

    /// Contacts: the low side of each node, then the high side of each; without those of the top, which is held.
    pub fn walls(&self, friction: f64) -> LinearRows<'static, f64> {
        let row = |rows: LinearRows<'static, f64>, (node, sign, gap): (usize, f64, f64)| {
            let [along, normal] = self.directions(node);
            let (normal, along) = (Self::along(node, normal.map(|n| sign * n)), Self::along(node, along));
            let rows = rows.unilateral(&normal, gap);
            if friction > 0.0 { rows.friction(friction, &[&along]) } else { rows }
        };
        let low = (1..=self.elements).map(|node| (node, 1.0, 0.0));
        let high = (1..=self.elements).map(|node| (node, -1.0, self.play));
        // Gaps are differences of coordinates of the well's size.
        low.chain(high).fold(LinearRows::new(), row).coordinates(self.length)
    }

    /// Contacts of the low side and of the high side.
    pub fn sides(&self) -> [Range<usize>; 2] {
        [0..self.elements, self.elements..2 * self.elements]
    }

    /// The pull of the hook on the top: the reaction there.
    ///
    /// # Errors
    ///
    /// Those of the reactions.
    pub fn hook_load(&self, run: &mut Simulation<'_, f64>) -> Result<f64> {
        let reactions = run.reactions()?;
        let [top, _] = self.directions(0);
        Ok(-reactions[..2].iter().zip(top).map(|(force, along)| force * along).sum::<f64>())
    }

    /// The soft string (Johancsik, Friesen and Dawson, J. Petrol. Technol. 36, 1984): tension and force on the wall
    /// over length at so many depths from the top to the end. From the lower end up dT = (w cos φ + sign μ |N|) ds, N =
    /// T κ − w sin φ (on the high side if positive), with the sign +1 when the rod is pulled out, −1 when it is run in,
    /// 0 when it has no friction.
    pub fn soft_string(&self, sign: f64, points: usize) -> Vec<[f64; 3]> {
        let pressed = |depth: f64, tension: f64| {
            tension * self.well.curvature_at(depth) - self.weight * self.well.inclination_at(depth).sin()
        };
        let slope = |depth: f64, tension: f64| {
            self.weight * self.well.inclination_at(depth).cos() + sign * self.friction * pressed(depth, tension).abs()
        };
        // Runge and Kutta's, piece by piece, with steps that end where the curvature jumps.
        let mut tension = self.tail;
        let mut profile = vec![[self.length, tension, pressed(self.length, tension)]];
        for k in (0..points - 1).rev() {
            let depths = [k + 1, k].map(|k| self.length * k as f64 / (points - 1) as f64);
            let mut knots: Vec<f64> = [self.well.end_of_arc(), self.well.kick_off]
                .into_iter()
                .filter(|knot| depths[1] < *knot && *knot < depths[0])
                .collect();
            knots.insert(0, depths[0]);
            knots.push(depths[1]);
            for piece in knots.windows(2) {
                let steps = 64;
                let ds = (piece[0] - piece[1]) / f64::from(steps);
                for step in 0..steps {
                    // (A little inside: the curvature belongs to the piece.)
                    let at = |part: f64| piece[0] - (f64::from(step) + part.clamp(1e-9, 1.0 - 1e-9)) * ds;
                    let k1 = slope(at(0.0), tension);
                    let k2 = slope(at(0.5), tension + 0.5 * ds * k1);
                    let k3 = slope(at(0.5), tension + 0.5 * ds * k2);
                    let k4 = slope(at(1.0), tension + ds * k3);
                    tension += ds / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                }
            }
            profile.push([depths[1], tension, pressed(depths[1], tension)]);
        }
        profile.reverse();
        profile
    }
}

/// Tension at the upper end of a circular arc of weight w over length, whose lower end has the tension and inclination
/// given, pulled out along its high side (T κ > w sin φ all along): T = C e^(−μφ) + A cos φ + B sin φ, A =
/// −2 μ w R/(1 + μ²), B = w R (μ² − 1)/(1 + μ²). Run in: the same with −μ.
pub fn arc_tension(friction: f64, weight: f64, radius: f64, lower: [f64; 2], upper: f64) -> f64 {
    let scale = weight * radius / (1.0 + friction * friction);
    let (a, b) = (-2.0 * friction * scale, (friction * friction - 1.0) * scale);
    let particular = |angle: f64| a * angle.cos() + b * angle.sin();
    let [tension, angle] = lower;
    particular(upper) + (tension - particular(angle)) * (friction * (angle - upper)).exp()
}

/// A start from rest to a constant velocity within a time, smooth in velocity: way, velocity, acceleration.
pub fn ramp(velocity: f64, time: f64) -> impl Fn(f64) -> [f64; 3] + Clone {
    move |t| {
        let x = t / time;
        match x {
            x if x <= 0.0 => [0.0; 3],
            x if x < 1.0 => {
                let way = velocity * time * (x.powi(3) - 0.5 * x.powi(4));
                [way, velocity * (3.0 - 2.0 * x) * x * x, 6.0 * velocity / time * (x - x * x)]
            }
            _ => [velocity * (t - 0.5 * time), velocity, 0.0],
        }
    }
}
