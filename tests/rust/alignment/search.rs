//! A made-up place of boxes, scanned and photographed by casting rays: the search finds where the camera stood.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

use nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};
use regionpose::internals::alignment::blur::blurred;
use regionpose::internals::alignment::cloud_edges::{CloudEdges, EdgeField, EdgeOptions, Thinning};
use regionpose::internals::alignment::density::PoseDensity;
use regionpose::internals::alignment::frame::{FINEST, Frame, PhotoView, SPREADS, SPREADS_PX};
use regionpose::internals::alignment::null_poses::LocalWeights;
use regionpose::internals::alignment::pictures::{DIRECTIONS, LogRatios};
use regionpose::internals::alignment::posterior::{Mode, Posterior, Weight};
use regionpose::internals::alignment::projection::Projection;
use regionpose::internals::alignment::search::{
    SearchOptions, SearchProgress, distinct_poses, search, search_with_progress,
};
use regionpose::internals::budget::{Budget, Cancel};
use regionpose::internals::geometry::pose::Tangent;
use regionpose::{Error, Pose, PoseSigma, Prior};

use crate::support::random::Random;

const WIDTH: usize = 480;
const HEIGHT: usize = 360;
const FOCAL: f64 = 300.0;
/// Likelihood of an edge elsewhere at the most, where it is 4 under an edge.
const BUSY: f32 = 0.3;
/// Least width of the window in which an edge is compared with what else is there, pixels.
const WINDOW: f64 = 12.0;
const BLOCKS: usize = 110;

/// A box that stands in the scene: its middle and half its sides, along the world's axes.
struct Block {
    middle: Vector3<f64>,
    half: Vector3<f64>,
}

impl Block {
    /// The distance along a ray at which it enters.
    fn met(&self, from: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
        let (mut enters, mut leaves) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let to = self.middle[axis] - from[axis];
            let (one, other) = ((to - self.half[axis]) / ray[axis], (to + self.half[axis]) / ray[axis]);
            enters = enters.max(one.min(other));
            leaves = leaves.min(one.max(other));
        }
        if enters < leaves { enters } else { f64::INFINITY }
    }
}

/// Boxes of many sizes all around, as signs, poles and branches are, in a hall of 40 m whose ground is 1.7 m below the scanner.
fn blocks(seed: u64) -> Vec<Block> {
    let mut random = Random::new(seed);
    let block = |_| {
        let (angle, distance) = (random.uniform(0.0, TAU), random.uniform(3.0, 16.0));
        let half = Vector3::from_fn(|_, _| 0.1 * 7.0_f64.powf(random.uniform(0.0, 1.0)));
        let height = distance * random.uniform(-0.35, 0.3);
        Block { middle: Vector3::new(distance * angle.cos(), distance * angle.sin(), height.max(-1.7)), half }
    };
    (0..BLOCKS).map(block).collect()
}

/// The distance to what a ray of unit length meets.
fn range(blocks: &[Block], from: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
    let met = blocks.iter().map(|block| block.met(from, ray)).fold(f64::INFINITY, f64::min);
    let ground = if ray.z < 0.0 { (-1.7 - from.z) / ray.z } else { f64::INFINITY };
    met.min(ground).min(20.0 / ray.xy().norm())
}

/// A scan from the origin, in the order of its rays.
fn scan(blocks: &[Block]) -> Vec<Vector3<f64>> {
    let ray = |ring: usize, step: usize| {
        let (up, around) = (-0.35 + 0.55 * ring as f64 / 63.0, TAU * step as f64 / 720.0);
        Vector3::new(up.cos() * around.cos(), up.cos() * around.sin(), up.sin())
    };
    let rays = (0..64).flat_map(|ring| (0..720).map(move |step| ray(ring, step)));
    rays.map(|ray| ray * range(blocks, &Vector3::zeros(), &ray)).collect()
}

/// Where the camera stood: beside the scanner, a little tilted.
fn truth() -> Pose {
    let level = Rotation3::rotation_between(&Vector3::z(), &-Vector3::y()).unwrap();
    let rotation =
        Rotation3::new(Vector3::new(0.03, 0.0, -0.02)) * Rotation3::from_axis_angle(&Vector3::y_axis(), 2.3) * level;
    Pose::new(rotation, -(rotation * Vector3::new(0.15, -0.2, 0.1)))
}

/// How much an edge in each pixel is likelier than none there, by direction: the cube of ranks that are 1 where ranges of neighbors
/// differ much, on some lines of chance, and even elsewhere.
fn edges_of_photo(blocks: &[Block], pose: &Pose, noise: u64) -> Vec<f32> {
    let center = pose.inverse().translation;
    let inverse = |row: usize, column: usize| {
        let bearing = Vector3::new(column as f64 - 0.5 * WIDTH as f64, row as f64 - 0.5 * HEIGHT as f64, FOCAL);
        range(blocks, &center, &(pose.rotation.inverse() * bearing.normalize())).recip()
    };
    // Of rays between the pixels' centers: those about pixel (0, 0) are at -0.5 and 0.5.
    let inverses: Vec<f64> =
        (0..=HEIGHT).flat_map(|row| (0..=WIDTH).map(move |column| (row, column))).map(|(r, c)| inverse(r, c)).collect();
    let mut random = Random::new(noise);
    let mut edges: Vec<f32> =
        (0..DIRECTIONS * WIDTH * HEIGHT).map(|_| BUSY * random.uniform(0.0, 1.0).powi(3) as f32).collect();
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            let at = |down: usize, right: usize| inverses[(row + down) * (WIDTH + 1) + column + right];
            let across =
                Vector2::new(at(0, 1) + at(1, 1) - at(0, 0) - at(1, 0), at(1, 0) + at(1, 1) - at(0, 0) - at(0, 1));
            let most = at(0, 0).max(at(0, 1)).max(at(1, 0)).max(at(1, 1));
            if across.norm() > 0.25 * most {
                let direction = (across.y.atan2(across.x) / (0.25 * PI)).round().rem_euclid(4.0) as usize;
                edges[(direction * HEIGHT + row) * WIDTH + column] = 4.0;
            }
        }
    }
    for _ in 0..60 {
        let direction = random.index(DIRECTIONS);
        let along = (direction as f64 + 2.0) * 0.25 * PI;
        let (x, y) = (random.uniform(0.0, WIDTH as f64), random.uniform(0.0, HEIGHT as f64));
        for step in 0..random.index(60) {
            let (x, y) = (x + along.cos() * step as f64, y + along.sin() * step as f64);
            if (0.0..WIDTH as f64).contains(&x) && (0.0..HEIGHT as f64).contains(&y) {
                edges[(direction * HEIGHT + y as usize) * WIDTH + x as usize] = 4.0;
            }
        }
    }
    edges
}

/// A picture spread by a Gaussian.
fn spread(picture: &[f32], spread: f64) -> Vec<f32> {
    let reach = (3.0 * spread).ceil() as usize;
    let bell = |away: usize| (-0.5 * (away as f64 / spread).powi(2)).exp();
    let whole = bell(0) + 2.0 * (1..=reach).map(bell).sum::<f64>();
    blurred(picture, WIDTH, &(0..=reach).map(|away| bell(away) / whole).collect::<Vec<f64>>())
}

/// Likelihood ratios of an edge by spread: half of the cloud's edges are in the photo, the others anywhere in a window (eq. 18.2).
fn log_ratios(edges: &[f32]) -> [Arc<LogRatios>; SPREADS] {
    SPREADS_PX.map(|width| {
        let mut values = Vec::with_capacity(edges.len());
        for picture in edges.chunks(WIDTH * HEIGHT) {
            let (shares, means) = (spread(picture, width), spread(picture, WINDOW.max(3.0 * width)));
            values.extend(shares.iter().zip(&means).map(|(share, mean)| (0.5 + 0.5 * share / mean).ln()));
        }
        Arc::new(LogRatios::new(&values, HEIGHT, WIDTH, (width / 4.0).max(1.0) as usize).unwrap())
    })
}

fn photo(edges: &[f32]) -> PhotoView {
    let pixel = |bearing: &Vector3<f64>| {
        let seen =
            bearing.xy() * (FOCAL / bearing.z) + Vector2::new(0.5 * WIDTH as f64 - 0.5, 0.5 * HEIGHT as f64 - 0.5);
        if bearing.z > 0.0 { seen } else { Vector2::repeat(f64::NAN) }
    };
    let projection =
        Projection::new([WIDTH as f64, HEIGHT as f64], |bearings| Ok::<_, Error>(bearings.iter().map(pixel).collect()));
    let half_field = (Vector2::new(WIDTH as f64, HEIGHT as f64).norm() / (2.0 * FOCAL)).atan();
    PhotoView { projection: projection.unwrap(), pictures: log_ratios(edges), half_field }
}

const DETECTION: EdgeOptions = EdgeOptions { cell: 2e-3, gap: 0.03, step_fraction: 0.1 };

fn frame(seed: u64) -> Frame {
    let blocks = blocks(seed);
    let edges = CloudEdges::new(&scan(&blocks), None, &Vector3::zeros(), &DETECTION);
    Frame::new(photo(&edges_of_photo(&blocks, &truth(), seed)), &edges, Vector3::zeros())
}

/// Frames of one rig at different places.
static FRAMES: LazyLock<[Frame; 2]> = LazyLock::new(|| [101, 102].map(frame));

/// The camera is near the scanner and about upright.
fn near_density() -> PoseDensity {
    let near = Prior::default().with_near(Vector3::zeros(), Some(0.3)).unwrap();
    PoseDensity::of_prior(&near.with_up(Vector3::z(), Some(3.0 * PI / 180.0)).unwrap()).unwrap()
}

/// A tenth of the default's work.
const OPTIONS: SearchOptions = SearchOptions { draws: 8000, kept: [200, 60, 16], threads: Some(2) };

fn found(frames: &[Frame], starts: &[Pose], draws: usize) -> Vec<Mode> {
    search(frames, &near_density(), starts, &SearchOptions { draws, ..OPTIONS }).unwrap()
}

/// How far the edges are from where a pose has them, pixels: a root mean square.
fn pixels_off(frame: &Frame, pose: &Pose) -> f64 {
    let increment = truth().local_coordinates(pose);
    let (squares, _) = frame.visible_edges(&truth(), FINEST, &Budget::unlimited()).square_moves(&truth());
    increment.dot(&(squares * increment)).sqrt()
}

fn deviations(mode: &Mode) -> f64 {
    let off = mode.pose.local_coordinates(&truth());
    off.dot(&mode.covariance.cholesky().unwrap().solve(&off)).sqrt()
}

fn log_volume(mode: &Mode) -> f64 {
    0.5 * mode.covariance.determinant().ln()
}

fn assert_finite(modes: &[Mode]) {
    for mode in modes {
        let numbers = mode.covariance.iter().chain(&mode.pose.translation).chain(mode.pose.rotation.matrix().iter());
        assert!(numbers.chain([&mode.log_mass, &mode.log_ratio]).all(|value| value.is_finite()), "{mode:?}");
        assert!(mode.covariance.cholesky().is_some(), "{}", mode.covariance);
    }
}

/// Poses that the widest spread distinguishes of those about the true one.
fn distinct_about_truth(frames: &[Frame], rotation: f64, place: f64) -> f64 {
    let prior = Prior::default().with_initial(truth(), Some(PoseSigma { rotation, place })).unwrap();
    distinct_poses(frames, &PoseDensity::of_prior(&prior).unwrap(), Some(2), &Budget::unlimited()).unwrap()
}

/// In the limits: one pose of a narrow prior, and a volume that grows with the product of all deviations.
#[test]
fn distinct_poses_are_a_volume_of_the_prior() {
    let frames = &*FRAMES;
    let narrow = distinct_about_truth(&frames[..1], 1e-4, 1e-4);
    assert!(narrow > 1.0 && narrow < 1.001, "{narrow}");
    // Of what the photo sees at the true pose: directions in which edges move by sigma times their derivative.
    let (squares, _) = frames[0].visible_edges(&truth(), 0, &Budget::unlimited()).square_moves(&truth());
    let sigmas = Vector6::new(0.02, 0.02, 0.02, 0.05, 0.05, 0.05);
    let scaled = Matrix6::from_fn(|row, column| squares[(row, column)] * sigmas[row] * sigmas[column]);
    let expected = (Matrix6::identity() + scaled / SPREADS_PX[0].powi(2)).determinant().sqrt();
    let found = distinct_about_truth(&frames[..1], 0.02, 0.05);
    assert!((found / expected).ln().abs() < 0.1, "{found}, expected {expected}");
    // A second frame of the rig distinguishes no more poses: the mean of both.
    let [one, other] = [0, 1].map(|frame| distinct_about_truth(&frames[frame..=frame], 0.1, 0.3));
    let both = distinct_about_truth(frames, 0.1, 0.3);
    assert!(both > 0.9 * one.min(other) && both < 1.3 * one.max(other), "{both} of {one} and {other}");
}

/// By weights of its own null poses the ascent ends where the search ends, and by those about a pose beside it at a maximum at
/// the same place, whose mass differs by the weights' errors alone.
#[test]
fn a_maximum_by_given_weights_is_that_of_the_search() {
    let (frames, density) = (&FRAMES[..1], near_density());
    let beside = |turn: f64| truth().retract(&Vector6::new(0.0, turn, 0.0, 0.02, 0.0, 0.0));
    let found = search(frames, &density, &[beside(0.003)], &SearchOptions { draws: 0, ..OPTIONS }).unwrap()[0];
    for at in [beside(0.003), beside(0.02)] {
        let mode = LocalWeights::about(frames, &at, &Budget::unlimited())
            .maximum(frames, &density, &beside(0.003), &Budget::unlimited())
            .unwrap();
        assert!((mode.log_mass / found.log_mass - 1.0).abs() < 0.3, "{} {}", mode.log_mass, found.log_mass);
        assert!(pixels_off(&FRAMES[0], &mode.pose) < 1.5 && mode.edges == found.edges, "{mode:?}");
    }
    let none = frames[0].with_edges(&nothing());
    let weights = LocalWeights::about(std::slice::from_ref(&none), &truth(), &Budget::unlimited());
    assert_eq!(weights.maximum(&[none], &density, &truth(), &Budget::unlimited()).unwrap().edges, 0);
}

/// Edges within the field of a camera are those of the whole cloud there, as dense as these are.
#[test]
fn edges_within_a_field_are_those_of_the_whole_cloud() {
    let points = scan(&blocks(101));
    let whole = CloudEdges::new(&points, None, &Vector3::zeros(), &DETECTION);
    let axis = truth().rotation.inverse() * Vector3::z();
    let field = EdgeField::cones(&[axis], 0.9).unwrap();
    let within = CloudEdges::within(&points, None, &Vector3::zeros(), &DETECTION, &field);
    let inside = |edges: &CloudEdges, angle: f64| {
        let middles = (0..edges.len()).map(|edge| edges.at(edge).0);
        middles.filter(|middle| middle.normalize().dot(&axis) > angle.cos()).collect::<Vec<_>>()
    };
    // A gap from the border of the field, neighbors are missing.
    assert_eq!(inside(&within, 0.9 - 2.0 * DETECTION.gap), inside(&whole, 0.9 - 2.0 * DETECTION.gap));
    assert!(within.len() < whole.len() / 2 && !within.is_empty());
    let frame = &FRAMES[0];
    for spread in 0..SPREADS {
        let (of_whole, of_within) = (
            frame.log_ratio(&truth(), spread, &Budget::unlimited()),
            frame.with_edges(&within).log_ratio(&truth(), spread, &Budget::unlimited()),
        );
        // As many of both are drawn, but not the same ones.
        let (few, many) = (of_whole.1.min(of_within.1) as f64, of_whole.1.max(of_within.1) as f64);
        assert!(many - few < 4.0 * many.sqrt(), "{few} {many}");
    }
}

fn nothing() -> CloudEdges {
    CloudEdges::new(&[], None, &Vector3::zeros(), &DETECTION)
}

/// The heading is free; edges of the scan are up to half a ray's spacing off, more than a pixel.
#[test]
fn the_pose_is_found_from_no_heading() {
    for frame in &*FRAMES {
        let modes = found(std::slice::from_ref(frame), &[], OPTIONS.draws);
        assert_finite(&modes);
        let best = &modes[0];
        let (off, deviations) = (pixels_off(frame, &best.pose), deviations(best));
        assert!(off < 1.5, "{off} px");
        // Of six normal numbers, of which few have a root of squares beyond 4; and none much below 1.
        assert!(deviations > 0.3 && deviations < 4.0, "{deviations}");
        assert!(best.log_mass > 5.0 && best.edges > 1000, "{best:?}");
        let rotation = best.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        assert!(rotation > 1e-3 && rotation < 0.015, "{rotation}");
        assert!(modes.windows(2).all(|pair| pair[0].log_mass >= pair[1].log_mass));
        assert!(modes.len() <= OPTIONS.kept[FINEST - 1]);
        for (number, mode) in modes.iter().enumerate() {
            let apart = modes[..number].iter().map(|other| {
                let way = other.pose.local_coordinates(&mode.pose);
                let (squares, _) =
                    frame.visible_edges(&other.pose, FINEST, &Budget::unlimited()).square_moves(&other.pose);
                way.dot(&(squares * way)).sqrt() / SPREADS_PX[FINEST]
            });
            assert!(apart.fold(f64::INFINITY, f64::min) > 0.49, "{number} is there already");
        }
    }
}

/// Photo and cloud of one place, and then of another as well; the same one twice is redundant.
#[test]
fn another_place_adds_information_and_the_same_one_again_does_not() {
    let [one, other] = &*FRAMES;
    let best = |frames: &[Frame]| found(frames, &[truth()], 0)[0];
    let (alone, elsewhere) = (best(std::slice::from_ref(one)), best(std::slice::from_ref(other)));
    let copies = best(&[one.clone(), one.clone()]);
    let both = best(&[one.clone(), other.clone()]);
    assert!((copies.log_mass - alone.log_mass).abs() < 2.5, "{} {}", copies.log_mass, alone.log_mass);
    let volume = log_volume(&copies) - log_volume(&alone);
    assert!(volume.abs() < 1.0, "{volume}");
    assert_eq!(
        copies.edges / 2,
        one.visible_edges(&copies.pose, FINEST, &Budget::unlimited()).square_moves(&copies.pose).1
    );
    assert!(both.log_mass > alone.log_mass.max(elsewhere.log_mass), "{} {}", both.log_mass, alone.log_mass);
    assert!(deviations(&both) < 4.0, "{}", deviations(&both));
    let (volume, mean) = (log_volume(&both), 0.5 * (log_volume(&alone) + log_volume(&elsewhere)));
    assert!(volume < mean - 0.5, "{volume} {mean}");
}

#[test]
fn starts_alone_suffice_and_without_any_there_is_no_pose() {
    let frames = &FRAMES[..1];
    let start = truth().retract(&Vector6::new(0.02, -0.02, 0.01, 0.05, 0.05, -0.05));
    let modes = found(frames, &[start], 0);
    assert!(modes.len() == 1 && pixels_off(&frames[0], &modes[0].pose) < 1.5);
    // From one place twice there is one maximum.
    assert_eq!(found(frames, &[start, start], 0).len(), 1);
    assert!(found(frames, &[], 0).is_empty());
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads() {
    let of = |threads| {
        let options = SearchOptions { draws: 300, kept: [20, 10, 5], threads: Some(threads) };
        search(&FRAMES[..1], &near_density(), &[], &options)
            .unwrap()
            .iter()
            .map(|mode| (mode.pose, mode.log_mass))
            .collect::<Vec<_>>()
    };
    assert_eq!(of(1), of(2));
}

#[test]
fn all_of_the_work_is_counted_however_little_is_left_to_do() {
    for (draws, starts) in [(300, vec![]), (0, vec![truth(), truth()]), (0, vec![])] {
        let (options, progress) = (SearchOptions { draws, kept: [20, 10, 5], ..OPTIONS }, SearchProgress::default());
        assert!(progress.fraction() < 1e-12);
        search_with_progress(&FRAMES[..1], &near_density(), &starts, &options, &progress, &Budget::unlimited())
            .unwrap();
        assert!((progress.fraction() - 1.0).abs() < 1e-12, "{}", progress.fraction());
    }
}

/// Asked at a third of the questions of a whole search, it has done less than half of its work.
#[test]
fn a_canceled_search_ends_soon() {
    let options = SearchOptions { draws: 800, kept: [100, 40, 10], threads: Some(1) };
    let work = |most: usize| {
        let asked = Arc::new(AtomicUsize::new(0));
        let stop: Cancel = {
            let asked = asked.clone();
            Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) >= most)
        };
        let budget = Budget::cancellable(stop);
        let progress = SearchProgress::default();
        search_with_progress(&FRAMES[..1], &near_density(), &[], &options, &progress, &budget).unwrap();
        (!budget.is_canceled(), budget.charged(), asked.load(Ordering::Relaxed))
    };
    let (is_whole, whole, asked) = work(usize::MAX);
    assert!(is_whole && asked > 10, "{asked}");
    for most in [0, asked / 3] {
        let (is_whole, counted, _) = work(most);
        assert!(!is_whole && counted < whole / 2, "{counted} of {whole}");
    }
}

/// A cloud without edges, with one of them, and cameras that face away from all of them.
#[test]
fn few_edges_or_none_leave_the_prior() {
    let frame = &FRAMES[0];
    let edges = CloudEdges::new(&scan(&blocks(101)), None, &Vector3::zeros(), &DETECTION);
    let nowhere = Prior::default().with_near(Vector3::new(0.0, 0.0, 4000.0), Some(1.0)).unwrap();
    let somewhere = Prior::default().with_near(Vector3::zeros(), Some(0.3)).unwrap();
    let anywhere = [nowhere, somewhere].map(|prior| PoseDensity::of_prior(&prior).unwrap());
    let student = PoseDensity::student(truth(), &(Matrix6::identity() * 1e-4)).unwrap();
    let options = SearchOptions { draws: 100, kept: [10, 8, 6], threads: Some(1) };
    let thinned = |most: usize| edges.thinned(&Thinning::to(most, edges.len()));
    for edges in [nothing(), thinned(1), thinned(2), thinned(40)] {
        let frames = [frame.with_edges(&edges)];
        for density in [&near_density(), &student, &anywhere[0], &anywhere[1]] {
            for frames in [&frames[..], &[frames[0].clone(), frame.clone()], &[]] {
                let modes = search(frames, density, &[truth()], &options).unwrap();
                assert_finite(&modes);
                // A prior's own mass is 1, about; angles that it leaves open have a little more than a bell's.
                let is_likely = |mode: &Mode| mode.edges > 0 || mode.log_mass.abs() < 3.0;
                assert!(modes.iter().all(is_likely), "{:?}", modes[0]);
            }
        }
    }
}

/// Directions across edges stay as they are near a pose, so that what is summed there has a slope but for the kinks between pixels.
#[test]
fn slopes_of_sums_are_their_derivatives() {
    let frame = &FRAMES[0];
    let pose = truth().retract(&Vector6::new(0.01, 0.02, -0.01, 0.03, 0.1, -0.05));
    for spread in 0..SPREADS {
        let budget = Budget::unlimited();
        let seen = frame.visible_edges(&pose, spread, &budget);
        let (sum, count) = frame.log_ratio(&pose, spread, &budget);
        let (same, _) = seen.log_ratio(&pose, 0.0);
        assert!((sum - same).abs() < 1e-3 * count as f64, "{sum} {same}");
        assert_eq!(seen.square_moves(&pose).1, count);
        assert!((seen.log_ratio(&pose, 0.25).0 - (sum - 0.25 * count as f64)).abs() < 1e-3 * count as f64);
        let (_, slope) = seen.log_ratio(&pose, 0.0);
        let value = |by: &Tangent| seen.log_ratio(&pose.retract(by), 0.0).0;
        let count = |by: &Tangent| seen.square_moves(&pose.retract(by)).1;
        for axis in 0..6 {
            // Edges that come into view are steps of the sum.
            let ways =
                [4e-4, 2e-4, 1e-4, 5e-5].map(|step| Vector6::ith(axis, if axis < 3 { step } else { 5.0 * step }));
            let step = ways.into_iter().find(|way| count(way) == count(&-way)).unwrap();
            let expected = (value(&step) - value(&-step)) / (2.0 * step.norm());
            let scale = slope.amax();
            assert!((slope[axis] - expected).abs() < 0.04 * scale, "{spread} {axis}: {} {expected}", slope[axis]);
        }
    }
}

/// As projected in double precision at nearby poses.
#[test]
fn moves_of_edges_are_those_of_their_pixels() {
    let frame = &FRAMES[0];
    let budget = Budget::unlimited();
    let seen = frame.visible_edges(&truth(), FINEST, &budget);
    let (squares, _) = seen.square_moves(&truth());
    let (before, directions) = seen.pixels(&truth());
    assert_eq!(before.len(), directions.len());
    let inside = |pixel: &Vector2<f64>| {
        (0.0..WIDTH as f64 - 1.0).contains(&pixel.x) && (0.0..HEIGHT as f64 - 1.0).contains(&pixel.y)
    };
    for way in 0..6 {
        let increment = Vector6::ith(way, 2e-3);
        let (after, _) = seen.pixels(&truth().retract(&increment));
        let moves: Vec<f64> = before
            .iter()
            .zip(&after)
            .filter(|(pixel, _)| inside(pixel))
            .map(|(one, other)| (other - one).norm_squared())
            .collect();
        let mean = moves.iter().sum::<f64>() / moves.len() as f64;
        let expected = increment.dot(&(squares * increment));
        assert!((mean / expected - 1.0).abs() < 0.03, "{way}: {mean} {expected}");
    }
}

/// Where nothing is seen the posterior is the prior; a weight of nothing makes it the prior as well.
#[test]
fn edges_without_weight_leave_the_prior() {
    let density = near_density();
    for weight in [Weight::Tempered(0.0), Weight::Standardized { offset: -0.1, scale: 0.0 }] {
        let posterior = Posterior { frames: &FRAMES[..1], weights: vec![weight], spread: FINEST, density: &density };
        let start = truth().retract(&Vector6::new(0.03, 0.0, 0.02, 0.2, 0.1, 0.0));
        assert!((posterior.log_density(&start, &Budget::unlimited()) - density.at(&start).value).abs() < 1e-9);
        let (pose, value) = posterior.maximum(&start, &Budget::unlimited());
        assert!((value - density.at(&pose).value).abs() < 1e-9);
        let up = Rotation3::rotation_between(&Vector3::z(), &-Vector3::y()).unwrap();
        assert!(density.at(&Pose::new(up, Vector3::zeros())).value - value < 0.02, "{value}");
    }
}
