//! The slab as a file that ParaView opens.

use crate::grid::Grid;
use contact_dynamics::Simulation;
use std::fs::File;
use std::io::{BufWriter, Result, Write};
use std::path::Path;

/// Nodes of a cube in VTK's order, by offsets of 0 or 1 along the axes.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// VTK's number of hexahedra.
const HEXAHEDRON: u8 = 12;

/// Writes cubes, displacements, velocities and contact forces of a state (VTU with appended raw data).
pub(crate) fn write(path: &Path, grid: &Grid, run: &Simulation<'_, f64>) -> Result<()> {
    let mut forces = vec![0.0; grid.dofs()];
    for contact in run.contact_forces() {
        contact.forces().for_each(|(dof, force)| forces[dof] += force);
    }
    let [x, y, z] = grid.cells;
    let cubes = (0..x).flat_map(|i| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k])));
    let connectivity = cubes
        .flat_map(|[i, j, k]| CORNERS.map(|[a, b, c]| grid.node([i + a, j + b, k + c])))
        .flat_map(|node| (node as u64).to_le_bytes());
    let cubes = x * y * z;
    let vector = |values: &[f64]| values.iter().flat_map(|x| x.to_le_bytes()).collect();
    let places = grid.places().flatten().flat_map(|at| (grid.size * at as f64).to_le_bytes());
    let blocks: [Vec<u8>; 7] = [
        places.collect(),
        vector(run.state().displacement()),
        vector(run.state().velocity()),
        vector(&forces),
        connectivity.collect(),
        (1..=cubes).flat_map(|cube| (8 * cube as u64).to_le_bytes()).collect(),
        vec![HEXAHEDRON; cubes],
    ];
    // Each block follows its own length.
    let mut offset = 0;
    let offsets = blocks.each_ref().map(|block| {
        let own = offset;
        offset += size_of::<u64>() + block.len();
        own
    });
    let array = |kind: &str, name: &str, components: usize, block: usize| {
        let offset = offsets[block];
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" \
             offset=\"{offset}\"/>"
        )
    };
    let mut file = BufWriter::new(File::create(path)?);
    writeln!(
        file,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{cubes}\">\n\
         <Points>{}</Points>\n<PointData>{}{}{}</PointData>\n<Cells>{}{}{}</Cells>\n</Piece></UnstructuredGrid>\n\
         <AppendedData encoding=\"raw\">",
        grid.dofs() / 3,
        array("Float64", "points", 3, 0),
        array("Float64", "displacement", 3, 1),
        array("Float64", "velocity", 3, 2),
        array("Float64", "contact_force", 3, 3),
        array("UInt64", "connectivity", 1, 4),
        array("UInt64", "offsets", 1, 5),
        array("UInt8", "types", 1, 6),
    )?;
    write!(file, "_")?;
    for block in blocks {
        file.write_all(&(block.len() as u64).to_le_bytes())?;
        file.write_all(&block)?;
    }
    writeln!(file, "\n</AppendedData>\n</VTKFile>")?;
    file.flush()
}
