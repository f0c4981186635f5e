//! How far apart samples of the plane lie: the gap that their outline has to bridge, and axes in which they are evenly spaced.

use nalgebra::{Matrix2, Vector2};
use spade::Triangulation;

use super::delaunay;
use super::distinct::distinct_scaled;
use crate::budget::Budget;
use crate::error::{Error, Result};

/// Fraction of the points that an outline has to hold together; the rest counts as stray: a convention.
const CONNECTED_FRACTION: f64 = 0.98;

/// Rounds in which the spacing of samples is made even: the first does so on a lattice, two or three on a scan.
const EVEN_ROUNDS: usize = 4;

/// Cosine up to which an angle counts as a right one, for lattices that are rounded.
const RIGHT_ANGLE: f64 = 1e-6;

/// The least length of steps by which 98 % of the points, each place once, are reached from one another.
///
/// Scan lines far apart count as much as the spacing within a line: a step has to cross from each to the next. The steps are those of the
/// minimum spanning tree, whose edges are Delaunay ones (Kruskal 1956, Toussaint 1980).
///
/// # Errors
/// A coordinate that is not finite or out of range, and fewer than 2 distinct points.
#[doc(hidden)]
pub fn bridging_gap(points: &[Vector2<f64>], budget: &Budget) -> Result<f64> {
    delaunay::interruptible(|| {
        let (points, scale) = distinct_scaled(points)?;
        let cdt = delaunay::constrained(&points, &[], budget)?;
        let ends = cdt.undirected_edges().map(|edge| edge.vertices().map(|vertex| vertex.index()));
        let mut edges: Vec<(f64, [usize; 2])> = ends.map(|[a, b]| ((points[a] - points[b]).norm(), [a, b])).collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut parts = DisjointSets::new(points.len());
        let is_bridged =
            |(_, [a, b]): &&(f64, [usize; 2])| parts.union(*a, *b) as f64 >= CONNECTED_FRACTION * points.len() as f64;
        edges.iter().find(is_bridged).map(|(length, _)| length / scale).ok_or_else(|| Error::InvalidGeometry {
            item: "the number of distinct points",
            found: points.len().to_string(),
            needed: "at least 2".into(),
        })
    })
}

/// A matrix of determinant 1 such that samples are equally far apart in all directions where the rows of places are multiplied by it.
///
/// The mean length of the steps to Gabriel neighbors, each counted along its own direction, is then the same along all axes. Where it
/// isn't, the ratio is that of the spacings. Neighbors are taken anew after each round.
///
/// # Errors
/// A coordinate that is not finite or out of range, and points that span no triangle.
#[doc(hidden)]
pub fn even_spacing(points: &[Vector2<f64>], budget: &Budget) -> Result<Matrix2<f64>> {
    let mut matrix = Matrix2::identity();
    for _ in 0..EVEN_ROUNDS {
        let even: Vec<Vector2<f64>> = points.iter().map(|point| matrix.tr_mul(point)).collect();
        let steps = gabriel_steps(&even, budget)?;
        let (mut counts, mut lengths) = (Matrix2::zeros(), Matrix2::zeros());
        for step in &steps {
            let product = step * step.transpose();
            counts += product / step.norm_squared();
            lengths += product / step.norm();
        }
        let eigen = counts.symmetric_eigen();
        if eigen.eigenvalues.min() <= f64::EPSILON * eigen.eigenvalues.max() {
            break;
        }
        let scales = Matrix2::from_diagonal(&eigen.eigenvalues.map(|count| count.sqrt().recip()));
        let root = eigen.eigenvectors * scales * eigen.eigenvectors.transpose();
        let spread = (root * lengths * root).symmetric_eigen();
        let [first, second] = [spread.eigenvalues[0], spread.eigenvalues[1]];
        let ratios = Matrix2::from_diagonal(&Vector2::new((second / first).sqrt(), (first / second).sqrt()));
        matrix *= spread.eigenvectors * ratios * spread.eigenvectors.transpose();
    }
    Ok(matrix)
}

/// The steps between points with no other in or on the circle about both (Gabriel, Sokal 1969): of a lattice its rows and columns
/// without diagonals.
fn gabriel_steps(points: &[Vector2<f64>], budget: &Budget) -> Result<Vec<Vector2<f64>>> {
    delaunay::interruptible(|| {
        let (points, scale) = distinct_scaled(points)?;
        let cdt = delaunay::constrained(&points, &[], budget)?;
        if cdt.num_inner_faces() == 0 {
            return Err(Error::CollinearPoints { found: points.len() });
        }
        let place = |index: usize| points[index];
        let mut steps = Vec::new();
        for edge in cdt.undirected_edges() {
            let edge = edge.as_directed();
            let [from, to] = edge.vertices().map(|vertex| place(vertex.index()));
            let is_empty = [edge, edge.rev()].iter().filter_map(|side| side.opposite_vertex()).all(|apex| {
                let [one, other] = [from, to].map(|end| end - place(apex.index()));
                one.dot(&other) > RIGHT_ANGLE * one.norm() * other.norm()
            });
            steps.extend(is_empty.then(|| (to - from) / scale));
        }
        Ok(steps)
    })
}

/// Disjoint sets of numbers below a count, with their sizes.
struct DisjointSets {
    parent: Vec<usize>,
    size: Vec<usize>,
}

impl DisjointSets {
    fn new(count: usize) -> Self {
        Self { parent: (0..count).collect(), size: vec![1; count] }
    }

    fn root(&mut self, mut of: usize) -> usize {
        while self.parent[of] != of {
            self.parent[of] = self.parent[self.parent[of]];
            of = self.parent[of];
        }
        of
    }

    /// Joins the sets of two numbers; returns the size of the joined one.
    fn union(&mut self, a: usize, b: usize) -> usize {
        let (mut large, mut small) = (self.root(a), self.root(b));
        if large != small {
            if self.size[large] < self.size[small] {
                (large, small) = (small, large);
            }
            self.parent[small] = large;
            self.size[large] += self.size[small];
        }
        self.size[large]
    }
}
