//! Predicted minus observed moments of a set of regions, and their derivatives by the pose: the one place where moments,
//! poses and regions meet.

use nalgebra::{DMatrix, DVector, Dyn, OMatrix, U6, Vector2, Vector3};

use crate::chart::Chart;
use crate::derivatives::Row;
use crate::equations::{
    PLANE_ORDER, SPHERE_ORDER, System, add_plane_rows, add_plane_values, add_sphere_rows, add_sphere_values,
};
use crate::error::{Error, Result};
use crate::facet::{Facet, Integration, SUBDIVISION, facets, quadrature_mesh};
use crate::mesh::triangulation::{MeshOptions, triangulate};
use crate::moments::mesh::{mesh_plane_moments, mesh_sphere_moments};
use crate::moments::pixels::pixel_moments;
use crate::moments::plane::planar_moments;
use crate::moments::sphere::spherical_moments;
use crate::pose::Pose;
use crate::region::{ObservedRegion, WorldRegion};
use crate::rings::PlaneRings;
use crate::whitening::whitening;

/// The scale on which residuals are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Moments of charts with unit observed area: a wide basin.
    Uniform,
    /// In standard deviations of one pixel's boundary noise: close to maximum likelihood near the solution.
    Whitened,
}

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
    observed: Vec<f64>,
    facets: Vec<Facet>,
    whitening: DMatrix<f64>,
}

impl RegionEquations {
    /// The equations of an observed region and a world region whose coordinates are taken relative to `origin`.
    ///
    /// # Errors
    /// What [`Chart::of`] refuses, a pixel area that is not positive, or pixel sums asked for without pixels.
    pub fn new(
        observed: &ObservedRegion,
        world: &WorldRegion,
        origin: &Vector3<f64>,
        system: System,
        integration: Integration,
    ) -> Result<Self> {
        let (chart, outline) = Chart::of(&observed.rings)?;
        let values = observed_values(observed, &chart, &outline, system, integration)?;
        let facets = facets(world, origin, system, integration)?;
        let whitening = whitening(system, &chart, &outline, observed.checked_pixel_area()?)?;
        Ok(Self { system, chart, outline, observed: values, facets, whitening })
    }

    /// The region's chart.
    pub fn chart(&self) -> &Chart {
        &self.chart
    }

    /// The observed outline in the chart.
    pub fn outline(&self) -> &PlaneRings {
        &self.outline
    }

    /// Number of independent equations: the whitening leaves out directions that the system cannot tell apart.
    pub fn rank(&self) -> usize {
        self.whitening.row_iter().filter(|row| row.iter().any(|&entry| entry != 0.0)).count()
    }

    /// Number of equations.
    pub fn count(&self) -> usize {
        self.system.count()
    }

    /// Residuals and derivatives at a pose of the centred world; `None` where the region is not wholly in view of its chart
    /// or its plane passes through the camera.
    pub fn evaluate(&self, pose: &Pose, weighting: Weighting) -> Option<Evaluation> {
        let mut values = vec![0.0; self.count()];
        let mut rows: Vec<Row> = vec![[0.0; 6]; self.count()];
        let chart_from_world =
            Pose::new(self.chart.rotation * pose.rotation, self.chart.rotation * pose.translation);
        for facet in &self.facets {
            self.add_facet(facet, &chart_from_world, &mut values, &mut rows)?;
        }
        // A region seen from behind turns the other way: its area, and with it every moment, changes sign.
        let side = if values[0] < 0.0 { -1.0 } else { 1.0 };
        let residual = DVector::from_iterator(
            self.count(),
            values.iter().zip(&self.observed).map(|(predicted, observed)| side * predicted - observed),
        );
        let jacobian = OMatrix::<f64, Dyn, U6>::from_fn(self.count(), |row, column| side * rows[row][column]);
        Some(match weighting {
            Weighting::Uniform => Evaluation { residual, jacobian },
            Weighting::Whitened => {
                Evaluation { residual: &self.whitening * residual, jacobian: &self.whitening * jacobian }
            }
        })
    }

    fn add_facet(&self, facet: &Facet, chart_from_world: &Pose, values: &mut [f64], rows: &mut [Row]) -> Option<()> {
        let nu = facet.nu(chart_from_world)?;
        match self.system {
            System::Plane => {
                let moments = facet.plane_moments(chart_from_world, &self.chart, PLANE_ORDER)?;
                add_plane_values(&moments, values);
                add_plane_rows(&moments, &self.chart, &nu, rows);
            }
            System::Sphere => {
                let moments = facet.sphere_moments(chart_from_world, SPHERE_ORDER)?;
                add_sphere_values(&moments, self.chart.scale, values);
                add_sphere_rows(&moments, &self.chart, &nu, rows);
            }
        }
        Some(())
    }
}

/// The observed side of the equations.
fn observed_values(
    observed: &ObservedRegion,
    chart: &Chart,
    outline: &PlaneRings,
    system: System,
    integration: Integration,
) -> Result<Vec<f64>> {
    let mut values = vec![0.0; system.count()];
    match (system, integration) {
        (System::Sphere, Integration::Pixels) => {
            let pixels = observed.pixels.as_ref().ok_or(Error::NoPixels)?;
            let turned: Vec<_> = pixels.bearings.iter().map(|r| chart.rotation * r).collect();
            add_sphere_values(&pixel_moments(&turned, &pixels.solid_angles, 3), chart.scale, &mut values);
        }
        (System::Plane, Integration::Pixels) => {
            return Err(Error::OutOfRange {
                item: "integration",
                found: "pixels with the plane system".into(),
                needed: "boundary or mesh; sums over pixels need the sphere system".into(),
            });
        }
        (System::Plane, Integration::Boundary) => {
            add_plane_values(&planar_moments(slices(outline), PLANE_ORDER), &mut values);
        }
        (System::Plane, Integration::Mesh) => {
            let mesh = triangulate(outline, MeshOptions::default())?;
            add_plane_values(&mesh_plane_moments(&mesh.vertices, &mesh.triangles, PLANE_ORDER), &mut values);
        }
        (System::Sphere, Integration::Boundary) => {
            let lift = |p: &Vector2<f64>| Vector3::new(p.x / chart.scale, p.y / chart.scale, 1.0).normalize();
            let rings: Vec<Vec<_>> = outline.rings().iter().map(|ring| ring.iter().map(lift).collect()).collect();
            let moments = spherical_moments(rings.iter().map(Vec::as_slice), SPHERE_ORDER);
            add_sphere_values(&moments, chart.scale, &mut values);
        }
        (System::Sphere, Integration::Mesh) => {
            let mesh = quadrature_mesh(outline)?;
            let lift = |p: &Vector2<f64>| Vector3::new(p.x / chart.scale, p.y / chart.scale, 1.0);
            let vertices: Vec<_> = mesh.vertices.iter().map(lift).collect();
            let moments = mesh_sphere_moments(&vertices, &mesh.triangles, SPHERE_ORDER, SUBDIVISION);
            add_sphere_values(&moments, chart.scale, &mut values);
        }
    }
    Ok(values)
}

/// Residuals and derivatives of several regions, one after another; `None` where one of them is not in view.
pub fn evaluate(regions: &[RegionEquations], pose: &Pose, weighting: Weighting) -> Option<Evaluation> {
    let count = regions.iter().map(RegionEquations::count).sum();
    let mut all = Evaluation { residual: DVector::zeros(count), jacobian: OMatrix::<f64, Dyn, U6>::zeros(count) };
    let mut start = 0;
    for region in regions {
        let one = region.evaluate(pose, weighting)?;
        all.residual.rows_mut(start, region.count()).copy_from(&one.residual);
        all.jacobian.rows_mut(start, region.count()).copy_from(&one.jacobian);
        start += region.count();
    }
    Some(all)
}

fn slices(outline: &PlaneRings) -> impl Iterator<Item = &[Vector2<f64>]> {
    outline.rings().iter().map(Vec::as_slice)
}
