//! Noise learning: expectation-maximization of the label models by the posterior of expectation propagation (`docs/math.md`, section 17).

use super::active_set::{ActiveSet, segment_states};
use super::ep::{ContourMoments, EpPosterior};
use super::label_model::{LabelModel, LabelPosterior, LabelStats};
use crate::math::gaussian::Normal;
use crate::noise::contamination::{LEAST_RATIO, SIZE_RATIO};

impl ActiveSet<'_> {
    /// Updates the noise of labels and segments by a posterior, and keeps the log probability that this gives each label.
    pub(super) fn learn_noise(&mut self, posterior: &EpPosterior) {
        let stats = self.label_stats(&posterior.increment, &posterior.contours);
        self.models.iter_mut().zip(&stats).for_each(|(model, stats)| *model = model.maximized(stats));
        if self.by_segment {
            self.learn_outlier_sigmas(&posterior.contours);
            self.keep_log_probabilities(&posterior.contours);
        }
        self.set_models();
    }

    /// Statistics of all labels of each region under a posterior of the increment and of the contours.
    fn label_stats(&self, increment: &Normal, contours: &[ContourMoments]) -> Vec<LabelStats> {
        let mut stats = self.inactive_stats.clone();
        if !self.by_segment {
            self.active.iter().for_each(|sample| stats[sample.region].add(&sample.site.posterior(increment), true));
        }
        for (contour, moments) in self.contours.iter().zip(contours) {
            for (segment, moments) in contour.segments().zip(&moments.segments) {
                for (disturbed, label) in segment.label_posteriors(moments) {
                    stats[contour.region].add(&LabelPosterior { disturbed, ..label }, true);
                }
            }
        }
        stats
    }

    /// Sets the outlier sigma of each region to the root mean square offset of its disturbed segments and of one as far off as expected.
    fn learn_outlier_sigmas(&mut self, contours: &[ContourMoments]) {
        let mut sums: Vec<(f64, f64)> =
            self.regions.iter().map(|sampled| (1.0, (SIZE_RATIO * sampled.size()).powi(2))).collect();
        for (contour, moments) in self.contours.iter().zip(contours) {
            let (count, squares) = &mut sums[contour.region];
            for (segment, [_, disturbed]) in contour.segments().zip(&moments.segments) {
                let [_, probability] = segment.site.probabilities;
                *count += probability;
                *squares += probability * disturbed.mean_square;
            }
        }
        for (model, (count, squares)) in self.models.iter_mut().zip(sums) {
            model.outlier_sigma = (squares / count).sqrt().max(LEAST_RATIO * model.sigma.max(self.corner_sigma));
        }
    }

    /// Keeps the log probability of each label beside a segment.
    fn keep_log_probabilities(&mut self, contours: &[ContourMoments]) {
        for (contour, moments) in self.contours.iter().zip(contours) {
            for (segment, moments) in contour.segments().zip(&moments.segments) {
                for (&member, (_, label)) in segment.members.iter().zip(segment.label_posteriors(moments)) {
                    self.active[member].log_probability = label.log_probability;
                }
            }
        }
    }

    /// Sets the noise of active samples and segments to that of their region.
    fn set_models(&mut self) {
        let models: Vec<LabelModel> = (0..self.regions.len()).map(|region| self.sample_model(region)).collect();
        self.active.iter_mut().for_each(|sample| sample.site.model = models[sample.region]);
        for contour in &mut self.contours {
            let states = segment_states(&self.models[contour.region]);
            contour.segments_mut().for_each(|segment| segment.states = states);
        }
    }
}
