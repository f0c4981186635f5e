//! Edges of a cloud as points of the world, in groups that a camera sees or not as a whole.

use std::array;
use std::f64::consts::PI;

use nalgebra::Vector3;

use super::edges::{self, Step, VisiblePoints};
use super::groups::{Floats, GROUP};
use crate::error::{Error, Result};
use crate::geometry::pose::Pose;

/// Edges nearer to the scanner than this are its own vehicle's or tripod's, meters: a convention.
const LEAST_DISTANCE: f64 = 0.5;

/// Edges of a cloud as seen from a place: where surfaces end, or their shade changes.
#[derive(Debug, Clone)]
pub struct CloudEdges {
    /// Points half-way between both sides of an edge, at the near side's distance, world coordinates, meters.
    middles: Vec<Vector3<f64>>,
    /// Ways from there across the edge, to the far side's bearing at the same distance, meters.
    across: Vec<Vector3<f64>>,
}

/// How edges of a cloud are detected.
#[derive(Debug, Clone, Copy)]
pub struct EdgeOptions {
    /// Of points whose bearings differ by less, the nearest hides the others, rad.
    pub cell: f64,
    /// Neighbors farther apart are none, rad.
    pub gap: f64,
    /// How far an edge goes beyond the plane of the near side, as a fraction of the inverse distance.
    pub step_fraction: f64,
}

/// Cones of bearings within which edges are detected, as of cameras.
#[derive(Debug, Clone)]
pub struct EdgeField {
    /// Axes of the cones, unit vectors of the world.
    axes: Vec<Vector3<f64>>,
    /// Cosine of half the angle at their tips.
    cosine: f64,
}

impl EdgeField {
    /// All bearings.
    pub fn whole() -> Self {
        Self { axes: vec![Vector3::z()], cosine: f64::NEG_INFINITY }
    }

    /// Those within an angle, rad, of one of some axes; all from a straight angle on.
    ///
    /// # Errors
    /// For an axis without a direction, and for an angle that is not positive.
    pub fn cones(axes: &[Vector3<f64>], angle: f64) -> Result<Self> {
        let invalid = |item, found: String, needed: &str| Error::InvalidOption { item, found, needed: needed.into() };
        if angle.is_nan() || angle <= 0.0 {
            return Err(invalid("angle", format!("{angle}"), "an angle above 0 rad"));
        }
        let unit = |axis: &Vector3<f64>| {
            let length = axis.norm();
            let found = || invalid("axes", format!("({}, {}, {})", axis.x, axis.y, axis.z), "vectors with a direction");
            if length.is_finite() && length > 0.0 { Ok(axis / length) } else { Err(found()) }
        };
        let axes = axes.iter().map(unit).collect::<Result<_>>()?;
        Ok(if angle < PI { Self { axes, cosine: angle.cos() } } else { Self::whole() })
    }

    /// Whether a point relative to the tips lies within a cone, at a distance.
    fn contains(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let least = self.cosine * distance;
        self.axes.iter().any(|axis| axis.dot(point) >= least)
    }
}

/// The points of a cloud that lie within a field, with their shades if there are any, in the cloud's order.
#[derive(Debug, Clone)]
pub struct SeenPoints {
    /// Where they are seen from, world coordinates, meters.
    place: Vector3<f64>,
    /// Relative to that.
    local: Vec<Vector3<f64>>,
    shades: Option<Vec<f64>>,
}

impl SeenPoints {
    /// Those of a cloud's points (world coordinates, meters), of which each has a shade where there are any.
    pub fn new(
        points: impl Iterator<Item = Vector3<f64>>,
        shades: Option<&[f64]>,
        place: &Vector3<f64>,
        field: &EdgeField,
    ) -> Self {
        let (mut local, mut kept_shades) = (Vec::new(), shades.map(|_| Vec::new()));
        for (number, point) in points.enumerate() {
            let point = point - place;
            let distance = point.norm();
            // What is left out hides nothing, either.
            if !(distance > LEAST_DISTANCE && field.contains(&point, distance)) {
                continue;
            }
            local.push(point);
            if let (Some(kept), Some(shades)) = (&mut kept_shades, shades) {
                kept.push(shades.get(number).copied().unwrap_or(f64::NAN));
            }
        }
        Self { place: *place, local, shades: kept_shades }
    }
}

/// By how much edges are thinned: as many are kept of each part of a cloud, however large that is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thinning {
    of: usize,
    kept: usize,
}

impl Thinning {
    /// To at most so many of a number of edges.
    pub fn to(most: usize, count: usize) -> Self {
        Self { of: count.max(1), kept: count.clamp(1, most.max(1)) }
    }
}

impl CloudEdges {
    /// The edges of points (world coordinates, meters), and of their shades if there are any, as seen from a place.
    pub fn new(points: &[Vector3<f64>], shades: Option<&[f64]>, place: &Vector3<f64>, options: &EdgeOptions) -> Self {
        Self::within(points, shades, place, options, &EdgeField::whole())
    }

    /// The same of the points that are seen within a field.
    pub fn within(
        points: &[Vector3<f64>],
        shades: Option<&[f64]>,
        place: &Vector3<f64>,
        options: &EdgeOptions,
        field: &EdgeField,
    ) -> Self {
        Self::of_points(&SeenPoints::new(points.iter().copied(), shades, place, field), options)
    }

    /// The same of points that were picked before.
    pub fn of_points(seen: &SeenPoints, options: &EdgeOptions) -> Self {
        let EdgeOptions { cell, gap, step_fraction } = *options;
        let steps = match &seen.shades {
            None => edges::depth_steps(&seen.local, cell, gap, step_fraction),
            Some(shades) => {
                let visible = VisiblePoints::new(&seen.local, cell, gap);
                [visible.depth_steps(step_fraction), visible.shade_steps(shades, step_fraction)].concat()
            }
        };
        Self::of(&steps, &seen.place)
    }

    /// The edges of steps as seen from a place.
    fn of(steps: &[Step], place: &Vector3<f64>) -> Self {
        let middle = |step: &Step| (step.near + step.far).normalize() * step.distance;
        Self {
            middles: steps.iter().map(|step| place + middle(step)).collect(),
            across: steps.iter().map(|step| step.far * step.distance - middle(step)).collect(),
        }
    }

    /// Number of edges.
    pub fn len(&self) -> usize {
        self.middles.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.middles.is_empty()
    }

    /// The point half-way between both sides of an edge, and the way from there to the far side, world coordinates, meters.
    pub fn at(&self, edge: usize) -> (Vector3<f64>, Vector3<f64>) {
        (self.middles[edge], self.across[edge])
    }

    /// Some of them, spread evenly over the order in which they were found, which is that of their bearings.
    pub fn thinned(&self, thinning: &Thinning) -> Self {
        let Thinning { of, kept } = *thinning;
        let chosen = (0..(self.len() * kept).div_ceil(of)).map(|index| index * of / kept);
        let (middles, across) = chosen.map(|index| (self.middles[index], self.across[index])).unzip();
        Self { middles, across }
    }
}

/// Edges in groups of neighbors.
#[derive(Debug, Clone)]
pub(super) struct GroupedEdges(Vec<EdgeGroup>);

/// Edges that lie within a sphere, in single precision about an origin; NaN where they are fewer than a group holds.
#[derive(Debug, Clone)]
pub(super) struct EdgeGroup {
    pub(super) middles: [Floats; 3],
    pub(super) across: [Floats; 3],
    pub(super) count: usize,
    center: Vector3<f64>,
    radius: f64,
}

impl GroupedEdges {
    /// Of edges given in the world, about an origin of it.
    pub(super) fn new(edges: &CloudEdges, origin: &Vector3<f64>) -> Self {
        let local: Vec<_> = edges.middles.iter().map(|middle| middle - origin).collect();
        let places: Vec<_> = local.iter().map(place_of).collect();
        let mut order: Vec<usize> = (0..local.len()).collect();
        split(&places, &mut order);
        Self(order.chunks(GROUP).map(|held| EdgeGroup::new(&local, &edges.across, held)).collect())
    }

    /// The groups of which some edges may lie within an angle of a camera's axis, by the cosine and sine of that angle.
    pub(super) fn within(&self, pose: &Pose, [cosine, sine]: [f64; 2]) -> impl Iterator<Item = &EdgeGroup> {
        let pose = *pose;
        let may_show = move |group: &&EdgeGroup| {
            let center = pose.transform(&group.center);
            // The distance of the sphere's center beyond the cone: from its side, or from its tip where that is nearer. Within a cone of
            // more than a right angle the center may be nearer to the tip than to any side.
            let (along, away) = (center.z, center.xy().norm());
            let beyond = away * cosine - along * sine;
            let from_tip = along * cosine + away * sine;
            beyond <= 0.0 || (beyond <= group.radius && from_tip >= 0.0) || center.norm() <= group.radius
        };
        self.0.iter().filter(may_show)
    }
}

impl EdgeGroup {
    fn new(middles: &[Vector3<f64>], across: &[Vector3<f64>], held: &[usize]) -> Self {
        let center = held.iter().map(|edge| middles[*edge]).sum::<Vector3<f64>>() / held.len() as f64;
        let radius = held.iter().map(|edge| (middles[*edge] - center).norm()).fold(0.0, f64::max);
        let floats = |of: &[Vector3<f64>], axis: usize| {
            array::from_fn(|place| held.get(place).map_or(f32::NAN, |edge| of[*edge][axis] as f32))
        };
        Self {
            middles: array::from_fn(|axis| floats(middles, axis)),
            across: array::from_fn(|axis| floats(across, axis)),
            count: held.len(),
            center,
            radius,
        }
    }
}

/// A point's bearing and the logarithm of its distance.
fn place_of(point: &Vector3<f64>) -> [f64; 4] {
    let distance = point.norm().max(LEAST_DISTANCE);
    let bearing = point / distance;
    [bearing.x, bearing.y, bearing.z, distance.ln()]
}

/// Puts edges in an order in which neighbors follow one another, halving them along the direction in which their places spread most, down
/// to groups; all of these but the last are full.
fn split(places: &[[f64; 4]], order: &mut [usize]) {
    if order.len() <= GROUP {
        return;
    }
    let spread = |axis: usize| {
        let values = order.iter().map(|edge| places[*edge][axis]);
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        most - least
    };
    let axis = (0..4).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0);
    let half = (order.len() / 2).next_multiple_of(GROUP);
    order.select_nth_unstable_by(half, |a, b| places[*a][axis].total_cmp(&places[*b][axis]).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(half);
    split(places, low);
    split(places, high);
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::ptr;

    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        let entry = || -size..size;
        (entry(), entry(), entry()).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    /// Edges in heaps, as of walls, poles and cars, each at a place of its own.
    fn edges() -> impl Strategy<Value = CloudEdges> {
        let heap = (vector(20.0), 0.0..6.0_f64, prop::collection::vec(vector(1.0), 1..80))
            .prop_map(|(middle, size, ways)| ways.into_iter().map(move |way| middle + way * size));
        prop::collection::vec(heap, 0..5).prop_map(|heaps| {
            let middles: Vec<_> = heaps.into_iter().flatten().collect();
            let across = middles.iter().map(|middle| middle.cross(&Vector3::y()) * 0.01).collect();
            CloudEdges { middles, across }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Cameras of any field, panoramas among them, that stand among the edges.
        #[test]
        fn no_edge_within_the_cone_is_left_out(
            edges in edges(),
            turn in vector(2.0),
            translation in vector(10.0),
            origin in vector(5.0),
            angle in 0.0..=PI,
        ) {
            let grouped = GroupedEdges::new(&edges, &origin);
            let pose = Pose::new(Rotation3::new(turn), translation);
            let shown: Vec<_> = grouped.within(&pose, [angle.cos(), angle.sin()]).collect();
            for group in &grouped.0 {
                let times = shown.iter().filter(|held| ptr::eq(**held, group)).count();
                prop_assert!(times <= 1, "a group comes {times} times");
                for edge in 0..group.count {
                    let middle = Vector3::from_fn(|axis, _| f64::from(group.middles[axis][edge]));
                    let local = pose.transform(&middle);
                    let off = local.xy().norm().atan2(local.z);
                    prop_assert!(times == 1 || off > angle - 1e-5, "{off} of {angle}");
                }
            }
        }

        #[test]
        fn groups_hold_every_edge_once_and_are_small(edges in edges(), origin in vector(5.0)) {
            let grouped = GroupedEdges::new(&edges, &origin);
            let last = grouped.0.len().saturating_sub(1);
            for (place, group) in grouped.0.iter().enumerate() {
                prop_assert!(group.count == GROUP || (place == last && (1..GROUP).contains(&group.count)));
                let mut rest = group.middles.iter().chain(&group.across).flat_map(|values| &values[group.count..]);
                prop_assert!(rest.all(|value| value.is_nan()));
            }
            // The same edges in another order, each with its own way across.
            let bits = |values: [f32; 6]| values.map(f32::to_bits);
            let held = grouped.0.iter().flat_map(|group| (0..group.count).map(move |edge| (group, edge)));
            let mut found: Vec<_> = held
                .map(|(group, edge)| {
                    let of = |from: &[Floats; 3]| from.map(|values| values[edge]);
                    let ([a, b, c], [d, e, f]) = (of(&group.middles), of(&group.across));
                    bits([a, b, c, d, e, f])
                })
                .collect();
            let mut given: Vec<_> = edges.middles.iter().zip(&edges.across)
                .map(|(middle, across)| {
                    let middle = middle - origin;
                    bits([middle.x, middle.y, middle.z, across.x, across.y, across.z].map(|value| value as f32))
                })
                .collect();
            found.sort_unstable();
            given.sort_unstable();
            prop_assert_eq!(found, given);
        }

        #[test]
        fn thinned_edges_are_some_of_them_in_order(edges in edges(), most in 1..300_usize) {
            let thinned = edges.thinned(&Thinning::to(most, edges.len()));
            prop_assert_eq!(thinned.len(), edges.len().min(most));
            let mut rest = edges.middles.iter();
            prop_assert!(thinned.middles.iter().all(|middle| rest.any(|other| other == middle)));
        }
    }

    /// Most groups of a cloud all around lie outside of the view of a usual camera.
    #[test]
    fn a_narrow_view_leaves_most_edges_out() {
        let ring = (0..10_000).map(|number| {
            let angle = f64::from(number) * 0.1;
            Vector3::new(angle.sin(), 0.2 * (angle * 7.0).sin(), angle.cos()) * (4.0 + (angle * 3.0).sin())
        });
        let middles: Vec<_> = ring.collect();
        let grouped = GroupedEdges::new(&CloudEdges { across: middles.clone(), middles }, &Vector3::zeros());
        let (sine, cosine) = 0.35_f64.sin_cos();
        let count: usize = grouped.within(&Pose::identity(), [cosine, sine]).map(|group| group.count).sum();
        // Of 10,000 as many as 0.7 of 2 pi at the most, and some beside.
        assert!((500..2000).contains(&count), "{count}");
    }
}
