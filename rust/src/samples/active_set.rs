//! The active set: samples whose margin lies within 6 sigma of zero, linearized and grouped by contour segment; the labels of all others
//! are certain (`docs/math.md`, section 17).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix6, Vector6};

use super::chain::SegmentRing;
use super::ep::ContourFactor;
use super::label_model::{LabelModel, LabelStats, NoiseLevels};
use super::margin::{EdgeKind, MAX_SIGMAS, ProjectedSample, SampledRegion};
use super::probit_site::LabelSite;
use super::segment::{ContourSegment, STATES, SegmentSite, SegmentState};
use crate::budget::Budget;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::{Gaussian, Normal};
use crate::math::normal::OUTLIER_SIGMAS;
use crate::noise::contamination::{LEAST_RATIO, SIZE_RATIO};

/// Distance of sigma points from the mean in standard deviations, the square root of the dimension: their covariance is the
/// distribution's.
const SIGMA_POINTS: f64 = 2.449_489_742_783_178;

/// A sample of the active set.
#[derive(Clone)]
pub(super) struct ActiveSample {
    pub(super) site: LabelSite,
    /// Index of its region among those with samples.
    pub(super) region: usize,
    /// Number of the sample there.
    number: usize,
    /// Number of the contour segment beside it.
    segment: usize,
    /// Log probability of its label by the last posterior.
    pub(super) log_probability: f64,
}

impl ActiveSample {
    /// Its region and the segment beside it.
    fn place(&self) -> (usize, usize) {
        (self.region, self.segment)
    }
}

impl AsRef<LabelSite> for ActiveSample {
    fn as_ref(&self) -> &LabelSite {
        &self.site
    }
}

impl AsMut<LabelSite> for ActiveSample {
    fn as_mut(&mut self) -> &mut LabelSite {
        &mut self.site
    }
}

/// The active samples of several regions, with the noise of their labels and contours.
#[derive(Clone)]
pub(super) struct ActiveSet<'a> {
    pub(super) regions: &'a [SampledRegion],
    pub(super) budget: &'a Budget,
    /// Every so many-th sample is used.
    stride: usize,
    /// Whether samples share the offsets of contour segments; they are independent otherwise.
    pub(super) by_segment: bool,
    pub(super) active: Vec<ActiveSample>,
    /// The contours beside these; none of independent samples.
    pub(super) contours: Vec<ContourFactor>,
    /// Standard deviation of the contours' dilation, pixels.
    dilation_sigma: f64,
    /// Standard deviation of their corners' offsets along either axis, pixels.
    pub(super) corner_sigma: f64,
    /// Label noise of each region.
    pub(super) models: Vec<LabelModel>,
    /// Statistics of the inactive labels of each region.
    pub(super) inactive_stats: Vec<LabelStats>,
}

impl<'a> ActiveSet<'a> {
    /// Every `stride`-th sample, independent.
    pub(super) fn independent(regions: &'a [SampledRegion], stride: usize, budget: &'a Budget) -> Self {
        Self {
            regions,
            budget,
            stride,
            by_segment: false,
            active: Vec::new(),
            contours: Vec::new(),
            dilation_sigma: 0.0,
            corner_sigma: 0.0,
            models: vec![LabelModel::prior(); regions.len()],
            inactive_stats: Vec::new(),
        }
    }

    /// All samples, which share the offsets of contour segments, with these noise models.
    pub(super) fn by_segment(regions: &'a [SampledRegion], models: Vec<LabelModel>, budget: &'a Budget) -> Self {
        Self { by_segment: true, models, ..Self::independent(regions, 1, budget) }
    }

    /// Selects and linearizes the active samples at a pose, under a distribution of the increment; sites keep their factors.
    pub(super) fn select(&mut self, pose: &Pose, increment: &Normal, noise: NoiseLevels) {
        let last = std::mem::take(&mut self.active);
        let mut last = last.iter().peekable();
        self.set_noise(noise);
        self.inactive_stats = vec![LabelStats::default(); self.regions.len()];
        let mut visible = Vec::new();
        for (region, sampled) in self.regions.iter().enumerate() {
            let model = self.sample_model(region);
            for number in (0..sampled.count()).step_by(self.stride) {
                let before = last.next_if(|sample| (sample.region, sample.number) == (region, number));
                match sampled.project(pose, number, self.budget) {
                    ProjectedSample::Visible(margin) => {
                        let site = LabelSite::new(&margin, model);
                        // The factor is one of the margin, however that is linearized.
                        let site = before.map_or(site, |before| LabelSite { factor: before.site.factor, ..site });
                        let segment = margin.segment;
                        visible.push(ActiveSample { site, region, number, segment, log_probability: 0.0 });
                    }
                    ProjectedSample::Behind { is_correct } => {
                        self.inactive_stats[region].add(&model.posterior_behind(is_correct), !is_correct);
                    }
                }
            }
        }
        self.keep_active(visible, increment, noise.label);
        self.group_by_segment();
    }

    /// Sets the noise of labels and contours.
    fn set_noise(&mut self, noise: NoiseLevels) {
        self.dilation_sigma = noise.dilation;
        self.corner_sigma = if self.by_segment { noise.corner_sigma() } else { 0.0 };
        for (model, sampled) in self.models.iter_mut().zip(self.regions) {
            let outlier_sigma = if self.by_segment { model.outlier_sigma } else { SIZE_RATIO * sampled.size() };
            model.sigma = noise.label;
            model.outlier_sigma = outlier_sigma.max(LEAST_RATIO * noise.label.max(self.corner_sigma));
        }
    }

    /// Label noise of a region's samples apart from the offsets of their segments.
    pub(super) fn sample_model(&self, region: usize) -> LabelModel {
        let model = self.models[region];
        if self.by_segment { LabelModel { contamination: 0.0, ..model } } else { model }
    }

    /// Keeps the samples whose margin is within reach of all noise, and adds the others to the statistics of inactive labels. Outliers
    /// count where a sample beside the same segment is clearly on the wrong side: nothing shows an offset elsewhere.
    fn keep_active(&mut self, visible: Vec<ActiveSample>, increment: &Normal, label_sigma: f64) {
        let increment = Normal { mean: Tangent::zeros(), ..*increment };
        let margin = |sample: &ActiveSample| {
            let (mean, variance) = sample.site.margin_under(&increment);
            (mean, (label_sigma * label_sigma + variance).sqrt())
        };
        let is_wrong = |sample: &&ActiveSample| {
            let (mean, sigma) = margin(sample);
            sample.site.edge == EdgeKind::Own && mean < -OUTLIER_SIGMAS * sigma
        };
        let may_be_outliers = visible.iter().filter(|_| self.by_segment);
        let contradicted: BTreeSet<_> = may_be_outliers.filter(is_wrong).map(ActiveSample::place).collect();
        for sample in visible {
            let (mean, sigma) = margin(&sample);
            let outlier_sigma =
                if contradicted.contains(&sample.place()) { self.models[sample.region].outlier_sigma } else { 0.0 };
            let reach = MAX_SIGMAS * sigma.hypot(outlier_sigma).hypot(self.dilation_sigma).hypot(self.corner_sigma);
            if mean.abs() > reach {
                self.inactive_stats[sample.region].add(&sample.site.posterior(&increment), mean < 0.0);
            } else {
                self.active.push(sample);
            }
        }
    }

    /// Groups the active samples by contour segment; segments keep their sites.
    fn group_by_segment(&mut self) {
        let mut members: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for (index, sample) in self.active.iter().enumerate().filter(|_| self.by_segment) {
            members.entry(sample.region).or_default().entry(sample.segment).or_default().push(index);
        }
        let sites: BTreeMap<_, _> = self.contours.iter().flat_map(sites_of).collect();
        let contour = |(region, mut members): (usize, BTreeMap<usize, Vec<usize>>)| {
            let (sampled, states) = (&self.regions[region], segment_states(&self.models[region]));
            let mut segment = |number: usize| {
                let (normal, length) = (sampled.normal(number), sampled.length(number));
                let beside = members.remove(&number).unwrap_or_default();
                let mut segment = ContourSegment::new(number, normal, length, beside, states);
                sites.get(&(region, number)).into_iter().for_each(|&site| segment.site = site);
                segment
            };
            let rings = sampled.rings().iter();
            let rings = rings.map(|numbers| SegmentRing::new(self.corner_sigma, numbers.clone().map(&mut segment)));
            let has_samples = |ring: &SegmentRing| ring.segments.iter().any(|segment| !segment.members.is_empty());
            ContourFactor { region, dilation_sigma: self.dilation_sigma, rings: rings.filter(has_samples).collect() }
        };
        self.contours = members.into_iter().map(contour).collect();
    }

    /// Linearizes the active samples at a pose, to first order; those behind the camera keep their last linearization.
    pub(super) fn linearize(&mut self, pose: &Pose) {
        for sample in &mut self.active {
            if let ProjectedSample::Visible(margin) =
                self.regions[sample.region].project(pose, sample.number, self.budget)
            {
                let site = sample.site.with_line(&margin.gradient, margin.value);
                sample.site = LabelSite { edge: margin.edge, ..site };
            }
        }
    }

    /// Linearizes the active samples over a whole distribution of the increment from a pose: statistical linear regression at its sigma
    /// points (`docs/math.md`, eq. 17.9).
    pub(super) fn linearize_statistically(&mut self, pose: &Pose, increment: &Normal) {
        let Some(root) = increment.covariance.cholesky().map(|root| root.unpack()) else { return };
        let points: [Tangent; 6] = std::array::from_fn(|axis| root.column(axis) * SIGMA_POINTS);
        let poses = points.map(|point| [point, -point].map(|point| pose.retract(&point)));
        let Some(inverse) = root.try_inverse() else { return };
        for sample in &mut self.active {
            let mut margins = [[0.0; 2]; 6];
            let mut is_visible = true;
            for (value, pose) in margins.iter_mut().flatten().zip(poses.iter().flatten()) {
                match self.regions[sample.region].project(pose, sample.number, self.budget) {
                    ProjectedSample::Visible(margin) => *value = margin.value,
                    ProjectedSample::Behind { .. } => is_visible = false,
                }
            }
            if is_visible {
                sample.site = regressed(&sample.site, &margins, &inverse);
            }
        }
    }

    /// Shifts the contours' sites to increments about a pose that lies farther by `increment`.
    pub(super) fn retract(&mut self, increment: &Tangent) {
        self.contours.iter_mut().for_each(|contour| contour.retract(increment));
    }

    /// Message of each region with active samples to the increment, by the region's index in the problem.
    pub(super) fn messages(&self) -> Vec<(usize, Gaussian)> {
        self.contours.iter().map(|contour| (self.regions[contour.region].index(), contour.message())).collect()
    }

    /// Log probability of the inactive labels.
    pub(super) fn inactive_log_probability(&self) -> f64 {
        self.inactive_stats.iter().map(|stats| stats.log_probability).sum()
    }

    /// Log probability of each label, by angle in each region: of active ones by the last posterior, of the others at a pose.
    pub(super) fn log_probabilities(&self, pose: &Pose) -> Vec<f64> {
        let mut active: BTreeMap<_, _> =
            self.active.iter().map(|sample| ((sample.region, sample.number), sample.log_probability)).collect();
        let mut all = Vec::new();
        for (region, sampled) in self.regions.iter().enumerate() {
            let model = self.sample_model(region);
            all.extend(sampled.by_angle().iter().map(|&number| match active.remove(&(region, number)) {
                Some(log_probability) => log_probability,
                None => model.posterior_at(&sampled.project(pose, number, self.budget)).log_probability,
            }));
        }
        all
    }
}

/// Priors of the states of a region's segments.
pub(super) fn segment_states(model: &LabelModel) -> [SegmentState; STATES] {
    let LabelModel { contamination, outlier_sigma, .. } = *model;
    [
        SegmentState { probability: 1.0 - contamination, sigma: 0.0 },
        SegmentState { probability: contamination, sigma: outlier_sigma },
    ]
}

/// The sites of a contour's segments, by region and number.
fn sites_of(contour: &ContourFactor) -> impl Iterator<Item = ((usize, usize), SegmentSite)> {
    contour.segments().map(|segment| ((contour.region, segment.number), segment.site))
}

/// The site with the linear regression of its margins at sigma points, two along each column of the covariance's root, and their variance
/// about it.
fn regressed(site: &LabelSite, margins: &[[f64; 2]; 6], inverse_root: &Matrix6<f64>) -> LabelSite {
    let points = 2.0 * margins.len() as f64;
    let mean = margins.iter().flatten().sum::<f64>() / points;
    let squares = margins.iter().flatten().map(|margin| (margin - mean).powi(2)).sum::<f64>() / points;
    let along = Vector6::from_iterator(margins.iter().map(|[ahead, behind]| (ahead - behind) / (2.0 * SIGMA_POINTS)));
    let linearization_variance = (squares - along.norm_squared()).max(0.0);
    LabelSite { linearization_variance, ..site.with_line(&(inverse_root.transpose() * along), mean) }
}
