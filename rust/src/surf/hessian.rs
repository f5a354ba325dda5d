//! Second derivatives by box filters, and the determinant of the Hessian.

use std::ops::Range;

use super::LANES;
use super::integral::Plane;

/// Relative weight of the mixed derivative: box filters see it a little too strongly.
const MIXED: f32 = 0.81;

/// The three box filters of one size.
///
/// On a filter of 9 pixels the boxes have their corners at these ninths of the side; on a larger one, at the
/// nearest pixels. The sides are multiples of 3, so that opposite boxes stay equal.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// Its side [px].
    pub(super) size: usize,
    /// Samples from the filter's corner to the sample that it is centred on.
    pub(super) margin: usize,
    corners: [usize; 10],
    /// One over the pixels of the boxes of a pure and of the mixed derivative.
    pure: f32,
    mixed: f32,
}

impl Filter {
    /// The filter of a layer of an octave, both counted from 0.
    pub(super) fn new(octave: usize, layer: usize) -> Self {
        let size = Self::size_of(octave, layer);
        // To the nearest; a ninth of the side is a whole number of thirds, so nothing is halfway.
        let corners = std::array::from_fn(|k| (2 * k * size + 9) / 18);
        let (third, height) = (size / 3, corners[7] - corners[2]);
        Self {
            size,
            margin: size / 2 >> octave,
            corners,
            pure: 1.0 / (third * height) as f32,
            mixed: 1.0 / (third * third) as f32,
        }
    }

    /// The side of that filter [px].
    pub(super) fn size_of(octave: usize, layer: usize) -> usize {
        (9 + 6 * layer) << octave
    }

    /// Writes the determinants at the samples `columns` of row `i`, and of as many more as fill the last vector.
    #[inline(always)]
    pub(super) fn row(
        &self,
        plane: &Plane,
        i: usize,
        columns: Range<usize>,
        space: &mut [Vec<[i32; LANES]>; 2],
        out: &mut [f32],
    ) {
        let corner = [columns.start, i].map(|at| (at - self.margin) * plane.step());
        let [xx, yy] = space;
        let blocks = columns.len().div_ceil(LANES);
        let c = &self.corners;
        let boxes = |x: [usize; 4], y: [usize; 4]| {
            Boxes::at(plane, x.map(|k| corner[0] + c[k]), y.map(|k| corner[1] + c[k]), blocks)
        };
        // One at a time: more than eight streams at once would not fit the registers.
        let wide = boxes([0, 9, 3, 6], [2, 7, 2, 7]);
        for (k, xx) in xx[..blocks].iter_mut().enumerate() {
            *xx = wide.combined(k, |all, middle| all.wrapping_sub(middle.wrapping_mul(3)));
        }
        let high = boxes([2, 7, 2, 7], [0, 9, 3, 6]);
        for (k, yy) in yy[..blocks].iter_mut().enumerate() {
            *yy = high.combined(k, |all, middle| all.wrapping_sub(middle.wrapping_mul(3)));
        }
        let product = self.pure * self.pure;
        let out = &mut out.as_chunks_mut::<LANES>().0[..blocks];
        for ((out, xx), yy) in out.iter_mut().zip(&xx[..blocks]).zip(&yy[..blocks]) {
            for ((out, &xx), &yy) in out.iter_mut().zip(xx).zip(yy) {
                *out = xx as f32 * yy as f32 * product;
            }
        }
        let upper = boxes([1, 4, 5, 8], [1, 4, 1, 4]);
        for (k, xy) in xx[..blocks].iter_mut().enumerate() {
            *xy = upper.combined(k, i32::wrapping_sub);
        }
        let lower = boxes([5, 8, 1, 4], [5, 8, 5, 8]);
        let factor = MIXED * (self.mixed * self.mixed);
        for (k, (out, upper)) in out.iter_mut().zip(&xx[..blocks]).enumerate() {
            let lower = lower.combined(k, i32::wrapping_sub);
            for ((out, &lower), &upper) in out.iter_mut().zip(&lower).zip(upper) {
                let xy = lower.wrapping_add(upper) as f32;
                *out -= xy * xy * factor;
            }
        }
    }

    /// Whether the trace at a sample is positive (1), negative (-1) or zero (0).
    pub(super) fn laplacian(&self, plane: &Plane, i: usize, j: usize) -> i32 {
        let [x, y] = [j, i].map(|at| (at - self.margin) * plane.step());
        let c = &self.corners;
        let sum = |a: usize, b: usize, top: usize, bottom: usize| {
            plane.sum([x + c[a], x + c[b]], [y + c[top], y + c[bottom]])
        };
        let xx = sum(0, 9, 2, 7) - 3 * sum(3, 6, 2, 7);
        let yy = sum(2, 7, 0, 9) - 3 * sum(2, 7, 3, 6);
        (xx + yy).signum()
    }
}

/// The corners of two boxes along a row: the first has its columns and rows in front, the second behind.
struct Boxes<'a>([&'a [[i32; LANES]]; 8]);

impl<'a> Boxes<'a> {
    #[inline(always)]
    fn at(plane: &'a Plane, x: [usize; 4], y: [usize; 4], blocks: usize) -> Self {
        let at = |x, y| &plane.along(x, y)[..blocks];
        Self([
            at(x[0], y[0]),
            at(x[1], y[0]),
            at(x[0], y[1]),
            at(x[1], y[1]),
            at(x[2], y[2]),
            at(x[3], y[2]),
            at(x[2], y[3]),
            at(x[3], y[3]),
        ])
    }

    /// One vector of both sums, combined.
    #[inline(always)]
    fn combined(&self, k: usize, combine: impl Fn(i32, i32) -> i32) -> [i32; LANES] {
        let [a, b, c, d, e, f, g, h] = self.0.map(|stream| &stream[k]);
        std::array::from_fn(|i| {
            let first = (d[i].wrapping_sub(c[i])).wrapping_sub(b[i].wrapping_sub(a[i]));
            let second = (h[i].wrapping_sub(g[i])).wrapping_sub(f[i].wrapping_sub(e[i]));
            combine(first, second)
        })
    }
}
