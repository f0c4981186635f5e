//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.9 to 11.11).

use nalgebra::{Matrix6, Vector6};

use super::correlation::long_run;
use super::fit::ContourFit;
use super::readings::{Contour, NOISE_FLOOR, Reading};
use crate::geometry::pose::PARAMETERS;

/// A piece of a contour as the covariance needs it.
struct Row {
    reading: Reading,
    derivative: Vector6<f64>,
    /// Weight of its distance.
    weight: f64,
    /// Weight by which it holds the pose: less by the mean slope of its region's pulls.
    held: f64,
    region: usize,
}

/// Covariance of the left increment `[omega (rad), tau (metres)]` of a pose on the contours but those of regions astray; infinite
/// where a direction is left free.
///
/// What regions astray pull the pose off by counts as one error of that size.
pub fn covariance(contours: &[Contour], fit: &ContourFit, astray: &[bool]) -> Matrix6<f64> {
    let free = Matrix6::from_element(f64::INFINITY);
    let Some(regions) = rows_of(contours, fit) else { return free };
    let (own, others): (Vec<_>, Vec<_>) =
        regions.into_iter().partition(|rows| !rows.iter().any(|row| astray[row.region]));
    let information = products(own.iter().flatten(), |row| row.held);
    let Some(inverse) = information.cholesky().map(|cholesky| cholesky.inverse()) else { return free };
    let pulls = others.iter().map(|rows| rows.iter().map(|row| row.derivative * row.pull()).sum::<Vector6<f64>>());
    let of_others: Matrix6<f64> = pulls.map(|pull| pull * pull.transpose()).sum();
    inverse * (scatter(&own, &inverse) + of_others) * inverse
}

/// Scatter of the gradient of regions that belong to the pose.
fn scatter(regions: &[Vec<Row>], inverse: &Matrix6<f64>) -> Matrix6<f64> {
    let rows = || regions.iter().flatten();
    let pulls: Vec<f64> = rows().map(Row::pull).collect();
    let correlation = long_run(&pulls, &regions.iter().map(Vec::len).collect::<Vec<_>>());
    let single = products(rows(), |row| row.pull().powi(2));
    let runs = runs_scatter(regions);
    // A run that is off as a whole is one measurement, whatever the number of its pieces.
    let alike = (inverse * runs).trace() / (inverse * single).trace().max(f64::MIN_POSITIVE);
    // Six parameters leave so much less of the distances that vary independently.
    let (parameters, held) = (PARAMETERS as f64, rows().map(|row| row.weight).sum::<f64>());
    let independent = (held / correlation.max(alike).max(1.0)).max(parameters + 1.0);
    let squares = rows().map(|row| row.weight * row.reading.distance.powi(2)).sum::<f64>() / held;
    let floor = (NOISE_FLOOR.powi(2) - squares).max(0.0);
    let single = single + products(rows(), |row| row.weight.powi(2)) * floor;
    (single * correlation + runs) * (independent / (independent - parameters))
}

impl Row {
    fn pull(&self) -> f64 {
        self.reading.distance * self.weight
    }
}

/// Sum of the products of the derivatives, each times a factor.
fn products<'a>(rows: impl Iterator<Item = &'a Row>, factor: impl Fn(&Row) -> f64) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    rows.for_each(|row| sum.ger(factor(row), &row.derivative, &row.derivative, 1.0));
    sum
}

/// The pieces of each region; `None` where one is out of view.
fn rows_of(contours: &[Contour], fit: &ContourFit) -> Option<Vec<Vec<Row>>> {
    contours.iter().enumerate().map(|(region, contour)| region_rows(contour, fit, region)).collect()
}

fn region_rows(contour: &Contour, fit: &ContourFit, region: usize) -> Option<Vec<Row>> {
    let (odds, sigma) = (fit.mixture.odds(region), fit.mixture.sigma);
    let ratio = (sigma / fit.mixture.wide).powi(2);
    let mut read = Vec::new();
    contour.read_rows(&fit.pose, &mut read)?;
    let (mut all, mut slopes) = (0.0, 0.0);
    let row = |(reading, derivative): (Reading, Vector6<f64>)| {
        let (clean, weight) = (odds.clean_probability(&reading), odds.weight(&reading));
        all += weight;
        // The weight falls as the piece's chance to be clean does.
        slopes += weight - clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.misfit / sigma).powi(2);
        Row { reading, derivative, weight, held: weight, region }
    };
    let mut rows: Vec<Row> = read.into_iter().map(row).collect();
    // Of a region elsewhere as many pieces come into reach as leave it: it holds nothing.
    let steepness = (slopes / all).clamp(0.0, 1.0);
    rows.iter_mut().for_each(|row| row.held *= steepness);
    Some(rows)
}

/// What straight runs add to the scatter of the gradient: all pieces of one are off alike.
///
/// A mask's edge along the pixels' grid lies anywhere within a pixel, as the side of a polygon does within a click's
/// error: the deviation of the contour's points, not that of the pieces, over which a staircase averages out. The
/// steps of a stair take turns, so that a run counts as much as it makes up of the edge that it lies on.
fn runs_scatter(regions: &[Vec<Row>]) -> Matrix6<f64> {
    let rows = || regions.iter().flatten();
    let points = rows().map(|row| (row.reading.distance.powi(2) + row.reading.spread) * row.weight);
    let variance = points.sum::<f64>() / rows().map(|row| row.weight).sum::<f64>();
    let mut scatter = Matrix6::zeros();
    for edge in regions.iter().flat_map(|rows| rows.chunk_by(|a, b| a.reading.edge == b.reading.edge)) {
        let alike = |a: &Row, b: &Row| a.reading.run.is_some() && a.reading.run == b.reading.run;
        for run in edge.chunk_by(alike).filter(|run| run.len() > 1) {
            let pull: Vector6<f64> = run.iter().map(|row| row.derivative * row.weight).sum();
            scatter.ger(variance * run.len() as f64 / edge.len() as f64, &pull, &pull, 1.0);
        }
    }
    scatter
}
