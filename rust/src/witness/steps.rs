//! Depth steps: places where a near surface ends before a far one, as seen from a camera's center (`docs/math.md`, eq. 18.1).

use std::array;
use std::collections::HashMap;

use nalgebra::Vector3;

/// Directions around a point in each of which its nearest neighbor is looked for: pairs of opposite ones, 45 degrees wide.
const SECTORS: usize = 8;

/// A neighbor on the near side may be so many times nearer than the one beyond the step: plain extrapolation past that
/// would magnify range noise.
const MOST_REACH: f64 = 2.0;

/// The end of a near surface: unit bearings of its last sample and of the first one beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthStep {
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
}

/// A sample's nearest neighbor in a sector: angle to it, and its number.
type Neighbor = Option<(f64, usize)>;

/// The depth steps among points given relative to the camera's center, meters, in any axes.
///
/// `cell`, rad: of points whose bearings differ by less, the nearest one hides the others. `gap`, rad: neighbors farther apart
/// are none. `share`: a step goes beyond the plane through the near side by more than this share of the inverse distance.
/// Points that are not finite, or in the center, are left out.
pub fn depth_steps(points: &[Vector3<f64>], cell: f64, gap: f64, share: f64) -> Vec<DepthStep> {
    let samples = visible(points, cell);
    let buckets = Buckets::new(&samples, gap);
    let ends = (0..samples.len()).flat_map(|near| {
        let far = ends_of(&samples, near, &buckets.neighbors(&samples, near), share);
        far.into_iter().flatten().map(move |far| (near, far))
    });
    ends.map(|(near, far)| step(&samples[near], &samples[far])).collect()
}

fn step(near: &Sample, far: &Sample) -> DepthStep {
    DepthStep { near: near.bearing, far: far.bearing, distance: near.inverse.recip() }
}

/// The neighbors of a sample before which its surface ends.
fn ends_of(samples: &[Sample], index: usize, around: &[Neighbor; SECTORS], share: f64) -> [Option<usize>; SECTORS] {
    let inverse = samples[index].inverse;
    array::from_fn(|sector| {
        let (before, beyond) = (around[(sector + SECTORS / 2) % SECTORS]?, around[sector]?);
        let inverses = [before, beyond].map(|(_, number)| samples[number].inverse);
        (excess(inverse, [before.0, beyond.0], inverses) > share * inverse).then_some(beyond.1)
    })
}

/// How far the inverse distance beyond a sample falls below that of the plane through the sample and its neighbor before it,
/// and below the sample's own.
fn excess(inverse: f64, [before, beyond]: [f64; 2], [inverse_before, inverse_beyond]: [f64; 2]) -> f64 {
    let slope = (inverse - inverse_before) / before;
    let expected = inverse + slope * beyond.min(MOST_REACH * before);
    expected.min(inverse) - inverse_beyond
}

/// The samples that no other one in their cell hides.
fn visible(points: &[Vector3<f64>], cell: f64) -> Vec<Sample> {
    let mut nearest: HashMap<[i32; 3], Sample> = HashMap::new();
    for point in points {
        let range = point.norm();
        if range.is_finite() && range > 0.0 {
            let sample = Sample { bearing: point / range, inverse: range.recip() };
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
    fn neighbors(&self, samples: &[Sample], index: usize) -> [Neighbor; SECTORS] {
        let (bearing, mut nearest) = (samples[index].bearing, [None; SECTORS]);
        let [right, up] = tangents(&bearing);
        for number in self.around(&bearing).filter(|number| *number != index) {
            let way = samples[number].bearing - bearing;
            let square = way.norm_squared();
            if square < self.gap * self.gap && square > 0.0 {
                let sector = sector_of(way.dot(&right), way.dot(&up));
                let held: &mut Neighbor = &mut nearest[sector];
                if held.is_none_or(|(least, _)| square < least) {
                    *held = Some((square, number));
                }
            }
        }
        nearest.map(|held: Neighbor| held.map(|(square, number)| (square.sqrt(), number)))
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
