//! Poses, priors, options and estimates as JSON: what is written is read again, and what is no pose or prior is refused.

use nalgebra::{Matrix3, Rotation3, Vector3};
use regionpose::{
    Cause, Estimate, FrameSigma, Limits, Options, Pose, PoseSigma, Prior, Problem, Refinement, RelativePose, Start,
    Warning,
};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Value, from_value, json, to_value};

use crate::support::random::Random;
use crate::support::samples::{layout, sampled};
use crate::support::scene::Scene;

/// What is read of what was written, by way of text.
fn again<T: Serialize + DeserializeOwned>(value: &T) -> T {
    serde_json::from_str(&serde_json::to_string(value).unwrap()).unwrap()
}

#[test]
fn a_pose_is_written_by_rows_and_read_to_the_last_digit() {
    let turned = Pose::new(Rotation3::from_axis_angle(&Vector3::z_axis(), 0.5), Vector3::new(1.0, 2.0, 3.0));
    let rows = &to_value(turned).unwrap()["rotation"];
    assert_eq!((&rows[0][1], &rows[1][0]), (&json!(-0.5_f64.sin()), &json!(0.5_f64.sin())));
    let random = &mut Random::new(1);
    for pose in [(); 20].map(|()| random.pose(5.0)) {
        assert_eq!(again(&pose), pose);
    }
}

#[test]
fn a_matrix_that_is_no_rotation_is_refused() {
    let pose = |matrix: Matrix3<f64>| {
        let rows: [[f64; 3]; 3] = matrix.transpose().into();
        from_value::<Pose>(json!({ "rotation": rows, "translation": [0.0, 0.0, 0.0] }))
    };
    assert!(pose(Matrix3::identity()).is_ok());
    assert!(pose(Matrix3::identity() * 1.1).is_err());
    assert!(pose(-Matrix3::identity()).is_err());
}

#[test]
fn a_prior_is_checked_where_it_is_read() {
    let pose = Random::new(2).pose(5.0);
    let prior = Prior::default().with_up(Vector3::new(0.0, 2.0, 1.0), Some(0.1)).unwrap();
    let prior = prior.with_near(Vector3::new(1.0, 2.0, 3.0), None).unwrap();
    let prior = prior.with_initial(pose, Some(PoseSigma { rotation: 0.1, place: 0.3 })).unwrap();
    assert_eq!((again(&prior), again(&Prior::default())), (prior, Prior::default()));
    let read = |value: Value| from_value::<Prior>(value).is_ok();
    assert!(read(json!({ "up": [0.0, 0.0, 1.0] })) && read(json!({})));
    assert!(!read(json!({ "up": [0.0, 0.0, 0.0] })));
    assert!(!read(json!({ "near": [0.0, 0.0, 1.0], "near_sigma": -1.0 })));
    assert!(!read(json!({ "near_sigma": 1.0 })), "a deviation of nothing");
    assert!(!read(json!({ "upp": [0.0, 0.0, 1.0] })), "an unknown term");
}

#[test]
fn options_that_are_not_given_are_the_default() {
    let options = Options::default().with_start(Start::Paper).with_refinement(Refinement::Off);
    let options = options.with_frame_sigma(FrameSigma::ZERO).with_limits(Limits::default().with_rotation(0.1));
    assert_eq!(again(&options), options);
    assert_eq!(from_value::<Options>(json!({})).unwrap(), Options::default());
    assert!(from_value::<Options>(json!({ "refine": "Off" })).is_err(), "an unknown field");
    assert!(from_value::<Options>(json!({ "limits": { "turn": 0.1 } })).is_err(), "an unknown field");
    let rotation = from_value::<Options>(json!({ "limits": { "rotation": 0.1 } })).unwrap();
    assert_eq!(rotation, Options::default().with_limits(Limits::default().with_rotation(0.1)));
}

#[test]
fn warnings_are_read_as_they_were() {
    let (axis, along) = (Vector3::x(), Vector3::y());
    let causes = vec![Cause::Coplanar, Cause::Lines { count: 1, regions: 2 }];
    let warnings = vec![
        Warning::SamplesUnused,
        Warning::Ambiguous { others: vec![RelativePose { degrees: 90.0, axis, shift: 0.1 }] },
        Warning::WeakGeometry { degrees: 1.0, axis, shift: 0.1, along, most_degrees: 0.5, most_shift: 0.02, causes },
    ];
    assert_eq!(again(&warnings), warnings);
}

/// The written forms are equal: neither estimates nor all of their parts can be compared.
#[test]
fn estimates_from_outlines_and_samples_are_read_as_they_were() {
    let random = &mut Random::new(3);
    let scene = Scene::random(random, layout(3));
    let worlds = sampled(random, &scene.worlds, 0.1, 1.0);
    for worlds in [&scene.worlds, &worlds] {
        let estimate = Problem::new(&scene.observed, worlds).unwrap().estimate().unwrap();
        let read: Estimate = again(&estimate);
        assert_eq!(read.best.pose, estimate.best.pose);
        assert_eq!(read.best.posterior.is_some(), !std::ptr::eq(worlds, &scene.worlds));
        assert_eq!(read.best.covariance, estimate.best.covariance);
        assert_eq!(to_value(&read).unwrap(), to_value(&estimate).unwrap());
    }
}
