//! Contours that are grown, and stretches and corners that are off, against sampling.

use crate::support::random::Random;
use crate::support::samples::{CLEAN, prior, site};
use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::math::gaussian::Normal;
use regionpose::internals::math::normal::density;
use regionpose::internals::samples::kinds::Kind;
use regionpose::internals::samples::outline::Outline;
use regionpose::internals::samples::propagation::{Site, propagated};
use regionpose::internals::samples::readings::Edge;
use regionpose::internals::samples::ring::Ring;
use regionpose::internals::samples::stretch::Stretch;
use regionpose::internals::samples::trust::Trust;

/// Spacing of the offsets that are integrated over, and their number to either side.
const SPACING: f64 = 0.2;
const OFFSETS: i32 = 100;

/// Offsets from one growth that is integrated over to the next: 0.6 deviations of the widest.
const GROWN: i32 = 3;

/// Offsets of corners that are integrated over, to either side; and how far corners are off.
const CORNERS: i32 = 56;
const CORNER: f64 = 1.5;

/// Offsets with the shares that a density gives them.
fn grid(density: impl Fn(f64) -> f64, spacing: f64, count: i32) -> Vec<(i32, f64)> {
    (-count..=count).map(|k| (k, spacing * density(spacing * f64::from(k)))).collect()
}

/// A label beside an end of a stretch: its slope, its side, and its margin.
type EndLabel = (Vector6<f64>, f64, f64);

/// The probability of the labels beside an end of a stretch of either kind, by how far its corner and growth put it.
type EndTable = [Vec<f64>; 2];

/// Three labels beside either end of each of five stretches, of two contours, which are off by so many pixels. The three of one close
/// a ring at corners of many angles, of the other ring the rest has no labels. Against draws of the prior, of which what the contours
/// are off is integrated by itself.
fn agree_with_sampling(growth: f64, grown: [f64; 2], off: [f64; 5]) {
    let mut random = Random::new(9);
    let kinds = [Kind { share: 0.8, off: 0.0 }, Kind { share: 0.2, off: 6.0 }];
    let trust = Trust { disturbed: 0.0, ..CLEAN };
    let mut labels: Vec<EndLabel> = Vec::new();
    for stretch in 0..5 {
        let slope = Vector6::from_fn(|_, _| random.normal());
        for _ in 0..6 {
            let place = 3.0 * random.normal();
            let side = if off[stretch] + grown[stretch / 3] > place { 1.0 } else { -1.0 };
            labels.push((slope * side, side, -place * side));
        }
    }
    let end = |(k, (slope, side, margin)): (usize, &EndLabel)| Site {
        along: if k % 6 < 3 { 0.0 } else { 1.0 },
        ..site(*slope, *side, *margin, trust)
    };
    let sites: Vec<Site> = labels.iter().enumerate().map(end).collect();
    let normals = [0.0, 2.5, 3.3, 0.4, 1.0].map(|angle: f64| Vector2::new(angle.cos(), angle.sin()));
    let lengths = [2.0, 3.0, 4.0, 2.0, 3.0, 5.0];
    let stretch = |k: usize| Stretch::new(k, normals[k], lengths[k], (6 * k..6 * k + 6).collect(), kinds);
    let closed: Vec<Stretch> = (0..3).map(stretch).collect();
    let open = vec![stretch(3), stretch(4), Stretch::new(5, Vector2::x(), lengths[5], Vec::new(), kinds)];
    let mut outlines =
        [closed, open].map(|stretches| Outline { region: 0, growth, rings: vec![Ring { off: CORNER, stretches }] });
    let found = propagated(&prior(1.0), &Gaussian::default(), &sites, &mut outlines).unwrap();
    // From the kind of one stretch, a row each, to that of another beside it, a column each.
    let next = |(one, other): (usize, usize)| {
        let same = (-0.5 * (lengths[one] + lengths[other]) / kinds[1].off).exp();
        Matrix2::from_fn(|from, to| kinds[to].share * (1.0 - same) + if from == to { same } else { 0.0 })
    };
    let offsets = grid(|d| density(d / kinds[1].off) / kinds[1].off, SPACING, OFFSETS);
    // A growth that is narrower than the spacing is none.
    let step = SPACING * f64::from(GROWN);
    let growths =
        if growth < step { vec![(0, 1.0)] } else { grid(|d| density(d / growth) / growth, step, OFFSETS / GROWN) };
    let growths: Vec<_> = growths.into_iter().filter(|(_, weight)| *weight > 1e-5).collect();
    let corners: Vec<_> = corners();
    let (mut all, mut first, mut second) = (0.0, Vector6::zeros(), Matrix6::zeros());
    for _ in 0..5_000 {
        let x = Vector6::from_fn(|_, _| random.normal());
        let table = |labels: &[EndLabel]| -> EndTable {
            let label = |d: f64, (slope, side, margin): &EndLabel| {
                trust.label(Edge::Own, slope.dot(&x) + side * d + margin, 0.0).log_probability
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
        // The kinds of the stretches before and after a corner that meets ends of these numbers.
        let meeting = |grown: i32, ended: usize, begun: usize| {
            Matrix2::from_fn(|before, after| -> f64 {
                let at = |end: usize, kind: usize, corner: &Vector2<f64>| {
                    between(&ends[end][kind], normals[end / 2].dot(corner) / SPACING + f64::from(grown))
                };
                corners.iter().map(|(c, weight)| weight * at(ended, before, c) * at(begun, after, c)).sum()
            })
        };
        let closed = |grown: i32| {
            let [a, b, c] = [(5, 0), (1, 2), (3, 4)].map(|(ended, begun)| meeting(grown, ended, begun));
            let [of_a, of_b, of_c] = [(2, 0), (0, 1), (1, 2)].map(next);
            let all = of_b.component_mul(&b) * of_c.component_mul(&c) * of_a.component_mul(&a);
            all.trace() / (of_b * of_c * of_a).trace()
        };
        let open = |grown: i32| {
            let alone = |end: usize| {
                Vector2::from_fn(|kind, _| -> f64 {
                    let at = |c: &Vector2<f64>| {
                        between(&ends[end][kind], normals[end / 2].dot(c) / SPACING + f64::from(grown))
                    };
                    corners.iter().map(|(c, weight)| weight * at(c)).sum()
                })
            };
            let ([between, on, back], [begun, ended]) = ([(3, 4), (4, 5), (5, 3)].map(next), [6, 9].map(alone));
            let all = between.component_mul(&meeting(grown, 7, 8)) * Matrix2::from_diagonal(&ended) * on * back;
            (Matrix2::from_diagonal(&begun) * all).trace() / (between * on * back).trace()
        };
        let over_growth =
            |of: &dyn Fn(i32) -> f64| -> f64 { growths.iter().map(|(grown, weight)| weight * of(GROWN * grown)).sum() };
        let weight = over_growth(&closed) * over_growth(&open);
        all += weight;
        first += x * weight;
        second += x * x.transpose() * weight;
    }
    let (mean, exact) = (first / all, (all / 5_000.0_f64).ln());
    let covariance = second / all - mean * mean.transpose();
    let Normal { mean: found_mean, covariance: found_covariance } = found.belief;
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

/// One of the stretches is off by four blurs.
#[test]
fn stretches_that_are_off_are_those_of_sampling() {
    agree_with_sampling(1e-3, [0.0; 2], [0.0, 0.0, 4.0, 0.0, 0.0]);
}

/// Two neighbors are off, as the sides of a bite are: were each so by itself, the mean would be another.
#[test]
fn neighbors_that_are_off_are_those_of_sampling() {
    agree_with_sampling(1e-3, [0.0; 2], [0.0, 4.0, 4.0, 0.0, 0.0]);
}

/// A contour that is grown by two blurs, and one that is not.
#[test]
fn contours_that_are_grown_are_those_of_sampling() {
    agree_with_sampling(1.0, [2.0, 0.0], [0.0; 5]);
}
