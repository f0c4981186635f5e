//! The confidence: a probability, higher for a pose that is held better, defined for the worst there can be.

use proptest::prelude::*;
use regionpose::verdict::confidence::Evidence;

#[test]
fn a_pose_that_is_held_well_is_trusted_and_a_loose_one_is_not() {
    let held = Evidence { spread: 1e-4, whole: true }.probability();
    let loose = Evidence { spread: 0.1, whole: false }.probability();
    assert!(held > 0.99 && loose < 0.3, "{held}, {loose}");
}

#[test]
fn a_direction_that_is_free_has_a_finite_confidence() {
    for spread in [f64::INFINITY, f64::NAN] {
        let evidence = Evidence { spread, whole: true };
        assert!(evidence.features().iter().all(|feature| feature.is_finite()));
        assert!((0.0..0.3).contains(&evidence.probability()), "{}", evidence.probability());
    }
}

proptest! {
    #[test]
    fn it_is_a_probability_that_falls_with_the_uncertainty(
        spread in 1e-6..1.0_f64, factor in 1.0..20.0_f64, whole in any::<bool>(),
    ) {
        let evidence = Evidence { spread, whole };
        let wider = Evidence { spread: spread * factor, ..evidence };
        prop_assert!((0.0..=1.0).contains(&evidence.probability()));
        prop_assert!(wider.probability() <= evidence.probability());
        let (less, more) = (Evidence { whole: false, spread }.probability(), Evidence { whole: true, spread }.probability());
        prop_assert!(less <= more);
    }
}
