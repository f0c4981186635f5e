//! The chosen functions of each system: which moments are compared, and at what scale.

use crate::chart::Chart;
use crate::derivatives::{PLANE_REACH, Row, SPHERE_REACH, plane_derivative, sphere_derivative};
use crate::moments::{PlaneMoments, SphereMoments};
use nalgebra::Vector3;

/// Which integrals are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// 13 moments on the normalized plane of each region's chart (paper eq. 14, 15).
    Plane,
    /// 17 moments on the unit sphere (paper eq. 5 to 8).
    Sphere,
}

/// Exponents (i, j) of the plane system: `i, j <= 3`, `i + j <= 4` (paper section 2.2).
pub const PLANE_EXPONENTS: [[usize; 2]; 13] =
    [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2], [3, 0], [2, 1], [1, 2], [0, 3], [3, 1], [2, 2], [1, 3]];

/// Exponents (l, m, n) of the sphere system: each at most 2, the sum at most 3 (paper section 2.1).
pub const SPHERE_EXPONENTS: [[usize; 3]; 17] = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [2, 0, 0],
    [1, 1, 0],
    [1, 0, 1],
    [0, 2, 0],
    [0, 1, 1],
    [0, 0, 2],
    [2, 1, 0],
    [2, 0, 1],
    [1, 2, 0],
    [1, 1, 1],
    [1, 0, 2],
    [0, 2, 1],
    [0, 1, 2],
];

/// Order of the moments from which the plane system's residuals and derivatives follow.
pub const PLANE_ORDER: usize = 4 + PLANE_REACH;

/// Order of the moments from which the sphere system's residuals and derivatives follow.
pub const SPHERE_ORDER: usize = 3 + SPHERE_REACH;

impl System {
    /// Number of equations of one region.
    pub fn count(self) -> usize {
        match self {
            Self::Plane => PLANE_EXPONENTS.len(),
            Self::Sphere => SPHERE_EXPONENTS.len(),
        }
    }
}

/// Adds the plane system's values of moments that were taken in scaled chart coordinates.
pub fn add_plane_values(moments: &PlaneMoments, values: &mut [f64]) {
    for (value, [i, j]) in values.iter_mut().zip(PLANE_EXPONENTS) {
        *value += moments.get(i, j);
    }
}

/// Adds the sphere system's values: moments along the chart's axes, x and y and the area at the chart's scale.
pub fn add_sphere_values(moments: &SphereMoments, scale: f64, values: &mut [f64]) {
    for (value, [l, m, n]) in values.iter_mut().zip(SPHERE_EXPONENTS) {
        *value += moments.get(l, m, n) * scale.powi((l + m + 2) as i32);
    }
}

/// Adds the derivatives of [`add_plane_values`] by the camera's left increment.
///
/// `nu` is the plane `nu . P = 1` along the chart's axes (`docs/math.md`, eq. 5.2 and 6.2).
pub fn add_plane_rows(moments: &PlaneMoments, chart: &Chart, nu: &Vector3<f64>, rows: &mut [Row]) {
    let unscaled = moments.scaled(1.0 / chart.scale);
    for (row, [i, j]) in rows.iter_mut().zip(PLANE_EXPONENTS) {
        let factor = chart.scale.powi((i + j + 2) as i32);
        add_turned(&plane_derivative(&unscaled, nu, i, j), factor, chart, row);
    }
}

/// Adds the derivatives of [`add_sphere_values`] by the camera's left increment.
pub fn add_sphere_rows(moments: &SphereMoments, chart: &Chart, nu: &Vector3<f64>, rows: &mut [Row]) {
    for (row, [l, m, n]) in rows.iter_mut().zip(SPHERE_EXPONENTS) {
        let factor = chart.scale.powi((l + m + 2) as i32);
        add_turned(&sphere_derivative(moments, nu, [l, m, n]), factor, chart, row);
    }
}

/// Adds a row of derivatives along the chart's axes, turned to the camera's and scaled.
fn add_turned(along_chart: &Row, factor: f64, chart: &Chart, row: &mut Row) {
    let c = chart.rotation.matrix();
    for half in [0, 3] {
        for axis in 0..3 {
            let turned: f64 = (0..3).map(|k| along_chart[half + k] * c[(k, axis)]).sum();
            row[half + axis] += factor * turned;
        }
    }
}
