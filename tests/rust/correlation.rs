//! How neighbors on a contour vary together, and that regions do not.

use crate::support::random::Random;
use regionpose::internals::math::autocorrelation::{correlation, sigmas};

#[test]
fn neighbors_that_take_turns_sum_to_less_and_alike_ones_to_more() {
    let turns: Vec<f64> = (0..400).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let alike: Vec<f64> = (0..400).map(|k| if (k / 40) % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let mut random = Random::new(3);
    let noise: Vec<f64> = (0..4000).map(|_| random.normal()).collect();
    assert!(correlation(&turns, &[400]) < 0.25);
    assert!(correlation(&alike, &[400]) > 7.0);
    assert!((correlation(&noise, &[4000]) - 1.0).abs() < 0.3);
    assert_eq!(correlation(&[0.0; 8], &[8]), 1.0);
}

/// Two regions that vary, each by itself, as one: their order does not matter, that of one long region of both would.
#[test]
fn the_end_of_a_region_is_no_neighbor_of_the_next_ones_beginning() {
    let up: Vec<f64> = (0..60).map(|k| f64::from(k) / 60.0).collect();
    let down: Vec<f64> = up.iter().map(|value| value - 1.0).collect();
    let (there, back) = ([up.clone(), down.clone()].concat(), [down, up].concat());
    assert!((correlation(&there, &[60, 60]) - correlation(&back, &[60, 60])).abs() < 1e-12);
    assert!((correlation(&there, &[120]) - correlation(&back, &[120])).abs() > 0.1);
}

#[test]
fn regions_of_few_or_no_values_are_fine() {
    assert_eq!(correlation(&[], &[]), 1.0);
    assert!(correlation(&[1.0, -1.0, 2.0], &[1, 0, 2]).is_finite());
}

/// Each value of normal noise `times` over: the sum varies more, and the standard deviations by which it exceeds zero do not.
#[test]
fn a_sum_exceeds_zero_by_standard_deviations_of_chance_also_where_neighbors_vary_as_one() {
    let mut random = Random::new(5);
    for times in [1, 8] {
        let mut once = || {
            let values: Vec<f64> = (0..60).flat_map(|_| vec![random.normal(); times]).collect();
            sigmas(&values, &[values.len()])
        };
        let spread = ((0..400).map(|_| once().powi(2)).sum::<f64>() / 400.0).sqrt();
        assert!((0.85..1.25).contains(&spread), "{times} times: {spread}");
    }
}

/// What fits one pose as a whole is decisive, however it varies.
#[test]
fn a_sum_of_one_sign_exceeds_zero_by_far() {
    let mut random = Random::new(6);
    let values: Vec<f64> = (0..100).map(|_| 1.0 + random.normal()).collect();
    assert!((8.0..12.0).contains(&sigmas(&values, &[50, 50])));
    let turned: Vec<f64> = values.iter().map(|value| -value).collect();
    assert_eq!(sigmas(&turned, &[50, 50]), -sigmas(&values, &[50, 50]));
    assert_eq!(sigmas(&[], &[]), 0.0);
}
