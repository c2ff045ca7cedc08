//! Systems from their descriptions in Python (systems.py), and masses of presets.

use crate::arrays::{ANY, floats, indices, matrix, shape};
use crate::callback::{fallible, fill, infallible};
use crate::error::{Result, refused, unexpected};
use crate::named;
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{LinearSystem, Mass, System, TangentWeights, mass};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::collections::BTreeMap;

type Object<'py> = Bound<'py, PyAny>;
type Linear = LinearSystem<'static, f64>;

/// The attributes that both kinds of systems have.
#[derive(FromPyObject)]
#[expect(non_snake_case, reason = "the name of the literature")]
struct Common<'py> {
    M: Object<'py>,
    load: Option<Object<'py>>,
    fixed: Object<'py>,
    driven: BTreeMap<usize, Py<PyAny>>,
}

#[derive(FromPyObject)]
#[expect(non_snake_case, reason = "the name of the literature")]
struct Damping<'py> {
    C: Option<Object<'py>>,
    rayleigh: Option<(f64, f64)>,
}

/// A system of its own for a simulation.
pub(crate) fn build(system: &Object<'_>) -> Result<Box<dyn System<f64>>> {
    match &*system.get_type().name()?.to_string() {
        "LinearSystem" => {
            let linear = with_stiffness(system.extract()?, matrix(&system.getattr("K")?, "the stiffness matrix")?)?;
            Ok(Box::new(match system.extract()? {
                Damping { C: None, rayleigh: None } => linear,
                Damping { C: Some(damping), rayleigh: None } => {
                    linear.damping(matrix(&damping, "the damping matrix")?)?
                }
                Damping { C: None, rayleigh: Some((mass, stiffness)) } => linear.rayleigh(mass, stiffness)?,
                Damping { .. } => {
                    return Err(refused("C and rayleigh are both given; the damping is one of them").into());
                }
            }))
        }
        "NonlinearSystem" => {
            let [force, tangent] = [system.getattr("internal_force")?, system.getattr("tangent")?];
            let dofs = shape(&system.getattr("M")?)?.first().copied().unwrap_or(0);
            let at_rest = tangent.call1((PyArray1::from_vec(system.py(), vec![0.0; dofs]),))?;
            let linear = with_stiffness(system.extract()?, matrix(&at_rest, "the tangent")?)?;
            let potential = Some(system.getattr("potential")?).filter(|given| !given.is_none()).map(Bound::unbind);
            Ok(Box::new(Callbacks { linear, force: force.unbind(), tangent: tangent.unbind(), potential }))
        }
        _ => Err(unexpected("the system", system, "LinearSystem or NonlinearSystem")),
    }
}

fn with_stiffness(given: Common<'_>, stiffness: SparseColMat<usize, f64>) -> Result<Linear> {
    let mut system = match shape(&given.M)?.len() {
        1 => Linear::lumped(floats(&given.M, "the mass", &[ANY])?, stiffness)?,
        _ => Linear::new(matrix(&given.M, "the mass matrix")?, stiffness)?,
    };
    if let Some(load) = given.load {
        system = if load.is_callable() {
            let load = load.unbind();
            system.try_load(move |t, out| fallible("load", |py| fill(&load, py, (t,), ("the load", out))))
        } else {
            let load = floats(&load, "the load", &[system.dofs()])?;
            system.load(move |_, out| out.copy_from_slice(&load))
        };
    }
    for dof in indices(&given.fixed, "the list of fixed dofs", &[ANY])? {
        system = system.fix(dof)?;
    }
    for (dof, motion) in given.driven {
        let at = move |t: f64| {
            let mut values = [0.0; 3];
            fallible("drive", |py| fill(&motion, py, (t,), ("the motion of a dof", &mut values)))?;
            Ok(values)
        };
        system = system.try_drive(dof, at)?;
    }
    Ok(system)
}

/// A system whose internal forces are Python functions; the linear one has the rest.
struct Callbacks {
    linear: Linear,
    force: Py<PyAny>,
    tangent: Py<PyAny>,
    potential: Option<Py<PyAny>>,
}

impl System<f64> for Callbacks {
    fn dofs(&self) -> usize {
        self.linear.dofs()
    }

    fn mass(&self) -> Mass<'_, f64> {
        self.linear.mass()
    }

    fn force(&mut self, t: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> contact_dynamics::Result<()> {
        let mut load = vec![0.0; out.len()];
        self.linear.external_load(t, &mut load)?;
        fallible("internal_force", |py| {
            fill(&self.force, py, (PyArray1::from_slice(py, u),), ("the internal force", out))
        })?;
        out.iter_mut().zip(load).for_each(|(out, load)| *out = load - *out);
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.linear.pattern()
    }

    fn tangent(
        &mut self,
        _: f64,
        u: &[f64],
        _: &[f64],
        weights: TangentWeights<f64>,
        out: &mut [f64],
    ) -> contact_dynamics::Result<()> {
        let pattern = self.linear.pattern();
        fallible("tangent", |py| {
            let tangent = self.tangent.bind(py).call1((PyArray1::from_slice(py, u),))?;
            scatter(&matrix(&tangent, "the tangent")?, pattern, weights.stiffness, out)
        })
    }

    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let potential = self.potential.as_ref()?;
        Some(infallible(f64::NAN, |py| potential.bind(py).call1((PyArray1::from_slice(py, u),))?.extract()))
    }

    fn external_load(&mut self, t: f64, out: &mut [f64]) -> contact_dynamics::Result<()> {
        self.linear.external_load(t, out)
    }

    fn prescribed(&self) -> &[usize] {
        self.linear.prescribed()
    }

    fn prescribed_motion(&mut self, t: f64, out: &mut [[f64; 3]]) -> contact_dynamics::Result<()> {
        self.linear.prescribed_motion(t, out)
    }
}

/// `out = weight · matrix`, in the order of a pattern that may have more entries.
fn scatter(
    matrix: &SparseColMat<usize, f64>,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    weight: f64,
    out: &mut [f64],
) -> PyResult<()> {
    if matrix.nrows() != pattern.nrows() {
        return Err(refused(format!("the tangent has {} rows, expected {}", matrix.nrows(), pattern.nrows())));
    }
    out.fill(0.0);
    for entry in matrix.as_ref().triplet_iter() {
        let (row, column) = (entry.row, entry.col);
        let Ok(place) = pattern.row_idx_of_col_raw(column).binary_search(&row) else {
            let text = "is not among those of tangent(0): store it there";
            return Err(refused(format!("the entry ({row}, {column}) of the tangent {text}")));
        };
        out[pattern.col_ptr()[column] + place] = weight * entry.val;
    }
    Ok(())
}

/// The mass matrix that goes with a preset ("smooth", "conservative", "explicit"): a `scipy.sparse.csc_array`.
///
/// M, K: consistent mass and stiffness, (n, n) sparse. step: the step size of the run (time).
/// contact_dofs: dofs that become massless: of the contact nodes in the normal direction if it is along an axis,
///     otherwise, and with friction, in all directions.
/// groups: (n) integers, one number for each body and direction.
#[pyfunction]
#[expect(non_snake_case, reason = "the names of the literature")]
pub(crate) fn preset_mass<'py>(
    name: &str,
    M: &Object<'py>,
    K: &Object<'py>,
    step: f64,
    contact_dofs: &Object<'py>,
    groups: &Object<'py>,
) -> Result<Object<'py>> {
    let missing = || refused(format!("there is no preset \"{name}\"; the names are smooth, conservative, explicit"));
    let preset = named::preset(name).ok_or_else(missing)?;
    let (mass, k) = (matrix(M, "the mass matrix")?, matrix(K, "the stiffness matrix")?);
    let contact = indices(contact_dofs, "the contact dofs", &[ANY])?;
    let courant = mass::courant(Mass::Consistent(mass.as_ref()), k.as_ref(), step)?;
    let courant = contact.iter().filter_map(|&dof| courant.get(dof)).fold(0.0, |largest, &c| f64::max(largest, c));
    let groups = indices(groups, "the groups", &[mass.nrows()])?;
    let made = preset.mass(mass.as_ref(), k.symbolic(), &contact, &groups, courant)?;
    let list = |indices: &[usize]| PyArray1::from_slice(M.py(), indices);
    let arrays = (PyArray1::from_slice(M.py(), made.val()), list(made.row_idx()), list(made.col_ptr()));
    Ok(M.py().import("scipy.sparse")?.call_method1("csc_array", (arrays, (made.nrows(), made.ncols())))?)
}
