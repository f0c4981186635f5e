//! Predicted minus observed moments of a set of regions, and their derivatives by the pose: the one place where moments,
//! poses and regions meet.

use std::sync::{Arc, OnceLock};

use nalgebra::{DVector, Dyn, OMatrix, U6, Vector2, Vector3};

use crate::budget::Budget;
use crate::equations::facet::{Facet, Integration, SUBDIVISION, facets, integration_mesh};
use crate::equations::normal_equations::{DERIVED, NormalEquations};
use crate::equations::system::{
    FLUX_NODES, MOST_EQUATIONS, System, Weighting, add_plane_derivatives, add_plane_values, add_sphere_derivatives,
    add_sphere_values, subtract_flux,
};
use crate::equations::whitening::{BoundaryCovariance, Orders, Whitening};
use crate::error::{Error, Result};
use crate::geometry::clipping::Clipped;
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::moments::mesh::{mesh_plane_moments, mesh_sphere_moments};
use crate::moments::pixels::pixel_moments;
use crate::moments::plane::planar_moments;
use crate::moments::sphere::spherical_moments;
use crate::moments::{MAX_ORDER, PlaneMoments, SphereMoments, plane_count};
use crate::region::{ObservedRegion, WorldRegion};
use crate::view::border::{Border, foreign_edges};
use crate::view::chart::Chart;

/// Cost of the powers of a place, in edge evaluations: one for each moment.
const EDGES_OF_MOMENTS: usize = plane_count(MAX_ORDER);

/// Cost of a vertex whose ring is turned into its chart and checked for crossings, in edge evaluations.
const EDGES_OF_VERTEX: usize = 500;

/// Residuals (predicted - observed) and their derivatives by the left increment `[omega (rad), tau (meters)]`.
#[derive(Debug, Clone)]
#[must_use]
pub struct Evaluation {
    /// (m,) residuals.
    pub residual: DVector<f64>,
    /// (m, 6) derivatives.
    pub jacobian: OMatrix<f64, Dyn, U6>,
}

/// The equations of one pair of image and world region; copies share what does not change.
#[derive(Debug, Clone)]
pub struct RegionEquations {
    sides: Arc<Sides>,
    facets: Arc<[Facet]>,
    /// Noise of the boundary, in pixels, and the orders that the whitened equations are for.
    noise: (f64, Orders),
    /// Computed on demand.
    whitening: OnceLock<Whitening>,
}

/// The observed side of the equations, and the world side.
#[derive(Debug)]
struct Sides {
    system: System,
    chart: Chart,
    outline: PlaneRings,
    border: Option<Border>,
    /// Edges of the outline that are not the region's own boundary, ring by ring.
    foreign: Vec<Vec<bool>>,
    hides_edges: bool,
    observed: Vec<f64>,
    pixel_area: f64,
    /// Computed on demand.
    covariance: OnceLock<BoundaryCovariance>,
}

impl RegionEquations {
    /// The equations of an observed region and a world region whose coordinates are taken relative to `origin`.
    ///
    /// # Errors
    /// What [`Chart::of`], [`Border::of`] and [`foreign_edges`] refuse, a pixel area that is not positive, pixel sums asked for
    /// without pixels, or that it was canceled.
    pub fn new(
        observed: &ObservedRegion,
        world: &WorldRegion,
        origin: &Vector3<f64>,
        system: System,
        integration: Integration,
        budget: &Budget,
    ) -> Result<Self> {
        if budget.is_canceled() {
            return Err(Error::Canceled);
        }
        budget.charge(EDGES_OF_VERTEX * observed.rings.iter().map(Vec::len).sum::<usize>());
        let (chart, outline) = Chart::of(&observed.rings)?;
        let pixel_area = observed.checked_pixel_area()?;
        let pixel = pixel_area.sqrt().recip();
        let border = Border::of(&observed.borders, &chart, &outline, pixel, budget)?;
        let (foreign, hides_edges) = foreign_edges(&observed.hidden, border.as_ref(), &chart, &outline, pixel, budget)?;
        // What the border leaves visible changes with the pose: a mesh of it would not last.
        let integration = match (integration, &border) {
            (Integration::Mesh { .. }, Some(_)) => Integration::Boundary,
            _ => integration,
        };
        let values = observed_values(observed, &chart, &outline, system, integration, budget)?;
        let facets = facets(world, origin, system, integration, budget)?.into();
        let covariance = OnceLock::new();
        let sides =
            Sides { system, chart, outline, border, foreign, hides_edges, observed: values, pixel_area, covariance };
        Ok(Self { sides: Arc::new(sides), facets, noise: (0.0, Orders::All), whitening: OnceLock::new() })
    }

    /// The same equations with the world region by fewer vertices, for coarse evaluations.
    pub fn coarse(&self, world: &WorldRegion, origin: &Vector3<f64>, budget: &Budget) -> Self {
        let facets = self.facets.iter().map(|facet| facet.coarse(world, origin, budget)).collect();
        Self { facets, ..self.clone() }
    }

    /// Whether a plane's integrals are taken over a mesh.
    pub fn is_mesh(&self, world: &WorldRegion) -> bool {
        self.facets.iter().any(|facet| facet.is_mesh(world))
    }

    /// The same equations with integrals of planes along their boundaries, to search by.
    pub fn by_boundary(&self, world: &WorldRegion, origin: &Vector3<f64>) -> Self {
        let facets = self.facets.iter().map(|facet| facet.by_boundary(world, origin)).collect();
        Self { facets, ..self.clone() }
    }

    /// The same equations with the integrals of other ones of the same region.
    pub fn integrated_as(&self, other: &Self) -> Self {
        Self { facets: other.facets.clone(), ..self.clone() }
    }

    /// The same equations, whitened for a boundary noise of `sigma` pixels instead of the least.
    pub fn whitened_for(&self, sigma: f64, orders: Orders) -> Self {
        let whitening = OnceLock::from(Whitening::new(self.covariance(), sigma, orders));
        Self { noise: (sigma, orders), whitening, ..self.clone() }
    }

    /// Over the whole outline, the border's edges too: moments that vanish on all the others would be trusted without end.
    fn covariance(&self) -> &BoundaryCovariance {
        let Sides { system, chart, outline, pixel_area, covariance, .. } = self.sides.as_ref();
        covariance.get_or_init(|| BoundaryCovariance::new(*system, chart, outline, *pixel_area))
    }

    fn whitening(&self) -> &Whitening {
        let (sigma, orders) = self.noise;
        self.whitening.get_or_init(|| Whitening::new(self.covariance(), sigma, orders))
    }

    /// The observed area in pixels.
    pub fn pixel_area(&self) -> f64 {
        self.sides.pixel_area
    }

    /// Pixels in an angle of one radian where the region is seen, as its area has them.
    pub fn pixels_per_radian(&self) -> f64 {
        self.pixel_area().sqrt() * self.chart().scale
    }

    /// The region's chart.
    pub fn chart(&self) -> &Chart {
        &self.sides.chart
    }

    /// The observed outline in the chart.
    pub fn outline(&self) -> &PlaneRings {
        &self.sides.outline
    }

    /// The border of the image along which the region was cut.
    pub fn border(&self) -> Option<&Border> {
        self.sides.border.as_ref()
    }

    /// Edges of the observed outline that are not the region's own boundary, ring by ring: on the image's border, or
    /// hidden.
    pub fn foreign_edges(&self) -> &[Vec<bool>] {
        &self.sides.foreign
    }

    /// Whether edges are hidden, so that the moments are those of the visible part alone.
    pub fn hides_edges(&self) -> bool {
        self.sides.hides_edges
    }

    /// Number of independent equations.
    pub fn count(&self, weighting: Weighting) -> usize {
        match weighting {
            Weighting::Uniform => self.sides.system.count(weighting),
            Weighting::Whitened => self.whitening().rank(),
        }
    }

    /// Adds the equations at a pose of the centered world, derivatives along the chart's axes, to `equations`; `None` where the
    /// region is not wholly in view of its chart or its plane passes through the camera.
    fn add_rows<const N: usize>(
        &self,
        pose: &Pose,
        weighting: Weighting,
        equations: &mut Vec<[f64; N]>,
        budget: &Budget,
    ) -> Option<()> {
        // What a cut takes depends on the pose, and is counted there.
        if self.sides.border.is_none() {
            budget.charge(self.work());
        }
        let mut rows = [[0.0; N]; MOST_EQUATIONS];
        let rows = &mut rows[..self.sides.system.count(weighting)];
        self.add_predicted(pose, weighting, rows, budget)?;
        // A region seen from behind turns the other way: its area, and with it every moment, changes sign.
        if rows[0][0] < 0.0 {
            rows.iter_mut().flatten().for_each(|entry| *entry = -*entry);
        }
        rows.iter_mut().zip(&self.sides.observed).for_each(|(row, observed)| row[0] -= observed);
        match weighting {
            Weighting::Uniform => equations.extend_from_slice(rows),
            Weighting::Whitened => self.whitening().apply(rows, equations),
        }
        Some(())
    }

    /// Cost of one evaluation, in edge evaluations: the moments of each, and of a region that is cut the moments and the flux
    /// of all of the image's border.
    pub fn work(&self) -> usize {
        let beside = self.sides.border.as_ref().map_or(0, Border::edge_count);
        let places: usize = self.facets.iter().map(|facet| facet.place_count(self.sides.system)).sum();
        places * EDGES_OF_MOMENTS + beside * (EDGES_OF_MOMENTS + self.edges_of_flux())
    }

    /// Cost of the flux through an edge: on the plane one list of moments for each component of its normal, on the sphere
    /// one for each node.
    fn edges_of_flux(&self) -> usize {
        match self.sides.system {
            System::Plane => 3 * EDGES_OF_MOMENTS,
            System::Sphere => FLUX_NODES * EDGES_OF_MOMENTS,
        }
    }

    /// Adds the predicted values of the equations and, in longer rows, their derivatives.
    fn add_predicted<const N: usize>(
        &self,
        pose: &Pose,
        weighting: Weighting,
        rows: &mut [[f64; N]],
        budget: &Budget,
    ) -> Option<()> {
        let turn = self.sides.chart.rotation;
        let chart_from_world = Pose::new(turn * pose.rotation, turn * pose.translation);
        let order = self.sides.system.order(weighting) + if N > ALONE { self.sides.system.reach() } else { 0 };
        self.facets.iter().try_for_each(|facet| {
            let nu = facet.nu(&chart_from_world)?;
            match (&self.sides.border, self.sides.system) {
                (Some(border), _) => {
                    let clipped = facet.clipped(&chart_from_world, &self.sides.chart, border, budget);
                    self.add_clipped(&clipped, order, &nu, rows, budget);
                }
                (None, System::Plane) => {
                    let moments = facet.plane_moments(&chart_from_world, order)?;
                    add_plane(&moments, self.sides.chart.scale, &nu, rows);
                }
                (None, System::Sphere) => {
                    let moments = facet.sphere_moments(&chart_from_world, order)?;
                    add_sphere(&moments, self.sides.chart.scale, &nu, rows);
                }
            }
            Some(())
        })
    }

    /// Adds what the image's border leaves visible of a facet: the visible part flows, but for the edges on the border
    /// (`docs/math.md`, eq. 14.1 and 14.2).
    fn add_clipped<const N: usize>(
        &self,
        (clipped, side): &(Clipped, f64),
        order: usize,
        nu: &Vector3<f64>,
        sums: &mut [[f64; N]],
        budget: &Budget,
    ) {
        let rings = clipped.rings.iter().map(Vec::as_slice);
        let scale = self.sides.chart.scale;
        budget.charge(EDGES_OF_MOMENTS * clipped.rings.iter().map(Vec::len).sum::<usize>());
        let mut rows = [[0.0; N]; MOST_EQUATIONS];
        let rows = &mut rows[..sums.len()];
        match self.sides.system {
            System::Plane => add_plane(&planar_moments(rings, order).scaled(1.0 / scale), scale, nu, rows),
            System::Sphere => add_sphere(&lifted_moments(rings, &self.sides.chart, order), scale, nu, rows),
        }
        if N > ALONE {
            budget.charge(self.edges_of_flux() * clipped.border.len());
            let still: Vec<_> = clipped.border.iter().map(|ends| ends.map(|p| p / scale)).collect();
            subtract_flux(self.sides.system, &still, scale, nu, rows);
        }
        sums.iter_mut().flatten().zip(rows.iter().flatten()).for_each(|(sum, entry)| *sum += side * entry);
    }
}

/// Entries of an equation that is evaluated without derivatives: its residual.
const ALONE: usize = 1;

fn add_plane<const N: usize>(moments: &PlaneMoments, scale: f64, nu: &Vector3<f64>, rows: &mut [[f64; N]]) {
    add_plane_values(moments, scale, rows);
    if N > ALONE {
        add_plane_derivatives(moments, scale, nu, rows);
    }
}

fn add_sphere<const N: usize>(moments: &SphereMoments, scale: f64, nu: &Vector3<f64>, rows: &mut [[f64; N]]) {
    add_sphere_values(moments, scale, rows);
    if N > ALONE {
        add_sphere_derivatives(moments, scale, nu, rows);
    }
}

/// The moments on the sphere of rings in a chart.
fn lifted_moments<'a>(rings: impl Iterator<Item = &'a [Vector2<f64>]>, chart: &Chart, order: usize) -> SphereMoments {
    let lift = |p: &Vector2<f64>| Vector3::new(p.x / chart.scale, p.y / chart.scale, 1.0).normalize();
    let rings: Vec<Vec<_>> = rings.map(|ring| ring.iter().map(lift).collect()).collect();
    spherical_moments(rings.iter().map(Vec::as_slice), order)
}

/// The observed side of the equations.
fn observed_values(
    observed: &ObservedRegion,
    chart: &Chart,
    outline: &PlaneRings,
    system: System,
    integration: Integration,
    budget: &Budget,
) -> Result<Vec<f64>> {
    let mut rows = vec![[0.0]; system.count(Weighting::Whitened)];
    let order = system.order(Weighting::Whitened);
    match (system, integration) {
        (System::Sphere, Integration::Pixels) => {
            let pixels = observed.pixels.as_ref().ok_or(Error::NoPixels)?;
            let turned: Vec<_> = pixels.bearings.iter().map(|r| chart.rotation * r).collect();
            add_sphere_values(&pixel_moments(&turned, &pixels.solid_angles, order)?, chart.scale, &mut rows);
        }
        (System::Plane, Integration::Pixels) => {
            return Err(Error::InvalidOption {
                item: "integration",
                found: "pixels with the plane system".into(),
                needed: "boundary or mesh; sums over pixels need the sphere system".into(),
            });
        }
        (System::Plane, Integration::Boundary) => {
            add_plane_values(&planar_moments(slices(outline), order), 1.0, &mut rows);
        }
        (System::Plane, Integration::Mesh { size }) => {
            let mesh = integration_mesh(outline, system, size, budget)?;
            add_plane_values(&mesh_plane_moments(&mesh.vertices, &mesh.triangles, order)?, 1.0, &mut rows);
        }
        (System::Sphere, Integration::Boundary) => {
            add_sphere_values(&lifted_moments(slices(outline), chart, order), chart.scale, &mut rows);
        }
        (System::Sphere, Integration::Mesh { size }) => {
            let mesh = integration_mesh(outline, system, size, budget)?;
            let lift = |p: &Vector2<f64>| Vector3::new(p.x / chart.scale, p.y / chart.scale, 1.0);
            let vertices: Vec<_> = mesh.vertices.iter().map(lift).collect();
            let moments = mesh_sphere_moments(&vertices, &mesh.triangles, order, SUBDIVISION)?;
            add_sphere_values(&moments, chart.scale, &mut rows);
        }
    }
    Ok(rows.into_iter().flatten().collect())
}

/// Residuals and derivatives of several regions, one after another; `None` where one of them is not in view.
pub fn evaluate(regions: &[RegionEquations], pose: &Pose, weighting: Weighting, budget: &Budget) -> Option<Evaluation> {
    let mut all: Vec<[f64; DERIVED]> = Vec::with_capacity(regions.len() * MOST_EQUATIONS);
    for region in regions {
        let first = all.len();
        region.add_rows(pose, weighting, &mut all, budget)?;
        all[first..].iter_mut().for_each(|row| *row = turned(row, region.chart()));
    }
    Some(Evaluation {
        residual: DVector::from_iterator(all.len(), all.iter().map(|row| row[0])),
        jacobian: OMatrix::<f64, Dyn, U6>::from_fn(all.len(), |row, column| all[row][column + 1]),
    })
}

/// An equation with its derivatives along the camera's axes instead of the chart's (`docs/math.md`, eq. 6.2).
fn turned(row: &[f64; DERIVED], chart: &Chart) -> [f64; DERIVED] {
    let &[residual, a, b, c, d, e, f, _] = row;
    let back = chart.rotation.inverse();
    let (turning, moving) = (back * Vector3::new(a, b, c), back * Vector3::new(d, e, f));
    [residual, turning.x, turning.y, turning.z, moving.x, moving.y, moving.z, 0.0]
}

/// Sum of squared residuals of several regions; `None` where one of them is not in view.
pub fn cost(regions: &[RegionEquations], pose: &Pose, weighting: Weighting, budget: &Budget) -> Option<f64> {
    let mut rows: Vec<[f64; ALONE]> = Vec::with_capacity(regions.len() * MOST_EQUATIONS);
    regions.iter().try_for_each(|region| region.add_rows(pose, weighting, &mut rows, budget))?;
    Some(rows.iter().map(|[residual]| residual * residual).sum())
}

/// The normal equations of several regions; `None` where one of them is not in view.
pub fn normal_equations(
    regions: &[RegionEquations],
    pose: &Pose,
    weighting: Weighting,
    budget: &Budget,
) -> Option<NormalEquations> {
    let (mut sum, mut rows) = (NormalEquations::default(), Vec::with_capacity(MOST_EQUATIONS));
    for region in regions {
        rows.clear();
        region.add_rows(pose, weighting, &mut rows, budget)?;
        sum += NormalEquations::of(&rows).turned(&region.chart().rotation);
    }
    Some(sum)
}

fn slices(outline: &PlaneRings) -> impl Iterator<Item = &[Vector2<f64>]> {
    outline.rings().iter().map(Vec::as_slice)
}
