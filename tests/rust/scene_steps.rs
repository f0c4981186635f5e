//! Steps of depth and shade of points, and pictures that are spread.

use crate::support::random::Random;
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::alignment::blur::blurred;
use regionpose::internals::alignment::edges::{self, Step, VisiblePoints};

/// Between neighbors of the grid, about, rad.
const SPACING: f64 = 0.02;
const CELL: f64 = 1e-3;
const GAP: f64 = 0.06;
const SHARE: f64 = 0.1;

/// Half a card's width on the plane at distance 1: between two of the grid's places.
const HALF: f64 = 0.21;

fn depth_steps(points: &[Vector3<f64>]) -> Vec<Step> {
    edges::depth_steps(points, CELL, GAP, SHARE)
}

fn shade_steps(points: &[Vector3<f64>], shades: &[f64]) -> Vec<Step> {
    VisiblePoints::new(points, CELL, GAP).shade_steps(shades, SHARE)
}

/// Directions to a grid 1 rad wide about the z axis.
fn grid(spacing: f64) -> impl Iterator<Item = Vector3<f64>> {
    let count = (1.0 / spacing) as i32;
    let places = move |k: i32| (f64::from(k) / f64::from(count) - 0.5) * 1.0;
    (0..=count).flat_map(move |i| (0..=count).map(move |j| Vector3::new(places(i), places(j), 1.0).normalize()))
}

/// Where rays meet a plane, all before the camera.
fn on_plane(normal: &Vector3<f64>, offset: f64) -> Vec<Vector3<f64>> {
    let met = grid(SPACING).map(|ray| (ray, offset / normal.dot(&ray)));
    met.filter(|(_, range)| *range > 0.0).map(|(ray, range)| ray * range).collect()
}

/// A square card before a wall.
fn card_and_wall(half: f64) -> Vec<Vector3<f64>> {
    let range = |ray: &Vector3<f64>| {
        let flat = ray / ray.z;
        if flat.x.abs() < half && flat.y.abs() < half { 2.0 } else { 5.0 }
    };
    grid(SPACING).map(|ray| ray / ray.z * range(&ray)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn a_plane_has_none_however_it_lies(x in -1.0..1.0_f64, y in -1.0..1.0_f64, offset in 0.1..100.0_f64) {
        // The grid ends where the plane does not: up to 45 degrees off the axis it turns away by 18 degrees more at the most.
        let normal = Vector3::new(x, y, 1.5).normalize();
        prop_assert!(depth_steps(&on_plane(&normal, offset)).is_empty());
    }

    #[test]
    fn the_world_axes_do_not_matter(seed in 0..1000_u64) {
        let rotation = Random::new(seed).rotation();
        let points = card_and_wall(HALF);
        let turned: Vec<_> = points.iter().map(|point| rotation * point).collect();
        let count = |points: &[Vector3<f64>]| {
            let steps = depth_steps(points);
            let mut near: Vec<_> = steps.iter().map(|step| format!("{:.6}", step.near.z.abs())).collect();
            near.dedup();
            steps.len()
        };
        // Sectors begin elsewhere, so that samples at corners may have one step more or less.
        let (one, other) = (count(&points) as f64, count(&turned) as f64);
        prop_assert!((one - other).abs() < 0.35 * one, "{one} {other}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whether neighbors are found of all samples, or only where surfaces may end: of cards, slopes and points on their own.
    #[test]
    fn the_steps_are_those_of_all_points(seed in 0..1000_u64, cell in 1e-3..GAP, gap in 0.5 * GAP..2.0 * GAP) {
        let mut random = Random::new(seed);
        let mut points = card_and_wall(random.uniform(0.05, 0.4));
        points.extend(on_plane(&Vector3::new(random.uniform(-1.0, 1.0), 0.3, 1.0), random.uniform(1.0, 9.0)));
        points.extend((0..200).map(|_| Vector3::from_fn(|_, _| random.uniform(-4.0, 4.0))));
        let steps = edges::depth_steps(&points, cell, gap, SHARE);
        prop_assert_eq!(steps, VisiblePoints::new(&points, cell, gap).depth_steps(SHARE));
    }
}

#[test]
fn a_card_before_a_wall_ends_in_steps_all_around() {
    let steps = depth_steps(&card_and_wall(HALF));
    for step in &steps {
        let (near, far) = (flat(&step.near).amax(), flat(&step.far).amax());
        assert!(near < HALF && near > HALF - 2.0 * SPACING && far > HALF && far < HALF + GAP, "{near} {far}");
        assert!((step.near.z * step.distance - 2.0).abs() < 1e-9, "{}", step.distance);
    }
    for side in [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()] {
        assert!(steps.iter().filter(|step| flat(&step.near).dot(&side) > HALF - SPACING).count() >= 19, "{side}");
    }
}

#[test]
fn a_bent_wall_has_none_and_nothing_neither() {
    let ramp: Vec<_> = grid(SPACING).map(|ray| ray / ray.z * (3.0 + 2.0 * (ray.x / ray.z))).collect();
    // Not a plane: inverse distances bend, by less than a tenth a step.
    assert!(depth_steps(&ramp).is_empty());
    assert!(depth_steps(&[]).is_empty());
    assert!(depth_steps(&[Vector3::zeros(), Vector3::repeat(f64::NAN)]).is_empty());
}

#[test]
fn a_hidden_wall_is_uninformative() {
    let mut points = card_and_wall(HALF);
    let behind: Vec<_> = points.iter().map(|point| point * 3.0).collect();
    let alone = depth_steps(&points);
    points.extend(behind);
    assert_eq!(depth_steps(&points), alone);
}

/// Where a bearing meets the plane at distance 1.
fn flat(bearing: &Vector3<f64>) -> Vector2<f64> {
    bearing.xy() / bearing.z
}

/// A wall with a card painted on it, of another shade but for noise.
fn painted(half: f64, seed: u64) -> (Vec<Vector3<f64>>, Vec<f64>) {
    let points = on_plane(&Vector3::z(), 5.0);
    let mut random = Random::new(seed);
    let shade = |point: &Vector3<f64>| if flat(point).amax() < half { 30.0 } else { 10.0 };
    let shades = points.iter().map(|point| shade(point) + random.uniform(-1.0, 1.0)).collect();
    (points, shades)
}

#[test]
fn a_painted_card_ends_in_steps_of_shade_all_around_and_has_none_of_depth() {
    let (points, shades) = painted(HALF, 1);
    assert!(depth_steps(&points).is_empty());
    let steps = shade_steps(&points, &shades);
    for step in &steps {
        let sides = [step.near, step.far].map(|side| flat(&side).amax());
        assert!(sides[0].min(sides[1]) < HALF && sides[0].max(sides[1]) > HALF, "{sides:?}");
    }
    for side in [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()] {
        assert!(steps.iter().filter(|step| flat(&step.near).dot(&side) > HALF - SPACING).count() >= 19, "{side}");
    }
}

#[test]
fn the_scale_of_shades_does_not_count() {
    let (points, shades) = painted(HALF, 2);
    let other: Vec<f64> = shades.iter().map(|shade| 4.0 - 0.25 * shade).collect();
    assert_eq!(shade_steps(&points, &other), shade_steps(&points, &shades));
}

#[test]
fn one_shade_has_no_steps_and_neither_have_other_surfaces() {
    let (points, shades) = painted(HALF, 3);
    assert!(shade_steps(&points, &vec![7.0; points.len()]).is_empty());
    assert!(shade_steps(&points, &shades[1..]).is_empty());
    assert!(shade_steps(&[], &[]).is_empty());
    // The card stands before the wall: what lies on either side are two surfaces.
    let before = card_and_wall(HALF);
    let is_on_card = |point: &Vector3<f64>| point.z < 3.0;
    let shades: Vec<f64> = before.iter().map(|point| if is_on_card(point) { 30.0 } else { 10.0 }).collect();
    assert!(shade_steps(&before, &shades).is_empty());
}

#[test]
fn a_shade_that_is_no_number_leaves_the_rest_their_steps() {
    let (points, mut shades) = painted(HALF, 4);
    let all = shade_steps(&points, &shades).len();
    shades[0] = f64::NAN;
    assert!(shade_steps(&points, &shades).len().abs_diff(all) <= 8);
}

#[test]
fn a_picture_is_spread_by_its_weights_and_mirrored_beyond_its_sides() {
    assert_eq!(blurred(&[0.0, 0.0, 16.0, 0.0, 0.0, 0.0], 3, &[0.5, 0.25]), [0.0, 3.0, 9.0, 0.0, 1.0, 3.0]);
    // Weights that reach far beyond: whatever is mirrored, they leave what is the same all over as it is.
    assert_eq!(blurred(&[8.0; 6], 2, &[0.0, 0.125, 0.0, 0.125, 0.125, 0.125]), [8.0; 6]);
    assert_eq!(blurred(&[1.0, 2.0], 2, &[]), [1.0, 2.0]);
    assert!(blurred(&[], 2, &[1.0, 1.0]).is_empty() && blurred(&[1.0], 0, &[1.0]).is_empty());
}
