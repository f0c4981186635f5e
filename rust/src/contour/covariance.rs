//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.8 to 11.10).

use nalgebra::{Matrix6, Vector6};

use crate::contour::correlation::long_run;
use crate::contour::distance::{Contour, ContourFit, Row, Rows};
use crate::contour::loss::{slope, weight};

/// The mean slope over the mean weight at least: below it, the contour does not hold the pose at this scale.
const LEAST_SLOPE: f64 = 0.1;

/// Parameters of a pose.
const PARAMETERS: f64 = 6.0;

/// Covariance of the left increment `[omega (rad), tau (metres)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit) -> Matrix6<f64> {
    let free = Matrix6::from_element(f64::INFINITY);
    let Some(found) = Rows::at(contours, &fit.pose, None) else { return free };
    let rows = &found.rows;
    let scale = fit.mixture.sigma;
    let weights: Vec<f64> = rows.iter().map(|row| weight(row.misfit, scale)).collect();
    let held: f64 = weights.iter().sum();
    let steepness = (rows.iter().map(|row| slope(row.misfit, scale)).sum::<f64>() / held).max(LEAST_SLOPE);
    let pulls: Vec<f64> = rows.iter().zip(&weights).map(|(row, weight)| row.distance * weight).collect();
    let correlation = long_run(&pulls);
    let square =
        |sum: Matrix6<f64>, (row, factor): (&Row, f64)| sum + row.derivative * row.derivative.transpose() * factor;
    let information = rows.iter().zip(weights.iter().map(|w| w * steepness)).fold(Matrix6::zeros(), square);
    let scatter = rows.iter().zip(pulls.iter().map(|pull| pull * pull * correlation)).fold(Matrix6::zeros(), square);
    let Some(inverse) = information.cholesky().map(|cholesky| cholesky.inverse()) else { return free };
    // Six parameters leave so much less of the distances that vary independently.
    let independent = held / correlation.max(1.0);
    let left = independent / (independent - PARAMETERS).max(1.0);
    inverse * (scatter + runs_scatter(contours, &found, &weights)) * inverse * left
}

/// What straight runs add to the scatter of the gradient: all pieces of one are off alike.
///
/// A mask's edge along the pixels' grid lies anywhere within a pixel, as the side of a polygon does within a click's
/// error: the deviation of the contour's points, not that of the pieces, over which a staircase averages out. The
/// steps of a stair take turns, so that a run counts as much as it makes up of the edge that it lies on.
fn runs_scatter(contours: &[Contour], Rows { rows, nearest }: &Rows, weights: &[f64]) -> Matrix6<f64> {
    let points = rows.iter().zip(weights).map(|(row, weight)| (row.distance.powi(2) + row.spread) * weight);
    let variance = points.sum::<f64>() / weights.iter().sum::<f64>();
    let places = contours.iter().zip(nearest).enumerate().flat_map(|(region, (contour, edges))| {
        contour.runs().zip(edges).map(move |(run, edge)| ((region, *edge), run))
    });
    let pulls = rows.iter().zip(weights).map(|(row, &weight)| row.derivative * weight);
    let placed: Vec<_> = places.zip(pulls).collect();
    let mut scatter = Matrix6::zeros();
    for edge in placed.chunk_by(|((a, _), _), ((b, _), _)| a == b) {
        for run in edge.chunk_by(|((_, a), _), ((_, b), _)| a.is_some() && a == b).filter(|run| run.len() > 1) {
            let pull: Vector6<f64> = run.iter().map(|(_, pull)| pull).sum();
            scatter += pull * pull.transpose() * (variance * run.len() as f64 / edge.len() as f64);
        }
    }
    scatter
}
