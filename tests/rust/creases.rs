//! Edges that two regions share: found where their planes meet, exact at the true pose, with exact derivatives.

use crate::support::jacobian::assert_jacobian;
use crate::support::random::Random;
use crate::support::scene::{Scene, SpaceRing, rendered};
use nalgebra::{DVector, Dyn, Matrix6, OMatrix, Rotation3, U6, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::creases::Crease;
use regionpose::{Estimate, ObservedRegion, Pose, Problem, Solution, WorldRegion};

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
        let creases = problem.creases(&Budget::unlimited());
        let [crease] = creases else { panic!("{} creases", creases.len()) };
        assert_eq!(crease.regions, [0, 1]);
        let pose = problem.centered(&scene.pose);
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
        let crease = problem.creases(&Budget::unlimited())[0];
        let pose = problem.centered(&scene.pose).retract(&random.tangent(0.3, 0.5));
        let rows = crease.rows(&pose).unwrap();
        let jacobian = OMatrix::<f64, Dyn, U6>::from_rows(&rows.map(|(_, row)| row.transpose()));
        assert_jacobian(&jacobian, |by| residuals(&crease, &pose.retract(by)), &Default::default(), 1.0, 1e-7);
        let factor = crease.gaussian(&pose);
        let slope = OMatrix::<f64, Dyn, U6>::from_rows(&[factor.information_vector.transpose()]);
        let energy = |by: &_| DVector::from_element(1, crease.gaussian(&pose.retract(by)).offset);
        assert_jacobian(&slope, energy, &Default::default(), 1.0, 1e-7);
        assert_eq!(factor.information.rank(1e-9 * factor.information.amax()), 2);
    }
}

/// Samples of a scanner end short of the corner: the line is that of the planes all the same.
#[test]
fn outlines_that_end_short_of_the_corner_change_nothing() {
    let mut random = Random::new(103);
    let scene = scene(&mut random);
    let whole = problem(&scene.observed, &scene.worlds).creases(&Budget::unlimited())[0];
    let shrunk = |by: f64| -> Vec<WorldRegion> {
        let shrink = |world: &WorldRegion| {
            let middle = world.frame().origin();
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
    let crease = short.creases(&Budget::unlimited())[0];
    assert!(residuals(&crease, &short.centered(&scene.pose)).amax() < 1e-6);
    assert!(crease.direction.cross(&whole.direction).norm() < 1e-9);
    assert!(problem(&scene.observed, &shrunk(0.3)).creases(&Budget::unlimited()).is_empty(), "too far from the corner");
}

#[test]
fn what_is_hidden_apart_or_in_one_plane_is_no_crease() {
    let mut random = Random::new(104);
    let scene = scene(&mut random);
    // The faces of another box, the second carried away.
    let mut apart = scene.observed.clone();
    let carried = scene.worlds[1].rings()[0].iter().map(|x| x + scene.worlds[0].frame().axes()[2] * 0.2).collect();
    apart[1] = rendered(&[carried], &scene.pose);
    assert!(problem(&apart, &scene.worlds).creases(&Budget::unlimited()).is_empty());
    let mut hidden = scene.observed.clone();
    let ring = &scene.observed[1].rings[0];
    hidden[1].hidden = (0..4).map(|k| vec![ring[k], ring[(k + 1) % 4]]).take(1).collect();
    let shown = problem(&hidden, &scene.worlds).creases(&Budget::unlimited()).len();
    hidden[1].hidden = vec![vec![ring[3], ring[0], ring[1], ring[2]]];
    assert!(problem(&hidden, &scene.worlds).creases(&Budget::unlimited()).is_empty() && shown <= 1);
    let flat = [scene.worlds[0].clone(), scene.worlds[0].clone()];
    assert!(problem(&scene.observed, &flat).creases(&Budget::unlimited()).is_empty());
    assert!(problem(&scene.observed[..1], &scene.worlds[..1]).creases(&Budget::unlimited()).is_empty());
    let through = Pose::new(
        Rotation3::identity(),
        -problem(&scene.observed, &scene.worlds).creases(&Budget::unlimited())[0].point,
    );
    assert!(
        problem(&scene.observed, &scene.worlds).creases(&Budget::unlimited())[0].gaussian(&through).information
            == Matrix6::zeros()
    );
}

/// A face with samples in rows `gap` apart where its own third axis, from the first vertex towards the last, is below a height,
/// a tenth as dense across.
fn scanned(random: &mut Random, world: &WorldRegion, up: &Vector3<f64>, below: f64, gap: f64) -> WorldRegion {
    let (frame, outline) = (world.frame().clone(), world.outline());
    let ([low, high], shift) = (<[_; 2]>::from(outline.bounds()), random.uniform(0.0, gap));
    let along = frame.axes()[..2].iter().position(|axis| axis.dot(up).abs() < 0.5).unwrap();
    let steps = |axis: usize| if axis == along { 0.1 * gap } else { gap };
    let count = |axis: usize| ((high[axis] - low[axis] + 6.0 * gap) / steps(axis)) as usize;
    let mut places: Vec<Vector2<f64>> = Vec::new();
    for i in 0..count(0) {
        places.extend((0..count(1)).map(|j| low + Vector2::new(steps(0) * i as f64, steps(1) * j as f64)));
    }
    places.iter_mut().for_each(|place| *place += Vector2::repeat(shift - 3.0 * gap));
    let height = |place: &Vector2<f64>| up.dot(&frame.to_world(place));
    let least = world.rings()[0].iter().map(|x| up.dot(x)).fold(f64::INFINITY, f64::min);
    places.retain(|place| height(place) - least < below);
    let (inside, outside): (Vec<_>, Vec<_>) = places.into_iter().partition(|place| outline.contains(*place));
    let lifted = |flat: Vec<Vector2<f64>>| flat.iter().map(|place| frame.to_world(place)).collect::<Vec<_>>();
    world.clone().with_samples(&lifted(inside), &lifted(outside)).unwrap()
}

/// The lower halves of a house's front and side, in rows 0.12 units apart: the edge between them is found and holds the pose, and
/// is handed out where it is.
#[test]
fn the_corner_of_a_house_holds_a_scan_of_its_lower_half() {
    let (mut ratios, mut errors) = (Vec::new(), Vec::new());
    for seed in 0..5 {
        let mut random = Random::new(110 + seed);
        let scene = scene(&mut random);
        let edge = problem(&scene.observed, &scene.worlds).creases(&Budget::unlimited())[0].direction;
        let worlds: Vec<_> = scene.worlds.iter().map(|world| scanned(&mut random, world, &edge, 0.6, 0.12)).collect();
        let mut hidden = scene.observed.clone();
        let ring = &hidden[1].rings[0];
        // The edge that both share is not the second one's own: no crease.
        hidden[1].hidden = vec![vec![ring[0], ring[1]]];
        let [with, without] = [&scene.observed, &hidden].map(|observed| problem(observed, &worlds).estimate().unwrap());
        assert!(without.creases.is_empty());
        let [(regions, ends)] = with.creases[..] else { panic!("seed {seed}: {} creases", with.creases.len()) };
        assert_eq!(regions, [0, 1]);
        assert!(((ends[1] - ends[0]).normalize().dot(&edge).abs() - 1.0).abs() < 1e-9);
        // Two rectangles have the same view upside down.
        let nearest = |estimate: &Estimate| {
            let answers = std::iter::once(&estimate.best).chain(&estimate.alternatives);
            let error = |solution: &Solution| scene.errors(&solution.pose).0;
            answers.min_by(|a, b| error(a).total_cmp(&error(b))).unwrap().clone()
        };
        let [with, without] = [nearest(&with), nearest(&without)];
        let (rotation, place) = scene.errors(&with.pose);
        let sigma = (0..3).map(|axis| with.covariance[(axis, axis)].sqrt()).fold(0.0, f64::max);
        assert!(rotation < 2.0 * sigma && place < 0.02, "seed {seed}: {rotation} rad, {sigma}, {place}");
        errors.push(rotation);
        ratios.push((with.covariance.determinant() / without.covariance.determinant()).powf(1.0 / 12.0));
    }
    ratios.sort_by(f64::total_cmp);
    errors.sort_by(f64::total_cmp);
    assert!(ratios[2] < 1.0 && errors[2] < 0.01, "{ratios:?} {errors:?}");
}
