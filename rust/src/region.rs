//! Regions of the 3D data: planar regions with holes and triangulated surface patches, valid by construction.

pub mod cell_normals;
pub(crate) mod derived;
mod plane;
mod points;
pub mod robust_plane;
pub mod samples;
mod surface;

use std::sync::Arc;

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::edge_field::EdgeField;
use crate::geometry::rings::PlaneRings;
use crate::moments::shape::NormalizedShape;
use derived::Derived;
use plane::check_planar;
use points::{extent, span};
use samples::Samples;
use surface::{boundary_rings, check_indices};

pub use plane::PlaneFrame;
pub(crate) use points::check_finite;
pub use surface::Surface;

/// Height above the plane, as a share of the distance, below which a point is on no side of it: a twentieth of a degree.
const ON_EDGE: f64 = 1e-3;

/// A region as the camera sees it: closed rings of bearings, joined by great-circle arcs.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::ObservedRegion;
/// // A pinhole camera's bearings of an outline in pixels; any length will do.
/// let (focal, x, y) = (1200.0, 960.0, 540.0);
/// let outline = [[931.9, 236.4], [933.9, 867.1], [653.6, 920.4], [627.2, 220.8]];
/// let bearings = outline.map(|p: [f64; 2]| Vector3::new((p[0] - x) / focal, (p[1] - y) / focal, 1.0)).to_vec();
/// let door = ObservedRegion::new(vec![bearings], 191_000.0); // pixels inside of it
/// assert_eq!(door.checked_pixel_area()?, 191_000.0);
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone)]
#[must_use]
pub struct ObservedRegion {
    /// Bearings of each ring's vertices, in camera axes; the rings may turn either way.
    pub rings: Vec<Vec<Vector3<f64>>>,
    /// The region's area in pixels: how fine the image saw its boundary.
    pub pixel_area: f64,
    /// The region's pixels, for sums over them.
    pub pixels: Option<Pixels>,
    /// The image's border where it may have cut the region: lines of bearings in order around the image, all with the
    /// image on the same hand, each going on beside the region at both ends or, around the whole image, closed by its first
    /// bearing.
    pub borders: Vec<Vec<Vector3<f64>>>,
    /// Stretches of the rings that are not the region's own boundary, lines of bearings: edges of what hides a part of
    /// it, or edges that no image shows.
    pub hidden: Vec<Vec<Vector3<f64>>>,
}

/// The pixels of a mask: the bearing of each, and the solid angle of the part of it that belongs to the region.
#[derive(Debug, Clone)]
pub struct Pixels {
    /// Unit bearings of the pixels' centers.
    pub bearings: Vec<Vector3<f64>>,
    /// Solid angles, in steradians.
    pub solid_angles: Vec<f64>,
}

impl ObservedRegion {
    /// The region inside rings of bearings that covers `pixel_area` pixels of the image.
    pub fn new(rings: Vec<Vec<Vector3<f64>>>, pixel_area: f64) -> Self {
        Self { rings, pixel_area, pixels: None, borders: Vec::new(), hidden: Vec::new() }
    }

    /// The area in pixels.
    ///
    /// # Errors
    /// When it is not a positive number.
    pub fn checked_pixel_area(&self) -> Result<f64> {
        if self.pixel_area > 0.0 && self.pixel_area.is_finite() {
            return Ok(self.pixel_area);
        }
        Err(Error::InvalidObservation {
            item: "the observed region's area in pixels",
            found: self.pixel_area.to_string(),
            needed: "a positive number".into(),
        })
    }
}

/// A region of the 3D data: its outline in a plane's coordinates, and its surface where that is not the plane itself.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::WorldRegion;
/// let ring = |side: f64, z: f64| [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]].map(|[x, y]| Vector3::new(x, y, z));
/// // A frame: the first ring is the outline, the other a hole in it; on the side of the scanner that the camera sees too.
/// let pane = ring(0.5, 0.0).map(|x| x + Vector3::new(0.2, 0.2, 0.0));
/// let frame = WorldRegion::from_rings(&[ring(1.0, 0.0).to_vec(), pane.to_vec()])?.seen_from(Vector3::new(2.0, 1.0, 5.0))?;
/// assert!((frame.outline().area() - 0.75).abs() < 1e-12);
///
/// // A bent surface is given by its triangles.
/// let vertices = [ring(1.0, 0.0), ring(1.0, 0.1)].concat();
/// let bent = WorldRegion::from_mesh(&[vertices[0], vertices[1], vertices[2], vertices[7]], &[[0, 1, 2], [0, 2, 3]])?;
/// assert!(bent.surface().is_some());
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone)]
#[must_use]
pub struct WorldRegion {
    frame: PlaneFrame,
    outline: PlaneRings,
    surface: Option<Surface>,
    viewpoint: Option<Vector3<f64>>,
    /// Shared by all copies.
    derived: Arc<Derived>,
    samples: Option<Samples>,
    /// Whether its samples lie on one line, so that its plane may be any through that line.
    is_line: bool,
}

impl WorldRegion {
    /// The planar region inside the first ring and outside the others.
    ///
    /// The vertices may turn either way and are moved onto their least squares plane.
    ///
    /// # Errors
    /// A coordinate that is not finite, fewer than 3 vertices, a ring farther than 1 % of the region's extent from one
    /// plane, crossing edges, zero area, or a hole that is not inside the first ring; the message names the ring.
    pub fn from_rings(rings: &[Vec<Vector3<f64>>]) -> Result<Self> {
        if rings.is_empty() {
            return Err(Error::NoRings);
        }
        for (ring, vertices) in rings.iter().enumerate() {
            check_finite(&format!("ring {ring} vertex"), vertices)?;
            if vertices.len() < 3 {
                return Err(Error::TooFewVertices { ring, found: vertices.len() });
            }
        }
        let frame = PlaneFrame::fit(&rings.concat())?;
        check_planar(rings, &frame)?;
        let flat = rings.iter().map(|ring| ring.iter().map(|x| frame.to_plane(x)).collect()).collect();
        Ok(Self::from_outline(frame, PlaneRings::polygon(flat)?))
    }

    /// The planar region of rings given in a plane's coordinates.
    pub fn from_outline(frame: PlaneFrame, outline: PlaneRings) -> Self {
        Self { frame, outline, surface: None, viewpoint: None, samples: None, derived: Arc::default(), is_line: false }
    }

    /// The region covered by a triangulated open surface, which need not be planar but must not hide itself from the camera.
    ///
    /// # Errors
    /// Vertices that are not finite, indices out of range, an edge shared by more than two triangles or with
    /// triangles turning against each other, a closed surface, or a boundary whose projection along the mean normal
    /// crosses itself.
    pub fn from_mesh(vertices: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<Self> {
        check_finite("vertex", vertices)?;
        check_indices(vertices, triangles)?;
        let rings = boundary_rings(vertices, triangles)?;
        let frame = PlaneFrame::fit(&rings.concat())?;
        let flat = rings.iter().map(|ring| ring.iter().map(|x| frame.to_plane(x)).collect()).collect();
        let outline = PlaneRings::polygon(largest_first(flat))?;
        let surface = Surface { vertices: vertices.to_vec(), triangles: triangles.to_vec(), rings };
        let surface = (height_range(vertices, &frame) > f64::EPSILON * 64.0 * extent(vertices)).then_some(surface);
        Ok(Self { surface, ..Self::from_outline(frame, outline) })
    }

    /// The same region of which a viewpoint, such as the scanner's place, lies on the side that the camera sees.
    ///
    /// # Errors
    /// A viewpoint that is not finite, or so near to the plane that it is on no side.
    pub fn seen_from(self, viewpoint: Vector3<f64>) -> Result<Self> {
        check_finite("viewpoint", &[viewpoint])?;
        let (height, distance) = (self.frame.height(&viewpoint).abs(), (viewpoint - self.frame.origin).norm());
        if height > ON_EDGE * distance {
            return Ok(Self { viewpoint: Some(viewpoint), ..self });
        }
        Err(Error::InvalidGeometry {
            item: "the viewpoint",
            found: format!("{height:.3e} off the region's plane at a distance of {distance:.3e}"),
            needed: "a point clearly on one side of it".into(),
        })
    }

    /// A point on the side that the camera sees, where one was given.
    pub fn viewpoint(&self) -> Option<&Vector3<f64>> {
        self.viewpoint.as_ref()
    }

    /// Whether a camera at this point of the world sees the side away from the viewpoint; `false` without a viewpoint, and of a line,
    /// whose plane may be any.
    ///
    /// Of a surface that is not planar, the mean plane's side counts.
    pub fn is_behind(&self, camera: &Vector3<f64>) -> bool {
        !self.is_line
            && self.viewpoint.is_some_and(|viewpoint| self.frame.height(&viewpoint) * self.frame.height(camera) < 0.0)
    }

    /// The same region with labeled samples: places that a sensor measured inside and outside of it, moved onto its plane.
    ///
    /// With samples, the pose is inferred from them, and the outline gives starts.
    ///
    /// # Errors
    /// What [`Samples::new`] refuses, and samples of a surface that is not planar.
    pub fn with_samples(self, inside: &[Vector3<f64>], outside: &[Vector3<f64>]) -> Result<Self> {
        if self.surface.is_some() {
            return Err(Error::InvalidGeometry {
                item: "the region with samples",
                found: "a surface that is not planar".into(),
                needed: "a planar region".into(),
            });
        }
        let samples = Samples::new(&self.frame, inside, outside)?;
        Ok(Self { samples: Some(samples), ..self })
    }

    /// The same region with labeled samples on one line alone, as of a single scan line: its plane may be any through that line,
    /// and the outline gives starts.
    ///
    /// # Errors
    /// As of [`WorldRegion::with_samples`], and a sample off the line through those inside by more than a tenth of the extent.
    pub fn with_line_samples(self, inside: &[Vector3<f64>], outside: &[Vector3<f64>]) -> Result<Self> {
        let sampled = self.with_samples(inside, outside)?;
        samples::check_line(inside, outside)?;
        Ok(Self { is_line: true, ..sampled })
    }

    /// The same region with samples also at places outside that it encloses: they count where its image has a hole.
    ///
    /// # Errors
    /// What [`Samples::with_enclosed`] refuses, and a region without samples.
    pub fn with_enclosed(self, enclosed: &[Vector3<f64>]) -> Result<Self> {
        let samples = self.samples.ok_or_else(|| Error::InvalidGeometry {
            item: "the region with enclosed samples",
            found: "a region without others".into(),
            needed: "samples inside and outside".into(),
        })?;
        let samples = samples.with_enclosed(&self.frame, enclosed)?;
        Ok(Self { samples: Some(samples), ..self })
    }

    /// Labeled samples of the plane.
    pub fn samples(&self) -> Option<&Samples> {
        self.samples.as_ref()
    }

    /// Whether its samples lie on one line, so that its plane may be any through that line.
    pub fn is_line(&self) -> bool {
        self.is_line
    }

    /// The plane's coordinates in which [`WorldRegion::outline`] is given; of a line, some plane through it.
    pub fn frame(&self) -> &PlaneFrame {
        &self.frame
    }

    /// The outline in plane coordinates; of a surface, its projection along the mean normal.
    pub fn outline(&self) -> &PlaneRings {
        &self.outline
    }

    /// The surface, for a region that is not planar.
    pub fn surface(&self) -> Option<&Surface> {
        self.surface.as_ref()
    }

    /// The boundary rings in the world.
    pub fn rings(&self) -> Vec<Vec<Vector3<f64>>> {
        match &self.surface {
            Some(surface) => surface.rings.clone(),
            None => {
                self.outline.rings().iter().map(|ring| ring.iter().map(|p| self.frame.to_world(p)).collect()).collect()
            }
        }
    }

    /// The edges of the outline in plane coordinates.
    pub(crate) fn edge_field(&self) -> Arc<EdgeField> {
        self.derived.edge_field(&self.outline)
    }

    /// The outline's rings by fewer vertices, in plane coordinates, for coarse evaluations.
    pub(crate) fn coarse(&self, budget: &Budget) -> &[Vec<Vector2<f64>>] {
        self.derived.coarse(&self.outline, budget)
    }

    /// The corners of each boundary ring, world.
    pub(crate) fn corners(&self, budget: &Budget) -> &[Vec<Vector3<f64>>] {
        self.derived.corners(&self.outline, || self.rings(), budget)
    }

    /// The outline's shape whatever affine map it is seen under; `None` where it is too slender for one.
    pub(crate) fn shape(&self) -> Option<&NormalizedShape> {
        self.derived.shape(&self.outline)
    }
}

fn height_range(points: &[Vector3<f64>], frame: &PlaneFrame) -> f64 {
    span(points.iter().map(|p| frame.height(p)))
}

fn largest_first(mut rings: Vec<Vec<Vector2<f64>>>) -> Vec<Vec<Vector2<f64>>> {
    let size = |ring: &Vec<Vector2<f64>>| {
        (0..ring.len()).map(|a| ring[a].perp(&ring[(a + 1) % ring.len()])).sum::<f64>().abs()
    };
    rings.sort_by(|a, b| size(b).total_cmp(&size(a)));
    rings
}
