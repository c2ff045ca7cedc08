//! The table of contacts: which nodes meet an obstacle or each other, along which normal, with which friction.

use crate::refusal::{Refusal, Result};
use crate::table::{Row, Table};
use contact_dynamics::LinearRows;
use std::path::Path;

/// Weights of the opposite nodes must sum up to 1 within this, so that a common translation leaves the gap alone.
const SUM: f64 = 1e-6;

/// A node and what it may touch: g = n · (u − Σ w u_opposite) + g₀.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Contact {
    pub(crate) name: String,
    line: u64,
    /// The dofs of the node, one a direction.
    pub(crate) dofs: Vec<usize>,
    /// Weights and dofs of the nodes opposite; none for a rigid obstacle.
    opposite: Vec<(f64, Vec<usize>)>,
    /// From what is opposite to the node; of length 1.
    normal: Vec<f64>,
    gap: f64,
    pub(crate) friction: Option<f64>,
}

/// Reads a table; there are so many dofs.
pub(crate) fn read(path: &Path, dofs: usize) -> Result<Vec<Contact>> {
    let table = Table::read(path, &["node", "dofs", "normal", "gap"], &["friction", "opposite", "weights"])?;
    let contacts: Vec<_> = table.rows().map(|row| contact(&row, dofs)).collect::<Result<_>>()?;
    if contacts.is_empty() {
        let what = "the table has no contact; give one line a node, for instance `17,49 50,0 1,0.002` below \
                    `node,dofs,normal,gap`";
        return Err(Refusal::of(path, what));
    }
    let mut names: Vec<_> = contacts.iter().map(|contact| (&contact.name, contact.line)).collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            let (name, first) = pair[0];
            let what = format!("the node `{name}` has a contact in line {first} already; name this one `{name}b`");
            Err(Refusal::at(path, pair[1].1, what))
        }
        None => Ok(contacts),
    }
}

fn contact(row: &Row<'_>, count: usize) -> Result<Contact> {
    let (dofs, normal) = (row.dofs("dofs", count)?, row.numbers("normal")?);
    let size = dofs.len();
    if !(1..=3).contains(&size) || normal.len() != size {
        let what = format!("{size} dofs and {} components of the normal; a node has 1 to 3 of both", normal.len());
        return Err(row.refused(what));
    }
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return Err(row.refused("the normal is zero; it points from the obstacle to the node, at any length"));
    }
    let normal = normal.iter().map(|n| n / length).collect();
    let contact = Contact {
        name: row.text("node")?.to_string(),
        line: row.line,
        opposite: opposite(row, count, size)?,
        dofs,
        normal,
        gap: row.number("gap")?,
        friction: row.optional("friction").map(|_| row.number("friction")).transpose()?,
    };
    let all = contact.dofs.iter().chain(contact.opposite.iter().flat_map(|(_, dofs)| dofs));
    let mut all: Vec<_> = all.copied().collect();
    all.sort_unstable();
    if let Some(pair) = all.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(row.refused(format!("dof {} is named twice; each once", pair[0] + 1)));
    }
    match contact.friction {
        Some(friction) if friction < 0.0 => {
            Err(row.refused(format!("`friction` is {friction}, it must be 0 or more (leave it empty for none)")))
        }
        Some(_) if size == 1 => Err(row.refused("friction needs 2 or 3 dofs: a node of one dof has no tangent")),
        _ => Ok(contact),
    }
}

/// The nodes opposite, with their weights: dofs node by node.
fn opposite(row: &Row<'_>, count: usize, size: usize) -> Result<Vec<(f64, Vec<usize>)>> {
    if row.optional("opposite").is_none() {
        return match row.optional("weights") {
            Some(_) => Err(row.refused("weights without dofs in `opposite`")),
            None => Ok(Vec::new()),
        };
    }
    let dofs = row.dofs("opposite", count)?;
    if dofs.len() % size != 0 {
        let what = format!("{} dofs opposite of a node of {size}; give {size} for each node opposite", dofs.len());
        return Err(row.refused(what));
    }
    let nodes: Vec<_> = dofs.chunks(size).map(<[usize]>::to_vec).collect();
    let weights = match row.optional("weights") {
        Some(_) => row.numbers("weights")?,
        None if nodes.len() == 1 => vec![1.0],
        None => return Err(row.refused(format!("{} nodes opposite need their `weights`", nodes.len()))),
    };
    let sum: f64 = weights.iter().sum();
    if weights.len() != nodes.len() || (sum - 1.0).abs() > SUM {
        let what = format!("{} weights of {} nodes with the sum {sum}, it must be 1", weights.len(), nodes.len());
        return Err(row.refused(what));
    }
    Ok(weights.into_iter().zip(nodes).collect())
}

impl Contact {
    /// Name and line, for messages.
    pub(crate) fn place(&self, path: &Path) -> String {
        format!("that of node {} ({}, line {})", self.name, path.display(), self.line)
    }

    /// The row of G along a direction.
    fn along(&self, direction: &[f64]) -> Vec<(usize, f64)> {
        let own = self.dofs.iter().copied().zip(direction.iter().copied());
        let opposite = self.opposite.iter().flat_map(|(weight, dofs)| {
            dofs.iter().zip(direction).map(move |(&dof, component)| (dof, -weight * component))
        });
        own.chain(opposite).collect()
    }

    /// Directions across the normal: one in the plane, two in space.
    fn tangents(&self) -> Vec<Vec<f64>> {
        match self.normal[..] {
            [x, y] => vec![vec![y, -x]],
            [x, y, z] => {
                let n = [x, y, z];
                // From the axis that is farthest from the normal.
                let axis = (0..3).fold(0, |far, axis| if n[axis].abs() < n[far].abs() { axis } else { far });
                let first: [f64; 3] = std::array::from_fn(|k| f64::from(u8::from(k == axis)) - n[axis] * n[k]);
                let length = first.iter().map(|x| x * x).sum::<f64>().sqrt();
                let s = first.map(|x| x / length);
                let second: [f64; 3] =
                    std::array::from_fn(|k| n[(k + 1) % 3] * s[(k + 2) % 3] - n[(k + 2) % 3] * s[(k + 1) % 3]);
                vec![s.to_vec(), second.to_vec()]
            }
            _ => Vec::new(),
        }
    }

    /// The force on the node from its normal and friction forces, one component a dof.
    pub(crate) fn force(&self, normal: f64, friction: &[f64]) -> Vec<f64> {
        let tangents = self.tangents();
        let component = |k: usize| {
            let rubbing: f64 = tangents.iter().zip(friction).map(|(tangent, f)| tangent[k] * f).sum();
            self.normal[k] * normal + rubbing
        };
        (0..self.normal.len()).map(component).collect()
    }
}

/// The constraint of all contacts, in their order.
pub(crate) fn constraint(contacts: &[Contact]) -> LinearRows<'static, f64> {
    contacts.iter().fold(LinearRows::new(), |rows, contact| {
        let rows = rows.unilateral(&contact.along(&contact.normal), contact.gap);
        let Some(friction) = contact.friction else { return rows };
        let tangents: Vec<_> = contact.tangents().iter().map(|tangent| contact.along(tangent)).collect();
        rows.friction(friction, &tangents.iter().map(Vec::as_slice).collect::<Vec<_>>())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tangents are orthonormal to the normal for normals of all kinds.
    #[test]
    fn tangents_are_across_the_normal() {
        for normal in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.6, 0.8], [0.48, 0.6, -0.64]] {
            let contact = Contact {
                name: String::new(),
                line: 2,
                dofs: vec![0, 1, 2],
                opposite: Vec::new(),
                normal: normal.to_vec(),
                gap: 0.0,
                friction: Some(0.3),
            };
            let mut all = contact.tangents();
            all.push(normal.to_vec());
            for (i, a) in all.iter().enumerate() {
                for (j, b) in all.iter().enumerate() {
                    let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                    let expected = f64::from(u8::from(i == j));
                    assert!((product - expected).abs() < 1e-15, "{normal:?}: {i}, {j}: {product}");
                }
            }
        }
    }
}
