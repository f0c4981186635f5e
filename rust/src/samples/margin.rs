//! Signed margins of a region's samples from its observed contour, and their derivatives by the pose (`docs/math.md`, eq. 17.1,
//! 17.2).

use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};

use super::signed_distance::SignedDistanceField;
use crate::budget::Budget;
use crate::equations::residual::RegionEquations;
use crate::geometry::pose::Pose;
use crate::region::WorldRegion;

/// Least depth over distance, along the chart's axis, of a sample in front of the camera.
const MIN_DEPTH_RATIO: f64 = 0.05;

/// A margin beyond this many standard deviations carries no information on the pose.
pub(super) const MAX_SIGMAS: f64 = 6.0;

/// Work of one projected sample, in edges: those of the grid cells around it.
pub(super) const EDGES_PER_PROJECTION: usize = 16;

/// The observed contour of a region and the samples of its world region.
#[derive(Debug)]
pub struct SampledRegion {
    /// Index among the problem's regions.
    index: usize,
    /// `chart_from_camera`.
    rotation: Rotation3<f64>,
    /// The contour on the plane z = 1 of the chart's axes; edges that are not the region's own are marked.
    contour: SignedDistanceField,
    /// Pixels per unit of that plane.
    pixels: f64,
    /// Square root of the region's area, pixels.
    size: f64,
    /// Samples about the problem's origin, and whether each is inside.
    samples: Vec<(Vector3<f64>, bool)>,
    /// Axes of the plane that the samples lie on.
    axes: [Vector3<f64>; 2],
    /// Numbers of the samples by angle about the centroid of those inside, found once.
    by_angle: OnceLock<Vec<usize>>,
}

/// A sample as a pose projects it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProjectedSample {
    /// In front of the camera, with its margin.
    Visible(Margin),
    /// Behind the camera, where no region is seen.
    Behind {
        /// Whether the label is right: that of a sample outside.
        is_correct: bool,
    },
}

/// The kind of the contour's edge nearest to a sample. Behind an occluder the region may continue, so labels there are
/// uninformative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeKind {
    /// The region's own boundary.
    Own,
    /// The border of the image or of an occluder, nearest to a sample inside the region.
    OccludedInside,
    /// The same, nearest to a sample outside.
    OccludedOutside,
}

/// Margin of a sample: its signed distance from the observed contour, positive on the side of its label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// The margin, pixels.
    pub value: f64,
    /// Its derivative by the left increment.
    pub gradient: Vector6<f64>,
    /// Its derivative by an outward offset of the contour: 1 inside, -1 outside.
    pub outward: f64,
    /// Position of the nearest point along its segment, from 0 at the start to 1 at the end.
    pub along: f64,
    /// Kind of the nearest edge.
    pub edge: EdgeKind,
    /// Number of the contour segment that the nearest point lies on.
    pub segment: usize,
}

impl SampledRegion {
    /// The samples of the region with this index in a problem, about `origin`; `None` where it has none.
    pub fn new(index: usize, region: &RegionEquations, world: &WorldRegion, origin: &Vector3<f64>) -> Option<Self> {
        let samples = world.samples()?;
        let lifted = |inside: bool| move |p| (world.frame().to_world(p) - origin, inside);
        let inside = samples.inside().iter().map(lifted(true));
        // A contour without holes is not compared with enclosed samples: a drawn wall holds its windows, a scan passes through them.
        let enclosed = if region.outline().has_holes() { samples.enclosed() } else { &[] };
        let outside = samples.outside().iter().chain(enclosed).map(lifted(false));
        let scale = region.chart().scale;
        let pixels = region.pixel_area().sqrt() * scale;
        let unscaled: Vec<Vec<_>> =
            region.outline().rings().iter().map(|ring| ring.iter().map(|p| p / scale).collect()).collect();
        Some(Self {
            index,
            rotation: region.chart().rotation,
            contour: SignedDistanceField::new(&unscaled, region.foreign_edges(), pixels),
            pixels,
            size: region.pixel_area().sqrt(),
            samples: inside.chain(outside).collect(),
            axes: [world.frame().axes[0], world.frame().axes[1]],
            by_angle: OnceLock::new(),
        })
    }

    /// Index among the problem's regions.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Square root of the observed region's area, pixels.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.samples.len()
    }

    /// Numbers of the contour's segments, ring by ring.
    pub(super) fn rings(&self) -> &[Range<usize>] {
        self.contour.rings()
    }

    /// Unit normal of a contour segment in the chart's plane.
    pub(super) fn normal(&self, segment: usize) -> Vector2<f64> {
        self.contour.normal(segment)
    }

    /// Length of a contour segment, pixels.
    pub(super) fn length(&self, segment: usize) -> f64 {
        self.contour.length(segment) * self.pixels
    }

    /// Numbers of the samples by angle about the centroid of those inside.
    pub(super) fn by_angle(&self) -> &[usize] {
        self.by_angle.get_or_init(|| {
            let [u, v] = &self.axes;
            let flat: Vec<_> = self.samples.iter().map(|(x, _)| Vector2::new(u.dot(x), v.dot(x))).collect();
            let inside = flat.iter().zip(&self.samples).filter(|(_, (_, inside))| *inside);
            let (sum, count) = inside.fold((Vector2::zeros(), 0.0), |(sum, count), (x, _)| (sum + x, count + 1.0));
            let centroid = sum / f64::max(count, 1.0);
            let angles: Vec<f64> = flat.iter().map(|x| (x.y - centroid.y).atan2(x.x - centroid.x)).collect();
            let mut numbers: Vec<usize> = (0..flat.len()).collect();
            numbers.sort_by(|&a, &b| angles[a].total_cmp(&angles[b]));
            numbers
        })
    }

    /// Whether any sample may lie on its wrong side at a pose with this covariance, of contours with this noise, pixels. Where none
    /// may, the samples add no information.
    pub fn is_informative(&self, pose: &Pose, covariance: &Matrix6<f64>, sigma: f64, budget: &Budget) -> bool {
        (0..self.count()).any(|number| match self.project(pose, number, budget) {
            ProjectedSample::Visible(margin) => {
                let deviation = (sigma * sigma + margin.gradient.dot(&(covariance * margin.gradient))).sqrt();
                // A direction that is left free has no deviation.
                margin.value <= MAX_SIGMAS * deviation || deviation.is_nan()
            }
            ProjectedSample::Behind { is_correct } => !is_correct,
        })
    }

    /// The projection of the sample with this number at a pose about the problem's origin.
    pub fn project(&self, pose: &Pose, number: usize, budget: &Budget) -> ProjectedSample {
        budget.charge(EDGES_PER_PROJECTION);
        let (sample, inside) = &self.samples[number];
        self.projected(&(self.rotation * pose.transform(sample)), *inside, &self.rotation.inverse())
    }

    /// The projection of a sample at `point` along the chart's axes; `camera_from_chart` turns derivatives back.
    fn projected(&self, point: &Vector3<f64>, inside: bool, camera_from_chart: &Rotation3<f64>) -> ProjectedSample {
        if point.z < MIN_DEPTH_RATIO * point.norm() {
            return ProjectedSample::Behind { is_correct: !inside };
        }
        let flat = point.xy() / point.z;
        let nearest = self.contour.at(&flat);
        let edge = match (nearest.is_marked, inside) {
            (false, _) => EdgeKind::Own,
            (true, true) => EdgeKind::OccludedInside,
            (true, false) => EdgeKind::OccludedOutside,
        };
        let scale = if inside { self.pixels } else { -self.pixels };
        let slope = nearest.gradient * (scale / point.z);
        let by_point = Vector3::new(slope.x, slope.y, -slope.dot(&flat));
        let (by_rotation, by_translation) = (camera_from_chart * point.cross(&by_point), camera_from_chart * by_point);
        let [rx, ry, rz] = by_rotation.into();
        let [tx, ty, tz] = by_translation.into();
        ProjectedSample::Visible(Margin {
            value: scale * nearest.distance,
            gradient: Vector6::new(rx, ry, rz, tx, ty, tz),
            outward: scale.signum(),
            along: nearest.along,
            edge,
            segment: nearest.segment,
        })
    }
}
