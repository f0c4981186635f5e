//! Sums of log likelihood ratios under the edges of a cloud, against ones taken edge by edge in double precision.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector2, Vector3, Vector6};
use regionpose::Error;
use regionpose::Pose;
use regionpose::internals::alignment::cloud_edges::{CloudEdges, EdgeOptions, Thinning};
use regionpose::internals::alignment::density::PoseDensity;
use regionpose::internals::alignment::frame::{Frame, MOST_EDGES, PhotoView, SPREADS};
use regionpose::internals::alignment::pictures::{DIRECTIONS, LogRatios};
use regionpose::internals::alignment::projection::Projection;
use regionpose::internals::alignment::search::{SearchOptions, search};
use regionpose::internals::budget::Budget;

use crate::support::random::Random;

const SIZE: [usize; 2] = [620, 188];
const FOCAL: f64 = 359.0;
const CENTER: [f64; 2] = [303.0, 92.0];
const REDUCTIONS: [usize; SPREADS] = [8, 4, 2, 1];

/// Pixels that single precision is off by, at most: some roundings of a place of 1000 pixels.
const ROUNDING_PX: f64 = 1e-3;

/// The shortest wave of a picture, pixels, and what follows for its steepest slope and its largest curvature.
const WAVE_PX: f64 = 100.0;
const SLOPE: f64 = TAU / WAVE_PX;
const CURVATURE: f64 = SLOPE * SLOPE;

fn pinhole(bearing: &Vector3<f64>) -> Vector2<f64> {
    let place = bearing.xy() / bearing.z * FOCAL + Vector2::from(CENTER);
    if bearing.z > 0.0 { place } else { Vector2::repeat(f64::NAN) }
}

/// An equidistant lens that sees half a turn along the picture's longer side, and so five faces of the cube.
fn fisheye(bearing: &Vector3<f64>) -> Vector2<f64> {
    let side = bearing.xy().norm();
    bearing.xy() * (190.0 * side.atan2(bearing.z) / side.max(1e-12)) + Vector2::new(309.5, 93.5)
}

/// A picture of waves from -1 to 1 that fades to 0 at the photo's sides, so that no edge comes or goes with a jump.
fn picture() -> Vec<f32> {
    let [width, height] = SIZE;
    let value = |direction: usize, row: usize, column: usize| {
        let fade = |place: usize, size: usize| (PI * place as f64 / (size - 1) as f64).sin();
        let turn = direction as f64 * 0.8;
        let place = column as f64 * turn.cos() + row as f64 * turn.sin();
        // Slower than the shortest wave, for what the fading adds.
        let wave = (0.4 * SLOPE * place + turn).cos();
        (wave * fade(row, height) * fade(column, width)) as f32
    };
    let rows = (0..DIRECTIONS).flat_map(|direction| (0..height).map(move |row| (direction, row)));
    rows.flat_map(|(direction, row)| (0..width).map(move |column| value(direction, row, column))).collect()
}

/// Points all around, so far from their neighbors in depth that there are edges.
fn edges(count: usize) -> CloudEdges {
    let mut random = Random::new(19);
    let points: Vec<_> = (0..count).map(|_| random.direction() * random.uniform(5.0, 50.0)).collect();
    CloudEdges::new(&points, None, &Vector3::zeros(), &EdgeOptions { cell: 1e-3, gap: 0.2, step_fraction: 0.1 })
}

fn frame(edges: &CloudEdges, half_field: f64, project: impl Fn(&Vector3<f64>) -> Vector2<f64>) -> Frame {
    let [width, height] = SIZE;
    let values = picture();
    let pictures = REDUCTIONS.map(|reduction| Arc::new(LogRatios::new(&values, height, width, reduction).unwrap()));
    let pixels = |bearings: &[Vector3<f64>]| Ok::<_, Error>(bearings.iter().map(&project).collect());
    let projection = Projection::new(SIZE.map(|size| size as f64), pixels).unwrap();
    Frame::new(PhotoView { projection, pictures, half_field }, edges, Vector3::new(0.3, -0.2, 0.1))
}

/// One whose half field is the angle to the farthest corner.
fn pinhole_frame(edges: &CloudEdges) -> Frame {
    let corner = CENTER[0].max(SIZE[0] as f64 - CENTER[0]).hypot(CENTER[1].max(SIZE[1] as f64 - CENTER[1]));
    frame(edges, (corner / FOCAL).atan(), pinhole)
}

fn fisheye_frame(edges: &CloudEdges) -> Frame {
    frame(edges, 310.0_f64.hypot(94.0) / 190.0, fisheye)
}

fn pose(random: &mut Random) -> Pose {
    Pose::new(random.rotation(), random.direction() * random.uniform(0.0, 2.0))
}

/// A picture averaged over squares, and the values between its pixels.
struct Reduced {
    values: Vec<f64>,
    rows: usize,
    columns: usize,
    reduction: usize,
}

impl Reduced {
    fn new(reduction: usize) -> Self {
        let ([width, height], full) = (SIZE, picture());
        let (rows, columns) = (height.div_ceil(reduction), width.div_ceil(reduction));
        let mean = |direction: usize, row: usize, column: usize| {
            let down = row * reduction..((row + 1) * reduction).min(height);
            let right = column * reduction..((column + 1) * reduction).min(width);
            let count = (down.len() * right.len()) as f64;
            let held = down.flat_map(|row| right.clone().map(move |column| (row, column)));
            held.map(|(row, column)| f64::from(full[(direction * height + row) * width + column])).sum::<f64>() / count
        };
        let lines = (0..DIRECTIONS).flat_map(|direction| (0..rows).map(move |row| (direction, row)));
        let values = lines
            .flat_map(|(direction, row)| (0..columns).map(move |column| (direction, row, column)))
            .map(|(direction, row, column)| mean(direction, row, column))
            .collect();
        Self { values, rows, columns, reduction }
    }

    /// The value at a pixel, and whether it lies so near the side of the picture that roundings decide whether it is shown.
    fn at(&self, pixel: Vector2<f64>, direction: usize) -> (Option<f64>, bool) {
        let place = pixel.map(|value| (value + 0.5) / self.reduction as f64 - 0.5);
        let last = Vector2::new(self.columns as f64 - 1.0, self.rows as f64 - 1.0);
        let inside = (0..2).map(|axis| place[axis].min(last[axis] - place[axis])).fold(f64::INFINITY, f64::min);
        let doubt = inside.abs() < ROUNDING_PX;
        if inside.is_nan() || inside <= 0.0 {
            return (None, doubt);
        }
        let (first, beyond) = (place.map(f64::floor), place.map(f64::fract));
        let value = |down: usize, right: usize| {
            let (row, column) = (first.y as usize + down, first.x as usize + right);
            self.values[(direction * self.rows + row) * self.columns + column]
        };
        let upper = value(0, 0) * (1.0 - beyond.x) + value(0, 1) * beyond.x;
        let lower = value(1, 0) * (1.0 - beyond.x) + value(1, 1) * beyond.x;
        (Some(upper * (1.0 - beyond.y) + lower * beyond.y), doubt)
    }
}

/// The sum at a pose, the number of edges, and how many of these are decided by roundings.
fn reference(edges: &CloudEdges, picture: &Reduced, pose: &Pose) -> (f64, usize, usize) {
    let (mut sum, mut count, mut doubts) = (0.0, 0, 0);
    for edge in 0..edges.len() {
        let (middle, across) = edges.at(edge);
        let (bearing, across) = (pose.transform(&middle), pose.rotation * across);
        if bearing.z <= 0.0 {
            continue;
        }
        let way = (across.xy() - bearing.xy() * (across.z / bearing.z)) / bearing.z;
        let eighths = (way.y.atan2(way.x) / (PI / 4.0)).rem_euclid(4.0);
        let (value, side) = picture.at(pinhole(&bearing), eighths.round() as usize % DIRECTIONS);
        let between = (eighths.fract() - 0.5).abs() < 1e-4;
        doubts += usize::from(side || (between && value.is_some()));
        sum += value.unwrap_or(0.0);
        count += usize::from(value.is_some());
    }
    (sum, count, doubts)
}

#[test]
fn sums_are_those_taken_edge_by_edge() {
    let edges = edges(3000);
    let frame = pinhole_frame(&edges);
    let mut random = Random::new(3);
    for (spread, reduction) in REDUCTIONS.into_iter().enumerate() {
        let (held, picture) = (edges.thinned(&Thinning::to(MOST_EDGES[spread], edges.len())), Reduced::new(reduction));
        let mut all = 0;
        for _ in 0..20 {
            let pose = pose(&mut random);
            let (sum, count) = frame.log_ratio(&pose, spread, &Budget::unlimited());
            let (wanted, shown, doubts) = reference(&held, &picture, &pose);
            // An edge in doubt is worth 2 at most.
            let bound = count as f64 * SLOPE * ROUNDING_PX + 2.0 * doubts as f64;
            assert!((sum - wanted).abs() <= bound, "{sum} for {wanted} by {reduction} pixels, within {bound}");
            assert!(count.abs_diff(shown) <= doubts, "{count} edges for {shown}, {doubts} in doubt");
            all += count;
        }
        assert!(all > 500, "{all} edges are too few for this test");
    }
}

#[test]
fn edges_that_are_seen_from_a_pose_have_the_same_sum_there() {
    let edges = edges(3000);
    let mut random = Random::new(4);
    for frame in [pinhole_frame(&edges), fisheye_frame(&edges)] {
        for spread in 0..SPREADS {
            let pose = pose(&mut random);
            let (sum, count) = frame.log_ratio(&pose, spread, &Budget::unlimited());
            let (same, _) = frame.visible_edges(&pose, spread, &Budget::unlimited()).log_ratio(&pose, 0.25);
            // The order alone differs: values are 1 at most, and of the sum of 32 five roundings are.
            assert!((same - (sum - 0.25 * count as f64)).abs() <= 5.0 * count as f64 * f64::from(f32::EPSILON));
        }
    }
}

/// Slopes change by the picture's curvature within a step and at the kinks between pixels, and moves by a twentieth where the table's cells
/// bend them: errors of edges that lie anywhere, of which four deviations are a bound.
#[test]
fn slopes_are_those_of_the_sums() {
    let edges = edges(3000);
    let mut random = Random::new(5);
    for frame in [pinhole_frame(&edges), fisheye_frame(&edges)] {
        for _ in 0..20 {
            let pose = pose(&mut random);
            let budget = Budget::unlimited();
            let visible = frame.visible_edges(&pose, SPREADS - 1, &budget);
            let (squares, count) = visible.square_moves(&pose);
            let (_, slope) = visible.log_ratio(&pose, 0.0);
            for way in 0..6 {
                let moves = squares[(way, way)].sqrt();
                // Half a pixel for edges of the usual distance.
                let step = 0.5 / moves;
                let at = |sign: f64| {
                    let mut increment = Vector6::zeros();
                    increment[way] = sign * step;
                    visible.log_ratio(&pose.retract(&increment), 0.0).0
                };
                let wanted = (at(1.0) - at(-1.0)) / (2.0 * step);
                let bound = 4.0 * (count as f64).sqrt() * moves * (CURVATURE * (1.0 + 0.5) + 0.05 * SLOPE);
                let error = (slope[way] - wanted).abs();
                assert!(error <= bound, "{} for {wanted} in {way}, within {bound}", slope[way]);
            }
        }
    }
}

/// For the pinhole camera, moves follow from its focal length.
#[test]
fn mean_squares_of_moves_are_those_taken_edge_by_edge() {
    let edges = edges(3000);
    let frame = pinhole_frame(&edges);
    let mut random = Random::new(6);
    let (spread, picture) = (SPREADS - 1, Reduced::new(1));
    for _ in 0..10 {
        let pose = pose(&mut random);
        let (mut squares, mut count) = (Matrix6::zeros(), 0.0_f64);
        for edge in 0..edges.len().min(MOST_EDGES[spread]) {
            let bearing = pose.transform(&edges.at(edge).0);
            if bearing.z <= 0.0 || picture.at(pinhole(&bearing), 0).0.is_none() {
                continue;
            }
            let turn = Matrix3::new(0.0, -bearing.z, bearing.y, bearing.z, 0.0, -bearing.x, -bearing.y, bearing.x, 0.0);
            for axis in 0..2 {
                let mut by_bearing = Vector3::zeros();
                by_bearing[axis] = FOCAL / bearing.z;
                by_bearing.z = -FOCAL * bearing[axis] / bearing.z.powi(2);
                let by_turn = turn * by_bearing;
                let moves = Vector6::from_iterator(by_turn.iter().chain(by_bearing.iter()).copied());
                squares += moves * moves.transpose();
            }
            count += 1.0;
        }
        let wanted = squares / count.max(1.0);
        let (found, shown) = frame.visible_edges(&pose, spread, &Budget::unlimited()).square_moves(&pose);
        assert!((shown as f64 - count).abs() <= 1.0);
        let root = Matrix6::from_diagonal(&wanted.diagonal().map(|value| value.sqrt().recip()));
        let error = (root * (found - wanted) * root).amax();
        assert!(error <= 1e-3 + 2.0 * (shown as f64 - count).abs() / count.max(1.0), "{error}");
    }
}

#[test]
fn a_pose_is_found_to_be_the_same_on_any_number_of_threads() {
    let frames = [fisheye_frame(&edges(800))];
    let density = PoseDensity::student(
        Pose::new(Rotation3::new(Vector3::new(0.1, 0.2, 0.3)), Vector3::zeros()),
        &Matrix6::from_diagonal(&Vector6::new(0.1, 0.1, 0.1, 0.2, 0.2, 0.2).map(|sigma| sigma * sigma)),
    )
    .unwrap();
    let found = |threads: usize| {
        let options = SearchOptions { draws: 200, kept: [20, 8, 4], threads: Some(threads) };
        let modes = search(&frames, &density, &[], &options).unwrap();
        modes.iter().map(|mode| (mode.pose, mode.log_mass, mode.covariance)).collect::<Vec<_>>()
    };
    let alone = found(1);
    assert!(!alone.is_empty());
    for threads in [2, 3] {
        assert_eq!(found(threads), alone);
    }
}
