//! Independent samples of a landscape, exact and without a chain; at will with a distance between them.

use crate::error::{Error, Result};
use crate::masses::{Landscape, Masses};
use crate::rng::{Xoshiro256PlusPlus, uniform};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

/// Draws in a row that may fall too near to earlier samples before the places that are left are summed anew.
const REFUSALS: u32 = 32;

/// Buffers of a sampler; with a warmed-up workspace nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    masses: Masses,
    /// Pixels too near to a sample.
    taken: Vec<bool>,
    /// The landscape without them.
    left: Vec<f32>,
}

/// Draws pixels (u, v) into `out`, two numbers each, and returns how many it drew.
///
/// Each is drawn with probability proportional to its landscape. With a `min_distance` each is drawn from the
/// pixels that are at least so far [px] from all before it, and there are fewer than asked when none of those
/// has a positive landscape.
///
/// # Errors
/// A pixel of the landscape that is negative or not finite, a landscape that is zero everywhere, or a
/// `min_distance` that is negative or not finite.
pub fn sample(
    simd: Simd,
    landscape: Landscape<'_>,
    min_distance: f64,
    rng: &mut Xoshiro256PlusPlus,
    workspace: &mut Workspace,
    out: &mut [i32],
) -> Result<usize> {
    if !(0.0..f64::INFINITY).contains(&min_distance) {
        return Err(Error::scalar("min_distance", "finite and >= 0", min_distance));
    }
    workspace.masses.scan(simd, landscape)?;
    if min_distance == 0.0 {
        let masses = &mut workspace.masses;
        return Ok(simd.run(Draws { landscape: landscape.pixels, masses, rng, out }));
    }
    workspace.apart(simd, landscape, min_distance, rng, out)
}

struct Draws<'a> {
    landscape: &'a [f32],
    masses: &'a mut Masses,
    rng: &'a mut Xoshiro256PlusPlus,
    out: &'a mut [i32],
}

impl Kernel for Draws<'_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let (pixels, _) = self.out.as_chunks_mut::<2>();
        for pixel in &mut *pixels {
            // An image has at most 2^31 - 1 pixels, see `Shape`.
            *pixel = self.masses.draw_pixel(self.landscape, uniform(self.rng)).map(|x| x as i32);
        }
        pixels.len()
    }
}

impl Workspace {
    /// Draws with a distance: refuses what is too near, which is exact, and where that takes too long draws
    /// from what is left, which is exact too.
    fn apart(
        &mut self,
        simd: Simd,
        landscape: Landscape<'_>,
        distance: f64,
        rng: &mut Xoshiro256PlusPlus,
        out: &mut [i32],
    ) -> Result<usize> {
        let Landscape { pixels: landscape, shape, .. } = landscape;
        let Self { masses, taken, left } = self;
        taken.clear();
        taken.resize(shape.pixels(), false);
        // Whether it is needed hangs on the draws, and they must not make a call allocate.
        left.clear();
        left.reserve(shape.pixels());
        let (mut renewed, mut refusals, mut drawn) = (false, 0, 0);
        let (pixels, _) = out.as_chunks_mut::<2>();
        while drawn < pixels.len() {
            if refusals == REFUSALS {
                left.clear();
                left.extend(landscape.iter().zip(&*taken).map(|(&p, &taken)| if taken { 0.0 } else { p }));
                if left.iter().all(|&p| p == 0.0) {
                    break;
                }
                masses.scan(simd, Landscape { pixels: left, shape, support: None })?;
                (renewed, refusals) = (true, 0);
            }
            let source = if renewed { &left[..] } else { landscape };
            let [u, v] = masses.draw_pixel(source, uniform(rng));
            if taken[v * shape.width() + u] {
                refusals += 1;
                continue;
            }
            take(taken, shape, [u, v], distance);
            pixels[drawn] = [u as i32, v as i32];
            (drawn, refusals) = (drawn + 1, 0);
        }
        Ok(drawn)
    }
}

/// Marks the pixels nearer to (u, v) than `distance`.
fn take(taken: &mut [bool], shape: Shape, [u, v]: [usize; 2], distance: f64) {
    // The square of a tiny distance may be 0, and the pixel itself is always too near.
    let square = (distance * distance).max(f64::MIN_POSITIVE);
    let reach = |size: usize, at: usize, by: f64| {
        let by = by as usize;
        at.saturating_sub(by)..at.saturating_add(by).saturating_add(1).min(size)
    };
    for row in reach(shape.height(), v, distance) {
        let dv = row.abs_diff(v) as f64;
        // The largest whole number whose square stays below what is left.
        let mut half = (square - dv * dv).max(0.0).sqrt().floor();
        if half * half + dv * dv >= square {
            half -= 1.0;
        }
        if half >= 0.0 {
            let columns = reach(shape.width(), u, half);
            taken[row * shape.width()..][columns].fill(true);
        }
    }
}
