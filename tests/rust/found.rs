//! Inputs found by fuzzing: each is refused, bounded, or has a finite answer with a warning.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::support::random::Random;
use crate::support::scene::{Layout, Scene, rectangle, regular, star};
use nalgebra::{Rotation3, Vector2, Vector3};
use regionpose::internals::budget::{Budget, Cancel};
use regionpose::internals::equations::least_squares::Termination;
use regionpose::internals::equations::residual::evaluate;
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::options::Options;
use regionpose::internals::problem::MAX_EVALUATIONS;
use regionpose::internals::verdict::coverage::overlap_errors;
use regionpose::internals::view::chart::Chart;
use regionpose::mesh::MOST_TRIANGLES;
use regionpose::mesh::even_mesh::{even_mesh, even_mesh_within};
use regionpose::mesh::triangulation::{MeshOptions, triangulate};
use regionpose::{Error, Integration, ObservedRegion, Pose, Problem, System, Warning, WorldRegion};

fn needle(width: f64) -> PlaneRings {
    PlaneRings::new(vec![[[0.0, 0.0], [1.0, 0.3], [1.0, 0.3 + width], [0.0, width]].map(Vector2::from).to_vec()])
        .unwrap()
}

/// Its area asks for short edges, its length for very many of them.
#[test]
fn an_even_mesh_of_a_needle_is_refused_before_any_work() {
    for width in [1e-9, 1e-11] {
        let region = needle(width);
        let budget = Budget::unlimited();
        let message = even_mesh_within(&region, region.area().sqrt() / 8.0, &budget).unwrap_err().to_string();
        assert!(message.contains(&format!("more than {MOST_TRIANGLES} triangles")), "{message}");
        assert_eq!(budget.charged(), 0);
    }
}

/// A strip one edge wide has nearly as many vertices on its boundary as triangles; of two rows it has half as many.
#[test]
fn an_even_mesh_of_a_long_strip_needs_two_rows() {
    let strip = |width: f64| PlaneRings::new(vec![rectangle(3.0, width)]).unwrap();
    assert!(even_mesh(&strip(1e-3), 1e-3).unwrap_err().to_string().contains("too thin for two rows"));
    assert!(even_mesh(&strip(2e-3), 1e-3).is_ok());
}

/// Edges far longer than the region is wide: a few of them are a mesh, thousands next to one another take their square.
#[test]
fn an_even_mesh_of_a_region_thinner_than_its_edges_is_bounded() {
    let region = needle(1e-6);
    let mesh = even_mesh(&region, 2e-3).unwrap();
    assert!((mesh.area() / region.area() - 1.0).abs() < 1e-9);
    let budget = Budget::unlimited();
    let message = even_mesh_within(&region, 2e-4, &budget).unwrap_err().to_string();
    assert!(message.contains("longer: the region is too thin for two rows"), "{message}");
    assert_eq!(budget.charged(), 0);
}

#[test]
fn a_refined_mesh_has_a_bound_on_its_vertices() {
    let region = needle(1e-4);
    let start = Instant::now();
    let options = MeshOptions::default().with_min_angle(30.0);
    assert!(triangulate(&region, options).map_or(true, |mesh| mesh.vertices.len() <= MOST_TRIANGLES));
    assert!(start.elapsed() < Duration::from_secs(30));
}

fn scene(regions: usize) -> Scene {
    Scene::random(&mut Random::new(61), Layout { regions, ..Layout::default() })
}

/// At poses that show a region in part, from its own plane or from behind, errors are numbers.
#[test]
fn overlap_errors_are_finite_at_any_pose() {
    let mut random = Random::new(62);
    let scene = scene(2);
    let problem = scene.problem(System::Plane, Integration::Boundary);
    for _ in 0..300 {
        let pose = Pose::new(random.rotation(), random.direction() * random.uniform(0.0, 8.0));
        let (all, each) = overlap_errors(&problem, &pose, &Budget::unlimited());
        assert!(all.is_finite() && all >= 0.0 && each.iter().all(|error| error.is_finite() && *error >= 0.0));
    }
    let (all, each) = overlap_errors(&problem, &scene.pose, &Budget::unlimited());
    assert!(all < 1e-9 && each.iter().all(|error| *error < 1e-9));
}

/// Turned by half a turn, no region is in view.
#[test]
fn a_pose_that_faces_the_other_way_misses_all_of_every_region() {
    let scene = scene(2);
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let across = scene.observed[0].rings[0][0].cross(&scene.observed[1].rings[0][0]).normalize();
    let away = Pose::new(Rotation3::from_scaled_axis(across * 2.0 * FRAC_PI_2), Vector3::zeros()).after(&scene.pose);
    assert_eq!(overlap_errors(&problem, &away, &Budget::unlimited()), (1.0, vec![1.0, 1.0]));
}

/// Regions of a micrometer and a kilometer, seen once and twice, from any side.
#[test]
fn covariances_are_symmetric_and_positive_or_infinite_with_a_warning() {
    let mut random = Random::new(63);
    for case in 0..60 {
        let unit = 10.0_f64.powf(random.uniform(-13.0, 6.0));
        let tilt = [[0.0, 1e-6], [0.3, 0.9], [1.5, 1.57]][case % 3];
        let layout = Layout { regions: 1 + case % 2, unit, tilt, vertices: 4, ..Layout::default() };
        let scene = Scene::random(&mut random, layout);
        let Ok(problem) = Problem::new(&scene.observed, &scene.worlds) else { continue };
        let Ok(estimate) = problem.estimate() else { continue };
        let warnings = format!("{:?}", estimate.warnings);
        assert!(!warnings.contains("NaN"), "case {case}: {warnings}");
        let covariance = estimate.best.covariance;
        if covariance.iter().all(|entry| *entry == f64::INFINITY) {
            assert!(estimate.warnings.iter().any(|warning| warning.code() == "weak-geometry"), "case {case}");
            continue;
        }
        let deviations = covariance.diagonal().map(f64::sqrt);
        assert!(deviations.iter().all(|deviation| *deviation > 0.0), "case {case}: {covariance}");
        assert_eq!(covariance, covariance.transpose());
        let correlation = covariance.component_div(&(deviations * deviations.transpose()));
        assert!(correlation.cholesky().is_some(), "case {case}: {correlation}");
    }
}

#[test]
fn empty_lines_of_a_border_are_refused_by_name() {
    let scene = scene(1);
    let refused = |borders: Vec<Vec<Vector3<f64>>>, hidden: Vec<Vec<Vector3<f64>>>| {
        let observed = ObservedRegion { borders, hidden, ..scene.observed[0].clone() };
        Problem::new(&[observed], &scene.worlds).unwrap_err().to_string()
    };
    let message = refused(vec![Vec::new()], Vec::new());
    assert!(message.starts_with("region 0: ") && message.contains("border"), "{message}");
    let message = refused(Vec::new(), vec![Vec::new()]);
    assert!(message.starts_with("region 0: ") && message.contains("hidden"), "{message}");
}

/// A needle is a thousand times as long as its area is wide: the area is one to what its length allows.
#[test]
fn charts_have_unit_area_to_the_rounding_of_their_extent() {
    for width in [1.0, 1e-3, 1e-6, 1e-9] {
        let corners = [[-0.3, -0.1], [0.3, 0.1], [0.3, 0.1 + width * 0.1], [-0.3, -0.1 + width * 0.1]];
        let bearings = corners.map(|[x, y]| Vector3::new(x, y, 1.0)).to_vec();
        let (_, rings) = Chart::of(&[bearings]).unwrap();
        let (lower, upper) = rings.bounds();
        assert!((rings.area() - 1.0).abs() < 1e-12 * (upper - lower).norm_squared().max(1.0), "{width}");
    }
}

/// Outlines of very many corners that have nothing to do with what is seen: a search without an end in sight.
fn hopeless(vertices: usize) -> Problem {
    let mut random = Random::new(64);
    let plane = Pose::new(Rotation3::from_scaled_axis(Vector3::new(0.3, 1.2, 0.1)), Vector3::new(0.1, 0.2, 3.0));
    let mut pair = || {
        let ring: Vec<_> = star(&mut random, vertices, 1.0).iter().map(|p| plane.transform(&p.push(0.0))).collect();
        let seen: Vec<_> = star(&mut random, vertices, 0.5).iter().map(|p| p.push(3.0)).collect();
        (ObservedRegion::new(vec![seen], 1e5), WorldRegion::from_rings(&[ring]).unwrap())
    };
    let (observed, worlds): (Vec<_>, Vec<_>) = (0..3).map(|_| pair()).unzip();
    Problem::new(&observed, &worlds).unwrap()
}

/// The same work within the same bound: the same answer.
#[test]
fn a_search_that_exhausts_its_budget_answers_with_what_it_found_and_a_warning() {
    let problem = hopeless(40);
    let estimate = |budget: &Budget| problem.estimate_within(&Options::default(), budget);
    let estimates = [(); 2].map(|()| Budget::unlimited().limited(2_000_000, estimate));
    for (estimate, spent) in &estimates {
        let estimate = estimate.as_ref().expect("a pose found before the end");
        assert!(*spent && estimate.best.pose.translation.iter().all(|x| x.is_finite()));
        let ended = Warning::NotConverged { termination: Termination::WorkLimit };
        assert!(estimate.warnings.contains(&ended), "{:?}", estimate.warnings);
    }
    let [first, second] = estimates.map(|(estimate, _)| estimate.unwrap().best.pose);
    assert_eq!(first, second);
}

#[test]
fn a_canceled_search_ends() {
    let problem = hopeless(200);
    let gone = Arc::new(AtomicBool::new(false));
    let stop: Cancel = {
        let gone = gone.clone();
        Arc::new(move || gone.swap(true, Ordering::Relaxed))
    };
    let budget = Budget::cancellable(stop);
    let _ = problem.search_within(&Options::default(), &budget);
    assert!(budget.is_canceled());
    assert!(gone.load(Ordering::Relaxed));
}

/// A star of so many corners, most of them along the image's border, which goes in and out as they do, or along the edges of what
/// hides it.
fn beset(vertices: usize, by: impl Fn(Vec<Vector3<f64>>, &mut ObservedRegion), budget: &Budget) -> Problem {
    let mut random = Random::new(67);
    let plane = Pose::new(Rotation3::from_scaled_axis(Vector3::new(0.3, 0.2, 0.1)), Vector3::new(0.1, 0.2, 3.0));
    let ring: Vec<_> = star(&mut random, vertices, 1.0).iter().map(|p| plane.transform(&p.push(0.0))).collect();
    let line = ring[..vertices * 4 / 5].iter().map(|x| x + random.direction() * 1e-4).collect();
    let mut observed = ObservedRegion::new(vec![ring.clone()], 1e5);
    by(line, &mut observed);
    let world = WorldRegion::from_rings(&[ring]).unwrap();
    Problem::new_within(&[observed], &[world], System::Plane, Integration::Boundary, budget).unwrap()
}

fn along_border(line: Vec<Vector3<f64>>, observed: &mut ObservedRegion) {
    observed.borders = vec![line];
}

fn behind_edges(line: Vec<Vector3<f64>>, observed: &mut ObservedRegion) {
    observed.hidden = vec![line];
}

/// Twice as many edges beside twice as many take about twice the work, and not four times as much.
#[test]
fn an_evaluation_of_an_outline_beside_many_edges_costs_in_proportion_to_these() {
    let costs = [400, 800].map(|vertices| {
        let (making, evaluating) = (Budget::unlimited(), Budget::unlimited());
        let problem = beset(vertices, along_border, &making);
        let evaluated =
            |k: usize| evaluate(problem.regions(), &problem.centered(&turned(k)), Weighting::Uniform, &evaluating);
        assert_eq!((0..20).filter_map(evaluated).count(), 20);
        let work = evaluating.charged();
        assert!(work < 20 * 2 * problem.work(), "{vertices}: {work} of {}", problem.work());
        let _ = beset(vertices, behind_edges, &making);
        (making.charged(), work)
    });
    let [(made, evaluated), (more_made, more_evaluated)] = costs;
    assert!(more_made < 3 * made, "{made}, {more_made}");
    assert!(more_evaluated < 3 * evaluated, "{evaluated}, {more_evaluated}");
}

/// A pose near that of [`beset`].
fn turned(number: usize) -> Pose {
    Pose::new(Rotation3::from_scaled_axis(Vector3::new(0.01, 0.02, 0.001 * number as f64)), Vector3::zeros())
}

/// Several hundred edges that are not the region's own: what is spent beyond the bound is what ends the search, a small part of it.
#[test]
fn a_search_beside_several_hundred_edges_is_bounded() {
    for (by, name) in [(along_border as fn(_, &mut _), "border"), (behind_edges, "hidden")] {
        let (problem, budget) = (beset(400, by, &Budget::unlimited()), Budget::unlimited());
        let search = problem.search_within(&Options::default(), &budget);
        let work = budget.charged();
        let most = MAX_EVALUATIONS * problem.work();
        assert!(work < most + most / 10, "{name}: {work}, bound {most}");
        let minima = search.candidates().iter().map(|pose| search.solve_from(pose)).collect();
        let estimate = search.assess(minima).unwrap();
        let has_warning = estimate.warnings.iter().any(|warning| warning.code() == "not-converged");
        assert_eq!(has_warning, work >= most, "{name}: {work}, bound {most}");
    }
}

/// Each triangle is sampled at 28 points, and takes as long.
#[test]
fn a_quadrature_on_the_sphere_is_counted_by_its_points() {
    let scene = scene(1);
    let work = |system: System, integration: Integration| {
        let (problem, budget) = (scene.problem(system, integration), Budget::unlimited());
        let _ = evaluate(problem.regions(), &problem.centered(&scene.pose), Weighting::Uniform, &budget).unwrap();
        budget.charged()
    };
    let mesh = Integration::Mesh { size: Some(0.1) };
    assert!(work(System::Sphere, mesh) > 9 * work(System::Plane, mesh));
    assert!(work(System::Plane, mesh) > work(System::Plane, Integration::Boundary));
}

/// A cancellation at the first poll.
fn at_once() -> Budget {
    Budget::cancellable(Arc::new(|| true))
}

#[test]
fn a_canceled_mesh_is_not_made() {
    let region = PlaneRings::new(vec![star(&mut Random::new(66), 40, 1.0)]).unwrap();
    let budget = at_once();
    assert_eq!(even_mesh_within(&region, 0.01, &budget), Err(Error::Canceled));
    assert!(budget.is_canceled());
}

/// Ordinary problems, also those of shapes that fit in many turns, stay well below the bound.
#[test]
fn ordinary_searches_spend_a_part_of_what_they_may() {
    let shapes = |count: usize| vec![vec![regular(64, 1.0)]; count];
    let discs = (1..3).map(|count| Scene::of_shapes(&mut Random::new(65), shapes(count), Layout::default()));
    for (place, scene) in (1..4).map(scene).chain(discs).enumerate() {
        let problem = scene.problem(System::Plane, Integration::Boundary);
        let budget = Budget::unlimited();
        let estimate = problem.estimate_within(&Options::default(), &budget);
        let work = budget.charged();
        assert!(
            estimate.is_ok() && work < MAX_EVALUATIONS / 2 * problem.work(),
            "{place}: {work} of {}",
            problem.work()
        );
    }
}

/// A search takes thousands of evaluations, and its result does not depend on the integration.
#[test]
fn a_mesh_is_searched_along_its_boundary() {
    let scene = scene(2);
    for system in [System::Plane, System::Sphere] {
        let [boundary, mesh] = [Integration::Boundary, Integration::Mesh { size: Some(0.02) }].map(|integration| {
            let (problem, budget) = (scene.problem(system, integration), Budget::unlimited());
            let search = problem.search_within(&Options::default(), &budget);
            let minima: Vec<_> = search.candidates().iter().map(|pose| search.solve_from(pose)).collect();
            assert!(!minima.is_empty() && minima.iter().all(|minimum| minimum.converged && minimum.evaluations < 10));
            (search.problem().work(), budget.charged())
        });
        assert!(mesh.0 > 20 * boundary.0, "the solution's evaluations are the mesh's: {} of {}", mesh.0, boundary.0);
        assert!(mesh.1 < 2 * boundary.1, "{system:?}: {} along the boundary, {} over a mesh", boundary.1, mesh.1);
    }
}
