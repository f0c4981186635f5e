//! Multivariate normal distributions: unnormalized factors in information form, and means with covariances.

use std::f64::consts::PI;

use nalgebra::{SMatrix, SVector};

/// A Gaussian factor of a vector `x` (mostly the left increment of a pose), not normalized: the logarithm of its value is
/// `offset + information_vector . x - x . information x / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gaussian<const D: usize = 6> {
    /// Information matrix: the inverse covariance, zero along directions that the factor leaves free.
    pub information: SMatrix<f64, D, D>,
    /// Information matrix times mean.
    pub information_vector: SVector<f64, D>,
    /// Logarithm of the value at `x = 0`.
    pub offset: f64,
}

impl<const D: usize> Default for Gaussian<D> {
    /// The constant factor 1.
    fn default() -> Self {
        Self { information: SMatrix::zeros(), information_vector: SVector::zeros(), offset: 0.0 }
    }
}

impl<const D: usize> Gaussian<D> {
    /// The normal density with independent components of these means and standard deviations.
    pub fn from_sigmas(mean: &SVector<f64, D>, sigmas: &SVector<f64, D>) -> Self {
        let precisions = sigmas.map(|sigma| sigma.powi(-2));
        let information_vector = precisions.component_mul(mean);
        let normalizer = sigmas.map(f64::ln).sum() + 0.5 * D as f64 * (2.0 * PI).ln();
        let information = SMatrix::from_diagonal(&precisions);
        Self { information, information_vector, offset: -0.5 * mean.dot(&information_vector) - normalizer }
    }

    /// The normal distribution that the factor is a multiple of, and the logarithm of its integral; `None` where a direction
    /// is left free.
    #[doc(hidden)]
    pub fn normalize(&self) -> Option<(Normal<D>, f64)> {
        let root = self.information.cholesky()?;
        let (covariance, mean) = (root.inverse(), root.solve(&self.information_vector));
        let log_root = root.l_dirty().diagonal().map(f64::ln).sum();
        let log_integral =
            self.offset + 0.5 * mean.dot(&self.information_vector) - log_root + 0.5 * D as f64 * (2.0 * PI).ln();
        log_integral.is_finite().then_some((Normal { mean, covariance }, log_integral))
    }

    /// The factor integrated over all components but the first `K`.
    #[doc(hidden)]
    pub fn marginal<const K: usize>(&self) -> Gaussian<K> {
        let mut left = *self;
        for last in (K..D).rev() {
            let (precision, vector) = (left.information[(last, last)], left.information_vector[last]);
            let column = left.information.column(last).into_owned();
            left.information.ger(-1.0 / precision, &column, &column, 1.0);
            left.information_vector -= column * (vector / precision);
            left.offset += 0.5 * ((2.0 * PI / precision).ln() + vector * vector / precision);
        }
        Gaussian {
            information: left.information.fixed_view::<K, K>(0, 0).into_owned(),
            information_vector: left.information_vector.fixed_rows::<K>(0).into_owned(),
            offset: left.offset,
        }
    }

    /// The same factor of a longer vector, constant in the components that are added at its end.
    #[doc(hidden)]
    pub fn embed<const E: usize>(&self) -> Gaussian<E> {
        let mut embedded = Gaussian::<E> { offset: self.offset, ..Gaussian::default() };
        embedded.information.fixed_view_mut::<D, D>(0, 0).copy_from(&self.information);
        embedded.information_vector.fixed_rows_mut::<D>(0).copy_from(&self.information_vector);
        embedded
    }

    /// The factor of the vector with `count` components from `first` and from `second` on swapped.
    #[doc(hidden)]
    pub fn swap_components(mut self, first: usize, second: usize, count: usize) -> Self {
        for (first, second) in (first..first + count).zip(second..) {
            self.information.swap_rows(first, second);
            self.information.swap_columns(first, second);
            self.information_vector.swap_rows(first, second);
        }
        self
    }
}

impl<const D: usize> std::ops::Add for Gaussian<D> {
    type Output = Self;

    /// The product of two factors: logarithms add.
    fn add(self, other: Self) -> Self {
        Self {
            information: self.information + other.information,
            information_vector: self.information_vector + other.information_vector,
            offset: self.offset + other.offset,
        }
    }
}

impl<const D: usize> std::ops::Sub for Gaussian<D> {
    type Output = Self;

    /// The quotient of two factors, as a cavity is.
    fn sub(self, other: Self) -> Self {
        Self {
            information: self.information - other.information,
            information_vector: self.information_vector - other.information_vector,
            offset: self.offset - other.offset,
        }
    }
}

impl<const D: usize> std::ops::Mul<f64> for Gaussian<D> {
    type Output = Self;

    /// The factor to a power.
    fn mul(self, power: f64) -> Self {
        Self {
            information: self.information * power,
            information_vector: self.information_vector * power,
            offset: self.offset * power,
        }
    }
}

/// A normal distribution by its moments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normal<const D: usize = 6> {
    /// Mean.
    pub mean: SVector<f64, D>,
    /// Covariance.
    pub covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Normal<D> {
    /// Its density, in information form; `None` where the covariance is not positive definite.
    pub fn density(&self) -> Option<Gaussian<D>> {
        let root = self.covariance.cholesky()?;
        let (information, information_vector) = (root.inverse(), root.solve(&self.mean));
        let log_root: f64 = root.l_dirty().diagonal().map(f64::ln).sum();
        let offset = -0.5 * self.mean.dot(&information_vector) - log_root - 0.5 * D as f64 * (2.0 * PI).ln();
        Some(Gaussian { information, information_vector, offset })
    }
}
