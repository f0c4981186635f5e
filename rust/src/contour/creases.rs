//! Lines in which the planes of two regions meet, seen as an edge that their outlines share (`docs/math.md`, section
//! 16).

use std::cell::OnceCell;

use nalgebra::{Vector2, Vector3, Vector6};

use super::neighbors::neighbors;
use super::pieces::{STRAIGHT, edges, straight_runs};
use crate::budget::Budget;
use crate::equations::residual::RegionEquations;
use crate::geometry::edge_boxes::{Corners, EdgeBoxes};
use crate::geometry::pose::Pose;
use crate::math::gaussian::Gaussian;
use crate::noise::boundary::DRAWN;
use crate::noise::contamination::{LEAST_RATIO, PRIOR_SHARE, SIZE_RATIO};
use crate::region::WorldRegion;

/// Distance, pixels, up to which two outlines share an edge: a hand's error of each.
const SHARED: f64 = 2.0 * DRAWN;

/// Length, pixels, from which an edge is shared: its ends, off by a hand's error, turn it by what a straight run may turn.
const SHORTEST: f64 = DRAWN / STRAIGHT;

/// Least sine of the angle between planes (20 degrees): the error of their line is that of the planes over the sine.
const APART: f64 = 0.34;

/// Distance of a world outline from the line up to which its region meets it, as a share of the square root of its
/// area: samples of walls of some 4 m end up to 0.6 m short of the corner.
const MEETS: f64 = 0.15;

/// A straight edge of the scene that two regions share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crease {
    /// The regions, by number.
    pub regions: [usize; 2],
    /// Bearings of the ends of the edge, as far as both outlines show it.
    pub ends: [Vector3<f64>; 2],
    /// A point of the line in which the planes meet, about the problem's origin.
    pub point: Vector3<f64>,
    /// Its direction, a unit vector.
    pub direction: Vector3<f64>,
    /// Pixels per radian.
    pixels: f64,
    /// Scale of how far an edge is off that is none of the planes', such as a roof's that stands over, pixels.
    wide: f64,
}

/// The creases of all pairs of regions, world coordinates about `origin`.
pub fn creases(
    regions: &[RegionEquations],
    worlds: &[WorldRegion],
    origin: &Vector3<f64>,
    budget: &Budget,
) -> Vec<Crease> {
    let sides: Vec<OnceCell<Vec<Side>>> = vec![OnceCell::new(); regions.len()];
    let sides_of = |index: usize| sides[index].get_or_init(|| self::sides(&regions[index], budget)).as_slice();
    let crease = |pair: [usize; 2]| {
        let (point, direction) = meeting_line(&worlds[pair[0]], &worlds[pair[1]], budget)?;
        let ends = shared_edge(&regions[pair[0]], pair.map(sides_of), budget)?;
        let pixels = pair.map(|index| regions[index].pixels_per_radian());
        let wide = SIZE_RATIO * 0.5 * pair.iter().map(|&index| regions[index].pixel_area().sqrt()).sum::<f64>();
        let wide = wide.max(LEAST_RATIO * DRAWN);
        Some(Crease {
            regions: pair,
            ends,
            point: point - origin,
            direction,
            pixels: (pixels[0] + pixels[1]) / 2.0,
            wide,
        })
    };
    neighbors(regions, |region| SHARED / region.pixels_per_radian(), budget).into_iter().filter_map(crease).collect()
}

/// The line in which two planes meet, if both regions reach it: a point and the direction.
fn meeting_line(first: &WorldRegion, second: &WorldRegion, budget: &Budget) -> Option<(Vector3<f64>, Vector3<f64>)> {
    if [first, second].iter().any(|world| world.surface().is_some() || world.is_line()) {
        return None;
    }
    let [a, b] = [first, second].map(WorldRegion::frame);
    let cross = a.axes[2].cross(&b.axes[2]);
    let direction = cross.try_normalize(APART)?;
    // From the first plane's origin along that plane, square to the line, to the second plane.
    let across = a.axes[2].cross(&direction);
    let point = a.origin + across * (-b.height(&a.origin) / b.axes[2].dot(&across));
    let meets = |world: &WorldRegion| {
        budget.charge(world.outline().rings().iter().map(Vec::len).sum());
        let side = world.frame().axes[2].cross(&direction);
        let offsets = world.rings().concat().into_iter().map(|x| side.dot(&(x - point)));
        let (low, high) = offsets.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        low.max(-high) <= MEETS * world.outline().area().sqrt()
    };
    (meets(first) && meets(second)).then_some((point, direction))
}

/// A straight side of an observed outline, as the rays of its ends.
type Side = [Vector3<f64>; 2];

/// Bearings of the ends of the longest edge that two observed outlines share, each outline on its own side of it; `first` is the
/// region of the first of both lists of sides.
fn shared_edge(first: &RegionEquations, sides: [&[Side]; 2], budget: &Budget) -> Option<Side> {
    let (chart, pixels) = (first.chart(), first.pixels_per_radian());
    let in_pixels = |ray: &Vector3<f64>| {
        let turned = chart.rotation * ray;
        (turned.z > 0.0).then(|| turned.xy() * (pixels / turned.z))
    };
    let length = |part: &[Vector2<f64>; 2]| (part[1] - part[0]).norm();
    // No part of a shorter side is long enough.
    let in_chart =
        |side: &Side| Some([in_pixels(&side[0])?, in_pixels(&side[1])?]).filter(|side| length(side) >= SHORTEST);
    budget.charge(sides[0].len() + sides[1].len());
    let [own, other_sides] = sides.map(|sides| sides.iter().filter_map(in_chart).collect::<Vec<_>>());
    let other_sides = EdgeBoxes::new(other_sides);
    let mut longest: Option<[Vector2<f64>; 2]> = None;
    for side in &own {
        // What runs beside it is no farther from it anywhere than what is shared may be.
        let (low, high) = (side[0].inf(&side[1]).add_scalar(-SHARED), side[0].sup(&side[1]).add_scalar(SHARED));
        let is_near = |other: &Corners| (0..2).all(|axis| other[0][axis] <= high[axis] && other[1][axis] >= low[axis]);
        let compare = |_, other: [Vector2<f64>; 2]| {
            let part = shared_part(side, &other);
            if part.is_some_and(|part| longest.is_none_or(|longest| length(&part) >= length(&longest))) {
                longest = part;
            }
        };
        other_sides.for_each_near(is_near, compare, budget);
    }
    Some(longest?.map(|p| chart.rotation.inverse() * (p / pixels).push(1.0).normalize()))
}

/// The straight sides of an observed outline that are its own.
fn sides(region: &RegionEquations, budget: &Budget) -> Vec<Side> {
    let (chart, mut runs) = (region.chart(), 0);
    let mut found: Vec<Side> = Vec::new();
    let lift = |p: Vector2<f64>| chart.rotation.inverse() * (p / chart.scale).push(1.0);
    for (ring, foreign) in region.outline().rings().iter().zip(region.foreign_edges()) {
        budget.charge(ring.len());
        let mut last = None;
        let numbers = straight_runs(ring, &mut runs);
        for (((from, to), number), &foreign) in edges(ring).zip(numbers).zip(foreign) {
            match found.last_mut() {
                Some([_, end]) if !foreign && last == Some(number) => *end = lift(to),
                _ if !foreign => found.push([lift(from), lift(to)]),
                _ => {}
            }
            last = (!foreign).then_some(number);
        }
    }
    found
}

/// The middle line of two sides where they run beside each other, in opposite directions, as outlines on either side of
/// it do.
fn shared_part(a: &[Vector2<f64>; 2], b: &[Vector2<f64>; 2]) -> Option<[Vector2<f64>; 2]> {
    let along = (a[1] - a[0]).try_normalize(0.0)?;
    let [start, end] = b.map(|p| along.dot(&(p - a[0])));
    let (low, high) = (end.max(0.0), start.min((a[1] - a[0]).norm()));
    if high - low < SHORTEST {
        return None;
    }
    let both = [low, high].map(|place| (a[0] + along * place, b[0].lerp(&b[1], (place - start) / (end - start))));
    let near = both.iter().all(|(own, other)| (own - other).norm() <= SHARED);
    near.then(|| both.map(|(own, other)| (own + other) / 2.0))
}

impl Crease {
    /// How far the ends of the edge lie from the projected line at a pose about the problem's origin, pixels, and the
    /// derivatives by the left increment (`docs/math.md`, eq. 16.1 and 16.2); `None` where the line passes through the
    /// camera.
    #[doc(hidden)]
    pub fn rows(&self, pose: &Pose) -> Option<[(f64, Vector6<f64>); 2]> {
        let (place, direction) = (pose.transform(&self.point), pose.rotation * self.direction);
        let moment = place.cross(&direction);
        let length = moment.norm();
        let normal = moment.try_normalize(f64::EPSILON * place.norm())?;
        Some(self.ends.map(|ray| {
            let off = normal.dot(&ray);
            let (turning, moving) = (normal.cross(&ray), direction.cross(&(ray - normal * off)) / length);
            let row = Vector6::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z);
            (self.pixels * off, row * self.pixels)
        }))
    }

    /// The crease at a pose as a Gaussian factor of its left increment, with the value and the slope of a mixture of an edge that
    /// is the planes' and one that is not; uninformative where the line passes through the camera.
    #[doc(hidden)]
    pub fn gaussian(&self, pose: &Pose) -> Gaussian {
        let mut factor = Gaussian::default();
        let Some(rows) = self.rows(pose) else { return factor };
        let square: f64 = rows.iter().map(|(distance, _)| distance * distance).sum();
        let [own, other] = [(1.0 - PRIOR_SHARE, DRAWN), (PRIOR_SHARE, self.wide)]
            .map(|(share, sigma)| share.ln() - 0.5 * square / (sigma * sigma) - 2.0 * sigma.ln());
        let most = own.max(other);
        let all = most + ((own - most).exp() + (other - most).exp()).ln();
        let weight = (own - all).exp() / (DRAWN * DRAWN) + (other - all).exp() / (self.wide * self.wide);
        for (distance, row) in rows {
            factor.information.ger(weight, &row, &row, 1.0);
            factor.information_vector -= row * (weight * distance);
        }
        Gaussian { offset: all, ..factor }
    }

    /// The part of the line, world coordinates about the problem's origin, that is seen from a pose between the ends of the edge.
    #[doc(hidden)]
    pub fn segment(&self, pose: &Pose) -> [Vector3<f64>; 2] {
        let (place, direction) = (pose.transform(&self.point), pose.rotation * self.direction);
        self.ends.map(|ray| {
            // Where the line is nearest to the ray.
            let across = ray.cross(&ray.cross(&direction));
            self.point - self.direction * (across.dot(&place) / across.dot(&direction))
        })
    }
}
