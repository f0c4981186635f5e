//! Expectation propagation (Minka 2001): the normal distribution of a pose that samples on their sides of a contour
//! leave possible (`docs/math.md`, eq. 17.5 to 17.7).

use nalgebra::Vector6;

use super::ends::PLACES;
use super::kinds::KINDS;
use super::outline::{Outline, View};
use super::readings::{Edge, Sight};
use super::trust::{Label, Trust};
use crate::effort;
use crate::math::gaussian::{Gaussian, Normal};
use crate::math::normal::{cumulative, density};

/// Sweeps over all sites at most.
pub(super) const SWEEPS: usize = 6;

/// What a sweep counts as for each site, in edges that are looked at: the places where its label is asked for each kind of stretch,
/// about eight of which take the time of an edge.
pub(super) const EDGES_OF_SWEEP: usize = PLACES * PLACES * KINDS / 8;

/// A sweep that moves the mean by less than this many of its standard deviations, in all directions together, is the
/// last.
const SETTLED: f64 = 0.05;

/// How far an evidence may be above that of certain labels, as a logarithm, since it is approximate: a convention. Where factors run away
/// it is off by hundreds and more.
const APPROXIMATE: f64 = 1.0;

/// Where the last sweep still moves the mean by more than this many of them, there is no such distribution: a convention.
const LOST: f64 = 0.5;

/// A sample: its margin on the right side of the contour is `margin + slope . x + outwards (g + (1 - along) d + along e)`
/// pixels, linear in the left increment `x`, the growth `g` of its contour and the offsets `d` and `e` of the ends of the
/// stretch that it lies beside, with those of their corners.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    /// Derivative of the margin by the increment.
    pub slope: Vector6<f64>,
    /// The same by growth, and by the offset where it lies.
    pub outwards: f64,
    /// Where it lies along its stretch, 0 at the start and 1 at the end.
    pub along: f64,
    /// The margin at zero, pixels.
    pub margin: f64,
    /// Variance of the margin about that line, squared pixels, which adds to the blur's.
    pub bent: f64,
    /// Whether it is nearest to an edge of the region's own.
    pub edge: Edge,
    /// How far labels are to be trusted.
    pub trust: Trust,
    /// The normal factor of the margin that stands for the label of a sample by itself.
    pub factor: Factor,
}

/// Natural parameters of a normal factor of a margin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Factor {
    /// Inverse variance.
    pub precision: f64,
    /// The same times the mean.
    pub pull: f64,
}

/// What a normal distribution of a margin shows of a label.
struct Tilted {
    /// Logarithm of the label's probability.
    log_probability: f64,
    /// Its first derivative by the mean, and minus its second.
    first: f64,
    second: f64,
}

impl Tilted {
    /// The label of a margin with a normal distribution (`docs/math.md`, eq. 17.6).
    fn new(mean: f64, variance: f64, trust: &Trust, edge: Edge) -> Self {
        let (mut probability, mut slope, mut bend) = (trust.bounds(edge).0, 0.0, 0.0);
        for (weight, blur) in trust.parts(edge).into_iter().filter(|(weight, _)| *weight > 0.0) {
            let width = (blur * blur + variance).sqrt();
            let u = mean / width;
            let height = weight * density(u) / width;
            probability += weight * cumulative(u);
            slope += height;
            bend += height * u / width;
        }
        let first = slope / probability;
        Self { log_probability: probability.ln(), first, second: first * first + bend / probability }
    }
}

impl AsRef<Site> for Site {
    fn as_ref(&self) -> &Site {
        self
    }
}

impl AsMut<Site> for Site {
    fn as_mut(&mut self) -> &mut Site {
        self
    }
}

impl Site {
    /// A sample where it is seen, whose factor is not known yet.
    pub fn new(sight: &Sight, trust: Trust) -> Self {
        let Sight { margin, slope, outwards, along, edge, .. } = *sight;
        Self { slope, outwards, along, margin, bent: 0.0, edge, trust, factor: Factor::default() }
    }

    /// The same with the derivative by the increment and the margin that it has from there.
    pub fn with_line(self, slope: &Vector6<f64>, margin: f64) -> Self {
        Self { slope: *slope, margin, ..self }
    }

    /// The site with the factor of another one.
    pub fn with_factor_of(self, other: &Self) -> Self {
        Self { factor: other.factor, ..self }
    }

    /// Whether it is nearest to an end of its stretch, where the next one has its say.
    pub fn is_at_corner(&self) -> bool {
        self.along <= 0.0 || self.along >= 1.0
    }

    /// Mean and variance of the margin under a belief.
    pub fn margin_under(&self, belief: &Normal) -> (f64, f64) {
        (self.margin + self.slope.dot(&belief.mean), self.slope.dot(&(belief.covariance * self.slope)))
    }

    /// What the label shows under a belief.
    pub fn label(&self, belief: &Normal) -> Label {
        let (mean, variance) = self.margin_under(belief);
        self.trust.label(self.edge, mean, variance + self.bent)
    }

    /// Moment matching of the factor, in place in the belief.
    fn update(&mut self, belief: &mut Normal) {
        let spread = belief.covariance * self.slope;
        let (mean, variance) = (self.margin + self.slope.dot(&belief.mean), self.slope.dot(&spread));
        let before = self.factor;
        let Some((mean_without, variance_without)) = before.left_out(mean, variance) else { return };
        let tilted = Tilted::new(mean_without, variance_without + self.bent, &self.trust, self.edge);
        let left = 1.0 - variance_without * tilted.second;
        // A sample that contradicts the others would make the belief wider than they leave it: it says nothing.
        let after = match tilted.second > 0.0 {
            true => {
                Factor { precision: tilted.second / left, pull: (tilted.first + mean_without * tilted.second) / left }
            }
            false => Factor::default(),
        };
        let (more, farther) = (after.precision - before.precision, after.pull - before.pull);
        let held = 1.0 + more * variance;
        // The comparison fails for what is not finite, too.
        if !(held > f64::EPSILON && held.is_finite() && farther.is_finite()) {
            return;
        }
        belief.covariance.ger(-more / held, &spread, &spread, 1.0);
        belief.mean += spread * ((farther - more * mean) / held);
        self.factor = after;
    }

    /// The site's factor, without what makes it as large as the label's probability.
    fn factor_into(&self, factor: &mut Gaussian) {
        let Factor { precision, pull } = self.factor;
        factor.information.ger(precision, &self.slope, &self.slope, 1.0);
        factor.information_vector += self.slope * (pull - precision * self.margin);
        factor.offset += self.margin * (pull - 0.5 * precision * self.margin);
    }

    /// Logarithm of what the factor is multiplied by so that it integrates, without the site, to the label's
    /// probability.
    fn log_scale(&self, belief: &Normal) -> f64 {
        let (mean, variance) = self.margin_under(belief);
        let Some((mean_without, variance_without)) = self.factor.left_out(mean, variance) else { return 0.0 };
        let label = Tilted::new(mean_without, variance_without + self.bent, &self.trust, self.edge).log_probability;
        let potential = |mean: f64, variance: f64| 0.5 * (variance.ln() + mean * mean / variance);
        label + potential(mean_without, variance_without) - potential(mean, variance)
    }
}

impl Factor {
    /// Mean and variance of a margin without the factor; `None` where nothing is left.
    pub(super) fn left_out(&self, mean: f64, variance: f64) -> Option<(f64, f64)> {
        let left = 1.0 - variance * self.precision;
        (left > f64::EPSILON).then(|| ((mean - variance * self.pull) / left, variance / left))
    }
}

/// What samples and other factors leave possible.
#[derive(Debug, Clone)]
pub struct Propagated {
    /// Of the increment.
    pub belief: Normal,
    /// Of the increment and what each contour is off; none of samples by themselves.
    pub views: Vec<View>,
    /// Logarithm of the evidence; of no worth where sweeps did not settle.
    pub log_evidence: f64,
    /// Whether the last sweep moved the mean by little, and the places of all ends were found.
    pub is_settled: bool,
}

/// What samples beside contours that are off, and other factors, leave possible; stretches keep their
/// factors, from which the next call goes on. In the first sweep a `guard` stands in for the factors that stretches do not
/// have yet: without it the first of them would meet a belief so wide that they contradict one another. `None` where a
/// direction is left free, or no distribution is found.
///
/// What contours are off meets in the increment alone, and stretches of one contour in that and its growth: each says
/// something of these, a message, and without its own the product of all messages is what the others say.
pub fn propagated<S: AsRef<Site>>(
    others: &Gaussian,
    guard: &Gaussian,
    sites: &[S],
    outlines: &mut [Outline],
) -> Option<Propagated> {
    outlines.iter_mut().for_each(|outline| outline.find_ends(sites));
    let mut messages: Vec<Gaussian> = outlines.iter().map(Outline::message).collect();
    let sum = |messages: &[Gaussian]| messages.iter().fold(*others, |sum, message| sum + *message);
    let mut all = sum(&messages) + *guard;
    let mut belief = all.normalize()?.0;
    outlines.iter_mut().for_each(|outline| outline.take_labels(sites, &belief.covariance));
    let mut moved = f64::INFINITY;
    for _ in 0..SWEEPS {
        count_sweep(sites.len())?;
        let before = belief.mean;
        for (outline, message) in outlines.iter_mut().zip(&mut messages) {
            let rest = all - *message;
            *message = outline.sweep(&rest)?;
            all = rest + *message;
        }
        // Anew from all messages: differences' rounding errors add up.
        all = sum(&messages);
        belief = all.normalize()?.0;
        moved = far(&belief, &before)?;
        if moved < SETTLED {
            break;
        }
    }
    let (belief, integral) = all.normalize()?;
    let views = outlines.iter_mut().zip(&messages).map(|(outline, message)| outline.view(&(all - *message)));
    let views: Vec<View> = views.collect::<Option<_>>()?;
    let log_evidence = integral + views.iter().map(|view| view.log_probability - integral).sum::<f64>();
    // No labels are likelier than certain ones: where factors have run away, the evidence may be any number.
    let (_, of_certain) = others.normalize()?;
    if log_evidence > of_certain + APPROXIMATE {
        return None;
    }
    let is_settled = moved < LOST && views.iter().all(|view| view.is_settled);
    Some(Propagated { belief, views, log_evidence, is_settled })
}

/// The same of samples by themselves, each beside a part of a contour of its own.
pub fn propagated_apart<S: AsMut<Site> + AsRef<Site>>(
    others: &Gaussian,
    guard: &Gaussian,
    sites: &mut [S],
) -> Option<Propagated> {
    let product = |sites: &[S]| {
        let mut all = *others;
        sites.iter().for_each(|site| site.as_ref().factor_into(&mut all));
        all
    };
    let mut belief = (product(sites) + *guard).normalize()?.0;
    let mut moved = f64::INFINITY;
    for _ in 0..SWEEPS {
        count_sweep(sites.len())?;
        let before = belief.mean;
        sites.iter_mut().for_each(|site| site.as_mut().update(&mut belief));
        belief = product(sites).normalize()?.0;
        moved = far(&belief, &before)?;
        if moved < SETTLED {
            break;
        }
    }
    let (belief, integral) = product(sites).normalize()?;
    let log_evidence = integral + sites.iter().map(|site| site.as_ref().log_scale(&belief)).sum::<f64>();
    Some(Propagated { belief, views: Vec::new(), log_evidence, is_settled: moved < LOST })
}

/// Counts a sweep over so many sites; `None` where nobody waits for it any more.
fn count_sweep(sites: usize) -> Option<()> {
    effort::spend(EDGES_OF_SWEEP * sites);
    (!effort::is_stopped()).then_some(())
}

/// How far a mean has moved, in standard deviations; `None` where a direction is left free.
fn far(belief: &Normal, before: &Vector6<f64>) -> Option<f64> {
    let way = belief.mean - before;
    Some(way.dot(&belief.covariance.cholesky()?.solve(&way)).sqrt())
}
