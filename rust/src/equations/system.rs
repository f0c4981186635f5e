//! The chosen functions of each system: which moments are compared, and at what scale.

use crate::equations::derivatives::{PLANE_REACH, Row, SPHERE_REACH, plane_derivative, sphere_derivative};
use crate::moments::plane::edge_fluxes;
use crate::moments::quadrature::{Node, gauss_legendre};
use crate::moments::{PlaneMoments, SphereMoments};
use nalgebra::{Vector2, Vector3};

/// Which integrals are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// Moments on the normalized plane of each region's chart (paper eq. 14, 15).
    Plane,
    /// Moments on the unit sphere (paper eq. 5 to 8).
    Sphere,
}

/// Which of a system's equations are compared, and on what scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// The paper's equations in charts of unit observed area: a wide basin.
    Uniform,
    /// In standard deviations of one pixel's boundary noise, close to maximum likelihood near the solution; on the plane
    /// all moments up to order 6, which distinguish the turns of shapes with up to sixfold symmetry.
    Whitened,
}

/// Exponents (i, j) of the plane system by order: the paper's 13 first (`i, j <= 3`, `i + j <= 4`, section 2.2), then the
/// others up to order 6.
pub const PLANE_EXPONENTS: [[usize; 2]; 28] = [
    [0, 0],
    [1, 0],
    [0, 1],
    [2, 0],
    [1, 1],
    [0, 2],
    [3, 0],
    [2, 1],
    [1, 2],
    [0, 3],
    [3, 1],
    [2, 2],
    [1, 3],
    [4, 0],
    [0, 4],
    [5, 0],
    [4, 1],
    [3, 2],
    [2, 3],
    [1, 4],
    [0, 5],
    [6, 0],
    [5, 1],
    [4, 2],
    [3, 3],
    [2, 4],
    [1, 5],
    [0, 6],
];

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

/// The paper's share of [`PLANE_EXPONENTS`].
const PAPER_PLANE_COUNT: usize = 13;

/// The share of [`PLANE_EXPONENTS`] up to order 4.
const PLANE_ORDER_4_COUNT: usize = 15;

/// Most equations of one region in any system.
pub const MOST_EQUATIONS: usize = PLANE_EXPONENTS.len();

impl System {
    /// Number of equations of one region.
    pub fn count(self, weighting: Weighting) -> usize {
        match (self, weighting) {
            (Self::Plane, Weighting::Uniform) => PAPER_PLANE_COUNT,
            (Self::Plane, Weighting::Whitened) => PLANE_EXPONENTS.len(),
            (Self::Sphere, _) => SPHERE_EXPONENTS.len(),
        }
    }

    /// Number of the leading functions of low order: on the plane those up to order 4.
    pub fn low_count(self) -> usize {
        match self {
            Self::Plane => PLANE_ORDER_4_COUNT,
            Self::Sphere => SPHERE_EXPONENTS.len(),
        }
    }

    /// Order of the moments that are compared.
    pub fn order(self, weighting: Weighting) -> usize {
        match (self, weighting) {
            (Self::Plane, Weighting::Uniform) => 4,
            (Self::Plane, Weighting::Whitened) => HIGHEST_ORDER,
            (Self::Sphere, _) => 3,
        }
    }

    /// How many orders above a moment its derivative reaches.
    pub fn reach(self) -> usize {
        match self {
            Self::Plane => PLANE_REACH,
            Self::Sphere => SPHERE_REACH,
        }
    }
}

/// Highest order of the moments that any system compares.
pub const HIGHEST_ORDER: usize = 6;

/// `scale^(k + 2)` of each order k (`docs/math.md`, eq. 6.2).
fn order_scales(scale: f64) -> [f64; HIGHEST_ORDER + 1] {
    let mut power = scale;
    [(); HIGHEST_ORDER + 1].map(|()| {
        power *= scale;
        power
    })
}

/// Adds to each row's first entry the plane system's value of moments that were taken at scale 1.
pub fn add_plane_values<const N: usize>(moments: &PlaneMoments, scale: f64, rows: &mut [[f64; N]]) {
    let scales = order_scales(scale);
    for (row, [i, j]) in rows.iter_mut().zip(PLANE_EXPONENTS) {
        row[0] += scales[i + j] * moments.get(i, j);
    }
}

/// Adds to each row's first entry the sphere system's value of moments along the chart's axes, x and y and the area taken at
/// the chart's scale.
pub fn add_sphere_values<const N: usize>(moments: &SphereMoments, scale: f64, rows: &mut [[f64; N]]) {
    let scales = order_scales(scale);
    for (row, [l, m, n]) in rows.iter_mut().zip(SPHERE_EXPONENTS) {
        row[0] += scales[l + m] * moments.get(l, m, n);
    }
}

/// Adds to each row's further entries the derivatives of [`add_plane_values`] by a left increment along the chart's axes.
///
/// `nu` is the plane `nu . P = 1` along the chart's axes (`docs/math.md`, eq. 5.2 and 6.2).
pub fn add_plane_derivatives<const N: usize>(
    moments: &PlaneMoments,
    scale: f64,
    nu: &Vector3<f64>,
    rows: &mut [[f64; N]],
) {
    let scales = order_scales(scale);
    for (row, [i, j]) in rows.iter_mut().zip(PLANE_EXPONENTS) {
        let derivative = plane_derivative(moments, nu, i, j);
        row[1..].iter_mut().zip(derivative).for_each(|(sum, entry)| *sum += scales[i + j] * entry);
    }
}

/// Adds to each row's further entries the derivatives of [`add_sphere_values`] by a left increment along the chart's axes
/// (`docs/math.md`, eq. 5.4 and 6.2).
pub fn add_sphere_derivatives<const N: usize>(
    moments: &SphereMoments,
    scale: f64,
    nu: &Vector3<f64>,
    rows: &mut [[f64; N]],
) {
    let scales = order_scales(scale);
    for (row, [l, m, n]) in rows.iter_mut().zip(SPHERE_EXPONENTS) {
        let derivative = sphere_derivative(moments, nu, [l, m, n]);
        row[1..].iter_mut().zip(derivative).for_each(|(sum, entry)| *sum += scales[l + m] * entry);
    }
}

/// Nodes of an edge's flux on the sphere: good to 1e-9 over 60 degrees.
pub const FLUX_NODES: usize = 12;
const FLUX: [Node; FLUX_NODES] = gauss_legendre();

/// Highest order of the sphere's functions, times a component of the point.
const SPHERE_FLUX_ORDER: usize = 4;

/// Takes off the derivatives, in each row's further entries, of a region that flows what of it flows out through edges that
/// stand still, given at scale 1 with the region on their left (`docs/math.md`, eq. 14.2).
pub fn subtract_flux<const N: usize>(
    system: System,
    still: &[[Vector2<f64>; 2]],
    scale: f64,
    nu: &Vector3<f64>,
    rows: &mut [[f64; N]],
) {
    let scales = order_scales(scale);
    match system {
        System::Plane => {
            let sums = edge_fluxes(still);
            for (row, [i, j]) in rows.iter_mut().zip(PLANE_EXPONENTS) {
                let flux =
                    flux([[i + 1, j], [i, j + 1], [i, j]].map(|[i, j]| sums.each_ref().map(|sum| sum.get(i, j))), nu);
                row[1..].iter_mut().zip(flux).for_each(|(entry, flux)| *entry -= scales[i + j] * flux);
            }
        }
        System::Sphere => {
            let sums = arc_fluxes(still);
            for (row, [l, m, n]) in rows.iter_mut().zip(SPHERE_EXPONENTS) {
                let raised = [[l + 1, m, n], [l, m + 1, n], [l, m, n + 1]];
                let flux = flux(raised.map(|[l, m, n]| sums.each_ref().map(|sum| sum.get(l, m, n))), nu);
                row[1..].iter_mut().zip(flux).for_each(|(entry, flux)| *entry -= scales[l + m] * flux);
            }
        }
    }
}

/// The flux of a function by a left increment, of its integrals times each component of the point (row) and of the edges'
/// outward normal (column).
fn flux([x, y, z]: [[f64; 3]; 3], nu: &Vector3<f64>) -> Row {
    let [x, y, z] = [x, y, z].map(Vector3::from);
    let moving = x * nu.x + y * nu.y + z * nu.z;
    [y.z - z.y, z.x - x.z, x.y - y.x, moving.x, moving.y, moving.z]
}

/// Integrals over the sphere's arcs of monomials times each component of the normal, summed over edges at scale 1.
fn arc_fluxes(still: &[[Vector2<f64>; 2]]) -> [SphereMoments; 3] {
    let mut sums = [SphereMoments::zero(SPHERE_FLUX_ORDER); 3];
    for ends in still {
        let [a, b] = ends.map(|p| p.push(1.0));
        let mut along = SphereMoments::zero(SPHERE_FLUX_ORDER);
        for (share, weight) in FLUX {
            let point = a.lerp(&b, share);
            along.add_point(&point.normalize(), weight / point.norm_squared());
        }
        let outward = -a.cross(&b);
        for (sum, factor) in sums.iter_mut().zip(outward.iter()) {
            sum.values_mut().iter_mut().zip(along.values()).for_each(|(sum, value)| *sum += factor * value);
        }
    }
    sums
}
