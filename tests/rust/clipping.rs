//! What two regions share, against another library and in closed form.

use i_overlay::core::{fill_rule::FillRule, overlay_rule::OverlayRule};
use i_overlay::float::single::SingleFloatOverlay;
use nalgebra::Vector2;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::clipping::{Window, intersection};
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::moments::plane::planar_moments;

use crate::support::random::Random;
use crate::support::scene::{Ring, pierced_star, rectangle, star};

/// Sums over the same outlines in another order differ by rounding.
const ROUNDING: f64 = 1e-12;

/// Area of regions of size one by which the other library, which rounds points to a grid, may differ.
const OF_GRID: f64 = 1e-9;

fn area(rings: &[Ring]) -> f64 {
    planar_moments(rings.iter().map(Vec::as_slice), 0).get(0, 0)
}

/// The area of a boolean operation of two regions, by the other library.
fn area_by_grid(rule: OverlayRule, first: &[Ring], second: &[Ring]) -> f64 {
    let [first, second]: [Vec<Vec<[f64; 2]>>; 2] =
        [first, second].map(|rings| rings.iter().map(|ring| ring.iter().map(|&p| p.into()).collect()).collect());
    let shapes = first.overlay_as::<i64>(&second, rule, FillRule::EvenOdd);
    let rings: Vec<Ring> =
        shapes.into_iter().flatten().map(|ring| ring.into_iter().map(Vector2::from).collect()).collect();
    area(&rings)
}

/// Asserts that an intersection covers what the other library's does, and that its border lies on the second region.
fn assert_shared(seed: u64, first: &PlaneRings, second: &PlaneRings) {
    let shared = intersection(first.rings(), second.rings(), &Budget::unlimited());
    let expected = area_by_grid(OverlayRule::Intersect, first.rings(), second.rings());
    let found = area(&shared.rings);
    assert!((found - expected).abs() < OF_GRID, "seed {seed}: {found}, {expected} by the other library");
    let all = area_by_grid(OverlayRule::Intersect, &shared.rings, first.rings());
    let both = area_by_grid(OverlayRule::Intersect, &shared.rings, second.rings());
    assert!(
        (all - expected).abs() < OF_GRID && (both - expected).abs() < OF_GRID,
        "seed {seed}: {expected} {all} {both}"
    );
    let on_second = |p: &Vector2<f64>| {
        second.edges().any(|(a, b)| {
            let share = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
            (a.lerp(&b, share) - p).norm() < ROUNDING
        })
    };
    assert!(shared.border.iter().flatten().all(on_second), "seed {seed}: border edges lie on the second region");
}

#[test]
fn stars_share_what_another_library_finds() {
    for seed in 0..40 {
        let random = &mut Random::new(seed);
        let first = PlaneRings::new(pierced_star(random, 9, 1.0)).unwrap();
        let shift = Vector2::new(random.uniform(-0.8, 0.8), random.uniform(-0.8, 0.8));
        let second = star(random, [7, 90][seed as usize % 2], 1.0).iter().map(|p| p + shift).collect();
        assert_shared(seed, &first, &PlaneRings::new(vec![second]).unwrap());
    }
}

/// Vertices of a coarse grid, on which edges touch and coincide.
#[test]
fn stars_of_a_grid_share_what_another_library_finds() {
    let mut compared = 0;
    for seed in 0..400 {
        let random = &mut Random::new(seed);
        let cells = [4.0, 8.0][seed as usize % 2];
        let snapped = |ring: Ring| -> Ring { ring.iter().map(|p| p.map(|x| (x * cells).round() / cells)).collect() };
        let [first, second] = [9, 12].map(|count| PlaneRings::new(vec![snapped(star(random, count, 1.0))]));
        if let (Ok(first), Ok(second)) = (first, second) {
            assert_shared(seed, &first, &second);
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared}");
}

/// More rings than one on both sides, some of which hold others, cross them or share their edges.
#[test]
fn many_rings_share_what_another_library_finds() {
    for seed in 0..40 {
        let random = &mut Random::new(seed);
        let [first, second] = [5, 6].map(|cells: usize| {
            let width = 2.0 / cells as f64;
            let rings = (0..cells * cells).flat_map(|k| {
                let middle = Vector2::new((k / cells) as f64 + 0.5, (k % cells) as f64 + 0.5) * width;
                let size = random.uniform(0.3, 0.99) * width;
                [1.0, 0.5].map(|share| rectangle(share * size, share * size).iter().map(|p| p + middle).collect())
            });
            PlaneRings::new(rings.collect()).unwrap()
        });
        assert_shared(seed, &first, &second);
    }
}

#[test]
fn outlines_that_touch_or_coincide_share_what_they_should() {
    let square = |x: f64, y: f64| rectangle(1.0, 1.0).iter().map(|p| p + Vector2::new(x, y)).collect::<Ring>();
    let shared = |other: Ring| area(&intersection(&[square(0.0, 0.0)], &[other], &Budget::unlimited()).rings);
    let corners = [[0.0, -0.5], [0.5, 0.0], [0.0, 0.5], [-0.5, 0.0]].map(|[x, y]| Vector2::new(x, y)).to_vec();
    for (other, expected) in [
        (square(0.0, 0.0), 1.0),
        (square(1.0, 0.0), 0.0),
        (square(0.0, -1.0), 0.0),
        (square(1.0, 1.0), 0.0),
        (square(0.5, 0.0), 0.5),
        (square(0.0, 0.25), 0.75),
        (rectangle(3.0, 1.0), 1.0),
        (rectangle(0.5, 0.5), 0.25),
        (corners, 0.5),
    ] {
        let found = shared(other.clone());
        assert!((found - expected).abs() < ROUNDING, "{other:?}: {found}");
    }
}

#[test]
fn a_hole_that_the_border_cuts_is_left_out() {
    let outer = rectangle(2.0, 2.0);
    let hole: Ring = rectangle(1.0, 1.0).into_iter().rev().collect();
    let half = rectangle(2.0, 4.0).iter().map(|p| p + Vector2::new(1.0, 0.0)).collect();
    let shared = intersection(&[outer, hole], &[half], &Budget::unlimited());
    assert!((area(&shared.rings) - 1.5).abs() < ROUNDING);
    let border: f64 = shared.border.iter().map(|[a, b]| (b - a).norm()).sum();
    assert!((border - 1.0).abs() < ROUNDING, "the border is seen on both sides of the hole: {border}");
}

/// A comb of a hundred teeth against a slab across them, each of them cutting the other.
#[test]
fn many_edges_share_what_few_do() {
    let teeth = 100;
    let tooth = |k: usize| [(0.0, 0.0), (0.5, 0.0), (0.5, 2.0), (0.0, 2.0)].map(|(x, y)| Vector2::new(k as f64 + x, y));
    let comb: Vec<Ring> = (0..teeth).map(|k| tooth(k).to_vec()).collect();
    let slab = vec![rectangle(300.0, 1.0).iter().map(|p| p + Vector2::new(0.0, 1.0)).collect::<Ring>()];
    let length = |border: &[[Vector2<f64>; 2]]| border.iter().map(|[a, b]| (b - a).norm()).sum::<f64>();
    for (first, second, edges, border) in
        [(&comb, &slab, 2 * teeth, teeth as f64), (&slab, &comb, 2 * teeth, 2.0 * teeth as f64)]
    {
        let window = Window::new(second.clone());
        assert_eq!(window.edge_count(), 4 * second.len());
        let shared = window.shared_with(first, &Budget::unlimited());
        assert_eq!((shared.rings.len(), shared.border.len()), (teeth, edges));
        assert!((area(&shared.rings) - 0.5 * teeth as f64).abs() < 1e-9, "{}", area(&shared.rings));
        assert!((length(&shared.border) - border).abs() < 1e-9, "{}", length(&shared.border));
        // It is not used up.
        assert_eq!(window.shared_with(first, &Budget::unlimited()), shared);
    }
}
