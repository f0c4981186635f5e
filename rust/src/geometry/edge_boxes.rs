//! A bounding volume hierarchy of edges: those near a point, those that a segment may cross.

use std::ops::Range;

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::geometry::rings::bounding_box;

/// Edges or boxes in one box: neighbors along a line lie together. A convention.
const GROUP: usize = 8;

/// How much farther than computed a tilted box may reach, as a share of the largest coordinate: more than products are rounded by.
const ROUNDING: f64 = 1e-9;

type Point = Vector2<f64>;

/// Lower left and upper right corners.
pub(crate) type Corners = [Point; 2];

/// Edges that do not move, and boxes around them.
#[derive(Debug, Clone)]
pub(crate) struct EdgeBoxes {
    edges: Vec<[Point; 2]>,
    /// Boxes around every [`GROUP`] edges, around every so many of these, and so on while there are more.
    levels: Vec<Vec<EdgeBox>>,
}

/// Two boxes around the same edges: one along the axes, and a tilted one along the longest edge, which is far more slender where
/// edges run side by side.
#[derive(Debug, Clone)]
struct EdgeBox {
    corners: Corners,
    longest: Point,
    /// The longest edge's direction.
    along: Point,
    /// The tilted box: least and greatest coordinates along that direction and across it.
    tilted: Corners,
}

impl EdgeBoxes {
    /// Boxes around edges, given by their ends; neighbors are best given one after the other.
    pub(crate) fn new(edges: Vec<[Point; 2]>) -> Self {
        let mut levels: Vec<Vec<EdgeBox>> = Vec::new();
        if edges.len() > GROUP {
            levels.push(edges.chunks(GROUP).map(EdgeBox::around_edges).collect());
        }
        while let Some(below) = levels.last().filter(|below| below.len() > GROUP) {
            levels.push(below.chunks(GROUP).map(EdgeBox::around_boxes).collect());
        }
        Self { edges, levels }
    }

    /// The number of edges.
    pub(crate) fn count(&self) -> usize {
        self.edges.len()
    }

    /// Gives the edges whose boxes, and all boxes around them, may be near, with their numbers, rising; charges the boxes that are
    /// asked for.
    pub(crate) fn for_each_near(
        &self,
        near: impl Fn(&Corners) -> bool,
        mut found: impl FnMut(usize, [Point; 2]),
        budget: &Budget,
    ) {
        self.for_each_in(&|group: &EdgeBox| near(&group.corners), &near, &mut found, budget);
    }

    /// Gives the edges whose boxes meet that of a segment, in boxes that the segment may meet; numbers and charge as above.
    pub(crate) fn for_each_across(
        &self,
        [a, b]: [Point; 2],
        mut found: impl FnMut(usize, [Point; 2]),
        budget: &Budget,
    ) {
        let (lower, upper) = (a.inf(&b), a.sup(&b));
        let near = |[low, high]: &Corners| (0..2).all(|k| low[k] <= upper[k] && high[k] >= lower[k]);
        self.for_each_in(&|group: &EdgeBox| near(&group.corners) && group.may_meet(a, b), &near, &mut found, budget);
    }

    fn for_each_in(
        &self,
        enters: &impl Fn(&EdgeBox) -> bool,
        near: &impl Fn(&Corners) -> bool,
        found: &mut impl FnMut(usize, [Point; 2]),
        budget: &Budget,
    ) {
        let top = self.levels.last().map_or(self.edges.len(), Vec::len);
        budget.charge(self.visit(self.levels.len(), 0..top, enters, near, found));
    }

    /// The same of a part of a level, level 0 being the edges; how many were evaluated.
    fn visit(
        &self,
        level: usize,
        part: Range<usize>,
        enters: &impl Fn(&EdgeBox) -> bool,
        near: &impl Fn(&Corners) -> bool,
        found: &mut impl FnMut(usize, [Point; 2]),
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
        for (number, group) in part.clone().zip(&self.levels[below][part]) {
            if enters(group) {
                let inner = number * GROUP..((number + 1) * GROUP).min(count);
                evaluated += self.visit(below, inner, enters, near, found);
            }
        }
        evaluated
    }
}

impl EdgeBox {
    fn around_edges(edges: &[[Point; 2]]) -> Self {
        let corners = bounding_box(edges.iter().flatten().copied());
        Self::new(corners.into(), edges.iter().map(|[a, b]| b - a), edges.iter().flatten().copied())
    }

    fn around_boxes(boxes: &[Self]) -> Self {
        let corners = bounding_box(boxes.iter().flat_map(|inner| inner.corners));
        Self::new(corners.into(), boxes.iter().map(|inner| inner.longest), boxes.iter().flat_map(Self::tilted_corners))
    }

    /// The boxes of these corners and around points, tilted as the longest of the steps.
    fn new(corners: Corners, steps: impl Iterator<Item = Point>, points: impl Iterator<Item = Point>) -> Self {
        let longer = |a: Point, b: Point| if b.norm_squared() > a.norm_squared() { b } else { a };
        let longest = steps.fold(Point::zeros(), longer);
        let along = longest.try_normalize(0.0).unwrap_or(Point::x());
        let (low, high) = bounding_box(points.map(|point| tilted(along, point)));
        Self { corners, longest, along, tilted: [low, high] }
    }

    fn tilted_corners(&self) -> [Point; 4] {
        let [low, high] = self.tilted;
        let back = Point::new(self.along.x, -self.along.y);
        [low, Point::new(high.x, low.y), high, Point::new(low.x, high.y)].map(|corner| tilted(back, corner))
    }

    /// Whether a segment may meet the tilted box: `false` only where a line along one of its sides or along the segment lies between.
    fn may_meet(&self, a: Point, b: Point) -> bool {
        let [low, high] = self.tilted;
        let room = ROUNDING * low.amax().max(high.amax()).max(a.amax()).max(b.amax());
        let (from, to) = (tilted(self.along, a), tilted(self.along, b));
        let (least, most) = (from.inf(&to), from.sup(&to));
        if (0..2).any(|k| least[k] > high[k] + room || most[k] < low[k] - room) {
            return false;
        }
        let (step, half) = (to - from, (high - low) / 2.0);
        let off = step.perp(&(low + half - from)).abs();
        off <= step.x.abs() * (half.y + room) + step.y.abs() * (half.x + room)
    }
}

/// A point's coordinates along a direction and across it, to its left.
fn tilted(along: Point, point: Point) -> Point {
    Point::new(along.dot(&point), along.perp(&point))
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
        let budget = Budget::unlimited();
        edges.for_each_near(near, |number, _| numbers.push(number), &budget);
        (numbers, budget.charged())
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
        edges.for_each_near(|_| true, |number, [a, b]| ends.push((number, a.x, b.x)), &Budget::unlimited());
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
