//! The mass of a landscape in blocks, from which both samplers draw.
//!
//! One pass checks every pixel and sums each column over blocks of [`BLOCK`] rows. Cumulative tables over
//! blocks follow line by line, when a draw first needs a line; within a block pixels are added on the spot.
//! All sums are float64 and formed in a fixed order: the same landscape gives the same draws on every machine.

use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};
use crate::support::Support;
use crate::threshold::check_pixels;

/// Pixels of a block along its line.
const BLOCK: usize = 16;

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

        let bits = simd.run(Scan { sums: &mut self.sums, width: self.width, landscape, support });
        if bits.suspect >> 31 != 0 {
            check_pixels(landscape, shape)?;
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

    /// Draws a row from the masses of all rows; `x` in `[0, 1)` is uniform.
    #[inline(always)]
    pub(crate) fn draw_first_row(&mut self, landscape: &[f32], x: f64) -> usize {
        let (down, rest) = invert(self.image(), x);
        let start = down * BLOCK;
        let mut masses = [0.0; BLOCK];
        for (row, mass) in (start..self.height).zip(&mut masses) {
            *mass = self.row_mass(landscape, row);
        }
        start + within(&masses, |&mass| mass, rest).0
    }

    /// Draws a column from row `v`; `x` in `[0, 1)` is uniform.
    #[inline(always)]
    pub(crate) fn draw_column(&mut self, landscape: &[f32], v: usize, x: f64) -> usize {
        let (block, rest) = invert(self.row(landscape, v), x);
        let row = &landscape[v * self.width..(v + 1) * self.width];
        let start = block * BLOCK;
        start + within(&row[start..row.len().min(start + BLOCK)], |&p| f64::from(p), rest).0
    }

    /// Draws a row from column `u`; `x` in `[0, 1)` is uniform.
    #[inline(always)]
    pub(crate) fn draw_row(&mut self, landscape: &[f32], u: usize, x: f64) -> usize {
        let (sums, width) = (&self.sums, self.width);
        let table = self.columns.line(u, |block| sums[block * width + u]);
        let (block, rest) = invert(table, x);
        self.within_column(landscape, block, u, rest)
    }

    /// Draws a pixel (u, v) from the whole landscape; `x` in `[0, 1)` is uniform.
    ///
    /// The inversion takes the pixels in the order block of rows, column, row.
    #[inline(always)]
    pub(crate) fn draw_pixel(&mut self, landscape: &[f32], x: f64) -> [usize; 2] {
        let (down, rest) = invert(self.image(), x);
        let (sums, bands, width) = (&self.sums, &mut self.bands, self.width);
        let (across, rest) = find(band(bands, sums, width, down), rest);
        let start = across * BLOCK;
        let sums = &sums[down * width..(down + 1) * width];
        let (column, rest) = within(&sums[start..width.min(start + BLOCK)], |&sum| sum, rest);
        let u = start + column;
        [u, self.within_column(landscape, down, u, rest)]
    }

    /// The table of all blocks of rows.
    #[inline(always)]
    fn image(&mut self) -> &[f64] {
        let (sums, bands, width) = (&self.sums, &mut self.bands, self.width);
        self.image.line(0, |k| band(bands, sums, width, k).last().copied().unwrap_or(0.0))
    }

    #[inline(always)]
    fn row(&mut self, landscape: &[f32], v: usize) -> &[f64] {
        let row = &landscape[v * self.width..(v + 1) * self.width];
        self.rows.line(v, |block| block_sum(&row[block * BLOCK..], |&p| f64::from(p)))
    }

    /// The row in a block of rows, and in column `u`, where `rest` of the block's mass is used up.
    #[inline(always)]
    fn within_column(&self, landscape: &[f32], block: usize, u: usize, rest: f64) -> usize {
        let start = block * BLOCK;
        let mut pixels = [0.0_f32; BLOCK];
        let rows = landscape[start * self.width..].chunks_exact(self.width);
        for (pixel, row) in pixels.iter_mut().zip(rows) {
            *pixel = row[u];
        }
        start + within(&pixels, |&p| f64::from(p), rest).0
    }
}

/// The table of a block of rows.
#[inline(always)]
fn band<'a>(bands: &'a mut Tables, sums: &[f64], width: usize, band: usize) -> &'a [f64] {
    let sums = &sums[band * width..(band + 1) * width];
    bands.line(band, |block| block_sum(&sums[block * BLOCK..], |&sum| sum))
}

/// Cumulative sums of lines over blocks, made when a line is first asked for.
#[derive(Clone, Debug, Default)]
struct Tables {
    blocks: usize,
    sums: Vec<f64>,
    /// The round in which a line was made: a new round empties the tables at no cost.
    made: Vec<u32>,
    round: u32,
}

impl Tables {
    fn reset(&mut self, lines: usize, blocks: usize) {
        self.blocks = blocks;
        self.round = self.round.wrapping_add(1);
        if self.round == 0 {
            self.made.fill(0);
            self.round = 1;
        }
        if self.made.len() < lines {
            self.made.resize(lines, 0);
        }
        if self.sums.len() < lines * blocks {
            self.sums.resize(lines * blocks, 0.0);
        }
    }

    #[inline(always)]
    fn line(&mut self, line: usize, mut mass: impl FnMut(usize) -> f64) -> &[f64] {
        let table = &mut self.sums[line * self.blocks..(line + 1) * self.blocks];
        if self.made[line] != self.round {
            self.made[line] = self.round;
            // In two loops: the masses side by side, then the sums, one after the other.
            for (block, sum) in table.iter_mut().enumerate() {
                *sum = mass(block);
            }
            let mut total = 0.0;
            for sum in table.iter_mut() {
                total += *sum;
                *sum = total;
            }
        }
        table
    }
}

/// Sum of the first block of a line, or of what is left of it.
#[inline(always)]
fn block_sum<T>(line: &[T], mass: impl Fn(&T) -> f64) -> f64 {
    let m: [f64; BLOCK] = match line.first_chunk::<BLOCK>() {
        Some(block) => std::array::from_fn(|i| mass(&block[i])),
        None => std::array::from_fn(|i| line.get(i).map_or(0.0, &mass)),
    };
    let m: [f64; 8] = std::array::from_fn(|i| m[i] + m[i + 8]);
    let m: [f64; 4] = std::array::from_fn(|i| m[i] + m[i + 4]);
    (m[0] + m[2]) + (m[1] + m[3])
}

/// The first block whose cumulative sum exceeds `x` times the total, and how far into it that is.
#[inline(always)]
fn invert(cumulative: &[f64], x: f64) -> (usize, f64) {
    find(cumulative, x * cumulative.last().copied().unwrap_or(0.0))
}

/// The first block whose cumulative sum exceeds the target, and how far into it the target is.
///
/// A block of no mass adds nothing to its predecessor's sum and so is never the first.
#[inline(always)]
fn find(cumulative: &[f64], target: f64) -> (usize, f64) {
    let mut index = cumulative.partition_point(|&sum| sum <= target);
    if index == cumulative.len() {
        // Rounding took the target up to the total: the last block that has mass.
        let total = cumulative.last().copied().unwrap_or(0.0);
        index = cumulative.partition_point(|&sum| sum < total);
    }
    let before = if index == 0 { 0.0 } else { cumulative[index - 1] };
    (index, target - before)
}

/// The first item at which the sum of a block exceeds `rest`, and how far into it that is.
#[inline(always)]
fn within<T>(block: &[T], mass: impl Fn(&T) -> f64, rest: f64) -> (usize, f64) {
    let (mut index, mut before, mut sum) = (0, 0.0, 0.0);
    for item in block {
        sum += mass(item);
        if sum <= rest {
            index += 1;
            before = sum;
        }
    }
    if index == block.len() {
        // The block's sum was formed in another order and may be larger by a rounding: its last mass.
        index = block.iter().rposition(|item| mass(item) > 0.0).unwrap_or(0);
        return (index, mass(&block[index]));
    }
    (index, rest - before)
}

/// Bits that tell whether there is anything to sample and anything wrong.
struct Bits {
    /// All pixels' bits together.
    any: u32,
    /// Its sign is set by a pixel that is negative, infinite or NaN, and by negative zero.
    suspect: u32,
}

/// The pass over the landscape.
struct Scan<'a> {
    sums: &'a mut [f64],
    width: usize,
    landscape: &'a [f32],
    support: Option<&'a Support>,
}

impl Kernel for Scan<'_> {
    type Output = Bits;

    #[inline(always)]
    fn run(self) -> Bits {
        let Self { sums, width, landscape, support } = self;
        let mut bits = Bits { any: 0, suspect: 0 };
        let blocks = landscape.chunks(BLOCK * width).zip(sums.chunks_exact_mut(width));
        for (block, (rows, sums)) in blocks.enumerate() {
            let count = rows.len() / width;
            let columns = support.map_or(0..width, |s| s.hull(block * BLOCK..block * BLOCK + count));
            sums[..columns.start].fill(0.0);
            sums[columns.end..].fill(0.0);
            let sums = &mut sums[columns.clone()];
            let row = |k: usize| &rows[k * width..][columns.clone()];
            if count == BLOCK {
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
        }
        bits
    }
}

impl Bits {
    /// Sums four rows at once, so that the sums are not read and written for each.
    #[inline(always)]
    fn four(&mut self, rows: [&[f32]; 4], sums: &mut [f64], join: impl Fn(f64, f64) -> f64) {
        let [a, b, c, d] = rows;
        let (mut any, mut suspect) = (0, 0);
        for ((((sum, &a), &b), &c), &d) in sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *sum = join(*sum, (f64::from(a) + f64::from(b)) + (f64::from(c) + f64::from(d)));
            any |= (a.to_bits() | b.to_bits()) | (c.to_bits() | d.to_bits());
            suspect |= (overflowing(a) | overflowing(b)) | (overflowing(c) | overflowing(d));
        }
        self.any |= any;
        self.suspect |= any | suspect;
    }

    #[inline(always)]
    fn one(&mut self, row: &[f32], sums: &mut [f64]) {
        for (sum, &p) in sums.iter_mut().zip(row) {
            *sum += f64::from(p);
            self.any |= p.to_bits();
            self.suspect |= p.to_bits() | overflowing(p);
        }
    }
}

/// Bits whose sign is set where the exponent is that of infinity and NaN, for a number that is not negative.
#[inline(always)]
fn overflowing(p: f32) -> u32 {
    p.to_bits().wrapping_add(1 << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inversion_never_picks_a_block_without_mass() {
        let cumulative = [0.0, 0.0, 0.25, 0.25, 1.0, 1.0];
        assert_eq!(find(&cumulative, 0.0), (2, 0.0));
        assert_eq!(find(&cumulative, 0.2499).0, 2);
        assert_eq!(find(&cumulative, 0.25), (4, 0.0));
        assert_eq!(find(&cumulative, 1.0 - f64::EPSILON / 2.0).0, 4);
        // Even where rounding reaches the total.
        assert_eq!(find(&cumulative, 1.0).0, 4);
        assert_eq!(within(&[0.0, 0.5, 0.0, 0.25, 0.0], |&m| m, 0.0), (1, 0.0));
        assert_eq!(within(&[0.0, 0.5, 0.0, 0.25, 0.0], |&m| m, 0.5), (3, 0.0));
        assert_eq!(within(&[0.0, 0.5, 0.0, 0.25, 0.0], |&m| m, 0.75), (3, 0.25));
    }

    #[test]
    fn a_block_sum_takes_what_there_is() {
        let line: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(block_sum(&line, |&m| m), 136.0);
        assert_eq!(block_sum(&line[16..], |&m| m), 74.0);
    }

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
