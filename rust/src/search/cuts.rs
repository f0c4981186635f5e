//! World regions clipped by half planes, as starts where the image's border cuts the observed one (`docs/math.md`, section 14).

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::geometry::clipping::intersection;
use crate::geometry::rings::PlaneRings;
use crate::region::WorldRegion;

/// Directions from which a world region is cut, over a full turn, and the shares that are cut off it, to start from:
/// conventions.
const CUT_DIRECTIONS: usize = 12;
const CUT_SHARES: [f64; 3] = [0.15, 0.3, 0.45];

/// Halvings of the range in which the line lies that cuts off a share: far finer than the shares are apart.
const CUT_HALVINGS: usize = 12;

/// A world region cut by straight lines from all sides: what a border that is straight in the image may leave of it.
pub fn cut_worlds(world: &WorldRegion, budget: &Budget) -> Vec<WorldRegion> {
    let outline = world.outline();
    let (lower, upper) = outline.bounds();
    let (middle, reach) = ((lower + upper) / 2.0, (upper - lower).norm());
    let mut cut = Vec::with_capacity(CUT_DIRECTIONS * CUT_SHARES.len());
    for k in 0..CUT_DIRECTIONS {
        let (sine, cosine) = (std::f64::consts::TAU * k as f64 / CUT_DIRECTIONS as f64).sin_cos();
        let (along, across) = (Vector2::new(cosine, sine), Vector2::new(-sine, cosine));
        let kept = |offset: f64| {
            let corner = |x: f64, y: f64| middle + along * x + across * y;
            let half = [(-reach, -reach), (offset, -reach), (offset, reach), (-reach, reach)];
            let half = vec![half.map(|(x, y)| corner(x, y)).to_vec()];
            PlaneRings::of_simple(intersection(outline.rings(), &half, budget).rings)
        };
        for share in CUT_SHARES {
            let (mut low, mut high) = (-reach, reach);
            for _ in 0..CUT_HALVINGS {
                let offset = (low + high) / 2.0;
                let much = kept(offset).area() > (1.0 - share) * outline.area();
                (low, high) = if much { (low, offset) } else { (offset, high) };
            }
            cut.push(WorldRegion::from_outline(world.frame().clone(), kept(high)));
        }
    }
    cut
}
