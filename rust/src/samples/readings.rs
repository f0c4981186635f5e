//! How far the samples of a region lie from its observed contour, and how a pose moves them (`docs/math.md`, eq. 17.1,
//! 17.2).

use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};

use super::propagation::{EDGES_OF_SWEEP, SWEEPS};
use super::signed_field::SignedField;
use crate::effort;
use crate::equations::residual::RegionEquations;
use crate::geometry::pose::Pose;
use crate::region::WorldRegion;

/// Depth over distance along the chart's axis below which a sample is behind the camera, or nearly.
const BEHIND: f64 = 0.05;

/// Margins beyond this many standard deviations of blur and belief tell nothing that moves the pose.
pub(super) const REACH: f64 = 6.0;

/// What the reading of a sample counts as, in edges that are looked at: those of the cells around it.
const EDGES_OF_READING: usize = 16;

/// The observed contour of a region and the samples of its world region.
#[derive(Debug)]
pub struct SampledRegion {
    /// Its place among the problem's regions.
    index: usize,
    /// `chart_from_camera`.
    rotation: Rotation3<f64>,
    /// The contour on the plane z = 1 of the chart's axes; edges that are not the region's own are marked.
    contour: SignedField,
    /// Pixels per unit of that plane.
    pixels: f64,
    /// Side, in pixels, of a square of the region's area.
    size: f64,
    /// Samples about the problem's origin, and whether each is inside.
    samples: Vec<(Vector3<f64>, bool)>,
    /// Axes of the plane that the samples lie on, and their numbers around the middle of those inside, once they are asked for.
    axes: [Vector3<f64>; 2],
    around: OnceLock<Vec<usize>>,
}

/// Where a sample is seen at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// Beside the contour.
    Seen(Sight),
    /// Behind the camera, where no region is seen: right for a sample outside.
    Behind(bool),
}

/// Whether the edge that a sample is nearest to is the region's own. Beyond one that hides it, the region may go on:
/// there a label is a coin's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// The region's own.
    Own,
    /// The border of the image or of something in front, of a sample inside the region.
    HidesInside,
    /// The same, of a sample outside of it.
    HidesOutside,
}

/// Where a sample is seen beside the contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// By how many pixels it lies on its right side, negative on the wrong one.
    pub margin: f64,
    /// Derivative of the margin by the left increment.
    pub slope: Vector6<f64>,
    /// The same by the pixels that the contour is off outwards there.
    pub outwards: f64,
    /// Where on its stretch the nearest point lies, 0 at the start and 1 at the end.
    pub along: f64,
    /// Whether the nearest edge is the region's own.
    pub edge: Edge,
    /// The stretch of the contour that this lies on, by number.
    pub stretch: usize,
}

impl SampledRegion {
    /// The samples of the region of that place in a problem, about `origin`; `None` where it has none.
    pub fn new(index: usize, region: &RegionEquations, world: &WorldRegion, origin: &Vector3<f64>) -> Option<Self> {
        let samples = world.samples()?;
        let lifted = |inside: bool| move |p| (world.frame().to_world(p) - origin, inside);
        let inside = samples.inside().iter().map(lifted(true));
        // What a contour without holes encloses is not compared: a drawn wall holds its windows, a scan looks through
        // them.
        let enclosed = if region.outline().has_holes() { samples.enclosed() } else { &[] };
        let outside = samples.outside().iter().chain(enclosed).map(lifted(false));
        let scale = region.chart().scale;
        let pixels = region.pixel_area().sqrt() * scale;
        let unscaled: Vec<Vec<_>> =
            region.outline().rings().iter().map(|ring| ring.iter().map(|p| p / scale).collect()).collect();
        Some(Self {
            index,
            rotation: region.chart().rotation,
            contour: SignedField::new(&unscaled, region.foreign_edges(), pixels),
            pixels,
            size: region.pixel_area().sqrt(),
            samples: inside.chain(outside).collect(),
            axes: [world.frame().axes[0], world.frame().axes[1]],
            around: OnceLock::new(),
        })
    }

    /// Its place among the problem's regions.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Side, in pixels, of a square of the observed region's area.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.samples.len()
    }

    /// The numbers of the stretches of each ring of its contour, in its order.
    pub(super) fn rings(&self) -> &[Range<usize>] {
        self.contour.rings()
    }

    /// Unit normal of a stretch of its contour on the chart's plane.
    pub(super) fn normal(&self, stretch: usize) -> Vector2<f64> {
        self.contour.normal(stretch)
    }

    /// How long a stretch of its contour is, pixels.
    pub(super) fn length(&self, stretch: usize) -> f64 {
        self.contour.length(stretch) * self.pixels
    }

    /// The numbers of the samples in the order in which they lie around the middle of those inside.
    pub(super) fn around(&self) -> &[usize] {
        self.around.get_or_init(|| {
            let [u, v] = &self.axes;
            let flat: Vec<_> = self.samples.iter().map(|(x, _)| Vector2::new(u.dot(x), v.dot(x))).collect();
            let inside = flat.iter().zip(&self.samples).filter(|(_, (_, inside))| *inside);
            let (sum, count) = inside.fold((Vector2::zeros(), 0.0), |(sum, count), (x, _)| (sum + x, count + 1.0));
            let middle = sum / f64::max(count, 1.0);
            let angles: Vec<f64> = flat.iter().map(|x| (x.y - middle.y).atan2(x.x - middle.x)).collect();
            let mut around: Vec<usize> = (0..flat.len()).collect();
            around.sort_by(|&a, &b| angles[a].total_cmp(&angles[b]));
            around
        })
    }

    /// What reading all samples and hearing them once counts as.
    pub fn work(&self) -> usize {
        self.count() * (EDGES_OF_READING + SWEEPS * EDGES_OF_SWEEP)
    }

    /// Whether any sample may lie on its wrong side at a pose with this covariance, of contours that scatter by so many pixels. Where none
    /// does, all say what is certain without them.
    pub fn tells(&self, pose: &Pose, covariance: &Matrix6<f64>, scatter: f64) -> bool {
        (0..self.count()).any(|number| match self.read(pose, number) {
            Reading::Seen(sight) => {
                let deviation = (scatter * scatter + sight.slope.dot(&(covariance * sight.slope))).sqrt();
                // A direction that is left free has no deviation.
                sight.margin <= REACH * deviation || deviation.is_nan()
            }
            Reading::Behind(right) => !right,
        })
    }

    /// The sample of a number at a pose about the problem's origin.
    pub fn read(&self, pose: &Pose, number: usize) -> Reading {
        effort::spend(EDGES_OF_READING);
        let (sample, inside) = &self.samples[number];
        self.reading(&(self.rotation * pose.transform(sample)), *inside, &self.rotation.inverse())
    }

    /// The reading of a sample that lies at `seen` along the chart's axes.
    fn reading(&self, seen: &Vector3<f64>, inside: bool, back: &Rotation3<f64>) -> Reading {
        if seen.z < BEHIND * seen.norm() {
            return Reading::Behind(!inside);
        }
        let point = seen.xy() / seen.z;
        let nearest = self.contour.nearest(&point);
        let edge = match (nearest.marked, inside) {
            (false, _) => Edge::Own,
            (true, true) => Edge::HidesInside,
            (true, false) => Edge::HidesOutside,
        };
        let scale = if inside { self.pixels } else { -self.pixels };
        let slope = nearest.gradient * (scale / seen.z);
        let moving = Vector3::new(slope.x, slope.y, -slope.dot(&point));
        let (turning, moving) = (back * seen.cross(&moving), back * moving);
        let derivative = Vector6::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z);
        let margin = scale * nearest.distance;
        let (outwards, along, stretch) = (scale.signum(), nearest.along, nearest.stretch);
        Reading::Seen(Sight { margin, slope: derivative, outwards, along, edge, stretch })
    }
}
