//! The image's border in a region's chart, and the part of the world inside it (`docs/math.md`, section 14).

use std::cell::Cell;

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::clipping::{Clipped, Window, holds};
use crate::geometry::edge_boxes::EdgeBoxes;
use crate::geometry::rings::{PlaneRings, ring_edges, signed_area};
use crate::noise::boundary::FINE;
use crate::view::bearing_rings::Bearing;
use crate::view::chart::Chart;

/// Share of an outline that the image has to show: less holds no pose.
const LEAST_SEEN: f64 = 0.05;

/// Where the visible part of the plane `z = 1` ends that no border bounds: 87 degrees off the chart's axis.
const REACH: f64 = 20.0;

/// Angle between neighboring points there, rad.
const REACH_STEP: f64 = 0.5;

/// Points of the world nearer to the camera's plane, along the chart's axis, than this share of the farthest are cut off.
const NEAR: f64 = 1e-3;

/// The border of the image as a region's chart shows it.
#[derive(Debug, Clone)]
pub struct Border {
    /// The visible part of the chart.
    visible: Window,
    /// Whether each edge of the observed outline lies on the border, ring by ring.
    on_border: Vec<Vec<bool>>,
}

impl Border {
    /// The border along which a region of an `outline` in its chart was cut, `pixel` being a pixel's size there.
    ///
    /// `None` where nothing of the outline lies on the border.
    ///
    /// # Errors
    /// When hardly any of the outline lies elsewhere, or the border bends out of the chart.
    pub fn of(
        lines: &[Vec<Bearing>],
        chart: &Chart,
        outline: &PlaneRings,
        pixel: f64,
        budget: &Budget,
    ) -> Result<Option<Self>> {
        let mut lines = projected_lines("border", lines, chart)?;
        for (line, points) in lines.iter_mut().enumerate() {
            // A line is extended beyond its ends along its last two points, which must differ.
            points.dedup();
            if points.len() < 2 {
                return Err(Error::ShortLine { item: "border", line, found: points.len() });
            }
        }
        let on_border = edges_along(&lines, outline, pixel, budget);
        let flat = || on_border.iter().flatten().copied();
        if !flat().any(|on_border| on_border) {
            return Ok(None);
        }
        let share = share_of_others(outline, &on_border);
        if share < LEAST_SEEN {
            return Err(Error::InvalidObservation {
                item: "the share of the observed outline inside the image",
                found: format!("{:.1} %, the rest of it on the image's border", 100.0 * share),
                needed: format!("at least {:.0} %", 100.0 * LEAST_SEEN),
            });
        }
        let middles = || outline.edges().map(|(a, b)| a.lerp(&b, 0.5)).zip(flat());
        let inside: Vec<_> = middles().filter(|(_, on_border)| !on_border).map(|(middle, _)| middle).collect();
        let visible = Window::new(vec![visible(lines, &inside, REACH * chart.scale)]);
        Ok(Some(Self { visible, on_border }))
    }

    /// Whether each edge of the observed outline lies on the border, ring by ring.
    pub fn on_border(&self) -> &[Vec<bool>] {
        &self.on_border
    }

    /// Edges of the visible part.
    pub fn edge_count(&self) -> usize {
        self.visible.edge_count()
    }

    /// The visible part of a region's rings in the chart, and the side from which they are seen: -1 from behind, where
    /// they turn the other way and are turned round.
    pub fn clipped(&self, mut rings: Vec<Vec<Vector2<f64>>>, budget: &Budget) -> (Clipped, f64) {
        let behind = rings.iter().map(|ring| signed_area(ring)).sum::<f64>() < 0.0;
        if behind {
            rings.iter_mut().for_each(|ring| ring.reverse());
        }
        (self.visible.shared_with(&rings, budget), if behind { -1.0 } else { 1.0 })
    }
}

/// The part of a closed ring, given along the chart's axes, that lies clearly before the camera, in chart coordinates
/// (Sutherland and Hodgman 1974).
pub fn projected_before(ring: &[Vector3<f64>], chart: &Chart) -> Vec<Vector2<f64>> {
    let near = near_plane(ring);
    let project = |p: Vector3<f64>| p.xy() * (chart.scale / p.z);
    let mut visible_ring = Vec::with_capacity(ring.len() + 2);
    for (a, b) in ring.iter().zip(ring.iter().skip(1).chain(ring.first())) {
        if let Some([from, to]) = edge_before(near, a, b) {
            visible_ring.push(project(from));
            visible_ring.extend((b.z < near).then(|| project(to)));
        }
    }
    visible_ring
}

/// The part of an edge, along the chart's axes, before the plane that [`near_plane`] gives; `None` where there is none.
pub fn edge_before(near: f64, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<[Vector3<f64>; 2]> {
    let crossing = || a.lerp(b, (near - a.z) / (b.z - a.z));
    match (a.z >= near, b.z >= near) {
        (true, true) => Some([*a, *b]),
        (true, false) => Some([*a, crossing()]),
        (false, true) => Some([crossing(), *b]),
        (false, false) => None,
    }
}

/// The depth before which a ring of points counts as behind the camera.
pub fn near_plane(ring: &[Vector3<f64>]) -> f64 {
    NEAR * ring.iter().map(|p| p.norm_squared()).fold(f64::MIN_POSITIVE, f64::max).sqrt()
}

/// Which edges of an outline in its chart are not the region's own boundary, ring by ring: those on the image's border,
/// and those along the lines of hidden edges; and whether there are any of these. `pixel` is a pixel's size in the
/// chart.
///
/// # Errors
/// When hardly any of the outline is left, or a line is none.
pub fn foreign_edges(
    hidden: &[Vec<Bearing>],
    border: Option<&Border>,
    chart: &Chart,
    outline: &PlaneRings,
    pixel: f64,
    budget: &Budget,
) -> Result<(Vec<Vec<bool>>, bool)> {
    let mut foreign = edges_along(&projected_lines("hidden", hidden, chart)?, outline, pixel, budget);
    let any_hidden = foreign.iter().flatten().any(|&hidden| hidden);
    for (edges, on_border) in foreign.iter_mut().zip(border.map_or(&[][..], Border::on_border)) {
        edges.iter_mut().zip(on_border).for_each(|(foreign, &on_border)| *foreign |= on_border);
    }
    let share = if any_hidden { share_of_others(outline, &foreign) } else { 1.0 };
    if share < LEAST_SEEN {
        return Err(Error::InvalidObservation {
            item: "the share of the observed outline that is the region's own",
            found: format!("{:.1} %, the rest of it hidden or on the image's border", 100.0 * share),
            needed: format!("at least {:.0} %", 100.0 * LEAST_SEEN),
        });
    }
    Ok((foreign, any_hidden))
}

/// Whether each edge of an outline lies along one of the lines, ring by ring.
fn edges_along(lines: &[Vec<Vector2<f64>>], outline: &PlaneRings, pixel: f64, budget: &Budget) -> Vec<Vec<bool>> {
    let ends = lines.iter().flat_map(|line| line.windows(2)).map(|ends| [ends[0], ends[1]]);
    let (edges, within) = (EdgeBoxes::new(ends.collect()), FINE * pixel);
    let near = |p: &Vector2<f64>| {
        let found = Cell::new(false);
        edges.for_each_near(
            |[low, high]| !found.get() && (0..2).all(|k| low[k] - within <= p[k] && p[k] <= high[k] + within),
            |_, ends| found.set(found.get() || distance(ends, p) < within),
            budget,
        );
        found.get()
    };
    let along = |(a, b): (Vector2<f64>, Vector2<f64>)| near(&a) && near(&b) && near(&a.lerp(&b, 0.5));
    outline.rings().iter().map(|ring| ring_edges(ring).map(along).collect()).collect()
}

/// The share of an outline's length that is not marked.
fn share_of_others(outline: &PlaneRings, marked: &[Vec<bool>]) -> f64 {
    let lengths = || outline.edges().map(|(a, b)| (b - a).norm());
    let unmarked = lengths().zip(marked.iter().flatten()).map(|(length, &marked)| if marked { 0.0 } else { length });
    unmarked.sum::<f64>() / lengths().sum::<f64>()
}

fn projected_lines(item: &'static str, lines: &[Vec<Bearing>], chart: &Chart) -> Result<Vec<Vec<Vector2<f64>>>> {
    lines.iter().enumerate().map(|(index, line)| projected(item, index, line, chart)).collect()
}

/// A line of bearings in the chart, without what lies outside of it at both ends.
fn projected(item: &'static str, index: usize, line: &[Bearing], chart: &Chart) -> Result<Vec<Vector2<f64>>> {
    if line.len() < 2 {
        return Err(Error::ShortLine { item, line: index, found: line.len() });
    }
    let points: Vec<_> = line.iter().map(|bearing| chart.project(bearing)).collect();
    let first = points.iter().position(Option::is_some).unwrap_or(0);
    let last = points.iter().rposition(Option::is_some).unwrap_or(0);
    let inside = points[first..=last].iter().copied().collect::<Option<Vec<_>>>();
    inside.filter(|line| line.len() > 1).ok_or_else(|| Error::InvalidObservation {
        item: "a line of the image's border or of hidden edges beside the observed region",
        found: "a line that leaves the region's half space".into(),
        needed: "a line that is in view beside the region".into(),
    })
}

/// Distance of a point from an edge.
fn distance([from, to]: [Vector2<f64>; 2], point: &Vector2<f64>) -> f64 {
    let step = to - from;
    let share = (point - from).dot(&step) / step.norm_squared().max(f64::MIN_POSITIVE);
    (point - from - step * share.clamp(0.0, 1.0)).norm()
}

/// The ring around what the lines leave visible within a radius, counter-clockwise; `inside` are some points in it.
fn visible(mut lines: Vec<Vec<Vector2<f64>>>, inside: &[Vector2<f64>], radius: f64) -> Vec<Vector2<f64>> {
    let ring = joined(&lines, radius);
    let within = std::slice::from_ref(&ring);
    if 2 * inside.iter().filter(|p| holds(within, **p, 1.0)).count() >= inside.len() {
        return ring;
    }
    // A camera that mirrors the image has the visible side on the other hand.
    lines.iter_mut().for_each(|line| line.reverse());
    lines.reverse();
    joined(&lines, radius)
}

/// The lines, prolonged to a circle and joined along it, with the inside on their left.
fn joined(lines: &[Vec<Vector2<f64>>], radius: f64) -> Vec<Vector2<f64>> {
    if let [line] = lines
        && line.first() == line.last()
    {
        return line[1..].to_vec();
    }
    let mut ring = Vec::new();
    for (k, line) in lines.iter().enumerate() {
        let (count, next) = (line.len(), &lines[(k + 1) % lines.len()]);
        let end = prolonged(&line[count - 2], &line[count - 1], radius);
        let start = prolonged(&next[1], &next[0], radius);
        ring.extend_from_slice(line);
        ring.push(end);
        let from = end.y.atan2(end.x);
        let turn = (start.y.atan2(start.x) - from).rem_euclid(std::f64::consts::TAU);
        let steps = (turn / REACH_STEP).ceil().max(1.0) as usize;
        ring.extend((1..steps).map(|step| {
            let angle = from + turn * step as f64 / steps as f64;
            Vector2::new(angle.cos(), angle.sin()) * radius
        }));
        ring.push(start);
    }
    ring
}

/// Intersection of the ray from `a` through `b` and a circle about the origin.
fn prolonged(a: &Vector2<f64>, b: &Vector2<f64>, radius: f64) -> Vector2<f64> {
    let step = (b - a).normalize();
    let along = b.dot(&step);
    let off = (radius * radius - b.norm_squared() + along * along).max(0.0).sqrt();
    b + step * (off - along).max(f64::EPSILON * radius)
}
