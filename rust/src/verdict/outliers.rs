//! Which regions belong to a pose: the odds of each one's indicator (`docs/math.md`, eq. 11.8).

use crate::contour::fit::{ContourFit, MOSTLY};
use crate::contour::readings::Reading;

/// Share of a contour that lies on the projected boundary of another region by chance: it crosses that here and there.
const BY_CHANCE: f64 = 0.06;

/// Share, of a region that belongs to the pose, below which nothing counts as found: twice what chance gives.
const LEAST_OWN: f64 = 2.0 * BY_CHANCE;

/// Half a pixel: as far as the edge of a binary mask lies from the true one. What is nearer is off by no more than masks are.
const HALF_A_PIXEL: f64 = 0.5;

/// Natural logarithm of the odds that a region belongs to the pose, for each region; infinite for a region alone.
///
/// Of `m` pieces that vary independently a share `q` is clean. Of a region elsewhere each is by chance, with `BY_CHANCE`; of
/// one that belongs to the pose with half the share that the cleanest of the others has: it may be disturbed so much more.
pub fn log_odds(fit: &ContourFit) -> Vec<f64> {
    let shares = fit.clean_shares();
    let all: usize = fit.regions().map(|(_, readings)| readings.len()).sum();
    let independent = fit.independent() / all.max(1) as f64;
    let odds = |(region, pieces): (usize, usize)| {
        let others = (0..shares.len()).filter(|&other| other != region).map(|other| shares[other]);
        let Some(own) = others.reduce(f64::max).map(|cleanest| MOSTLY * cleanest) else { return f64::INFINITY };
        // Where nothing is found, nothing is known of what belongs together.
        let own = if own < LEAST_OWN { BY_CHANCE } else { own };
        let [clean, disturbed] = [own / BY_CHANCE, (1.0 - own) / (1.0 - BY_CHANCE)].map(f64::ln);
        independent * pieces as f64 * (shares[region] * clean + (1.0 - shares[region]) * disturbed)
    };
    fit.regions().map(|(region, readings)| odds((region, readings.len()))).collect()
}

/// The regions of whose contours half more is off than of the cleanest of the others: what disturbs these does not explain it. What
/// lies within half a pixel is not off, however much closer other regions fit.
pub fn contradicted(fit: &ContourFit) -> Vec<bool> {
    let near = |readings: &[Reading]| readings.iter().filter(|reading| reading.misfit < HALF_A_PIXEL).count() as f64;
    let shares = fit.clean_shares().into_iter().zip(fit.regions());
    let shares: Vec<f64> =
        shares.map(|(clean, (_, readings))| clean.max(near(readings) / readings.len().max(1) as f64)).collect();
    let cleanest = |region: usize| {
        let others = (0..shares.len()).filter(|&other| other != region).map(|other| shares[other]);
        others.reduce(f64::max).unwrap_or(0.0)
    };
    (0..shares.len()).map(|region| shares[region] + MOSTLY < cleanest(region)).collect()
}

/// Probability that the label of a sample is wrong: of a region that belongs to the pose, by far too many, and of one elsewhere.
const MISLABELED: f64 = 0.1;
const ELSEWHERE: f64 = 0.5;

/// Whether a share of wrong labels is likelier of a region elsewhere than of one that belongs to the pose.
pub fn contradicts(wrong: f64) -> bool {
    let (label, right) = (ELSEWHERE / MISLABELED, (1.0 - ELSEWHERE) / (1.0 - MISLABELED));
    wrong * label.ln() + (1.0 - wrong) * right.ln() > 0.0
}
