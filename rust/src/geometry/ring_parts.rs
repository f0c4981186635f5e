//! Edges of rings in parts, parts in larger ones: what lies beside an edge, without a look at all of the rings.
//!
//! A part is known by a box, by a rectangle along its longest edge, which is far more slender for neighbors that run side by side,
//! and by where it begins and ends.

use std::ops::Range;

use nalgebra::Vector2;

use crate::effort;

/// Edges or parts in one part: neighbors along a ring lie together. A convention.
const GROUP: usize = 8;

/// A point of the plane.
pub(super) type Point = [f64; 2];

/// An edge of a ring, in its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    from: Point,
    to: Point,
}

impl Edge {
    /// +1 of an edge to the left, which has its region below, -1 to the right, 0 of a vertical one.
    pub(super) fn sign(&self) -> i32 {
        sign([self.from[0], self.to[0]])
    }

    /// Its ends from left to right.
    pub(super) fn rising(&self) -> [Point; 2] {
        if self.to[0] < self.from[0] { [self.to, self.from] } else { [self.from, self.to] }
    }
}

/// The sign of the area below a path from one x to another.
pub(super) fn sign([from, to]: [f64; 2]) -> i32 {
    i32::from(to < from) - i32::from(to > from)
}

/// Consecutive edges.
#[derive(Debug)]
pub(super) struct Part {
    /// Its least and its greatest coordinates.
    pub(super) low: Point,
    pub(super) high: Point,
    /// Corners of a rectangle around it, along its longest edge.
    pub(super) corners: [Point; 4],
    /// The x at which each path of it begins and ends: of the first ring and of the last one. One that is closed ends where it
    /// begins.
    pub(super) paths: [[f64; 2]; 2],
    longest: Point,
}

/// What goes through the parts of rings.
pub(super) trait Visitor {
    /// Whether it looks into a part.
    fn enters(&mut self, part: &Part) -> bool;

    /// Looks at an edge.
    fn meets(&mut self, edge: &Edge);
}

/// The edges of rings.
#[derive(Debug)]
pub(super) struct Parts {
    edges: Vec<Edge>,
    /// Parts of [`GROUP`] edges each, of so many of these, and so on while there are more.
    levels: Vec<Vec<Part>>,
}

impl Parts {
    pub(super) fn of(rings: &[Vec<Vector2<f64>>]) -> Self {
        let ends: Vec<usize> = rings
            .iter()
            .scan(0, |end, ring| {
                Some({
                    *end += ring.len();
                    *end
                })
            })
            .collect();
        let edge = |(a, b): (&Vector2<f64>, &Vector2<f64>)| Edge { from: [a.x, a.y], to: [b.x, b.y] };
        let edges = rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(edge));
        let mut parts = Self { edges: edges.collect(), levels: Vec::new() };
        let count = parts.edges.len();
        let paths = |part: Range<usize>| {
            // The first ring that ends behind its first edge, and the ring of its last edge.
            let first_end = ends[ends.partition_point(|&end| end <= part.start)].min(part.end);
            let last_ring = ends.partition_point(|&end| end < part.end);
            let last_start = if last_ring > 0 { ends[last_ring - 1] } else { 0 };
            let path = |part: Range<usize>| match part.is_empty() {
                true => [0.0; 2],
                false => [parts.edges[part.start].from[0], parts.edges[part.end - 1].to[0]],
            };
            [path(part.start..first_end), path(last_start.max(first_end)..part.end)]
        };
        let mut levels: Vec<Vec<Part>> = Vec::new();
        let (mut size, mut below) = (1, count);
        while below > GROUP {
            size *= GROUP;
            let level = (0..count).step_by(size).map(|first| {
                let paths = paths(first..(first + size).min(count));
                match levels.last() {
                    None => Part::around_edges(&parts.edges[first..(first + size).min(count)], paths),
                    Some(last) => {
                        let number = first / (size / GROUP);
                        Part::around_parts(&last[number..(number + GROUP).min(last.len())], paths)
                    }
                }
            });
            let level: Vec<Part> = level.collect();
            below = level.len();
            levels.push(level);
        }
        effort::spend(count);
        parts.levels = levels;
        parts
    }

    pub(super) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The largest size of a coordinate.
    pub(super) fn largest(&self) -> f64 {
        self.edges.iter().flat_map(|edge| edge.from).fold(0.0, |most, x| most.max(x.abs()))
    }

    /// Takes a visitor to all parts and edges that it enters; how many it was shown.
    pub(super) fn visit(&self, visitor: &mut impl Visitor) -> usize {
        let top = self.levels.last().map_or(self.edges.len(), Vec::len);
        self.visit_part(self.levels.len(), 0..top, visitor)
    }

    fn visit_part(&self, level: usize, part: Range<usize>, visitor: &mut impl Visitor) -> usize {
        let mut looked = part.len();
        let Some(below) = level.checked_sub(1) else {
            self.edges[part].iter().for_each(|edge| visitor.meets(edge));
            return looked;
        };
        let count = below.checked_sub(1).map_or(self.edges.len(), |level| self.levels[level].len());
        for number in part {
            if visitor.enters(&self.levels[below][number]) {
                let inner = number * GROUP..((number + 1) * GROUP).min(count);
                looked += self.visit_part(below, inner, visitor);
            }
        }
        looked
    }
}

impl Part {
    fn around_edges(edges: &[Edge], paths: [[f64; 2]; 2]) -> Self {
        let steps = edges.iter().map(|Edge { from, to }| [to[0] - from[0], to[1] - from[1]]);
        Self::around(edges.iter().flat_map(|edge| [edge.from, edge.to]), steps, paths)
    }

    fn around_parts(parts: &[Part], paths: [[f64; 2]; 2]) -> Self {
        let points = parts.iter().flat_map(|part| part.corners);
        let mut part = Self::around(points, parts.iter().map(|part| part.longest), paths);
        for axis in 0..2 {
            part.low[axis] = parts.iter().map(|part| part.low[axis]).fold(f64::INFINITY, f64::min);
            part.high[axis] = parts.iter().map(|part| part.high[axis]).fold(f64::NEG_INFINITY, f64::max);
        }
        part
    }

    fn around(
        points: impl Iterator<Item = Point> + Clone,
        steps: impl Iterator<Item = Point>,
        paths: [[f64; 2]; 2],
    ) -> Self {
        let length = |step: &Point| step[0].hypot(step[1]);
        let longest = steps.max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or([0.0; 2]);
        let [u, v] = if length(&longest) > 0.0 { longest.map(|x| x / length(&longest)) } else { [1.0, 0.0] };
        let bounds = |along: Point| {
            let values = points.clone().map(|[x, y]| x * along[0] + y * along[1]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let ([left, right], [down, up]) = (bounds([u, v]), bounds([-v, u]));
        let corners = [[left, down], [right, down], [right, up], [left, up]];
        let corners = corners.map(|[along, across]| [along * u - across * v, along * v + across * u]);
        let ([low_x, high_x], [low_y, high_y]) = (bounds([1.0, 0.0]), bounds([0.0, 1.0]));
        Self { low: [low_x, low_y], high: [high_x, high_y], corners, paths, longest }
    }
}
