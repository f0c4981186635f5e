//! A ball tree of points along a line: the point farthest from a chord.

use std::ops::Range;

use nalgebra::SVector;

use crate::budget::Budget;

/// Points in one ball at most. A convention.
const GROUP: usize = 16;

/// How much farther than computed the points of a ball may lie, as a share: more than distances are rounded by.
const ROUNDING: f64 = 1e-9;

/// Points in their order, and balls around parts of them.
pub(crate) struct PointTree<'a, const D: usize> {
    points: &'a [SVector<f64, D>],
    /// The whole first, each before its two halves.
    balls: Vec<Ball<D>>,
    budget: &'a Budget,
}

/// A part of the points, and a ball that holds them.
struct Ball<const D: usize> {
    part: Range<usize>,
    middle: SVector<f64, D>,
    radius: f64,
    /// The number of the second half's ball, that of the first being the next one; `None` where it isn't halved.
    second: Option<usize>,
}

/// The chord between two of the points, and what was farthest from it so far.
struct Search<'a, const D: usize> {
    tree: &'a PointTree<'a, D>,
    between: Range<usize>,
    first: SVector<f64, D>,
    step: SVector<f64, D>,
    inverse: f64,
    farthest: (f64, Option<usize>),
    evaluated: usize,
}

impl<'a, const D: usize> PointTree<'a, D> {
    pub(crate) fn new(points: &'a [SVector<f64, D>], budget: &'a Budget) -> Self {
        let mut tree = Self { points, balls: Vec::with_capacity(2 * points.len().div_ceil(GROUP)), budget };
        tree.add(0..points.len());
        tree
    }

    /// Adds the ball around a part and those in it; its number.
    fn add(&mut self, part: Range<usize>) -> usize {
        let number = self.balls.len();
        let points = &self.points[part.clone()];
        let Some(&any) = points.first() else { return number };
        let (low, high) = points.iter().fold((any, any), |(low, high), point| (low.inf(point), high.sup(point)));
        let middle = (low + high) / 2.0;
        let radius = points.iter().map(|point| (point - middle).norm_squared()).fold(0.0, f64::max).sqrt();
        self.budget.charge(points.len());
        self.balls.push(Ball { part: part.clone(), middle, radius, second: None });
        if part.len() > GROUP {
            let half = part.start + part.len() / 2;
            self.add(part.start..half);
            self.balls[number].second = Some(self.add(half..part.end));
        }
        number
    }

    /// The first of the points between two, farther from the chord between these than the root of `limit`, that is farthest from
    /// it.
    pub(crate) fn farthest_from_chord(&self, first: usize, last: usize, limit: f64) -> Option<usize> {
        let step = self.points[last] - self.points[first];
        let inverse = step.norm_squared().max(f64::MIN_POSITIVE).recip();
        let (between, farthest) = (first + 1..last, (limit, None));
        let mut search =
            Search { tree: self, between, first: self.points[first], step, inverse, farthest, evaluated: 0 };
        search.visit(0);
        self.budget.charge(search.evaluated);
        search.farthest.1
    }
}

impl<const D: usize> Search<'_, D> {
    /// Squared distance of a place from the chord.
    fn square(&self, place: &SVector<f64, D>) -> f64 {
        let offset = place - self.first;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (offset - self.step * share).norm_squared()
    }

    /// Squared distance that no point of a ball exceeds; `None` where none of them is asked for.
    fn most(&mut self, number: usize) -> Option<f64> {
        let Ball { part, middle, radius, .. } = self.tree.balls.get(number)?;
        let is_asked = part.start < self.between.end && part.end > self.between.start;
        self.evaluated += 1;
        is_asked.then(|| ((self.square(middle).sqrt() + radius) * (1.0 + ROUNDING)).powi(2))
    }

    /// Evaluates the points of a ball that may be farther than the farthest so far, the more likely half first.
    fn visit(&mut self, number: usize) {
        let Some(ball) = self.tree.balls.get(number) else { return };
        let Some(second) = ball.second else {
            for k in ball.part.start.max(self.between.start)..ball.part.end.min(self.between.end) {
                let square = self.square(&self.tree.points[k]);
                let is_first = || self.farthest.1.is_some_and(|other| k < other);
                if square > self.farthest.0 || (square == self.farthest.0 && is_first()) {
                    self.farthest = (square, Some(k));
                }
            }
            self.evaluated += ball.part.len();
            return;
        };
        let mut halves = [number + 1, second].map(|half| (self.most(half), half));
        if halves[1].0 > halves[0].0 {
            halves.swap(0, 1);
        }
        for (most, half) in halves {
            if most.is_some_and(|most| most >= self.farthest.0) {
                self.visit(half);
            }
        }
    }
}
