//! Reading of Gmsh files (format 4.1, ASCII or binary): the tetrahedra and hexahedra in them.

use crate::Result;
use crate::mesh::{Element, Mesh, Shape};
use mshio::mshfile::ElementType;
use std::collections::HashMap;
use std::path::Path;

/// Reads the volume elements of a file and the nodes that they use; lengths are multiplied by `unit` (meters).
pub fn read(path: &Path, unit: f64) -> Result<Mesh> {
    let shown = path.display();
    let bytes = std::fs::read(path).map_err(|error| format!("the mesh {shown} cannot be read: {error}"))?;
    check_format(&bytes).map_err(|reason| format!("{shown} {reason}"))?;
    // The text of the parser's error ends in a dump of bytes; before it, line by line, is what was being read.
    let file = mshio::parse_msh_bytes(&bytes).map_err(|error| {
        let text = error.to_string();
        let reading = text.lines().map(str::trim).filter_map(|line| line.strip_prefix("in ")).next_back();
        let place = reading.map_or(String::new(), |what| format!(" ({})", what.trim_end_matches([',', '.'])));
        format!("{shown} is damaged{place}: write it again with `gmsh -3 MODEL.geo -format msh41`")
    })?;
    let (Some(nodes), Some(blocks)) = (file.data.nodes, file.data.elements) else {
        return Err(format!("{shown} has no nodes or no elements: mesh the volume first, with `gmsh -3`").into());
    };

    let mut places = HashMap::new();
    for block in nodes.node_blocks {
        let tags: Vec<u64> = match block.node_tags {
            Some(map) => {
                let mut tags = vec![0; map.len()];
                map.into_iter().for_each(|(tag, index)| tags[index] = tag);
                tags
            }
            // Without a map the tags follow each other, over all blocks.
            None => (0..).map(|k| nodes.min_node_tag + (places.len() + k) as u64).take(block.nodes.len()).collect(),
        };
        for (tag, node) in tags.into_iter().zip(&block.nodes) {
            places.insert(tag, [node.x, node.y, node.z].map(|x| x * unit));
        }
    }

    let mut numbers = HashMap::new();
    let mut mesh = Mesh::default();
    for block in blocks.element_blocks {
        let Some(shape) = shape_of(block.element_type).map_err(|reason| format!("{shown} {reason}"))? else {
            continue;
        };
        for element in block.elements {
            let mut corners = [0; 8];
            for (corner, tag) in corners.iter_mut().zip(&element.nodes) {
                let place = places.get(tag).ok_or_else(|| {
                    format!("{shown}: element {} names node {tag}, which the file does not have", element.element_tag)
                })?;
                *corner = *numbers.entry(*tag).or_insert_with(|| {
                    mesh.nodes.push(*place);
                    mesh.nodes.len() - 1
                });
            }
            mesh.elements.push(Element { shape, corners, tag: element.element_tag });
        }
    }
    if mesh.elements.is_empty() {
        return Err(format!("{shown} has no tetrahedra and no hexahedra: mesh the volume, with `gmsh -3`").into());
    }
    mesh.check().map_err(|reason| format!("{shown}: {reason}"))?;
    Ok(mesh)
}

/// Refuses what is no Gmsh file of format 4.1, with the way to make it one, and numbers in the head of the file that
/// the parser takes for granted.
fn check_format(bytes: &[u8]) -> std::result::Result<(), String> {
    let mut lines = bytes.split(|byte| *byte == b'\n').map(String::from_utf8_lossy);
    if lines.next().is_none_or(|line| line.trim() != "$MeshFormat") {
        return Err("is no Gmsh mesh: it does not begin with $MeshFormat".into());
    }
    let line = lines.next().unwrap_or_default();
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["4.1", "0" | "1", "4" | "8"] => Ok(()),
        ["4.1", ..] => {
            Err("is damaged: its second line says neither `4.1 0 8` nor, for a binary file, `4.1 1 8`; write \
                            it again with `gmsh -3 MODEL.geo -format msh41`"
                .into())
        }
        _ => {
            let version = words.first().copied().unwrap_or("unknown");
            Err(format!(
                "is of Gmsh's format {version}: write format 4.1, with `gmsh IN.msh -save -format msh41 -o OUT.msh`"
            ))
        }
    }
}

/// The shape of a volume element, none for points, lines and facets; other volume elements are refused.
fn shape_of(kind: ElementType) -> std::result::Result<Option<Shape>, String> {
    use ElementType as E;
    match kind {
        E::Tet4 => Ok(Some(Shape::Tetrahedron)),
        E::Hex8 => Ok(Some(Shape::Hexahedron)),
        E::Pri6 | E::Pyr5 => Err("has prisms or pyramids: this program takes tetrahedra and hexahedra".into()),
        E::Pnt | E::Lin2 | E::Lin3 | E::Tri3 | E::Qua4 | E::Tri6 | E::Qua8 | E::Qua9 => Ok(None),
        other => Err(format!("has elements of type {other:?}: make first-order ones, with `gmsh -3 -order 1`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped(name: &str) -> Mesh {
        read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name), 1e-3).unwrap()
    }

    #[test]
    fn shipped_meshes_have_the_volume_of_their_shape() {
        // Of the bracket: two legs, the rib between them, three holes; flats exactly, holes as polygons.
        let legs = 80.0 * 40.0 * 8.0 + 8.0 * 40.0 * 52.0;
        let holes = std::f64::consts::PI * 8.0 * (36.0 + 16.0 + 16.0);
        let exact = (legs + 0.5 * 48.0 * 36.0 * 8.0 - holes) * 1e-9;
        let found = shipped("bracket.msh").volume();
        assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
        // The cup, binary: a bottom of 6 mm and a wall of 4 mm; arcs as polygons of 24 sides.
        let sector = |r: f64| 12.0 * (std::f64::consts::TAU / 24.0).sin() * r * r;
        let exact = (sector(40.0) * 6.0 + (sector(40.0) - sector(36.0)) * 84.0) * 1e-9;
        let found = shipped("cup.msh").volume();
        assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
        // The jack lies symmetrically about the origin, and is closed.
        let jack = shipped("jack.msh");
        let sum =
            jack.boundary().iter().map(|facet| jack.area(facet)).fold([0.0; 3], |s, a| [0, 1, 2].map(|i| s[i] + a[i]));
        assert!(sum.iter().all(|x| x.abs() < 1e-12), "{sum:?}");
    }

    #[test]
    fn nodes_of_no_volume_element_are_left_out() {
        let jack = shipped("jack.msh");
        let mut used = vec![false; jack.nodes.len()];
        jack.elements.iter().flat_map(Element::nodes).for_each(|&node| used[node] = true);
        assert!(used.iter().all(|used| *used));
    }
}
