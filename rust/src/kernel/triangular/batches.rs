//! Which points share a batch: a grid of steps, and one pass over the image.

use super::grid::{GRID_BITS_OF_MANY, exponent};
use crate::kernel::{Trajectory, Widths};

/// Widths of one batch differ by less than this many octaves, so that the narrowest has few bits less. The
/// classes meet at 1 px, for kernels narrower than a pixel have no slope.
const OCTAVES: i32 = 3;
/// Profiles of one batch differ by about this many octaves: the least keeps some bits beside the tallest.
const TALLEST_TO_LEAST: i32 = 12;
/// As many times lower than the tallest profile of a batch may its profiles be in the mean, so that a step of
/// each is little beside their sum.
const TALLEST_TO_MEAN: f64 = 32.0;
/// Points of one batch, unless their profiles would be too many to number.
pub(super) const BATCH: usize = 512;
/// Points of one batch whose kernels are so wide that their slope needs fractional bits.
const FEW: usize = 8;

/// Where a point stands among the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// Of widths along v.
    class: i32,
    /// Octaves by which its profile is below one of weight and widths 1, about.
    fall: i32,
    pub(super) point: u32,
}

/// Lists the points that have weight so that the points of a batch stand together. Returns whether they are
/// even: whether any of them may be in one batch.
pub(super) fn arrange(trajectory: &Trajectory<'_>, order: &mut Vec<Place>) -> bool {
    let points = 0..trajectory.points.len();
    let (weights, widths) = (trajectory.weights, trajectory.widths);
    order.clear();
    order.extend(points.filter(|&n| weights.is_none_or(|w| w[n] > 0.0)).map(|n| {
        let fall = weights.map_or(0, |w| -exponent(w[n]));
        match widths {
            Widths::Common(_) => Place { class: 0, fall, point: n as u32 },
            Widths::PerPoint(widths) => {
                let [wide, high] = widths[n].map(exponent);
                Place { class: high.div_euclid(OCTAVES), fall: fall + wide + 2 * high, point: n as u32 }
            }
        }
    }));
    let tallest = order.iter().min_by_key(|p| p.fall).copied();
    // Mostly they make one batch as they are, or one after the other.
    let even = tallest.is_none_or(|tallest| {
        let mut sum = 0.0;
        let fit = order.iter().all(|p| {
            sum += share(p, &tallest);
            fits(p, &tallest)
        });
        fit && order.len() as f64 <= TALLEST_TO_MEAN * sum
    });
    if !even {
        order.sort_unstable();
    }
    even
}

/// Whether a point may be in one batch with the tallest of it.
fn fits(place: &Place, tallest: &Place) -> bool {
    place.class == tallest.class && place.fall <= tallest.fall + TALLEST_TO_LEAST
}

/// Its profile in units of the tallest.
fn share(place: &Place, tallest: &Place) -> f64 {
    1.0 / f64::from(1 << (place.fall - tallest.fall).clamp(0, TALLEST_TO_LEAST))
}

/// How many of the points make a batch. Where they are not even they are sorted, the tallest of a class first.
pub(super) fn batch(trajectory: &Trajectory<'_>, order: &[Place], even: bool, most: usize) -> usize {
    let high = trajectory.widths.of(order[0].point as usize)[1];
    // The widest of the class may be wider by as many octaves.
    let most = if exponent(high) < GRID_BITS_OF_MANY - OCTAVES { most } else { most.min(FEW) };
    if even {
        return order.len().min(most);
    }
    let (mut count, mut sum) = (0.0, 0.0);
    let fit = |p: &&Place| {
        (count, sum) = (count + 1.0, sum + share(p, &order[0]));
        fits(p, &order[0]) && count <= TALLEST_TO_MEAN * sum
    };
    order.iter().take(most).take_while(fit).count()
}
