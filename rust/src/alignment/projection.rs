//! The projection of any central camera as a table over the faces of a cube around it (`docs/math.md`, section 19).

use std::array;

use nalgebra::{Vector2, Vector3};

use super::groups::{Floats, GROUP, Numbers, ZEROS, whole};
use crate::error::Error;

/// Cells along the side of a face, from the first try to the last.
const CELLS: [usize; 5] = [16, 32, 64, 128, 256];

/// Largest error of a pixel between the nodes of the table that is not worth a finer one, pixels: a twentieth of the
/// narrowest spread of edges that are compared.
const TOLERANCE_PX: f64 = 0.1;

/// Error beyond which a cell of the finest table shows a seam, such as where a panorama wraps around, pixels.
const SEAM_PX: f64 = 1.0;

/// Projection table of a camera, bearings to pixels: exact at the nodes of a grid on each face of a cube, bilinear between them.
///
/// A perspective camera without distortion is exact on the face before it, a right angle wide, which it maps linearly.
#[derive(Debug, Clone)]
pub struct Projection {
    /// Along the side of a face.
    count: usize,
    faces: [Face; 6],
    /// [`NONE`], and those of the faces that see something, face by face and row by row.
    cells: Vec<Cell>,
}

/// Offset of a face's cells, and which bits of their numbers count: none of a face that sees nothing, so that all are [`NONE`].
#[derive(Debug, Clone, Copy)]
struct Face {
    first: u32,
    mask: u32,
}

/// Coefficients of x and y: `c[0] + c[1] u + c[2] v + c[3] u v`, with u and v from 0 to 1 across the cell.
///
/// NaN where the camera sees nothing.
#[derive(Debug, Clone, Copy)]
struct Cell([[f32; 4]; 2]);

/// Points at which the bearings of a group of edges meet the cube.
pub(super) struct Places {
    /// The one of x, y and z along which the bearing is longest.
    axis: Numbers,
    /// The bearing's components along the two others, in turn: those along the sides of the face.
    along: [Floats; 2],
    /// The inverse of its component along the axis.
    inverse: Floats,
    /// Half the cells of a side, over the size of that component: moves within the cell by those of the bearing.
    scale: Floats,
    /// The place within the cell, from 0 to 1.
    within: [Floats; 2],
    face: Numbers,
    /// Of the face, row by row.
    cell: Numbers,
}

/// Pixels of a group of edges; NaN of edges out of view.
pub(super) struct Pixels {
    pub(super) pixels: [Floats; 2],
    /// Derivatives of each pixel's x and y by the place within the cell.
    by_within: [[Floats; 2]; 2],
}

impl Projection {
    /// The table of a camera with an image of `size` (width, height) pixels, the first pixel's center being (0, 0).
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
            return Err(Error::InvalidOption {
                item: "camera",
                found,
                needed: "the camera that took the photo".into(),
            }
            .into());
        }
        let mut joined = vec![NONE];
        let faces = faces.map(|face: Option<Vec<Cell>>| {
            let first = joined.len() as u32;
            let Some(face) = face else { return Face { first: 0, mask: 0 } };
            joined.extend(face);
            Face { first, mask: u32::MAX }
        });
        Ok(Self { count: cells, faces, cells: joined })
    }

    /// The table of the same camera with focal lengths multiplied by a factor and its principal point at a pixel. It has no bearings beyond
    /// those of this one, so that it shows all of the image for factors of at least 1.
    pub fn zoomed(&self, factor: f64, principal: &Vector2<f64>) -> Self {
        let factor = factor as f32;
        let offsets = [principal.x, principal.y].map(|place| place as f32 * (1.0 - factor));
        let zoomed = |cell: &Cell| {
            let mut coefficients = cell.0.map(|along| along.map(|value| value * factor));
            for (along, offset) in coefficients.iter_mut().zip(offsets) {
                along[0] += offset;
            }
            Cell(coefficients)
        };
        Self { cells: self.cells.iter().map(zoomed).collect(), ..*self }
    }

    /// Points at which bearings meet the cube.
    #[inline(always)]
    pub(super) fn places(&self, [xs, ys, zs]: &[Floats; 3]) -> Places {
        let (half, last) = (0.5 * self.count as f32, (self.count - 1) as f32);
        let mut places = Places {
            axis: [0; GROUP],
            along: [ZEROS; 2],
            inverse: ZEROS,
            scale: ZEROS,
            within: [ZEROS; 2],
            face: [0; GROUP],
            cell: [0; GROUP],
        };
        for edge in 0..GROUP {
            let bearing = [xs[edge], ys[edge], zs[edge]];
            let [x, y, z] = bearing.map(f32::abs);
            let axis = if (z >= x) & (z >= y) { 2 } else { i32::from(x < y) };
            let [first, second, depth] = turned(bearing, axis);
            let inverse = 1.0 / depth;
            let scale = half * inverse.abs();
            let (u, v) = (first * scale + half, second * scale + half);
            // NaN, of the bearing 0, is taken for 0 here, and is NaN within the cell.
            let (column, row) = (whole(u, last), whole(v, last));
            places.axis[edge] = axis;
            places.along[0][edge] = first;
            places.along[1][edge] = second;
            places.inverse[edge] = inverse;
            places.scale[edge] = scale;
            places.within[0][edge] = u - column as f32;
            places.within[1][edge] = v - row as f32;
            places.face[edge] = 2 * axis + i32::from(depth < 0.0);
            places.cell[edge] = row * self.count as i32 + column;
        }
        places
    }

    /// The pixels at which places are seen.
    #[inline(always)]
    pub(super) fn pixels(&self, places: &Places) -> Pixels {
        let mut projected = Pixels { pixels: [ZEROS; 2], by_within: [[ZEROS; 2]; 2] };
        for edge in 0..GROUP {
            let face = self.faces[places.face[edge] as usize];
            let Cell(cell) = self.cells[(face.first + (places.cell[edge] as u32 & face.mask)) as usize];
            let (u, v) = (places.within[0][edge], places.within[1][edge]);
            for (axis, [a, b, c, d]) in cell.into_iter().enumerate() {
                let (by_u, by_v) = (b + d * v, c + d * u);
                projected.pixels[axis][edge] = a + b * u + by_v * v;
                projected.by_within[axis][0][edge] = by_u;
                projected.by_within[axis][1][edge] = by_v;
            }
        }
        projected
    }

    /// The pixel at which a bearing of any length is seen; `None` where it is not seen.
    pub fn pixel_of(&self, bearing: &Vector3<f64>) -> Option<Vector2<f64>> {
        let bearings = [0, 1, 2].map(|axis| [bearing[axis] as f32; GROUP]);
        let pixels = self.pixels(&self.places(&bearings)).pixels;
        let pixel = Vector2::new(pixels[0][0], pixels[1][0]).cast();
        pixel.iter().all(|value: &f64| value.is_finite()).then_some(pixel)
    }
}

impl Pixels {
    /// Derivatives of the pixels by the bearings.
    #[inline(always)]
    pub(super) fn moved(&self, places: &Places, ways: &[Floats; 3]) -> [Floats; 2] {
        let mut moved = [ZEROS; 2];
        for edge in 0..GROUP {
            let [first, second, depth] = turned([ways[0][edge], ways[1][edge], ways[2][edge]], places.axis[edge]);
            let deeper = depth * places.inverse[edge];
            let by_u = (first - places.along[0][edge] * deeper) * places.scale[edge];
            let by_v = (second - places.along[1][edge] * deeper) * places.scale[edge];
            for (moved, [along_u, along_v]) in moved.iter_mut().zip(&self.by_within) {
                moved[edge] = along_u[edge] * by_u + along_v[edge] * by_v;
            }
        }
        moved
    }

    /// The derivatives by the bearings of what has derivatives `by_pixel`, exact for the table.
    #[inline(always)]
    pub(super) fn by_bearings(&self, places: &Places, by_pixel: &[Floats; 2]) -> [Floats; 3] {
        let ([x, y], mut by_bearings) = (&self.by_within, [ZEROS; 3]);
        for edge in 0..GROUP {
            let (slope_x, slope_y) = (by_pixel[0][edge], by_pixel[1][edge]);
            let first = (slope_x * x[0][edge] + slope_y * y[0][edge]) * places.scale[edge];
            let second = (slope_x * x[1][edge] + slope_y * y[1][edge]) * places.scale[edge];
            let along = first * places.along[0][edge] + second * places.along[1][edge];
            let by_bearing = turned_back([first, second, -along * places.inverse[edge]], places.axis[edge]);
            for (held, value) in by_bearings.iter_mut().zip(by_bearing) {
                held[edge] = value;
            }
        }
        by_bearings
    }
}

/// The components of a vector along the two axes that follow an axis in turn, and along that one.
#[inline(always)]
fn turned([x, y, z]: [f32; 3], axis: i32) -> [f32; 3] {
    let among = |a: f32, b: f32, c: f32| {
        if axis == 2 {
            c
        } else if axis == 0 {
            a
        } else {
            b
        }
    };
    [among(y, z, x), among(z, x, y), among(x, y, z)]
}

/// The vector of which these are the components.
#[inline(always)]
fn turned_back([first, second, depth]: [f32; 3], axis: i32) -> [f32; 3] {
    let among = |a: f32, b: f32, c: f32| {
        if axis == 2 {
            c
        } else if axis == 0 {
            a
        } else {
            b
        }
    };
    [among(depth, second, first), among(first, depth, second), among(second, first, depth)]
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
            let is_visible = shown(&center) || corners.iter().any(&shown) || (whole && around(&corners));
            any |= is_visible;
            let error = (corners.iter().sum::<Vector2<f64>>() / 4.0 - center).amax();
            fine &= !is_visible || (whole && error <= TOLERANCE_PX);
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

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use proptest::prelude::*;

    use super::*;

    /// A fisheye that sees nearly all around, so that every face of the cube is met.
    static FISHEYE: LazyLock<Projection> = LazyLock::new(|| {
        let pixel = |bearing: &Vector3<f64>| {
            let away = bearing.xy().norm();
            let scale = 100.0 * away.atan2(bearing.z) / away.max(1e-12);
            bearing.xy() * scale + Vector2::new(320.0, 320.0)
        };
        Projection::new([640.0, 640.0], |bearings| Ok::<_, Error>(bearings.iter().map(pixel).collect())).unwrap()
    });

    proptest! {
        /// In double precision about the same cell, which is exact: differences in single precision are not.
        #[test]
        fn derivatives_are_those_of_the_cell(
            bearing in prop::array::uniform3(-5.0..5.0_f64),
            way in prop::array::uniform3(-0.1..0.1_f64),
            by_pixel in prop::array::uniform2(-1.0..1.0_f32),
        ) {
            let made = &*FISHEYE;
            let narrow = |values: [f64; 3]| values.map(|value| value as f32);
            let (bearing, way) = (narrow(bearing), narrow(way));
            // All edges of a group alike.
            let filled = |values: [f32; 3]| values.map(|value| [value; GROUP]);
            let places = made.places(&filled(bearing));
            let projected = made.pixels(&places);
            let pixel = projected.pixels.map(|along| along[0]);
            if !pixel.iter().all(|value| value.is_finite()) {
                return Ok(());
            }
            let across = projected.moved(&places, &filled(way));
            let slope = projected.by_bearings(&places, &by_pixel.map(|value| [value; GROUP]));
            for along in projected.pixels.iter().chain(&across).chain(&slope) {
                prop_assert!(along.iter().all(|value| *value == along[0]), "{along:?}");
            }
            let (across, slope) = (across.map(|along| along[0]), slope.map(|along| along[0]));
            let (face, place) = (places.face[0] as usize, places.cell[0] as usize);
            let Cell(cell) = made.cells[made.faces[face].first as usize + place];
            let (axis, sign) = (face / 2, if face % 2 == 1 { -1.0 } else { 1.0 });
            let (row, column) = ((place / made.count) as f64, (place % made.count) as f64);
            let at = |bearing: [f64; 3]| {
                let half = 0.5 * made.count as f64;
                let depth = sign * bearing[axis];
                let u = (bearing[(axis + 1) % 3] / depth + 1.0) * half - column;
                let v = (bearing[(axis + 2) % 3] / depth + 1.0) * half - row;
                cell.map(|c| c.map(f64::from)).map(|[a, b, c, d]| a + b * u + c * v + d * u * v)
            };
            let wide = |values: [f32; 3]| values.map(f64::from);
            let same = at(wide(bearing));
            prop_assert!((0..2).all(|axis| (same[axis] - f64::from(pixel[axis])).abs() < 1e-3), "{same:?} {pixel:?}");
            let moved = |by: f64| at([0, 1, 2].map(|axis| wide(bearing)[axis] + by * wide(way)[axis]));
            let (forth, back) = (moved(1e-4), moved(-1e-4));
            let expected = [0, 1].map(|axis| (forth[axis] - back[axis]) / 2e-4);
            let most = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
            for axis in 0..2 {
                prop_assert!((f64::from(across[axis]) - expected[axis]).abs() < 1e-3 * most, "{across:?} {expected:?}");
            }
            let along: f64 = (0..3).map(|axis| f64::from(slope[axis]) * wide(way)[axis]).sum();
            let expected: f64 = (0..2).map(|axis| f64::from(by_pixel[axis]) * expected[axis]).sum();
            prop_assert!((along - expected).abs() < 1e-3 * most, "{along} {expected}");
        }
    }
}
