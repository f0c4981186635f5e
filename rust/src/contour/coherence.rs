//! What the pieces of one side have in common, and how many measurements that leaves (`docs/math.md`, section 11).

use std::ops::Range;

use super::readings::Reading;

/// Measurements that the pieces of a side are which vary together: where its two ends are.
const ENDS: f64 = 2.0;

/// Pieces of a contour as the sides that vary together: stretches on one edge of the boundary, or on one straight run of the
/// contour where that is longer.
pub fn sides(readings: &[Reading]) -> Vec<Range<usize>> {
    let edges = stretches(readings, |a, b| a.edge == b.edge);
    let runs = stretches(readings, |a, b| a.run.is_some() && a.run == b.run);
    let longer = |index: usize| if runs[index].len() > edges[index].len() { &runs[index] } else { &edges[index] };
    let mut sides: Vec<Range<usize>> = Vec::new();
    for index in 0..readings.len() {
        match sides.last_mut() {
            Some(last) if longer(index - 1) == longer(index) => last.end += 1,
            _ => sides.push(index..index + 1),
        }
    }
    sides
}

/// The stretch of neighbours alike that each reading lies in.
fn stretches(readings: &[Reading], alike: impl Fn(&Reading, &Reading) -> bool) -> Vec<Range<usize>> {
    let mut found = Vec::with_capacity(readings.len());
    for stretch in readings.chunk_by(alike) {
        let first = found.len();
        found.extend(std::iter::repeat_n(first..first + stretch.len(), stretch.len()));
    }
    found
}

/// What the pieces of sides have in common: distances split into lines through each side and the rest.
#[derive(Debug, Clone, Copy)]
pub struct Coherence {
    /// Mean square of the lines beyond what chance makes them, squared pixels.
    pub line: f64,
    /// Variance of the rest, squared pixels.
    pub rest: f64,
}

impl Coherence {
    /// The split of distances with these weights. Every side of which enough is held says by its pieces' number how far sides are
    /// off: those that are off by more pull less, but are no rarer for that.
    pub fn new(sides: &[Range<usize>], distances: &[f64], weights: &[f64]) -> Self {
        let (mut of_lines, mut by_chance, mut on_sides) = (0.0, 0.0, 0.0);
        let (mut rest, mut free) = (0.0, 0.0);
        for side in sides {
            let (own, values, count) = (&weights[side.clone()], &distances[side.clone()], side.len() as f64);
            let held: f64 = own.iter().sum();
            let squares = |of: &[f64]| own.iter().zip(of).map(|(weight, value)| weight * value * value).sum::<f64>();
            let Some(line) = (if held > ENDS { through(values, own) } else { None }) else {
                rest += squares(values);
                free += held;
                continue;
            };
            let left: Vec<f64> = values.iter().zip(&line).map(|(value, line)| value - line).collect();
            rest += squares(&left);
            free += held - ENDS;
            of_lines += count / held * squares(&line);
            by_chance += count / held * ENDS;
            on_sides += count;
        }
        let rest = rest / f64::max(free, f64::MIN_POSITIVE);
        let line = (of_lines - by_chance * rest).max(0.0) / f64::max(on_sides, f64::MIN_POSITIVE);
        Self { line, rest }
    }

    /// Share of the variance that the pieces of a side have in common; all of it where there is none to tell.
    pub fn common(&self) -> f64 {
        let all = self.line + self.rest;
        if all > f64::MIN_POSITIVE { self.line / all } else { 1.0 }
    }

    /// How many of a side's pieces vary independently, each of which stands for `step` and counts as much as its weight.
    pub fn independent(&self, weights: &[f64], step: usize) -> f64 {
        let pieces = (step * weights.len()) as f64;
        let mean = weights.iter().sum::<f64>() / weights.len() as f64;
        mean * pieces / (1.0 + self.common() * (pieces - 1.0) / ENDS)
    }
}

/// Values at the pieces of the line that fits a side best; `None` where its weights hold none.
fn through(distances: &[f64], weights: &[f64]) -> Option<Vec<f64>> {
    let (mut all, mut first, mut second, mut sum, mut moment) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (index, (distance, weight)) in distances.iter().zip(weights).enumerate() {
        let along = share(index, distances.len());
        all += weight;
        first += weight * along;
        second += weight * along * along;
        sum += weight * distance;
        moment += weight * along * distance;
    }
    let determinant = all * second - first * first;
    let held = determinant > 1e-9 * all * second;
    let (start, slope) = ((second * sum - first * moment) / determinant, (all * moment - first * sum) / determinant);
    held.then(|| (0..distances.len()).map(|index| start + slope * share(index, distances.len())).collect())
}

/// Where on a side of so many pieces the middle of one lies, 0 to 1.
fn share(index: usize, count: usize) -> f64 {
    (index as f64 + 0.5) / count as f64
}
