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
    check_read(Simd::best(), landscape, shape.width(), 1)
}

/// Checks pixels that were read with a stride; an error counts in rows and columns of the full image.
pub fn check_read<T: Pixel>(simd: Simd, pixels: &[T], width: usize, stride: usize) -> Result<()> {
    let Some(at) = simd.run(FirstBad(pixels)) else { return Ok(()) };
    let index = [at / width * stride, at % width * stride];
    Err(Error::element("landscape", &index, "finite and >= 0", pixels[at].into()))
}

/// The index of the first pixel that is negative or not finite.
struct FirstBad<'a, T>(&'a [T]);

impl<T: Pixel> Kernel for FirstBad<'_, T> {
    type Output = Option<usize>;

    #[inline(always)]
    fn run(self) -> Option<usize> {
        for (index, block) in self.0.chunks(BLOCK).enumerate() {
            let mut doubt = T::Key::default();
            for pixel in block {
                doubt |= pixel.key().doubt();
            }
            // What is in doubt may be a -0.0, which is valid and may come in numbers.
            if doubt < T::Key::default() && any_bad(block) {
                return block.iter().position(|p| !p.valid()).map(|at| index * BLOCK + at);
            }
        }
        None
    }
}

#[inline(always)]
fn any_bad<T: Pixel>(block: &[T]) -> bool {
    let mut bad = T::Key::default();
    for pixel in block {
        bad |= T::Key::from(!pixel.valid());
    }
    bad != T::Key::default()
}

/// Pixels between two looks at the result.
const BLOCK: usize = 1024;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_pixel_is_found_wherever_it_stands() {
        let shape = Shape::new(5, 9).unwrap();
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-45] {
            for at in 0..shape.pixels() {
                let mut pixels = vec![1.0_f32; shape.pixels()];
                pixels[at] = bad;
                let error = check_pixels(&pixels, shape).unwrap_err().to_string();
                assert!(error.ends_with(&format!("at landscape[{}, {}]", at / 9, at % 9)), "{error}");
            }
        }
        assert_eq!(check_pixels(&vec![-0.0_f32; shape.pixels()], shape), Ok(()));
        assert_eq!(check_pixels(&vec![f32::MAX; shape.pixels()], shape), Ok(()));
    }

    #[test]
    fn the_first_of_several_is_named_on_every_instruction_set() {
        let width = 700;
        let mut pixels = vec![-0.0_f64; 4 * width];
        for at in [1023, 1024, 1025, 2799].into_iter().rev() {
            pixels[at] = f64::NAN;
            for simd in Simd::all() {
                let error = check_read(simd, &pixels, width, 3).unwrap_err().to_string();
                let place = format!("at landscape[{}, {}]", at / width * 3, at % width * 3);
                assert!(error.ends_with(&place), "{error}");
            }
        }
    }
}
