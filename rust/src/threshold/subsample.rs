//! Every so-manieth pixel.

use super::pixel::Pixel;
use super::workspace::first;
use crate::shape::Shape;
use crate::simd::Kernel;

/// Copies every stride-th pixel of every stride-th row.
pub struct Subsample<'a, T> {
    pub landscape: &'a [T],
    pub shape: Shape,
    pub stride: usize,
    pub out: &'a mut Vec<T>,
}

impl<'a, T: Pixel> Kernel for Subsample<'a, T> {
    type Output = &'a [T];

    #[inline(always)]
    fn run(self) -> &'a [T] {
        let Self { landscape, shape, stride, out } = self;
        let width = shape.width().div_ceil(stride);
        let out = first(shape.height().div_ceil(stride) * width, out);
        let rows = landscape.chunks_exact(shape.width()).step_by(stride);
        for (row, out) in rows.zip(out.chunks_exact_mut(width)) {
            // A step that is known to the compiler is a shuffle of whole vectors.
            match stride {
                2 => every_of::<2, T>(row, out),
                4 => every_of::<4, T>(row, out),
                _ => every(stride, row, out),
            }
        }
        out
    }
}

/// Copies the first pixel of every `step`.
#[inline(always)]
pub fn every<T: Pixel>(step: usize, pixels: &[T], out: &mut [T]) {
    for (out, pixels) in out.iter_mut().zip(pixels.chunks(step)) {
        *out = pixels[0];
    }
}

#[inline(always)]
fn every_of<const STEP: usize, T: Pixel>(pixels: &[T], out: &mut [T]) {
    let (chunks, rest) = pixels.as_chunks::<STEP>();
    for (out, chunk) in out.iter_mut().zip(chunks) {
        *out = chunk[0];
    }
    if let (Some(out), Some(&pixel)) = (out.get_mut(chunks.len()), rest.first()) {
        *out = pixel;
    }
}
