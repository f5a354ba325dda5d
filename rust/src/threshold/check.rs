//! The check that every pixel is a relevance: finite and not negative.

use super::pixel::{Key, Pixel};
use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

/// Checks in one pass that every pixel is finite and not negative.
///
/// # Errors
/// Names the first pixel that is not.
pub fn check_pixels<T: Pixel>(landscape: &[T], shape: Shape) -> Result<()> {
    if Simd::best().run(Doubt(landscape)) { look_closer(landscape, shape.width(), 1) } else { Ok(()) }
}

/// Whether a pixel is negative, -0.0, infinite or NaN.
struct Doubt<'a, T>(&'a [T]);

impl<T: Pixel> Kernel for Doubt<'_, T> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let mut doubt = T::Key::default();
        for pixel in self.0 {
            doubt |= pixel.key().doubt();
        }
        doubt < T::Key::default()
    }
}

/// The error for the first bad pixel, if there is one. The pixels are those of every `stride`-th row and
/// column; the error counts in those of the full image.
#[cold]
pub(super) fn look_closer<T: Pixel>(pixels: &[T], width: usize, stride: usize) -> Result<()> {
    let Some(at) = pixels.iter().position(|p| !p.valid()) else { return Ok(()) };
    let index = [at / width * stride, at % width * stride];
    Err(Error::element("landscape", &index, "finite and >= 0", pixels[at].into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_pixel_is_found_wherever_it_stands() {
        let shape = Shape::new(5, 9).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-45] {
            for at in 0..shape.pixels() {
                let mut pixels = vec![1.0_f32; shape.pixels()];
                pixels[at] = bad;
                let error = check_pixels(&pixels, shape).unwrap_err().to_string();
                assert!(error.ends_with(&format!("at landscape[{}, {}]", at / 9, at % 9)), "{error}");
            }
        }
        assert_eq!(check_pixels(&vec![-0.0_f32; shape.pixels()], shape), Ok(()));
    }
}
