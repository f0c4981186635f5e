//! Predicted minus observed moments of a set of regions, and their derivatives by the pose: the one place where moments,
//! poses and regions meet.

use nalgebra::{DVector, Dyn, OMatrix, U6, Vector2, Vector3};

use crate::equations::derivatives::Row;
use crate::equations::facet::{Facet, Integration, SUBDIVISION, facets, integration_mesh};
use crate::equations::system::{
    MOST_EQUATIONS, System, Weighting, add_plane_rows, add_plane_values, add_sphere_rows, add_sphere_values,
    subtract_flux,
};
use crate::equations::whitening::{BoundaryCovariance, Orders, Whitening};
use crate::error::{Error, Result};
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::moments::SphereMoments;
use crate::moments::mesh::{mesh_plane_moments, mesh_sphere_moments};
use crate::moments::pixels::pixel_moments;
use crate::moments::plane::planar_moments;
use crate::moments::sphere::spherical_moments;
use crate::region::{ObservedRegion, WorldRegion};
use crate::view::border::Border;
use crate::view::chart::Chart;

/// Residuals (predicted - observed) and their derivatives by the left increment `[omega (rad), tau (metres)]`.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// (m,) residuals.
    pub residual: DVector<f64>,
    /// (m, 6) derivatives.
    pub jacobian: OMatrix<f64, Dyn, U6>,
}

/// The equations of one region seen in the image and known in the world.
#[derive(Debug, Clone)]
pub struct RegionEquations {
    system: System,
    chart: Chart,
    outline: PlaneRings,
    border: Option<Border>,
    observed: Vec<f64>,
    facets: Vec<Facet>,
    pixel_area: f64,
    covariance: BoundaryCovariance,
    whitening: Whitening,
}

impl RegionEquations {
    /// The equations of an observed region and a world region whose coordinates are taken relative to `origin`.
    ///
    /// # Errors
    /// What [`Chart::of`] and [`Border::of`] refuse, a pixel area that is not positive, or pixel sums asked for without
    /// pixels.
    pub fn new(
        observed: &ObservedRegion,
        world: &WorldRegion,
        origin: &Vector3<f64>,
        system: System,
        integration: Integration,
    ) -> Result<Self> {
        let (chart, outline) = Chart::of(&observed.rings)?;
        let pixel_area = observed.checked_pixel_area()?;
        let border = Border::of(&observed.borders, &chart, &outline, pixel_area.sqrt().recip())?;
        // What the border leaves visible changes with the pose: a mesh of it would not last.
        let integration = match (integration, &border) {
            (Integration::Mesh { .. }, Some(_)) => Integration::Boundary,
            _ => integration,
        };
        let values = observed_values(observed, &chart, &outline, system, integration)?;
        let facets = facets(world, origin, system, integration)?;
        // With the border's edges: moments that vanish on all the others would be trusted without end.
        let covariance = BoundaryCovariance::new(system, &chart, &outline, pixel_area);
        let whitening = Whitening::new(&covariance, 0.0, Orders::All);
        Ok(Self { system, chart, outline, border, observed: values, facets, pixel_area, covariance, whitening })
    }

    /// The same equations, whitened for a boundary noise of `sigma` pixels.
    pub fn whitened_for(self, sigma: f64, orders: Orders) -> Self {
        Self { whitening: Whitening::new(&self.covariance, sigma, orders), ..self }
    }

    /// The observed area in pixels.
    pub fn pixel_area(&self) -> f64 {
        self.pixel_area
    }

    /// The region's chart.
    pub fn chart(&self) -> &Chart {
        &self.chart
    }

    /// The observed outline in the chart.
    pub fn outline(&self) -> &PlaneRings {
        &self.outline
    }

    /// The border of the image along which the region was cut.
    pub fn border(&self) -> Option<&Border> {
        self.border.as_ref()
    }

    /// Length in the chart of the observed boundary, without what lies on the image's border.
    pub fn boundary_length(&self) -> f64 {
        seen_edges(&self.outline, self.border.as_ref()).map(|(a, b)| (b - a).norm()).sum()
    }

    /// Number of independent equations.
    pub fn count(&self, weighting: Weighting) -> usize {
        match weighting {
            Weighting::Uniform => self.system.count(weighting),
            Weighting::Whitened => self.whitening.rank(),
        }
    }

    /// Residual and derivatives of each equation at a pose of the centred world; `None` where the region is not wholly in
    /// view of its chart or its plane passes through the camera.
    fn rows(&self, pose: &Pose, weighting: Weighting) -> Option<Vec<EquationRow>> {
        let count = self.system.count(weighting);
        let mut values = [0.0; MOST_EQUATIONS];
        let mut derivatives = [[0.0; 6]; MOST_EQUATIONS];
        let chart_from_world = Pose::new(self.chart.rotation * pose.rotation, self.chart.rotation * pose.translation);
        for facet in &self.facets {
            let (values, derivatives) = (&mut values[..count], &mut derivatives[..count]);
            match &self.border {
                None => self.add_facet(facet, &chart_from_world, weighting, values, derivatives)?,
                Some(border) => self.add_cut_facet(facet, border, &chart_from_world, weighting, values, derivatives)?,
            }
        }
        // A region seen from behind turns the other way: its area, and with it every moment, changes sign.
        let side = if values[0] < 0.0 { -1.0 } else { 1.0 };
        let row = |k: usize| {
            let [a, b, c, d, e, f] = derivatives[k].map(|derivative: f64| side * derivative);
            [side * values[k] - self.observed[k], a, b, c, d, e, f]
        };
        Some((0..count).map(row).collect())
    }

    fn add_facet(
        &self,
        facet: &Facet,
        chart_from_world: &Pose,
        weighting: Weighting,
        values: &mut [f64],
        rows: &mut [Row],
    ) -> Option<()> {
        let nu = facet.nu(chart_from_world)?;
        let order = self.system.order(weighting);
        match self.system {
            System::Plane => {
                let moments = facet.plane_moments(chart_from_world, &self.chart, order)?;
                add_plane_values(&moments, values);
                add_plane_rows(&moments, &self.chart, &nu, rows);
            }
            System::Sphere => {
                let moments = facet.sphere_moments(chart_from_world, order)?;
                add_sphere_values(&moments, self.chart.scale, values);
                add_sphere_rows(&moments, &self.chart, &nu, rows);
            }
        }
        Some(())
    }
}

/// The edges of an observed outline that do not lie on the image's border.
fn seen_edges<'a>(
    outline: &'a PlaneRings,
    border: Option<&'a Border>,
) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + 'a {
    let on_border = border.into_iter().flat_map(|border| border.on_border().iter().flatten().copied());
    let known = on_border.chain(std::iter::repeat(false));
    outline.edges().zip(known).filter(|(_, on_border)| !on_border).map(|(edge, _)| edge)
}

/// An equation's residual, then its derivatives by the left increment.
type EquationRow = [f64; 7];

impl RegionEquations {
    /// Adds what the image's border leaves visible of a facet: the visible part flows, but for the edges on the border
    /// (`docs/math.md`, eq. 14.1 and 14.2).
    fn add_cut_facet(
        &self,
        facet: &Facet,
        border: &Border,
        chart_from_world: &Pose,
        weighting: Weighting,
        values: &mut [f64],
        rows: &mut [Row],
    ) -> Option<()> {
        let nu = facet.nu(chart_from_world)?;
        let order = self.system.order(weighting);
        let (clipped, side) = facet.clipped(chart_from_world, &self.chart, border);
        let rings = clipped.rings.iter().map(Vec::as_slice);
        let (mut value, mut row) = ([0.0; MOST_EQUATIONS], [Row::default(); MOST_EQUATIONS]);
        let (value, row) = (&mut value[..values.len()], &mut row[..rows.len()]);
        match self.system {
            System::Plane => {
                let moments = planar_moments(rings, order);
                add_plane_values(&moments, value);
                add_plane_rows(&moments, &self.chart, &nu, row);
            }
            System::Sphere => {
                let moments = lifted_moments(rings, &self.chart, order);
                add_sphere_values(&moments, self.chart.scale, value);
                add_sphere_rows(&moments, &self.chart, &nu, row);
            }
        }
        subtract_flux(self.system, &clipped.border, &self.chart, &nu, row);
        values.iter_mut().zip(value).for_each(|(sum, value)| *sum += side * *value);
        rows.iter_mut().flatten().zip(row.iter().flatten()).for_each(|(sum, entry)| *sum += side * entry);
        Some(())
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
) -> Result<Vec<f64>> {
    let mut values = vec![0.0; system.count(Weighting::Whitened)];
    let order = system.order(Weighting::Whitened);
    match (system, integration) {
        (System::Sphere, Integration::Pixels) => {
            let pixels = observed.pixels.as_ref().ok_or(Error::NoPixels)?;
            let turned: Vec<_> = pixels.bearings.iter().map(|r| chart.rotation * r).collect();
            add_sphere_values(&pixel_moments(&turned, &pixels.solid_angles, 3)?, chart.scale, &mut values);
        }
        (System::Plane, Integration::Pixels) => {
            return Err(Error::OutOfRange {
                item: "integration",
                found: "pixels with the plane system".into(),
                needed: "boundary or mesh; sums over pixels need the sphere system".into(),
            });
        }
        (System::Plane, Integration::Boundary) => {
            add_plane_values(&planar_moments(slices(outline), order), &mut values);
        }
        (System::Plane, Integration::Mesh { size }) => {
            let mesh = integration_mesh(outline, system, size)?;
            add_plane_values(&mesh_plane_moments(&mesh.vertices, &mesh.triangles, order)?, &mut values);
        }
        (System::Sphere, Integration::Boundary) => {
            add_sphere_values(&lifted_moments(slices(outline), chart, order), chart.scale, &mut values);
        }
        (System::Sphere, Integration::Mesh { size }) => {
            let mesh = integration_mesh(outline, system, size)?;
            let lift = |p: &Vector2<f64>| Vector3::new(p.x / chart.scale, p.y / chart.scale, 1.0);
            let vertices: Vec<_> = mesh.vertices.iter().map(lift).collect();
            let moments = mesh_sphere_moments(&vertices, &mesh.triangles, order, SUBDIVISION)?;
            add_sphere_values(&moments, chart.scale, &mut values);
        }
    }
    Ok(values)
}

/// Residuals and derivatives of several regions, one after another; `None` where one of them is not in view.
pub fn evaluate(regions: &[RegionEquations], pose: &Pose, weighting: Weighting) -> Option<Evaluation> {
    let mut all: Vec<EquationRow> = Vec::with_capacity(regions.len() * MOST_EQUATIONS);
    for region in regions {
        let rows = region.rows(pose, weighting)?;
        match weighting {
            Weighting::Uniform => all.extend(rows),
            Weighting::Whitened => all.extend(region.whitening.apply(&rows)),
        }
    }
    Some(Evaluation {
        residual: DVector::from_iterator(all.len(), all.iter().map(|row| row[0])),
        jacobian: OMatrix::<f64, Dyn, U6>::from_fn(all.len(), |row, column| all[row][column + 1]),
    })
}

fn slices(outline: &PlaneRings) -> impl Iterator<Item = &[Vector2<f64>]> {
    outline.rings().iter().map(Vec::as_slice)
}
