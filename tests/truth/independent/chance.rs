//! Scenes by chance.

use super::dense::{Matrix, dot};
use super::scene::{Offset, Row, Scene};
use contact_dynamics::ContactLaw;
use contact_dynamics::tableau::StartUp;
use contact_dynamics_scenes::random::Congruential;

/// What happens in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Bodies fly against obstacles, some of which move, with springs to the ground.
    Bounce,
    /// They are pushed to them, lie, and are let go.
    Press,
    /// They lie on them at the start, or are held by them for good.
    Rest,
    /// Nothing acts on them until they meet.
    Flight,
}

impl Kind {
    pub(crate) const ALL: [Self; 4] = [Self::Bounce, Self::Press, Self::Rest, Self::Flight];
}

/// What bodies are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bodies {
    /// Masses and springs.
    Linear,
    /// Springs harden.
    Hardening,
    /// Some dofs have no mass.
    Massless,
}

/// What a scene is made for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting {
    pub(crate) kind: Kind,
    /// The largest stable Ω of the scheme, if there is one.
    pub(crate) critical: Option<f64>,
    /// The law of every other row, with stiffnesses in units of one of the springs; the others are rigid, or of this
    /// law too.
    pub(crate) law: ContactLaw,
    pub(crate) mixed: bool,
    /// Whether dofs are those of nodes in the plane, and contacts rub.
    pub(crate) rubs: bool,
    pub(crate) bodies: Bodies,
}

impl Setting {
    /// The scene of a seed.
    pub(crate) fn scene(&self, seed: u64) -> Scene {
        let kind = self.kind;
        let mut random = Congruential(seed.wrapping_mul(0x9e37_79b9) ^ 0x5eed);
        (0..4).for_each(|_| _ = random.unit());
        let n = if self.rubs { 4 + 2 * (seed % 2) as usize } else { 3 + (seed % 4) as usize };
        let [mut mass, stiffness] = bodies(n, self.rubs, kind, seed % 3 == 1, &mut random);
        if self.bodies == Bodies::Massless {
            // (In the plane one of two nodes at least has a mass along each axis.)
            let apart: &[usize] = if self.rubs { &[0, 3] } else { &[0, 2] };
            let without = [&[0][..], &[1], apart, &[0, 1]][(seed % 4) as usize];
            for &dof in without {
                mass.iter_mut().for_each(|row| row[dof] = 0.0);
                mass[dof].fill(0.0);
            }
        }
        let damping = (seed % 2 == 1 && kind != Kind::Flight).then(|| {
            let (alpha, beta) = (random.within(0.0, 0.3), random.within(0.0005, 0.003));
            // (What is damped without a mass, and touches from the start, begins out of balance.)
            let beta = if self.bodies == Bodies::Massless && kind == Kind::Rest { 0.0 } else { beta };
            let entry = |i: usize, j: usize| alpha * mass[i][j] + beta * stiffness[i][j];
            (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
        });
        let bound = highest(&mass, &stiffness);
        let h = match self.critical {
            Some(critical) => random.within(0.3, 0.6) * critical / bound,
            None => random.within(0.3, 1.5) / bound,
        };
        let mut scene = Scene {
            mass,
            damping,
            stiffness,
            cubic: Vec::new(),
            constant: vec![0.0; n],
            amplitude: vec![0.0; n],
            frequency: random.within(0.02, 0.2) / h,
            rows: Vec::new(),
            u: vec![0.0; n],
            v: vec![0.0; n],
            h,
            changes: vec![1.0],
            start_up: StartUp::Trapezoidal,
            drive: None,
        };
        self.put_rows(&mut scene, &mut random);
        self.put_motion(&mut scene, &mut random);
        if self.bodies == Bodies::Hardening {
            self.put_cubic(&mut scene, &mut random);
        }
        if kind == Kind::Flight && seed.is_multiple_of(2) {
            // All contacts close where a step ends: they touch without pressure, and some let go of others.
            for row in &mut scene.rows {
                row.offset.gap = 3.0 * h * dot(&row.g, &scene.v).abs();
            }
        }
        if kind == Kind::Press && seed % 4 >= 2 {
            scene.start_up = StartUp::Taylor;
        }
        if matches!(kind, Kind::Bounce | Kind::Press) && seed % 4 == 3 {
            // The last dof is moved.
            let frequency = random.within(0.02, 0.1) / h;
            let drive = Offset { gap: 0.0, amplitude: random.within(0.2, 1.0) * h, frequency };
            [scene.u[n - 1], scene.v[n - 1], _] = drive.at(0.0);
            scene.drive = Some((n - 1, drive));
        }
        let ties = kind == Kind::Rest && seed % 2 == 1 && !self.rubs && self.law == ContactLaw::Rigid;
        if let Some(row) = scene.rows.last_mut().filter(|_| ties) {
            row.law = ContactLaw::Equality;
        }
        scene
    }

    /// Obstacles in front of some of the dofs, and bodies in front of each other.
    fn put_rows(&self, scene: &mut Scene, random: &mut Congruential) {
        let (n, h, kind) = (scene.dofs(), scene.h, self.kind);
        let stride = if self.rubs { 2 } else { 1 };
        let count = 1 + (random.unit() * 4.0) as usize;
        for r in 0..count.min(n / stride - usize::from(!self.rubs)) {
            let dof = stride * r;
            let mut g = vec![0.0; n];
            g[dof] = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            let other = (random.unit() < 0.4 && dof + stride < n).then(|| random.signed());
            if let Some(weight) = other {
                g[dof + stride] = weight;
            }
            let gap = if kind == Kind::Rest { 0.0 } else { random.within(0.2, 2.0) * h };
            let mut offset = Offset { gap, ..Offset::default() };
            if kind == Kind::Bounce && random.unit() < 0.4 {
                offset.amplitude = random.within(0.1, 0.5) * h;
                offset.frequency = random.within(0.02, 0.2) / h;
            }
            let law = if self.mixed && r % 2 == 1 { ContactLaw::Rigid } else { in_units(self.law, scene) };
            let friction = self.rubs.then(|| {
                let mut tangent = vec![0.0; n];
                tangent[dof + 1] = 1.0;
                if let Some(weight) = other {
                    tangent[dof + 3] = weight * g[dof];
                }
                (random.within(0.1, 0.8), tangent)
            });
            scene.rows.push(Row { g, offset, law, friction });
        }
    }

    /// Springs between neighbors, and to the ground where there are others, that are up to twice as stiff at the ways
    /// that bodies go: as far as a unit of velocity is stopped in.
    fn put_cubic(&self, scene: &mut Scene, random: &mut Congruential) {
        let stride = if self.rubs { 2 } else { 1 };
        let way = |k: f64, m: f64| (m / k).sqrt();
        for i in 0..scene.dofs() {
            let (k, m) = (scene.stiffness[i][i], scene.mass[i][i]);
            if self.kind != Kind::Flight && k > 0.0 {
                scene.cubic.push(([Some(i), None], random.within(0.03, 0.3) * k / way(k, m).powi(2)));
            }
            if i >= stride && k > 0.0 {
                let k3 = random.within(0.03, 0.3) * k / way(k, m).powi(2);
                scene.cubic.push(([i, i - stride].map(Some), k3));
            }
        }
    }

    /// Motion at the start, and loads that bring the contacts together.
    fn put_motion(&self, scene: &mut Scene, random: &mut Congruential) {
        let (n, h) = (scene.dofs(), scene.h);
        match self.kind {
            Kind::Bounce => {
                scene.v = random.vector(n, 1.0);
                scene.amplitude = random.vector(n, 0.3 / h);
            }
            Kind::Flight => {
                let v = [random.signed(), random.signed()];
                scene.v = (0..n).map(|i| if self.rubs { v[i % 2] } else { v[0] }).collect();
                for row in &mut scene.rows {
                    let approaches = row.g.iter().sum::<f64>() * v[0] < 0.0;
                    if !approaches {
                        row.g.iter_mut().for_each(|g| *g = -*g);
                    }
                }
            }
            Kind::Press | Kind::Rest => {
                // Towards the rows at first, and away from them later.
                for row in &scene.rows {
                    let push = random.within(0.2, 1.0) / h;
                    for (i, g) in row.g.iter().enumerate() {
                        // (Contacts without mass that close at the start, with a velocity, are none at rest.)
                        let waits = self.kind == Kind::Press && scene.mass[i][i] <= 0.0;
                        scene.constant[i] -= if waits { 0.0 } else { 0.3 * push * g };
                        scene.amplitude[i] -= push * g;
                    }
                    if let Some((coefficient, tangent)) = &row.friction {
                        let pull = coefficient * push * random.within(-1.0, 1.0);
                        for (i, t) in tangent.iter().enumerate() {
                            scene.constant[i] += 0.4 * pull * t;
                            scene.amplitude[i] += pull * t;
                        }
                    }
                }
                if self.kind == Kind::Press {
                    scene.v = random.vector(n, 0.3);
                } else {
                    scene.amplitude.iter_mut().for_each(|amplitude| *amplitude += 0.1 / h * random.signed());
                }
            }
        }
    }
}

/// Mass and stiffness of a chain, of dofs one after the other, or of nodes in the plane with springs across.
fn bodies(n: usize, plane: bool, kind: Kind, consistent: bool, random: &mut Congruential) -> [Matrix; 2] {
    let mut mass = vec![vec![0.0; n]; n];
    let mut stiffness = mass.clone();
    let stride = if plane { 2 } else { 1 };
    for i in 0..n {
        mass[i][i] = random.within(0.5, 2.0);
        if kind != Kind::Flight && (i == 0 || random.unit() < 0.5) {
            stiffness[i][i] += random.within(5.0, 60.0);
        }
    }
    for i in stride..n {
        let (k, m) = (random.within(20.0, 200.0), random.within(0.05, 0.2));
        // Along the dof alone, or in a direction of the plane.
        let along = if plane { random.signed() } else { 0.0 };
        let spring = |i: usize| [(i, 1.0), (i - stride, -1.0)];
        let mut terms = spring(i).to_vec();
        if plane {
            let beside = if i % 2 == 0 { i + 1 } else { i - 1 };
            terms.extend(spring(beside).map(|(dof, sign)| (dof, along * sign)));
        }
        for &(row, x) in &terms {
            for &(column, y) in &terms {
                stiffness[row][column] += k * x * y;
            }
        }
        if consistent {
            mass[i][i - stride] += m;
            mass[i - stride][i] += m;
        }
    }
    [mass, stiffness]
}

/// A law with stiffnesses in units of a spring of the scene.
fn in_units(law: ContactLaw, scene: &Scene) -> ContactLaw {
    let k = scene.stiffness[0][0];
    match law {
        ContactLaw::Penalty { stiffness } => ContactLaw::Penalty { stiffness: stiffness * k },
        ContactLaw::PowerLaw { stiffness, exponent } => {
            // The unit of depth is the way of a unit of velocity in a step.
            ContactLaw::PowerLaw { stiffness: stiffness * k * scene.h.powf(1.0 - exponent), exponent }
        }
        ContactLaw::KelvinVoigt { stiffness, damping } => {
            ContactLaw::KelvinVoigt { stiffness: stiffness * k, damping: damping * k * scene.h }
        }
        ContactLaw::HuntCrossley { stiffness, exponent, dissipation } => {
            ContactLaw::HuntCrossley { stiffness: stiffness * k * scene.h.powf(1.0 - exponent), exponent, dissipation }
        }
        ContactLaw::Bipenalty { stiffness, mass } => {
            ContactLaw::Bipenalty { stiffness: stiffness * k, mass: mass * k * scene.h * scene.h }
        }
        ContactLaw::StabilizedBipenalty { stiffness } => ContactLaw::StabilizedBipenalty { stiffness: stiffness * k },
        ContactLaw::AugmentedLagrangian { stiffness, augmentations } => {
            ContactLaw::AugmentedLagrangian { stiffness: stiffness * k, augmentations }
        }
        law => law,
    }
}

/// An upper bound of the highest frequency: norms of K and M⁻¹.
fn highest(mass: &Matrix, stiffness: &Matrix) -> f64 {
    let rows = |a: &Matrix| a.iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let least = mass.iter().enumerate().map(|(i, row)| 2.0 * row[i] - row.iter().map(|x| x.abs()).sum::<f64>());
    // (Dofs without mass follow the others.)
    let least = least.filter(|least| *least > 0.0);
    (rows(stiffness) / least.fold(f64::INFINITY, f64::min)).sqrt()
}
