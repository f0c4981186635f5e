//! What the pieces of one side have in common: lines through sides told from noise, and what that leaves to count.

mod support;

use std::ops::Range;

use regionpose::contour::coherence::{Coherence, sides};
use regionpose::contour::readings::Reading;
use support::random::Random;

const PIECES: usize = 25;

fn reading(edge: u32, run: Option<u32>) -> Reading {
    Reading { distance: 0.0, spread: 0.0, misfit: 0.0, edge, run }
}

/// Sides of as many pieces, whose ends are off by `ends` and whose pieces by `rest` each.
fn drawn(random: &mut Random, count: usize, ends: f64, rest: f64) -> (Vec<Range<usize>>, Vec<f64>) {
    let sides = (0..count).map(|side| side * PIECES..(side + 1) * PIECES).collect();
    let mut distances = Vec::new();
    for _ in 0..count {
        let (first, last) = (ends * random.normal(), ends * random.normal());
        let along = |index: usize| (index as f64 + 0.5) / PIECES as f64;
        distances.extend((0..PIECES).map(|k| first + (last - first) * along(k) + rest * random.normal()));
    }
    (sides, distances)
}

#[test]
fn a_side_is_an_edge_or_a_longer_run() {
    let edges = [0, 0, 0, 1, 2, 3, 3].map(|edge| reading(edge, None));
    assert_eq!(sides(&edges), [0..3, 3..4, 4..5, 5..7]);
    let runs = [(0, 7), (1, 7), (2, 7), (3, 7), (4, 8), (4, 8), (4, 9)].map(|(edge, run)| reading(edge, Some(run)));
    assert_eq!(sides(&runs), [0..4, 4..7]);
    assert!(sides(&[]).is_empty());
}

#[test]
fn ends_and_rest_are_told_apart() {
    let mut random = Random::new(4);
    for (ends, rest) in [(0.5, 0.0), (0.5, 0.3), (0.0, 0.3), (1.0, 0.1)] {
        let (sides, distances) = drawn(&mut random, 600, ends, rest);
        let found = Coherence::new(&sides, &distances, &vec![1.0; distances.len()]);
        assert!((1.5 * found.line - ends * ends).abs() < 0.1 * ends * ends + 0.01, "{ends}, {rest}: {}", found.line);
        assert!((found.rest - rest * rest).abs() < 0.05 * rest * rest + 1e-9, "{ends}, {rest}: {}", found.rest);
    }
}

#[test]
fn a_side_counts_as_its_pieces_or_as_its_ends() {
    let mut random = Random::new(5);
    let weights = [1.0; PIECES];
    let of = |ends: f64, rest: f64, random: &mut Random| {
        let (sides, distances) = drawn(random, 400, ends, rest);
        Coherence::new(&sides, &distances, &vec![1.0; distances.len()])
    };
    let (polygon, mask) = (of(0.5, 0.0, &mut random), of(0.0, 0.2, &mut random));
    assert!((polygon.independent(&weights, 1) - 1.92).abs() < 0.02, "{}", polygon.independent(&weights, 1));
    assert!(mask.independent(&weights, 1) > 0.9 * PIECES as f64, "{}", mask.independent(&weights, 1));
    assert!((polygon.independent(&[0.5; PIECES], 1) - 0.96).abs() < 0.01);
    let exact = Coherence::new(&[0..PIECES], &[0.0; PIECES], &weights);
    assert!(exact.common() == 1.0);
}

#[test]
fn nothing_and_weightless_pieces_are_fine() {
    for (count, weight) in [(0, 1.0), (1, 1.0), (9, 0.0)] {
        let found = Coherence::new(&[0..count], &vec![0.3; count], &vec![weight; count]);
        assert!([found.line, found.rest, found.common()].iter().all(|value| value.is_finite()), "{found:?}");
    }
}
