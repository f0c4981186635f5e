//! Gaussian priors on a pose, and the Mahalanobis distance of a pose from them (`docs/math.md`, section 10).

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use crate::error::{Error, Result};
use crate::geometry::pose::{Pose, check_pose};
use crate::math::gaussian::Gaussian;
use crate::math::odds::DECISIVE_DEVIANCE;

/// Standard deviation of the up direction where none is given, rad (15 degrees): a camera held by hand, its pitch unknown.
pub const UP_SIGMA: f64 = std::f64::consts::PI / 12.0;

/// Standard deviation of the camera's place along each axis where none is given, meters: a convention, that of a camera
/// on the same vehicle, mast or tripod as a scanner.
pub const NEAR_SIGMA: f64 = 2.0;

/// Squared distance, in variances, that counts at most against a pose (ten standard deviations): a prior may itself be
/// wrong, and what fits better by more stands in spite of it.
pub const MAX_PENALTY: f64 = 4.0 * DECISIVE_DEVIANCE;

/// Rotation, rad, beyond which a pose contradicts an initial one without an uncertainty: no rough pose is this rough.
const FAR: f64 = std::f64::consts::FRAC_PI_4;

/// Uncertainty of an initial pose, standard deviations along each of the camera's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PoseSigma {
    /// Of the camera's rotation, rad.
    pub rotation: f64,
    /// Of the camera's place, meters.
    pub place: f64,
}

/// A Gaussian prior on the pose: it adds starts, and resolves ambiguities between poses that fit about alike.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Options, Pose, PoseSigma, Prior, Problem, WorldRegion};
/// // A poster has the same view from four poses.
/// let poster = [(0.0, 0.0), (1.6, 0.0), (1.6, 1.0), (0.0, 1.0)].map(|(x, y)| Vector3::new(x, y, 0.3 * y)).to_vec();
/// let seen = poster.iter().map(|x| x + Vector3::new(-0.5, 0.2, 4.0)).collect();
/// let problem = Problem::new(&[ObservedRegion::new(vec![seen], 90_000.0)], &[WorldRegion::from_rings(&[poster])?])?;
/// assert_eq!(problem.estimate()?.alternatives.len(), 3);
///
/// // A rough pose with its standard deviations, 6 degrees and 20 cm, leaves one of them.
/// let initial = Pose::new(Pose::identity().rotation, Vector3::new(-0.4, 0.1, 4.1));
/// let sigma = PoseSigma { rotation: 0.1, place: 0.2 };
/// let prior = Prior::default().with_initial(initial, Some(sigma))?;
/// let estimate = problem.estimate_with(&Options::default().with_prior(prior))?;
/// assert!(estimate.alternatives.is_empty() && estimate.best.pose.angle_to(&initial) < 1e-6);
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(into = "serialized::Terms", try_from = "serialized::Terms"))]
#[must_use]
pub struct Prior {
    /// A rough pose, `camera_from_world`.
    pub(crate) initial: Option<Pose>,
    pub(crate) initial_sigma: Option<PoseSigma>,
    /// The direction, in the world, that is up in the image.
    pub(crate) up: Option<Vector3<f64>>,
    /// Standard deviation of its angle from the image's up, rad; [`UP_SIGMA`] where there is none.
    pub(crate) up_sigma: Option<f64>,
    /// A place of the world that the camera stands near.
    pub(crate) near: Option<Vector3<f64>>,
    /// Standard deviation of the camera's place about it along each axis, meters; [`NEAR_SIGMA`] where there is none.
    pub(crate) near_sigma: Option<f64>,
}

/// Deviation of a pose from the initial one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialDeviation {
    /// Rotation, rad.
    pub rotation: f64,
    /// Distance between the two places of the camera, meters.
    pub place: f64,
    /// Both in standard deviations of prior and pose together; `None` where the prior has none.
    pub sigmas: Option<f64>,
}

impl InitialDeviation {
    /// Whether the pose contradicts the initial one.
    pub fn is_contradiction(&self) -> bool {
        self.sigmas.map_or(self.rotation > FAR, |sigmas| sigmas * sigmas > DECISIVE_DEVIANCE)
    }
}

/// Deviation of the up direction from the image's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpDeviation {
    /// Angle, rad.
    pub angle: f64,
    /// The same in standard deviations of prior and pose together.
    pub sigmas: f64,
}

impl UpDeviation {
    /// Whether the pose contradicts the up direction.
    pub fn is_contradiction(&self) -> bool {
        self.sigmas * self.sigmas > DECISIVE_DEVIANCE
    }
}

/// Deviation of the camera from the prior's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceDeviation {
    /// Distance, meters.
    pub place: f64,
    /// The same in standard deviations of prior and pose together.
    pub sigmas: f64,
}

impl PlaceDeviation {
    /// Whether the pose contradicts the camera's place.
    pub fn is_contradiction(&self) -> bool {
        self.sigmas * self.sigmas > DECISIVE_DEVIANCE
    }
}

impl Prior {
    /// The same with a rough pose, `camera_from_world`, and its uncertainty: without one the pose is a start, and chooses among poses
    /// that fit alike.
    ///
    /// # Errors
    /// A pose that is not finite or whose rotation is none, and a deviation that is not a positive number.
    pub fn with_initial(self, pose: Pose, sigma: Option<PoseSigma>) -> Result<Self> {
        check_pose(pose.rotation.matrix(), &pose.translation)?;
        check_sigma("initial_sigma.rotation", sigma.map(|sigma| sigma.rotation))?;
        check_sigma("initial_sigma.place", sigma.map(|sigma| sigma.place))?;
        Ok(Self { initial: Some(pose), initial_sigma: sigma, ..self })
    }

    /// The same with the direction, in the world, that is up in the image, and the standard deviation of its angle, rad;
    /// [`UP_SIGMA`] where there is none.
    ///
    /// # Errors
    /// A direction that is not finite or has no length, and a deviation that is not a positive number.
    pub fn with_up(self, up: Vector3<f64>, sigma: Option<f64>) -> Result<Self> {
        check_finite("up entry", &up)?;
        let length = up.norm();
        if !is_positive(length) {
            let found = if length == 0.0 { "a zero vector".into() } else { format!("a vector of length {length}") };
            return Err(Error::InvalidPrior { item: "up", found, needed: "a direction".into() });
        }
        check_sigma("up_sigma", sigma)?;
        Ok(Self { up: Some(up), up_sigma: sigma, ..self })
    }

    /// The same with a place of the world that the camera stands near, and the standard deviation of the camera's place about it
    /// along each axis, meters; [`NEAR_SIGMA`] where there is none.
    ///
    /// # Errors
    /// A place that is not finite, and a deviation that is not a positive number.
    pub fn with_near(self, place: Vector3<f64>, sigma: Option<f64>) -> Result<Self> {
        check_finite("near entry", &place)?;
        check_sigma("near_sigma", sigma)?;
        Ok(Self { near: Some(place), near_sigma: sigma, ..self })
    }

    /// The rough pose, `camera_from_world`, and its uncertainty where that is given.
    pub fn initial(&self) -> Option<(Pose, Option<PoseSigma>)> {
        self.initial.map(|pose| (pose, self.initial_sigma))
    }

    /// The direction, in the world, that is up in the image, and the standard deviation of its angle, rad.
    pub fn up(&self) -> Option<(Vector3<f64>, f64)> {
        self.up.map(|up| (up, self.up_sigma.unwrap_or(UP_SIGMA)))
    }

    /// The initial pose and its standard deviations, where both are given.
    fn rough(&self) -> Option<(Pose, PoseSigma)> {
        self.initial.zip(self.initial_sigma)
    }

    /// The place that the camera stands near, and its standard deviation.
    pub fn place(&self) -> Option<(Vector3<f64>, f64)> {
        self.near.map(|near| (near, self.near_sigma.unwrap_or(NEAR_SIGMA)))
    }

    /// Its largest penalty, in variances.
    #[doc(hidden)]
    pub fn max_penalty(&self) -> f64 {
        let terms = [self.up.is_some(), self.rough().is_some(), self.near.is_some()];
        terms.into_iter().filter(|given| *given).count() as f64 * MAX_PENALTY
    }

    /// Penalty of a pose with this covariance of its left increment, in variances (`docs/math.md`, eq. 10.5).
    #[doc(hidden)]
    pub fn penalty(&self, pose: &Pose, covariance: &Matrix6<f64>) -> f64 {
        let initial = self.initial_deviation(pose, covariance).and_then(|from| from.sigmas);
        let up = self.up_deviation(pose, covariance).map(|from| from.sigmas);
        let near = self.place_deviation(pose, covariance).map(|from| from.sigmas);
        [initial, up, near].into_iter().flatten().map(|sigmas| (sigmas * sigmas).min(MAX_PENALTY)).sum()
    }

    /// All its terms as one Gaussian factor of the left increment of a pose (`docs/math.md`, eq. 10.7).
    ///
    /// The vector is the exact gradient of the log density at the pose, the information its curvature where pose and
    /// prior agree: from anywhere, the mean of each term alone is one Newton step away, so none drifts from one
    /// linearization to the next.
    pub fn gaussian(&self, pose: &Pose) -> Gaussian {
        let mut factor = Gaussian::default();
        if let Some((initial, sigma)) = self.rough() {
            let turn = pose.local_coordinates(&initial).fixed_rows::<3>(0).into_owned();
            add_block(&mut factor, 0, &Matrix3::identity(), &turn, sigma.rotation);
            add_place(&mut factor, pose, &initial.inverse().translation, sigma.place);
        }
        if let Some((turn, up_in_camera)) = self.turn_to_up(pose) {
            let across = Matrix3::identity() - up_in_camera * up_in_camera.transpose();
            add_block(&mut factor, 0, &across, &turn, self.up_sigma.unwrap_or(UP_SIGMA));
        }
        if let Some((near, sigma)) = self.place() {
            add_place(&mut factor, pose, &near, sigma);
        }
        factor
    }

    /// Deviation of a pose from the initial one; `None` without one.
    pub fn initial_deviation(&self, pose: &Pose, covariance: &Matrix6<f64>) -> Option<InitialDeviation> {
        // Its translation is as long as the camera's way.
        let increment = pose.local_coordinates(self.initial.as_ref()?);
        let (turn, shift) = (increment.fixed_rows::<3>(0).norm(), increment.fixed_rows::<3>(3).norm());
        let sigmas = self.initial_sigma.map(|sigma| {
            let [r, t] = [sigma.rotation, sigma.place].map(|deviation| deviation * deviation);
            mahalanobis(&increment, &(Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t)) + covariance))
        });
        Some(InitialDeviation { rotation: turn, place: shift, sigmas })
    }

    /// The rotation vector of the least turn that brings up to the image's up, and where up is seen, a unit vector.
    fn turn_to_up(&self, pose: &Pose) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let up_in_camera = pose.rotation * self.up?.try_normalize(0.0)?;
        let axis = -up_in_camera.cross(&Vector3::y());
        // Opposite to up every axis square to it will do.
        let axis = axis.try_normalize(0.0).unwrap_or_else(Vector3::x);
        Some((axis * up_in_camera.angle(&-Vector3::y()), up_in_camera))
    }

    /// Deviation of the up direction from the image's; `None` without one.
    pub fn up_deviation(&self, pose: &Pose, covariance: &Matrix6<f64>) -> Option<UpDeviation> {
        let (turn, _) = self.turn_to_up(pose)?;
        let (angle, deviation) = (turn.norm(), self.up_sigma.unwrap_or(UP_SIGMA));
        // The pose's own uncertainty of the angle: about the axis that turns one direction into the other.
        let axis = turn.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let rotation = covariance.fixed_view::<3, 3>(0, 0);
        let variance = deviation * deviation + axis.dot(&(rotation * axis));
        Some(UpDeviation { angle, sigmas: if variance.is_finite() { angle / variance.sqrt() } else { 0.0 } })
    }

    /// Deviation of the camera from the prior's place; `None` without one.
    pub fn place_deviation(&self, pose: &Pose, covariance: &Matrix6<f64>) -> Option<PlaceDeviation> {
        let (near, sigma) = self.place()?;
        let offset = pose.transform(&near);
        let sum = covariance.fixed_view::<3, 3>(3, 3) + Matrix3::identity() * (sigma * sigma);
        Some(PlaceDeviation { place: offset.norm(), sigmas: mahalanobis(&offset, &sum) })
    }
}

/// Adds to a factor of the left increment a normal term of the three components from `first` on, about `mean`, along the directions
/// that the projection `along` keeps.
fn add_block(factor: &mut Gaussian, first: usize, along: &Matrix3<f64>, mean: &Vector3<f64>, sigma: f64) {
    let weight = (sigma * sigma).recip();
    let mut block = factor.information.fixed_view_mut::<3, 3>(first, first);
    block += along * weight;
    let mut rows = factor.information_vector.fixed_rows_mut::<3>(first);
    rows += mean * weight;
    factor.offset -= 0.5 * weight * mean.norm_squared();
}

/// Adds that the camera stands near a place of the world, which it sees at `R (X - C)`: the way there in its axes.
fn add_place(factor: &mut Gaussian, pose: &Pose, place: &Vector3<f64>, sigma: f64) {
    add_block(factor, 3, &Matrix3::identity(), &-pose.transform(place), sigma);
}

fn check_finite(item: &str, vector: &Vector3<f64>) -> Result<()> {
    match vector.iter().enumerate().find(|(_, entry)| !entry.is_finite()) {
        Some((index, &value)) => Err(Error::NotFinite { item: item.into(), index, value }),
        None => Ok(()),
    }
}

fn check_sigma(item: &'static str, sigma: Option<f64>) -> Result<()> {
    match sigma.filter(|sigma| !is_positive(*sigma)) {
        Some(found) => Err(Error::InvalidPrior { item, found: found.to_string(), needed: "a positive number".into() }),
        None => Ok(()),
    }
}

fn is_positive(number: f64) -> bool {
    number > 0.0 && number.is_finite()
}

/// Length of an increment in standard deviations; 0 where a direction is left free.
pub(crate) fn mahalanobis<const N: usize>(increment: &SVector<f64, N>, covariance: &SMatrix<f64, N, N>) -> f64 {
    if !covariance.iter().all(|entry| entry.is_finite()) {
        return 0.0;
    }
    covariance.cholesky().map_or(0.0, |root| increment.dot(&root.solve(increment)).max(0.0).sqrt())
}

/// A prior as it is serialized, by its terms; what is read is checked as by its methods.
#[cfg(feature = "serde")]
mod serialized {
    use super::{Error, Pose, PoseSigma, Prior, Result, Vector3};

    #[derive(serde::Serialize, serde::Deserialize, Default)]
    #[serde(default, deny_unknown_fields)]
    pub(super) struct Terms {
        initial: Option<Pose>,
        initial_sigma: Option<PoseSigma>,
        up: Option<Vector3<f64>>,
        up_sigma: Option<f64>,
        near: Option<Vector3<f64>>,
        near_sigma: Option<f64>,
    }

    impl From<Prior> for Terms {
        fn from(prior: Prior) -> Self {
            let Prior { initial, initial_sigma, up, up_sigma, near, near_sigma } = prior;
            Self { initial, initial_sigma, up, up_sigma, near, near_sigma }
        }
    }

    impl TryFrom<Terms> for Prior {
        type Error = Error;

        fn try_from(terms: Terms) -> Result<Self> {
            let alone = |item, sigma: bool, term: bool| match sigma && !term {
                true => {
                    Err(Error::InvalidPrior { item, found: "a deviation alone".into(), needed: "what it is of".into() })
                }
                false => Ok(()),
            };
            alone("initial_sigma", terms.initial_sigma.is_some(), terms.initial.is_some())?;
            alone("up_sigma", terms.up_sigma.is_some(), terms.up.is_some())?;
            alone("near_sigma", terms.near_sigma.is_some(), terms.near.is_some())?;
            let mut prior = Self::default();
            if let Some(initial) = terms.initial {
                prior = prior.with_initial(initial, terms.initial_sigma)?;
            }
            if let Some(up) = terms.up {
                prior = prior.with_up(up, terms.up_sigma)?;
            }
            if let Some(near) = terms.near {
                prior = prior.with_near(near, terms.near_sigma)?;
            }
            Ok(prior)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Rotation3;

    use super::*;

    fn pose() -> Pose {
        Pose::new(Rotation3::new(Vector3::new(0.3, -0.5, 1.1)), Vector3::new(0.4, -2.0, 5.0))
    }

    fn rough(rotation: f64, place: f64) -> Prior {
        Prior::default().with_initial(pose(), Some(PoseSigma { rotation, place })).unwrap()
    }

    /// A camera turned by 0.2 rad where it stands, then carried by 0.6 m without a turn.
    #[test]
    fn a_turn_and_a_way_count_in_their_own_deviations() {
        let exact = Matrix6::zeros();
        let turned = Pose::new(Rotation3::new(Vector3::new(0.0, 0.2, 0.0)), Vector3::zeros()).after(&pose());
        let from = rough(0.1, 0.3).initial_deviation(&turned, &exact).unwrap();
        assert!((from.rotation - 0.2).abs() < 1e-12 && from.place < 1e-12);
        assert!((from.sigmas.unwrap() - 2.0).abs() < 1e-9);
        let carried = Pose::new(pose().rotation, pose().translation + Vector3::new(0.0, 0.0, 0.6));
        let from = rough(0.1, 0.3).initial_deviation(&carried, &exact).unwrap();
        assert!(from.rotation < 1e-7 && (from.place - 0.6).abs() < 1e-12);
        let centers = carried.inverse().translation - pose().inverse().translation;
        assert!((from.place - centers.norm()).abs() < 1e-12);
        assert!((from.sigmas.unwrap() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_poses_own_uncertainty_adds_to_the_priors() {
        let carried = Pose::new(pose().rotation, pose().translation + Vector3::new(0.5, 0.0, 0.0));
        let sigmas = |own: f64| {
            let covariance = Matrix6::identity() * (own * own);
            rough(0.3, 0.3).initial_deviation(&carried, &covariance).unwrap().sigmas.unwrap()
        };
        assert!((sigmas(0.4) - 1.0).abs() < 1e-6, "0.3 and 0.4 make 0.5");
        assert!(sigmas(0.0) > sigmas(0.4) && sigmas(f64::INFINITY) == 0.0);
    }

    #[test]
    fn a_contradiction_is_beyond_five_deviations_or_half_a_right_angle() {
        let exact = Matrix6::zeros();
        let carried = |by: f64| Pose::new(pose().rotation, pose().translation + Vector3::new(by, 0.0, 0.0));
        let contradicted = |prior: Prior, at: &Pose| prior.initial_deviation(at, &exact).unwrap().is_contradiction();
        assert!(!contradicted(rough(0.1, 0.1), &carried(0.49)) && contradicted(rough(0.1, 0.1), &carried(0.51)));
        let start = Prior { initial_sigma: None, ..rough(0.1, 0.1) };
        let turned = |by: f64| Pose::new(Rotation3::new(Vector3::z() * by) * pose().rotation, pose().translation);
        assert!(!contradicted(start, &turned(0.78)) && contradicted(start, &turned(0.79)));
        assert!(!contradicted(start, &carried(50.0)));
    }

    /// The world's +z is up; the camera is rolled by 30 degrees.
    #[test]
    fn up_is_as_far_off_as_the_camera_is_rolled() {
        let level = Rotation3::from_axis_angle(&Vector3::x_axis(), PI / 2.0);
        assert!((level * Vector3::z() + Vector3::y()).norm() < 1e-12);
        let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), PI / 6.0);
        let rolled = Pose::new(roll * level, Vector3::zeros());
        let exact = Matrix6::zeros();
        let prior = Prior { up: Some(Vector3::z() * 9.81), ..Prior::default() };
        let from = prior.up_deviation(&rolled, &exact).unwrap();
        assert!((from.angle - PI / 6.0).abs() < 1e-9 && (from.sigmas - 2.0).abs() < 1e-9);
        let strict = Prior { up_sigma: Some(PI / 36.0), ..prior };
        assert!((strict.up_deviation(&rolled, &exact).unwrap().sigmas - 6.0).abs() < 1e-9);
        assert!(strict.up_deviation(&rolled, &exact).unwrap().is_contradiction() && !from.is_contradiction());
        // Uncertain about the roll by as much again, and about another axis.
        let own = |axis: usize| Matrix6::from_diagonal(&Vector6::ith(axis, (PI / 36.0).powi(2) * 3.0));
        assert!((strict.up_deviation(&rolled, &own(2)).unwrap().sigmas - 3.0).abs() < 1e-9);
        assert!((strict.up_deviation(&rolled, &own(0)).unwrap().sigmas - 6.0).abs() < 1e-9);
    }

    /// A camera 3 m from a place with a deviation of 1 m; the pose's own 2 m along the way there add up to root 5, across
    /// they don't.
    #[test]
    fn a_place_counts_by_its_distance_in_deviations() {
        let way = Vector3::new(2.0, -1.0, 2.0);
        let near = Some(pose().inverse().translation - pose().rotation.inverse() * way);
        let prior = Prior { near, near_sigma: Some(1.0), ..Prior::default() };
        let from = prior.place_deviation(&pose(), &Matrix6::zeros()).unwrap();
        assert!((from.place - 3.0).abs() < 1e-12 && (from.sigmas - 3.0).abs() < 1e-12 && !from.is_contradiction());
        let own = |along: Vector3<f64>| {
            let mut covariance = Matrix6::zeros();
            covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(along * along.transpose() * 4.0));
            prior.place_deviation(&pose(), &covariance).unwrap().sigmas
        };
        assert!((own(way / 3.0) - 3.0 / 5.0_f64.sqrt()).abs() < 1e-12);
        assert!((own(Vector3::new(1.0, 2.0, 0.0) / 5.0_f64.sqrt()) - 3.0).abs() < 1e-12);
        let strict = Prior { near_sigma: Some(0.5), ..prior };
        assert!(strict.place_deviation(&pose(), &Matrix6::zeros()).unwrap().is_contradiction());
        let conventional = Prior { near_sigma: None, ..prior };
        assert!(
            (conventional.place_deviation(&pose(), &Matrix6::zeros()).unwrap().sigmas - 3.0 / NEAR_SIGMA).abs() < 1e-12
        );
    }

    #[test]
    fn a_penalty_is_the_sum_of_squares_each_up_to_a_bound() {
        let exact = Matrix6::zeros();
        let carried = |by: f64| Pose::new(pose().rotation, pose().translation + Vector3::new(by, 0.0, 0.0));
        let up = pose().rotation.inverse() * Rotation3::from_axis_angle(&Vector3::z_axis(), UP_SIGMA) * -Vector3::y();
        let both = Prior { up: Some(up), ..rough(0.1, 0.1) };
        assert!((both.penalty(&carried(0.3), &exact) - 10.0).abs() < 1e-6);
        assert!((both.penalty(&carried(70.0), &exact) - (MAX_PENALTY + 1.0)).abs() < 1e-6);
        let three = Prior { near: Some(pose().inverse().translation), near_sigma: Some(0.1), ..both };
        assert!((three.penalty(&carried(0.3), &exact) - 19.0).abs() < 1e-6 && three.max_penalty() == 3.0 * MAX_PENALTY);
        assert!((three.penalty(&carried(70.0), &exact) - (2.0 * MAX_PENALTY + 1.0)).abs() < 1e-6);
        assert!(
            both.max_penalty() == 2.0 * MAX_PENALTY
                && rough(0.1, 0.1).max_penalty() == MAX_PENALTY
                && Prior::default().max_penalty() == 0.0
        );
        assert!(Prior::default().penalty(&pose(), &exact) == 0.0);
    }
}
