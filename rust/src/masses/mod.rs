//! The mass of a landscape in blocks, from which both samplers draw.
//!
//! One pass checks every pixel and sums each column over blocks of [`BLOCK`] rows. Cumulative tables over
//! blocks follow line by line, when a draw first needs a line; within a block pixels are added on the spot.
//! The sums of four pixels are float32 and all others float64, formed in a fixed order: the same landscape gives
//! the same draws on every machine, and masses are true to 2^-23.

mod tables;

use tables::{Across, BLOCK, Bands, Down, Tables, find, first_block, invert, within};

use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};
use crate::support::Support;
use crate::threshold::check_pixels;

/// A landscape to draw from.
#[derive(Clone, Copy, Debug)]
pub struct Landscape<'a> {
    /// Its pixels, row-major.
    pub pixels: &'a [f32],
    /// Its size.
    pub shape: Shape,
    /// Where it may be positive, if that is known: the rest is not even read.
    pub support: Option<&'a Support>,
}

/// Sums over one landscape. For a landscape no larger than the ones before nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct Masses {
    width: usize,
    height: usize,
    /// Sums of every column over blocks of rows, (blocks, width).
    sums: Vec<f64>,
    /// Tables of the rows, of the columns, of the blocks of rows and of all of these together.
    rows: Tables,
    columns: Tables,
    bands: Tables,
    image: Tables,
}

impl Masses {
    /// Sums a landscape and checks every pixel that it sums.
    ///
    /// # Errors
    /// A pixel that is negative or not finite, a landscape that is zero everywhere, or a support that is that of
    /// another image.
    pub(crate) fn scan(&mut self, simd: Simd, landscape: Landscape<'_>) -> Result<()> {
        let Landscape { pixels: landscape, shape, support } = landscape;
        shape.check("landscape", landscape.len())?;
        if support.is_some_and(|support| !support.fits(shape)) {
            return Err(Error::conflict("support", "belongs to an image of another size"));
        }
        (self.width, self.height) = (shape.width(), shape.height());
        let (down, across) = (self.height.div_ceil(BLOCK), self.width.div_ceil(BLOCK));
        if self.sums.len() < down * self.width {
            self.sums.resize(down * self.width, 0.0);
        }
        self.rows.reset(self.height, across);
        self.columns.reset(self.width, down);
        self.bands.reset(down, across);
        self.image.reset(1, down);

        let mut scan = |wide| {
            let sums = &mut self.sums;
            simd.run(Scan { sums, width: self.width, landscape, support, wide })
        };
        let mut bits = scan(false);
        // A sum is infinite or NaN if one of its pixels is, or if four of them exceed float32 together.
        if bits.any >> 31 != 0 || !bits.finite {
            check_pixels(landscape, shape)?;
            bits = scan(true);
        }
        if bits.any << 1 == 0 {
            let reason = "is zero everywhere: there is nothing to sample";
            return Err(Error::conflict("landscape", reason));
        }
        Ok(())
    }

    /// Rows of the image.
    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// Columns of the image.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Mass of row `v`.
    #[inline(always)]
    pub(crate) fn row_mass(&mut self, landscape: &[f32], v: usize) -> f64 {
        self.row(landscape, v).last().copied().unwrap_or(0.0)
    }

    /// Draws a column from row `v`; `x` in `[0, 1)` is uniform.
    #[inline(always)]
    pub(crate) fn draw_column(&mut self, landscape: &[f32], v: usize, x: f64) -> usize {
        let (block, rest) = invert(self.row(landscape, v), x);
        let row = &landscape[v * self.width..(v + 1) * self.width];
        block * BLOCK + within(first_block(&row[block * BLOCK..]), rest).0
    }

    /// Draws a row from column `u`; `x` in `[0, 1)` is uniform.
    #[inline(always)]
    pub(crate) fn draw_row(&mut self, landscape: &[f32], u: usize, x: f64) -> usize {
        let (blocks, width) = (self.height.div_ceil(BLOCK), self.width);
        let (block, rest) = invert(self.columns.line(u, Down { sums: &self.sums, width, blocks, u }), x);
        self.within_column(landscape, block, u, rest)
    }

    /// Draws a pixel (u, v) from the whole landscape; `x` in `[0, 1)` is uniform.
    ///
    /// The inversion takes the pixels in the order block of rows, column, row.
    #[inline(always)]
    pub(crate) fn draw_pixel(&mut self, landscape: &[f32], x: f64) -> [usize; 2] {
        let (band, rest) = invert(self.image(), x);
        let width = self.width;
        let sums = &self.sums[band * width..(band + 1) * width];
        let (across, rest) = find(self.bands.line(band, Across(sums)), rest);
        let (column, rest) = within(first_block(&sums[across * BLOCK..]), rest);
        let u = across * BLOCK + column;
        [u, self.within_column(landscape, band, u, rest)]
    }

    /// The table of all blocks of rows.
    #[inline(always)]
    fn image(&mut self) -> &[f64] {
        let (blocks, width) = (self.height.div_ceil(BLOCK), self.width);
        self.image.line(0, Bands { tables: &mut self.bands, sums: &self.sums, width, blocks })
    }

    #[inline(always)]
    fn row(&mut self, landscape: &[f32], v: usize) -> &[f64] {
        self.rows.line(v, Across(&landscape[v * self.width..(v + 1) * self.width]))
    }

    /// The row in a block of rows, and in column `u`, where `rest` of the block's mass is used up.
    #[inline(always)]
    fn within_column(&self, landscape: &[f32], block: usize, u: usize, rest: f64) -> usize {
        let start = block * BLOCK;
        let pixel = |k: usize| f64::from(landscape[(start + k) * self.width + u]);
        let pixels = if start + BLOCK <= self.height {
            std::array::from_fn(pixel)
        } else {
            std::array::from_fn(|k| if start + k < self.height { pixel(k) } else { 0.0 })
        };
        start + within(pixels, rest).0
    }
}

/// What a scan tells of the pixels.
struct Bits {
    /// All pixels' bits together: zero if there is nothing to sample, and with the sign of any negative one.
    any: u32,
    /// Whether all sums are finite.
    finite: bool,
}

/// The pass over the landscape.
struct Scan<'a> {
    sums: &'a mut [f64],
    width: usize,
    landscape: &'a [f32],
    support: Option<&'a Support>,
    /// Whether all sums are float64, because float32 would overflow.
    wide: bool,
}

impl Kernel for Scan<'_> {
    type Output = Bits;

    #[inline(always)]
    fn run(self) -> Bits {
        let Self { sums, width, landscape, support, wide } = self;
        let mut bits = Bits { any: 0, finite: true };
        let blocks = landscape.chunks(BLOCK * width).zip(sums.chunks_exact_mut(width));
        for (block, (rows, sums)) in blocks.enumerate() {
            let count = rows.len() / width;
            let columns = support.map_or(0..width, |s| s.hull(block * BLOCK..block * BLOCK + count));
            sums[..columns.start].fill(0.0);
            sums[columns.end..].fill(0.0);
            let sums = &mut sums[columns.clone()];
            let row = |k: usize| &rows[k * width..][columns.clone()];
            if count == BLOCK && !wide {
                bits.four([row(0), row(1), row(2), row(3)], sums, |_, sum| sum);
                for k in [4, 8, 12] {
                    bits.four([row(k), row(k + 1), row(k + 2), row(k + 3)], sums, |old, sum| old + sum);
                }
            } else {
                sums.fill(0.0);
                for k in 0..count {
                    bits.one(row(k), sums);
                }
            }
            // Zero times a sum is zero unless the sum is infinite or NaN.
            bits.finite &=
                sums.iter().map(|&sum| u64::from(sum * 0.0 == 0.0)).sum::<u64>() == sums.len() as u64;
        }
        bits
    }
}

impl Bits {
    /// Sums four rows at once, so that the sums are not read and written for each. Four pixels are added in
    /// float32: converting each of them would take longer than all the rest.
    #[inline(always)]
    fn four(&mut self, rows: [&[f32]; 4], sums: &mut [f64], join: impl Fn(f64, f64) -> f64) {
        let [a, b, c, d] = rows;
        let mut any = 0;
        for ((((sum, &a), &b), &c), &d) in sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *sum = join(*sum, f64::from((a + b) + (c + d)));
            any |= (a.to_bits() | b.to_bits()) | (c.to_bits() | d.to_bits());
        }
        self.any |= any;
    }

    #[inline(always)]
    fn one(&mut self, row: &[f32], sums: &mut [f64]) {
        let mut any = 0;
        for (sum, &p) in sums.iter_mut().zip(row) {
            *sum += f64::from(p);
            any |= p.to_bits();
        }
        self.any |= any;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_pixel_is_named_wherever_it_stands() {
        let shape = Shape::new(35, 37).unwrap();
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-45] {
            for at in (0..shape.pixels()).step_by(11) {
                let mut pixels = vec![1.0; shape.pixels()];
                pixels[at] = bad;
                for simd in Simd::all() {
                    let error = Masses::default()
                        .scan(simd, Landscape { pixels: &pixels, shape, support: None })
                        .unwrap_err()
                        .to_string();
                    assert!(error.ends_with(&format!("at landscape[{}, {}]", at / 37, at % 37)), "{error}");
                }
            }
        }
        let zeros = vec![-0.0; shape.pixels()];
        let error = Masses::default()
            .scan(Simd::best(), Landscape { pixels: &zeros, shape, support: None })
            .unwrap_err();
        assert!(error.to_string().contains("zero everywhere"));
    }
}
