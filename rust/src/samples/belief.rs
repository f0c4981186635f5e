//! What is believed of a left increment: normal distributions and factors of such (`docs/math.md`, section 17).

use std::f64::consts::PI;

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use crate::geometry::pose::Tangent;
use crate::prior::Gaussian;

impl Gaussian {
    /// The normal density about `mean` with independent components of these deviations.
    pub fn normal(mean: &Tangent, deviations: &Vector6<f64>) -> Self {
        let information = deviations.map(|deviation| deviation.powi(-2));
        let vector = information.component_mul(mean);
        let normalizer = deviations.map(f64::ln).sum() + 3.0 * (2.0 * PI).ln();
        let information = Matrix6::from_diagonal(&information);
        Self { information, vector, offset: -0.5 * mean.dot(&vector) - normalizer }
    }

    /// The distribution that it is a multiple of, and the logarithm of its integral; `None` where a direction is left free.
    pub fn belief(&self) -> Option<(Belief, f64)> {
        let root = self.information.cholesky()?;
        let (covariance, mean) = (root.inverse(), root.solve(&self.vector));
        let determinant = root.l_dirty().diagonal().map(f64::ln).sum();
        let integral = self.offset + 0.5 * mean.dot(&self.vector) - determinant + 3.0 * (2.0 * PI).ln();
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

impl std::ops::Sub for Gaussian {
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

impl std::ops::Mul<f64> for Gaussian {
    type Output = Self;

    /// The factor to a power.
    fn mul(self, power: f64) -> Self {
        Self { information: self.information * power, vector: self.vector * power, offset: self.offset * power }
    }
}

/// A normal distribution, of a left increment or of that and how far a stretch of a contour is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief<const D: usize = 6> {
    /// Its mean.
    pub mean: SVector<f64, D>,
    /// Its covariance.
    pub covariance: SMatrix<f64, D, D>,
}

/// Components of an increment and the offset of a stretch together.
pub const JOINT: usize = 7;

/// The last of them, pixels outwards.
pub const OFFSET: usize = 6;

impl Belief {
    /// The same with a stretch that is where it is seen.
    pub fn beside_clean(&self) -> Belief<JOINT> {
        let mut joint = Belief::<JOINT> { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        joint.mean.fixed_rows_mut::<OFFSET>(0).copy_from(&self.mean);
        joint.covariance.fixed_view_mut::<OFFSET, OFFSET>(0, 0).copy_from(&self.covariance);
        joint
    }
}

impl Belief<JOINT> {
    /// The distribution of the increment alone.
    pub fn of_increment(&self) -> Belief {
        let covariance = self.covariance.fixed_view::<OFFSET, OFFSET>(0, 0).into_owned();
        Belief { mean: self.mean.fixed_rows::<OFFSET>(0).into_owned(), covariance }
    }
}

/// A Gaussian factor of an increment and the offset of a stretch, as [`Gaussian`] is of the increment alone.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointGaussian {
    /// Inverse covariance.
    pub information: SMatrix<f64, JOINT, JOINT>,
    /// Information times mean.
    pub vector: SVector<f64, JOINT>,
    /// Logarithm of its value at zero.
    pub offset: f64,
}

impl JointGaussian {
    /// Its integral over the offset, a factor of the increment.
    pub fn marginal(&self) -> Gaussian {
        let (precision, pull) = (self.information[(OFFSET, OFFSET)], self.vector[OFFSET]);
        let across = self.information.fixed_view::<OFFSET, 1>(0, OFFSET);
        Gaussian {
            information: self.information.fixed_view::<OFFSET, OFFSET>(0, 0) - across * across.transpose() / precision,
            vector: self.vector.fixed_rows::<OFFSET>(0) - across * (pull / precision),
            offset: self.offset + 0.5 * ((2.0 * PI / precision).ln() + pull * pull / precision),
        }
    }

    /// The distribution of its product with a factor of the increment, and the logarithm of the product's integral; `None` where
    /// a direction is left free.
    pub fn belief_with(&self, others: &Gaussian) -> Option<(Belief<JOINT>, f64)> {
        let (mut information, mut vector) = (self.information, self.vector);
        let mut block = information.fixed_view_mut::<OFFSET, OFFSET>(0, 0);
        block += others.information;
        let mut rows = vector.fixed_rows_mut::<OFFSET>(0);
        rows += others.vector;
        let root = information.cholesky()?;
        let (mean, covariance) = (root.solve(&vector), root.inverse());
        let determinant = root.l_dirty().diagonal().map(f64::ln).sum();
        let integral = self.offset + others.offset + 0.5 * mean.dot(&vector) - determinant + 3.5 * (2.0 * PI).ln();
        integral.is_finite().then_some((Belief { mean, covariance }, integral))
    }
}
