//! Scores of a few windows of an RGB image: only their pixels are looked at, each of them once.

use super::{Scan, Slots};
use crate::colours::{Colours, convert};
use crate::error::{Error, Result};
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

/// Pixels of a row that are asked at once whether they are in any of the target's bins.
const BLOCK: usize = 16;

/// Buffers that belong to the caller and are kept from one call to the next.
#[derive(Clone, Debug, Default)]
pub struct WindowSpace {
    /// A bit for each pixel of the image that a window covers, rows padded to whole words.
    covered: Vec<u64>,
    /// The covered pixels one after the other, as runs of the image's: where each begins, and its length.
    runs: Vec<[usize; 2]>,
    rgb: Vec<u8>,
    bins: Vec<u16>,
    /// The place of each covered pixel's bin among the target's.
    slots: Vec<u16>,
    counts: Vec<u32>,
}

/// An image whose pixels have no bins yet.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Three bytes for each pixel, row-major.
    pub rgb: &'a [u8],
    /// Its size.
    pub shape: Shape,
    /// The bins that its pixels are to have.
    pub colours: Colours,
}

impl Scan<'_> {
    /// Writes the score of each window, given by its upper left pixel `[u, v]`, to `out`: the same bits as
    /// [`Scan::run`] gives there on the bins of the whole image. Stride and wanted windows do not matter.
    ///
    /// # Errors
    /// A window or target outside its domain, a target that has not one share for each bin, a corner whose
    /// window is not inside the image, or a buffer of another size.
    pub fn windows(
        &self,
        simd: Simd,
        picture: Picture<'_>,
        corners: &[[i32; 2]],
        space: &mut WindowSpace,
        out: &mut [f32],
    ) -> Result<()> {
        let Picture { rgb, shape: image, colours } = picture;
        let places = Scan { stride: 1, ..*self }.places(image)?;
        if rgb.len() != 3 * image.pixels() {
            let expected = format!("of {} x {} x 3 elements", image.height(), image.width());
            return Err(Error::shape("rgb", expected, rgb.len().to_string()));
        }
        if self.target.len() != colours.count() {
            let expected = format!("one share for each of {} bins", colours.count());
            return Err(Error::shape("target", expected, self.target.len().to_string()));
        }
        if out.len() != corners.len() {
            return Err(Error::shape("out", format!("of {} elements", corners.len()), out.len().to_string()));
        }
        let fits = |place: i32, most: usize| usize::try_from(place).is_ok_and(|place| place < most);
        for (k, corner) in corners.iter().enumerate() {
            for (axis, most) in [places.width(), places.height()].into_iter().enumerate() {
                if !fits(corner[axis], most) {
                    let expected = format!("a window inside the image, from 0 to {}", most - 1);
                    return Err(Error::element("corners", &[k, axis], expected, corner[axis]));
                }
            }
        }
        let slots = self.slots()?;
        simd.run(Windows { window: self.window, picture, slots: &slots, corners, space, out });
        Ok(())
    }
}

struct Windows<'a> {
    window: [usize; 2],
    picture: Picture<'a>,
    slots: &'a Slots,
    corners: &'a [[i32; 2]],
    space: &'a mut WindowSpace,
    out: &'a mut [f32],
}

impl Kernel for Windows<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        self.cover();
        self.convert();
        for k in 0..self.corners.len() {
            self.out[k] = self.score(self.corners[k]);
        }
    }
}

impl Windows<'_> {
    /// Marks the pixels of all windows.
    #[inline(always)]
    fn cover(&mut self) {
        let words = self.picture.shape.width().div_ceil(64);
        let covered = &mut self.space.covered;
        covered.clear();
        covered.resize(words * self.picture.shape.height(), 0);
        let [height, width] = self.window;
        for &[u, v] in self.corners {
            let [first, end] = [u as usize, u as usize + width];
            for row in covered.chunks_exact_mut(words).skip(v as usize).take(height) {
                for (k, word) in row.iter_mut().enumerate().take(end.div_ceil(64)).skip(first / 64) {
                    let from = u64::MAX << first.saturating_sub(64 * k);
                    let past = (64 * (k + 1)).saturating_sub(end);
                    *word |= from & (u64::MAX >> past);
                }
            }
        }
    }

    /// Looks up the slots of the marked pixels.
    #[inline(always)]
    fn convert(&mut self) {
        let Picture { rgb: image, shape, colours } = self.picture;
        let width = shape.width();
        let WindowSpace { covered, runs, rgb, bins, slots, .. } = &mut *self.space;
        // A run is too short to fill the registers; all of them together are not.
        runs.clear();
        rgb.clear();
        for (v, words) in covered.chunks_exact(width.div_ceil(64)).enumerate() {
            let mut end = 0;
            loop {
                let from = next(words, end, width, false);
                if from == width {
                    break;
                }
                end = next(words, from, width, true);
                runs.push([v * width + from, end - from]);
                rgb.extend_from_slice(&image[3 * (v * width + from)..3 * (v * width + end)]);
            }
        }
        bins.resize(rgb.len() / 3, 0);
        convert(colours, rgb, bins);
        slots.resize(shape.pixels(), 0);
        let mut rest = &bins[..];
        for &[first, length] in &*runs {
            let (bins, others) = rest.split_at(length);
            for (slot, &bin) in slots[first..][..length].iter_mut().zip(bins) {
                *slot = self.slots.of[usize::from(bin)];
            }
            rest = others;
        }
    }

    #[inline(always)]
    fn score(&mut self, [u, v]: [i32; 2]) -> f32 {
        let [height, width] = self.window;
        let none = self.slots.caps.len();
        let WindowSpace { slots, counts, .. } = &mut *self.space;
        counts.clear();
        counts.resize(none + 1, 0);
        for row in slots.chunks_exact(self.picture.shape.width()).skip(v as usize).take(height) {
            for block in row[u as usize..][..width].chunks(BLOCK) {
                if block.iter().fold(true, |all, &slot| all & (usize::from(slot) == none)) {
                    continue;
                }
                for &slot in block {
                    counts[usize::from(slot)] += 1;
                }
            }
        }
        let mut score = 0.0;
        for (&count, &cap) in counts.iter().zip(&self.slots.caps) {
            let count = count as f32;
            score += if count < cap { count } else { cap };
        }
        score / (height * width) as f32
    }
}

/// The first pixel from `from` on that is marked or, where `not` says so, is not; `width` if there is none.
#[inline(always)]
fn next(words: &[u64], from: usize, width: usize, not: bool) -> usize {
    let flip = if not { u64::MAX } else { 0 };
    let mut at = from;
    while at < width {
        let word = (words[at / 64] ^ flip) >> (at % 64);
        if word != 0 {
            return (at + word.trailing_zeros() as usize).min(width);
        }
        at = (at / 64 + 1) * 64;
    }
    width
}
