//! Point-to-boundary residuals of contour pieces, and their derivatives by the pose (`docs/math.md`, section 11).

use std::cell::OnceCell;
use std::sync::{Arc, OnceLock};

use nalgebra::{Rotation3, Vector2, Vector3, Vector6};

use super::boundary::{Boundary, Edge, Edges, Foot, ProjectedBoundary};
use super::pieces::{self, Piece, pieces};
use crate::budget::Budget;
use crate::equations::normal_equations::{NormalEquations, WeightedRow};
use crate::equations::residual::RegionEquations;
use crate::geometry::edge_field::EdgeField;
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::region::{PlaneFrame, WorldRegion};

/// Squared tangent of the angle to the boundary (30 degrees) beyond which a piece runs across it, as the side of a bite does
/// where that crosses the outline; and what its spread across counts beside its squared distance.
const ALIGNED: f64 = 3.0;
const CROSSING: f64 = 4.0;

/// Sine of the angle between a plane and the ray to it (9 degrees) below which the nearest edge on the plane need not be the
/// nearest in the image: lengths differ by more than six times there.
const OBLIQUE: f64 = 0.15;

/// Cost of a piece, in edge evaluations: its cell's edges, its foot, and its density in the mixtures that follow.
const EDGES_OF_PIECE: usize = 32;

/// Pieces of all contours in a coarse evaluation, and of each at least: conventions.
const SKETCHED: usize = 120;
const FEWEST_SKETCHED: usize = 40;

/// The observed contour of one region and the boundary of its world region.
#[derive(Debug, Clone)]
pub struct Contour {
    /// `chart_from_camera`.
    rotation: Rotation3<f64>,
    /// The observed outline in the chart, and which of its edges are not the region's own.
    outline: PlaneRings,
    foreign: Vec<Vec<bool>>,
    /// Chart units to the unit of the plane z = 1 of the chart's axes.
    scale: f64,
    /// All pieces of the outline, on that plane, computed on demand.
    pieces: OnceLock<Vec<Piece>>,
    /// One piece in `few` of them.
    sketch: Vec<Piece>,
    few: usize,
    /// Pixels per unit of that plane.
    pixels: f64,
    /// Side, in pixels, of a square of the region's area.
    size: f64,
    /// Boundary of the world region about the problem's origin.
    boundary: Boundary,
    /// The plane that holds the rings, about the problem's origin, and their edges there; `None` for a surface.
    plane: Option<(PlaneFrame, Arc<EdgeField>)>,
    /// Whether the image's border cuts the region, so that a part of its boundary may be behind the camera.
    cut: bool,
}

/// The residual of a piece of a contour.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reading {
    /// Signed distance of its mean from the projected boundary, pixels.
    pub distance: f64,
    /// Mean square of its points about their mean across the boundary, squared pixels.
    pub spread: f64,
    /// Distance in the likelihood: that of its mean, more where it runs across the boundary, pixels.
    pub robust_distance: f64,
    /// The edge of the boundary that it is nearest to, counted over all rings.
    pub edge: u32,
}

impl Contour {
    /// The contours of observed regions, without what is not their own, and the boundaries of their world regions about
    /// `origin`.
    pub fn all(regions: &[RegionEquations], worlds: &[WorldRegion], origin: &Vector3<f64>) -> Vec<Self> {
        let wanted = (SKETCHED / regions.len()).max(FEWEST_SKETCHED);
        let count = |region: &RegionEquations| pieces::count(region.outline(), region.pixel_area().sqrt());
        let few = regions.iter().map(|region| count(region).div_ceil(wanted)).max().unwrap_or(1).max(1);
        regions.iter().zip(worlds).map(|(region, world)| Self::new(region, world, origin, few)).collect()
    }

    fn new(region: &RegionEquations, world: &WorldRegion, origin: &Vector3<f64>, few: usize) -> Self {
        let scale = region.chart().scale;
        let pixels = region.pixel_area().sqrt();
        let frame = world.frame();
        let plane = PlaneFrame { origin: frame.origin - origin, axes: frame.axes };
        Self {
            rotation: region.chart().rotation,
            sketch: scaled(pieces(region.outline(), region.foreign_edges(), pixels, few), scale),
            few,
            pieces: OnceLock::new(),
            outline: region.outline().clone(),
            foreign: region.foreign_edges().to_vec(),
            scale,
            pixels: pixels * scale,
            size: pixels,
            boundary: Boundary::new(&world.rings(), origin),
            plane: world.surface().is_none().then(|| (plane, world.edge_field())),
            cut: region.border().is_some(),
        }
    }

    /// Stride between pieces in coarse evaluations, over all contours of a problem.
    pub fn coarse_stride(&self) -> usize {
        self.few
    }

    /// Cost of reading all pieces, in edge evaluations.
    pub fn work(&self) -> usize {
        self.boundary.count() + EDGES_OF_PIECE * pieces::count(&self.outline, self.size)
    }

    /// The chart's axes: `chart_from_camera`.
    pub fn axes(&self) -> &Rotation3<f64> {
        &self.rotation
    }

    /// Side, in pixels, of a square of the region's area.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of pieces of which every `step`-th is read.
    pub fn count(&self, step: usize) -> usize {
        self.pieces(step).len()
    }

    /// Its effective number of observations at most, from every `step`-th piece.
    pub(super) fn numbers(&self, step: usize) -> f64 {
        pieces::numbers(&self.pieces(step).copied().collect::<Vec<_>>(), step)
    }

    /// Every `step`-th piece.
    fn pieces(&self, step: usize) -> impl ExactSizeIterator<Item = &Piece> {
        if step == self.few {
            return self.sketch.iter().step_by(1);
        }
        let all = self.pieces.get_or_init(|| scaled(pieces(&self.outline, &self.foreign, self.size, 1), self.scale));
        all.iter().step_by(step)
    }

    /// Adds the readings of every `step`-th piece at a pose about the problem's origin; `None` where the region is out of view.
    pub fn read(&self, pose: &Pose, step: usize, into: &mut Vec<Reading>, budget: &Budget) -> Option<()> {
        let view = self.view(pose, budget)?;
        self.charge_work(&view, step);
        into.extend(self.pieces(step).map(|piece| {
            let index = self.nearest(&view, &piece.mean);
            self.reading(&view.edge(index), index, piece).0
        }));
        Some(())
    }

    /// Gives the reading of every `step`-th piece, the derivative of its distance by the left increment along the chart's axes and the run
    /// that it is on to `found`; `None` where the region is out of view.
    ///
    /// `readings` are those at the pose where there are any. Elsewhere a piece is compared with the edge that follows
    /// along the boundary from that of the piece before, where that lies within `reach`, pixels: it does where a contour is
    /// clean.
    pub fn for_each_row(
        &self,
        pose: &Pose,
        step: usize,
        readings: Option<&[Reading]>,
        reach: f64,
        mut found: impl FnMut(Reading, Vector6<f64>, Option<[usize; 2]>),
        budget: &Budget,
    ) -> Option<()> {
        let view = self.view(pose, budget)?;
        self.charge_work(&view, step);
        let mut before = None;
        for (number, piece) in self.pieces(step).enumerate() {
            let index = match readings {
                Some(readings) => readings[number].edge as usize,
                None => before
                    .and_then(|edge| self.followed(&view, &piece.mean, edge, reach))
                    .unwrap_or_else(|| self.nearest(&view, &piece.mean)),
            };
            before = Some(index);
            let edge = view.edge(index);
            let (reading, foot) = self.reading(&edge, index, piece);
            found(reading, self.derivative(&edge, &foot), piece.run);
        }
        Some(())
    }

    /// Adds the normal equations of every `step`-th piece, each with the weight of its reading against the edge that it was
    /// nearest to in `before`, the readings of the same pieces at a pose close by.
    pub fn add_normal_equations(
        &self,
        pose: &Pose,
        step: usize,
        before: &[Reading],
        weight: impl Fn(&Reading) -> f64,
        into: &mut NormalEquations,
        budget: &Budget,
    ) -> Option<()> {
        let view = self.view(pose, budget)?;
        self.charge_work(&view, step);
        let pairs = self.pieces(step).zip(before);
        let rows: Vec<WeightedRow> = pairs
            .map(|(piece, before)| {
                let edge = view.edge(before.edge as usize);
                let (reading, foot) = self.reading(&edge, before.edge as usize, piece);
                let derivative = self.derivative(&edge, &foot);
                WeightedRow::new(&derivative, reading.distance, weight(&reading))
            })
            .collect();
        *into += NormalEquations::weighted(&rows).turned(&self.rotation);
        Some(())
    }

    /// Charges the vertices that a view projects, and the pieces that are read against it.
    fn charge_work(&self, view: &View<'_>, step: usize) {
        view.budget.charge(view.boundary.count() + EDGES_OF_PIECE * self.count(step));
    }

    /// Whether the projected boundary is in view at a pose.
    pub fn is_in_view(&self, pose: &Pose) -> bool {
        let depths = self.boundary.depths(&self.rotation, pose);
        if self.cut {
            self.boundary.rings.iter().all(|ring| depths[ring.clone()].iter().any(|&depth| depth > 0.0))
        } else {
            depths.iter().all(|&depth| depth > 0.0)
        }
    }

    /// The projected boundary at a pose; `None` where it isn't wholly before the chart's plane, or for a region that the image's
    /// border cuts not at all.
    fn view<'a>(&'a self, pose: &Pose, budget: &'a Budget) -> Option<View<'a>> {
        let chart_from_world = Pose::new(self.rotation * pose.rotation, self.rotation * pose.translation);
        let boundary = self.boundary.projected(&chart_from_world);
        let sight = self.plane.as_ref().map(|(plane, _)| Sight::new(plane, &chart_from_world));
        let sight = sight.filter(|sight| sight.slant > OBLIQUE);
        match boundary.is_before_camera() {
            true => Some(View { boundary, sight, edges: OnceCell::new(), budget }),
            false if self.cut => {
                Some(View { edges: Edges::new(boundary.edges_before()?).into(), boundary, sight, budget })
            }
            false => None,
        }
    }

    /// The edge of the boundary nearest to a point of the chart's plane z = 1: where the point's ray meets the region's plane,
    /// the edge that is nearest there.
    fn nearest(&self, view: &View<'_>, point: &Vector2<f64>) -> usize {
        let place = view.sight.as_ref().and_then(|sight| sight.place(point));
        if let (Some((_, field)), Some(place)) = (&self.plane, place) {
            return field.nearest_edge(&place);
        }
        view.edges().nearest(point, view.budget)
    }

    /// The edge nearer to a point than the edges before and after it, from an edge on; `None` where that is not within `reach`,
    /// pixels.
    fn followed(&self, view: &View<'_>, point: &Vector2<f64>, from: usize, reach: f64) -> Option<usize> {
        let square = |index: usize| view.edge(index).offset(point).1.norm_squared();
        let mut best = (square(from), from);
        for _ in 0..EDGES_OF_PIECE {
            let beside =
                [self.boundary.before(best.1), self.boundary.after(best.1)].map(|index| (square(index), index));
            let [before, after] = beside;
            let nearer = if after.0 < before.0 { after } else { before };
            if nearer.0 >= best.0 {
                return (self.pixels * best.0.sqrt() <= reach).then_some(best.1);
            }
            best = nearer;
        }
        None
    }

    /// The reading of a piece against an edge, and the place on the edge that it is nearest to.
    fn reading(&self, edge: &Edge, index: usize, piece: &Piece) -> (Reading, Foot) {
        let (foot, value) = edge.foot(&piece.mean);
        let (distance, spread) = (self.pixels * value, foot.normal.dot(&(piece.spread * foot.normal)));
        let crossing = CROSSING * (spread - (piece.spread.trace() - spread) / ALIGNED).max(0.0);
        let squared = self.pixels * self.pixels;
        let robust_distance = (distance * distance + squared * crossing).sqrt();
        (Reading { distance, spread: squared * spread, robust_distance, edge: index as u32 }, foot)
    }

    /// Derivatives of a distance along the chart's axes (`docs/math.md`, eq. 11.3).
    fn derivative(&self, edge: &Edge, foot: &Foot) -> Vector6<f64> {
        // The point of the edge in space that is seen at the foot.
        let weight = foot.share * edge.from.z / (foot.share * edge.from.z + (1.0 - foot.share) * edge.to.z);
        let point = edge.from.lerp(&edge.to, weight);
        let n = foot.normal * (self.pixels / point.z);
        let moving = Vector3::new(-n.x, -n.y, (n.x * point.x + n.y * point.y) / point.z);
        let turning = point.cross(&moving);
        Vector6::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z)
    }
}

/// Pieces of a chart on the plane z = 1 of its axes.
fn scaled(pieces: Vec<Piece>, scale: f64) -> Vec<Piece> {
    pieces.into_iter().map(|piece| piece.scaled(scale)).collect()
}

/// A projected boundary.
struct View<'a> {
    boundary: ProjectedBoundary<'a>,
    sight: Option<Sight>,
    /// All edges, of a cut boundary what lies before the camera of them, or once they are asked for.
    edges: OnceCell<Edges>,
    budget: &'a Budget,
}

impl View<'_> {
    fn edge(&self, index: usize) -> Edge {
        self.edges.get().map_or_else(|| self.boundary.edge(index), |edges| edges[index])
    }

    fn edges(&self) -> &Edges {
        self.edges.get_or_init(|| Edges::new(self.boundary.edges().collect()))
    }
}

/// A plane as the chart sees it: `place = (numerators . (x, y, 1)) / (normal . (x, y, 1))`.
struct Sight {
    normal: Vector3<f64>,
    numerators: [Vector3<f64>; 2],
    /// Sine of the angle between the plane and the ray to its origin.
    slant: f64,
}

impl Sight {
    fn new(plane: &PlaneFrame, chart_from_world: &Pose) -> Self {
        let [u, v, normal] = plane.axes.map(|axis| chart_from_world.rotation * axis);
        let origin = chart_from_world.transform(&plane.origin);
        let offset = normal.dot(&origin);
        // The ray meets the plane at the depth offset / (normal . ray); only before the camera that has the offset's sign.
        let side = offset.signum();
        let numerators = [u, v].map(|axis| (axis * offset - normal * axis.dot(&origin)) * side);
        Self { normal: normal * side, numerators, slant: offset.abs() / origin.norm() }
    }

    /// Coordinates in the plane of the point that is seen at a point of the chart's plane z = 1; `None` beyond its horizon.
    fn place(&self, point: &Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = Vector3::new(point.x, point.y, 1.0);
        let depth = self.normal.dot(&ray);
        let [x, y] = &self.numerators;
        (depth > 0.0).then(|| Vector2::new(x.dot(&ray), y.dot(&ray)) / depth)
    }
}
