//! Steps of a cloud that a photo shows as edges, as seen from a camera's center: where a near surface ends before a far one, and
//! where the shade of a surface changes (`docs/math.md`, section 18).

use std::array;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::mem;
use std::ops::Range;

use nalgebra::Vector3;

use crate::math::lanes::{NullaryFnOnce, vectorized};

/// Sectors around a point in each of which its nearest neighbor is found: pairs of opposite ones, 45 degrees wide.
const SECTORS: usize = 8;

/// A neighbor on the near side may be so many times nearer than the one beyond the step: plain extrapolation past that
/// would magnify range noise.
const MOST_REACH: f64 = 2.0;

/// Least ratios of a step of shade to the mean change between neighbors, and to the changes beside it. Conventions.
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

impl Sample {
    /// The sample of a point; `None` of one that is not finite, or in the center.
    fn new(number: usize, point: &Vector3<f64>) -> Option<Self> {
        let range = point.norm();
        (range.is_finite() && range > 0.0).then(|| Self {
            bearing: point / range,
            inverse: range.recip(),
            point: number,
        })
    }
}

/// The steps of depth of points, as of [`VisiblePoints`]: neighbors are found only where surfaces may end.
pub fn depth_steps(points: &[Vector3<f64>], cell: f64, gap: f64, step_fraction: f64) -> Vec<Step> {
    // Points of a cell may lie in neighboring buckets, but no farther apart.
    let near = if cell <= gap { near_steps(points, gap, step_fraction) } else { points.to_vec() };
    VisiblePoints::new(&near, cell, gap).depth_steps(step_fraction)
}

/// The points, in their order, that decide on steps of depth.
///
/// A step goes from a sample to a neighbor that is farther by a fraction of the inverse distance: only from buckets about which some
/// point is that much farther. What their samples are and what these have for neighbors is decided within two buckets.
fn near_steps(points: &[Vector3<f64>], gap: f64, step_fraction: f64) -> Vec<Vector3<f64>> {
    let mut buckets = DepthBuckets::default();
    let held: Vec<u32> = points.iter().map(|point| buckets.insert(point, gap)).collect();
    let has_steps = |bucket: &usize| {
        let [_, nearest] = buckets.inverses[*bucket];
        let farthest = buckets.around(*bucket).map(|other| buckets.inverses[other][0]).fold(f64::INFINITY, f64::min);
        farthest < (1.0 - step_fraction) * nearest * (1.0 + ROUNDING)
    };
    let mut kept: Vec<usize> = (0..buckets.cells.len()).filter(has_steps).collect();
    let mut is_kept = vec![false; buckets.cells.len()];
    for _ in 0..2 {
        let beside: Vec<usize> = kept.iter().flat_map(|bucket| buckets.around(*bucket)).collect();
        kept = beside.into_iter().filter(|bucket| !mem::replace(&mut is_kept[*bucket], true)).collect();
    }
    let pairs = points.iter().zip(held);
    pairs.filter(|(_, bucket)| is_kept.get(*bucket as usize) == Some(&true)).map(|(point, _)| *point).collect()
}

/// Relative slack of comparisons of depths, above all rounding of theirs.
const ROUNDING: f64 = 1e-9;

/// Cells of bearings as large as the widest gap, numbered as they are met.
#[derive(Default)]
struct DepthBuckets {
    numbers: HashMap<(i32, i32, i32), u32, BuildHasherDefault<CellHasher>>,
    cells: Vec<[i32; 3]>,
    /// Least and largest inverse distance of the points in each.
    inverses: Vec<[f64; 2]>,
}

impl DepthBuckets {
    /// The number of the bucket of a point, which counts in it; `u32::MAX` of one that is no sample.
    fn insert(&mut self, point: &Vector3<f64>, gap: f64) -> u32 {
        let Some(Sample { bearing, inverse, .. }) = Sample::new(0, point) else { return u32::MAX };
        let [x, y, z] = array::from_fn(|axis| whole_below(bearing[axis] / gap));
        let number = *self.numbers.entry((x, y, z)).or_insert_with(|| {
            self.cells.push([x, y, z]);
            self.inverses.push([f64::INFINITY, 0.0]);
            (self.cells.len() - 1) as u32
        });
        let [least, largest] = &mut self.inverses[number as usize];
        (*least, *largest) = (least.min(inverse), largest.max(inverse));
        number
    }

    /// The numbers of a bucket and of those beside it that hold points.
    fn around(&self, bucket: usize) -> impl Iterator<Item = usize> {
        let [x, y, z] = self.cells[bucket];
        let beside = (0..27).filter_map(move |k| self.numbers.get(&(x + k / 9 - 1, y + k / 3 % 3 - 1, z + k % 3 - 1)));
        beside.map(|number| *number as usize)
    }
}

/// Hash of three small whole numbers: a multiplication each, where the standard one takes as long as all else about a point.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_i32(i32::from(*byte)));
    }

    fn write_i32(&mut self, value: i32) {
        // The golden ratio in 64 bits (Fibonacci hashing, Knuth).
        self.0 = (self.0.rotate_left(5) ^ u64::from(value as u32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
}

/// The numbers of a sample's nearest neighbors, one in each sector.
type Neighbors = [Option<u32>; SECTORS];

/// The points that are visible from a place, and the neighbors of each.
#[derive(Debug)]
pub struct VisiblePoints {
    samples: Vec<Sample>,
    around: Vec<Neighbors>,
}

impl VisiblePoints {
    /// The visible ones of points given relative to the camera's center, meters, in any axes.
    ///
    /// `cell`, rad: of points whose bearings differ by less, the nearest one hides the others. `gap`, rad: neighbors farther apart
    /// are none. Points that are not finite, or in the center, are left out.
    pub fn new(points: &[Vector3<f64>], cell: f64, gap: f64) -> Self {
        let samples = visible(points, cell);
        let around = vectorized(Buckets::new(&samples, gap));
        Self { samples, around }
    }

    /// Where a near surface ends: the step goes beyond the plane through the near side by more than this fraction of the inverse
    /// distance.
    pub fn depth_steps(&self, step_fraction: f64) -> Vec<Step> {
        let ends = (0..self.samples.len()).flat_map(|near| {
            let far = array::from_fn::<_, SECTORS, _>(|sector| self.end_of(near, sector, step_fraction));
            far.into_iter().flatten().map(move |far| self.step(near, far))
        });
        ends.collect()
    }

    /// Where the shade of a surface changes from neighbor to neighbor, and not beside them. `shades`: one of each point given, on any
    /// scale. `step_fraction`: samples whose inverse distances differ by more are not one surface. None where there are fewer shades than
    /// points; shades that are not finite are unknown.
    pub fn shade_steps(&self, shades: &[f64], step_fraction: f64) -> Vec<Step> {
        let held: Option<Vec<f64>> = self.samples.iter().map(|sample| shades.get(sample.point).copied()).collect();
        let Some(shades) = held else { return Vec::new() };
        let rows = (0..self.samples.len())
            .flat_map(|index| (0..SECTORS).filter_map(move |sector| self.row_of(index, sector, step_fraction)));
        let (mut sum, mut count) = (0.0, 0_usize);
        let mut changes = Vec::new();
        for change in rows.filter_map(|row| Change::new(row, &shades)) {
            sum += change.size;
            count += 1;
            if change.size > OF_BESIDE * change.beside {
                changes.push(change);
            }
        }
        let mean = sum / count as f64;
        let is_step = |change: &&Change| change.size > OF_MEAN * mean;
        // Most are met from both sides.
        let mut pairs: Vec<[usize; 2]> = changes.iter().filter(is_step).map(|change| change.pair).collect();
        pairs.sort_unstable();
        pairs.dedup();
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
    fn end_of(&self, index: usize, sector: usize, step_fraction: f64) -> Option<usize> {
        let (before, beyond) = (self.neighbor(index, sector + SECTORS / 2)?, self.neighbor(index, sector)?);
        let here = self.samples[index];
        let [before, after] = [before, beyond].map(|number| self.samples[number]);
        (excess(&here, &before, &after) > step_fraction * here.inverse).then_some(beyond)
    }

    /// Four samples of a surface in a row: the one before, the sample, its neighbor in the sector, and the one beyond that.
    fn row_of(&self, index: usize, sector: usize, step_fraction: f64) -> Option<[usize; 4]> {
        let (before, next) = (self.neighbor(index, sector + SECTORS / 2)?, self.neighbor(index, sector)?);
        let row = [before, index, next, self.neighbor(next, sector)?];
        let inverse = |number: usize| self.samples[number].inverse;
        let is_near = |pair: &[usize]| (inverse(pair[0]) - inverse(pair[1])).abs() < step_fraction * inverse(index);
        row.windows(2).all(is_near).then_some(row)
    }
}

/// Change of shade between two neighbors, and beside them.
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

/// By how much the inverse distance beyond a sample falls below that of the plane through the sample and its neighbor before it,
/// and below the sample's own.
fn excess(here: &Sample, before: &Sample, beyond: &Sample) -> f64 {
    let [back, forth] = [before, beyond].map(|other| (other.bearing - here.bearing).norm());
    let slope = (here.inverse - before.inverse) / back;
    let expected = here.inverse + slope * forth.min(MOST_REACH * back);
    expected.min(here.inverse) - beyond.inverse
}

/// The samples that no other one in their cell hides, in the order of the cells.
fn visible(points: &[Vector3<f64>], cell: f64) -> Vec<Sample> {
    let finite = points.iter().enumerate().filter_map(|(number, point)| Sample::new(number, point));
    let mut placed: Vec<Placed> = finite.map(|sample| Placed::new(&sample.bearing, cell, sample.point)).collect();
    placed.sort_unstable();
    let nearest = |held: &[Placed]| {
        let samples = held.iter().filter_map(|place| Sample::new(place.number(), &points[place.number()]));
        samples.reduce(|nearest, other| if other.inverse > nearest.inverse { other } else { nearest })
    };
    placed.chunk_by(Placed::is_beside).filter_map(nearest).collect()
}

/// A cell of space, and the number of what lies in it, below 2^32: one integer, in the order of cells and then of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Placed(u128);

impl Placed {
    fn new(bearing: &Vector3<f64>, size: f64, number: usize) -> Self {
        Self::first(array::from_fn(|axis| whole_below(bearing[axis] / size)), number as u32)
    }

    /// That of a cell and a number.
    fn first(cell: [i32; 3], number: u32) -> Self {
        // With the sign's bit turned over, integers without sign have the order of those with one.
        let words = cell.map(|index| index as u32 ^ 1 << 31);
        Self([words[0], words[1], words[2], number].into_iter().fold(0, |bits, word| bits << 32 | u128::from(word)))
    }

    fn cell(self) -> [i32; 3] {
        [96, 64, 32].map(|shift| ((self.0 >> shift) as u32 ^ 1 << 31) as i32)
    }

    fn number(self) -> usize {
        self.0 as u32 as usize
    }

    /// Whether another one is in the same cell.
    fn is_beside(&self, other: &Self) -> bool {
        self.0 >> 32 == other.0 >> 32
    }
}

/// The largest whole number that is no greater: `floor` is a call where the machine's instructions are those of all.
fn whole_below(value: f64) -> i32 {
    let cut = value as i32;
    cut - i32::from(value < f64::from(cut))
}

/// Samples in the order of cells of space as large as the widest gap, so that those of neighboring cells lie side by side.
struct Buckets {
    gap: f64,
    placed: Vec<Placed>,
    /// Components of the bearings.
    bearings: [Vec<f64>; 3],
}

impl Buckets {
    fn new(samples: &[Sample], gap: f64) -> Self {
        let places = samples.iter().enumerate().map(|(number, sample)| Placed::new(&sample.bearing, gap, number));
        let mut placed: Vec<_> = places.collect();
        placed.sort_unstable();
        let of_axis = |axis| placed.iter().map(|place| samples[place.number()].bearing[axis]).collect();
        Self { gap, bearings: [0, 1, 2].map(of_axis), placed }
    }

    /// Moves the ranges of the samples in the cells about one, on from those about a cell before: cells that follow one another
    /// along z are one range.
    #[inline(always)]
    fn move_to(&self, [x, y, z]: [i32; 3], rows: &mut [Range<usize>; 9]) {
        for (row, at) in (0_i32..).zip(rows) {
            let (x, y) = (x + row / 3 - 1, y + row % 3 - 1);
            let before =
                |place: usize, z: i32| place < self.placed.len() && self.placed[place] < Placed::first([x, y, z], 0);
            while before(at.start, z - 1) {
                at.start += 1;
            }
            at.end = at.end.max(at.start);
            while before(at.end, z + 2) {
                at.end += 1;
            }
        }
    }

    /// Adds to `near` the places of a row that lie within the gap of a bearing, with their squared distances.
    #[inline(always)]
    fn within(&self, [x, y, z]: [f64; 3], row: &Range<usize>, squares: &mut Vec<f64>, near: &mut Vec<(f64, usize)>) {
        let [xs, ys, zs] = [0, 1, 2].map(|axis| &self.bearings[axis][row.clone()]);
        squares.resize(row.len().max(squares.len()), 0.0);
        for (((square, i), j), k) in squares.iter_mut().zip(xs).zip(ys).zip(zs) {
            *square = (i - x) * (i - x) + (j - y) * (j - y) + (k - z) * (k - z);
        }
        let (mut count, most) = (near.len(), self.gap * self.gap);
        near.resize(count + row.len(), (0.0, 0));
        for (place, square) in row.clone().zip(squares.iter()) {
            // Without a branch, which would be taken at random.
            near[count] = (*square, place);
            count += usize::from((*square < most) & (*square > 0.0));
        }
        near.truncate(count);
    }

    /// The nearest neighbor in each sector around a bearing, of those near it.
    #[inline(always)]
    fn nearest(&self, bearing: [f64; 3], near: &[(f64, usize)]) -> Neighbors {
        let [right, up] = tangents(&bearing.into());
        let mut nearest = [(f64::INFINITY, None); SECTORS];
        for (square, place) in near {
            let way = Vector3::from_fn(|axis, _| self.bearings[axis][*place] - bearing[axis]);
            let held = &mut nearest[sector_of(way.dot(&right), way.dot(&up))];
            if *square < held.0 {
                *held = (*square, Some(self.placed[*place].number() as u32));
            }
        }
        nearest.map(|(_, number)| number)
    }
}

impl NullaryFnOnce for Buckets {
    /// The nearest neighbor in each sector around each sample.
    type Output = Vec<Neighbors>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut found = vec![[None; SECTORS]; self.placed.len()];
        let mut rows = array::from_fn(|_| 0..0);
        let (mut squares, mut near) = (Vec::new(), Vec::new());
        for (number, place) in self.placed.iter().enumerate() {
            if number == 0 || !place.is_beside(&self.placed[number - 1]) {
                self.move_to(place.cell(), &mut rows);
            }
            let bearing = [0, 1, 2].map(|axis| self.bearings[axis][number]);
            near.clear();
            for row in &rows {
                self.within(bearing, row, &mut squares, &mut near);
            }
            found[place.number()] = self.nearest(bearing, &near);
        }
        found
    }
}

/// Two unit vectors at right angles to a bearing and to one another.
fn tangents(bearing: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = Vector3::ith(bearing.iamin(), 1.0);
    let right = bearing.cross(&axis).normalize();
    [right, bearing.cross(&right)]
}

/// The sector of a direction, counted from x towards y: by signs alone, since an arc tangent takes longer than all else, and
/// without branches.
#[inline(always)]
fn sector_of(x: f64, y: f64) -> usize {
    let (below, flat, steep) = (y < 0.0, x.abs() >= y.abs(), y.abs() >= x.abs());
    let behind = (below & (x >= 0.0)) | (!below & (x <= 0.0));
    let beyond = (behind & flat) | (!behind & steep);
    SECTORS / 2 * usize::from(below) + SECTORS / 4 * usize::from(behind) + usize::from(beyond)
}
