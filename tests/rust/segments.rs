//! Expectation propagation over contours that are dilated, with segments and corners that are off, against sampling.

use crate::support::random::Random;
use crate::support::samples::{MODEL, prior, site};
use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use regionpose::internals::budget::Budget;
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::math::gaussian::Normal;
use regionpose::internals::math::normal::density;
use regionpose::internals::samples::chain::SegmentRing;
use regionpose::internals::samples::ep::{ContourFactor, run_ep};
use regionpose::internals::samples::label_model::LabelModel;
use regionpose::internals::samples::margin::EdgeKind;
use regionpose::internals::samples::probit_site::LabelSite;
use regionpose::internals::samples::segment::{ContourSegment, SegmentState};

/// Spacing of the offsets that are integrated over, and their number to either side.
const SPACING: f64 = 0.2;
const OFFSETS: i32 = 100;

/// Offsets from one dilation that is integrated over to the next: 0.6 standard deviations of the widest.
const DILATED: i32 = 3;

/// Offsets of corners that are integrated over, to either side; and how far corners are off.
const CORNERS: i32 = 56;
const CORNER: f64 = 1.5;

/// Draws of the increment.
const DRAWS: usize = 4_000;

/// Offsets with the shares that a density gives them.
fn grid(density: impl Fn(f64) -> f64, spacing: f64, count: i32) -> Vec<(i32, f64)> {
    (-count..=count).map(|k| (k, spacing * density(spacing * f64::from(k)))).collect()
}

/// A label beside an end of a segment: the gradient of its margin, its side, and its margin.
type EndLabel = (Vector6<f64>, f64, f64);

/// The probability of the labels beside an end of a segment in either state, by the offset of its corner and dilation.
type EndTable = [Vec<f64>; 2];

/// Three labels beside either end of each of five segments, of two contours, which are off by so many pixels. The three of one close
/// a ring at corners of many angles; the rest of the other ring has no labels. Against draws of the increment's prior, for each of
/// which the contours' offsets are integrated on grids.
fn agree_with_sampling(dilation_sigma: f64, dilated: [f64; 2], off: [f64; 5]) {
    let mut random = Random::new(9);
    let states = [SegmentState { probability: 0.8, sigma: 0.0 }, SegmentState { probability: 0.2, sigma: 6.0 }];
    let model = LabelModel { contamination: 0.0, ..MODEL };
    let mut labels: Vec<EndLabel> = Vec::new();
    for segment in 0..5 {
        let gradient = Vector6::from_fn(|_, _| random.normal());
        for _ in 0..6 {
            let place = 3.0 * random.normal();
            let side = if off[segment] + dilated[segment / 3] > place { 1.0 } else { -1.0 };
            labels.push((gradient * side, side, -place * side));
        }
    }
    let end = |(k, (gradient, side, margin)): (usize, &EndLabel)| LabelSite {
        along: if k % 6 < 3 { 0.0 } else { 1.0 },
        ..site(*gradient, *side, *margin, model)
    };
    let sites: Vec<LabelSite> = labels.iter().enumerate().map(end).collect();
    let normals = [0.0, 2.5, 3.3, 0.4, 1.0].map(|angle: f64| Vector2::new(angle.cos(), angle.sin()));
    let lengths = [2.0, 3.0, 4.0, 2.0, 3.0, 5.0];
    let segment = |k: usize| ContourSegment::new(k, normals[k], lengths[k], (6 * k..6 * k + 6).collect(), states);
    let closed: Vec<ContourSegment> = (0..3).map(segment).collect();
    let open = vec![segment(3), segment(4), ContourSegment::new(5, Vector2::x(), lengths[5], Vec::new(), states)];
    let contour = |segments| {
        let rings = vec![SegmentRing { corner_sigma: CORNER, segments }];
        ContourFactor { region: 0, dilation_sigma, rings }
    };
    let mut contours = [closed, open].map(contour);
    let mut found_again =
        || run_ep(&prior(1.0), &Gaussian::default(), &sites, &mut contours, &Budget::unlimited()).unwrap();
    let found = found_again();
    // Sites stay, so that further sweeps settle: the evidence by the moments of the last one is theirs.
    let settled = (0..10).map(|_| found_again().log_evidence).last().unwrap();
    assert!((found.log_evidence - settled).abs() < 0.02, "{} against {settled}", found.log_evidence);
    // Transition from the state of one segment, a row each, to that of the next one, a column each.
    let next = |(one, other): (usize, usize)| {
        let same = (-0.5 * (lengths[one] + lengths[other]) / states[1].sigma).exp();
        Matrix2::from_fn(|from, to| states[to].probability * (1.0 - same) + if from == to { same } else { 0.0 })
    };
    let offsets = grid(|d| density(d / states[1].sigma) / states[1].sigma, SPACING, OFFSETS);
    // A dilation that is narrower than the spacing is none.
    let step = SPACING * f64::from(DILATED);
    let dilations = if dilation_sigma < step {
        vec![(0, 1.0)]
    } else {
        grid(|d| density(d / dilation_sigma) / dilation_sigma, step, OFFSETS / DILATED)
    };
    let dilations: Vec<_> = dilations.into_iter().filter(|(_, weight)| *weight > 1e-5).collect();
    let corners: Vec<_> = corners();
    let (mut all, mut first, mut second) = (0.0, Vector6::zeros(), Matrix6::zeros());
    for _ in 0..DRAWS {
        let x = Vector6::from_fn(|_, _| random.normal());
        let table = |labels: &[EndLabel]| -> EndTable {
            let label = |d: f64, (gradient, side, margin): &EndLabel| {
                model.posterior(EdgeKind::Own, gradient.dot(&x) + side * d + margin, 0.0).log_probability
            };
            let at = |d: f64| labels.iter().map(|each| label(d, each)).sum::<f64>().exp();
            let clean: Vec<f64> = (-2 * OFFSETS..=2 * OFFSETS).map(|k| at(SPACING * f64::from(k))).collect();
            let disturbed = |k: i32| -> f64 {
                offsets.iter().map(|(off, weight)| weight * clean[(k + off + 2 * OFFSETS) as usize]).sum()
            };
            let disturbed = (-CORNERS..=CORNERS).map(disturbed).collect();
            [clean[(2 * OFFSETS - CORNERS) as usize..=(2 * OFFSETS + CORNERS) as usize].to_vec(), disturbed]
        };
        let ends: Vec<EndTable> = labels.chunks(3).map(table).collect();
        // By the states of the segments before and after a corner that meets ends of these numbers.
        let meeting = |dilated: i32, ended: usize, begun: usize| {
            Matrix2::from_fn(|before, after| -> f64 {
                let at = |end: usize, state: usize, corner: &Vector2<f64>| {
                    between(&ends[end][state], normals[end / 2].dot(corner) / SPACING + f64::from(dilated))
                };
                corners.iter().map(|(c, weight)| weight * at(ended, before, c) * at(begun, after, c)).sum()
            })
        };
        let closed = |dilated: i32| {
            let [a, b, c] = [(5, 0), (1, 2), (3, 4)].map(|(ended, begun)| meeting(dilated, ended, begun));
            let [of_a, of_b, of_c] = [(2, 0), (0, 1), (1, 2)].map(next);
            let all = of_b.component_mul(&b) * of_c.component_mul(&c) * of_a.component_mul(&a);
            all.trace() / (of_b * of_c * of_a).trace()
        };
        let open = |dilated: i32| {
            let alone = |end: usize| {
                Vector2::from_fn(|state, _| -> f64 {
                    let at = |c: &Vector2<f64>| {
                        between(&ends[end][state], normals[end / 2].dot(c) / SPACING + f64::from(dilated))
                    };
                    corners.iter().map(|(c, weight)| weight * at(c)).sum()
                })
            };
            let ([between, on, back], [begun, ended]) = ([(3, 4), (4, 5), (5, 3)].map(next), [6, 9].map(alone));
            let all = between.component_mul(&meeting(dilated, 7, 8)) * Matrix2::from_diagonal(&ended) * on * back;
            (Matrix2::from_diagonal(&begun) * all).trace() / (between * on * back).trace()
        };
        let over_dilation = |of: &dyn Fn(i32) -> f64| -> f64 {
            dilations.iter().map(|(dilated, weight)| weight * of(DILATED * dilated)).sum()
        };
        let weight = over_dilation(&closed) * over_dilation(&open);
        all += weight;
        first += x * weight;
        second += x * x.transpose() * weight;
    }
    let (mean, exact) = (first / all, (all / DRAWS as f64).ln());
    let covariance = second / all - mean * mean.transpose();
    let Normal { mean: found_mean, covariance: found_covariance } = found.increment;
    assert!((found_mean - mean).norm() < 0.15, "{found_mean} against {mean}");
    let spread = (found_covariance - covariance).norm() / covariance.norm();
    assert!(spread < 0.2, "{found_covariance} against {covariance}");
    assert!((found.log_evidence - exact).abs() < 0.3, "{} against {exact}", found.log_evidence);
}

/// Places of a corner with their shares, up to three deviations along either axis.
fn corners() -> Vec<(Vector2<f64>, f64)> {
    let spacing = 0.6 * CORNER;
    let along = grid(|d| density(d / CORNER) / CORNER, spacing, 5);
    let at = |k: i32| spacing * f64::from(k);
    along.iter().flat_map(|(i, a)| along.iter().map(move |(j, b)| (Vector2::new(at(*i), at(*j)), a * b))).collect()
}

/// A table of `CORNERS` places to either side of its middle, at a place between two.
fn between(table: &[f64], place: f64) -> f64 {
    let place = place + f64::from(CORNERS);
    let (low, share) = ((place.floor() as usize).min(table.len() - 2), place.fract());
    table[low] * (1.0 - share) + table[low + 1] * share
}

/// One of the segments is off by four label sigmas.
#[test]
fn segments_that_are_off_are_those_of_sampling() {
    agree_with_sampling(1e-3, [0.0; 2], [0.0, 0.0, 4.0, 0.0, 0.0]);
}

/// Two neighbors are off, as the sides of a bite are: were each so by itself, the mean would be another.
#[test]
fn neighbors_that_are_off_are_those_of_sampling() {
    agree_with_sampling(1e-3, [0.0; 2], [0.0, 4.0, 4.0, 0.0, 0.0]);
}

/// A contour that is dilated by two label sigmas, and one that is not.
#[test]
fn contours_that_are_dilated_are_those_of_sampling() {
    agree_with_sampling(1.0, [2.0, 0.0], [0.0; 5]);
}
