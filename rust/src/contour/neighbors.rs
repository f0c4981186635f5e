//! Regions that are adjacent in the image, by a sweep over their boxes.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::equations::residual::RegionEquations;

/// Caps in one box at most. A convention.
const GROUP: usize = 8;

/// More than a cap and its box are rounded by, in chords of the unit sphere.
const ROUNDING: f64 = 1e-9;

/// Bearings within a chord of an axis on the unit sphere: an observed region and some room around it.
struct Cap {
    region: usize,
    axis: Vector3<f64>,
    reach: f64,
}

impl Cap {
    fn of(number: usize, region: &RegionEquations, room: f64, budget: &Budget) -> Self {
        let chart = region.chart();
        let points = region.outline().rings().iter().flatten();
        let widest = points.map(Vector2::norm_squared).fold(0.0, f64::max).sqrt();
        budget.charge(region.outline().rings().iter().map(Vec::len).sum());
        let reach = 2.0 * (0.5 * (widest / chart.scale).atan()).sin() + room + ROUNDING;
        Self { region: number, axis: chart.rotation.inverse() * Vector3::z(), reach }
    }

    /// Whether bearings of both may be the same; no chord is longer than the sum of those on the way.
    fn meets(&self, other: &Self) -> bool {
        (self.axis - other.axis).norm() <= self.reach + other.reach
    }
}

/// Caps in boxes, boxes in larger ones.
struct CapTree<'a> {
    caps: Vec<Cap>,
    /// The whole first, each before its two halves.
    boxes: Vec<CapBox>,
    budget: &'a Budget,
}

/// A part of the caps, and a box around it.
struct CapBox {
    part: Range<usize>,
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// The number of the second half's box, that of the first being the next one; `None` where it isn't halved.
    second: Option<usize>,
}

impl<'a> CapTree<'a> {
    fn new(caps: Vec<Cap>, budget: &'a Budget) -> Self {
        let count = caps.len();
        let mut tree = Self { caps, boxes: Vec::new(), budget };
        tree.add(0..count);
        tree
    }

    /// Adds the box around a part and those in it, whose caps it sorts by where they lie farthest apart; its number.
    fn add(&mut self, part: Range<usize>) -> usize {
        let (number, caps) = (self.boxes.len(), &mut self.caps[part.clone()]);
        let far = Vector3::repeat(f64::INFINITY);
        let (low, high) = caps.iter().fold((far, -far), |(low, high), cap| {
            let reach = Vector3::repeat(cap.reach);
            (low.inf(&(cap.axis - reach)), high.sup(&(cap.axis + reach)))
        });
        self.budget.charge(caps.len());
        let along = (high - low).imax();
        self.boxes.push(CapBox { part: part.clone(), low, high, second: None });
        if part.len() > GROUP {
            let half = part.len() / 2;
            caps.select_nth_unstable_by(half, |a, b| a.axis[along].total_cmp(&b.axis[along]));
            self.add(part.start..part.start + half);
            self.boxes[number].second = Some(self.add(part.start + half..part.end));
        }
        number
    }

    /// Gives the caps behind one, by their places, that meet it; charges those and the boxes that it evaluates.
    fn for_each_meeting(&self, place: usize, number: usize, found: &mut impl FnMut(&Cap)) {
        let (cap, CapBox { part, low, high, second }) = (&self.caps[place], &self.boxes[number]);
        let is_apart = |axis: usize| cap.axis[axis] + cap.reach < low[axis] || cap.axis[axis] - cap.reach > high[axis];
        self.budget.charge(1);
        if part.end <= place + 1 || (0..3).any(is_apart) {
            return;
        }
        match second {
            Some(second) => {
                [number + 1, *second].into_iter().for_each(|half| self.for_each_meeting(place, half, found))
            }
            None => {
                let behind = &self.caps[part.start.max(place + 1)..part.end];
                self.budget.charge(behind.len());
                behind.iter().filter(|other| cap.meets(other)).for_each(found);
            }
        }
    }
}

/// The pairs of regions, the lower number first, whose outlines may lie within the `room` (rad) of both together; by the second and the
/// first.
pub(super) fn neighbors(
    regions: &[RegionEquations],
    room: impl Fn(&RegionEquations) -> f64,
    budget: &Budget,
) -> Vec<[usize; 2]> {
    let caps = regions.iter().enumerate().map(|(number, region)| Cap::of(number, region, room(region), budget));
    let (tree, mut pairs) = (CapTree::new(caps.collect(), budget), Vec::new());
    for (place, cap) in tree.caps.iter().enumerate() {
        tree.for_each_meeting(place, 0, &mut |other| {
            pairs.push([cap.region.min(other.region), cap.region.max(other.region)]);
        });
    }
    pairs.sort_unstable_by_key(|&[first, second]| (second, first));
    pairs
}
