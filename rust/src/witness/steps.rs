//! Steps of a cloud that a photo shows as edges, as seen from a camera's center: where a near surface ends before a far one, and
//! where the shade of a surface changes (`docs/math.md`, section 18).

use std::array;
use std::collections::{BTreeSet, HashMap};

use nalgebra::Vector3;

/// Directions around a point in each of which its nearest neighbor is looked for: pairs of opposite ones, 45 degrees wide.
const SECTORS: usize = 8;

/// A neighbor on the near side may be so many times nearer than the one beyond the step: plain extrapolation past that
/// would magnify range noise.
const MOST_REACH: f64 = 2.0;

/// How many times as large as the mean change of shade between neighbors, and as the changes beside it, a step is. Measured: means
/// of 2, 3 and 4 give true poses log odds of 4.5, 4.9 and 4.7 in the mean of 20 frames (`python -m benchmarks.witness`); 2 beside
/// is a convention.
const OF_MEAN: f64 = 3.0;
const OF_BESIDE: f64 = 2.0;

/// A step: unit bearings of the samples on both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Bearing of the sample on the near side.
    pub near: Vector3<f64>,
    /// Bearing of its neighbor on the far side.
    pub far: Vector3<f64>,
    /// Distance of the sample on the near side, meters.
    pub distance: f64,
}

/// A sample: its bearing and inverse distance, which is linear over the image of a plane.
#[derive(Debug, Clone, Copy)]
struct Sample {
    bearing: Vector3<f64>,
    inverse: f64,
    /// Of the point among those given.
    point: usize,
}

/// The numbers of a sample's nearest neighbors, one in each sector.
type Neighbors = [Option<u32>; SECTORS];

/// The points that are seen from a place, and what lies around each.
#[derive(Debug)]
pub struct Seen {
    samples: Vec<Sample>,
    around: Vec<Neighbors>,
}

impl Seen {
    /// What is seen of points given relative to the camera's center, meters, in any axes.
    ///
    /// `cell`, rad: of points whose bearings differ by less, the nearest one hides the others. `gap`, rad: neighbors farther apart
    /// are none. Points that are not finite, or in the center, are left out.
    pub fn new(points: &[Vector3<f64>], cell: f64, gap: f64) -> Self {
        let samples = visible(points, cell);
        let buckets = Buckets::new(&samples, gap);
        let around = (0..samples.len()).map(|index| buckets.neighbors(&samples, index)).collect();
        Self { samples, around }
    }

    /// Where a near surface ends: the step goes beyond the plane through the near side by more than this share of the inverse
    /// distance.
    pub fn depth_steps(&self, share: f64) -> Vec<Step> {
        let ends = (0..self.samples.len()).flat_map(|near| {
            let far = array::from_fn::<_, SECTORS, _>(|sector| self.end_of(near, sector, share));
            far.into_iter().flatten().map(move |far| self.step(near, far))
        });
        ends.collect()
    }

    /// Where the shade of a surface changes from neighbor to neighbor, and not beside them. `shades`: one of each point given, on any
    /// scale. `share`: samples whose inverse distances differ by more are not one surface. None where there are fewer shades than
    /// points; shades that are not finite are unknown.
    pub fn shade_steps(&self, shades: &[f64], share: f64) -> Vec<Step> {
        let held: Option<Vec<f64>> = self.samples.iter().map(|sample| shades.get(sample.point).copied()).collect();
        let Some(shades) = held else { return Vec::new() };
        let rows = (0..self.samples.len())
            .flat_map(|index| (0..SECTORS).filter_map(move |sector| self.row_of(index, sector, share)));
        let changes: Vec<Change> = rows.filter_map(|row| Change::new(row, &shades)).collect();
        let mean = changes.iter().map(|change| change.size).sum::<f64>() / changes.len() as f64;
        let is_step = |change: &&Change| change.size > OF_MEAN * mean && change.size > OF_BESIDE * change.beside;
        // Most are met from both sides.
        let pairs: BTreeSet<[usize; 2]> = changes.iter().filter(is_step).map(|change| change.pair).collect();
        pairs.into_iter().map(|[one, other]| self.step(one, other)).collect()
    }

    fn step(&self, near: usize, far: usize) -> Step {
        let (near, far) = (&self.samples[near], &self.samples[far]);
        Step { near: near.bearing, far: far.bearing, distance: near.inverse.recip() }
    }

    fn neighbor(&self, index: usize, sector: usize) -> Option<usize> {
        self.around[index][sector % SECTORS].map(|number| number as usize)
    }

    /// The neighbor in a sector before which a sample's surface ends.
    fn end_of(&self, index: usize, sector: usize, share: f64) -> Option<usize> {
        let (before, beyond) = (self.neighbor(index, sector + SECTORS / 2)?, self.neighbor(index, sector)?);
        let here = self.samples[index];
        let [before, after] = [before, beyond].map(|number| self.samples[number]);
        (excess(&here, &before, &after) > share * here.inverse).then_some(beyond)
    }

    /// Four samples of a surface in a row: the one before, the sample, its neighbor in the sector, and the one beyond that.
    fn row_of(&self, index: usize, sector: usize, share: f64) -> Option<[usize; 4]> {
        let (before, next) = (self.neighbor(index, sector + SECTORS / 2)?, self.neighbor(index, sector)?);
        let row = [before, index, next, self.neighbor(next, sector)?];
        let inverse = |number: usize| self.samples[number].inverse;
        let is_near = |pair: &[usize]| (inverse(pair[0]) - inverse(pair[1])).abs() < share * inverse(index);
        row.windows(2).all(is_near).then_some(row)
    }
}

/// How much the shade changes between two neighbors, and beside them.
struct Change {
    pair: [usize; 2],
    size: f64,
    beside: f64,
}

impl Change {
    /// That in the middle of four samples in a row; `None` where a shade is unknown.
    fn new([before, one, other, beyond]: [usize; 4], shades: &[f64]) -> Option<Self> {
        let between = |a: usize, b: usize| (shades[a] - shades[b]).abs();
        let beside = between(before, one).max(between(other, beyond));
        let whole = Self { pair: [one.min(other), one.max(other)], size: between(one, other), beside };
        (between(before, one) + whole.size + between(other, beyond)).is_finite().then_some(whole)
    }
}

/// How far the inverse distance beyond a sample falls below that of the plane through the sample and its neighbor before it,
/// and below the sample's own.
fn excess(here: &Sample, before: &Sample, beyond: &Sample) -> f64 {
    let [back, forth] = [before, beyond].map(|other| (other.bearing - here.bearing).norm());
    let slope = (here.inverse - before.inverse) / back;
    let expected = here.inverse + slope * forth.min(MOST_REACH * back);
    expected.min(here.inverse) - beyond.inverse
}

/// The samples that no other one in their cell hides.
fn visible(points: &[Vector3<f64>], cell: f64) -> Vec<Sample> {
    let mut nearest: HashMap<[i32; 3], Sample> = HashMap::new();
    for (number, point) in points.iter().enumerate() {
        let range = point.norm();
        if range.is_finite() && range > 0.0 {
            let sample = Sample { bearing: point / range, inverse: range.recip(), point: number };
            let held = nearest.entry(cell_of(&sample.bearing, cell)).or_insert(sample);
            if sample.inverse > held.inverse {
                *held = sample;
            }
        }
    }
    let mut samples: Vec<_> = nearest.into_iter().collect();
    // A map's order differs from run to run.
    samples.sort_unstable_by_key(|(cell, _)| *cell);
    samples.into_iter().map(|(_, sample)| sample).collect()
}

fn cell_of(bearing: &Vector3<f64>, size: f64) -> [i32; 3] {
    array::from_fn(|axis| (bearing[axis] / size).floor() as i32)
}

/// Samples by cells of space as large as the widest gap.
struct Buckets {
    gap: f64,
    held: HashMap<[i32; 3], Vec<usize>>,
}

impl Buckets {
    fn new(samples: &[Sample], gap: f64) -> Self {
        let mut held: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
        for (number, sample) in samples.iter().enumerate() {
            held.entry(cell_of(&sample.bearing, gap)).or_default().push(number);
        }
        Self { gap, held }
    }

    /// The nearest neighbor in each sector around a sample.
    fn neighbors(&self, samples: &[Sample], index: usize) -> Neighbors {
        let (bearing, mut nearest) = (samples[index].bearing, [None::<(f64, u32)>; SECTORS]);
        let [right, up] = tangents(&bearing);
        for number in self.around(&bearing).filter(|number| *number != index) {
            let way = samples[number].bearing - bearing;
            let square = way.norm_squared();
            if square < self.gap * self.gap && square > 0.0 {
                let sector = sector_of(way.dot(&right), way.dot(&up));
                let held = &mut nearest[sector];
                if held.is_none_or(|(least, _)| square < least) {
                    *held = Some((square, number as u32));
                }
            }
        }
        nearest.map(|held| held.map(|(_, number)| number))
    }

    /// The samples of the cells about a place.
    fn around(&self, bearing: &Vector3<f64>) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = cell_of(bearing, self.gap);
        let steps = -1..=1;
        let cells =
            steps.clone().flat_map(move |i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k])));
        cells.filter_map(|cell| self.held.get(&cell)).flatten().copied()
    }
}

/// Two unit vectors at right angles to a bearing and to one another.
fn tangents(bearing: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = Vector3::ith(bearing.iamin(), 1.0);
    let right = bearing.cross(&axis).normalize();
    [right, bearing.cross(&right)]
}

/// The sector of a direction, counted from x towards y: by signs alone, since an arc tangent takes longer than all else.
fn sector_of(x: f64, y: f64) -> usize {
    let (x, y, half) = if y < 0.0 { (-x, -y, SECTORS / 2) } else { (x, y, 0) };
    let (x, y, quarter) = if x <= 0.0 { (y, -x, SECTORS / 4) } else { (x, y, 0) };
    half + quarter + usize::from(y >= x)
}
