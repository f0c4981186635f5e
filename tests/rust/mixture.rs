//! The mixture of clean and disturbed distances: recovered from samples, a density, and the odds that follow from it.

use crate::support::random::Random;
use proptest::prelude::*;
use regionpose::internals::contour::mixture::{Distances, Mixture};
use regionpose::internals::contour::readings::Reading;

/// Least scale of the mixtures, pixels.
const FINEST: f64 = 0.25;

/// Ratio of a scale to that of the samples: by chance, and by the steps that the iteration is left.
const NEARLY: f64 = 1.1;

fn reading(robust_distance: f64) -> Reading {
    Reading { distance: robust_distance, spread: 0.0, robust_distance: robust_distance.abs(), edge: 0 }
}

/// Distances of a region of which a share is disturbed.
fn drawn(random: &mut Random, count: usize, [sigma, wide]: [f64; 2], share: f64) -> Vec<Reading> {
    let scale = |random: &mut Random| if random.uniform(0.0, 1.0) < share { wide } else { sigma };
    let mut one = || scale(random) * random.normal();
    (0..count).map(|_| reading(one())).collect()
}

fn fitted(regions: &[Vec<Reading>]) -> Mixture {
    Distances::new(regions.iter().map(Vec::as_slice)).mixture(FINEST)
}

#[test]
fn scales_and_shares_of_drawn_samples_are_recovered() {
    let mut random = Random::new(1);
    for scales in [[0.4, 8.0], [0.6, 20.0], [1.5, 30.0]] {
        let shares = [0.3, 0.05, 0.6];
        let regions = shares.map(|share| drawn(&mut random, 3000, scales, share));
        let mixture = fitted(&regions);
        let ratio = (mixture.sigma / scales[0]).max(scales[0] / mixture.sigma);
        assert!(ratio < NEARLY, "{scales:?}: sigma {}", mixture.sigma);
        assert!((mixture.outlier_sigma / scales[1] - 1.0).abs() < 0.1, "{scales:?}: wide {}", mixture.outlier_sigma);
        for (found, share) in mixture.outlier_fractions.iter().zip(shares) {
            assert!((found - share).abs() < 0.05, "{scales:?}: {found} of {share} disturbed");
        }
    }
}

#[test]
fn clean_samples_leave_hardly_anything_disturbed_by_much() {
    let regions = [drawn(&mut Random::new(2), 2000, [0.3, 0.3], 0.0)];
    let mixture = fitted(&regions);
    assert!((FINEST..0.3 * NEARLY).contains(&mixture.sigma), "{}", mixture.sigma);
    // What the narrow scale does not hold is the tail of the same distribution.
    assert!(mixture.outlier_sigma < 1.0 || mixture.outlier_fractions[0] < 0.02, "{mixture:?}");
}

#[test]
fn the_likelihood_is_the_mean_logarithm_of_the_density() {
    let regions = [0.2, 0.4].map(|share| drawn(&mut Random::new(3), 1000, [0.5, 10.0], share));
    let mixture = fitted(&regions);
    let of = |(region, readings): (usize, &Vec<Reading>)| {
        readings.iter().map(|reading| mixture.log_density(region, reading)).sum::<f64>()
    };
    let mean = regions.iter().enumerate().map(of).sum::<f64>() / 2000.0;
    // Distances of a bin, which differ by a fifth, count as their mean square.
    assert!((mixture.likelihood - mean).abs() < 0.01, "{} {mean}", mixture.likelihood);
}

#[test]
fn no_scale_of_those_beside_is_likelier() {
    let regions = [drawn(&mut Random::new(4), 1000, [0.7, 15.0], 0.3)];
    let distances = Distances::new(regions.iter().map(Vec::as_slice));
    let best = distances.mixture(FINEST);
    for factor in [0.5, 1.0 / 1.5, 1.5, 2.0] {
        let other = distances.mixture_of(best.sigma * factor, distances.root_mean_square());
        assert!(other.likelihood <= best.likelihood, "{factor}: {} {}", other.likelihood, best.likelihood);
    }
}

#[test]
fn the_density_of_a_region_is_one_in_all() {
    let mixture = Mixture { sigma: 0.5, outlier_sigma: 6.0, outlier_fractions: vec![0.1, 0.7], likelihood: f64::NAN };
    let step = 0.01;
    for region in 0..2 {
        let density = |k: i32| mixture.log_density(region, &reading(f64::from(k) * step)).exp();
        let sum = (-6000..=6000).map(density).sum::<f64>() * step;
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }
}

#[test]
fn empty_regions_and_endless_distances_make_no_panic() {
    for regions in [vec![], vec![vec![]], vec![vec![reading(0.0)]], vec![vec![reading(f64::INFINITY)], vec![]]] {
        let mixture = fitted(&regions);
        assert_eq!(mixture.outlier_fractions.len(), regions.len());
        assert!(mixture.sigma >= FINEST && mixture.outlier_sigma >= mixture.sigma);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_piece_is_clean_by_its_share_of_the_density_which_falls_with_the_distance(
        sigma in 0.25..4.0_f64, ratio in 2.0..50.0_f64, share in 0.001..0.999_f64, far in 0.0..6.0_f64,
    ) {
        let mixture = Mixture { sigma, outlier_sigma: ratio * sigma, outlier_fractions: vec![share], likelihood: f64::NAN };
        let at = reading(far * sigma);
        let normal = (-0.5 * far * far).exp() / (sigma * std::f64::consts::TAU.sqrt());
        let clean = mixture.clean_probability(0, &at);
        prop_assert!((clean - (1.0 - share) * normal / mixture.log_density(0, &at).exp()).abs() < 1e-9);
        prop_assert!((0.0..=1.0).contains(&clean) && clean <= mixture.clean_probability(0, &reading(0.9 * far * sigma)));
    }
}
