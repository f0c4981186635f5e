//! The projection of any central camera as a table over the faces of a cube around it (`docs/math.md`, section 19).

use std::array;

use nalgebra::{Vector2, Vector3};

use crate::error::Error;

/// Cells along the side of a face, from the first try to the last.
const CELLS: [usize; 5] = [16, 32, 64, 128, 256];

/// Largest error of a pixel between the nodes of the table that is not worth a finer one, pixels: a twentieth of the
/// narrowest spread of edges that are compared.
const TOLERANCE_PX: f64 = 0.1;

/// Error beyond which a cell of the finest table shows a seam, such as where a panorama begins anew, pixels.
const SEAM_PX: f64 = 1.0;

/// Where a camera sees bearings, pixels: exact at the nodes of a grid on each face of a cube, bilinear between them.
///
/// A perspective camera without distortion is exact everywhere, since it maps the faces linearly.
#[derive(Debug, Clone)]
pub struct Projection {
    cells: usize,
    faces: [Option<Vec<Cell>>; 6],
}

/// Coefficients of x and y: `c[0] + c[1] u + c[2] v + c[3] u v`, with u and v from 0 to 1 across the cell.
///
/// NaN where the camera sees nothing.
#[derive(Debug, Clone, Copy)]
struct Cell([[f32; 4]; 2]);

/// Where a bearing meets the cube: the face, the cell, the place within it, and the bearing's component along the face's normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    face: usize,
    cell: usize,
    within: [f32; 2],
    depth: f32,
}

impl Projection {
    /// That of a camera with an image of `size` (width, height) pixels, the first pixel's center being (0, 0).
    ///
    /// `project` gives the pixels of some bearings, which are of any length; NaN for those that the camera does not see. The table is
    /// made finer until it is off by less than a tenth of a pixel.
    ///
    /// # Errors
    /// Those of `project`, and a camera that sees nothing within its image.
    pub fn new<E: From<Error>>(
        size: [f64; 2],
        mut project: impl FnMut(&[Vector3<f64>]) -> std::result::Result<Vec<Vector2<f64>>, E>,
    ) -> std::result::Result<Self, E> {
        let mut faces = array::from_fn(|_| None);
        let mut cells = CELLS[0];
        let mut relevant = [true; 6];
        for count in CELLS {
            cells = count;
            let last = count == CELLS[CELLS.len() - 1];
            let mut fine = true;
            for face in (0..6).filter(|face| relevant[*face]).collect::<Vec<_>>() {
                let nodes = project(&grid(face, count + 1, 0.0))?;
                let centers = project(&grid(face, count, 0.5))?;
                let (made, is_fine) = table(&nodes, &centers, count, size, last);
                relevant[face] = made.is_some();
                fine &= is_fine || made.is_none();
                faces[face] = made;
            }
            if fine {
                break;
            }
        }
        if faces.iter().all(Option::is_none) {
            let found = format!("one that sees nothing within its {} x {} pixels", size[0], size[1]);
            return Err(
                Error::OutOfRange { item: "camera", found, needed: "the camera that took the photo".into() }.into()
            );
        }
        Ok(Self { cells, faces })
    }

    fn place(&self, [x, y, z]: [f32; 3]) -> Option<(Place, &Cell)> {
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let (axis, depth, first, second) = if az >= ax && az >= ay {
            (2, z, x, y)
        } else if ax >= ay {
            (0, x, y, z)
        } else {
            (1, y, z, x)
        };
        let face = 2 * axis + usize::from(depth < 0.0);
        let table = self.faces[face].as_ref()?;
        let (count, depth) = (self.cells as f32, depth.abs());
        let half = 0.5 * count / depth;
        let (u, v) = (first * half + 0.5 * count, second * half + 0.5 * count);
        // NaN, of the bearing 0, is taken for 0 here, and is NaN within the cell.
        let (column, row) = ((u as usize).min(self.cells - 1), (v as usize).min(self.cells - 1));
        let cell = row * self.cells + column;
        let within = [u - column as f32, v - row as f32];
        Some((Place { face, cell, within, depth }, &table[cell]))
    }

    /// The pixel at which a bearing is seen, and how it moves with a small `way` from there; NaN or `None` where it is not seen.
    #[inline(always)]
    pub(super) fn pixel(&self, bearing: [f32; 3], way: [f32; 3]) -> Option<([f32; 2], [f32; 2])> {
        let (place, Cell(cell)) = self.place(bearing)?;
        let [u, v] = place.within;
        let moved = self.within_by(&place, bearing, way);
        let mut pixel = [0.0; 2];
        let mut across = [0.0; 2];
        for axis in 0..2 {
            let [a, b, c, d] = cell[axis];
            pixel[axis] = a + b * u + (c + d * u) * v;
            across[axis] = (b + d * v) * moved[0] + (c + d * u) * moved[1];
        }
        Some((pixel, across))
    }

    /// How a way of the bearing moves its place within the cell.
    #[inline(always)]
    fn within_by(&self, place: &Place, bearing: [f32; 3], way: [f32; 3]) -> [f32; 2] {
        let (axis, sign) = (place.face / 2, if place.face % 2 == 1 { -1.0 } else { 1.0 });
        let scale = 0.5 * self.cells as f32 / place.depth;
        let deeper = sign * way[axis] / place.depth;
        let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
        [(way[first] - bearing[first] * deeper) * scale, (way[second] - bearing[second] * deeper) * scale]
    }

    /// The pixel at which a bearing is seen, and its place in the table; `None` where it is not seen.
    #[inline(always)]
    pub(super) fn pixel_and_place(&self, bearing: [f32; 3]) -> Option<([f32; 2], Place)> {
        let (place, Cell(cell)) = self.place(bearing)?;
        let [u, v] = place.within;
        let pixel = cell.map(|[a, b, c, d]| a + b * u + (c + d * u) * v);
        // Fails for NaN.
        (pixel[0] > f32::NEG_INFINITY && pixel[1] > f32::NEG_INFINITY).then_some((pixel, place))
    }

    /// The derivative by the bearing of what has a derivative `by_pixel`, exact for the table.
    #[inline(always)]
    pub(super) fn by_bearing(&self, place: &Place, bearing: [f32; 3], by_pixel: [f32; 2]) -> [f32; 3] {
        let Cell(cell) = self.faces[place.face].as_ref().map_or(NONE, |table| table[place.cell]);
        let [u, v] = place.within;
        let (mut by_u, mut by_v) = (0.0, 0.0);
        for ([_, b, c, d], slope) in cell.into_iter().zip(by_pixel) {
            by_u += slope * (b + d * v);
            by_v += slope * (c + d * u);
        }
        let (axis, sign) = (place.face / 2, if place.face % 2 == 1 { -1.0 } else { 1.0 });
        let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
        let scale = 0.5 * self.cells as f32 / place.depth;
        let mut by_bearing = [0.0; 3];
        by_bearing[first] = by_u * scale;
        by_bearing[second] = by_v * scale;
        by_bearing[axis] = -sign * scale / place.depth * (by_u * bearing[first] + by_v * bearing[second]);
        by_bearing
    }

    /// The pixel at which a bearing of any length is seen; `None` where it is not seen.
    pub fn pixel_of(&self, bearing: &Vector3<f64>) -> Option<Vector2<f64>> {
        let (pixel, _) = self.pixel_and_place([0, 1, 2].map(|axis| bearing[axis] as f32))?;
        Some(Vector2::from(pixel).cast())
    }
}

/// The cell of what is not seen.
const NONE: Cell = Cell([[f32::NAN; 4]; 2]);

/// Bearings of a grid of `count` by `count` places on a face, row by row: of `count - 1` cells' nodes, or with an `offset` of half a cell
/// the middles of `count` cells.
fn grid(face: usize, count: usize, offset: f64) -> Vec<Vector3<f64>> {
    let cells = if offset > 0.0 { count } else { count - 1 };
    let at = |index: usize| 2.0 * (index as f64 + offset) / cells as f64 - 1.0;
    let (axis, depth) = (face / 2, if face % 2 == 1 { -1.0 } else { 1.0 });
    let place = |row: usize, column: usize| {
        let mut bearing = Vector3::zeros();
        bearing[axis] = depth;
        bearing[(axis + 1) % 3] = at(column);
        bearing[(axis + 2) % 3] = at(row);
        bearing
    };
    (0..count).flat_map(|row| (0..count).map(move |column| place(row, column))).collect()
}

/// The cells of a face by the pixels of their nodes, `None` where the image shows none of them; and whether they are fine enough.
fn table(
    nodes: &[Vector2<f64>],
    centers: &[Vector2<f64>],
    count: usize,
    size: [f64; 2],
    last: bool,
) -> (Option<Vec<Cell>>, bool) {
    let shown = |pixel: &Vector2<f64>| (0..2).all(|axis| pixel[axis] > -1.0 && pixel[axis] < size[axis]);
    let around = |corners: &[Vector2<f64>; 4]| {
        (0..2).all(|axis| {
            corners.iter().any(|corner| corner[axis] > -1.0) && corners.iter().any(|corner| corner[axis] < size[axis])
        })
    };
    let (mut any, mut fine) = (false, true);
    let mut cells = Vec::with_capacity(count * count);
    for row in 0..count {
        for column in 0..count {
            let node = |down: usize, right: usize| nodes[(row + down) * (count + 1) + column + right];
            let corners = [node(0, 0), node(0, 1), node(1, 0), node(1, 1)];
            let center = centers[row * count + column];
            let finite = |pixel: &Vector2<f64>| pixel.iter().all(|value| value.is_finite());
            let whole = finite(&center) && corners.iter().all(finite);
            // A cell may be larger than the image.
            let is_seen = shown(&center) || corners.iter().any(&shown) || (whole && around(&corners));
            any |= is_seen;
            let error = (corners.iter().sum::<Vector2<f64>>() / 4.0 - center).amax();
            fine &= !is_seen || (whole && error <= TOLERANCE_PX);
            let kept = whole && !(last && error > SEAM_PX);
            cells.push(if kept { Cell::new(&corners) } else { NONE });
        }
    }
    (any.then_some(cells), fine)
}

impl Cell {
    /// Of the pixels at its nodes, row by row.
    fn new([a, b, c, d]: &[Vector2<f64>; 4]) -> Self {
        Self(array::from_fn(|axis| {
            let (a, b, c, d) = (a[axis], b[axis], c[axis], d[axis]);
            [a, b - a, c - a, a + d - b - c].map(|value| value as f32)
        }))
    }
}
