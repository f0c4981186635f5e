//! What is believed of a left increment: normal distributions and factors of such (`docs/math.md`, section 17).

use nalgebra::{Matrix6, Vector6};

use crate::geometry::pose::Tangent;
use crate::prior::Gaussian;

impl Gaussian {
    /// The normal density about `mean` with independent components of these deviations.
    pub fn normal(mean: &Tangent, deviations: &Vector6<f64>) -> Self {
        let information = deviations.map(|deviation| deviation.powi(-2));
        let vector = information.component_mul(mean);
        let normalizer = deviations.map(f64::ln).sum() + 3.0 * (2.0 * std::f64::consts::PI).ln();
        let information = Matrix6::from_diagonal(&information);
        Self { information, vector, offset: -0.5 * mean.dot(&vector) - normalizer }
    }

    /// The distribution that it is a multiple of, and the logarithm of its integral; `None` where a direction is left free.
    pub fn belief(&self) -> Option<(Belief, f64)> {
        let root = self.information.cholesky()?;
        let (covariance, mean) = (root.inverse(), root.solve(&self.vector));
        let determinant = root.l_dirty().diagonal().map(f64::ln).sum();
        let integral =
            self.offset + 0.5 * mean.dot(&self.vector) - determinant + 3.0 * (2.0 * std::f64::consts::PI).ln();
        integral.is_finite().then_some((Belief { mean, covariance }, integral))
    }
}

impl std::ops::Add for Gaussian {
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

/// A normal distribution of a left increment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// Its mean.
    pub mean: Tangent,
    /// Its covariance.
    pub covariance: Matrix6<f64>,
}
