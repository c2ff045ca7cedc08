//! The model that the files describe: matrices, loads, supports and initial motion, checked with one another.

use crate::contacts::{self, Contact};
use crate::matrix_market::MatrixFile;
use crate::options::Options;
use crate::refusal::{Refusal, Result};
use crate::table::Table;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{LinearSystem, Mass, mass};
use std::collections::BTreeMap;
use std::path::Path;

type Matrix = SparseColMat<usize, f64>;

/// M as the crate takes it.
enum Masses {
    Lumped(Vec<f64>),
    Consistent(Matrix),
}

/// All inputs of a run.
pub(crate) struct Model {
    mass: Masses,
    stiffness: Matrix,
    damping: Damping,
    /// Whether K or C is not symmetric, so that effective matrices take LU.
    pub(crate) is_unsymmetric: bool,
    load: Load,
    supports: Vec<usize>,
    pub(crate) contacts: Vec<Contact>,
    pub(crate) u: Vec<f64>,
    pub(crate) v: Vec<f64>,
}

enum Damping {
    None,
    Rayleigh([f64; 2]),
    Matrix(Matrix),
}

impl Model {
    /// Reads all files that the options name.
    pub(crate) fn read(options: &Options) -> Result<Self> {
        let missing = |name| Refusal::new(format!("--{name} is missing"));
        let stiffness_file = MatrixFile::read(options.stiffness.as_deref().ok_or_else(|| missing("stiffness"))?)?;
        let stiffness = stiffness_file.matrix()?;
        let dofs = stiffness.nrows();
        let mut is_unsymmetric = is_unsymmetric(&stiffness_file, &stiffness)?;
        let mass = masses(options.mass.as_deref().ok_or_else(|| missing("mass"))?, dofs, options.lump)?;
        let damping = match (&options.damping, options.rayleigh.as_deref()) {
            (Some(path), _) => {
                let file = MatrixFile::read(path)?;
                let matrix = file.matrix()?;
                same_size(path, matrix.nrows(), dofs)?;
                is_unsymmetric |= self::is_unsymmetric(&file, &matrix)?;
                Damping::Matrix(matrix)
            }
            (None, Some(&[a, b])) => Damping::Rayleigh([a, b]),
            (None, _) => Damping::None,
        };
        let mut load = Load::new(dofs);
        if let Some(path) = &options.load {
            load.read(path, dofs)?;
        }
        if let Some(gravity) = &options.gravity {
            load.add_gravity(gravity, &mass)?;
        }
        let supports = options.supports.as_deref().map_or(Ok(Vec::new()), |path| supports(path, dofs))?;
        let contacts_path = options.contacts.as_deref().ok_or_else(|| missing("contacts"))?;
        let contacts = contacts::read(contacts_path, dofs)?;
        let [u, v] = match &options.initial {
            Some(path) => initial(path, dofs)?,
            None => [vec![0.0; dofs], vec![0.0; dofs]],
        };
        Ok(Self { mass, stiffness, damping, is_unsymmetric, load, supports, contacts, u, v })
    }

    pub(crate) fn dofs(&self) -> usize {
        self.u.len()
    }

    /// The system of the crate.
    pub(crate) fn system(self) -> contact_dynamics::Result<LinearSystem<'static, f64>> {
        let system = match self.mass {
            Masses::Lumped(mass) => LinearSystem::lumped(mass, self.stiffness)?,
            Masses::Consistent(mass) => LinearSystem::new(mass, self.stiffness)?,
        };
        let system = match self.damping {
            Damping::None => system,
            Damping::Rayleigh([a, b]) => system.rayleigh(a, b)?,
            Damping::Matrix(damping) => system.damping(damping)?,
        };
        let system = self.supports.into_iter().try_fold(system, LinearSystem::fix)?;
        let load = self.load;
        Ok(if load.is_none() { system } else { system.load(move |t, force| load.at(t, force)) })
    }
}

fn same_size(path: &Path, found: usize, dofs: usize) -> Result<()> {
    match found == dofs {
        true => Ok(()),
        false => Err(Refusal::of(path, format!("{found} dofs, but the stiffness matrix has {dofs}"))),
    }
}

/// M from a file of either kind.
fn masses(path: &Path, dofs: usize, lump: bool) -> Result<Masses> {
    let file = MatrixFile::read(path)?;
    if let Some(diagonal) = file.diagonal() {
        same_size(path, diagonal.len(), dofs)?;
        return match diagonal.iter().position(|&m| m < 0.0) {
            Some(dof) => Err(negative(path, dof, diagonal[dof])),
            None => Ok(Masses::Lumped(diagonal)),
        };
    }
    let matrix = file.matrix()?;
    same_size(path, matrix.nrows(), dofs)?;
    if let Some(entries) = file.asymmetry(&matrix) {
        let what = format!("the mass matrix is not symmetric: {entries}; write both triangles, or declare `symmetric`");
        return Err(Refusal::of(path, what));
    }
    for dof in 0..dofs {
        let entry = matrix.as_ref().get(dof, dof).copied().unwrap_or(0.0);
        if entry < 0.0 {
            return Err(negative(path, dof, entry));
        }
    }
    match lump {
        true => mass::lump(matrix.as_ref()).map(Masses::Lumped).map_err(|error| Refusal::of(path, error)),
        false => Ok(Masses::Consistent(matrix)),
    }
}

fn negative(path: &Path, dof: usize, mass: f64) -> Refusal {
    Refusal::of(path, format!("the mass of dof {} is {mass:?}, it must not be negative", dof + 1))
}

/// Whether a K or C is not symmetric. One with entries on one side of the diagonal alone is half a symmetric one, and
/// refused.
fn is_unsymmetric(file: &MatrixFile, matrix: &Matrix) -> Result<bool> {
    let Some(entries) = file.asymmetry(matrix) else { return Ok(false) };
    let on_side = |side: fn(&usize, &usize) -> bool| {
        (0..matrix.ncols())
            .any(|column| matrix.as_ref().row_idx_of_col_raw(column).iter().any(|row| side(row, &column)))
    };
    if on_side(usize::gt) && on_side(usize::lt) {
        return Ok(true);
    }
    let what = format!(
        "the file says `general`, but has entries on one side of the diagonal alone: {entries}; declare it `symmetric` \
         (lower triangle), or write both triangles"
    );
    Err(Refusal::of(file.path(), what))
}

fn supports(path: &Path, dofs: usize) -> Result<Vec<usize>> {
    let table = Table::read(path, &["dof"], &[])?;
    let mut lines = BTreeMap::new();
    for row in table.rows() {
        let dof = row.dof("dof", dofs)?;
        if let Some(line) = lines.insert(dof, row.line) {
            return Err(row.refused(format!("dof {} is fixed in line {line} already", dof + 1)));
        }
    }
    Ok(lines.into_keys().collect())
}

/// u and v at the start.
fn initial(path: &Path, dofs: usize) -> Result<[Vec<f64>; 2]> {
    let table = Table::read(path, &["dof"], &["u", "v"])?;
    let [mut u, mut v] = [vec![0.0; dofs], vec![0.0; dofs]];
    let mut lines = BTreeMap::new();
    for row in table.rows() {
        let dof = row.dof("dof", dofs)?;
        if let Some(line) = lines.insert(dof, row.line) {
            return Err(row.refused(format!("dof {} has its motion in line {line} already", dof + 1)));
        }
        for (name, values) in [("u", &mut u), ("v", &mut v)] {
            if row.optional(name).is_some() {
                values[dof] = row.number(name)?;
            }
        }
    }
    Ok([u, v])
}

/// Forces of time on the dofs.
struct Load {
    constant: Vec<f64>,
    /// Times and forces of each dof that has a history.
    histories: Vec<(usize, Vec<(f64, f64)>)>,
}

impl Load {
    fn new(dofs: usize) -> Self {
        Self { constant: vec![0.0; dofs], histories: Vec::new() }
    }

    fn read(&mut self, path: &Path, dofs: usize) -> Result<()> {
        let table = Table::read(path, &["dof", "force"], &["time"])?;
        let mut histories: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
        for row in table.rows() {
            let (dof, force) = (row.dof("dof", dofs)?, row.number("force")?);
            if !table.has("time") {
                self.constant[dof] += force;
                continue;
            }
            let (time, history) = (row.number("time")?, histories.entry(dof).or_default());
            match history.last() {
                Some(&(last, _)) if time <= last => {
                    let what = format!("time {time:?} of dof {} is not after {last:?}; times ascend", dof + 1);
                    return Err(row.refused(what));
                }
                _ => history.push((time, force)),
            }
        }
        self.histories = histories.into_iter().collect();
        Ok(())
    }

    /// M g, with g repeated node by node.
    fn add_gravity(&mut self, gravity: &[f64], mass: &Masses) -> Result<()> {
        let (dofs, size) = (self.constant.len(), gravity.len());
        if size == 0 || dofs % size != 0 {
            let what = format!("--gravity has {size} components, but {dofs} dofs are no multiple of that");
            return Err(Refusal::new(format!("{what}; give the load by --load")));
        }
        if let Some(component) = gravity.iter().find(|component| !component.is_finite()) {
            return Err(Refusal::new(format!("--gravity is {component}, it must be finite")));
        }
        let along: Vec<_> = (0..dofs).map(|dof| gravity[dof % size]).collect();
        let mass = match mass {
            Masses::Lumped(mass) => Mass::Lumped(mass),
            Masses::Consistent(mass) => Mass::Consistent(mass.as_ref()),
        };
        mass.product(1.0, &along, &mut self.constant).map_err(|error| Refusal::new(format!("--gravity: {error}")))
    }

    fn is_none(&self) -> bool {
        self.histories.is_empty() && self.constant.iter().all(|&force| force == 0.0)
    }

    fn at(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.constant);
        for (dof, history) in &self.histories {
            out[*dof] += between(history, t);
        }
    }
}

/// The value at t of points that are joined by straight lines, and constant beyond the first and the last.
fn between(points: &[(f64, f64)], t: f64) -> f64 {
    let after = points.partition_point(|point| point.0 <= t);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (Some((t0, f0)), Some(&(t1, f1))) => f0 + (f1 - f0) * ((t - t0) / (t1 - t0)),
        (Some((_, force)), None) | (None, Some(&(_, force))) => force,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_are_linear_between_their_times() {
        let points = [(1.0, 10.0), (2.0, 30.0), (4.0, -10.0)];
        for (t, force) in [(0.0, 10.0), (1.0, 10.0), (1.5, 20.0), (2.0, 30.0), (3.0, 10.0), (4.0, -10.0), (9.0, -10.0)]
        {
            assert!((between(&points, t) - force).abs() < 1e-14, "{t}");
        }
    }
}
