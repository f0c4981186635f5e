//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.9 to 11.11).

use nalgebra::{Matrix6, Vector6};

use super::correlation::long_run;
use super::fit::ContourFit;
use super::readings::{Contour, Reading};
use crate::equations::information::{Information, free, honest};

/// The mean slope over the mean weight at least: below it, the contour does not hold the pose at this scale.
const LEAST_SLOPE: f64 = 0.1;

/// Parameters of a pose.
const PARAMETERS: f64 = 6.0;

/// A piece of a contour as the covariance needs it.
struct Row {
    reading: Reading,
    derivative: Vector6<f64>,
    /// Weight of its distance.
    weight: f64,
    /// Derivative of the distance times its weight.
    slope: f64,
    /// Where it lies: region, edge of the boundary, straight run of the contour.
    place: (usize, u32, Option<usize>),
}

/// Covariance of the left increment `[omega (rad), tau (meters)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit) -> Matrix6<f64> {
    let Some((rows, counts)) = rows_of(contours, fit) else { return free() };
    let held: f64 = rows.iter().map(|row| row.weight).sum();
    let steepness = (rows.iter().map(|row| row.slope).sum::<f64>() / held).max(LEAST_SLOPE);
    let pulls: Vec<f64> = rows.iter().map(|row| row.reading.distance * row.weight).collect();
    let correlation = long_run(&pulls, &counts);
    let (mut information, mut single) = (Matrix6::zeros(), Matrix6::zeros());
    for (row, pull) in rows.iter().zip(&pulls) {
        information.ger(row.weight * steepness, &row.derivative, &row.derivative, 1.0);
        single.ger(pull * pull, &row.derivative, &row.derivative, 1.0);
    }
    let Some(information) = Information::holding(&information) else { return free() };
    let inverse = information.covariance();
    let runs = runs_scatter(&rows);
    // A run that is off as a whole is one measurement, whatever the number of its pieces.
    let alike = (inverse * runs).trace() / (inverse * single).trace().max(f64::MIN_POSITIVE);
    // Six parameters leave so much less of the distances that vary independently.
    let independent = (held / correlation.max(alike).max(1.0)).max(PARAMETERS + 1.0);
    honest(&(information.covariance_with(&(single * correlation + runs)) * (independent / (independent - PARAMETERS))))
}

fn rows_of(contours: &[Contour], fit: &ContourFit) -> Option<(Vec<Row>, Vec<usize>)> {
    let (mut rows, mut counts) = (Vec::new(), Vec::new());
    let mixture = &fit.mixture;
    let ratio = (mixture.sigma / mixture.wide).powi(2);
    for (region, contour) in contours.iter().enumerate() {
        let mut read = Vec::new();
        contour.read_rows(&fit.pose, &mut read)?;
        counts.push(read.len());
        let odds = mixture.odds(region);
        rows.extend(read.into_iter().zip(contour.runs()).map(|((reading, derivative), run)| {
            let (clean, weight) = (odds.clean_probability(&reading), odds.weight(&reading));
            // The weight falls as the piece's chance to be clean does.
            let fall = clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.misfit / mixture.sigma).powi(2);
            Row { reading, derivative, weight, slope: weight - fall, place: (region, reading.edge, run) }
        }));
    }
    Some((rows, counts))
}

/// What straight runs add to the scatter of the gradient: all pieces of one are off alike.
///
/// A mask's edge along the pixels' grid lies anywhere within a pixel, as the side of a polygon does within a click's
/// error: the deviation of the contour's points, not that of the pieces, over which a staircase averages out. The
/// steps of a stair take turns, so that a run counts as much as it makes up of the edge that it lies on.
fn runs_scatter(rows: &[Row]) -> Matrix6<f64> {
    let points = rows.iter().map(|row| (row.reading.distance.powi(2) + row.reading.spread) * row.weight);
    let variance = points.sum::<f64>() / rows.iter().map(|row| row.weight).sum::<f64>();
    let mut scatter = Matrix6::zeros();
    for edge in rows.chunk_by(|a, b| (a.place.0, a.place.1) == (b.place.0, b.place.1)) {
        for run in edge.chunk_by(|a, b| a.place.2.is_some() && a.place.2 == b.place.2).filter(|run| run.len() > 1) {
            let pull: Vector6<f64> = run.iter().map(|row| row.derivative * row.weight).sum();
            scatter.ger(variance * run.len() as f64 / edge.len() as f64, &pull, &pull, 1.0);
        }
    }
    scatter
}
