//! The confidence: a probability, higher for better evidence, defined for the worst there can be.

use proptest::prelude::*;
use regionpose::verdict::confidence::Evidence;

const GOOD: Evidence = Evidence { rotation_sigma: 0.01, whole: true, scatter: 0.25, contradicted: 0, regions: 3 };

const BAD: Evidence = Evidence { rotation_sigma: 8.0, whole: false, scatter: 10.0, contradicted: 0, regions: 1 };

#[test]
fn good_evidence_is_trusted_and_bad_is_not() {
    assert!(GOOD.probability() > 0.99, "{}", GOOD.probability());
    assert!(BAD.probability() < 0.5, "{}", BAD.probability());
}

#[test]
fn a_direction_that_is_free_has_a_finite_confidence() {
    for sigma in [f64::INFINITY, f64::NAN] {
        let evidence = Evidence { rotation_sigma: sigma, ..GOOD };
        assert!(evidence.features().iter().all(|feature| feature.is_finite()));
        assert!((0.0..0.1).contains(&evidence.probability()), "{}", evidence.probability());
    }
}

/// Whatever the regions say of the place, a deviation of ten degrees leaves two poses in five within five.
#[test]
fn the_noise_alone_bounds_it() {
    let probability = Evidence { rotation_sigma: 10.0, ..GOOD }.probability();
    assert!((0.2..0.383).contains(&probability), "{probability}");
}

proptest! {
    #[test]
    fn it_is_a_probability_that_falls_with_the_uncertainty(
        sigma in 1e-4..50.0_f64, factor in 1.0..20.0_f64, scatter in 0.25..20.0_f64, whole in proptest::bool::ANY,
        contradicted in 0..4_usize, regions in 1..9_usize,
    ) {
        let evidence = Evidence { rotation_sigma: sigma, whole, scatter, contradicted, regions };
        let wider = Evidence { rotation_sigma: sigma * factor, ..evidence };
        prop_assert!((0.0..=1.0).contains(&evidence.probability()));
        prop_assert!(wider.probability() <= evidence.probability());
    }
}
