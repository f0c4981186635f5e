//! A region's own view: the same for every rotation of the camera, unit area, as wide as a half space nearly is.

use std::f64::consts::TAU;

use crate::support::random::Random;
use crate::support::scene::{SpaceRing, pierced_star, placed, seen_plane};
use nalgebra::{Matrix3, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::Error;
use regionpose::internals::view::bearing_rings::BearingRings;
use regionpose::internals::view::chart::{Chart, MIN_COSINE};
use regionpose::moments::plane::planar_moments;

/// Error allowed of chart coordinates, which are of size one.
const ROUNDING: f64 = 1e-12;

/// Bearings of a pierced star anywhere around the camera.
fn anywhere(random: &mut Random) -> Vec<SpaceRing> {
    let direction = random.direction();
    let plane = seen_plane(random, &direction, 3.0, 0.6, true);
    let rings = placed(&pierced_star(random, 9, 1.0), &plane);
    rings.iter().map(|ring| ring.iter().map(Vector3::normalize).collect()).collect()
}

/// A ring of `count` bearings at `angle` (rad) around z.
fn cone(angle: f64, count: usize) -> SpaceRing {
    let bearing = |k: usize| {
        let around = TAU * k as f64 / count as f64;
        Vector3::new(angle.sin() * around.cos(), angle.sin() * around.sin(), angle.cos())
    };
    (0..count).map(bearing).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_area_is_one_and_the_centroid_on_the_axis(seed: u64) {
        let (_, outline) = Chart::of(&anywhere(&mut Random::new(seed))).unwrap();
        let moments = planar_moments(outline.rings().iter().map(Vec::as_slice), 1);
        prop_assert!((moments.get(0, 0) - 1.0).abs() < ROUNDING);
        // The centroid's own chart moves it by the cube of the region's angular size at most, three times over.
        prop_assert!(moments.get(1, 0).hypot(moments.get(0, 1)) < 1e-3);
    }

    #[test]
    fn bearings_project_onto_the_outline(seed: u64) {
        let rings = anywhere(&mut Random::new(seed));
        let (chart, outline) = Chart::of(&rings).unwrap();
        for (bearings, ring) in rings.iter().zip(outline.rings()) {
            for bearing in bearings {
                let point = chart.project(&(bearing * 7.0)).unwrap();
                prop_assert!(ring.iter().any(|p| (p - point).norm() < ROUNDING));
            }
        }
    }

    #[test]
    fn a_turned_camera_sees_the_same_chart_turned_in_itself(seed: u64) {
        let mut random = Random::new(seed);
        let rings = anywhere(&mut random);
        let turn = random.rotation();
        let turned: Vec<SpaceRing> = rings.iter().map(|ring| ring.iter().map(|r| turn * r).collect()).collect();
        let ((one, first), (other, second)) = (Chart::of(&rings).unwrap(), Chart::of(&turned).unwrap());
        prop_assert!((one.scale / other.scale - 1.0).abs() < ROUNDING);
        let axis = |chart: &Chart| chart.rotation.inverse() * Vector3::z();
        let gap = (turn * axis(&one) - axis(&other)).norm();
        prop_assert!(gap < ROUNDING, "{gap:.1e}");
        for (a, b) in first.rings().iter().flatten().zip(second.rings().iter().flatten()) {
            prop_assert!((a.norm() - b.norm()).abs() < 10.0 * ROUNDING);
        }
    }

    #[test]
    fn wild_bearings_are_taken_or_refused(seed: u64) {
        let mut random = Random::new(seed);
        let mut rings = anywhere(&mut random);
        let wild = [f64::NAN, f64::INFINITY, 1e308, -1e200, 1e-320, -0.0, 0.0];
        for _ in 0..=random.index(4) {
            rings[random.index(2)][random.index(4)][random.index(3)] = wild[random.index(wild.len())];
        }
        if let Ok((chart, outline)) = Chart::of(&rings) {
            prop_assert!(chart.scale.is_finite() && (outline.area() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn chart_rotations_are_orthonormal_however_near_the_axis_is_to_z() {
    for exponent in [-300, -160, -17, -9, -8, -4, -1] {
        for side in [1.0, -1.0] {
            let tilt = 10.0_f64.powi(exponent);
            let ring = cone(0.2, 6).iter().map(|r| Vector3::new(r.x + tilt, r.y - 2.0 * tilt, r.z * side)).collect();
            let (chart, _) = Chart::of(&[ring]).unwrap();
            let rotation = chart.rotation.matrix();
            assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-15, "{tilt:e} {side}");
        }
    }
}

#[test]
fn a_region_behind_the_camera_has_a_chart() {
    let ring: SpaceRing = cone(0.2, 6).iter().map(|r| -r).collect();
    let (chart, outline) = Chart::of(&[ring]).unwrap();
    assert!((chart.rotation * -Vector3::z() - Vector3::z()).norm() < ROUNDING);
    assert!((outline.area() - 1.0).abs() < ROUNDING);
    assert_eq!(chart.project(&Vector3::z()), None);
}

#[test]
fn wide_regions_up_to_87_degrees_from_their_axis_are_taken() {
    for degrees in [150.0_f64, 165.0, 173.0] {
        let turn = Random::new(degrees as u64).rotation();
        let ring: SpaceRing = cone(degrees.to_radians() / 2.0, 24).iter().map(|r| turn * r).collect();
        let (chart, outline) = Chart::of(std::slice::from_ref(&ring)).unwrap();
        assert!((outline.area() - 1.0).abs() < ROUNDING, "{degrees} deg");
        let farthest = ring.iter().map(|r| (chart.rotation * r).z).fold(1.0, f64::min);
        assert!(farthest > MIN_COSINE, "{degrees} deg: {farthest}");
    }
}

#[test]
fn a_wide_region_with_most_of_its_boundary_on_one_side_gets_the_axis_of_its_cone() {
    let mut ring = cone(75.0_f64.to_radians(), 6);
    let many = cone(75.0_f64.to_radians(), 6 * 64);
    ring.splice(0..2, many[0..65].iter().copied().map(|r| Vector3::new(r.x, r.y, r.z * 1.01).normalize()));
    let (chart, outline) = Chart::of(&[ring]).unwrap();
    assert!((outline.area() - 1.0).abs() < ROUNDING);
    assert!((chart.rotation.inverse() * Vector3::z()).z > 0.9);
}

#[test]
fn regions_wider_than_that_are_refused() {
    let found = Chart::of(&[cone(88.0_f64.to_radians(), 24)]).unwrap_err();
    assert_eq!(
        found.to_string(),
        "the observed region reaches 87.1 deg or more from every axis; it needs to lie nearer to one"
    );
    assert!(matches!(Chart::of(&[cone(1.7, 24)]), Err(Error::Crossing { .. } | Error::TooWide { .. }) | Ok(_)));
    let equator = Chart::of(&[cone(std::f64::consts::FRAC_PI_2, 24)]).unwrap_err();
    assert!(matches!(equator, Error::TooWide { .. }), "{equator}");
}

#[test]
fn bearings_are_named_in_refusals() {
    let mut ring = cone(0.3, 5);
    ring[3] = Vector3::zeros();
    let found = Chart::of(&[cone(0.6, 5), ring.clone()]).unwrap_err();
    assert_eq!(found.to_string(), "ring 1 bearing 3 is zero; a bearing needs a direction");
    ring[3].y = f64::NEG_INFINITY;
    let found = Chart::of(&[cone(0.6, 5), ring]).unwrap_err();
    assert_eq!(found.to_string(), "ring 1 bearing 3 is not finite: -inf; coordinates need to be finite numbers");
    assert_eq!(Chart::of(&[]).unwrap_err(), Error::NoRings);
    assert!(matches!(Chart::of(&[cone(0.3, 5), Vec::new()]), Err(Error::TooFewVertices { ring: 1, found: 0 })));
    assert!(matches!(Chart::of(&[Vec::new()]), Err(Error::TooFewVertices { ring: 0, found: 0 })));
    assert!(matches!(Chart::of(&[cone(0.3, 2)]), Err(Error::TooFewVertices { ring: 0, found: 2 })));
    let same = Chart::of(&[vec![Vector3::x(); 4]]).unwrap_err();
    assert!(matches!(same, Error::TooFewVertices { ring: 0, found: 1 }), "{same}");
    let crossed = [0, 2, 1, 3].map(|k| cone(0.3, 4)[k]).to_vec();
    assert!(matches!(Chart::of(&[crossed]), Err(Error::Crossing { .. })));
}

#[test]
fn points_beside_or_behind_the_chart_have_no_projection() {
    let (chart, _) = Chart::of(&[cone(0.3, 5)]).unwrap();
    let at = |degrees: f64| chart.project(&Vector3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos()));
    assert!(at(87.0).is_some() && at(87.2).is_none() && at(180.0).is_none());
    assert_eq!(chart.project(&Vector3::zeros()), None);
    assert_eq!(chart.project(&Vector3::new(f64::NAN, 0.0, 1.0)), None);
    assert_eq!(chart.project(&(Vector3::z() * 3.0)).map(|p| p.norm() < ROUNDING), Some(true));
}

#[test]
fn bearing_rings_turn_left_seen_from_outside() {
    for reversed in [false, true] {
        let mut ring = cone(0.4, 7);
        if reversed {
            ring.reverse();
        }
        let rings = BearingRings::new(&[ring, cone(0.2, 5)]).unwrap();
        let turn = |ring: &SpaceRing| {
            (0..ring.len()).map(|k| ring[k].cross(&ring[(k + 1) % ring.len()])).sum::<Vector3<f64>>().z
        };
        assert!(turn(&rings.rings()[0]) > 0.0 && turn(&rings.rings()[1]) < 0.0);
        let (_, flat) = rings.view();
        assert_eq!(flat.rings().len(), 2);
        assert!(flat.rings()[1].iter().all(|p| *p != Vector2::zeros()));
    }
}
