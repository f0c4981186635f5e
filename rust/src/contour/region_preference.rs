//! Comparison of two poses by region: a region that fits the other pose alone is displaced as a whole, like a moved thing or one of
//! a wrong pair. That is one event, however long the region's contour (`docs/math.md`, section 11).

use std::cmp::Ordering;

use crate::math::autocorrelation::split;

/// Which of two poses a region belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionPreference {
    /// The first alone.
    First,
    /// Both, or neither.
    Neither,
    /// The second alone.
    Second,
}

impl RegionPreference {
    /// Of a region that belongs to the first alone, to the second alone, or else to both or neither.
    pub fn of(first: bool, second: bool) -> Self {
        match (first, second) {
            (true, false) => Self::First,
            (false, true) => Self::Second,
            _ => Self::Neither,
        }
    }
}

/// Deviance of the second pose, in variances, of `worse` by all regions or some: its sign is that of the majority of regions; with a
/// tie it is that by the other regions and by the distances, pixels, of each region at each pose.
pub fn compare_by_region(
    preferences: &[RegionPreference],
    distances: [&[f64]; 2],
    worse: impl Fn(&[bool]) -> f64,
) -> f64 {
    let count = |preference: RegionPreference| preferences.iter().filter(|&&other| other == preference).count();
    let (first, second) = (count(RegionPreference::First), count(RegionPreference::Second));
    let by_all = || worse(&vec![true; preferences.len()]);
    let by_others =
        || worse(&preferences.iter().map(|&preference| preference == RegionPreference::Neither).collect::<Vec<_>>());
    match first.cmp(&second) {
        // A pose that chance alone puts ahead of the likelier one is not better.
        _ if first == 0 || second == 0 => by_all().max(0.0),
        Ordering::Greater => by_all().abs(),
        Ordering::Less => -by_all().abs(),
        Ordering::Equal => by_others() + 2.0 * by_distances(preferences, distances),
    }
}

/// Logarithm of the odds of the first pose by how far off each region lies at the pose that it does not belong to.
///
/// The place of a region that is elsewhere has no scale: at a distance `r` in the image its density falls as `1 / r^2`.
fn by_distances(preferences: &[RegionPreference], [first, second]: [&[f64]; 2]) -> f64 {
    let odds = |((preference, first), second): ((&RegionPreference, &f64), &f64)| match preference {
        RegionPreference::First => 2.0 * second.ln(),
        RegionPreference::Neither => 0.0,
        RegionPreference::Second => -2.0 * first.ln(),
    };
    preferences.iter().zip(first).zip(second).map(odds).sum()
}

/// The values of the regions that count, and how many each of these has.
pub fn of_counted(values: &[f64], counts: &[usize], counted: &[bool]) -> (Vec<f64>, Vec<usize>) {
    let regions = || split(values, counts).zip(counted).filter(|(_, counted)| **counted).map(|(values, _)| values);
    (regions().flatten().copied().collect(), regions().map(<[f64]>::len).collect())
}
