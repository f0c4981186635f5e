//! Moments through the public interface: exact cases, laws over random regions, and independent quadrature.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Rotation3, Vector2, Vector3, vector};
use proptest::prelude::*;
use regionpose::moments::mesh::{
    mesh_plane_moments, mesh_sphere_moments, triangle_plane_moments, triangle_sphere_moments,
};
use regionpose::moments::pixels::{pixel_moments, quad_solid_angles};
use regionpose::moments::plane::{planar_moments, ring_moments};
use regionpose::moments::sphere::{solid_angle, spherical_moments};
use regionpose::moments::{MAX_ORDER, PlaneMoments, SphereMoments};

/// Error allowed of exact sums over up to a hundred edges, relative to the largest moment.
const EXACT: f64 = 1e-12;

/// Error allowed where a value is one closed form: some roundings.
const ROUNDING: f64 = 1e-14;

/// Error allowed of the 7-point rule on pieces a twelfth of a radian wide (measured: 1e-10).
const TWELVE_CUTS: f64 = 1e-8;

/// Gauss-Legendre nodes and weights on [0, 1], by Newton steps from Chebyshev points.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..10 {
            let (mut before, mut value) = (1.0, x);
            for k in 2..=count {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
            }
            slope = count as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

/// Spherical moments of triangles by a Gauss product rule with one corner of the square pressed together (Duffy).
fn brute_force(triangles: &[[Vector3<f64>; 3]], order: usize, nodes: usize) -> SphereMoments {
    let rule = gauss(nodes);
    let mut moments = SphereMoments::zero(order);
    for [a, b, c] in triangles {
        let volume = a.dot(&b.cross(c));
        for (u, u_weight) in &rule {
            for (v, v_weight) in &rule {
                let point = a + *u * (b - a) + u * v * (c - b);
                let r = point.normalize();
                let element = u_weight * v_weight * u * volume / point.norm().powi(3);
                add_monomials(&mut moments, &r, element);
            }
        }
    }
    moments
}

fn add_monomials(moments: &mut SphereMoments, r: &Vector3<f64>, weight: f64) {
    let order = moments.order();
    let mut index = 0;
    for k in 0..=order {
        for p in 0..=k {
            for n in 0..=p {
                moments.values_mut()[index] +=
                    weight * r.x.powi((k - p) as i32) * r.y.powi((p - n) as i32) * r.z.powi(n as i32);
                index += 1;
            }
        }
    }
}

/// Largest difference of two lists of moments over the largest moment.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, |worst: f64, gap| {
        assert!(!gap.is_nan(), "a moment is NaN");
        worst.max(gap)
    });
    if worst == 0.0 { 0.0 } else { worst / largest }
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    let error = difference(found, expected);
    assert!(error < tolerance, "relative difference {error:.2e}, allowed {tolerance:.0e}");
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

/// Gamma(n / 2), n at least 1.
fn gamma_of_half(n: usize) -> f64 {
    match n {
        1 => PI.sqrt(),
        2 => 1.0,
        _ => (n as f64 / 2.0 - 1.0) * gamma_of_half(n - 2),
    }
}

/// Moments over the octant of positive coordinates: `G(l) G(m) G(n) / (4 Gamma((l + m + n + 3) / 2))`,
/// `G(l) = Gamma((l + 1) / 2)`.
fn octant_moment(l: usize, m: usize, n: usize) -> f64 {
    gamma_of_half(l + 1) * gamma_of_half(m + 1) * gamma_of_half(n + 1) / (4.0 * gamma_of_half(l + m + n + 3))
}

fn check_octants(order: usize, moments: &SphereMoments, expected: impl Fn(usize, usize, usize) -> f64) {
    for l in 0..=order {
        for m in 0..=order - l {
            for n in 0..=order - l - m {
                let gap = moments.get(l, m, n) - expected(l, m, n);
                assert!(gap.abs() < ROUNDING * 8.0 * FRAC_PI_2, "order {order}, x^{l} y^{m} z^{n}: off by {gap:.1e}");
            }
        }
    }
}

fn area_sum(pieces: &[SphereMoments]) -> Vec<f64> {
    (0..pieces[0].values().len()).map(|i| pieces.iter().map(|piece| piece.values()[i]).sum()).collect()
}

/// Vertices at rising angles around the origin with the given radii.
fn star(radii: &[f64]) -> Vec<Vector2<f64>> {
    let vertex = |(i, radius): (usize, &f64)| {
        let angle = TAU * i as f64 / radii.len() as f64;
        Vector2::new(radius * angle.cos(), radius * angle.sin())
    };
    radii.iter().enumerate().map(vertex).collect()
}

/// Bearings at those angular distances (rad) from the turned z axis.
fn bearing_star(angles: &[f64], turn: &Rotation3<f64>) -> Vec<Vector3<f64>> {
    let bearing = |(point, angle): (Vector2<f64>, &f64)| turn * vector![point.x, point.y, angle.cos()];
    star(&angles.iter().map(|angle| angle.sin()).collect::<Vec<_>>()).into_iter().zip(angles).map(bearing).collect()
}

/// Triangles from `center` to every edge of the ring.
fn fan<P: Copy>(center: P, ring: &[P]) -> Vec<[P; 3]> {
    (0..ring.len()).map(|i| [center, ring[i], ring[(i + 1) % ring.len()]]).collect()
}

/// A list of triangles as vertices and indices.
fn as_mesh<P: Copy>(triangles: &[[P; 3]]) -> (Vec<P>, Vec<[usize; 3]>) {
    (triangles.concat(), (0..triangles.len()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

fn reversed<P: Copy>(ring: &[P]) -> Vec<P> {
    ring.iter().rev().copied().collect()
}

fn unit_square() -> Vec<Vector2<f64>> {
    vec![vector![0.0, 0.0], vector![1.0, 0.0], vector![1.0, 1.0], vector![0.0, 1.0]]
}

#[test]
fn the_unit_square_has_moments_one_over_i_plus_1_times_j_plus_1() {
    for order in 0..=MAX_ORDER {
        let moments = planar_moments([&unit_square()[..]], order);
        for i in 0..=order {
            for j in 0..=order - i {
                let expected = 1.0 / ((i + 1) * (j + 1)) as f64;
                assert!((moments.get(i, j) - expected).abs() < ROUNDING, "order {order}, x^{i} y^{j}");
            }
        }
    }
}

#[test]
fn a_far_square_keeps_its_digits() {
    let corner = vector![100.0, -70.0];
    let ring: Vec<_> = unit_square().iter().map(|vertex| vertex + corner).collect();
    let moments = planar_moments([&ring[..]], MAX_ORDER);
    let power_integral = |start: f64, i: usize| -> f64 {
        gauss(5).iter().map(|(node, weight)| weight * (start + node).powi(i as i32)).sum()
    };
    for i in 0..=MAX_ORDER {
        for j in 0..=MAX_ORDER - i {
            let expected = power_integral(corner.x, i) * power_integral(corner.y, j);
            let gap = (moments.get(i, j) - expected).abs() / expected.abs();
            assert!(gap < EXACT, "x^{i} y^{j}: relative error {gap:.1e}");
        }
    }
}

#[test]
fn a_square_with_a_square_hole_is_the_difference() {
    let hole: Vec<_> = unit_square().iter().map(|vertex| vertex * 0.5 + vector![0.25, 0.3]).collect();
    let pierced = planar_moments([&unit_square()[..], &reversed(&hole)], 6);
    let whole = planar_moments([&unit_square()[..]], 6);
    let missing = planar_moments([&hole[..]], 6);
    let expected: Vec<_> = whole.values().iter().zip(missing.values()).map(|(a, b)| a - b).collect();
    assert_close(pierced.values(), &expected, EXACT);
    assert!((pierced.get(0, 0) - 0.75).abs() < ROUNDING);
}

#[test]
fn the_unit_triangle_follows_the_beta_integral() {
    let triangle = [vector![0.0, 0.0], vector![1.0, 0.0], vector![0.0, 1.0]];
    let by_recursion = triangle_plane_moments(&triangle, MAX_ORDER);
    let by_boundary = planar_moments([&triangle[..]], MAX_ORDER);
    for i in 0..=MAX_ORDER {
        for j in 0..=MAX_ORDER - i {
            let expected = factorial(i) * factorial(j) / factorial(i + j + 2);
            assert!((by_recursion.get(i, j) - expected).abs() < ROUNDING, "recursion, x^{i} y^{j}");
            assert!((by_boundary.get(i, j) - expected).abs() < ROUNDING, "boundary, x^{i} y^{j}");
        }
    }
}

#[test]
fn a_lower_order_leaves_higher_moments_alone() {
    let mut moments = PlaneMoments::zero(5);
    moments.values_mut()[20] = 7.0;
    ring_moments(&unit_square(), 3, &mut moments);
    assert_eq!(moments.values()[10..20], [0.0; 10]);
    assert_eq!(moments.values()[20], 7.0);
    assert!((moments.get(2, 1) - 1.0 / 6.0).abs() < ROUNDING);
}

#[test]
fn an_octant_has_solid_angle_half_pi_and_gamma_function_moments() {
    let ring = [Vector3::x(), Vector3::y(), Vector3::z()];
    assert!((solid_angle(&ring) - FRAC_PI_2).abs() < ROUNDING);
    for order in 0..=MAX_ORDER {
        check_octants(order, &spherical_moments([&ring[..]], order), octant_moment);
    }
}

#[test]
fn the_eight_octants_tile_the_sphere() {
    let octant = |signs: [f64; 3]| {
        let mut ring: Vec<_> = (0..3).map(|c| signs[c] * Vector3::ith(c, 1.0)).collect();
        if signs.iter().product::<f64>() < 0.0 {
            ring.reverse();
        }
        spherical_moments([&ring[..]], MAX_ORDER)
    };
    let signs = |bits: usize| [0, 1, 2].map(|c| if bits >> c & 1 == 0 { 1.0 } else { -1.0 });
    let octants: Vec<_> = (0..8).map(|bits| octant(signs(bits))).collect();
    let mut sphere = SphereMoments::zero(MAX_ORDER);
    sphere.values_mut().copy_from_slice(&area_sum(&octants));
    assert!((sphere.get(0, 0, 0) - 4.0 * PI).abs() < 8.0 * ROUNDING);
    let even = |l: usize, m: usize, n: usize| l % 2 + m % 2 + n % 2 == 0;
    check_octants(MAX_ORDER, &sphere, |l, m, n| if even(l, m, n) { 8.0 * octant_moment(l, m, n) } else { 0.0 });
}

#[test]
fn a_hemisphere_has_solid_angle_two_pi_at_most() {
    // A ring just above the equator: arcs of 60 deg between vertices 1e-6 rad above it.
    let ring = bearing_star(&[FRAC_PI_2 - 1e-6; 6], &Rotation3::identity());
    let moments = spherical_moments([&ring[..]], 2);
    let gap = TAU - moments.get(0, 0, 0);
    assert!(gap > 0.0 && gap < 1e-5, "gap {gap:.2e}");
    assert!((moments.get(0, 0, 1) - PI).abs() < 1e-5);
}

#[test]
fn patches_from_a_thousandth_to_six_steradians_match_quadrature() {
    // (angular radius, vertices, nodes of the quadrature): from 0.0007 to 6 sr, arcs from 0.2 to 60 deg.
    let cases =
        [(0.018, 5, 12), (0.018, 40, 12), (0.3, 6, 16), (0.7, 9, 20), (1.2, 7, 40), (1.5, 6, 60), (1.56, 60, 60)];
    let turn = Rotation3::from_euler_angles(0.7, -1.1, 2.3);
    for (radius, count, nodes) in cases {
        let angles: Vec<_> = (0..count).map(|i| radius * if i % 2 == 0 { 1.0 } else { 0.96 }).collect();
        let ring = bearing_star(&angles, &turn);
        let triangles = fan(turn * Vector3::z(), &ring);
        for order in 0..=MAX_ORDER {
            let expected = brute_force(&triangles, order, nodes);
            let found = spherical_moments([&ring[..]], order);
            let error = difference(found.values(), expected.values());
            assert!(error < EXACT, "radius {radius}, {count} vertices, order {order}: {error:.1e}");
        }
    }
}

#[test]
fn a_pierced_patch_and_a_distant_one_add_up() {
    let turn = Rotation3::from_euler_angles(0.2, 0.4, -0.3);
    let outer = bearing_star(&[0.5; 12], &turn);
    let hole = bearing_star(&[0.2, 0.25, 0.1, 0.15], &turn);
    let island = bearing_star(&[0.1; 5], &(turn * Rotation3::from_euler_angles(0.9, 0.0, 0.0)));
    let found = spherical_moments([&outer[..], &reversed(&hole), &island], 5);
    let alone = |ring: &[Vector3<f64>]| spherical_moments([ring], 5);
    let expected = area_sum(&[alone(&outer), alone(&reversed(&hole)), alone(&island)]);
    assert_close(found.values(), &expected, EXACT);
    assert!(alone(&reversed(&hole)).get(0, 0, 0) < 0.0);
}

#[test]
fn repeated_bearings_and_empty_rings_add_nothing() {
    let ring = bearing_star(&[0.3, 0.2, 0.4, 0.3, 0.25], &Rotation3::identity());
    let doubled: Vec<_> = ring.iter().flat_map(|bearing| [*bearing; 3]).collect();
    let found = spherical_moments([&[][..], &doubled, &[Vector3::z(); 4]], 8);
    assert_close(found.values(), spherical_moments([&ring[..]], 8).values(), EXACT);
    for order in 0..=MAX_ORDER {
        assert!(spherical_moments([&[][..]], order).values().iter().all(|&value| value == 0.0));
        assert!(planar_moments([&[][..]], order).values().iter().all(|&value| value == 0.0));
        assert!(spherical_moments([&[Vector3::x(); 3][..]], order).values().iter().all(|&value| value == 0.0));
    }
}

#[test]
fn arcs_of_every_length_equal_their_pieces() {
    // Regular rings 80 deg from the axis, arcs from 117 deg to 2 deg, against the same arcs cut in 16.
    let turn = Rotation3::from_euler_angles(1.0, 2.0, 3.0);
    for count in 3..180 {
        let ring = bearing_star(&vec![80.0_f64.to_radians(); count], &turn);
        let pieces = |i: usize| (0..16).map(move |piece| (i, piece as f64 / 16.0));
        let cut = |(i, place): (usize, f64)| ring[i].slerp(&ring[(i + 1) % count], place);
        let fine: Vec<_> = (0..count).flat_map(pieces).map(cut).collect();
        for order in [2, 5, 8] {
            let found = spherical_moments([&ring[..]], order);
            let error = difference(found.values(), spherical_moments([&fine[..]], order).values());
            assert!(error < EXACT, "{count} vertices, order {order}: {error:.1e}");
        }
    }
}

#[test]
fn triangle_quadrature_nears_the_boundary_sum_with_the_sixth_power() {
    let corners = [vector![0.1, -0.2, 2.0], vector![1.4, 0.1, 1.5], vector![0.2, 1.0, 1.8]];
    let ring = corners.map(|corner| corner.normalize());
    let exact = spherical_moments([&ring[..]], 5);
    let error = |cuts| difference(triangle_sphere_moments(&corners, 5, cuts).values(), exact.values());
    let (coarse, fine) = (error(2), error(4));
    assert!(coarse < 1e-4 && coarse > 30.0 * fine, "errors {coarse:.1e} and {fine:.1e}");
    assert!(error(40) < EXACT, "error {:.1e}", error(40));
    let flipped = [corners[0], corners[2], corners[1]];
    assert!(triangle_sphere_moments(&flipped, 5, 2).get(0, 0, 0) < 0.0);
    assert_eq!(triangle_sphere_moments(&corners, 3, 0), triangle_sphere_moments(&corners, 3, 1));
}

#[test]
fn a_triangle_seen_edge_on_has_no_moments() {
    let flat = [vector![1.0, 0.0, 1.0], vector![2.0, 0.0, 1.0], vector![-1.0, 0.0, -1.0]];
    assert_eq!(triangle_sphere_moments(&flat, 3, 2), SphereMoments::zero(3));
}

#[test]
fn a_mesh_with_a_wrong_index_is_refused_by_name() {
    let error = mesh_plane_moments(&unit_square(), &[[0, 1, 2], [0, 2, 4]], 2).unwrap_err();
    let message = "a triangle's vertex index is 4 (triangle 1); it needs to be below the number of vertices, 4";
    assert_eq!(error.to_string(), message);
    assert!(mesh_sphere_moments(&[Vector3::z()], &[[0, 0, 1]], 2, 1).is_err());
}

/// Bearings and solid angles of `count` times `count` pixels of the square |x|, |y| < 1/2 on z = 1.
fn square_pixels(count: usize) -> (Vec<Vector3<f64>>, Vec<f64>) {
    let bearing = |u: f64, v: f64| vector![u / count as f64 - 0.5, v / count as f64 - 0.5, 1.0].normalize();
    let places = (0..count * count).map(|i| ((i % count) as f64, (i / count) as f64));
    let corners = |(u, v)| [bearing(u, v), bearing(u + 1.0, v), bearing(u + 1.0, v + 1.0), bearing(u, v + 1.0)];
    let quads: Vec<_> = places.clone().map(corners).collect();
    (places.map(|(u, v)| bearing(u + 0.5, v + 0.5)).collect(), quad_solid_angles(&quads))
}

#[test]
fn pixel_sums_near_the_boundary_sum_with_the_square_of_the_pixel() {
    let ring = unit_square().into_iter().map(|corner| vector![corner.x - 0.5, corner.y - 0.5, 1.0].normalize());
    let exact = spherical_moments([&ring.collect::<Vec<_>>()[..]], 4);
    let error = |count| {
        let (bearings, solid_angles) = square_pixels(count);
        let moments = pixel_moments(&bearings, &solid_angles, 4).unwrap();
        assert!((moments.get(0, 0, 0) - exact.get(0, 0, 0)).abs() < EXACT, "pixels tile");
        difference(moments.values(), exact.values())
    };
    let (coarse, fine) = (error(20), error(40));
    assert!(coarse < 1e-3 && (coarse / fine - 4.0).abs() < 0.1, "errors {coarse:.2e} and {fine:.2e}");
    assert!(pixel_moments(&[Vector3::z()], &[], 2).is_err());
}

fn radii() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.3..1.0_f64, 3..40)
}

fn rotation() -> impl Strategy<Value = Rotation3<f64>> {
    (-PI..PI, -PI..PI, -PI..PI).prop_map(|(roll, pitch, yaw)| Rotation3::from_euler_angles(roll, pitch, yaw))
}

proptest! {
    #[test]
    fn boundary_and_mesh_agree_in_the_plane(radii in radii(), x in -2.0..2.0_f64, y in -2.0..2.0_f64, order in 0..=MAX_ORDER) {
        let offset = vector![x, y];
        let ring: Vec<_> = star(&radii).iter().map(|vertex| vertex + offset).collect();
        let (vertices, triangles) = as_mesh(&fan(offset, &ring));
        let mesh = mesh_plane_moments(&vertices, &triangles, order).unwrap();
        assert_close(planar_moments([&ring[..]], order).values(), mesh.values(), EXACT);
        let mut direct = PlaneMoments::zero(order);
        ring_moments(&ring, order, &mut direct);
        assert_close(direct.values(), mesh.values(), EXACT);
    }

    #[test]
    fn shifting_moments_is_shifting_the_ring(radii in radii(), x in -3.0..3.0_f64, y in -3.0..3.0_f64, order in 0..=MAX_ORDER) {
        let ring = star(&radii);
        let moved: Vec<_> = ring.iter().map(|vertex| vertex + vector![x, y]).collect();
        let shifted = planar_moments([&ring[..]], order).shifted(vector![x, y]);
        assert_close(shifted.values(), planar_moments([&moved[..]], order).values(), EXACT);
    }

    #[test]
    fn a_reversed_ring_has_negative_moments(radii in radii(), turn in rotation(), order in 0..=MAX_ORDER) {
        let ring = star(&radii);
        let negative: Vec<_> = planar_moments([&reversed(&ring)[..]], order).values().iter().map(|value| -value).collect();
        assert_close(&negative, planar_moments([&ring[..]], order).values(), EXACT);
        let ring = bearing_star(&radii, &turn);
        let negative: Vec<_> = spherical_moments([&reversed(&ring)[..]], order).values().iter().map(|value| -value).collect();
        assert_close(&negative, spherical_moments([&ring[..]], order).values(), EXACT);
    }

    #[test]
    fn the_parts_of_a_cut_region_add_up(radii in prop::collection::vec(0.7..0.8_f64, 6..40), turn in rotation(), at in 2_usize..5) {
        let ring = star(&radii);
        let (first, second) = cut(&ring, at);
        let parts = [planar_moments([&first[..]], 8), planar_moments([&second[..]], 8)];
        let sum: Vec<_> = parts[0].values().iter().zip(parts[1].values()).map(|(a, b)| a + b).collect();
        assert_close(&sum, planar_moments([&ring[..]], 8).values(), EXACT);

        let ring = bearing_star(&radii, &turn);
        let (first, second) = cut(&ring, at);
        let parts = [spherical_moments([&first[..]], 8), spherical_moments([&second[..]], 8)];
        assert_close(&area_sum(&parts), spherical_moments([&ring[..]], 8).values(), EXACT);
    }

    #[test]
    fn spherical_moments_turn_with_the_region(radii in radii(), turn in rotation()) {
        let still = spherical_moments([&bearing_star(&radii, &Rotation3::identity())[..]], 2);
        let turned = spherical_moments([&bearing_star(&radii, &turn)[..]], 2);
        let area = still.get(0, 0, 0);
        prop_assert!((turned.get(0, 0, 0) - area).abs() < EXACT * area);
        prop_assert!((first_order(&turned) - turn * first_order(&still)).norm() < EXACT * area);
        let expected = turn.matrix() * second_order(&still) * turn.matrix().transpose();
        prop_assert!((second_order(&turned) - expected).norm() < EXACT * area);
    }

    #[test]
    fn boundary_and_mesh_agree_on_the_sphere(radii in radii(), turn in rotation(), order in 0..=5_usize) {
        let ring = bearing_star(&radii, &turn);
        let (vertices, triangles) = as_mesh(&fan(turn * Vector3::z(), &ring));
        let mesh = mesh_sphere_moments(&vertices, &triangles, order, 12).unwrap();
        let boundary = spherical_moments([&ring[..]], order);
        assert_close(mesh.values(), boundary.values(), TWELVE_CUTS);
    }
}

/// The ring cut from its first vertex to vertex `at`.
fn cut<P: Copy>(ring: &[P], at: usize) -> (Vec<P>, Vec<P>) {
    let second = ring[at..].iter().chain(&ring[..1]).copied().collect();
    (ring[..=at].to_vec(), second)
}

fn first_order(moments: &SphereMoments) -> Vector3<f64> {
    vector![moments.get(1, 0, 0), moments.get(0, 1, 0), moments.get(0, 0, 1)]
}

fn second_order(moments: &SphereMoments) -> nalgebra::Matrix3<f64> {
    nalgebra::Matrix3::from_fn(|row, column| {
        let mut exponents = [0; 3];
        exponents[row] += 1;
        exponents[column] += 1;
        moments.get(exponents[0], exponents[1], exponents[2])
    })
}
