//! A series for ParaView: a .vtu file for each picture, and the .pvd file that lists them with their times.

use crate::Result;
use crate::mesh::{Mesh, Shape};
use crate::scene;
use contact_dynamics::contact::Surface;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, ElementType, IOBuffer,
    UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

/// What a picture shows, in SI units: vectors of all nodes one after the other, stress and part by element.
pub struct Picture<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    /// Contact forces on the nodes.
    pub force: &'a [f64],
    pub von_mises: &'a [f64],
}

/// The series of a run. Of one that goes on the list holds the pictures before as well.
pub struct Series {
    directory: PathBuf,
    /// Time and file of each picture.
    pub list: Vec<(f64, String)>,
    points: Vec<f32>,
    cells: Cells,
    part: Vec<u8>,
    surface: Surface,
}

impl Series {
    /// The first `elements` elements are the part's; `surface` has the facets of all parts.
    pub fn new(
        directory: &Path,
        (mesh, surface): (&Mesh, &[Vec<usize>]),
        elements: usize,
        list: Vec<(f64, String)>,
    ) -> Result<Self> {
        let connectivity = mesh.elements.iter().flat_map(|e| e.nodes().iter().map(|&node| node as u64)).collect();
        let offsets = mesh.elements.iter().scan(0, |end, e| {
            *end += e.nodes().len() as u64;
            Some(*end)
        });
        let kind = |shape: Shape| match shape {
            Shape::Tetrahedron => CellType::Tetra,
            Shape::Hexahedron => CellType::Hexahedron,
        };
        Ok(Self {
            directory: directory.into(),
            list,
            points: narrow(mesh.nodes.as_flattened()),
            cells: Cells {
                cell_verts: VertexNumbers::XML { connectivity, offsets: offsets.collect() },
                types: mesh.elements.iter().map(|e| kind(e.shape)).collect(),
            },
            part: (0..mesh.elements.len()).map(|e| u8::from(e >= elements)).collect(),
            surface: Surface::new(&mesh.nodes, surface.iter().map(|facet| scene::facet(facet)))?,
        })
    }

    /// Writes a picture.
    pub fn add(&mut self, time: f64, mesh: &Mesh, picture: &Picture<'_>) -> Result<()> {
        let pressure = pressure(mesh, &self.surface, picture)?;
        let piece = UnstructuredGridPiece {
            points: self.points.clone().into(),
            cells: self.cells.clone(),
            data: Attributes {
                point: vec![
                    vector("displacement", picture.displacement),
                    vector("velocity", picture.velocity),
                    vector("contact_force", picture.force),
                    scalar("contact_pressure", narrow(&pressure)),
                ],
                cell: vec![scalar("von_mises", narrow(picture.von_mises)), scalar("part", self.part.clone())],
            },
        };
        let name = format!("picture_{:04}.vtu", self.list.len());
        let path = self.directory.join(&name);
        let file = Vtk {
            version: Version::new(),
            byte_order: ByteOrder::native(),
            title: String::new(),
            file_path: None,
            data: DataSet::inline(piece),
        };
        file.export(&path).map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
        self.list.push((time, name));
        self.write_list()
    }

    fn write_list(&self) -> Result<()> {
        let mut text =
            String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n");
        for (time, name) in &self.list {
            writeln!(text, "<DataSet timestep=\"{time:e}\" part=\"0\" file=\"{name}\"/>")?;
        }
        text += "</Collection>\n</VTKFile>\n";
        let path = self.directory.join("series.pvd");
        Ok(std::fs::write(&path, text).map_err(|error| format!("{} cannot be written: {error}", path.display()))?)
    }
}

/// A named array of numbers of nodes or elements.
fn array(name: &str, kind: ElementType, data: impl Into<IOBuffer>) -> Attribute {
    Attribute::DataArray(DataArray { name: name.into(), elem: kind, data: data.into() })
}

fn scalar(name: &str, data: impl Into<IOBuffer>) -> Attribute {
    array(name, ElementType::Scalars { num_comp: 1, lookup_table: None }, data)
}

fn vector(name: &str, values: &[f64]) -> Attribute {
    array(name, ElementType::Vectors, narrow(values))
}

fn narrow(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&x| x as f32).collect()
}

/// Pressure (Pa) at each node of the mesh, where the surface is now.
fn pressure(mesh: &Mesh, surface: &Surface, picture: &Picture<'_>) -> Result<Vec<f64>> {
    let vectors = |x: &[f64]| x.chunks(3).map(|x| [x[0], x[1], x[2]]).collect::<Vec<_>>();
    let mut positions = vectors(picture.displacement);
    positions.iter_mut().zip(&mesh.nodes).for_each(|(u, x)| *u = [0, 1, 2].map(|i| x[i] + u[i]));
    let mut pressures = vec![0.0; mesh.nodes.len()];
    for (&node, pressure) in surface.nodes().iter().zip(surface.pressures(&positions, &vectors(picture.force))?) {
        pressures[node] = pressure;
    }
    Ok(pressures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gmsh;

    #[test]
    fn a_picture_is_read_back_as_it_was() {
        let mesh = gmsh::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/jack.msh"), 1e-3).unwrap();
        let directory = std::env::temp_dir().join(format!("drop_test_series_{}", std::process::id()));
        std::fs::create_dir_all(&directory).unwrap();
        let count = mesh.nodes.len();
        let vector: Vec<f64> = (0..3 * count).map(|k| k as f64).collect();
        let (zero, stress) = (vec![0.0; 3 * count], vec![2.5; mesh.elements.len()]);
        // A pressure of 3 Pa on the whole surface. (Of triangles: a third of each is its node's.)
        let surface = mesh.boundary();
        let mut force = vec![0.0; 3 * count];
        for facet in &surface {
            let area = mesh.area(facet);
            for &node in facet {
                (0..3).for_each(|i| force[3 * node + i] -= 3.0 * area[i] / facet.len() as f64);
            }
        }
        let picture = Picture { displacement: &zero, velocity: &vector, force: &force, von_mises: &stress };
        let mut series = Series::new(&directory, (&mesh, &surface), mesh.elements.len(), Vec::new()).unwrap();
        series.add(0.25, &mesh, &picture).unwrap();

        let read = Vtk::import(directory.join("picture_0000.vtu")).unwrap();
        let DataSet::UnstructuredGrid { pieces, .. } = read.data else { panic!("an unstructured grid") };
        let piece = pieces.into_iter().next().unwrap().into_loaded_piece_data(None).unwrap();
        assert_eq!((piece.num_points(), piece.cells.types.len()), (count, mesh.elements.len()));
        let values = |list: &[Attribute], name: &str| -> Vec<f32> {
            let found = list.iter().find_map(|attribute| match attribute {
                Attribute::DataArray(array) if array.name == name => array.data.clone().cast_into(),
                _ => None,
            });
            found.unwrap()
        };
        assert_eq!(values(&piece.data.point, "velocity"), narrow(&vector));
        assert_eq!(values(&piece.data.cell, "von_mises"), narrow(&stress));
        let pressure = values(&piece.data.point, "contact_pressure");
        let surface_node = |node: usize| surface.iter().any(|facet| facet.contains(&node));
        let right = |(node, p): (usize, &f32)| (p - if surface_node(node) { 3.0 } else { 0.0 }).abs() < 1e-5;
        assert!(pressure.iter().enumerate().all(right), "{pressure:?}");
        let list = std::fs::read_to_string(directory.join("series.pvd")).unwrap();
        assert!(list.contains("timestep=\"2.5e-1\"") && list.contains("picture_0000.vtu"), "{list}");
        std::fs::remove_dir_all(&directory).unwrap();
    }
}
