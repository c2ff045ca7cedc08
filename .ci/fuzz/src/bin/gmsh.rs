//! Gmsh files of `drop-test`, ASCII and binary, with bytes changed: refused with a sentence, or a mesh whose elements
//! all have a volume.

#![no_main]

#[allow(dead_code)]
#[path = "../../../../examples/drop_test/src/gmsh.rs"]
mod gmsh;
#[allow(dead_code)]
#[path = "../../../../examples/drop_test/src/mesh.rs"]
mod mesh;

use fuzz::{Input, folder};
use libfuzzer_sys::fuzz_target;
use std::error::Error;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const BINARY: &[u8] = include_bytes!("../../../../examples/drop_test/meshes/cup.msh");

/// Two tetrahedra.
const TEXT: &str = "\
$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
1 2 1 2
3 1 4 2
1 1 2 3 4
2 2 3 4 5
$EndElements
";

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let file = match input.below(8) {
        0 => input.0.to_vec(),
        1 => input.edited(BINARY),
        _ => input.edited(TEXT.as_bytes()),
    };
    let path = folder().join("part.msh");
    std::fs::write(&path, file).expect("a file");
    match gmsh::read(&path, 1e-3) {
        Ok(mesh) => {
            assert!(mesh.volume() > 0.0 && !mesh.boundary().is_empty());
            let _ = (mesh.bounds(), mesh.thinnest(), mesh.mean_size());
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
