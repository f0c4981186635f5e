//! The overlap error against closed forms, laws, and sampling.

use std::f64::consts::TAU;

use nalgebra::{Rotation3, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::overlap::overlap_areas;
use regionpose::internals::geometry::rings::PlaneRings;

type Ring = Vec<Vector2<f64>>;

fn rectangle(left: f64, low: f64, right: f64, high: f64) -> Ring {
    [[left, low], [right, low], [right, high], [left, high]].map(Vector2::from).to_vec()
}

fn polygon(rings: Vec<Ring>) -> PlaneRings {
    PlaneRings::polygon(rings).unwrap()
}

/// Solid angle of a rectangle of the chart: the corner sums of `atan(x y / sqrt(1 + x^2 + y^2))`.
fn rectangle_angle(left: f64, low: f64, right: f64, high: f64) -> f64 {
    let corner = |x: f64, y: f64| (x * y).atan2((1.0 + x * x + y * y).sqrt());
    corner(right, high) - corner(left, high) - corner(right, low) + corner(left, low)
}

/// Solid angle of the rings: signed spherical triangles with the optical axis (Van Oosterom and Strackee 1983).
fn solid_angle(region: &PlaneRings) -> f64 {
    let bearing = |p: Vector2<f64>| Vector3::new(p.x, p.y, 1.0).normalize();
    let triangle = |(a, b): (Vector2<f64>, Vector2<f64>)| {
        let (a, b, c) = (bearing(a), bearing(b), Vector3::z());
        2.0 * a.dot(&b.cross(&c)).atan2(1.0 + a.dot(&b) + b.dot(&c) + c.dot(&a))
    };
    region.edges().map(triangle).sum()
}

#[test]
fn equal_regions_have_no_error() {
    let region = polygon(vec![rectangle(-0.3, -0.2, 0.4, 0.5), rectangle(-0.1, 0.0, 0.1, 0.2)]);
    assert!(overlap_areas(&region, &region, &Budget::unlimited()).error() < 1e-14);
}

#[test]
fn shifted_rectangles_follow_the_closed_form() {
    for (dx, dy) in [(0.1, 0.0), (0.03, -0.2), (1e-7, 1e-7), (0.3, 0.55)] {
        let observed = polygon(vec![rectangle(-0.2, -0.3, 0.5, 0.4)]);
        let predicted = polygon(vec![rectangle(-0.2 + dx, -0.3 + dy, 0.5 + dx, 0.4 + dy)]);
        let [first, second] = [&observed, &predicted].map(solid_angle);
        let common = rectangle_angle(-0.2 + dx, (-0.3_f64).max(-0.3 + dy), 0.5, 0.4_f64.min(0.4 + dy));
        let areas = overlap_areas(&observed, &predicted, &Budget::unlimited());
        assert!((areas.intersection - common).abs() < 1e-15);
        assert!((areas.only_observed - (first - common)).abs() < 1e-15);
        assert!((areas.only_predicted - (second - common)).abs() < 1e-15);
        let error = overlap_areas(&observed, &predicted, &Budget::unlimited()).error();
        assert!((error - (first + second - 2.0 * common) / first).abs() < 1e-14);
    }
}

#[test]
fn regions_apart_give_one_plus_the_ratio_of_areas() {
    let observed = polygon(vec![rectangle(0.0, 0.0, 0.2, 0.2)]);
    for predicted in [rectangle(0.3, 0.0, 0.4, 0.9), rectangle(0.0, 0.21, 0.2, 0.5), rectangle(0.2, 0.0, 0.3, 0.2)] {
        let predicted = polygon(vec![predicted]);
        let ratio = solid_angle(&predicted) / solid_angle(&observed);
        assert!((overlap_areas(&observed, &predicted, &Budget::unlimited()).error() - 1.0 - ratio).abs() < 1e-13);
    }
}

#[test]
fn holes_and_islands_count() {
    let block = || rectangle(-0.6, -0.5, 0.6, 0.5);
    let hole = || rectangle(-0.3, -0.2, 0.1, 0.2);
    let (whole, pierced, plug) = (polygon(vec![block()]), polygon(vec![block(), hole()]), polygon(vec![hole()]));
    let lost = rectangle_angle(-0.3, -0.2, 0.1, 0.2);
    let error = overlap_areas(&whole, &pierced, &Budget::unlimited()).error();
    assert!((error - lost / solid_angle(&whole)).abs() < 1e-14);
    assert!(overlap_areas(&pierced, &plug, &Budget::unlimited()).intersection < 1e-15);
    let islands = PlaneRings::new(vec![rectangle(-0.5, 0.0, -0.2, 0.3), rectangle(0.0, 0.0, 0.3, 0.3)]).unwrap();
    let common = rectangle_angle(-0.3, 0.0, -0.2, 0.1) + rectangle_angle(0.0, 0.0, 0.1, 0.1);
    let probe = polygon(vec![rectangle(-0.3, -0.1, 0.1, 0.1)]);
    assert!((overlap_areas(&islands, &probe, &Budget::unlimited()).intersection - common).abs() < 1e-15);
}

#[test]
fn a_star_of_two_triangles_follows_from_its_corners() {
    let triangle = |turn: f64| -> Ring {
        (0..3)
            .map(|k| TAU * (k as f64 + turn) / 3.0)
            .map(|angle| 0.5 * Vector2::new(angle.cos(), angle.sin()))
            .collect()
    };
    let (up, down) = (polygon(vec![triangle(0.0)]), polygon(vec![triangle(0.5)]));
    let hexagon = |k: usize| TAU * (k as f64 + 0.5) / 6.0;
    let radius = 0.5 / 3.0_f64.sqrt();
    let common = polygon(vec![(0..6).map(|k| radius * Vector2::new(hexagon(k).cos(), hexagon(k).sin())).collect()]);
    assert!((overlap_areas(&up, &down, &Budget::unlimited()).intersection - solid_angle(&common)).abs() < 1e-15);
}

#[test]
fn a_region_nearly_as_wide_as_the_half_space_is_measured() {
    let wide = polygon(vec![rectangle(-1e8, -1e8, 1e8, 1e8)]);
    let probe = polygon(vec![rectangle(-1.0, -1.0, 1.0, 1.0)]);
    let areas = overlap_areas(&wide, &probe, &Budget::unlimited());
    assert!((areas.intersection - TAU / 3.0).abs() < 1e-14, "the cube's face");
    assert!((areas.intersection + areas.only_observed - TAU).abs() < 1e-7, "a half space but for 1e-8 rad");
}

/// A star-shaped ring around `(x, y)`.
fn star() -> impl Strategy<Value = Ring> {
    let radii = proptest::collection::vec(0.05..0.5_f64, 4..60);
    (radii, -0.4..0.4_f64, -0.4..0.4_f64, 0.0..TAU).prop_map(|(radii, x, y, turn)| {
        let count = radii.len() as f64;
        let vertex = |(k, radius): (usize, f64)| {
            let angle = turn + TAU * k as f64 / count;
            Vector2::new(x + radius * angle.cos(), y + radius * angle.sin())
        };
        radii.into_iter().enumerate().map(vertex).collect()
    })
}

/// The chart's points turned on the sphere.
fn turned(ring: &Ring, turn: Rotation3<f64>) -> Ring {
    let image = |p: &Vector2<f64>| turn * Vector3::new(p.x, p.y, 1.0);
    ring.iter().map(image).map(|p| Vector2::new(p.x / p.z, p.y / p.z)).collect()
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), -2.0..2.0_f64, (-3..3).prop_map(f64::from), (-60..60).prop_map(|k| 10.0_f64.powi(k))]
}

fn wild_ring() -> impl Strategy<Value = Ring> {
    proptest::collection::vec((wild(), wild()).prop_map(|(x, y)| Vector2::new(x, y)), 3..6)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn laws_hold(a in star(), b in star()) {
        let (a, b) = (polygon(vec![a]), polygon(vec![b]));
        let (there, back) = (overlap_areas(&a, &b, &Budget::unlimited()), overlap_areas(&b, &a, &Budget::unlimited()));
        prop_assert!((there.intersection - back.intersection).abs() < 1e-14);
        prop_assert!((there.only_observed - back.only_predicted).abs() < 1e-14);
        prop_assert!((there.intersection + there.only_observed - solid_angle(&a)).abs() < 1e-14);
        prop_assert!((there.intersection + there.only_predicted - solid_angle(&b)).abs() < 1e-14);
        let error = overlap_areas(&a, &b, &Budget::unlimited()).error();
        prop_assert!(error >= 0.0 && error <= 1.0 + solid_angle(&b) / solid_angle(&a) + 1e-12);
    }

    #[test]
    fn a_turn_of_the_camera_changes_nothing(a in star(), b in star(), x in -0.3..0.3_f64, y in -0.3..0.3_f64, z in -3.0..3.0_f64) {
        let turn = Rotation3::from_euler_angles(x, y, z);
        let moved = [&a, &b].map(|ring| polygon(vec![turned(ring, turn)]));
        let still = [a, b].map(|ring| polygon(vec![ring]));
        let errors = [still, moved].map(|[a, b]| overlap_areas(&a, &b, &Budget::unlimited()).error());
        prop_assert!((errors[0] - errors[1]).abs() < 1e-11 * (1.0 + errors[0]), "{errors:?}");
    }

    #[test]
    fn sampling_agrees(a in star(), b in star()) {
        const SIDE: usize = 80;
        let (a, b) = (polygon(vec![a]), polygon(vec![b]));
        let cell = 2.0 / SIDE as f64;
        let point = |k: usize| (Vector2::new((k % SIDE) as f64 + 0.5, (k / SIDE) as f64 + 0.5) * cell).add_scalar(-1.0);
        let weight = |p: Vector2<f64>| cell * cell * (1.0 + p.norm_squared()).powf(-1.5);
        let both = (0..SIDE * SIDE).map(point).filter(|&p| a.contains(p) && b.contains(p));
        let sampled: f64 = both.map(weight).sum();
        let found = overlap_areas(&a, &b, &Budget::unlimited()).intersection;
        prop_assert!((found - sampled).abs() < 0.012, "{found} {sampled}");
    }

    #[test]
    fn parts_add_up(a in star(), b in star()) {
        let whole = polygon(vec![a.clone()]);
        let (lower, upper) = whole.bounds();
        let cut = 0.5 * (lower.y + upper.y);
        let probe = polygon(vec![b]);
        let half = |low: f64, high: f64| overlap_areas(&polygon(vec![rectangle(-2.0, low, 2.0, high)]), &probe, &Budget::unlimited());
        let sum = half(-2.0, cut).intersection + half(cut, 2.0).intersection;
        prop_assert!((sum - solid_angle(&probe)).abs() < 1e-13);
    }

    #[test]
    fn nothing_panics(a in wild_ring(), b in wild_ring()) {
        if let (Ok(a), Ok(b)) = (PlaneRings::new(vec![a]), PlaneRings::new(vec![b])) {
            let areas = overlap_areas(&a, &b, &Budget::unlimited());
            prop_assert!(areas.intersection >= 0.0 && areas.only_observed >= 0.0 && areas.only_predicted >= 0.0);
        }
    }
}
