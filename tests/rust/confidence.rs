//! The confidence: a probability, higher for a pose that is held better, defined for the worst there can be.

use proptest::prelude::*;
use regionpose::verdict::confidence::Evidence;

const HELD: Evidence = Evidence { spread: 1e-4, whole: true, scatter: 0.25, contradicted: 0 };

#[test]
fn a_pose_that_is_held_well_is_trusted_and_a_loose_one_is_not() {
    let loose = Evidence { spread: 0.1, whole: false, scatter: 3.0, contradicted: 0 };
    assert!(HELD.probability() > 0.99 && loose.probability() < 0.3, "{HELD:?}, {loose:?}");
}

#[test]
fn a_direction_that_is_free_has_a_finite_confidence() {
    for spread in [f64::INFINITY, f64::NAN] {
        let evidence = Evidence { spread, ..HELD };
        assert!(evidence.features().iter().all(|feature| feature.is_finite()));
        assert!((0.0..0.3).contains(&evidence.probability()), "{}", evidence.probability());
    }
}

proptest! {
    #[test]
    fn it_is_a_probability_that_falls_with_the_uncertainty(
        spread in 1e-6..1.0_f64, factor in 1.0..20.0_f64, whole in any::<bool>(), scatter in 0.25..20.0_f64,
        contradicted in 0..4_usize,
    ) {
        let evidence = Evidence { spread, whole, scatter, contradicted };
        let worse = [
            Evidence { spread: spread * factor, ..evidence },
            Evidence { scatter: scatter * factor, ..evidence },
            Evidence { whole: false, ..evidence },
        ];
        prop_assert!((0.0..=1.0).contains(&evidence.probability()));
        prop_assert!(worse.iter().all(|worse| worse.probability() <= evidence.probability()));
    }
}
