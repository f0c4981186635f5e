//! What the stretches of a ring are, clean or disturbed: what comes over one mostly comes over its neighbors (`docs/math.md`, eq. 17.4).

use nalgebra::{Matrix2, Vector2};

use super::stretch::Stretch;

/// What a stretch may be: clean or disturbed.
pub const KINDS: usize = 2;

/// How far stretches of one kind are off from between their corners, and what share of a contour they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of the contour.
    pub share: f64,
    /// Standard deviation of the offset of either end from its corner, pixels; 0 of what runs from corner to corner.
    pub off: f64,
}

/// By the kind of one stretch, a column each, that of another, a row each; but for a multiple.
type Table = Matrix2<f64>;

/// What is said of the kinds of the stretches of a ring, on the way around it.
pub(super) struct Kinds {
    /// From the kind of the first stretch to that of the next one to be visited.
    before: Table,
    /// From the kind of each stretch to that of the next one.
    next: Vec<Table>,
    /// From the kind of each stretch, on over all behind it, to that of the first.
    behind: Vec<Table>,
}

impl Kinds {
    /// Before the first stretch.
    pub(super) fn new(stretches: &[Stretch]) -> Self {
        let next: Vec<Table> = (0..stretches.len()).map(|number| next_to(stretches, number)).collect();
        let mut last = Table::identity();
        let passed = |number: usize| {
            let behind = last * next[number];
            last = scaled(behind * told(&stretches[number])).0;
            behind
        };
        let mut behind: Vec<Table> = (0..stretches.len()).rev().map(passed).collect();
        behind.reverse();
        Self { before: Table::identity(), next, behind }
    }

    /// What all others say of the kind of the next stretch, which has this number.
    pub(super) fn others(&self, number: usize) -> [f64; KINDS] {
        let said = (self.before * self.behind[number]).diagonal();
        (said / said.sum()).into()
    }

    /// Goes past that stretch.
    pub(super) fn pass(&mut self, number: usize, stretches: &[Stretch]) {
        self.before = scaled(self.next[number] * told(&stretches[number]) * self.before).0;
    }
}

/// Logarithm of the probability of all labels beside the stretches of a ring.
pub(super) fn log_probability(stretches: &[Stretch]) -> f64 {
    let (mut all, mut prior, mut log_scale) = (Table::identity(), Table::identity(), 0.0);
    for (number, stretch) in stretches.iter().enumerate() {
        let next = next_to(stretches, number);
        prior = next * prior;
        let (passed, log_most) = scaled(next * told(stretch) * all);
        all = passed;
        log_scale += log_most + most_told(stretch);
    }
    log_scale + (all.trace() / prior.trace()).ln()
}

/// From the kind of a stretch to that of the next one on the ring: clean and disturbed parts follow each other along it by
/// chance, disturbed ones as long as they are far off: a convention. With half that length ellipsoids hold as many poses, with three times
/// that some fewer (`regionpose evaluate lidar --only scan=samples --only noise=0.05`).
fn next_to(stretches: &[Stretch], number: usize) -> Table {
    let (stretch, next) = (&stretches[number], &stretches[(number + 1) % stretches.len()]);
    let [_, disturbed] = next.kinds;
    let way = 0.5 * (stretch.length + next.length);
    let same = (-way / disturbed.off).exp();
    let shares = Vector2::from(next.kinds.map(|kind| kind.share));
    Table::from_columns(&[shares, shares]) * (1.0 - same) + Table::identity() * same
}

/// What the labels beside a stretch say of its kind, but for a multiple.
fn told(stretch: &Stretch) -> Table {
    let most = most_told(stretch);
    Table::from_diagonal(&Vector2::from(stretch.known.told.map(|told| (told - most).exp())))
}

fn most_told(stretch: &Stretch) -> f64 {
    let [clean, disturbed] = stretch.known.told;
    clean.max(disturbed)
}

/// With 1 as the largest entry, and the logarithm of what that was.
fn scaled(table: Table) -> (Table, f64) {
    let most = table.max();
    (table / most, most.ln())
}
