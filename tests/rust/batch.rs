//! Batches: in order, and the same to the last bit for any number of threads.

use crate::support::random::Random;
use crate::support::scene::{Layout, Scene};
use regionpose::internals::batch::in_parallel_within;
use regionpose::internals::budget::Budget;
use regionpose::{Estimate, Integration, Problem, Result, System, in_parallel};

fn scenes() -> Vec<Scene> {
    let mut random = Random::new(41);
    (0..12).map(|k| Scene::random(&mut random, Layout { regions: 1 + k % 3, ..Layout::default() })).collect()
}

fn estimates(scenes: &[Scene], threads: Option<usize>) -> Vec<Estimate> {
    let solve = |scene: &Scene| Ok(scene.problem(System::Plane, Integration::Boundary).estimate().unwrap());
    in_parallel(scenes, threads, solve).unwrap().into_iter().collect::<Result<_>>().unwrap()
}

/// All numbers of an estimate, bit by bit.
fn bits(estimate: &Estimate) -> Vec<u64> {
    let alternatives = estimate.alternatives.iter();
    let solutions = std::iter::once(&estimate.best).chain(alternatives);
    let numbers = solutions.flat_map(|solution| {
        let pose = solution.pose;
        let entries: Vec<f64> = pose.rotation.matrix().iter().chain(pose.translation.iter()).copied().collect();
        let cost = solution.minimum.as_ref().map(|minimum| minimum.cost);
        entries.into_iter().chain(cost).chain([solution.overlap_error])
    });
    numbers.chain(estimate.best.covariance.iter().copied()).map(f64::to_bits).collect()
}

#[test]
fn answers_are_the_same_for_any_number_of_threads_and_in_order() {
    let scenes = scenes();
    let one = estimates(&scenes, Some(1));
    for (scene, estimate) in scenes.iter().zip(&one) {
        assert!(scene.errors(&estimate.best.pose).0 < 1e-9);
    }
    for threads in [Some(2), Some(3), None] {
        for (a, b) in one.iter().zip(&estimates(&scenes, threads)) {
            assert_eq!(bits(a), bits(b), "{threads:?} threads");
            assert_eq!(a.warnings, b.warnings);
        }
    }
}

/// One region of the batch has no area, another no partner: each has its own answer, the others theirs.
#[test]
fn a_problem_that_is_refused_or_unsolved_leaves_the_others_alone() {
    let mut scenes = scenes();
    scenes[3].observed[0].rings[0].truncate(2);
    scenes[5].observed.pop();
    let solve = |scene: &Scene| Problem::new(&scene.observed, &scene.worlds)?.estimate();
    let answers: Vec<Result<Estimate>> = in_parallel(&scenes, Some(2), solve).unwrap();
    for (index, (scene, answer)) in scenes.iter().zip(&answers).enumerate() {
        match (index, answer) {
            (3, Err(error)) => assert!(error.to_string().starts_with("region 0: ring 0 has 2 distinct"), "{error}"),
            (5, Err(error)) => assert!(error.to_string().starts_with("there are "), "{error}"),
            (_, Ok(estimate)) => assert!(scene.errors(&estimate.best.pose).0 < 1e-9, "problem {index}"),
            (_, other) => panic!("problem {index}: {other:?}"),
        }
    }
}

#[test]
fn a_problem_that_panics_leaves_the_others_alone() {
    let halved = |&x: &u32| if x == 3 { panic!("{x} is odd") } else { Ok(x / 2) };
    let answers = in_parallel(&[2, 3, 4], Some(2), halved).unwrap();
    let message = answers[1].as_ref().unwrap_err().to_string();
    assert_eq!(message, "the solver failed on this problem (3 is odd); this is a defect of regionpose");
    assert!(matches!((&answers[0], &answers[2]), (Ok(1), Ok(2))));
}

#[test]
fn no_problems_give_no_answers() {
    assert!(in_parallel(&[] as &[f64], Some(2), |x| Ok(x + 1.0)).unwrap().is_empty());
}

#[test]
fn more_threads_than_problems_are_fine() {
    let squares: Result<Vec<i32>> = in_parallel(&[1, 2, 3], Some(16), |x| Ok(x * x)).unwrap().into_iter().collect();
    assert_eq!(squares.unwrap(), [1, 4, 9]);
}

#[test]
fn zero_threads_are_refused() {
    let message = in_parallel(&[1], Some(0), |x| Ok(x + 1)).unwrap_err().to_string();
    assert_eq!(message, "threads is 0; it needs to be at least 1");
}

/// A pool's threads take up other problems while one waits for a pool of its own: what those are charged is not taken from its limit,
/// and each has what the caller had left.
#[test]
fn problems_within_problems_have_limits_of_their_own() {
    let outer: Vec<u32> = (0..8).collect();
    let part = |_: &u32, budget: &Budget| {
        let before = budget.is_exhausted();
        budget.charge(10);
        std::thread::yield_now();
        Ok(before || budget.is_exhausted())
    };
    let solve = |_: &u32, budget: &Budget| {
        let (spent_before, exhausted) = budget.limited(1_000, |budget| {
            budget.charge(400);
            let inner = in_parallel_within(&outer, Some(2), part, budget);
            let inner: Vec<bool> = inner.unwrap().into_iter().collect::<Result<_>>().unwrap();
            (inner.into_iter().any(|spent| spent), budget.is_exhausted())
        });
        Ok((spent_before, exhausted))
    };
    let budget = Budget::unlimited();
    for each in in_parallel_within(&outer, Some(2), solve, &budget).unwrap() {
        assert_eq!(each.unwrap(), ((false, false), false), "480 of 1,000 are spent");
    }
    assert_eq!(budget.charged(), 8 * 480);
}
