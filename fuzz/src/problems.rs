//! Problems that nobody set, and what is promised of their answers.

use std::f64::consts::FRAC_PI_2;
use std::fmt::Debug;
use std::sync::atomic::Ordering;

use nalgebra::{Matrix6, Rotation3, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::covariance::covariance;
use regionpose::internals::contour::fit::{ContourFit, refined};
use regionpose::{
    Estimate, Integration, ObservedRegion, Options, Pose, PoseSigma, Prior, Problem, Refinement, Start, System,
    WorldRegion,
};

use crate::kernels::needed;
use crate::random::Random;
use crate::shapes::{Ring, magnitude, once_in, ring, rings};
use crate::{LOOK_WORK, Outcome};

type SpaceRing = Vec<Vector3<f64>>;

/// A pair of regions: rings of bearings, their area in pixels, rings of the world.
struct Pair {
    seen: Vec<SpaceRing>,
    pixel_area: f64,
    world: Vec<SpaceRing>,
}

/// Rings on a plane of the world.
fn on_plane(rings: &[Ring], world_from_plane: &Pose) -> Vec<SpaceRing> {
    let lift = |ring: &Ring| ring.iter().map(|p| world_from_plane.transform(&p.push(0.0))).collect();
    rings.iter().map(lift).collect()
}

/// A plane before the camera at about unit distance, from frontal to edge-on.
fn plane(random: &mut Random) -> Pose {
    let tilt = match random.index(4) {
        0 => FRAC_PI_2 - magnitude(random, -9.0, -0.5),
        1 => magnitude(random, -6.0, -1.0),
        _ => random.uniform(0.0, 1.3),
    };
    let turn = Rotation3::from_scaled_axis(Vector3::z() * random.uniform(0.0, 6.3));
    let tilted = Rotation3::from_scaled_axis(random.direction().cross(&Vector3::z()).normalize() * tilt);
    let aside = Vector3::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 0.0);
    Pose::new(turn * tilted, aside + Vector3::z() * magnitude(random, 0.0, 1.5))
}

/// What a camera sees of rings along its axes; any direction where one lies at its center.
fn bearings(rings: &[SpaceRing]) -> Vec<SpaceRing> {
    let unit = |x: &Vector3<f64>| x.try_normalize(0.0).unwrap_or_else(Vector3::z);
    rings.iter().map(|ring| ring.iter().map(unit).collect()).collect()
}

/// Rings that are a polygon of the plane more often than those of [`rings`].
fn shape(random: &mut Random) -> Vec<Ring> {
    if once_in(random, 3) { rings(random) } else { vec![ring(random)] }
}

/// One pair: a region and its view, mostly, moved or spoilt, or two polygons that have nothing to do with each other.
fn pair(random: &mut Random, pose: &Pose, unit: f64) -> Pair {
    let (known, place) = (shape(random), plane(random));
    let along_camera = on_plane(&known, &place);
    let seen = match random.index(6) {
        0 | 1 => on_plane(&shape(random), &plane(random)),
        2 => {
            let noise = magnitude(random, -8.0, -1.0);
            let mut moved = |ring: &SpaceRing| ring.iter().map(|x| x + random_vector(random, noise)).collect();
            along_camera.iter().map(&mut moved).collect()
        }
        _ => along_camera.clone(),
    };
    let back = pose.inverse();
    let in_world = |ring: &SpaceRing| ring.iter().map(|x| back.transform(x) * unit).collect();
    let pixel_area = magnitude(random, -1.0, 6.5);
    Pair { seen: bearings(&seen), pixel_area, world: along_camera.iter().map(in_world).collect() }
}

fn random_vector(random: &mut Random, size: f64) -> Vector3<f64> {
    random.direction() * size
}

/// A problem as it is given.
struct Set {
    observed: Vec<ObservedRegion>,
    worlds: Vec<WorldRegion>,
}

/// One to four pairs, now and then the same twice, in any unit.
fn set(random: &mut Random, low: f64, high: f64) -> Option<Set> {
    let unit = if once_in(random, 3) { magnitude(random, low, high) } else { 1.0 };
    let pose = Pose::new(random.rotation(), random.direction() * magnitude(random, -2.0, 2.0));
    let mut set = Set { observed: Vec::new(), worlds: Vec::new() };
    for _ in 0..1 + random.index(4) {
        let Pair { seen, pixel_area, world } = pair(random, &pose, unit);
        set.observed.push(ObservedRegion::new(seen, pixel_area));
        set.worlds.push(WorldRegion::from_rings(&world).ok()?);
    }
    if once_in(random, 8) {
        let copied = random.index(set.worlds.len());
        set.worlds[0] = set.worlds[copied].clone();
        if once_in(random, 2) {
            set.observed[0] = set.observed[copied].clone();
        }
    }
    Some(set)
}

impl Set {
    fn problem(&self, random: &mut Random, budget: &Budget) -> Option<Problem> {
        let system = if once_in(random, 4) { System::Sphere } else { System::Plane };
        let integration = if once_in(random, 8) { Integration::Mesh { size: None } } else { Integration::Boundary };
        Problem::new_within(&self.observed, &self.worlds, system, integration, budget).ok()
    }
}

fn options(random: &mut Random) -> Options {
    let start = if once_in(random, 6) { Start::Paper } else { Start::Global };
    let refinement = if once_in(random, 6) { Refinement::Off } else { Refinement::Contour };
    let mut prior = Prior::default();
    if once_in(random, 5) {
        prior = prior.with_up(random.direction(), None).expect("a direction");
    }
    if once_in(random, 5) {
        let pose = Pose::new(random.rotation(), random.direction() * magnitude(random, -3.0, 3.0));
        let sigma = PoseSigma { rotation: magnitude(random, -6.0, 1.0), place: magnitude(random, -6.0, 3.0) };
        prior = prior.with_initial(pose, once_in(random, 2).then_some(sigma)).expect("a finite pose");
    }
    if once_in(random, 5) {
        let place = random.direction() * magnitude(random, -3.0, 3.0);
        prior = prior.with_near(place, None).expect("a finite place");
    }
    Options::default().with_start(start).with_prior(prior).with_refinement(refinement)
}

/// What is promised of every answer.
fn checked(estimate: &Estimate) -> Result<(), String> {
    let weak = estimate.warnings.iter().any(|warning| warning.code() == "weak-geometry");
    for (place, solution) in std::iter::once(&estimate.best).chain(&estimate.alternatives).enumerate() {
        let name = if place == 0 { "best" } else { "alternative" };
        let pose = &solution.pose;
        let pose_finite = pose.translation.iter().chain(pose.rotation.matrix().iter()).all(|x| x.is_finite());
        needed(pose_finite, || format!("{name}: pose {pose:?}"))?;
        let determinant = pose.rotation.matrix().determinant();
        needed((determinant - 1.0).abs() < 1e-6, || format!("{name}: no rotation, determinant {determinant}"))?;
        checked_covariance(name, &solution.covariance)?;
        let free = solution.covariance.iter().any(|entry| entry.is_infinite());
        needed(place > 0 || weak || !free, || format!("{name}: infinite covariance without a warning"))?;
        let errors = || std::iter::once(&solution.overlap_error).chain(&solution.region_overlap_errors);
        needed(errors().all(|error| error.is_finite() && *error >= 0.0), || {
            format!("{name}: overlap errors {:?}", errors().collect::<Vec<_>>())
        })?;
        let confidence = solution.confidence;
        needed((0.0..=1.0).contains(&confidence), || format!("{name}: confidence {confidence}"))?;
    }
    finite("boundary noise", estimate.boundary_noise)?;
    finite("log odds", estimate.evidence.log_odds())?;
    estimate.creases.iter().flat_map(|(_, ends)| ends).flatten().try_for_each(|x| finite("crease", *x))?;
    for warning in &estimate.warnings {
        let text = format!("{warning:?}");
        needed(!text.contains("NaN"), || format!("warning: {text}"))?;
    }
    Ok(())
}

fn finite(item: &str, value: f64) -> Result<(), String> {
    needed(value.is_finite(), || format!("{item} {value}"))
}

/// All infinite, or symmetric without a negative variance along any direction.
fn checked_covariance(name: &str, covariance: &Matrix6<f64>) -> Result<(), String> {
    if covariance.iter().all(|entry| *entry == f64::INFINITY) {
        return Ok(());
    }
    let shown = || format!("{name}: covariance {covariance:?}");
    needed(covariance.iter().all(|entry| entry.is_finite()), shown)?;
    needed(covariance.diagonal().min() >= 0.0, shown)?;
    let scale = covariance.diagonal().map(|variance| if variance > 0.0 { variance.sqrt().recip() } else { 0.0 });
    let correlation = covariance.component_mul(&(scale * scale.transpose()));
    needed((correlation - correlation.transpose()).amax() < 1e-6, shown)?;
    let least = correlation.symmetric_eigenvalues().min();
    needed(least > -1e-6, || format!("{name}: correlation with the eigenvalue {least}"))
}

/// Whole problems and their estimates.
pub fn estimate(random: &mut Random, budget: &Budget) -> Outcome {
    let Some(set) = set(random, -13.0, 6.0) else { return Ok(false) };
    let options = options(random);
    let Some(problem) = set.problem(random, budget) else { return Ok(false) };
    LOOK_WORK.store(problem.work(), Ordering::Relaxed);
    let Ok(estimate) = problem.estimate_within(&options, budget) else { return Ok(true) };
    checked(&estimate)?;
    Ok(true)
}

/// Lines of bearings near a ring, some of them empty, of one bearing, or far away.
fn lines(random: &mut Random, rings: &[SpaceRing]) -> Vec<SpaceRing> {
    let line = |random: &mut Random| {
        let ring = &rings[random.index(rings.len())];
        let (start, count) = (random.index(ring.len()), random.index(ring.len() + 2));
        let off = if once_in(random, 2) { 0.0 } else { magnitude(random, -9.0, 0.0) };
        let mut line: SpaceRing =
            (0..count).map(|k| ring[(start + k) % ring.len()] + random_vector(random, off)).collect();
        if once_in(random, 12) {
            line.push(random.direction() * f64::NAN);
        }
        line
    };
    (0..random.index(4)).map(|_| line(random)).collect()
}

/// Regions cut by the border of the image or with hidden edges, their estimates too.
pub fn border(random: &mut Random, budget: &Budget) -> Outcome {
    let Some(mut set) = set(random, -3.0, 3.0) else { return Ok(false) };
    for observed in &mut set.observed {
        observed.borders = lines(random, &observed.rings.clone());
        if once_in(random, 2) {
            observed.hidden = lines(random, &observed.rings.clone());
        }
    }
    let Some(problem) = set.problem(random, budget) else { return Ok(false) };
    if let Ok(estimate) = problem.estimate_within(&options(random), budget) {
        checked(&estimate)?;
    }
    Ok(true)
}

/// What contours show at any pose, and where they lead.
pub fn contours(random: &mut Random, budget: &Budget) -> Outcome {
    let Some(set) = set(random, -13.0, 6.0) else { return Ok(false) };
    let Some(problem) = set.problem(random, budget) else { return Ok(false) };
    let distance = magnitude(random, -1.0, 1.5);
    let pose = Pose::new(random.rotation(), random.direction() * distance);
    let step = 1 + random.index(4);
    let fit = if once_in(random, 2) {
        ContourFit::at(problem.contours(), &pose, step, budget)
    } else {
        refined(problem.contours(), &pose, step, budget)
    };
    let Some(fit) = fit else { return Ok(true) };
    let shown = |value: &dyn Debug| format!("contour fit {value:?}");
    needed(fit.clean_shares().iter().all(|share| (0.0..=1.0).contains(share)), || shown(&fit.clean_shares()))?;
    needed(fit.mixture.sigma > 0.0 && fit.mixture.likelihood.is_finite(), || shown(&fit.mixture))?;
    checked_covariance("contours", &covariance(problem.contours(), &fit, budget))?;
    Ok(true)
}

/// Regions with samples inside and outside, mislabeled now and then.
pub fn samples(random: &mut Random, budget: &Budget) -> Outcome {
    let Some(mut set) = set(random, -3.0, 3.0) else { return Ok(false) };
    let worlds = std::mem::take(&mut set.worlds);
    for world in worlds {
        let world = if once_in(random, 6) { world } else { with_samples(random, world) };
        set.worlds.push(world);
    }
    let Some(problem) = set.problem(random, budget) else { return Ok(false) };
    if let Ok(estimate) = problem.estimate_within(&options(random), budget) {
        checked(&estimate)?;
    }
    Ok(true)
}

fn with_samples(random: &mut Random, world: WorldRegion) -> WorldRegion {
    let (lower, upper) = world.outline().bounds();
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    for _ in 0..magnitude(random, 0.0, 2.5) as usize {
        let share = |random: &mut Random| random.uniform(-0.3, 1.3);
        let (x, y) = (share(random), share(random));
        let place = lower + (upper - lower).component_mul(&nalgebra::Vector2::new(x, y));
        let labeled = world.outline().contains(place) != once_in(random, 20);
        let side = if labeled { &mut inside } else { &mut outside };
        side.push(world.frame().to_world(&place));
    }
    world.clone().with_samples(&inside, &outside).unwrap_or(world)
}
