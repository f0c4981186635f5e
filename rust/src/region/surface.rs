//! Triangulated surfaces and the rings of their boundary.

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::error::{Error, Result};

/// An open triangulated surface: consistently oriented triangles and the rings of its boundary.
#[derive(Debug, Clone)]
pub struct Surface {
    /// World vertices.
    pub vertices: Vec<Vector3<f64>>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[usize; 3]>,
    /// The boundary rings, world.
    pub rings: Vec<Vec<Vector3<f64>>>,
}

pub(super) fn check_indices(vertices: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<()> {
    let worst = triangles.iter().flatten().max();
    match worst {
        None => Err(Error::InvalidGeometry {
            item: "the number of triangles",
            found: "0".into(),
            needed: "at least 1".into(),
        }),
        Some(&index) if index >= vertices.len() => Err(Error::InvalidGeometry {
            item: "a triangle's vertex index",
            found: index.to_string(),
            needed: format!("below the number of vertices, {}", vertices.len()),
        }),
        Some(_) => Ok(()),
    }
}

/// The rings of edges that belong to one triangle only, in the triangles' own direction.
pub(super) fn boundary_rings(vertices: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<Vec<Vec<Vector3<f64>>>> {
    let mut directed = HashMap::new();
    for (index, t) in triangles.iter().enumerate() {
        for side in 0..3 {
            let edge = (t[side], t[(side + 1) % 3]);
            if edge.0 == edge.1 || directed.insert(edge, index).is_some() {
                return Err(Error::BadMesh {
                    found: format!("edge {} to {} twice in the same direction", edge.0, edge.1),
                    needed: "triangles with distinct corners that all turn the same way, at most two on an edge",
                });
            }
        }
    }
    let mut next: HashMap<usize, usize> = HashMap::new();
    for &(a, b) in directed.keys().filter(|&&(a, b)| !directed.contains_key(&(b, a))) {
        if next.insert(a, b).is_some() {
            return Err(Error::BadMesh {
                found: format!("a boundary that passes vertex {a} twice"),
                needed: "a boundary of simple rings",
            });
        }
    }
    trace(next).map(|rings| rings.iter().map(|ring| ring.iter().map(|&v| vertices[v]).collect()).collect())
}

fn trace(mut next: HashMap<usize, usize>) -> Result<Vec<Vec<usize>>> {
    let mut starts: Vec<usize> = next.keys().copied().collect();
    starts.sort_unstable();
    let mut rings = Vec::new();
    for start in starts {
        let mut ring = Vec::new();
        let mut at = start;
        while let Some(to) = next.remove(&at) {
            ring.push(at);
            at = to;
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    if rings.is_empty() {
        return Err(Error::BadMesh {
            found: "a closed surface".into(),
            needed: "an open patch, one side of which the camera sees",
        });
    }
    Ok(rings)
}
