//! The integral image, once as it is and once for every octave with the columns sorted by their phase.

use std::ops::Range;

use super::LANES;
use crate::parallel;
use crate::shape::Shape;
use crate::simd::{Kernel, Simd};

/// The integral image for samples every `step` pixels.
///
/// Row `y` holds `step` stretches of `columns` sums, stretch `p` those of the columns `p`, `p + step`, and so on:
/// what neighbouring samples read then lies side by side. Sums wrap around at 32 bits, and boxes do not mind.
#[derive(Debug, Default)]
pub(super) struct Plane {
    step: usize,
    columns: usize,
    sums: Vec<i32>,
}

impl Plane {
    /// Fits it to an image; the sums are whatever they were.
    fn fit(&mut self, step: usize, shape: Shape) {
        (self.step, self.columns) = (step, (shape.width() + 1).div_ceil(step));
        // Whole vectors are read, also where less than one is left.
        let size = (shape.height() + 1) * self.row_length() + LANES;
        self.sums.resize(size, 0);
    }

    fn row_length(&self) -> usize {
        self.step * self.columns
    }

    pub(super) fn step(&self) -> usize {
        self.step
    }

    /// Where the sum of all pixels above and left of the corner `(x, y)` stands.
    #[inline(always)]
    fn place(&self, x: usize, y: usize) -> usize {
        y * self.row_length() + x % self.step * self.columns + x / self.step
    }

    /// The sums at `(x, y)`, `(x + step, y)` and so on.
    #[inline(always)]
    pub(super) fn along(&self, x: usize, y: usize) -> &[i32] {
        &self.sums[self.place(x, y)..]
    }

    /// The sum of the pixels with `x[0] <= u < x[1]` and `y[0] <= v < y[1]`.
    #[inline(always)]
    pub(super) fn sum(&self, x: [usize; 2], y: [usize; 2]) -> i32 {
        let at = |x, y| self.sums[self.place(x, y)];
        at(x[1], y[1]).wrapping_sub(at(x[0], y[1])).wrapping_sub(at(x[1], y[0])).wrapping_add(at(x[0], y[0]))
    }

    /// The sums of a plane of step 1 row by row, and the length of a row.
    #[inline(always)]
    pub(super) fn rows(&self) -> (&[i32], usize) {
        (&self.sums, self.columns)
    }
}

/// A share of the rows of all planes.
struct Part<'a> {
    /// The rows of the image that it begins behind and ends with.
    rows: Range<usize>,
    /// What stands above these rows.
    carry: Vec<i32>,
    sums: &'a mut [i32],
    sorted: Vec<&'a mut [i32]>,
}

/// Fills the planes of the first octaves, each plane but the first in the rows that are needed only.
pub(super) fn fill(
    simd: Simd,
    gray: &[u8],
    shape: Shape,
    threads: usize,
    needed: &[Range<usize>],
    planes: &mut [Plane],
) {
    let (height, width) = (shape.height(), shape.width());
    for (octave, plane) in planes.iter_mut().enumerate() {
        plane.fit(1 << octave, shape);
        // Row 0 is above the image.
        let length = plane.row_length();
        plane.sums[..length].fill(0);
    }
    let sizes: Vec<[usize; 2]> = planes.iter().map(|plane| [plane.step, plane.columns]).collect();
    let share = height.div_ceil(threads.min(height));
    let Some((first, others)) = planes.split_first_mut() else { return };
    let rows = |length: usize| length..(height + 1) * length;
    let mut rest: Vec<_> = others
        .iter_mut()
        .map(|plane| {
            let length = plane.row_length();
            plane.sums[rows(length)].chunks_mut(share * length)
        })
        .collect();
    let sums = first.sums[rows(width + 1)].chunks_mut(share * (width + 1));
    let mut parts: Vec<Part> = sums
        .enumerate()
        .map(|(k, sums)| Part {
            rows: k * share..((k + 1) * share).min(height),
            carry: Vec::new(),
            sums,
            sorted: rest.iter_mut().filter_map(Iterator::next).collect(),
        })
        .collect();
    parallel::share(threads, &mut parts, |part| {
        add_up(&gray[part.rows.start * width..part.rows.end * width], width, part.sums);
    });
    let mut carry = vec![0_i32; width + 1];
    for part in &mut parts {
        part.carry.clone_from(&carry);
        let last = &part.sums[part.sums.len() - (width + 1)..];
        carry.iter_mut().zip(last).for_each(|(carry, &last)| *carry = carry.wrapping_add(last));
    }
    parallel::share(threads, &mut parts, |part| simd.run(Sort { part, sizes: &sizes, needed }));
}

/// The integral image of some rows, as if nothing were above them.
fn add_up(gray: &[u8], width: usize, sums: &mut [i32]) {
    let mut above: &[i32] = &[];
    for (pixels, sums) in gray.chunks_exact(width).zip(sums.chunks_exact_mut(width + 1)) {
        let (first, row) = sums.split_at_mut(1);
        first[0] = 0;
        let mut total = 0_i32;
        if above.is_empty() {
            for (sum, &pixel) in row.iter_mut().zip(pixels) {
                total += i32::from(pixel);
                *sum = total;
            }
        } else {
            for ((sum, &pixel), &above) in row.iter_mut().zip(pixels).zip(&above[1..]) {
                total += i32::from(pixel);
                *sum = above.wrapping_add(total);
            }
        }
        above = sums;
    }
}

/// Adds what is above a part, and sorts its columns for the further octaves.
struct Sort<'a, 'b> {
    part: &'a mut Part<'b>,
    sizes: &'a [[usize; 2]],
    needed: &'a [Range<usize>],
}

impl Kernel for Sort<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Part { rows, carry, sums, sorted } = self.part;
        let sizes = self.sizes;
        for (k, row) in sums.chunks_exact_mut(carry.len()).enumerate() {
            if rows.start > 0 {
                row.iter_mut().zip(&*carry).for_each(|(sum, &carry)| *sum = sum.wrapping_add(carry));
            }
            let y = rows.start + k + 1;
            let mut from: &[i32] = row;
            for (octave, plane) in sorted.iter_mut().enumerate() {
                // A plane is made of the one before it, which must be there then.
                if !self.needed[octave + 1..].iter().any(|rows| rows.contains(&y)) {
                    break;
                }
                let [step, columns] = sizes[octave + 1];
                let to = &mut plane[k * step * columns..(k + 1) * step * columns];
                sort(from, sizes[octave], to, columns);
                from = to;
            }
        }
    }
}

/// Splits every stretch into its even and its odd places.
#[inline(always)]
fn sort(from: &[i32], [step, length]: [usize; 2], to: &mut [i32], columns: usize) {
    let (even, odd) = to.split_at_mut(step * columns);
    let targets = even.chunks_exact_mut(columns).zip(odd.chunks_exact_mut(columns));
    for (stretch, (even, odd)) in from.chunks_exact(length).zip(targets) {
        let (pairs, last) = stretch.as_chunks::<2>();
        for ((pair, even), odd) in pairs.iter().zip(&mut *even).zip(odd) {
            (*even, *odd) = (pair[0], pair[1]);
        }
        if let [last] = last {
            even[columns - 1] = *last;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_plane_holds_the_sums_of_all_pixels_above_and_left() {
        for (height, width) in [(1, 1), (3, 7), (20, 33), (9, 64)] {
            let shape = Shape::new(height, width).unwrap();
            let gray: Vec<u8> = (0..height * width).map(|i| (i * i * 31 % 256) as u8).collect();
            for threads in [1, 2, 7] {
                let mut planes: Vec<Plane> = (0..4).map(|_| Plane::default()).collect();
                let needed = [0..height + 1, 0..height + 1, 0..height + 1, 0..height + 1];
                fill(Simd::best(), &gray, shape, threads, &needed, &mut planes);
                for (x, y) in (0..=width).flat_map(|x| (0..=height).map(move |y| (x, y))) {
                    let pixels = (0..y).flat_map(|v| (0..x).map(move |u| (u, v)));
                    let sum: i32 = pixels.map(|(u, v)| i32::from(gray[v * width + u])).sum();
                    for plane in &planes {
                        assert_eq!(plane.sum([0, x], [0, y]), sum, "{height} x {width}, {}", plane.step);
                        assert_eq!(plane.sums[plane.place(x, y)], sum);
                    }
                }
            }
        }
    }
}
