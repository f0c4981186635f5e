//! A bounding volume hierarchy of edges: those whose boxes are near a point.

use std::ops::Range;

use nalgebra::Vector2;

use crate::budget;
use crate::geometry::rings::bounding_box;

/// Edges or boxes in one box: neighbors along a line lie together. A convention.
const GROUP: usize = 8;

/// Lower left and upper right corners.
pub(crate) type Corners = [Vector2<f64>; 2];

/// Edges that do not move, and boxes around them.
#[derive(Debug, Clone)]
pub(crate) struct EdgeBoxes {
    edges: Vec<[Vector2<f64>; 2]>,
    /// Boxes around every [`GROUP`] edges, around every so many of these, and so on while there are more.
    levels: Vec<Vec<Corners>>,
}

impl EdgeBoxes {
    /// Boxes around edges, given by their ends; neighbors are best given one after the other.
    pub(crate) fn new(edges: Vec<[Vector2<f64>; 2]>) -> Self {
        let mut levels: Vec<Vec<Corners>> = Vec::new();
        let mut below = edges.as_slice();
        while below.len() > GROUP {
            levels.push(below.chunks(GROUP).map(around).collect());
            below = &levels[levels.len() - 1];
        }
        Self { edges, levels }
    }

    /// The number of edges.
    pub(crate) fn count(&self) -> usize {
        self.edges.len()
    }

    /// Gives the edges whose boxes, and all boxes around them, may be near, with their numbers, rising; counts the boxes that are
    /// asked for (`budget`).
    pub(crate) fn for_each_near(
        &self,
        near: impl Fn(&Corners) -> bool,
        mut found: impl FnMut(usize, [Vector2<f64>; 2]),
    ) {
        let top = self.levels.last().map_or(self.edges.len(), Vec::len);
        budget::charge(self.visit(self.levels.len(), 0..top, &near, &mut found));
    }

    /// The same of a part of a level, level 0 being the edges; how many were evaluated.
    fn visit(
        &self,
        level: usize,
        part: Range<usize>,
        near: &impl Fn(&Corners) -> bool,
        found: &mut impl FnMut(usize, [Vector2<f64>; 2]),
    ) -> usize {
        let mut evaluated = part.len();
        let Some(below) = level.checked_sub(1) else {
            for (number, &[a, b]) in part.clone().zip(&self.edges[part]) {
                if near(&[a.inf(&b), a.sup(&b)]) {
                    found(number, [a, b]);
                }
            }
            return evaluated;
        };
        let count = below.checked_sub(1).map_or(self.edges.len(), |level| self.levels[level].len());
        for (group, corners) in part.clone().zip(&self.levels[below][part]) {
            if near(corners) {
                evaluated += self.visit(below, group * GROUP..((group + 1) * GROUP).min(count), near, found);
            }
        }
        evaluated
    }
}

/// The box around pairs of points.
fn around(pairs: &[[Vector2<f64>; 2]]) -> Corners {
    let (low, high) = bounding_box(pairs.iter().flatten().copied());
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of unit edges along x, as many as boxes on three levels hold.
    fn line() -> EdgeBoxes {
        let end = |k: usize| Vector2::new(k as f64, 0.0);
        EdgeBoxes::new((0..500).map(|k| [end(k), end(k + 1)]).collect())
    }

    /// The numbers of edges that may hold a point of the line, and how many boxes were evaluated.
    fn found(edges: &EdgeBoxes, x: f64) -> (Vec<usize>, u64) {
        let mut numbers = Vec::new();
        let near = |[low, high]: &Corners| low.x <= x && x <= high.x;
        let visit = || edges.for_each_near(near, |number, _| numbers.push(number));
        let ((), evaluated) = budget::measured(visit);
        (numbers, evaluated)
    }

    #[test]
    fn edges_are_found_by_their_numbers_in_order() {
        let edges = line();
        assert_eq!(edges.count(), 500);
        assert_eq!(found(&edges, 0.5).0, [0]);
        assert_eq!(found(&edges, 499.5).0, [499]);
        // Both edges at a vertex, also where their boxes meet there.
        assert_eq!(found(&edges, 64.0).0, [63, 64]);
        assert!(found(&edges, -1.0).0.is_empty());
        let mut ends = Vec::new();
        edges.for_each_near(|_| true, |number, [a, b]| ends.push((number, a.x, b.x)));
        assert!(ends.iter().enumerate().all(|(k, end)| *end == (k, k as f64, k as f64 + 1.0)) && ends.len() == 500);
    }

    /// 500 edges make 63 boxes, these 8 more: those, one's 8 and its 8.
    #[test]
    fn what_is_asked_for_is_counted() {
        assert_eq!(found(&line(), 0.5).1, 24);
        assert_eq!(found(&line(), -1.0).1, 8);
        assert_eq!(found(&EdgeBoxes::new(Vec::new()), 0.5), (Vec::new(), 0));
    }
}
