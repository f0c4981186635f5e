//! The confidence: a probability, higher for better evidence, defined for the worst there can be.

use proptest::prelude::*;
use regionpose::verdict::confidence::Evidence;

const GOOD: Evidence =
    Evidence { rotation_sigma: 0.01, scatter: 0.25, clean_share: 0.95, clean_parts: 300.0, regions: 3 };

const BAD: Evidence = Evidence { rotation_sigma: 8.0, scatter: 10.0, clean_share: 0.2, clean_parts: 4.0, regions: 1 };

#[test]
fn good_evidence_is_trusted_and_bad_is_not() {
    assert!(GOOD.probability() > 0.99, "{}", GOOD.probability());
    assert!(BAD.probability() < 0.5, "{}", BAD.probability());
}

#[test]
fn a_direction_that_is_free_has_a_finite_confidence() {
    let evidence = Evidence { rotation_sigma: f64::INFINITY, clean_share: 1.0, clean_parts: f64::INFINITY, ..GOOD };
    assert!(evidence.features().iter().all(|feature| feature.is_finite()));
    let probability = Evidence { rotation_sigma: f64::INFINITY, ..BAD }.probability();
    assert!((0.0..0.5).contains(&probability), "{probability}");
}

proptest! {
    #[test]
    fn it_is_a_probability_that_falls_with_the_uncertainty(
        sigma in 1e-4..50.0_f64, factor in 1.0..20.0_f64, scatter in 0.25..20.0_f64, share in 0.0..=1.0_f64,
        parts in 0.0..5000.0_f64, regions in 1..9_usize,
    ) {
        let evidence = Evidence { rotation_sigma: sigma, scatter, clean_share: share, clean_parts: parts, regions };
        let wider = Evidence { rotation_sigma: sigma * factor, ..evidence };
        prop_assert!((0.0..=1.0).contains(&evidence.probability()));
        prop_assert!(wider.probability() <= evidence.probability());
    }
}
