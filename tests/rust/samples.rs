//! Samples inside and outside of regions: signed distances and their derivatives, expectation propagation
//! against quadrature and sampling.

mod support;

use nalgebra::{DVector, Dyn, Matrix2, Matrix6, OMatrix, U6, Vector2, Vector6};
use proptest::prelude::*;
use regionpose::Problem;
use regionpose::geometry::pose::Tangent;
use regionpose::geometry::rings::PlaneRings;
use regionpose::prior::Gaussian;
use regionpose::samples::belief::Belief;
use regionpose::samples::ends::{Beside, heard};
use regionpose::samples::kinds::Kind;
use regionpose::samples::normal::{cumulative, density};
use regionpose::samples::outline::Outline;
use regionpose::samples::propagation::{Edge, Site, Trust, propagated, propagated_apart};
use regionpose::samples::readings::{Reading, Sight};
use regionpose::samples::ring::Ring;
use regionpose::samples::signed_field::SignedField;
use regionpose::samples::single;
use regionpose::samples::stretch::Stretch;
use support::jacobian::differences;
use support::random::Random;
use support::samples::{layout, sampled};
use support::scene::{Scene, rectangle, regular, star};

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

const CLEAN: Trust = Trust { blur: 1.0, wide: 8.0, disturbed: 0.1, mislabeled: 0.02 };

/// A square of side 2: a point beside an edge, one beyond a corner, one at the middle of a notch.
#[test]
fn distances_are_signed_by_the_side() {
    let field = SignedField::new(&[rectangle(2.0, 2.0)], &[vec![false, false, false, true]], 100.0);
    let at = |x: f64, y: f64| field.nearest(&Vector2::new(x, y));
    let beside = at(0.2, -0.7);
    assert!((beside.distance - 0.3).abs() < 1e-12 && (beside.gradient - Vector2::y()).norm() < 1e-12);
    let beyond = at(4.0, 5.0);
    assert!((beyond.distance + 5.0).abs() < 1e-12, "3 and 4 from the corner");
    assert!((beyond.gradient + Vector2::new(0.6, 0.8)).norm() < 1e-12);
    assert!(at(-1.5, 0.0).marked && !at(1.5, 0.0).marked, "the last edge, at x = -1, is marked");
}

/// The corner of an L towards the inside: a point near it is inside, on whichever edge it counts.
#[test]
fn a_notch_has_its_inside_outside() {
    let ell = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]].map(|[x, y]| Vector2::new(x, y));
    let field = SignedField::new(&[ell.to_vec()], &[], 100.0);
    let near = field.nearest(&Vector2::new(0.7, 0.6));
    assert!((near.distance - 0.5).abs() < 1e-12, "0.3 and 0.4 from the notch's corner: {near:?}");
    assert!(field.nearest(&Vector2::new(1.2, 1.1)).distance < 0.0);
}

#[test]
fn a_hole_is_outside() {
    let hole: Vec<_> = rectangle(1.0, 1.0).into_iter().rev().collect();
    let field = SignedField::new(&[rectangle(4.0, 4.0), hole], &[], 100.0);
    assert!((field.nearest(&Vector2::zeros()).distance + 0.5).abs() < 1e-12);
    assert!((field.nearest(&Vector2::new(0.8, 0.0)).distance - 0.3).abs() < 1e-12);
}

/// Along a side from its start to its end; a hole goes the other way around.
#[test]
fn a_point_lies_along_its_stretch() {
    let hole: Vec<_> = rectangle(1.0, 1.0).into_iter().rev().collect();
    let field = SignedField::new(&[rectangle(4.0, 4.0), hole], &[], 100.0);
    let along = |x: f64, y: f64| field.nearest(&Vector2::new(x, y)).along;
    assert!((along(-1.0, -1.9) - 0.25).abs() < 1e-12 && (along(1.0, -2.5) - 0.75).abs() < 1e-12);
    let (left, right) = (along(-0.25, -0.6), along(0.25, -0.6));
    assert!((left + right - 1.0).abs() < 1e-12 && (left - 0.75).abs() < 1e-12);
}

/// A square has four sides, whatever steps a mask makes of them; a circle has a stretch for each twentieth of its size
/// or more; what steps out of a side is none of it.
#[test]
fn stretches_are_sides_or_parts_of_the_size() {
    let numbers = |ring: &[Vector2<f64>]| {
        let field = SignedField::new(&[ring.to_vec()], &[], 100.0);
        let middles = (0..ring.len()).map(|k| ring[k].lerp(&ring[(k + 1) % ring.len()], 0.5));
        middles.map(|middle| field.nearest(&middle).stretch).collect::<Vec<_>>()
    };
    assert_eq!(numbers(&rectangle(2.0, 1.0)), [0, 1, 2, 3]);
    let steps = [[0.0, 0.0], [0.7, 0.0], [0.71, 0.01], [1.4, 0.01], [1.41, 0.02], [2.0, 0.02], [2.0, 1.0], [0.0, 1.0]];
    assert_eq!(numbers(&steps.map(|[x, y]| Vector2::new(x, y))), [0, 0, 0, 0, 0, 1, 2, 3]);
    let bump = [[0.0, 0.0], [0.7, 0.0], [0.7, -0.1], [0.9, -0.1], [0.9, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];
    assert_eq!(numbers(&bump.map(|[x, y]| Vector2::new(x, y))), [0, 1, 2, 3, 4, 5, 6, 7]);
    let circle = numbers(&regular(400, 1.0));
    assert!(circle.is_sorted() && (17..=70).contains(&circle[399]), "{circle:?}");
}

/// Stretches are numbered ring by ring; a side that a mask makes of steps has the normal of what leads from its start to its end.
#[test]
fn stretches_have_their_ring_and_normal() {
    let steps = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.01], [2.0, 0.01], [2.0, 1.0], [0.0, 1.0]];
    let hole: Vec<_> = rectangle(0.5, 0.5).into_iter().rev().map(|p| p * 0.5 + Vector2::new(1.0, 0.5)).collect();
    let field = SignedField::new(&[steps.map(|[x, y]| Vector2::new(x, y)).to_vec(), hole], &[], 100.0);
    assert_eq!(field.rings(), [0..4, 4..8]);
    assert!((field.normal(0) - Vector2::new(-0.005, 1.0).normalize()).norm() < 1e-12);
    assert!((field.normal(1) - Vector2::new(-1.0, 0.0)).norm() < 1e-12);
    assert!((0..8).all(|number| (field.normal(number).norm() - 1.0).abs() < 1e-12));
}

proptest! {
    /// Against the exact inside test and the least distance to all edges.
    #[test]
    fn signs_and_distances_are_exact(seed in 0_u64..1000) {
        let mut random = Random::new(seed);
        let ring = star(&mut random, 40, 1.0);
        let region = PlaneRings::new(vec![ring.clone()]).unwrap();
        let field = SignedField::new(std::slice::from_ref(&ring), &[], 100.0);
        for _ in 0..40 {
            let point = Vector2::new(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
            let least = (0..ring.len()).map(|k| from_segment(&point, &ring[k], &ring[(k + 1) % ring.len()])).fold(f64::INFINITY, f64::min);
            let signed = if region.contains(point) { least } else { -least };
            prop_assert!((field.nearest(&point).distance - signed).abs() < 1e-12);
        }
    }
}

fn from_segment(point: &Vector2<f64>, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let share = ((point - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    (point - a.lerp(b, share)).norm()
}

#[test]
fn at_the_true_pose_every_sample_is_on_its_side() {
    let mut random = Random::new(3);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.1, 1.0)).unwrap();
    let pose = problem.centered(&scene.pose);
    for region in problem.sampled() {
        let right = |reading: &Reading| matches!(reading, Reading::Seen(sight) if sight.margin > -1e-6);
        assert!((0..region.count()).all(|number| right(&region.read(&pose, number))));
    }
}

#[test]
fn margins_have_exact_derivatives() {
    let mut random = Random::new(4);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.2, 1.0)).unwrap();
    let pose = problem.centered(&scene.pose).moved(&random.tangent(0.02, 0.05));
    for region in problem.sampled() {
        let numbers: Vec<usize> = (0..region.count()).collect();
        let read = |at: &Tangent| numbers.iter().map(|&n| region.read(&pose.moved(at), n)).collect::<Vec<_>>();
        let margins = |at: &Tangent| {
            let margin = |reading: &Reading| if let Reading::Seen(sight) = reading { sight.margin } else { f64::NAN };
            DVector::from_iterator(numbers.len(), read(at).iter().map(margin))
        };
        let expected = differences(&margins, &Tangent::zeros(), 4.0);
        let found = OMatrix::<f64, Dyn, U6>::from_fn(numbers.len(), |row, column| match region.read(&pose, row) {
            Reading::Seen(sight) => sight.slope[column],
            _ => f64::NAN,
        });
        // Where the nearest edge changes within the differences' step they mean nothing.
        let error = |row: usize| (found.row(row) - expected.row(row)).norm() / expected.row(row).norm();
        let exact = numbers.iter().filter(|&&row| error(row) < DIFFERENCES).count();
        assert!(exact as f64 > 0.9 * numbers.len() as f64, "{exact} of {}", numbers.len());
    }
}

/// A sample whose margin grows by `outwards` for each pixel that its contour or the start of its stretch is off.
fn site(slope: Vector6<f64>, outwards: f64, margin: f64, trust: Trust) -> Site {
    Site::new(&Sight { margin, slope, outwards, along: 0.0, edge: Edge::Own, stretch: 0 }, trust)
}

/// A normal prior of this deviation in all directions.
fn prior(deviation: f64) -> Gaussian {
    Gaussian::normal(&Tangent::zeros(), &Vector6::repeat(deviation))
}

/// The belief and the evidence of samples by themselves with such a prior.
fn left_possible(deviation: f64, sites: &mut [Site]) -> (Belief, f64) {
    let found = propagated_apart(&prior(deviation), &Gaussian::default(), sites).unwrap();
    (found.belief, found.log_evidence)
}

/// One direction is free, the others known: moments and evidence of a few labels against quadrature.
#[test]
fn moments_of_a_line_are_those_of_quadrature() {
    let slope = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    // Two walls, each met by one label from either side, and one label that is likely wrong.
    let margins = [(1.0, 2.0), (-1.0, 1.5), (2.0, 4.0), (-0.5, 3.0)];
    let mut sites: Vec<Site> =
        margins.iter().map(|(scale, margin)| site(slope * *scale, 0.0, *margin, CLEAN)).collect();
    let (belief, log_evidence) = left_possible(3.0, &mut sites);
    let probability = |x: f64| margins.iter().map(|(scale, margin)| label(scale * x + margin)).product::<f64>();
    let weight = |x: f64| probability(x) * density(x / 3.0) / 3.0;
    let [all, first, second] = [0, 1, 2].map(|power| quadrature(|x| weight(x) * x.powi(power)));
    let (mean, variance) = (first / all, second / all - (first / all).powi(2));
    assert!((belief.mean[0] - mean).abs() < 0.05, "{} against {mean}", belief.mean[0]);
    assert!(
        (belief.covariance[(0, 0)] / variance - 1.0).abs() < 0.1,
        "{} against {variance}",
        belief.covariance[(0, 0)]
    );
    assert!((log_evidence - all.ln()).abs() < 0.02, "{log_evidence} against {}", all.ln());
    assert!((belief.covariance[(1, 1)] - 9.0).abs() < 1e-9, "what no label tells stays as it was");
}

/// The probability of a label by its definition.
fn label(margin: f64) -> f64 {
    let Trust { blur, wide, disturbed, mislabeled } = CLEAN;
    let clean = (1.0 - disturbed) * cumulative(margin / blur) + disturbed * cumulative(margin / wide);
    mislabeled + (1.0 - 2.0 * mislabeled) * clean
}

fn quadrature(value: impl Fn(f64) -> f64) -> f64 {
    const STEPS: usize = 40_000;
    let step = 60.0 / STEPS as f64;
    (0..STEPS).map(|k| value(-30.0 + (k as f64 + 0.5) * step) * step).sum()
}

/// A single label: matching its moments is exact.
#[test]
fn one_label_is_exact() {
    let slope = Vector6::new(0.3, -1.0, 0.5, 2.0, 0.1, -0.7);
    let mut sites = [site(slope, 0.0, -1.2, CLEAN)];
    let (belief, log_evidence) = left_possible(1.0, &mut sites);
    let spread = slope.norm();
    let weight = |g: f64| label(g) * density((g + 1.2) / spread) / spread;
    let [all, first, second] = [0, 1, 2].map(|power| quadrature(|g| weight(g) * g.powi(power)));
    assert!((log_evidence - all.ln()).abs() < 1e-6, "{log_evidence} against {}", all.ln());
    let (mean, variance) = sites[0].margin_under(&belief);
    assert!((mean - first / all).abs() < 1e-6 && (variance - second / all + (first / all).powi(2)).abs() < 1e-6);
}

/// Sixty labels in six directions against a million draws of the prior.
#[test]
fn moments_are_those_of_sampling() {
    let mut random = Random::new(8);
    let truth = Vector6::from_fn(|_, _| 0.5 * random.normal());
    let draw = |random: &mut Random| {
        let slope = Vector6::from_fn(|_, _| random.normal());
        let threshold = 1.5 * random.normal();
        let side = if slope.dot(&truth) > threshold { 1.0 } else { -1.0 };
        (slope * side, -threshold * side)
    };
    let labels: Vec<_> = (0..12).map(|_| draw(&mut random)).collect();
    let mut sites: Vec<Site> = labels.iter().map(|(slope, margin)| site(*slope, 0.0, *margin, CLEAN)).collect();
    let (belief, log_evidence) = left_possible(1.0, &mut sites);
    let (mut all, mut first, mut second) = (0.0, Vector6::zeros(), Matrix6::zeros());
    for _ in 0..400_000 {
        let x = Vector6::from_fn(|_, _| random.normal());
        let weight: f64 = labels.iter().map(|(slope, margin)| label(slope.dot(&x) + margin)).product();
        all += weight;
        first += x * weight;
        second += x * x.transpose() * weight;
    }
    let mean = first / all;
    let covariance = second / all - mean * mean.transpose();
    assert!((belief.mean - mean).norm() < 0.05, "{} against {mean}", belief.mean);
    assert!(
        (belief.covariance - covariance).norm() < 0.1 * covariance.norm(),
        "{} against {covariance}",
        belief.covariance
    );
    assert!((log_evidence - (all / 400_000.0_f64).ln()).abs() < 0.05);
}

/// Beyond an edge that hides the region a label is a coin's, before it as right as beside any other.
#[test]
fn beyond_a_hiding_edge_nothing_is_known() {
    let trust = Trust { mislabeled: 0.02, ..CLEAN };
    let at = |edge: Edge, margin: f64| trust.label(edge, margin, 0.0).log_probability.exp();
    assert!((at(Edge::Own, 1e3) - 0.98).abs() < 1e-9 && (at(Edge::Own, -1e3) - 0.02).abs() < 1e-9);
    assert!((at(Edge::HidesInside, 1e3) - 0.98).abs() < 1e-9 && (at(Edge::HidesInside, -1e3) - 0.5).abs() < 1e-9);
    assert!((at(Edge::HidesOutside, 1e3) - 0.5).abs() < 1e-9 && (at(Edge::HidesOutside, -1e3) - 0.02).abs() < 1e-9);
}

/// Some labels beside a stretch whose ends lie at a place, and what is known of the ends beforehand.
fn beside(random: &mut Random, count: usize, trust: Trust) -> (Vec<Beside>, Belief<2>) {
    let [start, end] = [0; 2].map(|_| 3.0 * random.normal());
    let label = |_| {
        let along = random.uniform(0.0, 1.0);
        let (place, at) = (6.0 * random.normal(), (1.0 - along) * start + along * end);
        // An inside sample lies on its side where the contour is farther out than it.
        let side = if at + trust.blur * random.normal() > place { 1.0 } else { -1.0 };
        let weights = Vector2::new(1.0 - along, along) * side;
        Beside { margin: -place * side, weights, variance: 0.1, edge: Edge::Own, trust }
    };
    let labels = (0..count).map(label).collect();
    let covariance = Matrix2::new(16.0, 6.0, 6.0, 9.0);
    (labels, Belief { mean: Vector2::new(1.0, -2.0), covariance })
}

/// Mean, covariance and logarithm of the integral by an even grid over all that is known beforehand.
fn by_even_grid(labels: &[Beside], before: &Belief<2>) -> (Belief<2>, f64) {
    const STEP: f64 = 0.1;
    let information = before.covariance.try_inverse().unwrap();
    let (mut all, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for row in -250..250 {
        for column in -250..250 {
            let way = Vector2::new(f64::from(row), f64::from(column)) * STEP;
            let known = Belief { mean: before.mean + way, covariance: Matrix2::zeros() };
            let told: f64 = labels.iter().map(|label| label.label(&known).log_probability).sum();
            let weight = (told - 0.5 * way.dot(&(information * way))).exp();
            all += weight;
            first += known.mean * weight;
            second += known.mean * known.mean.transpose() * weight;
        }
    }
    let mean = first / all;
    let scale = STEP * STEP / (2.0 * std::f64::consts::PI * before.covariance.determinant().sqrt());
    (Belief { mean, covariance: second / all - mean * mean.transpose() }, (all * scale).ln())
}

/// How far one belief of two ends is from another: of the mean, in deviations, and of the covariance, as a share.
fn differences_of(found: &Belief<2>, exact: &Belief<2>) -> (f64, f64) {
    let root = exact.covariance.cholesky().unwrap();
    let way = root.l().solve_lower_triangular(&(found.mean - exact.mean)).unwrap();
    (way.norm(), (root.solve(&found.covariance) - Matrix2::identity()).norm())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whether labels are blurred or nearly steps, and from where they were found last as from all that is known beforehand. No label is wrong
    /// for its own sake: of what one such leaves possible far away, a percent may be missed.
    #[test]
    fn ends_are_those_of_an_even_grid(seed in 0_u64..1000, count in 1_usize..40, blur in 0.1..2.0) {
        let mut random = Random::new(seed);
        let trust = Trust { blur, disturbed: 0.0, mislabeled: 1e-6, ..CLEAN };
        let (labels, before) = beside(&mut random, count, trust);
        let (exact, log_integral) = by_even_grid(&labels, &before);
        let way = exact.covariance.cholesky().unwrap().l() * Vector2::new(1.0, -1.0);
        let beside = Belief { mean: exact.mean + way, covariance: exact.covariance * 1.5 };
        for about in [before, beside] {
            let (found, log_found) = heard(&labels, &before, &about).unwrap();
            let (mean, covariance) = differences_of(&found, &exact);
            prop_assert!(mean < 0.1 && covariance < 0.2, "{mean} deviations, {covariance}: {found:?} against {exact:?}");
            prop_assert!((log_found - log_integral).abs() < 0.1, "{log_found} against {log_integral}");
        }
    }
}

proptest! {
    /// Over all that labels ask of functions in single precision.
    #[test]
    fn single_precision_is_near_to_double(x in -40.0_f32..40.0, log in -87.0_f32..2.0) {
        let number = f64::from(log).exp() as f32;
        let off = |single: f32, double: f64| (f64::from(single) - double).abs();
        prop_assert!(off(single::cumulative(x), cumulative(f64::from(x))) < 3e-6);
        prop_assert!(off(single::ln(number), f64::from(number).ln()) < 1e-6 * f64::max(1.0, f64::from(log).abs()));
        let low = log.min(0.0);
        let exact = f64::from(low).exp();
        prop_assert!(off(single::exp(low), exact) < f64::max(1e-6 * exact, 2e-37));
    }
}

/// Whatever is out of range goes to the ends of it.
#[test]
fn single_precision_ends_where_numbers_do() {
    let far = [f32::MAX, f32::INFINITY];
    assert!(
        far.iter().all(|&x| single::cumulative(x) == 1.0 && single::cumulative(-x) == 0.0 && single::exp(-x) == 0.0)
    );
    assert_eq!(single::exp(0.0), 1.0);
    assert_eq!(single::ln(1.0), 0.0);
    assert_eq!(single::ln(0.0), single::ln(f32::MIN_POSITIVE));
}

/// Spacing of the offsets that are integrated over, and their number to either side.
const SPACING: f64 = 0.2;
const OFFSETS: i32 = 100;

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
    let growths =
        if growth < SPACING { vec![(0, 1.0)] } else { grid(|d| density(d / growth) / growth, SPACING, OFFSETS) };
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
            |of: &dyn Fn(i32) -> f64| -> f64 { growths.iter().map(|(grown, weight)| weight * of(*grown)).sum() };
        let weight = over_growth(&closed) * over_growth(&open);
        all += weight;
        first += x * weight;
        second += x * x.transpose() * weight;
    }
    let (mean, exact) = (first / all, (all / 5_000.0_f64).ln());
    let covariance = second / all - mean * mean.transpose();
    let Belief { mean: found_mean, covariance: found_covariance } = found.belief;
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
