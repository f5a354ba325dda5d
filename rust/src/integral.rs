//! Integral images and integral histograms: the sum over any rectangle in four look-ups.

use crate::error::{Error, Result};
use crate::shape::Shape;

/// `sums[v, u]` of the pixels above row `v` and left of column `u`: one row and one column more than the image.
#[derive(Clone, Debug, Default)]
pub struct IntegralImage {
    stride: usize,
    sums: Vec<u32>,
}

impl IntegralImage {
    /// Sums of an image whose pixels are given by their index, row-major.
    ///
    /// They wrap around where they exceed 32 bits, and the sums of rectangles are right all the same as long
    /// as they do not exceed them themselves.
    pub fn new(shape: Shape, pixel: impl Fn(usize) -> u32) -> Self {
        let stride = shape.width() + 1;
        let mut sums = vec![0_u32; stride * (shape.height() + 1)];
        for v in 0..shape.height() {
            let (above, row) = sums[v * stride..].split_at_mut(stride);
            let mut sum = 0_u32;
            for u in 0..shape.width() {
                sum = sum.wrapping_add(pixel(v * shape.width() + u));
                row[u + 1] = above[u + 1].wrapping_add(sum);
            }
        }
        Self { stride, sums }
    }

    /// The sum over columns `u0..u1` and rows `v0..v1`, of a rectangle `[u0, v0, u1, v1]` inside the image.
    pub fn sum(&self, [u0, v0, u1, v1]: [usize; 4]) -> u32 {
        let at = |v: usize, u: usize| self.sums[v * self.stride + u];
        at(v1, u1).wrapping_sub(at(v0, u1)).wrapping_sub(at(v1, u0)).wrapping_add(at(v0, u0))
    }
}

/// An integral image for each bin of a histogram: what any rectangle holds, at once.
#[derive(Clone, Debug)]
pub struct IntegralHistogram {
    shape: Shape,
    bins: Vec<IntegralImage>,
}

impl IntegralHistogram {
    /// Counts `count` bins of an image of indices; a pixel with a larger index is in no bin.
    ///
    /// # Errors
    /// `bins` is of another size than the image.
    pub fn new(bins: &[u16], shape: Shape, count: usize) -> Result<Self> {
        shape.check("bins", bins.len())?;
        let plane = |bin| IntegralImage::new(shape, |i| u32::from(usize::from(bins[i]) == bin));
        Ok(Self { shape, bins: (0..count).map(plane).collect() })
    }

    /// Pixels of each bin in the rectangle `[u0, v0, u1, v1]`, half-open.
    ///
    /// # Errors
    /// The rectangle is empty or not inside the image.
    pub fn counts(&self, rectangle: [usize; 4]) -> Result<Vec<u32>> {
        let [u0, v0, u1, v1] = rectangle;
        if u0 >= u1 || v0 >= v1 || u1 > self.shape.width() || v1 > self.shape.height() {
            let (width, height) = (self.shape.width(), self.shape.height());
            let expected = format!("(u0, v0, u1, v1) with u0 < u1 <= {width} and v0 < v1 <= {height}");
            return Err(Error::scalar("rectangle", expected, rectangle));
        }
        Ok(self.bins.iter().map(|bin| bin.sum(rectangle)).collect())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_rectangle_holds_the_pixels_that_counting_finds(
            (height, width) in (1_usize..20, 1_usize..20),
            corners in prop::array::uniform4(0.0..1.0),
            seed in 0_usize..1000,
        ) {
            let shape = Shape::new(height, width).unwrap();
            let bins: Vec<u16> = (0..shape.pixels()).map(|i| ((i * i + seed * i) % 5) as u16).collect();
            let side = |low: f64, high: f64, size: usize| {
                let first = (low * size as f64) as usize;
                (first, first + 1 + (high * (size - first) as f64) as usize)
            };
            let (u0, u1) = side(corners[0], corners[1], width);
            let (v0, v1) = side(corners[2], corners[3], height);
            let histogram = IntegralHistogram::new(&bins, shape, 4).unwrap();
            let mut expected = [0; 4];
            for v in v0..v1 {
                for u in u0..u1 {
                    if let Some(count) = expected.get_mut(usize::from(bins[v * width + u])) {
                        *count += 1;
                    }
                }
            }
            prop_assert_eq!(histogram.counts([u0, v0, u1, v1]).unwrap(), expected);
        }
    }

    #[test]
    fn sums_beyond_32_bits_wrap_and_their_differences_do_not_mind() {
        let shape = Shape::new(2, 3).unwrap();
        let image = IntegralImage::new(shape, |i| if i < 2 { u32::MAX } else { 7 });
        assert_eq!(image.sum([1, 1, 3, 2]), 14);
        assert_eq!(image.sum([2, 0, 3, 2]), 14);
    }

    #[test]
    fn a_rectangle_that_is_empty_or_not_inside_the_image_is_an_error() {
        let histogram = IntegralHistogram::new(&[0; 6], Shape::new(2, 3).unwrap(), 1).unwrap();
        for bad in [[0, 0, 4, 2], [0, 0, 3, 3], [1, 0, 1, 2], [0, 1, 3, 1]] {
            let error = histogram.counts(bad).unwrap_err().to_string();
            assert!(error.contains("u1 <= 3 and v0 < v1 <= 2"), "{error}");
        }
        assert!(IntegralHistogram::new(&[0; 5], Shape::new(2, 3).unwrap(), 1).is_err());
    }
}
