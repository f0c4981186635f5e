//! Times of sums over the edges of a cloud, in which the search of a pose spends its time; criterion's iterations are edges.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use criterion::{Bencher, Criterion, criterion_group, criterion_main};
use nalgebra::{Rotation3, Vector2, Vector3, Vector6};
use regionpose::Error;
use regionpose::Pose;
use regionpose::internals::alignment::cloud_edges::{CloudEdges, EdgeOptions};
use regionpose::internals::alignment::frame::{FINEST, Frame, PhotoView, SPREADS, SPREADS_PX};
use regionpose::internals::alignment::pictures::{DIRECTIONS, LogRatios};
use regionpose::internals::alignment::projection::Projection;
use regionpose::internals::budget::Budget;

/// Poses that take turns, so that the processor learns none of them.
const POSES: usize = 16;

/// The numbers of an evenly spread sequence in three dimensions, from 0 to 1.
fn even(number: usize) -> [f64; 3] {
    [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|step| (0.5 + number as f64 * step).fract())
}

/// Points all around, 5 to 50 m away: next to any there is a step in depth.
fn edges() -> CloudEdges {
    let point = |number: usize| {
        let [height, around, depth] = even(number);
        let (height, around) = (2.0 * height - 1.0, TAU * around);
        let side = (1.0 - height * height).sqrt();
        Vector3::new(side * around.cos(), side * around.sin(), height) * (5.0 + 45.0 * depth)
    };
    let points: Vec<_> = (0..12_000).map(point).collect();
    CloudEdges::new(&points, None, &Vector3::zeros(), &EdgeOptions { cell: 1e-3, gap: 0.1, step_fraction: 0.1 })
}

/// A photo of noise, averaged over half the spread of the edges.
fn frame(
    edges: &CloudEdges,
    [width, height]: [usize; 2],
    half_field: f64,
    project: impl Fn(&Vector3<f64>) -> Vector2<f64>,
) -> Frame {
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 - 0.6
    };
    let values: Vec<f32> = (0..DIRECTIONS * width * height).map(|_| noise()).collect();
    let pictures = std::array::from_fn::<_, SPREADS, _>(|spread| {
        Arc::new(LogRatios::new(&values, height, width, (SPREADS_PX[spread] / 2.0) as usize).expect("a picture"))
    });
    let pixels = |bearings: &[Vector3<f64>]| Ok::<_, Error>(bearings.iter().map(&project).collect());
    let projection = Projection::new([width as f64, height as f64], pixels).expect("a camera that sees something");
    Frame::new(PhotoView { projection, pictures, half_field }, edges, Vector3::zeros())
}

fn pinhole(bearing: &Vector3<f64>) -> Vector2<f64> {
    let place = bearing.xy() / bearing.z * 718.0 + Vector2::new(607.0, 185.0);
    if bearing.z > 0.0 { place } else { Vector2::repeat(f64::NAN) }
}

/// An equidistant lens with a little more distortion.
fn fisheye(bearing: &Vector3<f64>) -> Vector2<f64> {
    let side = bearing.xy().norm();
    let angle = side.atan2(bearing.z);
    let place = bearing.xy() * (500.0 * angle * (1.0 - 0.02 * angle * angle) / side.max(1e-12));
    if angle < 0.75 * PI { place + Vector2::new(639.5, 511.5) } else { Vector2::repeat(f64::NAN) }
}

/// Poses of all directions, some decimeters from the scanner.
fn poses() -> Vec<Pose> {
    let pose = |number: usize| {
        let [a, b, c] = even(number);
        let turn = Rotation3::from_euler_angles(TAU * a, TAU * b, TAU * c);
        Pose::new(turn, Vector3::new(a - 0.5, b - 0.5, c - 0.5))
    };
    (0..POSES).map(pose).collect()
}

/// The time of `work` for each edge that it evaluates.
fn by_edge(bencher: &mut Bencher<'_>, edges: u64, mut work: impl FnMut()) {
    bencher.iter_custom(|wanted| {
        let rounds = wanted.div_ceil(edges);
        let start = Instant::now();
        (0..rounds).for_each(|_| work());
        Duration::from_secs_f64(start.elapsed().as_secs_f64() * wanted as f64 / (rounds * edges) as f64)
    });
}

fn sums(criterion: &mut Criterion) {
    let (edges, poses) = (edges(), poses());
    let frames = [
        ("pinhole", frame(&edges, [1241, 376], 0.74, pinhole)),
        ("fisheye", frame(&edges, [1280, 1024], 0.56 * PI, fisheye)),
    ];
    for (camera, frame) in &frames {
        for spread in [0, FINEST] {
            let name = |of: &str| format!("{of}/{camera}/{} px", SPREADS_PX[spread]);
            let budget = Budget::unlimited();
            let shown: usize = poses.iter().map(|pose| frame.log_ratio(pose, spread, &budget).1).sum();
            let looked_at = budget.charged();
            let at_all = || {
                for pose in &poses {
                    black_box(frame.log_ratio(pose, spread, &budget));
                }
            };
            println!("{camera}: {} edges a pose, {} shown", looked_at / POSES as u64, shown / POSES);
            criterion.bench_function(&name("log_ratio"), |b| by_edge(b, looked_at, at_all));
            let from_all = || {
                for pose in &poses {
                    black_box(frame.visible_edges(pose, spread, &budget));
                }
            };
            criterion.bench_function(&name("visible_edges"), |b| by_edge(b, looked_at, from_all));
            let visible = frame.visible_edges(&poses[0], spread, &budget);
            let held = visible.pixels(&poses[0]).0.len() as u64;
            let moved: Vec<_> = (0..POSES)
                .map(|number| {
                    let [a, b, c] = even(number).map(|part| 0.02 * (part - 0.5));
                    poses[0].retract(&Vector6::new(a, b, c, b, c, a))
                })
                .collect();
            criterion.bench_function(&name("visible log_ratio"), |b| {
                by_edge(b, held * POSES as u64, || {
                    for pose in &moved {
                        black_box(visible.log_ratio(pose, 0.1));
                    }
                });
            });
            criterion.bench_function(&name("square_moves"), |b| {
                by_edge(b, held, || {
                    black_box(visible.square_moves(&poses[0]));
                });
            });
        }
    }
}

criterion_group!(benches, sums);
criterion_main!(benches);
