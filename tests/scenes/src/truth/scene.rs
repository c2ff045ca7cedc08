//! Scenes of a few dofs: what a run is made of, and scenes by chance.

use super::dense::{Matrix, dot, size, solve};
use crate::random::Congruential;
use contact_dynamics::contact::GapOffset;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::tableau::StartUp;
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem};

/// g0 + amplitude sin(frequency t).
#[derive(Clone, Copy, Debug, Default)]
pub struct Offset {
    pub gap: f64,
    pub amplitude: f64,
    pub frequency: f64,
}

impl Offset {
    /// The offset and its rates.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let (sin, cos) = (self.frequency * t).sin_cos();
        let w = self.frequency;
        [self.gap + self.amplitude * sin, self.amplitude * w * cos, -self.amplitude * w * w * sin]
    }
}

/// A contact: g = G u + g0(t).
#[derive(Clone, Debug)]
pub struct Row {
    pub g: Vec<f64>,
    pub offset: Offset,
    pub law: ContactLaw,
    /// Coefficient and tangent.
    pub friction: Option<(f64, Vec<f64>)>,
}

/// What happens in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bodies fly against obstacles, with springs to the ground.
    Bounce,
    /// They are pushed to them, lie, and are let go.
    Press,
    /// They lie on them at the start.
    Rest,
    /// Nothing acts on them until they meet.
    Flight,
}

impl Kind {
    pub const ALL: [Self; 4] = [Self::Bounce, Self::Press, Self::Rest, Self::Flight];
}

#[derive(Clone, Debug)]
pub struct Scene {
    pub mass: Matrix,
    pub damping: Option<Matrix>,
    pub stiffness: Matrix,
    /// f = constant + amplitude sin(frequency t), dof by dof.
    pub constant: Vec<f64>,
    pub amplitude: Vec<f64>,
    pub frequency: f64,
    pub rows: Vec<Row>,
    pub u: Vec<f64>,
    pub v: Vec<f64>,
    pub h: f64,
    pub start_up: StartUp,
    /// A dof with a motion of its own.
    pub drive: Option<(usize, Offset)>,
}

impl Scene {
    pub fn dofs(&self) -> usize {
        self.u.len()
    }

    pub fn load(&self, t: f64) -> Vec<f64> {
        let sin = (self.frequency * t).sin();
        self.constant.iter().zip(&self.amplitude).map(|(c, a)| c + a * sin).collect()
    }

    /// Displacement, velocity and acceleration of the driven dof.
    pub fn driven(&self, t: f64) -> Option<(usize, [f64; 3])> {
        self.drive.map(|(dof, motion)| (dof, motion.at(t)))
    }

    /// f(t) − K u − C v.
    pub fn force(&self, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        let mut f = self.load(t);
        for (i, f) in f.iter_mut().enumerate() {
            *f -= dot(&self.stiffness[i], u) + self.damping.as_ref().map_or(0.0, |c| dot(&c[i], v));
        }
        f
    }

    /// M⁻¹ f on the dofs that are free.
    pub fn accelerate(&self, f: &[f64]) -> Vec<f64> {
        let (mut mass, mut f) = (self.mass.clone(), f.to_vec());
        self.hold(&mut mass, &mut f);
        solve(mass, f).expect("a mass that is positive definite")
    }

    /// Makes the row and column of a driven dof those of a unit, and its entry zero.
    pub fn hold(&self, matrix: &mut Matrix, f: &mut [f64]) {
        if let Some((dof, _)) = self.drive {
            for (i, row) in matrix.iter_mut().enumerate() {
                row[dof] = f64::from(u8::from(i == dof));
            }
            for (j, entry) in matrix[dof].iter_mut().enumerate() {
                *entry = f64::from(u8::from(j == dof));
            }
            f[dof] = 0.0;
        }
    }

    /// Normal rows and tangents.
    pub fn axes(&self) -> Vec<&[f64]> {
        let tangents = self.rows.iter().filter_map(|row| row.friction.as_ref()).map(|(_, tangent)| &tangent[..]);
        self.rows.iter().map(|row| &row.g[..]).chain(tangents).collect()
    }

    /// The number of the tangent of a row among the axes.
    pub fn tangent(&self, row: usize) -> Option<usize> {
        let before = self.rows[..row].iter().filter(|row| row.friction.is_some()).count();
        self.rows[row].friction.as_ref().map(|_| self.rows.len() + before)
    }

    pub fn gap(&self, row: usize, t: f64, u: &[f64]) -> f64 {
        dot(&self.rows[row].g, u) + self.rows[row].offset.at(t)[0]
    }

    pub fn rate(&self, row: usize, t: f64, v: &[f64]) -> f64 {
        dot(&self.rows[row].g, v) + self.rows[row].offset.at(t)[1]
    }

    /// What of a gap is rounding.
    pub fn rounding(&self, row: usize, t: f64, u: &[f64]) -> f64 {
        64.0 * f64::EPSILON * (size(&self.rows[row].g, u) + self.gap(row, t, u).abs())
    }

    /// The system of the crate.
    pub fn system(&self) -> LinearSystem<'static, f64> {
        let mass = &self.mass;
        let is_diagonal = mass.iter().enumerate().all(|(i, row)| {
            let beside = row.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, x)| x.abs()).sum::<f64>();
            beside <= 0.0
        });
        let system = match is_diagonal {
            true => {
                let diagonal = mass.iter().enumerate().map(|(i, row)| row[i]).collect();
                LinearSystem::lumped(diagonal, sparse(&self.stiffness))
            }
            false => LinearSystem::new(sparse(mass), sparse(&self.stiffness)),
        };
        let mut system = system.expect("matrices of one size");
        if let Some(damping) = &self.damping {
            system = system.damping(sparse(damping)).expect("damping of the same size");
        }
        if let Some((dof, motion)) = self.drive {
            system = system.drive(dof, move |t| motion.at(t)).expect("a dof of the system");
        }
        let scene = self.clone();
        system.load(move |t, f| f.copy_from_slice(&scene.load(t)))
    }

    /// The contacts of the crate.
    pub fn contact(&self) -> LinearRows<'static, f64> {
        let entries = |row: &[f64]| -> Vec<(usize, f64)> {
            row.iter().copied().enumerate().filter(|(_, x)| x.abs() > 0.0).collect()
        };
        self.rows.iter().fold(LinearRows::new(), |rows, row| {
            let offset = row.offset;
            let offset = match offset.amplitude.abs() > 0.0 {
                true => GapOffset::moving(move |t| offset.at(t)),
                false => GapOffset::Constant(offset.gap),
            };
            let rows = rows.row(row.law, &entries(&row.g), offset);
            match &row.friction {
                Some((coefficient, tangent)) => rows.friction(*coefficient, &[&entries(tangent)]),
                None => rows,
            }
        })
    }

    /// A scene by chance: a chain of masses and springs, and rows that each have a dof of their own. `critical` is the
    /// largest stable Ω of the scheme, if there is one.
    pub fn by_chance(kind: Kind, seed: u64, critical: Option<f64>) -> Self {
        let mut random = Congruential(seed.wrapping_mul(0x9e37_79b9) ^ 0x5eed);
        (0..4).for_each(|_| _ = random.unit());
        let n = 3 + (seed % 4) as usize;
        let mut mass = vec![vec![0.0; n]; n];
        let mut stiffness = mass.clone();
        let consistent = seed % 3 == 1;
        for i in 0..n {
            mass[i][i] = random.within(0.5, 2.0);
            if kind != Kind::Flight && (i == 0 || random.unit() < 0.5) {
                stiffness[i][i] += random.within(5.0, 60.0);
            }
        }
        for i in 1..n {
            let (k, m) = (random.within(20.0, 200.0), random.within(0.05, 0.2));
            for (row, column, sign) in [(i, i, 1.0), (i - 1, i - 1, 1.0), (i, i - 1, -1.0), (i - 1, i, -1.0)] {
                stiffness[row][column] += sign * k;
                if consistent && row != column {
                    mass[row][column] += m;
                }
            }
        }
        let damping = (seed % 2 == 1 && kind != Kind::Flight).then(|| {
            let (alpha, beta) = (random.within(0.0, 0.3), random.within(0.0005, 0.003));
            let entry = |i: usize, j: usize| alpha * mass[i][j] + beta * stiffness[i][j];
            (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
        });
        let bound = highest(&mass, &stiffness);
        let h = match critical {
            Some(critical) => random.within(0.3, 0.6) * critical / bound,
            None => random.within(0.3, 1.5) / bound,
        };
        let mut scene = Self {
            mass,
            damping,
            stiffness,
            constant: vec![0.0; n],
            amplitude: vec![0.0; n],
            frequency: random.within(0.02, 0.2) / h,
            rows: Vec::new(),
            u: vec![0.0; n],
            v: vec![0.0; n],
            h,
            start_up: StartUp::Trapezoidal,
            drive: None,
        };
        scene.put_rows(kind, &mut random);
        scene.put_motion(kind, &mut random);
        if kind == Kind::Press && seed % 4 >= 2 {
            scene.start_up = StartUp::Taylor;
        }
        scene
    }

    /// Obstacles in front of some of the dofs, and bodies in front of each other.
    fn put_rows(&mut self, kind: Kind, random: &mut Congruential) {
        let n = self.dofs();
        let count = 1 + (random.unit() * 4.0) as usize;
        for r in 0..count.min(n - 1) {
            let mut g = vec![0.0; n];
            g[r] = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            if random.unit() < 0.4 {
                g[r + 1] = random.signed();
            }
            let gap = if kind == Kind::Rest { 0.0 } else { random.within(0.2, 2.0) * self.h };
            let mut offset = Offset { gap, ..Offset::default() };
            if kind == Kind::Bounce && random.unit() < 0.4 {
                offset.amplitude = random.within(0.1, 0.5) * self.h;
                offset.frequency = random.within(0.02, 0.2) / self.h;
            }
            self.rows.push(Row { g, offset, law: ContactLaw::Rigid, friction: None });
        }
    }

    /// Motion at the start, and loads that bring the contacts together.
    fn put_motion(&mut self, kind: Kind, random: &mut Congruential) {
        let n = self.dofs();
        match kind {
            Kind::Bounce => {
                self.v = random.vector(n, 1.0);
                self.amplitude = random.vector(n, 0.3 / self.h);
            }
            Kind::Flight => {
                let v = random.signed();
                self.v = vec![v; n];
                for row in &mut self.rows {
                    let approaches = row.g.iter().sum::<f64>() * v < 0.0;
                    if !approaches {
                        row.g.iter_mut().for_each(|g| *g = -*g);
                    }
                }
            }
            Kind::Press | Kind::Rest => {
                // Towards the rows at first, and away from them later.
                for row in &self.rows {
                    let push = random.within(0.2, 1.0) / self.h;
                    for (i, g) in row.g.iter().enumerate() {
                        self.constant[i] -= 0.3 * push * g;
                        self.amplitude[i] -= push * g;
                    }
                }
                if kind == Kind::Press {
                    self.v = random.vector(n, 0.3);
                }
            }
        }
    }
}

/// An upper bound of the highest frequency: norms of K and M⁻¹.
fn highest(mass: &Matrix, stiffness: &Matrix) -> f64 {
    let rows = |a: &Matrix| a.iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let least = mass.iter().enumerate().map(|(i, row)| 2.0 * row[i] - row.iter().map(|x| x.abs()).sum::<f64>());
    (rows(stiffness) / least.fold(f64::INFINITY, f64::min)).sqrt()
}

fn sparse(a: &Matrix) -> SparseColMat<usize, f64> {
    let entries = a.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, &x)| (i, j, x)));
    crate::sparse::matrix(a.len(), entries.filter(|(i, j, x)| i == j || x.abs() > 0.0))
}
