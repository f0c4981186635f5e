//! A piece of a world region that lies in one plane, and its moments as a camera sees it.

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::equations::system::System;
use crate::error::{Error, Result};
use crate::geometry::clipping::Clipped;
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::math::lanes::{LANES, Lanes, vectorized};
use crate::mesh::PlaneMesh;
#[cfg(feature = "mesh")]
use crate::mesh::even_mesh::even_mesh_within;
#[cfg(feature = "mesh")]
use crate::mesh::triangulation::{MeshOptions, triangulate_within};
use crate::moments::mesh::{mesh_sphere_moments, quadrature_count, triangle_plane_moments};
use crate::moments::plane::{RingMoments, VertexGroups};
use crate::moments::sphere::spherical_moments;
use crate::moments::{PlaneMoments, SphereMoments};
use crate::region::{Surface, WorldRegion};
use crate::view::border::{Border, projected_before};
use crate::view::chart::{Chart, MIN_COSINE, project_turned};

/// How the integrals are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Integration {
    /// Sums over the boundary's edges, exact (`docs/math.md`, sections 2 and 3).
    Boundary,
    /// Sums over the triangles of a mesh (paper section 2.1 and 2.2, eq. 16 to 24).
    Mesh {
        /// Edge length of an even mesh as a share of the side of a square of the region's area. Without it the plane system,
        /// exact on any mesh, takes a Delaunay mesh of the boundary, and the sphere system [`SPHERE_MESH_SIZE`]. A surface
        /// that is not planar keeps its own triangles.
        size: Option<f64>,
    },
    /// The observed side summed over the mask's pixels (paper eq. 6, 7), the predicted side from the boundary; sphere only.
    Pixels,
}

/// Each triangle of a spherical mesh is split into the square of this number for its quadrature.
pub const SUBDIVISION: usize = 2;

/// Edge length of the spherical quadrature's mesh as a share of the side of a square of the region's area.
pub const SPHERE_MESH_SIZE: f64 = 0.125;

/// A plane that passes the camera nearer than this, as a share of the facet's distance, is seen edge-on.
const EDGE_ON: f64 = 1e-9;

/// A piece of a region in the plane `normal . X = offset`.
#[derive(Debug, Clone)]
pub struct Facet {
    normal: Vector3<f64>,
    offset: f64,
    shape: Shape,
}

#[derive(Debug, Clone)]
enum Shape {
    Rings(Vec<SpaceRing>),
    Triangles { vertices: Vec<Vector3<f64>>, triangles: Vec<[usize; 3]> },
}

/// A closed ring of the world.
#[derive(Debug, Clone)]
struct SpaceRing {
    vertices: Vec<Vector3<f64>>,
    /// The same in groups, coordinate by coordinate; past the last vertex comes the first again.
    groups: Vec<[Lanes; 3]>,
}

impl SpaceRing {
    fn new(vertices: Vec<Vector3<f64>>) -> Self {
        let group = |start: usize| {
            let vertex = |i: usize| vertices.get(start + i).unwrap_or(&vertices[0]);
            let group: [_; LANES] = std::array::from_fn(vertex);
            [0, 1, 2].map(|axis| Lanes(group.map(|v| v[axis])))
        };
        Self { groups: (0..vertices.len()).step_by(LANES).map(group).collect(), vertices }
    }
}

/// The facets of a region, its coordinates taken relative to `origin`: one for a plane, one a triangle for a surface.
///
/// # Errors
/// When the region cannot be triangulated for `Integration::Mesh`.
pub fn facets(
    world: &WorldRegion,
    origin: &Vector3<f64>,
    system: System,
    integration: Integration,
    budget: &Budget,
) -> Result<Vec<Facet>> {
    match world.surface() {
        Some(surface) => Ok(surface_facets(surface, origin, integration)),
        None => Ok(vec![planar_facet(world, origin, system, integration, budget)?]),
    }
}

/// The mesh on which an outline's integrals are taken, with edges of `size` as of [`Integration::Mesh`].
///
/// # Errors
/// A size that is not positive and finite, or an outline that cannot be meshed.
#[cfg(feature = "mesh")]
pub fn integration_mesh(outline: &PlaneRings, system: System, size: Option<f64>, budget: &Budget) -> Result<PlaneMesh> {
    if let Some(size) = size.filter(|size| !(size.is_finite() && *size > 0.0)) {
        let needed = "positive and finite, a share of the square root of the region's area".into();
        return Err(Error::InvalidOption { item: "mesh_size", found: size.to_string(), needed });
    }
    let even = |share: f64| even_mesh_within(outline, share * outline.area().sqrt(), budget);
    match (system, size) {
        (_, Some(share)) => even(share),
        (System::Plane, None) => triangulate_within(outline, MeshOptions::default(), budget),
        (System::Sphere, None) => even(SPHERE_MESH_SIZE),
    }
}

/// No mesh.
///
/// # Errors
/// Always: the crate was built without the feature `mesh`.
#[cfg(not(feature = "mesh"))]
pub fn integration_mesh(_: &PlaneRings, _: System, _: Option<f64>, _: &Budget) -> Result<PlaneMesh> {
    let needed = "another, or the crate's feature `mesh`".into();
    Err(Error::InvalidOption { item: "integration", found: "over a mesh".into(), needed })
}

fn planar_facet(
    world: &WorldRegion,
    origin: &Vector3<f64>,
    system: System,
    integration: Integration,
    budget: &Budget,
) -> Result<Facet> {
    let frame = world.frame();
    let lift = |p: &Vector2<f64>| frame.to_world(p) - origin;
    let shape = match integration {
        Integration::Mesh { size } => {
            let mesh = integration_mesh(world.outline(), system, size, budget)?;
            Shape::Triangles { vertices: mesh.vertices.iter().map(lift).collect(), triangles: mesh.triangles }
        }
        _ => rings_of(world.outline().rings(), world, origin),
    };
    Ok(Facet { normal: frame.axes[2], offset: frame.axes[2].dot(&(frame.origin - origin)), shape })
}

/// Rings of a world region's plane in the world about `origin`.
fn rings_of(rings: &[Vec<Vector2<f64>>], world: &WorldRegion, origin: &Vector3<f64>) -> Shape {
    let lift = |p: &Vector2<f64>| world.frame().to_world(p) - origin;
    let ring = |ring: &Vec<Vector2<f64>>| SpaceRing::new(ring.iter().map(lift).collect());
    Shape::Rings(rings.iter().map(ring).collect())
}

fn surface_facets(surface: &Surface, origin: &Vector3<f64>, integration: Integration) -> Vec<Facet> {
    let corners = |t: &[usize; 3]| t.map(|v| surface.vertices[v] - origin);
    let facet = |t: &[usize; 3]| {
        let [a, b, c] = corners(t);
        // A triangle without area has no plane and no part in any integral.
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        let shape = match integration {
            Integration::Mesh { .. } => Shape::Triangles { vertices: vec![a, b, c], triangles: vec![[0, 1, 2]] },
            _ => Shape::Rings(vec![SpaceRing::new(vec![a, b, c])]),
        };
        Some(Facet { normal, offset: normal.dot(&a), shape })
    };
    surface.triangles.iter().filter_map(facet).collect()
}

impl Facet {
    /// The facet of a planar region with boundaries of fewer vertices, for coarse evaluations; others as they are.
    pub fn coarse(&self, world: &WorldRegion, origin: &Vector3<f64>, budget: &Budget) -> Self {
        match world.surface() {
            None => Self { shape: rings_of(world.coarse(budget), world, origin), ..*self },
            Some(_) => self.clone(),
        }
    }

    /// Whether it is a mesh of a planar region, whose integrals may be taken along the boundary.
    pub fn is_mesh(&self, world: &WorldRegion) -> bool {
        matches!(self.shape, Shape::Triangles { .. }) && world.surface().is_none()
    }

    /// The facet of a planar region with its integrals along the boundary, far fewer places than a mesh has; others as they
    /// are.
    pub fn by_boundary(&self, world: &WorldRegion, origin: &Vector3<f64>) -> Self {
        match self.is_mesh(world) {
            true => Self { shape: rings_of(world.outline().rings(), world, origin), ..*self },
            false => self.clone(),
        }
    }

    /// Places whose powers are summed in one evaluation: vertices of its rings, or what a mesh's triangles are sampled at.
    pub fn place_count(&self, system: System) -> usize {
        match (&self.shape, system) {
            (Shape::Rings(rings), _) => rings.iter().map(|ring| ring.vertices.len()).sum(),
            (Shape::Triangles { triangles, .. }, System::Plane) => 3 * triangles.len(),
            (Shape::Triangles { triangles, .. }, System::Sphere) => quadrature_count(SUBDIVISION) * triangles.len(),
        }
    }

    /// The plane along the chart's axes as `nu . P = 1` (`docs/math.md`, eq. 1.7); `None` where it passes through the
    /// camera.
    pub fn nu(&self, chart_from_world: &Pose) -> Option<Vector3<f64>> {
        let normal = chart_from_world.rotation * self.normal;
        let offset = self.offset + normal.dot(&chart_from_world.translation);
        let in_view = offset.abs() > EDGE_ON * chart_from_world.translation.norm();
        in_view.then(|| normal / offset)
    }

    /// Signed moments in the chart at scale 1; `None` where a vertex lies outside the chart.
    pub fn plane_moments(&self, chart_from_world: &Pose, order: usize) -> Option<PlaneMoments> {
        let mut moments = PlaneMoments::zero(order);
        match &self.shape {
            Shape::Rings(rings) => {
                for ring in rings {
                    let mut view = View::new(ring, chart_from_world);
                    vectorized(RingMoments { vertices: &mut view, order, into: &mut moments });
                    if !view.holds_all() {
                        return None;
                    }
                }
            }
            Shape::Triangles { vertices, triangles } => {
                let project = |x: &Vector3<f64>| project_turned(&chart_from_world.transform(x));
                let projected: Vec<_> = vertices.iter().map(project).collect::<Option<_>>()?;
                for t in triangles {
                    moments += &triangle_plane_moments(&t.map(|v| projected[v]), order);
                }
            }
        }
        Some(moments)
    }

    /// The part of the facet within the image's border, in chart coordinates, and the side from which it is seen: -1 from
    /// behind, where the rings are turned round.
    pub fn clipped(&self, chart_from_world: &Pose, chart: &Chart, border: &Border, budget: &Budget) -> (Clipped, f64) {
        let Shape::Rings(rings) = &self.shape else { return (Clipped::default(), 1.0) };
        let project = |ring: &SpaceRing| {
            projected_before(&ring.vertices.iter().map(|x| chart_from_world.transform(x)).collect::<Vec<_>>(), chart)
        };
        border.clipped(rings.iter().map(project).collect(), budget)
    }

    /// Signed moments on the sphere along the chart's axes; `None` where a vertex lies at the camera.
    pub fn sphere_moments(&self, chart_from_world: &Pose, order: usize) -> Option<SphereMoments> {
        match &self.shape {
            Shape::Rings(rings) => {
                let bearing = |x: &Vector3<f64>| chart_from_world.transform(x).try_normalize(f64::MIN_POSITIVE);
                let directions: Vec<Vec<_>> =
                    rings.iter().map(|ring| ring.vertices.iter().map(bearing).collect()).collect::<Option<_>>()?;
                Some(spherical_moments(directions.iter().map(Vec::as_slice), order))
            }
            Shape::Triangles { vertices, triangles } => {
                let moved: Vec<_> = vertices.iter().map(|x| chart_from_world.transform(x)).collect();
                mesh_sphere_moments(&moved, triangles, order, SUBDIVISION).ok()
            }
        }
    }
}

/// A ring as a chart at scale 1 shows it, and how far off the chart's axis its vertices have been.
struct View<'a> {
    ring: &'a SpaceRing,
    /// `chart_from_world`, row by row.
    rows: [[Lanes; 4]; 3],
    nearest: Lanes,
    farthest: Lanes,
}

impl<'a> View<'a> {
    fn new(ring: &'a SpaceRing, chart_from_world: &Pose) -> Self {
        let (rotation, translation) = (chart_from_world.rotation.matrix(), &chart_from_world.translation);
        let entry = |row: usize, column: usize| if column < 3 { rotation[(row, column)] } else { translation[row] };
        let row = |row: usize| [0, 1, 2, 3].map(|column| Lanes::splat(entry(row, column)));
        Self { ring, rows: [0, 1, 2].map(row), nearest: Lanes::splat(f64::INFINITY), farthest: Lanes::ZERO }
    }

    /// Whether all vertices were nearer than 87 degrees to the chart's axis.
    fn holds_all(&self) -> bool {
        self.nearest.min() > 0.0 && self.farthest.max() < const { 1.0 / (MIN_COSINE * MIN_COSINE) - 1.0 }
    }
}

impl VertexGroups for View<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.ring.groups.len()
    }

    #[inline(always)]
    fn group(&mut self, index: usize) -> [Lanes; 2] {
        let [x, y, z] = self.ring.groups[index];
        let along = |[a, b, c, d]: [Lanes; 4]| a * x + b * y + c * z + d;
        let [first, second, third] = self.rows;
        let (px, py, pz) = (along(first), along(second), along(third));
        let inverse = pz.map(|depth| 1.0 / depth);
        let (u, v) = (px * inverse, py * inverse);
        self.nearest = self.nearest.lower(pz);
        self.farthest = self.farthest.upper(u * u + v * v);
        [u, v]
    }
}
