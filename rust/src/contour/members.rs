//! Posterior odds that each region is an inlier of a pose (`docs/math.md`, eq. 11.8).

use super::fit::ContourFit;
use super::readings::Reading;
use crate::noise::contamination::MAJORITY;

/// Share of a contour that lies on the projected boundary of another region by chance: it crosses that here and there.
const BY_CHANCE: f64 = 0.06;

/// Clean share of an inlier below which it is not distinguished from chance: twice the latter.
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
    let cleanest = greatest_of_others(&shares);
    let odds = |(region, pieces): (usize, usize)| {
        let Some(own) = cleanest[region].map(|cleanest| MAJORITY * cleanest) else { return f64::INFINITY };
        // Where no region is found, the odds are even.
        let own = if own < LEAST_OWN { BY_CHANCE } else { own };
        let [clean, disturbed] = [own / BY_CHANCE, (1.0 - own) / (1.0 - BY_CHANCE)].map(f64::ln);
        independent * pieces as f64 * (shares[region] * clean + (1.0 - shares[region]) * disturbed)
    };
    fit.regions().map(|(region, readings)| odds((region, readings.len()))).collect()
}

/// The regions whose contours are disturbed by half more than that of the cleanest of the others, which its disturbance does not
/// explain. Pieces within half a pixel count as clean, however much closer other regions fit.
pub fn contradicted(fit: &ContourFit) -> Vec<bool> {
    let near =
        |readings: &[Reading]| readings.iter().filter(|reading| reading.robust_distance < HALF_A_PIXEL).count() as f64;
    let shares = fit.clean_shares().into_iter().zip(fit.regions());
    let shares: Vec<f64> =
        shares.map(|(clean, (_, readings))| clean.max(near(readings) / readings.len().max(1) as f64)).collect();
    let cleanest = greatest_of_others(&shares);
    shares.iter().zip(cleanest).map(|(share, cleanest)| share + MAJORITY < cleanest.unwrap_or(0.0)).collect()
}

/// The greatest of all numbers but each; `None` of one alone.
fn greatest_of_others(numbers: &[f64]) -> Vec<Option<f64>> {
    let greater = |most: Option<f64>, number: f64| Some(most.map_or(number, |most| most.max(number)));
    let mut behind = vec![None; numbers.len()];
    for place in (1..numbers.len()).rev() {
        behind[place - 1] = greater(behind[place], numbers[place]);
    }
    let mut before = None;
    let with_behind = |(&number, behind): (&f64, Option<f64>)| {
        let others = behind.map_or(before, |behind| greater(before, behind));
        before = greater(before, number);
        others
    };
    numbers.iter().zip(behind).map(with_behind).collect()
}

/// The least logarithm of the odds that a region is where the pose shows it, and not near by chance, over all regions.
///
/// Of `m` pieces that vary independently a share `q` is clean; by chance each lies as near with `BY_CHANCE` of a scatter of one pixel,
/// and the more the more the clean pieces scatter.
pub fn least_evidence(fit: &ContourFit) -> f64 {
    let chance = (BY_CHANCE * fit.mixture.sigma).min(0.5);
    let all: usize = fit.regions().map(|(_, readings)| readings.len()).sum();
    let independent = fit.independent() / all.max(1) as f64;
    let gain = |share: f64, by_chance: f64| if share > 0.0 { share * (share / by_chance).ln() } else { 0.0 };
    let evidence = |(share, (_, readings)): (f64, (usize, &[Reading]))| match share > chance {
        true => independent * readings.len() as f64 * (gain(share, chance) + gain(1.0 - share, 1.0 - chance)),
        false => 0.0,
    };
    fit.clean_shares().into_iter().zip(fit.regions()).map(evidence).fold(f64::INFINITY, f64::min)
}
