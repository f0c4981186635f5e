//! What is believed of a left increment, and of what contours are off: normal distributions and factors of such
//! (`docs/math.md`, section 17).

use std::f64::consts::PI;

use nalgebra::{SMatrix, SVector, Vector6};

use crate::geometry::pose::Tangent;
use crate::prior::Gaussian;

/// Components of an increment.
pub const INCREMENT: usize = 6;

/// The same and by how many pixels a region's contour lies outside of its samples all around, its growth.
pub const WHOLE: usize = INCREMENT + 1;

impl Gaussian {
    /// The normal density about `mean` with independent components of these deviations.
    pub fn normal(mean: &Tangent, deviations: &Vector6<f64>) -> Self {
        let information = deviations.map(|deviation| deviation.powi(-2));
        let vector = information.component_mul(mean);
        let normalizer = deviations.map(f64::ln).sum() + 3.0 * (2.0 * PI).ln();
        let information = SMatrix::from_diagonal(&information);
        Self { information, vector, offset: -0.5 * mean.dot(&vector) - normalizer }
    }
}

impl<const D: usize> Gaussian<D> {
    /// The distribution that it is a multiple of, and the logarithm of its integral; `None` where a direction is left
    /// free.
    pub fn belief(&self) -> Option<(Belief<D>, f64)> {
        let root = self.information.cholesky()?;
        let (covariance, mean) = (root.inverse(), root.solve(&self.vector));
        let determinant = root.l_dirty().diagonal().map(f64::ln).sum();
        let integral = self.offset + 0.5 * mean.dot(&self.vector) - determinant + 0.5 * D as f64 * (2.0 * PI).ln();
        integral.is_finite().then_some((Belief { mean, covariance }, integral))
    }

    /// Its integral over all components but the first `K`.
    pub fn marginal<const K: usize>(&self) -> Gaussian<K> {
        let mut left = *self;
        for last in (K..D).rev() {
            let (precision, pull) = (left.information[(last, last)], left.vector[last]);
            let across = left.information.column(last).into_owned();
            left.information.ger(-1.0 / precision, &across, &across, 1.0);
            left.vector -= across * (pull / precision);
            left.offset += 0.5 * ((2.0 * PI / precision).ln() + pull * pull / precision);
        }
        let information = left.information.fixed_view::<K, K>(0, 0).into_owned();
        Gaussian { information, vector: left.vector.fixed_rows::<K>(0).into_owned(), offset: left.offset }
    }

    /// The same among more components, of which it says nothing.
    pub fn among<const E: usize>(&self) -> Gaussian<E> {
        let mut more = Gaussian::<E> { offset: self.offset, ..Gaussian::default() };
        more.information.fixed_view_mut::<D, D>(0, 0).copy_from(&self.information);
        more.vector.fixed_rows_mut::<D>(0).copy_from(&self.vector);
        more
    }
}

impl<const D: usize> std::ops::Add for Gaussian<D> {
    type Output = Self;

    /// The product of both factors.
    fn add(self, other: Self) -> Self {
        Self {
            information: self.information + other.information,
            vector: self.vector + other.vector,
            offset: self.offset + other.offset,
        }
    }
}

impl<const D: usize> std::ops::Sub for Gaussian<D> {
    type Output = Self;

    /// The factor without another that it holds.
    fn sub(self, other: Self) -> Self {
        Self {
            information: self.information - other.information,
            vector: self.vector - other.vector,
            offset: self.offset - other.offset,
        }
    }
}

impl<const D: usize> std::ops::Mul<f64> for Gaussian<D> {
    type Output = Self;

    /// The factor to a power.
    fn mul(self, power: f64) -> Self {
        Self { information: self.information * power, vector: self.vector * power, offset: self.offset * power }
    }
}

/// A normal distribution, of a left increment or of that and of what a contour is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief<const D: usize = INCREMENT> {
    /// Its mean.
    pub mean: SVector<f64, D>,
    /// Its covariance.
    pub covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Belief<D> {
    /// The distribution of the first `K` components.
    pub fn of_first<const K: usize>(&self) -> Belief<K> {
        let covariance = self.covariance.fixed_view::<K, K>(0, 0).into_owned();
        Belief { mean: self.mean.fixed_rows::<K>(0).into_owned(), covariance }
    }
}
