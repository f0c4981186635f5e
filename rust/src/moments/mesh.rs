//! Moments of a triangulated region: the paper's form (sections 2.1 and 2.2), also for surfaces that are not planar.

use nalgebra::{Vector2, Vector3};

use super::{MAX_ORDER, PlaneMoments, SphereMoments, plane_count, plane_index};
use crate::error::{Error, Result};

/// Planar moments of a triangle to `order`, exact; negative when its vertices turn clockwise.
///
/// `integral of x^i y^j = 2 area i! j! / (i + j + 2)! S_ij` by the recursion of the paper's eq. 18 to 24
/// (`docs/math.md`, eq. 4.2).
///
/// # Panics
/// When `order` is above [`MAX_ORDER`].
pub fn triangle_plane_moments([a, b, c]: &[Vector2<f64>; 3], order: usize) -> PlaneMoments {
    let mut sums = multiply_by_powers(&[0.0; plane_count(MAX_ORDER)], c, order);
    sums = multiply_by_powers(&sums, b, order);
    sums = multiply_by_powers(&sums, a, order);
    let doubled_area = (b - a).perp(&(c - a));
    let mut moments = PlaneMoments::zero(order);
    let values = moments.values_mut();
    for k in 0..=order {
        // i! j! / k!, starting with j = 0.
        let mut inverse_binomial = 1.0;
        for j in 0..=k {
            let index = plane_index(k - j, j);
            values[index] = doubled_area * inverse_binomial / ((k + 1) * (k + 2)) as f64 * sums[index];
            inverse_binomial *= (j + 1) as f64 / (k - j).max(1) as f64;
        }
    }
    moments
}

/// One level of the recursion: `T_ij = v_x T_(i-1,j) + v_y T_(i,j-1) + inner_ij`, 1 at (0, 0)
/// (`docs/math.md`, eq. 4.3).
fn multiply_by_powers(
    inner: &[f64; plane_count(MAX_ORDER)],
    vertex: &Vector2<f64>,
    order: usize,
) -> [f64; plane_count(MAX_ORDER)] {
    let mut table = *inner;
    table[0] = 1.0;
    for k in 1..=order {
        for j in 0..=k {
            let index = plane_index(k - j, j);
            if j < k {
                table[index] += vertex.x * table[plane_index(k - j - 1, j)];
            }
            if j > 0 {
                table[index] += vertex.y * table[plane_index(k - j, j - 1)];
            }
        }
    }
    table
}

/// Planar moments of a mesh to `order`: the sum over its triangles, clockwise ones negative (paper eq. 17).
///
/// Fails when a triangle names a vertex that isn't there.
///
/// # Panics
/// When `order` is above [`MAX_ORDER`].
pub fn mesh_plane_moments(vertices: &[Vector2<f64>], triangles: &[[usize; 3]], order: usize) -> Result<PlaneMoments> {
    let mut sum = PlaneMoments::zero(order);
    for (number, triangle) in triangles.iter().enumerate() {
        let moments = triangle_plane_moments(&corners(vertices, triangle, number)?, order);
        for (value, more) in sum.values_mut().iter_mut().zip(moments.values()) {
            *value += more;
        }
    }
    Ok(sum)
}

/// Spherical moments of a triangle of camera-frame points to `order`, by quadrature (paper section 2.1, eq. 10).
///
/// Positive when the triangle turns counter-clockwise seen from the far side, that is from outside the sphere. The flat
/// triangle is cut into `subdivision^2` equal ones (0 counts as 1), each with a 7-point rule of degree 5 for
/// `integral of f(P / |P|) dS`, `dS = det(A, B, C) / |P|^3` of the barycentric element (`docs/math.md`, eq. 4.4). The
/// error falls with the sixth power of the pieces' size. A triangle in a plane through the camera's center has no
/// moments.
///
/// # Panics
/// When `order` is above [`MAX_ORDER`].
pub fn triangle_sphere_moments([a, b, c]: &[Vector3<f64>; 3], order: usize, subdivision: usize) -> SphereMoments {
    let mut moments = SphereMoments::zero(order);
    let volume = a.dot(&(b - a).cross(&(c - a)));
    if volume == 0.0 {
        return moments;
    }
    let pieces = subdivision.max(1);
    let scale = 1.0 / pieces as f64;
    let rule = triangle_rule();
    for (column, row, side) in piece_corners(pieces) {
        for (weight, beta, gamma) in rule {
            let (u, v) = (scale * (column + side * beta), scale * (row + side * gamma));
            let point = a + u * (b - a) + v * (c - a);
            let distance = point.norm();
            // The reference triangle has area 1/2.
            let element = 0.5 * scale * scale * volume / distance.powi(3);
            moments.add_point(&(point / distance), weight * element);
        }
    }
    moments
}

/// Points at which [`triangle_sphere_moments`] takes the powers of bearings.
pub fn quadrature_count(subdivision: usize) -> usize {
    subdivision.max(1).pow(2) * triangle_rule().len()
}

/// Corner (in pieces along both sides) and direction of every piece of a triangle cut `pieces` ways along a side.
fn piece_corners(pieces: usize) -> impl Iterator<Item = (f64, f64, f64)> {
    let upright = (0..pieces).flat_map(move |i| (0..pieces - i).map(move |j| (i as f64, j as f64, 1.0)));
    let turned = (1..pieces).flat_map(move |i| (1..=pieces - i).map(move |j| (i as f64, j as f64, -1.0)));
    upright.chain(turned)
}

/// The 7-point rule of degree 5 (Radon 1948): weight and the barycentric coordinates of the second and third corner.
fn triangle_rule() -> [(f64, f64, f64); 7] {
    let root = 15.0_f64.sqrt();
    let (near, near_weight) = ((6.0 - root) / 21.0, (155.0 - root) / 1200.0);
    let (far, far_weight) = ((6.0 + root) / 21.0, (155.0 + root) / 1200.0);
    [
        (9.0 / 40.0, 1.0 / 3.0, 1.0 / 3.0),
        (near_weight, near, near),
        (near_weight, 1.0 - 2.0 * near, near),
        (near_weight, near, 1.0 - 2.0 * near),
        (far_weight, far, far),
        (far_weight, 1.0 - 2.0 * far, far),
        (far_weight, far, 1.0 - 2.0 * far),
    ]
}

/// Spherical moments of a mesh of camera-frame points to `order`: the sum over its triangles (paper eq. 9, 10).
///
/// `subdivision` as in [`triangle_sphere_moments`]. Fails when a triangle names a vertex that isn't there.
///
/// # Panics
/// When `order` is above [`MAX_ORDER`].
pub fn mesh_sphere_moments(
    vertices: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    order: usize,
    subdivision: usize,
) -> Result<SphereMoments> {
    let mut sum = SphereMoments::zero(order);
    for (number, triangle) in triangles.iter().enumerate() {
        sum.add(&triangle_sphere_moments(&corners(vertices, triangle, number)?, order, subdivision));
    }
    Ok(sum)
}

/// The three corners of triangle `number`.
fn corners<P: Copy>(vertices: &[P], &[i, j, k]: &[usize; 3], number: usize) -> Result<[P; 3]> {
    let corner = |index: usize| {
        vertices.get(index).copied().ok_or_else(|| Error::InvalidGeometry {
            item: "a triangle's vertex index",
            found: format!("{index} (triangle {number})"),
            needed: format!("below the number of vertices, {}", vertices.len()),
        })
    };
    Ok([corner(i)?, corner(j)?, corner(k)?])
}
