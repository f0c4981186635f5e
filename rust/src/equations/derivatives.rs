//! Derivatives of moments with respect to the pose, as linear maps of moments one or two orders higher.
//!
//! For a region of the plane `nu . P = 1` in camera coordinates, `1 / P_z` and `1 / |P|` are linear in the projected point,
//! so the boundary's velocity is polynomial and Reynolds' theorem turns each derivative into moments of the same region
//! (`docs/math.md`, section 5).

use nalgebra::Vector3;

use crate::moments::{PlaneMoments, SphereMoments, plane_index};

/// A row of a Jacobian: derivatives by `[omega_x, omega_y, omega_z, tau_x, tau_y, tau_z]`.
pub type Row = [f64; 6];

/// How many orders above a planar moment its derivative reaches.
pub const PLANE_REACH: usize = 1;

/// How many orders above a spherical moment its derivative reaches.
pub const SPHERE_REACH: usize = 2;

/// Derivative of the planar moment of `x^i y^j` by a left increment of the pose (`docs/math.md`, eq. 5.2).
///
/// `moments` holds the region's moments to order `i + j + 1`; `nu` is the region's plane, `nu . P = 1`.
#[inline]
pub fn plane_derivative(moments: &PlaneMoments, nu: &Vector3<f64>, i: usize, j: usize) -> Row {
    let (p, q) = (i as f64, j as f64);
    let k = p + q;
    // In the list of moments the next order begins further on. One with an exponent below zero has the factor zero: any other
    // does in its place.
    let (values, at, order) = (moments.values(), plane_index(i, j), i + j);
    let (here, right, up) = (values[at], values[at + order + 1], values[at + order + 2]);
    let (left, down) = (values[at.saturating_sub(order)], values[at.saturating_sub(order + 1)]);
    let (falling, rising) = (values[at.saturating_sub(1)], values[at + 1]);
    [
        -(k + 3.0) * up - q * down,
        (k + 3.0) * right + p * left,
        q * falling - p * rising,
        (p + 1.0) * nu.x * here + p * (nu.y * rising + nu.z * left),
        (q + 1.0) * nu.y * here + q * (nu.x * falling + nu.z * down),
        -(k + 3.0) * (nu.x * right + nu.y * up) - (k + 2.0) * nu.z * here,
    ]
}

/// Derivative of the spherical moment of `r^e` by a left increment of the pose (`docs/math.md`, eq. 5.4).
///
/// `moments` holds the region's moments to order `|e| + 2`; `nu` is the region's plane, `nu . P = 1`.
pub fn sphere_derivative(moments: &SphereMoments, nu: &Vector3<f64>, e: [usize; 3]) -> Row {
    let e = e.map(|exponent| exponent as i32);
    let k = e.iter().sum::<i32>() as f64;
    let s = |e: [i32; 3]| spatial_moment_or_zero(moments, e);
    let turned = |w: usize| {
        let (u, v) = ((w + 1) % 3, (w + 2) % 3);
        e[v] as f64 * s(raised(raised(e, v, -1), u, 1)) - e[u] as f64 * s(raised(raised(e, u, -1), v, 1))
    };
    let shifted = |q: usize| -> f64 {
        (0..3)
            .map(|c| {
                let up = raised(e, c, 1);
                nu[c] * (up[q] as f64 * s(raised(up, q, -1)) - (k + 3.0) * s(raised(up, q, 1)))
            })
            .sum()
    };
    [turned(0), turned(1), turned(2), shifted(0), shifted(1), shifted(2)]
}

fn spatial_moment_or_zero(moments: &SphereMoments, e: [i32; 3]) -> f64 {
    if e.iter().any(|&exponent| exponent < 0) {
        return 0.0;
    }
    moments.get(e[0] as usize, e[1] as usize, e[2] as usize)
}

fn raised(mut e: [i32; 3], axis: usize, by: i32) -> [i32; 3] {
    e[axis] += by;
    e
}
