//! Constraints and obstacles from their descriptions in Python (contacts.py).

use crate::arrays::{ANY, floats, indices, rows, shape};
use crate::callback::{fill, infallible};
use crate::error::{Result, refused, unexpected};
use crate::named;
use contact_dynamics::LinearRows as Rows;
use contact_dynamics::contact::{
    self, ContactConstraint, Cuboid, Facet, GapOffset, Plane, Side, Sphere, Surface, SurfaceSettings,
};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::collections::BTreeMap;

type Object<'py> = Bound<'py, PyAny>;
type Constraints = Vec<Box<dyn ContactConstraint<f64>>>;

/// The constraints of a description.
pub(crate) fn build(contact: &Object<'_>) -> Result<Constraints> {
    let name = contact.get_type().name()?.to_string();
    if name == "LinearRows" {
        return Ok(vec![Box::new(linear_rows(contact.getattr("rows")?.extract()?)?)]);
    }
    let Ok(coordinates) = contact.getattr("coordinates") else {
        return Err(unexpected("a contact", contact, "LinearRows, NodesOnObstacle or BodyContact"));
    };
    let shape = shape(&coordinates)?;
    match (&*name, &shape[..]) {
        ("NodesOnObstacle", [_, 2]) => nodes_on_obstacle::<2>(contact.extract()?),
        ("NodesOnObstacle", [_, 3]) => nodes_on_obstacle::<3>(contact.extract()?),
        (_, [_, 2]) => between_bodies::<2>(contact.extract()?),
        (_, [_, 3]) => between_bodies::<3>(contact.extract()?),
        _ => Err(refused(format!("{name}: coordinates have the shape {shape:?}, expected [any, 2 or 3]")).into()),
    }
}

/// Coordinates and dofs of the nodes of a mesh; dofs are numbered node by node if they are not given.
type Mesh<const D: usize> = (Vec<[f64; D]>, Vec<[usize; D]>);

fn mesh<const D: usize>(coordinates: &Object<'_>, dofs: Option<&Object<'_>>) -> PyResult<Mesh<D>> {
    let coordinates = rows(&floats(coordinates, "the coordinates", &[ANY, D])?);
    let all = || Ok((0..D * coordinates.len()).collect());
    let dofs = dofs.map_or_else(all, |dofs| indices(dofs, "the dofs of the nodes", &[ANY, D]))?;
    Ok((coordinates, rows(&dofs)))
}

#[derive(FromPyObject)]
struct NodesOnObstacle<'py> {
    obstacle: Object<'py>,
    coordinates: Object<'py>,
    nodes: Object<'py>,
    dofs: Option<Object<'py>>,
    friction: f64,
    law: Object<'py>,
    reach: Option<f64>,
    motion: Option<Py<PyAny>>,
}

fn nodes_on_obstacle<const D: usize>(given: NodesOnObstacle<'_>) -> Result<Constraints> {
    let (coordinates, dofs) = mesh::<D>(&given.coordinates, given.dofs.as_ref())?;
    let nodes = indices(&given.nodes, "the list of nodes", &[ANY])?;
    let body = obstacle::<D>(&given.obstacle)?;
    let mut contact = contact::NodesOnObstacle::new(body, &coordinates, &dofs, &nodes)?
        .with_law(named::law(&given.law)?)
        .friction(given.friction);
    if let Some(reach) = given.reach {
        contact = contact.reach(reach)?;
    }
    if let Some(motion) = given.motion {
        contact = contact.moving(move |t| {
            infallible([[f64::NAN; D]; 3], |py| {
                let values = floats(&motion.bind(py).call1((t,))?, "the motion of an obstacle", &[3, D])?;
                Ok(std::array::from_fn(|row| std::array::from_fn(|axis| values[row * D + axis])))
            })
        });
    }
    Ok(vec![Box::new(contact)])
}

fn obstacle<const D: usize>(body: &Object<'_>) -> Result<Box<dyn contact::Obstacle<f64, D>>> {
    let place = |name: &str| -> PyResult<[f64; D]> {
        let values = floats(&body.getattr(name)?, &format!("{name} of an obstacle"), &[D])?;
        Ok(std::array::from_fn(|axis| values[axis]))
    };
    let number = |name: &str| body.getattr(name)?.extract::<f64>();
    match &*body.get_type().name()?.to_string() {
        "Plane" => Ok(Box::new(Plane::new(place("at")?, place("normal")?)?)),
        "Sphere" => {
            let side = if body.getattr("inside")?.is_truthy()? { Side::Inside } else { Side::Outside };
            Ok(Box::new(Sphere::new(place("center")?, number("radius")?, side)?))
        }
        "Cuboid" => Ok(Box::new(Cuboid::new(place("center")?, place("half")?, number("rounding")?)?)),
        "SignedDistance" => Ok(Box::new(body.extract::<SignedDistance>()?)),
        _ => Err(unexpected("an obstacle", body, "Plane, Sphere, Cuboid or SignedDistance")),
    }
}

/// A body given by Python functions.
#[derive(FromPyObject)]
struct SignedDistance {
    distance: Py<PyAny>,
    gradient: Py<PyAny>,
    curvature: Option<Py<PyAny>>,
}

impl<const D: usize> contact::Obstacle<f64, D> for SignedDistance {
    fn distance(&self, x: [f64; D]) -> (f64, [f64; D]) {
        infallible((f64::NAN, [f64::NAN; D]), |py| {
            let (x, mut normal) = (PyArray1::from_slice(py, &x), [0.0; D]);
            fill(&self.gradient, py, (&x,), ("the gradient of a distance", &mut normal))?;
            Ok((self.distance.bind(py).call1((&x,))?.extract()?, normal))
        })
    }

    fn curvature(&self, x: [f64; D], w: [f64; D]) -> f64 {
        let Some(curvature) = &self.curvature else { return 0.0 };
        infallible(f64::NAN, |py| {
            let [x, w] = [x, w].map(|vector| PyArray1::from_slice(py, &vector));
            curvature.bind(py).call1((x, w))?.extract()
        })
    }
}

#[derive(FromPyObject)]
struct BodyContact<'py> {
    coordinates: Object<'py>,
    slave: Object<'py>,
    master: Option<Object<'py>>,
    dofs: Option<Object<'py>>,
    friction: f64,
    law: Object<'py>,
    reach: Option<f64>,
}

fn between_bodies<const D: usize>(given: BodyContact<'_>) -> Result<Constraints> {
    let (coordinates, dofs) = mesh::<D>(&given.coordinates, given.dofs.as_ref())?;
    let (slave, master) = (facets(&given.slave)?, given.master.as_ref().map(facets).transpose()?);
    let settings = SurfaceSettings::new().law(named::law(&given.law)?).friction(given.friction);
    let contact = match master {
        Some(master) => contact::BodyContact::new(&coordinates, &dofs, slave, master)?,
        None => contact::BodyContact::of_itself(&coordinates, &dofs, slave)?,
    };
    Ok(contact.with(if let Some(reach) = given.reach { settings.reach(reach) } else { settings })?.constraints()?)
}

/// Lists of nodes: an array of shape (n, any), or a list of such arrays.
fn lists(value: &Object<'_>, what: &str) -> PyResult<Vec<Vec<usize>>> {
    let blocks: Vec<Object<'_>> = match value.get_item(0) {
        Ok(first) if shape(&first)?.len() == 2 => value.try_iter()?.collect::<PyResult<_>>()?,
        _ => vec![value.clone()],
    };
    let mut lists = Vec::new();
    for block in blocks {
        let nodes = indices(&block, what, &[ANY, ANY])?;
        lists.extend(nodes.chunks_exact(shape(&block)?[1].max(1)).map(<[usize]>::to_vec));
    }
    Ok(lists)
}

fn facets(value: &Object<'_>) -> PyResult<Vec<Facet>> {
    let facet = |nodes: Vec<usize>| match nodes[..] {
        [a, b] => Ok(Facet::from([a, b])),
        [a, b, c] => Ok(Facet::from([a, b, c])),
        [a, b, c, d] => Ok(Facet::from([a, b, c, d])),
        _ => Err(refused(format!("a facet has {} nodes, expected 2, 3 or 4", nodes.len()))),
    };
    lists(value, "the facets")?.into_iter().map(facet).collect()
}

/// The outer sides of a mesh, with normals out of the cells: a list with one (m, k) array for facets of k nodes each.
///
/// coordinates: (n, 2) or (n, 3). cells: (c, nodes of a cell) integers, corners first, or a list of such arrays. Sides
/// of cells of second order become several facets.
#[pyfunction]
pub(crate) fn outer_facets<'py>(coordinates: &Object<'py>, cells: &Object<'py>) -> Result<Vec<Object<'py>>> {
    let cells = lists(cells, "the cells")?;
    let surface = match shape(coordinates)?[..] {
        [_, 2] => Surface::of_cells(&mesh::<2>(coordinates, None)?.0, cells)?,
        _ => Surface::of_cells(&mesh::<3>(coordinates, None)?.0, cells)?,
    };
    let mut blocks: BTreeMap<usize, Vec<Vec<usize>>> = BTreeMap::new();
    for facet in surface.facets() {
        blocks.entry(facet.nodes().len()).or_default().push(facet.nodes().to_vec());
    }
    let array =
        |rows: &Vec<Vec<usize>>| PyArray2::from_vec2(coordinates.py(), rows)?.call_method1("astype", ("int64",));
    Ok(blocks.values().map(array).collect::<PyResult<_>>()?)
}

type Entries = BTreeMap<usize, f64>;

/// Entries, gap, law, strength of a bond, friction and its tangents, as `LinearRows` keeps them.
type Row<'py> = (Entries, Object<'py>, Object<'py>, Option<f64>, f64, Vec<Entries>);

fn linear_rows(rows: Vec<Row<'_>>) -> Result<Rows<'static, f64>> {
    let mut built = Rows::new();
    for (entries, gap, law, strength, friction, tangents) in rows {
        let offset = if gap.is_callable() {
            let gap = gap.unbind();
            GapOffset::moving(move |t| {
                infallible([f64::NAN; 3], |py| {
                    let mut offset = [0.0; 3];
                    fill(&gap, py, (t,), ("the gap of a row", &mut offset))?;
                    Ok(offset)
                })
            })
        } else {
            GapOffset::Constant(gap.extract()?)
        };
        let entries = Vec::from_iter(entries);
        built = match (strength, &law) {
            (Some(strength), _) => built.bond(strength, &entries, offset),
            (None, law) if law.is_none() => built.equality(&entries, offset),
            (None, law) => built.row(named::law(law)?, &entries, offset),
        };
        let tangents: Vec<Vec<_>> = tangents.into_iter().map(Vec::from_iter).collect();
        if friction != 0.0 && tangents.is_empty() {
            return Err(refused(format!("a row has the friction {friction} but no tangents")).into());
        } else if friction != 0.0 {
            built = built.friction(friction, &tangents.iter().map(Vec::as_slice).collect::<Vec<_>>());
        }
    }
    Ok(built)
}
