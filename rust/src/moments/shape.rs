//! The shape of a region whatever affine map it is seen under (`docs/math.md`, section 7).

use std::sync::LazyLock;

use nalgebra::{Complex, Matrix2, Vector2};

use super::PlaneMoments;
use super::plane::planar_moments;

/// Orders of the moments that are compared once the second moments agree.
pub(crate) const SHAPE_ORDERS: std::ops::RangeInclusive<usize> = 3..=8;

/// A shape whose second moments are the identity and whose centroid is the origin, and the affine map that made it so.
#[derive(Debug, Clone)]
pub(crate) struct NormalizedShape {
    pub(crate) mean: Vector2<f64>,
    /// `normalized = transform (x - mean)`.
    pub(crate) transform: Matrix2<f64>,
    /// Complex moments of orders 3 to 8, `integral of z^p conj(z)^q` with p >= q, over those of a disc.
    pub(crate) moments: Vec<ComplexMoment>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct ComplexMoment {
    /// `p - q`: a turn by t multiplies the moment by `exp(i winding t)`.
    pub(crate) winding: usize,
    pub(crate) value: Complex<f64>,
}

impl ComplexMoment {
    /// How often the moment counts: with its conjugate, unless it is real.
    pub(crate) fn share(&self) -> f64 {
        if self.winding == 0 { 1.0 } else { 2.0 }
    }
}

impl NormalizedShape {
    /// Sum of squares of the moments.
    pub(crate) fn power(&self) -> f64 {
        self.moments.iter().map(|moment| moment.share() * moment.value.norm_sqr()).sum()
    }

    /// The shape of a region's oriented rings; `None` where its second moments are no positive matrix.
    pub(crate) fn of(rings: &[Vec<Vector2<f64>>]) -> Option<Self> {
        let first = planar_moments(rings.iter().map(Vec::as_slice), 2);
        let (area, mean) = (first.get(0, 0), centroid(&first));
        let xy = first.get(1, 1) / area - mean.x * mean.y;
        let covariance =
            Matrix2::new(first.get(2, 0) / area - mean.x * mean.x, xy, xy, first.get(0, 2) / area - mean.y * mean.y);
        let transform = inverse_square_root(&covariance)?;
        let normalized = |ring: &Vec<Vector2<f64>>| ring.iter().map(|p| transform * (p - mean)).collect::<Vec<_>>();
        let rings: Vec<_> = rings.iter().map(normalized).collect();
        let moments = planar_moments(rings.iter().map(Vec::as_slice), *SHAPE_ORDERS.end());
        Some(Self { mean, transform, moments: complex_moments(&moments) })
    }
}

/// Symmetric inverse square root of a positive 2 x 2 matrix, by Cayley and Hamilton's theorem (`docs/math.md`, eq.
/// 7.2).
fn inverse_square_root(matrix: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let root = matrix.determinant();
    if root.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return None;
    }
    let root = root.sqrt();
    let square_root = (matrix + Matrix2::identity() * root) / (matrix.trace() + 2.0 * root).sqrt();
    square_root.try_inverse()
}

/// `integral of z^p conj(z)^q` for p + q in 3..=8, p >= q, `z = x + i y`, per unit of area and of the disc's moment
/// (`docs/math.md`, eq. 7.4).
fn complex_moments(moments: &PlaneMoments) -> Vec<ComplexMoment> {
    let area = moments.get(0, 0);
    let moment = |expansion: &Expansion| {
        let order = expansion.coefficients.len() - 1;
        let terms = expansion.coefficients.iter().enumerate().map(|(j, c)| c * moments.get(order - j, j));
        ComplexMoment { winding: expansion.winding, value: terms.sum::<Complex<f64>>() / area }
    };
    EXPANSIONS.iter().map(moment).collect()
}

/// `(x + i y)^p (x - i y)^q` over the disc's moment, in monomials.
struct Expansion {
    /// `p - q`.
    winding: usize,
    /// Those of `x^(p + q - j) y^j`.
    coefficients: Vec<Complex<f64>>,
}

/// Those of all moments that are compared.
static EXPANSIONS: LazyLock<Vec<Expansion>> = LazyLock::new(|| {
    let of_order = |order: usize| (0..=order / 2).map(move |q| expansion(order - q, q));
    SHAPE_ORDERS.flat_map(of_order).collect()
});

/// Mean of `|z|^order` over the disc whose second moments are the identity (radius 2): the size of moments of that
/// order.
fn disc_moment(order: usize) -> f64 {
    2.0 * 2.0_f64.powi(order as i32) / (order + 2) as f64
}

/// The expansion of `(x + i y)^p (x - i y)^q`, by multiplying factor after factor.
fn expansion(p: usize, q: usize) -> Expansion {
    let order = p + q;
    let mut coefficients = vec![Complex::new(0.0, 0.0); order + 1];
    coefficients[0] = Complex::new(1.0 / disc_moment(order), 0.0);
    for factor in 0..order {
        let step = Complex::new(0.0, if factor < p { 1.0 } else { -1.0 });
        for power in (1..=factor + 1).rev() {
            let lower = coefficients[power - 1];
            coefficients[power] += step * lower;
        }
    }
    Expansion { winding: p - q, coefficients }
}

/// Mean of a region's points, of its moments.
pub(crate) fn centroid(moments: &PlaneMoments) -> Vector2<f64> {
    Vector2::new(moments.get(1, 0), moments.get(0, 1)) / moments.get(0, 0)
}
