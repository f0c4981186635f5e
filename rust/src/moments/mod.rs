//! Integrals of monomials over regions of the plane and of the unit sphere.
//!
//! Moments know no pose and no camera. [`plane`] and [`sphere`] hold the boundary form, exact sums over edges;
//! [`mesh`] holds the form over triangles; [`pixels`] the sum over the pixels of a mask.

use std::ops::AddAssign;

pub mod mesh;
pub mod pixels;
pub mod plane;
pub(crate) mod quadrature;
pub(crate) mod shape;
pub mod sphere;

use nalgebra::Vector3;

/// Highest moment order supported.
pub const MAX_ORDER: usize = 8;

/// Number of planar monomials of order up to `order`.
pub const fn plane_count(order: usize) -> usize {
    (order + 1) * (order + 2) / 2
}

/// Number of spatial monomials of order up to `order`.
pub const fn sphere_count(order: usize) -> usize {
    (order + 1) * (order + 2) * (order + 3) / 6
}

/// Position of `x^i y^j` in the list of planar monomials: by order, then by the power of y.
pub const fn plane_index(i: usize, j: usize) -> usize {
    let k = i + j;
    k * (k + 1) / 2 + j
}

/// Position of `x^l y^m z^n` in the list of spatial monomials: by order, then by `m + n`, then by `n`.
pub const fn sphere_index(l: usize, m: usize, n: usize) -> usize {
    let (k, p) = (l + m + n, m + n);
    k * (k + 1) * (k + 2) / 6 + p * (p + 1) / 2 + n
}

/// Moments `integral of x^i y^j dA` of a planar region for `i + j <= order`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMoments {
    order: usize,
    values: [f64; plane_count(MAX_ORDER)],
}

impl PlaneMoments {
    /// All moments zero; `order` at most [`MAX_ORDER`].
    pub fn zero(order: usize) -> Self {
        assert!(order <= MAX_ORDER, "moment order {order} above {MAX_ORDER}");
        Self { order, values: [0.0; plane_count(MAX_ORDER)] }
    }

    /// Highest `i + j` held.
    pub fn order(&self) -> usize {
        self.order
    }

    /// The moment of `x^i y^j`.
    pub fn get(&self, i: usize, j: usize) -> f64 {
        debug_assert!(i + j <= self.order);
        self.values[plane_index(i, j)]
    }

    /// The moments in the order of [`plane_index`].
    pub fn values(&self) -> &[f64] {
        &self.values[..plane_count(self.order)]
    }

    /// The moments in the order of [`plane_index`], to be filled.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..plane_count(self.order)]
    }

    /// The moments of the region with all coordinates multiplied by `scale`.
    pub fn scaled(&self, scale: f64) -> Self {
        let mut scaled = *self;
        let mut factor = scale * scale;
        for k in 0..=self.order {
            scaled.values[plane_count(k) - (k + 1)..plane_count(k)].iter_mut().for_each(|value| *value *= factor);
            factor *= scale;
        }
        scaled
    }
}

impl AddAssign<&PlaneMoments> for PlaneMoments {
    /// Adds the moments of a region that lies beside this one; the order is that of the left side, at most the right's.
    fn add_assign(&mut self, other: &PlaneMoments) {
        for (value, term) in self.values_mut().iter_mut().zip(&other.values) {
            *value += term;
        }
    }
}

/// Moments `integral of x^l y^m z^n dS` of a region of the unit sphere for `l + m + n <= order`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereMoments {
    order: usize,
    values: [f64; sphere_count(MAX_ORDER)],
}

impl SphereMoments {
    /// All moments zero; `order` at most [`MAX_ORDER`].
    pub fn zero(order: usize) -> Self {
        assert!(order <= MAX_ORDER, "moment order {order} above {MAX_ORDER}");
        Self { order, values: [0.0; sphere_count(MAX_ORDER)] }
    }

    /// Highest `l + m + n` held.
    pub fn order(&self) -> usize {
        self.order
    }

    /// The moment of `x^l y^m z^n`.
    pub fn get(&self, l: usize, m: usize, n: usize) -> f64 {
        debug_assert!(l + m + n <= self.order);
        self.values[sphere_index(l, m, n)]
    }

    /// The moments in the order of [`sphere_index`].
    pub fn values(&self) -> &[f64] {
        &self.values[..sphere_count(self.order)]
    }

    /// The moments in the order of [`sphere_index`], to be filled.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..sphere_count(self.order)]
    }

    /// Adds `weight x^l y^m z^n` of a point to every moment.
    ///
    /// A degree's list is the one before times x, then that one's last row times y, then its last entry times z.
    pub(crate) fn add_point(&mut self, point: &Vector3<f64>, weight: f64) {
        let mut terms = [0.0; plane_count(MAX_ORDER)];
        terms[0] = weight;
        self.values[0] += weight;
        for k in 1..=self.order {
            let count = plane_count(k - 1);
            for i in count - k..count {
                terms[i + k] = terms[i] * point.y;
            }
            terms[count + k] = terms[count - 1] * point.z;
            for term in &mut terms[..count] {
                *term *= point.x;
            }
            for (value, term) in self.values[sphere_count(k - 1)..sphere_count(k)].iter_mut().zip(&terms) {
                *value += term;
            }
        }
    }

    /// Adds the moments of another region, of the same order.
    pub(crate) fn add(&mut self, other: &Self) {
        for (value, more) in self.values.iter_mut().zip(&other.values) {
            *value += more;
        }
    }
}
