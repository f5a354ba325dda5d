//! Gibbs sampling of a landscape with inverse-transform look-up tables (Section IV-B).

use crate::error::{Error, Result};
use crate::masses::{Landscape, Masses};
use crate::rng::{Xoshiro256PlusPlus, uniform};
use crate::simd::{Kernel, Simd};

/// A chain over the pixels of a landscape. One sweep draws `u` from the row, then `v` from the column.
#[derive(Debug)]
pub struct Gibbs<'a> {
    simd: Simd,
    landscape: &'a [f32],
    masses: &'a mut Masses,
    v: usize,
}

/// Which sweeps of a chain are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Sweeps to drop before the next one that is kept.
    skip: u64,
    /// Of the sweeps that follow every thin-th is kept.
    thin: u64,
}

impl Schedule {
    /// Drops `burn_in` sweeps and keeps every thin-th of the rest; `thin` of 0 counts as 1.
    pub fn new(burn_in: u64, thin: u64) -> Self {
        let thin = thin.max(1);
        Self { skip: burn_in.saturating_add(thin - 1), thin }
    }

    /// Whether the sweep just made is kept.
    #[inline(always)]
    fn keeps(&mut self) -> bool {
        let kept = self.skip == 0;
        self.skip = if kept { self.thin - 1 } else { self.skip - 1 };
        kept
    }
}

impl<'a> Gibbs<'a> {
    /// Checks and sums the landscape in one pass. The chain stands nowhere until one of the starts is called.
    ///
    /// # Errors
    /// A pixel that is negative or not finite, or a landscape that is zero everywhere.
    pub fn new(simd: Simd, landscape: Landscape<'a>, masses: &'a mut Masses) -> Result<Self> {
        masses.scan(simd, landscape)?;
        Ok(Self { simd, landscape: landscape.pixels, masses, v: 0 })
    }

    /// Starts at pixel (u, v). A sweep begins with a draw of `u`, so only the row matters.
    ///
    /// # Errors
    /// A pixel outside the image or on a row of zeros.
    pub fn start_at(&mut self, [u, v]: [usize; 2]) -> Result<()> {
        let (width, height) = (self.masses.width(), self.masses.height());
        if u >= width || v >= height {
            let expected = format!("(u, v) inside the image, u < {width} and v < {height}");
            return Err(Error::scalar("start", expected, (u, v)));
        }
        if self.masses.row_mass(self.landscape, v) <= 0.0 {
            let expected = "on a row of the landscape that is not zero everywhere";
            return Err(Error::scalar("start", expected, (u, v)));
        }
        self.v = v;
        Ok(())
    }

    /// Starts at an exact draw from the landscape, so that no sweep needs to be dropped.
    pub fn start_drawn(&mut self, rng: &mut Xoshiro256PlusPlus) {
        let Self { simd, landscape, masses, .. } = self;
        self.v = simd.run(Start { landscape, masses, x: uniform(rng) });
    }

    /// Makes at most `sweeps` sweeps and writes the pixels (u, v) of those that the schedule keeps to `out`,
    /// two numbers each, until it is full; returns how many pixels it wrote.
    pub fn run(
        &mut self,
        rng: &mut Xoshiro256PlusPlus,
        sweeps: u64,
        schedule: &mut Schedule,
        out: &mut [i32],
    ) -> usize {
        self.simd.run(Sweeps { chain: self, rng, sweeps, schedule, out })
    }
}

struct Start<'c> {
    landscape: &'c [f32],
    masses: &'c mut Masses,
    x: f64,
}

impl Kernel for Start<'_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        self.masses.draw_pixel(self.landscape, self.x)[1]
    }
}

struct Sweeps<'c, 'a> {
    chain: &'c mut Gibbs<'a>,
    rng: &'c mut Xoshiro256PlusPlus,
    sweeps: u64,
    schedule: &'c mut Schedule,
    out: &'c mut [i32],
}

impl Kernel for Sweeps<'_, '_> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Gibbs { landscape, masses, v, .. } = self.chain;
        let (pixels, _) = self.out.as_chunks_mut::<2>();
        let mut kept = 0;
        for _ in 0..self.sweeps {
            if kept == pixels.len() {
                break;
            }
            let u = masses.draw_column(landscape, *v, uniform(self.rng));
            *v = masses.draw_row(landscape, u, uniform(self.rng));
            if self.schedule.keeps() {
                // An image has at most 2^31 - 1 pixels, see `Shape`.
                pixels[kept] = [u as i32, *v as i32];
                kept += 1;
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;

    #[test]
    fn a_chain_visits_pixels_by_their_mass_and_no_other() {
        let pixels = [1.0, 0.0, 3.0, 2.0, 4.0, 0.0];
        let shape = Shape::new(2, 3).unwrap();
        let mut rng = Xoshiro256PlusPlus::new(3);
        let mut masses = Masses::default();
        let landscape = Landscape { pixels: &pixels, shape, support: None };
        let mut chain = Gibbs::new(Simd::best(), landscape, &mut masses).unwrap();
        chain.start_drawn(&mut rng);
        let mut out = vec![0; 400_000];
        assert_eq!(chain.run(&mut rng, u64::MAX, &mut Schedule::new(0, 1), &mut out), 200_000);
        let mut counts = [0_u32; 6];
        for pixel in out.as_chunks::<2>().0 {
            counts[(pixel[1] * 3 + pixel[0]) as usize] += 1;
        }
        for (&count, &pixel) in counts.iter().zip(&pixels) {
            let share = f64::from(count) / 200_000.0;
            assert!((share - f64::from(pixel) / 10.0).abs() < 0.01, "{counts:?}");
            assert_eq!(count == 0, pixel == 0.0);
        }
    }

    #[test]
    fn a_schedule_keeps_every_thin_th_sweep_after_the_burn_in() {
        let kept = |burn_in, thin| {
            let mut schedule = Schedule::new(burn_in, thin);
            (0..12).filter(|_| schedule.keeps()).collect::<Vec<u32>>()
        };
        assert_eq!(kept(0, 1), (0..12).collect::<Vec<_>>());
        assert_eq!(kept(3, 4), [6, 10]);
    }

    #[test]
    fn a_start_must_have_mass_in_its_row() {
        let pixels = [0.0, 0.0, 1.0, 0.0];
        let mut masses = Masses::default();
        let shape = Shape::new(2, 2).unwrap();
        let landscape = Landscape { pixels: &pixels, shape, support: None };
        let mut chain = Gibbs::new(Simd::best(), landscape, &mut masses).unwrap();
        assert!(chain.start_at([0, 0]).is_err());
        assert!(chain.start_at([1, 1]).is_ok());
        assert!(chain.start_at([2, 1]).is_err());
    }
}
