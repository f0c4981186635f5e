//! A bounding volume hierarchy of rings' edges: what lies beside an edge.
//!
//! A part has a box, a rectangle along its longest edge, which is far more slender for neighbors that run side by side, and its two
//! ends.

use std::ops::Range;

use nalgebra::Vector2;

use crate::budget;

/// Edges or parts in one part: neighbors along a ring lie together. A convention.
const GROUP: usize = 8;

/// A point of the plane.
pub(super) type Point = [f64; 2];

/// An edge of a ring.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    /// Its ends from left to right.
    pub(super) ends: [Point; 2],
    /// +1 where it runs to the left and has its region below, -1 to the right, 0 of a vertical one.
    pub(super) sign: i32,
}

impl Edge {
    fn new(from: Point, to: Point) -> Self {
        let sign = sign([from[0], to[0]]);
        Self { ends: if sign > 0 { [to, from] } else { [from, to] }, sign }
    }

    /// The x at which a ring comes to it and leaves it.
    fn path(&self) -> [f64; 2] {
        let [left, right] = self.ends.map(|end| end[0]);
        if self.sign > 0 { [right, left] } else { [left, right] }
    }
}

/// The lesser of two numbers, neither of which is NaN.
#[inline(always)]
pub(super) fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers, neither of which is NaN.
#[inline(always)]
pub(super) fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
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

/// A visitor of the parts of rings.
pub(super) trait Visitor {
    /// Whether it descends into a part.
    fn enters(&mut self, part: &Part) -> bool;

    /// Visits an edge.
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
        let mut edges = Vec::with_capacity(ends.last().copied().unwrap_or(0));
        for ring in rings {
            let Some(last) = ring.last() else { continue };
            let closing = Edge::new((*last).into(), ring[0].into());
            edges.extend(ring.windows(2).map(|ends| Edge::new(ends[0].into(), ends[1].into())));
            edges.push(closing);
        }
        let mut parts = Self { edges, levels: Vec::new() };
        let count = parts.edges.len();
        let paths = |part: Range<usize>| {
            // The first ring that ends behind its first edge, and the ring of its last edge.
            let first_end = ends[ends.partition_point(|&end| end <= part.start)].min(part.end);
            let last_ring = ends.partition_point(|&end| end < part.end);
            let last_start = if last_ring > 0 { ends[last_ring - 1] } else { 0 };
            let path = |part: Range<usize>| match part.is_empty() {
                true => [0.0; 2],
                false => [parts.edges[part.start].path()[0], parts.edges[part.end - 1].path()[1]],
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
        budget::charge(count);
        parts.levels = levels;
        parts
    }

    pub(super) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The largest size of a coordinate.
    pub(super) fn largest(&self) -> f64 {
        let of_edge = |most: f64, edge: &Edge| {
            let [[a, b], [c, d]] = edge.ends.map(|end| end.map(f64::abs));
            greater(most, greater(greater(a, b), greater(c, d)))
        };
        self.edges.iter().fold(0.0, of_edge)
    }

    /// Takes a visitor to all parts and edges that it enters; how many it was shown.
    pub(super) fn visit(&self, visitor: &mut impl Visitor) -> usize {
        let top = self.levels.last().map_or(self.edges.len(), Vec::len);
        self.visit_part(self.levels.len(), 0..top, visitor)
    }

    fn visit_part(&self, level: usize, part: Range<usize>, visitor: &mut impl Visitor) -> usize {
        let mut evaluated = part.len();
        let Some(below) = level.checked_sub(1) else {
            self.edges[part].iter().for_each(|edge| visitor.meets(edge));
            return evaluated;
        };
        let count = below.checked_sub(1).map_or(self.edges.len(), |level| self.levels[level].len());
        for number in part {
            if visitor.enters(&self.levels[below][number]) {
                let inner = number * GROUP..((number + 1) * GROUP).min(count);
                evaluated += self.visit_part(below, inner, visitor);
            }
        }
        evaluated
    }
}

impl Part {
    fn around_edges(edges: &[Edge], paths: [[f64; 2]; 2]) -> Self {
        let steps = edges.iter().map(|Edge { ends: [left, right], .. }| [right[0] - left[0], right[1] - left[1]]);
        Self::around(edges.iter().map(|edge| &edge.ends), steps, paths)
    }

    fn around_parts(parts: &[Part], paths: [[f64; 2]; 2]) -> Self {
        let mut part =
            Self::around(parts.iter().map(|part| &part.corners), parts.iter().map(|part| part.longest), paths);
        for axis in 0..2 {
            part.low[axis] = parts.iter().map(|part| part.low[axis]).fold(f64::INFINITY, f64::min);
            part.high[axis] = parts.iter().map(|part| part.high[axis]).fold(f64::NEG_INFINITY, f64::max);
        }
        part
    }

    fn around<'a, const N: usize>(
        points: impl Iterator<Item = &'a [Point; N]>,
        steps: impl Iterator<Item = Point>,
        paths: [[f64; 2]; 2],
    ) -> Self {
        // Any direction will do, so squares that are out of range do no harm.
        let square = |[x, y]: Point| x * x + y * y;
        let longer = |a: (f64, Point), b: (f64, Point)| if b.0 >= a.0 { b } else { a };
        let (_, longest) = steps.map(|step| (square(step), step)).fold((0.0, [0.0; 2]), longer);
        let length = longest[0].hypot(longest[1]);
        let [u, v] = if length > 0.0 { longest.map(|x| x / length) } else { [1.0, 0.0] };
        let (mut low, mut high) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
        for points in points {
            for [x, y] in points {
                for (axis, value) in [*x, *y, x * u + y * v, y * u - x * v].into_iter().enumerate() {
                    (low[axis], high[axis]) = (lesser(low[axis], value), greater(high[axis], value));
                }
            }
        }
        let ([low_x, low_y, left, down], [high_x, high_y, right, up]) = (low, high);
        let corners = [[left, down], [right, down], [right, up], [left, up]];
        let corners = corners.map(|[along, across]| [along * u - across * v, along * v + across * u]);
        Self { low: [low_x, low_y], high: [high_x, high_y], corners, paths, longest }
    }
}
