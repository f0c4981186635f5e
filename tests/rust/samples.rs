//! Expectation propagation of independent labels, and the tilted moments of a segment's ends, against quadrature, sampling and an even
//! grid.

use crate::support::random::Random;
use crate::support::samples::{MODEL, prior, site};
use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::math::gaussian::Normal;
use regionpose::internals::math::normal::{cumulative, density};
use regionpose::internals::math::single_precision;
use regionpose::internals::samples::ep::run_ep_independent;
use regionpose::internals::samples::label_model::LabelModel;
use regionpose::internals::samples::margin::EdgeKind;
use regionpose::internals::samples::probit_site::LabelSite;
use regionpose::internals::samples::quadrature::{SegmentLabel, TiltedMoments, tilted_moments};

/// Posterior and log evidence of independent labels with a prior of this standard deviation.
fn posterior(sigma: f64, sites: &mut [LabelSite]) -> (Normal, f64) {
    let found = run_ep_independent(&prior(sigma), &Gaussian::default(), sites, &Budget::unlimited()).unwrap();
    (found.increment, found.log_evidence)
}

/// One direction is free, the others fixed: moments and evidence of a few labels against quadrature.
#[test]
fn moments_of_a_line_are_those_of_quadrature() {
    let slope = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    // Two walls, each met by one label from either side, and one label that is likely wrong.
    let margins = [(1.0, 2.0), (-1.0, 1.5), (2.0, 4.0), (-0.5, 3.0)];
    let mut sites: Vec<LabelSite> =
        margins.iter().map(|(scale, margin)| site(slope * *scale, 0.0, *margin, MODEL)).collect();
    let (found, log_evidence) = posterior(3.0, &mut sites);
    let probability = |x: f64| margins.iter().map(|(scale, margin)| label(scale * x + margin)).product::<f64>();
    let weight = |x: f64| probability(x) * density(x / 3.0) / 3.0;
    let [all, first, second] = [0, 1, 2].map(|power| quadrature(|x| weight(x) * x.powi(power)));
    let (mean, variance) = (first / all, second / all - (first / all).powi(2));
    assert!((found.mean[0] - mean).abs() < 0.05, "{} against {mean}", found.mean[0]);
    assert!((found.covariance[(0, 0)] / variance - 1.0).abs() < 0.1, "{} against {variance}", found.covariance[(0, 0)]);
    assert!((log_evidence - all.ln()).abs() < 0.02, "{log_evidence} against {}", all.ln());
    assert!((found.covariance[(1, 1)] - 9.0).abs() < 1e-9, "directions without labels keep their prior");
}

/// The probability of a label by its definition.
fn label(margin: f64) -> f64 {
    let LabelModel { sigma, outlier_sigma, contamination, mislabeling } = MODEL;
    let clean = (1.0 - contamination) * cumulative(margin / sigma);
    mislabeling + (1.0 - 2.0 * mislabeling) * (clean + contamination * cumulative(margin / outlier_sigma))
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
    let mut sites = [site(slope, 0.0, -1.2, MODEL)];
    let (found, log_evidence) = posterior(1.0, &mut sites);
    let spread = slope.norm();
    let weight = |g: f64| label(g) * density((g + 1.2) / spread) / spread;
    let [all, first, second] = [0, 1, 2].map(|power| quadrature(|g| weight(g) * g.powi(power)));
    assert!((log_evidence - all.ln()).abs() < 1e-6, "{log_evidence} against {}", all.ln());
    let (mean, variance) = sites[0].margin_under(&found);
    assert!((mean - first / all).abs() < 1e-6 && (variance - second / all + (first / all).powi(2)).abs() < 1e-6);
}

/// Twelve labels in six directions against 400,000 draws of the prior.
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
    let mut sites: Vec<LabelSite> = labels.iter().map(|(slope, margin)| site(*slope, 0.0, *margin, MODEL)).collect();
    let (found, log_evidence) = posterior(1.0, &mut sites);
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
    assert!((found.mean - mean).norm() < 0.05, "{} against {mean}", found.mean);
    assert!(
        (found.covariance - covariance).norm() < 0.1 * covariance.norm(),
        "{} against {covariance}",
        found.covariance
    );
    assert!((log_evidence - (all / 400_000.0_f64).ln()).abs() < 0.05);
}

/// Behind an occluder a label is uninformative; in front of it, it is as right as beside any other edge.
#[test]
fn labels_behind_an_occluder_are_uninformative() {
    let model = LabelModel { mislabeling: 0.02, ..MODEL };
    let at = |edge: EdgeKind, margin: f64| model.posterior(edge, margin, 0.0).log_probability.exp();
    assert!((at(EdgeKind::Own, 1e3) - 0.98).abs() < 1e-9 && (at(EdgeKind::Own, -1e3) - 0.02).abs() < 1e-9);
    assert!(
        (at(EdgeKind::OccludedInside, 1e3) - 0.98).abs() < 1e-9
            && (at(EdgeKind::OccludedInside, -1e3) - 0.5).abs() < 1e-9
    );
    assert!(
        (at(EdgeKind::OccludedOutside, 1e3) - 0.5).abs() < 1e-9
            && (at(EdgeKind::OccludedOutside, -1e3) - 0.02).abs() < 1e-9
    );
}

/// Labels beside a segment whose ends lie at random places, and a cavity distribution of the ends.
fn beside(random: &mut Random, count: usize, model: LabelModel) -> (Vec<SegmentLabel>, Normal<2>) {
    let [start, end] = [0; 2].map(|_| 3.0 * random.normal());
    let label = |_| {
        let along = random.uniform(0.0, 1.0);
        let (place, at) = (6.0 * random.normal(), (1.0 - along) * start + along * end);
        // An inside sample lies on its side where the contour is farther out than it.
        let side = if at + model.sigma * random.normal() > place { 1.0 } else { -1.0 };
        let weights = Vector2::new(1.0 - along, along) * side;
        SegmentLabel { margin: -place * side, weights, variance: 0.1, edge: EdgeKind::Own, model }
    };
    let labels = (0..count).map(label).collect();
    let covariance = Matrix2::new(16.0, 6.0, 6.0, 9.0);
    (labels, Normal { mean: Vector2::new(1.0, -2.0), covariance })
}

/// Mean, covariance and logarithm of the integral by an even grid over the cavity.
fn by_even_grid(labels: &[SegmentLabel], before: &Normal<2>) -> (Normal<2>, f64) {
    const STEP: f64 = 0.1;
    let information = before.covariance.try_inverse().unwrap();
    let (mut all, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for row in -250..250 {
        for column in -250..250 {
            let way = Vector2::new(f64::from(row), f64::from(column)) * STEP;
            let ends = Normal { mean: before.mean + way, covariance: Matrix2::zeros() };
            let log_likelihood: f64 = labels.iter().map(|label| label.posterior(&ends).log_probability).sum();
            let weight = (log_likelihood - 0.5 * way.dot(&(information * way))).exp();
            all += weight;
            first += ends.mean * weight;
            second += ends.mean * ends.mean.transpose() * weight;
        }
    }
    let mean = first / all;
    let scale = STEP * STEP / (2.0 * std::f64::consts::PI * before.covariance.determinant().sqrt());
    (Normal { mean, covariance: second / all - mean * mean.transpose() }, (all * scale).ln())
}

/// Distance of two distributions: of the mean, in standard deviations, and of the covariance, relative.
fn differences_of(found: &Normal<2>, exact: &Normal<2>) -> (f64, f64) {
    let root = exact.covariance.cholesky().unwrap();
    let way = root.l().solve_lower_triangular(&(found.mean - exact.mean)).unwrap();
    (way.norm(), (root.solve(&found.covariance) - Matrix2::identity()).norm())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Of labels from wide sigmas to nearly steps, with seeds at the cavity, beside the tilted moments, and where all that is seen is a tail. No
    /// label is mislabeled: of the tail that one such leaves, a percent may be missed.
    #[test]
    fn ends_are_those_of_an_even_grid(seed in 0_u64..1000, count in 1_usize..40, sigma in 0.1..2.0) {
        let mut random = Random::new(seed);
        let model = LabelModel { sigma, contamination: 0.0, mislabeling: 1e-6, ..MODEL };
        let (labels, before) = beside(&mut random, count, model);
        let (exact, log_integral) = by_even_grid(&labels, &before);
        let way = exact.covariance.cholesky().unwrap().l() * Vector2::new(1.0, -1.0);
        let beside = Normal { mean: exact.mean + way, covariance: exact.covariance * 1.5 };
        let far = Normal { mean: exact.mean + way * 30.0, covariance: exact.covariance * 0.01 };
        for about in [before, beside, far] {
            let TiltedMoments { ends: found, log_probability: log_found, has_converged } = tilted_moments(&labels, &before, &about).unwrap();
            assert!(has_converged);
            let (mean, covariance) = differences_of(&found, &exact);
            prop_assert!(mean < 0.1 && covariance < 0.2, "{mean} deviations, {covariance}: {found:?} against {exact:?}");
            prop_assert!((log_found - log_integral).abs() < 0.1, "{log_found} against {log_integral}");
        }
    }
}

/// Of tens of thousands of labels with so little mislabeling that a product of eight floors underflows single precision; each of 200 comes
/// many times, against a fine grid about the result in double precision.
#[test]
fn ends_beside_many_labels_are_those_of_a_fine_grid() {
    const TIMES: usize = 500;
    for (seed, sigma, mislabeling) in [(1, 1.0, 1e-6), (2, 2.0, 1e-5), (3, 0.5, 1e-4)] {
        let model = LabelModel { sigma, contamination: 0.0, mislabeling, ..MODEL };
        let (few, before) = beside(&mut Random::new(seed), 200, model);
        let labels: Vec<SegmentLabel> = few.iter().flat_map(|label| vec![*label; TIMES]).collect();
        let TiltedMoments { ends, log_probability, has_converged } = tilted_moments(&labels, &before, &before).unwrap();
        assert!(has_converged);
        let (exact, log_integral) = by_fine_grid(&few, TIMES as f64, &before, &ends);
        let (mean, covariance) = differences_of(&ends, &exact);
        assert!(mean < 0.1 && covariance < 0.2, "{mean} deviations, {covariance}: {ends:?} against {exact:?}");
        assert!((log_probability - log_integral).abs() < 0.2, "{log_probability} against {log_integral}");
    }
}

/// Mean, covariance and logarithm of the integral where each label counts so many times, by a grid of 6 standard deviations about a distribution.
fn by_fine_grid(labels: &[SegmentLabel], times: f64, before: &Normal<2>, about: &Normal<2>) -> (Normal<2>, f64) {
    const PLACES: i32 = 60;
    let (information, root) = (before.covariance.try_inverse().unwrap(), about.covariance.cholesky().unwrap().l());
    let log_at = |place: &Vector2<f64>| {
        let ends = Normal { mean: *place, covariance: Matrix2::zeros() };
        let log_likelihood: f64 = labels.iter().map(|label| label.posterior(&ends).log_probability).sum();
        let way = place - before.mean;
        times * log_likelihood - 0.5 * way.dot(&(information * way))
    };
    let most = log_at(&about.mean);
    let (mut all, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for (row, column) in (-PLACES..=PLACES).flat_map(|row| (-PLACES..=PLACES).map(move |column| (row, column))) {
        let place = about.mean + root * Vector2::new(f64::from(row), f64::from(column)) * 0.1;
        let weight = (log_at(&place) - most).exp();
        all += weight;
        first += (place - about.mean) * weight;
        second += (place - about.mean) * (place - about.mean).transpose() * weight;
    }
    let mean = first / all;
    let area = 0.01 * root.determinant() / (2.0 * std::f64::consts::PI * before.covariance.determinant().sqrt());
    let covariance = second / all - mean * mean.transpose();
    (Normal { mean: about.mean + mean, covariance }, most + (all * area).ln())
}

/// From a million deviations away a dozen grids do not converge.
#[test]
fn quadratures_that_do_not_converge_report_it() {
    let before = Normal { mean: Vector2::zeros(), covariance: Matrix2::identity() };
    assert!(tilted_moments(&[], &before, &before).is_some_and(|moments| moments.has_converged));
    let away = Normal { mean: Vector2::repeat(1e3), covariance: Matrix2::identity() * 1e-6 };
    assert!(tilted_moments(&[], &before, &away).is_some_and(|moments| !moments.has_converged));
}

proptest! {
    /// Over the range that quadratures evaluate functions in.
    #[test]
    fn single_precision_is_near_to_double(x in -40.0_f32..40.0, log in -87.0_f32..2.0) {
        let number = f64::from(log).exp() as f32;
        let off = |single: f32, double: f64| (f64::from(single) - double).abs();
        prop_assert!(off(single_precision::cumulative(x), cumulative(f64::from(x))) < 3e-6);
        prop_assert!(off(single_precision::ln(number), f64::from(number).ln()) < 1e-6 * f64::max(1.0, f64::from(log).abs()));
        let low = log.min(0.0);
        let exact = f64::from(low).exp();
        prop_assert!(off(single_precision::exp(low), exact) < f64::max(1e-6 * exact, 2e-37));
    }
}

/// Whatever is out of range goes to the ends of it.
#[test]
fn single_precision_ends_where_numbers_do() {
    let far = [f32::MAX, f32::INFINITY];
    assert!(far.iter().all(|&x| single_precision::cumulative(x) == 1.0
        && single_precision::cumulative(-x) == 0.0
        && single_precision::exp(-x) == 0.0));
    assert_eq!(single_precision::exp(0.0), 1.0);
    assert_eq!(single_precision::ln(1.0), 0.0);
    assert_eq!(single_precision::ln(0.0), single_precision::ln(f32::MIN_POSITIVE));
}
