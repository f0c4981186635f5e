//! Signed distance field of the rings that bound a region, with its gradient, and the cut of their boundary into segments
//! (`docs/math.md`, eq. 17.1).

use std::ops::Range;

use nalgebra::Vector2;

use crate::contour::pieces::edges;
use crate::geometry::edge_field::EdgeField;
use crate::geometry::rings::signed_area;
use crate::noise::boundary::MEDIUM;
use crate::noise::contamination::SIZE_RATIO;

/// Signed distance field of oriented rings, outer ones counter-clockwise.
#[derive(Debug)]
pub struct SignedDistanceField {
    field: EdgeField,
    edges: Vec<Edge>,
    /// Number of the segment that each edge belongs to.
    segments: Vec<usize>,
    /// Start and length of each edge, as fractions of its segment's length.
    spans: Vec<[f64; 2]>,
    /// Numbers of the segments of each ring.
    rings: Vec<Range<usize>>,
    /// Unit normal of each segment's chord.
    normals: Vec<Vector2<f64>>,
    /// Arc length of each segment.
    lengths: Vec<f64>,
}

/// Signed distance of a point, and the boundary point nearest to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedDistance {
    /// Distance from the boundary, positive inside.
    pub distance: f64,
    /// Its gradient, a unit vector.
    pub gradient: Vector2<f64>,
    /// Whether the nearest edge is a marked one.
    pub is_marked: bool,
    /// Number of the segment that the nearest point lies on: a straight side, or a part of about a twentieth of the ring's size.
    pub segment: usize,
    /// Arc length of the nearest point along its segment, from 0 at the start to 1 at the end.
    pub along: f64,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
    /// Unit normal towards the inside.
    inward: Vector2<f64>,
    /// Sums of this normal and the neighbor's at either vertex, which sign the distance of points nearest to that vertex.
    vertex_normals: [Vector2<f64>; 2],
    is_marked: bool,
}

impl SignedDistanceField {
    /// The field of a region's rings, at `pixels` pixels per unit; `marks` holds a mark for each edge, ring by ring, or is empty.
    pub fn new(rings: &[Vec<Vector2<f64>>], marks: &[Vec<bool>], pixels: f64) -> Self {
        let marks_of = |ring: usize| marks.get(ring).map_or(&[][..], Vec::as_slice);
        let edges: Vec<Edge> =
            rings.iter().enumerate().flat_map(|(index, ring)| ring_edges(ring, marks_of(index))).collect();
        // The steps of a mask do not end a straight segment.
        let starts: Vec<Vec<bool>> = rings.iter().map(|ring| segment_starts(ring, MEDIUM / pixels)).collect();
        let counts = starts.iter().map(|starts| starts.iter().filter(|starts| **starts).count());
        let rings_of = counts.scan(0, |last, count| Some(std::mem::replace(last, *last + count)..*last));
        let rings_of: Vec<Range<usize>> = rings_of.collect();
        let segments: Vec<usize> = starts.into_iter().flatten().scan(0, count_starts).map(|next| next - 1).collect();
        let ((spans, lengths), normals) = (spans(&edges, &segments), normals(&edges, &segments));
        Self { field: EdgeField::new(rings), edges, segments, spans, rings: rings_of, normals, lengths }
    }

    /// Numbers of the segments of each ring, in its order.
    pub fn rings(&self) -> &[Range<usize>] {
        &self.rings
    }

    /// Unit normal of a segment's chord, to the left of its direction.
    pub fn normal(&self, segment: usize) -> Vector2<f64> {
        self.normals[segment]
    }

    /// Arc length of a segment.
    pub fn length(&self, segment: usize) -> f64 {
        self.lengths[segment]
    }

    /// Signed distance of a point.
    pub fn at(&self, point: &Vector2<f64>) -> SignedDistance {
        let number = self.field.nearest_edge(point);
        let edge = &self.edges[number];
        let (distance, gradient) = edge.distance(point);
        let [start, length] = self.spans[number];
        let along = start + edge.fraction(point).clamp(0.0, 1.0) * length;
        SignedDistance { distance, gradient, is_marked: edge.is_marked, segment: self.segments[number], along }
    }
}

impl Edge {
    /// Position of a point's projection onto the edge, as a fraction of its length.
    fn fraction(&self, point: &Vector2<f64>) -> f64 {
        (point - self.start).dot(&self.step) * self.inverse
    }

    /// Signed distance of a point that is nearest to this edge, and its gradient.
    fn distance(&self, point: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let offset = point - self.start;
        let fraction = self.fraction(point);
        if fraction > 0.0 && fraction < 1.0 {
            return (offset.dot(&self.inward), self.inward);
        }
        let [at_start, at_end] = self.vertex_normals;
        let (from_vertex, inward) = if fraction <= 0.0 { (offset, at_start) } else { (offset - self.step, at_end) };
        let (length, sign) = (from_vertex.norm(), if from_vertex.dot(&inward) < 0.0 { -1.0 } else { 1.0 });
        let gradient = if length > 0.0 { from_vertex * (sign / length) } else { self.inward };
        (sign * length, gradient)
    }
}

/// Whether each edge of a ring starts a segment: a straight part of the least length, or what follows on as much as that.
fn segment_starts(ring: &[Vector2<f64>], tolerance: f64) -> Vec<bool> {
    // Half of how far disturbed parts are off.
    let least = 0.5 * SIZE_RATIO * signed_area(ring).abs().sqrt();
    let corners = corners(ring, tolerance);
    let lengths: Vec<f64> = edges(ring).map(|(a, b)| (b - a).norm()).collect();
    let mut starts = vec![false; ring.len()];
    let mut last = f64::INFINITY;
    for (&first, &end) in corners.iter().zip(corners.iter().skip(1).chain([&ring.len()])) {
        let length: f64 = lengths[first..end].iter().sum();
        starts[first] = last >= least || length >= least;
        last = if starts[first] { length } else { last + length };
    }
    starts
}

/// Vertices of a ring, by number, between which it is straight: each is as far on as all vertices between lie within the tolerance of
/// rays from the last one (cone intersection).
fn corners(ring: &[Vector2<f64>], tolerance: f64) -> Vec<usize> {
    let mut corners = vec![0];
    let mut cone: Option<[Vector2<f64>; 2]> = None;
    for end in 1..=ring.len() {
        let from = *corners.last().unwrap_or(&0);
        let next = ring[end % ring.len()];
        let direction = next - ring[from];
        if cone.is_some_and(|[right, left]| right.perp(&direction) < 0.0 || direction.perp(&left) < 0.0) {
            corners.push(end - 1);
            cone = tangent_rays(&(next - ring[end - 1]), tolerance);
            continue;
        }
        if let Some([right, left]) = tangent_rays(&direction, tolerance) {
            let [low, high] = cone.unwrap_or([right, left]);
            cone = Some([
                if low.perp(&right) > 0.0 { right } else { low },
                if left.perp(&high) > 0.0 { left } else { high },
            ]);
        }
    }
    corners
}

/// Directions of the tangents to a circle at `center`, from the origin, the right one first; `None` inside the circle.
fn tangent_rays(center: &Vector2<f64>, radius: f64) -> Option<[Vector2<f64>; 2]> {
    let distance = center.norm();
    let length = (distance * distance - radius * radius).sqrt();
    let across = Vector2::new(-center.y, center.x) * (radius / distance);
    (distance > radius).then(|| [center * (length / distance) - across, center * (length / distance) + across])
}

/// Start and length of each edge as fractions of its segment, and the arc length of each segment.
fn spans(edges: &[Edge], segments: &[usize]) -> (Vec<[f64; 2]>, Vec<f64>) {
    let mut lengths = vec![0.0; segments.last().map_or(0, |last| last + 1)];
    let mut starts = Vec::with_capacity(edges.len());
    for (edge, &segment) in edges.iter().zip(segments) {
        starts.push(lengths[segment]);
        lengths[segment] += edge.step.norm();
    }
    let whole = |segment: usize| f64::max(lengths[segment], f64::MIN_POSITIVE);
    let span =
        |((edge, &segment), start): ((&Edge, &usize), f64)| [start, edge.step.norm()].map(|x| x / whole(segment));
    (edges.iter().zip(segments).zip(starts).map(span).collect(), lengths)
}

/// Unit normal of each segment's chord; of one that ends where it starts, any.
fn normals(edges: &[Edge], segments: &[usize]) -> Vec<Vector2<f64>> {
    let mut chords = vec![Vector2::zeros(); segments.last().map_or(0, |last| last + 1)];
    edges.iter().zip(segments).for_each(|(edge, &segment)| chords[segment] += edge.step);
    let normal = |chord: Vector2<f64>| Vector2::new(-chord.y, chord.x).try_normalize(0.0).unwrap_or_else(Vector2::x);
    chords.into_iter().map(normal).collect()
}

/// The number of segments that have started so far.
fn count_starts(count: &mut usize, starts: bool) -> Option<usize> {
    *count += usize::from(starts);
    Some(*count)
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
        vertex_normals: [inward(k) + inward(k + count - 1), inward(k) + inward(k + 1)],
        is_marked: marks.get(k) == Some(&true),
    })
}
