//! Edges that two regions share: found where their planes meet, exact at the true pose, with exact derivatives.

mod support;

use nalgebra::{DVector, Dyn, Matrix6, OMatrix, Rotation3, U6, Vector3};
use regionpose::contour::creases::Crease;
use regionpose::{ObservedRegion, Pose, Problem, WorldRegion};
use support::jacobian::assert_jacobian;
use support::random::Random;
use support::scene::{Scene, SpaceRing, rendered};

/// Two faces of a box that meet in the world's y axis, `gap` before it.
fn faces(gap: f64) -> [SpaceRing; 2] {
    let face = |corners: [[f64; 3]; 4]| corners.map(Vector3::from).to_vec();
    [
        face([[gap, 0.1, 0.0], [1.4, 0.1, 0.0], [1.4, 1.0, 0.0], [gap, 1.0, 0.0]]),
        face([[0.0, 0.0, gap], [0.0, 1.1, gap], [0.0, 1.1, 1.2], [0.0, 0.0, 1.2]]),
    ]
}

/// A camera about 5 m before the edge, which sees both faces, in a world of its own.
fn scene(random: &mut Random) -> Scene {
    let camera = Vector3::new(random.uniform(2.0, 4.0), random.uniform(-1.0, 2.0), random.uniform(2.0, 4.0));
    let to_edge = Vector3::new(0.3, 0.5, 0.3) - camera;
    let up = Vector3::new(random.uniform(-0.3, 0.3), -1.0, random.uniform(-0.3, 0.3));
    let seen = Pose::new(Rotation3::look_at_lh(&to_edge, &up), Vector3::zeros());
    let seen = Pose::new(seen.rotation, -(seen.rotation * camera));
    let world = random.pose(5.0);
    let rings = faces(0.0).map(|ring| vec![ring.iter().map(|x| world.transform(x)).collect::<SpaceRing>()]);
    Scene::of_rings(seen.after(&world.inverse()), &rings)
}

fn problem(observed: &[ObservedRegion], worlds: &[WorldRegion]) -> Problem {
    Problem::new(observed, worlds).unwrap()
}

fn residuals(crease: &Crease, pose: &Pose) -> DVector<f64> {
    DVector::from_iterator(2, crease.rows(pose).unwrap().map(|(distance, _)| distance))
}

#[test]
fn faces_of_a_box_share_the_edge_where_their_planes_meet() {
    let mut random = Random::new(101);
    for _ in 0..20 {
        let scene = scene(&mut random);
        let problem = problem(&scene.observed, &scene.worlds);
        let creases = problem.creases();
        let [crease] = &creases[..] else { panic!("{} creases", creases.len()) };
        assert_eq!(crease.regions, [0, 1]);
        let pose = problem.centred(&scene.pose);
        assert!(residuals(crease, &pose).amax() < 1e-6, "{}", residuals(crease, &pose));
        // As far as both faces go, which is 0.9 m.
        let places = crease.ends.map(|ray| place_on(crease, &pose, &ray));
        assert!(((places[1] - places[0]).abs() - 0.9).abs() < 1e-6, "{places:?}");
    }
}

/// Where along a crease's line a ray of the camera meets it.
fn place_on(crease: &Crease, pose: &Pose, ray: &Vector3<f64>) -> f64 {
    let (point, direction) = (pose.transform(&crease.point), pose.rotation * crease.direction);
    let across = ray.cross(&ray.cross(&direction));
    -across.dot(&point) / across.dot(&direction)
}

#[test]
fn derivatives_are_exact_and_a_crease_holds_two_directions() {
    let mut random = Random::new(102);
    for _ in 0..20 {
        let scene = scene(&mut random);
        let problem = problem(&scene.observed, &scene.worlds);
        let crease = problem.creases()[0];
        let pose = problem.centred(&scene.pose).moved(&random.tangent(0.3, 0.5));
        let rows = crease.rows(&pose).unwrap();
        let jacobian = OMatrix::<f64, Dyn, U6>::from_rows(&rows.map(|(_, row)| row.transpose()));
        assert_jacobian(&jacobian, |by| residuals(&crease, &pose.moved(by)), &Default::default(), 1.0, 1e-7);
        let factor = crease.gaussian(&pose);
        let slope = OMatrix::<f64, Dyn, U6>::from_rows(&[factor.vector.transpose()]);
        let energy = |by: &_| DVector::from_element(1, crease.gaussian(&pose.moved(by)).offset);
        assert_jacobian(&slope, energy, &Default::default(), 1.0, 1e-7);
        assert_eq!(factor.information.rank(1e-9 * factor.information.amax()), 2);
    }
}

/// Samples of a scanner end short of the corner: the line is that of the planes all the same.
#[test]
fn outlines_that_end_short_of_the_corner_change_nothing() {
    let mut random = Random::new(103);
    let scene = scene(&mut random);
    let whole = problem(&scene.observed, &scene.worlds).creases()[0];
    let shrunk = |by: f64| -> Vec<WorldRegion> {
        let shrink = |world: &WorldRegion| {
            let middle = world.frame().origin;
            WorldRegion::from_rings(
                &world
                    .rings()
                    .iter()
                    .map(|ring| ring.iter().map(|x| middle + (x - middle) * by).collect())
                    .collect::<Vec<_>>(),
            )
            .unwrap()
        };
        scene.worlds.iter().map(shrink).collect()
    };
    let short = problem(&scene.observed, &shrunk(0.85));
    let crease = short.creases()[0];
    assert!(residuals(&crease, &short.centred(&scene.pose)).amax() < 1e-6);
    assert!(crease.direction.cross(&whole.direction).norm() < 1e-9);
    assert!(problem(&scene.observed, &shrunk(0.3)).creases().is_empty(), "too far from the corner");
}

#[test]
fn what_is_hidden_apart_or_in_one_plane_is_no_crease() {
    let mut random = Random::new(104);
    let scene = scene(&mut random);
    // The faces of another box, the second carried away.
    let mut apart = scene.observed.clone();
    let carried = scene.worlds[1].rings()[0].iter().map(|x| x + scene.worlds[0].frame().axes[2] * 0.2).collect();
    apart[1] = rendered(&[carried], &scene.pose);
    assert!(problem(&apart, &scene.worlds).creases().is_empty());
    let mut hidden = scene.observed.clone();
    let ring = &scene.observed[1].rings[0];
    hidden[1].hidden = (0..4).map(|k| vec![ring[k], ring[(k + 1) % 4]]).take(1).collect();
    let shown = problem(&hidden, &scene.worlds).creases().len();
    hidden[1].hidden = vec![vec![ring[3], ring[0], ring[1], ring[2]]];
    assert!(problem(&hidden, &scene.worlds).creases().is_empty() && shown <= 1);
    let flat = [scene.worlds[0].clone(), scene.worlds[0].clone()];
    assert!(problem(&scene.observed, &flat).creases().is_empty());
    assert!(problem(&scene.observed[..1], &scene.worlds[..1]).creases().is_empty());
    let through = Pose::new(Rotation3::identity(), -problem(&scene.observed, &scene.worlds).creases()[0].point);
    assert!(problem(&scene.observed, &scene.worlds).creases()[0].gaussian(&through).information == Matrix6::zeros());
}
