//! The signed distance of any point from the rings that bound a region (`docs/math.md`, eq. 17.1).

use std::ops::Range;

use nalgebra::Vector2;

use crate::contour::pieces::edges;
use crate::geometry::edge_field::EdgeField;
use crate::geometry::rings::signed_area;

/// Length of a stretch that is not straight, as a share of the size of its ring: half of what disturbed parts reach.
const STRETCH: f64 = 0.05;

/// Distance, pixels, up to which points of a contour are on a straight line: the steps of a binary mask.
const STRAIGHT: f64 = 1.0;

/// Oriented rings, outer ones counter-clockwise, and the edge nearest to any point.
#[derive(Debug)]
pub struct SignedField {
    field: EdgeField,
    edges: Vec<Edge>,
    /// The stretch of the boundary that each edge belongs to, by number.
    stretches: Vec<usize>,
    /// Where on its stretch each edge starts and how much of it it is.
    places: Vec<[f64; 2]>,
    /// The numbers of the stretches of each ring.
    rings: Vec<Range<usize>>,
    /// Unit normal of each stretch, from its start to its end.
    normals: Vec<Vector2<f64>>,
    /// How long each stretch is.
    lengths: Vec<f64>,
}

/// Where a point lies from the boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Distance from the boundary, positive inside.
    pub distance: f64,
    /// Its gradient, a unit vector.
    pub gradient: Vector2<f64>,
    /// Whether the nearest edge is one that was marked.
    pub marked: bool,
    /// The stretch of the boundary that it lies on, by number: a straight side, or a part of about the twentieth of the
    /// size of its ring.
    pub stretch: usize,
    /// Where on it, 0 at its start and 1 at its end.
    pub along: f64,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
    /// Unit normal towards the inside.
    inward: Vector2<f64>,
    /// Sums of this normal and the neighbor's at either end: they tell the side of a point that is nearest to the
    /// vertex.
    ends: [Vector2<f64>; 2],
    marked: bool,
}

impl SignedField {
    /// The field of a region's rings, with so many pixels to the unit; `marks` tells of each edge, ring by ring,
    /// whether it is marked (none where it is empty).
    pub fn new(rings: &[Vec<Vector2<f64>>], marks: &[Vec<bool>], pixels: f64) -> Self {
        let marks_of = |ring: usize| marks.get(ring).map_or(&[][..], Vec::as_slice);
        let edges: Vec<Edge> =
            rings.iter().enumerate().flat_map(|(index, ring)| ring_edges(ring, marks_of(index))).collect();
        let begins: Vec<Vec<bool>> = rings.iter().map(|ring| stretches(ring, STRAIGHT / pixels)).collect();
        let numbers_of = begins.iter().map(|begins| begins.iter().filter(|begins| **begins).count());
        let rings_of = numbers_of.scan(0, |last, count| Some(std::mem::replace(last, *last + count)..*last));
        let rings_of: Vec<Range<usize>> = rings_of.collect();
        let stretches: Vec<usize> = begins.into_iter().flatten().scan(0, numbered).map(|next| next - 1).collect();
        let ((places, lengths), normals) = (places(&edges, &stretches), normals(&edges, &stretches));
        Self { field: EdgeField::new(rings), edges, stretches, places, rings: rings_of, normals, lengths }
    }

    /// The numbers of the stretches of each ring, in its order.
    pub fn rings(&self) -> &[Range<usize>] {
        &self.rings
    }

    /// Unit normal of a stretch, from its start to its end.
    pub fn normal(&self, stretch: usize) -> Vector2<f64> {
        self.normals[stretch]
    }

    /// How long a stretch is.
    pub fn length(&self, stretch: usize) -> f64 {
        self.lengths[stretch]
    }

    /// Signed distance of a point, its gradient and where it is measured from.
    pub fn nearest(&self, point: &Vector2<f64>) -> Nearest {
        let number = self.field.nearest_edge(point);
        let edge = &self.edges[number];
        let (distance, gradient) = edge.distance(point);
        let [start, length] = self.places[number];
        let along = start + edge.share(point).clamp(0.0, 1.0) * length;
        Nearest { distance, gradient, marked: edge.marked, stretch: self.stretches[number], along }
    }
}

impl Edge {
    /// How far along it a point lies, as a share of its length.
    fn share(&self, point: &Vector2<f64>) -> f64 {
        (point - self.start).dot(&self.step) * self.inverse
    }

    /// Signed distance of a point that is nearest to this edge, and its gradient.
    fn distance(&self, point: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let offset = point - self.start;
        let share = self.share(point);
        if share > 0.0 && share < 1.0 {
            return (offset.dot(&self.inward), self.inward);
        }
        let (from_end, inward) = if share <= 0.0 { (offset, self.ends[0]) } else { (offset - self.step, self.ends[1]) };
        let (length, side) = (from_end.norm(), if from_end.dot(&inward) < 0.0 { -1.0 } else { 1.0 });
        let gradient = if length > 0.0 { from_end * (side / length) } else { self.inward };
        (side * length, gradient)
    }
}

/// Whether each edge of a ring begins a stretch: a straight side that is long enough, or the one after as much as that.
fn stretches(ring: &[Vector2<f64>], tolerance: f64) -> Vec<bool> {
    let enough = STRETCH * signed_area(ring).abs().sqrt();
    let corners = corners(ring, tolerance);
    let lengths: Vec<f64> = edges(ring).map(|(a, b)| (b - a).norm()).collect();
    let mut begins = vec![false; ring.len()];
    let mut last = f64::INFINITY;
    for (&first, &end) in corners.iter().zip(corners.iter().skip(1).chain([&ring.len()])) {
        let length: f64 = lengths[first..end].iter().sum();
        begins[first] = last >= enough || length >= enough;
        last = if begins[first] { length } else { last + length };
    }
    begins
}

/// The vertices of a ring, by number, between which it is straight: from the first, each as far on as all between lie
/// within the tolerance of rays from the last.
fn corners(ring: &[Vector2<f64>], tolerance: f64) -> Vec<usize> {
    let mut corners = vec![0];
    let mut cone: Option<[Vector2<f64>; 2]> = None;
    for end in 1..=ring.len() {
        let from = *corners.last().unwrap_or(&0);
        let next = ring[end % ring.len()];
        let way = next - ring[from];
        if cone.is_some_and(|[right, left]| right.perp(&way) < 0.0 || way.perp(&left) < 0.0) {
            corners.push(end - 1);
            cone = seen_from(&(next - ring[end - 1]), tolerance);
            continue;
        }
        if let Some([right, left]) = seen_from(&way, tolerance) {
            let [low, high] = cone.unwrap_or([right, left]);
            cone = Some([
                if low.perp(&right) > 0.0 { right } else { low },
                if left.perp(&high) > 0.0 { left } else { high },
            ]);
        }
    }
    corners
}

/// The rays that touch a circle around a point, the right one first; `None` from inside of it.
fn seen_from(way: &Vector2<f64>, radius: f64) -> Option<[Vector2<f64>; 2]> {
    let distance = way.norm();
    let reach = (distance * distance - radius * radius).sqrt();
    let aside = Vector2::new(-way.y, way.x) * (radius / distance);
    (distance > radius).then(|| [way * (reach / distance) - aside, way * (reach / distance) + aside])
}

/// Where on its stretch each edge starts and how much of it it is, and how long each stretch is.
fn places(edges: &[Edge], stretches: &[usize]) -> (Vec<[f64; 2]>, Vec<f64>) {
    let mut lengths = vec![0.0; stretches.last().map_or(0, |last| last + 1)];
    let mut starts = Vec::with_capacity(edges.len());
    for (edge, &stretch) in edges.iter().zip(stretches) {
        starts.push(lengths[stretch]);
        lengths[stretch] += edge.step.norm();
    }
    let all = |stretch: usize| f64::max(lengths[stretch], f64::MIN_POSITIVE);
    let place = |((edge, &stretch), start): ((&Edge, &usize), f64)| [start, edge.step.norm()].map(|x| x / all(stretch));
    (edges.iter().zip(stretches).zip(starts).map(place).collect(), lengths)
}

/// The unit normal of each stretch; of one that ends where it starts, any.
fn normals(edges: &[Edge], stretches: &[usize]) -> Vec<Vector2<f64>> {
    let mut ways = vec![Vector2::zeros(); stretches.last().map_or(0, |last| last + 1)];
    edges.iter().zip(stretches).for_each(|(edge, &stretch)| ways[stretch] += edge.step);
    let normal = |way: Vector2<f64>| Vector2::new(-way.y, way.x).try_normalize(0.0).unwrap_or_else(Vector2::x);
    ways.into_iter().map(normal).collect()
}

/// The number of the next stretch, one more than the last where one begins.
fn numbered(last: &mut usize, begins: bool) -> Option<usize> {
    *last += usize::from(begins);
    Some(*last)
}

fn ring_edges<'a>(ring: &'a [Vector2<f64>], marks: &'a [bool]) -> impl Iterator<Item = Edge> + 'a {
    let count = ring.len();
    let step = move |k: usize| ring[(k + 1) % count] - ring[k % count];
    let inward = move |k: usize| {
        let along = step(k);
        Vector2::new(-along.y, along.x) / along.norm().max(f64::MIN_POSITIVE)
    };
    (0..count).map(move |k| Edge {
        start: ring[k],
        step: step(k),
        inverse: 1.0 / step(k).norm_squared().max(f64::MIN_POSITIVE),
        inward: inward(k),
        ends: [inward(k) + inward(k + count - 1), inward(k) + inward(k + 1)],
        marked: marks.get(k) == Some(&true),
    })
}
