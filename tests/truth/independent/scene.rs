//! Scenes of a few dofs, and the parts of the crate that they make.

use super::dense::{Matrix, dot, eliminate, size};
use contact_dynamics::contact::GapOffset;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::tableau::StartUp;
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, System};
use contact_dynamics_random_scenes::Nonlinear;

/// g0 + amplitude sin(frequency t).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Offset {
    pub(crate) gap: f64,
    pub(crate) amplitude: f64,
    pub(crate) frequency: f64,
}

impl Offset {
    /// The offset and its rates.
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let (sin, cos) = (self.frequency * t).sin_cos();
        let w = self.frequency;
        [self.gap + self.amplitude * sin, self.amplitude * w * cos, -self.amplitude * w * w * sin]
    }
}

/// A contact: g = G u + g0(t).
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) g: Vec<f64>,
    pub(crate) offset: Offset,
    pub(crate) law: ContactLaw,
    /// Coefficient and tangent.
    pub(crate) friction: Option<(f64, Vec<f64>)>,
}

/// By how many roundings data differ in the runs that tell how sensitive a scene is.
const ROUNDINGS: f64 = 256.0;

#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) mass: Matrix,
    pub(crate) damping: Option<Matrix>,
    pub(crate) stiffness: Matrix,
    /// Springs between two dofs (or a dof and the ground) that pull with k d³ besides.
    pub(crate) cubic: Vec<([Option<usize>; 2], f64)>,
    /// f = constant + amplitude sin(frequency t), dof by dof.
    pub(crate) constant: Vec<f64>,
    pub(crate) amplitude: Vec<f64>,
    pub(crate) frequency: f64,
    pub(crate) rows: Vec<Row>,
    pub(crate) u: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) h: f64,
    /// What the sizes of steps are of h, over and over.
    pub(crate) changes: Vec<f64>,
    pub(crate) start_up: StartUp,
    /// A dof with a motion of its own.
    pub(crate) drive: Option<(usize, Offset)>,
}

impl Scene {
    pub(crate) fn dofs(&self) -> usize {
        self.u.len()
    }

    /// The same scene with data that differ by a few roundings.
    pub(crate) fn rounded(&self) -> Self {
        let mut scene = self.clone();
        for data in [&mut scene.v, &mut scene.constant, &mut scene.amplitude] {
            data.iter_mut().zip(1..).for_each(|(x, i)| *x *= 1.0 + f64::from(i % 3 - 1) * ROUNDINGS * f64::EPSILON);
        }
        if let Some((dof, [_, v, _])) = scene.driven(0.0) {
            scene.v[dof] = v;
        }
        for (row, i) in scene.rows.iter_mut().zip(1..) {
            row.offset.gap *= 1.0 + f64::from(i % 3 - 1) * ROUNDINGS * f64::EPSILON;
        }
        scene
    }

    pub(crate) fn load(&self, t: f64) -> Vec<f64> {
        let sin = (self.frequency * t).sin();
        self.constant.iter().zip(&self.amplitude).map(|(c, a)| c + a * sin).collect()
    }

    /// Displacement, velocity and acceleration of the driven dof.
    pub(crate) fn driven(&self, t: f64) -> Option<(usize, [f64; 3])> {
        self.drive.map(|(dof, motion)| (dof, motion.at(t)))
    }

    /// f(t) − K u − C v, less the forces of the cubic springs.
    pub(crate) fn force(&self, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        let mut f = self.load(t);
        for (i, f) in f.iter_mut().enumerate() {
            *f -= dot(&self.stiffness[i], u) + self.damping.as_ref().map_or(0.0, |c| dot(&c[i], v));
        }
        for (ends, k) in &self.cubic {
            let d = length(*ends, u);
            for (end, sign) in ends.iter().zip([1.0, -1.0]) {
                if let Some(dof) = end {
                    f[*dof] -= sign * k * d * d * d;
                }
            }
        }
        f
    }

    /// The derivative of the internal force by u.
    pub(crate) fn stiffness_at(&self, u: &[f64]) -> Matrix {
        let mut k = self.stiffness.clone();
        for (ends, cubic) in &self.cubic {
            let slope = 3.0 * cubic * length(*ends, u) * length(*ends, u);
            let terms = ends.iter().zip([1.0, -1.0]).filter_map(|(end, sign)| Some(((*end)?, sign)));
            let terms: Vec<(usize, f64)> = terms.collect();
            for &(i, x) in &terms {
                terms.iter().for_each(|&(j, y)| k[i][j] += slope * x * y);
            }
        }
        k
    }

    /// Dofs without mass.
    pub(crate) fn massless(&self) -> Vec<usize> {
        (0..self.dofs()).filter(|&dof| self.mass[dof][dof] <= 0.0).collect()
    }

    /// Whether damping acts on dofs without mass.
    pub(crate) fn damps_massless(&self) -> bool {
        let damps = |damping: &Matrix| self.massless().iter().any(|&dof| damping[dof].iter().any(|c| c.abs() > 0.0));
        self.damping.as_ref().is_some_and(damps)
    }

    /// Whether an axis acts on dofs without mass.
    pub(crate) fn acts_on_massless(&self, axis: &[f64]) -> bool {
        self.massless().iter().any(|&dof| axis[dof].abs() > 0.0)
    }

    /// Whether a row acts on dofs without mass.
    pub(crate) fn is_static(&self, row: usize) -> bool {
        self.acts_on_massless(&self.rows[row].g)
    }

    /// Whether impulses of a contact reach all that it acts on, by its gap and its friction.
    pub(crate) fn has_mass(&self, row: usize) -> bool {
        let rubs = |(_, tangent): &(f64, Vec<f64>)| self.acts_on_massless(tangent);
        !self.is_static(row) && !self.rows[row].friction.as_ref().is_some_and(rubs)
    }

    /// M⁻¹ f on the dofs that are free and have a mass.
    pub(crate) fn accelerate(&self, f: &[f64]) -> Vec<f64> {
        let mut accelerations = [f.to_vec()];
        self.accelerate_all(&mut accelerations);
        let [acceleration] = accelerations;
        acceleration
    }

    /// The same of several f, in their place.
    pub(crate) fn accelerate_all(&self, f: &mut [Vec<f64>]) {
        if f.is_empty() {
            return;
        }
        let mut mass = self.mass.clone();
        self.hold(&mut mass, f);
        for dof in self.massless() {
            mass[dof][dof] = 1.0;
            f.iter_mut().for_each(|f| f[dof] = 0.0);
        }
        assert!(eliminate(&mut mass, f), "a mass that is not positive definite");
    }

    /// Makes the row and column of a driven dof those of a unit, and its entries zero.
    pub(crate) fn hold(&self, matrix: &mut Matrix, f: &mut [Vec<f64>]) {
        if let Some((dof, _)) = self.drive {
            for (i, row) in matrix.iter_mut().enumerate() {
                row[dof] = f64::from(u8::from(i == dof));
            }
            for (j, entry) in matrix[dof].iter_mut().enumerate() {
                *entry = f64::from(u8::from(j == dof));
            }
            f.iter_mut().for_each(|f| f[dof] = 0.0);
        }
    }

    /// Normal rows and tangents.
    pub(crate) fn axes(&self) -> impl Iterator<Item = &[f64]> {
        let tangents = self.rows.iter().filter_map(|row| row.friction.as_ref()).map(|(_, tangent)| &tangent[..]);
        self.rows.iter().map(|row| &row.g[..]).chain(tangents)
    }

    /// One of them.
    pub(crate) fn axis(&self, number: usize) -> &[f64] {
        self.axes().nth(number).expect("an axis of the scene")
    }

    /// The number of the tangent of a row among the axes.
    pub(crate) fn tangent(&self, row: usize) -> Option<usize> {
        let before = self.rows[..row].iter().filter(|row| row.friction.is_some()).count();
        self.rows[row].friction.as_ref().map(|_| self.rows.len() + before)
    }

    pub(crate) fn gap(&self, row: usize, t: f64, u: &[f64]) -> f64 {
        dot(&self.rows[row].g, u) + self.rows[row].offset.at(t)[0]
    }

    pub(crate) fn rate(&self, row: usize, t: f64, v: &[f64]) -> f64 {
        dot(&self.rows[row].g, v) + self.rows[row].offset.at(t)[1]
    }

    /// What of a gap is rounding.
    pub(crate) fn rounding(&self, row: usize, t: f64, u: &[f64]) -> f64 {
        64.0 * f64::EPSILON * (size(&self.rows[row].g, u) + self.gap(row, t, u).abs())
    }

    /// The system of the crate.
    pub(crate) fn system(&self) -> Box<dyn System<f64>> {
        let linear = self.linear();
        match self.cubic.is_empty() {
            true => Box::new(linear),
            false => Box::new(Nonlinear::new(linear, self.cubic.clone(), Vec::new())),
        }
    }

    fn linear(&self) -> LinearSystem<'static, f64> {
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
    pub(crate) fn contact(&self) -> LinearRows<'static, f64> {
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
}

/// How much longer a spring is.
fn length(ends: [Option<usize>; 2], u: &[f64]) -> f64 {
    let [one, other] = ends.map(|end| end.map_or(0.0, |dof| u[dof]));
    one - other
}

fn sparse(a: &Matrix) -> SparseColMat<usize, f64> {
    let entries = a.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, &x)| (i, j, x)));
    contact_dynamics_scenes::sparse::matrix(a.len(), entries.filter(|(i, j, x)| i == j || x.abs() > 0.0))
}
