//! Gibbs sampling of a landscape with inverse-transform look-up tables (Section IV-B).

use rand_core::RngCore;

use crate::error::{Error, Result};
use crate::rng::uniform;
use crate::shape::Shape;

/// A chain over the pixels of a landscape. One sweep draws `u` from the row, then `v` from the column.
///
/// The tables, cumulative sums of rows and columns, are made when the chain first comes by.
#[derive(Clone, Debug)]
pub struct Gibbs<'a> {
    landscape: &'a [f32],
    shape: Shape,
    row_sums: Vec<f64>,
    rows: Tables,
    columns: Tables,
    v: usize,
}

impl<'a> Gibbs<'a> {
    /// Checks the landscape in one pass; the chain stands nowhere until one of the starts is called.
    ///
    /// # Errors
    /// A pixel that is negative or not finite, or a landscape that is zero everywhere.
    pub fn new(landscape: &'a [f32], shape: Shape) -> Result<Self> {
        shape.check("landscape", landscape.len())?;
        let mut row_sums = Vec::with_capacity(shape.height());
        for (v, row) in landscape.chunks_exact(shape.width()).enumerate() {
            row_sums.push(
                checked_sum(row)
                    .map_err(|u| Error::element("landscape", &[v, u], "finite and >= 0", row[u]))?,
            );
        }
        if !row_sums.iter().any(|&sum| sum > 0.0) {
            let reason = "is zero everywhere: there is nothing to sample";
            return Err(Error::conflict("landscape", reason));
        }
        Ok(Self {
            landscape,
            shape,
            row_sums,
            rows: Tables::new(shape.height(), shape.width()),
            columns: Tables::new(shape.width(), shape.height()),
            v: 0,
        })
    }

    /// Starts at pixel (u, v). A sweep begins with a draw of `u`, so only the row matters.
    ///
    /// # Errors
    /// A pixel outside the image or on a row of zeros.
    pub fn start_at(&mut self, [u, v]: [usize; 2]) -> Result<()> {
        if u >= self.shape.width() || v >= self.shape.height() {
            let (height, width) = (self.shape.height(), self.shape.width());
            let expected = format!("(u, v) inside the image, u < {width} and v < {height}");
            return Err(Error::scalar("start", expected, (u, v)));
        }
        if self.row_sums[v] <= 0.0 {
            let expected = "on a row of the landscape that is not zero everywhere";
            return Err(Error::scalar("start", expected, (u, v)));
        }
        self.v = v;
        Ok(())
    }

    /// Starts at an exact draw from the landscape, so that no sweep needs to be dropped.
    pub fn start_drawn(&mut self, rng: &mut impl RngCore) {
        let mut total = 0.0;
        let cumulative: Vec<f64> = self
            .row_sums
            .iter()
            .map(|sum| {
                total += sum;
                total
            })
            .collect();
        self.v = invert(&cumulative, uniform(rng));
    }

    /// One sweep; returns the pixel (u, v) where the chain then stands.
    pub fn sweep(&mut self, rng: &mut impl RngCore) -> [usize; 2] {
        let width = self.shape.width();
        let start = self.v * width;
        let row = self.rows.get(self.v, || self.landscape[start..start + width].iter());
        let u = invert(row, uniform(rng));
        let column = self.columns.get(u, || self.landscape[u..].iter().step_by(width));
        self.v = invert(column, uniform(rng));
        [u, self.v]
    }
}

/// Sum of a row, or the index of its first pixel that is negative or not finite.
fn checked_sum(row: &[f32]) -> std::result::Result<f64, usize> {
    // Sixteen partial sums, so that they can stand side by side in vector registers.
    const LANES: usize = 16;
    let (mut sums, mut least) = ([0.0_f64; LANES], [0.0_f32; LANES]);
    let (chunks, rest) = row.as_chunks::<LANES>();
    for chunk in chunks {
        for ((sum, least), &p) in sums.iter_mut().zip(&mut least).zip(chunk) {
            *sum += f64::from(p);
            *least = if p < *least { p } else { *least };
        }
    }
    for ((sum, least), &p) in sums.iter_mut().zip(&mut least).zip(rest) {
        *sum += f64::from(p);
        *least = if p < *least { p } else { *least };
    }
    // Finite float32 cannot overflow a float64 sum: it is finite if and only if every pixel is.
    let sum: f64 = sums.iter().sum();
    if sum.is_finite() && least.iter().all(|&p| p >= 0.0) {
        return Ok(sum);
    }
    Err(row.iter().position(|p| !(0.0..f32::INFINITY).contains(p)).unwrap_or(0))
}

/// Cumulative sums of the lines (rows or columns) that have been visited, one after the other.
#[derive(Clone, Debug)]
struct Tables {
    sums: Vec<f64>,
    start: Vec<usize>,
    length: usize,
}

/// The start of a table that has not been made.
const NOT_MADE: usize = usize::MAX;

impl Tables {
    fn new(lines: usize, length: usize) -> Self {
        Self { sums: Vec::new(), start: vec![NOT_MADE; lines], length }
    }

    fn get<'p, I: Iterator<Item = &'p f32>>(&mut self, line: usize, pixels: impl FnOnce() -> I) -> &[f64] {
        if self.start[line] == NOT_MADE {
            self.start[line] = self.sums.len();
            let mut total = 0.0;
            self.sums.extend(pixels().take(self.length).map(|&p| {
                total += f64::from(p);
                total
            }));
        }
        &self.sums[self.start[line]..][..self.length]
    }
}

/// The first index whose cumulative sum exceeds `x` times the total, for `x` in `[0, 1)`.
///
/// An index of zero mass adds nothing to its predecessor's sum and so is never the first.
fn invert(cumulative: &[f64], x: f64) -> usize {
    let total = cumulative.last().copied().unwrap_or(0.0);
    let target = x * total;
    let index = cumulative.partition_point(|&sum| sum <= target);
    if index < cumulative.len() {
        return index;
    }
    // Rounding took the target up to the total: the last index that has mass.
    cumulative.partition_point(|&sum| sum < total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Xoshiro256PlusPlus;

    #[test]
    fn inversion_never_picks_an_index_without_mass() {
        let cumulative = [0.0, 0.0, 0.25, 0.25, 1.0, 1.0];
        assert_eq!(invert(&cumulative, 0.0), 2);
        assert_eq!(invert(&cumulative, 0.2499), 2);
        assert_eq!(invert(&cumulative, 0.25), 4);
        assert_eq!(invert(&cumulative, 1.0 - f64::EPSILON / 2.0), 4);
        // Even where rounding reaches the total.
        assert_eq!(invert(&cumulative, 1.0), 4);
    }

    #[test]
    fn a_chain_visits_pixels_by_their_mass_and_no_other() {
        let pixels = [1.0, 0.0, 3.0, 2.0, 4.0, 0.0];
        let shape = Shape::new(2, 3).unwrap();
        let mut rng = Xoshiro256PlusPlus::new(3);
        let mut chain = Gibbs::new(&pixels, shape).unwrap();
        chain.start_drawn(&mut rng);
        let mut counts = [0_u32; 6];
        let sweeps = 200_000;
        for _ in 0..sweeps {
            let [u, v] = chain.sweep(&mut rng);
            counts[v * 3 + u] += 1;
        }
        for (&count, &pixel) in counts.iter().zip(&pixels) {
            let share = f64::from(count) / f64::from(sweeps);
            assert!((share - f64::from(pixel) / 10.0).abs() < 0.01, "{counts:?}");
            assert_eq!(count == 0, pixel == 0.0);
        }
    }

    #[test]
    fn a_bad_pixel_is_named_wherever_it_stands() {
        let shape = Shape::new(3, 37).unwrap();
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            for u in 0..37 {
                let mut pixels = vec![1.0; shape.pixels()];
                pixels[37 + u] = bad;
                let error = Gibbs::new(&pixels, shape).unwrap_err().to_string();
                assert!(error.ends_with(&format!("at landscape[1, {u}]")), "{error}");
            }
        }
    }

    #[test]
    fn a_start_must_have_mass_in_its_row() {
        let pixels = [0.0, 0.0, 1.0, 0.0];
        let mut chain = Gibbs::new(&pixels, Shape::new(2, 2).unwrap()).unwrap();
        assert!(chain.start_at([0, 0]).is_err());
        assert!(chain.start_at([1, 1]).is_ok());
        assert!(chain.start_at([2, 1]).is_err());
    }
}
