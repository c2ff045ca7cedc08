//! The contacts of a model. Each is made once when it is added, so that its errors are found there, and once for each
//! run.

use crate::callback::{Callback, Gap};
use crate::error::{Result, Status, invalid};
use crate::memory::{array, dofs, floats, text};
use crate::model::{Description, Matrix, Model, of_model};
use crate::named;
use contact_dynamics::Error;
use contact_dynamics::LinearRows;
use contact_dynamics::contact::{
    BodyContact, ContactConstraint, ContactLaw, Facet, GapFunction, NodesOnObstacle, Plane, Side, Sphere,
    SurfaceSettings,
};
use std::ffi::{c_char, c_void};

type Constraints = Vec<Box<dyn ContactConstraint<f64>>>;
/// Makes a contact, for each run a new one.
pub(crate) type MakeContact = Box<dyn Fn() -> contact_dynamics::Result<Constraints> + Send>;

/// The nodes of a mesh.
#[repr(C)]
pub struct Mesh {
    /// 2 or 3.
    pub dimension: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Reference coordinates, node by node (nodes × dimension; length).
    pub coordinates: *const f64,
    /// Dofs of the displacements, node by node (nodes × dimension). NULL: 0, 1, 2 and so on.
    pub dofs: *const usize,
}

/// Facets of a surface: segments, triangles or quadrangles. Normals point out of the body: a segment runs with
/// the body on its left, the nodes of the others are counterclockwise as seen from outside.
#[repr(C)]
pub struct Facets {
    /// Number of facets.
    pub count: usize,
    /// Nodes of each facet: 2, 3 or 4.
    pub nodes_per_facet: usize,
    /// Their nodes, facet by facet (count × nodes_per_facet).
    pub nodes: *const usize,
}

/// How surfaces act on each other.
#[repr(C)]
pub struct Surface {
    /// Coulomb's coefficient μ; 0 without friction.
    pub friction: f64,
    /// The contact law by its name and parameters, as "penalty stiffness=1e6". NULL: "rigid".
    pub law: *const c_char,
}

impl Surface {
    /// Friction and law; NULL is rigid, without friction.
    unsafe fn read(surface: Option<&Self>) -> Result<(f64, ContactLaw)> {
        let Some(surface) = surface else { return Ok((0.0, ContactLaw::Rigid)) };
        if !(surface.friction >= 0.0 && surface.friction.is_finite()) {
            let (name, value, range) = ("the friction coefficient", surface.friction, "finite and not negative");
            return Err(Error::Parameter { name, value, range }.into());
        }
        // SAFETY: promised by the caller.
        Ok((surface.friction, named::law(unsafe { text(surface.law, "rigid", "the contact law") }?)?))
    }
}

impl Description {
    /// Adds a contact that can be made.
    fn contact(&mut self, make: impl Fn() -> contact_dynamics::Result<Constraints> + Send + 'static) -> Result<()> {
        make()?;
        self.contacts.push(Box::new(make));
        Ok(())
    }
}

type Entries = Vec<Vec<(usize, f64)>>;

/// The (dof, weight) pairs of rows.
unsafe fn rows(matrix: Option<&Matrix>, what: &'static str, size: usize) -> Result<Entries> {
    let matrix = matrix.ok_or_else(|| invalid(format!("{what}: the matrix is NULL")))?;
    // SAFETY: promised by the caller.
    let ((indptr, indices, data), _) =
        unsafe { (matrix.arrays(what)?, dofs((matrix.indices, matrix.entries), what, size)?) };
    if indptr[0] != 0 || !indptr.is_sorted() || indptr[matrix.rows] != matrix.entries {
        return Err(invalid(format!("{what}: indptr does not rise from 0 to the {} entries", matrix.entries)));
    }
    let row = |ends: &[usize]| (ends[0]..ends[1]).map(|k| (indices[k], data[k])).collect();
    Ok(indptr.windows(2).map(row).collect())
}

/// Adds contacts with the gaps G u + gaps ≥ 0. G (dofs are its columns) has a row for each contact, along which its
/// force acts; gaps (one for each row; length) are those at u = 0. `tangents` has one or two rows for each row of G,
/// along which bodies slide, contact after contact; NULL without friction. With the law "equality" gaps stay zero.
///
/// The laws of all contacts: "rigid", "restitution coefficient=…", "penalty stiffness=…", "power stiffness=…
/// exponent=…", "hertz modulus=… radius=…", "kelvin-voigt stiffness=… damping=…", "hunt-crossley stiffness=…
/// dissipation=… exponent=1.5", "rate-condition", "persistency-switch", "bipenalty stiffness=… mass=…",
/// "stabilized-bipenalty stiffness=…".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_rows(
    model: *mut Model,
    g: Option<&Matrix>,
    gaps: *const f64,
    tangents: Option<&Matrix>,
    surface: Option<&Surface>,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let normal = rows(g, "the contact rows", model.dofs)?;
            let tangents = tangents.map(|given| rows(Some(given), "the tangents", model.dofs)).transpose()?;
            let tangents = tangents.unwrap_or_default();
            let gaps = floats(gaps, normal.len(), "the gaps of the contact rows")?.to_vec();
            let (friction, law) = Surface::read(surface)?;
            let each = tangents.len() / normal.len().max(1);
            if tangents.len() != each * normal.len() || each > 2 {
                let (rows, tangents) = (normal.len(), tangents.len());
                return Err(invalid(format!(
                    "the number of tangents is {tangents}, expected one or two for {rows} rows"
                )));
            }
            if friction != 0.0 && each == 0 {
                return Err(invalid(format!("the rows have the friction {friction} but no tangents")));
            }
            model.contact(move || {
                let mut built = LinearRows::new();
                for (row, (entries, gap)) in normal.iter().zip(&gaps).enumerate() {
                    built = built.row(law, entries, *gap);
                    if friction != 0.0 {
                        let tangents = tangents[each * row..each * (row + 1)].iter().map(Vec::as_slice);
                        built = built.friction(friction, &tangents.collect::<Vec<_>>());
                    }
                }
                Ok(vec![Box::new(built)])
            })
        })
    }
}

/// Adds a contact whose gap is a function of the displacements of `count` dofs. `size` is the magnitude of the
/// coordinates that it uses (length): gaps within their rounding are zero; 0 if its gaps are exact. The friction of the
/// surface must be 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_gap(
    model: *mut Model,
    on: *const usize,
    count: usize,
    gap: Gap,
    user: *mut c_void,
    size: f64,
    surface: Option<&Surface>,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let function = gap.ok_or_else(|| invalid("the gap is NULL"))?;
            let (on, (friction, law)) =
                (dofs((on, count), "the list of dofs of a gap", model.dofs)?.to_vec(), Surface::read(surface)?);
            if friction != 0.0 {
                return Err(invalid(format!("a gap by a function has the friction {friction}, expected 0")));
            }
            let callback = Callback { function, user };
            model.contact(move || {
                let call = move |t: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| callback.gap(t, x, v, gradient);
                let built = GapFunction::fallible(&on, call).with_law(law);
                Ok(vec![Box::new(if size == 0.0 { built } else { built.scale(size)? })])
            })
        })
    }
}

/// A mesh in D dimensions: coordinates and dofs of its nodes.
type Nodes<const D: usize> = (Vec<[f64; D]>, Vec<[usize; D]>);

/// The nodes of a mesh in D dimensions.
unsafe fn nodes<const D: usize>(mesh: &Mesh, size: usize) -> Result<Nodes<D>> {
    let count = mesh.nodes.checked_mul(D).ok_or_else(|| invalid("the mesh has too many nodes"))?;
    // SAFETY: promised by the caller.
    let (coordinates, given) = unsafe {
        let given = if mesh.dofs.is_null() { 0 } else { count };
        (floats(mesh.coordinates, count, "the coordinates")?, array(mesh.dofs, given, "the dofs of the nodes")?)
    };
    let all: Vec<usize> = if mesh.dofs.is_null() { (0..count).collect() } else { given.to_vec() };
    match all.iter().find(|&&dof| dof >= size) {
        Some(&dof) => Err(Error::MissingDof { what: "the mesh", dof, dofs: size }.into()),
        None => Ok((coordinates.as_chunks().0.to_vec(), all.as_chunks().0.to_vec())),
    }
}

/// The mesh, in two or three dimensions.
fn checked(mesh: Option<&Mesh>) -> Result<&Mesh> {
    match mesh {
        None => Err(invalid("the mesh is NULL")),
        Some(mesh @ Mesh { dimension: 2 | 3, .. }) => Ok(mesh),
        Some(mesh) => Err(invalid(format!("the dimension of the mesh is {}, expected 2 or 3", mesh.dimension))),
    }
}

#[derive(Clone)]
enum Body {
    Plane { at: Vec<f64>, normal: Vec<f64> },
    Sphere { center: Vec<f64>, radius: f64, side: Side },
}

/// Adds the contact of nodes with a body.
unsafe fn on_body<const D: usize>(
    model: &mut Description,
    mesh: &Mesh,
    (list, count): (*const usize, usize),
    surface: Option<&Surface>,
    body: Body,
) -> Result<()> {
    // SAFETY: promised by the caller.
    let (mesh, list, (friction, law)) = unsafe {
        (nodes::<D>(mesh, model.dofs)?, array(list, count, "the list of nodes")?.to_vec(), Surface::read(surface)?)
    };
    model.contact(move || {
        let place = |values: &[f64]| std::array::from_fn(|axis| values[axis]);
        let body: Box<dyn contact_dynamics::contact::Obstacle<f64, D>> = match &body {
            Body::Plane { at, normal } => Box::new(Plane::new(place(at), place(normal))?),
            Body::Sphere { center, radius, side } => Box::new(Sphere::new(place(center), *radius, *side)?),
        };
        let built = NodesOnObstacle::new(body, &mesh.0, &mesh.1, &list)?.with_law(law).friction(friction);
        Ok(vec![Box::new(built)])
    })
}

/// Adds the contact of nodes with a half-space through `at` (dimension; length), from which `normal` (dimension) points
/// out.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_plane(
    model: *mut Model,
    mesh: Option<&Mesh>,
    nodes: *const usize,
    count: usize,
    at: *const f64,
    normal: *const f64,
    surface: Option<&Surface>,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let mesh = checked(mesh)?;
            let at = floats(at, mesh.dimension, "the place of the plane")?.to_vec();
            let normal = floats(normal, mesh.dimension, "the normal of the plane")?.to_vec();
            let on_body = if mesh.dimension == 2 { on_body::<2> } else { on_body::<3> };
            on_body(model, mesh, (nodes, count), surface, Body::Plane { at, normal })
        })
    }
}

/// Adds the contact of nodes with a ball (in two dimensions a disc), or with its wall if they are inside of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_sphere(
    model: *mut Model,
    mesh: Option<&Mesh>,
    nodes: *const usize,
    count: usize,
    center: *const f64,
    radius: f64,
    inside: bool,
    surface: Option<&Surface>,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let mesh = checked(mesh)?;
            let side = if inside { Side::Inside } else { Side::Outside };
            let center = floats(center, mesh.dimension, "the center of the sphere")?.to_vec();
            let on_body = if mesh.dimension == 2 { on_body::<2> } else { on_body::<3> };
            on_body(model, mesh, (nodes, count), surface, Body::Sphere { center, radius, side })
        })
    }
}

/// The facets of a surface.
unsafe fn facets(given: &Facets) -> Result<Vec<Facet>> {
    let count = given.count.checked_mul(given.nodes_per_facet).ok_or_else(|| invalid("too many facets"))?;
    // SAFETY: promised by the caller.
    let nodes = unsafe { array(given.nodes, count, "the nodes of the facets") }?;
    match given.nodes_per_facet {
        2 => Ok(nodes.as_chunks::<2>().0.iter().map(|&nodes| Facet::from(nodes)).collect()),
        3 => Ok(nodes.as_chunks::<3>().0.iter().map(|&nodes| Facet::from(nodes)).collect()),
        4 => Ok(nodes.as_chunks::<4>().0.iter().map(|&nodes| Facet::from(nodes)).collect()),
        other => Err(invalid(format!("a facet has {other} nodes, expected 2, 3 or 4"))),
    }
}

/// Adds the contact between two surfaces.
unsafe fn between<const D: usize>(
    model: &mut Description,
    mesh: &Mesh,
    [slave, master]: [Option<&Facets>; 2],
    surface: Option<&Surface>,
) -> Result<()> {
    let slave = slave.ok_or_else(|| invalid("the slave facets are NULL"))?;
    // SAFETY: promised by the caller.
    let ((coordinates, dofs), slave, master, (friction, law)) = unsafe {
        let master = master.map(|master| facets(master)).transpose()?;
        (nodes::<D>(mesh, model.dofs)?, facets(slave)?, master, Surface::read(surface)?)
    };
    model.contact(move || {
        let slave = slave.iter().copied();
        let contact = match &master {
            Some(master) => BodyContact::new(&coordinates, &dofs, slave, master.iter().copied())?,
            None => BodyContact::of_itself(&coordinates, &dofs, slave)?,
        };
        contact.with(SurfaceSettings::new().law(law).friction(friction))?.constraints()
    })
}

/// Adds the contact between two surfaces of a mesh, or of one with itself if `master` is NULL. It is several
/// constraints.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_bodies(
    model: *mut Model,
    mesh: Option<&Mesh>,
    slave: Option<&Facets>,
    master: Option<&Facets>,
    surface: Option<&Surface>,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let mesh = checked(mesh)?;
            let between = if mesh.dimension == 2 { between::<2> } else { between::<3> };
            between(model, mesh, [slave, master], surface)
        })
    }
}
