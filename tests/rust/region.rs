//! World regions: what is accepted and brought into which form, and what is refused with which words.

use crate::support::random::Random;
use crate::support::scene::{Ring, SpaceRing, pierced_star, placed, rectangle, star};
use nalgebra::Vector3;
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::region::PlaneFrame;
use regionpose::internals::region::cell_normals::cells_along;
use regionpose::internals::region::robust_plane::robust_plane;
use regionpose::{Error, ObservedRegion, Pose, WorldRegion};

/// Error allowed of coordinates of size 10 that were brought into a plane and back.
const ROUNDING: f64 = 1e-13;

fn space(points: &[[f64; 3]]) -> SpaceRing {
    points.iter().map(|&p| Vector3::from(p)).collect()
}

fn flat(points: &[[f64; 2]]) -> SpaceRing {
    points.iter().map(|&[x, y]| Vector3::new(x, y, 0.0)).collect()
}

fn square(x: f64, y: f64, half: f64) -> SpaceRing {
    flat(&[[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])
}

fn refusal(rings: &[SpaceRing]) -> String {
    WorldRegion::from_rings(rings).unwrap_err().to_string()
}

fn mesh_refusal(vertices: &[Vector3<f64>], triangles: &[[usize; 3]]) -> String {
    WorldRegion::from_mesh(vertices, triangles).unwrap_err().to_string()
}

fn area(rings: &[Ring]) -> f64 {
    let one = |ring: &Ring| (0..ring.len()).map(|k| 0.5 * ring[k].perp(&ring[(k + 1) % ring.len()])).sum::<f64>().abs();
    one(&rings[0]) - rings[1..].iter().map(one).sum::<f64>()
}

fn is_right_handed(frame: &PlaneFrame) -> bool {
    let [u, v, n] = frame.axes();
    (u.cross(v) - n).norm() < 1e-14 && [u, v, n].iter().all(|axis| (axis.norm() - 1.0).abs() < 1e-14)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rings_in_any_plane_keep_their_vertices_and_area(seed: u64, reverse_outer: bool, reverse_hole: bool) {
        let mut random = Random::new(seed);
        let shape = pierced_star(&mut random, 9, 1.0);
        let mut rings = placed(&shape, &random.pose(10.0));
        for (ring, reverse) in rings.iter_mut().zip([reverse_outer, reverse_hole]) {
            if reverse {
                ring.reverse();
            }
        }
        let region = WorldRegion::from_rings(&rings).unwrap();
        prop_assert!(is_right_handed(region.frame()) && region.surface().is_none());
        prop_assert!((region.outline().area() - area(&shape)).abs() < ROUNDING);
        for (found, given) in region.rings().iter().flatten().zip(same_turn(&region.rings(), &rings).iter().flatten()) {
            prop_assert!((found - given).norm() < ROUNDING);
        }
    }

    #[test]
    fn bent_rings_are_moved_onto_their_plane(seed: u64, bend in 0.0..0.004) {
        let mut random = Random::new(seed);
        let mut rings = placed(&[star(&mut random, 9, 1.0)], &Pose::identity());
        for x in &mut rings[0] {
            x.z += bend * random.uniform(-1.0, 1.0);
        }
        let region = WorldRegion::from_rings(&rings).unwrap();
        let frame = region.frame();
        for x in region.rings().iter().flatten() {
            prop_assert!(frame.height(x).abs() < ROUNDING && (frame.to_world(&frame.to_plane(x)) - x).norm() < ROUNDING);
        }
        let moved = region.rings().iter().flatten().map(|x| x.z.abs()).fold(0.0, f64::max);
        prop_assert!(moved < 3.0 * bend + ROUNDING);
    }

    #[test]
    fn units_of_any_size_are_taken(seed: u64, exponent in -30.0..30.0) {
        let mut random = Random::new(seed);
        let (shape, unit) = (vec![star(&mut random, 9, 1.0)], 10.0_f64.powf(exponent));
        let rings: Vec<SpaceRing> =
            placed(&shape, &random.pose(10.0)).iter().map(|ring| ring.iter().map(|x| x * unit).collect()).collect();
        let region = WorldRegion::from_rings(&rings).unwrap();
        prop_assert!((region.outline().area() / (unit * unit) - area(&shape)).abs() < 1e-12);
    }

    #[test]
    fn wild_coordinates_are_taken_or_refused(seed: u64) {
        let mut random = Random::new(seed);
        let mut rings = placed(&pierced_star(&mut random, 8, 1.0), &random.pose(1.0));
        let (ring, vertex, axis) = (random.index(2), random.index(4), random.index(3));
        let wild = [f64::NAN, f64::INFINITY, -1e308, 1e200, 1e100, 5e-324, -0.0, 1e16, 1e-200];
        let factor = [1.0, 1e308, 1e-308, 1e154, 1e-154][random.index(5)];
        rings.iter_mut().flatten().for_each(|x| *x *= factor);
        rings[ring][vertex][axis] = wild[random.index(wild.len())];
        if let Ok(region) = WorldRegion::from_rings(&rings) {
            prop_assert!(region.outline().area() > 0.0 && region.frame().axes().iter().flatten().all(|a| a.is_finite()));
        }
        let _ = WorldRegion::from_mesh(&rings.concat(), &[[0, 1, 2], [0, 2, 3]]);
    }
}

/// The given rings, each turned as the region turned it: it keeps the first vertex and may reverse the others.
fn same_turn(found: &[SpaceRing], given: &[SpaceRing]) -> Vec<SpaceRing> {
    let turned = |(found, given): (&SpaceRing, &SpaceRing)| {
        let kept = found.iter().zip(given).all(|(a, b)| (a - b).norm() < 1e-9);
        let mut ring = given.clone();
        if !kept {
            ring[1..].reverse();
        }
        ring
    };
    found.iter().zip(given).map(turned).collect()
}

#[test]
fn a_region_needs_rings_of_three_finite_vertices() {
    assert_eq!(refusal(&[]), "the region has no rings; it needs at least 1");
    let two = flat(&[[0.0, 0.0], [1.0, 0.0]]);
    assert_eq!(
        refusal(&[square(0.0, 0.0, 1.0), two]),
        "ring 1 has 2 distinct vertices; a region ring needs at least 3"
    );
    let repeated = flat(&[[0.0, 0.1], [0.1, 0.0], [0.1, 0.0], [0.0, 0.1]]);
    assert!(refusal(&[square(0.0, 0.0, 1.0), repeated]).starts_with("ring 1 has 2 distinct vertices"));
    let mut broken = square(0.0, 0.0, 0.1);
    broken[2].y = f64::NAN;
    assert_eq!(
        refusal(&[square(0.0, 0.0, 1.0), broken]),
        "ring 1 vertex 2 is not finite: NaN; coordinates need to be finite numbers"
    );
}

#[test]
fn points_of_one_line_span_no_plane() {
    let expected = "the region is 3 points that are identical or on one line; it needs to be at least 3 points that \
                    span a plane";
    assert_eq!(refusal(&[space(&[[0.0; 3], [1.0; 3], [2.0; 3]])]), expected);
    assert_eq!(refusal(&[space(&[[4.0; 3]; 3])]), expected);
    assert_eq!(refusal(&[space(&[[0.0; 3], [1.0; 3], [2.0, 2.0, 2.0 + 1e-7]])]), expected);
}

#[test]
fn a_bent_ring_is_named_with_its_distance() {
    let mut hole = square(0.0, 0.0, 0.5);
    hole[1].z = 0.3;
    let error = WorldRegion::from_rings(&[square(0.0, 0.0, 1.0), hole]).unwrap_err();
    let Error::NotPlanar { ring, distance, allowed } = error else { panic!("{error}") };
    assert!(ring == 1 && distance > 0.1 && distance < 0.3 && (allowed - 0.02).abs() < 1e-15);
    assert!(error.to_string().contains("ring 1 leaves the region's plane by"));
}

#[test]
fn crossing_edges_flat_rings_and_misplaced_holes_are_refused() {
    let bow_tie = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    assert!(refusal(&[bow_tie]).contains("of ring 0 crosses edge"));
    let back_and_forth = flat(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]);
    assert!(WorldRegion::from_rings(&[square(0.0, 0.0, 2.0), back_and_forth]).is_err());
    assert_eq!(
        refusal(&[square(0.0, 0.0, 1.0), square(5.0, 0.0, 0.5)]),
        "ring 1 is a hole outside every outer ring; a hole needs to lie inside its outer ring"
    );
    let nested = [square(0.0, 0.0, 1.0), square(0.0, 0.0, 0.5), square(0.0, 0.0, 0.2)];
    assert_eq!(refusal(&nested), "ring 2 lies inside the hole ring 1; the holes of a polygon need to lie side by side");
    assert!(refusal(&[square(0.0, 0.0, 1.0), square(1.0, 0.0, 0.5)]).contains("ring 0 crosses edge"));
}

/// The vertices of an `n` by `n` grid of squares of the unit square at these heights, and two triangles a square.
fn grid(n: usize, height: impl Fn(f64, f64) -> f64) -> (SpaceRing, Vec<[usize; 3]>) {
    let at = |k: usize| ((k % (n + 1)) as f64 / n as f64, (k / (n + 1)) as f64 / n as f64);
    let vertices = (0..(n + 1) * (n + 1)).map(at).map(|(x, y)| Vector3::new(x, y, height(x, y))).collect();
    let square = |k: usize| {
        let corner = k / n * (n + 1) + k % n;
        [[corner, corner + 1, corner + n + 2], [corner, corner + n + 2, corner + n + 1]]
    };
    (vertices, (0..n * n).flat_map(square).collect())
}

#[test]
fn a_mesh_of_one_plane_becomes_planar_and_keeps_its_boundary() {
    let (vertices, triangles) = grid(3, |x, y| 2.0 * x - 0.5 * y);
    let region = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    assert!(region.surface().is_none());
    assert_eq!(region.rings()[0].len(), 12);
    assert!((region.outline().area() - (1.0_f64 + 4.0 + 0.25).sqrt()).abs() < ROUNDING);
}

#[test]
fn a_planar_mesh_with_a_hole_keeps_the_hole() {
    let (vertices, mut triangles) = grid(3, |_, _| 0.0);
    triangles.drain(8..10);
    let region = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    assert_eq!(region.outline().rings().iter().map(Vec::len).collect::<Vec<_>>(), [12, 4]);
    assert!((region.outline().area() - 8.0 / 9.0).abs() < ROUNDING);
}

#[test]
fn a_curved_mesh_keeps_its_surface() {
    let (vertices, triangles) = grid(4, |x, y| 0.2 * x * x + 0.1 * x * y);
    let region = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    let surface = region.surface().unwrap();
    assert_eq!((surface.vertices.len(), surface.triangles.len(), surface.rings.len()), (25, 32, 1));
    assert_eq!(region.rings(), surface.rings);
    assert!(surface.rings[0].iter().all(|x| vertices.contains(x)) && surface.rings[0].len() == 16);
}

#[test]
fn closed_flipped_and_pinched_meshes_are_refused() {
    let corners = space(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let closed = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
    assert_eq!(
        mesh_refusal(&corners, &closed),
        "the mesh has a closed surface; it needs an open patch, one side of which the camera sees"
    );
    let flipped = mesh_refusal(&corners, &[[0, 1, 2], [1, 2, 3]]);
    assert!(flipped.starts_with("the mesh has edge 1 to 2 twice in the same direction; it needs"), "{flipped}");
    let pinched = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0]]);
    assert_eq!(
        mesh_refusal(&pinched, &[[0, 1, 2], [0, 3, 4]]),
        "the mesh has a boundary that passes vertex 0 twice; it needs a boundary of simple rings"
    );
}

#[test]
fn a_mesh_whose_boundary_crosses_itself_in_projection_is_refused() {
    let bow_tie = flat(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.5, 1.0], [1.5, -1.0], [1.0, -2.0]]);
    let message = mesh_refusal(&bow_tie, &[[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]]);
    assert!(message.contains("of ring 0 crosses edge"), "{message}");
}

#[test]
fn meshes_without_triangles_or_with_wrong_indices_are_refused() {
    let corners = square(0.0, 0.0, 1.0);
    assert_eq!(mesh_refusal(&corners, &[]), "the number of triangles is 0; it needs to be at least 1");
    assert_eq!(
        mesh_refusal(&corners, &[[0, 1, 4]]),
        "a triangle's vertex index is 4; it needs to be below the number of vertices, 4"
    );
    assert!(mesh_refusal(&corners, &[[0, 1, 1]]).contains("edge 1 to 1"));
    let mut broken = corners;
    broken[3].z = f64::INFINITY;
    assert!(mesh_refusal(&broken, &[[0, 1, 2]]).starts_with("vertex 3 is not finite: inf"));
}

#[test]
fn a_plane_frame_has_its_origin_at_the_mean_of_the_points() {
    let points = placed(&[rectangle(3.0, 1.0)], &Random::new(2).pose(10.0)).concat();
    let frame = PlaneFrame::fit(&points).unwrap();
    assert!((frame.origin() - points.iter().sum::<Vector3<f64>>() / 4.0).norm() < ROUNDING && is_right_handed(&frame));
    assert!((frame.axes()[0].dot(&(points[1] - points[0])).abs() - 3.0).abs() < ROUNDING);
    assert!(PlaneFrame::fit(&[]).is_err() && PlaneFrame::fit(&points[..2]).is_err());
}

#[test]
fn the_pixel_area_is_a_positive_number() {
    for area in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = ObservedRegion::new(Vec::new(), area).checked_pixel_area().unwrap_err().to_string();
        assert_eq!(
            message,
            format!("the observed region's area in pixels is {area}; it needs to be a positive number")
        );
    }
    assert_eq!(ObservedRegion::new(Vec::new(), 12.5).checked_pixel_area(), Ok(12.5));
}

#[test]
fn an_outline_needs_a_plane_with_axes_of_its_own() {
    let outline = || PlaneRings::new(vec![rectangle(2.0, 1.0)]).unwrap();
    let axes = Random::new(3).pose(1.0).rotation;
    let axes = [0, 1, 2].map(|k| axes.matrix().column(k).into());
    let frame = PlaneFrame::new(Vector3::new(1.0, 2.0, 3.0), axes).unwrap();
    let [u, v, normal] = *frame.axes();
    assert!((WorldRegion::from_outline(frame.clone(), outline()).outline().area() - 2.0).abs() < ROUNDING);
    let item = |origin: &Vector3<f64>, axes: &[Vector3<f64>; 3]| match PlaneFrame::new(*origin, *axes).unwrap_err() {
        Error::NotFinite { item, .. } => item,
        Error::InvalidGeometry { item, .. } | Error::InvalidRotation { item, .. } => item.to_owned(),
        other => panic!("{other:?}"),
    };
    for broken in [f64::NAN, f64::INFINITY] {
        assert_eq!(item(&Vector3::new(0.0, 0.0, broken), frame.axes()), "the plane's origin");
        assert_eq!(item(frame.origin(), &[u, Vector3::repeat(broken), normal]), "the matrix of the plane's axes");
    }
    for axes in
        [[u * 2.0, v, normal], [u, (v + u * 0.1).normalize(), normal], [u, v, -normal], [u, v, Vector3::zeros()]]
    {
        assert_eq!(item(frame.origin(), &axes), "the matrix of the plane's axes");
    }
}

/// Points over a tilted plane, with noise across it.
fn tilted(count: usize, noise: f64, random: &mut Random) -> (Vec<Vector3<f64>>, Pose) {
    let pose = Pose::new(nalgebra::Rotation3::new(Vector3::new(0.4, -0.3, 0.9)), Vector3::new(3.0, -2.0, 7.0));
    let point = |random: &mut Random| {
        let [x, y] = [1.5, 1.0].map(|half| random.uniform(-half, half));
        pose.transform(&Vector3::new(x, y, noise * random.normal()))
    };
    ((0..count).map(|_| point(random)).collect(), pose)
}

#[test]
fn a_robust_plane_of_exact_points_holds_them_all() {
    let (points, pose) = tilted(40, 0.0, &mut Random::new(1));
    let found = robust_plane(&points, None, &Budget::unlimited()).unwrap();
    assert_eq!(found.inliers, (0..40).collect::<Vec<_>>());
    assert!(
        found.frame.axes()[2].cross(&(pose.rotation * Vector3::z())).norm() < 1e-12 && is_right_handed(&found.frame)
    );
}

#[test]
fn a_robust_plane_leaves_forty_percent_of_outliers_out() {
    let mut random = Random::new(2);
    let (mut points, pose) = tilted(180, 0.005, &mut random);
    points.extend((0..120).map(|_| {
        pose.transform(&Vector3::new(random.uniform(-1.5, 1.5), random.uniform(-1.0, 1.0), random.uniform(0.2, 1.2)))
    }));
    let found = robust_plane(&points, None, &Budget::unlimited()).unwrap();
    let angle = found.frame.axes()[2].cross(&(pose.rotation * Vector3::z())).norm().asin();
    assert!(angle < 0.002, "{angle} rad");
    let own = found.inliers.iter().filter(|&&index| index < 180).count();
    assert!(own > 170 && found.inliers.len() == own, "{own} of {}", found.inliers.len());
}

#[test]
fn a_robust_plane_of_few_points_is_that_of_all() {
    // Any two of three lines hold six of nine points without any error.
    let along = |x: f64, z: f64| [-1.0, 0.0, 1.0].map(|y| Vector3::new(x, y, z));
    let points = [along(-1.0, 0.1), along(0.0, -0.1), along(1.0, 0.1)].concat();
    let found = robust_plane(&points, None, &Budget::unlimited()).unwrap();
    assert_eq!((found.inliers.len(), found.frame), (9, PlaneFrame::fit(&points).unwrap()));
}

#[test]
fn along_beams_a_scan_line_s_own_plane_holds_nothing() {
    // Two thirds of the points on one line, whose beams' plane holds them without any error.
    let mut random = Random::new(3);
    let beams = [(0.0, 60), (0.04, 15), (0.08, 15)].into_iter().flat_map(|(y, count)| {
        (0..count).map(move |k| Vector3::new(-0.4 + 0.8 * f64::from(k) / f64::from(count - 1), y, 3.0))
    });
    let points: Vec<_> = beams.map(|beam| beam * (1.0 + 0.002 * random.normal())).collect();
    let normal = |sensor| robust_plane(&points, sensor, &Budget::unlimited()).unwrap().frame.axes()[2];
    assert!(normal(Some(&Vector3::zeros())).z.abs() > 5.0_f64.to_radians().cos());
}

#[test]
fn a_robust_plane_needs_points_that_span_one() {
    let line: Vec<_> = (0..30).map(|k| Vector3::new(f64::from(k), 2.0 * f64::from(k), 1.0)).collect();
    for points in [vec![], vec![Vector3::x(); 20], line] {
        let error = robust_plane(&points, None, &Budget::unlimited()).unwrap_err();
        assert!(matches!(error, Error::InvalidGeometry { .. }), "{error}");
    }
}

#[test]
fn cells_have_the_normal_of_the_points_in_and_around_them() {
    // A flat floor in columns 0 to 5, a wall in columns 8 to 9, three points in a corner, and one outside of the grid.
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    let mut add = |place: [f64; 3], cell: [usize; 2]| {
        points.push(Vector3::from(place));
        cells.push(cell);
    };
    for row in 0..10 {
        for k in 0..24 {
            let (x, y) = (f64::from(row as u32) + 0.3 * f64::from(k % 3), 0.25 * f64::from(k));
            add([x, y, 0.0], [row, (0.25 * f64::from(k)) as usize]);
            add([x, 8.5, 0.1 * f64::from(k)], [row, 8 + usize::from(k > 12)]);
        }
    }
    for k in 0..3 {
        add([30.0, 30.0, f64::from(k)], [30, 30]);
    }
    add([50.0, 0.0, 0.0], [50, 0]);
    let along = cells_along(&points, &cells, [40, 40], 0.3);
    let expected = |row: usize, column: usize| matches!((row, column), (0..10, 0..6) | (30, 30));
    for (cell, &found) in along.iter().enumerate() {
        assert_eq!(found, expected(cell / 40, cell % 40), "{:?}", (cell / 40, cell % 40));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    #[test]
    fn a_robust_plane_moves_with_its_points(seed in any::<u64>(), turn in -3.0..3.0_f64, far in -50.0..50.0_f64) {
        let mut random = Random::new(seed);
        let (points, _) = tilted(100, 0.01, &mut random);
        let moved = Pose::new(nalgebra::Rotation3::new(Vector3::new(0.3, turn, -0.2)), Vector3::new(far, 1.0, -far));
        let others: Vec<_> = points.iter().map(|point| moved.transform(point)).collect();
        let [one, other] = [&points, &others].map(|points| robust_plane(points, None, &Budget::unlimited()).unwrap());
        prop_assert_eq!(&one.inliers, &other.inliers);
        let turned = (moved.rotation * one.frame.axes()[2]).cross(&other.frame.axes()[2]).norm();
        prop_assert!(turned < 1e-9, "{}", turned);
    }
}
