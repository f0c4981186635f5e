//! Triangulations cover their region, refined ones keep their promises, alpha shapes outline their points.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;
use proptest::prelude::*;
use regionpose::Error;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::mesh::{bridging_gap, even_spacing};
use regionpose::mesh::PlaneMesh;
use regionpose::mesh::alpha_shape::alpha_shape;
use regionpose::mesh::even_mesh::even_mesh;
use regionpose::mesh::triangulation::{MeshOptions, triangulate};

type Ring = Vec<Vector2<f64>>;

fn ring(points: &[[f64; 2]]) -> Ring {
    points.iter().map(|&[x, y]| Vector2::new(x, y)).collect()
}

fn square(x: f64, y: f64, half: f64) -> Ring {
    ring(&[[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])
}

fn circle(radius: f64, count: usize) -> Ring {
    let angle = |k: usize| TAU * k as f64 / count as f64;
    (0..count).map(|k| radius * Vector2::new(angle(k).cos(), angle(k).sin())).collect()
}

fn frame() -> PlaneRings {
    PlaneRings::polygon(vec![square(0.0, 0.0, 2.0), square(0.0, 0.0, 1.0)]).unwrap()
}

fn refined(max_area: f64, min_angle: f64) -> MeshOptions {
    MeshOptions::default().with_max_area(max_area).with_min_angle(min_angle)
}

fn area(mesh: &PlaneMesh, &[a, b, c]: &[usize; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|k| mesh.vertices[k]);
    0.5 * (b - a).perp(&(c - a))
}

fn smallest_angle(mesh: &PlaneMesh, triangle: &[usize; 3]) -> f64 {
    let corner = |k: usize| {
        let [a, b, c] = [0, 1, 2].map(|m| mesh.vertices[triangle[(k + m) % 3]]);
        (b - a).perp(&(c - a)).atan2((b - a).dot(&(c - a))).to_degrees()
    };
    (0..3).map(corner).fold(180.0, f64::min)
}

/// Mean of `4 sqrt(3) area / sum of squared edges`, which is 1 for equilateral triangles.
fn quality(mesh: &PlaneMesh) -> f64 {
    let one = |triangle: &[usize; 3]| {
        let squares: f64 =
            (0..3).map(|k| (mesh.vertices[triangle[k]] - mesh.vertices[triangle[(k + 1) % 3]]).norm_squared()).sum();
        4.0 * 3.0_f64.sqrt() * area(mesh, triangle) / squares
    };
    mesh.triangles.iter().map(one).sum::<f64>() / mesh.triangles.len() as f64
}

/// Standard deviation of the triangles' areas over their mean.
fn area_variation(mesh: &PlaneMesh) -> f64 {
    let areas: Vec<f64> = mesh.triangles.iter().map(|triangle| area(mesh, triangle)).collect();
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    (areas.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / areas.len() as f64).sqrt() / mean
}

#[test]
fn a_plain_mesh_keeps_the_ring_vertices_in_order() {
    let region = frame();
    let mesh = triangulate(&region, MeshOptions::default()).unwrap();
    assert_eq!(mesh.vertices, region.rings().concat());
    assert_eq!(mesh.triangles.len(), 8);
    assert_eq!(mesh.area(), 12.0);
    assert!(mesh.triangles.iter().all(|triangle| area(&mesh, triangle) > 0.0));
    assert!(mesh.triangles.is_sorted());
}

#[test]
fn islands_in_holes_are_meshed() {
    let rings = vec![square(0.0, 0.0, 3.0), square(0.0, 0.0, 2.0), square(0.0, 0.0, 1.0), square(8.0, 0.0, 1.0)];
    let mesh = triangulate(&PlaneRings::new(rings).unwrap(), MeshOptions::default()).unwrap();
    assert_eq!(mesh.area(), 36.0 - 16.0 + 4.0 + 4.0);
}

#[test]
fn touching_rings_are_meshed_also_when_refined() {
    let diamond = ring(&[[-2.0, 0.0], [0.0, -2.0], [2.0, 0.0], [0.0, 2.0]]);
    let inner = ring(&[[-2.0, 0.0], [0.0, -0.5], [2.0, 0.0], [0.0, 0.5]]);
    let squares = |k: usize| square(4.0 + k as f64 * 2.0, 2.0 + k as f64 * 2.0, 1.0);
    let rings = vec![square(0.0, 0.0, 2.0), diamond, inner, squares(0), squares(1)];
    for angle in [0.0, 0.3, 1.1] {
        let turn = nalgebra::Rotation2::new(angle);
        let turned = |ring: &Ring| ring.iter().map(|p| turn * p).collect();
        let corners: Vec<Ring> = if angle == 0.0 { rings.clone() } else { rings[3..].iter().map(turned).collect() };
        let region = PlaneRings::new(corners).unwrap();
        for options in [MeshOptions::default(), refined(0.05, 25.0)] {
            let mesh = triangulate(&region, options).unwrap();
            assert!((mesh.area() - region.area()).abs() < 1e-12, "{options:?}");
            let largest = mesh.triangles.iter().map(|t| area(&mesh, t)).fold(0.0, f64::max);
            assert!(options.max_area.is_none_or(|max_area| largest <= max_area * (1.0 + 1e-12)), "{angle} {largest}");
        }
        assert!((even_mesh(&region, 0.1).unwrap().area() - region.area()).abs() < 1e-9);
    }
}

#[test]
fn refinement_keeps_both_limits() {
    let region = frame();
    let mesh = triangulate(&region, refined(0.01, 28.0)).unwrap();
    assert!((mesh.area() - region.area()).abs() < 1e-12);
    assert!(mesh.triangles.len() > 1200 && mesh.triangles.len() < 6000, "{}", mesh.triangles.len());
    for triangle in &mesh.triangles {
        assert!(area(&mesh, triangle) > 0.0 && area(&mesh, triangle) <= 0.01);
        assert!(smallest_angle(&mesh, triangle) >= 28.0 - 1e-9, "{}", smallest_angle(&mesh, triangle));
    }
    assert_eq!(mesh.vertices[..8], region.rings().concat()[..]);
    assert_eq!(mesh, triangulate(&region, refined(0.01, 28.0)).unwrap());
}

#[test]
fn the_polygon_on_which_refinement_once_never_ended_is_refined() {
    let trap = [[0.9, 0.05], [0.25, 0.55], [-0.4, 0.55], [-0.6, 0.05], [-0.25, -0.25], [-0.05, -0.9], [0.6, -0.25]];
    let region = PlaneRings::polygon(vec![ring(&trap)]).unwrap();
    let mesh = triangulate(&region, refined(5e-3, 30.0)).unwrap();
    assert!((mesh.area() - region.area()).abs() < 1e-12);
    assert!(mesh.triangles.len() < 5000, "{}", mesh.triangles.len());
}

#[test]
fn rings_one_rounding_apart_make_a_mesh() {
    let region = PlaneRings::new(vec![square(0.0, 0.0, 2.0), square(0.0, 0.0, 2.0_f64.next_down())]).unwrap();
    let mesh = triangulate(&region, MeshOptions::default()).unwrap();
    assert_eq!(mesh.triangles.len(), 8);
}

#[test]
fn far_offsets_and_extreme_sizes_are_meshed() {
    for (offset, half) in [(5e6, 1.0), (0.0, 1e-50), (0.0, 1e50), (1e-30, 1.0)] {
        let region =
            PlaneRings::polygon(vec![square(offset, offset, half), square(offset, offset, half / 2.0)]).unwrap();
        let needed = region.area();
        for mesh in [
            triangulate(&region, MeshOptions::default()).unwrap(),
            triangulate(&region, refined(needed / 100.0, 25.0)).unwrap(),
            even_mesh(&region, half / 8.0).unwrap(),
        ] {
            assert!((mesh.area() - needed).abs() < 1e-8 * needed, "{offset} {half}");
        }
    }
}

#[test]
fn options_out_of_range_are_named() {
    for (max_area, min_angle, item) in [
        (Some(0.0), None, "max_area"),
        (Some(-1.0), None, "max_area"),
        (Some(f64::NAN), None, "max_area"),
        (Some(1e-9), None, "max_area"),
        (None, Some(0.0), "min_angle"),
        (None, Some(30.5), "min_angle"),
        (None, Some(f64::NAN), "min_angle"),
    ] {
        let found = triangulate(&frame(), MeshOptions::default().with_max_area(max_area).with_min_angle(min_angle))
            .unwrap_err();
        assert!(matches!(found, Error::InvalidOption { item: named, .. } if named == item), "{found}");
    }
    for length in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-4, 5e-324] {
        let found = even_mesh(&frame(), length).unwrap_err();
        assert!(found.to_string().starts_with("edge_length is "), "{found}");
    }
}

#[test]
fn even_meshes_are_even() {
    let turned = |points: Ring| points.iter().map(|p| nalgebra::Rotation2::new(0.4) * p).collect();
    let shapes: Vec<(&str, Vec<Ring>)> = vec![
        ("square", vec![square(0.0, 0.0, 1.0)]),
        ("turned square", vec![turned(square(0.0, 0.0, 1.0))]),
        ("disc", vec![circle(1.0, 60)]),
        ("frame", vec![square(0.0, 0.0, 1.0), square(0.0, 0.0, 0.5)]),
        ("angle", vec![ring(&[[0.0, 0.0], [2.0, 0.0], [2.0, 0.8], [0.9, 0.8], [0.9, 2.0], [0.0, 2.0]])]),
    ];
    for (name, rings) in shapes {
        let region = PlaneRings::polygon(rings).unwrap();
        let mesh = even_mesh(&region, 0.1).unwrap();
        let (quality, variation) = (quality(&mesh), area_variation(&mesh));
        let worst = mesh.triangles.iter().map(|t| smallest_angle(&mesh, t)).fold(180.0, f64::min);
        println!(
            "{name}: {} triangles, quality {quality:.4}, variation {variation:.3}, angle {worst:.1}",
            mesh.triangles.len()
        );
        assert!(quality > 0.96, "{name}: quality {quality}");
        assert!(variation < 0.2, "{name}: variation {variation}");
        assert!(worst > 25.0, "{name}: smallest angle {worst}");
        assert!((mesh.area() - region.area()).abs() < 1e-12 * region.area());
        let expected = region.area() / (3.0_f64.sqrt() / 4.0 * 0.01);
        assert!((mesh.triangles.len() as f64 / expected - 1.0).abs() < 0.2, "{name}: {}", mesh.triangles.len());
    }
}

#[test]
fn the_alpha_shape_of_a_grid_is_its_outline() {
    let grid: Ring = (0..400).map(|k| Vector2::new((k % 20) as f64, (k / 20) as f64)).collect();
    for radius in [0.8, 5.0, f64::INFINITY] {
        let outline = alpha_shape(&grid, radius).unwrap();
        assert_eq!(outline.rings().len(), 1);
        assert_eq!(outline.area(), 361.0);
        assert_eq!(outline.rings()[0][0], Vector2::new(0.0, 0.0));
    }
    let found = alpha_shape(&grid, 0.5).unwrap_err();
    let Error::EmptyShape { smallest, .. } = found else { panic!("{found}") };
    assert!((smallest - 0.5_f64.sqrt()).abs() < 1e-12);
    assert!(alpha_shape(&grid, smallest * (1.0 + 1e-12)).is_ok());
}

#[test]
fn the_alpha_shape_of_a_ring_of_points_has_a_hole_and_parts_stay_apart() {
    let cloud = |x: f64| {
        let grid = (0..1681).map(|k| Vector2::new((k % 41) as f64 - 20.0, (k / 41) as f64 - 20.0));
        grid.filter(|p| (8.0..=20.0).contains(&p.norm())).map(move |p| p + Vector2::new(x, 0.0))
    };
    let points: Ring = cloud(0.0).chain(cloud(60.0)).collect();
    let outline = alpha_shape(&points, 1.5).unwrap();
    assert_eq!(outline.rings().len(), 4);
    let expected = 2.0 * PI * (400.0 - 64.0);
    assert!((outline.area() / expected - 1.0).abs() < 0.08, "{}", outline.area() / expected);
    assert!(!outline.contains(Vector2::zeros()) && outline.contains(Vector2::new(60.0, 15.0)));
}

#[test]
fn parts_that_meet_in_one_point_become_touching_rings() {
    let two_triangles = ring(&[[0.0, 0.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, 1.0], [2.0, -1.0]]);
    let outline = alpha_shape(&two_triangles, 1.3).unwrap();
    assert_eq!(outline.rings().len(), 2);
    assert_eq!(outline.area(), 4.0);
}

#[test]
fn point_sets_without_an_outline_are_refused() {
    assert_eq!(alpha_shape(&[], 1.0), Err(Error::TooFewPoints { found: 0 }));
    assert_eq!(alpha_shape(&[Vector2::new(1.0, 2.0); 9], 1.0), Err(Error::TooFewPoints { found: 1 }));
    let line: Ring = (0..50).map(|k| Vector2::new(k as f64, 3.0 * k as f64)).collect();
    assert_eq!(alpha_shape(&line, 1.0), Err(Error::CollinearPoints { found: 50 }));
    let broken = ring(&[[0.0, 0.0], [1.0, f64::INFINITY], [0.0, 1.0]]);
    assert!(alpha_shape(&broken, 1.0).unwrap_err().to_string().starts_with("point 1 is not finite: inf"));
    for radius in [0.0, -1.0, f64::NAN] {
        assert!(alpha_shape(&circle(1.0, 9), radius).unwrap_err().to_string().starts_with("radius is "));
    }
}

#[test]
fn a_hundred_thousand_points_have_the_disc_s_outline() {
    let golden = |k: usize| {
        let (radius, angle) = ((k as f64 / 1e5).sqrt(), k as f64 * 2.399_963_229_728_653);
        Vector2::new(radius * angle.cos(), radius * angle.sin())
    };
    let points: Ring = (0..100_000).map(golden).collect();
    let outline = alpha_shape(&points, 0.01).unwrap();
    assert!((outline.area() - PI).abs() < 0.01);
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), -2.0..2.0_f64, (-3..3).prop_map(f64::from), Just(1e-300), Just(f64::INFINITY)]
}

/// Numbers of very different sizes, all of them acceptable.
fn uneven() -> impl Strategy<Value = f64> {
    prop_oneof![-2.0..2.0_f64, (-3..3).prop_map(f64::from), (-50..3).prop_map(|k| 10.0_f64.powi(k)), Just(1.0 + 1e-15)]
}

fn points_of(value: impl Strategy<Value = f64>, count: std::ops::Range<usize>) -> impl Strategy<Value = Ring> {
    let point = proptest::collection::vec(value, 2).prop_map(|v| Vector2::new(v[0], v[1]));
    proptest::collection::vec(point, count)
}

fn star() -> impl Strategy<Value = Ring> {
    proptest::collection::vec(0.05..1.0_f64, 4..30)
        .prop_map(|radii| circle(1.0, radii.len()).into_iter().zip(radii).map(|(p, radius)| radius * p).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_mesh_panics(
        rings in prop_oneof![
            proptest::collection::vec(points_of(wild(), 3..6), 1..3),
            proptest::collection::vec(points_of(uneven(), 3..6), 1..3)
        ],
        max_area in wild(), min_angle in wild(), length in wild()
    ) {
        if let Ok(region) = PlaneRings::new(rings) {
            let options = [
                MeshOptions::default(),
                MeshOptions::default().with_max_area(max_area).with_min_angle(min_angle),
                MeshOptions::default().with_max_area(region.area() / 20.0).with_min_angle(30.0),
                MeshOptions::default().with_max_area(region.area() / 20.0),
            ];
            for options in options {
                if let Ok(mesh) = triangulate(&region, options) {
                    prop_assert!(mesh.area() > 0.0);
                }
            }
            let perimeter: f64 = region.edges().map(|(a, b)| (b - a).norm()).sum();
            for length in [length, region.area().sqrt() / 5.0] {
                let _ = even_mesh(&region, length.max(perimeter / 300.0));
            }
        }
    }

    #[test]
    fn stars_are_meshed_to_their_area(outline in star(), scale in 0.2..0.8_f64) {
        let hole = outline.iter().map(|p| scale * p).collect();
        let Ok(region) = PlaneRings::polygon(vec![outline, hole]) else { return Ok(()) };
        let needed = region.area();
        let plain = triangulate(&region, MeshOptions::default()).unwrap();
        prop_assert_eq!(plain.triangles.len(), region.rings().concat().len());
        let fine = triangulate(&region, refined(needed / 50.0, 30.0)).unwrap();
        prop_assert!(fine.triangles.iter().all(|t| area(&fine, t) <= needed / 50.0 * (1.0 + 1e-12)));
        let even = even_mesh(&region, 0.1).unwrap();
        for mesh in [plain, fine, even] {
            prop_assert!((mesh.area() - needed).abs() < 1e-12);
            prop_assert!(mesh.triangles.iter().all(|t| area(&mesh, t) > 0.0));
        }
    }

    #[test]
    fn no_alpha_shape_panics(
        points in prop_oneof![points_of(wild(), 0..12), points_of(uneven(), 3..20)], radius in wild()
    ) {
        let _ = alpha_shape(&points, radius);
        if let Ok(hull) = alpha_shape(&points, f64::INFINITY) {
            prop_assert!(hull.rings().len() == 1);
        }
    }

    #[test]
    fn alpha_shapes_of_coarse_grids_trace_every_pinch(cells in proptest::collection::vec(any::<bool>(), 100), order in any::<u64>()) {
        let mut points: Ring = cells.iter().enumerate().filter(|(_, set)| **set)
            .flat_map(|(k, _)| {
                let corner = Vector2::new((k % 10) as f64, (k / 10) as f64);
                [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]].map(|offset| corner + Vector2::from(offset))
            })
            .collect();
        prop_assume!(!points.is_empty());
        let outline = alpha_shape(&points, 0.5001).unwrap();
        for (k, &set) in cells.iter().enumerate() {
            let corner = Vector2::new((k % 10) as f64, (k / 10) as f64);
            if set {
                prop_assert!(outline.contains(corner + Vector2::new(0.5, 0.25)));
                prop_assert!(outline.contains(corner + Vector2::new(0.25, 0.5)));
            }
        }
        let count = points.len();
        points.rotate_left((order % count as u64) as usize);
        prop_assert_eq!(alpha_shape(&points, 0.5001).unwrap(), outline);
    }

    #[test]
    fn the_convex_hull_contains_all_points(points in points_of(-1.0..1.0_f64, 3..40)) {
        let hull = alpha_shape(&points, f64::INFINITY).unwrap();
        prop_assert!(points.iter().all(|&p| hull.contains(p)));
        prop_assert_eq!(hull.rings().len(), 1);
    }
}

/// Rows and columns of a lattice.
fn lattice(rows: usize, columns: usize, step: [f64; 2]) -> Vec<Vector2<f64>> {
    let place = move |k: usize| Vector2::new((k % columns) as f64 * step[0], (k / columns) as f64 * step[1]);
    (0..rows * columns).map(place).collect()
}

/// The gap by all distances between points, not by a triangulation's: parts joined by ever longer ones.
fn gap_of_all_pairs(points: &[Vector2<f64>]) -> f64 {
    let mut part: Vec<usize> = (0..points.len()).collect();
    let pairs = (0..points.len()).flat_map(|a| (0..a).map(move |b| ((points[a] - points[b]).norm(), a, b)));
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
    for (length, a, b) in pairs {
        let (kept, joined) = (part[a], part[b]);
        part.iter_mut().filter(|own| **own == joined).for_each(|own| *own = kept);
        if part.iter().filter(|own| **own == kept).count() as f64 >= 0.98 * points.len() as f64 {
            return length;
        }
    }
    f64::NAN
}

#[test]
fn the_gap_of_a_lattice_is_its_wider_step_and_strays_do_not_count() {
    let mut points = lattice(30, 40, [0.02, 0.3]);
    let gap = |points: &[Vector2<f64>]| bridging_gap(points, &Budget::unlimited()).unwrap();
    assert!((gap(&points) - 0.3).abs() < 1e-12);
    points.extend((0..20).map(|k| Vector2::new(50.0 + f64::from(k), 90.0)));
    points.extend(points.clone());
    assert!((gap(&points) - 0.3).abs() < 1e-12);
}

#[test]
fn the_gap_of_points_on_a_line_is_the_way_from_one_to_the_next() {
    let points = ring(&[[0.0, 0.0], [3.0, 0.0], [1.0, 0.0], [1.5, 0.0]]);
    assert_eq!(bridging_gap(&points, &Budget::unlimited()).unwrap(), 1.5);
    for points in [vec![], vec![Vector2::new(1.0, 2.0); 5]] {
        assert!(matches!(bridging_gap(&points, &Budget::unlimited()), Err(Error::InvalidGeometry { .. })));
    }
}

#[test]
fn even_spacing_undoes_the_stretch_of_a_lattice() {
    let turned = nalgebra::Rotation2::new(0.4);
    let points: Vec<_> = lattice(20, 25, [0.05, 0.4]).iter().map(|point| turned * point).collect();
    let matrix = even_spacing(&points, &Budget::unlimited()).unwrap();
    let [along, across] = [[0.05, 0.0], [0.0, 0.4]].map(|step| matrix.tr_mul(&(turned * Vector2::from(step))).norm());
    assert!((along / across - 1.0).abs() < 1e-9 && (matrix.determinant() - 1.0).abs() < 1e-12, "{along} {across}");
    let line = ring(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]);
    assert!(matches!(even_spacing(&line, &Budget::unlimited()), Err(Error::CollinearPoints { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn the_gap_is_that_of_all_pairs(points in points_of(-2.0..2.0_f64, 2..80)) {
        let all = gap_of_all_pairs(&points);
        if let Ok(gap) = bridging_gap(&points, &Budget::unlimited()) {
            prop_assert!((gap - all).abs() <= 1e-9 * all, "{} {}", gap, all);
        } else {
            prop_assert!(points.iter().all(|point| *point == points[0]));
        }
    }
}
