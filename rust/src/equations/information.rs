//! Covariance from an information matrix, with directions that it leaves free (`docs/math.md`, section 10).

use nalgebra::{Matrix6, Vector6};

/// Share of a parameter's information that the others leave at the least: sums over a thousand pieces are good to 1e-14 of their
/// size, a hundredth of it. Anything less is round-off.
const LEAST_SHARE: f64 = 1e-12;

/// An information matrix that holds every direction.
#[derive(Debug, Clone)]
pub struct Information {
    /// Inverse of Cholesky's factor, in parameters of information one.
    inverse_root: Matrix6<f64>,
    /// Conditional deviations of each parameter given the others.
    deviations: Vector6<f64>,
}

impl Information {
    /// `None` where a direction is left free, in double precision.
    pub fn holding(information: &Matrix6<f64>) -> Option<Self> {
        let deviations = information.diagonal().map(|entry| entry.sqrt().recip());
        if !deviations.iter().all(|deviation| deviation.is_normal()) {
            return None;
        }
        let root = scaled(information, &deviations).cholesky()?.unpack();
        let held = root.diagonal().iter().all(|entry| entry * entry > LEAST_SHARE);
        let inverse_root = root.solve_lower_triangular(&Matrix6::identity())?;
        held.then_some(Self { inverse_root, deviations })
    }

    /// The covariance: the inverse.
    pub fn covariance(&self) -> Matrix6<f64> {
        self.covariance_of(&Matrix6::identity())
    }

    /// The covariance of an estimate whose gradient scatters as `scatter` in place of the information itself: `I^-1 scatter I^-1`.
    pub fn covariance_with(&self, scatter: &Matrix6<f64>) -> Matrix6<f64> {
        self.covariance_of(&(self.inverse_root * scaled(scatter, &self.deviations) * self.inverse_root.transpose()))
    }

    /// The covariance of a matrix in the parameters of the factor; symmetric to the last digit.
    fn covariance_of(&self, inner: &Matrix6<f64>) -> Matrix6<f64> {
        let whole = self.inverse_root.transpose() * inner * self.inverse_root;
        scaled(&((whole + whole.transpose()) * 0.5), &self.deviations)
    }
}

/// A covariance as it may leave the crate: symmetric and positive, or infinite where it is not so in double precision.
pub fn validated_covariance(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    let inverse = symmetric.diagonal().map(|variance| variance.sqrt().recip());
    let is_invertible = inverse.iter().all(|entry| entry.is_normal());
    let positive = is_invertible.then(|| scaled(&symmetric, &inverse).cholesky()).flatten().is_some();
    if positive && symmetric.iter().all(|entry| entry.is_finite()) { symmetric } else { free() }
}

/// The covariance of a pose of which a direction is left free.
pub fn free() -> Matrix6<f64> {
    Matrix6::from_element(f64::INFINITY)
}

fn scaled(matrix: &Matrix6<f64>, by: &Vector6<f64>) -> Matrix6<f64> {
    // In this order a symmetric matrix stays one to the last digit.
    Matrix6::from_fn(|row, column| matrix[(row, column)] * (by[row] * by[column]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows that hold six parameters of sizes 1 and `unit`, the last but one mostly by the last.
    fn information(unit: f64, apart: f64) -> Matrix6<f64> {
        let rows = Matrix6::from_fn(|row, column| ((1 + row * 7 + column * 3) as f64).sin());
        let mut rows = rows + Matrix6::identity() * 3.0;
        let near = rows.column(5) + rows.column(4) * apart;
        rows.set_column(4, &near);
        let units = Vector6::new(1.0, 1.0, 1.0, unit, unit, unit);
        scaled(&(rows.transpose() * rows), &units)
    }

    #[test]
    fn the_inverse_is_one_in_any_unit() {
        for unit in [1e-13, 1.0, 1e6] {
            let given = information(unit, 0.3);
            let units = Vector6::new(1.0, 1.0, 1.0, unit, unit, unit);
            let covariance = Information::holding(&given).unwrap().covariance();
            let product = scaled(&given, &units.map(f64::recip)) * scaled(&covariance, &units);
            assert!((product - Matrix6::identity()).amax() < 1e-10, "{unit}: {product}");
            assert_eq!(covariance, covariance.transpose());
        }
    }

    #[test]
    fn the_scatter_of_the_information_itself_changes_nothing() {
        let given = information(1.0, 0.3);
        let held = Information::holding(&given).unwrap();
        let (plain, sandwiched) = (held.covariance(), held.covariance_with(&given));
        assert!((plain - sandwiched).amax() < 1e-10 * plain.amax());
    }

    #[test]
    fn what_is_held_by_round_off_alone_is_free() {
        assert!(Information::holding(&information(1.0, 1e-5)).is_some());
        assert!(Information::holding(&information(1.0, 1e-7)).is_none());
        assert!(Information::holding(&Matrix6::zeros()).is_none());
        assert!(Information::holding(&Matrix6::from_element(f64::NAN)).is_none());
    }

    #[test]
    fn a_covariance_with_a_negative_variance_is_none() {
        let good = Information::holding(&information(1e-9, 0.3)).unwrap().covariance();
        assert_eq!(validated_covariance(&good), good);
        let mut bad = Matrix6::identity();
        bad[(4, 4)] = -1e-9;
        assert_eq!(validated_covariance(&bad), free());
        let mut bad = Matrix6::identity();
        (bad[(0, 1)], bad[(1, 0)]) = (2.0, 2.0);
        assert_eq!(validated_covariance(&bad), free());
        assert_eq!(validated_covariance(&Matrix6::from_element(f64::NAN)), free());
    }
}
