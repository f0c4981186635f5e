//! Rings of a planar region: what is accepted, what is refused, how nesting turns them.

use nalgebra::Vector2;
use proptest::prelude::*;
use regionpose::Error;
use regionpose::internals::budget::Budget;
use regionpose::internals::error::Contact;
use regionpose::internals::geometry::overlap::overlap_areas;
use regionpose::internals::geometry::rings::PlaneRings;

type Ring = Vec<Vector2<f64>>;

fn ring(points: &[[f64; 2]]) -> Ring {
    points.iter().map(|&[x, y]| Vector2::new(x, y)).collect()
}

/// Counter-clockwise square around `(x, y)`.
fn square(x: f64, y: f64, half: f64) -> Ring {
    ring(&[[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])
}

fn reversed(mut ring: Ring) -> Ring {
    ring.reverse();
    ring
}

fn circle(radius: f64, count: usize) -> Ring {
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / count as f64;
    (0..count).map(|k| radius * Vector2::new(angle(k).cos(), angle(k).sin())).collect()
}

fn signed_area(ring: &[Vector2<f64>]) -> f64 {
    (0..ring.len()).map(|k| 0.5 * ring[k].perp(&ring[(k + 1) % ring.len()])).sum()
}

#[test]
fn a_clockwise_square_is_turned_and_keeps_its_first_vertex() {
    let given = reversed(square(0.0, 0.0, 1.0));
    let region = PlaneRings::new(vec![given.clone()]).unwrap();
    assert_eq!(region.area(), 4.0);
    assert_eq!(region.rings()[0][0], given[0]);
    assert!(signed_area(&region.rings()[0]) > 0.0);
}

#[test]
fn repeated_vertices_and_the_closing_vertex_are_dropped() {
    let given = ring(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
    let region = PlaneRings::new(vec![given]).unwrap();
    assert_eq!(region.rings()[0], ring(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]));
    assert_eq!(region.edges().count(), 3);
}

#[test]
fn an_island_in_a_hole_is_an_outer_ring_again() {
    let rings = vec![square(0.0, 0.0, 1.0), square(0.0, 0.0, 3.0), square(0.0, 0.0, 2.0), square(9.0, 0.0, 1.0)];
    let region = PlaneRings::new(rings).unwrap();
    let turns: Vec<bool> = region.rings().iter().map(|ring| signed_area(ring) > 0.0).collect();
    assert_eq!(turns, [true, true, false, true]);
    assert_eq!(region.area(), 36.0 - 16.0 + 4.0 + 4.0);
    assert!(region.contains(Vector2::new(0.0, 0.5)) && region.contains(Vector2::new(2.5, 0.0)));
    assert!(!region.contains(Vector2::new(1.5, 0.0)) && !region.contains(Vector2::new(5.0, 0.0)));
}

#[test]
fn the_boundary_belongs_to_the_region() {
    let region = PlaneRings::polygon(vec![square(0.0, 0.0, 2.0), square(0.0, 0.0, 1.0)]).unwrap();
    for (x, y) in [(2.0, 2.0), (2.0, 0.3), (0.3, -2.0), (1.0, 0.3), (-1.0, -1.0), (0.25, 1.0)] {
        assert!(region.contains(Vector2::new(x, y)), "({x}, {y})");
    }
    for (x, y) in [(2.0 + 1e-15, 0.0), (0.0, 0.0), (1.0 - 1e-15, 0.3), (f64::NAN, 0.0), (f64::INFINITY, 0.0)] {
        assert!(!region.contains(Vector2::new(x, y)), "({x}, {y})");
    }
}

#[test]
fn a_bow_tie_names_both_edges_as_they_were_given() {
    let given = ring(&[[0.0, 0.0], [2.0, 2.0], [2.0, 2.0], [3.0, 0.0], [0.0, 2.0]]);
    let found = PlaneRings::new(vec![given]).unwrap_err();
    let needed =
        Error::Crossing { first_ring: 0, first_edge: 0, second_ring: 0, second_edge: 3, contact: Contact::Crosses };
    assert_eq!(found, needed);
    assert!(found.to_string().starts_with("edge 0 of ring 0 crosses edge 3 of ring 0"), "{found}");
}

#[test]
fn a_ring_may_not_touch_itself_nor_fold_back() {
    let contact = |points: &[[f64; 2]]| match PlaneRings::new(vec![ring(points)]) {
        Err(Error::Crossing { contact, .. }) => contact,
        other => panic!("{other:?}"),
    };
    let vertex_on_vertex = [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0], [2.0, 3.0], [1.0, 1.0], [0.0, 2.0]];
    assert_eq!(contact(&vertex_on_vertex), Contact::Touches);
    let vertex_on_edge = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.0], [0.0, 2.0]];
    assert_eq!(contact(&vertex_on_edge), Contact::Touches);
    let spike = [[0.0, 0.0], [3.0, 0.0], [2.0, 0.0], [2.0, 2.0]];
    assert_eq!(contact(&spike), Contact::Overlaps);
}

#[test]
fn rings_may_touch_at_points_but_not_cross_there() {
    let diamond = ring(&[[-2.0, 0.0], [0.0, -2.0], [2.0, 0.0], [0.0, 2.0]]);
    let outer = square(0.0, 0.0, 2.0);
    let inscribed = PlaneRings::polygon(vec![outer.clone(), diamond]).unwrap();
    assert_eq!(inscribed.area(), 8.0);
    let corner_to_corner = PlaneRings::new(vec![outer.clone(), square(3.0, 3.0, 1.0)]).unwrap();
    assert_eq!(corner_to_corner.area(), 20.0);
    let through_corners = ring(&[[-3.0, -3.0], [-2.0, -2.0], [0.0, -1.0], [2.0, 2.0], [3.0, 3.0], [-3.0, 3.0]]);
    assert!(matches!(PlaneRings::new(vec![outer.clone(), through_corners]), Err(Error::Crossing { .. })));
    let through_edge = ring(&[[1.0, 0.0], [2.0, 0.5], [3.0, 0.0], [2.0, 1.0]]);
    let found = PlaneRings::new(vec![outer.clone(), through_edge]).unwrap_err();
    assert!(matches!(found, Error::Crossing { contact: Contact::Crosses, .. }), "{found}");
    let shared_edge = PlaneRings::new(vec![outer, square(4.0, 0.0, 2.0)]).unwrap_err();
    assert!(matches!(shared_edge, Error::Crossing { contact: Contact::Overlaps, .. }), "{shared_edge}");
}

#[test]
fn a_ring_that_touches_its_hole_at_every_vertex_holds_it() {
    let outer = ring(&[[4.0, 3.0], [0.0, 3.0], [2.0, 2.0], [1.0, 0.0]]);
    let hole = ring(&[[2.0, 2.0], [3.0, 2.0], [1.0, 3.0]]);
    assert_eq!(PlaneRings::polygon(vec![outer, hole]).unwrap().area(), 3.0);
}

#[test]
fn rings_one_bit_apart_are_accepted_and_one_bit_over_refused() {
    let gap = |x: f64| ring(&[[x, -1.0], [5.0, 0.0], [x, 1.0]]);
    let outer = square(0.0, 0.0, 2.0);
    assert!(PlaneRings::new(vec![outer.clone(), gap(2.0_f64.next_up())]).is_ok());
    assert!(PlaneRings::new(vec![outer, gap(2.0_f64.next_down())]).is_err());
}

#[test]
fn a_lost_hole_is_refused() {
    let rings = vec![square(0.0, 0.0, 2.0), reversed(square(9.0, 0.0, 1.0))];
    assert_eq!(PlaneRings::new(rings.clone()), Err(Error::HoleOutside { ring: 1 }));
    let all_clockwise = rings.into_iter().enumerate().map(|(k, r)| if k == 0 { reversed(r) } else { r }).collect();
    assert!(PlaneRings::new(all_clockwise).is_ok());
}

#[test]
fn a_polygon_takes_holes_only_directly_inside_its_outline() {
    let outer = square(0.0, 0.0, 4.0);
    let outside = vec![outer.clone(), square(9.0, 0.0, 1.0)];
    assert_eq!(PlaneRings::polygon(outside), Err(Error::HoleOutside { ring: 1 }));
    let around = vec![outer.clone(), square(0.0, 0.0, 5.0)];
    assert_eq!(PlaneRings::polygon(around), Err(Error::HoleOutside { ring: 1 }));
    let nested = vec![outer, square(0.0, 0.0, 1.0), square(0.0, 0.0, 2.0)];
    assert_eq!(PlaneRings::polygon(nested), Err(Error::NestedHole { ring: 1, outer: 2 }));
}

#[test]
fn rings_without_extent_are_refused() {
    assert_eq!(PlaneRings::new(vec![]), Err(Error::NoRings));
    assert_eq!(PlaneRings::new(vec![vec![]]), Err(Error::TooFewVertices { ring: 0, found: 0 }));
    let back_and_forth = ring(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]);
    assert_eq!(PlaneRings::new(vec![back_and_forth]), Err(Error::TooFewVertices { ring: 0, found: 2 }));
    let line = ring(&[[0.0, 0.0], [1.0, 0.0], [2.0, 1e-13]]);
    assert!(matches!(PlaneRings::new(vec![line]), Err(Error::ZeroArea { ring: 0, .. })));
    let broken = ring(&[[0.0, 0.0], [1.0, f64::NAN], [2.0, 0.0]]);
    let found = PlaneRings::new(vec![square(0.0, 0.0, 1.0), broken]).unwrap_err();
    assert!(found.to_string().starts_with("ring 1 vertex 1 is not finite: NaN"), "{found}");
}

#[test]
fn sizes_that_would_overflow_or_underflow_are_refused() {
    for half in [1e300, 1e61, 1e-70, 1e-300] {
        assert!(PlaneRings::new(vec![square(0.0, 0.0, half)]).is_err(), "{half:e}");
    }
    for half in [1e60, 1e-60] {
        assert!(PlaneRings::new(vec![square(0.0, 0.0, half)]).is_ok(), "{half:e}");
    }
}

#[test]
fn ten_thousand_vertices_in_thin_teeth_make_a_ring() {
    let comb = |along: usize| -> Ring {
        let mut tips: Ring =
            (0..5000).flat_map(|k| [[k as f64, 0.0], [k as f64 + 0.5, 9000.0]]).map(Vector2::from).collect();
        tips.extend([Vector2::new(5000.0, -1.0), Vector2::new(0.0, -1.0)]);
        tips.into_iter().map(|p| if along == 0 { p } else { p.yx() }).collect()
    };
    for region in [circle(1.0, 10_000), comb(0), comb(1)] {
        let count = region.len();
        assert_eq!(PlaneRings::new(vec![region]).unwrap().rings()[0].len(), count);
    }
}

/// Any float at all, special values included.
fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), -2.0..2.0_f64, (-3..3).prop_map(f64::from), Just(f64::MAX), Just(5e-324), Just(f64::NAN)]
}

fn ring_of(value: impl Strategy<Value = f64>, count: std::ops::Range<usize>) -> impl Strategy<Value = Ring> {
    let point = proptest::collection::vec(value, 2).prop_map(|v| Vector2::new(v[0], v[1]));
    proptest::collection::vec(point, count)
}

/// A star-shaped ring: one radius for each of evenly spaced directions.
fn star() -> impl Strategy<Value = Ring> {
    proptest::collection::vec(0.2..1.0_f64, 3..40).prop_map(|radii| {
        let turned = circle(1.0, radii.len());
        turned.into_iter().zip(radii).map(|(direction, radius)| radius * direction).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_panics(rings in proptest::collection::vec(ring_of(wild(), 0..7), 0..4), x in wild(), y in wild()) {
        let _ = PlaneRings::polygon(rings.clone());
        if let Ok(region) = PlaneRings::new(rings) {
            prop_assert!(region.area() > 0.0);
            region.contains(Vector2::new(x, y));
        }
    }

    #[test]
    fn small_whole_numbers_are_judged_like_by_brute_force(
        given in ring_of((0..5).prop_map(f64::from), 4..7)
    ) {
        let count = given.len();
        let distinct = (0..count).all(|k| (0..k).all(|m| given[k] != given[m]));
        if !distinct || signed_area(&given) == 0.0 {
            return Ok(());
        }
        let meets = |k: usize, m: usize| {
            let (a, b, c, d) = (given[k], given[(k + 1) % count], given[m], given[(m + 1) % count]);
            let cross = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| (q - p).perp(&(r - p));
            let on = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| cross(p, q, r) == 0.0 && (r - p).dot(&(r - q)) <= 0.0;
            let proper = cross(a, b, c) * cross(a, b, d) < 0.0 && cross(c, d, a) * cross(c, d, b) < 0.0;
            if b == c { on(a, b, d) || on(c, d, a) }
            else if d == a { on(a, b, c) || on(c, d, b) }
            else { proper || on(a, b, c) || on(a, b, d) || on(c, d, a) || on(c, d, b) }
        };
        let simple = (0..count).all(|k| (0..k).all(|m| !meets(m, k)));
        prop_assert_eq!(PlaneRings::new(vec![given]).is_ok(), simple);
    }

    #[test]
    fn two_rings_are_accepted_when_they_share_none_or_all_of_the_smaller(
        first in ring_of((0..5).prop_map(f64::from), 3..5), second in ring_of((0..5).prop_map(f64::from), 3..5)
    ) {
        let upright = |ring: &Ring| if signed_area(ring) < 0.0 { reversed(ring.clone()) } else { ring.clone() };
        let rings = [upright(&first), upright(&second)];
        let [Ok(a), Ok(b)] = [0, 1].map(|k| PlaneRings::new(vec![rings[k].clone()])) else { return Ok(()) };
        let areas = overlap_areas(&a, &b, &Budget::unlimited());
        let shares_part = areas.intersection > 1e-9 && areas.only_observed.min(areas.only_predicted) > 1e-9;
        match PlaneRings::new(rings.to_vec()) {
            Ok(both) => {
                prop_assert!(!shares_part);
                let nested = areas.intersection > 1e-9;
                let sum = if nested { (a.area() - b.area()).abs() } else { a.area() + b.area() };
                prop_assert!((both.area() - sum).abs() < 1e-12);
            }
            Err(Error::Crossing { contact, .. }) => prop_assert!(shares_part || contact == Contact::Overlaps),
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn many_rings_turn_by_how_many_are_around_them(
        shapes in proptest::collection::vec((0..12_i32, 0..12_i32, 1..7_i32, 0..4_usize, any::<bool>()), 1..40)
    ) {
        let mut kept: Vec<Ring> = Vec::new();
        for (x, y, size, corners, turned) in shapes {
            let corner = |dx: i32, dy: i32| Vector2::new(f64::from(x + size * dx), f64::from(y + size * dy));
            let all = [corner(1, 0), corner(0, 1), corner(-1, 0), corner(0, -1)];
            // A diamond, or half of one.
            let shape: Ring = if corners == 0 { all.to_vec() } else { all.into_iter().cycle().skip(corners).take(3).collect() };
            let outer_turns = kept.iter().chain([&shape]).cloned().collect();
            if PlaneRings::new(outer_turns).is_err() {
                continue;
            }
            let alone = |ring: &Ring| PlaneRings::new(vec![ring.clone()]).unwrap();
            let around = kept.iter().any(|ring| overlap_areas(&alone(ring), &alone(&shape), &Budget::unlimited()).intersection > 0.0);
            kept.push(if turned && around { reversed(shape) } else { shape });
        }
        let alone: Vec<PlaneRings> = kept.iter().map(|ring| PlaneRings::new(vec![ring.clone()]).unwrap()).collect();
        let holds = |outer: &PlaneRings, inner: &PlaneRings| {
            let areas = overlap_areas(outer, inner, &Budget::unlimited());
            outer.area() > inner.area() && areas.intersection > areas.only_predicted
        };
        let expected: Vec<f64> = alone.iter().map(|ring| {
            let depth = alone.iter().filter(|outer| holds(outer, ring)).count();
            if depth % 2 == 0 { ring.area() } else { -ring.area() }
        }).collect();
        let Ok(all) = PlaneRings::new(kept) else { return Ok(()) };
        let found: Vec<f64> = all.rings().iter().map(|ring| signed_area(ring)).collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn a_star_with_a_shrunken_hole_keeps_its_difference_of_areas(outer in star(), scale in 0.1..0.9_f64, shift in 0usize..40) {
        let mut hole: Ring = outer.iter().map(|p| scale * p).collect();
        let count = hole.len();
        hole.rotate_left(shift % count);
        prop_assume!(signed_area(&outer) > 1e-3);
        if let Ok(region) = PlaneRings::polygon(vec![outer.clone(), hole]) {
            let expected = (1.0 - scale * scale) * signed_area(&outer);
            prop_assert!((region.area() - expected).abs() < 1e-13);
            prop_assert_eq!(region.contains(Vector2::zeros()), false);
        } else {
            prop_assert!(count < 5, "a star around the origin has no crossing");
        }
    }
}
